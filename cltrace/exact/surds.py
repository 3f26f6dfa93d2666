"""Numbers p + q sqrt(s), exactly, and the signs of sums with square roots.

Sums, differences and products of such numbers of one s have that form again, and a sign is found by squaring: of two
terms that differ in sign, the one with the larger square has it. So there is no precision to choose and nothing to
iterate: equal is equal. A root over such numbers is taken care of by squaring once or twice more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any


def sign(x: int | Fraction) -> int:
    return (x > 0) - (x < 0)


class Surd:
    """The real number p + q sqrt(s), with integers p, q and s >= 0.

    Numbers that meet in a sum, a difference or a product must have the same s; an integer has any.
    """

    __slots__ = ("p", "q", "s")

    def __init__(self, p: int, q: int = 0, s: int = 0) -> None:
        self.p, self.q, self.s = p, q if s else 0, s if q else 0

    def _root_of(self, other: Surd) -> int:
        if self.s and other.s and self.s != other.s:
            raise ValueError("two different square roots meet")
        return self.s or other.s

    def __add__(self, other: Surd) -> Surd:
        return Surd(self.p + other.p, self.q + other.q, self._root_of(other))

    def __sub__(self, other: Surd) -> Surd:
        return Surd(self.p - other.p, self.q - other.q, self._root_of(other))

    def __mul__(self, other: Surd) -> Surd:
        if not self.q and not other.q:
            return Surd(self.p * other.p)
        s = self._root_of(other)
        return Surd(self.p * other.p + self.q * other.q * s, self.p * other.q + self.q * other.p, s)

    def times(self, factor: int) -> Surd:
        return Surd(self.p * factor, self.q * factor, self.s)

    def sign(self) -> int:
        """-1, 0 or 1."""
        p, q = sign(self.p), sign(self.q)
        return sign(p + q) if p * q >= 0 else p * sign(self.p * self.p - self.q * self.q * self.s)

    def between(self, bits: int) -> Interval:
        """Two rational numbers with this one between them, that are closer the more bits are asked for."""
        if not self.q:
            return Interval(Fraction(self.p), Fraction(self.p))
        root = root_between(Fraction(self.s), bits)
        ends = sorted((self.p + self.q * root.low, self.p + self.q * root.high))
        return Interval(*ends)


def sign_with_root(p: Surd, q: Surd, D: Surd) -> int:
    """The sign of p + q sqrt(D), D >= 0."""
    x, y = p.sign(), q.sign() * D.sign()
    return sign(x + y) if x * y >= 0 else x * (p * p - q * q * D).sign()


@dataclass(frozen=True, slots=True)
class Interval:
    """All numbers from low to high."""

    low: Fraction
    high: Fraction

    def over(self, other: Interval) -> Interval | None:
        """All quotients, or None while the divisor may be 0."""
        if other.low <= 0 <= other.high:
            return None
        ends = [p / q for p in (self.low, self.high) for q in (other.low, other.high)]
        return Interval(min(ends), max(ends))


def root_between(s: Fraction, bits: int) -> Interval:
    """Bounds of sqrt(s), s >= 0, within 2^-bits of it; both are the root itself if that is rational."""
    # sqrt(n / d) = sqrt(n d) / d, and n d >= 1.
    number = s.numerator * s.denominator << 2 * bits
    root, unit = math.isqrt(number), s.denominator << bits
    return Interval(Fraction(root, unit), Fraction(root if root * root == number else root + 1, unit))


def over_common(values: Any) -> tuple[list[int], int]:
    """Integers, and the one > 0 by which they are to be divided to give these doubles or Fractions."""
    ratios = [v.as_integer_ratio() for v in values]
    over = math.lcm(*(q for _, q in ratios))
    return [p * (over // q) for p, q in ratios], over
