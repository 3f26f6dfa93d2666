"""Meshes, whose files are read when the scene's own is over: a row of SHAPES."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.base.errors import located
from cltrace.base.limits import MAX_MESHES, MAX_TRIANGLES, MAX_VERTICES
from cltrace.formats.faults import FatalError
from cltrace.formats.shapes.shape import Shape
from cltrace.formats.xml_checks import Checks, Numbers
from cltrace.formats.xml_files import Contents
from cltrace.formats.xml_transforms import Steps, to_world
from cltrace.scene import ANY, Camera, MeshFile, PlacedMesh, place_faults

if TYPE_CHECKING:
    from cltrace.formats.obj import Obj


# Where corners are so many times as far away as what is seen, the kernel's points of narrow triangles lose digits that
# colours need: those of a mirrored ray that grazed a sphere were off by ten levels at 2.4 million times.
MAX_REACH = 1e6
AS_IT_IS = np.array(to_world(()))


class _Mesh(NamedTuple):
    """A mesh as the file has it: its line, which of the named files it is, its place, number, and texture."""

    line: int
    file: int
    to_world: Numbers
    number: int
    textured: bool


class Meshes(Shape):
    """Those of the file, and what their files hold."""

    def __init__(self, checks: Checks, instances: int) -> None:
        super().__init__(checks, instances)
        self._meshes: list[_Mesh] = []
        self._contents: Contents[Obj] = Contents()
        self._placed: list[PlacedMesh] = []

    def take(self, element: etree._Element, number: int) -> None:
        checks = self.checks
        if len(self._meshes) >= MAX_MESHES:
            raise FatalError(checks.document.line_of(element), f"surfaces: must be at most {MAX_MESHES} meshes")
        values, whole = checks.element(element)
        finish, line = checks.finish(element, values), checks.document.line_of(element)
        file = checks.files.meshes.add(values["name"], line) if "name" in values else -1
        place = self._place(element, checks.steps(values, number))
        if place is None:
            return
        if whole and finish is not None:
            self._meshes.append(_Mesh(line, file=file, to_world=place, number=number, textured=finish[-1] >= 0))
            self.tell(element, finish)

    def _place(self, element: etree._Element, steps: Steps) -> Numbers | None:
        """The map of the steps to the world; None, and complains, where it is none for meshes."""
        if not steps:
            return AS_IT_IS
        checks, place = self.checks, np.array(to_world(steps))
        extreme = place[~ANY.admits(place)].tolist()
        faults = [f"a number of its matrix {ANY.fault(extreme[0])}"] if extreme else place_faults(place)
        for fault in faults:
            checks.fault(element, f"mesh transform: {fault}")
            return None
        sizes = np.linalg.norm(place[:, :3], axis=0)
        checks.doubt_sizes([element], sizes.max(keepdims=True), sizes.min(keepdims=True))
        return place

    def complete(self) -> None:
        """Places the meshes whose files are right in the world; complains about those that are not right there."""
        faults = self.checks.faults
        self._contents = contents = self.checks.files.read_meshes(faults)
        triangles = vertices = again = 0
        seen = set[int]()
        for mesh in self._meshes:
            file = contents.of[mesh.file]
            if file is None:
                continue
            geometry = contents.found[file].geometry
            triangles, vertices = triangles + len(geometry.faces), vertices + len(geometry.vertices)
            if triangles > MAX_TRIANGLES or vertices > MAX_VERTICES:
                most = f"{MAX_TRIANGLES} triangles and {MAX_VERTICES} vertices"
                faults.add(mesh.line, f"surfaces: must be at most {most} of meshes")
                break
            again += len(geometry.faces) if file in seen else 0
            seen.add(file)
            if again > self.instances:
                most = f"at most {self.instances} triangles of files that are named again"
                faults.add(mesh.line, f"surfaces: must have {most}; --instances allows more")
                break
            try:
                self._placed.append(PlacedMesh(geometry, mesh.to_world, 0, mesh.number))
            except ValueError as error:
                faults.add(mesh.line, f"mesh: after the transform {str(error).partition('in the world, ')[2]}")

    def doubt_reach(self, view: Camera) -> None:
        most = MAX_REACH * math.dist(view.position, view.lookat)
        for mesh, placed in zip(self._meshes, self._placed, strict=True):
            reach = float(np.abs(placed.vertices - view.position).max(initial=0))
            if reach > most:
                words = f"mesh: reaches {reach:.2g} from the eye, which may spoil colours, which hold within {most:.2g}"
                self.checks.warnings.add(mesh.line, f"{words}: {MAX_REACH:g} times as far as the camera looks")

    def files(self) -> dict[int, MeshFile]:
        contents = self._contents
        files = [MeshFile(name, obj.lines) for name, obj in zip(contents.names, contents.found, strict=True)]
        file_of = ((mesh.number, contents.of[mesh.file]) for mesh in self._meshes)
        return {number: files[k] for number, k in file_of if k is not None}

    def counts(self) -> tuple[int, int]:
        placed, found = (mesh.geometry for mesh in self._placed), (obj.geometry for obj in self._contents.found)
        return sum(len(mesh.faces) for mesh in placed), sum(len(mesh.faces) for mesh in found)

    def notes(self) -> Iterator[str]:
        contents = self._contents
        textured = {contents.of[mesh.file] for mesh in self._meshes if mesh.textured}
        for i, (name, obj) in enumerate(zip(contents.names, contents.found, strict=True)):
            for warning in sorted([*obj.warnings, *(obj.unmapped if i in textured else [])]):
                yield located(self.checks.files.shown(name), warning.line, warning.message)

    def fields(self, materials: NDArray[np.integer[Any]]) -> dict[str, Any]:
        return {"meshes": [mesh.of(int(k), mesh.number) for mesh, k in zip(self._placed, materials, strict=True)]}
