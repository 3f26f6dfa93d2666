"""Where a ray goes on from a mirror or through glass.

d: the direction in which the ray came, of any length; n: the outward unit normal of the surface, both in camera space;
side: 1 where the ray came from outside, -1 from inside. Nothing is normalised on the way: a mirror keeps the length of
d, and so does Snell's law as it is written here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from cltrace.reference.rays import Ray, Start
from cltrace.reference.surfaces import Intersection
from cltrace.reference.vectors import Direction


@dataclass(frozen=True, slots=True)
class SecondaryRay:
    """A ray that goes on. share: how much of what it sees the ray sees that came; total: whether reflection is total,
    so that the mirrored ray has the share of the refracted one, too."""

    kind: Literal["mirrored", "refracted"]
    start: Start
    direction: Direction
    share: float
    total: bool


def bounces(ray: Ray, at: Intersection) -> Iterator[SecondaryRay]:
    """How a ray goes on from a mirror or through glass: the refracted ray first, if any, then the mirrored one."""
    m, d, n, spread = at.material, ray.direction, at.outward, at.surface.spread
    mirror, total = m.reflectance, False
    if m.transmittance > 0:
        through = refracted(d, n, at.side, index=m.index, spread=spread)
        if through is None:
            mirror, total = mirror + m.transmittance, True
        else:
            yield SecondaryRay("refracted", at.start, through, m.transmittance, total=False)
    if mirror > 0:
        yield SecondaryRay("mirrored", at.start, mirrored(d, n, at.side, spread), mirror, total)


def mirrored(d: Direction, n: Direction, side: int, spread: float = 1.0) -> Direction:
    """d - 2 (n.d) n: the angle out is the angle in."""
    return lift(d - n * (2 * n.dot(d)), n, side, spread)


def refracted(d: Direction, n: Direction, side: int, index: float, spread: float = 1.0) -> Direction | None:
    """Snell's law: the sine of the angle to the normal is divided by the index on the way in, multiplied by it on the
    way out. None: total reflection, the sine would be above 1.

    index: of refraction inside; outside it is 1.

    With the normal N against the ray, c = -N.d is the ray's part along it and d + c N the part across, of length
    |n x d|. The new part across is eta times that, and what is left of d.d is the square of the new part along N.
    |n x d|^2 is not computed as d.d - c^2, which would cancel near the normal.
    """
    if index == 1:
        return d
    eta = 1 / index if side > 0 else index
    facing = n * side
    c, across = -facing.dot(d), n.cross(d)
    k = d.dot(d) - (eta * eta) * across.dot(across)
    if k < 0:
        return None
    return lift((d + facing * c) * eta - facing * math.sqrt(k), n, -side, spread)


def lift(d: Direction, n: Direction, side: int, spread: float = 1.0) -> Direction:
    """d, turned a little where it does not surely leave on that side of the surface: by what rounding may have done.

    Which side a ray takes is decided by the exact sign of (B^T q).(B^T d), q being the normal of its start. n.d as
    computed here is off by 4 u |d|_1, u = 2^-53, and the camera's axes, which are orthonormal but for 14 u (see
    rays.View), add 14 u |d|. So beyond
    `least` = 32 u |d|_1 it is sure. What is not is set to twice that, which rounds by 2 u |d|_1 more.

    spread: of an ellipsoid, k l, where k and l are the sizes of K and K^-1 (see vectors.Matrix). The sign is that of
    (K^T q).(B^T d). K^T q rounds by 3 u k, which is 3 u k l of its length at most; normalising it changes no sign,
    turning it costs 5.2 u, and n.d 4 u: less than 32 u k l again, as k l >= 3.
    """
    leaves = side * n.dot(d)
    least = 2.0**-48 * ((abs(d.x) + abs(d.y)) + abs(d.z)) * spread
    return d if leaves > least else d + n * (side * (2 * least - leaves))
