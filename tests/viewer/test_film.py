"""Movies in the viewer: their frames, and the file that a button writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_session import FILE, drawn, kinds, pixels

import cltrace
from cltrace import cli
from cltrace.cli import view as command
from cltrace.cli.files import Reporter
from cltrace.cli.options import options_of
from cltrace.run.devices import choose
from cltrace.viewer.messages import Event
from cltrace.viewer.session import Session
from cltrace.viewer.stage import Stage, film_of

SCENE = cltrace.load(FILE)


def session_of(frames: Any, spec: str, count: int | None = None, output: str | None = None) -> Session:
    def write(items: Any, output: str) -> object:
        return cltrace.animate(items, output, scene=SCENE, device=spec, progress=False, fps=10)

    return Session(Stage(SCENE, choose(spec), film=film_of(frames, count, output, 10, write)))


@pytest.mark.slow
def test_frames_are_those_of_animate(spec: str) -> None:
    """Cameras, scenes and changes, each of what was there before it, in any order; a moved camera stays."""
    center = SCENE.spheres["center"]
    frames = [
        SCENE.camera,
        {"centers": center + 0.2},
        {"colors": np.full((len(center), 3), 0.5)},
        cltrace.orbit(SCENE, 8)[1],
    ]
    wanted = [image.rgb8 for image in cltrace.animate(frames, scene=SCENE, device=spec)]
    session = session_of(frames, spec)
    for number in (3, 1, 2, 0):
        session.handle(Event("frame", number))
        _, exact, smooth = drawn(session)
        assert (pixels(exact) == wanted[number]).all()
        assert exact.home
        assert (smooth.state["frame"], smooth.state["frames"], smooth.state["fps"]) == (number, 4, 10)
    session.handle(Event("orbit", 0.3))
    drawn(session)
    moved = session.camera
    session.handle(Event("frame", 3))
    assert not drawn(session)[-1].home
    assert session.camera == moved
    session.handle(Event("back"))
    assert session.camera == frames[3]
    session.handle(Event("frame", 4))
    assert session.frame == 3


def test_a_function_makes_frames(spec: str) -> None:
    asked = []

    def frame(number: int) -> cltrace.Camera:
        asked.append(number)
        if number == 2:
            raise OSError("no such step")
        return cltrace.orbit(SCENE, 8)[number]

    session = session_of(frame, spec, count=3)
    assert asked == []
    session.handle(Event("frame", 1))
    drawn(session)
    assert asked == [0, 1]
    session.handle(Event("frame", 2))
    message = session.draw()
    assert (message.kind, message.text) == ("error", "frames[2]: OSError('no such step')")
    session.handle(Event("frame", 0))
    assert kinds(drawn(session)) == ["moving", "exact", "smooth"]


@pytest.mark.parametrize(
    ("frames", "count", "words"),
    [
        ([], None, "frames: must be a list"),
        ("ab", None, "frames: must be a list"),
        (iter([1]), None, "frames: must be a list"),
        ([SCENE.camera], 3, "count: goes with a function"),
        (lambda k: SCENE, None, "count: must be how many"),
        (lambda k: SCENE, 0, "count: must be how many"),
    ],
)
def test_what_is_no_movie(frames: Any, count: Any, words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        film_of(frames, count, None, 25, lambda *_: None)


def test_the_button_of_a_closed_window_writes_nothing(spec: str, tmp_path: Path) -> None:
    cameras, file = cltrace.orbit(SCENE, 3), tmp_path / "turn.apng"
    session = session_of(cameras, spec, output=str(file))
    session.close()
    assert kinds(session.answer(Event("write"))) == ["said"]
    assert not file.exists()
    assert list(session_of(cameras, spec).answer(Event("write"))) == []


@pytest.mark.parametrize(
    ("name", "options", "count", "fps"),
    [("a.gif", ("--fps", "10"), 4, 10), ("a%02d.png", ("--frames", "1:4:2", "--axis", "x"), 2, 25)],
)
def test_the_commands_movie(
    name: str, options: tuple[str, ...], count: int, fps: int, spec: str, tmp_path: Path, monkeypatch: Any
) -> None:
    """The frames and the file of the command without `view`."""
    file, stages = tmp_path / name, list[Stage]()
    arguments = [str(FILE), "--orbit", "4", "-o", str(file), "-d", spec, *options]
    monkeypatch.setattr(command, "serve", lambda stage, *_: stages.append(stage))
    assert command.view(options_of(["view", *arguments]), Reporter(True)) == 0
    session = Session(stages[0])
    state = drawn(session)[-1].state
    assert (state["frames"], state["file"], state["fps"]) == (count, str(file), fps)
    assert [message.text for message in session.answer(Event("write"))][-1] == f"{file} is written"
    written = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for path in written:
        path.unlink()
    assert cli.main([*arguments, "-q"]) == 0
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == written
