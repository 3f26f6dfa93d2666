"""The reference against answers that can be derived by hand."""

from __future__ import annotations

import dataclasses
import math

import judge
import numpy as np
import pytest
from hostile import bounced_regimes

import cltrace
from cltrace import Camera, Scene
from cltrace.oracle.search import Kinds
from cltrace.oracle.shapes import Spheres
from cltrace.reference import (
    EYE,
    Direction,
    Intersection,
    Point,
    Ray,
    ShadowRay,
    Sphere,
    World,
    byte_of,
    mirrored,
    refracted,
    world_of,
)
from cltrace.reference.spheres import surely_blocks
from cltrace.reference.trace import cast_shadow_ray, closest_hit, primary_ray, trace

AHEAD = Ray(EYE, Direction(0, 0, -1))


def scene_of(*spheres: tuple[float, float, float, float], lights: tuple = (), **options: object) -> Scene:
    """Spheres (x, y, z, r) before a camera at the origin that looks along -z; the picture is one pixel."""
    camera = Camera(resolution=(1, 1))
    data = np.array(spheres, float).reshape(-1, 4)
    return Scene.from_spheres(camera, lights, data[:, :3], data[:, 3], **options)  # type: ignore[arg-type]


def balls_of(world: World) -> list[Sphere]:
    return [surface for surface in world.surfaces if isinstance(surface, Sphere)]


def hit(ray: Ray, *spheres: tuple[float, float, float, float]) -> Intersection | None:
    return closest_hit(world_of(scene_of(*spheres)), ray)


BALL, FAR = (0, 0, -5, 2), (0, math.nextafter(1, 2), -5, 1)
FRONT, SIDE = Direction(0, 0, 1), Direction(1, 0, 0)


@pytest.mark.parametrize(
    ("ray", "spheres", "want"),
    [
        (AHEAD, [BALL], (3, 3, False, FRONT)),
        # The distance is in scene units, however long the direction is.
        (Ray(EYE, Direction(0, 0, -0.25)), [BALL], (12, 3, False, FRONT)),
        # Ends of the range do not count; behind t_min, the far end is hit from inside.
        (Ray(EYE, AHEAD.direction, t_max=3), [BALL], None),
        (Ray(EYE, AHEAD.direction, t_max=3.5), [BALL], (3, 3, False, FRONT)),
        (Ray(EYE, AHEAD.direction, t_min=3, t_max=7), [BALL], None),
        (Ray(EYE, AHEAD.direction, t_min=4), [BALL], (7, 7, True, FRONT)),
        # From anywhere.
        (Ray(Point(1000, 0, -5), Direction(-1, 0, 0)), [BALL], (998, 998, False, SIDE)),
        (Ray(Point(0, 0, -5), Direction(0, 3, 4)), [BALL], (0.4, 2, True, Direction(0, -0.6, -0.8))),
        (Ray(Point(1000, 0, -5), Direction(1, 0, 0)), [BALL], None),
        (Ray(Point(1000, 0, -5), Direction(0, 0, 0)), [BALL], None),
        # Touching is one hit.
        (AHEAD, [(0, 1, -5, 1)], (5, 5, False, Direction(0, -1, 0))),
        (AHEAD, [FAR], None),
        (AHEAD, [(0, 0, 5, 2)], None),  # behind
        # From inside the far wall is hit, and its normal faces the ray.
        (AHEAD, [(0, 0, 0.5, 2)], (1.5, 1.5, True, FRONT)),
        (AHEAD, [(0, 0, 0, 3)], (3, 3, True, FRONT)),
        # From the surface, only the way through the inside hits.
        (AHEAD, [(0, 0, -1, 1)], (2, 2, True, FRONT)),
        (AHEAD, [(0, 0, 1, 1)], None),
        (AHEAD, [(0, 1, 0, 1)], None),
    ],
)
def test_what_a_ray_meets(
    ray: Ray,
    spheres: list[tuple[float, float, float, float]],
    want: tuple[float, float, bool, Direction] | None,
) -> None:
    at = hit(ray, *spheres)
    assert (at is None) == (want is None)
    if at and want:
        assert (at.t, at.distance, at.inside) == want[:3]
        assert tuple(at.normal) == pytest.approx(tuple(want[3]), abs=1e-15)
        assert at.point == ray.at(at.t)


