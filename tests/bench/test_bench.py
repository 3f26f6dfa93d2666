"""The benchmark: its baseline and its truth are right, its errors are what they say, and the command does its work."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cltrace
from cltrace import Scene, parallel_light, point_light, spot_light
from cltrace.bench import catalogue, cli, errors, measure, report, scenes, stress, tracers, truth
from cltrace.bench.cases import balls, everything, looking
from cltrace.bench.peers import povray
from cltrace.bench.textbook import Textbook
from cltrace.plan.request import KEEPS
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT

SCENES = Path(__file__).parents[2] / "scenes"
SMALL = (48, 27)
# Every kind of light, with the one that is there.
MORE = (
    parallel_light((-1, -2, -1), (0.4, 0.4, 0.3)),
    point_light((-5, 8, 2), (0, 0, 0)),
    spot_light((-4, 5, 0), (4, -5, -7), 10, 25, (0.6, 0.3, 0.2)),
)


def run(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cltrace.bench", *map(str, arguments)]
    env = {k: v for k, v in os.environ.items() if k != "PYOPENCL_CTX"} | environment
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=240, check=False)


def every_pixel(scene: Scene) -> np.ndarray:
    return np.arange(math.prod(scene.camera.resolution))


# ---------------------------------------------------------------------------------------------------------- the parts


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first", "three-lights", "spot-colours", "inside", "transforms"])
def test_the_textbook_draws_what_cltrace_draws(device: Device, name: str) -> None:
    scene = cltrace.load(SCENES / f"{name}.xml")
    scene = replace(scene, camera=replace(scene.camera, resolution=(160, 120)))
    image = Textbook(scene, device).render("rgb8", "color", "normal", "depth", "id")
    want = cltrace.render(scene, device, outputs=("rgb8", "normal", "depth", "id"))
    assert (image.id != want.id).mean() < 1e-3
    assert (np.abs(image.rgb8.astype(int) - want.rgb8).max(axis=-1) > 1).mean() < 5e-3
    hit = (image.id == want.id) & (want.id >= 0)
    assert np.abs(image.depth[hit] / want.depth[hit] - 1).max() < 1e-3
    assert ((image.normal * want.normal).sum(axis=-1)[hit] > 0.99).all()


@pytest.mark.slow
def test_the_truth_of_a_thinned_scene_is_that_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    for scene in (scenes.cloud(60, SMALL), scenes.cloud(40, SMALL, *MORE), everything()):
        pixels = every_pixel(scene)[::7]
        monkeypatch.setattr(truth, "MANY", 1000)
        whole = truth.answer(scene, pixels)
        monkeypatch.setattr(truth, "MANY", 0)
        thinned = truth.answer(scene, pixels)
        assert len(set(whole.id.tolist())) > 5
        for name in whole.__dict__:
            assert np.array_equal(getattr(whole, name), getattr(thinned, name)), name


def test_the_oracle_and_the_reference_agree_on_an_ordinary_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenes.cloud(16, SMALL, *MORE)
    exact = truth.answer(scene, every_pixel(scene))
    monkeypatch.setattr(truth, "looks_along_an_axis", lambda camera: False)
    other = truth.answer(scene, every_pixel(scene))
    found = errors.compare(other, exact)
    assert (found.wrong_ids, found.false_shadows, found.leaks, found.bytes_differ) == (0, 0, 0, 0)
    assert found.t_ulp <= 0.501
    assert found.normal < 1e-12
    # There is something to compare: of each light that shines, lit and dark pixels, and one light that is off.
    assert exact.lit.any(axis=0).all()
    assert not exact.lit.all(axis=0).any()


@pytest.mark.slow
def test_lamps_are_the_lights_one_by_one(any_device: Device) -> None:
    scene = scenes.cloud(16, SMALL, *MORE)
    lights = scene.lights[scene.lights["kind"] != AMBIENT]
    assert [len(lamp.lights) for lamp in truth.lamps(scene)] == [3, 1]
    got = tracers.Product(any_device, "accurate", ("features",)).answer(scene)
    for k in range(len(lights)):
        alone = lights[k : k + 1].copy()
        alone["color"] = 1
        lamp = replace(truth.lamps(scene)[0], lights=alone)
        image = cltrace.Renderer(lamp, any_device, outputs=("color",), keep=("features",)).render()
        assert np.array_equal(got.lit[:, k], image.color.reshape(-1, 3)[:, 0] > 0)


def test_errors_are_found() -> None:
    """Each kind of mistake, planted once, is counted as that and nothing else."""
    scene = scenes.cloud(16, SMALL)
    right = truth.answer(scene, every_pixel(scene))
    hit, miss = np.flatnonzero(right.lit[:, 0] & (right.light[:, 0] > 0.1))[:8], np.flatnonzero(right.id < 0)[:3]
    dark = np.flatnonzero((right.id >= 0) & ~right.lit[:, 0])[:5]
    none = errors.compare(right, right)
    assert (none.wrong_ids, none.normal, none.false_shadows, none.leaks, none.bytes_differ) == (0, 0, 0, 0, 0)
    assert 0 < none.t_ulp <= 0.5
    wrong = truth.Answer(**{name: value.copy() for name, value in right.__dict__.items()})
    wrong.id[hit[0]] = -1
    wrong.id[miss] = 5
    wrong.id[hit[1]] += 1
    wrong.depth[hit[2]] += 8 * np.spacing(np.float32(right.depth[hit[2]]))
    x, y, z = right.normal[hit[3]]
    wrong.normal[hit[3]] = np.array([x, y, z]) + 1e-5 * np.array([y, -x, 0]) / math.hypot(x, y)
    wrong.lit[hit[4:6]] = False
    wrong.lit[dark[:3]] = True
    wrong.color[hit[6]] += 0.25
    wrong.rgb8[hit[6:8], 1] ^= 1
    wrong.rgb8[hit[7], 2] ^= 2
    wrong.color[dark[4], 0] = math.nan
    found = errors.compare(wrong, right)
    assert (found.wrong_ids, found.missed, found.invented) == (5, 1, 3)
    assert found.t_ulp == pytest.approx(8, abs=0.51)
    assert found.normal == pytest.approx(1e-5, rel=1e-3)
    assert (found.false_shadows, found.leaks, found.bytes_differ, found.bytes_off) == (2, 3, 2, 1)
    assert found.color_max == pytest.approx(0.25)
    assert found.not_finite == 1


def test_a_surface_that_barely_faces_a_light_may_be_black() -> None:
    scene = scenes.cloud(16, SMALL)
    right = truth.answer(scene, every_pixel(scene))
    lit = np.flatnonzero(right.lit[:, 0])
    right.light[lit[0]] = 1e-9
    wrong = truth.Answer(**{name: value.copy() for name, value in right.__dict__.items()})
    wrong.lit[lit[0]] = False
    wrong.rgb8[lit[0]] ^= 128
    found = errors.compare(wrong, right)
    assert (found.false_shadows, found.bytes_off, found.bytes_differ) == (0, 0, 1)


def test_all_that_is_skipped_is_measured(any_device: Device) -> None:
    every = measure.configurations(any_device, ("accurate", "single"), quick=False)
    kept = [t.keep for t in every if isinstance(t, tracers.Product) and t.precision == "accurate"]
    assert tracers.ACCELERATION in KEEPS
    assert {(name,) for name in KEEPS} | {(), tuple(tracers.SKIPS)} <= set(kept)
    assert len(kept) == len(set(kept))
    assert set(KEEPS) == set(max(kept, key=len))


@pytest.mark.stress
@pytest.mark.parametrize("long", [False, True])
def test_measuring(any_device: Device, long: bool) -> None:
    """Every tracer has a row with times and errors; what has no reference has those of the sample."""
    case = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(16, SMALL))
    rows: list[measure.Row] = []
    every = measure.configurations(any_device, ("accurate", "single", "double"), quick=not long)
    budget = measure.Budget(rounds=2, seconds=1e9, sample=60)
    measure.measure(case, every, tracers.Product(any_device, "double"), budget, rows, lambda text: None)
    assert [row.name for row in rows] == [t.name for t in every]
    for row in rows:
        assert not row.note
        assert len(row.whole) == 2
        assert row.best > 0
        assert min(row.whole) >= row.best
        assert row.sample is not None
        assert row.sample.pixels == 60
        assert (row.picture is None) == (row.name == "double")
        if row.name in ("accurate", "double"):
            assert row.sample.wrong_ids == row.sample.leaks == row.sample.false_shadows == 0
            assert row.errors is not None
            assert row.errors.t_ulp <= 0.52
            assert 0 < row.errors.normal <= 1e-7
    textbook = rows[-1].errors
    assert textbook is not None
    assert textbook.t_ulp > 10  # float32 is seen to be float32
    parsed = json.loads(report.as_json(rows, report.about(["x"], "2000-01-01"), True))
    assert parsed["finished"] is True
    assert [row["kernel"] for row in parsed["rows"]] == [row.kernel for row in rows]
    lines = report.summary(rows, report.about(["x"], "2000-01-01")).splitlines()
    assert lines[0].split(" | ")[1:] == ["accurate", "single", "double", "textbook |"]
    assert lines[2].startswith("| ordinary | ")


def rich() -> Scene:
    """A mesh, an ellipsoid, a texture, glass and a mirror."""
    glass = cltrace.Material(transmittance=0.7, index=1.5)
    tile = cltrace.Mesh([(-2, -1, -5), (2, -1, -5), (0, 2, -6)], [(0, 1, 2)], material=cltrace.Material(texture=GREY))
    more = cltrace.Mesh.of(tile, glass, [(0.5, 0, 0, 0.6), (0, 0.5, 0, 0), (0, 0, 0.5, 0)])
    return Scene.from_spheres(
        looking(tan=0.5, size=SMALL),
        [cltrace.ambient_light(), point_light((1, 5, 1))],
        [(-1, 0, -4), (1, 0.5, -3)],
        0.5,
        reflectance=[0.5, 0],
        transform=[np.eye(3), np.diag([1, 2, 1])],
        background=(1, 1, 1),
        meshes=[tile, more],
    )


GREY = np.full((2, 2), 100, np.uint8)


def test_what_only_cltrace_draws_is_left_to_it(any_device: Device, tmp_path: Path) -> None:
    wanted = "meshes, ellipsoids, mirrors"
    assert tracers.Baseline(any_device).refuses(rich()) == wanted
    assert povray.PovRay("povray", tmp_path).refuses(rich()) == wanted
    bare = replace(rich(), meshes=())
    assert tracers.too_rich(bare) == "ellipsoids, mirrors"
    assert tracers.too_rich(scenes.cloud(16, SMALL)) == ""
    row = measure.Row(scenes.Case("rich", scenes.GIVEN, rich()), "accurate", "", "")
    assert report.title(row) == "given: rich (2 spheres, 2 triangles, 48x27)"


def test_lamps_keep_the_shapes() -> None:
    """Of meshes and ellipsoids, too; nothing in the background is lit."""
    scene = rich()
    lamp = truth.lamps(scene)[0]
    assert [mesh.number for mesh in lamp.meshes] == [2, 3]
    assert (lamp.spheres["to_object"] == scene.spheres["to_object"]).all()
    found = truth.answer(scene, every_pixel(scene))
    seen = truth.answer(lamp, every_pixel(scene))
    assert set(found.id.tolist()) == {-1, 0, 1, 2, 3}
    for name in ("id", "depth", "normal", "lit", "light"):
        assert np.array_equal(getattr(found, name), getattr(seen, name)), name
    assert np.array_equal(seen.color[:, 0] > 0, found.lit[:, 0])


def test_too_many_tests_are_refused(any_device: Device) -> None:
    scene = balls(looking(size=(1000, 1000)), [((0, 0, -5), 1)] * 1001)
    assert "too many" in tracers.Baseline(any_device).refuses(scene)
    assert "too many" in tracers.Product(any_device, "single", ("lists",)).refuses(scene)
    assert not tracers.Product(any_device, "single").refuses(scene)


# --------------------------------------------------------------------------------------------------------- the report

STRESS_CASES = [*(pytest.param(name, marks=pytest.mark.stress) for name in ("G1", "O1", "L5", "L6", "P3"))]
STRESS_CASES.append(pytest.param("R3", marks=pytest.mark.slow))


@pytest.mark.parametrize("name", STRESS_CASES)
def test_stress_case(any_device: Device, name: str) -> None:
    """The report finds what test_stress.py finds of the same catalogue."""
    case = catalogue.cases(name)[0]
    made = list(case.scenes(1))
    answers = [truth.answer(scene, stress.pixels_of(scene)) for scene in made]
    found = stress.examine(tracers.Product(any_device, "accurate"), made, answers, case.limits)
    assert found.within(case.limits), found


def test_the_textbook_fails_what_it_is_known_to_fail(any_device: Device) -> None:
    (case,) = catalogue.cases("G3")
    made = list(case.scenes(1))
    answers = [truth.answer(scene, stress.pixels_of(scene)) for scene in made]
    found = stress.examine(tracers.Baseline(any_device), made, answers, case.limits)
    assert found.t_ulp > 1000
    assert not found.within(case.limits)


def test_a_failed_case_is_the_exit_status(
    any_device: Device, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from cltrace.bench.cli import Progress

    (g1,) = catalogue.cases("G1")
    for limits, status in ((catalogue.GEOMETRY, 0), (replace(catalogue.GEOMETRY, t_ulp=0.1), 1)):
        monkeypatch.setattr(stress, "CATALOGUE", [replace(g1, limits=limits)])
        assert stress.run([any_device], True, Progress(True, 1)) == status
        out = capsys.readouterr().out
        assert ("FAILED" in out) == bool(status)
        assert "1 failed" in out if status else "0 failed" in out
        assert "textbook" in out


# -------------------------------------------------------------------------------------------------------- the command


@pytest.mark.slow
def test_quick(tmp_path: Path) -> None:
    done = run("--quick", "--size", "96x54", "--rounds", 1, "--precision", "accurate", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "bench-results"
    results = json.loads((folder / "results.json").read_text())
    assert results["finished"] is True
    assert {row["class"] for row in results["rows"]} == {"ordinary", "ground spheres", "far from the origin"}
    assert {"accurate", "textbook"} <= {row["tracer"] for row in results["rows"]}
    for row in results["rows"]:
        assert row["size"] == [96, 54]
        assert row["kernel"] or row["note"]
    for line in ("accurate", "textbook", "ordinary: 16 balls (16 spheres, 96x54)"):
        assert line in done.stdout
    names = {path.name for path in folder.iterdir()}
    assert names == {"results.json", "table.md"} | {
        f"{name}.{kind}" for name in ("time-error", "time-distance", "skipped") for kind in ("svg", "png")
    }
    assert (folder / "time-error.png").read_bytes().startswith(b"\x89PNG")
    svg = (folder / "time-error.svg").read_text()
    for text in ("kernel time (ms)", "ordinary", "textbook", "Pareto front"):
        assert text in svg


@pytest.mark.stress
def test_given_scenes_without_plots(tmp_path: Path) -> None:
    scene = SCENES / "minimal.xml"
    done = run(scene, "--quick", "--no-plots", "--precision", "accurate", "-o", "out", "-q", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "out" / "results.json").read_text())["rows"]
    assert {row["scene"] for row in rows} == {"minimal"}
    assert [row["tracer"] for row in rows if row["tracer"] in cltrace.plan.request.PRECISIONS] == ["accurate"] * 2
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"results.json", "table.md"}


def test_without_matplotlib(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import sys; sys.modules['matplotlib'] = None\n")
    done = run("--quick", cwd=tmp_path, PYTHONPATH=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "cltrace-bench: the plots need matplotlib: pip install 'cltrace[bench]', or say --no-plots\n"
    )


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["missing.xml"], 2, "missing.xml: "),
        (["--device", "no such"], 3, "cltrace-bench: no device matches 'no such'"),
        (["--rounds", "0"], 2, "cltrace-bench: argument --rounds: must be a whole number >= 1, got '0'"),
        (["--size", "9"], 2, "cltrace-bench: argument --size: must be WIDTHxHEIGHT, such as 640x480, got '9'"),
        (["--stress", "a.xml"], 2, "cltrace-bench: --stress has scenes of its own"),
        (["-o", "file"], 2, "cltrace-bench: -o: File exists: 'file'"),
    ],
)
def test_faults(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    status: int,
    message: str,
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.chdir(tmp_path)
    assert cli.main([*arguments, "--no-plots"]) == status
    assert capsys.readouterr().err.startswith(message)


@pytest.mark.slow
def test_ctrl_c_keeps_what_was_measured(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cltrace.bench", "--no-plots", "--size", "64x36", "--rounds", "1", "-o", "out"]
    command += ["--precision", "accurate"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("ordinary: 16 balls"):  # the first table: the second scene has begun
            break
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.endswith("cltrace-bench: interrupted; what was measured is kept\n")
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["finished"] is False
    measured = {row["scene"] for row in results["rows"] if row["kernel"]}
    assert "16 balls" in measured
    assert "1,000,000 balls" not in measured
    assert "| accurate | " in (tmp_path / "out" / "table.md").read_text()


def test_plots_show_what_was_measured() -> None:
    """Marks are where time and error are; an error of 0 has its own place; the front holds what nothing beats."""
    from cltrace.bench import plots

    case = scenes.Case("16 balls", scenes.ORDINARY, scenes.cloud(16, SMALL))
    rows = [
        measure.Row(case, "accurate", "", "d", kernel=[0.002, 0.003], whole=[0.01], differ=1e-5),
        measure.Row(case, "accurate", "no lists", "d", ("lists",), [0.008], [0.02], differ=1e-5, work=1),
        measure.Row(case, "double", "", "d", kernel=[0.004], whole=[0.01], differ=0.0),
        measure.Row(case, "textbook", "", "d", kernel=[0.1], whole=[0.1], differ=0.5),
        measure.Row(case, "accurate", "", "another", kernel=[1e-9], whole=[1e-9], differ=0.9),
    ]
    for grown in scenes.growing()[:3]:
        rows.append(measure.Row(grown, "accurate", "", "d", kernel=[0.001], whole=[0.002]))
    figures = plots.figures(rows, "d", "about")
    assert set(figures) == {"time-error", "skipped", "growth"}  # of distances, nothing is known
    panel = figures["time-error"].axes[0]
    rings, *marks = panel.collections
    where = {(round(x, 9), y) for mark in marks for x, y in mark.get_offsets().tolist()}
    assert {(x, y) for x, y in where if y > 1e-6} == {(2.0, 1e-5), (8.0, 1e-5), (100.0, 0.5)}
    assert {x for x, y in where if y <= 1e-6} == {4.0}
    assert [round(x, 9) for x, _ in rings.get_offsets().tolist()] == [2.0, 4.0]
    assert plots.saved([row for row in rows if row.device == "d"]) == {"lists": {"ordinary": pytest.approx(4)}}
    line = figures["growth"].axes[0].lines[0]
    assert (list(line.get_xdata()), list(line.get_ydata())) == ([1, 10, 100], [1, 1, 1])
