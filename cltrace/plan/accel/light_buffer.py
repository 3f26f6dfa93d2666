"""Light buffers: the directions from a light in cells, each with the spheres that can stop a shadow ray there.

A point light has a grid on each side of a cube around it, the direction cube (Haines and Greenberg 1986). A side on
which nothing is to be seen has none. A parallel light has one grid, on the plane across it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.blocks import blockwise, concurrently
from cltrace.plan.accel.cells import (
    BLOCK,
    SLACK,
    CellGrid,
    Held,
    Ints,
    Mask,
    Outlines,
    Place,
    areas,
    joined,
    joined_outlines,
    outlines_of,
    sprawling,
)
from cltrace.plan.exact import Array, along, rounded_down
from cltrace.plan.shapes.polygon import TURNED, Corners, Pane, Polygons, Shown, View, polygons
from cltrace.plan.shapes.sphere import Reals, Seen, length, nearest, slopes

# The same as SLACK, for arithmetic in double.
FINE_SLACK = 2.0**-44
# The cells of a window that is at least so wide are at least 2^-15 wide, 32 times SLACK: see _on_window().
NARROW = 2.0**-4
# The cells of a light's grid are made for so many entries, besides 1.6 for each triangle.
FINER = 2**14
# Discs in more layers than this have finer cells.
CROWDED = 32
# One in so many discs is looked at to know the size of most.
SAMPLE = 16


# Each has an axis and a sign.
SIDES = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
NOTHING = np.zeros(())
# What is seen through a side of the cube: slopes of at most 1, and a few roundings more.
SIDE = Pane((0, 0), (1 + 2.0**-16, 1 + 2.0**-16), (1, 1), (0, 0))


class Shadows(NamedTuple):
    """Who takes part in shadows.

    occluder: (n,), the surfaces that may stop light, which are the ones to enter, spheres first, then triangles;
    receiver: (n,), those of them on which shadow rays may end; slack: SLACK if the kernel decides in
    float32, else FINE_SLACK.
    """

    occluder: Mask
    receiver: Mask
    slack: float


def point_buffer(seen: Seen, who: Shadows, corners: Corners | None = None) -> list[CellGrid]:
    """The grids of a light at a point, at most six.

    seen: spheres from the light, along the camera's axes; corners: triangles from there, None for none.
    """
    offsets = [seen.center] if corners is None else [seen.center, corners.vertex]
    cube = cube_of([offset[sampled(len(offset))] for offset in offsets])

    def look(real: type[np.floating[Any]], sides: list[tuple[int, float]], block: slice) -> list[_Discs]:
        x, y, z = np.ascontiguousarray(seen.center[block].T)
        exact = [row[0] * x + row[1] * y + row[2] * z for row in cube]
        f, exact_r = [axis.astype(real) for axis in exact], seen.radius[block]
        r, distance = exact_r.astype(real), length(*f)
        near, far = nearest(distance, r, seen.power[block]), (distance + r) ** 2 * real(1 + 2.0**-10)
        size = [np.abs(axis) for axis in f]
        # How far beyond the face of a pyramid a centre may be if its sphere still reaches into the pyramid.
        reach = r * real(2**0.5 * (1 + SLACK)) + np.maximum(np.maximum(size[0], size[1]), size[2]) * real(SLACK)
        reach[~who.occluder[block]] = -np.inf
        found = []
        for axis, sign in sides:
            # What is seen through a side of the cube is the pyramid |c| <= d, |e| <= d, with d along the side's axis.
            right, up = (axis + 1) % 3, (axis + 2) % 3
            i = np.flatnonzero(np.maximum(size[right], size[up]) <= (reach + f[axis] if sign > 0 else reach - f[axis]))
            d, radii = exact[axis][i] * sign, exact_r[i]
            gap = ((d - radii) * (d + radii)).astype(real)
            edges = slopes([f[right][i], f[up][i]], d.astype(real), r[i], gap)
            member = (block.start + i).astype(np.int32)
            found.append(_Discs.of(member, edges, near[i], far[i], who.receiver[block][i]))
        return found

    def discs_of(real: type[np.floating[Any]], sides: list[tuple[int, float]], pane: Pane = SIDE) -> list[list[_Part]]:
        found: list[list[_Part]] = [
            list(discs) for discs in zip(*blockwise(len(seen.radius), partial(look, real, sides), BLOCK), strict=True)
        ]
        if corners is None:
            return found
        if corners.sight and real is np.float32:
            asked, ends = corners.of(who.occluder), corners.of(who.receiver)
            shown = corners.sight.see(cube, [SIDES.index(side) for side in sides], pane, asked, ends)
            for parts, side, part in zip(found, sides, shown, strict=True):
                rest = corners.some(part.rest)
                parts += [_Shown(part, _loose(pane))] if part.members else []
                parts += _triangles(rest, _turned(cube, rest.vertex), side, who, pane, real)
            return found
        vertex = _turned(cube, corners.vertex)
        for parts, side in zip(found, sides, strict=True):
            parts += _triangles(corners, vertex, side, who, pane, real)
        return found

    grids = []
    for (axis, sign), discs in zip(SIDES, discs_of(np.float32, SIDES), strict=True):
        window = window_of([part.extent for part in discs], SLACK, True)
        if window is None:
            continue
        if not window.coarse and who.slack < SLACK:
            (discs,) = discs_of(np.float64, [(axis, sign)], window.pane(who.slack))
            window = window_of([part.extent for part in discs], who.slack, True)
            if window is None:
                continue
            window = window._replace(coarse=False)
        grids.append(
            _on_window(side_axes(cube, axis, sign), discs, window, SLACK if window.coarse else who.slack, True)
        )
    return grids


def _loose(pane: Pane) -> float:
    """By how much corners of polygons are off in double, beside what the caller allows for roundings to `real`."""
    return TURNED * (1 + max(pane.largest)) ** 2


def _triangles(
    corners: Corners,
    vertex: Array,
    side: tuple[int, float],
    who: Shadows,
    pane: Pane,
    real: type[np.floating[Any]],
) -> list[_Discs]:
    """The triangles that are seen through a side of the cube, or through a part of it.

    vertex: (3, v), along the cube's axes.
    """
    axis, sign = side
    view = View((vertex[(axis + 1) % 3], vertex[(axis + 2) % 3], vertex[axis]), (1, 1, sign))

    def place(part: Polygons) -> _Discs:
        member = corners.primitives(part.triangle)
        loose = part.loose + _loose(pane)
        edges = [edge - loose if k % 2 == 0 else edge + loose for k, edge in enumerate(part.edges)]
        return _Discs.of(member, edges, part.near, part.far, who.receiver[member], part.corner, loose)

    return polygons(view, corners.face, corners.of(who.occluder), pane, real, place)


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


def parallel_buffer(axes: Array, seen: Seen, who: Shadows, corners: Corners | None = None) -> list[CellGrid]:
    """The grid of a parallel light; none if it can shadow nothing.

    axes: (3, 3), the two across and the one towards the light; seen, corners: spheres and triangles from the eye.
    """

    def look(block: slice) -> _Discs:
        i = np.flatnonzero(who.occluder[block])
        c, r = seen.center[block][i], seen.radius[block][i]
        u, v, s = along(axes, c)
        near = rounded_down(-(s + r) - SLACK * (np.abs(s) + r) - 2.0**-100)
        member = (block.start + i).astype(np.int32)
        return _Discs.of(member, [u - r, u + r, v - r, v + r], near, r - s + 2.0**-10, who.receiver[block][i])

    discs = blockwise(len(seen.radius), look, BLOCK)
    if corners is not None:
        discs += _triangles_along(corners, axes, who)
    window = window_of([part.extent for part in discs], who.slack, False)
    return [] if window is None else [_on_window(axes, discs, window, who.slack, False)]


def _triangles_along(corners: Corners, axes: Array, who: Shadows) -> list[_Discs]:
    """The triangles as a parallel light sees them."""
    across = _turned(axes, corners.vertex)

    def look(block: slice) -> _Discs:
        member = np.flatnonzero(who.occluder[corners.first + block.start : corners.first + block.stop])
        triangle = corners.face[block][member].T
        member = (member + (corners.first + block.start)).astype(np.int32)
        corner = np.stack([[axis[which] for which in triangle] for axis in across])
        least, most = corner[2].min(axis=0), corner[2].max(axis=0)
        # Lengths are about 1: the kernel's depths, too, are right to SLACK of themselves and to this.
        near = rounded_down(-most - SLACK * np.abs(most) - who.slack)
        edges = [bound for values in corner[:2] for bound in (values.min(axis=0), values.max(axis=0))]
        return _Discs.of(member, edges, near, 2.0**-10 - least, who.receiver[member], corner[:2])

    return blockwise(len(corners.face), look, BLOCK)


def _turned(rows: Array, vertex: Array) -> Array:
    """(3, v): the vertices (v, 3) in the coordinate system of `rows`, (3, 3)."""
    out = np.empty((3, len(vertex)))

    def turn(block: slice) -> None:
        x, y, z = np.ascontiguousarray(vertex[block].T)
        for axis, row in zip(out, rows, strict=True):
            axis[block] = row[0] * x + row[1] * y + row[2] * z

    blockwise(len(vertex), turn)
    return out


class Extent(NamedTuple):
    """Of discs and polygons.

    spans: two lists of the outermost left, right, low and high edge, first of all of them, then of those where shadow
    rays end; nearest, furthest: bounds of the depth of all points where shadow rays end.
    """

    spans: list[list[float]]
    nearest: float
    furthest: float


@dataclass(frozen=True)
class _Discs:
    """n spheres as discs, or triangles as polygons, in the plane of a grid.

    member: (n,), their indices; edges: four of (n,), their left, right, low and high coordinates; near: (n,), a lower
    bound of the depth of their nearest points; corner: (2, c, n), of polygons; loose: (n,) or (), how far off those
    are, besides a few roundings. It is in the edges already.
    """

    member: Ints
    edges: list[Reals]
    near: NDArray[np.float32]
    extent: Extent
    corner: Reals | None
    loose: Array

    @staticmethod
    def of(
        member: Ints,
        edges: list[Reals],
        near: NDArray[np.float32],
        far: Reals,
        receiver: Mask,
        corner: Reals | None = None,
        loose: Array = NOTHING,
    ) -> _Discs:
        """far: (n,), upper bounds of the depth of their furthest points; receiver: (n,), where shadow rays end."""
        ends = np.flatnonzero(receiver)
        spans = [[_extreme(k, edge[which]) for k, edge in enumerate(edges)] for which in (slice(None), ends)]
        nearest, furthest = float(near[ends].min(initial=np.inf)), float(far[ends].max(initial=-np.inf))
        return _Discs(member, edges, near, Extent(spans, nearest, furthest), corner, loose)

    def sizes(self, sample: int) -> Reals:
        """The width and the height of discs whose indices `sample` divides.

        Of polygons, it is the side of a square of twice the area.
        """
        which = np.flatnonzero(self.member % sample == 0)
        if self.corner is None:
            return np.concatenate([self.edges[k + 1][which] - self.edges[k][which] for k in (0, 2)])
        return np.asarray(np.sqrt(2 * areas(self.corner.take(which, axis=2))))


def _extreme(k: int, edge: Reals) -> float:
    """The outermost one of left, right, low or high edges, by k = 0, 1, 2 or 3."""
    return float(edge.max(initial=-np.inf) if k % 2 else edge.min(initial=np.inf))


@dataclass(frozen=True)
class _Shown:
    """The same, kept elsewhere. loose: of _Discs."""

    shown: Shown
    loose: float

    @property
    def extent(self) -> Extent:
        spans = (self.shown.edges + np.array([-1, 1, -1, 1]) * self.loose).tolist()
        return Extent(spans, self.shown.nearest, self.shown.furthest)

    def sizes(self, sample: int) -> Reals:
        return np.asarray(np.sqrt(2 * self.shown.areas(sample)))


_Part = _Discs | _Shown


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

    def pane(self, slack: float) -> Pane:
        """What is seen through it, also by rays whose slopes are off by a few `slack`."""
        (x, y), (wide, high) = self.middle.tolist(), (self.half + 4 * slack).tolist()
        return Pane((x, y), (wide, high), (1, 1), (0, 0))

    def cells(self, sizes: Reals, members: int, polygons: bool) -> tuple[int, int]:
        """Columns and rows, of cells that are about square.

        sizes: of some discs and polygons; members: how many there are; polygons: whether there are any of these.
        """
        # Cells as wide as 2 discs were within 5 % of the fastest, for 64 to a million spheres in whatever layout: each
        # one has (1 + 1 / 2)^2 entries then, on average. There are about as many cells as discs, at most; but two a
        # side at least, as the kernel looks up no window of one cell. Where discs lie in many layers, lists are long,
        # and cells as wide as one disc are faster: a million spheres in 7,000 layers take 0.5 of the time, and 0.34
        # with half of that width, but 9 entries for each. Triangles take longer to enter than to try, and few of them
        # may have many entries: for five meshes of 1,000 to 100,000, twice as many or half as many change little.
        sides, size = 2 * self.half, float(np.median(sizes))
        layers = members * size**2 / (sides[0] * sides[1])
        entries = 1.6 + min(FINER / max(1, members), 64) if polygons else 4 if layers > CROWDED else 2.25
        most = max(members, FINER if polygons else 2)
        cell = max(size / (np.sqrt(entries) - 1), np.sqrt(sides[0] * sides[1] / most))
        columns, rows = (int(np.clip(np.ceil(s / cell), 2, 2048)) for s in sides)
        return columns, rows

    def sides(self, cells: tuple[int, int]) -> tuple[Side, Side]:
        """Both axes, if there are so many cells."""
        low, wide = (self.middle - self.half).tolist(), (2 * self.half).tolist()
        x, y = (Side(a, a + s, n / s, n - 1) for a, s, n in zip(low, wide, cells, strict=True))
        return x, y


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


def _on_window(axes: Array, parts: Sequence[_Part], window: Rectangle, slack: float, perspective: bool) -> CellGrid:
    """The grid of a window. perspective: of CellGrid."""
    discs = [part for part in parts if isinstance(part, _Discs)]
    shown = [part for part in parts if isinstance(part, _Shown)]
    flat: list[_Part] = [*shown, *(part for part in discs if part.corner is not None)]
    sizes = np.concatenate([part.sizes(SAMPLE) for part in parts])
    if not len(sizes):
        sizes = np.concatenate([part.sizes(1) for part in parts])
    members = sum(len(part.member) for part in discs) + sum(part.shown.members for part in shown)
    cells = window.cells(sizes, members, bool(flat))
    low, sides = window.middle - window.half, 2 * window.half
    scale = np.array(cells) / sides
    # The largest coordinate of a corner; corners in cells are off by this, beside `loose`.
    most = max((abs(x) for part in flat for x in part.extent.spans[0]), default=0)

    def off_by(loose: Array | float) -> Any:
        return (slack * (1 + 2 * most) + loose) * scale.max() + 1 / 64

    def place(part: _Discs) -> tuple[tuple[NDArray[Any], ...], Outlines | None]:
        # A sphere that is wholly beside the window, or beyond where the last ray ends, is met by no ray of the window.
        within = part.near < window.furthest
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

    def outlined(part: _Discs, which: NDArray[np.intp], covers: NDArray[np.int16]) -> Outlines | None:
        if part.corner is None:
            return None
        at = sprawling(covers)
        corner = (part.corner.take(which.take(at), axis=2) - low[:, None, None]) * scale[:, None, None]
        loose = part.loose[which[at]] if part.loose.ndim else part.loose
        return outlines_of(at, corner, off_by(loose))

    def elsewhere(part: _Shown) -> Held:
        off, (x, y) = float(off_by(part.loose)), window.sides(cells)
        lead = tuple(low.tolist()), tuple(scale.tolist())
        return part.shown.on(Place((x, y), part.loose, off, *lead, slack, window.furthest))

    placed = concurrently([partial(place, part) for part in discs])
    member, covers, near = joined([part for part, _ in placed])
    starts = np.cumsum([0] + [len(part[0]) for part, _ in placed]).tolist()
    outlines = joined_outlines([(start, outline) for start, (_, outline) in zip(starts, placed, strict=False)])
    held = elsewhere(*shown) if shown else None
    kind = perspective, window.coarse, outlines, 0, bool(flat), held
    return CellGrid(axes, window.middle, window.half, cells, member, covers, near, *kind)
