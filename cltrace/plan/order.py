"""An order of surfaces in memory in which neighbours in space are near each other."""

from __future__ import annotations

from functools import cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from cltrace.base.arrays import BLOCK, blockwise, concurrently, empty, processors

# Bits of a digit of a code, five of each coordinate. About so many codes tell how large others are.
DIGIT, CODES = 15, 2**10
# From so many surfaces on, they are sorted by place. A shell of 100,000 spheres then takes 27 ms a frame instead of
# 37. One of 10,000 takes 10 either way, as all that a picture needs stays in a cache.
MANY = 4096
# Rows in one cell are sorted as one where that leaves no more than this share of them to sort.
FEWER = 0.75
# One in so many spheres is looked at to know how good an order is.
SAMPLE = 16


class Curve(NamedTuple):
    """How n points (x, y, z) become the whole numbers that are sorted.

    From the top, each has `bits` bits of each coordinate in turn, then the point's index, which has index_bits.
    A coordinate is (x / 2 - low / 2) * scale, as a whole number, of low (3,).
    """

    low: NDArray[np.float64]
    scale: float
    bits: int
    index_bits: int

    @classmethod
    def of(cls, n: int, low: NDArray[np.float64], high: NDArray[np.float64]) -> Curve:
        """low, high: (3,), the ends of the points' coordinates."""
        # Halves, as the difference of two doubles may overflow.
        size = max(1e-300, float((high / 2 - low / 2).max()))
        index_bits = (n - 1).bit_length()
        bits = (63 - index_bits) // 3
        return cls(low, (2**bits - 1) / size, bits, index_bits)


def spatial_order(center: NDArray[Any]) -> NDArray[np.int32]:
    """The indices (n,) of points (n, 3) in the order of a curve through space, of which neighbours are near each other.

    That is Morton's order (1966).
    """
    n = len(center)
    curve = Curve.of(n, *_ends(center))
    key = np.arange(n)

    def interleave(block: slice) -> None:
        key[block] |= _codes(center[block], curve) << curve.index_bits

    blockwise(n, interleave)
    return _sorted_low_bits(key, curve.index_bits)


def order_of_rows(center: NDArray[Any], which: NDArray[np.int32]) -> NDArray[np.int32]:
    """The order of points that are some rows of (n, 3), one row often several times: which, (k,), is one each.

    It is that of spatial_order(), but in coarser cells, of which a side has 2^-10 of the rows' extent.
    """
    low, high = _ends(center)
    curve = Curve(low, Curve.of(2 ** (63 - 2 * DIGIT), low, high).scale, 2 * DIGIT // 3, 0)
    codes = np.concatenate(blockwise(len(center), lambda block: _codes(center[block], curve).astype(np.int32)))
    code = np.concatenate(blockwise(len(which), lambda rows: codes.take(which[rows])))
    # Both triangles of a quad mostly begin at one corner. What follows each other in one cell is sorted as one.
    begin = np.flatnonzero(np.concatenate([code[:1] >= 0, code[1:] != code[:-1]])).astype(np.int32)
    if len(begin) > FEWER * len(code):
        return _sorted_codes(code)
    order = _sorted_codes(code.take(begin))
    count = np.diff(begin, append=np.int32(len(code))).take(order)
    first = begin.take(order) - (np.cumsum(count, dtype=np.int32) - count)
    return np.repeat(first, count) + np.arange(len(code), dtype=np.int32)


def _sorted_codes(code: NDArray[np.int32]) -> NDArray[np.int32]:
    """The indices of codes in their order; equal ones stay as they are."""
    parts = min(processors(), len(code) // BLOCK + 1)
    # Each processor sorts a part of the codes. Those of a sample tell where parts of about the same size end.
    some = np.sort(code[:: len(code) // CODES + 1])
    ends = [0, *(some[[len(some) * part // parts for part in range(1, parts)]].tolist()), 2 ** (2 * DIGIT)]
    return np.concatenate(concurrently([partial(_sorted_by_digits, code, *part) for part in pairwise(ends)]))


def _sorted_by_digits(code: NDArray[np.int32], low: int, high: int) -> NDArray[np.int32]:
    """The indices of codes from `low` to less than `high`, in their order; equal ones stay as they are."""
    order = np.flatnonzero((code >= low) & (code < high)).astype(np.int32)
    # The last digit comes first. Whole numbers of 16 bits take numpy about a sixth of the time of those of 64.
    for first in (0, DIGIT):
        digit = (code.take(order) >> first & 2**DIGIT - 1).astype(np.uint16)
        order = order.take(digit.argsort(kind="stable"))
    return order


def _ends(center: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(3,) each: the least and the largest coordinates of points (n, 3)."""
    ends = blockwise(len(center), lambda block: [(x.min(), x.max()) for x in _axes(center[block])])
    return np.min(ends, axis=0)[:, 0], np.max(ends, axis=0)[:, 1]


def _codes(center: NDArray[Any], curve: Curve) -> NDArray[np.int64]:
    """The bits of the coordinates of points (n, 3) in turn."""
    every_third = _every_third(curve.bits)
    code = np.zeros(len(center), np.int64)
    for k, x in enumerate(_axes(center)):
        place = (x / 2 - curve.low[k] / 2) * curve.scale
        code |= every_third.take(place.astype(np.int32)) << k
    return code


@cache
def _every_third(bits: int) -> NDArray[np.int64]:
    """Whole numbers of so many bits, with two zeros above each bit."""
    found = np.zeros(2**bits, np.int64)
    for bit in range(bits):
        found |= (np.arange(2**bits) >> bit & 1) << 3 * bit
    return found


def _sorted_low_bits(key: NDArray[np.int64], bits: int) -> NDArray[np.int32]:
    """So many of the lowest bits of each of the keys (n,), in their order. Each processor sorts a part, in place."""
    n, parts = len(key), min(processors(), len(key) // BLOCK + 1)
    edges = [n * part // parts for part in range(parts + 1)]
    if parts > 1:
        key.partition(edges[1:-1])
    order = np.empty(n, np.int32)

    def sort(part: slice) -> None:
        some = key[part]
        some.sort()
        some &= (1 << bits) - 1
        order[part] = some

    concurrently([partial(sort, slice(low, high)) for low, high in pairwise(edges)])
    return order


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
