"""Where the lists of grids are on a device: those of several cameras, beside what these have in common."""

from __future__ import annotations

from typing import NamedTuple
from weakref import finalize

import numpy as np

from cltrace.run.pack.toolbox import Toolbox

# What is taken for one grid that holds nothing yet: neither many surfaces nor many cells are known of it.
LEAST = 2**17
# On a CPU there is room for so many grids beside those of lights: the tiles of some cameras.
CAMERAS = 3


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
