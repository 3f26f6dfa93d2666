"""Meshes, where tracers leak, hit twice or shadow themselves: answers known by hand, and what changes no bit."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from glowing import BLACK, BLUE, GREEN, NIGHT, RED, WHITE, total
from hostile.sphere_scenes import directions, looking
from solids import (
    NARROW,
    SIZE,
    WIDE,
    Solid,
    ball,
    box,
    glow,
    glowing,
    joined,
    lattice,
    mesh,
    needles,
    octahedron,
    places,
    sheet,
    smooth,
    tetrahedron,
)
from stress_cases import assert_same, channel, picture, wrong_pixels

import cltrace
from cltrace import Camera, Image, Material, Mesh, Scene, ambient_light, parallel_light, point_light
from cltrace.run.devices import Device

pytestmark = pytest.mark.slow

SAME = ("rgb8", "color", "depth", "id", "primitive", "normal", "shadow_rays")
MATTE = Material(ka=0, kd=1, ks=0)
CONVEX = [box(), octahedron().moved(factor=2), tetrahedron().moved(factor=3), ball(1).moved(factor=2)]


# ------------------------------------------------------------------------------------------------------ what is seen


def fuzzed(seed: int, spread: int = 240) -> Scene:
    """Triangles of random bits, with normals, texture coordinates and lights of the same numbers.

    The numbers are few, so that much has no area, is in one plane, or is where the eye or a light is. Of every other
    scene they are small whole numbers times a power of two; else their sizes differ by up to 2^spread.
    """
    rng = np.random.default_rng((seed, 13))
    bits = rng.integers(1, 2**24, 8) * 2.0**-24
    pool = np.ldexp(bits * rng.choice([1, -1], 8), rng.integers(-spread // 2, spread // 2 + 1, 8))
    pool = np.where(rng.random(8) < 0.3, rng.choice([0.0, 1, -1, 2.0**-149, 3.4e38, -3.4e38], 8), pool)
    if seed % 2:
        pool = np.ldexp(np.round(rng.uniform(-8, 8, 8)), int(rng.integers(-100, 100)))
    vertices, faces = rng.choice(pool, (9, 3)), rng.integers(0, 9, (12, 3))
    normals, uv = rng.choice(pool, (12, 3, 3)), rng.choice(pool, (12, 3, 2))
    texture = rng.integers(0, 256, (3, 5, 3), np.uint8)
    eye = np.clip(rng.choice(pool, 3), -1e38, 1e38)
    at = np.clip(eye + rng.normal(size=3) * max(1e-30, float(np.abs(eye).max())), -3e38, 3e38)
    made = Mesh(vertices, faces, normals, uv, Material(texture=texture, ks=1, exponent=rng.choice([0, 50, 1e6])))
    lights = [point_light(rng.choice(pool, 3)), parallel_light(rng.normal(size=3)), ambient_light((0.1, 0.1, 0.1))]
    return Scene.from_meshes(Camera(tuple(eye), tuple(at), horizontal_fov=60, resolution=(9, 7)), lights, made)


def look_for_nan(seeds: Iterable[int]) -> None:
    """Every pixel is a number, of whatever sizes a triangle's corners are."""
    for seed, precision in itertools.product(seeds, ("accurate", "single")):
        image = picture(fuzzed(seed), None, precision)
        assert (image.color >= 0).all(), (seed, precision)
        assert not np.isnan(image.normal).any(), (seed, precision)
        assert np.isfinite(image.uv).all(), (seed, precision)
        assert np.array_equal(np.isfinite(image.depth), image.id >= 0), (seed, precision)
        assert np.array_equal(image.primitive >= 0, image.id >= 0), (seed, precision)


def test_no_nan() -> None:
    look_for_nan([*range(40), 888])


@pytest.mark.stress
def test_no_nan_in_ten_thousand_meshes() -> None:
    look_for_nan(range(40, 10_000))


