"""The exact engine, by way of the oracle, against an independent judge: on hostile scenes, and random ones of ties."""

from __future__ import annotations

from typing import Any

import judge
import mpmath
import numpy as np
import pytest
from hostile import bounced_regimes, cylinder_regimes, mesh_regimes
from hostile.sphere_regimes import REGIMES, camera_space, rays
from small_meshes import doubles_mesh
from surface_rays import along, blocked, closest, on_spheres, on_triangles, to_light

from cltrace import Camera, Mesh, Scene
from cltrace.oracle import closest_hit
from cltrace.oracle.scenes import kinds_of
from cltrace.oracle.search import Kinds
from cltrace.oracle.shapes import Spheres, Triangles


def agree(surfaces: list[judge.Named], found: tuple[int, int, float], o: object, w: object, *ends: float) -> int:
    """The number of what is met, after having compared what was found with what the judge says."""
    index, t = judge.first([one[2] for one in surfaces], o, w, *ends)  # type: ignore[arg-type]
    assert found[:2] == (surfaces[index][:2] if index >= 0 else (-1, -1))
    assert judge.is_rounded(found[2], t)
    return found[0]


@pytest.mark.parametrize(("name", "regime"), REGIMES, ids=[name for name, _ in REGIMES])
def test_spheres_from_the_eye(name: str, regime: object) -> None:
    for seed in range(2):
        scene = regime(seed, (32, 24))  # type: ignore[operator]
        origin, centers, radii = camera_space(scene)
        d = rays(scene.camera)
        index, t = closest(origin, d, centers, radii)
        balls: list[judge.Named] = [(i, -1, judge.Ball(*one)) for i, one in enumerate(zip(centers, radii, strict=True))]
        for k in np.random.default_rng(seed).choice(len(d), 20, replace=False):
            agree(balls, (int(index[k]), -1, float(t[k])), origin, d[k])


@pytest.mark.parametrize("name", list(bounced_regimes.REGIMES))
def test_rays_and_shadows_from_spheres_and_ellipsoids(name: str) -> None:
    seen, count = set(), {False: 0, True: 0}
    for seed in range(3):
        scene = bounced_regimes.scene_of(name, seed)
        leaving, spheres, surfaces = (
            bounced_regimes.rays_of(scene, 15, seed),
            Spheres.of(scene),
            judge.surfaces_of(scene),
        )
        kinds, paths = Kinds([spheres]), leaving.path(spheres)
        found = kinds.closest(paths)
        t = kinds.rounded(paths, found)
        rng = np.random.default_rng(seed)
        light = scene.spheres["center"][0] + scene.spheres["radius"][0] * rng.normal(size=3)
        points = on_spheres(spheres, leaving.own.astype(np.int64), leaving.normal, leaving.basis)
        dark = blocked(kinds, to_light(points, light, parallel=bool(seed % 2)))
        for k, own in enumerate(leaving.own.tolist()):
            ball = surfaces[own][2]
            assert isinstance(ball, judge.Ball)
            normal = judge.in_world(scene, leaving.normal[k]) if ball.to_object is None else leaving.normal[k]
            start = ball.point(normal)
            seen.add(
                agree(
                    surfaces, (int(found.item[k]), -1, float(t[k])), start, judge.in_world(scene, leaving.direction[k])
                )
            )
            want = judge.between([one[2] for one in surfaces], start, light, parallel=bool(seed % 2))
            assert dark[k] == want
            count[want] += 1
    assert len(seen) > 2
    assert min(count.values()) > 0


@pytest.mark.parametrize(
    ("regimes", "name", "seeds"),
    [
        *((mesh_regimes, name, 1) for name in mesh_regimes.REGIMES),
        *((cylinder_regimes, name, 3) for name in cylinder_regimes.REGIMES),
    ],
)
def test_meshes_and_cylinders(regimes: Any, name: str, seeds: int) -> None:
    for seed in range(seeds):
        scene = regimes.scene_of(name, seed, (8, 8))
        surfaces, eye, rng = judge.surfaces_of(scene), scene.camera.position, np.random.default_rng(seed)
        d = rays(scene.camera)[rng.choice(64, 4 if len(surfaces) < 200 else 1, replace=False)]
        d = d @ np.array(scene.camera.basis())
        found = closest_hit(scene, eye, d)
        for k, way in enumerate(d):
            agree(surfaces, (int(found.id[k]), int(found.primitive[k]), float(found.t[k])), eye, way)


def whole_scene(rng: np.random.Generator) -> Scene:
    """Of small whole numbers, so that surfaces touch, and are equally near, all over."""
    centers, radii = rng.integers(-3, 4, (4, 3)), rng.integers(1, 4, 4)
    maps = np.array([np.eye(3), np.eye(3), np.diag(rng.choice([0.5, 1, 2], 3)), np.eye(3)[rng.permutation(3)] * 2])
    mesh = Mesh(rng.integers(-3, 4, (7, 3)).astype(float), [(0, 1, 2), (0, 2, 3), (3, 2, 4), (4, 5, 6), (1, 2, 5)])
    scene = Scene.from_spheres(Camera(), (), centers, radii, transform=maps, meshes=[mesh])
    starts = rng.integers(-3, 4, (3, 3)).astype(float)
    ends = starts + np.eye(3)[rng.integers(0, 3, 3)] * rng.choice([-2, -1, 1, 2], (3, 1))
    return scene.with_cylinders(starts, ends, rng.choice([0.5, 1, 2], 3))


