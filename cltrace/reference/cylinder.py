"""Cylinders with flat ends."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from cltrace.base.arithmetic import cross, dot, minus
from cltrace.exact.surds import Surd
from cltrace.reference.crossing import Way, shadow_way, way_of
from cltrace.reference.doubt import size_of
from cltrace.reference.exact import ZERO, Line, Quadratic, Rational, Root, Vector, between, vector
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start
from cltrace.reference.surfaces import Intersection, Material, Setting, Surface
from cltrace.reference.texture import UV
from cltrace.reference.vectors import Direction, Point

Part = Literal["side", "start", "end"]


@dataclass(frozen=True)
class Met:
    """Where a line enters the solid, or leaves it: the root, and by which part of the surface."""

    root: Root
    part: Part


@dataclass(frozen=True)
class Tube:
    """The points p with |(p - S) x u| <= r |u| and 0 <= (p - S).u <= u.u, exactly, from the eye along the world's axes.

    start: S; axis: u, from there to the middle of the other end; radius: r.
    """

    start: Rational
    axis: Rational
    radius: Fraction

    @cached_property
    def uu(self) -> Fraction:
        return sum((x * x for x in self.axis), ZERO)

    def way_through(self, line: Line, loose: tuple[float, float] = (0, 0)) -> tuple[Met, Met] | None:
        """The two ends of a line's way through the solid; None if it passes by. Touching is a way of length 0.

        loose: below what its start counts as on the side, and as on an end's plane.

        With f = S - o, the line o + t w is within the endless cylinder where |t G - F|^2 <= r^2 u.u, with G = w x u and
        F = f x u, and between the planes of the ends where 0 <= t g - h <= u.u, with g = w.u and h = f.u. It is in the
        solid where it is in both. On the rim, it is the flat end that is met.
        """
        u = vector(self.axis)
        f, w = minus(vector(self.start), line.start), line.direction
        g, h = dot(w, u), dot(f, u)
        side, beyond = self.side(line), _settled(h + Surd(self.depth), loose[1])
        side, h = replace(side, c=_settled(side.c, loose[0])), _settled(h, loose[1])
        near: Met | None = None
        far: Met | None = None
        if side.a.sign():
            if side.discriminant.sign() < 0:
                return None
            near, far = Met(Root(side, -1), "side"), Met(Root(side, 1), "side")
        elif side.c.sign() > 0:
            return None
        if g.sign():
            first, last = _flat(g, h, "start"), _flat(g, beyond, "end")
            first, last = (first, last) if g.sign() > 0 else (last, first)
            near = first if near is None or not first.root < near.root else near
            far = last if far is None or not far.root < last.root else far
        elif h.sign() > 0 or beyond.sign() < 0:
            return None
        if near is None or far is None or far.root < near.root:
            return None
        return near, far

    def side(self, line: Line) -> Quadratic:
        """Where a line is within what goes round the axis."""
        f, u = minus(vector(self.start), line.start), vector(self.axis)
        F, G = cross(f, u), cross(line.direction, u)
        return Quadratic(dot(G, G), dot(F, G), dot(F, F) - Surd(self.radius * self.radius * self.uu))

    @property
    def depth(self) -> Fraction:
        """How far the second plane is from the first one, times |u|."""
        return self.uu

    def first(
        self, line: Line, t_min: float, t_max: float, loose: tuple[float, float] = (0, 0)
    ) -> tuple[Met, bool] | None:
        """Where a line meets the surface first, strictly between t_min and t_max, and whether from inside."""
        ends = self.way_through(line, loose)
        for met, inside in zip(ends or (), (False, True), strict=False):
            if met.root.is_between(t_min, t_max):
                return met, inside
        return None

    def is_outside(self, p: Rational) -> bool:
        """Whether a point is strictly outside of the solid."""
        x = tuple(a - b for a, b in zip(p, self.start, strict=True))
        along = sum((a * b for a, b in zip(x, self.axis, strict=True)), ZERO)
        return along < 0 or along > self.depth or self.is_beside(p)

    def is_beside(self, p: Rational) -> bool:
        """Whether a point is strictly outside of what goes round the axis."""
        x, y, z = (a - b for a, b in zip(p, self.start, strict=True))
        across = cross((x, y, z), self.axis)
        return sum((a * a for a in across), ZERO) > self.radius * self.radius * self.uu


def _settled(x: Surd, loose: float) -> Surd:
    """0 where it is no larger than that, else x."""
    far = Surd(Fraction(loose))
    return x if not loose or (x - far).sign() > 0 or (x + far).sign() < 0 else Surd(ZERO)


def _flat(g: Surd, h: Surd, part: Part) -> Met:
    """Where a line meets the plane g t = h: as a quadratic equation, (g t - h)^2 = 0, which has one root twice."""
    equation = Quadratic(g * g, g * h, h * h)
    return Met(Root(equation, equation.b.sign() or 1), part)


@dataclass(frozen=True)
class OnCylinder(Start):
    """A point of a cylinder: exactly S + k u + r m / |m| on the side, and S + m or E + m on a flat end.

    m = a e1 + b e2 is across the axis u, with e1 = x x u, x being the coordinate axis that u is furthest from, and e2 =
    u x e1. The anchor is S, or E on the end there. k: within 0..1.
    """

    cylinder: Cylinder
    part: Part
    k: float
    a: float
    b: float

    @property
    def surface(self) -> Cylinder:
        return self.cylinder

    @property
    def place(self) -> Point:
        return self.cylinder.end if self.part == "end" else self.cylinder.start

    @cached_property
    def anchor(self) -> Point:
        return self.cylinder.seen_end if self.part == "end" else self.cylinder.seen_start

    @cached_property
    def step(self) -> Direction:
        of = self.cylinder
        m = of.e1 * self.a + of.e2 * self.b
        if self.part != "side":
            return m
        return of.axis * self.k + m * (of.radius * (1 / math.sqrt(m.dot(m))))

    @property
    def reach(self) -> float:
        return self.cylinder.reach

    @property
    def error(self) -> float:
        """With u = 2^-53: k u is off by 2 u |u|, e1 and e2 by 3 u of themselves, m by 6 u and m / |m| by 12 u, and
        turning by 5.2 u of |step|."""
        return self.reach * 2.0**-48

    @property
    def exact_across(self) -> Rational:
        """m."""
        e1, e2 = exact_axes(self.cylinder.tube.axis)
        x, y, z = (Fraction(self.a) * p + Fraction(self.b) * q for p, q in zip(e1, e2, strict=True))
        return x, y, z

    @cached_property
    def exact_point(self) -> Vector:
        of, m = self.cylinder.tube, self.exact_across
        if self.part != "side":
            k = Fraction(self.part == "end")
            x, y, z = (Surd(s + k * u + v) for s, u, v in zip(of.start, of.axis, m, strict=True))
            return x, y, z
        s = sum((v * v for v in m), ZERO)
        k = Fraction(self.k)
        x, y, z = (Surd(p + k * u, of.radius * v / s, s) for p, u, v in zip(of.start, of.axis, m, strict=True))
        return x, y, z


def exact_axes(u: Rational) -> tuple[Rational, Rational]:
    """e1 and e2 of an axis u."""
    helper = [ZERO, ZERO, ZERO]
    helper[min(range(3), key=lambda i: abs(u[i]))] = Fraction(1)
    e1 = cross((helper[0], helper[1], helper[2]), u)
    return e1, cross(u, e1)


class Cylinder(Surface):
    """A solid cylinder with flat ends. tube says what that is, exactly.

    Its side is a quadratic equation like that of a sphere, of what is left of the ray when its part along the axis is
    taken away; its ends are two planes. A ray is inside where it is within all three: so it enters where it has entered
    the last of them, and leaves where it leaves the first one. What surely passes by is left out in doubles, and all
    else is decided in exact numbers.

    start, end: in the world; axis: from one to the other, rounded; seen_start, seen_end: in camera space.
    """

    shape = kind = "cylinder"

    def __init__(self, of: np.void, setting: Setting, material: Material) -> None:
        self.start, self.end = Point(*of["start"].tolist()), Point(*of["end"].tolist())
        self.radius, self.number = float(of["radius"]), int(of["number"])
        self.frame, self.eye, self.material = setting.frame, setting.eye, material
        self.axis = self.end - self.start
        self.reach = size_of(self.axis) + self.radius
        self.tube = self.solid(of)
        self.seen_start, self.seen_end = (
            Point(*map(float, self.frame.to_camera(between(self.eye, p)))) for p in (self.start, self.end)
        )
        helper = [0.0, 0.0, 0.0]
        helper[min(range(3), key=lambda i: abs(tuple(self.axis)[i]))] = 1.0
        self.e1 = Direction(*helper).cross(self.axis)
        self.e2 = self.axis.cross(self.e1)
        self._met = lru_cache(maxsize=1)(self._find)

    def solid(self, of: np.void) -> Tube:
        """What it is, exactly."""
        return Tube(between(self.eye, self.start), between(self.start, self.end), Fraction(self.radius))

    def passes_by(self, way: Way | None) -> bool:
        """Whether a ray surely passes by it, in doubles."""
        return passes_by(self, way)

    def intersect(self, ray: Ray) -> float | None:
        if self.passes_by(way_of(ray, self.frame, self.eye)):
            return None
        met = self._met(ray)
        return float(met[0].root) if met else None

    def exact_t(self, ray: Ray) -> Root:
        return self._found(ray)[0].root

    def blocks(self, ray: ShadowRay) -> bool:
        if ray.start.surface is self:
            # It is convex: as of a sphere.
            return ray.inside and (ray.light.parallel or self.tube.is_outside(ray.light.place))
        if self.passes_by(shadow_way(ray)):
            return False
        return self.tube.first(ray.line, 0.0, ray.t_max, self.loose(ray.start)) is not None

    def loose(self, start: Start) -> tuple[float, float]:
        """Below what the start of a shadow ray counts as on the side, and as on an end's plane: see Tube.

        It is a point of another surface, and rounded: where it is on this one but for that, it counts as on it, and so
        light leaves both where cylinders cross. The bounds are those of c, h and k in RodErrors of the kernel.
        """
        if not start.fits:
            return 0, 0
        f = (self.start - start.place) - start.step
        s, u1, F1 = size_of(f) + start.reach, size_of(self.axis), size_of(f.cross(self.axis))
        off = 2.0**-47 * s * u1
        square = F1 * F1 + self.radius * self.radius * self.axis.dot(self.axis)
        return 2 * F1 * off + 3 * off * off + 2.0**-50 * square, off

    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        met, inside = self._found(ray)
        start = self.point_at(ray, t, met.part)
        outward = self.frame.B @ self.outward(start)
        return Intersection(
            point=ray.at(t),
            t=t,
            distance=t * ray.direction.length(),
            normal=-outward if inside else outward,
            inside=inside,
            start=start,
            material=self.material,
            uv=self.uv(start),
            index=self.number,
            turned=inside,
        )

    def point_at(self, ray: Ray, t: float, part: Part) -> OnCylinder:
        """The point of this part that is nearest to the ray's at t, but for rounding."""
        way = self.way(ray)
        p = way.w * t - way.to(self.end if part == "end" else self.start)
        u = self.axis
        k = p.dot(u) / u.dot(u)
        m = p - u * k
        if part == "side":
            m = m * (1 / math.sqrt(m.dot(m)))
        a, b = m.dot(self.e1) / self.e1.dot(self.e1), m.dot(self.e2) / self.e2.dot(self.e2)
        return OnCylinder(self, part, k=max(0.0, min(1.0, k)), a=a, b=b)

    def way(self, ray: Ray) -> Way:
        """That of a ray that is met, rounded."""
        way = way_of(ray, self.frame, self.eye)
        if way is None:
            step = self.frame.B.T @ (ray.at(0.0) - Point(0, 0, 0))
            way = Way(self.eye, self.frame.B.T @ ray.direction, 0.0, step=step)
        return way

    def outward(self, at: OnCylinder) -> Direction:
        """The outward unit normal at a point, in the world."""
        n = self.axis if at.part == "end" else -self.axis
        if at.part == "side":
            n = self.e1 * at.a + self.e2 * at.b
        return n.normalized()

    def uv(self, at: OnCylinder) -> UV:
        """u goes round the axis, v along it from the end to the start; on the ends v is 0 and 1."""
        turn = math.atan2(at.b * math.sqrt(self.e2.dot(self.e2)), at.a * math.sqrt(self.e1.dot(self.e1)))
        return 0.5 + turn / (2 * math.pi), {"side": 1 - at.k, "start": 1.0, "end": 0.0}[at.part]

    def _find(self, ray: Ray) -> tuple[Met, bool] | None:
        return self.tube.first(ray.line(self.frame), ray.t_min, ray.t_max)

    def _found(self, ray: Ray) -> tuple[Met, bool]:
        met = self._met(ray)
        if met is None:
            raise ValueError("the ray does not hit the surface")
        return met


