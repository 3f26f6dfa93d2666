"""The command `cltrace-bench`: options, progress, tables, files, exit codes."""

from __future__ import annotations

import argparse
import importlib.util
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from importlib import metadata
from pathlib import Path

from cltrace.base.errors import UsageError
from cltrace.cli.options import picture_size
from cltrace.formats.reader import read
from cltrace.picture.files import whole_file
from cltrace.plan.abi import COUNTERS
from cltrace.plan.request import PRECISIONS
from cltrace.process.console import Parser, command, positive, tell
from cltrace.renderers.renderer import Renderer, default_precision
from cltrace.run.devices import Device, choose

from . import report
from .measure import LEAST_ROUNDS, Results, Watch, about, load, measure, measure_waits, sentence, truth_of
from .peers import installed
from .scenes import GIVEN, MILLION, ORDINARY, Case, Size, cloud, few, generated, growing
from .tracers import own_tracers

SIZE, QUICK_SIZE, COUNTED_SIZE = (800, 450), (320, 180), (160, 90)
# Counters of which only the sum is the same on all drivers, and arrays whose sizes are entries of lists.
TESTS, LISTS = ("FILTERED", "DECIDED"), ("start", "entry", "node")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="cltrace-bench",
        description="Measure run time against error: cltrace in each precision, and other programs where installed.",
        allow_abbrev=False,
    )
    p.add_argument("scenes", nargs="*", metavar="SCENE.xml", help="scenes to draw (default: a set of its own)")
    p.add_argument("-d", "--device", metavar="SPEC", help="cpu, gpu, P:D or part of a name (default: the fastest CPU)")
    p.add_argument("--precision", action="append", choices=PRECISIONS,
                   help="only this one; may be repeated (default: all that the device has)")  # fmt: skip
    p.add_argument("--size", type=picture_size, metavar="WxH", help=f"picture size (default: {SIZE[0]}x{SIZE[1]})")
    p.add_argument("--rounds", type=positive, metavar="N", help="measure each exactly N times")
    p.add_argument("-o", "--output", default="bench-results", metavar="FOLDER",
                   help="where results.json, table.md and the plots go (default: %(default)s)")  # fmt: skip
    p.add_argument("--no-plots", action="store_true", help="tables and results.json only; needs no matplotlib")
    p.add_argument("--quick", action="store_true", help="three small scenes, in about half a minute")
    p.add_argument("--stages", action="store_true",
                   help="also without each of the stages that skip work: what they save")  # fmt: skip
    p.add_argument("--counted", action="store_true", help="count rays, tests and entries of lists instead of measuring")
    p.add_argument("--from", dest="source", metavar="FILE", help="no run: the results.json of another one, again")
    p.add_argument("--publish", action="store_true", help="in a checkout: also write docs/benchmark.md and its figures")
    p.add_argument("--version", action="version", version=f"cltrace-bench {metadata.version('cltrace')}")
    return p


def main(argv: list[str] | None = None) -> int:
    """Runs the command. Returns its exit status: 0 ok, 2 usage or scene, 3 device."""
    kept = "interrupted; what was measured is kept"
    return command("cltrace-bench", lambda: _run(parser().parse_args(argv)), interrupted=kept)


def _run(args: argparse.Namespace) -> int:
    chosen = args.scenes or args.size or args.precision or args.rounds or args.quick or args.stages
    if chosen and (args.counted or args.source or args.publish):
        raise UsageError("--counted, --from and --publish go with no scenes and no choice of what to measure")
    plots = not (args.no_plots or args.counted)
    if plots and not importlib.util.find_spec("matplotlib"):
        raise UsageError("the plots need matplotlib: pip install 'cltrace[bench]', or say --no-plots")
    results = load(args.source) if args.source else Results({})
    folder = Path(args.output)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        if not args.source:
            _measure(args, results)
    finally:
        if results.points or results.work:
            _save(results, folder, plots)
    if args.publish:
        for path in report.publish(results, counted=not args.source):
            tell(f"cltrace-bench: wrote {path}")
    return 0


