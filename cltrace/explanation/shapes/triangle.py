"""Meshes, and the triangles that they have: a row of SHAPES."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cltrace.explanation.shapes.shape import Textbook
from cltrace.explanation.triples import Triple, number, triple, vector
from cltrace.reference import Direction, Mesh, Point, Surface, Triangle


@dataclass(frozen=True)
class TriangleTest(Textbook):
    """t = (A - o).N / d.N, in doubles.

    corners: A, B and C; normal: N = (B - A) x (C - A), not normalised; d_n: d.N; t: where the ray is in the plane, NaN
    if it is parallel to that; weights: of A, B and C at that point, all >= 0 within the triangle.
    """

    corners: tuple[Triple, Triple, Triple]
    normal: Triple
    d_n: float
    t: float
    weights: Triple
    surfaces: ClassVar = (Mesh, Triangle)
    normals: ClassVar = {"flat": "N / |N|", "smooth": "the corners' normals by the weights, normalized"}

    @classmethod
    def of(cls, triangle: Triangle, o: Point, d: Direction) -> TriangleTest:
        A, B, C = triangle.places
        N = (B - A).cross(C - A)
        d_n, area = d.dot(N), N.dot(N)
        t = (A - o).dot(N) / d_n if d_n else math.nan
        P = o + d * t
        # The triangle that P makes with an edge, as a share of the whole one.
        parts = [(Y - X).cross(P - X).dot(N) / area if area else math.nan for X, Y in ((B, C), (C, A), (A, B))]
        return cls((triple(A), triple(B), triple(C)), triple(N), d_n=d_n, t=t, weights=(parts[0], parts[1], parts[2]))

    @classmethod
    def gap(cls, mesh: Mesh, o: Point, d: Direction) -> tuple[float, float, Surface]:
        gaps, at = _gaps(mesh, o, d)
        k = int(np.argmin(gaps)) if len(gaps) else -1
        return (float(gaps[k]), float(at[k]), mesh.triangle(k)) if k >= 0 else (math.inf, math.inf, mesh)

    def first(self, own: bool) -> float:
        return self.t if self.t > 0 and all(weight >= 0 for weight in self.weights) else math.inf

    def lines(self) -> Iterator[str]:
        yield f"    {', '.join(f'{name} = {vector(corner)}' for name, corner in zip('ABC', self.corners, strict=True))}"
        yield f"    N = (B - A) x (C - A) = {vector(self.normal)}, d.N = {number(self.d_n)}"
        if math.isnan(self.t):
            yield "    d.N = 0: the ray is parallel to the plane"
            return
        inside = "all >= 0: within" if all(weight >= 0 for weight in self.weights) else "one < 0: outside"
        yield f"    t = (A - o).N / d.N = {number(self.t)}"
        yield f"    weights of A, B and C there: {', '.join(map(number, self.weights))}; {inside}"


def _gaps(mesh: Mesh, o: Point, d: Direction) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far a ray passes by each triangle of a mesh that is ahead of it as a whole, and at which t; inf for others.

    Seen along the ray the triangles are flat, and the ray is a point: so far is that from the nearest edge.
    """
    start, way = np.array(triple(o)), np.array(triple(d))
    right = np.cross(way, np.eye(3)[np.argmin(np.abs(way))])
    right /= np.linalg.norm(right)
    seen = (mesh.of.vertices - start) @ np.stack([right, np.cross(way, right), way], axis=1)
    corners = seen[mesh.of.geometry.faces]
    gap, at = np.full(len(corners), math.inf), np.full(len(corners), math.inf)
    for i in range(3):
        p, edge = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
        length = np.square(edge[:, :2]).sum(axis=1)
        along = -(p[:, :2] * edge[:, :2]).sum(axis=1)
        share = np.clip(np.divide(along, length, out=np.zeros(len(along)), where=length > 0), 0, 1)
        nearest = p + share[:, None] * edge
        distance = np.hypot(nearest[:, 0], nearest[:, 1])
        closer = (distance < gap) & (corners[:, :, 2] > 0).all(axis=1)
        gap[closer], at[closer] = distance[closer], nearest[closer, 2]
    return gap, at
