"""What all windows look at: a scene, the movie of it, and its renderers, which windows use in turn."""

from __future__ import annotations

import io
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from cltrace.base.errors import CltraceError, printable
from cltrace.movie.animate import FPS
from cltrace.movie.frames import frames_of
from cltrace.picture.image import LIT, SHOWS, Image, Output, Show
from cltrace.plan.request import Request
from cltrace.renderers.renderer import SAMPLES, Renderer
from cltrace.run.devices import Device
from cltrace.scene import Scene
from cltrace.scene.rules import is_whole
from cltrace.students.comparison import Comparison
from cltrace.students.lit import lighting_by

# Raises where a movie is not wanted any more.
Check = Callable[[], None]


@dataclass(frozen=True)
class Film:
    """A movie.

    items: what its frames show of a scene, as animate() takes them; count: how many there are; fps: frames a second;
    file: where write() writes it, which calls what it is given for each frame; "" if nowhere.
    """

    items: Callable[[Scene], Iterable[object]] = lambda scene: [scene]
    count: int = 1
    fps: float = FPS
    file: str = ""
    write: Callable[[Check], object] = lambda check: None


def film_of(
    frames: Sequence[object] | Callable[[int], object],
    count: int | None,
    output: str | os.PathLike[str] | None,
    fps: float,
    animate: Callable[..., object],
) -> Film:
    """The film of these arguments of view(). animate: writes frames to an output. Raises TypeError and ValueError."""
    if callable(frames):
        if not is_whole(count) or (count or 0) < 1:
            raise ValueError(f"count: must be how many frames the function makes, 1 at least, got {count!r}")
    elif not isinstance(frames, Sequence) or isinstance(frames, str) or not frames:
        raise TypeError(f"frames: must be a list of frames, at least one, or a function of a number, got {frames!r}")
    elif count is not None:
        raise ValueError(f"count: goes with a function of a frame's number, got {count!r}")
    number = int(count or 0) if callable(frames) else len(frames)

    def items(check: Check = lambda: None) -> Iterator[Any]:
        for k in range(number):
            check()
            yield frames(k) if callable(frames) else frames[k]

    file = "" if output is None else os.fspath(output)
    return Film(lambda scene: items(), number, fps, file, lambda check: animate(items(check), file))


class Frames:
    """The scenes of a film's frames, each made when it is first asked for, after those before it: a frame is what it
    changes of the last one. Several threads may ask."""

    def __init__(self, film: Film, scene: Scene) -> None:
        self._coming, self._count = frames_of(film.items(scene), scene), film.count
        self._there, self._fault, self._lock = list[Scene](), "", threading.Lock()

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, number: int) -> Scene:
        """Raises ValueError where a frame, or one before it, cannot be."""
        with self._lock:
            while len(self._there) <= number and not self._fault:
                try:
                    self._there.append(next(self._coming).scene)
                except StopIteration:
                    self._fault = f"frames: there are only {len(self._there)}"
                except Exception as error:  # of the user's function, too
                    words = isinstance(error, (CltraceError, TypeError, ValueError))
                    self._fault = str(error) if words else f"frames[{len(self._there)}]: {error!r}"
            if len(self._there) <= number:
                raise ValueError(self._fault)
            return self._there[number]


# Renderers that are kept, as they have the scene on the device.
KEPT = 4
# What a window can show: outputs, and which lights reach what, and how far off the smooth picture is.
ERROR = "error"
VIEWS: tuple[str, ...] = (*SHOWS, LIT, ERROR)
# Levels of 255 that `error` shows as white.
WHITE = 16
# Which picture comes next: a small one while it moves, then the exact one, then the smooth one. Where a surface is
# explained, its outline comes after the exact one.
Phase = Literal["moving", "exact", "outline", "smooth", "done"]


class OverError(Exception):
    """The picture that is being drawn is not wanted any more."""


class Drawn(NamedTuple):
    """A picture, what of it is shown, what its colours stand for, in words, and the seconds that its pixels took."""

    image: Image
    show: Show = "color"
    legend: str = ""
    seconds: float = 0.0

    def file(self, suffix: str) -> bytes:
        """The file of it, in the format of the suffix."""
        file = io.BytesIO()
        self.image.write(file, suffix, self.show)
        return file.getvalue()


