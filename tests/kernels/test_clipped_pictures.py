"""Clipped scenes of all shapes: the kernel against the reference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from clipped_scenes import REGIMES, everything, first_of_balls, scene_of
from judged_pictures import is_the_mean_of_finer_pixels

import cltrace
from cltrace import Scene, point_light
from cltrace.reference import world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device


def wrong_pixels(scene: Scene, device: Device, every: int = 1) -> list[tuple[int, int]]:
    """Which pixels have another number, cap, colour or distance than the reference says, of one in so many rows."""
    outputs = ("id", "primitive", "color", "depth")
    image = cltrace.Renderer(scene, device, "accurate", outputs, keep=("features",)).render()
    world, wrong, (width, height) = world_of(scene), [], scene.camera.resolution
    for v in range(0, height, every):
        for u in range(width):
            color, at = trace(world, primary_ray(scene.camera, u, v))
            same = (image.id[v, u], image.primitive[v, u]) == ((at.index, at.primitive) if at else (-1, -1))
            near = at is None or abs(image.depth[v, u] - at.distance) <= 1e-9 * at.distance
            if not same or not near or np.abs(image.color[v, u] - color).max() > 1e-4:
                wrong.append((u, v))
    return wrong


@pytest.mark.parametrize("name", REGIMES)
def test_pictures_are_those_of_the_reference(device: Device, name: str) -> None:
    assert wrong_pixels(scene_of(name, 0), device) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 9))
@pytest.mark.parametrize("name", REGIMES)
def test_more_pictures_are_those_of_the_reference(device: Device, name: str, seed: int) -> None:
    assert wrong_pixels(scene_of(name, seed), device) == []


def test_light_falls_through_what_is_left_out(device: Device) -> None:
    """A floor below a ball of which the upper half is gone, in light from above that the whole ball would stop."""
    camera = cltrace.Camera((0, 6, 6), (0, 0, 0), (0, 1, 0), 30, (16, 12))
    centers, radii = [(0, 2, 0), (0, -1000, 0), (0, 4, 0)], [1, 999, 0.5]
    scene = Scene.from_spheres(camera, [point_light((0, 9, 0))], centers, radii)
    assert wrong_pixels(scene.clipped((0, 1.5, 0), (0, 1, 0)), device) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["some", "glass", "straight"])
def test_packets_of_one_pixel(device: Device, name: str) -> None:
    """As GPUs have them."""
    outputs = ("id", "primitive", "color")
    one, other = (cltrace.Renderer(scene_of(name, 2), device, outputs=outputs, width=w).render() for w in (1, None))
    assert all(np.array_equal(getattr(one, name), getattr(other, name)) for name in outputs)


@pytest.mark.slow
def test_single(device: Device) -> None:
    """In float32, few pixels at edges are others than in `accurate`."""
    scene = scene_of("some", 1)
    scene = scene.seen_by(replace(scene.camera, resolution=(160, 120)))
    exact, rough = (cltrace.render(scene, device, precision, ("id", "color")) for precision in ("accurate", "single"))
    same = exact.id == rough.id
    assert same.mean() > 0.99
    assert (np.abs(exact.color - rough.color).max(axis=2)[same] < 1e-3).mean() > 0.98


@pytest.mark.slow
def test_antialiasing_is_that_of_more_pixels(device: Device) -> None:
    scene = scene_of("some", 0)
    is_the_mean_of_finer_pixels(scene.seen_by(replace(scene.camera, resolution=(48, 36))), device)


@pytest.mark.slow
def test_more_closed_meshes_than_bits(device: Device) -> None:
    """Cubes in each other, of which bits of a packet tell about 31 at a time."""
    rng = np.random.default_rng(1)
    scene = everything(rng, [((0, 0, 0.1), (0.1, 0.2, 1))])
    solid = scene.meshes[0]
    cubes = [solid.moved(np.array([0, 0, 0.001 * k]), 100 + k) for k in range(70)]
    scene = replace(scene, meshes=(*scene.meshes, *cubes))
    image = cltrace.render(scene, device, outputs=("id", "primitive"))
    assert wrong_pixels(scene, device, every=4) == []
    assert (image.primitive == -2).any()


@pytest.mark.slow
def test_many_spheres(device: Device) -> None:
    """As many as a device makes lists of: hits and caps are those of the exact answers."""
    rng = np.random.default_rng(3)
    camera = cltrace.Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 30, (64, 48))
    scene = Scene.from_spheres(camera, "studio", rng.uniform(-1, 1, (40_000, 3)), 0.03).clipped(
        (0, 0, 0.2), (0, 0.3, 1)
    )
    image = cltrace.render(scene, device, outputs=("id", "primitive", "depth"))
    y, x = (grid.ravel()[::7] for grid in np.mgrid[:48, :64])
    wide, high = camera.image_plane()
    d = np.column_stack([(2 * x + 1 - 64) * wide / 64, (47 - 2 * y) * high / 48, -np.ones(len(x))])
    clips = [((0, 0, 0.2), (0, 0.3, 1))]
    index, t, cap = first_of_balls(scene.columns.center, 0.03, clips, np.tile((0.0, 0, 4), (len(d), 1)), d)
    assert np.array_equal(image.id[y, x], index)
    assert np.array_equal(image.primitive[y, x] == -2, cap)
    met = index >= 0
    assert np.allclose(image.depth[y, x][met], (t * np.linalg.norm(d, axis=1))[met], rtol=1e-9)
    assert cap.mean() > 0.05
