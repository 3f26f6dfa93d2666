"""The triangles of all meshes: as one list, their edges' planes as seen from the eye or a light, and for shading."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Triple, cross, dot, minus
from cltrace.base.arrays import blockwise, empty, joined, widened
from cltrace.plan.abi import CONSTANTS, Precision, dtype_of, real_dtype
from cltrace.plan.accel.silhouettes import Polygons
from cltrace.plan.accel.tree import Paths
from cltrace.plan.lights import Lamp
from cltrace.plan.materials import may_bounce
from cltrace.plan.order import MANY, order_of_rows, repeated_faces
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints, U, along, rotated
from cltrace.plan.shapes.shape import Arrays, InView, ShapePacking, Sights, share
from cltrace.scene import AnyCamera, PlacedMesh, Scene

Floats = NDArray[np.float32]
# Three numbers for each of n triangles.
Columns = tuple[Array, Array, Array]
# Where the float filter's bounds begin, and what corners in camera space are off by, and the edges' planes with them:
# see from_point().
FLOAT, TURNED = CONSTANTS["FACET_ROUNDINGS"] * U, 2.0**-46
# No bound is smaller, lest one of 0 be divided by. Lengths are about 1.
LEAST = 2.0**-300
# Points on surfaces are no further from the eye than this in the float buffers' unit: no coordinate of a centre, a
# vertex or a radius exceeds 1.
FAR = 4.0


@dataclass(frozen=True)
class PackedTriangles:
    """The m triangles of all meshes of a scene, in the order in which they are packed, of equal ones the first alone.

    vertex: (v, 3) float64, in the world, in scene units; face: (m, 4), three vertices each, and twice the mesh, plus 1
    where the front is the side to which N = (B - A) x (C - A) does not point; number: (m,), each one's in its mesh;
    surface, material: (m,), the mesh's number in the scene and its material; sided: whether the fronts are known, of
    which rays ask that go on from a surface; again: how many triangles of the scene are equal to an earlier one.
    """

    vertex: Array
    face: Ints
    number: Ints
    surface: Ints
    material: Ints
    sided: bool = True
    again: int = 0

    @classmethod
    def of(
        cls, meshes: tuple[PlacedMesh, ...], by_place: bool, sided: bool = True, once: bool = True
    ) -> PackedTriangles:
        """by_place: whether to sort them by place, so that neighbours are near each other in memory; once: whether to
        leave out those that are equal to an earlier one.
        """
        vertices, corners, fourths = [np.zeros((0, 3))], [np.zeros((0, 3), np.int32)], [np.zeros(0, np.int32)]
        begin, first = [0], 0
        for k, mesh in enumerate(meshes):
            corners.append(mesh.geometry.faces + np.int32(first) if first else mesh.geometry.faces)
            back = mesh.front < 0 if sided else np.zeros(len(mesh.geometry.faces), bool)
            fourths.append(2 * k + back.astype(np.int32))
            vertices.append(mesh.vertices)
            begin.append(begin[-1] + len(mesh.geometry.faces))
            first += len(mesh.vertices)
        vertex, corner, fourth = joined(vertices), joined(corners), joined(fourths)
        order = order_of_rows(vertex, corner[:, 0]) if by_place else np.arange(begin[-1], dtype=np.int32)
        again = repeated_faces(vertex, corner) if once else np.zeros(0, np.intp)
        if len(again):
            left = np.ones(len(corner), bool)
            left[again] = False
            order = order[left[order]]
        m = len(order)
        face, number, surface, material = empty((m, 4), np.int32), *(empty((m,), np.int32) for _ in range(3))
        first_of, surface_of, material_of = (
            np.array(values, np.int32)
            for values in (begin, [mesh.number for mesh in meshes], [mesh.material for mesh in meshes])
        )

        def fill(rows: slice) -> None:
            which = order[rows]
            face[rows, :3], face[rows, 3] = corner.take(which, axis=0), fourth.take(which)
            of = face[rows, 3] >> 1
            number[rows] = which - first_of.take(of)
            surface[rows], material[rows] = surface_of.take(of), material_of.take(of)

        if m:
            blockwise(m, fill)
        return cls(vertex, face, number=number, surface=surface, material=material, sided=sided, again=len(again))


# (m,): the sign of D, or of N.l: 1 or -1 where a triangle's corners are seen one way round or the other, 0 where no ray
# from there can meet it.
Sides = NDArray[np.int8]


def from_point(
    vertex: Array, triangles: PackedTriangles, point: Array, out: Floats, plane: tuple[float, float] | None = None
) -> Sides:
    """The planes of the edges, A' x B', B' x C' and C' x A', times the sign of D = A'.N, each divided by its bound.

    Beside each edge is one number of the triangle's own plane N / D: a ray along d meets it at 1/t = N.d / D.

    A corner is off by TURNED / 4 of its size at most: it was subtracted, turned by axes that are orthogonal to 14
    roundings, and scaled. So an edge's plane is off by less than TURNED of the product of both corners' sizes; a number
    of N = e x f, of edges e and f from A, by less than TURNED s (|e| + |f|), s the largest corner's size; and D by what
    that makes of A, and TURNED |A| |N|. rounding: what float32 makes of the planes (3 arrays); reach: how much the
    former may count, 1-norm of the directions; turn: 1 or -1, a factor; exact: the sign of D of one triangle.
    """
    reach, turn = 1 + sum(plane or ()), 1.0 if plane else -1.0
    m = len(triangles.face)
    packed, sides = out.reshape(m, 3, 4), np.zeros(m, np.int8)
    columns = np.ascontiguousarray(vertex.T)
    size = np.abs(columns).sum(axis=0)

    def fill(rows: slice) -> None:
        face = np.ascontiguousarray(triangles.face[rows, :3].T)
        corner = [tuple(column.take(which) for column in columns) for which in face]
        sizes = [size.take(which) for which in face]
        planes = [cross(corner[i], corner[(i + 1) % 3]) for i in range(3)]
        e, f = (minus(other, corner[0]) for other in corner[1:])
        N = cross(e, f)
        D = dot(corner[0], N)
        most = np.maximum(np.maximum(sizes[0], sizes[1]), sizes[2])
        total, N_off = _size(N), TURNED * most * (_size(e) + _size(f))
        D_off = sizes[0] * (N_off + TURNED * total)
        side = np.sign(D)
        unsure = np.flatnonzero(~(np.abs(D) > D_off))
        side[unsure] = exact_sides(triangles, rows.start + unsure, point)
        sides[rows] = side
        side *= turn
        for i, n in enumerate(planes):
            bound = FLOAT * _rounding(n, plane) + TURNED * reach * (sizes[i] * sizes[(i + 1) % 3]) + LEAST
            factor = side / bound
            for k in range(3):
                packed[rows, i, k] = n[k] * factor
        # A point of the triangle along d has t |d_i| <= s in each coordinate, so 1/t >= (|d_x| + |d_y| + |d_z|) / 3 s.
        # Each number of N / D is off by less than (N_off + |N| D_off / |D|) / |D|, but for 2^-25 of that, so here what
        # 1/t is off by is below 2^-24 of it. Other planes are left open.
        size_of_D = np.abs(D)
        with np.errstate(all="ignore"):
            clear = (most * N_off <= 2.0**-27 * size_of_D) & (most * total * D_off <= 2.0**-27 * size_of_D * size_of_D)
            factor = np.where(clear & (D_off <= 2.0**-26 * size_of_D), turn / D, np.nan)
            for k in range(3):
                packed[rows, k, 3] = N[k] * factor

    blockwise(m, fill)
    return sides


def along_light(
    vertex: Array,
    triangles: PackedTriangles,
    axes: Array,
    towards: Array,
    out: Floats,
    plane: tuple[float, float] = (FAR, FAR),
) -> Sides:
    """As seen along a parallel light: lines in the plane across it, and how deep below the light the triangle is there.

    vertex: (v, 3), from the eye in camera space, in the float buffers' unit; axes: (3, 3), the two across and the one
    towards the light, in camera space; towards: (3,), the direction to it in the world, exactly; out: of from_point();
    plane: the largest |u| and |v|. Along an orthographic camera's view, it is the same as along light against that.

    A line is a (u, v) -> (b - a) x (p - a) for a point p of the plane. The axes are orthogonal and unit to 2^-48, and a
    point's coordinates are off by 2^-46 of FAR, beside what rounding them to float32 makes. Depth is a function of u
    and v, too: that of A, plus slopes times the way from there.
    """
    m = len(triangles.face)
    packed, sides = out.reshape(m, 3, 4), np.zeros(m, np.int8)
    u, v, s = along(axes, vertex)

    def fill(rows: slice) -> None:
        face = np.ascontiguousarray(triangles.face[rows, :3].T)
        x, y, z = ([column.take(which) for which in face] for column in (u, v, s))
        lines = []
        for i, j in ((0, 1), (1, 2), (2, 0)):
            lines.append((-(y[j] - y[i]), x[j] - x[i], x[i] * y[j] - x[j] * y[i]))
        e, f = (tuple(p[i] - p[0] for p in (x, y, z)) for i in (1, 2))
        N = cross(e, f)
        area = N[2]
        spread = (np.abs(lines[0][0]) + np.abs(lines[0][1])) + (np.abs(lines[2][0]) + np.abs(lines[2][1]))
        side = np.sign(area)
        unsure = np.flatnonzero(~(np.abs(area) > 4 * TURNED * FAR * (spread + FAR * TURNED)))
        # N points to the light where the corners turn left, as the third axis does.
        side[unsure] = exact_turns(triangles, rows.start + unsure, towards)
        sides[rows] = side
        for i, n in enumerate(lines):
            across, up = np.abs(n[0]), np.abs(n[1])
            length = across + up
            bound = (
                FLOAT * ((plane[0] * across + plane[1] * up) + np.abs(n[2]))
                + 8 * TURNED * FAR * (length + FAR * TURNED)
                + LEAST
            )
            factor = side / bound
            for k in range(3):
                packed[rows, i, k] = n[k] * factor
        # Where a line along the light meets the triangle, that is within |e| + |f| of A, and slopes are off by less
        # than (1 + |slope|) N_off / |N_s|. So here depths are off by less than 2^-27. Other planes are left open.
        reach = _size(e) + _size(f)
        with np.errstate(all="ignore"):
            a, b = N[0] / area, N[1] / area
            off = reach * (1 + np.abs(a) + np.abs(b)) * (4 * TURNED * FAR * reach)
            depth = np.where(off <= 2.0**-28 * np.abs(area), -(z[0] + (a * x[0] + b * y[0])), np.nan)
            packed[rows, 0, 3], packed[rows, 1, 3], packed[rows, 2, 3] = a, b, depth

    blockwise(m, fill)
    return sides


def _rounding(n: Columns, plane: tuple[float, float] | None) -> Array:
    """What float32 makes of a plane n times a direction, in units of FLOAT. plane: of from_point()."""
    if plane is None:
        return np.asarray(np.sqrt((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]))
    return (plane[0] * np.abs(n[0]) + plane[1] * np.abs(n[1])) + np.abs(n[2])


def _size(a: tuple[Array, ...]) -> Array:
    """The sum of the coordinates' magnitudes."""
    return (np.abs(a[0]) + np.abs(a[1])) + np.abs(a[2])


