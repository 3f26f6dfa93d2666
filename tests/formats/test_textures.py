"""Textures: what the reader makes of images of every kind, and what it refuses."""

from __future__ import annotations

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

pytestmark = pytest.mark.usefixtures("own_folder")

RGB = np.random.default_rng(5).integers(0, 256, (5, 7, 3), np.uint8)
GREY = np.repeat(RGB[:, :, :1], 3, axis=2)
DEEP = np.array([[0, 1, 255, 256], [4096, 32767, 32768, 65535]], np.uint16)
UPPER = "has 16 bits for each colour, of which the upper 8 count"
NO_IMAGE, DAMAGED = "is no PNG or JPEG file", "is damaged"


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


def grey(*levels: int) -> np.ndarray:
    return np.repeat(np.array(levels)[None, :, None], 3, axis=2)


def wide(kind: int, channels: int) -> bytes:
    row = np.repeat([[0x12FF], [0xFF00]], channels, axis=1).astype(">u2")
    return png(2, 1, 16, kind, b"\0" + row.tobytes())


PALETTE, TWO = chunk(b"PLTE", bytes(range(10, 100, 10))), b"\0\1\2\3\4\5\6"
DEEP_ROWS = b"".join(b"\0" + row.astype(">u2").tobytes() for row in DEEP)
ADAM7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
PASSES = b"".join(b"\0" + row.tobytes() for x, y, dx, dy in ADAM7 for row in RGB[y::dy, x::dx] if row.size)
ORIENTED = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
# What other programs obey, or stumble over.
EXTRA = {
    b"gAMA": struct.pack(">I", 20000),
    b"sRGB": b"\0",
    b"iCCP": b"x\0\0" + zlib.compress(b"no profile"),
    b"tEXt": b"Comment\0hello",
    b"cHRM": bytes(32),
    b"eXIf": ORIENTED,
    b"teSt": b"unknown",
    b"tRNS": struct.pack(">HHH", 1, 2, 3),
}
# An array that Pillow writes or a file; its pixels; the warning.
IMAGES: list[tuple[np.ndarray | bytes, np.ndarray, str | None]] = [
    (RGB, RGB, None),
    (RGB[:, :, 0], GREY, None),
    (np.concatenate([RGB, 0 * RGB[:, :, :1]], axis=2), RGB, None),  # the colour where alpha is 0
    (np.stack([RGB[:, :, 0], 0 * RGB[:, :, 0]], axis=2), GREY, None),
    *(
        (png(3, 1, 8, 3, b"\0\0\1\2", PALETTE, *more), np.arange(10, 100, 10).reshape(1, 3, 3), None)
        for more in ([], [chunk(b"tRNS", b"\x00\x80\xff")], [chunk(b"tRNS", b"\x00")])
    ),
    (png(2, 1, 8, 0, b"\0\1\2", chunk(b"tRNS", b"\0\1")), grey(1, 2), None),
    (png(4, 1, 1, 0, b"\0\x50"), grey(0, 255, 0, 255), None),
    (png(4, 1, 2, 0, b"\0\x1b"), grey(0, 85, 170, 255), None),
    (png(4, 1, 4, 0, b"\0\x01\x8f"), grey(0, 17, 136, 255), None),
    (png(2, 1, 4, 3, b"\0\x01", PALETTE), np.array([[(10, 20, 30), (40, 50, 60)]]), None),
    (png(4, 2, 16, 0, DEEP_ROWS), np.stack([DEEP] * 3, axis=2), None),
    (png(4, 2, 16, 0, DEEP_ROWS, chunk(b"tRNS", b"\0\1")), np.stack([DEEP] * 3, axis=2), None),
    *((wide(kind, channels), grey(0x12, 0xFF), UPPER) for kind, channels in ((2, 3), (6, 4), (4, 2))),
    (png(7, 5, 8, 2, PASSES, interlaced=1), RGB, None),
    *((png(2, 1, 8, 2, TWO, chunk(*extra)), np.arange(1, 7).reshape(1, 2, 3), None) for extra in EXTRA.items()),
]


@pytest.mark.parametrize(("image", "wanted", "told"), IMAGES)
def test_images_of_every_kind(image: np.ndarray | bytes, wanted: np.ndarray, told: str | None) -> None:
    """Whatever the name says."""
    if isinstance(image, bytes):
        Path("x.jpg").write_bytes(image)
    else:
        Image.fromarray(image).save("x.jpg", "PNG")
    found, warning = read_texture("x.jpg")
    assert np.array_equal(found, wanted)
    assert found.dtype == (np.uint16 if wanted.max() > 255 else np.uint8)
    assert not found.flags.writeable
    assert warning == told


