"""The reference: the same ray tracer in plain Python, to be read beside the course's tutorial.

It favours plainness over speed: every ray tries every surface, in double precision, without shortcuts. kernels/trace.cl
has the same functions under the same names. Formulas are written in the order in which the kernel evaluates them, so
that both compute the same bits; why a formula has the form it has is said there, or here where it is only here.

Everything happens in camera space, as in the tutorial: the eye is the origin, x is right, y is up, -z is ahead.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import AMBIENT, PARALLEL, SPOT, Camera, Scene

Color = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Direction:
    """A difference of points: it can be scaled, added and multiplied, but is nowhere."""

    x: float
    y: float
    z: float

    def __iter__(self) -> Iterator[float]:
        return iter((self.x, self.y, self.z))

    def __add__(self, other: Direction) -> Direction:
        return Direction(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Direction) -> Direction:
        return Direction(self.x - other.x, self.y - other.y, self.z - other.z)

    def __neg__(self) -> Direction:
        return Direction(-self.x, -self.y, -self.z)

    def __mul__(self, factor: float) -> Direction:
        return Direction(self.x * factor, self.y * factor, self.z * factor)

    def __truediv__(self, divisor: float) -> Direction:
        return Direction(self.x / divisor, self.y / divisor, self.z / divisor)

    def dot(self, other: Direction) -> float:
        return (self.x * other.x + self.y * other.y) + self.z * other.z

    def cross(self, other: Direction) -> Direction:
        return Direction(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )

    def length(self) -> float:
        return math.hypot(self.x, self.y, self.z)

    def normalized(self) -> Direction:
        # By the largest component first: the square of a tiny or a huge one would leave the range.
        once = self / max(abs(self.x), abs(self.y), abs(self.z))
        return once / once.length()


@dataclass(frozen=True, slots=True)
class Point:
    """A place. Points differ by a direction; they cannot be added."""

    x: float
    y: float
    z: float

    def __sub__(self, other: Point) -> Direction:
        return Direction(self.x - other.x, self.y - other.y, self.z - other.z)

    def __add__(self, step: Direction) -> Point:
        if not isinstance(step, Direction):
            return NotImplemented
        return Point(self.x + step.x, self.y + step.y, self.z + step.z)


EYE = Point(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Ray:
    """The points origin + t direction for t_min < t < t_max. The direction may have any length; t is in units of it."""

    origin: Point
    direction: Direction
    t_min: float = 0.0
    t_max: float = math.inf

    def at(self, t: float) -> Point:
        return self.origin + self.direction * t


@dataclass(frozen=True, slots=True)
class Material:
    """Phong's coefficients and the colour of the surface."""

    color: Color
    ka: float
    kd: float
    ks: float
    exponent: float


@dataclass(frozen=True, slots=True)
class Intersection:
    """All that an intersection test finds out.

    point: where; t: at which multiple of the ray's direction; distance: how far, in scene units; normal: unit, facing
    the side from which the ray came; inside: whether that was the inside; surface, index: what was hit.
    """

    point: Point
    t: float
    distance: float
    normal: Direction
    inside: bool
    surface: Surface
    material: Material
    index: int = -1


class Surface(ABC):
    """Something that can be hit."""

    material: Material

    @abstractmethod
    def intersect(self, ray: Ray) -> float | None:
        """The smallest t of the ray, t_min < t < t_max, at which it meets the surface; None if it does not."""

    @abstractmethod
    def exact_distance(self, ray: Ray) -> Fraction:
        """That t, far beyond double precision."""

    @abstractmethod
    def intersection_at(self, ray: Ray, t: float, index: int) -> Intersection:
        """Everything about the point at that t."""

    @abstractmethod
    def blocks(self, at: Intersection, light: Light) -> bool:
        """Whether this surface stands between a point on another surface, or on itself, and a light."""


