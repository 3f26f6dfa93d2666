"""What users hand to Mesh and Material: arrays of every kind and layout, other libraries' objects, and mistakes."""

from __future__ import annotations

import pickle
from types import SimpleNamespace as Thing
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

from cltrace import Camera, Material, Mesh, Scene

V = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
F = [(0, 1, 2), (0, 2, 3)]


def same(mesh: Mesh, vertices: object = V, faces: object = F) -> None:
    shape = mesh.geometry
    assert (shape.vertices.dtype, shape.faces.dtype) == (np.float64, np.int32)
    assert np.array_equal(shape.vertices, vertices)
    assert np.array_equal(shape.faces, faces)


@pytest.mark.parametrize("dtype", ["f2", "<f4", ">f4", "<f8", ">f8", "g", "i1", "u2", ">i8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_vertices_of_every_type(dtype: str, order: Any) -> None:
    same(Mesh(np.array(V, dtype, order=order), F))


@pytest.mark.parametrize("dtype", ["i1", "u1", "<i2", ">u2", "<i4", ">i4", "<u4", "i8", ">u8", "f4", ">f8"])
def test_faces_of_every_type(dtype: str) -> None:
    same(Mesh(V, np.array(F, dtype)))
    same(Mesh(V, np.array(F, dtype)[::-1, ::-1][::-1, ::-1]))


def test_views_of_larger_arrays() -> None:
    wide = np.full((8, 5), np.nan)
    wide[::2, 1:4] = V
    same(Mesh(wide[::2, 1:4], np.array(F)))
    columns = np.array([(v, 9) for v in range(2)], [("f", "i4"), ("x", "i4")])
    assert len(Mesh(np.broadcast_to(0.5, (3, 3)), np.stack([columns["f"]] * 3, 1)).geometry.faces) == 2
    frozen = np.array(V)
    frozen.flags.writeable = False
    same(Mesh(frozen, F))


def test_what_is_given_is_copied() -> None:
    vertices, faces, normals, uv = np.array(V), np.array(F, np.int32), np.ones((4, 3)), np.zeros((4, 2))
    texture, matrix = np.zeros((2, 2, 3), np.uint8), np.eye(4)
    mesh = Mesh(vertices, faces, normals, uv, Material(texture=texture), matrix)
    for array in (vertices, faces, normals, uv, texture, matrix):
        assert array.flags.writeable
        array[:] = 3
    scene = Scene.from_meshes(Camera(), [], mesh)
    same(mesh)
    assert np.array_equal(scene.meshes[0].vertices, V)
    assert np.array_equal(scene.meshes[0].geometry.normals, np.ones((4, 3)))
    assert not scene.textures[0].any()
    shape = scene.meshes[0].geometry
    for array in (shape.vertices, shape.faces, shape.normals, shape.uv, scene.textures[0], scene.meshes[0].vertices):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0


def test_meshes_share_what_they_are_made_of() -> None:
    texture = np.zeros((2, 2, 3), np.uint8)
    one = Mesh(V, F, material=Material(texture=texture))
    two = Mesh.of(one, material=one.material, transform=np.diag([2, 2, 2]))
    scene = Scene.from_meshes(Camera(), [], [one, one, two])
    for made in (scene, pickle.loads(pickle.dumps(scene))):
        assert len({id(mesh.geometry) for mesh in made.meshes}) == 1
        assert len(made.textures) == 1
        assert len(made.materials) == 1
        assert [mesh.number for mesh in made.meshes] == [0, 1, 2]
        assert np.array_equal(made.meshes[2].vertices, 2 * np.array(V))


def test_objects_of_other_libraries() -> None:
    class Tracked(np.ndarray):
        """As trimesh has them."""

    faces = np.array(F)
    quads = np.array([[0, 1, 2, 3]])
    same(Mesh.of(Thing(vertices=np.array(V).view(Tracked), faces=faces.view(Tracked))))
    block = Thing(type="triangle", data=faces)
    line = Thing(type="line", data=np.array([[0, 1]]))
    same(Mesh.of(Thing(points=np.array(V), cells=[line, block])))
    same(Mesh.of(Thing(points=np.array(V), cells=[("triangle", faces)])))
    both = Mesh.of(Thing(points=np.array(V), cells=[block, Thing(type="quad", data=quads)]))
    same(both, V, [*F, (0, 1, 2), (0, 2, 3)])
    same(Mesh.of(Thing(points=np.array(V), cells=[Thing(type="polygon", data=quads)])), V, [(0, 1, 2), (0, 2, 3)])


def test_nothing_is_a_mesh_too() -> None:
    for vertices, faces in (([], []), (V, []), (np.zeros((0, 3)), np.zeros((0, 3), int)), ([], np.zeros((0, 3)))):
        scene = Scene.from_meshes(Camera(), [], Mesh(vertices, faces))
        assert len(scene.meshes) == 1
        assert len(scene.meshes[0].geometry.faces) == 0
    assert len(Scene.from_meshes(Camera(), [], []).meshes) == 0


def test_textures_of_every_kind() -> None:
    rng = np.random.default_rng(0)
    rgba = rng.integers(0, 256, (3, 5, 4), np.uint8)
    deep = rng.integers(0, 65536, (3, 5, 3), np.uint16)

    def texture(image: object) -> np.ndarray:
        got = Material(texture=image).texture
        assert got is not None
        assert got.shape == (3, 5, 3)
        assert got.flags.c_contiguous
        assert not got.flags.writeable
        return got

    for image in (rgba, rgba[..., :3], np.asfortranarray(rgba), np.flipud(np.flipud(rgba)), Picture.fromarray(rgba)):
        assert np.array_equal(texture(image), rgba[..., :3])
    for image in (rgba[..., 1], Picture.fromarray(np.ascontiguousarray(rgba[..., 1]))):
        assert np.array_equal(texture(image), np.repeat(rgba[..., 1:2], 3, axis=2))
    for image in (deep, deep.astype(">u2"), deep.astype("<u2")):
        got = texture(image)
        assert got.dtype == np.uint16
        assert got.dtype.isnative
        assert np.array_equal(got, deep)
    grey = Picture.fromarray(np.ascontiguousarray(deep[..., 0]))
    assert grey.mode.startswith("I;16")
    assert np.array_equal(texture(grey), np.repeat(deep[..., :1], 3, axis=2))
