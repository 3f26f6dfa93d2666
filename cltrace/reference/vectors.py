"""Points and directions in camera space, in double precision: the vector class that the tutorial asks for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Color = tuple[float, float, float]


def color_of(value: NDArray[np.float64]) -> Color:
    r, g, b = value.tolist()
    return (r, g, b)


def byte_of(value: float, truncate: bool = False) -> int:
    """0..255, linear: rounded to nearest, or down as the course's own pictures are."""
    return int(max(0.0, min(1.0, value)) * 255 + (0.0 if truncate else 0.5))


@dataclass(frozen=True, slots=True)
class Direction:
    """A difference of points: it can be scaled, added and multiplied, but is nowhere."""

    x: float
    y: float
    z: float

    def __iter__(self) -> Iterator[float]:
        return iter((self.x, self.y, self.z))

    def __add__(self, other: Direction) -> Direction:
        return Direction(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Direction) -> Direction:
        return Direction(self.x - other.x, self.y - other.y, self.z - other.z)

    def __neg__(self) -> Direction:
        return Direction(-self.x, -self.y, -self.z)

    def __mul__(self, factor: float) -> Direction:
        return Direction(self.x * factor, self.y * factor, self.z * factor)

    def __truediv__(self, divisor: float) -> Direction:
        return Direction(self.x / divisor, self.y / divisor, self.z / divisor)

    def dot(self, other: Direction) -> float:
        return (self.x * other.x + self.y * other.y) + self.z * other.z

    def cross(self, other: Direction) -> Direction:
        return Direction(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )

    def length(self) -> float:
        return math.hypot(self.x, self.y, self.z)

    def normalized(self) -> Direction:
        """The same direction with length 1. ZeroDivisionError for a direction of length 0, which has none."""
        # By the largest component first: the square of a tiny or a huge one would leave the range.
        once = self / max(abs(self.x), abs(self.y), abs(self.z))
        return once / once.length()


@dataclass(frozen=True, slots=True)
class Point:
    """A place. Points differ by a direction; they cannot be added."""

    x: float
    y: float
    z: float

    def __iter__(self) -> Iterator[float]:
        return iter((self.x, self.y, self.z))

    def __sub__(self, other: Point) -> Direction:
        return Direction(self.x - other.x, self.y - other.y, self.z - other.z)

    def __add__(self, step: Direction) -> Point:
        if not isinstance(step, Direction):
            return NotImplemented
        return Point(self.x + step.x, self.y + step.y, self.z + step.z)


EYE = Point(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Matrix:
    """Three rows. `matrix @ v` is the vector of their products with v; `matrix.T` has its columns for rows."""

    x: Direction
    y: Direction
    z: Direction

    def __matmul__(self, v: Direction) -> Direction:
        return Direction(self.x.dot(v), self.y.dot(v), self.z.dot(v))

    @cached_property
    def T(self) -> Matrix:
        return Matrix(*(Direction(*column) for column in zip(self.x, self.y, self.z, strict=True)))

    @cached_property
    def size(self) -> float:
        """The sum of the magnitudes of its numbers, row by row: no vector becomes more than that times as long."""
        total = 0.0
        for value in (*self.x, *self.y, *self.z):
            total += abs(value)
        return total


def size_of(p: Point | Direction) -> float:
    """|p|_1, the sum of the coordinates' magnitudes."""
    return (abs(p.x) + abs(p.y)) + abs(p.z)
