"""Soft lights: their members, what these add up to, and what is refused."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

import cltrace
from cltrace.scene import LAMBERT, LIGHT, PARALLEL, POINT, Scene, members_of

COLOR = (1.0, 0.5, 0.25)


def members(light: np.ndarray) -> np.ndarray:
    return members_of(light[0])


def scene(lights: object, **more: object) -> Scene:
    return Scene.from_spheres(cltrace.Camera(), lights, [(0, 0, -5)], 1.0, **more)  # type: ignore[arg-type]


def white_matte(light: np.ndarray, normal: tuple[float, ...], place: tuple[float, ...] = (0, 0, 0)) -> np.ndarray:
    """What a surface with kd = 1 shows, by the formula, where nothing is in the way."""
    total = np.zeros(3)
    for one in members(light):
        w = -one["direction"] if one["kind"] == PARALLEL else one["position"] - np.array(place)
        w = w / np.linalg.norm(w)
        axis = one["direction"] / np.linalg.norm(one["direction"])
        strength = max(0.0, -w @ axis) if one["kind"] == LAMBERT else 1.0
        total += one["color"] * strength * max(0.0, w @ np.array(normal))
    return total


SKY, HALF = cltrace.sky_light(COLOR, directions=512), cltrace.sky_light(COLOR, (0, 0, 3), directions=512)


@pytest.mark.parametrize(
    ("light", "normal", "share"),
    [
        (SKY, (1, 0, 0), 1 / 4),
        (SKY, (0, -0.6, 0.8), 1 / 4),
        (HALF, (0, 0, 1), 1 / 2),
        (HALF, (0, 1, 0), 1 / 4),
        (cltrace.sky_light(COLOR, (0, 1, 0), (0, 0, 0), 512), (0, 1, 0), 5 / 24),
        (cltrace.sky_light(COLOR, (0, 1, 0), (0, 0, 0), 512), (0, -1, 0), 1 / 24),
        (cltrace.sun_light((0, -7, 0), COLOR, 30, 64), (0, 1, 0), (1 + math.cos(math.radians(30))) / 2),
        (cltrace.ball_light((0, 1e4, 0), COLOR, 9, 16), (0, 1, 0), 1),
        (cltrace.panel_light((0, 1e4, 0), COLOR, (9, 0, 0), (0, 0, 9)), (0, 1, 0), 1),
        (
            cltrace.panel_light((1e4, 1e4, 0), COLOR, (9, 0, 0), (0, 0, 9)),
            (math.sqrt(0.5), math.sqrt(0.5), 0),
            0.5**0.5,
        ),
        (cltrace.panel_light((0, 1e4, 0), COLOR, (0, 0, 9), (9, 0, 0)), (0, 1, 0), 0),
    ],
)
def test_a_white_surface_shows_what_the_docstrings_say(
    light: np.ndarray, normal: tuple[float, ...], share: float
) -> None:
    assert white_matte(light, normal) == pytest.approx(np.array(COLOR) * share, abs=2e-3)


@pytest.mark.parametrize("n", [1, 2, 3, 16, 64, 1024])
def test_members_add_up_to_the_colour(n: int) -> None:
    lights = [
        (cltrace.sky_light(COLOR, directions=n), COLOR),
        (cltrace.sky_light(COLOR, (1, 1, 0), directions=n), COLOR),
        (cltrace.sky_light(COLOR, (1, 1, 0), (0, 0, 1.5), n), (0.5, 0.25, 0.875)),
        (cltrace.sun_light((1, 2, 3), COLOR, 5, n), COLOR),
        (cltrace.ball_light((1, 2, 3), COLOR, 2, n), COLOR),
        (cltrace.panel_light((1, 2, 3), COLOR, (1, 0, 0), (0, 1, 0), n), COLOR),
    ]
    for light, color in lights:
        assert len(members(light)) == n
        assert members(light)["color"].sum(axis=0) == pytest.approx(np.array(color), rel=1e-12)
        assert (members(light)["members"] == 0).all()


def test_directions_of_a_sun_are_within_its_disc_and_of_a_half_sky_above() -> None:
    towards = -members(cltrace.sun_light((0, 0, -2), COLOR, 7, 100))["direction"]
    assert np.linalg.norm(towards, axis=1) == pytest.approx(1)
    assert (towards[:, 2] >= math.cos(math.radians(7))).all()
    assert towards[:, 2].min() < math.cos(math.radians(6.9))
    assert towards.mean(axis=0)[:2] == pytest.approx(0, abs=1e-3)
    assert (-members(HALF)["direction"][:, 2] > 0).all()
    assert (members(SKY)["kind"] == PARALLEL).all()


def test_a_ball_looks_like_an_even_disc_from_everywhere() -> None:
    light = members(cltrace.ball_light((5, 6, 7), COLOR, 2, 1024))
    assert (light["kind"] == POINT).all()
    places = (light["position"] - (5, 6, 7)) / 2
    assert np.linalg.norm(places, axis=1).max() <= 1
    for view in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 2, 3), (-2, 1, 0.3)]:
        along = np.array(view) / np.linalg.norm(view)
        across = np.linalg.norm(places - np.outer(places @ along, along), axis=1)
        for radius in (0.3, 0.5, 0.8):
            assert (across <= radius).mean() == pytest.approx(radius**2, abs=0.02)


def test_points_of_a_panel_are_spread_over_it() -> None:
    light = members(cltrace.panel_light((5, 6, 7), COLOR, (2, 0, 0), (0, 0, 4), 100))
    assert (light["kind"] == LAMBERT).all()
    places = light["position"] - (5, 6, 7)
    assert (np.abs(places) <= (1, 0, 2)).all()
    count = np.histogram2d(places[:, 0], places[:, 2], 5, [(-1, 1), (-2, 2)])[0]
    assert (np.abs(count - 4) <= 1).all()
    assert (light["direction"] / np.linalg.norm(light["direction"], axis=1)[:, None] == (0, -1, 0)).all()


def test_a_scene_holds_a_soft_light_as_one() -> None:
    plain = [cltrace.ambient_light(), cltrace.point_light((1, 2, 3))]
    found = scene([plain[0], cltrace.sky_light(COLOR), plain[1], cltrace.ball_light((1, 2, 3), points=2)])
    assert (len(found.lights), len(found.lamps)) == (4, 68)
    assert found.lamp_of.tolist() == [0, *[1] * 64, 2, 3, 3]
    assert found.lamps.dtype == LIGHT
    bare = scene(plain)
    assert bare.lamps is bare.lights
    assert pickle.loads(pickle.dumps(found)).lamps.tobytes() == found.lamps.tobytes()
    assert found.seen_by(cltrace.Camera()).lamps.tobytes() == found.lamps.tobytes()


def test_lit_by_shares_all_but_the_lights() -> None:
    first = scene([cltrace.sky_light(COLOR)])
    other = first.lit_by([cltrace.ambient_light()])
    assert (len(first.lamps), len(other.lamps), other.columns is first.columns) == (64, 1, True)


@pytest.mark.parametrize("name", ["studio", "sky", "rim", "flat"])
def test_settings_follow_camera_and_scene(name: str) -> None:
    """Whatever there is to be seen."""
    small = scene(name)
    assert small.lit_by(name).lights.tobytes() == small.lights.tobytes()
    moved = Scene.from_spheres(cltrace.Camera((0, 0, 1000), (0, 0, 0)), name, [(0, 0, 995)], 1.0)
    assert moved.lights["position"][1:] - small.lights["position"][1:] == pytest.approx(
        np.where(small.lights["edges"].any(axis=(1, 2)), 1000, 0)[1:, None] * np.array([0.0, 0, 1])
    )
    nothing = Scene.from_spheres(cltrace.Camera(), name, [], 1.0)
    rod = nothing.with_cylinders([(0, 0, -50)], [(0, 1, -50)], 0.5).lit_by(name)
    mesh = cltrace.Mesh([(0, 0, -5), (1, 0, -5), (0, 1, -5)], [(0, 1, 2)])
    for other in (nothing, rod, Scene.from_meshes(cltrace.Camera(), name, [mesh])):
        assert other.lights["kind"].tolist() == small.lights["kind"].tolist()
    assert (rod.lights["position"] == nothing.lights["position"]).all() == (name != "studio")


def test_the_lamp_of_the_studio_shines_on_the_scene_from_the_upper_left() -> None:
    (lamp,) = [light for light in scene("studio").lights if light["edges"].any()]
    towards = lamp["position"] - (0, 0, -5)
    assert towards[0] < 0 < towards[1]
    assert towards[2] > 0
    normal = np.cross(*lamp["edges"])
    assert normal @ towards == pytest.approx(-np.linalg.norm(normal) * np.linalg.norm(towards))
