"""Bytes of linear colours, by the scene's transfer curve."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.scene.colors import decoded, encoded

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


def srgb_error(color: NDArray[np.float32], error: NDArray[np.float32]) -> NDArray[np.float32]:
    """(h, w): what sRGB colours are off by at most, in levels of 255, if no channel of linear ones (h, w, 3) is off by
    more than `error` levels (h, w).

    The curve rises, so what is farthest off is an end of what the linear colour may be.
    """
    off = np.empty(error.shape, np.float32)

    def convert(rows: slice) -> None:
        c, e = color[rows].astype(np.float64), error[rows].astype(np.float64)[..., None] / 255
        low, mean, high = (encoded(np.clip(x, 0, 1), "srgb") for x in (c - e, c, c + e))
        most = 255 * np.maximum(mean - low, high - mean).max(axis=-1)
        off[rows] = np.nextafter(most.astype(np.float32), np.float32(np.inf))

    blockwise(len(color), convert, max(1, 2**16 // max(1, color[:1].size)))
    return off


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
