"""What the eye sees of meshes, in the places where tracers leak or hit twice: answers are exact."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from glowing import BLUE, WHITE
from hostile.sphere_scenes import AHEAD, BACK, LEFT, UP, directions, looking
from solids import (
    AT_FOUR,
    NARROW,
    SAME,
    SIZE,
    WIDE,
    Row,
    Solid,
    Triangles,
    at_pixels,
    ball,
    bare,
    box,
    check,
    corners_of,
    drawn,
    glow,
    glowing,
    is_closed,
    joined,
    lattice,
    mesh,
    needles,
    octahedron,
    same,
    seen,
    sheet,
    tetrahedron,
)
from stress_cases import channel

import cltrace
from cltrace import Camera, Material, Mesh, Scene, ambient_light, parallel_light, point_light
from cltrace.plan.request import KEEPS
from cltrace.run.devices import Device

pytestmark = pytest.mark.slow

# --- what the eye sees, pixel by pixel


def terrain_of_pixels(camera: Camera, step: int = 2) -> Solid:
    """A surface with a vertex in the ray of every other pixel of every other row: the rays between are on edges."""
    width, height = camera.resolution
    depth = np.random.default_rng(1).integers(16, 24, (height // step, width // step)) / 8
    rows = directions(camera).reshape(height, width, 3)[::step, ::step][: height // step, : width // step]
    flat = sheet(np.arange(width // step), np.arange(height // step), np.zeros(depth.shape))
    return Solid((rows * depth[..., None]).reshape(-1, 3) + camera.position, flat.faces)


def strips(camera: Camera) -> Solid:
    """A wall that fills the picture, of columns that are 2^-2 .. 2^-40 wide about the rays of a column of pixels."""
    gaps = np.array([0, *(2.0 ** -np.arange(40, 1, -2)), 4])
    x = directions(camera)[11, 0]
    columns = np.unique(np.concatenate([x - gaps, x + gaps]))
    rows = directions(camera)[:: camera.resolution[0], 1][5] + np.array([-4.0, -(2.0**-30), 0, 2.0**-36, 4])
    return sheet(columns, rows, np.full((len(rows), len(columns)), -1.0)).moved(camera.position)


def aslant(seed: int, at: Row = (0, 0, 0), far: float = 4, angle: float = 20) -> Camera:
    """A camera whose axes are doubles of 53 digits."""
    rng = np.random.default_rng((seed, 7))
    eye = np.array(at) + far * rng.normal(size=3) / 2
    return Camera(tuple(eye), tuple(at), tuple(rng.normal(size=3)), angle, (24, 18))


def fuzzed(seed: int, spread: int) -> Scene:
    """Triangles of random bits, with normals, texture coordinates and lights of the same numbers.

    The numbers are few, so that much has no area, is in one plane, or is where the eye or a light is. Of every other
    scene they are small whole numbers times a power of two; else their sizes differ by up to 2^spread.
    """
    rng = np.random.default_rng((seed, 13))
    base = int(rng.integers(spread - 126, 127 - spread)) if spread < 100 else 0
    bits = rng.integers(1, 2**24, 8) * 2.0**-24
    pool = np.ldexp(bits * rng.choice([1, -1], 8), base + rng.integers(-spread // 2, spread // 2 + 1, 8))
    if spread >= 100:
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


def crossing_planes(camera: Camera) -> tuple[Solid, Solid]:
    """A wall and a slanted one, which cross in what a row of pixels sees: there both are equally far."""
    y = directions(camera)[10 * camera.resolution[0], 1]
    wall = sheet(np.array([-4.0, 4]), np.array([-4.0, 4]), np.full((2, 2), -1.0))
    slant = Solid(wall.vertices.copy(), wall.faces)
    slant.vertices[:, 2] -= (slant.vertices[:, 1] - y) / 8
    return wall, slant


IN_BOX = [(0, 0, 0), (0.5, 0.25, 0.125), (0, 0, 1), (0, 0.5, 1), (0.5, 0, -1), (0, 1, 1), (1, 1, 1), (1, -1, 0.5)]
BESIDE_BOX = [(0, 1, 4), (1, 1, 4), (0, 0, 4), (3, 1, 4), (1, 0, 2), (0, 2, 1), (2, 2, 2), (0, 4, 1)]

CASES: dict[str, Callable[[], list[Scene]]] = {
    "vertices in the rays": lambda: [
        bare(AT_FOUR, at_pixels(AT_FOUR, s)) for s in (ball(1), ball(2), box(), octahedron())
    ],
    "edges in the rays": lambda: [
        bare(camera, terrain_of_pixels(camera, step))
        for camera in (looking((0, 0, 0), NARROW, SIZE), looking((3, -5, 7), WIDE, SIZE))
        for step in (2, 3, 4)
    ],
    "rooms": lambda: [
        bare(looking(eye, WIDE, (24, 24), axis), box()) for eye in IN_BOX[:2] for axis in (AHEAD, UP, LEFT)
    ],
    "the eye on a box": lambda: [
        bare(looking(eye, WIDE, SIZE, axis), box()) for eye in IN_BOX[2:] for axis in (AHEAD, BACK, UP)
    ],
    "the eye in the planes of a box": lambda: [bare(looking(eye, WIDE, SIZE), box()) for eye in BESIDE_BOX],
    "slivers": lambda: [
        bare(camera, strips(camera)) for camera in (looking((0, 0, 0), NARROW, SIZE), looking((8, -4, 2), WIDE, SIZE))
    ],
    "needles": lambda: [bare(looking((0, 0, 2), NARROW, SIZE), needles(seed)) for seed in range(3)],
    "whole numbers": lambda: [
        bare(looking(eye, WIDE, SIZE), lattice(seed))
        for seed, eye in enumerate([(0, 0, 4), (0.5, 0.25, 4), (0, 0, 0), (1, 1, 3), (3, 3, 3)])
    ],
    "there twice": lambda: [
        bare(looking((0.25, 0.5, 4), NARROW, SIZE), *solids)
        for solids in (
            (joined(box(), box()),),
            (box(), box()),
            (box(), box().flipped()),
            (box().reordered(np.arange(12)[::-1]), box()),
            (lattice(9), lattice(9).reordered(np.random.default_rng(0).permutation(120))),
        )
    ],
    "in one plane": lambda: [
        bare(looking((0, 0, 4), NARROW, SIZE), *solids)
        for solids in (
            (box(), box((-0.5, -0.5, 0), (0.5, 0.5, 1))),
            (box((-0.5, -0.5, 0), (0.5, 0.5, 1)), box()),
            (box((0, 0, 0)), box(high=(0.25, 0.25, 1))),
        )
    ],
    "crossing in a row of pixels": lambda: [
        bare(camera, *walls)
        for camera in (looking((0, 0, 0), NARROW, SIZE),)
        for walls in (crossing_planes(camera), crossing_planes(camera)[::-1])
    ],
    "far away": lambda: [
        bare(looking((0.5 + far, 0.25 - far, 4 + far), NARROW, SIZE), solid.moved((far, -far, far)))
        for far in (2.0**23, 1e7, 123456.789)
        for solid in (box(), ball(2), lattice(4))
    ],
    "tiny and huge": lambda: [
        bare(looking(np.array([0.5, 0.25, 4]) * k, NARROW, SIZE), solid.moved(factor=k))
        for k in (2.0**60, 2.0**-60, 1e-30, 1e30)
        for solid in (box(), ball(1), lattice(5))
    ],
    "aslant": lambda: [
        bare(aslant(seed), solid)
        for seed, solid in enumerate([box(), ball(2), lattice(6), needles(7), joined(box(), box()), octahedron()])
    ],
    "aslant and far away": lambda: [
        bare(aslant(seed, (1e7, -1e7, 3e6)), solid.moved((1e7, -1e7, 3e6)))
        for seed, solid in enumerate([box(), ball(2), lattice(8)])
    ],
    "random bits": lambda: [fuzzed(seed, 32) for seed in range(60)],
    "one triangle": lambda: [
        bare(looking((0, 0, 0), WIDE, SIZE), Solid(np.array(points, float), np.array([[0, 1, 2]])))
        for points in (
            [(-1, -1, -2), (1, -1, -2), (0, 1, -2)],
            [(-1e6, -1e6, -1), (1e6, -1e6, -1), (0, 1e7, -1)],  # all of the sky
            [(-1e4, -1, 1e4), (1e4, -1, 1e4), (0, -1, -1e6)],  # a floor, under the eye and behind it
            [(-1e30, -1, 1e30), (1e30, -1, 1e30), (0, -1, -1e30)],
            [(-1, -1, 2), (1, -1, 2), (0, 1, 2)],  # behind the eye
            [(-1, -1, 0), (1, -1, 0), (0, 1, 0)],  # the eye is on it
            [(0, 0, 0), (1, -1, -2), (0, 1, -2)],  # the eye is a corner
        )
    ],
}


@functools.cache
def cases(name: str) -> list[Scene]:
    """The same objects each time, for which it is remembered what they show."""
    return CASES[name]()


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("precision", ["accurate", "double"])
def test_hits(device: Device, name: str, precision: str) -> None:
    for scene in cases(name):
        check(scene, device, precision)


@pytest.mark.parametrize("name", ["vertices in the rays", "rooms", "there twice", "aslant"])
def test_hits_in_packets_of_one_pixel(device: Device, name: str) -> None:
    for scene in cases(name):
        check(scene, device, width=1)


def look_for_nan(seeds: Iterable[int]) -> None:
    """Every pixel is a number, of whatever sizes a triangle's corners are."""
    for seed in seeds:
        scene = fuzzed(seed, 240)
        for precision in ("accurate", "single"):
            image = drawn(scene, None, precision)
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