def test_of_equal_distances_the_lowest_index_wins() -> None:
    at = hit(AHEAD, (0, 0, -9, 1), (0, 0, -5, 2), (0, 0, -5, 2), (0, 0, -4, 1))
    assert at is not None
    assert at.index == 1


def test_head_on_phong() -> None:
    """Light, eye and normal in line: n.l = r.v = 1, so every term has its full weight."""
    scene = scene_of(
        (0, 0, -5, 2),
        lights=(cltrace.ambient_light((0.5, 0.5, 0.5)), cltrace.point_light((0, 0, 0), (0.5, 1, 1))),
        colors=(0.2, 0.4, 0.6),
        ka=0.5,
        kd=0.25,
        ks=0.125,
    )
    color, _ = trace(world_of(scene), AHEAD)
    assert color == pytest.approx((0.05 + 0.5 * (0.05 + 0.125), 0.1 + 0.1 + 0.125, 0.15 + 0.15 + 0.125), abs=1e-15)


@pytest.mark.parametrize(
    ("degrees", "material", "want"),
    [
        (60, {"kd": 1, "ks": 1, "exponent": 2}, 0.75),  # n.l = r.v = 1/2
        (120, {"kd": 1, "ks": 1}, 0),  # from behind the surface
        # An exponent of 0 is the full highlight even where r.v is not positive.
        (math.degrees(1.2), {"kd": 0, "ks": 0.5, "exponent": 0}, 0.5),
    ],
)
def test_light_at_an_angle(degrees: float, material: dict[str, float], want: float) -> None:
    """A parallel light so far off the normal."""
    direction = (-math.sin(math.radians(degrees)), 0, -math.cos(math.radians(degrees)))
    scene = scene_of(BALL, lights=(cltrace.parallel_light(direction),), ka=0, **material)
    assert trace(world_of(scene), AHEAD)[0] == pytest.approx((want,) * 3, abs=1e-15)


@pytest.mark.parametrize("alpha1", [20, 25])
@pytest.mark.parametrize("degrees", [0, 5, 19.9, 22.5, 24.9, 25.1, 90, 180])
def test_spot_falls_off_linearly_in_the_angle(degrees: float, alpha1: float) -> None:
    """The light sits at the eye, the spot's axis turns away from the point."""
    angle = math.radians(degrees)
    light = cltrace.spot_light((0, 0, 0), (math.sin(angle), 0, -math.cos(angle)), alpha1, 25)
    scene = scene_of((0, 0, -5, 2), lights=(light,), ka=0, kd=1, ks=0)
    share = min(1.0, max(0.0, (25 - degrees) / (25 - alpha1))) if alpha1 < 25 else float(degrees < 25)
    assert trace(world_of(scene), AHEAD)[0] == pytest.approx((share,) * 3, abs=1e-14)


@pytest.mark.parametrize("stretch", [(1, 1, 1), (2, 1, 4)])
@pytest.mark.parametrize(
    ("name", "light", "others", "shadowed"),
    [
        ("nothing between", (0, 0, 5), [], False),
        ("between", (0, 9, -3), [(0, 3, -3, 1)], True),
        ("touching", (0, 9, -3), [(1, 3, -3, 1)], True),
        ("a little beside", (0, 9, -3), [(1 + 2**-52, 3, -3, 1)], False),
        ("behind the light", (0, 2, -3), [(0, 5, -3, 1)], False),
        ("light just before the occluder", (0, 2 - 2**-51, -3), [(0, 3, -3, 1)], False),
        ("light on the occluder", (0, 2, -3), [(0, 3, -3, 1)], False),
        ("light just inside the occluder", (0, 2 + 2**-51, -3), [(0, 3, -3, 1)], True),
        ("light just behind the occluder", (0, 4 + 2**-50, -3), [(0, 3, -3, 1)], True),
        ("light on the far side of the occluder", (0, 4, -3), [(0, 3, -3, 1)], True),
        ("behind the point", (0, 0, -2.5), [(0, 0, -9, 1)], False),
        ("point and light inside", (0, 0, 5), [(0, 0, 0, 100)], False),
        ("point inside, light outside", (0, 0, 5), [(0, 0, -3, 1)], True),
        ("point inside, light on the surface", (0, 0, -2), [(0, 0, -3, 1)], False),
        ("shell one ulp outside", (0, 0, 5), [(0, 0, -5, math.nextafter(2, 3))], True),
        ("shell one ulp inside", (0, 0, 5), [(0, 0, -5, math.nextafter(2, 1))], False),
    ],
)
def test_shadows_of_a_point_light(
    name: str,
    light: tuple[float, float, float],
    others: list[tuple[float, float, float, float]],
    shadowed: bool,
    stretch: tuple[float, float, float],
) -> None:
    """The point is on the front of the first sphere, wherever it is seen from. Ellipsoids are a stretched world."""
    maps, near = {} if stretch == (1, 1, 1) else {"transform": np.diag(stretch)}, -3.0 * stretch[2]
    spheres = [(*np.multiply(ball[:3], stretch), ball[3]) for ball in (BALL, *others)]
    scene = scene_of(*spheres, lights=(cltrace.point_light(np.multiply(light, stretch)),), **maps)
    world = world_of(scene)
    at = balls_of(world)[0].intersection_at(AHEAD, -near)
    assert at.point == Point(0, 0, near)
    assert cast_shadow_ray(world, at, world.lights[0]) is shadowed, name


