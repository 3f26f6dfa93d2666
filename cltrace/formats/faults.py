"""What is wrong with a file: messages with their lines, and what a misspelt name was meant to be."""

from __future__ import annotations

import bisect
import difflib
import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import Fault, printable

MAX_MESSAGES = 100
MAX_LINES = 4  # that are named of equal messages


class FatalError(Exception):
    """Line and message of a fault after which no more of the file is read."""


@dataclass
class _Group:
    """Equal messages: how many, the first lines that they are about, in order, and what makes their ends."""

    count: int = 0
    lines: list[int] = field(default_factory=list)  # one more than are told, to know whether there are more
    hints: list[Callable[[], str]] = field(default_factory=list)

    def add(self, line: int, hint: Callable[[], str], times: int) -> None:
        self.count += times
        if len(self.hints) < MAX_LINES:
            self.hints.append(hint)
        if line not in self.lines and (len(self.lines) <= MAX_LINES or line < self.lines[-1]):
            bisect.insort(self.lines, line)
            del self.lines[MAX_LINES + 1 :]

    def text(self, message: str) -> str:
        """The message with the first end that there is, and how often and where else it applies, if it does."""
        message += next(filter(None, (hint() for hint in self.hints)), "")
        if self.count == 1:
            return message
        others = ", ".join(map(str, self.lines[1:MAX_LINES])) + ", …" * (len(self.lines) > MAX_LINES)
        where = f", also in line{'s' * (len(self.lines) > 2)} {others}" if others else ""
        return f"{message} ({self.count} times{where})"


class Messages:
    """The first MAX_MESSAGES by line, however many there are. Equal ones are one, at its first line."""

    def __init__(self) -> None:
        self.count = 0
        self._groups: dict[str, _Group] = {}

    def add(self, line: int, message: str, hint: Callable[[], str] = lambda: "", times: int = 1) -> None:
        """A message about this line of the file; 0 is the file as a whole.

        `hint` makes the message's end, which may take a while: it is called only for few of those that are kept.
        times: how many messages this stands for, the others of which are about lines further down.
        """
        self.count += times
        self._groups.setdefault(message, _Group()).add(line, hint, times)
        if len(self._groups) >= 2 * MAX_MESSAGES:
            self._trim()

    def add_all(self, lines: NDArray[np.integer[Any]], message: str) -> None:
        """The same message about each of these lines, which rise."""
        told = np.unique(lines[: 8 * MAX_LINES])[: MAX_LINES + 1].tolist()
        for line in told:
            self.add(line, message, times=1 if line != told[-1] else len(lines) - len(told) + 1)

    def _trim(self) -> None:
        # If what goes were said again of a line further up, it would count from there, and the rest among the "more".
        first = sorted(self._groups.items(), key=lambda item: (item[1].lines[0], item[0]))
        self._groups = dict(first[:MAX_MESSAGES])

    def in_order(self) -> list[Fault]:
        """By line, each of them one line of text; a last one counts those that are left out."""
        self._trim()
        told = [Fault(group.lines[0], printable(group.text(message))) for message, group in self._groups.items()]
        more = self.count - sum(group.count for group in self._groups.values())
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


def short(text: str) -> str:
    """The beginning of a text, short enough for a message."""
    return text if len(text) <= 40 else f"{text[:37]}..."


def quoted(text: str) -> str:
    """The same in quotation marks, with control characters written as escapes."""
    return repr(short(text))