def test_jpeg() -> None:
    """The orientation of a camera is not applied."""
    flat, exif = np.full((8, 16, 3), (200, 100, 50), np.uint8), Image.Exif()
    exif[0x0112] = 6
    for image, options in ((flat, {}), (flat[:, :, 0], {}), (flat, {"progressive": True}), (flat, {"exif": exif})):
        Image.fromarray(image).save("x.jpg", quality=100, **options)  # type: ignore[arg-type]
        found, warning = read_texture("x.jpg")
        assert np.abs(found.astype(int) - (flat if image.ndim == 3 else 200)).max() <= 2
        assert warning is None
    Image.fromarray(np.zeros((8, 8, 4), np.uint8), "CMYK").save("x.jpg", quality=100)
    found, warning = read_texture("x.jpg")
    assert found.min() >= 250
    assert warning == "is CMYK, which is taken for RGB without a colour profile"


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_truncated_files_are_faults(kind: str) -> None:
    Image.fromarray(np.random.default_rng(1).integers(0, 256, (40, 40, 3), np.uint8)).save("x", kind)
    whole = Path("x").read_bytes()
    for share in (0.3, 0.6, 0.9):
        Path("x").write_bytes(whole[: int(share * len(whole))])
        assert fault("x") == DAMAGED
    for length in range(20):  # how much of it makes an image depends on Pillow
        Path("x").write_bytes(whole[:length])
        assert fault("x") in (NO_IMAGE, DAMAGED)


def test_damaged_and_other_files_are_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    Image.fromarray(RGB).save("x.png")
    whole = bytearray(Path("x.png").read_bytes())
    whole[whole.index(b"IDAT") + 8] ^= 0x55
    for data in (whole, png(2, 1, 8, 2, TWO, chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(2**27))))):
        Path("x.png").write_bytes(data)
        assert fault() == DAMAGED
    for kind in ("GIF", "BMP", "TIFF", "PPM", "PCX", "TGA", "ICO", "WEBP"):
        Image.fromarray(RGB).save("x.png", kind)
        assert fault() == NO_IMAGE
    for data in (b"", b"\0", b"P6 1 1 255\n", b"<svg/>", b"%!PS-Adobe\n", b"v 1 2 3\n", bytes(10_000)):
        Path("x.png").write_bytes(data)
        assert fault() == NO_IMAGE
    monkeypatch.setattr(texture, "MAX_BYTES", 10)
    assert fault() == "must not be larger than 10 bytes; --limit texture-bytes=N or CLTRACE_LIMITS allows more"


def test_the_size_is_asked_before_decoding() -> None:
    """A few bytes may promise pixels that fill the memory."""
    for side in (20_000, 100_000):
        Path("x.png").write_bytes(png(side, side // 2, 8, 2, b""))
        assert fault() == f"must not have more than {MAX_TEXELS} pixels"
    Image.fromarray(RGB).save("x.png")
    assert fault(most=34) == "must not have more than 34 pixels with the textures before it"
    assert read_texture("x.png", 35)[0].shape == RGB.shape


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
    assert np.array_equal(read_texture("x.png")[0][..., 1], np.tile(np.uint8([255, 0, 255]), (100_000, 1)))
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
    sizes = [(20_000, 10_000), (65_535, 65_535), (2**31 - 1, 2**31 - 1), (2**32 - 1, 2**32 - 1), (2**31 - 1, 1)]
    refused = [png(width, height, 8, 2, b"") for width, height in (*sizes, (0, 5), (5, 0), (0, 0))]
    refused += [
        png(20_000, 10_000, 1, 0, bytes(2501 * 10_000)),
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 2**31 - 1) + b"IHDR",
        b"\xff\xd8\xff\xc0\x00\x11\x08\xff\xdc\xff\xdc\x03\x01\x22\x00\x02\x11\x01\x03\x11\x01",
        png(5, 5, 7, 2, bytes(80)),
        png(5, 5, 8, 5, bytes(80)),
    ]
    text = b"x\0\0" + zlib.compress(bytes(2**27), 9)
    harmless = [
        *(png(1, 1, 8, 2, bytes(4), chunk(name, text)) for name in (b"zTXt", b"iCCP")),
        png(1, 1, 8, 2, bytes(4), *[chunk(b"zTXt", b"x\0\0" + zlib.compress(bytes(2**20 - 1), 9))] * 200),
        png(5, 5, 8, 3, bytes(30)),
        png(5, 5, 8, 2, b"\x09" * 80),
    ]
    names = [f"{k}.png" for k in range(len(refused + harmless))]
    for name, data in zip(names, refused + harmless, strict=True):
        Path(name).write_bytes(data)
    said = limited("texture", 1000, names)
    assert all(line.startswith("UnreadableError") for line in said[: len(refused)])
    assert all(line.startswith(("UnreadableError", "read")) for line in said)
