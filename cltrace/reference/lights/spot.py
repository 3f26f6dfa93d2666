"""Light that leaves a point within a cone."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cltrace.reference.exact import Frame
from cltrace.reference.lights.point import PointLight
from cltrace.reference.vectors import Direction


@dataclass(frozen=True)
class SpotLight(PointLight):
    """axis: the unit direction in which it shines; alpha1, alpha2: radians off the axis, beyond which light fades,
    and beyond which there is none."""

    axis: Direction
    alpha1: float
    alpha2: float

    @classmethod
    def of(cls, light: np.void, eye: Iterable[float], frame: Frame) -> SpotLight:
        cone: dict[str, Any] = {name: math.radians(light[name]) for name in ("alpha1", "alpha2")}
        return cls(**vars(PointLight.of(light, eye, frame)), axis=frame.turned(light["direction"].tolist()), **cone)

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
