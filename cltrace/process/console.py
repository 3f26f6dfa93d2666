"""What every command owes its user: clear messages, exit codes instead of tracebacks, and calm at a closed pipe."""

from __future__ import annotations

import argparse
import contextlib
import logging
import math
import os
import re
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from cltrace.base.errors import CltraceError, UsageError, printable
from cltrace.process.entry import ENDING


class Parser(argparse.ArgumentParser):
    """Whose errors are a UsageError. What begins with a minus and a digit is a value, since no option does."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._negative_number_matcher = re.compile(r"-[0-9]")

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")


def positive(text: str) -> int:
    """An argument's whole number, 1 at least."""
    if not re.fullmatch(r"[0-9]{1,9}", text) or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number >= 1, got {text!r}")
    return int(text)


def tell(message: str) -> None:
    """A message on stderr. Control characters of file names are shown, not sent; a full disk changes nothing."""
    with contextlib.suppress(OSError):
        print("\n".join(map(printable, message.split("\n"))), file=sys.stderr, flush=True)


def command(
    name: str, body: Callable[[], int], interrupted: str = "interrupted", verbose: Callable[[], bool] = lambda: False
) -> int:
    """Runs a command's body and returns its exit status.

    That is the body's own, or 2 for usage, scenes and files, 3 for devices, 141 for a reader of stdout that has gone,
    130 for Ctrl-C, and 128 + n for any other signal n that ends a program. verbose: whether to show tracebacks, too.
    """
    # A closed stderr is None, and print() would then take stdout for it.
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115
    with _signals_raise():
        try:
            with _log_on_terminal(name):
                status = body()
            if sys.stdout is not None:
                sys.stdout.flush()
            return status
        except CltraceError as error:
            if verbose():
                traceback.print_exc()
            # A SceneError begins with the file's name.
            tell(str(error) if type(error).__name__ == "SceneError" else f"{name}: {error}")
            return error.exit_code
        except KeyboardInterrupt:
            tell(f"{name}: {interrupted}")
            return 128 + signal.SIGINT
        except _SignalError as ended:
            return 128 + int(ended.args[0])
        except BrokenPipeError:
            _silence_stdout()
            return 128 + signal.SIGPIPE
        except OSError as error:
            _silence_stdout()
            tell(f"{name}: cannot write: {error.strerror or error}")
            return 2
        except MemoryError:
            tell(f"{name}: not enough memory")
            return 2


class _SignalError(BaseException):
    """The number of a signal that ends the command."""


@contextlib.contextmanager
def _signals_raise() -> Iterator[None]:
    """Makes the signals that end a program exceptions for a while, so that nothing half-written is left.

    One that comes within two seconds of another is not heard, so that the first one is obeyed undisturbed. A signal
    that is ignored, as `nohup` has it, stays so.
    """
    heard = -math.inf

    def hear(number: int, frame: FrameType | None) -> None:
        nonlocal heard
        while frame:
            if frame.f_code.co_name == "__del__":  # where Python drops what is raised: it comes again
                threading.Timer(0.01, os.kill, [os.getpid(), number]).start()
                return
            frame = frame.f_back
        if time.monotonic() < heard + 2:
            return
        heard = time.monotonic()
        raise KeyboardInterrupt if number == signal.SIGINT else _SignalError(number)

    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {n: signal.getsignal(n) for n in ENDING if signal.getsignal(n) not in (signal.SIG_IGN, None)}
    try:
        for number in before:
            signal.signal(number, hear)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Teller(logging.Handler):
    """Tells what the library logs, as the command's own words."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.command = name

    def emit(self, record: logging.LogRecord) -> None:
        tell(f"{self.command}: {record.getMessage()}")


@contextlib.contextmanager
def _log_on_terminal(name: str) -> Iterator[None]:
    """Shows the library's warnings, and where stderr is a terminal also its INFO: why nothing seems to happen."""
    log, handler = logging.getLogger("cltrace"), _Teller(name)
    level = log.level
    log.addHandler(handler)
    if sys.stderr.isatty():
        log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


def _silence_stdout() -> None:
    """Keeps Python from failing once more when it flushes at its end."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
