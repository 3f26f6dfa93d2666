"""Does the work again whenever a file that it depends on is saved; a fault is told, and the last picture stays."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from pathlib import Path

from cltrace.base.errors import CltraceError, DeviceError, MissingPackageError, UsageError
from cltrace.cli.options import Compare, OneScene, View
from cltrace.cli.reporter import Reporter
from cltrace.process.console import tell

# Milliseconds after which the files are looked at even if nothing is heard, as on some network drives.
PATIENCE = 1000

Stamp = tuple[int, int, int] | None


def watch(work: OneScene, do: Callable[[], int], reporter: Reporter) -> int:
    """Does the work, and does it again after each change, until it is interrupted. Raises DeviceError as it does.

    do: does the work once.
    """
    begun = False
    for _ in changes(work, reporter):
        try:
            do()
        except CltraceError as error:
            if isinstance(error, DeviceError) or (isinstance(error, UsageError) and not begun):
                raise
            tell(str(error) if type(error).__name__ == "SceneError" else f"cltrace: {error}")
        begun = True
    return 0


def changes(work: OneScene, reporter: Reporter) -> Iterator[None]:
    """Comes back once before the work is done, and then after each change of a file that it depends on, for ever.

    Whether a file has changed is told by its time, size and place on the disk since before it was read, so none is
    missed while a picture is drawn.
    """
    try:
        notify = importlib.import_module("watchfiles").watch
    except ImportError:
        raise MissingPackageError("--watch", "watchfiles", "watch") from None

    def stamps() -> dict[Path, Stamp]:
        return {path: _stamp(path) for path in _own(work) | reporter.files}

    while True:
        before = stamps()
        reporter.files = set()
        yield
        now = stamps()
        before = {path: before.get(path, stamp) for path, stamp in now.items()}
        reporter.say(f"cltrace: waiting for a change of {work.scene.path}; Ctrl-C ends it")
        folders = {path.parent for path in now if path.parent.is_dir()}
        for _ in notify(*folders, recursive=False, yield_on_timeout=True, rust_timeout=PATIENCE, debounce=100):
            if stamps() != before:
                break


def _own(work: OneScene) -> set[Path]:
    """The files that the command line names and the work depends on."""
    compared = {Path(work.compare)} if isinstance(work, (Compare, View)) and work.compare else set()
    return {Path(work.scene.path)} | compared


def _stamp(path: Path) -> Stamp:
    """What changes with a file, None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
