"""The kernel's rays and triangles, one by one, against the exact oracle, in the hostile regimes; no excused band.

What a pixel shows is told by its id and primitive, which light reaches it by its colour, and what its ray meets that
goes on from there by the colour that names it. See tests/hostile/mesh_pictures.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hostile.mesh_pictures import (
    Seen,
    Verdict,
    each_named,
    in_light,
    judge,
    judge_light,
    judge_onward,
    passed,
    seen_through,
)
from hostile.mesh_regimes import CLOSED, REGIMES, scene_of
from hostile.mixed_pictures import REGIMES as MIXED
from hostile.mixed_pictures import judge as judge_mixed
from hostile.mixed_pictures import scene_of as mixed_scene
from hostile.sphere_regimes import rays as camera_rays
from solids import box

from cltrace import Camera, Image, Material, Mesh, Renderer, Scene, ambient_light, parallel_light, point_light
from cltrace.renderers.rays import trace_rays
from cltrace.run.devices import Device
from cltrace.students.check import check

pytestmark = pytest.mark.slow

NAMES = list(REGIMES)
SPARSE = ("grazing", "far and small", "slivers between rays")  # few pixels show anything
# Whose triangles cover each other in one plane: of these, a ray that goes on meets one only.
PARITY = [name for name in CLOSED if name != "pillars"]


def seen(image: Image) -> Seen:
    return Seen(image.id.ravel(), image.primitive.ravel())


def draw(scene: Scene, device: Device, outputs: tuple[str, ...], **how: object) -> Image:
    return Renderer(scene, device, "accurate", outputs, **how).render()  # type: ignore[arg-type]


def judged(make: Callable[[int], Verdict], count: int) -> int:
    """How many rays are right, `count` at least, in pictures of seeds 0, 1, ...; an error where one is not."""
    rays, seed = 0, 0
    while rays < count and seed < count:
        verdict = make(seed)
        assert len(verdict.wrong) == 0, (seed, verdict.wrong[:5], verdict.leaks, verdict.phantoms)
        rays += verdict.rays
        seed += 1
    return rays


def first_hits(name: str, device: Device, side: int, **how: object) -> Callable[[int], Verdict]:
    def make(seed: int) -> Verdict:
        scene = scene_of(name, seed, (side, side))
        return judge(scene, seen(draw(scene, device, ("id", "primitive", "normal"), **how)))

    return make


def lights(name: str, device: Device, side: int) -> Callable[[int], Verdict]:
    """Of one light a picture: at a point near the scene, or of a corner of it, or parallel, along an axis or not."""

    def make(seed: int) -> Verdict:
        rng, scene = np.random.default_rng(seed), scene_of(name, seed, (side, side))
        vertices = np.concatenate([mesh.vertices for mesh in scene.meshes])
        size = np.abs(vertices - np.array(scene.camera.position)).max()
        lamp = vertices[rng.integers(len(vertices))] + rng.choice([0, 1e-9, 0.1, 1]) * size * rng.normal(size=3)
        sun = rng.choice([rng.normal(size=3), np.array([0, -1, 0]), np.array([1, 0, -1]), np.array([0.0, 0, -1])])
        scene = in_light(scene, parallel_light(sun) if seed % 2 else point_light(lamp))
        image = draw(scene, device, ("id", "primitive", "color"))
        return judge_light(scene, seen(image), image.color)

    return make


def onward(name: str, device: Device, side: int) -> Callable[[int], Verdict]:
    """Half of the triangles are mirrors, and half glass."""

    def make(seed: int) -> Verdict:
        rng, scene = np.random.default_rng(seed), scene_of(name, seed, (side, side))
        glass = rng.random(sum(len(mesh.geometry.faces) for mesh in scene.meshes)) < 0.5
        scene = each_named(scene, glass, float(rng.choice([1.0, 1.5, 0.75])))
        image = draw(scene, device, ("id", "primitive", "color"))
        return judge_onward(scene, seen(image), image.color)

    return make


def among_each_other(name: str, device: Device, side: int, count: int) -> None:
    """Rays that leave triangles, and those that leave spheres and ellipsoids: `count` of each, and all are right."""
    rays, seed = np.zeros(2, int), 0
    while rays.min() < count:
        assert seed < 200
        scene = mixed_scene(name, seed, (side, side))
        image = draw(scene, device, ("id", "primitive", "color"))
        for i, verdict in enumerate(judge_mixed(scene, seen(image), image.color)):
            assert len(verdict.wrong) == 0, (seed, i, verdict.wrong[:5], verdict.leaks, verdict.phantoms)
            rays[i] += verdict.rays
        seed += 1


@pytest.mark.parametrize("name", NAMES)
def test_what_pixels_show(device: Device, name: str) -> None:
    assert judged(first_hits(name, device, 32), 1000) >= 1000


@pytest.mark.parametrize("name", ["eye in a plane", "grazing", "slivers between rays", "huge", "fans", "soup"])
def test_how_far_away_they_are(device: Device, name: str) -> None:
    """To 2^-23 of the distance, also of triangles whose planes the eye is all but in: before cameras along the axes."""
    for seed in range(4):
        scene = scene_of(name, seed, (32, 32))
        d = camera_rays(scene.camera) @ np.array(scene.camera.basis())
        hits = trace_rays(scene, scene.camera.position, d)
        depth = draw(scene, device, ("depth",)).depth.ravel()
        np.testing.assert_allclose(depth, hits.t * np.linalg.norm(d, axis=1), rtol=2.0**-23)


@pytest.mark.parametrize("name", ["corners on rays", "room", "crossings", "among spheres"])
def test_one_by_one(device: Device, name: str) -> None:
    """In packets of one pixel, as GPUs get them."""
    assert judged(first_hits(name, device, 32, width=1), 1000) >= 1000


@pytest.mark.parametrize("name", NAMES)
def test_which_lights_reach_them(device: Device, name: str) -> None:
    assert judged(lights(name, device, 16), 5 if name in SPARSE else 200) > 0


def test_light_on_what_is_2_to_the_minus_101_away(device: Device) -> None:
    """Two triangles have an edge in common; a point of one, 2^-64 of it beside that edge, is in the other's shadow:
    only whole numbers tell on which side of the other's plane it is."""
    verdict = lights("eye in a plane", device, 64)(33)
    assert verdict.rays > 1000
    assert (verdict.leaks, verdict.phantoms) == (0, 0)


