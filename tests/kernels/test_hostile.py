"""Whole pictures of a scene that is put where float32 fails, and shadow rays by the million."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import world
from random_scenes import fuzzed_scene, random_scene
from stress_cases import picture

import cltrace
from cltrace import Camera, Scene
from cltrace.bench.scenes import field
from cltrace.reference import byte_of
from cltrace.reference.trace import primary_ray, trace
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


def compare(device: Device, name: str, size: tuple[int, int]) -> None:
    scene = hostile(name, size)
    accurate, double = (picture(scene, device, p) for p in ("accurate", "double"))
    assert np.array_equal(accurate.id, double.id)
    levels = np.abs(accurate.rgb8.astype(int) - double.rgb8).max(axis=-1)
    assert levels.max() <= 1
    assert (levels > 0).mean() <= 5e-5
    for i in np.random.default_rng(6).integers(0, size[0] * size[1], 60).tolist():
        color, at = trace(world(scene), primary_ray(scene.camera, i % size[0], i // size[0]))
        assert (at.index if at else -1) == double.id.ravel()[i]
        assert np.abs(double.rgb8.reshape(-1, 3)[i].astype(int) - [byte_of(c) for c in color]).max() <= 1


@pytest.mark.parametrize("name", TRANSFORMS)
def test_picture(device: Device, name: str) -> None:
    compare(device, name, (300, 170))


@pytest.mark.stress
@pytest.mark.parametrize("name", TRANSFORMS)
def test_large_picture(device: Device, name: str) -> None:
    compare(device, name, (1800, 1020))


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


def shadows(device: Device, side: int) -> int:
    """A ball alone never shadows itself, a shell around it always does, from 1e-3 to 1e7; returns the shadow rays."""
    rays = 0
    for exponent in range(-3, 8):
        R = float(np.float32(10.0**exponent))
        shells = [R * (1 + g) for g in (1e-2, 1e-4, 1e-6)] + [float(np.nextafter(np.float32(R), np.float32(np.inf)))]
        for offset in (0.0, R, 1e3 * R):
            center = np.array([offset, -offset, offset])
            camera = Camera(tuple(center + (0, 0, 3 * R)), tuple(center), horizontal_fov=19, resolution=(side, side))
            light = cltrace.point_light(center + np.array([4, 7, 9]) * R)
            far = center + (0, -50 * R, 0)
            for shell in [0.0, *(s for s in shells if offset == 0)]:
                # The eye is between ball and shell when there is one, just above the ball: its own shell is around it.
                if shell:
                    eye = (0, 0, (R + shell) / 2)
                    camera = Camera(eye, (0, 0, 0), horizontal_fov=80, resolution=(side, side))
                    balls, radii = [center, center], [R, shell]
                else:
                    balls, radii = [center, far], [R, R]
                scene = Scene.from_spheres(camera, [light], balls, radii, ka=0, kd=1, ks=0)
                image = picture(scene, device)
                cast = (image.shadow_rays > 0) & (image.id == 0)
                lit = image.color[..., 0] > 0
                rays += int(cast.sum())
                if shell:
                    assert not lit.any(), (R, shell)
                else:
                    assert lit[cast].all(), (R, offset)
                    assert cast.any()
    return rays


def test_no_self_shadow_and_no_leak(device: Device) -> None:
    assert shadows(device, 64) > 50_000


@pytest.mark.stress
def test_no_self_shadow_and_no_leak_in_ten_million_rays(device: Device) -> None:
    assert shadows(device, 900) >= 10_000_000


def look_for_nan(scenes: range) -> None:
    """Every pixel of random and of fuzzed scenes is a number, in both precisions that use float32."""
    for seed in scenes:
        scene = (random_scene if seed % 2 else fuzzed_scene)(seed)
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


@pytest.mark.slow
@pytest.mark.parametrize("R", [1e2, 1e5, 1e9, 1e11, 1e13])
def test_shadows_within_a_huge_shell(device: Device, R: float) -> None:
    """docs/accuracy.md says up to which ratio of sizes shadows are right: this far, by the exact reference."""
    camera = Camera((0.5, 0.5, 3), (2, 0, 0), horizontal_fov=40, resolution=(16, 12))
    light = cltrace.point_light((4, 0.3, 0.2))
    scene = Scene.from_spheres(camera, [light], [(2, 0, 0), (0, 0, 0)], [1, R], ka=0, kd=1, ks=0)
    for precision in ("accurate", "double"):
        image = cltrace.render(scene, device, precision, ("color", "id"))
        for i in range(192):
            color, at = trace(world(scene), primary_ray(camera, i % 16, i // 16))
            assert image.id.ravel()[i] == (at.index if at else -1)
            assert (image.color.reshape(-1, 3)[i, 0] > 0) == (color[0] > 0), i


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
