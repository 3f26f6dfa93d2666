"""The command `cltrace-bench`: options, progress, tables, files, exit codes."""

from __future__ import annotations

import argparse
import datetime
import importlib.util
import math
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import Any

from cltrace.base.errors import UsageError
from cltrace.cli.arguments import picture_size
from cltrace.formats.xml_reader import read
from cltrace.picture.files import whole_file
from cltrace.plan.abi import Precision
from cltrace.plan.request import PRECISIONS
from cltrace.process.console import Parser, command, positive, tell
from cltrace.renderers.renderer import default_precision
from cltrace.run.devices import Device, choose, devices

from . import report
from .measure import Budget, Row, configurations, measure
from .peers import installed
from .scenes import GIVEN, Case, Size, few, generated, growing
from .tracers import Product, Tracer

SIZE, QUICK_SIZE = (960, 540), (320, 180)
FULL, QUICK = Budget(), Budget(rounds=3, seconds=1, sample=100)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="cltrace-bench",
        description="Measure run time against error: cltrace in each precision with and without what it skips, the "
        "textbook's tracer, and Embree and POV-Ray where they are installed.",
        allow_abbrev=False,
    )
    p.add_argument("scenes", nargs="*", metavar="SCENE.xml", help="scenes to draw (default: a set of its own)")
    p.add_argument("-d", "--device", action="append", metavar="SPEC",
                   help="cpu, gpu, P:D or part of a name; may be repeated (default: the fastest CPU)")  # fmt: skip
    p.add_argument("--precision", action="append", choices=PRECISIONS,
                   help="only this one; may be repeated (default: all that the device has)")  # fmt: skip
    p.add_argument("--size", type=picture_size, metavar="WxH", help=f"picture size (default: {SIZE[0]}x{SIZE[1]})")
    p.add_argument("--rounds", type=positive, metavar="N", help=f"measure each up to N times (default: {FULL.rounds})")
    p.add_argument("-o", "--output", default="bench-results", metavar="FOLDER",
                   help="where results.json, table.md and the plots go (default: %(default)s)")  # fmt: skip
    p.add_argument("--no-plots", action="store_true", help="tables and results.json only; needs no matplotlib")
    p.add_argument("--quick", action="store_true", help="three small scenes, in less than half a minute")
    p.add_argument(
        "--stress", action="store_true", help="the stress catalogue instead: required and found, case by case"
    )
    p.add_argument("-q", "--quiet", action="store_true", help="no progress")
    p.add_argument("--version", action="version", version=f"cltrace-bench {metadata.version('cltrace')}")
    return p


def main(argv: list[str] | None = None) -> int:
    """Runs the command. Returns its exit status: 0 ok, 1 a stress case failed, 2 usage or scene, 3 device."""
    return command(
        "cltrace-bench", lambda: _run(parser().parse_args(argv)), interrupted="interrupted; what was measured is kept"
    )


