"""What a sphere and an ellipsoid have in common, which is a sphere in axes of its own: Round."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from cltrace.reference.ball import Ball
from cltrace.reference.doubt import RoughLine, RoughStart, U, size_of
from cltrace.reference.exact import Frame, Quadratic, Rational, Root, Vector
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start
from cltrace.reference.surfaces import Intersection, Material, Surface
from cltrace.reference.texture import UV
from cltrace.reference.vectors import Direction, Point


@dataclass(frozen=True)
class OnSphere(Start):
    """A point of a sphere: exactly center + radius n / |n|, n being the double triple `normal`.

    The anchor is the centre. normal: outward in camera space, of any length but 0; of an ellipsoid, that of the sphere
    that it is in its own axes. Rays are decided soonest where it is unit to rounding.
    """

    sphere: Round
    normal: Direction

    @property
    def surface(self) -> Round:
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


class Round(Surface):
    """The points P with |K (P - C)| = r, where K = 1 for a sphere.

    center: in camera space, rounded; radius; place: the centre of the file, in the world; ball: centre and radius of
    the file, exactly, from the eye along the world's axes; frame: the camera's axes, which lead from there to camera
    space. reach: how far the surface is from its centre at most. stretch, spread: see ellipsoid.py.
    """

    kind = "sphere"
    stretch = 1.0

    def __init__(self, place: Point, ball: Ball, frame: Frame, material: Material, number: int) -> None:
        self.center = Point(*map(float, frame.to_camera(ball.center)))
        self.radius = self.reach = float(ball.radius)
        self.place, self.ball, self.frame, self.material, self.number = place, ball, frame, material, number

    @abstractmethod
    def equation(self, ray: Ray) -> Equation:
        """Of where the ray meets it, in the form that keeps its digits."""

    def intersect(self, ray: Ray) -> float | None:
        equation = self.equation(ray)
        side = equation.side()
        return None if side is None else equation.t(side)

    def exact_t(self, ray: Ray) -> Root:
        root = self.equation(ray).exact.first(ray.t_min, ray.t_max)
        if root is None:
            raise ValueError("the ray does not hit the surface")
        return root

    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        equation = self.equation(ray)
        side = equation.side()
        if side is None:
            raise ValueError("the ray does not hit the surface")
        start, inside = OnSphere(self, equation.normal(side, t)), side > 0
        outward = self.outward(start.normal)
        return Intersection(
            point=ray.at(t),
            t=t,
            distance=equation.distance(t),
            normal=-outward if inside else outward,
            inside=inside,
            start=start,
            material=self.material,
            uv=_around(self.own_axes(start.normal)),
            index=self.number,
            turned=inside,
        )

    def blocks(self, ray: ShadowRay) -> bool:
        if ray.start.surface is self:
            # It is convex: from outside it is never in its own way, and from inside if and only if the light is
            # strictly outside. The root 0 is not looked for.
            return ray.inside and (ray.light.parallel or self.ball.power(ray.light.place) > 0)
        sure = surely_blocks(self, ray)
        return self.ball.met_by(ray.line).first(0.0, ray.t_max) is not None if sure is None else sure

    # q is the normal of a Start, unit to rounding.

    def step(self, q: Direction) -> Direction:
        """From the centre to the point, along the world's axes, rounded."""
        return (self.frame.B.T @ q) * self.radius

    def from_center(self, q: Direction) -> Direction:
        """The same in camera space."""
        return q * self.radius

    def exact_point(self, q: Direction) -> Vector:
        """The point, exactly, from the eye along the world's axes."""
        return self.ball.point(self.frame.to_world(q))

    def outward(self, q: Direction) -> Direction:
        """The outward unit normal there, in camera space."""
        return q

    def support(self, q: Direction) -> float:
        """How far the plane that touches the surface there is from the centre."""
        return self.radius

    def own_axes(self, q: Direction) -> Direction:
        """The normal there in the object's own axes, before it was placed in the world."""
        return self.frame.B.T @ q

    def seen(self, v: Direction) -> Direction:
        """A direction of the world in the surface's own axes."""
        return v

    @cached_property
    def exact_power(self) -> Fraction:
        """|C|^2 - r^2, the power of the eye: > 0 outside, 0 on the sphere, < 0 inside."""
        origin: Rational = (Fraction(0), Fraction(0), Fraction(0))
        return self.ball.power(origin)

    @cached_property
    def eye_power(self) -> float:
        return float(self.exact_power)

    @cached_property
    def eye_outside(self) -> bool:
        return self.exact_power > 0


