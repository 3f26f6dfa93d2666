"""The exact oracle for balls that planes have cut, and for the discs that cap them.

It is that of cylinders, with the equation of a sphere around C in place of that of the endless one: with f = C - o,
a = d.d, b = f.d, c = f.f - r^2 and D = b^2 - a c = a r^2 - |f x d|^2. Of what is flat, both planes are one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cltrace.base.arithmetic import Floats, Triple, cross, dot, minus, two_sum
from cltrace.exact.cuts import ExactCut
from cltrace.exact.fine import Fine
from cltrace.oracle.cylinders import MOST, Cylinders
from cltrace.oracle.rays import Ids, Rough, moderate
from cltrace.oracle.search import Bools
from cltrace.scene import Scene


@dataclass(frozen=True, eq=False)
class Cuts(Cylinders):
    """centers: (m, 3); flat: (m,). The starts and ends are what cuts the balls."""

    centers: Floats
    flat: Bools

    @classmethod
    def of(cls, scene: Scene) -> Cuts:
        cuts = scene.cuts
        start, end, radius, number = (cuts[name] for name in ("start", "end", "radius", "number"))
        return cls(start, end, radius, number.astype(np.int64), cuts["center"], cuts["flat"] == 1)

    @cached_property
    def moderate(self) -> Bools:
        return moderate(np.concatenate([self.starts, self.ends, self.centers, self.radii[:, None]], axis=1), MOST)

    @property
    def balls(self) -> tuple[Floats, Floats]:
        return self.centers, self.radii * (1 + 2.0**-40)

    def round_part(self, rough: Rough, item: Ids, f: Triple[Fine], u: Triple[Fine]) -> tuple[Fine, Fine, Fine, Fine]:
        w, r, zero = rough.way, Fine.of(self.radii[item]), np.zeros(len(item))
        f = minus(tuple(Fine(*two_sum(self.centers[item, i], -rough.anchor[:, i]), zero) for i in range(3)), rough.step)
        a, X = dot(w, w), cross(f, w)
        return a, dot(f, w), dot(f, f) - r * r, a * r * r - dot(X, X)

    def solid(self, item: int) -> ExactCut:
        start, end, center = (x[item].tolist() for x in (self.starts, self.ends, self.centers))
        return ExactCut(start, end, float(self.radii[item]), center, flat=bool(self.flat[item]))

    def depth(self, item: Ids) -> Ids:
        return np.where(self.flat[item], 0, 1)
