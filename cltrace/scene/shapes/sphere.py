"""Spheres and ellipsoids, whose numbers are those that all other surfaces leave."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cltrace.base.arithmetic import inverses
from cltrace.base.arrays import blockwise
from cltrace.base.limits import MAX_SPHERES
from cltrace.scene.columns import Columns
from cltrace.scene.shapes.shape import Floats, Shape, moved


@dataclass(frozen=True, eq=False)
class Spheres(Shape):
    """columns: what they and materials hold; to_object: (k, 3, 3), the maps of ellipsoids."""

    columns: Columns
    to_object: Floats
    words: ClassVar[str] = "spheres"
    most: ClassVar[float] = MAX_SPHERES

    def __len__(self) -> int:
        return len(self.columns)

    def moved(self, moves: Floats, first: int, spheres: int) -> Spheres:
        of, k = self.columns, len(moves)
        radius, kind, material = (np.tile(x, k) if x.ndim else x for x in (of.radius, of.to_object, of.material_of))
        center = moved("centers", of.center, moves)
        return replace(self, columns=replace(of, center=center, radius=radius, to_object=kind, material=material))

    def reach(self, directions: Floats) -> list[Floats]:
        """An ellipsoid C + r L s, with |s| = 1, reaches d.C + r |L^T d|."""
        columns, lengths = self.columns, np.sqrt((directions * directions).sum(axis=1))
        stretch = np.sqrt((np.einsum("kij,ni->nkj", inverses(self.to_object), directions) ** 2).sum(axis=2))

        def part(block: slice) -> Floats:
            center = columns.center[block].astype(np.float64)
            radius = np.asarray(columns.radius[block] if columns.radius.ndim else columns.radius, np.float64)
            kind = columns.to_object[block] if columns.to_object.ndim else columns.to_object
            found = []
            for row, length, by in zip(directions, lengths, stretch, strict=True):
                size = np.where(kind >= 0, by[kind], length) if len(by) else length
                found.append((center @ row + radius * size).max())
            return np.array(found)

        return blockwise(len(columns), part) if len(columns) else []
