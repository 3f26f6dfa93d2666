"""Grids of cells, each cell with a list of the surfaces that a ray through it may meet: tiles and light buffers.

All primary rays start at the eye, and all shadow rays of a point light end at the light. Seen from there, a ray is a
point of a plane, a sphere is a disc, and only the discs that cover the point matter. The window of a grid is a
rectangle of such a plane; for a parallel light, of the plane across the light.

A disc may cover any number of cells. So a grid is hierarchical: level 0 has the finest cells, and each level above it
has cells of twice the side. A sphere is entered on one level only, the finest on which it takes few enough cells. A ray
then looks at one cell of each level that holds anything. The list of a cell is in depth order, by the spheres' nearest
points, so that a search ends as soon as those lie behind what was found.

Bounds are wider than all rounding, here and in the kernel, can ask for. So a list may hold a sphere in vain, but it
lacks none that a ray meets first, and no list changes a picture. (In single some extreme scenes are an exception:
docs/speed.md.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise, concurrently, empty, processors
from cltrace.plan.abi import CONSTANTS, Precision, dtype_of
from cltrace.plan.rounding import Array, Ints, Mask, rounded_up

# Relative to a coordinate. float32 arithmetic is off by less than half of it here, and by less in the kernel, too.
SLACK = 2.0**-20
# So many entries, besides 4 for each sphere, a grid may have. With few spheres even large discs are then on level 0.
SPARE = 2**18
# How many looks an entry of a triangle in the tiles has to save. Without a price, a ball of 1,000 triangles takes 18 ms
# of a processor's time to list instead of 12, and 47 to draw instead of 49 (PoCL 3.1, 1920x1080).
PRICE = 2.0
# The price of entries follows from one in so many polygons, unless those are fewer than this.
SAMPLE, FEW_SAMPLES = 16, 2**12
# Spheres at a time, mostly in float32. With fewer, threads would wait for Python's lock more than they work.
AT_ONCE = 2**17
# The level that a grid of one cell uses.
ONE_CELL_LEVEL = 30


@dataclass(frozen=True)
class Lists:
    """The lists of g grids, one after the other.

    grid: (g,), records of abi's `Grid`; start: (c + 1,), where in entry the list of each of c cells begins, and where
    the last one ends; entry: (e, 2), a sphere's index and the depth of its nearest point, as the bits of a float32. The
    depth does not fall along a list.
    """

    grid: NDArray[np.void]
    start: Ints
    entry: Ints

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The kernel's buffers by name."""
        return {"grid": self.grid, "start": self.start, "entry": self.entry}


class Outlines(NamedTuple):
    """Convex polygons that fill little of the rectangles of cells around them, j of them with c corners each.

    at: (j,), which of a grid's members they are; corner: (2, c, j), in cells, or in pixels where rays pass through
    those alone; loose: (j,), by how much a corner or a ray may be off.
    """

    at: NDArray[np.intp]
    corner: NDArray[np.float32]
    loose: NDArray[np.float32]


class Place(NamedTuple):
    """How polygons are entered on a grid.

    pixels: of CellGrid. Of a light: axes: of each one where the window begins and ends, what leads to cells, and the
    last cell; slack: relative to an edge, what it is off by; loose: what it is off by beside that; furthest: where the
    last ray ends; low, scale: how corners become cells; off: by how much these are off. Of a picture: axes: the first
    pixel of each one, and the one after the last; loose: by how much edges are off.
    """

    axes: tuple[tuple[float, ...], tuple[float, ...]]
    loose: float
    off: float
    low: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (1.0, 1.0)
    slack: float = 0.0
    furthest: float = 0.0
    pixels: int = 0


class Held(Protocol):
    """Members of a grid that are kept elsewhere."""

    def entered(self) -> Mask:
        """(m,): which triangles they are, once the grid's lists are made."""


