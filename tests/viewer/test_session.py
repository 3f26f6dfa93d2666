"""A window without a network: what events do, which pictures come, and that these are the command's."""

from __future__ import annotations

import json
import math
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

import cltrace
from cltrace import cli
from cltrace.base.errors import SceneError
from cltrace.formats.reader import read
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import choose
from cltrace.viewer import cameras
from cltrace.viewer.messages import Event, Message, RayLine, lines_of
from cltrace.viewer.session import PACE, Session, next_divisor
from cltrace.viewer.stage import VIEWS, Drawn, Phase, Stage

SCENES = Path(__file__).parents[2] / "scenes"
FILE = SCENES / "minimal.xml"


@pytest.fixture
def stage(spec: str) -> Stage:
    return Stage(read(str(FILE), True)[0], choose(spec))


@pytest.fixture
def session(stage: Stage) -> Session:
    return Session(stage)


def drawn(session: Session) -> list[Message]:
    """All pictures until there is nothing new."""
    found = []
    while session.phase != "done":
        message = session.draw()
        assert message
        found.append(message)
    assert session.draw() is None
    return found


def pixels(message: Message) -> np.ndarray:
    return np.asarray(Picture.open(BytesIO(message.data)))


def command(folder: Path, *arguments: str) -> bytes:
    file = folder / "command.png"
    assert cli.main([str(FILE), "-q", "-o", str(file), *arguments]) == 0
    return file.read_bytes()


# Each is a kernel to compile.
OTHERS = [pytest.param(view, marks=pytest.mark.slow) if view in ("primitive", "uv", "lit") else view for view in VIEWS]


@pytest.mark.parametrize("view", OTHERS[1:-1])
def test_other_outputs_are_the_commands(session: Session, view: str, spec: str, tmp_path: Path) -> None:
    drawn(session)
    session.handle(Event("show", name=view))
    moving, exact = drawn(session)
    assert (moving.kind, exact.kind) == ("moving", "exact")
    assert exact.data == command(tmp_path, "-d", spec, "--show", view)
    assert f"minimal.xml: {view}, 481x361, exact, on " in exact.text


def test_a_moved_camera_is_exact_at_rest(session: Session, stage: Stage, spec: str) -> None:
    drawn(session)
    session.handle(Event("orbit", 0.1, 0.05))
    moving, exact, smooth = drawn(session)
    seen = stage.scene.seen_by(cameras.orbit(stage.scene.camera, 0.1, 0.05))
    assert (pixels(exact) == cltrace.render(seen, spec).rgb8).all()
    assert (pixels(smooth) == cltrace.render(seen, spec, antialias=True).rgb8).all()
    assert moving.number == exact.number == 1
    assert not moving.home
    assert not exact.home
    # The small one shows the same, but for what its size and JPEG lose.
    small = pixels(moving)
    assert small.shape == (180, 240, 3)
    assert np.abs(small.astype(int) - pixels(exact)[:-1:2, :-1:2]).mean() < 3


def test_old_pictures_are_dropped(session: Session) -> None:
    """However many events there were, one picture is moving, and it is of the newest."""
    drawn(session)
    for _ in range(100):
        session.handle(Event("orbit", 0.01))
    assert [message.number for message in drawn(session)] == [100, 100, 100]
    session.handle(Event("zoom", 0, 1))
    assert session.draw().kind == "moving"
    session.handle(Event("zoom", 0, 1))
    assert session.phase == "moving"


@pytest.mark.parametrize("end", [lambda session: session.handle(Event("orbit", 0.1)), Session.close])
@pytest.mark.parametrize(("view", "phase"), [("color", "exact"), ("color", "smooth"), ("lit", "exact")])
@pytest.mark.parametrize("other", [False, True])
def test_what_is_drawn_at_rest_ends(
    session: Session, end: Callable[[Session], None], view: str, phase: Phase, other: bool, monkeypatch: Any
) -> None:
    """As soon as something is wanted in any window, or this one is closed, and then it is drawn again."""
    session.handle(Event("show", name=view))
    drawn(session)
    draw, wanting = Renderer.draw, Session(session.stage) if other else session
    session.phase = phase
    with monkeypatch.context() as patch:
        patch.setattr(Renderer, "draw", lambda *arguments: (end(wanting), draw(*arguments))[1])
        assert session.draw() is None
    session.closed = False
    assert drawn(session)[-1].kind == ("smooth" if view == "color" else "exact")


