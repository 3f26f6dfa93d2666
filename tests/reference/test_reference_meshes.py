"""The reference's triangles and textures, against rational arithmetic and answers that can be derived by hand."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import judge
import mpmath
import numpy as np
import pytest
from small_meshes import doubles_mesh, grid_mesh

from cltrace import Camera, Material, Mesh, Scene, ambient_light, parallel_light, point_light
from cltrace.reference import (
    EYE,
    Direction,
    Intersection,
    Point,
    Ray,
    ShadowRay,
    Sphere,
    Start,
    Texture,
    TriangleMesh,
    World,
    world_of,
)
from cltrace.reference.bounce import bounces
from cltrace.reference.trace import closest_hit, primary_ray, trace

AXES = Camera((0, 0, 0), (0, 0, -1), resolution=(1, 1))


def scene_of(*meshes: Mesh, camera: Camera = AXES, lights: tuple = ()) -> Scene:
    return Scene.from_meshes(camera, lights, meshes)


def mesh_of(world: World) -> TriangleMesh:
    return next(surface for surface in world.surfaces if isinstance(surface, TriangleMesh))


def ball_of(world: World, i: int = 0) -> Sphere:
    return [surface for surface in world.surfaces if isinstance(surface, Sphere)][i]


def starts_of(world: World, rng: np.random.Generator) -> Start:
    """A point of some triangle of the first mesh: often on an edge or a corner."""
    mesh = mesh_of(world)
    u, v = rng.choice([0.0, 0.25, 0.5, float(rng.uniform(0, 0.5))], 2).tolist()
    return mesh.triangle(int(rng.integers(len(mesh.of.geometry.faces)))).start(int(rng.integers(3)), u, v)


def own_of(start: Start) -> tuple[int, int]:
    """The number of the triangle on which a start is."""
    return start.surface.number, start.surface.primitive


@mpmath.workdps(judge.DIGITS)
def place_of(surfaces: list[judge.Named], start: Start) -> judge.Vector:
    """The point in the world, exactly."""
    corner, u, v = start.on
    flat = next(one[2] for one in surfaces if one[:2] == own_of(start))
    assert isinstance(flat, judge.Flat)
    V, V1, V2 = (judge.vector(flat.corners[(corner + i) % 3]) for i in range(3))
    return [p + u * (q - p) + v * (r - p) for p, q, r in zip(V, V1, V2, strict=True)]


def compare(
    surfaces: list[judge.Named], world: World, ray: Ray, origin: judge.Vector, own: tuple[int, int] | None = None
) -> bool:
    """Whether a ray meets something, after it has been seen to meet the right thing at the right t."""
    others, got = [one for one in surfaces if one[:2] != own], closest_hit(world, ray)
    index, t = judge.first([one[2] for one in others], origin, judge.in_world(world, ray.direction))
    assert ((got.index, got.primitive) if got else (-1, -1)) == (others[index][:2] if index >= 0 else (-1, -1))
    assert got is None or abs(got.t - t) <= t * 2.0**-24
    return got is not None


WAYS = [Direction(*map(float, d)) for d in itertools.product((-2, -1, 0, 1, 2), repeat=3) if any(d)]


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 8))])
def test_rays_among_whole_numbers(seed: int) -> None:
    """At corners, at edges, along edges, in planes, from the eye and from triangles."""
    rng = np.random.default_rng(seed)
    eye = tuple(rng.integers(-3, 4, 3).astype(float) / rng.choice([1, 2]))
    camera = Camera(eye, (eye[0], eye[1], eye[2] - 1), resolution=(1, 1))
    scene = scene_of(grid_mesh(rng), grid_mesh(rng, 6), camera=camera)
    world, surfaces = world_of(scene), judge.surfaces_of(scene)
    for i in rng.choice(len(WAYS), 30, replace=False):
        compare(surfaces, world, Ray(EYE, WAYS[i]), eye)
        start = starts_of(world, rng)
        compare(surfaces, world, Ray(start, WAYS[i]), place_of(surfaces, start), own_of(start))


@pytest.mark.parametrize("offset", [0.0, 1e7])
@pytest.mark.parametrize("seed", range(4))
def test_rays_among_doubles(seed: int, offset: float) -> None:
    """From the eye and from triangles, at points of edges and at corners but for rounding, before any camera."""
    rng = np.random.default_rng(seed)
    mesh = doubles_mesh(rng, offset)
    vertices = mesh.geometry.vertices
    eye = vertices[8] + rng.normal(size=3)
    camera = Camera(tuple(eye), tuple(eye + rng.normal(size=3)), tuple(rng.normal(size=3)), resolution=(1, 1))
    scene = scene_of(mesh, camera=camera)
    world, surfaces, basis, met = world_of(scene), judge.surfaces_of(scene), np.array(camera.basis()), 0
    for _ in range(40):
        a, b = vertices[rng.integers(len(vertices), size=2)]
        at = a + (b - a) * rng.choice([0, 0.5, rng.random()])
        start = starts_of(world, rng)
        own, place = own_of(start), place_of(surfaces, start)
        d = Direction(*(basis @ (at - eye)).tolist())
        met += compare(surfaces, world, Ray(EYE, d), eye)
        along = basis @ (at - np.array([float(x) for x in place]))
        if along.any():
            compare(surfaces, world, Ray(start, Direction(*along.tolist())), place, own)
    assert met > 10


@pytest.mark.parametrize(
    ("z", "t_min", "t_max", "t"),
    [
        (3, 0, math.inf, 10),
        (3, 0, 10, None),
        (3, 0, 10.5, 10),
        (3, 10, math.inf, None),
        (3, 9.5, 11, 10),
        (-3, -5, 5, -2),  # behind the start
    ],
)
def test_a_ray_may_start_anywhere_and_count_anywhere(z: float, t_min: float, t_max: float, t: float | None) -> None:
    mesh = Mesh([(0, 0, -2), (2, 0, -2), (0, 2, -2)], [(0, 1, 2)])
    at = closest_hit(world_of(scene_of(mesh)), Ray(Point(0.5, 0.5, z), Direction(0, 0, -0.5), t_min, t_max))
    assert (at and (at.t, at.distance, at.primitive, at.point)) == (t and (t, t / 2, 0, Point(0.5, 0.5, -2)))


# --------------------------------------------------------------------------------------------------------- from spheres

PYTHAGORAS = [(3, 4, 0), (0, -3, 4), (1, 2, 2), (2, -1, 2), (-2, 3, 6), (0, 0, -1), (6, 2, -3), (-4, 0, 3)]


@pytest.mark.parametrize("seed", range(4))
def test_rays_from_spheres(seed: int) -> None:
    """Whose points are rational: triangles through them, and through what the ray aims at."""
    rng = np.random.default_rng(seed)
    camera = Camera((0.5, 0.25, 8), (0.5, 0.25, 0), resolution=(1, 1))
    flat, center, radius = (
        scene_of(grid_mesh(rng), camera=camera),
        rng.integers(-2, 3, 3),
        float(rng.choice([5, 3, 7, 1])),
    )
    sphere = ball_of(world_of(Scene.from_spheres(camera, (), [center], [radius])))
    world, surfaces = world_of(flat), judge.surfaces_of(flat)
    for n in PYTHAGORAS:
        start, place = sphere.start(Direction(*n)), judge.Ball(center, radius).point(n)
        for i in rng.choice(len(WAYS), 2, replace=False):
            compare(surfaces, world, Ray(start, WAYS[i]), place)


# -------------------------------------------------------------------------------------------------- what is at a point


def seen(scene: Scene, u: int = 0, v: int = 0) -> Intersection:
    at = closest_hit(world_of(scene), primary_ray(scene.camera, u, v))
    assert at is not None
    return at


WALL = [(-1, -1, -2), (3, -1, -2), (-1, 3, -2)]  # before AXES, whose ray meets it at weights 1/2, 1/4, 1/4


def test_at_a_point_of_a_triangle() -> None:
    at = seen(scene_of(Mesh(WALL, [(0, 1, 2)], uv=[(0, 0), (4, 0), (0, 8)])))
    assert (at.t, at.distance, at.inside, at.uv) == (2, 2, False, (1, 2))
    assert at.normal == at.outward == Direction(0, 0, 1)
    start = at.start
    assert start.on == (0, 0.25, 0.25)
    assert start.point == at.point == Point(0, 0, -2)
    assert start.exact_point.fractions() == (0, 0, -2)
    assert start.height(Point(5, 6, 1), at.outward) == 3


@pytest.mark.parametrize("turn", range(3))
def test_the_corner_of_the_largest_weight_is_the_anchor(turn: int) -> None:
    corners = [(0, 1, 2), (1, 2, 0), (2, 0, 1)][turn]
    start = seen(scene_of(Mesh([(-1, -1, -2), (3, -1, -2), (-1, 2.5, -2)], [corners]))).start
    assert start.place == Point(-1, -1, -2)
    assert start.on == (-turn % 3, 0.25, pytest.approx(2 / 7))


@pytest.mark.parametrize("reach", [1e7, 1e10])
def test_points_of_narrow_triangles_are_on_their_rays(reach: float) -> None:
    """Found with a corner at 1e22: in doubles the weights were off by more than the picture is wide."""
    mesh = Mesh([(-1.5, reach, 0), (1.5, -1, 0.4), (-1.5, 1, -0.75)], [(0, 1, 2)])
    camera = Camera((0.4, 0.5, 6), (0, 1, 0), horizontal_fov=20, resolution=(24, 16))
    world, met = world_of(scene_of(mesh, camera=camera)), 0
    for u, v in itertools.product(range(24), range(16)):
        at = closest_hit(world, primary_ray(camera, u, v))
        if at is not None:
            off = at.start.point - at.point
            assert off.dot(off) < (1e-6 * at.t) ** 2
            met += 1
    assert met > 10


def test_outside_is_where_the_normals_point_to() -> None:
    away, towards = (0, 0, -3), (0.5, 0, 4)
    for faces, normals, inside in (
        ([(0, 1, 2)], None, False),
        ([(0, 2, 1)], None, True),
        ([(0, 1, 2)], [towards] * 3, False),
        ([(0, 2, 1)], [towards] * 3, False),
        ([(0, 1, 2)], [away] * 3, True),
        ([(0, 1, 2)], [towards, away, away], True),
        ([(0, 2, 1)], [(1, 0, 0)] * 3, True),
        # The sum of the normals points away: the shading normal is on the other side of the triangle than the ray's.
        ([(0, 1, 2)], [(3, 0, -0.1)] * 3, True),
    ):
        at = seen(scene_of(Mesh(WALL, faces, normals=normals)))
        assert at.inside is inside, (faces, normals)
        assert at.side == (-1 if inside else 1)
        assert at.normal.z >= 0
        assert at.outward == (-at.normal if inside else at.normal)


def test_normals_are_interpolated_and_turned_as_normals_are() -> None:
    normals = [(0, 0, 1), (4, 0, 0), (0, 0, 1)]
    at = seen(scene_of(Mesh(WALL, [(0, 1, 2)], normals=normals)))
    assert tuple(at.normal) == pytest.approx((0.8, 0, 0.6))
    # Twice as wide, and the mirror image: normals are half as wide.
    at = seen(scene_of(Mesh([(x / -2, y, z) for x, y, z in WALL], [(0, 1, 2)], normals=normals,
                            transform=np.diag((-2, 1, 1)))))  # fmt: skip
    assert tuple(at.normal) == pytest.approx(np.array([-1 / 2, 0, 0.75]) / math.hypot(0.5, 0.75))
    assert not at.inside
    # Those that add up to nothing say nothing.
    at = seen(scene_of(Mesh(WALL, [(0, 1, 2)], normals=[(0, 1, 0), (0, -1, 0), (0, -1, 0)])))
    assert at.normal == Direction(0, 0, 1)


CHECKS = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)]], np.uint8)


def test_a_texture_is_interpolated_and_repeats() -> None:
    texture = Texture(CHECKS)
    for i, j in itertools.product((-4, -2, 0, 2), repeat=2):
        assert texture.lookup((i / 2, j / 2)).color == (1, 0, 0)
        assert texture.lookup(((i + 1) / 2, j / 2)).color == (0, 1, 0)
        assert texture.lookup((i / 2, (j + 1) / 2)).color == (0, 0, 1)
    assert texture.lookup((0.25, 0)).color == texture.lookup((0.75, 0)).color == (0.5, 0.5, 0)
    assert texture.lookup((0, 0.125)).color == (0.75, 0, 0.25)
    assert texture.lookup((0.25, -0.25)).color == (0.5, 0.5, 0.5)
    assert Texture(np.full((1, 1, 3), 32768, np.uint16)).lookup((0.3, -7)).color == (32768 / 65535,) * 3


def test_a_textured_surface_has_the_product_of_both_colours() -> None:
    material = Material((1, 0.5, 0.25), ka=1, texture=CHECKS)
    mesh = Mesh(WALL, [(0, 1, 2)], uv=[(0.25, 0)] * 3, material=material)
    color, at = trace(world_of(scene_of(mesh, lights=ambient_light((1, 1, 1)))), Ray(EYE, Direction(0, 0, -1)))
    assert color == (0.5, 0.25, 0)
    assert at is not None
    assert at.uv == (0.25, 0)
    bare = seen(scene_of(Mesh(WALL, [(0, 1, 2)], material=material)))
    assert (bare.uv, bare.color) == ((0, 0), (1, 0, 0))


def test_where_a_texture_is_on_a_sphere() -> None:
    ball = ball_of(world_of(Scene.from_spheres(AXES, (), [(0, 0, 0)], [1])))
    for origin, uv in (
        (Point(0, 0, 3), (0.5, 0.5)),
        (Point(3, 0, 0), (0.75, 0.5)),
        (Point(-3, 0, 0), (0.25, 0.5)),
        (Point(0, 3, 0), (None, 0)),
        (Point(0, -3, 0), (None, 1)),
    ):
        ray = Ray(origin, EYE - origin)
        t = ball.intersect(ray)
        assert t is not None
        for got, want in zip(ball.intersection_at(ray, t).uv, uv, strict=True):
            assert want is None or got == pytest.approx(want, abs=1e-15)


def test_a_needle_without_a_normal_in_doubles_has_one() -> None:
    """Its edges' cross product vanishes by rounding."""
    e = 2.0**-52
    mesh = Mesh([(0, 0, -2), (1 + e, 1, -2), (1 + 2 * e, 1 + e, -2)], [(0, 1, 2)])
    needle = mesh_of(world_of(scene_of(mesh))).triangle(0)
    assert Direction(0, 0, 0) == needle.N
    assert needle.exact.normal != (0, 0, 0)
    assert abs(needle.normal((1, 0, 0)).z) == 1


