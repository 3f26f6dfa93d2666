"""Balls that planes have cut, and the discs that cap them: cylinders with a sphere in place of the side."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cltrace.exact.cuts import ExactCut
from cltrace.exact.lines import ExactPoint
from cltrace.exact.shapes import Part
from cltrace.reference.cylinders import Cylinder, OnCylinder
from cltrace.reference.rays import Ray, Start, Way
from cltrace.reference.surfaces import Setting
from cltrace.reference.vectors import Direction, Point, size_of


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


class Cut(Cylinder):
    """A solid ball between two planes, of which the second one is beyond it, or the disc in the first one.

    place: the centre in the world; seen_center: in camera space.
    """

    shape = kind = "cut ball"

    def loose(self, start: Start) -> tuple[float, float]:
        """See Cylinder: of a cut ball nothing counts as on it that is not."""
        return 0, 0

    def solid(self, of: np.void) -> ExactCut:
        self.place = Point(*of["center"].tolist())
        self.seen_center = self.view.seen(ExactPoint.of(self.place))
        # The start of the plane may be far from the ball, and so are the discs' points from there.
        self.reach = self.radius * 2 + size_of(self.place - self.start)
        self.flat = bool(of["flat"])
        return ExactCut(self.start, self.end, self.radius, self.place, self.flat)

    def passes_by(self, way: Way | None) -> bool:
        """Whether a ray surely passes by the ball: |f x w| > r |w|.

        f, from the ray's start to the centre, is off by 48 v s and w by 48 v w1, see cylinders.passes_by(), so f x w is
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