def test_undo_takes_back_a_whole_way(session: Session) -> None:
    home = session.camera
    drawn(session)
    for _ in range(5):
        session.handle(Event("orbit", 0.01))
        session.draw()  # a moving one
    drawn(session)
    turned = session.camera
    session.handle(Event("show", name="depth"))
    session.handle(Event("fit"))
    drawn(session)
    for wanted in (turned, home, home):
        session.handle(Event("undo"))
        assert session.camera == wanted
        drawn(session)


def test_what_cannot_be_changes_nothing(session: Session) -> None:
    before = session.camera
    for event in (Event("zoom", 0, 2**20), Event("zoom", 0, -(2**20)), Event("show", name="nothing")):
        session.handle(event)
        assert session.camera == before
    assert len(drawn(session)) == 2


@pytest.mark.parametrize("parallel", [False, True])
def test_centre(session: Session, parallel: bool) -> None:
    if parallel:
        session.handle(Event("parallel"))
    drawn(session)
    assert list(session.answer(Event("centre", 0, 0))) == []
    assert session.phase == "done"
    explained = cltrace.explain(session.stage.scene.seen_by(session.camera), 200, 180)
    assert list(session.answer(Event("centre", 200, 180))) == []
    assert session.camera.lookat == pytest.approx(explained.rays[0].hit.point)
    assert session.phase == "moving"


def test_explanation(session: Session) -> None:
    """That of the command, and before it the line of the file."""
    message, _ = session.answer(Event("explain", 240, 180))
    explained = cltrace.explain(session.stage.scene, 240, 180)
    assert message.kind == "explanation"
    assert message.text.endswith(str(explained))
    line = explained.rays[0].hit.surface.line
    assert f"\n{FILE}:{line}: <sphere " in message.text
    message, _ = session.answer(Event("explain", 0, 0))
    assert "meets nothing" in message.text
    (message,) = session.answer(Event("explain", 481, 0))
    assert (message.kind, message.text) == ("error", "x: must be a whole number within 0..480, got 481")