def test_own_surface_blocks_only_from_inside_and_only_lights_that_are_outside() -> None:
    for maps, z, lit in (
        *(({}, z, lit) for z, lit in ((-1.0, True), (3.0, False), (2.0, True))),
        *(({"transform": np.diag([1, 2, 3])}, z, lit) for z, lit in ((-1, True), (-2.75, True), (7, False), (6, True))),
    ):
        scene = scene_of((0, 0, 0, 2), lights=(cltrace.point_light((0, 0, z)),), ka=0, kd=1, ks=0, **maps)
        assert (trace(world_of(scene), AHEAD)[0][0] > 0) is lit
    outside = scene_of((0, 0, 0, 2), lights=(cltrace.parallel_light((0, 0, -1)),), ka=0, kd=1, ks=0)
    assert trace(world_of(outside), AHEAD)[0] == (0, 0, 0)


WIDE = Camera(horizontal_fov=45, resolution=(4, 2), square_pixels=False)
TALL = Camera(horizontal_fov=45, resolution=(2, 4), square_pixels=False)


@pytest.mark.parametrize(
    ("camera", "pixel", "want"),
    [
        # 45 degrees are half of the horizontal opening; the vertical angle is 45 H/W degrees, or the tangent H/W.
        (WIDE, (0, 0), (-0.75, 0.5 * math.tan(math.pi / 8))),
        (WIDE, (3, 1), (0.75, -0.5 * math.tan(math.pi / 8))),
        (Camera(horizontal_fov=45, resolution=(4, 2)), (0, 0), (-0.75, 0.25)),
        # A tall picture has the angle vertically.
        (TALL, (1, 3), (0.5 * math.tan(math.pi / 8), -0.75)),
        (Camera(horizontal_fov=60, resolution=(7, 13)), (3, 6), (0, 0)),
    ],
)
def test_rays_go_through_pixel_centres(camera: Camera, pixel: tuple[int, int], want: tuple[float, float]) -> None:
    d = primary_ray(camera, *pixel).direction
    assert tuple(d) == pytest.approx((*want, -1), abs=1e-15)


def test_bytes() -> None:
    assert [byte_of(c) for c in (-1, 0, 0.5, 1, 7, math.inf)] == [0, 0, 128, 255, 255, 255]
    assert [byte_of(c, truncate=True) for c in (0.5, 254.9 / 255, 1)] == [127, 254, 255]


# --------------------------------------------------------------------------------------------- held against the oracle


def turned_scene(rng: np.random.Generator, scale: float = 1.0, lights: tuple = ()) -> Scene:
    """Some spheres before a camera that looks anywhere."""
    eye, view = rng.normal(size=3), rng.normal(size=3)
    centers = eye + 5 * view / np.linalg.norm(view) + rng.normal(size=(6, 3))
    camera = Camera(tuple(eye), tuple(eye + view), tuple(rng.normal(size=3)), 30, (24, 18))
    return Scene.from_spheres(camera, lights, centers, scale * rng.uniform(0.2, 1.2, 6))


def agree(scene: Scene, world: World, ray: Ray, start: object, bound: float = 2.0**-24) -> bool:
    """Whether a ray meets a ball, after it has been seen to meet what the judge says. start: as the judge has it."""
    balls, at = [one[2] for one in judge.surfaces_of(scene)], closest_hit(world, ray)
    index, t = judge.first(balls, start, judge.in_world(scene, ray.direction))
    assert (at.index if at else -1) == index
    assert at is None or abs(at.t / t - 1) < bound
    return at is not None


