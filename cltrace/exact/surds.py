"""Numbers p + q sqrt(s), exactly, and the signs of sums with square roots.

Sums, differences and products of such numbers of one s have that form again, and a sign is found by squaring: of two
terms that differ in sign, the one with the larger square has it. So there is no precision to choose and nothing to
iterate: equal is equal. A root over such numbers is taken care of by squaring once or twice more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Generic, TypeVar

import numpy as np

from cltrace.exact.whole import Signs, Whole, sign, signs

Q = TypeVar("Q", int, Fraction)


class Surd(Generic[Q]):
    """The real number p + q sqrt(s); p, q and s >= 0 are integers, or Fractions.

    Numbers that meet in a sum, a difference or a product must have the same s; a rational number has any.
    """

    __slots__ = ("p", "q", "s")
    p: Q
    q: Q
    s: Q

    def __init__(self, p: Q, q: Q | int = 0, s: Q | int = 0) -> None:
        self.p, self.q, self.s = p, q, s if q else 0  # type: ignore[assignment]

    def _root_of(self, other: Surd[Q]) -> Q:
        if self.s and other.s and self.s != other.s:
            raise ValueError("two different square roots meet")
        return self.s or other.s

    def __add__(self, other: Surd[Q]) -> Surd[Q]:
        return Surd(self.p + other.p, self.q + other.q, self._root_of(other))

    def __sub__(self, other: Surd[Q]) -> Surd[Q]:
        return Surd(self.p - other.p, self.q - other.q, self._root_of(other))

    def __mul__(self, other: Surd[Q]) -> Surd[Q]:
        if not self.q and not other.q:
            return Surd(self.p * other.p)
        s = self._root_of(other)
        return Surd(self.p * other.p + self.q * other.q * s, self.p * other.q + self.q * other.p, s)

    def times(self, factor: Q | int) -> Surd[Q]:
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


def sign_with_root(p: Surd[Q], q: Surd[Q], D: Surd[Q]) -> int:
    """The sign of p + q sqrt(D), D >= 0."""
    x, y = p.sign(), q.sign() * D.sign()
    return sign(x + y) if x * y >= 0 else x * (p * p - q * q * D).sign()


class Surds:
    """Arrays of numbers p + q sqrt(s), of one shape, of whole p, q and s >= 0. q None: of all it is 0.

    As of a Surd, numbers that meet have the same s, or one of them is rational.
    """

    __slots__ = ("p", "q", "s")

    def __init__(self, p: Whole, q: Whole | None = None, s: Whole | None = None) -> None:
        self.p, self.q, self.s = p, q, s

    @classmethod
    def all(cls, parts: Sequence[Surds]) -> Surds:
        """One array after the other. If one has roots, all have."""
        columns: Any = zip(*((x.p, x.q, x.s) for x in parts), strict=True)
        p, q, s = (None if column[0] is None else np.concatenate(column) for column in columns)
        assert p is not None
        return cls(p, q, s)

    def filled(self, s: Whole | None) -> Surds:
        """The same numbers with these s, (n,), if they are rational."""
        return self if s is None or self.q is not None else Surds(self.p, 0 * s, s)

    def __add__(self, other: Surds) -> Surds:
        return self._sum(other, 1)

    def __sub__(self, other: Surds) -> Surds:
        return self._sum(other, -1)

    def _sum(self, other: Surds, sign: int) -> Surds:
        p, s = self.p + sign * other.p, self.s if self.s is not None else other.s
        if self.q is None or other.q is None:
            return Surds(p, self.q if other.q is None else sign * other.q, s)
        return Surds(p, self.q + sign * other.q, s)

    def __mul__(self, other: Surds | Whole) -> Surds:
        if not isinstance(other, Surds):
            return Surds(self.p * other, None if self.q is None else self.q * other, self.s)
        p, s = self.p * other.p, self.s if self.s is not None else other.s
        if self.q is None or other.q is None:
            q = None if self.q is other.q else self.p * other.q if self.q is None else self.q * other.p
            return Surds(p, q, s)
        return Surds(p + self.q * other.q * s, self.p * other.q + self.q * other.p, s)

    def signs(self) -> Signs:
        return signs(self.p) if self.q is None or self.s is None else signs_with_root(self.p, self.q, self.s)

    def __getitem__(self, rows: Any) -> Surds:
        return (
            Surds(self.p[rows]) if self.q is None or self.s is None else Surds(self.p[rows], self.q[rows], self.s[rows])
        )

    def one(self, i: int) -> Surd[int]:
        return Surd(self.p[i]) if self.q is None or self.s is None else Surd(self.p[i], self.q[i], self.s[i])


def _signs(x: Any) -> Signs:
    return x.signs() if isinstance(x, Surds) else signs(x)


def signs_with_root(p: Any, q: Any, D: Any) -> Signs:
    """The signs of p + q sqrt(D), D >= 0: arrays (n,) of whole numbers, or Surds."""
    first, second = _signs(p), _signs(q) * _signs(D)
    doubt, out = np.flatnonzero(first * second < 0), np.sign(first + second)
    if len(doubt):
        p, q, D = p[doubt], q[doubt], D[doubt]
        out[doubt] = first[doubt] * _signs(p * p - D * (q * q))
    return out


def signs_with_roots(p: Any, one: Any, D: Any, other: Any, E: Any) -> Signs:
    """The signs of p + one sqrt(D) + other sqrt(E): arrays (n,) of whole numbers, or Surds; one, other: of -1, 0 and 1.

    Where x = p + one sqrt(D) and y = other sqrt(E) differ in sign, x^2 - y^2 is p^2 + D - E plus 2 one p sqrt(D).
    """
    first, second = signs_with_root(p, one, D), other * _signs(E)
    out: Signs = np.sign(first + second)
    doubt = np.flatnonzero(first * second < 0)
    if len(doubt):
        p, D, E, one = p[doubt], D[doubt], E[doubt], one[doubt]
        out[doubt] = first[doubt] * signs_with_root(p * p + D - E, p * (2 * one), D)
    return out


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
