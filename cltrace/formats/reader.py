"""Reads a scene file of the course's XML format into a `Scene`, or says everything that is wrong with it.

The file may be large. After each chunk of it, the elements that are complete are read and dropped from the tree, so
that memory grows with the packed records only. Spheres that are laid out as in the format's listing are converted in
bulk (`surfaces.bulk`). Everything else, and whatever has a fault, takes the careful path (`checks`), which alone words
the messages. Both paths give the same numbers.

The files of meshes and textures are read when the scene's own is over (`files`).
"""

from __future__ import annotations

import os
import warnings
from array import array
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.base.errors import SceneError, SceneWarning, located
from cltrace.base.limits import FEW, MAX_LIGHTS, MAX_PAIRS, MAX_PARTS, MAX_TRIANGLES, PAIRS_BYTES, hint
from cltrace.formats.checks import Checks, Children, vector_of
from cltrace.formats.document import LinesNeededError
from cltrace.formats.faults import FatalError, quoted
from cltrace.formats.schema import ELEMENTS, SECTIONS, Values, light_of
from cltrace.formats.surfaces import CylinderReader, MeshReader, ShapeReader, SphereReader, packed_materials
from cltrace.scene import LIGHT, Camera, Scene, Source, Vector

_VIEW = ("position", "lookat", "up")
_PARTS: Callable[[etree._Element], Any] = etree.XPath("count(//node()) + count(//@*)")


