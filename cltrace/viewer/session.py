"""One window: its camera, what it shows, and what comes next. It knows no network."""

from __future__ import annotations

import shlex
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path

from cltrace.base.errors import CltraceError, located
from cltrace.explanation.pixel import explain
from cltrace.picture.image import Image
from cltrace.rays import trace_rays
from cltrace.scene import AnyCamera, Camera
from cltrace.students.comparison import Comparison
from cltrace.viewer import cameras
from cltrace.viewer.messages import Event, Message
from cltrace.viewer.stage import VIEWS, Drawn, OverError, Phase, Stage

AFTER: dict[Phase, Phase] = {"moving": "exact", "exact": "smooth", "smooth": "done", "done": "done"}
# Seconds that the pixels of a moving picture may take, and by what its sides are divided at most.
PACE, SMALLEST = 1 / 60, 4
# Cameras that can be gone back to.
UNDO = 1000
MOVES: dict[str, Callable[[AnyCamera, float, float], AnyCamera]] = {
    "orbit": cameras.orbit,
    "pan": cameras.pan,
    "zoom": cameras.zoom,
}


class Session:
    """A window on a stage.

    phase: which picture comes next; view: what it shows, of VIEWS; closed: whether the window is. One thread may tell
    it what happens while another one draws, and a third one answers.
    """

    def __init__(self, stage: Stage) -> None:
        self.stage, self.view, self.closed = stage, "color", False
        self.phase: Phase = "exact"
        self._scene = stage.scene
        self.camera = self._scene.camera
        self._undo, self._count, self._divisor = deque[AnyCamera](maxlen=UNDO), 0, 2
        self._rested = True  # whether the exact picture of this camera was there
        self._lock = threading.Lock()

    def handle(self, event: Event) -> None:
        """Does what needs no time. What cannot be done changes nothing."""
        if event.kind == "undo":
            if self._undo:
                self._go(self._undo.pop(), remember=False)
        elif event.kind == "show" and event.name in VIEWS:
            self.view = event.name
            self._go(self.camera, remember=False)
        else:
            try:
                self._go(self._moved(event))
            except (ValueError, OverflowError):  # as where a camera would be in what it looks at
                return

    def refresh(self) -> None:
        """The scene may be another one. A camera that was not moved is then the new one's."""
        if self._scene is self.stage.scene:
            return
        before, self._scene = self._scene.camera, self.stage.scene
        self._go(self._scene.camera if self.camera == before else self.camera, remember=False)
        self.phase = "exact"

    def reopen(self) -> None:
        """It begins, or goes on after close() with the camera that it had."""
        self.closed = False
        self.refresh()
        self.phase = "exact"

    def close(self) -> None:
        """What is being drawn for it ends."""
        self.closed = True
        self.stage.press()

    def draw(self) -> Message | None:
        """The next picture; None where it is not wanted any more, before it is there."""
        phase, count = self.phase, self._count
        if phase == "done":
            return None
        moving = phase == "moving"
        camera, home = self.camera, self.camera == self._scene.camera
        try:
            seen = cameras.reduced(camera, self._divisor) if moving else camera
            picture = self.stage.draw(seen, self.view, phase, lambda: self.closed)
        except OverError:
            return None
        except (CltraceError, ValueError, MemoryError) as error:
            self._done(count, "done")
            return Message("error", str(error) or "not enough memory")
        data = picture.file(".jpg" if moving else ".png")
        if moving:
            self._divisor = next_divisor(self._divisor, picture.seconds)
        self._done(count, AFTER[phase] if moving or self.view == "color" else "done")
        width, height = camera.resolution
        text = self._caption(picture, phase)
        return Message(phase, text, data, width=width, height=height, number=count, home=home)

    def answer(self, event: Event) -> Iterator[Message]:
        """What is asked for, which may take long."""
        try:
            if event.kind == "explain":
                yield Message("explanation", self._explained(int(event.x), int(event.y)))
            elif event.kind == "centre":
                self._centre(int(event.x), int(event.y))
            elif event.kind == "copy":
                yield Message("copy", self._copied(event.name))
            elif found := self.stage.compared():
                yield from _compared(found)
        except (CltraceError, ValueError) as error:
            yield Message("error", str(error))

    def _go(self, camera: AnyCamera, remember: bool = True) -> None:
        """Another camera, with the scene's size, or another picture of the same one.

        remember: whether undo leads back from it.
        """
        home = self._scene.camera
        camera = replace(camera, resolution=home.resolution, max_bounces=home.max_bounces)
        with self._lock:
            if remember and self._rested:  # once for a way of the pointer
                self._undo.append(self.camera)
            self._rested = self._rested and not remember
            self.camera, self.phase, self._count = camera, "moving", self._count + 1
        self.stage.press()

    def _done(self, count: int, phase: Phase) -> None:
        """A picture is there that counts so many events; if there were no more, the next phase begins."""
        with self._lock:
            if count == self._count:
                self.phase, self._rested = phase, self._rested or phase != "exact"

    def _moved(self, event: Event) -> AnyCamera:
        """The camera after an event. Raises ValueError where there is none."""
        home = self._scene.camera
        match event.kind:
            case "orbit" | "pan" | "zoom":
                return MOVES[event.kind](self.camera, event.x, event.y)
            case "fit":
                return cameras.fit(self._scene.seen_by(self.camera))
            case "parallel":
                return cameras.other_kind(self.camera, home if isinstance(home, Camera) else Camera())
            case "back":
                return home
        raise ValueError(f"{event.kind} moves no camera")

    def _caption(self, picture: Drawn, phase: Phase) -> str:
        """What a picture at rest is, in words."""
        size = "{}x{}".format(*self.camera.resolution)
        parts = (self.view, size, phase, f"on {self.stage.device.name}", picture.legend)
        return f"{self.stage.name}: {', '.join(filter(None, parts))}"

    def _explained(self, x: int, y: int) -> str:
        """Why a pixel has its colour; before that, the line of the scene's file where its surface is."""
        found = explain(self.stage.scene.seen_by(self.camera), x, y, truncate=self.stage.options.get("truncate", False))
        hit = found.rays[0].hit
        return "\n".join([found.line, *_line_of(found.path, hit.surface.line if hit else 0), "", str(found)])

    def _centre(self, x: int, y: int) -> None:
        """Looks at what a pixel shows, if that is a surface."""
        hits = trace_rays(self.stage.scene, *cameras.ray(self.camera, x, y))
        if hits.id[0] >= 0:
            self._go(cameras.centre(self.camera, hits.point[0]))

    def _copied(self, form: str) -> str:
        """The camera as text. Raises ValueError where there is no such form of it."""
        if form == "xml":
            return cameras.as_xml(self.camera)
        if form == "python":
            return cameras.as_python(self.camera)
        source, options = self.stage.scene.source, {"antialias": True} | self.stage.options | self.stage.smooth
        if form != "command" or source is None:
            raise ValueError(f"there is no {form!r} of this camera")
        how = "".join(f", {name}={value!r}" for name, value in options.items() if value)
        look = f"cltrace.load({source.path!r}).seen_by({cameras.as_python(self.camera)})"
        program = f"import cltrace; cltrace.render({look}{how}).save('view.png')"
        return f"python -c {shlex.quote(program)}"


def _compared(found: Comparison) -> Iterator[Message]:
    """The other tracer's picture, the difference, and what explains it."""
    width = found.mine.shape[1]
    mine, difference = (
        Drawn(Image(rgb8=pixels)).file(".png") for pixels in (found.mine, found.side_by_side()[:, -width:])
    )
    yield Message("mine", data=mine)
    yield Message("difference", data=difference)
    yield Message("comparison", str(found))


def next_divisor(divisor: int, seconds: float) -> int:
    """By what the sides of the next moving picture are divided: by less where that would keep the pace, too.

    seconds: what the pixels of the last one took, with this divisor.
    """
    if seconds > PACE:
        return min(divisor + 1, SMALLEST)
    finer = divisor > 1 and seconds * (divisor / (divisor - 1)) ** 2 <= PACE
    return divisor - 1 if finer else divisor


def _line_of(path: str, line: int) -> Iterator[str]:
    """A line of a scene's file, with its number, if that is known and it is there."""
    if not line:
        return
    with suppress(OSError), Path(path).open(encoding="utf-8", errors="replace") as file:
        for text in islice(file, line - 1, line):
            yield located(path, line, text.strip())
