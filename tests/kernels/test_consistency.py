"""The kernel against the reference: every device, packet width and precision, on every scene and on random ones."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from conftest import SCENES, world
from random_scenes import random_scene
from stress_cases import picture, renderer

import cltrace
from cltrace import Scene
from cltrace.plan.request import KEEPS
from cltrace.reference import byte_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device
from cltrace.students.check import sample

RANDOM = range(24)
# The reference tries every sphere for every pixel: so many tests a scene take it a tenth of a second.
TESTS = 20_000


@dataclass(frozen=True)
class Expected:
    """What the reference says of some pixels: their flat positions, bytes, ids, distances, and in the world the unit
    vectors in which they are seen and the normals.
    """

    at: np.ndarray
    rgb8: np.ndarray
    id: np.ndarray
    depth: np.ndarray
    direction: np.ndarray
    normal: np.ndarray


@functools.cache
def load(name: str) -> Scene:
    if name.isdigit():
        return random_scene(int(name))
    return cltrace.load(next(path for path in SCENES if path.stem == name))


@functools.cache
def expected(name: str, most: int = 300) -> Expected:
    """most: of how many pixels."""
    scene = load(name)
    width, height = scene.camera.resolution
    # Where ids change is most to be got wrong. Which pixels those are, any device may say.
    count = min(width * height, max(60, min(most, TESTS // (len(scene.spheres) + scene.triangles))))
    at = sample(picture(scene).id, count)
    rays = [primary_ray(scene.camera, int(i) % width, int(i) // width) for i in at]
    results = [trace(world(scene), ray) for ray in rays]
    basis = np.array(scene.camera.basis())
    return Expected(
        at,
        np.array([[byte_of(c) for c in color] for color, _ in results]),
        np.array([hit.index if hit else -1 for _, hit in results]),
        np.array([hit.distance if hit else np.inf for _, hit in results]),
        np.array([tuple(ray.direction.normalized()) for ray in rays]) @ basis,
        np.array([tuple(hit.normal) if hit else (0, 0, 0) for _, hit in results]) @ basis,
    )


MESHES = {path.stem for path in SCENES if "<mesh" in path.read_text("utf-8")}
# Two of the scenes with meshes; tests/kernels/test_scenes.py holds more of them
# against the reference, where there is time for their programs.
SOME_MESHES = {"step4-meshes", "step8-cone"}
NAMES = [path.stem for path in SCENES if path.stem not in MESHES - SOME_MESHES] + [str(seed) for seed in RANDOM]
# Scenes that need a program of their own, which takes long to compile: the long run has them. There,
# tests/kernels/test_scenes.py has more of them, in the other precisions.
OWN_PROGRAM = {"dusk", "four-mirrors", *MESHES}
# Spheres that float32 cannot hold relative to the camera: ordinary scenes are the others.
HOSTILE = {"globe"}


@pytest.mark.slow
def test_kernel_agrees_with_the_reference_in_all_scenes(device: Device) -> None:
    agree(device, device.width, "accurate", NAMES, most=800)


@pytest.mark.parametrize("precision", ["accurate", pytest.param("double", marks=pytest.mark.slow), "single"])
def test_kernel_agrees_with_the_reference(device: Device, width: int, precision: str) -> None:
    agree(device, width, precision, [name for name in NAMES if name not in OWN_PROGRAM])


def agree(device: Device, width: int, precision: str, names: list[str], most: int = 300) -> None:
    differing = total = 0
    for name in names:
        want = expected(name, most)
        image = picture(load(name), device, precision, width)
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


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["accurate", "double"])
def test_normals_and_directions(device: Device, precision: str) -> None:
    for name in [*(path.stem for path in SCENES[:6]), *map(str, range(6))]:
        scene, want = load(name), expected(name)
        image = picture(scene, device, precision)
        assert np.abs(image.direction.reshape(-1, 3)[want.at] - want.direction).max() <= 1e-7
        assert np.abs(image.normal.reshape(-1, 3)[want.at] - want.normal).max() <= 1e-7


def test_drivers_agree_on_ids_and_distances() -> None:
    """Double precision is rounded the same everywhere, so all drivers and packet widths give the same bits."""
    for name in map(str, RANDOM):
        images = [
            picture(load(name), device, "accurate", width)
            for device in cltrace.devices()
            if device.has_double
            for width in {1, device.width}
        ]
        for other in images[1:]:
            assert np.array_equal(images[0].id, other.id), name
            assert np.array_equal(images[0].depth, other.depth), name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first", "spot", "step6-textures", *map(str, RANDOM)])
def test_drivers_agree_on_every_byte_in_double(name: str) -> None:
    """Colours in double are rounded the same everywhere, too, with highlights, spot lights, textures and bounces."""
    scene = load(name)
    images = [
        picture(scene, device, "double", width)
        for device in cltrace.devices()
        if device.has_double
        for width in {1, device.width}
    ]
    for other in images[1:]:
        assert np.array_equal(images[0].rgb8, other.rgb8)
        assert np.array_equal(images[0].color, other.color)


def test_crop_is_those_pixels_of_the_whole_picture(device: Device, width: int) -> None:
    scene = load("1")
    for precision in ("accurate", "single"):
        whole = picture(scene, device, precision, width)
        for crop in [(0, 0, 1, 1), (3, 5, 20, 18), (0, 7, 33, 8), (13, 2, 14, 31)]:
            part = picture(scene, device, precision, width, crop=crop)
            x0, y0, x1, y1 = crop
            for name in ("rgb8", "id", "depth"):
                assert np.array_equal(getattr(whole, name)[y0:y1, x0:x1], getattr(part, name)), (name, crop)


def test_rows_are_those_of_the_whole_picture(device: Device, width: int) -> None:
    """With the lists of all of it."""
    whole = renderer(load("1"), device, "accurate", width, crop=(3, 2, 31, 30))
    image = whole.render()
    for first, end in [(2, 3), (2, 21), (9, 16), (17, 30), (29, 30)]:
        part = whole.rows(first, end)
        assert part.region == (3, first, 28, end - first)
        for name in ("rgb8", "id", "depth"):
            assert np.array_equal(getattr(image, name)[first - 2 : end - 2], getattr(part.render(), name)), (
                name,
                first,
            )
    looked = whole.rows(9, 16).look(whole.scene.camera)  # packs for these rows alone
    assert np.array_equal(image.rgb8[7:14], looked.render().rgb8)
    for first, end in [(1, 5), (2, 31), (7, 7)]:
        with pytest.raises(ValueError, match=r"rows: must be within 2\.\.30 and not empty"):
            whole.rows(first, end)


@pytest.mark.parametrize(
    "precision", ["accurate", *(pytest.param(name, marks=pytest.mark.slow) for name in ("double", "single"))]
)
def test_packet_width_changes_nothing(device: Device, precision: str) -> None:
    """A lane never depends on its neighbours."""
    for seed in range(8):
        wide = picture(load(str(seed)), device, precision)
        one = picture(load(str(seed)), device, precision, 1)
        assert np.array_equal(wide.depth, one.depth)
        assert np.allclose(wide.color, one.color, rtol=0, atol=2e-6)


LEAN = ("rgb8", "color", "depth", "id")


def unskipped(device: Device, names: list[str], precisions: tuple[str, ...]) -> None:
    """Pictures with and without each thing that is skipped: the same bits. For features, see test_scenes.py."""
    for name in names:
        for precision in precisions:
            usual = picture(load(name), device, precision)
            for keep in set(KEEPS) - {"features"}:
                other = picture(load(name), device, precision, keep=(keep,))
                for output in LEAN:
                    same = np.array_equal(getattr(usual, output), getattr(other, output))
                    assert same, (name, precision, keep, output)


@pytest.mark.slow
def test_what_is_skipped_changes_no_bit(device: Device) -> None:
    unskipped(device, ["globe", "thousand", "inside", "1"], ("accurate", "single"))


@pytest.mark.stress
@pytest.mark.parametrize("name", NAMES)
def test_what_is_skipped_changes_no_bit_of_any_scene(device: Device, name: str) -> None:
    unskipped(device, [name], ("accurate", "single", "double"))
    for precision in ("accurate", "single", "double"):
        lean, full = cltrace.render(load(name), device, precision, LEAN), picture(load(name), device, precision)
        for output in LEAN:
            assert np.array_equal(getattr(lean, output), getattr(full, output)), (name, precision, output)


@pytest.mark.slow
def test_shadow_rays_are_counted(device: Device) -> None:
    """One per light that a hit point faces, none without a hit, none for a lone sphere seen from outside."""
    camera = cltrace.Camera((0, 0, 5), (0, 0, 0), horizontal_fov=20, resolution=(40, 40))
    light = cltrace.point_light((0, 0, 5))
    two = Scene.from_spheres(camera, [light, light], [(-0.6, 0, 0), (0.6, 0, 0)], 0.5)
    ids = picture(two, device).id
    work = renderer(two, device).work()
    asked = work["shadow rays traced"] + work["shadow rays that no sphere can stop"]
    assert asked == 2 * (ids >= 0).sum()
    one = Scene.from_spheres(camera, [light], [(0, 0, 0)], 1.0)
    assert renderer(one, device).work()["shadow rays traced"] == 0
