"""Ellipsoids: spheres under a linear map, and the spheres between which each of them lies."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import inverses, two_sum, whole_inverse
from cltrace.plan.abi import dtype_of
from cltrace.plan.rounding import Array

# Singular values are right to far less than this.
LOOSE = 2.0**-40


@dataclass(frozen=True)
class Maps:
    """The maps that make ellipsoids of n spheres.

    of_sphere: (n,), index of a sphere's map, 0 for none; to_object: (k, 3, 3), K of the scene, the first one is 1;
    to_world: (k, 3, 3), the inverses, each number rounded once; rest: (k, 3, 3), what that cut off; longest: (k,), no
    less than the longest half axis of a sphere of radius 1; shortest: (k,), no more than the shortest one.
    """

    of_sphere: NDArray[np.int32]
    to_object: Array
    to_world: Array
    rest: Array
    longest: Array
    shortest: Array

    @classmethod
    def of(cls, of_sphere: NDArray[np.integer[Any]], to_object: Array) -> Maps:
        """of_sphere, to_object: of the scene, with -1 for no map."""
        K = np.concatenate([np.eye(3)[None], to_object])
        L = inverses(K)
        rest = np.array([_rest(k, hi) for k, hi in zip(K.tolist(), L.tolist(), strict=True)])
        longest = np.linalg.norm(L, 2, axis=(1, 2)) * (1 + LOOSE)
        shortest = 1 / (np.linalg.norm(K, 2, axis=(1, 2)) * (1 + LOOSE))
        longest[0] = shortest[0] = 1
        return cls(
            (of_sphere + 1).astype(np.int32), to_object=K, to_world=L, rest=rest, longest=longest, shortest=shortest
        )

    def packed(self, basis: Array, real: np.dtype[Any]) -> NDArray[np.void]:
        """(k,) records of abi's `Map`. basis: (3, 3), the camera's axes in the world."""
        out = np.zeros(len(self.to_object), dtype_of("Map", "single" if real.itemsize == 4 else "accurate"))
        views = {"to": self.to_object, "from": self.to_world, "rest": self.rest, "camera": self.to_object @ basis.T}
        for name, matrices in views.items():
            for i, axis in enumerate("xyz"):
                out[f"{name}_{axis}"][:, :3] = matrices[:, i]
        out["to_x"][:, 3], out["from_x"][:, 3] = _sizes(self.to_object), _sizes(self.to_world)
        return out

    def sides(self, center: Array, radius: Array, point: Array) -> NDArray[np.int8]:
        """(n,): whether a point is outside of each ellipsoid, 1, on it, 0, or inside, -1; exactly. Of spheres: 0.

        center (n, 3), radius (n,), point (3,): in the world, in scene units.
        """
        out = np.zeros(len(radius), np.int8)
        which = np.flatnonzero(self.of_sphere)
        K = self.to_object[self.of_sphere[which]]
        f, _ = two_sum(center[which], -point)
        F = (K * f[:, None]).sum(axis=2)
        # The difference rounds by 2^-53 of itself and a product with K by some more, so each coordinate is off by less
        # than 2^-50 of the size that it has in K's magnitudes.
        size = (np.abs(K) * np.abs(f)[:, None]).sum(axis=2)
        squares, rr = (F * F).sum(axis=1), radius[which] ** 2
        excess, error = squares - rr, 2.0**-47 * (size * size).sum(axis=1) + 2.0**-50 * rr
        out[which] = np.sign(excess)
        for i in np.flatnonzero(~(np.abs(excess) > error)).tolist():
            out[which[i]] = _exact_side(K[i], center[which[i]], radius[which[i]], point)
        return out


def _sizes(matrices: Array) -> Array:
    """The sums of the magnitudes, from the first number to the last, as the reference adds them up."""
    total = np.zeros(len(matrices))
    for column in np.abs(matrices).reshape(-1, 9).T:
        total = total + column
    return total


def _rest(rows: list[list[float]], rounded: list[list[float]]) -> list[list[float]]:
    """What is cut off of the inverse of a matrix where each of its numbers is rounded."""
    numerators, determinant = whole_inverse(rows)

    def cut(x: int, hi: float) -> float:
        p, q = hi.as_integer_ratio()
        return (x * q - p * determinant) / (determinant * q)

    return [[cut(x, hi) for x, hi in zip(*row, strict=True)] for row in zip(numerators, rounded, strict=True)]


def _exact_side(K: Array, center: Array, radius: float, point: Array) -> int:
    f = [Fraction(a) - Fraction(b) for a, b in zip(center.tolist(), point.tolist(), strict=True)]
    F = [sum((Fraction(k) * x for k, x in zip(row, f, strict=True)), Fraction(0)) for row in K.tolist()]
    excess = sum((x * x for x in F), Fraction(0)) - Fraction(float(radius)) ** 2
    return (excess > 0) - (excess < 0)
