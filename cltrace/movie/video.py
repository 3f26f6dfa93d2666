"""Frames -> mp4, by the ffmpeg that the package imageio-ffmpeg brings."""

from __future__ import annotations

import importlib
import re
import subprocess
import tempfile
from contextlib import closing
from pathlib import Path
from subprocess import DEVNULL, PIPE

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import MissingPackageError, UsageError
from cltrace.movie.encoders import Drawn, OneFile

# H.264 as every player shows it, with colours at half the resolution and the matrix of HDTV. At 17, hardly anybody sees
# what is lost. What was measured (2026-11-22) of 1920x1080 pixels, processor time, bytes and similarity (SSIM) of a
# frame: of 100,000 spheres "superfast" 74 ms, 457 kB and 0.953, "veryfast" at 18 110 ms, 449 kB and 0.957; of smooth
# surfaces 35 ms, 82 kB and 0.995, and 58 ms, 42 kB and 0.991.
CODEC = (
    *("-c:v", "libx264", "-preset", "superfast", "-crf", "17", "-pix_fmt", "yuv420p"),
    *("-vf", "scale=out_color_matrix=bt709:out_range=tv"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"),
    *("-movflags", "+faststart", "-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "mp4"),
)
PATIENCE = 60  # seconds in which ffmpeg ends


class Mp4(OneFile):
    """An mp4 of H.264; size: (width, height) of its frames. The encoder is tried before anything else.

    H.264 has even sizes only: an odd one gets its last column or row twice. Raises UsageError, also later, if ffmpeg
    fails, and MissingPackageError if the package is not installed.
    """

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        width, height = (n + n % 2 for n in size)
        start = [_ffmpeg(), "-nostdin", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
        self._command = [*start, "-s", f"{width}x{height}", "-r", f"{fps:.9g}", "-i", "-", *CODEC]
        with (
            tempfile.TemporaryDirectory() as folder,
            closing(_Run([*self._command, str(Path(folder, "trial.mp4"))], path)) as trial,
        ):
            trial.write(bytes(3 * width * height))
            trial.end()
        super().__init__(path)
        self._run = _Run([*self._command, str(self._file.name)], path)

    def encode(self, drawn: Drawn) -> NDArray[np.uint8]:
        pixels = drawn.pixels[..., :3]  # H.264 has no alpha
        height, width = pixels.shape[:2]
        if height % 2 or width % 2:
            return np.pad(pixels, ((0, height % 2), (0, width % 2), (0, 0)), "edge")
        return np.ascontiguousarray(pixels)

    def _write(self, encoded: NDArray[np.uint8]) -> None:
        self._run.write(encoded.data)

    def _finish(self) -> None:
        with closing(self._run):
            self._run.end()

    def abandon(self) -> None:
        self._run.close()
        super().abandon()


class _Run:
    """A run of ffmpeg, which a Ctrl-C on the terminal does not reach. close() ends it, whether it is done or not.

    path: of the movie, for messages.
    """

    def __init__(self, command: list[str], path: Path) -> None:
        self._path = path
        self._words = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            command, bufsize=0, stdin=PIPE, stdout=DEVNULL, stderr=self._words, start_new_session=True
        )
        assert self._process.stdin
        self._stdin = self._process.stdin

    def write(self, data: bytes | memoryview) -> None:
        """Raises UsageError, with ffmpeg's last words, if it has ended."""
        left = memoryview(data).cast("B")
        try:
            while left:
                left = left[self._stdin.write(left) :]
        except (BrokenPipeError, ValueError):
            raise self._fault() from None

    def end(self) -> None:
        """Waits until the file is whole. Raises UsageError as write() does."""
        self._stdin.close()
        if self._process.wait(PATIENCE):
            raise self._fault()

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._stdin.close()
        self._words.close()

    def _fault(self) -> UsageError:
        self._process.wait(PATIENCE)
        self._words.seek(0)
        words = self._words.read().decode(errors="replace").strip().splitlines()
        last = re.sub(r"^\[[^]]*\] ", "", words[-1]) if words else f"ended with status {self._process.returncode}"
        return UsageError(f"cannot write {self._path}: ffmpeg: {last}")


def _ffmpeg() -> str:
    """The path of the program."""
    try:
        package = importlib.import_module("imageio_ffmpeg")
    except ImportError:
        raise MissingPackageError("an mp4", "imageio-ffmpeg", "movie") from None
    try:
        path: str = package.get_ffmpeg_exe()
    except RuntimeError as error:
        raise UsageError(f"imageio-ffmpeg: {error}") from None
    return path
