"""The exact oracle for spheres and ellipsoids: which one a ray hits, where, and whether a point sees a light.

Every float64 is an integer times a power of two, so a scene is a set of integers. The ray is p = o + t d; with

    f = C - o,  a = d.d,  b = f.d,  c = f.f - r^2,  D = b^2 - a c,

the sphere's roots are t = (b -/+ sqrt(D)) / a, and a hit is the smallest root t > 0. An ellipsoid |K (p - C)| = r is a
sphere in its own axes, with K f and K d for f and d. All questions are then signs of integers, or of p + q sqrt(D) with
integers p and q, which squaring decides:

    c > 0 (origin outside):  a hit iff b > 0 and D >= 0, at (b - sqrt(D)) / a = c / (b + sqrt(D))
    c < 0 (inside):          a hit,                      at (b + sqrt(D)) / a
    c = 0 (on the surface):  a hit iff b > 0,            at (b + sqrt(D)) / a = 2 b / a    (the root 0 is not a hit)

A ray that starts on a sphere starts at P = A + R n / |n|: A, R and n are given numbers, |n| = sqrt(s) with s = n.n.
With all lengths times s, C - P is s (C - A) - R n sqrt(s): a vector p + q sqrt(s) of integers. So a, b, c and D are
such numbers, too, and c is 0 where it must be: there is no rule for the sphere that is left.

Touching counts (D = 0), equal roots go to the lowest index, and a zero direction hits nothing.

Spheres are given by centers (m, 3) and radii (m,) or one number for all, > 0; all numbers are finite. Every public
function raises ValueError, which names the argument, where one is not of its shape or a value is not allowed.

In front of the integers is a filter: double-double arithmetic in numpy, which keeps count of its errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import atan2, isqrt, sqrt
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Floats, adjugate, dot, minus, product, two_sum
from cltrace.exact.fine import Fine, FineVector, fine_vector, select
from cltrace.exact.surds import Surds
from cltrace.exact.whole import Whole, grid_of, over_power, whole
from cltrace.oracle.rays import (
    ExactRays,
    Ids,
    Points,
    Rays,
    Rough,
    SurdVector,
    along,
    along_numbers,
    at_point,
    columns,
    moderate,
    ones,
    rounded,
    to_light,
    turned,
)
from cltrace.oracle.search import Bools, Hits, Kind, Kinds, Roots, on_hits
from cltrace.scene import Scene
from cltrace.scene.rules import is_whole, numbers

Maps = Sequence[ArrayLike | None]
Inverse = tuple[Sequence[Sequence[int]], int]  # a matrix of whole numbers, and what it is to be divided by, > 0

# Up to what the filter takes numbers, see moderate(). The largest and the smallest of its numbers, D of an ellipsoid,
# has 8 such factors, two of which may be differences, 2^-52 of that. So nothing leaves the range of double, nor does
# EPS times a number.
MOST = 2.0**100


# ------------------------------------------------------------------------------------------------- what is handed over


def array_of(name: str, value: ArrayLike, *shape: int) -> Floats:
    """`value` as finite doubles of this shape, where -1 is any length; [] is none of them."""
    array = numbers(name, value)
    if array.shape == (0,) and shape[:1] == (-1,):
        array = array.reshape(0, *shape[1:])
    if len(array.shape) != len(shape) or any(n not in (-1, got) for n, got in zip(shape, array.shape, strict=True)):
        wanted = str(tuple("n" if n < 0 else n for n in shape)).replace("'", "") if shape else "() (one number)"
        raise ValueError(f"{name}: must have shape {wanted}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: must be finite")
    return array


def _balls(centers: ArrayLike, radii: ArrayLike) -> tuple[Floats, Floats]:
    """(m, 3) and (m,)."""
    places = array_of("centers", centers, -1, 3)
    sizes = numbers("radii", radii)
    sizes = array_of("radii", np.full(len(places), sizes) if sizes.ndim == 0 else sizes, -1)
    if len(sizes) != len(places):
        raise ValueError(f"radii: must be one number or as many as centers, {len(places)}, got {len(sizes)}")
    if not (sizes > 0).all():
        raise ValueError(f"radii: must be > 0, got {sizes[~(sizes > 0)][0]:g}")
    return places, sizes


def _ball(center: ArrayLike, radius: float, names: tuple[str, str] = ("center", "radius")) -> tuple[Floats, float]:
    size = float(array_of(names[1], radius))
    if size <= 0:
        raise ValueError(f"{names[1]}: must be > 0, got {size:g}")
    return array_of(names[0], center, 3), size


def _exact(name: str, values: Sequence[float | Fraction]) -> list[float | Fraction]:
    """Three numbers, each finite; a Fraction must be one that has a double's kind of denominator, a power of two."""
    rows = list(values) if np.ndim(np.asarray(values, object)) == 1 else []
    if len(rows) != 3:
        raise ValueError(f"{name}: must be 3 numbers, got {values!r}")
    if not any(isinstance(v, Fraction) for v in rows):
        given: Any = rows
        return list(array_of(name, given, 3).tolist())
    out = [v if isinstance(v, Fraction) else float(array_of(name, v)) for v in rows]
    if any(isinstance(v, Fraction) and v.denominator & (v.denominator - 1) for v in out):
        raise ValueError(f"{name}: the denominator of a Fraction must be a power of two, got {values!r}")
    return out


