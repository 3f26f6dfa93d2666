"""What surfaces cover of a plane, as seen from a point or along a direction: rectangles, and how near they are.

A surface is within the convex hull of a few spheres of one radius: a ball is within one, a cylinder within the two
around the middles of its ends, and a triangle within three of radius 0. Seen from a point that has all of them ahead,
each sphere is an ellipse on the plane one unit ahead, and the surface is within the rectangle around all of these. All
bounds are wider than any rounding, here or in the kernel, can ask for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.plan.rounding import Array, Ints, Mask, along, rounded_down

# Relative to a coordinate: float32 arithmetic in the kernel has an error of less than half of it, double of the other.
SLACK, FINE_SLACK = 2.0**-20, 2.0**-44
# A corner that was subtracted and turned, twice at most, has an error of this share of its distance.
TURNED = 2.0**-46
# Depths along a direction are lower by this: the kernel's depths in float32 have an error of less than half of it.
DEPTH_SLACK = 2.0**-22
# A triangle that comes nearer to the point than this share of its corners' distance may cover everything.
TOO_NEAR = 2.0**-36
# Edges of rectangles: see Projected.
EVERYWHERE = np.array([[-np.inf], [np.inf], [-np.inf], [np.inf]])
NOWHERE = -EVERYWHERE
OUTWARDS = np.sign(EVERYWHERE)


class Projected(NamedTuple):
    """What n surfaces cover of a plane.

    member: (n,), their indices as surfaces; edges: (4, n), the left, right, low and high ends of rectangles around
    them, -inf or inf where nothing is known; near: (n,), lower bounds of the depths of their nearest points; far: (n,),
    upper bounds of those of the furthest ones. A depth is a squared distance from a point, or a distance along a
    direction.
    """

    member: Ints
    edges: Array
    near: NDArray[np.float32]
    far: Array


NOTHING = Projected(np.zeros(0, np.int32), np.zeros((4, 0)), np.zeros(0, np.float32), np.zeros(0))


def joined_projections(parts: Sequence[Projected]) -> Projected:
    """The surfaces of all parts."""
    some = [part for part in parts if len(part.member)] or parts[:1]
    if len(some) == 1:
        return some[0]
    return Projected(*(np.concatenate(columns, axis=-1) for columns in zip(*some, strict=True)))


class Silhouettes(ABC):
    """n surfaces of one shape along the camera's axes, in the float buffers' unit, in which lengths are about 1.

    They are seen from the origin, or along a direction. first: the index of the first one as a surface; cell_entries:
    how many cells of a light's grid are made for each of them; sight: what sees most of them on a device, see
    run/pack/polygons.py, None for nothing.
    """

    first: int
    cell_entries = 2.25
    sight: Any = None

    @abstractmethod
    def __len__(self) -> int:
        """n."""

    @property
    @abstractmethod
    def points(self) -> Array:
        """(p, 3): where they are."""

    @property
    def met(self) -> Mask:
        """(n,): which of them rays from there can meet."""
        return np.ones(len(self), bool)

    @abstractmethod
    def spheres(self, which: NDArray[np.intp]) -> tuple[Sequence[Array], Array]:
        """The spheres that hold some of them: their centres, (k, 3) each, and the radius of each surface's, (k,)."""

    @abstractmethod
    def nearest(self, which: NDArray[np.intp], ends: Sequence[Array]) -> NDArray[np.float32]:
        """Lower bounds of the squared distances of some of them; -1 where it may be 0. ends: (3, k) each, of these."""

    def vague_edges(self, ends: Sequence[Array], half: tuple[float, float]) -> Array:
        """The edges, (4, k), of some that are not ahead as a whole: they may be anywhere. ends: (3, k) each, of these;
        half: of through()."""
        return EVERYWHERE.repeat(ends[0].shape[1], axis=1)

    def through(self, axes: Array, half: tuple[float, float], among: Mask) -> Projected:
        """What is seen from the origin through a rectangle of the plane one unit ahead; edges are slopes.

        axes: (3, 3), the two across and the one ahead; half: half of the rectangle's sides; among: of all surfaces,
        which to look for.
        """
        rows = np.flatnonzero(among[self.first : self.first + len(self)] & self.met)

        def look(block: slice) -> Projected:
            which = rows[block]
            ends, r = self.spheres(which)
            ends = [np.stack(along(axes, end)) for end in ends]
            some = np.flatnonzero(~_beside(ends, r, half))
            if not len(some):
                return NOTHING
            which, r, ends = which[some], r[some], [end.take(some, axis=1) for end in ends]
            edges, *others = (np.stack(slopes([x, y], d, r, (d - r) * (d + r))) for x, y, d in ends)
            for other in others:
                widen(edges, other)
            vague = np.flatnonzero(np.isinf(edges[0]))
            if len(vague):
                edges[:, vague] = self.vague_edges([end.take(vague, axis=1) for end in ends], half)
            # Slopes of what has errors of TURNED. Of an empty rectangle, nothing is compared.
            most = 1 + np.abs(edges).max(axis=0, initial=0)
            with np.errstate(over="ignore", invalid="ignore"):
                edges += OUTWARDS * (TURNED * most * most)
            far = (np.max([length(*end) for end in ends], axis=0, initial=0) + r) ** 2 * (1 + 2.0**-10)
            near = self.nearest(which, ends)
            there = np.flatnonzero(edges[0] <= edges[1])
            return Projected((self.first + which[there]).astype(np.int32), edges[:, there], near[there], far[there])

        return joined_projections(blockwise(len(rows), look))

    def across(self, axes: Array, slack: float, among: Mask) -> Projected:
        """What is seen along a direction, on the plane across it.

        axes: (3, 3), the two across and the one against the direction; slack: SLACK or FINE_SLACK; among: of all
        surfaces, which to look for.
        """
        rows = np.flatnonzero(among[self.first : self.first + len(self)] & self.met)

        def look(block: slice) -> Projected:
            ends, r = self.spheres(rows[block])
            places = np.stack([np.stack(along(axes, end)) for end in ends])
            low, high = places.min(axis=0) - (r + FINE_SLACK), places.max(axis=0) + (r + FINE_SLACK)
            edges = np.stack([low[0], high[0], low[1], high[1]])
            size = np.maximum(np.abs(low[2]), np.abs(high[2]))
            near = rounded_down(-high[2] - SLACK * size - (DEPTH_SLACK + slack))
            return Projected((self.first + rows[block]).astype(np.int32), edges, near, 2.0**-10 - low[2])

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

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def points(self) -> Array:
        return self.center

    def spheres(self, which: NDArray[np.intp]) -> tuple[Sequence[Array], Array]:
        return (self.center[which],), self.radius[which]

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
    cell_entries = 4.0

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def points(self) -> Array:
        return np.concatenate([self.start, self.end])

    @property
    def met(self) -> Mask:
        return np.ones(len(self), bool)

    def spheres(self, which: NDArray[np.intp]) -> tuple[Sequence[Array], Array]:
        return (self.start[which], self.end[which]), self.radius[which]

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
        """(n,): which of them may have the point inside or on them."""
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
    # Few triangles may have many entries.
    cell_entries = 3.0

    def __len__(self) -> int:
        return len(self.face)

    @property
    def points(self) -> Array:
        return self.vertex

    @property
    def met(self) -> Mask:
        return np.not_equal(self.side, 0)

    def spheres(self, which: NDArray[np.intp]) -> tuple[Sequence[Array], Array]:
        return [self.vertex.take(corner, axis=0) for corner in self.face[which].T], np.zeros(len(which))

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

    def vague_edges(self, ends: Sequence[Array], half: tuple[float, float]) -> Array:
        """Those of what is ahead.

        A ray through the rectangle is within 1 + half[0] + half[1] of its depth, so what it meets of a plane at a
        distance h is at least at depth h / (1 + half[0] + half[1]). All that is at half of that or more is cut off
        here, and projected with the errors of the corners, which are divided by that depth. Where h is about 0, nothing
        is known.
        """
        plane, reach = plane_distance(ends)
        least = plane / (2 * (1 + half[0] + half[1]))
        edges = NOWHERE.repeat(len(least), axis=1)
        for p, q in zip(ends, (*ends[1:], ends[0]), strict=True):
            crosses = (p[2] < least) != (q[2] < least)
            share = np.where(crosses, (least - p[2]) / np.where(crosses, q[2] - p[2], 1), 0)
            between = p + np.clip(share, 0, 1) * (q - p)
            between[2] = least
            for point, there in ((p, p[2] >= least), (between, crosses)):
                some = np.flatnonzero(there & (point[2] > 0))
                x, y = point[:2, some] / point[2, some]
                off = 4 * TURNED * reach[some] * (1 + np.abs(x) + np.abs(y)) / point[2, some]
                found = edges[:, some]
                widen(found, np.stack([x - off, x + off, y - off, y + off]))
                edges[:, some] = found
        edges[:, least <= TOO_NEAR * reach] = EVERYWHERE
        return edges


