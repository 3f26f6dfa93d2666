"""Light that leaves a point of a flat lamp, by Lambert's law."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cltrace.reference.exact import Frame
from cltrace.reference.lights.point import PointLight
from cltrace.reference.vectors import Direction


@dataclass(frozen=True)
class LambertLight(PointLight):
    """axis: the unit direction in which it is brightest; elsewhere it is as the cosine of the angle from there."""

    axis: Direction

    @classmethod
    def of(cls, light: np.void, eye: Iterable[float], frame: Frame) -> LambertLight:
        return cls(**vars(PointLight.of(light, eye, frame)), axis=frame.turned(light["direction"].tolist()))

    def strength(self, w: Direction) -> float:
        return max(0.0, -self.axis.dot(w.normalized()))
