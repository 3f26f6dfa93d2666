"""Textures: what the reader makes of images of every kind, and what it refuses."""

from __future__ import annotations

import os
import struct
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cltrace.base.limits import MAX_TEXELS
from cltrace.formats import texture
from cltrace.formats.files import UnreadableError
from cltrace.formats.texture import read_texture

RGB = np.random.default_rng(5).integers(0, 256, (5, 7, 3), np.uint8)
GREY = RGB[:, :, 0]
DEEP = np.array([[0, 1, 255, 256], [4096, 32767, 32768, 65535]], np.uint16)


def pixels(path: str = "x.png") -> np.ndarray:
    found, warning = read_texture(path)
    assert warning is None
    assert not found.flags.writeable
    assert found.shape[2] == 3
    return found


def fault(path: str = "x.png", most: int = MAX_TEXELS) -> str:
    with pytest.raises(UnreadableError) as caught:
        read_texture(path, most)
    return str(caught.value)


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(width: int, height: int, depth: int, kind: int, rows: bytes, *chunks: bytes, interlaced: int = 0) -> bytes:
    """A PNG file of these rows, each with its filter's byte in front. kind: 0 grey, 2 RGB, 3 palette, 4 LA, 6 RGBA."""
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, interlaced))
    body = chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + head + b"".join(chunks) + body


def test_rgb_and_grey_arrive() -> None:
    Image.fromarray(RGB).save("x.png")
    assert np.array_equal(pixels(), RGB)
    assert pixels().dtype == np.uint8
    Image.fromarray(GREY).save("x.png")
    assert np.array_equal(pixels(), np.stack([GREY] * 3, axis=2))


def test_the_name_says_nothing_of_the_kind() -> None:
    Image.fromarray(RGB).save("x.jpg", "PNG")
    assert np.array_equal(pixels("x.jpg"), RGB)


def test_alpha_is_ignored() -> None:
    """Also where it is 0: the colour there is kept."""
    alpha = np.zeros((5, 7, 1), np.uint8)
    Image.fromarray(np.concatenate([RGB, alpha], axis=2)).save("x.png")
    assert np.array_equal(pixels(), RGB)
    Image.fromarray(np.stack([GREY, alpha[:, :, 0]], axis=2)).save("x.png")
    assert np.array_equal(pixels()[:, :, 1], GREY)


@pytest.mark.parametrize("alpha", [b"\x00\x80\xff", b"\x00"])
def test_palettes_with_and_without_transparency(alpha: bytes) -> None:
    colors = bytes([10, 20, 30, 40, 50, 60, 70, 80, 90])
    for chunks in ([], [chunk(b"tRNS", alpha)]):
        Path("x.png").write_bytes(png(3, 1, 8, 3, b"\0\0\1\2", chunk(b"PLTE", colors), *chunks))
        assert pixels().tobytes() == colors


def test_a_transparent_colour_is_a_colour() -> None:
    Path("x.png").write_bytes(png(2, 1, 8, 2, b"\0\1\2\3\4\5\6", chunk(b"tRNS", struct.pack(">HHH", 1, 2, 3))))
    assert pixels().tolist() == [[[1, 2, 3], [4, 5, 6]]]
    Path("x.png").write_bytes(png(2, 1, 8, 0, b"\0\1\2", chunk(b"tRNS", struct.pack(">H", 1))))
    assert pixels()[:, :, 0].tolist() == [[1, 2]]


@pytest.mark.parametrize(
    ("depth", "rows", "wanted"), [(1, b"\0\x50", [0, 255, 0, 255]), (2, b"\0\x1b", [0, 85, 170, 255])]
)
def test_few_bits(depth: int, rows: bytes, wanted: list[int]) -> None:
    Path("x.png").write_bytes(png(4, 1, depth, 0, rows))
    assert pixels()[0, :, 2].tolist() == wanted


def test_four_bits() -> None:
    Path("x.png").write_bytes(png(4, 1, 4, 0, b"\0\x01\x8f"))
    assert pixels()[0, :, 0].tolist() == [0, 17, 136, 255]
    Path("x.png").write_bytes(png(4, 1, 4, 3, b"\0\x01\x10", chunk(b"PLTE", bytes([1, 2, 3, 200, 5, 6]))))
    assert pixels()[0].tolist() == [[1, 2, 3], [200, 5, 6], [200, 5, 6], [1, 2, 3]]


def test_sixteen_bits_of_grey_are_kept() -> None:
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in DEEP)
    for chunks in ([], [chunk(b"tRNS", b"\0\1")]):
        Path("x.png").write_bytes(png(4, 2, 16, 0, rows, *chunks))
        assert pixels().dtype == np.uint16
        assert np.array_equal(pixels(), np.stack([DEEP] * 3, axis=2))


