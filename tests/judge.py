"""An independent judge of what rays meet: surfaces as plain numbers, straight from their definitions, in many digits.

It imports nothing from cltrace. Doubles are exact in mpmath, and what differs by less than NEAR of its terms is equal:
with DIGITS digits, numbers that come from so few doubles differ by far more, or not at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import mpmath
from mpmath import mpf

DIGITS = 1000
NEAR = mpf(10) ** -400
Vector = list[Any]


def vector(v: Iterable[Any]) -> Vector:
    return [x if isinstance(x, mpmath.mpf) else mpf(float(x)) for x in v]


def dot(u: Vector, v: Vector) -> Any:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def minus(u: Vector, v: Vector) -> Vector:
    return [a - b for a, b in zip(u, v, strict=True)]


def cross(u: Vector, v: Vector) -> Vector:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def product(rows: Sequence[Sequence[float]], v: Vector) -> Vector:
    return [dot(vector(row), v) for row in rows]


def settled(x: Any, *terms: Any) -> Any:
    """0 where x is next to nothing beside the terms whose sum it is."""
    return x if abs(x) > NEAR * max(map(abs, terms)) else mpf(0)


@dataclass(frozen=True)
class Ball:
    """|K (p - center)| = radius, K = 1 where there is none."""

    center: Sequence[float]
    radius: float
    to_object: Sequence[Sequence[float]] | None = None

    def met(self, o: Vector, w: Vector) -> list[Any]:
        """The t of both ends of the way through, by the formula of the school book."""
        K = self.to_object if self.to_object is not None else ((1, 0, 0), (0, 1, 0), (0, 0, 1))
        return roots(product(K, minus(o, vector(self.center))), product(K, w), mpf(float(self.radius)))

    @mpmath.workdps(DIGITS)
    def point(self, normal: Sequence[float]) -> Vector:
        """center + radius K^-1 n / |n|."""
        n = vector(normal)
        length = mpmath.sqrt(dot(n, n))
        step = [mpf(float(self.radius)) * x / length for x in n]
        if self.to_object is not None:
            K = mpmath.matrix([vector(row) for row in self.to_object])
            step = list(mpmath.lu_solve(K, mpmath.matrix(step)))
        return [c + x for c, x in zip(vector(self.center), step, strict=True)]


def roots(v: Vector, w: Vector, r: Any) -> list[Any]:
    """Where |v + t w| = r; the same twice where the line touches."""
    a, b, c = dot(w, w), dot(v, w), settled(dot(v, v) - r * r, dot(v, v), r * r)
    if a == 0:
        return []
    b = settled(b, *(x * y for x, y in zip(v, w, strict=True)))
    D = settled(b * b - a * c, b * b, a * dot(v, v), a * r * r)
    if D < 0:
        return []
    root = mpmath.sqrt(D)
    ends = [(-b - root) / a, (-b + root) / a]
    return [settled(t, b / a, root / a) if c == 0 else t for t in ends]


@dataclass(frozen=True)
class Cylinder:
    """A solid cylinder with flat ends: |(p - S) x u| <= r |u| and 0 <= (p - S).u <= u.u, with u = end - start."""

    start: Sequence[float]
    end: Sequence[float]
    radius: float

    def met(self, o: Vector, w: Vector) -> list[Any]:
        """From the later one of the two beginnings to the earlier one of the two ends."""
        S, r = vector(self.start), mpf(float(self.radius))
        u = minus(vector(self.end), S)
        v, uu = minus(o, S), dot(u, u)
        g, h = settled(dot(w, u), *(x * y for x, y in zip(w, u, strict=True))), dot(v, u)
        ends = [(mpf("-inf"), mpf("inf"))]
        across = cross(w, u)
        if max(map(abs, across)) > NEAR * max(map(abs, w)) * max(map(abs, u)):
            way = roots(cross(v, u), across, r * mpmath.sqrt(uu))
            if not way:
                return []
            ends.append((way[0], way[1]))
        elif dot(cross(v, u), cross(v, u)) > r * r * uu * (1 + NEAR):
            return []
        if g:
            flat = sorted((settled(-h / g, 1), (uu - h) / g))
            ends.append((flat[0], flat[1]))
        elif not -NEAR * uu <= h <= uu * (1 + NEAR):
            return []
        begin, end = max(x for x, _ in ends), min(y for _, y in ends)
        return [begin, end] if begin <= end + NEAR * abs(end) else []


@dataclass(frozen=True)
class Flat:
    """A triangle. At its edges it is met as the ray along w + (e, e^2, e^3) meets it, for every small e > 0."""

    corners: Sequence[Sequence[float]]

    def plane(self, o: Vector) -> Vector | None:
        """n, with n.(p - o) = 1 in the plane; None where o is in it."""
        A, B, C = (minus(vector(corner), o) for corner in self.corners)
        N = cross(minus(B, A), minus(C, A))
        D = settled(dot(A, N), *(x * y for x, y in zip(A, N, strict=True)))
        return [x / D for x in N] if D else None

    def met(self, o: Vector, w: Vector) -> list[Any]:
        n, sides = self.plane(o), set()
        if n is None:
            return []
        A, B, C = (minus(vector(corner), o) for corner in self.corners)
        for P, Q in ((A, B), (B, C), (C, A)):
            edge = [settled(x * y - z * k, x * y, z * k) for x, y, z, k in (
                (P[1], Q[2], P[2], Q[1]), (P[2], Q[0], P[0], Q[2]), (P[0], Q[1], P[1], Q[0])
            )]  # fmt: skip
            along = settled(dot(edge, w), *(x * y for x, y in zip(edge, w, strict=True)))
            sides.add(next((x > 0 for x in (along, *edge) if x), None))
        return [1 / dot(n, w)] if len(sides) == 1 else []


Surface = Ball | Cylinder | Flat
Named = tuple[int, int, Surface]


def surfaces_of(scene: Any) -> list[Named]:
    """Number, primitive and the plain numbers of all surfaces of a scene, by rising numbers."""
    found: list[Named] = []
    for number, one in zip(scene.sphere_numbers.tolist(), scene.spheres, strict=True):
        K = scene.to_object[one["to_object"]].tolist() if one["to_object"] >= 0 else None
        found.append((number, -1, Ball(one["center"].tolist(), float(one["radius"]), K)))
    for one in scene.cylinders:
        found.append(
            (int(one["number"]), -1, Cylinder(one["start"].tolist(), one["end"].tolist(), float(one["radius"])))
        )
    for mesh in scene.meshes:
        corners = mesh.vertices[mesh.geometry.faces].tolist()
        found += [(mesh.number, i, Flat(three)) for i, three in enumerate(corners)]
    return sorted(found, key=lambda one: one[:2])


@mpmath.workdps(DIGITS)
def in_world(scene: Any, d: Iterable[Any]) -> Vector:
    """B^T d, which is not rounded, for the camera's axes B."""
    return product(list(zip(*scene.camera.basis(), strict=True)), vector(d))


