"""Writes frames: a PNG for each, or a GIF, an animated PNG or an MP4 of all, which takes its place when it is whole."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import MissingPackageError, UsageError
from cltrace.movie.fingerprint import NAME
from cltrace.picture.files import whole_file
from cltrace.picture.png import Animation, stream_of, write_png

Pixels = NDArray[np.uint8]
# Begins a GIF of frames with colours of their own, which is repeated for ever in the way of Netscape's browser.
GIF_HEAD, GIF_LOOP = b"GIF89a", b"\x70\0\0\x21\xff\x0bNETSCAPE2.0\x03\x01\0\0\0"
# H.264 as every player shows it, with colours at half the resolution and the matrix of HDTV. At 17, hardly anybody sees
# what is lost. What was measured (2026-11-22) of 1920x1080 pixels, processor time, bytes and similarity (SSIM) of a
# frame: of 100,000 spheres "superfast" 74 ms, 457 kB and 0.953, "veryfast" at 18 110 ms, 449 kB and 0.957; of smooth
# surfaces 35 ms, 82 kB and 0.995, and 58 ms, 42 kB and 0.991.
CODEC = (
    *("-preset", "superfast", "-crf", "17", "-vf", "scale=out_color_matrix=bt709:out_range=tv"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"),
    *("-movflags", "+faststart", "-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "mp4"),
)


def write_frame(name: str, pixels: Pixels, mark: Callable[[], str] | None) -> str:
    """Writes a PNG, and returns its name. mark: makes the fingerprint that the file says of itself."""
    with whole_file(Path(name)) as file:
        write_png(file, pixels, {NAME: mark()} if mark else None)
    return name


class MovieWriter(Protocol):
    """Writes the frames of a movie, which all have the size of the first one."""

    def encode(self, pixels: Pixels) -> Any:
        """What put() takes. Several threads call this at once."""

    def put(self, encoded: Any) -> None:
        """Writes what encode() returned, in the order of the frames, from one thread at a time."""

    def end(self) -> None:
        """Writes the end."""

    def close(self) -> None:
        """Frees what is used, whether the movie is whole or not."""


@contextmanager
def movie_writer(path: Path, fps: float, size: tuple[int, int]) -> Iterator[MovieWriter]:
    """Writes a movie, which replaces the file of this name when the block has ended well; size: (width, height).

    Raises MissingPackageError for an MP4 without the package imageio-ffmpeg, and UsageError, at the latest at the end,
    if ffmpeg fails.
    """
    with whole_file(path) as file:
        writer: MovieWriter
        if path.suffix.lower() == ".mp4":
            writer = Mp4Writer(path, file, fps, size)
        else:
            writer = GifWriter(file, fps) if path.suffix.lower() == ".gif" else ApngWriter(file, fps)
        try:
            yield writer
            writer.end()
        finally:
            writer.close()


class ApngWriter:
    """An animated PNG, with all colours; what reads no such file shows the first frame."""

    def __init__(self, file: BinaryIO, fps: float) -> None:
        self._movie = Animation(file, fps)

    def encode(self, pixels: Pixels) -> tuple[Pixels, bytes]:
        return pixels, stream_of(pixels)

    def put(self, encoded: tuple[Pixels, bytes]) -> None:
        self._movie.add(*encoded)

    def end(self) -> None:
        self._movie.close()

    def close(self) -> None:
        pass


class GifWriter:
    """A GIF, of 256 colours a frame, which are chosen for each, without alpha.

    A frame's time is a whole number of 1/100 s, 2 at least, so that it ends at the one next to when it should.
    """

    def __init__(self, file: BinaryIO, fps: float) -> None:
        self._file, self._fps, self._frames, self._end = file, fps, 0, 0

    def encode(self, pixels: Pixels) -> tuple[tuple[int, int], list[bytes]]:
        from PIL import GifImagePlugin
        from PIL import Image as Picture

        picture = Picture.fromarray(pixels[..., :3]).quantize(256)
        return picture.size, GifImagePlugin.getdata(picture, include_color_table=True)

    def put(self, encoded: tuple[tuple[int, int], list[bytes]]) -> None:
        (width, height), data = encoded
        if not self._frames:
            self._file.write(GIF_HEAD + width.to_bytes(2, "little") + height.to_bytes(2, "little") + GIF_LOOP)
        self._frames += 1
        delay = min(65535, max(2, round(100 * self._frames / self._fps) - self._end))
        self._end += delay
        self._file.write(b"\x21\xf9\x04\x04" + delay.to_bytes(2, "little") + b"\0\0" + b"".join(data))

    def end(self) -> None:
        self._file.write(b";")

    def close(self) -> None:
        pass


class Mp4Writer:
    """An MP4 of H.264, by the package imageio-ffmpeg.

    H.264 has even sizes only: an odd one gets its last column or row twice.
    """

    def __init__(self, path: Path, file: BinaryIO, fps: float, size: tuple[int, int]) -> None:
        self._path, self._name, self._frames = path, str(file.name), 0
        how: dict[str, Any] = {"input_params": ["-r", f"{fps:.9g}"], "output_params": list(CODEC)}
        how |= {"codec": "libx264", "quality": None, "macro_block_size": 1, "ffmpeg_log_level": "error"}
        width, height = (n + n % 2 for n in size)
        self._stream = find_ffmpeg().write_frames(self._name, (width, height), fps=fps, **how)
        self._stream.send(None)

    def encode(self, pixels: Pixels) -> Pixels:
        height, width = pixels.shape[:2]
        padding = ((0, height % 2), (0, width % 2), (0, 0))
        return np.ascontiguousarray(np.pad(pixels[..., :3], padding, "edge"))  # H.264 has no alpha

    def put(self, encoded: Pixels) -> None:
        self._frames += 1
        try:
            self._stream.send(encoded)
        except OSError:
            raise UsageError(f"cannot write {self._path}: ffmpeg has failed") from None

    def end(self) -> None:
        """imageio-ffmpeg does not say whether ffmpeg has failed, as on a full disk: the file says it."""
        self._stream.close()
        try:
            whole = find_ffmpeg().count_frames_and_secs(self._name)[0] == self._frames
        except RuntimeError:
            whole = False
        if not whole:
            raise UsageError(f"cannot write {self._path}: ffmpeg has failed")

    def close(self) -> None:
        self._stream.close()


def find_ffmpeg() -> Any:
    """The package imageio-ffmpeg. Raises MissingPackageError, and UsageError where it has no ffmpeg."""
    try:
        package = importlib.import_module("imageio_ffmpeg")
        package.get_ffmpeg_exe()
    except ImportError:
        raise MissingPackageError("an mp4", "imageio-ffmpeg", "movie") from None
    except RuntimeError as error:
        raise UsageError(f"imageio-ffmpeg: {error}") from None
    return package
