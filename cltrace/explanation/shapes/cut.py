"""Balls that planes have cut: a row of SHAPES."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from cltrace.explanation.shapes.shape import Textbook, common, first_of, solutions
from cltrace.explanation.triples import Triple, number, triple, vector
from cltrace.reference import Direction, Point
from cltrace.reference.cut import Cut


@dataclass(frozen=True)
class CutTest(Textbook):
    """The ball, and the plane that cuts it, in doubles.

    center, radius: of the ball; start: a point of the plane; axis: of length 1, across it, to what is left; flat:
    whether that is the disc in the plane alone; a, b, c: of a t^2 + b t + c = 0; t: the two solutions, or none; plane:
    where the ray is in the plane, NaN if it is parallel to it; inside: from where to where it is in the ball and on the
    plane's side, none if it is nowhere.
    """

    center: Triple
    radius: float
    start: Triple
    axis: Triple
    flat: bool
    a: float
    b: float
    c: float
    t: tuple[float, ...]
    plane: float
    inside: tuple[float, ...]
    surfaces: ClassVar = (Cut,)
    normals: ClassVar = {"cut ball": "P - C, or against u in the plane, normalized"}

    @classmethod
    def of(cls, cut: Cut, o: Point, d: Direction) -> CutTest:
        S, u, flat = cut.start, cut.axis.normalized(), cut.flat
        from_center, R = o - cut.place, cut.radius
        a, b, c = d.dot(d), 2 * d.dot(from_center), from_center.dot(from_center) - R * R
        _, t = solutions(a, b, c)
        height, speed = (o - S).dot(u), d.dot(u)
        plane = -height / speed if speed else math.nan
        nowhere = math.inf, -math.inf
        if flat:
            side = (plane, plane) if speed else nowhere
        elif speed:
            side = (plane, math.inf) if speed > 0 else (-math.inf, plane)
        else:
            side = (-math.inf, math.inf) if height >= 0 else nowhere
        return cls(
            triple(cut.place),
            R,
            start=triple(S),
            axis=triple(u),
            flat=flat,
            a=a,
            b=b,
            c=c,
            t=t,
            plane=plane,
            inside=common(t or nowhere, side),
        )

    @classmethod
    def gap(cls, cut: Cut, o: Point, d: Direction) -> tuple[float, float, Cut]:
        """Of the whole ball; t is where the ray is nearest to its centre."""
        f = cut.place - o
        t = max(0.0, f.dot(d) / d.dot(d))
        return (f - d * t).length() - cut.radius, t, cut

    def first(self, own: bool) -> float:
        return first_of(self.inside, own)

    def lines(self) -> Iterator[str]:
        yield f"    C = {vector(self.center)}, R = {number(self.radius)}; the plane has S = {vector(self.start)}"
        yield f"    u, across it to what is left = {vector(self.axis)}"
        c = f"c = (o - C).(o - C) - R^2 = {number(self.c)}"
        yield f"    a = d.d = {number(self.a)}, b = 2 d.(o - C) = {number(self.b)}, {c}"
        t = map(number, self.t)
        yield "    t1 = {}, t2 = {} on the ball".format(*t) if self.t else "    no intersection with the ball"
        if not math.isnan(self.plane):
            yield f"    t = {number(self.plane)} in the plane"
        ends, where = map(number, self.inside), "in the ball and the plane" if self.flat else "in what is left"
        yield f"    {where} " + "from t = {} to {}".format(*ends) if self.inside else f"    never {where}"
