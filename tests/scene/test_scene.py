"""Scenes built from arrays: what is refused, by field and index, and what is kept."""

from __future__ import annotations

import math
import pickle
from array import array
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest

import cltrace
from cltrace import Camera, Scene
from cltrace.base.arithmetic import inverses
from cltrace.scene import MATERIAL, SPHERE

GOOD = {"centers": [(0, 0, -3), (1, 0, -3)], "radii": 0.5}
MASKED = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
BYTES = "must be linear with 1 as full, but whole numbers up to {} look like bytes of 0 to 255; divide by 255"
R3 = range(3)
SPHERES, MATERIALS = np.zeros(0, SPHERE), np.zeros(0, MATERIAL)


def build(**changed: object) -> Scene:
    arguments = {"camera": Camera(), "lights": [cltrace.point_light((1, 2, 3))], **GOOD, **changed}
    return Scene.from_spheres(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"centers": [(0, 0), (1, 1)]}, "centers: must have shape (n, 3), got (2, 2)"),
        ({"centers": [(0, 0, 0), (0, math.nan, 0)]}, "centers[1][1]: must be a finite number, got nan"),
        ({"centers": [("0", "0", "0")]}, "centers: must be numbers, got '0' among them"),
        ({"radii": [1, 0]}, "radii[1]: must be > 0, got 0"),
        ({"radii": -1}, "radii: must be > 0, got -1"),
        ({"radii": 1e-46}, "radii: must be at least 1.4e-45 in magnitude, got 1e-46"),
        ({"radii": [1, 2, 3]}, "radii: must have shape (2,) or be one value, got (3,)"),
        ({"radii": True}, "radii: must be numbers, got True"),
        ({"colors": (-1, 0, 0)}, "colors[0]: must be >= 0, got -1"),
        ({"exponent": -1}, "exponent: must be >= 0, got -1"),
        ({"background": (0, 0, -0.5)}, "background[2]: must be >= 0, got -0.5"),
        # What is no real number, or none that a double can hold, at any depth.
        ({"centers": [(0, 0, 1j), (0, 0, 0)]}, "centers: must be numbers, got 1j among them"),
        (
            {"centers": np.zeros((2, 3), complex)},
            "centers: must be numbers, got an array of complex128, shape (2, 3)",
        ),
        (
            {"radii": [np.timedelta64(1, "s"), 1]},
            "radii: must be numbers, got 1 seconds (timedelta64[s]) among them",
        ),
        ({"radii": [np.True_, 1]}, "radii: must be numbers, got True (bool) among them"),
        ({"radii": [1, None]}, "radii: must be numbers, got None among them"),
        ({"radii": b"12"}, "radii: must be numbers, got b'12'"),
        ({"radii": {1, 2}}, "radii: must be numbers, got {1, 2}"),
        ({"radii": MASKED}, "radii: must not be masked; use its filled() or compressed()"),
        ({"background": [0, 0, np.ma.masked]}, "background: must not be masked; use its filled() or compressed()"),
        (
            {"centers": [(0, 0, 10**400), (0, 0, 0)]},
            "centers: must not exceed 3.4e38 in magnitude, got an integer beyond 1.7e308",
        ),
        ({"centers": [(0, 0, 0), (0, 0)]}, "centers: must be an array, got rows of different lengths"),
        # Colours that are bytes.
        ({"colors": (255, 128, 0)}, f"colors: {BYTES.format(255)}"),
        ({"colors": (255.0, 128.0, 0.0)}, f"colors: {BYTES.format(255)}"),
        ({"background": (0, 2, 0)}, f"background: {BYTES.format(2)}, or write 2.0"),
        # Arguments in each other's place.
        (
            {"centers": [0.5, 0.5], "radii": [(0, 0, -3), (1, 0, -3)]},
            "centers: must have shape (n, 3), got (2,); radii has shape (2, 3): are the two swapped?",
        ),
    ],
)
def test_bad_arrays(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        build(**changed)
    assert str(caught.value) == message


@pytest.mark.parametrize("radii", [1, [], np.zeros(0)])
@pytest.mark.parametrize("centers", [[], (), np.zeros((0, 3))])
@pytest.mark.parametrize("colors", [(1, 1, 1), [], np.zeros((0, 3))])
def test_no_spheres(centers: Any, radii: Any, colors: Any) -> None:
    scene = Scene.from_spheres(Camera(resolution=(2, 1)), [], centers, radii, colors)
    assert len(scene.spheres) == 0
    assert cltrace.render(scene).rgb8.shape == (1, 2, 3)


def test_a_list_that_contains_itself_is_no_number() -> None:
    endless: list[object] = []
    endless.append(endless)
    with pytest.raises(ValueError, match=r"^radii: must be numbers, got \[.*\] among them$"):
        build(radii=endless)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: Scene(Camera(), [], np.array([1.0, 2.0]), MATERIALS),  # type: ignore[arg-type]
            "spheres: must be an (n,) array of dtype cltrace.scene.SPHERE, got an array of float64, shape (2,); "
            "Scene.from_spheres() takes plain arrays",
        ),
        (
            lambda: Scene(Camera(), [], SPHERES, [1.0]),  # type: ignore[arg-type]
            "materials: must be an (n,) array of dtype cltrace.scene.MATERIAL, got [1.0]; "
            "Scene.from_spheres() takes plain arrays",
        ),
        (
            lambda: Scene([], Camera(), SPHERES, MATERIALS),  # type: ignore[arg-type]
            "camera: must be a cltrace.Camera or Orthographic, got []; the order is camera, lights, spheres, materials",
        ),
        (
            lambda: Scene(Camera(), [], SPHERES, MATERIALS, (0, 0, 0), 5),  # type: ignore[arg-type]
            "output_file: must be a text, got 5",
        ),
        (
            lambda: build(camera=[cltrace.ambient_light()], lights=Camera()),
            "camera: must be a cltrace.Camera or Orthographic, got a list of arrays; "
            "the order is camera, lights, centers, radii, colors",
        ),
        (lambda: build().seen_by((0, 0, 1)), "camera: must be a cltrace.Camera or Orthographic, got (0, 0, 1)"),  # type: ignore[arg-type]
        (lambda: build(lights=5), "lights: must be a list of lights, got 5"),
        (
            lambda: build(lights=[(1, 2, 3)]),
            "lights: must be a list of what ambient_light(), point_light(), sky_light() and the like return, "
            "got (1, 2, 3) among them",
        ),
    ],
)
def test_what_is_something_else_altogether(call: Callable[[], object], message: str) -> None:
    with pytest.raises(TypeError) as caught:
        call()
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cltrace.point_light((1, 2)), "light.position: must be 3 numbers, got (1, 2)"),
        (lambda: cltrace.parallel_light((0, 0, 1j)), "light.direction: must be numbers, got 1j among them"),
        (lambda: cltrace.spot_light((0, 0, 0), (0, 0, 1), (1, 2), 3), "light.alpha1: must be one number, got (1, 2)"),  # type: ignore[arg-type]
        (lambda: cltrace.ambient_light((255, 255, 255)), f"light.color: {BYTES.format(255)}"),
        (lambda: cltrace.ambient_light((3, 3, 3)), f"light.color: {BYTES.format(3)}, or write 3.0"),
    ],
)
def test_bad_lights(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        call()
    assert str(caught.value) == message


def test_colors_that_are_no_bytes() -> None:
    for colors in ((1, 0, 1), (2.5, 1, 0), (1000, 0, 0), np.ones((2, 3), np.uint8)):
        assert np.array_equal(build(colors=colors).materials["color"], np.atleast_2d(colors))
    assert build(background=(2.0, 0, 0)).background == (2, 0, 0)


def test_a_light_may_be_brighter_than_1() -> None:
    """Whole floats are brightnesses; whole numbers above 255 are no bytes."""
    assert cltrace.point_light((0, 0, 0), (255.0, 2.0, 0.0))["color"].tolist() == [[255, 2, 0]]
    assert cltrace.point_light((0, 0, 0), (1000, 0, 0))["color"].tolist() == [[1000, 0, 0]]
    assert cltrace.point_light((0, 0, 0), (1, 0, 1))["color"].tolist() == [[1, 0, 1]]


def test_unlit_sides_are_seen_and_lit_ones_have_their_colour() -> None:
    """Without light, kd of the ambient light; facing a white light beside the default ambient light, exactly 1."""
    scene = build(lights=[cltrace.ambient_light()], colors=(0.5, 0.25, 1))
    material = scene.materials[0]
    assert material["ka"] == material["kd"] == 0.8
    assert (scene.lights["color"][0] * material["ka"] + material["kd"]).tolist() == [1, 1, 1]
    two = build(kd=[0.25, 0.5])
    assert two.materials["ka"].tolist() == two.materials["kd"].tolist() == [0.25, 0.5]
    assert build(ka=0.125).materials["ka"].tolist() == [0.125]


def test_vectors_are_whatever_numpy_takes() -> None:
    camera = Camera(np.array([1, 2, 3]), lookat=np.zeros(3, np.float32), up=[0, 1, 0], resolution=np.array([64, 48]))
    assert camera == Camera((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), resolution=(64, 48))
    assert hash(camera) == hash(replace(camera))
    light = cltrace.spot_light(np.ones(3), [0, 0, -1], np.float32(10), 20)
    assert np.array_equal(light, cltrace.spot_light((1, 1, 1), (0, 0, -1), 10, 20))
    scene = build(lights=light, radii=range(1, 3), ks=array("d", [0, 1]), background=np.full(3, 0.5))
    assert scene.spheres["radius"].tolist() == [1, 2]
    assert scene.materials["ks"].tolist() == [0, 1]
    assert scene.background == (0.5, 0.5, 0.5)
    again = Scene(camera, [light, light], scene.spheres, scene.materials)
    assert again.lights.shape == (2,)


def test_pixels_are_square_unless_told_otherwise() -> None:
    x, y = Camera(resolution=(64, 48)).image_plane()
    assert y / x == pytest.approx(48 / 64, abs=1e-15)
    x, y = Camera(resolution=(64, 48), square_pixels=False).half_angles()
    assert (x, y) == (45, 45 * 48 / 64)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"horizontal_fov": 0}, "camera.horizontal_fov: must be within (0, 90), got 0"),
        ({"horizontal_fov": 90}, "camera.horizontal_fov: must be within (0, 90), got 90"),
        ({"lookat": (0, 0, 0)}, "camera.lookat: must differ from position"),
        ({"up": (0, 0, 0)}, "camera.up: must not be 0"),
        ({"up": (0, 0, 3)}, "camera.up: must not be parallel to the view"),
        ({"position": (1, 2)}, "camera.position: must have shape (3,), got (2,)"),
        ({"resolution": (0, 5)}, "camera.resolution: must be within 1..65536 each and 1073741824 pixels, got 0x5"),
        ({"resolution": (2.5, 5)}, "camera.resolution: must be two integers (width, height), got (2.5, 5)"),
        ({"resolution": "64x48"}, "camera.resolution: must be two integers (width, height), got '64x48'"),
        (
            {"resolution": (10**5000, 5)},
            "camera.resolution: must be within 1..65536 each and 1073741824 pixels, got an integer of 16610 bitsx5",
        ),
        ({"max_bounces": -1}, "camera.max_bounces: must be within 0..100, got -1"),
        ({"square_pixels": 1}, "camera.square_pixels: must be True or False, got 1"),
        ({"up": np.ma.array([0, 1, 0])}, "camera.up: must not be masked; use its filled() or compressed()"),
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


