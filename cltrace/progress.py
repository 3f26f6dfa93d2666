"""How far something is: a bar of tqdm, where somebody is looking."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from typing import Any

from cltrace.errors import MissingPackageError


def bar(total: int | None, unit: str, wanted: bool | None = None) -> Any:
    """A context manager with update(n), which shows how much of the total is done; None for one that is not known.

    wanted: whether there is one; None for one where stderr is a terminal, or in a notebook, if tqdm is installed.
    Raises MissingPackageError if it is wanted and tqdm is not installed.
    """
    if importlib.util.find_spec("tqdm") is None:
        if wanted:
            raise MissingPackageError("a progress bar", "tqdm", "progress")
        return _Nothing()
    looking = "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
    if wanted is False or (wanted is None and not looking):
        return _Nothing()
    return importlib.import_module("tqdm.auto").tqdm(total=total, unit=unit, delay=1)


class _Nothing:
    """What shows nothing."""

    def __enter__(self) -> _Nothing:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def update(self, n: float = 1) -> None:
        pass