class Sphere(Surface):
    """The points with |p - center| = radius.

    exact_center: the centre before it was rounded; exact_power: |center|^2 - radius^2 of the unrounded scene, the power
    of the eye, > 0 outside; light_sides: for each light the sign of its own power: 1 outside, 0 on the sphere, -1
    inside.
    """

    def __init__(
        self,
        exact_center: tuple[Fraction, Fraction, Fraction],
        radius: float,
        material: Material,
        exact_power: Fraction,
        light_sides: dict[int, int],
    ) -> None:
        self.center = Point(*map(float, exact_center))
        self.radius, self.material, self.eye_power = radius, material, float(exact_power)
        self.exact_center, self.exact_power, self.light_sides = exact_center, exact_power, light_sides

    def _quadratic(self, ray: Ray) -> tuple[float, float, float, Direction, bool]:
        """a, b, discriminant of a t^2 - 2 b t + c = 0, v from the ray's closest point to the centre, and which form.

        The tutorial's formula is b^2 - a c. It is kept where it is accurate, for |b| < radius |d| and from inside;
        elsewhere a (radius^2 - |v|^2) is. Where its sign is in doubt, it is computed without rounding.
        """
        f, d = self.center - ray.origin, ray.direction
        a, b = d.dot(d), f.dot(d)
        if a == 0:
            return 0.0, 0.0, -1.0, f, True  # no direction: no hit
        k = b * (1 / a)
        v = Direction(f.x - k * d.x, f.y - k * d.y, f.z - k * d.z)
        rr = self.radius * self.radius
        bb, arr = b * b, a * rr
        by_b = bb < arr or self.eye_power <= 0
        discriminant = bb - a * self.eye_power if by_b else a * (rr - v.dot(v))
        tiny = arr < bb * 2.0**-42
        if abs(discriminant) <= (bb + arr) * 2.0**-48 or tiny:
            exact_a, exact_b, exact_discriminant = self._exact_quadratic(ray)
            discriminant = float(exact_discriminant)
            if tiny:
                k_exact = exact_b / exact_a
                v = Direction(*(float(c - k_exact * Fraction(x)) for c, x in zip(self.exact_center, d, strict=True)))
        return a, b, discriminant, v, by_b

    def _exact_quadratic(self, ray: Ray) -> tuple[Fraction, Fraction, Fraction]:
        """a, b and the discriminant, not rounded. The ray starts at the eye."""
        d = [Fraction(x) for x in ray.direction]
        a = _sum(x * x for x in d)
        b = _sum(x * y for x, y in zip(d, self.exact_center, strict=True))
        return a, b, b * b - a * self.exact_power

    def exact_distance(self, ray: Ray) -> Fraction:
        """The t of a ray that hits, to 2^-100 of its value or better: the square root is rounded that late."""
        a, b, discriminant = self._exact_quadratic(ray)
        whole = discriminant.numerator * discriminant.denominator
        root = Fraction(math.isqrt(whole << 400), discriminant.denominator << 200)
        q = b - root if b < 0 else b + root
        return self.exact_power / q if self.exact_power > 0 or b < 0 else q / a

    def intersect(self, ray: Ray) -> float | None:
        a, b, discriminant, _, by_b = self._quadratic(ray)
        c = self.eye_power
        if not discriminant >= 0:
            return None
        root = math.sqrt(discriminant)
        if by_b or a * c <= 2.0**-10 * (b * b):
            # b - root might cancel: with q = b + root, or b - root if b < 0, the roots are c/q and q/a. Outside, both
            # have the sign of b and c/q is the nearer one.
            q = b - root if b < 0 else b + root
            numerator, denominator = (c, q) if c > 0 or b < 0 else (q, a)
            t = numerator / denominator if denominator else math.nan
        else:
            t = (b - root) * (1 / a)
        return t if ray.t_min < t < ray.t_max else None

    def intersection_at(self, ray: Ray, t: float, index: int) -> Intersection:
        a, _, discriminant, v, by_b = self._quadratic(ray)
        d = ray.direction
        near, far = d * t - (self.center - ray.origin), -(v + d * (math.sqrt(discriminant) * (1 / a)))
        from_center = near if by_b else far
        outward = from_center * (1 / self.radius)
        outward = outward * (0.5 * (3 - outward.dot(outward)))
        inside = not self.eye_power > 0
        return Intersection(
            point=ray.at(t),
            t=t,
            distance=t * math.sqrt(a),
            normal=-outward if inside else outward,
            inside=inside,
            surface=self,
            material=self.material,
            index=index,
        )

    def from_center(self, at: Intersection) -> Direction:
        """From this sphere's centre to a point on it."""
        outward = -at.normal if at.inside else at.normal
        return Direction(self.radius * outward.x, self.radius * outward.y, self.radius * outward.z)

    def blocks(self, at: Intersection, light: Light) -> bool:
        own = at.surface
        if own is self:
            # Convex: from outside never; from inside if and only if the light is outside.
            return at.inside and (light.parallel or self.light_sides[light.number] > 0)
        assert isinstance(own, Sphere)
        p = own.from_center(at)
        w = light.direction_from(own.center, p)
        centers = self.center - own.center
        f = centers - p
        a, b = w.dot(w), f.dot(w)
        # |f|^2 - radius^2, or the same by way of the centres: the one with the smaller terms has the smaller error.
        ff, rr = f.dot(f), self.radius * self.radius
        shift, step = centers.dot(f - p), (own.radius - self.radius) * (own.radius + self.radius)
        c = shift + step if abs(shift) + abs(step) < ff + rr else ff - rr
        side = 1 if light.parallel else self.light_sides[light.number]
        if side < 0:
            return c > 0
        across = f.cross(w)
        arr = a * (self.radius * self.radius)
        meets = (b * b - a * c if b * b < arr else arr - across.dot(across)) >= 0
        enters = c > 0 and meets and b > 0
        leaves = c < 0 or (c == 0 and b > 0)
        if side == 0:
            return enters and b < a
        return enters or leaves if light.parallel else (enters and b < a) or leaves


