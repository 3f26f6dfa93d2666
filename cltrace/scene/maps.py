"""Linear maps of the world, (3, 3) matrices: their inverses, and which of them keep a sphere a sphere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Every number that the rules allow is a whole multiple of 2^-201: of 2^-149 it is the last of a double's 53 bits.
_GRID = 201


def inverses(maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """The inverses of (n, 3, 3) maps whose numbers the rules allow, each number rounded once; of a singular one NaN."""
    result = np.full(maps.shape, np.nan)
    straight = ~maps.any(axis=(1, 2), where=~np.eye(3, dtype=bool)) & np.diagonal(maps, axis1=1, axis2=2).all(axis=1)
    result[straight] = 0.0
    for i in range(3):
        result[straight, i, i] = 1.0 / maps[straight, i, i]
    for k in np.flatnonzero(~straight).tolist():
        result[k] = _inverse(maps[k].tolist())
    return result


def _inverse(rows: list[list[float]]) -> NDArray[np.float64]:
    """The adjugate over the determinant, both in integers: dividing two of them rounds once."""
    m = [[int(x * 2.0**_GRID) for x in row] for row in rows]
    # Indices that go round need no signs.
    adjugate = [
        [m[j - 2][i - 2] * m[j - 1][i - 1] - m[j - 2][i - 1] * m[j - 1][i - 2] for j in range(3)] for i in range(3)
    ]
    determinant = sum(m[0][j] * adjugate[j][0] for j in range(3))
    if not determinant:
        return np.full((3, 3), np.nan)
    return np.array([[(x << _GRID) / determinant for x in row] for row in adjugate]) + 0.0  # makes -0 a 0


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