@pytest.mark.parametrize("seed", range(6))
def test_whole_numbers(seed: int) -> None:
    """Any start, any range, all shapes together."""
    rng = np.random.default_rng(seed)
    scene = whole_scene(rng)
    surfaces, seen = judge.surfaces_of(scene), set()
    o, d = rng.integers(-5, 6, (60, 3)).astype(float), rng.integers(-2, 3, (60, 3)).astype(float)
    d[~d.any(axis=1)] = 1
    t_min, t_max = rng.choice([0, 0, -1, 0.5, 1, -np.inf], 60), rng.choice([np.inf, np.inf, 2, 3], 60)
    found = closest_hit(scene, o, d, t_min, t_max)
    for k in range(60):
        got = int(found.id[k]), int(found.primitive[k]), float(found.t[k])
        seen.add(agree(surfaces, got, o[k], d[k], t_min[k], t_max[k]))
    assert len(seen) > 4


def double_scene(rng: np.random.Generator, offset: float) -> Scene:
    """Around corners, and with needles, far from the origin and before any camera."""
    mesh = doubles_mesh(rng, offset)
    eye = mesh.geometry.vertices[8] + rng.normal(size=3)
    camera = Camera(tuple(eye), tuple(eye + rng.normal(size=3)), tuple(rng.normal(size=3)))
    egg = np.array([np.eye(3), rng.normal(size=(3, 3))])
    return Scene.from_spheres(camera, (), [eye, eye + 1], [3, 0.5], transform=egg, meshes=[mesh])


@pytest.mark.parametrize("seed", range(6))
def test_rays_and_lights_from_points_of_surfaces(seed: int) -> None:
    """From triangles, at their edges, too, and from spheres, towards corners and points of edges."""
    rng, count = np.random.default_rng(seed + 50), 12
    scene = double_scene(rng, 1e7 * (seed % 4 == 1)) if seed % 2 else whole_scene(rng)
    flat, spheres, surfaces, kinds = Triangles.of(scene), Spheres.of(scene), judge.surfaces_of(scene), kinds_of(scene)
    own, corner = rng.integers(len(flat.faces), size=count), rng.integers(3, size=count)
    on_flat = on_triangles(flat, own, corner, rng.choice([0, 0.25, 0.5, 2.0**-64, 0.1], (count, 2)))
    ball, n = rng.integers(2, size=count), rng.choice([-2.0, 0, 1, 0.7], (count, 3)) + (0, 0, 0.25)
    on_ball = on_spheres(spheres, ball, n, scene.camera.basis())
    a, b = flat.vertices[rng.integers(len(flat.vertices), size=(2, count))]
    for points, kind in ((on_flat, Triangles), (on_ball, Spheres)):
        places = []
        for k in range(count):
            if kind is Triangles:
                with mpmath.workdps(judge.DIGITS):
                    places.append([mpmath.mpf(x.numerator) / x.denominator for x in points.place(k).fractions()])
            else:
                surface = surfaces[int(spheres.surface[ball[k]])][2]
                assert isinstance(surface, judge.Ball)
                places.append(surface.point(judge.in_world(scene, n[k]) if surface.to_object is None else n[k]))
        d = (a + (b - a) * rng.choice([0, 0.5, 0.25], (count, 1))) - np.array([[float(x) for x in p] for p in places])
        d[~d.any(axis=1)] = 1
        paths = along(points, d, np.eye(3))
        found, light = kinds.closest(paths), b[0] + (0, 0, 1.0)
        t = kinds.rounded(paths, found)
        near = blocked(Kinds([flat]), to_light(points, light, parallel=False))
        parallel = blocked(kinds, to_light(points, light, parallel=True))
        for k, place in enumerate(places):
            got = (np.append(numbers, -1)[found.item[k]] for numbers in (kinds.surface, kinds.primitive))
            agree(surfaces, (*map(int, got), float(t[k])), place, d[k])
            flats = [one[2] for one in surfaces if isinstance(one[2], judge.Flat)]
            assert near[k] == judge.between(flats, place, light, parallel=False)
            assert parallel[k] == judge.between([one[2] for one in surfaces], place, light, parallel=True)


def test_the_judge_finds_mistakes() -> None:
    """And knows what is equal, what touches, and who owns an edge."""
    two = [judge.Ball((0, 0, -5), 1.0), judge.Ball((0, 0, -6), 2.0)]
    assert judge.first(two, (0, 0, 0), (0, 0, -1)) == (0, 4)
    assert judge.first(two, (0, 0, 0), (0, 0, -1), 4) == (0, 6)
    assert judge.first(two[:1], (1, 0, 0), (0, 0, -1)) == (0, 5)
    assert judge.first(two[:1], (float(np.nextafter(1, 2)), 0, 0), (0, 0, -1))[0] == -1
    square = [judge.Flat(((-1, -1, -1), (1, -1, -1), (1, 1, -1))), judge.Flat(((-1, -1, -1), (1, 1, -1), (-1, 1, -1)))]
    assert [judge.first(square, (0, 0, 0), (x, 0, -1))[0] for x in (0, 1e-300, -1e-300)] == [0, 0, 1]
    cylinder = judge.Cylinder((0, 0, -3), (0, 0, -2), 1.0)
    assert judge.first([cylinder], (0, 0, 0), (0, 0, -1)) == (0, 2)
    assert judge.first([cylinder], (1, 0, 0), (0, 0, -1)) == (0, 2)
    assert judge.between(two, (0, 0, 0), (0, 0, -5), parallel=False)
    assert not judge.between(two[:1], (0, 0, 0), (0, 0, -4), parallel=False)
    assert judge.is_rounded(0.1, mpmath.mpf(1) / 10)
    assert not judge.is_rounded(float(np.nextafter(0.1, 1)), mpmath.mpf(1) / 10)
    with pytest.raises(AssertionError):
        agree([(3, -1, two[0])], (3, -1, 4.5), (0, 0, 0), (0, 0, -1))
