"""Colours that are given and written as sRGB, with light that adds up linearly between."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import colormaps
from test_colors import bytes_shown, unlit
from test_outputs import png16

import cltrace
from cltrace import Image, Material, Mesh, Scene, ambient_light, parallel_light
from cltrace.picture.composition import srgb_bytes
from cltrace.run.devices import Device
from cltrace.scene.colors import decoded, encoded
from cltrace.students.check import check

CAMERA = cltrace.Camera((0, 0, 6), (0, 0, 0), horizontal_fov=20, resolution=(64, 48))
SQUARE = ([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2), (0, 2, 3)])
UNLIT = {"ka": 1, "kd": 0, "ks": 0}


def lit(**given: Any) -> Scene:
    lights = [ambient_light(), parallel_light((-3, -5, -6))]
    return Scene.from_spheres(CAMERA, lights, [(-1, 0, 0), (1, 0, 0)], 0.9, transfer="srgb", **given)


def test_the_curve_is_that_of_the_standard() -> None:
    """Values of IEC 61966-2-1, worked out by its formulas by hand."""
    levels = np.array([0, 10, 11, 128, 188, 255])
    linear = np.array([0, 0.0030352698, 0.0033465358, 0.2158605001, 0.5028864580, 1])
    assert np.allclose(decoded(levels / 255, "srgb"), linear, rtol=1e-9)
    assert np.allclose(encoded(linear, "srgb") * 255, levels, rtol=1e-7)
    assert encoded([1.0], "srgb").tolist() == decoded(np.ones(1), "srgb").tolist() == [1.0]
    assert decoded(levels / 255, "linear").tolist() == (levels / 255).tolist()


@pytest.mark.parametrize("truncate", [False, True])
def test_bytes_are_those_of_the_curve(truncate: bool) -> None:
    random = np.random.default_rng(0)
    linear = np.concatenate([random.uniform(-0.1, 1.1, 100_000), 10 ** random.uniform(-9, 0, 100_000), [0, 1, 9e9]])
    begin = decoded((np.arange(1, 256) - (0 if truncate else 0.5)) / 255, "srgb").astype(np.float32)
    near = [np.nextafter(begin, np.float32(way)) for way in (0, 2)]
    color = np.concatenate([linear.astype(np.float32), *near]).reshape(-1, 1, 1)
    exact = encoded(np.clip(color, 0, 1), "srgb") * 255 + (0 if truncate else 0.5)
    assert np.array_equal(srgb_bytes(color, truncate), np.floor(exact))


def test_bytes_that_are_given_come_back(device: Device) -> None:
    own = colormaps["viridis"](np.arange(256), bytes=True)[:, :3]
    scene = unlit(256, values=np.arange(256), background="#123456", transfer="srgb")
    assert np.array_equal(bytes_shown(scene, device), own)
    image = cltrace.render(scene, device, outputs=("rgb8", "rgba8", "id"))
    assert image.outputs == ("rgb8", "id", "rgba8")
    assert (image.rgb8[image.id < 0] == (0x12, 0x34, 0x56)).all()
    assert np.array_equal(image.rgba8[..., :3], image.rgb8)
    renderer = cltrace.Renderer(scene, device)
    renderer.update(colors="#fedcba")
    assert (renderer.render().rgb8[image.id >= 0] == (0xFE, 0xDC, 0xBA)).all()
    assert (cltrace.render(scene.in_front_of("#0a0b0c"), device).rgb8[image.id < 0] == (10, 11, 12)).all()


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_materials_and_textures_of_meshes(dtype: Any, any_device: Device) -> None:
    camera = cltrace.Camera((0, 0, 6), (0, 0, 0), horizontal_fov=9, resolution=(8, 8))
    uv = [(0, 1), (1, 1), (1, 0), (0, 0)]
    image = np.empty((2, 2, 3), dtype)
    for level in (0, 1, 5, 10, 11, 40, 127, 200, 254, 255):
        image[:] = level * (np.iinfo(dtype).max // 255)
        for material in (Material(f"#{level:02x}3010", **UNLIT), Material(texture=image, **UNLIT)):
            mesh = Mesh(*SQUARE, uv=uv, material=material)
            scene = Scene.from_meshes(camera, [ambient_light((1, 1, 1))], mesh, transfer="srgb")
            color = (level, 0x30, 0x10) if material.texture is None else (level,) * 3
            assert (cltrace.render(scene, any_device).rgb8 == color).all()


def test_light_adds_up_linearly(any_device: Device) -> None:
    """A grey that is given as 188 is half of the light of white, so that two lights of a half make it 188 of white."""
    lights = [ambient_light((0.25, 0.25, 0.25)), ambient_light((0.25, 0.25, 0.25))]
    for color, expected in (("white", 188), ("#bcbcbc", round(255 * encoded([0.25], "srgb")[0]))):
        scene = Scene.from_spheres(CAMERA, lights, [(0, 0, 0)], 5, color, **UNLIT, transfer="srgb")
        assert abs(int(cltrace.render(scene, any_device).rgb8[24, 32, 0]) - expected) <= 1
    plain = Scene.from_spheres(CAMERA, lights, [(0, 0, 0)], 5, **UNLIT)
    assert cltrace.render(plain, any_device, outputs=("rgb8", "id")).rgb8[24, 32, 0] == 128


def test_the_curve_is_the_last_step(any_device: Device, tmp_path: Path) -> None:
    scene = lit(colors=["gold", "teal"], background=(1, 1, 1, 0))
    image = cltrace.render(scene, any_device, outputs=("rgb8", "color", "alpha", "id"))
    assert image.transfer == "srgb"
    assert np.array_equal(image.rgb8, np.floor(encoded(np.clip(image.color, 0, 1), "srgb") * 255 + 0.5))
    same = cltrace.render(replace(scene, transfer="linear"), any_device, outputs=("rgb8", "color"))
    assert np.array_equal(same.color, image.color)
    assert (same.rgb8[image.id >= 0] < image.rgb8[image.id >= 0]).any()
    image.save(tmp_path / "a.png", bits=16)
    deep = png16((tmp_path / "a.png").read_bytes())
    assert np.abs(deep[..., :3] / 257 - image.rgb8).max() < 0.51
    cut = cltrace.render(scene, any_device, truncate=True)
    assert set(np.unique(image.rgb8.astype(int) - cut.rgb8)) == {0, 1}


def test_what_else_knows_the_curve(any_device: Device) -> None:
    scene = lit(colors=["gold", "teal"], background="#204060")
    image = cltrace.render(scene, any_device, outputs=("rgb8", "id"))
    report = check(scene, image, "accurate", pixels=1000)
    assert report.ok
    assert report.pixels == 1000
    for x, y in ((20, 24), (44, 24), (1, 1)):
        why = cltrace.explain(scene, x, y)
        assert why.rgb8 == tuple(image.rgb8[y, x].tolist())
        assert "curve of sRGB" in str(why)
        assert why.to_dict()["transfer"] == "srgb"
    assert "sRGB" not in str(cltrace.explain(replace(scene, transfer="linear"), 20, 24))
    with pytest.raises(ValueError, match=r"^scene: must have the transfer 'linear', as scene files have, got 'srgb'$"):
        cltrace.compare(scene, Image(rgb8=image.rgb8))
