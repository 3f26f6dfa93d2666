"""Writes frames: a PNG for each, or a GIF, an animated PNG or an MP4 of all, which takes its place when it is whole.

A PNG says itself what it shows: a text in it is a hash of all that its picture depends on. There is no list of files
beside them, which two processes that draw frames into one folder could spoil for each other, and which would be wrong
once a file is copied or made by something else.
"""

from __future__ import annotations

import hashlib
import importlib
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from cltrace import __version__
from cltrace.base.errors import MissingPackageError, UsageError
from cltrace.picture.files import whole_file
from cltrace.picture.png import text_of, write_png
from cltrace.scene import Scene

Pixels = NDArray[np.uint8]
Put = Callable[[Pixels], object]
# Begins a GIF of frames with colours of their own, which is repeated for ever in the way of Netscape's browser.
GIF_HEAD, GIF_LOOP = b"GIF89a", b"\x70\0\0\x21\xff\x0bNETSCAPE2.0\x03\x01\0\0\0"
# What ffmpeg is told. H.264 as every player shows it has colours at half the resolution and the matrix of HDTV. At 17,
# hardly anybody sees what is lost. What was measured (2026-11-22) of 1920x1080 pixels, processor time, bytes and
# similarity (SSIM) of a frame: of 100,000 spheres "superfast" 74 ms, 457 kB and 0.953, "veryfast" at 18 110 ms, 449 kB
# and 0.957; of smooth surfaces 35 ms, 82 kB and 0.995, and 58 ms, 42 kB and 0.991.
BITEXACT = ("-fflags", "+bitexact", "-flags:v", "+bitexact")
CODECS: dict[str, tuple[str, tuple[str, ...]]] = {
    ".mp4": (
        "libx264",
        (
            *("-preset", "superfast", "-crf", "17", "-vf", "scale=out_color_matrix=bt709:out_range=tv"),
            *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"),
            *("-movflags", "+faststart", "-f", "mp4"),
        ),
    ),
    ".apng": ("apng", ("-pred", "up", "-compression_level", "1", "-plays", "0", "-f", "apng")),
}
NAME = "cltrace"  # of the text in a PNG
# What is no part of a picture, or is there twice.
LEFT_OUT = {"output_file", "source", "scale", "spheres", "materials"}


def write_frame(name: str, pixels: Pixels, mark: Callable[[], str] | None) -> None:
    """Writes a PNG. mark: makes the fingerprint that the file says of itself."""
    with whole_file(Path(name)) as file:
        write_png(file, pixels, {NAME: mark()} if mark else None)


@contextmanager
def movie_writer(path: Path, fps: float, shape: tuple[int, ...]) -> Iterator[Put]:
    """Gives what writes one frame after the other into a movie, which replaces the file when the block has ended well.

    shape: of the frames. Raises MissingPackageError for all but a GIF without the package imageio-ffmpeg, and
    UsageError, at the latest at the end, if ffmpeg fails.
    """
    with whole_file(path) as file:
        if path.suffix.lower() == ".gif":
            with _gif(file, fps, shape) as put:
                yield put
        else:
            with _by_ffmpeg(path, str(file.name), fps, shape) as put:
                yield put


@contextmanager
def _gif(file: BinaryIO, fps: float, shape: tuple[int, ...]) -> Iterator[Put]:
    """A GIF, of 256 colours a frame, which are chosen for each, without alpha.

    A frame's time is a whole number of 1/100 s, 2 at least, so that it ends at the one next to when it should.
    """
    from PIL import GifImagePlugin
    from PIL import Image as Picture

    frames = end = 0

    def put(pixels: Pixels) -> None:
        nonlocal frames, end
        frames += 1
        delay = min(65535, max(2, round(100 * frames / fps) - end))
        end += delay
        picture = Picture.fromarray(pixels[..., :3]).quantize(256)
        data = b"".join(GifImagePlugin.getdata(picture, include_color_table=True))
        file.write(b"\x21\xf9\x04\x04" + delay.to_bytes(2, "little") + b"\0\0" + data)

    height, width = shape[:2]
    file.write(GIF_HEAD + width.to_bytes(2, "little") + height.to_bytes(2, "little") + GIF_LOOP)
    yield put
    file.write(b";")


