"""Spheres and ellipsoids, triangles, and cylinders as the oracle has them: what pairs of doubles know of them and rays.

Each filter says, with bounds of its errors, which rays surely meet or surely pass by, and where. All numbers are those
of the scene's file, in the world; o + t d is a ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cltrace.base.arithmetic import Fine, Floats, cross, dot, fine_vector, inverses, product, select
from cltrace.exact.shapes import ExactCylinder, ExactSphere, ExactTriangle
from cltrace.oracle.search import Ids, Kind, PairHits, Rays, at, ball_around
from cltrace.scene import Scene


@dataclass(frozen=True, eq=False)
class Spheres(Kind):
    """Spheres, and ellipsoids |K (p - C)| = r. bent: (m,), which of the matrices `to_object` is K, -1 for a sphere.

    With f = C - o,  a = d.d,  b = f.d,  c = f.f - r^2,  D = b^2 - a c, a ray meets a sphere at t = (b -/+ sqrt(D)) / a,
    and the first t > 0 is

        c > 0 (origin outside):  a hit iff b > 0 and D >= 0, at (b - sqrt(D)) / a = c / (b + sqrt(D))
        c < 0 (inside):          a hit,                      at (b + sqrt(D)) / a
        c = 0 (on the surface):  a hit iff b > 0,            at (b + sqrt(D)) / a = 2 b / a    (the root 0 is not a hit)

    An ellipsoid is a sphere in its own axes, with K f and K d for f and d.
    """

    centers: Floats
    radii: Floats
    surface: Ids
    bent: Ids
    to_object: Floats

    @classmethod
    def of(cls, scene: Scene) -> Spheres:
        center, radius, bent = (scene.spheres[name] for name in ("center", "radius", "to_object"))
        return cls(center, radius, scene.sphere_numbers.astype(np.int64), bent.astype(np.int64), scene.to_object)

    @cached_property
    def maps(self) -> Floats:
        """(m, 3, 3): K, 1 of spheres."""
        return np.concatenate([self.to_object, np.eye(3)[None]])[self.bent]

    @property
    def balls(self) -> tuple[Floats, Floats]:
        # The sum of a map's magnitudes bounds how far the surface is from its centre.
        longest = np.append(np.abs(inverses(self.to_object)).sum(axis=(1, 2)), 1)[self.bent]
        return self.centers, self.radii * longest * (1 + 2.0**-40)

    def hits(self, rays: Rays, ray: Ids, item: Ids) -> PairHits:
        f, w, own = rays.to(self.centers[item], ray), at(rays.way, ray), rays.leaves(self, ray, item)
        if (self.bent[item] >= 0).any():
            K = [fine_vector(self.maps[item, i]) for i in range(3)]
            f, w = product(K, f), product(K, w)
        r = Fine.of(self.radii[item])
        a, b, c = dot(w, w), dot(f, w), dot(f, f) - r * r
        c = select(own, Fine.of(np.zeros(len(ray))), c)
        D = b * b - a * c
        outside, ahead, meets = np.where(own, -1, c.sign()), b.sign(), D.sign()
        sure = (meets > 0) & np.where(outside > 0, ahead > 0, (outside < 0) & (~own | (ahead > 0)))
        gone = np.where(own, ahead < 0, (meets < 0) | ((outside > 0) & (ahead < 0)))
        root = Fine(np.maximum(D.h, 0), D.l, D.error).root()
        direct, n = (outside < 0) & (b.h >= 0), select(b.h < 0, -b, b) + root
        t = select(direct, n, select(outside < 0, -c, c)) / select(direct, a, n)
        return PairHits.of(ray, item, sure, gone, t)

    def solid(self, item: int) -> ExactSphere:
        K = self.maps[item].tolist() if self.bent[item] >= 0 else None
        return ExactSphere(self.centers[item].tolist(), float(self.radii[item]), K)


@dataclass(frozen=True, eq=False)
class Triangles(Kind):
    """vertices: (v, 3), in the world; faces: (m, 3), by rising surface and primitive; surface, primitive: (m,).

    With A' = A - o, e1 = B - A, e2 = C - A, N = e1 x e2 and R = A' x d, a ray meets a triangle if these have one sign:

        D = A'.N,    E_AB = d.(A' x B') = -e1.R,    E_CA = d.(C' x A') = e2.R,    E_BC = (N.d - E_CA) - E_AB,

    and at t = D / N.d.
    """

    vertices: Floats
    faces: Ids
    surface: Ids
    primitive: Ids

    @classmethod
    def of(cls, scene: Scene) -> Triangles:
        counts = [len(mesh.geometry.faces) for mesh in scene.meshes]
        first = np.cumsum([0, *(len(mesh.vertices) for mesh in scene.meshes)])
        faces = [mesh.geometry.faces + int(k) for mesh, k in zip(scene.meshes, first, strict=False)]
        return cls(
            np.concatenate([np.empty((0, 3)), *(mesh.vertices for mesh in scene.meshes)]),
            np.concatenate([np.empty((0, 3), np.int64), *faces]),
            np.repeat([mesh.number for mesh in scene.meshes], counts).astype(np.int64),
            np.concatenate([np.empty(0, np.int64), *map(np.arange, counts)]),
        )

    def primitives(self) -> Ids:
        return self.primitive

    @property
    def balls(self) -> tuple[Floats, Floats]:
        return ball_around([self.vertices[self.faces[:, i]] for i in range(3)])

    def hits(self, rays: Rays, ray: Ids, item: Ids) -> PairHits:
        A, B, C = (self.vertices[self.faces[item, i]] for i in range(3))
        e1, e2 = (tuple(Fine.gap(end[:, i], A[:, i]) for i in range(3)) for end in (B, C))
        to_a, w = rays.to(A, ray), at(rays.way, ray)
        N, R = cross(e1, e2), cross(to_a, w)
        D, den, ab, ca = dot(to_a, N), dot(N, w), -dot(e1, R), dot(e2, R)
        signs = np.array([x.sign() for x in (D, ab, ca, (den - ca) - ab)])
        gone = ((signs > 0).any(axis=0) & (signs < 0).any(axis=0)) | rays.leaves(self, ray, item)
        return PairHits.of(ray, item, (signs != 0).all(axis=0), gone, D / den)

    def solid(self, item: int) -> ExactTriangle:
        return ExactTriangle(self.vertices[self.faces[item]].tolist())


@dataclass(frozen=True, eq=False)
class Cylinders(Kind):
    """Cylinders with flat ends. starts, ends: (m, 3), S and E; radii: (m,).

    With f = S - o, u = E - S, F = f x u and G = d x u, a ray is within the endless cylinder between the roots of

        a t^2 - 2 b t + c = 0,    a = G.G,  b = F.G,  c = F.F - r^2 u.u,  D = b^2 - a c,

    and between the planes of the ends from t = N / g to t = N' / g, with g = d.u; N and N' are h = f.u and h + u.u, by
    the sign of g. It is in the solid from the later one of the two beginnings to the earlier one of the two ends. Where
    these are in another order, it passes by.
    """

    starts: Floats
    ends: Floats
    radii: Floats
    surface: Ids

    @classmethod
    def of(cls, scene: Scene) -> Cylinders:
        start, end, radius, number = (scene.cylinders[name] for name in ("start", "end", "radius", "number"))
        return cls(start, end, radius, number.astype(np.int64))

    @property
    def balls(self) -> tuple[Floats, Floats]:
        return ball_around([self.starts, self.ends], self.radii)

    def hits(self, rays: Rays, ray: Ids, item: Ids) -> PairHits:
        f, w, r = rays.to(self.starts[item], ray), at(rays.way, ray), Fine.of(self.radii[item])
        u = tuple(Fine.gap(self.ends[item, i], self.starts[item, i]) for i in range(3))
        g, h, uu = dot(w, u), dot(f, u), dot(u, u)
        F, G, X = cross(f, u), cross(w, u), cross(f, w)
        k, V = h + uu, dot(u, X)
        # D is u.u times that of the distance from the axis, which does not cancel as b^2 - a c does.
        a, b, c = dot(G, G), dot(F, G), dot(F, F) - r * r * uu
        D = uu * (a * r * r - V * V)
        root = Fine(np.maximum(D.h, 0), np.where(D.h > 0, D.l, 0), D.error).root()
        ahead, forth = b.h > 0, g.h > 0
        q = select(ahead, b, -b) + root
        outer, inner = select(ahead, q, -q) / a, select(ahead, c, -c) / q
        first = select(forth, h, k) / g, select(ahead, inner, outer)
        last = select(forth, k, h) / g, select(ahead, outer, inner)
        late, soon = (first[0] - first[1]).sign(), (last[0] - last[1]).sign()
        begin, end = select(late > 0, *first), select(soon < 0, *last)
        order = (D.sign() > 0) & (a.sign() > 0) & (g.sign() != 0) & (late != 0) & (soon != 0)
        there = (end - begin).sign()
        t = select(begin.sign() > 0, begin, end)
        sure = order & (there > 0) & ((begin.sign() > 0) | ((begin.sign() < 0) & (end.sign() > 0)))
        gone = (D.sign() < 0) | (order & ((there < 0) | ((there > 0) & (end.sign() < 0))))
        return PairHits.of(ray, item, sure, gone, t)

    def solid(self, item: int) -> ExactCylinder:
        return ExactCylinder(self.starts[item].tolist(), self.ends[item].tolist(), float(self.radii[item]))
