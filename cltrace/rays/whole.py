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

from cltrace.numbers.pairs import Floats
from cltrace.numbers.surds import signs_with_root, signs_with_roots
from cltrace.numbers.vectors import cross, dot, product
from cltrace.numbers.whole import Signs, Whole, grid_of, rounded, signs, whole
from cltrace.rays.lines import Bools, Ids, Lines
from cltrace.rays.surfaces import Surfaces


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


class Exact:
    """Rays and primitives, (k,) rows each, in whole numbers. roots: what each ray meets first of its primitive within
    its range, if anything; their unit is 2^shift."""

    def __init__(self, lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> None:
        round_, long, flat = kinds = surfaces.kinds(primitive)
        balls, rods = primitive[round_], primitive[long] - surfaces.spheres
        corners = surfaces.vertex[surfaces.face[primitive[flat] - surfaces.solids]]
        ends = surfaces.start[rods], surfaces.end[rods], surfaces.rod_radius[rods]
        places = (lines.origin[ray], surfaces.center[balls], surfaces.radius[balls], *ends, corners)
        self.grid = grid_of(*(x.ravel() for x in places))
        fine = grid_of(lines.direction[ray].ravel())
        self.shift = fine - self.grid
        o, w = whole(lines.origin[ray], self.grid).T, whole(lines.direction[ray], fine).T
        self.t_min, self.t_max = lines.t_min[ray], lines.t_max[ray]
        self.volumes = np.empty((3, len(ray)), object)
        parts: list[tuple[Ids, Roots]] = []
        for kind, roots in zip(kinds, (self._spheres, self._rods, self._triangles), strict=True):
            rows = np.flatnonzero(kind)
            if len(rows):
                parts.append((rows, roots(surfaces, primitive[rows], rows, o[:, rows], w[:, rows])))
        back = np.argsort(np.concatenate([rows for rows, _ in parts]))
        self.roots = Roots._make(np.concatenate(x, axis=-1) for x in zip(*(r for _, r in parts), strict=True)).at(back)

    def _triangles(self, surfaces: Surfaces, primitive: Ids, rows: Ids, o: Whole, w: Whole) -> Roots:
        face = surfaces.face[primitive - surfaces.solids]
        A, B, C = (whole(surfaces.vertex[face[:, k]], self.grid).T - o for k in range(3))
        edges = [np.array(cross(u, v), object) for u, v in ((A, B), (B, C), (C, A))]
        D = dot(A, edges[1])
        sides = np.array([_sign_along(w, edge) for edge in edges])
        side = sides[0]
        exists = (signs(D) != 0) & (sides == side).all(axis=0)
        # Where it is met, all three are on one side, so that side is that of their sum, N.w.
        volumes = np.array([dot(w, edge) * side for edge in edges], object).reshape(3, -1)
        self.volumes[:, rows] = volumes
        normal, zero = (edges[0] + edges[1] + edges[2]) * side, np.zeros(len(rows), np.int64)
        roots = Roots(exists, a=volumes.sum(axis=0), b=D * side, side=zero, D=zero.astype(object), w=w, normal=normal)
        return roots._replace(exists=exists & self._within(roots, rows))

    def _spheres(self, surfaces: Surfaces, primitive: Ids, rows: Ids, o: Whole, w: Whole) -> Roots:
        f, d = whole(surfaces.center[primitive], self.grid).T - o, w
        r = whole(surfaces.radius[primitive], self.grid)
        bent = surfaces.bent[primitive]
        if (bent >= 0).any():
            maps = np.concatenate([surfaces.maps, np.eye(3)[None]])[bent]  # of -1, the last one
            k = grid_of(maps.ravel())
            K = np.moveaxis(whole(maps, k), 0, -1)
            f, d = (np.array(product(K, v), object) for v in (f, d))
            r = r << k
        a, b, c = dot(d, d), dot(f, d), dot(f, f) - r * r
        D, side = b * b - a * c, np.ones(len(rows), np.int64)
        passes = D < 0
        roots = Roots(
            ~passes, a=a, b=b, side=-side, D=np.where(passes, 0, D), w=w, normal=np.zeros((3, len(rows)), object)
        )
        first, second = (self._within(roots._replace(side=end), rows) for end in (-side, side))
        return roots._replace(exists=~passes & (first | second), side=np.where(first, -1, 1))

    def _rods(self, surfaces: Surfaces, primitive: Ids, rows: Ids, o: Whole, w: Whole) -> Roots:
        """The way through the endless cylinder, and that between the planes N = g t, each from -1 to 1; the later
        beginning and the earlier end of these count."""
        rod = primitive - surfaces.spheres
        S, E, r = (whole(x[rod], self.grid) for x in (surfaces.start, surfaces.end, surfaces.rod_radius))
        f, u = S.T - o, (E - S).T
        F, G = (np.array(cross(v, u), object) for v in (f, w))
        uu, g, h = dot(u, u), dot(w, u), dot(f, u)
        a, b, c = dot(G, G), dot(F, G), dot(F, F) - r * r * uu
        D, k, forth = b * b - a * c, h + uu, signs(g)
        steep, curved, real = forth != 0, signs(a) > 0, D >= 0
        none, one = np.zeros((3, len(rows)), object), np.ones(len(rows), np.int64)
        sides, flats = [], []
        for end, N in ((-1, np.where(forth > 0, h, k)), (1, np.where(forth > 0, k, h))):
            D_or_0, g_or_1, a_or_1 = np.where(real, D, 0), np.where(steep, g, 1), np.where(curved, a, 1)
            sides.append(Roots(curved & real, a=a_or_1, b=b, side=end * one, D=D_or_0, w=w, normal=none))
            flats.append(Roots(steep, a=g_or_1 * g_or_1, b=N * g, side=end * one, D=none[0], w=w, normal=none))
        by_flat = steep & (~curved | ~flats[0].before(sides[0])), steep & (~curved | ~sides[1].before(flats[1]))
        near, far = (flat.where(by, side) for flat, by, side in zip(flats, by_flat, sides, strict=True))
        there = np.where(curved, real, c <= 0) & (steep | ((h <= 0) & (k >= 0))) & ~far.before(near)
        first, second = self._within(near, rows), self._within(far, rows)
        return near.where(first, far)._replace(exists=there & (first | second))

    def _within(self, roots: Roots, rows: Ids) -> Bools:
        low, high = (roots.sign_less(bound[rows], -self.shift) for bound in (self.t_min, self.t_max))
        return np.asarray((low > 0) & (high < 0))

    def weights(self) -> Floats:
        """(3, k): of the corners of triangles that are met, rounded."""
        order = self.volumes[[1, 2, 0]]
        return np.array([[float(Fraction(x, sum(v))) for x in v] for v in order.T], float).reshape(-1, 3).T


def _sign_along(w: Whole, v: Whole) -> Signs:
    """The sign of v.w, and where that is 0, of v.(w + (e, e^2, e^3)) for every small e > 0."""
    sign = signs(dot(v, w))
    for x in v:
        if sign.all():
            break
        sign = np.where(sign == 0, signs(x), sign)
    return sign
