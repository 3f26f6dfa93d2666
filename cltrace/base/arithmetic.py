"""Arithmetic that several layers need: vectors of any numbers, sums of two doubles, and exact inverses of matrices.

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

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
Q = TypeVar("Q", int, Fraction)
Rows = tuple[tuple[Q, Q, Q], tuple[Q, Q, Q], tuple[Q, Q, Q]]
Floats = NDArray[np.float64]
Pair = tuple[Floats, Floats]
# The operations on pairs lose less than this share of their result.
EPS = 2.0**-101


# Vectors. All functions add and multiply in the same order, so that equal numbers give equal bits.


class Triple(Protocol[T_co]):
    """Three coordinates: a tuple, a list, or an array (3, n)."""

    def __getitem__(self, index: int, /) -> T_co: ...


def dot(u: Triple[T], v: Triple[T]) -> T:
    a: Any = u
    product: T = a[0] * v[0] + a[1] * v[1] + a[2] * v[2]
    return product


def cross(u: Triple[T], v: Triple[T]) -> tuple[T, T, T]:
    """Indices that go round need no signs."""
    a: Any = u
    x, y, z = (a[i - 2] * v[i - 1] - a[i - 1] * v[i - 2] for i in range(3))
    return x, y, z


def minus(u: Triple[T], v: Triple[T]) -> tuple[T, T, T]:
    a: Any = u
    return a[0] - v[0], a[1] - v[1], a[2] - v[2]


def product(rows: Triple[Triple[T]], v: Triple[T]) -> tuple[T, T, T]:
    """The product of a matrix and a vector."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)


# Pairs of doubles.


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


# Inverses of (3, 3) matrices.

# Every number that the rules of scenes allow is a whole multiple of 2^-201: of 2^-149 it is the last of a double's 53
# bits.
_GRID = 201

# From so many on, pairs of doubles are faster than integers; in a block of so many, they stay in the caches.
_FEW, _BLOCK = 64, 4096


def adjugate(m: Sequence[Sequence[Q]]) -> tuple[Rows[Q], Q]:
    """The adjugate of a matrix and its determinant, by which it is to be divided to give the inverse; 0 for none."""
    # Indices that go round need no signs.
    rows: Any = tuple(
        tuple(m[j - 2][i - 2] * m[j - 1][i - 1] - m[j - 2][i - 1] * m[j - 1][i - 2] for j in range(3)) for i in range(3)
    )
    return rows, m[0][0] * rows[0][0] + m[0][1] * rows[1][0] + m[0][2] * rows[2][0]


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
            out[k] = _rounded_inverse(block[k].tolist())
    return result


def _rounded_inverses(maps: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """The inverses of (n, 3, 3) maps by pairs of doubles, and of which of them each number is surely rounded right.

    With u = 2^-53, let P be the sum of the magnitudes of a cofactor's two products, and Q that of the determinant's
    six. A cofactor is wrong by 4 u^2 P at most: its products are exact, and `add_quickly` of pairs whose rests
    are within u loses no more. The determinant D is wrong by 4 u^2 Q for its cofactors, 3 u^2 Q for its products,
    and 16 u^2 Q for two sums of pairs whose rests are within 2 u. A quotient q is wrong by 18 u^2 q for its own
    steps, 4 u^2 P / |D| for the cofactor and 23 u^2 Q q / |D| for the determinant. As q <= P / |D|, that is within
    32 u^2 (P + q Q) / |D| = 2^-101 of them. Eight times as much covers what is of higher order, where |D| > 2^-90
    Q, and the rounding of the bound itself.
    """
    m = np.moveaxis(maps, 0, -1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # Indices that go round need no signs. Entry i, j is the cofactor of j, i.
        i, j = np.ogrid[:3, :3]
        a, b, c, d = m[j - 2, i - 2], m[j - 1, i - 1], m[j - 2, i - 1], m[j - 1, i - 2]
        adjugate = add_quickly(two_product(a, b), two_product(-c, d))
        size = np.abs(a * b) + np.abs(c * d)
        high, low = two_product(m[0], adjugate[0][:, 0])
        terms = high, low + m[0] * adjugate[1][:, 0]
        x, y, z = ((terms[0][k], terms[1][k]) for k in range(3))
        determinant = add_quickly(add_quickly(x, y), z)
        whole = (np.abs(m[0]) * size[:, 0]).sum(axis=0)
        quotient = adjugate[0] / determinant[0]
        product = two_product(quotient, np.broadcast_to(determinant[0], quotient.shape))
        rest = (((adjugate[0] - product[0]) - product[1]) + adjugate[1]) - quotient * determinant[1]
        rest /= determinant[0]
        error = 2.0**-98 * ((size + np.abs(quotient) * whole) / np.abs(determinant[0]))
        result = quotient + (rest - error)
        sure = (result == quotient + (rest + error)).all(axis=(0, 1)) & (np.abs(determinant[0]) > 2.0**-90 * whole)
        return np.moveaxis(result + 0.0, -1, 0), sure


def _rounded_inverse(rows: list[list[float]]) -> Floats:
    """The exact inverse, each number divided once: dividing two integers rounds once."""
    numerators, determinant = whole_inverse(rows)
    if not determinant:
        return np.full((3, 3), np.nan)
    return np.array([[x / determinant for x in row] for row in numerators]) + 0.0  # makes -0 a 0
