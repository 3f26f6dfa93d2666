"""Clipping planes: a scene shows only what is on the kept side of all of them.

The region that the planes keep is convex. So nothing is cut: a ray is limited to its range within the region, whatever
the shapes of the surfaces are, and where it enters the region inside of a closed surface, it meets a cap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.limits import MAX_PLANES
from cltrace.scene.colors import decoded
from cltrace.scene.cylinders import colors_of
from cltrace.scene.materials import Material, records
from cltrace.scene.rules import ANY, check_none, check_rule, checked, records_of
from cltrace.scene.surfaces import Floats, Ids, NumberedSurfaces

if TYPE_CHECKING:
    from cltrace.scene.scene import Scene

PLANE = np.dtype(
    [
        ("point", "f8", (3,)),  # of the plane, scene units
        ("normal", "f8", (3,)),  # of any length but 0; leads to the side that is left out
        ("material", "i4"),  # of caps: index into the scene's materials; -1: that of the surface which the cap closes
    ]
)


@dataclass(frozen=True, eq=False)
class Planes(NumberedSurfaces):
    """planes: PLANE. They have no surfaces of their own."""

    planes: NDArray[np.void] = field(default_factory=lambda: np.zeros(0, PLANE))
    words: ClassVar[str] = "clipping planes"

    @classmethod
    def checked(cls, given: Mapping[str, Any], materials: int, spheres: int) -> Planes:
        if given["planes"] is None:
            return cls()
        planes = records_of("planes", given["planes"], PLANE)
        _check_count(planes)
        for name in ("point", "normal"):
            check_rule(f"planes.{name}", ANY, planes[name])
        of = planes["material"]
        check_none("planes.normal", (planes["normal"] == 0).all(axis=1), "not 0", planes["normal"])
        check_none("planes.material", (of < -1) | (of >= materials), "-1 or the index of a material", of)
        return cls(planes)

    def __len__(self) -> int:
        return 0

    @property
    def numbers(self) -> Ids:
        return np.zeros(0, np.int64)

    @property
    def materials(self) -> Ids:
        """Those of caps with a colour of their own."""
        return self.planes["material"][self.planes["material"] >= 0].astype(np.int64)

    def with_materials(self, materials: Ids) -> Planes:
        planes = self.planes.copy()
        planes["material"][planes["material"] >= 0] = materials
        return Planes(planes)

    def moved(self, moves: Floats, first: int, spheres: int) -> Planes:
        """Planes stay where they are when surfaces are repeated."""
        return self

    def reach(self, directions: Floats) -> list[Floats]:
        return []


def clipped(scene: Scene, point: ArrayLike, normal: ArrayLike, cap_color: ArrayLike | None) -> Scene:
    """See Scene.clipped()."""
    plane = np.zeros(1, PLANE)
    plane["point"], plane["normal"] = checked("point", ANY, point, (3,)), checked("normal", ANY, normal, (3,))
    plane["material"] = -1
    if not plane["normal"].any():
        raise ValueError("normal: must not be 0")
    columns = scene.columns
    if cap_color is not None:
        kinds, _ = records([Material()])
        shown = colors_of("cap_color", 1, cap_color)
        if shown.shape != (3,):
            raise ValueError(f"cap_color: must be one colour, got an array of shape {shown.shape}")
        kinds["color"] = decoded(shown, scene.transfer)
        plane["material"] = columns.materials_count
        columns = columns.with_more(kinds)
    planes = np.concatenate([scene.planes, plane])
    _check_count(planes)
    return scene.with_fields(columns=columns, planes=planes)


def _check_count(planes: NDArray[np.void]) -> None:
    if len(planes) > MAX_PLANES:
        raise ValueError(f"planes: must be at most {MAX_PLANES}, got {len(planes)}")
