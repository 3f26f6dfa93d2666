"""Which spheres a ray can meet at all: lists of spheres for the cells of a sheet.

All primary rays start at the eye, and all shadow rays of a point light end at the light: seen from there, a ray is a
point of a plane, a sphere is a disc, and only the discs over the point matter. A sheet is a rectangle of such a plane,
cut into cells; for a parallel light, of the plane across the light. A point light has up to six sheets, the sides of a
cube around it.

A disc may cover any number of cells. So a sheet is a pyramid: level 0 has the finest cells, each level above it cells
of twice the side, and a sphere is entered on one level, the finest on which it takes few enough cells. A ray then looks
at one cell of each level that holds anything. Within a cell, the spheres come in the order of their nearest points, so
that a search ends as soon as those lie behind what was found.

Bounds are computed in double and widened by more than all rounding, of the kernel's float32, too: a list may hold a
sphere in vain, but lacks none, and no list changes a picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .numerics import Array, rounded_down, squared_length

Ints = NDArray[np.int32]


def grid_dtype(real: np.dtype[Any]) -> np.dtype[Any]:
    """`Grid` of kernels/lists.cl."""
    axes = [(name, real, 4) for name in ("right", "up", "ahead")]
    return np.dtype([*axes, ("window", "f4", 4), ("cells", "i4", 4)])


# Of a coordinate's size: what float32 arithmetic in the kernel is off by is less than half of it.
SLACK = 2.0**-20
# The same for double, here and in the kernel, with the bits that slopes() may lose.
FINE_SLACK = 2.0**-44
# Entries beyond 4 a sphere that a sheet may have: that many make even large discs exact to a finest cell.
SPARE = 2**18
# The level of a sheet that is one cell only: wherever a ray is, its cell has the number 0 there.
WHOLE = 30


@dataclass(frozen=True)
class Lists:
    """The lists of several sheets.

    grid: (g,) grid_dtype; start: where the list of each cell begins in entry, and one more for the last one's end;
    entry: (e, 2), the sphere's number, and the float32 bits of the nearest point's measure, which grows along a list.
    """

    grid: NDArray[np.void]
    start: Ints
    entry: Ints


@dataclass(frozen=True)
class Sheet:
    """One sheet and what is to be entered on it.

    axes: (3, 3): right, up, ahead; middle, half: (2,), of the window and its sides; cells: (columns, rows) of level 0;
    member: (n,), numbers of spheres; first, last: (n, 2), the range of cells of level 0 that each one covers; near:
    (n,) float32; perspective: of a point, not of a parallel light.
    """

    axes: Array
    middle: Array
    half: Array
    cells: tuple[int, int]
    member: Ints
    first: Ints
    last: Ints
    near: NDArray[np.float32]
    perspective: bool


def slopes(c: Array, d: Array, r: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """The tangents, from the origin, at circles with centre (c, d) and radius r: lowest and highest c/d, and whether.

    They exist where the circle is clear of the line d = 0. With d^2 - r^2 >= d^2 / 16 the numerators, which may cancel,
    lose 4 bits at most: the slopes are right to 2^-46 of the larger one.
    """
    gap = (d - r) * (d + r)
    clear = (d > 0) & (gap >= d * d / 16)
    safe = np.where(clear, gap, 1.0)
    root = r * np.sqrt(c * c + safe)
    low, high = (c * d - root) / safe, (c * d + root) / safe
    return low, high, clear


def build(sheets: list[Sheet], real: np.dtype[Any]) -> Lists:
    """Enters all members of all sheets."""
    grid = np.zeros(max(1, len(sheets)), grid_dtype(real))
    starts, entries = [], [np.zeros((0, 2), np.int32)]
    cells = filled = 0
    for g, sheet in zip(grid, sheets, strict=False):
        start, entry, mask = _enter(sheet)
        # Coordinates count from the window's middle, and are made so before they are rounded to float32.
        right, up, ahead = sheet.axes
        shear = sheet.middle if sheet.perspective else np.zeros(2)
        g["right"][:3], g["up"][:3], g["ahead"][:3] = right - shear[0] * ahead, up - shear[1] * ahead, ahead
        if not sheet.perspective:
            g["right"][3], g["up"][3] = -sheet.middle
        g["window"] = *sheet.half, *(np.array(sheet.cells) / (2 * sheet.half))
        g["cells"] = *sheet.cells, cells, mask
        starts.append(start + np.int32(filled))
        entries.append(entry)
        cells += len(start)
        filled += len(entry)
    return Lists(grid, np.concatenate([*starts, np.array([filled], np.int32)]), np.concatenate(entries))


def _enter(sheet: Sheet) -> tuple[Ints, Ints, int]:
    """The begins of the lists of all cells of one sheet, their entries, and which levels hold anything."""
    order = np.argsort(sheet.near).astype(np.int32)
    level = (_levels(sheet) if sheet.cells != (1, 1) else np.full(len(order), WHOLE, np.int32))[order]
    columns, rows = sheet.cells
    base, width = np.zeros(32, np.int32), np.zeros(32, np.int32)
    total = mask = 0
    for k in reversed(np.flatnonzero(np.bincount(level)).tolist()):
        base[k], width[k], mask = total, ((columns - 1) >> k) + 1, mask | 1 << k
        total += int(width[k]) * (((rows - 1) >> k) + 1)
    first, last = sheet.first[order] >> level[:, None], sheet.last[order] >> level[:, None]
    span = last - first + 1
    counts = span[:, 0] * span[:, 1]
    # Entry after entry: which sphere, and which of its cells. Spheres stay in the order of `near`.
    of = np.repeat(np.arange(len(order), dtype=np.int32), counts)
    nth = np.arange(len(of), dtype=np.int32) - np.repeat(np.cumsum(counts, dtype=np.int32) - counts, counts)
    down = nth // span[:, 0][of]
    corner = base[level] + first[:, 1] * width[level] + first[:, 0]
    cell = corner[of] + down * (width[level] - span[:, 0])[of] + nth
    # By cell, and within a cell in that order: a sort of whole numbers.
    member = order[(np.sort((cell.astype(np.int64) << 32) | of) & 0xFFFFFFFF)]
    start = np.zeros(total, np.int32)
    start[1:] = np.cumsum(np.bincount(cell, minlength=total)[: total - 1])
    entry = np.empty((len(member), 2), np.int32)
    entry[:, 0], entry[:, 1] = sheet.member[member], sheet.near[member].view(np.int32)
    return start, entry, mask


def _levels(sheet: Sheet) -> Ints:
    """The level of each member: the finest one on which all of them together take few enough entries."""
    wide, high = (sheet.last - sheet.first + 1).T
    extent = np.maximum(wide, high)
    bits: Ints = np.ceil(np.log2(extent)).astype(np.int32)
    budget = 4 * len(extent) + SPARE
    # With many spheres, finding a better share costs more than it saves.
    for lift in range(int(bits.max(initial=0)), 1, -1) if len(extent) < SPARE else ():
        finer: Ints = np.maximum(bits - np.int32(lift), 0)
        span = (sheet.last >> finer[:, None]) - (sheet.first >> finer[:, None]) + 1
        if (span[:, 0].astype(np.int64) * span[:, 1]).sum() <= budget:
            return finer
    coarse: Ints = np.maximum(bits - np.int32(1), 0)
    return coarse


def whole_sheet(n: int) -> Sheet:
    """One list of all spheres, for all rays of any kind: what would be without lists."""
    none, cells = np.zeros(2), np.zeros((n, 2), np.int32)
    near = np.full(n, -np.inf, np.float32)
    return Sheet(np.zeros((3, 3)), none, none + 1, (1, 1), np.arange(n, dtype=np.int32), cells, cells, near, True)


def camera_sheet(center: Array, radius: Array, step: tuple[float, float], size: tuple[int, int]) -> Sheet:
    """The picture, in cells of 4x4 pixels. center (n, 3) in camera space; step: size of a pixel at z = -1.

    Left out is what cannot be seen: spheres behind the eye, beside the picture, or between the centres of its pixels.
    """
    first, last = np.empty((len(center), 2), np.int32), np.empty((len(center), 2), np.int32)
    ahead = -center[:, 2]
    seen = ahead > -radius
    for k, sign in ((0, 1.0), (1, -1.0)):
        low, high, clear = slopes(sign * center[:, k], ahead, radius)
        slack = SLACK * (np.abs(low) + np.abs(high))
        # Pixel i is at slope (2i + 1 - n) step; 1/16 of a pixel more, for pictures a few ulp wide.
        i = [((s / step[k]) + size[k] - 1) / 2 for s in (low - slack, high + slack)]
        begin = np.where(clear, np.clip(np.ceil(i[0] - 1 / 16), 0, size[k]), 0)
        end = np.where(clear, np.clip(np.floor(i[1] + 1 / 16), -1, size[k] - 1), size[k] - 1)
        seen &= begin <= end
        first[:, k], last[:, k] = begin.astype(np.int32) >> 2, end.astype(np.int32) >> 2
    member = np.flatnonzero(seen).astype(np.int32)
    cells = (-(-size[0] // 4), -(-size[1] // 4))
    near = nearest(center[member], radius[member])
    return Sheet(np.eye(3), np.zeros(2), np.ones(2), cells, member, first[member], last[member], near, True)


def nearest(center: Array, radius: Array) -> NDArray[np.float32]:
    """A lower bound of the squared distance of the nearest point of each sphere; -1 from inside. Lengths at most 4."""
    # A distance is off by less than 2^-46, and a float32 square of one, or of the kernel, by 16 units of 2^-24.
    gap = np.sqrt(squared_length(center)) - radius - 2.0**-46
    return np.where(gap > 2.0**-50, rounded_down(gap * gap * (1 - 2.0**-20)), np.float32(-1)).astype(np.float32)


def point_sheets(offset: Array, radius: Array, slack: float) -> list[Sheet]:
    """The sides of a cube around a point light. offset: (n, 3), from the light to the centres; slack: of the kernel."""
    sheets = []
    near = nearest(offset, radius)
    x, y, z = np.abs(offset).T
    # How far beyond the side of a pyramid a centre may be, whose sphere still reaches into it.
    reach = radius * np.sqrt(2.0) * (1 + SLACK) + SLACK * np.maximum(np.maximum(x, y), z)
    for axis in range(3):
        for sign in (1.0, -1.0):
            right, up = (axis + 1) % 3, (axis + 2) % 3
            d, c, e = sign * offset[:, axis], offset[:, right], offset[:, up]
            # The side of the cube is the pyramid |c| <= d, |e| <= d.
            limit = d + reach
            member = np.flatnonzero((np.abs(c) <= limit) & (np.abs(e) <= limit)).astype(np.int32)
            if not len(member):
                continue
            bounds = []
            for other in (c[member], e[member]):
                low, high, clear = slopes(other, d[member], radius[member])
                loose = slack * (1 + np.abs(low) + np.abs(high))
                bounds.append((np.where(clear, low - loose, -2), np.where(clear, high + loose, 2)))
            axes = np.eye(3)[[right, up, axis]] * np.array([1, 1, sign])[:, None]
            sheets.append(_windowed(axes, bounds, member, near[member], True))
    return sheets


def parallel_sheet(axes: Array, center: Array, radius: Array, slack: float) -> Sheet:
    """The plane across a parallel light. axes: (3, 3), the two across and the one towards the light."""
    bounds = []
    for axis in axes[:2]:
        c = center @ axis
        loose = radius + slack * (1 + np.abs(c) + radius)
        bounds.append((c - loose, c + loose))
    s = center @ axes[2]
    near = rounded_down(-(s + radius) - SLACK * (np.abs(s) + radius) - 2.0**-100)
    return _windowed(axes, bounds, np.arange(len(center), dtype=np.int32), near, False)


def _windowed(
    axes: Array, bounds: list[tuple[Array, Array]], member: Ints, near: NDArray[np.float32], perspective: bool
) -> Sheet:
    """A sheet whose window is as large as the discs on it; the side of a cube, but for SLACK, ends at +-1."""
    limit = 1 + SLACK if perspective else np.inf
    low = np.array([max(b[0].min(), -limit) for b in bounds])
    high = np.array([min(b[1].max(), limit) for b in bounds])
    middle = (low + high) / 2
    half = np.maximum((high - low) / 2, 2.0**-60) * (1 + SLACK)
    # As many cells as spheres, in the window's proportion. Never one only: that would do without the window.
    low, sides = middle - half, 2 * half
    cell = np.sqrt(sides[0] * sides[1] / max(2, len(member)))
    cells = np.array([int(np.clip(np.ceil(s / cell), 2, 2048)) for s in sides])
    first, last = np.empty((len(member), 2), np.int32), np.empty((len(member), 2), np.int32)
    for k in (0, 1):
        scale = cells[k] / sides[k]
        # A 64th of a cell more: the kernel's float32 cell number may be off by that.
        first[:, k] = np.clip(np.floor((bounds[k][0] - low[k]) * scale - 1 / 64), 0, cells[k] - 1)
        last[:, k] = np.clip(np.floor((bounds[k][1] - low[k]) * scale + 1 / 64), 0, cells[k] - 1)
    # Whoever lies wholly beside the window is not met by any ray that has its number there.
    beside = np.zeros(len(member), bool)
    for k in (0, 1):
        beside |= (bounds[k][1] < low[k]) | (bounds[k][0] > low[k] + sides[k])
    i = ~beside
    size = (int(cells[0]), int(cells[1]))
    return Sheet(axes, middle, half, size, member[i], first[i], last[i], near[i], perspective)
