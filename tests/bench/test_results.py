"""What the benchmark measures is told as it is: in results.json, tables, plots, comparisons and on the page."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
from PIL import Image

from cltrace import Scene
from cltrace.base.errors import DeviceError, UsageError
from cltrace.bench import (
    against,
    cli,
    counted,
    front,
    machine,
    measure,
    points,
    publish,
    ready,
    report,
    scenes,
    tracers,
    ways,
)
from cltrace.bench.errors import Errors
from cltrace.bench.points import Point, Results, Spread, Way
from cltrace.bench.truth import Truth
from cltrace.run.devices import Device

ROOT = Path(__file__).parents[2]
SMALL = (48, 27)
ABOUT = {"date": "2000-01-01 00:00", "cltrace": "0.1.0", "commit": "abc", "cpu": "a CPU", "cores": 2, "devices": ["d"]}
RIGHT = Errors(100, 0, 0, 0, 0.5, 1e-8, 50, 0, 0, 1e-7, 1e-8, 0, 0, 0)
STEADY = (0.002, 0.00201, 0.00202)


def point(tracer: str = "accurate", kernel: tuple[float, ...] = STEADY, **more: object) -> Point:
    given = {"group": "ordinary", "scene": "16 balls", "spheres": 16, "triangles": 0, "cylinders": 0, "size": SMALL}
    return Point(**{**given, "tracer": tracer, "device": "d", "kernel": kernel, "differ": 1e-5, **more})  # type: ignore[arg-type]


def some() -> Results:
    """Results with everything in it."""
    odd = replace(RIGHT, t_ulp=math.inf, color_max=math.nan, wrong_ids=3)
    rows = [
        point(picture=odd, sample=RIGHT, whole=(0.01, 0.02), truth="t"),
        point("Embree", version="3", level=2.0, rms=0.5, refused=("mirrors", "glass")),
    ]
    way = Way("16 balls", 16, SMALL, "cltrace", ways.AGAIN, "", (0.5, 0.51, 0.52), 10**8, None)
    return Results(dict(ABOUT), rows, [way], {"a scene": {"rays": 5}}, ["none: it is missing"], True)


# ------------------------------------------------------------------------------------------------------------ the data


def test_rounds_agree_or_not() -> None:
    assert Spread.of([1.0, 1.05, 1.1]) == Spread(1.025, 1.05, 1.1 - 0.025, 3)
    assert Spread.of([1.0, 1.05, 1.1]).steady
    assert not Spread.of([1.0, 1.0, 1.3, 1.3]).steady
    assert not Spread.of([1.0, 1.0]).steady  # too few to know
    assert math.isnan(Spread.of([]).median)


def test_results_are_read_as_they_were(tmp_path: Path) -> None:
    made = some()
    (tmp_path / "r.json").write_text(made.as_json())
    found = points.load(tmp_path / "r.json")
    assert math.isnan(found.points[0].picture.color_max)  # type: ignore[union-attr]
    found.points[0] = replace(found.points[0], picture=made.points[0].picture)  # NaN is not itself
    assert found == made
    assert json.loads(made.as_json())["points"][0]["picture"]["t_ulp"] == "inf"


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"about": 1}', some().as_json().replace('"tracer"', '"racer"')])
def test_what_is_no_results_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "r.json").write_text(text)
    with pytest.raises(UsageError, match=r"r\.json: these are no results of cltrace-bench: "):
        points.load(tmp_path / "r.json")


def test_the_larger_error_counts() -> None:
    found = point(picture=RIGHT, sample=replace(RIGHT, t_ulp=7.0, wrong_ids=9)).errors
    assert found == replace(RIGHT, t_ulp=7.0)


# --------------------------------------------------------------------------------------------------------- measurement


class Fake(tracers.Tracer):
    """Takes the seconds that it is told to, for each run, and a second for the first frame of the first one."""

    name = "fake"

    def __init__(self, seconds: list[float], costs: float = 0.0) -> None:
        self.left, self.costs, self.frames = seconds, costs, list[int]()

    def run(self, scene: Scene, frames: int) -> tracers.Run:
        first = [] if self.frames else [1.0]
        self.frames.append(frames)
        CLOCK[0] += self.costs
        kernel = [*first, *[self.left.pop(0)] * (frames - len(first))]
        return tracers.Run(kernel, 1.0, np.zeros((27, 48, 3), np.uint8))


CLOCK = [0.0]


def measured(
    every: list[tracers.Tracer], budget: measure.Budget, monkeypatch: pytest.MonkeyPatch | None = None
) -> list[Point]:
    """Points of a small scene; with a patch, by the clock of the Fakes."""
    if monkeypatch:
        monkeypatch.setattr(measure.time, "perf_counter", lambda: CLOCK[0])
    case = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(2, SMALL))
    rows: list[Point] = []
    measure.measure(case, every, None, budget, rows, lambda text: None, machine.Watch())
    return rows


def test_a_tracer_is_measured_until_its_rounds_agree() -> None:
    """Or until there are as many as there may be. An early agreement of three is not believed."""
    steady, restless = Fake([9.0, *[1.0] * 20]), Fake([9.0, *[1.0, 2.0, 2.5] * 9])
    late, slow = Fake([9.0, 1.0, 2.0, 2.5, *[1.0] * 20]), Fake([measure.TOO_LONG + 1.0] * 2)
    rows = measured([steady, restless, late, slow], measure.Budget(rounds=15, seconds=1e9))
    assert [len(row.kernel) for row in rows] == [7, 15, 9, 1]
    assert [row.time.steady for row in rows] == [True, False, True, False]
    assert rows[3].note == "4 s a picture: no further round"
    every = measured([Fake([9.0, *[1.0] * 20])], measure.Budget(rounds=20, seconds=math.inf))
    assert len(every[0].kernel) == 20


def test_each_tracer_has_its_own_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is dear takes no round from what is cheap, and has the least that says something."""
    dear, middle, cheap = (Fake([0.1] + [1.0, 2.0] * 9, costs) for costs in (5.0, 0.19, 1e-3))
    rows = measured([dear, middle, cheap], measure.Budget(rounds=15, seconds=0.8), monkeypatch)
    assert [len(row.kernel) for row in rows] == [points.LEAST_ROUNDS, 5, 15]


