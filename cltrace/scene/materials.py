"""Materials: of one colour all over, shaded after Phong."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.rules import NOT_NEGATIVE, check_rule

MATERIAL = np.dtype(
    [
        ("color", "f8", (3,)),  # linear, 1 = full
        ("ka", "f8"),  # share of the colour in ambient light
        ("kd", "f8"),  # share of the colour in diffuse light
        ("ks", "f8"),  # strength of the highlight
        ("exponent", "f8"),  # the larger, the smaller the highlight
    ]
)
COEFFICIENTS = ("ka", "kd", "ks", "exponent")


def check_materials(materials: NDArray[np.void]) -> None:
    """Raises ValueError, which names field and index, where a MATERIAL array holds what is not allowed."""
    for name in (*COEFFICIENTS, "color"):
        check_rule(f"materials.{name}", NOT_NEGATIVE, materials[name])


def packed(count: int, fields: Mapping[str, ArrayLike]) -> NDArray[np.void]:
    """A (count,) MATERIAL array; each field has a value for each record or one for all."""
    materials = np.empty(count, MATERIAL)
    for name, value in fields.items():
        materials[name] = value
    return materials
