"""Grids of cells, each cell with a list of the surfaces that a ray through it may meet: tiles and light grids.

All primary rays start at the eye, and all shadow rays of a point light end at the light. Seen from there, a ray is a
point of a plane, and only the surfaces that cover the point matter. The window of a grid is a rectangle of such a
plane; for a parallel light, of the plane across the light. A point light has a grid on each side of a cube around it,
the direction cube (Haines and Greenberg 1986), unless nothing is to be seen there.

A grid may be hierarchical: level 0 has the finest cells, and each level above it has cells of twice the side. A ray
then looks at one cell of each level that holds anything. The lists that are made here, of small scenes, are on one
level: the finest that takes few enough entries. A surface is entered in those cells of the rectangle around it that
its silhouette's lines leave. The list of a cell is in depth order, by the surfaces' nearest points, so that a search
ends as soon as those lie behind what was found.

Bounds are wider than all rounding, here and in the kernel, can ask for. So a list may hold a surface in vain, but it
lacks none that a ray meets first, and no list changes a picture. (In single some extreme scenes are an exception:
docs/speed.md.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS, Precision, dtype_of
from cltrace.plan.accel.silhouettes import SLACK, Projected, Silhouettes, joined_projections
from cltrace.plan.request import Region, Request
from cltrace.plan.rounding import Array, Ints, Mask
from cltrace.scene import AnyCamera

# So many entries, besides 4 for each surface, a grid may have.
SPARE = 2**20
# The level that a grid of one cell uses.
ONE_CELL_LEVEL = 30
# Where float32 tells cells apart, they are at least so wide, 32 times SLACK: see cover_cells(). A window of 2^-4 has
# room for the most that there may be.
NARROW, LEAST = 2.0**-4, 2.0**-15
# The cells of a light's grid are made for so many entries, besides those for each polygon.
FINER = 2**14
# Each has an axis and a sign.
SIDES = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
# What is seen through a side of the cube: slopes of at most 1, and a few roundings more.
SIDE = 1 + 2.0**-16
TILE = CONSTANTS["TILE"]
SHIFT = TILE.bit_length() - 1


class CellMembers(NamedTuple):
    """n surfaces that are entered on a grid.

    member: (n,), their indices; covers: (4, n), the cells of level 0 that each one covers at most, as the first column,
    the first row, and how many more columns and rows; near: (n,), depth of the nearest points; lines: (k, 3, n), a
    surface covers no cell of a column x and a row y where its a x + b y + c is less than 0.
    """

    member: Ints
    covers: NDArray[np.int16]
    near: NDArray[np.float32]
    lines: Array = np.zeros((0, 3, 0))

    def rows(self, level: int) -> CellMembers:
        """The same, in depth order, as runs of cells of a level, each in one row. covers: in cells of that level."""
        order = np.argsort(self.near, kind="stable")
        left, top, more, further = self.covers[:, order].astype(np.int64)
        right, bottom, left, top = (left + more) >> level, (top + further) >> level, left >> level, top >> level
        height = bottom - top + 1
        which = np.repeat(np.arange(len(order)), height)
        row = np.arange(len(which)) + (top - np.cumsum(height) + height)[which]
        begin, end = left[which].astype(np.float64), right[which].astype(np.float64)
        # In one row or one column, the rectangle is no larger than what is covered, or hardly.
        some = np.flatnonzero(((right > left) & (bottom > top))[which])
        of, down, least, most = order[which[some]], row[some], begin[some], end[some]
        for a, b, c in self.lines:
            # The corner of a cell of that level for which the value is largest is so many cells of level 0 further.
            c = c + (2.0**level - 1) * (np.maximum(a, 0) + np.maximum(b, 0))
            over = -1 / np.where(np.abs(a) < 2.0**-900, 2.0**-900, a * 2.0**level)
            rises = (a > -(2.0**-900))[of]
            # What overflows to a NaN cuts nothing off.
            with np.errstate(over="ignore", invalid="ignore"):
                limit = (c * over)[of] + (b * 2.0**level * over)[of] * down
                np.fmax(least, limit, out=least, where=rises)
                np.fmin(most, limit, out=most, where=~rises)
        begin[some], end[some] = np.ceil(least), np.floor(most)
        there = np.flatnonzero(begin <= end)
        which, begin, end = order[which[there]], begin[there], end[there]
        covers = np.stack([begin, row[there], end - begin, np.zeros(len(there))]).astype(np.int16)
        return CellMembers(self.member[which], covers, self.near[which])


NOBODY = CellMembers(np.zeros(0, np.int32), np.zeros((4, 0), np.int16), np.zeros(0, np.float32))


def lines_on_cells(lines: Array, origin: Array, scale: Array, ends: tuple[float, float], loose: Array) -> Array:
    """Lines of Projected as those of CellMembers.

    Cell i of an axis begins at (i + ends[0]) / scale + origin and stops at (i + ends[1]) / scale + origin; loose: (3,),
    what the three coefficients' products are off by, relative to them.
    """
    a, b, c = lines.swapaxes(0, 1)
    c = c + a * origin[0] + b * origin[1] + (loose[0] * np.abs(a) + loose[1] * np.abs(b) + loose[2] * np.abs(c))
    a, b = a / scale[0], b / scale[1]
    low, high = ends
    c += np.maximum(a * low, a * high) + np.maximum(b * low, b * high)
    return np.stack([a, b, c], axis=1)


class Held(Protocol):
    """Members of a grid that are on a device: triangles, of which a mask says which are members, once listed."""

    def entered(self) -> Mask: ...


@dataclass(frozen=True)
class CellGrid:
    """One grid, and the surfaces to be entered on it.

    axes: (3, 3), right, up and ahead; middle: (2,), of the window; half: (2,), half of its sides; cells: (columns,
    rows) of level 0; perspective: whether it is seen from a point, not along a parallel light; coarse: whether the
    cells are so large that coordinates in float32 tell them apart; held: further members, None for none.
    """

    axes: Array
    middle: Array
    half: Array
    cells: tuple[int, int]
    members: CellMembers = NOBODY
    perspective: bool = True
    coarse: bool = False
    held: Held | None = field(default=None, compare=False)

    def without_members(self) -> CellGrid:
        """What record_of() needs of it."""
        return replace(self, members=NOBODY, held=None)

    def entered(self, count: int) -> Mask:
        """(count,): which of so many surfaces, the last ones of which are triangles, are members, once listed."""
        found = np.zeros(count, bool)
        found[self.members.member] = True
        if self.held:
            triangles = self.held.entered()
            found[count - len(triangles) :] |= triangles
        return found


# ------------------------------------------------------------------------------------------------------------- lists


def build(grids: Iterable[CellGrid], precision: Precision) -> dict[str, NDArray[Any]]:
    """The kernel's buffers of the lists of all cells of all grids, one grid after the other.

    Every member is entered in each cell that it covers. grid: records of abi's `Grid`; start: where in entry the list
    of each cell begins, and where the last one ends; entry: (e, 2), a surface's index and the depth of its nearest
    point, as the bits of a float32.
    """
    records, starts, entries = list[NDArray[np.void]](), list[Ints](), list[Ints]()
    cells = filled = 0
    for grid in grids:
        start, entry, mask = listed(grid)
        records.append(record_of(grid, cells, mask, precision))
        starts.append(start + np.int32(filled))
        entries.append(entry)
        cells += len(start)
        filled += len(entry)
    entries.append(np.zeros((CONSTANTS["AHEAD"], 2), np.int32))
    starts.append(np.array([filled], np.int32))
    return {"grid": np.concatenate(records), "start": np.concatenate(starts), "entry": np.concatenate(entries)}


def record_of(grid: CellGrid, first: int, mask: int, precision: Precision) -> NDArray[np.void]:
    """(1,): abi's `Grid` of a grid. first: its first cell; mask: a bit for each level that holds anything."""
    record = np.zeros(1, dtype_of("Grid", precision))
    g = record[0]
    # Coordinates count from the window's middle. The axes are changed for that before they are rounded to float32.
    right, up, ahead = grid.axes
    shear = grid.middle if grid.perspective else np.zeros(2)
    g["right"][:3], g["up"][:3], g["ahead"][:3] = right - shear[0] * ahead, up - shear[1] * ahead, ahead
    if not grid.perspective:
        g["right"][3], g["up"][3] = -grid.middle
    for name in ("right", "up", "ahead"):
        g[f"near_{name}"] = g[name]
    g["flags"][0] = grid.coarse
    g["window"] = *grid.half, *(np.array(grid.cells) / (2 * grid.half))
    g["cells"] = *grid.cells, first, mask
    return record


