"""What doubles know of rays and surfaces, with bounds of what they are off by.

The formulas, and the derivation of their bounds, are those of cltrace/reference: crossing.py for triangles and
equation.py, FromSurface, for spheres and ellipsoids. Those have a start that is off by 2^-49 of a "reach" at most, and
a direction that is off by less than 48 u of its size, u = 2^-53. Here the direction is exact, and each number of the
start is off by `off`: with a reach of 2^51 times as much, all bounds hold.

FLOOR covers what underflows: of two factors, one is a scene's number or a ray's, the other below 2^400.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cltrace.base.arithmetic import Floats, Triple
from cltrace.rays.lines import Bools, Ids, Lines

FLOOR = 2.0**-600
PER_OFF = 2.0**51


class Met(NamedTuple):
    """k rays and primitives that meet, or may meet, within the rays' ranges.

    ray, primitive: (k,) rows; sure: (k,), whether they do; side: (k,), 1 for the far end of the way through a solid,
    and less than that otherwise; low, high: (k,), bounds of s, if they do.
    """

    ray: Ids
    primitive: Ids
    sure: Bools
    side: Ids
    low: Floats
    high: Floats

    def at(self, rows: Ids | Bools) -> Met:
        return Met._make(x[rows] for x in self)

    @classmethod
    def all(cls, parts: list[Met]) -> Met:
        none = np.empty(0, np.int64)
        parts = parts or [cls(none, none, none.astype(bool), none, low=none.astype(float), high=none.astype(float))]
        return cls._make(np.concatenate(x) for x in zip(*parts, strict=True))


def norm1(v: Triple[Floats]) -> Floats:
    return np.asarray(np.abs(v[0]) + np.abs(v[1]) + np.abs(v[2]))


class Range(NamedTuple):
    """Whether s, with a bound of its error, is within the ray's range: surely, and perhaps."""

    surely: Bools
    perhaps: Bools

    @classmethod
    def of(cls, lines: Lines, ray: Ids, s: Floats, error: Floats) -> Range:
        slack = error + lines.loose[ray]
        low, high = lines.low[ray], lines.high[ray]
        return cls((s - slack > low) & (s + slack < high), ~((s + slack < low) | (s - slack > high)))
