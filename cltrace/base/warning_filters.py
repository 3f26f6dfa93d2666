"""What Python does with warnings, changed for a while by one thread at a time: its filters are those of all threads."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

_lock = threading.RLock()


@contextmanager
def warnings_are(action: Literal["error", "ignore"], kind: type[Warning] = Warning) -> Iterator[None]:
    """Makes warnings errors, or ignores them, in a `with` block. Other threads wait for it at theirs.

    If the blocks of two threads overlapped, the one that ends last would leave the filters of the other one for ever.
    """
    with _lock, warnings.catch_warnings():
        warnings.simplefilter(action, kind)
        yield
