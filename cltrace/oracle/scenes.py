"""What any rays meet first of a scene: surfaces of all kinds together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Floats
from cltrace.oracle.search import Ids, Kind, Kinds, Rays
from cltrace.oracle.shapes import Cylinders, Spheres, Triangles
from cltrace.reference.ways import first_hits
from cltrace.scene import Geometry, Scene
from cltrace.scene.rules import numbers

# The table of shapes.
KINDS: tuple[type[Kind], ...] = (Triangles, Spheres, Cylinders)


class OracleHits(NamedTuple):
    """Of n rays. id, primitive: (n,) int32, numbers of the surface in the scene and of the triangle in its mesh, -1 for
    none; t: (n,) float64, correctly rounded, in units of the direction, inf where nothing is met."""

    id: NDArray[np.int32]
    primitive: NDArray[np.int32]
    t: Floats


def closest_hit(
    scene: Scene,
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike = 0.0,
    t_max: ArrayLike = np.inf,
) -> OracleHits:
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
    t_min, t_max : float or array_like, shape (n,)
        Only hits with ``t_min < t < t_max`` count.

    Returns
    -------
    OracleHits
        Arrays `id`, `primitive` and `t`.

    Raises
    ------
    ValueError
        If an array has another shape or is not finite, or a direction is 0. The message names the argument.
    """
    o, d, low, high = checked_rays(origins, directions, t_min, t_max)
    if len(scene.planes):
        met = first_hits(scene, o, d, low, high)
        return OracleHits(met.id, met.primitive, met.t)
    kinds = kinds_of(scene)
    item, t = closest_item(kinds, o, d, low, high)
    id_, primitive = (np.append(numbers, -1)[item].astype(np.int32) for numbers in (kinds.surface, kinds.primitive))
    return OracleHits(id_, primitive, t)


def kinds_of(scene: Scene) -> Kinds:
    """All surfaces of a scene."""
    return Kinds([kind.of(scene) for kind in KINDS])


def closest_item(
    kinds: Kinds, o: Floats, d: Floats, t_min: Floats, t_max: Floats, pairs: tuple[Ids, Ids] | None = None
) -> tuple[Ids, Floats]:
    """What rays, (n, 3), meet first: its row in `kinds`, -1 for none, and t, correctly rounded. pairs: (k,) rays,
    rising, and rows that may meet, None for all of them."""
    # Doubles need a finite start. No surface is before this one.
    with np.errstate(over="ignore"):
        begin = -4 * (np.abs(o).max(axis=1) + kinds.extent) / np.abs(d).max(axis=1)
    rays = Rays.of(o, d, np.where(np.isneginf(t_min), begin, t_min), t_max)
    found = kinds.closest(rays, pairs)
    return found.item, kinds.rounded(rays, found)


def checked_rays(
    origins: ArrayLike, directions: ArrayLike, t_min: ArrayLike = 0.0, t_max: ArrayLike = np.inf
) -> tuple[Floats, Floats, Floats, Floats]:
    """All arguments as arrays of the rays' number. Raises ValueError, which names the argument and the index."""
    points = [_vectors("origins", origins), _vectors("directions", directions)]
    none = np.flatnonzero(~points[1].any(axis=-1))
    if len(none):
        raise ValueError(f"directions{f'[{none[0]}]' if points[1].ndim == 2 else ''}: must not be 0")
    ends = [numbers("t_min", t_min), numbers("t_max", t_max)]
    counts = {len(x) for x in points if x.ndim == 2} | {len(x) for x in ends if x.ndim == 1}
    n = max(counts, default=1)
    for name, array, shape in zip(
        ("origins", "directions", "t_min", "t_max"), (*points, *ends), ((n, 3), (n, 3), (n,), (n,)), strict=True
    ):
        if array.shape not in (shape, shape[1:]):
            raise ValueError(f"{name}: must have shape {shape} or {shape[1:]}, got {array.shape}")
        if np.isnan(array).any():
            raise ValueError(f"{name}: must not be nan")
    o, d = (np.broadcast_to(x, (n, 3)) for x in points)
    low, high = (np.broadcast_to(x, (n,)) for x in ends)
    return o, d, low, high


def _vectors(name: str, value: ArrayLike) -> Floats:
    array = numbers(name, value)
    if array.shape == (0,):
        array = array.reshape(0, 3)
    if array.ndim not in (1, 2) or array.shape[-1] != 3:
        raise ValueError(f"{name}: must have shape (n, 3) or (3,), got {array.shape}")
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))
        where = "".join(f"[{i}]" for i in bad[0])
        raise ValueError(f"{name}{where}: must be a finite number, got {array[tuple(bad[0])]:g}")
    return array


def triangles_met(
    origins: ArrayLike, directions: ArrayLike, vertices: ArrayLike, faces: ArrayLike
) -> NDArray[np.int64]:
    """How many triangles each ray meets at t > 0, (n,). Of a closed mesh, from outside, that is even.

    origins, directions: as of closest_hit(); vertices: (v, 3); faces: (f, 3), indices of each triangle's corners.
    Raises ValueError, which names the argument.
    """
    o, d, *_ = checked_rays(origins, directions)
    mesh = Geometry(vertices, faces)
    numbers = np.arange(len(mesh.faces))
    flat = Triangles(mesh.vertices, mesh.faces.astype(np.int64), 0 * numbers, numbers)
    return Kinds([flat]).counts(Rays.of(o, d))