@dataclass(frozen=True, slots=True)
class Light:
    """A parallel, point or spot light.

    towards: unit direction to a parallel light; position: of the other ones; axis: unit direction of a spot light;
    alpha1, alpha2: its angles in radians, None for the others.
    """

    number: int
    color: Color
    towards: Direction | None
    position: Point | None
    axis: Direction | None
    alpha1: float | None
    alpha2: float | None

    @property
    def parallel(self) -> bool:
        return self.towards is not None

    def direction_from(self, center: Point, p: Direction) -> Direction:
        """From the point center + p to the light: a unit vector if the light is parallel, else the whole way."""
        if self.towards is not None:
            return self.towards
        assert self.position is not None
        return (self.position - center) - p

    def strength(self, w: Direction) -> float:
        """The share of the light that leaves in the direction -w: 1, but less towards the rim of a spot's cone."""
        if self.axis is None or self.alpha1 is None or self.alpha2 is None:
            return 1.0
        if not -w.dot(self.axis) >= math.cos(self.alpha2) * math.sqrt(w.dot(w)):
            return 0.0
        if self.alpha1 == self.alpha2:
            return 1.0
        l = w.normalized()  # noqa: E741
        angle = math.atan2(self.axis.cross(l).length(), -self.axis.dot(l))
        return min(1.0, max(0.0, 1 - (angle - self.alpha1) / (self.alpha2 - self.alpha1)))


@dataclass(frozen=True)
class World:
    """A scene in camera space, as objects."""

    camera: Camera
    surfaces: list[Surface]
    lights: list[Light]
    ambient: Color
    background: Color


def world_of(scene: Scene) -> World:
    """Moves a scene into camera space, in exact arithmetic: each coordinate is rounded once."""
    eye = scene.camera.position
    basis = scene.camera.basis()

    def relative(p: Iterable[float]) -> list[Fraction]:
        return [Fraction(a) - Fraction(b) for a, b in zip(p, eye, strict=True)]

    def rotated(p: list[Fraction]) -> tuple[Fraction, Fraction, Fraction]:
        x, y, z = (_sum(Fraction(e) * v for e, v in zip(axis, p, strict=True) if e) for axis in basis)
        return x, y, z

    def turned(v: Iterable[float]) -> Direction:
        return Direction(*_rotate(basis, v)).normalized()

    lights = []
    positions = {}
    for number, light in enumerate(scene.lights[scene.lights["kind"] != AMBIENT]):
        kind, spot = light["kind"], light["kind"] == SPOT
        place = None
        if kind != PARALLEL:
            positions[number] = relative(light["position"].tolist())
            place = Point(*map(float, rotated(positions[number])))
        lights.append(
            Light(
                number,
                _color(light["color"]),
                -turned(light["direction"].tolist()) if kind == PARALLEL else None,
                place,
                turned(light["direction"].tolist()) if spot else None,
                math.radians(light["alpha1"]) if spot else None,
                math.radians(light["alpha2"]) if spot else None,
            )
        )
    materials = [
        Material(_color(m["color"]), *(float(m[k]) for k in ("ka", "kd", "ks", "exponent"))) for m in scene.materials
    ]
    surfaces: list[Surface] = []
    for sphere in scene.spheres:
        center = relative(sphere["center"].tolist())
        square = Fraction(float(sphere["radius"])) ** 2
        power = _sum(x * x for x in center) - square
        sides = {}
        for number, position in positions.items():
            light_power = _sum((a - b) ** 2 for a, b in zip(position, center, strict=True)) - square
            sides[number] = (light_power > 0) - (light_power < 0)
        surfaces.append(Sphere(rotated(center), float(sphere["radius"]), materials[sphere["material"]], power, sides))
    ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
    return World(scene.camera, surfaces, lights, _color(ambient), _color(np.array(scene.background)))


