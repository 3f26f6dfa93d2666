"""Spheres and ellipsoids, exactly."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from cltrace.base.arithmetic import dot, exact_inverse, minus
from cltrace.exact.surds import Surd
from cltrace.reference.exact import ZERO, Line, Quadratic, Rational, Rows, Vector, product, vector


@dataclass(frozen=True)
class Ball:
    """The points p with |K (p - center)| = radius, from the eye along the world's axes.

    to_object: K, which leads from the world to the own axes of an ellipsoid; None for a sphere, where K = 1.
    """

    center: Rational
    radius: Fraction
    to_object: Rows | None = None

    @cached_property
    def to_world(self) -> Rows | None:
        """L, the inverse of K."""
        return exact_inverse(self.to_object) if self.to_object else None

    def seen(self, v: Vector) -> Vector:
        """K v."""
        if not self.to_object:
            return v
        x, y, z = (v[0].times(a) + v[1].times(b) + v[2].times(c) for a, b, c in self.to_object)
        return x, y, z

    def power(self, p: Rational) -> Fraction:
        """|K (p - center)|^2 - radius^2, the power of a point: > 0 outside, 0 on the surface, < 0 inside."""
        x, y, z = (a - b for a, b in zip(p, self.center, strict=True))
        w = product(self.to_object, (x, y, z)) if self.to_object else (x, y, z)
        return sum((a * a for a in w), ZERO) - self.radius * self.radius

    def point(self, n: Rational) -> Vector:
        """The point center + radius L n / |n|. As |n| = sqrt(s), it is center + (radius L n / s) sqrt(s)."""
        s = sum((x * x for x in n), ZERO)
        step = product(self.to_world, n) if self.to_world else n
        x, y, z = (Surd(c, self.radius * a / s, s) for c, a in zip(self.center, step, strict=True))
        return x, y, z

    def met_by(self, line: Line) -> Quadratic:
        """The equation of the t at which a line meets it."""
        f, d = self.seen(minus(vector(self.center), line.start)), self.seen(line.direction)
        return Quadratic(dot(d, d), dot(f, d), dot(f, f) - Surd(self.radius * self.radius))
