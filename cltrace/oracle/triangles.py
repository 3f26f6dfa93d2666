"""The exact oracle for triangles: which of them many rays at once meet, where, and which light they stop.

A ray and a triangle are what cltrace/reference/exact.py says of them. With X' = X - O for a start O and a corner X, a
ray along w is on that side of an edge AB which is the sign of

    E = w . (A' x B') = det(w, A', B'),    and if that is 0, of the first of the coordinates of A' x B' that is not.

It meets the triangle if all three E have the sign of D = det(A', B', C'), which is not 0, at t = D / (E + E + E) > 0.
At equal t, that counts which the ray w + (e, e^2, e^3) meets first, for small e; in one plane, the lower surface, then
the lower triangle. Towards a light at a point, it is the ray from the light that counts, up to t < 1.

Three steps decide. All triangles beside whose corners a ray passes are ruled out by their corners, as seen along the
ray. Of the others, the determinants are computed in doubles, with bounds of their errors. Where these leave a doubt,
whole numbers of any size decide: all coordinates are whole multiples of powers of two. A ray that starts on a sphere,
at C + r n / |n|, brings square roots, so all numbers are p + q sqrt(s) with whole p, q and s = n.n.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from math import isqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.oracle.pairs import Floats
from cltrace.scene import Scene, whole_inverse

Ids = NDArray[np.int64]
Bools = NDArray[np.bool_]
Whole = NDArray[Any]  # of dtype object: Python's integers

U = 2.0**-53
BLOCK = 1 << 21  # so many pairs of a vertex and a ray are looked at in one go


class Triangles(NamedTuple):
    """vertices: (v, 3), in the world; faces: (m, 3), by rising surface and primitive; surface, primitive: (m,)."""

    vertices: Floats
    faces: Ids
    surface: Ids
    primitive: Ids

    @classmethod
    def of(cls, scene: Scene) -> Triangles:
        """All of a scene."""
        counts = [len(mesh.geometry.faces) for mesh in scene.meshes]
        first = np.cumsum([0, *(len(mesh.vertices) for mesh in scene.meshes)])
        faces = [mesh.geometry.faces + int(k) for mesh, k in zip(scene.meshes, first, strict=False)]
        return cls(
            np.concatenate([np.empty((0, 3)), *(mesh.vertices for mesh in scene.meshes)]),
            np.concatenate([np.empty((0, 3), np.int64), *faces]),
            np.repeat([mesh.number for mesh in scene.meshes], counts).astype(np.int64),
            np.concatenate([np.empty(0, np.int64), *map(np.arange, counts)]),
        )


# -------------------------------------------------------------------------------------------------------- whole numbers


def grid_of(*arrays: ArrayLike) -> int:
    """The least k >= 0 such that all these doubles are whole multiples of 2^-k."""
    least = 0
    for array in arrays:
        mantissa, exponent = np.frexp(np.asarray(array, float))
        whole = (mantissa * 2.0**53).astype(np.int64)
        _, zeros = np.frexp((whole & -whole).astype(float))
        lowest = np.where(whole == 0, 0, exponent + zeros - 54)
        least = min(least, int(lowest.min(initial=0)))
    return -least


def whole(array: ArrayLike, grid: int) -> Whole:
    """The doubles times 2^grid, of which they are whole multiples."""
    mantissa, exponent = np.frexp(np.asarray(array, float))
    shift = exponent + (grid - 53)
    number = (mantissa * 2.0**53).astype(np.int64)
    number = np.where(shift < 0, number >> np.minimum(-shift, 63), number).astype(object)
    return np.asarray(number << np.maximum(shift, 0).astype(object), object)


class Roots:
    """Numbers p + q sqrt(s), exactly: arrays of one shape, of whole p, q and s >= 0. q None: of all it is 0."""

    __slots__ = ("p", "q", "s")

    def __init__(self, p: Whole, q: Whole | None = None, s: Whole | None = None) -> None:
        self.p, self.q, self.s = p, q, s

    def __add__(self, other: Roots) -> Roots:
        return self._sum(other, 1)

    def __sub__(self, other: Roots) -> Roots:
        return self._sum(other, -1)

    def _sum(self, other: Roots, sign: int) -> Roots:
        p, s = self.p + sign * other.p, self.s if self.s is not None else other.s
        if self.q is None or other.q is None:
            return Roots(p, self.q if other.q is None else sign * other.q, s)
        return Roots(p, self.q + sign * other.q, s)

    def __mul__(self, other: Roots) -> Roots:
        p, s = self.p * other.p, self.s if self.s is not None else other.s
        if self.q is None or other.q is None:
            q = None if self.q is other.q else self.p * other.q if self.q is None else self.q * other.p
            return Roots(p, q, s)
        return Roots(p + self.q * other.q * s, self.p * other.q + self.q * other.p, s)

    def sign(self) -> NDArray[np.int8]:
        """Of two terms that differ in sign, the one with the larger square has it."""
        first = _sign(self.p)
        if self.q is None or self.s is None:
            return first
        second = np.where(_sign(self.s) > 0, _sign(self.q), 0)
        larger = _sign(self.p * self.p - self.q * self.q * self.s)
        return np.where(first * second < 0, first * larger, np.sign(first + second)).astype(np.int8)

    def __getitem__(self, rows: Any) -> Roots:
        if self.q is None or self.s is None:
            return Roots(self.p[rows])
        return Roots(self.p[rows], self.q[rows], self.s[rows])


def _sign(x: Whole) -> NDArray[np.int8]:
    return (x > 0).astype(np.int8) - (x < 0).astype(np.int8)


Exact = tuple[Roots, Roots, Roots]


def _minus(u: Exact, v: Exact) -> Exact:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def _cross(u: Exact, v: Exact) -> Exact:
    x, y, z = (u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2] for i in range(3))
    return x, y, z


def _dot(u: Exact, v: Exact) -> Roots:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _columns(v: Whole) -> Exact:
    return Roots(v[:, 0]), Roots(v[:, 1]), Roots(v[:, 2])


# ----------------------------------------------------------------------------------------------------------------- rays


class ExactRays(NamedTuple):
    """n rays in whole numbers. scale: (n,), > 0; start: times 2^grid and scale; way: times numbers > 0.

    unit: (n,), what t is to be multiplied with, if it comes from these numbers.
    """

    scale: Whole
    start: Exact
    way: Exact
    unit: Whole

    def at(self, rows: Ids) -> ExactRays:
        start, way = (tuple(x[rows] for x in v) for v in (self.start, self.way))
        return ExactRays(self.scale[rows], start, way, self.unit[rows])  # type: ignore[arg-type]


@dataclass(frozen=True)
class Rays:
    """n rays in doubles: from anchor + step along way, (n, 3) each, all in the world.

    reach: (n,), a bound of |step|, which is off by 2^-49 of it at most; length: (n,), a bound of |way|_1, of which way
    is off by 2^-50 at most; own: (n,), the row of the triangle that a ray leaves, -1 for none; t_max: what t must be
    below. exact(rows, grid): those rays in whole numbers; grid: what this takes at least, see grid_of().
    """

    anchor: Floats
    step: Floats
    reach: Floats
    way: Floats
    length: Floats
    own: Ids
    t_max: float
    grid: int
    exact: Callable[[Ids, int], ExactRays]

    def __len__(self) -> int:
        return len(self.own)

    def at(self, rows: Ids) -> Rays:
        fields = ("anchor", "step", "reach", "way", "length", "own")
        return replace(
            self,
            **{name: getattr(self, name)[rows] for name in fields},
            exact=lambda some, grid: self.exact(rows[some], grid),
        )


class Points(NamedTuple):
    """n points where rays start: in doubles as in Rays, and exactly.

    exact(rows, grid): scale (n,), and the points times 2^grid and that. own: see Rays.
    """

    anchor: Floats
    step: Floats
    reach: Floats
    own: Ids
    grid: int
    exact: Callable[[Ids, int], tuple[Whole, Exact]]


def at_point(place: ArrayLike, count: int) -> Points:
    """Points of the world for so many rays, (n, 3), or one for all, (3,): the eye."""
    anchor = np.broadcast_to(np.asarray(place, float), (count, 3))

    def exact(rows: Ids, grid: int) -> tuple[Whole, Exact]:
        return _ones(len(rows)), _columns(whole(anchor[rows], grid))

    return Points(anchor, np.zeros((count, 3)), np.zeros(count), np.full(count, -1), grid_of(place), exact)


def on_triangles(triangles: Triangles, own: Ids, corner: Ids, uv: Floats) -> Points:
    """V + u (V' - V) + v (V'' - V) of the triangles `own`, (n,): V is that corner, V' and V'' the next ones."""
    V = [triangles.vertices[triangles.faces[own, (corner + i) % 3]] for i in range(3)]
    e1, e2, (u, v) = V[1] - V[0], V[2] - V[0], uv.T[:, :, None]
    fine = grid_of(uv)

    def exact(rows: Ids, grid: int) -> tuple[Whole, Exact]:
        a, b, c = (whole(corners[rows], grid) for corners in V)
        weights = whole(uv[rows], fine)
        place = (a << fine) + weights[:, :1] * (b - a) + weights[:, 1:] * (c - a)
        return _ones(len(rows)) << fine, _columns(place)

    reach = np.abs(u * e1).sum(axis=1) + np.abs(v * e2).sum(axis=1)
    return Points(V[0], u * e1 + v * e2, reach, own, grid_of(*V), exact)


def on_spheres(scene: Scene, own: Ids, normal: Floats) -> Points:
    """Points of the spheres `own`, (n,), counted in scene.spheres; normal: (n, 3), q of leaving.Rays, unit to 2^-47."""
    spheres, basis = scene.spheres[own], np.array(scene.camera.basis())
    bent = spheres["to_object"] >= 0
    inverses = [_whole_inverse(K) for K in scene.to_object.tolist()]
    L = np.array([[[float(Fraction(x, d)) for x in row] for row in rows] for rows, d in inverses]).reshape(-1, 3, 3)
    turned = normal @ basis
    if bent.any():
        turned[bent] = np.einsum("nij,nj->ni", L[spheres["to_object"][bent]], normal[bent])
    # As |q| is 1 to 2^-48, the step is off by that and what it rounds by, less than 2^-47 of its size.
    sizes = np.append(np.abs(L).sum(axis=(1, 2)), 1)[spheres["to_object"]]
    reach = 4 * spheres["radius"] * np.where(bent, sizes, 1.0)

    def exact(rows: Ids, grid: int) -> tuple[Whole, Exact]:
        fine = grid_of(normal[rows])
        q, s, scale = whole(normal[rows], fine), _ones(len(rows)), _ones(len(rows))
        axes = whole(basis, grid_of(basis))
        for i, row in enumerate(rows.tolist()):
            if bent[row]:
                matrix, determinant = inverses[spheres["to_object"][row]]
                s[i] = sum(x * x for x in q[i])
                q[i] = [sum(a * x for a, x in zip(line, q[i], strict=True)) for line in matrix]
                scale[i] = s[i] * determinant
            else:
                q[i] = q[i] @ axes
                scale[i] = s[i] = sum(x * x for x in q[i])
        center, radius = whole(spheres["center"][rows], grid), whole(spheres["radius"][rows], grid)
        x, y, z = (Roots(center[:, i] * scale, radius * q[:, i], s) for i in range(3))
        return scale, (x, y, z)

    none, grid = np.full(len(own), -1), grid_of(spheres["center"], spheres["radius"])
    return Points(spheres["center"], spheres["radius"][:, None] * turned, reach, none, grid, exact)


def _whole_inverse(K: list[list[float]]) -> tuple[list[list[int]], int]:
    rows, determinant = whole_inverse(K)
    return ([[-x for x in row] for row in rows], -determinant) if determinant < 0 else (rows, determinant)


def _ones(count: int) -> Whole:
    return np.full(count, 1, object)


def along(start: Points, direction: Floats, basis: ArrayLike) -> Rays:
    """Rays along B^T d: direction (n, 3), d, in camera space; basis: (3, 3), B, the camera's axes in the world."""
    axes = np.asarray(basis, float)
    way = direction @ axes
    fine, axes_grid = grid_of(direction), grid_of(axes)

    def exact(rows: Ids, grid: int) -> ExactRays:
        scale, place = start.exact(rows, grid)
        d = whole(direction[rows], fine)
        w = (d[:, None, :] * whole(axes.T, axes_grid)).sum(axis=2)
        # The way is times 2^(fine + axes_grid), and the lengths are times 2^grid and scale.
        unit = np.array([Fraction(2) ** (fine + axes_grid - grid) / x for x in scale], object)
        return ExactRays(scale, place, _columns(w), unit)

    # B^T d rounds by 3 u of |B^T| |d|, which is 5.2 u |d|.
    length = np.abs(way).sum(axis=1)
    return Rays(start.anchor, start.step, start.reach, way, length, start.own, np.inf, start.grid, exact)


def to_light(start: Points, light: ArrayLike, parallel: bool) -> Rays:
    """Shadow rays. light: (3,), the light's position, or the direction in which parallel light travels."""
    place, count = np.asarray(light, float), len(start.own)
    grid_of_light = grid_of(place)
    if parallel:
        way = np.broadcast_to(-place, (count, 3))

        def sideways(rows: Ids, grid: int) -> ExactRays:
            scale, origin = start.exact(rows, grid)
            unit = np.array([Fraction(2) ** (grid_of_light - grid) / x for x in scale], object)
            return ExactRays(scale, origin, _columns(whole(way[rows], grid_of_light)), unit)

        length = np.abs(way).sum(axis=1)
        return Rays(start.anchor, start.step, start.reach, way, length, start.own, np.inf, start.grid, sideways)

    def exact(rows: Ids, grid: int) -> ExactRays:
        scale, end = start.exact(rows, grid)
        x, y, z = (Roots(n * scale) for n in whole(place, grid))
        return ExactRays(scale, (x, y, z), _minus(end, (x, y, z)), _ones(len(rows)))

    way, zero = (start.anchor - place) + start.step, np.zeros((count, 3))
    # Both sums round by u of what they yield, |way| + reach at most; step is off by 2^-49 reach.
    length = np.abs(way).sum(axis=1) + 4 * start.reach
    grid = max(start.grid, grid_of_light)
    return Rays(np.broadcast_to(place, (count, 3)), zero, zero[:, 0], way, length, start.own, 1.0, grid, exact)


# ------------------------------------------------------------------------------------------------------------ crossings


class Hits(NamedTuple):
    """Rays that meet triangles: ray, triangle: (k,) rows; t: (k,), off by `error` of itself at most."""

    ray: Ids
    triangle: Ids
    t: Floats
    error: Floats


def hits(rays: Rays, triangles: Triangles) -> Iterator[tuple[slice, Hits]]:
    """All hits, for blocks of the rays. The rays of Hits are counted from the block's first one."""
    size = max(1, BLOCK // max(1, len(triangles.vertices)))
    for first in range(0, len(rays), size):
        rows = np.arange(first, min(first + size, len(rays)))
        block = rays.at(rows)
        yield slice(first, first + len(rows)), _hits(block, triangles, *_candidates(block, triangles))


def _candidates(rays: Rays, triangles: Triangles) -> tuple[Ids, Ids]:
    """Rays and triangles, (k,) rows each: all pairs that may meet.

    Where P - O = t w, two coordinates of w x (P - O) are 0, and w.(P - O) > 0. All three are linear in P. So a triangle
    is ruled out whose corners all are on the same side of one of these. With u = 2^-53, all places are seen from a
    vertex c, and M is the largest |V - c|_1 + |anchor - c|_1 + reach. A place is off by 20 u M, so the three are off by
    40 u M |w|, and their products and sums by 8 u M |w|. As w is off by 8 u of `length`, which is twice |w|_1 at most,
    they are not quite 0 on the ray, at |t w| <= M, but 32 u M |w|_1 at most. All of it is below 2^-45 M |w|_1. Where
    |w| is not known as well, nothing is ruled out.
    """
    c = triangles.vertices[0] if len(triangles.vertices) else np.zeros(3)
    V, O = triangles.vertices - c, (rays.anchor - c) + rays.step  # noqa: E741
    size = np.abs(rays.way).sum(axis=1)
    far = np.abs(V).sum(axis=1).max(initial=0.0) + np.abs(rays.anchor - c).sum(axis=1) + rays.reach
    known = rays.length <= 2 * size
    axis = np.abs(rays.way).argmax(axis=1)
    found: list[tuple[Ids, Ids]] = []
    for k in range(3):
        rows = np.flatnonzero(axis == k)
        w, o, error = rays.way[rows], O[rows], np.where(known, 2.0**-45 * far * size, np.inf)[rows]
        beside = np.zeros((len(V), len(rows)), np.uint8)
        i, j = (k + 1) % 3, (k + 2) % 3
        for bit, value in enumerate((
            V[:, i, None] * w[:, k] - V[:, k, None] * w[:, i] - (o[:, i] * w[:, k] - o[:, k] * w[:, i]),
            V[:, j, None] * w[:, k] - V[:, k, None] * w[:, j] - (o[:, j] * w[:, k] - o[:, k] * w[:, j]),
        )):  # fmt: skip
            beside |= (value > error).astype(np.uint8) << np.uint8(2 * bit)
            beside |= (value < -error).astype(np.uint8) << np.uint8(2 * bit + 1)
        beside |= (V @ w.T - (o * w).sum(axis=1) < -error).astype(np.uint8) << np.uint8(4)
        a, b, d = (beside[triangles.faces[:, n]] for n in range(3))
        triangle, ray = np.nonzero((a & b & d) == 0)
        found.append((rows[ray], triangle))
    ray, triangle = (np.concatenate(x) for x in zip(*found, strict=True))
    other = rays.own[ray] != triangle
    return ray[other], triangle[other]


class _Double(NamedTuple):
    """k doubles, and bounds of their errors."""

    value: Floats
    error: Floats

    def sign(self) -> NDArray[np.int8]:
        """0 where it is not sure."""
        return (self.value > self.error).astype(np.int8) - (self.value < -self.error).astype(np.int8)


def _det(u: Floats, v: Floats, w: Floats) -> Floats:
    """Determinants of (3, k) vectors."""
    return np.asarray(
        u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0])
    )


