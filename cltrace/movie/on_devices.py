"""Frames drawn on this machine: by one device, or shared out among all of them."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from copy import copy
from functools import partial
from typing import Any, NamedTuple

from cltrace.base.errors import DeviceError
from cltrace.movie.frames import Frame
from cltrace.movie.pipeline import Each, FrameRenderer, Workers
from cltrace.picture.image import Image
from cltrace.renderers.all_devices import all_devices, names_of
from cltrace.renderers.renderer import Renderer, default_precision
from cltrace.renderers.shared_rows import Faults
from cltrace.run.devices import Device, choose, is_all
from cltrace.scene import Scene

# Frames for each of several devices that may be on their way or wait for one before them: while a slow device draws
# one, a fast one is to have enough to do, but memory is not to grow with the movie.
AHEAD = 8


class OnDevices(FrameRenderer):
    """Draws on this machine. device: as Renderer has it, or "all" for all devices; options: the Renderer's; each: see
    draw_on().

    Raises DeviceError if there is no such device.
    """

    def __init__(self, device: str | Device | None, options: Mapping[str, Any], each: Each | None = None) -> None:
        precision = options.get("precision")
        if is_all(device):
            self._devices, precision = all_devices(precision)
        else:
            self._devices = [device if isinstance(device, Device) else choose(device)]
        self._options = {**options, "precision": precision or default_precision(self._devices[0])}
        names = names_of(self._devices)
        super().__init__(self._options, names, names, each)

    def workers(self) -> Workers[Frame, Image]:
        if len(self._devices) > 1:
            return _SeveralDevices(self._devices, self._first)
        return _OneDevice(partial(self._first, self._devices[0]))

    def _first(self, device: Device, scene: Scene) -> Renderer:
        return Renderer(scene, device, **self._options)


class _Preparing:
    """Renderers of one frame after the other on a device, made by a thread of its own.

    first: makes the first one. Each other one keeps what its frame shares with the one before it.
    """

    def __init__(self, first: Callable[[Scene], Renderer]) -> None:
        self._next, self._pool = first, ThreadPoolExecutor(1)

    def begin(self, scene: Scene) -> Future[Renderer]:
        """The Renderer of the next frame, when it is there."""
        return self._pool.submit(self._made, scene)

    def _made(self, scene: Scene) -> Renderer:
        renderer = self._next(scene)
        self._next = copy(renderer).following  # whose lock is its own: it does not wait until this one has drawn
        return renderer

    def close(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)  # it may still compile


class _OneDevice:
    """Draws in the thread that asks for results, while another one prepares the next frame."""

    def __init__(self, first: Callable[[Scene], Renderer]) -> None:
        self._preparing = _Preparing(first)
        self.close = self._preparing.close

    def room(self) -> int:
        return 2

    def take(self, frame: Frame) -> Callable[[], Image]:
        coming = self._preparing.begin(frame.scene)
        return lambda: coming.result().render(progress=False)


class _Job(NamedTuple):
    """A frame, and its picture when it is drawn."""

    frame: Frame
    image: Future[Image]


class _ClosedError(Exception):
    """Nobody waits for pictures any more."""


class _SeveralDevices:
    """A thread for each device, which takes the next frame when it is free. close() ends them.

    A device that fails draws no more, and others draw its frames. Where none is left, the results raise DeviceError.
    first: makes the Renderer of the first frame of a device.
    """

    def __init__(self, devices: Sequence[Device], first: Callable[[Device, Scene], Renderer]) -> None:
        self._first, self._working, self._closed = first, len(devices), False
        self._drawing: dict[Device, Renderer] = {}
        self._faults, self._jobs, self._changed = Faults(), deque[_Job](), threading.Condition()
        self._room, self._pool = AHEAD * len(devices), ThreadPoolExecutor(len(devices))
        for device in devices:
            self._pool.submit(self._work, device)

    def room(self) -> int:
        return self._room

    def take(self, frame: Frame) -> Callable[[], Image]:
        job = _Job(frame, Future())
        self._put([job])
        return job.image.result

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        for renderer in list(self._drawing.values()):
            renderer.stop()
        self._pool.shutdown(wait=False)  # a thread may still compile

    def _put(self, jobs: Iterable[_Job]) -> None:
        """Adds jobs, of which the earliest frame is drawn first. Where nobody is left, they fail."""
        with self._changed:
            self._jobs = deque(sorted([*self._jobs, *jobs], key=lambda job: job.frame.number))
            while self._jobs and not self._working:
                self._jobs.popleft().image.set_exception(self._faults.error())
            self._changed.notify_all()

    def _next(self, patient: bool) -> _Job | None:
        """The next job; None if there is none now, or where this is patient, if there will be none."""
        with self._changed:
            if patient:
                self._changed.wait_for(lambda: self._jobs or self._closed)
            return self._jobs.popleft() if self._jobs and not self._closed else None

    def _work(self, device: Device) -> None:
        """Draws until there is no more, or the device or a frame has a fault."""
        mine: deque[_Job] = deque()
        fault: DeviceError | None = None
        try:
            self._draw(device, mine)
        except DeviceError as error:
            fault = error
        except BaseException as error:  # of a frame, which whoever asks for its picture is to hear
            while mine:
                mine.popleft().image.set_exception(error)
        with self._changed:
            self._working -= 1
            if fault and not self._closed:
                self._faults.note(device, fault, left=self._working > 0)
        self._put(mine)

    def _draw(self, device: Device, mine: deque[_Job]) -> None:
        """Draws what there is, while another thread prepares the next frame. mine: the jobs that are not done."""
        with closing(_Preparing(partial(self._first, device))) as preparing:
            while job := self._next(patient=True):
                mine.append(job)
                coming = preparing.begin(job.frame.scene)
                while mine:
                    renderer = self._drawing[device] = coming.result()
                    if job := self._next(patient=False):
                        mine.append(job)
                        coming = preparing.begin(job.frame.scene)
                    mine[0].image.set_result(renderer.draw(self._check_open))
                    mine.popleft()

    def _check_open(self, rows: int) -> None:
        if self._closed:
            raise _ClosedError
