"""Lights: one record each, and the functions that make them.

Colours are linear and may exceed 1. They may be texts, such as "white" or "#ffe0c0", whose bytes are divided by 255.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.colors import color_numbers
from cltrace.scene.rules import ANY, CONE, NOT_NEGATIVE, check_not_bytes, checked, described, numbers

# A light has tables of its own for all spheres, and is asked for at each point: more would be no scene but a trap.
MAX_LIGHTS = 1024
LIGHT = np.dtype(
    [
        ("kind", "i4"),  # one of the four constants below
        ("color", "f8", (3,)),  # linear
        ("position", "f8", (3,)),  # point, spot: scene units
        ("direction", "f8", (3,)),  # parallel, spot: in which the light travels; any length but 0
        ("alpha1", "f8"),  # spot: degrees from the axis, full light within
        ("alpha2", "f8"),  # spot: degrees from the axis, no light beyond
    ]
)
AMBIENT, PARALLEL, POINT, SPOT = range(4)


def ambient_light(color: ArrayLike = (0.25, 0.25, 0.25)) -> NDArray[np.void]:
    """A (1,) LIGHT array: light that comes from everywhere and is never shadowed. Several add up.

    Times a material's ka, this is how bright its unlit side is. The default is a quarter of a point light's: with the
    material that `Scene.from_spheres` takes unless told otherwise (ka = kd = 0.8), a surface that also faces a point
    light has 0.8 (0.25 + 1) = 1, exactly its colour.

    Raises ValueError if the colour is not 3 numbers; negative ones are refused by the Scene, as with every light.
    """
    return _light(AMBIENT, color)


def parallel_light(direction: ArrayLike, color: ArrayLike = (1, 1, 1)) -> NDArray[np.void]:
    """A (1,) LIGHT array: a light at infinity that travels along `direction` (any length but 0).

    Raises ValueError if an argument is not 3 numbers; a direction of 0 is refused by the Scene.
    """
    return _light(PARALLEL, color, direction=direction)


def point_light(position: ArrayLike, color: ArrayLike = (1, 1, 1)) -> NDArray[np.void]:
    """A (1,) LIGHT array: a point that shines equally in all directions, without attenuation.

    Raises ValueError if an argument is not 3 numbers.
    """
    return _light(POINT, color, position=position)


def spot_light(
    position: ArrayLike, direction: ArrayLike, alpha1: float, alpha2: float, color: ArrayLike = (1, 1, 1)
) -> NDArray[np.void]:
    """A (1,) LIGHT array: full light up to alpha1 degrees off `direction`, falling linearly to none at alpha2.

    Both angles are measured from the axis, within 0..180 degrees. Raises ValueError if an argument is not 3 numbers,
    or not one where it is an angle; alpha1 > alpha2 and a direction of 0 are refused by the Scene.
    """
    return _light(SPOT, color, position=position, direction=direction, alpha1=alpha1, alpha2=alpha2)


def _light(
    kind: int,
    color: ArrayLike,
    position: ArrayLike = (0, 0, 0),
    direction: ArrayLike = (0, 0, -1),
    alpha1: ArrayLike = 0,
    alpha2: ArrayLike = 0,
) -> NDArray[np.void]:
    """Their values are checked by the scene that they become part of, which knows the light's index."""
    color = color_numbers("light.color", color)
    given = {"color": color, "position": position, "direction": direction, "alpha1": alpha1, "alpha2": alpha2}
    light = np.empty(1, LIGHT)
    light["kind"] = kind
    for name, value in given.items():
        array = numbers(f"light.{name}", value)
        if array.shape != LIGHT[name].shape:
            wanted = "3 numbers" if LIGHT[name].shape else "one number"
            raise ValueError(f"light.{name}: must be {wanted}, got {described(value)}")
        light[name] = array
    check_not_bytes("light.color", color)
    return light


def joined(lights: Iterable[NDArray[np.void]] | NDArray[np.void]) -> NDArray[np.void]:
    """Arrays of lights as one (n,) LIGHT array. TypeError where one of them is none."""
    arrays = [lights] if isinstance(lights, np.ndarray) else lights
    if not isinstance(arrays, Iterable):
        raise TypeError(f"lights: must be a list of lights, got {described(lights)}")
    arrays = list(arrays)
    for array in arrays:
        if not isinstance(array, np.ndarray) or array.dtype != LIGHT or array.ndim > 1:
            raise TypeError(
                "lights: must be a list of what ambient_light(), parallel_light(), point_light() and spot_light() "
                f"return, got {described(array)}{'' if array is lights else ' among them'}"
            )
    return np.concatenate([np.zeros(0, LIGHT), *map(np.atleast_1d, arrays)])


def check_lights(lights: NDArray[np.void]) -> None:
    """Raises ValueError, which names field and index, where a LIGHT array holds what is not allowed."""
    if len(lights) > MAX_LIGHTS:
        raise ValueError(f"lights: must be at most {MAX_LIGHTS}, got {len(lights)}")
    for name, rule in (("color", NOT_NEGATIVE), ("position", ANY), ("direction", ANY)):
        checked(f"lights.{name}", rule, lights[name], (-1, 3))
    for name in ("alpha1", "alpha2"):
        checked(f"lights.{name}", CONE, lights[name], (-1,))
    for i, light in enumerate(lights):
        if light["kind"] not in (AMBIENT, PARALLEL, POINT, SPOT):
            raise ValueError(f"lights.kind[{i}]: must be within 0..3, got {light['kind']}")
        if light["kind"] in (PARALLEL, SPOT) and not light["direction"].any():
            raise ValueError(f"lights.direction[{i}]: must not be 0")
        if light["kind"] == SPOT and light["alpha1"] > light["alpha2"]:
            raise ValueError(f"lights.alpha1[{i}]: must be <= alpha2, got {light['alpha1']:g} > {light['alpha2']:g}")
