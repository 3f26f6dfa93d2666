"""The exact oracle for triangles against rational arithmetic, and the reference against it in the hostile regimes."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hostile.mesh_regimes import AROUND, CLOSED, REGIMES, scene_of
from hostile.sphere_regimes import rays as camera_rays
from small_meshes import doubles_mesh
from stress_cases import hits
from surface_rays import along, blocked, from_eye, on_spheres, on_triangles, to_light, undecided

from cltrace import Camera, Mesh, Scene, parallel_light, point_light
from cltrace.exact.surds import Surd
from cltrace.oracle.search import Kinds
from cltrace.oracle.shapes import Spheres, Triangles
from cltrace.reference import Ray, world_of
from cltrace.reference.bounce import mirrored
from cltrace.reference.trace import closest_hit, illuminate, primary_ray

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("offset", [0.0, 1e7])
def test_doubles_from_spheres_and_ellipsoids_are_right(offset: float) -> None:
    """Where they are sure: the same as by whole numbers alone, towards corners and points of edges."""
    rng, count = np.random.default_rng(int(offset)), 200
    mesh = doubles_mesh(rng, offset)
    eye, egg = mesh.geometry.vertices[8] + rng.normal(size=3), [np.eye(3), rng.normal(size=(3, 3))]
    camera = Camera(tuple(eye), tuple(eye + rng.normal(size=3)), tuple(rng.normal(size=3)))
    scene = Scene.from_spheres(camera, (), [eye, eye + 1], [3, 0.5], transform=egg, meshes=[mesh])
    own, n = rng.integers(2, size=count), rng.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    triangles, kinds = Triangles.of(scene), Kinds([Triangles.of(scene)])
    start = on_spheres(Spheres.of(scene), own, n, camera.basis())
    a, b = triangles.vertices[rng.integers(len(triangles.vertices), size=(2, count))]
    d = (a + (b - a) * rng.choice([0, 0.5, 0.25, 1 / 3], (count, 1)) - eye) @ np.array(camera.basis()).T
    light = triangles.vertices[0] + rng.normal(size=3)
    for rays in (along(start, d, camera.basis()), to_light(start, light, False), to_light(start, d[0], True)):
        doubtful = undecided(rays)
        assert np.array_equal(kinds.counts(rays), kinds.counts(doubtful))
        found, exact = kinds.closest(rays), kinds.closest(doubtful)
        assert np.array_equal(found.item, exact.item)
        assert np.allclose(found.t.h, exact.t.h, rtol=2.0**-20)


def test_square_roots_have_the_right_sign() -> None:
    values = (-7, -3, -2, -1, 0, 1, 2, 3, 7)
    for a, b, s in itertools.product(values, values, (0, 1, 2, 3, 4, 9, 10)):
        value = a + b * math.sqrt(s)
        assert Surd(a, b, s).sign() == (0 if abs(value) < 1e-9 else math.copysign(1, value))
    with pytest.raises(ValueError, match="two different square roots"):
        Surd(0, 1, 2) + Surd(0, 1, 3)


# -------------------------------------------------------------------------------------------------------------- regimes


def agrees(scene: Scene) -> None:
    """Asserts that the reference meets what the oracle does, in all pixels."""
    world, width, want = world_of(scene), scene.camera.resolution[0], hits(scene)
    for i, one in enumerate(zip(want.index.tolist(), want.primitive.tolist(), strict=True)):
        at = closest_hit(world, primary_ray(scene.camera, i % width, i // width))
        assert ((at.index, at.primitive) if at else (-1, -1)) == one, i


@pytest.mark.parametrize("name", list(REGIMES))
def test_the_reference_in_a_regime(name: str) -> None:
    agrees(scene_of(name, 0, (8, 8)))


@pytest.mark.parametrize("name", ["soup", "corners on rays", "eye on a corner", "room"])
def test_the_reference_s_rays_from_triangles_in_a_regime(name: str) -> None:
    """Mirrored rays meet what the oracle says of the points where they start, and so do rays to two lights."""
    scene, rng = scene_of(name, 1, (8, 8)), np.random.default_rng(1)
    triangles, basis, asked = Triangles.of(scene), scene.camera.basis(), 0
    kinds, first = Kinds([triangles]), np.cumsum([0, *(len(mesh.geometry.faces) for mesh in scene.meshes)])
    lamp = triangles.vertices[3] + np.abs(triangles.vertices).max() / 9 * rng.normal(size=3)
    sun = np.array([1.0, -2, -3])
    world = world_of(scene.lit_by([point_light(lamp), parallel_light(sun)]))
    for i in range(64):
        ray = primary_ray(scene.camera, i % 8, i // 8)
        at = closest_hit(world, ray)
        if at is None:
            continue
        (corner, *uv), own = at.start.on, np.array([first[at.index] + at.primitive])
        place = on_triangles(triangles, own, np.array([corner]), np.array([uv]))
        out = mirrored(ray.direction, at.outward, at.side)
        item = kinds.closest(along(place, np.array([tuple(out)]), basis)).item[0]
        met = closest_hit(world, Ray(at.start, out))
        assert (triangles.surface[item], triangles.primitive[item]) == (met.index, met.primitive) if met else item < 0
        for parallel, where in enumerate((lamp, sun)):
            fate = illuminate(world, ray, at, world.lights[parallel]).fate
            if fate in ("lit", "in shadow"):
                assert (fate == "in shadow") == blocked(kinds, to_light(place, where, bool(parallel)))[0], i
                asked += 1
    assert asked > 15


def test_closed_meshes_are_met_evenly() -> None:
    """A ray that comes in goes out again: also by a corner or an edge, which belong to one triangle on each side."""
    for name in (*CLOSED, *AROUND):
        scene = scene_of(name, 1, (32, 32))
        counts = Kinds([Triangles.of(scene)]).counts(from_eye(scene, camera_rays(scene.camera)))
        around = len(scene.meshes) if name in AROUND else 0
        assert (counts % 2 == around % 2).all(), name
        assert counts.max() >= 2 - around % 2, name


def test_meshes_among_spheres_are_numbered_as_in_the_file() -> None:
    scene = scene_of("among spheres", 0, (32, 32))
    want = hits(scene)
    assert set(want.index[want.primitive < 0].tolist()) > {-1}
    # The same with the meshes first: whatever touches a sphere is now before it.
    meshes = [mesh.of(mesh.material, i) for i, mesh in enumerate(scene.meshes)]
    other = replace(scene, meshes=meshes)
    assert other.sphere_numbers.tolist() == list(range(len(meshes), len(meshes) + len(scene.spheres)))
    index, n, m = hits(other).index, len(scene.spheres), len(meshes)
    same = np.where(index < 0, -1, np.where(index < m, index + n, index - m))
    assert (same != want.index).mean() < 0.1
    agrees(other)


def test_a_scene_without_triangles_has_nothing_to_meet() -> None:
    scene = Scene.from_meshes(Camera(resolution=(2, 2)), (), Mesh([(0, 0, 0)], np.zeros((0, 3), int)))
    assert hits(scene).index.tolist() == [-1] * 4
