"""Tiles: the picture in cells of 4x4 pixels [TILE = 4], each with the surfaces that its rays may meet, by depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS
from cltrace.plan.accel.cells import CellGrid, Members, Outlines, outlines_of, put_together, sprawling
from cltrace.plan.accel.silhouettes import SHIFT, Pictured, Silhouettes, Window
from cltrace.plan.rounding import Mask

# Pixels smaller than this, at z = -1, are too small for slopes in float32 to be divided by them.
TINY = 2.0**-64
# The same of parallel rays, in the float buffers' unit: there, the slack of float32 would be a few pixels.
FINE = 2.0**-18


def picture_tiles(shapes: Sequence[Silhouettes], among: Mask, window: Window) -> CellGrid:
    """The picture's grid.

    shapes: surfaces from the eye, in the order of SHAPES; among: (n,), which of all of them to enter. Those that cannot
    be seen are left out: those behind the eye, beside the region, or between the centres of pixels.
    """
    real = np.float32 if min(window.step) > (FINE if window.parallel else TINY) else np.float64
    parts, elsewhere = [], []
    for silhouettes in shapes:
        some, held = silhouettes.in_picture(among, window, real, partial(_entered, window))
        parts += some
        elsewhere += [held] if held else []
    grid = picture_grid(window.size, put_together(parts))
    polygons = any(silhouettes.has_corners for silhouettes in shapes)
    return replace(grid, polygons=polygons, held=elsewhere[0] if elsewhere else None)


def _entered(window: Window, part: Pictured) -> tuple[tuple[NDArray[Any], ...], Outlines | None]:
    """Members, covers and near of those that cover pixels, and their outlines."""
    covers, visible = np.empty((4, len(part.member)), np.int16), part.wanted
    for k, ((low, high), axis) in enumerate(zip(part.pixels, window.axes, strict=True)):
        begin = np.clip(np.ceil(low), axis.first, axis.stop)
        end = np.clip(np.floor(high), axis.first - 1, axis.stop - 1)
        visible &= begin <= end
        covers[k] = begin.astype(np.int32) >> SHIFT
        covers[2 + k] = (end.astype(np.int32) >> SHIFT) - covers[k]
    which = np.flatnonzero(visible)
    covers, outline = covers.take(which, axis=1), None
    if part.corner is not None:
        at = sprawling(covers)
        loose = part.loose[which[at]] if part.loose.ndim else part.loose
        outline = outlines_of(at, part.corner(which.take(at)), loose)
    return (part.member[which], covers, part.near(which)), outline


def picture_grid(size: tuple[int, int], members: Members) -> CellGrid:
    """The grid of a picture of so many pixels, (width, height)."""
    cells = (((size[0] - 1) >> SHIFT) + 1, ((size[1] - 1) >> SHIFT) + 1)
    none, tile = np.zeros(2), CONSTANTS["TILE"]
    return CellGrid(np.eye(3), none, none + 1, cells, **members._asdict(), perspective=True, pixels=tile)