def test_copies(session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the command draws is what is seen: another camera, in other lights."""
    session.handle(Event("orbit", 0.1))
    session.handle(Event("light", 1, 0.25))
    texts = {name: next(session.answer(Event("copy", name=name))).text for name in ("xml", "python", "command")}
    assert texts["xml"] == cameras.as_xml(session.camera)
    assert texts["python"] == f"cltrace.{session.camera!r}"
    monkeypatch.chdir(tmp_path)
    words = shlex.split(texts["command"])
    assert words[:2] == ["python", "-c"]
    subprocess.run([sys.executable, *words[1:]], check=True)
    with Picture.open("view.png") as picture:
        assert (np.asarray(picture) == pixels(drawn(session)[-1])).all()
    (message,) = session.answer(Event("copy", name="other"))
    assert message.kind == "error"


@pytest.mark.slow
def test_another_scene(stage: Stage, session: Session, spec: str) -> None:
    """A camera that was not moved is the new one's; one that was moved stays, with the new size."""
    told = []
    stage.changed.add(lambda: told.append(stage.fault))
    moved = Session(stage)
    moved.handle(Event("orbit", 0.1))
    drawn(session), drawn(moved)
    where = moved.camera.position
    new = cltrace.load(SCENES / "first.xml")
    stage.follow(lambda: new)
    for window in (session, moved):
        window.refresh()
        assert [message.kind for message in drawn(window)] == ["exact", "smooth"]
    assert session.camera == new.camera
    assert (moved.camera.position, moved.camera.resolution) == (where, (960, 540))
    moved.handle(Event("undo"))
    assert moved.camera.resolution == (960, 540)
    session.handle(Event("show", name="color"))
    assert (pixels(drawn(session)[-1]) == cltrace.render(new, spec, antialias=True).rgb8).all()

    def faulty() -> cltrace.Scene:
        raise SceneError("a.xml", [])

    with pytest.raises(SceneError):
        stage.follow(faulty)
    assert stage.scene is new
    assert told == ["", stage.fault]


def test_comparison(spec: str, tmp_path: Path) -> None:
    mine = tmp_path / "mine.png"
    scene = cltrace.load(FILE)
    cltrace.Image(rgb8=cltrace.render(scene, spec).rgb8[::-1]).save(mine)
    session = Session(Stage(scene, choose(spec), compare=lambda seen: cltrace.compare(seen, mine, device=spec)))
    own, difference, words = session.answer(Event("compare"))
    assert (own.kind, difference.kind, words.kind) == ("mine", "difference", "comparison")
    found = cltrace.compare(scene, mine, device=spec)
    assert (pixels(own) == found.mine).all()
    assert (pixels(difference) == np.minimum(4 * np.abs(found.mine.astype(int) - found.right), 255)).all()
    assert words.text == str(found)
    mine.unlink()
    session.stage.scene = cltrace.load(FILE)
    (message,) = session.answer(Event("compare"))
    assert message.text.startswith(f"{mine}: cannot be read")
    assert list(Session(Stage(scene, choose(spec))).answer(Event("compare"))) == []


def test_pictures_that_take_long_are_smaller(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it is their file that does."""
    assert [next_divisor(d, PACE / 5) for d in (1, 2, 3, 4)] == [1, 1, 2, 3]
    assert next_divisor(2, 0.9 * PACE) == 2
    write = Drawn.file
    monkeypatch.setattr(Drawn, "file", lambda *which: (time.sleep(2 * PACE), write(*which))[1])
    for height in (180, 120, 90, 90):
        session.handle(Event("orbit", 0.1))
        assert len(pixels(session.draw())) == height


def kinds(found: Iterable[Message | RayLine]) -> list[str]:
    return [one.kind for one in found]


def test_the_explained_surface_is_outlined(session: Session, spec: str) -> None:
    """At once, and again by each other camera, until nothing is explained: light inside it, dark outside."""
    drawn(session)
    list(session.answer(Event("explain", 240, 180)))
    assert kinds(drawn(session)) == ["outline"]
    list(session.answer(Event("explain", 0, 0)))
    assert not pixels(drawn(session)[0]).any()
    list(session.answer(Event("explain", 240, 180)))
    session.handle(Event("orbit", 0.1))
    pictures = drawn(session)
    assert kinds(pictures) == ["moving", "exact", "outline", "smooth"]
    seen = cltrace.render(session.stage.scene.seen_by(session.camera), spec, outputs=("id",)).id == 0
    line = pixels(pictures[2])
    assert not line[~seen, :3].any()
    assert (line[seen & (line[..., 3] > 0), :3] == (255, 220, 0)).all()
    inner = seen[1:-1, 1:-1] & seen[:-2, 1:-1] & seen[2:, 1:-1] & seen[1:-1, :-2] & seen[1:-1, 2:]
    assert not line[1:-1, 1:-1][inner].any()
    assert (line[1:-1, 1:-1, 3][seen[1:-1, 1:-1] & ~inner] == 255).all()
    assert np.count_nonzero(line[..., 3]) > 100
    list(session.answer(Event("explain", 0, 0)))
    session.handle(Event("orbit", 0.1))
    assert kinds(drawn(session)) == ["moving", "exact", "smooth"]


def test_rays_of_an_explanation(spec: str) -> None:
    """From the eye to the point, from there to what blocks a light and on to the light, and all by the projection."""
    scene = cltrace.load(SCENES / "first.xml")
    session = Session(Stage(scene, choose(spec)))
    _, lines = session.answer(Event("explain", 710, 402))
    found = cltrace.explain(scene, 710, 402)
    told = json.loads(lines.text)
    assert told["count"] == len(told["lines"])
    first = told["lines"][0]
    assert (first["kind"], tuple(first["start"])) == ("primary", scene.camera.position)
    assert tuple(first["end"]) == found.rays[0].hit.point
    shadows = told["lines"][1:]
    blocked = [light for light in found.rays[0].lights if light.fate == "in shadow"]
    assert blocked, "the pixel is to be in a shadow"
    assert [line["kind"] for line in shadows].count("beyond") == len(blocked)
    (stopped, *_) = [line for line in shadows if line["kind"] == "in shadow"]
    assert tuple(stopped["end"]) == blocked[0].between[0].point
    state = drawn(session)[-1].state
    matrix = np.reshape(state["projection"], (3, 4))
    x, y, w = matrix @ [*found.rays[0].hit.point, 1]
    assert (x / w, y / w) == pytest.approx((710.5, 402.5))


def test_lines_have_an_end(spec: str) -> None:
    """Rays to the background and to parallel lights are as long as the way to what the camera looks at."""
    camera = cltrace.Orthographic((0, 0, 9), height=4, resolution=(9, 9))
    scene = cltrace.Scene.from_spheres(camera, [cltrace.parallel_light((0, -1, 0))], [(0, 0, 0)], 1)
    far, near = (list(lines_of(cltrace.explain(scene, x, 4), 5.0)) for x in (0, 4))
    assert kinds(far) == ["primary"]
    assert math.dist(far[0].start, far[0].end) == pytest.approx(5)
    assert kinds(near) == ["primary", "behind"]
    assert math.dist(near[1].start, near[1].end) == pytest.approx(5)


@pytest.mark.slow
def test_field_of_view(session: Session, stage: Stage, spec: str) -> None:
    """It is undone and copied as the camera is; an orthographic camera keeps it for later; reset has the scene's."""
    drawn(session)
    for degrees in (50, 60, 70):
        session.handle(Event("fov", degrees))
        session.draw()
    smooth = drawn(session)[-1]
    home = stage.scene.camera
    assert smooth.state["fov"] == 70
    assert session.camera == replace(home, horizontal_fov=35)
    assert 'horizontal_fov angle="35.0"' in next(session.answer(Event("copy", name="xml"))).text
    assert (pixels(smooth) == cltrace.render(stage.scene.seen_by(session.camera), spec, antialias=True).rgb8).all()
    for _ in range(2):
        session.handle(Event("parallel"))
        drawn(session)
    assert session.camera.horizontal_fov == 35
    for wrong in (0, 180, -1):
        session.handle(Event("fov", wrong))
        assert session.camera.horizontal_fov == 35
    session.handle(Event("reset"))
    assert session.camera.horizontal_fov == home.horizontal_fov
    drawn(session)
    for kind in ("back", "fit", "back"):
        session.handle(Event(kind))
    assert session.camera == home


def test_samples(session: Session, tmp_path: Path, spec: str) -> None:
    drawn(session)
    session.handle(Event("samples", 4))
    smooth = drawn(session)[-1]
    assert smooth.state["samples"] == 4
    assert smooth.data == command(tmp_path, "-d", spec, "--antialias", "--samples", "4")
    assert "samples=4" in next(session.answer(Event("copy", name="command"))).text
    session.handle(Event("samples", 5))
    assert session.samples == 4
    session.handle(Event("reset"))
    assert drawn(session)[-1].state["samples"] == 32


def test_lights(session: Session, stage: Stage, spec: str) -> None:
    """A dimmed one is in pictures and explanations, and no other window has it."""
    drawn(session)
    session.handle(Event("light", 1, 0.25))
    session.handle(Event("light", 0, 2))
    smooth = drawn(session)[-1]
    assert [share for _, share in smooth.state["lights"]] == [1, 0.25]
    assert "(line " in smooth.state["lights"][1][0]
    lights = stage.scene.lights.copy()
    lights["color"][1] *= 0.25
    dimmed = stage.scene.lit_by(lights)
    assert (pixels(smooth) == cltrace.render(dimmed, spec, antialias=True).rgb8).all()
    message = next(session.answer(Event("explain", 240, 180)))
    assert cltrace.explain(dimmed, 240, 180).rgb8 == cltrace.explain(session._seen(session.camera), 240, 180).rgb8
    assert f"{FILE}:" in message.text
    assert (pixels(drawn(Session(stage))[-1]) != pixels(smooth)).any()
    session.handle(Event("reset"))
    assert [share for _, share in drawn(session)[-1].state["lights"]] == [1, 1]


@pytest.mark.slow
def test_error(session: Session, spec: str) -> None:
    """White is 16 levels, of the smooth picture's error."""
    session.handle(Event("show", name="error"))
    exact = drawn(session)[-1]
    error = cltrace.render(session.stage.scene, spec, outputs=("error",), antialias=True).error
    assert (pixels(exact)[..., 0] == np.minimum(error * (255 / 16), 255).astype(np.uint8)).all()
    assert ", an estimate, " in exact.text
    assert f"the most is {error.max():.3g}" in exact.text
    assert exact.state["view"] == "error"


def test_a_click_says_what_is_wrong_there(spec: str) -> None:
    scene = cltrace.load(FILE)
    right = cltrace.render(scene, spec).rgb8
    mine = right.copy()
    mine[180, 240] = 0
    session = Session(Stage(scene, choose(spec), compare=lambda seen: cltrace.compare(seen, mine, device=spec)))
    wrong, same = (next(session.answer(Event("explain", 240, y))).text.split("\n") for y in (180, 181))
    assert wrong[1].startswith("the other picture has 0 0 0, which is wrong: look at ")
    assert same[1] == f"the other picture has {' '.join(map(str, right[181, 240]))}, which is right"
    session.handle(Event("light", 0, 0.5))
    assert "other picture" not in next(session.answer(Event("explain", 240, 180))).text
    session.handle(Event("reset"))
    session.handle(Event("orbit", 0.1))
    assert "other picture" not in next(session.answer(Event("explain", 240, 180))).text