def listed(grid: CellGrid) -> tuple[Ints, Ints, int]:
    """Of one grid: where the list of each cell begins, the entries, and a bit for the level that holds them."""
    runs, level = runs_of(grid)
    row = np.stack([runs.member, runs.near.view(np.int32)], axis=1)
    if grid.cells == (1, 1):
        return np.zeros(1, np.int32), row, bool(len(row)) << ONE_CELL_LEVEL
    if not len(row):
        return np.zeros(1, np.int32), row, 0
    columns, rows = (((n - 1) >> level) + 1 for n in grid.cells)
    # One number for each entry: the cell above the run's place in depth order.
    count = runs.covers[2].astype(np.int64) + 1
    place = np.repeat(np.arange(len(row)), count)
    first = runs.covers[1].astype(np.int64) * columns + runs.covers[0]
    key = np.arange(len(place)) + (first - np.cumsum(count) + count)[place]
    counts = np.bincount(key, minlength=columns * rows)
    key = key << 32 | place
    key.sort()
    return (np.cumsum(counts) - counts).astype(np.int32), row[key & 2**32 - 1], 1 << level


def runs_of(grid: CellGrid) -> tuple[CellMembers, int]:
    """The members in rows of cells, on the finest level on which they take few enough entries, and that level."""
    limit, top = 4 * len(grid.members.member) + SPARE, grid.members.covers[1].astype(np.int64)
    for level in range(16):
        rows = ((top + grid.members.covers[3]) >> level) - (top >> level) + 1
        if level < 15 and rows.sum() > limit:
            continue
        runs = grid.members.rows(level)
        if int(runs.covers[2].sum(dtype=np.int64)) + len(runs.member) <= limit:
            break
    return runs, level


