"""Spheres, ellipsoids, triangles and cylinders, exactly: where a line meets them first, and which points are on them.

All numbers are those of the scene's file, in the world.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Literal

from cltrace.base.arithmetic import adjugate, cross, dot
from cltrace.exact.lines import Equation, ExactPoint, Height, Line, Root, Vector, sign_along, sum_times
from cltrace.exact.surds import Surd, over_common

Part = Literal["side", "start", "end"]
Number = float | Fraction


class ExactSphere:
    """The points p with |K (p - center)| = radius. K: of an ellipsoid, its matrix; None for a sphere, where K = 1."""

    def __init__(
        self, center: Iterable[Number], radius: Number, to_object: Sequence[Sequence[Number]] | None = None
    ) -> None:
        (*numbers, self.radius), self.over = over_common([*center, radius])
        x, y, z = map(Surd, numbers)
        self.center = ExactPoint((x, y, z), self.over)
        self.K: list[int] | None = None
        self.K_over = 1
        if to_object is not None:
            self.K, self.K_over = over_common([x for row in to_object for x in row])

    @cached_property
    def inverse(self) -> tuple[list[list[int]], int]:
        """Integers, and the one > 0 by which they are to be divided to give K^-1; 0 if there is none."""
        if self.K is None:
            return [[1, 0, 0], [0, 1, 0], [0, 0, 1]], 1
        rows, determinant = adjugate([self.K[i : i + 3] for i in (0, 3, 6)])
        sign = -1 if determinant < 0 else 1
        return [[sign * x * self.K_over for x in row] for row in rows], abs(determinant)

    def seen(self, v: Vector) -> Vector:
        """K v, times the denominator of K."""
        if self.K is None:
            return v
        return sum_times(v, self.K[:3]), sum_times(v, self.K[3:6]), sum_times(v, self.K[6:])

    def met_by(self, line: Line) -> Equation:
        """The equation of the t at which a line meets it: a = d.d, b = d.f, c = f.f - r^2, with d = K w, f = K (C - o).

        f is over a number n: so the equation is that of n f and n r, and d is multiplied by n, too.
        """
        to_center = self.center - line.start
        f, d, n = self.seen(to_center.numbers), self.seen(line.way), to_center.over
        r = self.radius * (n // self.over) * self.K_over
        a, b, c = dot(d, d).times(n * n), dot(f, d).times(n), dot(f, f) - Surd(r * r)
        return Equation(line, a, b, c, over=n * self.K_over)

    def first(self, line: Line, t_min: float, t_max: float) -> Root | None:
        return self.met_by(line).first(t_min, t_max)

    def side_of(self, p: ExactPoint) -> int:
        """1 for a point outside, 0 on the surface, -1 inside: the sign of |K (p - center)|^2 - radius^2."""
        return self.power(p)[0].sign()

    def power(self, p: ExactPoint) -> tuple[Surd, int]:
        """|K (p - center)|^2 - radius^2, the power of a point, and by what it is to be divided."""
        v = p - self.center
        f, r = self.seen(v.numbers), self.radius * (v.over // self.over) * self.K_over
        return dot(f, f) - Surd(r * r), (v.over * self.K_over) ** 2

    def contains_entry(self, height: Height) -> bool:
        """Whether a line enters what a clipping plane keeps strictly inside of it."""
        v, size = height.from_point(self.center)
        Kv, r = self.seen(v), self.radius * self.K_over
        return (dot(Kv, Kv).times(self.over * self.over) - (size * size).times(r * r)).sign() < 0

    def point(self, q: Sequence[Number]) -> ExactPoint:
        """The point center + radius K^-1 q / |q|. As |q| = sqrt(s), it is center + (radius K^-1 q / s) sqrt(s)."""
        whole, _ = over_common(q)
        (rows, divisor), s = self.inverse, sum(x * x for x in whole)
        scale = s * divisor
        x, y, z = (
            Surd(c.p * scale, self.radius * (row[0] * whole[0] + row[1] * whole[1] + row[2] * whole[2]), s)
            for c, row in zip(self.center.numbers, rows, strict=True)
        )
        return ExactPoint((x, y, z), self.over * scale)


class ExactTriangle:
    """A triangle by its corners A, B, C.

    Seen from O, with A' = A - O and so on, a ray along w passes the edge AB on the side that is the sign of

        E = w . (A' x B'),    and likewise BC and CA.

    It meets the triangle where these three are the same. At an edge, E = 0, the sign is that of the first of the
    coordinates of A' x B' that is not 0: that is the side of the ray w + (e, e^2, e^3) for every small e > 0. So one
    and the same ray is asked about everywhere, and of all triangles around an edge or a corner, exactly one has it on
    each side where the surface goes on.

    With N = A' x B' + B' x C' + C' x A' the three add up to N.w, and the ray is in the plane at t = A'.N / N.w. Where
    A'.N = 0, as the ray starts in the plane or the triangle has no area, it is not met. So not all coordinates of
    A' x B' are 0.
    """

    def __init__(self, corners: Sequence[Iterable[Number]]) -> None:
        numbers, self.over = over_common([x for corner in corners for x in corner])
        self.corners = [
            ExactPoint((Surd(x), Surd(y), Surd(z)), self.over) for x, y, z in zip(*[iter(numbers)] * 3, strict=True)
        ]

    def met_by(self, line: Line) -> Across | None:
        """Where a line meets the triangle, and how; None if it does not."""
        from_start = [corner - line.start for corner in self.corners]
        A, B, C = (v.numbers for v in from_start)
        edges = [cross(A, B), cross(B, C), cross(C, A)]
        D = dot(A, edges[1])
        sides = {sign_along(line.way, edge) for edge in edges} if D.sign() else {1, -1}
        if len(sides) > 1:
            return None
        (side,) = sides
        turn = side * from_start[0].over
        x, y, z = ((p + q + r).times(turn) for p, q, r in zip(*edges, strict=True))
        plane = Equation(line, dot((x, y, z), line.way), D.times(side), normal=(x, y, z))
        by_b, by_c = (dot(edges[i], line.way).times(turn) for i in (2, 0))
        return Across(side, Root(plane, 0), by_b, by_c)

    def first(self, line: Line, t_min: float, t_max: float) -> Root | None:
        across = self.met_by(line)
        return across.root if across and across.root.is_between(t_min, t_max) else None

    @cached_property
    def normal(self) -> tuple[int, int, int]:
        """(B - A) x (C - A), times a number > 0."""
        A, B, C = (corner.numbers for corner in self.corners)
        u, v = ([p.p - q.p for p, q in zip(X, A, strict=True)] for X in (B, C))
        return cross(u, v)

    def point(self, corner: int, u: float, v: float) -> ExactPoint:
        """V + u (V' - V) + v (V'' - V): from one of the corners, and the next ones going round."""
        V, V1, V2 = (self.corners[(corner + i) % 3].numbers for i in range(3))
        (a, b), over = over_common([u, v])
        x, y, z = (Surd(p.p * over + a * (q.p - p.p) + b * (r.p - p.p)) for p, q, r in zip(V, V1, V2, strict=True))
        return ExactPoint((x, y, z), self.over * over)


@dataclass(frozen=True)
class Across:
    """A line across a triangle. side: the sign of N.w, 1 for a ray that goes the way of N; root: where it is met.

    by_b, by_c: side times E of the edges CA and AB, which are |N.w| times the weights of the corners B and C.
    """

    side: int
    root: Root
    by_b: Surd
    by_c: Surd

    def weights(self) -> tuple[float, float]:
        """Of the corners B and C, rounded."""
        line, a = self.root.of.line, self.root.of.a
        b, c = (
            float(Root(Equation(replace(line, direction=ExactPoint(line.way, 1)), a, e, normal=line.way), 0))
            for e in (self.by_b, self.by_c)
        )
        return b, c


class ExactCylinder:
    """The points p with |(p - S) x u| <= r |u| and 0 <= (p - S).u <= u.u: a solid cylinder with flat ends.

    start: S; axis: u, from there to the middle of the other end; radius: r.
    """

    def __init__(self, start: Iterable[Number], end: Iterable[Number], radius: Number) -> None:
        (*numbers, self.radius), self.over = over_common([*start, *end, radius])
        S, E = numbers[:3], numbers[3:]
        self.start = ExactPoint((Surd(S[0]), Surd(S[1]), Surd(S[2])), self.over)
        self.u = (E[0] - S[0], E[1] - S[1], E[2] - S[2])
        self.uu = dot(self.u, self.u)
        self.axis: Vector = (Surd(self.u[0]), Surd(self.u[1]), Surd(self.u[2]))

    def round_part(self, line: Line) -> Equation:
        """Where a line is within what goes round the axis: |t G - F|^2 <= r^2 u.u, with G = w x u and F = f x u.

        f = S - o is over a number n: so the equation is that of n f, n u and n r, and w is multiplied by n, too.
        """
        f = self.start - line.start
        n, more = f.over, f.over // self.over
        u: Vector = (self.axis[0].times(more), self.axis[1].times(more), self.axis[2].times(more))
        F, G, r = cross(f.numbers, u), cross(line.way, u), self.radius * more
        c = dot(F, F) - Surd(r * r * self.uu * more * more)
        return Equation(line, dot(G, G).times(n * n), dot(F, G).times(n), c, over=n * n)

    def first(self, line: Line, t_min: float, t_max: float) -> Root | None:
        met = self.meet(line, t_min, t_max)
        return met and met[0]

    def meet(
        self, line: Line, t_min: float, t_max: float, loose: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[Root, Part, bool] | None:
        """Where a line meets the surface first, strictly between t_min and t_max, by which part, and whether from
        inside; see way_through()."""
        for met, inside in zip(self.way_through(line, loose) or (), (False, True), strict=False):
            if met[0].is_between(t_min, t_max):
                return *met, inside
        return None

    def way_through(
        self, line: Line, loose: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[tuple[Root, Part], tuple[Root, Part]] | None:
        """The two ends of a line's way through the solid, and by which part of the surface; None if it passes by.

        loose: below what its start counts as on the side, and as on an end's plane. Touching is a way of length 0.

        The line is between the planes of the ends where 0 <= t g - h <= u.u, with g = w.u and h = f.u, and in the solid
        where it is in both these and the endless cylinder. On the rim, it is the flat end that is met.
        """
        f = self.start - line.start
        n, more = f.over, f.over // self.over
        # For t in whole directions, f and u over n: g is over n, h and u.u are over n^2.
        g, h = dot(line.way, self.axis).times(more * n), dot(f.numbers, self.axis).times(more)
        side, beyond = self.round_part(line), _settled(h + Surd(self.uu * more * more), loose[1], n * n)
        side, h = replace(side, c=_settled(side.c, loose[0], side.over**2)), _settled(h, loose[1], n * n)
        near: tuple[Root, Part] | None = None
        far: tuple[Root, Part] | None = None
        if side.a.sign():
            if side.discriminant.sign() < 0:
                return None
            near, far = (Root(side, -1), "side"), (Root(side, 1), "side")
        elif side.c.sign() > 0:
            return None
        if g.sign():
            first, last = _flat(line, g, h, "start"), _flat(line, g, beyond, "end")
            first, last = (first, last) if g.sign() > 0 else (last, first)
            near = first if near is None or not first[0] < near[0] else near
            far = last if far is None or not far[0] < last[0] else far
        elif h.sign() > 0 or beyond.sign() < 0:
            return None
        if near is None or far is None or far[0] < near[0]:
            return None
        return near, far

    def is_outside(self, p: ExactPoint) -> bool:
        """Whether a rational point is strictly outside of the solid."""
        v = p - self.start
        more = v.over // self.over
        along = dot(v.numbers, self.axis).p * more
        across = cross(v.numbers, self.axis)
        beside = dot(across, across).p > self.radius * self.radius * self.uu * more * more
        return along < 0 or along > self.uu * more * more or beside

    def contains_entry(self, height: Height) -> bool:
        """Whether a line enters what a clipping plane keeps strictly inside of it."""
        v, size = height.from_point(self.start)
        along, across = dot(v, self.axis).times(self.over), cross(v, self.axis)
        excess = dot(across, across).times(self.over * self.over)
        excess -= (size * size).times(self.radius * self.radius * self.uu)
        return along.sign() > 0 and (along - size.times(self.uu)).sign() < 0 and excess.sign() < 0

    def across(self, a: float, b: float) -> list[Fraction]:
        """a e1 + b e2, with e1 = x x u, x being the coordinate axis that u is furthest from, and e2 = u x e1."""
        e1, e2 = axes_across([Fraction(x, self.over) for x in self.u])
        return [Fraction(a) * p + Fraction(b) * q for p, q in zip(e1, e2, strict=True)]

    def point(self, part: Part, k: float, a: float, b: float) -> ExactPoint:
        """S + k u + r m / |m| on the side, and S + m or E + m on a flat end, where m = a e1 + b e2."""
        m, S = self.across(a, b), self.start.fractions()
        along = Fraction(k) if part == "side" else Fraction(part == "end")
        foot = [s + along * Fraction(x, self.over) for s, x in zip(S, self.u, strict=True)]
        if part != "side":
            return ExactPoint.of([p + v for p, v in zip(foot, m, strict=True)])
        square = sum((v * v for v in m), Fraction(0))
        r = Fraction(self.radius, self.over)
        return ExactPoint.of(foot, [r * v / square for v in m], square)


def axes_across(u: Sequence[Fraction]) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
    """e1 and e2 of an axis u, see ExactCylinder.across()."""
    helper = [Fraction(0)] * 3
    helper[min(range(3), key=lambda i: abs(u[i]))] = Fraction(1)
    e1 = cross(helper, u)
    return e1, cross(u, e1)


def _settled(x: Surd, loose: float, over: int) -> Surd:
    """0 where x / over is no larger than that, else x."""
    if not loose:
        return x
    p, q = (Fraction(loose) * over).as_integer_ratio()
    scaled, far = x.times(q), Surd(p)
    return x if (scaled - far).sign() > 0 or (scaled + far).sign() < 0 else Surd(0)


def _flat(line: Line, g: Surd, h: Surd, part: Part) -> tuple[Root, Part]:
    """Where a line meets the plane g t = h: as a quadratic equation, (g t - h)^2 = 0, which has one root twice."""
    return Root(Equation(line, g * g, g * h, h * h), 1), part