class Progress:
    """One line on a terminal, written over and over, and how far the whole is; nothing elsewhere."""

    def __init__(self, quiet: bool, steps: int) -> None:
        self._shown = not quiet and sys.stderr.isatty()
        self._steps, self._done, self._start, self._what = steps, 0, time.monotonic(), ""

    def step(self, what: str) -> None:
        """The next step begins."""
        self._done, self._what = self._done + 1, what
        self.say("")

    def say(self, detail: str) -> None:
        if self._shown:
            seconds = int(time.monotonic() - self._start)
            line = f"[{self._done}/{self._steps}, {seconds // 60}:{seconds % 60:02d}] {self._what}  {detail}"
            print(f"\r\x1b[K{line[:110]}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Before something else is printed."""
        if self._shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


@dataclass
class Bench:
    """A whole run: what is measured on what, and what came out of it so far."""

    cases: list[Case]
    growth: list[Case]
    devices: list[Device]
    precisions: list[Precision] | None
    budget: Budget
    quick: bool
    rows: list[Row] = field(default_factory=list)

    def tracers(self, peers: list[Tracer]) -> list[Tracer]:
        """On all devices."""
        own = [t for d in self.devices for t in configurations(d, self.precisions_of(d), self.quick)]
        return [*own, *peers]

    def precisions_of(self, device: Device) -> list[Precision]:
        """The device's default first. UsageError if it has none of those that were asked for."""
        first = default_precision(device)
        others: tuple[Precision, ...] = ("single", "double")
        has = [first, *(p for p in others if p != first and (device.has_double or p == "single"))]
        chosen = [p for p in has if self.precisions is None or p in self.precisions]
        if not chosen:
            raise UsageError(f"{device.name} has no double precision, which --precision {self.precisions[0]} needs")  # type: ignore[index]
        return chosen

    def reference(self) -> Product | None:
        """In double precision, without filters, on the first device that has it, or on any other."""
        able = next((d for d in [*self.devices, *devices()] if d.has_double), None)
        return Product(able, "double", ("filter",)) if able else None

    def run(self, peers: list[Tracer], progress: Progress) -> None:
        """Measures everything. Prints a table as soon as its scene is done."""
        tracers, reference = self.tracers(peers), self.reference()
        for case in self.cases:
            progress.step(f"{case.group}: {case.name}")
            first = len(self.rows)
            measure(case, tracers, reference, self.budget, self.rows, progress.say)
            progress.clear()
            print(report.scene_table(self.rows[first:]), end="\n\n", flush=True)
        budget = replace(self.budget, errors=False)
        if math.isfinite(budget.seconds):  # else so many rounds were asked for
            budget = replace(budget, rounds=3, seconds=3)
        few_tracers = [t for t in tracers if t.grows]
        for case in self.growth:
            progress.step(f"{case.group}: {case.name}")
            measure(case, few_tracers, None, budget, self.rows, progress.say)
        progress.clear()


def _run(args: argparse.Namespace) -> int:
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    if args.stress and (args.scenes or args.size or args.precision or args.rounds):
        raise UsageError("--stress has scenes of its own, and measures no times")
    chosen = list({d.spec: d for d in map(choose, args.device or [None])}.values())
    if args.stress:
        from . import stress

        return stress.run(chosen, args.quick, Progress(args.quiet, len(stress.chosen(args.quick))))
    if not args.no_plots and not importlib.util.find_spec("matplotlib"):
        raise UsageError("the plots need matplotlib: pip install 'cltrace[bench]', or say --no-plots")
    folder = _folder(args.output)

    size = args.size or (QUICK_SIZE if args.quick else SIZE)
    budget = QUICK if args.quick else FULL
    if args.rounds:
        # All of them, whatever they take.
        budget = replace(budget, rounds=args.rounds, seconds=math.inf)
    bench = Bench(
        cases=_given(args.scenes, args.size) if args.scenes else (few if args.quick else generated)(size),
        growth=[] if args.scenes or args.quick else growing(),
        devices=chosen,
        precisions=args.precision,
        budget=budget,
        quick=args.quick,
    )
    bench.tracers([])  # finds what cannot be before the work
    about = report.about([d.name for d in chosen], datetime.datetime.now(datetime.UTC).date().isoformat())
    print(report.machine_line(about))
    for k, device in enumerate(chosen if len(chosen) > 1 else []):
        print(f"[{k}] is {device.label}")
    print(flush=True)
    progress = Progress(args.quiet, len(bench.cases) + len(bench.growth))
    finished = False
    try:
        with tempfile.TemporaryDirectory() as scratch:
            peers, missing = installed(Path(scratch))
            for reason in missing:
                tell(f"cltrace-bench: without {reason}")
            bench.run(peers, progress)
        finished = True
    finally:
        # What was measured is kept, whatever ended it.
        progress.clear()
        if any(row.kernel for row in bench.rows):
            _save(bench, about, folder, not args.no_plots, finished)
    return 0


def _given(paths: Sequence[str], size: Size | None) -> list[Case]:
    """The scenes of these files."""
    cases = []
    for path in paths:
        scene, warnings = read(path)
        for warning in warnings:
            tell(warning)
        if size:
            scene = replace(scene, camera=replace(scene.camera, resolution=size))
        cases.append(Case(Path(path).stem, GIVEN, scene))
    return cases


def _folder(name: str) -> Path:
    """The folder for the files, made if it is not there; UsageError if nothing can be written there."""
    path = Path(name)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            return path
    except (OSError, ValueError) as error:
        raise UsageError(f"-o: {getattr(error, 'strerror', None) or error}: {name!r}") from None


def _save(bench: Bench, about: dict[str, Any], folder: Path, plots: bool, finished: bool) -> None:
    """Writes all files, each of them whole."""
    names = ["results.json", "table.md"]
    with whole_file(folder / names[0]) as file:
        file.write(report.as_json(bench.rows, about, finished).encode())
    with whole_file(folder / names[1]) as file:
        file.write(report.summary(bench.rows, about).encode())
    if plots:
        from . import plots as figures  # matplotlib takes a second to load, and need not be there

        for device in bench.devices:
            suffix = f"-{device.spec.replace(':', '.')}" if len(bench.devices) > 1 else ""
            where = report.machine_line(about | {"devices": [device.name]})
            for name, figure in figures.figures(bench.rows, device.label, where).items():
                for kind in ("svg", "png"):
                    with whole_file(folder / f"{name}{suffix}.{kind}") as file:
                        figure.savefig(file, format=kind)
                names.append(f"{name}{suffix}.svg/.png")
    tell(f"cltrace-bench: wrote {', '.join(names)} in {folder}")
