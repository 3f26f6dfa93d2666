"""An order of surfaces in memory in which neighbours in space are near each other, Morton's (1966); and which surfaces
are there twice, so that no ray could ever tell."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from cltrace.base.arrays import blockwise, empty
from cltrace.plan.rounding import Array, Mask

# From so many surfaces on, they are sorted by place. A shell of 100,000 spheres then takes 27 ms a frame instead of
# 37. One of 10,000 takes 10 either way, as all that a picture needs stays in a cache.
MANY = 4096
# Bits of a coordinate of triangles, of which most are larger than what more bits tell apart.
COARSE = 10
# One in so many spheres is looked at to know how good an order is.
SAMPLE = 16
# An odd number without a pattern, for marks.
ODD = np.uint64(0xD6E8FEB86659FD93)


def spatial_order(center: NDArray[Any]) -> NDArray[np.int32]:
    """The indices (n,) of points (n, 3) in the order of a curve through space, of which neighbours are near each other.

    Points of which so many bits are equal as a key has room for stay as they are.
    """
    index_bits = (len(center) - 1).bit_length()
    return _sorted(_codes(center, (63 - index_bits) // 3), index_bits)


def order_of_rows(center: NDArray[Any], which: NDArray[np.int32]) -> NDArray[np.int32]:
    """The order of points that are some rows of (n, 3), one row often several times: which, (k,), is one each.

    It is that of spatial_order(), but in coarser cells, of which a side has 2^-10 of the rows' extent.
    """
    return _sorted(_codes(center, COARSE).take(which), (len(which) - 1).bit_length())


def _sorted(key: NDArray[np.int64], index_bits: int) -> NDArray[np.int32]:
    """The indices of codes (n,) in their order; equal ones stay as they are. The codes are written over."""
    key <<= index_bits
    key |= np.arange(len(key))
    key.sort()
    key &= (1 << index_bits) - 1
    return key.astype(np.int32)


def _codes(center: NDArray[Any], bits: int) -> NDArray[np.int64]:
    """So many bits of each coordinate of points (n, 3) in turn, of their places in the box of all of them."""
    ends = blockwise(len(center), lambda block: [(x.min(), x.max()) for x in _axes(center[block])])
    low, high = np.min(ends, axis=0)[:, 0], np.max(ends, axis=0)[:, 1]
    # Halves, as the difference of two doubles may overflow.
    scale = (2**bits - 1) / max(1e-300, float((high / 2 - low / 2).max()))
    every_third, code = _every_third(bits), np.zeros(len(center), np.int64)

    def interleave(block: slice) -> None:
        for k, x in enumerate(_axes(center[block])):
            code[block] |= every_third.take(((x / 2 - low[k] / 2) * scale).astype(np.int32)) << k

    blockwise(len(center), interleave)
    return code


@cache
def _every_third(bits: int) -> NDArray[np.int64]:
    """Whole numbers of so many bits, with two zeros above each bit."""
    found = np.zeros(2**bits, np.int64)
    for bit in range(bits):
        found |= (np.arange(2**bits) >> bit & 1) << 3 * bit
    return found


def step(center: NDArray[np.float64]) -> float:
    """How far apart neighbours in an order are on average, of a sample: a share of the size of all of it."""
    one, other = center[:-1:SAMPLE], center[1::SAMPLE]
    size = max(1e-300, float(np.ptp(one / 2, axis=0).max()))
    return float(np.abs(other / 2 - one / 2).mean()) / size


def _axes(points: NDArray[Any]) -> NDArray[np.float64]:
    """(3, n): the coordinates of (n, 3)."""
    return np.ascontiguousarray(points.T, np.float64)


def gathered(column: NDArray[Any], order: NDArray[np.int32], shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """A column in an order (n,), as an array of `shape`, (n, ...). One value for all is there n times."""
    out = empty(shape, dtype)

    def gather(block: slice) -> None:
        out[block] = column if column.ndim < len(shape) else column.take(order[block], axis=0)

    blockwise(len(out), gather)
    return out


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
