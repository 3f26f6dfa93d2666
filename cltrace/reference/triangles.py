"""Meshes and their triangles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from cltrace.exact.lines import Line, Root
from cltrace.exact.shapes import Across, ExactTriangle
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start, Way, exact_line, way_of
from cltrace.reference.surfaces import UV, Intersection, Setting, Shape, Surface, way_along
from cltrace.reference.vectors import Direction, Matrix, Point, size_of
from cltrace.scene import PlacedMesh

if TYPE_CHECKING:
    from cltrace.reference.clipping import Entry

Weights = tuple[float, float, float]  # of a triangle's corners A, B and C, which add up to 1


class TriangleMesh(Shape):
    """Triangles. of: the scene's."""

    kind = "mesh"

    def __init__(self, of: PlacedMesh, setting: Setting) -> None:
        self.of, self.number, self.view = of, of.number, setting.view
        self.material, self.clipped = setting.material(of.material), of.clipped
        self.normal_to_world = Matrix(*(Direction(*row) for row in of.normal_to_world.tolist()))
        self.triangle = cache(partial(Triangle, self))

    def contains(self, entry: Entry) -> bool:
        """By an odd number of triangles beyond the point, which none of them holds."""
        if not self.of.geometry.closed:
            return False
        met = (part.exact.met_by(entry.height.line) for part in self.parts(entry.ray))
        sides = [entry.height.sign_at(across.root) for across in met if across]
        return 0 not in sides and sides.count(1) % 2 == 1

    def parts(self, ray: Ray | ShadowRay) -> Iterator[Triangle]:
        """The triangles that a ray may meet, in order. All others it surely passes by.

        Seen from its start, a ray along w is where w x P = 0, and w.P > 0. Two coordinates of w x P, those that have
        the largest number w_k of w, are linear in P, and 0 where the ray meets a triangle. That is between its corners,
        so neither may be > 0 at all three corners, or < 0, nor may w.P be < 0 there.

        The corners are off by 48 u (M + reach), u = 2^-53, where M is the largest distance of one; see rays.Way. A
        coordinate of w x P is then off by 51 u (M + reach) |w|, and so is w.P. As w is off by 48 u w1, these are not
        quite 0 on the ray: at a distance of M at most, which is t <= 2 M / |w|, by 2 * 48 u w1 |w| t, or 192 u w1 M.
        With w1 <= 4 |w|_1, all of it is below 2^-41 (M + reach) |w|_1.
        """
        faces, way = self.of.geometry.faces, way_along(ray, self.view)
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


def meshes(setting: Setting) -> Iterator[TriangleMesh]:
    """Those of a scene."""
    return (TriangleMesh(of, setting) for of in setting.scene.meshes)


@dataclass(frozen=True, slots=True)
class Rough:
    """A double and a bound of its error."""

    value: float
    error: float

    def sign(self) -> int | None:
        """The sign of the exact value, None if it is in doubt. It is never known to be 0."""
        if self.value > self.error:
            return 1
        return -1 if self.value < -self.error else None


class RoughFace:
    """A triangle in doubles. places: A, B and C in the world; e1, e2: from A to B and to C; N: e1 x e2; g, h, size: the
    sizes of e1 and e2, and their sum."""

    def __init__(self, A: Point, B: Point, C: Point) -> None:
        self.places, self.e1, self.e2 = (A, B, C), B - A, C - A
        self.N, self.g, self.h = self.e1.cross(self.e2), size_of(self.e1), size_of(self.e2)
        self.size = self.g + self.h


