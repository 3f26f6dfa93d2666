"""What the benchmark measures is told as it is: in results.json, tables, plots, comparisons and on the page."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cltrace import Scene
from cltrace.base.errors import UsageError
from cltrace.bench import against, cli, counted, machine, measure, points, publish, report, scenes, tracers, ways
from cltrace.bench.errors import Errors
from cltrace.bench.points import Point, Results, Spread, Way
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
        point("Embree", version="3", level=2.0, rms=0.5),
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
    """Takes the seconds that it is told to."""

    name = "fake"

    def __init__(self, seconds: list[float]) -> None:
        self.left = seconds

    def run(self, scene: Scene, frames: int) -> tracers.Run:
        return tracers.Run([self.left.pop(0)] * frames, 1.0, np.zeros((27, 48, 3), np.uint8))


def test_a_tracer_is_measured_until_its_rounds_agree() -> None:
    case = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(2, SMALL))
    steady, restless = Fake([9.0, 1.0, 1.0, 1.0]), Fake([9.0, 1.0, 2.0, 2.5, 1.0, 2.0])
    slow = Fake([measure.TOO_LONG + 1.0] * 2)
    rows: list[Point] = []
    budget = measure.Budget(rounds=5, seconds=1e9, errors=False)
    measure.measure(case, [steady, restless, slow], None, budget, rows, lambda text: None)
    assert [row.kernel for row in rows] == [(1.0,) * 3, (1.0, 2.0, 2.5, 1.0, 2.0), (4.0,)]
    assert [row.time.steady for row in rows] == [True, False, False]
    assert rows[2].note == "4 s a picture: no further round"


@pytest.mark.stress
@pytest.mark.parametrize("long", [False, True])
def test_measuring(any_device: Device, long: bool) -> None:
    """Every tracer has a point with times and errors; what has no reference has those of the sample."""
    case = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(16, SMALL))
    rows: list[Point] = []
    every = tracers.configurations(any_device, ("accurate", "single", "double"), quick=not long)
    budget = measure.Budget(rounds=2, seconds=math.inf, sample=60)
    measure.measure(case, every, tracers.Product(any_device, "double"), budget, rows, lambda text: None)
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


def test_a_loaded_machine_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    # Of 100 s of all processors, others take 6 and the host 3.
    seconds = iter([(0.0, 0.0, 0.0, 0.0), (40.0, 3.0, 100.0, 34.0), (0.0, 0.0, 0.0, 0.0), (40.0, 1.0, 100.0, 39.0)])
    monkeypatch.setattr(machine, "_seconds", lambda: next(seconds))
    found = machine.Watch().so_far()
    assert (found["others"], found["steal"]) == (0.06, 0.03)
    text = "LOADED MACHINE: other processes took 6% of the processors and the host held back 3% of them"
    assert found["loaded"] == text
    assert machine.Watch().so_far()["loaded"] == ""
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
    now = Results({}, work=counted.count(any_device, lambda text: None))
    assert old.work == now.work, against.told(against.changes(old, now, 0), old, now)