def _measure(args: argparse.Namespace, results: Results) -> None:
    """A run, into `results`. Prints a table as soon as its scene is done."""
    device, start, watch = choose(args.device), time.monotonic(), Watch()
    results.about = about(device)
    if args.counted:
        results.work = count(device)
        results.finished = True
        return
    size = args.size or (QUICK_SIZE if args.quick else SIZE)
    cases = _given(args.scenes, args.size) if args.scenes else (few if args.quick else generated)(size)
    growth = [] if args.scenes or args.quick else growing()
    counts = () if args.scenes else (1000,) if args.quick else (1000, 100_000)
    default = default_precision(device)
    precisions = args.precision or [default, *(p for p in ("single", "double") if p != default and device.has_double)]
    tracers = own_tracers(device, precisions, args.quick, args.stages)
    print(sentence(results.about))
    with tempfile.TemporaryDirectory() as folder:
        peers, results.missing = installed(Path(folder))
        print("".join(f"{text}\n" for text in results.missing), flush=True)
        try:
            for number, case in enumerate([*cases, *growth], 1):
                say = partial(show, f"[{number}/{len(cases) + len(growth)}] {case.group}: {case.name}")
                say("what is right")
                every = [tracer for tracer in [*tracers, *peers] if tracer.grows or number <= len(cases)]
                truth = truth_of(case, device) if number <= len(cases) else None
                watch.pause()
                points = measure(case, every, truth, say, args.rounds)
                results.points += points
                show("")
                print(report.scene_table(points), end="\n\n", flush=True)
            for number, balls in enumerate(counts):
                case = Case(f"{balls:,} balls", ORDINARY, cloud(balls, size))
                rounds, anew = 1 if args.quick else LEAST_ROUNDS, number == 0 and not args.quick
                results.waits += measure_waits(case, device, peers, rounds, partial(show, case.name), anew)
            if not args.quick:
                results.work = count(device)
            results.finished = True
        finally:
            show("")
            results.about |= watch.so_far() | {"seconds": time.monotonic() - start}
    if results.waits:
        print(report.aligned(report.waits_table(results.waits)), end="\n\n")
    print(f"It took {results.about['seconds']:.0f} s. {results.loaded}".strip())


def show(title: str, detail: str = "") -> None:
    """One line on a terminal, written over and over; nothing elsewhere."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{title}  {detail}".rstrip()[:120], end="", file=sys.stderr, flush=True)


def count(device: Device) -> dict[str, dict[str, int]]:
    """What a frame of the first scene of each class takes, except for the largest: exact numbers, without a clock.

    They are of packets of one pixel, as GPUs have them, and are the same on all drivers: only which of its tests
    float32 decides depends on how a driver rounds, so these are counted together.
    """
    first = {case.group: case for case in reversed(generated(COUNTED_SIZE)) if case.task == "frame"}
    out = {}
    for group, case in reversed(first.items()):
        if group != MILLION:
            show(f"counting {group}")
            renderer = Renderer(case.scene, device, width=1)
            work, arrays = renderer.work(), renderer.plan.arrays
            tests = sum(work.pop(COUNTERS[name]) for name in TESTS)
            sizes = {f"entries of {name}": arrays[name].size for name in LISTS if name in arrays}
            counts = {"tests of surfaces": tests, **work, **sizes}
            out[f"{group}: {case.name}"] = {name: int(n) for name, n in counts.items() if n}
    return out


def _given(paths: list[str], size: Size | None) -> list[Case]:
    """The scenes of these files."""
    cases = []
    for path in paths:
        scene, warnings = read(path)
        for warning in warnings:
            tell(warning)
        if size:
            scene = scene.seen_by(replace(scene.camera, resolution=size))
        cases.append(Case(Path(path).stem, GIVEN, scene))
    return cases


def _save(results: Results, folder: Path, plots: bool) -> None:
    """Writes all files, each of them whole."""
    files = {"results.json": results.as_json()}
    if results.points:
        files["table.md"] = report.summary(results)
    for name, text in files.items():
        with whole_file(folder / name) as file:
            file.write(text.encode())
    names = list(files)
    if plots and results.points:
        from .plots import save  # matplotlib takes a second to load, and need not be there

        names += save(results, folder)
    tell(f"cltrace-bench: wrote {', '.join(names)} in {folder}")
