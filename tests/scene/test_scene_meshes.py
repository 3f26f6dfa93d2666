"""Meshes of a scene: where they are in the world, their fronts, normals and numbers, and what they are made of."""

from __future__ import annotations

import pickle
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace as Thing
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

from cltrace import Camera, Material, Mesh, Scene, ambient_light
from cltrace.scene import MATERIAL, SPHERE, Geometry, PlacedMesh

V = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1.0)])
F = np.array([(0, 1, 2), (0, 2, 3), (3, 2, 1)])
SHAPE = Geometry(V, F)
LIGHTS = [ambient_light()]
TEXTURE = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)


def exactly(to_world: np.ndarray, point: np.ndarray) -> list[Fraction]:
    rows = [list(map(Fraction, row)) for row in to_world.tolist()]
    p = list(map(Fraction, point.tolist()))
    return [sum((a * b for a, b in zip(row, p, strict=False)), row[3]) for row in rows]


# --- In the world


@pytest.mark.parametrize("size", [1.0, 1e-30, 1e30])
def test_vertices_in_the_world_are_rounded_once(size: float) -> None:
    """But where what cancels leaves less than 2^-50 of the terms, in which pairs of doubles end."""
    rng = np.random.default_rng(3)
    shape = Geometry(rng.normal(size=(300, 3)) * size, np.zeros((0, 3)))
    for _ in range(3):
        to_world = rng.normal(size=(3, 4))
        to_world[:, 3] *= size
        placed = PlacedMesh(shape, to_world)
        for got, point in zip(placed.vertices, shape.vertices, strict=True):
            assert got.tolist() == [float(x) for x in exactly(to_world, point)]


def test_what_cancels_is_exact_where_the_products_are() -> None:
    to_world = np.array([[3.0, 0, 0, -3.0], [0, 0.5, 0, -1e16], [1, 1, 1, 0]])
    shape = Geometry([(1 + 2.0**-52, 2e16 + 4, 1.0), (1, 2e16, -1)], np.zeros((0, 3)))
    want = [[float(x) for x in exactly(to_world, point)] for point in shape.vertices]
    assert PlacedMesh(shape, to_world).vertices.tolist() == want
    assert want[0][:2] == [3 * 2.0**-52, 2]


def test_normals_stay_upright() -> None:
    """By the inverse transposed but for a factor: what was orthogonal is so in the world. Lengths are kept in range."""
    rng = np.random.default_rng(4)
    for size in (1e-12, 1.0, 1e12):
        linear = rng.normal(size=(3, 3)) * size
        placed = PlacedMesh(SHAPE, np.concatenate([linear, rng.normal(size=(3, 1))], axis=1))
        assert 1 <= np.abs(placed.normal_to_world).max() < 2
        scaled = placed.normal_to_world @ linear.T
        np.testing.assert_allclose(scaled / scaled[0, 0], np.eye(3), atol=1e-12)
        assert scaled[0, 0] > 0


@pytest.mark.parametrize(
    ("normals", "normal_of", "front"),
    [
        ((), None, [1, 1, 1]),
        ([(0, 0, 1)], [(0, 0, 0)] * 3, [1, 1, -1]),
        ([(0, 0, -2)], [(0, 0, 0)] * 3, [-1, 1, 1]),
        ([(0, 0, 1), (0, 0, -1)], [(0, 1, 1), (-1, -1, -1), (1, 1, 1)], [-1, 1, 1]),
        ([(0, 0, 1), (0, 0, -1), (5, 0, 0)], [(0, 1, 2), (2, 2, 2), (2, 0, 1)], [1, 1, -1]),
        ([(0, 0, 0)], [(0, 0, 0)] * 3, [1, 1, 1]),
    ],
)
def test_fronts_are_where_the_normals_point(normals: Any, normal_of: Any, front: list[int]) -> None:
    """The triangles look along z, x and all of -x, -y, -z. A sum in the plane says nothing. What mirrors exchanges."""
    shape = Geometry(V, F, normals, normal_of)
    for to_world, sign in (
        (np.eye(3, 4), 1),
        (np.diag([-1.0, 1, 1, 0])[:3], -1),
        (np.diag([-2.0, -3, 1, 0])[:3], 1),
        (np.diag([-1.0, -1, -1, 0])[:3], -1),
        (np.diag([1e-12, 1e-12, -1e-12, 0])[:3], -1),
    ):
        assert PlacedMesh(shape, to_world).front.tolist() == [sign * side for side in front]


# --- Scenes


def test_spheres_come_first_and_meshes_after_them() -> None:
    red, blue = Material((1, 0, 0), texture=TEXTURE), Material((0, 0, 1), ka=0.25)
    one, two = Mesh(V, F, material=red), Mesh(V, F[:1], material=blue)
    scene = Scene.from_spheres(
        Camera(), LIGHTS, [(0, 0, 0), (2, 0, 0)], 0.5, [(0, 1, 0), (1, 1, 0)], meshes=[one, two, one]
    )
    assert scene.sphere_numbers.tolist() == [0, 1]
    assert [(m.number, m.material) for m in scene.meshes] == [(2, 2), (3, 3), (4, 2)]
    assert scene.materials["color"].tolist() == [[0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 1]]
    assert scene.materials["ka"].tolist() == [0.8, 0.8, 0.8, 0.25]
    assert scene.materials["texture"].tolist() == [-1, -1, 0, -1]
    assert [texture.tolist() for texture in scene.textures] == [TEXTURE.tolist()]
    assert scene.meshes[0].geometry is one.geometry is scene.meshes[2].geometry


