"""What of a scene is on one side of a plane: balls and meshes that it cuts are closed by caps.

The plane is that of the cut balls, exactly: through the point, across the way from there to the `end` of them all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import inverses
from cltrace.base.limits import MAX_CYLINDERS
from cltrace.scene.cylinders import colors_of, linear
from cltrace.scene.materials import Material, packed, records
from cltrace.scene.meshes import PlacedMesh, check_size
from cltrace.scene.rules import ANY, checked
from cltrace.scene.sections import Section
from cltrace.scene.shapes.cut import CUT
from cltrace.scene.spheres import Columns
from cltrace.scene.surfaces import Floats

if TYPE_CHECKING:
    from cltrace.scene.scene import Scene

Mask = NDArray[np.bool_]
# More than heights round, as a share of what they are made of. What is so close to the plane counts as cut by it, and
# is what it is: the whole of it, or nothing.
ROOM = 2.0**-40


@dataclass(frozen=True)
class Half:
    """The half of space that stays: the points x with (x - start).u >= 0, u = end - start. Scene units.

    size: how far from the start anything may be.
    """

    start: Floats
    end: Floats
    size: float

    @classmethod
    def of(cls, scene: Scene, point: ArrayLike, normal: ArrayLike) -> Half:
        """Raises ValueError, which names the argument."""
        start, away = checked("point", ANY, point, (3,)), checked("normal", ANY, normal, (3,))
        if not away.any():
            raise ValueError("normal: must not be 0")
        away = away / np.abs(away).max()
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        far = [np.abs(part).max() for shape in scene.shapes for part in shape.reach(axes)]
        size = 4 * (max(far, default=0.0) + float(np.abs(start).max()))
        # A power of two rounds nothing, and what the end rounds turns the plane by less than 2^-50.
        along = math.ldexp(1.0, math.frexp(size)[1] + 1)
        end = start - away * along
        return cls(start, checked("point, moved against the normal", ANY, end, (3,)), size)

    @classmethod
    def between(cls, points: Floats) -> Half:
        """Of start and end, (2, 3)."""
        return cls(points[0], points[1], 0.0)

    @property
    def up(self) -> Floats:
        """u / |u|, rounded."""
        u = self.end - self.start
        return np.asarray(u / math.sqrt(float(u @ u)))

    def heights(self, points: Floats) -> Floats:
        """(n,): (x - start).u. Points at one place have one height, which `@` does not promise."""
        return np.asarray(((points - self.start) * (self.end - self.start)).sum(axis=1))

    def section_of(self, mesh: PlacedMesh) -> Section | None:
        """Where it cuts a mesh, of which it keeps what is above; None where nothing is, and the mesh itself if all."""
        height = self.heights(mesh.vertices)
        used = height[mesh.geometry.faces] >= 0
        if used.all():
            return Section(mesh, np.zeros((0, 2, 3)), False)
        return Section.of(mesh, height) if used.any() else None

    def sides(self, points: Floats, radius: Any) -> tuple[Mask, Mask]:
        """(n,) each: what is surely all in it, and what is surely all out of it. radius: how far up or down from the
        points it reaches."""
        height = (points - self.start) @ self.up
        room = radius + ROOM * (self.size + np.abs(points).max(axis=1, initial=0))
        return height > room, height < -room


def clipped(scene: Scene, point: ArrayLike, normal: ArrayLike, cap_color: ArrayLike | None) -> Scene:
    """See Scene.clipped()."""
    half = Half.of(scene, point, normal)
    columns, many = scene.columns, len(scene.columns)
    radius = np.broadcast_to(columns.radius, (many,)).astype(np.float64)
    maps = np.broadcast_to(columns.to_object, (many,))
    # An ellipsoid C + r L s, with |s| = 1, reaches r |L^T n| to both sides. The last one is that of a ball, whose map
    # is -1.
    stretch = np.append(np.linalg.norm(half.up @ inverses(scene.to_object), axis=1), 1.0)
    kept, gone = half.sides(columns.center.astype(np.float64), radius * stretch[maps])
    cut = np.flatnonzero(~kept & ~gone)
    kinds = _cap(cap_color)
    _check_balls(scene, cut, maps)
    made = _cut(columns, cut, radius, half)
    caps = made[: len(made) if len(kinds) else 0].copy()
    cap = columns.materials_count if len(kinds) else None
    caps["flat"], caps["material"] = 1, cap or 0
    columns = columns.with_more(linear(kinds, scene.transfer))
    old, rods = scene.cuts, scene.cylinders
    found = np.concatenate([old[_whole(half, old)], caps, made])
    if len(found) > MAX_CYLINDERS:
        raise ValueError(f"cut balls and caps: must be at most {MAX_CYLINDERS}, got {len(found)}")
    rods = rods[_rods(half, rods)].copy()
    meshes, columns = _meshes(half, columns, scene.meshes, cap)
    first = int(kept.sum())
    meshes = [mesh.of(mesh.material, first + i) for i, mesh in enumerate(meshes)]
    check_size(meshes)
    found["number"] = first + len(meshes) + np.arange(len(found))
    rods["number"] = first + len(meshes) + len(found) + np.arange(len(rods))
    return scene.with_fields(
        columns=_taken(columns, kept), meshes=tuple(meshes), cuts=found, cylinders=rods, bonds=None, scale=None
    )


def _cap(color: ArrayLike | None) -> NDArray[np.void]:
    """MATERIAL of caps of one colour, (1,), or none. Raises ValueError, which names cap_color."""
    kinds, _ = records([Material()] if color is not None else [])
    if color is not None:
        shown = colors_of("cap_color", 1, color)
        if shown.shape != (3,):
            raise ValueError(f"cap_color: must be one colour, got an array of shape {shown.shape}")
        kinds["color"] = shown
    return kinds


def _cut(columns: Columns, which: NDArray[np.intp], radius: Floats, half: Half) -> NDArray[np.void]:
    """CUT records of some spheres, without numbers."""
    made = np.zeros(len(which), CUT)
    made["center"], made["radius"] = columns.center[which], radius[which]
    made["start"], made["end"] = half.start, half.end
    made["material"] = np.broadcast_to(columns.material_of, (len(columns),))[which]
    return made


def _taken(columns: Columns, kept: Mask) -> Columns:
    """Some of the spheres, with the materials of all."""
    center, radius, kind, material = (
        x[kept] if x.ndim else x for x in (columns.center, columns.radius, columns.to_object, columns.material_of)
    )
    return replace(columns, center=center, radius=radius, to_object=kind, material=material)


def _check_balls(scene: Scene, cut: NDArray[np.intp], maps: NDArray[np.int32]) -> None:
    """Raises ValueError where the plane cuts what it cannot cut."""
    bent = cut[maps[cut] >= 0]
    if len(bent):
        raise ValueError(f"spheres[{bent[0]}]: is an ellipsoid that the plane cuts, and only balls can be cut")
    if len(scene.textures):
        image = scene.materials["texture"][np.broadcast_to(scene.columns.material_of, (len(maps),))[cut]]
        shown = cut[image >= 0]
        if len(shown):
            raise ValueError(f"spheres[{shown[0]}]: has a texture and the plane cuts it; cut balls have none")


def _whole(half: Half, cuts: NDArray[np.void]) -> Mask:
    """(n,): which cut balls and caps stay. Raises ValueError where the plane may cut the whole ball of one."""
    kept, gone = half.sides(cuts["center"], cuts["radius"])
    cut = np.flatnonzero(~kept & ~gone)
    if len(cut):
        raise ValueError(f"cut balls[{cut[0]}]: the plane cuts a ball that is cut already; a ball can be cut once")
    return kept


def _rods(half: Half, rods: NDArray[np.void]) -> Mask:
    """(n,): which cylinders stay. Raises ValueError where the plane may cut one."""
    # Ends are discs, which reach r sin(angle between u and the axis). A root of 1 - cos^2 would be less exact.
    axis = rods["end"] - rods["start"]
    reach = rods["radius"] * np.linalg.norm(np.cross(axis, half.up), axis=1) / np.linalg.norm(axis, axis=1)
    (a_in, a_out), (b_in, b_out) = (half.sides(rods[end], reach) for end in ("start", "end"))
    cut = np.flatnonzero(~(a_in & b_in) & ~(a_out & b_out))
    if len(cut):
        raise ValueError(f"cylinders[{cut[0]}]: the plane cuts it, which only balls can be; leave it out, or move it")
    return np.asarray(a_in & b_in)


def _meshes(
    half: Half, columns: Columns, meshes: Iterable[PlacedMesh], material: int | None
) -> tuple[list[PlacedMesh], Columns]:
    """What stays of meshes, then their caps, without numbers; and the materials with those of the caps.

    material: the index of that of all caps, None where each is as its mesh, but for its texture.
    """
    left, caps, more = [], list[PlacedMesh](), list[NDArray[np.void]]()
    for mesh in meshes:
        section = half.section_of(mesh)
        if section and section.kept is mesh:
            left.append(mesh)
        elif section:
            planes = np.concatenate([mesh.planes, [[half.start, half.end]]])
            left.append(section.kept.cut_by(planes, mesh.cut_from or mesh))
            cap = _closing(half, half.section_of(mesh.cut_from) if mesh.cut_from else section, mesh.planes)
            if cap:
                kind = material
                if kind is None:
                    kind = columns.materials_count + len(more)
                    more.append(packed(columns.materials_count, columns.every_shade())[mesh.material])
                caps.append(cap.of(kind, 0))
    if more:
        shown = np.array(more)
        shown["texture"] = -1
        columns = columns.with_more(shown)
    return left + caps, columns


def _closing(half: Half, section: Section | None, planes: Floats) -> PlacedMesh | None:
    """What closes a mesh where the plane cuts it, None if it is open or that has no area.

    section: of the whole mesh; planes: those that have cut it before.
    """
    made = section.cap(half.start - half.end) if section and section.closed else None
    cap = PlacedMesh(made) if made else None
    for before in planes:
        left = cap and Half.between(before).section_of(cap)
        cap = left.kept if left else None
    return cap
