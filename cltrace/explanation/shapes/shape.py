"""What a shape is to an explanation: a row of SHAPES in table.py, of which all others here know this alone."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from cltrace.explanation.space import Footprint
from cltrace.reference import Direction, Point, Surface


@dataclass(frozen=True)
class Textbook(ABC):
    """The intersection test of the textbook, in doubles: the numbers that a student's own code has.

    The ray is o + t d in the world, and d has length 1. surfaces: which ones of the reference it is of; normals: what
    their normals are, in words, by `shape` of Hit.
    """

    surfaces: ClassVar[tuple[type[Surface], ...]]
    normals: ClassVar[Mapping[str, str]]

    @classmethod
    @abstractmethod
    def of(cls, surface: Any, o: Point, d: Direction) -> Self:
        """That of a surface which is no group."""

    @classmethod
    def beside(cls, surface: Any, o: Point, d: Direction, pixel: Footprint) -> Iterable[Surface]:
        """What of a surface of the world a ray may pass by by less than a pixel's width there."""
        return (surface,)

    @classmethod
    @abstractmethod
    def gap(cls, surface: Any, o: Point, d: Direction) -> tuple[float, float, Surface]:
        """How far a ray passes by one of these, at which t, and what of it is nearest."""

    @abstractmethod
    def first(self, own: bool) -> float:
        """Where the ray meets it first by these numbers, infinite if it does not. own: whether it starts there."""

    @abstractmethod
    def lines(self) -> Iterator[str]:
        """They in the words of the tutorial."""


def first_of(ends: tuple[float, ...], own: bool) -> float:
    """Where a ray meets a solid first, of where it meets it. On the one that it leaves, one of the two is its start."""
    ahead = [t for t in ends if t > 0]
    if own and ahead:
        ahead = [t for t in ends if t != min(ends, key=abs) and t > 0]
    return min(ahead, default=math.inf)


def common(one: Sequence[float], other: Sequence[float]) -> tuple[float, ...]:
    """From where to where a ray is in both of two parts of it, none if it is nowhere."""
    begin, end = max(one[0], other[0]), min(one[1], other[1])
    return (begin, end) if begin <= end else ()


def solutions(a: float, b: float, c: float) -> tuple[float, tuple[float, ...]]:
    """Of a t^2 + b t + c = 0: (b/2)^2 - a c, and the two solutions, the smaller one first, or none."""
    half = b / 2
    disc = half * half - a * c
    root = math.sqrt(disc) if disc >= 0 else math.nan
    return disc, ((-half - root) / a, (-half + root) / a) if disc >= 0 and a > 0 else ()
