"""Explains a pixel: the reference tracer decides, and all that it goes by is written down."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cltrace.base.errors import TooManyRaysError
from cltrace.explanation.explanation import Explanation
from cltrace.explanation.facts import Meetings, Names, Space, ambient_terms, light_terms
from cltrace.explanation.record import (
    AmbientTerm,
    Bounce,
    CameraRay,
    Hit,
    LightTerm,
    Placement,
    SoftTerm,
    Term,
    Texel,
    TextureLookup,
    TracedRay,
    total,
)
from cltrace.explanation.textbook import KINDS
from cltrace.explanation.triples import Triple, triple
from cltrace.explanation.triples import number as written
from cltrace.reference import (
    Direction,
    Intersection,
    Pixel,
    Ray,
    Texture,
    byte_of,
    world_of,
)
from cltrace.reference.records import Sight
from cltrace.reference.surfaces import UV
from cltrace.reference.trace import follow, primary_ray, trace
from cltrace.scene import Camera, Orthographic, Scene
from cltrace.scene.colors import encoded

# Of a material, as of Hit.
NUMBERS = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index")
FAINT = 1 / 512  # weight of a ray below which even full white is less than half a level


def explain(scene: Scene, x: int, y: int, *, truncate: bool = False, square_pixels: bool = False) -> Explanation:
    """Why a pixel has its colour: every number on the way, in the order and words of the course's tutorial.

    x, y: the pixel's column and row, from the top left, from 0; truncate: whether bytes are 255 c cut to a whole number
    instead of rounded, as in render(); square_pixels: whether a pixel is as wide as it is high, even if the scene's
    camera has it otherwise. `print()` of what comes back is the text of `cltrace SCENE.xml --explain X,Y`; its fields
    are described in cltrace.explanation.record, and `to_json()` writes them.

    It takes no device: the reference tracer finds what each ray meets. The bytes are the reference's.

    Raises TypeError if scene is not a Scene, ValueError if the pixel is not in its picture, and TooManyRaysError as
    Renderer.render() does.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene: must be a cltrace.Scene, such as cltrace.load() gives, got {scene!r}")
    if square_pixels and isinstance(scene.camera, Camera):
        scene = scene.seen_by(replace(scene.camera, square_pixels=True))
    return Explainer(scene).pixel(x, y, truncate)


