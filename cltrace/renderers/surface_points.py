"""Points where rays meet surfaces: where they are, their normals, and where they are on a texture.

A point is found by its t, which is rounded: far from where a ray starts, that alone would be off. So each function
takes the point at t from a place of the surface, in pairs of doubles, and moves it along the ray onto the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cltrace.base.arithmetic import Fine, Floats, cross, dot, fine_vector, select
from cltrace.base.arrays import blockwise
from cltrace.oracle.search import Ids, Kind
from cltrace.oracle.shapes import Cylinders, Spheres, Triangles
from cltrace.scene import PlacedMesh


class Rays(NamedTuple):
    """k rays o + t w that meet something at t. o, w: (k, 3), t: (k,)."""

    o: Floats
    w: Floats
    t: Floats

    def at(self, rows: Ids | slice) -> Rays:
        return Rays(self.o[rows], self.w[rows], self.t[rows])

    @classmethod
    def of(cls, o: Floats, d: Floats, t: Floats) -> Rays:
        """Rays along d, of any length, which becomes w with a size of about 1."""
        with np.errstate(over="ignore"):
            _, exponent = np.frexp(np.abs(d).max(axis=1))
            return cls(o, np.ldexp(d, -exponent[:, None]), np.ldexp(t, exponent))

    def seen_from(self, place: Floats) -> Fine:
        """(k, 3): from these places to the points at t."""
        t = np.broadcast_to(self.t[:, None], self.w.shape)
        return Fine.of(t) * Fine.of(self.w) + Fine.gap(self.o, place)


class Spots(NamedTuple):
    """k points of surfaces: point, normal of any length, (k, 3); uv: (k, 2), 0 unless it was asked for."""

    point: Floats
    normal: Floats
    uv: Floats


def spots_of(
    kinds: Sequence[Kind], first: Ids, meshes: tuple[PlacedMesh, ...], item: Ids, rays: Rays, with_uv: bool
) -> Spots:
    """Of n rays, each of which meets the surface `item`, a row of all kinds, of which `first` are the first; -1: none.

    Normals have the length 1 and face where the ray comes from; where nothing is met, they are 0 and points are nan.
    """
    n = len(item)
    out = Spots(np.full((n, 3), np.nan), np.zeros((n, 3)), np.zeros((n, 2)))
    for kind, begin in zip(kinds, first, strict=False):
        rows = np.flatnonzero((item >= begin) & (item < begin + len(kind.surface)))

        def fill(part: slice, rows: Ids = rows, kind: Kind = kind, begin: int = begin) -> None:
            some = rows[part]
            found, of = _spots(kind, meshes, item[some] - begin, rays.at(some), with_uv), rays.w[some]
            normal = found.normal / np.abs(found.normal).max(axis=1, keepdims=True)
            normal /= np.sqrt((normal * normal).sum(axis=1, keepdims=True))
            normal *= np.where((normal * of).sum(axis=1) > 0, -1, 1)[:, None]
            out.point[some], out.normal[some], out.uv[some] = found.point, normal + 0.0, found.uv  # no -0

        if len(rows):
            blockwise(len(rows), fill)
    return out


def _spots(kind: Kind, meshes: tuple[PlacedMesh, ...], i: Ids, rays: Rays, with_uv: bool) -> Spots:
    with np.errstate(all="ignore"):
        if isinstance(kind, Triangles):
            return _on_triangles(kind, meshes, i, rays)
        if isinstance(kind, Spheres):
            return _on_spheres(kind, i, rays, with_uv)
        assert isinstance(kind, Cylinders)
        return _on_cylinders(kind, i, rays, with_uv)


def _small_root(a: Floats, b: Floats, c: Floats, D: Floats) -> Floats:
    """The root of a s^2 + 2 b s + c = 0 that is nearest to 0, by D = b^2 - a c; 0 where there is none."""
    q = np.abs(b) + np.sqrt(np.maximum(D, 0))
    return np.where(q > 0, -c / np.where(b < 0, -q, q), 0.0)


def _on_spheres(kind: Spheres, i: Ids, rays: Rays, with_uv: bool) -> Spots:
    center, r = kind.centers[i], kind.radii[i]
    p, w = rays.seen_from(center).h, rays.w
    own, along, maps = p, w, None
    if (kind.bent[i] >= 0).any():  # an ellipsoid is a sphere in its own axes
        maps = kind.maps[i]
        own, along = (np.einsum("nij,nj->ni", maps, v) for v in (p, w))
    f, d = own.T, along.T
    X, a, b = cross(f, d), dot(d, d), dot(f, d)
    s = _small_root(a, b, dot(f, f) - r * r, a * r * r - dot(X, X))[:, None]
    own = own + s * along
    normal = own if maps is None else np.einsum("nji,nj->ni", maps, own)
    uv = np.zeros((len(i), 2))
    if with_uv:
        x, y, z = own.T
        uv[:, 0] = 0.5 + np.arctan2(x + 0.0, z) / (2 * np.pi)
        uv[:, 1] = np.arctan2(np.hypot(x, z), y) / np.pi
    return Spots(center + (p + s * w), normal, uv)


def _on_cylinders(kind: Cylinders, i: Ids, rays: Rays, with_uv: bool) -> Spots:
    """On the flat end, the other one, or the side: where the point at t is the nearest, and on the rim on an end."""
    start, r, w = kind.starts[i], kind.radii[i], rays.w
    p, u = rays.seen_from(start).h, kind.ends[i] - kind.starts[i]
    uu, wu, pu = ((v * u).sum(axis=1) for v in (u, w, p))
    F, G, V = cross(p.T, u.T), cross(w.T, u.T), dot(u.T, cross(p.T, w.T))
    a = dot(G, G)
    side = _small_root(a, dot(F, G), dot(F, F) - r * r * uu, uu * (a * r * r - V * V))
    ends = np.array([-pu / wu, (uu - pu) / wu, np.where(a > 0, side, np.inf)])
    ends[~np.isfinite(ends)] = np.inf
    part = np.abs(ends).argmin(axis=0)
    s = np.take_along_axis(ends, part[None], axis=0)[0]
    p = p + np.where(np.isfinite(s), s, 0)[:, None] * w
    height = (p * u).sum(axis=1) / uu
    out = p - height[:, None] * u  # from the axis
    normal = np.where((part == 2)[:, None], out, np.where(part == 0, -1, 1)[:, None] * u)
    uv = np.zeros((len(i), 2))
    if with_uv:
        e1 = np.cross(np.eye(3)[np.abs(u).argmin(axis=1)], u)
        e2 = np.cross(u, e1)
        x, y = ((out * e).sum(axis=1) / np.sqrt((e * e).sum(axis=1)) for e in (e1, e2))
        uv[:, 0] = 0.5 + np.arctan2(y, x) / (2 * np.pi)
        uv[:, 1] = np.where(part == 0, 1.0, np.where(part == 1, 0.0, 1 - np.clip(height, 0, 1)))
    return Spots(start + p, normal, uv)


def _on_triangles(kind: Triangles, meshes: tuple[PlacedMesh, ...], i: Ids, rays: Rays) -> Spots:
    """In pairs throughout: of a sliver, doubles do not know the plane, nor how much each corner counts."""
    A, B, C = (kind.vertices[kind.faces[i, k]] for k in range(3))
    e, f, p = (tuple(v[:, k] for k in range(3)) for v in (Fine.gap(B, A), Fine.gap(C, A), rays.seen_from(A)))
    N, w = cross(e, f), fine_vector(rays.w)
    s = dot(N, p) / dot(N, w)
    s = select(np.isfinite(s.error), s, Fine.of(np.zeros(len(i))))
    x, y, z = (v - s * along for v, along in zip(p, w, strict=True))
    normal, uv = np.stack([n.h for n in N], axis=1), np.zeros((len(i), 2))
    point, weights = A + np.stack([x.h, y.h, z.h], axis=1), None
    for mesh in meshes:
        rows = np.flatnonzero(kind.surface[i] == mesh.number)
        geometry, faces = mesh.geometry, kind.primitive[i[rows]]
        if not len(rows) or not (len(geometry.normals) or len(geometry.uv)):
            continue
        if weights is None:
            b, c = (dot(v, N) / dot(N, N) for v in (cross((x, y, z), f), cross(e, (x, y, z))))
            weights = np.clip(np.stack([1 - (b.h + c.h), b.h, c.h], axis=1), 0, 1)
        given = geometry.normal_of[faces][:, 0] >= 0
        m = np.einsum("nk,nki->ni", weights[rows[given]], geometry.normals[geometry.normal_of[faces[given]]])
        m = m @ mesh.normal_to_world.T
        shown = (m * m).sum(axis=1) > 0
        normal[rows[given][shown]] = m[shown]
        given = geometry.uv_of[faces][:, 0] >= 0
        uv[rows[given]] = np.einsum("nk,nki->ni", weights[rows[given]], geometry.uv[geometry.uv_of[faces[given]]])
    return Spots(point, normal, uv)
