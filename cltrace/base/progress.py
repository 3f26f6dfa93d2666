"""How far something is: a bar of tqdm, where somebody is looking."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import time
from typing import Any

from cltrace.base.errors import MissingPackageError

DELAY = 1.0  # seconds of work before anything is shown


def bar(total: int | None, unit: str, wanted: bool | None = None) -> Any:
    """A context manager with update(n), which shows how much of the total is done; None for one that is not known.

    wanted: whether there is one; None for one where stderr is a terminal, or in a notebook, if tqdm is installed.
    Raises MissingPackageError if it is wanted and tqdm is not installed.
    """
    looking = "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
    shown = looking if wanted is None else wanted
    if shown and importlib.util.find_spec("tqdm") is None:
        if wanted:
            raise MissingPackageError("a progress bar", "tqdm", "progress")
        shown = False
    return _Bar(total, unit, shown)


class _Bar:
    """A bar that is there after a second, if it is shown: most work has ended before that, and needs no tqdm."""

    def __init__(self, total: int | None, unit: str, shown: bool) -> None:
        self._options = {"total": total, "unit": unit}
        self._shown = shown
        self._start = time.time()
        self._bar: Any = None
        self._done: float = 0

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def update(self, n: float = 1) -> None:
        """So much more is done."""
        self._done += n
        if self._shown and self._bar is None and time.time() - self._start >= DELAY:
            self._bar = importlib.import_module("tqdm.auto").tqdm(**self._options)
            self._bar.start_t, n = self._start, self._done  # so that its rate is that of all
        if self._bar is not None:
            self._bar.update(n)
