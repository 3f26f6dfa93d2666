"""An order of surfaces in memory in which neighbours in space are near each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cltrace.blocks import blockwise
from cltrace.plan.exact import Array


def spatial_order(center: Array) -> NDArray[np.int64]:
    """The indices (n,) of points (n, 3) in the order of a curve through space, of which neighbours are near each other.

    That is Morton's order (1966).
    """
    n, axes = len(center), center.T
    low = [float(x.min()) for x in axes]
    # Halves, as the difference of two doubles may overflow.
    size = max(1e-300, *(float(x.max()) / 2 - least / 2 for x, least in zip(axes, low, strict=True)))
    # One whole number for each point is sorted. From the top it has the bits of the three coordinates in turn, then the
    # point's index.
    index_bits = (n - 1).bit_length()
    bits = (63 - index_bits) // 3
    every_third = np.zeros(2**bits, np.int64)
    for bit in range(bits):
        every_third |= (np.arange(2**bits) >> bit & 1) << 3 * bit + index_bits
    scale, key = (2**bits - 1) / size, np.arange(n)

    def interleave(block: slice) -> None:
        for k in range(3):
            place = (axes[k][block] / 2 - low[k] / 2) * scale
            key[block] |= every_third[place.astype(np.int32)] << k

    blockwise(n, interleave)
    key.sort()
    key &= (1 << index_bits) - 1
    return key
