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
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .numerics import Array, blockwise, concurrently, rounded_down, squared_length

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]


def grid_dtype(real: np.dtype[Any]) -> np.dtype[Any]:
    """`Grid` of kernels/lists.cl."""
    axes = [(name, real, 4) for name in ("right", "up", "ahead")]
    near = [(f"near_{name}", "f4", 4) for name, _, _ in axes]
    return np.dtype([*axes, *near, ("window", "f4", 4), ("cells", "i4", 4), ("flags", "i4", 4)])


# Of a coordinate's size: what float32 arithmetic in the kernel is off by is less than half of it.
SLACK = 2.0**-20
# The same for double, here and in the kernel, with the bits that slopes() may lose.
FINE_SLACK = 2.0**-44
# A window at least so wide has no cell (see _windowed) below 2^-15, 32 times SLACK.
NARROW = 2.0**-4
# Entries beyond 4 a sphere that a sheet may have: that many make even large discs exact to a finest cell.
SPARE = 2**18
# Spreads the bits of a number to every third place.
MORTON = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)
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
    member: (n,), numbers of spheres, ascending; covers: (4, n), first and last column, first and last row of the cells
    of level 0 that each one covers; near: (n,) float32; perspective: of a point, not of a parallel light; coarse:
    whether that leaves room for coordinates in float32.
    """

    axes: Array
    middle: Array
    half: Array
    cells: tuple[int, int]
    member: Ints
    covers: Ints
    near: NDArray[np.float32]
    perspective: bool
    coarse: bool = False


def spatial_order(center: Array) -> NDArray[np.int64]:
    """Indices of points (n, 3) along a curve through space on which neighbours are near each other: Morton 1966."""
    low = center.min(axis=0)
    # Whole numbers of 20 bits; halves, as the difference of two numbers may be beyond all numbers.
    size = max(float((center.max(axis=0) / 2 - low / 2).max()), 1e-300)

    def interleaved(block: slice) -> NDArray[np.uint64]:
        key = np.zeros(len(center[block]), np.uint64)
        for k in range(3):
            v = ((center[block, k] / 2 - low[k] / 2) / size * (2.0**20 - 1)).astype(np.uint64)
            for shift, mask in MORTON:
                v = (v | v << np.uint64(shift)) & np.uint64(mask)
            key |= v << np.uint64(k)
        return key

    key = np.concatenate(blockwise(len(center), interleaved))
    return np.argsort(key)


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
    entered = concurrently([partial(_enter, sheet) for sheet in sheets])
    for g, sheet, (start, entry, mask) in zip(grid, sheets, entered, strict=False):
        # Coordinates count from the window's middle, and are made so before they are rounded to float32.
        right, up, ahead = sheet.axes
        shear = sheet.middle if sheet.perspective else np.zeros(2)
        g["right"][:3], g["up"][:3], g["ahead"][:3] = right - shear[0] * ahead, up - shear[1] * ahead, ahead
        if not sheet.perspective:
            g["right"][3], g["up"][3] = -sheet.middle
        for name in ("right", "up", "ahead"):
            g[f"near_{name}"] = g[name]
        g["flags"][0] = sheet.coarse
        g["window"] = *sheet.half, *(np.array(sheet.cells) / (2 * sheet.half))
        g["cells"] = *sheet.cells, cells, mask
        starts.append(start + np.int32(filled))
        entries.append(entry)
        cells += len(start)
        filled += len(entry)
    return Lists(grid, np.concatenate([*starts, np.array([filled], np.int32)]), np.concatenate(entries))


def _enter(sheet: Sheet) -> tuple[Ints, Ints, int]:
    """The begins of the lists of all cells of one sheet, their entries, and which levels hold anything."""
    if sheet.cells == (1, 1):
        order = np.argsort(sheet.near, kind="stable")
        entry = np.stack([sheet.member, sheet.near.view(np.int32)], axis=1)[order]
        return np.zeros(1, np.int32), entry, bool(len(order)) << WHOLE
    if not len(sheet.member):
        return np.zeros(1, np.int32), np.zeros((0, 2), np.int32), 0
    level = _levels(sheet)
    columns, rows = sheet.cells
    base, width = np.zeros(32, np.int64), np.zeros(32, np.int64)
    total = mask = 0
    for k in reversed(np.flatnonzero(np.bincount(level)).tolist()):
        base[k], width[k], mask = total, ((columns - 1) >> k) + 1, mask | 1 << k
        total += int(width[k]) * (((rows - 1) >> k) + 1)
    # An entry is one whole number: from the top, its cell, the nearest point's measure, rounded down to the bits that
    # are left, and the sphere. Sorting those sorts the cells, and the list of each.
    index_bits = int(sheet.member[-1]).bit_length()
    near_bits = min(32, 63 - index_bits - total.bit_length())
    cut, shift = 32 - near_bits, index_bits + near_bits

    def enter(block: slice) -> NDArray[np.int64]:
        at = level[block]
        key = ((_ascending(sheet.near[block]) >> cut << index_bits) | sheet.member[block]).astype(np.int64)
        left, right, top, bottom = sheet.covers[:, block] >> at
        wide, high, pitch = right - left + 1, bottom - top + 1, width[at]
        key += (base[at] + top * pitch + left) << shift
        # First an entry for each row of cells, then one for each cell.
        key = np.repeat(key, high) + (_count_up(high) * np.repeat(pitch, high) << shift)
        wide = np.repeat(wide, high)
        return np.repeat(key, wide) + (_count_up(wide) << shift)

    key = np.concatenate(blockwise(len(level), enter))
    key.sort()
    start = np.zeros(total, np.int32)
    start[1:] = np.cumsum(np.bincount(key >> shift, minlength=total)[: total - 1])
    entry = np.empty((len(key), 2), np.int32)

    def unpack(block: slice) -> None:
        entry[block, 0] = key[block] & ((1 << index_bits) - 1)
        near = (key[block] >> index_bits & ((1 << near_bits) - 1)) << cut
        entry[block, 1] = _ascending((near - 2**31).astype(np.int32).view(np.float32)) - 2**31

    blockwise(len(key), unpack)
    return start, entry, mask


def _count_up(counts: Ints) -> NDArray[np.int64]:
    """0, 1, ... up to each count, one after the other."""
    end = np.cumsum(counts)
    return np.arange(end[-1] if len(end) else 0) - np.repeat(end - counts, counts)


def _ascending(x: NDArray[np.float32]) -> NDArray[np.int64]:
    """Whole numbers from 0 to 2^32 - 1 in the order of these float32 numbers, made of their bits."""
    bits = x.view(np.int32)
    return (bits ^ (bits >> 31 & 0x7FFFFFFF)).astype(np.int64) + 2**31


def _levels(sheet: Sheet) -> Ints:
    """The level of each member: the finest one on which all of them together take few enough entries."""
    left, right, top, bottom = sheet.covers
    extent = np.maximum(right - left, bottom - top) + 1
    bits: Ints = np.ceil(np.log2(extent)).astype(np.int32)
    # Of very many spheres all on level 0, or each on the level that has its size: what is between takes longer to make
    # and saves nothing.
    many = len(extent) >= SPARE
    lifts, budget = (
        ((30,), 4.5 * len(extent)) if many else (range(int(bits.max(initial=0)), 1, -1), 4 * len(extent) + SPARE)
    )
    for lift in lifts:
        finer: Ints = np.maximum(bits - np.int32(lift), 0)
        left, right, top, bottom = (sheet.covers >> finer).astype(np.int64)
        if ((right - left + 1) * (bottom - top + 1)).sum() <= budget:
            return finer
    coarse: Ints = bits if many else np.maximum(bits - np.int32(1), 0)
    return coarse


def whole_sheet(members: Mask) -> Sheet:
    """One list of spheres for all rays of any kind: what would be without lists. members: (n,), which spheres."""
    member = np.flatnonzero(members).astype(np.int32)
    none, near = np.zeros(2), np.full(len(member), -np.inf, np.float32)
    covers = np.zeros((4, len(member)), np.int32)
    return Sheet(np.zeros((3, 3)), none, none + 1, (1, 1), member, covers, near, True)


def camera_sheet(center: Array, radius: Array, step: tuple[float, float], size: tuple[int, int], among: Mask) -> Sheet:
    """The picture, in cells of 4x4 pixels. center: (n, 3) in camera space; step: a pixel's size at z = -1; among: (n,).

    Left out is what cannot be seen: spheres behind the eye, beside the picture, or between the centres of its pixels.
    """

    def see(block: slice) -> tuple[NDArray[Any], ...]:
        c, r = np.ascontiguousarray(center[block].T), radius[block]
        covers = np.empty((4, len(r)), np.int32)
        ahead = -c[2]
        # Not ahead > -r: the eye may be inside by less than a centre's rounding.
        seen = (ahead > -r * (1 + SLACK)) & among[block]
        for k, sign in ((0, 1.0), (1, -1.0)):
            low, high, clear = slopes(sign * c[k], ahead, r)
            slack = SLACK * (np.abs(low) + np.abs(high))
            # Pixel i is at slope (2i + 1 - n) step; 1/16 of a pixel more, for pictures a few ulp wide.
            i = [((s / step[k]) + size[k] - 1) / 2 for s in (low - slack, high + slack)]
            begin = np.where(clear, np.clip(np.ceil(i[0] - 1 / 16), 0, size[k]), 0)
            end = np.where(clear, np.clip(np.floor(i[1] + 1 / 16), -1, size[k] - 1), size[k] - 1)
            seen &= begin <= end
            covers[2 * k], covers[2 * k + 1] = begin, end
        which = np.flatnonzero(seen)
        near = nearest(c[:, which], r[which])
        return (block.start + which).astype(np.int32), covers[:, which] >> 2, near

    nothing = (np.zeros(0, np.int32), np.zeros((4, 0), np.int32), np.zeros(0, np.float32))
    member, covers, near = _joined([nothing, *blockwise(len(center), see)])
    cells = (-(-size[0] // 4), -(-size[1] // 4))
    return Sheet(np.eye(3), np.zeros(2), np.ones(2), cells, member, covers, near, True)


def _joined(parts: list[tuple[NDArray[Any], ...]]) -> list[NDArray[Any]]:
    return [np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)]


def nearest(center: Array, radius: Array) -> NDArray[np.float32]:
    """A lower bound of the squared distance of each sphere's nearest point; -1 from inside. center: (3, n)."""
    # Lengths are at most 4. A distance is off by less than 2^-46, and a float32 square of one, or of the kernel, by 16
    # units of 2^-24.
    gap = np.sqrt(squared_length(center.T)) - radius - 2.0**-46
    near = rounded_down(gap * gap * (1 - SLACK))
    return np.where(gap > 2.0**-50, near, np.float32(-1))