def _hits(rays: Rays, triangles: Triangles, ray: Ids, triangle: Ids) -> Hits:
    """Of these pairs, those that meet.

    Bounds, with u = 2^-53: X' = (X - anchor) - step is off by u |X - anchor|, 2^-49 reach and u |X'|, and so by 20 u s
    for s = |X'|_1 + reach; w by 8 u w1. So det(w, A', B') is off by (8 + 20 + 20) u w1 s s, and its products and sums
    by 6 u more: less than 2^-46 w1 s s. det(A', B', C') by 66 u s s s, less than 2^-45 s s s. FLOOR covers what
    underflows.
    """
    if not len(ray):
        return Hits(ray, triangle, np.empty(0), np.empty(0))
    anchor, step, w = rays.anchor[ray].T, rays.step[ray].T, rays.way[ray].T
    corners = [(triangles.vertices[triangles.faces[triangle, i]].T - anchor) - step for i in range(3)]
    s = [np.abs(corner).sum(axis=0) + rays.reach[ray] for corner in corners]
    with np.errstate(all="ignore"):  # what is not finite is not sure
        D = _Double(_det(*corners), 2.0**-45 * s[0] * s[1] * s[2] + FLOOR)
        E = [
            _Double(_det(w, corners[i], corners[j]), 2.0**-46 * rays.length[ray] * s[i] * s[j] + FLOOR)
            for i, j in ((0, 1), (1, 2), (2, 0))
        ]
        den = _Double(E[0].value + E[1].value + E[2].value, 2 * (E[0].error + E[1].error + E[2].error))
        signs = np.array([x.sign() for x in (D, *E)])
        t = D.value / den.value
        error = 2 * (D.error / np.abs(D.value) + den.error / np.abs(den.value)) + 4 * U
        miss = (signs > 0).any(axis=0) & (signs < 0).any(axis=0)
        sure = miss | (signs != 0).all(axis=0)
        if rays.t_max < np.inf:
            rest = _Double(den.value - D.value, den.error + D.error).sign() * signs[0]
            miss |= (rest < 0) & sure
            sure &= miss | (rest > 0)
    hit = sure & ~miss
    error[~(error < 2.0**-20)] = np.inf
    doubt = np.flatnonzero(~sure)
    if len(doubt):
        exact = _crossed(rays, triangles, ray[doubt], triangle[doubt])
        kept = exact.meets & (exact.sign_less(rays.t_max) < 0 if rays.t_max < np.inf else True)
        hit[doubt] = kept
        t[doubt[kept]], error[doubt[kept]] = exact.at(np.flatnonzero(kept)).rounded(), 4 * U
    return Hits(ray[hit], triangle[hit], t[hit], error[hit])


