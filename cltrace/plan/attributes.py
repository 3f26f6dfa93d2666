"""What the corners of triangles have for shading: normals and texture coordinates, as the kernel reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import Precision, dtype_of, real_dtype
from cltrace.scene import PlacedMesh


@dataclass(frozen=True)
class Attributes:
    """The normals and texture coordinates of k meshes. What several meshes share is there once.

    mesh: (k,) records of abi's `Mesh`; corner_normal: (n, 4) of real_dtype(), in the objects' spaces, each object's
    divided by a power of two so that no number exceeds 1; normal_face: (f, 4) int32, which normals the corners of a
    triangle have, -1 for none; corner_uv: (j, 2) of real_dtype(); uv_face: (g, 4) int32, likewise.
    """

    mesh: NDArray[np.void]
    corner_normal: NDArray[Any]
    normal_face: NDArray[np.int32]
    corner_uv: NDArray[Any]
    uv_face: NDArray[np.int32]

    @classmethod
    def of(cls, meshes: tuple[PlacedMesh, ...], precision: Precision, with_uv: bool) -> Attributes:
        """The attributes of a scene's meshes. with_uv: whether texture coordinates are needed."""
        real = real_dtype(precision)
        mesh = np.zeros(len(meshes), dtype_of("Mesh", precision))
        normals, uvs = _Table(4, real), _Table(2, real)
        for record, placed in zip(mesh, meshes, strict=True):
            shape = placed.geometry
            for name, row in zip(("normal_x", "normal_y", "normal_z"), placed.normal_to_world, strict=True):
                record[name][:3] = row
            record["normals"][0] = normals.add(id(shape), _scaled(shape.normals), shape.normal_of)
            record["uvs"][0] = uvs.add(id(shape), shape.uv, shape.uv_of) if with_uv else -1
        return cls(mesh, *normals.arrays(), *uvs.arrays())

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The kernel's buffers by name."""
        return dict(self.__dict__)


class _Table:
    """Rows of numbers, and triangles that have three of them each."""

    def __init__(self, width: int, real: np.dtype[Any]) -> None:
        self._rows = [np.zeros((0, width), real)]
        self._faces = [np.zeros((0, 4), np.int32)]
        self._count = self._triangles = 0
        self._begin: dict[int, int] = {}

    def add(self, key: int, rows: NDArray[np.float64], faces: NDArray[np.int32]) -> int:
        """Where the triangles of these faces begin, -1 where there are no rows; those of a known key are there."""
        if key not in self._begin:
            self._begin[key] = self._triangles if len(rows) else -1
            if len(rows):
                wide = np.zeros((len(rows), self._rows[0].shape[1]), self._rows[0].dtype)
                wide[:, : rows.shape[1]] = rows
                indices = np.full((len(faces), 4), -1, np.int32)
                indices[:, :3] = faces
                if self._count:
                    indices[:, :3][faces >= 0] += self._count
                self._rows.append(wide)
                self._faces.append(indices)
                self._count += len(rows)
                self._triangles += len(faces)
        return self._begin[key]

    def arrays(self) -> tuple[NDArray[Any], NDArray[np.int32]]:
        return np.concatenate(self._rows), np.concatenate(self._faces)


def _scaled(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divided by a power of two, so that the largest number is less than 1, and at least 1/2 if there is one but 0."""
    return np.asarray(np.ldexp(normals, -np.frexp(np.abs(normals).max(initial=0))[1]))
