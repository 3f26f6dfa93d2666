"""The command `cltrace-bench`: options, progress, tables, files, exit codes."""

from __future__ import annotations

import argparse
import importlib.util
import math
import re
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import metadata
from pathlib import Path

from cltrace.base.errors import UsageError
from cltrace.cli.options import picture_size
from cltrace.formats.reader import read
from cltrace.picture.files import whole_file
from cltrace.plan.abi import Precision
from cltrace.plan.request import PRECISIONS
from cltrace.process.console import Parser, command, positive, tell
from cltrace.renderers.renderer import default_precision
from cltrace.run.devices import Device, choose, devices

from . import against, counted, machine, points, ready, report, ways
from .measure import Budget, measure
from .peers import installed
from .points import Results
from .ready import Found
from .scenes import GIVEN, ORDINARY, Case, Size, cloud, few, generated, growing
from .tracers import Tracer

SIZE, QUICK_SIZE = (800, 450), (320, 180)
FULL, QUICK = Budget(), Budget(rounds=7, seconds=0.2)
# So many pixels of a case are checked exactly.
CHECKED = 100


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = Parser(
        prog="cltrace-bench",
        description="Measure run time against error: cltrace in each precision with and without what it skips, the "
        "textbook's tracer, and other programs where they are installed.",
        allow_abbrev=False,
    )
    p.add_argument("scenes", nargs="*", metavar="SCENE.xml", help="scenes to draw (default: a set of its own)")
    p.add_argument("-d", "--device", action="append", metavar="SPEC",
                   help="cpu, gpu, P:D or part of a name; may be repeated (default: the fastest CPU)")  # fmt: skip
    p.add_argument("--precision", action="append", choices=PRECISIONS,
                   help="only this one; may be repeated (default: all that the device has)")  # fmt: skip
    p.add_argument("--size", type=picture_size, metavar="WxH", help=f"picture size (default: {SIZE[0]}x{SIZE[1]})")
    p.add_argument("--rounds", type=positive, metavar="N",
                   help=f"measure each N times (default: up to {FULL.rounds}, until they agree)")  # fmt: skip
    p.add_argument("-o", "--output", default="bench-results", metavar="FOLDER",
                   help="where results.json, table.md and the plots go (default: %(default)s)")  # fmt: skip
    p.add_argument("--no-plots", action="store_true", help="tables and results.json only; needs no matplotlib")
    p.add_argument("--quick", action="store_true", help="three small scenes, in less than half a minute")
    p.add_argument(
        "--counted", action="store_true", help="count rays and tests instead of measuring: no clock, no errors"
    )
    p.add_argument("--from", dest="source", metavar="FILE", help="no run: the results.json of another one, again")
    p.add_argument("--against", metavar="FILE",
                   help="also say what is slower, less right or more work than in that results.json")  # fmt: skip
    p.add_argument("--tolerance", type=positive, default=10, metavar="PERCENT",
                   help="by how much times and errors may grow (default: %(default)s); counts may not")  # fmt: skip
    p.add_argument(
        "--publish", action="store_true", help="in a checkout: also write docs/benchmark.md, and its figures"
    )
    p.add_argument("-q", "--quiet", action="store_true", help="no progress")
    p.add_argument("--version", action="version", version=f"cltrace-bench {metadata.version('cltrace')}")
    return p


def main(argv: list[str] | None = None) -> int:
    """Runs the command. Returns its exit status: 0 ok, 1 worse than before, 2 usage or scene,
    3 device."""
    return command(
        "cltrace-bench", lambda: _run(parser().parse_args(argv)), interrupted="interrupted; what was measured is kept"
    )


