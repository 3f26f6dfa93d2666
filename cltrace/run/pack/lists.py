"""The lists of grids on a device: those of several cameras, beside what these have in common.

Unlike those of cltrace.plan.accel.grids, they may be on several levels: a surface is entered on one of them only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS, Precision
from cltrace.plan.accel.grids import ONE_CELL_LEVEL, SPARE, CellGrid, listed, record_of, runs_of
from cltrace.run.pack.polygons import EnteredPolygons
from cltrace.run.pack.toolbox import PACKET, Arguments, Entered, Toolbox, numbered

# Work-items that go through cells, or note much.
ITEMS = 2**10
# What is taken for one grid that holds nothing yet: neither many surfaces nor many cells are known of it.
LEAST = 2**17
# On a CPU there is room for so many grids beside those of lights: the tiles of some cameras.
CAMERAS = 3
# Where spheres take more entries each, beside SPARE ones, each is on the level of its size.
ENTRIES = 6
# In place of a level of kernels/pack/cells.cl.
BY_SIZE = -1


# ----------------------------------------------------------------------------------------------------------- buffers


class Part(NamedTuple):
    """A part of ListBuffers: where it begins in `start` and in `entry`, and where it ends there."""

    cell: int
    entry: int
    cell_stop: int
    entry_stop: int

    def meets(self, other: Part) -> bool:
        """Whether they have anything in common."""
        return (self.cell < other.cell_stop and other.cell < self.cell_stop) or (
            self.entry < other.entry_stop and other.entry < self.entry_stop
        )


class ListBuffers:
    """Buffers of lists, and who uses which part of them.

    start, entry: those of abi, for so many cells and entries; common: what is there for all cameras. One thread at a
    time may write there; who reads what has been written need not wait.
    """

    def __init__(self, tools: Toolbox, cells: int, entries: int) -> None:
        self._tools, self._size = tools, (cells, entries)
        self.start = tools.room(cells, np.int32, again=True)
        self.entry = tools.room(entries, np.uint64, again=True)
        self.common = Part(0, 0, 0, 0)
        self._taken: dict[object, Part] = {}

    @classmethod
    def of(cls, tools: Toolbox, surfaces: int, lights: int) -> ListBuffers:
        """One for the lists of so many surfaces and lights, which grows with them on a GPU.

        On a CPU it is ample: memory costs nothing until it is written to. Down a tunnel, a sphere has four
        entries for each light.
        """
        if tools.kind != "cpu":
            return cls(tools, 1, 1)
        ample = (CAMERAS + lights) * max(surfaces, LEAST)
        return cls(tools, min(ample, tools.most(np.int32)), min(6 * ample, tools.most(np.uint64)))

    def fits(self, cells: int, entries: int) -> bool:
        """Whether there is room for so many, from the first one on."""
        return cells <= self._size[0] and entries <= self._size[1]

    def gap(self, cells: int, entries: int) -> tuple[int, int] | None:
        """The first cell and the first entry of a part that nobody has taken, None if there is none."""
        taken = [self.common, *list(self._taken.values())]
        for cell, entry in [(0, 0), *((part.cell_stop, part.entry_stop) for part in taken)]:
            part = Part(cell, entry, cell + cells, entry + entries)
            if self.fits(part.cell_stop, part.entry_stop) and not any(map(part.meets, taken)):
                return cell, entry
        return None

    def take(self, part: Part, owner: object) -> None:
        """Keeps a part for as long as somebody keeps its owner."""
        key = object()
        self._taken[key] = part
        finalize(owner, self._taken.pop, key, None).atexit = False

    def another(self, used: tuple[int, int], cells: int, entries: int) -> ListBuffers:
        """One for at least so many, with what is common. used: how many cells and entries are copied there.

        Raises DeviceError if the device can have no such buffers.
        """
        sizes = [
            old if least <= old else max(least, min(old * 3 // 2, self._tools.most(kind)))
            for least, old, kind in zip((cells, entries), self._size, (np.int32, np.uint64), strict=True)
        ]
        other = ListBuffers(self._tools, *sizes)
        self._tools.copy(self.start, other.start, 0, 4 * used[0])
        self._tools.copy(self.entry, other.entry, 0, 8 * used[1])
        other.common = self.common
        return other


# ----------------------------------------------------------------------------------------------------------- writing


@dataclass(frozen=True)
class Levels:
    """The levels of a grid that hold anything.

    used: rising; pitch, base: of each level from 0 on, the cells in a row, and the first cell; cells: of all levels.
    """

    used: list[int]
    pitch: list[int]
    base: list[int]
    cells: int

    @classmethod
    def of(cls, used: list[int], cells: tuple[int, int]) -> Levels:
        """used: rising; cells: (columns, rows) of level 0."""
        if cells == (1, 1) or not used:
            return cls([ONE_CELL_LEVEL] if used else [], [1], [0], 1)
        pitch = [((cells[0] - 1) >> k) + 1 for k in range(used[-1] + 1)]
        base, total = [0 for _ in pitch], 0
        for k in reversed(used):
            base[k] = total
            total += pitch[k] * (((cells[1] - 1) >> k) + 1)
        return cls(used, pitch, base, total)

    @property
    def mask(self) -> int:
        """A bit for each of `used`."""
        return sum(1 << k for k in self.used)

    def on(self, tools: Toolbox) -> Any:
        """`Levels` of kernels/pack/cells.cl."""
        table = np.zeros((2, 16), np.int32)
        table[0, : len(self.pitch)], table[1, : len(self.base)] = self.pitch, self.base
        return tools.upload(table)


class Listed(NamedTuple):
    """Where the lists of one grid are. cell: the first one in `start`; mask: of its record."""

    cell: int
    mask: int


class ListWriter:
    """The lists of one grid after the other, each of which is written where it stays.

    records: of abi's `Grid`; listed: where each one's are; lists: the buffers, others if they need that.
    """

    def __init__(self, tools: Toolbox, precision: Precision, lists: ListBuffers) -> None:
        self.records: list[NDArray[np.void]] = []
        self.listed: list[Listed] = []
        self.lists = lists
        self._tools, self._precision = tools, precision
        # Where lists began, where those of the second grid did, and where the next ones belong: a cell and an entry.
        self._begin = self._second = self._next = (0, 0)

    def add(self, grid: CellGrid, spheres: Arguments, members: int, entries: int) -> None:
        """Makes the lists of a grid of spheres.

        spheres: arguments of kernels, of which `covers` says where spheres are and `near` which ones are entered;
        members: how many; entries: how many cells of level 0 they cover.
        """
        tools, used, level = self._tools, [0], 0
        if grid.cells != (1, 1) and entries > ENTRIES * members + SPARE:
            sizes = tools.noted("tally", 17, np.int64, items=ITEMS, **spheres).sum(axis=0)
            used, level = np.flatnonzero(sizes[:16]).tolist(), BY_SIZE
        entered = Entered("entries", spheres | {"level": level}, numbered(spheres["covers"], 0))
        self._list(grid, used, [entered] if members else [])

    def add_members(self, grid: CellGrid) -> None:
        """Makes the lists of a grid: its own members are on one level, and those that are held on one, too."""
        tools, held, own, used = self._tools, grid.held, grid.members, set[int]()
        assert held is None or isinstance(held, EnteredPolygons)
        held = held if held and held.members else None
        if grid.cells == (1, 1) or not (len(own.member) or held):
            _, entry, mask = listed(grid)
            at, first = self._place(1, len(entry))
            tools.copy(tools.upload(np.array([first, first + len(entry)], np.int32)), self.lists.start, 4 * at, 8)
            tools.copy(tools.upload(entry), self.lists.entry, 8 * first, 8 * len(entry))
            self.add_again(grid, Listed(at, mask))
            return
        groups = held.groups if held else []
        own, level = runs_of(grid)
        if len(own.member):
            near = np.append(own.near, np.full(PACKET, np.inf, np.float32))  # Kernels read whole packets.
            # Kernels take cells of level 0.
            covers = tools.upload(own.covers << np.int16(level))
            members = {"n": len(own.member), "pitch": len(own.member), "level": level, "covers": covers}
            members |= {"near": tools.upload(near)}
            groups = [Entered("entries", members, numbered(tools.upload(own.member))), *groups]
            used.add(level)
        self._list(grid, sorted(used | ({held.level} if held else set())), groups)

    def _list(self, grid: CellGrid, used: list[int], groups: list[Entered]) -> None:
        """Makes the lists of a grid on these levels."""
        tools, sums = self._tools, self._tools.room(ITEMS, np.int32)
        levels = Levels.of(used if groups else [], grid.cells)
        counts, on = tools.room(levels.cells, np.int32), {"levels": levels.on(tools)}
        tools.clear(counts, levels.cells)
        for group in groups:
            tools.run(f"count_{group.kind}", **group.counted, **on, count=counts)
        tools.run("sum_cells", items=ITEMS, cells=levels.cells, count=counts, sum=sums)
        entries = int(tools.read(sums, ITEMS, np.int32).sum())
        at, first = self._place(levels.cells, entries)
        lists, entry = {"cells": levels.cells, "at": at, "start": self.lists.start}, self.lists.entry
        tools.run("start_cells", items=ITEMS, **lists, first=first, count=counts, sum=sums)
        for group in groups:
            tools.run(f"scatter_{group.kind}", **group.counted, **group.written, **on, next=counts, entry=entry)
        if entries:
            tools.run("sort_lists", **lists, entry=entry)
        self.add_again(grid, Listed(at, levels.mask))

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

    def add_again(self, grid: CellGrid, where: Listed) -> None:
        """Adds a grid whose lists are there already."""
        self.records.append(record_of(grid, *where, self._precision))
        self.listed.append(where)

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