def test_the_cases_are_what_they_say() -> None:
    """Rays are on edges and vertices, and exact arithmetic needs 0 or 2 triangles of a closed mesh all the same."""
    for solid in (box(), octahedron(), tetrahedron(), ball(1), ball(2)):
        assert is_closed(solid)
    for name in ("vertices in the rays", "there twice", "in one plane"):
        for scene in cases(name)[:3]:
            assert (seen(scene).met.sum(axis=1) % 2 == 0).all(), name
    for scene in (*cases("rooms"), *cases("slivers")):
        assert (seen(scene).met.sum(axis=1) == 1).all()
    ties = 0
    for scene in (cases("vertices in the rays")[1], cases("edges in the rays")[0]):
        corners, _, _ = corners_of(scene)
        triangles = Triangles(corners, scene.camera.position)
        for w in directions(scene.camera):
            E = triangles.n @ w
            ties += int((np.abs(E) < 1e-14).any(axis=1).sum())
    assert ties > 500


def test_every_pixel_of_a_room_is_a_wall(device: Device) -> None:
    for precision in ("accurate", "double", "single"):
        for size in ((24, 24), (31, 31), (64, 64)):
            for solid in (box(), octahedron().moved(factor=4), ball(2).moved(factor=2)):
                image = drawn(bare(looking((0, 0, 0), WIDE, size), solid), device, precision)
                assert (image.id == 0).all(), (precision, size)
                assert np.isfinite(image.depth).all()


