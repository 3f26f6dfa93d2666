"""What is wrong with a scene file: messages with their lines, and what a misspelt name was meant to be."""

from __future__ import annotations

import difflib
import functools

from cltrace.errors import Fault

MAX_MESSAGES = 100


class FatalError(Exception):
    """Line and message of a fault after which no more of the file is read."""


class Messages:
    """The first MAX_MESSAGES by line, however many there are."""

    def __init__(self) -> None:
        self.count = 0
        self._kept: list[Fault] = []

    def add(self, line: int, message: str) -> None:
        """A message about this line of the file; 0 is the file as a whole."""
        self.count += 1
        self._kept.append(Fault(line, message))
        if len(self._kept) >= 2 * MAX_MESSAGES:
            self._trim()

    def _trim(self) -> None:
        self._kept = sorted(self._kept)[:MAX_MESSAGES]

    def in_order(self) -> list[Fault]:
        """By line, and a last one that counts those that are left out."""
        self._trim()
        more = self.count - len(self._kept)
        # The ellipsis sorts behind every message of the same line.
        return [*self._kept, Fault(self._kept[-1].line, f"… and {more} more")] if more else self._kept


@functools.lru_cache(1024)
def closest(name: str, others: tuple[str, ...]) -> str | None:
    """The one of the other names that this one is most likely a misspelling of, if any."""
    by_lower = {other.lower(): other for other in others}
    found = difflib.get_close_matches(name.lower(), by_lower, 1)
    return by_lower[found[0]] if found else None
