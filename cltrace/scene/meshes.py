"""Meshes: triangles between vertices, placed in the world by an affine map.

The corners of a triangle are three vertices. A mesh in the world is its world vertices, which are doubles: where a map
places it, they are rounded once, and the triangles between the rounded ones are the surface.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import add_quickly, cross, dot, inverses, two_product, whole_inverse
from cltrace.base.arrays import blockwise
from cltrace.base.limits import MAX_MESHES, MAX_TRIANGLES, MAX_VERTICES
from cltrace.scene.colors import Transfer, decoded
from cltrace.scene.materials import Frozen, Material, Texture, check_texels, linear_texels, records
from cltrace.scene.mesh_colors import MeshColors
from cltrace.scene.mesh_sources import Found
from cltrace.scene.rules import ANY, check_rule, checked, described, indices, is_whole, large_or_numbers, numbers
from cltrace.scene.spheres import inverse_faults
from cltrace.scene.surfaces import Floats, Ids, NumberedSurfaces

_IDENTITY = np.eye(3, 4)
_POINTS = 4096  # the temporary arrays of so many points stay in the caches


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Geometry(Frozen):
    """Triangles in the object's own space, in scene units. Immutable; may be placed several times.

    vertices: (v, 3) doubles; faces: (f, 3) int32, the indices of each triangle's corners; normals: (k, 3) doubles of
    any length; normal_of: (f, 3) int32, the index of each corner's normal, all three -1 for a triangle without; uv: (j,
    2) doubles, texture coordinates, 1 for the whole width or height, v downwards from the top; uv_of: (f, 3) int32, as
    normal_of. Triangles without area are kept, so that a triangle's number is its place among all.

    Raises ValueError, which names the field and the index.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    normals: NDArray[np.float64]
    normal_of: NDArray[np.int32]
    uv: NDArray[np.float64]
    uv_of: NDArray[np.int32]

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        normals: ArrayLike = (),
        normal_of: ArrayLike | None = None,
        uv: ArrayLike = (),
        uv_of: ArrayLike | None = None,
    ) -> None:
        points = _rows("mesh.vertices", vertices, 3)
        corners = indices("mesh.faces", faces, 3, len(points), "a vertex")
        for name, rows, most in (("vertices", points, MAX_VERTICES), ("faces", corners, MAX_TRIANGLES)):
            if len(rows) > most:
                raise ValueError(f"mesh.{name}: must be at most {most}, got {len(rows)}")
        directions, places = _rows("mesh.normals", normals, 3), _rows("mesh.uv", uv, 2)
        direction_of = _of_corners("mesh.normal_of", normal_of, len(corners), len(directions), "a normal")
        place_of = _of_corners("mesh.uv_of", uv_of, len(corners), len(places), "uv")
        state = {"vertices": points, "faces": corners, "normals": directions, "normal_of": direction_of}
        self.__setstate__(state | {"uv": places, "uv_of": place_of})

    @functools.cached_property
    def closed(self) -> bool:
        """Whether each edge belongs to an even number of triangles. Vertices at one place count as one."""
        _, place = np.unique(self.vertices + 0.0, axis=0, return_inverse=True)
        corners = place.reshape(-1)[self.faces].astype(np.int64)
        ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
        ends = ends[ends[:, 0] != ends[:, 1]]
        _, counts = np.unique(ends[:, 0] * len(self.vertices) + ends[:, 1], return_counts=True)
        return bool((counts % 2 == 0).all())

    def __repr__(self) -> str:
        return f"<cltrace geometry: {len(self.faces)} triangles, {len(self.vertices)} vertices>"