class Progress:
    """One line on a terminal, written over and over, and how far the whole is; nothing elsewhere.

    spent: seconds, by the kind of step and who is at work.
    """

    def __init__(self, quiet: bool, steps: int) -> None:
        self._shown = not quiet and sys.stderr.isatty()
        self._steps, self._done, self._what = steps, 0, ""
        self._start = self._since = time.monotonic()
        self._at = "", ""
        self.spent: dict[str, dict[str, float]] = {}

    def step(self, what: str) -> None:
        """The next step begins."""
        self._done, self._what = self._done + 1, what
        self.say("")

    def say(self, detail: str) -> None:
        now, (step, who) = time.monotonic(), self._at
        mine = self.spent.setdefault(step, {})
        mine[who] = round(mine.get(who, 0) + now - self._since, 3)
        self._since, self._at = now, (self._what.partition(":")[0], re.split("[:,]", detail)[0])
        if self._shown:
            seconds = int(now - self._start)
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
    waited: list[Case]
    devices: list[Device]
    precisions: list[Precision] | None
    budget: Budget
    quick: bool
    results: Results

    def ours(self) -> ready.Ours:
        """Our tracers on all devices; the reference is on the first that has double precision, or on any other."""
        able = next((d.spec for d in [*self.devices, *devices()] if d.has_double), None)
        return ready.Ours(tuple((d.spec, tuple(self.precisions_of(d))) for d in self.devices), able, self.quick)

    def precisions_of(self, device: Device) -> list[Precision]:
        """The device's default first. UsageError if it has none of those that were asked for."""
        first = default_precision(device)
        others: tuple[Precision, ...] = ("single", "double")
        has = [first, *(p for p in others if p != first and (device.has_double or p == "single"))]
        chosen = [p for p in has if self.precisions is None or p in self.precisions]
        if not chosen:
            raise UsageError(f"{device.name} has no double precision, which --precision {self.precisions[0]} needs")  # type: ignore[index]
        return chosen

    def known(self, ours: ready.Ours, progress: Progress) -> list[ready.Known]:
        """What is known of each case. The last ones are begun first: they take longest."""
        jobs = [partial(ready.known, case, ours, CHECKED) for case in reversed(self.cases)]
        return _at_once(jobs, "compiled and checked", progress)[::-1]

    def run(self, peers: Sequence[Tracer], progress: Progress, watch: machine.Watch) -> None:
        """Measures everything. Prints a table as soon as its scene is done."""
        progress.step("made ready")
        ours, out = self.ours(), self.results
        tracers = [*ours.tracers(), *peers]
        for case, known in zip(self.cases, self.known(ours, progress), strict=True):
            progress.step(f"{case.group}: {case.name}")
            first = len(out.points)
            measure(case, tracers, known, self.budget, out.points, progress.say, watch)
            progress.clear()
            print(report.scene_table(out.points[first:]), end="\n\n", flush=True)
        few_tracers = [t for t in tracers if t.grows]
        for case in self.growth:
            progress.step(f"{case.group}: {case.name}")
            measure(case, few_tracers, None, self.budget, out.points, progress.say, watch)
        rounds = 1 if self.quick else points.LEAST_ROUNDS
        for k, case in enumerate(self.waited):
            progress.step(f"whole ways: {case.name}")
            new = k == 0 and not self.quick  # what is compiled is the same for all
            with watch.timing():
                ways.measure(case, self.devices[0], peers, rounds, out.ways, progress.say, new=new)
        progress.clear()
        if out.ways:
            print(report.ways_table(out.ways), end="\n\n", flush=True)
        if not self.quick:
            out.work = _counted(self.devices[0], progress)
        out.finished = True


def _at_once(jobs: Sequence[Callable[[], Found]], done: str, progress: Progress) -> list[Found]:
    """What these return, in their order. done: what each of them, of a scene, has then been."""
    found: list[Found] = []
    progress.say(done)
    for of in ready.at_once(jobs):
        found.append(of)
        progress.say(f"{done}: {len(found)} of {len(jobs)} scenes")
    return found


def _counted(device: Device, progress: Progress) -> points.Work:
    progress.step("counting")
    found = _at_once(counted.jobs(device.spec), "counted", progress)
    progress.clear()
    return {scene: counts for of in found for scene, counts in of.items()}