def whole_grid(members: Mask) -> CellGrid:
    """A grid of one cell: one list of surfaces for all rays, in the order of their indices. members: (n,), which."""
    member = np.flatnonzero(members).astype(np.int32)
    near, none = np.full(len(member), -np.inf, np.float32), np.zeros(2)
    some = CellMembers(member, np.zeros((4, len(member)), np.int16), near)
    return CellGrid(np.zeros((3, 3)), none, none + 1, (1, 1), some)


# ----------------------------------------------------------------------------------------------------------- pictures


class Axis(NamedTuple):
    """How places become pixels: the first is s scale + begin, rounded up, the last s scale + end, rounded down.

    first, stop: the pixels that are wanted.
    """

    scale: float
    begin: float
    end: float
    first: int
    stop: int


@dataclass(frozen=True)
class PictureWindow:
    """What of the image plane is to be drawn.

    step: half of a pixel's width and height on the image plane z = -1, or, of parallel rays, in the float buffers'
    unit; size: (width, height) of the whole picture in pixels; region: the part of it that is wanted; parallel: whether
    rays are parallel; spread: how far from a pixel's middle its rays are, in pixels: 0, or half a pixel where they fill
    it.
    """

    step: tuple[float, float]
    size: tuple[int, int]
    region: Region
    parallel: bool = False
    spread: float = 0

    @classmethod
    def of(cls, camera: AnyCamera, request: Request, k: int = 0) -> PictureWindow:
        """The window of what a request wants of a camera's picture. k: see CameraView.without_lists().

        Of means over pixels it is all of the picture, whatever the crop: the more is listed beside a pixel, the less is
        known of it, and the more rays it has. That is to be the same in all crops.
        """
        (x, y), (width, height) = camera.image_plane(), camera.resolution
        unit = 2.0**k if camera.parallel else 1.0
        wanted, spread = request.region_of(camera.resolution), 0.0
        if request.means:
            wanted, spread = (0, 0, width, height), 0.5
        return cls((x * unit / width, y * unit / height), camera.resolution, wanted, camera.parallel, spread)

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """Across and down."""
        found = []
        for step, size, first, count in zip(self.step, self.size, self.region[:2], self.region[2:], strict=True):
            # Pixel i is at slope (2i + 1 - n) step. The product and the sum of slopes are rounded, each by 2^-24 of up
            # to 2^16 pixels, which 1/64 of a pixel covers; what is off by more is beyond the picture, and clipped.
            middle = (size - 1) / 2
            off = 1 / 64 + self.spread
            found.append(Axis(0.5 / step, begin=middle - off, end=middle + off, first=first, stop=first + count))
        return found[0], found[1]

    @property
    def half(self) -> tuple[float, float]:
        """The largest size of a place that is wanted, and a pixel more, across and down."""
        x, y = (max(abs(a.first - 1 - (n - 1) / 2), abs(a.stop - (n - 1) / 2)) / a.scale
                for a, n in zip(self.axes, self.size, strict=True))  # fmt: skip
        return x, y


