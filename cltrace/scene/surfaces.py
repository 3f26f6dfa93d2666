"""Surfaces: what a ray can meet. These are spheres and ellipsoids, one record each, whose material is an index.

The surface is { x : |K (x - center)| = radius } with K, the linear map from the world to the object's own axes, an
entry of the scene's to_object, or 1 without one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.numbers.inverses import inverses
from cltrace.scene.maps import deviations
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
MAX_DEVIATION = 2.0**-24  # of an ellipsoid's distances from its centre: depths are given to no more


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
    reach = reaches(to_object)
    singular = np.isnan(reach).any(axis=1)
    if singular.any():
        raise ValueError(f"to_object[{int(np.argmax(singular))}]: must not be singular")
    bent = np.flatnonzero(spheres["to_object"] >= 0)
    for i, fault in extent_faults(spheres["radius"][bent], reach[spheres["to_object"][bent]]):
        raise ValueError(f"spheres.radius[{bent[i]}]: {fault}")


def checked_maps(to_object: ArrayLike) -> NDArray[np.float64]:
    """A (k, 3, 3) array of its own, of numbers that the rules allow. Raises ValueError, which names the index."""
    return checked("to_object", ANY, to_object, (-1, 3, 3))


def inverse_faults(to_world: NDArray[np.float64], to_object: NDArray[np.float64]) -> Iterator[tuple[int, str]]:
    """What is wrong with the maps of ellipsoids, each with its index, in words that belong behind "transform: ".

    to_world: (n, 3, 3), what makes an ellipsoid of a sphere; to_object: (n, 3, 3), its inverses as they were rounded,
    NaN for none.
    """
    admitted, errors = ANY.admits(to_object), deviations(to_object, to_world)
    for i in np.flatnonzero(~admitted.all(axis=(1, 2)) | ~(errors <= MAX_DEVIATION)).tolist():
        extreme = to_object[i][~admitted[i]].tolist()
        if np.isnan(to_object[i]).any() or (not extreme and np.isnan(errors[i])):
            yield i, "must not be singular"
        elif extreme:
            yield i, f"its inverse {ANY.fault(extreme[0])}"
        else:
            yield i, "must not distort so much that rounding spoils its inverse"


def extent_faults(radii: NDArray[np.float64], reach: NDArray[np.float64]) -> Iterator[tuple[int, str]]:
    """Ellipsoids that reach too far, or not far enough, each with its index and words that begin with what is wrong.

    Half of the extent along each axis of the world obeys the rule of a radius. radii: (n,); reach: (n, 3), the same
    halves with radius 1.
    """
    with np.errstate(over="ignore"):
        extents = radii[:, None] * reach
    bad = ~POSITIVE.admits(extents)
    for i in np.flatnonzero(bad.any(axis=1)).tolist():
        axis = int(np.argmax(bad[i]))
        yield i, f"half of the extent along {'xyz'[axis]} {POSITIVE.fault(float(extents[i, axis]))}"


def reaches(to_object: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half of the extents along the axes of the world of the ellipsoids of radius 1 with (k, 3, 3) maps, (k, 3).

    NaN of a singular map.
    """
    return row_lengths(inverses(to_object))


def row_lengths(maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """The lengths of the rows of (k, 3, 3) maps, (k, 3); one beyond 1e154 may be infinite."""
    with np.errstate(over="ignore"):
        lengths: NDArray[np.float64] = np.sqrt(np.square(maps).sum(axis=2))
        return lengths
