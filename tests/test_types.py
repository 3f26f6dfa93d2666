"""What a type checker knows of the Python interface. mypy checks this file; pytest runs it.

A line that mypy must refuse says so in its `type: ignore`: mypy also complains where such a comment is not needed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, assert_type

import numpy as np
import pytest
from numpy.typing import NDArray

from cltrace import (
    Camera,
    Explanation,
    Image,
    Material,
    Mesh,
    Scene,
    ambient_light,
    colorbar,
    explain,
    parallel_light,
    render,
    spot_light,
)
from cltrace.picture.image import Output, Show

RGB8 = np.zeros((1, 2, 3), np.uint8)
SCENE = Scene.from_spheres(Camera(), [], [(0, 0, -3)], 1)


def test_vectors_may_be_tuples_lists_and_arrays() -> None:
    camera = Camera(position=np.zeros(3), lookat=[0, 0, -1], up=(0, 1, 0), resolution=(2, 1))
    assert_type(camera.position, tuple[float, float, float])
    lights = [ambient_light(np.ones(3)), parallel_light([0, 0, -1]), spot_light((0, 0, 0), [0, 0, 1], 1, 2)]
    one: Scene = Scene.from_spheres(
        camera, lights, np.zeros((4, 3)), 1.0, [0.5, 0.5, 0.5], kd=np.ones(4), background=[0, 0, 0]
    )
    two: Scene = Scene.from_spheres(camera, lights[0], [(0, 0, 0)], [1], reflectance=0.5, transform=np.diag([1, 2, 3]))
    shown: Scene = Scene.from_spheres(
        camera, [], np.zeros((2, 3)), 1, values=[1, 2], cmap="gray", clim=(0, 3), background="#fff0", transfer="srgb"
    )
    named: Scene = Scene.from_spheres(camera, ambient_light("white"), [(0, 0, 0)], 1, ["red"], background=(1, 1, 1, 0))
    assert shown.in_front_of("white").background_alpha == 1 > named.background_alpha
    assert_type(colorbar(clim=(0, 2), color="red"), NDArray[np.uint8])
    assert (len(one.spheres), len(two.lights)) == (4, 1)
    assert_type(one.background, tuple[float, float, float])
    assert_type(two.to_object, NDArray[np.float64])
    three: Scene = Scene(camera, two.lights, two.spheres, two.materials, to_object=[((1, 0, 0), (0, 1, 0), (0, 0, 2))])
    assert three.to_object.shape == (1, 3, 3)


def test_meshes_may_be_lists_and_arrays() -> None:
    mesh = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.arange(3).reshape(1, 3), transform=np.eye(4))
    other = Mesh.of(mesh, Material((1, 0, 0), kd=0.5, texture=np.zeros((1, 2, 3), np.uint8)))
    one: Scene = Scene.from_meshes(Camera(), ambient_light(), mesh)
    two: Scene = Scene.from_spheres(Camera(), [], [(0, 0, -3)], 1, meshes=[mesh, other])
    assert_type(two.sphere_numbers, NDArray[np.int32])
    assert_type(one.meshes[0].vertices, NDArray[np.float64])
    assert_type(one.meshes[0].geometry.faces, NDArray[np.int32])
    assert len(two.textures) == len(two.meshes) - 1 == len(one.meshes)


def test_outputs_are_arrays_and_not_optional() -> None:
    image = Image(rgb8=RGB8, depth=np.ones((1, 2)), id=np.zeros((1, 2), np.int32))
    assert_type(image.rgb8, NDArray[np.uint8])
    assert_type(image.depth, NDArray[np.float64])
    assert_type(image.id, NDArray[np.int32])
    assert image.depth.max() == image.rgb8.shape[0]
    assert_type(image.outputs, tuple[Output, ...])
    show: Show = "depth"
    assert_type(image.as_rgb8(show), NDArray[np.uint8])


def test_explanations() -> None:
    camera = Camera((0, 0, 5), (0, 0, 0), horizontal_fov=30, resolution=(3, 3))
    found = explain(Scene.from_spheres(camera, [], [(0, 0, 0)], 1), 1, 1)
    assert_type(found, Explanation)
    assert_type(found.rgb8, tuple[int, int, int])
    assert found.rays[0].hit is not None
    assert_type(found.rays[0].hit.point, tuple[float, float, float])


REFUSED: list[Callable[[], Any]] = [
    lambda: Camera(lookat=None),  # type: ignore[arg-type]
    lambda: Camera(horizontal_fov="30"),  # type: ignore[arg-type]
    lambda: Camera(resolution=512),  # type: ignore[arg-type]
    lambda: Scene.from_spheres([], Camera(), [(0, 0, 0)], 1),  # type: ignore[arg-type]
    lambda: Scene.from_meshes(Camera(), [], [RGB8]),  # type: ignore[list-item]
    lambda: Mesh([(0, 0, 0)], [(0, 0, 0)], material="red"),  # type: ignore[arg-type]
    lambda: render(SCENE, outputs=("rbg",)),  # type: ignore[arg-type]
    lambda: Image(rgb8=RGB8).as_rgb8("heat"),  # type: ignore[arg-type]
    lambda: Image(rgb8=RGB8).save("x.png", "rgb8"),  # type: ignore[arg-type]
    lambda: Image(rgb8=RGB8).save("x.npz", outputs=("rbg",)),  # type: ignore[arg-type]
    lambda: Scene.from_meshes(Camera(), [], [], transfer="gamma"),  # type: ignore[arg-type]
    lambda: Image(rgb8=RGB8).colour,  # type: ignore[attr-defined]
]


@pytest.mark.parametrize("call", REFUSED)
def test_what_a_type_checker_refuses_is_refused(call: Callable[[], Any]) -> None:
    with pytest.raises((ValueError, TypeError, AttributeError)):
        call()
