"""The files of a scene as chunks of bytes. They may come from a stranger."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cltrace.base import limits


class UnreadableError(Exception):
    """What is wrong with a file before any of its contents, in words that belong behind its name."""


def chunks(path: str, size: int, name: str) -> Iterator[bytes]:
    """The bytes of a regular file, `size` at once; raises UnreadableError, also beyond the limit of this name."""
    most = limits.current(name)
    check_regular(path)
    with _words_for_errors(), Path(path).open("rb") as file:
        read = 0
        while chunk := file.read(size):
            read += len(chunk)
            if read > most:
                raise UnreadableError(f"must not be larger than {most} bytes{limits.hint(name)}")
            yield chunk


def check_regular(path: str) -> None:
    """Raises UnreadableError where a file is missing or none that has contents of its own."""
    with _words_for_errors():
        mode = os.stat(path).st_mode  # noqa: PTH116 - a Path drops a slash at the end, which only a folder may have
    if not stat.S_ISREG(mode):
        raise UnreadableError("is a directory" if stat.S_ISDIR(mode) else "is not a regular file")


def size_of(path: Path) -> int:
    """How many bytes a file has, 0 where it cannot be read: what then reads it says why."""
    try:
        return path.stat().st_size
    except (OSError, ValueError):
        return 0


def within(folder: str, name: str) -> str:
    """The real path of a file in a folder; raises UnreadableError where a symbolic link leads out of the folder."""
    with _words_for_errors():
        inside = os.path.realpath(folder)
        path = os.path.realpath(f"{inside}/{name}")
    if not Path(path).is_relative_to(inside):
        raise UnreadableError("must stay within the scene's folder")
    return path


@contextmanager
def _words_for_errors() -> Iterator[None]:
    """Raises UnreadableError in place of what the system raises."""
    try:
        yield
    except OSError as error:
        raise UnreadableError(f"cannot be read: {error.strerror}") from None
    except UnicodeEncodeError:
        raise UnreadableError(f"cannot be read: the name is not {sys.getfilesystemencoding()}") from None
    except ValueError:
        raise UnreadableError("cannot be read: the name contains a NUL") from None
