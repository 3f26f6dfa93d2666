"""What surfaces cover of a plane, as seen from a point or along a direction: rectangles, and how near they are.

A surface is within the convex hull of a few spheres of one radius: a ball is within one, a cylinder within the two
around the middles of its ends, and a triangle within three of radius 0. Seen from a point that has all of them ahead,
each sphere is an ellipse on the plane one unit ahead, and the surface is within the rectangle around all of these. The
planes through the point that touch two spheres cut corners off the rectangle. All bounds are wider than any rounding,
here or in the kernel, can ask for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import cross
from cltrace.base.arrays import blockwise
from cltrace.plan.rounding import Array, Ints, Mask, along, rounded_down

# Relative to a coordinate: float32 arithmetic in the kernel has an error of less than half of it, double of the other.
SLACK, FINE_SLACK = 2.0**-20, 2.0**-44
# A corner that was subtracted and turned, twice at most, has an error of this share of its distance.
TURNED = 2.0**-46
# Depths along a direction are lower by this: the kernel's depths in float32 have an error of less than half of it.
DEPTH_SLACK = 2.0**-22
# Signs that move the edges of rectangles outwards: see Projected.
OUTWARDS = np.array([[-1.0], [1.0], [-1.0], [1.0]])


# Two ends of silhouettes, and a third one, (3, n) each: see _touching().
Pair = tuple[Array, Array, Array | None]


class Projected(NamedTuple):
    """What n surfaces cover of a plane.

    member: (n,), their indices as surfaces; edges: (4, n), the left, right, low and high ends of rectangles around
    them, -inf or inf where nothing is known; lines: (k, 3, n), a surface covers no place (x, y) where its a x + b y + c
    is less than 0; area: (n,), about what it covers; near: (n,), lower bounds of the depths of their nearest points;
    far: (n,), upper bounds of those of the furthest ones. A depth is a squared distance from a point, or a distance
    along a direction.
    """

    member: Ints
    edges: Array
    lines: Array
    area: Array
    near: NDArray[np.float32]
    far: Array


NOTHING = Projected(
    np.zeros(0, np.int32), np.zeros((4, 0)), np.zeros((0, 3, 0)), np.zeros(0), np.zeros(0, np.float32), np.zeros(0)
)


def joined_projections(parts: Sequence[Projected]) -> Projected:
    """The surfaces of all parts."""
    some = [part for part in parts if len(part.member)] or parts[:1]
    if len(some) == 1:
        return some[0]
    most = max(len(part.lines) for part in some)
    some = [part._replace(lines=np.pad(part.lines, ((0, most - len(part.lines)), (0, 0), (0, 0)))) for part in some]
    return Projected(*(np.concatenate(columns, axis=-1) for columns in zip(*some, strict=True)))


class Silhouettes(ABC):
    """n surfaces of one shape along the camera's axes, in the float buffers' unit, in which lengths are about 1.

    They are seen from the origin, or along a direction. radius: (n,), of the spheres that hold each one; first: the
    index of the first one as a surface; cell_entries: how many cells of a light's grid are made for each of them, 0 for
    balls; sight: what sees most of them on a device, see run/pack/polygons.py, None for nothing.
    """

    radius: Array
    first: int
    cell_entries = 0.0
    sight: Any = None

    def __len__(self) -> int:
        return int(self.ends.shape[1])

    @property
    @abstractmethod
    def points(self) -> Array:
        """(p, 3): the centres of all spheres that hold the surfaces."""

    @property
    @abstractmethod
    def ends(self) -> NDArray[np.integer[Any]]:
        """(k, n): which of these points each surface's spheres are around."""

    @property
    def met(self) -> Mask:
        """(n,): which of them rays from there can meet."""
        return np.ones(len(self), bool)

    @property
    def inside(self) -> Mask:
        """(n,): which of them the point that they are seen from may be inside of or on."""
        return np.zeros(len(self), bool)

    @abstractmethod
    def nearest(self, which: NDArray[np.intp], ends: Sequence[Array]) -> NDArray[np.float32]:
        """Lower bounds of the squared distances of some of them; -1 where it may be 0. ends: (3, k) each, of these."""

    def pairs(self, ends: Sequence[Array]) -> list[Pair]:
        """The first three arguments of _touching() for each line. ends: (3, k) each, of some surfaces."""
        return []

    def lines(self, ends: Sequence[Array], r: Array, reach: float, flat: bool = False) -> Array:
        """(p, 3, k): of Projected, for some surfaces. ends, r: centres and radius; reach, flat: of _touching()."""
        found = [_touching(*pair, r, reach, flat) for pair in self.pairs(ends)]
        return np.array(found).reshape(len(found), 3, len(r))

    def through(self, axes: Array, half: tuple[float, float], among: Mask) -> Projected:
        """What is seen from the origin through a rectangle of the plane one unit ahead; edges are slopes.

        axes: (3, 3), the two across and the one ahead; half: half of the rectangle's sides; among: of all surfaces,
        which to look for.
        """
        rows, corners = np.flatnonzero(among[self.first : self.first + len(self)] & self.met), self.ends
        place, radius = np.array(along(axes, self.points)), np.zeros(len(self.points))
        for corner in corners:
            radius[corner] = self.radius
        beyond, discs = _beyond(place, radius, half), slopes(place, radius)

        def look(block: slice) -> Projected:
            which = rows[block]
            which = which[np.bitwise_and.reduce([beyond.take(corner[which]) for corner in corners]) == 0]
            if not len(which):
                return NOTHING
            r, ends = self.radius[which], [place.take(corner[which], axis=1) for corner in corners]
            edges, area = _around(np.array([discs.take(corner[which], axis=1) for corner in corners]))
            # Slopes of what has errors of TURNED.
            most = 1 + np.abs(edges).max(axis=0)
            edges += OUTWARDS * (TURNED * most * most)
            far = (np.max([length(*end) for end in ends], axis=0) + r) ** 2 * (1 + 2.0**-10)
            near, lines = self.nearest(which, ends), self.lines(ends, r, 1 + sum(half))
            return Projected((self.first + which).astype(np.int32), edges, lines, area, near, far)

        return joined_projections(blockwise(len(rows), look))

    def across(self, axes: Array, slack: float, among: Mask) -> Projected:
        """What is seen along a direction, on the plane across it.

        axes: (3, 3), the two across and the one against the direction; slack: SLACK or FINE_SLACK; among: of all
        surfaces, which to look for.
        """
        rows, corners = np.flatnonzero(among[self.first : self.first + len(self)] & self.met), self.ends
        place = np.array(along(axes, self.points))

        def look(block: slice) -> Projected:
            which = rows[block]
            r, ends = self.radius[which], np.array([place.take(corner[which], axis=1) for corner in corners])
            edges, area = _around(ends[:, [0, 0, 1, 1]] + OUTWARDS * (r + FINE_SLACK))
            low, high = ends[:, 2].min(axis=0) - (r + FINE_SLACK), ends[:, 2].max(axis=0) + (r + FINE_SLACK)
            size = np.maximum(np.abs(low), np.abs(high))
            near = rounded_down(-high - SLACK * size - (DEPTH_SLACK + slack))
            # Homogeneous coordinates of places, none of which exceeds 4.
            ends[:, 2] = 1
            lines = self.lines([*ends], r, 9, flat=True)
            return Projected((self.first + which).astype(np.int32), edges, lines, area, near, 2.0**-10 - low)

        return joined_projections(blockwise(len(rows), look))


