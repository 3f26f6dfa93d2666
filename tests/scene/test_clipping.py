"""Clipping planes as data of a scene, and what rays meet of the scenes that they clip."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from clipped_scenes import first_of_balls
from solids import box

import cltrace
from cltrace import Camera, Material, Mesh, Scene, ambient_light
from cltrace.scene import with_spheres

CAMERA = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), 30, (64, 48))
# In front of z = 0, cut by it, touching it from behind, and behind it.
PLACES = [(0, 0, 3), (1, 0, 0.1), (0, 1, -0.4), (0, 2, -3)]
OUTPUTS: Any = ("rgb8", "id", "primitive", "depth", "color")


def balls(**how: Any) -> Scene:
    return Scene.from_spheres(CAMERA, ambient_light(), PLACES, 0.4, **how)


def cube(**how: Any) -> Mesh:
    solid = box()
    return Mesh(solid.vertices, solid.faces, **how)


def test_a_plane_is_data_and_surfaces_keep_their_numbers() -> None:
    scene = balls(colors=np.eye(4, 3)).clipped((5, 5, 0), (0, 0, 2), "red").clipped((0, 9, 0), (0, 1, 0))
    assert scene.planes["point"].tolist() == [[5, 5, 0], [0, 9, 0]]
    assert scene.planes["normal"].tolist() == [[0, 0, 2], [0, 1, 0]]
    assert scene.planes["material"].tolist() == [4, -1]
    assert scene.materials["color"][4].tolist() == [1, 0, 0]
    assert scene.sphere_numbers.tolist() == [0, 1, 2, 3]
    assert repr(scene) == repr(balls())


def test_what_is_beyond_is_gone_and_what_is_cut_has_a_cap() -> None:
    """The second ball is cut: its cap is as large as the circle in the plane, and has the ball's number."""
    image = cltrace.render(balls().clipped((0, 0, 0), (0, 0, 1), "red"), outputs=OUTPUTS)
    assert np.unique(image.id).tolist() == [-1, 1, 2, 3]
    cap = image.primitive == -2
    assert (image.id[cap] == 1).all()
    area = cap.sum() * (2 * 9 * CAMERA.image_plane()[0] / 64) ** 2
    assert area == pytest.approx(np.pi * (0.4**2 - 0.1**2), rel=0.2)
    y, x = np.nonzero(cap)
    assert (image.color[cap] == image.color[y[0], x[0]]).all()
    assert image.color[y[0], x[0], 0] > 0
    assert not image.color[y[0], x[0], 1:].any()


def test_first_hits_are_those_of_balls_within_a_region() -> None:
    """Against intervals in doubles, for rays from all around, and two planes."""
    rng = np.random.default_rng(2)
    centers, radii, normals = rng.normal(size=(20, 3)), rng.uniform(0.1, 0.7, 20), rng.normal(size=(2, 3))
    points = rng.normal(size=(2, 3)) * 0.3
    scene = Scene.from_spheres(CAMERA, ambient_light(), centers, radii)
    for point, normal in zip(points, normals, strict=True):
        scene = scene.clipped(point, normal)
    o = rng.normal(size=(600, 3)) * 2
    d = rng.normal(size=o.shape) - o
    hits = cltrace.trace_rays(scene, o, d)
    index, t, cap = first_of_balls(centers, radii, list(zip(points, normals, strict=True)), o, d)
    assert np.array_equal(hits.id, index)
    assert np.allclose(hits.t[index >= 0], t[index >= 0], rtol=1e-9)
    assert cap.sum() > 40
    assert np.array_equal(hits.primitive < -1, cap)
    which = normals[-2 - hits.primitive[cap]]
    assert np.allclose(hits.normal[cap], which / np.linalg.norm(which, axis=1)[:, None])


