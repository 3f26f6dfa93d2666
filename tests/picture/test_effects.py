"""Outlines and depth cueing: where they are, by brute force; the same in crops, bands, movies and behind updates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

import cltrace
from cltrace import cli
from cltrace.renderers import renderer as front
from cltrace.run.devices import Device
from cltrace.scene import camera as eye

SIZE = (60, 44)
CAMERA = cltrace.Camera((0, 0, 9), (0, 0, 0), horizontal_fov=15, resolution=SIZE)
LIGHTS = [cltrace.ambient_light("white")]
FLAT = {"ka": 1, "kd": 0, "ks": 0}
# What smooth pictures with effects have the kernel write, so that all of them share one program.
SMOOTH = ("rgb8", "color", "alpha")
PLAIN = ("rgb8", "color", "alpha", "id", "depth")  # the same of plain ones


def scene(n: int = 25, background: Any = "white", seed: int = 0, **more: Any) -> cltrace.Scene:
    rng = np.random.default_rng(seed)
    centers, colors = rng.uniform((-2, -1.5, -2), (2, 1.5, 2), (n, 3)), rng.uniform(0.2, 1, (n, 3))
    return cltrace.Scene.from_spheres(CAMERA, LIGHTS, centers, 0.4, colors, background=background, **FLAT, **more)


def draw(of: cltrace.Scene, device: Device, **how: Any) -> cltrace.Image:
    return cltrace.render(of, device, **{"outputs": PLAIN, **how})


def line_by_hand(id: np.ndarray, depth: np.ndarray, radius: float) -> np.ndarray:
    """Which rays lines cover: those near one whose neighbour is farther, and of another surface."""
    height, width = id.shape
    ends = []
    for y, x in np.argwhere(id >= 0):
        for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
            if 0 <= v < height and 0 <= u < width and id[v, u] != id[y, x] and depth[v, u] > depth[y, x]:
                ends.append((y, x))
    y, x = np.indices(id.shape)
    covered = np.zeros(id.shape, bool)
    for v, u in set(ends):
        covered |= (y - v) ** 2 + (x - u) ** 2 <= radius * radius
    return covered


@pytest.mark.parametrize("thick", [1, 2, 5])
def test_lines_are_where_surfaces_end(thick: int, device: Device) -> None:
    plain = draw(scene(), device)
    image = draw(scene(), device, outline=("red", thick))
    line = line_by_hand(plain.id, plain.depth, (thick - 1) / 2)
    assert 0 < line.sum() < line.size
    assert (image.rgb8[line] == (255, 0, 0)).all()
    assert (image.color[line] == (1, 0, 0)).all()
    assert (image.rgb8[~line] == plain.rgb8[~line]).all()
    assert (image.color[~line] == plain.color[~line]).all()
    assert (image.id == plain.id).all()
    assert (image.depth == plain.depth).all()


def test_a_finer_picture_within_the_limit(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture that is allowed has lines, too, where none of four times as many pixels is."""
    width, height = SIZE
    monkeypatch.setattr(eye, "MAX_PIXELS", 2 * width * height)
    monkeypatch.setattr(front, "MAX_PIXELS", 2 * width * height)
    renderer = cltrace.Renderer(scene(), device, outputs=SMOOTH, antialias=True, outline=("red", 1.5))
    assert renderer.render().rgb8.shape == (height, width, 3)


