"""From a pixel to its colour. The names, and their order, are those of kernels/trace.cl."""

from __future__ import annotations

from collections.abc import Iterator

from cltrace.reference.bounce import mirrored, refracted
from cltrace.reference.lights import Light, ShadowRay
from cltrace.reference.rays import EYE, OnPlane, Ray
from cltrace.reference.surfaces import Intersection, first_met
from cltrace.reference.vectors import Color, Direction, Point
from cltrace.reference.world import World, frame_of
from cltrace.scene import AnyCamera

BLACK: Color = (0.0, 0.0, 0.0)


def primary_ray(camera: AnyCamera, u: int, v: int) -> Ray:
    """The ray through the centre of the pixel in column u and row v; row 0 is the top.

    The tutorial's (2 (u + 0.5)/width - 1) tan(fov_x), as a whole number times the size of a pixel: symmetric pixels get
    exactly symmetric rays. It is not normalised, so nothing is rounded that need not be. A ray of an orthographic
    camera starts there, and leads along -z.
    """
    width, height = camera.resolution
    half_width, half_height = camera.image_plane()
    x = (2 * u + 1 - width) * (half_width / width)
    y = (height - 1 - 2 * v) * (half_height / height)
    if camera.parallel:
        return Ray(OnPlane(Point(*camera.position), frame_of(camera), x, y), Direction(0.0, 0.0, -1.0))
    return Ray(EYE, Direction(x, y, -1.0))


def closest_hit(world: World, ray: Ray) -> Intersection | None:
    """The nearest intersection; of equally near ones, that with the surface of the lowest number."""
    met = first_met(world.surfaces, ray)
    if met is None:
        return None
    t, surface = met
    return surface.intersection_at(ray, t)


def cast_shadow_ray(world: World, at: Intersection, light: Light) -> bool:
    """Whether anything stands between the point and the light; what is behind the light does not."""
    ray = ShadowRay(at.start, at.inside, light)
    return any(surface.blocks(ray) for surface in world.surfaces)


def faces(at: Intersection, light: Light) -> bool:
    """Whether the side of the surface from which the ray came is turned to the light."""
    if light.towards is not None:
        cosine = at.outward.dot(light.towards)
    else:
        assert light.position is not None
        cosine = at.start.height(light.position, at.outward)
    return (-cosine if at.inside else cosine) > 0


def illuminate(world: World, ray: Ray, at: Intersection, light: Light) -> Color:
    """What one light adds by Phong's formula: kd C L (n.l) + ks L (r.v)^exponent, if it reaches the point."""
    n, m = at.normal, at.material
    if not faces(at, light):
        return BLACK
    w = light.direction_from(at.start)
    if not any(w):
        return BLACK  # a light that touches the point shines along the surface, if anywhere
    strength = light.strength(w)
    if strength == 0 or cast_shadow_ray(world, at, light):
        return BLACK
    l = w.normalized()  # noqa: E741
    v = -ray.direction.normalized()
    n_l = min(1.0, n.dot(l))
    if not n_l > 0:
        return BLACK
    r = n * (2 * n.dot(l)) - l
    highlight = m.ks * max(0.0, min(1.0, r.dot(v))) ** m.exponent
    red, green, blue = (strength * (m.kd * c * n_l + highlight) * L for c, L in zip(at.color, light.color, strict=True))
    return (red, green, blue)


def local_color(world: World, ray: Ray, at: Intersection) -> Color:
    """What the point shows of the light that reaches it straight from the lights: ambient light and Phong's formula."""
    red, green, blue = (at.material.ka * a * c for a, c in zip(world.ambient, at.color, strict=True))
    for light in world.lights:
        more = illuminate(world, ray, at, light)
        red, green, blue = red + more[0], green + more[1], blue + more[2]
    return (red, green, blue)


def trace(world: World, ray: Ray) -> tuple[Color, Intersection | None]:
    """The colour that is seen along a ray, not clamped, and what is there.

    Raises ValueError, which names max_bounces, where mirrors and glass make more than 2^20 rays of one.
    """
    at = closest_hit(world, ray)
    if at is not None and at.material.passes_on:
        pixel = Pixel()
        follow(world, ray, at, 1.0, 0, pixel)
        return pixel.color, at
    return (world.background if at is None else local_color(world, ray, at)), at


def follow(world: World, ray: Ray, at: Intersection | None, weight: float, depth: int, pixel: Pixel) -> None:
    """Adds to a pixel what a ray sees, with a weight, which is not 0, and what the rays see that go on from there.

    at: what the ray meets; depth: how many bounces lie behind it. It bounces again while depth <= max_bounces; what is
    met after the last bounce counts in full.
    """
    if at is None:
        pixel.add(weight, world.background)
        return
    m, ends = at.material, depth > world.camera.max_bounces
    share = 1.0 if ends else max(0.0, (1 - m.reflectance) - m.transmittance)
    if weight * share > 0:
        pixel.add(weight * share, local_color(world, ray, at))
    if ends:
        return
    for direction, part in bounces(ray, at):
        if weight * part > 0:
            pixel.count_ray()
            further = Ray(at.start, direction)
            follow(world, further, closest_hit(world, further), weight * part, depth + 1, pixel)


def bounces(ray: Ray, at: Intersection) -> Iterator[tuple[Direction, float]]:
    """The directions in which a ray goes on, and how much of what is seen there it sees."""
    m, d, n, spread = at.material, ray.direction, at.outward, at.surface.spread
    mirror = m.reflectance
    if m.transmittance > 0:
        through = refracted(d, n, at.side, m.index, spread)
        if through is None:  # total reflection
            mirror += m.transmittance
        else:
            yield through, m.transmittance
    if mirror > 0:
        yield mirrored(d, n, at.side, spread), mirror


class Pixel:
    """The sum of what all rays of one pixel see, in whole multiples of 2^-60, so that their order does not matter.

    The kernel's are multiples of 2^-40, which is far below what its colours in float32 show. Here they are finer, since
    a background of 0.9, seen in a perfect mirror, is 229.5 levels and has to be rounded up as beside the mirror.
    """

    UNIT, FULL, RAYS = 2.0**-60, 2**81, 2**20

    def __init__(self) -> None:
        self.sums, self.rays = [0, 0, 0], 1

    def add(self, weight: float, color: Color) -> None:
        for i, value in enumerate(color):
            units = weight * value / self.UNIT if value > 0 else 0.0  # black, also where a weight is infinite
            self.sums[i] = min(self.sums[i] + (round(units) if units < self.FULL else self.FULL), self.FULL)

    def count_ray(self) -> None:
        self.rays += 1
        if self.rays > self.RAYS:
            raise ValueError(f"camera.max_bounces: must be lower, a pixel takes more than {self.RAYS} rays")

    @property
    def color(self) -> Color:
        red, green, blue = (units * self.UNIT for units in self.sums)
        return (red, green, blue)


def byte_of(value: float, truncate: bool = False) -> int:
    """0..255, linear: rounded to nearest, or down as the course's own pictures are."""
    return int(max(0.0, min(1.0, value)) * 255 + (0.0 if truncate else 0.5))
