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
    """Spheres as seen from a point: center (n, 3), from that point; radius (n,); power (n,): |center|^2 - radius^2
    without the rounding of that difference.
    """

    center: Array
    radius: Array
    power: Array


def filter_constant(seen: Seen) -> NDArray[np.float32]:
    """c' of sphere_may_meet in kernels/shapes/sphere.cl, where it is derived. (n,)"""
    c = seen.power
    wide = CONSTANTS["FILTER_ROUNDINGS"] * U * (squared_length(seen.center) + np.abs(c))
    bound = c - wide - 2.0**-100
    return rounded_down(np.where(bound > 0, bound, -np.inf))


def disc_filter(u: Array, v: Array, radius: Array) -> NDArray[np.float32]:
    """r'^2 of filter_leaves in kernels/find/stopped.cl, where it is derived, for spheres at (u, v) across a parallel
    light. (n,)
    """
    reach = radius + CONSTANTS["DISC_ROUNDINGS"] * U * (np.abs(u) + np.abs(v) + radius) + 2.0**-60
    return rounded_up(reach * reach)


def slopes(across: list[Reals], d: Reals, r: Reals, gap: Reals) -> list[Reals]:
    """The tangents, from the origin, at circles with centre (c, d) and radius r, for each c of `across`: lowest and
    highest c/d, one after the other.

    gap: d^2 - r^2. The tangents exist where the circle is clear of the line d = 0; else the answer is all numbers. With
    each argument rounded once, both are right to 8 roundings of the larger one, which is |middle| + half: neither of
    those has more. Where squares are about to vanish there is no answer either.
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
    """|(x, y, z)|, (n,), to 2^-22 of it in float32; too much of less than 2^-60, where squares vanish."""
    return np.asarray(np.sqrt(x * x + y * y + z * z + x.dtype.type(2.0**-120)))


def nearest(distance: Reals, r: Reals, power: Array) -> NDArray[np.float32]:
    """A lower bound of the squared distance of each sphere's nearest point, (n,); -1 from inside, or all but.

    distance, r: of length() and the radius, (n,); power: of Seen.
    """
    # The gap is right to 6 units of 2^-24, and its square to 14; those of the kernel's lengths are right to 5.
    gap = power.astype(np.float32) / (distance + r)
    return np.where(gap > 2.0**-50, gap * gap * (1 - 2.0**-19), -1).astype(np.float32)
