"""What is wrong with a scene file: messages with their lines, and what a misspelt name was meant to be."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Callable

from cltrace.errors import Fault, printable

MAX_MESSAGES = 100


class FatalError(Exception):
    """Line and message of a fault after which no more of the file is read."""


class Messages:
    """The first MAX_MESSAGES by line, however many there are."""

    def __init__(self) -> None:
        self.count = 0
        self._kept: list[tuple[int, str, Callable[[], str]]] = []

    def add(self, line: int, message: str, hint: Callable[[], str] = lambda: "") -> None:
        """A message about this line of the file; 0 is the file as a whole.

        `hint` makes the message's end, which may take a while: it is called only for the messages that are kept.
        """
        self.count += 1
        self._kept.append((line, message, hint))
        if len(self._kept) >= 2 * MAX_MESSAGES:
            self._trim()

    def _trim(self) -> None:
        self._kept = sorted(self._kept, key=lambda kept: kept[:2])[:MAX_MESSAGES]

    def in_order(self) -> list[Fault]:
        """By line, each of them one line of text; a last one counts those that are left out."""
        self._trim()
        told = [Fault(line, printable(message + hint())) for line, message, hint in self._kept]
        more = self.count - len(told)
        # The ellipsis sorts behind every message of the same line.
        return [*told, Fault(told[-1].line, f"… and {more} more")] if more else told


@functools.lru_cache(1024)
def closest(name: str, others: tuple[str, ...]) -> str | None:
    """The one of the other names that this one is most likely meant to be, if any.

    That is the one it resembles, or else the only one that has all its words, or whose words it has: as fov and
    horizontal_fov.
    """
    by_lower = {other.lower(): other for other in others}
    found = difflib.get_close_matches(name.lower(), by_lower, 1)
    if not found:
        words = set(name.lower().split("_"))
        found = [other for other in by_lower if words <= set(other.split("_")) or words >= set(other.split("_"))]
    return by_lower[found[0]] if len(found) == 1 else None
