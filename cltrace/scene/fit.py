"""Cameras that see all of a scene: where they look from, and how far its surfaces reach in any direction."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.rules import NOT_NEGATIVE, Vector, checked, described, vector
from cltrace.scene.shapes.shape import Shape

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
    def shapes(self) -> tuple[Shape, ...]: ...


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
    found = reaches_if_any(scene, directions)
    if found is None:
        raise ValueError("scene: must have surfaces, or there is nothing to fit a camera to")
    return found


def reaches_if_any(scene: Fitted, directions: ArrayLike) -> Floats | None:
    """The same, but None if the scene has no surfaces."""
    rows = np.asarray(directions, np.float64)
    parts = [part for shape in scene.shapes for part in shape.reach(rows)]
    return np.max(parts, axis=0) if parts else None