@mpmath.workdps(DIGITS)
def first(
    surfaces: Sequence[Surface], o: Iterable[Any], w: Iterable[Any], t_min: float = 0.0, t_max: float = mpmath.inf
) -> tuple[int, Any]:
    """The surface that o + t w meets first, strictly between t_min and t_max, and t; -1 and infinity for none.

    Of equally near ones that is the lowest, but of triangles the one that the ray along w + (e, e^2, e^3) meets first.
    """
    place, way = vector(o), vector(w)
    best, index = mpmath.inf, -1
    for i, surface in enumerate(surfaces):
        for t in surface.met(place, way):
            if not (t > t_min + NEAR * abs(t) and t < t_max - NEAR * abs(t)):
                continue
            other = surfaces[index]
            if index < 0 or t < best - NEAR * abs(t):
                best, index = t, i
            elif t <= best + NEAR * abs(t) and isinstance(surface, Flat) and isinstance(other, Flat):
                n, m = surface.plane(place), other.plane(place)
                assert n is not None
                assert m is not None
                gaps = [settled(x - y, x, y) if x or y else mpf(0) for x, y in zip(n, m, strict=True)]
                if next((x for x in gaps if x), mpf(0)) > 0:
                    index = i
            break
    return index, best


@mpmath.workdps(DIGITS)
def between(surfaces: Sequence[Surface], o: Iterable[Any], light: Iterable[Any], parallel: bool) -> bool:
    """Whether anything is strictly between a point and a light; light: its place, or the direction in which it shines.

    Triangles are asked as the light comes, which decides at their edges.
    """
    p, l = vector(o), vector(light)  # noqa: E741
    way = [-x for x in l] if parallel else minus(l, p)
    far = mpmath.inf if parallel else 1 - NEAR
    if max(map(abs, way)) <= NEAR * max(1, *map(abs, p), *map(abs, l)):
        return False
    for surface in surfaces:
        back = isinstance(surface, Flat) and not parallel
        ends = surface.met(l, [-x for x in way]) if back else surface.met(p, way)
        if any(NEAR < t < far for t in ends):
            return True
    return False


@mpmath.workdps(DIGITS)
def is_rounded(t: float, exact: Any) -> bool:
    """Whether t is the double nearest to a number, or as near as another one."""
    if not mpmath.isfinite(exact) or t == 0:
        return bool(exact == t)
    around = [abs(mpf(x) - exact) for x in _neighbours(float(t))]
    return bool(abs(mpf(float(t)) - exact) <= min(around) * (1 + NEAR))


def _neighbours(t: float) -> list[float]:
    return [x for x in (math.nextafter(t, -math.inf), math.nextafter(t, math.inf)) if abs(x) != math.inf]
