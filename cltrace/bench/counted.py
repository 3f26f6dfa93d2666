"""Counted work: exact numbers that say what a frame takes, without a clock.

They are of packets of one pixel, as GPUs have them, and are the same on all drivers: only which of its tests float32
decides depends on how a driver rounds, so these are counted together.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from cltrace.plan.abi import COUNTERS
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import choose

from .points import Work
from .scenes import MILLION, Case, generated

SIZE = (160, 90)
# Counters that depend on a driver's rounding, but for their sum, and the arrays whose sizes are entries of lists.
TESTS, LISTS = ("FILTERED", "DECIDED"), ("start", "entry", "node")


def cases() -> list[Case]:
    """The first scene of each class of the benchmark, but of the largest."""
    first = {case.group: case for case in reversed(generated(SIZE)) if case.task == "frame" and case.group != MILLION}
    return list(reversed(first.values()))


def jobs(spec: str) -> list[Callable[[], Work]]:
    """For each of these scenes, what says what a frame takes on this device, in any process."""
    return [partial(count, case, spec) for case in cases()]


def count(case: Case, spec: str) -> Work:
    """What one frame takes."""
    renderer = Renderer(case.scene, choose(spec), width=1)
    work = renderer.work()
    tests = sum(work.pop(COUNTERS[name]) for name in TESTS)
    sizes = {f"entries of {name}": renderer.plan.arrays[name].size for name in LISTS if name in renderer.plan.arrays}
    counts = {"tests of surfaces": tests, **work, **sizes}
    return {f"{case.group}: {case.name}": {name: int(n) for name, n in counts.items() if n}}
