"""PNG and animated PNG, written row by row with zlib: as exact as any, and in a third of the time.

What was measured, processor time and size, of 1920x1080 pixels of a million spheres (2026-11-22): Pillow at level 1,
which tries five filters for each row, 138 ms and 2.50 MB; here 35 ms and 2.42 MB. Pictures of smooth surfaces become up
to a tenth larger, and those of flat colours up to a third.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from fractions import Fraction
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import DTypeLike, NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
KINDS = {1: 0, 3: 2, 4: 6}  # the format's number for grey, RGB and RGBA, by channels
UP = 2  # the format's number for the filter that subtracts the row above
# So many bytes are filtered at a time, which stay in a processor's cache.
BLOCK = 2**19
# So many compressed bytes are in a chunk of the file.
CHUNK = 2**20

Pixels = NDArray[np.uint8] | NDArray[np.uint16]


def write_png(file: BinaryIO, pixels: Pixels, text: dict[str, str] | None = None) -> None:
    """Writes a picture to an open binary file.

    pixels: (h, w), (h, w, 3) or (h, w, 4) of uint8 or uint16; the fourth is alpha, not multiplied. text: Latin-1, by
    names of at most 79 letters, which say something of the picture.
    """
    rows = Rows(file, pixels.shape, pixels.dtype, text)
    rows.add(pixels)
    rows.close()


class Rows:
    """A PNG that is written rows by rows, from the top. How they are cut does not change a byte of the file.

    shape, dtype, text: of the whole, see write_png(). close() ends it.
    """

    def __init__(
        self, file: BinaryIO, shape: tuple[int, ...], dtype: DTypeLike, text: dict[str, str] | None = None
    ) -> None:
        self._file, self._packer, self._ready = file, _Packer(), bytearray()
        file.write(SIGNATURE + _header(shape, np.dtype(dtype)))
        for name, value in (text or {}).items():
            file.write(_chunk(b"tEXt", name.encode("latin-1") + b"\0" + value.encode("latin-1")))

    def add(self, pixels: Pixels) -> None:
        """Some rows, with the shape of the whole but for their number."""
        for part in self._packer.add(pixels):
            self._ready += part
            while len(self._ready) >= CHUNK:
                self._file.write(_chunk(b"IDAT", bytes(self._ready[:CHUNK])))
                del self._ready[:CHUNK]

    def close(self) -> None:
        self._ready += self._packer.end()
        self._file.write(_chunk(b"IDAT", bytes(self._ready)) + _chunk(b"IEND"))


class _Packer:
    """Rows, each less the one above it, compressed: what is in a PNG's IDAT."""

    def __init__(self) -> None:
        self._compress = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS, 9, zlib.Z_RLE)
        self._above: NDArray[np.uint8] | None = None

    def add(self, pixels: Pixels) -> Iterator[bytes]:
        big = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">"))
        rows = big.view(np.uint8).reshape(len(pixels), -1)
        above = np.zeros_like(rows[:1]) if self._above is None else self._above
        step = max(1, BLOCK // rows.shape[1])
        for i in range(0, len(rows), step):
            block = rows[i : i + step]
            filtered = np.empty((len(block), 1 + rows.shape[1]), np.uint8)
            filtered[:, 0] = UP
            np.subtract(block[:1], above, out=filtered[:1, 1:])
            np.subtract(block[1:], block[:-1], out=filtered[1:, 1:])
            above = block[-1:]
            yield self._compress.compress(filtered.data)
        self._above = above.copy()

    def end(self) -> bytes:
        return self._compress.flush()


def packed(pixels: Pixels) -> bytes:
    """What is in the IDAT of a PNG, in one piece."""
    packer = _Packer()
    return b"".join([*packer.add(pixels), packer.end()])


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
            self._file.write(SIGNATURE + _header(pixels.shape, pixels.dtype))
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


def _header(shape: tuple[int, ...], dtype: np.dtype[Any]) -> bytes:
    kind = KINDS[shape[2] if len(shape) == 3 else 1]
    return _chunk(b"IHDR", struct.pack(">IIBBBBB", shape[1], shape[0], 8 * dtype.itemsize, kind, 0, 0, 0))


def _chunk(kind: bytes, data: bytes = b"") -> bytes:
    return b"".join([struct.pack(">I", len(data)), kind, data, struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))])
