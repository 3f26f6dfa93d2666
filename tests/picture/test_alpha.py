"""Pictures in front of a background that lets through."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture
from random_scenes import usual_scene

import cltrace
from cltrace import cli
from cltrace.run.devices import Device
from cltrace.scene.colors import encoded

SCENE = Path(__file__).parents[2] / "scenes" / "step3-shadows.xml"


@pytest.mark.parametrize("alpha", [0.0, 0.3, 1.0])
def test_alpha_is_1_on_surfaces_and_the_backgrounds_elsewhere(alpha: float, any_device: Device) -> None:
    scene = usual_scene()
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
    scene = usual_scene()
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
    scene = usual_scene()
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


def balls(**given: Any) -> cltrace.Scene:
    random = np.random.default_rng(7)
    camera = cltrace.Camera((0, 0, 6), (0, 0, 0), horizontal_fov=20, resolution=(60, 44))
    lights = [cltrace.ambient_light(), cltrace.point_light((4, 7, 9))]
    centers, colors = random.uniform(-1.5, 1.5, (30, 3)), random.uniform(0, 1, (30, 3))
    return cltrace.Scene.from_spheres(camera, lights, centers, random.uniform(0.02, 0.5, 30), colors, **given)


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.0, 0.4])
@pytest.mark.parametrize("transfer", ["linear", "srgb"])
def test_smooth_edges_lie_well_on_white_and_on_black(alpha: float, transfer: Any, any_device: Device) -> None:
    """A cut-out, laid on a colour in linear light, is the picture with that colour behind the background's share."""
    clear = balls(background=(0.2, 0.5, 0.3, alpha), transfer=transfer)
    outputs: Any = ("color", "alpha", "rgba8", "rgb8", "error")
    image = cltrace.render(clear, any_device, outputs=outputs, antialias=True, samples=1024)
    assert (image.alpha > 0.01).any()
    assert ((alpha + 0.01 < image.alpha) & (image.alpha < 0.99)).sum() > 200
    assert np.array_equal(image.rgba8[..., :3], image.rgb8)
    assert np.abs(image.rgba8[..., 3] - 255.0 * image.alpha).max() < 0.51
    shown = 255 * encoded(image.color, transfer)
    assert np.abs(image.rgb8 - shown).max() < 0.51
    for ground in ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)):
        behind = alpha * np.array(clear.background) + (1 - alpha) * np.array(ground)
        whole = replace(clear, background=tuple(behind), background_alpha=1.0, transfer="linear")
        right = cltrace.render(whole, any_device, outputs=("color", "rgb8", "error"), antialias=True, samples=1024)
        laid = image.color * image.alpha[..., None] + (1 - image.alpha[..., None]) * ground
        # Each has its own error, which 95 of 100 pixels keep: other backgrounds ask for other numbers of rays.
        within = 255 * np.abs(laid - right.color).max(axis=2) <= image.error + right.error + 0.01
        assert within.mean() >= 0.95
        assert np.abs(laid - right.color).mean() <= 0.2 / 255
        if transfer == "linear":
            share = image.rgba8[..., 3:] / 255
            assert np.abs(image.rgb8 * share + 255 * (1 - share) * ground - 255 * laid).max() <= 1


@pytest.mark.slow
def test_alone_colours_are_straight_too(any_device: Device) -> None:
    clear = balls(background="#33804d00")
    both = cltrace.render(clear, any_device, outputs=("color", "rgba8"), antialias=True)
    alone = cltrace.render(clear, any_device, outputs=("color",), antialias=True)
    assert alone.outputs == ("color",)
    assert np.array_equal(alone.color, both.color)
    opaque = cltrace.render(clear.in_front_of("#33804d"), any_device, outputs=("rgb8", "rgba8"), antialias=True)
    assert np.array_equal(opaque.rgba8[..., :3], opaque.rgb8)
    assert (opaque.rgba8[..., 3] == 255).all()


@pytest.mark.slow
def test_a_following_renderer_is_antialiased_as_the_first(any_device: Device) -> None:
    first = cltrace.Renderer(balls(background="white"), any_device, antialias=True)
    clear = balls(background="#ffffff00")
    found, fresh = first.following(clear).render(), cltrace.render(clear, any_device, antialias=True)
    assert found.outputs == fresh.outputs == ("rgb8", "rgba8")
    assert np.array_equal(found.rgba8, fresh.rgba8)


@pytest.mark.slow
def test_the_error_of_srgb_is_about_its_bytes(any_device: Device) -> None:
    scene = balls(background="#101010", transfer="srgb")
    image = cltrace.render(scene, any_device, outputs=("color", "error"), antialias=True)
    linear = cltrace.render(replace(scene, transfer="linear"), any_device, outputs=("color", "error"), antialias=True)
    assert np.array_equal(image.color, linear.color)
    e = linear.error.astype(float)[..., None] / 255
    # Whatever the true mean is within the linear bound, its sRGB is within the other.
    for share in (-1, -0.5, 0.5, 1):
        true = np.clip(linear.color + share * e, 0, 1)
        off = 255 * np.abs(encoded(true, "srgb") - encoded(linear.color, "srgb")).max(axis=-1)
        assert (off <= image.error).all()
    assert (image.error >= linear.error * 0.42).all()  # the curve's least slope is 0.44
    assert image.error.max() < 13 * linear.error.max() + 1e-6
