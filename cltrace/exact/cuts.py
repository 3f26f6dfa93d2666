"""Balls that planes have cut, and the discs that cap them, exactly: cylinders with a sphere in place of the side."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from cltrace.exact.lines import Equation, ExactPoint, Line
from cltrace.exact.shapes import ExactCylinder, ExactSphere, Number, Part


class ExactCut(ExactCylinder):
    """The points p with |p - C| <= r and 0 <= (p - S).u <= u.u, or, flat, with (p - S).u = 0. center: C."""

    def __init__(
        self, start: Iterable[Number], end: Iterable[Number], radius: Number, center: Iterable[Number], flat: bool
    ) -> None:
        super().__init__(start, end, radius)
        self.ball, self.flat = ExactSphere(center, radius), flat

    def round_part(self, line: Line) -> Equation:
        return self.ball.met_by(line)

    @property
    def depth(self) -> int:
        return 0 if self.flat else self.uu

    def is_beside(self, p: ExactPoint) -> bool:
        return self.ball.side_of(p) > 0

    def point(self, part: Part, k: float, a: float, b: float) -> ExactPoint:
        """C + r m / |m| on the sphere, with m = (2 k - 1) u + a e1 + b e2, and S + a e1 + b e2 on the disc."""
        m = self.across(a, b)
        if part != "side":
            return ExactPoint.of([s + v for s, v in zip(self.start.fractions(), m, strict=True)])
        along = 2 * Fraction(k) - 1
        return self.ball.point([along * Fraction(x, self.over) + v for x, v in zip(self.u, m, strict=True)])
