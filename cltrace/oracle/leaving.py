"""The exact oracle for many rays at once that start on spheres and ellipsoids: what mirrors and glass send on.

What is decided about is what cltrace/reference/exact.py says: a ray starts at C + r B^T q / |B^T q|, on an ellipsoid at
C + r K^-1 q / |q|, and leads along B^T d, all of them the doubles that they are. Double-double arithmetic, which keeps
count of its errors, decides most rays, and spheres.py's integers the others.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.oracle.pairs import Fine, Floats, select
from cltrace.oracle.spheres import Maps, OnSphere, closest_from, to_world
from cltrace.scene import Scene

# What the filter takes, or 0. Its numbers have at most 14 such factors, so that nothing leaves the range of double, and
# what underflows, below 2^-1000, is nothing beside EPS times the terms that an error counts.
LOW, HIGH = 2.0**-64, 2.0**64
BLOCK = 1 << 13  # the temporary arrays stay in the cache

Vector = tuple[Fine, Fine, Fine]


class Shapes(NamedTuple):
    """Spheres, or ellipsoids where to_object is not None, see spheres.closest_from()."""

    centers: Floats
    radii: Floats
    to_object: Maps

    @classmethod
    def of(cls, scene: Scene) -> Shapes:
        maps = [None if i < 0 else scene.to_object[i] for i in scene.spheres["to_object"]]
        return cls(scene.spheres["center"], scene.spheres["radius"], maps)

    def key(self, i: int) -> tuple[object, ...]:
        """Equal for equal surfaces."""
        own = self.to_object[i]
        return *self.centers[i].tolist(), float(self.radii[i]), None if own is None else np.asarray(own).tobytes()


class Rays(NamedTuple):
    """n rays. own: (n,), the index of the surface on which each starts, -1 for the eye; normal: (n, 3), q, in camera
    space, but of an ellipsoid in its own axes, any for the eye; direction: (n, 3), d, in camera space; basis: (3, 3),
    the camera's axes in the world; eye: (3,)."""

    own: NDArray[np.int32]
    normal: Floats
    direction: Floats
    basis: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    eye: ArrayLike = (0.0, 0.0, 0.0)

    def at(self, rows: NDArray[np.intp]) -> Rays:
        return self._replace(own=self.own[rows], normal=self.normal[rows], direction=self.direction[rows])


def closest_of(rays: Rays, shapes: Shapes) -> tuple[NDArray[np.int32], Floats]:
    """The nearest hit of every ray: surface (n,), -1 if none; t (n,), to 2^-40 of itself, inf if none."""
    index, t, doubt = filtered_of(rays, shapes)
    index[doubt], t[doubt] = closest_of_exact(rays.at(np.flatnonzero(doubt)), shapes)
    return index, t


def closest_of_exact(rays: Rays, shapes: Shapes) -> tuple[NDArray[np.int32], Floats]:
    """The same by integers alone, with t correctly rounded: about a millisecond per ray."""
    index, t = np.full(len(rays.own), -1, np.int32), np.full(len(rays.own), np.inf)
    basis = np.asarray(rays.basis, float).tolist()
    for row, own in enumerate(rays.own.tolist()):
        start: ArrayLike | OnSphere = rays.eye
        if own >= 0:
            q, to_object = rays.normal[row].tolist(), shapes.to_object[own]
            n = to_world(basis, q) if to_object is None else q
            start = OnSphere(shapes.centers[own], float(shapes.radii[own]), n, to_object)
        d = to_world(basis, rays.direction[row].tolist())
        hit = closest_from(start, [d], shapes.centers, shapes.radii, to_object=shapes.to_object)
        index[row], t[row] = hit[0][0], hit[1][0]
    return index, t


def filtered_of(rays: Rays, shapes: Shapes) -> tuple[NDArray[np.int32], Floats, NDArray[np.bool_]]:
    """What closest_of() returns, but for the rays in the third array, which the filter leaves to the integers."""
    n = len(rays.own)
    index, t, doubt = np.full(n, -1, np.int32), np.full(n, np.inf), np.ones(n, bool)
    given = [np.ravel(m) for m in shapes.to_object if m is not None]
    constants = np.concatenate([np.ravel(x) for x in (shapes.centers, shapes.radii, rays.basis, rays.eye, *given)])
    if not _moderate(constants).all():
        return index, t, doubt
    fit = _moderate(rays.direction).all(axis=1) & rays.direction.any(axis=1)
    fit &= (rays.own < 0) | (_moderate(rays.normal).all(axis=1) & rays.normal.any(axis=1))
    for own in np.unique(rays.own[fit]):
        rows = np.flatnonzero(fit & (rays.own == own))
        for i in range(0, len(rows), BLOCK):
            part = rows[i : i + BLOCK]
            best = _closest(int(own), rays.at(part), shapes)
            index[part], t[part], doubt[part] = best.index, best.t.h, best.unsure()
    return index, t, doubt


