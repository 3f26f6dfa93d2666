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

    A triangle is three corners of doubles in the world. Who owns an edge, and a corner, is said at Face.

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
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import ClassVar

from cltrace.reference.vectors import Direction, Matrix

ZERO = Fraction(0)


class Surd:
    """The real number p + q sqrt(s), exactly; p, q and s >= 0 are rational.

    Numbers that meet in a sum, a difference or a product must have the same s; a rational number has any.
    """

    __slots__ = ("p", "q", "s")

    def __init__(self, p: Fraction, q: Fraction = ZERO, s: Fraction = ZERO) -> None:
        self.p, self.q, self.s = p, q, s if q else ZERO

    def _root_of(self, other: Surd) -> Fraction:
        if self.s and other.s and self.s != other.s:
            raise ValueError("two different square roots meet")
        return self.s or other.s

    def __add__(self, other: Surd) -> Surd:
        return Surd(self.p + other.p, self.q + other.q, self._root_of(other))

    def __sub__(self, other: Surd) -> Surd:
        return Surd(self.p - other.p, self.q - other.q, self._root_of(other))

    def __mul__(self, other: Surd) -> Surd:
        if not self.q and not other.q:
            return Surd(self.p * other.p)
        s = self._root_of(other)
        return Surd(self.p * other.p + self.q * other.q * s, self.p * other.q + self.q * other.p, s)

    def times(self, factor: Fraction | int) -> Surd:
        return Surd(self.p * factor, self.q * factor, self.s)

    def sign(self) -> int:
        """-1, 0 or 1. Of two terms that differ in sign, the one with the larger square has it."""
        p, q = _sign(self.p), _sign(self.q)
        return _sign(p + q) if p * q >= 0 else p * _sign(self.p * self.p - self.q * self.q * self.s)

    def between(self, bits: int) -> Interval:
        """Two rational numbers with this one between them, that are closer the more bits are asked for."""
        if not self.q:
            return Interval(self.p, self.p)
        root = _root_between(self.s, bits)
        ends = sorted((self.p + self.q * root.low, self.p + self.q * root.high))
        return Interval(*ends)


def _sign(x: Fraction | int) -> int:
    return (x > 0) - (x < 0)


def sign_with_root(p: Surd, q: Surd, D: Surd) -> int:
    """The sign of p + q sqrt(D), D >= 0: as in Surd.sign, with numbers that are surds themselves."""
    x, y = p.sign(), q.sign() * D.sign()
    return _sign(x + y) if x * y >= 0 else x * (p * p - q * q * D).sign()


@dataclass(frozen=True, slots=True)
class Interval:
    """All numbers from low to high."""

    low: Fraction
    high: Fraction


def _root_between(s: Fraction, bits: int) -> Interval:
    """Bounds of sqrt(s), s >= 0, within 2^-bits of it; both are the root itself if that is rational."""
    # sqrt(n / d) = sqrt(n d) / d, and n d >= 1.
    whole = s.numerator * s.denominator << 2 * bits
    root, unit = math.isqrt(whole), s.denominator << bits
    return Interval(Fraction(root, unit), Fraction(root if root * root == whole else root + 1, unit))


Vector = tuple[Surd, Surd, Surd]
Rational = tuple[Fraction, Fraction, Fraction]
Rows = tuple[Rational, Rational, Rational]


def rational(v: Iterable[float]) -> Rational:
    """Doubles as the fractions that they are."""
    x, y, z = (Fraction(a) for a in v)
    return x, y, z


def vector(v: Iterable[Fraction]) -> Vector:
    x, y, z = (Surd(a) for a in v)
    return x, y, z


def minus(u: Vector, v: Vector) -> Vector:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def dot(u: Vector, v: Vector) -> Surd:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Vector, v: Vector) -> Vector:
    x, y, z = (u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3))
    return x, y, z


def product(rows: Rows, v: Rational) -> Rational:
    """The vector of the products of the rows of a matrix with v."""
    x, y, z = (sum((a * b for a, b in zip(row, v, strict=True) if a), ZERO) for row in rows)
    return x, y, z