def _light(light: ArrayLike, kind: str) -> Floats:
    if kind not in ("point", "parallel"):
        raise ValueError(f"kind: must be 'point' or 'parallel', got {kind!r}")
    array = array_of("light", light, 3)
    if kind == "parallel" and not array.any():
        raise ValueError("light: the direction of parallel light must not be 0")
    return array


# ---------------------------------------------------------------------------------------------------------- the kind


@dataclass(frozen=True, eq=False)
class Spheres(Kind):
    """Spheres, or ellipsoids |K (p - C)| = r where to_object, K (3, 3), is not None."""

    centers: Floats
    radii: Floats
    to_object: Maps
    surface: Ids

    @classmethod
    def of(cls, scene: Scene) -> Spheres:
        """All of a scene."""
        maps = [None if i < 0 else scene.to_object[i] for i in scene.spheres["to_object"]]
        return cls(scene.spheres["center"], scene.spheres["radius"], maps, scene.sphere_numbers.astype(np.int64))

    @cached_property
    def grid(self) -> int:  # type: ignore[override]
        return grid_of(self.centers, self.radii)

    @cached_property
    def bent(self) -> Bools:
        return np.array([K is not None for K in self.to_object], bool)

    @cached_property
    def maps(self) -> Floats:
        """(m, 3, 3): K, 1 of spheres."""
        maps = np.tile(np.eye(3), (len(self.radii), 1, 1))
        for i in np.flatnonzero(self.bent).tolist():
            maps[i] = self.to_object[i]
        return maps

    @cached_property
    def inverses(self) -> list[Inverse | None]:
        """K^-1 of each ellipsoid."""
        return [_whole_inverse(K) if bent else None for K, bent in zip(self.maps, self.bent, strict=True)]

    def rounded_inverses(self, item: Ids) -> tuple[FineVector, FineVector, FineVector]:
        """The rows of K^-1 of ellipsoids."""
        used, place = np.unique(item, return_inverse=True)
        parts = []
        for inverse in (self.inverses[i] for i in used):
            assert inverse is not None
            parts += [Fine.rounded(Fraction(x, inverse[1])) for row in inverse[0] for x in row]
        table = np.array([(x.h, x.l, x.error) for x in parts], float).reshape(-1, 9, 3)[place]
        rows = [Fine(*(column.copy() for column in table[:, k].T)) for k in range(9)]
        return (rows[0], rows[1], rows[2]), (rows[3], rows[4], rows[5]), (rows[6], rows[7], rows[8])

    @cached_property
    def _same(self) -> Ids:
        """(m,): the first of all surfaces that are equal to each, which hides the others."""
        keys = [self.centers, self.radii[:, None], *((self.maps.reshape(-1, 9),) if self.bent.any() else ())]
        _, first, which = np.unique(np.concatenate(keys, axis=1), axis=0, return_index=True, return_inverse=True)
        return first[which.ravel()]

    @cached_property
    def _outer(self) -> Floats:
        """(m,): bounds of how far the surfaces are from their centres."""
        sizes = np.ones(len(self.radii))
        for i in np.flatnonzero(self.bent).tolist():
            rows, divisor = _whole_inverse(self.maps[i])
            sizes[i] = float(sum(Fraction(abs(x), divisor) for row in rows for x in row))
        return np.asarray(self.radii * sizes * (1 + 2.0**-40))

    @property
    def extent(self) -> float:
        return float(np.abs(self.centers).max(initial=0) + self._outer.max(initial=0))

    @cached_property
    def moderate(self) -> Bools:
        """(m,): which ones' numbers are within the range of the filter."""
        numbers = np.concatenate([self.centers, self.radii[:, None], self.maps.reshape(-1, 9)], axis=1)
        return moderate(numbers, MOST)

    def near(self, rays: Rays) -> tuple[Ids, Ids]:
        """With f from the start to a centre, R its reach and u = 2^-53, a ray along w passes by where |f x w| > R |w|,
        and leads away where f.w < -R |w|. f = (C - anchor) - step is off by 2^-49 reach and 3 u (|f|_1 + reach), and w
        by 2^-50 of its length. So f x w and f.w are off by less than 2^-47 s length for s = |f|_1 + reach, and |w| by
        2^-50 length. Twice that covers the roundings beside these.
        """
        assert rays.rough is not None
        rough, first = rays.rough, np.flatnonzero(self._same == np.arange(len(self.radii)))
        w, length = rounded(rough.way).T[:, :, None], rough.length[:, None]
        x, y, z = ((self.centers[first, i] - rough.anchor[:, i, None]) - rough.step[i].h[:, None] for i in range(3))
        u, v, s = y * w[2] - z * w[1], z * w[0] - x * w[2], x * w[1] - y * w[0]
        size = (np.abs(x) + np.abs(y) + np.abs(z)) + rough.reach[:, None]
        room = self._outer[first] * (np.sqrt(dot(w, w)) + 2.0**-49 * length) + 2.0**-46 * size * length
        beside = (u * u + v * v + s * s > room * room) | (x * w[0] + y * w[1] + z * w[2] < -room)
        ray, item = np.nonzero(~(beside & rough.fits(MOST)[:, None] & self.moderate[first]))
        return ray, first[item]

    def hits(self, rays: Rays, ray: Ids, item: Ids) -> Hits:
        """By the equation, whose numbers count their errors."""
        assert rays.rough is not None
        # A ray to a light at a point starts at the light.
        left = (rays.left(Spheres) if np.all(rays.t_max == np.inf) else np.full(len(rays), -1))[ray]
        own = (left >= 0) & (np.append(self._same, -1)[left] == item)
        f, w = self._seen(rays.rough.at(ray), item)
        r, zero = Fine.of(self.radii[item]), Fine.of(np.zeros(len(ray)))
        a, b, c = dot(w, w), dot(f, w), select(own, zero, dot(f, f) - r * r)
        D = b * b - a * c
        outside, ahead, meets = np.where(own, -1, c.sign()), b.sign(), D.sign()
        sure = (meets > 0) & np.where(outside > 0, ahead > 0, (outside < 0) & (~own | (ahead > 0)))
        miss = np.where(own, ahead < 0, (meets < 0) | ((outside > 0) & (ahead < 0)))
        fit = rays.rough.fits(MOST)[ray] & self.moderate[item]
        direct, root = (outside < 0) & (b.h >= 0), Fine(np.maximum(D.h, 0), D.l, D.error).root()
        n = select(b.h < 0, -b, b) + root
        t = select(direct, n, select(outside < 0, -c, c)) / select(direct, a, n)
        sure, gone = sure & fit, miss & fit
        t = Fine(t.h, t.l, np.where(sure & (t.error < 2.0**-41 * t.h), t.error, np.inf))
        kept = np.flatnonzero(~gone)
        return Hits(ray[kept], item[kept], sure[kept], t[kept])

    def _seen(self, rough: Rough, item: Ids) -> tuple[FineVector, FineVector]:
        """From the start to the centre, and the way; both in an ellipsoid's own axes."""
        zero = np.zeros(len(item))
        x, y, z = (Fine(*two_sum(self.centers[item, i], -rough.anchor[:, i]), zero) for i in range(3))
        f, w, bent = minus((x, y, z), rough.step), rough.way, np.flatnonzero(self.bent[item])
        if not len(bent):
            return f, w
        rows = [fine_vector(self.maps[item[bent], i]) for i in range(3)]
        for v in (f, w):
            put(v, bent, product(rows, at_rows(v, bent)))
        return f, w

    def roots(self, exact: ExactRays, item: Ids, t_min: float | Floats, t_max: float | Floats) -> Roots:
        f, d, r = self.from_start(exact, item)
        a, b, c = dot(d, d), dot(f, d), dot(f, f) - Surds(r * r)
        D, one, zero = b * b - a * c, np.ones(len(item), np.int64), Surds(np.full(len(item), 0, object))
        there = (D.signs() >= 0) & (a.signs() > 0)
        near = Roots(
            there,
            a,
            b,
            -one,
            D=D * there.astype(object),
            normal=(zero, zero, zero),
            unit=exact.unit,
            surface=self.surface[item],
        )
        first, second = (replace(near, side=side).within(t_min, t_max) for side in (-one, one))
        return replace(near, exists=there & (first | second), side=np.where(first, -1, 1))

    def from_start(self, exact: ExactRays, item: Ids) -> tuple[SurdVector, SurdVector, Whole]:
        """f, d and r in whole numbers; of an ellipsoid in its own axes."""
        f = minus(columns(whole(self.centers[item], exact.grid) * exact.scale[:, None]), exact.start)
        r = whole(self.radii[item], exact.grid) * exact.scale
        if not self.bent[item].any():
            return f, exact.way, r
        k = grid_of(self.maps)
        K = np.moveaxis(whole(self.maps[item], k), 0, -1)

        def own(v: SurdVector) -> SurdVector:
            x, y, z = (v[0] * row[0] + v[1] * row[1] + v[2] * row[2] for row in K)
            return x, y, z

        return own(f), own(exact.way), r << k


