"""How frames are drawn, wherever that is: handed out and taken in again in order, a few at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from copy import copy
from functools import partial
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from cltrace.movie.fingerprint import Fingerprints
from cltrace.movie.frames import Frame
from cltrace.picture.image import Image
from cltrace.plan.request import Crop
from cltrace.renderers.renderer import Renderer, default_precision
from cltrace.run.devices import Device, choose
from cltrace.scene import Scene

Task = TypeVar("Task")
Result = TypeVar("Result")
Task_contra = TypeVar("Task_contra", contravariant=True)
Result_co = TypeVar("Result_co", covariant=True)


class Workers(Protocol[Task_contra, Result_co]):
    """What does tasks: a device or a cluster. One thread calls it."""

    def room(self) -> int:
        """How many tasks may be on their way, or wait for one before them; 1 at least."""

    def take(self, task: Task_contra) -> Callable[[], Result_co]:
        """Has a task done. What it returns waits for the result, and raises what went wrong."""

    def close(self) -> None:
        """Ends what is on its way, whose results nobody wants any more."""


def in_order(tasks: Iterable[Task], workers: Workers[Task, Result]) -> Generator[tuple[Task, Result], None, None]:
    """Each task with its result, in order. The workers are closed at the end, also if that is an error or Ctrl-C.

    Tasks are taken by the thread that asks for results, and no more of them than the workers have room for. Where
    there is an error instead of a task, those before it are done first.
    """
    iterator, more = iter(tasks), True
    fault: Exception | None = None
    waiting: deque[tuple[Task, Callable[[], Result]]] = deque()

    def first() -> tuple[Task, Result]:
        task, result = waiting.popleft()
        return task, result()

    with closing(workers):
        while more or waiting:
            while more and len(waiting) < workers.room():
                task = None
                try:
                    task = next(iterator, None)
                except Exception as error:
                    fault = error
                more = task is not None
                if task is not None:
                    waiting.append((task, workers.take(task)))
            if waiting:
                yield first()
        if fault:
            raise fault


class Shown(NamedTuple):
    """What of Images is shown. look: tells it from other ways, for fingerprints; of: makes the pixels of an Image."""

    look: object
    of: Callable[[Image, Scene], NDArray[np.uint8]]


# What is called with the number of a frame and its Image, see draw_on().
Each = Callable[[int, Image], Any]


def draw_on(image: Image, number: int, each: Each) -> None:
    """Lets a function draw on the image of a frame.

    What it returns, if that is not None, is the picture instead: what numpy takes for (h, w, 3) or (h, w, 4) uint8 of
    the same size. Raises ValueError for anything else.
    """
    found = each(number, image)
    if found is None:
        return
    size, pixels = np.asarray(image).shape[:2], np.asarray(found)
    if pixels.dtype != np.uint8 or pixels.shape not in ((*size, 3), (*size, 4)):
        wanted = f"None or uint8 of shape {(*size, 3)} or {(*size, 4)}"
        raise ValueError(f"each: must return {wanted}, returned {pixels.dtype} of shape {pixels.shape}")
    image.rgb8 = np.array(pixels[..., :3])
    image.__dict__.pop("rgba8", None)
    if pixels.shape[2] == 4:
        image.rgba8 = np.array(pixels)


COLORS = Shown("", lambda image, scene: np.asarray(image))


class FrameRenderer(ABC):
    """Draws the frames of movies.

    options: the Renderer's, with the precision; names: of the devices; place: those, for messages; each: None, or what
    is done with each Image. how: the precision and the place.
    """

    def __init__(self, options: Mapping[str, Any], names: str, place: str, each: Each | None = None) -> None:
        precision = options["precision"]
        # In single, the device decides some bits.
        self._bits = {**options, "device": names if precision == "single" else ""}
        self.how = f"{precision} precision, on {place}"
        self.crop: Crop | None = options.get("crop")
        self.each = each

    @abstractmethod
    def workers(self) -> Workers[Frame, Image]:
        """What draws the frames of one movie."""

    def images(self, frames: Iterable[Frame]) -> Generator[tuple[Frame, Image], None, None]:
        """Each frame with its Image, in order."""
        with closing(in_order(frames, self.workers())) as drawn:
            for frame, image in drawn:
                if self.each:
                    draw_on(image, frame.number, self.each)
                yield frame, image

    def pictures(self, frames: Iterable[Frame], shown: Shown) -> Generator[tuple[Frame, NDArray[np.uint8]], None, None]:
        """Each frame with what of its Image is shown, in order."""
        with closing(self.images(frames)) as drawn:
            for frame, image in drawn:
                yield frame, shown.of(image, frame.scene)

    def marks(self, shown: Shown) -> Fingerprints:
        """Fingerprints of the pictures."""
        return Fingerprints({**self._bits, "look": shown.look})


class OnDevice(FrameRenderer):
    """Draws on a device of this machine. device: as Renderer has it; options: the Renderer's; each: see draw_on().

    Raises DeviceError if there is no such device.
    """

    def __init__(self, device: str | Device | None, options: Mapping[str, Any], each: Each | None = None) -> None:
        self._device = device if isinstance(device, Device) else choose(device)
        self._options = {**options, "precision": options.get("precision") or default_precision(self._device)}
        super().__init__(self._options, self._device.name, self._device.name, each)

    def workers(self) -> Workers[Frame, Image]:
        return _OneDevice(partial(Renderer, device=self._device, **self._options))


class _OneDevice:
    """Draws in the thread that asks for results, while another thread prepares the next frame.

    first: makes the Renderer of the first frame. Each later one keeps what its frame shares with the one before it.
    """

    def __init__(self, first: Callable[[Scene], Renderer]) -> None:
        self._next, self._pool = first, ThreadPoolExecutor(1)

    def room(self) -> int:
        return 2

    def take(self, frame: Frame) -> Callable[[], Image]:
        coming: Future[Renderer] = self._pool.submit(self._prepared, frame.scene)
        return lambda: coming.result().render(progress=False)

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)  # it may still compile

    def _prepared(self, scene: Scene) -> Renderer:
        renderer = self._next(scene)
        self._next = copy(renderer).following  # whose lock is its own: it does not wait until this one has drawn
        return renderer