def _sum(terms: Iterable[Fraction]) -> Fraction:
    return sum(terms, Fraction(0))


def _color(value: NDArray[np.float64]) -> Color:
    r, g, b = value.tolist()
    return (r, g, b)


def _rotate(basis: tuple[tuple[float, float, float], ...], v: Iterable[float]) -> list[float]:
    x, y, z = v
    largest = max(abs(x), abs(y), abs(z))
    w = Direction(x / largest, y / largest, z / largest)
    return [Direction(*axis).dot(w) for axis in basis]


def primary_ray(camera: Camera, u: int, v: int) -> Ray:
    """The ray through the centre of the pixel in column u and row v; row 0 is the top.

    The tutorial's (2 (u + 0.5)/width - 1) tan(fov_x), as a whole number times the size of a pixel: symmetric pixels get
    exactly symmetric rays. It is not normalised, so nothing is rounded that need not be.
    """
    width, height = camera.resolution
    half_width, half_height = camera.image_plane()
    x = (2 * u + 1 - width) * (half_width / width)
    y = (height - 1 - 2 * v) * (half_height / height)
    return Ray(EYE, Direction(x, y, -1.0))


def closest_hit(world: World, ray: Ray) -> Intersection | None:
    """The nearest intersection; of equally near ones, that with the surface of the lowest index."""
    nearest, index = math.inf, -1
    for i, surface in enumerate(world.surfaces):
        t = surface.intersect(ray)
        if t is not None and comes_first(ray, surface, t, world.surfaces[index], nearest):
            nearest, index = t, i
    return world.surfaces[index].intersection_at(ray, nearest, index) if index >= 0 else None


def comes_first(ray: Ray, surface: Surface, t: float, other: Surface, best: float) -> bool:
    """Whether the ray meets a surface, at t, strictly before another one, at `best`.

    Where the two could be equal but for rounding, the unrounded distances decide; closer than 2^-70 is equal.
    """
    if best < math.inf and abs(t - best) <= best * 2.0**-22:
        theirs = other.exact_distance(ray)
        return surface.exact_distance(ray) < theirs * (1 - Fraction(1, 2**70))
    return t < best


def cast_shadow_ray(world: World, at: Intersection, light: Light) -> bool:
    """Whether anything stands between the point and the light; what is behind the light does not."""
    return any(surface.blocks(at, light) for surface in world.surfaces)


def illuminate(world: World, ray: Ray, at: Intersection, light: Light) -> Color:
    """What one light adds by Phong's formula: kd C L (n.l) + ks L (r.v)^exponent, if it reaches the point."""
    own = at.surface
    assert isinstance(own, Sphere)
    n, m = at.normal, at.material
    outward = -n if at.inside else n
    # n.(L - P) by way of the centre: P = center + radius n, so n.P needs no rounding.
    if light.towards is not None:
        cosine = outward.dot(light.towards)
    else:
        assert light.position is not None
        cosine = outward.dot(light.position - own.center) - own.radius
    if not (-cosine if at.inside else cosine) > 0:
        return (0.0, 0.0, 0.0)
    w = light.direction_from(own.center, own.from_center(at))
    strength = light.strength(w)
    if strength == 0 or cast_shadow_ray(world, at, light):
        return (0.0, 0.0, 0.0)
    l = w.normalized()  # noqa: E741
    v = -ray.direction.normalized()
    n_l = min(1.0, n.dot(l))
    if not n_l > 0:
        return (0.0, 0.0, 0.0)
    r = n * (2 * n.dot(l)) - l
    highlight = m.ks * max(0.0, min(1.0, r.dot(v))) ** m.exponent
    red, green, blue = (strength * (m.kd * c * n_l + highlight) * L for c, L in zip(m.color, light.color, strict=True))
    return (red, green, blue)


def trace(world: World, ray: Ray) -> tuple[Color, Intersection | None]:
    """The colour that is seen along a ray, not clamped, and what is there."""
    at = closest_hit(world, ray)
    if at is None:
        return world.background, None
    red, green, blue = (at.material.ka * a * c for a, c in zip(world.ambient, at.material.color, strict=True))
    for light in world.lights:
        more = illuminate(world, ray, at, light)
        red, green, blue = red + more[0], green + more[1], blue + more[2]
    return (red, green, blue), at


def byte_of(value: float, truncate: bool = False) -> int:
    """0..255, linear: rounded to nearest, or down as the course's own pictures are."""
    return int(max(0.0, min(1.0, value)) * 255 + (0.0 if truncate else 0.5))
