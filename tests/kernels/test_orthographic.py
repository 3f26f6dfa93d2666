"""Orthographic cameras, and what explanations say of their rays."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from stress_cases import picture

import cltrace
from cltrace import Orthographic, Scene
from cltrace.run.devices import Device

TURNED = Orthographic((3, 2, 5), (0.1, 0.2, 0.3), (0.1, 1, 0.2), height=4.3, resolution=(40, 30))
LIGHTS = [cltrace.ambient_light(), cltrace.point_light((5, 8, 9)), cltrace.parallel_light((1, -2, -1))]


def balls(camera: Orthographic = TURNED) -> Scene:
    rng = np.random.default_rng(8)
    centers, radii = rng.normal(size=(60, 3)), rng.uniform(0.05, 1, 60) / 4
    return Scene.from_spheres(camera, LIGHTS, centers, radii, rng.uniform(size=(60, 3)), background=(1, 1, 1))


def test_explanations(device: Device) -> None:
    """The bytes are the picture's, and the rays start where the words say."""
    scene = balls()
    image = picture(scene, device)
    right, up, back = np.array(TURNED.basis())
    assert np.abs(image.direction + back).max() < 2.0**-23
    for x, y in [(20, 15), (25, 10), (18, 20), (0, 0), (16, 12), (22, 17), (19, 11), (24, 16)]:
        found = cltrace.explain(scene, x, y)
        assert found.rgb8 == tuple(image.rgb8[y, x].tolist())
        ray, c = found.rays[0], found.camera
        assert ray.direction == pytest.approx(-back, abs=1e-15)
        assert np.array(ray.origin) == pytest.approx(TURNED.position + c.x_i * right + c.y_i * up, abs=1e-14)
        assert (c.x_i, c.y_i) == pytest.approx((((x + 0.5) / 20 - 1) * 4.3 / 2 * 4 / 3, (1 - (y + 0.5) / 15) * 4.3 / 2))
        assert (ray.hit.t if ray.hit else np.inf) == pytest.approx(image.depth[y, x])
        assert "H = 4.3, the height of what the picture shows" in str(found)
        assert "o = position + x_i x + y_i y = (" in str(found)
    assert '"height": 4.3' in cltrace.explain(scene, 3, 4).to_json()


def test_the_camera() -> None:
    camera = Orthographic((1, 2, 3), (0, 0, 0), height=4, resolution=(640, 480))
    assert camera.image_plane() == (2 * 640 / 480, 2)
    for same in (replace(camera), pickle.loads(pickle.dumps(camera)), eval(repr(camera))):
        assert same == camera
        assert hash(same) == hash(camera)
    around = cltrace.orbit(balls(replace(TURNED, lookat=(0, 0, 0))), 4, axis="y")
    assert all(isinstance(camera, Orthographic) and camera.height == TURNED.height for camera in around)
    assert np.array([camera.position for camera in around]).mean(axis=0) == pytest.approx((0, 2, 0))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"height": 0}, "camera.height: must be > 0, got 0"),
        ({"height": np.inf}, "camera.height: must be a finite number, got inf"),
        ({"height": "1"}, "camera.height: must be numbers, got '1'"),
        ({"lookat": (0, 0, 0)}, "camera.lookat: must differ from position"),
        ({"resolution": (0, 5)}, "camera.resolution: must be within 1..65536 each and 1073741824 pixels, got 0x5"),
        ({"max_bounces": 101}, "camera.max_bounces: must be within 0..100, got 101"),
    ],
)
def test_bad_cameras(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        Orthographic(**changed)  # type: ignore[arg-type]
    assert str(caught.value) == message


def test_one_pixel_is_as_much_of_the_world_everywhere(device: Device) -> None:
    """A scale bar: spheres near and far are as many pixels wide as their size says."""
    camera = Orthographic((0, 0, 10), (0, 0, 0), height=10, resolution=(100, 100))
    image = picture(Scene.from_spheres(camera, [], [(-2.5, 0, 8), (2.5, 0, -900)], 2), device)
    for number in (0, 1):
        rows, columns = np.nonzero(image.id == number)
        assert np.ptp(rows) + 1 == np.ptp(columns) + 1 == 40
    assert image.depth[50, (24, 75)] == pytest.approx((0, 908), abs=0.01)
