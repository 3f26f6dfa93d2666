"""Pictures in soft light: against closed forms, against the same lights one by one, and wherever pictures are made."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from stress_cases import box_means

import cltrace
from cltrace.picture.image import Output
from cltrace.plan import plan
from cltrace.plan.request import Request
from cltrace.plan.world import ScenePacking
from cltrace.scene import Scene
from cltrace.students.check import check
from cltrace.students.lit import lighting

GREY = (0.9, 0.9, 0.9)
MATTE: dict[str, Any] = {"ka": 0, "kd": 1, "ks": 0}
CAMERA = cltrace.Camera((0, 3, 9), (0, 0, 0), horizontal_fov=20, resolution=(96, 64))


PRECISIONS = ["accurate", *(pytest.param(name, marks=pytest.mark.slow) for name in ("single", "double"))]


# What is a sum over lights, and what is none, so that it is drawn in one pass: a program each.
SUMS: tuple[Output, ...] = ("rgb8", "color", "depth", "id")
OUTPUTS: tuple[Output, ...] = (*SUMS, "shadow_rays")


def floor(y: float = 0.0, size: float = 1e4) -> cltrace.Mesh:
    corners = [(-size, y, -size), (-size, y, size), (size, y, size), (size, y, -size)]
    return cltrace.Mesh(corners, [(0, 1, 2), (0, 2, 3)], material=cltrace.Material((1, 1, 1), ka=0, kd=1, ks=0))


def wall(low: float, high: float, x: float = 0.0) -> cltrace.Mesh:
    """Upright, along z: what is in front of it has a larger x."""
    corners = [(x, low, -1e4), (x, low, 1e4), (x, high, 1e4), (x, high, -1e4)]
    return cltrace.Mesh(corners, [(0, 1, 2), (0, 2, 3)], material=cltrace.Material((0, 0, 0), ka=0, kd=0, ks=0))


def row_of(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """x on the floor, and red there, along the middle row of a picture from above, where the floor is seen."""
    image = cltrace.render(scene, outputs=("color", "id"))
    width, height = scene.camera.resolution
    x = (np.arange(width) + 0.5 - width / 2) * (scene.camera.height / height)  # type: ignore[union-attr]
    seen = image.id[height // 2] == len(scene.columns)
    return x[seen], image.color[height // 2, seen, 0]


def from_above(height: float = 8.0) -> cltrace.Orthographic:
    return cltrace.Orthographic((0, 50, 0), (0, 0, 0), up=(0, 0, -1), height=height, resolution=(160, 160))


def sky(n: int = 1024) -> np.ndarray:
    return cltrace.sky_light((4.0, 4.0, 4.0), directions=n)


@pytest.mark.slow
def test_a_ball_on_a_floor_under_a_whole_sky() -> None:
    """It hides (R/d)^2 cos of the floor's sky, with d the way to its middle and cos = R/d above the horizon."""
    scene = Scene.from_spheres(from_above(), [sky()], [(0, 1, 0)], 1.0, meshes=[floor()], **MATTE)
    x, red = row_of(scene)
    assert len(x) > 100
    assert np.sqrt(np.mean((red - (1 - (1 + x * x) ** -1.5)) ** 2)) < 1.5 / 255


