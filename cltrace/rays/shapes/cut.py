"""Balls that planes have cut, as rays meet them: cylinders with a sphere in place of the side."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from cltrace.base.arithmetic import Floats, Triple, cross, dot
from cltrace.exact.fine import Fine, fine_vector
from cltrace.rays.doubles import FLOOR, PER_OFF, norm1
from cltrace.rays.lines import Bools, Ids, Lines, differences
from cltrace.rays.numbers import whole
from cltrace.rays.shapes.cylinder import Cylinders
from cltrace.rays.shapes.shape import Points
from cltrace.rays.whole import WholeRays
from cltrace.scene import Scene


class Cuts(Cylinders):
    """See Shape. start, end: (n, 3), what cuts them; radius: (n,), center: (n, 3); flat: (n,)."""

    def __init__(self, scene: Scene, first: int) -> None:
        self._take(scene.cuts, first)
        self.center, self.flat = np.ascontiguousarray(scene.cuts["center"]), scene.cuts["flat"] == 1
        self.outer = self.radius * (1 + 2.0**-40)

    def beside(self, lines: Lines, ray: Ids, i: Ids) -> Bools:
        """|f x w| / |w| from the centre, with bounds as of cylinders."""
        f, w, r = self.center[i].T - lines.place[ray].T, lines.w[ray].T, self.radius[i]
        X, s, w1 = cross(f, w), norm1(f) + PER_OFF * lines.off[ray], norm1(w)
        size = np.sqrt(dot(w, w)) + 2.0**-45 * w1
        return np.asarray(np.sqrt(dot(X, X)) - 2.0**-45 * s * w1 > r * size * (1 + 2.0**-45) + FLOOR)

    def round_part(self, lines: Lines, ray: Ids, i: Ids, f: Triple[Fine], u: Triple[Fine]) -> tuple[Fine, ...]:
        r, w = Fine.of(self.radius[i]), fine_vector(lines.w[ray])
        f = fine_vector(*differences(self.center[i], lines.origin[ray]))
        a, X = dot(w, w), cross(f, w)
        return a, dot(f, w), dot(f, f) - r * r, a * r * r - dot(X, X)

    def whole_round_part(self, rays: WholeRays, i: Ids, f: Any, u: Any) -> tuple[Any, Any, Any]:
        C, r = (whole(x[i], rays.grid) for x in (self.center, self.radius))
        f, w = C.T - rays.o, rays.w
        return dot(w, w), dot(f, w), dot(f, f) - r * r

    def depth(self, i: Ids) -> Ids:
        return np.where(self.flat[i], 0, 1)

    def lengths(self, primitive: Ids) -> list[Floats]:
        return [*super().lengths(primitive), self.center[primitive - self.first]]

    def points(self, lines: Lines, primitive: Ids, t: Fine) -> Points:
        return CutPoints(self, lines, primitive - self.first, t)


class CutPoints:
    """See Points. A point is on the disc where the plane is as near as the sphere, and always of what is flat."""

    def __init__(self, cuts: Cuts, lines: Lines, i: Ids, t: Fine) -> None:
        w = fine_vector(lines.w)
        self._u = cuts.end[i] - cuts.start[i]
        length = np.sqrt((self._u * self._u).sum(axis=1))
        from_start, self._out = (
            np.stack(
                [(t * x - y).h for x, y in zip(w, fine_vector(*differences(p[i], lines.origin)), strict=True)], axis=1
            )
            for p in (cuts.start, cuts.center)
        )
        height = np.abs((from_start * self._u).sum(axis=1) / length)
        off = np.abs(np.sqrt((self._out * self._out).sum(axis=1)) - cuts.radius[i])
        self._flat = cuts.flat[i] | (height <= off)

    @cached_property
    def normal(self) -> Floats:
        return np.asarray(np.where(self._flat[:, None], -self._u, self._out))

    @cached_property
    def uv(self) -> Floats:
        """Cut balls have no textures."""
        return np.zeros((len(self._flat), 2))
