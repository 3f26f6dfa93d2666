"""What a hand does to a camera. Each function gives another camera, or raises ValueError where there is none.

A drag of the pointer is in shares of the picture's height: x to the right, y downwards. What is under it follows it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.movie.frames import turned
from cltrace.scene import AnyCamera, Camera, Orthographic, Scene

Floats = NDArray[np.float64]
# So near the poles a camera may turn, radians: at a pole it would look along `up`.
POLE = math.radians(0.5)


def orbit(camera: AnyCamera, x: float, y: float) -> AnyCamera:
    """Turned about what it looks at, half a turn for the picture's height, about `up` and towards its poles."""
    axis = np.array(camera.up) / math.hypot(*camera.up)
    aside = turned(camera, axis, -math.pi * x)
    right, _, back = _axes(aside)
    angle = math.acos(min(1.0, max(-1.0, axis @ back)))
    wanted = min(math.pi - POLE, max(POLE, angle - math.pi * y))
    return replace(turned(aside, right, wanted - angle), up=camera.up)


def pan(camera: AnyCamera, x: float, y: float) -> AnyCamera:
    """Moved across the view, so that what is at `lookat` goes as far as the pointer."""
    width, height = camera.resolution
    wide, high = (2 * half * _scale(camera) for half in camera.image_plane())
    right, up, _ = _axes(camera)
    shift = -x * height / width * wide * right + y * high * up
    return replace(camera, position=camera.position + shift, lookat=camera.lookat + shift)


def zoom(camera: AnyCamera, x: float, y: float) -> AnyCamera:
    """Twice as far from what it looks at for each y; a parallel one sees twice as much instead."""
    factor = math.exp2(y)
    if isinstance(camera, Orthographic):
        return replace(camera, height=camera.height * factor)
    back: Any = np.subtract(camera.position, camera.lookat)
    return replace(camera, position=camera.lookat + back * factor)


def centre(camera: AnyCamera, point: ArrayLike) -> AnyCamera:
    """Moved across the view until it looks at a point."""
    _, _, back = _axes(camera)
    at: Any = np.asarray(point, np.float64)
    return replace(camera, position=at + back * ((camera.position - at) @ back), lookat=at)


def fit(scene: Scene) -> AnyCamera:
    """The scene's camera, where it sees all surfaces from the same side, from as near as it can."""
    camera = scene.camera
    back = np.subtract(camera.position, camera.lookat)
    if isinstance(camera, Orthographic):
        return Orthographic.fit(scene, back, up=camera.up, max_bounces=camera.max_bounces)
    return Camera.fit(
        scene,
        back,
        up=camera.up,
        fov=2 * camera.horizontal_fov,
        max_bounces=camera.max_bounces,
        square_pixels=camera.square_pixels,
    )


def other_kind(camera: AnyCamera, like: Camera) -> AnyCamera:
    """An orthographic camera for one with perspective and the reverse, to which what is at `lookat` is as large.

    like: whose opening angle a camera with perspective gets.
    """
    _, _, back = _axes(camera)
    if isinstance(camera, Camera):
        pose = (camera.position, camera.lookat, camera.up)
        height = 2 * camera.image_plane()[1] * _scale(camera)
        return Orthographic(*pose, height=height, resolution=camera.resolution, max_bounces=camera.max_bounces)
    seen = replace(like, resolution=camera.resolution, max_bounces=camera.max_bounces)
    shift = back * (camera.height / 2 / seen.image_plane()[1])
    return replace(seen, position=camera.lookat + shift, lookat=camera.lookat, up=camera.up)


def opened(camera: AnyCamera, degrees: float) -> AnyCamera:
    """With another opening angle, the whole of it, from the same place. An orthographic camera has none."""
    return replace(camera, horizontal_fov=degrees / 2) if isinstance(camera, Camera) else camera


def projection(camera: AnyCamera) -> tuple[float, ...]:
    """A matrix of 3 rows of 4: of (x, y, z, 1) in the world it makes the column times w, the row times w, and w.

    Columns and rows are those of the picture's pixels, whose middles are at halves; w > 0 is in front of the camera.
    """
    (width, height), (wide, high) = camera.resolution, camera.image_plane()
    right, up, back = (np.array([*axis, -(axis @ camera.position)]) for axis in _axes(camera))
    w = np.array([0.0, 0.0, 0.0, 1.0]) if camera.parallel else -back
    rows = np.stack([width / 2 * (w + right / wide), height / 2 * (w - up / high), w])
    return tuple(rows.ravel().tolist())


def ray(camera: AnyCamera, x: int, y: int) -> tuple[Floats, Floats]:
    """Where the ray of a pixel starts, and its direction, of any length, in the world."""
    (width, height), (wide, high) = camera.resolution, camera.image_plane()
    right, up, back = _axes(camera)
    across = (2 * (x + 0.5) / width - 1) * wide * right + (1 - 2 * (y + 0.5) / height) * high * up
    eye = np.array(camera.position)
    return (eye + across, -back) if camera.parallel else (eye, across - back)


def reduced(camera: AnyCamera, divisor: int) -> AnyCamera:
    """The same view in a picture of that part of the width and of the height."""
    width, height = (max(1, side // divisor) for side in camera.resolution)
    return replace(camera, resolution=(width, height))


def as_xml(camera: AnyCamera) -> str:
    """The element of a scene's file. Raises ValueError for an orthographic camera, which no file has."""
    if not isinstance(camera, Camera):
        raise ValueError("a scene's file has no orthographic camera: o makes it one with perspective")
    places = {"position": camera.position, "lookat": camera.lookat, "up": camera.up}
    lines = ['  <{} x="{!r}" y="{!r}" z="{!r}"/>'.format(name, *place) for name, place in places.items()]
    lines += [
        f'  <horizontal_fov angle="{camera.horizontal_fov!r}"/>',
        '  <resolution horizontal="{}" vertical="{}"/>'.format(*camera.resolution),
        f'  <max_bounces n="{camera.max_bounces}"/>',
    ]
    return "\n".join(["<camera>", *lines, "</camera>"])


def _axes(camera: AnyCamera) -> tuple[Any, Any, Any]:
    """To the right, upwards and backwards in the world, as arrays."""
    right, up, back = map(np.array, camera.basis())
    return right, up, back


def _scale(camera: AnyCamera) -> float:
    """How far from the camera its image_plane() has to be for what is at `lookat`; 1 if its rays are parallel."""
    return 1.0 if camera.parallel else math.dist(camera.position, camera.lookat)