def test_primary_rays_of_turned_cameras_are_those_of_the_judge() -> None:
    """The scene is not turned, the rays are: what is decided about are the numbers of the file."""
    rng = np.random.default_rng(1)
    for _ in range(6):
        scene = turned_scene(rng)
        world = world_of(scene)
        for _ in range(30):
            ray = primary_ray(scene.camera, *map(int, rng.integers(0, (24, 18))))
            agree(scene, world, ray, scene.camera.position, 1e-13)


@pytest.mark.parametrize("exponent", [2, 7, 12, 16, 20, 30])
def test_spheres_that_are_far_for_their_size_before_a_turned_camera(exponent: int) -> None:
    """Distance / radius from 1e2 to 1e30: rays that pass 0.5 to 1.5 radii from the centre, found in exact numbers."""
    rng = np.random.default_rng(exponent)
    seen = []
    for _ in range(40):
        scene = turned_scene(rng, 10.0**-exponent)
        world, i = world_of(scene), int(rng.integers(6))
        # No double triple is that well aimed. The ray starts near the sphere, then, in front of it.
        n, side = map(unit, rng.normal(size=(2, 3)))
        aimed = -n + unit(np.cross(n, side)) * rng.uniform(0.9, 1.1) * rng.choice([1, 1e9])
        ball = judge.Ball(scene.spheres["center"][i], scene.spheres["radius"][i])
        start = balls_of(world)[i].start(Direction(*n))
        agree(scene, world, Ray(start, Direction(*aimed)), ball.point(judge.in_world(scene, n)))
        # From the eye, towards the centre as well as doubles can.
        ahead = Direction(*balls_of(world)[i].center)
        seen.append(agree(scene, world, Ray(EYE, ahead), scene.camera.position, math.inf))
    # Beyond 1e16, the nearest double triple mostly passes by.
    assert any(seen) or exponent > 16


def test_equally_near_is_exactly_so() -> None:
    """Mirror images in the plane of the ray are equally near, an ulp of a radius unties them, and so do 2^-80."""
    ray = Ray(EYE, Direction(0, 0.03, -1))
    pair = [(0.5, 0.25, -5, 1.7), (-0.5, 0.25, -5, 1.7)]
    larger = [(*ball[:3], math.nextafter(1.7, 2)) for ball in pair]
    for i, spheres in ((0, pair), (0, [larger[0], pair[1]]), (1, [pair[0], larger[1]])):
        at = hit(ray, *spheres)
        assert at is not None
        assert at.index == i
    # 5 - sqrt(1 - x^2) is 4 + 2^-81, which no double tells from 4, and nearer than 4 + 2^-79.
    for offsets, nearest in (((2.0**-40, 0.0), 1), ((2.0**-39, 2.0**-40), 1), ((2.0**-40, 2.0**-39), 0)):
        at = hit(AHEAD, *((x, 0, -5, 1) for x in offsets))
        assert at is not None
        assert (at.index, at.t) == (nearest, 4)


@pytest.mark.parametrize("radius", [1e13, 1e14, 1e18])
def test_a_shell_of_any_size_leaks_nothing(radius: float) -> None:
    """Eye, light and ball within a huge shell, which is lit from inside wherever the ball is not between.

    An answer by hand: the shell's wall is so far that its shadow is that of a cone, whose half angle has the sine 1/d.
    """
    light, ball = np.array([4, 0.3, 0.2]), np.array([2.0, 0, 0])
    camera = Camera((0.5, 0.5, 3), (0.5, 0.5, 2), resolution=(16, 12), horizontal_fov=80)
    scene = Scene.from_spheres(camera, [cltrace.point_light(tuple(light))], [ball, (0, 0, 0)], [1, radius])
    world, shadowed = world_of(scene), 0
    for direction in np.random.default_rng(5).normal(size=(300, 3)):
        at = closest_hit(world, Ray(EYE, Direction(*direction)))
        assert at is not None
        if at.index == 0:
            continue
        # From the light to the wall: so long a way that it is the ray's direction but for 1e-12.
        d, to_ball = np.array(direction) / np.linalg.norm(direction), ball - light
        expected = d @ to_ball > 0 and np.linalg.norm(np.cross(d, to_ball)) < 1
        assert cast_shadow_ray(world, at, world.lights[0]) is bool(expected)
        shadowed += bool(expected)
    assert shadowed > 5


