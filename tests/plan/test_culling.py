"""What is left out because it cannot matter is left out, and no picture tells."""

from __future__ import annotations

import numpy as np
import pytest
from hostile.sphere_regimes import rays as camera_rays
from random_scenes import crowded, fuzzed_scene, random_scene
from stress_cases import OUTPUTS, assert_same, picture, renderer

import cltrace
from cltrace import Camera, Material, Mesh, Scene
from cltrace.picture.image import Output
from cltrace.plan import lists, order, plan
from cltrace.plan.abi import COUNTERS
from cltrace.plan.accel import grids
from cltrace.plan.accel.silhouettes import Discs
from cltrace.plan.shapes import mesh, sphere
from cltrace.run import executor
from cltrace.run.devices import Device, choose

TRACED, UNSTOPPABLE = COUNTERS["SHADOW_RAYS"], COUNTERS["UNSTOPPABLE"]
CAMERA = Camera((0, 2, 12), (0, 0, 0), horizontal_fov=25, resolution=(64, 48), square_pixels=False)
LAMP = cltrace.point_light((3, 9, 6))
SUN = cltrace.parallel_light((-0.3, -1, -0.2))


def compare(scene: Scene, device: Device | None, names: tuple[str, ...], precision: str) -> None:
    """The picture has the same bits with and without each of these skips."""
    want = picture(scene, device, precision)
    for name in names:
        image = picture(scene, device, precision, keep=(name,))
        assert_same(image, want, ("rgb8", "color", "normal", "depth", "id"), (name, precision))


@pytest.mark.parametrize("many", [2, 3000], ids=["few", "many"])
def test_of_equal_spheres_only_the_first_is_looked_at(device: Device, many: int) -> None:
    """Of equal spheres the first one's id shows. A sphere that is an ulp smaller is not equal."""
    centers = np.array([*[(-2, 0, 0)] * many, *[(2, 0, 0)] * many, (2, 0, 0)])
    radii = np.array([*[1.0] * (2 * many), np.nextafter(1.0, 0)])
    colors = np.eye(3)[np.arange(len(centers)) % 3]
    order = np.random.default_rng(4).permutation(len(centers))
    scene = Scene.from_spheres(CAMERA, [LAMP, SUN], centers[order], radii[order], colors[order])
    for precision in ("accurate", "single", "double"):
        drawn = renderer(scene, device, precision)
        # Sorted by place, the sphere that is an ulp smaller may come between two equal ones, which are then both kept.
        assert 2 * (many - 1) - drawn.skipped["spheres equal to others"] in (0, 1)
        ids = drawn.render().id
        first = [
            int(np.flatnonzero((centers[order] == c).all(axis=1) & (radii[order] == 1))[0]) for c in centers[[0, -1]]
        ]
        assert set(np.unique(ids).tolist()) == {-1, *first}
        if many < 100:
            compare(scene, device, ("hidden",), precision)


@pytest.mark.parametrize("light", [LAMP, SUN], ids=["point", "parallel"])
def test_shadow_rays_that_nothing_can_stop(device: Device, light: np.ndarray) -> None:
    """A row of balls across the light stands in nobody's way; one that hangs over the first one does."""
    row = [(x, 0.0, 0.0) for x in (-4.5, -1.5, 1.5, 4.5)]
    free = Scene.from_spheres(CAMERA, [light], row, 0.4)
    work = renderer(free, device).work()
    assert work[TRACED] == 0
    assert work[UNSTOPPABLE] > 0
    towards = np.array([3, 9, 6]) - row[0] if light is LAMP else np.array([0.3, 1, 0.2])
    over = tuple(np.array(row[0]) + 2 * towards / np.linalg.norm(towards))
    shaded = Scene.from_spheres(CAMERA, [light], [*row, over], [0.4] * 4 + [0.3])
    work = renderer(shaded, device).work()
    assert 0 < work[TRACED] < work[UNSTOPPABLE]
    for scene in (free, shaded):
        compare(scene, device, ("unstopped", "receivers"), "accurate")


