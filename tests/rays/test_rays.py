"""trace_rays against the exact oracle, rational arithmetic, and what the kernel shows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from hostile.mesh_regimes import REGIMES, round_mesh, scene_of
from hostile.sphere_regimes import rays as camera_rays
from small_meshes import doubles_mesh, grid_mesh

import cltrace
from cltrace import Camera, Mesh, Scene, oracle
from cltrace.base.arithmetic import inverses
from cltrace.renderers import rays as inside
from cltrace.renderers.rays import Hits, trace_rays
from cltrace.run import rays as on_device
from cltrace.run.devices import Device

CAMERA = Camera((0, 0, 9), (0, 0, 0), resolution=(8, 8))


@pytest.fixture(autouse=True)
def by_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """So few rays as here would else be left to the exact engine, which is the oracle."""
    monkeypatch.setattr(inside, "FEW_RAYS", 0)
    monkeypatch.setattr(on_device, "MANY_UNDECIDED", 0)


def mixed(seed: int, offset: float = 0.0, scale: float = 1.0) -> Scene:
    """Small whole numbers: spheres that touch, ellipsoids, and triangles that share corners, planes and places."""
    rng = np.random.default_rng(seed)
    centers, radii = rng.integers(-2, 3, (8, 3)), rng.integers(1, 3, 8) / 2
    maps = np.array([np.eye(3)] * 5 + [np.diag([1, 2, 0.5]), rng.integers(-2, 3, (3, 3)) + 3 * np.eye(3)] * 2)[:8]
    meshes = [grid_mesh(rng, 20), grid_mesh(rng, 6), doubles_mesh(rng, 0)]
    meshes.append(Mesh.of(meshes[0], transform=rng.integers(-1, 2, (3, 3)) + 3 * np.eye(3)))
    meshes.append(Mesh.of(meshes[0]))  # all of its triangles are there twice
    moved = [
        Mesh(mesh.placed.vertices * scale + offset, mesh.geometry.faces[rng.permutation(len(mesh.geometry.faces))])
        for mesh in meshes
    ]
    return Scene.from_spheres(CAMERA, (), centers * scale + offset, radii * scale, transform=maps, meshes=moved)


def aimed(scene: Scene, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays through corners and edges, along faces, past spheres and at their middles, from everywhere."""
    vertices = np.concatenate([mesh.vertices for mesh in scene.meshes])
    a, b = vertices[rng.integers(len(vertices), size=(2, count))]
    on = a + (b - a) * rng.choice([0, 0, 0.5, 0.25, 1 / 3, 1.5], (count, 1))
    centers, radii = scene.spheres["center"], scene.spheres["radius"]
    ball = rng.integers(len(centers), size=count)
    axis = np.eye(3)[rng.integers(3, size=count)] * rng.choice([-1, 1], (count, 1))
    limb = centers[ball] + radii[ball, None] * axis  # a point of each sphere, exactly
    size = np.abs(vertices).max()
    goals = np.stack([on, limb, centers[ball], on])
    starts = np.stack([on[::-1], limb[::-1], centers[ball][::-1], rng.normal(size=(count, 3)) * 4 * size, a])
    one = goals[rng.integers(len(goals), size=count), np.arange(count)]
    two = starts[rng.integers(len(starts), size=count), np.arange(count)]
    way = np.where(rng.random((count, 1)) < 0.3, np.roll(axis, 1, axis=1), one - two)
    way[~way.any(axis=1)] = 1
    return two, way


def same(hits: Hits, want: oracle.OracleHits) -> None:
    assert hits.id.tolist() == want.id.tolist()
    assert hits.primitive.tolist() == want.primitive.tolist()
    assert hits.t.tolist() == want.t.tolist()


Paths = tuple[np.ndarray, np.ndarray, np.ndarray | float, np.ndarray | float]  # origins, directions, t_min and t_max
Case = tuple[Scene, *Paths]


def hostile(seed: int, count: int = 300, ends: bool = False, **how: float) -> Case:
    """Corners, edges, faces seen edge-on, spheres touched, starts on surfaces, equal depths; ends of ranges there."""
    scene, rng = mixed(seed, **how), np.random.default_rng(seed + 50)
    o, d = aimed(scene, rng, count)
    if not ends:
        return scene, o, d, 0.0, np.inf
    return scene, o, d, rng.choice([-np.inf, -1.5, -1, 0, 0.5, 1], count), rng.choice([np.inf, 1, 0.5, 2, 1e-9], count)