def inverse(m: Rows) -> Rows:
    """The inverse of a matrix that has one: the adjugate over the determinant. Indices that go round need no signs."""
    adjugate = [
        [m[j - 2][i - 2] * m[j - 1][i - 1] - m[j - 2][i - 1] * m[j - 1][i - 2] for j in range(3)] for i in range(3)
    ]
    determinant = sum((m[0][j] * adjugate[j][0] for j in range(3)), ZERO)
    x, y, z = ((a / determinant, b / determinant, c / determinant) for a, b, c in adjugate)
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


@dataclass(frozen=True)
class Ball:
    """The points p with |K (p - center)| = radius, from the eye along the world's axes.

    to_object: K, which leads from the world to the own axes of an ellipsoid; None for a sphere, where K = 1.
    """

    center: Rational
    radius: Fraction
    to_object: Rows | None = None

    @cached_property
    def to_world(self) -> Rows | None:
        """L, the inverse of K."""
        return inverse(self.to_object) if self.to_object else None

    def seen(self, v: Vector) -> Vector:
        """K v."""
        if not self.to_object:
            return v
        x, y, z = (v[0].times(a) + v[1].times(b) + v[2].times(c) for a, b, c in self.to_object)
        return x, y, z

    def power(self, p: Rational) -> Fraction:
        """|K (p - center)|^2 - radius^2, the power of a point: > 0 outside, 0 on the surface, < 0 inside."""
        x, y, z = (a - b for a, b in zip(p, self.center, strict=True))
        w = product(self.to_object, (x, y, z)) if self.to_object else (x, y, z)
        return sum((a * a for a in w), ZERO) - self.radius * self.radius

    def point(self, n: Rational) -> Vector:
        """The point center + radius L n / |n|. As |n| = sqrt(s), it is center + (radius L n / s) sqrt(s)."""
        s = sum((x * x for x in n), ZERO)
        step = product(self.to_world, n) if self.to_world else n
        x, y, z = (Surd(c, self.radius * a / s, s) for c, a in zip(self.center, step, strict=True))
        return x, y, z


@dataclass(frozen=True)
class Face:
    """A triangle by its corners A, B, C, from the eye along the world's axes.

    Seen from O, with A' = A - O and so on, a ray along w passes the edge AB on the side that is the sign of

        E = w . (A' x B'),    and likewise BC and CA.

    It meets the triangle where these three are the same. At an edge, E = 0, the sign is that of the first of the
    coordinates of A' x B' that is not 0: that is the side of the ray w + (e, e^2, e^3) for every small e > 0. So one
    and the same ray is asked about everywhere, and of all triangles around an edge or a corner, exactly one has it on
    each side where the surface goes on.

    With N = (B - A) x (C - A), the three add up to N.w, and the ray is in the plane at t = A'.N / N.w. Where A'.N = 0,
    as the ray starts in the plane or the triangle has no area, it is not met. So not all coordinates of A' x B' are 0.

    Where a ray meets two triangles at one t, that ray decides, too. At the edge of a box, which hides its other side,
    it meets the face in front before that behind; they are at different t unless they are in one plane.
    """

    corners: tuple[Rational, Rational, Rational]

    def point(self, corner: int, u: Fraction | float, v: Fraction | float) -> Rational:
        """V + u (V' - V) + v (V'' - V): from one of the corners, and the next ones going round."""
        V, V1, V2 = (self.corners[(corner + i) % 3] for i in range(3))
        a, b = Fraction(u), Fraction(v)
        x, y, z = (p + a * (q - p) + b * (r - p) for p, q, r in zip(V, V1, V2, strict=True))
        return x, y, z

    @cached_property
    def normal(self) -> Rational:
        """N."""
        A, B, C = (vector(corner) for corner in self.corners)
        x, y, z = cross(minus(B, A), minus(C, A))
        return x.p, y.p, z.p


def sign_along(w: Vector, v: Vector) -> int:
    """The sign of v.w, and where that is 0, of v.(w + (e, e^2, e^3)) for every small e > 0."""
    return next((sign for x in (dot(v, w), *v) if (sign := x.sign())), 0)


