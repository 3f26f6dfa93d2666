"""Balls that planes have cut, and the discs that cap them: cylinders with a sphere in place of the side."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from cltrace.base.arithmetic import dot, minus
from cltrace.exact.surds import Surd
from cltrace.reference.crossing import Way
from cltrace.reference.cylinder import Cylinder, OnCylinder, Part, Tube
from cltrace.reference.doubt import size_of
from cltrace.reference.exact import ZERO, Line, Quadratic, Rational, Vector, between, vector
from cltrace.reference.rays import Ray, Start
from cltrace.reference.surfaces import Setting
from cltrace.reference.vectors import Direction, Point


@dataclass(frozen=True)
class Segment(Tube):
    """The points p with |p - C| <= r and 0 <= (p - S).u <= u.u, or, flat, with (p - S).u = 0; exactly, as a Tube.

    center: C.
    """

    center: Rational = (ZERO, ZERO, ZERO)
    flat: bool = False

    def side(self, line: Line) -> Quadratic:
        f, w = minus(vector(self.center), line.start), line.direction
        return Quadratic(dot(w, w), dot(f, w), dot(f, f) - Surd(self.radius * self.radius))

    @property
    def depth(self) -> Fraction:
        return ZERO if self.flat else self.uu

    def is_beside(self, p: Rational) -> bool:
        return sum(((a - b) ** 2 for a, b in zip(p, self.center, strict=True)), ZERO) > self.radius * self.radius


@dataclass(frozen=True)
class OnCut(OnCylinder):
    """A point of a cut ball: exactly C + r m / |m| on the sphere, m = (2 k - 1) u + a e1 + b e2; on the disc as of a
    cylinder, S + a e1 + b e2, where both ends of what is flat are one."""

    cylinder: Cut

    @property
    def place(self) -> Point:
        return self.cylinder.place if self.part == "side" else self.cylinder.start

    @cached_property
    def anchor(self) -> Point:
        return self.cylinder.seen_center if self.part == "side" else self.cylinder.seen_start

    @cached_property
    def step(self) -> Direction:
        of = self.cylinder
        m = of.e1 * self.a + of.e2 * self.b
        if self.part != "side":
            return m
        m = of.axis * (2 * self.k - 1) + m
        return m * (of.radius * (1 / math.sqrt(m.dot(m))))

    @cached_property
    def exact_point(self) -> Vector:
        of, across = self.cylinder.segment, self.exact_across
        if self.part != "side":
            x, y, z = (Surd(s + v) for s, v in zip(of.start, across, strict=True))
            return x, y, z
        along = 2 * Fraction(self.k) - 1
        m = [along * u + v for u, v in zip(of.axis, across, strict=True)]
        square = sum((v * v for v in m), ZERO)
        x, y, z = (Surd(c, of.radius * v / square, square) for c, v in zip(of.center, m, strict=True))
        return x, y, z


class Cut(Cylinder):
    """A solid ball between two planes, of which the second one is beyond it, or the disc in the first one.

    segment: what that is, exactly; place: the centre in the world; seen_center: in camera space.
    """

    shape = kind = "cut ball"

    def loose(self, start: Start) -> tuple[float, float]:
        """See Cylinder: of a cut ball nothing counts as on it that is not."""
        return 0, 0

    def solid(self, of: np.void) -> Segment:
        self.place = Point(*of["center"].tolist())
        center = between(self.eye, self.place)
        self.seen_center = Point(*map(float, self.frame.to_camera(center)))
        # The start of the plane may be far from the ball, and so are the discs' points from there.
        self.reach = self.radius * 2 + size_of(self.place - self.start)
        start, axis = between(self.eye, self.start), between(self.start, self.end)
        self.segment = Segment(start, axis, Fraction(self.radius), center, flat=bool(of["flat"]))
        return self.segment

    def passes_by(self, way: Way | None) -> bool:
        """Whether a ray surely passes by the ball: |f x w| > r |w|.

        f, from the ray's start to the centre, is off by 48 v s and w by 48 v w1, see cylinder.passes_by(), so f x w is
        by less than 100 v s w1.
        """
        if way is None:
            return False
        f, w = way.to(self.place), way.w
        s = size_of(f) + way.reach
        beside = f.cross(w).length() - 2.0**-45 * s * way.w1
        return beside > self.radius * (w.length() + 2.0**-45 * way.w1) * (1 + 2.0**-45)

    def point_at(self, ray: Ray, t: float, part: Part) -> OnCut:
        way, side = self.way(ray), part == "side"
        p = way.w * t - way.to(self.place if side else self.start)
        u, k = self.axis, 0.0
        m = p - u * (p.dot(u) / u.dot(u))
        if side:
            over, length = 1 / math.sqrt(p.dot(p)), math.sqrt(u.dot(u))
            k = 0.5 + 0.5 * max(-1.0, min(1.0, p.dot(u) * over / length))
            m = m * (over * length)
        a, b = m.dot(self.e1) / self.e1.dot(self.e1), m.dot(self.e2) / self.e2.dot(self.e2)
        return OnCut(self, part, k=k, a=a, b=b)

    def outward(self, at: OnCylinder) -> Direction:
        return at.step.normalized() if at.part == "side" else super().outward(at)


def cuts(setting: Setting) -> Iterator[Cut]:
    """Those of a scene."""
    return (Cut(of, setting, setting.material(int(of["material"]))) for of in setting.scene.cuts)