def from_far_away(distance: float) -> Case:
    """At whole points of the scene, so that a good share of the rays still meets it where no double resolves it."""
    scene, rng = mixed(2), np.random.default_rng(4)
    axis = np.eye(3)[rng.integers(3, size=150)] * rng.choice([-1, 1], (150, 1))
    way = np.where(rng.random((150, 1)) < 0.7, axis, rng.normal(size=(150, 3)))
    o = rng.integers(-2, 3, (150, 3)) / rng.choice([1, 2, 3], (150, 1)) - way * 2.0 ** round(math.log2(distance))
    return scene, o, way, 0.0, np.inf


def extreme_numbers() -> Case:
    """Directions and starts as small and as large as there are, also beside each other."""
    rng = np.random.default_rng(6)
    scene, o, d, low, high = hostile(5, 120)
    d *= 2.0 ** rng.choice([-1060, -900, -300, 0, 300, 900], (120, 1))
    d[rng.random((120, 3)) < 0.2] = 1e-320
    o[rng.random((120, 3)) < 0.2] = 5e-324
    return scene, o, d, low, high


def along_edges() -> Case:
    """In the planes of faces, along their edges, and through corners, where no double decides."""
    vertices, faces = round_mesh(2)
    scene, rng = Scene.from_meshes(CAMERA, (), Mesh(vertices, faces)), np.random.default_rng(3)
    a, b, c = vertices[faces[rng.integers(len(faces), size=200)]].swapaxes(0, 1)
    o = a - (b - a) * rng.choice([0, 1, 2, -0.5], (200, 1))
    return scene, np.vstack([o, o]), np.vstack([b - a, c - o]), 0.0, np.inf


def on_a_ground() -> Case:
    """A ground sphere under a cloud and a terrain: what a tree of boxes finds is all that there is."""
    rng = np.random.default_rng(10)
    centers = np.vstack([[(0, -1e5, 0)], rng.uniform(-1, 1, (3000, 3)) + (0, 1, 0)])
    vertices, faces = round_mesh(3)
    ball = Mesh(vertices * 0.5 + (0.2, 1, 0.1), faces)
    scene = Scene.from_spheres(CAMERA, (), centers, np.append(1e5, rng.uniform(0.005, 0.05, 3000)), meshes=[ball])
    d = np.vstack([rng.normal(size=(150, 3)) * (0.2, 0.2, 0) + (0, -0.1, -1), rng.normal(size=(50, 3))])
    return scene, np.broadcast_to((0, 1.5, 6), d.shape), d, 0.0, np.inf


def at_corners(seed: int) -> Case:
    """One triangle, at whose corners the box around it is met at a point: no rounding of float32 may lose that."""
    rng = np.random.default_rng(seed)
    corners = np.round(rng.normal(size=(3, 3)) * 2.0**40) / 2.0**40
    scene = Scene.from_meshes(CAMERA, (), Mesh(corners, [(0, 1, 2)]))
    d = rng.integers(-3, 4, (300, 3)).astype(float)
    d[~d.any(axis=1)] = 1
    return scene, corners[rng.integers(3, size=300)] - d * rng.choice([0.5, 1, 2], (300, 1)), d, 0.0, np.inf


CASES: dict[str, Callable[[], Case]] = {
    **{f"whole numbers {seed}": partial(hostile, seed) for seed in range(4)},
    **{f"ranges {seed}": partial(hostile, seed, ends=True) for seed in range(3)},
    "1e7": partial(hostile, 9, offset=1e7),
    "1e15": partial(hostile, 9, offset=1e15),
    "tiny": partial(hostile, 9, scale=2.0**-100),
    "huge": partial(hostile, 9, scale=2.0**90),
    **{f"from {distance:g}": partial(from_far_away, distance) for distance in (1e3, 1e9, 1e15, 1e22, 1e60)},
    "extreme numbers": extreme_numbers,
    "along edges": along_edges,
    "a ground": on_a_ground,
    **{f"corners of boxes {seed}": partial(at_corners, seed) for seed in range(20)},
}


