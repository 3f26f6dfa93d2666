"""Lights by name: settings that look right at once, placed about a scene as its camera sees it.

They are made for the coefficients that Scene.from_spheres and Material have unless told otherwise, ka = kd = 0.8.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cltrace.scene.fit import Fitted, reaches_if_any
from cltrace.scene.lights import ambient_light, panel_light, sky_light, sun_light

Lights = list[NDArray[np.void]]
# Directions as the camera sees them: rightwards, upwards, and towards it.
KEY, EDGE = (-2.0, 2.5, 3.0), (1.0, 0.6, -1.2)


class Place:
    """Where a scene is.

    axes: (3, 3), its camera's right, up and back in the world; middle, radius: of a ball that holds its surfaces.
    """

    def __init__(self, scene: Fitted) -> None:
        self.axes = np.array(scene.camera.basis())
        self.middle, self.radius = np.zeros(3), 1.0
        reaches = reaches_if_any(scene, [*self.axes, *-self.axes])
        if reaches is not None:
            high, low = np.split(reaches, 2)
            self.middle = (high / 2 - low / 2) @ self.axes
            self.radius = float(np.hypot(*np.hypot((high / 2 + low / 2)[:2], (high / 2 + low / 2)[2])))

    def world(self, direction: tuple[float, float, float]) -> NDArray[np.float64]:
        """A direction as the camera sees it, in the world."""
        return np.asarray(np.array(direction) @ self.axes)


def _studio(at: Place) -> Lights:
    """A bright sky above, a large lamp over the left shoulder, and an edge of light from behind."""
    towards = at.world(KEY)
    across = np.cross(at.axes[1], towards)
    along = np.cross(towards, across)
    across, along = (2 * at.radius * v / np.sqrt(v @ v) for v in (across, along))
    # The lamp shines to the side of across x along, which is towards itself from the scene: so `across` is turned.
    lamp = panel_light(at.middle + at.radius * towards, (0.7, 0.7, 0.7), -across, along)
    rim = sun_light(-at.world(EDGE), (0.35, 0.35, 0.35), angle=10, directions=8)
    return [sky_light((2.8, 2.8, 2.8), at.axes[1], (1.4, 1.4, 1.4)), lamp, rim]


def _flat(at: Place) -> Lights:
    """Each surface shows exactly its colour, without shade or shadow."""
    return [ambient_light((1.25, 1.25, 1.25))]


def _sky(at: Place) -> Lights:
    """A bright sky all around, a little brighter above: what is hidden from it is dark."""
    return [sky_light((4.0, 4.0, 4.0), at.axes[1], (3.0, 3.0, 3.0))]


def _rim(at: Place) -> Lights:
    """Edges of light from behind, for a dark background."""
    right, up, back = EDGE
    sides = [at.world((side * right, up, back)) for side in (-1, 1)]
    return [ambient_light((0.2, 0.2, 0.2)), *(sun_light(-side, (0.9, 0.9, 0.9), angle=8) for side in sides)]


SETTINGS: dict[str, Callable[[Place], Lights]] = {"studio": _studio, "flat": _flat, "sky": _sky, "rim": _rim}


def check_setting(name: str) -> None:
    """Raises ValueError if no setting has this name."""
    if name not in SETTINGS:
        raise ValueError(f"lights: must be one of {', '.join(SETTINGS)}, or a list of lights, got {name!r}")


def setting(name: str, scene: Fitted) -> Lights:
    """The lights of a setting for a scene."""
    return SETTINGS[name](Place(scene))