FLOOR = 2.0**-1000


class _Crossed(NamedTuple):
    """Rays across triangles, exactly: meets (k,); where it does, t = unit D / den, den = N.w > 0."""

    meets: Bools
    D: Roots
    den: Roots
    N: Exact
    unit: Whole

    def at(self, rows: Ids) -> _Crossed:
        x, y, z = (part[rows] for part in self.N)
        return _Crossed(self.meets[rows], self.D[rows], self.den[rows], (x, y, z), self.unit[rows])

    def sign_less(self, t_max: float) -> NDArray[np.int8]:
        """The sign of t - t_max, which is 1: their unit is 1, too."""
        assert t_max == 1
        return (self.D - self.den).sign()

    def before(self, other: _Crossed) -> Bools:
        """Whether it comes before the other one, of the same ray; both in the same units."""
        pairs = zip((self.den, *self.N), (other.den, *other.N), strict=True)
        return _first_sign(self.D * its - other.D * mine for mine, its in pairs) < 0

    def t(self) -> list[Fraction]:
        """Exactly; of square roots, to 2^-400 of their terms' size."""
        return [unit * _cut(self.D[i]) / _cut(self.den[i]) for i, unit in enumerate(self.unit)]

    def rounded(self) -> Floats:
        return np.array([_float(t) for t in self.t()], float)


