"""Cylinders and bonds in scenes: what is given, what becomes of it, and what is refused."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np

import cltrace
from cltrace import Camera, Material, Scene, ambient_light
from cltrace.scene import with_spheres

CAMERA = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 30, (8, 6))
PLACES = [(0, 0, 0), (1, 0, 0), (0, 9, 0)]


def balls(**how: object) -> Scene:
    return Scene.from_spheres(CAMERA, ambient_light(), PLACES, 0.2, **how)  # type: ignore[arg-type]


def test_bonds_of_one_material_are_whole() -> None:
    scene = balls(bonds=[(0, 1), (2, 0)], bond_radius=0.1)
    assert scene.cylinders["start"].tolist() == [[0, 0, 0], [0, 9, 0]]
    assert scene.cylinders["end"].tolist() == [[1, 0, 0], [0, 0, 0]]
    assert scene.cylinders["number"].tolist() == [3, 4]
    assert scene.sphere_numbers.tolist() == [0, 1, 2]
    assert scene.columns.materials_count == 1


def test_bonds_have_the_colors_of_their_ends() -> None:
    scene = balls(colors=[(1, 0, 0), (0, 1, 0), (1, 0, 0)], bonds=[(0, 1)], bond_radius=0.1)
    rods = scene.cylinders
    assert scene.materials["color"][rods["material"]].tolist() == [[1, 0, 0], [0, 1, 0]]
    assert rods["end"][0].tolist() == rods["start"][1].tolist() == [0.5, 0, 0]


def test_bonds_across_a_periodic_box_lead_to_the_nearest_image() -> None:
    scene = balls(bonds=[(0, 2)], bond_radius=0.1, box=(10, 10, 10))
    rods = scene.cylinders
    assert rods["start"].tolist() == [[0, 0, 0], [0, 9.5, 0]]
    assert rods["end"].tolist() == [[0, -0.5, 0], [0, 9, 0]]


def test_bonds_may_have_colors_of_their_own() -> None:
    two = balls(bonds=[(0, 1)], bond_radius=0.1, bond_colors=[[(1, 0, 0), (0, 0, 1)]], ka=0.3)
    assert two.materials["color"][two.cylinders["material"]].tolist() == [[1, 0, 0], [0, 0, 1]]
    assert (two.materials["ka"] == 0.3).all()
    one = balls(bonds=[(0, 1), (0, 2)], bond_radius=0.1, bond_colors="gold")
    assert len(one.cylinders) == 2


def test_bonds_move_with_their_ends() -> None:
    scene = balls(bonds=[(0, 1), (0, 2)], bond_radius=0.1, box=(10, 10, 10)).with_cylinders(
        *cltrace.box_edges((10, 10, 10)), 0.05, "white"
    )
    moved = with_spheres(scene, {"centers": [(0, 0, 0), (2, 0, 0), (0, 1, 0)]})
    assert moved.cylinders["end"][:2].tolist() == [[2, 0, 0], [0, 1, 0]]  # none is across the boundary any more
    assert len(scene.cylinders) == 15
    assert len(moved.cylinders) == 14
    assert moved.cylinders["number"].tolist() == list(range(3, 17))
    painted = with_spheres(moved, {"colors": [(1, 0, 0), (0, 1, 0), (0, 0, 1)]})
    assert len(painted.cylinders) == 16
    colors = painted.materials["color"][painted.cylinders["material"]]
    assert colors[:5].tolist() == [[1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1], [1, 1, 1]]
    assert with_spheres(painted, {"ks": 0.1}).cylinders is painted.cylinders


def test_scenes_with_cylinders_are_copied_and_pickled() -> None:
    scene = balls(bonds=[(0, 1)], bond_radius=0.1).with_cylinders([(0, 0, 0)], [(0, 0, 2)], 0.5, material=Material())
    for other in (pickle.loads(pickle.dumps(scene)), replace(scene), scene.seen_by(CAMERA)):
        assert other.cylinders.tobytes() == scene.cylinders.tobytes()
        assert other.bonds.pairs.tolist() == [[0, 1]]


def test_boxes_and_axes() -> None:
    starts, ends = cltrace.box_edges((1, 2, 3), (5, 5, 5))
    assert sorted(np.abs(ends - starts).sum(axis=1).tolist()) == [1] * 4 + [2] * 4 + [3] * 4
    corners = {tuple(p) for p in cltrace.box_corners((1, 2, 3), (5, 5, 5)).tolist()}
    assert {tuple(p) for p in np.vstack([starts, ends]).tolist()} == corners
    assert len(corners) == 8
    starts, ends = cltrace.axes(2, (1, 0, 0))
    assert ends.tolist() == [[3, 0, 0], [1, 2, 0], [1, 0, 2]]


def test_cylinders_of_two_colors_meet_in_the_middle_and_cameras_fit_them() -> None:
    scene = Scene.from_spheres(CAMERA, ambient_light(), [], [])
    scene = scene.with_cylinders([(0, 0, 0)], [(0, 4, 0)], 1, [[(1, 0, 0), (0, 0, 1)]])
    assert scene.cylinders["end"][0].tolist() == scene.cylinders["start"][1].tolist() == [0, 2, 0]
    camera = Camera.fit(scene, view="front", resolution=(40, 40), margin=0)
    assert np.allclose(camera.lookat[1], 2, atol=0.5)