def picture_grid(size: tuple[int, int], members: CellMembers = NOBODY, held: Held | None = None) -> CellGrid:
    """The grid of a picture of so many pixels, (width, height): its cells are tiles."""
    columns, rows = (((n - 1) >> SHIFT) + 1 for n in size)
    return CellGrid(np.eye(3), np.zeros(2), np.ones(2), (columns, rows), members, held=held)


def picture_tiles(shapes: Sequence[Silhouettes], among: Mask, window: PictureWindow, slack: float) -> CellGrid:
    """The picture's grid.

    shapes: surfaces from the eye, in the order of SHAPES; among: (n,), which of all of them to enter; slack: SLACK or
    FINE_SLACK. Those that cannot be seen are left out: those behind the eye, beside the region, or between the centres
    of pixels.
    """
    if window.parallel:
        # A pixel's coordinates are its column and row, from the top. What is behind the rays' starts has no depth.
        parts = [one.across(np.diag([1.0, -1.0, 1.0]), slack, among) for one in shapes]
        found = joined_projections(parts)
        return picture_grid(window.size, _pictured(found, found.far >= 0, window, slack))
    axes, held = np.diag([1.0, -1.0, -1.0]), None
    if sight := sight_of(shapes):
        held, among = sight.picture(axes, window, among)
    found = joined_projections([one.through(axes, window.half, among) for one in shapes])
    return picture_grid(window.size, _pictured(found, np.ones(len(found.near), bool), window, slack), held)


def sight_of(shapes: Sequence[Silhouettes]) -> Any:
    """What sees most triangles on a device, None for nothing."""
    return next((one.sight for one in shapes if one.sight), None)


def _pictured(found: Projected, visible: Mask, window: PictureWindow, slack: float) -> CellMembers:
    """Those of `visible` that cover pixels."""
    covers, axes = np.empty((4, len(found.member)), np.int16), window.axes
    for k, axis in enumerate(axes):
        low, high = found.edges[2 * k : 2 * k + 2]
        loose = (np.abs(low) + np.abs(high)) * slack
        begin = np.clip(np.ceil((low - loose) * axis.scale + axis.begin), axis.first, axis.stop)
        end = np.clip(np.floor((high + loose) * axis.scale + axis.end), axis.first - 1, axis.stop - 1)
        visible = visible & (begin <= end)
        covers[k] = begin.astype(np.int32) >> SHIFT
        covers[2 + k] = (end.astype(np.int32) >> SHIFT) - covers[k]
    off = (axes[0].end - axes[0].begin) / 2
    lines = lines_on_cells(
        found.lines[:, :, visible],
        np.array([(axis.begin + axis.end) / -2 / axis.scale for axis in axes]),
        np.array([axis.scale / TILE for axis in axes]),
        (-off / TILE, (TILE - 1 + off) / TILE),
        slack * np.array([*window.half, 1]),
    )
    return CellMembers(found.member[visible], covers[:, visible], found.near[visible], lines)


# ------------------------------------------------------------------------------------------------------------- lights


