"""Linear maps of the world, (3, 3) matrices: which of them keep a sphere a sphere, how exact they are; affine maps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import add_quickly, two_product

_BLOCK = 4096  # the temporary arrays of so many points stay in the caches


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
                total = add_quickly(total, two_product(row[j : j + 1], block[:, j]))
            result[start : start + _BLOCK, i] = total[0]
    return result + 0.0  # makes -0 a 0


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
