"""What pairs of doubles know of rays and surfaces: the same questions as in doubles.py, to a hundred bits.

The start is the ray's own, not a place near the surfaces, and t is in units of w. The arithmetic keeps count of its
errors, see cltrace/numbers/pairs.py.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.numbers.fine import Fine, FineVector, fine_vector, select
from cltrace.numbers.pairs import Floats
from cltrace.numbers.vectors import cross, dot
from cltrace.rays.lines import Ids, Lines, differences
from cltrace.rays.surfaces import Surfaces

Signs = NDArray[np.int8]
# What is below may have lost digits that no error counts. Of the terms of an error, all factors are within 2^-200 or
# what a scene's number may be.
FLOOR = 2.0**-900


class Ends(NamedTuple):
    """k rays and surfaces. meets: (k,), 1 where the line surely meets the surface, -1 where not, 0 where it may or not;
    near, far: where it does, of triangles twice the same."""

    meets: Signs
    near: Fine
    far: Fine


def _sign(x: Fine) -> Signs:
    """1 or -1 where it is sure, 0 where it is not."""
    bound = 2 * x.error + FLOOR
    return (x.h > bound).astype(np.int8) - (x.h < -bound).astype(np.int8)


def ends(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> Ends:
    """Of pairs all of which are of one kind."""
    with np.errstate(all="ignore"):  # what is not finite is not sure
        for rows, kind in zip(surfaces.kinds(primitive[:1]), (_spheres, _rods, _triangles), strict=True):
            if rows.all():
                return kind(lines, surfaces, ray, primitive)
    raise ValueError("primitive: must be some")


def _triangles(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> Ends:
    face, o = surfaces.face[primitive - surfaces.solids], lines.origin[ray]
    A, B, C = (fine_vector(*differences(surfaces.vertex[face[:, k]], o)) for k in range(3))
    w = fine_vector(lines.w[ray])
    volumes = [dot(w, cross(u, v)) for u, v in ((A, B), (B, C), (C, A))]
    D = dot(A, cross(B, C))
    den = volumes[0] + volumes[1] + volumes[2]
    signs = np.array([_sign(x) for x in volumes])
    flat = _sign(D) == 0
    miss = (signs > 0).any(axis=0) & (signs < 0).any(axis=0)
    meets = np.where(miss, -1, ((signs != 0).all(axis=0) & ~flat & (_sign(den) != 0)).astype(np.int8))
    t = D / den
    return Ends(meets.astype(np.int8), t, t)


def seen(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> tuple[FineVector, FineVector]:
    """The way from the start to a sphere's centre, and w; both in an ellipsoid's own axes."""
    f, w = fine_vector(*differences(surfaces.center[primitive], lines.origin[ray])), fine_vector(lines.w[ray])
    bent = surfaces.bent[primitive]
    if (bent < 0).all():
        return f, w
    maps = np.concatenate([surfaces.maps, np.eye(3)[None]])[bent]  # of -1, the last one
    rows = [fine_vector(maps[:, i]) for i in range(3)]
    (fx, fy, fz), (wx, wy, wz) = ([dot(row, v) for row in rows] for v in (f, w))
    return (fx, fy, fz), (wx, wy, wz)


def _spheres(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> Ends:
    (f, w), r = seen(lines, surfaces, ray, primitive), Fine.of(surfaces.radius[primitive])
    X, rr = cross(f, w), r * r
    a, b, c, D = dot(w, w), dot(f, w), dot(f, f) - rr, dot(w, w) * rr - dot(X, X)
    root = Fine(np.maximum(D.h, 0), np.where(D.h > 0, D.l, 0), D.error).root()
    ahead = b.h > 0
    q = select(ahead, b, -b) + root
    outer, inner = select(ahead, q, -q) / a, select(ahead, c, -c) / q
    meets = np.where((_sign(D) > 0) & (_sign(b) == 0), 0, _sign(D))
    return Ends(meets.astype(np.int8), select(ahead, inner, outer), select(ahead, outer, inner))


def _rods(lines: Lines, surfaces: Surfaces, ray: Ids, primitive: Ids) -> Ends:
    """Where lines are within the endless cylinder, and between the planes of the ends: from the later beginning to the
    earlier end of the two."""
    rod = primitive - surfaces.spheres
    start, r, w = surfaces.start[rod], Fine.of(surfaces.rod_radius[rod]), fine_vector(lines.w[ray])
    f, u = fine_vector(*differences(start, lines.origin[ray])), fine_vector(*differences(surfaces.end[rod], start))
    F, G, uu = cross(f, u), cross(w, u), dot(u, u)
    a, b, c, g, h, V = dot(G, G), dot(F, G), dot(F, F) - r * r * uu, dot(w, u), dot(f, u), dot(u, cross(f, w))
    D, k = uu * (a * r * r - V * V), h + uu
    root = Fine(np.maximum(D.h, 0), np.where(D.h > 0, D.l, 0), D.error).root()
    ahead, forth = b.h > 0, g.h > 0
    q = select(ahead, b, -b) + root
    outer, inner = select(ahead, q, -q) / a, select(ahead, c, -c) / q
    first = select(forth, h, k) / g, select(ahead, inner, outer)
    last = select(forth, k, h) / g, select(ahead, outer, inner)
    late, soon = _sign(first[0] - first[1]), _sign(last[0] - last[1])
    near, far = select(late > 0, *first), select(soon < 0, *last)
    known = (_sign(D) > 0) & (_sign(a) > 0) & (_sign(b) != 0) & (_sign(g) != 0) & (late != 0) & (soon != 0)
    meets = np.where(_sign(D) < 0, -1, np.where(known, _sign(far - near), 0))
    return Ends(meets.astype(np.int8), near, far)


def compare(t: Fine, bound: Floats) -> Signs:
    """The sign of t - bound where it is sure; bound may be infinite."""
    finite = np.isfinite(bound)
    with np.errstate(all="ignore"):
        sign = _sign(t - Fine.of(np.where(finite, bound, 0)))
    return np.where(finite, sign, np.where(bound > 0, -1, 1)).astype(np.int8)
