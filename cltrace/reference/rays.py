"""Rays: where they start, where they lead, and how far they count."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from cltrace.reference.exact import Frame, Line, Vector, vector
from cltrace.reference.vectors import Direction, Point

if TYPE_CHECKING:
    from cltrace.reference.surfaces import Sphere, Surface
    from cltrace.reference.triangles import Triangle

EYE = Point(0.0, 0.0, 0.0)
Weights = tuple[float, float, float]  # of a triangle's corners A, B and C, which add up to 1


class Start(ABC):
    """The point of a surface by which a ray leaves it: exactly, by numbers that put it on the surface.

    Or a point of the plane where the rays of an orthographic camera start.

    Rounded coordinates would put it off the surface, and every ray from there would need an epsilon. Doubles reach it
    in two steps, of which the first one is exact: to a point nearby, the anchor, and from there.
    """

    @property
    @abstractmethod
    def surface(self) -> Surface | None:
        """The surface that the ray leaves; None if it comes from the camera."""

    @property
    @abstractmethod
    def place(self) -> Point:
        """The anchor in the world, exactly."""

    @property
    @abstractmethod
    def anchor(self) -> Point:
        """The anchor in camera space, rounded."""

    @property
    @abstractmethod
    def step(self) -> Direction:
        """From the anchor to the point, along the world's axes, rounded."""

    @property
    @abstractmethod
    def from_anchor(self) -> Direction:
        """The same in camera space."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """How far the point is from the anchor at most."""

    @property
    @abstractmethod
    def error(self) -> float:
        """A bound of what from_anchor is off by, beside the 2 k reach for the camera's skew k, see doubt.py."""

    @property
    @abstractmethod
    def fits(self) -> bool:
        """Whether step is as good as equation.py and crossing.py need it."""

    @property
    @abstractmethod
    def exact_point(self) -> Vector:
        """The point, exactly, from the eye along the world's axes."""

    @property
    def point(self) -> Point:
        """The point in camera space, rounded."""
        return self.anchor + self.from_anchor

    @abstractmethod
    def height(self, point: Point, n: Direction) -> float:
        """n.(point - P), how far a point is above the plane through this one that has the outward unit normal n."""


@dataclass(frozen=True)
class OnSphere(Start):
    """A point of a sphere: exactly center + radius n / |n|, n being the double triple `normal`.

    The anchor is the centre. normal: outward in camera space, of any length but 0; of an ellipsoid, that of the sphere
    that it is in its own axes. Rays are decided soonest where it is unit to rounding.
    """

    sphere: Sphere
    normal: Direction

    @property
    def surface(self) -> Sphere:
        return self.sphere

    @property
    def place(self) -> Point:
        return self.sphere.place

    @property
    def anchor(self) -> Point:
        return self.sphere.center

    @cached_property
    def step(self) -> Direction:
        return self.sphere.step(self.normal)

    @cached_property
    def from_anchor(self) -> Direction:
        return self.sphere.from_center(self.normal)

    @property
    def reach(self) -> float:
        return self.sphere.reach

    @property
    def error(self) -> float:
        off_unit = abs(self.normal.dot(self.normal) - 1)
        return self.reach * (off_unit + 2.0**-51) if off_unit < 0.5 else math.inf

    @property
    def fits(self) -> bool:
        return abs(self.normal.dot(self.normal) - 1) <= 2.0**-47

    @cached_property
    def exact_point(self) -> Vector:
        return self.sphere.exact_point(self.normal)

    @property
    def point(self) -> Point:
        return self.anchor + self.sphere.from_center(self.normal.normalized())

    def height(self, point: Point, n: Direction) -> float:
        """By way of the centre: P = center + radius n, so n.P needs no rounding."""
        return n.dot(point - self.anchor) - self.sphere.support(self.normal)