def rounded_t(rays: Rays, shapes: Shapes) -> tuple[Floats, NDArray[np.bool_]]:
    """The nearest hit's t (n,) of rays that start on one surface, or at the eye, correctly rounded where the second
    array, (n,), says so; inf if there is none."""
    t, sure = np.empty(len(rays.own)), np.zeros(len(rays.own), bool)
    for i in range(0, len(t), BLOCK):
        part = np.arange(i, min(i + BLOCK, len(t)))
        best = _closest(int(rays.own[0]), rays.at(part), shapes)
        h, low, error = best.t.h, best.t.l, best.t.error
        t[part] = h
        sure[part] = ~best.unsure() & (h + (low + 2 * error) == h) & (h + (low - 2 * error) == h)
    return t, sure


def _moderate(values: ArrayLike) -> NDArray[np.bool_]:
    size = np.abs(values)
    return np.asarray((size == 0) | ((size >= LOW) & (size <= HIGH)))


def _closest(own: int, rays: Rays, shapes: Shapes) -> _Nearest:
    """Of rays from one surface, or from the eye."""
    basis = [[Fraction(x) for x in row] for row in np.asarray(rays.basis, float).tolist()]
    columns = [[basis[j][i] for j in range(3)] for i in range(3)]
    w = _times(columns, _vector(rays.direction))
    if own >= 0:
        to_object, q = shapes.to_object[own], _vector(rays.normal)
        m = _times(columns, q) if to_object is None else _times(_inverse(to_object), q)
        length = m if to_object is None else q
        factor = Fine.of(shapes.radii[own]) / _dot(length, length).root()
        step = m[0] * factor, m[1] * factor, m[2] * factor
        anchor = shapes.centers[own]
    else:
        zero = Fine.of(np.zeros(len(rays.own)))
        step, anchor = (zero, zero, zero), np.asarray(rays.eye, float)
    best = _Nearest(len(rays.own))
    first: dict[tuple[object, ...], int] = {}
    for i in range(len(shapes.radii)):
        if first.setdefault(shapes.key(i), i) != i:
            continue  # an equal surface before it always wins
        x, y, z = (Fine.rounded(Fraction(a) - Fraction(b)) for a, b in zip(shapes.centers[i], anchor, strict=True))
        f, d, given = (x - step[0], y - step[1], z - step[2]), w, shapes.to_object[i]
        if given is not None:
            K = [[Fraction(e) for e in row] for row in np.asarray(given, float).tolist()]
            f, d = _times(K, f), _times(K, d)
        if own >= 0 and shapes.key(own) == shapes.key(i):
            best.offer(i, np.arange(len(rays.own)), *_own_meeting(f, d))
            continue
        rows = np.flatnonzero(_may_meet(f, d, shapes.radii[i]))
        if len(rows):
            best.offer(i, rows, *_meeting(_at(f, rows), _at(d, rows), Fine.of(shapes.radii[i])))
    return best


def _vector(v: Floats) -> Vector:
    return Fine.of(v[:, 0]), Fine.of(v[:, 1]), Fine.of(v[:, 2])


def _dot(u: Vector, v: Vector) -> Fine:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _times(rows: list[list[Fraction]], v: Vector) -> Vector:
    """The vector of the products of the rows of a matrix with v."""

    def product(row: list[Fraction]) -> Fine:
        terms = [Fine.rounded(a) * x for a, x in zip(row, v, strict=True) if a]
        return sum(terms[1:], terms[0])

    return product(rows[0]), product(rows[1]), product(rows[2])


def _inverse(to_object: ArrayLike) -> list[list[Fraction]]:
    m = [[Fraction(x) for x in row] for row in np.asarray(to_object, float).tolist()]
    # Indices that go round need no signs.
    adjugate = [
        [m[j - 2][i - 2] * m[j - 1][i - 1] - m[j - 2][i - 1] * m[j - 1][i - 2] for j in range(3)] for i in range(3)
    ]
    determinant = sum((m[0][j] * adjugate[j][0] for j in range(3)), Fraction(0))
    return [[x / determinant for x in row] for row in adjugate]