def test_light_on_fans_all_but_in_planes(device: Device) -> None:
    """Of a fourth of the points, doubles do not tell on which side of a triangle's plane they are."""
    verdict = lights("fans all but in planes", device, 64)(4)
    assert verdict.rays > 3000
    assert (verdict.leaks, verdict.phantoms) == (0, 0)


def test_light_on_a_triangle_before_a_fan(device: Device) -> None:
    """All have one corner, and the fan is 2^-52 behind the triangle: less than what the ways from there are off by."""
    rng = np.random.default_rng(0)
    u, v = np.array([2, -1, 0]) / 5**0.5, np.array([1, 2, -3]) / 14**0.5
    n = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    corner, a, b = -u - 1.3 * v, *rng.uniform(1, 3, (2, 20, 1))
    ends = [a * (u + rng.uniform(0, 1, (20, 1)) * v), b * (v + rng.uniform(-0.3, 1, (20, 1)) * u)]
    fan = [corner + end - n * 2.0**-52 * rng.uniform(0.5, 2, (20, 1)) for end in ends]
    behind = np.stack([np.tile(corner, (20, 1)), *fan], axis=1).reshape(-1, 3)
    meshes = [
        Mesh([corner, 1.1 * u - 0.9 * v, 0.2 * u + 1.7 * v], [(0, 1, 2)]),
        Mesh(behind, np.arange(60).reshape(-1, 3)),
    ]
    camera = Camera(tuple(3 * n + 0.3 * u), (0, 0, 0), tuple(v), 40, (48, 48))
    scene = in_light(Scene.from_meshes(camera, [], meshes), point_light(tuple(5 * n + v)))
    image = draw(scene, device, ("id", "primitive", "color"))
    verdict = judge_light(scene, seen(image), image.color)
    assert (image.id == 0).sum() > 200
    assert (verdict.leaks, verdict.phantoms) == (0, 0)


@pytest.mark.parametrize("lamp", [1, -1])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("off", "wide", "low"), [(2.0**-45, 4, 0), (2.0**-105, 2.0**-35, -5)], ids=["pairs", "whole"])
def test_light_on_what_is_beside_a_wall(
    device: Device, off: float, wide: float, low: float, side: int, lamp: int
) -> None:
    """The points of one column are `off` beside the wall's plane, or 2^-99, since none is an edge's: too near to it for
    doubles, or for pairs of them. A lamp is on the same side of the wall, or on the other one."""
    floor = Mesh([(0, 0, 0), (0, 0, 4), (-side * wide, 0, 2)], [(0, 1, 2)])
    wall = Mesh([(0, low, -5), (0, low, 5), (0, 20, 0)], [(0, 1, 2)])
    camera = Camera((-side * off, 8, 2), (-side * off, 0, 2), (0, 0, -1), 20, (33, 33))
    scene = in_light(Scene.from_meshes(camera, [], [floor, wall]), point_light((lamp, 4, 2.3)))
    image = draw(scene, device, ("id", "primitive", "color"))
    verdict = judge_light(scene, seen(image), image.color)
    on_floor = image.id[:, 16] == 0
    assert on_floor.sum() > 20
    assert (image.color[:, 16][on_floor].any(axis=1) == (side != lamp)).all()
    assert (verdict.leaks, verdict.phantoms) == (0, 0)


