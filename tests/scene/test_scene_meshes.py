"""Meshes of a scene: where they are in the world, their fronts and normals, their numbers, and what is refused."""

from __future__ import annotations

import pickle
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cltrace import Camera, Material, Mesh, Scene, ambient_light
from cltrace.base.limits import MAX_TEXELS
from cltrace.scene import MATERIAL, SPHERE, Geometry, PlacedMesh, materials, meshes, texels

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


def test_a_mesh_that_is_not_moved_has_its_own_vertices() -> None:
    assert PlacedMesh(SHAPE).vertices is SHAPE.vertices
    assert PlacedMesh(SHAPE).normal_to_world.tolist() == np.eye(3).tolist()
    assert not np.signbit(PlacedMesh(SHAPE, np.diag([-1.0, -1, -1, 0])[:3]).vertices[0]).any()


def test_normals_stay_upright() -> None:
    """A normal is orthogonal to the triangle before the map and after it; its length is kept in range."""
    rng = np.random.default_rng(4)
    for size in (1e-12, 1.0, 1e12):
        linear = rng.normal(size=(3, 3)) * size
        placed = PlacedMesh(SHAPE, np.concatenate([linear, rng.normal(size=(3, 1))], axis=1))
        assert 1 <= np.abs(placed.normal_to_world).max() < 2
        for a, b, c in placed.geometry.faces:
            before = np.cross(V[b] - V[a], V[c] - V[a])
            normal = placed.normal_to_world @ before
            for edge in (linear @ (V[b] - V[a]), linear @ (V[c] - V[a])):
                assert abs(normal @ edge) < 1e-12 * np.linalg.norm(normal) * np.linalg.norm(edge)
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
        ([0], [1, 2, 3]),
        ([1, 3], [0, 2, 4]),
        ([0, 1, 2], [3, 4, 5]),
        ([3], [0, 1, 2]),
        ([9], [0, 1, 2]),
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
    records = {"spheres", "materials"}
    assert set(scene.__getstate__()) == {field.name for field in fields(Scene)} - records | {"columns"}
    assert set(replace(scene).__getstate__()) == {field.name for field in fields(Scene)}
    assert set(scene.meshes[0].__getstate__()) == {
        *("geometry", "to_world", "material", "number", "clipped"),
    }
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


def test_what_is_placed_shares_what_is_worked_out() -> None:
    mesh = Mesh(V, F, transform=np.diag([2.0, 1, 1]))
    one, two = Scene.from_meshes(Camera(), LIGHTS, [mesh, mesh]).meshes
    assert one.vertices is two.vertices
    assert (one.number, two.number) == (0, 1)


# --- What is refused

PLACED = PlacedMesh(SHAPE)
NO_SPHERES, NO_MATERIALS = np.zeros(0, SPHERE), np.zeros(0, MATERIAL)


def scene_with(*placed: Any, textures: Any = (), texture: int = -1) -> Scene:
    shade = np.zeros(1, MATERIAL)
    shade["texture"] = texture
    return Scene(Camera(), [], NO_SPHERES, shade, meshes=placed, textures=textures)


