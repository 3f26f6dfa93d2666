"""Light buffers: the directions from a light in cells, each with the spheres that can stop a shadow ray there.

A point light has the sides of a cube around it (Haines and Greenberg 1986), as far as there is anything to be seen
there; a parallel light has the plane across it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.accel.cells import BLOCK, SLACK, CellGrid, Ints, Mask, joined
from cltrace.plan.exact import Array, blockwise, concurrently, rounded_down
from cltrace.plan.shapes.sphere import Reals, Seen, length, nearest, slopes

# What SLACK is for float32, for double.
FINE_SLACK = 2.0**-44
# A window at least so wide has no cell (see _on_window) below 2^-15, 32 times SLACK.
NARROW = 2.0**-4
# The size of one in so many discs is enough to know that of most.
SAMPLE = 16


class Shadows(NamedTuple):
    """Who takes part in shadows. occluder (n,): which spheres to enter; receiver (n,): of those, where shadow rays end;
    slack: SLACK or FINE_SLACK, by what the kernel decides in.
    """

    occluder: Mask
    receiver: Mask
    slack: float


def point_buffer(seen: Seen, who: Shadows) -> list[CellGrid]:
    """The grids of a light at a point, up to six. seen: from the light, along the camera's axes."""
    sides = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
    cube = _towards(seen.center)

    def look(real: type[np.floating[Any]], sides: list[tuple[int, float]], block: slice) -> list[_Discs]:
        x, y, z = np.ascontiguousarray(seen.center[block].T)
        exact = [row[0] * x + row[1] * y + row[2] * z for row in cube]
        f, exact_r = [axis.astype(real) for axis in exact], seen.radius[block]
        r, distance = exact_r.astype(real), length(*f)
        near, far = nearest(distance, r, seen.power[block]), (distance + r) ** 2 * real(1 + 2.0**-10)
        size = [np.abs(axis) for axis in f]
        # How far beyond the side of a pyramid a centre may be, whose sphere still reaches into it.
        reach = r * real(2**0.5 * (1 + SLACK)) + np.maximum(np.maximum(size[0], size[1]), size[2]) * real(SLACK)
        reach[~who.occluder[block]] = -np.inf
        found = []
        for axis, sign in sides:
            # The side of the cube is the pyramid |c| <= d, |e| <= d.
            right, up = (axis + 1) % 3, (axis + 2) % 3
            i = np.flatnonzero(np.maximum(size[right], size[up]) <= (reach + f[axis] if sign > 0 else reach - f[axis]))
            d, radii = exact[axis][i] * sign, exact_r[i]
            gap = ((d - radii) * (d + radii)).astype(real)
            edges = slopes([f[right][i], f[up][i]], d.astype(real), r[i], gap)
            member = (block.start + i).astype(np.int32)
            found.append(_Discs.of(member, edges, near[i], far[i], who.receiver[block][i]))
        return found

    def discs_of(real: type[np.floating[Any]], sides: list[tuple[int, float]]) -> list[list[_Discs]]:
        return [
            list(discs) for discs in zip(*blockwise(len(seen.radius), partial(look, real, sides), BLOCK), strict=True)
        ]

    grids = []
    for (axis, sign), discs in zip(sides, discs_of(np.float32, sides), strict=True):
        axes = cube[[(axis + 1) % 3, (axis + 2) % 3, axis]] * np.array([1, 1, sign])[:, None]
        window = _window(discs, SLACK, True)
        if window is None:
            continue
        # Where the discs fill little of the cube's side, float32 would be too coarse for its cells.
        coarse = bool((window.half > NARROW / 2).all())
        if not coarse and who.slack < SLACK:
            (discs,) = discs_of(np.float64, [(axis, sign)])
            window = _window(discs, who.slack, True)
            if window is None:
                continue
        grids.append(_on_window(axes, discs, window, SLACK if coarse else who.slack, coarse))
    return grids


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


def parallel_buffer(axes: Array, seen: Seen, who: Shadows) -> list[CellGrid]:
    """The grid of a parallel light, if there is any. axes: (3, 3), the two across and the one towards the light."""

    def look(block: slice) -> _Discs:
        i = np.flatnonzero(who.occluder[block])
        c, r = seen.center[block][i], seen.radius[block][i]
        u, v, s = (c @ axis for axis in axes)
        near = rounded_down(-(s + r) - SLACK * (np.abs(s) + r) - 2.0**-100)
        member = (block.start + i).astype(np.int32)
        return _Discs.of(member, [u - r, u + r, v - r, v + r], near, r - s + 2.0**-10, who.receiver[block][i])

    discs = blockwise(len(seen.radius), look, BLOCK)
    window = _window(discs, who.slack, False)
    return [] if window is None else [_on_window(axes, discs, window, who.slack, None)]


@dataclass(frozen=True)
class _Discs:
    """Some spheres as seen on a grid.

    member: their indices; edges: their left, right, low and high coordinates; near: a lower bound of the depth of
    their nearest points; spans: the extreme ones of the edges of all of them, and of those where shadow rays end;
    nearest, furthest: bounds of the depth of any point where shadow rays end.
    """

    member: Ints
    edges: list[Reals]
    near: NDArray[np.float32]
    spans: list[list[float]]
    nearest: float
    furthest: float

    @staticmethod
    def of(member: Ints, edges: list[Reals], near: NDArray[np.float32], far: Reals, receiver: Mask) -> _Discs:
        """far: an upper bound of the depth of their furthest points; receiver: whether shadow rays end there."""
        ends = np.flatnonzero(receiver)
        spans = [[_extreme(k, edge[which]) for k, edge in enumerate(edges)] for which in (slice(None), ends)]
        return _Discs(
            member, edges, near, spans, float(near[ends].min(initial=np.inf)), float(far[ends].max(initial=-np.inf))
        )


def _extreme(k: int, edge: Reals) -> float:
    """The outermost one of left, right, low or high edges."""
    return float(edge.max(initial=-np.inf) if k % 2 else edge.min(initial=np.inf))


class _Window(NamedTuple):
    """What a grid shows: its middle and half of its sides, (2,) each; furthest: where the last shadow ray ends."""

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


def _on_window(axes: Array, discs: list[_Discs], window: _Window, slack: float, coarse: bool | None) -> CellGrid:
    """The grid of a window, with cells in its proportion. coarse: None for a parallel light."""
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

    member, covers, near = joined(concurrently([partial(place, part) for part in discs]))
    columns, rows = cells
    perspective = coarse is not None
    return CellGrid(axes, window.middle, window.half, (columns, rows), member, covers, near, perspective, bool(coarse))
