"""Reads a scene file of the course's XML format into a `Scene`, or says everything that is wrong with it.

The file may be large. After each chunk of it, the elements that are complete are read and dropped from the tree, so
that memory grows with the packed records only. Spheres that are laid out as in the format's listing are converted in
bulk (`xml_bulk`). Everything else, and whatever has a fault, takes the careful path (`_Reader._element`), which alone
words the messages. Both paths give the same numbers.

The files of meshes and textures are read when the scene's own is over (`xml_files`).
"""

from __future__ import annotations

import functools
import os
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.base.errors import SceneError, located
from cltrace.formats.faults import MAX_MESSAGES, FatalError, Messages, closest
from cltrace.formats.xml_bulk import FINISH, NO_ROW, ROW, SHARES, bulk, packed_materials, packed_spheres
from cltrace.formats.xml_elements import ELEMENTS, MEANT, SECTIONS, Values, light_of, rotations
from cltrace.formats.xml_files import Contents, Files
from cltrace.formats.xml_source import Document, LinesNeededError
from cltrace.formats.xml_transforms import Maps, Steps, maps_of, to_world, transformed
from cltrace.formats.xml_values import like_bytes, quoted, short, value
from cltrace.scene import (
    ANY,
    CYLINDER,
    LIGHT,
    MAX_CYLINDERS,
    MAX_LIGHTS,
    MAX_MESHES,
    MAX_SPHERES,
    MAX_TRIANGLES,
    MAX_VERTICES,
    POSITIVE,
    Camera,
    MeshFile,
    PlacedMesh,
    Scene,
    Source,
    Texture,
    Vector,
    extent_faults,
    inverse_faults,
    place_faults,
    reaches,
)

if TYPE_CHECKING:
    from cltrace.formats.obj import Obj

MAX_PARTS = 100_000  # of one sphere, mesh, light or other element, which is kept until it is complete

MAX_TRANSFORMS = 10_000  # whose steps are kept

# Colours are computed in float32, whose numbers are 2^-126 to 2^128 where they keep their digits. Sizes and their
# inverses are squared for lengths, so they stay in there up to this.
MAX_SIZE = 2.0**63

_VIEW = ("position", "lookat", "up")
_PARTS: Callable[[etree._Element], Any] = etree.XPath("count(//node()) + count(//@*)")


Numbers = NDArray[np.float64]


class _Mesh(NamedTuple):
    """A mesh as the file has it: its line, which of the named files it is, its place, number and finish (xml_bulk)."""

    line: int
    file: int
    to_world: NDArray[np.float64]
    number: int
    finish: NDArray[np.float64]


class _Cylinder(NamedTuple):
    """A cylinder as the file has it."""

    start: Vector
    end: Vector
    radius: float
    number: int
    finish: NDArray[np.float64]


class _Children:
    """The children of an element so far: which of those that may occur once it has, and which are unknown."""

    def __init__(self, reader: _Reader, element: etree._Element) -> None:
        self.reader, self.element = reader, element
        self.schema, self.label = ELEMENTS[element.tag], _label(element)
        self.filled: set[str] = set()
        self.strays: dict[str, int] = {}

    def claim(self, child: etree._Element) -> bool:
        """Whether the child is to be read; if not, it has been complained about."""
        slot = self.schema.slots.get(child.tag)
        if slot is None and child.tag not in self.schema.many:
            known = self.wanted(child)
            line = self.reader.warn_unknown(child, self.label, what="element <{}>", name=child.tag, known=known)
            if len(self.strays) < MAX_MESSAGES:
                self.strays.setdefault(child.tag, line)
            return False
        if slot in self.filled:
            self.reader.fault(child, f"{self.label}: <{child.tag}> must occur only once")
            return False
        if slot:
            self.filled.add(slot)
        return True

    def wanted(self, stray: etree._Element) -> tuple[str, ...]:
        """What a stray child may have been meant to be."""
        if self.element.tag == "transform" and stray.tag.lower() in ("rotate", "rotation"):
            return rotations({str(name): str(value) for name, value in stray.attrib.items()})
        return tuple(name for name in self.schema.known if self.schema.slots.get(name) not in self.filled)

    def complete(self) -> bool:
        """Whether every required child has been there; complains about those that have not."""
        missing = [slot for slot in self.schema.children if slot not in self.filled]
        if self.element not in self.reader.cut_off:
            for slot in missing:
                self._complain(slot)
        return not missing

    def _complain(self, slot: str) -> None:
        names = slot.split("|")

        def hint() -> str:
            stray = next(filter(None, (closest(name, tuple(self.strays)) for name in names)), None)
            known = (MEANT[self.element.tag, name] for name in self.strays if (self.element.tag, name) in MEANT)
            return next(known, f"; did you mean <{short(stray)}> on line {self.strays[stray]}?" if stray else "")

        missing = " or ".join(f"<{name}>" for name in names)
        self.reader.fault(self.element, f"{self.label}: {missing} is missing", hint)


