"""trace_rays: what any rays meet first of a scene, decided exactly, in numpy alone."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from cltrace.base.arithmetic import Floats
from cltrace.base.arrays import concurrently
from cltrace.exact.fine import Fine, select
from cltrace.rays.attributes import Attributes
from cltrace.rays.doubles import Met
from cltrace.rays.fine import compare
from cltrace.rays.lines import Bools, Ids, Lines
from cltrace.rays.surfaces import Surfaces, surfaces_of
from cltrace.rays.walk import candidates
from cltrace.scene import Scene
from cltrace.scene.rules import described, numbers

# So many rays are traced together. What they take, some kilobytes each, does not grow with their number.
RAYS_AT_ONCE = 1 << 16


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
    rounding t first, and right to a few ulp.
    """

    def __init__(self, t: Floats, index: Ids, attributes: Attributes) -> None:
        self.t, surfaces = t, attributes.surfaces
        self.id = np.append(surfaces.number, -1)[index].astype(np.int32)
        self.primitive = np.append(surfaces.primitive, -1)[index].astype(np.int32)
        self._attributes = attributes

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"<cltrace.Hits: {np.count_nonzero(self.id >= 0)} of {len(self)} rays>"

    @property
    def point(self) -> Floats:
        return self._attributes.point

    @property
    def normal(self) -> Floats:
        return self._attributes.normal

    @property
    def uv(self) -> Floats:
        return self._attributes.uv


