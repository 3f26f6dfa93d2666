"""What `--show` shows: which lights reach a pixel, the camera's axes, and what the colours stand for."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENES
from PIL import Image as Picture

import cltrace
from cltrace import cli
from cltrace.explanation.pixel import Explainer
from cltrace.picture import palettes
from cltrace.run.devices import Device
from cltrace.students.lit import lighting

FOLDER = SCENES[0].parent


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("dusk", marks=pytest.mark.slow),
        "spot-colours",
        "three-lights",
        pytest.param("step4-meshes", marks=pytest.mark.slow),
    ],
)
def test_lit_is_what_the_reference_finds(name: str, device: Device) -> None:
    scene = cltrace.load(FOLDER / f"{name}.xml")
    scene = scene.seen_by(replace(scene.camera, resolution=(96, 64)))
    lit, explainer, place = cltrace.lit(scene, device), Explainer(scene), random.Random(name)
    assert lit.shape == (64, 96, len(scene.lights))
    found = set()
    for _ in range(100):
        x, y = place.randrange(96), place.randrange(64)
        ray = explainer.pixel(x, y).rays[0]
        if ray.hit is None:
            assert not lit[y, x].any()
            continue
        reach = {term.light.number for term in ray.lights if term.fate == "lit"}
        if ray.share:
            assert set(np.flatnonzero(lit[y, x])) == reach | {term.light.number for term in ray.ambient}, (x, y)
            found.add(frozenset(reach))
    assert len(found) > 2


def test_crops_and_scenes_without_lights(any_device: Device) -> None:
    scene = cltrace.load(FOLDER / "three-lights.xml")
    whole, part = cltrace.lit(scene, any_device), cltrace.lit(scene, any_device, crop=(300, 100, 340, 130))
    assert np.array_equal(whole[100:130, 300:340], part)
    dark = cltrace.Scene.from_spheres(cltrace.Camera((0, 0, 5), resolution=(8, 6)), [], [(0, 0, 0)], 1)
    assert cltrace.lit(dark, any_device).shape == (6, 8, 0)
    colors = lighting(dark, any_device).as_rgb8()
    assert sorted(np.unique(colors.reshape(-1, 3), axis=0).tolist()) == [[0] * 3, [palettes.UNLIT] * 3]
    ambient = cltrace.Scene.from_spheres(dark.camera, [cltrace.ambient_light()], [(0, 0, 0)], 1)
    assert np.array_equal(cltrace.lit(ambient, any_device)[:, :, 0], cltrace.render(ambient, outputs=("id",)).id >= 0)


def test_the_colours_of_sets_of_lights() -> None:
    seen = np.array([[True, True, True, False]])
    lit = np.array([[[1, 0, 0], [1, 1, 0], [0, 0, 0], [0, 0, 0]]], bool)
    assert palettes.light_sets(lit, seen).tolist() == [[[255, 0, 0], [255, 255, 0], [48] * 3, [0] * 3]]
    many = np.zeros((1, 4, 32), bool)
    many[0, 0, 31] = many[0, 1, 0] = many[0, 1, 2] = True
    expected = palettes.distinct(np.array([[2**31, 5, 0, 0]]))
    assert palettes.light_sets(many, seen)[0, :2].tolist() == expected[0, :2].tolist()
    assert palettes.light_sets(many, seen)[0, 2:].tolist() == [[48] * 3, [0] * 3]
    with pytest.raises(ValueError, match=r"^lit: must be of at most 32 lights, got 33$"):
        palettes.light_sets(np.zeros((1, 4, 33), bool), seen)


def test_the_command_writes_lit_and_says_its_colours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, target = FOLDER / "three-lights.xml", tmp_path / "lit.png"
    assert cli.main([str(path), "--show", "lit", "--size", "90x60", "-o", str(target)]) == 0
    lines = capsys.readouterr().err.splitlines()
    scene = cltrace.load(path)
    scene = scene.seen_by(replace(scene.camera, resolution=(90, 60)))
    found = lighting(scene)
    pixels = np.asarray(Picture.open(target))
    assert np.array_equal(pixels, found.as_rgb8())
    assert lines[0].startswith(f"cltrace: wrote {target}, 90x60, on ")
    legend = [line.split(maxsplit=4) for line in lines[1:]]
    assert len(legend) > 3
    total = 0
    for _, _, color, share, rest in legend:
        same = (pixels == [int(color[i : i + 2], 16) for i in (1, 3, 5)]).all(axis=-1)
        assert float(share) == pytest.approx(100 * same.mean(), rel=0.01)
        total += same.sum()
        y, x = np.argwhere(same)[0]
        numbers = found.numbers[found.lit[y, x, found.numbers]].tolist()
        assert [f"light {k} (" in rest for k in range(len(scene.lights))] == [
            k in numbers for k in range(len(scene.lights))
        ]
    assert total == found.seen.sum()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--show", "lit", "--check"], "--show lit takes no --check"),
        (["--show", "lit", "--crop", "0,0,9999,9"], "crop"),
        (["--space", "camera"], "--space goes with --show normal and --show direction"),
        (["--show", "normal", "--space", "eye"], "argument --space: invalid choice: 'eye'"),
    ],
)
def test_what_makes_no_sense_is_said(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "a.png"
    assert cli.main([str(FOLDER / "first.xml"), "-o", str(target), *options]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"cltrace: {message}")
    assert said.count("\n") == 1
    assert not target.exists()


def test_more_lights_than_colours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    light = '<point_light><color r="1" g="1" b="1"/><position x="0" y="9" z="9"/></point_light>'
    path = tmp_path / "many.xml"
    path.write_text((FOLDER / "minimal.xml").read_text().replace("</lights>", 33 * light + "</lights>"))
    assert cli.main([str(path), "--show", "lit", "-o", str(tmp_path / "a.png")]) == 2
    assert "cltrace: --show lit tells 32 lights apart, and the scene has 3" in capsys.readouterr().err


def test_normals_and_directions_along_the_cameras_axes(
    tmp_path: Path, any_device: Device, capsys: pytest.CaptureFixture[str]
) -> None:
    path = FOLDER / "first.xml"
    scene = cltrace.load(path)
    scene = scene.seen_by(replace(scene.camera, resolution=(80, 45)))
    image = cltrace.render(scene, outputs=("normal", "direction", "id"))
    axes = np.array(scene.camera.basis())
    for show in ("normal", "direction"):
        target = tmp_path / f"{show}.png"
        options = [str(path), "--size", "80x45", "--show", show, "-o", str(target)]
        pictures = {}
        for space in ("world", "camera"):
            assert cli.main([*options, "--space", space]) == 0
            pictures[space] = np.asarray(Picture.open(target)).astype(int)
        assert cli.main(options) == 0
        assert np.array_equal(np.asarray(Picture.open(target)), pictures["world"])
        assert np.array_equal(image.as_rgb8(show), pictures["world"])
        assert np.array_equal(image.as_rgb8(show, axes), pictures["camera"])
        value = getattr(image, show)
        seen = (value != 0).any(axis=-1)
        turned = np.einsum("ij,hwj->hwi", axes, value.astype(float))
        assert np.abs(pictures["camera"][seen] - 127.5 * (turned[seen] + 1)).max() < 0.51
        assert not pictures["camera"][~seen].any()
    # All rays lead ahead, -z, and the normals that they meet face them.
    assert (image.as_rgb8("direction", axes)[..., 2] < 64).all()
    assert (image.as_rgb8("normal", axes)[image.id >= 0][:, 2] > 100).all()
    with pytest.raises(ValueError, match=r"^axes: must be None for id, only normal and direction have axes$"):
        image.as_rgb8("id", axes)


def test_the_depths_scale_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, target = FOLDER / "first.xml", tmp_path / "d.png"
    assert cli.main([str(path), "--size", "80x45", "--show", "depth", "-o", str(target)]) == 0
    said = capsys.readouterr().err.splitlines()[1]
    scene = cltrace.load(path)
    scene = scene.seen_by(replace(scene.camera, resolution=(80, 45)))
    depth = cltrace.render(scene, outputs=("depth",)).depth
    hit = np.isfinite(depth)
    near, far = depth[hit].min(), depth[hit].max()
    formula = f"(1/depth - 1/{far:.6g}) / (1/{near:.6g} - 1/{far:.6g})"
    assert said == (
        f"cltrace: depth: {near:.6g} is white (255), {far:.6g} is dark (32), nothing is black; in between, a grey is "
        f"32 + 223 {formula}"
    )
    grey = np.where(hit, 32 + 223 * (1 / np.where(hit, depth, 1) - 1 / far) / (1 / near - 1 / far), 0)
    assert np.abs(np.asarray(Picture.open(target))[..., 0] - grey).max() < 0.51
    camera = cltrace.Camera((0, 0, 5), (0, 0, 9), resolution=(4, 4))
    empty = cltrace.render(cltrace.Scene.from_spheres(camera, [], [], 1), outputs=("depth",))
    assert palettes.depth_range(empty.depth) is None
    assert not empty.as_rgb8("depth").any()
