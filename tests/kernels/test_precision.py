"""Bytes of `accurate` are those of `double`, also where floats alone would show: what has gone wrong, and the rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import fuzzed_scene

import cltrace
from cltrace import Camera, Renderer, Scene
from cltrace.plan.materials import precision_for
from cltrace.run.devices import Device

CAMERA = Camera((0, 0, 4), (0, 0, 0), horizontal_fov=40, resolution=(24, 18))
SUN = [cltrace.parallel_light((-1, -1, -1))]


def ball(exponent: float = 50, ks: float = 0.5, kd: float = 0.5, light: float = 1, r: float = 0, t: float = 0) -> Scene:
    lights = [cltrace.parallel_light((-1, -1, -1), (light, light, light))]
    material = {"ks": ks, "kd": kd, "exponent": exponent, "reflectance": r, "transmittance": t}
    return Scene.from_spheres(CAMERA, lights, [(0, 0, 0)], [1], [(1, 0.5, 0.2)], ka=0.1, **material)


def differing(scene: Scene, device: Device) -> int:
    """In how many bytes pictures of the two precisions differ."""
    accurate, double = (cltrace.render(scene, device, precision=name) for name in ("accurate", "double"))
    return int((accurate.rgb8 != double.rgb8).sum())


def mild(seed: int) -> Scene:
    """fuzzed_scene() with materials and lights for which floats are good enough."""
    scene = fuzzed_scene(seed)
    materials, lights = scene.materials.copy(), scene.lights.copy()
    materials["color"] = materials["ks"] = materials["kd"] = lights["color"] = 0.5
    materials["exponent"] = 1
    return replace(scene, materials=materials, lights=lights)


def test_a_highlight_within_the_smallest_of_balls(device: Device) -> None:
    """Eye and light are in the centre of a ball of 9e-38, and another one has a radius of 8e27: in units of that, there
    was no direction to the light, and no highlight."""
    scene = mild(142)
    image = cltrace.render(scene, device, precision="accurate", outputs=("rgb8", "color"))
    assert differing(scene, device) == 0
    assert np.allclose(image.color, 0.025 + 0.125 + 0.25)


def test_a_highlight_under_grazing_light(device: Device) -> None:
    """The light grazes the ball where the eye is on it: n.l is 1e-13, and was below 0 in floats."""
    scene = mild(91)
    assert differing(scene, device) == 0
    materials = scene.materials.copy()
    materials["ka"] = materials["ks"] = 0
    dark = replace(scene, materials=materials)
    assert cltrace.render(dark, device, precision="accurate", outputs=("color",)).color.min() == 0


@pytest.mark.parametrize("seed", [247, 289, 358, 599, 612, 3525, 7070, 7112])
def test_bytes_of_extreme_scenes(seed: int, device: Device) -> None:
    """Colours of 1e30 and exponents of 1e-30 to 3e38, which differed by up to 255 levels."""
    assert differing(fuzzed_scene(seed), device) == 0


@pytest.mark.slow
def test_bytes_of_many_fuzzed_scenes(device: Device) -> None:
    assert sum(differing(fuzzed_scene(seed), device) for seed in range(400)) == 0


def test_what_floats_are_good_enough_for() -> None:
    floats = [
        {},
        {"exponent": 0},
        {"exponent": 0.6},
        {"exponent": 2.0**16},
        {"exponent": 1e9, "ks": 0},
        {"exponent": 0.1, "ks": 0},
        {"light": 500, "exponent": 1e3},
        {"kd": 256, "ks": 0},
        {"r": 0.5, "t": 0.5},
        {"r": 1.5},
    ]
    doubles = [
        {"exponent": 0.5},
        {"exponent": 1e-30},
        {"exponent": 2.0**16 + 1},
        {"exponent": 1e4, "ks": 100, "kd": 1},
        {"light": 520},
        {"kd": 257, "ks": 0},
        {"ks": 257, "exponent": 1},
        {"r": 1.5, "t": 1.5},
    ]
    assert [how for how in floats if precision_for(ball(**how), "accurate") != "accurate"] == []
    assert [how for how in doubles if precision_for(ball(**how), "accurate") != "double"] == []
    assert precision_for(ball(light=1e9), "single") == "single"


def test_a_renderer_follows_its_scene(device: Device) -> None:
    """Materials that change, and a camera that lets rays bounce more often, are those of new Renderers, to the bit."""
    outputs = ("rgb8", "color", "depth", "id")
    renderer = Renderer(ball(), device, "accurate", outputs)
    for exponent, precision in ((1e6, "double"), (1e7, "double"), (20, "accurate")):
        renderer.update(exponent=exponent)
        assert renderer.precision == precision
        new = Renderer(renderer.scene, device, "accurate", outputs).render()
        image = renderer.render()
        assert all(np.array_equal(getattr(image, name), getattr(new, name), equal_nan=True) for name in outputs)
    places = [(0, 0, 0), (1.5, 0, 0)]
    mirror = Scene.from_spheres(CAMERA, SUN, places, [1, 0.5], [(1, 0.5, 0.2)] * 2, reflectance=[4, 0])
    once = Renderer(mirror, device, "accurate").look(replace(CAMERA, max_bounces=1))
    often = once.look(replace(CAMERA, max_bounces=8))
    assert (once.precision, often.precision) == ("accurate", "double")
    for renderer in (once, often):
        assert np.array_equal(renderer.render().rgb8, Renderer(renderer.scene, device).render().rgb8)
