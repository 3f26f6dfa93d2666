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
    layout = _Layout(upright, length, across, [f"{m:g}" for m in marks])
    if layout.bar < 1:
        raise ValueError(f"size: must have room for the numbers, {layout.margin} pixels, got {width}x{height}")
    shares = (np.arange(layout.end - layout.begin) + 0.5) / (layout.end - layout.begin)
    # A bar of steps is even in values, any other one in colours.
    even = scale if scale.steps is None else replace(scale, norm=None)
    span = scale.high - scale.low
    shown = mapped(map_of(cmap), shares) if even is scale else scale.colors(scale.low + shares * span)
    colors = np.rint(shown * 255).astype(np.uint8)
    pixels = np.zeros((height, width, 4), np.uint8)
    pixels[..., :3] = np.rint(np.minimum(ink, 1) * 255)
    places = even.shares(np.array(marks)).tolist() if span > 0 else [0.5] * len(marks)
    pixels[..., 3] = layout.drawn(places)
    if upright:
        rows = slice(height - layout.end, height - layout.begin)
        pixels[rows, : layout.bar, :3], pixels[rows, : layout.bar, 3] = colors[::-1, None], 255
    else:
        columns = slice(layout.begin, layout.end)
        pixels[: layout.bar, columns, :3], pixels[: layout.bar, columns, 3] = colors, 255
    return pixels


class _Layout:
    """Where the parts of a bar are. length, across: of all of it, in pixels, along the bar and across it.

    begin, end: of the bar, along it, from its low end; bar: how broad it is; margin: what its numbers take across.
    """

    def __init__(self, upright: bool, length: int, across: int, labels: list[str]) -> None:
        self.upright, self.length, self.across, self.labels = upright, length, across, labels
        self.font = ImageFont.load_default(TEXT)
        boxes = [self.font.getbbox(label) for label in labels]
        wide = max((math.ceil(box[2]) for box in boxes), default=0)
        high = max((math.ceil(box[3]) for box in boxes), default=0)
        self.margin = TICK + GAP + (wide if upright else high) if labels else 0
        self.bar = across - self.margin
        # Half a number stands out at either end.
        self.begin = math.ceil((high if upright else wide) / 2)
        self.end = length - self.begin
        if self.end <= self.begin:
            self.bar = 0

    def drawn(self, shares: list[float]) -> NDArray[np.uint8]:
        """The ink of the numbers and their lines, 0..255: shares of the bar's length."""
        size = (self.across, self.length) if self.upright else (self.length, self.across)
        page = Picture.new("L", size)
        draw = ImageDraw.Draw(page)
        for label, share in zip(self.labels, shares, strict=True):
            at = self.begin + min(math.floor(share * (self.end - self.begin)), self.end - self.begin - 1)
            far = self.bar + TICK - 1
            if self.upright:
                at = self.length - 1 - at
                draw.line((self.bar, at, far, at), 255)
                draw.text((far + 1 + GAP, at), label, 255, self.font, "lm")
            else:
                draw.line((at, self.bar, at, far), 255)
                draw.text((at, far + 1 + GAP), label, 255, self.font, "mt")
        return np.asarray(page)


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
