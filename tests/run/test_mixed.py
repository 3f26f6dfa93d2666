"""Worlds of triangles, ellipsoids and spheres that a device helps to pack: buffers but those of lists have the bits of
numpy's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from device_views import LIGHTS, PRECISIONS, Gpu, check_same_view
from numpy.typing import NDArray

import cltrace
from cltrace.plan.abi import Precision
from cltrace.plan.request import Request
from cltrace.plan.view import CameraView
from cltrace.plan.world import ScenePacking
from cltrace.run.devices import Device
from cltrace.run.pack.meshes import MeshPacker

Floats = NDArray[np.float64]
pytestmark = pytest.mark.usefixtures("even_few_are_packed")


def both(scene: cltrace.Scene, device: Device, request: Request) -> None:
    """Asserts that the device's view of a scene is numpy's."""
    world = ScenePacking.of(scene, request)
    mixed = MeshPacker.of(world, request, device)
    assert mixed is not None
    view, made = mixed.view(world, scene.camera)
    check_same_view(view, made, mixed.tools, CameraView.of(world, scene.camera, request))


def scene(vertices: Floats, triangles: NDArray[np.int64], lights: object = LIGHTS, shift: float = 0) -> cltrace.Scene:
    camera = cltrace.Camera(position=(0.1 + shift, 0.2, 3.0), lookat=(shift, 0, 0), resolution=(97, 61))
    return cltrace.Scene.from_meshes(camera, lights, cltrace.Mesh(vertices + (shift, 0, 0), triangles))  # type: ignore[arg-type]


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
    return scene(grid.reshape(-1, 3), np.arange(900).reshape(-1, 3))


def ellipsoids(n: int, meshes: object = ()) -> cltrace.Scene:
    rng = np.random.default_rng(5)
    maps = np.where(rng.random(n)[:, None, None] < 0.3, np.eye(3), rng.normal(size=(n, 3, 3)))
    camera = cltrace.Camera(position=(0.1, 0.2, 3.0), lookat=(0, 0, 0), resolution=(97, 61))
    centers, radii = rng.uniform(-1, 1, (n, 3)), rng.uniform(0.02, 0.1, n)
    return cltrace.Scene.from_spheres(camera, LIGHTS, centers, radii, transform=maps, meshes=meshes)  # type: ignore[arg-type]


CASES: dict[str, Callable[[], cltrace.Scene]] = {
    "soup": lambda: scene(*soup()),
    "one": lambda: scene(*soup(1)),
    "around the eye": lambda: scene(*soup(301, 4.0)),
    "around a light": lambda: scene(soup()[0] * 4, soup()[1]),
    "many": lambda: scene(*soup(70_000, 0.02)),
    "needles": lambda: scene(soup()[0] * (1, 1e-7, 1), soup()[1]),
    "tiny": lambda: scene(*soup(301, 1e-13)),
    "small": lambda: scene(soup()[0] * 2.0**-14, soup()[1]),
    "edge on": edge_on,
    "far away": lambda: scene(*soup(), LIGHTS[:2], 1e7),
    "ellipsoids": lambda: ellipsoids(300),
    "ellipsoids and triangles": lambda: ellipsoids(300, cltrace.Mesh(*soup())),
    "one cell": lambda: scene(*soup()).seen_by(cltrace.Camera(position=(0, 0, 3), lookat=(0, 0, 0), resolution=(4, 3))),
    "nothing seen": lambda: scene(*soup()).seen_by(cltrace.Camera(position=(0, 0, 9), lookat=(0, 0, 12))),
    "no light": lambda: scene(*soup(), []),
}


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", CASES)
def test_bits(device: Device, precision: Precision, name: str) -> None:
    both(CASES[name](), device, Request(precision))


@pytest.mark.slow
def test_bits_on_a_gpu(device: Device) -> None:
    """A GPU takes one triangle at a time, and has memory of its own. Here a CPU does that."""
    both(edge_on(), Gpu(device.spec, device.cl), Request())