@dataclass(frozen=True)
class Discs(Silhouettes):
    """n balls as seen from a point.

    center: (n, 3), from that point to the centres; radius: (n,); power: (n,), |center|^2 - radius^2 of the exact
    center, rounded once, 0 from inside for surfaces that only lie within these balls.
    """

    center: Array
    radius: Array
    power: Array
    first: int = 0

    @property
    def points(self) -> Array:
        return self.center

    @property
    def ends(self) -> NDArray[np.integer[Any]]:
        return np.arange(len(self.radius))[None]

    @property
    def inside(self) -> Mask:
        return np.less_equal(self.power, 0)

    def nearest(self, which: NDArray[np.intp], ends: Sequence[Array]) -> NDArray[np.float32]:
        """From inside, too, the nearest point is | |C| - r | away."""
        # Relative errors, in units of 2^-24: the gap is right to 6, its square to 14, and the kernel's squared lengths
        # are right to 5.
        gap = np.abs(self.power[which]) / (length(*ends[0]) + self.radius[which])
        return np.where(gap > 2.0**-50, gap * gap * (1 - 2.0**-19), -1).astype(np.float32)


@dataclass(frozen=True)
class Capsules(Silhouettes):
    """n cylinders as seen from a point.

    start, end: (n, 3), from there to the middles of their ends; radius: (n,).
    """

    start: Array
    end: Array
    radius: Array
    first: int
    # To try a cylinder takes longer than a triangle or a ball.
    cell_entries = 3.0

    @property
    def points(self) -> Array:
        return np.concatenate([self.start, self.end])

    @property
    def ends(self) -> NDArray[np.integer[Any]]:
        return np.arange(2 * len(self.radius)).reshape(2, -1)

    def pairs(self, ends: Sequence[Array]) -> list[Pair]:
        a, b = ends
        return [(a, b, None), (b, a, None)]

    def distance(self, which: NDArray[np.intp], ends: Sequence[Array]) -> Array:
        """(k,): how far some of them are from the point, at least, 0 from inside."""
        a, b = ends
        u = b - a
        uu = (u * u).sum(axis=0)
        k = np.clip(-(a * u).sum(axis=0) / np.where(uu > 0, uu, 1), 0, 1)
        # a + k u takes four roundings of each coordinate, and k seven and a division, which move the point along u.
        off = 2.0**-48 * (np.abs(a) + np.abs(b)).sum(axis=0)
        return np.asarray(np.maximum(length(*(a + k * u)) * (1 - 2.0**-40) - off - self.radius[which], 0))

    def nearest(self, which: NDArray[np.intp], ends: Sequence[Array]) -> NDArray[np.float32]:
        near = self.distance(which, ends)
        # 2^-19 is 32 roundings, of which this takes two, and the kernel's squares five.
        return np.where(near > 2.0**-50, near * near * (1 - 2.0**-19), -1).astype(np.float32)

    @property
    def inside(self) -> Mask:
        return np.asarray(self.distance(np.arange(len(self.radius)), [self.start.T, self.end.T]) == 0)


