"""How a program of cltrace begins and ends: without a traceback, whenever a signal comes.

This imports hardly anything of cltrace, so that it is there before numpy and the OpenCL driver, which take their time.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import itertools
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any, NoReturn

from cltrace.base import limits

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

# Those of the signals that end a program which a user, a terminal or a batch system sends; Windows lacks some.
ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU") if hasattr(signal, name)]


def start(module: str, first: Callable[[], None] = lambda: None) -> NoReturn:
    """Runs main() of this module as a program, and leaves with the exit status that it returns.

    first: is called before the module is imported, in the environment in which that is done.

    Before and after main() there is nothing to be cleaned up, and a signal ends the program at once. At its end the
    program does not wait for Python and the OpenCL drivers to be taken apart, where a signal could still do harm.
    """
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    _check_addresses(module)
    _change_limits(sys.argv[1:])
    try:
        # Threads that numpy starts for products of large matrices wait for work by spinning: there are none.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        first()
        status = _program(module).main()
    except SystemExit as end:  # argparse, after --help and --version
        status = end.code
        if sys.stdout is not None:
            sys.stdout.flush()
    os._exit(status or 0)


def _check_addresses(module: str) -> None:
    """Ends the program where libraries would, some without a word: with less memory than they take for themselves."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0] if resource else -1
    if 0 <= limit < limits.ADDRESSES:
        _end(
            module, f"not enough memory: ulimit -v is {limit // 1024}, and must be {limits.ADDRESSES // 1024} at least"
        )


def _change_limits(words: list[str]) -> None:
    """Sets what --limit says, here and in processes that this one starts: modules take limits as they find them."""
    words = words[: words.index("--")] if "--" in words else words
    given = [word.removeprefix("--limit=") for word in words if word.startswith("--limit=")]
    given += [value for word, value in itertools.pairwise(words) if word == "--limit"]
    if given:
        os.environ[limits.CHANGED] = " ".join([os.environ.get(limits.CHANGED, ""), *given])
        with contextlib.suppress(ValueError):  # which the command's own parser finds, too, and has words for
            limits.change(given)


def _end(module: str, words: str) -> NoReturn:
    os.write(2, f"{module.partition('.')[0]}: {words}\n".encode())
    os._exit(2)


def _program(module: str) -> Any:
    """The module of a program, or the end of this one where it or a library that it needs cannot be loaded."""
    try:
        return imported(module)
    except (ImportError, MemoryError) as error:  # as of little memory
        words = str(error).strip().splitlines() or ["not enough memory"]
        _end(module, f"cannot be loaded: {words[-1]}")


def imported(module: str) -> Any:
    """A module, imported in less of a processor's time."""
    # What modules hold lives until the end: to look through it for garbage, again and again, finds nothing.
    gc.disable()
    found = importlib.import_module(module)
    gc.freeze()
    gc.enable()
    return found


def _leave(number: int, _: object) -> NoReturn:
    os._exit(128 + number)


# How multiprocessing starts the workers of a local cluster: as forks of one process, which imports what they need while
# this one is still busy with other things. It opens no device, so that each fork can open its own. Only Linux's
# libraries are all written for forks.
METHOD = "forkserver" if sys.platform == "linux" else "spawn"


def start_forkserver(module: str) -> None:
    """Starts that process, where there is to be one and it is not there yet. module: what it imports."""
    # Python's helper processes would look for modules in the current folder first, and take a user's re.py for its own.
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    if METHOD != "forkserver" or threading.current_thread() is not threading.main_thread():
        return
    import multiprocessing
    from multiprocessing import forkserver

    multiprocessing.set_forkserver_preload([module])
    # It inherits that these are ignored: what a terminal sends to all processes is left to this one, which ends them.
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGHUP)}
    try:
        forkserver.ensure_running()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
