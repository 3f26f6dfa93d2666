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

    That is decided to 2^-50 of L^T L: a rotation and a uniform scale, each rounded, are within.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        square = maps.transpose(0, 2, 1) @ maps
        mean = np.trace(square, axis1=1, axis2=2) / 3
        off = np.abs(square - mean[:, None, None] * np.eye(3)).max(axis=(1, 2), initial=0)
        return np.where((off <= 2.0**-50 * mean) & (mean > 0), np.sqrt(mean), np.nan)
