"""Spheres and ellipsoids as the oracle has them: what pairs of doubles know of rays and spheres.

In front of the exact engine is a filter: double-double arithmetic in numpy, which keeps count of its errors. With

    f = C - o,  a = d.d,  b = f.d,  c = f.f - r^2,  D = b^2 - a c

a ray o + t d meets a sphere at t = (b -/+ sqrt(D)) / a, and the first t > 0 is

    c > 0 (origin outside):  a hit iff b > 0 and D >= 0, at (b - sqrt(D)) / a = c / (b + sqrt(D))
    c < 0 (inside):          a hit,                      at (b + sqrt(D)) / a
    c = 0 (on the surface):  a hit iff b > 0,            at (b + sqrt(D)) / a = 2 b / a    (the root 0 is not a hit)

An ellipsoid |K (p - C)| = r is a sphere in its own axes, with K f and K d for f and d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Floats, dot, minus, product, two_sum
from cltrace.exact.fine import Fine, FineVector, fine_vector, select
from cltrace.exact.lines import ExactPoint, Frame
from cltrace.exact.shapes import ExactSphere
from cltrace.oracle.rays import Ids, Points, Rays, Rough, along, at_point, moderate, turned
from cltrace.oracle.search import Bools, Hits, Kind, Kinds, near_balls
from cltrace.scene import Scene
from cltrace.scene.rules import numbers

Maps = Sequence[ArrayLike | None]

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
    def bent(self) -> Bools:
        return np.array([K is not None for K in self.to_object], bool)

    @cached_property
    def maps(self) -> Floats:
        """(m, 3, 3): K, 1 of spheres."""
        maps = np.tile(np.eye(3), (len(self.radii), 1, 1))
        for i in np.flatnonzero(self.bent).tolist():
            maps[i] = self.to_object[i]
        return maps

    def rounded_inverses(self, item: Ids) -> tuple[FineVector, FineVector, FineVector]:
        """The rows of K^-1 of ellipsoids."""
        used, place = np.unique(item, return_inverse=True)
        parts = []
        for inverse, divisor in (self.solid(i).inverse for i in used.tolist()):
            parts += [Fine.rounded(Fraction(x, divisor)) for row in inverse for x in row]
        table = np.array([(x.h, x.l, x.error) for x in parts], float).reshape(-1, 9, 3)[place]
        rows = [Fine(*(column.copy() for column in table[:, k].T)) for k in range(9)]
        return (rows[0], rows[1], rows[2]), (rows[3], rows[4], rows[5]), (rows[6], rows[7], rows[8])

    @cached_property
    def _same(self) -> Ids:
        """(m,): the first of all surfaces that are equal to each, which hides the others."""
        _, which, count = np.unique(self.centers[:, 0], return_inverse=True, return_counts=True)
        same, rows = np.arange(len(which)), np.flatnonzero(count[which] > 1)  # mostly few, as sorting rows takes long
        _, first, which = np.unique(self._numbers[rows], axis=0, return_index=True, return_inverse=True)
        same[rows] = rows[first[which.ravel()]]
        return same

    @cached_property
    def _numbers(self) -> Floats:
        """(m, 4), or (m, 13) where there are ellipsoids."""
        maps = [self.maps.reshape(-1, 9)] if self.bent.any() else []
        return np.concatenate([self.centers, self.radii[:, None], *maps], axis=1)

    @cached_property
    def _outer(self) -> Floats:
        """(m,): bounds of how far the surfaces are from their centres."""
        sizes = np.ones(len(self.radii))
        for i in np.flatnonzero(self.bent).tolist():
            rows, divisor = self.solid(i).inverse
            sizes[i] = float(sum(Fraction(abs(x), divisor) for row in rows for x in row))
        return np.asarray(self.radii * sizes * (1 + 2.0**-40))

    @property
    def extent(self) -> float:
        return float(np.abs(self.centers).max(initial=0) + self._outer.max(initial=0))

    @cached_property
    def moderate(self) -> Bools:
        """(m,): which ones' numbers are within the range of the filter."""
        return moderate(self._numbers, MOST)

    def near(self, rays: Rays) -> tuple[Ids, Ids]:
        first = np.flatnonzero(self._same == np.arange(len(self.radii)))
        ray, item = near_balls(rays, self.centers[first], self._outer[first], self.moderate[first], MOST)
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

    def solid(self, item: int) -> ExactSphere:
        K = self.to_object[item]
        return ExactSphere(
            self.centers[item].tolist(), float(self.radii[item]), None if K is None else np.asarray(K, float).tolist()
        )


def at_rows(v: FineVector, rows: Ids) -> FineVector:
    return v[0][rows], v[1][rows], v[2][rows]


def put(v: FineVector, rows: Ids, values: FineVector) -> None:
    """Puts other numbers into these rows."""
    for x, y in zip(v, values, strict=True):
        x.h[rows], x.l[rows], x.error[rows] = y.h, y.l, y.error


def on_spheres(spheres: Spheres, own: Ids, normal: Floats, basis: ArrayLike) -> Points:
    """Points of the spheres `own`, (n,). normal: (n, 3), of any length but 0, of a sphere in camera space, and of an
    ellipsoid in its own axes; basis: (3, 3), the camera's axes in the world."""
    bent, frame = np.flatnonzero(spheres.bent[own]), Frame(tuple(map(tuple, np.asarray(basis, float).tolist())))

    def place(i: int) -> ExactPoint:
        q = normal[i].tolist()
        return spheres.solid(int(own[i])).point(q if spheres.bent[own[i]] else frame.to_world(q).fractions())

    n = turned(normal, basis)
    with np.errstate(all="ignore"):  # what is not finite is not sure
        q = fine_vector(normal)
        factor = Fine.of(spheres.radii[own]) / select(spheres.bent[own], dot(q, q), dot(n, n)).root()
        if len(bent):
            put(n, bent, product(spheres.rounded_inverses(own[bent]), at_rows(q, bent)))
        factor.error[~(moderate(normal, MOST) & spheres.moderate[own])] = np.inf
        x, y, z = (part * factor for part in n)
    return Points((spheres.centers[own], (x, y, z)), place, own, Spheres)


def closest(
    origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[NDArray[np.int32], Floats]:
    """The nearest hit of every ray among spheres.

    Parameters
    ----------
    origin : array_like, shape (3,)
    direction : array_like, shape (n, 3)
        Directions may have any length; one of 0 hits nothing.
    centers : array_like, shape (m, 3)
    radii : array_like, shape (m,), or one number for all
        Greater than 0. All numbers are finite, and taken as exact.

    Returns
    -------
    sphere : ndarray of int32, shape (n,)
        The sphere that is met first, -1 for none. Touching counts, and equal distances go to the lowest index.
    t : ndarray of float64, shape (n,)
        Correctly rounded, in units of the direction; inf for none.

    Raises
    ------
    ValueError
        If an argument is not of its shape or a value is not allowed. The message names the argument.
    """
    rays, spheres = rays_among_spheres(origin, direction, centers, radii)
    found = Kinds([spheres]).closest(rays)
    return found.item.astype(np.int32), found.rounded()


def rays_among_spheres(
    origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[Rays, Spheres]:
    """What closest() is asked about; it raises the same."""
    place, d = array_of("origin", origin, 3), array_of("direction", direction, -1, 3)
    places, sizes = _balls(centers, radii)
    spheres = Spheres(places, sizes, [None] * len(places), np.arange(len(places)))
    return along(at_point(place, len(d)), d, np.eye(3)), spheres
