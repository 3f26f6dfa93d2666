"""Cylinders: a row of SHAPES."""

from __future__ import annotations

from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.base.limits import MAX_CYLINDERS
from cltrace.formats.faults import FatalError
from cltrace.formats.shapes.shape import Shape
from cltrace.formats.xml_checks import Checks, vector_of
from cltrace.scene import CYLINDER


class Cylinders(Shape):
    """Each of them a record but for its material."""

    def __init__(self, checks: Checks, instances: int) -> None:
        super().__init__(checks, instances)
        self._found: list[tuple[Any, ...]] = []

    def take(self, element: etree._Element, number: int) -> None:
        checks = self.checks
        if len(self._found) >= MAX_CYLINDERS:
            raise FatalError(checks.document.line_of(element), f"surfaces: must be at most {MAX_CYLINDERS} cylinders")
        values, whole = checks.element(element)
        finish = checks.finish(element, values)
        if not whole or finish is None:
            return
        radius = np.array([values["radius"]])
        self._found.append((vector_of(values["start"]), vector_of(values["end"]), radius[0], 0, number))
        checks.doubt_sizes([element], radius, radius)
        self.tell(element, finish)

    def fields(self, materials: NDArray[np.integer[Any]]) -> dict[str, Any]:
        found = np.array(self._found, CYLINDER)
        found["material"] = materials
        return {"cylinders": found}