def _label(element: etree._Element) -> str:
    parent = element.getparent()
    return element.tag if parent is None or parent.tag in SECTIONS else f"{parent.tag} {element.tag}"


class _Reader:
    """One pass over a file: what it holds so far, and what is wrong with it."""

    def __init__(self, path: str, exact: bool, instances: int) -> None:
        self.path, self.document, self._instances = path, Document(path, exact), instances
        self.faults, self.warnings = Messages(), Messages()
        self.cut_off: set[etree._Element] = set()  # the elements that may be open where the file ceases to be XML
        self._output_file = ""
        self._background: Vector = (0.0, 0.0, 0.0)
        self._camera: Values = {}
        self._lights: list[NDArray[np.void]] = []
        self._members = 0  # of all lights: those that are not soft are one
        self._rows: list[NDArray[np.float64]] = []
        self._maps: dict[bytes, int] = {}  # of the ellipsoids, each once -> its index
        self._sphere_count = 0
        self._camera_line = 0
        self._light_lines, self._surface_lines = array("i"), array("i")  # of those that are read, in their order
        self._transforms: dict[int, NDArray[np.float64]] = {}
        self._meshes: list[_Mesh] = []
        self._cylinders: list[_Cylinder] = []
        self._files = Files(path)
        self._sections: dict[etree._Element, _Children] = {}  # of those that have begun

    # Messages

    def fault(self, element: etree._Element, message: str, hint: Callable[[], str] = lambda: "") -> None:
        self.faults.add(self.document.line_of(element), message, hint)

    def warn_unknown(self, element: etree._Element, label: str, what: str, name: str, known: tuple[str, ...]) -> int:
        """Warns of an unknown attribute or element and returns its line."""
        line = self.document.line_of(element)

        def hint() -> str:
            meant = closest(name, known)
            return f"; did you mean {what.partition(' ')[2].format(meant)}?" if meant else ""

        self.warnings.add(line, f"{label}: unknown {what.format(short(name))} ignored", hint)
        return line

    # The file

    def run(self) -> None:
        """Reads the file; `result` then has what came of it."""
        try:
            self._parse()
        except FatalError as fatal:
            self.faults.add(*fatal.args)

    def result(self) -> tuple[Scene, list[str]]:
        """The scene and the warnings, with the files that it names; raises SceneError if there are faults."""
        textures = self._files.read_textures(self.faults, self.warnings)
        shapes = self._files.read_meshes(self.faults)
        placed = self._placed_meshes(shapes)
        if self.faults.count or self._files.faults:
            raise SceneError(self.path, [*self.faults.in_order(), *self._files.faults], self._files.named())
        rows = np.concatenate([np.empty((0, ROW)), *self._rows])
        others: list[_Mesh | _Cylinder] = [*self._meshes, *self._cylinders]
        finishes = np.concatenate([rows[:, FINISH], *(other.finish[None] for other in others)])
        with_texture = finishes[:, -1] >= 0
        finishes[with_texture, -1] = np.array(textures.of)[finishes[with_texture, -1].astype(int)]
        materials, material_of = packed_materials(finishes)
        view, of_meshes = self._view(), material_of[len(rows) : len(rows) + len(placed)]
        scene = Scene(
            view,
            np.concatenate([np.zeros(0, LIGHT), *self._lights]),
            packed_spheres(rows, material_of[: len(rows)]),
            materials,
            background=self._background,
            output_file=self._output_file,
            to_object=np.frombuffer(b"".join(self._maps)).reshape(-1, 3, 3),
            meshes=[mesh.of(int(k), mesh.number) for mesh, k in zip(placed, of_meshes, strict=True)],
            textures=textures.found,
            cylinders=self._packed_cylinders(material_of[len(rows) + len(placed) :]),
        ).read_from(self._source(view, shapes, textures))
        return scene, [*(located(self.path, w.line, w.message) for w in self.warnings.in_order()), *self._notes(shapes)]

    def _source(self, view: Camera, shapes: Contents[Obj], textures: Contents[Texture]) -> Source:
        files = [MeshFile(name, obj.lines) for name, obj in zip(shapes.names, shapes.found, strict=True)]
        file_of = ((mesh.number, shapes.of[mesh.file]) for mesh in self._meshes)
        return Source(
            self.path,
            view=view,
            camera=self._camera_line,
            lights=np.array(self._light_lines),
            surfaces=np.array(self._surface_lines),
            meshes={number: files[k] for number, k in file_of if k is not None},
            textures=tuple(textures.names),
            transforms=self._transforms,
            files=self._files.named(),
        )

    def _view(self) -> Camera:
        view: dict[str, Any] = {name: _vector(self._camera[name]) for name in _VIEW}
        return Camera(
            **view,
            horizontal_fov=self._camera["horizontal_fov"]["angle"],
            resolution=(self._camera["resolution"]["horizontal"], self._camera["resolution"]["vertical"]),
            max_bounces=self._camera["max_bounces"]["n"],
            square_pixels=False,  # the tutorial's rule for the shorter side
        )

    def _placed_meshes(self, shapes: Contents[Obj]) -> list[PlacedMesh]:
        """The meshes whose files are right, in the world; complains about those that are not right there."""
        placed: list[PlacedMesh] = []
        triangles = vertices = again = 0
        seen = set[int]()
        for mesh in self._meshes:
            file = shapes.of[mesh.file]
            if file is None:
                continue
            geometry = shapes.found[file].geometry
            triangles, vertices = triangles + len(geometry.faces), vertices + len(geometry.vertices)
            if triangles > MAX_TRIANGLES or vertices > MAX_VERTICES:
                most = f"{MAX_TRIANGLES} triangles and {MAX_VERTICES} vertices"
                self.faults.add(mesh.line, f"surfaces: must be at most {most} of meshes")
                break
            again += len(geometry.faces) if file in seen else 0
            seen.add(file)
            if again > self._instances:
                most = f"at most {self._instances} triangles of files that are named again"
                self.faults.add(mesh.line, f"surfaces: must have {most}; --instances allows more")
                break
            try:
                placed.append(PlacedMesh(geometry, mesh.to_world, 0, mesh.number))
            except ValueError as error:
                self.faults.add(mesh.line, f"mesh: after the transform {str(error).partition('in the world, ')[2]}")
        return placed

    def _packed_cylinders(self, materials: NDArray[np.integer[Any]]) -> NDArray[np.void]:
        out = np.zeros(len(self._cylinders), CYLINDER)
        for name in ("start", "end", "radius", "number"):
            out[name] = np.array([getattr(one, name) for one in self._cylinders]).reshape(out[name].shape)
        out["material"] = materials
        return out

    def _notes(self, shapes: Contents[Obj]) -> Iterator[str]:
        """The warnings of the meshes' files."""
        textured = {shapes.of[mesh.file] for mesh in self._meshes if mesh.finish[-1] >= 0}
        for i, (name, obj) in enumerate(zip(shapes.names, shapes.found, strict=True)):
            for warning in sorted([*obj.warnings, *(obj.unmapped if i in textured else [])]):
                yield located(self._files.shown(name), warning.line, warning.message)

    def _parse(self) -> None:
        for _ in self.document.grow():
            self._take_complete()
        if malformed := self.document.malformed:
            self.faults.add(malformed.line, malformed.message)
            self._mark_cut_off()
        if self.document.root is not None:
            self._take(self.document.root, whole=True)

    def _mark_cut_off(self) -> None:
        """Notes the elements that may be open, in which nothing is missing yet: the last one, its last child, ..."""
        element = self.document.root
        while element is not None:
            self.cut_off.add(element)
            element = next(element.iterchildren("*", reversed=True), None)

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
            raise FatalError(
                self.document.line_of(element), f"{element.tag}: must not have more than {MAX_PARTS} parts"
            )

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
        self._sections[section] = _Children(self, section)
        values, _ = self._attributes(section)
        parent = section.getparent()
        if parent is not None:
            self._sections[parent].claim(section)
        elif "output_file" in values:
            self._output_file = values["output_file"]
            if Path(self._output_file).suffix.lower() != ".png":
                self._output_file += ".png"
                written = quoted(values["output_file"])
                self.warnings.add(
                    self.document.line_of(section),
                    f"scene: output_file {written} does not end in .png, which is appended",
                )

    def _parts(self, scene: etree._Element, children: Sequence[etree._Element]) -> None:
        for child in children:
            if child.tag in SECTIONS[1:]:
                self._take(child, whole=True)
            elif self._sections[scene].claim(child):
                values, whole = self._element(child)
                if child.tag == "camera":
                    self._check_view(child, values)
                    self._camera, self._camera_line = values, self.document.line_if_known(child)
                elif whole:
                    self._background = _vector(values)
                    self._doubt([child], np.array([self._background]))

    def _lights_of(self, lights: etree._Element, children: Sequence[etree._Element]) -> None:
        for child in children:
            if not self._sections[lights].claim(child):
                continue
            if self._members >= MAX_LIGHTS:
                raise FatalError(self.document.line_of(child), f"lights: must be at most {MAX_LIGHTS}")
            values, whole = self._element(child)
            self._members += 1
            if whole:
                light = light_of(child.tag, values)
                self._members += max(0, int(light["members"][0]) - 1)
                self._light_lines.append(self.document.line_if_known(child))
                self._lights.append(light)
                self._doubt([child], light["color"])
                if self._members > MAX_LIGHTS:
                    message = f"lights: must be at most {MAX_LIGHTS} with all members of soft lights"
                    raise FatalError(self.document.line_of(child), f"{message}, got {self._members}")

    def _surfaces_of(self, surfaces: etree._Element, children: Sequence[etree._Element]) -> None:
        spheres, numbers = [], []
        for child in children:
            if child.tag == "sphere":
                spheres.append(child)
                numbers.append(len(self._surface_lines))
            elif self._sections[surfaces].claim(child):
                (self._mesh if child.tag == "mesh" else self._cylinder)(child)
            else:
                continue
            self._surface_lines.append(self.document.line_if_known(child))
        room = MAX_SPHERES - self._sphere_count
        if len(spheres) > room:
            raise FatalError(self.document.line_of(spheres[room]), f"surfaces: must be at most {MAX_SPHERES} spheres")
        self._sphere_count += len(spheres)
        good, rows = bulk(spheres)
        maps: dict[int, Maps] = {}
        for i in np.flatnonzero(~good).tolist():
            rows[i], ellipsoid = self._sphere(spheres[i], numbers[i])
            if ellipsoid:
                maps[i] = ellipsoid
        if maps:
            self._take_maps(spheres, rows, maps)
        self._doubt_sizes(spheres, rows[:, 0], rows[:, 0])
        self._doubt_shares(spheres, rows[:, FINISH])
        self._rows.append(rows)
        self._doubt(spheres, rows[:, 4:7])

    def _take_maps(self, spheres: Sequence[etree._Element], rows: NDArray[np.float64], maps: dict[int, Maps]) -> None:
        """Gives rows of spheres, those of `maps`, the indices of their maps from the world; equal ones are one."""
        which, (to_world, to_object) = list(maps), np.array(list(maps.values())).swapaxes(0, 1)
        with np.errstate(divide="ignore"):  # which is a fault below
            largest, least = np.abs(to_world).max(axis=(1, 2)), 1 / np.abs(to_object).max(axis=(1, 2))
        self._doubt_sizes([spheres[i] for i in which], largest, least)
        faults = dict(inverse_faults(to_world, to_object))
        for k, fault in faults.items():
            self.fault(spheres[which[k]], f"sphere transform: {fault}")
        rest = [k for k in range(len(which)) if k not in faults]
        for k, fault in extent_faults(rows[which, 0][rest], reaches(to_object[rest])):
            self.fault(spheres[which[rest[k]]], f"sphere: after the transform {fault}")
        rows[which, -1] = [self._maps.setdefault(matrix.tobytes(), len(self._maps)) for matrix in to_object]

    def _doubt(self, elements: Sequence[etree._Element], colors: NDArray[np.float64]) -> None:
        """Warns of colours, (n, 3), that seem to be meant as bytes, each in its element or in a <color> within."""
        for i in np.flatnonzero(like_bytes(colors)).tolist():
            element = next(elements[i].iter("color"), elements[i])
            numbers = ", ".join(f"{share:g}" for share in colors[i])
            message = f"{_label(element)}: {numbers} looks like bytes of 0..255, but 1 is full: divide by 255"
            self.warnings.add(self.document.line_of(element), message)

    def _doubt_sizes(self, elements: Sequence[etree._Element], largest: Numbers, least: Numbers) -> None:
        """Warns of surfaces whose radii or scales, (n,) at most and at least, are none for colours."""
        for i in np.flatnonzero((largest > MAX_SIZE) | (least < 1 / MAX_SIZE)).tolist():
            size = largest[i] if largest[i] > MAX_SIZE else least[i]
            message = (
                f"{elements[i].tag}: a radius or scale of {size:.2g} may spoil colours, which hold "
                f"within {1 / MAX_SIZE:.2g}..{MAX_SIZE:.2g}"
            )
            self.warnings.add(self.document.line_of(elements[i]), message)

    def _doubt_shares(self, elements: Sequence[etree._Element], finishes: Numbers) -> None:
        """Warns of materials, a row of FINISH each, that send on more light than reaches them."""
        shares = finishes[:, SHARES].sum(axis=1)
        for i in np.flatnonzero(shares > 1 + np.finfo(np.float32).eps).tolist():  # what is written as 0.7 + 0.3 is 1
            material = next(elements[i].iter("material_solid", "material_textured"))
            message = f"{material.tag}: r + t = {shares[i]:g} is above 1: more light goes on than reaches it"
            self.warnings.add(self.document.line_of(material), message)

    # Elements

    def _element(self, element: etree._Element) -> tuple[Values, bool]:
        """What is valid in an element, and whether that is all that it needs."""
        schema, label = ELEMENTS[element.tag], _label(element)
        values, whole = self._attributes(element)
        children = _Children(self, element)
        for child in element.iterchildren("*"):
            if children.claim(child):
                inner, good = self._element(child)
                whole &= good
                if child.tag not in schema.many:
                    values[child.tag] = inner
                elif good:
                    values.setdefault("steps", []).append((child, inner))
        whole &= children.complete()
        with suppress(KeyError):
            if fault := schema.check(values):
                self.fault(element, f"{label}: {fault}")
                whole = False
        return values, whole

    def _attributes(self, element: etree._Element) -> tuple[Values, bool]:
        """The valid attributes of an element, in the order of the schema, and whether these are all."""
        kinds, label = ELEMENTS[element.tag].attributes, _label(element)
        wanted = tuple(kind for kind in kinds if element.get(kind) is None)
        strays = [str(name) for name in element.attrib if name not in kinds]
        for name in strays:
            self.warn_unknown(element, label, what="attribute '{}'", name=name, known=wanted)
        del strays[MAX_MESSAGES:]
        values: Values = {}
        for name, kind in kinds.items():
            text = element.get(name)
            if text is None:
                self.fault(
                    element,
                    f"{label}: attribute {name} is missing",
                    functools.partial(_meant, element.tag, name, *strays),
                )
                continue
            try:
                values[name] = value(kind, text)
            except ValueError as error:
                self.fault(element, f"{label}: {name} {error}")
        return values, len(values) == len(kinds)

    def _check_view(self, camera: etree._Element, values: Values) -> None:
        """Complains about a view that is undefined, in the words of `Camera`."""
        vectors = {name: tuple(values[name].values()) for name in _VIEW if name in values}
        # Only valid ones: that up is 0 has already been said.
        view: dict[str, Any] = {k: v for k, v in vectors.items() if len(v) == 3 and (k != "up" or any(v))}
        if "position" not in view or "lookat" not in view:
            return
        try:
            Camera(**view)
        except ValueError as error:
            name, _, fault = str(error).removeprefix("camera.").partition(": ")
            if name in view:  # It may be a default of the camera's.
                self.fault(next(camera.iterchildren(name)), f"camera {name}: {fault}")

    def _sphere(self, element: etree._Element, number: int) -> tuple[Sequence[float], Maps | None]:
        """The row of a sphere with its transform folded in, and the maps of an ellipsoid; NaN if it has a fault."""
        values, whole = self._element(element)
        finish = self._finish(element, values)
        if not whole or finish is None:
            return NO_ROW, None
        steps = self._steps(values, number)
        turns = "material_textured" in values
        center, radius, maps = transformed(_vector(values["position"]), values["radius"], steps, turns)
        for name, rule, size in zip(("radius", *"xyz"), (POSITIVE, ANY, ANY, ANY), (radius, *center), strict=True):
            if fault := rule.fault(size):
                self.fault(element, f"sphere: after the transform {name} {fault}")
        return [radius, *center, *finish, -1], maps

    def _mesh(self, element: etree._Element) -> None:
        """Takes a mesh, whose files are read later."""
        if len(self._meshes) >= MAX_MESHES:
            raise FatalError(self.document.line_of(element), f"surfaces: must be at most {MAX_MESHES} meshes")
        values, whole = self._element(element)
        finish, line = self._finish(element, values), self.document.line_of(element)
        file = self._files.meshes.add(values["name"], line) if "name" in values else -1
        place = np.array(to_world(self._steps(values, len(self._surface_lines))))
        extreme = place[~ANY.admits(place)].tolist()
        if extreme:
            self.fault(element, f"mesh transform: a number of its matrix {ANY.fault(extreme[0])}")
            return
        for fault in place_faults(place):
            self.fault(element, f"mesh transform: {fault}")
            return
        sizes = np.linalg.norm(place[:, :3], axis=0)
        self._doubt_sizes([element], sizes.max(keepdims=True), sizes.min(keepdims=True))
        if whole and finish is not None:
            self._meshes.append(
                _Mesh(line, file=file, to_world=place, number=len(self._surface_lines), finish=np.array(finish))
            )
            self._doubt([element], np.array([finish[:3]]))
            self._doubt_shares([element], np.array([finish]))

    def _cylinder(self, element: etree._Element) -> None:
        if len(self._cylinders) >= MAX_CYLINDERS:
            raise FatalError(self.document.line_of(element), f"surfaces: must be at most {MAX_CYLINDERS} cylinders")
        values, whole = self._element(element)
        finish = self._finish(element, values)
        if not whole or finish is None:
            return
        start, end, radius = _vector(values["start"]), _vector(values["end"]), np.array([values["radius"]])
        self._cylinders.append(
            _Cylinder(start, end, float(radius[0]), number=len(self._surface_lines), finish=np.array(finish))
        )
        self._doubt_sizes([element], radius, radius)
        self._doubt([element], np.array([finish[:3]]))
        self._doubt_shares([element], np.array([finish]))

    def _steps(self, values: Values, number: int) -> Steps:
        """The steps of the transform of the surface with this number, of which the first surfaces' are kept."""
        steps: Steps = values.get("transform", {}).get("steps", [])
        if steps and len(self._transforms) < MAX_TRANSFORMS:
            self._transforms[number] = maps_of(steps)
        return steps

    def _finish(self, element: etree._Element, values: Values) -> list[float] | None:
        """What a row has of the material; None where something is missing. A texture's file is read later."""
        material = values.get("material_solid") or values.get("material_textured", {})
        texture = -1
        if name := material.get("texture", {}).get("name"):
            texture = self._files.textures.add(name, self.document.line_of(next(element.iter("texture"))))
        try:
            color = (1.0, 1.0, 1.0) if "texture" in material else _vector(material["color"])
            parts = (material[name] for name in ("phong", "reflectance", "transmittance", "refraction"))
            return [*color, *(number for part in parts for number in part.values()), texture]
        except (KeyError, ValueError):
            return None


