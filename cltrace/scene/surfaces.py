"""Surfaces: what a ray can meet. These are spheres and ellipsoids, one record each, whose material is an index.

The surface is { x : |K (x - center)| = radius } with K, the linear map from the world to the object's own axes, an
entry of the scene's to_object, or 1 without one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import inverses
from cltrace.base.limits import MAX_SPHERES
from cltrace.scene.maps import deviations, uniform_scales
from cltrace.scene.rules import ANY, POSITIVE, check_rule, checked, numbers

SPHERE = np.dtype(
    [
        ("center", "f8", (3,)),  # scene units
        ("radius", "f8"),  # scene units
        ("material", "i4"),  # index into the scene's materials
        ("to_object", "i4"),  # index into the scene's to_object; -1: a sphere
    ]
)
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


def shaped(
    radius: NDArray[Any], n: int, transform: ArrayLike | None
) -> tuple[NDArray[Any], NDArray[np.int32], NDArray[np.float64]]:
    """What a linear map makes of n spheres: their radii, which of the maps each of them has, and the scene's to_object.

    Raises ValueError, which names the argument and the index.
    """
    if transform is None:
        return radius, np.array(-1, np.int32), np.empty((0, 3, 3))
    to_world = numbers("transform", transform)
    if to_world.shape not in ((3, 3), (n, 3, 3)):
        raise ValueError(f"transform: must have shape (3, 3) or {(n, 3, 3)}, got {to_world.shape}")
    check_rule("transform", ANY, to_world)
    maps = to_world.reshape(-1, 3, 3)
    scales = uniform_scales(maps)
    bent = np.flatnonzero(np.isnan(scales))
    to_object = inverses(maps[bent])
    for i, fault in inverse_faults(maps[bent], to_object):
        raise ValueError(f"transform{f'[{bent[i]}]' if to_world.ndim == 3 else ''}: {fault}")
    radii = np.broadcast_to(radius * np.where(np.isnan(scales), 1.0, scales), (n,))
    for i in np.flatnonzero(~POSITIVE.admits(radii)).tolist():
        raise ValueError(f"transform: of sphere {i}, the radius {POSITIVE.fault(float(radii[i]))}")
    index = np.full(len(maps), -1, np.int32)
    index[bent] = np.arange(len(bent))
    of_sphere = np.array(np.broadcast_to(index, (n,)))
    turned = np.flatnonzero(of_sphere >= 0)
    reach = row_lengths(maps[bent])[of_sphere[turned]]
    for i, fault in extent_faults(radii[turned], reach):
        raise ValueError(f"transform: of sphere {turned[i]}, {fault}")
    return np.array(radii), of_sphere, to_object
