"""The kernel against the reference: every device, packet width and precision, on every scene and on random ones."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from conftest import SCENES, world
from random_scenes import random_scene

import cltrace
from cltrace import Scene
from cltrace.plan.layout import KEEPS
from cltrace.reference import byte_of, primary_ray, trace
from cltrace.reference.check import sample
from cltrace.run.devices import Device

RANDOM = range(24)
# The reference tries every sphere for every pixel; this many tests a scene take it about two seconds.
TESTS = 400_000


@dataclass(frozen=True)
class Expected:
    """What the reference says of some pixels: their flat positions, bytes, ids and distances."""

    at: np.ndarray
    rgb8: np.ndarray
    id: np.ndarray
    depth: np.ndarray


@functools.cache
def load(name: str) -> Scene:
    if name.isdigit():
        return random_scene(int(name))
    return cltrace.load(next(path for path in SCENES if path.stem == name))


@functools.cache
def expected(name: str) -> Expected:
    scene = load(name)
    width, height = scene.camera.resolution
    # Where ids change is most to be got wrong. Which pixels those are, any device may say.
    ids = cltrace.render(scene, outputs=("id",)).id
    assert ids is not None
    at = sample(ids, min(width * height, max(100, min(2500, TESTS // len(scene.spheres)))))
    results = [trace(world(scene), primary_ray(scene.camera, int(i) % width, int(i) // width)) for i in at]
    return Expected(
        at,
        np.array([[byte_of(c) for c in color] for color, _ in results]),
        np.array([hit.index if hit else -1 for _, hit in results]),
        np.array([hit.distance if hit else np.inf for _, hit in results]),
    )


NAMES = [path.stem for path in SCENES] + [str(seed) for seed in RANDOM]
# Spheres that float32 cannot hold relative to the camera: ordinary scenes are the others.
HOSTILE = {"globe"}


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_kernel_agrees_with_the_reference(device: Device, width: int, precision: str) -> None:
    differing = total = 0
    for name in NAMES:
        want = expected(name)
        image = cltrace.Renderer(load(name), device, precision, ("rgb8", "id", "depth"), width=width).render()
        assert image.rgb8 is not None
        assert image.id is not None
        assert image.depth is not None
        levels = np.abs(image.rgb8.reshape(-1, 3)[want.at].astype(int) - want.rgb8).max(axis=1)
        differing += int((levels > 0).sum())
        total += len(want.at)
        if precision == "single":
            if name not in HOSTILE:
                assert (levels > 1).sum() <= max(1, 1e-3 * len(levels)), name
            continue
        assert (image.id.ravel()[want.at] == want.id).all(), name
        assert levels.max() <= 1, name
        # Both compute t by the same operations in double: the very same bits.
        assert (image.depth.ravel()[want.at] == want.depth).all(), name
    if precision != "single":
        assert differing <= 1e-4 * total


@pytest.mark.parametrize("precision", ["accurate", "double"])
def test_normals_and_directions(device: Device, precision: str) -> None:
    for name in [*(path.stem for path in SCENES[:6]), *map(str, range(6))]:
        scene, want = load(name), expected(name)
        picture = cltrace.render(scene, device, precision, ("normal", "direction"))
        assert picture.normal is not None
        assert picture.direction is not None
        basis = np.array(scene.camera.basis())
        columns = scene.camera.resolution[0]
        for i in want.at[:: max(1, len(want.at) // 200)]:
            ray = primary_ray(scene.camera, int(i) % columns, int(i) // columns)
            _, hit = trace(world(scene), ray)
            d = ray.direction.normalized()
            direction = np.array([d.x, d.y, d.z]) @ basis
            assert np.abs(picture.direction.reshape(-1, 3)[i] - direction).max() <= 1e-7
            normal = np.array([hit.normal.x, hit.normal.y, hit.normal.z]) @ basis if hit else np.zeros(3)
            assert np.abs(picture.normal.reshape(-1, 3)[i] - normal).max() <= 1e-7


def test_drivers_agree_on_ids_and_distances() -> None:
    """Double precision is rounded the same everywhere, so all drivers and packet widths give the same bits."""
    for name in map(str, RANDOM):
        images = [
            cltrace.Renderer(load(name), device, "accurate", ("id", "depth"), width=width).render()
            for device in cltrace.devices()
            if device.has_double
            for width in {1, device.width}
        ]
        for other in images[1:]:
            assert np.array_equal(images[0].id, other.id), name
            assert np.array_equal(images[0].depth, other.depth), name


def test_crop_is_those_pixels_of_the_whole_picture(device: Device, width: int) -> None:
    scene = load("1")
    for precision in ("accurate", "single"):
        whole = cltrace.Renderer(scene, device, precision, ("rgb8", "id", "depth"), width=width).render()
        for crop in [(0, 0, 1, 1), (3, 5, 20, 18), (0, 7, 33, 8), (13, 2, 14, 31)]:
            part = cltrace.Renderer(scene, device, precision, ("rgb8", "id", "depth"), crop, width=width).render()
            x0, y0, x1, y1 = crop
            for name in ("rgb8", "id", "depth"):
                assert np.array_equal(getattr(whole, name)[y0:y1, x0:x1], getattr(part, name)), (name, crop)


def test_packet_width_changes_nothing(device: Device) -> None:
    """A lane never depends on its neighbours."""
    for seed in range(8):
        for precision in ("accurate", "double", "single"):
            wide = cltrace.Renderer(load(str(seed)), device, precision, ("color", "depth")).render()
            one = cltrace.Renderer(load(str(seed)), device, precision, ("color", "depth"), width=1).render()
            assert np.array_equal(wide.depth, one.depth)
            assert np.allclose(wide.color, one.color, rtol=0, atol=2e-6)


def unskipped(device: Device, names: list[str], precisions: tuple[str, ...]) -> None:
    """Pictures with and without each thing that is skipped: the same bits."""
    outputs = ("rgb8", "color", "depth", "id")
    for name in names:
        for precision in precisions:
            usual = cltrace.Renderer(load(name), device, precision, outputs).render()
            for keep in KEEPS:
                other = cltrace.Renderer(load(name), device, precision, outputs, keep=(keep,)).render()
                for output in outputs:
                    same = np.array_equal(getattr(usual, output), getattr(other, output))
                    assert same, (name, precision, keep, output)


def test_what_is_skipped_changes_no_bit(device: Device) -> None:
    unskipped(device, ["globe", "spot", "captive-light", "thousand", "inside", "1", "7"], ("accurate", "single"))


@pytest.mark.stress
@pytest.mark.parametrize("name", NAMES)
def test_what_is_skipped_changes_no_bit_of_any_scene(device: Device, name: str) -> None:
    unskipped(device, [name], ("accurate", "single", "double"))


def test_shadow_rays_are_counted(device: Device) -> None:
    """One per light that a hit point faces, none without a hit, none for a lone sphere seen from outside."""
    camera = cltrace.Camera((0, 0, 5), (0, 0, 0), horizontal_fov=20, resolution=(40, 40))
    light = cltrace.point_light((0, 0, 5))
    two = Scene.from_spheres(camera, [light, light], [(-0.6, 0, 0), (0.6, 0, 0)], 0.5)
    ids = cltrace.render(two, device, outputs=("id",)).id
    assert ids is not None
    work = cltrace.Renderer(two, device).work()
    asked = work["shadow rays traced"] + work["shadow rays that no sphere can stop"]
    assert asked == 2 * (ids >= 0).sum()
    one = Scene.from_spheres(camera, [light], [(0, 0, 0)], 1.0)
    assert cltrace.Renderer(one, device).work()["shadow rays traced"] == 0
