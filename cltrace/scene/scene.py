"""The scene: a camera and packed arrays of spheres, materials and lights. No files, no devices.

Lengths are in scene units, angles in degrees, colours linear (1 = full). The world is right-handed with y up.
Every array is double precision, one record per object, and read-only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = tuple[float, float, float]

SPHERE = np.dtype([("center", "f8", (3,)), ("radius", "f8"), ("material", "i4")])
MATERIAL = np.dtype(
    [
        ("color", "f8", (3,)),
        ("ka", "f8"),
        ("kd", "f8"),
        ("ks", "f8"),
        ("exponent", "f8"),
    ]
)
LIGHT = np.dtype(
    [
        ("kind", "i4"),  # one of the four constants below
        ("color", "f8", (3,)),
        ("position", "f8", (3,)),  # point, spot
        ("direction", "f8", (3,)),  # parallel, spot: in which the light travels; any length
        ("alpha1", "f8"),  # spot: degrees from the axis, full light within
        ("alpha2", "f8"),  # spot: degrees from the axis, no light beyond
    ]
)
AMBIENT, PARALLEL, POINT, SPOT = range(4)

# A number is 0 or within float32's range: its square and the square of that then stay within double's range, so that
# nothing that is computed from it overflows or vanishes.
SMALLEST, LARGEST = 2.0**-149, (2.0 - 2.0**-23) * 2.0**127
MAX_SIDE, MAX_PIXELS = 65_536, 2**28
MAX_SPHERES = 2**26
MAX_BOUNCES = 100


@dataclass(frozen=True)
class Rule:
    """The values that a number may have: finite, 0 or within float32's range, and within these bounds."""

    text: str
    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False
    open_high: bool = False

    def admits(self, value: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether each value (any shape) is allowed, as an array of that shape."""
        low = value > self.low if self.open_low else value >= self.low
        high = value < self.high if self.open_high else value <= self.high
        ok: NDArray[np.bool_] = low & high & representable(value)
        return ok

    def fault(self, value: float) -> str | None:
        """What is wrong with one value, to be put behind its name; None if nothing is."""
        if not math.isfinite(value):
            return f"must be a finite number, got {value:g}"
        if abs(value) > LARGEST:
            return f"must not exceed 3.4e38 in magnitude, got {value:g}"
        if value != 0 and abs(value) < SMALLEST:
            return f"must be 0 or at least 1.4e-45 in magnitude, got {value:g}"
        if not self.admits(np.float64(value)):  # type: ignore[arg-type]
            return f"must be {self.text}, got {value:g}"
        return None


def representable(value: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each value is finite and 0 or within float32's range."""
    size = np.abs(value)
    ok: NDArray[np.bool_] = (size == 0) | ((size >= SMALLEST) & (size <= LARGEST))
    return ok


ANY = Rule("a finite number")
POSITIVE = Rule("> 0", low=0, open_low=True)
NOT_NEGATIVE = Rule(">= 0", low=0)
FOV = Rule("within (0, 90)", low=0, high=90, open_low=True, open_high=True)
CONE = Rule("within [0, 180]", low=0, high=180)


def _require(name: str, rule: Rule, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """`value` as a new array of doubles of this shape (a -1 stands for any length); ValueError names the culprit."""
    if not _is_numbers(value):
        raise ValueError(f"{name}: must be numbers, got {value!r}")
    array = np.array(value, np.float64)
    if len(array.shape) != len(shape) or any(n not in (-1, got) for n, got in zip(shape, array.shape, strict=True)):
        wanted = str(tuple("n" if n < 0 else n for n in shape)).replace("'", "")
        raise ValueError(f"{name}: must have shape {wanted}, got {array.shape}")
    bad = ~rule.admits(array)
    if bad.any():
        where = np.argwhere(bad)[0]
        index = "".join(f"[{i}]" for i in where)
        raise ValueError(f"{name}{index}: {rule.fault(float(array[tuple(where)]))}")
    return array


def _is_numbers(value: ArrayLike) -> bool:
    """Whether these are numbers and nothing else: not texts, and not bools, which numpy would turn into numbers."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "iuf"
    return all(
        isinstance(x, (int, float, np.number)) and not isinstance(x, bool) for x in np.asarray(value, object).ravel()
    )


def _vector(name: str, value: Sequence[float], rule: Rule = ANY) -> Vector:
    x, y, z = _require(name, rule, value, (3,)).tolist()
    return (x, y, z)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    position, lookat: points, scene units; up: any vector not parallel to the view; horizontal_fov: HALF of the
    horizontal opening angle, degrees, within (0, 90); resolution: (width, height) in pixels; max_bounces: depth limit
    of secondary rays; square_pixels: the vertical half-angle is atan(tan(horizontal_fov) H/W) instead of the tutorial's
    horizontal_fov H/W. Raises ValueError naming the field.
    """

    position: Vector = (0.0, 0.0, 0.0)
    lookat: Vector = (0.0, 0.0, -1.0)
    up: Vector = (0.0, 1.0, 0.0)
    horizontal_fov: float = 45.0
    resolution: tuple[int, int] = (512, 512)
    max_bounces: int = 0
    square_pixels: bool = False

    def __post_init__(self) -> None:
        for name in ("position", "lookat", "up"):
            object.__setattr__(self, name, _vector(f"camera.{name}", getattr(self, name)))
        fov = _require("camera.horizontal_fov", FOV, self.horizontal_fov, ())
        object.__setattr__(self, "horizontal_fov", float(fov))
        object.__setattr__(self, "resolution", check_resolution(self.resolution))
        if not isinstance(self.square_pixels, bool):
            raise ValueError(f"camera.square_pixels: must be True or False, got {self.square_pixels!r}")
        whole = isinstance(self.max_bounces, (int, np.integer)) and not isinstance(self.max_bounces, bool)
        if not whole or not 0 <= self.max_bounces <= MAX_BOUNCES:
            raise ValueError(f"camera.max_bounces: must be within 0..{MAX_BOUNCES}, got {self.max_bounces}")
        self.basis()

    def basis(self) -> tuple[Vector, Vector, Vector]:
        """The camera's x (right), y (up) and z (backward) axes in the world: unit and orthogonal to rounding.

        Raises ValueError if they are undefined (eye = lookat, up zero or parallel to the view).
        """
        eye, at = self.position, self.lookat
        try:
            z = _unit((eye[0] - at[0], eye[1] - at[1], eye[2] - at[2]))
        except ZeroDivisionError:
            raise ValueError("camera.lookat: must differ from position") from None
        try:
            up = _unit(self.up)
        except ZeroDivisionError:
            raise ValueError("camera.up: must not be 0") from None
        # The sine of the angle between up and the view is |up x z|. Both are rounded: below a few ulp it is noise.
        x = _cross(up, z)
        if math.hypot(*x) <= 2.0**-50:
            raise ValueError("camera.up: must not be parallel to the view")
        x = _unit(x)
        # up x z is orthogonal to z to within a rounding error divided by that sine: once more (Kahan: "twice is
        # enough"), and x and y are orthogonal to z to rounding, however nearly parallel up and the view are.
        along = _dot(x, z)
        x = _unit((x[0] - along * z[0], x[1] - along * z[1], x[2] - along * z[2]))
        return x, _unit(_cross(z, x)), z

    def half_angles(self) -> tuple[float, float]:
        """Half of the horizontal and of the vertical opening angle, degrees: the longer side has horizontal_fov.

        The tutorial scales the angle, not its tangent; `square_pixels` scales the tangent.
        """
        width, height = self.resolution
        fov = self.horizontal_fov
        short, long = min(width, height), max(width, height)
        other = fov * short / long
        if self.square_pixels:
            other = math.degrees(math.atan(math.tan(math.radians(fov)) * short / long))
        return (fov, other) if width >= height else (other, fov)

    def image_plane(self) -> tuple[float, float]:
        """Half of the width and of the height of the image plane at z = -1 (tangents of the half angles)."""
        width, height = self.resolution
        tan = math.tan(math.radians(self.horizontal_fov))
        if self.square_pixels:
            other = tan * min(width, height) / max(width, height)
            return (tan, other) if width >= height else (other, tan)
        x, y = self.half_angles()
        return math.tan(math.radians(x)), math.tan(math.radians(y))


def check_resolution(resolution: Sequence[int]) -> tuple[int, int]:
    """(width, height) if a picture may have that size; ValueError if not."""
    if not isinstance(resolution, Sequence):
        raise ValueError(f"camera.resolution: must be two integers (width, height), got {resolution!r}")
    whole = [isinstance(n, (int, np.integer)) and not isinstance(n, bool) for n in resolution]
    if whole != [True, True]:
        raise ValueError(f"camera.resolution: must be two integers (width, height), got {resolution!r}")
    width, height = int(resolution[0]), int(resolution[1])
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and width * height <= MAX_PIXELS):
        raise ValueError(
            f"camera.resolution: must be within 1..{MAX_SIDE} each and {MAX_PIXELS} pixels, got {width}x{height}"
        )
    return width, height


def _dot(a: Vector, b: Vector) -> float:
    return math.fsum((a[0] * b[0], a[1] * b[1], a[2] * b[2]))


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(v: Vector) -> Vector:
    """v / |v|; ZeroDivisionError if v = 0. hypot neither overflows nor underflows."""
    scale = max(map(abs, v))
    w = (v[0] / scale, v[1] / scale, v[2] / scale)
    length = math.hypot(*w)
    return (w[0] / length, w[1] / length, w[2] / length)


def ambient_light(color: Sequence[float] = (1, 1, 1)) -> NDArray[np.void]:
    """A (1,) LIGHT array: light that comes from everywhere and is never shadowed; several add up."""
    return _light(AMBIENT, color)


def parallel_light(direction: Sequence[float], color: Sequence[float] = (1, 1, 1)) -> NDArray[np.void]:
    """A (1,) LIGHT array: a light at infinity that travels along `direction` (any length but 0)."""
    return _light(PARALLEL, color, direction=direction)


def point_light(position: Sequence[float], color: Sequence[float] = (1, 1, 1)) -> NDArray[np.void]:
    """A (1,) LIGHT array: a point that shines equally in all directions, without attenuation."""
    return _light(POINT, color, position=position)


def spot_light(
    position: Sequence[float],
    direction: Sequence[float],
    alpha1: float,
    alpha2: float,
    color: Sequence[float] = (1, 1, 1),
) -> NDArray[np.void]:
    """A (1,) LIGHT array: full light up to alpha1 degrees off `direction`, falling linearly to none at alpha2."""
    return _light(SPOT, color, position=position, direction=direction, alpha1=alpha1, alpha2=alpha2)


def _light(
    kind: int,
    color: Sequence[float],
    position: Sequence[float] = (0, 0, 0),
    direction: Sequence[float] = (0, 0, -1),
    alpha1: float = 0,
    alpha2: float = 0,
) -> NDArray[np.void]:
    given: dict[str, ArrayLike] = {
        "color": color,
        "position": position,
        "direction": direction,
        "alpha1": alpha1,
        "alpha2": alpha2,
    }
    for name, value in given.items():
        if not _is_numbers(value) or np.asarray(value).shape != LIGHT[name].shape:
            shape = "3 numbers" if LIGHT[name].shape else "numbers"
            raise ValueError(f"light.{name}: must be {shape}, got {value!r}")
    return np.array([(kind, tuple(color), tuple(position), tuple(direction), alpha1, alpha2)], LIGHT)


def _frozen(array: NDArray[np.void]) -> NDArray[np.void]:
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that a picture depends on. Immutable and picklable.

    spheres, materials, lights: (n,) arrays of the dtypes SPHERE, MATERIAL and LIGHT above; background: colour of rays
    that hit nothing, >= 0; output_file: the picture's name, without a folder. Raises ValueError naming field and index.
    """

    camera: Camera
    lights: NDArray[np.void]
    spheres: NDArray[np.void]
    materials: NDArray[np.void]
    background: Vector = (0.0, 0.0, 0.0)
    output_file: str = field(default="scene.png")

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, _frozen(value) if isinstance(value, np.ndarray) else value)

    def __post_init__(self) -> None:
        if not isinstance(self.camera, Camera):
            raise TypeError(f"camera: must be a cltrace.Camera, got {self.camera!r}")
        object.__setattr__(self, "background", _vector("background", self.background, NOT_NEGATIVE))
        for name, dtype in (("lights", LIGHT), ("spheres", SPHERE), ("materials", MATERIAL)):
            array = np.array(getattr(self, name), dtype, ndmin=1)
            object.__setattr__(self, name, _frozen(array))
        if len(self.spheres) > MAX_SPHERES:
            raise ValueError(f"spheres: must be at most {MAX_SPHERES}, got {len(self.spheres)}")
        _require("spheres.center", ANY, self.spheres["center"], (-1, 3))
        _require("spheres.radius", POSITIVE, self.spheres["radius"], (-1,))
        lost = (self.spheres["material"] < 0) | (self.spheres["material"] >= len(self.materials))
        if lost.any():
            i = int(np.argmax(lost))
            got = self.spheres["material"][i]
            raise ValueError(f"spheres.material[{i}]: must be the index of a material, got {got}")
        for name in ("ka", "kd", "ks", "exponent"):
            _require(f"materials.{name}", NOT_NEGATIVE, self.materials[name], (-1,))
        _require("materials.color", NOT_NEGATIVE, self.materials["color"], (-1, 3))
        _require("lights.color", NOT_NEGATIVE, self.lights["color"], (-1, 3))
        for name, rule in (("position", ANY), ("direction", ANY)):
            _require(f"lights.{name}", rule, self.lights[name], (-1, 3))
        for name in ("alpha1", "alpha2"):
            _require(f"lights.{name}", CONE, self.lights[name], (-1,))
        for i, light in enumerate(self.lights):
            if light["kind"] not in (AMBIENT, PARALLEL, POINT, SPOT):
                raise ValueError(f"lights.kind[{i}]: must be within 0..3, got {light['kind']}")
            if light["kind"] in (PARALLEL, SPOT) and not light["direction"].any():
                raise ValueError(f"lights.direction[{i}]: must not be 0")
            if light["kind"] == SPOT and light["alpha1"] > light["alpha2"]:
                raise ValueError(
                    f"lights.alpha1[{i}]: must be <= alpha2, got {light['alpha1']:g} > {light['alpha2']:g}"
                )

    @classmethod
    def from_spheres(
        cls,
        camera: Camera,
        lights: Iterable[NDArray[np.void]] | NDArray[np.void],
        centers: ArrayLike,
        radii: ArrayLike,
        colors: ArrayLike = (1.0, 1.0, 1.0),
        *,
        ka: ArrayLike = 0.1,
        kd: ArrayLike = 0.8,
        ks: ArrayLike = 0.5,
        exponent: ArrayLike = 50.0,
        background: Vector = (0.0, 0.0, 0.0),
        output_file: str = "scene.png",
    ) -> Scene:
        """A scene from arrays.

        centers (n, 3) and radii (n,) or one number, scene units; colors (n, 3) or one colour; ka, kd, ks, exponent (n,)
        or one number each; lights: results of ambient_light(), parallel_light(), point_light(), spot_light().
        Raises ValueError naming field and index.
        """
        points = np.asarray(centers)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"centers: must have shape (n, 3), got {points.shape}")
        n = len(points)
        coefficients = (("ka", ka), ("kd", kd), ("ks", ks), ("exponent", exponent))
        shade = {"colors": (colors, (n, 3))} | {k: (v, (n,)) for k, v in coefficients}
        for name, (value, shape) in {"centers": (centers, (n, 3)), "radii": (radii, (n,)), **shade}.items():
            if not _is_numbers(value):
                kind = np.asarray(value).dtype
                got = "a bool among them" if kind.kind in "iuf" else kind
                raise ValueError(f"{name}: must be numbers, got {got}")
            array = np.asarray(value)
            try:
                np.broadcast_to(array, shape)
            except ValueError:
                raise ValueError(f"{name}: must have shape {shape} or be one value, got {array.shape}") from None
        one = all(np.asarray(value).ndim == len(shape) - 1 for value, shape in shade.values())
        materials = np.empty(1 if one else n, MATERIAL)
        for name, (value, _) in shade.items():
            materials["color" if name == "colors" else name] = value
        spheres = np.empty(n, SPHERE)
        spheres["center"], spheres["radius"] = points, radii
        spheres["material"] = 0 if one else np.arange(n)
        if isinstance(lights, np.ndarray):
            lights = [lights]
        every = [np.zeros(0, LIGHT), *lights]
        return cls(camera, np.concatenate(every), spheres, materials, background, output_file)
