"""Vectors of arrays, or of numbers, in the order of operations that kernel and reference have."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats
from cltrace.reference.vectors import Direction, Matrix, Point

Bools = NDArray[np.bool_]
Vector = tuple[Floats, Floats, Floats]


def columns_of(v: Floats) -> Vector:
    return v[:, 0].copy(), v[:, 1].copy(), v[:, 2].copy()


def constant(v: Direction | Point | Sequence[Fraction]) -> Vector:
    x, y, z = np.array([float(x) for x in v])
    return x, y, z


def dot(u: Vector, v: Vector) -> Floats:
    return (u[0] * v[0] + u[1] * v[1]) + u[2] * v[2]


def magnitude(v: Vector) -> Floats:
    return np.asarray((np.abs(v[0]) + np.abs(v[1])) + np.abs(v[2]))


def cross(u: Vector, v: Vector) -> Vector:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def plus(u: Vector, v: Vector) -> Vector:
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


def minus(u: Vector, v: Vector) -> Vector:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def times(k: Floats | NDArray[np.int_] | float, v: Vector) -> Vector:
    return k * v[0], k * v[1], k * v[2]


def pick(mask: Bools, u: Vector, v: Vector) -> Vector:
    return np.where(mask, u[0], v[0]), np.where(mask, u[1], v[1]), np.where(mask, u[2], v[2])


def product(rows: Matrix, v: Vector) -> Vector:
    return dot(constant(rows.x), v), dot(constant(rows.y), v), dot(constant(rows.z), v)
