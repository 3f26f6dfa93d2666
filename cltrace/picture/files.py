"""Files that are there completely, or not at all."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import platform
import re
import secrets
import stat
import sys
import time
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from cltrace.base.errors import UsageError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

# On some shares a lock holds on one host only, so the name of a file that is being written says which host that is.
HOST = f"{zlib.crc32(platform.node().encode()):08x}"
PART = re.compile(r"\..*-([0-9a-f]{8})-[0-9a-f]{16}\.part", re.DOTALL)
# Seconds for which nothing is written to another host's file that is taken for left behind.
OLD = 86400


def is_named_as_folder(name: str) -> bool:
    """Whether a name ends as only a folder's does, such as "s.png/" and "s.png/.". Path() drops these ends."""
    return os.path.basename(name) != Path(name).name  # noqa: PTH119


class Inputs:
    """Files that pictures are made from, which none may replace, by whatever name. Threads may add some meanwhile."""

    def __init__(self, files: Iterable[Path] = ()) -> None:
        self._places: dict[tuple[int, int], Path] = {}  # by disk and file number
        self.add(files)

    def add(self, files: Iterable[Path]) -> None:
        """More of them."""
        for path in files:
            with contextlib.suppress(OSError):
                found = path.stat()
                self._places[found.st_dev, found.st_ino] = path

    def check(self, target: str, origin: str) -> None:
        """Raises UsageError if a picture of this name would replace one of them, and OSError if the name is odd.

        origin: whose word the name is. An input that is not there any more is none.
        """
        try:
            found = Path(target).stat()
            other = self._places.get((found.st_dev, found.st_ino))
            if other and os.path.samestat(found, other.stat()):
                what = f"{str(other)!r}, which the picture is made from and would replace"
                raise UsageError(f"{origin}: {target!r} is {what}")
        except FileNotFoundError:  # the usual case, or a link that is to be written through
            return


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A binary file that replaces the one of this name when the `with` block has ended well.

    A link is written through. What is not a plain file, such as a pipe or a device, is written into and stays what it
    is. Raises OSError, with the name, if that fails; a plain file that was there is then untouched.
    """
    try:
        with _stream(path) if _is_stream(path) else _replacement(Path(os.path.realpath(path))) as file:
            yield file
    except OSError as error:
        if error.filename is None or PART.fullmatch(Path(error.filename).name):
            error.filename = str(path)
        raise


def _is_stream(path: Path) -> bool:
    """Whether something is there that a file cannot replace. Raises OSError for a folder and for links in a circle."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    return not stat.S_ISREG(mode)


def _stream(path: Path) -> BinaryIO:
    # Neither O_CREAT nor O_TRUNC: if it has gone in the meantime, no file takes its place.
    return os.fdopen(os.open(path, os.O_WRONLY | getattr(os, "O_NOCTTY", 0)), "wb")


@contextlib.contextmanager
def _replacement(target: Path) -> Iterator[BinaryIO]:
    """A file beside the target under a name of its own, which takes the target's place at the end.

    It holds a lock, which dies with its process. So what a kill has left is known, and removed.
    """
    _remove_left(target.parent)
    part, file = _new_part(target)
    try:
        # The lock is that of both files. Where there are none, an open file cannot be renamed.
        held = os.dup(file.fileno()) if fcntl else -1
        try:
            with file:
                yield file
            part.replace(target)
        finally:
            if fcntl:
                os.close(held)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise


def _new_part(target: Path) -> tuple[Path, BinaryIO]:
    """A new file beside the target, its name first, locked where the file system has locks."""
    # A name may have 255 bytes, so 64 bytes of the target's name leave room for the rest. A cut letter is dropped.
    name = os.fsencode(target.name)[:64].decode(sys.getfilesystemencoding(), "ignore")
    while True:
        part = target.with_name(f".{name}-{HOST}-{secrets.token_hex(8)}.part")
        file = part.open("xb")
        with contextlib.suppress(OSError):
            _lock(file)
        if os.fstat(file.fileno()).st_nlink:  # else another process has removed it before it was locked
            return part, file
        file.close()


@functools.cache
def _remove_left(folder: Path) -> None:
    """Removes files of processes that have died from a folder. Once in a process, as a folder may have many files."""
    for part in folder.glob(".*.part") if fcntl else ():
        # What cannot be locked is in use, or the file system has no locks.
        with contextlib.suppress(OSError):
            name = PART.fullmatch(part.name)
            if name and (name[1] == HOST or part.stat().st_mtime < time.time() - OLD):
                with part.open("rb") as file:
                    _lock(file, fcntl.LOCK_NB)
                    part.unlink()


def _lock(file: BinaryIO, how: int = 0) -> None:
    if fcntl:
        fcntl.flock(file, fcntl.LOCK_EX | how)
