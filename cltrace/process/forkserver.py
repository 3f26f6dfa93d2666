"""Where the workers of a local cluster come from: forks of one process, which imports what they need while this one is
still busy with other things. It opens no device, so that each fork can open its own.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from multiprocessing import forkserver

# How multiprocessing starts them. Only Linux's libraries are all made for forks.
METHOD = "forkserver" if sys.platform == "linux" else "spawn"


def prepare(module: str) -> None:
    """Starts that process, where there is to be one and it is not there yet. module: what it imports."""
    # Python's helper processes would look for modules in the current folder first, and take a user's re.py for its own.
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    if METHOD != "forkserver" or threading.current_thread() is not threading.main_thread():
        return
    multiprocessing.set_forkserver_preload([module])
    # It inherits that these are ignored: what a terminal sends to all processes is left to this one, which ends them.
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGHUP)}
    try:
        forkserver.ensure_running()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
