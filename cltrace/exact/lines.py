"""Points, lines and where lines meet surfaces, exactly.

All numbers are integers, or p + q sqrt(s) with integers: every double is an integer over a power of two, and what
several numbers have in common for a denominator is kept beside them. A point C + r n / |n| of a sphere brings the
square root of s = n.n, so the numbers of a line that starts there have that s. Where a line meets a sphere there is one
root more, which is compared by squaring once or twice more, see Root.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from cltrace.base.arithmetic import dot
from cltrace.exact.surds import Interval, Surd, over_common, root_between, sign_with_root

Vector = tuple[Surd, Surd, Surd]
ZERO = Surd(0)


@dataclass(frozen=True)
class ExactPoint:
    """The point, or the vector, numbers / over."""

    numbers: Vector
    over: int

    @classmethod
    def of(
        cls, values: Iterable[float | Fraction], step: Iterable[Fraction] = (), square: Fraction | int = 0
    ) -> ExactPoint:
        """That of doubles or fractions, to which step times the root of a square may be added."""
        p, d = [Fraction(v) for v in values], Fraction(square).denominator
        # sqrt(n / d) = sqrt(n d) / d
        q = [Fraction(v) / d for v in step] or [Fraction(0)] * 3
        whole, over = over_common([*p, *q])
        s = Fraction(square).numerator * d
        x, y, z = (Surd(a, b, s) for a, b in zip(whole[:3], whole[3:], strict=True))
        return cls((x, y, z), over)

    def __sub__(self, other: ExactPoint) -> ExactPoint:
        over = math.lcm(self.over, other.over)
        a, b = over // self.over, over // other.over
        x, y, z = (p.times(a) - q.times(b) for p, q in zip(self.numbers, other.numbers, strict=True))
        return ExactPoint((x, y, z), over)

    def __add__(self, other: ExactPoint) -> ExactPoint:
        x, y, z = (p.times(-1) for p in other.numbers)
        return self - ExactPoint((x, y, z), other.over)

    def fractions(self) -> tuple[Fraction, Fraction, Fraction]:
        """Of a rational one."""
        x, y, z = (Fraction(n.p, self.over) for n in self.numbers)
        return x, y, z

    def rounded(self) -> tuple[float, float, float]:
        """Of a rational one. A quotient of two integers is rounded once."""
        x, y, z = (n.p / self.over for n in self.numbers)
        return x, y, z


@dataclass(frozen=True, eq=False)
class Frame:
    """The camera's axes in the world: the rows of B, which are orthonormal but for rounding.

    A direction d of camera space stands for B^T d in the world, exactly. This is a definition and not a formality:
    turning the surfaces instead of the rays would lose the eye that is on a sphere, two spheres that touch, or the
    light within a shell.
    """

    rows: tuple[tuple[float, float, float], ...]

    @cached_property
    def _whole(self) -> tuple[list[int], int]:
        return over_common([x for row in self.rows for x in row])

    def to_world(self, v: Sequence[float | Fraction]) -> ExactPoint:
        """B^T v: the vector v of camera space along the world's axes."""
        (B, over), (w, more) = self._whole, over_common(v)
        x, y, z = (Surd(w[0] * B[i] + w[1] * B[3 + i] + w[2] * B[6 + i]) for i in range(3))
        return ExactPoint((x, y, z), over * more)

    def to_camera(self, v: ExactPoint) -> ExactPoint:
        """B v: a vector of the world along the camera's axes."""
        B, over = self._whole
        x, y, z = (sum_times(v.numbers, B[3 * i : 3 * i + 3]) for i in range(3))
        return ExactPoint((x, y, z), over * v.over)


def sum_times(v: Vector, factors: Sequence[int]) -> Surd:
    """The product of a vector and a row of integers."""
    return v[0].times(factors[0]) + v[1].times(factors[1]) + v[2].times(factors[2])


@dataclass(frozen=True)
class Line:
    """The points start + t direction.

    Within this package, t counts in whole directions: it is to be multiplied by `unit`, the denominator of direction.
    """

    start: ExactPoint
    direction: ExactPoint

    @property
    def way(self) -> Vector:
        return self.direction.numbers

    @property
    def unit(self) -> int:
        return self.direction.over


@dataclass(frozen=True)
class Equation:
    """a t^2 - 2 b t + c = 0, for the t of a line, in whole directions; or of a plane, a t = b, with a = normal.way.

    over: a / over^2, b / over^2 and c / over^2 are the numbers of which the shape speaks, for the direction `way`. Of a
    sphere, c is the power of the line's start.
    """

    line: Line
    a: Surd
    b: Surd
    c: Surd = ZERO
    over: int = 1
    normal: Vector | None = None

    @cached_property
    def discriminant(self) -> Surd:
        return ZERO if self.normal else self.b * self.b - self.a * self.c

    def roots(self) -> Iterator[Root]:
        """The near end and the far end; the same one twice where the line touches; none for a line without direction.

        So a start on the sphere itself, c = 0, has the root 0, which no range that begins at 0 contains, and 2 b / a:
        outwards it is never met again, inwards at the far side.
        """
        if self.a.sign() > 0 and self.discriminant.sign() >= 0:
            yield Root(self, -1)
            yield Root(self, 1)

    def first(self, t_min: float, t_max: float) -> Root | None:
        """The first end strictly between t_min and t_max."""
        return next((root for root in self.roots() if root.is_between(t_min, t_max)), None)

    def rounded(self) -> tuple[float, float, float]:
        """b, c and the discriminant of a line with rational numbers, for its whole direction, each rounded once."""
        square, unit = self.over**2, self.line.unit
        return self.b.p / (square * unit), self.c.p / square, self.discriminant.p / (square * unit) ** 2

    def middle(self) -> Fraction:
        """b / a of a line with rational numbers: the t that is half way between the roots."""
        return Fraction(self.b.p * self.line.unit, self.a.p)


