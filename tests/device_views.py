"""What tests of packing on a device share: lights of each kind, and whether a device's view is numpy's."""

from __future__ import annotations

import pyopencl as cl

import cltrace
from cltrace.plan.plan import View
from cltrace.run.toolbox import Toolbox

LIGHTS = [
    cltrace.ambient_light(),
    cltrace.parallel_light((-1, -2, -0.5)),
    cltrace.point_light((3, 4, 5)),
    cltrace.spot_light((0.1, 2.0, -0.3), (0, -1, 0), 20, 30),
]


def check_same_view(view: View, made: dict[str, cl.Buffer], tools: Toolbox, expected: View) -> None:
    """Asserts that a view, with the buffers that a device made for it, has the bits of numpy's."""
    assert made.keys() | view.arrays.keys() == expected.arrays.keys()
    for name, array in expected.arrays.items():
        found = tools.read(made[name], array.size, array.dtype.base) if name in made else view.arrays[name]
        assert found.tobytes() == array.tobytes(), name
    assert (view.skipped, view.inside, view.values) == (expected.skipped, expected.inside, expected.values)
    assert (view.region, view.exponent) == (expected.region, expected.exponent)
