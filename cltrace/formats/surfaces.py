"""The surfaces of a scene file: how the element of each shape becomes what a Scene takes.

Spheres that are laid out as in the format's listing are converted together. A row is such a sphere: 14 numbers in the
order of the file, which are its radius, centre, colour, Phong coefficients, reflectance, transmittance and index of
refraction; then the number of its texture, -1 for none, and its index into the maps of the ellipsoids, -1 for a sphere.
A finish is what a row has of the material: the colour up to the texture.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.base.errors import located
from cltrace.base.limits import MAX_CYLINDERS, MAX_MESHES, MAX_SPHERES, MAX_TRIANGLES, MAX_VERTICES, hint
from cltrace.formats.checks import Checks, Numbers, vector_of
from cltrace.formats.document import LinesNeededError
from cltrace.formats.faults import FatalError
from cltrace.formats.schema import ELEMENTS, NUMBER, Values
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

ROW, FINISH, FINISHED = 16, slice(4, 15), 11
MAX_TRANSFORMS = 10_000  # whose steps are kept
# Whether rays meet ellipsoids is decided in pairs of doubles, which know squared distances to about 2^-104 of these. So
# many times as far away as they are thick, no digits are left for normals; at 1e16 times, one hit of 15 was wrong.
MAX_DISTANCE = 1e14
# Where corners are so many times as far away as what is seen, the kernel's points of narrow triangles lose digits that
# colours need: those of a mirrored ray that grazed a sphere were off by ten levels at 2.4 million times.
MAX_REACH = 1e6

Pending = Sequence[tuple[etree._Element, int]]  # complete elements, and their numbers among all surfaces
Steps = Sequence[tuple[etree._Element, Values]]
Rows = Sequence[Sequence[float]]
Maps = tuple[Rows, Rows]


class ShapeReader(ABC):
    """The surfaces of one element so far, whose faults and warnings `checks` are told of.

    words, most: what they are, and how many there may be; pending: those that are to be read before they are dropped;
    transforms: of the first surfaces of the file that have some, the maps of their steps, by the surfaces' numbers.
    """

    words: str
    most: int

    def __init__(self, checks: Checks, transforms: dict[int, Numbers]) -> None:
        self.checks, self.transforms = checks, transforms
        self.pending: list[tuple[etree._Element, int]] = []
        self.count = 0
        self._finishes: list[Numbers] = [np.empty((0, FINISHED))]

    def read_pending(self) -> None:
        """Reads the pending elements. Raises FatalError if there are too many."""
        pending, self.pending = self.pending, []
        if len(pending) > self.most - self.count:
            line = self.checks.document.line_of(pending[self.most - self.count][0])
            raise FatalError(line, f"surfaces: must be at most {self.most} {self.words}")
        self.count += len(pending)
        elements, finishes = self._read(pending)
        self._finishes.append(finishes)
        self.checks.doubt_colors(elements, finishes[:, :3])
        self.checks.doubt_shares(elements, finishes)

    @abstractmethod
    def _read(self, pending: Pending) -> tuple[list[etree._Element], Numbers]:
        """Reads elements. Returns those that can be used, and their finishes, (n, 11)."""

    def _steps(self, values: Values, number: int) -> Steps:
        """The steps of the transform of the surface with this number."""
        steps: Steps = values.get("transform", {}).get("steps", [])
        if steps and len(self.transforms) < MAX_TRANSFORMS:
            self.transforms[number] = np.array([to_world([step]) for step in steps])
        return steps

    @property
    def finishes(self) -> Numbers:
        """(n, 11), a finish for each surface."""
        return np.concatenate(self._finishes)

    @abstractmethod
    def fields(self, materials: NDArray[np.integer[Any]]) -> dict[str, Any]:
        """The fields of Scene that they are. materials: (n,), the index of that of each surface."""

    def doubt_reach(self, view: Camera) -> None:  # noqa: B027 (most hold at any distance)
        """Warns of what reaches so far, for where the camera looks, that its colours may not hold."""


def _read_one_by_one(
    pending: Pending, read: Callable[[etree._Element, int], list[float] | None]
) -> tuple[list[etree._Element], Numbers]:
    """What ShapeReader._read() returns. read: returns the finish of a surface, None where it cannot be used."""
    found = [(element, read(element, number)) for element, number in pending]
    finishes = [finish for _, finish in found if finish]
    return [element for element, finish in found if finish], np.array(finishes).reshape(-1, FINISHED)


class SphereReader(ShapeReader):
    """Spheres and ellipsoids."""

    words, most = "spheres", MAX_SPHERES

    def __init__(self, checks: Checks, transforms: dict[int, Numbers]) -> None:
        super().__init__(checks, transforms)
        self._rows: list[Numbers] = [np.empty((0, ROW))]
        self._maps: dict[bytes, int] = {}  # of the ellipsoids, each once -> its index
        self._ellipsoids: list[Numbers] = []  # center, thickness, and line, 0 if that is not known

    def _read(self, pending: Pending) -> tuple[list[etree._Element], Numbers]:
        spheres = [element for element, _ in pending]
        good, rows = bulk(spheres)
        maps: dict[int, Maps] = {}
        for i in np.flatnonzero(~good).tolist():
            rows[i], ellipsoid = self._sphere(*pending[i])
            if ellipsoid:
                maps[i] = ellipsoid
        if maps:
            self._take_maps(spheres, rows, maps)
        self.checks.doubt_sizes(spheres, rows[:, 0], rows[:, 0])
        self._rows.append(rows)
        return spheres, rows[:, FINISH]

    def _sphere(self, element: etree._Element, number: int) -> tuple[Sequence[float], Maps | None]:
        """The row of a sphere with its transform folded in, and the maps of an ellipsoid; NaN if it has a fault."""
        values, finish = self.checks.surface(element)
        if finish is None:
            return [math.nan] * ROW, None
        steps, turns = self._steps(values, number), "material_textured" in values
        center, radius, maps = transformed(vector_of(values["position"]), values["radius"], steps, turns)
        for name, rule, size in zip(("radius", *"xyz"), (POSITIVE, ANY, ANY, ANY), (radius, *center), strict=True):
            if fault := rule.fault(size):
                self.checks.fault(element, f"sphere: after the transform {name} {fault}")
        return [radius, *center, *finish, -1], maps

    def _take_maps(self, spheres: Sequence[etree._Element], rows: Numbers, maps: dict[int, Maps]) -> None:
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
        rows = np.concatenate(self._rows)
        spheres = np.empty(len(rows), SPHERE)
        spheres["radius"], spheres["center"] = rows[:, 0], rows[:, 1:4]
        spheres["material"], spheres["to_object"] = materials, rows[:, -1]
        return {"spheres": spheres, "to_object": np.frombuffer(b"".join(self._maps)).reshape(-1, 3, 3)}


class CylinderReader(ShapeReader):
    """Cylinders, each a record without its material."""

    words, most = "cylinders", MAX_CYLINDERS

    def __init__(self, checks: Checks, transforms: dict[int, Numbers]) -> None:
        super().__init__(checks, transforms)
        self._found: list[tuple[Any, ...]] = []

    def _read(self, pending: Pending) -> tuple[list[etree._Element], Numbers]:
        return _read_one_by_one(pending, self._cylinder)

    def _cylinder(self, element: etree._Element, number: int) -> list[float] | None:
        values, finish = self.checks.surface(element)
        if finish is not None:
            radius = np.array([values["radius"]])
            self.checks.doubt_sizes([element], radius, radius)
            self._found.append((vector_of(values["start"]), vector_of(values["end"]), radius[0], 0, number, 0))
        return finish

    def fields(self, materials: NDArray[np.integer[Any]]) -> dict[str, Any]:
        found = np.array(self._found, CYLINDER)
        found["material"] = materials
        return {"cylinders": found}


class _Mesh(NamedTuple):
    """A mesh as the file has it: its line, which of the named files it is, its place, number, and texture."""

    line: int
    file: int
    to_world: Numbers
    number: int
    textured: bool


class MeshReader(ShapeReader):
    """Meshes, and what their files hold, which are read when the scene's own is over.

    instances: how many triangles may be of files that are named again.
    """

    words, most = "meshes", MAX_MESHES

    def __init__(self, checks: Checks, transforms: dict[int, Numbers], instances: int) -> None:
        super().__init__(checks, transforms)
        self._instances = instances
        self._meshes: list[_Mesh] = []
        self._placed: list[PlacedMesh] = []

    def _read(self, pending: Pending) -> tuple[list[etree._Element], Numbers]:
        return _read_one_by_one(pending, self._mesh)

    def _mesh(self, element: etree._Element, number: int) -> list[float] | None:
        checks = self.checks
        values, finish = checks.surface(element)
        line = checks.document.line_of(element)
        file = checks.files.meshes.add(values["name"], line) if "name" in values else -1
        steps = self._steps(values, number)
        place = np.array(to_world(steps))
        extreme = place[~ANY.admits(place)].tolist()
        faults = [f"a number of its matrix {ANY.fault(extreme[0])}"] if extreme else [*place_faults(place)]
        if faults:
            checks.fault(element, f"mesh transform: {faults[0]}")
            return None
        if steps:
            sizes = np.linalg.norm(place[:, :3], axis=0)
            checks.doubt_sizes([element], sizes.max(keepdims=True), sizes.min(keepdims=True))
        if finish is not None:
            self._meshes.append(_Mesh(line, file=file, to_world=place, number=number, textured=finish[-1] >= 0))
        return finish

    def place(self) -> None:
        """Reads the files and places their meshes in the world; complains about those that are not right there."""
        faults, files = self.checks.faults, self.checks.files.meshes
        self.checks.files.read_meshes(faults)
        contents = [obj.geometry for obj in files.found.values()]
        triangles = vertices = again = 0
        seen = set[int]()
        for mesh in self._meshes:
            file = files.index[mesh.file]
            if file is None:
                continue
            geometry = contents[file]
            triangles, vertices = triangles + len(geometry.faces), vertices + len(geometry.vertices)
            if triangles > MAX_TRIANGLES or vertices > MAX_VERTICES:
                most = f"{MAX_TRIANGLES} triangles and {MAX_VERTICES} vertices"
                faults.add(mesh.line, f"surfaces: must be at most {most} of meshes")
                break
            again += len(geometry.faces) if file in seen else 0
            seen.add(file)
            if again > self._instances:
                most = f"at most {self._instances} triangles of files that are named again"
                faults.add(mesh.line, f"surfaces: must have {most}{hint('instances')}")
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
        """The file of each mesh, by the mesh's number."""
        files = self.checks.files.meshes
        contents = [MeshFile(name, obj.lines) for name, obj in files.found.items()]
        index = ((mesh.number, files.index[mesh.file]) for mesh in self._meshes)
        return {number: contents[k] for number, k in index if k is not None}

    def triangles(self) -> tuple[int, int]:
        """How many there are, and how many of them the files hold."""
        files = self.checks.files.meshes.found.values()
        return sum(len(mesh.geometry.faces) for mesh in self._placed), sum(len(obj.geometry.faces) for obj in files)

    def notes(self) -> Iterator[str]:
        """The warnings of their files."""
        files = self.checks.files
        textured = {files.meshes.index[mesh.file] for mesh in self._meshes if mesh.textured}
        for i, (name, obj) in enumerate(files.meshes.found.items()):
            for warning in sorted([*obj.warnings, *(obj.unmapped if i in textured else [])]):
                yield located(files.shown(name), warning.line, warning.message)

    def fields(self, materials: NDArray[np.integer[Any]]) -> dict[str, Any]:
        return {"meshes": [mesh.of(int(k), mesh.number) for mesh, k in zip(self._placed, materials, strict=True)]}


