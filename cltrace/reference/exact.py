"""Where a decision is close, doubles do not decide it: this module does, in exact arithmetic.

What is decided about
    The scene as its file has it. A sphere is |p - C| = r with the numbers of the file, an ellipsoid |K (p - C)| = r
    with a matrix of doubles, and everything is measured from the eye along the *world's* axes: f = C - eye is an exact
    difference. Only rays are turned. The camera's axes are three double triples; as rows of a matrix B they lead from
    the world to camera space, and the direction d of a ray in camera space stands for the direction B^T d in the world,
    exactly. Since the rows of B are orthonormal only to rounding, this is a definition and not a formality: turning the
    spheres instead would lose the eye that lies on a sphere, two spheres that touch, or the light within a shell. With
    it,

        a = |B^T d|^2,    b = (B^T d) . (C - o),    c = |C - o|^2 - r^2

    are exact numbers, and so is every decision. (B^T d) . f is d . (B f), so a centre in camera space serves for b. For
    an ellipsoid, K B^T d and K (C - o) take the places of B^T d and C - o.

    A triangle is three corners of doubles in the world. Who owns an edge, and a corner, is said at face.Face.

Which numbers that takes
    A ray from the eye, from any point with given coordinates, or from a triangle needs rational numbers only. A ray
    that starts on a sphere starts at P = C + r n / |n|, on an ellipsoid at C + r K^-1 n / |n|, and |n| = sqrt(s) is a
    square root: its numbers have the form p + q sqrt(s) with p, q and s rational. Sums, differences and products of
    such numbers (of one s) have that form again, and their sign is found by squaring, see Surd. So there is no
    precision to choose and nothing to iterate: equal is equal.

    The two ends of a ray through a sphere, t = (b -/+ sqrt(D)) / a, have one root more. They are compared with each
    other, and with the ends of a ray's range, by squaring once or twice more, see Root.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import ClassVar

from cltrace.base.arithmetic import dot
from cltrace.exact.surds import Interval, Surd, root_between, sign_with_root
from cltrace.reference.vectors import Direction, Matrix

ZERO = Fraction(0)


Exact = Surd
Vector = tuple[Exact, Exact, Exact]
Rational = tuple[Fraction, Fraction, Fraction]
Rows = tuple[Rational, Rational, Rational]


def rational(v: Iterable[float]) -> Rational:
    """Doubles as the fractions that they are."""
    x, y, z = (Fraction(a) for a in v)
    return x, y, z


def between(p: Iterable[float], q: Iterable[float]) -> Rational:
    """From one point to another."""
    x, y, z = (Fraction(b) - Fraction(a) for a, b in zip(p, q, strict=True))
    return x, y, z


def vector(v: Iterable[Fraction]) -> Vector:
    x, y, z = (Surd(a) for a in v)
    return x, y, z


def product(rows: Rows, v: Rational) -> Rational:
    """The vector of the products of the rows of a matrix with v."""
    x, y, z = (sum((a * b for a, b in zip(row, v, strict=True) if a), ZERO) for row in rows)
    return x, y, z


@dataclass(frozen=True)
class Frame:
    """The camera's axes in the world: the rows of B.

    skew: a bound of |B B^T - 1| and of |B^T B - 1|, 0 for a camera along the world's axes. Camera.basis() makes the
    rows unit to 3 u and orthogonal to 4 u, u = 2^-53 (a hypot() of 2 u, and quotients, products and differences of u
    each), so the norm of either is below 14 u.
    """

    rows: Rows

    @cached_property
    def skew(self) -> float:
        # The two matrices have the same eigenvalues. The sum of an error matrix's entries bounds its norm.
        total = ZERO
        for i, u in enumerate(self.rows):
            for j, v in enumerate(self.rows):
                total += abs(sum((x * y for x, y in zip(u, v, strict=True)), ZERO) - (i == j))
        return math.nextafter(float(total), math.inf) if total else 0.0

    @cached_property
    def B(self) -> Matrix:
        """The same in doubles, which the axes are."""
        return Matrix(*(Direction(*map(float, row)) for row in self.rows))

    def to_world(self, v: Iterable[float]) -> Rational:
        """B^T v: the vector v of camera space along the world's axes."""
        out = [ZERO, ZERO, ZERO]
        for amount, row in zip(v, self.rows, strict=True):
            if amount:
                for i, x in enumerate(row):
                    out[i] += Fraction(amount) * x
        return out[0], out[1], out[2]

    def to_camera(self, v: Rational) -> Rational:
        """B v: the vector v of the world along the camera's axes."""
        return product(self.rows, v)

    def turned(self, v: Sequence[float]) -> Direction:
        """A direction of the world in camera space, of length 1, right to a few ulp.

        The largest coordinate goes to 1 first, for the range.
        """
        largest = max(map(abs, v))
        return (self.B @ Direction(*(x / largest for x in v))).normalized()


