"""Reads a scene file of the course's XML format into a `Scene`, or says everything that is wrong with it.

The file may be large: of each surface that has been read only numbers are kept. The files of meshes and textures are
read when the scene's own is over (`files`).
"""

from __future__ import annotations

import os
import warnings
from array import array
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import SceneError, SceneWarning, located
from cltrace.base.limits import FEW, MAX_LIGHTS, MAX_PAIRS, MAX_TRIANGLES, PAIRS_BYTES, hint
from cltrace.formats.elements import ElementReader
from cltrace.formats.faults import FatalError, quoted
from cltrace.formats.schema import Element, light_of
from cltrace.formats.surfaces import CylinderReader, MeshReader, ShapeReader, SphereReader, packed_materials, to_world
from cltrace.scene import LIGHT, Camera, Scene, Source

MAX_TRANSFORMS = 10_000  # whose steps are kept


class _SceneReader(ElementReader):
    """What a file holds so far."""

    def __init__(self, path: str, instances: int) -> None:
        super().__init__(path)
        self._spheres, self._meshes = SphereReader(self), MeshReader(self, instances)
        cylinders = CylinderReader(self)
        self._shapes: dict[str, ShapeReader] = {"sphere": self._spheres, "mesh": self._meshes, "cylinder": cylinders}
        self._lights = [np.zeros(0, LIGHT)]
        self._members = 0  # of all lights: those that are not soft are one
        self._light_lines, self._surface_lines = array("i"), array("i")
        self._finishes = array("d")  # of surfaces without faults, in order, 11 numbers each: see packed_materials()
        self._transforms: dict[int, NDArray[np.float64]] = {}  # the maps of the steps of the first surfaces

    def take(self, element: Element, parent: Element) -> None:
        if element.tag == "texture" and "name" in element:
            element.values["number"] = self.files.textures.add(element["name"], element.line)
        elif element.tag == "camera":
            self._check_view(element)
        elif parent.tag == "lights":
            self._take_light(element)
        elif parent.tag == "surfaces":
            self._take_surface(element)

    def _check_view(self, camera: Element) -> None:
        """Complains about a view that is undefined, in the words of `Camera`."""
        view: dict[str, Any] = {
            k: camera[k].numbers for k in ("position", "lookat", "up") if k in camera and camera[k].whole
        }
        if "position" not in view or "lookat" not in view:
            return
        try:
            Camera(**view, resolution=(1, 1), max_bounces=0)  # which any limits allow
        except ValueError as error:
            name, _, fault = str(error).removeprefix("camera.").partition(": ")
            if name in view:  # it may be a default of the camera's
                self.fault(camera[name], fault)

    def _take_light(self, element: Element) -> None:
        self._members += 1
        if element.whole:
            light = light_of(element)
            self._members += max(0, int(light["members"][0]) - 1)
            self._light_lines.append(element.line)
            self._lights.append(light)
        if self._members > MAX_LIGHTS:
            most = f"lights: must be at most {MAX_LIGHTS}, with all members of soft ones, got {self._members}"
            raise FatalError(element.line, f"{most}{hint('lights')}")

    def take_usual(self, text: bytes, begin: int, line: int) -> int:
        end, lines, finishes = self._spheres.read_usual(text, begin, line)
        first = len(self._surface_lines)
        self._spheres.numbers.extend(range(first, first + len(lines)))
        self._spheres.lines.extend(lines)
        self._surface_lines.extend(lines)
        self._finishes.frombytes(finishes.tobytes())
        return end

    def _take_surface(self, element: Element) -> None:
        shape, number = self._shapes[element.tag], len(self._surface_lines)
        self._surface_lines.append(element.line)
        if len(shape.numbers) == shape.most:
            raise FatalError(element.line, f"surfaces: must be at most {shape.most} {shape.words}")
        steps = element["transform"].steps if "transform" in element else []
        if steps and len(self._transforms) < MAX_TRANSFORMS:
            self._transforms[number] = np.array([to_world([step]) for step in steps])
        if shape.read(element, steps):
            shape.numbers.append(number)
            shape.lines.append(element.line)
            material = element.values.get("material_solid") or element["material_textured"]
            self._finishes.extend(material["color"].numbers if "color" in material else (1.0, 1.0, 1.0))
            for name in ("phong", "reflectance", "transmittance", "refraction"):
                self._finishes.extend(material[name].numbers)
            self._finishes.append(material["texture"]["number"] if "texture" in material else -1)

    def result(self) -> tuple[Scene, list[str]]:
        """The scene and the warnings, with the files that it names; raises SceneError if there are faults."""
        files, shapes = self.files, self._shapes.values()
        files.read_textures(self.faults, self.warnings)
        for shape in shapes:
            shape.check()
        if not self.faults.count and not files.faults:
            self._check_pairs()
        if self.faults.count or files.faults:
            raise SceneError(self.path, [*self.faults.in_order(), *files.faults], files.named())
        finishes = np.array(self._finishes).reshape(-1, 11)
        textured = finishes[:, -1] >= 0
        finishes[textured, -1] = np.array(files.textures.index)[finishes[textured, -1].astype(int)]
        materials, material_of = packed_materials(finishes)
        root = self.root
        assert root
        camera = root["camera"]
        seen = {name: camera[name].numbers for name in ("position", "lookat", "up", "resolution")}
        angle, bounces = camera["horizontal_fov"]["angle"], camera["max_bounces"]["n"]
        # The tutorial's rule for the shorter side is not that of square pixels.
        view = Camera(**seen, horizontal_fov=angle, max_bounces=bounces, square_pixels=False)
        given: dict[str, Any] = {"materials": materials, "textures": files.textures.found.values()}
        for shape in shapes:
            shape.doubt_reach(view)
            given |= shape.fields(material_of[np.array(shape.numbers)])
        output_file = root["output_file"]
        if Path(output_file).suffix.lower() != ".png":
            message = f"scene: output_file {quoted(output_file)} does not end in .png, which is appended"
            self.warnings.add(root.line, message)
            output_file += ".png"
        source = Source(
            self.path,
            view=view,
            camera=camera.line,
            lights=np.array(self._light_lines),
            surfaces=np.array(self._surface_lines),
            meshes=self._meshes.files(),
            textures=tuple(files.textures.found),
            transforms=self._transforms,
            files=files.named(),
        )
        given |= {"background": root["background_color"].numbers, "output_file": output_file}
        scene = Scene(view, np.concatenate(self._lights), **given).changed(source=source)
        ignored = [located(self.path, w.line, w.message) for w in self.warnings.in_order()]
        return scene, [*ignored, *self._meshes.notes()]

    def _check_pairs(self) -> None:
        """Complains about more pairs of a light and a surface than allowed."""
        if not self._meshes.again and self._members <= FEW:
            return
        surfaces = self._meshes.triangles + sum(
            len(shape.numbers) for shape in self._shapes.values() if shape is not self._meshes
        )
        most = MAX_PAIRS * max(self.files.size, PAIRS_BYTES) // PAIRS_BYTES
        if self._members * surfaces > most:
            got = f"{self._members} lights, with all members of soft ones, and {surfaces} surfaces{hint('pairs')}"
            words = f"lights: must be at most {most} pairs of a light and a surface, got {got}"
            self.faults.add(self._light_lines[-1], words)


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


def read(path: str | os.PathLike[str], instances: int = MAX_TRIANGLES) -> tuple[Scene, list[str]]:
    """The scene of a file and the warnings, such as "scene.xml:12: sphere: unknown attribute 'foo' ignored".

    instances: how many triangles meshes may have whose files are named again. Raises SceneError with every fault of the
    file.
    """
    reader = _SceneReader(os.fspath(path), instances)
    reader.parse()
    return reader.result()
