"""The formats of files beside PNG with 8 bits, and what each of them holds.

NPY is the array of one output, as the image has it, and NPZ has some of them by their names. An OpenEXR file has them
as channels, whose names and units are those of CHANNELS.
"""

from __future__ import annotations

import importlib
import importlib.util
import io
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import by_rows
from cltrace.base.errors import MissingPackageError
from cltrace.base.waiting import aside
from cltrace.scene.colors import Transfer, encoded

# Formats of Pillow, by the ends of names.
FORMATS = {".tif": "TIFF", ".tiff": "TIFF", ".jpg": "JPEG", ".jpeg": "JPEG"}
SUFFIXES = (".png", *FORMATS, ".exr", ".npy", ".npz")
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
    """Raises ValueError if no picture can have a file of this name, and MissingPackageError if that takes a package."""
    if path.suffix.lower() not in suffixes:
        names = " or ".join(filter(None, (", ".join(suffixes[:-1]), suffixes[-1])))
        raise ValueError(f"the name of a picture must end in {names}, got {str(path)!r}")
    if path.suffix.lower() == ".exr" and not importlib.util.find_spec("OpenEXR"):
        raise MissingPackageError("writing .exr", "OpenEXR", "exr")


def levels16(color: NDArray[np.float32], transfer: Transfer, alpha: NDArray[Any] | None) -> NDArray[np.uint16]:
    """(h, w, 3), or with an alpha of (h, w) (h, w, 4): 65535 times colours and alpha, 0..1, rounded.

    transfer: the curve by which linear colours are written.
    """

    def levels(rows: slice) -> NDArray[Any]:
        values = encoded(np.clip(color[rows], 0.0, 1.0), transfer)
        if alpha is not None:
            values = np.concatenate([values, alpha[rows, :, None]], axis=-1)
        return np.asarray(np.rint(values * 65535))

    return by_rows(levels, (*color.shape[:2], 3 if alpha is None else 4), np.uint16)


def write_pillow(file: BinaryIO, suffix: str, pixels: NDArray[np.uint8], dpi: float | None) -> None:
    """Writes (h, w, 3) or (h, w, 4) to an open binary file: TIFF exactly, JPEG with a loss and without alpha.

    suffix: one of FORMATS; dpi: pixels an inch, None to say nothing of that.
    """
    from PIL import Image as Picture

    kind = FORMATS[suffix]
    buffer, picture = io.BytesIO(), Picture.fromarray(pixels[..., :3] if kind == "JPEG" else pixels)
    picture.save(buffer, kind, **QUALITY[kind], **({} if dpi is None else {"dpi": (dpi, dpi)}))
    file.write(buffer.getbuffer())  # at once: Pillow goes back and forth in what it writes


def write_npy(file: BinaryIO, array: NDArray[Any]) -> None:
    """Writes one array to an open binary file."""
    # Of a real file numpy asks where it is, which a pipe does not know.
    np.save(SimpleNamespace(write=file.write), array, allow_pickle=False)


def write_npz(file: BinaryIO, arrays: Arrays) -> None:
    """Writes arrays by their names to an open binary file, not compressed."""
    np.savez(file, allow_pickle=False, **arrays)


def write_exr(file: BinaryIO, arrays: Arrays) -> None:
    """Writes outputs to an open binary file. Raises ValueError where CHANNELS has no such output."""
    for name in arrays:
        if name not in CHANNELS:
            raise ValueError(f"outputs: an EXR has none of {name}, only of {', '.join(CHANNELS)}")
    aside(partial(_write_exr, file, arrays))  # of 4,000 x 4,000 pixels, numpy and the package take long


def _write_exr(file: BinaryIO, arrays: Arrays) -> None:
    channels: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        value = array
        if name == "color" and "alpha" in arrays:
            value = array * arrays["alpha"][..., None]
        kind = np.uint32 if array.dtype.kind == "i" else np.float32
        with np.errstate(over="ignore"):  # distances beyond float32's range are infinite there
            planes = np.moveaxis(np.atleast_3d(value).astype(kind), -1, 0)
        channels |= {c: np.ascontiguousarray(plane) for c, plane in zip(CHANNELS[name], planes, strict=True)}
    openexr = importlib.import_module("OpenEXR")
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    whole = openexr.File(header, channels)
    if file.seekable():
        whole.write(file)
        return
    buffer = io.BytesIO()  # the package goes back and forth in what it writes
    whole.write(buffer)
    file.write(buffer.getbuffer())
