"""What is at the points that rays meet: where they are, normals, texture coordinates."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

from cltrace.numbers.fine import Fine, FineVector, fine_vector
from cltrace.numbers.pairs import Floats, Pair
from cltrace.numbers.vectors import cross, dot
from cltrace.rays.fine import seen
from cltrace.rays.lines import Ids, Lines, differences
from cltrace.rays.surfaces import Surfaces
from cltrace.rays.whole import Exact
from cltrace.scene import PlacedMesh, Scene


class Attributes:
    """Of n rays, each of which meets the primitive `index`, -1 for none, at T, pairs in units of w.

    lines: makes the rays, when something is asked for.
    """

    def __init__(self, scene: Scene, surfaces: Surfaces, lines: Callable[[], Lines], index: Ids, T: Pair) -> None:
        self.scene, self.surfaces, self.index, self.T = scene, surfaces, index, T
        self._lines = lines

    @cached_property
    def lines(self) -> Lines:
        return self._lines()

    @cached_property
    def met(self) -> Ids:
        return np.flatnonzero(self.index >= 0)

    @cached_property
    def balls(self) -> Ids:
        return np.flatnonzero(self.surfaces.kinds(self.index)[0])

    @cached_property
    def rods(self) -> Ids:
        return np.flatnonzero(self.surfaces.kinds(self.index)[1])

    @cached_property
    def flat(self) -> Ids:
        return np.flatnonzero(self.surfaces.kinds(self.index)[2])

    @cached_property
    def point(self) -> Floats:
        out, t = np.full((len(self.index), 3), np.nan), self._t(self.met)
        o, w = fine_vector(self.lines.origin[self.met]), fine_vector(self.lines.w[self.met])
        out[self.met] = np.stack([(x + t * y).h for x, y in zip(o, w, strict=True)], axis=1)
        return out

    @cached_property
    def normal(self) -> Floats:
        out, q = np.zeros((len(self.index), 3)), self._own_normals
        bent = self.surfaces.bent[self.index[self.balls]]
        maps = np.concatenate([self.surfaces.maps, np.eye(3)[None]])[bent]  # of -1, the last one
        out[self.balls] = np.einsum("nji,nj->ni", maps, q)  # normals are turned by the transposed map
        out[self.rods] = self._rod_points[1]
        flat = self._flat_normals.copy()
        for mesh, rows, faces in self._meshes():
            corners = mesh.geometry.normal_of[faces]
            given = corners[:, 0] >= 0
            m = np.einsum("nk,nki->ni", self._weights[rows[given]], mesh.geometry.normals[corners[given]])
            m = m @ mesh.normal_to_world.T
            shown = (m * m).sum(axis=1) > 0
            flat[rows[given][shown]] = m[shown]
        out[self.flat] = flat
        out[self.met] = _unit(out[self.met])
        out[(out * self.lines.w).sum(axis=1) > 0] *= -1
        return out + 0.0  # makes -0 a 0

    @cached_property
    def uv(self) -> Floats:
        out, (x, y, z) = np.zeros((len(self.index), 2)), self._own_normals.T
        # As _around() of cltrace/reference/surfaces.py.
        around, down = np.arctan2(x + 0.0, z) / (2 * np.pi), np.arctan2(np.hypot(x, z), y) / np.pi
        out[self.balls] = np.stack([0.5 + around, down], axis=1)
        out[self.rods] = self._rod_points[0]
        for mesh, rows, faces in self._meshes():
            corners = mesh.geometry.uv_of[faces]
            given = corners[:, 0] >= 0
            places = mesh.geometry.uv[corners[given]]
            out[self.flat[rows[given]]] = np.einsum("nk,nki->ni", self._weights[rows[given]], places)
        return out

    def _t(self, rows: Ids) -> Fine:
        return Fine(self.T[0][rows], self.T[1][rows], np.zeros(len(rows)))

    @cached_property
    def _own_normals(self) -> Floats:
        """(balls, 3): unit normals in the own axes of ellipsoids, and in the world of spheres."""
        f, w = seen(self.lines, self.surfaces, self.balls, self.index[self.balls])
        t = self._t(self.balls)
        return _unit(np.stack([(t * x - y).h for x, y in zip(w, f, strict=True)], axis=1))

    @cached_property
    def _rod_points(self) -> tuple[Floats, Floats]:
        """(rods, 2): where points of cylinders are on a texture, and (rods, 3): normals outwards, of any length.

        A point is on a flat end if the plane of that is as near as the side: their distances are compared in doubles.
        """
        rod = self.index[self.rods] - self.surfaces.spheres
        start, r, t = self.surfaces.start[rod], self.surfaces.rod_radius[rod], self._t(self.rods)
        f, w = fine_vector(*differences(start, self.lines.origin[self.rods])), fine_vector(self.lines.w[self.rods])
        u = self.surfaces.end[rod] - start
        p = np.stack([(t * x - y).h for x, y in zip(w, f, strict=True)], axis=1)
        length = np.sqrt((u * u).sum(axis=1, keepdims=True))
        along = (p * u).sum(axis=1, keepdims=True) / length
        m = p - along * u / length
        size = np.sqrt((m * m).sum(axis=1, keepdims=True))
        gaps = np.abs(np.concatenate([size - r[:, None], along, length - along], axis=1))
        part = gaps.argmin(axis=1)
        normal = np.where(part[:, None] == 0, m / np.where(size > 0, size, 1), np.where(part == 1, -1, 1)[:, None] * u)
        helper = np.eye(3)[np.abs(u).argmin(axis=1)]
        e1 = np.cross(helper, u)
        e2 = np.cross(u, e1)
        x, y = ((m * e).sum(axis=1) / np.sqrt((e * e).sum(axis=1)) for e in (e1, e2))
        down = np.where(part == 1, 1.0, np.where(part == 2, 0.0, 1 - np.clip(along / length, 0, 1)[:, 0]))
        return np.stack([0.5 + np.arctan2(y, x) / (2 * np.pi), down], axis=1), normal

    def _corners(self, rows: Ids) -> list[FineVector]:
        """Corners of triangles, from where the rays start."""
        face, o = self.surfaces.face[self.index[rows] - self.surfaces.solids], self.lines.origin[rows]
        return [fine_vector(*differences(self.surfaces.vertex[face[:, k]], o)) for k in range(3)]

    @cached_property
    def _weights(self) -> Floats:
        """(flat, 3): how much each corner counts where rays meet triangles; together they are 1."""
        w, (A, B, C) = fine_vector(self.lines.w[self.flat]), self._corners(self.flat)
        with np.errstate(all="ignore"):
            volumes = [dot(w, cross(u, v)) for u, v in ((B, C), (C, A), (A, B))]
            total = volumes[0] + volumes[1] + volumes[2]
            shares = [x / total for x in volumes]
            out = np.stack([share.h for share in shares], axis=1)
            known = np.all([share.error < 2.0**-50 for share in shares], axis=0) & self.lines.plain[self.flat]
        rows = np.flatnonzero(~known)
        if len(rows):
            which = self.flat[rows]
            out[rows] = Exact(self.lines, self.surfaces, which, self.index[which]).weights().T
        return np.clip(out, 0, 1)

    @cached_property
    def _flat_normals(self) -> Floats:
        """(flat, 3): N of the triangles, of any length."""
        A, B, C = (
            self.surfaces.vertex[corner]
            for corner in self.surfaces.face[self.index[self.flat] - self.surfaces.solids].T
        )
        e, f = fine_vector(*differences(B, A)), fine_vector(*differences(C, A))
        return np.stack([x.h for x in cross(e, f)], axis=1)

    def _meshes(self) -> Iterator[tuple[PlacedMesh, Ids, Ids]]:
        """Each mesh that is met, the rows of `flat` where it is, and which of its triangles."""
        number = self.surfaces.number[self.index[self.flat]]
        for mesh in self.scene.meshes:
            rows = np.flatnonzero(number == mesh.number)
            if len(rows):
                yield mesh, rows, self.surfaces.primitive[self.index[self.flat[rows]]]


def _unit(v: Floats) -> Floats:
    """Vectors (n, 3) of length 1. The largest number goes to 1 first, for the range."""
    v = v / np.abs(v).max(axis=1, keepdims=True)
    return np.asarray(v / np.sqrt((v * v).sum(axis=1, keepdims=True)))
