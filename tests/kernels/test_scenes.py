"""The scenes: each one's header comment states answers, and they are what comes out."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from answers import answers
from conftest import SCENES, world
from stress_cases import picture

import cltrace
from cltrace.reference import byte_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device


def test_there_are_scenes_and_they_are_small() -> None:
    assert len(SCENES) >= 12
    assert all(path.stat().st_size < 500_000 for path in SCENES)


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_scene_says_what_it_shows_and_names_its_picture(path: Path) -> None:
    text = path.read_text("utf-8")
    assert re.match(r"<\?xml[^>]*\?>\s*(<!DOCTYPE[^>]*>\s*)?<!--", text)
    assert cltrace.load(path).output_file == f"{path.stem}.png"
    assert answers(path)


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_answers_of_the_reference(path: Path) -> None:
    scene = cltrace.load(path)
    for (x, y), rgb in answers(path):
        color, _ = trace(world(scene), primary_ray(scene.camera, x, y))
        assert tuple(byte_of(c) for c in color) == rgb, (x, y)


# Each scene and precision is a program of its own, a second to compile, and several with meshes. An ordinary run draws
# some; test_consistency.py has others in single precision, by one program.
FIRST = {
    "accurate": ("first", "globe", "minimal", "step3-shadows"),
    "double": ("first",),
    "single": (),
}
# The slow run draws all in the usual precision, and these in single.
LONG = {("single", "bounces"), ("single", "first")}
DRAWN = [
    pytest.param(
        precision,
        path,
        id=f"{precision}-{path.stem}",
        marks=()
        if path.stem in FIRST[precision]
        else pytest.mark.slow
        if precision == "accurate" or (precision, path.stem) in LONG
        else pytest.mark.stress,
    )
    for precision in ("accurate", "double", "single")
    for path in SCENES
]


@pytest.mark.parametrize(("precision", "path"), DRAWN)
def test_answers_of_the_kernel(device: Device, precision: str, path: Path) -> None:
    """And no bit of what is drawn depends on what the kernel can do beyond what the scene needs.

    Which parts those are does not depend on the precision, so that in the others a few scenes are enough.
    """
    scene = cltrace.load(path)
    image = picture(scene, device, precision)
    if precision == "accurate" or path.stem in FIRST[precision] or (precision, path.stem) in LONG:
        assert np.array_equal(cltrace.render(scene, device, precision).rgb8, image.rgb8)
    for (x, y), rgb in answers(path):
        assert tuple(image.rgb8[y, x].tolist()) == rgb, (x, y)


def test_highlights_in_double_are_the_reference_s_to_all_digits_of_float(device: Device) -> None:
    """Of a low exponent, whose highlight covers the ball: cosines from 0.4 to 1, of which a power is taken."""
    light = cltrace.point_light((2, 3, 4), (1, 1, 1))
    camera = cltrace.Camera((0, 0, 4), (0, 0, 0), fov=40, resolution=(32, 24))
    scene = cltrace.Scene.from_spheres(camera, [light], [(0, 0, 0)], 1, kd=0, ks=1, exponent=24, ka=0)
    image = cltrace.render(scene, device, "double", outputs=("color",))
    ys, xs = np.nonzero(image.color[..., 0] > 1e-6)
    assert len(ys) > 50
    for y, x in zip(ys.tolist(), xs.tolist(), strict=True):
        color, _ = trace(world(scene), primary_ray(scene.camera, x, y))
        assert float(image.color[y, x, 0]) == pytest.approx(color[0], rel=2.0**-23)
