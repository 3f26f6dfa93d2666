"""The exact oracle for triangles against rational arithmetic, and the reference against it in the hostile regimes."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hostile import mesh_pictures
from hostile.mesh_pictures import Seen, each_named, expected, in_light, judge, judge_light, judge_onward
from hostile.mesh_regimes import AROUND, CLOSED, REGIMES, TAN, scene_of
from rational_meshes import Vector, corners_of, doubles_mesh, exactly, grid_mesh, meets, minus, nearest, triangle_point

from cltrace import Camera, Mesh, Scene, parallel_light, point_light
from cltrace.exact.lines import Line, Root
from cltrace.exact.shapes import ExactTriangle
from cltrace.exact.surds import Surd
from cltrace.oracle.rays import Points, along, at_point, to_light
from cltrace.oracle.search import Kinds
from cltrace.oracle.spheres import Spheres, on_spheres
from cltrace.oracle.triangles import Triangles, on_triangles
from cltrace.reference import world_of
from cltrace.reference.trace import closest_hit, primary_ray, trace

pytestmark = pytest.mark.slow

NAMES = list(REGIMES)


def some_scene(seed: int, **more: object) -> Scene:
    """Whole numbers for even seeds, with two meshes; doubles, 1e7 away and before any camera, for odd ones."""
    rng = np.random.default_rng(seed)
    if seed % 2 == 0:
        eye = rng.integers(-3, 4, 3) / 2
        camera = Camera(tuple(eye), tuple(eye - (0, 0, 1)), resolution=(1, 1))
        return Scene.from_spheres(camera, (), [(1, 0, 2)], [3], meshes=[grid_mesh(rng), grid_mesh(rng, 5)])
    mesh = doubles_mesh(rng, 1e7 * (seed % 4 == 1))
    eye = mesh.geometry.vertices[8] + rng.normal(size=3)
    camera = Camera(tuple(eye), tuple(eye + rng.normal(size=3)), tuple(rng.normal(size=3)), resolution=(1, 1))
    egg = [np.eye(3), rng.normal(size=(3, 3))]
    return Scene.from_spheres(camera, (), [eye, eye + 1], [3, 0.5], transform=egg, meshes=[mesh])


def directions(scene: Scene, rng: np.random.Generator, count: int) -> np.ndarray:
    """In camera space: small whole numbers, and at corners and points of edges, as seen from the eye."""
    vertices = np.concatenate([mesh.vertices for mesh in scene.meshes])
    a, b = vertices[rng.integers(len(vertices), size=(2, count))]
    at = a + (b - a) * rng.choice([0, 0.5, 0.25, 1 / 3], (count, 1)) - np.array(scene.camera.position)
    whole = rng.integers(-2, 3, (count, 3)).astype(float)
    whole[~whole.any(axis=1)] = 1
    return np.where(rng.random((count, 1)) < 0.5, whole, at @ np.array(scene.camera.basis()).T)


def exact_way(scene: Scene, d: np.ndarray) -> Vector:
    axes = [exactly(row) for row in scene.camera.basis()]
    return exactly([sum(Fraction(float(e)) * row[i] for e, row in zip(d, axes, strict=True)) for i in range(3)])


def some_points(scene: Scene, rng: np.random.Generator, count: int) -> tuple[Points, list[Vector]]:
    """Points of triangles, often on edges and at corners."""
    triangles = Triangles.of(scene)
    own, corner = rng.integers(len(triangles.faces), size=count), rng.integers(3, size=count)
    uv = rng.choice([0, 0.25, 0.5, 2.0**-64, 0.1], (count, 2))
    corners = [c for _, _, c in corners_of(scene)]
    places = [triangle_point(corners[o], k, u, v) for o, k, (u, v) in zip(own, corner, uv.tolist(), strict=True)]
    return on_triangles(triangles, own, corner, uv), places


@pytest.mark.parametrize("seed", range(8))
def test_what_rays_meet(seed: int) -> None:
    """From the eye and from triangles: the right triangle, how many, and where."""
    rng, count = np.random.default_rng(seed + 100), 60
    scene = some_scene(seed)
    triangles, d, basis = Triangles.of(scene), directions(scene, rng, count), scene.camera.basis()
    leaves, places = some_points(scene, rng, count)
    for start, origins in ((at_point(scene.camera.position, count), None), (leaves, places)):
        rays = along(start, d, basis)
        found, counts = Kinds([triangles]).closest(rays), Kinds([triangles]).counts(rays)
        row, t = found.item, found.t.h
        for i in range(count):
            own = (int(triangles.surface[start.own[i]]), int(triangles.primitive[start.own[i]]))
            origin, way = exactly(scene.camera.position) if origins is None else origins[i], exact_way(scene, d[i])
            want = nearest(scene, origin, way, own if start.own[i] >= 0 else None)
            got = (int(triangles.surface[row[i]]), int(triangles.primitive[row[i]])) if row[i] >= 0 else None
            assert got == (want[1:] if want else None)
            assert want is None or abs(Fraction(t[i]) - want[0]) <= want[0] * Fraction(2) ** -20
            met = [meets(origin, way, corners) for number, k, corners in corners_of(scene) if (number, k) != own]
            if start.own[i] >= 0:
                assert counts[i] == len(met) - met.count(None)


@pytest.mark.parametrize("seed", range(5))
def test_which_lights_are_stopped(seed: int) -> None:
    rng, count = np.random.default_rng(seed + 200), 40
    scene = some_scene(seed)
    triangles = Triangles.of(scene)
    leaves, places = some_points(scene, rng, count)
    vertices = triangles.vertices
    corners = [c for _, _, c in corners_of(scene)]
    for k in range(6):
        parallel = k % 2 == 1
        light = vertices[rng.integers(len(vertices))] * 2 - vertices[rng.integers(len(vertices))]
        light = np.where(rng.random() < 0.5, light, np.round(light)) if not parallel else rng.integers(-2, 3, 3) + 0.0
        if parallel and not light.any():
            continue
        got = Kinds([triangles]).blocked(to_light(leaves, light, parallel))
        for i in range(count):
            origin = places[i] if parallel else exactly(light.tolist())
            way = exactly((-light).tolist()) if parallel else minus(places[i], origin)
            # A light that touches the point is not stopped.
            met = [meets(origin, way, c) for j, c in enumerate(corners) if j != leaves.own[i] and any(way)]
            assert got[i] == any(t is not None and (parallel or t < 1) for t in met)


PYTHAGORAS = [(3, 4, 0), (0, -3, 4), (1, 2, 2), (2, -1, 2), (-2, 3, 6), (0, 0, -1), (6, 2, -3), (-4, 0, 3)]


@pytest.mark.parametrize("seed", range(0, 4, 2))
def test_rays_from_spheres(seed: int) -> None:
    """From points that are rational, and that square roots must find to be so."""
    rng = np.random.default_rng(seed + 300)
    scene = some_scene(seed)
    n = np.repeat(np.array(PYTHAGORAS, float), 6, axis=0)
    triangles, d = Triangles.of(scene), rng.integers(-2, 3, (len(n), 3)) + (0.0, 0.0, 0.25)
    start = on_spheres(Spheres.of(scene), np.zeros(len(n), int), n, scene.camera.basis())
    row = Kinds([triangles]).closest(along(start, d, scene.camera.basis())).item
    lights = rng.integers(-3, 4, (4, 3)).astype(float)
    dark = [Kinds([triangles]).blocked(to_light(start, light, False)) for light in lights]
    sphere, corners = scene.spheres[0], [c for _, _, c in corners_of(scene)]
    for i, q in enumerate(n.tolist()):
        length = math.isqrt(int(sum(x * x for x in q)))
        out = [Fraction(float(sphere["radius"])) * int(x) / length for x in q]
        place = exactly([Fraction(c) + x for c, x in zip(sphere["center"].tolist(), out, strict=True)])
        want = nearest(scene, place, exactly(d[i].tolist()))
        assert (want[1:] if want else None) == (
            (triangles.surface[row[i]], triangles.primitive[row[i]]) if row[i] >= 0 else None
        )
        for k, light in enumerate(lights.tolist()):
            met = [meets(exactly(light), minus(place, exactly(light)), c) for c in corners]
            assert dark[k][i] == any(t is not None and t < 1 for t in met)


@pytest.mark.parametrize("seed", [1, 3])
def test_doubles_from_spheres_and_ellipsoids_are_right(seed: int) -> None:
    """Where they are sure: the same as by whole numbers alone."""
    rng = np.random.default_rng(seed + 400)
    scene, count = some_scene(seed), 200
    own, n = rng.integers(2, size=count), rng.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    triangles, kinds = Triangles.of(scene), Kinds([Triangles.of(scene)])
    start = on_spheres(Spheres.of(scene), own, n, scene.camera.basis())
    d = directions(scene, rng, count)
    light = triangles.vertices[0] + rng.normal(size=3)
    for rays in (along(start, d, scene.camera.basis()), to_light(start, light, False), to_light(start, d[0], True)):
        doubtful = replace(rays, rough=None)
        assert np.array_equal(kinds.counts(rays), kinds.counts(doubtful))
        found, exact = kinds.closest(rays), kinds.closest(doubtful)
        assert np.array_equal(found.item, exact.item)
        assert np.allclose(found.t.h, exact.t.h, rtol=2.0**-20)


def test_square_roots_have_the_right_sign() -> None:
    values = (-7, -3, -2, -1, 0, 1, 2, 3, 7)
    for a, b, s in itertools.product(values, values, (0, 1, 2, 3, 4, 9, 10)):
        value = a + b * math.sqrt(s)
        assert Surd(a, b, s).sign() == (0 if abs(value) < 1e-9 else math.copysign(1, value))


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


def test_there_are_twenty_regimes_at_least() -> None:
    assert len(REGIMES) >= 20
    assert set(CLOSED) | set(AROUND) <= set(NAMES)
    assert scene_of("soup", 0, (64, 32)).camera.image_plane() == (TAN, TAN / 2)


@pytest.mark.parametrize("name", NAMES)
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


def test_many_rays_are_decided_by_whole_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the regimes whose structures are on rays; and next to none where nothing is."""
    decided: list[ExactTriangle] = []
    first = ExactTriangle.first

    def counted(triangle: ExactTriangle, line: Line, t_min: float, t_max: float) -> Root | None:
        decided.append(triangle)
        return first(triangle, line, t_min, t_max)

    monkeypatch.setattr(ExactTriangle, "first", counted)
    for name, least, most in (
        ("corners on rays", 200, 1e4),
        ("edges along rows", 400, 1e4),
        ("terrain", 400, 1e4),
        ("duplicates", 1000, 1e5),
        ("a closed ball", 0, 5),
    ):
        decided.clear()
        expected(scene_of(name, 0, (32, 32)))
        assert least <= len(decided) <= most, (name, len(decided))


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