@pytest.mark.parametrize("closed", [True, False])
def test_a_closed_mesh_has_caps_and_an_open_one_has_none(closed: bool) -> None:
    solid = box()
    mesh = Mesh(solid.vertices, solid.faces if closed else solid.faces[:-1], material=Material((0, 1, 0)))
    scene = Scene.from_meshes(CAMERA, ambient_light(), mesh).clipped((0, 0, 0.5), (0, 0, 1))
    assert mesh.geometry.closed is closed
    hit = cltrace.trace_rays(scene, (0.1, 0.2, 9), (0, 0, -1))
    assert hit.t.tolist() == [8.5 if closed else 10]
    assert bool(hit.primitive[0] == -2) is closed
    # A face in the plane is kept, and is seen rather than a cap.
    flush = Scene.from_meshes(CAMERA, ambient_light(), cube()).clipped((0, 0, 1), (0, 0, 1))
    seen = cltrace.trace_rays(flush, (0.1, 0.2, 9), (0, 0, -1))
    assert seen.t.tolist() == [8]
    assert seen.primitive[0] >= 0


def test_closed_meshes() -> None:
    """Whatever vertices they share; what is twice everywhere is inside of nothing."""
    solid = box()
    corners = solid.vertices[solid.faces].reshape(-1, 3)
    assert Mesh(corners, np.arange(len(corners)).reshape(-1, 3)).geometry.closed
    assert Mesh(solid.vertices, np.concatenate([solid.faces, [(0, 1, 1)]])).geometry.closed
    twice = Mesh(solid.vertices, np.tile(solid.faces, (2, 1)))
    assert twice.geometry.closed
    scene = Scene.from_meshes(CAMERA, ambient_light(), twice).clipped((0, 0, 0.5), (0, 0, 1))
    image = cltrace.render(scene, outputs=OUTPUTS)
    assert (image.primitive >= -1).all()
    assert image.depth[24, 32] == pytest.approx(10, rel=0.01)


def test_single_objects_are_not_clipped() -> None:
    scene = balls(meshes=[cube(clipped=False, transform=np.diag((0.2, 0.2, 0.2)))])
    scene = scene.with_cylinders([(-1, -1, 1)], [(1, -1, 1)], 0.1, clipped=False)
    scene = scene.with_cylinders([(-1, 1, 1)], [(1, 1, 1)], 0.1).clipped((0, 0, -9), (0, 0, 1))
    assert np.unique(cltrace.render(scene, outputs=("id",)).id).tolist() == [-1, 4, 5]
    assert not scene.replicate([(0, 0, 0), (0, 0, 2)]).meshes[1].clipped
    assert pickle.loads(pickle.dumps(scene)).cylinders["unclipped"].tolist() == [1, 0]


def test_clipped_scenes_are_made_anew_pickled_and_changed() -> None:
    scene = balls(values=[1, 2, 3, 4]).clipped((0, 0, 0), (0, 0, 1), "red")
    again = pickle.loads(pickle.dumps(scene))
    made = Scene(
        scene.camera, scene.lights, **{name: getattr(scene, name) for name in ("spheres", "materials", "planes")}
    )
    image = cltrace.render(scene, outputs=OUTPUTS)
    for other in (again, made):
        assert np.array_equal(cltrace.render(other, outputs=OUTPUTS).rgb8, image.rgb8)
    twice = scene.replicate([(0, 0, 0), (0, 0.5, 0)])
    assert twice.planes["point"].tolist() == scene.planes["point"].tolist()
    painted = with_spheres(scene, {"colors": "lime"})
    assert painted.materials["color"][painted.planes["material"]].tolist() == [[1, 0, 0]]
    bonded = balls(bonds=[(0, 3)], bond_radius=0.1).clipped((0, 0, 0), (0, 0, 1))
    moved = with_spheres(bonded, {"centers": np.array(PLACES) + (0, 0.1, 0)})
    assert moved.cylinders["start"][0].tolist() == [0, 0.1, 3]


def test_a_renderer_follows_what_is_painted_moved_and_clipped() -> None:
    scene = balls(colors=np.eye(4, 3)).clipped((0, 0, 0), (0, 0, 1), "red")
    renderer = cltrace.Renderer(scene, outputs=("rgb8", "id", "primitive"))
    before = renderer.render()
    renderer.update(colors="lime", centers=np.array(PLACES) + (0.05, 0, 0))
    after = renderer.render()
    assert np.array_equal(after.rgb8, cltrace.render(renderer.scene).rgb8)
    assert not np.array_equal(before.rgb8, after.rgb8)
    for changed in (renderer.scene.clipped((1, 0, 0), (1, 0, 1)), balls()):
        other = renderer.following(changed)
        assert np.array_equal(other.render().rgb8, cltrace.render(changed).rgb8)
