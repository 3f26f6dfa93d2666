"""Spheres and ellipsoids, as rays meet them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from cltrace.base.arithmetic import Floats, cross, dot, inverses, product
from cltrace.exact.fine import Fine, FineVector, fine_vector
from cltrace.rays.doubles import FLOOR, PER_OFF, Met, Range, norm1
from cltrace.rays.fine import Ends, sign_of, way_through
from cltrace.rays.lines import Ids, Lines, differences
from cltrace.rays.numbers import grid_of, whole
from cltrace.rays.shapes.shape import Shape, unit
from cltrace.rays.whole import Roots, WholeRays
from cltrace.scene import Scene


class Spheres(Shape):
    """See Shape. radius: (n,); bent: (n,), the index in `maps` of an ellipsoid's, -1 for a sphere; maps: (k, 3, 3),
    from the world to an ellipsoid's own axes; stretch: (n,), a bound of what that map makes of a length."""

    def __init__(self, scene: Scene, first: int) -> None:
        super().__init__(first, scene.sphere_numbers)
        spheres, self.maps = scene.spheres, scene.to_object
        self.center, self.radius = np.ascontiguousarray(spheres["center"]), np.ascontiguousarray(spheres["radius"])
        self.bent = spheres["to_object"].astype(np.int64)
        sizes = (np.linalg.norm(m, 2, axis=(1, 2)) for m in (self.maps, inverses(self.maps)))
        self.stretch, reach = (np.append(size * (1 + 2.0**-40), 1)[self.bent] for size in sizes)
        self.outer = self.radius * reach

    def maps_of(self, i: Ids) -> Floats:
        """(k, 3, 3): from the world to the own axes of these; of spheres, the identity."""
        return np.concatenate([self.maps, np.eye(3)[None]])[self.bent[i]]  # of -1, the last one

    def meet(self, lines: Lines, ray: Ids, primitive: Ids) -> Met:
        i = primitive - self.first
        f, w, r = self.center[i].T - lines.place[ray].T, lines.w[ray].T, self.radius[i]
        k, bent = self.stretch[i], np.flatnonzero(self.bent[i] >= 0)
        f1, w1 = k * norm1(f), k * norm1(w)
        s = f1 + k * PER_OFF * lines.off[ray]
        if len(bent):
            maps = self.maps[self.bent[i[bent]]]
            f[:, bent], w[:, bent] = (np.einsum("nij,jn->in", maps, v[:, bent]) for v in (f, w))
        X = cross(f, w)
        a, b, ff, XX, rr = dot(w, w), dot(f, w), dot(f, f), dot(X, X), r * r
        c, arr = ff - rr, a * rr
        D = arr - XX
        w_error = np.where(k == 1, 0.0, 2.0**-49 * w1)
        a_error = w_error * (2 * norm1(w) + w_error) + 2.0**-50 * a
        b_error = 2.0**-47 * s * w1 + FLOOR
        D_error = (2 * norm1(X) * b_error + b_error * b_error) + 2.0**-47 * (arr + XX) + rr * a_error + FLOOR
        c_error = 2.0**-46 * s * f1 + 2.0**-50 * (ff + rr) + (2.0**-47 * s) ** 2 + FLOOR
        miss = -D_error > D
        # q = |b| + sqrt(D) is off by b_error, by D_error / sqrt(D), and by its rounding; the ends are q / a and c / q,
        # or their negatives, and each is off by the shares of both, the divisor's twice.
        root = np.sqrt(np.maximum(D, 0))
        q = np.abs(b) + root
        q_share = (b_error + D_error / root) / q + 2.0**-50
        sure = (D_error < D) & (np.abs(b) > b_error) & (q_share < 0.25) & (a_error < 0.25 * a)
        ahead = b > 0
        outer, inner = np.where(ahead, q, -q) / a, np.where(ahead, c, -c) / q
        outer_error = np.abs(outer) * 2 * (q_share + a_error / a + 2.0**-51)
        inner_error = np.abs(inner) * 2 * (q_share + 2.0**-51) + 2 * c_error / q
        near, near_error = np.where(ahead, inner, outer), np.where(ahead, inner_error, outer_error)
        far, far_error = np.where(ahead, outer, inner), np.where(ahead, outer_error, inner_error)
        sure &= np.isfinite(near_error) & np.isfinite(far_error)
        first, second = Range.of(lines, ray, near, near_error), Range.of(lines, ray, far, far_error)
        by_near, by_far = sure & first.surely, sure & ~first.perhaps & second.surely
        out = miss | (sure & ~first.perhaps & ~second.perhaps)
        # From outside, where the middle of the way through is behind, both ends are.
        out |= (c > c_error) & (b < -b_error) & (lines.low[ray] - lines.loose[ray] >= 0) & (lines.start[0][ray] == 0)
        kept = np.flatnonzero(~out)
        low = np.where(sure, np.where(by_far, far - far_error, near - near_error), -np.inf)
        high = np.where(sure, np.where(by_near, near + near_error, far + far_error), np.inf)
        side = np.where(by_far, 1, -1)
        return Met(ray, primitive, sure=by_near | by_far, side=side, low=low, high=high).at(kept)

    def seen(self, lines: Lines, ray: Ids, i: Ids) -> tuple[FineVector, FineVector]:
        """The way from the start to a sphere's centre, and w; both in an ellipsoid's own axes."""
        f, w = fine_vector(*differences(self.center[i], lines.origin[ray])), fine_vector(lines.w[ray])
        if (self.bent[i] < 0).all():
            return f, w
        maps = self.maps_of(i)
        rows = [fine_vector(maps[:, k]) for k in range(3)]
        (fx, fy, fz), (wx, wy, wz) = ([dot(row, v) for row in rows] for v in (f, w))
        return (fx, fy, fz), (wx, wy, wz)

    def ends(self, lines: Lines, ray: Ids, primitive: Ids) -> Ends:
        i = primitive - self.first
        (f, w), r = self.seen(lines, ray, i), Fine.of(self.radius[i])
        X, rr = cross(f, w), r * r
        a, b, c, D = dot(w, w), dot(f, w), dot(f, f) - rr, dot(w, w) * rr - dot(X, X)
        meets = np.where((sign_of(D) > 0) & (sign_of(b) == 0), 0, sign_of(D))
        return Ends(meets.astype(np.int8), *way_through(a, b, c, D))

    def lengths(self, primitive: Ids) -> list[Floats]:
        i = primitive - self.first
        return [self.center[i], self.radius[i]]

    def roots(self, rays: WholeRays, primitive: Ids) -> Roots:
        i = primitive - self.first
        f, d, r = whole(self.center[i], rays.grid).T - rays.o, rays.w, whole(self.radius[i], rays.grid)
        if (self.bent[i] >= 0).any():
            maps = self.maps_of(i)
            k = grid_of(maps)
            K = np.moveaxis(whole(maps, k), 0, -1)
            f, d = (np.array(product(K, v), object) for v in (f, d))
            r = r << k
        a, b, c = dot(d, d), dot(f, d), dot(f, f) - r * r
        D, side = b * b - a * c, np.ones(len(i), np.int64)
        passes, none = D < 0, np.zeros((3, len(i)), object)
        near = Roots(~passes, a=a, b=b, side=-side, D=np.where(passes, 0, D), w=rays.w, normal=none)
        first, second = (rays.reach(near._replace(side=end)) for end in (-side, side))
        return near._replace(exists=~passes & (first | second), side=np.where(first, -1, 1))

    def points(self, lines: Lines, primitive: Ids, t: Fine) -> SpherePoints:
        return SpherePoints(self, lines, primitive - self.first, t)


class SpherePoints:
    """See Points."""

    def __init__(self, spheres: Spheres, lines: Lines, i: Ids, t: Fine) -> None:
        self._spheres, self._lines, self._i, self._t = spheres, lines, i, t

    @cached_property
    def _own(self) -> Floats:
        """(k, 3): unit normals in the own axes of ellipsoids, and in the world of spheres."""
        f, w = self._spheres.seen(self._lines, np.arange(len(self._i)), self._i)
        return unit(np.stack([(self._t * x - y).h for x, y in zip(w, f, strict=True)], axis=1))

    @property
    def normal(self) -> Floats:
        # Normals are turned by the transposed map.
        return np.asarray(np.einsum("nji,nj->ni", self._spheres.maps_of(self._i), self._own))

    @property
    def uv(self) -> Floats:
        """As _around() of cltrace/reference/surfaces.py."""
        x, y, z = self._own.T
        around, down = np.arctan2(x + 0.0, z) / (2 * np.pi), np.arctan2(np.hypot(x, z), y) / np.pi
        return np.stack([0.5 + around, down], axis=1)
