"""The steps of a `transform`: folded into a sphere's centre and radius, or the map of an ellipsoid or of a mesh."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.formats.xml_elements import Values
from cltrace.scene import Vector, uniform_scales

Steps = Sequence[tuple[etree._Element, Values]]
Rows = Sequence[Sequence[float]]
Maps = tuple[Rows, Rows]

# The axes that a turn by 90 degrees takes one to the other.
_PLANE = {"rotateX": (1, 2), "rotateY": (2, 0), "rotateZ": (0, 1)}


def transformed(
    center: Vector, radius: float, steps: Steps, turns: bool = False
) -> tuple[list[float], float, Maps | None]:
    """Centre and radius in the world, in scene units, after the steps, of which the last listed acts first.

    Of an ellipsoid, the radius is the one before the steps, and the third are its linear map to the world and that from
    the world: the product of the inverse steps. It is None where the steps together scale all directions alike.

    turns: whether the sphere is not the same from all sides, as with a texture. Then the maps are also given, with the
    radius before the steps, where the steps turn or mirror it. That from the world is a rotation, or a mirror image of
    one, times the inverse scale: K (x - c), with c the centre, is as long as the radius where x is on the sphere.
    """
    p = list(center)
    alike, scaled = True, radius
    for element, step in reversed(steps):
        if element.tag == "translate":
            p = [a + b for a, b in zip(p, step.values(), strict=True)]
        elif element.tag == "scale":
            p = [a * b for a, b in zip(p, step.values(), strict=True)]
            scaled *= abs(step["x"])
            alike &= abs(step["x"]) == abs(step["y"]) == abs(step["z"])
        else:
            i, j, cos, sin = _turn(element.tag, step["theta"])
            p[i], p[j] = cos * p[i] - sin * p[j], sin * p[i] + cos * p[j]
    if alike and not turns:
        return p, scaled, None
    linear = _product(steps)
    if not turns or _upright(linear):
        scale = float(uniform_scales(np.array([linear]))[0])
        if alike or not math.isnan(scale):
            return p, scaled if alike else radius * scale, None
    return p, radius, (linear, [*zip(*_product(steps, inverse=True), strict=True)])


def to_world(steps: Steps) -> list[list[float]]:
    """The rows of the affine map of all steps to the world, (3, 4); its numbers are products and sums of doubles."""
    origin, _, _ = transformed((0.0, 0.0, 0.0), 1.0, steps)
    return [[*row, place + 0.0] for row, place in zip(_product(steps), origin, strict=True)]  # makes -0 a 0


def maps_of(steps: Steps) -> NDArray[np.float64]:
    """(k, 3, 4): the affine maps of the steps, one by one."""
    return np.array([to_world([step]) for step in steps])


def _upright(rows: Rows) -> bool:
    """Whether a linear map only scales, by the same in all directions."""
    scale = rows[0][0]
    return scale > 0 and all(x == (scale if i == j else 0) for i, row in enumerate(rows) for j, x in enumerate(row))


def _product(steps: Steps, inverse: bool = False) -> list[list[float]]:
    """The rows of the steps' linear parts, multiplied; or of their inverses', transposed: a rotation's is itself."""
    rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    for element, step in reversed(steps):
        if element.tag == "scale":
            rows = [[a / s if inverse else a * s for a in row] for row, s in zip(rows, step.values(), strict=True)]
        elif element.tag != "translate":
            i, j, cos, sin = _turn(element.tag, step["theta"])
            pairs = list(zip(rows[i], rows[j], strict=True))
            rows[i], rows[j] = [cos * a - sin * b for a, b in pairs], [sin * a + cos * b for a, b in pairs]
    return [[a + 0.0 for a in row] for row in rows]  # makes -0 a 0


def _turn(tag: str, degrees: float) -> tuple[int, int, float, float]:
    """The two axes that a rotation takes one towards the other, its cosine and its sine."""
    return *_PLANE[tag], *cos_sin(degrees)


def cos_sin(degrees: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees, exact at the multiples of 90."""
    turned = math.remainder(degrees, 360.0)  # This is exact, as is the difference below.
    quarter = round(turned / 90.0)
    rest = math.radians(turned - 90.0 * quarter)
    cos, sin = math.cos(rest), math.sin(rest)
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]
