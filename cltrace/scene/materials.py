"""Materials: of one colour all over, shaded after Phong; what they mirror and let through."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.rules import ANY, NOT_NEGATIVE, check_rule

MATERIAL = np.dtype(
    [
        ("color", "f8", (3,)),  # linear, 1 = full
        ("ka", "f8"),  # share of the colour in ambient light
        ("kd", "f8"),  # share of the colour in diffuse light
        ("ks", "f8"),  # strength of the highlight
        ("exponent", "f8"),  # the larger, the smaller the highlight
        ("reflectance", "f8"),  # share of the light that is mirrored
        ("transmittance", "f8"),  # share of the light that is let through, refracted
        ("index", "f8"),  # index of refraction inside, 1 outside; counts only where transmittance > 0
    ]
)
COEFFICIENTS = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance")


def check_materials(materials: NDArray[np.void]) -> None:
    """Raises ValueError, which names field and index, where a MATERIAL array holds what is not allowed."""
    for name in (*COEFFICIENTS, "color"):
        check_rule(f"materials.{name}", NOT_NEGATIVE, materials[name])
    check_index("materials.index", materials["index"], materials["transmittance"])


def check_index(name: str, index: NDArray[np.float64], transmittance: NDArray[np.float64]) -> None:
    """Raises ValueError, which names the array and the place, where light is let through with an index <= 0.

    Either may be one number for all.
    """
    check_rule(name, ANY, index)
    index, transmittance = np.broadcast_arrays(index, transmittance)
    bad = np.argwhere((index <= 0) & (transmittance > 0))
    if len(bad):
        where = tuple(bad[0])
        place = "".join(f"[{i}]" for i in where)
        raise ValueError(f"{name}{place}: must be > 0 where transmittance > 0, got {index[where]:g}")


def packed(count: int, fields: Mapping[str, ArrayLike]) -> NDArray[np.void]:
    """A (count,) MATERIAL array; each field has a value for each record or one for all."""
    materials = np.empty(count, MATERIAL)
    for name, value in fields.items():
        materials[name] = value
    return materials
