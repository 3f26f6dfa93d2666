"""What can go wrong for a user, the exit code each kind has on the command line, and filters of warnings."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cltrace.base.limits import hint


def printable(text: str) -> str:
    """The text on one line that a terminal takes for text: control characters and line breaks as escapes."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def located(path: str, line: int, message: str) -> str:
    """A message with the file and the line, 0 for none, that it is about."""
    return f"{printable(path)}:{line}: {message}" if line else f"{printable(path)}: {message}"


class CltraceError(Exception):
    """Base of all errors that cltrace raises on purpose; `exit_code` is the command's exit status."""

    exit_code = 2


class UsageError(CltraceError):
    """The command line asks for something that makes no sense."""


@dataclass(frozen=True, order=True)
class Fault:
    """One fault of a scene: the line it is on (1-based; 0 = the file as a whole) and what is wrong.

    path: of the file, if that is not the scene's own but one that it names.
    """

    line: int
    message: str
    path: str = ""


class SceneError(CltraceError):
    """A scene cannot be used.

    `faults` holds the faults of the file, in line order, and after them those of each file that it names; equal ones
    are one, which says how often and where else it is there. `str()` is one line for each.
    `files`: what the scene would be made of, its own file and those that it names, as far as is known.
    """

    def __init__(self, path: str, faults: list[Fault], files: tuple[Path, ...] = ()) -> None:
        super().__init__(path, faults, files)
        self.path, self.files = path, files
        self.faults = sorted(faults, key=lambda f: (f.path, f.line, f.message))

    def __str__(self) -> str:
        return "\n".join(located(f.path or self.path, f.line, f.message) for f in self.faults)


class TooManyRaysError(CltraceError):
    """Mirrors and glass make so many rays of one pixel that it is given up.

    `pixel` is one such pixel, as (x, y) from the top left of the whole picture; `rays`: how many are too many;
    `max_bounces`: the camera's.
    """

    def __init__(self, pixel: tuple[int, int], rays: int, max_bounces: int) -> None:
        super().__init__(pixel, rays, max_bounces)
        self.pixel = pixel
        self.rays = rays
        self.max_bounces = max_bounces

    def __str__(self) -> str:
        most = f"{self.max_bounces}, with which pixel {self.pixel} takes more than {self.rays:,} rays{hint('rays')}"
        return f"camera.max_bounces: must be lower than {most}"


class TooSlowError(CltraceError):
    """A picture, or what is made before it, takes longer than the limit of seconds, and is given up.

    `seconds`: that limit, for so large a picture or such files; `advice`: which numbers could be lower; `work`: what
    takes so long.
    """

    def __init__(self, seconds: float, advice: str, work: str = "drawing") -> None:
        super().__init__(seconds, advice, work)
        self.seconds = seconds
        self.advice = advice
        self.work = work

    def __str__(self) -> str:
        return f"{self.work} takes longer than {self.seconds:.0f} s; lower {self.advice}{hint('seconds')}"


class SceneWarning(UserWarning):
    """Something in a scene file is ignored, such as an unknown element."""


class DeviceError(CltraceError):
    """No device, an ambiguous or unsuitable one, or a failure of its driver."""

    exit_code = 3


class OutOfMemoryError(DeviceError):
    """A device has not enough memory."""


class BuildError(DeviceError):
    """The kernel does not build on this device; the message holds the options and the compiler's log."""


class MissingPackageError(CltraceError, ImportError):
    """Something needs a package that is not installed. The message says which extra of cltrace brings it."""

    def __init__(self, what: str, package: str, extra: str) -> None:
        super().__init__(what, package, extra)

    def __str__(self) -> str:
        what, package, extra = self.args
        return f"{what} needs the package {package}, which is not installed: pip install 'cltrace[{extra}]'"


_filters_lock = threading.RLock()  # Python's filters are those of all threads


@contextmanager
def warnings_are(action: Literal["error", "ignore"], kind: type[Warning] = Warning) -> Iterator[None]:
    """Makes warnings errors, or ignores them, in a `with` block. Other threads wait for it at theirs.

    If the blocks of two threads overlapped, the one that ends last would leave the filters of the other one for ever.
    """
    with _filters_lock, warnings.catch_warnings():
        warnings.simplefilter(action, kind)
        yield
