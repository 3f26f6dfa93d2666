"""Cylinders: the kernel against the exact oracle and the reference, in hostile pictures and plain ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hostile.rod_pictures import REGIMES, lit_of, scene_of, wrong_pixels, wrong_shadows
from judged_pictures import agrees, changed_by_filter, is_the_mean_of_finer_pixels, single_agrees

import cltrace
from cltrace import Camera, Orthographic, Scene, ambient_light, parallel_light, point_light
from cltrace.picture.image import Output
from cltrace.run.devices import Device

LIGHTS = (ambient_light((0.2, 0.2, 0.2)), point_light((5, 8, 9)), parallel_light((-1, -1, -0.3), (0.3, 0.3, 0.3)))
CAMERA = Camera((0, 1, 6), (0, 0, 0), (0, 1, 0), 15, (48, 36))


def molecule(**how: object) -> Scene:
    """Three balls, two bonds of two colours, a coin and a rod."""
    centers, colors = [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    scene = Scene.from_spheres(
        CAMERA,
        LIGHTS,
        centers,
        0.3,
        colors,
        bonds=[(0, 1), (0, 2)],
        bond_radius=0.12,
        **how,  # type: ignore[arg-type]
    )
    return scene.with_cylinders([(-1, -1, 0), (0.5, -1, 0.1)], [(-1, -1, 0.2), (1, -0.5, 0.8)], [0.6, 0.2], (1, 1, 0))


def seen_wrong(name: str, device: Device, seeds: int, size: tuple[int, int]) -> int:
    wrong = 0
    for seed in range(seeds):
        scene = scene_of(name, seed, size)
        image = cltrace.Renderer(scene, device, "accurate", ("id", "depth"), keep=("features",)).render()
        wrong += wrong_pixels(scene, image.id, image.depth)
    return wrong


@pytest.mark.parametrize("name", REGIMES)
def test_hostile_pictures(device: Device, name: str) -> None:
    seeds, size = (40, (5, 3)) if name == "edges" else (3, (31, 23))
    assert seen_wrong(name, device, seeds, size) == 0


@pytest.mark.stress
@pytest.mark.parametrize("name", REGIMES)
def test_a_million_rays(device: Device, name: str) -> None:
    assert seen_wrong(name, device, 110, (111, 87)) == 0


def shadows_wrong(name: str, device: Device, seeds: int, size: tuple[int, int]) -> tuple[int, int]:
    """How many shadow rays were asked for, in each of four lights, and how many the oracle has otherwise."""
    counts = []
    for seed in range(seeds):
        scene = lit_of(name, seed, size)
        for light in scene.lights.reshape(-1, 1):
            outputs: tuple[Output, ...] = ("color", "normal")
            one = scene.lit_by([light])
            image = cltrace.Renderer(one, device, "accurate", outputs, keep=("features",)).render()
            counts.append(wrong_shadows(one, image))
    asked, wrong = np.sum(counts, axis=0).tolist()
    return asked, wrong


@pytest.mark.slow
@pytest.mark.parametrize("name", REGIMES)
def test_shadows_are_those_of_the_oracle(device: Device, name: str) -> None:
    asked, wrong = shadows_wrong(name, device, 2, (12, 9))
    assert asked > 100
    assert wrong == 0


@pytest.mark.stress
@pytest.mark.parametrize("name", REGIMES)
def test_a_million_shadow_rays(device: Device, name: str) -> None:
    """Of all regimes together."""
    assert shadows_wrong(name, device, 80, (31, 23))[1] == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", REGIMES)
def test_no_filter_changes_a_picture(device: Device, name: str) -> None:
    seeds, size = (40, (5, 3)) if name in ("grazing", "edges") else (4, (31, 23))
    assert [seed for seed in range(seeds) if changed_by_filter(lit_of(name, seed, size), device)] == []


@pytest.mark.slow
def test_no_filter_changes_a_picture_of_a_lamp_within_a_cylinder(device: Device) -> None:
    """What is within, too, is lit; the cylinder stops what goes out."""
    lamps = [ambient_light((0.2, 0.2, 0.2)), point_light((0.2, 0.1, 1.5), (0.8, 0.8, 0.8))]
    inside = Camera((0, 0.5, 2.5), (0, 0, 0), (0, 1, 0), 30, (48, 36))
    scene = Scene.from_spheres(inside, lamps, [(0, 0, 0), (0, 0, 9)], 0.5).with_cylinders([(0, -3, 0)], [(0, 3, 0)], 3)
    agrees(scene, device)
    agrees(scene.seen_by(replace(CAMERA, position=(0, 0, 15))), device)
    assert changed_by_filter(scene, device) == 0


@pytest.mark.slow
def test_no_filter_changes_a_picture_of_a_lamp_at_a_cylinder(device: Device) -> None:
    """It is nearer to the side than floats can tell, and what it shines at is before the cylinder, or behind it."""
    lamp, balls = point_light((1 + 2.0**-22, 0.25, 0), (0.8, 0.8, 0.8)), [(3, 0, 0), (3, 0.9, 0), (0, 0, -3)]
    seen = Camera((2, 2, 9), (1.5, 0, 0), (0, 1, 0), 40, (48, 36))
    scene = Scene.from_spheres(seen, [ambient_light((0.2, 0.2, 0.2)), lamp], balls, 0.5)
    scene = scene.with_cylinders([(0, -2, 0)], [(0, 2, 0)], 1)
    agrees(scene, device)
    assert changed_by_filter(scene, device) == 0


@pytest.mark.stress
@pytest.mark.parametrize("name", REGIMES)
def test_no_filter_changes_a_million_pixels(device: Device, name: str) -> None:
    assert [seed for seed in range(110) if changed_by_filter(lit_of(name, seed, (111, 87)), device)] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", REGIMES)
def test_no_filter_changes_parallel_rays(device: Device, name: str) -> None:
    for seed in range(2):
        scene = lit_of(name, seed, (31, 23))
        size = np.linalg.norm(np.ptp(np.stack([scene.cylinders["start"], scene.cylinders["end"]]), axis=(0, 1)))
        camera = Orthographic(scene.camera.position, scene.camera.lookat, (0.1, 1, 0.2), size + 1e-3, (31, 23))
        assert changed_by_filter(scene.seen_by(camera), device) == 0, seed


def test_light_and_shadows(device: Device) -> None:
    agrees(molecule(), device)


def test_light_leaves_both_of_two_that_cross(device: Device) -> None:
    """A point of one of them that is on the other one, but for rounding, is on it: it was in its shadow."""
    camera = Orthographic((1, 1, 6), (1, 1, 0), (0, 1, 0), 3, (48, 36))
    lights = [ambient_light((0.2, 0.2, 0.2)), parallel_light((-0.3, -0.2, -1))]
    bare = Scene.from_spheres(camera, lights, np.zeros((0, 3)), 1)
    box = bare.with_cylinders(*cltrace.box_edges((2, 2, 2)), 0.2, "white")
    agrees(box, device, every=1)
    seam = np.array([12, 13])  # rays through these pixels of a diagonal meet two edges at once
    assert (cltrace.render(box, device, outputs=("color",)).color[41 - seam, seam] > 0.3).all()
    bars = bare.seen_by(CAMERA).lit_by(LIGHTS)
    agrees(bars.with_cylinders([(-1, 0, 0), (0, 0, 0)], [(0, 0, 0), (0, 1, 0)], 0.3, "gold"), device)


@pytest.mark.slow
@pytest.mark.parametrize("how", [{"reflectance": 0.4}, {"transmittance": 0.6, "index": 1.5, "reflectance": 0.1}])
def test_mirrors_and_glass(device: Device, how: dict[str, float]) -> None:
    scene = molecule(**how)
    agrees(replace(scene, camera=replace(CAMERA, max_bounces=3)), device, every=2)


@pytest.mark.slow
def test_parallel_rays(device: Device) -> None:
    agrees(molecule().seen_by(Orthographic((0, 1, 6), (0, 0, 0), (0, 1, 0), 3.2, (48, 36))), device, every=2)


@pytest.mark.slow
def test_single(device: Device) -> None:
    single_agrees(molecule(), device)


@pytest.mark.slow
def test_antialiasing_is_that_of_more_pixels(device: Device) -> None:
    is_the_mean_of_finer_pixels(molecule(), device)