class Equation(ABC):
    """The two ends of the way through the sphere are told apart by their side: -1 the near one, 1 the far one."""

    def __init__(self, sphere: Round, ray: Ray) -> None:
        self.sphere, self.ray = sphere, ray

    @cached_property
    def exact(self) -> Quadratic:
        """The same equation in exact numbers."""
        return self.sphere.ball.met_by(self.ray.line(self.sphere.frame))

    @abstractmethod
    def side(self) -> int | None:
        """The end that the ray meets first, strictly within its range; None if there is none."""

    @abstractmethod
    def t(self, side: int) -> float:
        """Where on the ray that end is."""

    @abstractmethod
    def normal(self, side: int, t: float) -> Direction:
        """The unit normal of a Start at that end."""

    def distance(self, t: float) -> float:
        """How far along the ray that is, in scene units."""
        return t * self.ray.direction.length()

    def _exact_t(self, side: int) -> float:
        """Where on the ray that end is, by exact arithmetic."""
        return float(self._root(side))

    def exact_value(self, side: int) -> Fraction:
        return self._root(side).value()

    def _root(self, side: int) -> Root:
        return next(root for root in self.exact.roots() if root.side == side)

    def _unit(self, from_center: Direction) -> Direction:
        """From the centre to the point is r long but for rounding, so after the division by r one Newton step
        n (3 - n.n)/2 makes it unit to the last digits."""
        n = from_center * (1 / self.sphere.radius)
        return n * (0.5 * (3 - n.dot(n)))


def seen_by(sphere: Round, v: Direction, error: float) -> tuple[Direction, float]:
    """A difference of points as the sphere sees it, K B^T v for an ellipsoid, and the bound of its error."""
    if sphere.ball.to_object is None:
        return v, error
    frame = sphere.frame
    return sphere.seen(frame.B.T @ v), sphere.stretch * (error + (16 * U + frame.skew) * size_of(v))


def line_seen_by(sphere: Round, line: RoughLine) -> RoughLine:
    """The same in the own axes of an ellipsoid."""
    if sphere.ball.to_object is None:
        return line
    return RoughLine(*seen_by(sphere, line.w, line.w_error), 0.0)


def surely_misses(sphere: Round, ray: Ray) -> bool:
    """Whether the ray certainly passes by the sphere, or leads away from it. False: it may or may not."""
    skew, r = sphere.frame.skew, sphere.radius
    line = line_seen_by(sphere, RoughLine(ray.direction, skew * ray.direction.length(), skew))
    f, error = seen_by(sphere, *RoughStart(ray.origin, skew).to(sphere.center))
    if line.discriminant(f, error, r).sign() == -1:
        return True
    # Away from it, both ends are behind the start.
    return ray.t_min >= 0 and line.excess(f, error, r).sign() == 1 and line.along(f, error).sign() == -1


def surely_blocks(sphere: Round, ray: ShadowRay) -> bool | None:
    """Whether a sphere that the ray does not start on is met before its end; None if doubles cannot tell.

    A line that passes by the sphere does not meet it, nor does a ray that starts outside and leads away. From inside to
    inside nothing is crossed, and from inside to outside or back the sphere is. From outside to outside it is if the
    middle of the way through it, t = b / a, is before the end.
    """
    line, light, r = line_seen_by(sphere, ray.rough_line), ray.light.position, sphere.radius
    f, error = seen_by(sphere, *ray.rough_start.to(sphere.center))
    meets = line.discriminant(f, error, r).sign()
    if meets == -1:
        return False
    start, b = line.excess(f, error, r).sign(), line.along(f, error)
    if start == 1 and b.sign() == -1:
        return False
    end, short = (1, 1) if light is None else (_end(sphere, ray.rough_start, line, light), line.rest(b).sign())
    if start is None or end is None:
        return None
    if start < 0 or end < 0:
        return start != end
    if short == -1:
        return False
    return True if meets == b.sign() == short == 1 else None


def _end(sphere: Round, start: RoughStart, line: RoughLine, light: Point) -> int | None:
    """The sign of the light's power, 1 outside."""
    error = start.relative * (size_of(light) + size_of(sphere.center))
    return line.excess(*seen_by(sphere, light - sphere.center, error), sphere.radius).sign()


def _around(q: Direction) -> UV:
    """Where a sphere's texture is at the unit normal q: u goes round the y axis, v from the top down."""
    # The angle from the y axis by its tangent: near the poles the cosine would lose digits. On all of the seam u is 1,
    # where an x of -0.0 would make it 0.
    return 0.5 + math.atan2(q.x + 0.0, q.z) / (2 * math.pi), math.atan2(math.hypot(q.x, q.z), q.y) / math.pi
