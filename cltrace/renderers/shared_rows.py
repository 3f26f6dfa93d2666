"""One picture, drawn by several devices together: each takes rows that nobody has, until none are left."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any

from numpy.typing import NDArray

from cltrace.base.errors import DeviceError
from cltrace.plan.request import Region
from cltrace.run.devices import Device
from cltrace.run.executor import Executor, margin_of
from cltrace.run.rows import Rows

Arrays = dict[str, NDArray[Any]]

log = logging.getLogger("cltrace")


class Faults:
    """What devices that were to work together have failed of, by their labels. Several threads may note one."""

    def __init__(self) -> None:
        self._words: dict[str, str] = {}

    def note(self, device: Device, error: DeviceError, left: bool = True) -> None:
        """A device that draws no more. left: whether others are left, which is said then."""
        self._words[device.label] = str(error)
        if left:
            log.warning("%s draws no more, and others do its part: %s", device.label, str(error).splitlines()[0])

    def __contains__(self, device: Device) -> bool:
        return device.label in self._words

    def error(self) -> DeviceError:
        """What to raise where none is left."""
        words = "".join(f"\n{label}: {words}" for label, words in self._words.items())
        return DeviceError(f"no device can draw this; `cltrace --doctor` tries each of them{words}")


def draw_together(
    region: Region,
    makers: Mapping[Device, Callable[[], Executor]],
    drawn: Callable[[int], object] = lambda rows: None,
    faults: Faults | None = None,
) -> Arrays:
    """The outputs of a picture by name, as Executor.read() has them.

    region: of the picture; makers: for each device what makes an executor for it, all with equal requests; a thread for
    each calls it. drawn: called with how many rows have been drawn, by one thread at a time; faults: of devices that
    have failed before.

    What a device draws counts when it has been read, so one that fails costs no more than its rows, which others draw
    again. Raises DeviceError if none is left, and what else drawing raises.
    """
    picture = _Picture(region, len(makers), drawn, faults or Faults())
    pool, shares = ThreadPoolExecutor(len(makers)), dict[Device, Future[None]]()
    try:
        for device, make in makers.items():
            shares[device] = pool.submit(picture.share, device, make)
        picture.rows.wait_for_all()
    finally:
        picture.rows.stop()
        for executor in picture.executors.values():
            executor.stop()
        # And not for one that compiles; a signal may come before all have begun.
        wait(shares[device] for device in picture.executors if device in shares)
        pool.shutdown(wait=False)
    if picture.fault:
        raise picture.fault
    if picture.rows.lacking:
        raise picture.faults.error()
    return picture.arrays


class _StoppedError(Exception):
    """Nobody wants the picture any more."""


class _Picture:
    """What is shared between threads, one for each device. rows: those of a frame, with its margin."""

    def __init__(self, region: Region, devices: int, drawn: Callable[[int], object], faults: Faults) -> None:
        self._margin, self._working = margin_of(region)[1], devices
        self.rows = Rows(region[3] + self._margin, devices)
        self.arrays: Arrays = {}
        self.faults, self.executors = faults, dict[Device, Executor]()
        self.fault: BaseException | None = None
        self._tell, self._lock = drawn, threading.Lock()

    def share(self, device: Device, make: Callable[[], Executor]) -> None:
        """Draws as much as one device can, until the picture is there."""
        try:
            executor = self.executors[device] = make()
            with executor.driver_errors():
                while self.rows.wait():
                    self._draw(executor)
        except DeviceError as error:
            with self._lock:
                self._working -= 1
                if self.rows.lacking:
                    self.faults.note(device, error, left=self._working > 0)
                if not self._working:
                    self.rows.stop()
        except _StoppedError:
            pass
        except BaseException as error:  # of the picture, which whoever asks for it is to hear
            self.fault = error
            self.rows.stop()

    def _draw(self, executor: Executor) -> None:
        """Draws rows that nobody has, and puts them into the picture."""
        mine: list[range] = []

        def take(most: int) -> range | None:
            if strip := self.rows.take(most):
                mine.append(strip)
            return strip

        frame = executor.frame()  # a new one each time, as reading it writes over all its rows
        try:
            executor.draw(frame, self._drawn, take)
            arrays = executor.read(frame)
        except BaseException:
            self.rows.give_back(mine)
            raise
        with self._lock:
            if not self.arrays:
                self.arrays = arrays
            else:
                for strip in mine:
                    part = slice(max(strip.start - self._margin, 0), max(strip.stop - self._margin, 0))
                    for name, array in arrays.items():
                        self.arrays[name][part] = array[part]
        self.rows.settle(mine)

    def _drawn(self, count: int) -> None:
        if self.rows.stopped:
            raise _StoppedError
        with self._lock:
            self._tell(count)
