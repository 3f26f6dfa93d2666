"""Follows what was asked for: does that kind of work, and returns its exit status."""

from __future__ import annotations

import logging
import sys
from argparse import Namespace
from functools import partial

from cltrace.cli.options import (
    Compare,
    Doctor,
    Explain,
    ListDevices,
    Lit,
    Movie,
    OneScene,
    Options,
    Picture,
    Tiles,
    View,
    Work,
    options_of,
)
from cltrace.cli.parsing import parser
from cltrace.cli.reporter import Reporter
from cltrace.process.console import command
from cltrace.run.devices import devices, where_drivers_are


def main(argv: list[str] | None = None) -> int:
    """Runs the command. Returns its exit status: 0 ok, 1 check failed, 2 usage or scene, 3 device, 130 Ctrl-C."""
    args, p = Namespace(verbose=False), parser()
    given = sys.argv[1:] if argv is None else argv
    if given[:1] == ["view"] and len(given) > 1:
        given = ["--view", *given[1:]]
    cut = given.index("--") if "--" in given else len(given)

    def run() -> int:
        p.parse_intermixed_args(given[:cut], args)
        args.scenes += given[cut + 1 :]  # which argparse would take for options, here and there
        return _run(options_of(args, p))

    return command("cltrace", run, verbose=lambda: args.verbose)


def _run(options: Options) -> int:
    if options.quiet:
        logging.getLogger("cltrace").setLevel(logging.WARNING)
    work, reporter = options.work, Reporter(options.quiet)
    if not options.watch or not isinstance(work, OneScene) or isinstance(work, View):
        return _do(work, reporter)
    from cltrace.cli.watch import watch

    return watch(work, partial(_do, work, reporter), reporter)


def _do(work: Work, reporter: Reporter) -> int:
    """Does a kind of work, and returns the exit status. Only the modules that it needs are imported."""
    match work:
        case Doctor():
            if work.report is None:
                from cltrace.cli.doctor import doctor

                return doctor(work.device)
            from cltrace.cli.device_report import report

            return report(work.device, work.report)
        case ListDevices():
            return _list_devices()
        case Movie():
            from cltrace.cli.movie import draw_movie

            return draw_movie(work, reporter)
        case Tiles():
            from cltrace.cli.cluster import draw_tiles

            return draw_tiles(work, reporter)
        case Explain():
            from cltrace.cli.questions import explain

            return explain(work, reporter)
        case Compare():
            from cltrace.cli.questions import compare

            return compare(work, reporter)
        case Lit():
            from cltrace.cli.questions import show_lit

            return show_lit(work, reporter)
        case View():
            from cltrace.cli.view import view

            return view(work, reporter)
        case Picture():
            from cltrace.cli.picture import draw

            return draw(work, reporter)


def _list_devices() -> int:
    listing = [d.line() for d in devices()]
    print("\n".join(listing) if listing else f"no OpenCL device found\n{where_drivers_are()}")
    return 0 if listing else 3
