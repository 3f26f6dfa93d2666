"""What can be hit: Surface, which each shape implements in its own file, and what is known where a ray hits one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from cltrace.reference.exact import Frame, Root
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start
from cltrace.reference.texture import UV, Texture
from cltrace.reference.vectors import Color, Direction, Point
from cltrace.scene import Scene


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
    material: Material
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


class Surface(ABC):
    """Something that can be hit.

    number: among the scene's surfaces; frame: the camera's axes; spread: of its normals' rounding, see bounce.lift();
    shape: what its normals are made of; kind: what it is in a file; primitive: the number of a triangle in its mesh.
    """

    material: Material
    number: int
    frame: Frame
    spread: float = 1.0
    shape: str
    kind: str
    primitive: int = -1

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

    def parts(self, ray: Ray | ShadowRay) -> Iterator[Surface]:
        """What a ray may meet of it, by rising numbers: itself, where it is no group."""
        yield self


class Setting(NamedTuple):
    """What surfaces are made from. eye, frame: the camera's place and axes; material: by its number in the scene."""

    scene: Scene
    eye: Point
    frame: Frame
    material: Callable[[int], Material]


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
    but for planes that cross there, see face.Face.
    """
    if not abs(t - best) > best * 2.0**-22:
        return surface.exact_t(ray) < other.exact_t(ray)
    return t < best
