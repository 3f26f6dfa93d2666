"""What an image has beside the arrays that the kernel writes: made of these, on the host."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.picture.effects import Effects, Shares
from cltrace.scene import Scene, Vector
from cltrace.scene.colors import Transfer, decoded, encoded

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Composition:
    """How a Renderer makes its images.

    outputs: what an image has; background: linear (r, g, b); alpha: the background's, 0..1; transfer: the scene's;
    truncate: whether bytes are cut instead of rounded; effects: what is done to the colours.
    """

    outputs: tuple[str, ...]
    background: Vector
    alpha: float
    transfer: Transfer
    truncate: bool
    effects: Effects | None = None

    @classmethod
    def of(cls, outputs: tuple[str, ...], scene: Scene, truncate: bool, effects: Effects | None = None) -> Composition:
        """For what was asked of a scene. A picture in front of a background that lets through has its alpha, too.

        Raises ValueError where an error is wanted of colours with effects.
        """
        if effects and "error" in outputs:
            raise ValueError("outputs: error goes with neither outline nor fog, of which it knows nothing")
        more = ("rgba8",) if "rgb8" in outputs and scene.background_alpha < 1 else ()
        colored = not {"rgb8", "rgba8", "color", "alpha"}.isdisjoint(outputs)
        looks = (scene.background, scene.background_alpha, scene.transfer)
        return cls((*outputs, *more), *looks, truncate, effects if colored else None)

    @property
    def written(self) -> tuple[str, ...]:
        """What the kernel is asked for. It knows linear bytes only, so others are made of its colours."""
        curved = self.transfer != "linear" and not {"rgb8", "rgba8", "error"}.isdisjoint(self.outputs)
        straight = self.alpha < 1 and "color" in self.outputs
        color = ("color",) if curved or self.effects else ()
        return (*self.outputs, *color, *(("alpha",) if straight or self.effects else ()))

    def with_effects(self, written: Mapping[str, NDArray[Any]], shares: Shares) -> Mapping[str, NDArray[Any]]:
        """What the kernel has written, with the effects in it. shares: where they are."""
        assert self.effects
        covered = written["coverage"] if "coverage" in written else (written["id"] >= 0).astype(np.float32)
        color, covered = self.effects.applied(written["color"], covered, shares, self.background)
        found = {**written, "color": color, "coverage": covered}
        return found | ({"rgb8": self._bytes(np.clip(color, 0, 1))} if "rgb8" in written else {})

    def composed(self, written: Mapping[str, NDArray[Any]]) -> Arrays:
        """The arrays of an image. written: those of the kernel, by the names of abi.OUTPUTS."""
        if self.transfer != "linear" and "rgb8" in written:
            written = {**written, "rgb8": srgb_bytes(written["color"], self.truncate)}
        found = {name: array for name, array in written.items() if name in self.outputs}
        if self.transfer != "linear" and "error" in found:
            found["error"] = srgb_error(written["color"], written["error"])
        if "coverage" in written:
            return found | self._of_means(written)
        if "alpha" in self.outputs:
            found["alpha"] = np.where(written["id"] >= 0, np.float32(1), np.float32(self.alpha))
        if "rgba8" in self.outputs:
            level = np.uint8(self.alpha * 255 + (0.0 if self.truncate else 0.5))
            found["rgba8"] = joined(written["rgb8"], np.where(written["id"] >= 0, np.uint8(255), level))
        return found

    def _of_means(self, written: Mapping[str, NDArray[Any]]) -> Arrays:
        """alpha and rgba8 of an antialiased picture, and with alpha below 1 straight colours, where they are wanted.

        A mean colour is k S + (1 - k) B, for a share k of surfaces of the colour S. In front of nothing, with the
        background's alpha a, it is (k S + (1 - k) a B) / alpha, and alpha is k + (1 - k) a.
        """
        found: Arrays = {}
        rest = (1 - written["coverage"]) * np.float32(1 - self.alpha)
        alpha = 1 - rest
        if "alpha" in self.outputs:
            found["alpha"] = alpha
        if "color" not in written:
            return found
        color = written["color"]
        if self.alpha < 1:
            behind = np.minimum(np.array(self.background, np.float32), 1)
            seen = (color - rest[..., None] * behind) / np.maximum(alpha, np.float32(2.0**-24))[..., None]
            color = np.clip(np.where(alpha[..., None] > 0, seen, behind), 0, 1, dtype=np.float32)
            found |= {"color": color} if "color" in self.outputs else {}
        if "rgba8" in self.outputs:
            level = (alpha * 255 + (0.0 if self.truncate else 0.5)).astype(np.uint8)
            rgb8 = written["rgb8"] if self.alpha == 1 and "rgb8" in written else self._bytes(color)
            found |= {"rgba8": joined(rgb8, level)} | ({"rgb8": rgb8} if "rgb8" in self.outputs else {})
        return found

    def _bytes(self, color: NDArray[np.float32]) -> NDArray[np.uint8]:
        """The bytes of linear colours, 0..1."""
        if self.transfer != "linear":
            return srgb_bytes(color, self.truncate)
        return (color * 255 + (0.0 if self.truncate else 0.5)).astype(np.uint8)


def joined(rgb8: NDArray[np.uint8], alpha: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(h, w, 4) of (h, w, 3) and (h, w)."""
    rgba8 = np.empty((*alpha.shape, 4), np.uint8)

    def join(rows: slice) -> None:
        for k in range(3):  # one after the other is faster than all three
            rgba8[rows, :, k] = rgb8[rows, :, k]
        rgba8[rows, :, 3] = alpha[rows]

    blockwise(len(alpha), join, max(1, 2**17 // max(1, alpha.shape[1])))
    return rgba8


# Bytes of linear colours as sRGB

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
