"""What rays meet and what lights add, in the words of the scene's file: kinds, numbers and lines."""

from __future__ import annotations

import math
from itertools import groupby

from cltrace.explanation.record import AmbientTerm, LightName, LightTerm, Met, SoftTerm, SurfaceName, SurfaceTest, total
from cltrace.explanation.textbook import Footprint, textbook_of
from cltrace.explanation.triples import number, triple
from cltrace.reference import Direction, Intersection, Light, Point, Ray, Start, Surface, World
from cltrace.reference.lights import SpotLight
from cltrace.reference.rays import view_of
from cltrace.reference.records import Illumination, Shading
from cltrace.reference.ways import Meeting, behind, blockers, meetings
from cltrace.scene import AMBIENT, BALL, LAMBERT, PANEL, PARALLEL, POINT, SKY, SOFT, SPOT, SUN, AnyCamera, Scene

LIGHT_NAMES = {
    AMBIENT: "ambient_light",
    PARALLEL: "parallel_light",
    POINT: "point_light",
    SPOT: "spot_light",
    LAMBERT: "lambert_light",
    SKY: "sky_light",
    SUN: "sun_light",
    BALL: "ball_light",
    PANEL: "panel_light",
}


class Names:
    """What the surfaces, lights and textures of a scene are called."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.source = scene, scene.source

    def surface(self, surface: Surface) -> SurfaceName:
        number = surface.number
        line = int(self.source.surfaces[number]) if self.source else 0
        file = self.source.meshes.get(number) if self.source else None
        face_line = int(file.lines[surface.primitive]) if file and surface.primitive >= 0 else 0
        name = file.name if file else ""
        return SurfaceName(surface.kind, number, line, file=name, primitive=surface.primitive, face_line=face_line)

    def light(self, number: int) -> LightName:
        """number: among all lights of the scene."""
        line = int(self.source.lights[number]) if self.source else 0
        return LightName(LIGHT_NAMES[int(self.scene.lights[number]["kind"])], number, line)

    def texture(self, index: int) -> str:
        return self.source.textures[index] if self.source else ""


class Space:
    """The eye and the axes of a camera. pixel: the width of a pixel in the middle of the picture, at distance 1 or, of
    parallel rays, anywhere."""

    def __init__(self, camera: AnyCamera) -> None:
        self.eye, self.view = Point(*camera.position), view_of(camera)
        self.pixel, self.parallel = 2 * camera.image_plane()[0] / camera.resolution[0], camera.parallel

    def footprint(self, behind: float) -> Footprint:
        """Of a ray that starts so far from the eye, along the rays before."""
        return Footprint(self.pixel, 0.0) if self.parallel else Footprint(self.pixel * behind, self.pixel)

    def turned(self, d: Direction) -> Direction:
        """A direction of camera space in the world, with length 1."""
        return (self.view.B.T @ d).normalized()

    def start(self, ray: Ray) -> Point:
        """Where a ray starts, in the world, rounded."""
        return ray.origin.place + ray.origin.step if isinstance(ray.origin, Start) else self.eye


MOST = 8  # surfaces that are listed of a ray
TIED = "exactly as near as the closest one, which is seen because of its lower number, or that of its triangle"


class Meetings:
    """A ray among the surfaces of a world.

    found: those that it meets, closest first, at most MOST; count: how many these are in all.
    """

    def __init__(self, world: World, space: Space, names: Names, ray: Ray, at: Intersection | None) -> None:
        """at: what the ray meets first."""
        self.world, self.names, self.ray, self.at = world, names, ray, at
        self.o, self.d, self.space = space.start(ray), space.turned(ray.direction), space
        length, met = ray.direction.length(), meetings(world, ray, at)
        self.count, self._numbers = len(met), {meeting.surface.number for meeting in met}
        self.found = tuple(self._test(one.surface, one.t * length, tied=one.tied) for one in met[:MOST])

    def missed(self, behind: float) -> tuple[SurfaceTest, ...]:
        """The surfaces that the ray passes by, before what it meets, by less than a pixel's width there.

        behind: how far it is from the eye to the ray's start, along the rays before.
        """
        close, pixel = [], self.space.footprint(behind)
        for whole in self.world.surfaces:
            row = textbook_of(whole)
            for surface in row.beside(whole, self.o, self.d, pixel):
                if surface.number in self._numbers or self._starts_on(surface):
                    continue
                gap, t, single = row.gap(surface, self.o, self.d)
                pixels = gap / pixel.at(t) if 0 < t < (self.at.distance if self.at else math.inf) else 1.0
                if 0 <= pixels < 1:
                    close.append((pixels, single))
        close.sort(key=lambda one: one[0])
        return tuple(self._test(surface, math.inf, pixels) for pixels, surface in close[:MOST])

    def _starts_on(self, surface: Surface) -> bool:
        return isinstance(self.ray.origin, Start) and self.ray.origin.surface is surface

    def _test(self, surface: Surface, distance: float, gap: float = 0.0, tied: bool = False) -> SurfaceTest:
        own, textbook = self._starts_on(surface), textbook_of(surface).of(surface, self.o, self.d)
        remark = TIED if tied else _remark(textbook.first(own), distance, own)
        return SurfaceTest(self.names.surface(surface), textbook, distance=distance, gap=gap, remark=remark)


def _remark(textbook: float, exact: float, own: bool) -> str:
    """What to say where exact arithmetic differs from a textbook's number in what is printed of it."""
    if math.isinf(exact):
        return "" if math.isinf(textbook) else "exactly, it passes by: these numbers are rounded"
    if math.isinf(textbook):
        return f"exactly, it is met, at t = {number(exact)}: these numbers are rounded"
    if number(textbook) != number(exact):
        return f"exactly, t = {number(exact)}: these numbers are rounded"
    return "the one that is all but 0 is where the ray starts, and does not count: code takes an epsilon" if own else ""


