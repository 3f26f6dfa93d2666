"""What any rays meet first of a scene: surfaces of all kinds together."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Floats
from cltrace.oracle.cylinders import Cylinders
from cltrace.oracle.rays import Ids, along, at_point
from cltrace.oracle.search import Kind, Kinds
from cltrace.oracle.spheres import Spheres, array_of
from cltrace.oracle.triangles import Triangles
from cltrace.reference.ways import first_hits
from cltrace.scene import Geometry, Scene

# The table of shapes.
KINDS: tuple[type[Kind], ...] = (Triangles, Spheres, Cylinders)


class Answer(NamedTuple):
    """Of n rays. id, primitive: (n,) int32, numbers of the surface in the scene and of the triangle in its mesh, -1 for
    none; t: (n,) float64, correctly rounded, in units of the direction, inf where nothing is met."""

    id: NDArray[np.int32]
    primitive: NDArray[np.int32]
    t: Floats


def closest_hit(
    scene: Scene,
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: float | Floats = 0.0,
    t_max: float | Floats = np.inf,
) -> Answer:
    """Find the first surface that each ray meets, exactly.

    Touching counts, and an edge belongs to one of its triangles: the one that the ray turned by e, e^2 and e^3 along x,
    y and z meets for small e > 0. Of equally near surfaces, the lowest number is met, and in a mesh the lowest
    triangle; of triangles in different planes, the one that the turned ray meets first.

    Every ray tries every surface: less than 1 us for each, and some 100 us where the exact engine decides. A scene with
    clipping planes is left to the reference tracer, which takes milliseconds for each ray.

    Parameters
    ----------
    scene : Scene
    origins, directions : array_like, shape (n, 3) or (3,)
        In the world, scene units; finite. Directions need not be normalized; `t` is in multiples of their length.
    t_min, t_max : float or ndarray, shape (n,)
        Only hits with ``t_min < t < t_max`` count.

    Returns
    -------
    Answer
        Arrays `id`, `primitive` and `t`.

    Raises
    ------
    ValueError
        If an array has another shape or is not finite, or a direction is 0. The message names the argument.
    """
    o, d = rays_of(origins, directions)
    if len(scene.planes):
        met = first_hits(scene, o, d, *(np.broadcast_to(t, len(o)) for t in (t_min, t_max)))
        return Answer(met.id, met.primitive, met.t)
    kinds = kinds_of(scene)
    item, t = closest_item(kinds, o, d, t_min, t_max)
    id_, primitive = (np.append(numbers, -1)[item].astype(np.int32) for numbers in (kinds.surface, kinds.primitive))
    return Answer(id_, primitive, t)


def kinds_of(scene: Scene) -> Kinds:
    """All surfaces of a scene."""
    return Kinds([kind.of(scene) for kind in KINDS])


def closest_item(
    kinds: Kinds,
    o: Floats,
    d: Floats,
    t_min: float | Floats,
    t_max: float | Floats,
    pairs: tuple[Ids, Ids] | None = None,
) -> tuple[Ids, Floats]:
    """What rays, (n, 3), meet first: its row in `kinds`, -1 for none, and t, correctly rounded. pairs: (k,) rays,
    rising, and rows that may meet, None for all of them."""
    # Doubles need a finite start. No surface is before this one.
    with np.errstate(over="ignore"):
        extent = np.abs(o).max(axis=1) + max(kind.extent for kind in kinds.kinds)
        begin = -4 * extent / np.abs(d).max(axis=1)
    low = np.where(np.isneginf(t_min), begin, t_min)
    found = kinds.closest(replace(along(at_point(o, len(o)), d, np.eye(3)), t_min=low, t_max=t_max), pairs)
    return found.item, found.rounded()


def rays_of(origins: ArrayLike, directions: ArrayLike) -> tuple[Floats, Floats]:
    """Both as (n, 3). Raises ValueError, which names the argument."""
    given = {"origins": origins, "directions": directions}
    arrays = [array_of(name, x, *(3,) if np.ndim(x) == 1 and np.size(x) else (-1, 3)) for name, x in given.items()]
    o, d = (np.atleast_2d(x) for x in arrays)
    if len(o) != len(d) and 1 not in (len(o), len(d)):
        raise ValueError(f"directions: must be as many as origins, {len(o)}, or one, got {len(d)}")
    none = np.flatnonzero(~d.any(axis=1))
    if len(none):
        raise ValueError(f"directions[{none[0]}]: must not be 0")
    shape = (len(d) if len(o) == 1 else len(o), 3)
    return np.broadcast_to(o, shape), np.broadcast_to(d, shape)


def triangles_met(
    origins: ArrayLike, directions: ArrayLike, vertices: ArrayLike, faces: ArrayLike
) -> NDArray[np.int64]:
    """How many triangles each ray meets at t > 0, (n,). Of a closed mesh, from outside, that is even.

    origins, directions: as of closest_hit(); vertices: (v, 3); faces: (f, 3), indices of each triangle's corners.
    Raises ValueError, which names the argument.
    """
    o, d = rays_of(origins, directions)
    mesh = Geometry(vertices, faces)
    numbers = np.arange(len(mesh.faces))
    flat = Triangles(mesh.vertices, mesh.faces.astype(np.int64), 0 * numbers, numbers)
    return Kinds([flat]).counts(along(at_point(o, len(o)), d, np.eye(3)))
