"""What tests of packing on a device share: lights of each kind, precisions, a CPU as a GPU, whether a device's view is
numpy's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyopencl as cl
import pytest
from numpy.typing import NDArray

import cltrace
from cltrace.plan.accel.grids import ONE_CELL_LEVEL
from cltrace.plan.view import CameraView
from cltrace.run.devices import Device
from cltrace.run.pack.toolbox import Toolbox

# Programs in single are others, and take as long to compile again.
PRECISIONS = ["accurate", pytest.param("single", marks=pytest.mark.slow)]
# Numpy makes other lists: tests/plan/test_lists.py and test_polygon_lists.py say what both have in common.
LISTS = {"grid", "start", "entry", "light_buffer"}
LIGHTS = [
    cltrace.ambient_light(),
    cltrace.parallel_light((-1, -2, -0.5)),
    cltrace.point_light((3, 4, 5)),
    cltrace.spot_light((0.1, 2.0, -0.3), (0, -1, 0), 20, 30),
]


class Gpu(Device):
    """A device that is taken for a GPU. It is equal to no other, so that programs that are kept are its own."""

    kind = property(lambda _: "gpu")  # type: ignore[assignment]


def check_same_view(view: CameraView, made: dict[str, cl.Buffer], tools: Toolbox, expected: CameraView) -> None:
    """Asserts that a view, with the buffers that a device made for it, has the bits of numpy's, but for lists."""
    assert made.keys() | view.arrays.keys() == expected.arrays.keys()
    found = view.arrays | {name: read(made, name, tools, expected.arrays[name]) for name in made}
    for name in expected.arrays.keys() - (LISTS if "entry" in made else set()):
        assert found[name].tobytes() == expected.arrays[name].tobytes(), name
    unseen = [{name: n for name, n in one.skipped.items() if "equal to others" in name} for one in (view, expected)]
    assert unseen[0] == unseen[1]
    assert (view.inside, view.values) == (expected.inside, expected.values)
    assert (view.region, view.exponent) == (expected.region, expected.exponent)


def made_lists(view: CameraView, made: dict[str, cl.Buffer], tools: Toolbox) -> list[tuple[bytes, bytes, bytes]]:
    """What lists_of() says of a view whose lists a device has made."""
    like = np.zeros(1, np.int32)
    return lists_of(view.arrays | {name: read(made, name, tools, like) for name in ("start", "entry")})


def read(made: dict[str, cl.Buffer], name: str, tools: Toolbox, like: NDArray[Any]) -> NDArray[Any]:
    """A buffer as an array with so many numbers, or, of lists, with all that there are."""
    dtype = like.dtype.base
    return tools.read(made[name], made[name].size // dtype.itemsize if name in LISTS else like.size, dtype)


def lists_of(arrays: dict[str, NDArray[Any]]) -> list[tuple[bytes, bytes, bytes]]:
    """Of each grid, its record, but for where its lists are; where these begin, from the first one on; and them all."""
    lists, entry = [], arrays["entry"].reshape(-1, 2)
    for record in arrays["grid"].copy():
        columns, rows, first, mask = record["cells"].tolist()
        record["cells"][2] = 0
        sides = [((columns - 1 >> k) + 1) * ((rows - 1 >> k) + 1) for k in range(16) if mask >> k & 1]
        cells = sum(sides) if mask and mask != 1 << ONE_CELL_LEVEL else 1
        start = arrays["start"].reshape(-1)[first : first + cells + 1]
        lists.append((record.tobytes(), (start - start[0]).tobytes(), entry[start[0] : start[-1]].tobytes()))
    return lists
