"""Lights in camera space, and the rays that look for them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from cltrace.reference.doubt import RoughLine, RoughStart, U
from cltrace.reference.exact import Line, Rational, minus, vector
from cltrace.reference.rays import Start
from cltrace.reference.vectors import Color, Direction, Point


@dataclass(frozen=True, slots=True)
class Light:
    """A parallel, point or spot light.

    towards: unit direction to a parallel light; position: of the other ones; axis: unit direction of a spot light;
    alpha1, alpha2: its angles in radians, None for the others; place: in the world, exactly, from the eye to the light,
    or the direction to a parallel light, of any length; site: the position in the world, as the file has it.
    """

    color: Color
    towards: Direction | None
    position: Point | None
    axis: Direction | None
    alpha1: float | None
    alpha2: float | None
    place: Rational
    site: Point | None = None

    @property
    def parallel(self) -> bool:
        return self.towards is not None

    def direction_from(self, start: Start) -> Direction:
        """From the point to the light: a unit vector if the light is parallel, else the whole way, in scene units."""
        if self.towards is not None:
            return self.towards
        assert self.position is not None
        # By way of the anchor: the point's own coordinates are never formed.
        return (self.position - start.anchor) - start.from_anchor

    def strength(self, w: Direction) -> float:
        """The share of the light that leaves in the direction -w, which is not 0: 1, less near the rim of a spot."""
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
class ShadowRay:
    """The points start + t w for 0 < t < t_max, where w is the whole way to a light.

    inside: whether the start is seen from the inside of its sphere; then the ray crosses that inside. t_max is 1, as
    what is behind the light does not matter, and infinite if the light is parallel; then w may have any length.
    """

    start: Start
    inside: bool
    light: Light

    @property
    def t_max(self) -> float:
        return math.inf if self.light.parallel else 1.0

    @property
    def _skew(self) -> float:
        surface = self.start.surface
        assert surface is not None
        return surface.frame.skew

    @cached_property
    def rough_start(self) -> RoughStart:
        """The start in doubles with bounds of their errors."""
        return RoughStart(self.start, self._skew)

    @cached_property
    def rough_line(self) -> RoughLine:
        """The way in doubles with bounds of their errors."""
        skew = self._skew
        if self.light.towards is not None:
            return RoughLine(self.light.towards, 64 * U + 4 * skew, skew)
        assert self.light.position is not None
        return RoughLine(*self.rough_start.to(self.light.position), skew)

    @cached_property
    def line(self) -> Line:
        """The ray in exact numbers, in the world: to a parallel light, along the direction that the file gives."""
        point, light = self.start.exact_point, vector(self.light.place)
        return Line(point, light if self.light.parallel else minus(light, point))

    @cached_property
    def line_of_light(self) -> Line:
        """As the light comes: from a light at a point to the start; of a parallel light, the same as `line`."""
        light = vector(self.light.place)
        return self.line if self.light.parallel else Line(light, minus(self.line.start, light))