@pytest.mark.parametrize("look", [(1, 0, -1), (1, 1, 0), (1, 1, 1), (0, 1, -1)])
def test_mirrors_lose_nothing_at_the_edges_of_a_room(device: Device, look: tuple[int, ...]) -> None:
    """Pixels in the middle see an edge, all along or at one point: their rays would leave the black room for a white
    background from a point of the edge itself, which is in the planes of both walls."""
    room = box()
    walls = Mesh(room.vertices, room.faces, material=Material((0, 0, 0), ka=0, kd=0, ks=0, reflectance=0.9))
    camera = Camera((0, 0, 0), look, (0, 1, 0) if look[1] == 0 else (0, 1, 0.1), 60, (33, 33), max_bounces=4)
    scene = Scene.from_meshes(camera, [ambient_light()], walls, background=(1, 1, 1))
    assert not draw(scene, device, ("color",)).color.any()


@pytest.mark.parametrize("name", NAMES)
def test_what_their_mirrors_and_glass_show(device: Device, name: str) -> None:
    assert judged(onward(name, device, 16), 5 if name in SPARSE else 100) > 0


@pytest.mark.parametrize("name", list(MIXED))
def test_what_mirrors_and_glass_show_of_spheres_and_meshes(device: Device, name: str) -> None:
    among_each_other(name, device, 16, 100)


@pytest.mark.parametrize("name", PARITY)
def test_what_goes_into_a_closed_mesh_comes_out_again(device: Device, name: str) -> None:
    count = passed(draw(seen_through(scene_of(name, 0, (64, 64))), device, ("color",)).color)
    assert count.max() >= 2
    assert (count % 2 == 0).all(), np.flatnonzero(count % 2)


def in_full(name: str, seed: int, side: int) -> Scene:
    """The surfaces of a regime, shaded: mirrors and glass, smooth, textured, in three lights."""
    rng, plain = np.random.default_rng(seed), scene_of(name, seed, (side, side))
    place = np.concatenate([mesh.vertices for mesh in plain.meshes])
    size = np.abs(place - np.array(plain.camera.position)).max()
    meshes = []
    for mesh in plain.meshes:
        shape, corners = mesh.geometry, len(mesh.vertices)
        texture = rng.integers(0, 256, (3, 5, 3)).astype(np.uint8) if rng.random() < 0.5 else None
        passes = rng.choice([0, 0, 0.4], 2)
        material = Material(rng.random(3), reflectance=passes[0], transmittance=passes[1], index=1.5, texture=texture)
        normals = rng.normal(size=(corners, 3)) if rng.random() < 0.5 else None
        meshes.append(Mesh(shape.vertices, shape.faces, normals, rng.normal(size=(corners, 2)), material))
    lights = [point_light(place[0] + 0.3 * size * rng.normal(size=3), (0.5, 0.4, 0.3)) for _ in range(2)]
    spheres, maps = (
        plain.spheres,
        [np.eye(3) if i < 0 else np.linalg.inv(plain.to_object[i]) for i in plain.spheres["to_object"]],
    )
    return Scene.from_spheres(
        replace(plain.camera, max_bounces=3),
        [*lights, parallel_light((1, -2, -3), (0.4, 0.4, 0.4)), ambient_light((0.2, 0.2, 0.2))],
        spheres["center"],
        spheres["radius"],
        rng.random((len(spheres), 3)),
        reflectance=0.3,
        transmittance=0.3,
        index=1.5,
        transform=np.array(maps) if maps else None,
        meshes=meshes,
        background=(0.1, 0.2, 0.3),
    )


@pytest.mark.parametrize("name", ["among spheres", "room", "corners on rays", "soup", "pillars", "terrain"])
def test_whole_pictures_are_the_reference_s(device: Device, name: str) -> None:
    scene = in_full(name, 0, 16)
    report = check(scene, draw(scene, device, ("rgb8", "id")), "accurate", 256)
    assert (report.wrong_ids, report.off_by_more) == (0, 0), report
    assert report.differing <= 1, report


@pytest.mark.stress
@pytest.mark.parametrize("name", NAMES)
def test_a_million_pixels(device: Device, name: str) -> None:
    assert judged(first_hits(name, device, 128), 1_000_000) >= 1_000_000


@pytest.mark.stress
@pytest.mark.parametrize("name", NAMES)
def test_a_hundred_thousand_lights(device: Device, name: str) -> None:
    assert judged(lights(name, device, 64), 1000 if name in SPARSE else 100_000) > 0


@pytest.mark.stress
@pytest.mark.parametrize("name", NAMES)
def test_a_hundred_thousand_mirrors(device: Device, name: str) -> None:
    assert judged(onward(name, device, 64), 1000 if name in SPARSE else 100_000) > 0


@pytest.mark.stress
@pytest.mark.parametrize("name", list(MIXED))
def test_ten_thousand_rays_between_spheres_and_meshes(device: Device, name: str) -> None:
    among_each_other(name, device, 64, 10_000)


@pytest.mark.stress
@pytest.mark.parametrize("name", PARITY)
def test_ten_million_rays_through_closed_meshes(device: Device, name: str) -> None:
    """As many as for all of them."""
    rays, seed = 0, 0
    while rays < 10_000_000 // len(PARITY):
        count = passed(draw(seen_through(scene_of(name, seed, (512, 512))), device, ("color",)).color)
        assert (count % 2 == 0).all(), (seed, np.flatnonzero(count % 2)[:5])
        rays, seed = rays + len(count), seed + 1