def plane_distance(ends: Sequence[Array]) -> tuple[Array, Array]:
    """A lower bound of how far the planes of triangles are from the origin, and their furthest corners: (n,) each.

    ends: (3, n) each, their corners, which have errors of TURNED of their distance. So have the sides, twice of it, and
    all else follows.
    """
    a, b, c = ends
    e, f = b - a, c - a
    normal = np.stack([e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]])
    sides, reach = np.maximum(length(*e), length(*f)), np.max([length(*end) for end in ends], axis=0)
    error = 8 * TURNED * reach
    plane = np.abs((a * normal).sum(axis=0)) - error * reach * sides
    return np.maximum(plane / (np.sqrt((normal * normal).sum(axis=0)) + error * sides + 2.0**-500), 0), reach


def _beside(ends: Sequence[Array], radii: Array, half: tuple[float, float]) -> Mask:
    """(n,): which hulls have all their spheres beyond one of the planes through the origin and a side of a rectangle.

    ends: (3, n) each, across, up and ahead; half: of through().
    """
    beside = np.zeros(len(radii), bool)
    for k, h in enumerate(half):
        reaches = [radii * np.hypot(1, h) * (1 + SLACK) + np.abs(end).sum(axis=0) * ((1 + h) * SLACK) for end in ends]
        for sign in (1, -1):
            beyond = [sign * end[k] - h * end[2] > reach for end, reach in zip(ends, reaches, strict=True)]
            beside |= np.logical_and.reduce(beyond)
    return beside


