"""What the benchmark has measured is told as it is: in results.json, tables, comparisons, figures and on the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from cltrace.base.errors import UsageError
from cltrace.bench import measure, report, scenes, user
from cltrace.bench.measure import Measurement, Results, Wait
from cltrace.bench.truth import Errors

ROOT = Path(__file__).parents[2]
ABOUT = {"date": "2000-01-01 00:00", "cltrace": "0.1.0", "commit": "abc", "cpu": "a CPU", "cores": 2, "device": "d"}
RIGHT = Errors(0, 0.5, 0, 0)
STEADY = [0.002, 0.00201, 0.00202]


def point(tracer: str = "accurate", frames: list[float] = STEADY, **more: object) -> Measurement:
    level = more.get("level")
    given = {"group": "ordinary", "scene": "16 balls", "surfaces": 16, "size": (48, 27), "differ": 1e-5}
    label = tracer if level is None else f"{tracer}, {level}"
    return Measurement(**{**given, "tracer": tracer, "label": label, "frames": frames, **more})  # type: ignore[arg-type]


def some() -> Results:
    """Results with everything in it."""
    rows = [
        point(errors=replace(RIGHT, t_ulp=float("inf"), wrong_ids=3), whole=[0.01, 0.02]),
        point("Embree", version="3", level=2, rms=0.5),
        point("Embree", [], version="3", scene="glass", note="mirrors, glass"),
    ]
    wait = Wait("16 balls", "cltrace, arrays", user.AGAIN, "", [0.5, 0.51, 0.52])
    return Results(dict(ABOUT), rows, [wait], {"a scene": {"rays": 5}}, ["none: it is missing"], True)


def test_results_are_read_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "r.json").write_text(some().as_json())
    assert measure.load(tmp_path / "r.json") == some()


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"about": 1}', some().as_json().replace('"tracer"', '"racer"')])
def test_what_is_no_results_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "r.json").write_text(text)
    with pytest.raises(UsageError, match=r"r\.json: these are no results of cltrace-bench: "):
        measure.load(tmp_path / "r.json")


# --------------------------------------------------------------------------------------------------------------- tables


def test_tables_say_what_was_measured() -> None:
    rows = [point(errors=RIGHT), point("Embree", [0.001, 0.002, 0.003], note="slow", rms=0.25)]
    text = report.scene_table(rows)
    assert text.splitlines()[0] == "ordinary: 16 balls (16 surfaces, 48x27)"
    for part in ("2.01", "2.00~", "Embree: slow"):
        assert part in text
    lines = report.summary(Results(dict(ABOUT), rows, finished=True)).splitlines()
    assert lines[0] == "|  | accurate | Embree |"
    assert lines[2] == "| ordinary | 2.0 ms, 0.0010 % | 2.0~ ms, 0.0010 % |"
    where = "Measured on 2000-01-01 00:00 UTC with cltrace 0.1.0 (abc) on 2 cores of a CPU, d."
    assert lines[-1] == f"{where} Pictures of 48x27 pixels."
    text = report.summary(some())
    for part in ("Embree 3 does not draw mirrors, glass.", "Missing: none: it is missing.", "3 | inf ulp",
                 "| Embree, 2 | 2.01 ms, 0.50 |", "| 16 balls: cltrace, arrays |  | 510 |  |"):  # fmt: skip
        assert part in text.replace("wrong surfaces | 3 |\n| distance off by | inf ulp", "3 | inf ulp"), part
    assert "**Interrupted**" in report.summary(replace(some(), finished=False))
    assert "**busy**" in report.summary(replace(some(), about={**ABOUT, "loaded": "busy"}))


def test_a_class_has_a_mean_only_of_all_its_scenes() -> None:
    rows = [point(), point(scene="another", frames=[0.008] * 3, differ=0.5), point("Embree")]
    line = report.summary(Results(dict(ABOUT), rows, finished=True)).splitlines()[2]
    assert line == "| ordinary | 4.0 ms, 50 % |  |"


def test_where_peers_are_ahead() -> None:
    """A peer's point is named unless one of ours is as fast and as right; errors within 1 % are equal."""

    def at(tracer: str, ms: float, differ: float | None, **more: object) -> Measurement:
        version = "" if tracer in ("single", "double") else "3"
        return point(tracer, [ms / 1000] * 3, differ=differ, version=version, **more)

    rows = [
        at("single", 2, 0.01), at("double", 8, 0.0),
        at("fast", 1, 0.01005), at("between", 4, 0.005), at("worse", 3, 0.02), at("equal", 2, 0.01),
        at("right", 5, 0.0), at("rough", 1, 0.5), at("unknown", 1, None),
        at("curve", 1, 0.9, level=2, rms=0.1, group="antialiased"),
        at("double", 2, 0.1, level=4, rms=0.2, group="antialiased"),
        at("alone", 1, 0.0, scene="that ours do not draw"),
    ]  # fmt: skip
    wait = Wait("16 balls", "cltrace, arrays", user.AGAIN, "", [0.4] * 3)
    early, late = (replace(wait, tracer=f"{s}", version="3", seconds=[s] * 3) for s in (0.3, 0.45))
    assert report.ahead(Results(ABOUT, rows, [wait, early, late])).splitlines()[2:] == [
        "- ordinary, 16 balls: fast; between; right; rough",
        "- antialiased, 16 balls: curve, 2",
        "- 16 balls, process to file: 0.3",
    ]
    assert report.ahead(Results(ABOUT, rows[:1])).endswith("are equal: nowhere.")


