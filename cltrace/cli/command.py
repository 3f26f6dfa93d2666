"""Follows what was asked for: does that kind of work, and returns its exit status."""

from __future__ import annotations

import importlib
import logging
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from cltrace.base.errors import CltraceError, DeviceError, MissingPackageError, UsageError
from cltrace.cli.files import Reporter
from cltrace.cli.options import Options, options_of
from cltrace.picture.image import LIT
from cltrace.process.console import command, tell
from cltrace.run.devices import devices, where_drivers_are

# Milliseconds after which watched files are looked at even if nothing is heard, as on some network drives.
PATIENCE = 1000


def main(argv: list[str] | None = None) -> int:
    """Runs the command. Returns its exit status: 0 ok, 1 check failed, 2 usage or scene, 3 device, 130 Ctrl-C."""
    options = Options(verbose=False)

    def run() -> int:
        options_of(sys.argv[1:] if argv is None else argv, options)
        if options.quiet:
            logging.getLogger("cltrace").setLevel(logging.WARNING)
        reporter = Reporter(options.quiet)
        if options.watch and not options.view:
            return watch(options, reporter, partial(do, options, reporter))
        return do(options, reporter)

    return command("cltrace", run, verbose=lambda: bool(options.verbose))


def do(options: Options, reporter: Reporter) -> int:
    """Does a kind of work, and returns the exit status. Only the modules that it needs are imported: imports are half
    of a small picture's time."""
    if options.doctor:
        from cltrace.cli.doctor import doctor

        return doctor(options.device)
    if options.list_devices:
        listing = [device.line() for device in devices()]
        print("\n".join(listing) if listing else f"no OpenCL device found\n{where_drivers_are()}")
        return 0 if listing else 3
    if options.view:
        from cltrace.cli.view import view

        return view(options, reporter)
    if options.many:
        from cltrace.cli.many import draw_many

        return draw_many(options, reporter)
    if options.explain or options.compare is not None or options.show == LIT:
        from cltrace.cli import questions

        if options.explain:
            return questions.explain(options, reporter)
        answer = questions.show_lit if options.compare is None else questions.compare
        return answer(options, reporter)
    if options.cluster is not None:
        from cltrace.cli.cluster import draw_tiles

        return draw_tiles(options, options.cluster, reporter)
    from cltrace.cli.picture import draw

    return draw(options, reporter)


def watch(options: Options, reporter: Reporter, work: Callable[[], int]) -> int:
    """Does the work, and does it again after each change, until it is interrupted. A fault is told, and the last
    picture stays. Raises DeviceError as the work does."""
    begun = False
    for _ in changes(options, reporter):
        try:
            work()
        except CltraceError as error:
            if isinstance(error, DeviceError) or (isinstance(error, UsageError) and not begun):
                raise
            tell(str(error) if type(error).__name__ == "SceneError" else f"cltrace: {error}")
        begun = True
    return 0


def changes(options: Options, reporter: Reporter) -> Iterator[None]:
    """Comes back once before the work is done, and then after each change of a file that it depends on, for ever.

    Whether a file has changed is told by its time, size and place on the disk since before it was read, so none is
    missed while a picture is drawn.
    """
    try:
        notify = importlib.import_module("watchfiles").watch
    except ImportError:
        raise MissingPackageError("--watch", "watchfiles", "watch") from None
    named = {Path(options.scenes[0]), *([Path(options.compare)] if options.compare else [])}

    def stamp(path: Path) -> tuple[int, int, int] | None:
        try:
            status = path.stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_size, status.st_ino

    def stamps() -> dict[Path, tuple[int, int, int] | None]:
        return {path: stamp(path) for path in named | reporter.files}

    while True:
        before = stamps()
        reporter.files = set()
        yield
        now = stamps()
        before = {path: before.get(path, found) for path, found in now.items()}
        reporter.say(f"cltrace: waiting for a change of {options.scenes[0]}; Ctrl-C ends it")
        folders = {path.parent for path in now if path.parent.is_dir()}
        for _ in notify(*folders, recursive=False, yield_on_timeout=True, rust_timeout=PATIENCE, debounce=100):
            if stamps() != before:
                break