@dataclass(frozen=True)
class OnTriangle(Start):
    """A point of a triangle: exactly V + u (V' - V) + v (V'' - V).

    corner: which of the three corners V is, the anchor; V' and V'' are those that come after it, going round; u, v:
    their weights, from 2^-64 to 1/2. So the point is in the triangle's plane, and strictly within its edges: a ray from
    there meets the triangles beside it, or does not, as it must. On an edge it would be in their planes, too, and no
    ray that starts in a plane meets it.
    """

    LEAST, MOST = 2.0**-64, 0.5

    triangle: Triangle
    corner: int
    u: float
    v: float

    @classmethod
    def near(cls, triangle: Triangle, weights: Weights) -> OnTriangle:
        """The point of these weights, but for rounding, from the corner that it is nearest to by them."""
        k = weights.index(max(weights))
        u, v = (max(cls.LEAST, min(cls.MOST, w)) for w in (weights[k - 2], weights[k - 1]))
        return cls(triangle, k, u, v)

    @property
    def weights(self) -> Weights:
        """Of the triangle's corners A, B and C."""
        from_v = ((1 - self.u) - self.v, self.u, self.v)
        return from_v[-self.corner], from_v[1 - self.corner], from_v[2 - self.corner]

    @property
    def surface(self) -> Triangle:
        return self.triangle

    @property
    def place(self) -> Point:
        return self.triangle.places[self.corner]

    @cached_property
    def anchor(self) -> Point:
        return self.triangle.seen_corner(self.corner)

    @cached_property
    def step(self) -> Direction:
        V, V1, V2 = (self.triangle.places[(self.corner + i) % 3] for i in range(3))
        return (V1 - V) * self.u + (V2 - V) * self.v

    @cached_property
    def from_anchor(self) -> Direction:
        return self.triangle.frame.B @ self.step

    @property
    def reach(self) -> float:
        """By |V' - V| u + |V'' - V| v: no edge is longer than the other two, and u and v are at most 1/2."""
        return self.triangle.size

    @property
    def error(self) -> float:
        """With u = 2^-53: a difference rounds by u, a product and the sum by u each, and turning by 5.2 u of |step|."""
        return self.reach * 2.0**-49

    @property
    def fits(self) -> bool:
        return True

    @cached_property
    def exact_point(self) -> Vector:
        return vector(self.triangle.face.point(self.corner, self.u, self.v))

    def height(self, point: Point, n: Direction) -> float:
        return n.dot((point - self.anchor) - self.from_anchor)


@dataclass(frozen=True)
class OnPlane(Start):
    """A point of the plane where the rays of an orthographic camera start: exactly the eye plus x and y times its axes.

    The anchor is the eye. eye: in the world; frame: the camera's axes; x, y: scene units.
    """

    eye: Point
    frame: Frame
    x: float
    y: float

    @property
    def surface(self) -> None:
        return None

    @property
    def place(self) -> Point:
        return self.eye

    @property
    def anchor(self) -> Point:
        return EYE

    @cached_property
    def step(self) -> Direction:
        return self.frame.B.T @ self.from_anchor

    @property
    def from_anchor(self) -> Direction:
        return Direction(self.x, self.y, 0.0)

    @property
    def reach(self) -> float:
        return abs(self.x) + abs(self.y)

    @property
    def error(self) -> float:
        return 0.0

    @property
    def fits(self) -> bool:
        return True

    @cached_property
    def exact_point(self) -> Vector:
        return vector(self.frame.to_world(self.from_anchor))

    def height(self, point: Point, n: Direction) -> float:
        return n.dot(point - self.point)


@dataclass(frozen=True)
class Ray:
    """The points origin + t direction for t_min < t < t_max. The direction may have any length; t is in units of it.

    origin: a point in camera space whose coordinates are exactly these doubles, or a point of a surface. direction: in
    camera space, exactly these doubles.
    """

    origin: Point | Start
    direction: Direction
    t_min: float = 0.0
    t_max: float = math.inf

    def at(self, t: float) -> Point:
        start = self.origin.point if isinstance(self.origin, Start) else self.origin
        return start + self.direction * t

    def line(self, frame: Frame) -> Line:
        """The ray in exact numbers, in the world."""
        start = self.origin.exact_point if isinstance(self.origin, Start) else vector(frame.to_world(self.origin))
        return Line(start, vector(frame.to_world(self.direction)))

    @property
    def is_plain(self) -> bool:
        """Whether doubles may decide about it: it counts from 0 to infinity, starts at the eye or by a Start as good as
        that takes, and its d.d is far from the ends of double's range."""
        if (self.t_min, self.t_max) != (0, math.inf) or not 2.0**-200 < self.direction.dot(self.direction) < 2.0**200:
            return False
        return self.origin.fits if isinstance(self.origin, Start) else self.origin == EYE