def point_sheets(offset: Array, radius: Array, among: Mask, receiver: Mask, slack: float) -> list[Sheet]:
    """The sides of a cube around a point light. offset: (n, 3), from the light to the centres; slack: of the kernel;
    among: (n,), what to enter; receiver: (n,), of those, where shadow rays end.
    """
    sides = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
    cube = _towards(offset)

    def look(block: slice) -> list[_Discs]:
        x, y, z = offset[block].T
        f, r = np.array([row[0] * x + row[1] * y + row[2] * z for row in cube]), radius[block]
        near, far = nearest(f, r), (np.sqrt(squared_length(f.T)) + r) ** 2 * (1 + 2.0**-10)
        x, y, z = np.abs(f)
        # How far beyond the side of a pyramid a centre may be, whose sphere still reaches into it.
        reach = r * (np.sqrt(2.0) * (1 + SLACK)) + SLACK * np.maximum(np.maximum(x, y), z)
        found = []
        for axis, sign in sides:
            # The side of the cube is the pyramid |c| <= d, |e| <= d.
            limit = sign * f[axis] + reach
            right, up = (axis + 1) % 3, (axis + 2) % 3
            i = np.flatnonzero((np.abs(f[right]) <= limit) & (np.abs(f[up]) <= limit) & among[block])
            d, radii = sign * f[axis, i], r[i]
            left_right, low_high = (
                (np.where(clear, low, -2.0), np.where(clear, high, 2.0))
                for low, high, clear in (slopes(c, d, radii) for c in (f[right, i], f[up, i]))
            )
            member = (block.start + i).astype(np.int32)
            found.append(_Discs(member, *left_right, *low_high, near[i], far[i], receiver[block][i]))
        return found

    sheets = []
    for (axis, sign), discs in zip(sides, zip(*blockwise(len(radius), look), strict=True), strict=True):
        axes = cube[[(axis + 1) % 3, (axis + 2) % 3, axis]] * np.array([1, 1, sign])[:, None]
        sheets += _windowed(axes, list(discs), slack, True)
    return sheets


