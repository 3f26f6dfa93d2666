"""Shadows of meshes: none where a face sees the lamp, no light where it does not, and no rays through seams."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hostile.sphere_scenes import directions, looking
from solids import (
    NARROW,
    WIDE,
    Row,
    Solid,
    Triangles,
    ball,
    box,
    corners_of,
    drawn,
    joined,
    lattice,
    mesh,
    needles,
    octahedron,
    places,
    sheet,
    sign,
    tetrahedron,
    unstopped,
)
from stress_cases import channel

from cltrace import Material, Scene, parallel_light, point_light
from cltrace.run.devices import Device

pytestmark = pytest.mark.slow

# --- shadows


def facing(solid: Solid, light: Row, parallel: bool) -> np.ndarray:
    """(f,): 1 where the light is before a face, 0 where it is in its plane, -1 where it is behind; exactly."""
    out = []
    for f in solid.faces:
        a, b, c = ([Fraction(float(x)) for x in p] for p in solid.vertices[f])
        e, g = ([y - x for x, y in zip(a, q, strict=True)] for q in (b, c))
        n = (e[1] * g[2] - e[2] * g[1], e[2] * g[0] - e[0] * g[2], e[0] * g[1] - e[1] * g[0])
        to = [-Fraction(float(x)) if parallel else Fraction(float(x)) - y for x, y in zip(light, a, strict=True)]
        out.append(sign(sum(x * y for x, y in zip(n, to, strict=True))))
    return np.array(out)


POINTS = [
    (0, 0, 4),
    (3, 2, 1),
    (0, 5, 0),
    (1, 4, 1),
    (-2, 1, 2),
    (1, 1, 2),
    (0.5, 0, 1e6),
    (1.001, 0.5, 0.25),
    (-7, 8, 9),
]
TRAVELS = [(0, 0, -1), (-1, -3, -2), (0, -1, 0), (1, -1, -1), (0, 0, 1), (1e-6, 0, -1), (0, -1, -1e-9)]
MATTE = Material(ka=0, kd=1, ks=0)


@pytest.mark.parametrize("place", ["here", "far", "tiny"])
def test_a_convex_solid_shadows_itself_where_it_turns_away_only(device: Device, place: str) -> None:
    far, k = {"here": (0.0, 1.0), "far": (2.0**23, 1.0), "tiny": (0.0, 2.0**-60)}[place]
    by = np.array([far, -far, far])
    for solid in (box(), octahedron(), tetrahedron(), ball(1), ball(2)):
        if place == "far" and len(solid.faces) > 12:
            continue  # It would no longer be convex, since its vertices are rounded.
        there = solid.moved(by, k)
        eye = np.array([1.5, 1.25, 4]) * k + by
        camera = looking(eye, 2 * NARROW, (48, 36))
        for light, parallel in [*((p, False) for p in POINTS), *((p, True) for p in TRAVELS)]:
            at = np.array(light) * (1 if parallel else k) + (0 if parallel else by)
            lamp = parallel_light(light) if parallel else point_light(at)
            image = drawn(Scene.from_meshes(camera, [lamp], [mesh(there, material=MATTE)]), device)
            side = facing(there, light if parallel else at, parallel)[image.primitive]
            hit, lit = image.id >= 0, image.color[..., 0] > 0
            assert hit.any()
            assert lit[hit & (side > 0)].all(), (light, "a shadow where there is none")
            assert not lit[hit & (side < 0)].any(), (light, "light from behind")
            assert image.color[hit & (side == 0)].max(initial=0) <= 1e-6
            assert (image.shadow_rays[hit & (side > 0)] == 1).all()
            assert (image.shadow_rays[hit & (side < 0)] == 0).all()


def closed_solids() -> list[Solid]:
    return [
        box(),
        octahedron(),
        tetrahedron(),
        ball(1),
        ball(2),
        box().unshared(),
        joined(box(), ball(2).moved(factor=2)),
    ]


def test_no_light_leaves_a_closed_mesh(device: Device) -> None:
    """A lamp inside lights nothing outside; what is around is a room and a ball."""
    camera = looking((0.5, 3, 9), WIDE, (48, 36))
    room = mesh(box((-8, -8, -8), (8, 8, 16)), material=MATTE)
    for solid in closed_solids():
        for light in ((0, 0, 0), (0.125, 0.25, -0.0625), (1 / 3, 0.1, 0.2), (0, 0.25, 0)):
            shade = mesh(solid, material=MATTE)
            scene = Scene.from_meshes(camera, [point_light(light)], [shade, room])
            image = drawn(scene, device)
            assert (image.id >= 0).all()
            assert (image.color == 0).all(), light


def test_no_light_enters_a_closed_mesh(device: Device) -> None:
    """Whether from a lamp or from the sun, through edges and vertices, too.

    In the sun along a face's plane, n.l is 0 but for rounding, and so is what it lights.
    """
    lamps = [point_light(p) for p in ((5, 5, 5), (0, 6, 0), (3, 2, 1), (1.5, 3, 0.25))]
    suns = [parallel_light(d) for d in ((-1, -1, -2), (1, 2, 3.5), (1e-9, -1, 1e-3))]
    along = [parallel_light(d) for d in ((0, -1, 0), (-1, 1, 0), (-1, -1, 0))]
    camera = looking((0.125, 0.0625, 0.25), WIDE, (40, 30))
    for solid in closed_solids():
        for lights, most in (([*lamps, *suns], 0.0), (along, 1e-6)):
            image = drawn(Scene.from_meshes(camera, lights, [mesh(solid, material=MATTE)]), device)
            assert (image.id >= 0).all()
            assert image.color.max() <= most


def test_every_wall_of_a_room_sees_the_lamp(device: Device) -> None:
    """In a convex room nothing shadows anything, not even next to the edges."""
    for solid in (box(), octahedron().moved(factor=2), tetrahedron().moved(factor=3), ball(1).moved(factor=2)):
        for eye, light in itertools.product(
            ((0, 0, 0), (0.125, 0.25, 0.375)), ((0, 0, 0), (0.25, 0.25, 0.25), (0.1, 0.3, -0.2))
        ):
            camera = looking(eye, WIDE, (48, 36))
            image = drawn(Scene.from_meshes(camera, [point_light(light)], [mesh(solid, material=MATTE)]), device)
            assert (image.color[..., 0] > 0).all(), (eye, light)


def check_shadows(scene: Scene, device: Device, step: int = 3) -> tuple[int, int]:
    """Some pixels against exact arithmetic: how many are lit, and how many are shadowed. The light is a point."""
    image = drawn(scene, device)
    corners, surfaces, _ = corners_of(scene)
    light, eye = scene.lights[0]["position"].tolist(), [Fraction(x) for x in scene.camera.position]
    first = {int(s): int(np.flatnonzero(surfaces == s)[0]) for s in np.unique(surfaces)}
    lit = shadowed = 0
    w = directions(scene.camera)
    triangles, lamp = Triangles(corners, scene.camera.position), Triangles(corners, light)
    for i in range(0, len(w), step):
        surface, number = int(channel(image, "id")[i]), int(channel(image, "primitive")[i])
        if surface < 0:
            continue
        own = first[surface] + number
        d = [Fraction(x) for x in w[i].tolist()]
        t = triangles.t(own, d)
        p = [o + t * x for o, x in zip(eye, d, strict=True)]
        N = triangles.normal(own)
        before, toward = (sum(n * x for n, x in zip(N, v, strict=True)) for v in
                          (d, [Fraction(y) - x for y, x in zip(light, p, strict=True)]))  # fmt: skip
        free = unstopped(lamp, p, own)
        bright = float(channel(image, "color")[i].max())
        if before * toward >= 0:  # The light is on the other side, or in the plane.
            assert bright <= 1e-6, i
        elif free is not None:
            assert (bright > 0) == free, (i, free)
            lit, shadowed = lit + free, shadowed + (not free)
    return lit, shadowed


@pytest.mark.parametrize(
    "light", [(1, 1, 1), (0, 1, 1), (1, 0, 0.5), (0, 2, 1), (3, 1, 1), (1, 1, 3), (0, 0, 0), (-1.5, 1, 3)]
)
def test_lamps_on_vertices_and_edges_and_in_planes(device: Device, light: Row) -> None:
    """A triangle in whose plane the lamp is stops no ray of it. A lamp inside of the box is there, too."""
    camera = looking((0.5, 1, 6), 1, (40, 30))
    floor, pillar = box((-4, -3, -4), (4, -2, 4)), box((-2, -2, 0), (-1.5, 2, 0.5))
    scene = Scene.from_meshes(camera, [point_light(light)], [mesh(s, material=MATTE) for s in (box(), floor, pillar)])
    lit, shadowed = check_shadows(scene, device)
    assert (lit == 0) == (light == (0, 0, 0))
    assert lit + shadowed > 30


def test_shadows_of_soups(device: Device) -> None:
    for seed in range(3):
        camera = looking((0.5, 0.25, 7), 2 * NARROW, (40, 30))
        solids = [lattice(seed, 3, 60), needles(seed).moved(factor=2)]
        scene = Scene.from_meshes(camera, [point_light((3, 2, 4))], [mesh(s, material=MATTE) for s in solids])
        lit, shadowed = check_shadows(scene, device, 5)
        assert lit > 5
        assert shadowed > 5


def test_balls_at_rest_on_a_mesh(device: Device) -> None:
    """A ball that touches a floor shadows an ellipse, and the floor takes no light from the ball's lower half.

    The sun is in direction s = (1, 2, 0) / sqrt(5), the ball about (0, 1, 0) has radius 1: p on the floor is in its
    shadow iff the distance of the line p + k s to the centre is below 1.
    """
    camera = looking((0.25, 3, 6), 2 * NARROW, (64, 48))
    for solid in (box((-8, -1, -8), (8, 0, 8)), flat_floor(8)):
        meshes = [mesh(solid, material=MATTE)]
        scene = Scene.from_spheres(
            camera, [parallel_light((-1, -2, 0))], [(0, 1, 0)], [1], ka=0, kd=1, ks=0, meshes=meshes
        )
        image = drawn(scene, device)
        p = places(camera, image)
        lit, who = channel(image, "color")[:, 0] > 0, channel(image, "id")
        sun, f = np.array([1, 2, 0]) / np.sqrt(5), np.array([0, 1, 0]) - p
        away = np.linalg.norm(f - (f @ sun)[:, None] * sun, axis=1)
        sure, top = np.abs(away - 1) > 1e-6, np.abs(p[:, 1]) < 1e-9
        floor = (who == 1) & top & sure
        assert floor.sum() > 300
        assert np.array_equal(lit[floor], away[floor] > 1)
        n = p - (0, 1, 0)
        towards = n @ sun
        ball_ = (who == 0) & (np.abs(towards) > 1e-6)
        assert ball_.sum() > 100
        assert np.array_equal(lit[ball_], towards[ball_] > 0)


def flat_floor(half: int) -> Solid:
    """Squares of side 1 in the plane y = 0."""
    line = np.arange(-half, half + 1.0)
    flat = sheet(line, line, np.zeros((len(line), len(line))))
    return Solid(flat.vertices[:, [0, 2, 1]], flat.faces)


def test_balls_that_walls_cut(device: Device) -> None:
    """The nearer one of both is seen, and a wall through the middle of a lamp's ball stops its light."""
    camera = looking((0.125, 0.25, 4), NARROW * 2, (64, 48))
    centers, radii = [(-0.75, 0, 0), (0.75, 0.25, 0.25), (0, -0.5, -1)], [0.5, 0.75, 1.0]
    wall = box((-2, -2, -4), (2, 2, 0))
    scene = Scene.from_spheres(camera, [], centers, radii, meshes=[mesh(wall)])
    image = drawn(scene, device)
    w, eye = directions(camera), np.array(camera.position)
    t = [sphere_t(eye, w, np.array(c), r) for c, r in zip(centers, radii, strict=True)]
    reach = eye + 4 * w
    t.append(np.where((np.abs(reach[:, :2]) <= 2).all(axis=1), 4.0, np.inf))
    order = np.sort(np.array(t), axis=0)
    with np.errstate(invalid="ignore"):
        sure = ~(order[1] - order[0] < 1e-9)
    want = np.where(np.isfinite(order[0]), np.argmin(t, axis=0), -1)
    assert np.array_equal(channel(image, "id")[sure], want[sure])
    assert np.array_equal(channel(image, "primitive")[sure] >= 0, want[sure] == 3)
    assert {0, 1, 3} <= set(want.tolist())


def sphere_t(eye: np.ndarray, w: np.ndarray, center: np.ndarray, radius: float) -> np.ndarray:
    """Where rays enter a sphere; inf for never."""
    f = center - eye
    a, b, c = (w * w).sum(axis=1), w @ f, f @ f - radius**2
    D = b * b - a * c
    return np.where(D >= 0, (b - np.sqrt(np.maximum(D, 0))) / a, np.inf)
