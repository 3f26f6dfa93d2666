"""Cylinders with flat ends: a row of SHAPES."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from cltrace.explanation.shapes.shape import Textbook, common, first_of, solutions
from cltrace.explanation.triples import Triple, number, triple, vector
from cltrace.reference import Direction, Point
from cltrace.reference.cylinders import Cylinder


@dataclass(frozen=True)
class CylinderTest(Textbook):
    """The endless cylinder, and the planes of the ends, in doubles.

    start, end: the middles of the ends; radius: R; axis: of length 1, from one to the other; across, way: what is left
    of o - start and of d without their parts along the axis; a, b, c: of a t^2 + b t + c = 0; t: the two solutions, or
    none; planes: where the ray is in those of the start and of the end, NaN if it is parallel to them; inside: from
    where to where it is within both, none if it is nowhere.
    """

    start: Triple
    end: Triple
    radius: float
    axis: Triple
    across: Triple
    way: Triple
    a: float
    b: float
    c: float
    t: tuple[float, ...]
    planes: tuple[float, float]
    inside: tuple[float, ...]
    surfaces: ClassVar = (Cylinder,)
    normals: ClassVar = {
        "cylinder": "what is left of P - S without its part along the axis, or the axis, normalized",
    }

    @classmethod
    def of(cls, cylinder: Cylinder, o: Point, d: Direction) -> CylinderTest:
        S, u = cylinder.start, cylinder.axis.normalized()
        to_start, length, R = o - S, cylinder.axis.length(), cylinder.radius
        along, speed = to_start.dot(u), d.dot(u)
        across, way = to_start - u * along, d - u * speed
        a, b, c = way.dot(way), 2 * way.dot(across), across.dot(across) - R * R
        _, t = solutions(a, b, c)
        planes = (-along / speed, (length - along) / speed) if speed else (math.nan, math.nan)
        round_ = t or ((-math.inf, math.inf) if a == 0 and c <= 0 else (math.inf, -math.inf))
        between = sorted(planes) if speed else [-math.inf, math.inf] if 0 <= along <= length else [math.inf, -math.inf]
        return cls(
            triple(S),
            triple(cylinder.end),
            R,
            axis=triple(u),
            across=triple(across),
            way=triple(way),
            a=a,
            b=b,
            c=c,
            t=t,
            planes=planes,
            inside=common(round_, between),
        )

    @classmethod
    def gap(cls, cylinder: Cylinder, o: Point, d: Direction) -> tuple[float, float, Cylinder]:
        """As if its ends were round; t is where the ray is nearest to its axis."""
        f, u = cylinder.start - o, cylinder.axis
        g, uu, dd = d.dot(u), u.dot(u), d.dot(d)
        rest = dd * uu - g * g
        k = (f.dot(d) * g - f.dot(u) * dd) / rest if rest > 0 else 0.0
        near = f + u * max(0.0, min(1.0, k))
        t = near.dot(d) / dd
        return (near - d * t).length() - cylinder.radius, t, cylinder

    def first(self, own: bool) -> float:
        return first_of(self.inside, own)

    def lines(self) -> Iterator[str]:
        yield f"    S = {vector(self.start)}, E = {vector(self.end)}, R = {number(self.radius)}"
        yield f"    u = E - S, normalized = {vector(self.axis)}"
        yield "    without their parts along u:"
        yield f"    o - S is {vector(self.across)}, d is {vector(self.way)}; of these"
        c = f"c = (o - S).(o - S) - R^2 = {number(self.c)}"
        yield f"    a = d.d = {number(self.a)}, b = 2 d.(o - S) = {number(self.b)}, {c}"
        t = map(number, self.t)
        yield "    t1 = {}, t2 = {} on the side".format(*t) if self.t else "    no intersection with the side"
        if not math.isnan(self.planes[0]):
            yield f"    t = {number(self.planes[0])} in the plane of S, t = {number(self.planes[1])} in that of E"
        ends = map(number, self.inside)
        yield "    within both from t = {} to {}".format(*ends) if self.inside else "    never in both"