@pytest.mark.parametrize(
    ("name", "many"),
    [*((name, 0) for name in CASES), *((f"ranges {k}", 10**9) for k in range(3)), ("along edges", 10**9)],
)
def test_hostile_rays(name: str, many: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a device decides, by whole numbers if need be, and what it leaves to the exact engine, is as the oracle
    says. many: where the latter decides about as many as these."""
    monkeypatch.setattr(on_device, "MANY_UNDECIDED", many)
    scene, o, d, low, high = CASES[name]()
    want = oracle.closest_hit(scene, o, d, low, high)
    same(trace_rays(scene, o, d, t_min=low, t_max=high), want)
    assert 0 < (want.id >= 0).sum() < len(want.id)


@pytest.fixture(params=["device", "exact engine"])
def either(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both ways in which rays are decided."""
    monkeypatch.setattr(inside, "FEW_RAYS", 0 if request.param == "device" else 10**9)


def all_shapes(seed: int) -> Scene:
    """Spheres, ellipsoids, cylinders and a mesh, in and through each other."""
    rng = np.random.default_rng(seed)
    maps = np.array([*[np.eye(3)] * 30, *(rng.normal(size=(10, 3, 3)) + 2 * np.eye(3))])
    vertices, faces = round_mesh(2)
    ends = rng.uniform(-1, 1, (2, 20, 3))
    centers, radii = rng.uniform(-1, 1, (40, 3)), rng.uniform(0.05, 0.5, 40)
    scene = Scene.from_spheres(CAMERA, (), centers, radii, transform=maps, meshes=Mesh(vertices, faces))
    return scene.with_cylinders(*ends, rng.uniform(0.02, 0.2, 20))


def paths(kind: str, scene: Scene, count: int) -> Paths:
    """Rays that are hard to decide, with their ranges."""
    rng = np.random.default_rng(len(kind))
    goals = rng.uniform(-1, 1, (count, 3))
    o = rng.normal(size=(count, 3)) * 2
    d, none, endless = goals - o, np.zeros(count), np.full(count, np.inf)
    if kind == "random":
        return o, d, none, endless
    if kind == "ranges":
        return o, d, rng.choice([-np.inf, -1, 0, 0.5, 0.9, 1], count), rng.choice([np.inf, 1, 1.1, 0.95], count)
    if kind.startswith("far"):
        d /= np.linalg.norm(d, axis=1)[:, None]
        far = float(kind.split()[1])
        return goals - d * far, d, far - rng.choice([0, 0.5, 1, np.inf], count), far + rng.choice([1, np.inf], count)
    if kind == "tangent":  # along an axis, past the spheres' and the cylinders' outermost points
        spheres, axis = scene.spheres[:30], rng.integers(3, size=count)
        one, way = spheres[rng.integers(30, size=count)], np.eye(3)[axis] * rng.choice([-1, 1], (count, 1))
        limb = one["center"] + one["radius"][:, None] * np.roll(way, 1, axis=1)
        return limb - way * rng.choice([1, 4], (count, 1)), way, none, endless
    hits = trace_rays(scene, o, d)
    met = np.flatnonzero(hits.id >= 0)
    o, d, t, end = o[met], d[met], hits.t[met], endless[met]
    if kind == "between":  # behind the first hit: the far end of what is round counts
        return o, d, t, end
    if kind == "up to":  # a double more or less than where they end
        return o, d, np.zeros(len(t)), np.nextafter(t, rng.choice([-np.inf, 0, np.inf], len(t)))
    assert kind == "leaving"  # from points that are on surfaces, but for rounding
    return hits.point[met], rng.normal(size=(len(met), 3)), np.zeros(len(t)), end


KINDS = ("random", "ranges", "far 1e3", "far 1e9", "far 1e13", "far 1e16", "tangent", "between", "up to", "leaving")


@pytest.mark.parametrize("kind", KINDS)
def test_hard_rays(kind: str) -> None:
    """What a device decides, and what it leaves to the exact engine, is what the oracle says."""
    scene = all_shapes(1)
    o, d, low, high = paths(kind, scene, 400)
    hits, want = trace_rays(scene, o, d, t_min=low, t_max=high), oracle.closest_hit(scene, o, d, low, high)
    same(hits, want)
    assert (want.id >= 0).sum() > 50


def test_most_rays_are_decided_by_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[on_device.DeviceHits] = []
    trace = on_device.RayTracer.trace

    def kept(self: on_device.RayTracer, *rays: np.ndarray) -> on_device.DeviceHits:
        found.append(trace(self, *rays))
        return found[-1]

    monkeypatch.setattr(on_device.RayTracer, "trace", kept)
    scene = all_shapes(1)
    for kind in ("random", "ranges", "far 1e9"):
        o, d, low, high = paths(kind, scene, 4000)
        trace_rays(scene, o, d, t_min=low, t_max=high)
    assert len(found) == 3
    assert all(len(one.undecided) <= 2 for one in found)


def test_more_candidates_than_there_is_room_for() -> None:
    """A ray that touches a hundred spheres, none of which pairs can tell, and a sphere behind them."""
    x = np.arange(100.0)
    centers = np.stack([x, np.where(x % 2, 1, -1), 0 * x], axis=1)
    scene = Scene.from_spheres(CAMERA, (), np.vstack([centers[::-1], [(200, 0, 0)]]), 1)
    rays = [(-1, 0, 0), (-1, 1e-300, 0), (-1, -1e-300, 0), (-1, 0, 1e-20)]
    hits = trace_rays(scene, rays, (1, 0, 0))
    assert hits.id.tolist() == [99, 98, 99, 100]
    assert hits.t.tolist() == [1, 2, 1, 200]


def test_few_rays_wait_for_no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor do many without a device, or with one that has no doubles."""
    scene, o = all_shapes(2), np.random.default_rng(4).normal(size=(20, 3)) * 3
    want = oracle.closest_hit(scene, o, -o)
    monkeypatch.setattr(inside, "RayTracer", None)
    monkeypatch.setattr(inside, "FEW_RAYS", 1000)
    same(trace_rays(scene, o, -o), want)
    monkeypatch.setattr(inside, "FEW_RAYS", 0)
    for found in (cltrace.DeviceError("there is none"), SimpleNamespace(has_double=False)):
        inside._known.clear()
        monkeypatch.setattr(inside, "choose", Mock(side_effect=[found]))
        same(trace_rays(scene, o, -o), want)


@pytest.mark.parametrize("name", list(REGIMES))
def test_hostile_meshes(name: str) -> None:
    """The regimes' pictures, ray by ray."""
    scene = scene_of(name, 1, (16, 16))
    d = camera_rays(scene.camera) @ np.array(scene.camera.basis())
    same(trace_rays(scene, scene.camera.position, d), oracle.closest_hit(scene, scene.camera.position, d))


FEW = ("first", "transforms")  # of the others, each has a kernel to compile
FILES = [
    pytest.param(file, id=file.stem, marks=() if file.stem in FEW else pytest.mark.slow)
    for file in sorted((Path(__file__).parents[2] / "scenes").glob("*.xml"))
]


@pytest.mark.parametrize("file", FILES)
def test_what_pictures_show(file: Path, any_device: Device) -> None:
    """The rays of the eye: the kernel's surfaces, triangles, distances, normals and texture coordinates."""
    scene = cltrace.load(file)
    width, height = scene.camera.resolution
    scene = scene.seen_by(replace(scene.camera, resolution=(max(1, width // 8), max(1, height // 8)), max_bounces=0))
    image = cltrace.render(scene, any_device, outputs=("id", "primitive", "depth", "normal", "uv"))
    # The camera's axes are not always exact, so that the world's directions are rounded.
    d = camera_rays(scene.camera) @ np.array(scene.camera.basis())
    hits = trace_rays(scene, scene.camera.position, d)
    assert np.count_nonzero(hits.id != image.id.ravel()) <= 1e-4 * len(d)
    some = (hits.id == image.id.ravel()) & (hits.primitive == image.primitive.ravel()) & (hits.id >= 0)
    length = np.linalg.norm(d, axis=1)
    np.testing.assert_allclose((hits.t * length)[some], image.depth.ravel()[some], rtol=1e-7)
    np.testing.assert_allclose(hits.normal[some], image.normal.reshape(-1, 3)[some], atol=1e-6)
    np.testing.assert_allclose(hits.uv[some], image.uv.reshape(-1, 2)[some], atol=1e-5)
    where = scene.camera.position + d[some] * hits.t[some, None]
    np.testing.assert_allclose(hits.point[some], where, rtol=1e-12, atol=1e-9)
    nothing = hits.id < 0
    assert np.isinf(hits.t[nothing]).all()
    assert np.isnan(hits.point[nothing]).all()
    assert not hits.normal[nothing].any()
    assert not hits.uv[nothing].any()


@pytest.mark.usefixtures("either")
def test_points_are_on_the_surface_from_however_far() -> None:
    """1e15 away, t alone would be off by a tenth; point is not made of that."""
    scene = Scene.from_spheres(CAMERA, (), [(0, 0, 0), (5, 0, 0)], 1, transform=[np.eye(3), np.diag([1, 0.5, 2])])
    o = np.array([(1e15 / 3, 0.25, 0.5), (1e15 / 3, 0.0, 0.7)])
    hits = trace_rays(scene, o, (-1, 0, 0))
    x = math.sqrt(1 - 0.25**2 - 0.5**2)
    assert hits.id.tolist() == [1, 1]
    low = trace_rays(scene, o, (-1, 0, 0), t_min=o[:, 0] - 2)
    np.testing.assert_allclose(low.point[0], (x, 0.25, 0.5), rtol=1e-15)
    K = inverses(np.diag([1, 0.5, 2])[None])[0]
    assert abs(np.linalg.norm(K @ (hits.point[0] - (5, 0, 0))) - 1) < 1e-15
    np.testing.assert_allclose(low.normal[0], (x, 0.25, 0.5), rtol=1e-15)


@pytest.mark.usefixtures("either")
def test_normals_and_uv_of_triangles() -> None:
    """By hand: in the middle of a triangle with a normal and a place of the texture at each corner."""
    corners = np.array([(0, 0, 0), (3, 0, 0), (0, 3, 0)], float)
    normals, uv = np.array([(0, 0, 1), (1, 0, 1), (0, 1, 1)], float), np.array([(0, 0), (3, 0), (0, 6)], float)
    mesh = Mesh(corners, [(0, 1, 2)], normals, uv, transform=np.diag([1, 1, 2]))
    scene = Scene.from_meshes(CAMERA, (), [mesh, Mesh(corners - (0, 0, 1), [(0, 1, 2)])])
    hits = trace_rays(scene, [(1, 1, 5), (1, 1, -5), (4, 4, 5)], [(0, 0, -1), (0, 0, 1), (0, 0, -1)])
    assert hits.t.tolist() == [5, 4, np.inf]
    assert hits.id.tolist() == [0, 1, -1]
    # Interpolated (1, 1, 3) / 3; the map doubles z, so the inverse transpose halves it.
    n = np.array([1, 1, 1.5]) / np.linalg.norm([1, 1, 1.5])
    np.testing.assert_allclose(hits.normal, [n, (0, 0, -1), (0, 0, 0)], atol=1e-15)
    np.testing.assert_allclose(hits.uv, [(1, 2), (0, 0), (0, 0)], atol=1e-15)


@pytest.mark.usefixtures("either")
def test_the_rim_of_a_cylinder_is_its_end() -> None:
    scene = Scene.from_spheres(CAMERA, (), np.zeros((0, 3)), 1).with_cylinders([(0, 0, 0)], [(0, 0, 2)], 1)
    origins = [(2, 0, 3), (1, 0, 5), (2, 0, -1), (3, 0, 1)]
    directions = [(-1, 0, -1), (0, 0, -1), (-1, 0, 1), (-1, 0, 0)]
    hits = trace_rays(scene, origins, directions)
    assert hits.normal.tolist() == [[0, 0, 1], [0, 0, 1], [0, 0, -1], [1, 0, 0]]


def test_a_closed_mesh_has_no_hole() -> None:
    """From within: through corners, points of edges, and an ulp beside them, all of them doubles."""
    vertices, faces = round_mesh(3)
    scene, rng = Scene.from_meshes(CAMERA, (), Mesh(vertices, faces)), np.random.default_rng(8)
    at = vertices[rng.integers(len(vertices), size=4000)]
    edge = vertices[faces[rng.integers(len(faces), size=4000)]][:, :2].sum(axis=1) / 2
    goals = np.concatenate([at, edge, np.nextafter(at, 2), np.nextafter(edge, -2)])
    o = np.where(rng.random((len(goals), 1)) < 0.5, 0, rng.uniform(-0.5, 0.5, goals.shape))
    hits = trace_rays(scene, o, goals - o)
    assert (hits.id == 0).all()
    np.testing.assert_allclose(hits.t, 1, atol=1e-14)
    assert (oracle.triangles_met(o[:99], (goals - o)[:99], vertices, faces) == 1).all()
    away = trace_rays(scene, 2 * goals, goals)
    assert (away.id == -1).all()
    assert (oracle.triangles_met(2 * goals[::99], -goals[::99], vertices, faces) % 2 == 0).all()


def test_blocks_and_threads_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, rng = mixed(4), np.random.default_rng(9)
    o, d = aimed(scene, rng, 200)
    want = trace_rays(scene, o, d)
    monkeypatch.setattr(on_device, "RAYS_AT_ONCE", 7)
    monkeypatch.setattr(on_device, "RUN", 3)
    again = trace_rays(scene, o, d)
    for name in ("t", "id", "primitive", "point", "normal", "uv"):
        np.testing.assert_array_equal(getattr(want, name), getattr(again, name))


@pytest.mark.usefixtures("either")
def test_nothing_to_meet() -> None:
    hits = trace_rays(Scene.from_spheres(CAMERA, (), [], 1), np.zeros((2, 3)), (0, 0, 1))
    assert hits.id.tolist() == [-1, -1]
    assert repr(hits) == "<cltrace.Hits: 0 of 2 rays>"
    none = trace_rays(mixed(0), np.empty((0, 3)), np.empty((0, 3)))
    assert len(none) == len(none.point) == len(none.uv) == 0


@pytest.mark.usefixtures("either")
def test_shapes_of_arguments() -> None:
    scene = Scene.from_spheres(CAMERA, (), [(0, 0, 0)], 1)
    assert trace_rays(scene, (0, 0, 3), (0, 0, -1)).t.tolist() == [2]
    assert trace_rays(scene, [(0, 0, 3), (0, 0, 4)], (0, 0, -1)).t.tolist() == [2, 3]
    assert trace_rays(scene, (0, 0, 3), [(0, 0, -2), (0, 0, 1)]).t.tolist() == [1, np.inf]
    assert trace_rays(scene, (0, 0, 3), (0, 0, -1), t_min=[2, 1], t_max=[9, 2]).t.tolist() == [4, np.inf]


@pytest.mark.parametrize(
    ("origins", "directions", "more", "text"),
    [
        ((0, 0, 0), (0, 0, 0), {}, "directions: must not be 0"),
        ((0, 0, 0), [(0, 0, 1), (0, 0, -0.0)], {}, "directions[1]: must not be 0"),
        ([(0, 0, 0), (0, np.nan, 0)], (0, 0, 1), {}, "origins[1][1]: must be a finite number, got nan"),
        ((0, 0), (0, 0, 1), {}, "origins: must have shape (n, 3) or (3,), got (2,)"),
        (np.zeros((2, 3)), np.ones((3, 3)), {}, "origins: must have shape (3, 3) or (3,), got (2, 3)"),
        ((0, 0, 0), (0, 0, 1), {"t_min": np.nan}, "t_min: must not be nan"),
        ((0, 0, 0), np.ones((2, 3)), {"t_max": [1, 2, 3]}, "directions: must have shape (3, 3) or (3,), got (2, 3)"),
        ((0, 0, 0), "up", {}, "directions: must be numbers, got 'up'"),
    ],
)
def test_what_is_refused(origins: object, directions: object, more: dict[str, object], text: str) -> None:
    scene = Scene.from_spheres(CAMERA, (), [(0, 0, 0)], 1)
    with pytest.raises(ValueError) as error:
        trace_rays(scene, origins, directions, **more)
    assert str(error.value) == text


def test_a_scene_is_needed() -> None:
    with pytest.raises(TypeError, match=r"^scene: must be a cltrace\.Scene, such as cltrace\.load\(\) gives, got 3$"):
        trace_rays(3, (0, 0, 0), (0, 0, 1))


def test_the_oracle_counts_triangles() -> None:
    """A square of two triangles: its diagonal is that of one of them, and its plane is met by no ray in it."""
    corners, faces = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2), (0, 2, 3)]
    rays = [(0, 0, -1), (0.5, 0.25, -1), (3, 0, -1), (0, 0, 1), (-1, -1, -1)]
    assert oracle.triangles_met((0, 0, 1), rays, corners, faces).tolist() == [1, 1, 0, 0, 1]
    assert oracle.triangles_met((-3, 0, 0), [(1, 0, 0)], corners, faces).tolist() == [0]
    twice = oracle.triangles_met((0, 0, 1), rays, corners, [*faces, *faces])
    assert twice.tolist() == [2, 2, 0, 0, 2]


def test_the_oracle_refuses_the_same() -> None:
    scene = Scene.from_spheres(CAMERA, (), [(0, 0, 0)], 1)
    for ask in (
        lambda: oracle.closest_hit(scene, (0, 0, 0), [(0, 0, 1), (0, 0, 0)]),
        lambda: oracle.triangles_met((0, 0, 0), [(0, 0, 1), (0, 0, 0)], [(0, 0, 0)], np.zeros((0, 3), int)),
    ):
        with pytest.raises(ValueError, match=r"^directions\[1\]: must not be 0$"):
            ask()
