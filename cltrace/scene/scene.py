"""The scene: a camera, lights, and packed arrays of surfaces and materials. No files, no devices.

Lengths are in scene units, angles in degrees, colours linear (1 = full). The world is right-handed with y up.
Every array is double precision, one record per object, and read-only.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.camera import Camera
from cltrace.scene.lights import check_lights, joined
from cltrace.scene.materials import COEFFICIENTS, MATERIAL, check_materials, packed
from cltrace.scene.rules import (
    ANY,
    NOT_NEGATIVE,
    POSITIVE,
    Rule,
    Vector,
    check_not_bytes,
    check_rule,
    described,
    numbers,
    vector,
)
from cltrace.scene.surfaces import MAX_SPHERES, SPHERE, check_spheres

Lights = Iterable[NDArray[np.void]] | NDArray[np.void]


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Scene:
    """Everything that a picture depends on. Immutable and picklable. `Scene.from_spheres` makes one of plain arrays.

    camera: a Camera; lights: one (n,) LIGHT array or several, such as point_light() returns; spheres, materials: (n,)
    arrays of the dtypes SPHERE and MATERIAL of cltrace.scene; background: the linear colour of rays that hit nothing,
    3 numbers >= 0; output_file: the picture's name, without a folder. The arrays are copied.

    Raises ValueError, which names the field and the index, where a value is not allowed, and TypeError where an
    argument is something else altogether.
    """

    camera: Camera
    lights: NDArray[np.void]
    spheres: NDArray[np.void]
    materials: NDArray[np.void]
    background: Vector
    output_file: str

    def __init__(
        self,
        camera: Camera,
        lights: Lights,
        spheres: NDArray[np.void],
        materials: NDArray[np.void],
        background: ArrayLike = (0.0, 0.0, 0.0),
        output_file: str = "scene.png",
    ) -> None:
        _check_camera(camera, "camera, lights, spheres, materials")
        balls, shades = _records("spheres", spheres, SPHERE), _records("materials", materials, MATERIAL)
        check_spheres(balls, len(shades))
        check_materials(shades)
        self._fill(camera, joined(lights), balls, shades, background, output_file)

    def _fill(
        self,
        camera: Camera,
        lights: NDArray[np.void],
        spheres: NDArray[np.void],
        materials: NDArray[np.void],
        background: ArrayLike,
        output_file: str,
    ) -> None:
        """Takes these arrays as they are, of which spheres and materials have been checked."""
        if not isinstance(output_file, str):
            raise TypeError(f"output_file: must be a text, got {described(output_file)}")
        check_lights(lights)
        color = vector("background", background, NOT_NEGATIVE)
        check_not_bytes("background", background)
        values = (camera, lights, spheres, materials, color, output_file)
        self.__setstate__(dict(zip((f.name for f in fields(self)), values, strict=True)))

    def seen_by(self, camera: Camera) -> Scene:
        """The same scene with another camera. It shares the arrays, so this takes no time however many spheres it has.

        dataclasses.replace() gives the same, but copies and checks everything anew.
        """
        _check_camera(camera)
        other = object.__new__(type(self))
        other.__setstate__({**self.__dict__, "camera": camera})
        return other

    def __repr__(self) -> str:
        width, height = self.camera.resolution
        return f"<cltrace.Scene {width}x{height}: {len(self.spheres)} spheres, {len(self.lights)} lights>"

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)

    @classmethod
    def from_spheres(
        cls,
        camera: Camera,
        lights: Lights,
        centers: ArrayLike,
        radii: ArrayLike,
        colors: ArrayLike = (1.0, 1.0, 1.0),
        *,
        ka: ArrayLike | None = None,
        kd: ArrayLike = 0.8,
        ks: ArrayLike = 0.5,
        exponent: ArrayLike = 50.0,
        background: ArrayLike = (0.0, 0.0, 0.0),
        output_file: str = "scene.png",
    ) -> Scene:
        """A scene of plain arrays.

        camera: a Camera; lights: a list of what ambient_light(), parallel_light(), point_light() and spot_light()
        return; centers: (n, 3), or [] for no spheres, and radii: (n,) or one number, scene units; colors: (n, 3) or one
        colour, linear, 1 = full; background, output_file: see Scene.

        ka, kd, ks: how strongly a surface shows ambient light, diffuse light and highlights; exponent: the larger, the
        smaller the highlight; each (n,) or one number >= 0. Without ka it is kd: ambient light stands for light that
        arrives from all around, and a matte surface returns as much of it as of light from one side. What no light
        reaches then shows kd times the ambient light, and with kd = 0.8 a surface that faces one white light beside
        the default ambient light shows exactly its colour.

        Raises ValueError, which names the argument and the index, and TypeError as Scene does.
        """
        _check_camera(camera, "camera, lights, centers, radii, colors")
        lights = joined(lights)
        points = _points(centers, radii)
        n = len(points)
        if n > MAX_SPHERES:
            raise ValueError(f"centers: must be at most {MAX_SPHERES}, got {n}")
        check_rule("centers", ANY, points)
        spheres = np.empty(n, SPHERE)
        spheres["center"], spheres["radius"] = points, _values("radii", POSITIVE, radii, (n,))
        shade = {"color": _values("colors", NOT_NEGATIVE, colors, (n, 3))}
        check_not_bytes("colors", shade["color"], reflected=True)
        for name, value in (("kd", kd), ("ks", ks), ("exponent", exponent)):
            shade[name] = _values(name, NOT_NEGATIVE, value, (n,))
        shade["ka"] = shade["kd"] if ka is None else _values("ka", NOT_NEGATIVE, ka, (n,))
        one = shade["color"].ndim == 1 and not any(shade[name].ndim for name in COEFFICIENTS)
        spheres["material"] = 0 if one else np.arange(n)
        scene = cls.__new__(cls)
        scene._fill(camera, lights, spheres, packed(1 if one else n, shade), background, output_file)
        return scene


def _check_camera(camera: object, order: str = "") -> None:
    """Raises TypeError, which says the order of the arguments, if this is no camera."""
    if not isinstance(camera, Camera):
        advice = f"; the order is {order}" if order else ""
        raise TypeError(f"camera: must be a cltrace.Camera, got {described(camera)}{advice}")


def _points(centers: ArrayLike, radii: ArrayLike) -> NDArray[np.float64]:
    """The centres as an (n, 3) array; ValueError if they are none, with advice where they and the radii are swapped."""
    points = numbers("centers", centers)
    if points.shape == (0,):  # an empty list
        return points.reshape(0, 3)
    if points.ndim == 2 and points.shape[1] == 3:
        return points
    swapped = points.ndim < 2 and np.shape(numbers("radii", radii))[1:] == (3,)
    raise ValueError(
        f"centers: must have shape (n, 3), got {points.shape}"
        + (f"; radii has shape {np.shape(radii)}: are the two swapped?" if swapped else "")
    )


def _values(name: str, rule: Rule, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """One value or as many as the spheres, as the array that was given; ValueError names the argument and the index."""
    array = numbers(name, value)
    if array.shape == shape[:1] == (0,):  # an empty list
        return array.reshape(shape)
    try:
        np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(f"{name}: must have shape {shape} or be one value, got {array.shape}") from None
    check_rule(name, rule, array)
    return array


def _records(name: str, value: NDArray[np.void], dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """A copy of an (n,) array of these records; TypeError if it is none: numpy would turn a number into all fields."""
    if not isinstance(value, np.ndarray) or value.dtype.names != dtype.names or value.ndim != 1:
        raise TypeError(
            f"{name}: must be an (n,) array of dtype cltrace.scene.{name[:-1].upper()}, got {described(value)}; "
            "Scene.from_spheres() takes plain arrays"
        )
    return np.array(value, dtype)