def _run(args: argparse.Namespace) -> int:
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    _refuse(args)
    plots = not (args.no_plots or args.counted)
    if plots and not importlib.util.find_spec("matplotlib"):
        raise UsageError("the plots need matplotlib: pip install 'cltrace[bench]', or say --no-plots")
    old = points.load(args.against) if args.against else None
    if args.source:
        results = points.load(args.source)
    folder = _folder(args.output)
    if not args.source:
        results = _measured(args, folder, plots)
    _save(results, folder, plots)
    if args.publish:
        from . import publish

        for path in publish.publish(results, plots):
            tell(f"cltrace-bench: wrote {path}")
    if not old:
        return 0
    found = against.changes(old, results, args.tolerance / 100)
    print(against.told(found, old, results))
    return int(any(kind in against.WORSE for kind, _ in found))


def _refuse(args: argparse.Namespace) -> None:
    """UsageError for options that do not go together."""
    chosen = args.scenes or args.size or args.precision or args.rounds
    if args.counted and (chosen or args.quick):
        raise UsageError("--counted has scenes of its own, in one size and one precision")
    if args.source and (chosen or args.quick or args.counted or args.device):
        raise UsageError("--from measures nothing, so it has no scenes, sizes or devices")
    if args.publish and (chosen or args.quick or args.no_plots):
        raise UsageError("--publish wants all that the page shows")


def _devices(args: argparse.Namespace) -> list[Device]:
    return list({d.spec: d for d in map(choose, args.device or [None])}.values())


def _measured(args: argparse.Namespace, folder: Path, plots: bool) -> Results:
    """A run. What there is of it is saved if it is interrupted."""
    chosen = _devices(args)
    results, watch = Results(machine.about([d.label for d in chosen])), machine.Watch()
    if args.counted:
        results.work = _counted(chosen[0], Progress(args.quiet, 1))
        results.finished = True
        return results
    bench = _bench(args, chosen, results)
    bench.ours()  # finds what cannot be before the work
    print(machine.sentence(results.about))
    for k, device in enumerate(chosen if len(chosen) > 1 else []):
        print(f"[{k}] is {device.label}")
    progress = Progress(args.quiet, len(bench.cases) + len(bench.growth) + len(bench.waited) + 3 - args.quick)
    progress.step("peers")
    with tempfile.TemporaryDirectory() as name:
        peers, results.missing = installed(Path(name))
        progress.clear()
        print("".join(f"{text}\n" for text in results.missing), flush=True)
        try:
            bench.run(peers, progress, watch)
        except BaseException:
            results.about |= watch.so_far() | {"seconds": progress.spent}
            progress.clear()
            if results.points:
                _save(results, folder, plots)
            raise
    results.about |= watch.so_far() | {"seconds": progress.spent}
    said = machine.sentence(results.about), report.took(progress.spent), results.loaded
    print("\n".join(text for text in said if text))
    return results


def _bench(args: argparse.Namespace, chosen: list[Device], results: Results) -> Bench:
    """What the options ask for."""
    size = args.size or (QUICK_SIZE if args.quick else SIZE)
    budget = QUICK if args.quick else FULL
    if args.rounds:
        # All of them, whatever they take.
        budget = replace(budget, rounds=args.rounds, seconds=math.inf)
    counts = () if args.scenes else (1000,) if args.quick else (1000, 100_000)
    return Bench(
        cases=_given(args.scenes, args.size) if args.scenes else (few if args.quick else generated)(size),
        growth=[] if args.scenes or args.quick else growing(),
        waited=[Case(f"{n:,} balls", ORDINARY, cloud(n, size)) for n in counts],
        devices=chosen,
        precisions=args.precision,
        budget=budget,
        quick=args.quick,
        results=results,
    )


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
        from . import plots as figures  # matplotlib takes a second to load, and need not be there

        labels = list(dict.fromkeys(point.device for point in results.points if point.device))
        for label in labels:
            suffix = f"-{label.split()[0].replace(':', '.')}" if len(labels) > 1 else ""
            for scheme in figures.SCHEMES:
                for name, figure in figures.figures(results, label, scheme).items():
                    names.append(f"{name}{suffix}{scheme}.png")
                    with whole_file(folder / names[-1]) as file:
                        figure.savefig(file, format="png")
    tell(f"cltrace-bench: wrote {', '.join(names)} in {folder}")