@dataclass(frozen=True, eq=False, init=False, repr=False)
class PlacedMesh(Frozen):
    """A mesh of a scene. Immutable.

    geometry: a Geometry, which several may share; to_world: (3, 4) doubles, the affine map from its space to the world,
    of which the last column is the translation in scene units; material: the index of a material of the scene; number:
    the surface's, in the order of the file, in which spheres count, too; clipped: whether the scene's planes clip it.

    Raises ValueError where the map is singular, or takes vertices to where the rules allow none.
    """

    geometry: Geometry
    to_world: NDArray[np.float64]
    material: int
    number: int
    clipped: bool

    def __init__(
        self,
        geometry: Geometry,
        to_world: ArrayLike = _IDENTITY,
        material: int = 0,
        number: int = 0,
        clipped: bool = True,
    ) -> None:
        if not isinstance(geometry, Geometry):
            raise TypeError(f"mesh.geometry: must be a cltrace.scene.Geometry, got {described(geometry)}")
        for name, value in (("material", material), ("number", number)):
            if not is_whole(value) or not 0 <= value < 2**31:
                raise ValueError(f"mesh.{name}: must be an integer within 0..{2**31 - 1}, got {described(value)}")
        place = checked("mesh.to_world", ANY, to_world, (3, 4))
        for fault in place_faults(place):
            raise ValueError(f"mesh.to_world: {fault}")
        state = {"geometry": geometry, "to_world": place, "material": int(material), "number": int(number)}
        self.__setstate__(state | {"clipped": bool(clipped)})
        if self.vertices is not geometry.vertices:  # which are checked
            check_rule("mesh.to_world: in the world, vertices", ANY, self.vertices)

    @functools.cached_property
    def vertices(self) -> NDArray[np.float64]:
        """(v, 3) doubles, the vertices in the world, scene units: to_world applied, and each number rounded once."""
        if (self.to_world == _IDENTITY).all():
            return self.geometry.vertices
        return _read_only(affine(self.to_world, self.geometry.vertices))

    @functools.cached_property
    def normal_to_world(self) -> NDArray[np.float64]:
        """(3, 3) doubles: takes the directions of normals to the world.

        It is the transposed inverse of to_world's linear part, each number rounded once, times the power of two that
        brings its largest number into [1, 2).
        """
        matrix = inverses(self.to_world[None, :, :3])[0].T
        _, exponent = np.frexp(np.abs(matrix).max())
        return _read_only(np.ldexp(matrix, 1 - exponent))

    @functools.cached_property
    def front(self) -> NDArray[np.int8]:
        """(f,): 1 where a triangle's front is the side of N = (B - A) x (C - A) of its corners A, B, C in the world.

        It is -1 where it is the other side. The front is where the sum of the corners' normals points to: a side of
        the triangle in the object's space, in doubles, which a map that mirrors exchanges. Without normals, and where
        the sum lies in the triangle's plane, it is the side of N in the object's space.
        """
        shape = self.geometry
        _, determinant = whole_inverse(self.to_world[:, :3].tolist())
        outward = -1 if determinant < 0 else 1
        side = np.full(len(shape.faces), outward, np.int8)

        def turn(rows: slice) -> None:
            given = np.flatnonzero(shape.normal_of[rows, 0] >= 0)
            corners, directions = shape.faces[rows].take(given, axis=0), shape.normal_of[rows].take(given, axis=0)
            a, b, c = (_columns(shape.vertices, which) for which in corners.T)
            x, y, z = (_columns(shape.normals, which) for which in directions.T)
            side[rows.start + given[dot(cross(b - a, c - a), (x + y) + z) < 0]] = -outward

        if len(shape.normals):
            blockwise(len(side), turn)
        return _read_only(side)

    def moved(self, offset: NDArray[np.float64], number: int) -> PlacedMesh:
        """The same with another number, moved in the world, scene units; shares the geometry."""
        if not offset.any():
            return self.changed(number=number)
        place = self.to_world.copy()
        place[:, 3] += offset
        return PlacedMesh(self.geometry, place, self.material, number, self.clipped)

    def __repr__(self) -> str:
        return f"<cltrace mesh {self.number}: {len(self.geometry.faces)} triangles, material {self.material}>"


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Mesh(Frozen):
    """Triangles with a material, for Scene.from_meshes and Scene.from_spheres. Immutable; the arrays are copied.

    vertices: (v, 3), scene units; faces: (f, 3) integers, each triangle's corners as indices into the vertices, seen
    counter-clockwise from its front; normals: (v, 3), one for each vertex, or (f, 3, 3), one for each corner of each
    triangle, of any length, for smooth shading, or None; uv: (v, 2) or (f, 3, 2), texture coordinates alike; material:
    a Material; transform: (3, 3), (3, 4) or (4, 4), an affine map to the world, whose last row is 0 0 0 1 if it has
    four.

    colors: (v, 3) or (f, 3), or as many texts, for each vertex or for each triangle, as in Scene.from_spheres but
    within 0..1; values: (v,) or (f,) numbers that are shown as colours instead, with cmap, clim and norm, also as
    there. A vertex has exactly its colour, and between vertices, colours and values are interpolated. The material's
    colour, white as a rule, is multiplied with them. They take the place of uv and a texture, so the output uv is where
    they are stored. clipped: whether the planes of Scene.clipped() clip it.

    Both sides of a triangle are seen. Its front, which matters to glass, is the side that its normals point to; without
    normals it is the one from which the corners go round counter-clockwise. `Mesh.of` takes other libraries' objects.

    Raises ValueError, which names the argument and the index, and TypeError where the material is none.
    """

    geometry: Geometry
    material: Material
    placed: PlacedMesh
    colors: MeshColors | None

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        normals: ArrayLike | None = None,
        uv: ArrayLike | None = None,
        material: Material = Material(),  # noqa: B008 (it is immutable)
        transform: ArrayLike | None = None,
        *,
        colors: ArrayLike | None = None,
        values: ArrayLike | None = None,
        cmap: Any = None,
        clim: ArrayLike | None = None,
        norm: Any = None,
        clipped: bool = True,
    ) -> None:
        bare = Geometry(vertices, faces)
        directions, normal_of = _given("mesh.normals", normals, bare, width=3) or (bare.normals, bare.normal_of)
        places, uv_of = _given("mesh.uv", uv, bare, width=2) or (bare.uv, bare.uv_of)
        shown = {"colors": colors, "values": values, "cmap": cmap, "clim": clim, "norm": norm}
        found = MeshColors.of(bare.faces, len(bare.vertices), **shown)
        if found:
            if uv is not None:
                raise ValueError("mesh.uv: must not be given together with colors or values")
            places, uv_of = found.uv, found.uv_of
        geometry = bare.changed(normals=directions, normal_of=normal_of, uv=places, uv_of=uv_of)
        self.__setstate__(_checked_parts(geometry, material, transform, found, clipped))

    @property
    def vertices(self) -> NDArray[np.float64]:
        """(v, 3), as they were given: before the transform. Read-only."""
        return self.geometry.vertices

    @property
    def faces(self) -> NDArray[np.int32]:
        """(f, 3), the indices of each triangle's corners. Read-only."""
        return self.geometry.faces

    @classmethod
    def of(
        cls,
        thing: Any,
        material: Material = Material(),  # noqa: B008
        transform: ArrayLike | None = None,
        *,
        colors: ArrayLike | None = None,
        values: ArrayLike | str | None = None,
        cmap: Any = None,
        clim: ArrayLike | None = None,
        norm: Any = None,
    ) -> Mesh:
        """A mesh of what another library calls one.

        thing: an object with `vertices` and `faces`, as trimesh's, or a Scene of these; with `points` and `cells`, as
        meshio's, of which the cells of type triangle, quad and polygon are taken; a PolyData of pyvista, or one of its
        grids, of which the surface is taken; or another Mesh, whose arrays are then shared. Polygons of more than three
        corners become fans. Colours of vertices, and in trimesh of faces, are taken along, as a PLY has them, unless
        colors or values are given here. Other objects' normals and texture coordinates are left alone: they go into
        `Mesh` as arrays. material, transform and the others: as of Mesh; values may be the name of one of the thing's
        `point_data`.

        Raises TypeError if it is none of these, and ValueError as Mesh does.
        """
        shown = {"colors": colors, "values": values, "cmap": cmap, "clim": clim, "norm": norm}
        if isinstance(thing, Mesh):
            if any(given is not None for given in shown.values()):
                raise ValueError("mesh.colors: must not be given with a Mesh, which has its own")
            clipped = thing.placed.clipped
            return thing.changed(**_checked_parts(thing.geometry, material, transform, thing.colors, clipped))
        found = Found.of(thing)
        own = found.colors if colors is None and values is None else colors
        shown |= {"colors": own, "values": found.values(values)}
        return cls(found.vertices, found.faces, material=material, transform=transform, **shown)

    def __repr__(self) -> str:
        return f"<cltrace.Mesh: {len(self.geometry.faces)} triangles, {len(self.geometry.vertices)} vertices>"


