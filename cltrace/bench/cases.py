"""What stress cases are made of: cameras whose rays are known exactly, and spheres aimed at their pixels.

A camera here looks along a coordinate axis with up along another one: its basis holds 0, 1 and -1 only, so the world is
camera space without a rounding, and the exact oracle can say what every pixel must be.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene import Camera, Scene, parallel_light, point_light

from .regimes import rays

Floats = NDArray[np.float64]
Ball = tuple[Sequence[float], float]

LEFT, RIGHT, DOWN, UP, AHEAD, BACK = (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)
AXES = (AHEAD, BACK, LEFT, RIGHT, DOWN, UP)


def looking(
    eye: Sequence[float] = (0, 0, 0), tan: float = 1.0, size: tuple[int, int] = (32, 24), axis: Sequence[int] = AHEAD
) -> Camera:
    """A camera along an axis; tan: half of the longer side of its image plane at distance 1."""
    (x, y, z), (u, v, w) = map(float, eye), (a * max(1.0, abs(e)) for e, a in zip(eye, axis, strict=True))
    camera = Camera(
        position=(x, y, z),
        lookat=(x + u, y + v, z + w),
        up=BACK if axis in (UP, DOWN) else UP,
        horizontal_fov=math.degrees(math.atan(tan)),
        resolution=size,
        square_pixels=True,
    )
    assert set(np.ravel(camera.basis())) == {0.0, 1.0} or set(np.ravel(camera.basis())) == {0.0, 1.0, -1.0}
    return camera


def frame(amount: int, pixels: int = 800) -> tuple[int, int]:
    """The size of a picture of 4:3 with about pixels * amount pixels; odd, so that one pixel is on the axis."""
    height = math.isqrt(pixels * amount * 3 // 4)
    return (height * 4 // 3 | 1, height | 1)


def balls(camera: Camera, spheres: Iterable[Ball], lights: Iterable[np.ndarray] = (), **material: ArrayLike) -> Scene:
    """A scene of (center, radius)."""
    centers, radii = zip(*spheres, strict=True)
    return Scene.from_spheres(camera, lights, np.array(centers, float), np.array(radii, float), **material)  # type: ignore[arg-type]


def lit(camera: Camera, spheres: Iterable[Ball], point: Sequence[float], travels: Sequence[float]) -> Scene:
    """White dull spheres without ambient light: red is what the point light adds, green what the parallel one does."""
    lights = [point_light(point, (1, 0, 0)), parallel_light(travels, (0, 1, 0))]
    return balls(camera, spheres, lights, ka=0, kd=1, ks=0)


def directions(camera: Camera) -> Floats:
    """Every pixel's ray in the world, exactly: (n, 3)."""
    return np.asarray(rays(camera) @ np.array(camera.basis()))


def aimed(camera: Camera, distance: ArrayLike, radius: ArrayLike, near: Floats, rng: np.random.Generator) -> list[Ball]:
    """Spheres this far from the eye (the origin), each passed by the ray of some pixel at radius (1 + near)."""
    d = directions(camera)[rng.integers(0, camera.resolution[0] * camera.resolution[1], len(near))]
    d /= np.linalg.norm(d, axis=1)[:, None]
    side = np.cross(d, rng.normal(size=d.shape))
    side /= np.linalg.norm(side, axis=1)[:, None]
    distance, radius = (np.broadcast_to(np.asarray(x, float), len(near)) for x in (distance, radius))
    centers: Floats = d * distance[:, None] + side * (radius * (1 + near))[:, None]
    return list(zip(centers.tolist(), radius.tolist(), strict=True))


def limbs(low: int, high: int, count: int, rng: np.random.Generator) -> Floats:
    """+/-2^-k, each k of low..high equally often."""
    near: Floats = np.resize(2.0 ** -np.arange(low, high + 1), count) * rng.choice([-1, 1], count)
    return near