class Shadows(NamedTuple):
    """Who takes part in shadows.

    occluder: (n,), the surfaces that may stop light, which are the ones to enter, in the order of SHAPES;
    receiver: (n,), those of them on which shadow rays may end; slack: SLACK if the kernel decides in
    float32, else FINE_SLACK.
    """

    occluder: Mask
    receiver: Mask
    slack: float


class Extent(NamedTuple):
    """Of projected surfaces.

    spans: two lists of the outermost left, right, low and high edge, first of all of them, then of those where shadow
    rays end; nearest, furthest: bounds of the depth of all points where shadow rays end.
    """

    spans: list[list[float]]
    nearest: float
    furthest: float

    @classmethod
    def of(cls, seen: Projected, who: Shadows) -> Extent:
        ends = np.flatnonzero(who.receiver[seen.member])
        spans = [
            [float(edge.max(initial=-np.inf) if k % 2 else edge.min(initial=np.inf)) for k, edge in enumerate(edges)]
            for edges in (seen.edges, seen.edges[:, ends])
        ]
        return cls(spans, float(seen.near[ends].min(initial=np.inf)), float(seen.far[ends].max(initial=-np.inf)))


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

    def cells(self, size: float, members: int, wanted: float, most: int) -> tuple[int, int]:
        """Columns and rows, of cells that are about square.

        size: the median of the widths and heights of what is entered; members: how many there are; wanted: in how many
        cells each one is to be, if it has that size; most: about how many cells there may be.
        """
        # There are two cells a side at least, as the kernel looks up no window of one cell.
        sides = 2 * self.half
        cell = max(size / (np.sqrt(wanted) - 1), np.sqrt(sides[0] * sides[1] / most))
        limits = [min(2048, int(s / LEAST)) if self.coarse else 2048 for s in sides]
        columns, rows = (int(np.clip(np.ceil(s / cell), 2, limit)) for s, limit in zip(sides, limits, strict=True))
        return columns, rows

    def sides(self, cells: tuple[int, int]) -> tuple[Side, Side]:
        """Both axes, if there are so many cells."""
        low, wide = (self.middle - self.half).tolist(), (2 * self.half).tolist()
        x, y = (Side(a, a + s, n / s, n - 1) for a, s, n in zip(low, wide, cells, strict=True))
        return x, y


def window_of(extents: list[Extent], slack: float, perspective: bool) -> Rectangle | None:
    """The window that holds what is common to the extent of all surfaces and to that of those where shadow rays end.

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
    # Where the surfaces fill little of the cube's side, float32 would be too coarse for its cells.
    coarse = perspective and bool((half > NARROW / 2).all())
    return Rectangle((low + high) / 2, half, max(extent.furthest for extent in extents), coarse)


def cube_of(offsets: Sequence[Array]) -> Array:
    """(3, 3): three axes at right angles. The last one points about at the middle of points (n, 3), or away from it.

    So a distant group of surfaces is in the middle of one side of the cube, not on an edge.
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


