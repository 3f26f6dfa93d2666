"""Waiting for libraries that do not come back soon: signals are heard meanwhile, and what is slow is told.

Python runs the handlers of signals in the main thread, and only when the library that this thread is in has come back.
"""

from __future__ import annotations

import functools
import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
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

    After a signal the other thread goes on, for nobody. Python's end waits for it, as a driver that is taken apart while
    it compiles ends the process with a fault; the command leaves without that.
    """
    if not in_main_thread():
        return work()
    done: Future[T] = Future()

    def run() -> None:
        try:
            done.set_result(work())
        except BaseException as error:
            done.set_exception(error)

    threading.Thread(target=run).start()
    return done.result()


class _Listener:
    """A thread that hears signals while the main thread is in a library, and sees how long it has been there.

    since: when that began, by time.monotonic(), None while it is not.
    """

    def __init__(self) -> None:
        self.since: float | None = None
        self._stop: Callable[[], object] | None = None
        self._slow: Callable[[], str] | None = None
        self._ear, self._mouth = socket.socketpair()
        self._mouth.setblocking(False)
        self._before, self._asleep, self._told = -1, False, set[str]()
        threading.Thread(target=self._listen, daemon=True).start()

    @contextmanager
    def listening(self, stop: Callable[[], object], slow: Callable[[], str]) -> Iterator[None]:
        """See interruptible()."""
        try:
            before = signal.set_wakeup_fd(self._mouth.fileno(), warn_on_full_buffer=False)
            self._before = self._before if before == self._mouth.fileno() else before
            self._stop, self._slow = stop, slow
            yield
        finally:
            self._stop = self._slow = self.since = None
            signal.set_wakeup_fd(self._before)

    def begin(self) -> None:
        """Now the main thread calls a library."""
        self.since = time.monotonic()
        if self._asleep:
            self._mouth.send(b"\0")

    def _listen(self) -> None:
        while True:
            self._asleep = True  # before it is asked whether there is anything to do, so that begin() sees one or other
            self._asleep = self.since is None
            self._ear.settimeout(None if self._asleep else SLOW / 2)
            numbers = b""
            with suppress(TimeoutError):
                numbers = self._ear.recv(256)
            if self._before >= 0 and numbers.strip(b"\0"):  # whoever listened before hears them, too
                with suppress(OSError):
                    os.write(self._before, numbers.strip(b"\0"))
            stop, slow, since = self._stop, self._slow, self.since
            if stop and ENDING.intersection(numbers):
                stop()
            if slow and since is not None and time.monotonic() >= since + SLOW:
                self._say(slow())

    def _say(self, words: str) -> None:
        if words not in self._told:
            self._told.add(words)
            log.warning(words)


@functools.cache
def _listener() -> _Listener:
    return _Listener()


@contextmanager
def interruptible(stop: Callable[[], object], slow: Callable[[], str]) -> Iterator[Callable[[], object]]:
    """While it lasts, a signal that ends programs has another thread call `stop`, so that a library comes back.

    It gives what to call before a library is called; `slow` is what is said, once, if that then takes more than a
    second. In other threads than the main one, which hear no signals, nothing happens.
    """
    if not in_main_thread():
        yield lambda: None
        return
    listener = _listener()
    with listener.listening(stop, slow):
        yield listener.begin