def test_short_frames_are_repeated() -> None:
    """As the second frame says, which compiles nothing; what begins with nothing each time is timed at once."""
    short, long, tiny = Fake([0.004] * 30), Fake([0.2] * 30), Fake([1e-6] * 30)
    afresh = Fake([0.2] * 30)
    afresh.afresh = True
    rows = measured([short, long, tiny, afresh], measure.Budget())
    assert [set(fake.frames[1:]) for fake in (short, long, tiny)] == [{10}, {1}, {measure.MOST_FRAMES}]
    assert len(afresh.frames) == len(rows[3].kernel) == len(long.frames) - 1 == 7


@pytest.mark.stress
@pytest.mark.parametrize("long", [False, True])
def test_measuring(any_device: Device, long: bool) -> None:
    """Every tracer has a point with times and errors; what has no reference has those of the sample."""
    case = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(16, SMALL))
    rows: list[Point] = []
    every = tracers.configurations(any_device, ("accurate", "single", "double"), quick=not long)
    known = ready.judged(case, every, tracers.Product(any_device, "double"), 60)
    budget = measure.Budget(rounds=2, seconds=math.inf)
    measure.measure(case, every, known, budget, rows, lambda text: None, machine.Watch())
    assert [row.tracer for row in rows] == [t.name for t in every if t.draws(case)]
    for row in rows:
        assert not row.note
        assert len(row.whole) == len(row.kernel) == 2
        assert row.way.high >= row.time.low > 0
        assert row.sample is not None
        assert row.sample.pixels == 60
        assert (row.picture is None) == (row.tracer == "double")
        assert row.truth
        if row.tracer in ("accurate", "double"):
            assert row.sample.wrong_ids == row.sample.leaks == row.sample.false_shadows == 0
            assert row.errors is not None
            assert row.errors.t_ulp <= 0.52
            assert 0 < row.errors.normal <= 1e-7
    textbook = rows[-1].errors
    assert textbook is not None
    assert textbook.t_ulp > 10  # float32 is seen to be float32


