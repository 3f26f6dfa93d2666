"""Light that leaves a point to all sides."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cltrace.reference.exact import Frame, between
from cltrace.reference.lights.light import Light
from cltrace.reference.rays import Start
from cltrace.reference.vectors import Direction, Point, color_of


@dataclass(frozen=True)
class PointLight(Light):
    position: Point
    site: Point

    @classmethod
    def of(cls, light: np.void, eye: Iterable[float], frame: Frame) -> PointLight:
        site = Point(*light["position"].tolist())
        place = between(eye, site)
        return cls(color_of(light["color"]), place, Point(*map(float, frame.to_camera(place))), site)

    def direction_from(self, start: Start) -> Direction:
        """By way of the anchor: the point's own coordinates are never formed."""
        return (self.position - start.anchor) - start.from_anchor

    def height_above(self, start: Start, outward: Direction) -> float:
        return start.height(self.position, outward)
