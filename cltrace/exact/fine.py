"""Pairs of doubles that keep count of their errors, so that a sign is known to be right or known to be in doubt."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import EPS, Floats, add, div, mul, sqrt


@dataclass(frozen=True, slots=True)
class Fine:
    """Pairs h + l with bounds of their errors. A bound may be rounded down by a few ulp: take twice of it.

    Each result's error is what the operands' errors make of it, and EPS for the operation.
    """

    h: Floats
    l: Floats  # noqa: E741
    error: Floats

    @classmethod
    def of(cls, value: Floats) -> Fine:
        """Doubles, which have no error."""
        return cls(value, np.zeros_like(value), np.zeros_like(value))

    @classmethod
    def rounded(cls, value: Fraction) -> Fine:
        """A rational number."""
        h = float(value)
        low = float(value - Fraction(h))
        exact = Fraction(h) + Fraction(low) == value
        return cls(np.array(h), np.array(low), np.array(0.0 if exact else EPS * abs(h)))

    def __neg__(self) -> Fine:
        return Fine(-self.h, -self.l, self.error)

    def __add__(self, other: Fine) -> Fine:
        sum_ = add((self.h, self.l), (other.h, other.l))
        return Fine(*sum_, self.error + other.error + EPS * (np.abs(self.h) + np.abs(other.h)))

    def __sub__(self, other: Fine) -> Fine:
        return self + -other

    def __mul__(self, other: Fine) -> Fine:
        product, x, y = mul((self.h, self.l), (other.h, other.l)), np.abs(self.h), np.abs(other.h)
        return Fine(*product, x * other.error + y * self.error + self.error * other.error + EPS * (x * y))

    def __truediv__(self, other: Fine) -> Fine:
        """Infinite errors where the divisor is not known to half of itself."""
        q = div((self.h, self.l), (other.h, other.l))
        size, y = np.abs(q[0]), np.abs(other.h)
        error = np.where(y > 2 * other.error, 2 * (self.error + size * other.error) / y + EPS * size, np.inf)
        return Fine(*q, error)

    def root(self) -> Fine:
        """The square root of numbers that are surely > 0: off by error / (sqrt(x) + sqrt(exact x))."""
        root = sqrt((self.h, self.l))
        return Fine(*root, self.error / root[0] + EPS * root[0])

    def sign(self) -> NDArray[np.int8]:
        """1 or -1 where it is sure, 0 where it is not."""
        bound = 2 * self.error
        return (self.h > bound).astype(np.int8) - (self.h < -bound).astype(np.int8)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Fine:
        return Fine(self.h[rows], self.l[rows], self.error[rows])


def select(mask: NDArray[np.bool_], x: Fine, y: Fine) -> Fine:
    """x where the mask is true, y elsewhere."""
    return Fine(np.where(mask, x.h, y.h), np.where(mask, x.l, y.l), np.where(mask, x.error, y.error))


FineVector = tuple[Fine, Fine, Fine]


def fine_vector(h: Floats, low: Floats | None = None) -> FineVector:
    """Vectors h + low, (n, 3) each, which have no error."""
    zero = np.zeros(len(h))
    x, y, z = (Fine(h[:, i].copy(), zero if low is None else low[:, i].copy(), zero) for i in range(3))
    return x, y, z
