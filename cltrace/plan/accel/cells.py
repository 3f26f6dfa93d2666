"""A grid of cells, each with the list of the surfaces that a ray through it may meet: the packed form of both tiles and
light buffers.

All primary rays start at the eye, and all shadow rays of a point light end at the light. Seen from there, a ray is a
point of a plane, a sphere is a disc, and only the discs over the point matter. A grid covers a rectangle of such a
plane; for a parallel light, of the plane across the light.

A disc may cover any number of cells. So a grid is hierarchical: level 0 has the finest cells, each level above it cells
of twice the side, and a sphere is entered on one level, the finest on which it takes few enough cells. A ray then looks
at one cell of each level that holds anything. Within a cell, the spheres come in depth order, by their nearest points,
so that a search ends as soon as those lie behind what was found.

Bounds are computed in double and widened by more than all rounding, of the kernel's float32, too. So a list may hold a
sphere in vain, but it lacks none that a ray meets, and no list changes a picture. (In single, some of extreme scenes
are an exception: docs/accuracy.md.)
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

# Of a coordinate's size: what float32 arithmetic is off by, here and in the kernel, is less than half of it each.
SLACK = 2.0**-20
# Entries beyond 4 a sphere that a grid may have: that many make even large discs exact to a finest cell.
SPARE = 2**18
# Rows at a time, mostly of float32: fewer, and threads would wait for Python's lock more than they work.
BLOCK = 2**17


@dataclass(frozen=True)
class Lists:
    """The lists of several grids.

    grid: (g,) records of abi's `Grid`; start: where the list of each cell begins in entry, and one more for the last
    one's end; entry: (e, 2), the sphere's index, and the float32 bits of its nearest point's depth, which grows along a
    list.
    """

    grid: NDArray[np.void]
    start: Ints
    entry: Ints


@dataclass(frozen=True)
class CellGrid:
    """One grid and what is to be entered on it.

    axes: (3, 3): right, up, ahead; middle, half: (2,), of the window and its sides; cells: (columns, rows) of level 0;
    member: (n,), indices of spheres, ascending; covers: (4, n), of the cells of level 0 that each one covers the first
    column and the first row, and how many more columns and rows; near: (n,) float32, depth of the nearest points;
    perspective: of a point, not of a parallel light; coarse: whether that leaves room for coordinates in float32.
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
    """Enters all members of all grids."""
    records = np.zeros(len(grids), dtype_of("Grid", precision))
    starts, entries = [], []
    cells = filled = 0
    jobs = [partial(_enter, grid) for grid in grids]
    # Threads take a millisecond to start.
    entered = concurrently(jobs) if sum(len(grid.member) for grid in grids) > BLOCK else [job() for job in jobs]
    for g, grid, (start, entry, mask) in zip(records, grids, entered, strict=True):
        # Coordinates count from the window's middle, and are made so before they are rounded to float32.
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
    """The begins of the lists of all cells of one grid, their entries, and which levels hold anything."""
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
    # An entry is one whole number: from the top, its cell, the nearest point's depth, rounded down to the bits that
    # are left, and the sphere. Sorting those sorts the cells, and the list of each.
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
            # First an entry for each row of cells, then one for each cell.
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
        # The depth to the upper half, which has no room for the cell, and the sphere to the lower one, in place.
        near = block_of_keys >> index_bits << int(cut) + 32
        block_of_keys &= (1 << index_bits) - 1
        block_of_keys |= _descended(near)
    start = np.cumsum(counts, dtype=np.int32) - counts
    return start, key.astype("<i8", copy=False).view("<i4").reshape(-1, 2).astype(np.int32, copy=False), mask


def _edges(covers: NDArray[np.int16]) -> NDArray[np.int16]:
    """The first column and row of each, and the last ones."""
    return np.concatenate([covers[:2], covers[:2] + covers[2:]])


def _spread(
    more: NDArray[np.int16], step: int, key: NDArray[np.int64], *others: NDArray[np.int16]
) -> Iterator[tuple[NDArray[Any], ...]]:
    """key, key + step, ..., key + more step of each, in any order, and the others, the same for all of them."""
    yield key, *others
    while len(rest := np.flatnonzero(more > 0)):  # of whole numbers it takes seven times as long
        more = more[rest] - np.int16(1)
        key, *others = (key[rest] + step, *(other[rest] for other in others))  # type: ignore[assignment]
        yield key, *others


def _ascending(x: NDArray[np.float32]) -> NDArray[np.uint32]:
    """The bits of float32 numbers, so changed that they are in the same order as whole numbers."""
    bits = x.view(np.int32)
    return (bits ^ (bits >> 31 & np.int32(0x7FFFFFFF))).view(np.uint32) ^ np.uint32(1 << 31)


def _descended(x: NDArray[np.int64]) -> NDArray[np.int64]:
    """The bits that _ascending() was given; both in the upper half, above zeros."""
    x ^= np.int64(-(2**63))
    x ^= x >> 63 & np.int64(0x7FFFFFFF << 32)
    return x


def _levels(grid: CellGrid) -> tuple[NDArray[np.int8], int]:
    """The level of each member, the finest one on which all together take few enough entries; how many those are."""
    wide, high = grid.covers[2:]
    n, entries = len(wide), _entries(grid.covers[2:])
    # Of very many spheres all on level 0, or each on the level that has its size: what is between takes longer to make
    # and saves nothing.
    many = n >= SPARE
    if entries <= 4.5 * n if many else entries <= 4 * n + SPARE:
        return np.zeros(n, np.int8), entries
    # An exponent: the cells of that level are as large as the disc.
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
    """Into so many cells is entered what covers so many more columns and rows than one, (2, n)."""
    wide, high = more
    return int(((wide + np.int32(1)) * (high + np.int32(1))).sum(dtype=np.int64))


def whole_grid(members: Mask) -> CellGrid:
    """One list of spheres for all rays of any kind: what would be without lists. members: (n,), which spheres."""
    member = np.flatnonzero(members).astype(np.int32)
    none, near = np.zeros(2), np.full(len(member), -np.inf, np.float32)
    covers = np.zeros((4, len(member)), np.int16)
    return CellGrid(np.zeros((3, 3)), none, none + 1, (1, 1), member, covers, near, True)


def joined(parts: list[tuple[NDArray[Any], ...]]) -> list[NDArray[Any]]:
    """Columns from blocks of columns, each joined along its last axis."""
    return [np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)]