# ---------------------------------------------------------------------------------------------------- order and numbers


def test_of_equal_distances_the_lowest_surface_and_then_triangle_is_met() -> None:
    twice = Mesh(WALL, [(0, 2, 1), (0, 1, 2)])
    at = seen(scene_of(Mesh([(0, 0, -1), (1, 0, -1), (0, 0, -1)], [(0, 1, 2)]), twice, twice))
    assert (at.index, at.primitive) == (1, 0)
    ball = Scene.from_spheres(AXES, (), [(0, 0, -3)], [1], meshes=[twice])
    assert (seen(ball).index, seen(ball).primitive) == (0, -1)
    first, *_ = ball.meshes
    shapes = ball.spheres, ball.materials
    behind = Scene(AXES, (), *shapes, meshes=[replace(first, number=0)])
    assert (seen(behind).index, seen(behind).primitive) == (0, 0)
    assert world_of(behind).surfaces[1].number == 1


def test_a_fan_owns_each_ray_once() -> None:
    """Around a corner, and along its spokes: whatever the order of the corners, and however they are listed."""
    rim = [(4, 0), (3, 3), (0, 4), (-2, 2), (-4, 0), (-3, -3), (0, -4), (2, -2)]
    vertices = [(0, 0, -4), *((2 * x, 2 * y, -4) for x, y in rim)]
    rng = np.random.default_rng(1)
    for _ in range(8):
        faces = [rng.permutation([0, i + 1, (i + 1) % 8 + 1]) for i in range(8)]
        mesh = mesh_of(world_of(scene_of(Mesh(vertices, faces))))
        for x, y in itertools.product(range(-4, 5), repeat=2):
            ray = Ray(EYE, Direction(x / 2, y / 2, -4))
            owners = [i for i in range(8) if mesh.triangle(i).intersect(ray) is not None]
            assert len(owners) == 1
        ray = Ray(EYE, Direction(0, 0, -1))
        assert sum(mesh.triangle(i).intersect(ray) is not None for i in range(8)) == 1


