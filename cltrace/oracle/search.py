"""What rays meet first, or at all, of surfaces of all kinds: the one search of the oracle.

A kind of surfaces says what may meet, in pairs of doubles that count their errors. What these leave in doubt is decided
by the exact engine, in first_of().
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import FLOOR, Fine, FineVector, Floats, fine_vector, minus
from cltrace.exact.lines import ExactPoint, Line, Root
from cltrace.scene import Scene

Bools = NDArray[np.bool_]
Ids = NDArray[np.int64]

PAIRS_AT_ONCE = 1 << 15  # so many pairs of a ray and a surface are looked at in one go


@dataclass(frozen=True)
class Rays:
    """n rays from anchor + step along way, in the world.

    anchor: (n, 3), exactly; step, way: in pairs, with infinite errors where only the exact engine decides; line(i): the
    i-th ray, exactly; t_min, t_max: (n,), the ends of what counts, where t_min is that of the ray's start, and `step`
    leads to where t is t_min; own: the kind of surfaces that rays leave, and (n,) which of these each one leaves.
    """

    anchor: Floats
    step: FineVector
    way: FineVector
    line: Callable[[int], Line]
    t_min: Floats
    t_max: Floats
    own: tuple[type[Kind], Ids] | None = None

    @classmethod
    def of(cls, o: Floats, d: Floats, t_min: float | Floats = 0.0, t_max: float | Floats = np.inf) -> Rays:
        """From o along d, (n, 3)."""
        low, high = (np.broadcast_to(t, len(o)) for t in (t_min, t_max))
        x, y, z = way = fine_vector(d)
        begin = Fine.of(low)
        with np.errstate(all="ignore"):
            step = (begin * x, begin * y, begin * z) if low.any() else fine_vector(np.zeros(d.shape))
        return cls(o, step, way, lambda i: Line(ExactPoint.of(o[i].tolist()), ExactPoint.of(d[i].tolist())), low, high)

    def __len__(self) -> int:
        return len(self.anchor)

    def to(self, points: Floats, ray: Ids) -> FineVector:
        """From where rays start to points, (k, 3), the i-th ray of `ray` to the i-th point."""
        x, y, z = (Fine.gap(points[:, i], self.anchor[ray, i]) for i in range(3))
        return minus((x, y, z), at(self.step, ray))

    def leaves(self, kind: Kind, ray: Ids, item: Ids) -> Bools:
        """(k,): which of these pairs are a ray and the surface of a kind that it leaves."""
        return self.own[1][ray] == item if self.own and isinstance(kind, self.own[0]) else np.zeros(len(ray), bool)


def at(v: FineVector, rows: Ids) -> FineVector:
    return v[0][rows], v[1][rows], v[2][rows]


class PairHits(NamedTuple):
    """k pairs of a ray and a surface that meet, surely or maybe: rows, (k,) each, and t; its error may be infinite."""

    ray: Ids
    item: Ids
    sure: Bools
    t: Fine

    @classmethod
    def of(cls, ray: Ids, item: Ids, sure: Bools, gone: Bools, t: Fine) -> PairHits:
        """Those of such pairs that do not surely pass each other by, with t where that is known well enough to help."""
        t = replace(t, error=np.where(sure & (t.error < 2.0**-41 * t.h), t.error, np.inf))
        return cls(ray, item, sure, t).at(np.flatnonzero(~gone))

    def at(self, rows: NDArray[np.intp]) -> PairHits:
        return PairHits(self.ray[rows], self.item[rows], self.sure[rows], self.t[rows])


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

    def primitives(self) -> Ids:
        """(m,): the number of each one in its mesh, -1 for none."""
        return np.full(len(self.surface), -1)

    @property
    @abstractmethod
    def balls(self) -> tuple[Floats, Floats]:
        """Balls around them: centres, (m, 3), and radii, (m,), no matter how much too large."""

    @abstractmethod
    def hits(self, rays: Rays, ray: Ids, item: Ids) -> PairHits:
        """Those of these pairs of a ray and a surface, (k,) each, that do not surely pass each other by, at t > 0."""

    @abstractmethod
    def solid(self, item: int) -> Solid:
        """One of them, exactly."""


def ball_around(points: Sequence[Floats], more: float | Floats = 0.0) -> tuple[Floats, Floats]:
    """Balls around points, (m, 3) each, and as much more: centres and radii."""
    center = np.mean(points, axis=0)
    far = np.max([np.sqrt(((p - center) ** 2).sum(axis=1)) for p in points], axis=0)
    return center, (far + more) * (1 + 2.0**-40)


def near_balls(rays: Rays, rows: slice, centers: Floats, radii: Floats) -> tuple[Ids, Ids]:
    """Some rays and balls, (k,) rows each: all pairs that may meet.

    With f from the start to a centre, R its radius and u = 2^-53, a ray along w passes by where |f x w| > R |w|, and
    leads away where f.w < -R |w|. The first numbers of the step and of w have errors of less than 2^-50 reach and 2^-50
    length, where reach and length are the sizes of step and w, and 2^52 times their errors. f = (C - anchor) - step has
    an error of that and 3 u (|f|_1 + reach). So those of f x w and f.w are less than 2^-47 length far for far =
    |f|_1 + reach, and that of |w| is 2^-50 length. Twice that covers all other roundings.
    """

    def size(v: FineVector) -> Floats:
        return np.asarray(sum(np.abs(x.h[rows]) + 2.0**52 * x.error[rows] for x in v))[:, None]

    w = [x.h[rows, None] for x in rays.way]
    x, y, z = ((centers[:, i] - rays.anchor[rows, i, None]) - rays.step[i].h[rows, None] for i in range(3))
    u, v, s = y * w[2] - z * w[1], z * w[0] - x * w[2], x * w[1] - y * w[0]
    length, far = size(rays.way), (np.abs(x) + np.abs(y) + np.abs(z)) + size(rays.step)
    room = radii * (np.hypot(np.hypot(w[0], w[1]), w[2]) + 2.0**-49 * length) + 2.0**-46 * far * length + FLOOR
    ray, item = np.nonzero(~((u * u + v * v + s * s > room * room + FLOOR) | (x * w[0] + y * w[1] + z * w[2] < -room)))
    return ray + rows.start, item


class Kinds:
    """Surfaces of several kinds, whose rows are counted on from one kind to the next.

    first: the row of each kind's first one, and how many there are in all; surface, primitive: (m,), their numbers.
    """

    def __init__(self, kinds: Sequence[Kind]) -> None:
        self.kinds, self.first = kinds, np.cumsum([0, *(len(kind.surface) for kind in kinds)])
        self.surface = np.concatenate([kind.surface for kind in kinds])
        self.primitive = np.concatenate([kind.primitives() for kind in kinds])
        self.balls = [kind.balls for kind in kinds]
        self.solid = functools.cache(self._solid)

    @property
    def extent(self) -> float:
        """No coordinate of any point of them is larger than this."""
        return max(float((np.abs(c).max(axis=1) + r).max(initial=0)) for c, r in self.balls)

    def hits(self, rays: Rays, pairs: tuple[Ids, Ids] | None = None) -> Iterator[tuple[slice, PairHits]]:
        """All hits, sure ones and others, for blocks of the rays.

        pairs: (k,) rays, rising, and surfaces that may meet, None for all.
        """
        many = int(self.first[-1]) if pairs is None else -(-len(pairs[0]) // max(1, len(rays)))
        size = max(1, PAIRS_AT_ONCE // max(1, many))
        for begin in range(0, len(rays), size):
            rows = slice(begin, min(begin + size, len(rays)))
            given = slice(*np.searchsorted(pairs[0], (rows.start, rows.stop))) if pairs else None
            parts = []
            with np.errstate(all="ignore"):  # what is not finite is not sure
                for kind, balls, first in zip(self.kinds, self.balls, self.first.tolist(), strict=False):
                    if pairs is None:
                        ray, item = near_balls(rays, rows, *balls)
                    else:
                        ray, item = pairs[0][given], pairs[1][given] - first
                        own = (item >= 0) & (item < len(kind.surface))
                        ray, item = ray[own], item[own]
                    hits = _limited(kind.hits(rays, ray, item), rays)
                    parts.append(hits._replace(item=hits.item + first))
            ray, item, sure = (np.concatenate([part[i] for part in parts]) for i in range(3))
            h, low, error = (np.concatenate([getattr(part.t, name) for part in parts]) for name in ("h", "l", "error"))
            yield rows, PairHits(ray, item, sure, Fine(h, low, error))

    def _solid(self, item: int) -> Solid:
        of = int(np.searchsorted(self.first, item, side="right")) - 1
        return self.kinds[of].solid(item - int(self.first[of]))

    def root(self, rays: Rays, ray: int, item: int, line: Line | None = None) -> Root | None:
        """Where a ray meets a surface first within its range, exactly; line: the ray, if it is known already."""
        return self.solid(item).first(line or rays.line(ray), float(rays.t_min[ray]), float(rays.t_max[ray]))

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
        for _, hits in self.hits(rays):
            met = hits.sure.copy()
            for k in np.flatnonzero(~met).tolist():
                met[k] = self.root(rays, int(hits.ray[k]), int(hits.item[k])) is not None
            np.add.at(out, hits.ray[met], 1)
        return out

    def closest(self, rays: Rays, pairs: tuple[Ids, Ids] | None = None) -> FirstItems:
        """What each ray meets first; of equally near surfaces, as first_of() has it. pairs: as of hits()."""
        n = len(rays)
        found = FirstItems(np.full(n, -1), Fine(np.full(n, np.inf), *np.zeros((2, n))), np.zeros(n, bool))
        t = found.t
        for rows, hits in self.hits(rays, pairs):
            # By rays, and of each ray the first hit that is known, if any, comes first.
            known = hits.sure & np.isfinite(hits.t.error)
            order = np.lexsort((np.where(known, hits.t.h, np.inf), hits.ray))
            hits, known = hits.at(order), known[order]
            begin = np.searchsorted(hits.ray, np.arange(rows.start, rows.stop + 1))
            best = begin[hits.ray - rows.start]
            with np.errstate(all="ignore"):
                kept = ~(known[best] & ((hits.t - hits.t[best]).sign() > 0))
            first = best[known & (best == np.arange(len(best)))]
            ray = hits.ray[first]
            found.item[ray], t.h[ray] = hits.item[first], hits.t.h[first]
            t.l[ray], t.error[ray] = hits.t.l[first], hits.t.error[first]
            left = np.bincount(hits.ray[kept] - rows.start, minlength=len(begin) - 1) > (found.item[rows] >= 0)
            for i in (np.flatnonzero(left) + rows.start).tolist():
                its = slice(*begin[[i - rows.start, i - rows.start + 1]])
                exact = self.first_of(rays, i, hits.item[its][kept[its]].tolist())
                found.item[i], t.h[i] = (exact[0], float(exact[1])) if exact else (-1, np.inf)
                t.l[i] = t.error[i] = 0
                found.doubt[i] = True
        return found

    def rounded(self, rays: Rays, found: FirstItems) -> Floats:
        """The t of what was found, correctly rounded, (n,)."""
        t = found.t.h.copy()
        for row in np.flatnonzero(~found.is_rounded).tolist():
            root = self.root(rays, row, int(found.item[row]))
            assert root is not None
            t[row] = float(root)
        return t


def _limited(hits: PairHits, rays: Rays) -> PairHits:
    """PairHits with t from the rays' own starts, without those surely beyond t_max."""
    low, high = rays.t_min[hits.ray], rays.t_max[hits.ray]
    if not low.any() and np.all(high == np.inf):
        return hits
    t = hits.t + Fine.of(low)
    limited = np.isfinite(high)
    gap = (t - Fine.of(np.where(limited, high, 0))).sign()
    # A ray that starts in a triangle's plane never meets it, and moving the start has hidden that.
    sure = hits.sure & (~limited | (gap < 0)) & (t.sign() != 0)
    kept = ~(hits.sure & limited & (gap > 0)) & (high > low)
    return PairHits(hits.ray, hits.item, sure, t).at(np.flatnonzero(kept))


class FirstItems(NamedTuple):
    """What n rays meet first. item: (n,), rows of Kinds, -1 for none; t: (n,), to 2^-40 of itself, inf for none; doubt:
    (n,), which rays whole numbers decided."""

    item: Ids
    t: Fine
    doubt: Bools

    @property
    def is_rounded(self) -> Bools:
        """(n,): whether t is known to be correctly rounded."""
        with np.errstate(all="ignore"):
            return np.asarray((self.item < 0) | self.t.is_rounded)