def _vector(values: Values) -> Vector:
    x, y, z = values.values()
    return x, y, z


def _meant(element: str, name: str, *strays: str) -> str:
    """The end of the message that an attribute is missing, where an unknown one may have been meant to be it."""
    stray = closest(name, strays)
    known = next((MEANT[element, stray] for stray in strays if (element, stray) in MEANT), "")
    return known or (f"; did you mean '{short(stray)}'?" if stray else "")


def _prune(element: etree._Element) -> None:
    """Drops what is complete in an element that is still being parsed."""
    while len(element):
        del element[:-1]
        element = element[-1]


def read(path: str | os.PathLike[str], lines: bool = False, instances: int = MAX_TRIANGLES) -> tuple[Scene, list[str]]:
    """The scene of a file and the warnings, such as "scene.xml:12: sphere: unknown attribute 'foo' ignored".

    lines: whether the scene's `source` is to know the lines beyond 65,534, too, which takes reading them twice;
    instances: how many triangles meshes may have whose files are named again. Raises SceneError with every fault of the
    file.
    """
    name = os.fspath(path)
    with suppress(LinesNeededError):
        scene, warnings = _read(name, False, instances)
        if not lines or (scene.source and scene.source.knows_all_lines):
            return scene, warnings
    return _read(name, True, instances)


def _read(path: str, exact: bool, instances: int) -> tuple[Scene, list[str]]:
    reader = _Reader(path, exact, instances)
    reader.run()
    return reader.result()
