"""Cylinders with flat ends."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cltrace.exact.lines import ExactPoint, Line, Root
from cltrace.exact.shapes import ExactCylinder, Part
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start, Way, exact_line, way_of
from cltrace.reference.surfaces import Intersection, PhongMaterial, Setting, Surface
from cltrace.reference.vectors import Direction, Point, size_of

if TYPE_CHECKING:
    from cltrace.reference.clipping import Entry


class Cylinder(Surface):
    """A solid cylinder with flat ends. ExactCylinder says what that is.

    Its side is a quadratic equation like that of a sphere, of what is left of the ray when its part along the axis is
    taken away; its ends are two planes. A ray is inside where it is within all three: so it enters where it has entered
    the last of them, and leaves where it leaves the first one. What surely passes by is left out in doubles, and all
    else is decided in exact numbers.

    start, end: in the world; axis: from one to the other, rounded; seen_start, seen_end: in camera space.
    """

    shape = kind = "cylinder"

    def __init__(self, of: np.void, setting: Setting, material: PhongMaterial) -> None:
        self.start, self.end = Point(*of["start"].tolist()), Point(*of["end"].tolist())
        self.radius, self.number = float(of["radius"]), int(of["number"])
        self.clipped = not of["unclipped"]
        self.view, self.material = setting.view, material
        self.axis = self.end - self.start
        self.reach = size_of(self.axis) + self.radius
        self.exact = ExactCylinder(self.start, self.end, self.radius)
        self.seen_start, self.seen_end = (self.view.seen(ExactPoint.of(p)) for p in (self.start, self.end))
        helper = [0.0, 0.0, 0.0]
        helper[min(range(3), key=lambda i: abs(tuple(self.axis)[i]))] = 1.0
        self.e1 = Direction(*helper).cross(self.axis)
        self.e2 = self.axis.cross(self.e1)

    def intersect(self, ray: Ray) -> float | None:
        if passes_by(self, way_of(ray, self.view)):
            return None
        met = self.exact.meet(exact_line(ray, self.view), ray.t_min, ray.t_max)
        return float(met[0]) if met else None

    def exact_t(self, ray: Ray) -> Root:
        return self._found(ray)[0]

    def blocks(self, ray: ShadowRay) -> bool:
        if ray.start.surface is self:
            # It is convex: as of a sphere.
            return ray.inside and (ray.light.parallel or self.exact.is_outside(ray.light.exact))
        if passes_by(self, ray.way_of_light):
            return False
        return self.exact.meet(ray.line, 0.0, ray.t_max, self.loose(ray.start)) is not None

    def blocking_root(self, ray: ShadowRay) -> tuple[Line, Root]:
        own = ray.start.surface is self
        met = self.exact.meet(ray.line, 0.0, ray.t_max, (0, 0) if own else self.loose(ray.start))
        assert met
        return ray.line, met[0]

    def contains(self, entry: Entry) -> bool:
        return self.exact.contains_entry(entry.height)

    def loose(self, start: Start) -> tuple[float, float]:
        """Below what the start of a shadow ray counts as on the side, and as on an end's plane: see ExactCylinder.

        It is a point of another surface, and rounded: where it is on this one but for that, it counts as on it, and so
        light leaves both where cylinders cross. The bounds are those of c, h and k in cylinder_errors() of the kernel.
        """
        if not start.fits:
            return 0, 0
        f = (self.start - start.place) - start.step
        s, u1, F1 = size_of(f) + start.reach, size_of(self.axis), size_of(f.cross(self.axis))
        off = 2.0**-47 * s * u1
        square = F1 * F1 + self.radius * self.radius * self.axis.dot(self.axis)
        return 2 * F1 * off + 3 * off * off + 2.0**-50 * square, off

    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        _, part, inside = self._found(ray)
        # The point of this part that is nearest to the ray's at t, but for rounding: S + k u + m, with m = a e1 + b e2.
        way, u, e1, e2 = self.way(ray), self.axis, self.e1, self.e2
        p = way.w * t - way.to(self.end if part == "end" else self.start)
        k = p.dot(u) / u.dot(u)
        m = p - u * k
        if part == "side":
            m = m * (1 / math.sqrt(m.dot(m)))
        k, a, b = max(0.0, min(1.0, k)), m.dot(e1) / e1.dot(e1), m.dot(e2) / e2.dot(e2)
        n = e1 * a + e2 * b if part == "side" else u if part == "end" else -u
        outward = self.view.B @ n.normalized()
        # u goes round the axis, v along it from the end to the start; on the ends v is 0 and 1.
        turn = math.atan2(b * math.sqrt(e2.dot(e2)), a * math.sqrt(e1.dot(e1)))
        uv = 0.5 + turn / (2 * math.pi), {"side": 1 - k, "start": 1.0, "end": 0.0}[part]
        return Intersection(
            point=ray.at(t),
            t=t,
            distance=t * ray.direction.length(),
            normal=-outward if inside else outward,
            inside=inside,
            start=self.point(part, k, a, b),
            material=self.material,
            uv=uv,
            index=self.number,
            turned=inside,
        )

    def point(self, part: Part, k: float, a: float, b: float) -> Start:
        """The point of a ray's start: exactly S + k u + r m / |m| on the side, and S + m or E + m on a flat end.

        m = a e1 + b e2 is across the axis u, with e1 = x x u, x being the coordinate axis that u is furthest from, and
        e2 = u x e1. The anchor is S, or E on the end there. k: within 0..1.
        """
        step = self.e1 * a + self.e2 * b
        if part == "side":
            step = self.axis * k + step * (self.radius * (1 / math.sqrt(step.dot(step))))
        place, seen = (self.end, self.seen_end) if part == "end" else (self.start, self.seen_start)
        from_anchor, exact = self.view.B @ step, partial(self.exact.point, part, k, a, b)
        return Start(self, self.view, place, seen, step, from_anchor, self.reach, seen + from_anchor, exact)

    def way(self, ray: Ray) -> Way:
        """That of a ray that is met, rounded."""
        way = way_of(ray, self.view)
        if way is None:
            step = self.view.B.T @ (ray.at(0.0) - Point(0, 0, 0))
            way = Way(self.view.eye, self.view.B.T @ ray.direction, 0.0, step=step)
        return way

    def _found(self, ray: Ray) -> tuple[Root, Part, bool]:
        met = self.exact.meet(exact_line(ray, self.view), ray.t_min, ray.t_max)
        if met is None:
            raise ValueError("the ray does not hit the surface")
        return met


def passes_by(of: Cylinder, way: Way | None) -> bool:
    """Whether a ray surely passes by the endless cylinder, or an end's plane is surely beyond its start.

    With f from the ray's start to S, the line along w is |u.(f x w)| / |w x u| away from the axis. As rays.Way has
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
