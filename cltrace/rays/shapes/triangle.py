"""Triangles of meshes, as rays meet them."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import cached_property

import numpy as np

from cltrace.base.arithmetic import Floats, cross, dot
from cltrace.exact.fine import Fine, FineVector, fine_vector
from cltrace.rays.doubles import FLOOR, PER_OFF, Met, Range, norm1
from cltrace.rays.fine import Ends, sign_of
from cltrace.rays.lines import Ids, Lines, differences
from cltrace.rays.numbers import Signs, Whole, signs, whole
from cltrace.rays.shapes.shape import Shape
from cltrace.rays.whole import Roots, WholeRays
from cltrace.scene import PlacedMesh, Scene


class Triangles(Shape):
    """See Shape."""

    def __init__(self, scene: Scene, first: int) -> None:
        self.meshes = scene.meshes
        counts = [len(mesh.geometry.faces) for mesh in self.meshes]
        numbers = np.repeat(np.array([mesh.number for mesh in self.meshes], np.int64), counts)
        super().__init__(first, numbers, np.concatenate([np.empty(0, np.int64), *map(np.arange, counts)]))
        begins = np.cumsum([0, *(len(mesh.vertices) for mesh in self.meshes)])
        faces = [mesh.geometry.faces + np.int32(k) for mesh, k in zip(self.meshes, begins, strict=False)]
        self.vertex = np.concatenate([self.vertex, *(mesh.vertices for mesh in self.meshes)])
        self.face = np.concatenate([self.face, *faces])

    def corners(self, primitive: Ids) -> list[Floats]:
        """(k, 3) each, in the world."""
        face = self.face[primitive - self.first]
        return [self.vertex[face[:, k]] for k in range(3)]

    def from_start(self, lines: Lines, ray: Ids, primitive: Ids) -> list[FineVector]:
        """Corners, from where the rays start."""
        return [fine_vector(*differences(corner, lines.origin[ray])) for corner in self.corners(primitive)]

    def meet(self, lines: Lines, ray: Ids, primitive: Ids) -> Met:
        A, B, C = (corner.T for corner in self.corners(primitive))
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
        # The quotient is off by the shares of both, the divisor's twice, as it is known to half of itself; and it
        # rounds.
        error = np.abs(t) * (D_error / np.abs(D) + 2 * (den_error / np.abs(den)) + 2.0**-51)
        within = Range.of(lines, ray, t, error)
        known = sure & np.isfinite(error)
        kept = np.flatnonzero(~miss & ~(known & ~within.perhaps))
        low, high = np.where(known, t - error, -np.inf), np.where(known, t + error, np.inf)
        side = np.zeros(len(ray), np.int64)
        return Met(ray, primitive, sure=known & within.surely, side=side, low=low, high=high).at(kept)

    def ends(self, lines: Lines, ray: Ids, primitive: Ids) -> Ends:
        w, (A, B, C) = fine_vector(lines.w[ray]), self.from_start(lines, ray, primitive)
        volumes = [dot(w, cross(u, v)) for u, v in ((A, B), (B, C), (C, A))]
        D = dot(A, cross(B, C))
        den = volumes[0] + volumes[1] + volumes[2]
        sides = np.array([sign_of(x) for x in volumes])
        flat = sign_of(D) == 0
        miss = (sides > 0).any(axis=0) & (sides < 0).any(axis=0)
        meets = np.where(miss, -1, ((sides != 0).all(axis=0) & ~flat & (sign_of(den) != 0)).astype(np.int8))
        t = D / den
        return Ends(meets.astype(np.int8), t, t)

    def lengths(self, primitive: Ids) -> list[Floats]:
        return self.corners(primitive)

    def edges(self, rays: WholeRays, primitive: Ids) -> tuple[list[Whole], Whole]:
        """The normals of the planes through a ray's start and each edge, and the volume D of start and triangle."""
        A, B, C = (whole(corner, rays.grid).T - rays.o for corner in self.corners(primitive))
        edges = [np.array(cross(u, v), object) for u, v in ((A, B), (B, C), (C, A))]
        return edges, dot(A, edges[1])

    def roots(self, rays: WholeRays, primitive: Ids) -> Roots:
        edges, D = self.edges(rays, primitive)
        sides = np.array([_sign_along(rays.w, edge) for edge in edges])
        side = sides[0]
        exists = (signs(D) != 0) & (sides == side).all(axis=0)
        # Where it is met, all three are on one side, so that side is that of their sum, N.w.
        normal, zero = (edges[0] + edges[1] + edges[2]) * side, np.zeros(len(side), np.int64)
        a, none = dot(rays.w, normal), zero.astype(object)
        found = Roots(exists, a=a, b=D * side, side=zero, D=none, w=rays.w, normal=normal)
        return found._replace(exists=exists & rays.reach(found))

    def points(self, lines: Lines, primitive: Ids, t: Fine) -> TrianglePoints:
        return TrianglePoints(self, lines, primitive)


