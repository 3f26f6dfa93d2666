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
sphere in vain, but lacks none that a ray meets: no list changes a picture (in single, some of extreme scenes: README).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.exact import Array, blockwise, concurrently, rounded_down

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]
# float32 or double.
Reals = NDArray[Any]


def grid_dtype(real: np.dtype[Any]) -> np.dtype[Any]:
    """`Grid` of kernels/lists.cl."""
    axes = [(name, real, 4) for name in ("right", "up", "ahead")]
    near = [(f"near_{name}", "f4", 4) for name, _, _ in axes]
    return np.dtype([*axes, *near, ("window", "f4", 4), ("cells", "i4", 4), ("flags", "i4", 4)])


# Of a coordinate's size: what float32 arithmetic is off by, here and in the kernel, is less than half of it each.
SLACK = 2.0**-20
# The same for double.
FINE_SLACK = 2.0**-44
# A window at least so wide has no cell (see _windowed) below 2^-15, 32 times SLACK.
NARROW = 2.0**-4
# Angles of a pixel below this are beyond what float32 can count in.
TINY = 2.0**-64
# Entries beyond 4 a sphere that a sheet may have: that many make even large discs exact to a finest cell.
SPARE = 2**18
# How many entries ahead the kernel looks, even beyond the last list: AHEAD of kernels/lists.cl.
AHEAD = 8
# Rows at a time, mostly of float32: fewer, and threads would wait for Python's lock more than they work.
BLOCK = 2**17
# The size of one in so many discs is enough to know that of most.
SAMPLE = 16
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
    member: (n,), numbers of spheres, ascending; covers: (4, n), of the cells of level 0 that each one covers the first
    column and the first row, and how many more columns and rows; near: (n,) float32; perspective: of a point, not of a
    parallel light; coarse: whether that leaves room for coordinates in float32.
    """

    axes: Array
    middle: Array
    half: Array
    cells: tuple[int, int]
    member: Ints
    covers: NDArray[np.int16]
    near: NDArray[np.float32]
    perspective: bool
    coarse: bool = False


def spatial_order(center: Array) -> NDArray[np.int64]:
    """Indices of points (n, 3) along a curve through space on which neighbours are near each other: Morton 1966."""
    n, axes = len(center), center.T
    low = [float(x.min()) for x in axes]
    # Halves, as the difference of two numbers may be beyond all numbers.
    size = max(1e-300, *(float(x.max()) / 2 - least / 2 for x, least in zip(axes, low, strict=True)))
    # One number for each point, to be sorted: from the top, the bits of its coordinates in turn, and its index.
    index_bits = (n - 1).bit_length()
    bits = (63 - index_bits) // 3
    every_third = np.zeros(2**bits, np.int64)
    for bit in range(bits):
        every_third |= (np.arange(2**bits) >> bit & 1) << 3 * bit + index_bits
    scale, key = (2**bits - 1) / size, np.arange(n)

    def interleave(block: slice) -> None:
        for k in range(3):
            place = (axes[k][block] / 2 - low[k] / 2) * scale
            key[block] |= every_third[place.astype(np.int32)] << k

    blockwise(n, interleave)
    key.sort()
    key &= (1 << index_bits) - 1
    return key


def slopes(across: list[Reals], d: Reals, r: Reals, gap: Reals) -> list[Reals]:
    """The tangents, from the origin, at circles with centre (c, d) and radius r, for each c of `across`: lowest and
    highest c/d, one after the other.

    gap: d^2 - r^2. The tangents exist where the circle is clear of the line d = 0; else the answer is all numbers. With
    each argument rounded once, both are right to 8 roundings of the larger one, which is |middle| + half: neither of
    those has more. Where squares are about to vanish there is no answer either.
    """
    clear = (d > 0) & (gap >= d * d * (1 / 16)) & (gap > 2.0**-100)
    over = 1 / np.where(clear, gap, 1)
    unclear = np.flatnonzero(~clear)
    forward, around = d * over, r * over
    found = []
    for c in across:
        middle, half = c * forward, around * np.sqrt(np.maximum(c * c + gap, 0))
        low, high = middle - half, middle + half
        low[unclear], high[unclear] = -np.inf, np.inf
        found += [low, high]
    return found


def build(sheets: list[Sheet], real: np.dtype[Any]) -> Lists:
    """Enters all members of all sheets."""
    grid = np.zeros(len(sheets), grid_dtype(real))
    starts, entries = [], []
    cells = filled = 0
    jobs = [partial(_enter, sheet) for sheet in sheets]
    # Threads take a millisecond to start.
    entered = concurrently(jobs) if sum(len(sheet.member) for sheet in sheets) > BLOCK else [job() for job in jobs]
    for g, sheet, (start, entry, mask) in zip(grid, sheets, entered, strict=True):
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
    entries.append(np.zeros((AHEAD, 2), np.int32))
    return Lists(grid, np.concatenate([*starts, np.array([filled], np.int32)]), np.concatenate(entries))


def _enter(sheet: Sheet) -> tuple[Ints, Ints, int]:
    """The begins of the lists of all cells of one sheet, their entries, and which levels hold anything."""
    if sheet.cells == (1, 1):
        order = np.argsort(sheet.near, kind="stable")
        entry = np.stack([sheet.member, sheet.near.view(np.int32)], axis=1)[order]
        return np.zeros(1, np.int32), entry, bool(len(order)) << WHOLE
    if not len(sheet.member):
        return np.zeros(1, np.int32), np.zeros((0, 2), np.int32), 0
    level, entries = _levels(sheet)
    used = [k for k in range(int(level.max()) + 1) if (level == k).any()]
    columns, rows = sheet.cells
    pitch, base = {}, {}
    total = mask = 0
    for k in reversed(used):
        pitch[k], base[k], mask = ((columns - 1) >> k) + 1, total, mask | 1 << k
        total += pitch[k] * (((rows - 1) >> k) + 1)
    # An entry is one whole number: from the top, its cell, the nearest point's measure, rounded down to the bits that
    # are left, and the sphere. Sorting those sorts the cells, and the list of each.
    index_bits = int(sheet.member[-1]).bit_length()
    near_bits = min(32, 63 - index_bits - total.bit_length())
    cut, shift = np.uint32(32 - near_bits), index_bits + near_bits
    key, filled = np.empty(entries, np.int64), 0
    for i in range(0, len(level), BLOCK):
        block = slice(i, i + BLOCK)
        low = (_ascending(sheet.near[block]) >> cut).astype(np.int64) << index_bits | sheet.member[block]
        edges = _edges(sheet.covers[:, block])
        for k in used:
            which = np.flatnonzero(level[block] == k) if len(used) > 1 else slice(None)
            left, top, right, bottom = edges[:, which] >> k
            cell = top.astype(np.int64) * pitch[k] + left + base[k]
            # First an entry for each row of cells, then one for each cell.
            rows_of = _joined(list(_spread(bottom - top, pitch[k] << shift, cell << shift | low[which], right - left)))
            for (part,) in _spread(rows_of[1], 1 << shift, rows_of[0]):
                key[filled : filled + len(part)] = part
                filled += len(part)
    key.sort()
    counts = np.zeros(total, np.int32)
    for i in range(0, entries, BLOCK):
        block_of_keys = key[i : i + BLOCK]
        cell = block_of_keys >> shift
        first = int(cell[0])
        here = np.bincount(cell - first)
        counts[first : first + len(here)] += here.astype(np.int32)
        # The measure to the upper half, which has no room for the cell, and the sphere to the lower one, in place.
        near = block_of_keys >> index_bits << int(cut) + 32
        block_of_keys &= (1 << index_bits) - 1
        block_of_keys |= _descended(near)
    start = np.cumsum(counts, dtype=np.int32) - counts
    return start, key.astype("<i8", copy=False).view("<i4").reshape(-1, 2).astype(np.int32, copy=False), mask


def _edges(covers: NDArray[np.int16]) -> NDArray[np.int16]:
    """The first column and row of each, and the last ones."""
    return np.concatenate([covers[:2], covers[:2] + covers[2:]])


def _spread(
    more: NDArray[np.int16], step: int, key: NDArray[np.int64], *others: NDArray[np.int16]
) -> Iterator[tuple[NDArray[Any], ...]]:
    """key, key + step, ..., key + more step of each, in any order, and the others, the same for all of them."""
    yield key, *others
    while len(rest := np.flatnonzero(more > 0)):  # of whole numbers it takes seven times as long
        more = more[rest] - np.int16(1)
        key, *others = (key[rest] + step, *(other[rest] for other in others))  # type: ignore[assignment]
        yield key, *others


def _ascending(x: NDArray[np.float32]) -> NDArray[np.uint32]:
    """The bits of float32 numbers, so changed that they are in the same order as whole numbers."""
    bits = x.view(np.int32)
    return (bits ^ (bits >> 31 & np.int32(0x7FFFFFFF))).view(np.uint32) ^ np.uint32(1 << 31)


def _descended(x: NDArray[np.int64]) -> NDArray[np.int64]:
    """The bits that _ascending() was given; both in the upper half, above zeros."""
    x ^= np.int64(-(2**63))
    x ^= x >> 63 & np.int64(0x7FFFFFFF << 32)
    return x


def _levels(sheet: Sheet) -> tuple[NDArray[np.int8], int]:
    """The level of each member, the finest one on which all together take few enough entries; how many those are."""
    wide, high = sheet.covers[2:]
    n, entries = len(wide), _entries(sheet.covers[2:])
    # Of very many spheres all on level 0, or each on the level that has its size: what is between takes longer to make
    # and saves nothing.
    many = n >= SPARE
    if entries <= 4.5 * n if many else entries <= 4 * n + SPARE:
        return np.zeros(n, np.int8), entries
    # An exponent: the cells of that level are as large as the disc.
    bits = np.frexp(np.maximum(wide, high).astype(np.float32))[1].astype(np.int8)
    edges = _edges(sheet.covers)
    for lift in (0,) if many else range(int(bits.max()) - 1, 0, -1):
        level = np.maximum(bits - np.int8(lift), np.int8(0))
        left_top, right_bottom = (edges[:2] >> level), (edges[2:] >> level)
        entries = _entries(right_bottom - left_top)
        if many or lift == 1 or entries <= 4 * n + SPARE:
            break
    return level, entries


def _entries(more: NDArray[np.int16]) -> int:
    """Into so many cells is entered what covers so many more columns and rows than one, (2, n)."""
    wide, high = more
    return int(((wide + np.int32(1)) * (high + np.int32(1))).sum(dtype=np.int64))


def whole_sheet(members: Mask) -> Sheet:
    """One list of spheres for all rays of any kind: what would be without lists. members: (n,), which spheres."""
    member = np.flatnonzero(members).astype(np.int32)
    none, near = np.zeros(2), np.full(len(member), -np.inf, np.float32)
    covers = np.zeros((4, len(member)), np.int16)
    return Sheet(np.zeros((3, 3)), none, none + 1, (1, 1), member, covers, near, True)


def camera_sheet(
    center: Array, radius: Array, power: Array, step: tuple[float, float], size: tuple[int, int], among: Mask
) -> Sheet:
    """The picture, in cells of 4x4 pixels. center: (n, 3) in camera space; power: (n,), |center|^2 - radius^2; step: a
    pixel's size at z = -1; among: (n,), what to enter.

    Left out is what cannot be seen: spheres behind the eye, beside the picture, or between the centres of its pixels.
    """
    real = np.float32 if min(step) > TINY else np.float64

    def see(block: slice) -> tuple[NDArray[Any], ...]:
        exact, exact_r = np.ascontiguousarray(center[block].T), radius[block]
        x, y, z = exact.astype(real)
        r, gap = exact_r.astype(real), ((exact[2] - exact_r) * (exact[2] + exact_r)).astype(real)
        covers = np.empty((4, len(r)), np.int16)
        # Not z < r: the eye may be inside by less than a centre's rounding.
        seen = (exact[2] < exact_r * (1 + SLACK)) & among[block]
        left, right, top, bottom = slopes([x, -y], -z, r, gap)
        for k, (low, high) in enumerate(((left, right), (top, bottom))):
            slack = (np.abs(low) + np.abs(high)) * real(SLACK)
            # Pixel i is at slope (2i + 1 - n) step; 1/16 of a pixel more, for what float32 cannot count in a wide
            # picture, and for pictures a few ulp wide.
            scale, middle = 0.5 / step[k], (size[k] - 1) / 2
            begin = np.clip(np.ceil((low - slack) * scale + (middle - 1 / 16)), 0, size[k])
            end = np.clip(np.floor((high + slack) * scale + (middle + 1 / 16)), -1, size[k] - 1)
            seen &= begin <= end
            first, last = begin.astype(np.int32) >> 2, end.astype(np.int32) >> 2
            covers[k], covers[2 + k] = first, last - first
        which = np.flatnonzero(seen)
        near = nearest(length(x, y, z)[which], r[which], power[block][which])
        return (block.start + which).astype(np.int32), covers.take(which, axis=1), near

    member, covers, near = _joined(blockwise(len(center), see, BLOCK))
    cells = (-(-size[0] // 4), -(-size[1] // 4))
    return Sheet(np.eye(3), np.zeros(2), np.ones(2), cells, member, covers, near, True)


def _joined(parts: list[tuple[NDArray[Any], ...]]) -> list[NDArray[Any]]:
    return [np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)]


def length(x: Reals, y: Reals, z: Reals) -> Reals:
    """|(x, y, z)|, (n,), to 2^-22 of it in float32; too much of less than 2^-60, where squares vanish."""
    return np.asarray(np.sqrt(x * x + y * y + z * z + x.dtype.type(2.0**-120)))


def nearest(distance: Reals, r: Reals, power: Array) -> NDArray[np.float32]:
    """A lower bound of the squared distance of each sphere's nearest point; -1 from inside, or all but.

    distance, r: of length() and the radius, (n,); power: distance^2 - r^2 without the rounding of that difference.
    """
    # Right to 6 units of 2^-24, and its square to 14; those of the kernel's lengths are right to 5.
    gap = power.astype(np.float32) / (distance + r)
    return np.where(gap > 2.0**-50, gap * gap * (1 - 2.0**-19), -1).astype(np.float32)


def point_sheets(offset: Array, radius: Array, power: Array, among: Mask, receiver: Mask, slack: float) -> list[Sheet]:
    """The sides of a cube around a point light. offset: (n, 3), from the light to the centres; power: (n,),
    |offset|^2 - radius^2; slack: of the kernel; among: (n,), what to enter; receiver: (n,), of those, where shadow rays
    end.
    """
    sides = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
    cube = _towards(offset)

    def look(real: type[np.floating[Any]], sides: list[tuple[int, float]], block: slice) -> list[_Discs]:
        x, y, z = np.ascontiguousarray(offset[block].T)
        exact = [row[0] * x + row[1] * y + row[2] * z for row in cube]
        f, exact_r = [axis.astype(real) for axis in exact], radius[block]
        r, distance = exact_r.astype(real), length(*f)
        near, far = nearest(distance, r, power[block]), (distance + r) ** 2 * real(1 + 2.0**-10)
        size = [np.abs(axis) for axis in f]
        # How far beyond the side of a pyramid a centre may be, whose sphere still reaches into it.
        reach = r * real(2**0.5 * (1 + SLACK)) + np.maximum(np.maximum(size[0], size[1]), size[2]) * real(SLACK)
        reach[~among[block]] = -np.inf
        found = []
        for axis, sign in sides:
            # The side of the cube is the pyramid |c| <= d, |e| <= d.
            right, up = (axis + 1) % 3, (axis + 2) % 3
            i = np.flatnonzero(np.maximum(size[right], size[up]) <= (reach + f[axis] if sign > 0 else reach - f[axis]))
            d, radii = exact[axis][i] * sign, exact_r[i]
            gap = ((d - radii) * (d + radii)).astype(real)
            edges = slopes([f[right][i], f[up][i]], d.astype(real), r[i], gap)
            member = (block.start + i).astype(np.int32)
            found.append(_Discs.of(member, edges, near[i], far[i], receiver[block][i]))
        return found

    def seen(real: type[np.floating[Any]], sides: list[tuple[int, float]]) -> list[list[_Discs]]:
        return [list(discs) for discs in zip(*blockwise(len(radius), partial(look, real, sides), BLOCK), strict=True)]

    sheets = []
    for (axis, sign), discs in zip(sides, seen(np.float32, sides), strict=True):
        axes = cube[[(axis + 1) % 3, (axis + 2) % 3, axis]] * np.array([1, 1, sign])[:, None]
        window = _window(discs, SLACK, True)
        if window is None:
            continue
        # Where the discs fill little of the cube's side, float32 would be too coarse for its cells.
        coarse = bool((window.half > NARROW / 2).all())
        if not coarse and slack < SLACK:
            (discs,) = seen(np.float64, [(axis, sign)])
            window = _window(discs, slack, True)
            if window is None:
                continue
        sheets.append(_windowed(axes, discs, window, SLACK if coarse else slack, True, coarse))
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
        return _Discs.of(member, [u - r, u + r, v - r, v + r], near, r - s + 2.0**-10, receiver[block][i])

    discs = blockwise(len(radius), look, BLOCK)
    window = _window(discs, slack, False)
    return [] if window is None else [_windowed(axes, discs, window, slack, False)]


@dataclass(frozen=True)
class _Discs:
    """Some spheres as seen on a sheet.

    member: their numbers; edges: their left, right, low and high coordinates; near: a lower bound of the measure of
    their nearest points; spans: the extreme ones of the edges of all of them, and of those where shadow rays end;
    nearest, furthest: bounds of the measure of any point where shadow rays end.
    """

    member: Ints
    edges: list[Reals]
    near: NDArray[np.float32]
    spans: list[list[float]]
    nearest: float
    furthest: float

    @staticmethod
    def of(member: Ints, edges: list[Reals], near: NDArray[np.float32], far: Reals, receiver: Mask) -> _Discs:
        """far: an upper bound of the measure of their furthest points; receiver: whether shadow rays end there."""
        ends = np.flatnonzero(receiver)
        spans = [[_extreme(k, edge[which]) for k, edge in enumerate(edges)] for which in (slice(None), ends)]
        return _Discs(
            member, edges, near, spans, float(near[ends].min(initial=np.inf)), float(far[ends].max(initial=-np.inf))
        )


def _extreme(k: int, edge: Reals) -> float:
    """The outermost one of left, right, low or high edges."""
    return float(edge.max(initial=-np.inf) if k % 2 else edge.min(initial=np.inf))


class _Window(NamedTuple):
    """What a sheet shows: its middle and half of its sides, (2,) each; furthest: where the last shadow ray ends."""

    middle: Array
    half: Array
    furthest: float


def _window(discs: list[_Discs], slack: float, perspective: bool) -> _Window | None:
    """A window as large as the discs, and as those where shadow rays end, if there are any; the side of a cube ends at
    +-1.
    """
    spans = np.array([part.spans for part in discs])
    (least, first), (most, last) = spans[:, :, ::2].min(axis=0), spans[:, :, 1::2].max(axis=0)
    if (first > last).any():
        return None
    # Where a ray ends is known to 256 slack, at 2^-8 and more from a light; nearer to one it may be seen anywhere.
    if not perspective or min(part.nearest for part in discs) > 2.0**-16:
        room = 256 * slack * (1 + np.maximum(np.abs(first), np.abs(last)))
        least, most = np.maximum(least, first - room), np.minimum(most, last + room)
        if (least > most).any():
            return None
    limit = 1 + SLACK if perspective else np.inf
    loose = slack * (1 + 2 * np.maximum(np.abs(least), np.abs(most)))
    low, high = np.maximum(least - loose, -limit), np.minimum(most + loose, limit)
    half = np.maximum((high - low) / 2, 2.0**-60) * (1 + SLACK)
    return _Window((low + high) / 2, half, max(part.furthest for part in discs))


def _windowed(
    axes: Array, discs: list[_Discs], window: _Window, slack: float, perspective: bool, coarse: bool = False
) -> Sheet:
    """The sheet of a window, with cells in its proportion."""
    members = sum(len(part.member) for part in discs)
    low, sides = window.middle - window.half, 2 * window.half
    # From 64 to a million spheres, in whatever layout, cells of 2 discs were within 5 % of the fastest. At most as
    # many as discs, and never one only: that would do without the window.
    each = [part.edges[k + 1][::SAMPLE] - part.edges[k][::SAMPLE] for part in discs for k in (0, 2)]
    cell = max(2 * float(np.median(np.concatenate(each))), np.sqrt(sides[0] * sides[1] / max(2, members)))
    cells = [int(np.clip(np.ceil(s / cell), 2, 2048)) for s in sides]

    def place(part: _Discs) -> tuple[NDArray[Any], ...]:
        # Whoever lies wholly beside the window is not met by any ray that has its number there.
        within = part.near < window.furthest
        covers = np.empty((4, len(within)), np.int16)
        for k, (begin, end) in enumerate((part.edges[:2], part.edges[2:])):
            loose = slack * (1 + np.abs(begin) + np.abs(end))
            begin, end = begin - loose, end + loose
            first, scale = float(low[k]), cells[k] / float(sides[k])
            within &= (end >= first) & (begin <= first + float(sides[k]))
            # A 64th of a cell more: the kernel's float32 cell number may be off by that.
            covers[k] = np.clip((begin - first) * scale - 1 / 64, 0, cells[k] - 1)
            covers[2 + k] = np.clip((end - first) * scale + 1 / 64, 0, cells[k] - 1)
            covers[2 + k] -= covers[k]
        which = np.flatnonzero(within)
        return part.member[which], covers.take(which, axis=1), part.near[which]

    member, covers, near = _joined(concurrently([partial(place, part) for part in discs]))
    columns, rows = cells
    return Sheet(axes, window.middle, window.half, (columns, rows), member, covers, near, perspective, coarse)
