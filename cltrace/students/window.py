"""A picture inside a screenshot of its window: where it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]

LARGEST = 2**24  # pixels of a screenshot, in which every place is tried
_PROBES, _FIRST = 400, 24  # pixels that are looked at in the best places, and in every place
_BEST = 64  # places that are looked at again
_STEP = 16  # levels by which these differ from a neighbour: where all is alike, all places fit
_NEAR = 8  # levels by which they may be off, so that a mistake of the colours is found in its window, too
_FITS = 0.6  # of them, at least, that are right in the place where the picture is


class Window(NamedTuple):
    """Width and height of a screenshot, and where in it the picture begins, from its left and its top, in pixels."""

    width: int
    height: int
    x: int
    y: int


def place_within(mine: Bytes, right: Bytes) -> tuple[int, int] | None:
    """Column and row of the screenshot, (H, W, 3), where the right picture, (h, w, 3), fits best; None if it does not.

    Of places that fit equally well, the first. A picture without any edge fits everywhere, and so nowhere.
    """
    y, x = _telling(right)
    if len(x) < _FIRST:
        return None
    down, across = (m - r + 1 for m, r in zip(mine.shape, right.shape[:2], strict=False))
    hits = np.zeros((down, across), np.int32)
    for i, j in zip(y[:_FIRST].tolist(), x[:_FIRST].tolist(), strict=True):
        hits += (np.abs(mine[i : i + down, j : j + across].astype(np.int16) - right[i, j]) <= _NEAR).all(axis=2)
    places = np.argsort(-hits, axis=None, kind="stable")[:_BEST]
    shares = []
    for row, column in zip(*np.unravel_index(places, hits.shape), strict=True):
        seen = mine[row + y, column + x].astype(np.int16)
        shares.append(float((np.abs(seen - right[y, x]) <= _NEAR).all(axis=1).mean()))
    best = int(np.argmax(shares))
    row, column = divmod(int(places[best]), across)
    return (column, row) if shares[best] >= _FITS else None


def _telling(right: Bytes) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of some pixels that differ from their neighbours, always the same ones, in no order."""
    levels = right.astype(np.int16)
    edges = np.zeros(right.shape[:2], np.bool_)
    edges[:, 1:] |= np.abs(np.diff(levels, axis=1)).max(axis=2) >= _STEP
    edges[1:] |= np.abs(np.diff(levels, axis=0)).max(axis=2) >= _STEP
    some = np.random.default_rng(0).permutation(np.flatnonzero(edges))[:_PROBES]
    return np.divmod(some, right.shape[1])
