"""The surfaces of a scene file: how the element of each shape becomes what a Scene takes."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from array import array
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import located
from cltrace.base.limits import MAX_CYLINDERS, MAX_MESHES, MAX_SPHERES, MAX_TRIANGLES, MAX_VERTICES, hint
from cltrace.formats.elements import ElementReader
from cltrace.formats.schema import ELEMENTS, Element
from cltrace.scene import (
    ANY,
    CYLINDER,
    MATERIAL,
    POSITIVE,
    SPHERE,
    Camera,
    MeshFile,
    PlacedMesh,
    Vector,
    extent_faults,
    inverse_faults,
    place_faults,
    reaches,
    uniform_scales,
)

# Colours are computed in float32, whose numbers are 2^-126 to 2^128 where they keep their digits. Sizes and their
# inverses are squared for lengths, so they stay in there up to this.
MAX_SIZE = 2.0**63
# Whether rays meet ellipsoids is decided in pairs of doubles, which know squared distances to about 2^-104 of these. So
# many times as far away as they are thick, no digits are left for normals; at 1e16 times, one hit of 15 was wrong.
MAX_DISTANCE = 1e14
# Where corners are so many times as far away as what is seen, the kernel's points of narrow triangles lose digits that
# colours need: those of a mirrored ray that grazed a sphere were off by ten levels at 2.4 million times.
MAX_REACH = 1e6

Numbers = NDArray[np.float64]
Indices = NDArray[np.int32]
Steps = Sequence[Element]


class ShapeReader(ABC):
    """The surfaces of one element so far.

    words, most: what they are, and how many there may be; file: where faults and warnings are reported; numbers, lines:
    of those without faults, each one's number among all surfaces, and its line.
    """

    words: str
    most: int

    def __init__(self, file: ElementReader) -> None:
        self.file, self.numbers, self.lines = file, array("i"), array("i")

    @abstractmethod
    def read(self, element: Element, steps: Steps) -> bool:
        """Reads an element with these steps of a transform, and returns whether it can be used."""

    def check(self) -> None:  # noqa: B027 (most have been checked by then)
        """Tells of faults that are looked for once all surfaces have been read."""

    def doubt_reach(self, view: Camera) -> None:  # noqa: B027 (most hold at any distance)
        """Warns of what reaches so far, for where the camera looks, that its colours may not hold."""

    @abstractmethod
    def fields(self, materials: Indices) -> dict[str, Any]:
        """The fields of Scene that they are. materials: (n,), the index of that of each surface."""

    def doubt_size(self, element: Element, *sizes: float) -> None:
        """Warns of a surface with radii or scales that are none for colours."""
        for size in sizes:
            if not 1 / MAX_SIZE <= size <= MAX_SIZE:
                words = f"a radius or scale of {size:.2g} may spoil colours, which hold within"
                message = f"{element.tag}: {words} {1 / MAX_SIZE:.2g}..{MAX_SIZE:.2g}"
                self.file.warnings.add(element.line, message)
                return


def _layout(tag: str) -> str:
    """The pattern of an element as the format's listing has it, without a transform; a group for each number.

    The numbers are 0 or within 1e-39..1e37. SphereReader.read_usual() checks the rules that some of them break.
    """
    kind, space, number = ELEMENTS[tag], r"[ \t\r\n]", r"[0-9]{1,18}(?:\.[0-9]{0,20})?(?:[eE][-+]?[01]?[0-9])?"
    signs = {name: "-?" if name in "xyz" else "" for name in kind.attributes}
    start = tag + "".join(rf'{space}+{name}="({sign}{number})"' for name, sign in signs.items())
    children = "".join(_layout(slot.split("|")[0]) for slot in kind.children)
    return rf"{space}*<{start}[ \t]*" + (rf">{children}{space}*</{tag}>" if children else "/>")


_USUAL = re.compile(_layout("sphere").encode())
_COLUMNS = _USUAL.groups


class SphereReader(ShapeReader):
    """Spheres and ellipsoids."""

    words, most = "spheres", MAX_SPHERES

    def __init__(self, file: ElementReader) -> None:
        super().__init__(file)
        self._rows = array("d")  # centre, radius, and the index of an ellipsoid or -1
        self._maps = array("d")  # of each ellipsoid, its linear map to the world, and the inverse
        self._bent = array("i")  # which of the spheres they are

    def read(self, element: Element, steps: Steps) -> bool:
        if not element.whole:
            return False
        radius, center, maps = element["radius"], element["position"].numbers, None
        if steps:
            turns = "material_textured" in element
            center, radius, maps = transformed(center, radius, steps, turns)
            for name, rule, size in zip(("radius", *"xyz"), (POSITIVE, ANY, ANY, ANY), (radius, *center), strict=True):
                if fault := rule.fault(size):
                    self.file.fault(element, f"after the transform {name} {fault}")
        if maps:
            to_world, to_object = ([number for row in rows for number in row] for rows in maps)
            self.doubt_size(element, max(map(abs, to_world)), 1 / (max(map(abs, to_object)) or math.nan))
            self._maps.extend([*to_world, *to_object])
            self._bent.append(len(self.numbers))
        self.doubt_size(element, radius)
        self._rows.extend((*center, radius, len(self._bent) - 1 if maps else -1))
        return True

    def read_usual(self, text: bytes, begin: int, line: int) -> tuple[int, list[int], Numbers]:
        """Reads the spheres from there on that are written as usual, are free of faults and give no warnings.

        Returns where they end, their lines, and their finishes, (n, 11). line: that of `begin`.
        """
        ends, lines, written = [begin], list[int](), list[bytes]()
        while len(lines) < self.most - len(self.numbers) and (match := _USUAL.match(text, ends[-1])):
            lines.append(line + text.count(b"\n", ends[-1], match.start(1)))
            line += text.count(b"\n", *match.span())
            ends.append(match.end())
            written += match.groups()
        values = np.array(list(map(float, written))).reshape(-1, _COLUMNS)
        radius, (reflected, passing, index) = values[:, 0], values[:, 11:14].T
        usual = (radius >= 1 / MAX_SIZE) & (radius <= MAX_SIZE) & (values[:, 4:7] <= 1).all(axis=1)
        usual &= (reflected + passing <= 1) & ((passing == 0) | (index > 0))
        n = len(usual) if usual.all() else int(np.argmin(usual))
        values = values[:n]
        self._rows.frombytes(np.column_stack([values[:, 1:4], radius[:n], np.full(n, -1.0)]).tobytes())
        return ends[n], lines[:n], np.column_stack([values[:, 4:], np.full(n, -1.0)])

    def _ellipsoids(self) -> tuple[Numbers, Numbers, Numbers]:
        """Their rows, (n, 5), and their maps to the world and back, (n, 3, 3)."""
        maps = np.array(self._maps).reshape(-1, 2, 3, 3)
        return np.array(self._rows).reshape(-1, 5)[np.array(self._bent)], maps[:, 0], maps[:, 1]

    def check(self) -> None:
        rows, to_world, to_object = self._ellipsoids()
        faults = {k: f"sphere transform: {fault}" for k, fault in inverse_faults(to_world, to_object)}
        rest = [k for k in range(len(rows)) if k not in faults]
        for k, fault in extent_faults(rows[rest, 3], reaches(to_object[rest])):
            faults[rest[k]] = f"sphere: after the transform {fault}"
        for k, fault in faults.items():
            self.file.faults.add(self.lines[self._bent[k]], fault)

    def doubt_reach(self, view: Camera) -> None:
        rows, _, to_object = self._ellipsoids()
        thickness = rows[:, 3] / np.abs(to_object).max(axis=(1, 2))
        times = np.sqrt(((rows[:, :3] - view.position) ** 2).sum(axis=1)) / thickness
        for k in np.flatnonzero(times > MAX_DISTANCE).tolist():
            words = f"sphere: is {times[k]:.2g} times as far from the eye as its transform makes it thick"
            message = f"{words}, which may spoil colours, which hold within {MAX_DISTANCE:g}"
            self.file.warnings.add(self.lines[self._bent[k]], message)

    def fields(self, materials: Indices) -> dict[str, Any]:
        _, _, to_object = self._ellipsoids()
        maps, index = unique_rows(to_object.reshape(-1, 9))
        rows = np.array(self._rows).reshape(-1, 5)
        spheres = np.empty(len(rows), SPHERE)
        spheres["center"], spheres["radius"] = rows[:, :3], rows[:, 3]
        spheres["material"], spheres["to_object"] = materials, -1
        spheres["to_object"][np.array(self._bent)] = index
        return {"spheres": spheres, "to_object": maps.reshape(-1, 3, 3)}


class CylinderReader(ShapeReader):
    """Cylinders."""

    words, most = "cylinders", MAX_CYLINDERS

    def __init__(self, file: ElementReader) -> None:
        super().__init__(file)
        self._rows = array("d")  # start, end, radius

    def read(self, element: Element, steps: Steps) -> bool:
        if element.whole:
            self.doubt_size(element, element["radius"])
            self._rows.extend((*element["start"].numbers, *element["end"].numbers, element["radius"]))
        return element.whole

    def fields(self, materials: Indices) -> dict[str, Any]:
        rows = np.array(self._rows).reshape(-1, 7)
        cylinders = np.zeros(len(rows), CYLINDER)
        cylinders["start"], cylinders["end"], cylinders["radius"] = rows[:, :3], rows[:, 3:6], rows[:, 6]
        cylinders["material"], cylinders["number"] = materials, self.numbers
        return {"cylinders": cylinders}


class _Mesh(NamedTuple):
    """A mesh as the file has it: which of the named files it is, its place, and whether it has a texture."""

    file: int
    to_world: Numbers
    textured: bool


class MeshReader(ShapeReader):
    """Meshes, and what their files hold, which are read when the scene's own is over.

    instances: how many triangles may be of files that are named again.
    """

    words, most = "meshes", MAX_MESHES

    def __init__(self, file: ElementReader, instances: int) -> None:
        super().__init__(file)
        self._instances = instances
        self.triangles = self.again = 0  # of all meshes, and of those whose files are named again
        self._meshes: list[_Mesh] = []
        self._placed: list[PlacedMesh] = []

    def read(self, element: Element, steps: Steps) -> bool:
        name = self.file.files.meshes.add(element["name"], element.line) if "name" in element else -1
        place = np.array(to_world(steps))
        extreme = place[~ANY.admits(place)].tolist()
        faults = [f"a number of its matrix {ANY.fault(extreme[0])}"] if extreme else [*place_faults(place)]
        if faults:
            self.file.faults.add(element.line, f"mesh transform: {faults[0]}")
            return False
        if steps:
            sizes = np.linalg.norm(place[:, :3], axis=0)
            self.doubt_size(element, float(sizes.max()), float(sizes.min()))
        if element.whole:
            self._meshes.append(_Mesh(name, place, "material_textured" in element))
        return element.whole

    def check(self) -> None:
        """Reads the files and places their meshes in the world; tells of those that are not right there."""
        faults, files = self.file.faults, self.file.files.meshes
        self.file.files.read_meshes(faults)
        contents = [obj.geometry for obj in files.found.values()]
        vertices, seen = 0, set[int]()
        for mesh, number, line in zip(self._meshes, self.numbers, self.lines, strict=True):
            file = files.index[mesh.file]
            if file is None:
                continue
            geometry = contents[file]
            self.triangles += len(geometry.faces)
            vertices += len(geometry.vertices)
            if self.triangles > MAX_TRIANGLES or vertices > MAX_VERTICES:
                most = f"{MAX_TRIANGLES} triangles and {MAX_VERTICES} vertices"
                faults.add(line, f"surfaces: must be at most {most} of meshes")
                break
            self.again += len(geometry.faces) if file in seen else 0
            seen.add(file)
            if self.again > self._instances:
                most = f"at most {self._instances} triangles of files that are named again"
                faults.add(line, f"surfaces: must have {most}{hint('instances')}")
                break
            try:
                self._placed.append(PlacedMesh(geometry, mesh.to_world, 0, number))
            except ValueError as error:
                faults.add(line, f"mesh: after the transform {str(error).partition('in the world, ')[2]}")

    def doubt_reach(self, view: Camera) -> None:
        most = MAX_REACH * math.dist(view.position, view.lookat)
        for line, placed in zip(self.lines, self._placed, strict=True):
            reach = float(np.abs(placed.vertices - view.position).max(initial=0))
            if reach > most:
                words = f"mesh: reaches {reach:.2g} from the eye, which may spoil colours, which hold within {most:.2g}"
                self.file.warnings.add(line, f"{words}: {MAX_REACH:g} times as far as the camera looks")

    def files(self) -> dict[int, MeshFile]:
        """The file of each mesh, by the mesh's number."""
        files = self.file.files.meshes
        contents = [MeshFile(name, obj.lines) for name, obj in files.found.items()]
        index = ((number, files.index[mesh.file]) for number, mesh in zip(self.numbers, self._meshes, strict=True))
        return {number: contents[k] for number, k in index if k is not None}

    def notes(self) -> Iterator[str]:
        """The warnings of their files."""
        files = self.file.files
        textured = {files.meshes.index[mesh.file] for mesh in self._meshes if mesh.textured}
        for i, (name, obj) in enumerate(files.meshes.found.items()):
            for warning in sorted([*obj.warnings, *(obj.unmapped if i in textured else [])]):
                yield located(files.shown(name), warning.line, warning.message)

    def fields(self, materials: Indices) -> dict[str, Any]:
        return {"meshes": [mesh.changed(material=k) for mesh, k in zip(self._placed, materials.tolist(), strict=True)]}


