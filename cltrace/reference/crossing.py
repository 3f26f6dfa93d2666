"""A ray across a triangle's plane, in doubles: where, on which side of each edge, and of what doubles are sure.

The formulas are those of face.Face, in a form that keeps their digits. Seen from the start O, with A' = A - O,

    e1 = B - A,  e2 = C - A,  N = e1 x e2,  R = A' x w,
    D = A'.N,  den = N.w,  E_AB = w.(A' x B') = -e1.R,  E_CA = w.(C' x A') = e2.R,  E_BC = (den - E_CA) - E_AB,

the triangle is met where the three E have the sign of D, at t = D / den. Nothing is formed from two far points: all is
as good as the way to A and the edges are, wherever in the world that is.

Bounds, in which u = 2^-53, |x|_1 sums a vector's magnitudes, g = |e1|_1, h = |e2|_1, s = |A'|_1 + reach, and w1 is
|w|_1, of a ray from a light |w|_1 + reach:

    A'. From the eye or a light, rounded once: u s. From a sphere, 48 u s, as equation.FromSurface has it for f; from a
        triangle less.
    w.  Turned from camera space: 5.2 u |w|. From a light to a point, P - L is A' of that point: 48 u w1.
    e1, e2: u g, u h.    N: 2 u g h for the edges, 3 u g h for products and sums: 5 u g h.
    R.  48 u s w1 for A', 48 u s w1 for w, and 3 u s w1: 99 u s w1.
    E_AB, E_CA. 99 u s w1 for R, u for the edge, 3 u for the sums, each times g or h: < 2^-46 s w1 (g + h) = 128 u ...
    den. 5 u for N, 48 u for w, 3 u for the sums:   < 2^-46 g h w1.
    D.   48 u for A', 5 u for N, 3 u for the sums:  < 2^-46 s g h.
    E_BC. Those of den, E_CA and E_AB, and u for each of the two differences, of what they yield.

The bounds that are taken are larger, which leaves room for the rounding of the sizes themselves: 2^-44 s w1 (g + h) for
E_AB and E_CA, 2^-46 g h w1 for den, both together for E_BC, and 2^-45 s g h for D.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from cltrace.reference.doubt import Rough, size_of
from cltrace.reference.exact import Frame
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start
from cltrace.reference.vectors import Direction, Point

NOWHERE = Direction(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Way:
    """A ray in doubles: from place + step along w, all of them along the world's axes.

    place: exactly; w1: |w|_1, or more where w is off by more than its own size; reach: a bound of |step|.
    """

    place: Point
    w: Direction
    w1: float
    step: Direction = NOWHERE
    reach: float = 0.0

    def to(self, point: Point) -> Direction:
        return (point - self.place) - self.step


def way_of(ray: Ray, frame: Frame, eye: Point) -> Way | None:
    """eye: in the world. None if doubles may not decide about the ray."""
    if not ray.is_plain:
        return None
    w, start = frame.B.T @ ray.direction, ray.origin
    if isinstance(start, Start):
        return Way(start.place, w, size_of(w), step=start.step, reach=start.reach)
    return Way(eye, w, size_of(w))


def shadow_way(ray: ShadowRay) -> Way | None:
    """From a light at a point to where the shadow ray starts; to a parallel light from there."""
    start, site = ray.start, ray.light.site
    if not start.fits:
        return None
    if site is None:
        w = Direction(*map(float, ray.light.place))
        return Way(start.place, w, size_of(w), step=start.step, reach=start.reach)
    w = (start.place - site) + start.step
    return Way(site, w, size_of(w) + start.reach)


class RoughFace:
    """A triangle in doubles. places: A, B and C in the world; e1, e2: from A to B and to C; N: e1 x e2; g, h, size: the
    sizes of e1 and e2, and their sum."""

    def __init__(self, A: Point, B: Point, C: Point) -> None:
        self.places, self.e1, self.e2 = (A, B, C), B - A, C - A
        self.N, self.g, self.h = self.e1.cross(self.e2), size_of(self.e1), size_of(self.e2)
        self.size = self.g + self.h


class Crossing:
    """What doubles know of a ray and a triangle. Each value is a Rough one: with the bound of its error."""

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


def _positive_quotient(x: float, y: float) -> float:
    """x / y as a processor divides, but 0 if it is below, or 0 / 0."""
    if y == 0:
        return math.inf if x != 0 and (x > 0) == (math.copysign(1, y) > 0) else 0.0
    q = x / y
    return q if q > 0 else 0.0