def test_a_scene_of_meshes() -> None:
    mesh = Mesh(V, F)
    for given in (mesh, [mesh], (mesh,), iter([mesh])):
        scene = Scene.from_meshes(Camera(), LIGHTS, given, background=(0, 0, 1), output_file="a.png")
        assert (len(scene.spheres), len(scene.meshes), len(scene.materials)) == (0, 1, 1)
        assert (scene.background, scene.output_file) == ((0, 0, 1), "a.png")
        assert scene.meshes[0].number == 0
    assert Scene.from_meshes(Camera(), LIGHTS, []).meshes == ()
    assert repr(scene) == "<cltrace.Scene 512x512: 0 spheres, 1 meshes of 3 triangles, 1 lights>"
    assert repr(scene.meshes[0]) == "<cltrace mesh 0: 3 triangles, material 0>"
    assert repr(mesh) == "<cltrace.Mesh: 3 triangles, 4 vertices>"
    assert repr(mesh.geometry) == "<cltrace geometry: 3 triangles, 4 vertices>"


def test_the_numbers_of_spheres_are_those_that_meshes_leave() -> None:
    spheres = np.zeros(3, SPHERE)
    spheres["radius"], spheres["to_object"] = 1, -1
    shade = np.zeros(1, MATERIAL)
    shade["texture"] = -1
    for numbers, wanted in (
        ([], [0, 1, 2]),
        ([1, 3], [0, 2, 4]),
        ([0, 1, 2], [3, 4, 5]),
        ([3], [0, 1, 2]),
    ):
        placed = [PlacedMesh(SHAPE, number=number) for number in numbers]
        scene = Scene(Camera(), [], spheres, shade, meshes=placed)
        assert scene.sphere_numbers.tolist() == wanted
        fewer = replace(scene, spheres=spheres[:1])
        assert fewer.sphere_numbers.tolist() == wanted[:1]
        assert [m.number for m in fewer.meshes] == numbers


def test_a_pickle_has_large_arrays_beside_it() -> None:
    """dask sends these without a copy."""
    v = np.random.default_rng(1).random((9000, 3))
    mesh = Mesh(v, np.arange(9000).reshape(-1, 3), normals=v)
    beside: list[pickle.PickleBuffer] = []
    data = pickle.dumps(mesh, protocol=5, buffer_callback=beside.append)
    assert len(data) < 2000
    assert np.array_equal(pickle.loads(data, buffers=beside).vertices, v)


def test_scenes_with_meshes_are_immutable_and_may_be_pickled() -> None:
    material = Material(texture=TEXTURE)
    mesh = Mesh(V, F, V, V[:, :2], material, np.diag([1, 2, 3.0]))
    scene = Scene.from_meshes(Camera(), LIGHTS, [mesh, mesh])
    assert scene.meshes[0].front.tolist() == [1, 1, -1]
    assert scene.sphere_numbers.tolist() == []
    for one in (scene, pickle.loads(pickle.dumps(scene)), scene.seen_by(Camera((0, 0, 3))), replace(scene)):
        assert one.meshes[0].geometry is one.meshes[1].geometry
        assert np.array_equal(one.meshes[1].vertices, V * (1, 2, 3))
        shape = one.meshes[0].geometry
        arrays = [getattr(shape, name) for name in ("vertices", "faces", "normals", "normal_of", "uv", "uv_of")]
        placed = [getattr(one.meshes[0], name) for name in ("vertices", "to_world", "normal_to_world", "front")]
        for array in [*arrays, *placed, *one.textures, one.sphere_numbers]:
            assert not array.flags.writeable
    assert scene.seen_by(Camera()).meshes is scene.meshes
    assert replace(scene).textures[0] is scene.textures[0]


# --- What users hand over


def same(mesh: Mesh, faces: object = F) -> None:
    shape = mesh.geometry
    assert (shape.vertices.dtype, shape.faces.dtype) == (np.float64, np.int32)
    assert np.array_equal(shape.vertices, V)
    assert np.array_equal(shape.faces, faces)


@pytest.mark.parametrize("dtype", ["f2", "<f4", ">f4", "<f8", ">f8", "g", "i1", "u2", ">i8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_vertices_of_every_type(dtype: str, order: Any) -> None:
    same(Mesh(np.array(V, dtype, order=order), F))


@pytest.mark.parametrize("dtype", ["i1", "u1", "<i2", ">u2", "<i4", ">i4", "<u4", "i8", ">u8", "f4", ">f8"])
def test_faces_of_every_type(dtype: str) -> None:
    same(Mesh(V, np.array(F, dtype)))
    same(Mesh(V, np.array(F, dtype)[::-1, ::-1][::-1, ::-1]))


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
    same(both, [*F.tolist(), (0, 1, 2), (0, 2, 3)])
    same(Mesh.of(Thing(points=np.array(V), cells=[Thing(type="polygon", data=quads)])), [(0, 1, 2), (0, 2, 3)])


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
