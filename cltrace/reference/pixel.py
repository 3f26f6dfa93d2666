"""What the rays of a pixel see, as one sum, and the byte that stands for it in a picture."""

from __future__ import annotations

from cltrace.base.limits import MAX_RAYS
from cltrace.reference.vectors import Color


class Pixel:
    """The sum of what all rays of one pixel see, in whole multiples of 2^-60, so that their order does not matter.

    The kernel's are multiples of 2^-40, which is far below what its colours in float32 show. Here they are finer, since
    a background of 0.9, seen in a perfect mirror, is 229.5 levels and has to be rounded up as beside the mirror.
    """

    UNIT, FULL, RAYS = 2.0**-60, 2**81, MAX_RAYS

    def __init__(self) -> None:
        self.sums, self.rays = [0, 0, 0], 1

    def add(self, weight: float, color: Color) -> None:
        for i, value in enumerate(color):
            units = weight * value / self.UNIT if value > 0 else 0.0  # black, also where a weight is infinite
            self.sums[i] = min(self.sums[i] + (round(units) if units < self.FULL else self.FULL), self.FULL)

    def count_ray(self) -> None:
        self.rays += 1
        if self.rays > self.RAYS:
            raise ValueError(f"camera.max_bounces: must be lower, a pixel takes more than {self.RAYS} rays")

    @property
    def color(self) -> Color:
        red, green, blue = (units * self.UNIT for units in self.sums)
        return (red, green, blue)


def byte_of(value: float, truncate: bool = False) -> int:
    """0..255, linear: rounded to nearest, or down as the course's own pictures are."""
    return int(max(0.0, min(1.0, value)) * 255 + (0.0 if truncate else 0.5))
