"""An order of surfaces in memory in which neighbours in space are near each other."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from cltrace.blocks import BLOCK, blockwise, concurrently, empty, processors

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


def spatial_order(center: NDArray[Any], which: NDArray[np.int32] | None = None) -> NDArray[np.int32]:
    """The indices (n,) of points (n, 3) in the order of a curve through space, of which neighbours are near each other.

    That is Morton's order (1966). which: (n,), the rows of `center` that are the points; None for all of them.
    """
    n = len(center) if which is None else len(which)

    def axes(block: slice) -> NDArray[np.float64]:
        return _axes(center[block] if which is None else center.take(which[block], axis=0))

    ends = blockwise(n, lambda block: [(x.min(), x.max()) for x in axes(block)])
    curve = Curve.of(n, np.min(ends, axis=0)[:, 0], np.max(ends, axis=0)[:, 1])
    low, scale, bits, index_bits = curve.low, curve.scale, curve.bits, curve.index_bits
    every_third = np.zeros(2**bits, np.int64)
    for bit in range(bits):
        every_third |= (np.arange(2**bits) >> bit & 1) << 3 * bit + index_bits
    key = np.arange(n)

    def interleave(block: slice) -> None:
        for k, x in enumerate(axes(block)):
            place = (x / 2 - low[k] / 2) * scale
            key[block] |= every_third.take(place.astype(np.int32)) << k

    blockwise(n, interleave)
    return _sorted_low_bits(key, index_bits)


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