def _float(x: Fraction) -> float:
    try:
        return float(x)
    except OverflowError:
        return np.inf


def _cut(x: Roots) -> Fraction:
    """p + q sqrt(s) of one number."""
    p, q, s = (int(v) if v is not None else 0 for v in (x.p, x.q, x.s))
    bits = 400 + s.bit_length()
    return p + Fraction(q * isqrt(s << 2 * bits), 1 << bits)


def _crossed(rays: Rays, triangles: Triangles, ray: Ids, triangle: Ids) -> _Crossed:
    """Of these pairs of a ray and a triangle, exactly."""
    used, place = np.unique(ray, return_inverse=True)
    corners = triangles.vertices[triangles.faces[triangle]]
    grid = max(rays.grid, grid_of(corners))
    exact = rays.exact(used, grid).at(place)
    scale = exact.scale
    A, B, C = (_minus(_columns(whole(corners[:, i], grid) * scale[:, None]), exact.start) for i in range(3))
    edges = [_cross(A, B), _cross(B, C), _cross(C, A)]
    D = _dot(A, edges[1])
    side = D.sign()
    volumes = [_dot(exact.way, edge) for edge in edges]
    meets = side != 0
    for E, edge in zip(volumes, edges, strict=True):
        meets &= _first_sign((E, *edge)) == side
    turn = Roots(np.where(side < 0, -1, 1).astype(object))
    x, y, z = ((a + b + c) * turn for a, b, c in zip(*edges, strict=True))
    return _Crossed(meets, D * turn, (volumes[0] + volumes[1] + volumes[2]) * turn, (x, y, z), exact.unit)