REFUSED: list[tuple[Any, str]] = [
    (lambda: Geometry(V, [(0, 1, 4)]), "mesh.faces[0][2]: must be the index of a vertex, of which there are 4, got 4"),
    (
        lambda: Geometry(V, F, V, [(0, 1, 2), (0, -1, 1), (0, 0, 0)]),
        "mesh.normal_of[1]: must be -1 for all three corners or for none",
    ),
    (
        lambda: Geometry(V, F, V, [(0, 1, 2)] * 2 + [(4, 0, 0)]),
        "mesh.normal_of[2][0]: must be the index of a normal, of which there are 4, got 4",
    ),
    (
        lambda: Geometry(V, F, uv=V[:, :2], uv_of=[(0, 1, -2)] * 3),
        "mesh.uv_of[0][2]: must be the index of uv, of which there are 4, got -2",
    ),
    (lambda: Geometry(V, F, uv=V), "mesh.uv: must have shape (n, 2), got (4, 3)"),
    (lambda: PlacedMesh(V), "mesh.geometry: must be a cltrace.scene.Geometry, got an array of float64, shape (4, 3)"),
    (lambda: PlacedMesh(SHAPE, np.eye(3)), "mesh.to_world: must have shape (3, 4), got (3, 3)"),
    (lambda: PlacedMesh(SHAPE, np.zeros((3, 4))), "mesh.to_world: must not be singular"),
    (
        lambda: PlacedMesh(SHAPE, np.diag([1e-30, 1, 1, 0])[:3] * 1e-10),
        "mesh.to_world: its inverse must not exceed 3.4e38 in magnitude, got 1e+40",
    ),
    (lambda: PlacedMesh(SHAPE, material=-1), "mesh.material: must be an integer within 0..2147483647, got -1"),
    (lambda: PlacedMesh(SHAPE, number=1.5), "mesh.number: must be an integer within 0..2147483647, got 1.5"),
    (
        lambda: PlacedMesh(Geometry(V * 3e38, F), np.diag([1, 2.0, 1, 0])[:3]),
        "mesh.to_world: in the world, vertices[2][1]: must not exceed 3.4e38 in magnitude, got 6e+38",
    ),
    (
        lambda: scene_with(Mesh(V, F)),
        "meshes[0]: must be a cltrace.scene.PlacedMesh, got <cltrace.Mesh...s, 4 vertices>; "
        "Scene.from_meshes() takes each cltrace.Mesh",
    ),
    (
        lambda: scene_with(PLACED, PlacedMesh(SHAPE, material=1, number=1)),
        "meshes[1].material: must be the index of a material, got 1",
    ),
    (lambda: scene_with(PLACED, PLACED), "meshes[1].number: must be greater than that of the mesh before, got 0"),
    (lambda: scene_with(texture=0), "materials.texture[0]: must be -1 or the index of one of textures, got 0"),
    (lambda: scene_with(textures=5), "textures: must be a list of arrays, got 5"),
    (
        lambda: scene_with(textures=[TEXTURE, np.zeros((2, 2))]),
        "textures[1]: must be an array of uint8 or uint16, got an array of float64, shape (2, 2)",
    ),
    (lambda: Scene.from_meshes(Camera(), LIGHTS, 5), "meshes: must be a list of cltrace.Mesh, got 5"),
    (lambda: Scene.from_meshes(Camera(), LIGHTS, [5]), "meshes[0]: must be a cltrace.Mesh, got 5; Mesh.of() makes one"),
]


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_refused(number: int) -> None:
    call, message = REFUSED[number]
    with pytest.raises((ValueError, TypeError)) as caught:
        call()
    assert str(caught.value) == message


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    placed = [PlacedMesh(SHAPE, number=i) for i in range(3)]
    for name, most, message in (
        ("MAX_MESHES", 2, "meshes: must be at most 2, got 3"),
        ("MAX_TRIANGLES", 8, "meshes: must be at most 8 triangles in all, got 9"),
        ("MAX_VERTICES", 11, "meshes: must be at most 11 vertices in all, got 12"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(meshes, name, most)
            assert len(scene_with(*placed[:2]).meshes) == 2
            for make in (lambda: scene_with(*placed), lambda: Scene.from_meshes(Camera(), [], [Mesh(V, F)] * 3)):
                with pytest.raises(ValueError) as caught:
                    make()
                assert str(caught.value) == message
    monkeypatch.setattr(materials, "MAX_TEXELS", 7)
    shades = [Material(texture=TEXTURE), Material(texture=TEXTURE)]
    for make in (
        lambda: scene_with(textures=[TEXTURE, TEXTURE]),
        lambda: Scene.from_meshes(Camera(), [], [Mesh(V, F, material=shade) for shade in shades]),
    ):
        with pytest.raises(ValueError, match=r"^textures: must be at most 7 pixels in all, got 8$"):
            make()
    assert len(Scene.from_meshes(Camera(), [], [Mesh(V, F, material=shades[0])] * 3).textures) == 1
    with pytest.raises(ValueError, match=r"^x: must have 1 to 7 pixels, got 4 x 2$"):
        texels("x", np.zeros((4, 2), np.uint8))
    assert MAX_TEXELS > 10**8
