"""What doubles know of rays and surfaces, with bounds of what they are off by.

The formulas, and the derivation of their bounds, are those of cltrace/reference: crossing.py for triangles and
equation.py, FromSurface, for spheres and ellipsoids. Those have a start that is off by 2^-49 of a "reach" at most, and
a direction that is off by less than 48 u of its size, u = 2^-53. Here the direction is exact, and each number of the
start is off by `off`: with a reach of 2^51 times as much, all bounds hold.

FLOOR covers what underflows: of two factors, one is a scene's number or a ray's, the other below 2^400.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cltrace.numbers.pairs import Floats
from cltrace.numbers.vectors import Triple, cross, dot
from cltrace.rays.lines import Bools, Ids, Lines
from cltrace.rays.surfaces import Surfaces

FLOOR = 2.0**-600
PER_OFF = 2.0**51


class Met(NamedTuple):
    """k rays and primitives that meet, or may meet, within the rays' ranges.

    ray, primitive: (k,) rows; sure: (k,), whether they do; side: (k,), -1 for the near end of the way through a sphere,
    1 for the far one, 0 of triangles; low, high: (k,), bounds of s, if they do.
    """

    ray: Ids
    primitive: Ids
    sure: Bools
    side: Ids
    low: Floats
    high: Floats

    def at(self, rows: Ids | Bools) -> Met:
        return Met._make(x[rows] for x in self)

    @classmethod
    def all(cls, parts: list[Met]) -> Met:
        none = np.empty(0, np.int64)
        parts = parts or [cls(none, none, none.astype(bool), none, low=none.astype(float), high=none.astype(float))]
        return cls._make(np.concatenate(x) for x in zip(*parts, strict=True))


def meet(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> Met:
    """Which of these pairs meet, or may."""
    parts = []
    with np.errstate(all="ignore"):  # what is not finite is not sure
        for rows, kind in zip(surfaces.kinds(primitive), (_spheres, _rods, _triangles), strict=True):
            if rows.any():
                parts.append(kind(lines, surfaces, ray[rows], primitive[rows]))
    return Met.all(parts)


def norm1(v: Triple[Floats]) -> Floats:
    return np.asarray(np.abs(v[0]) + np.abs(v[1]) + np.abs(v[2]))


class _Range(NamedTuple):
    """Whether s, with a bound of its error, is within the ray's range: surely, and perhaps."""

    surely: Bools
    perhaps: Bools

    @classmethod
    def of(cls, lines: Lines, ray: Ids, s: Floats, error: Floats) -> _Range:
        slack = error + lines.loose[ray]
        low, high = lines.low[ray], lines.high[ray]
        return cls((s - slack > low) & (s + slack < high), ~((s + slack < low) | (s - slack > high)))


