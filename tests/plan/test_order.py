"""The order of spheres in memory."""

from __future__ import annotations

import numpy as np
import pytest

from cltrace.plan import order
from cltrace.plan.order import order_of_rows, spatial_order, step


@pytest.mark.parametrize("processors", [1, 2, 7])
@pytest.mark.parametrize("points", ["apart", "in pairs", "in one place"])
def test_an_order_is_the_same_on_any_number_of_processors(
    points: str, processors: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Equal points stay in the scene's order."""
    n = 3 * order.BLOCK
    center = np.random.default_rng(0).normal(size=(n, 3))
    if points == "in pairs":
        center[n // 2 :] = center[: n - n // 2]
    if points == "in one place":
        center[:] = 1
    monkeypatch.setattr(order, "processors", lambda: 1)
    want = spatial_order(center)
    monkeypatch.setattr(order, "processors", lambda: processors)
    found = spatial_order(center)
    assert np.array_equal(found, want)
    assert np.array_equal(np.sort(found), np.arange(n))
    if points != "apart":
        place = np.empty(n, int)
        place[found] = np.arange(n)
        assert (place[n // 2 :] > place[: n - n // 2]).all()
    else:
        assert step(center[found]) < step(center) / 10


@pytest.mark.parametrize("processors", [1, 2, 7])
@pytest.mark.parametrize("together", [1, 2])
def test_rows_are_in_the_order_of_a_curve(together: int, processors: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of places in cells of 2^-10 of a cube, the bits of the coordinates in turn rise; those in one cell stay.

    together: how many of those that follow each other are in one cell, or more.
    """
    rng = np.random.default_rng(3)
    place = np.concatenate([[[0, 0, 0], [1023, 1023, 1023]], rng.integers(0, 1024, (500, 3))])
    which = rng.integers(0, len(place), 3 * order.BLOCK // together).astype(np.int32).repeat(together)
    bits = place[:, :, None] >> np.arange(10) & 1
    code = (bits << 3 * np.arange(10) + np.arange(3)[:, None]).sum(axis=(1, 2))
    monkeypatch.setattr(order, "processors", lambda: processors)
    found = order_of_rows(place.astype(np.float64), which)
    assert np.array_equal(found, np.argsort(code[which], kind="stable"))
