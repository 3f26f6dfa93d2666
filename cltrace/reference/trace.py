"""From a pixel to its colour. The functions, and their order, are those of kernels/trace.cl.

Each returns a record of what it decided, which cltrace.explanation prints. Points and directions are in camera space.
Colours are linear, 1 = full, and not clamped.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from cltrace.base.limits import MAX_RAYS
from cltrace.reference.bounce import SecondaryRay, bounces
from cltrace.reference.lights import Light, ShadowRay
from cltrace.reference.rays import Ray, start_on_plane, view_of
from cltrace.reference.surfaces import Intersection, Surface, first_met
from cltrace.reference.vectors import EYE, Color, Direction
from cltrace.reference.world import World
from cltrace.scene import AnyCamera

BLACK: Color = (0.0, 0.0, 0.0)
# Whether a light reaches a point, or why not.
Fate = Literal["lit", "behind", "beside the cone", "in shadow", "at the point"]


@dataclass(frozen=True, slots=True)
class Illumination:
    """What one light adds at a point.

    w: from the point to the light, as Light.direction_from() has it; l: the same with length 1, or n where w is 0;
    r: l mirrored at the normal n; n_l: n.l; r_v: r.v, where v leads back along the ray, with length 1; strength: the
    share of the light that leaves in the direction -w; diffuse, specular: the two terms of Phong's formula, whose sum
    is the color, black unless `fate` is lit.
    """

    light: Light
    fate: Fate
    w: Direction
    l: Direction  # noqa: E741
    r: Direction
    n_l: float
    r_v: float
    strength: float
    diffuse: Color = BLACK
    specular: Color = BLACK

    @property
    def color(self) -> Color:
        (red, green, blue), (r, g, b) = self.diffuse, self.specular
        return (red + r, green + g, blue + b)


@dataclass(frozen=True, slots=True)
class Shading:
    """The colour of a point in the light that reaches it straight from the lights: ambient light and all others."""

    ambient: Color
    lights: tuple[Illumination, ...]

    @property
    def color(self) -> Color:
        red, green, blue = self.ambient
        for light in self.lights:
            red, green, blue = red + light.color[0], green + light.color[1], blue + light.color[2]
        return (red, green, blue)


@dataclass(frozen=True, slots=True)
class Sight:
    """One ray and what it sees.

    at: what it meets, None for the background; share: of the point's own colour, which is 1 but where rays go on;
    shading: how that comes about, None if it does not count; own: that colour, or the background's; bounces: where rays
    go on from there; last: whether max_bounces ends here what would go on.
    """

    ray: Ray
    at: Intersection | None
    share: float
    shading: Shading | None
    own: Color
    bounces: tuple[SecondaryRay, ...]
    last: bool


class Pixel:
    """The sum of what all rays of one pixel see, in whole multiples of 2^-60, so that their order does not matter.

    The kernel's are multiples of 2^-40, which is far below what its colours in float32 show. Here they are finer, since
    a background of 0.9, seen in a perfect mirror, is 229.5 levels and has to be rounded up as beside the mirror.
    """

    UNIT, FULL, RAYS = 2.0**-60, 2**81, MAX_RAYS

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
        return Ray(start_on_plane(view_of(camera), x, y), Direction(0.0, 0.0, -1.0))
    return Ray(EYE, Direction(x, y, -1.0))


def closest_hit(world: World, ray: Ray) -> Intersection | None:
    """The nearest intersection; of equally near ones, that with the surface of the lowest number."""
    met = first_met(world.parts(ray), ray)
    return intersection_at(ray, *met) if met else None


def intersection_at(ray: Ray, t: float, surface: Surface) -> Intersection:
    """Everything about the point at which a ray meets a surface first."""
    return surface.intersection_at(ray, t)


def cast_shadow_ray(world: World, at: Intersection, light: Light) -> bool:
    """Whether anything stands between the point and the light; what is behind the light does not."""
    return any(world.blockers(ShadowRay(at.start, at.inside, light)))


def illuminate(world: World, ray: Ray, at: Intersection, light: Light) -> Illumination:
    """What one light adds by Phong's formula: kd C L (n.l) + ks L (r.v)^exponent, if it reaches the point.

    A light that touches the point shines along the surface, if anywhere.
    """
    n, m = at.normal, at.material
    w = light.direction_from(at.start)
    l = w.normalized() if any(w) else n  # noqa: E741
    n_l = n.dot(l)
    r = n * (2 * n_l) - l
    r_v = -r.dot(ray.direction.normalized())
    strength = light.strength(w) if any(w) else 0.0
    fate: Fate = "lit"
    if not any(w):
        fate = "at the point"
    elif not at.side * light.height_above(at.start, at.outward) > 0:
        fate = "behind"
    elif strength == 0:
        fate = "beside the cone"
    elif cast_shadow_ray(world, at, light):
        fate = "in shadow"
    elif not n_l > 0:
        fate = "behind"
    found = Illumination(light=light, fate=fate, w=w, l=l, r=r, n_l=n_l, r_v=r_v, strength=strength)
    if fate != "lit":
        return found
    red, green, blue = (strength * (m.kd * c * min(1.0, n_l)) * L for c, L in zip(at.color, light.color, strict=True))
    r, g, b = (strength * (m.ks * max(0.0, min(1.0, r_v)) ** m.exponent) * L for L in light.color)
    return replace(found, diffuse=(red, green, blue), specular=(r, g, b))


def shade(world: World, ray: Ray, at: Intersection) -> Shading:
    """What the point shows of the light that reaches it straight from the lights: ambient light and Phong's formula."""
    red, green, blue = (at.material.ka * a * c for a, c in zip(world.ambient, at.color, strict=True))
    return Shading((red, green, blue), tuple(illuminate(world, ray, at, light) for light in world.lights))


def follow(world: World, ray: Ray, weight: float = 1.0, depth: int = 0) -> Sight:
    """What a ray meets, what that shows itself, and where rays go on from there.

    weight: of what it sees in the pixel, not 0; depth: how many bounces lie behind it. It bounces again while depth <=
    max_bounces; what is met after the last bounce counts in full.
    """
    at = closest_hit(world, ray)
    if at is None:
        return Sight(ray, None, 1.0, None, world.background, (), last=False)
    m = at.material
    last = m.passes_on and depth > world.camera.max_bounces
    share, further = 1.0, tuple[SecondaryRay, ...]()
    if m.passes_on and not last:
        share = max(0.0, (1 - m.reflectance) - m.transmittance)
        further = tuple(bounce for bounce in bounces(ray, at) if weight * bounce.share > 0)
    shading = shade(world, ray, at) if weight * share > 0 else None
    return Sight(ray, at, share, shading, shading.color if shading else BLACK, further, last)


def trace(world: World, ray: Ray, depth: int = 0, pixel: Pixel | None = None) -> tuple[Color, Intersection | None]:
    """The colour that is seen along a ray, not clamped, and what is there.

    depth: how many bounces lie behind it; pixel: to which all that is seen is added, too.

    Raises ValueError, which names max_bounces, where mirrors and glass make more than 2^20 rays of one.
    """
    pixel, first, left = pixel or Pixel(), None, [(ray, 1.0, depth)]
    while left:
        ray, weight, depth = left.pop()
        sight = follow(world, ray, weight, depth)
        first = first or sight
        pixel.add(weight * sight.share, sight.own)
        for bounce in reversed(sight.bounces):
            pixel.count_ray()
            left.append((Ray(bounce.start, bounce.direction), weight * bounce.share, depth + 1))
    assert first is not None
    return pixel.color if first.at and first.at.material.passes_on else first.own, first.at