@pytest.mark.slow
def test_what_is_made_ready_comes_back_in_order() -> None:
    """From processes that are not ours; what one of them raises is raised."""
    assert list(ready.at_once([partial(math.sqrt, k * k) for k in range(5)])) == [0, 1, 2, 3, 4]
    assert os.getpid() not in set(ready.at_once([os.getpid] * 3))
    with pytest.raises(ValueError, match="math domain error"):
        list(ready.at_once([partial(math.sqrt, -1)]))


def test_what_takes_too_long_to_be_made_ready_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ready, "LONGEST", 0.5)
    with pytest.raises(DeviceError, match=r"^making a scene ready has taken more than 0.5 s$"):
        list(ready.at_once([partial(time.sleep, 100)]))
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize(("jobs", "have", "want"), [(20, 64, 8), (20, 2, 2), (3, 64, 3)])
def test_few_are_made_ready_at_once(monkeypatch: pytest.MonkeyPatch, jobs: int, have: int, want: int) -> None:
    context = MagicMock()
    monkeypatch.setattr(ready.multiprocessing, "get_context", lambda kind: context)
    monkeypatch.setattr(ready, "processors", lambda: have)
    list(ready.at_once([os.getpid] * jobs))
    assert context.Pool.call_args.args[0] == want


@pytest.mark.slow
def test_errors_of_what_moves_are_known(any_device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of cameras and of positions, whose scenes are the same ones."""
    monkeypatch.setattr(cli, "_counted", lambda device, progress: {})
    monkeypatch.setattr(ready, "at_once", lambda jobs: (job() for job in jobs))
    cases = [
        scenes.Case("1,000 balls", group, make(SMALL)["1,000 balls"], task)
        for group, (task, make) in scenes.CLASSES.items()
        if group.startswith("moving")
    ]
    made = Results(dict(ABOUT))
    bench = cli.Bench(cases, [], [], [any_device], ["accurate"], measure.Budget(rounds=1), False, made)
    bench.run([], cli.Progress(True, 3), machine.Watch())
    assert [row.group for row in made.points] == ["moving cameras", "moving positions"]
    for row in made.points:
        assert row.errors
        assert (row.errors.wrong_ids, row.errors.false_shadows, row.errors.leaks) == (0, 0, 0)


def test_an_interruption_ends_what_is_made_ready() -> None:
    start = time.monotonic()
    threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        list(ready.at_once([partial(time.sleep, 100)]))
    assert time.monotonic() - start < 50
    assert multiprocessing.active_children() == []


def test_errors_are_those_of_the_same_picture() -> None:
    """What is known of a mode counts only for the very bytes that it was found out of."""
    picture = np.zeros((27, 48, 3), np.uint8)
    verdict = ready.Verdict(ready.digest(picture), RIGHT, replace(RIGHT, t_ulp=7.0))
    fake = Fake([1.0] * 9)
    truth = Truth(picture.copy(), "what is true")
    truth.levels[3, 5] = 255
    known = ready.Known(truth, {fake.mode: verdict})
    case = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(2, SMALL))
    for other in (False, True):
        rows: list[Point] = []
        if other:
            known = replace(known, verdicts={fake.mode: replace(verdict, digest="of another")})
        budget = measure.Budget(rounds=1, seconds=math.inf)
        measure.measure(case, [fake], known, budget, rows, lambda text: None, machine.Watch())
        assert rows[0].truth == "what is true"
        assert rows[0].differ == 1 / (27 * 48)
        assert rows[0].rms == pytest.approx(255 / math.sqrt(27 * 48))
        assert (rows[0].errors is None) == other
        assert rows[0].note == other * "another picture than with all outputs: its errors are not known"


def test_a_process_is_measured() -> None:
    """Its memory and what it reads are its own, not those of who starts it."""
    held = bytes(300 << 20)
    found = ways.process([sys.executable, "-c", "import time; a = b'x' * (64 << 20); time.sleep(0.2)"])
    assert found.seconds >= 0.2
    assert 64 << 20 <= found.memory < len(held)
    if sys.platform == "linux":
        assert found.read
    with pytest.raises(ways.PeerError, match="failed: ValueError: no"):
        ways.process([sys.executable, "-c", "raise ValueError('no')"])


@pytest.mark.slow
def test_whole_ways(any_device: Device) -> None:
    case = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(16, SMALL))
    rows: list[Way] = []
    elsewhere = Fake([])  # what is measured at another task is not asked
    elsewhere.task = "members"
    ways.measure(case, any_device, [Fake([0.1] * 9), elsewhere], 1, rows, lambda text: None)
    assert {row.way for row in rows if row.tracer.startswith("cltrace")} == set(ways.WAYS[1:])
    for row in rows:
        assert not row.note
        assert len(row.seconds) == 1
        assert row.seconds[0] > 0
        assert (row.memory is None) == (row.way not in (ways.NEW, ways.AGAIN))
    assert [row.way for row in rows if row.tracer == "fake"] == [ways.ARRAYS]
    assert "a few: cltrace, arrays" in report.ways_table(rows)


def test_where_seconds_went(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each belongs to the class and the tracer that were named before it."""
    clock = iter([0.0, 1.0, 3.0, 6.0, 10.0, 15.0])
    monkeypatch.setattr(cli.time, "monotonic", lambda: next(clock))
    progress = cli.Progress(True, 2)
    progress.step("meshes: a")
    progress.say("Embree, robust: round 1 of 7")
    progress.say("Embree: round 1 of 7")
    progress.step("bonds: b")
    progress.say("Embree: first picture")
    assert progress.spent == {"": {"": 1.0}, "meshes": {"": 2.0, "Embree": 7.0}, "bonds": {"": 5.0}}
    assert report.took(progress.spent) == (
        "It took 15 s. By class: meshes 9, bonds 5, the rest 1. By program: the rest 8, Embree 7."
    )


def test_only_what_others_do_while_something_is_timed_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """What this process's children do, and theirs, is not done by others, whether they have ended or not."""
    busy = "import time\nend = time.process_time() + 0.4\nwhile time.process_time() < end: pass\n"
    with subprocess.Popen([sys.executable, "-c", busy + "input()"], stdin=subprocess.PIPE, text=True) as child:
        before = machine._used("self")
        time.sleep(0.1)
        while machine.TICK * machine._used(str(child.pid)) < 0.3:  # it takes a little more
            time.sleep(0.05)
        during = machine._used("self")
        child.communicate("")
    assert 0.2 < machine.TICK * (during - before) < 3
    assert machine._used("self") >= during
    assert machine._used("no such process") == 0
    # A thread that has ended, or a kernel that does not tell of children, takes no seconds of the process away.
    read = Path.read_text
    monkeypatch.setattr(Path, "read_text", lambda path: read(path if path.name != "children" else path / "none"))
    assert machine._used("self") > 0
    watch = machine.Watch()
    assert watch.so_far() == {"loaded": ""}


def test_a_loaded_machine_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    # Of 100 s of all processors in which something is timed, others take 6 and the host 3; then only 1 and 1.
    seconds = iter(
        [(0.0, 0.0, 0.0, 0.0), (40.0, 3.0, 100.0, 34.0), (90.0, 50.0, 200.0, 34.0), (130.0, 51.0, 300.0, 73.0)]
    )
    monkeypatch.setattr(machine, "_seconds", lambda: next(seconds))
    watch = machine.Watch()
    with watch.timing():
        pass
    found = watch.so_far()
    assert (found["others"], found["steal"]) == (0.06, 0.03)
    text = "LOADED MACHINE: other processes took 6% of the processors and the host held back 3% of them"
    assert found["loaded"] == text
    with watch.timing():
        pass
    assert {name: watch.so_far()[name] for name in ("others", "steal", "loaded")} == {
        "others": 0.035, "steal": 0.02, "loaded": ""
    }  # fmt: skip
    made = some()
    made.about |= found
    assert f"**{text}**" in report.summary(made)
    assert "**Interrupted**" not in report.summary(made)
    assert "**Interrupted**" in report.summary(replace(made, finished=False))


# --------------------------------------------------------------------------------------------------------------- tables


def test_tables_say_what_was_measured() -> None:
    rows = [
        point(picture=RIGHT, sample=RIGHT, truth="an oracle"),
        point("Embree", (0.001, 0.002, 0.003), note="slow", rms=0.25),
    ]
    text = report.scene_table(rows)
    assert text.splitlines()[0] == "ordinary: 16 balls (16 spheres, 48x27)"
    assert "2.01  2.00..2.02" in text
    assert "2.00~" in text
    assert "Embree: slow" in text
    assert "  held against an oracle\n" in text
    lines = report.summary(Results(dict(ABOUT), rows, finished=True)).splitlines()
    assert lines[0] == "|  | accurate | Embree |"
    assert lines[2] == "| ordinary | 2.0 ms, 0.0010 % | 2.0~ ms, 0.0010 % |"
    where = "Measured on 2000-01-01 00:00 UTC with cltrace 0.1.0 (abc) on 2 cores of a CPU, d."
    assert lines[-1] == f"{where} Pictures of 48x27 pixels."
    text = report.summary(some())
    assert "pixels. Peers: Embree 3. Missing: none: it is missing." in text
    assert "| Embree, 2 | 2.01 ms, 0.50 |" in text
    assert "| 16 balls: cltrace |  | 510 |  |  |  | 100 |  |" in text


def test_where_peers_are_ahead() -> None:
    """A peer's point is named unless one of ours is as fast and as right; errors within 1 % are equal."""

    def at(tracer: str, ms: float, differ: float | None, **more: object) -> Point:
        version = "" if tracer in ("single", "double", "textbook") else "3"
        return point(tracer, (ms / 1000,) * 3, differ=differ, version=version, **more)

    rows = [
        at("single", 2, 0.01), at("double", 8, 0.0), at("textbook", 1, 0.0),
        at("fast", 1, 0.01005), at("between", 4, 0.005), at("worse", 3, 0.02), at("equal", 2, 0.01),
        at("right", 5, 0.0), at("rough", 1, 0.5), at("unknown", 1, None),
        at("curve", 1, 0.9, level=2.0, rms=0.1, group="antialiased"),
        at("double", 2, 0.1, level=4.0, rms=0.2, group="antialiased"),
        at("alone", 1, 0.0, scene="that ours do not draw"),
    ]  # fmt: skip
    assert front.faster(rows) == [
        "ordinary, 16 balls: fast 1.00 ms at 1.0 %, ours single 2.00 ms at 1.0 %",
        "ordinary, 16 balls: right 5.00 ms at 0 %, ours double 8.00 ms at 0 %",
        "antialiased, 16 balls: curve, 2 1.00 ms at RMS 0.10, ours double, 4 2.00 ms at RMS 0.20",
    ]
    assert front.beside(rows) == ["ordinary, 16 balls: between 4.00 ms at 0.50 %; rough 1.00 ms at 50 %"]
    way = Way("16 balls", 16, SMALL, "cltrace, arrays", ways.AGAIN, "", (0.5, 0.51, 0.52))
    taken = [way, replace(way, tracer="cltrace, scene file", seconds=(0.4,) * 3)]
    taken += [replace(way, tracer=name, version="3", seconds=(s,) * 3) for name, s in (("early", 0.3), ("late", 0.45))]
    assert front.sooner(taken) == ["16 balls, process to file: early 300 ms, ours 400 ms"]
    assert front.sooner(taken[2:]) == []
    text = report.summary(Results(dict(ABOUT), rows, taken, finished=True))
    assert "\n  - 16 balls, process to file: early 300 ms, ours 400 ms\n" in text
    assert "nowhere" not in text
    assert "\n- **faster, at an equal or a smaller error**: nowhere\n" in report.summary(some())
    assert "ahead of cltrace, or beside it; errors that are within 1 % of each other are equal:\n\n- **faster" in text
    assert "ahead" not in report.summary(Results(dict(ABOUT), [point()], finished=True))


def test_what_peers_do_not_draw_is_said() -> None:
    """And what one has failed at, in its own words; what was not reached is neither."""
    rows = [point(), point("Embree", (), version="3"), point("VTK", (), version="9")]
    many = "more than 9, each a sky"
    rows += [point("Embree", (), version="3", refused=kinds) for kinds in (("glass", many), ("glass",))]
    rows.append(point("Embree", (), version="3", note="its end, at last"))
    made = Results({**ABOUT, "seconds": {"ordinary": {"Embree": 60.0, "": 21.5}}}, rows, finished=True)
    assert f"VTK 9. Embree does not draw: glass, {many}, its end, at last. It took 82 s." in report.summary(made)
    assert f"\n  Embree: glass, {many}\n" in report.scene_table(rows)


# ---------------------------------------------------------------------------------------------------------- comparisons


def test_what_got_worse_is_found() -> None:
    old = some()
    assert against.changes(old, old, 0.1) == []
    new = some()
    first = replace(RIGHT, wrong_ids=1)
    new.points = [
        replace(old.points[0], kernel=tuple(1.2 * s for s in STEADY), sample=first),
        replace(old.points[1], rms=0.4),
    ]
    new.ways = [replace(old.ways[0], memory=2 * 10**8)]
    new.work = {"a scene": {"rays": 6}}
    found = against.changes(old, new, 0.1)
    assert sorted(kind for kind, _ in found) == ["less right", "more right", "more work", "slower", "slower"]
    assert "a scene, rays: 5 -> 6" in against.told(found, old, new)
    assert against.changes(old, new, 0.3)[0].kind == "more work"
    assert "slower" not in {kind for kind, _ in against.changes(old, replace_about(new, cpu="another"), 0.1)}
    assert "faster" in {kind for kind, _ in against.changes(new, old, 0.1)}
    unsteady = some()
    unsteady.points[0] = point(kernel=(0.002, 0.004, 0.009))
    assert against.changes(old, unsteady, 0.1) == []
    new.work = {"another": {"rays": 1}}
    assert "gone" in {kind for kind, _ in against.changes(old, new, 0.1)}


def replace_about(results: Results, **values: object) -> Results:
    return replace(results, about=results.about | values)


# ---------------------------------------------------------------------------------------------------------------- plots


def drawn() -> Results:
    rows = [
        point(differ=1e-5),
        point(variant="no lists", kernel=tuple(4 * s for s in STEADY), differ=1e-5),
        point("double", tuple(2 * s for s in STEADY), differ=0.0),
        point("textbook", tuple(50 * s for s in STEADY), differ=0.5),
        point("Embree", (0.001, 0.002, 0.004), differ=0.5),  # its rounds do not agree
        point(device="another", kernel=(1e-9,) * 3, differ=0.9),
        *(point(scene=f"{n}", group=scenes.GROWTH_SPHERES, spheres=n, whole=STEADY) for n in (1, 10, 100)),
        *(point("new peer", group="antialiased", level=n, rms=9 / n) for n in (1.0, 2.0, 4.0)),
    ]
    return Results(dict(ABOUT), rows)


def test_plots_show_what_was_measured() -> None:
    """Marks are where time and error are; an error of 0 has its own place; the front holds what nothing beats."""
    from cltrace.bench import plots

    figures = plots.figures(drawn(), "d")
    assert set(figures) == {"time-error", "antialiasing", "growth"}
    panel = figures["time-error"].axes[0]
    assert panel.get_title() == "ordinary (1 not drawn)"
    marks = [line for line in panel.lines if line.get_linestyle() == "None"]
    where = {(round(float(line.get_xdata()[0]), 4), float(line.get_ydata()[0])) for line in marks}  # type: ignore[index]
    assert {(x, y) for x, y in where if y > 1e-6} == {(2.01, 1e-5), (8.04, 1e-5), (100.5, 0.5)}
    assert {x for x, y in where if y <= 1e-6} == {4.02}
    (rings,) = panel.collections
    assert [round(x, 4) for x, _ in rings.get_offsets().tolist()] == [2.01, 4.02]  # type: ignore[union-attr]
    assert any("1 not drawn: " in text.get_text() for text in figures["time-error"].texts)
    line = figures["growth"].axes[0].lines[0]
    assert list(line.get_xdata()) == [1, 10, 100]
    curve = next(line for line in figures["antialiasing"].axes[0].lines if len(line.get_xdata()) == 3)
    assert list(curve.get_ydata()) == [9.0, 4.5, 2.25]


def test_plots_of_a_loaded_machine_say_so() -> None:
    from cltrace.bench import plots

    results = replace_about(drawn(), loaded="LOADED MACHINE: it was busy")
    for figure in plots.figures(results, "d").values():
        assert any(text.get_text() == "LOADED MACHINE: it was busy" for text in figure.texts)


@pytest.mark.parametrize("scheme", ["", "-dark"])
def test_plots_can_be_read_on_their_paper(scheme: str) -> None:
    """Text and marks have a contrast of 4.5 and of 3 at least, as WCAG wants it."""
    from cltrace.bench import plots

    ink, _, paper = plots.SCHEMES[scheme]
    assert contrast(ink, paper) >= 4.5
    colors = [color for color, _, _ in plots.LOOKS.values()]
    assert {color for color in colors if contrast(color, paper) < 3} == set()
    assert len(set(colors)) == len(colors)


def contrast(a: str, b: str) -> float:
    def luminance(color: str) -> float:
        c = np.array([int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)])
        return float(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ (0.2126, 0.7152, 0.0722))

    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


