"""What rays meet first, or at all, of surfaces of all kinds: the one search of the oracle.

A kind of surfaces says what may meet, in doubles with bounds of their errors, and where, exactly. Here this is put
together. What doubles leave in doubt is decided by signs of whole numbers, in _first() and Roots.before() alone.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats
from cltrace.exact.fine import Fine
from cltrace.exact.surds import Interval, Surds, root_between, signs_with_root, signs_with_roots
from cltrace.exact.whole import Signs, Whole, rounded
from cltrace.oracle.rays import ExactRays, Ids, Points, Rays, SurdVector
from cltrace.scene import Scene

Bools = NDArray[np.bool_]

PAIRS_AT_ONCE = 1 << 15  # so many pairs of a ray and a surface are looked at in one go


class Hits(NamedTuple):
    """k pairs of a ray and a surface that meet, surely or maybe: rows, (k,) each, and t; its error may be infinite."""

    ray: Ids
    item: Ids
    sure: Bools
    t: Fine


@dataclass(frozen=True)
class Roots:
    """Where k rays meet surfaces first: t = unit (b + side sqrt(D)) / a with a > 0, if exists, (k,).

    side: (k,), 0 of planes, whose equation is a t = b with a = normal.way; normal: 0 of others. surface: (k,), its
    number. Those of one ray have the same unit.
    """

    exists: Bools
    a: Surds
    b: Surds
    side: Ids
    D: Surds
    normal: SurdVector
    unit: Whole
    surface: Ids

    def at(self, rows: Ids) -> Roots:
        x, y, z = (part[rows] for part in self.normal)
        rest = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "normal"}
        return Roots(**rest, normal=(x, y, z))

    @classmethod
    def all(cls, parts: Sequence[Roots], s: Whole | None) -> Roots:
        """One after the other; s: of the square roots of all rays."""

        def joined(columns: Sequence[Surds]) -> Surds:
            return Surds.all([x.filled(part) for x, part in zip(columns, shares, strict=True)])

        ends = np.cumsum([len(part.side) for part in parts])[:-1]
        shares = [None] * len(parts) if s is None else np.split(s, ends)
        x, y, z = (joined([part.normal[i] for part in parts]) for i in range(3))
        a, b, D = (joined([getattr(part, name) for part in parts]) for name in ("a", "b", "D"))
        exists, side, unit, surface = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("exists", "side", "unit", "surface")
        )
        return cls(exists, a=a, b=b, side=side, D=D, normal=(x, y, z), unit=unit, surface=surface)

    def before(self, other: Roots) -> Bools:
        """Whether it comes before another one of the same ray.

        Of two planes, that is asked of the direction w + (e, e^2, e^3) for every small e > 0. Of what is still equal,
        that of the surface with the lower number does.
        """
        gap = self.b * other.a - other.b * self.a
        D, E = self.D * other.a * other.a, other.D * self.a * self.a
        sign = signs_with_roots(gap, one=self.side, D=D, other=-other.side, E=E)
        planes = np.flatnonzero((sign == 0) & (self.side == 0) & (other.side == 0))
        if len(planes):
            mine, its = self.at(planes), other.at(planes)
            for m, n in zip(mine.normal, its.normal, strict=True):
                tie = sign[planes] == 0
                sign[planes] = np.where(tie, (mine.b * n - its.b * m).signs(), sign[planes])
        return np.asarray((sign < 0) | ((sign == 0) & (self.surface < other.surface)))

    def sign_less(self, bound: float | Fraction) -> Signs:
        """The signs of t - bound, (k,)."""
        if isinstance(bound, float) and np.isinf(bound):
            return np.full(len(self.side), -1 if bound > 0 else 1, np.int8)
        if not bound:
            return signs_with_root(self.b, self.side, self.D)
        ratios = [(Fraction(bound) / unit).as_integer_ratio() for unit in self.unit]
        p, q = np.array(ratios, object).reshape(-1, 2).T
        return signs_with_root(self.b * q - self.a * p, self.side * q, self.D)

    def within(self, t_min: float | Floats, t_max: float | Floats) -> Bools:
        """(k,): whether t_min < t < t_max; these are (k,), or one number for all."""
        inside = np.ones(len(self.side), bool)
        for ends, sign in ((t_min, 1), (t_max, -1)):
            values, which = np.unique(np.broadcast_to(ends, len(inside)), return_inverse=True)
            for i, value in enumerate(values.tolist()):
                rows = np.flatnonzero(which == i)
                inside[rows] &= self.at(rows).sign_less(value) == sign
        return inside

    def between(self, i: int, bits: int) -> Interval | None:
        """Bounds of t of the i-th, closer the more bits there are; None if these are too few."""
        a, b, D = (x.one(i).between(bits) for x in (self.a, self.b, self.D))
        ends = [root_between(max(D.low, Fraction(0)), bits).low, root_between(max(D.high, Fraction(0)), bits).high]
        roots = sorted(int(self.side[i]) * end for end in ends)
        t = Interval(b.low + roots[0], b.high + roots[1]).over(a)
        return t and Interval(t.low * self.unit[i], t.high * self.unit[i])

    def rounded(self) -> Floats:
        """t correctly rounded, (k,); infinite beyond the range of doubles."""
        return np.array([self._rounded(i) for i in range(len(self.side))], float)

    def _rounded(self, i: int) -> float:
        def side_of(bound: float | Fraction) -> int:
            return int(self.at(np.array([i])).sign_less(bound)[0])

        bits = 128
        while True:
            t = self.between(i, bits)
            if t and t.low <= 0 <= t.high and side_of(0.0) == 0:
                return 0.0
            low, high = (rounded(t.low), rounded(t.high)) if t else (0.0, np.inf)
            if low == high:
                return low
            if t and np.nextafter(low, np.inf) == high:  # which of the two is told by what is half way between
                middle = (Fraction(low) + (Fraction(high) if high < np.inf else 2**1024)) / 2
                return (low, rounded(middle), high)[side_of(middle) + 1]
            bits *= 2


class Kind(ABC):
    """The surfaces of one kind. surface: (m,), their numbers in the scene; grid: what they take at least, see
    grid_of()."""

    surface: Ids
    grid: int

    @classmethod
    @abstractmethod
    def of(cls, scene: Scene) -> Self:
        """All of a scene."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """No coordinate of any point of them is larger than this."""

    def primitives(self) -> Ids:
        """(m,): the number of each one in its mesh, -1 for none."""
        return np.full(len(self.surface), -1)

    @abstractmethod
    def near(self, rays: Rays) -> tuple[Ids, Ids]:
        """Rays and surfaces, (k,) rows each: all pairs that may meet, by a quick look in doubles."""

    @abstractmethod
    def hits(self, rays: Rays, ray: Ids, item: Ids) -> Hits:
        """Those of these pairs that do not surely pass each other by, at t > 0."""

    @abstractmethod
    def roots(self, exact: ExactRays, item: Ids, t_min: float | Floats, t_max: float | Floats) -> Roots:
        """Where each ray meets its surface within t_min < t < t_max, exactly; these are (k,), or one for all."""


class Kinds:
    """Surfaces of several kinds, whose rows are counted on from one kind to the next.

    first: the row of each kind's first one, and how many there are in all; surface, primitive: (m,), their numbers.
    """

    def __init__(self, kinds: Sequence[Kind]) -> None:
        self.kinds, self.first = kinds, np.cumsum([0, *(len(kind.surface) for kind in kinds)])
        self.surface = np.concatenate([kind.surface for kind in kinds])
        self.primitive = np.concatenate([kind.primitives() for kind in kinds])

    def hits(self, rays: Rays, pairs: tuple[Ids, Ids] | None = None) -> Iterator[tuple[slice, Rays, Hits]]:
        """All hits, sure ones and others, for blocks of the rays. The rays of Hits are counted from the block's.

        pairs: (k,) rays, rising, and surfaces that may meet, None for all.
        """
        many = int(self.first[-1]) if pairs is None else -(-len(pairs[0]) // max(1, len(rays)))
        size = max(1, PAIRS_AT_ONCE // max(1, many))
        for begin in range(0, len(rays), size):
            rows = np.arange(begin, min(begin + size, len(rays)))
            block, some = rays.at(rows), None
            if pairs is not None:
                one, end = np.searchsorted(pairs[0], (begin, begin + size))
                some = pairs[0][one:end] - begin, pairs[1][one:end]
            parts = [self._hits(kind, block, int(k), some) for kind, k in zip(self.kinds, self.first, strict=False)]
            ray, item, sure = (np.concatenate([part[i] for part in parts]) for i in range(3))
            h, low, error = (np.concatenate([getattr(part.t, name) for part in parts]) for name in ("h", "l", "error"))
            yield slice(begin, begin + len(rows)), block, Hits(ray, item, sure, Fine(h, low, error))

    @staticmethod
    def _hits(kind: Kind, rays: Rays, first: int, pairs: tuple[Ids, Ids] | None) -> Hits:
        n, m = len(rays), len(kind.surface)
        if pairs is not None:
            own = (pairs[1] >= first) & (pairs[1] < first + m)
            pairs = pairs[0][own], pairs[1][own] - first
        with np.errstate(all="ignore"):  # what is not finite is not sure
            if rays.rough is not None:
                begun = rays.begun()
                hits = _limited(kind.hits(begun, *(kind.near(begun) if pairs is None else pairs)), rays)
            else:
                ray, item = pairs or (np.repeat(np.arange(n), m), np.tile(np.arange(m), n))
                t = Fine(np.zeros(len(ray)), np.zeros(len(ray)), np.full(len(ray), np.inf))
                hits = Hits(ray, item, np.zeros(len(ray), bool), t)
        return hits._replace(item=hits.item + first)

    def roots(self, rays: Rays, ray: Ids, item: Ids) -> Roots:
        """Of these pairs, exactly."""
        used, place = np.unique(ray, return_inverse=True)
        exact = rays.exact(used, max(rays.grid, *(kind.grid for kind in self.kinds))).at(place)
        ends = [np.broadcast_to(end, len(rays)) for end in (rays.t_min, rays.t_max)]
        of = np.searchsorted(self.first, item, side="right") - 1
        rows = [np.flatnonzero(of == k) for k in range(len(self.kinds))]
        parts = [
            kind.roots(exact.at(some), item[some] - first, *(end[ray[some]] for end in ends))
            for kind, some, first in zip(self.kinds, rows, self.first, strict=False)
            if len(some)
        ]
        order = np.concatenate(rows)
        return Roots.all(parts, None if exact.s is None else exact.s[order]).at(np.argsort(order))

    def counts(self, rays: Rays) -> Ids:
        """(n,): how many surfaces each ray meets."""
        out = np.zeros(len(rays), int)
        for part, block, hits in self.hits(rays):
            met, doubt = hits.sure.copy(), np.flatnonzero(~hits.sure)
            if len(doubt):
                met[doubt] = self.roots(block, hits.ray[doubt], hits.item[doubt]).exists
            out[part] = np.bincount(hits.ray[met], minlength=len(block))
        return out

    def blocked(self, rays: Rays) -> Bools:
        """(n,): whether each ray meets anything."""
        return self.counts(rays) > 0

    def closest(self, rays: Rays, pairs: tuple[Ids, Ids] | None = None) -> Found:
        """What each ray meets first; of equally near surfaces, as Roots.before() has it. pairs: as of hits()."""
        index, t, unsure = np.full(len(rays), -1), _none(len(rays)), np.zeros(len(rays), bool)
        for part, block, hits in self.hits(rays, pairs):
            item, near, doubt, kept = _nearest(len(block), hits)
            left = kept[doubt[hits.ray[kept]]]
            if len(left):
                item[doubt], near.h[doubt] = -1, np.inf
                roots = self.roots(block, hits.ray[left], hits.item[left])
                first = _first(hits.ray[left], roots)
                rows = hits.ray[left[first]]
                item[rows], near.h[rows] = hits.item[left[first]], roots.at(first).rounded()
                near.l[doubt] = near.error[doubt] = 0
            index[part], unsure[part], t.h[part], t.l[part], t.error[part] = (item, doubt, near.h, near.l, near.error)
        return Found(self, rays, index, t, unsure)


def _limited(hits: Hits, rays: Rays) -> Hits:
    """Hits of rays that have begun at t_min, with t from their own starts, without those surely beyond t_max."""
    if not np.any(rays.t_min) and np.all(rays.t_max == np.inf):
        return hits
    low, high = (np.broadcast_to(end, len(rays))[hits.ray] for end in (rays.t_min, rays.t_max))
    t = hits.t + Fine.of(low)
    t = Fine(t.h, t.l, np.where(np.isfinite(hits.t.error), t.error, np.inf))
    limited = np.isfinite(high)
    gap = (t - Fine.of(np.where(limited, high, 0))).sign()
    # A ray that starts in a triangle's plane never meets it, and moving the start has hidden that.
    sure = hits.sure & (~limited | (gap < 0)) & (t.sign() != 0)
    kept = np.flatnonzero(~(hits.sure & limited & (gap > 0)) & (high > low))
    return Hits(hits.ray[kept], hits.item[kept], sure[kept], t[kept])


def _none(count: int) -> Fine:
    return Fine(np.full(count, np.inf), np.zeros(count), np.zeros(count))


def _nearest(count: int, hits: Hits) -> tuple[Ids, Fine, Bools, Ids]:
    """Of so many rays, the first hit: item and t, (n,); which rays are in doubt about it, and the hits, (k,) rows by
    rising ray and item, that are not surely behind another one."""
    with np.errstate(all="ignore"):
        known = np.flatnonzero(hits.sure & np.isfinite(hits.t.error))
        known = known[np.lexsort((hits.t.h[known], hits.ray[known]))[::-1]]
        best = np.full(count, -1)
        best[hits.ray[known]] = known  # of equal indices, the last one counts
        other = best[hits.ray]
        behind = (other >= 0) & ((hits.t - hits.t[other]).sign() > 0) if len(hits.ray) else np.zeros(0, bool)
    kept = np.flatnonzero(~behind)
    kept = kept[np.lexsort((hits.item[kept], hits.ray[kept]))]
    many = np.bincount(hits.ray[kept], minlength=count)
    found = best >= 0
    index, t = np.full(count, -1), _none(count)
    rows = best[found]
    index[found], t.h[found], t.l[found], t.error[found] = (
        hits.item[rows],
        *(x[rows] for x in (hits.t.h, hits.t.l, hits.t.error)),
    )
    return index, t, many > found, kept


def _first(ray: Ids, roots: Roots) -> Ids:
    """The rows of the roots that come first, one for each ray that meets something. ray: (k,), rising."""
    there = np.flatnonzero(roots.exists)
    ray = ray[there]
    first = np.flatnonzero(np.append(True, ray[1:] != ray[:-1])) if len(ray) else np.empty(0, int)
    count = np.diff(np.append(first, len(ray)))
    best = first.copy()
    for turn in range(1, int(count.max(initial=0))):
        group = np.flatnonzero(count > turn)
        a, b = best[group], first[group] + turn
        best[group] = np.where(roots.at(there[b]).before(roots.at(there[a])), b, a)
    return np.asarray(there[best])


@dataclass(frozen=True)
class Found:
    """What n rays meet first. item: (n,), rows of Kinds, -1 for none; t: (n,), to 2^-20 of itself, inf for none; doubt:
    (n,), which rays whole numbers decided."""

    kinds: Kinds
    rays: Rays
    item: Ids
    t: Fine
    doubt: Bools

    @property
    def is_rounded(self) -> Bools:
        """(n,): whether t is known to be correctly rounded."""
        h, low, error = self.t.h, self.t.l, self.t.error
        with np.errstate(all="ignore"):
            return np.asarray((self.item < 0) | ((h + (low + 2 * error) == h) & (h + (low - 2 * error) == h)))

    def rounded(self) -> Floats:
        """t correctly rounded, (n,)."""
        t, rows = self.t.h.copy(), np.flatnonzero(~self.is_rounded)
        if len(rows):
            t[rows] = self.kinds.roots(self.rays, rows, self.item[rows]).rounded()
        return t


def on_hits(rays: Rays, of: Kind, own: Ids) -> Points:
    """The points where rays with rational numbers meet surfaces of a kind: o + (b + side sqrt(D)) d / a.

    own: (n,), the row of each one, which its ray meets.
    """

    def exact(rows: Ids, grid: int) -> tuple[Whole, SurdVector]:
        some = rays.exact(rows, grid)
        roots = of.roots(some, own[rows], 0.0, np.inf)
        a, b, D = roots.a.p, roots.b.p, roots.D.p
        x, y, z = (Surds(a * o.p + b * d.p, roots.side * d.p, D) for o, d in zip(some.start, some.way, strict=True))
        return some.scale * a, (x, y, z)

    return Points(None, max(rays.grid, of.grid), exact, own, type(of))
