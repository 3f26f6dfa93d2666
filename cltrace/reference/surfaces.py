"""What can be hit: Surface, which a new shape implements, Sphere and Ellipsoid. triangles.py has Mesh and Triangle."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from cltrace.reference.doubt import surely_blocks
from cltrace.reference.equation import Equation, equation_of
from cltrace.reference.exact import Ball, Frame, Rational, Root, Vector, rational
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import OnSphere, Ray, Start
from cltrace.reference.texture import UV, Texture
from cltrace.reference.vectors import Color, Direction, Matrix, Point


@dataclass(frozen=True, slots=True)
class Material:
    """Phong's coefficients and the colour of the surface, and what it passes on of the light.

    reflectance, transmittance: the shares of what is seen in the mirrored and along the refracted ray; index: of
    refraction inside, 1 outside; texture: an image by which the colour is multiplied, if any.
    """

    color: Color
    ka: float
    kd: float
    ks: float
    exponent: float
    reflectance: float = 0.0
    transmittance: float = 0.0
    index: float = 1.0
    texture: Texture | None = None

    @property
    def passes_on(self) -> bool:
        """Whether rays go on from it."""
        return self.reflectance > 0 or self.transmittance > 0

    def color_at(self, uv: UV) -> Color:
        if self.texture is None:
            return self.color
        red, green, blue = (c * texel for c, texel in zip(self.color, self.texture.color(uv), strict=True))
        return (red, green, blue)


@dataclass(frozen=True, slots=True)
class Intersection:
    """All that an intersection test finds out.

    point: where; t: at which multiple of the ray's direction; distance: how far, in scene units; normal: unit, facing
    the side from which the ray came; inside: whether that was the inside; start: the point as the start of further
    rays; uv: where in the material's texture; index: the number of the surface that was hit; primitive: the number of
    the triangle in its mesh, -1 for other surfaces.
    """

    point: Point
    t: float
    distance: float
    normal: Direction
    inside: bool
    start: Start
    material: Material
    uv: UV
    index: int
    primitive: int = -1

    @property
    def surface(self) -> Surface:
        surface = self.start.surface
        assert surface is not None
        return surface

    @property
    def color(self) -> Color:
        """The surface's, without light."""
        return self.material.color_at(self.uv)

    @property
    def side(self) -> int:
        """The side from which the ray came: 1 from outside, -1 from inside."""
        return -1 if self.inside else 1

    @property
    def outward(self) -> Direction:
        """The unit normal that leads out of the surface."""
        return -self.normal if self.inside else self.normal


class Surface(ABC):
    """Something that can be hit.

    number: among the scene's surfaces; frame: the camera's axes; spread: of its normals' rounding, see bounce.lift().
    """

    material: Material
    number: int
    frame: Frame
    spread: float = 1.0

    @abstractmethod
    def intersect(self, ray: Ray) -> float | None:
        """The smallest t of the ray, t_min < t < t_max, at which it meets the surface; None if it does not."""

    @abstractmethod
    def exact_t(self, ray: Ray) -> Root:
        """That t of a ray that hits, exactly."""

    @abstractmethod
    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        """Everything about the point at that t, where intersect() found the ray to hit."""

    @abstractmethod
    def blocks(self, ray: ShadowRay) -> bool:
        """Whether this surface stands between the start of a shadow ray and the light."""


def first_met(surfaces: Iterable[Surface], ray: Ray) -> tuple[float, Surface] | None:
    """The surface that a ray meets first, and at which t; of equally near ones, the first one here. None if none."""
    best: tuple[float, Surface] | None = None
    for surface in surfaces:
        t = surface.intersect(ray)
        if t is not None and (best is None or comes_first(ray, surface, t, best[1], best[0])):
            best = t, surface
    return best


def comes_first(ray: Ray, surface: Surface, t: float, other: Surface, best: float) -> bool:
    """Whether the ray meets a surface, at t, strictly before another one, at `best`.

    A t is off by 2^-24 of itself at most. Where two are closer than that, exact arithmetic decides; equal is equal,
    but for planes that cross there, see exact.Face.
    """
    if not abs(t - best) > best * 2.0**-22:
        return surface.exact_t(ray) < other.exact_t(ray)
    return t < best


