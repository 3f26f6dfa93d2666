"""One window: its camera, its lights, what it shows, what comes next, and when that is drawn. It knows no network."""

from __future__ import annotations

import asyncio
import math
import shlex
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import CltraceError, located
from cltrace.explanation.explanation import Explanation
from cltrace.explanation.pixel import explain
from cltrace.explanation.words import Names, light
from cltrace.picture.image import Image
from cltrace.plan.request import LATTICES
from cltrace.renderers.rays import trace_rays
from cltrace.scene import AnyCamera, Camera, Scene
from cltrace.students.comparison import Comparison, look_at
from cltrace.viewer import cameras
from cltrace.viewer.messages import Event, Message, Questions, as_json
from cltrace.viewer.stage import ERROR, VIEWS, Drawn, OverError, Phase, Stage

# A window lists no more lights.
LISTED = 8


class Lights:
    """How bright each light is, as a share of what the scene says: 1 unless it is dimmed."""

    def __init__(self) -> None:
        self._strengths = dict[int, float]()
        self._last: tuple[Scene, dict[int, float], Scene] | None = None

    def dim(self, number: int, strength: float) -> bool:
        """Whether there is such a strength, which the light then has."""
        there = 0 <= number < LISTED and 0 <= strength <= 1
        if there:
            self._strengths = self._strengths | {number: strength}
        return there

    def on(self, scene: Scene) -> Scene:
        """A scene in these lights: the same one where none is dimmed, and else the same one each time."""
        strengths = {number: share for number, share in self._strengths.items() if number < len(scene.lights)}
        if all(share == 1 for share in strengths.values()):
            return scene
        if self._last is None or self._last[0] is not scene or self._last[1] != strengths:
            lights = scene.lights.copy()
            for number, share in strengths.items():
                for name in ("color", "below"):
                    lights[name][number] *= share
            dimmed = scene.lit_by(lights)
            self._last = scene, strengths, dimmed.changed(source=scene.source)
        return self._last[2]

    def listed(self, scene: Scene) -> tuple[tuple[str, float], ...]:
        """The name and the strength of each light; none where there are many."""
        if len(scene.lights) > LISTED:
            return ()
        names = Names(scene)
        return tuple((light(names.light(k)), self._strengths.get(k, 1.0)) for k in range(len(scene.lights)))

    @property
    def as_python(self) -> str:
        """What a program does to the lights of its `scene`; "" where that is nothing."""
        dimmed = [(number, share) for number, share in self._strengths.items() if share != 1]
        if not dimmed:
            return ""
        changes = "".join(f"lights[{name!r}][{k}] *= {s!r}; " for k, s in dimmed for name in ("color", "below"))
        return f"lights = scene.lights.copy(); {changes}scene = scene.lit_by(lights); "


# Seconds that the pixels of a moving picture and its JPEG may take, and by what its sides are divided at most. A page
# takes about as long again to show one.
PACE, SMALLEST = 1 / 100, 4
# What no pixel's id is.
NOTHING = -2
# Cameras that can be gone back to.
UNDO = 1000
Drag = Callable[[AnyCamera, float, float], AnyCamera]
DRAGS: dict[str, Drag] = {"orbit": cameras.orbit, "pan": cameras.pan, "zoom": cameras.zoom}