def _checked_parts(
    geometry: Geometry, material: Material, transform: ArrayLike | None, colors: MeshColors | None, clipped: bool
) -> dict[str, Any]:
    """The fields of a Mesh."""
    if not isinstance(material, Material):
        raise TypeError(f"mesh.material: must be a cltrace.Material, got {described(material)}")
    if colors and material.texture is not None:
        raise ValueError("mesh.material: must have no texture where there are colors or values")
    try:
        placed = PlacedMesh(geometry, _matrix(transform), clipped=clipped)
    except ValueError as error:
        raise ValueError(str(error).replace("mesh.to_world", "mesh.transform", 1)) from None
    return {"geometry": geometry, "material": material, "placed": placed, "colors": colors}


def place_faults(to_world: NDArray[np.float64]) -> Iterator[str]:
    """What is wrong with an affine map, (3, 4), of numbers that the rules allow, in words for behind its name."""
    if (to_world[:, :3] != np.eye(3)).any():
        linear = to_world[None, :, :3]
        yield from (fault for _, fault in inverse_faults(linear, inverses(linear)))


def check_size(meshes: Iterable[PlacedMesh]) -> None:
    """Raises ValueError if these are too many, or of too many triangles or vertices, for a scene."""
    shapes = [mesh.geometry for mesh in meshes]
    if len(shapes) > MAX_MESHES:
        raise ValueError(f"meshes: must be at most {MAX_MESHES}, got {len(shapes)}")
    for name, most, count in (
        ("triangles", MAX_TRIANGLES, sum(len(shape.faces) for shape in shapes)),
        ("vertices", MAX_VERTICES, sum(len(shape.vertices) for shape in shapes)),
    ):
        if count > most:
            raise ValueError(f"meshes: must be at most {most} {name} in all, got {count}")


