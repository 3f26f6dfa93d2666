"""Double-double arithmetic in numpy, with bounds of its errors.

A pair (h, l) of arrays stands for the unevaluated sum h + l, with |l| <= u |h|, u = 2^-53. Three transformations are
exact without over- and underflow: two_sum (Knuth, TAOCP 2, 4.2.2), quick_two_sum (Dekker 1971) where |x| >= |y|, and
two_product (Veltkamp, Dekker 1971) for |x|, |y| < 2^996; the names are those of Ogita, Rump and Oishi 2005. For the
four operations below, with all terms of order u^3 dropped (which the slack below pays for):

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

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Pair = tuple[Floats, Floats]
EPS = 2.0**-101


def two_sum(x: Floats, y: Floats) -> Pair:
    """(h, l) with h = x + y rounded and h + l = x + y exactly."""
    s = x + y
    z = s - x
    return s, (x - (s - z)) + (y - z)


def quick_two_sum(x: Floats, y: Floats) -> Pair:
    """The same where |x| >= |y|."""
    s = x + y
    return s, y - (s - x)


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


def add(x: Pair, y: Pair) -> Pair:
    s, e = two_sum(x[0], y[0])
    return two_sum(s, e + (x[1] + y[1]))


def add_quickly(x: Pair, y: Pair) -> Pair:
    """The same but for the last digits of l where the sum of the h cancels to less than the rests."""
    s, e = two_sum(x[0], y[0])
    return quick_two_sum(s, e + (x[1] + y[1]))


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
