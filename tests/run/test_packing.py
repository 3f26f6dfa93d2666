"""Packing on a device: every buffer but those of lists has the bits that numpy gives it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from device_views import LIGHTS, PRECISIONS, Gpu, check_same_view, made_lists
from numpy.typing import NDArray
from random_scenes import tunnel

import cltrace
from cltrace.plan.abi import Precision
from cltrace.plan.request import Request
from cltrace.plan.view import CameraView
from cltrace.plan.world import ScenePacking
from cltrace.run import pack
from cltrace.run.devices import Device
from cltrace.run.pack import lists
from cltrace.run.pack.meshes import MeshPacker
from cltrace.run.pack.spheres import SpherePacker
from cltrace.scene import PARALLEL, AnyCamera

Floats = NDArray[np.float64]
pytestmark = pytest.mark.usefixtures("even_few_are_packed")


def both(scene: cltrace.Scene, device: Device, request: Request, *cameras: AnyCamera) -> int:
    """Asserts that the device's views of a scene are numpy's: by its own camera, and by others after it.

    Returns how many the device has made. What parallel lights see is made anew: test_other_cameras.py keeps it.
    """
    world = ScenePacking.of(scene, request)
    packer = SpherePacker(world, request, device)
    # On the device, shadow rays may end on all spheres.
    plain, count = replace(request, keep=(*request.keep, "receivers")), 0
    keep = bool((scene.lights["kind"] != PARALLEL).all())
    for by in (scene.camera, *cameras):
        view, made = packer.view(world, by, keep)
        check_same_view(view, made, packer.tools, CameraView.of(world, by, plain if made else request))
        count += bool(made)
    return count


def camera(**changes: object) -> cltrace.Camera:
    arguments = {"position": (0.1, 0.2, 3.0), "lookat": (0, 0, 0), "horizontal_fov": 50.0, "resolution": (97, 61)}
    return cltrace.Camera(**(arguments | changes))  # type: ignore[arg-type]


def balls(n: int = 300, size: float = 0.1, seed: int = 1) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (n, 3)), rng.uniform(0.1, 1, n) * size


def scene(centers: Floats, radii: Floats | float, lights: object = LIGHTS, **changes: object) -> cltrace.Scene:
    return cltrace.Scene.from_spheres(camera(**changes), lights, centers, radii)  # type: ignore[arg-type]


def far_away() -> cltrace.Scene:
    """At 1e7 from the origin, a coordinate has eight bits after the point."""
    centers, radii = balls()
    shift = np.array([1e7, -1e7, 1e7])
    lights = [cltrace.point_light(shift + (3, 4, 5))]
    return scene(centers + shift, radii, lights, position=tuple(shift + (0, 0, 3)), lookat=tuple(shift))


def touching() -> cltrace.Scene:
    """The eye and a light are on spheres, exactly or but for a last digit: sums cancel to nothing."""
    rng = np.random.default_rng(3)
    step = rng.integers(-8, 9, (200, 3)) / 8
    radii = np.maximum(np.sqrt((step**2).sum(axis=1)), 1 / 64)
    eye, lamp = np.array([0.5, 0.25, 2.0]), np.array([3.0, 1.0, 0.1])
    centers = np.concatenate([eye + step, lamp + step])
    nearly = np.nextafter(radii, rng.choice([0.0, 9.0], 200))
    return scene(centers, np.concatenate([radii, nearly]), [cltrace.point_light(lamp)], position=tuple(eye))


def halfway() -> cltrace.Scene:
    """From the eye, most coordinates are halfway between two doubles."""
    step = np.random.default_rng(3).integers(-8, 9, (300, 3)) / 8
    return scene(step, 0.05, position=(2.0**-54, -(2.0**-54), 3), lookat=(2.0**-54, -(2.0**-54), 0))


def of_all_sizes() -> cltrace.Scene:
    rng = np.random.default_rng(4)
    return scene(rng.uniform(-1, 1, (400, 3)), 2.0 ** rng.uniform(-140, 3, 400))


def in_shells(lights: object = LIGHTS) -> cltrace.Scene:
    """Most spheres are inside of larger ones, which hide them."""
    centers, radii = balls(300, 0.02)
    return scene(np.concatenate([centers * 0.3, [(0, 0, 0), (0.4, 0, 0)]]), np.append(radii, [0.6, 0.6]), lights)


def few_in_light() -> cltrace.Scene:
    """What is seen is so small, as the light sees it, that its grid is made in double."""
    centers, radii = balls(300, 0.1)
    return scene(centers, radii, [cltrace.point_light((0, 900, 0.3))], horizontal_fov=0.3)


def mirrors() -> cltrace.Scene:
    centers, radii = balls()
    return cltrace.Scene.from_spheres(camera(), LIGHTS, centers, radii, reflectance=0.5, transmittance=0.3, index=1.5)


def crowded(**changes: object) -> cltrace.Scene:
    """Thousands of spheres in few cells, and in depths that are equal."""
    centers, radii = balls(3000, 0.3, 6)
    centers[::2] = centers[1::2]
    return scene(centers, radii, **changes)


def in_a_tunnel() -> cltrace.Scene:
    """Far down the tunnel, spheres crowd, and have grids of their own."""
    lights = [cltrace.point_light((0.3, -0.2, z)) for z in (-2, -37)]
    return scene(*tunnel(3000), lights, position=(0, 0, -0.5), lookat=(0, 0, -9))


CASES: dict[str, Callable[[], cltrace.Scene]] = {
    "scattered": lambda: scene(*balls()),
    "one more than lists are made for": lambda: scene(*balls(17)),
    "a whole packet": lambda: scene(*balls(64)),
    "around the eye": lambda: scene(*balls(300, 4.0)),  # and around lights
    "far away": far_away,
    "touching": touching,
    "halfway": halfway,
    "equal": lambda: scene(np.tile(balls(100)[0], (3, 1)), np.tile(balls(100)[1], 3)),
    "of all sizes": of_all_sizes,
    "in shells": in_shells,
    "behind the eye": lambda: scene(balls()[0] + (0, 0, 9), balls()[1]),  # so that no list has anything
    "few in the light": few_in_light,
    "mirrors": mirrors,
    "crowded": crowded,
    "in a tunnel": in_a_tunnel,
    "one cell": lambda: crowded(resolution=(4, 3)),
    "two cells": lambda: crowded(resolution=(5, 3)),
    "no light": lambda: scene(*balls(), []),
    "a view along an axis": lambda: scene(*balls(), position=(0, 0, 3), lookat=(0, 0, 0)),
    "one unit of size": lambda: scene(balls()[0] * 1e30, balls()[1] * 1e30, position=(0, 0, 3e30)),
}


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", CASES)
def test_bits(device: Device, precision: Precision, name: str) -> None:
    both(CASES[name](), device, Request(precision))


@pytest.mark.slow
def test_bits_on_a_gpu(device: Device) -> None:
    """A GPU takes one sphere at a time, and has memory of its own. Here a CPU does that."""
    gpu = Gpu(device.spec, device.cl)
    for make in (crowded, touching, mirrors, few_in_light, in_a_tunnel):
        for precision in ("accurate", "single"):
            both(make(), gpu, Request(precision))


@pytest.mark.parametrize("precision", PRECISIONS)
def test_bits_of_other_cameras(device: Device, precision: Precision) -> None:
    """They have what lights see in common, unless lengths have another unit, or the eye is within what hides others."""
    cameras = [camera(position=p) for p in ((0.1, 0.21, 3.0), (3, 2, -1), (0.2, 0.3, 0.1), (70, 0, 90), (0, 0, 3))]
    for lights in (LIGHTS, LIGHTS[:1] + LIGHTS[2:]):
        both(in_shells(lights), device, Request(precision), *cameras)


def parallel(**changes: object) -> cltrace.Orthographic:
    arguments = {"position": (0.1, 0.2, 3.0), "lookat": (0, 0, 0), "height": 2.5, "resolution": (97, 61)}
    return cltrace.Orthographic(**(arguments | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", CASES)
def test_bits_along_the_view(device: Device, precision: Precision, name: str) -> None:
    """Parallel rays, whose plane is before the spheres, or cuts some, or whose picture is larger than all of them."""
    seen, at = CASES[name](), np.array(CASES[name]().camera.position)
    size = np.abs(seen.columns.center - at).max()
    seen_along = parallel(position=tuple(at), resolution=seen.camera.resolution)
    by = [
        replace(seen_along, lookat=tuple(at + size * np.array(aim)), height=height)
        for aim, height in (((0, 0, -1), 0.7 * size), ((0.1, -0.1, -1), 0.1 * size), ((-1, 0.5, -2), 9 * size))
    ]
    made = both(seen.seen_by(by[0]), device, Request(precision), *by[1:], seen.camera, by[1])
    # A light that is far away makes pixels tiny.
    assert made == 5 or name == "few in the light"


def test_bits_of_what_is_wanted(device: Device) -> None:
    """Of a crop; of antialiased pixels, whose borders are seen, too, so that lists are half a pixel wider; and of
    pixels that float32 does not tell apart, which are numpy's."""
    for request in (Request(crop=(13, 7, 30, 22)), Request(samples=16, crop=(8, 9, 50, 40))):
        for by in (camera(), parallel()):
            both(crowded().seen_by(by), device, request)
    assert not both(crowded().seen_by(parallel(height=2.0**-13, lookat=(0.1, 0.2, 0))), device, Request())


