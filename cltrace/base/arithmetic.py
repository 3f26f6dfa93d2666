"""Arithmetic that several layers need: vectors of any numbers, pairs of doubles, and exact inverses of matrices.

A pair (h, l) of arrays stands for the unevaluated sum h + l, with |l| <= u |h|, u = 2^-53. Two transformations are
exact without over- and underflow: two_sum (Knuth, TAOCP 2, 4.2.2) and two_product (Veltkamp, Dekker 1971)
for |x|, |y| < 2^996; the names are those of Ogita, Rump and Oishi 2005. For the four operations of Fine, with all terms
of order u^3 dropped (which the slack below pays for):

  +     two roundings behind the exact sum of the h: x.l + y.l, and that to the error of the sum:
        u u (|x| + |y|) + u (u + u) (|x| + |y|)                                      = 3 u^2 (|x| + |y|)
  *     l l is dropped (1), two products h l are rounded (2), their sum (2), the sum with the error of h h (3):
                                                                                       8 u^2 |x y|
  /     q = x.h / y.h is off by 3 u |x/y|, so R = x - q y <= 3 u |x|, found to 8 + 2 * 3 = 14 u^2 |x|;
        R.h / y.h is off by another 3 u of 3 u |x/y|:                             14 + 9 = 23 u^2 |x/y|
  root  q = sqrt(x.h) is off by 1.5 u sqrt(x), so R = x - q^2 <= 3 u x, found to 6 u^2 x;
        R.h / (2 q) is off by 3 u of 1.5 u sqrt(x):                              3 + 4.5 = 8 u^2 sqrt(x)

All are below EPS = 32 u^2 = 2^-101. FLOOR covers what underflows; what overflows has an infinite error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
Q = TypeVar("Q", int, Fraction, "Fine")
Rows = tuple[tuple[Q, Q, Q], tuple[Q, Q, Q], tuple[Q, Q, Q]]
Floats = NDArray[np.float64]
Pair = tuple[Floats, Floats]
# The operations on pairs lose less than this share of their result.
EPS = 2.0**-101
FLOOR = 2.0**-1000


# Vectors. All functions add and multiply in the same order, so that equal numbers give equal bits.


class Triple(Protocol[T_co]):
    """Three coordinates: a tuple, a list, or an array (3, n)."""

    def __getitem__(self, index: int, /) -> T_co: ...


def dot(u: Any, v: Triple[T]) -> T:
    product: T = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    return product


def cross(u: Any, v: Triple[T]) -> tuple[T, T, T]:
    """Indices that go round need no signs."""
    x, y, z = (u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3))
    return x, y, z


def minus(u: Any, v: Triple[T]) -> tuple[T, T, T]:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def product(rows: Triple[Triple[T]], v: Triple[T]) -> tuple[T, T, T]:
    """The product of a matrix and a vector."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)


# Pairs of doubles.


def two_sum(x: Floats, y: Floats) -> Pair:
    """(h, l) with h = x + y rounded and h + l = x + y exactly."""
    s = x + y
    z = s - x
    return s, (x - (s - z)) + (y - z)


def _halves(x: Floats) -> Pair:
    """x as a sum of two numbers of 26 bits."""
    z = (2.0**27 + 1) * x
    h = z - (z - x)
    return h, x - h


def two_product(x: Floats, y: Floats) -> Pair:
    """(h, l) with h = x y rounded and h + l = x y exactly."""
    p = x * y
    (a, b), (c, d) = _halves(x), _halves(y)
    return p, ((a * c - p) + a * d + b * c) + b * d


def add_quickly(x: Pair, y: Pair) -> Pair:
    """x + y, but for the last digits of l where the sum of the h cancels to less than the rests."""
    s, e = two_sum(x[0], y[0])
    e = e + (x[1] + y[1])
    h = s + e
    return h, e - (h - s)  # the quick sum of Dekker, for |s| >= |e|