class Sphere(Surface):
    """The points P with |P - C| = r.

    A ray o + t d meets it where |o + t d - C|^2 = r^2. Multiplied out, as in the tutorial but with b halved and turned,

        a t^2 - 2 b t + c = 0,    a = d.d,    b = d.(C - o),    c = (C - o).(C - o) - r^2
        t = (b -/+ sqrt(D)) / a,  D = b^2 - a c

    D < 0 is a miss, D = 0 touches, D > 0 gives the two ends of the way through the sphere. equation.py computes these
    numbers in such a form that they lose no digits, and says which of them doubles cannot decide; exact.py decides
    those.

    center: in camera space, rounded; radius; place: the centre of the file, in the world; ball: centre and radius of
    the file, exactly, from the eye along the world's axes; frame: the camera's axes, which lead from there to camera
    space. reach: how far the surface is from its centre at most. stretch, spread: see Ellipsoid.
    """

    stretch = 1.0

    def __init__(self, place: Point, ball: Ball, frame: Frame, material: Material, number: int) -> None:
        self.center = Point(*map(float, frame.to_camera(ball.center)))
        self.radius = self.reach = float(ball.radius)
        self.place, self.ball, self.frame, self.material, self.number = place, ball, frame, material, number

    def equation(self, ray: Ray) -> Equation:
        return equation_of(self, ray)

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
        )

    def blocks(self, ray: ShadowRay) -> bool:
        if ray.start.surface is self:
            # It is convex: from outside it is never in its own way, and from inside if and only if the light is
            # strictly outside. The root 0 is not looked for.
            return ray.inside and (ray.light.parallel or self.ball.power(ray.light.place) > 0)
        sure = surely_blocks(self, ray)
        return ray.line.through(self.ball).first(0.0, ray.t_max) is not None if sure is None else sure

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


class Ellipsoid(Sphere):
    """The points P with |K (P - C)| = r: what a linear map L = K^-1 makes of a sphere.

    K leads from the world to the ellipsoid's own axes. There it is a sphere, and the ray K o + t K d is straight and
    has the same t, so all that has been said of spheres holds. Back in the world a normal is K^T q, not L q.

    K: of the scene; L: rounded from the exact inverse; stretch, spread: k and k l, the sizes of K and L (see
    vectors.Matrix), which bound what K and L may make of an error.
    """

    def __init__(self, place: Point, ball: Ball, frame: Frame, material: Material, number: int) -> None:
        super().__init__(place, ball, frame, material, number)
        assert ball.to_object is not None
        assert ball.to_world is not None
        self.K = Matrix(*(Direction(*map(float, row)) for row in ball.to_object))
        self.L = Matrix(*(Direction(*map(float, row)) for row in ball.to_world))
        self.reach = self.radius * self.L.size
        self.stretch, self.spread = self.K.size, self.K.size * self.L.size

    def step(self, q: Direction) -> Direction:
        return (self.L @ q) * self.radius

    def from_center(self, q: Direction) -> Direction:
        return self.frame.B @ self.step(q)

    def exact_point(self, q: Direction) -> Vector:
        return self.ball.point(rational(q))

    def outward(self, q: Direction) -> Direction:
        n = self.K.T @ q
        return self.frame.B @ (n * (1 / math.sqrt(n.dot(n))))

    def support(self, q: Direction) -> float:
        n = self.K.T @ q
        return self.radius * (1 / math.sqrt(n.dot(n)))

    def own_axes(self, q: Direction) -> Direction:
        return q

    def seen(self, v: Direction) -> Direction:
        return self.K @ v


def _around(q: Direction) -> UV:
    """Where a sphere's texture is at the unit normal q: u goes round the y axis, v from the top down."""
    # The angle from the y axis by its tangent: near the poles the cosine would lose digits. On all of the seam u is 1,
    # where an x of -0.0 would make it 0.
    return 0.5 + math.atan2(q.x + 0.0, q.z) / (2 * math.pi), math.atan2(math.hypot(q.x, q.z), q.y) / math.pi