@pytest.mark.slow
def test_a_floor_beside_a_long_wall_under_a_whole_sky() -> None:
    """A wall of height h at the distance x hides (1 - cos(e)) / 2 of the floor's sky, with tan(e) = h / x."""
    scene = Scene.from_meshes(from_above(), [sky()], [floor(), wall(0, 1.5)])
    image = cltrace.render(scene, outputs=("color",))
    x = np.abs((np.arange(160) + 0.5 - 80) / 20)
    want = 1 - (1 - x / np.hypot(x, 1.5)) / 2
    assert np.sqrt(np.mean((image.color[80, :, 0] - want) ** 2)) < 1.5 / 255


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sun", "ball"])
def test_the_penumbra_of_a_straight_edge(kind: str) -> None:
    """Of a disc, an edge at s radii from its middle hides (acos(s) - s sqrt(1 - s^2)) / pi."""
    degrees, high = 5.0, 10.0
    r = math.tan(math.radians(degrees))
    light = cltrace.sun_light((0, -1, 0), (1.0, 1.0, 1.0), degrees, 512)
    if kind == "ball":
        light = cltrace.ball_light((0, 1000, 0), (1.0, 1.0, 1.0), 990 * r, 512)
    roof = [(0, high, -1e4), (0, high, 1e4), (-1e4, high, 1e4), (-1e4, high, -1e4)]
    black = cltrace.Material((0, 0, 0), ka=0, kd=0, ks=0)
    camera = cltrace.Orthographic((2.1, 5, 0), (2.1, 0, 0), up=(0, 0, -1), height=4.0, resolution=(160, 160))
    scene = Scene.from_meshes(camera, [light], [floor(), cltrace.Mesh(roof, [(0, 1, 2), (0, 2, 3)], material=black)])
    image = cltrace.render(scene, outputs=("color",))
    s = np.clip((2.1 + (np.arange(160) + 0.5 - 80) / 40) / (high * r), -1, 1)
    lit = 1 - (np.arccos(s) - s * np.sqrt(1 - s * s)) / np.pi
    assert 0.4 < lit.min() < 0.6 < 0.99 < lit.max()
    assert np.abs(image.color[80, :, 0] - lit * (1 + math.cos(math.radians(degrees))) / 2).max() < 3 / 255


def crowd(lights: Any, **more: Any) -> Scene:
    random = np.random.default_rng(0)
    balls = np.concatenate([random.normal(size=(60, 3)), [(0, -102, 0)]])
    return Scene.from_spheres(CAMERA, lights, balls, np.append(np.full(60, 0.4), 100.0), GREY, **more)


def every_kind() -> list[np.ndarray]:
    return [
        cltrace.ambient_light((0.1, 0.1, 0.1)),
        cltrace.sky_light((2.0, 2.0, 2.0), (0, 1, 0), (0.5, 0.5, 0.5), 24),
        cltrace.sun_light((1, -2, -1), (0.4, 0.3, 0.3), 8, 9),
        cltrace.ball_light((3, 5, 4), (0.3, 0.3, 0.5), 1.0, 7),
        cltrace.panel_light((-3, 4, 1), (0.5, 0.5, 0.2), (2, 0, 0), (0, 0, 2), 8),
    ]


def test_bytes_are_those_of_the_members() -> None:
    scene = crowd(every_kind())
    whole = cltrace.render(scene, outputs=OUTPUTS)
    single = cltrace.render(scene.lit_by(scene.lamps), outputs=OUTPUTS)
    assert whole.color.tobytes() == single.color.tobytes()
    assert whole.shadow_rays.tobytes() == single.shadow_rays.tobytes()
    assert whole.shadow_rays.max() > 24
    part = cltrace.render(scene, outputs=OUTPUTS, crop=(17, 9, 50, 41))
    assert part.color.tobytes() == whole.color[9:41, 17:50].tobytes()


@pytest.mark.parametrize("precision", PRECISIONS)
def test_the_reference_traces_the_same_members(precision: Any) -> None:
    scene = crowd(every_kind())
    image = cltrace.render(scene, precision=precision, outputs=OUTPUTS)
    report = check(scene, image, precision, pixels=200)
    assert report.ok, report


@pytest.mark.slow
def test_smooth_edges_average_the_members_shadows() -> None:
    scene = crowd(every_kind())
    truth = box_means(scene, 8)
    smooth = cltrace.render(scene, antialias=True, samples=64, outputs=("color", "error")).color
    assert np.sqrt(np.mean((smooth - truth) ** 2)) < 1.5 / 255
    plain = np.minimum(cltrace.render(scene, outputs=("color",)).color, 1)
    assert np.sqrt(np.mean((plain - truth) ** 2)) > 4 / 255


@pytest.mark.slow
def test_a_soft_light_is_lit_where_any_member_reaches() -> None:
    scene = crowd(every_kind())
    found = lighting(scene)
    assert found.lit.shape == (64, 96, 5)
    members = lighting(scene.lit_by(scene.lamps))
    for k in range(5):
        assert (found.lit[:, :, k] == members.lit[:, :, scene.lamp_of == k].any(axis=2)).all()
    assert any("sky_light 1, sun_light 2" in line for line in found.legend())


