"""Triangles as polygons on a plane, and the cells that they cover, on a device.

A triangle seen from a point is a convex polygon on the image plane, or on a side of a light's cube. Most have their
three corners ahead and not far out of the window that is looked through. The others, and those near the point, are left
to cltrace.plan.accel.silhouettes. Polygons that cover more than a row or a column of cells are entered in those cells
that they touch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS
from cltrace.plan.accel.grids import FINER, SIDE, SIDES, Extent, PictureWindow, Shadows, Side
from cltrace.plan.accel.silhouettes import DEPTH_SLACK, SLACK, TURNED
from cltrace.plan.rounding import Array, Mask
from cltrace.run.pack.toolbox import PACKET, Arguments, Entered, Toolbox, numbered

# So many times as wide and high as the window is the pyramid in which corners are divided by their depth.
GUARD = 2.0
# Pixels smaller than this, at z = -1, are too small for slopes in float32 to be divided by them, and cells of parallel
# light that are narrower than the other are too narrow for places in float32, which are off by 2^-23.
TINY, TINY_CELL = 2.0**-64, 2.0**-16
# So many entries, besides 4 for each triangle, a grid may have.
SPARE = 2**18
# How many entries there are follows from one in so many polygons, unless those are fewer than this.
SAMPLE, FEW_SAMPLES = 16, 2**12
# Numbers that kernels/pack/polygons.cl notes of a side, and numbers of an outline.
EXTENTS, OUTLINE = 11, 16
# `Pane` and `Place` of kernels/pack/polygons.cl.
PANE = np.dtype(
    [(name, "f4", 2) for name in ("middle", "halves", "loose", "size", "scale", "shift", "over")] + [("along", "f4")]
)
PLACE = np.dtype(
    [("axes", "f8", (2, 4)), ("slack", "f8"), ("loose", "f8"), ("low", "f8", 2), ("scale", "f8", 2), ("off", "f8")]
    + [("furthest", "f4"), ("pixels", "i4"), ("level", "i4")]
)


class Pane(NamedTuple):
    """The window that is looked through, a rectangle of the plane one unit ahead.

    middle, half: its middle and half of its sides, across and up, as slopes; scale, shift: coordinates on the plane
    are slope * scale + shift; along: 0 where all is seen from a point. Where it is seen along a direction instead, it
    is what depths are off by, and nothing is outside of the window.
    """

    middle: tuple[float, float]
    half: tuple[float, float]
    scale: tuple[float, float] = (1, 1)
    shift: tuple[float, float] = (0, 0)
    along: float = 0

    @property
    def largest(self) -> tuple[float, float]:
        """The largest size of a slope in the pyramid in which corners are divided."""
        across, up = (abs(m) + GUARD * h for m, h in zip(self.middle, self.half, strict=True))
        return across, up

    @property
    def off(self) -> float:
        """By how much corners on a side of a cube are off in double, beside what is allowed for roundings to float.

        Across a parallel light it is what they are off by in float32.
        """
        return 2.0**-23 if self.along else TURNED * (1 + max(self.largest)) ** 2

    @property
    def record(self) -> NDArray[np.void]:
        """`Pane` of kernels/pack/polygons.cl."""
        made = np.zeros((), PANE)
        made["along"] = self.along
        for k in (0, 1):
            reach = abs(self.middle[k]) + self.half[k]
            made["middle"][k], made["halves"][k] = self.middle[k], self.half[k]
            made["loose"][k], made["size"][k] = SLACK * reach, 1 + reach
            made["scale"][k], made["shift"][k], made["over"][k] = self.scale[k], self.shift[k], 1 / self.scale[k]
        return made


@dataclass
class PolygonSight:
    """A point that sees the m triangles of meshes.

    vertex: (v, 3), from there along the camera's axes, in the float buffers' unit; face: a buffer of m rows of four
    ints; count: m; first: the index of the first triangle as a surface.
    """

    tools: Toolbox
    vertex: Array
    face: Any
    count: int
    first: int

    def picture(self, axes: Array, window: PictureWindow, among: Mask) -> tuple[EnteredPolygons | None, Mask]:
        """Enters on the tiles what the window shows of `among`, and says which surfaces are left to the host.

        axes: (3, 3), across, down and ahead.
        """
        if min(window.step) <= TINY or max(window.size) <= CONSTANTS["TILE"]:
            return None, among
        first, count = window.region[:2], window.region[2:]
        # A pixel's coordinates are its column and row. The window ends half a pixel beyond its outermost ones.
        scale = [0.5 / step for step in window.step]
        shift = [(n - 1) / 2 for n in window.size]
        middle = [(first[k] + (count[k] - 1) / 2 - shift[k]) / scale[k] for k in (0, 1)]
        half = [count[k] / 2 / scale[k] for k in (0, 1)]
        pane = Pane((middle[0], middle[1]), (half[0], half[1]), (scale[0], scale[1]), (shift[0], shift[1]))
        # In pixels: a 64th, and what coordinates are off by in float32, and in double before.
        off = max(
            SLACK * (s * p + n) + TURNED * s * (1 + p) ** 2
            for s, p, n in zip(scale, pane.largest, window.size, strict=True)
        )
        (shown,) = self._see(axes, [4], pane, Shadows(among, among, 0))
        place, loose = np.zeros((), PLACE), float(np.float32(1 / 64 + window.spread + off))
        place["loose"], place["off"], place["scale"], place["pixels"] = loose, loose, 1, CONSTANTS["TILE"]
        for row, axis in zip(place["axes"], window.axes, strict=True):
            row[:2] = axis.first, axis.stop
        return EnteredPolygons.of(shown, place) if shown.members else None, shown.rest

    def sides(self, cube: Array, who: Shadows) -> list[ShownSide]:
        """What the sides of a cube around the point show, in their order. cube: (3, 3), its axes."""
        return self._see(cube, range(len(SIDES)), Pane((0, 0), (SIDE, SIDE)), who)

    def across(self, axes: Array, who: Shadows) -> ShownSide | None:
        """What a parallel light shows, None if float32 is too coarse for it.

        No coordinate exceeds sqrt(3), so places in float32 are off by 2^-24, and FINE_SLACK. The kernel's depths and
        what is subtracted from them are, too, which is less than pane.along; in single, the slack is.
        """
        (shown,) = self._see(axes, [4], Pane((0, 0), (1, 1), along=DEPTH_SLACK + who.slack), who)
        left, right, low, high = shown.extent.spans[0]
        tiny = shown.members and (right - left) * (high - low) < max(shown.members, FINER) * TINY_CELL**2
        return None if tiny else shown

    def _see(self, axes: Array, sides: Sequence[int], pane: Pane, who: Shadows) -> list[ShownSide]:
        """What sides of a cube show. axes: (3, 3), of the cube; sides: their indices, 2 k along axis k and 2 k + 1
        against it, each of which has the next two axes across and up."""
        tools, v, mine = self.tools, len(self.vertex), slice(self.first, self.first + self.count)
        bits, point = sum(1 << side for side in sides), tools.room(4 * (v + PACKET), np.int32, again=True)
        common = {"pane": tools.upload(pane.record), "point": point}
        cube = dict(zip("abc", axes, strict=True))
        tools.run("look_at_vertices", n=v, sides=bits, vertex=tools.share(self.vertex), **cube, **common)
        rest = tools.room(len(SIDES) * (1 + self.count), np.int32, again=True)
        tools.clear(rest, len(SIDES))
        common |= {"face": self.face, "among": tools.share(np.ascontiguousarray(who.occluder[mine]))}
        written = {"receiver": tools.share(np.ascontiguousarray(who.receiver[mine])), "rest": rest}
        part = tools.noted(
            "see_polygons", len(SIDES) * EXTENTS, np.float32, m=self.count, sides=bits, **common, **written
        )
        part = part.reshape(-1, len(SIDES), EXTENTS)
        most = part[:, :, :-1].max(axis=0).astype(np.float64)
        members = part[:, :, -1].sum(axis=0, dtype=np.int64)
        counts, found = tools.read(rest, len(SIDES), np.int32).tolist(), []
        for side in sides:
            left = who.occluder.copy()
            left[mine] = False
            left[self.first + tools.read(rest, counts[side], np.int32, len(SIDES) + side * self.count)] = True
            # Left and low edges are noted with the other sign.
            edges = (most[side, :8].reshape(2, 4) + pane.off) * np.array([-1, 1, -1, 1])
            extent = Extent(edges.tolist(), -float(most[side, 8]), float(most[side, 9]))
            found.append(ShownSide(int(members[side]), left, extent, pane.off, self, common | {"side": side}))
        return found


@dataclass
class ShownSide:
    """What a side of a cube shows of the triangles.

    members: how many; rest: of all surfaces, those that are left to the host; extent: of Extent, with squared
    distances; loose: how far off corners are, besides a few roundings; seen: what kernels are given that look through
    it.
    """

    members: int
    rest: Mask
    extent: Extent
    loose: float
    sight: PolygonSight
    seen: Arguments

    def sizes(self) -> NDArray[np.float32]:
        """The sides of squares of twice the areas of some polygons, of one in SAMPLE, or of all if there is none."""
        place = np.zeros((), PLACE)
        place["level"] = -1
        area, _, _ = self.sampled(place, 1)
        return np.asarray(np.sqrt(2 * area))

    def sampled(self, place: NDArray[np.void], least: int) -> tuple[NDArray[np.float32], NDArray[np.float32], int]:
        """sizes_on() of one polygon in SAMPLE, or of all if that gives fewer than `least`; and its `stride`."""
        for stride in (SAMPLE, 1):
            area, sides = self.sizes_on(place, stride)
            if len(area) >= least:
                break
        return area, sides, stride

    def sizes_on(self, place: NDArray[np.void], stride: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Of those whose indices as surfaces `stride` divides, the areas in cells of level 0, and widths plus heights;
        or the areas on the plane, and 0, if no level is given."""
        tools, first = self.sight.tools, -self.sight.first % stride
        count = len(range(first, self.sight.count, stride))
        size = tools.room(2 * (count + PACKET), np.float32)
        which: Arguments = {"count": count, "first": first, "stride": stride}
        if count:
            tools.run("sample_polygons", **which, **self.seen, place=tools.upload(place), size=size)
        area, sides = tools.read(size, 2 * count, np.float32).reshape(-1, 2).T
        there = area >= 0
        return area[there], sides[there]

    def entered_on(self, sides: tuple[Side, Side], slack: float, furthest: float) -> EnteredPolygons:
        """Enters them on a light's grid. sides: of its window; slack: relative to an edge; furthest: where the last
        ray ends."""
        place = np.zeros((), PLACE)
        place["axes"], place["slack"], place["loose"], place["furthest"] = sides, slack, self.loose, furthest
        place["low"], place["scale"] = [side.first for side in sides], [side.scale for side in sides]
        most = max(abs(x) for x in self.extent.spans[0])
        place["off"] = (slack * (1 + 2 * most) + self.loose) * place["scale"].max() + 1 / 64
        return EnteredPolygons.of(self, place)

    def level_on(self, place: NDArray[np.void]) -> int:
        """The finest level on which they take few enough entries.

        A convex body in a lattice meets area + width + height + 1 cells on average, all measured in cells.
        """
        area, sides, stride = self.sampled(place, FEW_SAMPLES)
        for level in range(16):
            by = 0.5**level
            if stride * float((area * by * by + sides * by + 1).sum(dtype=np.float64)) <= 4 * self.members + SPARE:
                break
        return level