def sign_along(w: Vector, v: Vector) -> int:
    """The sign of v.w, and where that is 0, of v.(w + (e, e^2, e^3)) for every small e > 0."""
    return next((sign for x in (dot(v, w), *v) if (sign := x.sign())), 0)


@dataclass(frozen=True)
class Line:
    """The points start + t direction, from the eye along the world's axes."""

    start: Vector
    direction: Vector


@dataclass(frozen=True)
class Plane:
    """The equation of the t at which a line meets a plane: a t - b = 0 with a = normal.direction > 0.

    As a quadratic equation, (a t - b)^2 / a = 0, it has one root twice.
    """

    direction: Vector
    normal: Vector
    b: Exact
    c: ClassVar[Exact] = Surd(ZERO)  # nobody asks for it
    discriminant: ClassVar[Exact] = Surd(ZERO)

    @cached_property
    def a(self) -> Exact:
        return dot(self.normal, self.direction)

    def is_before(self, other: Plane) -> bool:
        """Whether the line meets this plane before another one, at a smaller t: b / a < b' / a'."""
        mine, its = self.normal, other.normal
        x, y, z = (self.b * q - other.b * p for p, q in zip(mine, its, strict=True))
        return sign_along(self.direction, (x, y, z)) < 0


@dataclass(frozen=True)
class Quadratic:
    """a t^2 - 2 b t + c = 0. Of the sphere that it comes from, c is the power of the line's start."""

    a: Exact
    b: Exact
    c: Exact

    @cached_property
    def discriminant(self) -> Exact:
        return self.b * self.b - self.a * self.c

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


@dataclass(frozen=True)
class Root:
    """t = (b + side sqrt(D)) / a, where side is -1 for the near end and 1 for the far one.

    Of a plane D is 0, and side the sign of b.
    """

    of: Quadratic | Plane
    side: int

    def sign_less(self, t: float) -> int:
        """The sign of this root less t: that of (b - a t) + side sqrt(D), since a > 0."""
        if math.isinf(t):
            return -1 if t > 0 else 1
        e = self.of
        return sign_with_root(e.b - e.a.times(Fraction(t)), Surd(Fraction(self.side)), e.discriminant)

    def is_between(self, t_min: float, t_max: float) -> bool:
        return self.sign_less(t_min) > 0 and self.sign_less(t_max) < 0

    def __lt__(self, other: Root) -> bool:
        """Whether this root is strictly less than one of the same ray, whose s is the same.

        Both are multiplied by both a, which are positive. Then the difference is x + y with x = gap + side sqrt(D) and
        y = -side' sqrt(E). Where x and y differ in sign, the larger square decides: x^2 - y^2 is gap^2 + D - E plus
        2 side gap sqrt(D).
        """
        mine, its = self.of, other.of
        if isinstance(mine, Plane) and isinstance(its, Plane):
            return mine.is_before(its)
        gap = mine.b * its.a - its.b * mine.a
        D, E = mine.discriminant * (its.a * its.a), its.discriminant * (mine.a * mine.a)
        x, y = sign_with_root(gap, Surd(Fraction(self.side)), D), -other.side * E.sign()
        if x * y >= 0:
            return x + y < 0
        return x * sign_with_root(gap * gap + D - E, gap.times(2 * self.side), D) < 0

    def __float__(self) -> float:
        """t rounded; infinite beyond the range of double."""
        try:
            return float(self.value())
        except OverflowError:
            return math.inf

    def value(self) -> Fraction:
        """t within 2^-200 of itself, and with its sign.

        Where b and side sqrt(D) differ in sign, t is c / (b - side sqrt(D)) instead, which does not cancel. What still
        cancels is within b, c or D, so bits are added until there are enough: there are, since 0 is told apart first.
        """
        e = self.of
        direct = self.side * e.b.sign() >= 0
        if not direct and e.c.sign() == 0:
            return ZERO
        bits = 256
        while True:
            b, D = e.b.between(bits), e.discriminant.between(bits)
            low, high = root_between(max(D.low, ZERO), bits).low, root_between(max(D.high, ZERO), bits).high
            if e.discriminant.sign() == 0:
                low = high = ZERO
            side = self.side if direct else -self.side
            ends = Interval(b.low + min(side * low, side * high), b.high + max(side * low, side * high))
            numerator, denominator = (ends, e.a.between(bits)) if direct else (e.c.between(bits), ends)
            t = numerator.over(denominator)
            if t and (t.high - t.low) <= abs(t.low) / 2**200:
                return t.low
            bits *= 2
