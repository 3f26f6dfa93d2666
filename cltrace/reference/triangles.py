"""Meshes and their triangles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cltrace.reference.crossing import Crossing, RoughFace, Way, shadow_way, way_of
from cltrace.reference.doubt import size_of
from cltrace.reference.exact import Root, Vector, between, vector
from cltrace.reference.face import Across, Face
from cltrace.reference.groups import Group
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start
from cltrace.reference.surfaces import Intersection, Setting, Surface
from cltrace.reference.texture import UV
from cltrace.reference.vectors import Direction, Matrix, Point
from cltrace.scene import PlacedMesh

Weights = tuple[float, float, float]  # of a triangle's corners A, B and C, which add up to 1


@dataclass(frozen=True)
class OnTriangle(Start):
    """A point of a triangle: exactly V + u (V' - V) + v (V'' - V).

    corner: which of the three corners V is, the anchor; V' and V'' are those that come after it, going round; u, v:
    their weights, from 2^-64 to 1/2. So the point is in the triangle's plane, and strictly within its edges: a ray from
    there meets the triangles beside it, or does not, as it must. On an edge it would be in their planes, too, and no
    ray that starts in a plane meets it.
    """

    LEAST, MOST = 2.0**-64, 0.5

    triangle: Triangle
    corner: int
    u: float
    v: float

    @classmethod
    def near(cls, triangle: Triangle, weights: Weights) -> OnTriangle:
        """The point of these weights, but for rounding, from the corner that it is nearest to by them."""
        k = weights.index(max(weights))
        u, v = (max(cls.LEAST, min(cls.MOST, w)) for w in (weights[k - 2], weights[k - 1]))
        return cls(triangle, k, u, v)

    @property
    def weights(self) -> Weights:
        """Of the triangle's corners A, B and C."""
        from_v = ((1 - self.u) - self.v, self.u, self.v)
        return from_v[-self.corner], from_v[1 - self.corner], from_v[2 - self.corner]

    @property
    def surface(self) -> Triangle:
        return self.triangle

    @property
    def place(self) -> Point:
        return self.triangle.places[self.corner]

    @cached_property
    def anchor(self) -> Point:
        return self.triangle.seen_corner(self.corner)

    @cached_property
    def step(self) -> Direction:
        V, V1, V2 = (self.triangle.places[(self.corner + i) % 3] for i in range(3))
        return (V1 - V) * self.u + (V2 - V) * self.v

    @property
    def reach(self) -> float:
        """By |V' - V| u + |V'' - V| v: no edge is longer than the other two, and u and v are at most 1/2."""
        return self.triangle.size

    @property
    def error(self) -> float:
        """With u = 2^-53: a difference rounds by u, a product and the sum by u each, and turning by 5.2 u of |step|."""
        return self.reach * 2.0**-49

    @cached_property
    def exact_point(self) -> Vector:
        return vector(self.triangle.face.point(self.corner, self.u, self.v))


class Mesh(Group):
    """Triangles, of which a ray meets the nearest one; of equally near ones, the one of the lowest number.

    of: the scene's.
    """

    kind = "mesh"

    def __init__(self, of: PlacedMesh, setting: Setting) -> None:
        super().__init__(of.number, setting.eye, setting.frame)
        self.of, self.material = of, setting.material(of.material)
        self.normal_to_world = Matrix(*(Direction(*row) for row in of.normal_to_world.tolist()))
        self._triangles: dict[int, Triangle] = {}

    def triangle(self, primitive: int) -> Triangle:
        if primitive not in self._triangles:
            self._triangles[primitive] = Triangle(self, primitive)
        return self._triangles[primitive]

    def near(self, way: Way | None) -> Iterator[Triangle]:
        """The triangles that a ray may meet, in order. All others it surely passes by.

        Seen from its start, a ray along w is where w x P = 0, and w.P > 0. Two coordinates of w x P, those that have
        the largest number w_k of w, are linear in P, and 0 where the ray meets a triangle. That is between its corners,
        so neither may be > 0 at all three corners, or < 0, nor may w.P be < 0 there.

        The corners are off by 48 u (M + reach), u = 2^-53, where M is the largest distance of one; see crossing.py. A
        coordinate of w x P is then off by 51 u (M + reach) |w|, and so is w.P. As w is off by 48 u w1, these are not
        quite 0 on the ray: at a distance of M at most, which is t <= 2 M / |w|, by 2 * 48 u w1 |w| t, or 192 u w1 M.
        With w1 <= 4 |w|_1, all of it is below 2^-41 (M + reach) |w|_1.
        """
        faces = self.of.geometry.faces
        rows = np.arange(len(faces))
        if way is not None and way.w1 <= 4 * size_of(way.w):
            w = np.array(tuple(way.w))
            P = (self.of.vertices - np.array(tuple(way.place))) - np.array(tuple(way.step))
            error = 2.0**-41 * (np.abs(P).sum(axis=1).max(initial=0.0) + way.reach) * size_of(way.w)
            k = int(np.argmax(np.abs(w)))
            across = [P[:, i] * w[k] - P[:, k] * w[i] for i in range(3) if i != k]
            sides = [side > error for x in across for side in (x, -x)] + [P @ w < -error]
            beside = np.packbits(sides, axis=0, bitorder="little")[0]  # one bit of each vertex for each side
            rows = np.flatnonzero((beside[faces[:, 0]] & beside[faces[:, 1]] & beside[faces[:, 2]]) == 0)
        for row in rows.tolist():
            yield self.triangle(row)


def meshes(setting: Setting) -> Iterator[Mesh]:
    """Those of a scene."""
    return (Mesh(of, setting) for of in setting.scene.meshes)


class Triangle(RoughFace, Surface):
    """The points a A + b B + c C with a, b, c >= 0 and a + b + c = 1. Both sides are seen.

    A ray o + t w is in its plane where t w.N = (A - o).N, with N = (B - A) x (C - A). There it is in the triangle if it
    passes all three edges on the same side: A to B, B to C and C to A go round the triangle. crossing.py computes that
    in doubles; face.Face says who owns an edge, and decides what doubles cannot.

    primitive: its number in the mesh; front: 1 if N points to the outside, -1 if to the inside; normals: the corners',
    in the object's space, or None; uvs: where the corners are in the texture.
    """

    kind = "mesh"

    def __init__(self, mesh: Mesh, primitive: int) -> None:
        self.mesh, self.primitive, self.number = mesh, primitive, mesh.number
        self.frame, self.material, self.front = mesh.frame, mesh.material, int(mesh.of.front[primitive])
        shape = mesh.of.geometry
        super().__init__(*(Point(*place) for place in mesh.of.vertices[shape.faces[primitive]].tolist()))
        normal_of, uv_of = shape.normal_of[primitive], shape.uv_of[primitive]
        self.normals = [Direction(*n) for n in shape.normals[normal_of].tolist()] if normal_of[0] >= 0 else None
        self.shape = "smooth" if self.normals else "flat"
        self.uvs: Sequence[UV] = shape.uv[uv_of].tolist() if uv_of[0] >= 0 else [(0.0, 0.0)] * 3

    @cached_property
    def face(self) -> Face:
        """The triangle, exactly, from the eye."""
        a, b, c = (between(self.mesh.eye, place) for place in self.places)
        return Face((a, b, c))

    def seen_corner(self, corner: int) -> Point:
        """A corner in camera space, rounded."""
        return Point(*map(float, self.frame.to_camera(self.face.corners[corner])))

    def intersect(self, ray: Ray) -> float | None:
        if self._is_left_by(ray.origin):
            return None
        crossing = self._crossing(ray)
        side = crossing.side if crossing else None
        if side == 0 or (side is None and self._across(ray) is None):
            return None
        t = crossing.t if crossing else None
        return float(self.exact_t(ray)) if t is None else t

    def exact_t(self, ray: Ray) -> Root:
        return self._met_by(ray).root

    def blocks(self, ray: ShadowRay) -> bool:
        """From a light at a point, the ray that is asked about is the one that leads to the start of the shadow ray."""
        if self._is_left_by(ray.start):
            return False
        way = shadow_way(ray)
        crossing = Crossing(self, way) if way else None
        if crossing and crossing.side is not None:
            sure = crossing.side != 0 and (ray.light.parallel or crossing.ends_beyond)
            if sure is not None:
                return sure
        across = self.face.met_by(ray.line_of_light)
        return across is not None and across.root.is_between(0.0, ray.t_max)

    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        crossing = self._crossing(ray)
        sure: Crossing | Across
        point: Crossing | Across
        if crossing and crossing.side and crossing.has_point:
            sure = point = crossing
        else:
            sure = self._met_by(ray)
            point = crossing if crossing and crossing.has_point else sure
        start = OnTriangle.near(self, _three(*point.weights()))
        normal, inside = self.normal(start.weights), sure.side == self.front
        turned = normal.dot(ray.direction) > 0
        return Intersection(
            point=ray.at(t),
            t=t,
            distance=t * math.sqrt(ray.direction.dot(ray.direction)),
            normal=-normal if turned else normal,
            inside=inside,
            start=start,
            material=self.material,
            uv=self.uv(start.weights),
            index=self.number,
            primitive=self.primitive,
            turned=turned,
        )

    def _is_left_by(self, start: object) -> bool:
        """It is flat: what leaves it never meets it again."""
        return isinstance(start, OnTriangle) and start.triangle is self

    def _crossing(self, ray: Ray) -> Crossing | None:
        way = way_of(ray, self.frame, self.mesh.eye)
        return Crossing(self, way) if way else None

    def _across(self, ray: Ray) -> Across | None:
        """How the ray meets the triangle within its range, exactly; None if it does not."""
        across = self.face.met_by(ray.line(self.frame))
        return across if across and across.root.is_between(ray.t_min, ray.t_max) else None

    def _met_by(self, ray: Ray) -> Across:
        across = self._across(ray)
        if across is None:
            raise ValueError("the ray does not hit the surface")
        return across

    # What is at a point.

    def normal(self, weights: Weights) -> Direction:
        """The unit normal for shading there, in camera space, to either side of the triangle.

        Interpolated in the object's space, and turned to the world as normals are, by the inverse transpose; N where
        there are none.
        """
        m = self.N
        if self.normals:
            (a, b, c), (A, B, C) = weights, self.normals
            m = self.mesh.normal_to_world @ ((A * a + B * b) + C * c)
        if not m.dot(m) > 0:
            m = self.N
        if not m.dot(m) > 0:
            m = self._exact_normal()
        return self.frame.B @ (m * (1 / math.sqrt(m.dot(m))))

    def _exact_normal(self) -> Direction:
        """N of length about 1, for triangles so narrow that in doubles it vanishes."""
        N = self.face.normal
        largest = max(map(abs, N))
        return Direction(*(float(x / largest) for x in N))

    def uv(self, weights: Weights) -> UV:
        (a, b, c), (A, B, C) = weights, self.uvs
        return (a * A[0] + b * B[0]) + c * C[0], (a * A[1] + b * B[1]) + c * C[1]


def _three(b: float, c: float) -> Weights:
    """The weights of all three corners from those of two. Rounding may leave nothing for the first one."""
    a = (1 - b) - c
    return (a if a > 0 else 0.0), b, c
