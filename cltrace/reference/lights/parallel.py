"""Parallel light, as from the sun."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cltrace.reference.exact import Frame, rational
from cltrace.reference.lights.light import Light
from cltrace.reference.rays import Start
from cltrace.reference.vectors import Direction, color_of


@dataclass(frozen=True)
class ParallelLight(Light):
    """towards: the unit direction to the light."""

    towards: Direction

    @classmethod
    def of(cls, light: np.void, eye: Iterable[float], frame: Frame) -> ParallelLight:
        direction = light["direction"].tolist()
        x, y, z = rational(direction)
        return cls(color_of(light["color"]), (-x, -y, -z), None, site=None, towards=-frame.turned(direction))

    def direction_from(self, start: Start) -> Direction:
        return self.towards

    def height_above(self, start: Start, outward: Direction) -> float:
        return outward.dot(self.towards)
