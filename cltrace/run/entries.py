"""The lists of grids on a device, with the same bits as those of cltrace.plan.accel.cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS, Precision, dtype_of
from cltrace.plan.accel.cells import SPARE, CellGrid, Keys, chosen_lift, fill_record
from cltrace.run.toolbox import EdgeType, Toolbox

# Work-items that go through cells, or note much.
ITEMS = 2**10


class Covers:
    """Which cells of one grid n spheres cover: `covers` and `near` of kernels/pack/tiles.cl.

    members: how many are entered; entries: how many cells of level 0 they cover; last: the last one of them; more: how
    many of them are in no grid of the same light before.
    """

    def __init__(self, tools: Toolbox, n: int, pitch: int) -> None:
        self.tools, self.n, self.pitch = tools, n, pitch
        self.cells, self.near = tools.room(4 * pitch, np.int16), tools.room(pitch, np.float32)
        self.members = self.entries = self.last = self.more = 0

    def make(self, kernel: str, *arguments: Any, edge: EdgeType = np.float32) -> None:
        """Runs a kernel that makes them; its last arguments are not given: these buffers, and what it notes."""
        part = self.tools.noted(kernel, *arguments, self.cells, self.near, columns=4, dtype=np.int64, edge=edge)
        self.members, self.entries, _, self.more = part.sum(axis=0).tolist()
        self.last = int(part[:, 2].max())


@dataclass(frozen=True)
class _Layout:
    """How a grid's entries are made. lift: of chosen_lift(); mask: a bit for each level used."""

    lift: int | None
    pitch: list[int]
    base: list[int]
    cells: int
    entries: int
    mask: int
    near_bits: int


class Entries:
    """The lists of one grid after the other. records: of abi's `Grid`."""

    def __init__(self, tools: Toolbox, precision: Precision) -> None:
        self.records: list[NDArray[np.void]] = []
        self._tools, self._dtype = tools, dtype_of("Grid", precision)
        self._pieces: list[tuple[Any, int, Any, int]] = []
        self._cells = self._filled = 0

    def add(self, grid: CellGrid, covers: Covers) -> None:
        """Makes the lists of a grid, whose own members are not looked at."""
        tools, layout = self._tools, self._layout(grid, covers)
        start, entry = tools.room(layout.cells, np.int32), tools.room(layout.entries, np.uint64)
        record = np.zeros(1, self._dtype)
        fill_record(record[0], grid, self._cells, layout.mask)
        self.records.append(record)
        count, sums = tools.room(layout.cells, np.int32), tools.room(ITEMS, np.int32)
        tools.clear(count, layout.cells)
        levels = np.zeros((2, 16), np.int32)
        levels[0, : len(layout.pitch)], levels[1, : len(layout.base)] = layout.pitch, layout.base
        cells, stop = np.int32(layout.cells), np.int32(self._filled + layout.entries)
        spheres = np.int32(covers.n), np.int32(covers.pitch), np.int32(-1 if layout.lift is None else layout.lift)
        where, first = (tools.upload(levels), covers.cells, covers.near), np.int32(self._filled)
        if layout.entries:
            tools.run("count_entries", *spheres, *where, count)
        tools.run("sum_cells", cells, count, sums, items=ITEMS)
        tools.run("start_cells", cells, first, count, sums, start, items=ITEMS)
        if layout.entries:
            bits = np.uint32(2**32 - 2 ** (32 - layout.near_bits))
            tools.run("scatter_entries", *spheres, first, bits, *where, count, entry)
            tools.run("sort_lists", cells, first, stop, start, entry)
        self._pieces.append((start, layout.cells, entry, layout.entries))
        self._cells += layout.cells
        self._filled += layout.entries

    def _layout(self, grid: CellGrid, covers: Covers) -> _Layout:
        if not covers.members:
            return _Layout(None, [1], [0], 1, 0, 0, 32)
        if grid.cells == (1, 1):
            return _Layout(None, [1], [0], 1, covers.members, 1 << CONSTANTS["WHOLE"], 32)
        n, pitch, tallies = np.int32(covers.n), np.int32(covers.pitch), list[NDArray[np.int64]]()

        def tally() -> NDArray[np.int64]:
            if not tallies:
                lifts = 1 if covers.members >= SPARE else 16
                arguments = (n, pitch, np.int32(lifts), covers.cells, covers.near)
                part = self._tools.noted("tally", *arguments, columns=32, dtype=np.int64, items=ITEMS)
                tallies.append(part.sum(axis=0))
            return tallies[0]

        def largest() -> int:
            return int(np.flatnonzero(tally()[16:]).max())

        lift, entries = chosen_lift(covers.members, covers.entries, largest, lambda lift: int(tally()[lift]))
        used = [0] if lift is None else sorted({max(bits - lift, 0) for bits in np.flatnonzero(tally()[16:]).tolist()})
        keys = Keys.on(used, grid.cells, covers.last)
        return _Layout(lift, keys.pitch, keys.base, keys.cells, entries, keys.mask, keys.near_bits)

    def joined(self) -> tuple[dict[str, Any], NDArray[np.void]]:
        """The buffers `start` and `entry`, and the records."""
        tools, ahead = self._tools, CONSTANTS["AHEAD"]
        start, entry = tools.room(self._cells + 1, np.int32), tools.room(self._filled + ahead, np.uint64)
        cells = filled = 0
        while self._pieces:
            starts, some_cells, entries, some = self._pieces.pop(0)
            tools.copy(starts, start, 4 * cells, 4 * some_cells)
            tools.copy(entries, entry, 8 * filled, 8 * some)
            tools.finish()  # There is never room for all of it twice.
            cells, filled = cells + some_cells, filled + some
        tools.copy(tools.upload(np.array([filled], np.int32)), start, 4 * cells, 4)
        tools.copy(tools.upload(np.zeros(ahead, np.uint64)), entry, 8 * filled, 8 * ahead)
        return {"start": start, "entry": entry}, np.concatenate(self.records)
