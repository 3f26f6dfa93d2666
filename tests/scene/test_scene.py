"""Scenes built from arrays: what is refused, by field and index, and what is kept."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import cltrace
from cltrace import Camera, Scene
from cltrace.base.arithmetic import inverses

GOOD = {"centers": [(0, 0, -3), (1, 0, -3)], "radii": 0.5}
R3 = range(3)


def build(**changed: object) -> Scene:
    arguments = {"camera": Camera(), "lights": [cltrace.point_light((1, 2, 3))], **GOOD, **changed}
    return Scene.from_spheres(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("radii", [1, [], np.zeros(0)])
@pytest.mark.parametrize("centers", [[], (), np.zeros((0, 3))])
@pytest.mark.parametrize("colors", [(1, 1, 1), [], np.zeros((0, 3))])
def test_no_spheres(centers: Any, radii: Any, colors: Any) -> None:
    scene = Scene.from_spheres(Camera(resolution=(2, 1)), [], centers, radii, colors)
    assert len(scene.spheres) == 0
    assert cltrace.render(scene).rgb8.shape == (1, 2, 3)


def test_colors_that_are_no_bytes() -> None:
    for colors in ((1, 0, 1), (2.5, 1, 0), (1000, 0, 0), np.ones((2, 3), np.uint8)):
        assert np.array_equal(build(colors=colors).materials["color"], np.atleast_2d(colors))
    assert build(background=(2.0, 0, 0)).background == (2, 0, 0)
    assert cltrace.point_light((0, 0, 0), (255.0, 2.0, 0.0))["color"].tolist() == [[255, 2, 0]]
    assert cltrace.point_light((0, 0, 0), (1000, 0, 0))["color"].tolist() == [[1000, 0, 0]]


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
    for name in {field.name for field in fields(Scene)} - {"columns"}:
        assert np.array_equal(getattr(other, name), getattr(anew, name)), name
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


def test_a_linear_map_makes_an_ellipsoid() -> None:
    """Its inverse is kept, each number rounded once."""
    one = build(transform=np.diag([1.0, 3, 0.1]))
    assert one.to_object.tolist() == [[[1, 0, 0], [0, 1 / 3, 0], [0, 0, 10]]]
    assert one.spheres["to_object"].tolist() == [0, 0]
    assert not one.to_object.flags.writeable


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


def test_one_material_is_shared_and_a_million_spheres_are_arrays() -> None:
    assert len(build().materials) == 1
    assert len(build(colors=[(1, 0, 0), (0, 1, 0)]).materials) == 2
    n = 1_000_000
    scene = Scene.from_spheres(Camera(), [], np.zeros((n, 3)), 1.0)
    assert scene.spheres.nbytes <= 48 * n


@pytest.mark.parametrize("angle", [1.0, 1e-3, 1e-7, 1e-9])
def test_basis_is_orthonormal_even_if_up_is_nearly_the_view(angle: float) -> None:
    camera = Camera((3, -2, 7), (1, 5, 2), (1 + angle, -3.5 + 2 * angle, 2.5))
    rows = [[Fraction(x) for x in row] for row in camera.basis()]
    for i in R3:
        for j in R3:
            dot = sum(rows[i][k] * rows[j][k] for k in R3)
            assert abs(dot - (i == j)) < 1e-15