def at_rows(v: FineVector, rows: Ids) -> FineVector:
    return v[0][rows], v[1][rows], v[2][rows]


def put(v: FineVector, rows: Ids, values: FineVector) -> None:
    """Puts other numbers into these rows."""
    for x, y in zip(v, values, strict=True):
        x.h[rows], x.l[rows], x.error[rows] = y.h, y.l, y.error


def _whole_inverse(K: Floats) -> Inverse:
    """K^-1; of a singular matrix, the divisor is 0."""
    k = grid_of(K)
    rows, determinant = adjugate(whole(K, k).tolist())
    sign = -1 if determinant < 0 else 1
    return [[sign * x << k for x in row] for row in rows], abs(determinant)


def _from_center(q: Sequence[int], inverse: Inverse | None) -> tuple[int, Sequence[int], int]:
    """scale, n and s: to the point of the normal q on a sphere, or an ellipsoid, of the radius 1 is n sqrt(s) / scale,
    with s = |q|^2."""
    s = dot(q, q)
    if inverse is None:
        return s, q, s
    return s * inverse[1], product(inverse[0], q), s


def on_spheres(spheres: Spheres, own: Ids, normal: Floats, basis: ArrayLike) -> Points:
    """Points of the spheres `own`, (n,). normal: (n, 3), of any length but 0, of a sphere in camera space, and of an
    ellipsoid in its own axes; basis: (3, 3), the camera's axes in the world."""
    fine, axes_grid, bent = grid_of(normal), grid_of(basis), np.flatnonzero(spheres.bent[own])

    def exact(rows: Ids, grid: int) -> tuple[Whole, SurdVector]:
        q = whole(normal[rows], fine)
        world = q @ whole(basis, axes_grid)
        inverses = [spheres.inverses[i] for i in own[rows]]
        steps = [_from_center(w if L is None else v, L) for v, w, L in zip(q, world, inverses, strict=True)]
        scale, s = (np.array([step[i] for step in steps], object) for i in (0, 2))
        n = np.array([list(step[1]) for step in steps], object).reshape(-1, 3)
        center, radius = whole(spheres.centers[own[rows]], grid), whole(spheres.radii[own[rows]], grid)
        x, y, z = (Surds(center[:, i] * scale, radius * n[:, i], s) for i in range(3))
        return scale, (x, y, z)

    n = turned(normal, basis)
    with np.errstate(all="ignore"):  # what is not finite is not sure
        q = fine_vector(normal)
        factor = Fine.of(spheres.radii[own]) / select(spheres.bent[own], dot(q, q), dot(n, n)).root()
        if len(bent):
            put(n, bent, product(spheres.rounded_inverses(own[bent]), at_rows(q, bent)))
        factor.error[~(moderate(normal, MOST) & spheres.moderate[own])] = np.inf
        x, y, z = (part * factor for part in n)
    return Points((spheres.centers[own], (x, y, z)), spheres.grid, exact, own, Spheres)


