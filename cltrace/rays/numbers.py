"""Doubles as whole numbers of any size: every finite one is a whole multiple of a power of two.

In numpy, arrays of dtype object hold Python's integers; all else here is plain Python.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Whole = NDArray[Any]  # of dtype object: Python's integers
Signs = NDArray[np.int8]


def signs(x: Whole | NDArray[np.int64]) -> Signs:
    return (x > 0).astype(np.int8) - (x < 0).astype(np.int8)


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


def signs_with_root(p: Any, q: Any, D: Any) -> Signs:
    """The signs of p + q sqrt(D), D >= 0: arrays (n,) of whole numbers."""
    first, second = signs(p), signs(q) * signs(D)
    doubt, out = np.flatnonzero(first * second < 0), np.sign(first + second)
    if len(doubt):
        p, q, D = p[doubt], q[doubt], D[doubt]
        out[doubt] = first[doubt] * signs(p * p - D * (q * q))
    return out


def signs_with_roots(p: Any, one: Any, D: Any, other: Any, E: Any) -> Signs:
    """The signs of p + one sqrt(D) + other sqrt(E): arrays (n,) of whole numbers; one, other: of -1, 0 and 1.

    Where x = p + one sqrt(D) and y = other sqrt(E) differ in sign, x^2 - y^2 is p^2 + D - E plus 2 one p sqrt(D).
    """
    first, second = signs_with_root(p, one, D), other * signs(E)
    out: Signs = np.sign(first + second)
    doubt = np.flatnonzero(first * second < 0)
    if len(doubt):
        p, D, E, one = p[doubt], D[doubt], E[doubt], one[doubt]
        out[doubt] = first[doubt] * signs_with_root(p * p + D - E, p * (2 * one), D)
    return out
