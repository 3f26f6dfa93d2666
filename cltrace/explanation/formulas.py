"""The intersection tests of the textbook, in doubles: the numbers that a student's own code has.

The ray is o + t d in the world, and d has length 1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cltrace.explanation.record import CylinderTest, SphereTest, TriangleTest
from cltrace.explanation.space import triple
from cltrace.reference.cylinder import Cylinder
from cltrace.reference.round import Round
from cltrace.reference.triangles import Mesh, Triangle
from cltrace.reference.vectors import Direction, Point


def sphere_test(sphere: Round, o: Point, d: Direction) -> SphereTest:
    C, R = sphere.place, sphere.radius
    to_start, way = sphere.seen(o - C), sphere.seen(d)
    a, b, c = way.dot(way), 2 * way.dot(to_start), to_start.dot(to_start) - R * R
    half = b / 2
    disc = half * half - a * c
    root = math.sqrt(disc) if disc >= 0 else math.nan
    t = ((-half - root) / a, (-half + root) / a) if disc >= 0 and a > 0 else ()
    own = sphere.ball.to_object is not None
    return SphereTest(triple(C), R, own, triple(to_start), direction=triple(way), a=a, b=b, c=c, discriminant=disc, t=t)


def triangle_test(triangle: Triangle, o: Point, d: Direction) -> TriangleTest:
    A, B, C = triangle.places
    N = (B - A).cross(C - A)
    d_n, area = d.dot(N), N.dot(N)
    t = (A - o).dot(N) / d_n if d_n else math.nan
    P = o + d * t
    # The triangle that P makes with an edge, as a share of the whole one.
    parts = [(Y - X).cross(P - X).dot(N) / area if area else math.nan for X, Y in ((B, C), (C, A), (A, B))]
    return TriangleTest(
        (triple(A), triple(B), triple(C)), triple(N), d_n=d_n, t=t, weights=(parts[0], parts[1], parts[2])
    )


def cylinder_test(cylinder: Cylinder, o: Point, d: Direction) -> CylinderTest:
    S, u = cylinder.start, cylinder.axis.normalized()
    to_start, length, R = o - S, cylinder.axis.length(), cylinder.radius
    along, speed = to_start.dot(u), d.dot(u)
    across, way = to_start - u * along, d - u * speed
    a, b, c = way.dot(way), 2 * way.dot(across), across.dot(across) - R * R
    disc = (b / 2) * (b / 2) - a * c
    root = math.sqrt(disc) if disc >= 0 else math.nan
    t = ((-b / 2 - root) / a, (-b / 2 + root) / a) if disc >= 0 and a > 0 else ()
    planes = (-along / speed, (length - along) / speed) if speed else (math.nan, math.nan)
    round_ = t or ((-math.inf, math.inf) if a == 0 and c <= 0 else (math.inf, -math.inf))
    between = sorted(planes) if speed else [-math.inf, math.inf] if 0 <= along <= length else [math.inf, -math.inf]
    inside = max(round_[0], between[0]), min(round_[1], between[1])
    return CylinderTest(
        triple(S),
        triple(cylinder.end),
        R,
        axis=triple(u),
        across=triple(across),
        way=triple(way),
        a=a,
        b=b,
        c=c,
        t=t,
        planes=planes,
        inside=inside if inside[0] <= inside[1] else (),
    )


def cylinder_gap(cylinder: Cylinder, o: Point, d: Direction) -> tuple[float, float]:
    """How far a ray passes by a cylinder, as if its ends were round, and at which t it is nearest to its axis."""
    f, u = cylinder.start - o, cylinder.axis
    g, uu, dd = d.dot(u), u.dot(u), d.dot(d)
    rest = dd * uu - g * g
    k = (f.dot(d) * g - f.dot(u) * dd) / rest if rest > 0 else 0.0
    near = f + u * max(0.0, min(1.0, k))
    t = near.dot(d) / dd
    return (near - d * t).length() - cylinder.radius, t


def sphere_gap(sphere: Round, o: Point, d: Direction) -> tuple[float, float]:
    """How far a ray passes by a sphere, and at which t it is nearest to it, of an ellipsoid in its own axes."""
    to_center, way = sphere.seen(sphere.place - o), sphere.seen(d)
    t = to_center.dot(way) / way.dot(way)
    across = way * t - to_center
    length = across.length()
    outside = across * (1 - sphere.radius / length) if length > 0 else across
    return math.copysign(_in_world(sphere, outside).length(), length - sphere.radius), t


def _in_world(sphere: Round, v: Direction) -> Direction:
    """Back from a sphere's own axes."""
    rows = sphere.ball.to_world
    return v if rows is None else Direction(*(Direction(*map(float, row)).dot(v) for row in rows))


def mesh_gaps(mesh: Mesh, o: Point, d: Direction) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
