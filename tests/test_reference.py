"""The reference against answers that can be derived by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

import cltrace
from cltrace import Camera, Scene
from cltrace.reference import (
    EYE,
    Direction,
    Intersection,
    Point,
    Ray,
    byte_of,
    cast_shadow_ray,
    closest_hit,
    primary_ray,
    trace,
    world_of,
)

AHEAD = Ray(EYE, Direction(0, 0, -1))


def scene_of(*spheres: tuple[float, float, float, float], lights: tuple = (), **options: object) -> Scene:
    """Spheres (x, y, z, r) before a camera at the origin that looks along -z; the picture is one pixel."""
    camera = Camera(resolution=(1, 1))
    data = np.array(spheres, float).reshape(-1, 4)
    return Scene.from_spheres(camera, lights, data[:, :3], data[:, 3], **options)  # type: ignore[arg-type]


def hit(ray: Ray, *spheres: tuple[float, float, float, float]) -> Intersection | None:
    return closest_hit(world_of(scene_of(*spheres)), ray)


def test_points_and_directions_are_told_apart() -> None:
    step = Point(1, 2, 3) - Point(0, 1, 1)
    assert isinstance(step, Direction)
    assert Point(0, 0, 0) + step == Point(1, 1, 2)
    with pytest.raises(TypeError):
        Point(0, 0, 0) + Point(0, 0, 0)  # type: ignore[operator]


def test_head_on() -> None:
    at = hit(AHEAD, (0, 0, -5, 2))
    assert at is not None
    assert (at.t, at.distance, at.inside, at.index) == (3, 3, False, 0)
    assert at.point == Point(0, 0, -3)
    assert at.normal == Direction(0, 0, 1)


def test_distance_is_in_scene_units_whatever_the_direction_s_length() -> None:
    at = hit(Ray(EYE, Direction(0, 0, -0.25)), (0, 0, -5, 2))
    assert at is not None
    assert (at.t, at.distance) == (12, 3)


def test_a_ray_has_a_minimum_and_a_maximum_distance() -> None:
    assert hit(Ray(EYE, Direction(0, 0, -1), t_max=3), (0, 0, -5, 2)) is None
    assert hit(Ray(EYE, Direction(0, 0, -1), t_max=3.5), (0, 0, -5, 2)) is not None
    assert hit(Ray(EYE, Direction(0, 0, -1), t_min=3, t_max=7), (0, 0, -5, 2)) is None


BALL = (0, 0, -5, 2)


def test_a_ray_may_start_anywhere() -> None:
    far = hit(Ray(Point(1000, 0, -5), Direction(-1, 0, 0)), BALL)
    assert far is not None
    assert (far.t, far.distance, far.inside, far.normal) == (998, 998, False, Direction(1, 0, 0))
    middle = hit(Ray(Point(0, 0, -5), Direction(0, 3, 4)), BALL)
    assert middle is not None
    assert (middle.t, middle.distance, middle.inside) == (0.4, 2, True)
    assert tuple(middle.normal) == pytest.approx((0, -0.6, -0.8), abs=1e-15)
    assert hit(Ray(Point(1000, 0, -5), Direction(1, 0, 0)), BALL) is None
    assert hit(Ray(Point(1000, 0, -5), Direction(0, 0, 0)), BALL) is None


def test_behind_t_min_the_far_end_is_hit_from_inside() -> None:
    at = hit(Ray(EYE, Direction(0, 0, -1), t_min=4), BALL)
    assert at is not None
    assert (at.t, at.distance, at.inside, at.normal) == (7, 7, True, Direction(0, 0, 1))
    assert at.point == Point(0, 0, -7)


def test_tangent_ray_is_one_hit() -> None:
    at = hit(AHEAD, (0, 1, -5, 1))
    assert at is not None
    assert at.t == 5
    assert at.normal == Direction(0, -1, 0)
    assert hit(AHEAD, (0, math.nextafter(1, 2), -5, 1)) is None


def test_behind_is_no_hit() -> None:
    assert hit(AHEAD, (0, 0, 5, 2)) is None


def test_from_inside_the_far_wall_is_hit_and_its_normal_faces_the_ray() -> None:
    at = hit(AHEAD, (0, 0, 0.5, 2))
    assert at is not None
    assert (at.t, at.inside) == (1.5, True)
    assert at.normal == Direction(0, 0, 1)


def test_from_the_surface_only_the_way_through_the_inside_hits() -> None:
    inward = hit(AHEAD, (0, 0, -1, 1))
    assert inward is not None
    assert inward.t == 2
    assert hit(AHEAD, (0, 0, 1, 1)) is None
    assert hit(AHEAD, (0, 1, 0, 1)) is None


def test_from_the_centre() -> None:
    at = hit(Ray(EYE, Direction(0, 0, -1)), (0, 0, 0, 3))
    assert at is not None
    assert at.t == 3
    assert at.normal == Direction(0, 0, 1)


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


def test_light_at_an_angle() -> None:
    """A parallel light 60 degrees off the normal: n.l = 1/2 and r.v = 1/2."""
    direction = (-math.sin(math.pi / 3), 0, -math.cos(math.pi / 3))
    scene = scene_of((0, 0, -5, 2), lights=(cltrace.parallel_light(direction),), ka=0, kd=1, ks=1, exponent=2)
    color, _ = trace(world_of(scene), AHEAD)
    assert color == pytest.approx((0.75, 0.75, 0.75), abs=1e-15)


def test_exponent_0_is_the_full_highlight_even_where_r_v_is_not_positive() -> None:
    direction = (-math.sin(1.2), 0, -math.cos(1.2))
    scene = scene_of((0, 0, -5, 2), lights=(cltrace.parallel_light(direction),), ka=0, kd=0, ks=0.5, exponent=0)
    assert trace(world_of(scene), AHEAD)[0] == (0.5, 0.5, 0.5)


@pytest.mark.parametrize("degrees", [0, 5, 19.9, 22.5, 24.9, 25.1, 90, 180])
def test_spot_falls_off_linearly_in_the_angle(degrees: float) -> None:
    """The light sits at the eye, the spot's axis turns away from the point."""
    angle = math.radians(degrees)
    light = cltrace.spot_light((0, 0, 0), (math.sin(angle), 0, -math.cos(angle)), 20, 25)
    scene = scene_of((0, 0, -5, 2), lights=(light,), ka=0, kd=1, ks=0)
    share = min(1.0, max(0.0, (25 - degrees) / 5))
    assert trace(world_of(scene), AHEAD)[0] == pytest.approx((share,) * 3, abs=1e-14)


