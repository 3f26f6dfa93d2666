"""Mirrors and glass of triangles: rays that start on edges and vertices, and rays that must stay in closed rooms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from glowing import BLACK, BLUE, GREEN, NIGHT, RED, WHITE, total
from hostile.sphere_scenes import directions, looking, unit
from solids import (
    AT_FOUR,
    NARROW,
    SIZE,
    WIDE,
    Solid,
    at_pixels,
    ball,
    bare,
    box,
    drawn,
    glow,
    glowing,
    joined,
    mesh,
    octahedron,
    places,
    same,
    sheet,
    smooth,
    tetrahedron,
)
from stress_cases import channel

from cltrace import Camera, Material, Mesh, Scene, ambient_light, parallel_light, point_light
from cltrace.run.devices import Device

pytestmark = pytest.mark.slow

# --- mirrors and glass


@pytest.mark.parametrize("bounces", [0, 1, 5, 100])
def test_mirror_rooms_keep_every_ray(device: Device, bounces: int) -> None:
    """All walls look the same, so each pixel does, however often it is mirrored; through a leak it would be red.

    Pixels see edges and vertices exactly, where a ray starts again on the line that two mirrors share.
    """
    solids = [
        box(),
        box((-1, -1, -3), (2, 0.5, 1)),
        box().unshared().moved(factor=2.0**-30),
        octahedron().moved(factor=2),
        ball(1).moved(factor=2),
        tetrahedron().moved(factor=3),
    ]
    eyes = [(0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0), (0.125, 0.25, 0), (0, 0.25, 0)]
    for solid, eye in zip(solids, eyes, strict=True):
        for r in (1.0, 0.5):
            camera = replace(looking(eye, WIDE, (24, 24)), max_bounces=bounces)
            image = drawn(glowing(camera, solid, material=glow(GREEN, reflectance=r)), device)
            weights = [r**k * (1 - r) for k in range(bounces + 1)] + [r ** (bounces + 1)]
            assert (image.color == total([(w, GREEN) for w in weights])).all(), (len(solid.faces), r)


def test_corners_of_mirrors_send_rays_back(device: Device) -> None:
    """Three mirrors at right angles: every ray returns the way it came, parallel, and meets no wall but its own three.

    Eye and walls are such that rays hit edges, and the corner, exactly. What they see is the night.
    """
    corner = Solid(
        np.array([(0, 0, 0), (8, 0, 0), (0, 8, 0), (0, 0, 8)], float), np.array([(0, 1, 2), (0, 2, 3), (0, 3, 1)])
    )
    for eye in ((2, 2, 6), (1, 1, 1), (1.5, 1.5, 3), (2, 1, 6)):
        camera = replace(looking(eye, WIDE, (25, 25)), max_bounces=8)
        image = drawn(glowing(camera, corner, material=glow(GREEN, reflectance=1), background=BLUE), device)
        assert (image.color == BLUE).all(), eye


def test_neighbours_in_one_plane_are_not_met_by_mirrored_rays(device: Device) -> None:
    """A floor of many faces, seen at grazing angles, mirrors nothing but the sky; also one that is aslant.

    Its planes are exact: whole numbers, and the sides 3, 4, 5 of a right angle.
    """
    line = np.arange(-8.0, 9)
    i, j = np.meshgrid(line, line)
    faces = sheet(line, line, np.zeros((17, 17))).faces
    flat = np.stack([i, 0 * i, j], -1).reshape(-1, 3)
    slant = (i.reshape(-1, 1) * np.array([[3, 4, 0]]) + j.reshape(-1, 1) * np.array([[0, 0, 5]])).astype(float)
    for vertices in (flat, flat * 3.7 - (0, 0, 0.1), slant, slant + 1024):
        for height in (1.0, 1e-3, 1e-6, 1e-9, 1e-12):
            base = vertices[17 * 8 + 8]
            up = (
                np.array([0, 1, 0])
                if vertices[0, 1] == vertices[-1, 1] == vertices[16, 1]
                else np.array([-0.8, 0.6, 0])
            )
            camera = replace(
                Camera(tuple(base + height * up), tuple(base + (0, 0, -4)), horizontal_fov=30, resolution=(32, 24)),
                max_bounces=5,
            )
            image = drawn(
                glowing(camera, Solid(vertices, faces), material=glow(RED, reflectance=1), background=BLUE), device
            )
            assert (image.id >= 0).any()
            assert (image.color == BLUE).all(), height


def test_convex_mirrors_do_not_see_themselves(device: Device) -> None:
    for solid in (
        box(),
        octahedron(),
        at_pixels(AT_FOUR, tetrahedron()),
        box().moved((2.0**23, 0, 0)),
        box().moved(factor=1e-30),
    ):
        middle, half = solid.vertices.mean(axis=0), np.ptp(solid.vertices, axis=0).max() / 2
        for by in ((0, 0, 4), (0.5, 1, 3), (0.75, 0.5, 1.5)):
            camera = replace(looking(middle + half * np.array(by), NARROW * 2, (32, 24)), max_bounces=4)
            image = drawn(glowing(camera, solid, material=glow(RED, reflectance=1), background=BLUE), device)
            assert (image.id >= 0).any()
            assert (image.color == BLUE).all(), by


def walls(solid: Solid, camera: Camera, device: Device) -> np.ndarray:
    """How many walls each pixel looks through: each lets half of the light pass, straight on, before a blue night."""
    image = drawn(glowing(camera, solid, material=glow(RED, transmittance=0.5, index=1), background=BLUE), device)
    count = -np.log2(channel(image, "color")[:, 2])
    assert np.array_equal(channel(image, "color")[:, 0], 1 - channel(image, "color")[:, 2])
    assert np.array_equal(count, np.round(count))
    assert np.array_equal(count > 0, channel(image, "id") >= 0)
    return count


def test_what_enters_a_closed_mesh_leaves_it(device: Device) -> None:
    """Rays meet an even number of walls, of a convex mesh none or two.

    Vertices and edges are in the rays, so that many enter and leave at one edge.
    """
    for solid, most in (
        (box(), 2),
        (octahedron(), 2),
        (ball(2), 2),
        (box().unshared(), 2),
        (at_pixels(AT_FOUR, ball(2)), 8),
        (joined(box(), ball(2).moved(factor=0.5)), 4),
    ):
        count = walls(solid, replace(AT_FOUR, max_bounces=12, resolution=(64, 48)), device)
        assert (count % 2 == 0).all(), np.unique(count)
        assert 0 < count.max() <= most


@pytest.mark.stress
def test_ten_million_rays_enter_and_leave_closed_meshes(device: Device) -> None:
    """Seen from anywhere, near and far, large and small; of the last solid, many faces are at random."""
    rays, rng = 0, np.random.default_rng(0)
    rough = ball(4)
    rough = Solid(rough.vertices * rng.uniform(0.8, 1, (len(rough.vertices), 1)), rough.faces)
    for solid, most in ((box(), 2), (octahedron(), 2), (ball(3), 20), (ball(5), 20), (rough, 60)):
        for far, k in ((0.0, 1.0), (1e7, 1.0), (0.0, 1e-30), (1e3, 1e10)):
            at = far * k * rng.normal(size=3)
            eye = at + k * rng.uniform(1.1, 6) * unit(rng)
            aim = at + k * 0.3 * rng.normal(size=3)
            camera = Camera(tuple(eye), tuple(aim), tuple(rng.normal(size=3)), 20, (800, 640), max_bounces=80)
            count = walls(solid.moved(at, k), camera, device)
            assert (count % 2 == 0).all(), (len(solid.faces), far, k)
            assert 0 < count.max() <= most
            rays += len(count)
    assert rays >= 10_000_000


@pytest.mark.stress
def test_ten_million_rays_stay_in_mirror_rooms(device: Device) -> None:
    """Each of a million rays is mirrored ten times."""
    rng = np.random.default_rng(0)
    for solid, size in ((box(), 0.9), (octahedron(), 0.5), (tetrahedron(), 0.3), (ball(2), 0.9)):
        eye = size * rng.uniform(-0.5, 0.5, 3)
        for at in (eye + rng.normal(size=3), (0, 0, -1e3)):
            camera = Camera(tuple(eye), tuple(at), (0, 1, 0), 50, (360, 360), max_bounces=10)
            image = drawn(glowing(camera, solid, material=glow(GREEN, reflectance=1)), device)
            assert (image.color == GREEN).all()


def test_glass_of_index_one_is_invisible(device: Device) -> None:
    """All pass it straight on, so what is behind it looks as if it were not there; also from inside of it."""
    lights = [ambient_light((0.2, 0.2, 0.2)), parallel_light((-1, -1, -2), (0.5, 0.75, 1))]
    behind = [mesh(ball(2).moved((0, 0, -4), 2), material=Material(color=(0.9, 0.4, 0.1)))]
    clear = Material(color=(0, 0, 0), ka=0, kd=0, ks=0, transmittance=1, index=1)
    for eye in ((0, 0, 4), (0.5, 0.25, 0), (0, 0, 1)):
        camera = replace(looking(eye, 2 * NARROW, (64, 48)), max_bounces=12)
        spheres = ([(1.5, 0, -3)], [0.5])
        without = Scene.from_spheres(camera, lights[:1], *spheres, meshes=behind, background=NIGHT)
        for solid in (box(), ball(1), ball(2).flipped(), joined(box(), box((-0.5, -0.5, -0.5), (0.5, 0.5, 1)))):
            meshes = [mesh(solid, material=clear), *behind]
            scene = Scene.from_spheres(camera, lights[:1], *spheres, meshes=meshes, background=NIGHT)
            assert np.array_equal(drawn(scene, device).color, drawn(without, device).color), eye


def test_total_reflection_in_a_cube(device: Device) -> None:
    """From inside of glass, a ray with unit direction d leaves a cube iff |d_i| is beyond sqrt(1 - 1/n^2) for some i.

    Mirrors at right angles change signs only. What cannot leave shows the cube's own colour in the end.
    """
    index = 1.5
    camera = replace(looking((0.125, 0.25, -0.0625), WIDE, (48, 48)), max_bounces=60)
    glass = glow(GREEN, transmittance=1, index=index)
    image = drawn(glowing(camera, box(), material=glass, background=RED), device)
    d = directions(camera)
    d = np.abs(d) / np.linalg.norm(d, axis=1)[:, None]
    leaves = d.max(axis=1) - np.sqrt(1 - 1 / index**2)
    sure = np.abs(leaves) > 1e-9
    color = channel(image, "color")
    assert np.array_equal(color[sure], np.where(leaves[sure, None] > 0, RED, GREEN).astype(np.float32))
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
    image = drawn(Scene.from_meshes(camera, [ambient_light(WHITE)], [plate, *parts], background=RED), device)
    d = directions(camera)
    sine = np.linalg.norm(d[:, :2], axis=1) / np.linalg.norm(d, axis=1)
    inner = sine / index
    slope = np.divide(
        inner / np.sqrt(1 - inner**2), np.linalg.norm(d[:, :2], axis=1), where=sine > 0, out=np.zeros(len(d))
    )
    where = d[:, :2] * (7 - h + h * slope[:, None])
    k = (where - line[0]) * 4
    sure = (np.abs(k - np.round(k)) > 1e-9).all(axis=1)
    want = np.where(np.floor(k).sum(axis=1)[:, None] % 2 == 0, WHITE, BLUE)
    assert sure.mean() > 0.9
    assert np.array_equal(channel(image, "color")[sure], want[sure].astype(np.float32))


def test_inside_out_glass_has_the_inverse_index(device: Device) -> None:
    """Fronts decide where inside is. By powers of two the numbers are the same, to the bit."""
    camera = replace(looking((0.125, 0.25, 4), NARROW, SIZE), max_bounces=6)
    wall = mesh(box((-3, -3, -3), (3, 3, -2)), material=glow((0.5, 0.25, 1)))
    for solid in (box(), octahedron(), ball(1)):
        images = [
            drawn(
                Scene.from_meshes(
                    camera, [ambient_light(WHITE)], [mesh(s, material=glow(GREEN, transmittance=0.5, index=i)), wall]
                ),
                device,
            )
            for s, i in ((solid, 2.0), (solid.flipped(), 0.5))
        ]
        assert np.abs(images[0].color - images[1].color).max() <= 1e-6
        same(*images, "front", ("id", "primitive"))
        assert (images[0].id == 0).any()


def test_normals_decide_where_inside_is(device: Device) -> None:
    """The front is where the normals of the vertices point, however the faces are wound."""
    camera = replace(looking((0.125, 0.25, 4), NARROW, SIZE), max_bounces=6)
    wall = mesh(box((-3, -3, -3), (3, 3, -2)), material=glow((0.5, 0.25, 1)))
    solid = ball(1)
    mixed = Solid(solid.vertices, np.where(np.arange(len(solid.faces))[:, None] % 2, solid.faces, solid.faces[:, ::-1]))
    images = []
    for s in (solid, mixed, solid.flipped()):
        glass = smooth(s, material=glow(GREEN, transmittance=0.5, index=1.5))
        images.append(drawn(Scene.from_meshes(camera, [ambient_light(WHITE)], [glass, wall]), device))
    for image in images[1:]:
        same(images[0], image, "winding", ("id", "primitive"))
        assert np.abs(images[0].color - image.color).max() <= 1e-6


def test_smooth_normals_are_those_of_the_sphere(device: Device) -> None:
    """A ball of 2048 faces with normals of its vertices: within 1/30 of the sphere's, and turned to the eye."""
    camera = looking((0.125, 0.25, 4), NARROW, (48, 36))
    for factor in (1.0, -1.0, 1e-30, 1e20):
        solid = ball(4)
        made = Mesh(solid.vertices, solid.faces, normals=solid.vertices * factor)
        image = drawn(Scene.from_meshes(camera, [], [made]), device)
        hit = channel(image, "id") == 0
        p = places(camera, image)
        d, n = directions(camera)[hit], channel(image, "normal")[hit]
        want = p[hit] / np.linalg.norm(p[hit], axis=1)[:, None]
        # At the limb, a normal may point away from the eye, and is turned.
        want *= np.where((want * d).sum(axis=1) > 0, -1, 1)[:, None]
        middle = np.linalg.norm(p[hit][:, :2], axis=1) < 0.9
        assert np.linalg.norm(n - want, axis=1)[middle].max() <= 1 / 30
        assert (n * d).sum(axis=1).max() <= 1e-6
        assert np.abs(np.linalg.norm(n, axis=1) - 1).max() <= 1e-6


