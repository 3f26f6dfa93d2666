"""The benchmark measures what it says: its truth is exact, errors are counted, rounds and the machine are watched."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import stress_cases
from hostile.sphere_scenes import everything

import cltrace
from cltrace import Scene, parallel_light, point_light, spot_light
from cltrace.bench import cli, measure, scenes, tracers, truth, user
from cltrace.bench.measure import Spread
from cltrace.run.devices import Device

SMALL = (48, 27)
# Every kind of light, with the one that is there.
MORE = (
    parallel_light((-1, -2, -1), (0.4, 0.4, 0.3)),
    point_light((-5, 8, 2), (0, 0, 0)),
    spot_light((-4, 5, 0), (4, -5, -7), 10, 25, (0.6, 0.3, 0.2)),
)
NAMES = ("id", "depth", "light", "rgb8")


def every_pixel(scene: Scene) -> np.ndarray:
    return np.arange(math.prod(scene.camera.resolution))


def quiet(text: str) -> None:
    """What a user is told, to nobody."""


# ----------------------------------------------------------------------------------------------------------- the truth


def test_the_truth_is_what_the_oracle_says() -> None:
    scene = scenes.cloud(16, SMALL, *MORE)
    found, exact = truth.exact(scene, every_pixel(scene)), stress_cases.hits(scene)
    assert (found.id == exact.index).all()
    hit = np.flatnonzero(exact.index >= 0)
    assert truth.ulps(found.depth[hit], exact.depth[hit]).max() <= 0.501
    lit, _ = stress_cases.reached(scene, exact, hit)
    white = truth.exact(replace(scene, spheres=scene.spheres), every_pixel(scene)).light[hit]
    assert not (white > 0)[~lit].any()
    assert (white[:, :2] > 0).sum() > 100  # the third light is off, and the spot light has a cone
    # There is something to compare: of each light that shines, lit and dark pixels.
    assert (found.light > 0).any(axis=0).all()
    assert not (found.light > 0).all(axis=0).any()


@pytest.mark.slow
def test_the_truth_of_a_thinned_scene_is_that_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    for scene in (scenes.cloud(60, SMALL), scenes.cloud(40, SMALL, *MORE), everything()):
        pixels = every_pixel(scene)[::7]
        answers = []
        for many in (1000, 0):
            monkeypatch.setattr(truth, "MANY_SPHERES", many)
            answers.append(truth.exact(scene, pixels))
        assert len(set(answers[0].id.tolist())) > 5
        for name in NAMES:
            assert np.array_equal(getattr(answers[0], name), getattr(answers[1], name)), name


@pytest.mark.slow
def test_pictures_are_answers(any_device: Device) -> None:
    """Of shapes and cameras of all kinds; what lights add one by one is in one picture of three of them."""
    for scene in (scenes.cloud(16, SMALL, *MORE), scenes.sticks(27, SMALL), scenes.orthographic(SMALL),
                  scenes.meshed(SMALL, scenes.bowl(200))):  # fmt: skip
        got = tracers.Product(any_device, "accurate").answer(scene)
        pixels = every_pixel(scene)[::5]
        found = truth.compare(got.at(pixels), truth.exact(scene, pixels))
        assert (found.wrong_ids, found.false_shadows, found.leaks) == (0, 0, 0)
        assert found.t_ulp <= 0.52


@pytest.mark.slow
def test_means_of_some_rows(any_device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are those of all rows, and what is not known is not held against a picture."""
    monkeypatch.setattr(truth, "RAYS", 4)
    monkeypatch.setattr(truth, "BAND", 2 * 4 * 4 * SMALL[0])
    scene = scenes.cloud(16, SMALL)
    every, some = (truth.truth_of_means(scene, any_device, bands).levels for bands in (1, 3))
    known = np.arange(SMALL[1]) % 6 < 2
    assert np.array_equal(some[known], every[known])
    assert np.isnan(some[~known]).all()
    picture = np.rint(every).astype(np.uint8)
    picture[~known] ^= 255
    assert truth.differ(picture, some) == 0
    assert truth.rms(picture, some) < 0.5
    picture[0, :7] ^= 2
    assert truth.differ(picture, some) == 7 / (SMALL[0] * known.sum())
    assert truth.differ(picture, every) > 0.6