@pytest.mark.parametrize("parallel", [False, True], ids=["point", "parallel"])
def test_which_spheres_may_shadow_others(parallel: bool) -> None:
    """A sphere whose shadow reaches another one's edge by 1 % of its radius may, and one that misses it by 1 % not."""
    rng = np.random.default_rng(6)
    for share, may in ((0.99, True), (1.01, False)):
        for _ in range(20):
            (r, other), turn = rng.uniform(0.1, 0.4, 2), np.linalg.qr(rng.normal(size=(3, 3)))[0]
            if parallel:  # the light is along the third axis of turn
                centers = [(0, 0, -1), (r + share * other, 0, 1)]
            else:  # the light is at 0, and sees both discs in a plane through it
                far, near = rng.uniform(2, 3), rng.uniform(1, 1.5)
                angle = np.arcsin(r / far) + share * np.arcsin(other / near)
                centers = [(0, 0, far), (near * np.sin(angle), 0, near * np.cos(angle))]
            center, radius = np.array(centers) @ turn, np.array([r, other])
            discs = Discs(center, radius, (center**2).sum(axis=1) - radius**2)
            slack = 2.0**-20
            found = lists.parallel_shadows(turn, discs, slack) if parallel else lists.point_shadows(discs, slack)
            assert found[0, 1] == may
            assert not found[1, 0]  # it is further from the light


@pytest.mark.parametrize("light", [LAMP, SUN], ids=["point", "parallel"])
def test_spheres_that_shadow_nothing_seen_are_in_no_list_of_a_light(device: Device, light: np.ndarray) -> None:
    """A cloud behind the camera, away from what it sees and from the way of the light to it."""
    rng = np.random.default_rng(2)
    seen = rng.uniform(-2, 2, (30, 3))
    away = rng.uniform(-2, 2, (50, 3)) + (0, -10, 60)
    scene = Scene.from_spheres(CAMERA, [light], np.concatenate([seen, away]), 0.3)
    assert renderer(scene, device).skipped["spheres that shadow nothing seen, per light"] >= 50
    compare(scene, device, ("receivers",), "accurate")


def test_highlights_too_faint_for_a_byte(device: Device) -> None:
    scene = Scene.from_spheres(CAMERA, [LAMP], [(0, 0, 0)], 2.0, ks=1, exponent=500)
    work = renderer(scene, device).work()
    assert work["highlights too faint for a pixel"] > work["highlights computed"] > 0
    accurate, double = (picture(scene, device, p) for p in ("accurate", "double"))
    assert np.abs(accurate.color - double.color).max() <= 1e-6
    brighter = Scene.from_spheres(CAMERA, [cltrace.point_light((3, 9, 6), (1e6, 1e6, 1e6))], [(0, 0, 0)], 2.0, ks=1)
    assert renderer(brighter, device).work()["highlights computed"] > work["highlights computed"]


