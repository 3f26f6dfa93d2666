"""Pictures in front of a background that lets through."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture
from random_scenes import random_scene

import cltrace
from cltrace import cli
from cltrace.run.devices import Device

SCENE = Path(__file__).parent.parent / "scenes" / "step3-shadows.xml"


@pytest.mark.parametrize("alpha", [0.0, 0.3, 1.0])
def test_alpha_is_1_on_surfaces_and_the_backgrounds_elsewhere(alpha: float, any_device: Device) -> None:
    scene = random_scene(1)
    thin = scene.in_front_of((*scene.background, alpha))
    plain = cltrace.render(scene, any_device, outputs=("rgb8", "id"))
    image = cltrace.render(thin, any_device, outputs=("alpha", "rgba8", "rgb8"))
    assert image.outputs == ("rgb8", "rgba8", "alpha")
    assert np.array_equal(image.rgb8, plain.rgb8)  # colours are not multiplied by alpha
    assert np.array_equal(image.rgba8[..., :3], plain.rgb8)
    hit = plain.id >= 0
    assert 0 < hit.sum() < hit.size
    assert (image.alpha == np.where(hit, np.float32(1), np.float32(alpha))).all()
    assert (image.rgba8[..., 3] == np.where(hit, 255, int(alpha * 255 + 0.5))).all()
    cut = cltrace.render(thin, any_device, outputs=("rgba8",), truncate=True)
    assert (cut.rgba8[~hit][:, 3] == int(alpha * 255)).all()
    assert cut.outputs == ("rgba8",)
    assert np.array_equal(cut.as_rgb8(), cut.rgba8[..., :3])


def test_a_transparent_background_is_seen_in_all_that_shows_a_picture(any_device: Device, tmp_path: Path) -> None:
    scene = random_scene(1)
    for clear in (scene.in_front_of("#00000000"), replace(scene, background_alpha=0.0)):
        image = cltrace.render(clear, any_device)
        assert image.outputs == ("rgb8", "rgba8")
        assert np.asarray(image) is image.rgba8
        image.save(tmp_path / "a.png")
        for data in ((tmp_path / "a.png").read_bytes(), image._repr_png_()):
            with Picture.open(io.BytesIO(data)) as picture:
                assert picture.mode == "RGBA"
                assert np.array_equal(np.asarray(picture), image.rgba8)
    assert np.asarray(cltrace.render(scene, any_device)).shape[2] == 3
    renderer = cltrace.Renderer(clear, any_device, outputs=("rgb8", "id"))
    image = renderer.look(replace(scene.camera, horizontal_fov=20)).render(None)
    assert np.array_equal(image.rgba8[..., 3], np.where(image.id >= 0, 255, 0))


def test_the_backgrounds_alpha_stays_with_the_scene() -> None:
    scene = random_scene(1)
    assert (scene.background_alpha, len(scene.background)) == (1, 3)
    clear = cltrace.Scene.from_spheres(cltrace.Camera(), [], [(0, 0, -3)], 1, background=(0.1, 0.2, 0.3, 0.5))
    assert (clear.background, clear.background_alpha) == ((0.1, 0.2, 0.3), 0.5)
    assert clear.seen_by(cltrace.Camera((0, 0, 1))).background_alpha == 0.5
    assert replace(clear, output_file="b.png").background_alpha == 0.5
    assert replace(clear, background=(1, 1, 1)).background_alpha == 0.5
    assert replace(clear, background=(1, 1, 1, 0.25)).background_alpha == 0.25
    assert clear.in_front_of("white").background_alpha == 1
    assert clear.in_front_of("white").spheres is clear.spheres
    assert cltrace.Scene.from_meshes(cltrace.Camera(), [], [], background="#fff0").background_alpha == 0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"background": (1, 1, 1, 1.5)}, "background_alpha: must be within 0..1, as it is an alpha, got 1.5"),
        ({"background": (1, 1, 1, -0.5)}, "background_alpha: must be within 0..1, as it is an alpha, got -0.5"),
        ({"background": (1, 1)}, "background: must have shape (3,), got (2,)"),
        ({"background": (0, 0, 200, 0)}, "background: must be linear with 1 as full, but whole numbers up to 200"),
        ({"background_alpha": 2}, "background_alpha: must be within 0..1, as it is an alpha, got 2"),
    ],
)
def test_what_is_no_alpha_is_said(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        replace(random_scene(1), **given)
    assert str(caught.value).startswith(message)


def test_transparent_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "a.png"
    assert cli.main([str(SCENE), "--size", "90x60", "--transparent", "-o", str(target), "--check=all"]) == 0
    with Picture.open(target) as picture:
        pixels = np.asarray(picture)
    scene = cltrace.load(SCENE)
    image = cltrace.render(scene.seen_by(replace(scene.camera, resolution=(90, 60))), outputs=("rgb8", "id"))
    assert np.array_equal(pixels[..., :3], image.rgb8)
    assert np.array_equal(pixels[..., 3], np.where(image.id >= 0, 255, 0))
    assert (image.id < 0).sum() > 0
    capsys.readouterr()
    assert cli.main([str(SCENE), "--transparent", "--show", "depth", "-o", str(target)]) == 2
    assert capsys.readouterr().err == "cltrace: --transparent goes with --show color\n"
