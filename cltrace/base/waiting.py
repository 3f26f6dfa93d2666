"""Waiting for libraries that do not come back soon: signals are heard meanwhile, and what is slow is told.

Python runs the handlers of signals in the main thread, and only when the library that this thread is in has come back.
"""

from __future__ import annotations

import logging
import math
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import cache, partial
from typing import TypeVar

# Those that a user, a terminal or a batch system sends to end what is going on. Others may come again and again, from a
# profiler as an example, and what begins again after each would never be done.
ENDING = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU") if hasattr(signal, name)}
# Seconds without progress after which it is said what is slow.
SLOW = 1.0

log = logging.getLogger("cltrace")
T = TypeVar("T")


def in_main_thread() -> bool:
    """Whether this is the thread that hears signals."""
    return threading.current_thread() is threading.main_thread()


def aside(work: Callable[[], T]) -> T:
    """What `work` returns or raises, done by another thread where this is the main one, which hears signals meanwhile.

    After a signal the other thread goes on, for nobody. Python's end waits for it, as a driver that is taken apart
    while it compiles could end the process with a fault; the command leaves without that.
    """
    if not in_main_thread():
        return work()
    other = ThreadPoolExecutor(1)
    try:
        return other.submit(work).result()
    finally:
        other.shutdown(wait=False)


@dataclass(eq=False)
class _Wait:
    """A thread's work with a library.

    stop: has that come back; slow: what to say where it takes long; over: whether there is to be no more of it; hears:
    whether the thread is the main one; since: when the library was called last.
    """

    stop: Callable[[], object]
    slow: Callable[[], str]
    over: Callable[[], bool]
    hears: bool
    since: float = math.inf


class _Listener:
    """A thread that hears signals while the main thread is in a library, and sees how long any thread has been there.

    waits: the calls that may be in a library now.
    """

    def __init__(self) -> None:
        self.waits = set[_Wait]()
        self._ear, self._mouth = socket.socketpair()
        self._mouth.setblocking(False)
        self._before, self._asleep, self._told = -1, False, set[str]()
        threading.Thread(target=self._listen, daemon=True).start()

    @contextmanager
    def hearing(self) -> Iterator[None]:
        """Called in the main thread, whose waits then stop when a signal comes."""
        try:
            before = signal.set_wakeup_fd(self._mouth.fileno(), warn_on_full_buffer=False)
            self._before = self._before if before == self._mouth.fileno() else before
            yield
        finally:
            signal.set_wakeup_fd(self._before)

    def begin(self, wait: _Wait) -> None:
        """Now a library is called."""
        wait.since = time.monotonic()
        if self._asleep:
            self._asleep = False
            with suppress(BlockingIOError):  # it has not read what there is, and so is not asleep
                self._mouth.send(b"\0")

    def _listen(self) -> None:
        while True:
            self._asleep = True  # before it is asked whether anything waits, so that begin() sees one or the other
            self._asleep = not self.waits
            self._ear.settimeout(None if self._asleep else SLOW / 2)
            numbers = b""
            with suppress(TimeoutError):
                numbers = self._ear.recv(256).strip(b"\0")
            if self._before >= 0 and numbers:  # whoever listened before hears them, too
                with suppress(OSError):
                    os.write(self._before, numbers)
            self._look(bool(ENDING.intersection(numbers)))

    def _look(self, ending: bool) -> None:
        """Stops what is to be stopped, and tells what is slow. Afterwards this thread holds no work, nor its memory."""
        for wait in self.waits.copy():
            if wait.over() or (ending and wait.hears):
                wait.stop()
            if time.monotonic() >= wait.since + SLOW and (words := wait.slow()) not in self._told:
                self._told.add(words)
                log.warning(words)


@cache
def _listener() -> _Listener:
    return _Listener()


@contextmanager
def interruptible(
    stop: Callable[[], object], slow: Callable[[], str], over: Callable[[], bool] = lambda: False
) -> Iterator[Callable[[], None]]:
    """While it lasts, a signal that ends programs has another thread call `stop`, so that a library comes back.

    It gives what to call before a library is called; `slow` is what is said, once, if that then takes more than a
    second; where `over` says so, `stop` is called, too. Signals are heard in the main thread alone.
    """
    listener, wait = _listener(), _Wait(stop, slow, over, in_main_thread())
    listener.waits.add(wait)
    try:
        with listener.hearing() if wait.hears else nullcontext():
            yield partial(listener.begin, wait)
    finally:
        listener.waits.discard(wait)


class Announcement:
    """Logs `text`, as information or at another level, if the `with` block takes longer than `after` seconds."""

    def __init__(self, text: str, after: float = 0.5, level: int = logging.INFO) -> None:
        self.timer, self.level = threading.Timer(after, log.log, [level, text]), level
        self.timer.daemon = True

    def __enter__(self) -> None:
        if log.isEnabledFor(self.level):
            self.timer.start()

    def __exit__(self, *_: object) -> None:
        self.timer.cancel()