@pytest.mark.parametrize(
    ("kind", "few"), [(Device, 2**17), (Device, 3000), pytest.param(Gpu, 0, marks=pytest.mark.slow)]
)
def test_lists_of_cameras_are_side_by_side(
    device: Device, monkeypatch: pytest.MonkeyPatch, kind: type[Device], few: int
) -> None:
    """What lights see is there once, views of any age keep their lists, and what nobody keeps has others in its place.

    What has no room is in other buffers. A GPU has none to spare.
    """
    monkeypatch.setattr(lists, "LEAST", few)
    world = ScenePacking.of(crowded(lights=LIGHTS[2:]), Request())
    packer = SpherePacker(world, Request(), kind(device.spec, device.cl))
    cameras = [camera(position=(0.1 * k, 0.2, 3 + 0.1 * k)) for k in range(9)]
    views = [(by, *packer.view(world, by)) for by in cameras]
    expected = {}
    for by in cameras:
        fresh = SpherePacker(world, Request(), kind(device.spec, device.cl))
        expected[by] = made_lists(*fresh.view(world, by), fresh.tools)
    assert (len({id(made["entry"]) for _, _, made in views}) == 1) == (few > 3000)
    for by, view, made in views:
        assert made_lists(view, made, packer.tools) == expected[by]
    del by, view, made, views[1:]
    places = set()
    for by in cameras:
        view, made = packer.view(world, by)
        assert packer.lamps is not None
        assert made_lists(view, made, packer.tools) == expected[by]
        places.add(id(packer.lamps.lists))
        del view, made
    assert len(places) == 1
    by, view, made = views[0]
    assert made_lists(view, made, packer.tools) == expected[by]