def test_closed_meshes_have_no_cracks(device: Device) -> None:
    """Seen from far, and with vertices in the rays, so that many rays are on edges."""
    camera = looking((0, 0, 4e3), NARROW, (96, 72))
    check(bare(camera, at_pixels(camera, ball(3).moved(factor=1e3))), device)


def test_faces_without_area_are_not_there(device: Device) -> None:
    """A mesh of nothing else is nothing; among others they keep their numbers."""
    points = np.array([(0, 0, 0), (1, 1, 1), (2, 2, 2), (1, 0, 0), (0, 1, 0)], float)
    flat = Solid(points, np.array([(0, 1, 2), (0, 0, 0), (0, 3, 3), (2, 0, 1)]))
    camera = looking((0.25, 0.25, 4), NARROW, SIZE)
    scene = glowing(camera, flat, material=glow(), background=BLUE)
    image = drawn(scene, device)
    assert (image.id == -1).all()
    assert (image.primitive == -1).all()
    assert (image.color == BLUE).all()
    some = Solid(points, np.array([(0, 1, 2), (0, 3, 3), (0, 3, 4), (0, 0, 0)]))
    image = check(bare(camera, flat, some), device)
    assert set(np.unique(image.id)) == {-1, 1}
    assert set(np.unique(image.primitive)) == {-1, 2}