class Stage:
    """A scene that may change, on a device.

    options: arguments of Renderer for all pictures; samples: rays a pixel of the smooth ones; compare: compares another
    tracer's picture of a scene with the right one, None if there is none; film: a movie of the scene. scene: what is
    shown now; frames: the film's, or the scene alone; fault: what is wrong with a newer scene, "" for nothing; changed:
    what to call when scene or fault has changed; presses: how often a window wanted something. Raises what Renderer
    raises.
    """

    def __init__(
        self,
        scene: Scene,
        device: Device,
        options: dict[str, Any] | None = None,
        samples: int | None = None,
        compare: Callable[[Scene], Comparison] | None = None,
        film: Film | None = None,
    ) -> None:
        self.scene, self.device, self.compare, self.fault, self.presses = scene, device, compare, "", 0
        self.film = film or Film()
        self.frames = Frames(self.film, scene)
        self.changed = set[Callable[[], object]]()
        self.options, self.samples = options or {}, SAMPLES if samples is None else samples
        Request(samples=self.samples)  # which refuses other numbers
        self._renderers = dict[tuple[object, ...], Renderer]()
        self._resting: Renderer | None = None  # what draws a picture at rest now
        self._compared: tuple[Scene, Comparison] | None = None
        self._renderer(scene, "color", self.options, "rgb8")

    @property
    def name(self) -> str:
        """What windows call the scene."""
        return printable(self.scene.source.path) if self.scene.source else "scene"

    def follow(self, read: Callable[[], Scene]) -> None:
        """Shows the scene that is read, or what is wrong with it over the last one. Another thread may draw."""
        try:
            scene = read()
            self.frames, self.scene, self.fault = Frames(self.film, scene), scene, ""
        except CltraceError as error:
            self.fault = str(error)
            raise
        finally:
            for tell in self.changed.copy():
                tell()

    def press(self) -> None:
        """A window wants something: what is drawn at rest, for any of them, ends, and is drawn again later."""
        self.presses += 1
        if resting := self._resting:
            resting.stop()

    def draw(self, scene: Scene, view: str, phase: Phase, closed: Callable[[], bool], samples: int) -> Drawn:
        """A scene, such as one of the frames. Only one thread may call it.

        view: of VIEWS; closed: whether the window is; samples: of smooth pictures. Raises OverError where the picture
        is not wanted any more, and what Renderer and lighting_by() raise.
        """
        presses = self.presses
        smooth = self.options | {"antialias": True, "samples": samples}

        def drawn(_: int) -> None:
            if closed() or (phase != "moving" and presses != self.presses):
                raise OverError

        def image(seen: Scene, how: dict[str, Any], *outputs: Output) -> Image:
            renderer = self._renderer(seen, view, how, *outputs)
            self._resting = None if phase == "moving" else renderer
            try:
                return renderer.draw(drawn)
            finally:
                self._resting = None

        if view == LIT:
            start, how = time.perf_counter(), {"precision": self.options.get("precision")}
            lit = lighting_by(scene, lambda some: image(some, how, "id", "color"))
            seconds = time.perf_counter() - start
            return Drawn(Image(rgb8=lit.as_rgb8()), legend="; ".join(lit.legend()), seconds=seconds)
        if view == ERROR:
            return _errors(image(scene, smooth, "error"))
        show: Show = next(show for show in SHOWS if show == view)
        found = image(scene, smooth if phase == "smooth" else self.options, "rgb8" if show == "color" else show)
        return Drawn(found, show, seconds=found.frame_seconds)

    def _renderer(self, scene: Scene, view: str, how: dict[str, Any], *outputs: Output) -> Renderer:
        """What draws it, made from the last one of its kind, with which it shares what is the same.

        how: options, of which only the samples may be others than before.
        """
        kind = view, how.get("antialias"), how.get("samples")
        if before := self._renderers.pop(kind, None):
            renderer = before.following(scene)
        else:
            renderer = Renderer(scene, self.device, outputs=outputs, **how)
        self._renderers[kind] = renderer
        if len(self._renderers) > KEPT:
            del self._renderers[next(iter(self._renderers))]
        return renderer

    def compared(self) -> Comparison | None:
        """The other tracer's picture beside the right one, if there is one. Raises what compare() raises."""
        scene = self.scene
        if self.compare and (self._compared is None or self._compared[0] is not scene):
            self._compared = scene, self.compare(scene)
        return self._compared[1] if self._compared else None


def _errors(image: Image) -> Drawn:
    """How far off the colours of a smooth picture are, as grey."""
    error = image.error
    grey = np.minimum(error * (255 / WHITE), 255).astype(np.uint8)
    legend = f"white is {WHITE} levels of 255 or more, the most is {error.max():.3g}, the mean {error.mean():.3g}"
    return Drawn(Image(rgb8=np.repeat(grey[..., None], 3, axis=2)), legend=legend, seconds=image.frame_seconds)
