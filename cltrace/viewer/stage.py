"""What all windows look at: a scene, and its renderers, which windows use in turn."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

from cltrace.base.errors import CltraceError, printable
from cltrace.picture.image import LIT, SHOWS, Image, Output, Show
from cltrace.renderers.renderer import Renderer, means_of
from cltrace.run.devices import Device
from cltrace.scene import AnyCamera, Scene
from cltrace.students.comparison import Comparison
from cltrace.students.lit import lighting

# Renderers that are kept, as they have the scene on the device.
KEPT = 4
# What a window can show.
VIEWS: tuple[str, ...] = (*SHOWS, LIT)
# Which picture comes next: a small one while it moves, then the exact one, then the smooth one.
Phase = Literal["moving", "exact", "smooth", "done"]


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
    tracer's picture of a scene with the right one, None if there is none. scene: what is shown now; fault: what is
    wrong with a newer one, "" for nothing; changed: what to call when either has changed; presses: how often a window
    wanted something. Raises what Renderer raises.
    """

    def __init__(
        self,
        scene: Scene,
        device: Device,
        options: dict[str, Any] | None = None,
        smooth: dict[str, Any] | None = None,
        judge: Callable[[Scene], Comparison] | None = None,
    ) -> None:
        self.scene, self.device, self.judge, self.fault, self.presses = scene, device, judge, "", 0
        self.changed = set[Callable[[], object]]()
        self.options, self.smooth = options or {}, smooth or {"antialias": True, "samples": None}
        self._renderers = dict[tuple[str, bool], Renderer]()
        self._resting: Renderer | None = None  # what draws a picture at rest now
        self._compared: tuple[Scene, Comparison] | None = None
        means_of(**self.smooth)
        self._renderer(scene, "color", False)

    @property
    def name(self) -> str:
        """What windows call the scene."""
        return printable(self.scene.source.path) if self.scene.source else "scene"

    def follow(self, read: Callable[[], Scene]) -> None:
        """Shows the scene that is read, or what is wrong with it over the last one. Another thread may draw."""
        try:
            self.scene, self.fault = read(), ""
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

    def draw(self, camera: AnyCamera, view: str, phase: Phase, closed: Callable[[], bool]) -> Drawn:
        """The scene, seen by a camera. Only one thread may call it.

        view: of VIEWS; closed: whether the window is. Raises OverError where the picture is not wanted any more, and
        what Renderer and lighting() raise.
        """
        scene, presses = self.scene.seen_by(camera), self.presses
        if view == LIT:
            start = time.perf_counter()
            found = lighting(scene, self.device, self.options.get("precision"))
            seconds = time.perf_counter() - start
            return Drawn(Image(rgb8=found.as_rgb8()), legend="; ".join(found.legend()), seconds=seconds)
        show: Show = next(show for show in SHOWS if show == view)
        renderer = self._renderer(scene, show, phase == "smooth")

        def drawn(_: int) -> None:
            if closed() or (phase != "moving" and presses != self.presses):
                raise OverError

        self._resting = None if phase == "moving" else renderer
        try:
            image = renderer.draw(drawn)
            return Drawn(image, show, seconds=image.frame_seconds)
        finally:
            self._resting = None

    def _renderer(self, scene: Scene, show: Show, smooth: bool) -> Renderer:
        """What draws it, made from the last one of its kind, with which it shares what is the same."""
        if before := self._renderers.pop((show, smooth), None):
            renderer = before.following(scene)
        else:
            outputs: tuple[Output, ...] = ("rgb8",) if show == "color" else (show,)
            how = self.options | (self.smooth if smooth else {})
            renderer = Renderer(scene, self.device, outputs=outputs, **how)
        self._renderers[show, smooth] = renderer
        if len(self._renderers) > KEPT:
            del self._renderers[next(iter(self._renderers))]
        return renderer

    def compared(self) -> Comparison | None:
        """The other tracer's picture beside the right one, if there is one. Raises what compare() raises."""
        scene = self.scene
        if self.judge and (self._compared is None or self._compared[0] is not scene):
            self._compared = scene, self.judge(scene)
        return self._compared[1] if self._compared else None
