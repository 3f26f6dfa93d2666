"""All that is on a ray's way, not the first alone: for those who ask why."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray
from cltrace.reference.records import Illumination
from cltrace.reference.surfaces import Intersection, Surface, first_met
from cltrace.reference.world import World


@dataclass(frozen=True, slots=True)
class Meeting:
    """A surface on the way of a ray. t: infinite if unknown; tied: whether it is exactly as near as the closest one,
    which is seen."""

    surface: Surface
    t: float
    tied: bool = False


def meetings(world: World, ray: Ray, at: Intersection | None) -> list[Meeting]:
    """The surfaces that a ray meets, the nearest ones first. at: what it meets first."""
    met = [(t, surface) for surface in _parts(world, ray) if (t := surface.intersect(ray)) is not None]
    met.sort(key=lambda one: (at is None or not _is_seen(at, one[1]), one[0]))
    return [Meeting(surface, t, at is not None and _ties(ray, at, surface, t)) for t, surface in met]


def _parts(world: World, ray: Ray) -> Iterator[Surface]:
    """The surfaces that a ray may meet, those of groups one by one."""
    if world.region.planes:
        return world.region.parts(world.surfaces, ray)
    return (part for surface in world.surfaces for part in surface.parts(ray))


def _is_seen(at: Intersection, surface: Surface) -> bool:
    return (surface.number, surface.primitive) == (at.index, at.primitive)


def _ties(ray: Ray, at: Intersection, surface: Surface, t: float) -> bool:
    """A t is off by 2^-24 of itself at most."""
    if _is_seen(at, surface) or abs(t - at.t) > at.t * 2.0**-20:
        return False
    closest, other = at.surface.exact_t(ray), surface.exact_t(ray)
    return not (closest < other or other < closest)


def blockers(world: World, at: Intersection, of: Illumination) -> list[Meeting]:
    """The surfaces between a point and a light, the nearest ones first. t: of the ray along of.w."""
    shadow, ray = ShadowRay(at.start, at.inside, of.light), Ray(at.start, of.w)
    found = list(world.region.blockers(world.surfaces, shadow))
    # At an edge, a ray that comes from the light may meet what one that leads to it passes by.
    ends = [(surface.intersect(ray), surface) for surface in found]
    return sorted((Meeting(s, math.inf if t is None else t) for t, s in ends), key=lambda meeting: meeting.t)


def behind(world: World, at: Intersection, of: Illumination) -> Meeting | None:
    """The first surface on the way to a light that nothing hides, which is behind it."""
    ray = Ray(at.start, of.w)
    met = first_met(_parts(world, ray), ray)
    return Meeting(met[1], met[0]) if met else None