def _first_sign(values: Iterable[Roots]) -> NDArray[np.int8]:
    """The sign of the first of these that is not 0; later ones are only computed where some are."""
    sign: NDArray[np.int8] | None = None
    for value in values:
        sign = value.sign() if sign is None else np.where(sign == 0, value.sign(), sign)
        if (sign != 0).all():
            break
    assert sign is not None
    return sign


# ------------------------------------------------------------------------------------------------------------ questions


def closest(rays: Rays, triangles: Triangles) -> tuple[Ids, Floats]:
    """The triangle that each ray meets first, (n,) rows, -1 if none; and t, (n,), to 2^-20 of itself, inf if none."""
    index, t = np.full(len(rays), -1), np.full(len(rays), np.inf)
    for part, found in hits(rays, triangles):
        index[part], t[part] = _first(rays.at(np.arange(part.start, part.stop)), triangles, found)
    return index, t


def exact_t(rays: Rays, triangles: Triangles, ray: Ids, triangle: Ids) -> list[Fraction]:
    """The t at which these rays meet these triangles, which they do."""
    return _crossed(rays, triangles, ray, triangle).t()


def _first(rays: Rays, triangles: Triangles, found: Hits) -> tuple[Ids, Floats]:
    """Of each ray, the hit that comes first, and of equal ones that of the lowest triangle."""
    index, t = np.full(len(rays), -1), np.full(len(rays), np.inf)
    far = np.full(len(rays), np.inf)
    # What t of each hit is at least and at most; and of each ray, what the least t is at most.
    least, most = found.t * (1 - found.error), found.t * (1 + found.error)
    least, most = np.where(np.isfinite(least), least, 0.0), np.where(np.isfinite(most), most, np.inf)
    np.minimum.at(far, found.ray, most)
    kept = np.flatnonzero(least <= far[found.ray])
    kept = kept[np.lexsort((found.triangle[kept], found.ray[kept]))]
    ray, triangle = found.ray[kept], found.triangle[kept]
    first = np.flatnonzero(np.append(True, ray[1:] != ray[:-1])) if len(ray) else np.empty(0, int)
    count = np.diff(np.append(first, len(ray)))
    best = first.copy()
    for turn in range(1, int(count.max(initial=0))):
        group = np.flatnonzero(count > turn)
        a, b = best[group], first[group] + turn
        both = np.concatenate([b, a])
        exact, half = _crossed(rays, triangles, ray[both], triangle[both]), np.arange(len(b))
        best[group] = np.where(exact.at(half).before(exact.at(half + len(b))), b, a)
    index[ray[best]], t[ray[best]] = triangle[best], found.t[kept[best]]
    rough = best[~np.isfinite(found.error[kept[best]])]
    if len(rough):
        t[ray[rough]] = _crossed(rays, triangles, ray[rough], triangle[rough]).rounded()
    return index, t


def stopped(rays: Rays, triangles: Triangles) -> Bools:
    """(n,): which shadow rays are stopped."""
    out = np.zeros(len(rays), bool)
    for part, found in hits(rays, triangles):
        out[part] = np.bincount(found.ray, minlength=part.stop - part.start) > 0
    return out


def hit_counts(rays: Rays, triangles: Triangles) -> Ids:
    """(n,): how many triangles each ray meets."""
    out = np.zeros(len(rays), int)
    for part, found in hits(rays, triangles):
        out[part] = np.bincount(found.ray, minlength=part.stop - part.start)
    return out
