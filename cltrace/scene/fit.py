"""Cameras that see all of a scene: where they look from, and how far its surfaces reach in any direction."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arrays import blockwise
from cltrace.numbers.inverses import inverses
from cltrace.scene.columns import Columns
from cltrace.scene.meshes import PlacedMesh
from cltrace.scene.rules import NOT_NEGATIVE, Vector, checked, described, vector

Floats = NDArray[np.float64]
# Where the camera is, as seen from the scene.
VIEWS: dict[str, Vector] = {
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "right": (1.0, 0.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
    "isometric": (1.0, 1.0, 1.0),
}


class Fitted(Protocol):
    """What of a Scene a camera is fitted to. A scene has a camera, so no camera knows what a Scene is."""

    @property
    def camera(self) -> Any: ...

    @property
    def to_object(self) -> Floats: ...

    @property
    def meshes(self) -> tuple[PlacedMesh, ...]: ...

    @property
    def cylinders(self) -> NDArray[np.void]: ...

    @property
    def columns(self) -> Columns: ...

    @property
    def triangles(self) -> int: ...


def direction_of(view: str | ArrayLike) -> Vector:
    """The direction from a scene to the camera. view: one of VIEWS, or three numbers that are not all 0."""
    if isinstance(view, str):
        if view not in VIEWS:
            raise ValueError(f"view: must be one of {', '.join(VIEWS)}, or three numbers, got {described(view)}")
        return VIEWS[view]
    found = vector("view", view)
    if not any(found):
        raise ValueError("view: must not be 0")
    return found


def up_for(view: Vector, up: ArrayLike | None) -> Vector:
    """What is up in the picture, unless told otherwise: y, or, where that is along the view, what is behind."""
    if up is not None:
        return vector("up", up)
    x, y, z = view
    return (0.0, 1.0, 0.0) if x or z else (0.0, 0.0, -1.0 if y > 0 else 1.0)


def checked_margin(margin: float) -> float:
    """The share of a picture that is not left free, if a share `margin` of it is on each of its four sides."""
    free = float(checked("margin", NOT_NEGATIVE, margin, ()))
    if not free < 0.5:
        raise ValueError(f"margin: must be below 0.5, got {free:g}")
    return 1 - 2 * free


def reaches_of(scene: Fitted, directions: ArrayLike) -> Floats:
    """How far the surfaces of a scene reach: (k,), for each direction d the largest p.d of all points p on them.

    directions: (k, 3), of any length, in the world. Raises ValueError if the scene has no surfaces.
    """
    rows = np.asarray(directions, np.float64)
    columns = scene.columns
    n, lengths = len(columns), np.sqrt((rows * rows).sum(axis=1))
    rods = scene.cylinders
    if not n and not scene.triangles and not len(rods):
        raise ValueError("scene: must have surfaces, or there is nothing to fit a camera to")
    # An ellipsoid C + r L s, with |s| = 1, reaches d.C + r |L^T d|.
    stretch = np.sqrt((np.einsum("kij,ni->nkj", inverses(scene.to_object), rows) ** 2).sum(axis=2))

    def reach(block: slice) -> Floats:
        center = columns.center[block].astype(np.float64)
        radius = np.asarray(columns.radius[block] if columns.radius.ndim else columns.radius, np.float64)
        kind = columns.to_object[block] if columns.to_object.ndim else columns.to_object
        found = []
        for row, length, by in zip(rows, lengths, stretch, strict=True):
            size = np.where(kind >= 0, by[kind], length) if len(by) else length
            found.append((center @ row + radius * size).max())
        return np.array(found)

    def corners(block: slice) -> Floats:
        return np.asarray((vertices[block] @ rows.T).max(axis=0))

    def ends(block: slice) -> Floats:
        """Of flat ends, whose discs reach r sin(angle between d and the axis)."""
        of = rods[block]
        axis = of["end"] - of["start"]
        axis /= np.sqrt((axis * axis).sum(axis=1))[:, None]
        along = axis @ rows.T
        across = np.sqrt(np.maximum(lengths**2 - along**2, 0))
        most = np.maximum(of["start"] @ rows.T, of["end"] @ rows.T) + of["radius"][:, None] * across
        return np.asarray(most.max(axis=0))

    parts = blockwise(n, reach) if n else []
    parts += blockwise(len(rods), ends) if len(rods) else []
    for mesh in scene.meshes:
        if len(mesh.geometry.faces):
            vertices = mesh.vertices[np.unique(mesh.geometry.faces)]
            parts += blockwise(len(vertices), corners)
    return np.asarray(np.max(parts, axis=0))