def test_further_cameras_are_packed_of_fewer(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a quarter of the surfaces on, as long as these stay where they are. All have what lights see in common."""
    monkeypatch.setattr(pack, "MANY", 4 * 3000 - 1)
    renderer, other = cltrace.Renderer(crowded(), device), camera(position=(1.0, 2.0, 2.5))
    moved = renderer.look(other)
    assert ("entry" in renderer.plan.arrays, "entry" in moved.plan.arrays) == (True, False)
    assert np.array_equal(moved.render().rgb8, cltrace.Renderer(crowded().seen_by(other), device).render().rgb8)
    assert renderer.look(camera())._now.packer is renderer.look(other)._now.packer is moved._now.packer
    assert "entry" in moved.update(centers=balls(3000, 0.3, 7)[0]).plan.arrays
    monkeypatch.setattr(pack, "MANY", 4 * 3000)
    assert "entry" in cltrace.Renderer(crowded(), device).look(other).plan.arrays


# ------------------------------------------------------------------------------- triangles, ellipsoids and spheres


def of(vertices: Floats, triangles: NDArray[np.int64], lights: object = LIGHTS, shift: float = 0) -> cltrace.Scene:
    eye = camera(position=(0.1 + shift, 0.2, 3.0), lookat=(shift, 0, 0))
    return cltrace.Scene.from_meshes(eye, lights, cltrace.Mesh(vertices + (shift, 0, 0), triangles))  # type: ignore[arg-type]


def soup(n: int = 301, size: float = 0.2, seed: int = 1) -> tuple[Floats, NDArray[np.int64]]:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (n, 1, 3)) + rng.normal(size=(n, 3, 3)) * size
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def edge_on() -> cltrace.Scene:
    """The eye and a light are in the planes of triangles, exactly or but for a last digit."""
    rng = np.random.default_rng(2)
    grid = rng.integers(-8, 9, (300, 3, 3)) / 8
    eye, lamp = np.array([0.1, 0.2, 3.0]), np.array([3.0, 4.0, 5.0])
    grid[:100, 2] = eye + (grid[:100, 0] - eye) * 2 + (grid[:100, 1] - eye) * -0.5
    grid[100:200, 2] = lamp + (grid[100:200, 0] - lamp) / 4 + (grid[100:200, 1] - lamp) / 2
    grid[200:] = grid[:100] * (1 + 2.0**-52)
    return of(grid.reshape(-1, 3), np.arange(900).reshape(-1, 3))


def ellipsoids(n: int, meshes: object = ()) -> cltrace.Scene:
    rng = np.random.default_rng(5)
    maps = np.where(rng.random(n)[:, None, None] < 0.3, np.eye(3), rng.normal(size=(n, 3, 3)))
    centers, radii = rng.uniform(-1, 1, (n, 3)), rng.uniform(0.02, 0.1, n)
    return cltrace.Scene.from_spheres(camera(), LIGHTS, centers, radii, transform=maps, meshes=meshes)  # type: ignore[arg-type]


MIXED: dict[str, Callable[[], cltrace.Scene]] = {
    "soup": lambda: of(*soup()),
    "one": lambda: of(*soup(1)),
    "around the eye": lambda: of(*soup(301, 4.0)),
    "around a light": lambda: of(soup()[0] * 4, soup()[1]),
    "many": lambda: of(*soup(70_000, 0.02)),
    "needles": lambda: of(soup()[0] * (1, 1e-7, 1), soup()[1]),
    "tiny": lambda: of(*soup(301, 1e-13)),
    "small": lambda: of(soup()[0] * 2.0**-14, soup()[1]),
    "edge on": edge_on,
    "far away": lambda: of(*soup(), LIGHTS[:2], 1e7),
    "ellipsoids": lambda: ellipsoids(300),
    "ellipsoids and triangles": lambda: ellipsoids(300, cltrace.Mesh(*soup())),
    "one cell": lambda: of(*soup()).seen_by(camera(resolution=(4, 3))),
    "nothing seen": lambda: of(*soup()).seen_by(camera(lookat=(0, 0, 12))),
    "no light": lambda: of(*soup(), []),
}


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize(
    ("name", "kind"), [*((name, Device) for name in MIXED), pytest.param("edge on", Gpu, marks=pytest.mark.slow)]
)
def test_bits_of_what_numpy_packs_with_a_device(
    device: Device, precision: Precision, name: str, kind: type[Device]
) -> None:
    """Buffers of triangles, ellipsoids and spheres, but for lists, have the bits of numpy's."""
    seen, request = MIXED[name](), Request(precision)
    world = ScenePacking.of(seen, request)
    packer = MeshPacker(world, request, kind(device.spec, device.cl))
    view, made = packer.view(world, seen.camera)
    check_same_view(view, made, packer.tools, CameraView.of(world, seen.camera, request))