class Explainer:
    """A scene, of which several pixels are explained."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.world = scene, world_of(scene, KINDS)
        self.names, self.space = Names(scene), Space(scene.camera)

    def pixel(self, x: int, y: int, truncate: bool = False) -> Explanation:
        """See explain(), which raises the same."""
        camera = self.scene.camera
        for name, value, most in zip("xy", (x, y), camera.resolution, strict=True):
            if not isinstance(value, (int, np.integer)) or isinstance(value, bool) or not 0 <= value < most:
                raise ValueError(f"{name}: must be a whole number within 0..{most - 1}, got {value!r}")
        x, y = int(x), int(y)
        try:
            color, _ = trace(self.world, primary_ray(camera, x, y))
        except ValueError:  # the only one: there is no end to the rays
            raise TooManyRaysError((x, y), Pixel.RAYS, camera.max_bounces) from None
        red, green, blue = (byte_of(c, truncate) for c in encoded(color, self.scene.transfer))
        return Explanation(
            path=self.scene.source.path if self.scene.source else "",
            x=x,
            y=y,
            width=camera.resolution[0],
            height=camera.resolution[1],
            max_bounces=camera.max_bounces,
            surfaces=sum(map(len, self.scene.shapes)),
            camera=self._camera_ray(x, y),
            rays=tuple(self._primary(x, y)),
            color=color,
            rgb8=(red, green, blue),
            truncate=truncate,
            transfer=self.scene.transfer,
        )

    def _camera_ray(self, x: int, y: int) -> CameraRay:
        """The tutorial's formulas, with v from the bottom, so that y_i is upwards as they have it."""
        camera = self.scene.camera
        (width, height), (half_width, half_height) = camera.resolution, camera.image_plane()
        u, v = x, height - 1 - y
        x_n, y_n = (u + 0.5) / width, (v + 0.5) / height
        x_i, y_i = (2 * x_n - 1) * half_width, (2 * y_n - 1) * half_height
        fov_x, fov_y, square = 0.0, 0.0, True
        d = Direction(0.0, 0.0, -1.0)
        if isinstance(camera, Camera):
            (fov_x, fov_y), square = camera.half_angles(), camera.square_pixels
            d = Direction(x_i, y_i, -1.0).normalized()
        return CameraRay(
            u=u,
            v=v,
            x_n=x_n,
            y_n=y_n,
            fov_x=fov_x,
            fov_y=fov_y,
            square_pixels=square,
            height=camera.height if isinstance(camera, Orthographic) else None,
            x_i=x_i,
            y_i=y_i,
            direction=triple(d),
            axes=camera.basis(),
            line=self.scene.source.camera if self.scene.source else 0,
        )

    def _primary(self, x: int, y: int) -> list[TracedRay]:
        """The pixel's ray, and all that go on from it."""
        ray = primary_ray(self.scene.camera, x, y)
        return self._rays(_Way("primary", ray), 0)

    def _rays(self, way: _Way, place: int) -> list[TracedRay]:
        """A ray, with its place among all, and those that go on from it."""
        sight = follow(self.world, way.ray, way.weight, way.depth)
        ray, at, shading, share = way.ray, sight.at, sight.shading, sight.share
        goes_on = at is not None and at.material.passes_on and not sight.last
        ambient = ambient_terms(self.scene, self.names, at) if at and shading else ()
        lights = light_terms(self.scene, self.world, self.space, self.names, at, shading) if at and shading else ()
        local_terms = _local_terms(ambient, lights)
        on, further = self._bounces(way, sight, place) if goes_on else ((), [])
        if at is None:
            terms: tuple[Term, ...] = (Term("background_color", self.world.background),)
        else:
            terms = _mixed(share, _sum(local_terms), on) if goes_on else local_terms
        meetings = Meetings(self.world, self.space, self.names, ray, at)
        record = TracedRay(
            kind=way.kind,
            depth=way.depth,
            weight=way.weight,
            origin=triple(self.space.start(ray)),
            direction=triple(self.space.turned(ray.direction)),
            tests=meetings.found,
            meets=meetings.count,
            missed=meetings.missed(way.behind),
            hit=self._hit(at, ray) if at else None,
            ambient=ambient,
            lights=lights,
            local_terms=local_terms,
            local=_sum(local_terms),
            share=share,
            last=sight.last,
            bounces=on,
            terms=terms,
            color=_sum(terms),
        )
        return [record, *further]

    def _bounces(self, way: _Way, sight: Sight, place: int) -> tuple[tuple[Bounce, ...], list[TracedRay]]:
        """What goes on from a mirror or through glass, and all rays of that; place: of the ray that came."""
        assert sight.at is not None
        found: list[Bounce] = []
        rays: list[TracedRay] = []
        n = sight.at.normal
        for on in sight.bounces:
            further, weight = Ray(on.start, on.direction), way.weight * on.share
            if weight < FAINT:
                pixel = Pixel()
                trace(self.world, further, way.depth + 1, pixel)
                number, count, color = None, pixel.rays, pixel.color
            else:
                number, count = place + 1 + len(rays), 1
                behind = way.behind + sight.at.distance
                more = self._rays(_Way(on.kind, further, weight, depth=way.depth + 1, behind=behind), number)
                rays += more
                color = more[0].color
            came, left = _angle(-way.ray.direction, n), _angle(on.direction, -n if on.kind == "refracted" else n)
            seen = Bounce(on.kind, on.total, on.share, number, rays=count, color=color, angle_in=came, angle_out=left)
            found.append(seen)
        return tuple(found), rays

    def _hit(self, at: Intersection, ray: Ray) -> Hit:
        m = at.material
        return Hit(
            surface=self.names.surface(at.surface),
            shape=at.surface.shape,
            t=at.distance,
            point=triple(at.start.place + at.start.step),
            normal=triple(self.space.turned(at.normal)),
            turned=at.turned,
            inside=at.inside,
            placement=self._placement(at.surface.number, ray),
            color=at.color,
            texture=self._texture(m.texture, at.uv) if m.texture else None,
            **{name: getattr(m, name) for name in NUMBERS},
        )

    def _texture(self, texture: Texture, uv: UV) -> TextureLookup:
        height, width = texture.texels.shape[:2]
        place = next(i for i, texels in enumerate(self.scene.textures) if texels is texture.texels)
        found = texture.lookup(uv)
        texels = tuple(
            Texel((found.x + i) % width, (found.y + j) % height, part * share, texture.texel(found.x + i, found.y + j))
            for j, part in enumerate((1 - found.down, found.down))
            for i, share in enumerate((1 - found.right, found.right))
        )
        return TextureLookup(self.names.texture(place), (width, height), uv, **found._asdict(), texels=texels)

    def _placement(self, number: int, ray: Ray) -> Placement | None:
        """What the transform of a surface makes of it; None where it has none, or is not known."""
        steps = self.scene.source.transforms.get(number) if self.scene.source else None
        if steps is None:
            return None
        matrix = np.eye(4)
        for step in steps:
            matrix = matrix @ np.concatenate([step, [[0.0, 0.0, 0.0, 1.0]]])
        inverse = np.linalg.inv(matrix)[:3]
        o, d = np.array(triple(self.space.start(ray))), np.array(triple(self.space.turned(ray.direction)))
        (x, y, z), (dx, dy, dz) = (inverse[:, :3] @ o + inverse[:, 3]).tolist(), (inverse[:, :3] @ d).tolist()
        rows, back = (tuple(map(tuple, rows)) for rows in (matrix[:3].tolist(), inverse.tolist()))
        return Placement(rows, back, (x, y, z), (dx, dy, dz))