@pytest.mark.parametrize("antialias", [False, True])
def test_crops_and_bands_are_parts_of_the_whole(
    antialias: bool, device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    outputs = SMOOTH if antialias else PLAIN
    how = {"outline": ("black", 3), "fog": ("white", 7, 11), "antialias": antialias, "outputs": outputs}
    whole = draw(scene(), device, **how)
    x0, y0, x1, y1 = 13, 7, 38, 30
    renderer = cltrace.Renderer(scene(), device, **how)
    monkeypatch.setattr(front, "BAND", 2000)
    for image in (
        draw(scene(), device, crop=(x0, y0, x1, y1), **how),
        renderer.cropped((x0, y0, x1, y1)).render(),
    ):
        assert (image.rgb8 == whole.rgb8[y0:y1, x0:x1]).all()
        assert (image.color == whole.color[y0:y1, x0:x1]).all()
    assert (renderer.rows(11, 26).render().rgb8 == whole.rgb8[11:26]).all()
    assert (renderer.render().rgb8 == whole.rgb8).all()


def test_fog(device: Device) -> None:
    plain, image = draw(scene(), device), draw(scene(), device, fog=("#336699", 8, 10))
    share = np.clip((plain.depth - 8) / 2, 0, 1)[..., None] * (plain.id >= 0)[..., None]
    assert ((share > 0) & (share < 1)).sum() > 0
    wanted = plain.color + share * (np.array((0x33, 0x66, 0x99)) / 255 - plain.color)
    assert np.abs(image.color - wanted).max() < 1e-6
    # What is as far as the fog has its colour, by the scene's curve.
    for transfer in ("linear", "srgb"):
        image = draw(scene(background="black", transfer=transfer), device, fog=("#336699", 0, 1))
        assert (image.rgb8[image.id >= 0] == (0x33, 0x66, 0x99)).all()
        assert (image.rgb8[image.id < 0] == 0).all()


def test_smooth_fog_leaves_the_background(device: Device) -> None:
    """Where all surfaces have the fog's colour, a pixel has as much of it as surfaces cover."""
    how = {"antialias": True, "outputs": (*SMOOTH, "coverage")}
    image = draw(scene(background="black"), device, fog=((0.5, 0.25, 1), 0, 1), **how)
    assert np.abs(image.color - image.coverage[..., None] * np.array((0.5, 0.25, 1))).max() < 0.07  # of 16 rays one
    edges = (image.coverage > 0.1) & (image.coverage < 0.9)
    assert np.abs(image.color - image.coverage[..., None] * np.array((0.5, 0.25, 1)))[edges].mean() < 0.01


def test_lines_fade(device: Device) -> None:
    far = draw(scene(), device, outline=("black", 2), fog=("white", 0, 1))
    assert (far.rgb8 == 255).all()
    near = draw(scene(), device, outline=("black", 2), fog=("white", 100, 101))
    assert (near.rgb8 == draw(scene(), device, outline=("black", 2)).rgb8).all()


@pytest.mark.parametrize("antialias", [False, True])
def test_lines_over_nothing_have_alpha(antialias: bool, device: Device) -> None:
    how = {"antialias": antialias, "outputs": SMOOTH if antialias else PLAIN}
    image = draw(scene(background="#ffffff00"), device, **how, outline=("red", 3))
    opaque = draw(scene(), device, **how, outline=("red", 3))
    over = image.color * image.alpha[..., None] + (1 - image.alpha[..., None])
    assert np.abs(over - opaque.color).max() < 1e-5
    plain = draw(scene(background="#ffffff00"), device, **how)
    assert ((image.alpha == 1) & (plain.alpha == 0)).any()
    assert (image.alpha >= plain.alpha).all()
    assert np.abs(image.rgba8[..., 3] - 255 * image.alpha).max() <= 0.5


def test_no_line_is_in_the_middle_of_a_bond(device: Device) -> None:
    """Its halves are one, in whichever colours they are; two bonds that touch are two."""
    centers, colors = [(-1, 0, 0), (1, 0, 0), (1, 0.5, 0), (-1, 0.5, 0)], ["red", "blue", "red", "lime"]
    given: dict[str, Any] = {"radii": 0.2, "colors": colors, "bond_radius": 0.17}
    of = cltrace.Scene.from_spheres(CAMERA, LIGHTS, centers, bonds=[(0, 1), (2, 3)], **given, **FLAT)
    assert len(of.cylinders) == 4
    assert of.wholes.tolist() == [0, 1, 2, 3, 4, 4, 6, 6, -1]
    image, plain = (draw(of, device, **how) for how in ({"outline": ("white", 1)}, {}))
    line = (image.rgb8 == 255).all(axis=2)
    middle = slice(SIZE[0] // 2 - 2, SIZE[0] // 2 + 2)
    for first in (4, 6):
        bond = (plain.id[:, middle] >= first) & (plain.id[:, middle] < first + 2)
        assert (bond.sum(axis=0) >= 4).all()
        assert ((line[:, middle] & bond).sum(axis=0) <= 2).all()  # at its two sides
        assert len(np.unique(plain.id[:, middle][bond])) == 2


@pytest.mark.parametrize("thick", [0.5, 1, 2])
def test_smooth_lines_are_as_wide_as_they_should_be(thick: float, device: Device) -> None:
    """To a ray, of which a pixel has 4 along its side, they are odd; half of the next ones count for those between."""
    camera = cltrace.Orthographic((0, 0, 5), (0, 0, 0), height=4, resolution=(32, 32))
    white = cltrace.Material((1, 1, 1), ka=1, kd=0, ks=0)
    edge = cltrace.Mesh([(-9, -9, 0), (9, -9, 0), (9, 0.01, 0), (-9, 0.01, 0)], [(0, 1, 2), (0, 2, 3)], material=white)
    of = cltrace.Scene.from_meshes(camera, LIGHTS, [edge], background="white")
    image = cltrace.render(of, device, outputs=SMOOTH, outline=("black", thick), antialias=True)
    assert (1 - image.color[:, 16, 0]).sum() == pytest.approx(thick)


@pytest.mark.slow
def test_movies_updates_and_other_outputs(device: Device) -> None:
    how = {"outline": ("black", 2), "fog": ("white", 7, 11)}
    cameras = cltrace.orbit(scene(), 3)
    wanted = [draw(scene().seen_by(camera), device, **how).rgb8 for camera in cameras]
    images = cltrace.animate(cameras, scene=scene(), device=device, **how)
    assert all((image.rgb8 == array).all() for image, array in zip(images, wanted, strict=True))
    renderer = cltrace.Renderer(scene(), device, **how)
    renderer.update(centers=scene(seed=1).columns.center)
    assert (renderer.render().rgb8 == draw(renderer.scene, device, **how).rgb8).all()
    assert cltrace.Renderer(scene(), device, outputs=("id",), **how).render().outputs == ("id",)
    deep = draw(scene(), device, outputs=("rgb8", "alpha"), **how)
    assert deep.outputs == ("rgb8", "alpha")
    assert (deep.rgb8 == wanted[0]).all()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"fog": ("white", 1, 2), "outputs": ("error",), "antialias": True}, "outputs: error goes with neither outl"),
        ({"outline": "black"}, r"outline: must be \(color, width\), such as \('black', 2\), got 'black'"),
        ({"outline": ("black", 0)}, r"outline: width: must be within \(0, 64\] pixels, got 0"),
        ({"outline": ((0, 0, 255), 2)}, "outline: color: .* look like bytes"),
        ({"fog": ("white", 2)}, r"fog: must be \(color, near, far\), such as \('white', 10, 50\)"),
        ({"fog": ("white", 2, 2)}, "fog: must have two rising distances >= 0, got 2, 2"),
        ({"fog": ("white", -1, 2)}, "fog: near: must be >= 0, got -1"),
    ],
)
def test_faults(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        cltrace.Renderer(scene(), **given)


FILE = str(Path(__file__).parents[2] / "scenes" / "step1-ambient.xml")


def test_the_command_draws_them(tmp_path: Path, device: Device) -> None:
    target = str(tmp_path / "a.png")
    size = ["-q", "--size", "60x44", "-o", target, "-d", device.spec]
    assert cli.main([FILE, "--outline", "#ff0000,2", "--fog", "rgb(255,255,255),3,20", *size]) == 0
    of = cltrace.load(FILE)
    of = of.seen_by(replace(of.camera, resolution=(60, 44)))
    wanted = cltrace.render(of, device, outline=("red", 2), fog=("white", 3, 20)).rgb8
    with Picture.open(target) as found:
        assert (np.asarray(found) == wanted).all()
    assert (wanted != cltrace.render(of, device).rgb8).any()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["--outline", "black"], "must be (color, width), such as ('black', 2)"),
        (["--outline", "black,wide"], "--outline"),
        (["--fog", "white,1,4", "--show", "depth"], "--fog goes with --show color"),
        (["--outline", "black,1", "--check"], "--check does not go with --outline, which the reference has not"),
        (["--outline", "black,1", "--explain", "1,1"], "--explain takes no --outline"),
    ],
)
def test_faults_of_the_command(given: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([FILE, *given]) == 2
    (told,) = capsys.readouterr().err.splitlines()
    assert words in told
