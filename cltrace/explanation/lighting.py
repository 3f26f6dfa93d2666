"""What each light adds at a point, and what is in its way."""

from __future__ import annotations

import math
from itertools import groupby

from cltrace.explanation.names import Names
from cltrace.explanation.record import AmbientTerm, LightTerm, Met, SoftTerm, total
from cltrace.explanation.space import Space
from cltrace.explanation.triples import triple
from cltrace.reference import Direction, Intersection, Light, World
from cltrace.reference.lights import SpotLight
from cltrace.reference.records import Illumination, Shading
from cltrace.reference.ways import Meeting, behind, blockers
from cltrace.scene import AMBIENT, SOFT, Scene

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
