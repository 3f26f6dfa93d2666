"""All devices of this machine at once: the bytes of one device, and what becomes of one that fails.

The ordinary run draws one scene with one output, so that each driver compiles one kernel.
"""

from __future__ import annotations

import logging
import re
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

import cltrace
from cltrace import Scene, cli
from cltrace.renderers.all_devices import AllDevicesRenderer, all_devices, names_of
from cltrace.run import executor
from cltrace.run.executor import Executor
from cltrace.run.rows import STEP, Rows

FILE = Path(__file__).parents[2] / "scenes" / "step3-shadows.xml"
DEVICES = cltrace.devices()

two = pytest.mark.skipif(len([d for d in DEVICES if d.has_double]) < 2, reason="takes two devices with doubles")


def small(width: int = 240, height: int = 180) -> Scene:
    scene = cltrace.load(FILE)
    return scene.seen_by(replace(scene.camera, resolution=(width, height)))


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How many strips each device has drawn. The first ones of two devices wait for each other."""
    counts, both = Counter[str](), threading.Barrier(2)
    launch = Executor._launch

    def counted(self: Executor, kernel: Any, frame: Any, region: Any, row: int, rows: int) -> Any:
        if region[3]:
            counts[self.device.spec] += 1
            if counts[self.device.spec] == 1:
                both.wait(60)
            time.sleep(0.01)  # for the other one
        return launch(self, kernel, frame, region, row, rows)

    monkeypatch.setattr(Executor, "_launch", counted)
    monkeypatch.setattr(executor, "FIRST_ROWS", STEP)
    monkeypatch.setattr("cltrace.renderers.all_devices.devices", lambda: [d for d in DEVICES if d.has_double][:2])
    return counts


def fail(monkeypatch: pytest.MonkeyPatch, wanted: Callable[[str, int], bool]) -> None:
    """Makes devices fail in those of their strips, by spec and number, that are wanted."""
    launch, numbers, lock = Executor._launch, Counter[str](), threading.Lock()

    def faulty(self: Executor, kernel: Any, frame: Any, region: Any, row: int, rows: int) -> Any:
        if region[3]:
            with lock:
                numbers[self.device.spec] += 1
            if wanted(self.device.spec, numbers[self.device.spec]):
                raise cl.RuntimeError("clEnqueueNDRangeKernel failed: it is on fire")
        return launch(self, kernel, frame, region, row, rows)

    monkeypatch.setattr(Executor, "_launch", faulty)


# Rows that are shared out.


def test_rows_are_all_taken_once() -> None:
    rows, found = Rows(1000, devices=3), list[range]()
    while strip := rows.take(128):
        assert strip.start % STEP == 0
        assert len(strip) <= 128
        found.append(strip)
    assert sorted(row for strip in found for row in strip) == list(range(1000))
    assert len(found[-1]) <= STEP
    rows.settle(found[1:])
    assert rows.lacking == len(found[0])
    rows.give_back(found[:1])
    assert rows.wait()
    assert rows.take(16) == found[0][:16]
    rows.stop()
    assert not rows.wait()
    assert rows.take(16) is None


# Pictures.


@two
@pytest.mark.parametrize(
    ("crop", "how"),
    [
        (None, {"outputs": ("rgb8",)}),
        ((7, 3, 201, 163), {"outputs": ("rgb8",)}),
        pytest.param(
            (7, 3, 201, 163),
            {"precision": "double", "outputs": ("rgb8", "depth", "normal", "shadow_rays")},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_picture_is_that_of_one_device(crop: Any, how: dict[str, Any], request: pytest.FixtureRequest) -> None:
    want = cltrace.render(small(), "cpu", crop=crop, **how)
    launched = request.getfixturevalue("launched")
    image = cltrace.render(small(), "all", crop=crop, **how)
    for name in how["outputs"]:
        assert np.array_equal(getattr(image, name), getattr(want, name), equal_nan=name == "normal"), name
    assert len(launched) == 2


@two
def test_others_do_what_a_device_fails_at(
    launched: Counter[str], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """What it has drawn before is drawn again, as nobody knows whether it is right."""
    first = DEVICES[0]
    fail(monkeypatch, lambda spec, number: spec == first.spec and number >= 2)
    image = cltrace.render(small(), "all")
    monkeypatch.undo()
    assert np.array_equal(image.rgb8, cltrace.render(small()).rgb8)
    assert launched[first.spec] == 1
    (message,) = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert message.startswith(f"{first.label} draws no more, and others do its part: ")
    assert message.endswith("it is on fire")


@two
def test_a_fault_of_the_picture_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    def overgrown(*_: object) -> None:
        raise cltrace.TooManyRaysError((3, 4), 2**20, 50)

    monkeypatch.setattr(Executor, "draw", overgrown)
    with pytest.raises(cltrace.TooManyRaysError, match="3"):
        cltrace.render(small(), "all")


def test_what_follows_is_drawn_by_all_devices_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where another background brings other outputs."""
    monkeypatch.setattr("cltrace.renderers.all_devices.devices", lambda: DEVICES[:1])
    first, clear = AllDevicesRenderer(small(60, 45)), replace(small(60, 45), background_alpha=0.5)
    following = first.following(clear)
    assert isinstance(following, AllDevicesRenderer)
    found, want = following.render(), cltrace.render(clear, DEVICES[0])
    assert found.outputs == want.outputs == ("rgb8", "rgba8")
    assert np.array_equal(found.rgba8, want.rgba8)