@dataclass(frozen=True)
class Line:
    """The points start + t direction, from the eye along the world's axes."""

    start: Vector
    direction: Vector

    def through(self, ball: Ball) -> Quadratic:
        """The equation of the t at which the line meets a sphere or an ellipsoid."""
        f, d = ball.seen(minus(vector(ball.center), self.start)), ball.seen(self.direction)
        return Quadratic(dot(d, d), dot(f, d), dot(f, f) - Surd(ball.radius * ball.radius))

    def across(self, face: Face) -> Across | None:
        """Where the line meets a triangle, and how; None if it does not."""
        A, B, C = (minus(vector(corner), self.start) for corner in face.corners)
        N = vector(face.normal)
        D = dot(A, N)
        edges = cross(A, B), cross(B, C), cross(C, A)
        sides = {sign_along(self.direction, edge) for edge in edges} if D.sign() else {1, -1}
        if len(sides) > 1:
            return None
        (side,) = sides
        plane = Plane(self.direction, (N[0].times(side), N[1].times(side), N[2].times(side)), D.times(side))
        ab, _, ca = (dot(edge, self.direction) for edge in edges)
        return Across(side, plane, ca.times(side), ab.times(side))


@dataclass(frozen=True)
class Across:
    """A line across a triangle. side: the sign of N.w, 1 for a ray that goes the way of N.

    plane: the triangle's; by_b, by_c: side times E of the edges CA and AB, which are |N.w| times the weights of the
    corners B and C.
    """

    side: int
    plane: Plane
    by_b: Surd
    by_c: Surd

    @property
    def root(self) -> Root:
        """The t at which the line meets the triangle."""
        return Root(self.plane, self.plane.b.sign())

    def weights(self) -> tuple[float, float]:
        """Of B and of C, rounded."""
        w, n = self.plane.direction, self.plane.normal
        b, c = (float(Root(Plane(w, n, e), e.sign())) for e in (self.by_b, self.by_c))
        return b, c


@dataclass(frozen=True)
class Plane:
    """The equation of the t at which a line meets a plane: a t - b = 0 with a = normal.direction > 0.

    As a quadratic equation, (a t - b)^2 / a = 0, it has one root twice.
    """

    direction: Vector
    normal: Vector
    b: Surd
    c: ClassVar[Surd] = Surd(ZERO)  # nobody asks for it
    discriminant: ClassVar[Surd] = Surd(ZERO)

    @cached_property
    def a(self) -> Surd:
        return dot(self.normal, self.direction)

    def is_before(self, other: Plane) -> bool:
        """Whether the line meets this plane before another one, at a smaller t: b / a < b' / a'."""
        mine, its = self.normal, other.normal
        x, y, z = (self.b * q - other.b * p for p, q in zip(mine, its, strict=True))
        return sign_along(self.direction, (x, y, z)) < 0


@dataclass(frozen=True)
class Quadratic:
    """a t^2 - 2 b t + c = 0. Of the sphere that it comes from, c is the power of the line's start."""

    a: Surd
    b: Surd
    c: Surd

    @cached_property
    def discriminant(self) -> Surd:
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
            low, high = _root_between(max(D.low, ZERO), bits).low, _root_between(max(D.high, ZERO), bits).high
            if e.discriminant.sign() == 0:
                low = high = ZERO
            side = self.side if direct else -self.side
            ends = Interval(b.low + min(side * low, side * high), b.high + max(side * low, side * high))
            numerator, denominator = (ends, e.a.between(bits)) if direct else (e.c.between(bits), ends)
            t = _quotient(numerator, denominator)
            if t and (t.high - t.low) <= abs(t.low) / 2**200:
                return t.low
            bits *= 2


def _quotient(x: Interval, y: Interval) -> Interval | None:
    """All quotients, or None while y may be 0."""
    if y.low <= 0 <= y.high:
        return None
    ends = [p / q for p in (x.low, x.high) for q in (y.low, y.high)]
    return Interval(min(ends), max(ends))
