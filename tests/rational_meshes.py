"""Triangles in rational arithmetic, straight from their definition, and small meshes where it is hard to keep to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np

from cltrace import Mesh, Scene
from cltrace.reference import Direction

Vector = tuple[Fraction, Fraction, Fraction]
Hit = tuple[Fraction, int, int]  # t, surface, triangle


def exactly(v: Sequence[float | Fraction]) -> Vector:
    x, y, z = map(Fraction, v)
    return x, y, z


def minus(p: Vector, q: Vector) -> Vector:
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


def cross(p: Vector, q: Vector) -> Vector:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


def times(p: Vector, q: Vector) -> Fraction:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def sign(x: Fraction) -> int:
    return (x > 0) - (x < 0)


def meets(origin: Vector, w: Vector, corners: Sequence[Vector]) -> Fraction | None:
    """The t > 0 at which the ray origin + t w meets a triangle: with w + (e, e^2, e^3) at its edges."""
    A, B, C = (minus(corner, origin) for corner in corners)
    normal = cross(minus(B, A), minus(C, A))
    depth = times(normal, A)
    if depth == 0:
        return None
    for P, Q in ((A, B), (B, C), (C, A)):
        edge = cross(P, Q)
        if next(sign(x) for x in (times(edge, w), *edge) if x) != sign(depth):
            return None
    return depth / times(normal, w)


def corners_of(scene: Scene) -> Iterator[tuple[int, int, list[Vector]]]:
    for mesh in scene.meshes:
        for i, face in enumerate(mesh.geometry.faces):
            yield mesh.number, i, [exactly(mesh.vertices[v].tolist()) for v in face]


def nearest(scene: Scene, origin: Vector, w: Vector, own: tuple[int, int] | None = None) -> Hit | None:
    """What a ray meets first, but for the triangle `own`, by which it leaves; at one t, what w + (e, e^2, e^3) does."""
    best: tuple[Hit, Vector] | None = None
    for number, i, corners in corners_of(scene):
        t = meets(origin, w, corners) if (number, i) != own else None
        if t is None:
            continue
        # In the plane, n.(p - origin) = 1: so 1 / t = n.w, and the larger one is met first.
        A, B, C = (minus(corner, origin) for corner in corners)
        normal = cross(minus(B, A), minus(C, A))
        n = exactly([x / times(normal, A) for x in normal])
        further = (t,) if best is None else (best[0][0] - t, *minus(n, best[1]))
        if next((x for x in further if x), Fraction(0)) > 0:
            best = (t, number, i), n
    return best[0] if best else None


def triangle_point(corners: Sequence[Vector], corner: int, u: float, v: float) -> Vector:
    """V + u (V' - V) + v (V'' - V): from one of the corners, and the next ones."""
    V, V1, V2 = (corners[(corner + i) % 3] for i in range(3))
    a, b = Fraction(u), Fraction(v)
    return exactly([p + a * (q - p) + b * (r - p) for p, q, r in zip(V, V1, V2, strict=True)])


def in_world(scene: Scene, d: Direction) -> Vector:
    axes = [exactly(row) for row in scene.camera.basis()]
    return exactly([sum((Fraction(e) * row[i] for e, row in zip(d, axes, strict=True)), Fraction(0)) for i in range(3)])


def grid_mesh(rng: np.random.Generator, count: int = 12) -> Mesh:
    """Triangles between small whole numbers: many share edges and corners, or planes with other things."""
    vertices = rng.integers(-2, 3, (10, 3))
    return Mesh(vertices, rng.integers(0, 10, (count, 3)))


def doubles_mesh(rng: np.random.Generator, offset: float) -> Mesh:
    """Around a corner, and with needles: corners that are all but on the edges of others."""
    vertices = rng.normal(size=(9, 3)) + offset * rng.normal(size=3)
    vertices[5:8] = vertices[0:3] + (vertices[1:4] - vertices[0:3]) * rng.choice([0.5, 0.25, 1 / 3], (3, 1))
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 5, 2], [2, 6, 3], [0, 5, 1], [3, 7, 4], [8, 5, 6]]
    return Mesh(vertices, faces)
