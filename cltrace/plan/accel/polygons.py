"""Triangles as seen from a fixed point or along a fixed direction: polygons on a plane, and how near their points are.

A triangle seen from a point is a convex polygon on the image plane, or on a side of a light's cube. Most have their
three corners ahead and not far out of the window that is looked through: those are three divisions. The others are
first clipped to a pyramid GUARD times as wide as the window, by its planes through the point (Sutherland and Hodgman
1974), so that no number is divided by about zero, and have up to seven corners then.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.plan.abi import CONSTANTS
from cltrace.plan.accel.cells import AT_ONCE, SLACK, Held, Place
from cltrace.plan.accel.silhouettes import (
    FINE_SLACK,
    LOOSE,
    Cast,
    Cube,
    Elsewhere,
    Pane,
    Part,
    Pictured,
    Real,
    Reals,
    Shadows,
    Silhouettes,
    T,
    Window,
)
from cltrace.plan.rounding import Array, Mask, along, rounded_down

# So many times as wide and high as the window is the pyramid in which corners are divided by their depth.
GUARD = 2.0
# A corner, in double, is right to this share of its distance: it was subtracted and turned, twice at most.
TURNED = 2.0**-46
# Nearer corners are too near for float32's squares.
CLOSE = 2.0**-40

OUTSIDE, BEYOND = 15, 16
# In a light's lists. Triangles take longer to enter than to try, and few of them may have many entries: for five meshes
# of 1,000 to 100,000, twice as many or half as many change little.
ENTRIES = 1.6


@dataclass(frozen=True)
class Polygons(Silhouettes):
    """m triangles as seen from a point, or, along a parallel light, from the eye: Silhouettes.

    vertex: (v, 3), from there along the camera's axes, in the float buffers' unit; face: (m, 3), three vertices each;
    first: the index of the first triangle as a surface; side: (m,), 1 or -1 where the corners are seen one way round or
    the other, 0 where no ray from there can meet the triangle; sight: what sees most of them elsewhere, None for
    nothing; which: (m,), their numbers, if they are some of all triangles, else None.
    """

    vertex: Array
    face: NDArray[np.int32]
    first: int
    side: NDArray[np.int8]
    sight: Sight | None = None
    which: NDArray[np.int32] | None = None

    has_corners = True

    @property
    def points(self) -> Array:
        return self.vertex

    @property
    def met(self) -> Mask:
        return np.not_equal(self.side, 0)

    def primitives(self, triangle: NDArray[np.int32]) -> NDArray[np.int32]:
        """The indices of some of the triangles as surfaces."""
        return (triangle if self.which is None else self.which[triangle]) + np.int32(self.first)

    def of(self, mask: Mask) -> Mask:
        """(m,): what a mask of all surfaces says of the triangles."""
        return mask[self.first : self.first + len(self.face)] if self.which is None else mask[self.first + self.which]

    def some(self, which: NDArray[np.int32]) -> Polygons:
        """Only these triangles, and their vertices."""
        vertex, corner = np.unique(self.face[which], return_inverse=True)
        face = corner.reshape(-1, 3).astype(np.int32)
        return Polygons(self.vertex[vertex], face, self.first, self.side[which], None, which)

    def in_picture(
        self, among: Mask, window: Window, real: Real, use: Callable[[Pictured], T]
    ) -> tuple[list[T], Held | None]:
        if window.parallel:
            return self._along_view(among, window, use), None
        (pane, loose), rest, held = _pane(window), self, None
        if self.sight and real is np.float32 and max(window.size) > CONSTANTS["TILE"]:
            # The picture is the side of a cube to which the last one of its axes leads.
            asked, off = self.of(among), float(np.float32(loose))
            (shown,) = self.sight.see(np.diag([1.0, -1.0, -1.0]), [4], pane, among=asked, receiver=asked)
            x, y = ((float(axis.first), float(axis.stop)) for axis in window.axes)
            held = shown.on(Place((x, y), off, off, pixels=CONSTANTS["TILE"])) if shown.members else None
            rest = self.some(shown.rest)
        x, y, z = rest.vertex.T

        def enter(part: Projections) -> T:
            off = (loose + part.loose).astype(part.edges[0].dtype)
            pixels = [(part.edges[k] - off, part.edges[k + 1] + off) for k in (0, 2)]
            member, every = rest.primitives(part.triangle), np.ones(len(part.triangle), bool)
            return use(Pictured(member, every, pixels, part.near.take, partial(part.corner.take, axis=2), off))

        return projections(Turned((x, y, z), (1, -1, -1)), rest.face, rest.of(among), pane, real, enter), held

    def _along_view(self, among: Mask, window: Window, use: Callable[[Pictured], T]) -> list[T]:
        """The same for parallel rays, in double."""
        x, y, z = self.vertex.T
        # A pixel's coordinates are its column and row.
        places = [
            c * axis.scale + (size - 1) / 2 for c, axis, size in zip((x, -y), window.axes, window.size, strict=True)
        ]
        off, asked = 1 / 64 + window.spread + LOOSE * max(axis.scale for axis in window.axes), self.of(among)

        def see(block: slice) -> T:
            face = self.face[block].T
            corner = np.stack([[place[which] for which in face] for place in places])
            depth = np.stack([z[which] for which in face])
            pixels = []
            for values in corner:
                loose = off + FINE_SLACK * np.abs(values).max(axis=0)
                pixels.append((values.min(axis=0) - loose, values.max(axis=0) + loose))
            most = depth.max(axis=0)
            near = rounded_down(-most - SLACK * np.abs(most) - LOOSE)
            member = self.primitives(np.arange(block.start, block.stop, dtype=np.int32))
            ahead = asked[block] & (depth.min(axis=0) < LOOSE)
            return use(Pictured(member, ahead, pixels, near.take, partial(corner.take, axis=2), np.asarray(off)))

        return blockwise(len(self.face), see)

    def on_sides(self, cube: Cube, who: Shadows) -> list[list[Part]]:
        if not self.sight or cube.real is not np.float32:
            vertex = _turned(cube.axes, self.vertex)
            return [[*self._on_side(vertex, side, cube, who)] for side in cube.sides]
        numbers = [2 * axis + (sign < 0) for axis, sign in cube.sides]
        shown = self.sight.see(
            cube.axes, numbers, cube.pane, among=self.of(who.occluder), receiver=self.of(who.receiver)
        )
        found: list[list[Part]] = []
        for side, part in zip(cube.sides, shown, strict=True):
            rest = self.some(part.rest)
            there = [part] if part.members else []
            found.append([*there, *rest._on_side(_turned(cube.axes, rest.vertex), side, cube, who)])
        return found

    def _on_side(self, vertex: Array, side: tuple[int, float], cube: Cube, who: Shadows) -> list[Cast]:
        """Those that are seen through a side of the cube, or through a part of it.

        vertex: (3, v), along the cube's axes.
        """
        axis, sign = side
        turned = Turned((vertex[(axis + 1) % 3], vertex[(axis + 2) % 3], vertex[axis]), (1, 1, sign))

        def place(part: Projections) -> Cast:
            member = self.primitives(part.triangle)
            loose = part.loose + off_by(cube.pane)
            edges = [edge - loose if k % 2 == 0 else edge + loose for k, edge in enumerate(part.edges)]
            return Cast.of(member, edges, (part.near, part.far), who, partial(part.corner.take, axis=2), loose, ENTRIES)

        return projections(turned, self.face, self.of(who.occluder), cube.pane, cube.real, place)

    def across(self, axes: Array, who: Shadows, real: Real) -> Sequence[Part]:
        # No coordinate exceeds sqrt(3), so places in float32 are off by 2^-24, and FINE_SLACK. The kernel's depths and
        # what is subtracted from them are, too, which is less than pane.along; in single, who.slack is.
        asked, pane = self.of(who.occluder), Pane((0, 0), (1, 1), along=2.0**-22 + who.slack)
        if self.sight and real is np.float32:
            shown = self.sight.see(axes, [4], pane, among=asked, receiver=self.of(who.receiver))
            return [part for part in shown if part.members]
        places, loose = _turned(axes, self.vertex).astype(real), np.asarray(off_by(pane) if real is np.float32 else 0.0)

        def look(block: slice) -> Cast:
            which = np.flatnonzero(asked[block])
            triangle, member = self.face[block][which].T, self.primitives((which + block.start).astype(np.int32))
            corner = np.stack([[axis[k] for k in triangle] for axis in places])
            least, most = corner[2].min(axis=0), corner[2].max(axis=0)
            depths = rounded_down(-most - real(pane.along)), real(2.0**-10) - least
            ends = [(values.min(axis=0) - loose, values.max(axis=0) + loose) for values in corner[:2]]
            edges = [*ends[0], *ends[1]]
            return Cast.of(member, edges, depths, who, partial(corner[:2].take, axis=2), loose, ENTRIES)

        return blockwise(len(self.face), look, AT_ONCE)


def _pane(window: Window) -> tuple[Pane, float]:
    """What is seen through the window, in pixels, and by how many of them a corner or a ray may be off."""
    first, count = window.region[:2], window.region[2:]
    # A pixel's coordinates are its column and row. The window ends half a pixel beyond its outermost ones.
    scale = [0.5 / step for step in window.step]
    shift = [(n - 1) / 2 for n in window.size]
    middle = [(first[k] + (count[k] - 1) / 2 - shift[k]) / scale[k] for k in (0, 1)]
    pane = Pane(tuple(middle), tuple(count[k] / 2 / scale[k] for k in (0, 1)), tuple(scale), tuple(shift))  # type: ignore[arg-type]
    # In pixels: a 64th, and what coordinates are off by in float32 (see SLACK), and in double before.
    off = [
        SLACK * (s * p + n) + TURNED * s * (1 + p) ** 2
        for s, p, n in zip(scale, _largest(pane), window.size, strict=True)
    ]
    return pane, 1 / 64 + window.spread + max(off)


def _largest(pane: Pane) -> tuple[float, float]:
    """The largest size of a slope in the pyramid that polygons are clipped to."""
    across, up = (abs(m) + GUARD * h for m, h in zip(pane.middle, pane.half, strict=True))
    return across, up


def off_by(pane: Pane) -> float:
    """By how much corners on a side of a cube are off in double, beside what is allowed for roundings to `real`.

    Across a parallel light it is what they are off by in float32.
    """
    return 2.0**-23 if pane.along else TURNED * (1 + max(_largest(pane))) ** 2


def _turned(rows: Array, vertex: Array) -> Array:
    """(3, v): the vertices (v, 3) in the coordinate system of `rows`, (3, 3)."""
    out = np.empty((3, len(vertex)))

    def turn(block: slice) -> None:
        out[:, block] = along(rows, vertex[block])

    blockwise(len(vertex), turn)
    return out


class Sight(Protocol):
    """A point that sees triangles, elsewhere, as projections() does in float32."""

    def see(self, axes: Array, sides: Sequence[int], pane: Pane, among: Mask, receiver: Mask) -> Sequence[Elsewhere]:
        """What sides of a cube show. axes: (3, 3), of the cube; sides: their indices, 2 k along axis k and 2 k + 1
        against it, each of which has the next two axes across and up; among: (m,), which triangles are asked for;
        receiver: (m,), where shadow rays may end."""


class Projections(NamedTuple):
    """n convex polygons of c corners, some of which may be the same.

    triangle: (n,), which triangles they are; corner: (2, c, n), coordinates on the plane; edges: left, right, low and
    high, each (n,), the extent; loose: (n,) or (), no corner is off by more than that and a few roundings; near: (n,)
    float32, a lower bound of the squared distance of the nearest point, -1 where it is not known; far: (n,), an upper
    bound of that of the furthest point.
    """

    triangle: NDArray[np.int32]
    corner: Reals
    edges: list[Reals]
    loose: Array
    near: NDArray[np.float32]
    far: Reals


class Turned(NamedTuple):
    """Vertices as seen along three axes. axes: their coordinates (v,) across, up and ahead, each times its sign."""

    axes: tuple[Array, Array, Array]
    signs: tuple[float, float, float]

    def along(self, which: slice | NDArray[np.intp], real: Real = np.float64) -> Reals:
        """(3, n): the coordinates of some of the vertices."""
        some = [axis[which] for axis in self.axes]
        found = np.empty((3, len(some[0])), real)
        for axis, sign, out in zip(some, self.signs, found, strict=True):
            np.multiply(axis, sign, out=out, casting="same_kind")
        return found


def projections(
    turned: Turned,
    face: NDArray[np.int32],
    among: Mask,
    pane: Pane,
    real: Real,
    use: Callable[[Projections], T],
) -> list[T]:
    """What `use` makes of the triangles that a window may show, some at a time.

    face: (m, 3); among: (m,), which triangles are asked for; real: what to compute in.
    """
    box = np.array([[axis.min(initial=np.inf), axis.max(initial=-np.inf)] for axis in turned.axes])
    if not len(face) or _all_beyond(box * np.array(turned.signs)[:, None], pane):
        return []
    parts = blockwise(len(turned.axes[0]), lambda block: _on_plane(turned.along(block, real), pane))
    points = _Points(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))

    def see(block: slice) -> list[T]:
        corners = np.ascontiguousarray(face[block].T, np.intp)
        codes = [points.code.take(corner) for corner in corners]
        wanted = among[block] & ((codes[0] & codes[1] & codes[2] & np.uint8(OUTSIDE)) == 0)
        inside = (codes[0] | codes[1] | codes[2]) < BEYOND
        near, far = (np.flatnonzero(which) for which in (wanted & inside, wanted & ~inside))
        some = corners if len(near) == corners.shape[1] else corners.take(near, axis=1)
        found = [_direct((block.start + near).astype(np.int32), points, some, turned, pane)]
        if len(far):
            found += _clipped((block.start + far).astype(np.int32), corners.take(far, axis=1), turned, pane)
        return [use(part) for part in found if len(part.triangle)]

    return list(chain.from_iterable(blockwise(len(face), see, AT_ONCE)))


class _Points(NamedTuple):
    """Vertices on the plane. x, y: (v,), coordinates; square: (v,), squared distances; code: (v,), a bit for each side
    of the window that a vertex is beyond, and BEYOND where x and y mean nothing."""

    x: Reals
    y: Reals
    square: Reals
    code: NDArray[np.uint8]


def _on_plane(axes: Reals, pane: Pane) -> _Points:
    """axes: (3, v), the coordinates of vertices."""
    x, y, d = axes
    real = axes.dtype.type
    # `size` is what the doubles may be off by; the other term of `loose`, what is rounded here. A vertex that is
    # beyond a side by more is beyond it. One that is not has |x| <= (|middle| + half) |d| for that side, to which the
    # roundings of x - middle d are relative; of one that is far beyond, they are relative to x itself.
    size = (np.abs(x) + np.abs(y) + np.abs(d)) * real(TURNED)
    depth = np.abs(d)
    code = (~(d > CLOSE)).astype(np.uint8) << np.uint8(4)
    for k, c in enumerate((x, y)):
        middle, half = pane.middle[k], pane.half[k]
        loose = depth * real(SLACK * (abs(middle) + half)) + size * real(1 + abs(middle) + half)
        aside = c - d * real(middle) if middle else c
        reach = d * real(half)
        code |= (aside > reach + loose).astype(np.uint8) << np.uint8(2 * k)
        code |= (-aside > reach + loose).astype(np.uint8) << np.uint8(2 * k + 1)
        code |= (~(np.abs(aside) <= reach * real(GUARD))).astype(np.uint8) << np.uint8(4)
    over = 1 / np.where(code < BEYOND, d, 1)
    placed = []
    for k, c in enumerate((x, y)):
        c = c * over
        if pane.scale[k] != 1 or pane.shift[k] != 0:
            c = c * real(pane.scale[k]) + real(pane.shift[k])
        placed.append(c)
    return _Points(placed[0], placed[1], x * x + y * y + d * d, code)


def _all_beyond(axes: Reals, pane: Pane) -> bool:
    """Whether all vertices, (3, v), are beyond one side of the window, as the box around them is."""
    bounds = [(float(axis.min()), float(axis.max())) for axis in axes]
    size = max(abs(bound) for pair in bounds for bound in pair)
    for k, (least, most) in enumerate(bounds[:2]):
        middle, half = pane.middle[k], pane.half[k]
        loose = 2 * SLACK * size * (1 + abs(middle) + half)
        for nearest, edge in ((least, half + middle), (-most, half - middle)):
            if nearest > max(edge * depth for depth in bounds[2]) + loose:
                return True
    return False


def _direct(
    triangle: NDArray[np.int32], points: _Points, corners: NDArray[np.intp], turned: Turned, pane: Pane
) -> Projections:
    """Triangles with all corners within the pyramid. corners: (3, n), their vertices."""
    corner = np.empty((2, 3, corners.shape[1]), points.x.dtype)
    for values, out in zip((points.x, points.y), corner, strict=True):
        for which, each in zip(corners, out, strict=True):
            values.take(which, out=each, mode="clip")  # other modes need a copy for `out`
    squares = [points.square.take(which) for which in corners]
    least = np.minimum(np.minimum(squares[0], squares[1]), squares[2])
    most = np.maximum(np.maximum(squares[0], squares[1]), squares[2])
    edges = _extent(corner)
    # A point of a triangle has the weighted mean of the corners' squared distances, less a variance of at most the
    # squared radius of the circle around it, which is at most a third of the longest side's square (Jung 1901). Of two
    # corners at distances p <= q, this square is (q - p)^2 and p q times that of the chord of their angle, which is
    # less than between their slopes.
    real = least.dtype.type
    wide, high = (edges[1] - edges[0]) * real(1 / pane.scale[0]), (edges[3] - edges[2]) * real(1 / pane.scale[1])
    apart = most - least
    spread = (apart * apart / (4 * least) + most * (wide * wide + high * high)) * real(1 / 3)
    # Each of these terms is right to 2^-20 of the smallest square, as long as they are less than that.
    near = least * real(1 - 2.0**-16) - spread
    large = np.flatnonzero(spread > least * real(1 / 16))
    near = near.astype(np.float32)
    if len(large):
        a, b, c = (turned.along(which[large]) for which in corners)
        near[large] = _nearest(a, b, c, np.stack([a, b, c], axis=1))
    return Projections(triangle, corner, edges, loose=np.zeros(()), near=near, far=most * real(1 + 2.0**-10))


def _extent(corner: Reals) -> list[Reals]:
    """left, right, low, high: each (n,), of corners (2, c, n)."""
    found = []
    for values in corner:
        low, high = np.minimum(values[0], values[1]), np.maximum(values[0], values[1])
        for more in values[2:]:
            np.minimum(low, more, out=low)
            np.maximum(high, more, out=high)
        found += [low, high]
    return found


def _nearest(a: Array, b: Array, c: Array, corner: Array) -> NDArray[np.float32]:
    """(n,): a lower bound of the squared distance of the points of n polygons; -1 if it is about 0.

    a, b, c: (3, n), corners of the triangles that the polygons are parts of; corner: (3, c, n), those of the polygons.
    """
    normal, sides = _normal(a, b, c)
    reach = np.maximum(np.maximum(_size(a), _size(b)), _size(c))
    # Corners are off by TURNED of their distance. So are sides, by twice of it, and all else follows.
    error = 8 * TURNED * reach
    plane = np.abs((a * normal).sum(axis=0)) - error * reach * sides
    plane /= _size(normal) + error * sides + 2.0**-500
    plane = np.maximum(plane, 0)
    square = (corner * corner).sum(axis=0).min(axis=0)
    across = corner.max(axis=1) - corner.min(axis=1)
    ball = square - (across * across).sum(axis=0) / 3 - error * reach
    near = np.maximum(plane * plane, ball) * (1 - 2.0**-18)
    return np.where(near > 2.0**-100, rounded_down(near), np.float32(-1))


def _size(v: Array) -> Array:
    """|v| of (3, n): (n,)."""
    return np.asarray(np.sqrt((v * v).sum(axis=0)))


def _clipped(triangle: NDArray[np.int32], corners: NDArray[np.intp], turned: Turned, pane: Pane) -> list[Projections]:
    """The parts of triangles within the pyramid, in double.

    What clipping loses to roundings is within `error` of the pyramid's sides, z away from the window's. So it is out of
    the window, unless z is less than about that. Then the point is almost in the triangle's plane: such triangles are
    entered everywhere.
    """
    a, b, c = (turned.along(which) for which in corners)
    reach = np.maximum(np.maximum(_size(a), _size(b)), _size(c))
    # Along the skew axes below, the pyramid is |x|, |y| <= z, and coordinates are larger by `grow` at most.
    middle, width = np.array(pane.middle)[:, None, None], GUARD * np.array(pane.half)[:, None, None]
    grow = 1 + float(((1 + np.abs(middle)) / width).max())
    error = 4 * TURNED * grow * reach
    normal, sides = _normal(a, b, c)
    clear = np.abs((a * normal).sum(axis=0)) > 64 * error * (1 + sum(_largest(pane))) * sides * sides
    polygon, which = np.stack([a, b, c], axis=1)[:, :, clear], np.flatnonzero(clear)
    polygon[:2] = (polygon[:2] - middle * polygon[2]) / width
    for k in (0, 1):
        for sign in (1.0, -1.0):
            polygon, left = _cut(polygon, polygon[2] - sign * polygon[k])
            which = which[left]
    scale, shift = np.array(pane.scale)[:, None, None], np.array(pane.shift)[:, None, None]
    found = []
    if len(which):
        slope = polygon[:2] / polygon[2]
        loose = 2 * error[which] / polygon[2].min(axis=0, initial=np.inf)
        polygon[:2] = polygon[:2] * width + middle * polygon[2]
        far = (polygon * polygon).sum(axis=0).max(axis=0, initial=0) * (1 + 2.0**-10)
        near = _nearest(a[:, which], b[:, which], c[:, which], polygon)
        corner = (slope * width + middle) * scale + shift
        found.append(_of(triangle[which], corner, loose=loose * (width * scale).max(), near=near, far=far))
    if not clear.all():
        rest = np.flatnonzero(~clear)
        square = np.array([[-1.0, 1, 1, -1], [-1, -1, 1, 1]])[:, :, None] * width + middle
        everywhere = np.repeat(square * scale + shift, len(rest), axis=2)
        near = np.full(len(rest), -1, np.float32)
        found.append(_of(triangle[rest], everywhere, loose=np.zeros(len(rest)), near=near, far=3 * reach[rest] ** 2))
    return found


def _of(triangle: NDArray[np.int32], corner: Array, loose: Array, near: NDArray[np.float32], far: Array) -> Projections:
    return Projections(triangle, corner, _extent(corner), loose=loose, near=near, far=far)


def _cut(polygon: Array, inside: Array) -> tuple[Array, NDArray[np.intp]]:
    """The parts of n polygons (3, c, n) where a linear function of the coordinates is not negative, and which have any.

    inside: (c, n), its values at the corners. Polygons with fewer corners than others have their first one many times.
    """
    outside = inside < 0
    cut = np.flatnonzero(outside.any(axis=0))
    every, inside, outside = polygon[:, :, cut], inside[:, cut], outside[:, cut]
    following, then = np.roll(every, -1, axis=1), np.roll(inside, -1, axis=0)
    crosses = outside != np.roll(outside, -1, axis=0)
    share = inside / np.where(crosses, inside - then, 1)
    shape = (3, 2 * polygon.shape[1], len(cut))
    # After each corner comes the point where the side to the next one crosses.
    every = np.stack([every, every + share * (following - every)], axis=2).reshape(shape)
    valid = np.stack([~outside, crosses], axis=1).reshape(shape[1:])
    count = valid.sum(axis=0)
    order = np.argsort(~valid, axis=0, kind="stable")[: int(count.max(initial=0))]
    order = np.where(np.arange(len(order))[:, None] < count, order, order[:1])
    found = np.repeat(polygon[:, :1], max(polygon.shape[1], len(order)), axis=1)
    found[:, : polygon.shape[1]] = polygon
    found[:, : len(order), cut] = np.take_along_axis(every, order[None], axis=1)
    found[:, len(order) :, cut] = found[:, :1, cut]
    left = np.ones(polygon.shape[2], bool)
    left[cut] = count > 0
    return found[:, :, left], np.flatnonzero(left)


def _normal(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Of triangles with corners (3, n): (b - a) x (c - a), (3, n), and the longest of the two sides, (n,)."""
    e, f = b - a, c - a
    normal = np.stack([e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]])
    return normal, np.maximum(_size(e), _size(f))