def _corners(triangles: PackedTriangles, i: int) -> list[list[Fraction]]:
    return [[Fraction(x) for x in triangles.vertex[k].tolist()] for k in triangles.face[i, :3]]


def _volume(a: Triple[Fraction], b: Triple[Fraction], c: Triple[Fraction]) -> int:
    """The sign of a.(b x c)."""
    value = dot(a, cross(b, c))
    return (value > 0) - (value < 0)


def exact_turns(triangles: PackedTriangles, which: NDArray[np.integer[Any]], towards: Array) -> list[int]:
    """The signs of l.((B - A) x (C - A)) of some triangles, (k,), l being the direction to a parallel light."""
    light = [Fraction(x) for x in towards.tolist()]
    corners = (_corners(triangles, i) for i in which.tolist())
    return [_volume(light, minus(b, a), minus(c, a)) for a, b, c in corners]


def exact_sides(triangles: PackedTriangles, which: NDArray[np.integer[Any]], point: Array) -> list[int]:
    """The signs of D = A'.(B' x C') of some triangles, (k,), as seen from a point of the world."""
    at = [Fraction(x) for x in point.tolist()]
    corners = (_corners(triangles, i) for i in which.tolist())
    return [_volume(*(minus(corner, at) for corner in three)) for three in corners]