def sample(points: NDArray[Any]) -> NDArray[Any]:
    """Points that tell cube_of() where all of them are."""
    return points[:: len(points) // 4096 + 1]


def side_axes(cube: Array, axis: int, sign: float) -> Array:
    """(3, 3): of a side of the cube, the two axes across and the one that leads there."""
    return np.asarray(cube[[(axis + 1) % 3, (axis + 2) % 3, axis]] * np.array([1, 1, sign])[:, None])


def point_grids(shapes: Sequence[Silhouettes], who: Shadows) -> Iterator[CellGrid]:
    """The grids of a light at a point, one by one. shapes: surfaces as seen from the light, in the order of SHAPES."""
    cube, sight = cube_of([sample(one.points) for one in shapes]), sight_of(shapes)
    on_device = sight.sides(cube, who) if sight else [None] * len(SIDES)
    for (axis, sign), shown in zip(SIDES, on_device, strict=True):
        axes = side_axes(cube, axis, sign)
        seen = _through(shapes, axes, shown.rest if shown else who.occluder)
        shown = shown if shown and shown.members else None
        if not shown and not len(seen.member):
            continue
        window = window_of([Extent.of(seen, who), *([shown.extent] if shown else [])], SLACK, True)
        if window and not window.coarse and who.slack < SLACK:
            if shown:  # which float32 is too coarse for
                shown, seen = None, _through(shapes, axes, who.occluder)
            window = window_of([Extent.of(seen, who)], who.slack, True)
            window = window and window._replace(coarse=False)
        if window:
            yield _grid(axes, shapes, seen, shown, window, SLACK if window.coarse else who.slack, True)


def _through(shapes: Sequence[Silhouettes], axes: Array, among: Mask) -> Projected:
    return joined_projections([one.through(axes, (SIDE, SIDE), among) for one in shapes])


def parallel_grids(axes: Array, shapes: Sequence[Silhouettes], who: Shadows) -> Iterator[CellGrid]:
    """The grid of a parallel light; none if it can shadow nothing.

    axes: (3, 3), the two across and the one towards the light; shapes: surfaces as seen from the eye.
    """
    sight = sight_of(shapes)
    shown = sight.across(axes, who) if sight else None
    seen = joined_projections([one.across(axes, who.slack, shown.rest if shown else who.occluder) for one in shapes])
    shown = shown if shown and shown.members else None
    window = window_of([Extent.of(seen, who), *([shown.extent] if shown else [])], who.slack, False)
    if window:
        yield _grid(axes, shapes, seen, shown, window, who.slack, False)


def _grid(
    axes: Array,
    shapes: Sequence[Silhouettes],
    seen: Projected,
    shown: Any,
    window: Rectangle,
    slack: float,
    perspective: bool,
) -> CellGrid:
    """The grid of a window, with the surfaces that are seen in it, and those that are shown on a device, if any."""
    members = len(seen.member) + (shown.members if shown else 0)
    low, high = ((window.middle + sign * window.half)[:, None] for sign in (-1, 1))
    wide, high = np.clip(seen.edges[1::2], low, high) - np.clip(seen.edges[::2], low, high)
    sizes = shown.sizes() if shown else np.sqrt(np.fmin(2 * seen.area, wide * high))
    # Cells as wide as 2 discs were within 5 % of the fastest, for 64 to a million spheres in whatever layout: each one
    # has (1 + 1 / 2)^2 entries then, on average. There are about as many cells as surfaces, at most. Few surfaces that
    # are no balls may have more.
    flat = max(one.cell_entries for one in shapes if len(one))
    wanted = flat + min(FINER / max(1, members), 64) if flat else 2.25
    cells = window.cells(float(np.median(sizes)), members, wanted, max(members, FINER if flat else 2))
    sides = window.sides(cells)
    held = shown.entered_on(sides, slack, window.furthest) if shown else None
    some = cover_cells(seen, sides, slack, window.furthest)
    return CellGrid(axes, window.middle, window.half, cells, some, perspective, window.coarse, held)


def cover_cells(seen: Projected, sides: tuple[Side, Side], slack: float, furthest: float) -> CellMembers:
    """Which cells of a light's grid surfaces cover. sides: of the window; furthest: where the last ray ends."""
    # What is wholly beside the window, or beyond where the last ray ends, is met by no ray of the window.
    within, covers = seen.near < furthest, np.empty((4, len(seen.near)), np.int16)
    for k, side in enumerate(sides):
        begin, end = seen.edges[2 * k : 2 * k + 2]
        loose = slack * (1 + np.abs(begin) + np.abs(end))
        begin, end = begin - loose, end + loose
        within &= (end >= side.first) & (begin <= side.stop)
        # A 64th of a cell more, as the kernel computes column and row in float32: they may be off by that.
        covers[k] = np.clip((begin - side.first) * side.scale - 1 / 64, 0, side.last)
        covers[2 + k] = np.clip((end - side.first) * side.scale + 1 / 64, 0, side.last)
        covers[2 + k] -= covers[k]
    first, stop, scale, _ = np.array(sides).T
    loose = slack * np.array([*(1 + np.maximum(np.abs(first), np.abs(stop))), 1])
    lines = lines_on_cells(seen.lines[:, :, within], first, scale, (-1 / 64, 1 + 1 / 64), loose)
    return CellMembers(seen.member[within], covers[:, within], seen.near[within], lines)
