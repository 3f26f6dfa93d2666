"""The formats of files beside PNG with 8 bits, and what each of them holds.

NPY is the array of one output, as the image has it, and NPZ has some of them by their names. An OpenEXR file has them
as channels, whose names and units are those of CHANNELS.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import ROWS, concurrently
from cltrace.picture import png

# Formats of Pillow, by the ends of names.
FORMATS = {".tif": "TIFF", ".tiff": "TIFF", ".jpg": "JPEG", ".jpeg": "JPEG"}
SUFFIXES = (".png", *FORMATS, ".exr", ".npy", ".npz")
# Those that can be written from the top, without the whole picture.
BY_ROWS = (".png", ".exr", ".npy")
# Those that say how large a picture is in print.
SIZED = (".png", *FORMATS)
QUALITY: dict[str, dict[str, Any]] = {
    "TIFF": {"compression": "tiff_deflate"},
    "JPEG": {"quality": 95, "subsampling": 0},
}
# The channels of an EXR, by the output that they hold. R, G, B: linear light, 1 = full, times A if there is an A, as
# the format has it; A: alpha, 0..1; Z: distance from the eye, scene units; N: unit normal in the world; D: direction of
# the pixel's ray in the world; id, primitive: unsigned 32 bit, of which 4294967295 is what -1 is in the image, where
# there is none; U, V: texture coordinates; error: of R, G and B, in levels of 255; coverage: a pixel's share. All
# others are 32-bit floats.
CHANNELS = {
    "color": ("R", "G", "B"),
    "alpha": ("A",),
    "depth": ("Z",),
    "normal": ("N.X", "N.Y", "N.Z"),
    "direction": ("D.X", "D.Y", "D.Z"),
    "id": ("id",),
    "primitive": ("primitive",),
    "uv": ("U", "V"),
    "error": ("error",),
    "coverage": ("coverage",),
}

Arrays = Mapping[str, NDArray[Any]]


def check_format(path: Path, suffixes: tuple[str, ...] = SUFFIXES) -> None:
    """Raises ValueError if no picture can have a file of this name."""
    if path.suffix.lower() not in suffixes:
        names = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        raise ValueError(f"the name of a picture must end in {names}, got {str(path)!r}")


def write_pillow(file: BinaryIO, suffix: str, pixels: NDArray[np.uint8], dpi: float | None) -> None:
    """Writes (h, w, 3) or (h, w, 4) to an open binary file: TIFF exactly, JPEG with a loss and without alpha.

    suffix: one of FORMATS; dpi: pixels an inch, None to say nothing of that.
    """
    from PIL import Image as Picture

    kind = FORMATS[suffix]
    buffer, picture = io.BytesIO(), Picture.fromarray(pixels[..., :3] if kind == "JPEG" else pixels)
    picture.save(buffer, kind, **QUALITY[kind], **({} if dpi is None else {"dpi": (dpi, dpi)}))
    file.write(buffer.getbuffer())  # at once: Pillow goes back and forth in what it writes


class Writer(Protocol):
    """What writes the rows of a picture from the top, a multiple of 16 at a time; close() ends the file."""

    def write(self, part: Any) -> None: ...
    def close(self) -> None: ...


def writer(file: BinaryIO, suffix: str, part: Any, height: int, dpi: float | None) -> Writer:
    """What writes a file with one of the suffixes BY_ROWS.

    file: open and binary; part: its first rows, as Writer.write() takes them; height: how many rows there are; dpi:
    pixels an inch, of PNG alone.
    """
    if suffix == ".png":
        return png.Rows(file, (height, *part.shape[1:]), part.dtype, dpi=dpi)
    return _Npy(file, part, height) if suffix == ".npy" else _Exr(file, part, height)


class _Npy:
    """One array."""

    def __init__(self, file: BinaryIO, first: NDArray[Any], height: int) -> None:
        self._file = file
        told = np.lib.format.header_data_from_array_1_0(first[:0])
        np.lib.format.write_array_header_1_0(file, told | {"shape": (height, *first.shape[1:])})

    def write(self, array: NDArray[Any]) -> None:
        for i in range(0, len(array), ROWS):
            self._file.write(np.ascontiguousarray(array[i : i + ROWS]).data)

    def close(self) -> None:
        pass


# OpenEXR files of 32-bit channels, written by rows: what the format calls scan lines, with the compression ZIP.
#
# https://openexr.com/en/latest/OpenEXRFileLayout.html has the format. The package OpenEXR writes only whole pictures,
# and holds three copies of them.

EXR_MAGIC, EXR_VERSION = 20000630, 2
# The format's numbers: of the compression, which takes so many lines at once, and of the kinds of numbers.
ZIP, LINES = 3, 16
EXR_KINDS = {"u": 0, "f": 2}
# Blocks of lines that are compressed before they are written.
BLOCKS_AT_ONCE = 16


class _Exr:
    """Outputs by their names, as channels. How the rows are cut does not change a byte of the file."""

    def __init__(self, file: BinaryIO, first: Arrays, height: int) -> None:
        for name in first:
            if name not in CHANNELS:
                raise ValueError(f"outputs: an EXR has none of {name}, only of {', '.join(CHANNELS)}")
        # The table of where blocks are stands before them, so what goes into a pipe is put together here.
        self._target, self._file = file, file if file.seekable() else io.BytesIO()
        self._file.write(_exr_header(_channels({name: array[:0] for name, array in first.items()}), height))
        self._table, self._places, self._line = self._file.tell(), list[int](), 0
        self._file.write(bytes(8 * -(-height // LINES)))

    def write(self, arrays: Arrays) -> None:
        height = len(next(iter(arrays.values())))
        for i in range(0, height, BLOCKS_AT_ONCE * LINES):
            part = slice(i, min(height, i + BLOCKS_AT_ONCE * LINES))
            channels = _channels({name: array[part] for name, array in arrays.items()})
            planes = [channels[name].view(np.uint32) for name in sorted(channels)]
            blocks = range(0, part.stop - i, LINES)
            for data in concurrently([partial(_block, [plane[y : y + LINES] for plane in planes]) for y in blocks]):
                self._places.append(self._file.tell())
                self._file.write(struct.pack("<ii", self._line, len(data)) + data)
                self._line += LINES

    def close(self) -> None:
        """Writes where the blocks are."""
        self._file.seek(self._table)
        self._file.write(np.array(self._places, "<u8").tobytes())
        if isinstance(self._file, io.BytesIO):
            self._target.write(self._file.getbuffer())


def _channels(arrays: Arrays) -> dict[str, NDArray[Any]]:
    channels: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        value = array
        if name == "color" and "alpha" in arrays:
            value = array * arrays["alpha"][..., None]
        kind = np.uint32 if array.dtype.kind == "i" else np.float32
        with np.errstate(over="ignore"):  # distances beyond float32's range are infinite there
            planes = np.moveaxis(np.atleast_3d(value).astype(kind, copy=False), -1, 0)
        channels |= zip(CHANNELS[name], planes, strict=True)
    return channels


def _block(planes: list[NDArray[np.uint32]]) -> bytes:
    """Lines, each with one channel after the other, compressed where that makes them smaller.

    Before that, bytes at even places come first, and of each the one before it is subtracted.
    """
    plain = np.stack(planes, axis=1).astype("<u4", copy=False).view(np.uint8).ravel()
    parted = np.concatenate([plain[::2], plain[1::2]])
    parted[1:] -= parted[:-1] - np.uint8(128)
    data = zlib.compress(parted.data, 1)
    return data if len(data) < len(plain) else plain.tobytes()


def _exr_header(channels: Arrays, height: int) -> bytes:
    width = next(iter(channels.values())).shape[1]
    kinds = ((name, EXR_KINDS[channels[name].dtype.kind]) for name in sorted(channels))
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
    return struct.pack("<ii", EXR_MAGIC, EXR_VERSION) + b"".join(parts) + b"\0"