def test_many_triangles_one_behind_the_other(device: Device) -> None:
    """100,000 that cover the picture: the nearest one is not the first one of the file. Some are equally near."""
    n = 100_000
    order = np.random.default_rng(0).permutation(n)
    depth = 1 + order // 2 * 2.0**-10
    one = np.array([(-4, -4, -1), (4, -4, -1), (0, 8, -1)], float)
    stack = Solid((one * depth[:, None, None]).reshape(-1, 3), np.arange(3 * n).reshape(-1, 3))
    nearest = int(np.flatnonzero(order // 2 == 0)[0])
    camera = looking((0, 0, 0), NARROW, SIZE)
    image = drawn(bare(camera, stack), device)
    assert (image.primitive == nearest).all()
    assert np.abs(channel(image, "depth") / np.linalg.norm(directions(camera), axis=1) - 1).max() <= 1e-8


def test_triangles_that_cross_in_one_line(device: Device) -> None:
    """Like the leaves of a book, with its spine in a row of pixels: no order of depths helps."""
    camera = looking((0, 0, 0), NARROW, SIZE)
    y = directions(camera)[10 * SIZE[0], 1]
    slope = np.arange(-32, 32) / 32
    leaves = [np.array([(-4, y - 4, -1 + 4 * s), (4, y - 4, -1 + 4 * s), (0, y + 8, -1 - 8 * s)]) for s in slope / 16]
    check(bare(camera, Solid(np.concatenate(leaves), np.arange(3 * len(leaves)).reshape(-1, 3))), device)


# --- what a picture is free of


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


def with_meshes(scene: Scene, change: Callable[[Solid, int], Solid]) -> Scene:
    """The same scene with something done to each of its meshes, which have no transforms."""
    meshes = []
    for k, old in enumerate(scene.meshes):
        solid = change(Solid(np.array(old.geometry.vertices), np.array(old.geometry.faces)), k)
        of = scene.materials[old.material]
        values = {n: float(of[n]) for n in ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index")}
        meshes.append(mesh(solid, material=Material(color=tuple(of["color"].tolist()), **values)))  # type: ignore[arg-type]
    return Scene.from_meshes(scene.camera, scene.lights, meshes, background=scene.background)


def test_a_mesh_is_the_doubles_that_were_given() -> None:
    rng = np.random.default_rng(0)
    solid = Solid(rng.normal(size=(30, 3)) * 10.0 ** rng.integers(-20, 20, (30, 1)), rng.integers(0, 30, (20, 3)))
    scene = bare(Camera(), solid)
    assert np.array_equal(scene.meshes[0].vertices, solid.vertices)
    assert np.array_equal(scene.meshes[0].geometry.faces, solid.faces)


def test_the_order_of_faces_changes_no_bit(device: Device) -> None:
    rng = np.random.default_rng(3)
    for number, scene in enumerate(worlds()):
        # Of faces that are there twice, the first one is seen, so each place has one only.
        scene = with_meshes(scene, lambda s, k: s if k < 3 else Solid(s.vertices, np.unique(np.sort(s.faces), axis=0)))
        orders = [rng.permutation(len(m.geometry.faces)) for m in scene.meshes]
        other = with_meshes(scene, lambda s, k, orders=orders: s.reordered(orders[k]))
        one, two = drawn(scene, device), drawn(other, device)
        if number < 2:  # Overlapping faces in one plane have the lower number in front, which is another one now.
            same(one, two, number, ("depth", "id"))
        hit = one.id >= 0
        back = np.array([orders[k][p] if k >= 0 else -1 for k, p in zip(two.id[hit], two.primitive[hit], strict=True)])
        apart = back != one.primitive[hit]
        assert (one.id[hit][apart] == 3).all()  # only the soup has such faces
        for name in ("rgb8", "color", "normal"):
            assert np.array_equal(getattr(one, name)[hit][~apart], getattr(two, name)[hit][~apart]), (name, number)


def test_shared_vertices_change_no_bit(device: Device) -> None:
    for number, scene in enumerate(worlds()):
        same(drawn(scene, device), drawn(with_meshes(scene, lambda s, _: s.unshared()), device), number)


def test_vertices_that_no_face_has_change_no_bit(device: Device) -> None:
    scene = worlds()[1]
    more = np.array([(1e30, 0, 0), (0, 0, 4), (3, 3, 3)])
    other = with_meshes(scene, lambda s, _: Solid(np.concatenate([more, s.vertices]), s.faces + 3))
    same(drawn(scene, device), drawn(other, device), "strays")


def test_widths_and_structures_change_no_bit(device: Device) -> None:
    scene = worlds()[2]
    usual = drawn(scene, device)
    same(usual, drawn(scene, device, width=1), 1, ("id", "primitive", "depth"))
    for keep in (("lists", "tree"), ("order", "receivers", "lights", "hidden", "unstopped", "weightless")):
        same(usual, drawn(scene, device, keep=keep), keep)


@pytest.mark.stress
def test_no_width_and_nothing_that_is_skipped_changes_a_bit(device: Device) -> None:
    for number, scene in enumerate(worlds()):
        usual = drawn(scene, device)
        for width in (1, 4, 8, 16):
            same(usual, drawn(scene, device, width=width), (number, width), ("id", "primitive", "depth"))
        for keep in sorted(set(KEEPS) - {"features"}):
            same(usual, drawn(scene, device, keep=(keep,)), (number, keep))


def test_crops_are_those_pixels(device: Device) -> None:
    scene = worlds()[2]
    whole = drawn(scene, device)
    for x0, y0, x1, y1 in ((0, 0, 1, 1), (3, 5, 20, 18), (0, 7, 40, 8), (13, 2, 14, 30)):
        part = drawn(scene, device, crop=(x0, y0, x1, y1))
        for name in SAME:
            assert np.array_equal(getattr(whole, name)[y0:y1, x0:x1], getattr(part, name)), (name, x0)


def test_winding_does_not_matter_to_what_is_opaque(device: Device) -> None:
    """Faces have two sides: wound the other way, or each in its own way, nothing looks different.

    No ray is on an edge, where the last digit of a point says which side of another face a mirrored ray starts on.
    """
    scene = worlds()[1]
    scene = scene.seen_by(replace(scene.camera, position=(0.2371, 0.5113, 4.037)))
    usual = drawn(scene, device)
    odd = with_meshes(
        scene, lambda s, _: Solid(s.vertices, np.where(np.arange(len(s.faces))[:, None] % 3, s.faces, s.faces[:, ::-1]))
    )
    for other in (with_meshes(scene, lambda s, _: s.flipped()), odd):
        image = drawn(other, device)
        same(usual, image, "winding", ("id", "primitive", "shadow_rays"))
        assert np.abs(usual.color - image.color).max() <= 1e-6
        hit = usual.id >= 0
        assert np.abs(usual.depth[hit] / image.depth[hit] - 1).max() <= 1e-12


def test_one_mesh_or_many(device: Device) -> None:
    """A solid as one mesh of 48 faces, or as 48 meshes of one face."""
    camera = looking((0.25, 0.5, 4), NARROW, SIZE)
    solid, lights = ball(1), [point_light((3, 4, 5))]
    one = drawn(Scene.from_meshes(camera, lights, [mesh(solid)]), device)
    parts = [mesh(Solid(solid.vertices, solid.faces[k : k + 1])) for k in range(len(solid.faces))]
    many = drawn(Scene.from_meshes(camera, lights, parts), device)
    assert np.array_equal(one.primitive, many.id)
    assert np.array_equal(many.primitive, np.where(many.id < 0, -1, 0))
    same(one, many, "parts", ("rgb8", "color", "depth", "normal", "shadow_rays"))


def test_transforms_do_what_moved_vertices_do(device: Device) -> None:
    """By powers of two, whole numbers, and mirrored; the front of a mirrored mesh stays outside."""
    camera, solid = replace(looking((0.25, 0.5, 4), 2 * NARROW, SIZE), max_bounces=3), box().moved((0.25, 0, 0), 0.5)
    wall = mesh(box((-3, -3, -3), (3, 3, -2)), material=glow((0.5, 0.25, 1)))
    lights = [ambient_light(WHITE), point_light((3, 4, 5))]
    glass = Material(color=(0.5, 0.5, 1), transmittance=0.75, index=1.5)
    for rows, flips in (
        ([[1, 0, 0, 0.5], [0, 1, 0, 0.25], [0, 0, 1, -1]], False),
        ([[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], True),
        ([[0, 2, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]], True),
        ([[0, -1, 0, 0], [0, 0, 1, 0.5], [-1, 0, 0, 0]], False),
        ([[-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0]], True),
    ):
        M = np.array(rows, float)
        image = drawn(Scene.from_meshes(camera, lights, [mesh(solid, transform=M, material=glass), wall]), device)
        moved = Solid(solid.vertices @ M[:, :3].T + M[:, 3], solid.faces)
        other = moved.flipped() if flips else moved
        want = drawn(Scene.from_meshes(camera, lights, [mesh(other, material=glass), wall]), device)
        same(image, want, rows, ("id", "primitive"))
        assert np.abs(image.color - want.color).max() <= 1e-6
        square = np.vstack([M, [0, 0, 0, 1]])
        same(
            image,
            drawn(Scene.from_meshes(camera, lights, [mesh(solid, transform=square, material=glass), wall]), device),
            4,
        )


def test_scaling_by_powers_of_two_changes_no_colour(device: Device) -> None:
    base = worlds()[2]
    usual = drawn(base, device)
    for k in (-40, 60):
        scene = with_meshes(base, lambda s, _, k=k: s.moved(factor=2.0**k))
        lights = scene.lights.copy()
        lights["position"] = np.ldexp(lights["position"], k)
        camera = scene.camera
        moved = replace(camera, position=tuple(np.ldexp(camera.position, k)), lookat=tuple(np.ldexp(camera.lookat, k)))
        image = drawn(replace(scene, camera=moved, lights=lights), device)
        same(usual, image, k, ("rgb8", "color", "id", "primitive", "shadow_rays"))
