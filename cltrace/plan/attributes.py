"""What the corners of triangles have for shading: normals and texture coordinates, as the kernel reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise, empty, joined, widened
from cltrace.plan.abi import Precision, dtype_of, real_dtype
from cltrace.plan.shapes.triangle import Triangles
from cltrace.scene import PlacedMesh


@dataclass(frozen=True)
class Attributes:
    """The normals and texture coordinates of k meshes with t triangles. What several meshes share is there once.

    mesh: (k,) records of abi's `Mesh`; corner_normal: (n, 4) of real_dtype(), in the objects' spaces, in float32 each
    object's divided by a power of two so that no number exceeds 1; normal_face: (t, 4) int32, which three normals the
    corners of a triangle have, and its mesh, -1 where they have none; corner_uv: (j, 2) of real_dtype(); uv_face: (t,
    4) int32, which three of these, and -1 where there are none.
    """

    mesh: NDArray[np.void]
    corner_normal: NDArray[Any]
    normal_face: NDArray[np.int32]
    corner_uv: NDArray[Any]
    uv_face: NDArray[np.int32]

    @classmethod
    def of(
        cls, meshes: tuple[PlacedMesh, ...], triangles: Triangles, precision: Precision, with_uv: bool
    ) -> Attributes:
        """The attributes of a scene's meshes. with_uv: whether texture coordinates are needed."""
        real = real_dtype(precision)
        mesh = np.zeros(len(meshes), dtype_of("Mesh", precision))
        normals, uvs, narrow = _Table(4, real), _Table(2, real), real == np.float32
        for record, placed in zip(mesh, meshes, strict=True):
            shape = placed.geometry
            for name, row in zip(("normal_x", "normal_y", "normal_z"), placed.normal_to_world, strict=True):
                record[name][:3] = row
            # A double has room for the squares of what a scene may hold.
            normals.add(id(shape), shape.normals, shape.normal_of, _size(shape.normals) if narrow else 0)
            if with_uv:
                uvs.add(id(shape), shape.uv, shape.uv_of)
        (normal, normal_face), (corner_uv, uv_face) = normals.arrays(triangles), uvs.arrays(triangles)
        return cls(mesh, normal, normal_face, corner_uv=corner_uv, uv_face=uv_face)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The kernel's buffers by name."""
        return dict(self.__dict__)


class _Table:
    """Rows of numbers, and triangles that have three of them each."""

    def __init__(self, width: int, real: np.dtype[Any]) -> None:
        self._rows = [np.zeros((0, width), real)]
        self._faces: list[NDArray[np.int32]] = []
        self._count = 0
        self._begin: dict[int, int] = {}

    def add(self, key: int, rows: NDArray[np.float64], faces: NDArray[np.int32], size: int = 0) -> None:
        """Adds a mesh: its rows unless those of this key are there, and which ones its triangles have, -1 for none.

        size: the rows are divided by 2^size.
        """
        if key not in self._begin:
            self._begin[key] = self._count
            none = self._rows[0]
            self._rows.append(widened(np.ldexp(rows, -size) if size else rows, none.shape[1], none.dtype))
            self._count += len(rows)
        begin = np.int32(self._begin[key])
        self._faces.append(np.where(faces >= 0, faces + begin, -1).astype(np.int32) if begin else faces)

    def arrays(self, triangles: Triangles) -> tuple[NDArray[Any], NDArray[np.int32]]:
        """The rows, and for each of t triangles three of them and its mesh, or -1. If nothing was added, none."""
        rows = joined(self._rows)
        if not len(rows):
            return rows, np.full((len(triangles.face) if self._faces else 0, 4), (0, 0, 0, -1), np.int32)
        faces, out = joined(self._faces), empty((len(triangles.face), 4), np.int32)
        begin = np.cumsum([0, *(len(faces) for faces in self._faces)])[:-1]

        def fill(some: slice) -> None:
            mesh, number, four = triangles.face[some, 3] >> 1, triangles.number[some], out[some]
            four[:, :3] = faces.take(begin.take(mesh) + number if len(begin) > 1 else number, axis=0)
            four[:, 3] = mesh
            four[four[:, 0] < 0] = 0, 0, 0, -1

        blockwise(len(out), fill)
        return rows, out


def _size(normals: NDArray[np.float64]) -> int:
    """The k for which the largest number, divided by 2^k, is less than 1, and at least 1/2 unless all are 0."""
    return int(np.frexp(max(normals.max(initial=0), -normals.min(initial=0)))[1])