# ------------------------------------------------------------------------------------------------------ rays and lights


class OnSphere(NamedTuple):
    """The point center + radius normal / |normal|; the normal may have any length but 0.

    to_object: of an ellipsoid, see `closest_from`; then the point is center + radius K^-1 normal / |normal|.
    """

    center: ArrayLike
    radius: float
    normal: Sequence[float | Fraction]
    to_object: ArrayLike | None = None


def _map(name: str, to_object: ArrayLike | None) -> Floats | None:
    if to_object is None:
        return None
    made = array_of(name, to_object, 3, 3)
    if not _whole_inverse(made)[1]:
        raise ValueError(f"{name}: must not be singular")
    return made


def _spheres(centers: ArrayLike, radii: ArrayLike, to_object: Maps | None = None) -> Spheres:
    places, sizes = _balls(centers, radii)
    if to_object is None:
        to_object = [None] * len(places)
    if len(to_object) != len(places):
        raise ValueError(f"to_object: must be as many as centers, {len(places)}, got {len(to_object)}")
    maps = [_map(f"to_object[{i}]", K) for i, K in enumerate(to_object)]
    return Spheres(places, sizes, maps, np.arange(len(places)))


def _start(start: ArrayLike | Sequence[Fraction] | OnSphere, count: int) -> Points:
    """Where so many rays start, in whole numbers only."""
    if isinstance(start, OnSphere):
        center, radius = _ball(start.center, start.radius, ("start.center", "start.radius"))
        n, _ = over_power(_exact("start.normal", start.normal))
        if not any(n):
            raise ValueError("start.normal: must not be 0")
        to_object = _map("start.to_object", start.to_object)
        scale, step, s = _from_center(n, None if to_object is None else _whole_inverse(to_object))
        place, k = over_power([*center.tolist(), radius])
    else:
        place, k = over_power([*_exact("start", np.asarray(start, object).tolist()), 0.0])
        scale, step, s = 1, (0, 0, 0), 0

    def exact(rows: Ids, grid: int) -> tuple[Whole, SurdVector]:
        one, (*center, radius) = ones(len(rows)), (c << (grid - k) for c in place)
        parts = ((one * (c * scale), one * (radius * n)) for c, n in zip(center, step, strict=True))
        x, y, z = (Surds(p, q, one * s) if s else Surds(p) for p, q in parts)
        return one * scale, (x, y, z)

    return Points(None, k, exact, np.full(count, -1))


