"""Two runs beside each other: what got slower, less right or more work."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import NamedTuple, TypeVar

from .errors import Errors
from .points import Point, Results, Spread, Way, Work
from .texts import milliseconds, number

Row = TypeVar("Row", Point, Way)
SLOWER, FASTER, WRONG, RIGHT, MORE, LESS, GONE = (
    "slower", "faster", "less right", "more right", "more work", "less work", "gone",
)  # fmt: skip
# What fails a comparison.
WORSE = (SLOWER, WRONG, MORE, GONE)
# Of Errors, what says how much was compared.
EXTENT = ("pixels", "arriving")
MACHINE = ("cpu", "cores", "devices")


class Change(NamedTuple):
    """kind: one of those above; text: of what, from what to what."""

    kind: str
    text: str


def changes(old: Results, new: Results, tolerance: float) -> list[Change]:
    """All that has changed of what both have. tolerance: by what share times and errors may grow, times and memory only
    count on the same machine; of counted work, and of wrong pixels, nothing may."""
    same = all(old.about.get(name) == new.about.get(name) for name in MACHINE)
    found = [*_work(old.work, new.work)]
    for before, now in _pairs(old.points, new.points):
        name = f"{now.group}: {now.scene}, {now.label}"
        found += _wrong(name, before, now, tolerance)
        if same:
            found += _times(f"{name}, frame", before.time, now.time, tolerance)
            found += _times(f"{name}, whole", before.way, now.way, tolerance)
    for of, to in _pairs(old.ways, new.ways) if same else ():
        name = f"{to.scene}, {to.tracer}, {to.way}"
        found += _times(name, of.time, to.time, tolerance)
        found += _sizes(f"{name}, memory", of.memory or 0, to.memory or 0, tolerance)
    return found


def told(found: Sequence[Change], old: Results, new: Results) -> str:
    """The changes, a line each, and how many there are of each kind."""
    lines = [f"{kind:<10}  {text}" for kind, text in sorted(found)]
    if any(old.about.get(name) != new.about.get(name) for name in MACHINE):
        lines.append("another machine or driver: times are not compared")
    counts = Counter(kind for kind, _ in found)
    return "\n".join([*lines, ", ".join(f"{n} {kind}" for kind, n in sorted(counts.items())) or "no changes"])


def _pairs(old: Sequence[Row], new: Sequence[Row]) -> Iterator[tuple[Row, Row]]:
    """The same in both."""
    before = {row.key: row for row in old}
    return ((before[row.key], row) for row in new if row.key in before)


def _work(old: Work, new: Work) -> Iterator[Change]:
    """Of all scenes that one of them has, if both have any."""
    for scene in dict.fromkeys([*old, *new]) if old and new else ():
        before, now = old.get(scene, {}), new.get(scene, {})
        if not now:
            yield Change(GONE, f"{scene}: is not counted any more")
        for name in dict.fromkeys([*before, *now]):
            a, b = before.get(name, 0), now.get(name, 0)
            if a != b and now:
                yield Change(MORE if b > a else LESS, f"{scene}, {name}: {a:,} -> {b:,}")


def _times(name: str, old: Spread, new: Spread, tolerance: float) -> Iterator[Change]:
    """Where the rounds of both agree, and their quartiles do not overlap."""
    if old.steady and new.steady:
        text = f"{name}: {milliseconds(old)} -> {milliseconds(new)} ms ({number(new.median / old.median, 3)})"
        if new.median > old.median * (1 + tolerance) and new.low > old.high:
            yield Change(SLOWER, text)
        elif old.median > new.median * (1 + tolerance) and old.low > new.high:
            yield Change(FASTER, text)


def _sizes(name: str, old: float, new: float, tolerance: float) -> Iterator[Change]:
    if old and new and max(old, new) > min(old, new) * (1 + tolerance):
        yield Change(SLOWER if new > old else FASTER, f"{name}: {number(old / 1e6, 3)} -> {number(new / 1e6, 3)} MB")


def _wrong(name: str, old: Point, new: Point, tolerance: float) -> Iterator[Change]:
    """Counts may not grow at all, sizes of errors by this share."""
    for of in ("picture", "sample"):
        before, now = getattr(old, of), getattr(new, of)
        for field in fields(Errors) if before and now and before.pixels == now.pixels else ():
            if field.name not in EXTENT:
                yield from _error(
                    f"{name}, {field.name}", getattr(before, field.name), getattr(now, field.name), tolerance
                )
    for value in ("differ", "off", "rms"):
        before, now = getattr(old, value), getattr(new, value)
        if before is not None and now is not None:
            yield from _error(f"{name}, {value}", before, now, tolerance)


def _error(name: str, old: float, new: float, tolerance: float) -> Iterator[Change]:
    share = 0 if isinstance(new, int) else tolerance
    if max(old, new) > min(old, new) * (1 + share):
        yield Change(WRONG if new > old else RIGHT, f"{name}: {number(old, 3)} -> {number(new, 3)}")