def test_normals_that_are_nothing_or_opposite(device: Device) -> None:
    """Where the interpolated normal is 0, the face's own one is shown; nothing is NaN."""
    camera, solid = looking((0, 0, 4), NARROW, SIZE), box()
    flat = drawn(bare(camera, solid), device)
    for normals in (np.zeros((8, 3)), np.zeros((12, 3, 3))):
        made = Mesh(solid.vertices, solid.faces, normals=normals)
        image = drawn(Scene.from_meshes(camera, [point_light((1, 2, 3))], [made]), device)
        assert np.array_equal(image.normal, flat.normal)
        assert np.isfinite(image.color).all()
    wild = np.random.default_rng(0).choice([1.0, -1, 0], (12, 3, 3))
    image = drawn(
        Scene.from_meshes(camera, [point_light((1, 2, 3))], [Mesh(solid.vertices, solid.faces, wild)]), device
    )
    assert np.isfinite(image.color).all()
    assert np.isfinite(image.normal).all()


def test_deep_rooms_of_many_faces_by_the_tree(device: Device) -> None:
    """Mirrors and glass in a room of 1500 faces: with the tree or without, the same bits; none leaves the room."""
    camera = replace(looking((0.125, 0.25, 0.5), WIDE, (32, 24)), max_bounces=6)
    room = mesh(ball(3).moved(factor=4), material=glow((0.25, 0.5, 0), reflectance=0.5))
    glass = mesh(ball(2).moved((0, 0, -2), 0.75), material=glow((0, 0.25, 0.5), transmittance=0.75, index=1.5))
    brick = mesh(box((1, -1, -2), (1.5, 0.5, -1)), material=glow((0, 1, 0)))
    scene = Scene.from_meshes(camera, [ambient_light(WHITE)], [room, glass, brick], background=(1000, 0, 0))
    usual = drawn(scene, device)
    assert usual.color[..., 0].max() <= 1
    for keep in (("tree",), ("tree", "lists"), ("branches",)):
        same(usual, drawn(scene, device, keep=keep), keep)
