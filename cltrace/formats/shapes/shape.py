"""What a shape is to a scene file: a row of SHAPES in table.py, of which the reader knows this alone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.formats.xml_bulk import FINISHED
from cltrace.formats.xml_checks import Checks, Numbers
from cltrace.scene import Camera, MeshFile


class Shape(ABC):
    """The surfaces of one element so far, whose faults and warnings `checks` are told of."""

    def __init__(self, checks: Checks, instances: int) -> None:
        """instances: as of read()."""
        self.checks, self.instances = checks, instances
        self._finishes: list[Numbers] = [np.empty((0, FINISHED))]
        self._told: list[tuple[etree._Element, Sequence[float]]] = []

    @abstractmethod
    def take(self, element: etree._Element, number: int) -> None:
        """Reads a complete element with its number among all surfaces. Raises FatalError if these are too many."""

    def take_rest(self) -> None:
        """Reads what take() has put off of elements, before they are dropped. Raises FatalError likewise."""
        if self._told:
            elements, finishes = zip(*self._told, strict=True)
            self._told = []
            self.keep(elements, np.array(finishes))

    def tell(self, element: etree._Element, finish: Sequence[float]) -> None:
        """keep() of one surface, put off."""
        self._told.append((element, finish))

    def complete(self) -> None:  # noqa: B027 (most name none)
        """Reads the files that the elements name, after all of these."""

    def doubt_reach(self, view: Camera) -> None:  # noqa: B027 (most hold at any distance)
        """Warns of what reaches so far, for where the camera looks, that its colours may not hold."""

    def files(self) -> dict[int, MeshFile]:
        """The file of each surface that has one, by its number."""
        return {}

    def notes(self) -> Iterator[str]:
        """The warnings of these files."""
        return iter(())

    def counts(self) -> tuple[int, int]:
        """How many surfaces there are, and how many of them the files hold: those of a mesh that is placed again once.

        A triangle of a mesh is a surface.
        """
        count = sum(map(len, self._finishes))
        return count, count

    def keep(self, elements: Sequence[etree._Element], finishes: Numbers) -> None:
        """Keeps the finishes, (n, 11), of surfaces, and warns of what is odd about them."""
        self._finishes.append(finishes)
        self.checks.doubt(elements, finishes[:, :3])
        self.checks.doubt_shares(elements, finishes)

    @property
    def finishes(self) -> Numbers:
        """(n, 11), a finish of xml_bulk for each surface."""
        return np.concatenate(self._finishes)

    @abstractmethod
    def fields(self, materials: NDArray[np.integer[Any]]) -> dict[str, Any]:
        """The fields of Scene that they are. materials: (n,), the index of that of each surface."""