class Session:
    """A window on a stage.

    phase: which picture comes next; view: what it shows, of VIEWS; frame: of the movie; samples: of a pixel; closed:
    whether the window is. One thread may tell it what happens while another one draws, and others answer.
    """

    def __init__(self, stage: Stage) -> None:
        self.stage, self.view, self.closed, self.frame, self.samples = stage, "color", False, 0, stage.samples
        self.phase: Phase = "exact"
        self._scene, self._frames, self._lights = stage.scene, stage.frames, Lights()
        self.camera = self._scene.camera
        self._pinhole = self.camera if isinstance(self.camera, Camera) else Camera(resolution=(1, 1), max_bounces=0)
        self._explained = NOTHING  # the surface that is outlined
        self._rest: Phase = "smooth"  # what comes after the outline
        self._undo, self._count, self._divisor = deque[AnyCamera](maxlen=UNDO), 0, 2
        self._rested = True  # whether the exact picture of this camera was there
        self._lock = threading.Lock()

    def handle(self, event: Event) -> None:
        """Does what needs no time. What cannot be done changes nothing."""
        camera, home, looked = self.camera, self._scene.camera, True
        try:
            match event.kind:
                case "orbit" | "pan" | "zoom":
                    camera = DRAGS[event.kind](camera, event.x, event.y)
                case "fit":
                    camera = cameras.fit(self._scene.seen_by(camera))
                case "parallel":
                    camera = cameras.other_kind(camera, self._pinhole)
                case "fov":
                    camera = cameras.opened(camera, event.x)
                case "back":
                    camera = home
                case "reset":
                    self.samples, self._lights = self.stage.samples, Lights()
                    camera = cameras.opened(camera, 2 * home.horizontal_fov) if isinstance(home, Camera) else camera
                case "undo" if self._undo:
                    camera, looked = self._undo.pop(), False
                case "show" if event.name in VIEWS:
                    self.view, looked = event.name, False
                case "samples" if event.x in LATTICES:
                    self.samples, looked = int(event.x), False
                case "light" if self._lights.dim(int(event.x), event.y):
                    looked = False
                case "frame" if 0 <= event.x < len(self._frames):
                    self.frame, looked = int(event.x), False
                case _:
                    return
        except (ValueError, OverflowError):  # as where a camera would be in what it looks at
            return
        self._go(camera, looked and camera != self.camera)

    def refresh(self) -> None:
        """The scene may be another one."""
        if self._frames is self.stage.frames:
            return
        with self._lock:
            self._frames, self.phase, self._count = self.stage.frames, "exact", self._count + 1
        self.stage.press()

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
        moving, outline, explained = phase == "moving", phase == "outline", self._explained
        try:
            self._follow()
            camera, home = self.camera, self.camera == self._scene.camera
            scene = self._seen(cameras.reduced(camera, self._divisor) if moving else camera)
            view = "id" if outline else self.view
            picture = self.stage.draw(scene, view, phase, lambda: self.closed, self.samples)
        except OverError:
            return None
        except (CltraceError, ValueError, MemoryError) as error:
            self._done(count, "done")
            return Message("error", str(error) or "not enough memory")
        self._done(count, self._after(phase))
        if outline:
            return Message(phase, data=_around(picture.image.id == explained), number=count)
        start = time.perf_counter()
        data = picture.file(".jpg" if moving else ".png")
        if moving:
            self._divisor = next_divisor(self._divisor, picture.seconds + time.perf_counter() - start)
        width, height = camera.resolution
        text, state = self._caption(picture, phase), self._state(camera)
        return Message(phase, text, data, width=width, height=height, number=count, home=home, state=state)

    def answer(self, event: Event) -> Iterator[Message]:
        """What is asked for, which may take long."""
        try:
            if event.kind == "explain":
                yield from self._explain(int(event.x), int(event.y))
            elif event.kind == "centre":
                self._centre(int(event.x), int(event.y))
            elif event.kind == "copy":
                yield Message("copy", self._copied(event.name))
            elif event.kind == "write":
                yield from self._written()
            elif found := self.stage.compared():
                yield from _compared(found)
        except OverError:
            return
        except (CltraceError, ValueError, OSError) as error:
            yield Message("error", str(error))

    def _go(self, camera: AnyCamera, remember: bool = True) -> None:
        """Another camera, with the scene's size, or another picture of the same one.

        remember: whether undo leads back from it.
        """
        home = self._scene.camera
        camera = replace(camera, resolution=home.resolution, max_bounces=home.max_bounces)
        with self._lock:
            if remember and self._rested:  # once for each drag
                self._undo.append(self.camera)
            self._rested = self._rested and not remember
            self._pinhole = camera if isinstance(camera, Camera) else self._pinhole
            self.camera, self.phase, self._count = camera, "moving", self._count + 1
        self.stage.press()

    def _done(self, count: int, phase: Phase) -> None:
        """A picture is there that counts so many events; if there were no more, the next phase begins."""
        with self._lock:
            if count == self._count:
                self.phase, self._rested = phase, self._rested or phase != "exact"

    def _after(self, phase: Phase) -> Phase:
        """What comes after a picture."""
        if phase == "exact":
            self._rest = "smooth" if self.view == "color" else "done"
            return self._rest if self._explained == NOTHING else "outline"
        after: dict[Phase, Phase] = {"moving": "exact", "outline": self._rest}
        return after.get(phase, "done")

    def _follow(self) -> None:
        """Takes the scene of the frame. A camera that was not moved is then the new one's."""
        scene = self._frames[self.frame]
        with self._lock:
            if scene is not self._scene:
                before, self._scene = self._scene.camera, scene
                camera = scene.camera if self.camera == before else self.camera
                home = scene.camera
                self.camera = replace(camera, resolution=home.resolution, max_bounces=home.max_bounces)

    def _seen(self, camera: AnyCamera) -> Scene:
        """The scene in this window's lights, seen by a camera."""
        return self._lights.on(self._scene).seen_by(camera)

    def _state(self, camera: AnyCamera) -> dict[str, Any]:
        """What the controls show.

        view: which button is on; projection: from the world to the picture, see cameras.projection(); fov: the whole
        opening angle, degrees, 0 of parallel rays; samples: rays a pixel of the smooth picture; lights: name and
        strength of each, none where they are many; frame, frames: which one of how many; fps: frames a second; file: of
        the movie, "" for none.
        """
        fov = 2 * camera.horizontal_fov if isinstance(camera, Camera) else 0.0
        film, lights = self.stage.film, self._lights.listed(self._scene)
        state = {"view": self.view, "projection": cameras.projection(camera), "fov": fov, "samples": self.samples}
        return state | {"lights": lights, "frame": self.frame, "frames": film.count, "fps": film.fps, "file": film.file}

    def _caption(self, picture: Drawn, phase: Phase) -> str:
        """What a picture at rest is, in words."""
        size = "{}x{}".format(*self.camera.resolution)
        how = phase if self.view != ERROR else "an estimate"
        parts = (self.view, size, how, f"on {self.stage.device.name}", picture.legend)
        return f"{self.stage.name}: {', '.join(filter(None, parts))}"

    def _explain(self, x: int, y: int) -> Iterator[Message]:
        """Why a pixel has its colour; before that, the line of the scene's file where its surface is, and what is wrong
        there with the picture of --compare. Its surface is outlined from now on."""
        camera = self.camera
        found = explain(self._seen(camera), x, y, truncate=self.stage.options.get("truncate", False))
        hit = found.rays[0].hit
        told = [*self._beside(found), *_line_of(found.path, hit.surface.line if hit else 0)]
        yield Message("explanation", "\n".join([found.line, *told, "", str(found)]))
        yield Message("lines", as_json(found, reach=math.dist(camera.position, camera.lookat)))
        with self._lock:
            self._explained = hit.surface.id if hit else NOTHING
            if self.phase in ("outline", "smooth", "done"):  # also where another one is being outlined
                self._rest = self._rest if self.phase == "outline" else self.phase
                self.phase, self._count = "outline", self._count + 1

    def _beside(self, found: Explanation) -> Iterator[str]:
        """What the picture of --compare has there, if it is of the same camera, lights and size."""
        scene = self.stage.scene
        if self.camera != scene.camera or self._lights.on(self._scene).lights is not scene.lights:
            return
        compared = self.stage.compared()
        if compared and compared.mine.shape[1::-1] == (found.width, found.height):
            mine = tuple(compared.mine[found.y, found.x].tolist())
            wrong = compared.error[found.y, found.x] > compared.tolerance
            advice = f"wrong: look at {look_at(found, mine)}" if wrong else "right"
            yield f"the other picture has {' '.join(map(str, mine))}, which is {advice}"

    def _written(self) -> Iterator[Message]:
        """Writes the movie, unless the window is closed meanwhile."""
        film = self.stage.film

        def check() -> None:
            if self.closed:
                raise OverError

        if film.file:
            yield Message("said", f"{film.file} is being written")
            film.write(check)
            yield Message("said", f"{film.file} is written")

    def _centre(self, x: int, y: int) -> None:
        """Looks at what a pixel shows, if that is a surface."""
        hits = trace_rays(self._scene, *cameras.ray(self.camera, x, y))
        if hits.id[0] >= 0:
            self._go(cameras.centre(self.camera, hits.point[0]))

    def _copied(self, form: str) -> str:
        """The camera as text. Raises ValueError where there is no such form of it."""
        if form == "xml":
            return cameras.as_xml(self.camera)
        python = f"cltrace.{self.camera!r}"
        if form == "python":
            return python
        source, options = self._scene.source, {"antialias": True, "samples": self.samples} | self.stage.options
        if form != "command" or source is None:
            raise ValueError(f"there is no {form!r} of this camera")
        how = "".join(f", {name}={value!r}" for name, value in options.items() if value)
        look = f"cltrace.load({source.path!r}).seen_by({python})"
        program = f"import cltrace; scene = {look}; {self._lights.as_python}cltrace.render(scene{how}).save('view.png')"
        return f"python -c {shlex.quote(program)}"


