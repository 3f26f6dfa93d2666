"""Grids of cells, each cell with a list of the surfaces that a ray through it may meet: tiles and light buffers.

All primary rays start at the eye, and all shadow rays of a point light end at the light. Seen from there, a ray is a
point of a plane, a sphere is a disc, and only the discs that cover the point matter. The window of a grid is a
rectangle of such a plane; for a parallel light, of the plane across the light.

A disc may cover any number of cells. So a grid is hierarchical: level 0 has the finest cells, and each level above it
has cells of twice the side. A sphere is entered on one level only, the finest on which it takes few enough cells. A ray
then looks at one cell of each level that holds anything. The list of a cell is in depth order, by the spheres' nearest
points, so that a search ends as soon as those lie behind what was found.

Bounds are wider than all rounding, here and in the kernel, can ask for. So a list may hold a sphere in vain, but it
lacks none that a ray meets, and no list changes a picture. (In single some extreme scenes are an exception:
docs/speed.md.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS, Precision, dtype_of
from cltrace.plan.exact import Array, concurrently

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]

# Relative to a coordinate. float32 arithmetic is off by less than half of it here, and by less in the kernel, too.
SLACK = 2.0**-20
# So many entries, besides 4 for each sphere, a grid may have. With few spheres even large discs are then on level 0.
SPARE = 2**18
# Spheres at a time, mostly in float32. With fewer, threads would wait for Python's lock more than they work.
BLOCK = 2**17


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


@dataclass(frozen=True)
class CellGrid:
    """One grid, and n spheres to be entered on it.

    axes: (3, 3), right, up and ahead; middle: (2,), of the window; half: (2,), half of its sides; cells: (columns,
    rows) of level 0; member: (n,), indices of the spheres, ascending; covers: (4, n), the cells of level 0 that each
    one covers, as the first column, the first row, and how many more columns and rows; near: (n,) float32, depth of
    the nearest points; perspective: whether it is seen from a point, not along a parallel light; coarse: whether the
    cells are so large that coordinates in float32 tell them apart.
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


def build(grids: list[CellGrid], precision: Precision) -> Lists:
    """The lists of all cells of all grids: every member is entered in each cell that it covers."""
    records = np.zeros(len(grids), dtype_of("Grid", precision))
    starts, entries = [], []
    cells = filled = 0
    jobs = [partial(_enter, grid) for grid in grids]
    # Threads take a millisecond to start.
    entered = concurrently(jobs) if sum(len(grid.member) for grid in grids) > BLOCK else [job() for job in jobs]
    for g, grid, (start, entry, mask) in zip(records, grids, entered, strict=True):
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
        g["cells"] = *grid.cells, cells, mask
        starts.append(start + np.int32(filled))
        entries.append(entry)
        cells += len(start)
        filled += len(entry)
    entries.append(np.zeros((CONSTANTS["AHEAD"], 2), np.int32))
    return Lists(records, np.concatenate([*starts, np.array([filled], np.int32)]), np.concatenate(entries))