# --------------------------------------------------------------------------------------------------------------- light

FLOOR = [(-8, 0, -8), (8, 0, -8), (8, 0, 8), (-8, 0, 8)]
QUAD = [(0, 1, 2), (0, 2, 3)]
LAMP = point_light((0, 4, 0))
ABOVE = Camera((0, 6, 0), (0, 0, 0), (0, 0, -1), resolution=(9, 9), horizontal_fov=45)


def lit(scene: Scene) -> list[str]:
    world, width = world_of(scene), scene.camera.resolution[0]
    rows = []
    for v in range(scene.camera.resolution[1]):
        colors = [trace(world, primary_ray(scene.camera, u, v))[0] for u in range(width)]
        rows.append("".join("#" if any(color) else "." for color in colors))
    return rows


def test_a_floor_does_not_shade_itself_and_a_lid_does() -> None:
    """Of two triangles whose common edge, and corner, half of the rays meet; the lid is 2 x 2 half way up."""
    assert lit(scene_of(Mesh(FLOOR, QUAD), camera=ABOVE, lights=LAMP)) == ["#" * 9] * 9
    assert lit(scene_of(Mesh(FLOOR, QUAD), camera=ABOVE, lights=parallel_light((0, -1, 0)))) == ["#" * 9] * 9
    assert lit(scene_of(Mesh(FLOOR, QUAD), camera=ABOVE, lights=parallel_light((0, 1, 0)))) == ["." * 9] * 9
    lid = Mesh([(-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)], QUAD)
    above = Camera((0, 1.5, 0), (0, 0, 0), (0, 0, -1), resolution=(9, 9), horizontal_fov=60)
    for light in (point_light((0, 4, 0)), parallel_light((0, -1, 0))):
        size = 2 if light["kind"] == point_light((0, 0, 0))["kind"] else 1
        want = []
        for v in range(9):
            ray = [primary_ray(above, u, v).direction for u in range(9)]
            want.append("".join("." if max(abs(d.x), abs(d.y)) * 1.5 < size else "#" for d in ray))
        assert lit(scene_of(lid, Mesh(FLOOR, QUAD), camera=above, lights=light)) == want