class _SceneReader(Checks):
    """One pass over a file: what it holds so far."""

    def __init__(self, path: str, exact: bool, instances: int) -> None:
        super().__init__(path, exact)
        self._transforms: dict[int, NDArray[np.float64]] = {}
        self._meshes = MeshReader(self, self._transforms, instances)
        # Materials are in this order.
        self._shapes: dict[str, ShapeReader] = {
            "sphere": SphereReader(self, self._transforms),
            "mesh": self._meshes,
            "cylinder": CylinderReader(self, self._transforms),
        }
        self._output_file = ""
        self._background: Vector = (0.0, 0.0, 0.0)
        self._camera: Values = {}
        self._lights: list[NDArray[np.void]] = []
        self._members = 0  # of all lights: those that are not soft are one
        self._camera_line = 0
        self._light_lines, self._surface_lines = array("i"), array("i")  # of those that are read, in their order
        self._sections: dict[etree._Element, Children] = {}  # of those that have begun

    # The file

    def run(self) -> None:
        """Reads the file; `result` then has what came of it."""
        document = self.document
        try:
            for _ in document.grow():
                self._take_complete()
            if document.malformed:
                self.faults.add(document.malformed.line, document.malformed.message)
                # In the elements that may be open nothing is missing yet: the last one, its last child, and so on.
                element = document.root
                while element is not None:
                    self.cut_off.add(element)
                    element = next(element.iterchildren("*", reversed=True), None)
            if document.root is not None:
                self._take(document.root, whole=True)
        except FatalError as fatal:
            self.faults.add(*fatal.args)

    def result(self) -> tuple[Scene, list[str]]:
        """The scene and the warnings, with the files that it names; raises SceneError if there are faults."""
        files, shapes = self.files, self._shapes.values()
        files.read_textures(self.faults, self.warnings)
        self._meshes.place()
        self._check_pairs()
        if self.faults.count or files.faults:
            raise SceneError(self.path, [*self.faults.in_order(), *files.faults], files.named())
        parts = [shape.finishes for shape in shapes]
        finishes = np.concatenate(parts)
        textured = finishes[:, -1] >= 0
        finishes[textured, -1] = np.array(files.textures.index)[finishes[textured, -1].astype(int)]
        materials, material_of = packed_materials(finishes)
        view = self._view()
        surfaces: dict[str, Any] = {}
        for shape, own in zip(shapes, np.split(material_of, np.cumsum([*map(len, parts)])[:-1]), strict=True):
            shape.doubt_reach(view)
            surfaces |= shape.fields(own)
        source = Source(
            self.path,
            view=view,
            camera=self._camera_line,
            lights=np.array(self._light_lines),
            surfaces=np.array(self._surface_lines),
            meshes=self._meshes.files(),
            textures=tuple(files.textures.found),
            transforms=self._transforms,
            files=files.named(),
        )
        scene = Scene(
            view,
            np.concatenate([np.zeros(0, LIGHT), *self._lights]),
            materials=materials,
            background=self._background,
            output_file=self._output_file,
            textures=files.textures.found.values(),
            **surfaces,
        ).read_from(source)
        ignored = [located(self.path, w.line, w.message) for w in self.warnings.in_order()]
        return scene, [*ignored, *self._meshes.notes()]

    def _check_pairs(self) -> None:
        """Complains about more pairs of a light and a surface than allowed, where nothing else is wrong."""
        triangles, in_files = self._meshes.triangles()
        if self.faults.count or self.files.faults or (triangles == in_files and self._members <= FEW):
            return
        surfaces = triangles + sum(shape.count for shape in self._shapes.values() if shape is not self._meshes)
        most = MAX_PAIRS * max(self.files.size, PAIRS_BYTES) // PAIRS_BYTES
        if self._members * surfaces > most:
            self.faults.add(
                self._light_lines[-1],
                f"lights: must be at most {most} pairs of a light and a surface, got {self._members} lights, with "
                f"all members of soft ones, and {surfaces} surfaces{hint('pairs')}",
            )

    def _view(self) -> Camera:
        view: dict[str, Any] = {name: vector_of(self._camera[name]) for name in _VIEW}
        return Camera(
            **view,
            horizontal_fov=self._camera["horizontal_fov"]["angle"],
            resolution=(self._camera["resolution"]["horizontal"], self._camera["resolution"]["vertical"]),
            max_bounces=self._camera["max_bounces"]["n"],
            square_pixels=False,  # the tutorial's rule for the shorter side
        )

    # Sections: scene, lights and surfaces

    def _take_complete(self) -> None:
        """Reads and drops what is complete."""
        root = self.document.root
        if root is None:
            return
        self._take(root, whole=False)
        self.document.forget_dropped()
        if _PARTS(root) > MAX_PARTS:
            element = root
            while element.tag in SECTIONS and len(element):
                element = element[-1]
            message = f"{element.tag}: must not have more than {MAX_PARTS} parts{hint('parts')}"
            raise FatalError(self.document.line_of(element), message)

    def _take(self, section: etree._Element, whole: bool) -> None:
        """Reads and drops the complete children of a section: all but the last, unless the section is `whole`."""
        if section not in self._sections:
            self._begin(section)
        children = list(section.iterchildren("*"))
        last = None if whole or not children else children.pop()
        {"scene": self._parts, "lights": self._lights_of, "surfaces": self._surfaces_of}[section.tag](section, children)
        del section[: len(children)]
        if whole:
            self._sections.pop(section).complete()
        elif last is not None and section is self.document.root and last.tag in SECTIONS[1:]:
            self._take(last, whole=False)
        elif last is not None and last.tag not in ELEMENTS[section.tag].known:
            _prune(last)

    def _begin(self, section: etree._Element) -> None:
        self._sections[section] = Children(self, section)
        values, _ = self.attributes(section)
        parent = section.getparent()
        if parent is not None:
            self._sections[parent].claim(section)
        elif "output_file" in values:
            self._output_file = values["output_file"]
            if Path(self._output_file).suffix.lower() != ".png":
                written = quoted(self._output_file)
                message = f"scene: output_file {written} does not end in .png, which is appended"
                self.warnings.add(self.document.line_of(section), message)
                self._output_file += ".png"

    def _parts(self, scene: etree._Element, children: Sequence[etree._Element]) -> None:
        for child in children:
            if child.tag in SECTIONS[1:]:
                self._take(child, whole=True)
            elif self._sections[scene].claim(child):
                values, whole = self.element(child)
                if child.tag == "camera":
                    self._check_view(child, values)
                    self._camera, self._camera_line = values, self.document.line_if_known(child)
                elif whole:
                    self._background = vector_of(values)
                    self.doubt_colors([child], np.array([self._background]))

    def _lights_of(self, lights: etree._Element, children: Sequence[etree._Element]) -> None:
        for child in children:
            if not self._sections[lights].claim(child):
                continue
            if self._members >= MAX_LIGHTS:
                raise FatalError(self.document.line_of(child), f"lights: must be at most {MAX_LIGHTS}{hint('lights')}")
            values, whole = self.element(child)
            self._members += 1
            if whole:
                light = light_of(child.tag, values)
                self._members += max(0, int(light["members"][0]) - 1)
                self._light_lines.append(self.document.line_if_known(child))
                self._lights.append(light)
                self.doubt_colors([child], light["color"])
                if self._members > MAX_LIGHTS:
                    message = f"lights: must be at most {MAX_LIGHTS} with all members of soft lights"
                    raise FatalError(self.document.line_of(child), f"{message}, got {self._members}{hint('lights')}")

    def _surfaces_of(self, surfaces: etree._Element, children: Sequence[etree._Element]) -> None:
        for child in children:
            shape = self._shapes.get(child.tag)
            if shape:
                shape.pending.append((child, len(self._surface_lines)))
                self._surface_lines.append(self.document.line_if_known(child))
            else:
                self._sections[surfaces].claim(child)  # which complains
        for shape in reversed(self._shapes.values()):  # which is the order of textures
            shape.read_pending()

    def _check_view(self, camera: etree._Element, values: Values) -> None:
        """Complains about a view that is undefined, in the words of `Camera`."""
        vectors = {name: tuple(values[name].values()) for name in _VIEW if name in values}
        # Only valid ones: that up is 0 has already been said.
        view: dict[str, Any] = {k: v for k, v in vectors.items() if len(v) == 3 and (k != "up" or any(v))}
        if "position" not in view or "lookat" not in view:
            return
        try:
            Camera(**view, resolution=(1, 1), max_bounces=0)  # which any limits allow
        except ValueError as error:
            name, _, fault = str(error).removeprefix("camera.").partition(": ")
            if name in view:  # It may be a default of the camera's.
                self.fault(next(camera.iterchildren(name)), f"camera {name}: {fault}")


