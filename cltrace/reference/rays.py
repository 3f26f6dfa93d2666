"""Rays: where they start, where they lead, and how far they count."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cltrace.reference.exact import Frame, Line, vector
from cltrace.reference.vectors import Direction, Point

if TYPE_CHECKING:
    from cltrace.reference.surfaces import Sphere

EYE = Point(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Start:
    """The point by which a ray leaves a sphere: exactly center + radius n / |n|, n being the double triple `normal`.

    Rounded coordinates would put it off the sphere, and every ray from there would need an epsilon. normal: outward in
    camera space, of any length but 0; of an ellipsoid, that of the sphere that it is in its own axes. Rays are decided
    soonest where it is unit to rounding.
    """

    surface: Sphere
    normal: Direction

    @property
    def from_center(self) -> Direction:
        """From the surface's centre to the point, rounded, for a unit normal."""
        return self.surface.from_center(self.normal)

    @property
    def point(self) -> Point:
        """The point, rounded."""
        return self.surface.center + self.surface.from_center(self.normal.normalized())


@dataclass(frozen=True)
class Ray:
    """The points origin + t direction for t_min < t < t_max. The direction may have any length; t is in units of it.

    origin: a point in camera space whose coordinates are exactly these doubles, or a point of a sphere. direction: in
    camera space, exactly these doubles.
    """

    origin: Point | Start
    direction: Direction
    t_min: float = 0.0
    t_max: float = math.inf

    def at(self, t: float) -> Point:
        start = self.origin.point if isinstance(self.origin, Start) else self.origin
        return start + self.direction * t

    def line(self, frame: Frame) -> Line:
        """The ray in exact numbers, in the world."""
        if isinstance(self.origin, Start):
            start = self.origin.surface.exact_point(self.origin.normal)
        else:
            start = vector(frame.to_world(self.origin))
        return Line(start, vector(frame.to_world(self.direction)))
