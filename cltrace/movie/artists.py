"""What draws the frames of a movie on this machine: one device, or all of them."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.joint import all_devices, names_of
from cltrace.movie.crew import drawn_by_all
from cltrace.movie.fingerprint import Fingerprints
from cltrace.movie.frames import Frame
from cltrace.picture.image import Image
from cltrace.renderer import Renderer, default_precision
from cltrace.run.devices import Device, choose, is_all
from cltrace.scene import Scene

Images = Generator[tuple[Frame, Image], None, None]
Pictures = Generator[tuple[Frame, NDArray[np.uint8]], None, None]
Shown = Callable[[Image, Scene], NDArray[np.uint8]]


def shown_as(image: Image, scene: Scene) -> NDArray[np.uint8]:
    """What of an Image is shown where nothing else is asked for."""
    return np.asarray(image)


class Artist(Protocol):
    """What draws. how: the precision and the device, for messages."""

    how: str

    def pictures(self, frames: Iterator[Frame], shown: Shown) -> Pictures:
        """Each frame with what of its Image is shown."""

    def marks(self, look: object) -> Fingerprints:
        """Fingerprints of the pictures. look: what else tells what is shown from others."""


class Here:
    """Draws on this machine. device: as Renderer has it, or "all" for all devices; options: the Renderer's.

    Raises DeviceError if there is no such device.
    """

    def __init__(self, device: str | Device | None, options: Mapping[str, Any]) -> None:
        precision = options.get("precision")
        if is_all(device):
            self._devices, chosen = all_devices(precision)
        else:
            self._devices = [device if isinstance(device, Device) else choose(device)]
            chosen = precision or default_precision(self._devices[0])
        self._options = {**options, "precision": chosen}
        names = names_of(self._devices)
        # In single, the device decides some bits.
        self._bits = {"precision": chosen, "device": names if chosen == "single" else ""}
        self.how = f"{chosen} precision, on {names}"

    def images(self, frames: Iterable[Frame]) -> Images:
        """Each frame with its Image, in order."""
        if len(self._devices) > 1:
            return drawn_by_all(frames, self._devices, self._first)
        return images(frames, lambda scene: self._first(scene, self._devices[0]))

    def pictures(self, frames: Iterable[Frame], shown: Shown = shown_as) -> Pictures:
        """Each frame with what of its Image is shown, in order."""
        with closing(self.images(frames)) as drawn:
            for frame, image in drawn:
                yield frame, shown(image, frame.scene)

    def marks(self, look: object = "") -> Fingerprints:
        """Fingerprints of the pictures. look: what else tells what is shown from others."""
        return Fingerprints({**self._options, **self._bits, "look": look})

    def _first(self, scene: Scene, device: Device) -> Renderer:
        return Renderer(scene, device, **self._options)


def images(frames: Iterable[Frame], first: Callable[[Scene], Renderer]) -> Images:
    """Each frame with its picture. first: makes the Renderer of the first one.

    A frame is taken from `frames` when the one before it is prepared, by the thread that asks for pictures.
    """
    renderer: Renderer | None = None

    def prepared(frame: Frame, before: Renderer | None) -> Renderer:
        return first(frame.scene) if before is None else before.following(frame.scene)

    with ThreadPoolExecutor(1) as pool:
        iterator = iter(frames)
        frame = next(iterator, None)
        job = pool.submit(prepared, frame, None) if frame else None
        while frame and job:
            renderer, drawn = job.result(), frame
            frame = next(iterator, None)
            job = pool.submit(prepared, frame, renderer) if frame else None
            yield drawn, renderer.render(progress=False)
