"""Periodic images of a scene, and bonds across the boundaries of boxes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import cltrace
from cltrace import Camera, Material, Mesh, Scene, ambient_light
from cltrace.scene import with_spheres

CAMERA = Camera((4, 2, 30), (4, 2, 0), (0, 1, 0), 12, (60, 40))
PLACES = np.array([(0.5, 1, 1), (3.5, 1, 1), (2, 3, 2)])
BOX = [(4, 0, 0), (1, 4, 0), (0, 0, 4)]
LOOKS = {"colors": ["red", "lime", "blue"], "ks": [0.1, 0.2, 0.3]}


def crystal(box: object = BOX) -> Scene:
    return Scene.from_spheres(
        CAMERA, ambient_light(), PLACES, [0.3, 0.4, 0.5], bonds=[(0, 1), (1, 2)], bond_radius=0.1, box=box,  # type: ignore[arg-type]
        **LOOKS,  # type: ignore[arg-type]
    )  # fmt: skip


def test_images_have_all_that_spheres_and_bonds_have() -> None:
    scene = crystal()
    offsets = cltrace.box_images(BOX, (2, 1, 2))
    assert offsets.tolist() == [[0, 0, 0], [0, 0, 4], [4, 0, 0], [4, 0, 4]]
    made = scene.replicate(offsets)
    assert made.spheres["center"].tolist() == np.concatenate([PLACES + offset for offset in offsets]).tolist()
    by_hand = Scene.from_spheres(
        CAMERA, ambient_light(), made.spheres["center"], np.tile([0.3, 0.4, 0.5], 4), box=BOX,
        bonds=[(3 * k + i, 3 * k + j) for k in range(4) for i, j in ((0, 1), (1, 2))], bond_radius=0.1,
        **{name: values * 4 for name, values in LOOKS.items()},  # type: ignore[arg-type]
    )  # fmt: skip
    for name in ("start", "end", "radius", "number"):
        assert (by_hand.cylinders[name] == made.cylinders[name]).all()
    assert (by_hand.spheres["radius"] == made.spheres["radius"]).all()
    for name in ("spheres", "cylinders"):
        one, other = (of.materials[getattr(of, name)["material"]] for of in (made, by_hand))
        assert (one == other).all()


def test_bonds_across_a_boundary_meet_those_of_the_next_image() -> None:
    made = crystal().replicate(cltrace.box_images(BOX, (2, 1, 1)))
    halves = {(tuple(rod["start"]), tuple(rod["end"])) for rod in made.cylinders}
    assert {((4, 1, 1), (3.5, 1, 1)), ((4.5, 1, 1), (4, 1, 1))} <= halves
    moved = with_spheres(made, {"centers": made.columns.center + (0, 0.25, 0)})
    assert (moved.cylinders["end"] == made.cylinders["end"] + (0, 0.25, 0)).all()


def test_other_shapes_are_there_in_each_image() -> None:
    mesh = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], material=Material((1, 0, 0)))
    scene = Scene.from_spheres(
        CAMERA, ambient_light(), [(2, 0, 0)], 1, meshes=[mesh, mesh], transform=np.diag([1, 2, 1])
    ).with_cylinders([(-2, 0, 0)], [(-2, 0, 1)], 0.5, "blue")  # fmt: skip
    made = scene.replicate([(0, 0, 0), (0, 8, 0), (0, -8, 0)])
    assert [mesh.number for mesh in made.meshes] == [3, 4, 5, 6, 7, 8]
    assert made.meshes[0].geometry is made.meshes[4].geometry
    rng = np.random.default_rng(3)
    o = rng.uniform(-3, 3, (500, 3)) + (0, 0, 9)
    d = rng.uniform(-3, 3, (500, 3)) * (1, 1, 0.2) - o
    want = cltrace.trace_rays(scene, o, d)
    numbers = np.array([[0, 3, 4, 9], [1, 5, 6, 10], [2, 7, 8, 11]])
    assert set(want.id) == {-1, 0, 1, 3}
    for k, y in enumerate((0, 8, -8)):
        got = cltrace.trace_rays(made, o + (0, y, 0), d, t_max=1.2)
        assert (got.id[want.id >= 0] == numbers[k][want.id[want.id >= 0]]).all()
        assert np.allclose(got.t[want.id >= 0], want.t[want.id >= 0], rtol=1e-12)


def test_values_of_images_have_the_scale_of_before() -> None:
    scene = Scene.from_spheres(CAMERA, (), PLACES, 1, values=[0, 1, 2], clim=(0, 4)).replicate([(0, 0, 0), (9, 0, 0)])
    later = with_spheres(scene, {"values": [4, 4, 4, 0, 1, 2]})
    assert (later.materials["color"][3:] == scene.materials["color"][:3]).all()


@pytest.mark.parametrize("box", [BOX, (3, 4, 5), [(4, 0, 0), (2, 4, 0), (-2, 1, 3)], [(4, 0, 0), (9, 4, 0), (0, 0, 9)]])
def test_bonds_lead_to_the_nearest_of_all_images(box: object) -> None:
    places = np.random.default_rng(2).uniform(-6, 6, (60, 3))
    scene = Scene.from_spheres(
        CAMERA, (), places, 0.1, bonds=np.arange(60).reshape(30, 2), bond_radius=0.1,
        bond_colors=[[(1, 0, 0), (0, 0, 1)]] * 30, box=box,  # type: ignore[arg-type]
    )  # fmt: skip
    edges = np.diag(box) if np.ndim(box) == 1 else np.array(box)  # type: ignore[arg-type]
    steps = np.array(list(itertools.product(range(-9, 10), repeat=3))) @ edges
    least = np.linalg.norm((places[1::2] - places[::2])[:, None] + steps, axis=2).min(axis=1)
    halves = scene.cylinders["end"] - scene.cylinders["start"]
    assert np.allclose(np.linalg.norm(halves, axis=1), np.repeat(least, 2) / 2)
