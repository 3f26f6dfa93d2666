"""Files of a picture: PNG with 8 and 16 bits, NPY, NPZ and OpenEXR, from Python and from the command."""

from __future__ import annotations

import io
import json
import os
import struct
import threading
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture
from random_scenes import usual_scene

import cltrace
from cltrace import Image, cli
from cltrace.picture import storing
from cltrace.picture.image import OUTPUTS

SCENE = Path(__file__).parents[2] / "scenes" / "first.xml"
MESHES = SCENE.with_name("step4-meshes.xml")
ALL = tuple(name for name in OUTPUTS if name not in ("work", "shadow_rays", "error", "coverage"))


@pytest.fixture(scope="module")
def image() -> Image:
    scene = usual_scene()
    return cltrace.render(scene.in_front_of((*scene.background, 0.25)), outputs=ALL)


def png16(data: bytes) -> np.ndarray:
    """The pixels of a PNG with 16 bits, read by the format's own rules, of which only filters 1 and 2 occur."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, body, head = 8, b"", b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at : at + 8])
        part = data[at + 8 : at + 8 + size]
        head, body = (part if kind == b"IHDR" else head), body + (part if kind == b"IDAT" else b"")
        at += 12 + size
    width, height, bits, color = struct.unpack(">IIBB", head[:10])
    assert bits == 16
    channels = {2: 3, 6: 4}[color]
    rows = np.frombuffer(zlib.decompress(body), np.uint8).reshape(height, -1)
    assert set(rows[:, 0]) <= {1, 2}
    bytes_ = rows[:, 1:].reshape(height, width, -1).copy()
    for y in range(height):
        bytes_[y] = np.cumsum(bytes_[y], axis=0, dtype=np.uint8) if rows[y, 0] == 1 else bytes_[y] + bytes_[y - 1]
    return bytes_.view(">u2").reshape(height, width, channels)


def channels_of(path: Path) -> dict[str, np.ndarray]:
    openexr = pytest.importorskip("OpenEXR")
    with openexr.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels.copy() for name, channel in file.channels().items()}


def test_16_bits(image: Image, tmp_path: Path) -> None:
    image.save(tmp_path / "a.png", bits=16)
    found = png16((tmp_path / "a.png").read_bytes())
    exact = np.clip(image.color.astype(float), 0, 1) * 65535
    assert np.abs(found[..., :3] - exact).max() <= 0.5
    assert np.array_equal(found[..., 3], np.where(image.id >= 0, 65535, round(0.25 * 65535)))
    # In 8 bits it is the same picture.
    assert np.abs(found[..., :3] / 257 - image.rgb8).max() < 0.51
    opaque = Image(rgb8=image.rgb8, color=image.color)
    opaque.save(tmp_path / "b.png", bits=16)
    assert np.array_equal(png16((tmp_path / "b.png").read_bytes()), found[..., :3])
    of_bytes = Image(rgba8=image.rgba8, color=image.color)
    of_bytes.save(tmp_path / "c.png", bits=16)
    assert np.array_equal(png16((tmp_path / "c.png").read_bytes())[..., 3], image.rgba8[..., 3].astype(int) * 257)


@pytest.mark.parametrize(
    ("name", "show", "kind", "mode", "dpi"),
    [
        ("a.tif", "color", "TIFF", "RGBA", 300),
        ("a.TIFF", "id", "TIFF", "RGB", 300),
        ("a.jpg", "color", "JPEG", "RGB", 150),
        ("a.jpeg", "color", "JPEG", "RGB", 150),
        ("a.png", "color", "PNG", "RGBA", 600),
    ],
)
def test_files_of_pillow_and_sizes_in_print(
    name: str, show: Any, kind: str, mode: str, dpi: float, image: Image, tmp_path: Path
) -> None:
    image.save(tmp_path / name, show, dpi=dpi)
    with Picture.open(tmp_path / name) as found:
        assert (found.format, found.mode) == (kind, mode)
        assert [*map(float, found.info["dpi"])] == pytest.approx((dpi, dpi), abs=0.02)  # a PNG's are whole ones a metre
        pixels = np.asarray(found).astype(int)
    if kind == "JPEG":
        assert np.abs(pixels - image.rgb8).mean() < 4
    else:
        assert np.array_equal(pixels, image.rgba8 if show == "color" else image.as_rgb8(show))


def test_an_array_of_what_is_shown(image: Image, tmp_path: Path) -> None:
    target = tmp_path / "a.npy"
    for show in ("depth", "normal", "direction", "id", "primitive", "uv"):
        image.save(target, show)  # type: ignore[arg-type]
        found, own = np.load(target), getattr(image, show)
        assert found.dtype == own.dtype
        assert np.array_equal(found, own)
    image.save(target)
    assert np.array_equal(np.load(target), image.rgba8)
    Image(rgb8=image.rgb8).save(target)
    assert np.array_equal(np.load(target), image.rgb8)
    axes = usual_scene().camera.basis()
    image.save(target, "normal", axes)
    assert np.allclose(np.load(target), image.normal @ np.array(axes).T, atol=1e-6)
    with pytest.raises(ValueError, match=r"^axes: must be None for depth, only normal and direction have axes$"):
        image.save(target, "depth", axes)


def test_arrays_by_name(image: Image, tmp_path: Path) -> None:
    image.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as found:
        assert set(found) == set(ALL) == set(image.outputs)
        for name in ALL:
            assert found[name].dtype == getattr(image, name).dtype
            assert np.array_equal(found[name], getattr(image, name))
    image.save(tmp_path / "b.npz", outputs=("id", "depth"))
    with np.load(tmp_path / "b.npz") as found:
        assert set(found) == {"id", "depth"}


def test_channels_of_an_exr(image: Image, tmp_path: Path) -> None:
    image.save(tmp_path / "a.exr")
    found = channels_of(tmp_path / "a.exr")
    assert set(found) == {c for name in ALL for c in storing.CHANNELS.get(name, ())}
    assert np.array_equal(found["A"], image.alpha)
    for k, c in enumerate("RGB"):
        assert np.array_equal(found[c], image.color[..., k] * image.alpha)
    assert np.array_equal(found["Z"], image.depth.astype(np.float32))
    assert np.isinf(found["Z"]).any()
    for name, prefix in (("normal", "N"), ("direction", "D")):
        for k, c in enumerate("XYZ"):
            assert np.array_equal(found[f"{prefix}.{c}"], getattr(image, name)[..., k])
    for name in ("id", "primitive"):
        assert found[name].dtype == np.uint32
        assert np.array_equal(found[name].view(np.int32), getattr(image, name))
    assert np.array_equal(np.stack([found["U"], found["V"]], axis=-1), image.uv)
    image.save(tmp_path / "b.exr", outputs=("color", "id"))
    plain = channels_of(tmp_path / "b.exr")
    assert set(plain) == {"R", "G", "B", "id"}
    assert np.array_equal(plain["R"], image.color[..., 0])
    Image(depth=image.depth).save(tmp_path / "c.exr")
    assert set(channels_of(tmp_path / "c.exr")) == {"Z"}
    # Noise becomes no smaller, and is there as it is; 33 rows are three blocks.
    noise = np.random.default_rng(1).integers(0, 2**31, (33, 5), np.int32)
    Image(id=noise).save(tmp_path / "d.exr")
    assert np.array_equal(channels_of(tmp_path / "d.exr")["id"], noise)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("a.bmp", {}, "path: the name of a picture must end in .png, .tif, .tiff, .jpg, .jpeg, .exr, .npy or .npz,"),
        ("a.png", {"bits": 12}, "bits: must be 8, or 16 in a PNG of color, got 12"),
        ("a.png", {"bits": 16, "show": "depth"}, "bits: must be 8, or 16 in a PNG of color, got 16"),
        ("a.png", {"bits": 16}, "outputs: the image has no color; ask for it with outputs=('rgb8', 'id', 'color')"),
        ("a.npy", {"show": "depth"}, "show: the image has no depth, only rgb8, id; show='color' shows what it has"),
        ("a.npz", {"outputs": ("depth",)}, "outputs: the image has no depth; ask for it with outputs=('rgb8', 'id', "),
        ("a.npz", {"outputs": ()}, "outputs: must be some of rgb8, id, got ()"),
        ("a.exr", {}, "outputs: the image has no color; ask for it with outputs=('rgb8', 'id', 'color')"),
        ("a.exr", {"outputs": ("rgb8",)}, "outputs: an EXR has none of rgb8, only of color, alpha, depth, normal, "),
        ("a.npy", {"dpi": 300}, "dpi: goes with .png, .tif, .tiff, .jpg, .jpeg, got .npy"),
        ("a.png", {"dpi": 0}, "dpi: must be a number within 0.1..1000000, got 0"),
        ("a.png", {"dpi": "300"}, "dpi: must be a number within 0.1..1000000, got '300'"),
        ("a.jpg", {"dpi": 1e6}, "dpi: must be within 1..65535 in a JPEG, got 1e+06"),
    ],
)
def test_what_makes_no_file_is_said(name: str, options: dict[str, Any], message: str, tmp_path: Path) -> None:
    image = Image(rgb8=np.zeros((1, 2, 3), np.uint8), id=np.zeros((1, 2), np.int32))
    (tmp_path / name).write_bytes(b"old")
    with pytest.raises(ValueError) as caught:
        image.save(tmp_path / name, **options)
    assert str(caught.value).startswith(message)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


def run(*options: object, scene: Path = SCENE) -> int:
    return cli.main([str(scene), "--size", "90x60", "-q", *map(str, options)])


def test_one_run_writes_many_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = [tmp_path / f"a.{suffix}" for suffix in ("png", "exr", "npy", "npz")]
    assert run(*(part for name in names for part in ("-o", name)), "--stats=json", scene=MESHES) == 0
    stats = json.loads(capsys.readouterr().out)
    assert "WITH_EXTRAS" in stats["features"]
    scene = cltrace.load(MESHES)
    scene = scene.seen_by(cltrace.Camera(**{**vars(scene.camera), "resolution": (90, 60)}))
    image = cltrace.render(scene, outputs=("rgb8", "color", "alpha", "depth", "normal", "id", "primitive"))
    with Picture.open(names[0]) as picture:
        assert np.array_equal(np.asarray(picture), image.rgb8)
    assert np.array_equal(np.load(names[2]), image.rgb8)
    with np.load(names[3]) as arrays:
        assert set(arrays) == {"color", "alpha", "depth", "normal", "id", "primitive"}
        assert all(np.array_equal(arrays[name], getattr(image, name)) for name in arrays)
    found = channels_of(names[1])
    assert set(found) == {*"RGBAZ", "N.X", "N.Y", "N.Z", "id", "primitive"}
    assert np.array_equal(found["primitive"].view(np.int32), image.primitive)
    assert (image.primitive > 0).any()
    # Deeper, with an alpha, and of fewer arrays.
    assert run("-o", names[0], "--bits", 16, "--transparent", "-o", names[3], "--outputs", "id,rgb8", scene=MESHES) == 0
    assert png16(names[0].read_bytes()).shape == (60, 90, 4)
    with np.load(names[3]) as arrays:
        assert set(arrays) == {"id", "rgb8"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-o", "a.png", "-o", "./a.png"], "-o: './a.png' is there twice"),
        (["-o", "a.png", "--bits", "12"], "argument --bits: invalid choice: 12"),
        (["-o", "a.npy", "--bits", "16"], "--bits 16 goes with a PNG and --show color"),
        (["-o", "a.png", "--outputs", "id"], "--outputs goes with -o of an .exr or .npz"),
        (["-o", "a.exr", "--outputs", "rgb8,id"], "--outputs: an .exr has none of rgb8, only of color, alpha, "),
        (["-o", "a.npy", "--show", "lit"], "-o: the name of a picture must end in .png, got 'a.npy'"),
        (["-o", "a.png", "-o", "b.png", "--show", "lit"], "--show lit takes one -o"),
        (["-o", "a.png", "-o", "b.png", "--compare", "c.png"], "--compare takes one -o"),
        (["-o", "a.npz", "--compare", "c.png"], "-o: the name of a picture must end in .png, got 'a.npz'"),
    ],
)
@pytest.mark.usefixtures("own_folder")
def test_what_makes_no_sense_is_said_before_anything_is_drawn(
    options: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("cltrace.cli.picture.Renderer", None)
    assert run(*options) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"cltrace: {message}")
    assert said.count("\n") == 1
    assert not list(Path().iterdir())


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names here")
@pytest.mark.parametrize("suffix", [".png", ".npy", ".npz", ".exr"])
def test_a_pipe_is_written_into(suffix: str, tmp_path: Path) -> None:
    image, pipe, got = cltrace.render(usual_scene(), outputs=("rgb8", "color")), tmp_path / f"a{suffix}", []
    link = tmp_path / f"link{suffix}"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    image.save(link)
    reader.join()
    assert pipe.is_fifo()
    assert sorted(tmp_path.iterdir()) == [pipe, link]
    image.save(tmp_path / f"b{suffix}")
    if suffix == ".npz":  # whose entries are marked otherwise where one cannot go back
        with np.load(io.BytesIO(got[0])) as found:
            assert np.array_equal(found["color"], image.color)
    else:
        assert got[0] == (tmp_path / f"b{suffix}").read_bytes()


@pytest.mark.parametrize("how", [{"bits": 16}, *({"show": show} for show in ("id", "normal", "uv", "depth"))])
def test_memory_that_writing_takes(how: dict[str, Any], tmp_path: Path) -> None:
    """Little more than the bytes that are written, 8 for a pixel at most; it was up to 96."""
    shape = (1024, 512)
    arrays = {"color": np.zeros((*shape, 3), np.float32), "alpha": np.ones(shape, np.float32)}
    shown = {"id": np.zeros(shape, np.int32), "normal": arrays["color"], "uv": arrays["color"][..., :2]}
    shown["depth"] = np.ones(shape)
    image = Image(**arrays, **shown)
    tracemalloc.start()
    try:
        image.save(tmp_path / "a.png", **how)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 8 * 1024 * 512 + 2**22 + 2**21


@pytest.mark.parametrize("height", [1, 64, 130])
def test_pictures_of_any_height_are_made_of_rows(height: int, tmp_path: Path) -> None:
    levels = np.random.default_rng(2).integers(0, 65536, (height, 3, 3))
    Image(color=(levels / 65535).astype(np.float32)).save(tmp_path / "a.png", bits=16)
    assert np.array_equal(png16((tmp_path / "a.png").read_bytes()), levels)