def test_errors_are_found() -> None:
    """Each kind of mistake, planted once, is counted as that and nothing else."""
    scene = scenes.cloud(16, SMALL)
    right = truth.exact(scene, every_pixel(scene))
    hit, miss = np.flatnonzero(right.light[:, 0] > 0.1)[:8], np.flatnonzero(right.id < 0)[:3]
    dark = np.flatnonzero((right.id >= 0) & (right.light[:, 0] == 0))[:5]
    assert replace(truth.compare(right, right), t_ulp=0.0) == truth.Errors(0, 0.0, 0, 0)
    wrong = truth.Answer(*(getattr(right, name).copy() for name in NAMES))
    wrong.id[hit[0]] = -1
    wrong.id[miss], wrong.depth[miss] = 5, 9
    wrong.id[hit[1]] += 1
    wrong.depth[hit[2]] += 8 * np.spacing(np.float32(right.depth[hit[2]]))
    wrong.light[hit[4:6]] = 0
    wrong.light[dark[:3]] = 1
    right.light[hit[7]] = 1e-9  # a surface that barely faces a light may be black
    wrong.light[hit[7]] = 0
    found = truth.compare(wrong, right)
    assert (found.wrong_ids, found.false_shadows, found.leaks) == (5, 2, 3)
    assert found.t_ulp == pytest.approx(8, abs=0.51)
    # The larger error counts, of all pixels and of those that are held against the reference.
    held = truth.Truth(np.zeros((27, 48, 3)), right, hit, right.at(hit))
    assert held.errors(wrong).wrong_ids == 5  # type: ignore[union-attr]
    assert replace(held, answer=wrong).errors(wrong).wrong_ids == 2  # type: ignore[union-attr]


# --------------------------------------------------------------------------------------------------------- measurement


class Fake(tracers.BenchTracer):
    """Takes the seconds that it is told to, for each run, and a second for the first frame of the first one."""

    name = "fake"
    version = "1"

    def __init__(self, seconds: list[float], costs: float = 0.0) -> None:
        self.left, self.costs, self.frames = seconds, costs, list[int]()

    def run(self, scene: Scene, frames: int) -> tracers.Run:
        first = [] if self.frames else [1.0]
        self.frames.append(frames)
        CLOCK[0] += self.costs
        return tracers.Run([*first, *[self.left.pop(0)] * (frames - len(first))], 1.0, np.zeros((27, 48, 3), np.uint8))


CLOCK = [0.0]
A_FEW = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(2, SMALL))


def test_rounds_agree_or_not() -> None:
    assert Spread.of([1.0, 1.05, 1.1]) == Spread(1.025, 1.05, 1.1 - 0.025, True)
    assert not Spread.of([1.0, 1.0, 1.3, 1.3]).steady
    assert not Spread.of([1.0, 1.0]).steady  # too few to know
    assert math.isnan(Spread.of([]).median)