# Spheres that are laid out as usual


def _layout(tag: str) -> str:
    """The pattern of an element as libxml2 writes it, laid out as in the format's listing; a group for each number."""
    schema = ELEMENTS[tag]
    start = tag + "".join(rf' {name}="({NUMBER})"' for name in schema.attributes)
    children = "".join(_layout(slot.split("|")[0]) + r"\s*" for slot in schema.children)
    return rf"<{start}>\s*{children}</{tag}>" if children else f"<{start}/>"


def _rules(tag: str) -> Iterator[Any]:
    """The rule of each number of that pattern, in the same order."""
    schema = ELEMENTS[tag]
    yield from schema.attributes.values()
    for slot in schema.children:
        yield from _rules(slot.split("|")[0])


_STANDARD = re.compile(_layout("sphere").encode())
_COLUMNS = [*_rules("sphere")]
_T, _INDEX = 12, 13  # the columns of the transmittance and the index of refraction


def bulk(spheres: Sequence[etree._Element]) -> tuple[NDArray[np.bool_], Numbers]:
    """Which spheres are laid out as usual and free of faults, (n,), and their rows, (n, 16); NaN for the others."""
    found = [_STANDARD.fullmatch(etree.tostring(sphere, with_tail=False)) for sphere in spheres]
    usual = [i for i, match in enumerate(found) if match]
    written = [text for match in found if match for text in match.groups()]
    values = np.array(list(map(float, written))).reshape(len(usual), len(_COLUMNS))
    ok = np.ones(len(usual), np.bool_)
    for column, rule in enumerate(_COLUMNS):
        ok &= rule.admits(values[:, column])
    ok &= (values[:, _T] == 0) | (values[:, _INDEX] > 0)
    # A number that reads as 0 but is not written so may have underflowed.
    ok[[i // len(_COLUMNS) for i in np.flatnonzero(values == 0).tolist() if written[i].strip(b"+-0.")]] = False
    good = np.zeros(len(spheres), np.bool_)
    good[usual] = ok
    rows = np.full((len(spheres), ROW), np.nan)
    rows[good, :-2], rows[good, -2:] = values[ok], -1
    return good, rows


def packed_materials(finishes: Numbers) -> tuple[NDArray[np.void], NDArray[np.int32]]:
    """(m,) MATERIAL records and the index of that of each finish, (n, 11).

    Equal materials are one record, in the order of their first use. Where nothing is let through, any index of
    refraction is as good as another: there it is 1.
    """
    shades = np.ascontiguousarray(finishes) + 0.0  # makes -0 a 0, as they are compared as bytes
    shades[shades[:, 8] == 0, 9] = 1
    _, first, of_finish = np.unique(
        shades.view(f"V{shades.itemsize * shades.shape[1]}"), return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order))
    materials = np.empty(len(order), MATERIAL)
    shades = shades[first[order]]
    materials["color"] = shades[:, :3]
    names = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index", "texture")
    for column, name in enumerate(names, 3):
        materials[name] = shades[:, column]
    return materials, rank[of_finish.ravel()]


# Transforms


# The axes that a turn by 90 degrees takes one to the other.
_PLANE = {"rotateX": (1, 2), "rotateY": (2, 0), "rotateZ": (0, 1)}


def transformed(
    center: Vector, radius: float, steps: Steps, turns: bool = False
) -> tuple[list[float], float, Maps | None]:
    """Centre and radius in the world, in scene units, after the steps, of which the last listed acts first.

    Of an ellipsoid, the radius is the one before the steps, and the third are its linear map to the world and that from
    the world: the product of the inverse steps. It is None where the steps together scale all directions alike.

    turns: whether the sphere is not the same from all sides, as with a texture. Then the maps are also given, with the
    radius before the steps, where the steps turn or mirror it. That from the world is a rotation, or a mirror image of
    one, times the inverse scale: K (x - c), with c the centre, is as long as the radius where x is on the sphere.
    """
    p = list(center)
    alike, scaled = True, radius
    for element, step in reversed(steps):
        if element.tag == "translate":
            p = [a + b for a, b in zip(p, step.values(), strict=True)]
        elif element.tag == "scale":
            p = [a * b for a, b in zip(p, step.values(), strict=True)]
            scaled *= abs(step["x"])
            alike &= abs(step["x"]) == abs(step["y"]) == abs(step["z"])
        else:
            i, j, cos, sin = _turn(element.tag, step["theta"])
            p[i], p[j] = cos * p[i] - sin * p[j], sin * p[i] + cos * p[j]
    if alike and not turns:
        return p, scaled, None
    linear = _product(steps)
    if not turns or _upright(linear):
        scale = float(uniform_scales(np.array([linear]))[0])
        if alike or not math.isnan(scale):
            return p, scaled if alike else radius * scale, None
    return p, radius, (linear, [*zip(*_product(steps, inverse=True), strict=True)])


def to_world(steps: Steps) -> list[list[float]]:
    """The rows of the affine map of all steps to the world, (3, 4); its numbers are products and sums of doubles."""
    origin, _, _ = transformed((0.0, 0.0, 0.0), 1.0, steps)
    return [[*row, place + 0.0] for row, place in zip(_product(steps), origin, strict=True)]  # makes -0 a 0


def _upright(rows: Rows) -> bool:
    """Whether a linear map only scales, by the same in all directions."""
    scale = rows[0][0]
    return scale > 0 and all(x == (scale if i == j else 0) for i, row in enumerate(rows) for j, x in enumerate(row))


def _product(steps: Steps, inverse: bool = False) -> list[list[float]]:
    """The rows of the steps' linear parts, multiplied; or of their inverses', transposed: a rotation's is itself."""
    rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    for element, step in reversed(steps):
        if element.tag == "scale":
            rows = [[a / s if inverse else a * s for a in row] for row, s in zip(rows, step.values(), strict=True)]
        elif element.tag != "translate":
            i, j, cos, sin = _turn(element.tag, step["theta"])
            pairs = list(zip(rows[i], rows[j], strict=True))
            rows[i], rows[j] = [cos * a - sin * b for a, b in pairs], [sin * a + cos * b for a, b in pairs]
    return [[a + 0.0 for a in row] for row in rows]  # makes -0 a 0


def _turn(tag: str, degrees: float) -> tuple[int, int, float, float]:
    """The two axes that a rotation takes one towards the other, its cosine and its sine."""
    return *_PLANE[tag], *cos_sin(degrees)


def cos_sin(degrees: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees, exact at the multiples of 90."""
    turned = math.remainder(degrees, 360.0)  # This is exact, as is the difference below.
    quarter = round(turned / 90.0)
    rest = math.radians(turned - 90.0 * quarter)
    cos, sin = math.cos(rest), math.sin(rest)
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]
