"""What the kernel needs to clip a scene by planes: see kernels/find/range.cl."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.accel.tree import Paths
from cltrace.plan.rounding import Array, Ints
from cltrace.plan.shapes.shape import Arrays, ShapePacking
from cltrace.scene import Scene


@dataclass(frozen=True, eq=False)
class Clipping:
    """The planes of a world, k of them, of which a surface may be left alone.

    point, normal: (k, 3), in the world; a normal leads to the kept side, and its largest coordinate is in [1, 2);
    material: (k,), the index of the caps' material, -1 for that of the surface that a cap closes; solid_of: (n,),
    abi's; solids: how many closed meshes there are.
    """

    point: Array
    normal: Array
    material: Ints
    solid_of: Ints
    solids: int

    def __bool__(self) -> bool:
        """Whether there are any planes."""
        return len(self.point) > 0

    @classmethod
    def of(cls, scene: Scene, shapes: Sequence[ShapePacking]) -> Clipping:
        planes = scene.planes
        if not len(planes):
            return cls(np.zeros((0, 3)), np.zeros((0, 3)), *(np.zeros(0, np.int32),) * 2, solids=0)
        _, exponent = np.frexp(np.abs(planes["normal"]).max(axis=1))
        normal = -np.ldexp(planes["normal"], 1 - exponent[:, None])
        closed = [mesh for mesh in scene.meshes if mesh.clipped and mesh.geometry.closed]
        number = {mesh.number: i for i, mesh in enumerate(closed, 1)}
        solid = np.zeros(1 + max((mesh.number for mesh in scene.meshes), default=0), np.int32)
        for mesh in scene.meshes:
            solid[mesh.number] = number.get(mesh.number, 0) if mesh.clipped else -1
        spheres, cylinders, meshes = shapes
        parts = [
            np.zeros(len(spheres.row), np.int32),
            -scene.cylinders["unclipped"].take(cylinders.row),
            solid.take(meshes.number),
        ]
        return cls(planes["point"], normal, planes["material"], np.concatenate(parts).astype(np.int32), len(closed))

    def arrays(self, real: np.dtype[Any], exponent: int | None, paths: Paths | None) -> Arrays:
        """The kernel's buffers by name. exponent: of the float buffers, where `real` is float; else None."""
        place: NDArray[Any] = self.point
        if exponent is not None and paths:
            place = np.ldexp(place - paths.middle, exponent)
        planes = np.zeros((len(place), 2, 4), real)
        planes[:, 0, :3], planes[:, 0, 3], planes[:, 1, :3] = place, self.material, self.normal
        return {"clip": planes.reshape(-1, 4), "solid_of": self.solid_of}

    def values(self) -> dict[str, Any]:
        """The kernel's arguments by name."""
        return {
            "planes": len(self.point),
            "surfaces": len(self.solid_of),
            "solids": self.solids,
            "unclipped": int((self.solid_of < 0).any()),
        }
