"""Tiles: the picture in cells of 4x4 pixels [TILE = 4], each with the spheres that its rays may meet, nearest first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS
from cltrace.plan.accel.cells import BLOCK, SLACK, CellGrid, Mask, joined
from cltrace.plan.exact import blockwise
from cltrace.plan.request import Region
from cltrace.plan.shapes.sphere import Seen, length, nearest, slopes

# Pixels smaller than this, at z = -1, are too small for slopes in float32 to be divided by them.
TINY = 2.0**-64
SHIFT = CONSTANTS["TILE"].bit_length() - 1


@dataclass(frozen=True)
class Window:
    """What of the image plane is to be drawn.

    step: half of a pixel's width and height on the image plane z = -1; size: (width, height) of the whole picture in
    pixels; region: the part of it that is wanted.
    """

    step: tuple[float, float]
    size: tuple[int, int]
    region: Region


def picture_tiles(seen: Seen, among: Mask, window: Window) -> CellGrid:
    """The picture's grid. seen: from the eye, in camera space; among: (n,), which spheres to enter.

    Spheres that cannot be seen are left out: those behind the eye, beside the region, or between the centres of pixels.
    """
    step, size, (left_most, top_most, width, height) = window.step, window.size, window.region
    bounds = ((left_most, left_most + width), (top_most, top_most + height))
    real = np.float32 if min(step) > TINY else np.float64

    def see(block: slice) -> tuple[NDArray[Any], ...]:
        exact, exact_r = np.ascontiguousarray(seen.center[block].T), seen.radius[block]
        x, y, z = exact.astype(real)
        r, gap = exact_r.astype(real), ((exact[2] - exact_r) * (exact[2] + exact_r)).astype(real)
        covers = np.empty((4, len(r)), np.int16)
        # More than z < r, as the eye may be inside by less than the rounding of the centre.
        visible = (exact[2] < exact_r * (1 + SLACK)) & among[block]
        left, right, top, bottom = slopes([x, -y], -z, r, gap)
        for k, (low, high) in enumerate(((left, right), (top, bottom))):
            slack = (np.abs(low) + np.abs(high)) * real(SLACK)
            # Pixel i is at slope (2i + 1 - n) step. The product and the sum below are rounded, each by 2^-24 of up to
            # 2^16 pixels, which 1/64 of a pixel covers; what is off by more is beyond the picture, and clipped.
            scale, middle = 0.5 / step[k], (size[k] - 1) / 2
            first, stop = bounds[k]
            begin = np.clip(np.ceil((low - slack) * scale + (middle - 1 / 64)), first, stop)
            end = np.clip(np.floor((high + slack) * scale + (middle + 1 / 64)), first - 1, stop - 1)
            visible &= begin <= end
            covers[k] = begin.astype(np.int32) >> SHIFT
            covers[2 + k] = (end.astype(np.int32) >> SHIFT) - covers[k]
        which = np.flatnonzero(visible)
        near = nearest(length(x, y, z)[which], r[which], seen.power[block][which])
        return (block.start + which).astype(np.int32), covers.take(which, axis=1), near

    member, covers, near = joined(blockwise(len(seen.center), see, BLOCK))
    cells = (((size[0] - 1) >> SHIFT) + 1, ((size[1] - 1) >> SHIFT) + 1)
    return CellGrid(np.eye(3), np.zeros(2), np.ones(2), cells, member, covers, near, True)