def _towards(offset: Array) -> Array:
    """(3, 3): axes of which the last one points at the middle of points (n, 3), about, or away from it."""
    some = offset[:: len(offset) // 4096 + 1]
    middle = some.min(axis=0) / 2 + some.max(axis=0) / 2
    if np.abs(middle).max() < 2.0**-20:
        return np.eye(3)
    # Householder's reflection of the last axis onto that direction, which is orthogonal to the last digits.
    ahead = middle / np.abs(middle).max()
    ahead /= np.sqrt((ahead * ahead).sum())
    v = ahead + np.array([0, 0, np.copysign(1, ahead[2])])
    return np.asarray(np.eye(3) - 2 * np.outer(v, v) / (v * v).sum())


def parallel_sheet(axes: Array, center: Array, radius: Array, among: Mask, receiver: Mask, slack: float) -> list[Sheet]:
    """The plane across a parallel light. axes: (3, 3), the two across and the one towards the light; as above."""

    def look(block: slice) -> _Discs:
        i = np.flatnonzero(among[block])
        c, r = center[block][i], radius[block][i]
        u, v, s = (c @ axis for axis in axes)
        near = rounded_down(-(s + r) - SLACK * (np.abs(s) + r) - 2.0**-100)
        member = (block.start + i).astype(np.int32)
        return _Discs(member, u - r, u + r, v - r, v + r, near, r - s + 2.0**-10, receiver[block][i])

    return _windowed(axes, blockwise(len(radius), look), slack, False)


def _extent(discs: list[_Discs]) -> tuple[Array, Array]:
    """The lowest and the highest coordinates of any disc, (2,) each."""
    least = np.array([min(part[k].min() for part in discs) for k in (1, 3)])
    return least, np.array([max(part[k].max() for part in discs) for k in (2, 4)])


class _Discs(NamedTuple):
    """Some spheres as seen on a sheet: their numbers, their lowest and highest coordinates, bounds of the measure of
    their nearest and furthest points, and whether shadow rays end there.
    """

    member: Ints
    left: Array
    right: Array
    low: Array
    high: Array
    near: NDArray[np.float32]
    far: Array
    receiver: Mask

    def only(self, which: Mask) -> _Discs:
        return self._replace(**{name: column[which] for name, column in self._asdict().items()})


def _windowed(axes: Array, discs: list[_Discs], slack: float, perspective: bool) -> list[Sheet]:
    """A sheet whose window is as large as the discs on it, if there are any, and as those where shadow rays end; the
    side of a cube ends at +-1.
    """
    discs = [part for part in discs if len(part.member)]
    receivers = [part.only(part.receiver) for part in discs if part.receiver.any()]
    if not receivers:
        return []
    limit = 1 + SLACK if perspective else np.inf
    (least, most), (first, last) = _extent(discs), _extent(receivers)
    furthest = max(part.far.max() for part in receivers)
    # Where a ray ends is known to 256 slack, at 2^-8 and more from a light; nearer to one it may be seen anywhere.
    if not perspective or min(part.near.min() for part in receivers) > 2.0**-16:
        room = 256 * slack * (1 + np.maximum(np.abs(first), np.abs(last)))
        least, most = np.maximum(least, first - room), np.minimum(most, last + room)
        if (least > most).any():
            return []
    # Where the discs fill little of the cube's side, float32 would be too coarse for its cells.
    coarse = perspective and bool((most - least > NARROW).all())
    slack = SLACK if coarse else slack
    loose = slack * (1 + 2 * np.maximum(np.abs(least), np.abs(most)))
    low, high = np.maximum(least - loose, -limit), np.minimum(most + loose, limit)
    middle = (low + high) / 2
    half = np.maximum((high - low) / 2, 2.0**-60) * (1 + SLACK)
    # As many cells as spheres, in the window's proportion. Never one only: that would do without the window.
    low, high = middle - half, middle + half
    sides = 2 * half
    cell = np.sqrt(sides[0] * sides[1] / max(2, sum(len(part.member) for part in discs)))
    cells = np.array([int(np.clip(np.ceil(s / cell), 2, 2048)) for s in sides])
    scale = cells / sides

    def place(part: _Discs) -> tuple[NDArray[Any], ...]:
        # Whoever lies wholly beside the window is not met by any ray that has its number there.
        within = part.near < furthest
        covers = np.empty((4, len(within)), np.int32)
        for k, (begin, end) in enumerate(((part.left, part.right), (part.low, part.high))):
            loose = slack * (1 + np.abs(begin) + np.abs(end))
            begin, end = begin - loose, end + loose
            within &= (end >= low[k]) & (begin <= high[k])
            # A 64th of a cell more: the kernel's float32 cell number may be off by that.
            covers[2 * k] = np.clip((begin - low[k]) * scale[k] - 1 / 64, 0, cells[k] - 1)
            covers[2 * k + 1] = np.clip((end - low[k]) * scale[k] + 1 / 64, 0, cells[k] - 1)
        return part.member[within], covers[:, within], part.near[within]

    member, covers, near = _joined(concurrently([partial(place, part) for part in discs]))
    return [Sheet(axes, middle, half, (int(cells[0]), int(cells[1])), member, covers, near, perspective, coarse)]