def test_spot_with_a_hard_edge() -> None:
    for axis, share in (((0, 0, -1), 1.0), ((1, 0, -1), 0.0)):
        light = cltrace.spot_light((0, 0, 0), axis, 20, 20)
        scene = scene_of((0, 0, -5, 2), lights=(light,), ka=0, kd=1, ks=0)
        assert trace(world_of(scene), AHEAD)[0] == (share,) * 3


@pytest.mark.parametrize(
    ("name", "light", "others", "shadowed"),
    [
        ("nothing between", (0, 0, 5), [], False),
        ("between", (0, 9, -3), [(0, 3, -3, 1)], True),
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
    name: str, light: tuple[float, float, float], others: list[tuple[float, float, float, float]], shadowed: bool
) -> None:
    """The point is (0, 0, -3), on the front of the sphere 0, wherever it is seen from."""
    world = world_of(scene_of((0, 0, -5, 2), *others, lights=(cltrace.point_light(light),)))
    t = world.surfaces[0].intersect(AHEAD)
    assert t == 3
    at = world.surfaces[0].intersection_at(AHEAD, t, 0)
    assert cast_shadow_ray(world, at, world.lights[0]) is shadowed, name


def test_shadows_of_a_parallel_light_reach_to_infinity() -> None:
    for z, shadowed in ((1e9, True), (-1e9, False)):
        world = world_of(scene_of((0, 0, -5, 2), (0, 0, z, 1), lights=(cltrace.parallel_light((0, 0, -1)),)))
        at = world.surfaces[0].intersection_at(AHEAD, 3, 0)
        assert cast_shadow_ray(world, at, world.lights[0]) is shadowed


def test_own_sphere_blocks_only_from_inside_and_only_lights_that_are_outside() -> None:
    for z, lit in ((-1.0, True), (3.0, False), (2.0, True)):
        scene = scene_of((0, 0, 0, 2), lights=(cltrace.point_light((0, 0, z)),), ka=0, kd=1, ks=0)
        assert (trace(world_of(scene), AHEAD)[0][0] > 0) is lit
    outside = scene_of((0, 0, 0, 2), lights=(cltrace.parallel_light((0, 0, -1)),), ka=0, kd=1, ks=0)
    assert trace(world_of(outside), AHEAD)[0] == (0, 0, 0)


def test_light_behind_the_surface_adds_nothing() -> None:
    scene = scene_of((0, 0, -5, 2), lights=(cltrace.point_light((0, 0, -9)),), ka=0, kd=1, ks=1)
    assert trace(world_of(scene), AHEAD)[0] == (0, 0, 0)


def test_background() -> None:
    scene = scene_of((0, 0, 5, 2), background=(0.1, 0.2, 0.3))
    assert trace(world_of(scene), AHEAD) == ((0.1, 0.2, 0.3), None)


def test_rays_go_through_pixel_centres_and_the_picture_is_upright() -> None:
    """45 degrees are half of the horizontal opening; the vertical angle is 45 H/W degrees, or the tangent H/W."""
    camera = Camera(horizontal_fov=45, resolution=(4, 2), square_pixels=False)
    first, last = primary_ray(camera, 0, 0).direction, primary_ray(camera, 3, 1).direction
    assert (first.x, first.y, first.z) == pytest.approx((-0.75, 0.5 * math.tan(math.pi / 8), -1), abs=1e-15)
    assert (last.x, last.y) == (-first.x, -first.y)
    square = primary_ray(Camera(horizontal_fov=45, resolution=(4, 2)), 0, 0).direction
    assert (square.x, square.y) == pytest.approx((-0.75, 0.25), abs=1e-15)


def test_a_tall_picture_has_the_angle_vertically() -> None:
    tall = primary_ray(Camera(horizontal_fov=45, resolution=(2, 4), square_pixels=False), 1, 3).direction
    assert (tall.x, tall.y) == pytest.approx((0.5 * math.tan(math.pi / 8), -0.75), abs=1e-15)


def test_the_middle_of_an_odd_picture_is_the_axis() -> None:
    middle = primary_ray(Camera(horizontal_fov=60, resolution=(7, 13)), 3, 6).direction
    assert (middle.x, middle.y, middle.z) == (0, 0, -1)


def test_bytes() -> None:
    assert [byte_of(c) for c in (-1, 0, 0.5, 1, 7, math.inf)] == [0, 0, 128, 255, 255, 255]
    assert [byte_of(c, truncate=True) for c in (0.5, 254.9 / 255, 1)] == [127, 254, 255]
