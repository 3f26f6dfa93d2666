"""What the reference decided on the way to a colour: trace.py sums it up, and cltrace.explanation prints it.

Points and directions are in camera space. Colours are linear, 1 = full, and not clamped.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from cltrace.base.limits import MAX_RAYS
from cltrace.reference.bounce import Bounce
from cltrace.reference.lights import Light
from cltrace.reference.rays import Ray
from cltrace.reference.surfaces import Intersection
from cltrace.reference.vectors import Color, Direction

BLACK: Color = (0.0, 0.0, 0.0)
# Whether a light reaches a point, or why not.
Fate = Literal["lit", "behind", "beside the cone", "in shadow", "at the point"]


@dataclass(frozen=True, slots=True)
class Illumination:
    """What one light adds at a point.

    w: from the point to the light, as Light.direction_from() has it; l: the same with length 1, or n where w is 0;
    r: l mirrored at the normal n; n_l: n.l; r_v: r.v, where v leads back along the ray, with length 1; strength: the
    share of the light that leaves in the direction -w; diffuse, specular: the two terms of Phong's formula, whose sum
    is the color, black unless `fate` is lit.
    """

    light: Light
    fate: Fate
    w: Direction
    l: Direction  # noqa: E741
    r: Direction
    n_l: float
    r_v: float
    strength: float
    diffuse: Color = BLACK
    specular: Color = BLACK

    @property
    def color(self) -> Color:
        (red, green, blue), (r, g, b) = self.diffuse, self.specular
        return (red + r, green + g, blue + b)


@dataclass(frozen=True, slots=True)
class Shading:
    """The colour of a point in the light that reaches it straight from the lights: ambient light and all others."""

    ambient: Color
    lights: tuple[Illumination, ...]

    @property
    def color(self) -> Color:
        red, green, blue = self.ambient
        for light in self.lights:
            red, green, blue = red + light.color[0], green + light.color[1], blue + light.color[2]
        return (red, green, blue)


@dataclass(frozen=True, slots=True)
class Sight:
    """One ray and what it sees.

    at: what it meets, None for the background; share: of the point's own colour, which is 1 but where rays go on;
    shading: how that comes about, None if it does not count; own: that colour, or the background's; bounces: where rays
    go on from there; last: whether max_bounces ends here what would go on.
    """

    ray: Ray
    at: Intersection | None
    share: float
    shading: Shading | None
    own: Color
    bounces: tuple[Bounce, ...]
    last: bool


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
