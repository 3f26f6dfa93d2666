"""Which surfaces cannot matter: what is there twice, and spheres that can shadow nothing.

All tests but for equality are made with spheres that are larger by more than any rounding, here or in the kernel, can
amount to. So a surface is left out only if no ray could ever tell, and no picture changes. (In single some extreme
scenes are an exception: docs/speed.md.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.plan.accel.silhouettes import Discs
from cltrace.plan.rounding import Array, Mask, squared_length

# An odd number without a pattern, for marks.
ODD = np.uint64(0xD6E8FEB86659FD93)


def larger(radius: Array, slack: float) -> Array:
    """The radii (n,), larger by more than rounding can move the silhouette of such a sphere.

    slack: the relative error of lengths. Lengths are at most 4: an error of 16 slack in a discriminant, or in a squared
    length, moves the silhouette of a sphere of radius r by less than 16 slack / r.
    """
    return radius + 16 * slack * (1 + 1 / radius)


def repeated(center: Array, radius: Array, shape: NDArray[np.int32], number: NDArray[np.int32], by_place: bool) -> Mask:
    """(n,): which spheres are equal to one with a lower number, and so never seen: of equal ones, the first one counts.

    shape: (n,) or (), another number by which they may differ; number: (n,), those in the scene; by_place: whether
    neighbours in space are neighbours here. Then only those are compared, which finds nearly all that are equal without
    sorting.
    """
    n = len(radius)
    shape = np.broadcast_to(shape, (n,))
    order = None if by_place else np.lexsort((number, shape, radius, *center.T))
    out = np.zeros(n, bool)

    def compare(block: slice) -> NDArray[np.intp]:
        one = slice(block.start, min(block.stop, n - 1))
        next_one = slice(one.start + 1, one.stop + 1)
        a, b = (one, next_one) if order is None else (order[one], order[next_one])
        which = np.flatnonzero((radius[a] == radius[b]) & (center[a, 0] == center[b, 0]) & (shape[a] == shape[b]))
        i, j = (which + one.start, which + next_one.start) if order is None else (a[which], b[which])  # type: ignore[index]
        same = (center[i] == center[j]).all(axis=1)
        return np.asarray(np.where(number[i] < number[j], j, i)[same])

    for which in blockwise(n, compare):
        out[which] = True
    return out


def repeated_faces(vertex: Array, face: NDArray[np.int32]) -> NDArray[np.intp]:
    """Which triangles have the same three corners as an earlier one, in whatever order, and so are never seen.

    vertex: (v, 3), in the world; face: (m, 3), the corners of triangles, of which the earlier one wins a tie. No ray
    that starts elsewhere meets one of two such triangles without the other, at another t, or first, and one that starts
    on the earlier one is in the plane of both, and so meets neither. Whatever side, normals and material the later
    one has, no rule asks for them.
    """
    if len(face) < 2:
        return np.zeros(0, np.intp)
    mark = np.concatenate(blockwise(len(vertex), lambda rows: _marks(vertex[rows])))
    # What two triangles add up to is hardly ever the same if they are not equal. Only such are compared.
    total = np.concatenate(blockwise(len(face), lambda rows: mark.take(face[rows]).sum(axis=1)))
    twice = np.sort(total)
    twice = twice[1:][twice[1:] == twice[:-1]]
    if not len(twice):
        return np.zeros(0, np.intp)
    among = np.flatnonzero(np.isin(total, twice))
    marks, corners = mark.take(face[among]), face[among]
    by_mark = marks.argsort(axis=1)
    marks, corners = (np.take_along_axis(one, by_mark, axis=1) for one in (marks, corners))
    order = np.lexsort(marks.T)  # equal ones stay as they are
    places = vertex.take(corners[order], axis=0)
    again = (places[1:] == places[:-1]).all(axis=(1, 2))
    return np.sort(among[order[1:][again]])


def _marks(points: Array) -> NDArray[np.uint64]:
    """(n,): a number for each point (n, 3), hardly ever the same for two that are not equal; 0 and -0 are."""
    mark = np.zeros(len(points), np.uint64)
    for k in range(3):
        mark = (mark ^ (points[:, k] + 0.0).view(np.uint64)) * ODD
        mark ^= mark >> np.uint64(32)
    return mark * ODD


def point_shadows(discs: Discs, slack: float) -> Mask:
    """(n, n): whether sphere [j] can stand between a point light and any point of sphere [i]. discs: from the light."""
    roomy = larger(discs.radius, slack)
    distance = np.sqrt(squared_length(discs.center))
    # A light that is inside of a sphere, or all but, sees it in every direction.
    clear = distance > roomy
    safe = np.where(clear, distance, 1.0)
    half = np.where(clear, np.arcsin(np.minimum(roomy / safe, 1)), np.pi)
    direction = discs.center / safe[:, None]
    cross = np.cross(direction[:, None], direction[None])
    angle = np.arctan2(np.sqrt((cross * cross).sum(axis=-1)), direction @ direction.T)
    loose = 16 * slack * (1 + 1 / safe)
    overlap = angle <= (half + loose)[:, None] + (half + loose)[None]
    return np.asarray(overlap & ((distance - roomy)[None] < (distance + roomy)[:, None]))


def parallel_shadows(axes: Array, discs: Discs, slack: float) -> Mask:
    """The same for a parallel light. axes: (3, 3), two across the light and one towards it; discs: from the eye."""
    roomy = larger(discs.radius, slack) + slack * 16
    u, v, s = axes @ discs.center.T
    gap = np.hypot(u[:, None] - u[None], v[:, None] - v[None])
    return np.asarray((gap <= roomy[:, None] + roomy[None]) & ((s + roomy)[None] > (s - roomy)[:, None]))