class Crossing:
    """What doubles know of a ray and a triangle. Each value is a Rough one: with the bound of its error.

    The formulas are those of ExactTriangle, in a form that keeps their digits. Seen from the start O, with A' = A - O,

        e1 = B - A,  e2 = C - A,  N = e1 x e2,  R = A' x w,
        D = A'.N,  den = N.w,  E_AB = w.(A' x B') = -e1.R,  E_CA = w.(C' x A') = e2.R,  E_BC = (den - E_CA) - E_AB,

    the triangle is met where the three E have the sign of D, at t = D / den. Nothing is formed from two far points: all
    is as good as the way to A and the edges are, wherever in the world that is.

    Bounds, in which u = 2^-53, |x|_1 sums a vector's magnitudes, g = |e1|_1, h = |e2|_1, s = |A'|_1 + reach, and w1 is
    |w|_1, of a ray from a light |w|_1 + reach:

        A'. From the eye or a light, rounded once: u s. From a sphere, 48 u s, as rays.Way has it for f; from a
            triangle less.
        w.  Turned from camera space: 5.2 u |w|. From a light to a point, P - L is A' of that point: 48 u w1.
        e1, e2: u g, u h.    N: 2 u g h for the edges, 3 u g h for products and sums: 5 u g h.
        R.  48 u s w1 for A', 48 u s w1 for w, and 3 u s w1: 99 u s w1.
        E_AB, E_CA. 99 u s w1 for R, u for the edge, 3 u for the sums, each times g or h: < 2^-46 s w1 (g + h).
        den. 5 u for N, 48 u for w, 3 u for the sums:   < 2^-46 g h w1.
        D.   48 u for A', 5 u for N, 3 u for the sums:  < 2^-46 s g h.
        E_BC. Those of den, E_CA and E_AB, and u for each of the two differences, of what they yield.

    The bounds that are taken are larger, which leaves room for the rounding of the sizes themselves: for E_AB and E_CA
    2^-44 s w1 (g + h), 2^-46 g h w1 for den, both together for E_BC, and 2^-45 s g h for D.
    """

    def __init__(self, triangle: RoughFace, way: Way) -> None:
        e1, e2, N, w = triangle.e1, triangle.e2, triangle.N, way.w
        to_a = way.to(triangle.places[0])
        R, den = to_a.cross(w), N.dot(w)
        ab, ca = -e1.dot(R), e2.dot(R)
        s, gh, w1 = size_of(to_a) + way.reach, triangle.g * triangle.h, way.w1
        bound, den_error = 2.0**-44 * s * w1 * (triangle.g + triangle.h), 2.0**-46 * w1 * gh
        self.w1, self.reach = w1, way.reach
        self.D, self.den = Rough(to_a.dot(N), 2.0**-45 * s * gh), Rough(den, den_error)
        self.ab, self.ca = Rough(ab, bound), Rough(ca, bound)
        self.bc = Rough((den - ca) - ab, bound + den_error)
        # |den| times how far the point of weights() is off: each weight, which is at most 1, by its part of |den|.
        self.off = (bound + den_error) * triangle.size

    @cached_property
    def side(self) -> int | None:
        """The sign of N.w if the ray meets the triangle, 0 if it does not; None if doubles are not sure."""
        signs = [x.sign() for x in (self.D, self.ab, self.bc, self.ca)]
        known = {sign for sign in signs if sign is not None}
        if len(known) == 2:
            return 0
        return None if None in signs else known.pop()

    @property
    def ends_beyond(self) -> bool | None:
        """Of a ray that surely meets the triangle: whether its point at t = 1 is strictly beyond the plane."""
        rest = Rough(self.den.value - self.D.value, self.den.error + self.D.error).sign()
        return None if rest is None else rest == self.side

    @property
    def t(self) -> float | None:
        """Where the ray is in the plane, right to 2^-24 of itself; None if doubles cannot tell."""
        D, den = self.D, self.den
        if D.error <= 2.0**-26 * abs(D.value) and den.error <= 2.0**-26 * abs(den.value):
            return D.value / den.value
        return None

    @property
    def has_point(self) -> bool:
        """Of a ray that meets the triangle: whether the point of weights() is off by at most 2^-24 of the way to it.

        That way begins at the corner from which the ray's start is counted, or at the eye.

        Where edges are millions of times as long as a triangle is wide, N has lost its digits, and it is not so.
        Elsewhere these weights are the kernel's, also on an edge.
        """
        return self.off <= 2.0**-24 * (abs(self.D.value) * self.w1 + abs(self.den.value) * self.reach)

    def weights(self) -> tuple[float, float]:
        """Of the corners B and C, where the ray is in the plane; not below 0."""
        return _positive_quotient(self.ca.value, self.den.value), _positive_quotient(self.ab.value, self.den.value)


