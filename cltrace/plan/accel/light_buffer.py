"""Light buffers: the directions from a light in cells, each with the surfaces that can stop a shadow ray there.

A point light has a grid on each side of a cube around it, the direction cube (Haines and Greenberg 1986). A side on
which nothing is to be seen has none. Where many discs crowd in a small part of a side, as far down a tunnel, those that
fit into a window around that part have a grid of their own, with cells of their size, and so on. A parallel light has
one grid, on the plane across it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import concurrently
from cltrace.plan.accel.cells import SLACK, CellGrid, Held, Outlines, Place, outlines_of, put_together, sprawling
from cltrace.plan.accel.silhouettes import (
    Cast,
    Cube,
    Elsewhere,
    Extent,
    Pane,
    Part,
    Real,
    Reals,
    Shadows,
    Silhouettes,
    sizes_of,
)
from cltrace.plan.rounding import Array, Mask

# Where float32 tells cells apart, they are at least so wide, 32 times SLACK: see _on_window(). A window of 2^-4 has
# room for the most that there may be, and a window in one, NARROWEST at least, for 128 of them across.
NARROW, NARROWEST, LEAST = 2.0**-4, 2.0**-8, 2.0**-15
# The cells of a light's grid are made for so many entries, besides those for each polygon.
FINER = 2**14
# Cells of a window of parallel light that are narrower than this are too narrow for float32.
TINY = 2.0**-16
# Discs in more layers than this have finer cells; and those of a side on which many crowd, in more than this.
LAYERS, CROWDED_LAYERS = 32, 2
# One in so many discs is looked at to know the size of most, and where they are.
SAMPLE = 16
# Discs crowd where a pane of so many times smaller sides than their window's holds a SHARE-th of them, and FEW at
# least; if discs are all over a window, it holds a sixteenth. They have a window of their own if most of them are less
# than half as large as most others, as what is far away is. Down a tunnel with 100 lights, frames of 20,000 balls take
# 0.55 of the time then; with finer cells in one window instead they took 0.72, in more memory. In a galaxy, where all
# are as large, windows in windows took 1.05.
SMALLER, SHARE, FEW = 4, 4, 256
# Panes into which all discs fit, and none: left, right, low and high.
EVERYWHERE, NOWHERE = (-np.inf, np.inf, -np.inf, np.inf), (np.inf, -np.inf, np.inf, -np.inf)
# Each has an axis and a sign.
SIDES = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
# What is seen through a side of the cube: slopes of at most 1, and a few roundings more.
SIDE = Pane((0, 0), (1 + 2.0**-16, 1 + 2.0**-16))


def point_buffer(shapes: Sequence[Silhouettes], who: Shadows) -> list[CellGrid]:
    """The grids of a light at a point. shapes: surfaces as seen from the light, in the order of SHAPES."""
    axes = cube_of([points[sampled(len(points))] for points in (silhouettes.points for silhouettes in shapes)])

    def cast(real: Real, sides: list[tuple[int, float]], pane: Pane = SIDE) -> list[list[Part]]:
        found = [silhouettes.on_sides(Cube(axes, sides, pane, real), who) for silhouettes in shapes]
        return [[part for parts in of_side for part in parts] for of_side in zip(*found, strict=True)]

    grids = []
    for (axis, sign), parts in zip(SIDES, cast(np.float32, SIDES), strict=True):
        window = window_of([part.extent for part in parts], SLACK, True)
        if window is None:
            continue
        if not window.coarse and who.slack < SLACK:
            (parts,) = cast(np.float64, [(axis, sign)], window.pane(who.slack))
            window = window_of([part.extent for part in parts], who.slack, True)
            if window is None:
                continue
            window = window._replace(coarse=False)
        slack, nest = SLACK if window.coarse else who.slack, _nest_of(window, parts)
        discs = [part for part in parts if isinstance(part, Cast) and part.corner is None]
        nests = [nest]
        if len(discs) == len(parts):
            nests = nests_of(nest, _some([part.edges_of for part in discs]), [part.extent for part in discs])
        grids += [_on_window(side_axes(axes, axis, sign), parts, each, slack, True) for each in nests]
    return grids


def sampled(n: int) -> slice:
    """Which of n points tell cube_of() where they are."""
    return slice(None, None, n // 4096 + 1)


def side_axes(cube: Array, axis: int, sign: float) -> Array:
    """(3, 3): of a side of the cube, the two axes across and the one that leads there."""
    return np.asarray(cube[[(axis + 1) % 3, (axis + 2) % 3, axis]] * np.array([1, 1, sign])[:, None])


def cube_of(offsets: list[Array]) -> Array:
    """(3, 3): three axes at right angles. The last one points about at the middle of points (n, 3), or away from it.

    So the discs of a distant group of spheres are in the middle of one side of the cube, not on an edge.
    """
    some = np.concatenate(offsets)
    middle = some.min(axis=0) / 2 + some.max(axis=0) / 2
    if np.abs(middle).max() < 2.0**-20:
        return np.eye(3)
    # Householder's reflection of the last axis onto that direction: it keeps right angles to the last digits.
    ahead = middle / np.abs(middle).max()
    ahead /= np.sqrt((ahead * ahead).sum())
    v = ahead + np.array([0, 0, np.copysign(1, ahead[2])])
    return np.asarray(np.eye(3) - 2 * np.outer(v, v) / (v * v).sum())


def parallel_buffer(axes: Array, shapes: Sequence[Silhouettes], who: Shadows) -> list[CellGrid]:
    """The grid of a parallel light; none if it can shadow nothing.

    axes: (3, 3), the two across and the one towards the light; shapes: surfaces as seen from the eye.
    """
    for real in (np.float32, np.float64):
        parts: list[Part] = [part for silhouettes in shapes for part in silhouettes.across(axes, who, real)]
        window = window_of([part.extent for part in parts], who.slack, False)
        if window is None or not window.is_tiny(sum(part.members for part in parts)):
            break
    return [] if window is None else [_on_window(axes, parts, _nest_of(window, parts), who.slack, False)]


class Side(NamedTuple):
    """One axis of a window: where it begins and ends, how many cells a unit of length has, and the last cell."""

    first: float
    stop: float
    scale: float
    last: int


class Rectangle(NamedTuple):
    """The rectangle of a grid.

    middle: (2,); half: (2,), half of its sides; furthest: the depth where the last ray ends; coarse: whether float32
    tells its cells apart.
    """

    middle: Array
    half: Array
    furthest: float
    coarse: bool

    def is_tiny(self, members: int) -> bool:
        """Whether float32, in which places are off by 2^-23, is too coarse for cells of a light that sees so many."""
        return bool(4 * self.half.prod() < max(members, FINER) * TINY**2)

    def pane(self, slack: float) -> Pane:
        """What is seen through it, also by rays whose slopes are off by a few `slack`."""
        (x, y), (wide, high) = self.middle.tolist(), (self.half + 4 * slack).tolist()
        return Pane((x, y), (wide, high))

    def cells(self, sizes: Reals, members: int, entries: float, deep: float) -> tuple[int, int]:
        """Columns and rows, of cells that are about square.

        sizes: of some discs and polygons; members: how many there are; entries: of Cast, the most of any; deep: discs
        in more layers than this have finer cells.
        """
        # Cells as wide as 2 discs were within 5 % of the fastest, for 64 to a million spheres in whatever layout: each
        # one has (1 + 1 / 2)^2 entries then, on average. There are about as many cells as discs, at most; but two a
        # side at least, as the kernel looks up no window of one cell. Where discs lie in many layers, lists are long,
        # and cells as wide as one disc are faster: a million spheres in 7,000 layers take 0.5 of the time, and 0.34
        # with half of that width, but 9 entries for each.
        sides, size = 2 * self.half, float(np.median(sizes))
        layers = members * size**2 / (sides[0] * sides[1])
        wanted = entries + min(FINER / max(1, members), 64) if entries else 4 if layers > deep else 2.25
        most = max(members, FINER if entries else 2)
        cell = max(size / (np.sqrt(wanted) - 1), np.sqrt(sides[0] * sides[1] / most))
        limits = [min(2048, int(s / LEAST)) if self.coarse else 2048 for s in sides]
        columns, rows = (int(np.clip(np.ceil(s / cell), 2, limit)) for s, limit in zip(sides, limits, strict=True))
        return columns, rows

    def sides(self, cells: tuple[int, int]) -> tuple[Side, Side]:
        """Both axes, if there are so many cells."""
        low, wide = (self.middle - self.half).tolist(), (2 * self.half).tolist()
        x, y = (Side(a, a + s, n / s, n - 1) for a, s, n in zip(low, wide, cells, strict=True))
        return x, y


class Nest(NamedTuple):
    """A window for those discs that fit into a pane, but not into another one, which has a window of its own.

    sizes: of some of them, see Rectangle.cells(); members: how many there are, about; fits, beside: left, right, low
    and high of both panes; deep: of Rectangle.cells().
    """

    window: Rectangle
    sizes: Reals
    members: int
    fits: tuple[float, ...] = EVERYWHERE
    beside: tuple[float, ...] = NOWHERE
    deep: float = LAYERS

    def holds(self, edges: Sequence[Reals]) -> Mask:
        """(n,): which discs with these edges, four of (n,), are its own."""
        return _fit(edges, self.fits) & ~_fit(edges, self.beside)


def _fit(edges: Reals | Sequence[Reals], pane: tuple[float, ...]) -> Mask:
    left, right, low, high = edges
    return np.asarray((left >= pane[0]) & (right <= pane[1]) & (low >= pane[2]) & (high <= pane[3]))


def _nest_of(window: Rectangle, parts: Sequence[Part]) -> Nest:
    """The window of all that is seen in it."""
    return Nest(window, _some([part.sizes for part in parts]), sum(part.members for part in parts))


def _some(parts: list[Callable[[int], Reals]]) -> Reals:
    """What parts say of those whose indices SAMPLE divides, or of all of them if there is none."""
    for sample in (SAMPLE, 1):
        found = np.concatenate([part(sample) for part in parts], axis=-1)
        if found.size:
            break
    return found


def nests_of(whole: Nest, edges: Reals, extents: list[Extent]) -> list[Nest]:
    """A side's window, and one around where the discs crowd in it, one around where they crowd in that, and so on.

    A ray looks into all windows that it passes. So each disc is in one of them alone, the innermost one that has all
    rays that may meet it. whole: the window of all discs; edges: (4, s), of some of them; extents: of all of them.
    """
    found = [whole]
    while (crowd := _crowd_of(found[0].window, edges)) is not None:
        outer = found[0]
        (left, right, low, high), fits = crowd, outer.fits
        pane = max(left, fits[0]), min(right, fits[1]), max(low, fits[2]), min(high, fits[3])
        inside = _fit(edges, pane)
        inner, rest = sizes_of(edges[:, inside]), sizes_of(edges[:, ~inside])
        more = outer.members * int(inside.sum()) // len(inside)
        if more < FEW or SHARE * more < outer.members or not len(rest) or 2 * np.median(inner) >= np.median(rest):
            break
        window = window_of([extent._replace(spans=[list(pane), extent.spans[1]]) for extent in extents], SLACK, True)
        if window is None or (2 * window.half < NARROWEST).any():
            break
        outer = outer._replace(sizes=rest, members=outer.members - more, beside=pane, deep=CROWDED_LAYERS)
        narrow = Nest(window._replace(coarse=True), inner, more, fits=pane, deep=CROWDED_LAYERS)
        found[:1], edges = [narrow, outer], edges[:, inside]
    return found


def _crowd_of(window: Rectangle, edges: Reals) -> tuple[float, ...] | None:
    """A pane in the middle of most of a window's discs, if float32 tells its cells apart."""
    known, half = edges[:, np.isfinite(edges).all(axis=0)], window.half / SMALLER
    if not known.size or not window.coarse:
        return None
    middle = np.median((known[::2] + known[1::2]) / 2, axis=1).astype(np.float64)
    (left, low), (right, high) = ((middle + sign * half).astype(np.float32).tolist() for sign in (-1, 1))
    return left, right, low, high