def unique_rows(rows: Numbers) -> tuple[Numbers, Indices]:
    """Equal rows of (n, k) once, in the order of their first use, and the index of each one's, (n,)."""
    rows = np.ascontiguousarray(rows) + 0.0  # makes -0 a 0, as they are compared as bytes
    whole = rows.view(f"V{rows.itemsize * rows.shape[1]}")
    _, first, of_row = np.unique(whole, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order))
    return rows[first[order]], rank[of_row.ravel()]


def packed_materials(finishes: Numbers) -> tuple[NDArray[np.void], Indices]:
    """(m,) MATERIAL records and the index of that of each finish, (n, 11), in the order of their first use.

    A finish is the colour, the Phong coefficients, reflectance, transmittance, index of refraction, and the number of
    the texture, -1 for none. Where nothing is let through, any index of refraction is as good as another: there it
    becomes 1.
    """
    finishes[finishes[:, 8] == 0, 9] = 1
    shades, of_finish = unique_rows(finishes)
    materials = np.empty(len(shades), MATERIAL)
    materials["color"] = shades[:, :3]
    names = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index", "texture")
    for column, name in enumerate(names, 3):
        materials[name] = shades[:, column]
    return materials, of_finish


# Transforms


# The axes that a turn by 90 degrees takes one to the other.
_PLANE = {"rotateX": (1, 2), "rotateY": (2, 0), "rotateZ": (0, 1)}