@dataclass(frozen=True)
class _Way:
    """A ray on its way: its share of the pixel, how many bounces and what distance lie behind it."""

    kind: str
    ray: Ray
    weight: float = 1.0
    depth: int = 0
    behind: float = 0.0


def _local_terms(ambient: tuple[AmbientTerm, ...], lights: tuple[LightTerm | SoftTerm, ...]) -> tuple[Term, ...]:
    terms = [Term(f"{term.light.kind} {term.light.number}", term.color) for term in ambient]
    for light in lights:
        if light.fate == "lit":
            name = f"{light.light.kind} {light.light.number}"
            terms += [Term(f"{name}, diffuse", light.diffuse), Term(f"{name}, specular", light.specular)]
    return tuple(terms)


def _mixed(share: float, local: Triple, bounces: tuple[Bounce, ...]) -> tuple[Term, ...]:
    """The colour of a point that passes light on: shares of its own colour and of what the further rays see."""
    terms = [Term(f"{written(share)} x local color", _times(share, local))] if share else []
    for bounce in bounces:
        what = f"the {bounce.kind} ray" if bounce.ray is None else f"ray {bounce.ray}, {bounce.kind}"
        terms.append(Term(f"{written(bounce.share)} x {what}", _times(bounce.share, bounce.color)))
    return tuple(terms)


def _times(share: float, color: Triple) -> Triple:
    red, green, blue = (share * c for c in color)
    return (red, green, blue)


def _sum(terms: Iterable[Term]) -> Triple:
    return total(term.color for term in terms)


def _angle(a: Direction, b: Direction) -> float:
    """Between two directions, in degrees."""
    return math.degrees(math.atan2(a.cross(b).length(), a.dot(b)))