@contextmanager
def _by_ffmpeg(path: Path, name: str, fps: float, shape: tuple[int, ...]) -> Iterator[Put]:
    """An MP4 of H.264, without alpha and of even sizes: an odd one gets its last column or row twice. Or an animated
    PNG, with all colours; what reads no such file shows its first frame. name: of the file that ffmpeg writes.
    """
    suffix, (height, width, channels) = path.suffix.lower(), shape
    codec, options = CODECS[suffix]
    padding, frames, package = ((0, 0), (0, 0), (0, 0)), 0, find_ffmpeg()
    if suffix == ".mp4":
        padding, channels = ((0, height % 2), (0, width % 2), (0, 0)), 3
    size, kind = (width + padding[1][1], height + padding[0][1]), "rgba" if channels == 4 else "rgb24"
    how: dict[str, Any] = {"codec": codec, "output_params": [*options, *BITEXACT], "input_params": ["-r", f"{fps:.9g}"]}
    how |= {"pix_fmt_in": kind, "pix_fmt_out": "yuv420p" if suffix == ".mp4" else kind}
    how |= {"quality": None, "macro_block_size": 1, "ffmpeg_log_level": "error"}
    stream = package.write_frames(name, size, fps=fps, **how)

    failed = UsageError(f"cannot write {path}: ffmpeg has failed")

    def put(pixels: Pixels) -> None:
        nonlocal frames
        frames += 1
        try:
            stream.send(np.ascontiguousarray(np.pad(pixels[..., :channels], padding, "edge")))
        except OSError:
            raise failed from None

    stream.send(None)
    try:
        yield put
    finally:
        stream.close()
    try:  # imageio-ffmpeg does not say whether ffmpeg has failed, as on a full disk: the file says it
        whole = package.count_frames_and_secs(name)[0] == frames
    except RuntimeError:
        whole = False
    if not whole:
        raise failed


def find_ffmpeg() -> Any:
    """The package imageio-ffmpeg. Raises MissingPackageError, and UsageError where it has no ffmpeg."""
    try:
        package = importlib.import_module("imageio_ffmpeg")
        package.get_ffmpeg_exe()
    except ImportError:
        raise MissingPackageError("an mp4 or apng", "imageio-ffmpeg", "movie") from None
    except RuntimeError as error:
        raise UsageError(f"imageio-ffmpeg: {error}") from None
    return package


class Fingerprints:
    """Hashes of scenes. What a scene shares with the one before it is not read again. Several threads may ask for one.

    options: whatever else the pictures depend on, of which repr() says all.
    """

    def __init__(self, options: Mapping[str, object]) -> None:
        self._options = repr((__version__, sorted(options.items())))
        self._digests: dict[str, tuple[object, bytes]] = {}
        self._lock = threading.Lock()

    def of(self, scene: Scene) -> str:
        """64 digits, which are equal for scenes with equal contents, wherever they were read from."""
        names = sorted({f.name for f in fields(scene)} - LEFT_OUT | {"columns"})
        with self._lock:
            parts = [self._options.encode(), *(self._digest(name, getattr(scene, name)) for name in names)]
        return hashlib.sha256(b"\0".join(parts)).hexdigest()

    def _digest(self, name: str, value: object) -> bytes:
        found = self._digests.get(name)
        if found is None or found[0] is not value:
            digest = hashlib.sha256()
            _feed(digest, value)
            self._digests[name] = found = (value, digest.digest())
        return found[1]


def shows(path: Path, fingerprint: str) -> bool:
    """Whether a file is a whole PNG that was written with this fingerprint."""
    try:
        with path.open("rb") as file:
            return text_of(file, NAME) == fingerprint
    except OSError:
        return False


def _feed(digest: Any, value: object) -> None:
    """Gives a value to a hash, with what tells it from others that have the same bytes."""
    if isinstance(value, np.ndarray):
        digest.update(f"array {value.dtype.descr} {value.shape};".encode())
        digest.update(np.ascontiguousarray(value).view(np.uint8).data if value.size else b"")
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(f"{type(value).__name__}(".encode())
        for f in fields(value):
            _feed(digest, getattr(value, f.name))
        digest.update(b")")
    elif isinstance(value, Mapping):
        _feed(digest, sorted(value.items()))
    elif isinstance(value, (tuple, list)):
        digest.update(b"[")
        for part in value:
            _feed(digest, part)
        digest.update(b"]")
    else:
        digest.update(f"{value!r};".encode())