@dataclass
class EnteredPolygons:
    """Polygons that are entered on a level of a grid. members: how many."""

    sight: PolygonSight
    members: int
    level: int
    groups: list[Entered]

    @classmethod
    def of(cls, shown: ShownSide, place: NDArray[np.void]) -> EnteredPolygons:
        """Enters what a side shows. place: `Place` of kernels/pack/polygons.cl, but for the level."""
        tools, m = shown.sight.tools, shown.sight.count
        place["level"] = level = shown.level_on(place)
        pitch = m + PACKET
        covers, near = tools.room(4 * pitch, np.int16, again=True), tools.room(pitch, np.float32, again=True)
        outline, outlines = tools.room(OUTLINE * m, np.float32, again=True), tools.room(1, np.int32)
        tools.clear(outlines, 1)
        written = {"place": tools.upload(place), "outline": outline, "outlines": outlines}
        cells: Arguments = {"pitch": pitch, "covers": covers, "near": near}
        part = tools.noted("place_polygons", 1, np.int64, m=m, **cells, **shown.seen, **written)
        count = int(tools.read(outlines, 1, np.int32)[0])
        groups = [Entered("entries", cells | {"n": m, "level": level}, numbered(covers, shown.sight.first))]
        if count:
            outlined = {"n": count, "pixels": int(place["pixels"]), "outline": outline}
            groups.append(Entered("outlines", outlined, {"first": shown.sight.first}))
        return cls(shown.sight, int(part.sum()), level, groups)

    def entered(self) -> Mask:
        """(m,): which triangles they are."""
        near = self.sight.tools.read(self.groups[0].counted["near"], self.sight.count, np.float32)
        return np.asarray(near != np.inf)