def widen(edges: Array, others: Array) -> None:
    """Makes rectangles (4, n) as large as to hold others, too."""
    for k in range(4):
        (np.maximum if k % 2 else np.minimum)(edges[k], others[k], out=edges[k])


def slopes(across: list[Array], d: Array, r: Array, gap: Array) -> list[Array]:
    """The slopes c/d of the two tangents from the origin to circles with centre (c, d) and radius r.

    Returns, for each c of `across`, first the lower slopes (n,), then the higher ones. across: arrays (n,); gap: (n,),
    d^2 - r^2. Where a circle is not clear of the line d = 0, it has no such tangents, and the answer is -inf and inf,
    as it is where squares are about to underflow. If each argument is rounded once, both slopes are right to 8
    roundings of the larger one, |middle| + half, as neither of these takes more.
    """
    clear = (d > 0) & (gap >= d * d * (1 / 16)) & (gap > 2.0**-100)
    over = 1 / np.where(clear, gap, 1)
    found = []
    for c in across:
        middle, half = c * (d * over), r * over * np.sqrt(np.maximum(c * c + gap, 0))
        found += [np.where(clear, middle - half, -np.inf), np.where(clear, middle + half, np.inf)]
    return found


def length(x: Array, y: Array, z: Array) -> Array:
    """(n,): |(x, y, z)|. Below 2^-60, where squares underflow, it is too large."""
    return np.asarray(np.sqrt(x * x + y * y + z * z + 2.0**-120))
