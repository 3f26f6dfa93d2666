"""Cylinders as seen from a fixed point or along a fixed direction: what holds the two spheres around their ends.

A cylinder is within its capsule, the convex hull of the spheres of its radius around the middles of its ends. Seen from
a point that has both spheres ahead of it, the capsule is the convex hull of two ellipses, and so within the hull of the
two rectangles around these: see _hexagons(). Where one of the spheres is not clear of the plane through the point, what
is seen may be anywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.plan.accel.cells import SLACK
from cltrace.plan.accel.discs import length, slopes
from cltrace.plan.accel.silhouettes import (
    FINE_SLACK,
    LOOSE,
    Cast,
    Cube,
    Part,
    Pictured,
    Real,
    Reals,
    Shadows,
    Silhouettes,
    T,
    Window,
)
from cltrace.plan.rounding import Array, Ints, Mask, along, rounded_down

# Left, right, low and high of the discs that both ends of capsules are, (n,) each.
Rims = list[list[Reals]]
# In a light's lists. To try a cylinder takes longer than a triangle: with 100,000 balls and bonds, a frame takes 0.8 of
# what it takes with the entries of triangles, under a sky of 64 directions half of it, and first pictures as long.
ENTRIES = 3.0


@dataclass(frozen=True)
class Capsules(Silhouettes):
    """n cylinders as seen from a point, or, by parallel light, from the eye: Silhouettes.

    start, end: (n, 3), from there to the middles of their ends, in the float buffers' unit; radius: (n,); first: the
    index of the first one as a surface; idle: (n,), those that count for nothing, None for none.
    """

    start: Array
    end: Array
    radius: Array
    first: int
    idle: Mask | None = None

    has_corners = True

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def points(self) -> Array:
        return np.concatenate([self.start, self.end])

    @property
    def met(self) -> Mask:
        return np.ones(len(self), bool) if self.idle is None else ~self.idle

    def of(self, mask: Mask, block: slice) -> Mask:
        """What a mask of all surfaces says of a block of them."""
        return mask[self.first + block.start : self.first + block.stop]

    def member(self, block: slice) -> Ints:
        """The indices of a block as surfaces."""
        return np.arange(self.first + block.start, self.first + block.stop, dtype=np.int32)

    def nearest(self, block: slice) -> Array:
        """(n,): how far the capsules are from the point, 0 from inside."""
        a, b = _columns(self.start[block]), _columns(self.end[block])
        u = b - a
        uu = (u * u).sum(axis=0)
        k = np.clip(-(a * u).sum(axis=0) / np.where(uu > 0, uu, 1), 0, 1)
        # a + k u takes four roundings of each coordinate, and k seven and a division, which move the point along u.
        off = 2.0**-48 * (np.abs(a) + np.abs(b)).sum(axis=0)
        return np.asarray(np.maximum(length(*(a + k * u)) * (1 - 2.0**-40) - off - self.radius[block], 0))

    def in_picture(self, among: Mask, window: Window, real: Real, use: Callable[[Pictured], T]) -> tuple[list[T], None]:
        slack, off = real(SLACK if real is np.float32 else FINE_SLACK), np.asarray(1 / 64 + window.spread)
        look = self._along_view if window.parallel else self._from_eye

        def loosened(edges: list[Reals]) -> list[Reals]:
            for low, high in (edges[:2], edges[2:]):
                loose = (np.abs(low) + np.abs(high)) * slack + real(LOOSE if window.parallel else 0)
                low -= loose
                high += loose
            return edges

        def see(block: slice) -> T:
            rims, ahead, near = look(block, window, real)

            def corner(which: NDArray[np.intp]) -> Reals:
                found = _hexagons([loosened([edge.take(which) for edge in rim]) for rim in rims])
                for c, axis, size in zip(found, window.axes, window.size, strict=True):
                    c *= axis.scale
                    c += (size - 1) / 2
                return found

            edges = loosened(_around(rims))
            pixels = [
                (edges[2 * k] * axis.scale + axis.begin, edges[2 * k + 1] * axis.scale + axis.end)
                for k, axis in enumerate(window.axes)
            ]
            wanted = ahead & self.of(among, block)
            return use(Pictured(self.member(block), wanted, pixels, near.take, corner, off))

        return blockwise(len(self), see), None

    def _from_eye(self, block: slice, window: Window, real: Real) -> tuple[Rims, Mask, NDArray[np.float32]]:
        """As slopes; depths are squared distances."""
        most = [(size + 1) * step for size, step in zip(window.size, window.step, strict=True)]
        r, rims, ahead = self.radius[block], [], np.zeros(len(self.radius[block]), bool)
        for end in (self.start, self.end):
            x, y, z = _columns(end[block])
            ahead |= z < r * (1 + SLACK)
            gap, across = ((z - r) * (z + r)).astype(real), [x.astype(real), -y.astype(real)]
            rims.append(_ended(slopes(across, -z.astype(real), r.astype(real), gap), most))
        return rims, ahead, _squared(self.nearest(block))

    def _along_view(self, block: slice, _: Window, real: Real) -> tuple[Rims, Mask, NDArray[np.float32]]:
        """As places on the plane where parallel rays start; depths are distances from there, if it is ahead."""
        r, rims = self.radius[block], []
        for end in (self.start, self.end):
            x, y, radius = (c.astype(real) for c in (*end[block, :2].T, r))
            rims.append([x - radius, x + radius, -y - radius, radius - y])
        z = np.maximum(self.start[block, 2], self.end[block, 2])
        least = np.minimum(self.start[block, 2], self.end[block, 2]) - r
        size = np.abs(z) + r
        return rims, least < SLACK * r + LOOSE, rounded_down(-(z + r) - SLACK * size - LOOSE)

    def on_sides(self, cube: Cube, who: Shadows) -> list[list[Part]]:
        found = blockwise(len(self), lambda block: self._on_sides(cube, who, block))
        return [list(parts) for parts in zip(*found, strict=True)]

    def _on_sides(self, cube: Cube, who: Shadows, block: slice) -> list[Cast]:
        """A block of them, one Cast for each side of a cube."""
        real, r, occluder = cube.real, self.radius[block], self.of(who.occluder, block)
        exact = [along(cube.axes, end[block]) for end in (self.start, self.end)]
        ends, radius = [[c.astype(real) for c in end] for end in exact], r.astype(real)
        far = (np.maximum(*(length(*end) for end in ends)) + radius) ** 2 * real(1 + 2.0**-10)
        near, beside, found = _squared(self.nearest(block)), _beside(ends, radius), []
        for axis, sign in cube.sides:
            i = np.flatnonzero(occluder & ~beside[axis, sign])
            right, up, rims = (axis + 1) % 3, (axis + 2) % 3, []
            for fine, end in zip(exact, ends, strict=True):
                d, radii = fine[axis].take(i) * sign, r.take(i)
                gap = ((d - radii) * (d + radii)).astype(real)
                edges = slopes([end[right].take(i), end[up].take(i)], d.astype(real), radius.take(i), gap)
                rims.append(_ended(edges, (2.0, 2.0)))  # no window ends there
            found.append(_cast(self.member(block).take(i), rims, (near.take(i), far.take(i)), who))
        return found

    def across(self, axes: Array, who: Shadows, real: Real) -> list[Cast]:
        def look(block: slice) -> Cast:
            which = np.flatnonzero(self.of(who.occluder, block))
            r = self.radius[block][which]
            ends = [along(axes, end[block][which]) for end in (self.start, self.end)]
            rims = [[u - r, u + r, v - r, v + r] for u, v, _ in ends]
            high, low = np.maximum(ends[0][2], ends[1][2]) + r, np.minimum(ends[0][2], ends[1][2]) - r
            near = rounded_down(-high - SLACK * np.abs(high) - who.slack)
            return _cast(self.member(block).take(which), rims, (near, 2.0**-10 - low), who)

        return blockwise(len(self), look)


def _columns(v: Array) -> Array:
    """The coordinates of vectors (n, 3), each one in a row: (3, n)."""
    return np.ascontiguousarray(v.T)


def _squared(near: Array) -> NDArray[np.float32]:
    """(n,): lower bounds of squared distances, -1 of 0, or all but."""
    # 2^-19 is 32 roundings, of which this takes two, and the kernel's squares five.
    return np.where(near > 2.0**-50, near * near * (1 - 2.0**-19), -1).astype(np.float32)


def _beside(ends: list[list[Reals]], r: Reals) -> dict[tuple[int, float], Mask]:
    """Which capsules are not seen through a side of a cube, by its axis and sign. ends: along the cube's axes.

    What is seen is the pyramid |c| <= d, |e| <= d, with d along the side's axis: a capsule that has both spheres beyond
    one of its four planes is beside it.
    """
    real = r.dtype.type
    size = np.maximum.reduce([np.abs(c) for end in ends for c in end])
    reach = real(2**0.5 * (1 + SLACK)) * r + size * real(4 * SLACK)
    beside = {(axis, sign): np.zeros(len(r), bool) for axis in range(3) for sign in (1.0, -1.0)}
    for a, b in ((0, 1), (1, 2), (2, 0)):
        less, more = [end[a] - end[b] for end in ends], [end[a] + end[b] for end in ends]
        for sign, inner in ((1.0, np.minimum), (-1.0, np.maximum)):
            # Beyond a - b = 0 is what is beside the sides to b and to -a, beyond a + b = 0 those to -a and to -b.
            for plane, sides in ((less, ((b, sign), (a, -sign))), (more, ((a, -sign), (b, -sign)))):
                beyond = inner(*plane) * real(sign) > reach
                for side in sides:
                    beside[side] |= beyond
    return beside


def _cast(member: Ints, rims: Rims, depths: tuple[NDArray[np.float32], Reals], who: Shadows) -> Cast:
    def corner(which: NDArray[np.intp]) -> Reals:
        return _hexagons([[edge.take(which) for edge in rim] for rim in rims])

    return Cast.of(member, _around(rims), depths, who, corner, np.zeros(()), ENTRIES)


def _ended(rim: list[Reals], most: Sequence[float]) -> list[Reals]:
    """A disc's edges; infinite ones are put just outside of the window. most: where, across and up."""
    return [np.where(np.isinf(edge), np.copysign(edge.dtype.type(most[k // 2]), edge), edge)
            for k, edge in enumerate(rim)]  # fmt: skip


def _around(rims: Rims) -> list[Reals]:
    """Left, right, low and high of what is around both discs."""
    return [(np.maximum if k % 2 else np.minimum)(*edges) for k, edges in enumerate(zip(*rims, strict=True))]


def _hexagons(rims: Rims) -> Reals:
    """(2, 6, n): the corners of hexagons around two rectangles each.

    Let A be the rectangle whose middle is further left, and let B be higher, else all is turned upside down. The
    rectangle around both has A at its left and low sides and B at the others, unless one of the two is much larger.
    Then no part of either is beyond the line from the low right corner of A to that of B, and none beyond the line
    between the high left corners: the two other corners of the rectangle around both are cut off there.
    """
    (A, B), swap = rims, rims[0][0] + rims[0][1] > rims[1][0] + rims[1][1]
    A, B = ([np.where(swap, *pair) for pair in zip(*two, strict=True)] for two in ((B, A), (A, B)))
    turn = A[2] + A[3] > B[2] + B[3]
    (a0, a1), (b0, b1) = ((np.where(turn, -e[3], e[2]), np.where(turn, -e[2], e[3])) for e in (A, B))
    left, right = np.minimum(A[0], B[0]), np.maximum(A[1], B[1])
    bottom, top = np.minimum(a0, b0), np.maximum(a1, b1)
    below, above = (A[1] <= B[1]) & (a0 <= b0), (A[0] <= B[0]) & (a1 <= b1)
    corner = np.stack([
        np.stack([left, np.where(below, A[1], right), right, right, np.where(above, B[0], left), left]),
        np.stack([bottom, bottom, np.where(below, b0, bottom), top, top, np.where(above, a1, top)]),
    ])  # fmt: skip
    np.negative(corner[1], out=corner[1], where=turn)
    return corner
