"""Inverses of (3, 3) matrices: exactly, in plain Python, and rounded once, in numpy."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from cltrace.numbers.pairs import Floats, add_quickly, two_product

Q = TypeVar("Q", int, Fraction)
Rows = tuple[tuple[Q, Q, Q], tuple[Q, Q, Q], tuple[Q, Q, Q]]

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


def exact_inverse(m: Sequence[Sequence[Fraction]]) -> Rows[Fraction]:
    """The inverse of a matrix that has one."""
    rows, determinant = adjugate(m)
    x, y, z = ((a / determinant, b / determinant, c / determinant) for a, b, c in rows)
    return x, y, z


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
