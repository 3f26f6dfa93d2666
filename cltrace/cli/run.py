"""Follows what was asked for: which of the command's works it is, and its exit status."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable
from pathlib import Path

from cltrace.cli.options import LIT, parser
from cltrace.console import command, tell
from cltrace.errors import UsageError
from cltrace.picture.image import DIRECTED
from cltrace.run.devices import devices, is_all, where_drivers_are

# Options that ask for more than one picture.
MOVIE = ("orbit", "axis", "degrees", "frames", "fps", "skip_existing")


def main(argv: list[str] | None = None) -> int:
    """Runs the command. Returns its exit status: 0 ok, 1 check failed, 2 usage or scene, 3 device, 130 Ctrl-C."""
    args = argparse.Namespace(verbose=False)
    return command("cltrace", lambda: _run(parser().parse_intermixed_args(argv, args)), verbose=lambda: args.verbose)


def _run(args: argparse.Namespace) -> int:
    if args.quiet:
        logging.getLogger("cltrace").setLevel(logging.WARNING)
    args.scene = args.scenes[0] if args.scenes else None
    for option, given in (("--doctor", args.doctor), ("--list-devices", args.list_devices)):
        if given and args.scene is not None:
            raise UsageError(f"{option} takes no scene, got {args.scene!r}")
    if args.doctor:
        from cltrace.doctor import doctor

        return doctor(args.device)
    if args.list_devices:
        return _list_devices(args)
    if args.scene is None:
        raise UsageError("which scene? Say cltrace SCENE.xml; see cltrace --help")
    if "-" in args.scenes and not Path("-").exists():
        raise UsageError("a scene is not read from stdin: say the name of its file")
    say: Callable[[str], None] = (lambda text: None) if args.quiet else tell
    work = _work(args)
    if not args.watch:
        return work(args, say)
    if args.output and "-" in args.output:
        raise UsageError("--watch takes no -o -")
    from cltrace.cli.watch import watch

    return watch(work, args, say)


def _list_devices(args: argparse.Namespace) -> int:
    if args.device is not None:
        raise UsageError("--list-devices lists all devices, so it takes no -d; --doctor -d SPEC tries one")
    listing = [d.line() for d in devices()]
    print("\n".join(listing) if listing else f"no OpenCL device found\n{where_drivers_are()}")
    return 0 if listing else 3


def _work(args: argparse.Namespace) -> Callable[[argparse.Namespace, Callable[[str], None]], int]:
    """What is to be done with a scene: a function of the arguments, and of what says a message, to the exit status."""
    _check_devices(args)
    if len(args.scenes) > 1 or any(getattr(args, name) != parser().get_default(name) for name in MOVIE):
        from cltrace.cli.movie import movie

        if args.watch:
            raise UsageError("--watch is for one picture, of one scene")
        _check_show(args)
        return movie
    if args.tiles is not None and args.cluster is None:
        raise UsageError("--tiles goes with --cluster")
    if args.explain is not None:
        from cltrace.cli.questions import explain

        return explain
    _check_show(args)
    if args.antialias is not None and (args.show != "color" or args.check is not None):
        other = "--check" if args.check is not None else f"--show {args.show}"
        raise UsageError(f"--antialias does not go with {other}, which is about the rays of pixels' middles")
    if args.compare is not None:
        from cltrace.cli.questions import compare

        return compare
    if args.tolerance is not None:
        raise UsageError("--tolerance goes with --compare")
    if args.json:
        raise UsageError("--json goes with --explain and --compare; times and counts are --stats=json")
    if args.cluster is not None:
        from cltrace.cli.cluster import draw_tiles

        return draw_tiles
    if args.show == LIT:
        from cltrace.cli.questions import show_lit

        return show_lit
    from cltrace.cli.picture import draw

    return draw


def _check_devices(args: argparse.Namespace) -> None:
    """Raises UsageError for options that want one device where all are given."""
    one = {
        "--cluster": args.cluster is not None,
        "--compare": args.compare is not None,
        "--repeat": args.repeat != 1,
        f"--show {LIT}": args.show == LIT,
    }
    for option, given in one.items():
        if given and is_all(args.device):
            why = ": a worker has one device" if option == "--cluster" else ", which takes one device"
            raise UsageError(f"-d all does not go with {option}{why}")


def _check_show(args: argparse.Namespace) -> None:
    """Raises UsageError for options that do not go with what is shown."""
    if args.space and args.show not in DIRECTED:
        raise UsageError(f"--space goes with --show {' and --show '.join(DIRECTED)}")
    if args.transparent and args.show != "color":
        raise UsageError("--transparent goes with --show color")
