"""Spheres, and ellipsoids, which are spheres in axes of their own: a row of SHAPES."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar

from cltrace.explanation.many import Swarm
from cltrace.explanation.shapes.shape import Textbook, first_of, solutions
from cltrace.explanation.space import Footprint
from cltrace.explanation.triples import Triple, number, triple, vector
from cltrace.reference import Direction, Ellipsoid, Point, Round, Surface


@dataclass(frozen=True)
class SphereTest(Textbook):
    """a t^2 + b t + c = 0, as the tutorial has it, in doubles.

    center: C; radius: R; own_axes: whether it is an ellipsoid, whose numbers are those in its own axes, as before its
    transform, where it is a sphere; from_center, direction: o - C and d there, d not normalised again, so that t is the
    same; discriminant: (b/2)^2 - a c; t: the two solutions, the smaller one first, or none.
    """

    center: Triple
    radius: float
    own_axes: bool
    from_center: Triple
    direction: Triple
    a: float
    b: float
    c: float
    discriminant: float
    t: tuple[float, ...]
    surfaces: ClassVar = (Round, Swarm)
    normals: ClassVar = {
        "sphere": "(P - C) / |P - C|",
        "ellipsoid": "that of the sphere before the transform, by the inverse transpose, normalized",
    }

    @classmethod
    def of(cls, sphere: Round, o: Point, d: Direction) -> SphereTest:
        C, R = sphere.place, sphere.radius
        to_start, way = sphere.seen(o - C), sphere.seen(d)
        a, b, c = way.dot(way), 2 * way.dot(to_start), to_start.dot(to_start) - R * R
        disc, t = solutions(a, b, c)
        own = sphere.exact.K is not None
        return cls(triple(C), R, own, triple(to_start), direction=triple(way), a=a, b=b, c=c, discriminant=disc, t=t)

    @classmethod
    def beside(cls, surface: Round | Swarm, o: Point, d: Direction, pixel: Footprint) -> Iterable[Surface]:
        return surface.beside(o, d, pixel) if isinstance(surface, Swarm) else (surface,)

    @classmethod
    def gap(cls, sphere: Round, o: Point, d: Direction) -> tuple[float, float, Round]:
        """Of an ellipsoid, t is where the ray is nearest to it in its own axes."""
        to_center, way = sphere.seen(sphere.place - o), sphere.seen(d)
        t = to_center.dot(way) / way.dot(way)
        across = way * t - to_center
        length = across.length()
        outside = across * (1 - sphere.radius / length) if length > 0 else across
        return math.copysign(_in_world(sphere, outside).length(), length - sphere.radius), t, sphere

    def first(self, own: bool) -> float:
        return first_of(self.t, own)

    def lines(self) -> Iterator[str]:
        yield f"    C = {vector(self.center)}, R = {number(self.radius)}"
        if self.own_axes:
            same = "where d is not normalized again, so that t is the same:"
            yield f"    in its own axes, as before its transform, {same}"
            yield f"    o - C = {vector(self.from_center)}, d = {vector(self.direction)}"
        yield f"    a = d.d = {number(self.a)}"
        yield f"    b = 2 d.(o - C) = {number(self.b)}"
        yield f"    c = (o - C).(o - C) - R^2 = {number(self.c)}"
        disc = f"    disc = (b/2)^2 - a c = {number(self.discriminant)}"
        if not self.t:
            yield f"{disc} < 0: no intersection"
            return
        yield f"{disc} {'> 0: two intersections' if self.discriminant > 0 else '= 0: one intersection'}"
        near, far = map(number, self.t)
        yield f"    t1 = (-b/2 - sqrt(disc)) / a = {near}, t2 = (-b/2 + sqrt(disc)) / a = {far}"


def _in_world(sphere: Round, v: Direction) -> Direction:
    """Back from a sphere's own axes."""
    return sphere.L @ v if isinstance(sphere, Ellipsoid) else v
