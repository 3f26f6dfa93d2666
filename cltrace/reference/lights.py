"""Lights in camera space, and the ray that looks for one."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cltrace.exact.lines import ExactPoint, Line
from cltrace.reference.rays import Start, View, Way
from cltrace.reference.vectors import Color, Direction, Point, color_of, size_of
from cltrace.scene import PARALLEL, POINT, SPOT


@dataclass(frozen=True)
class Light(ABC):
    """Something that shines.

    exact: the light in the world, or of one that is infinitely far away the direction to it, of any length; position:
    in camera space, rounded, and site: in the world, as the file has it, both None of one that is infinitely far away.
    """

    color: Color
    exact: ExactPoint
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
class ParallelLight(Light):
    """As from the sun. towards: the unit direction to the light."""

    towards: Direction

    def direction_from(self, start: Start) -> Direction:
        return self.towards

    def height_above(self, start: Start, outward: Direction) -> float:
        return outward.dot(self.towards)


@dataclass(frozen=True)
class PointLight(Light):
    """Light that leaves a point to all sides."""

    position: Point
    site: Point

    def direction_from(self, start: Start) -> Direction:
        """By way of the anchor: the point's own coordinates are never formed."""
        return (self.position - start.anchor) - start.from_anchor

    def height_above(self, start: Start, outward: Direction) -> float:
        return start.height(self.position, outward)


@dataclass(frozen=True)
class SpotLight(PointLight):
    """Light that leaves a point within a cone. axis: the unit direction in which it shines; alpha1, alpha2: radians off
    the axis, beyond which light fades, and beyond which there is none."""

    axis: Direction
    alpha1: float
    alpha2: float

    def off_axis(self, l: Direction) -> float:  # noqa: E741
        """The angle in radians between the axis and the way back along the unit direction l."""
        return math.atan2(self.axis.cross(l).length(), -self.axis.dot(l))

    def strength(self, w: Direction) -> float:
        """Less than 1 near the rim of the cone."""
        if not -w.dot(self.axis) >= math.cos(self.alpha2) * math.sqrt(w.dot(w)):
            return 0.0
        if self.alpha1 == self.alpha2:
            return 1.0
        angle = self.off_axis(w.normalized())
        return min(1.0, max(0.0, 1 - (angle - self.alpha1) / (self.alpha2 - self.alpha1)))


@dataclass(frozen=True)
class LambertLight(PointLight):
    """Light that leaves a point of a flat lamp, by Lambert's law. axis: the unit direction in which it is brightest;
    elsewhere it is as the cosine of the angle from there."""

    axis: Direction

    def strength(self, w: Direction) -> float:
        return max(0.0, -self.axis.dot(w.normalized()))


def light_of(light: np.void, view: View) -> Light:
    """What a scene's light is to its camera."""
    color, direction = color_of(light["color"]), light["direction"].tolist()
    if light["kind"] == PARALLEL:
        back = ExactPoint.of([-x for x in direction])
        return ParallelLight(color, back, None, None, towards=-view.turned(direction))
    site = Point(*light["position"].tolist())
    exact = ExactPoint.of(site)
    at = (color, exact, view.seen(exact), site)
    if light["kind"] == POINT:
        return PointLight(*at)
    axis = view.turned(direction)
    if light["kind"] == SPOT:
        return SpotLight(*at, axis, *(math.radians(light[name]) for name in ("alpha1", "alpha2")))
    return LambertLight(*at, axis)


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

    @cached_property
    def line(self) -> Line:
        """The ray in exact numbers, in the world: to a parallel light, along the direction that the file gives."""
        point, light = self.start.exact_point, self.light.exact
        return Line(point, light if self.light.parallel else light - point)

    @cached_property
    def line_of_light(self) -> Line:
        """As the light comes: from a light at a point to the start; of a parallel light, the same as `line`."""
        light = self.light.exact
        return self.line if self.light.parallel else Line(light, self.start.exact_point - light)

    @cached_property
    def way(self) -> Way | None:
        """In doubles, from the start to the light; None if these may not decide about it."""
        start, site = self.start, self.light.site
        if not start.fits:
            return None
        if site is None:
            w = Direction(*self.light.exact.rounded())
            return Way(start.place, w, size_of(w), step=start.step, reach=start.reach)
        w = (site - start.place) - start.step
        return Way(start.place, w, size_of(w) + start.reach, step=start.step, reach=start.reach)

    @cached_property
    def way_of_light(self) -> Way | None:
        """The same as the light comes, see line_of_light."""
        way, site = self.way, self.light.site
        if way is None or site is None:
            return way
        return Way(site, (self.start.place - site) + self.start.step, way.w1)