def test_a_light_that_touches_the_point_adds_nothing() -> None:
    """The eye and the light are one point of a sphere: a ray along it may end where it starts (a ZeroDivisionError)."""
    camera = Camera(
        (4.040135160495624, 0, -64), (0, -1.5831314531216503, 0), (1, 4, 0), horizontal_fov=89.999, resolution=(9, 7)
    )
    light = cltrace.point_light(camera.position)
    scene = Scene.from_spheres(camera, [light], [(0.04013516049562422, 0, -64)], [4], kd=1)
    world = world_of(scene)
    for i in range(63):
        color, _ = trace(world, primary_ray(camera, i % 9, i // 9))
        assert all(0 <= c < 2 for c in color)
    # The same by hand: the hit is where the light is.
    world = world_of(scene_of((0, 0, -5, 2), lights=(cltrace.point_light((0, 0, -3)),), ka=0, kd=1, ks=1))
    assert trace(world, AHEAD)[0] == (0, 0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("bent", [False, True])
def test_bounds_of_doubles_hold(bent: bool) -> None:
    """What doubles are certain about is what exact arithmetic says, for starts and spheres of very different sizes.

    With ellipsoids, too, up to a million times as long as wide.
    """
    rng = np.random.default_rng(7)
    sure = {None: 0, False: 0, True: 0}
    for _ in range(400):
        size = 10.0 ** rng.uniform(-6, 6, 6)
        scene = turned_scene(rng)
        spheres, K, L = scene.spheres.copy(), np.zeros((0, 3, 3)), np.repeat(np.eye(3)[None], 6, axis=0)
        spheres["radius"] = size
        spheres["center"] *= rng.choice([1, 1e3, 1e-3])
        if bent:
            L = np.array([turned(rng, *10.0 ** rng.uniform(-6, 0, 3)) for _ in range(6)])
            K, spheres["to_object"] = np.linalg.inv(L), np.arange(6)
        scene = dataclasses.replace(scene, spheres=spheres, to_object=K)
        own, other, *_ = rng.permutation(6)
        n = unit(rng.normal(size=3))
        # The light is close to where the line from the start would touch the other one.
        point = spheres["center"][own] + size[own] * L[own] @ n
        f = np.linalg.solve(L[other], spheres["center"][other] - point)
        side = unit(np.cross(f, rng.normal(size=3))) * size[other] * (1 + rng.normal() * 10.0 ** rng.uniform(-17, 0))
        light = point + L[other] @ (f + side) * rng.uniform(0.5, 3)
        lit = dataclasses.replace(scene, lights=cltrace.point_light(tuple(light)))
        world = world_of(lit)
        first, second = balls_of(world)[own], balls_of(world)[other]
        normal = Direction(*(n if bent else np.array(scene.camera.basis()) @ n).tolist()).normalized()
        ray = ShadowRay(first.start(normal), False, world.lights[0])
        said = surely_blocks(second, ray)
        sure[said] += 1
        if said is not None:
            assert said is (second.exact.first(ray.line, 0.0, 1.0) is not None)
    assert min(sure.values()) > 20


def test_along_a_surface_on_which_the_eye_is() -> None:
    """c is exactly 0 and b all but 0: its sign alone says whether the ray leads outwards or through the sphere."""
    rng = np.random.default_rng(9)
    hits = 0
    for _ in range(100):
        k = 1 + float(rng.integers(1, 1000)) * 2.0**-48
        x = rng.uniform(-2, 2)
        y = -x * 0.75
        for _ in range(int(rng.integers(3))):
            y = math.nextafter(y, rng.choice([-9, 9]))
        ray = Ray(EYE, Direction(x, y, -float(rng.choice([1, 2.0**-30]))))
        scene = scene_of((3 * k, 4 * k, 0, 5 * k))
        hits += agree(scene, world_of(scene), ray, (0, 0, 0), 1e-7)
    assert 20 < hits < 80


# ---------------------------------------------------------------------------------------------------- mirrors and glass

UP = Direction(0, 1, 0)


@pytest.mark.parametrize(
    ("d", "n", "side", "want"),
    [
        ((3, -4, 12), UP, 1, (3, 4, 12)),
        ((3, 4, 12), UP, -1, (3, -4, 12)),
        ((-1, 0, 0), Direction(0.6, 0.0, 0.8), 1, (2 * 0.36 - 1, 0, 2 * 0.48)),
        # A grazing ray keeps its angle; one along the surface leaves on its side.
        ((1, -1e-14, 0), UP, 1, (1, 1e-14, 0)),
        *(((1, -slope, 0), UP, 1, (1, 2.0**-47, 0)) for slope in (1e-16, 0, -1e-16)),
        ((1, 1e-16, 0), UP, -1, (1, -(2.0**-47), 0)),
    ],
)
def test_a_mirror_turns_the_part_along_the_normal(
    d: tuple[float, float, float], n: Direction, side: int, want: tuple[float, float, float]
) -> None:
    assert tuple(mirrored(Direction(*d), n, side)) == pytest.approx(want, rel=1e-15, abs=1e-20)


def test_snell() -> None:
    """The sine of the angle to the normal is divided by the index on the way in and multiplied on the way out."""
    rng = np.random.default_rng(20)
    for _ in range(200):
        index, sine, length = rng.uniform(0.4, 3), rng.uniform(0, 1), 10.0 ** rng.uniform(-3, 3)
        for side, eta in ((1, 1 / index), (-1, index)):
            d = Direction(sine, -side * math.sqrt((1 - sine) * (1 + sine)), 0) * length
            through = refracted(d, UP, side, index)
            if sine * eta > 1 + 1e-14:
                assert through is None
            elif sine * eta < 1 - 1e-3:
                assert through is not None
                assert through.x / length == pytest.approx(sine * eta, abs=1e-15)
                assert through.y / length == pytest.approx(-side * math.sqrt(1 - (sine * eta) ** 2), abs=1e-14)


@pytest.mark.parametrize("index", [1.5, 2.3, 1 + 1e-9])
def test_total_reflection_begins_at_the_critical_angle(index: float) -> None:
    for off, total in ((1e-9, True), (-1e-9, False)):
        angle = math.asin(1 / index) + off
        d = Direction(math.sin(angle), math.cos(angle), 0)
        assert (refracted(d, UP, -1, index) is None) is total
        out = Direction(math.sin(angle), -math.cos(angle), 0)  # into a bubble of air, whose outside is the glass
        assert (refracted(out, UP, 1, 1 / index) is None) is total


def seen(*spheres: tuple[float, float, float, float], ray: Ray = AHEAD, bounces: int = 8, **options: object) -> float:
    """The red that a ray sees of spheres under one ambient light, which show ka times their red."""
    scene = scene_of(*spheres, lights=(cltrace.ambient_light((1, 1, 1)),), **options)
    camera = dataclasses.replace(scene.camera, max_bounces=bounces)
    return trace(world_of(scene.seen_by(camera)), ray)[0][0]


TWO, DOUBLING = [(0, 0, -5, 2), (0, 0, 9, 1)], {"ka": 0.5, "reflectance": 2}
ASLANT = Ray(Point(0.3, -0.2, 0.1), Direction(0.4, 0.5, -1))


@pytest.mark.parametrize(
    ("spheres", "options", "want"),
    [
        # A mirror shows what is behind the eye, or the background.
        (TWO, {"ka": [0.5, 0.25], "reflectance": [1, 0]}, 0.25),
        (TWO, {"ka": [0.5, 0.25], "reflectance": [0.25, 0]}, 0.75 * 0.5 + 0.25 * 0.25),
        (TWO[:1], {"ka": 0.5, "reflectance": 0.25, "background": (0.75, 0, 0)}, 0.75 * 0.5 + 0.25 * 0.75),
        # Weights above 1 leave nothing of the surface's own colour; the other ray sees the far wall from inside.
        (
            TWO,
            {"ka": [0.5, 0.125], "reflectance": [0.75, 0], "transmittance": [1.25, 0], "bounces": 0},
            0.75 * 0.125 + 1.25 * 0.5,
        ),
        # What is met after the last bounce counts in full: within a mirror that doubles, its own share is none before.
        *(([(0, 0, 0, 3)], {**DOUBLING, "bounces": n}, 0.5 * 2.0 ** (n + 1)) for n in (0, 1, 5, 14)),
        ([(0, 0, 0, 3)], {**DOUBLING, "bounces": 100}, 2.0**21),  # the most that a sum holds
        ([(0, 0, 0, 3)], {"ka": 0.5, "reflectance": 1, "bounces": 100, "ray": ASLANT}, 0.5),
        # Sums are whole multiples, and opaque scenes have none.
        (TWO[:1], {"ka": 0.1, "reflectance": 0.3}, round(0.7 * 0.1 * 2**60) / 2**60),
        (TWO[:1], {"ka": 0.1}, 0.1),
    ],
)
def test_what_is_seen_in_mirrors_and_glass(
    spheres: list[tuple[float, float, float, float]], options: dict[str, object], want: float
) -> None:
    assert seen(*spheres, **options) == want


def test_total_reflection_is_one_ray_of_both_weights() -> None:
    """A bubble, hit beyond its critical height: the mirrored ray, which leads away, has all the weight."""
    h = 0.8
    mirror = Direction(0, math.sin(2 * math.asin(h)), math.cos(2 * math.asin(h)))
    other = tuple(np.array([0, 0, -5 + math.sqrt(1 - h * h)]) + 9 * np.array(tuple(mirror)))
    options = {"ka": [0, 0.5], "reflectance": [0.25, 0], "transmittance": [0.5, 0], "index": [0.5, 1]}
    # The eye's axis passes the bubble's centre at the height h.
    assert seen((0, -h, -5, 1), (*other, 1), **options) == (0.25 + 0.5) * 0.5


def test_glass_of_index_1_is_not_there() -> None:
    rng = np.random.default_rng(22)
    for _ in range(60):
        ray = Ray(EYE, Direction(*rng.uniform(-0.5, 0.5, 2).tolist(), -1.0))
        behind = [(0.2, 0.1, -9, 2), (-0.3, 0.4, -7, 1)]
        assert seen((0, 0, -5, 1.5), *behind, ka=[0.5, 0.25, 0.75], transmittance=[1, 0, 0], ray=ray) == seen(
            *behind, ka=[0.25, 0.75], ray=ray
        )


def unit(v: np.ndarray) -> np.ndarray:
    return np.asarray(v / np.linalg.norm(v))


# --------------------------------------------------------------------------------------------------------- ellipsoids


def ellipsoids(*spheres: tuple[float, float, float, float], transform: object, **options: object) -> World:
    """Spheres with a transform, before the camera of scene_of()."""
    return world_of(scene_of(*spheres, transform=np.array(transform, float), **options))


def turned(rng: np.random.Generator, *lengths: float) -> np.ndarray:
    """A linear map that makes a sphere an ellipsoid with these half axes, turned somehow."""
    return np.asarray(
        np.linalg.qr(rng.normal(size=(3, 3)))[0] @ np.diag(lengths) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    )


def test_an_ellipsoid_along_the_axes() -> None:
    """The ellipsoid x^2/4 + y^2 + (z + 5)^2/9 = 1 by hand."""
    world = ellipsoids((0, 0, -5, 1), transform=np.diag([2, 1, 3]))
    for start, d, t, normal in (
        (EYE, (0, 0, -1), 2, (0, 0, 1)),
        (Point(0, 0, -5), (0, 0, -1), 3, (0, 0, 1)),
        (Point(9, 0, -5), (-2, 0, 0), 3.5, (1, 0, 0)),
        (Point(1, 9, -5), (0, -1, 0), 9 - math.sqrt(0.75), (0.25, math.sqrt(0.75), 0)),
        (Point(0, -9, -6.5), (0, 1, 0), 9 - math.sqrt(0.75), (0, -math.sqrt(0.75), -0.5 / 3)),
    ):
        at = closest_hit(world, Ray(start, Direction(*d)))
        assert at is not None
        assert at.t == pytest.approx(t, rel=1e-15)
        assert tuple(at.normal) == pytest.approx(tuple(unit(np.array(normal))), abs=1e-15)
        assert at.inside == (start == Point(0, 0, -5))
    assert closest_hit(world, Ray(Point(2, 9, -5), Direction(0, -1, 0))) is not None
    assert closest_hit(world, Ray(Point(math.nextafter(2, 3), 9, -5), Direction(0, -1, 0))) is None


def test_the_mirror_of_an_ellipsoid_has_two_foci() -> None:
    """From one focus of a prolate ellipsoid every ray is mirrored to the other one."""
    rng = np.random.default_rng(30)
    far, near = 5.0, 3.0  # half axes: the foci are 4 from the centre
    for _ in range(50):
        axis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        eye, center = rng.normal(size=3), rng.normal(size=3)
        center = eye - axis @ (4, 0, 0)
        camera = Camera(tuple(eye), tuple(rng.normal(size=3)), tuple(rng.normal(size=3)))
        world = world_of(Scene.from_spheres(camera, (), [center], [1], transform=axis @ np.diag([far, near, near])))
        ray = Ray(EYE, Direction(*rng.normal(size=3).tolist()))
        at = closest_hit(world, ray)
        assert at is not None
        assert at.inside
        out = mirrored(ray.direction, at.outward, at.side, at.surface.spread)
        focus = Point(*(np.array(camera.basis()) @ (center - axis @ (4, 0, 0) - eye)).tolist())
        to = focus - at.point
        assert out.normalized().cross(to).length() < 1e-13
        assert out.dot(to) > 0
        assert at.distance + to.length() == pytest.approx(2 * far, rel=1e-14)


def test_light_on_an_ellipsoid_falls_by_its_normal() -> None:
    """A parallel light 60 degrees off the normal at a point where that is not the way to the centre."""
    world = ellipsoids((-1, 0, -5, 1), transform=np.diag([2, 1, 3]))
    at = closest_hit(world, AHEAD)
    assert at is not None
    n = unit(np.array([0.25, 0, math.sqrt(0.75) / 3]))
    assert tuple(at.normal) == pytest.approx(tuple(n), abs=1e-15)
    across = unit(np.cross(n, (0, 1, 0)))
    towards = n / 2 + across * math.sqrt(0.75)
    for light in (cltrace.parallel_light(tuple(-towards)), cltrace.point_light(tuple(tuple(at.point) + 3 * towards))):
        world = ellipsoids((-1, 0, -5, 1), transform=np.diag([2, 1, 3]), lights=(light,), ka=0, kd=1, ks=0)
        assert trace(world, AHEAD)[0] == pytest.approx((0.5, 0.5, 0.5), abs=1e-14)
    for slope, lit in ((1e-9, True), (-1e-9, False)):
        light = cltrace.point_light(tuple(tuple(at.point) + across + slope * n))
        world = ellipsoids((-1, 0, -5, 1), transform=np.diag([2, 1, 3]), lights=(light,), ka=0, kd=1, ks=0)
        assert (trace(world, AHEAD)[0][0] > 0) is lit


@pytest.mark.parametrize(
    ("seeds", "count"), [(range(4), 60), pytest.param(range(40), 500, marks=pytest.mark.stress)], ids=["", "long"]
)
@pytest.mark.parametrize("name", list(bounced_regimes.REGIMES))
def test_bounced_rays_are_those_of_the_oracle(name: str, seeds: range, count: int) -> None:
    for seed in seeds:
        scene = bounced_regimes.scene_of(name, seed)
        rays, world, spheres = bounced_regimes.rays_of(scene, count, seed), world_of(scene), Spheres.of(scene)
        found = Kinds([spheres]).closest(rays.path(spheres))
        for row in range(count):
            start = balls_of(world)[rays.own[row]].start(Direction(*rays.normal[row].tolist()))
            at = closest_hit(world, Ray(start, Direction(*rays.direction[row].tolist())))
            assert (at.index if at else -1) == found.item[row], (seed, row)
            if at:
                assert abs(at.t / found.t.h[row] - 1) < 2.0**-24, (seed, row)
                assert (at.start.on.length(), at.normal.length()) == pytest.approx((1, 1), abs=1e-14)


def test_shadows_are_those_of_the_judge() -> None:
    rng, found = np.random.default_rng(33), {False: 0, True: 0}
    for seed, name in enumerate(bounced_regimes.REGIMES):
        scene = bounced_regimes.scene_of(name, seed)
        balls, rays = [one[2] for one in judge.surfaces_of(scene)], bounced_regimes.rays_of(scene, 8, seed)
        on = [np.array(ball.point(rng.normal(size=3)), float) for ball in balls[:3]]
        lights = np.concatenate([*map(cltrace.point_light, on), cltrace.parallel_light(rng.normal(size=3))])
        world = world_of(dataclasses.replace(scene, lights=lights))
        for own, q in zip(rays.own.tolist(), rays.normal.tolist(), strict=True):
            surface = balls_of(world)[own]
            start, place = surface.start(Direction(*q)), balls[own].point(q if surface.K else judge.in_world(scene, q))
            for light, lamp in zip(lights, world.lights, strict=True):
                inside = surface.outward(Direction(*q)).dot(lamp.direction_from(start)) <= 0
                where = light["direction"] if lamp.parallel else light["position"]
                blocked = judge.between(balls, place, where, lamp.parallel)
                assert any(world.blockers(ShadowRay(start, inside, lamp))) is blocked
                found[blocked] += 1
    assert min(found.values()) > 40
