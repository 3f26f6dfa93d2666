"""The order of spheres and triangles in memory."""

from __future__ import annotations

import numpy as np
import pytest

from cltrace.base.arrays import BLOCK
from cltrace.plan.order import order_of_rows, spatial_order, step


@pytest.mark.parametrize("points", ["apart", "in pairs", "in one place", "far apart"])
def test_neighbours_are_near_each_other(points: str) -> None:
    """Equal points stay in the scene's order."""
    n, rng = 3 * BLOCK, np.random.default_rng(0)
    center = rng.normal(size=(n, 3))
    if points == "in pairs":
        center[n // 2 :] = center[: n - n // 2]
    if points == "in one place":
        center[:] = 1
    if points == "far apart":
        center *= 10 ** rng.uniform(-300, 308, (n, 1)) / 10
    found = spatial_order(center)
    assert np.array_equal(np.sort(found), np.arange(n))
    if points in ("in pairs", "in one place"):
        place = np.empty(n, int)
        place[found] = np.arange(n)
        assert (place[n // 2 :] > place[: n - n // 2]).all()
    if points == "apart":
        assert step(center[found]) < step(center) / 10


@pytest.mark.parametrize("together", [1, 2])
def test_rows_are_in_the_order_of_a_curve(together: int) -> None:
    """Of places in cells of 2^-10 of a cube, the bits of the coordinates in turn rise; those in one cell stay.

    together: how many of those that follow each other are in one cell, or more.
    """
    rng = np.random.default_rng(3)
    place = np.concatenate([[[0, 0, 0], [1023, 1023, 1023]], rng.integers(0, 1024, (500, 3))])
    which = rng.integers(0, len(place), 3 * BLOCK // together).astype(np.int32).repeat(together)
    bits = place[:, :, None] >> np.arange(10) & 1
    code = (bits << 3 * np.arange(10) + np.arange(3)[:, None]).sum(axis=(1, 2))
    found = order_of_rows(place.astype(np.float64), which)
    assert np.array_equal(found, np.argsort(code[which], kind="stable"))
