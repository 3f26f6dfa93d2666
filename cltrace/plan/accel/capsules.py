"""Cylinders as seen from a fixed point or along a fixed direction: what holds the two spheres around their ends.

A cylinder is within its capsule, the convex hull of the spheres of its radius around the middles of its ends. Seen from
a point that has both spheres ahead of it, the capsule is the convex hull of two ellipses, and so within the hull of the
two rectangles around these: see _hexagons(). Where one of the spheres is not clear of the plane through the point, what
is seen may be anywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.plan.accel.cells import AT_ONCE, SLACK
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

    def member(self, which: NDArray[np.intp], block: slice) -> Ints:
        """The indices of some of a block as surfaces."""
        return np.asarray(which + (self.first + block.start), np.int32)

    def nearest(self, block: slice) -> Array:
        """(n,): how far the capsules are from the point, 0 from inside."""
        a, b = self.start[block], self.end[block]
        u = b - a
        uu = (u * u).sum(axis=1)
        k = np.clip(-(a * u).sum(axis=1) / np.where(uu > 0, uu, 1), 0, 1)
        return np.asarray(np.maximum(length(*(a + k[:, None] * u).T) * (1 - 2.0**-40) - self.radius[block], 0))

    def in_picture(self, among: Mask, window: Window, real: Real, use: Callable[[Pictured], T]) -> tuple[list[T], None]:
        found: list[T] = []

        def see(block: slice) -> None:
            rims, ahead, near = (self._along_view if window.parallel else self._from_eye)(block)
            ahead &= self.of(among, block)
            clear = np.isfinite(rims).all(axis=(0, 1))
            for part in (clear, ~clear):
                which = np.flatnonzero(part)
                if len(which):
                    found.append(use(self._pictured(block, which, rims, ahead, near, window)))

        blockwise(len(self), see, AT_ONCE)
        return found, None

    def _pictured(
        self, block: slice, which: NDArray[np.intp], rims: Array, ahead: Mask, near: NDArray[np.float32], window: Window
    ) -> Pictured:
        """Some of a block. rims: (2, 4, n), left, right, low and high of both ends, as slopes or places."""
        some = rims[:, :, which]
        edges = np.stack(_around(some))
        pixels = [
            (edges[2 * k] * axis.scale + axis.begin, edges[2 * k + 1] * axis.scale + axis.end)
            for k, axis in enumerate(window.axes)
        ]
        corner, off = None, 1 / 64 + window.spread
        if np.isfinite(edges).all():
            corner = _hexagons(some)
            for k, (axis, size) in enumerate(zip(window.axes, window.size, strict=True)):
                corner[k] = corner[k] * axis.scale + (size - 1) / 2
        chosen = near[which]
        return Pictured(self.member(which, block), ahead[which], pixels, chosen.take, corner, np.asarray(off))

    def _from_eye(self, block: slice) -> tuple[Array, Mask, NDArray[np.float32]]:
        """As slopes; depths are squared distances."""
        r, rims, ahead = self.radius[block], [], np.zeros(len(self.radius[block]), bool)
        for end in (self.start, self.end):
            x, y, z = end[block].T
            ahead |= z < r * (1 + SLACK)
            rims.append(_widened(slopes([x, -y], -z, r, (z - r) * (z + r))))
        return np.stack(rims), ahead, _squared(self.nearest(block))

    def _along_view(self, block: slice) -> tuple[Array, Mask, NDArray[np.float32]]:
        """As places on the plane where parallel rays start; depths are distances from there, if it is ahead."""
        r, rims = self.radius[block], []
        for end in (self.start, self.end):
            x, y, _ = end[block].T
            rims.append(_widened([x - r, x + r, -y - r, r - y], LOOSE))
        z = np.maximum(self.start[block, 2], self.end[block, 2])
        least = np.minimum(self.start[block, 2], self.end[block, 2]) - r
        size = np.abs(z) + r
        return np.stack(rims), least < SLACK * r + LOOSE, rounded_down(-(z + r) - SLACK * size - LOOSE)

    def on_sides(self, cube: Cube, who: Shadows) -> list[list[Part]]:
        found: list[list[Part]] = [[] for _ in cube.sides]

        def see(block: slice) -> None:
            ends = [along(cube.axes, end[block]) for end in (self.start, self.end)]
            r, near = self.radius[block], self.nearest(block)
            far = np.maximum(*(length(*end) for end in ends)) + r
            depths, occluder = (_squared(near), far * far * (1 + 2.0**-10)), self.of(who.occluder, block)
            for parts, (axis, sign) in zip(found, cube.sides, strict=True):
                which, rims = _through(ends, r, axis, sign)
                kept = occluder[which]
                which, rims = which[kept], rims[:, :, kept]
                clear = np.isfinite(rims).all(axis=(0, 1))
                for part in (clear, ~clear):
                    some = which[part]
                    if len(some):
                        member, shown = self.member(some, block), (depths[0][some], depths[1][some])
                        parts.append(_cast(member, rims[:, :, part], shown, who))

        blockwise(len(self), see, AT_ONCE)
        return found

    def across(self, axes: Array, who: Shadows, real: Real) -> list[Cast]:
        def look(block: slice) -> Cast:
            which = np.flatnonzero(self.of(who.occluder, block))
            r = self.radius[block][which]
            ends = [along(axes, end[block][which]) for end in (self.start, self.end)]
            rims = np.stack([np.stack([u - r, u + r, v - r, v + r]) for u, v, _ in ends])
            high, low = np.maximum(ends[0][2], ends[1][2]) + r, np.minimum(ends[0][2], ends[1][2]) - r
            near = rounded_down(-high - SLACK * np.abs(high) - who.slack)
            return _cast(self.member(which, block), rims, (near, 2.0**-10 - low), who)

        return blockwise(len(self), look, AT_ONCE)


def _widened(edges: list[Reals], loose: float = 0.0) -> Array:
    """(4, n): left, right, low and high of discs, in double, with what these may be off by."""
    out = np.empty((4, len(edges[0])))
    for k in (0, 2):
        slack = (np.abs(edges[k]) + np.abs(edges[k + 1])) * FINE_SLACK + loose
        out[k], out[k + 1] = edges[k] - slack, edges[k + 1] + slack
    return out


def _squared(near: Array) -> NDArray[np.float32]:
    """(n,): lower bounds of squared distances, -1 of 0, or all but."""
    return np.where(near > 2.0**-50, rounded_down(near * near * (1 - 2.0**-19)), -1).astype(np.float32)


def _through(ends: list[list[Array]], r: Array, axis: int, sign: float) -> tuple[NDArray[np.intp], Array]:
    """Which capsules are seen through a side of a cube, and the edges of both ends' discs there, (2, 4, n).

    ends: of both, three coordinates along the cube's axes. What is seen is the pyramid |c| <= d, |e| <= d, with d along
    the side's axis: a capsule that has both spheres beyond one of its four planes is beside it.
    """
    right, up = (axis + 1) % 3, (axis + 2) % 3
    beside = np.zeros(len(r), bool)
    for c in (right, up):
        for turn in (1.0, -1.0):
            beyond = [
                turn * end[c] - sign * end[axis]
                > r * (2**0.5 * (1 + SLACK)) + SLACK * (np.abs(end[c]) + np.abs(end[axis]))
                for end in ends
            ]
            beside |= beyond[0] & beyond[1]
    which = np.flatnonzero(~beside)
    rims = []
    for end in ends:
        d, radii = end[axis][which] * sign, r[which]
        rims.append(_widened(slopes([end[right][which], end[up][which]], d, radii, (d - radii) * (d + radii))))
    return which, np.stack(rims)


def _cast(member: Ints, rims: Array, depths: tuple[NDArray[np.float32], Array], who: Shadows) -> Cast:
    """rims: (2, 4, n), all of them finite, or none as a whole."""
    edges = _around(rims)
    if not np.isfinite(rims).all():
        return Cast.of(member, edges, depths, who)
    return Cast.of(member, edges, depths, who, _hexagons(rims), np.zeros(()))


def _around(rims: Array) -> list[Array]:
    """Left, right, low and high of what is around two rectangles each. rims: (2, 4, n)."""
    a, b = rims
    return [np.minimum(a[0], b[0]), np.maximum(a[1], b[1]), np.minimum(a[2], b[2]), np.maximum(a[3], b[3])]


def _hexagons(rims: Array) -> Array:
    """(2, 6, n): the corners of hexagons around two rectangles each. rims: (2, 4, n), left, right, low, high of both.

    Let A be the rectangle whose middle is further left, and let B be higher, else all is turned upside down. The
    rectangle around both has A at its left and low sides and B at the others, unless one of the two is much larger.
    Then no part of either is beyond the line from the low right corner of A to that of B, and none beyond the line
    between the high left corners: the two other corners of the rectangle around both are cut off there.
    """
    swap = rims[0, 0] + rims[0, 1] > rims[1, 0] + rims[1, 1]
    A, B = np.where(swap, rims[1], rims[0]), np.where(swap, rims[0], rims[1])
    turn = np.where(A[2] + A[3] > B[2] + B[3], -1.0, 1.0)
    low, high = (np.where(turn > 0, [a[2], a[3]], [-a[3], -a[2]]) for a in (A, B))
    (a0, a1), (b0, b1) = low, high
    left, right = np.minimum(A[0], B[0]), np.maximum(A[1], B[1])
    bottom, top = np.minimum(a0, b0), np.maximum(a1, b1)
    below, above = (A[1] <= B[1]) & (a0 <= b0), (A[0] <= B[0]) & (a1 <= b1)
    x = np.stack([
        left, np.where(below, A[1], right), right, right, np.where(above, B[0], left), left
    ])  # fmt: skip
    y = np.stack([
        bottom, bottom, np.where(below, b0, bottom), top, top, np.where(above, a1, top)
    ])  # fmt: skip
    return np.stack([x, turn * y])
