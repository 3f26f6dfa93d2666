"""Cameras by their full angle, and cameras that are fitted to a scene."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from cltrace import Camera, Mesh, Orthographic, Scene
from cltrace.scene.camera import VIEWS, reaches_of

WIDE, HIGH = (640, 480), (480, 640)


def test_the_full_angle_is_twice_the_half_one() -> None:
    assert Camera(fov=50, resolution=WIDE) == Camera(horizontal_fov=25, resolution=WIDE)
    assert Camera().horizontal_fov == 45


@pytest.mark.parametrize("square", [True, False])
@pytest.mark.parametrize("size", [WIDE, HIGH, (7, 7), (3, 100)])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_full_angle_is_that_of_the_axis(axis: str, size: tuple[int, int], square: bool) -> None:
    camera = Camera(fov=4, fov_axis=axis, resolution=size, square_pixels=square)  # type: ignore[arg-type]
    assert camera.half_angles()["xy".index(axis)] == pytest.approx(2, rel=1e-14)


def test_such_a_camera_is_a_camera_like_others() -> None:
    camera = Camera(fov=50, fov_axis="y", resolution=WIDE)
    same = (replace(camera), pickle.loads(pickle.dumps(camera)), eval(repr(camera), {"Camera": Camera}))
    assert all(other == camera and hash(other) == hash(camera) for other in same)


def scene_of(kind: str, rng: np.random.Generator) -> Scene:
    """A few surfaces off the middle of the world."""
    camera, n = Camera(resolution=(64, 40)), 30
    center, radius = rng.normal(size=(n, 3)) * (3, 1, 2) + (5, -2, 7), rng.uniform(0.05, 0.7, n)
    if kind == "meshes":
        faces = rng.integers(0, n, (40, 3))
        return Scene.from_meshes(camera, [], [Mesh(center, faces[: 1 + k]) for k in range(3)])
    maps = rng.normal(size=(n, 3, 3)) if kind == "ellipsoids" else None
    mesh = Mesh(center[:3] + (0, 3, 0), [(0, 1, 2)]) if kind == "all" else ()
    return Scene.from_spheres(camera, [], center, radius, transform=maps, meshes=mesh)


def points_of(scene: Scene, rng: np.random.Generator) -> np.ndarray:
    """Points on all of its surfaces, (n, 3)."""
    found = [mesh.vertices[mesh.geometry.faces].reshape(-1, 3) for mesh in scene.meshes]
    for one in scene.spheres:
        s = rng.normal(size=(4000, 3))
        s /= np.sqrt((s * s).sum(axis=1, keepdims=True))
        if one["to_object"] >= 0:
            s = s @ np.linalg.inv(scene.to_object[one["to_object"]]).T
        found.append(one["center"] + one["radius"] * s)
    return np.concatenate(found)


@pytest.mark.parametrize("kind", ["spheres", "ellipsoids", "meshes", "all"])
@pytest.mark.parametrize("view", [*VIEWS, (1, 2, -0.5)])
@pytest.mark.parametrize("margin", [0, 0.1])
def test_a_fitted_camera_sees_all_and_touches(kind: str, view: str | tuple[float, ...], margin: float) -> None:
    """No point is in the margin, and some is at its edge but for what the points leave of the surfaces."""
    rng = np.random.default_rng(15)
    scene = scene_of(kind, rng)
    camera = Camera.fit(scene, view, margin)
    assert camera.resolution == scene.camera.resolution
    x, y, z = np.array(camera.basis())
    from_eye = points_of(scene, rng) - np.array(camera.position)
    assert (from_eye @ z < 0).all()
    wide, high = camera.image_plane()
    across = from_eye @ x / (from_eye @ -z) / wide, from_eye @ y / (from_eye @ -z) / high
    ends = [(side.min(), side.max()) for side in across]
    least = 1 - 2 * margin - 0.01
    assert all(max(-low, high) < 1 - 2 * margin + 1e-12 for low, high in ends)
    assert any(-low > least and high > least for low, high in ends)  # on both sides: no nearer eye sees all


@pytest.mark.parametrize("kind", ["spheres", "ellipsoids", "meshes", "all"])
@pytest.mark.parametrize("view", [*VIEWS, (1, 2, -0.5)])
@pytest.mark.parametrize("size", [(64, 40), (9, 30)])
def test_a_fitted_orthographic_camera(kind: str, view: str | tuple[float, ...], size: tuple[int, int]) -> None:
    """All is before its plane and out of the margin, in the middle, and along one axis as large as it can be."""
    rng = np.random.default_rng(15)
    scene = scene_of(kind, rng)
    camera = Orthographic.fit(scene, view, 0.1, resolution=size)
    x, y, z = np.array(camera.basis())
    from_eye = points_of(scene, rng) - np.array(camera.position)
    assert (from_eye @ z).max() == pytest.approx(-camera.height, rel=0.05)
    ends = [((from_eye @ axis) / half) for axis, half in zip((x, y), camera.image_plane(), strict=True)]
    for across in ends:
        assert max(-across.min(), across.max()) < 0.8 + 1e-12
        assert across.min() + across.max() == pytest.approx(0, abs=0.01)
    assert max(np.ptp(across) for across in ends) > 1.58


def test_reaches_are_those_of_the_surfaces_and_not_of_a_box() -> None:
    scene = Scene.from_spheres(Camera(), [], [(1, 2, 3), (0, 0, 0)], [1, 0.5])
    assert reaches_of(scene, [(1, 0, 0), (0, 0, -2), (1, 1, 1)]) == pytest.approx([2, 1, 6 + math.sqrt(3)])


def test_views_have_the_axes_that_their_names_say() -> None:
    scene = scene_of("spheres", np.random.default_rng(1))
    assert Camera.fit(scene, "front").basis() == ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    assert Camera.fit(scene, "right").basis() == ((0, 0, -1), (0, 1, 0), (1, 0, 0))
    assert Camera.fit(scene, "top").basis() == ((1, 0, 0), (0, 0, -1), (0, 1, 0))
    assert Camera.fit(scene, "bottom").basis() == ((1, 0, 0), (0, 0, 1), (0, -1, 0))
    assert Camera.fit(scene, "top", up=(1, 0, 0)).basis() == ((0, 0, 1), (1, 0, 0), (0, 1, 0))
