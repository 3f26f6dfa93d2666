"""Frames of a movie, shared out among several devices: each takes the next one when it is free."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from typing import NamedTuple

from cltrace.errors import DeviceError
from cltrace.movie.frames import Frame
from cltrace.picture.image import Image
from cltrace.renderer import Renderer
from cltrace.run.devices import Device
from cltrace.run.together import Faults
from cltrace.scene import Scene

# Frames for each device that may be on their way or wait for one before them: while a slow device draws one, a fast one
# is to have enough to do, but memory is not to grow with the movie.
AHEAD = 8


def drawn_by_all(
    frames: Iterable[Frame], devices: Sequence[Device], first: Callable[[Scene, Device], Renderer]
) -> Generator[tuple[Frame, Image], None, None]:
    """Each frame with its picture, in order. first: makes the Renderer of the first frame of a device.

    Frames are taken by the thread that asks for pictures. A device that fails draws no more, and others draw its
    frames. Raises DeviceError if none is left, and what else drawing raises.
    """
    iterator, more = iter(frames), True
    waiting: deque[_Job] = deque()
    with closing(_Crew(devices, first)) as crew:
        while more or waiting:
            while more and len(waiting) < AHEAD * len(devices):
                frame = next(iterator, None)
                more = frame is not None
                if frame:
                    waiting.append(crew.take(frame))
            if waiting:
                job = waiting.popleft()
                yield job.frame, job.image.result()


class _Job(NamedTuple):
    """A frame, and its picture when it is drawn."""

    frame: Frame
    image: Future[Image]


class _ClosedError(Exception):
    """Nobody waits for pictures any more."""


class _Crew:
    """A thread for each device, which draws. close() ends them, after a strip of what they are at."""

    def __init__(self, devices: Sequence[Device], first: Callable[[Scene, Device], Renderer]) -> None:
        self._first, self._working, self._closed = first, len(devices), False
        self._faults, self._jobs, self._changed = Faults(), deque[_Job](), threading.Condition()
        self._pool = ThreadPoolExecutor(len(devices))
        for device in devices:
            self._pool.submit(self._work, device)

    def take(self, frame: Frame) -> _Job:
        """Has a frame drawn."""
        job = _Job(frame, Future())
        self._put([job])
        return job

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
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
        renderer: Renderer | None = None

        def prepared(scene: Scene) -> Renderer:
            return renderer.following(scene) if renderer else self._first(scene, device)

        with ThreadPoolExecutor(1) as pool:
            while job := self._next(patient=True):
                mine.append(job)
                coming = pool.submit(prepared, job.frame.scene)
                while mine:
                    renderer = coming.result()
                    if job := self._next(patient=False):
                        mine.append(job)
                        coming = pool.submit(prepared, job.frame.scene)
                    mine[0].image.set_result(renderer.draw(self._check_open))
                    mine.popleft()

    def _check_open(self, rows: int) -> None:
        if self._closed:
            raise _ClosedError