# -------------------------------------------------------------------------------------------------------------- figures


def drawn() -> Results:
    rows = [
        point(),
        point("double", [2 * s for s in STEADY], differ=0.0),
        point("single", [50 * s for s in STEADY], differ=0.5),
        point("Embree", [0.001, 0.002, 0.004], differ=0.5),  # its rounds do not agree
        *(point(scene=f"{n}", group=scenes.GROWTH_SPHERES, surfaces=n, whole=STEADY) for n in (1, 10, 100)),
        *(point("new peer", group="antialiased", level=n, rms=9 / n) for n in (1, 2, 4)),
    ]  # fmt: skip
    return Results(dict(ABOUT), rows)


def test_plots_show_what_was_measured() -> None:
    """Marks are where time and error are; an error of 0 has its own place; the front holds what nothing beats."""
    from cltrace.bench import plots

    figures = plots.figures(drawn())
    assert set(figures) == {"time-error", "antialiasing", "growth"}
    panel = figures["time-error"].axes[0]
    assert panel.get_title() == "ordinary (1 not drawn)"
    marks = [line for line in panel.lines if line.get_linestyle() == "None"]
    where = {(round(float(line.get_xdata()[0]), 4), float(line.get_ydata()[0])) for line in marks}  # type: ignore[index]
    assert {(x, y) for x, y in where if y > 1e-6} == {(2.01, 1e-5), (100.5, 0.5)}
    assert {x for x, y in where if y <= 1e-6} == {4.02}
    (rings,) = panel.collections
    assert [round(x, 4) for x, _ in rings.get_offsets().tolist()] == [2.01, 4.02]  # type: ignore[union-attr]
    assert any("1 not drawn: " in text.get_text() for text in figures["time-error"].texts)
    assert list(figures["growth"].axes[0].lines[0].get_xdata()) == [1, 10, 100]
    curve = next(line for line in figures["antialiasing"].axes[0].lines if len(line.get_xdata()) == 3)
    assert list(curve.get_ydata()) == [9.0, 4.5, 2.25]
    busy = replace(drawn(), about={**ABOUT, "loaded": "it was busy"})
    for figure in plots.figures(busy).values():
        assert any(text.get_text() == "it was busy" for text in figure.texts)


# ------------------------------------------------------------------------------------------------------------- the page


def test_the_page_says_what_its_results_say() -> None:
    """And whether they are older than the code: `cltrace-bench --counted --publish` writes that anew."""
    published, now = measure.load(ROOT / report.RESULTS), measure.load(ROOT / report.COUNTED)
    page = (ROOT / report.PAGE).read_text("utf-8")
    assert report.block(published, now.work) in page
    for name in ("time-error", "antialiasing", "growth"):
        for scheme in ("", "-dark"):
            assert f"{name}{scheme}.png" in page
            with Image.open(ROOT / "docs" / f"{name}{scheme}.png") as picture:
                assert picture.info["Description"] == measure.sentence(published.about)


def test_figures_that_are_older_than_the_code_are_marked() -> None:
    old = {"a": {"rays": 100, "tests": 10}, "b": {"rays": 7}}
    assert report.aged(old, old) == ""
    text = report.aged(old, {"a": {"rays": 150, "tests": 10}, "b": {"rays": 7}, "c": {"rays": 1}})
    assert text == "**These figures are older than the code**: the counted work of 2 scenes has changed."