def test_each_tracer_has_its_own_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is dear takes no round from what is cheap, has the least that says something, and may not take long."""
    monkeypatch.setattr(measure.time, "perf_counter", lambda: CLOCK[0])
    dear, middle, cheap = (Fake([0.1] + [1.0, 2.0] * 9, costs) for costs in (5.0, 0.12, 1e-3))
    slow = Fake([measure.TOO_LONG + 1.0] * 2)
    points = measure.measure(A_FEW, [dear, middle, cheap, slow], None, quiet)
    assert [len(point.frames) for point in points] == [measure.LEAST_ROUNDS, 5, measure.ROUNDS, 1]
    assert points[3].note == "4 s a picture: no further round"
    (every,) = measure.measure(A_FEW, [Fake([0.1] * 30, 5.0)], None, quiet, rounds=20)
    assert len(every.frames) == 20


def test_short_frames_are_repeated() -> None:
    """As the second frame says, which compiles nothing."""
    fakes = [Fake([seconds] * 30) for seconds in (0.004, 0.2, 1e-6)]
    measure.measure(A_FEW, fakes, None, quiet)
    assert [set(fake.frames[1:]) for fake in fakes] == [{10}, {1}, {measure.MOST_FRAMES}]


def test_a_peer_that_fails_does_not_end_the_run() -> None:
    short = Fake([0.1] * 3)
    failed, fine = measure.measure(A_FEW, [short, Fake([0.1] * 30)], None, quiet)
    assert failed.note.startswith("IndexError: ")
    assert len(failed.frames) == 2
    assert len(fine.frames) == measure.ROUNDS
    ours = Fake([])
    ours.version = ""
    with pytest.raises(IndexError):
        measure.measure(A_FEW, [ours], None, quiet)


def test_errors_are_those_of_the_picture() -> None:
    levels = np.zeros((27, 48, 3), np.uint8)
    levels[3, 5] = 255
    (point,) = measure.measure(A_FEW, [Fake([1.0] * 9)], truth.Truth(levels), quiet, rounds=1)
    assert (point.differ, point.errors) == (1 / (27 * 48), None)
    assert point.rms == pytest.approx(255 / math.sqrt(27 * 48))


@pytest.mark.slow
@pytest.mark.parametrize("task", ["cameras", "positions"])
def test_what_moves_ends_at_the_scene(any_device: Device, task: scenes.Task) -> None:
    """So its picture is that of the scene, and its errors are known."""
    scene = scenes.cloud(100, SMALL)
    done = tracers.Product(any_device, "accurate", task).run(scene, 3)
    assert len(done.frames) == 3
    assert np.array_equal(done.rgb8, cltrace.render(scene, any_device).rgb8)


@pytest.mark.slow
def test_what_a_user_waits_for(any_device: Device, tmp_path: Path) -> None:
    case = scenes.Case("a few", scenes.ORDINARY, scenes.cloud(16, SMALL))
    elsewhere = Fake([])  # what is measured at another task is not asked
    elsewhere.task = "samples"
    waits = measure.measure_waits(case, any_device, [Fake([0.1] * 9), elsewhere], 1, quiet, anew=False)
    assert [(wait.tracer, wait.way) for wait in waits] == [
        ("cltrace, arrays", user.AGAIN), ("cltrace, arrays", user.ARRAYS), ("fake", user.ARRAYS)
    ]  # fmt: skip
    assert all(len(wait.seconds) == 1 and wait.seconds[0] > 0 for wait in waits)
    with pytest.raises(subprocess.CalledProcessError):
        user.seconds_of([sys.executable, "-c", "raise ValueError"])


def test_a_loaded_machine_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """What others do in pauses, and what the host holds back at any time."""
    monkeypatch.setattr(measure, "PAUSE", 0)
    # Busy, stolen and all ticks: at the start, before and after a pause, and when asked.
    ticks = iter([(0, 0, 0), (500, 0, 1000), (506, 0, 1100), (600, 30, 2000), (0, 0, 0), (7, 0, 9), (8, 0, 109),
                  (9, 1, 200)])  # fmt: skip
    monkeypatch.setattr(measure, "ticks", lambda: next(ticks))
    for others, steal, loaded in ((0.06, 0.015, True), (0.01, 0.005, False)):
        watch = measure.Watch()
        watch.pause()
        found = watch.so_far()
        assert (found["others"], found["steal"]) == (others, steal)
        text = "LOADED MACHINE: others took 6% of the processors, the host held back 2% of them" if loaded else ""
        assert found["loaded"] == text


@pytest.mark.slow
def test_work_is_as_it_was_counted(any_device: Device) -> None:
    """Exact on each machine. After a change that is meant: cltrace-bench --counted --publish, and say why."""
    from cltrace.bench import report

    assert measure.load(Path(__file__).parents[2] / report.COUNTED).work == cli.count(any_device)