def passes_by(of: Cylinder, way: Way | None) -> bool:
    """Whether a ray surely passes by the endless cylinder, or an end's plane is surely beyond its start.

    With f from the ray's start to S, the line along w is |u.(f x w)| / |w x u| away from the axis. As crossing.py has
    it, with v = 2^-53 and s = |f|_1 + reach, f is off by 48 v s and w by 48 v w1. So f x w is off by less than 100 v s
    w1, the product with u by 102 v s w1 |u|_1, w x u by 52 v w1 |u|_1, and f.u and w.u by 52 v s |u|_1 and 52 v w1
    |u|_1. Twice these bounds have room for all other roundings.
    """
    if way is None:
        return False
    f, w, u = way.to(of.start), way.w, of.axis
    s, u1 = size_of(f) + way.reach, size_of(u)
    V, G = abs(u.dot(f.cross(w))), w.cross(u)
    if V - 2.0**-45 * s * way.w1 * u1 > of.radius * (G.length() + 2.0**-45 * way.w1 * u1) * (1 + 2.0**-45):
        return True
    h, g, h_error, g_error = f.dot(u), w.dot(u), 2.0**-46 * s * u1, 2.0**-46 * way.w1 * u1
    return (h > h_error and g < -g_error) or (h + u.dot(u) * (1 + 2.0**-50) < -h_error and g > g_error)


def cylinders(setting: Setting) -> Iterator[Cylinder]:
    """Those of a scene."""
    return (Cylinder(of, setting, setting.material(int(of["material"]))) for of in setting.scene.cylinders)