def corner_attributes(
    meshes: tuple[PlacedMesh, ...], triangles: PackedTriangles, precision: Precision, with_uv: bool
) -> Arrays:
    """The normals and texture coordinates of k meshes with t triangles. What several meshes share is there once.

    mesh: (k,) records of abi's `Mesh`; corner_normal: (n, 4) of real_dtype(), in the objects' spaces, in float32 each
    object's divided by a power of two so that no number exceeds 1; normal_face: (t, 4) int32, which three normals the
    corners of a triangle have, and its mesh, -1 where they have none; corner_uv: (j, 2) of real_dtype(); uv_face: (t,
    4) int32, which three of these, and -1 where there are none. with_uv: whether texture coordinates are needed.
    """
    real = real_dtype(precision)
    mesh = np.zeros(len(meshes), dtype_of("Mesh", precision))
    normals, uvs, narrow = _Table(4, real), _Table(2, real), real == np.float32
    for record, placed in zip(mesh, meshes, strict=True):
        shape = placed.geometry
        for name, row in zip(("normal_x", "normal_y", "normal_z"), placed.normal_to_world, strict=True):
            record[name][:3] = row
        # A double has room for the squares of what a scene may hold.
        normals.add(id(shape), shape.normals, shape.normal_of, _exponent_of(shape.normals) if narrow else 0)
        if with_uv:
            uvs.add(id(shape), shape.uv, shape.uv_of)
    (normal, normal_face), (uv, uv_face) = normals.arrays(triangles), uvs.arrays(triangles)
    corners = {"corner_normal": normal, "normal_face": normal_face, "corner_uv": uv, "uv_face": uv_face}
    return {"mesh": mesh, **corners}