@pytest.mark.parametrize(("kind", "channels"), [(2, 3), (6, 4), (4, 2)])
def test_of_sixteen_bits_of_colour_the_upper_count(kind: int, channels: int) -> None:
    row = np.repeat([[0x12FF], [0xFF00]], channels, axis=1).astype(">u2")
    Path("x.png").write_bytes(png(2, 1, 16, kind, b"\0" + row.tobytes()))
    found, warning = read_texture("x.png")
    assert found.tolist() == [[[0x12] * 3, [0xFF] * 3]]
    assert warning == "has 16 bits for each colour, of which the upper 8 count"


def test_chunks_that_other_programs_obey_change_nothing() -> None:
    for extra in (
        chunk(b"gAMA", struct.pack(">I", 20000)),
        chunk(b"sRGB", b"\0"),
        chunk(b"iCCP", b"x\0\0" + zlib.compress(b"no profile")),
        chunk(b"tEXt", b"Comment\0hello"),
        chunk(b"pHYs", struct.pack(">IIB", 1, 2, 1)),
        chunk(b"cHRM", bytes(32)),
        chunk(b"bKGD", bytes(6)),
        chunk(b"eXIf", b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"),  # orientation 6
        chunk(b"eXIf", b"broken"),
        chunk(b"teSt", b"unknown"),
    ):
        Path("x.png").write_bytes(png(2, 1, 8, 2, b"\0\1\2\3\4\5\6", extra))
        assert pixels().tolist() == [[[1, 2, 3], [4, 5, 6]]]


def test_interlaced_png() -> None:
    """Adam7: the same pixels in seven passes."""
    passes = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    rows = b"".join(b"\0" + row.tobytes() for x, y, dx, dy in passes for row in RGB[y::dy, x::dx] if row.size)
    Path("x.png").write_bytes(png(7, 5, 8, 2, rows, interlaced=1))
    assert np.array_equal(pixels(), RGB)


def test_jpeg() -> None:
    flat = np.full((8, 16, 3), (200, 100, 50), np.uint8)
    Image.fromarray(flat).save("x.jpg", quality=100)
    assert np.abs(pixels("x.jpg").astype(int) - flat).max() <= 2
    Image.fromarray(flat[:, :, 0]).save("x.jpg", quality=100)
    assert (pixels("x.jpg") == 200).all()
    Image.fromarray(flat).save("x.jpg", quality=100, progressive=True)
    assert np.abs(pixels("x.jpg").astype(int) - flat).max() <= 2


def test_the_orientation_of_a_camera_is_not_applied() -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(np.zeros((8, 16, 3), np.uint8)).save("x.jpg", exif=exif)
    assert pixels("x.jpg").shape == (8, 16, 3)


def test_cmyk_is_taken_for_rgb() -> None:
    Image.fromarray(np.zeros((8, 8, 4), np.uint8), "CMYK").save("x.jpg", quality=100)
    found, warning = read_texture("x.jpg")
    assert found.min() >= 250
    assert warning == "is CMYK, which is taken for RGB without a colour profile"


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_truncated_files_are_faults(kind: str) -> None:
    big = np.random.default_rng(1).integers(0, 256, (40, 40, 3), np.uint8)
    Image.fromarray(big).save("x", kind)
    whole = Path("x").read_bytes()
    for share in (0.3, 0.6, 0.9):
        Path("x").write_bytes(whole[: int(share * len(whole))])
        assert fault("x") == "is damaged"
    for length in range(20):  # how much of it makes an image depends on Pillow
        Path("x").write_bytes(whole[:length])
        assert fault("x") in ("is no PNG or JPEG file", "is damaged")


def test_damaged_files_are_faults() -> None:
    Image.fromarray(RGB).save("x.png")
    whole = bytearray(Path("x.png").read_bytes())
    whole[whole.index(b"IDAT") + 8] ^= 0x55
    Path("x.png").write_bytes(whole)
    assert fault() == "is damaged"
    bomb = chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(2**27)))
    Path("x.png").write_bytes(png(2, 1, 8, 2, b"\0\1\2\3\4\5\6", bomb))
    assert fault() == "is damaged"


def test_other_formats_are_refused() -> None:
    """Whatever their names are."""
    for kind in ("GIF", "BMP", "TIFF", "PPM", "PCX", "TGA", "ICO", "WEBP"):
        Image.fromarray(RGB).save("x.png", kind)
        assert fault() == "is no PNG or JPEG file"
    for data in (b"", b"\0", b"P6 1 1 255\n", b"<svg/>", b"%!PS-Adobe\n", b"v 1 2 3\n", bytes(10_000)):
        Path("x.png").write_bytes(data)
        assert fault() == "is no PNG or JPEG file"


