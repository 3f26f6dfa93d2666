"""Spheres as seen from a fixed point or along a fixed direction: filter constants, silhouettes, nearest points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS
from cltrace.plan.exact import Array, rounded_down, rounded_up, squared_length

# float32 or double.
Reals = NDArray[Any]
# Unit roundoff of float32: the bounds of the filters are multiples of it.
U = 2.0**-24


@dataclass(frozen=True)
class Seen:
    """n spheres as seen from a point.

    center: (n, 3), from that point to the centres; radius: (n,); power: (n,), |center|^2 - radius^2 of the exact
    center, rounded once. Of surfaces that only lie within these spheres, it is 0 from inside.
    """

    center: Array
    radius: Array
    power: Array


def filter_constant(seen: Seen) -> NDArray[np.float32]:
    """(n,): the c' of sphere_may_meet in kernels/shapes/sphere.cl, where it is derived."""
    c = seen.power
    wide = CONSTANTS["FILTER_ROUNDINGS"] * U * (squared_length(seen.center) + np.abs(c))
    bound = c - wide - 2.0**-100
    return rounded_down(np.where(bound > 0, bound, -np.inf))


def disc_filter(u: Array, v: Array, radius: Array, loose: float = 2.0**-60) -> NDArray[np.float32]:
    """(n,): the r'^2 of filter_leaves in kernels/find/stopped.cl, where it is derived.

    u, v, radius: (n,), the coordinates of the centres across a parallel light, and the radii; loose: what is to be
    added to these.
    """
    reach = radius + CONSTANTS["DISC_ROUNDINGS"] * U * (np.abs(u) + np.abs(v) + radius) + loose
    return rounded_up(reach * reach)


def slopes(across: list[Reals], d: Reals, r: Reals, gap: Reals) -> list[Reals]:
    """The slopes c/d of the two tangents from the origin to circles with centre (c, d) and radius r.

    Returns, for each c of `across`, first the lower slopes (n,), then the higher ones. across: arrays (n,); gap: (n,),
    d^2 - r^2. Where a circle is not clear of the line d = 0, it has no such tangents, and the answer is -inf and inf,
    as it is where squares are about to underflow. If each argument is rounded once, both slopes are right to 8
    roundings of the larger one, |middle| + half, as neither of these takes more.
    """
    clear = (d > 0) & (gap >= d * d * (1 / 16)) & (gap > 2.0**-100)
    over = 1 / np.where(clear, gap, 1)
    unclear = np.flatnonzero(~clear)
    forward, around = d * over, r * over
    found = []
    for c in across:
        middle, half = c * forward, around * np.sqrt(np.maximum(c * c + gap, 0))
        low, high = middle - half, middle + half
        low[unclear], high[unclear] = -np.inf, np.inf
        found += [low, high]
    return found


def length(x: Reals, y: Reals, z: Reals) -> Reals:
    """(n,): |(x, y, z)|, in float32 right to 2^-22 of it. Below 2^-60, where squares underflow, it is too large."""
    return np.asarray(np.sqrt(x * x + y * y + z * z + x.dtype.type(2.0**-120)))


def nearest(distance: Reals, r: Reals, power: Array) -> NDArray[np.float32]:
    """(n,): a lower bound of the squared distance of each sphere's nearest point; -1 on the sphere, or all but.

    distance: (n,), of length(); r, power: (n,), of Seen. From inside, too, that point is | |C| - r | away.
    """
    # Relative errors, in units of 2^-24: the gap is right to 6, its square to 14, and the kernel's squared lengths are
    # right to 5.
    gap = np.abs(power.astype(np.float32)) / (distance + r)
    return np.where(gap > 2.0**-50, gap * gap * (1 - 2.0**-19), -1).astype(np.float32)