def trace_rays(
    scene: Scene, origins: ArrayLike, directions: ArrayLike, *, t_min: ArrayLike = 0.0, t_max: ArrayLike = np.inf
) -> Hits:
    """What rays meet first of a scene's surfaces, from anywhere to anywhere; no light, no mirrors, no OpenCL.

    origins: (n, 3) or one point, scene units, in the world; directions: (n, 3) or one, of any length but 0, in the
    world; t_min, t_max: (n,) or one number, in units of the direction: what is met is strictly between them.

    All numbers are taken as exact, and every decision is that of exact arithmetic, as the tracer makes it: whether a
    ray meets a surface, and which one first. A ray that starts on a sphere does not meet it there, and one that starts
    in a triangle's plane never meets that. Touching counts. An edge belongs to one of its triangles; of equally near
    surfaces, the lowest number is met, and in a mesh the lowest triangle (docs/accuracy.md has both in full).

    Doubles with bounds of their errors decide about almost all rays, then pairs of doubles, then whole numbers of any
    size. A million rays against a million spheres, or triangles of a terrain, take 13 seconds of a processor, of which
    all are used, and 40 against a million triangles at random, which overlap; and 0.6 to 0.9 GB of memory, with the
    scene. The tree is built by a scene's first call, in a second or two, and kept as long as the scene is.

    Raises TypeError if scene is not a Scene, and ValueError, which names the argument and the index, where a number is
    not finite, a direction is 0, or the shapes do not fit.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene: must be a cltrace.Scene, such as cltrace.load() gives, got {described(scene)}")
    o, d, low, high = _checked(origins, directions, t_min, t_max)
    surfaces = surfaces_of(scene)
    parts = [slice(i, i + RAYS_AT_ONCE) for i in range(0, len(o), RAYS_AT_ONCE)]
    jobs = [partial(_trace, surfaces, o[part], d[part], low[part], high[part]) for part in parts]
    index, t, h, rest = (np.concatenate(x) for x in zip(_nothing(), *concurrently(jobs), strict=True))
    lines = partial(Lines.of, o, d, low, high, surfaces.middle, surfaces.size)
    return Hits(t, index, Attributes(surfaces, lines, index, (h, rest)))


def _nothing() -> tuple[Ids, Floats, Floats, Floats]:
    return np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0)


def _checked(
    origins: ArrayLike, directions: ArrayLike, t_min: ArrayLike, t_max: ArrayLike
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
    o, d = (np.broadcast_to(x, (n, 3)).copy() for x in points)
    low, high = (np.broadcast_to(x, (n,)).copy() for x in ends)
    return o, d, low, high


def _vectors(name: str, value: ArrayLike) -> Floats:
    array = numbers(name, value)
    if array.shape == (0,):
        array = array.reshape(0, 3)
    if array.ndim not in (1, 2) or array.shape[-1] != 3:
        raise ValueError(f"{name}: must have shape (n, 3) or (3,), got {array.shape}")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        where = "".join(f"[{i}]" for i in bad[0])
        raise ValueError(f"{name}{where}: must be a finite number, got {array[tuple(bad[0])]:g}")
    return array


# -------------------------------------------------------------------------------------------------------------- a block


def _trace(
    surfaces: Surfaces, origin: Floats, direction: Floats, t_min: Floats, t_max: Floats
) -> tuple[Ids, Floats, Floats, Floats]:
    """Of some rays: the primitive that each meets first, -1 for none; and what _distances() says of that."""
    lines = Lines.of(origin, direction, t_min, t_max, middle=surfaces.middle, size=surfaces.size)
    index, side = np.full(len(lines), -1), np.zeros(len(lines), np.int64)

    def settled(met: Met) -> Met:
        """Writes down what is decided of the rays, and returns what is left of the others."""
        count = np.bincount(met.ray, minlength=len(lines))
        sure = met.sure & (count[met.ray] == 1)
        index[met.ray[sure]], side[met.ray[sure]] = met.primitive[sure], met.side[sure]
        return met.at(~sure)

    left = settled(candidates(lines, surfaces, partial(surfaces.meet, lines)))
    left = settled(_by_pairs(lines, surfaces, left))
    if len(left.ray):
        ray, primitive, end = _by_whole_numbers(lines, surfaces, left)
        index[ray], side[ray] = primitive, end
    return index, *_distances(lines, surfaces, index, side)


def _by_pairs(lines: Lines, surfaces: Surfaces, met: Met) -> Met:
    """What pairs of doubles know of these. Of the rays for which they must not decide, what was known before."""
    far = np.full(len(lines), np.inf)
    parts = []
    for rows, found in surfaces.ends(lines, met.ray, met.primitive):
        some = met.at(rows)
        plain = lines.plain[some.ray]
        low, high = (np.ldexp(t[some.ray], lines.exponent[some.ray]) for t in (lines.t_min, lines.t_max))
        inside, outside = [], []
        for t in (found.near, found.far):
            above, below = compare(t, low), compare(t, high)
            inside.append((found.meets > 0) & (above > 0) & (below < 0))
            outside.append((found.meets < 0) | ((found.meets > 0) & ((above < 0) | (below > 0))))
        by_far = outside[0] & inside[1]
        sure = plain & (inside[0] | by_far)
        t = select(by_far, found.far, found.near)
        slack = np.abs(t.l) + 2 * t.error + 2.0**-50 * np.abs(t.h)
        least, most = np.where(sure, t.h - slack, -np.inf), np.where(sure, t.h + slack, np.inf)
        side = np.where(by_far, 1, -1)
        kept = ~(plain & outside[0] & outside[1])
        parts.append(Met(some.ray, some.primitive, sure=sure, side=side, low=least, high=most).at(kept))
    result = Met.all(parts)
    np.minimum.at(far, result.ray, result.high)
    return result.at(result.low <= far[result.ray])


def _by_whole_numbers(lines: Lines, surfaces: Surfaces, met: Met) -> tuple[Ids, Ids, Ids]:
    """The rays that meet any of these, the primitive that each meets first, and at which end."""
    met = met.at(np.lexsort((surfaces.rank[met.primitive], met.ray)))
    roots, _ = surfaces.roots(lines, met.ray, met.primitive)
    there = np.flatnonzero(roots.exists)
    met, roots = met.at(there), roots.at(there)
    first = np.flatnonzero(np.diff(met.ray, prepend=-1))
    count, best = np.diff(np.append(first, len(met.ray))), first.copy()
    for turn in range(1, int(count.max(initial=0))):
        group = np.flatnonzero(count > turn)
        other = first[group] + turn
        best[group] = np.where(roots.at(other).before(roots.at(best[group])), other, best[group])
    return met.ray[best], met.primitive[best], roots.side[best]


def _distances(lines: Lines, surfaces: Surfaces, index: Ids, side: Ids) -> tuple[Floats, Floats, Floats]:
    """Where rays meet these primitives, (n,) each: t, correctly rounded, and T as pairs, inf for none."""
    h, low, sure = np.full(len(index), np.inf), np.zeros(len(index)), index < 0
    for rows, found in surfaces.ends(lines, np.arange(len(index)), index):
        h[rows], low[rows], sure[rows] = _rounded(select(side[rows] > 0, found.far, found.near))
    with np.errstate(over="ignore"):
        t = np.ldexp(h, -lines.exponent)
    # Below the normal doubles this has rounded once more.
    sure &= (lines.plain & (np.abs(t) > 2.0**-1000)) | (index < 0)
    rows = np.flatnonzero(~sure)
    if len(rows):
        roots, shift = surfaces.roots(lines, rows, index[rows])
        for i, row in enumerate(rows.tolist()):
            h[row], low[row] = roots.pair(i, shift + int(lines.exponent[row]))
            t[row], _ = roots.pair(i, shift)
    return t, h, low


def _rounded(t: Fine) -> tuple[Floats, Floats, Bools]:
    """Pairs, and where the first part is all of it, correctly rounded. Half of the error is for the sum's rounding."""
    with np.errstate(all="ignore"):
        loose = 4 * t.error + 2.0**-900
        return t.h, t.l, (t.h + (t.l - loose) == t.h) & (t.h + (t.l + loose) == t.h)
