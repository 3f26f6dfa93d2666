"""Cameras: where the eye is, where it looks, and the picture that it sees."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Floats, cross, minus
from cltrace.base.limits import MAX_BOUNCES, MAX_PIXELS, MAX_SIDE
from cltrace.scene.rules import FOV, FULL_FOV, NOT_NEGATIVE, POSITIVE, Vector, checked, described, is_whole, vector

if TYPE_CHECKING:
    from cltrace.scene.scene import Scene

Axis = Literal["x", "y"]
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


@dataclass(frozen=True, init=False)
class Pose:
    """What every camera has: where it is in the world, and how it is turned. The fields are those of Camera."""

    position: Vector
    lookat: Vector
    up: Vector
    resolution: tuple[int, int]
    max_bounces: int
    parallel: ClassVar[bool] = False  # whether all rays are

    def basis(self) -> tuple[Vector, Vector, Vector]:
        """The camera's x (right), y (up) and z (backward) axes in the world: unit and orthogonal to rounding.

        They are multiples of 2^-300, so that exact arithmetic with them has an end: what is below 2^-247 is rounded.
        Raises ValueError if they are undefined: position equals lookat, or up is 0 or parallel to the view.
        """
        eye, at = self.position, self.lookat
        try:
            z = _unit(minus(eye, at))
        except ZeroDivisionError:
            raise ValueError("camera.lookat: must differ from position") from None
        try:
            up = _unit(self.up)
        except ZeroDivisionError:
            raise ValueError("camera.up: must not be 0") from None
        # The sine of the angle between up and the view is |up x z|. Both are rounded: below a few ulp it is noise.
        x = cross(up, z)
        if math.hypot(*x) <= 2.0**-50:
            raise ValueError("camera.up: must not be parallel to the view")
        x = _unit(x)
        # up x z is orthogonal to z to within a rounding error divided by that sine. Removing what is left along z once
        # more makes x and y orthogonal to z to rounding, however nearly parallel up and the view are (Kahan: "twice is
        # enough").
        along = _dot(x, z)
        x = _unit((x[0] - along * z[0], x[1] - along * z[1], x[2] - along * z[2]))
        return _on_grid(x), _on_grid(_unit(cross(z, x))), _on_grid(z)

    def _set(self, resolution: Any, max_bounces: int, more: Mapping[str, object], **vectors: ArrayLike) -> None:
        """Checks and sets all fields but `more`, which are right."""
        if not is_whole(max_bounces) or not 0 <= max_bounces <= MAX_BOUNCES:
            raise ValueError(f"camera.max_bounces: must be within 0..{MAX_BOUNCES}, got {described(max_bounces)}")
        values = {name: vector(f"camera.{name}", value) for name, value in vectors.items()}
        numbers = {"resolution": check_resolution(resolution), "max_bounces": int(max_bounces)}
        for name, value in {**values, **numbers, **more}.items():
            object.__setattr__(self, name, value)
        self.basis()


@dataclass(frozen=True, init=False)
class Camera(Pose):
    """A pinhole camera in the world. Immutable; vectors are kept as tuples of floats.

    position: the eye, scene units; lookat: a point that is seen in the middle of the picture, scene units; up: a
    direction of any length that is not parallel to the view; horizontal_fov: HALF of the horizontal opening angle,
    degrees, within (0, 90); resolution: (width, height) in pixels; max_bounces: how often a ray may be reflected or
    refracted, 0..100; square_pixels: whether a pixel is as wide as it is high. The tutorial scales the angle of the
    shorter side instead of its tangent; scene files therefore have False, which stretches what is not a square picture.

    fov, instead of horizontal_fov: ALL of the opening angle, degrees, within (0, 180), as other programs have it;
    fov_axis: the side of the picture that it is about, "x" or "y". Both angles are about the longer side of the picture
    unless fov_axis says otherwise, also where it is higher than wide.

    Vectors are any three numbers: a tuple, a list, an array of numpy. Raises ValueError, which names the argument.
    """

    horizontal_fov: float
    square_pixels: bool

    def __init__(
        self,
        position: ArrayLike = (0.0, 0.0, 0.0),
        lookat: ArrayLike = (0.0, 0.0, -1.0),
        up: ArrayLike = (0.0, 1.0, 0.0),
        horizontal_fov: float | None = None,
        resolution: Sequence[int] | NDArray[np.integer[Any]] = (512, 512),
        max_bounces: int = 8,
        square_pixels: bool = True,
        *,
        fov: float | None = None,
        fov_axis: Axis | None = None,
    ) -> None:
        if not isinstance(square_pixels, (bool, np.bool_)):
            raise ValueError(f"camera.square_pixels: must be True or False, got {described(square_pixels)}")
        size = check_resolution(resolution)
        half = _half_angle(horizontal_fov, full=fov, axis=fov_axis, size=size, square_pixels=square_pixels)
        more = {"horizontal_fov": half, "square_pixels": bool(square_pixels)}
        self._set(size, max_bounces, more, position=position, lookat=lookat, up=up)

    @classmethod
    def fit(
        cls,
        scene: Scene,
        view: str | ArrayLike = "isometric",
        margin: float = 0.05,
        *,
        up: ArrayLike | None = None,
        fov: float = 40.0,
        fov_axis: Axis | None = None,
        resolution: Sequence[int] | NDArray[np.integer[Any]] | None = None,
        max_bounces: int = 8,
        square_pixels: bool = True,
    ) -> Camera:
        """The camera that sees all surfaces of a scene, from as near as it can.

        view: where it is, as seen from the scene, "front" (on the z axis), "back", "right" (on the x axis), "left",
        "top" (on the y axis), "bottom" or "isometric" (on the diagonal of the three), or the direction that leads there
        from the scene, three numbers; margin: the share of the picture's width and height that stays free on each side,
        at least: what reaches furthest touches it; up: y unless told otherwise, and where the camera looks along that,
        what is behind; resolution: that of the scene's camera unless told otherwise; the others as for a Camera.

        The scene's own camera does not matter: scene.seen_by(Camera.fit(scene)) is the scene as this one sees it.
        Raises ValueError, which names the argument, also where the scene has no surfaces.
        """
        share = checked_margin(margin)
        facing = _facing(scene, view, up, resolution) | {"max_bounces": max_bounces}
        camera = cls(**facing, square_pixels=square_pixels, fov=fov, fov_axis=fov_axis)
        x, y, z = (np.array(axis) for axis in camera.basis())
        wide, high = (tangent * share for tangent in camera.image_plane())
        # From an eye E, a point p is within the right edge of the picture if (p - E).x <= -wide (p - E).z. So E.(x +
        # wide z) is at least what the surfaces reach in the direction of x + wide z, and so on for all four edges.
        reaches = reaches_of(scene, (x + wide * z, -x + wide * z, y + high * z, -y + high * z, z, -z))
        right, left, above, below, near, far = reaches.tolist()
        distance = max((right + left) / (2 * wide), (above + below) / (2 * high))
        if not distance > near:
            raise ValueError("scene: must not be a single point as the camera sees it")
        eye = (right - left) / 2 * x + (above - below) / 2 * y + distance * z
        middle = eye - (distance - (near - far) / 2) * z
        return replace(camera, position=eye, lookat=middle)

    def half_angles(self) -> tuple[float, float]:
        """Half of the horizontal and half of the vertical opening angle, degrees. The longer side has horizontal_fov.

        The shorter side has the share of its pixels: of the tangent with square_pixels, else of the angle.
        """
        width, height = self.resolution
        fov = self.horizontal_fov
        short, long = min(width, height), max(width, height)
        other = fov * short / long
        if self.square_pixels:
            other = math.degrees(math.atan(math.tan(math.radians(fov)) * short / long))
        return (fov, other) if width >= height else (other, fov)

    def image_plane(self) -> tuple[float, float]:
        """Half of the width and half of the height of the image plane at distance 1: tangents of the half angles."""
        width, height = self.resolution
        tan = math.tan(math.radians(self.horizontal_fov))
        if self.square_pixels:
            other = tan * min(width, height) / max(width, height)
            return (tan, other) if width >= height else (other, tan)
        x, y = self.half_angles()
        return math.tan(math.radians(x)), math.tan(math.radians(y))


@dataclass(frozen=True, init=False)
class Orthographic(Pose):
    """A camera whose rays are parallel: things have the same size in the picture however far they are. Immutable.

    Rays start on the plane through `position` that is across the view, and lead along the view. So only what lies
    before that plane is seen, which is where t > 0; depth is the distance from the plane, and a surface that the plane
    cuts is seen from inside.

    position: what is seen in the middle of the picture where the plane is, scene units; lookat: a point that is seen
    there, too, scene units; up: a direction of any length that is not parallel to the view; height: how much of the
    world the picture is high, scene units, > 0; resolution: (width, height) in pixels; max_bounces: how often a ray may
    be reflected or refracted, 0..100. Pixels are as wide as they are high.

    Vectors are any three numbers: a tuple, a list, an array of numpy. Raises ValueError, which names the argument.
    """

    height: float
    parallel: ClassVar[bool] = True

    def __init__(
        self,
        position: ArrayLike = (0.0, 0.0, 0.0),
        lookat: ArrayLike = (0.0, 0.0, -1.0),
        up: ArrayLike = (0.0, 1.0, 0.0),
        height: float = 2.0,
        resolution: Sequence[int] | NDArray[np.integer[Any]] = (512, 512),
        max_bounces: int = 8,
    ) -> None:
        more = {"height": float(checked("camera.height", POSITIVE, height, ()))}
        self._set(resolution, max_bounces, more, position=position, lookat=lookat, up=up)

    @classmethod
    def fit(
        cls,
        scene: Scene,
        view: str | ArrayLike = "isometric",
        margin: float = 0.05,
        *,
        up: ArrayLike | None = None,
        resolution: Sequence[int] | NDArray[np.integer[Any]] | None = None,
        max_bounces: int = 8,
    ) -> Orthographic:
        """The camera that sees all surfaces of a scene as large as it can, from before all of them.

        Its plane is as far before the nearest surface as the picture is high. The arguments, and what is raised, are
        those of Camera.fit().
        """
        share = checked_margin(margin)
        camera = cls(**_facing(scene, view, up, resolution), height=1.0, max_bounces=max_bounces)
        x, y, z = (np.array(axis) for axis in camera.basis())
        right, left, above, below, near, far = reaches_of(scene, (x, -x, y, -y, z, -z)).tolist()
        wide, high = camera.resolution
        height = max(above + below, (right + left) * high / wide) / share
        if not height > 0:
            raise ValueError("scene: must not be a single point as the camera sees it")
        middle = (right - left) / 2 * x + (above - below) / 2 * y
        eye, at = middle + (near + height) * z, middle + (near - far) / 2 * z
        return replace(camera, position=eye, lookat=at, height=height)

    def image_plane(self) -> tuple[float, float]:
        """Half of the width and half of the height of what the picture shows, scene units."""
        width, height = self.resolution
        half = self.height / 2
        return half * width / height, half


AnyCamera = Camera | Orthographic


def _facing(scene: Scene, view: str | ArrayLike, up: ArrayLike | None, resolution: Any) -> dict[str, Any]:
    """Arguments of a camera at the origin that looks as one that is fitted to a scene will: see Camera.fit()."""
    if isinstance(view, str):
        if view not in VIEWS:
            raise ValueError(f"view: must be one of {', '.join(VIEWS)}, or three numbers, got {described(view)}")
        view = VIEWS[view]
    x, y, z = vector("view", view)
    if not (x or y or z):
        raise ValueError("view: must not be 0")
    if up is None:
        up = (0.0, 1.0, 0.0) if x or z else (0.0, 0.0, -1.0 if y > 0 else 1.0)
    size = scene.camera.resolution if resolution is None else resolution
    return {"lookat": (-x, -y, -z), "up": vector("up", up), "resolution": size}


def _half_angle(
    half: float | None, full: float | None, axis: Axis | None, size: tuple[int, int], square_pixels: bool
) -> float:
    """The horizontal_fov of a Camera, from what it was given: half of the opening angle, all of it, or neither."""
    if full is None:
        if axis is not None:
            raise ValueError("camera.fov_axis: must not be given without fov")
        return float(checked("camera.horizontal_fov", FOV, 45.0 if half is None else half, ()))
    if half is not None:
        raise ValueError("camera.fov: must not be given together with horizontal_fov, which is half of it")
    if axis not in (None, "x", "y"):
        raise ValueError(f'camera.fov_axis: must be "x" or "y", got {described(axis)}')
    angle = float(checked("camera.fov", FULL_FOV, full, ())) / 2
    width, height = size
    given = max(size) if axis is None else width if axis == "x" else height
    if given < max(size):
        share = max(size) / given
        angle = math.degrees(math.atan(math.tan(math.radians(angle)) * share)) if square_pixels else angle * share
        if not angle < 90:
            raise ValueError(f"camera.fov: must leave the longer side below 180, got {2 * angle:g} there")
    return angle


def check_resolution(resolution: Sequence[int] | NDArray[np.integer[Any]]) -> tuple[int, int]:
    """(width, height) if a picture may have that size; ValueError if not."""
    sides = resolution.tolist() if isinstance(resolution, np.ndarray) else resolution
    if not isinstance(sides, Sequence) or len(sides) != 2 or not all(map(is_whole, sides)):
        raise ValueError(f"camera.resolution: must be two integers (width, height), got {described(resolution)}")
    width, height = int(sides[0]), int(sides[1])
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and width * height <= MAX_PIXELS):
        size = f"{described(width)}x{described(height)}"
        raise ValueError(f"camera.resolution: must be within 1..{MAX_SIDE} each and {MAX_PIXELS} pixels, got {size}")
    return width, height


def _dot(a: Vector, b: Vector) -> float:
    return math.fsum((a[0] * b[0], a[1] * b[1], a[2] * b[2]))


def _unit(v: Vector) -> Vector:
    """v / |v|; ZeroDivisionError if v = 0. hypot neither overflows nor underflows."""
    scale = max(map(abs, v))
    w = (v[0] / scale, v[1] / scale, v[2] / scale)
    length = math.hypot(*w)
    return (w[0] / length, w[1] / length, w[2] / length)


def _on_grid(v: Vector) -> Vector:
    """v rounded to multiples of 2^-300; the doubles from 2^-247 on are some."""
    x, y, z = (a if a == 0 or abs(a) >= 2.0**-247 else math.ldexp(round(math.ldexp(a, 300)), -300) for a in v)
    return (x, y, z)


def checked_margin(margin: float) -> float:
    """The share of a picture that is not left free, if a share `margin` of it is on each of its four sides."""
    free = float(checked("margin", NOT_NEGATIVE, margin, ()))
    if not free < 0.5:
        raise ValueError(f"margin: must be below 0.5, got {free:g}")
    return 1 - 2 * free


def reaches_of(scene: Scene, directions: ArrayLike) -> Floats:
    """How far the surfaces of a scene reach: (k,), for each direction d the largest p.d of all points p on them.

    directions: (k, 3), of any length, in the world. Raises ValueError if the scene has no surfaces.
    """
    found = reaches_if_any(scene, directions)
    if found is None:
        raise ValueError("scene: must have surfaces, or there is nothing to fit a camera to")
    return found


def reaches_if_any(scene: Scene, directions: ArrayLike) -> Floats | None:
    """The same, but None if the scene has no surfaces."""
    rows = np.asarray(directions, np.float64)
    parts = [part for shape in scene.shapes for part in shape.reach(rows)]
    return np.max(parts, axis=0) if parts else None
