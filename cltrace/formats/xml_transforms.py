"""The steps of a `transform`, folded into a sphere's centre and radius."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lxml import etree

from cltrace.formats.xml_elements import Values
from cltrace.scene import Vector

# The axes that a turn by 90 degrees takes one to the other.
_PLANE = {"rotateX": (1, 2), "rotateY": (2, 0), "rotateZ": (0, 1)}


def transformed(
    center: Vector, radius: float, steps: Sequence[tuple[etree._Element, Values]]
) -> tuple[list[float], float]:
    """Centre and radius in the world, in scene units, after the steps, of which the last listed acts first.

    Scales must be uniform.
    """
    p = list(center)
    for element, step in reversed(steps):
        tag = element.tag
        if tag == "translate":
            p = [a + b for a, b in zip(p, step.values(), strict=True)]
        elif tag == "scale":
            p = [a * b for a, b in zip(p, step.values(), strict=True)]
            radius *= abs(step["x"])
        else:
            i, j = _PLANE[tag]
            cos, sin = cos_sin(step["theta"])
            p[i], p[j] = cos * p[i] - sin * p[j], sin * p[i] + cos * p[j]
    return p, radius


def cos_sin(degrees: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees, exact at the multiples of 90."""
    turned = math.remainder(degrees, 360.0)  # This is exact, as is the difference below.
    quarter = round(turned / 90.0)
    rest = math.radians(turned - 90.0 * quarter)
    cos, sin = math.cos(rest), math.sin(rest)
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]
