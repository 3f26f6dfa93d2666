"""The members of soft lights: fixed sets of directions and points, of low discrepancy.

Nothing is random here: a picture is the same everywhere, a movie does not flicker, and each member is a light whose
shadows are exact. Directions are a Fibonacci lattice, as in R. Swinbank and R. J. Purser, Fibonacci grids (2006): each
one goes on by the golden angle about the axis, and by the same share of the area along it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cltrace.scene.lights import BALL, LAMBERT, LIGHT, PANEL, PARALLEL, POINT, SKY, SOFT, SUN

Array = NDArray[np.float64]
# The golden ratio, whose multiples are spread most evenly over a circle of length 1, however many there are, and a
# number that is likewise for pairs with it: the plastic number, the root of x^3 = x + 1.
GOLDEN, PLASTIC = (1 + math.sqrt(5)) / 2, 1.3247179572447460


def members_of(light: np.void) -> NDArray[np.void]:
    """(m,) of LIGHT, none of them soft: what a light stands for. One that is not soft is its own member."""
    members = MEMBERS.get(int(light["kind"]))
    return members(light) if members else np.array([light], LIGHT)


def lamps_of(lights: NDArray[np.void]) -> tuple[NDArray[np.void], NDArray[np.intp]]:
    """The members of all lights, one light's after the other's, and the index of each one's light.

    Where no light is soft, they are the lights themselves, the same array.
    """
    if not np.isin(lights["kind"], SOFT).any():
        return lights, np.arange(len(lights))
    members = [members_of(light) for light in lights]
    return np.concatenate(members), np.repeat(np.arange(len(lights)), [len(some) for some in members])


def _turns(n: int) -> Array:
    """(n,): the angles of a Fibonacci lattice about its axis, radians."""
    return np.asarray(2 * np.pi * np.mod(np.arange(n) / GOLDEN, 1.0))


def middles(n: int) -> Array:
    """(n,): the middles of n equal parts of 0..1."""
    return np.asarray((np.arange(n) + 0.5) / n)


def axes_about(axis: Array) -> Array:
    """(3, 3): two unit vectors across an axis of any length but 0, and its own; the first one always is the same."""
    ahead = axis / np.abs(axis).max()
    ahead /= np.sqrt((ahead * ahead).sum())
    across = np.cross(np.eye(3)[np.argmin(np.abs(ahead))], ahead)
    across /= np.sqrt((across * across).sum())
    return np.array([across, np.cross(ahead, across), ahead])


def cap(axis: Array, angle: float, n: int) -> Array:
    """(n, 3): unit vectors, evenly spread over those that are at most `angle` degrees off an axis."""
    height = 1 - (1 - math.cos(math.radians(angle))) * middles(n)
    return _on_circles(np.sqrt((1 - height) * (1 + height)), height, n) @ axes_about(axis)


def ball(n: int) -> Array:
    """(n, 3): points of the unit ball which, seen from any side, are spread evenly over its disc.

    With the density 1 / (pi^2 sqrt(1 - r^2)) about the middle, what lies behind each another at the distance p from the
    middle is 2 / pi^2 times the integral of r dr / (sqrt(1 - r^2) sqrt(r^2 - p^2)) from p to 1, which is pi / 2
    whatever p is (Abel). With r = sin(a), the share of it within r is (2 a - sin(2 a)) / pi.
    """
    share = np.mod(0.5 + np.arange(n) / PLASTIC, 1.0)
    low, high = np.zeros(n), np.full(n, np.pi / 2)
    for _ in range(60):  # halves: the share grows with a
        middle = (low + high) / 2
        below = (2 * middle - np.sin(2 * middle)) / np.pi < share
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    height = 1 - 2 * middles(n)
    return np.asarray(np.sin(high)[:, None] * _on_circles(np.sqrt((1 - height) * (1 + height)), height, n))


def _on_circles(radius: Array, height: Array, n: int) -> Array:
    """(n, 3): points on circles about the third axis, each at the next of _turns()."""
    return np.stack([radius * np.cos(_turns(n)), radius * np.sin(_turns(n)), height], axis=1)


def _some(light: np.void, kind: int, **columns: Array) -> NDArray[np.void]:
    """The members of a light, of one kind, each with its share of the colour unless that is given."""
    found = np.zeros(int(light["members"]), LIGHT)
    found["kind"], found["direction"] = kind, (0, 0, -1)
    for name, values in ({"color": light["color"] / len(found)} | columns).items():
        found[name] = values
    return found


def _of_cap(light: np.void) -> NDArray[np.void]:
    n, axis = int(light["members"]), -light["direction"]
    towards = cap(axis, float(light["alpha2"]), n)
    high = (1 + towards @ axes_about(axis)[2])[:, None] / 2
    even = (light["color"] == light["below"]).all()
    color = light["color"] if even else high * light["color"] + (1 - high) * light["below"]
    return _some(light, PARALLEL, direction=-towards, color=color / n)


def _of_ball(light: np.void) -> NDArray[np.void]:
    return _some(light, POINT, position=light["position"] + light["radius"] * ball(int(light["members"])))


def _of_panel(light: np.void) -> NDArray[np.void]:
    (across, along), n = light["edges"], int(light["members"])
    x, y = middles(n) - 0.5, np.mod(np.arange(n) / GOLDEN + 0.5, 1.0) - 0.5
    sizes = np.abs(across).max(), np.abs(along).max()
    normal = np.cross(across / sizes[0], along / sizes[1])
    place = light["position"] + x[:, None] * across + y[:, None] * along
    return _some(light, LAMBERT, position=place, direction=normal)


# By the kinds of soft lights.
MEMBERS: dict[int, Callable[[np.void], NDArray[np.void]]] = {
    SKY: _of_cap,
    SUN: _of_cap,
    BALL: _of_ball,
    PANEL: _of_panel,
}
