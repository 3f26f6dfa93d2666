"""Whole pictures of scenes that are put where float32 fails, and of numbers at the ends of its range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import fuzzed_scene, fuzzed_tree, random_scene
from stress_cases import picture, wrong_pixels

import cltrace
from cltrace import Camera, Scene
from cltrace.bench.scenes import field
from cltrace.run.devices import Device

TRANSFORMS = {
    "R=1e3": (1e3, 0, 1),
    "R=1e5": (1e5, 0, 1),
    "R=1e7": (1e7, 0, 1),
    "moved 1e4": (1e3, 1e4, 1),
    "moved 1e6": (1e3, 1e6, 1),
    "scale 1e-6": (1e3, 0, 1e-6),
    "scale 1e6": (1e3, 0, 1e6),
}


def hostile(name: str, size: tuple[int, int]) -> Scene:
    """The benchmark's balls on a ground sphere, seen aslant; the ground's radius, the place and the scale vary."""
    radius, offset, scale = TRANSFORMS[name]
    move = offset * np.array([1, -0.7, 0.3])
    eye, at = (tuple((scale * (np.array(p) + move)).tolist()) for p in ((13, 2, 3), (0, 0, 0)))
    camera = Camera(eye, at, horizontal_fov=17, resolution=size, square_pixels=False)
    return replace(field(size, radius, offset, scale), camera=camera)


@pytest.mark.parametrize("name", TRANSFORMS)
def test_picture(device: Device, name: str) -> None:
    scene = hostile(name, (300, 170))
    accurate, double = (picture(scene, device, precision) for precision in ("accurate", "double"))
    assert np.array_equal(accurate.id, double.id)
    levels = np.abs(accurate.rgb8.astype(int) - double.rgb8).max(axis=-1)
    assert levels.max() <= 1
    assert (levels > 0).mean() <= 5e-5
    assert wrong_pixels(scene, double, 60, np.inf) == []


@pytest.mark.parametrize("k", [-141, -100, 115])
def test_picture_at_the_ends_of_the_range(device: Device, k: int) -> None:
    """Down to radii of 7e-44 and up to coordinates of 5e35, where float32 has no room for a product."""
    scene = hostile("R=1e3", (200, 113))
    spheres, lights, camera = scene.spheres.copy(), scene.lights.copy(), scene.camera
    for array, name in ((spheres, "center"), (spheres, "radius"), (lights, "position")):
        array[name] = np.ldexp(array[name], k)
    position, lookat = (tuple(np.ldexp(p, k).tolist()) for p in (camera.position, camera.lookat))
    moved = replace(camera, position=position, lookat=lookat)
    scaled = Scene(moved, lights, spheres, scene.materials, scene.background)
    for precision in ("accurate", "single", "double"):
        usual, other = (picture(s, device, precision) for s in (scene, scaled))
        assert np.array_equal(usual.id, other.id)
        assert np.array_equal(usual.color, other.color)
        assert np.array_equal(usual.rgb8, other.rgb8)


def look_for_nan(scenes: range) -> None:
    """Every pixel of random and of fuzzed scenes is a number, in both precisions that use float32."""
    for seed in scenes:
        scene = (random_scene, fuzzed_scene, fuzzed_tree)[seed % 3](seed)
        for precision in ("accurate", "single"):
            image = picture(scene, None, precision)
            assert (image.color >= 0).all(), (seed, precision)
            assert not np.isnan(image.normal).any(), (seed, precision)
            assert np.array_equal(np.isfinite(image.depth), image.id >= 0), (seed, precision)


@pytest.mark.parametrize("ks", [0.0, 3e38])
def test_colours_that_overflow_are_numbers(any_device: Device, ks: float) -> None:
    """A light at the eye that is black in two channels: all that is diffuse and all of a highlight, times 0."""
    camera = Camera((0, 0, 4), (0, 0, 0), horizontal_fov=30, resolution=(9, 7))
    light = cltrace.point_light((0, 0, 4), (1, 0, 0))
    scene = Scene.from_spheres(camera, [light], [(0, 0, 0)], 1, (1e30, 1e30, 1), ka=0, kd=1e30, ks=ks)
    for precision in ("single", "accurate", "double"):
        color = picture(scene, any_device, precision).color[3, 4]
        assert (color[0] > 1e38, color[1:].tolist()) == (True, [0, 0]), precision


@pytest.mark.slow
def test_no_nan() -> None:
    look_for_nan(range(250))


@pytest.mark.stress
def test_no_nan_in_a_hundred_thousand_scenes() -> None:
    look_for_nan(range(250, 100_250))


def test_no_diffuse_light_beyond_full(device: Device) -> None:
    """Where a surface faces the light, n.l is 1 but for rounding; above 1 it would be brighter than it can be."""
    camera = Camera((0.3, 0.2, 5), (0.1, 0.1, 0), horizontal_fov=0.2, resolution=(64, 64))
    toward = np.array([0.3, 0.2, 5]) - (0.1, 0.1, 0)
    light = cltrace.parallel_light(-toward)
    scene = Scene.from_spheres(camera, [light], [(0.1, 0.1, 0)], [1.0], ka=0, kd=0.8, ks=0)
    color = cltrace.render(scene, device, "accurate", ("color",)).color
    assert np.float32(0.799) < color.min()
    assert color.max() <= np.float32(0.8)


@pytest.mark.slow
def test_tiny_things_in_a_large_scene(device: Device) -> None:
    """A ball of 1e-24 and its light beside one at a distance of 1: squares of such lengths are nothing in float32."""
    colors = []
    for k, far in ((1.0, []), (1e-24, [((0.0, 0.0, -1.0), 0.1)])):
        camera = Camera((0, 0, 0), (0, 0, -1), horizontal_fov=12, resolution=(24, 24))
        centers, radii = zip(((0.0, 0.0, -3 * k), k), *far, strict=True)
        lights = [cltrace.point_light((5 * k, 4 * k, k))]
        scene = Scene.from_spheres(camera, lights, centers, radii, ka=0, kd=0.8, ks=0.5)
        image = cltrace.render(scene, device, "accurate", ("color", "id"))
        assert (image.id == 0).all()
        colors.append(image.color)
    assert colors[0].max() > 0.5
    assert np.abs(colors[0] - colors[1]).max() <= 1e-6


@pytest.mark.parametrize("height", [1e-2, 1e-5])
def test_balls_on_a_ground_right_before_the_eye_in_single(device: Device, height: float) -> None:
    """A ground of radius 1 that starts `height` below the eye stops no light of its own points: there floats measure
    them from the eye, where the power of a point in its own sphere is not 0."""
    generator = np.random.default_rng(3)
    radii = generator.uniform(0.2, 1.2, 12) * height
    places = np.stack([generator.uniform(-6, 6, 12), np.zeros(12), generator.uniform(-20, -3, 12)], axis=-1) * height
    up = places + (0, 1, 0)
    balls = up / np.linalg.norm(up, axis=-1, keepdims=True) * (1 + radii[:, None]) - (0, 1, 0)
    scene = Scene.from_spheres(
        Camera((0, 3 * height, 0), (0, 0, -10 * height), fov=60, resolution=(96, 64)),
        [cltrace.point_light((20 * height, 30 * height, 5 * height), (1, 1, 1))],
        np.vstack([(0, -1, 0), balls]),
        np.append(1, radii),
    )
    single, accurate = (
        cltrace.render(scene, device, precision).rgb8.astype(int) for precision in ("single", "accurate")
    )
    assert np.abs(single - accurate).max() <= 1
