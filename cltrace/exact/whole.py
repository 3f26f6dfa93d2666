"""Doubles as whole numbers of any size: every finite one is a whole multiple of a power of two.

In numpy, arrays of dtype object hold Python's integers; all else here is plain Python.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Whole = NDArray[Any]  # of dtype object: Python's integers
Signs = NDArray[np.int8]


def sign(x: int | Fraction) -> int:
    return (x > 0) - (x < 0)


def signs(x: Whole | NDArray[np.int64]) -> Signs:
    return (x > 0).astype(np.int8) - (x < 0).astype(np.int8)


def over_power(values: Sequence[float | Fraction]) -> tuple[tuple[int, ...], int]:
    """Whole numbers n and the least k >= 0 with value = n / 2^k. A Fraction's denominator must be a power of two."""
    ratios = [(v if isinstance(v, Fraction) else float(v)).as_integer_ratio() for v in values]
    k = max((q.bit_length() - 1 for _, q in ratios), default=0)
    return tuple(p << (k - q.bit_length() + 1) for p, q in ratios), k


def grid_of(*arrays: ArrayLike) -> int:
    """The least k >= 0 such that all these doubles are whole multiples of 2^-k."""
    least = 0
    for array in arrays:
        mantissa, exponent = np.frexp(np.asarray(array, float))
        number = (mantissa * 2.0**53).astype(np.int64)
        _, zeros = np.frexp((number & -number).astype(float))
        lowest = np.where(number == 0, 0, exponent + zeros - 54)
        least = min(least, int(lowest.min(initial=0)))
    return -least


def whole(array: ArrayLike, grid: int) -> Whole:
    """The doubles times 2^grid, of which they are whole multiples."""
    mantissa, exponent = np.frexp(np.asarray(array, float))
    shift = exponent + (grid - 53)
    number = (mantissa * 2.0**53).astype(np.int64)
    number = np.where(shift < 0, number >> np.minimum(-shift, 63), number).astype(object)
    return np.asarray(number << np.maximum(shift, 0).astype(object), object)


def rounded(x: Fraction) -> float:
    """The nearest double; infinite beyond the range of doubles."""
    try:
        return float(x)
    except OverflowError:
        return np.inf if x > 0 else -np.inf
