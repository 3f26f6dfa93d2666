"""What other libraries call a mesh: those of trimesh, meshio and pyvista, known by their attributes alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.scene.rules import described


@dataclass(frozen=True)
class Found:
    """vertices: (v, 3); faces: (f, 3); colors: of each of either, or None; named: numbers of each vertex, by names, and
    of_cells: those of each cell.
    """

    vertices: Any
    faces: Any
    colors: Any = None
    named: Mapping[str, Any] = field(default_factory=dict)
    of_cells: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not len(self.faces):
            raise ValueError("mesh: must have triangles, and has none; for points there is Scene.from_spheres")

    @classmethod
    def of(cls, thing: Any) -> Found:
        """Raises TypeError if this is none of what `Mesh.of` knows, and ValueError if there is no triangle in it."""
        if hasattr(thing, "geometry") and hasattr(thing, "to_mesh"):  # a Scene of trimesh: all of it as one
            parts = thing.dump() if hasattr(thing, "dump") else []
            kinds = {_kind_of(part) for part in parts}
            if "face" in kinds and len(kinds) > 1:
                return _of_parts(parts)
            thing = thing.to_mesh()
        if hasattr(thing, "vertices") and hasattr(thing, "faces"):
            return cls(thing.vertices, thing.faces, _colors_of_trimesh(getattr(thing, "visual", None)))
        if hasattr(thing, "extract_surface") and not hasattr(thing, "faces"):  # a grid of pyvista: what is seen of it
            thing = _surface(thing)
        named, of_cells = (getattr(thing, name, {}) for name in ("point_data", "cell_data"))
        if hasattr(thing, "points") and hasattr(thing, "faces"):
            if getattr(thing, "n_strips", 0):
                raise ValueError("mesh.strips: must be none; triangulate() of the PolyData makes triangles of them")
            polygons = _polygons(np.asarray(thing.faces))
        elif hasattr(thing, "points") and hasattr(thing, "cells"):
            polygons = _cells(thing.cells)
        else:
            raise TypeError(f"mesh: must have vertices and faces, or points and faces or cells, got {described(thing)}")
        return cls(thing.points, _fans(polygons), colors=_colors_of_points(named), named=named, of_cells=of_cells)

    def values(self, values: Any) -> Any:
        """Those of this name, or as they are. Raises ValueError if there is no such name."""
        if not isinstance(values, str):
            return values
        if values not in self.named:
            names = ", ".join(name for name in self.named if not name.startswith("vtk")) or "none"
            hint = "; cell_data_to_point_data() makes point_data of cell_data" if values in self.of_cells else ""
            raise ValueError(f"mesh.values: must be numbers or a name of point_data, {names}, got {values!r}{hint}")
        return np.asarray(self.named[values])


def _of_parts(parts: list[Any]) -> Found:
    """Meshes of trimesh as one, whose triangles share no corners. Each corner has its part's colour there, or white."""
    places, colors = [], []
    for part in parts:
        corners = np.asarray(part.faces).reshape(-1)
        places.append(np.asarray(part.vertices)[corners])
        own = _colors_of_trimesh(part.visual)
        if own is None:
            own = np.ones((len(corners), 4))
        elif _kind_of(part) == "face":
            own = np.repeat(own, 3, axis=0)
        else:
            own = own[corners]
        colors.append(own)
    vertices = np.concatenate(places)
    return Found(vertices, np.arange(len(vertices)).reshape(-1, 3), np.concatenate(colors))


def _kind_of(part: Any) -> Any:
    """What a mesh of trimesh has colours of: "vertex" or "face"; else None, or what is none."""
    return getattr(getattr(part, "visual", None), "kind", None)


def _surface(grid: Any) -> Any:
    try:
        return grid.extract_surface(algorithm=None)
    except TypeError:  # before 0.47 there was but one
        return grid.extract_surface()


def _colors_of_trimesh(visual: Any) -> Any:
    """Those of vertices or of faces, which are bytes; None if the mesh has neither."""
    kind = getattr(visual, "kind", None)
    return _shares(getattr(visual, f"{kind}_colors")) if kind in ("vertex", "face") else None


def _colors_of_points(named: Mapping[str, Any]) -> Any:
    """Those that a PLY has, as pyvista and as meshio call them."""
    for name in ("RGBA", "RGB"):
        if name in named:
            return _shares(named[name])
    parts = [named[name] for name in ("red", "green", "blue", "alpha") if name in named]
    return _shares(np.stack(parts, axis=-1)) if len(parts) >= 3 else None


def _shares(colors: Any) -> NDArray[Any]:
    array = np.asarray(colors)
    if array.dtype == np.int8:  # as meshio has a PLY's bytes
        array = array.view(np.uint8)
    return array / 255 if array.dtype.kind in "iu" else array


def _polygons(faces: NDArray[Any]) -> list[NDArray[Any]]:
    """The corners of VTK's list of polygons, each after its count: (n, k) for each run of polygons with k corners."""
    runs: list[NDArray[Any]] = []
    at = 0
    while at < len(faces):
        step = int(faces[at]) + 1
        counts = faces[at :: max(1, step)]
        other = np.flatnonzero(counts != step - 1)
        same = min(int(other[0]) if len(other) else len(counts), (len(faces) - at) // max(1, step))
        if step < 2 or not same:
            raise ValueError(f"mesh.faces: must be polygons, each after the count of its corners, got {step - 1}")
        runs.append(faces[at : at + same * step].reshape(same, step)[:, 1:])
        at += same * step
    return runs


def _cells(blocks: Iterable[Any]) -> list[NDArray[Any]]:
    """The corners of meshio's blocks of cells that are triangles, quads or polygons."""
    try:
        pairs = [block if isinstance(block, tuple) else (block.type, block.data) for block in blocks]
    except (AttributeError, TypeError):
        raise TypeError(f"mesh.cells: must be a list of blocks with type and data, got {described(blocks)}") from None
    found = []
    for kind, data in pairs:
        if kind in ("triangle", "quad") or kind.startswith("polygon"):
            corners = np.asarray(data)
            if corners.ndim != 2 or corners.shape[1] < 3:
                raise ValueError(f"mesh.cells: must have shape (n, 3) or more, got {corners.shape} of type {kind}")
            found.append(corners)
    if not found:
        raise ValueError("mesh.cells: must have some of type triangle, quad or polygon, got none")
    return found


def _fans(polygons: list[NDArray[Any]]) -> NDArray[Any]:
    """The triangles of polygons, (f, 3), in their order; those of more than three corners as fans."""
    fans = [np.zeros((0, 3), np.int64)]
    for corners in polygons:
        k = np.arange(1, corners.shape[1] - 1)
        fans.append(corners[:, np.stack([0 * k, k, k + 1], axis=1)].reshape(-1, 3))
    return np.concatenate(fans)
