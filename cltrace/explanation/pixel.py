"""Explains a pixel: the reference tracer decides, and all that it goes by is written down."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby, product

import numpy as np

from cltrace.base.errors import TooManyRaysError
from cltrace.explanation.explanation import Explanation
from cltrace.explanation.record import (
    AmbientTerm,
    Bounce,
    CameraRay,
    Hit,
    LightTerm,
    Met,
    Placement,
    SoftTerm,
    SurfaceTest,
    Term,
    Texel,
    TextureLookup,
    TracedRay,
    total,
)
from cltrace.explanation.textbook import KINDS, Triple, textbook_of, triple
from cltrace.explanation.textbook import number as written
from cltrace.explanation.words import Names
from cltrace.reference import Direction, Intersection, Pixel, Point, Ray, Start, Surface, Texture, byte_of, world_of
from cltrace.reference.lights import SpotLight
from cltrace.reference.rays import view_of
from cltrace.reference.surfaces import UV
from cltrace.reference.trace import Illumination, Shading, Sight, closest_hit, follow, primary_ray, trace
from cltrace.reference.ways import Meeting, behind, blockers, meetings
from cltrace.scene import AMBIENT, SOFT, AnyCamera, Camera, Orthographic, Scene
from cltrace.scene.colors import encoded

# Of a material, as of Hit.
NUMBERS = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index")
FAINT = 1 / 512  # weight of a ray below which even full white is less than half a level
MOST_MET = 8  # surfaces that are listed of a ray
MOST_BETWEEN = 3  # surfaces that are listed between a point and a light
TIED = "exactly as near as the closest one, which is seen because of its lower number, or that of its triangle"


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


class Space:
    """The eye and the axes of a camera, in the world."""

    def __init__(self, camera: AnyCamera) -> None:
        self.eye, self.view = Point(*camera.position), view_of(camera)

    def turned(self, d: Direction) -> Direction:
        """A direction of camera space in the world, with length 1."""
        return (self.view.B.T @ d).normalized()

    def start(self, ray: Ray) -> Point:
        """Where a ray starts, in the world, rounded."""
        return ray.origin.place + ray.origin.step if isinstance(ray.origin, Start) else self.eye


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
            rays=tuple(self._rays("primary", primary_ray(camera, x, y), beside=(x, y))),
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

    def _rays(
        self,
        kind: str,
        ray: Ray,
        weight: float = 1.0,
        depth: int = 0,
        place: int = 0,
        beside: tuple[int, int] | None = None,
    ) -> list[TracedRay]:
        """A ray, with its place among all, and those that go on from it. beside: the pixel whose own ray it is."""
        sight = follow(self.world, ray, weight, depth)
        at, shading, share = sight.at, sight.shading, sight.share
        goes_on = at is not None and at.material.passes_on and not sight.last
        ambient = self._ambient_terms(at) if at and shading else ()
        lights = self._light_terms(at, shading) if at and shading else ()
        local_terms = _local_terms(ambient, lights)
        on, further = self._bounces(sight, weight, depth, place) if goes_on else ((), [])
        if at is None:
            terms: tuple[Term, ...] = (Term("background_color", self.world.background),)
        else:
            terms = _mixed(share, _sum(local_terms), on) if goes_on else local_terms
        met, length = meetings(self.world, ray, at), ray.direction.length()
        missed = self._seen_beside(*beside, at, {one.surface.number for one in met}) if beside else ()
        record = TracedRay(
            kind=kind,
            depth=depth,
            weight=weight,
            origin=triple(self.space.start(ray)),
            direction=triple(self.space.turned(ray.direction)),
            tests=tuple(self._test(ray, one.surface, one.t * length, tied=one.tied) for one in met[:MOST_MET]),
            meets=len(met),
            missed=tuple(self._test(ray, surface, math.inf) for surface in missed),
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

    def _seen_beside(self, x: int, y: int, at: Intersection | None, met: set[int]) -> Iterable[Surface]:
        """What the eight pixels around one show before its own surface, if its ray does not meet that at all."""
        found: dict[int, Surface] = {}
        for dx, dy in product((-1, 0, 1), repeat=2):
            other = closest_hit(self.world, primary_ray(self.scene.camera, x + dx, y + dy))
            if other and other.index not in met and (at is None or other.distance < at.distance):
                found.setdefault(other.index, other.surface)
        return found.values()

    def _test(self, ray: Ray, surface: Surface, distance: float, tied: bool = False) -> SurfaceTest:
        own = isinstance(ray.origin, Start) and ray.origin.surface is surface
        textbook = textbook_of(surface).of(surface, self.space.start(ray), self.space.turned(ray.direction))
        remark = TIED if tied else _remark(textbook.first(own), distance, own)
        return SurfaceTest(self.names.surface(surface), textbook, distance=distance, remark=remark)

    def _bounces(
        self, sight: Sight, weight: float, depth: int, place: int
    ) -> tuple[tuple[Bounce, ...], list[TracedRay]]:
        """What goes on from a mirror or through glass, and all rays of that; place: of the ray that came."""
        assert sight.at is not None
        found: list[Bounce] = []
        rays: list[TracedRay] = []
        n = sight.at.normal
        for on in sight.bounces:
            further, share = Ray(on.start, on.direction), weight * on.share
            if share < FAINT:
                pixel = Pixel()
                trace(self.world, further, depth + 1, pixel)
                number, count, color = None, pixel.rays, pixel.color
            else:
                number, count = place + 1 + len(rays), 1
                more = self._rays(on.kind, further, share, depth + 1, number)
                rays += more
                color = more[0].color
            came, left = _angle(-sight.ray.direction, n), _angle(on.direction, -n if on.kind == "refracted" else n)
            seen = Bounce(on.kind, on.total, on.share, number, rays=count, color=color, angle_in=came, angle_out=left)
            found.append(seen)
        return tuple(found), rays

    def _ambient_terms(self, at: Intersection) -> tuple[AmbientTerm, ...]:
        terms = []
        for i in np.flatnonzero(self.scene.lights["kind"] == AMBIENT).tolist():
            red, green, blue = self.scene.lights["color"][i].tolist()
            r, g, b = (at.material.ka * L * c for L, c in zip((red, green, blue), at.color, strict=True))
            terms.append(AmbientTerm(self.names.light(i), (red, green, blue), (r, g, b)))
        return tuple(terms)

    def _light_terms(self, at: Intersection, shading: Shading) -> tuple[LightTerm | SoftTerm, ...]:
        """One for each light but the ambient ones, in the order of the file; a soft one's has those of its members."""
        numbers = self.scene.lamp_of[self.scene.lamps["kind"] != AMBIENT].tolist()
        terms = [self._light_term(at, number, of) for number, of in zip(numbers, shading.lights, strict=True)]
        found: list[LightTerm | SoftTerm] = []
        for number, some in groupby(terms, key=lambda term: term.light.number):
            members = tuple(some)
            soft = SoftTerm(members[0].light, total(one.L for one in members), members)
            found.append(soft if self.scene.lights["kind"][number] in SOFT else members[0])
        return tuple(found)

    def _light_term(self, at: Intersection, number: int, of: Illumination) -> LightTerm:
        light, cone = of.light, None
        if isinstance(light, SpotLight):
            cone = math.degrees(light.off_axis(of.l)), math.degrees(light.alpha1), math.degrees(light.alpha2)
        between = blockers(self.world, at, of) if of.fate == "in shadow" else []
        beyond = behind(self.world, at, of) if of.fate == "lit" and not light.parallel else None
        return LightTerm(
            light=self.names.light(number),
            L=light.color,
            fate=of.fate,
            l=triple(self.space.turned(of.l)),
            distance=math.inf if light.parallel else of.w.length(),
            n_l=of.n_l,
            cone=cone,
            strength=of.strength,
            between=tuple(self._met(at, meeting, of.w) for meeting in between[:MOST_BETWEEN]),
            blockers=len(between),
            behind=self._met(at, beyond, of.w) if beyond else None,
            r=triple(self.space.turned(of.r)),
            r_v=of.r_v,
            diffuse=of.diffuse,
            specular=of.specular,
        )

    def _met(self, at: Intersection, meeting: Meeting, w: Direction) -> Met:
        """A surface on the way w from a point to a light."""
        name, distance = self.names.surface(meeting.surface), meeting.t * w.length()
        start = at.start.place + at.start.step
        return Met(name, distance, triple(start + self.space.turned(w) * distance) if math.isfinite(distance) else None)

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


def _remark(textbook: float, exact: float, own: bool) -> str:
    """What to say where exact arithmetic differs from a textbook's number in what is printed of it."""
    if math.isinf(exact):
        return "" if math.isinf(textbook) else "exactly, it passes by: these numbers are rounded"
    if math.isinf(textbook):
        return f"exactly, it is met, at t = {written(exact)}: these numbers are rounded"
    if written(textbook) != written(exact):
        return f"exactly, t = {written(exact)}: these numbers are rounded"
    return "the one that is all but 0 is where the ray starts, and does not count: code takes an epsilon" if own else ""


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
