"""Where a picture goes: what can be known to fail is found before the work, and then the file is written."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from numpy.typing import ArrayLike

from cltrace.errors import UsageError
from cltrace.picture.files import is_named_as_folder
from cltrace.picture.image import Image, Show
from cltrace.scene import Scene

STDOUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")


def target_of(scene: Scene, args: argparse.Namespace) -> str:
    """Where the picture goes; what can be known to fail is found before the work."""
    target: str = scene.output_file if args.output is None else args.output
    origin = "output_file" if args.output is None else "-o"
    if sys.stdout is None and (target == "-" or args.stats == "json"):
        raise UsageError("stdout is closed")
    if target == "-":
        if args.stats == "json":
            raise UsageError("-o - and --stats=json both want stdout")
        if sys.stdout.isatty():
            raise UsageError("-o - writes a PNG: send stdout to a file or a program")
        return target
    try:
        _check_target(target, origin, args.scene)
    except (OSError, ValueError) as error:  # too long a name, a locked folder, a null byte, a link to itself
        raise UsageError(f"{origin}: {getattr(error, 'strerror', None) or error}: {target!r}") from None
    return target


def _check_target(target: str, origin: str, scene: str) -> None:
    """Raises UsageError, OSError or ValueError if no picture can or should be written to a file of this name."""
    path = Path(target)
    if not target:
        raise UsageError("-o: must not be empty")
    if path.is_dir() or is_named_as_folder(target):
        raise UsageError(f"{origin}: {target!r} is a folder")
    if path.suffix.lower() != ".png":
        advice = "; -o - writes it to stdout" if target in STDOUT else ""
        raise UsageError(f"-o: the picture is a PNG and its name must end in .png, got {target!r}{advice}")
    if not path.parent.is_dir():
        raise UsageError(f"-o: there is no folder {str(path.parent)!r}")
    try:
        existing = path.stat()
    except FileNotFoundError:  # the usual case, or a link that is to be written through
        return
    if os.path.samestat(existing, Path(scene).stat()):
        raise UsageError(f"{origin}: {target!r} is the scene itself, which the picture would replace")


def write(image: Image, target: str, show: Show, axes: ArrayLike | None = None) -> None:
    """Writes a PNG to a file, or to stdout where the target is -. show, axes: see Image.as_rgb8()."""
    try:
        if target == "-":
            image.write_png(sys.stdout.buffer, show, axes)
            sys.stdout.buffer.flush()
        else:
            image.save(target, show, axes)
    except BrokenPipeError:
        raise
    except (OSError, UnicodeError) as error:
        raise UsageError(f"cannot write {target}: {getattr(error, 'strerror', None) or error}") from None
