"""What can go wrong for a user, and the exit code each kind has on the command line."""

from __future__ import annotations

from dataclasses import dataclass


def printable(text: str) -> str:
    """The text on one line that a terminal takes for text: control characters and line breaks as escapes."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class CltraceError(Exception):
    """Base of all errors that cltrace raises on purpose; `exit_code` is the command's exit status."""

    exit_code = 2


class UsageError(CltraceError):
    """The command line asks for something that makes no sense."""


@dataclass(frozen=True, order=True)
class Fault:
    """One fault of a scene file: the line it is on (1-based; 0 = the file as a whole) and what is wrong."""

    line: int
    message: str


class SceneError(CltraceError):
    """A scene cannot be used.

    `faults` holds the faults of the file, in line order; equal ones are one, which says how often and where else it is
    there. `str()` is one line for each.
    """

    def __init__(self, path: str, faults: list[Fault]) -> None:
        super().__init__(path, faults)
        self.path = path
        self.faults = sorted(faults)

    def __str__(self) -> str:
        path = printable(self.path)
        return "\n".join(f"{path}:{f.line}: {f.message}" if f.line else f"{path}: {f.message}" for f in self.faults)


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
        return (
            f"camera.max_bounces: must be lower than {self.max_bounces}, with which pixel {self.pixel} takes more than "
            f"{self.rays:,} rays"
        )


class SceneWarning(UserWarning):
    """Something in a scene file is ignored, such as an unknown element."""


class DeviceError(CltraceError):
    """No device, an ambiguous or unsuitable one, or a failure of its driver."""

    exit_code = 3


class BuildError(DeviceError):
    """The kernel does not build on this device; the message holds the options and the compiler's log."""
