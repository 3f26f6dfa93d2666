"""Rays: where they start, where they lead, and how far they count."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from cltrace.reference.exact import Frame, Line, Vector, vector
from cltrace.reference.vectors import Direction, Point

EYE = Point(0.0, 0.0, 0.0)


class Start(ABC):
    """The point of a surface by which a ray leaves it: exactly, by numbers that put it on the surface.

    Or a point of the plane where the rays of an orthographic camera start.

    Rounded coordinates would put it off the surface, and every ray from there would need an epsilon. Doubles reach it
    in two steps, of which the first one is exact: to a point nearby, the anchor, and from there.
    """

    @property
    @abstractmethod
    def surface(self) -> Any:
        """The surface that the ray leaves; None if it comes from the camera."""

    @property
    def frame(self) -> Frame:
        """The camera's axes."""
        frame: Frame = self.surface.frame
        return frame

    @property
    @abstractmethod
    def place(self) -> Point:
        """The anchor in the world, exactly."""

    @property
    @abstractmethod
    def anchor(self) -> Point:
        """The anchor in camera space, rounded."""

    @property
    @abstractmethod
    def step(self) -> Direction:
        """From the anchor to the point, along the world's axes, rounded."""

    @cached_property
    def from_anchor(self) -> Direction:
        """The same in camera space."""
        return self.frame.B @ self.step

    @property
    @abstractmethod
    def reach(self) -> float:
        """How far the point is from the anchor at most."""

    @property
    @abstractmethod
    def error(self) -> float:
        """A bound of what from_anchor is off by, beside the 2 k reach for the camera's skew k, see doubt.py."""

    @property
    def fits(self) -> bool:
        """Whether step is as good as equation.py and crossing.py need it."""
        return True

    @property
    @abstractmethod
    def exact_point(self) -> Vector:
        """The point, exactly, from the eye along the world's axes."""

    @property
    def point(self) -> Point:
        """The point in camera space, rounded."""
        return self.anchor + self.from_anchor

    def height(self, point: Point, n: Direction) -> float:
        """n.(point - P), how far a point is above the plane through this one that has the outward unit normal n."""
        return n.dot((point - self.anchor) - self.from_anchor)


@dataclass(frozen=True)
class OnPlane(Start):
    """A point of the plane where the rays of an orthographic camera start: exactly the eye plus x and y times its axes.

    The anchor is the eye. eye: in the world; axes: the camera's; x, y: scene units.
    """

    eye: Point
    axes: Frame
    x: float
    y: float

    @property
    def frame(self) -> Frame:
        return self.axes

    @property
    def surface(self) -> None:
        return None

    @property
    def place(self) -> Point:
        return self.eye

    @property
    def anchor(self) -> Point:
        return EYE

    @cached_property
    def step(self) -> Direction:
        return self.frame.B.T @ self.from_anchor

    @cached_property
    def from_anchor(self) -> Direction:
        return Direction(self.x, self.y, 0.0)

    @property
    def reach(self) -> float:
        return abs(self.x) + abs(self.y)

    @property
    def error(self) -> float:
        return 0.0

    @cached_property
    def exact_point(self) -> Vector:
        return vector(self.frame.to_world(self.from_anchor))


@dataclass(frozen=True)
class Ray:
    """The points origin + t direction for t_min < t < t_max. The direction may have any length; t is in units of it.

    origin: a point in camera space whose coordinates are exactly these doubles, or a point of a surface. direction: in
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
        start = self.origin.exact_point if isinstance(self.origin, Start) else vector(frame.to_world(self.origin))
        return Line(start, vector(frame.to_world(self.direction)))

    @property
    def is_plain(self) -> bool:
        """Whether doubles may decide about it: it counts from 0 to infinity, starts at the eye or by a Start as good as
        that takes, and its d.d is far from the ends of double's range."""
        if (self.t_min, self.t_max) != (0, math.inf) or not 2.0**-200 < self.direction.dot(self.direction) < 2.0**200:
            return False
        return self.origin.fits if isinstance(self.origin, Start) else self.origin == EYE
