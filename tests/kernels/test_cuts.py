"""Balls that planes have cut: the kernel against the exact oracle and the reference, in hostile pictures, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hostile.cut_pictures import REGIMES, lit_of, scene_of
from hostile.rod_pictures import wrong_pixels
from judged_pictures import agrees, changed_by_filter, is_the_mean_of_finer_pixels, single_agrees

import cltrace
from cltrace import Camera, Orthographic, Scene, ambient_light, parallel_light, point_light
from cltrace.run.devices import Device

# The point is in the part that is left out, and would be within a ball.
LIGHTS = (
    ambient_light((0.2, 0.2, 0.2)),
    point_light((0.3, 0.2, 0.9)),
    parallel_light((-1, -1, -0.3), (0.3, 0.3, 0.3)),
)
CAMERA = Camera((0.4, 1, 6), (0, 0, 0), (0, 1, 0), 15, (48, 36))


def opened(**how: object) -> Scene:
    """A heap of balls, cut open towards the camera, with caps; and a cylinder."""
    rng = np.random.default_rng(4)
    centers, radii = rng.uniform(-1, 1, (8, 3)), rng.uniform(0.4, 0.7, 8)
    scene = Scene.from_spheres(CAMERA, LIGHTS, centers, radii, rng.uniform(0.2, 1, (8, 3)), **how)  # type: ignore[arg-type]
    scene = scene.with_cylinders([(-1, -1.2, -1)], [(1, -1.2, -0.5)], 0.1, "gold")
    return scene.clipped((0, 0, 0.3), (0.3, 0.2, 1), "red").clipped((0, 1.8, 0), (0, 1, 0))


def seen_wrong(name: str, device: Device, seeds: int, size: tuple[int, int]) -> int:
    wrong = 0
    for seed in range(seeds):
        scene = scene_of(name, seed, size)
        image = cltrace.Renderer(scene, device, "accurate", ("id", "depth"), keep=("features",)).render()
        wrong += wrong_pixels(scene, image.id, image.depth)
    return wrong


@pytest.mark.parametrize("name", REGIMES)
def test_hostile_pictures(device: Device, name: str) -> None:
    assert seen_wrong(name, device, 3, (31, 23)) == 0


@pytest.mark.stress
@pytest.mark.parametrize("name", REGIMES)
def test_a_million_rays(device: Device, name: str) -> None:
    assert seen_wrong(name, device, 110, (111, 87)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", REGIMES)
def test_no_filter_changes_a_picture(device: Device, name: str) -> None:
    seeds, size = (40, (5, 3)) if name == "grazing" else (4, (31, 23))
    assert [seed for seed in range(seeds) if changed_by_filter(lit_of(name, seed, size), device)] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", REGIMES)
def test_shadows_are_those_of_the_reference(device: Device, name: str) -> None:
    agrees(lit_of(name, 1, (48, 36)), device, every=5)


def test_light_and_shadows(device: Device) -> None:
    agrees(opened(), device)


@pytest.mark.slow
@pytest.mark.parametrize("how", [{"reflectance": 0.4}, {"transmittance": 0.6, "index": 1.5, "reflectance": 0.1}])
def test_mirrors_and_glass(device: Device, how: dict[str, float]) -> None:
    scene = opened(**how)
    agrees(replace(scene, camera=replace(CAMERA, max_bounces=3)), device, every=2)


@pytest.mark.slow
def test_parallel_rays(device: Device) -> None:
    agrees(opened().seen_by(Orthographic((0, 1, 6), (0, 0, 0), (0, 1, 0), 3.2, (48, 36))), device, every=2)


@pytest.mark.slow
def test_single(device: Device) -> None:
    single_agrees(opened(), device)


@pytest.mark.slow
def test_antialiasing_is_that_of_more_pixels(device: Device) -> None:
    is_the_mean_of_finer_pixels(opened(), device)
