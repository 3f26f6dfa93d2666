"""What is on the ways of rays: all of it, for those who ask why, and what any rays of the world meet first."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray
from cltrace.reference.surfaces import Intersection, Surface, first_met
from cltrace.reference.trace import Illumination, closest_hit
from cltrace.reference.vectors import Direction, Point
from cltrace.reference.world import World, world_of
from cltrace.scene import Camera, Scene


@dataclass(frozen=True, slots=True)
class Meeting:
    """A surface on the way of a ray. t: infinite if unknown; tied: whether it is exactly as near as the closest one,
    which is seen."""

    surface: Surface
    t: float
    tied: bool = False


def meetings(world: World, ray: Ray, at: Intersection | None) -> list[Meeting]:
    """The surfaces that a ray meets, the nearest ones first. at: what it meets first."""
    met = [(t, surface) for surface in world.parts(ray) if (t := surface.intersect(ray)) is not None]
    met.sort(key=lambda one: (at is None or not _is_seen(at, one[1]), one[0]))
    return [Meeting(surface, t, at is not None and _ties(ray, at, surface, t)) for t, surface in met]


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
    found = list(world.blockers(shadow))
    # At an edge, a ray that comes from the light may meet what one that leads to it passes by.
    ends = [(surface.intersect(ray), surface) for surface in found]
    return sorted((Meeting(s, math.inf if t is None else t) for t, s in ends), key=lambda meeting: meeting.t)


def behind(world: World, at: Intersection, of: Illumination) -> Meeting | None:
    """The first surface on the way to a light that nothing hides, which is behind it."""
    ray = Ray(at.start, of.w)
    met = first_met(world.parts(ray), ray)
    return Meeting(met[1], met[0]) if met else None


# Its camera space is the world.
WORLD = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), 45.0, (1, 1))


class FirstHits(NamedTuple):
    """Of n rays, as of cltrace.trace_rays()."""

    id: NDArray[np.int32]
    primitive: NDArray[np.int32]
    t: Floats
    point: Floats
    normal: Floats
    uv: Floats


@lru_cache(maxsize=1)
def _world_of(scene: Scene) -> World:
    """The latest scene's, as who clicks at a picture asks again."""
    return world_of(scene.seen_by(WORLD))


def first_hits(
    scene: Scene,
    origins: Floats,
    directions: Floats,
    t_min: Floats,
    t_max: Floats,
) -> FirstHits:
    """What each ray meets first at t_min < t < t_max, exactly, in milliseconds a ray. All arguments have n rows."""
    world, n = _world_of(scene), len(origins)
    found = FirstHits(
        np.full(n, -1, np.int32),
        np.full(n, -1, np.int32),
        np.full(n, np.inf),
        np.full((n, 3), np.nan),
        np.zeros((n, 3)),
        np.zeros((n, 2)),
    )
    for i, (o, d) in enumerate(zip(origins.tolist(), directions.tolist(), strict=True)):
        at = closest_hit(world, Ray(Point(*o), Direction(*d), float(t_min[i]), float(t_max[i])))
        if at:
            found.id[i], found.primitive[i], found.t[i] = at.index, at.primitive, at.t
            found.point[i], found.normal[i], found.uv[i] = tuple(at.point), tuple(at.normal), at.uv
    return found
