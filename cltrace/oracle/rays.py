"""Rays as the oracle has them: in pairs of doubles that know their errors, and exactly, one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Floats, minus
from cltrace.exact.fine import Fine, FineVector, fine_vector
from cltrace.exact.lines import ExactPoint, Frame, Line

Ids = NDArray[np.int64]
LINES = 64  # exact lines that are kept, as several surfaces are asked about each


class Rough(NamedTuple):
    """n rays from anchor + step along way, in the world. anchor: (n, 3), exactly."""

    anchor: Floats
    step: FineVector
    way: FineVector

    def at(self, rows: Ids) -> Rough:
        step, way = (tuple(x[rows] for x in v) for v in (self.step, self.way))
        return Rough(self.anchor[rows], step, way)  # type: ignore[arg-type]

    @property
    def reach(self) -> Floats:
        """(n,): a bound of |step|_1, of which the rounded step is off by 2^-49 at most."""
        return bound_of(self.step)

    @property
    def length(self) -> Floats:
        """(n,): a bound of |way|_1, of which the rounded way is off by 2^-50 at most."""
        return bound_of(self.way)

    def fits(self, most: float) -> NDArray[np.bool_]:
        """(n,): for which rays the numbers of a filter are within its range, see moderate()."""
        w = rounded(self.way)
        return moderate(w, most) & moderate(rounded(self.step), most) & moderate(self.anchor, most) & w.any(axis=1)


def moderate(values: Floats, most: float) -> NDArray[np.bool_]:
    """(n,): which rows have numbers between 1 / most and most alone, or 0."""
    size = np.abs(values)
    return np.asarray(((size == 0) | ((size >= 1 / most) & (size <= most))).all(axis=1))


def bound_of(v: FineVector) -> Floats:
    """What rounded(v) is off by is 2^-53 of it, and twice the error: less than 2^-50 of this."""
    return np.asarray(sum(np.abs(x.h) + 2.0**52 * x.error for x in v))


def rounded(v: FineVector) -> Floats:
    return np.stack([x.h for x in v], axis=1)


@dataclass(frozen=True)
class Points:
    """n points where rays start. rough: the anchor and the step of Rough, None if only the exact engine knows them.

    place(i): the i-th point, exactly; own: (n,), rows of the surfaces of that kind on which the points are, -1 for
    none.
    """

    rough: tuple[Floats, FineVector] | None
    place: Callable[[int], ExactPoint]
    own: Ids
    kind: type | None = None


@dataclass(frozen=True)
class Rays:
    """n rays, which count for t_min < t < t_max, (n,) or one number for all. rough: None if the exact engine decides
    all; line(i): the i-th ray, exactly; the rest as of Points."""

    rough: Rough | None
    line: Callable[[int], Line]
    own: Ids
    kind: type | None = None
    t_min: float | Floats = 0.0
    t_max: float | Floats = np.inf

    def __len__(self) -> int:
        return len(self.own)

    def at(self, rows: Ids) -> Rays:
        rough = self.rough.at(rows) if self.rough else None
        low, high = (np.broadcast_to(end, len(self))[rows] for end in (self.t_min, self.t_max))
        return replace(
            self, rough=rough, line=lambda i: self.line(int(rows[i])), own=self.own[rows], t_min=low, t_max=high
        )

    def range_of(self, i: int) -> tuple[float, float]:
        """t_min and t_max of the i-th ray."""
        low, high = (float(np.broadcast_to(end, len(self))[i]) for end in (self.t_min, self.t_max))
        return low, high

    def begun(self) -> Rays:
        """The same rays from where t = t_min, for what doubles know of them: their t counts from there."""
        assert self.rough is not None
        if not np.any(self.t_min):
            return self
        t = Fine.of(np.broadcast_to(self.t_min, len(self)).copy())
        x, y, z = (step + t * way for step, way in zip(self.rough.step, self.rough.way, strict=True))
        return replace(self, rough=self.rough._replace(step=(x, y, z)))

    def left(self, kind: type) -> Ids:
        """(n,): rows of the surfaces of that kind that the rays leave, -1 for none."""
        return self.own if kind is self.kind else np.full(len(self), -1)


def at_point(place: ArrayLike, count: int) -> Points:
    """Points of the world for so many rays, (n, 3), or one for all, (3,): the eye."""
    anchor = np.broadcast_to(np.asarray(place, float), (count, 3))
    eye = ExactPoint.of(np.asarray(place, float).tolist()) if np.ndim(place) == 1 else None

    def exact(i: int) -> ExactPoint:
        return eye or ExactPoint.of(anchor[i].tolist())

    return Points((anchor, fine_vector(np.zeros((count, 3)))), exact, np.full(count, -1))


def turned(v: Floats, basis: ArrayLike) -> FineVector:
    """B^T v: vectors (n, 3) of camera space along the world's axes; basis: (3, 3), B, the camera's axes."""
    axes, parts = np.asarray(basis, float), fine_vector(v)

    def along_axis(column: Floats) -> Fine:
        terms = [Fine.of(np.array(e)) * x for e, x in zip(column, parts, strict=True) if e]
        return sum(terms[1:], terms[0])

    return along_axis(axes[:, 0]), along_axis(axes[:, 1]), along_axis(axes[:, 2])


def along(start: Points, direction: Floats, basis: ArrayLike) -> Rays:
    """Rays along B^T d: direction (n, 3), d, in camera space; basis: (3, 3), B, the camera's axes in the world."""
    axes = np.asarray(basis, float)
    frame = Frame(tuple(map(tuple, axes.tolist())))
    rough = Rough(*start.rough, turned(direction, axes)) if start.rough else None

    @lru_cache(maxsize=LINES)
    def line(i: int) -> Line:
        return Line(start.place(i), frame.to_world(direction[i].tolist()))

    return Rays(rough, line, start.own, start.kind)


def to_light(start: Points, light: ArrayLike, parallel: bool) -> Rays:
    """Shadow rays. light: (3,), the light's position, or the direction in which parallel light travels.

    From a light at a point they lead to the start, where t is 1.
    """
    place, count = np.asarray(light, float), len(start.own)
    if parallel:
        return along(start, np.broadcast_to(-place, (count, 3)), np.eye(3))
    source = ExactPoint.of(place.tolist())
    rough = None
    if start.rough:
        anchor, step = start.rough
        x, y, z = (a + b for a, b in zip(minus(fine_vector(anchor), fine_vector(place[None])), step, strict=True))
        rough = Rough(np.broadcast_to(place, (count, 3)), fine_vector(np.zeros((count, 3))), (x, y, z))

    @lru_cache(maxsize=LINES)
    def line(i: int) -> Line:
        return Line(source, start.place(i) - source)

    return Rays(rough, line, start.own, start.kind, t_max=1.0)
