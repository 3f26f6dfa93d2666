"""What the reference decided on the way to a colour: trace.py sums it up, and cltrace.explanation prints it.

Points and directions are in camera space. Colours are linear, 1 = full, and not clamped.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
