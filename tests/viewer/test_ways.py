"""What a hand does to a camera: what is under the pointer follows it, and what is done can be undone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import cltrace
from cltrace.scene import AnyCamera, Camera, Orthographic
from cltrace.viewer import cameras

PINHOLE = Camera((1, 2, 9), (0, 1, 0), (0.1, 1, 0), horizontal_fov=20, resolution=(90, 60), square_pixels=False)
PARALLEL = Orthographic((1, 2, 9), (0, 1, 0), (0.1, 1, 0), height=5, resolution=(90, 60))
BOTH = pytest.mark.parametrize("camera", [PINHOLE, PARALLEL], ids=["pinhole", "parallel"])


def place(camera: AnyCamera, point: object) -> np.ndarray:
    """Where a point is in the picture: shares of its width and height, from the middle, rightwards and downwards."""
    x, y, z = np.array(camera.basis()) @ (np.asarray(point) - camera.position)
    wide, high = camera.image_plane()
    away = 1 if camera.parallel else -z
    return np.array([x / wide / 2 / away, -y / high / 2 / away])


@BOTH
def test_orbit_goes_around(camera: AnyCamera) -> None:
    radius = math.dist(camera.position, camera.lookat)
    around = camera
    for _ in range(8):
        around = cameras.orbit(around, 0.25, 0)
        assert math.dist(around.position, around.lookat) == pytest.approx(radius)
        assert (around.lookat, around.up) == (camera.lookat, camera.up)
    assert around.position == pytest.approx(camera.position)
    half = cameras.orbit(cameras.orbit(camera, 1, 0), 0.1, 0.05)
    assert cameras.orbit(cameras.orbit(half, 0, -0.05), -1.1, 0).position == pytest.approx(camera.position)


def test_orbit_takes_the_front_with_it() -> None:
    camera = Camera((0, 0, 9), (0, 0, 0), horizontal_fov=20)
    front = (0, 0, 1)
    assert place(cameras.orbit(camera, 0.1, 0), front)[0] > 0
    assert place(cameras.orbit(camera, 0, 0.1), front)[1] > 0


@BOTH
def test_orbit_stops_before_the_poles(camera: AnyCamera) -> None:
    for y in (5, -5):
        top = cameras.orbit(camera, 0, y)
        angle = math.acos(np.dot(top.basis()[2], camera.up) / math.hypot(*camera.up))
        assert angle == pytest.approx(cameras.POLE if y > 0 else math.pi - cameras.POLE)
        assert cameras.orbit(top, 0, y).position == pytest.approx(top.position)


@BOTH
def test_pan_keeps_what_is_under_the_pointer(camera: AnyCamera) -> None:
    width, height = camera.resolution
    moved = cameras.pan(camera, 0.2, -0.1)
    assert place(moved, camera.lookat) == pytest.approx([0.2 * height / width, -0.1])
    assert np.array(moved.basis()) == pytest.approx(np.array(camera.basis()))


@BOTH
def test_zoom(camera: AnyCamera) -> None:
    near = cameras.zoom(camera, 0, -1)
    sideways = np.add(camera.lookat, 0.1 * np.array(camera.basis()[0]))
    assert place(near, sideways) == pytest.approx(2 * place(camera, sideways))
    assert cameras.zoom(near, 0, 1) == camera


@BOTH
def test_centre(camera: AnyCamera) -> None:
    moved = cameras.centre(camera, (0.5, 0, 1))
    assert place(moved, (0.5, 0, 1)) == pytest.approx([0, 0], abs=1e-12)
    assert moved.lookat == (0.5, 0, 1)
    assert np.array(moved.basis()) == pytest.approx(np.array(camera.basis()))
    # As far away as the point was.
    before, after = (np.dot(np.subtract(c.position, (0.5, 0, 1)), camera.basis()[2]) for c in (camera, moved))
    assert after == pytest.approx(before)


@BOTH
def test_fit_is_that_of_the_side(camera: AnyCamera) -> None:
    scene = cltrace.Scene.from_spheres(camera, [], [(0, 0, 0), (3, 1, 0)], [1, 2])
    fitted = cameras.fit(scene)
    assert (type(fitted), fitted.up, fitted.resolution) == (type(camera), camera.up, camera.resolution)
    assert fitted.basis()[2] == pytest.approx(camera.basis()[2])
    if isinstance(fitted, Camera):
        assert fitted.horizontal_fov == pytest.approx(20)
        assert fitted.square_pixels is False
    back = cltrace.render(scene.seen_by(fitted), outputs=("id",), device="cpu").id
    assert (back[0] == -1).all()
    assert (back[:, 0] == -1).all()
    assert set(np.unique(back)) == {-1, 0, 1}


def test_the_other_kind_and_back() -> None:
    flat = cameras.other_kind(PINHOLE, PINHOLE)
    assert isinstance(flat, Orthographic)
    up = np.add(PINHOLE.lookat, 0.3 * np.array(PINHOLE.basis()[1]))
    assert place(flat, up)[1] == pytest.approx(place(PINHOLE, up)[1])
    back = cameras.other_kind(flat, PINHOLE)
    assert isinstance(back, Camera)
    assert back.position == pytest.approx(PINHOLE.position)
    assert replace(back, position=PINHOLE.position) == PINHOLE


def test_a_narrow_picture_keeps_a_column() -> None:
    assert cameras.reduced(replace(PINHOLE, resolution=(2, 60)), 4).resolution == (1, 15)


def test_text(tmp_path) -> None:
    moved = cameras.orbit(PINHOLE, 0.123, 0.045)
    assert eval(f"cltrace.{moved!r}", {"cltrace": cltrace}) == moved
    assert eval(f"cltrace.{PARALLEL!r}", {"cltrace": cltrace}) == PARALLEL
    file = tmp_path / "scene.xml"
    rest = '<scene output_file="a.png"><background_color r="0" g="0" b="0"/>{}<lights/><surfaces/></scene>'
    file.write_text(rest.format(cameras.as_xml(moved)))
    assert cltrace.load(file).camera == moved
    with pytest.raises(ValueError, match="no orthographic camera"):
        cameras.as_xml(PARALLEL)
