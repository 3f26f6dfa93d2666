"""What stress cases are made of: cameras whose rays are known exactly, and spheres aimed at their pixels.

A camera here looks along a coordinate axis, with up along another one. Its basis holds 0, 1 and -1 only, so turning the
world into camera space rounds nothing, and the exact oracle can say what every pixel must be.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene import AnyCamera, Camera, Scene, Vector, ambient_light, parallel_light, point_light, spot_light
from hostile.sphere_regimes import rays

Floats = NDArray[np.float64]
Ball = tuple[Sequence[float], float]

LEFT, RIGHT, DOWN, UP, AHEAD, BACK = (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)
AXES = (AHEAD, BACK, LEFT, RIGHT, DOWN, UP)


def looking(
    eye: Sequence[float] = (0, 0, 0), tan: float = 1.0, size: tuple[int, int] = (32, 24), axis: Sequence[int] = AHEAD
) -> Camera:
    """A camera that looks along an axis. tan: half of the longer side of its image plane at distance 1."""
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
    """A scene of spheres that are given as (center, radius)."""
    centers, radii = zip(*spheres, strict=True)
    material.setdefault("ka", 0.1)
    return Scene.from_spheres(camera, lights, np.array(centers, float), np.array(radii, float), **material)  # type: ignore[arg-type]


def lit(camera: Camera, spheres: Iterable[Ball], point: Sequence[float], travels: Sequence[float]) -> Scene:
    """White spheres without highlights, in a red point light at `point` and a green parallel one along `travels`."""
    lights = [point_light(point, (1, 0, 0)), parallel_light(travels, (0, 1, 0))]
    return balls(camera, spheres, lights, ka=0, kd=1, ks=0)


@functools.lru_cache(maxsize=1)
def directions(camera: AnyCamera) -> Floats:
    """(n, 3): the direction of every pixel's ray in the world, without a rounding. All callers share it."""
    out = np.asarray(rays(camera) @ np.array(camera.basis()))
    out.flags.writeable = False
    return out


def aimed(camera: Camera, distance: ArrayLike, radius: ArrayLike, near: Floats, rng: np.random.Generator) -> list[Ball]:
    """n spheres at these distances from the eye, which is the origin, for `near` (n,).

    The ray of some pixel passes each one at radius (1 + near) from its centre.
    """
    d = directions(camera)[rng.integers(0, camera.resolution[0] * camera.resolution[1], len(near))]
    d /= np.linalg.norm(d, axis=1)[:, None]
    side = np.cross(d, rng.normal(size=d.shape))
    side /= np.linalg.norm(side, axis=1)[:, None]
    distance, radius = (np.broadcast_to(np.asarray(x, float), len(near)) for x in (distance, radius))
    centers: Floats = d * distance[:, None] + side * (radius * (1 + near))[:, None]
    return list(zip(centers.tolist(), radius.tolist(), strict=True))


def limbs(low: int, high: int, count: int, rng: np.random.Generator) -> Floats:
    """(count,): numbers +/-2^-k, with each k of low..high about equally often."""
    near: Floats = np.resize(2.0 ** -np.arange(low, high + 1), count) * rng.choice([-1, 1], count)
    return near


def ulp32(x: float, steps: int = 1) -> float:
    """The float32 so many steps beyond x."""
    y = np.float32(x)
    for _ in range(abs(steps)):
        y = np.nextafter(y, np.float32(math.copysign(np.inf, steps)))
    return float(y)


def unit(rng: np.random.Generator, n: int | None = None) -> Floats:
    """A random unit vector, (3,), or n of them, (n, 3)."""
    v = rng.normal(size=3 if n is None else (n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


@functools.cache
def between_doubles(seed: int) -> tuple[float, ...]:
    """A point p near (0, 0, 1), strictly between the spheres of radius 1 and 1 + 2^-52. |p|^2 is computed exactly."""
    rng = np.random.default_rng(seed)
    while True:
        w = unit(rng) * (0.1, 0.1, 1)
        p = w / np.linalg.norm(w) * math.copysign(1 + 2.0**-53, w[2])
        square = sum(Fraction(float(x)) ** 2 for x in p)
        if 1 < square < (1 + Fraction(1, 2**52)) ** 2 and p[2] > 0:
            return tuple(p.tolist())


@functools.cache
def everything(offset: tuple[float, ...] = (0, 0, 0), factor: float = 1, order: tuple[int, ...] = ()) -> Scene:
    """Ground, overlapping spheres and all kinds of light, seen aslant. Coordinates are multiples of 2^-20.

    All of it is moved by `offset`, then scaled by `factor`. order: the spheres that there are, by index; () for all.
    """
    rng = np.random.default_rng(5)

    def place(p: ArrayLike) -> Vector:
        x, y, z = ((np.round(np.asarray(p, float) * 2**20) / 2**20 + offset) * factor).tolist()
        return x, y, z

    n = 10
    centers = [(0, -50, -6), *(rng.uniform(-2, 2, (n - 1, 3)) + (0, 0, -6))]
    radii = np.round(np.array([48.5, *rng.uniform(0.3, 1.2, n - 1)]) * 2**20) / 2**20
    colors, shine = rng.uniform(0.2, 1, (n, 3)), rng.choice([0, 0.5, 20, 1e4], n)
    lights = [
        ambient_light((0.1, 0.1, 0.2)),
        parallel_light((-1, -3, -2), (0.5, 0.5, 0.3)),
        point_light(place((3, 4, 0)), (0.4, 0.3, 0.2)),
        spot_light(place((-3, 5, -2)), (2, -4, -4), 10, 30, (0.2, 0.6, 0.6)),
    ]
    at = list(order or range(n))
    camera = Camera(place((1, 1.5, 2)), place((0, 0.25, -6)), (0.1, 1, 0.2), 28, (44, 33), square_pixels=False)
    where = np.array([place(p) for p in centers])
    return Scene.from_spheres(
        camera,
        lights,
        where[at],
        (radii * factor)[at],
        colors[at],
        ka=0.1,
        exponent=shine[at],
        background=(0.2, 0.3, 0.4),
    )
