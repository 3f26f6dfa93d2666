"""Caps, where clipping planes cut closed surfaces: a row of SHAPES."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from cltrace.explanation.shapes.shape import Textbook
from cltrace.explanation.triples import Triple, number, triple, vector
from cltrace.reference import Direction, Point
from cltrace.reference.clipping import Cap


@dataclass(frozen=True)
class CapTest(Textbook):
    """t = (S - o).m / d.m, in doubles.

    start: S, a point of the plane; normal: m, of length 1, to the side that is left out; d_m: d.m; t: where the ray is
    in the plane, NaN if it is parallel to that.
    """

    start: Triple
    normal: Triple
    d_m: float
    t: float
    surfaces: ClassVar = (Cap,)
    normals: ClassVar = {"cap": "m"}

    @classmethod
    def of(cls, cap: Cap, o: Point, d: Direction) -> CapTest:
        plane = cap.entry.plane
        S, m = plane.point, -plane.inward.normalized()
        d_m = d.dot(m)
        return cls(triple(S), triple(m), d_m, (S - o).dot(m) / d_m if d_m else math.nan)

    @classmethod
    def gap(cls, cap: Cap, o: Point, d: Direction) -> tuple[float, float, Cap]:
        return math.inf, math.inf, cap

    def first(self, own: bool) -> float:
        return self.t if self.t > 0 else math.inf

    def lines(self) -> Iterator[str]:
        yield f"    the plane has S = {vector(self.start)} and m = {vector(self.normal)}"
        yield f"    t = (S - o).m / d.m = {number(self.t)}; there the ray is inside of the surface that the cap closes"
