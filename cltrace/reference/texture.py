"""Images on surfaces."""

from __future__ import annotations

import math
from typing import NamedTuple

from cltrace.reference.vectors import Color
from cltrace.scene import FULL
from cltrace.scene import Texture as Texels

UV = tuple[float, float]


class Lookup(NamedTuple):
    """x, y: the pixel at the upper left of the four that are mixed; right, down: the shares of those to the right of it
    and below; color: the mixture."""

    x: int
    y: int
    right: float
    down: float
    color: Color


class Texture:
    """An image that repeats: u = 0..1 is its width from left to right, v = 0..1 its height from top to bottom.

    u = i / W is exactly column i of W, and v = j / H row j. In between, the four pixels around are mixed by how near
    they are: bilinear interpolation.

    texels: (H, W, 3), of uint8, uint16 or int16, of which FULL says what full colour is.
    """

    def __init__(self, texels: Texels) -> None:
        self.texels, self.full = texels, FULL[texels.dtype]

    def lookup(self, uv: UV) -> Lookup:
        """The colour at (u, v), 1 = full in each channel, and how it comes about."""
        height, width = self.texels.shape[:2]
        # The image repeats, so whole parts do not matter. Without them, large numbers keep the digits behind.
        x, y = (uv[0] - math.floor(uv[0])) * width, (uv[1] - math.floor(uv[1])) * height
        i, j = math.floor(x), math.floor(y)
        upper = _mix(self.texel(i, j), self.texel(i + 1, j), x - i)
        lower = _mix(self.texel(i, j + 1), self.texel(i + 1, j + 1), x - i)
        return Lookup(i % width, j % height, right=x - i, down=y - j, color=_mix(upper, lower, y - j))

    def texel(self, i: int, j: int) -> Color:
        """The pixel in column i and row j, both counted on beyond the image."""
        height, width = self.texels.shape[:2]
        red, green, blue = self.texels[j % height, i % width].tolist()
        return (red / self.full, green / self.full, blue / self.full)


def _mix(a: Color, b: Color, share: float) -> Color:
    """a for share = 0, b for 1."""
    red, green, blue = (x + share * (y - x) for x, y in zip(a, b, strict=True))
    return (red, green, blue)
