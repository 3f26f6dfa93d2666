"""The lists of grids on a device, with the same bits as those of cltrace.plan.accel.cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS, Precision, dtype_of
from cltrace.plan.accel.cells import (
    ONE_CELL_LEVEL,
    SPARE,
    CellGrid,
    Keys,
    Placement,
    Strip,
    chosen_lift,
    entered_in,
    fill_record,
)
from cltrace.run.pack.list_buffers import ListBuffers, Part
from cltrace.run.pack.polygons import EnteredPolygons
from cltrace.run.pack.toolbox import Arguments, EdgeType, Toolbox

# Work-items that go through cells, or note much.
ITEMS = 2**10
NONE = np.zeros(0, np.int32)
# Of lists that are all in one cell.
ONE_CELL = Keys(used=[0], pitch=[1], base=[0], cells=1, mask=0, index_bits=31, near_bits=32)
# Starts the kernels that write entries, which are given `mask`, the bits of depth that count, `levels`, `next`, where
# the next entry of each cell belongs, and `entry`.
Scatter = Callable[..., None]


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

    @property
    def arguments(self) -> Arguments:
        """Those of kernels that look at all spheres."""
        return {"n": self.n, "pitch": self.pitch, "covers": self.cells, "near": self.near}

    def place(self, edge: EdgeType, **arguments: Any) -> None:
        """Makes them by the kernel of this name, of which these are the other arguments."""
        part = self.tools.noted("place", 4, np.int64, edge=edge, **self.arguments, **arguments)
        self.members, self.entries, _, self.more = part.sum(axis=0).tolist()
        self.last = int(part[:, 2].max())


@dataclass(frozen=True)
class _Layout:
    """How a grid's entries are made, and how many, at most. lift: of chosen_lift()."""

    keys: Keys
    entries: int
    lift: int | None = None


class Listed(NamedTuple):
    """Where the lists of one grid are. cell: the first one in `start`; mask: of its record."""

    cell: int
    mask: int


@dataclass(frozen=True)
class _OwnMembers:
    """The members that a grid itself has, on a device, beside its strips of cells.

    used: their levels; entries: how many; last: the last one; members, strips: what kernels are given that go through
    them; written: what entries are made of.
    """

    tools: Toolbox
    used: list[int]
    entries: int
    last: int
    members: Arguments
    strips: Arguments
    written: Arguments

    @classmethod
    def of(cls, tools: Toolbox, grid: CellGrid, price: float | None) -> _OwnMembers:
        """price: of Placement.of()."""

        def shared(**arrays: NDArray[Any]) -> Arguments:
            return {name: tools.share(np.ascontiguousarray(array)) for name, array in arrays.items()}

        place, n = Placement.of(grid, price), len(grid.member)
        columns = zip(*place.strips, strict=True) if place.strips else 4 * [[NONE]]
        strip = [np.concatenate(parts).astype(np.int32) for parts in columns]
        boxes = np.where(place.outlined, np.int8(-1), place.level)
        return cls(
            tools,
            place.used,
            place.entries,
            last=int(grid.member.max(initial=-1)),
            members={"n": n, "pitch": n} | shared(level_of=boxes, covers=grid.covers),
            strips={"n": len(strip[0])} | shared(level_of=place.level, **dict(zip(Strip._fields, strip, strict=True))),
            written=shared(member=grid.member, near=grid.near),
        )

    def count(self, **cells: Any) -> None:
        if self.members["n"]:
            self.tools.run("count_members", **self.members, **cells)
        if self.strips["n"]:
            self.tools.run("count_strips", **self.strips, **cells)

    def scatter(self, **entries: Any) -> None:
        if self.members["n"]:
            self.tools.run("scatter_members", **self.members, **self.written, **entries)
        if self.strips["n"]:
            self.tools.run("scatter_strips", **self.strips, **self.written, **entries)


def _levels(tools: Toolbox, keys: Keys) -> Any:
    """`Levels` of kernels/pack/cells.cl."""
    table = np.zeros((2, 16), np.int32)
    table[0, : len(keys.pitch)], table[1, : len(keys.base)] = keys.pitch, keys.base
    return tools.upload(table)


def _of_levels(tools: Toolbox, counts: Any, every: Keys, keys: Keys, rows: int) -> Any:
    """Of counts of the cells of every level, those of the levels that are used. rows: of cells, on level 0."""
    if keys.cells == every.cells:
        return counts
    found = tools.room(keys.cells, np.int32)
    for k in keys.used:
        size = keys.pitch[k] * (((rows - 1) >> k) + 1)
        tools.copy(counts, found, 4 * keys.base[k], 4 * size, first=4 * every.base[k])
    return found


