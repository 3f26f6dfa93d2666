"""Spheres and ellipsoids, many of which are converted together: a row of SHAPES."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.base.limits import MAX_SPHERES
from cltrace.formats.faults import FatalError
from cltrace.formats.shapes.shape import Shape
from cltrace.formats.xml_bulk import FINISH, NO_ROW, ROW, bulk, packed_spheres
from cltrace.formats.xml_checks import Checks, Numbers, vector_of
from cltrace.formats.xml_source import LinesNeededError
from cltrace.formats.xml_transforms import Maps, transformed
from cltrace.scene import ANY, POSITIVE, Camera, extent_faults, inverse_faults, reaches

# Whether rays meet ellipsoids is decided in pairs of doubles, which know squared distances to about 2^-104 of these. So
# many times as far away as they are thick, no digits are left for normals; at 1e16 times, one hit of 15 was wrong.
MAX_DISTANCE = 1e14


class Spheres(Shape):
    """Those of which the rest is yet to be read, and the rows of the others."""

    def __init__(self, checks: Checks, instances: int) -> None:
        super().__init__(checks, instances)
        self._rest: list[etree._Element] = []
        self._numbers: list[int] = []
        self._count = 0
        self._rows: list[Numbers] = [np.empty((0, ROW))]
        self._maps: dict[bytes, int] = {}  # of the ellipsoids, each once -> its index
        self._ellipsoids: list[Numbers] = []  # center, thickness, and line, 0 if that is not known

    def take(self, element: etree._Element, number: int) -> None:
        self._rest.append(element)
        self._numbers.append(number)

    def take_rest(self) -> None:
        spheres, numbers, checks = self._rest, self._numbers, self.checks
        self._rest, self._numbers = [], []
        room = MAX_SPHERES - self._count
        if len(spheres) > room:
            line = checks.document.line_of(spheres[room])
            raise FatalError(line, f"surfaces: must be at most {MAX_SPHERES} spheres")
        self._count += len(spheres)
        good, rows = bulk(spheres)
        maps: dict[int, Maps] = {}
        for i in np.flatnonzero(~good).tolist():
            rows[i], ellipsoid = self._sphere(spheres[i], numbers[i])
            if ellipsoid:
                maps[i] = ellipsoid
        if maps:
            self._take_maps(spheres, rows, maps)
        checks.doubt_sizes(spheres, rows[:, 0], rows[:, 0])
        self._rows.append(rows)
        self.keep(spheres, rows[:, FINISH])

    def _sphere(self, element: etree._Element, number: int) -> tuple[Sequence[float], Maps | None]:
        """The row of a sphere with its transform folded in, and the maps of an ellipsoid; NaN if it has a fault."""
        checks = self.checks
        values, whole = checks.element(element)
        finish = checks.finish(element, values)
        if not whole or finish is None:
            return NO_ROW, None
        steps = checks.steps(values, number)
        turns = "material_textured" in values
        center, radius, maps = transformed(vector_of(values["position"]), values["radius"], steps, turns)
        for name, rule, size in zip(("radius", *"xyz"), (POSITIVE, ANY, ANY, ANY), (radius, *center), strict=True):
            if fault := rule.fault(size):
                checks.fault(element, f"sphere: after the transform {name} {fault}")
        return [radius, *center, *finish, -1], maps

    def _take_maps(self, spheres: Sequence[etree._Element], rows: NDArray[np.float64], maps: dict[int, Maps]) -> None:
        """Gives rows of spheres, those of `maps`, the indices of their maps from the world; equal ones are one."""
        which, (to_world, to_object) = list(maps), np.array(list(maps.values())).swapaxes(0, 1)
        with np.errstate(divide="ignore"):  # which is a fault below
            largest, least = np.abs(to_world).max(axis=(1, 2)), 1 / np.abs(to_object).max(axis=(1, 2))
        self.checks.doubt_sizes([spheres[i] for i in which], largest, least)
        lines = [self.checks.document.line_if_known(spheres[i]) for i in which]
        self._ellipsoids.append(np.column_stack([rows[which, 1:4], rows[which, 0] * least, lines]))
        faults = dict(inverse_faults(to_world, to_object))
        for k, fault in faults.items():
            self.checks.fault(spheres[which[k]], f"sphere transform: {fault}")
        rest = [k for k in range(len(which)) if k not in faults]
        for k, fault in extent_faults(rows[which, 0][rest], reaches(to_object[rest])):
            self.checks.fault(spheres[which[rest[k]]], f"sphere: after the transform {fault}")
        rows[which, -1] = [self._maps.setdefault(matrix.tobytes(), len(self._maps)) for matrix in to_object]

    def doubt_reach(self, view: Camera) -> None:
        for part in self._ellipsoids:
            times = np.sqrt(((part[:, :3] - view.position) ** 2).sum(axis=1)) / part[:, 3]
            for i in np.flatnonzero(times > MAX_DISTANCE).tolist():
                line = int(part[i, 4])
                if not line:
                    raise LinesNeededError
                words = f"sphere: is {times[i]:.2g} times as far from the eye as its transform makes it thick"
                self.checks.warnings.add(line, f"{words}, which may spoil colours, which hold within {MAX_DISTANCE:g}")

    def fields(self, materials: NDArray[np.integer[Any]]) -> dict[str, Any]:
        to_object = np.frombuffer(b"".join(self._maps)).reshape(-1, 3, 3)
        return {"spheres": packed_spheres(np.concatenate(self._rows), materials), "to_object": to_object}
