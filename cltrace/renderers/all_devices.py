"""All devices of this machine, for one picture: the front door for `--device all`."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable
from copy import copy
from functools import partial
from typing import Any

from cltrace.base.errors import DeviceError
from cltrace.picture.image import Image, Output
from cltrace.plan.abi import Precision
from cltrace.plan.request import Antialias, Crop
from cltrace.renderers.renderer import Renderer, default_precision
from cltrace.renderers.shared_rows import Faults, draw_together
from cltrace.run.devices import Device, check_process, devices, is_all, where_drivers_are
from cltrace.run.executor import Executor
from cltrace.scene import Scene


def all_devices(precision: Precision | None = None) -> tuple[list[Device], Precision]:
    """The devices of this machine that can draw in this precision, and it; None for the best that one of them has.

    Raises DeviceError if there is none.
    """
    every = devices()
    if not every:
        raise DeviceError(f"no OpenCL device found\n{where_drivers_are()}")
    double = [device for device in every if device.has_double]
    chosen = precision or default_precision((double or every)[0])
    if chosen == "single":
        return every, chosen
    if not double:
        raise DeviceError(f"no device has double precision, which --precision {chosen} needs; use --precision single")
    return double, chosen


def names_of(found: Iterable[Device]) -> str:
    """The names of devices, for messages and statistics."""
    counts = Counter(device.name for device in found)
    return " and ".join(name if count == 1 else f"{count} x {name}" for name, count in counts.items())


class AllDevicesRenderer(Renderer):
    """A Renderer whose pictures all devices of this machine draw together.

    The arguments are those of Renderer; devices without double precision are left out where that is needed. device: the
    first one that works. What takes no picture, such as work(), is done there. Raises DeviceError if none works, and
    else what Renderer raises.
    """

    def __init__(self, scene: Scene, precision: Precision | None = None, **options: Any) -> None:
        self._faults = Faults()
        left, precision = all_devices(precision)
        while left:
            device = left.pop(0)
            try:
                super().__init__(scene, device, precision, **options)
            except DeviceError as error:
                self._faults.note(device, error, left=bool(left))
            else:
                self._others = left
                return
        raise self._faults.error()

    @property
    def place(self) -> str:
        """Those that have not failed."""
        return names_of(device for device in (self.device, *self._others) if device not in self._faults)

    def draw(self, drawn: Callable[[int], object], out: Image | None = None) -> Image:
        """As a Renderer's; each device draws rows that nobody has. out: must be None."""
        if out is not None:
            raise ValueError("out: must be None where several devices draw")
        check_process()
        with self._lock:
            start, alike = time.perf_counter(), copy(self)
            makers: dict[Device, Callable[[], Executor]] = {self.device: lambda: self._executor}
            makers |= {device: partial(_executor_on, alike, device) for device in self._others}
            arrays = draw_together(self.region, makers, drawn, self._faults)
            seconds = {"kernel": time.perf_counter() - start, "readback": 0.0}
        return self._image(arrays, seconds)


def _executor_on(renderer: Renderer, device: Device) -> Executor:
    return renderer.on(device)._executor


def render(
    scene: Scene,
    device: str | Device | None = None,
    precision: Precision | None = None,
    outputs: tuple[Output, ...] = ("rgb8",),
    crop: Crop | None = None,
    truncate: bool = False,
    progress: bool | None = None,
    antialias: Antialias = False,
    samples: int | None = None,
    outline: tuple[Any, float] | None = None,
    fog: tuple[Any, float, float] | None = None,
) -> Image:
    """One picture of a scene. The arguments and what is raised are those of Renderer and its render().

    device: may also be "all", for all devices of this machine together. In accurate and double, the bytes are those of
    one device.
    """
    how: dict[str, Any] = {"precision": precision, "outputs": outputs, "crop": crop, "truncate": truncate}
    how |= {"antialias": antialias, "samples": samples, "outline": outline, "fog": fog}
    if is_all(device):
        return AllDevicesRenderer(scene, **how).render(progress=progress)
    return Renderer(scene, device, **how).render(progress=progress)
