"""Surfaces: what a ray can meet. These are spheres and ellipsoids, one record each, whose material is an index.

The surface is { x : |K (x - center)| = radius } with K, the linear map from the world to the object's own axes, an
entry of the scene's to_object, or 1 without one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.maps import inverses
from cltrace.scene.rules import ANY, POSITIVE, check_rule, checked

SPHERE = np.dtype(
    [
        ("center", "f8", (3,)),  # scene units
        ("radius", "f8"),  # scene units
        ("material", "i4"),  # index into the scene's materials
        ("to_object", "i4"),  # index into the scene's to_object; -1: a sphere
    ]
)
MAX_SPHERES = 2**26


def check_spheres(spheres: NDArray[np.void], materials: int, to_object: NDArray[np.float64]) -> None:
    """Raises ValueError, which names field and index, where a SPHERE array holds what is not allowed.

    materials: how many there are; to_object: (k, 3, 3), as `checked_maps` returns it.
    """
    if len(spheres) > MAX_SPHERES:
        raise ValueError(f"spheres: must be at most {MAX_SPHERES}, got {len(spheres)}")
    check_rule("spheres.center", ANY, spheres["center"])
    check_rule("spheres.radius", POSITIVE, spheres["radius"])
    lost = (spheres["material"] < 0) | (spheres["material"] >= materials)
    if lost.any():
        i = int(np.argmax(lost))
        raise ValueError(f"spheres.material[{i}]: must be the index of a material, got {spheres['material'][i]}")
    lost = (spheres["to_object"] < -1) | (spheres["to_object"] >= len(to_object))
    if lost.any():
        i = int(np.argmax(lost))
        got = spheres["to_object"][i]
        raise ValueError(f"spheres.to_object[{i}]: must be -1 or the index of one of to_object, got {got}")
    if fault := extent_fault(spheres, inverses(to_object)):
        raise ValueError(f"spheres.radius[{fault[0]}]: {fault[1]}")


def checked_maps(to_object: ArrayLike) -> NDArray[np.float64]:
    """(k, 3, 3) maps from the world to an object's own axes. Raises ValueError, which names the index."""
    if not np.size(to_object):
        return np.empty((0, 3, 3))
    maps = checked("to_object", ANY, to_object, (-1, 3, 3))
    singular = np.isnan(inverses(maps)).any(axis=(1, 2))
    if singular.any():
        raise ValueError(f"to_object[{int(np.argmax(singular))}]: must not be singular")
    return maps


def extent_fault(spheres: NDArray[np.void], to_world: NDArray[np.float64]) -> tuple[int, str] | None:
    """The first sphere that reaches too far, or not far enough, and what is wrong with it; None if there is none.

    Half of its extent along each axis of the world obeys the rule of a radius. to_world: (k, 3, 3), the inverses of the
    scene's to_object.
    """
    bad = np.argwhere(~POSITIVE.admits(spheres["radius"]))
    if len(bad):
        return int(bad[0, 0]), f"radius {POSITIVE.fault(float(spheres['radius'][bad[0, 0]]))}"
    bent = np.flatnonzero(spheres["to_object"] >= 0)
    with np.errstate(over="ignore"):
        lengths = np.sqrt(np.square(to_world).sum(axis=2))
        extents = spheres["radius"][bent, None] * lengths[spheres["to_object"][bent]]
    bad = np.argwhere(~POSITIVE.admits(extents))
    if len(bad):
        i, axis = bad[0].tolist()
        return int(bent[i]), f"half of its extent along {'xyz'[axis]} {POSITIVE.fault(float(extents[i, axis]))}"
    return None
