"""Triangles as polygons, and the cells that they cover, on a device, with the bits of cltrace.plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.accel.cells import SLACK, CellGrid, Mask, Place, Sizes, most_levels, price_of
from cltrace.plan.exact import Array
from cltrace.plan.shapes.polygon import Pane, Shown
from cltrace.run.toolbox import PACKET, Toolbox, vector

# Numbers that kernels/pack/polygons.cl notes of a side, sides of a cube, numbers of an outline, and what is no level.
EXTENTS, SIDES, OUTLINE, ABSENT = 11, 6, 16, -1
# `Pane` and `Place` of kernels/pack/polygons.cl.
PANE = np.dtype([(name, "f4", 2) for name in ("middle", "halves", "loose", "size", "scale", "shift", "over")])
PLACE = np.dtype(
    [("axes", "f8", (2, 4)), ("slack", "f8"), ("loose", "f8"), ("low", "f8", 2), ("scale", "f8", 2), ("off", "f8")]
    + [("furthest", "f4"), ("price", "f4"), ("pixels", "i4"), ("levels", "i4")]
)


@dataclass
class Spot:
    """A point that sees the m triangles of meshes: Sight of shapes/polygon.py.

    vertex: (v, 3), from there along the camera's axes, in the float buffers' unit; face: a buffer of m rows of four
    ints; count: m; first: the index of the first triangle as a primitive.
    """

    tools: Toolbox
    vertex: Array
    face: Any
    count: int
    first: int

    def see(self, axes: Array, sides: Sequence[int], pane: Pane, among: Mask, receiver: Mask) -> Sequence[Shown]:
        """See Sight."""
        tools, m, v = self.tools, np.int32(self.count), len(self.vertex)
        bits, seen_through = np.int32(sum(1 << side for side in sides)), tools.upload(_pane(pane))
        point = tools.room(4 * (v + PACKET), np.int32, again=True)
        rows = tuple(vector(row) for row in axes)
        tools.run("look_at_vertices", np.int32(v), bits, *rows, seen_through, tools.share(self.vertex), point)
        rest, asked = tools.room(SIDES * (1 + self.count), np.int32, again=True), tools.share(among)
        tools.clear(rest, SIDES)
        common = seen_through, point, self.face, asked, tools.share(receiver), rest
        part = tools.noted("see_polygons", m, bits, *common, columns=SIDES * EXTENTS, dtype=np.float32)
        part = part.reshape(-1, SIDES, EXTENTS)
        most = part[:, :, :-1].max(axis=0).astype(np.float64)
        members = part[:, :, -1].sum(axis=0, dtype=np.int64)
        counts, found = tools.read(rest, SIDES, np.int32).tolist(), []
        for side in sides:
            left = np.sort(tools.read(rest, counts[side], np.int32, SIDES + side * self.count))
            edges = most[side, :8].reshape(2, 4) * np.array([-1, 1, -1, 1])
            bounds = -float(most[side, 8]), float(most[side, 9])
            spot = self, np.int32(side), seen_through, point, asked
            found.append(Seen(int(members[side]), left, edges, *bounds, *spot))
        return found


@dataclass
class Seen:
    """What a side of a cube shows of the triangles: Shown of shapes/polygon.py.

    side: its index; pane, point, among: buffers.
    """

    members: int
    rest: NDArray[np.int32]
    edges: Array
    nearest: float
    furthest: float
    spot: Spot
    side: np.int32
    pane: Any
    point: Any
    among: Any

    def areas(self, stride: int) -> NDArray[np.float32]:
        """See Shown of shapes/polygon.py."""
        return self.sizes(np.zeros((), PLACE), stride).area

    def sizes(self, place: NDArray[np.void], stride: int) -> Sizes:
        """Sizes of those whose indices as primitives `stride` divides; areas on the plane if a grid has no levels."""
        tools, first = self.spot.tools, -self.spot.first % stride
        count = len(range(first, self.spot.count, stride))
        if not count:
            return Sizes(np.zeros(0, np.float32), np.zeros(0, np.float32))
        size = tools.room(2 * (count + PACKET), np.float32)
        which = np.int32(count), np.int32(first), np.int32(stride), self.side
        common = self.pane, tools.upload(place), self.point, self.spot.face, self.among
        tools.run("sample_polygons", *which, *common, size)
        area, sides = tools.read(size, 2 * count, np.float32).reshape(-1, 2).T
        there = area >= 0
        return Sizes(area[there], sides[there])

    def on(self, place: Place) -> Crowd:
        """See Shown of shapes/polygon.py."""
        return Crowd(self, place)


@dataclass
class Crowd:
    """Polygons that are entered on a grid: Held of accel/cells.py.

    Once enter() has been called: used: the levels of those that are entered; last: the last one's index as a primitive;
    level_of: a buffer, ABSENT for triangles that are not entered.
    """

    shown: Seen
    place: Place
    used: list[int] = field(default_factory=list)
    last: int = -1

    def entered(self) -> Mask:
        """See Held."""
        return np.asarray(self._tools.read(self.level_of, self.shown.spot.count, np.int8) != ABSENT)

    @property
    def _tools(self) -> Toolbox:
        return self.shown.spot.tools

    def enter(self, grid: CellGrid) -> float:
        """Enters them, and returns the price of an entry: see price_of()."""
        tools, shown, m = self._tools, self.shown, self.shown.spot.count
        place, own = self._place(grid), Sizes.of(grid)

        def sample(stride: int) -> Sizes:
            some, others = own.sampled(grid.member, stride), shown.sizes(place, stride)
            return Sizes(np.append(some.area, others.area), np.append(some.sides, others.sides))

        price = price_of(grid, sample)
        place["price"] = price
        pitch = m + PACKET
        self.covers = tools.room(4 * pitch, np.int16, again=True)
        self.near = tools.room(pitch, np.float32, again=True)
        self.level_of = tools.room(pitch, np.int8, again=True)
        self.outline, outlines = tools.room(OUTLINE * m, np.float32, again=True), tools.room(1, np.int32)
        tools.clear(outlines, 1)
        common = shown.side, shown.pane, tools.upload(place), shown.point, shown.spot.face, shown.among
        made = self.covers, self.near, self.level_of, outlines, self.outline
        part = tools.noted("place_polygons", np.int32(m), np.int32(pitch), *common, *made, columns=4, dtype=np.int64)
        bits = int(np.bitwise_or.reduce(part[:, 0]))
        self.used = [k for k in range(bits.bit_length()) if bits >> k & 1]
        self.last, self._entries = shown.spot.first + int(part[:, 1].max()), int(part[:, 3].sum())
        self.outlines = int(tools.read(outlines, 1, np.int32)[0])
        return price

    def _place(self, grid: CellGrid) -> NDArray[np.void]:
        """`Place` of kernels/pack/polygons.cl, but for the price."""
        place, made = self.place, np.zeros((), PLACE)
        for name in ("slack", "loose", "low", "scale", "off", "furthest", "pixels"):
            made[name] = getattr(place, name)
        for row, axis in zip(made["axes"], place.axes, strict=True):
            row[: len(axis)] = axis
        made["levels"] = most_levels(grid)
        return made

    @property
    def _sizes(self) -> tuple[np.int32, np.int32]:
        return np.int32(self.shown.spot.count), np.int32(self.shown.spot.count + PACKET)

    @property
    def _outlines(self) -> tuple[np.int32, np.int32]:
        return np.int32(self.outlines), np.int32(self.place.pixels)

    def count(self, levels: Any, counts: Any) -> int:
        """Adds what is entered to the entries of each cell, and returns how many entries that are."""
        self._tools.run("count_members", *self._sizes, levels, self.level_of, self.covers, counts)
        if not self.outlines:
            return self._entries
        common = levels, self.outline, counts
        part = self._tools.noted("count_outlines", *self._outlines, *common, columns=1, dtype=np.int64)
        return self._entries + int(part.sum())

    def scatter(self, bits: np.uint32, levels: Any, counts: Any, entry: Any) -> None:
        """Writes the entries: see Scatter of entries.py."""
        common = np.int32(self.shown.spot.first), bits, levels
        made = self.level_of, self.covers, self.near
        self._tools.run("scatter_polygons", *self._sizes, *common, *made, counts, entry)
        if self.outlines:
            self._tools.run("scatter_outlines", *self._outlines, *common, self.outline, counts, entry)


def _pane(pane: Pane) -> NDArray[np.void]:
    """`Pane` of kernels/pack/polygons.cl."""
    made = np.zeros((), PANE)
    for k in (0, 1):
        reach = abs(pane.middle[k]) + pane.half[k]
        made["middle"][k], made["halves"][k] = pane.middle[k], pane.half[k]
        made["loose"][k], made["size"][k] = SLACK * reach, 1 + abs(pane.middle[k]) + pane.half[k]
        made["scale"][k], made["shift"][k], made["over"][k] = pane.scale[k], pane.shift[k], 1 / pane.scale[k]
    return made
