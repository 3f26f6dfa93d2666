"""PNG, written by bands of rows with zlib: as exact as any, and in a third of the time.

What was measured, processor time and size, of 1920x1080 pixels of a million spheres (2026-11-22): Pillow at level 1,
which tries five filters for each row, 138 ms and 2.50 MB; here 35 ms and 2.42 MB. Pictures of smooth surfaces become up
to a tenth larger, and those of flat colours up to a third.
"""

from __future__ import annotations

import struct
import zlib
from typing import BinaryIO

import numpy as np
from numpy.typing import DTypeLike, NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
KINDS = {1: 0, 3: 2, 4: 6}  # the format's number for grey, RGB and RGBA, by channels
# The format's numbers for the filters that subtract the pixel on the left, and the row above.
SUB, UP = 1, 2
# So many rows are filtered and compressed on their own. Together they are the one stream of zlib that the format wants:
# what it begins with, and the last block, in which nothing is, before its sum.
BAND = 16
HEAD, LAST = b"\x78\x01", b"\x03\x00"
# So many compressed bytes are in a chunk of the file.
CHUNK = 2**20

Pixels = NDArray[np.uint8] | NDArray[np.uint16]


def write_png(file: BinaryIO, pixels: Pixels, text: dict[str, str] | None = None, dpi: float | None = None) -> None:
    """Writes a picture to an open binary file.

    pixels: (h, w), (h, w, 3) or (h, w, 4) of uint8 or uint16; the fourth is alpha, not multiplied. text: Latin-1, by
    names of at most 79 letters, which say something of the picture; dpi: pixels an inch, which the file has as whole
    ones a metre.
    """
    rows = Rows(file, pixels.shape, pixels.dtype, text, dpi=dpi)
    rows.write(pixels)
    rows.close()


class Rows:
    """A PNG that is written rows by rows, from the top. How they are cut does not change a byte of the file.

    shape, dtype, text, dpi: of the whole, see write_png(). close() ends it.
    """

    def __init__(
        self,
        file: BinaryIO,
        shape: tuple[int, ...],
        dtype: DTypeLike,
        text: dict[str, str] | None = None,
        dpi: float | None = None,
    ) -> None:
        self._file, self._ready, self._adler = file, bytearray(HEAD), 1
        kind, bits = KINDS[shape[2] if len(shape) == 3 else 1], 8 * np.dtype(dtype).itemsize
        file.write(SIGNATURE + _chunk(b"IHDR", struct.pack(">IIBBBBB", shape[1], shape[0], bits, kind, 0, 0, 0)))
        if dpi is not None:
            file.write(_chunk(b"pHYs", struct.pack(">IIB", *[round(dpi / 0.0254)] * 2, 1)))
        for name, value in (text or {}).items():
            file.write(_chunk(b"tEXt", name.encode("latin-1") + b"\0" + value.encode("latin-1")))

    def write(self, pixels: Pixels) -> None:
        """Some rows: a multiple of BAND, but for the last ones."""
        for i in range(0, len(pixels), BAND):
            band = np.ascontiguousarray(pixels[i : i + BAND], pixels.dtype.newbyteorder(">"))
            rows = band.view(np.uint8).reshape(len(band), -1)
            filtered = _filtered(rows, rows.shape[1] // band.shape[1]).data
            compress = zlib.compressobj(1, zlib.DEFLATED, -zlib.MAX_WBITS, 9, zlib.Z_RLE)
            # Blocks of deflate that end with a whole byte.
            self._ready += compress.compress(filtered) + compress.flush(zlib.Z_SYNC_FLUSH)
            self._adler = zlib.adler32(filtered, self._adler)
            while len(self._ready) >= CHUNK:
                self._file.write(_chunk(b"IDAT", bytes(self._ready[:CHUNK])))
                del self._ready[:CHUNK]

    def close(self) -> None:
        self._ready += LAST + struct.pack(">I", self._adler)
        self._file.write(_chunk(b"IDAT", bytes(self._ready)) + _chunk(b"IEND"))


def _filtered(rows: NDArray[np.uint8], pixel: int) -> NDArray[np.uint8]:
    """Rows of bytes, each with its filter before it: all less the one above, the first less its pixels on the left.

    pixel: bytes that a pixel has.
    """
    out = np.empty((len(rows), 1 + rows.shape[1]), np.uint8)
    out[0, 0], out[1:, 0] = SUB, UP
    out[0, 1 : 1 + pixel] = rows[0, :pixel]
    np.subtract(rows[0, pixel:], rows[0, :-pixel], out=out[0, 1 + pixel :])
    np.subtract(rows[1:], rows[:-1], out=out[1:, 1:])
    return out


def text_of(file: BinaryIO, name: str) -> str | None:
    """The text of this name before the pixels of a PNG of write_png(); None if it has none, or is not whole.

    It is whole if it ends as a PNG, and all that is in it has the sums that it says.
    """
    if file.read(len(SIGNATURE)) != SIGNATURE:
        return None
    found = None
    while len(head := file.read(8)) == 8:
        length, kind = struct.unpack(">I4s", head)
        data = file.read(min(length, 2 * CHUNK) + 4)
        total = zlib.crc32(data[:-4], zlib.crc32(kind)).to_bytes(4, "big")
        if len(data) != length + 4 or total != data[-4:]:
            return None
        if kind == b"IEND":
            return found
        key, _, value = data[:-4].partition(b"\0")
        if (kind, key) == (b"tEXt", name.encode("latin-1")):
            found = value.decode("latin-1")
    return None


def _chunk(kind: bytes, data: bytes = b"") -> bytes:
    return b"".join([struct.pack(">I", len(data)), kind, data, struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))])
