"""The last word on rays and surfaces: whole numbers of any size, for many pairs at once. Nothing is rounded.

All numbers of some rays and surfaces are whole multiples of powers of two. With lengths times 2^grid, directions times
2^fine and t times 2^(grid - fine), the questions are those of cltrace/reference/exact.py: a triangle is met at D / den,
a sphere or an ellipsoid at (b -/+ sqrt(D)) / a, and signs and orders of these are found by squaring.
"""

from __future__ import annotations

from fractions import Fraction
from math import isqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats
from cltrace.rays.lines import Bools, Ids, Lines
from cltrace.rays.numbers import Signs, Whole, grid_of, rounded, signs, signs_with_root, signs_with_roots, whole


class Roots(NamedTuple):
    """k numbers t = (b + side sqrt(D)) / a, in the unit 2^(fine - grid), and whether they are there: exists, (k,).

    a > 0 and D >= 0; side: (k,), 0 of triangles. w: (3, k), the direction; normal: (3, k), of triangles, with b the
    planes' equation a t = b, a = normal.w; 0 of others.
    """

    exists: Bools
    a: Whole
    b: Whole
    side: NDArray[np.int64]
    D: Whole
    w: Whole
    normal: Whole

    def at(self, rows: Ids) -> Roots:
        return Roots._make(x[..., rows] for x in self)

    def where(self, mask: Bools, other: Roots) -> Roots:
        """Of some rows these, and those of another one elsewhere."""
        return Roots._make(np.where(mask, x, y) for x, y in zip(self, other, strict=True))

    def before(self, other: Roots) -> Bools:
        """Whether it comes before another one of the same ray.

        Of two planes, that is asked of the direction w + (e, e^2, e^3) for every small e > 0.
        """
        p = self.b * other.a - other.b * self.a
        E, F = self.D * other.a * other.a, other.D * self.a * self.a
        sign = signs_with_roots(p, one=self.side, D=E, other=-other.side, E=F)
        planes = np.flatnonzero((sign == 0) & (self.side == 0) & (other.side == 0))
        if len(planes):
            mine, its = self.at(planes), other.at(planes)
            for m, n in zip(mine.normal, its.normal, strict=True):
                tie = sign[planes] == 0
                sign[planes] = np.where(tie, signs(mine.b * n - its.b * m), sign[planes])
        return np.asarray(sign < 0)

    def sign_less(self, bound: Floats, shift: int) -> Signs:
        """The sign of t - bound, (k,), where bound may be infinite; it is to be multiplied by 2^shift."""
        out = np.where(bound > 0, -1, 1).astype(np.int8)
        rows = np.flatnonzero(np.isfinite(bound))
        if len(rows):
            ratios = [(Fraction(x) * Fraction(2) ** shift).as_integer_ratio() for x in bound[rows].tolist()]
            p, q = np.array(ratios, object).T
            a, b, side, D = self.a[rows], self.b[rows], self.side[rows], self.D[rows]
            out[rows] = signs_with_root(b * q - a * p, side * q, D)
        return out

    def pair(self, i: int, shift: int) -> tuple[float, float]:
        """2^shift t correctly rounded, and what that leaves; infinite beyond the range of doubles."""
        a, b, side, D, unit = self.a[i], self.b[i], int(self.side[i]), self.D[i], Fraction(2) ** shift
        bits = 128
        while True:
            root = isqrt(D << 2 * bits)
            more = int(root * root != D << 2 * bits)
            low, high = sorted(Fraction((b << bits) + side * x, a << bits) * unit for x in (root, root + more))
            h = rounded(low)
            # If sqrt(D) is rational both are t, and otherwise t is no double, nor half way between two.
            if h == rounded(high) and high - low <= abs(low) / 2**110:
                return h, 0.0 if np.isinf(h) else float(low - Fraction(h))
            bits *= 2


class WholeRays(NamedTuple):
    """k rays in whole numbers: lengths times 2^grid, t times 2^-shift.

    o, w: (3, k), where they start, and their directions; t_min, t_max: (k,), as given.
    """

    grid: int
    shift: int
    o: Whole
    w: Whole
    t_min: Floats
    t_max: Floats

    @classmethod
    def of(cls, lines: Lines, ray: Ids, lengths: list[Floats]) -> WholeRays:
        """Some rays, on a grid on which these lengths are whole, too."""
        grid, fine = grid_of(lines.origin[ray], *lengths), grid_of(lines.direction[ray])
        o, w = whole(lines.origin[ray], grid).T, whole(lines.direction[ray], fine).T
        return cls(grid, fine - grid, o=o, w=w, t_min=lines.t_min[ray], t_max=lines.t_max[ray])

    def at(self, rows: Ids) -> WholeRays:
        low, high = self.t_min[rows], self.t_max[rows]
        return self._replace(o=self.o[:, rows], w=self.w[:, rows], t_min=low, t_max=high)

    def reach(self, roots: Roots) -> Bools:
        """(k,): whether these are within the rays' ranges."""
        low, high = (roots.sign_less(bound, -self.shift) for bound in (self.t_min, self.t_max))
        return np.asarray((low > 0) & (high < 0))