class _Table:
    """Rows of numbers, and triangles that have three of them each."""

    def __init__(self, width: int, real: np.dtype[Any]) -> None:
        self._rows = [np.zeros((0, width), real)]
        self._faces: list[NDArray[np.int32]] = []
        self._count = 0
        self._begin: dict[int, int] = {}

    def add(self, key: int, rows: NDArray[np.float64], faces: NDArray[np.int32], size: int = 0) -> None:
        """Adds a mesh: its rows unless those of this key are there, and which ones its triangles have, -1 for none.

        size: the rows are divided by 2^size.
        """
        if key not in self._begin:
            self._begin[key] = self._count
            none = self._rows[0]
            self._rows.append(widened(np.ldexp(rows, -size) if size else rows, none.shape[1], none.dtype))
            self._count += len(rows)
        begin = np.int32(self._begin[key])
        self._faces.append(np.where(faces >= 0, faces + begin, -1).astype(np.int32) if begin else faces)

    def arrays(self, triangles: PackedTriangles) -> tuple[NDArray[Any], NDArray[np.int32]]:
        """The rows, and for each of t triangles three of them and its mesh, or -1. If nothing was added, none."""
        rows = joined(self._rows)
        if not len(rows):
            return rows, np.full((len(triangles.face) if self._faces else 0, 4), (0, 0, 0, -1), np.int32)
        faces, out = joined(self._faces), empty((len(triangles.face), 4), np.int32)
        begin = np.cumsum([0, *(len(faces) for faces in self._faces)])[:-1]

        def fill(some: slice) -> None:
            mesh, number, four = triangles.face[some, 3] >> 1, triangles.number[some], out[some]
            four[:, :3] = faces.take(begin.take(mesh) + number if len(begin) > 1 else number, axis=0)
            four[:, 3] = mesh
            four[four[:, 0] < 0] = 0, 0, 0, -1

        blockwise(len(out), fill)
        return rows, out


def _exponent_of(normals: NDArray[np.float64]) -> int:
    """The k for which the largest number, divided by 2^k, is less than 1, and at least 1/2 unless all are 0."""
    return int(np.frexp(max(normals.max(initial=0), -normals.min(initial=0)))[1])


FLAGS = ("WITH_TRIANGLES", "WITH_SHAPES", "WITH_PLACED")