class TrianglePoints:
    """See Points."""

    def __init__(self, triangles: Triangles, lines: Lines, primitive: Ids) -> None:
        self._triangles, self._lines, self._primitive = triangles, lines, primitive

    @cached_property
    def normal(self) -> Floats:
        A, B, C = self._triangles.corners(self._primitive)
        e, f = fine_vector(*differences(B, A)), fine_vector(*differences(C, A))
        out = np.stack([x.h for x in cross(e, f)], axis=1)
        for mesh, rows, faces in self._meshes():
            corners = mesh.geometry.normal_of[faces]
            given = corners[:, 0] >= 0
            m = np.einsum("nk,nki->ni", self._weights[rows[given]], mesh.geometry.normals[corners[given]])
            m = m @ mesh.normal_to_world.T
            shown = (m * m).sum(axis=1) > 0
            out[rows[given][shown]] = m[shown]
        return out

    @cached_property
    def uv(self) -> Floats:
        out = np.zeros((len(self._primitive), 2))
        for mesh, rows, faces in self._meshes():
            corners = mesh.geometry.uv_of[faces]
            given = corners[:, 0] >= 0
            places = mesh.geometry.uv[corners[given]]
            out[rows[given]] = np.einsum("nk,nki->ni", self._weights[rows[given]], places)
        return out

    @cached_property
    def _weights(self) -> Floats:
        """(k, 3): how much each corner counts; together they are 1."""
        rows = np.arange(len(self._primitive))
        w, (A, B, C) = fine_vector(self._lines.w), self._triangles.from_start(self._lines, rows, self._primitive)
        with np.errstate(all="ignore"):
            volumes = [dot(w, cross(u, v)) for u, v in ((B, C), (C, A), (A, B))]
            total = volumes[0] + volumes[1] + volumes[2]
            shares = [x / total for x in volumes]
            out = np.stack([share.h for share in shares], axis=1)
            known = np.all([share.error < 2.0**-50 for share in shares], axis=0) & self._lines.plain
        rest = np.flatnonzero(~known)
        if len(rest):
            rays = WholeRays.of(self._lines, rest, self._triangles.lengths(self._primitive[rest]))
            edges, _ = self._triangles.edges(rays, self._primitive[rest])
            exact = np.array([dot(rays.w, edge) for edge in (edges[1], edges[2], edges[0])], object)
            out[rest] = [[float(Fraction(x, sum(v))) for x in v] for v in exact.T]
        return np.clip(out, 0, 1)

    def _meshes(self) -> Iterator[tuple[PlacedMesh, Ids, Ids]]:
        """Each mesh that is met, the rows of points where it is, and which of its triangles."""
        i = self._primitive - self._triangles.first
        for mesh in self._triangles.meshes:
            rows = np.flatnonzero(self._triangles.number[i] == mesh.number)
            if len(rows):
                yield mesh, rows, self._triangles.primitive[i[rows]]


def _sign_along(w: Whole, v: Whole) -> Signs:
    """The sign of v.w, and where that is 0, of v.(w + (e, e^2, e^3)) for every small e > 0."""
    sign = signs(dot(v, w))
    for x in v:
        if sign.all():
            break
        sign = np.where(sign == 0, signs(x), sign)
    return sign
