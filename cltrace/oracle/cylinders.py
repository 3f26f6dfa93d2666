"""Cylinders with flat ends, as the oracle has them: what pairs of doubles know of rays and cylinders.

With f = S - o, u = E - S, F = f x u and G = d x u, a ray o + t d is within the endless cylinder between the roots of

    a t^2 - 2 b t + c = 0,    a = G.G,  b = F.G,  c = F.F - r^2 u.u,  D = b^2 - a c,

and between the planes of the ends from t = N / g to t = N' / g, with g = d.u; N and N' are h = f.u and h + u.u, by the
sign of g. It is in the solid from the later one of the two beginnings to the earlier one of the two ends. Where these
are in another order, it passes by. Pairs of doubles that count their errors compare the four t.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cltrace.base.arithmetic import Floats, cross, dot, minus, two_sum
from cltrace.exact.fine import Fine, select
from cltrace.exact.shapes import ExactCylinder
from cltrace.oracle.rays import Ids, Rays, moderate
from cltrace.oracle.search import Bools, Hits, Kind, near_balls
from cltrace.scene import Scene

# Up to what the filter takes numbers, see moderate(): products of ten of its numbers stay within the range of double.
MOST = 2.0**80


@dataclass(frozen=True, eq=False)
class Cylinders(Kind):
    """starts, ends: (m, 3), in the world; radii: (m,)."""

    starts: Floats
    ends: Floats
    radii: Floats
    surface: Ids

    @classmethod
    def of(cls, scene: Scene) -> Cylinders:
        """All of a scene."""
        start, end, radius, number = (scene.cylinders[name] for name in ("start", "end", "radius", "number"))
        return cls(start, end, radius, number.astype(np.int64))

    @cached_property
    def moderate(self) -> Bools:
        """(m,): which ones' numbers are within the range of the filter."""
        return moderate(np.concatenate([self.starts, self.ends, self.radii[:, None]], axis=1), MOST)

    def near(self, rays: Rays) -> tuple[Ids, Ids]:
        return near_balls(rays, *self.balls, self.moderate, MOST)

    @property
    def balls(self) -> tuple[Floats, Floats]:
        """The balls around them: centres, (m, 3), and radii, (m,)."""
        half = self.ends / 2 - self.starts / 2
        return self.starts / 2 + self.ends / 2, (np.sqrt((half * half).sum(axis=1)) + self.radii) * (1 + 2.0**-40)

    @property
    def extent(self) -> float:
        middle, outer = self.balls
        return float(np.abs(middle).max(initial=0) + outer.max(initial=0))

    def hits(self, rays: Rays, ray: Ids, item: Ids) -> Hits:
        """By four t with bounds: those of the planes, and those of the endless cylinder."""
        assert rays.rough is not None
        rough, zero = rays.rough.at(ray), np.zeros(len(ray))
        f = minus(
            tuple(Fine(*two_sum(self.starts[item, i], -rough.anchor[:, i]), zero) for i in range(3)),
            rough.step,
        )
        u = tuple(Fine(*two_sum(self.ends[item, i], -self.starts[item, i]), zero) for i in range(3))
        g, h = dot(rough.way, u), dot(f, u)
        w, r, uu = rough.way, Fine.of(self.radii[item]), dot(u, u)
        F, G, X = cross(f, u), cross(w, u), cross(f, w)
        k, V = h + uu, dot(u, X)
        # D is u.u times that of the distance from the axis, which does not cancel as b^2 - a c does.
        a, b, c = dot(G, G), dot(F, G), dot(F, F) - r * r * uu
        D = uu * (a * r * r - V * V)
        root = Fine(np.maximum(D.h, 0), np.where(D.h > 0, D.l, 0), D.error).root()
        ahead = b.h > 0
        q = select(ahead, b, -b) + root
        outer, inner = select(ahead, q, -q) / a, select(ahead, c, -c) / q
        forth = g.h > 0
        first = select(forth, h, k) / g, select(ahead, inner, outer)
        last = select(forth, k, h) / g, select(ahead, outer, inner)
        late, soon = (first[0] - first[1]).sign(), (last[0] - last[1]).sign()
        begin, end = select(late > 0, *first), select(soon < 0, *last)
        there, left = (end - begin).sign(), np.array([begin.sign(), end.sign()])
        known = (D.sign() > 0) & (a.sign() > 0) & (g.sign() != 0) & (late != 0) & (soon != 0) & (there > 0)
        t = select(left[0] > 0, begin, end)
        sure = known & ((left[0] > 0) | ((left[0] < 0) & (left[1] > 0)))
        gone = (D.sign() < 0) | (known & (left[1] < 0))
        gone |= (g.sign() != 0) & (a.sign() > 0) & (D.sign() > 0) & (late != 0) & (soon != 0) & (there < 0)
        fit = rays.rough.fits(MOST)[ray] & self.moderate[item]
        sure, gone = sure & fit, gone & fit
        t = Fine(t.h, t.l, np.where(sure & (t.error < 2.0**-41 * t.h), t.error, np.inf))
        kept = np.flatnonzero(~gone)
        return Hits(ray[kept], item[kept], sure[kept], t[kept])

    def solid(self, item: int) -> ExactCylinder:
        start, end = self.starts[item].tolist(), self.ends[item].tolist()
        return ExactCylinder(start, end, float(self.radii[item]))
