"""What each light adds at a point, and what is in its way."""

from __future__ import annotations

import math
from collections.abc import Iterator

from cltrace.explanation.meeting import single
from cltrace.explanation.names import Names
from cltrace.explanation.record import AmbientTerm, Fate, LightTerm, Met, Triple
from cltrace.explanation.space import Space, triple
from cltrace.reference import Direction, Intersection, Light, Ray, ShadowRay, Surface, World, illuminate
from cltrace.reference.crossing import shadow_way
from cltrace.reference.groups import Group
from cltrace.reference.surfaces import first_met
from cltrace.reference.trace import BLACK, faces
from cltrace.scene import AMBIENT, Scene

FEW = 3  # surfaces that are listed between a point and a light


def ambient_terms(scene: Scene, names: Names, at: Intersection) -> tuple[AmbientTerm, ...]:
    terms = []
    for i, light in enumerate(scene.lights):
        if light["kind"] == AMBIENT:
            red, green, blue = light["color"].tolist()
            r, g, b = (at.material.ka * L * c for L, c in zip((red, green, blue), at.color, strict=True))
            terms.append(AmbientTerm(names.light(i), (red, green, blue), (r, g, b)))
    return tuple(terms)


def light_terms(
    scene: Scene, world: World, space: Space, names: Names, ray: Ray, at: Intersection
) -> tuple[LightTerm, ...]:
    """One for each light but the ambient ones, in the order of the file."""
    numbers = [i for i, light in enumerate(scene.lights) if light["kind"] != AMBIENT]
    lamp = _Lamp(world, space, names, ray, at)
    return tuple(lamp.term(number, light) for number, light in zip(numbers, world.lights, strict=True))


class _Lamp:
    """A point that is looked at along a ray, and the lights that may shine on it."""

    def __init__(self, world: World, space: Space, names: Names, ray: Ray, at: Intersection) -> None:
        self.world, self.space, self.names, self.ray, self.at = world, space, names, ray, at

    def term(self, number: int, light: Light) -> LightTerm:
        w, n = light.direction_from(self.at.start), self.at.normal
        l = w.normalized() if any(w) else n  # noqa: E741
        n_l = n.dot(l)
        r = n * (2 * n_l) - l
        strength = light.strength(w) if any(w) else 0.0
        fate: Fate = "behind" if any(w) else "at the point"
        blockers: list[Met] = []
        if any(w) and faces(self.at, light):
            fate = "beside the cone" if strength == 0 else "lit"
        if fate == "lit":
            blockers = self._blockers(light, w)
            fate = "in shadow" if blockers else "lit" if n_l > 0 else "behind"
        diffuse, specular = self._phong(light, strength * n_l) if fate == "lit" else (BLACK, BLACK)
        return LightTerm(
            light=self.names.light(number),
            L=light.color,
            fate=fate,
            l=triple(self.space.turned(l)),
            distance=math.inf if light.parallel else w.length(),
            n_l=n_l,
            cone=self._cone(light, l),
            strength=strength,
            between=tuple(blockers[:FEW]),
            blockers=len(blockers),
            behind=self._behind(w) if fate == "lit" and not light.parallel else None,
            r=triple(self.space.turned(r)),
            r_v=-r.dot(self.ray.direction.normalized()),
            diffuse=diffuse,
            specular=specular,
        )

    def _cone(self, light: Light, l: Direction) -> tuple[float, float, float] | None:  # noqa: E741
        if light.axis is None or light.alpha1 is None or light.alpha2 is None:
            return None
        off = math.atan2(light.axis.cross(l).length(), -light.axis.dot(l))
        return math.degrees(off), math.degrees(light.alpha1), math.degrees(light.alpha2)

    def _phong(self, light: Light, share: float) -> tuple[Triple, Triple]:
        """The diffuse and the specular term of a light that reaches the point: they add up to what it adds."""
        m, color = self.at.material, illuminate(self.world, self.ray, self.at, light)
        diffuse = [m.kd * c * min(1.0, share) * L for c, L in zip(self.at.color, light.color, strict=True)]
        r, g, b = diffuse
        x, y, z = (max(0.0, whole - part) if m.ks else 0.0 for whole, part in zip(color, diffuse, strict=True))
        return (r, g, b), (x, y, z)

    def _blockers(self, light: Light, w: Direction) -> list[Met]:
        """The surfaces between the point and the light, nearest first."""
        shadow = ShadowRay(self.at.start, self.at.inside, light)
        found = [surface for surface in self._single(shadow) if surface.blocks(shadow)]
        return sorted((self._met(surface, w) for surface in found), key=lambda met: met.distance)

    def _single(self, shadow: ShadowRay) -> Iterator[Surface]:
        for surface in self.world.surfaces:
            if isinstance(surface, Group):
                yield from surface.near(shadow_way(shadow))
            else:
                yield surface

    def _met(self, surface: Surface, w: Direction) -> Met:
        name, ray = self.names.surface(surface), Ray(self.at.start, w)
        t = surface.intersect(ray)
        if t is None:  # At an edge, a ray that comes from the light may meet what one that leads to it passes by.
            return Met(name, math.inf, None)
        distance = t * w.length()
        return Met(name, distance, triple(self.space.start(ray) + self.space.turned(w) * distance))

    def _behind(self, w: Direction) -> Met | None:
        """The first surface on the way to a light that nothing hides, which is behind it."""
        first = first_met(single(self.world, Ray(self.at.start, w)), Ray(self.at.start, w))
        return self._met(first[1], w) if first else None
