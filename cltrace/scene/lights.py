"""Lights: one record each, and the functions that make them.

Colours are linear and may exceed 1. They may be texts, such as "white" or "#ffe0c0", whose bytes are divided by 255.
A soft light stands for many, its members, which are listed at the end of this file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.limits import MAX_LIGHTS, hint
from cltrace.scene.camera import reaches_if_any
from cltrace.scene.colors import color_numbers
from cltrace.scene.rules import ANY, CONE, NOT_NEGATIVE, check_not_bytes, check_rule, described, is_whole, numbers

if TYPE_CHECKING:
    from cltrace.scene.scene import Scene

LIGHT = np.dtype(
    [
        ("kind", "i4"),  # one of the constants below
        ("color", "f8", (3,)),  # linear; of a sky: of what comes along `direction`
        ("position", "f8", (3,)),  # point, spot, lambert: scene units; ball, panel: of the middle
        ("direction", "f8", (3,)),  # parallel, spot, lambert, sky, sun: in which the light travels; any length but 0
        ("alpha1", "f8"),  # spot: degrees from the axis, full light within
        ("alpha2", "f8"),  # spot, sky, sun: degrees from the axis, no light beyond
        ("members", "i4"),  # of a soft light: how many it has; 0 of others
        ("below", "f8", (3,)),  # sky, sun: the linear colour of what comes against `direction`
        ("radius", "f8"),  # ball: scene units
        ("edges", "f8", (2, 3)),  # panel: scene units; it shines to the side of edges[0] x edges[1]
    ]
)
# A lambert light is at a point, as bright as the cosine of the angle from its direction: a small flat lamp.
AMBIENT, PARALLEL, POINT, SPOT, LAMBERT, SKY, SUN, BALL, PANEL = range(9)
SOFT = (SKY, SUN, BALL, PANEL)


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


def sky_light(
    color: ArrayLike = (1, 1, 1), up: ArrayLike | None = None, below: ArrayLike | None = None, directions: int = 64
) -> NDArray[np.void]:
    """A (1,) LIGHT array: a soft light from all around, or from half a sky.

    What a white matte surface (kd = 1) that sees all of it shows: with `color` alone, which comes evenly from all
    around, color / 4; with `up`, evenly from the half of the sky in that direction (any length but 0), color / 2 if it
    faces up; with `below`, too, from all around, `color` from straight above, `below` from straight below, and between
    these mixed by height, (5 color + below) / 24 if it faces up.

    It is that many parallel lights, whose directions are a Fibonacci lattice and whose colours are the sky's there over
    their number: so they add up to `color`, or with `below` to the mean of both, and each casts an exact shadow. With a
    material's ka = 0, this is ambient occlusion. directions: 1 to 1,024.

    Raises ValueError if an argument is not 3 numbers, if below comes without up, or directions is not such a number.
    """
    if up is None and below is not None:
        raise ValueError("light.below: goes with up, which is not given")
    down = -_shaped("up", (0, 1, 0) if up is None else up, (3,))
    alpha2 = 90 if up is not None and below is None else 180
    low = color if below is None else below
    return _light(SKY, color, direction=down, alpha2=alpha2, below=low, directions=directions)


def sun_light(
    direction: ArrayLike, color: ArrayLike = (1, 1, 1), angle: float = 5.0, directions: int = 16
) -> NDArray[np.void]:
    """A (1,) LIGHT array: a soft light that travels along `direction` (any length but 0), from a disc in the sky.

    What a white matte surface (kd = 1) that faces the middle of the disc shows: color * (1 + cos(angle)) / 2. angle: in
    degrees from the disc's middle to its rim, within 0..180; that of the real sun is 0.27. It is that many parallel
    lights of color / directions each, in a Fibonacci lattice. directions: 1 to 1,024.

    Raises ValueError if an argument is not 3 numbers or one, or directions is not such a number; a direction of 0 is
    refused by the Scene.
    """
    return _light(SUN, color, direction=direction, alpha2=angle, below=color, directions=directions)


def ball_light(
    position: ArrayLike, color: ArrayLike = (1, 1, 1), radius: float = 1.0, points: int = 16
) -> NDArray[np.void]:
    """A (1,) LIGHT array: a soft light from a ball that looks like an evenly bright disc from everywhere.

    What a white matte surface (kd = 1) that faces a distant ball shows: `color`. There is no attenuation, as of a
    point_light(). position: of the middle, scene units; radius: > 0, scene units. It is that many point lights of
    color / points each, which fill the ball so that, seen from any side, they are spread evenly over its disc: what
    stands within the ball casts shadows, too. points: 1 to 1,024.

    Raises ValueError if an argument is not 3 numbers or one, or points is not such a number; a radius that is not
    positive is refused by the Scene.
    """
    return _light(BALL, color, position=position, radius=radius, points=points)


def panel_light(
    position: ArrayLike, color: ArrayLike, across: ArrayLike, along: ArrayLike, points: int = 16
) -> NDArray[np.void]:
    """A (1,) LIGHT array: a soft light from a flat parallelogram, which shines to the side of across x along.

    What a white matte surface (kd = 1) shows that faces a distant panel from straight before it: `color`; elsewhere,
    that times the cosine of the angle between the panel's normal and the way to the point, and nothing behind it. There
    is no attenuation. position: of the middle; across, along: its edges; all in scene units. It is that many points of
    color / points each, in a Fibonacci lattice. points: 1 to 1,024.

    Raises ValueError if an argument is not 3 numbers, or points is not such a number; edges along one line are refused
    by the Scene.
    """
    edges = [_shaped("across", across, (3,)), _shaped("along", along, (3,))]
    return _light(PANEL, color, position=position, edges=edges, points=points)


def _shaped(name: str, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    array = numbers(f"light.{name}", value)
    if array.shape != shape:
        raise ValueError(f"light.{name}: must be {'3 numbers' if shape else 'one number'}, got {described(value)}")
    return array


def _light(kind: int, color: ArrayLike, **given: ArrayLike) -> NDArray[np.void]:
    """Its values are checked by the scene that it becomes part of, which knows the light's index.

    given: by the names of LIGHT, but directions or points for members; what is missing is 0, but for the direction.
    """
    for name in {"directions", "points"} & given.keys():
        count: Any = given.pop(name)
        if not is_whole(count) or not 1 <= count <= MAX_LIGHTS:
            more = hint("lights") if is_whole(count) and count > MAX_LIGHTS else ""
            within = f"must be a whole number within 1..{MAX_LIGHTS}, got {described(count)}{more}"
            raise ValueError(f"light.{name}: {within}")
        given["members"] = count
    given = {"color": color, "direction": (0, 0, -1), **given}
    colors = {name: color_numbers(f"light.{name}", given[name]) for name in ("color", "below") if name in given}
    light = np.zeros(1, LIGHT)
    light["kind"] = kind
    for name, value in (given | colors).items():
        light[name] = _shaped(name, value, LIGHT[name].shape)
    for name, value in colors.items():
        check_not_bytes(f"light.{name}", value)
    return light


def joined(lights: Iterable[NDArray[np.void]] | NDArray[np.void]) -> NDArray[np.void]:
    """Arrays of lights as one (n,) LIGHT array. TypeError where one of them is none."""
    arrays = [lights] if isinstance(lights, np.ndarray) else lights
    if not isinstance(arrays, Iterable):
        raise TypeError(f"lights: must be a list of lights, got {described(lights)}")
    arrays = list(arrays)
    for array in arrays:
        if not isinstance(array, np.ndarray) or array.dtype != LIGHT or array.ndim > 1:
            got = f"{described(array)}{'' if array is lights else ' among them'}"
            words = "must be a list of what ambient_light(), point_light(), sky_light() and the like return"
            raise TypeError(f"lights: {words}, got {got}")
    return np.concatenate([np.zeros(0, LIGHT), *map(np.atleast_1d, arrays)])


def check_lights(lights: NDArray[np.void]) -> None:
    """Raises ValueError, which names field and index, where a LIGHT array holds what is not allowed."""
    soft = np.isin(lights["kind"], SOFT)
    count = int(np.where(soft, lights["members"], 1).sum())
    if count > MAX_LIGHTS:
        members = " with all members of soft lights" if soft.any() else ""
        raise ValueError(f"lights: must be at most {MAX_LIGHTS}{members}, got {count}{hint('lights')}")
    rules = {"color": NOT_NEGATIVE, "below": NOT_NEGATIVE, "alpha1": CONE, "alpha2": CONE, "radius": NOT_NEGATIVE}
    for name, rule in (rules | dict.fromkeys(("position", "direction", "edges"), ANY)).items():
        check_rule(f"lights.{name}", rule, lights[name])
    for i, light in enumerate(lights):
        _check_light(i, light)


def _check_light(i: int, light: np.void) -> None:
    """The same of what makes no sense together. i: its index."""
    kind = light["kind"]
    if kind not in range(PANEL + 1):
        raise ValueError(f"lights.kind[{i}]: must be within 0..{PANEL}, got {kind}")
    if kind in (PARALLEL, SPOT, LAMBERT, SKY, SUN) and not light["direction"].any():
        raise ValueError(f"lights.direction[{i}]: must not be 0")
    if kind == SPOT and light["alpha1"] > light["alpha2"]:
        raise ValueError(f"lights.alpha1[{i}]: must be <= alpha2, got {light['alpha1']:g} > {light['alpha2']:g}")
    if kind in SOFT and light["members"] < 1:
        raise ValueError(f"lights.members[{i}]: must be at least 1, got {light['members']}")
    if kind == BALL and not light["radius"] > 0:
        raise ValueError(f"lights.radius[{i}]: must be > 0, got {light['radius']:g}")
    if kind in (BALL, PANEL):
        reach = np.abs(light["position"]) + light["radius"] + np.abs(light["edges"]).sum(axis=0)
        if not ANY.admits_all(reach):
            raise ValueError(f"lights.position[{i}]: all of the light must not exceed 3.4e38 in magnitude")
    if kind == PANEL and spans_no_area(*light["edges"]):
        raise ValueError(f"lights.edges[{i}]: must not be along one line")


def spans_no_area(across: NDArray[np.float64], along: NDArray[np.float64]) -> bool:
    """Whether two vectors (3,) have no normal, as far as doubles can tell."""
    sizes = np.abs(across).max(), np.abs(along).max()
    return not all(sizes) or not np.cross(across / sizes[0], along / sizes[1]).any()


# The members of soft lights: fixed sets of directions and points, of low discrepancy.
#
# Nothing is random here: a picture is the same everywhere, a movie does not flicker, and each member is a light whose
# shadows are exact. Directions are a Fibonacci lattice, as in R. Swinbank and R. J. Purser, Fibonacci grids (2006):
# each one goes on by the golden angle about the axis, and by the same share of the area along it.

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
    return _on_sphere(height) @ axes_about(axis)


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
    return np.asarray(np.sin(high)[:, None] * _on_sphere(1 - 2 * middles(n)))


def _on_sphere(height: Array) -> Array:
    """(n, 3): points of the unit sphere at (n,) heights along the third axis, each at the next angle of the lattice."""
    radius, angle = np.sqrt((1 - height) * (1 + height)), 2 * np.pi * np.mod(np.arange(len(height)) / GOLDEN, 1.0)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


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
MEMBERS = {SKY: _of_cap, SUN: _of_cap, BALL: _of_ball, PANEL: _of_panel}


# Lights by name: settings that look right at once, placed about a scene as its camera sees it. They are made for the
# coefficients that Scene.from_spheres and Material have unless told otherwise, ka = kd = 0.8.

LightList = list[NDArray[np.void]]
# Directions as the camera sees them: rightwards, upwards, and towards it.
KEY, EDGE = (-2.0, 2.5, 3.0), (1.0, 0.6, -1.2)


class SceneFrame:
    """Where a scene is.

    axes: (3, 3), its camera's right, up and back in the world; middle, radius: of a ball that holds its surfaces.
    """

    def __init__(self, scene: Scene) -> None:
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


def _studio(at: SceneFrame) -> LightList:
    """A bright sky above, a large lamp over the left shoulder, and an edge of light from behind."""
    towards = at.world(KEY)
    across = np.cross(at.axes[1], towards)
    along = np.cross(towards, across)
    across, along = (2 * at.radius * v / np.sqrt(v @ v) for v in (across, along))
    # The lamp shines to the side of across x along, which is towards itself from the scene: so `across` is turned.
    lamp = panel_light(at.middle + at.radius * towards, (0.7, 0.7, 0.7), -across, along)
    rim = sun_light(-at.world(EDGE), (0.35, 0.35, 0.35), angle=10, directions=8)
    return [sky_light((2.8, 2.8, 2.8), at.axes[1], (1.4, 1.4, 1.4)), lamp, rim]


def _flat(at: SceneFrame) -> LightList:
    """Each surface shows exactly its colour, without shade or shadow."""
    return [ambient_light((1.25, 1.25, 1.25))]


def _sky(at: SceneFrame) -> LightList:
    """A bright sky all around, a little brighter above: what is hidden from it is dark."""
    return [sky_light((4.0, 4.0, 4.0), at.axes[1], (3.0, 3.0, 3.0))]


def _rim(at: SceneFrame) -> LightList:
    """Edges of light from behind, for a dark background."""
    right, up, back = EDGE
    sides = [at.world((side * right, up, back)) for side in (-1, 1)]
    return [ambient_light((0.2, 0.2, 0.2)), *(sun_light(-side, (0.9, 0.9, 0.9), angle=8) for side in sides)]


SETTINGS: dict[str, Callable[[SceneFrame], LightList]] = {"studio": _studio, "flat": _flat, "sky": _sky, "rim": _rim}


def setting(name: str, scene: Scene) -> LightList:
    """The lights of a setting for a scene. Raises ValueError if no setting has this name."""
    if name not in SETTINGS:
        raise ValueError(f"lights: must be one of {', '.join(SETTINGS)}, or a list of lights, got {name!r}")
    return SETTINGS[name](SceneFrame(scene))
