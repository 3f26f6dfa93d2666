"""The exact oracle for triangles against rational arithmetic, and the reference against it in the hostile regimes."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hostile import mesh_pictures
from hostile.mesh_pictures import Seen, each_named, expected, in_light, judge, judge_light, judge_onward
from hostile.mesh_regimes import AROUND, CLOSED, REGIMES, scene_of
from rational_meshes import doubles_mesh
from surface_rays import along, on_spheres, to_light, undecided

from cltrace import Camera, Mesh, Scene, parallel_light, point_light
from cltrace.exact.surds import Surd
from cltrace.oracle.search import Kinds
from cltrace.oracle.shapes import Spheres, Triangles
from cltrace.reference import world_of
from cltrace.reference.trace import closest_hit, primary_ray, trace

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


def drawn(scene: Scene, colors: bool = False) -> tuple[Seen, np.ndarray]:
    """What the reference shows."""
    world, (width, height) = world_of(scene), scene.camera.resolution
    seen, color = Seen(*np.full((2, width * height), -1)), np.zeros((width * height, 3))
    for i in range(width * height):
        ray = primary_ray(scene.camera, i % width, i // width)
        if colors:
            color[i], at = trace(world, ray)
        else:
            at = closest_hit(world, ray)
        if at:
            seen.id[i], seen.primitive[i] = at.index, at.primitive
    return seen, color


@pytest.mark.parametrize("name", list(REGIMES))
def test_the_reference_in_a_regime(name: str) -> None:
    scene = scene_of(name, 0, (8, 8))
    verdict = judge(scene, drawn(scene)[0])
    assert verdict.rays == 64
    assert len(verdict.wrong) == verdict.leaks == verdict.phantoms == 0


@pytest.mark.parametrize("name", ["soup", "corners on rays", "eye on a corner", "room"])
def test_the_reference_s_light_and_mirrors_in_a_regime(name: str) -> None:
    scene, rng = scene_of(name, 1, (8, 4)), np.random.default_rng(1)
    vertices = np.concatenate([mesh.vertices for mesh in scene.meshes])
    judged = 0
    lamp = point_light(vertices[3] + np.abs(vertices).max() / 9 * rng.normal(size=3))
    for light in (lamp, parallel_light((1, -2, -3))):
        lit = in_light(scene, light)
        verdict = judge_light(lit, *drawn(lit, colors=True))
        assert len(verdict.wrong) == 0
        judged += verdict.rays
    mixed = each_named(scene, rng.random(sum(len(mesh.geometry.faces) for mesh in scene.meshes)) < 0.5, 1.5)
    verdict = judge_onward(mixed, *drawn(mixed, colors=True))
    assert len(verdict.wrong) == 0
    assert judged + verdict.rays > 30


def test_closed_meshes_are_met_evenly() -> None:
    """A ray that comes in goes out again: also by a corner or an edge, which belong to one triangle on each side."""
    for name in (*CLOSED, *AROUND):
        scene = scene_of(name, 1, (32, 32))
        counts = Kinds([Triangles.of(scene)]).counts(mesh_pictures.primary(scene))
        around = len(scene.meshes) if name in AROUND else 0
        assert (counts % 2 == around % 2).all(), name
        assert counts.max() >= 2 - around % 2, name


def test_the_judges_find_mistakes() -> None:
    scene = scene_of("room", 0, (8, 8))
    right, _ = drawn(scene)
    for change, leaks in ((lambda s: s.id.__setitem__(5, -1), 1), (lambda s: s.primitive.__setitem__(5, 99), 0)):
        seen = Seen(right.id.copy(), right.primitive.copy())
        change(seen)
        verdict = judge(scene, seen)
        assert (verdict.rays, verdict.wrong.tolist(), verdict.leaks, verdict.phantoms) == (64, [5], leaks, 0)
    ball = scene_of("corners on rays", 0, (8, 8))
    seen, _ = drawn(ball)
    empty = int(np.flatnonzero(seen.id < 0)[0])
    seen.id[empty] = 0
    verdict = judge(ball, seen)
    assert (verdict.wrong.tolist(), verdict.phantoms) == ([empty], 1)
    lit = in_light(scene, point_light(scene.camera.position))
    seen, color = drawn(lit, colors=True)
    color[7] = 0
    assert judge_light(lit, seen, color).wrong.tolist() == [7]
    mirrors = each_named(scene, np.zeros(36, bool), 1.0)
    seen, color = drawn(mirrors, colors=True)
    color[9] = 1
    verdict = judge_onward(mirrors, seen, color)
    assert (verdict.wrong.tolist(), verdict.leaks) == ([9], 1)


def test_meshes_among_spheres_are_numbered_as_in_the_file() -> None:
    scene = scene_of("among spheres", 0, (32, 32))
    want = expected(scene)
    assert set(want.id[want.primitive < 0].tolist()) > {-1}
    # The same with the meshes first: whatever touches a sphere is now before it.
    meshes = [mesh.of(mesh.material, i) for i, mesh in enumerate(scene.meshes)]
    other = replace(scene, meshes=meshes)
    assert other.sphere_numbers.tolist() == list(range(len(meshes), len(meshes) + len(scene.spheres)))
    moved = expected(other)
    n, m = len(scene.spheres), len(meshes)
    same = np.where(moved.id < 0, -1, np.where(moved.id < m, moved.id + n, moved.id - m))
    assert (same != want.id).mean() < 0.1
    verdict = judge(other, drawn(other)[0])
    assert len(verdict.wrong) == 0


def test_a_scene_without_triangles_has_nothing_to_meet() -> None:
    scene = Scene.from_meshes(Camera(resolution=(2, 2)), (), Mesh([(0, 0, 0)], np.zeros((0, 3), int)))
    assert expected(scene).id.tolist() == [-1] * 4
