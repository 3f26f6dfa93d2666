"""The textbook's intersection test of each shape, in doubles, as a student's own code has it; and the table of shapes.

The reference tracer tries all spheres for every ray, as the tutorial has it. Where a pixel of a million spheres is to
be explained, that would take minutes: so many spheres are one surface here, of which a ray tries only those that it
does not surely pass by.
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np

from cltrace.base.arithmetic import inverses
from cltrace.reference import Direction, Point, Ray, Sphere, Surface, Triangle
from cltrace.reference.clipping import Cap
from cltrace.reference.cylinders import Cylinder
from cltrace.reference.lights import ShadowRay
from cltrace.reference.surfaces import Setting, Shape, way_along
from cltrace.reference.vectors import size_of
from cltrace.reference.world import KINDS as PLAIN

Triple = tuple[float, float, float]


def triple(v: Point | Direction) -> Triple:
    return (v.x, v.y, v.z)


def number(x: float) -> str:
    """A number as it is printed, with six digits."""
    return f"{x + 0.0:.6g}"  # makes -0 a 0


def vector(v: Triple) -> str:
    return f"({', '.join(map(number, v))})"


@dataclass(frozen=True)
class Textbook(ABC):
    """The intersection test of the textbook, in doubles: the numbers that a student's own code has.

    The ray is o + t d in the world, and d has length 1. surfaces: which ones of the reference it is of; normals: what
    their normals are, in words, by `shape` of Hit.
    """

    surfaces: ClassVar[tuple[type[Surface], ...]]
    normals: ClassVar[Mapping[str, str]]

    @classmethod
    @abstractmethod
    def of(cls, surface: Any, o: Point, d: Direction) -> Self:
        """That of a surface which is no group."""

    @abstractmethod
    def first(self, own: bool) -> float:
        """Where the ray meets it first by these numbers, infinite if it does not. own: whether it starts there."""

    @abstractmethod
    def lines(self) -> Iterator[str]:
        """They in the words of the tutorial."""


def first_of(ends: tuple[float, ...], own: bool) -> float:
    """Where a ray meets a solid first, of where it meets it. On the one that it leaves, one of the two is its start."""
    ahead = [t for t in ends if t > 0]
    if own and ahead:
        ahead = [t for t in ends if t != min(ends, key=abs) and t > 0]
    return min(ahead, default=math.inf)


def common(one: Sequence[float], other: Sequence[float]) -> tuple[float, ...]:
    """From where to where a ray is in both of two parts of it, none if it is nowhere."""
    begin, end = max(one[0], other[0]), min(one[1], other[1])
    return (begin, end) if begin <= end else ()


def solutions(a: float, b: float, c: float) -> tuple[float, tuple[float, ...]]:
    """Of a t^2 + b t + c = 0: (b/2)^2 - a c, and the two solutions, the smaller one first, or none."""
    half = b / 2
    disc = half * half - a * c
    root = math.sqrt(disc) if disc >= 0 else math.nan
    return disc, ((-half - root) / a, (-half + root) / a) if disc >= 0 and a > 0 else ()


MANY = 64  # spheres with numbers that follow each other, from which on they are a swarm


class Swarm(Shape):
    """Spheres and ellipsoids with numbers that follow each other, each of which is made when a ray may meet it.

    number: the first one's; places: of these spheres among the scene's.
    """

    def __init__(self, setting: Setting, places: range) -> None:
        scene, self.view = setting.scene, setting.view
        self.number = int(scene.sphere_numbers[places[0]])
        self._sphere = cache(lambda row: Sphere(setting, places[row]))
        part = scene.spheres[places.start : places.stop]
        self._centers, self._reach = part["center"], part["radius"].copy()
        bent = part["to_object"] >= 0
        if bent.any():
            sizes = np.abs(inverses(scene.to_object)).sum(axis=(1, 2))
            self._reach[bent] *= sizes[part["to_object"][bent]]

    def parts(self, ray: Ray | ShadowRay) -> Iterator[Sphere]:
        """The spheres that a ray may meet, by rising numbers. All others it surely passes by, or leads away from.

        With f from the start to a centre and R the reach, a ray along w passes by where |f x w| > R |w|, and leads away
        where f.w < -R |w|. As rays.Way has it, with u = 2^-53 and s = |f|_1 + reach, f has an error of 48 u s, and w
        one of 48 u w1. So f x w and f.w have errors below 100 u s w1 < 2^-46 s w1, and |w| one of 2^-44 of itself, as
        w1 <= 4 |w|_1. A few more roundings fit in twice that.
        """
        rows, way = np.arange(len(self._reach)), way_along(ray, self.view)
        if way is not None and way.w1 <= 4 * size_of(way.w):
            w = np.array(triple(way.w))
            f = (self._centers - np.array(triple(way.place))) - np.array(triple(way.step))
            error = 2.0**-45 * (np.abs(f).sum(axis=1) + way.reach) * way.w1
            room = self._reach * (np.sqrt(w @ w) * (1 + 2.0**-42)) + error
            rows = np.flatnonzero(~((np.linalg.norm(np.cross(f, w), axis=1) > room) | (f @ w < -room)))
        for row in rows.tolist():
            yield self._sphere(row)

    def solids(self, ray: Ray | ShadowRay) -> Iterator[Sphere]:
        return self.parts(ray)


def swarms(setting: Setting) -> Iterator[Shape]:
    """The spheres of a scene: those with numbers that follow each other as a swarm, if they are many."""
    numbers = setting.scene.sphere_numbers
    ends = [0, *(np.flatnonzero(np.diff(numbers) != 1) + 1).tolist(), len(numbers)]
    for begin, end in itertools.pairwise(ends):
        if end - begin >= MANY:
            yield Swarm(setting, range(begin, end))
        else:
            yield from (Sphere(setting, i) for i in range(begin, end))


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
    surfaces: ClassVar = (Sphere,)
    normals: ClassVar = {
        "sphere": "(P - C) / |P - C|",
        "ellipsoid": "that of the sphere before the transform, by the inverse transpose, normalized",
    }

    @classmethod
    def of(cls, sphere: Sphere, o: Point, d: Direction) -> SphereTest:
        C, R = sphere.place, sphere.radius
        to_start, way = sphere.seen(o - C), sphere.seen(d)
        a, b, c = way.dot(way), 2 * way.dot(to_start), to_start.dot(to_start) - R * R
        disc, t = solutions(a, b, c)
        own = sphere.K is not None
        return cls(triple(C), R, own, triple(to_start), direction=triple(way), a=a, b=b, c=c, discriminant=disc, t=t)

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


@dataclass(frozen=True)
class TriangleTest(Textbook):
    """t = (A - o).N / d.N, in doubles.

    corners: A, B and C; normal: N = (B - A) x (C - A), not normalised; d_n: d.N; t: where the ray is in the plane, NaN
    if it is parallel to that; weights: of A, B and C at that point, all >= 0 within the triangle.
    """

    corners: tuple[Triple, Triple, Triple]
    normal: Triple
    d_n: float
    t: float
    weights: Triple
    surfaces: ClassVar = (Triangle,)
    normals: ClassVar = {"flat": "N / |N|", "smooth": "the corners' normals by the weights, normalized"}

    @classmethod
    def of(cls, triangle: Triangle, o: Point, d: Direction) -> TriangleTest:
        A, B, C = triangle.places
        N = (B - A).cross(C - A)
        d_n, area = d.dot(N), N.dot(N)
        t = (A - o).dot(N) / d_n if d_n else math.nan
        P = o + d * t
        # The triangle that P makes with an edge, as a share of the whole one.
        parts = [(Y - X).cross(P - X).dot(N) / area if area else math.nan for X, Y in ((B, C), (C, A), (A, B))]
        return cls((triple(A), triple(B), triple(C)), triple(N), d_n=d_n, t=t, weights=(parts[0], parts[1], parts[2]))

    def first(self, own: bool) -> float:
        return self.t if self.t > 0 and all(weight >= 0 for weight in self.weights) else math.inf

    def lines(self) -> Iterator[str]:
        yield f"    {', '.join(f'{name} = {vector(corner)}' for name, corner in zip('ABC', self.corners, strict=True))}"
        yield f"    N = (B - A) x (C - A) = {vector(self.normal)}, d.N = {number(self.d_n)}"
        if math.isnan(self.t):
            yield "    d.N = 0: the ray is parallel to the plane"
            return
        inside = "all >= 0: within" if all(weight >= 0 for weight in self.weights) else "one < 0: outside"
        yield f"    t = (A - o).N / d.N = {number(self.t)}"
        yield f"    weights of A, B and C there: {', '.join(map(number, self.weights))}; {inside}"


@dataclass(frozen=True)
class CapTest(Textbook):
    """t = (S - o).m / d.m, in doubles.

    start: S, a point of the plane; normal: m, of length 1, to the side that is left out; d_m: d.m; t: where the ray is
    in the plane, NaN if it is parallel to that.
    """

    start: Triple
    normal: Triple
    d_m: float
    t: float
    surfaces: ClassVar = (Cap,)
    normals: ClassVar = {"cap": "m"}

    @classmethod
    def of(cls, cap: Cap, o: Point, d: Direction) -> CapTest:
        plane = cap.entry.plane
        S, m = plane.point, -plane.inward.normalized()
        d_m = d.dot(m)
        return cls(triple(S), triple(m), d_m, (S - o).dot(m) / d_m if d_m else math.nan)

    def first(self, own: bool) -> float:
        return self.t if self.t > 0 else math.inf

    def lines(self) -> Iterator[str]:
        yield f"    the plane has S = {vector(self.start)} and m = {vector(self.normal)}"
        yield f"    t = (S - o).m / d.m = {number(self.t)}; there the ray is inside of the surface that the cap closes"


SHAPES: tuple[type[Textbook], ...] = (SphereTest, CylinderTest, TriangleTest, CapTest)
# What makes a scene's surfaces, as that of the reference does.
KINDS = {**PLAIN, "spheres": swarms}
# What normals are, by `shape` of Hit.
NORMALS = {shape: words for row in SHAPES for shape, words in row.normals.items()}


def textbook_of(surface: Surface) -> type[Textbook]:
    """Its row."""
    return next(row for row in SHAPES if isinstance(surface, row.surfaces))
