"""What a shape is to a scene: of those in OTHERS, Scene, cameras and changes know this alone."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from cltrace.scene.rules import ANY, check_rule

if TYPE_CHECKING:
    from cltrace.scene.spheres import Columns

Floats = NDArray[np.float64]
Ids = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surfaces(ABC):
    """All surfaces of one shape. Its fields are those of Scene that hold them.

    words: what they are, in messages; most: how many there may be, infinite where moved() looks after that.
    """

    words: ClassVar[str]
    most: ClassVar[float] = math.inf

    @abstractmethod
    def __len__(self) -> int:
        """How many surfaces of the scene they are."""

    def __str__(self) -> str:
        return f"{len(self)} {self.words}"

    @abstractmethod
    def reach(self, directions: Floats) -> list[Floats]:
        """How far they reach, in parts, (k,) each: for each direction d the largest p.d of all points p on them.

        directions: (k, 3), of any length, in the world.
        """

    @property
    def counted(self) -> int:
        """How many count for `most`."""
        return len(self)

    @abstractmethod
    def moved(self, moves: Floats, first: int, spheres: int) -> Self:
        """They once for each offset, (k, 3), in scene units, numbered from `first` on. Raises ValueError.

        spheres: how many there are before they are moved.
        """


@dataclass(frozen=True, eq=False)
class NumberedSurfaces(Surfaces):
    """Surfaces beside the spheres, which know their numbers. Without arguments there are none."""

    @classmethod
    @abstractmethod
    def checked(cls, given: Any, materials: int, spheres: int) -> Self:
        """Of what Scene is given for its fields, by name, with so many materials and spheres.

        Raises ValueError and TypeError, which name the field and the index.
        """

    @property
    @abstractmethod
    def numbers(self) -> Ids:
        """(n,): theirs among all surfaces."""

    @property
    def wholes(self) -> Ids:
        """(n,): of each one its number, or that of the one whose other half it is."""
        return self.numbers

    @property
    @abstractmethod
    def materials(self) -> Ids:
        """(m,): the indices of those materials that they do not share with spheres."""

    @abstractmethod
    def with_materials(self, materials: Ids) -> Self:
        """The same with other indices of these."""

    def beside(self, spheres: int, was: int) -> Self:
        """The same where there are so many spheres instead of `was`. Raises ValueError where that makes no sense."""
        return self

    def following(self, columns: Columns, first: int) -> Self:
        """The same where the spheres are now. first: the number of the first one of these, if they are the last."""
        return self


def fields_of(shapes: Iterable[Surfaces]) -> dict[str, Any]:
    """The fields of Scene that shapes are."""
    return {f.name: getattr(shape, f.name) for shape in shapes for f in fields(shape)}


def moved(name: str, points: NDArray[Any], moves: Floats) -> Floats:
    """(k n, 3): n points by each of k offsets. Raises ValueError."""
    found: Floats = (moves[:, None] + points).reshape(-1, 3)
    check_rule(f"{name}, moved by offsets", ANY, found)
    return found
