"""OpenEXR files of 32-bit channels, written by rows: what the format calls scan lines, with the compression ZIP.

https://openexr.com/en/latest/OpenEXRFileLayout.html has the format. The package OpenEXR writes only whole pictures, and
holds three copies of them.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping
from functools import partial
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import concurrently
from cltrace.picture.png import HEAD

MAGIC, VERSION = 20000630, 2
# The format's numbers: of the compression, which takes so many lines at once, and of the kinds of numbers.
ZIP, LINES = 3, 16
KINDS = {"u": 0, "f": 2}
# Of zlib: higher ones take a quarter more time for files that are 2 % smaller.
LEVEL = 2
# Blocks of lines that are compressed before they are written.
AT_ONCE = 16

Channels = Mapping[str, NDArray[np.float32] | NDArray[np.uint32]]


class Rows:
    """A file to which rows are written from the top. How they are cut does not change a byte of it.

    file: open and binary; channels: the first rows, (h, w) each, by their names; height: of the whole. close() ends it.
    """

    def __init__(self, file: BinaryIO, channels: Channels, height: int) -> None:
        # The table of where blocks are stands before them, so what goes into a pipe is put together here.
        self._target, self._file = file, file if file.seekable() else io.BytesIO()
        self._file.write(_header(channels, height))
        self._table, self._places = self._file.tell(), list[int]()
        self._file.write(bytes(8 * -(-height // LINES)))
        self._line = 0

    def write(self, channels: Channels) -> None:
        """More rows: a multiple of LINES, but for the last ones."""
        planes = [channels[name].view(np.uint32) for name in sorted(channels)]
        blocks = range(0, len(planes[0]), LINES)
        for i in range(0, len(blocks), AT_ONCE):
            jobs = [partial(_block, [plane[y : y + LINES] for plane in planes]) for y in blocks[i : i + AT_ONCE]]
            for data in concurrently(jobs):
                self._places.append(self._file.tell())
                self._file.write(struct.pack("<ii", self._line, len(data)) + data)
                self._line += LINES

    def close(self) -> None:
        """Writes where the blocks are."""
        self._file.seek(self._table)
        self._file.write(np.array(self._places, "<u8").tobytes())
        if isinstance(self._file, io.BytesIO):
            self._target.write(self._file.getbuffer())


def _block(planes: list[NDArray[np.uint32]]) -> bytes:
    """Lines, each with one channel after the other, compressed where that makes them smaller.

    Before that, bytes at even places come first, and of each the one before it is subtracted.
    """
    plain = np.stack(planes, axis=1).astype("<u4", copy=False).view(np.uint8).ravel()
    parted = np.concatenate([plain[::2], plain[1::2]])
    parted[1:] -= parted[:-1] - np.uint8(128)
    data = _compressed(parted)
    return data if len(data) < len(plain) else plain.tobytes()


def _compressed(parted: NDArray[np.uint8]) -> bytes:
    """A stream of zlib. The first half is mostly noise, in which looking for more than runs finds nothing."""
    middle, data = len(parted) // 2, HEAD
    for part, strategy, end in (
        (parted[:middle], zlib.Z_RLE, zlib.Z_SYNC_FLUSH),
        (parted[middle:], zlib.Z_DEFAULT_STRATEGY, zlib.Z_FINISH),
    ):
        compress = zlib.compressobj(LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS, 9, strategy)
        data += compress.compress(part.data) + compress.flush(end)
    return data + zlib.adler32(parted.data).to_bytes(4, "big")


def _header(channels: Channels, height: int) -> bytes:
    width = next(iter(channels.values())).shape[1]
    kinds = ((name, KINDS[channels[name].dtype.kind]) for name in sorted(channels))
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", kind, 0, 1, 1) for name, kind in kinds)
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = {
        ("channels", "chlist"): listed + b"\0",
        ("compression", "compression"): bytes([ZIP]),
        ("dataWindow", "box2i"): window,
        ("displayWindow", "box2i"): window,
        ("lineOrder", "lineOrder"): b"\0",
        ("pixelAspectRatio", "float"): struct.pack("<f", 1),
        ("screenWindowCenter", "v2f"): struct.pack("<2f", 0, 0),
        ("screenWindowWidth", "float"): struct.pack("<f", 1),
        ("type", "string"): b"scanlineimage",
    }
    parts = (f"{name}\0{kind}\0".encode() + struct.pack("<i", len(v)) + v for (name, kind), v in attributes.items())
    return struct.pack("<ii", MAGIC, VERSION) + b"".join(parts) + b"\0"
