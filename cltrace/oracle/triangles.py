"""Triangles as the oracle has them: what doubles know of rays and triangles.

Two steps precede the exact engine, cltrace/exact/shapes.py. All triangles beside whose corners a ray passes are ruled
out by their corners, as seen along the ray. Of the others, the determinants

    E = w . (A' x B') = det(w, A', B')    and    D = det(A', B', C'),    with X' = X - O,

are computed in doubles, with bounds of their errors. A ray from O along w meets the triangle if all three E have the
sign of D, at t = D / (E + E + E).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats, minus
from cltrace.exact.fine import Fine, fine_vector
from cltrace.exact.lines import ExactPoint
from cltrace.exact.shapes import ExactTriangle
from cltrace.oracle.rays import Ids, Points, Rays, rounded
from cltrace.oracle.search import Hits, Kind
from cltrace.scene import Scene

U = 2.0**-53
FLOOR = 2.0**-1000


@dataclass(frozen=True, eq=False)
class Triangles(Kind):
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

    def primitives(self) -> Ids:
        return self.primitive

    @property
    def extent(self) -> float:
        return float(np.abs(self.vertices).max(initial=0))

    def near(self, rays: Rays) -> tuple[Ids, Ids]:
        """Rays and triangles, (k,) rows each: all pairs that may meet.

        Where P - O = t w, two coordinates of w x (P - O) are 0, and w.(P - O) > 0. All three are linear in P. So a
        triangle is ruled out whose corners all are on the same side of one of these. With u = 2^-53, all places are
        seen from a vertex c, and M is the largest |V - c|_1 + |anchor - c|_1 + reach. A place is off by 20 u M, so the
        three are off by 40 u M |w|, and their products and sums by 8 u M |w|. As w is off by 8 u of `length`, which is
        twice |w|_1 at most, they are not quite 0 on the ray, at |t w| <= M, but 32 u M |w|_1 at most. All of it is
        below 2^-45 M |w|_1. Where |w| is not known as well, nothing is ruled out.
        """
        rough = rays.rough
        assert rough is not None
        way = rounded(rough.way)
        c = self.vertices[0] if len(self.vertices) else np.zeros(3)
        V, O = self.vertices - c, (rough.anchor - c) + rounded(rough.step)  # noqa: E741
        size = np.abs(way).sum(axis=1)
        far = np.abs(V).sum(axis=1).max(initial=0.0) + np.abs(rough.anchor - c).sum(axis=1) + rough.reach
        known = rough.length <= 2 * size
        axis = np.abs(way).argmax(axis=1)
        found: list[tuple[Ids, Ids]] = []
        for k in range(3):
            rows = np.flatnonzero(axis == k)
            w, o, error = way[rows], O[rows], np.where(known, 2.0**-45 * far * size, np.inf)[rows]
            beside = np.zeros((len(V), len(rows)), np.uint8)
            i, j = (k + 1) % 3, (k + 2) % 3
            for bit, value in enumerate((
                V[:, i, None] * w[:, k] - V[:, k, None] * w[:, i] - (o[:, i] * w[:, k] - o[:, k] * w[:, i]),
                V[:, j, None] * w[:, k] - V[:, k, None] * w[:, j] - (o[:, j] * w[:, k] - o[:, k] * w[:, j]),
            )):  # fmt: skip
                beside |= (value > error).astype(np.uint8) << np.uint8(2 * bit)
                beside |= (value < -error).astype(np.uint8) << np.uint8(2 * bit + 1)
            beside |= (V @ w.T - (o * w).sum(axis=1) < -error).astype(np.uint8) << np.uint8(4)
            a, b, d = (beside[self.faces[:, n]] for n in range(3))
            triangle, ray = np.nonzero((a & b & d) == 0)
            found.append((rows[ray], triangle))
        ray, triangle = (np.concatenate(x) for x in zip(*found, strict=True))
        other = rays.left(Triangles)[ray] != triangle
        return ray[other], triangle[other]

    def hits(self, rays: Rays, ray: Ids, item: Ids) -> Hits:
        """Bounds, with u = 2^-53: X' = (X - anchor) - step is off by u |X - anchor|, 2^-49 reach and u |X'|, and so by
        20 u s for s = |X'|_1 + reach; w by 8 u w1. So det(w, A', B') is off by (8 + 20 + 20) u w1 s s, and its products
        and sums by 6 u more: less than 2^-46 w1 s s. det(A', B', C') by 66 u s s s, less than 2^-45 s s s. FLOOR covers
        what underflows.
        """
        assert rays.rough is not None
        rough = rays.rough.at(ray)
        anchor, step, w = rough.anchor.T, rounded(rough.step).T, rounded(rough.way).T
        corners = [(self.vertices[self.faces[item, i]].T - anchor) - step for i in range(3)]
        s = [np.abs(corner).sum(axis=0) + rough.reach for corner in corners]
        D = _Double(_det(*corners), 2.0**-45 * s[0] * s[1] * s[2] + FLOOR)
        E = [
            _Double(_det(w, corners[i], corners[j]), 2.0**-46 * rough.length * s[i] * s[j] + FLOOR)
            for i, j in ((0, 1), (1, 2), (2, 0))
        ]
        den = _Double(E[0].value + E[1].value + E[2].value, 2 * (E[0].error + E[1].error + E[2].error))
        signs = np.array([x.sign() for x in (D, *E)])
        t = D.value / den.value
        error = 2 * (D.error / np.abs(D.value) + den.error / np.abs(den.value)) + 4 * U
        miss = (signs > 0).any(axis=0) & (signs < 0).any(axis=0)
        sure = (signs != 0).all(axis=0)
        kept = np.flatnonzero(~miss)
        t, error = t[kept], np.where(error[kept] < 2.0**-20, np.abs(t[kept]) * error[kept], np.inf)
        return Hits(ray[kept], item[kept], sure[kept], Fine(t, np.zeros(len(t)), error))

    def solid(self, item: int) -> ExactTriangle:
        return ExactTriangle(self.vertices[self.faces[item]].tolist())


def on_triangles(triangles: Triangles, own: Ids, corner: Ids, uv: Floats) -> Points:
    """V + u (V' - V) + v (V'' - V) of the triangles `own`, (n,): V is that corner, V' and V'' the next ones."""
    V = [triangles.vertices[triangles.faces[own, (corner + i) % 3]] for i in range(3)]

    def place(i: int) -> ExactPoint:
        u, v = uv[i].tolist()
        return triangles.solid(int(own[i])).point(int(corner[i]), u, v)

    e1, e2 = (minus(fine_vector(corners), fine_vector(V[0])) for corners in V[1:])
    u, v = (Fine.of(x.copy()) for x in uv.T)
    x, y, z = (u * p + v * q for p, q in zip(e1, e2, strict=True))
    return Points((V[0], (x, y, z)), place, own, Triangles)


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