@dataclass(frozen=True)
class CellGrid:
    """One grid, and n surfaces to be entered on it.

    axes: (3, 3), right, up and ahead; middle: (2,), of the window; half: (2,), half of its sides; cells: (columns,
    rows) of level 0; member: (n,), indices of the surfaces; covers: (4, n), the cells of level 0 that each one covers,
    as the first column, the first row, and how many more columns and rows; near: (n,) float32, depth of the nearest
    points; perspective: whether it is seen from a point, not along a parallel light; coarse: whether the cells are so
    large that coordinates in float32 tell them apart; outlines: of those that cover fewer cells than `covers` says;
    pixels: in the side of a cell, where rays pass through their centres alone, else 0; polygons: whether any surfaces
    are convex polygons; held: further members, None for none.
    """

    axes: Array
    middle: Array
    half: Array
    cells: tuple[int, int]
    member: Ints
    covers: NDArray[np.int16]
    near: NDArray[np.float32]
    perspective: bool
    coarse: bool = False
    outlines: tuple[Outlines, ...] = ()
    pixels: int = 0
    polygons: bool = False
    held: Held | None = None

    def without_members(self) -> CellGrid:
        """What fill_record() needs of it."""
        return replace(self, **NOBODY._asdict(), held=None)

    def entered(self, count: int) -> Mask:
        """(count,): which of so many surfaces, the last ones of which are triangles, are members, once listed."""
        found = np.zeros(count, bool)
        found[self.member] = True
        if self.held:
            triangles = self.held.entered()
            found[count - len(triangles) :] |= triangles
        return found


def build(grids: Iterable[CellGrid], precision: Precision) -> Lists:
    """The lists of all cells of all grids: every member is entered in each cell that it covers."""
    records, starts, entries = list[NDArray[np.void]](), list[Ints](), list[Ints]()
    cells = filled = 0
    for some in _batches(grids):
        jobs = [partial(entered_in, grid) for grid in some]
        # Threads take a millisecond to start.
        entered = concurrently(jobs) if sum(len(grid.member) for grid in some) > AT_ONCE else [job() for job in jobs]
        for grid, (start, entry, mask) in zip(some, entered, strict=True):
            records.append(np.zeros(1, dtype_of("Grid", precision)))
            fill_record(records[-1][0], grid, cells, mask)
            starts.append(start + np.int32(filled))
            entries.append(entry)
            cells += len(start)
            filled += len(entry)
    entries.append(np.zeros((CONSTANTS["AHEAD"], 2), np.int32))
    starts.append(np.array([filled], np.int32))
    entry = np.concatenate(entries, out=empty((filled + CONSTANTS["AHEAD"], 2), np.int32))
    return Lists(np.concatenate(records), np.concatenate(starts), entry)


def _batches(grids: Iterable[CellGrid]) -> Iterator[list[CellGrid]]:
    """A few grids at a time, as hundreds of lights have more of them than there should be in memory at once."""
    some, members = list[CellGrid](), 0
    for grid in grids:
        some.append(grid)
        members += len(grid.member)
        if members > AT_ONCE and len(some) >= processors():
            yield some
            some, members = [], 0
    yield some


def fill_record(g: np.void, grid: CellGrid, first: int, mask: int) -> None:
    """Makes `g` abi's `Grid` of a grid. first: its first cell; mask: a bit for each level that holds anything."""
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


