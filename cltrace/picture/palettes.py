"""What colours stand for, where a picture shows something else than colour. All are (h, w, 3) uint8."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEAR, FAR = 255, 32  # grey of the nearest and of the farthest depth
UNLIT = 48  # grey of what no light reaches
MAX_LIGHTS = 32  # that `light_sets` tells apart

Colors = NDArray[np.uint8]


def directions(v: NDArray[np.floating], axes: NDArray[np.float64] | None = None) -> Colors:
    """Unit vectors (h, w, 3) as (v + 1)/2, red for x, green for y and blue for z; 0 is black.

    axes: (3, 3), whose rows are the axes along which they are shown; None for those of the world.
    """
    values = np.asarray(v, np.float64)
    seen = values if axes is None else values @ axes.T
    bytes_ = np.rint((seen + 1) * 127.5)
    return np.where(np.any(values != 0, axis=-1, keepdims=True), bytes_, 0).astype(np.uint8)


def depth_range(depth: NDArray[np.float64]) -> tuple[float, float] | None:
    """The nearest and the farthest depth of (h, w), or None where nothing was hit."""
    hit = np.isfinite(depth)
    ends = depth.min(initial=np.inf, where=hit), depth.max(initial=-np.inf, where=hit)
    return (float(ends[0]), float(ends[1])) if hit.any() else None


def grey(depth: NDArray[np.float64], ends: tuple[float, float] | None) -> Colors:
    """Depths (h, w) as grey, 255 for the nearest one, 32 for the farthest one, 0 for nothing. ends: of depth_range().

    In between it is FAR + (NEAR - FAR) (1/depth - 1/farthest) / (1/nearest - 1/farthest): in the reciprocal, what is
    near keeps its contrast, however far the horizon is.
    """
    if ends is None:
        return np.zeros((*depth.shape, 3), np.uint8)
    hit, near, far = np.isfinite(depth), 1 / ends[0], 1 / ends[1]
    share = (1 / np.where(hit, depth, ends[1]) - far) / (near - far if near > far else 1.0)
    value = np.where(hit, np.rint(FAR + (NEAR - FAR) * share), 0).astype(np.uint8)
    return np.repeat(value[..., None], 3, axis=-1)


def wrapped(uv: NDArray[np.float64]) -> Colors:
    """u and v, (h, w, 2), as red and green, without their whole parts."""
    colors = np.zeros((*uv.shape[:2], 3), np.uint8)
    colors[..., :2] = np.rint((uv - np.floor(uv)) * 255)
    return colors


def distinct(index: NDArray[np.integer]) -> Colors:
    """Indices (h, w) as colours, of which neighbouring ones differ much; -1 is black.

    Of k = (index + 1) * 0x9E3779B97F4A7C15 mod 2^64, three of the highest bytes are c = (k >> 56, k >> 48, k >> 40) mod
    256, and the colour is 64 + 3 c / 4, rounded down.
    """
    mixed = ((index.astype(np.uint64) + 1) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    colors = np.stack([(mixed >> np.uint64(s)) & np.uint64(255) for s in (16, 8, 0)], axis=-1)
    return np.where(index[..., None] < 0, 0, 64 + colors * 3 // 4).astype(np.uint8)


def light_sets(lit: NDArray[np.bool_], seen: NDArray[np.bool_]) -> Colors:
    """Which lights reach a pixel, (h, w, n), as a colour for each set of lights. seen: (h, w), where a surface is.

    Up to three lights are red, green and blue, which add up: yellow is the first and the second one. Of more,
    at most MAX_LIGHTS, each set has the colour that distinct() has for the sum of 2^k over its lights k = 0, 1, ...
    What no light reaches is dark grey, and where no surface is it is black.
    """
    count = lit.shape[-1]
    if count > MAX_LIGHTS:
        raise ValueError(f"lit: must be of at most {MAX_LIGHTS} lights, got {count}")
    if count <= 3:
        colors = np.zeros((*seen.shape, 3), np.uint8)
        colors[..., :count] = np.where(lit, 255, 0)
    else:
        colors = distinct((lit * (1 << np.arange(count))).sum(axis=-1))
    colors[~lit.any(axis=-1)] = UNLIT
    colors[~seen] = 0
    return colors
