"""Meshes: a row of OTHERS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np

from cltrace.base.arrays import blockwise
from cltrace.scene.meshes import PlacedMesh, check_meshes, check_size
from cltrace.scene.shapes.shape import Floats, Ids, Other


@dataclass(frozen=True, eq=False)
class Meshes(Other):
    """meshes: by rising numbers."""

    meshes: tuple[PlacedMesh, ...] = ()
    words: ClassVar[str] = "meshes"

    @classmethod
    def checked(cls, given: Mapping[str, Any], materials: int, spheres: int) -> Meshes:
        return cls(check_meshes(given["meshes"], materials))

    def __len__(self) -> int:
        return len(self.meshes)

    def __str__(self) -> str:
        return f"{len(self)} meshes of {self.triangles} triangles"

    @property
    def triangles(self) -> int:
        """How many they have together."""
        return sum(len(mesh.geometry.faces) for mesh in self.meshes)

    @property
    def numbers(self) -> Ids:
        return np.array([mesh.number for mesh in self.meshes], np.int64)

    @property
    def materials(self) -> Ids:
        return np.array([mesh.material for mesh in self.meshes], np.int64)

    def with_materials(self, materials: Ids) -> Meshes:
        return Meshes(tuple(mesh.of(k, mesh.number) for mesh, k in zip(self.meshes, materials.tolist(), strict=True)))

    def beside(self, spheres: int, was: int) -> Meshes:
        if any(mesh.number < was for mesh in self.meshes):
            raise ValueError(f"centers: must be {was}, as there are meshes between the spheres, got {spheres}")
        return Meshes(tuple(mesh.of(mesh.material, mesh.number + spheres - was) for mesh in self.meshes))

    def moved(self, moves: Floats, first: int, spheres: int) -> Meshes:
        found = tuple(mesh.moved(move, first + i) for i, (move, mesh) in enumerate(product(moves, self.meshes)))
        check_size(found)
        return Meshes(found)

    def reach(self, directions: Floats) -> list[Floats]:
        def corners(block: slice) -> Floats:
            return np.asarray((vertices[block] @ directions.T).max(axis=0))

        parts: list[Floats] = []
        for mesh in self.meshes:
            if len(mesh.geometry.faces):
                vertices = mesh.vertices[np.unique(mesh.geometry.faces)]
                parts += blockwise(len(vertices), corners)
        return parts