def _around(seen: NDArray[np.bool_]) -> bytes:
    """A PNG of (h, w) pixels: a light line inside what is seen and a dark one outside, and nothing elsewhere."""
    pixels = np.zeros((*seen.shape, 4), np.uint8)
    for some, color in ((seen, (255, 220, 0, 255)), (~seen, (0, 0, 0, 255))):
        near = np.pad(some, 1, mode="edge")
        whole = near[:-2, 1:-1] & near[2:, 1:-1] & near[1:-1, :-2] & near[1:-1, 2:]
        pixels[some & ~whole] = color
    return Drawn(Image(rgba8=pixels)).file(".png")


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

    seconds: what the pixels of the last one and its JPEG took, with this divisor.
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


# Seconds without an event after which the exact picture is drawn.
REST = 0.12


class SessionRunner:
    """A session's pictures and answers, which are sent while events come.

    send: takes a message to the window; draws: a thread, for pictures; answers: two, one of which may write a movie. A
    picture is drawn when the one before it is on the screen: none waits anywhere, and each shows what is newest.
    """

    def __init__(
        self, session: Session, send: Callable[[Message], Awaitable[None]], draws: Executor, answers: Executor
    ) -> None:
        self._stage, self._session, self._send = session.stage, session, send
        self._draws, self._answers, self._loop = draws, answers, asyncio.get_running_loop()
        self._woken, self._shown = asyncio.Event(), asyncio.Event()
        self._shown.set()

    async def live(self, events: AsyncIterator[Event]) -> None:
        """Until there are no more events. Raises what `events` raises."""
        changed = partial(self._loop.call_soon_threadsafe, self._changed)
        self._stage.changed.add(changed)
        tasks = {asyncio.create_task(self._tell_fault()), asyncio.create_task(self._draw())}
        try:
            async for event in events:
                if event.kind == "shown":
                    self._shown.set()
                elif event.kind in get_args(Questions):
                    tasks.add(task := asyncio.create_task(self._answer(event)))
                    task.add_done_callback(tasks.discard)
                else:
                    self._session.handle(event)
                    self._woken.set()
        finally:
            self._stage.changed.discard(changed)
            self._session.close()
            for task in tasks:
                task.cancel()

    def _changed(self) -> None:
        """The scene, or what is wrong with it, is another one."""
        self._session.refresh()
        self._woken.set()
        self._told = asyncio.create_task(self._tell_fault())

    async def _tell_fault(self) -> None:
        await self._send(Message("fault", self._stage.fault))

    async def _draw(self) -> None:
        """Draws one picture after the other, as long as there is something new to see."""
        while True:
            await self._shown.wait()
            with suppress(TimeoutError):
                wait = {"moving": 0.0, "done": None}.get(self._session.phase, REST)
                await asyncio.wait_for(self._woken.wait(), wait)
            self._woken.clear()
            message = await self._loop.run_in_executor(self._draws, self._session.draw)
            if message:
                if message.data:  # of an error, no page says that it is on the screen
                    self._shown.clear()
                await self._send(message)

    async def _answer(self, event: Event) -> None:
        """Answers a question."""
        answers = self._session.answer(event)
        while message := await self._loop.run_in_executor(self._answers, next, answers, None):
            await self._send(message)
        self._woken.set()
