"""Rays in doubles: where they come near to the surfaces, and by how much that is off.

A ray is o + t d for t_min < t < t_max. Its direction d over 2^exponent is w, whose largest number is within [1, 2): the
ray is o + T w, with T = t 2^exponent. What it meets far from o would be lost to rounding if distances were taken from
there. So they are taken from a place near the surfaces, o + T0 w, and along the ray T is T0 + s.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import EPS, Floats, Pair, add, mul, two_sum

Bools = NDArray[np.bool_]
Ids = NDArray[np.int64]
# Numbers of which so many factors as there are anywhere neither overflow nor vanish, or 0.
LOW, HIGH = 2.0**-200, 2.0**200


@dataclass(frozen=True)
class Lines:
    """n rays. Lengths are in scene units, in the world.

    origin, direction: (n, 3), and t_min, t_max: (n,), as given; exponent: (n,); w: (n, 3); place: (n, 3), and T0: (n,)
    as pairs, see above; off: (n,), a bound of what each number of `place` is off by; low, high: (n,), the range of s;
    loose: (n,), a bound of what these are off by; plain: (n,), whether pairs of doubles may decide about it.
    """

    origin: Floats
    direction: Floats
    t_min: Floats
    t_max: Floats
    exponent: NDArray[np.int32]
    w: Floats
    place: Floats
    start: Pair
    off: Floats
    low: Floats
    high: Floats
    loose: Floats
    plain: Bools

    @classmethod
    def of(cls, origin: Floats, direction: Floats, t_min: Floats, t_max: Floats, middle: Floats, size: float) -> Lines:
        """Rays near surfaces, all of which are within `size` of a point, (3,)."""
        with np.errstate(all="ignore"):
            _, exponent = np.frexp(np.abs(direction).max(axis=1))
            exponent -= 1
            w = np.ldexp(direction, -exponent[:, None])
            place, start, off = _near(origin, w, middle, size)
            ends = np.ldexp(t_min, exponent), np.ldexp(t_max, exponent)
            low, high = ((end - start[0]) - start[1] for end in ends)
            # Each difference rounds by 2^-53 of what it yields, and a tiny end may have lost its last digits.
            finite = [np.where(np.isfinite(end), np.abs(end), 0) for end in ends]
            loose = 2.0**-50 * (2 * np.abs(start[0]) + finite[0] + finite[1]) * (start[0] != 0) + 2.0**-1070
            exact = np.isin(t_min, (0, -np.inf)) & (t_max == np.inf)
            loose = np.where(exact & (start[0] == 0), 0.0, loose)
        numbers = np.column_stack([origin, w, *finite])
        plain = ((numbers == 0) | ((np.abs(numbers) >= LOW) & (np.abs(numbers) <= HIGH))).all(axis=1)
        asked = {"origin": origin, "direction": direction, "t_min": t_min, "t_max": t_max, "exponent": exponent}
        return cls(**asked, w=w, place=place, start=start, off=off, low=low, high=high, loose=loose, plain=plain)

    def __len__(self) -> int:
        return len(self.w)

    def at(self, rows: Any) -> Lines:
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        h, low = values.pop("start")
        return Lines(start=(h[rows], low[rows]), **{name: value[rows] for name, value in values.items()})


def _near(origin: Floats, w: Floats, middle: Floats, size: float) -> tuple[Floats, Pair, Floats]:
    """Places near the surfaces, T0 there, and a bound of what each number of a place is off by.

    A ray that starts within some sizes has its own start, exactly. For the others, each turn goes to where the ray is
    nearest to the middle, but for rounding: 2^-50 of the way is left.
    """
    place, start = origin.copy(), (np.zeros(len(w)), np.zeros(len(w)))
    off = np.zeros(len(w))
    far = np.flatnonzero(~(np.abs(origin - middle).max(axis=1) <= 4 * size))
    if not len(far):
        return place, start, off
    o, v, aim = origin[far], w[far], start[0][far]
    T: Pair = (aim, aim.copy())
    near, rest = o, np.zeros_like(o)
    for _ in range(3):
        more = ((middle - near) * v).sum(axis=1) / (v * v).sum(axis=1)
        T = add(T, (more, np.zeros_like(more)))
        along = mul((T[0][:, None], T[1][:, None]), (v, np.zeros_like(v)))
        near, rest = add((o, np.zeros_like(o)), along)
    # Product and sum are off by EPS of their size, see pairs.py; the rest of the pair is not part of the place.
    error = np.abs(rest) + 2 * EPS * (np.abs(o) + 2 * np.abs(T[0][:, None] * v)) + 2.0**-1000
    place[far], off[far] = near, error.max(axis=1)
    start[0][far], start[1][far] = T
    return place, start, np.where(np.isfinite(off), off, np.inf)


def differences(p: Floats, q: Floats) -> Pair:
    """p - q, exactly."""
    return two_sum(p, -q)