def entered_in(grid: CellGrid) -> tuple[Ints, Ints, int]:
    """Of one grid: where the list of each cell begins, the entries, and a bit for each level that holds anything."""
    if grid.cells == (1, 1):
        order = np.argsort(grid.near, kind="stable")
        entry = np.stack([grid.member, grid.near.view(np.int32)], axis=1)[order]
        return np.zeros(1, np.int32), entry, bool(len(order)) << ONE_CELL_LEVEL
    if not len(grid.member):
        return np.zeros(1, np.int32), np.zeros((0, 2), np.int32), 0
    level, outlined, strips, used, entries = Placement.of(grid)
    keys = Keys.on(used, grid.cells, int(grid.member.max()))
    key, filled = np.empty(entries, np.int64), 0
    for part in chain((keys.of_strip(grid, level, strip) for strip in strips), keys.of_boxes(grid, level, outlined)):
        key[filled : filled + len(part)] = part
        filled += len(part)
    key = key[:filled]
    key.sort()
    counts = np.zeros(keys.cells, np.int32)
    shift = keys.index_bits + keys.near_bits
    for i in range(0, filled, AT_ONCE):
        block_of_keys = key[i : i + AT_ONCE]
        cell = block_of_keys >> shift
        first = int(cell[0])
        here = np.bincount(cell - first)
        counts[first : first + len(here)] += here.astype(np.int32)
        # In place: the depth goes to the upper half, where it pushes out the cell, the sphere to the lower half.
        near = block_of_keys >> keys.index_bits << 64 - keys.near_bits
        block_of_keys &= (1 << keys.index_bits) - 1
        block_of_keys |= _descended(near)
    start = np.cumsum(counts, dtype=np.int32) - counts
    return start, key.astype("<i8", copy=False).view("<i4").reshape(-1, 2).astype(np.int32, copy=False), keys.mask


class Placement(NamedTuple):
    """Where the n members of a grid are entered.

    level: (n,), of each one; outlined: (n,), which of them are entered in strips of cells, not in rectangles; strips:
    of those; used: the levels that hold anything, rising; entries: how many there are.
    """

    level: NDArray[np.int8]
    outlined: Mask
    strips: list[Strip]
    used: list[int]
    entries: int

    @staticmethod
    def of(grid: CellGrid, price: float | None = None) -> Placement:
        """The placement on a grid of several cells, but for members that are held elsewhere.

        price: see price_of(); None if there are none of these.
        """
        outlined = np.zeros(len(grid.member), bool)
        for outlines in grid.outlines:
            outlined[outlines.at] = True
        if grid.polygons:
            sizes = Sizes.of(grid)
            if price is None:
                price = price_of(grid, partial(sizes.sampled, grid.member))
            level = levels_of_polygons(grid, sizes, price)

            def entries_of(block: slice) -> int:
                which = np.flatnonzero(~outlined[block])
                edges = _edges(grid.covers[:, block].take(which, axis=1)) >> level[block].take(which)
                return entries_of_boxes(edges[2:] - edges[:2])

            entries = sum(blockwise(len(level), entries_of, AT_ONCE))
        else:
            level, entries = _levels(grid)
        strips = [strip for outlines in grid.outlines for strip in _strips(grid, level, outlines)]
        entries += sum(int(strip.more.sum(dtype=np.int64)) + len(strip.more) for strip in strips)
        used = np.flatnonzero(np.bincount(level)).tolist()
        return Placement(level, outlined, strips, used, entries)