@dataclass(frozen=True, slots=True)
class Fine:
    """Pairs h + l with bounds of their errors, so that a sign is known to be right or known to be in doubt.

    A bound may be rounded down by a few ulp: take twice of it. Each result's error is what the operands' errors make of
    it, and EPS for the operation.
    """

    h: Floats
    l: Floats  # noqa: E741
    error: Floats

    @classmethod
    def of(cls, value: Floats) -> Fine:
        """Doubles, which have no error."""
        return cls(value, np.zeros_like(value), np.zeros_like(value))

    @classmethod
    def gap(cls, x: Floats, y: Floats) -> Fine:
        """x - y, which has no error."""
        return cls(*two_sum(x, -y), np.zeros_like(x))

    def __neg__(self) -> Fine:
        return Fine(-self.h, -self.l, self.error)

    def __add__(self, other: Fine) -> Fine:
        s, e = two_sum(self.h, other.h)
        error = self.error + other.error + EPS * (np.abs(self.h) + np.abs(other.h))
        return Fine(*two_sum(s, e + (self.l + other.l)), error)

    def __sub__(self, other: Fine) -> Fine:
        return self + -other

    def __mul__(self, other: Fine) -> Fine:
        (p, e), x, y = two_product(self.h, other.h), np.abs(self.h), np.abs(other.h)
        lost = np.where((x > 0) & (y > 0), EPS * (x * y) + FLOOR, 0)
        error = x * other.error + y * self.error + self.error * other.error + lost
        return Fine(*two_sum(p, e + (self.h * other.l + self.l * other.h)), error)

    def __truediv__(self, other: Fine) -> Fine:
        """Infinite errors where the divisor is not known to half of itself."""
        q, y = self.h / other.h, np.abs(other.h)
        size = np.abs(q)
        lost = np.where(self.h != 0, EPS * size + FLOOR * (1 + 2 / y), 0)
        error = 2 * (self.error + size * other.error) / y + lost
        rest = self - Fine.of(q) * other
        return Fine(*two_sum(q, rest.h / other.h), np.where(y > 2 * other.error, error, np.inf))

    def root(self) -> Fine:
        """The square root of numbers that are surely > 0: off by error / (sqrt(x) + sqrt(exact x))."""
        root = np.sqrt(self.h)
        rest = self - Fine.of(root) * Fine.of(root)
        return Fine(*two_sum(root, rest.h / (2 * root)), (self.error + FLOOR) / root + EPS * root)

    def sign(self) -> NDArray[np.int8]:
        """1 or -1 where it is sure, 0 where it is not."""
        bound = 2 * self.error
        return (self.h > bound).astype(np.int8) - (self.h < -bound).astype(np.int8)

    @property
    def is_rounded(self) -> NDArray[np.bool_]:
        """Where h is surely the double that is nearest."""
        low, high = (self.h + (self.l + sign * 2 * self.error) for sign in (-1, 1))
        return np.asarray((low == self.h) & (high == self.h))

    def __getitem__(self, rows: Any) -> Fine:
        return Fine(self.h[rows], self.l[rows], self.error[rows])


FineVector = tuple[Fine, Fine, Fine]


def fine_vector(v: Floats) -> FineVector:
    """Vectors, (n, 3), which have no error."""
    x, y, z = (Fine.of(v[:, i].copy()) for i in range(3))
    return x, y, z


def select(mask: NDArray[np.bool_], x: Fine, y: Fine) -> Fine:
    """x where the mask is true, y elsewhere."""
    return Fine(np.where(mask, x.h, y.h), np.where(mask, x.l, y.l), np.where(mask, x.error, y.error))


# Inverses of (3, 3) matrices.

# Every number that the rules of scenes allow is a whole multiple of 2^-201: of 2^-149 it is the last of a double's 53
# bits.
_GRID = 201

# From so many on, pairs of doubles are faster than integers; in a block of so many, they stay in the caches.
_FEW, _BLOCK = 64, 4096


def adjugate(m: Sequence[Sequence[Q]]) -> tuple[Rows[Q], Q]:
    """The adjugate of a matrix and its determinant, by which it is to be divided to give the inverse; 0 for none."""
    columns = [cross(m[i - 2], m[i - 1]) for i in range(3)]
    rows: Any = tuple(zip(*columns, strict=True))
    return rows, dot(m[0], columns[0])


def whole_inverse(rows: list[list[float]]) -> tuple[list[list[int]], int]:
    """Integers, (3, 3), and the one by which they are to be divided to give the inverse exactly; 0 if there is none.

    They are the adjugate and the determinant of a matrix whose numbers the rules of scenes allow.
    """
    inverse, determinant = adjugate([[int(x * 2.0**_GRID) for x in row] for row in rows])
    return [[x << _GRID for x in row] for row in inverse], determinant


def inverses(maps: Floats) -> Floats:
    """The inverses of (n, 3, 3) maps whose numbers the rules of scenes allow, each number rounded once; of a singular
    one NaN."""
    result = np.empty(maps.shape)
    for start in range(0, len(maps), _BLOCK):
        block, out = maps[start : start + _BLOCK], result[start : start + _BLOCK]
        sure = np.zeros(len(block), np.bool_)
        if len(block) >= _FEW:
            out[:], sure = _rounded_inverses(block)
        for k in np.flatnonzero(~sure).tolist():
            numerators, determinant = whole_inverse(block[k].tolist())
            # Dividing two integers rounds once.
            out[k] = [[x / determinant for x in row] for row in numerators] if determinant else np.nan
    result += 0.0  # makes -0 a 0
    return result


def _rounded_inverses(maps: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """The inverses of (n, 3, 3) maps by pairs of doubles, and of which of them each number is surely rounded right."""
    m = np.moveaxis(maps, 0, -1)
    with np.errstate(all="ignore"):
        rows, determinant = adjugate([[Fine.of(x) for x in row] for row in m])
        numbers = [x / determinant for row in rows for x in row]
    sure = np.all([x.is_rounded for x in numbers], axis=0)
    return np.stack([x.h for x in numbers], axis=-1).reshape(-1, 3, 3), sure