def _enter(grid: CellGrid) -> tuple[Ints, Ints, int]:
    """Of one grid: where the list of each cell begins, the entries, and a bit for each level that holds anything."""
    if grid.cells == (1, 1):
        order = np.argsort(grid.near, kind="stable")
        entry = np.stack([grid.member, grid.near.view(np.int32)], axis=1)[order]
        return np.zeros(1, np.int32), entry, bool(len(order)) << CONSTANTS["WHOLE"]
    if not len(grid.member):
        return np.zeros(1, np.int32), np.zeros((0, 2), np.int32), 0
    level, entries = _levels(grid)
    used = [k for k in range(int(level.max()) + 1) if (level == k).any()]
    columns, rows = grid.cells
    pitch, base = {}, {}
    total = mask = 0
    for k in reversed(used):
        pitch[k], base[k], mask = ((columns - 1) >> k) + 1, total, mask | 1 << k
        total += pitch[k] * (((rows - 1) >> k) + 1)
    # An entry is one whole number. From the top it has the cell, the depth of the nearest point, rounded down to as
    # many bits as are left, and the sphere. Sorting these numbers sorts the cells, and the list of each cell.
    index_bits = int(grid.member[-1]).bit_length()
    near_bits = min(32, 63 - index_bits - total.bit_length())
    cut, shift = np.uint32(32 - near_bits), index_bits + near_bits
    key, filled = np.empty(entries, np.int64), 0
    for i in range(0, len(level), BLOCK):
        block = slice(i, i + BLOCK)
        low = (_ascending(grid.near[block]) >> cut).astype(np.int64) << index_bits | grid.member[block]
        edges = _edges(grid.covers[:, block])
        for k in used:
            which = np.flatnonzero(level[block] == k) if len(used) > 1 else slice(None)
            left, top, right, bottom = edges[:, which] >> k
            cell = top.astype(np.int64) * pitch[k] + left + base[k]
            # First there is one number for each row of cells that a sphere covers, then one for each cell.
            rows_of = joined(list(_spread(bottom - top, pitch[k] << shift, cell << shift | low[which], right - left)))
            for (part,) in _spread(rows_of[1], 1 << shift, rows_of[0]):
                key[filled : filled + len(part)] = part
                filled += len(part)
    key.sort()
    counts = np.zeros(total, np.int32)
    for i in range(0, entries, BLOCK):
        block_of_keys = key[i : i + BLOCK]
        cell = block_of_keys >> shift
        first = int(cell[0])
        here = np.bincount(cell - first)
        counts[first : first + len(here)] += here.astype(np.int32)
        # In place: the depth goes to the upper half, where it pushes out the cell, the sphere to the lower half.
        near = block_of_keys >> index_bits << int(cut) + 32
        block_of_keys &= (1 << index_bits) - 1
        block_of_keys |= _descended(near)
    start = np.cumsum(counts, dtype=np.int32) - counts
    return start, key.astype("<i8", copy=False).view("<i4").reshape(-1, 2).astype(np.int32, copy=False), mask


def _edges(covers: NDArray[np.int16]) -> NDArray[np.int16]:
    """(4, n): the first column, the first row, the last column and the last row of each."""
    return np.concatenate([covers[:2], covers[:2] + covers[2:]])


def _spread(
    more: NDArray[np.int16], step: int, key: NDArray[np.int64], *others: NDArray[np.int16]
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


def _levels(grid: CellGrid) -> tuple[NDArray[np.int8], int]:
    """The level of each member, and how many entries all of them take: the finest levels that take few enough."""
    wide, high = grid.covers[2:]
    n, entries = len(wide), _entries(grid.covers[2:])
    # Where spheres are very many, all are on level 0, or each is on the level that has its size. Whatever is in between
    # takes longer to make and saves nothing.
    many = n >= SPARE
    if entries <= 4.5 * n if many else entries <= 4 * n + SPARE:
        return np.zeros(n, np.int8), entries
    # Cells of level `bits` are as large as the disc.
    bits = np.frexp(np.maximum(wide, high).astype(np.float32))[1].astype(np.int8)
    edges = _edges(grid.covers)
    for lift in (0,) if many else range(int(bits.max()) - 1, 0, -1):
        level = np.maximum(bits - np.int8(lift), np.int8(0))
        left_top, right_bottom = (edges[:2] >> level), (edges[2:] >> level)
        entries = _entries(right_bottom - left_top)
        if many or lift == 1 or entries <= 4 * n + SPARE:
            break
    return level, entries


def _entries(more: NDArray[np.int16]) -> int:
    """How many entries discs take that cover one column and one row and so many more of them, (2, n)."""
    wide, high = more
    return int(((wide + np.int32(1)) * (high + np.int32(1))).sum(dtype=np.int64))


def whole_grid(members: Mask) -> CellGrid:
    """A grid of one cell: one list of spheres for all rays, in the order of their indices. members: (n,), which."""
    member = np.flatnonzero(members).astype(np.int32)
    none, near = np.zeros(2), np.full(len(member), -np.inf, np.float32)
    covers = np.zeros((4, len(member)), np.int16)
    return CellGrid(np.zeros((3, 3)), none, none + 1, (1, 1), member, covers, near, True)


def joined(parts: list[tuple[NDArray[Any], ...]]) -> list[NDArray[Any]]:
    """Each of several arrays, put together along its last axis from the same one of each block."""
    return [np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)]