@pytest.mark.slow
def test_what_very_many_spheres_get_is_the_same_picture(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few spheres are treated as a million: fetched ahead, sorted by place, on coarser levels."""
    camera = Camera((0, 2, 12), (0, 0, 0), horizontal_fov=25, resolution=(64, 64))
    scenes = [crowded((random_scene if seed % 2 else fuzzed_scene)(seed), seed) for seed in range(6)]
    for n, sizes in ((120, (0, 1, 6)), (480, range(7))):
        radii = np.random.default_rng(6).choice(2.0 ** -np.array(sizes), n)
        centers = np.random.default_rng(7).uniform(-3, 3, (n, 3))
        scenes.append(Scene.from_spheres(camera, [LAMP, SUN], centers, radii))
    for number, scene in enumerate(scenes):
        for precision in ("accurate", "single"):
            want = picture(scene, device, precision)
            with monkeypatch.context() as patch:
                patch.setattr(plan, "PLENTY", 1)
                patch.setattr(plan, "VIEWS", 1)
                for module in (mesh, sphere):
                    patch.setattr(module, "MANY", 1)
                patch.setattr(grids, "SPARE", -3 * len(scene.spheres))
                drawn = renderer(scene, device, precision)
                assert "WITH_PREFETCH" in drawn.plan.features
                assert (drawn.plan.arrays["grid"]["cells"][:, 3] > 1).any()
                image = drawn.render()
            assert_same(image, want, OUTPUTS, (number, precision))


@pytest.mark.slow
def test_shadows_of_spheres_much_smaller_than_their_distance(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Many spheres have a filter of their own for radii that float32 loses beside the light's distance."""
    rng = np.random.default_rng(9)
    ground, n = np.array([(0.0, -100.0, 0.0)]), 400
    centers = np.concatenate([ground, rng.uniform((-0.05, 0.001, -0.05), (0.05, 0.02, 0.05), (n, 3))])
    radii = np.append(100.0, 10 ** rng.uniform(-4, -2.5, n))
    camera = Camera((0, 0.3, 0.1), (0, 0, 0), horizontal_fov=10, resolution=(96, 80))
    for light in ((30, 40, 3), (-2, 9, 500)):
        scene = Scene.from_spheres(camera, [cltrace.point_light(light)], centers, radii)
        want = picture(scene, device, "accurate")
        assert 100 < ((want.id == 0) & (want.color.max(axis=-1) == 0)).sum() < 4000  # shadows on the ground
        with monkeypatch.context() as patch:
            patch.setattr(plan, "PLENTY", 1)
            fetched = renderer(scene, device, "accurate", width=1)  # where each ray decides for itself
            assert "WITH_PREFETCH" in fetched.plan.features
            image = fetched.render()
            work, kept = fetched.work(), renderer(scene, device, "accurate", keep=("filter",)).work()
        what = "spheres that are decided in full for a ray"
        assert work[what] < kept[what] / 2
        assert_same(image, want, OUTPUTS, light)


@pytest.mark.slow
def test_blocks_of_packets_are_the_same_picture(device: Device, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole pictures and parts of them, of heights with and without a last block that is cut off, in several strips."""
    rng = np.random.default_rng(8)
    camera = Camera((0, 0, 12), (0, 0, 0), horizontal_fov=20, resolution=(71, 150))
    scene = Scene.from_spheres(camera, [LAMP, SUN], rng.uniform(-3, 3, (80, 3)), 0.3, rng.uniform(0, 1, (80, 3)))
    for crop in (None, (0, 0, 70, 144), (3, 5, 50, 22), (9, 131, 71, 150)):
        want = cltrace.Renderer(scene, device, outputs=("rgb8", "id"), crop=crop, width=width).render()
        with monkeypatch.context() as patch:
            patch.setattr(plan, "VIEWS", 1)
            patch.setattr(executor, "FIRST_ROWS", 16)
            drawn = cltrace.Renderer(scene, device, outputs=("rgb8", "id"), crop=crop, width=width)
            assert drawn.plan.blocks
            image = drawn.render()
        assert_same(image, want, ("rgb8", "id"), crop)


def test_the_eye_inside_by_less_than_a_rounding(device: Device) -> None:
    """The eye is 1e12 inside of a sphere of 3.4e38 and looks outwards. By the rounded centre, it is on the sphere."""
    camera = Camera((1e12, 0, 0), (0, 0, 0), horizontal_fov=60, resolution=(9, 7), square_pixels=False)
    scene = Scene.from_spheres(camera, [], [(3.4e38, 0, 0)], [3.4e38])
    for precision in ("accurate", "double"):
        ids = picture(scene, device, precision).id
        assert (ids == 0).all()


# These change the plan's arrays only, so no program has to be compiled for them. What mirrors and glass need is in
# tests/kernels/test_invariance.py.
PACKED = ("lists", "lights", "hidden", "receivers", "unstopped", "order")


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [range(100), pytest.param(range(100, 2_100), marks=pytest.mark.stress)])
def test_no_scene_tells_what_was_left_out(seeds: range) -> None:
    for seed in seeds:
        scene = (random_scene if seed % 2 else fuzzed_scene)(seed)
        compare(scene, choose(), PACKED, "accurate")
        # In single, a black light may be so far away that nothing else is left of float32's range beside it.
        compare(scene, choose(), tuple(name for name in PACKED if name != "lights"), "single")
        # In single, a shadow ray may meet a sphere of less than a thousandth of its distance where it is not, and where
        # no list holds it.
        compare(crowded(scene, seed), choose(), PACKED, "accurate")


QUAD = np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])

SHOWN: tuple[Output, ...] = ("rgb8", "id", "primitive")


def of_meshes(meshes: list[Mesh], bounces: int = 0) -> Scene:
    camera = Camera((0, 2, 5), (0, 0, 0), horizontal_fov=25, resolution=(48, 32), max_bounces=bounces)
    return Scene.from_meshes(camera, [LAMP, SUN], meshes)


@pytest.mark.parametrize("many", [1, 20_000], ids=["few", "many"])
def test_of_equal_triangles_only_the_first_is_packed(many: int) -> None:
    """Whatever corner they begin with, and however they are wound; an ulp makes another triangle, and -0 none."""
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(many, 3, 3))
    corners[0, 0, 0] = 0.0
    orders = np.array([(0, 1, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0), (1, 0, 2), (0, 2, 1)])
    again = np.concatenate([corners[:, order] for order in orders])
    again[many][again[many] == 0] = -0.0
    other = corners.copy()
    other[:, 1, 2] = np.nextafter(other[:, 1, 2], 9)
    every = np.concatenate([again, other])
    found = order.repeated_faces(every.reshape(-1, 3), np.arange(3 * len(every), dtype=np.int32).reshape(-1, 3))
    assert np.array_equal(found, np.arange(many, 6 * many))
    assert not len(order.repeated_faces(other.reshape(-1, 3), np.arange(3 * many, dtype=np.int32).reshape(-1, 3)))


@pytest.mark.slow
def test_of_equal_triangles_the_first_shows_whatever_the_others_are(device: Device) -> None:
    """A mirror, glass and plain faces in one place: the id, the colours and the normals are those of the first."""
    kinds = [Material("red"), Material("lime", reflectance=0.8), Material("blue", transmittance=0.7, index=1.5)]
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    normals = np.array([(0.3, 0, 1.0), (-0.3, 0, 1), (-0.3, 0, 1), (0.3, 0, 1)])
    # Behind the floor are all kinds in every scene, so that one program draws all of them.
    floor = [Mesh(QUAD[:, [0, 2, 1]] * 3 - (0, 1.2, 0), faces)]
    rest = floor + [Mesh(QUAD[:, [0, 2, 1]] * 0.1 - (0, 2 + k, 0), faces, material=kinds[k]) for k in range(3)]
    for k in range(2):
        some = [kinds[(k + i) % 3] for i in range(3)]
        copies = [Mesh(QUAD, faces, normals, material=some[0]), Mesh(QUAD, faces[:, ::-1], material=some[1])]
        scene = of_meshes([*copies, Mesh(QUAD, np.roll(faces, 1, axis=1), -normals, material=some[2]), *rest], 4)
        drawn = renderer(scene, device, "accurate")
        assert drawn.skipped["triangles equal to others"] == 4
        compare(scene, device, ("hidden",), "accurate")
        alone = picture(of_meshes([copies[0], *rest], 4), device, "accurate")
        image = drawn.render()
        assert_same(image, alone, ("rgb8", "normal"), k)
        assert set(np.unique(image.id).tolist()) <= {-1, 0, 3}


# The corners of a polygon and how often it is there: equal triangles, and fans whose triangles cover each other.
@pytest.mark.parametrize(("corners", "copies"), [(4, 115), (900, 1)], ids=["a quad 115 times", "a fan of 900"])
def test_what_covers_itself_in_one_plane_needs_few_decisions(device: Device, corners: int, copies: int) -> None:
    rng = np.random.default_rng(5)
    points = QUAD if corners == 4 else np.round(rng.uniform(-1, 1, (corners, 2)) @ [(1, 0, 0), (0, 1, 0)], 6)
    fan = np.array([(0, i, i + 1) for i in range(1, corners - 1)] * copies)
    drawn = cltrace.Renderer(of_meshes([Mesh(points, fan)], 2), device, "accurate", SHOWN)
    image = drawn.render()
    # The second frame knows the planes that the first one found.
    assert_same(drawn.render(), image, SHOWN, "again")
    hit = image.id >= 0
    assert (image.primitive[hit] < len(fan) // copies).all()
    if copies > 1:
        assert drawn.skipped["triangles equal to others"] == len(fan) - 2
    # Of all that are met in one plane the lowest number shows: what a brute search in exact numbers says, too.
    camera = drawn.scene.camera
    hits = cltrace.trace_rays(drawn.scene, camera.position, camera_rays(camera) @ np.array(camera.basis()))
    assert np.array_equal(hits.primitive, image.primitive.ravel())