# ------------------------------------------------------------------------------------------------------------- the page


def test_the_page_says_what_its_results_say() -> None:
    """And whether they are older than the code: `cltrace-bench --counted --publish` writes that anew."""
    published, now = points.load(ROOT / publish.RESULTS), points.load(ROOT / publish.COUNTED)
    page = (ROOT / publish.PAGE).read_text("utf-8")
    assert publish.block(published, now.work) in page
    for name in ("time-error", "antialiasing", "growth"):
        for scheme in ("", "-dark"):
            assert f"{name}{scheme}.png" in page
            with Image.open(ROOT / "docs" / f"{name}{scheme}.png") as picture:
                assert picture.info["Description"] == machine.sentence(published.about)


def test_figures_that_are_older_than_the_code_are_marked() -> None:
    old = {"a": {"rays": 100, "tests": 10}, "b": {"rays": 7}}
    assert publish.aged(old, old) == ""
    text = publish.aged(old, {"a": {"rays": 150, "tests": 11}, "b": {"rays": 7}, "c": {"rays": 1}})
    assert text == (
        "**These figures are older than the code**: the counted work of 1 of 2 scenes has changed, most in a, rays, "
        "which is 1.50 times what it was; 1 scenes are other ones."
    )


@pytest.mark.slow
def test_work_is_as_it_was_counted(any_device: Device) -> None:
    """Exact on each machine. After a change that is meant: cltrace-bench --counted --publish, and say why."""
    old = points.load(ROOT / publish.COUNTED)
    now = Results({}, work={name: of for job in counted.jobs(any_device.spec) for name, of in job().items()})
    assert old.work == now.work, against.told(against.changes(old, now, 0), old, now)
