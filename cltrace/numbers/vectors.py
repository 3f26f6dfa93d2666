"""Dot and cross products of triples of any numbers: doubles, arrays, whole numbers, pairs of doubles, surds.

All of them add and multiply in the same order, so that equal numbers give equal bits.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


class Triple(Protocol[T_co]):
    """Three coordinates: a tuple, a list, or an array (3, n)."""

    def __getitem__(self, index: int, /) -> T_co: ...


def dot(u: Triple[T], v: Triple[T]) -> T:
    a: Any = u
    product: T = a[0] * v[0] + a[1] * v[1] + a[2] * v[2]
    return product


def cross(u: Triple[T], v: Triple[T]) -> tuple[T, T, T]:
    """Indices that go round need no signs."""
    a: Any = u
    x, y, z = (a[i - 2] * v[i - 1] - a[i - 1] * v[i - 2] for i in range(3))
    return x, y, z


def minus(u: Triple[T], v: Triple[T]) -> tuple[T, T, T]:
    a: Any = u
    return a[0] - v[0], a[1] - v[1], a[2] - v[2]


def product(rows: Triple[Triple[T]], v: Triple[T]) -> tuple[T, T, T]:
    """The product of a matrix and a vector."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)
