"""Cylinders with flat ends, as rays meet them."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats, Triple, cross, dot
from cltrace.exact.fine import Fine, fine_vector, select
from cltrace.rays.doubles import FLOOR, PER_OFF, Met, norm1
from cltrace.rays.fine import Ends, sign_of, way_through
from cltrace.rays.lines import Bools, Ids, Lines, differences
from cltrace.rays.numbers import signs, whole
from cltrace.rays.shapes.shape import Points, Shape
from cltrace.rays.whole import Roots, WholeRays
from cltrace.scene import Scene


class Cylinders(Shape):
    """See Shape. start, end: (n, 3), the middles of their ends; radius: (n,)."""

    def __init__(self, scene: Scene, first: int) -> None:
        self._take(scene.cylinders, first)
        half = self.end / 2 - self.start / 2
        self.center = self.start / 2 + self.end / 2
        self.outer = (np.sqrt((half * half).sum(axis=1)) + self.radius) * (1 + 2.0**-40)

    def _take(self, of: NDArray[np.void], first: int) -> None:
        super().__init__(first, of["number"])
        self.start, self.end, self.radius = (np.ascontiguousarray(of[name]) for name in ("start", "end", "radius"))

    def meet(self, lines: Lines, ray: Ids, primitive: Ids) -> Met:
        """Only those are left out that surely pass by: pairs tell of the others."""
        kept = np.flatnonzero(~self.beside(lines, ray, primitive - self.first))
        unknown = np.full(len(kept), np.inf)
        none = np.zeros(len(kept), np.int64)
        return Met(ray[kept], primitive[kept], sure=none.astype(bool), side=none - 1, low=-unknown, high=unknown)

    def beside(self, lines: Lines, ray: Ids, i: Ids) -> Bools:
        """(k,): which lines surely pass by.

        The line is |V| / |G| from the axis, V = u.(f x w) and G = w x u. With u = 2^-53 and s as of spheres, f is off
        by 2^-48 s and f x w by 2^-47 s w1: see passes_by() in cltrace/reference/cylinder.py.
        """
        start, r = self.start[i].T, self.radius[i]
        f, w, u = start - lines.place[ray].T, lines.w[ray].T, self.end[i].T - start
        s, w1, u1 = norm1(f) + PER_OFF * lines.off[ray], norm1(w), norm1(u)
        V, G = np.abs(dot(u, cross(f, w))), cross(w, u)
        size = np.sqrt(dot(G, G)) + 2.0**-45 * w1 * u1
        return np.asarray(V - 2.0**-45 * s * w1 * u1 > r * size * (1 + 2.0**-45) + FLOOR)

    def round_part(self, lines: Lines, ray: Ids, i: Ids, f: Triple[Fine], u: Triple[Fine]) -> tuple[Fine, ...]:
        """a, b, c and D of what goes round the axis."""
        r, w, uu = Fine.of(self.radius[i]), fine_vector(lines.w[ray]), dot(u, u)
        F, G = cross(f, u), cross(w, u)
        a, b, c, V = dot(G, G), dot(F, G), dot(F, F) - r * r * uu, dot(u, cross(f, w))
        return a, b, c, uu * (a * r * r - V * V)

    def whole_round_part(self, rays: WholeRays, i: Ids, f: Any, u: Any) -> tuple[Any, Any, Any]:
        """a, b and c, exactly."""
        F, G = (np.array(cross(v, u), object) for v in (f, rays.w))
        r = whole(self.radius[i], rays.grid)
        return dot(G, G), dot(F, G), dot(F, F) - r * r * dot(u, u)

    def depth(self, i: Ids) -> Ids:
        """(k,): 1, or 0 where the second plane is the first one."""
        return np.ones(len(i), np.int64)

    def ends(self, lines: Lines, ray: Ids, primitive: Ids) -> Ends:
        """Where lines are within the endless cylinder, and between the planes of the ends: from the later beginning to
        the earlier end of the two."""
        i = primitive - self.first
        start, w = self.start[i], fine_vector(lines.w[ray])
        f, u = fine_vector(*differences(start, lines.origin[ray])), fine_vector(*differences(self.end[i], start))
        a, b, c, D = self.round_part(lines, ray, i, f=f, u=u)
        g, h = dot(w, u), dot(f, u)
        k, forth = h + dot(u, u) * Fine.of(self.depth(i).astype(float)), g.h > 0
        into, out_of = way_through(a, b, c, D)
        first, last = (select(forth, h, k) / g, into), (select(forth, k, h) / g, out_of)
        late, soon = sign_of(first[0] - first[1]), sign_of(last[0] - last[1])
        near, far = select(late > 0, *first), select(soon < 0, *last)
        known = np.logical_and.reduce([sign_of(D) > 0, sign_of(a) > 0, sign_of(b) != 0, sign_of(g) != 0, late, soon])
        meets = np.where(sign_of(D) < 0, -1, np.where(known, sign_of(far - near), 0))
        return Ends(meets.astype(np.int8), near, far)

    def lengths(self, primitive: Ids) -> list[Floats]:
        i = primitive - self.first
        return [self.start[i], self.end[i], self.radius[i]]

    def roots(self, rays: WholeRays, primitive: Ids) -> Roots:
        """The way through the endless cylinder, and that between the planes N = g t, each from -1 to 1; the later
        beginning and the earlier end of these count."""
        i = primitive - self.first
        w, (S, E) = rays.w, (whole(x[i], rays.grid) for x in (self.start, self.end))
        f, u = S.T - rays.o, (E - S).T
        g, h = dot(w, u), dot(f, u)
        a, b, c = self.whole_round_part(rays, i, f=f, u=u)
        D, k, forth = b * b - a * c, h + dot(u, u) * self.depth(i).astype(object), signs(g)
        steep, curved, real = forth != 0, signs(a) > 0, D >= 0
        none, one = np.zeros((3, len(i)), object), np.ones(len(i), np.int64)
        sides, flats = [], []
        for end, N in ((-1, np.where(forth > 0, h, k)), (1, np.where(forth > 0, k, h))):
            D_or_0, g_or_1, a_or_1 = np.where(real, D, 0), np.where(steep, g, 1), np.where(curved, a, 1)
            sides.append(Roots(curved & real, a=a_or_1, b=b, side=end * one, D=D_or_0, w=w, normal=none))
            flats.append(Roots(steep, a=g_or_1 * g_or_1, b=N * g, side=end * one, D=none[0], w=w, normal=none))
        by_flat = steep & (~curved | ~flats[0].before(sides[0])), steep & (~curved | ~sides[1].before(flats[1]))
        near, far = (flat.where(by, side) for flat, by, side in zip(flats, by_flat, sides, strict=True))
        there = np.where(curved, real, c <= 0) & (steep | ((h <= 0) & (k >= 0))) & ~far.before(near)
        first, second = rays.reach(near), rays.reach(far)
        return near.where(first, far)._replace(exists=there & (first | second))

    def points(self, lines: Lines, primitive: Ids, t: Fine) -> Points:
        return CylinderPoints(self, lines, primitive - self.first, t)


class CylinderPoints:
    """See Points.

    A point is on a flat end if the plane of that is as near as the side: their distances are compared in doubles. So
    it is on the rim.
    """

    def __init__(self, cylinders: Cylinders, lines: Lines, i: Ids, t: Fine) -> None:
        start, r = cylinders.start[i], cylinders.radius[i]
        f, w = fine_vector(*differences(start, lines.origin)), fine_vector(lines.w)
        p = np.stack([(t * x - y).h for x, y in zip(w, f, strict=True)], axis=1)
        self._u = cylinders.end[i] - start
        self._length = np.sqrt((self._u * self._u).sum(axis=1, keepdims=True))
        self._along = (p * self._u).sum(axis=1, keepdims=True) / self._length
        self._out = p - self._along * self._u / self._length  # from the axis
        self._size = np.sqrt((self._out * self._out).sum(axis=1, keepdims=True))
        gaps = np.abs(np.concatenate([self._along, self._length - self._along, self._size - r[:, None]], axis=1))
        self._part = gaps.argmin(axis=1)  # the start, the end, the side

    @cached_property
    def normal(self) -> Floats:
        side = self._out / np.where(self._size > 0, self._size, 1)
        flat = np.where(self._part == 0, -1, 1)[:, None] * self._u
        return np.asarray(np.where(self._part[:, None] == 2, side, flat))

    @cached_property
    def uv(self) -> Floats:
        e1 = np.cross(np.eye(3)[np.abs(self._u).argmin(axis=1)], self._u)
        e2 = np.cross(self._u, e1)
        x, y = ((self._out * e).sum(axis=1) / np.sqrt((e * e).sum(axis=1)) for e in (e1, e2))
        high = np.clip(self._along / self._length, 0, 1)[:, 0]
        down = np.where(self._part == 0, 1.0, np.where(self._part == 1, 0.0, 1 - high))
        return np.stack([0.5 + np.arctan2(y, x) / (2 * np.pi), down], axis=1)