def _prune(element: etree._Element) -> None:
    """Drops what is complete in an element that is still being parsed."""
    while len(element):
        del element[:-1]
        element = element[-1]


def load(path: str | os.PathLike[str]) -> Scene:
    """Reads a scene file of the course's XML format.

    Raises SceneError with all faults of the file. What the file has and no picture shows is a SceneWarning.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"path: must be a str or a Path, got {path!r}")
    scene, ignored = read(path)
    for text in ignored:
        warnings.warn(text, SceneWarning, stacklevel=2)
    return scene


def read(path: str | os.PathLike[str], lines: bool = False, instances: int = MAX_TRIANGLES) -> tuple[Scene, list[str]]:
    """The scene of a file and the warnings, such as "scene.xml:12: sphere: unknown attribute 'foo' ignored".

    lines: whether the scene's `source` is to know the lines beyond 65,534, too, which takes reading them twice;
    instances: how many triangles meshes may have whose files are named again. Raises SceneError with every fault of the
    file.
    """
    name = os.fspath(path)
    with suppress(LinesNeededError):
        scene, ignored = _read(name, False, instances)
        if not lines or (scene.source and scene.source.knows_all_lines):
            return scene, ignored
    return _read(name, True, instances)


def _read(path: str, exact: bool, instances: int) -> tuple[Scene, list[str]]:
    reader = _SceneReader(path, exact, instances)
    reader.run()
    return reader.result()
