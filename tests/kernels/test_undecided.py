"""Pixels that double cannot decide, where a work-item has one pixel: a second program draws them, and only them."""

from __future__ import annotations

import numpy as np
import pytest
from hostile import bounced_regimes, cylinder_regimes, mesh_regimes
from hostile.sphere_regimes import EDGES, REGIMES
from stress_cases import channel, picture

import cltrace
from cltrace import Scene
from cltrace.picture.image import Image
from cltrace.run import executor
from cltrace.run.devices import Device
from cltrace.run.executor import Undecided
from cltrace.run.program import Program

SIZE = (48, 32)
# What takes pairs and whole numbers: spheres, triangles, their mirrors and shadows, cylinders.
SCENES: dict[str, Scene] = {
    "ties": dict(REGIMES + EDGES)["ties"](1, SIZE),
    "corners on rays": mesh_regimes.scene_of("corners on rays", 1, SIZE),
    "fans all but in planes": mesh_regimes.scene_of("fans all but in planes", 1, SIZE),
    "edges": cylinder_regimes.lit_of("edges", 1, SIZE),
    "touching exactly": next(bounced_regimes.scenes_of("touching exactly", 1, SIZE, 1)),
}


def differing(one: Image, other: Image) -> int:
    """In how many pixels any output differs."""
    pairs = [(channel(one, name), channel(other, name)) for name in one.outputs]
    return int(np.logical_or.reduce([(a != b).reshape(len(a), -1).any(1) for a, b in pairs]).sum())


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_the_second_program_draws_what_the_first_one_leaves(
    name: str, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All outputs are those of vectors, which one program draws, and some pixel was left."""
    left: list[bool] = []

    def is_any(self: Undecided) -> bool:
        left.append(of(self))
        return left[-1]

    of = Undecided.any
    monkeypatch.setattr(Undecided, "any", is_any)
    scene = SCENES[name]
    whole = picture(scene, device)
    assert left == []
    assert differing(picture(scene, device, width=1), whole) == 0
    assert any(left)


@pytest.mark.slow
def test_nothing_is_compiled_for_pictures_that_double_decides(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[list[str]] = []

    def program(device: Device, options: list[str]) -> Program:
        if "-DWITHOUT_RARE" not in options:
            made.append(options)
        return of(device, options)

    of = executor.program
    monkeypatch.setattr(executor, "program", program)
    scene = Scene.from_spheres(cltrace.Camera(resolution=SIZE), [cltrace.point_light((4, 4, 4))], [(0, 0.1, -3)], 1.0)
    picture(scene, device, width=1)
    assert made == []
    picture(SCENES["ties"], device, width=1)
    assert len(made) == 1


@pytest.mark.parametrize(
    ("width", "precision", "stages"), [(1, "accurate", 1), (1, "double", 1), (1, "single", 0), (8, "accurate", 0)]
)
def test_when_there_are_two_programs(width: int, precision: cltrace.plan.abi.Precision, stages: int) -> None:
    assert executor.is_in_stages(width, precision) == stages