class ListWriter:
    """The lists of one grid after the other, each of which is written where it stays.

    records: of abi's `Grid`; listed: where each one's are; lists: the buffers, others if they need that.
    """

    def __init__(self, tools: Toolbox, precision: Precision, lists: ListBuffers) -> None:
        self.records: list[NDArray[np.void]] = []
        self.listed: list[Listed] = []
        self.lists = lists
        self._tools, self._dtype = tools, dtype_of("Grid", precision)
        # Where lists began, where those of the second grid did, and where the next ones belong: a cell and an entry.
        self._begin = self._second = self._next = (0, 0)

    def add(self, grid: CellGrid, covers: Covers) -> None:
        """Makes the lists of a grid, whose own members are not looked at."""
        tools, layout = self._tools, self._layout(grid, covers)
        spheres = covers.arguments | {"lift": -1 if layout.lift is None else layout.lift}
        counts = tools.room(layout.keys.cells, np.int32)
        tools.clear(counts, layout.keys.cells)
        if layout.entries:
            tools.run("count_entries", **spheres, levels=_levels(tools, layout.keys), count=counts)
        self._list(grid, layout, counts, partial(tools.run, "scatter_entries", **spheres))

    def _list(self, grid: CellGrid, layout: _Layout, counts: Any, scatter: Scatter) -> None:
        """Makes lists of which it is known how many entries each cell has."""
        tools, sums, keys, entries = self._tools, self._tools.room(ITEMS, np.int32), layout.keys, layout.entries
        tools.run("sum_cells", items=ITEMS, cells=keys.cells, count=counts, sum=sums)
        at, first = self._place(keys.cells, entries)
        lists, entry = {"cells": keys.cells, "at": at, "start": self.lists.start}, self.lists.entry
        tools.run("start_cells", items=ITEMS, **lists, first=first, count=counts, sum=sums)
        if entries:
            bits = 2**32 - 2 ** (32 - keys.near_bits)
            scatter(levels=_levels(tools, keys), mask=bits, next=counts, entry=entry)
            tools.run("sort_lists", **lists, entry=entry)
        self.add_again(grid, Listed(at, keys.mask))

    def _place(self, cells: int, entries: int) -> tuple[int, int]:
        """The first cell and the first entry of the next grid's lists. There is room for so many then."""
        more, lists = (cells + 1, entries + CONSTANTS["AHEAD"]), self.lists
        gap = self._next if self.records else lists.gap(*more)
        at, first = gap or (lists.common.cell_stop, lists.common.entry_stop)
        if not gap or not lists.fits(at + more[0], first + more[1]):
            self.lists = lists.another((at, first), at + more[0], first + more[1])
        self._next = at + cells, first + entries
        if not self.records:
            self._begin, self._second = (at, first), self._next
        return at, first

    def add_again(self, grid: CellGrid, listed: Listed) -> None:
        """Adds a grid whose lists are there already."""
        record = np.zeros(1, self._dtype)
        fill_record(record[0], grid, *listed)
        self.records.append(record)
        self.listed.append(listed)

    def add_members(self, grid: CellGrid) -> None:
        """Makes the lists of a grid, of its own members and of those that are held."""
        tools, held = self._tools, grid.held
        if held is not None and not isinstance(held, EnteredPolygons):
            raise TypeError("what is held elsewhere is not on this device")
        price = held.enter(grid) if held else None
        if grid.cells == (1, 1) or not (len(grid.member) or (held and held.used)):
            _, entry, mask = entered_in(grid)
            at, first = self._place(1, len(entry))
            tools.copy(tools.upload(np.array([first, first + len(entry)], np.int32)), self.lists.start, 4 * at, 8)
            tools.copy(tools.upload(entry), self.lists.entry, 8 * first, 8 * len(entry))
            self.add_again(grid, Listed(at, mask))
            return
        own = _OwnMembers.of(tools, grid, price)
        used = sorted({*own.used, *(held.used if held else ())})
        # Which levels are used is known only now, but how many entries the others' outlines have, only when all levels
        # have been counted: their cells are put together then.
        every = Keys.on(list(range(used[-1] + 1)), grid.cells, 0)
        counts, levels = tools.room(every.cells, np.int32), _levels(tools, every)
        tools.clear(counts, every.cells)
        own.count(levels=levels, count=counts)
        entries = own.entries + (held.count(levels=levels, count=counts) if held else 0)
        keys = Keys.on(used, grid.cells, max(own.last, held.last if held else -1))
        counts = _of_levels(tools, counts, every, keys, rows=grid.cells[1])

        def scatter(**written: Any) -> None:
            own.scatter(**written)
            if held:
                held.scatter(**written)

        self._list(grid, _Layout(keys, entries), counts, scatter)

    def _layout(self, grid: CellGrid, covers: Covers) -> _Layout:
        if not covers.members:
            return _Layout(ONE_CELL, 0)
        if grid.cells == (1, 1):
            return _Layout(replace(ONE_CELL, mask=1 << ONE_CELL_LEVEL), covers.members)
        tallies = list[NDArray[np.int64]]()

        def tally() -> NDArray[np.int64]:
            if not tallies:
                lifts = 1 if covers.members >= SPARE else 16
                part = self._tools.noted("tally", 32, np.int64, items=ITEMS, lifts=lifts, **covers.arguments)
                tallies.append(part.sum(axis=0))
            return tallies[0]

        def largest() -> int:
            return int(np.flatnonzero(tally()[16:]).max())

        lift, entries = chosen_lift(covers.members, covers.entries, largest, lambda lift: int(tally()[lift]))
        used = [0] if lift is None else sorted({max(bits - lift, 0) for bits in np.flatnonzero(tally()[16:]).tolist()})
        return _Layout(Keys.on(used, grid.cells, covers.last), entries, lift)

    def done(self, common: bool = True) -> tuple[dict[str, Any], NDArray[np.void]]:
        """The buffers `start` and `entry`, and the records: lists of the first grid stay while somebody keeps these.

        common: whether those of the others, if they were made here, are common to all that is put there from now on,
        in place of what was. Else they stay as long as the first one's.
        """
        tools, lists, ahead, (cell, entry) = self._tools, self.lists, CONSTANTS["AHEAD"], self._next
        tools.copy(tools.upload(np.zeros(ahead, np.uint64)), lists.entry, 8 * entry, 8 * ahead)
        records, stop = np.concatenate(self.records), (cell + 1, entry + ahead)
        if common and self._next != self._second:
            lists.common, stop = Part(*self._second, *stop), self._second
        lists.take(Part(*self._begin, *stop), records)
        tools.finish()
        return {"start": lists.start, "entry": lists.entry}, records
