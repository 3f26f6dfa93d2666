"""Meshes cut by a plane: the triangles of one side, and what closes them, made of the lines where the plane cuts them.

Corners on the plane are rounded once. In between, normals and texture coordinates are what they were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.base.limits import MAX_TRIANGLES
from cltrace.scene.meshes import Geometry, PlacedMesh
from cltrace.scene.rules import SMALLEST
from cltrace.scene.surfaces import Floats

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Section:
    """Where a plane cuts a mesh.

    kept: the mesh on one side; lines: (n, 2, 3), where the triangles end there, in the world; closed: whether they go
    round what is inside, as those of a closed mesh do.
    """

    kept: PlacedMesh
    lines: Floats
    closed: bool

    @classmethod
    def of(cls, mesh: PlacedMesh, height: Floats) -> Section:
        """height: (v,), of its vertices above the plane; what is above or in it is kept."""
        shape, above = mesh.geometry, height >= 0
        inside = above[shape.faces]
        count = inside.sum(axis=1)
        # With the corner that is alone on its side first.
        cut = np.flatnonzero((count == 1) | (count == 2))
        turn = np.argmax(inside[cut] == (count[cut] == 1)[:, None], axis=1)
        corner = (turn[:, None] + np.arange(3)) % 3
        # Vertices at one place count as one: where a mesh has seams, or shares none, it is closed nevertheless.
        near, vertex = np.unique(shape.faces[cut], return_inverse=True)
        _, first, same = np.unique(mesh.vertices[near], axis=0, return_index=True, return_inverse=True)
        joined = near[first[same.reshape(-1)]][vertex.reshape(-1)].reshape(-1, 3)
        faces = np.take_along_axis(joined.astype(np.int64), corner, axis=1)
        alone = count[cut] == 1
        # The two edges from there that the plane cuts. Each is one however many triangles share it.
        ends = np.stack([faces[:, [0, 0]], faces[:, 1:]], axis=2)
        edges, edge_of = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
        edge_of = edge_of.reshape(-1, 2)
        a, b = height[edges].T
        share = a / (a - b)
        points = _between(shape.vertices, edges, share)
        # The share of the way from the corner that is alone.
        share_of = np.where(ends[:, :, 0] == edges[edge_of][:, :, 0], share[edge_of], 1 - share[edge_of])
        of = len(shape.vertices) + edge_of
        pieces = _pieces(faces, of, alone)
        whole = shape.faces[count == 3]
        rows, which = {}, {}
        for name in ("normals", "uv"):
            indices = getattr(shape, {"normals": "normal_of", "uv": "uv_of"}[name])
            own = np.take_along_axis(indices[cut].astype(np.int64), corner, axis=1)
            given = np.flatnonzero(own[:, 0] >= 0)
            some = np.stack([own[given][:, [0, 0]], own[given][:, 1:]], axis=2).reshape(-1, 2)
            values = getattr(shape, name)
            rows[name] = np.concatenate([values, _between(values, some, share_of[given].reshape(-1))])
            new = np.full(own[:, :2].shape, -1, np.int64)
            new[given] = len(values) + np.arange(len(some)).reshape(-1, 2)
            which[name] = np.concatenate([indices[count == 3], _pieces(own, new, alone)])
        used, faces = np.unique(np.concatenate([whole, pieces]), return_inverse=True)
        geometry = Geometry(
            np.concatenate([shape.vertices, points])[used],
            faces.reshape(-1, 3),
            rows["normals"],
            normal_of=which["normals"],
            uv=rows["uv"],
            uv_of=which["uv"],
        )
        kept = PlacedMesh(geometry, mesh.to_world, mesh.material, mesh.number)
        closed = bool((np.bincount(edge_of.reshape(-1), minlength=len(edges)) % 2 == 0).all())
        return cls(kept, kept.vertices[np.searchsorted(used, of)], closed)

    def cap(self, away: Floats) -> Geometry | None:
        """What closes it, None if that has no area. away: (3,), across the plane, to the side that is gone.

        Between two lines next to each other across the plane there are trapezoids, from each end of a line to the next.
        What an odd number of lines is in front of is inside. Raises ValueError where these are too many.
        """
        right = np.cross(away, np.eye(3)[np.abs(away).argmin()])
        up = np.cross(away, right)
        # Ends at one place have one x, which `@` does not promise.
        plane = (self.lines[:, :, None] * np.stack([right, up])).sum(axis=3)
        first = np.argsort(plane[:, :, 0], axis=1)
        line, plane = (np.take_along_axis(x, first[:, :, None], axis=1) for x in (self.lines, plane))
        x = np.unique(plane[:, :, 0])
        begin, end = (np.searchsorted(x, plane[:, k, 0]) for k in (0, 1))
        count = int((end - begin).sum())
        if count > MAX_TRIANGLES:
            words = f"meshes: the cap of surface {self.kept.number} must be at most"
            raise ValueError(f"{words} {MAX_TRIANGLES} triangles, got {count}")
        row = np.repeat(np.arange(len(line)), end - begin)
        slab = np.arange(len(row)) - np.repeat(np.cumsum(end - begin) - (end - begin), end - begin) + begin[row]
        shares = [(at - plane[row, 0, 0]) / (plane[row, 1, 0] - plane[row, 0, 0]) for at in (x[slab], x[slab + 1])]
        middle = (shares[0] + shares[1]) / 2
        height = plane[row, 0, 1] * (1 - middle) + plane[row, 1, 1] * middle
        order = np.lexsort((height, slab))
        sides = np.stack([line[row, 0] * (1 - s[:, None]) + line[row, 1] * s[:, None] for s in shares], axis=1)[order]
        low, high = sides[::2], sides[1::2]
        corners = np.concatenate([low, high[:, ::-1]], axis=1)  # round each trapezoid
        triangles = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
        area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        triangles = np.where(np.abs(triangles) < SMALLEST, 0, triangles)[area.any(axis=1)]
        if not len(triangles):
            return None
        return Geometry(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def _between(values: Floats, ends: Ints, share: Floats) -> Floats:
    """(n, c): of rows, at each share of the way between two of them; both ends are exact."""
    s = share[:, None]
    found = values[ends[:, 0]] * (1 - s) + values[ends[:, 1]] * s
    # No scene has smaller numbers.
    return np.asarray(np.where(np.abs(found) < SMALLEST, 0, found))


def _pieces(corner: Ints, new: Ints, alone: NDArray[np.bool_]) -> Ints:
    """What is kept of triangles: that at the corner that is alone, or else the two others, as two.

    corner: (n, 3), the indices of the corners, that one first; new: (n, 2), those on the edges from there; alone: (n,),
    whether that one is kept.
    """
    a, (b, c), (p, q) = corner[:, 0], corner[:, 1:].T, new.T
    one = np.stack([a, p, q], axis=1)[alone]
    two = [np.stack(three, axis=1)[~alone] for three in ((b, c, q), (b, q, p))]
    return np.concatenate([one, *two])