def test_precisions(monkeypatch: pytest.MonkeyPatch) -> None:
    """A device without doubles is left out where the others have them."""
    assert all_devices("single") == (cltrace.devices(), "single")
    every = all_devices()[0]
    assert all(d.has_double for d in every)
    assert names_of([every[0], every[0]]) == f"2 x {every[0].name}"
    monkeypatch.setattr(cltrace.Device, "has_double", False)
    assert all_devices() == (cltrace.devices(), "single")
    with pytest.raises(cltrace.DeviceError, match="no device has double precision, which --precision accurate needs"):
        all_devices("accurate")
    monkeypatch.setattr("cltrace.renderers.all_devices.devices", list)
    with pytest.raises(cltrace.DeviceError, match="no OpenCL device found"):
        cltrace.render(small(), "all")


# Movies.


def cameras(count: int = 9) -> list[Any]:
    return cltrace.orbit(small(60, 45), count)


@two
def test_frames_are_those_of_one_device(request: pytest.FixtureRequest) -> None:
    frames = cameras()
    moved = {"centers": np.asarray(small().spheres["center"]) + (0.1, 0, 0)}
    frames[5:5] = [moved, small(50, 41)]
    want = list(cltrace.animate(frames, scene=small(60, 45), device="cpu"))
    launched = request.getfixturevalue("launched")
    found = cltrace.animate(frames, scene=small(60, 45), device="all")
    for k, (image, one) in enumerate(zip(found, want, strict=True)):
        assert np.array_equal(image.rgb8, one.rgb8), k
    assert len(launched) == 2


@two
@pytest.mark.parametrize("which", [1, 2])
def test_others_draw_the_frames_of_a_device_that_fails(
    which: int, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """At its first frame, or at the second, while it has prepared the third."""
    want = [image.rgb8 for image in cltrace.animate(cameras(), scene=small())]
    if which > 1:
        request.getfixturevalue("launched")
    fail(monkeypatch, lambda spec, number: spec == DEVICES[0].spec and number == which)
    images = list(cltrace.animate(cameras(), scene=small(), device="all"))
    assert all(np.array_equal(image.rgb8, one) for image, one in zip(images, want, strict=True))
    assert len([record for record in caplog.records if "draws no more" in record.getMessage()]) == 1


@two
def test_a_frame_that_fails_ends_the_movie_there(monkeypatch: pytest.MonkeyPatch) -> None:
    def frames() -> Iterator[Any]:
        yield from cameras(4)
        yield {"camera": replace(small().camera, resolution=(8, 6))}  # too small for the crop
        yield from cameras(4)

    images = cltrace.animate(frames(), scene=small(), device="all", crop=(0, 0, 50, 40))
    for _ in range(4):
        next(images)
    with pytest.raises(ValueError, match=re.escape("crop: must be within 0,0,8,6")):
        next(images)


# The command.


@two
def test_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    line = [str(FILE), "--size", "60x45"]
    for more in (["-o", "{}.png"], ["--orbit", "3", "-o", "{}%d.png"]):
        for device, name in (("all", "a"), ("cpu", "b")):
            assert cli.main([*line, "-d", device, *[word.replace("{}", name) for word in more]]) == 0
            (said,) = [text for text in capsys.readouterr().err.splitlines() if "wrote" in text]
            assert (" and " in said) == (device == "all")
    for name in (".png", "0.png", "1.png", "2.png"):
        assert (tmp_path / f"a{name}").read_bytes() == (tmp_path / f"b{name}").read_bytes()
    fail(monkeypatch, lambda spec, number: True)
    for more in (["-o", "x.png"], ["--orbit", "3", "-o", "x%d.png"]):
        assert cli.main([*line, "-d", "all", *more]) == 3
        lines = capsys.readouterr().err.splitlines()
        assert "cltrace: no device can draw this; `cltrace --doctor` tries each of them" in lines
        assert [text.split(": ")[0] for text in lines[-2:]] != lines[-2:]
        assert sorted(text.split()[0] for text in lines[-len(DEVICES) :]) == sorted(d.spec for d in DEVICES)
    assert not list(tmp_path.glob("*x*"))


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--cluster", "local"], 2, "-d all does not go with --cluster: a worker has one device"),
        (["--compare", "mine.png"], 2, "-d all does not go with --compare, which takes one device"),
        (["--repeat", "3"], 2, "-d all does not go with --repeat, which takes one device"),
        (["--show", "lit"], 2, "-d all does not go with --show lit, which takes one device"),
    ],
)
def test_usage(arguments: list[str], status: int, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([str(FILE), "-d", "all", *arguments]) == status
    assert message in capsys.readouterr().err
    with pytest.raises(cltrace.DeviceError, match="'all' is for pictures and movies"):
        cltrace.Renderer(small(), "all")
