"""a t^2 - 2 b t + c = 0 in double precision, for a ray and a sphere: each number in the form that keeps its digits.

A ray from the eye is computed as the kernel does it, operation by operation, so that both get the same bits; doubles
decide where they are sure to be right, and exact.py where not. A ray from anywhere else is ruled out by doubles where
those are sure, and otherwise left to exact.py altogether.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

from cltrace.reference.doubt import surely_misses
from cltrace.reference.exact import Quadratic, minus, vector
from cltrace.reference.rays import EYE, Ray
from cltrace.reference.vectors import Direction

if TYPE_CHECKING:
    from cltrace.reference.surfaces import Sphere


def equation_of(sphere: Sphere, ray: Ray) -> Equation:
    a = ray.direction.dot(ray.direction)
    # Directions whose squares leave the range of double are for exact arithmetic.
    return FromEye(sphere, ray) if ray.origin == EYE and 2.0**-900 < a < 2.0**900 else FromAnywhere(sphere, ray)


class Equation(ABC):
    """The two ends of the way through the sphere are told apart by their side: -1 the near one, 1 the far one."""

    def __init__(self, sphere: Sphere, ray: Ray) -> None:
        self.sphere, self.ray = sphere, ray

    @cached_property
    def exact(self) -> Quadratic:
        """The same equation in exact numbers."""
        return self.ray.line(self.sphere.frame).through(self.sphere.ball)

    @abstractmethod
    def side(self) -> int | None:
        """The end that the ray meets first, strictly within its range; None if there is none."""

    @abstractmethod
    def t(self, side: int) -> float:
        """Where on the ray that end is."""

    @abstractmethod
    def from_center(self, side: int, t: float) -> Direction:
        """From the sphere's centre to the point at that end, in camera space, rounded."""

    @abstractmethod
    def distance(self, t: float) -> float:
        """How far along the ray that is, in scene units."""


class FromEye(Equation):
    """The tutorial's equation for a ray that starts at the eye, where C - o is the centre itself.

    c = |C|^2 - r^2 comes from the exact scene, rounded once. The discriminant b^2 - a c is kept where it is accurate,
    for |b| < r |d| and from inside; elsewhere a (r^2 - |v|^2) is, where v leads from the ray's closest point to the
    centre. kernels/shapes/sphere.cl derives both, and the bound below which the sign of the result is in doubt.
    """

    def __init__(self, sphere: Sphere, ray: Ray) -> None:
        super().__init__(sphere, ray)
        C, d, r, c = sphere.center - EYE, ray.direction, sphere.radius, sphere.eye_power
        self.a, self.b, self.outside = d.dot(d), C.dot(d), sphere.eye_outside
        k = self.b * (1 / self.a)
        self.v = Direction(C.x - k * d.x, C.y - k * d.y, C.z - k * d.z)
        bb, rr, arr = self.b * self.b, r * r, self.a * (r * r)
        self.by_b = bb < arr or not self.outside
        self.discriminant = bb - self.a * c if self.by_b else self.a * (rr - self.v.dot(self.v))
        # Of a sphere this far and small, v would have lost too many digits for the normal.
        tiny = arr < bb * 2.0**-42
        self.unsure = not abs(self.discriminant) > (bb + arr) * 2.0**-48
        if self.unsure or tiny:
            self.discriminant = float(self.exact.discriminant.p)
            self.hits = self.exact.discriminant.sign() >= 0
            if tiny:
                self.v = self._exact_v()
            # All but on the sphere, and all but along it, b cancels, too.
            if self.unsure and bb < arr * 2.0**-16:
                self.b = float(self.exact.b.p)
        else:
            self.hits = self.discriminant >= 0
        self.root = math.sqrt(max(self.discriminant, 0.0))

    def _exact_v(self) -> Direction:
        ball, frame, d = self.sphere.ball, self.sphere.frame, self.sphere.frame.to_world(self.ray.direction)
        k = self.exact.b.p / self.exact.a.p
        x, y, z = (c - k * e for c, e in zip(ball.center, d, strict=True))
        return Direction(*map(float, frame.to_camera((x, y, z))))

    def side(self) -> int | None:
        return next((side for side in (-1, 1) if self._is_in_range(side)), None) if self.hits else None

    def _is_in_range(self, side: int) -> bool:
        """By doubles, which are off by 2^-25 at most, unless the sign of the discriminant or this is in doubt."""
        low, high, t = self.ray.t_min, self.ray.t_max, self._t(side)
        if self.unsure or not abs(t - low) > abs(low) * 2.0**-22 or not abs(t - high) > t * 2.0**-22:
            return next(root for root in self.exact.roots() if root.side == side).is_between(low, high)
        return low < t < high

    def t(self, side: int) -> float:
        t = self._t(side)
        if not self.ray.t_min < t < self.ray.t_max:  # only the exact one is
            t = float(next(root for root in self.exact.roots() if root.side == side).value())
        return t

    def _t(self, side: int) -> float:
        """b - root or b + root might cancel: with q = b + root, or b - root if b < 0, the roots are q / a and c / q."""
        a, b, c, root = self.a, self.b, self.sphere.eye_power, self.root
        if side < 0 and b >= 0 and not self.by_b and a * c > 2.0**-10 * (b * b):
            return (b - root) * (1 / a)  # does not cancel much, and needs no division
        q = b - root if b < 0 else b + root
        numerator, denominator = (q, a) if (b < 0) == (side < 0) else (c, q)
        return numerator / denominator if denominator else 0.0

    def from_center(self, side: int, t: float) -> Direction:
        """t d - C, or without its cancellation -v -/+ sqrt(D)/a d, where the discriminant comes from v."""
        if self.by_b:
            return self.ray.direction * t - (self.sphere.center - EYE)
        along = self.ray.direction * (self.root * (1 / self.a))
        return -(self.v + along) if side < 0 else along - self.v

    def distance(self, t: float) -> float:
        return t * math.sqrt(self.a)


class FromAnywhere(Equation):
    """The equation of any ray: where doubles do not rule it out, all of it is exact, and rounded in the end."""

    def side(self) -> int | None:
        if surely_misses(self.sphere, self.ray):
            return None
        root = self.exact.first(self.ray.t_min, self.ray.t_max)
        return None if root is None else root.side

    def _value(self, side: int) -> Fraction:
        return next(root for root in self.exact.roots() if root.side == side).value()

    def t(self, side: int) -> float:
        try:
            return float(self._value(side))
        except OverflowError:
            return math.inf

    def from_center(self, side: int, t: float) -> Direction:
        """start + t d - C with the t of exact arithmetic, not the rounded one."""
        frame, line, bits = self.sphere.frame, self.ray.line(self.sphere.frame), 256
        start, t_exact = minus(line.start, vector(self.sphere.ball.center)), self._value(side)
        x, y, z = (p.between(bits).low + t_exact * q.p for p, q in zip(start, line.direction, strict=True))
        return Direction(*map(float, frame.to_camera((x, y, z))))

    def distance(self, t: float) -> float:
        return t * self.ray.direction.length()
