"""The lists of grids on a device, with the same bits as those of cltrace.plan.accel.cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS, Precision, dtype_of
from cltrace.plan.accel.cells import SPARE, CellGrid, Keys, Placement, chosen_lift, entered_in, fill_record
from cltrace.run.crowd import Crowd
from cltrace.run.shelf import Block, Shelf
from cltrace.run.toolbox import EdgeType, Toolbox

# Work-items that go through cells, or note much.
ITEMS = 2**10
NONE = np.zeros(0, np.int32)
# Starts the kernels that write entries, of which the bits of depth that count, the levels, where the next entry of each
# cell belongs, and the entries are given.
Scatter = Callable[[np.uint32, Any, Any, Any], None]


class Covers:
    """Which cells of one grid n spheres cover: `covers` and `near` of kernels/pack/tiles.cl.

    members: how many are entered; entries: how many cells of level 0 they cover; last: the last one of them; more: how
    many of them are in no grid of the same light before.
    """

    def __init__(self, tools: Toolbox, n: int, pitch: int) -> None:
        self.tools, self.n, self.pitch = tools, n, pitch
        self.cells = tools.room(4 * pitch, np.int16, again=True)
        self.near = tools.room(pitch, np.float32, again=True)
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


class Listed(NamedTuple):
    """Where the lists of one grid are. cell: the first one in `start`; mask: of its record."""

    cell: int
    mask: int


@dataclass(frozen=True)
class _Own:
    """The members that a grid itself has, on a device. used: their levels; entries: how many; last: the last one."""

    tools: Toolbox
    used: list[int]
    entries: int
    last: int
    columns: tuple[Any, ...]
    strips: tuple[Any, ...]
    sizes: tuple[np.int32, np.int32]

    @classmethod
    def of(cls, tools: Toolbox, grid: CellGrid, price: float | None) -> _Own:
        """price: of Placement.of()."""
        level, outlined, strips, used, entries = Placement.of(grid, price)
        columns = zip(*strips, strict=True) if strips else 4 * [[NONE]]
        strip = [np.concatenate(parts).astype(np.int32) for parts in columns]
        boxes = np.where(outlined, np.int8(-1), level)
        shared = (np.ascontiguousarray(a) for a in (boxes, level, grid.covers, grid.member, grid.near))
        sizes = np.int32(len(grid.member)), np.int32(len(strip[0]))
        last = int(grid.member.max(initial=-1))
        return cls(tools, used, entries, last, tuple(map(tools.share, shared)), tuple(map(tools.share, strip)), sizes)

    def count(self, levels: Any, counts: Any) -> None:
        (n, s), (boxes, level, covers, *_) = self.sizes, self.columns
        if n:
            self.tools.run("count_members", n, n, levels, boxes, covers, counts)
        if s:
            self.tools.run("count_strips", s, levels, level, *self.strips, counts)

    def scatter(self, bits: np.uint32, levels: Any, counts: Any, entry: Any) -> None:
        (n, s), (boxes, level, covers, member, near) = self.sizes, self.columns
        common, written = (bits, levels), (member, near, counts, entry)
        if n:
            self.tools.run("scatter_members", n, n, *common, boxes, covers, *written)
        if s:
            self.tools.run("scatter_strips", s, *common, level, *self.strips, *written)


def _levels(tools: Toolbox, pitch: list[int], base: list[int]) -> Any:
    """`Levels` of kernels/pack/cells.cl."""
    table = np.zeros((2, 16), np.int32)
    table[0, : len(pitch)], table[1, : len(base)] = pitch, base
    return tools.upload(table)


def _of_levels(tools: Toolbox, counts: Any, every: Keys, keys: Keys, rows: int) -> Any:
    """Of counts of the cells of every level, those of the levels that are used. rows: of cells, on level 0."""
    if keys.cells == every.cells:
        return counts
    found = tools.room(keys.cells, np.int32)
    for k in keys.used:
        size = keys.pitch[k] * (((rows - 1) >> k) + 1)
        tools.copy(counts, found, 4 * keys.base[k], 4 * size, 4 * every.base[k])
    return found


class Entries:
    """The lists of one grid after the other, each of which is written where it stays.

    records: of abi's `Grid`; listed: where each one's are; shelf: what they are on, another one if they need that.
    """

    def __init__(self, tools: Toolbox, precision: Precision, shelf: Shelf) -> None:
        self.records: list[NDArray[np.void]] = []
        self.listed: list[Listed] = []
        self.shelf = shelf
        self._tools, self._dtype = tools, dtype_of("Grid", precision)
        # Where lists began, where those of the second grid did, and where the next ones belong: a cell and an entry.
        self._begin = self._second = self._next = (0, 0)

    def add(self, grid: CellGrid, covers: Covers, behind: Any = None) -> None:
        """Makes the lists of a grid, whose own members are not looked at. behind: of CellGrid, a buffer."""
        tools, layout = self._tools, self._layout(grid, covers)
        if grid.cells == (1, 1):
            behind = None
        deepest = covers.near if behind is None else self._deepest(grid, layout, behind)
        lift, some = np.int32(-1 if layout.lift is None else layout.lift), np.int32(behind is not None)
        spheres = np.int32(covers.n), np.int32(covers.pitch), lift, some, deepest

        def count(levels: Any, counts: Any) -> None:
            tools.run("count_entries", *spheres, levels, covers.cells, covers.near, counts)

        def scatter(bits: np.uint32, levels: Any, counts: Any, entry: Any) -> None:
            tools.run("scatter_entries", *spheres, bits, levels, covers.cells, covers.near, counts, entry)

        counts = tools.room(layout.cells, np.int32)
        tools.clear(counts, layout.cells)
        if layout.entries:
            count(_levels(tools, layout.pitch, layout.base), counts)
        self._list(grid, layout, counts, scatter, behind is not None)

    def _deepest(self, grid: CellGrid, layout: _Layout, behind: Any) -> Any:
        """A buffer with the largest `behind` of each cell."""
        tools, found = self._tools, self._tools.room(layout.cells, np.float32)
        levels, (columns, rows) = _levels(tools, layout.pitch, layout.base), map(np.int32, grid.cells)
        tools.run("find_deepest", columns, rows, np.int32(layout.mask), levels, behind, found)
        return found

    def _list(self, grid: CellGrid, layout: _Layout, counts: Any, scatter: Scatter, fewer: bool = False) -> None:
        """Makes lists of which it is known how many entries each cell has. fewer: whether they may be less in all."""
        tools, sums = self._tools, self._tools.room(ITEMS, np.int32)
        tools.run("sum_cells", np.int32(layout.cells), counts, sums, items=ITEMS)
        if fewer:
            layout = replace(layout, entries=int(tools.read(sums, ITEMS, np.int32).sum()))
        levels, bits = _levels(tools, layout.pitch, layout.base), np.uint32(2**32 - 2 ** (32 - layout.near_bits))
        at, first = self._place(layout.cells, layout.entries)
        cells, start, entry = np.int32(layout.cells), self.shelf.start, self.shelf.entry
        tools.run("start_cells", cells, np.int32(at), np.int32(first), counts, sums, start, items=ITEMS)
        if layout.entries:
            scatter(bits, levels, counts, entry)
            tools.run("sort_lists", cells, np.int32(at), start, entry)
        self.add_again(grid, Listed(at, layout.mask))

    def _place(self, cells: int, entries: int) -> tuple[int, int]:
        """The first cell and the first entry of the next grid's lists. There is room for so many then."""
        more, shelf = (cells + 1, entries + CONSTANTS["AHEAD"]), self.shelf
        gap = self._next if self.records else shelf.gap(*more)
        at, first = gap or (shelf.common.cell_stop, shelf.common.entry_stop)
        if not gap or not shelf.fits(at + more[0], first + more[1]):
            self.shelf = shelf.another((at, first), at + more[0], first + more[1])
        self._next = at + cells, first + entries
        if not self.records:
            self._begin, self._second = (at, first), self._next
        return at, first

    def add_again(self, grid: CellGrid, listed: Listed) -> None:
        """Adds a grid whose lists are on the shelf."""
        record = np.zeros(1, self._dtype)
        fill_record(record[0], grid, *listed)
        self.records.append(record)
        self.listed.append(listed)

    def add_members(self, grid: CellGrid) -> None:
        """Makes the lists of a grid, of its own members and of those that are held."""
        tools, held = self._tools, grid.held
        if held is not None and not isinstance(held, Crowd):
            raise TypeError("what is held elsewhere is not on this device")
        price = held.enter(grid) if held else None
        if grid.cells == (1, 1) or not (len(grid.member) or (held and held.used)):
            _, entry, mask = entered_in(grid)
            at, first = self._place(1, len(entry))
            tools.copy(tools.upload(np.array([first, first + len(entry)], np.int32)), self.shelf.start, 4 * at, 8)
            tools.copy(tools.upload(entry), self.shelf.entry, 8 * first, 8 * len(entry))
            self.add_again(grid, Listed(at, mask))
            return
        own = _Own.of(tools, grid, price)
        used = sorted({*own.used, *(held.used if held else ())})
        # Which levels are used is known only now, but how many entries a crowd's outlines have, only when all levels
        # have been counted: their cells are put together then.
        every = Keys.on(list(range(used[-1] + 1)), grid.cells, 0)
        counts, levels = tools.room(every.cells, np.int32), _levels(tools, every.pitch, every.base)
        tools.clear(counts, every.cells)
        own.count(levels, counts)
        entries = own.entries + (held.count(levels, counts) if held else 0)
        keys = Keys.on(used, grid.cells, max(own.last, held.last if held else -1))
        counts = _of_levels(tools, counts, every, keys, grid.cells[1])
        layout = _Layout(None, keys.pitch, keys.base, keys.cells, entries, keys.mask, keys.near_bits)

        def scatter(bits: np.uint32, levels: Any, counts: Any, entry: Any) -> None:
            own.scatter(bits, levels, counts, entry)
            if held:
                held.scatter(bits, levels, counts, entry)

        self._list(grid, layout, counts, scatter)

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

    def done(self) -> tuple[dict[str, Any], NDArray[np.void]]:
        """The buffers `start` and `entry`, and the records: lists of the first grid stay while somebody keeps these.

        Those of the others, if they were made here, are common to all that is put on the shelf from now on.
        """
        tools, shelf, ahead, (cell, entry) = self._tools, self.shelf, CONSTANTS["AHEAD"], self._next
        tools.copy(tools.upload(np.zeros(ahead, np.uint64)), shelf.entry, 8 * entry, 8 * ahead)
        records, stop = np.concatenate(self.records), (cell + 1, entry + ahead)
        if self._next != self._second:
            shelf.common, stop = Block(*self._second, *stop), self._second
        shelf.take(Block(*self._begin, *stop), records)
        tools.finish()
        return {"start": shelf.start, "entry": shelf.entry}, records
