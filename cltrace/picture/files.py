"""Files that are there completely, or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO


def is_named_as_folder(name: str) -> bool:
    """Whether a name ends as only a folder's does, such as "s.png/" and "s.png/.". Path() drops these ends."""
    return os.path.basename(name) != Path(name).name  # noqa: PTH119


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A binary file that replaces the one of this name when the `with` block has ended well.

    A link is written through. What is not a plain file, such as a pipe or a device, is written into and stays what it
    is. Raises OSError if that fails; a plain file that was there is then untouched.
    """
    with _stream(path) if _is_stream(path) else _replacement(Path(os.path.realpath(path))) as file:
        yield file


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
    """A file beside the target under a name of its own, which takes the target's place at the end."""
    # A name may have 255 bytes, so 64 bytes of the target's name leave room for the rest. A cut letter is dropped.
    name = os.fsencode(target.name)[:64].decode(errors="ignore")
    part = target.with_name(f".{name}-{secrets.token_hex(8)}.part")
    try:
        with part.open("xb") as file:
            yield file
        part.replace(target)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise
