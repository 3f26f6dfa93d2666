"""Double-double arithmetic in numpy for the oracle's filters, with bounds of its errors.

A pair (h, l) of arrays stands for h + l, with |l| <= u |h|, u = 2^-53. Two lemmas, exact without over- and underflow:
two_sum (Knuth) and two_product (Veltkamp, Dekker). For the four operations below, with all terms of order u^3 dropped
(which the slack below pays for):

  add:   two roundings behind the exact sum of the h: x.l + y.l, and that to the error of the sum:
         u u (|x| + |y|) + u (u + u) (|x| + |y|)                                      = 3 u^2 (|x| + |y|)
  mul:   l l is dropped (1), two products h l are rounded (2), their sum (2), the sum with the error of h h (3):
                                                                                        8 u^2 |x y|
  div:   q = x.h / y.h is off by 3 u |x/y|, so R = x - q y <= 3 u |x|, found to 8 + 2 * 3 = 14 u^2 |x|;
         R.h / y.h is off by another 3 u of 3 u |x/y|:                             14 + 9 = 23 u^2 |x/y|
  sqrt:  q = sqrt(x.h) is off by 1.5 u sqrt(x), so R = x - q^2 <= 3 u x, found to 6 u^2 x;
         R.h / (2 q) is off by 3 u of 1.5 u sqrt(x):                              3 + 4.5 = 8 u^2 sqrt(x)

All are below EPS = 32 u^2 = 2^-101.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Pair = tuple[Floats, Floats]
EPS = 2.0**-101


def two_sum(x: Floats, y: Floats) -> Pair:
    s = x + y
    z = s - x
    return s, (x - (s - z)) + (y - z)


def _halves(x: Floats) -> Pair:
    z = 134217729.0 * x  # 2^27 + 1
    h = z - (z - x)
    return h, x - h


def two_product(x: Floats, y: Floats) -> Pair:
    p = x * y
    (a, b), (c, d) = _halves(x), _halves(y)
    return p, ((a * c - p) + a * d + b * c) + b * d


def add(x: Pair, y: Pair) -> Pair:
    s, e = two_sum(x[0], y[0])
    return two_sum(s, e + (x[1] + y[1]))


def neg(x: Pair) -> Pair:
    return -x[0], -x[1]


def where(mask: NDArray[np.bool_], x: Pair, y: Pair) -> Pair:
    return np.where(mask, x[0], y[0]), np.where(mask, x[1], y[1])


def mul(x: Pair, y: Pair) -> Pair:
    p, e = two_product(x[0], y[0])
    return two_sum(p, e + (x[0] * y[1] + x[1] * y[0]))


def div(x: Pair, y: Pair) -> Pair:
    q = x[0] / y[0]
    rest = add(x, neg(mul((q, np.zeros_like(q)), y)))
    return two_sum(q, rest[0] / y[0])


def sqrt(x: Pair) -> Pair:
    q = np.sqrt(x[0])
    rest = add(x, neg(two_product(q, q)))
    return two_sum(q, rest[0] / (2 * q))


@dataclass(frozen=True, slots=True)
class Fine:
    """Pairs h + l with bounds of their errors. A bound may be rounded down by a few ulp: take twice of it.

    Each result's error is what the operands' errors make of it, and EPS for the operation.
    """

    h: Floats
    l: Floats  # noqa: E741
    error: Floats

    @classmethod
    def of(cls, value: Floats) -> Fine:
        """Doubles, which have no error."""
        return cls(value, np.zeros_like(value), np.zeros_like(value))

    @classmethod
    def rounded(cls, value: Fraction) -> Fine:
        """A rational number."""
        h = float(value)
        low = float(value - Fraction(h))
        exact = Fraction(h) + Fraction(low) == value
        return cls(np.array(h), np.array(low), np.array(0.0 if exact else EPS * abs(h)))

    def __neg__(self) -> Fine:
        return Fine(-self.h, -self.l, self.error)

    def __add__(self, other: Fine) -> Fine:
        sum_ = add((self.h, self.l), (other.h, other.l))
        return Fine(*sum_, self.error + other.error + EPS * (np.abs(self.h) + np.abs(other.h)))

    def __sub__(self, other: Fine) -> Fine:
        return self + -other

    def __mul__(self, other: Fine) -> Fine:
        product, x, y = mul((self.h, self.l), (other.h, other.l)), np.abs(self.h), np.abs(other.h)
        return Fine(*product, x * other.error + y * self.error + self.error * other.error + EPS * (x * y))

    def __truediv__(self, other: Fine) -> Fine:
        """Infinite errors where the divisor is not known to half of itself."""
        q = div((self.h, self.l), (other.h, other.l))
        size, y = np.abs(q[0]), np.abs(other.h)
        error = np.where(y > 2 * other.error, 2 * (self.error + size * other.error) / y + EPS * size, np.inf)
        return Fine(*q, error)

    def root(self) -> Fine:
        """The square root of numbers that are surely > 0: off by error / (sqrt(x) + sqrt(exact x))."""
        root = sqrt((self.h, self.l))
        return Fine(*root, self.error / root[0] + EPS * root[0])

    def sign(self) -> NDArray[np.int8]:
        """1 or -1 where it is sure, 0 where it is not."""
        bound = 2 * self.error
        return (self.h > bound).astype(np.int8) - (self.h < -bound).astype(np.int8)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Fine:
        return Fine(self.h[rows], self.l[rows], self.error[rows])


def select(mask: NDArray[np.bool_], x: Fine, y: Fine) -> Fine:
    return Fine(np.where(mask, x.h, y.h), np.where(mask, x.l, y.l), np.where(mask, x.error, y.error))
