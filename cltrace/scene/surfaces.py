"""Surfaces: what a ray can meet. So far these are spheres, one record each, whose material is an index."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cltrace.scene.rules import ANY, POSITIVE, check_rule

SPHERE = np.dtype(
    [
        ("center", "f8", (3,)),  # scene units
        ("radius", "f8"),  # scene units
        ("material", "i4"),  # index into the scene's materials
    ]
)
MAX_SPHERES = 2**26


def check_spheres(spheres: NDArray[np.void], materials: int) -> None:
    """Raises ValueError, which names field and index, where a SPHERE array holds what is not allowed.

    materials: how many there are.
    """
    if len(spheres) > MAX_SPHERES:
        raise ValueError(f"spheres: must be at most {MAX_SPHERES}, got {len(spheres)}")
    check_rule("spheres.center", ANY, spheres["center"])
    check_rule("spheres.radius", POSITIVE, spheres["radius"])
    lost = (spheres["material"] < 0) | (spheres["material"] >= materials)
    if lost.any():
        i = int(np.argmax(lost))
        raise ValueError(f"spheres.material[{i}]: must be the index of a material, got {spheres['material'][i]}")
