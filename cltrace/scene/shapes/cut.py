"""Balls that planes have cut, and the discs that cap them: one of OTHERS.

The solid is { x : |x - center| <= radius, 0 <= (x - start).u <= u.u } with u = end - start, all of these numbers as
they are. Of a flat one, the plane (x - start).u = 0 alone is there. Flat ones stand before those that they cap: where
both are met at once, which is wherever the cap is seen, the one of the lower number counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.base.limits import MAX_CYLINDERS
from cltrace.scene.rules import ANY, POSITIVE, check_rule, records_of
from cltrace.scene.surfaces import Floats, Ids, NumberedSurfaces, moved

CUT = np.dtype(
    [
        ("center", "f8", (3,)),  # scene units
        ("radius", "f8"),  # scene units
        ("start", "f8", (3,)),  # a point of the plane that cuts it
        ("end", "f8", (3,)),  # where a plane across the way from there is, beyond which there is nothing of it
        ("flat", "i4"),  # 1: only the disc in the first plane is there; 0: the solid
        ("material", "i4"),  # index into the scene's materials
        ("number", "i4"),  # among all surfaces
    ]
)


@dataclass(frozen=True, eq=False)
class Cuts(NumberedSurfaces):
    """cuts: CUT."""

    cuts: NDArray[np.void] = field(default_factory=lambda: np.zeros(0, CUT))
    words: ClassVar[str] = "cut balls and caps"
    most: ClassVar[float] = MAX_CYLINDERS

    @classmethod
    def checked(cls, given: Mapping[str, Any], materials: int, spheres: int) -> Cuts:
        if given["cuts"] is None:
            return cls()
        cuts = records_of("cuts", given["cuts"], CUT)
        _check(cuts, materials)
        return cls(cuts)

    def __len__(self) -> int:
        return len(self.cuts)

    @property
    def numbers(self) -> Ids:
        return self.cuts["number"].astype(np.int64)

    @property
    def materials(self) -> Ids:
        return self.cuts["material"].astype(np.int64)

    def _with(self, **values: Any) -> Cuts:
        cuts = self.cuts.copy()
        for name, value in values.items():
            cuts[name] = value
        return Cuts(cuts)

    def with_materials(self, materials: Ids) -> Cuts:
        return self._with(material=materials)

    def beside(self, spheres: int, was: int) -> Cuts:
        if (self.cuts["number"] < was).any():
            raise ValueError(f"centers: must be {was}, as there are cut balls between the spheres, got {spheres}")
        return self._with(number=self.cuts["number"] + (spheres - was))

    def moved(self, moves: Floats, first: int, spheres: int) -> Cuts:
        places = {name: moved(f"cuts.{name}", self.cuts[name], moves) for name in ("center", "start", "end")}
        cuts = np.tile(self.cuts, len(moves)).copy()  # of nothing, numpy makes no copy
        return Cuts(cuts)._with(**places, number=first + np.arange(len(cuts)))

    def reach(self, directions: Floats) -> list[Floats]:
        """Of whole balls."""
        lengths = np.sqrt((directions * directions).sum(axis=1))

        def balls(block: slice) -> Floats:
            of = self.cuts[block]
            return np.asarray((of["center"] @ directions.T + of["radius"][:, None] * lengths).max(axis=0))

        return blockwise(len(self.cuts), balls) if len(self.cuts) else []


def _check(cuts: NDArray[np.void], materials: int) -> None:
    """Raises ValueError, which names field and index, where a CUT array holds what is not allowed."""
    if len(cuts) > MAX_CYLINDERS:
        raise ValueError(f"cuts: must be at most {MAX_CYLINDERS}, got {len(cuts)}")
    for name, rule in (("center", ANY), ("start", ANY), ("end", ANY), ("radius", POSITIVE)):
        check_rule(f"cuts.{name}", rule, cuts[name])
    for name, lost, words in (
        ("end", (cuts["start"] == cuts["end"]).all(axis=1), "another place than the start"),
        ("flat", (cuts["flat"] != 0) & (cuts["flat"] != 1), "0 or 1"),
        ("material", (cuts["material"] < 0) | (cuts["material"] >= materials), "the index of a material"),
        ("number", cuts["number"] < 0, "at least 0"),
    ):
        if lost.any():
            i = int(np.argmax(lost))
            raise ValueError(f"cuts.{name}[{i}]: must be {words}, got {cuts[name][i]}")
