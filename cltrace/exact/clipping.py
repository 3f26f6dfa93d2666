"""Clipping planes, exactly: what they keep of a line, and where a line enters that.

A plane is a point S and a normal m towards the kept side. For the t of a line, in whole directions, the point of the
line is on the kept side if h + t g >= 0, with h = (o - S).m and g = w.m. The line enters the kept side at t = -h / g if
g > 0, and leaves it there if g < 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from cltrace.base.arithmetic import dot
from cltrace.exact.lines import Equation, ExactPoint, Line, Root, Vector, sum_times
from cltrace.exact.surds import Surd, over_common, sign_with_root


class ExactPlane:
    """The points p with (p - S).m >= 0 are kept."""

    def __init__(self, point: Iterable[float], inward: Iterable[float]) -> None:
        self.point = ExactPoint.of(point)
        self.inward, _ = over_common(inward)

    def along(self, line: Line) -> Height:
        """What a line has of it."""
        f = line.start - self.point
        x, y, z = (Surd(m * f.over) for m in self.inward)
        return Height(line, sum_times(f.numbers, self.inward), (x, y, z))


@dataclass(frozen=True)
class Height:
    """h + t g for the t of a line, times a number > 0. normal: m, times the same number."""

    line: Line
    h: Surd
    normal: Vector

    @cached_property
    def g(self) -> Surd:
        return dot(self.normal, self.line.way)

    @cached_property
    def root(self) -> Root:
        """Where it is 0, if g > 0."""
        return Root(Equation(self.line, self.g, self.h.times(-1), normal=self.normal), 0)

    def sign_at(self, root: Root) -> int:
        """The sign at t = (b + side sqrt(D)) / a, a > 0."""
        e = root.of
        return sign_with_root(self.h * e.a + self.g * e.b, self.g.times(root.side), e.discriminant)

    def is_later(self, other: Height) -> bool:
        """Whether it is still negative, or becomes 0 only later, where another one with g > 0 becomes 0."""
        return (self.h * other.g - other.h * self.g).sign() < 0

    def from_point(self, point: ExactPoint) -> tuple[Vector, Surd]:
        """From a point to where it is 0, if g > 0, times the second number, which is positive."""
        f = self.line.start - point
        x, y, z = (a * self.g - (self.h * w).times(f.over) for a, w in zip(f.numbers, self.line.way, strict=True))
        return (x, y, z), self.g.times(f.over)


def entry_of(heights: Iterable[Height]) -> Height | None:
    """That one of the planes' heights by which a line enters what all of them keep; None if it never does."""
    found, last = list(heights), None
    for height in found:
        if height.g.sign() > 0 and (last is None or height.is_later(last)):
            last = height
    return None if last is None or any(height.is_later(last) for height in found) else last