def _triangles(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> Met:
    face = surfaces.face[primitive - surfaces.solids]
    A, B, C = (surfaces.vertex[face[:, k]].T for k in range(3))
    w, a, e1, e2 = lines.w[ray].T, A - lines.place[ray].T, B - A, C - A
    R, N = cross(a, w), cross(e1, e2)
    D, den, EB, EC = dot(a, N), dot(N, w), dot(e2, R), -dot(e1, R)
    EA = (den - EB) - EC
    g, h, s, w1 = norm1(e1), norm1(e2), norm1(a) + PER_OFF * lines.off[ray], norm1(w)
    den_error = 2.0**-46 * g * h * w1 + FLOOR
    E_error = 2.0**-44 * s * w1 * (g + h) + den_error
    D_error = 2.0**-45 * s * g * h + FLOOR
    volumes = np.stack([EA, EB, EC])
    above, below = volumes > E_error, volumes < -E_error
    miss, sure = above.any(axis=0) & below.any(axis=0), (above | below).all(axis=0)
    sure &= (np.abs(D) > D_error) & (np.abs(den) > 2 * den_error)
    t = D / den
    # The quotient is off by the shares of both, the divisor's twice, as it is known to half of itself; and it rounds.
    error = np.abs(t) * (D_error / np.abs(D) + 2 * (den_error / np.abs(den)) + 2.0**-51)
    within = _Range.of(lines, ray, t, error)
    known = sure & np.isfinite(error)
    kept = np.flatnonzero(~miss & ~(known & ~within.perhaps))
    low, high = np.where(known, t - error, -np.inf), np.where(known, t + error, np.inf)
    side = np.zeros(len(ray), np.int64)
    return Met(ray, primitive, sure=known & within.surely, side=side, low=low, high=high).at(kept)


def _spheres(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> Met:
    f, w, r = surfaces.center[primitive].T - lines.place[ray].T, lines.w[ray].T, surfaces.radius[primitive]
    k, bent = surfaces.stretch[primitive], np.flatnonzero(surfaces.bent[primitive] >= 0)
    f1, w1 = k * norm1(f), k * norm1(w)
    s = f1 + k * PER_OFF * lines.off[ray]
    if len(bent):
        maps = surfaces.maps[surfaces.bent[primitive[bent]]]
        f[:, bent], w[:, bent] = (np.einsum("nij,jn->in", maps, v[:, bent]) for v in (f, w))
    X = cross(f, w)
    a, b, ff, XX, rr = dot(w, w), dot(f, w), dot(f, f), dot(X, X), r * r
    c, arr = ff - rr, a * rr
    D = arr - XX
    w_error = np.where(k == 1, 0.0, 2.0**-49 * w1)
    a_error = w_error * (2 * norm1(w) + w_error) + 2.0**-50 * a
    b_error = 2.0**-47 * s * w1 + FLOOR
    D_error = (2 * norm1(X) * b_error + b_error * b_error) + 2.0**-47 * (arr + XX) + rr * a_error + FLOOR
    c_error = 2.0**-46 * s * f1 + 2.0**-50 * (ff + rr) + (2.0**-47 * s) ** 2 + FLOOR
    miss = -D_error > D
    # q = |b| + sqrt(D) is off by b_error, by D_error / sqrt(D), and by its rounding; the ends are q / a and c / q, or
    # their negatives, and each is off by the shares of both, the divisor's twice.
    root = np.sqrt(np.maximum(D, 0))
    q = np.abs(b) + root
    q_share = (b_error + D_error / root) / q + 2.0**-50
    sure = (D_error < D) & (np.abs(b) > b_error) & (q_share < 0.25) & (a_error < 0.25 * a)
    ahead = b > 0
    outer, inner = np.where(ahead, q, -q) / a, np.where(ahead, c, -c) / q
    outer_error = np.abs(outer) * 2 * (q_share + a_error / a + 2.0**-51)
    inner_error = np.abs(inner) * 2 * (q_share + 2.0**-51) + 2 * c_error / q
    near, near_error = np.where(ahead, inner, outer), np.where(ahead, inner_error, outer_error)
    far, far_error = np.where(ahead, outer, inner), np.where(ahead, outer_error, inner_error)
    sure &= np.isfinite(near_error) & np.isfinite(far_error)
    first, second = _Range.of(lines, ray, near, near_error), _Range.of(lines, ray, far, far_error)
    by_near, by_far = sure & first.surely, sure & ~first.perhaps & second.surely
    out = miss | (sure & ~first.perhaps & ~second.perhaps)
    # From outside, where the middle of the way through is behind, both ends are.
    out |= (c > c_error) & (b < -b_error) & (lines.low[ray] - lines.loose[ray] >= 0) & (lines.start[0][ray] == 0)
    kept = np.flatnonzero(~out)
    low = np.where(sure, np.where(by_far, far - far_error, near - near_error), -np.inf)
    high = np.where(sure, np.where(by_near, near + near_error, far + far_error), np.inf)
    side = np.where(by_far, 1, -1)
    return Met(ray, primitive, sure=by_near | by_far, side=side, low=low, high=high).at(kept)


def _rods(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> Met:
    """Only those are left out that surely pass by: pairs tell of the others.

    The line is |V| / |G| from the axis, V = u.(f x w) and G = w x u. With u = 2^-53 and s as of spheres, f is off by
    2^-48 s and f x w by 2^-47 s w1: see passes_by() in cltrace/reference/cylinder.py.
    """
    rod = primitive - surfaces.spheres
    start, r = surfaces.start[rod].T, surfaces.rod_radius[rod]
    f, w, u = start - lines.place[ray].T, lines.w[ray].T, surfaces.end[rod].T - start
    s, w1, u1 = norm1(f) + PER_OFF * lines.off[ray], norm1(w), norm1(u)
    V, G = np.abs(dot(u, cross(f, w))), cross(w, u)
    size = np.sqrt(dot(G, G)) + 2.0**-45 * w1 * u1
    beside = V - 2.0**-45 * s * w1 * u1 > r * size * (1 + 2.0**-45) + FLOOR
    kept = np.flatnonzero(~beside)
    unknown = np.full(len(kept), np.inf)
    none = np.zeros(len(kept), np.int64)
    return Met(ray[kept], primitive[kept], sure=none.astype(bool), side=none - 1, low=-unknown, high=unknown)