def test_an_explanation_has_a_soft_light_as_one() -> None:
    scene = crowd(every_kind())
    told = cltrace.explain(scene, 48, 32)
    _, *soft = told.rays[0].ambient[0].light.kind, *told.rays[0].lights
    assert [term.light.kind for term in soft] == ["sky_light", "sun_light", "ball_light", "panel_light"]
    assert [sum(term.fates.values()) for term in soft] == [24, 9, 7, 8]  # type: ignore[union-attr]
    assert "sky_light 1, L = (1.25, 1.25, 1.25) together: 6 of 24 members reach the point" in str(told)
    assert told.line.count("members reach the point") == 4
    assert "light 1 reaches\t0.25" in told.table
    sums = np.sum([term.diffuse for term in soft], axis=0) + np.sum([term.specular for term in soft], axis=0)
    assert sums + told.rays[0].ambient[0].color == pytest.approx(told.color)


@pytest.fixture
def few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seven lights of a crowd in each pass."""
    monkeypatch.setattr(plan, "WHOLE", 0)
    monkeypatch.setattr(plan, "PAIRS", 61 * 7)


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
def test_no_bit_depends_on_how_many_lights_are_added_at_once(
    precision: Any, few_at_a_time: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = crowd(every_kind())
    renderer = cltrace.Renderer(scene, precision=precision, outputs=SUMS)
    assert renderer.plan.passes
    few = renderer.render()
    again = renderer.render()
    monkeypatch.setattr(plan, "WHOLE", 2**24)
    whole = cltrace.Renderer(scene, precision=precision, outputs=OUTPUTS)
    assert not whole.plan.passes
    image = whole.render()
    for name in SUMS:
        assert getattr(few, name).tobytes() == getattr(image, name).tobytes() == getattr(again, name).tobytes()


@pytest.mark.slow
@pytest.mark.usefixtures("few_at_a_time")
def test_passes_draw_parts_and_updates(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = crowd(every_kind())
    renderer = cltrace.Renderer(scene)
    whole = renderer.render().rgb8.copy()
    assert (renderer.cropped((17, 9, 50, 41)).render().rgb8 == whole[9:41, 17:50]).all()
    assert (renderer.rows(16, 48).render().rgb8 == whole[16:48]).all()
    assert (cltrace.Renderer(scene, width=4, crop=(17, 9, 50, 41)).render().rgb8 == whole[9:41, 17:50]).all()
    camera = replace(CAMERA, position=(2, 3, 8))
    assert (renderer.look(camera).render().rgb8 == cltrace.render(scene.seen_by(camera)).rgb8).all()
    renderer.update(colors=(0.2, 0.4, 0.6))
    assert (renderer.render().rgb8 == cltrace.render(renderer.scene).rgb8).all()
    work = renderer.work()
    monkeypatch.setattr(plan, "WHOLE", 2**24)
    for kind in ("shadow rays traced", "highlights computed"):
        assert work[kind] == cltrace.Renderer(renderer.scene).work()[kind] > 0


@pytest.mark.usefixtures("few_at_a_time")
def test_rows_are_told_once_and_whoever_looks_on_may_stop_it() -> None:
    scene = crowd(every_kind())
    told: list[int] = []
    renderer = cltrace.Renderer(scene, outputs=SUMS)
    renderer.draw(told.append)
    assert sum(told) == 64
    with pytest.raises(KeyboardInterrupt):
        renderer.draw(_interrupt)
    assert (renderer.render().rgb8 == cltrace.render(scene, outputs=SUMS).rgb8).all()


def _interrupt(rows: int) -> None:
    raise KeyboardInterrupt


@pytest.mark.usefixtures("few_at_a_time")
def test_what_is_no_sum_over_lights_is_one_pass() -> None:
    soft, points = crowd(every_kind()), crowd([cltrace.point_light((1, 9, 3))] * 9)
    for scene, request, more in (
        (soft, Request(), True),
        (soft, Request(samples=16), False),
        (soft, Request(outputs=("shadow_rays",)), False),
        (soft, Request(outputs=("id",)), False),
        (points, Request(), False),
    ):
        assert (len(plan.passes_of(ScenePacking.of(scene, request), request)) > 1) == more, request
