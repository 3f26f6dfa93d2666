"""Frames -> files: a PNG for each, or one animated PNG or GIF for all."""

from __future__ import annotations

import io
import struct
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import processors
from cltrace.movie.fingerprint import NAME
from cltrace.picture.files import whole_file
from cltrace.picture.png import Animation, stream_of, write_png

GIF_EXTENSION = 0x21  # the byte with which one begins
# Says that the movie is repeated for ever, in the way of the program that had it first.
GIF_LOOP = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\0\0\0"


class Drawn(NamedTuple):
    """A frame that was drawn. pixels: (h, w, 3) or (h, w, 4) uint8; mark: returns the fingerprint of what it shows."""

    number: int
    pixels: NDArray[np.uint8]
    mark: Callable[[], str] | None = None


class Encoder(Protocol):
    """What makes files of frames. All are of the size of the first one, unless each has a file of its own."""

    def encode(self, drawn: Drawn) -> Any:
        """What put() takes. Several threads call this at once."""

    def put(self, encoded: Any) -> None:
        """Writes what encode() returned, in the order of the frames, from one thread at a time."""

    def close(self) -> None:
        """Ends the file."""

    def abandon(self) -> None:
        """Leaves nothing of a file that is not whole. Another thread may be in put(), which then ends soon."""


class Writer:
    """Encodes and writes frames beside what draws them; a few at a time, so that memory does not grow.

    For use in a `with` block. What goes wrong in a thread is raised by one of the next calls, or at the block's end.
    """

    def __init__(self, encoder: Encoder) -> None:
        self._encoder, self._most = encoder, processors()
        self._encoding = ThreadPoolExecutor(self._most)
        self._putting = ThreadPoolExecutor(1)
        self._pending: deque[Future[None]] = deque()

    def add(self, drawn: Drawn) -> None:
        """Takes a frame, whose pixels are not to change any more."""
        job = self._encoding.submit(self._encoder.encode, drawn)
        self._pending.append(self._putting.submit(lambda: self._encoder.put(job.result())))
        while len(self._pending) > self._most:
            self._pending.popleft().result()

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with ExitStack() as stack:
            stack.callback(self._encoding.shutdown, cancel_futures=True)
            stack.callback(self._putting.shutdown, cancel_futures=True)
            whole = False
            try:
                if error is None:
                    while self._pending:
                        self._pending.popleft().result()
                    self._encoder.close()
                    whole = True
                elif isinstance(error, Exception):  # and not Ctrl-C: what was drawn before is written
                    wait(self._pending)
            finally:
                if not whole:
                    self._encoder.abandon()


class PngFiles:
    """A PNG for each frame, of which name_of() is the name. Each file is there as a whole or not at all.

    written: gets the names of those that are there.
    """

    def __init__(self, name_of: Callable[[int], str], written: list[str]) -> None:
        self._name_of, self._written = name_of, written

    def encode(self, drawn: Drawn) -> str:
        text = {NAME: drawn.mark()} if drawn.mark else None
        with whole_file(Path(self._name_of(drawn.number))) as file:
            write_png(file, drawn.pixels, text)
        return self._name_of(drawn.number)

    def put(self, encoded: str) -> None:
        self._written.append(encoded)

    def close(self) -> None:
        pass

    def abandon(self) -> None:
        pass


class OneFile:
    """One file for all frames, which takes its place when it is whole. What differs between formats is in _write()."""

    def __init__(self, path: Path) -> None:
        self._stack = ExitStack()
        self._file = self._stack.enter_context(whole_file(path))

    def encode(self, drawn: Drawn) -> Any:
        raise NotImplementedError

    def _write(self, encoded: Any) -> None:
        raise NotImplementedError

    def _finish(self) -> None:
        """Writes the end."""

    def put(self, encoded: Any) -> None:
        self._write(encoded)

    def close(self) -> None:
        self._finish()
        self._stack.close()

    def abandon(self) -> None:
        with suppress(_AbandonedError):
            self._stack.__exit__(_AbandonedError, _AbandonedError(), None)


class _AbandonedError(Exception):
    """Why a file is not kept."""


class Apng(OneFile):
    """An animated PNG, with all colours; what reads no such file shows the first frame."""

    def __init__(self, path: Path, fps: float) -> None:
        super().__init__(path)
        self._movie = Animation(self._file, fps)
        self._shape: tuple[int, ...] = ()

    def encode(self, drawn: Drawn) -> tuple[NDArray[np.uint8], bytes]:
        return drawn.pixels, stream_of(drawn.pixels)

    def _write(self, encoded: tuple[NDArray[np.uint8], bytes]) -> None:
        if encoded[0].shape != self._shape and self._shape:
            raise ValueError(f"frames: must all have {self._shape[2]} channels, as the background of the first one")
        self._shape = encoded[0].shape
        self._movie.add(*encoded)

    def _finish(self) -> None:
        self._movie.close()


class Gif(OneFile):
    """A GIF, of 256 colours a frame, which are chosen for each, without alpha.

    A frame's time is a whole number of 1/100 s, 2 at least, so that it ends at the one next to when it should.
    """

    def __init__(self, path: Path, fps: float) -> None:
        super().__init__(path)
        self._fps, self._frames, self._end = fps, 0, 0

    def encode(self, drawn: Drawn) -> tuple[bytes, bytes]:
        """The size, and what a frame adds to the file: a GIF that Pillow makes, with its colours as the frame's own."""
        from PIL import Image as Picture

        file = io.BytesIO()
        Picture.fromarray(drawn.pixels[..., :3]).quantize(256).save(file, "GIF")
        data = file.getvalue()
        bits = data[10] & 7
        begin = 13 + 3 * 2 ** (bits + 1)
        colors, at = data[13:begin], begin
        while data[at] == GIF_EXTENSION:  # whose blocks begin with their length, and end with one of 0
            at += 2
            while data[at]:
                at += 1 + data[at]
            at += 1
        place, pixels = data[at : at + 9], data[at + 10 : -1]
        return data[6:10], place + bytes([0x80 | (data[at + 9] & 0x40) | bits]) + colors + pixels

    def _write(self, encoded: tuple[bytes, bytes]) -> None:
        size, frame = encoded
        if not self._frames:
            self._file.write(b"GIF89a" + size + b"\x70\0\0" + GIF_LOOP)
        self._frames += 1
        delay = min(65535, max(2, round(100 * self._frames / self._fps) - self._end))
        self._end += delay
        self._file.write(struct.pack("<BBBBHBB", GIF_EXTENSION, 0xF9, 4, 0, delay, 0, 0) + frame)

    def _finish(self) -> None:
        self._file.write(b";")
