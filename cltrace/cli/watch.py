"""Does the work again whenever a file that it depends on is saved; a fault is told, and the last picture stays."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cltrace.console import tell
from cltrace.errors import CltraceError, DeviceError, MissingPackageError, UsageError

# What a scene may name.
NAMED = (".obj", ".png", ".jpg", ".jpeg")
# Milliseconds after which the files are looked at even if nothing is heard, as on some network drives.
PATIENCE = 1000

Stamp = tuple[int, int, int] | None


def watch(work: Callable[[argparse.Namespace, Callable[[str], None]], int], args: argparse.Namespace, say: Any) -> int:
    """Does the work, and does it again after each change, until it is interrupted. Raises DeviceError as it does.

    work: as cltrace.cli.run has it. Whether a file has changed is told by its time, size and place on the disk since
    before it was read, so none is missed while a picture is drawn.
    """
    try:
        notify = importlib.import_module("watchfiles").watch
    except ImportError:
        raise MissingPackageError("--watch", "watchfiles", "watch") from None
    files, faulty, begun = {Path(args.scene)}, False, False

    def stamps() -> dict[Path, Stamp]:
        """A scene with a fault may lack a file that is beside it later."""
        return {path: _stamp(path) for path in (files | _others(args) if faulty else files)}

    while True:
        before = stamps()
        try:
            work(args, say)
            files, faulty = _watched(args), False
        except CltraceError as error:
            if isinstance(error, DeviceError) or (isinstance(error, UsageError) and not begun):
                raise
            tell(str(error) if type(error).__name__ == "SceneError" else f"cltrace: {error}")
            faulty = True
        begun = True
        now = stamps()
        before = {path: before.get(path, stamp) for path, stamp in now.items()}
        say(f"cltrace: waiting for a change of {args.scene}; Ctrl-C ends it")
        folders = {path.parent for path in now if path.parent.is_dir()}
        for _ in notify(*folders, recursive=False, yield_on_timeout=True, rust_timeout=PATIENCE, debounce=100):
            if stamps() != before:
                break


def _watched(args: argparse.Namespace) -> set[Path]:
    """The files that a picture depends on."""
    own = {Path(args.scene), *args.files}
    return own if args.compare is None else own | {Path(args.compare)}


def _others(args: argparse.Namespace) -> set[Path]:
    """Files beside a scene with a fault, which may be what it lacks; not the picture itself."""
    folder, outputs = Path(args.scene).parent, set(args.output or ())
    try:
        return {path for path in folder.iterdir() if path.suffix.lower() in NAMED and str(path) not in outputs}
    except OSError:
        return set()


def _stamp(path: Path) -> Stamp:
    """What changes with a file, None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