def test_the_size_is_asked_before_decoding() -> None:
    """A few bytes may promise pixels that fill the memory."""
    for side in (20_000, 100_000):
        Path("x.png").write_bytes(png(side, side // 2, 8, 2, b""))
        assert fault() == f"must not have more than {MAX_TEXELS} pixels"
    Image.fromarray(RGB).save("x.png")
    assert fault(most=34) == "must not have more than 34 pixels with the textures before it"
    assert read_texture("x.png", 35)[0].shape == RGB.shape


def test_files_that_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("folder").mkdir()
    os.mkfifo("pipe")
    assert fault("nowhere") == "cannot be read: No such file or directory"
    assert fault("folder") == "is a directory"
    assert fault("pipe") == "is not a regular file"
    Path("text.png").write_text("not an image")
    assert fault("text.png") == "is no PNG or JPEG file"
    Image.fromarray(RGB).save("x.png")
    monkeypatch.setattr(texture, "MAX_BYTES", 10)
    assert fault() == "must not be larger than 10 bytes; --limit texture-bytes=N or CLTRACE_LIMITS allows more"


def test_a_decoder_out_of_memory_is_no_damage(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise MemoryError

    Image.fromarray(RGB).save("x.png")
    monkeypatch.setattr(texture, "_pixels", fail)
    with pytest.raises(MemoryError):
        read_texture("x.png")


def test_narrow_pixels_are_converted_many_rows_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A damaged header made 17 million rows of four pixels of 300 bytes, which took 5 seconds: 64 rows at a time."""
    bands, crop = [], Image.Image.crop

    def counted(image: Image.Image, box: Any) -> Image.Image:
        bands.append(box)
        return crop(image, box)

    monkeypatch.setattr(Image.Image, "crop", counted)
    Path("x.png").write_bytes(png(3, 100_000, 1, 0, b"\0\xa0" * 100_000))
    assert np.array_equal(pixels()[..., 1], np.tile(np.uint8([255, 0, 255]), (100_000, 1)))
    assert len(bands) <= -(-300_000 // texture.BAND) + 1


@pytest.mark.parametrize(("kind", "depth", "size"), [(0, 16, 2), (2, 16, 6), (6, 8, 4), (3, 8, 1)])
def test_memory_that_reading_takes(kind: int, depth: int, size: int) -> None:
    """Beside what the decoder has, no more than the texture itself."""
    palette = [chunk(b"PLTE", bytes(6))] if kind == 3 else []
    Path("x.png").write_bytes(png(512, 2048, depth, kind, (b"\0" + bytes(512 * size)) * 2048, *palette))
    tracemalloc.start()
    try:
        found, _ = read_texture("x.png")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.nbytes == 512 * 2048 * (6 if kind == 0 else 3)
    assert peak < found.nbytes + 2**20


def test_bombs(limited: Any) -> None:
    """A few bytes that claim, or unfold to, gigabytes. What is harmless may be read. One process reads all of them."""
    text = zlib.compress(bytes(2**27), 9)
    refused = [
        png(20_000, 10_000, 8, 2, b""),
        png(65_535, 65_535, 1, 0, b""),
        png(2**31 - 1, 2**31 - 1, 8, 6, b""),
        png(2**32 - 1, 2**32 - 1, 8, 2, b""),
        png(2**31 - 1, 1, 8, 0, b""),
        *(png(width, height, 8, 2, b"") for width, height in ((0, 5), (5, 0), (0, 0))),
        png(20_000, 10_000, 1, 0, bytes(2501 * 10_000)),
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 2**31 - 1) + b"IHDR",
        b"\xff\xd8\xff\xc0\x00\x11\x08\xff\xdc\xff\xdc\x03\x01\x22\x00\x02\x11\x01\x03\x11\x01",
        png(5, 5, 7, 2, bytes(80)),
        png(5, 5, 8, 5, bytes(80)),
    ]
    harmless = [
        png(1, 1, 8, 2, bytes(4), chunk(b"zTXt", b"x\0\0" + text)),
        png(1, 1, 8, 2, bytes(4), *[chunk(b"zTXt", b"x\0\0" + zlib.compress(bytes(2**20 - 1), 9))] * 200),
        png(1, 1, 8, 2, bytes(4), chunk(b"iCCP", b"x\0\0" + text)),
        png(5, 5, 8, 3, bytes(30)),
        png(5, 5, 8, 2, b"\x09" * 80),
    ]
    names = [f"{k}.png" for k in range(len(refused + harmless))]
    for name, data in zip(names, refused + harmless, strict=True):
        Path(name).write_bytes(data)
    said = limited("texture", 1000, names)
    assert all(line.startswith("UnreadableError") for line in said[: len(refused)])
    assert all(line.startswith(("UnreadableError", "read")) for line in said)
