"""What rays meet first, or at all, of surfaces of all kinds: the one search of the oracle.

A kind of surfaces says what may meet, in doubles with bounds of their errors. What these leave in doubt is decided by
the exact engine, in first_of().
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats, dot
from cltrace.exact.fine import Fine
from cltrace.exact.lines import ExactPoint, Line, Root
from cltrace.oracle.rays import Ids, Points, Rays, rounded
from cltrace.scene import Scene

Bools = NDArray[np.bool_]

PAIRS_AT_ONCE = 1 << 15  # so many pairs of a ray and a surface are looked at in one go


class Hits(NamedTuple):
    """k pairs of a ray and a surface that meet, surely or maybe: rows, (k,) each, and t; its error may be infinite."""

    ray: Ids
    item: Ids
    sure: Bools
    t: Fine


class Solid(Protocol):
    """A surface as the exact engine has it."""

    def first(self, line: Line, t_min: float, t_max: float) -> Root | None:
        """Where a line meets it first, strictly between t_min and t_max."""


class Kind(ABC):
    """The surfaces of one kind. surface: (m,), their numbers in the scene."""

    surface: Ids

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
    def solid(self, item: int) -> Solid:
        """One of them, exactly."""


def near_balls(rays: Rays, centers: Floats, radii: Floats, known: Bools, most: float) -> tuple[Ids, Ids]:
    """Rays and balls, (k,) rows each: all pairs that may meet. known: (m,), which balls doubles may rule out.

    With f from the start to a centre, R its radius and u = 2^-53, a ray along w passes by where |f x w| > R |w|, and
    leads away where f.w < -R |w|. f = (C - anchor) - step is off by 2^-49 reach and 3 u (|f|_1 + reach), and w by 2^-50
    of its length. So f x w and f.w are off by less than 2^-47 s length for s = |f|_1 + reach, and |w| by 2^-50 length.
    Twice that covers the roundings beside these, and the rounding of a centre that is the middle of two points.
    """
    assert rays.rough is not None
    rough = rays.rough
    w, length = rounded(rough.way).T[:, :, None], rough.length[:, None]
    x, y, z = ((centers[:, i] - rough.anchor[:, i, None]) - rough.step[i].h[:, None] for i in range(3))
    u, v, s = y * w[2] - z * w[1], z * w[0] - x * w[2], x * w[1] - y * w[0]
    size = (np.abs(x) + np.abs(y) + np.abs(z)) + rough.reach[:, None]
    room = radii * (np.sqrt(dot(w, w)) + 2.0**-49 * length) + 2.0**-46 * (size + 1e-3 * radii) * length
    beside = (u * u + v * v + s * s > room * room) | (x * w[0] + y * w[1] + z * w[2] < -room)
    ray, item = np.nonzero(~(beside & rough.fits(most)[:, None] & known))
    return ray, item


class Kinds:
    """Surfaces of several kinds, whose rows are counted on from one kind to the next.

    first: the row of each kind's first one, and how many there are in all; surface, primitive: (m,), their numbers.
    """

    def __init__(self, kinds: Sequence[Kind]) -> None:
        self.kinds, self.first = kinds, np.cumsum([0, *(len(kind.surface) for kind in kinds)])
        self._solids: dict[int, Solid] = {}
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

    def root(self, rays: Rays, ray: int, item: int, line: Line | None = None) -> Root | None:
        """Where a ray meets a surface first within its range, exactly; line: the ray, if it is known already."""
        if item not in self._solids:
            of = int(np.searchsorted(self.first, item, side="right")) - 1
            self._solids[item] = self.kinds[of].solid(item - int(self.first[of]))
        return self._solids[item].first(line or rays.line(ray), *rays.range_of(ray))

    def first_of(self, rays: Rays, ray: int, items: Sequence[int]) -> tuple[int, Root] | None:
        """Which of these a ray meets first, exactly. Of equally near ones, that is the one of the lowest number."""
        best: tuple[int, Root] | None = None
        line = rays.line(ray)
        for item in sorted(items, key=lambda item: (self.surface[item], item)):
            root = self.root(rays, ray, item, line)
            if root is not None and (best is None or root < best[1]):
                best = item, root
        return best

    def counts(self, rays: Rays) -> Ids:
        """(n,): how many surfaces each ray meets."""
        out = np.zeros(len(rays), int)
        for part, block, hits in self.hits(rays):
            met = hits.sure.copy()
            for k in np.flatnonzero(~met).tolist():
                met[k] = self.root(block, int(hits.ray[k]), int(hits.item[k])) is not None
            out[part] = np.bincount(hits.ray[met], minlength=len(block))
        return out

    def blocked(self, rays: Rays) -> Bools:
        """(n,): whether each ray meets anything."""
        return self.counts(rays) > 0

    def closest(self, rays: Rays, pairs: tuple[Ids, Ids] | None = None) -> Found:
        """What each ray meets first; of equally near surfaces, as first_of() has it. pairs: as of hits()."""
        index, t, unsure = np.full(len(rays), -1), _none(len(rays)), np.zeros(len(rays), bool)
        for part, block, hits in self.hits(rays, pairs):
            item, near, doubt, kept = _nearest(len(block), hits)
            begin = np.searchsorted(hits.ray[kept], np.arange(len(block) + 1))
            for ray in np.flatnonzero(doubt).tolist():
                first = self.first_of(block, ray, hits.item[kept[begin[ray] : begin[ray + 1]]].tolist())
                item[ray], near.h[ray] = (first[0], float(first[1])) if first else (-1, np.inf)
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
        t = self.t.h.copy()
        for row in np.flatnonzero(~self.is_rounded).tolist():
            root = self.kinds.root(self.rays, row, int(self.item[row]))
            assert root is not None
            t[row] = float(root)
        return t


def on_hits(rays: Rays, of: Kind, own: Ids) -> Points:
    """The points where rays with rational numbers meet surfaces of a kind; own: (n,), the row of each one."""

    def place(i: int) -> ExactPoint:
        root = of.solid(int(own[i])).first(rays.line(i), 0.0, np.inf)
        if root is None:
            raise ValueError("the ray does not hit the surface")
        return root.point()

    return Points(None, place, own, type(of))
