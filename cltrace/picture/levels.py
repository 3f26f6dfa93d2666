"""Bytes of linear colours, by the scene's transfer curve."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from cltrace.blocks import blockwise
from cltrace.scene.colors import decoded

# A float's bits without the last 15 rise with it, and say in which of these buckets it is: from 2^-13 to 1, where the
# curve has no two levels in one.
SHIFT = 15
LOW, HIGH = (int(np.float32(x).view(np.int32)) >> SHIFT for x in (2.0**-13, 1.0))


def srgb_bytes(color: NDArray[np.float32], truncate: bool) -> NDArray[np.uint8]:
    """uint8 of the same shape: 255 times linear colours as sRGB, rounded, or cut to whole numbers.

    They are compared with the linear colours at which the levels begin, which is exact but for the curve's own doubles.
    """
    first, begin = _tables(truncate)
    levels = np.empty(color.shape, np.uint8)

    def convert(rows: slice) -> None:
        c = color[rows]
        bucket = np.clip((np.ascontiguousarray(c).view(np.int32) >> SHIFT) - LOW, 0, HIGH - LOW)
        level = first[bucket]
        levels[rows] = level + (c >= begin[level])

    blockwise(len(color), convert, max(1, 2**18 // max(1, color[:1].size)))
    return levels


@functools.cache
def _tables(truncate: bool) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """The level at each bucket's begin, and the least float32 of the level after each: infinity after 255."""
    exact = decoded((np.arange(1, 256) - (0.0 if truncate else 0.5)) / 255, "srgb")
    least = exact.astype(np.float32)
    least = np.where(least < exact, np.nextafter(least, np.float32(np.inf)), least)
    starts = (np.arange(LOW, HIGH + 1, dtype=np.int32) << SHIFT).view(np.float32)
    first = np.searchsorted(least, starts, side="right").astype(np.uint8)
    first[0] = 0  # of 0, and of all that is less than 2^-13
    return first, np.append(least, np.float32(np.inf))
