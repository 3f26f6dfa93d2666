"""What colours stand for, where a picture shows something else than colour, and the bar of a colour map.

Pictures of outputs are (h, w, 3) uint8.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene import check_resolution
from cltrace.scene.colormaps import Scale, map_of, mapped
from cltrace.scene.colors import color_numbers
from cltrace.scene.rules import NOT_NEGATIVE, vector

NEAR, FAR = 255, 32  # grey of the nearest and of the farthest depth
UNLIT = 48  # grey of what no light reaches
MAX_LIGHTS = 32  # that `light_sets` tells apart
TEXT, TICK, GAP = 13, 4, 3  # sizes of numbers, of the lines beside the bar, and of the gap between them, in pixels

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


def colorbar(
    cmap: Any = None,
    clim: ArrayLike | None = None,
    size: tuple[int, int] = (80, 256),
    *,
    norm: Any = None,
    ticks: bool = True,
    color: ArrayLike | str = "black",
) -> NDArray[np.uint8]:
    """(h, w, 4) uint8: the bar of a colour map, to put beside a picture; straight alpha, without gamma.

    cmap, clim, norm: as in Scene.from_spheres; without clim it is of 0 to 1, or of the norm's own limits; size:
    (width, height) in pixels. It stands upright, low values at the bottom, where it is at least as high as wide, and
    else lies, low values on the left. ticks: whether there are numbers beside or below it, in this color, round ones
    within clim, or where a norm spans some decades the powers of ten; the rest of the array is transparent. Without
    ticks all of it is bar: of a map of 256 colours, 256 pixels have one each.

    Raises ValueError, which names the argument, also where there is no room for the numbers, and MissingPackageError as
    Scene.from_spheres does.
    """
    from PIL import Image as Picture  # which pictures alone do without
    from PIL import ImageDraw, ImageFont

    width, height = check_resolution(size)
    scale = Scale.of(np.array([0.0, 1.0]), cmap, clim, norm)
    ink = vector("color", color_numbers("color", color), NOT_NEGATIVE)
    upright = height >= width
    length, across = (height, width) if upright else (width, height)
    marks = _ticks(scale, max(2, length // 50)) if ticks else []
    labels, font = [f"{mark:g}" for mark in marks], ImageFont.load_default(TEXT)
    wide, high = (max((math.ceil(font.getbbox(label)[k]) for label in labels), default=0) for k in (2, 3))
    along, margin = (high, wide) if upright else (wide, high)
    margin = TICK + GAP + margin if labels else 0
    # Along the bar from its low end, half a number stands out at either end; it is so many pixels broad and long.
    begin, broad = math.ceil(along / 2), across - margin
    long = length - 2 * begin
    if broad < 1 or long < 1:
        raise ValueError(f"size: must have room for the numbers, {margin} pixels, got {width}x{height}")
    shares = (np.arange(long) + 0.5) / long
    # A bar of steps is even in values, any other one in colours.
    even = scale if scale.steps is None else replace(scale, norm=None)
    span = scale.high - scale.low
    shown = mapped(map_of(cmap), shares) if even is scale else scale.colors(scale.low + shares * span)
    colors = np.rint(shown * 255).astype(np.uint8)
    page = Picture.new("L", (width, height))
    draw, end = ImageDraw.Draw(page), broad + TICK
    for label, share in zip(labels, even.shares(np.array(marks)) if span > 0 else [0.5] * len(marks), strict=True):
        at = begin + min(math.floor(share * long), long - 1)
        if upright:
            at = length - 1 - at
            draw.line((broad, at, end - 1, at), 255)
            draw.text((end + GAP, at), label, 255, font, "lm")
        else:
            draw.line((at, broad, at, end - 1), 255)
            draw.text((at, end + GAP), label, 255, font, "mt")
    pixels = np.empty((height, width, 4), np.uint8)
    pixels[..., :3], pixels[..., 3] = np.rint(np.minimum(ink, 1) * 255), np.asarray(page)
    # A view in which the bar stands upright with its low end on top.
    standing = pixels[::-1] if upright else pixels.swapaxes(0, 1)
    standing[begin : begin + long, :broad, :3] = colors[:, None]
    standing[begin : begin + long, :broad, 3] = 255
    return pixels


def _ticks(scale: Scale, most: int) -> list[float]:
    """Round numbers within a scale, at most so many: whole multiples of 1, 2 or 5 times a power of ten.

    Where a norm has steps, they are those. Where there is another one, and the upper end is at least 100 times the
    lower one, they are powers of ten.
    """
    low, high = scale.low, scale.high
    if not high > low:
        return [low]
    if scale.steps is not None:
        return [float(step) for step in scale.steps[:: math.ceil(len(scale.steps) / most)]]
    if scale.norm is not None and low > 0 and high >= 100 * low:
        first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
        every = math.ceil((last - first + 1) / most)
        return [min(max(10.0**k, low), high) for k in range(first, last + 1, every)]
    power = 10.0 ** math.floor(math.log10((high - low) / most))
    for step in (power, 2 * power, 5 * power, 10 * power):
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < most:
            break
    return [min(max(k * step, low), high) for k in range(first, last + 1)]