LISTED = 3  # surfaces that are listed between a point and a light


def ambient_terms(scene: Scene, names: Names, at: Intersection) -> tuple[AmbientTerm, ...]:
    terms = []
    for i, light in enumerate(scene.lights):
        if light["kind"] == AMBIENT:
            red, green, blue = light["color"].tolist()
            r, g, b = (at.material.ka * L * c for L, c in zip((red, green, blue), at.color, strict=True))
            terms.append(AmbientTerm(names.light(i), (red, green, blue), (r, g, b)))
    return tuple(terms)


def light_terms(
    scene: Scene, world: World, space: Space, names: Names, at: Intersection, shading: Shading
) -> tuple[LightTerm | SoftTerm, ...]:
    """One for each light but the ambient ones, in the order of the file."""
    numbers = scene.lamp_of[scene.lamps["kind"] != AMBIENT].tolist()
    lamp = _Lamp(world, space, names, at)
    terms = [lamp.term(number, of) for number, of in zip(numbers, shading.lights, strict=True)]
    return tuple(_whole(scene, tuple(some)) for _, some in groupby(terms, key=lambda term: term.light.number))


def _whole(scene: Scene, terms: tuple[LightTerm, ...]) -> LightTerm | SoftTerm:
    """What one light adds. terms: of its members, or of itself if it is not soft."""
    light = terms[0].light
    if scene.lights["kind"][light.number] not in SOFT:
        return terms[0]
    return SoftTerm(light, total(term.L for term in terms), terms)


class _Lamp:
    """A point and the lights that may shine on it."""

    def __init__(self, world: World, space: Space, names: Names, at: Intersection) -> None:
        self.world, self.space, self.names, self.at = world, space, names, at

    def term(self, number: int, of: Illumination) -> LightTerm:
        light, l = of.light, of.l  # noqa: E741
        between = blockers(self.world, self.at, of) if of.fate == "in shadow" else []
        beyond = behind(self.world, self.at, of) if of.fate == "lit" and not light.parallel else None
        return LightTerm(
            light=self.names.light(number),
            L=light.color,
            fate=of.fate,
            l=triple(self.space.turned(l)),
            distance=math.inf if light.parallel else of.w.length(),
            n_l=of.n_l,
            cone=self._cone(light, l),
            strength=of.strength,
            between=tuple(self._met(meeting, of.w) for meeting in between[:LISTED]),
            blockers=len(between),
            behind=self._met(beyond, of.w) if beyond else None,
            r=triple(self.space.turned(of.r)),
            r_v=of.r_v,
            diffuse=of.diffuse,
            specular=of.specular,
        )

    def _cone(self, light: Light, l: Direction) -> tuple[float, float, float] | None:  # noqa: E741
        if not isinstance(light, SpotLight):
            return None
        return math.degrees(light.off_axis(l)), math.degrees(light.alpha1), math.degrees(light.alpha2)

    def _met(self, meeting: Meeting, w: Direction) -> Met:
        name = self.names.surface(meeting.surface)
        if math.isinf(meeting.t):
            return Met(name, math.inf, None)
        distance = meeting.t * w.length()
        start = self.at.start.place + self.at.start.step
        return Met(name, distance, triple(start + self.space.turned(w) * distance))