@dataclass(frozen=True)
class Root:
    """t = (b + side sqrt(D)) / a, where side is -1 for the near end and 1 for the far one, and 0 of a plane."""

    of: Equation
    side: int

    def sign_less(self, t: float | Fraction) -> int:
        """The sign of this root less t: that of (b - a t) + side sqrt(D), since a > 0."""
        if isinstance(t, float) and math.isinf(t):
            return -1 if t > 0 else 1
        e, bound = self.of, Fraction(t) / self.of.line.unit
        p, q = bound.numerator, bound.denominator
        return sign_with_root(e.b.times(q) - e.a.times(p), Surd(self.side * q), e.discriminant)

    def is_between(self, t_min: float, t_max: float) -> bool:
        return self.sign_less(t_min) > 0 and self.sign_less(t_max) < 0

    def __lt__(self, other: Root) -> bool:
        """Whether this root is strictly less than one of the same line.

        Both are multiplied by both a, which are positive. Then the difference is x + y with x = gap + side sqrt(D) and
        y = -side' sqrt(E). Where x and y differ in sign, the larger square decides: x^2 - y^2 is gap^2 + D - E plus
        2 side gap sqrt(D).

        Where a line meets two planes at one t, the line along way + (e, e^2, e^3) decides, for every small e > 0. At
        the edge of a box, which hides its other side, it meets the face in front before that behind; they are at
        different t unless they are in one plane.
        """
        mine, its = self.of, other.of
        if mine.normal and its.normal:
            x, y, z = (mine.b * q - its.b * p for p, q in zip(mine.normal, its.normal, strict=True))
            return sign_along(mine.line.way, (x, y, z)) < 0
        gap = mine.b * its.a - its.b * mine.a
        D, E = mine.discriminant * (its.a * its.a), its.discriminant * (mine.a * mine.a)
        x1, y1 = sign_with_root(gap, Surd(self.side), D), -other.side * E.sign()
        if x1 * y1 >= 0:
            return x1 + y1 < 0
        return x1 * sign_with_root(gap * gap + D - E, gap.times(2 * self.side), D) < 0

    def bounds(self, bits: int) -> Interval | None:
        """Two numbers with t between them, that are closer the more bits are asked for; None if these are too few."""
        e = self.of
        a, b, D = e.a.between(bits), e.b.between(bits), e.discriminant.between(bits)
        ends = [root_between(max(x, Fraction(0)), bits) for x in (D.low, D.high)]
        roots = sorted((self.side * ends[0].low, self.side * ends[1].high))
        t = Interval(b.low + roots[0], b.high + roots[1]).over(a)
        return t and Interval(t.low * e.line.unit, t.high * e.line.unit)

    def value(self, bits: int = 200) -> Fraction:
        """t within 2^-bits of itself, and with its sign."""
        if self.sign_less(Fraction(0)) == 0:
            return Fraction(0)
        more = 256
        while (t := self.bounds(more)) is None or (t.high - t.low) * 2**bits > abs(t.low):
            more *= 2
        return t.low

    def __float__(self) -> float:
        """t correctly rounded; infinite beyond the range of doubles."""
        bits = 128
        while True:
            t = self.bounds(bits)
            if t and t.low <= 0 <= t.high and self.sign_less(Fraction(0)) == 0:
                return 0.0
            low, high = (nearest(t.low), nearest(t.high)) if t else (0.0, math.inf)
            if low == high:
                return low
            if t and math.nextafter(low, math.inf) == high:  # which of the two is told by what is half way between
                middle = (Fraction(low) + (Fraction(high) if high < math.inf else 2**1024)) / 2
                return (low, nearest(middle), high)[self.sign_less(middle) + 1]
            bits *= 2


def nearest(x: Fraction) -> float:
    """The nearest double; infinite beyond the range of doubles."""
    try:
        return float(x)
    except OverflowError:
        return math.inf if x > 0 else -math.inf


def sign_along(w: Vector, v: Vector) -> int:
    """The sign of v.w, and where that is 0, of v.(w + (e, e^2, e^3)) for every small e > 0."""
    return next((sign for x in (dot(v, w), *v) if (sign := x.sign())), 0)


# Clipping planes: what they keep of a line, and where a line enters that.


class ExactPlane:
    """A point S and a normal m towards the kept side: the points p with (p - S).m >= 0 are kept.

    For the t of a line, in whole directions, the point of the line is on the kept side if h + t g >= 0, with
    h = (o - S).m and g = w.m. The line enters the kept side at t = -h / g if g > 0, and leaves it there if g < 0.
    """

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