def _at(v: Vector, rows: NDArray[np.intp]) -> Vector:
    return v[0][rows], v[1][rows], v[2][rows]


def _may_meet(f: Vector, w: Vector, r: float) -> NDArray[np.bool_]:
    """False only where a ray surely passes a surface by, in plain doubles: D = a r^2 - |f x w|^2 < 0.

    spheres._may_hit() has the proof, with 32 u (|f|^2 + r^2) a for all that is off. Here w is rounded as f is, and both
    are off by a share of 2^-60 more, which is looked at: that is less than twice as much, and 2^-40 is 2^8 times.
    """
    (fx, fy, fz), (x, y, z) = (v.h for v in f), (v.h for v in w)
    u, v, s = fy * z - fz * y, fz * x - fx * z, fx * y - fy * x
    a, ff, rr = x * x + y * y + z * z, fx * fx + fy * fy + fz * fz, r * r
    passes = a * rr - (u * u + v * v + s * s) < -(2.0**-40) * (a * (ff + rr))
    return ~(passes & _is_known(f) & _is_known(w))


def _is_known(v: Vector) -> NDArray[np.bool_]:
    """To 2^-60 of its length."""
    errors, sizes = (sum(x.error for x in v), sum(np.abs(x.h) for x in v))
    return np.asarray(2 * errors <= 2.0**-60 * sizes)


def _meeting(f: Vector, w: Vector, r: Fine) -> tuple[NDArray[np.bool_], Fine, NDArray[np.bool_]]:
    """Which rays surely meet a surface, where, and which may or may not. The equation is that of spheres.py."""
    a, b, c = _dot(w, w), _dot(f, w), _dot(f, f) - r * r
    D = b * b - a * c
    outside, ahead, meets = c.sign(), b.sign(), D.sign()
    hit = ((outside > 0) & (ahead > 0) & (meets > 0)) | ((outside < 0) & (meets > 0))
    miss = (meets < 0) | ((outside > 0) & (ahead < 0))
    rows = np.flatnonzero(hit)
    a, b, c, root = a[rows], b[rows], c[rows], D[rows].root()
    n = select(b.h < 0, -b, b) + root
    direct = (outside[rows] < 0) & (b.h >= 0)
    return hit, select(direct, n, select(outside[rows] < 0, -c, c)) / select(direct, a, n), ~(hit | miss)


def _own_meeting(f: Vector, w: Vector) -> tuple[NDArray[np.bool_], Fine, NDArray[np.bool_]]:
    """The same of the surface on which the rays start: c = 0."""
    a, b = _dot(w, w), _dot(f, w)
    hit, doubt = b.sign() > 0, b.sign() == 0
    return hit, ((b + b) / a)[hit], doubt


class _Nearest:
    """The nearest of the hits that have been offered, for each ray."""

    def __init__(self, count: int) -> None:
        self.index = np.full(count, -1, np.int32)
        self.t = Fine(np.full(count, np.inf), np.zeros(count), np.zeros(count))
        self._unsure = np.zeros(count, bool)

    def offer(self, i: int, which: NDArray[np.intp], hit: NDArray[np.bool_], t: Fine, doubt: NDArray[np.bool_]) -> None:
        """Of the rays `which`, those of `hit` meet surface i at t, (hits,), and those of `doubt` may or may not."""
        rows = which[hit]
        found = self.index[rows] >= 0
        gap = t - select(found, self.t[rows], Fine.of(np.zeros(len(rows))))
        self._unsure[which[doubt]] = True
        self._unsure[rows[(found & (gap.sign() == 0)) | ~np.isfinite(t.error)]] = True
        win = ~found | (gap.h < 0)
        rows, t = rows[win], t[win]
        self.index[rows] = i
        self.t.h[rows], self.t.l[rows], self.t.error[rows] = t.h, t.l, t.error

    def unsure(self) -> NDArray[np.bool_]:
        """For which rays it is not sure what is nearest, or t to 2^-40 of itself."""
        result: NDArray[np.bool_] = self._unsure | ((self.index >= 0) & ~(self.t.error < 2.0**-41 * self.t.h))
        return result
