"""Triangles as polygons, and the cells that they cover, on a device, with the bits of cltrace.plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.accel.cells import SLACK, CellGrid, Place, Sizes, most_levels, price_of
from cltrace.plan.accel.polygons import ENTRIES, off_by
from cltrace.plan.accel.silhouettes import Elsewhere, Extent, Pane
from cltrace.plan.rounding import Array, Mask
from cltrace.run.pack.toolbox import PACKET, Arguments, Toolbox

# Numbers that kernels/pack/polygons.cl notes of a side, sides of a cube, numbers of an outline, and what is no level.
EXTENTS, SIDES, OUTLINE, ABSENT = 11, 6, 16, -1
# `Pane` and `Place` of kernels/pack/polygons.cl.
PANE = np.dtype(
    [(name, "f4", 2) for name in ("middle", "halves", "loose", "size", "scale", "shift", "over")] + [("along", "f4")]
)
PLACE = np.dtype(
    [("axes", "f8", (2, 4)), ("slack", "f8"), ("loose", "f8"), ("low", "f8", 2), ("scale", "f8", 2), ("off", "f8")]
    + [("furthest", "f4"), ("price", "f4"), ("pixels", "i4"), ("levels", "i4")]
)


@dataclass
class PolygonSight:
    """A point that sees the m triangles of meshes: Sight of accel/polygons.py.

    vertex: (v, 3), from there along the camera's axes, in the float buffers' unit; face: a buffer of m rows of four
    ints; count: m; first: the index of the first triangle as a primitive.
    """

    tools: Toolbox
    vertex: Array
    face: Any
    count: int
    first: int

    def see(self, axes: Array, sides: Sequence[int], pane: Pane, among: Mask, receiver: Mask) -> Sequence[Elsewhere]:
        """See Sight."""
        tools, v = self.tools, len(self.vertex)
        bits, point = sum(1 << side for side in sides), tools.room(4 * (v + PACKET), np.int32, again=True)
        common = {"pane": tools.upload(_pane(pane)), "point": point}
        cube = dict(zip("abc", axes, strict=True))
        tools.run("look_at_vertices", n=v, sides=bits, vertex=tools.share(self.vertex), **cube, **common)
        rest = tools.room(SIDES * (1 + self.count), np.int32, again=True)
        tools.clear(rest, SIDES)
        common |= {"face": self.face, "among": tools.share(among)}
        written = {"receiver": tools.share(receiver), "rest": rest}
        part = tools.noted("see_polygons", SIDES * EXTENTS, np.float32, m=self.count, sides=bits, **common, **written)
        part = part.reshape(-1, SIDES, EXTENTS)
        most = part[:, :, :-1].max(axis=0).astype(np.float64)
        members = part[:, :, -1].sum(axis=0, dtype=np.int64)
        counts, found = tools.read(rest, SIDES, np.int32).tolist(), []
        for side in sides:
            left = np.sort(tools.read(rest, counts[side], np.int32, SIDES + side * self.count))
            # Left and low edges are noted with the other sign.
            edges = (most[side, :8].reshape(2, 4) + off_by(pane)) * np.array([-1, 1, -1, 1])
            extent = Extent(edges.tolist(), -float(most[side, 8]), float(most[side, 9]))
            seen = common | {"side": side}
            found.append(ShownSide(int(members[side]), left, extent, off_by(pane), sight=self, seen=seen))
        return found


@dataclass
class ShownSide:
    """What a side of a cube shows of the triangles: Elsewhere of accel/silhouettes.py.

    seen: what kernels are given that look through it.
    """

    members: int
    rest: NDArray[np.int32]
    extent: Extent
    loose: float
    sight: PolygonSight
    seen: Arguments
    entries = ENTRIES

    def sizes(self, sample: int) -> NDArray[np.float32]:
        """See Elsewhere."""
        return np.asarray(np.sqrt(2 * self.sizes_on(np.zeros((), PLACE), sample).area))

    def sizes_on(self, place: NDArray[np.void], stride: int) -> Sizes:
        """Sizes of those whose indices as primitives `stride` divides; areas on the plane if a grid has no levels."""
        tools, first = self.sight.tools, -self.sight.first % stride
        count = len(range(first, self.sight.count, stride))
        if not count:
            return Sizes(np.zeros(0, np.float32), np.zeros(0, np.float32))
        size = tools.room(2 * (count + PACKET), np.float32)
        which: Arguments = {"count": count, "first": first, "stride": stride}
        tools.run("sample_polygons", **which, **self.seen, place=tools.upload(place), size=size)
        area, sides = tools.read(size, 2 * count, np.float32).reshape(-1, 2).T
        there = area >= 0
        return Sizes(area[there], sides[there])

    def on(self, place: Place) -> EnteredPolygons:
        """See Elsewhere of accel/silhouettes.py."""
        return EnteredPolygons(self, place)


@dataclass
class EnteredPolygons:
    """Polygons that are entered on a grid: Held of accel/cells.py.

    Once enter() has been called: used: the levels of those that are entered; last: the last one's index as a primitive;
    made: what kernels are given of each triangle, of which level_of is ABSENT where it is not entered; outlined: of
    those that have outlines, how many and which.
    """

    shown: ShownSide
    place: Place
    used: list[int] = field(default_factory=list)
    last: int = -1
    made: Arguments = field(default_factory=dict)
    outlined: Arguments = field(default_factory=dict)

    def entered(self) -> Mask:
        """See Held."""
        return np.asarray(self._tools.read(self.made["level_of"], self.shown.sight.count, np.int8) != ABSENT)

    @property
    def _tools(self) -> Toolbox:
        return self.shown.sight.tools

    def enter(self, grid: CellGrid) -> float:
        """Enters them, and returns the price of an entry: see price_of()."""
        tools, shown, m = self._tools, self.shown, self.shown.sight.count
        place, own = self._place(grid), Sizes.of(grid)

        def sample(stride: int) -> Sizes:
            some, others = own.sampled(grid.member, stride), shown.sizes_on(place, stride)
            return Sizes(np.append(some.area, others.area), np.append(some.sides, others.sides))

        price = price_of(grid, sample)
        place["price"] = price
        pitch = m + PACKET
        sizes = {"covers": (4, np.int16), "near": (1, np.float32), "level_of": (1, np.int8)}
        self.made = {name: tools.room(k * pitch, dtype, again=True) for name, (k, dtype) in sizes.items()}
        outline, outlines = tools.room(OUTLINE * m, np.float32, again=True), tools.room(1, np.int32)
        tools.clear(outlines, 1)
        written = {"place": tools.upload(place), "outline": outline, "outlines": outlines, **self.made}
        part = tools.noted("place_polygons", 4, np.int64, m=m, pitch=pitch, **shown.seen, **written)
        bits = int(np.bitwise_or.reduce(part[:, 0]))
        self.used = [k for k in range(bits.bit_length()) if bits >> k & 1]
        self.last, self._entries = shown.sight.first + int(part[:, 1].max()), int(part[:, 3].sum())
        self.made |= {"n": m, "pitch": pitch}
        count = int(tools.read(outlines, 1, np.int32)[0])
        self.outlined = {"n": count, "pixels": self.place.pixels, "outline": outline}
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

    def count(self, **cells: Any) -> int:
        """Adds what is entered to the entries of each cell, and returns how many entries that are."""
        members = {name: self.made[name] for name in ("n", "pitch", "level_of", "covers")}
        self._tools.run("count_members", **members, **cells)
        if not self.outlined["n"]:
            return self._entries
        return self._entries + int(self._tools.noted("count_outlines", 1, np.int64, **self.outlined, **cells).sum())

    def scatter(self, **entries: Any) -> None:
        """Writes the entries: see Scatter of lists.py."""
        first = self.shown.sight.first
        self._tools.run("scatter_polygons", index=first, **self.made, **entries)
        if self.outlined["n"]:
            self._tools.run("scatter_outlines", index=first, **self.outlined, **entries)


def _pane(pane: Pane) -> NDArray[np.void]:
    """`Pane` of kernels/pack/polygons.cl."""
    made = np.zeros((), PANE)
    made["along"] = pane.along
    for k in (0, 1):
        reach = abs(pane.middle[k]) + pane.half[k]
        made["middle"][k], made["halves"][k] = pane.middle[k], pane.half[k]
        made["loose"][k], made["size"][k] = SLACK * reach, 1 + abs(pane.middle[k]) + pane.half[k]
        made["scale"][k], made["shift"][k], made["over"][k] = pane.scale[k], pane.shift[k], 1 / pane.scale[k]
    return made
