"""What can be hit: Surface, which each shape implements in its own file, and what is known where a ray hits one."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from cltrace.exact.lines import Line, Root
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start, View, Way, way_of
from cltrace.reference.vectors import Color, Direction, Point
from cltrace.scene import FULL, Scene
from cltrace.scene import Texture as Texels

if TYPE_CHECKING:
    from cltrace.reference.clipping import Entry

UV = tuple[float, float]


class Lookup(NamedTuple):
    """x, y: the pixel at the upper left of the four that are mixed; right, down: the shares of those to the right of it
    and below; color: the mixture."""

    x: int
    y: int
    right: float
    down: float
    color: Color


class Texture:
    """An image that repeats: u = 0..1 is its width from left to right, v = 0..1 its height from top to bottom.

    u = i / W is exactly column i of W, and v = j / H row j. In between, the four pixels around are mixed by how near
    they are: bilinear interpolation.

    texels: (H, W, 3), of uint8, uint16 or int16, of which FULL says what full colour is.
    """

    def __init__(self, texels: Texels) -> None:
        self.texels, self.full = texels, FULL[texels.dtype]

    def lookup(self, uv: UV) -> Lookup:
        """The colour at (u, v), 1 = full in each channel, and how it comes about."""
        height, width = self.texels.shape[:2]
        # The image repeats, so whole parts do not matter. Without them, large numbers keep the digits behind.
        x, y = (uv[0] - math.floor(uv[0])) * width, (uv[1] - math.floor(uv[1])) * height
        i, j = math.floor(x), math.floor(y)
        upper = _mix(self.texel(i, j), self.texel(i + 1, j), x - i)
        lower = _mix(self.texel(i, j + 1), self.texel(i + 1, j + 1), x - i)
        return Lookup(i % width, j % height, right=x - i, down=y - j, color=_mix(upper, lower, y - j))

    def texel(self, i: int, j: int) -> Color:
        """The pixel in column i and row j, both counted on beyond the image."""
        height, width = self.texels.shape[:2]
        red, green, blue = self.texels[j % height, i % width].tolist()
        return (red / self.full, green / self.full, blue / self.full)


def _mix(a: Color, b: Color, share: float) -> Color:
    """a for share = 0, b for 1."""
    red, green, blue = (x + share * (y - x) for x, y in zip(a, b, strict=True))
    return (red, green, blue)


@dataclass(frozen=True, slots=True)
class PhongMaterial:
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
        red, green, blue = (c * texel for c, texel in zip(self.color, self.texture.lookup(uv).color, strict=True))
        return (red, green, blue)


@dataclass(frozen=True, slots=True)
class Intersection:
    """All that an intersection test finds out.

    point: where; t: at which multiple of the ray's direction; distance: how far, in scene units; normal: unit, facing
    the side from which the ray came; inside: whether that was the inside; start: the point as the start of further
    rays; uv: where in the material's texture; index: the number of the surface that was hit; primitive: the number of
    the triangle in its mesh, -1 for other surfaces; turned: whether the surface's own normal faces the other side.
    """

    point: Point
    t: float
    distance: float
    normal: Direction
    inside: bool
    start: Start
    material: PhongMaterial
    uv: UV
    index: int
    primitive: int = -1
    turned: bool = False

    @property
    def surface(self) -> Surface:
        surface = self.start.surface
        assert isinstance(surface, Surface)
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


class Shape(ABC):
    """An object of the scene: a surface, or several, of which each ray tries those that it may meet.

    number: among the scene's surfaces; view: the camera's; kind: what it is in a file; clipped: whether clipping planes
    clip it.
    """

    material: PhongMaterial
    number: int
    view: View
    kind: str
    clipped: bool = True

    @abstractmethod
    def parts(self, ray: Ray | ShadowRay) -> Iterator[Surface]:
        """The surfaces that a ray may meet, by rising numbers."""

    def solids(self, ray: Ray | ShadowRay) -> Iterator[Shape]:
        """What of it may contain a point of a ray."""
        yield self

    def contains(self, entry: Entry) -> bool:
        """Whether it is a closed surface, and a ray enters the region of clipping planes strictly inside of it."""
        return False


class Surface(Shape):
    """Something that can be hit.

    spread: of its normals' rounding, see bounce.lift(); shape: what its normals are made of; primitive: the number of a
    triangle in its mesh.
    """

    spread: float = 1.0
    shape: str
    primitive: int = -1

    def parts(self, ray: Ray | ShadowRay) -> Iterator[Surface]:
        yield self

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

    def blocking_root(self, ray: ShadowRay) -> tuple[Line, Root]:
        """Where a surface that blocks a shadow ray does so: the line and its root."""
        raise NotImplementedError


class Setting(NamedTuple):
    """What surfaces are made from. view: the camera's; material: by its number in the scene."""

    scene: Scene
    view: View
    material: Callable[[int], PhongMaterial]


def first_met(surfaces: Iterable[Surface], ray: Ray) -> tuple[float, Surface] | None:
    """The surface that a ray meets first, and at which t; of equally near ones, the first one here. None if none."""
    best: tuple[float, Surface] | None = None
    for surface in surfaces:
        t = surface.intersect(ray)
        if t is not None and (best is None or comes_first(ray, surface, t, other=best[1], best=best[0])):
            best = t, surface
    return best


def comes_first(ray: Ray, surface: Surface, t: float, other: Surface, best: float) -> bool:
    """Whether the ray meets a surface, at t, strictly before another one, at `best`.

    A t is off by 2^-24 of itself at most. Where two are closer than that, exact arithmetic decides; equal is equal,
    but for planes that cross there, see exact.Root.
    """
    if not abs(t - best) > best * 2.0**-22:
        return surface.exact_t(ray) < other.exact_t(ray)
    return t < best


def way_along(ray: Ray | ShadowRay, view: View) -> Way | None:
    """In doubles, None if these may not decide: a ray, and a shadow ray as the light comes."""
    return ray.way_of_light if isinstance(ray, ShadowRay) else way_of(ray, view)
