"""What any rays of the world meet first, one after the other: for scenes that only the reference decides exactly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.reference.rays import Ray
from cltrace.reference.trace import closest_hit
from cltrace.reference.vectors import Direction, Point
from cltrace.reference.world import world_of
from cltrace.scene import Camera, Scene

Floats = NDArray[np.float64]
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


def first_hits(scene: Scene, origins: Floats, directions: Floats, t_min: Floats, t_max: Floats) -> FirstHits:
    """What each ray meets first at t_min < t < t_max, exactly, in milliseconds a ray. All arguments have n rows."""
    world, n = world_of(scene.seen_by(WORLD)), len(origins)
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