def transformed(
    center: Vector, radius: float, steps: Steps, turns: bool = False
) -> tuple[list[float], float, tuple[list[list[float]], list[tuple[float, ...]]] | None]:
    """Centre and radius in the world, in scene units, after the steps, of which the last listed acts first.

    Of an ellipsoid, the radius is the one before the steps, and the third are its linear map to the world and that from
    the world: the product of the inverse steps. It is None where the steps together scale all directions alike.

    turns: whether the sphere is not the same from all sides, as with a texture. Then the maps are also given, with the
    radius before the steps, where the steps turn or mirror it. That from the world is a rotation, or a mirror image of
    one, times the inverse scale: K (x - c), with c the centre, is as long as the radius where x is on the sphere.
    """
    p = list(center)
    alike, scaled = True, radius
    for step in reversed(steps):
        if step.tag == "translate":
            p = [a + b for a, b in zip(p, step.numbers, strict=True)]
        elif step.tag == "scale":
            p = [a * b for a, b in zip(p, step.numbers, strict=True)]
            scaled *= abs(step["x"])
            alike &= abs(step["x"]) == abs(step["y"]) == abs(step["z"])
        else:
            (i, j), (cos, sin) = _PLANE[step.tag], cos_sin(step["theta"])
            p[i], p[j] = cos * p[i] - sin * p[j], sin * p[i] + cos * p[j]
    if alike and not turns:
        return p, scaled, None
    linear = _product(steps)
    upright = linear[0][0] > 0 and np.array_equal(linear, linear[0][0] * np.eye(3))
    if not turns or upright:
        scale = float(uniform_scales(np.array([linear]))[0])
        if alike or not math.isnan(scale):
            return p, scaled if alike else radius * scale, None
    return p, radius, (linear, [*zip(*_product(steps, inverse=True), strict=True)])


