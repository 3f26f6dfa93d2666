"""Pictures that are drawn and written by strips: the bytes of whole ones, in less memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest
from random_scenes import usual_scene

from cltrace import Renderer, TooSlowError, cli
from cltrace.renderers import renderer as module
from cltrace.run import executor
from cltrace.run.devices import Device
from cltrace.run.executor import Executor, FrameBuffers

pytestmark = pytest.mark.usefixtures("own_folder")

SCENE = Path(__file__).parents[2] / "scenes" / "first.xml"
SIZE = ["--size", "90x75", "-q"]
FILES = ["-o", "a.png", "-o", "a.exr", "-o", "a.npy"]
WAYS = {
    "plain": [],
    "16 bits with alpha": ["--bits", "16", "--transparent"],
    "ids of a part": ["--show", "id", "--crop", "7,9,80,70", "--outputs", "id,depth,normal,primitive,uv"],
    "normals of the camera": ["--show", "normal", "--space", "camera"],
    "lines and fog": ["--outline", "black,3", "--fog", "white,5,9", "--antialias"],
}


def fails_above(monkeypatch: pytest.MonkeyPatch, rows: int, error: type[Exception]) -> None:
    """There is no memory for frames of more rows."""
    make = Executor.frame

    def frame(self: Executor) -> FrameBuffers:
        if self.region[3] > rows:
            raise error("no room")
        return make(self)

    monkeypatch.setattr(Executor, "frame", frame)


@pytest.mark.parametrize("way", [pytest.param(way, marks=pytest.mark.slow) if "fog" in way else way for way in WAYS])
def test_files_are_those_of_whole_pictures(
    way: str, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    names, drawn = ["a.png", "a.exr", "a.npy"], []
    draw = Renderer.draw
    monkeypatch.setattr(Renderer, "draw", lambda self, *a, **k: drawn.append(self.region[3]) or draw(self, *a, **k))
    assert cli.main([str(SCENE), *SIZE, *FILES, *WAYS[way]]) == 0
    want, height = [Path(name).read_bytes() for name in names], max(drawn)
    monkeypatch.setattr(module, "STRIP_BYTES", 2**12)
    drawn.clear()
    assert cli.main([str(SCENE), *SIZE, *FILES, *WAYS[way]]) == 0
    assert [Path(name).read_bytes() for name in names] == want
    assert way == "lines and fog" or (set(drawn) <= {16, height % 16} and sum(drawn) == height)
    capfdbinary.readouterr()
    assert cli.main([str(SCENE), *SIZE, *WAYS[way], "-o", "-", "-o", "a.exr"]) == 0
    assert capfdbinary.readouterr().out == want[0]


@pytest.mark.parametrize("error", [cl.MemoryError, MemoryError])
def test_strips_become_smaller_where_memory_does_not_suffice(
    error: type[Exception], device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    renderer = Renderer(usual_scene(), device)
    want = renderer.render().rgb8
    fails_above(monkeypatch, 20, error)
    parts = list(module.strips(renderer))
    assert {rows for rows, _ in parts[:-1]} == {16}
    assert np.array_equal(np.concatenate([image.rgb8 for _, image in parts]), want)
    assert cli.main([str(SCENE), *SIZE, "-o", "a.png"]) == 0


def test_strips_have_one_limit_of_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each takes less than the limit; and a whole picture after them has a limit of its own."""
    monkeypatch.setattr(module, "STRIP_BYTES", 2**12)
    renderer, now, draw = Renderer(usual_scene()), [0.0], Executor._render
    want = renderer.render().rgb8
    monkeypatch.setattr(executor, "MAX_SECONDS", 1.5)
    monkeypatch.setattr("time.monotonic", lambda: now[0])

    def a_second(self: Executor, *where: Any) -> None:
        now[0] += 1
        draw(self, *where)

    monkeypatch.setattr(Executor, "_render", a_second)
    drawn = module.strips(renderer)
    next(drawn)  # in time
    with pytest.raises(TooSlowError):
        list(drawn)
    assert np.array_equal(renderer.render().rgb8, want)


def test_too_little_memory_is_said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """As of a device that has none, or of a format that is not written by rows; the old file stays."""
    for name, rows in (("a.png", 10), ("a.npz", 74)):
        Path(name).write_bytes(b"old")
        with monkeypatch.context() as patch:
            fails_above(patch, rows, cl.MemoryError)
            assert cli.main([str(SCENE), *SIZE, "-o", name]) == 3
        assert capsys.readouterr().err.endswith(" has not enough memory: no room\n")
        assert [path.read_bytes() for path in Path().iterdir()] == [b"old"]
        Path(name).unlink()


@pytest.mark.slow
def test_a_whole_picture_that_no_memory_holds(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("cltrace.cli.picture.physical_memory", lambda: 5e4)
    for more, size in ((["-o", "a.npz"], 243), (["--check", "-o", "a.npy"], 47.2)):
        assert cli.main([str(SCENE), *SIZE, *more]) == (2 if size > 50 else 0)
        advice = "of 5e-05 GB; only .png, .exr, .npy are written by rows, without --check, --repeat and "
        advice += "--show depth; or draw a part of it with --crop"
        want = f"cltrace: 90x75 would take {size / 1e6:.3g} GB at once, {advice}\n" if size > 50 else ""
        assert capsys.readouterr().err == want
    assert cli.main([str(SCENE), *SIZE, "-o", "a.exr"]) == 0


def test_a_fault_while_strips_are_written_names_the_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "STRIP_BYTES", 2**12)
    line = [str(SCENE), *SIZE, "-o", "a.png", "-o", "/dev/full", "-o", "a.npy"]
    monkeypatch.setattr("cltrace.cli.files.check_target", lambda *_: None)
    monkeypatch.setattr("cltrace.cli.files.suffix_of", lambda target: Path(target).suffix or ".npy")
    monkeypatch.setattr("cltrace.cli.picture.suffix_of", lambda target: Path(target).suffix or ".npy")
    assert cli.main(line) == 2
    assert capsys.readouterr().err == "cltrace: cannot write /dev/full: No space left on device\n"
    assert not list(Path().iterdir())


MEMORY = """
import resource, sys
from cltrace import cli
assert cli.main([sys.argv[1], "--size", "256x240", "-q", *sys.argv[3:]]) == 0
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
assert cli.main([sys.argv[1], "--size", sys.argv[2], "-q", *sys.argv[3:]]) == 0
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems count otherwise")
@pytest.mark.parametrize("how", [["-o", "a.exr"], ["-o", "a.png", "--bits", "16"], ["-o", "a.png", "--show", "id"]])
def test_memory_does_not_grow_with_the_picture(how: list[str]) -> None:
    """25 million pixels, in kB; an .exr took 2.3 GB."""
    minimal = SCENE.with_name("minimal.xml")
    line = [sys.executable, "-c", MEMORY, str(minimal), "5000x5000", *how]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 300_000
