"""A light in camera space, of any kind, and the ray that looks for it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

from cltrace.base.arithmetic import minus
from cltrace.reference.doubt import RoughLine, RoughStart, U
from cltrace.reference.exact import Line, Rational, vector
from cltrace.reference.rays import Start
from cltrace.reference.vectors import Color, Direction, Point


@dataclass(frozen=True)
class Light(ABC):
    """Something that shines: each kind of light has its file.

    place: in the world, exactly, from the eye to the light, or of one that is infinitely far away the direction to it,
    of any length; position: in camera space, rounded, and site: in the world, as the file has it, both None of one that
    is infinitely far away.
    """

    color: Color
    place: Rational
    position: Point | None
    site: Point | None

    @property
    def parallel(self) -> bool:
        """Whether it is infinitely far away."""
        return self.position is None

    @abstractmethod
    def direction_from(self, start: Start) -> Direction:
        """From the point to the light: a unit vector if the light is parallel, else the whole way, in scene units."""

    @abstractmethod
    def height_above(self, start: Start, outward: Direction) -> float:
        """Of the light, above the plane that touches a surface at the point. outward: its unit normal there."""

    def strength(self, w: Direction) -> float:
        """The share of the light that leaves in the direction -w, which is not 0."""
        return 1.0


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
        return self.start.frame.skew

    @cached_property
    def rough_start(self) -> RoughStart:
        """The start in doubles with bounds of their errors."""
        return RoughStart(self.start, self._skew)

    @cached_property
    def rough_line(self) -> RoughLine:
        """The way in doubles with bounds of their errors."""
        skew, position = self._skew, self.light.position
        if position is None:
            return RoughLine(self.light.direction_from(self.start), 64 * U + 4 * skew, skew)
        return RoughLine(*self.rough_start.to(position), skew)

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