def to_world(steps: Steps) -> list[list[float]]:
    """The rows of the affine map of all steps to the world, (3, 4); its numbers are products and sums of doubles."""
    origin, _, _ = transformed((0.0, 0.0, 0.0), 1.0, steps)
    return [[*row, place + 0.0] for row, place in zip(_product(steps), origin, strict=True)]  # makes -0 a 0


def _product(steps: Steps, inverse: bool = False) -> list[list[float]]:
    """The rows of the steps' linear parts, multiplied; or of their inverses', transposed: a rotation's is itself."""
    rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    for step in reversed(steps):
        if step.tag == "scale":
            rows = [[a / s if inverse else a * s for a in row] for row, s in zip(rows, step.numbers, strict=True)]
        elif step.tag != "translate":
            (i, j), (cos, sin) = _PLANE[step.tag], cos_sin(step["theta"])
            pairs = list(zip(rows[i], rows[j], strict=True))
            rows[i], rows[j] = [cos * a - sin * b for a, b in pairs], [sin * a + cos * b for a, b in pairs]
    return [[a + 0.0 for a in row] for row in rows]  # makes -0 a 0


def cos_sin(degrees: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees, exact at the multiples of 90."""
    turned = math.remainder(degrees, 360.0)  # This is exact, as is the difference below.
    quarter = round(turned / 90.0)
    rest = math.radians(turned - 90.0 * quarter)
    cos, sin = math.cos(rest), math.sin(rest)
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]