@dataclass(frozen=True)
class Polygons(Silhouettes):
    """m triangles as seen from a point.

    vertex: (v, 3), from there; face: (m, 3), three vertices each; side: (m,), 1 or -1 where the corners are seen one
    way round or the other, 0 where no ray from there can meet the triangle.
    """

    vertex: Array
    face: Ints
    first: int
    side: NDArray[np.int8]
    sight: Any = None
    # Triangles take longer to enter than to try, and few of them may have many entries: for five meshes of 1,000 to
    # 100,000, twice as many or half as many change little.
    cell_entries = 1.6

    @property
    def radius(self) -> Array:  # type: ignore[override]
        return np.zeros(len(self.face))

    @property
    def points(self) -> Array:
        return self.vertex

    @property
    def ends(self) -> NDArray[np.integer[Any]]:
        return self.face.T

    @property
    def met(self) -> Mask:
        return np.not_equal(self.side, 0)

    def pairs(self, ends: Sequence[Array]) -> list[Pair]:
        a, b, c = ends
        return [(a, b, c), (b, c, a), (c, a, b)]

    def nearest(self, which: NDArray[np.intp], ends: Sequence[Array]) -> NDArray[np.float32]:
        """The triangle's plane is no further, and, by its corners, neither is a ball around it.

        A point of a triangle has the weighted mean of the corners' squared distances, less a variance of at most the
        squared radius of the circle around it, which is at most a third of the longest side's square (Jung 1901).
        """
        plane, reach = plane_distance(ends)
        corner = np.stack(ends)
        across = corner.max(axis=0) - corner.min(axis=0)
        ball = (corner * corner).sum(axis=1).min(axis=0) - (across * across).sum(axis=0) / 3 - 8 * TURNED * reach**2
        near = np.maximum(plane * plane, ball) * (1 - 2.0**-18)
        return np.where(near > 2.0**-100, rounded_down(near), np.float32(-1))


def plane_distance(ends: Sequence[Array]) -> tuple[Array, Array]:
    """A lower bound of how far the planes of triangles are from the origin, and their furthest corners: (n,) each.

    ends: (3, n) each, their corners, which have errors of TURNED of their distance. So have the sides, twice of it, and
    all else follows.
    """
    a, b, c = ends
    e, f = b - a, c - a
    normal = np.stack(cross(e, f))
    sides, reach = np.maximum(length(*e), length(*f)), np.max([length(*end) for end in ends], axis=0)
    error = 8 * TURNED * reach
    plane = np.abs((a * normal).sum(axis=0)) - error * reach * sides
    return np.maximum(plane / (np.sqrt((normal * normal).sum(axis=0)) + error * sides + 2.0**-500), 0), reach


