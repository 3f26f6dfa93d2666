"""The bar of a colour map, with the numbers that its colours stand for."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from cltrace.scene import check_resolution
from cltrace.scene.colormaps import Scale, map_of, mapped
from cltrace.scene.colors import color_numbers
from cltrace.scene.rules import NOT_NEGATIVE, vector

TEXT, TICK, GAP = 13, 4, 3  # sizes of numbers, of the lines beside the bar, and of the gap between them, in pixels


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