def test_every_pixel_of_a_room_is_a_wall(device: Device) -> None:
    for precision, size, solid in itertools.product(("accurate", "double", "single"), ((24, 24), (31, 31)), CONVEX):
        image = picture(Scene.from_meshes(looking((0, 0, 0), WIDE, size), [], mesh(solid)), device, precision)
        assert (image.id == 0).all(), (precision, size)
        assert np.isfinite(image.depth).all()


def test_faces_without_area_are_not_there(device: Device) -> None:
    """A mesh of nothing else is nothing; among others they keep their numbers."""
    points = np.array([(0, 0, 0), (1, 1, 1), (2, 2, 2), (1, 0, 0), (0, 1, 0)], float)
    flat, some = ([(0, 1, 2), (0, 0, 0), (0, 3, 3), (2, 0, 1)], [(0, 1, 2), (0, 3, 3), (0, 3, 4), (0, 0, 0)])
    camera = looking((0.25, 0.25, 4), NARROW, SIZE)
    image = picture(Scene.from_meshes(camera, [], [Mesh(points, flat), Mesh(points, some)]), device)
    assert set(np.unique(image.id)) == {-1, 1}
    assert set(np.unique(image.primitive)) == {-1, 2}


def test_many_triangles_one_behind_the_other(device: Device) -> None:
    """100,000 that cover the picture: the nearest one is not the first one of the file. Some are equally near."""
    n = 100_000
    order = np.random.default_rng(0).permutation(n)
    depth = 1 + order // 2 * 2.0**-10
    one = np.array([(-4, -4, -1), (4, -4, -1), (0, 8, -1)], float)
    stack = Solid((one * depth[:, None, None]).reshape(-1, 3), np.arange(3 * n).reshape(-1, 3))
    camera = looking((0, 0, 0), NARROW, SIZE)
    image = picture(Scene.from_meshes(camera, [], mesh(stack)), device)
    assert (image.primitive == int(np.flatnonzero(order // 2 == 0)[0])).all()
    assert np.abs(channel(image, "depth") / np.linalg.norm(directions(camera), axis=1) - 1).max() <= 1e-8


# ------------------------------------------------------------------------------------------- what a picture is free of


def worlds() -> list[Scene]:
    """Meshes in every kind of light, some of them mirrors or of glass, with vertices in rays and faces in one plane."""
    camera = replace(looking((0.25, 0.5, 4), NARROW * 2, (40, 30)), max_bounces=4)
    lights = [
        ambient_light((0.1, 0.1, 0.2)),
        parallel_light((-1, -3, -2), (0.5, 0.5, 0.3)),
        point_light((3, 4, 5), (0.5, 0.4, 0.3)),
        cltrace.spot_light((-3, 5, 2), (2, -4, -2), 10, 40, (0.2, 0.6, 0.6)),
    ]
    floor = sheet(np.arange(-4.0, 5), np.arange(-4.0, 5), np.zeros((9, 9)))
    floor = Solid(floor.vertices[:, [0, 2, 1]] + (0, -1, 0), floor.faces)
    kinds = [
        Material(color=(0.9, 0.5, 0.2)),
        Material(color=(0.2, 0.5, 0.9), reflectance=0.5),
        Material(color=(0.3, 0.9, 0.3), transmittance=0.75, index=1.5),
    ]
    scenes = []
    for one, two in ((0, 0), (1, 0), (1, 2)):
        solids = [floor, box((-1, -1, -1), (0, 0, 0)), ball(1).moved((0.75, -0.25, 0), 0.75), lattice(2, 1, 30)]
        materials = [kinds[one], kinds[0], kinds[two], kinds[0]]
        meshes = [mesh(solid, material=m) for solid, m in zip(solids, materials, strict=True)]
        scenes.append(Scene.from_meshes(camera, lights, meshes, background=(0.2, 0.3, 0.4)))
    return scenes


def changed(scene: Scene, change: Callable[[Solid], Solid]) -> Scene:
    """The same scene with something done to each of its meshes, which have no transforms."""
    meshes = []
    for old in scene.meshes:
        solid, of = change(Solid(old.geometry.vertices, old.geometry.faces)), scene.materials[old.material]
        values = {n: float(of[n]) for n in ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index")}
        meshes.append(mesh(solid, material=Material(color=tuple(of["color"].tolist()), **values)))  # type: ignore[arg-type]
    return Scene.from_meshes(scene.camera, scene.lights, meshes, background=scene.background)


STRAYS = np.array([(1e30, 0, 0), (0, 0, 4), (3, 3, 3)])


@pytest.mark.parametrize(
    "change",
    [lambda s: s.unshared(), lambda s: Solid(np.concatenate([STRAYS, s.vertices]), s.faces + 3)],
    ids=["vertices of their own", "vertices that no face has"],
)
def test_how_vertices_are_shared_changes_no_bit(device: Device, change: Callable[[Solid], Solid]) -> None:
    for number, scene in enumerate(worlds()):
        assert_same(picture(scene, device), picture(changed(scene, change), device), SAME, number)


@pytest.mark.parametrize("odd", [False, True])
def test_winding_does_not_matter_to_what_is_opaque(device: Device, odd: bool) -> None:
    """Faces have two sides: wound the other way, or each in its own way, nothing looks different.

    No ray is on an edge, where the last digit of a point says which side of another face a mirrored ray starts on.
    """

    def flipped(s: Solid) -> Solid:
        return Solid(s.vertices, np.where(np.arange(len(s.faces))[:, None] % 3 * odd, s.faces, s.faces[:, ::-1]))

    scene = worlds()[1]
    scene = scene.seen_by(replace(scene.camera, position=(0.2371, 0.5113, 4.037)))
    one, two = picture(scene, device), picture(changed(scene, flipped), device)
    assert_same(one, two, ("id", "primitive", "shadow_rays"), "winding")
    assert np.abs(one.color - two.color).max() <= 1e-6
    assert np.isclose(one.depth, two.depth, rtol=1e-12, atol=0).all()


def test_one_mesh_or_many(device: Device) -> None:
    """A solid as one mesh of 32 faces, or as 32 meshes of one face, in another order."""
    camera, solid, lights = looking((0.25, 0.5, 4), NARROW, SIZE), ball(1), [point_light((3, 4, 5))]
    order = np.random.default_rng(3).permutation(len(solid.faces))
    one = picture(Scene.from_meshes(camera, lights, [mesh(solid)]), device)
    parts = [mesh(Solid(solid.vertices, solid.faces[k : k + 1])) for k in order]
    many = picture(Scene.from_meshes(camera, lights, parts), device)
    assert np.array_equal(one.primitive, np.where(many.id < 0, -1, order[many.id]))
    assert np.array_equal(many.primitive, np.where(many.id < 0, -1, 0))
    assert_same(one, many, ("rgb8", "color", "depth", "normal", "shadow_rays"), "parts")


def test_transforms_do_what_moved_vertices_do(device: Device) -> None:
    """By powers of two, whole numbers, and mirrored; the front of a mirrored mesh stays outside."""
    camera, solid = replace(looking((0.25, 0.5, 4), 2 * NARROW, SIZE), max_bounces=3), box().moved((0.25, 0, 0), 0.5)
    wall = mesh(box((-3, -3, -3), (3, 3, -2)), material=glow((0.5, 0.25, 1)))
    lights, glass = (
        [ambient_light(WHITE), point_light((3, 4, 5))],
        Material((0.5, 0.5, 1), transmittance=0.75, index=1.5),
    )

    def seen(one: Mesh) -> Image:
        return picture(Scene.from_meshes(camera, lights, [one, wall]), device)

    for rows, flips in (
        ([[1, 0, 0, 0.5], [0, 1, 0, 0.25], [0, 0, 1, -1]], False),
        ([[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], True),
        ([[0, 2, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]], True),
        ([[0, -1, 0, 0], [0, 0, 1, 0.5], [-1, 0, 0, 0]], False),
    ):
        M = np.array(rows, float)
        image = seen(mesh(solid, transform=M, material=glass))
        moved = Solid(solid.vertices @ M[:, :3].T + M[:, 3], solid.faces)
        want = seen(mesh(moved.flipped() if flips else moved, material=glass))
        assert_same(image, want, ("id", "primitive"), rows)
        assert np.abs(image.color - want.color).max() <= 1e-6
        assert_same(image, seen(mesh(solid, transform=np.vstack([M, [0, 0, 0, 1]]), material=glass)), SAME, rows)


def test_scaling_by_powers_of_two_changes_no_colour(device: Device) -> None:
    base = worlds()[2]
    usual = picture(base, device)
    for k in (-40, 60):
        scene = changed(base, lambda s, k=k: s.moved(factor=2.0**k))
        lights, camera = scene.lights.copy(), scene.camera
        lights["position"] = np.ldexp(lights["position"], k)
        moved = replace(camera, position=tuple(np.ldexp(camera.position, k)), lookat=tuple(np.ldexp(camera.lookat, k)))
        image = picture(replace(scene, camera=moved, lights=lights), device)
        assert_same(usual, image, ("rgb8", "color", "id", "primitive", "shadow_rays"), k)


# ------------------------------------------------------------------------------------------------------------- shadows

CLOSED = [*CONVEX, ball(2), box().unshared(), joined(box(), ball(2).moved(factor=2))]


def test_no_light_leaves_a_closed_mesh(device: Device) -> None:
    """A lamp inside lights nothing outside; what is around is a room."""
    camera, room = looking((0.5, 3, 9), WIDE, (48, 36)), mesh(box((-8, -8, -8), (8, 8, 16)), material=MATTE)
    for solid, light in itertools.product(CLOSED, ((0, 0, 0), (0.125, 0.25, -0.0625), (1 / 3, 0.1, 0.2), (0, 0.25, 0))):
        image = picture(Scene.from_meshes(camera, [point_light(light)], [mesh(solid, material=MATTE), room]), device)
        assert (image.id >= 0).all()
        assert (image.color == 0).all(), light


def test_no_light_enters_a_closed_mesh(device: Device) -> None:
    """Whether from a lamp or from the sun, through edges and vertices, too.

    In the sun along a face's plane, n.l is 0 but for rounding, and so is what it lights.
    """
    lamps = [point_light(p) for p in ((9, 9, 9), (0, 12, 0), (7, 5, 3), (3.5, 8, 0.25))]
    suns = [parallel_light(d) for d in ((-1, -1, -2), (1, 2, 3.5), (1e-9, -1, 1e-3))]
    along = [parallel_light(d) for d in ((0, -1, 0), (-1, 1, 0), (-1, -1, 0))]
    camera = looking((0.125, 0.0625, 0.25), WIDE, (40, 30))
    for solid, (lights, most) in itertools.product(CLOSED, (([*lamps, *suns], 0.0), (along, 1e-6))):
        image = picture(Scene.from_meshes(camera, lights, [mesh(solid, material=MATTE)]), device)
        assert (image.id >= 0).all()
        assert image.color.max() <= most


def test_every_wall_of_a_room_sees_the_lamp(device: Device) -> None:
    """In a convex room nothing shadows anything, not even next to the edges."""
    lamps = ((0, 0, 0), (0.25, 0.25, 0.25), (0.1, 0.3, -0.2))
    for solid, eye, light in itertools.product(CONVEX, ((0, 0, 0), (0.125, 0.25, 0.375)), lamps):
        camera = looking(eye, WIDE, (48, 36))
        image = picture(Scene.from_meshes(camera, [point_light(light)], [mesh(solid, material=MATTE)]), device)
        assert (image.color[..., 0] > 0).all(), (eye, light)


@pytest.mark.parametrize(
    "light", [(1, 1, 1), (0, 1, 1), (1, 0, 0.5), (0, 2, 1), (3, 1, 1), (1, 1, 3), (0, 0, 0), (-1.5, 1, 3)]
)
def test_lamps_on_vertices_and_edges_and_in_planes(device: Device, light: tuple[float, ...]) -> None:
    """A triangle in whose plane the lamp is stops no ray of it. A lamp inside of the box is there, too."""
    solids = [box(), box((-4, -3, -4), (4, -2, 4)), box((-2, -2, 0), (-1.5, 2, 0.5)), needles(0).moved(factor=2)]
    meshes = [mesh(solid, material=MATTE) for solid in solids]
    scene = Scene.from_meshes(looking((0.5, 1, 6), 1, (40, 30)), [point_light(light)], meshes)
    assert wrong_pixels(scene, picture(scene, device), 300) == []


def test_balls_at_rest_on_a_mesh(device: Device) -> None:
    """A ball that touches a floor shadows an ellipse, and the floor takes no light from the ball's lower half.

    The sun is in direction s = (1, 2, 0) / sqrt(5), the ball about (0, 1, 0) has radius 1: p on the floor is in its
    shadow iff the distance of the line p + k s to the centre is below 1.
    """
    camera, floor = looking((0.25, 3, 6), 2 * NARROW, (64, 48)), mesh(box((-8, -1, -8), (8, 0, 8)), material=MATTE)
    scene = Scene.from_spheres(camera, [parallel_light((-1, -2, 0))], [(0, 1, 0)], [1], ka=0, kd=1, ks=0, meshes=floor)
    image = picture(scene, device)
    p, lit, who = places(camera, image), channel(image, "color")[:, 0] > 0, channel(image, "id")
    sun, f = np.array([1, 2, 0]) / np.sqrt(5), np.array([0, 1, 0]) - p
    away = np.linalg.norm(f - (f @ sun)[:, None] * sun, axis=1)
    for which, lights in (((who == 1) & (np.abs(p[:, 1]) < 1e-9), away - 1), (who == 0, (p - (0, 1, 0)) @ sun)):
        sure = which & (np.abs(lights) > 1e-6)
        assert sure.sum() > 100
        assert np.array_equal(lit[sure], lights[sure] > 0)


def test_light_on_a_triangle_before_a_fan(device: Device) -> None:
    """All have one corner, and the fan is 2^-52 behind the triangle: less than what the ways from there are off by."""
    rng = np.random.default_rng(0)
    u, v = np.array([2, -1, 0]) / 5**0.5, np.array([1, 2, -3]) / 14**0.5
    n = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    corner, a, b = -u - 1.3 * v, *rng.uniform(1, 3, (2, 20, 1))
    ends = [a * (u + rng.uniform(0, 1, (20, 1)) * v), b * (v + rng.uniform(-0.3, 1, (20, 1)) * u)]
    fan = [corner + end - n * 2.0**-52 * rng.uniform(0.5, 2, (20, 1)) for end in ends]
    behind = np.stack([np.tile(corner, (20, 1)), *fan], axis=1).reshape(-1, 3)
    front = Mesh([corner, 1.1 * u - 0.9 * v, 0.2 * u + 1.7 * v], [(0, 1, 2)], material=MATTE)
    camera = Camera(tuple(3 * n + 0.3 * u), (0, 0, 0), tuple(v), 40, (48, 48))
    meshes = [front, Mesh(behind, np.arange(60).reshape(-1, 3), material=MATTE)]
    scene = Scene.from_meshes(camera, [point_light(tuple(5 * n + v))], meshes)
    image = picture(scene, device)
    assert (image.id == 0).sum() > 200
    assert wrong_pixels(scene, image, 1000) == []


@pytest.mark.parametrize("lamp", [1, -1])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("off", "wide", "low"), [(2.0**-45, 4, 0), (2.0**-105, 2.0**-35, -5)], ids=["pairs", "whole"])
def test_light_on_what_is_beside_a_wall(
    device: Device, off: float, wide: float, low: float, side: int, lamp: int
) -> None:
    """The points of one column are `off` beside the wall's plane, or 2^-99, since none is an edge's: too near to it for
    doubles, or for pairs of them. A lamp is on the same side of the wall, or on the other one."""
    floor = Mesh([(0, 0, 0), (0, 0, 4), (-side * wide, 0, 2)], [(0, 1, 2)], material=MATTE)
    wall = Mesh([(0, low, -5), (0, low, 5), (0, 20, 0)], [(0, 1, 2)], material=MATTE)
    camera = Camera((-side * off, 8, 2), (-side * off, 0, 2), (0, 0, -1), 20, (33, 33))
    image = picture(Scene.from_meshes(camera, [point_light((lamp, 4, 2.3))], [floor, wall]), device)
    on_floor = image.id[:, 16] == 0
    assert on_floor.sum() > 20
    assert (image.color[:, 16][on_floor].any(axis=1) == (side != lamp)).all()


# --------------------------------------------------------------------------------------------------- mirrors and glass


@pytest.mark.parametrize("bounces", [0, 1, 5, 100])
def test_mirror_rooms_keep_every_ray(device: Device, bounces: int) -> None:
    """All walls look the same, so each pixel does, however often it is mirrored; through a leak it would be red.

    Pixels see edges and vertices exactly, where a ray starts again on the line that two mirrors share.
    """
    rooms = [*CONVEX[:2], box((-1, -1, -3), (2, 0.5, 1)), box().unshared().moved(factor=2.0**-30)]
    eyes = [*itertools.product(rooms, [(0, 0, 0)]), (CONVEX[2], (0.125, 0.25, 0)), (CONVEX[3], (0, 0.25, 0))]
    for (solid, eye), r in itertools.product(eyes, (1.0, 0.5)):
        camera = replace(looking(eye, WIDE, (24, 24)), max_bounces=bounces)
        image = picture(glowing(camera, solid, material=glow(GREEN, reflectance=r)), device)
        weights = [r**k * (1 - r) for k in range(bounces + 1)] + [r ** (bounces + 1)]
        assert (image.color == total([(w, GREEN) for w in weights])).all(), (len(solid.faces), r)


@pytest.mark.parametrize("look", [(1, 0, -1), (1, 1, 0), (1, 1, 1), (0, 1, -1)])
def test_mirrors_lose_nothing_at_the_edges_of_a_room(device: Device, look: tuple[int, ...]) -> None:
    """Pixels in the middle see an edge, all along or at one point: their rays would leave the black room for a white
    background from a point of the edge itself, which is in the planes of both walls."""
    walls = mesh(box(), material=Material((0, 0, 0), ka=0, kd=0, ks=0, reflectance=0.9))
    camera = Camera((0, 0, 0), look, (0, 1, 0) if look[1] == 0 else (0, 1, 0.1), 60, (33, 33), max_bounces=4)
    assert not picture(Scene.from_meshes(camera, [ambient_light()], walls, background=(1, 1, 1)), device).color.any()


def test_corners_of_mirrors_send_rays_back(device: Device) -> None:
    """Three mirrors at right angles: every ray returns the way it came, parallel, and meets no wall but its own three.

    Eye and walls are such that rays hit edges, and the corner, exactly. What they see is the night.
    """
    points = np.array([(0, 0, 0), (8, 0, 0), (0, 8, 0), (0, 0, 8)], float)
    corner = Solid(points, np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1)]))
    for eye in ((2, 2, 6), (1, 1, 1), (1.5, 1.5, 3), (2, 1, 6)):
        camera = replace(looking(eye, WIDE, (25, 25)), max_bounces=8)
        image = picture(glowing(camera, corner, material=glow(GREEN, reflectance=1), background=BLUE), device)
        assert (image.color == BLUE).all(), eye


def test_neighbours_in_one_plane_are_not_met_by_mirrored_rays(device: Device) -> None:
    """A floor of many faces, seen at grazing angles, mirrors nothing but the sky; also one that is aslant.

    Its planes are exact: whole numbers, and the sides 3, 4, 5 of a right angle.
    """
    line = np.arange(-8.0, 9)
    i, j = np.meshgrid(line, line)
    faces = sheet(line, line, np.zeros((17, 17))).faces
    flat = np.stack([i, 0 * i, j], -1).reshape(-1, 3)
    slant = i.reshape(-1, 1) * np.array([[3.0, 4, 0]]) + j.reshape(-1, 1) * np.array([[0.0, 0, 5]])
    floors = [(v, (0, 1, 0)) for v in (flat, flat * 3.7 - (0, 0, 0.1))] + [
        (v, (-0.8, 0.6, 0)) for v in (slant, slant + 1024)
    ]
    for (vertices, up), height in itertools.product(floors, (1.0, 1e-3, 1e-6, 1e-9, 1e-12)):
        base = vertices[17 * 8 + 8]
        camera = Camera(tuple(base + height * np.array(up)), tuple(base + (0, 0, -4)), fov=60, resolution=(32, 24))
        floor = glowing(
            replace(camera, max_bounces=5), Solid(vertices, faces), material=glow(RED, reflectance=1), background=BLUE
        )
        image = picture(floor, device)
        assert (image.id >= 0).any()
        assert (image.color == BLUE).all(), height


def test_glass_of_index_one_is_invisible(device: Device) -> None:
    """All pass it straight on, so what is behind it looks as if it were not there; also from inside of it."""
    behind = [mesh(ball(2).moved((0, 0, -4), 2), material=Material(color=(0.9, 0.4, 0.1)))]
    clear, light = Material((0, 0, 0), ka=0, kd=0, ks=0, transmittance=1, index=1), [ambient_light((0.2, 0.2, 0.2))]
    solids = (box(), ball(1), ball(2).flipped(), joined(box(), box((-0.5, -0.5, -0.5), (0.5, 0.5, 1))))
    for eye in ((0, 0, 4), (0.5, 0.25, 0), (0, 0, 1)):
        camera = replace(looking(eye, 2 * NARROW, (64, 48)), max_bounces=12)
        without, *scenes = (
            Scene.from_spheres(camera, light, [(1.5, 0, -3)], [0.5], meshes=[*before, *behind], background=NIGHT)
            for before in ((), *([mesh(solid, material=clear)] for solid in solids))
        )
        for scene in scenes:
            assert np.array_equal(picture(scene, device).color, picture(without, device).color), eye


def test_total_reflection_in_a_cube(device: Device) -> None:
    """From inside of glass, a ray with unit direction d leaves a cube iff |d_i| is beyond sqrt(1 - 1/n^2) for some i.

    Mirrors at right angles change signs only. What cannot leave shows the cube's own colour in the end.
    """
    index = 1.5
    camera = replace(looking((0.125, 0.25, -0.0625), WIDE, (48, 48)), max_bounces=60)
    image = picture(glowing(camera, box(), material=glow(GREEN, transmittance=1, index=index), background=RED), device)
    d = directions(camera)
    leaves = (np.abs(d) / np.linalg.norm(d, axis=1)[:, None]).max(axis=1) - np.sqrt(1 - 1 / index**2)
    sure = np.abs(leaves) > 1e-9
    want = np.where(leaves[sure, None] > 0, RED, GREEN).astype(np.float32)
    assert np.array_equal(channel(image, "color")[sure], want)
    assert 100 < (leaves > 0).sum() < 48 * 48 - 100


def test_a_cube_of_glass_looks_as_snell_says(device: Device) -> None:
    """A plate shifts a ray sideways by h tan(i) - h tan(o), where sin(o) = sin(i) / n, and it goes on as it came.

    Behind the plate is a wall of squares of two colours.
    """
    index, h = 1.5, 2.0
    camera = replace(looking((0, 0, 4), NARROW, (64, 48)), max_bounces=4)
    line = np.arange(-16.0, 17) / 4 + 0.01
    wall = sheet(line, line, np.full((33, 33), -3.0))
    cell = np.arange(32 * 32) // 32 + np.arange(32 * 32) % 32
    white = np.concatenate([cell % 2 == 0] * 2)
    plate = mesh(box((-4, -4, -1), (4, 4, 1)), material=glow(BLACK, transmittance=1, index=index))
    parts = [mesh(Solid(wall.vertices, wall.faces[w]), material=glow(c)) for w, c in ((white, WHITE), (~white, BLUE))]
    image = picture(Scene.from_meshes(camera, [ambient_light(WHITE)], [plate, *parts], background=RED), device)
    d = directions(camera)
    across = np.linalg.norm(d[:, :2], axis=1)
    inner = across / np.linalg.norm(d, axis=1) / index
    slope = np.divide(inner / np.sqrt(1 - inner**2), across, where=across > 0, out=np.zeros(len(d)))
    k = (d[:, :2] * (7 - h + h * slope[:, None]) - line[0]) * 4
    sure = (np.abs(k - np.round(k)) > 1e-9).all(axis=1)
    want = np.where(np.floor(k).sum(axis=1)[:, None] % 2 == 0, WHITE, BLUE)
    assert sure.mean() > 0.9
    assert np.array_equal(channel(image, "color")[sure], want[sure].astype(np.float32))


def test_fronts_and_normals_decide_where_inside_is(device: Device) -> None:
    """Inside-out glass has the inverse index: by powers of two the numbers are the same, to the bit. The front is where
    the normals of the vertices point, however the faces are wound."""
    camera = replace(looking((0.125, 0.25, 4), NARROW, SIZE), max_bounces=6)
    wall = mesh(box((-3, -3, -3), (3, 3, -2)), material=glow((0.5, 0.25, 1)))

    def glass(index: float) -> Material:
        return glow(GREEN, transmittance=0.5, index=index)

    solid = ball(1)
    mixed = Solid(solid.vertices, np.where(np.arange(len(solid.faces))[:, None] % 2, solid.faces, solid.faces[:, ::-1]))
    pairs = [(mesh(s, material=glass(2)), mesh(s.flipped(), material=glass(0.5))) for s in (box(), octahedron(), solid)]
    pairs += [(smooth(solid, material=glass(1.5)), smooth(s, material=glass(1.5))) for s in (mixed, solid.flipped())]
    for pair in pairs:
        one, two = (picture(Scene.from_meshes(camera, [ambient_light(WHITE)], [of, wall]), device) for of in pair)
        assert np.abs(one.color - two.color).max() <= 1e-6
        assert_same(one, two, ("id", "primitive"), "front")
        assert (one.id == 0).any()


def test_smooth_normals_are_those_of_the_sphere(device: Device) -> None:
    """A ball of 2048 faces with normals of its vertices: within 1/30 of the sphere's, and turned to the eye."""
    camera, solid = looking((0.125, 0.25, 4), NARROW, (48, 36)), ball(4)
    for factor in (1.0, -1.0, 1e-30, 1e20):
        made = Mesh(solid.vertices, solid.faces, normals=solid.vertices * factor)
        image = picture(Scene.from_meshes(camera, [], [made]), device)
        hit = channel(image, "id") == 0
        p, d, n = places(camera, image)[hit], directions(camera)[hit], channel(image, "normal")[hit]
        want = p / np.linalg.norm(p, axis=1)[:, None]
        # At the limb, a normal may point away from the eye, and is turned.
        want *= np.where((want * d).sum(axis=1) > 0, -1, 1)[:, None]
        middle = np.linalg.norm(p[:, :2], axis=1) < 0.9
        assert np.linalg.norm(n - want, axis=1)[middle].max() <= 1 / 30
        assert (n * d).sum(axis=1).max() <= 1e-6


def test_normals_that_are_nothing_or_opposite(device: Device) -> None:
    """Where the interpolated normal is 0, the face's own one is shown; nothing is NaN."""
    camera, solid, light = looking((0, 0, 4), NARROW, SIZE), box(), [point_light((1, 2, 3))]
    flat = picture(Scene.from_meshes(camera, light, mesh(solid)), device)
    wild = np.random.default_rng(0).choice([1.0, -1, 0], (12, 3, 3))
    for normals in (np.zeros((8, 3)), np.zeros((12, 3, 3)), wild):
        image = picture(Scene.from_meshes(camera, light, Mesh(solid.vertices, solid.faces, normals)), device)
        assert np.isfinite(image.color).all()
        assert normals is wild or np.array_equal(image.normal, flat.normal)
        assert np.isfinite(image.normal).all()