def window_of(extents: list[Extent], slack: float, perspective: bool) -> Rectangle | None:
    """The window that holds what is common to the extent of all discs and to that of those where shadow rays end.

    On the side of a cube, it ends at +-1. None if there is nothing in common.
    """
    spans = np.array([extent.spans for extent in extents])
    (least, first), (most, last) = spans[:, :, ::2].min(axis=0), spans[:, :, 1::2].max(axis=0)
    if (first > last).any():
        return None
    # The end of a ray that is 2^-8 or more from the light is seen from there where it is, but for 256 slack. Nearer to
    # the light it may be seen anywhere. Of a light at a point, `nearest` is a squared distance.
    if not perspective or min(extent.nearest for extent in extents) > 2.0**-16:
        room = 256 * slack * (1 + np.maximum(np.abs(first), np.abs(last)))
        least, most = np.maximum(least, first - room), np.minimum(most, last + room)
        if (least > most).any():
            return None
    limit = 1 + SLACK if perspective else np.inf
    loose = slack * (1 + 2 * np.maximum(np.abs(least), np.abs(most)))
    low, high = np.maximum(least - loose, -limit), np.minimum(most + loose, limit)
    half = np.maximum((high - low) / 2, 2.0**-60) * (1 + SLACK)
    # Where the discs fill little of the cube's side, float32 would be too coarse for its cells.
    coarse = perspective and bool((half > NARROW / 2).all())
    return Rectangle((low + high) / 2, half, max(extent.furthest for extent in extents), coarse)