@dataclass(frozen=True)
class Keys:
    """Entries as whole numbers.

    From the top, a key has the cell, the depth of the nearest point, rounded down to as many bits as are left, and the
    surface. Sorting keys sorts the cells, and the list of each cell.

    used: levels that hold anything; pitch, base: of each level from 0 on, the cells in a row, and the first cell;
    cells: of all levels; mask: a bit for each of `used`; index_bits, near_bits: for surface and depth.
    """

    used: list[int]
    pitch: list[int]
    base: list[int]
    cells: int
    mask: int
    index_bits: int
    near_bits: int

    @staticmethod
    def on(used: list[int], cells: tuple[int, int], last: int) -> Keys:
        """used: levels, rising; cells: (columns, rows) of level 0; last: the largest index of a surface."""
        levels = range(used[-1] + 1)
        pitch = [((cells[0] - 1) >> k) + 1 for k in levels]
        base, total = [0 for _ in levels], 0
        for k in reversed(used):
            base[k] = total
            total += pitch[k] * (((cells[1] - 1) >> k) + 1)
        index_bits = last.bit_length()
        near_bits = min(32, 63 - index_bits - total.bit_length())
        return Keys(
            used, pitch, base, total, mask=sum(1 << k for k in used), index_bits=index_bits, near_bits=near_bits
        )

    def _low(self, grid: CellGrid, which: slice | NDArray[np.intp]) -> NDArray[np.int64]:
        """Depth and surface of some members."""
        near = _ascending(grid.near[which]) >> np.uint32(32 - self.near_bits)
        return near.astype(np.int64) << self.index_bits | grid.member[which]

    def of_boxes(self, grid: CellGrid, level: NDArray[np.int8], outlined: Mask) -> Iterator[NDArray[np.int64]]:
        """The keys of those that have no outline: one for each cell of the rectangles around them."""
        shift = self.index_bits + self.near_bits
        for i in range(0, len(level), AT_ONCE):
            block = slice(i, i + AT_ONCE)
            low = self._low(grid, block)
            edges = _edges(grid.covers[:, block])
            for k in self.used:
                every = len(self.used) == 1 and not grid.polygons
                which = slice(None) if every else np.flatnonzero((level[block] == k) & ~outlined[block])
                left, top, right, bottom = edges[:, which] >> k
                cell = top.astype(np.int64) * self.pitch[k] + left + self.base[k]
                # First there is one number for each row of cells that a sphere covers, then one for each cell.
                step, key = self.pitch[k] << shift, cell << shift | low[which]
                key, more = joined(list(spread(bottom - top, step, key, right - left)))
                for (part,) in spread(more, 1 << shift, key):
                    yield part

    def of_strip(self, grid: CellGrid, level: NDArray[np.int8], strip: Strip) -> NDArray[np.int64]:
        """The keys of polygons: one for each cell of some rows of cells."""
        at_level, count = level[strip.at], strip.more + 1
        cell = np.array(self.base)[at_level] + strip.row * np.array(self.pitch)[at_level] + strip.column
        key = np.repeat(cell - (np.cumsum(count, dtype=np.int64) - count), count)
        key += np.arange(len(key))
        key <<= self.index_bits + self.near_bits
        key |= np.repeat(self._low(grid, strip.at), count)
        return key


def _edges(covers: NDArray[np.int16]) -> NDArray[np.int16]:
    """(4, n): the first column, the first row, the last column and the last row of each."""
    return np.concatenate([covers[:2], covers[:2] + covers[2:]])


def spread(
    more: NDArray[np.int16], step: int, key: NDArray[np.int64], *others: NDArray[Any]
) -> Iterator[tuple[NDArray[Any], ...]]:
    """For each element key, key + step, ..., key + more step, in any order, with its own elements of the others."""
    yield key, *others
    while len(rest := np.flatnonzero(more > 0)):  # a mask, as flatnonzero() of numbers takes seven times as long
        more = more[rest] - np.int16(1)
        key, *others = (key[rest] + step, *(other[rest] for other in others))  # type: ignore[assignment]
        yield key, *others


def _ascending(x: NDArray[np.float32]) -> NDArray[np.uint32]:
    """The bits of float32 numbers, changed such that, read as whole numbers, they are in the numbers' order."""
    bits = x.view(np.int32)
    return (bits ^ (bits >> 31 & np.int32(0x7FFFFFFF))).view(np.uint32) ^ np.uint32(1 << 31)


def _descended(x: NDArray[np.int64]) -> NDArray[np.int64]:
    """Undoes _ascending(), in place. The bits are in the upper half of x, with zeros below."""
    x ^= np.int64(-(2**63))
    x ^= x >> 63 & np.int64(0x7FFFFFFF << 32)
    return x


class Strip(NamedTuple):
    """Runs of cells in rows. at: (s,), which of the members they are of; row, column: (s,), the first cell of each,
    on the member's level; more: (s,), how many more columns."""

    at: NDArray[np.intp]
    row: Ints
    column: Ints
    more: Ints