def test_what_is_behind_a_light_or_touches_the_point_does_not_stop_it() -> None:
    lid, camera = [(-9, 5, -9), (9, 5, -9), (9, 5, 9), (-9, 5, 9)], replace(ABOVE, position=(0, 3, 0))
    assert lit(scene_of(Mesh(FLOOR, QUAD), Mesh(lid, QUAD), camera=camera, lights=LAMP)) == ["#" * 9] * 9
    # The light is in the lid's plane, and so in its own light.
    level = [(x, 4, z) for x, _, z in lid]
    assert lit(scene_of(Mesh(FLOOR, QUAD), Mesh(level, QUAD), camera=camera, lights=LAMP)) == ["#" * 9] * 9
    # The floor twice, and once more the other way round.
    again = [Mesh(FLOOR, QUAD), Mesh(FLOOR, QUAD), Mesh(FLOOR[::-1], QUAD)]
    assert lit(scene_of(*again, camera=ABOVE, lights=LAMP)) == ["#" * 9] * 9


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_shadows_among_whole_numbers(seed: int) -> None:
    """At corners, along edges, in planes: from points of triangles and of spheres."""
    rng = np.random.default_rng(seed)
    camera = Camera((0.5, 0.25, 8), (0.5, 0.25, 0), resolution=(1, 1))
    center, sites, ways = rng.integers(-2, 3, 3), rng.integers(-3, 4, (4, 3)), rng.choice([-2, -1, 0, 1, 2], (4, 3))
    ways[~ways.any(axis=1)] = (0, 0, 1)
    lights = (*map(point_light, sites), *map(parallel_light, ways))
    scene = Scene.from_spheres(camera, lights, [center], [5.0], meshes=[grid_mesh(rng)])
    world, surfaces = world_of(scene), judge.surfaces_of(scene)[1:]
    ball, mesh, blocked = ball_of(world), mesh_of(world), 0
    for k in range(12):
        n = PYTHAGORAS[k % 8]
        leaf = mesh.triangle(int(rng.integers(12))).start(int(rng.integers(3)), *rng.choice([0, 0.25, 0.5], 2).tolist())
        places = (leaf, place_of(surfaces, leaf)), (ball.start(Direction(*n)), judge.Ball(center, 5.0).point(n))
        for start, place in places:
            for i, light in enumerate((*sites, *ways)):
                ray = ShadowRay(start, False, world.lights[i])
                want = {
                    j for _, j, flat in surfaces
                    if j != start.surface.primitive and judge.between([flat], place, light, parallel=i >= 4)
                }  # fmt: skip
                assert {j for j in range(12) if mesh.triangle(j).blocks(ray)} == want
                assert {part.primitive for part in mesh.parts(ray) if part.blocks(ray)} == want
                blocked += len(want)
    assert blocked > 10


# ---------------------------------------------------------------------------------------------------- mirrors and glass


def test_glass_walls_know_their_sides() -> None:
    """A slab of glass shifts what is behind it; entered at a corner of its triangles, too."""
    low, high = (-4, -4, -3), (4, 4, -2)
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    glass = Mesh(corners, faces, material=Material(transmittance=1, index=1.5))
    world = world_of(scene_of(glass))
    for d in (Direction(0, 0, -1), Direction(0.5, 0, -1), Direction(0.25, 0.25, -1)):
        at = closest_hit(world, Ray(EYE, d))
        assert at is not None
        assert (at.point.z, at.inside) == (-2, False)
        first = next(iter(bounces(Ray(EYE, d), at)))
        inner, weight = first.direction, first.share
        assert weight == 1
        assert inner.normalized().x == pytest.approx(d.normalized().x / 1.5)
        there = closest_hit(world, Ray(at.start, inner))
        assert there is not None
        assert (there.point.z, there.inside) == (pytest.approx(-3), True)
        outer = next(iter(bounces(Ray(at.start, inner), there))).direction
        assert tuple(outer.normalized()) == pytest.approx(tuple(d.normalized()))
        assert closest_hit(world, Ray(there.start, outer)) is None
