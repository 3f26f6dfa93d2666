"""PNG and animated PNG, written row by row with zlib: as exact as any, and in a third of the time.

What was measured, processor time and size, of 1920x1080 pixels of a million spheres (2026-11-22): Pillow at level 1,
which tries five filters for each row, 138 ms and 2.50 MB; here 35 ms and 2.42 MB. Pictures of smooth surfaces become up
to a tenth larger, and those of flat colours up to a third.
"""

from __future__ import annotations

import struct
import zlib
from fractions import Fraction
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
KINDS = {1: 0, 3: 2, 4: 6}  # the format's number for grey, RGB and RGBA, by channels
UP = 2  # the format's number for the filter that subtracts the row above
# So many bytes are filtered at a time, which stay in a processor's cache.
BLOCK = 2**19

Pixels = NDArray[np.uint8] | NDArray[np.uint16]


def write_png(file: BinaryIO, pixels: Pixels, text: dict[str, str] | None = None) -> None:
    """Writes a picture to an open binary file.

    pixels: (h, w), (h, w, 3) or (h, w, 4) of uint8 or uint16; the fourth is alpha, not multiplied. text: Latin-1, by
    names of at most 79 letters, which say something of the picture.
    """
    file.write(SIGNATURE + _header(pixels))
    for name, value in (text or {}).items():
        file.write(_chunk(b"tEXt", name.encode("latin-1") + b"\0" + value.encode("latin-1")))
    file.write(_chunk(b"IDAT", packed(pixels)) + _chunk(b"IEND"))


def packed(pixels: Pixels) -> bytes:
    """The rows, each less the one above it, compressed: what is in a PNG's IDAT."""
    big = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">"))
    rows = big.view(np.uint8).reshape(len(pixels), -1)
    compress = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, 9, zlib.Z_RLE)
    parts, step = [], max(1, BLOCK // rows.shape[1])
    for i in range(0, len(rows), step):
        block = rows[i : i + step]
        filtered = np.empty((len(block), 1 + rows.shape[1]), np.uint8)
        filtered[:, 0] = UP
        above = rows[i - 1 : i + len(block) - 1] if i else np.concatenate([np.zeros_like(rows[:1]), block[:-1]])
        np.subtract(block, above, out=filtered[:, 1:])
        parts.append(compress.compress(filtered.data))
    return b"".join([*parts, compress.flush()])


def text_of(file: BinaryIO, name: str) -> str | None:
    """The text of this name before the pixels of a PNG; None if it has none, or is not whole or no PNG."""
    if file.read(len(SIGNATURE)) != SIGNATURE:
        return None
    found = None
    while len(head := file.read(8)) == 8:
        length, kind = struct.unpack(">I4s", head)
        if kind == b"IEND":
            return found
        if kind == b"tEXt" and length < 2**16:
            key, _, value = file.read(length).partition(b"\0")
            found = value.decode("latin-1") if key == name.encode("latin-1") else found
            file.seek(4, 1)
        else:
            file.seek(length + 4, 1)
    return None


class Animation:
    """An animated PNG, frame by frame: each is a whole picture, and the first one is what other programs show.

    file: open for writing, and one that can be searched; fps: frames a second. close()
    ends it.
    """

    def __init__(self, file: BinaryIO, fps: float) -> None:
        self._file, self._count, self._number = file, 0, 0
        self._delay = _delay(fps)

    def add(self, pixels: Pixels, compressed: bytes | None = None) -> None:
        """Adds a frame, all of the same shape. compressed: packed(pixels), if that is there already."""
        height, width = pixels.shape[:2]
        if not self._count:
            self._file.write(SIGNATURE + _header(pixels))
            self._place = self._file.tell()
            self._file.write(_control(0))
        place = struct.pack(">IIIIIHHBB", self._next(), width, height, 0, 0, *self._delay, 0, 0)
        data = packed(pixels) if compressed is None else compressed
        self._file.write(_chunk(b"fcTL", place))
        if self._count:
            self._file.write(_chunk(b"fdAT", struct.pack(">I", self._next()) + data))
        else:
            self._file.write(_chunk(b"IDAT", data))
        self._count += 1

    def close(self) -> None:
        """Writes the end, and into the beginning how many frames there are."""
        self._file.write(_chunk(b"IEND"))
        self._file.seek(self._place)
        self._file.write(_control(self._count))

    def _next(self) -> int:
        self._number += 1
        return self._number - 1


def _control(count: int) -> bytes:
    """Says that it is an animation of so many frames, which is repeated for ever."""
    return _chunk(b"acTL", struct.pack(">II", count, 0))


def _delay(fps: float) -> tuple[int, int]:
    """The seconds that a frame is shown, as two whole numbers of 16 bits: the nearest fraction that there is."""
    seconds = min(Fraction(1 / fps).limit_denominator(65535), Fraction(65535))
    return (seconds.numerator, seconds.denominator) if seconds.numerator <= 65535 else (round(seconds), 1)


def _header(pixels: Pixels) -> bytes:
    height, width = pixels.shape[:2]
    kind = KINDS[pixels.shape[2] if pixels.ndim == 3 else 1]
    return _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8 * pixels.dtype.itemsize, kind, 0, 0, 0))


def _chunk(kind: bytes, data: bytes = b"") -> bytes:
    return b"".join([struct.pack(">I", len(data)), kind, data, struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))])