@dataclass(frozen=True, eq=False)
class MeshPacking(ShapePacking):
    """The m triangles of all meshes, and what their corners have for shading, as buffers: a Shape."""

    triangles: PackedTriangles
    attributes: Arrays

    words: ClassVar[str] = "triangles"

    @classmethod
    def of(cls, scene: Scene, request: Request, before: tuple[Scene, MeshPacking] | None) -> MeshPacking:
        sided = bool(scene.meshes) and may_bounce(scene, request)
        # What knows the triangles' fronts does for a scene that needs none, too.
        if before and share(before[0], scene, "meshes", "planes") and before[1].triangles.sided >= sided:
            return before[1]
        by_place = scene.triangles >= MANY and "order" not in request.keep
        once = "hidden" not in request.keep and not len(scene.planes)
        triangles = PackedTriangles.of(scene.meshes, by_place, sided=sided, once=once)
        textured = bool(scene.textures) or "uv" in request.outputs
        attributes, m = corner_attributes(scene.meshes, triangles, request.precision, textured), len(triangles.face)
        tree = {"vertex": triangles.vertex, "face": triangles.face[:, :3]}
        of: dict[str, Any] = {"triangles": triangles, "attributes": attributes}
        return cls(triangles.number, triangles.surface, FLAGS if m else (), tree, leave=m > 0, **of)

    @property
    def left_out(self) -> int:
        return self.triangles.again

    def material(self, scene: Scene) -> Ints:
        return self.triangles.material

    def solid_of(self, scene: Scene) -> Ints:
        closed = [mesh.number for mesh in scene.meshes if mesh.clipped and mesh.geometry.closed]
        number = {mesh: i for i, mesh in enumerate(closed, 1)}
        solid = np.zeros(1 + max((mesh.number for mesh in scene.meshes), default=0), np.int32)
        for mesh in scene.meshes:
            solid[mesh.number] = number.get(mesh.number, 0) if mesh.clipped else -1
        return solid.take(self.number)

    @property
    def sizes(self) -> Array:
        return np.zeros(0)  # bounds of triangles hold at any size

    def values(self, first: int) -> dict[str, Any]:
        return {"first_triangle": first, "triangles": len(self.triangles.face)}

    def packed(self, real: np.dtype[Any], exponent: int | None, basis: Array, paths: Paths) -> Arrays:
        vertex = widened(paths.moved(self.triangles.vertex, exponent), 4, real)
        return {"vertex": vertex, "face": self.triangles.face, "number_of": self.triangles.number} | self.attributes

    def in_view(self, camera: AnyCamera, first: int) -> MeshesInView:
        return MeshesInView(self, camera, first)


@dataclass
class MeshesInView(InView):
    """Triangles as a camera sees them. arrays, lit: of Sights."""

    shape: MeshPacking
    arrays: Arrays = field(default_factory=dict)
    lit: Arrays = field(default_factory=dict)

    @cached_property
    def near(self) -> Array:
        """(v, 3): from the eye to the corners, along the camera's axes, in scene units."""
        return self.seen_from(np.array(self.camera.position))

    def lengths(self) -> Sequence[Array]:
        return (self.near,)

    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        self.near *= 2.0**k
        eye_row, *rows = self.rows(len(lights))
        eye = self.from_eye(k, eye_row)
        seen = [self.from_light(light, k, row) for light, row in zip(lights, rows, strict=True)]
        return Sights(self.arrays, eye=eye, lights=[*seen], lit=self.lit)

    def rows(self, lights: int) -> Iterable[Any]:
        """Where facets go that are seen from the eye, and from each light."""
        facets = np.empty((1 + lights, 3 * len(self.shape.triangles.face), 4), np.float32)
        self.arrays["facet"], self.lit["light_facet"] = facets[0], facets[1:].reshape(-1, 4)
        return facets

    def from_eye(self, k: int, out: Floats) -> Polygons:
        """What the eye sees. out: (3 m, 4), abi's `facet`."""
        camera, (wide, high) = self.camera, self.camera.image_plane()
        if not camera.parallel:
            side = from_point(self.near, self.shape.triangles, np.array(camera.position), out, (wide, high))
        else:
            plane, back = (math.ldexp(wide, k), math.ldexp(high, k)), np.array(camera.basis()[2])
            side = along_light(self.near, self.shape.triangles, np.eye(3), towards=back, out=out, plane=plane)
        return self.polygons(self.near, side)

    def from_light(self, light: Lamp, k: int, out: Floats) -> Polygons:
        """What a light sees. out: as of from_eye()."""
        if not light.at_point:
            side = along_light(self.near, self.shape.triangles, light.axes, towards=light.towards, out=out)
            return self.polygons(self.near, side)
        place = self.seen_from(light.place, 2.0**k)
        return self.polygons(place, from_point(place, self.shape.triangles, light.place, out))

    def polygons(self, vertex: Array, side: Sides, sight: Any = None) -> Polygons:
        """See Polygons."""
        return Polygons(vertex, self.shape.triangles.face[:, :3], self.first, side, sight)

    def seen_from(self, point: Array, unit: float = 1.0) -> Array:
        """(v, 3): from a point of the world to the corners, along the camera's axes, in 1 / unit scene units."""
        return rotated(np.array(self.camera.basis()), self.shape.triangles.vertex, point, unit)
