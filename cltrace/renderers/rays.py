"""trace_rays: what any rays meet first of a scene, decided exactly."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Floats
from cltrace.base.errors import DeviceError
from cltrace.oracle.scenes import checked_rays, closest_item, kinds_of
from cltrace.oracle.search import Ids
from cltrace.reference.ways import FirstHits, first_hits
from cltrace.renderers.surface_points import Rays, Spots, spots_of
from cltrace.run.devices import choose
from cltrace.run.rays import RayTracer
from cltrace.scene import Scene
from cltrace.scene.rules import described

# Fewer rays are decided by the exact engine alone, as long as these are not more pairs of a ray and a surface, which
# takes a second: so nobody waits for a compiler who asks about a few rays.
FEW_RAYS, FEW_PAIRS = 1000, 1 << 24
# Directions of other sizes are left to the exact engine.
MODERATE = (2.0**-100, 2.0**100)


class Hits:
    """What n rays meet first. Arrays are in the order of the rays.

    t          (n,) float64    where on the ray, in units of its direction; inf where nothing is met
    id         (n,) int32      number of the surface in the scene; -1 where nothing is met
    primitive  (n,) int32      number of the triangle within its mesh; -1 on spheres and where nothing is met
    point      (n, 3) float64  origin + t direction, in the world, scene units; nan where nothing is met
    normal     (n, 3) float64  unit vector in the world, for shading, facing where the ray comes from; 0 for nothing
    uv         (n, 2) float64  where the point is on a texture, not wrapped; 0 where nothing is met

    id, primitive, normal and uv are those of the picture's outputs, see cltrace.Image. t is correctly rounded: no
    double is nearer to where the ray meets the surface. The last three are computed when they are asked for, without
    rounding t first, and right to a few ulp of the surface's size.
    """

    def __init__(
        self, t: Floats, id: NDArray[np.int32], primitive: NDArray[np.int32], spots: Callable[[bool], Spots | FirstHits]
    ) -> None:
        """spots: makes points and normals, and uv where that is asked for."""
        self.t, self.id, self.primitive, self._spots = t, id, primitive, spots

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"<cltrace.Hits: {np.count_nonzero(self.id >= 0)} of {len(self)} rays>"

    @cached_property
    def _points(self) -> Spots | FirstHits:
        return self._spots(False)

    @property
    def point(self) -> Floats:
        return self._points.point

    @property
    def normal(self) -> Floats:
        return self._points.normal

    @cached_property
    def uv(self) -> Floats:
        return self._spots(True).uv


class Surfaces:
    """The surfaces of a scene: for the exact engine, and on a device once many rays ask for them."""

    def __init__(self, scene: Scene) -> None:
        self.kinds = kinds_of(scene)
        self._lock = threading.Lock()
        self._tracer: RayTracer | None = None
        self._asked = False
        self._item = np.empty(0, np.int64)

    def tracer(self, scene: Scene) -> RayTracer | None:
        """What traces rays on the device that pictures take; None without one that has doubles, and for surfaces of
        which bounds of errors might overflow or vanish."""
        with self._lock:
            if self._asked:
                return self._tracer
            try:
                device = choose()
            except DeviceError:  # there is none
                device = None
            tracer = RayTracer(scene, device) if device and device.has_double else None
            self._tracer, self._asked = tracer if tracer and tracer.moderate else None, True
            if self._tracer:
                keys = _keys(self.kinds.surface, self.kinds.primitive)
                order = keys.argsort()
                wanted = _keys(self._tracer.number, self._tracer.primitive)
                self._item = np.append(order[np.searchsorted(keys, wanted, sorter=order)], -1)
            return self._tracer

    def first_hits(self, scene: Scene, o: Floats, d: Floats, low: Floats, high: Floats) -> tuple[Ids, Floats]:
        """The surface that each ray meets first, as a row of `kinds`, -1 for none, and t, correctly rounded."""
        n, m = len(o), len(self.kinds.surface)
        if not n or not m:
            return np.full(n, -1), np.full(n, np.inf)
        tracer = self.tracer(scene) if n >= FEW_RAYS or n * m > FEW_PAIRS else None
        if tracer is None:
            return closest_item(self.kinds, o, d, low, high)
        size = np.maximum(np.maximum(np.abs(d[:, 0]), np.abs(d[:, 1])), np.abs(d[:, 2]))
        extreme = np.flatnonzero((size < MODERATE[0]) | (size > MODERATE[1]))
        w = d
        if len(extreme):
            w = d.copy()
            w[extreme] = 1.0
        with self._lock:
            found = tracer.trace(o, w, low, high)
        item, t, anything = self._item[found.index], found.t, np.union1d(found.anything, extreme)
        some = np.setdiff1d(found.undecided, anything)
        kept = np.isin(found.ray, some)
        pairs = np.searchsorted(some, found.ray[kept]), self._item[found.surface[kept]]
        for rows, which in ((some, pairs), (anything, None)):
            if len(rows):
                item[rows], t[rows] = closest_item(self.kinds, o[rows], d[rows], low[rows], high[rows], which)
        return item, t


def _keys(surface: NDArray[np.integer], primitive: NDArray[np.integer]) -> Ids:
    return (surface.astype(np.int64) << 32) + primitive


_known: weakref.WeakKeyDictionary[Scene, Surfaces] = weakref.WeakKeyDictionary()
_lock = threading.Lock()


def surfaces_of(scene: Scene) -> Surfaces:
    """The same for the same scene, as long as it lives."""
    with _lock:
        if scene not in _known:
            _known[scene] = Surfaces(scene)
        return _known[scene]


def trace_rays(
    scene: Scene, origins: ArrayLike, directions: ArrayLike, *, t_min: ArrayLike = 0.0, t_max: ArrayLike = np.inf
) -> Hits:
    """Find the first surface that each ray meets, from anywhere to anywhere; no light, no mirrors.

    All numbers are taken as exact, and every decision is that of exact arithmetic, as the tracer makes it: whether a
    ray meets a surface, and which one first. A ray that starts on a sphere does not meet it there, and one that starts
    in a triangle's plane never meets that. Touching counts. An edge belongs to one of its triangles; of equally near
    surfaces, the lowest number is met, and in a mesh the lowest triangle (docs/accuracy.md has both in full).

    A thousand rays and more are traced on the OpenCL device that pictures take, where doubles and pairs of doubles
    with bounds of their errors decide about almost all of them. The others are decided by whole numbers of any size, as
    are fewer rays, and all rays where there is no device that has doubles. The first call with many rays compiles the
    kernel and builds a tree of the surfaces, which are kept as long as the scene is.

    Rays of a scene that planes clip are left to the reference tracer, which takes milliseconds for each. A cap has the
    `primitive` -2 less the number of its plane.

    Parameters
    ----------
    scene : Scene
    origins, directions : array_like, shape (n, 3) or (3,)
        In scene units, in the world. A direction may have any length but 0; `t` is in multiples of its length.
    t_min, t_max : float or array_like, shape (n,)
        Only hits with ``t_min < t < t_max`` count.

    Returns
    -------
    Hits

    Raises
    ------
    TypeError
        If scene is not a Scene.
    ValueError
        If a number is not finite, a direction is 0, or the shapes do not fit. The message names the argument and the
        row.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene: must be a cltrace.Scene, such as cltrace.load() gives, got {described(scene)}")
    o, d, low, high = checked_rays(origins, directions, t_min, t_max)
    if len(scene.planes):
        met = first_hits(scene, o, d, low, high)
        return Hits(met.t, met.id, met.primitive, lambda with_uv: met)
    surfaces = surfaces_of(scene)
    item, t = surfaces.first_hits(scene, o, d, low, high)
    kinds = surfaces.kinds
    id_, primitive = (np.append(numbers, -1)[item].astype(np.int32) for numbers in (kinds.surface, kinds.primitive))

    def spots(with_uv: bool) -> Spots:
        return spots_of(kinds.kinds, kinds.first, scene.meshes, item, Rays.of(o, d, t), with_uv)

    return Hits(t, id_, primitive, spots)
