"""Scenes built from arrays: what is refused, by field and index, and what is kept."""

from __future__ import annotations

import math
import pickle

import mpmath
import numpy as np
import pytest

import cltrace
from cltrace import Camera, Scene

GOOD = {"centers": [(0, 0, -3), (1, 0, -3)], "radii": 0.5}


def build(**changed: object) -> Scene:
    arguments = {"camera": Camera(), "lights": [cltrace.point_light((1, 2, 3))], **GOOD, **changed}
    return Scene.from_spheres(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"centers": [(0, 0), (1, 1)]}, "centers: must have shape (n, 3), got (2, 2)"),
        ({"centers": [(0, 0, 0), (0, math.nan, 0)]}, "centers[1][1]: must be a finite number, got nan"),
        (
            {"centers": [(0, 0, 0), (0, 1e39, 0)]},
            "centers[1][1]: must not exceed 3.4e38 in magnitude, got 1e+39",
        ),
        ({"centers": [("0", "0", "0")]}, "centers: must be numbers, got '0' among them"),
        ({"radii": [1, 0]}, "radii[1]: must be > 0, got 0"),
        ({"radii": -1}, "radii: must be > 0, got -1"),
        ({"radii": [1, math.inf]}, "radii[1]: must be a finite number, got inf"),
        ({"radii": 1e-46}, "radii: must be 0 or at least 1.4e-45 in magnitude, got 1e-46"),
        ({"radii": [1, 2, 3]}, "radii: must have shape (2,) or be one value, got (3,)"),
        ({"radii": True}, "radii: must be numbers, got True"),
        ({"radii": None}, "radii: must be numbers, got None"),
        ({"colors": (-1, 0, 0)}, "colors[0]: must be >= 0, got -1"),
        ({"exponent": -1}, "exponent: must be >= 0, got -1"),
        ({"ks": [0, math.nan]}, "ks[1]: must be a finite number, got nan"),
        ({"lights": [cltrace.parallel_light((0, 0, 0))]}, "lights.direction[0]: must not be 0"),
        (
            {"lights": [cltrace.point_light((0, 0, math.inf))]},
            "lights.position[0][2]: must be a finite number, got inf",
        ),
        ({"background": (0, 0, -0.5)}, "background[2]: must be >= 0, got -0.5"),
        (
            {"lights": [cltrace.spot_light((0, 0, 0), (1, 0, 0), 30, 20)]},
            "lights.alpha1[0]: must be <= alpha2, got 30 > 20",
        ),
    ],
)
def test_bad_arrays(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        build(**changed)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"horizontal_fov": 0}, "camera.horizontal_fov: must be within (0, 90), got 0"),
        ({"horizontal_fov": 90}, "camera.horizontal_fov: must be within (0, 90), got 90"),
        ({"horizontal_fov": -5}, "camera.horizontal_fov: must be within (0, 90), got -5"),
        ({"horizontal_fov": 180}, "camera.horizontal_fov: must be within (0, 90), got 180"),
        ({"horizontal_fov": math.nan}, "camera.horizontal_fov: must be a finite number, got nan"),
        ({"lookat": (0, 0, 0)}, "camera.lookat: must differ from position"),
        ({"up": (0, 0, 0)}, "camera.up: must not be 0"),
        ({"up": (0, 0, 3)}, "camera.up: must not be parallel to the view"),
        ({"position": (1, 2)}, "camera.position: must have shape (3,), got (2,)"),
        ({"resolution": (0, 5)}, "camera.resolution: must be within 1..65536 each and 268435456 pixels, got 0x5"),
        ({"resolution": (2.5, 5)}, "camera.resolution: must be two integers (width, height), got (2.5, 5)"),
        ({"resolution": (1, 2, 3)}, "camera.resolution: must be two integers (width, height), got (1, 2, 3)"),
        ({"max_bounces": -1}, "camera.max_bounces: must be within 0..100, got -1"),
    ],
)
def test_bad_cameras(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        Camera(**changed)  # type: ignore[arg-type]
    assert str(caught.value) == message


def test_scene_is_immutable_and_a_copy() -> None:
    radii = np.array([1.0, 2.0])
    scene = build(radii=radii)
    radii[0] = 9
    assert scene.spheres["radius"].tolist() == [1, 2]
    with pytest.raises(ValueError):
        scene.spheres["radius"][0] = 3


def test_pickle() -> None:
    scene = build()
    again = pickle.loads(pickle.dumps(scene))
    assert again.camera == scene.camera
    for name in ("spheres", "materials", "lights"):
        assert np.array_equal(getattr(again, name), getattr(scene, name))


def test_one_material_is_shared_and_a_million_spheres_are_arrays() -> None:
    assert len(build().materials) == 1
    assert len(build(colors=[(1, 0, 0), (0, 1, 0)]).materials) == 2
    n = 1_000_000
    scene = Scene.from_spheres(Camera(), [], np.zeros((n, 3)), 1.0)
    assert scene.spheres.nbytes <= 48 * n


@pytest.mark.parametrize("angle", [1.0, 1e-3, 1e-7, 1e-9])
def test_basis_is_orthonormal_even_if_up_is_nearly_the_view(angle: float) -> None:
    camera = Camera((3, -2, 7), (1, 5, 2), (1 + angle, -3.5 + 2 * angle, 2.5))
    mpmath.mp.dps = 50
    rows = [mpmath.matrix(row) for row in camera.basis()]
    for i in range(3):
        for j in range(3):
            dot = sum(rows[i][k] * rows[j][k] for k in range(3))
            assert abs(dot - (i == j)) < 1e-15
