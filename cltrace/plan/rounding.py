"""Arithmetic in numpy of which the rounding is known: double-double sums, and numbers rounded to one side.

The few sums that must not cancel are of double-doubles: such a number is an unevaluated hi + lo.

Error-free transformations: Dekker 1971, Knuth TAOCP 2, 4.2.2; the names are those of Ogita, Rump and Oishi 2005.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Pair, two_product, two_sum
from cltrace.base.arrays import blockwise

Array = NDArray[np.float64]
Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]
# Unit roundoff of float32: the bounds of the kernel's filters are multiples of it.
U = 2.0**-24
ORIGIN = np.zeros(3)


def total(terms: list[Array]) -> Pair:
    """(hi, lo): the sum of the terms, to 2^-104 of itself and 2^-145 of their magnitudes; hi is hi + lo rounded."""
    hi = terms[0]
    low = np.zeros_like(hi)
    lower = np.zeros_like(hi)
    for term in terms[1:]:
        hi, e = two_sum(hi, term)
        low, e = two_sum(low, e)
        lower = lower + e
    # Where hi has cancelled, low is as large: added to lower at once, it would lose what hi lacks.
    hi, low = two_sum(hi, low)
    return two_sum(hi, low + lower)


def differences(points: Array, point: Array) -> Pair:
    """From a point to points (n, 3): a pair of (n, 3), exact."""
    out, rest = np.empty_like(points), np.empty_like(points)

    def subtract(block: slice) -> None:
        out[block], rest[block] = two_sum(points[block], -point)

    blockwise(len(points), subtract)
    return out, rest


def dot_products(rows: Array, hi: Array, lo: Array) -> Pair:
    """The vectors hi + lo, (n, 3), in the coordinate system of `rows`, (3, 3): a pair of (n, 3)."""
    out, rest = np.empty_like(hi), np.empty_like(hi)

    def turn(block: slice) -> None:
        h, e = hi[block], lo[block]
        for i, row in enumerate(rows):
            terms = []
            for j in np.flatnonzero(row):  # an axis-aligned camera has two zeros a row
                terms += [*two_product(row[j : j + 1], h[:, j]), row[j] * e[:, j]]
            out[block, i], rest[block, i] = total(terms)

    blockwise(len(hi), turn)
    return out, rest


def rotated(rows: Array, v: Array, origin: Array = ORIGIN, unit: float = 1.0) -> Array:
    """The vectors v, (n, 3), from an origin, in the coordinate system of `rows`, (3, 3), times a power of two.

    Without an origin, each is right to a few ulp of its length.
    """
    out = np.empty_like(v)

    def turn(block: slice) -> None:
        x, y, z = (c - o for c, o in zip(v[block].T, origin, strict=True))
        for i, row in enumerate(rows):
            out[block, i] = (row[0] * x + row[1] * y + row[2] * z) * unit

    blockwise(len(v), turn)
    return out


def along(axes: Array, v: Array) -> list[Array]:
    """The coordinates of vectors v, (n, 3), along m axes, (m, 3): m arrays (n,). All machines add in the same order."""
    x, y, z = np.ascontiguousarray(v.T)
    return [(x * a + y * b) + z * c for a, b, c in axes.tolist()]


def square_excess(hi: Array, lo: Array, r: Array) -> Pair:
    """|hi + lo|^2 - r^2 for vectors (n, 3) and radii (n,): a pair of (n,), right to 2^-99 of itself, and so in sign.

    The first sum leaves out the squares of lo, and rounds its products with hi: 2^-104 of the terms' size. What cancels
    more than that allows is summed again from exact terms.
    """
    c, rest = np.empty_like(r), np.empty_like(r)

    def excess(block: slice) -> None:
        h, e = hi[block], lo[block]
        terms = []
        for j in range(3):
            terms += [*two_product(h[:, j], h[:, j]), 2 * h[:, j] * e[:, j]]
        square, error = two_product(r[block], r[block])
        c[block], rest[block] = total([*terms, -square, -error])
        least = np.where(e.any(axis=1), 2.0**-2, _CANCELS) * (squared_length(h) + square)
        rows = np.flatnonzero(np.abs(c[block]) < least) + block.start
        if len(rows):
            c[rows], rest[rows] = _exact_total(_excess_terms(hi[rows], lo[rows], r[rows]))

    blockwise(len(r), excess)
    return c, rest


# Where the terms of total() cancel to less than this share of their size, their sum is not right to 2^-100 of itself.
_CANCELS = 2.0**-44


def _excess_terms(hi: Array, lo: Array, r: Array) -> list[Array]:
    """Numbers (n,) whose sum is |hi + lo|^2 - r^2, exactly."""
    terms = [-part for part in two_product(r, r)]
    for h, e in zip(hi.T, lo.T, strict=True):
        terms += two_product(h, h)
        if e.any():
            terms += [*two_product(2 * h, e), *two_product(e, e)]
    return terms


def _exact_total(terms: list[Array]) -> Pair:
    """The sum of terms (n,): a pair of (n,), right to 2^-99 of itself; 0 only if it is 0.

    A pass of two_sum() along the terms changes their sum in nothing, but leaves one large term and small ones (Rump,
    Ogita and Oishi 2008, VecSum): what cancels does so without a rounding, and its size falls by about 2^-50 a pass. A
    sum of 0 leaves zeros. Each pass is for the rows that are not yet sure; rational numbers are for those of very
    different sizes.
    """
    n = len(terms[0])
    c, rest, rows = np.empty(n), np.empty(n), np.arange(n)
    for _ in range(8):
        near, low = total(terms[::-1])
        sure = np.abs(near) >= _CANCELS * sum(np.abs(term) for term in terms)
        c[rows[sure]], rest[rows[sure]] = near[sure], low[sure]
        rows, terms = rows[~sure], [term[~sure] for term in terms]
        if not len(rows):
            break
        for i in range(1, len(terms)):
            terms[i], terms[i - 1] = two_sum(terms[i], terms[i - 1])
    for row, values in zip(rows.tolist(), np.transpose(terms).tolist(), strict=True):
        exact = sum(map(Fraction, values), Fraction(0))
        c[row] = float(exact)
        rest[row] = float(exact - Fraction(c[row]))
    return c, rest


def squared_length(v: Array) -> Array:
    """|v|^2 of vectors (n, 3): (n,), to a few ulp."""
    x, y, z = v.T
    return np.asarray(x * x + y * y + z * z)


def rounded_down(value: Array) -> NDArray[np.float32]:
    """The largest float32 that is <= value."""
    near = value.astype(np.float32)
    return np.where(near > value, np.nextafter(near, np.float32(-np.inf)), near).astype(np.float32)


def rounded_up(value: Array) -> NDArray[np.float32]:
    """The smallest float32 that is >= value."""
    return -rounded_down(-value)