def _strips(grid: CellGrid, level: NDArray[np.int8], outlines: Outlines) -> list[Strip]:
    """The cells that polygons touch, each one on its level."""
    levels = level[outlines.at].astype(np.int32)
    left, top, right, bottom = _edges(grid.covers[:, outlines.at]).astype(np.int32) >> levels
    count = bottom - top + 1
    # A strip is as high as a cell, or from its first row of pixels to the last one.
    sides = np.ldexp(np.float32(grid.pixels or 1), levels)
    gap = np.float32(bool(grid.pixels))

    def of(block: slice) -> Strip:
        many = count[block]
        which = np.repeat(np.arange(len(many)), many)
        row = np.arange(len(which), dtype=np.int32)
        row -= (np.cumsum(many, dtype=np.int32) - many - top[block]).take(which)
        side, loose = sides[block].take(which), outlines.loose[block].take(which)
        low = row.astype(np.float32) * side - loose
        least, most = _across(outlines.corner[:, :, block], which, low, low + (side + 2 * loose - gap))
        least -= loose
        most += loose
        if grid.pixels:
            # A strip may pass between the centres of pixels.
            np.ceil(least, out=least)
            least[least > most] = np.nan
        # Comparisons with nan are false.
        inside = np.flatnonzero(least <= most)
        which, side = which.take(inside), side.take(inside)
        first, last = left[block].take(which), right[block].take(which)
        begin = np.clip(least.take(inside) / side, first, last + 1).astype(np.int32)
        stop = np.clip(most.take(inside) / side, first - 1, last).astype(np.int32)
        keep = np.flatnonzero(begin <= stop)
        begin, at = begin.take(keep), outlines.at[block].take(which.take(keep))
        return Strip(at, row.take(inside.take(keep)), begin, stop.take(keep) - begin)

    return blockwise(len(count), of, max(1, AT_ONCE // 4 * len(count) // max(1, int(count.sum(dtype=np.int64)))))


def _across(
    corner: NDArray[np.float32], which: NDArray[np.intp], low: NDArray[np.float32], up: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where polygons begin and end in strips: (s,), nan if they do not meet them.

    corner: (2, c, n), of polygons; which: (s,), the polygon of each strip; low, up: (s,), the strip's edges.
    """
    least, most = np.full(len(which), np.nan, np.float32), np.full(len(which), np.nan, np.float32)
    for start, end in zip(corner.transpose(1, 0, 2), np.roll(corner, -1, axis=1).transpose(1, 0, 2), strict=True):
        # The part of the side from start to end that is in the strip, and where it begins and ends.
        falls = start[1] > end[1]
        (x, y), (end_x, end_y) = np.where(falls, end, start), np.where(falls, start, end)
        # Strips are made wider by 1/64 or more. So one that needs anything of a side as flat as this has both its
        # ends, and one of them is the beginning of another side.
        flat = end_y - y < 2.0**-10
        slope = (end_x - x) * ~flat / np.where(flat, 1, end_y - y)
        x, y, slope = x.take(which), y.take(which), slope.take(which)
        begin, stop = np.maximum(low, y), np.minimum(up, end_y.take(which))
        x += (begin - y) * slope
        x[begin > stop] = np.nan
        np.fmin(least, x, out=least)
        np.fmax(most, x, out=most)
        x += (stop - begin) * slope
        np.fmin(least, x, out=least)
        np.fmax(most, x, out=most)
    return least, most


def _levels(grid: CellGrid) -> tuple[NDArray[np.int8], int]:
    """The level of each member, and how many entries all of them take: the finest levels that take few enough."""
    wide, high = grid.covers[2:]
    n, edges = len(wide), _edges(grid.covers)
    # Cells of level `bits` are as large as the disc.
    bits = np.frexp(np.maximum(wide, high).astype(np.float32))[1].astype(np.int8)

    def lifted(lift: int) -> NDArray[np.int8]:
        return np.asarray(np.maximum(bits - np.int8(lift), np.int8(0)))

    def entries_of(lift: int) -> int:
        level = lifted(lift)
        return entries_of_boxes((edges[2:] >> level) - (edges[:2] >> level))

    lift, entries = chosen_lift(n, entries_of_boxes(grid.covers[2:]), lambda: int(bits.max()), entries_of)
    return np.zeros(n, np.int8) if lift is None else lifted(lift), entries


def chosen_lift(
    n: int, entries: int, most: Callable[[], int], entries_of: Callable[[int], int]
) -> tuple[int | None, int]:
    """By how much discs are on finer levels than that of their size, None for level 0, and how many entries they take.

    n: how many there are; entries: how many these take on level 0; most: the level of the largest one's size;
    entries_of: how many entries a lift makes.
    """
    # Where spheres are very many, all are on level 0, or each is on the level that has its size. Whatever is in between
    # takes longer to make and saves nothing.
    many = n >= SPARE
    if entries <= 6 * n if many else entries <= 4 * n + SPARE:
        return None, entries
    for lift in (0,) if many else range(most() - 1, 0, -1):
        entries = entries_of(lift)
        if many or lift == 1 or entries <= 4 * n + SPARE:
            break
    return lift, entries


class Sizes(NamedTuple):
    """How large n members of a grid are, in cells of level 0: their areas, and their widths plus heights, (n,) each."""

    area: NDArray[np.float32]
    sides: NDArray[np.float32]

    @staticmethod
    def of(grid: CellGrid) -> Sizes:
        """Those of all members, some of which are polygons."""
        area, sides = (np.empty(len(grid.member), np.float32) for _ in range(2))

        def measure(block: slice) -> None:
            wide, high = grid.covers[2:, block].astype(np.float32)
            area[block], sides[block] = wide * high, wide + high

        blockwise(len(area), measure, AT_ONCE)
        for outlines in grid.outlines:
            exact = areas(outlines.corner) / np.float32(max(1, grid.pixels) ** 2)
            area[outlines.at] = np.minimum(area[outlines.at], exact)
        return Sizes(area, sides)

    def some(self, which: slice | NDArray[np.intp]) -> Sizes:
        """Those of some of the members."""
        return Sizes(self.area[which], self.sides[which])

    def sampled(self, member: Ints, stride: int) -> Sizes:
        """Those of members, (n,), whose indices `stride` divides."""
        return self.some(np.flatnonzero(member % stride == 0))

    def levels(self, price: float, levels: int) -> NDArray[np.int8]:
        """The level of each one, below `levels`, at a price: see levels_of_polygons()."""
        level = np.zeros(len(self.area), np.int8)
        large = np.flatnonzero(self.sides > 0) if price else ()  # others are in one cell
        if len(large):
            wide, filled = self.sides.take(large), self.area.take(large)
            for k in range(1, levels):
                looks = wide * np.float32(2.0 ** (k - 1)) + np.float32(3 * 4.0 ** (k - 1))
                level[large] += looks <= price * (filled * np.float32(3 * 4.0**-k) + wide * np.float32(2.0**-k))
        return level


def levels_of_polygons(grid: CellGrid, sizes: Sizes, price: float) -> NDArray[np.int8]:
    """The level of each member, where some are polygons.

    A convex body in a lattice meets area + width + height + 1 cells on average, all measured in cells. So many are a
    polygon's entries; on level k they are looked at from 4^k times as many cells of level 0. One level down from k,
    there are more entries and fewer looks, and the less is won for each entry, the finer the levels are. So there is a
    price, in looks, up to which all polygons pay for an entry: see price_of().
    """
    levels = most_levels(grid)
    return np.concatenate(blockwise(len(sizes.area), lambda block: sizes.some(block).levels(price, levels), AT_ONCE))


def most_levels(grid: CellGrid) -> int:
    """How many levels a grid with polygons may have."""
    return max(grid.cells).bit_length()


def price_of(grid: CellGrid, sample: Callable[[int], Sizes]) -> float:
    """What an entry may cost: as little as the number of entries allows, but not less than PRICE for tiles, each of
    which is looked at once.

    sample: the sizes of those members, in any order, whose indices a number divides.
    """
    stride = SAMPLE
    some = sample(stride)
    if len(some.area) < FEW_SAMPLES:
        stride = 1
        some = sample(stride)
    levels, most = most_levels(grid), 4 * stride * len(some.area) + SPARE
    price = PRICE if grid.pixels else 0.0
    while True:
        by = np.ldexp(np.float32(1), -some.levels(price, levels))
        # In sixteenths, a sum does not depend on the order.
        sixteenths = ((some.area * by * by + some.sides * by + 1) * 16).astype(np.int64)
        if stride * int(sixteenths.sum()) <= 16 * most or price > 4.0**levels:
            return price
        price = max(1.0, 2 * price)


def areas(corner: NDArray[Any]) -> NDArray[Any]:
    """(n,): the areas of polygons with corners (2, c, n)."""
    x, y = corner[:, 1:] - corner[:, :1]
    found = x[:-1] * y[1:] - y[:-1] * x[1:]
    return np.asarray(np.abs(found.sum(axis=0) if len(found) > 1 else found[0]) / 2)


def entries_of_boxes(more: NDArray[np.int16]) -> int:
    """How many entries discs take that cover one column and one row and so many more of them, (2, n)."""
    wide, high = more.astype(np.int32) + 1  # numpy 1 would add a np.int32 in int16
    return int((wide * high).sum(dtype=np.int64))


def whole_grid(members: Mask) -> CellGrid:
    """A grid of one cell: one list of spheres for all rays, in the order of their indices. members: (n,), which."""
    member = np.flatnonzero(members).astype(np.int32)
    none, near = np.zeros(2), np.full(len(member), -np.inf, np.float32)
    covers = np.zeros((4, len(member)), np.int16)
    return CellGrid(np.zeros((3, 3)), none, none + 1, (1, 1), member=member, covers=covers, near=near, perspective=True)


def joined(parts: list[tuple[NDArray[Any], ...]]) -> list[NDArray[Any]]:
    """Each of several arrays, put together along its last axis from the same one of each block."""
    return [np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)]


def sprawling(covers: NDArray[np.int16]) -> NDArray[np.intp]:
    """Which polygons, with covers (4, n), may touch fewer cells than the rectangles around them have."""
    wide, high = covers[2:]
    return np.flatnonzero((wide > 0) & (high > 0))


def outlines_of(at: NDArray[np.intp], corner: NDArray[Any], loose: NDArray[Any] | float) -> Outlines | None:
    """Outlines of arrays of any float type; None if there are none. loose: (j,) or ()."""
    if not len(at):
        return None
    # What _strips() computes is off by a few roundings of the coordinates.
    off = loose + SLACK * np.abs(corner).max(axis=(0, 1)).astype(np.float64)
    return Outlines(at, corner.astype(np.float32), rounded_up(off))


class Members(NamedTuple):
    """What of a CellGrid its surfaces are."""

    member: Ints
    covers: NDArray[np.int16]
    near: NDArray[np.float32]
    outlines: tuple[Outlines, ...] = ()


NOBODY = Members(np.zeros(0, np.int32), np.zeros((4, 0), np.int16), np.zeros(0, np.float32))


def put_together(
    parts: Sequence[tuple[tuple[NDArray[Any], ...], Outlines | None]],
) -> Members:
    """Parts have the first three, and an outline or none.

    Outlines with equally many corners are one.
    """
    found: dict[int, list[tuple[Any, ...]]] = {}
    first = 0
    for (member, *_), outline in parts:
        if outline:
            found.setdefault(outline.corner.shape[1], []).append((outline.at + first, outline.corner, outline.loose))
        first += len(member)
    member, covers, near = joined([part for part, _ in parts])
    return Members(member, covers, near, tuple(Outlines(*joined(some)) for some in found.values()))
