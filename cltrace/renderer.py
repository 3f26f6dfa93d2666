"""The front door: a scene goes through plan and run, and comes out as an Image."""

from __future__ import annotations

import threading
import time
from copy import copy

from cltrace.errors import DeviceError
from cltrace.picture.image import Image, Output
from cltrace.plan.abi import Precision
from cltrace.plan.plan import Plan, View, World
from cltrace.plan.request import Crop, Keep, Region, Request
from cltrace.run.devices import Device, check_process, choose
from cltrace.run.executor import WIDTHS, Executor
from cltrace.scene import Camera, Scene


def default_precision(device: Device) -> Precision:
    """accurate where the device has doubles, else single."""
    return "accurate" if device.has_double else "single"


class Renderer:
    """A scene on a device: program and buffers are kept, so that each render() costs only the kernel and the readback.

    device: None, a SPEC as on the command line, or a Device; precision: accurate, single, double or None for the
    device's default; outputs: any of rgb8, color, normal, direction, depth, id, shadow_rays, work; crop: (x0, y0, x1,
    y1), exactly those pixels of the full picture, x1 and y1 excluded; truncate: bytes are trunc(255 c) instead of
    rounded; width: pixels in a packet, 1, 4, 8 or 16, None for what is best on the device; keep: what not to skip, for
    measuring. One thread at a time: a second one waits. Raises DeviceError, BuildError, ValueError.
    """

    def __init__(
        self,
        scene: Scene,
        device: str | Device | None = None,
        precision: Precision | None = None,
        outputs: tuple[Output, ...] = ("rgb8",),
        crop: Crop | None = None,
        truncate: bool = False,
        width: int | None = None,
        keep: tuple[Keep, ...] = (),
    ) -> None:
        check_process()
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: must be a cltrace.Scene, such as cltrace.load() gives, got {scene!r}")
        self.device = device if isinstance(device, Device) else choose(device)
        self.request = Request(precision or default_precision(self.device), outputs, crop, truncate, keep)
        if self.precision != "single" and not self.device.has_double:
            raise DeviceError(
                f"{self.device.name} has no double precision, which --precision {self.precision} needs; "
                "use --precision single or another device"
            )
        self.width = self.device.width if width is None else width
        if not isinstance(self.width, int) or isinstance(self.width, bool) or self.width not in WIDTHS:
            raise ValueError(f"width: must be {', '.join(map(str, WIDTHS))} or None, got {width!r}")
        start = time.perf_counter()
        self._world = World.of(scene, self.request)
        self._look(scene, start, None)

    def look(self, camera: Camera) -> Renderer:
        """The same scene, seen by another camera, as another Renderer with the same outputs, precision and crop.

        It keeps what no camera changes: the program, the order of the spheres and their materials, also on the device.
        What float32 and double can hold of a place depends on the eye, and so do the lists: those are made again.
        Raises DeviceError, BuildError, ValueError if the crop is not within its picture.
        """
        check_process()
        other = copy(self)
        other._look(self.scene.seen_by(camera), time.perf_counter(), self._executor)
        return other

    def _look(self, scene: Scene, start: float, before: Executor | None) -> None:
        """start: when the work began, for the statistics."""
        self.scene = scene
        view = View.of(self._world, scene.camera, self.request)
        self.plan = Plan.of(self._world, view, self.request)
        packed = time.perf_counter() - start
        self._executor = Executor(self.plan, self.device, self.width, before)
        seconds = self.plan.seconds
        self.seconds = {"pack": packed - sum(seconds.values()), **seconds, **self._executor.seconds}
        self._lock = threading.Lock()

    @property
    def precision(self) -> Precision:
        """accurate, single or double."""
        return self.request.precision

    @property
    def region(self) -> Region:
        """The part of the picture that is rendered: x, y, width, height."""
        return self.plan.region

    @property
    def skipped(self) -> dict[str, int]:
        """What this scene did not need, and how often."""
        return self.plan.skipped

    def render(self, out: Image | None = None) -> Image:
        """One frame. With `out`, an Image of an earlier render() of this Renderer, its arrays are written over.

        Raises ValueError if `out` is none of those, DeviceError if the driver fails or in a forked process.
        """
        check_process()
        executor = self._executor
        if out is not None and (not isinstance(out, Image) or getattr(out.frame, "owner", None) is not executor):
            raise ValueError("out: must be an image that this Renderer has rendered")
        with self._lock, executor.driver_errors():
            frame = executor.frame() if out is None else out.frame
            start = time.perf_counter()
            executor.draw(frame)
            done = time.perf_counter()
            arrays = executor.read(frame)
            end = time.perf_counter()
        seconds = self.seconds | {"kernel": done - start, "readback": end - done}
        return Image(**arrays, seconds=seconds, frame=frame)

    def work(self) -> dict[str, int]:
        """How often a frame does what abi.COUNTERS names: renders one more with a kernel that counts."""
        check_process()
        with self._lock, self._executor.driver_errors():
            return self._executor.work()


def render(
    scene: Scene,
    device: str | Device | None = None,
    precision: Precision | None = None,
    outputs: tuple[Output, ...] = ("rgb8",),
    crop: Crop | None = None,
    truncate: bool = False,
) -> Image:
    """One picture of a scene; see Renderer for the arguments."""
    return Renderer(scene, device, precision, outputs, crop, truncate).render()
