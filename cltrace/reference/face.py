"""Triangles, exactly."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from cltrace.base.arithmetic import cross, dot, minus
from cltrace.reference.exact import Exact, Line, Plane, Rational, Root, sign_along, vector


@dataclass(frozen=True)
class Face:
    """A triangle by its corners A, B, C, from the eye along the world's axes.

    Seen from O, with A' = A - O and so on, a ray along w passes the edge AB on the side that is the sign of

        E = w . (A' x B'),    and likewise BC and CA.

    It meets the triangle where these three are the same. At an edge, E = 0, the sign is that of the first of the
    coordinates of A' x B' that is not 0: that is the side of the ray w + (e, e^2, e^3) for every small e > 0. So one
    and the same ray is asked about everywhere, and of all triangles around an edge or a corner, exactly one has it on
    each side where the surface goes on.

    With N = (B - A) x (C - A), the three add up to N.w, and the ray is in the plane at t = A'.N / N.w. Where A'.N = 0,
    as the ray starts in the plane or the triangle has no area, it is not met. So not all coordinates of A' x B' are 0.

    Where a ray meets two triangles at one t, that ray decides, too. At the edge of a box, which hides its other side,
    it meets the face in front before that behind; they are at different t unless they are in one plane.
    """

    corners: tuple[Rational, Rational, Rational]

    def point(self, corner: int, u: Fraction | float, v: Fraction | float) -> Rational:
        """V + u (V' - V) + v (V'' - V): from one of the corners, and the next ones going round."""
        V, V1, V2 = (self.corners[(corner + i) % 3] for i in range(3))
        a, b = Fraction(u), Fraction(v)
        x, y, z = (p + a * (q - p) + b * (r - p) for p, q, r in zip(V, V1, V2, strict=True))
        return x, y, z

    @cached_property
    def normal(self) -> Rational:
        """N."""
        A, B, C = (vector(corner) for corner in self.corners)
        x, y, z = cross(minus(B, A), minus(C, A))
        return x.p, y.p, z.p

    def met_by(self, line: Line) -> Across | None:
        """Where a line meets the triangle, and how; None if it does not."""
        A, B, C = (minus(vector(corner), line.start) for corner in self.corners)
        N = vector(self.normal)
        D = dot(A, N)
        edges = cross(A, B), cross(B, C), cross(C, A)
        sides = {sign_along(line.direction, edge) for edge in edges} if D.sign() else {1, -1}
        if len(sides) > 1:
            return None
        (side,) = sides
        plane = Plane(line.direction, (N[0].times(side), N[1].times(side), N[2].times(side)), D.times(side))
        ab, _, ca = (dot(edge, line.direction) for edge in edges)
        return Across(side, plane, ca.times(side), ab.times(side))


@dataclass(frozen=True)
class Across:
    """A line across a triangle. side: the sign of N.w, 1 for a ray that goes the way of N.

    plane: the triangle's; by_b, by_c: side times E of the edges CA and AB, which are |N.w| times the weights of the
    corners B and C.
    """

    side: int
    plane: Plane
    by_b: Exact
    by_c: Exact

    @property
    def root(self) -> Root:
        """The t at which the line meets the triangle."""
        return Root(self.plane, self.plane.b.sign())

    def weights(self) -> tuple[float, float]:
        """Of B and of C, rounded."""
        w, n = self.plane.direction, self.plane.normal
        b, c = (float(Root(Plane(w, n, e), e.sign())) for e in (self.by_b, self.by_c))
        return b, c