def placed_meshes(
    meshes: Iterable[Mesh] | Mesh, transfer: Transfer, materials: int, first: int
) -> tuple[tuple[PlacedMesh, ...], NDArray[np.void], tuple[Texture, ...]]:
    """The meshes of an argument in a scene, numbered from `first` on, with their own MATERIAL records and textures.

    Colours of a mesh are a texture. transfer: how colours are given; materials: how many others there are. Raises
    TypeError, which names the index, and ValueError.
    """
    found = [meshes] if isinstance(meshes, Mesh) else meshes
    if not isinstance(found, Iterable):
        raise TypeError(f"meshes: must be a list of cltrace.Mesh, got {described(meshes)}")
    given = list(found)
    placed, kinds, index = list[PlacedMesh](), list[Material](), dict[tuple[int, int], int]()
    for i, mesh in enumerate(given):
        if not isinstance(mesh, Mesh):
            raise TypeError(f"meshes[{i}]: must be a cltrace.Mesh, got {described(mesh)}; Mesh.of() makes one")
        key = (id(mesh.material), id(mesh.colors))
        if key not in index:
            index[key] = materials + len(kinds)
            colors = mesh.colors
            kinds.append(mesh.material.changed(texture=colors.texture(transfer)) if colors else mesh.material)
        placed.append(mesh.placed.changed(material=index[key], number=first + i))
    check_size(placed)
    rows, textures = records(kinds)
    check_texels(textures)
    rows["color"] = decoded(rows["color"], transfer)
    return tuple(placed), rows, tuple(linear_texels(image, transfer) for image in textures)


def _matrix(transform: ArrayLike | None) -> NDArray[np.float64]:
    """(3, 4)"""
    if transform is None:
        return _IDENTITY
    matrix = numbers("mesh.transform", transform)
    if matrix.shape not in ((3, 3), (3, 4), (4, 4)):
        raise ValueError(f"mesh.transform: must have shape (3, 3), (3, 4) or (4, 4), got {matrix.shape}")
    check_rule("mesh.transform", ANY, matrix)
    if len(matrix) == 4 and matrix[3].tolist() != [0, 0, 0, 1]:
        raise ValueError(f"mesh.transform[3]: must be 0, 0, 0, 1, got {', '.join(f'{x:g}' for x in matrix[3])}")
    to_world = np.zeros((3, 4))
    to_world[:, : matrix.shape[1]] = matrix[:3]
    return to_world


def _given(
    name: str, value: ArrayLike | None, shape: Geometry, width: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]] | None:
    """What is given for each vertex or for each corner as rows, and the index of each corner's row; None for none."""
    if value is None:
        return None
    array, wanted = large_or_numbers(name, value), ((len(shape.vertices), width), (len(shape.faces), 3, width))
    if array.shape not in wanted:
        raise ValueError(f"{name}: must have shape {wanted[0]} or {wanted[1]}, got {array.shape}")
    rows = _rows(name, array.reshape(-1, width), width)
    return rows, shape.faces if array.ndim == 2 else np.arange(len(rows), dtype=np.int32).reshape(-1, 3)


def _rows(name: str, value: ArrayLike, width: int) -> NDArray[np.float64]:
    # The kernel's rows of three numbers have a fourth one.
    return checked(name, ANY, value, (-1, width), int(width == 3))