def _on_window(axes: Array, parts: Sequence[Part], nest: Nest, slack: float, perspective: bool) -> CellGrid:
    """The grid of a window. perspective: of CellGrid."""
    here = [part for part in parts if isinstance(part, Cast)]
    shown = [part for part in parts if not isinstance(part, Cast)]
    flat: list[Part] = [part for part in parts if part.entries and part.members]
    window = nest.window
    cells = window.cells(nest.sizes, nest.members, max((part.entries for part in flat), default=0), nest.deep)
    low, sides = window.middle - window.half, 2 * window.half
    scale = np.array(cells) / sides
    # The largest coordinate of a corner; corners in cells are off by this, beside `loose`.
    most = max((abs(x) for part in flat for x in part.extent.spans[0]), default=0)

    def off_by(loose: Array | float) -> Any:
        return (slack * (1 + 2 * most) + loose) * scale.max() + 1 / 64

    def place(part: Cast) -> tuple[tuple[NDArray[Any], ...], Outlines | None]:
        # A sphere that is wholly beside the window, or beyond where the last ray ends, is met by no ray of the window.
        within = (part.near < window.furthest) & nest.holds(part.edges)
        covers = np.empty((4, len(within)), np.int16)
        for k, (begin, end, side) in enumerate(
            zip(part.edges[::2], part.edges[1::2], window.sides(cells), strict=True)
        ):
            loose = slack * (1 + np.abs(begin) + np.abs(end))
            begin, end = begin - loose, end + loose
            within &= (end >= side.first) & (begin <= side.stop)
            # A 64th of a cell more, as the kernel computes column and row in float32: they may be off by that.
            covers[k] = np.clip((begin - side.first) * side.scale - 1 / 64, 0, side.last)
            covers[2 + k] = np.clip((end - side.first) * side.scale + 1 / 64, 0, side.last)
            covers[2 + k] -= covers[k]
        which = np.flatnonzero(within)
        covers = covers.take(which, axis=1)
        return (part.member[which], covers, part.near[which]), outlined(part, which, covers)

    def outlined(part: Cast, which: NDArray[np.intp], covers: NDArray[np.int16]) -> Outlines | None:
        if part.corner is None:
            return None
        at = sprawling(covers)
        corner = (part.corner(which.take(at)) - low[:, None, None]) * scale[:, None, None]
        loose = part.loose[which[at]] if part.loose.ndim else part.loose
        return outlines_of(at, corner, off_by(loose))

    def elsewhere(part: Elsewhere) -> Held:
        off, (x, y) = float(off_by(part.loose)), window.sides(cells)
        lead: Any = {"low": tuple(low.tolist()), "scale": tuple(scale.tolist())}
        return part.on(Place((x, y), part.loose, off, **lead, slack=slack, furthest=window.furthest))

    listed = put_together(concurrently([partial(place, part) for part in here]))._asdict()
    grid = CellGrid(axes, window.middle, window.half, cells, **listed, perspective=perspective, coarse=window.coarse)
    return replace(grid, polygons=bool(flat), held=elsewhere(*shown) if shown else None)