def test_seen_by_another_camera() -> None:
    """What a scene made anew would hold, without a copy."""
    scene, camera = build(background=(0.1, 0.2, 0.3), output_file="x.png"), Camera((0, 0, 9))
    other, anew = scene.seen_by(camera), replace(scene, camera=camera)
    for field in fields(Scene):
        assert np.array_equal(getattr(other, field.name), getattr(anew, field.name)), field.name
    assert other.camera is camera
    assert scene.camera == Camera()
    assert other.spheres is scene.spheres
    assert not anew.spheres.flags.writeable


def test_materials_that_mirror_and_let_through() -> None:
    scene = build(reflectance=[0.25, 0], transmittance=0.5, index=[1.5, 1.25])
    assert scene.materials["reflectance"].tolist() == [0.25, 0]
    assert scene.materials["transmittance"].tolist() == [0.5, 0.5]
    assert scene.materials["index"].tolist() == [1.5, 1.25]
    assert len(build(reflectance=0.3, transmittance=2, index=1.5).materials) == 1
    assert build().materials[["reflectance", "transmittance", "index"]].tolist() == [(0, 0, 1)]
    assert build(index=0).materials["index"].tolist() == [0]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"reflectance": -0.5}, "reflectance: must be >= 0, got -0.5"),
        ({"transmittance": [0, -1]}, "transmittance[1]: must be >= 0, got -1"),
        ({"index": math.inf}, "index: must be a finite number, got inf"),
        ({"index": 0, "transmittance": 0.5}, "index: must be > 0 where transmittance > 0, got 0"),
        ({"index": [1, -1], "transmittance": 0.5}, "index[1]: must be > 0 where transmittance > 0, got -1"),
        ({"transform": [1, 2, 3]}, "transform: must have shape (3, 3) or (2, 3, 3), got (3,)"),
        ({"transform": np.diag([1, 1, math.nan])}, "transform[2][2]: must be a finite number, got nan"),
        ({"transform": np.zeros((3, 3))}, "transform: must not be singular"),
        (
            {"transform": [[1, 2, 3], [4, 5, 6], [7, 8, 9 + 1e-12]]},
            "transform: must not distort so much that rounding spoils its inverse",
        ),
        (
            {"transform": np.diag([1, 1, 1e-40])},
            "transform: its inverse must not exceed 3.4e38 in magnitude, got 1e+40",
        ),
        (
            {"transform": [np.eye(3), np.diag([1, 1e38, 1])], "radii": [1, 10]},
            "transform: of sphere 1, half of the extent along y must not exceed 3.4e38 in magnitude, got 1e+39",
        ),
        (
            {"transform": 1e-38 * np.eye(3), "radii": [1, 1e-38]},
            "transform: of sphere 1, the radius must be at least 1.4e-45 in magnitude, got 1e-76",
        ),
    ],
)
def test_bad_mirrors_glass_and_ellipsoids(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        build(**changed)
    assert str(caught.value) == message


def test_a_linear_map_makes_an_ellipsoid() -> None:
    """Its inverse is kept, each number rounded once."""
    one = build(transform=np.diag([1.0, 3, 0.1]))
    assert one.to_object.tolist() == [[[1, 0, 0], [0, 1 / 3, 0], [0, 0, 10]]]
    assert one.spheres["to_object"].tolist() == [0, 0]
    assert not one.to_object.flags.writeable
    rng = np.random.default_rng(5)
    maps = rng.normal(size=(2, 3, 3))
    maps[1, 2] = maps[1, 0] * 3 + maps[1, 1] * 2 + maps[1, 2] * 2.0**-20
    scene = build(transform=maps)
    mpmath.mp.dps = 80
    for transform, to_object in zip(maps, scene.to_object, strict=True):
        inverse = mpmath.matrix(transform.tolist()) ** -1
        assert [[float(inverse[i, j]) for j in range(3)] for i in range(3)] == to_object.tolist()


def hostile_maps(rng: np.random.Generator, count: int) -> Iterator[np.ndarray]:
    """(n, 3, 3) maps: usual, nearly singular in part, of very different sizes, nearly singular, simple, straight."""
    usual, wide = rng.normal(size=(count, 3, 3)), rng.normal(size=(count, 3, 3))
    wide *= 2.0 ** rng.uniform(-140, 120, wide.shape)
    flat = np.linalg.qr(usual)[0] * 2.0 ** rng.uniform(-60, 0, (count, 1, 3)) @ np.linalg.qr(wide)[0]
    few = rng.choice([0, 1, -1, 3, 2.0**-149, -3.4e38], usual.shape)
    narrow = usual.copy()
    narrow[:, 1, 1] = usual[:, 1, 2] * usual[:, 2, 1] / usual[:, 2, 2]
    yield from (usual, narrow, np.where(np.abs(wide) < 2.0**-149, 0, wide), flat, few, usual * np.eye(3))


def test_inverses_are_rounded_once() -> None:
    """By pairs of doubles as by whole numbers, and by these as by fractions."""
    rng = np.random.default_rng(8)
    for maps in hostile_maps(rng, 500):
        together = inverses(maps)
        one_by_one = np.concatenate([inverses(maps[k : k + 1]) for k in range(len(maps))])
        np.testing.assert_array_equal(together, one_by_one)
        for a, b in zip(maps[:20], together, strict=False):
            m = [[Fraction(x) for x in row] for row in a.tolist()]
            cross = [[m[j - 2][i - 2] * m[j - 1][i - 1] - m[j - 2][i - 1] * m[j - 1][i - 2] for j in R3] for i in R3]
            determinant = sum(m[0][k] * cross[k][0] for k in R3)
            want = [[float(x / determinant) if determinant else math.nan for x in row] for row in cross]
            np.testing.assert_array_equal(b, want)


def test_a_map_that_keeps_spheres_round_leaves_spheres() -> None:
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    scene = build(transform=[-2 * turn, np.diag([3, 3, -3])])
    assert len(scene.to_object) == 0
    assert scene.spheres["to_object"].tolist() == [-1, -1]
    assert scene.spheres["radius"].tolist() == [1, 1.5]
    scene = build(transform=[np.eye(3), np.diag([3, 3, 4])])
    assert scene.spheres["to_object"].tolist() == [-1, 0]
    assert scene.spheres["radius"].tolist() == [0.5, 0.5]


@pytest.mark.parametrize(
    ("to_object", "index", "message"),
    [
        ((), 0, "spheres.to_object[1]: must be -1 or the index of one of to_object, got 0"),
        ([np.eye(3)], 1, "spheres.to_object[1]: must be -1 or the index of one of to_object, got 1"),
        (np.eye(3), 0, "to_object: must have shape (n, 3, 3), got (3, 3)"),
        (np.zeros((0, 3)), -1, "to_object: must have shape (n, 3, 3), got (0, 3)"),
        (None, -1, "to_object: must be numbers, got None"),
        ([np.eye(3), np.ones((3, 3))], 0, "to_object[1]: must not be singular"),
        ([np.diag([1, 1e39, 1])], 0, "to_object[0][1][1]: must not exceed 3.4e38 in magnitude, got 1e+39"),
        (
            [np.diag([1, 1, 1e-40])],
            0,
            "spheres.radius[1]: half of the extent along z must not exceed 3.4e38 in magnitude, got 5e+39",
        ),
    ],
)
def test_bad_maps(to_object: Any, index: int, message: str) -> None:
    scene = build()
    spheres = scene.spheres.copy()
    spheres["to_object"][1] = index
    with pytest.raises(ValueError) as caught:
        replace(scene, spheres=spheres, to_object=to_object)
    assert str(caught.value) == message


def test_pickle() -> None:
    scene = build(transform=np.diag([1, 2, 3]))
    again = pickle.loads(pickle.dumps(scene))
    assert again.camera == scene.camera
    for name in ("spheres", "materials", "lights", "to_object"):
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
