"""What all windows look at: a scene, and its renderers, which windows use in turn."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np

from cltrace.base.errors import CltraceError, printable
from cltrace.picture.image import LIT, SHOWS, Image, Output, Show
from cltrace.renderers.renderer import Renderer, samples_of
from cltrace.run.devices import Device
from cltrace.scene import Scene
from cltrace.students.comparison import Comparison
from cltrace.students.lit import lighting_by
from cltrace.viewer.film import Film, Frames

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

    options: arguments of Renderer for all pictures; smooth: those of the smooth ones alone; judge: compares another
    tracer's picture of a scene with the right one, None if there is none; film: a movie of the scene. scene: what is
    shown now; frames: the film's, or the scene alone; samples: rays a pixel of smooth pictures, 0 where these are
    proved; fault: what is wrong with a newer scene, "" for nothing; changed: what to call when scene or fault has
    changed; presses: how often a window wanted something. Raises what Renderer raises.
    """

    def __init__(
        self,
        scene: Scene,
        device: Device,
        options: dict[str, Any] | None = None,
        smooth: dict[str, Any] | None = None,
        judge: Callable[[Scene], Comparison] | None = None,
        film: Film | None = None,
    ) -> None:
        self.scene, self.device, self.judge, self.fault, self.presses = scene, device, judge, "", 0
        self.film = film or Film()
        self.frames = Frames(self.film, scene)
        self.changed = set[Callable[[], object]]()
        self.options, self.smooth = options or {}, smooth or {"antialias": True, "samples": None}
        self._renderers = dict[tuple[object, ...], Renderer]()
        self._resting: Renderer | None = None  # what draws a picture at rest now
        self._compared: tuple[Scene, Comparison] | None = None
        self.samples: int = samples_of(**self.smooth) or 0
        self._renderer(scene, "color", self.options, "rgb8")

    @property
    def name(self) -> str:
        """What windows call the scene."""
        return printable(self.scene.source.path) if self.scene.source else "scene"

    def follow(self, read: Callable[[], Scene]) -> None:
        """Shows the scene that is read, or what is wrong with it over the last one. Another thread may draw."""
        try:
            self.scene, self.fault = read(), ""
            self.frames = Frames(self.film, self.scene)
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

    def draw(self, scene: Scene, view: str, phase: Phase, closed: Callable[[], bool], samples: int = 0) -> Drawn:
        """A scene, such as one of the frames. Only one thread may call it.

        view: of VIEWS; closed: whether the window is; samples: of smooth pictures, 0 for what the stage says. Raises
        OverError where the picture is not wanted any more, and what Renderer and lighting_by() raise.
        """
        presses = self.presses
        smooth = self.options | self.smooth | ({"samples": samples} if samples else {})

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
        if self.judge and (self._compared is None or self._compared[0] is not scene):
            self._compared = scene, self.judge(scene)
        return self._compared[1] if self._compared else None


def _errors(image: Image) -> Drawn:
    """How far off the colours of a smooth picture are, as grey."""
    error = image.error
    grey = np.minimum(error * (255 / WHITE), 255).astype(np.uint8)
    legend = f"white is {WHITE} levels of 255 or more, the most is {error.max():.3g}, the mean {error.mean():.3g}"
    return Drawn(Image(rgb8=np.repeat(grey[..., None], 3, axis=2)), legend=legend, seconds=image.frame_seconds)