def _of_corners(name: str, value: ArrayLike | None, faces: int, count: int, what: str) -> NDArray[np.int32]:
    """(faces, 3) indices, -1 for none. Raises ValueError also where a triangle has one for some corners only."""
    if value is None:
        return np.broadcast_to(np.int32(-1), (faces, 3))
    array = indices(name, value, 3, count, what, least=-1)
    if len(array) != faces:
        raise ValueError(f"{name}: must have shape ({faces}, 3), got {array.shape}")
    absent = array < 0
    some = (absent[:, 1:] != absent[:, :1]).any(axis=1) if absent.any() else absent[:0]
    if some.any():
        raise ValueError(f"{name}[{int(np.argmax(some))}]: must be -1 for all three corners or for none")
    return array


def _columns(rows: NDArray[np.float64], which: NDArray[np.int32]) -> NDArray[np.float64]:
    """(3, n): the coordinates of some rows (k, 3)."""
    return np.ascontiguousarray(rows[which].T)  # take() would copy all of a view first


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array


def affine(matrix: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points (n, 3) that a (3, 4) matrix makes of (n, 3), each number rounded once from a pair of doubles.

    The products are exact. Their sum is right to 2^-104 of the terms' size before it is rounded.
    """
    result = np.empty(points.shape)
    for start in range(0, len(points), _POINTS):
        block = points[start : start + _POINTS]
        for i, row in enumerate(matrix):
            total = np.full(len(block), row[3]), np.zeros(len(block))
            for j in np.flatnonzero(row[:3]).tolist():
                total = add_quickly(total, two_product(row[j : j + 1], block[:, j]))
            result[start : start + _POINTS, i] = total[0]
    return result + 0.0  # makes -0 a 0


@dataclass(frozen=True, eq=False)
class Meshes(NumberedSurfaces):
    """meshes: by rising numbers."""

    meshes: tuple[PlacedMesh, ...] = ()
    words: ClassVar[str] = "meshes"

    @classmethod
    def checked(cls, given: Mapping[str, Any], materials: int, spheres: int) -> Meshes:
        found = tuple(given["meshes"]) if isinstance(given["meshes"], Iterable) else (given["meshes"],)
        last = -1
        for i, mesh in enumerate(found):
            if not isinstance(mesh, PlacedMesh):
                words = f"must be a cltrace.scene.PlacedMesh, got {described(mesh)}"
                raise TypeError(f"meshes[{i}]: {words}; Scene.from_meshes() takes each cltrace.Mesh")
            if mesh.material >= materials:
                raise ValueError(f"meshes[{i}].material: must be the index of a material, got {mesh.material}")
            if mesh.number <= last:
                raise ValueError(f"meshes[{i}].number: must be greater than that of the mesh before, got {mesh.number}")
            last = mesh.number
        check_size(found)
        return cls(found)

    def __len__(self) -> int:
        return len(self.meshes)

    def __str__(self) -> str:
        return f"{len(self)} meshes of {self.triangles} triangles"

    @property
    def triangles(self) -> int:
        """How many they have together."""
        return sum(len(mesh.geometry.faces) for mesh in self.meshes)

    @property
    def numbers(self) -> Ids:
        return np.array([mesh.number for mesh in self.meshes], np.int64)

    @property
    def materials(self) -> Ids:
        return np.array([mesh.material for mesh in self.meshes], np.int64)

    def with_materials(self, materials: Ids) -> Meshes:
        pairs = zip(self.meshes, materials.tolist(), strict=True)
        return Meshes(tuple(mesh.changed(material=material) for mesh, material in pairs))

    def beside(self, spheres: int, was: int) -> Meshes:
        if any(mesh.number < was for mesh in self.meshes):
            raise ValueError(f"centers: must be {was}, as there are meshes between the spheres, got {spheres}")
        return Meshes(tuple(mesh.changed(number=mesh.number + spheres - was) for mesh in self.meshes))

    def moved(self, moves: Floats, first: int, spheres: int) -> Meshes:
        found = tuple(mesh.moved(move, first + i) for i, (move, mesh) in enumerate(product(moves, self.meshes)))
        check_size(found)
        return Meshes(found)

    def reach(self, directions: Floats) -> list[Floats]:
        def corners(block: slice) -> Floats:
            return np.asarray((vertices[block] @ directions.T).max(axis=0))

        parts: list[Floats] = []
        for mesh in self.meshes:
            if len(mesh.geometry.faces):
                vertices = mesh.vertices[np.unique(mesh.geometry.faces)]
                parts += blockwise(len(vertices), corners)
        return parts
