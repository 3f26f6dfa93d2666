"""What doubles know for certain of a ray and a sphere; round.py leaves what they cannot tell to exact.py.

Every quantity here is a double with a bound of its error. u = 2^-53; k stands for the camera's skew, the bound of
|B B^T - 1| (see exact.Frame): camera space is the world but for k. |x| of a vector is bounded by the sum of its
coordinates, |x|_1. What is compared is, along the ray o + t w,

    f = C - o,  a = w.w,  b = f.w,  c = f.f - r^2,  X = |f x w|,  D = a r^2 - X^2,  which is b^2 - a c.

f.  With o = A + p, f is (C - A) - p. Each coordinate of C and A is rounded once (u |C|, u |A|), and both subtractions
    round (u each of what they yield). If the ray starts on a sphere, A is its centre and p = r n: for a normal n
    with n.n = 1 + e it differs from r n / |n| by less than r |e|, turning costs 2 k r and rounding u r. If it starts
    at any other point, that is A, which turning moves by k |A|. All of it is below
        (16 u + 4 k) (|C|_1 + |A|_1 + r) + r |e|                                  [error(f); the same for light - o]
w.  The direction of a ray is off by k |w|; to a parallel light, 64 u + 4 k bounds turning and normalising it.
Products.  Let f' and w' be the errors of f and w.
    b:  |f| w' + |w| f' + f' w', rounding 4 u |f| |w|, turning k |f| |w|
    a:  2 |w| w' + w'^2 + (4 u + k) |w|^2;   c: 2 |f| f' + f'^2 + (4 u + k) |f|^2 + 4 u r^2
    X:  as b; turning scales areas by 1 -/+ 2 k, which 4 k X^2 in D pays for
    D:  r^2 a' + 2 X X' + X'^2 + 8 u (a r^2 + X^2) + 4 k X^2
An ellipsoid sees K B^T f and K B^T w instead: turning them back costs k |f| and 5.2 u |f|, K rounds by 3 u of its size
    (see vectors.Matrix) times |f|, and makes all errors as much larger as that size. There is no skew in its own axes.
Of a start on an ellipsoid, p = B L q r with |p| <= l r, l being the size of L, is off by 5 u l r in the world, and
    turning adds as much: l r takes the place of r. Of a start on a triangle, A is a corner, and its reach that of r.
The bounds themselves are rounded, and products of two errors are dropped where they are third-order: so all are
doubled. FLOOR covers underflow. An overflow makes a bound infinite or NaN, and both compare as a doubt.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cltrace.reference.rays import Start
from cltrace.reference.vectors import Direction, Point

U = 2.0**-53
FLOOR = 2.0**-900


def size_of(p: Point | Direction) -> float:
    """|p|_1, the sum of the coordinates' magnitudes."""
    return (abs(p.x) + abs(p.y)) + abs(p.z)


@dataclass(frozen=True, slots=True)
class Rough:
    """A double and a bound of its error."""

    value: float
    error: float

    def sign(self) -> int | None:
        """The sign of the exact value, None if it is in doubt. It is never known to be 0."""
        if self.value > self.error:
            return 1
        return -1 if self.value < -self.error else None


class RoughStart:
    """Where a ray starts, anchor + p, with what its error depends on."""

    def __init__(self, start: Point | Start, skew: float) -> None:
        self.relative, self.skew = 16 * U + 4 * skew, skew
        self.p: Direction | None
        if isinstance(start, Start):
            self.anchor, self.p = start.anchor, start.from_anchor
            self.size, self.fixed = size_of(self.anchor) + start.reach, start.error
        else:
            self.anchor, self.p, self.size, self.fixed = start, None, size_of(start), 0.0

    def to(self, point: Point) -> tuple[Direction, float]:
        """From the start to a point, and the bound of its error."""
        f = point - self.anchor
        return f - self.p if self.p else f, self.relative * (size_of(point) + self.size) + self.fixed


class RoughLine:
    """A ray that leads along w, with what its errors depend on."""

    def __init__(self, w: Direction, error: float, skew: float) -> None:
        self.products, self.skew = 4 * U + skew, skew
        self.w, self.w_error = w, error
        a = w.dot(w)
        self.length = math.sqrt(a)
        self.a = Rough(a, 2 * (2 * self.length * error + error * error + self.products * a) + FLOOR)

    def excess(self, f: Direction, error: float, r: float) -> Rough:
        """|f|^2 - r^2, the power of what is f away from the centre."""
        ff, rr = f.dot(f), r * r
        bound = 2 * math.sqrt(ff) * error + error * error + self.products * ff + 4 * U * rr
        return Rough(ff - rr, 2 * bound + FLOOR)

    def along(self, f: Direction, error: float) -> Rough:
        """b."""
        size = math.sqrt(f.dot(f))
        bound = size * self.w_error + self.length * error + error * self.w_error + self.products * size * self.length
        return Rough(f.dot(self.w), 2 * bound + FLOOR)

    def rest(self, b: Rough) -> Rough:
        """a - b: what is left of the ray, times w, where it is nearest to the centre."""
        return Rough(self.a.value - b.value, self.a.error + b.error)

    def discriminant(self, f: Direction, error: float, r: float) -> Rough:
        """D."""
        size, rr, across = math.sqrt(f.dot(f)), r * r, f.cross(self.w)
        XX, arr = across.dot(across), self.a.value * rr
        X = math.sqrt(XX)
        X_error = size * self.w_error + self.length * error + error * self.w_error + 4 * U * size * self.length
        bound = rr * self.a.error + 2 * X * X_error + X_error * X_error + 8 * U * (arr + XX) + 4 * self.skew * XX
        return Rough(arr - XX, 2 * bound + FLOOR)