class Triangle(RoughFace, Surface):
    """The points a A + b B + c C with a, b, c >= 0 and a + b + c = 1. Both sides are seen.

    A ray o + t w is in its plane where t w.N = (A - o).N, with N = (B - A) x (C - A). There it is in the triangle if it
    passes all three edges on the same side: A to B, B to C and C to A go round the triangle. Crossing computes that in
    doubles; ExactTriangle says who owns an edge, and decides what doubles cannot.

    primitive: its number in the mesh; front: 1 if N points to the outside, -1 if to the inside; normals: the corners',
    in the object's space, or None; uvs: where the corners are in the texture.
    """

    kind = "mesh"

    def __init__(self, mesh: TriangleMesh, primitive: int) -> None:
        self.mesh, self.primitive, self.number = mesh, primitive, mesh.number
        self.view, self.material, self.front = mesh.view, mesh.material, int(mesh.of.front[primitive])
        self.clipped = mesh.clipped
        shape = mesh.of.geometry
        super().__init__(*(Point(*place) for place in mesh.of.vertices[shape.faces[primitive]].tolist()))
        normal_of, uv_of = shape.normal_of[primitive], shape.uv_of[primitive]
        self.normals = [Direction(*n) for n in shape.normals[normal_of].tolist()] if normal_of[0] >= 0 else None
        self.shape = "smooth" if self.normals else "flat"
        self.uvs: Sequence[UV] = shape.uv[uv_of].tolist() if uv_of[0] >= 0 else [(0.0, 0.0)] * 3

    @cached_property
    def exact(self) -> ExactTriangle:
        """The triangle as the exact engine has it."""
        return ExactTriangle(self.places)

    @cached_property
    def seen_corners(self) -> list[Point]:
        """In camera space, rounded."""
        return [self.view.seen(corner) for corner in self.exact.corners]

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
        crossing = Crossing(self, ray.way_of_light) if ray.way_of_light else None
        if crossing and crossing.side is not None:
            sure = crossing.side != 0 and (ray.light.parallel or crossing.ends_beyond)
            if sure is not None:
                return sure
        return self.exact.first(ray.line_of_light, 0.0, ray.t_max) is not None

    def blocking_root(self, ray: ShadowRay) -> tuple[Line, Root]:
        across = self.exact.met_by(ray.line_of_light)
        assert across
        return ray.line_of_light, across.root

    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        crossing = self._crossing(ray)
        sure: Crossing | Across
        point: Crossing | Across
        if crossing and crossing.side and crossing.has_point:
            sure = point = crossing
        else:
            sure = self._met_by(ray)
            point = crossing if crossing and crossing.has_point else sure
        b, c = point.weights()
        start = self.start(*nearest_corner((1 - b) - c, b, c))
        normal, inside = self.normal(weights_of(*start.on)), sure.side == self.front
        turned = normal.dot(ray.direction) > 0
        return Intersection(
            point=ray.at(t),
            t=t,
            distance=t * math.sqrt(ray.direction.dot(ray.direction)),
            normal=-normal if turned else normal,
            inside=inside,
            start=start,
            material=self.material,
            uv=self.uv(weights_of(*start.on)),
            index=self.number,
            primitive=self.primitive,
            turned=turned,
        )

    def start(self, corner: int, u: float, v: float) -> Start:
        """The point of a ray's start: exactly V + u (V' - V) + v (V'' - V).

        corner: which of the three corners V is, the anchor; V' and V'' are those that come after it, going round; u, v:
        their weights, from LEAST to MOST. So the point is in the triangle's plane, and strictly within its edges: a ray
        from there meets the triangles beside it, or does not, as it must. On an edge it would be in their planes, too,
        and no ray that starts in a plane meets it.
        """
        V, V1, V2 = (self.places[(corner + i) % 3] for i in range(3))
        step = (V1 - V) * u + (V2 - V) * v
        seen, from_anchor = self.seen_corners[corner], self.view.B @ step
        exact = partial(self.exact.point, corner, u, v)
        # |V' - V| u + |V'' - V| v is less: no edge is longer than the other two, and u and v are at most 1/2.
        reach = self.size
        return Start(self, self.view, V, seen, step, from_anchor, reach, seen + from_anchor, exact, on=(corner, u, v))

    def _is_left_by(self, start: Point | Start) -> bool:
        """It is flat: what leaves it never meets it again."""
        return isinstance(start, Start) and start.surface is self

    def _crossing(self, ray: Ray) -> Crossing | None:
        way = way_of(ray, self.view)
        return Crossing(self, way) if way else None

    def _across(self, ray: Ray) -> Across | None:
        """How the ray meets the triangle within its range, exactly; None if it does not."""
        across = self.exact.met_by(exact_line(ray, self.view))
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
        return self.view.B @ (m * (1 / math.sqrt(m.dot(m))))

    def _exact_normal(self) -> Direction:
        """N of length about 1, for triangles so narrow that in doubles it vanishes."""
        N = self.exact.normal
        largest = max(map(abs, N))
        return Direction(*(x / largest for x in N))

    def uv(self, weights: Weights) -> UV:
        (a, b, c), (A, B, C) = weights, self.uvs
        return (a * A[0] + b * B[0]) + c * C[0], (a * A[1] + b * B[1]) + c * C[1]


LEAST, MOST = 2.0**-64, 0.5  # of the weights of a start


def nearest_corner(*weights: float) -> tuple[int, float, float]:
    """The corner that the point of these weights is nearest to by them, and those of the two that come after it."""
    # Rounding may leave nothing for the first one.
    w = [x if x > 0 else 0.0 for x in weights]
    k = w.index(max(w))
    u, v = (max(LEAST, min(MOST, x)) for x in (w[k - 2], w[k - 1]))
    return k, u, v


def weights_of(corner: int, u: float, v: float) -> Weights:
    """The weights of a triangle's corners A, B and C at the point of a start."""
    from_v = ((1 - u) - v, u, v)
    return from_v[-corner], from_v[1 - corner], from_v[2 - corner]


def _positive_quotient(x: float, y: float) -> float:
    """x / y as a processor divides, but 0 if it is below, or 0 / 0."""
    if y == 0:
        return math.inf if x != 0 and (x > 0) == (math.copysign(1, y) > 0) else 0.0
    q = x / y
    return q if q > 0 else 0.0