def _beyond(place: Array, radius: Array, half: tuple[float, float]) -> NDArray[np.int8]:
    """(n,): a bit for each plane through the origin and a side of a rectangle that a sphere is beyond.

    place: (3, n), centres, across, up and ahead; radius: (n,); half: of through().
    """
    beyond, size = np.zeros(len(radius), np.int8), np.abs(place).sum(axis=0) * SLACK
    for k, h in enumerate(half):
        reach = radius * (np.hypot(1, h) * (1 + SLACK)) + size * (1 + h) + h * place[2]
        for bit, sign in enumerate((1, -1), 2 * k):
            beyond |= (sign * place[k] > reach).astype(np.int8) << bit
    return beyond


def _around(discs: Array) -> tuple[Array, Array]:
    """Of n hulls of k discs each: `edges` and `area` of Projected. discs: (k, 4, n), the edges of these."""
    low, high = discs[:, ::2], discs[:, 1::2]
    edges = np.stack([low.min(axis=0), high.max(axis=0)], axis=1).reshape(4, -1)
    # A convex polygon whose edges are moved out by a radius covers its area, that of a strip at each edge, and a disc.
    with np.errstate(invalid="ignore"):
        (x, y), radius = ((low + high) / 2).swapaxes(0, 1), (high - low).mean(axis=(0, 1)) / 2
        dx, dy = np.roll(x, -1, axis=0) - x, np.roll(y, -1, axis=0) - y
        area = (
            np.abs((x * dy - y * dx).sum(axis=0)) / 2 + np.sqrt(dx * dx + dy * dy).sum(axis=0) * radius + 2 * radius**2
        )
    return edges, area


def _touching(p: Array, q: Array, third: Array | None, r: Array, reach: float, flat: bool = False) -> Array:
    """(3, n): of n pairs of spheres around p and q, with one radius, N for which N.(x, y, 1) is at least 0 on both.

    p, q: (3, n) each; third: (3, n), to which side the hull is, None for the side where p, q and the origin turn right;
    reach: 1 + |x| + |y| at most; flat: whether spheres are discs in the plane that the third coordinates, all 1, span.

    With u = q - p and m = u x p, a plane through the origin along u has a distance r from both points if its unit
    normal is (r A + sqrt(m.m - r^2 u.u) m) / m.m for A = m x u: it is at right angles to u, and times p it is r. Points
    have errors of up to d = FINE_SLACK s, for the largest distance s of any. So m has an error of up to d (|u| + 2 s)
    <= 4 d s, and A one of 2 d |m| + 4 d s |u|. Where the root is at least |m| / 4, it has an error of up to 16 d s +
    8 r d, and all of r A + sqrt(...) m, with r |u| <= |m| and r <= s, one of less than 40 d s |m|.
    """
    u = q - p
    m, size = np.stack(cross(u, p)), np.maximum(length(*p), length(*q))
    if third is not None:
        size = np.maximum(size, length(*third))
        side = (m * third).sum(axis=0)
        m *= np.where(np.abs(side) > 8 * FINE_SLACK * size**3, np.sign(side), 0)
    uu, mm, off = (u * u).sum(axis=0), (m * m).sum(axis=0), 64 * FINE_SLACK * size**2 * reach
    if flat:
        m[2] += r * np.sqrt(uu) + off
        return m
    square = mm - r * r * uu
    found = np.where(square > mm / 16, r * np.stack(cross(m, u)) + np.sqrt(np.maximum(square, 0)) * m, 0)
    found[2] += off * np.sqrt(mm)
    return np.asarray(found)


def slopes(place: Array, r: Array) -> Array:
    """(4, n): lower and higher slopes x / d, and those of y / d, of the tangents from the origin to spheres.

    place: (3, n), centres (x, y, d); r: (n,). Where a sphere is not clear of the plane d = 0, it has no such tangents,
    and the answer is -inf and inf, as it is where squares are about to underflow. If each argument is rounded once,
    slopes are right to 9 roundings of the larger one, |middle| + half.
    """
    d = place[2]
    gap = (d - r) * (d + r)
    clear = (d > 0) & (gap >= d * d * (1 / 16)) & (gap > 2.0**-100)
    over, found = 1 / np.where(clear, gap, 1), np.empty((4, len(r)))
    for k, c in enumerate(place[:2]):
        middle, half = c * (d * over), r * over * np.sqrt(np.maximum(c * c + gap, 0))
        found[2 * k], found[2 * k + 1] = middle - half, middle + half
    found[:, ~clear] = np.inf * OUTWARDS
    return found


def length(x: Array, y: Array, z: Array) -> Array:
    """(n,): |(x, y, z)|. Below 2^-60, where squares underflow, it is too large."""
    return np.asarray(np.sqrt(x * x + y * y + z * z + 2.0**-120))
