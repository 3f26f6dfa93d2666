"""Linear maps of the world, (3, 3) matrices: their inverses, and which of them keep a sphere a sphere; affine maps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Every number that the rules allow is a whole multiple of 2^-201: of 2^-149 it is the last of a double's 53 bits.
_GRID = 201

# From so many on, pairs of doubles are faster than integers; in a block of so many, they stay in the caches.
_FEW, _BLOCK = 64, 4096
Pair = tuple[NDArray[np.float64], NDArray[np.float64]]  # a sum of two: what it is rounded, and what that leaves


def affine(matrix: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points (n, 3) that a (3, 4) matrix makes of (n, 3), each number rounded once from a pair of doubles.

    The products are exact. Their sum is right to 2^-104 of the terms' size before it is rounded.
    """
    result = np.empty(points.shape)
    for start in range(0, len(points), _BLOCK):
        block = points[start : start + _BLOCK]
        for i, row in enumerate(matrix):
            total = np.full(len(block), row[3]), np.zeros(len(block))
            for j in np.flatnonzero(row[:3]).tolist():
                total = _sum_of_pairs(total, exact_product(row[j : j + 1], block[:, j]))
            result[start : start + _BLOCK, i] = total[0]
    return result + 0.0  # makes -0 a 0


def inverses(maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """The inverses of (n, 3, 3) maps whose numbers the rules allow, each number rounded once; of a singular one NaN."""
    result = np.empty(maps.shape)
    for start in range(0, len(maps), _BLOCK):
        block, out = maps[start : start + _BLOCK], result[start : start + _BLOCK]
        sure = np.zeros(len(block), np.bool_)
        if len(block) >= _FEW:
            out[:], sure = _rounded_inverses(block)
        for k in np.flatnonzero(~sure).tolist():
            out[k] = _inverse(block[k].tolist())
    return result


def _rounded_inverses(maps: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The inverses of (n, 3, 3) maps by pairs of doubles, and of which of them each number is surely rounded right.

    With u = 2^-53, let P be the sum of the magnitudes of a cofactor's two products, and Q that of the determinant's
    six. A cofactor is wrong by 4 u^2 P at most: its products are exact, and `_sum_of_pairs` of pairs whose rests
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
        adjugate = _sum_of_pairs(exact_product(a, b), exact_product(-c, d))
        size = np.abs(a * b) + np.abs(c * d)
        high, low = exact_product(m[0], adjugate[0][:, 0])
        terms = high, low + m[0] * adjugate[1][:, 0]
        x, y, z = ((terms[0][k], terms[1][k]) for k in range(3))
        determinant = _sum_of_pairs(_sum_of_pairs(x, y), z)
        whole = (np.abs(m[0]) * size[:, 0]).sum(axis=0)
        quotient = adjugate[0] / determinant[0]
        product = exact_product(quotient, np.broadcast_to(determinant[0], quotient.shape))
        rest = (((adjugate[0] - product[0]) - product[1]) + adjugate[1]) - quotient * determinant[1]
        rest /= determinant[0]
        error = 2.0**-98 * ((size + np.abs(quotient) * whole) / np.abs(determinant[0]))
        result = quotient + (rest - error)
        sure = (result == quotient + (rest + error)).all(axis=(0, 1)) & (np.abs(determinant[0]) > 2.0**-90 * whole)
        return np.moveaxis(result + 0.0, -1, 0), sure


def exact_product(a: NDArray[np.float64], b: NDArray[np.float64]) -> Pair:
    """a b exactly, after Dekker."""
    (x, rest_x), (y, rest_y) = _halves(a), _halves(b)
    p = a * b
    return p, ((x * y - p) + x * rest_y + rest_x * y) + rest_x * rest_y


def _halves(a: NDArray[np.float64]) -> Pair:
    """a as a sum of two numbers of 26 bits."""
    scaled = a * (2.0**27 + 1)
    high = scaled - (scaled - a)
    return high, a - high


def _sum_of_pairs(a: Pair, b: Pair) -> Pair:
    """a + b; the rests are added as doubles."""
    s = a[0] + b[0]
    t = s - a[0]
    rest = ((a[0] - (s - t)) + (b[0] - t)) + (a[1] + b[1])
    high = s + rest
    return high, rest - (high - s)


def _inverse(rows: list[list[float]]) -> NDArray[np.float64]:
    """The exact inverse, each number divided once: dividing two integers rounds once."""
    numerators, determinant = whole_inverse(rows)
    if not determinant:
        return np.full((3, 3), np.nan)
    return np.array([[x / determinant for x in row] for row in numerators]) + 0.0  # makes -0 a 0


def whole_inverse(rows: list[list[float]]) -> tuple[list[list[int]], int]:
    """Integers, (3, 3), and the one by which they are to be divided to give the inverse exactly; 0 if there is none.

    They are the adjugate and the determinant of a matrix whose numbers the rules allow.
    """
    m = [[int(x * 2.0**_GRID) for x in row] for row in rows]
    # Indices that go round need no signs.
    adjugate = [
        [m[j - 2][i - 2] * m[j - 1][i - 1] - m[j - 2][i - 1] * m[j - 1][i - 2] for j in range(3)] for i in range(3)
    ]
    return [[x << _GRID for x in row] for row in adjugate], sum(m[0][j] * adjugate[j][0] for j in range(3))


def uniform_scales(maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much each of (n, 3, 3) maps scales all lengths, (n,); NaN where it is not by the same in all directions.

    That is decided to 2^-50 of L^T L, within which rounding leaves a rotation and a uniform scale.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        square = _products(maps.transpose(0, 2, 1), maps)
        mean = np.trace(square, axis1=1, axis2=2) / 3
        off = np.abs(square - mean[:, None, None] * np.eye(3)).max(axis=(1, 2), initial=0)
        return np.where((off <= 2.0**-50 * mean) & (mean > 0), np.sqrt(mean), np.nan)


def deviations(to_object: NDArray[np.float64], to_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """By which share of their distance from the centre points of ellipsoids may be off, (n,), for rounding.

    to_object: K, (n, 3, 3), as it was rounded; to_world: L, of which it ought to be the inverse. With E = K L - 1, K is
    (1 + E) L^-1. So where the surface is to have |L^-1 x| = r, |K x| differs from r by |E| r at most. |E| is no more
    than the square root of the sum of its squares.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        error: NDArray[np.float64] = np.sqrt(np.square(_products(to_object, to_world) - np.eye(3)).sum(axis=(1, 2)))
        return error


def _products(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The products of (n, 3, 3) matrices, rounded alike on every machine, which `@` does not promise."""
    x, y, z = (a[:, :, k, None] * b[:, k, None, :] for k in range(3))
    return (x + y) + z