def _from_eye(origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike) -> tuple[Rays, Spheres]:
    """Rays from one point."""
    place, d = array_of("origin", origin, 3), array_of("direction", direction, -1, 3)
    return along(at_point(place, len(d)), d, np.eye(3)), _spheres(centers, radii)


def closest(
    origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[NDArray[np.int32], Floats]:
    """The nearest hit of every ray: sphere (n,) int32, -1 if none; t (n,), correctly rounded, inf if none.

    origin (3,), direction (n, 3), centers (m, 3), radii (m,) or one number > 0 for all: finite float64, taken as exact
    numbers. t is in units of the ray's direction, which may have any length; a direction of 0 hits nothing. Raises
    ValueError, which names the argument, where one is not of its shape or a value is not allowed.
    """
    rays, spheres = _from_eye(origin, direction, centers, radii)
    found = Kinds([spheres]).closest(rays)
    return found.item.astype(np.int32), found.rounded()


def closest_from(
    start: ArrayLike | Sequence[Fraction] | OnSphere,
    direction: Sequence[Sequence[float | Fraction]],
    centers: ArrayLike,
    radii: ArrayLike,
    t_min: float = 0.0,
    t_max: float = np.inf,
    to_object: Maps | None = None,
) -> tuple[NDArray[np.int32], Floats]:
    """What `closest` returns, for rays that start anywhere, by integers alone: the first t strictly within the range.

    to_object: for each sphere a matrix K (3, 3), which makes it the ellipsoid |K (p - C)| = r, or None.

    start: (3,), of which each may be a Fraction, or OnSphere; direction: rows of 3 numbers; t_min, t_max: the range,
    inf and -inf are no bounds.
    """
    if not (t_min < np.inf and t_max > -np.inf):  # nor NaN
        raise ValueError(f"t_min, t_max: must be numbers, t_min < inf and t_max > -inf, got {t_min!r}, {t_max!r}")
    shape = np.asarray(direction, object).shape  # of objects: a Fraction stays what it is
    if shape[1:] != (3,) and shape != (0,):
        raise ValueError(f"direction: must have shape (n, 3), got {shape}")
    spheres, points = _spheres(centers, radii, to_object), _start(start, len(direction))
    rays = along_numbers(points, [_exact("direction", row) for row in direction])
    found = Kinds([spheres]).closest(replace(rays, t_min=t_min, t_max=t_max))
    return found.item.astype(np.int32), found.rounded()


def blocked(
    start: OnSphere,
    light: ArrayLike,
    kind: Literal["point", "parallel"],
    centers: ArrayLike,
    radii: ArrayLike,
    to_object: Maps | None = None,
) -> bool:
    """Whether a sphere or an ellipsoid is met strictly between a point of one and a light.

    light: a position ("point") or the direction in which the light travels ("parallel"). From inside, the sphere that
    the ray starts on blocks as any other: if and only if the light is strictly outside.
    """
    rays = to_light(_start(start, 1), _light(light, kind), kind == "parallel")
    return bool(Kinds([_spheres(centers, radii, to_object)]).blocked(rays)[0])


def lit(
    origin: ArrayLike,
    direction: ArrayLike,
    hit_index: ArrayLike,
    centers: ArrayLike,
    radii: ArrayLike,
    light: ArrayLike,
    kind: Literal["point", "parallel"],
) -> tuple[Bools, Bools]:
    """(lit, facing), (n,) each, of the points P where rays meet the spheres hit_index, (n,); ValueError if not.

    light, kind: as of blocked(). facing: n.l > 0, where n is the normal that faces the side from which the ray came,
    and l leads from P to the light. lit: facing, and nothing blocks.
    """
    where = _light(light, kind)
    rays, spheres = _from_eye(origin, direction, centers, radii)
    own, m = np.broadcast_to(hit_index, len(rays)), len(spheres.radii)
    if own.dtype.kind != "i" or not ((own >= 0) & (own < m)).all():
        raise ValueError(f"hit_index: must be the index of one of the {m} spheres, got {hit_index!r}")
    side = _hit(rays, spheres, own)[1].side
    shadow = to_light(on_hits(rays, spheres, own), where, kind == "parallel")
    exact = shadow.exact(np.arange(len(own)), max(shadow.grid, spheres.grid))
    f, w, _ = spheres.from_start(exact, own)
    # From a light at a point they lead to P, so (C - P).(L - P) is w.w - f.w.
    inwards = dot(f, w) if kind == "parallel" else dot(w, w) - dot(f, w)
    facing = side * inwards.signs() > 0
    return facing & ~Kinds([spheres]).blocked(shadow), facing


def _hit(rays: Rays, spheres: Spheres, own: Ids) -> tuple[ExactRays, Roots]:
    """The rays and where they meet these spheres, in whole numbers; ValueError if one does not."""
    exact = rays.exact(np.arange(len(own)), max(rays.grid, spheres.grid))
    roots = spheres.roots(exact, own, 0.0, np.inf)
    if not roots.exists.all():
        raise ValueError("the ray does not hit the sphere")
    return exact, roots


def t_high(origin: ArrayLike, direction_row: ArrayLike, center: ArrayLike, radius: float, bits: int = 160) -> Fraction:
    """The hit's t with a relative error below 2^-bits, bits >= 1; ValueError if there is no hit."""
    if not is_whole(bits) or bits < 1:
        raise ValueError(f"bits: must be a whole number >= 1, got {bits!r}")
    _, (_, roots), more = *_one(origin, direction_row, center, radius), 128
    while (t := roots.between(0, more)) is None or (t.high - t.low) * 2**bits > t.low:
        more *= 2
    return t.low


def _one(
    origin: ArrayLike, direction_row: ArrayLike, center: ArrayLike, radius: float
) -> tuple[Spheres, tuple[ExactRays, Roots]]:
    """One ray and one sphere that it hits."""
    place, size = _ball(center, radius)
    row = array_of("direction_row", direction_row, 3)
    rays, spheres = _from_eye(origin, row[None], place[None], size)
    return spheres, _hit(rays, spheres, np.zeros(1, np.int64))


def normal_high(
    origin: ArrayLike, direction_row: ArrayLike, center: ArrayLike, radius: float
) -> tuple[Fraction, Fraction, Fraction]:
    """The outward unit normal (p - C) / r at the hit, each component to within 1e-50; ValueError if there is no hit.

    a (p - C) = a (t d - f) = (b d - a f) + s d sqrt(D), to be divided by a r. sqrt(D) is cut k bits behind the point,
    an error of |d| 2^-k / (a r) <= 2^-k.
    """
    spheres, (exact, roots) = _one(origin, direction_row, center, radius)
    f, w, r = spheres.from_start(exact, np.zeros(1, np.int64))
    a, b, D, s, k = roots.a.p[0], roots.b.p[0], roots.D.p[0], int(roots.side[0]), 180
    rest = isqrt(D << 2 * k)
    x, y, z = (
        Fraction(((b * d.p[0] - a * g.p[0]) << k) + s * d.p[0] * rest, a * r[0] << k) for d, g in zip(w, f, strict=True)
    )
    return x, y, z


def normal_error(normal: ArrayLike, exact: Sequence[Fraction]) -> float:
    """The angle between a normal of any length but 0 and one of normal_high(), radians."""
    n = [Fraction(x) for x in array_of("normal", normal, 3).tolist()]
    if not any(n):
        raise ValueError("normal: must not be 0")
    if len(exact) != 3:
        raise ValueError(f"exact: must be 3 numbers, got {exact!r}")
    cross = [n[i - 2] * exact[i - 1] - n[i - 1] * exact[i - 2] for i in range(3)]
    dot = sum((x * y for x, y in zip(n, exact, strict=True)), Fraction(0))
    return atan2(sqrt(sum(x * x for x in cross)), dot)


def to_world(basis: Sequence[Sequence[float]], v: Sequence[float]) -> tuple[Fraction, Fraction, Fraction]:
    """The vector v of camera space along the world's axes, exactly: v.x right + v.y up + v.z back."""
    if len(basis) != 3:
        raise ValueError(f"basis: must be 3 vectors, got {basis!r}")
    axes, parts = [[Fraction(x) for x in _exact("basis", a)] for a in basis], [Fraction(x) for x in _exact("v", v)]
    x, y, z = (sum((e * a[i] for e, a in zip(parts, axes, strict=True)), Fraction(0)) for i in range(3))
    return x, y, z
