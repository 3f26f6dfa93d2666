"""What the stress cases share: cameras whose rays are known exactly, and pictures held against oracle and reference.

A camera here looks along a coordinate axis with up along another one: its basis holds 0, 1 and -1 only, so the world is
camera space without a rounding, and the exact oracle can say what every pixel must be.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numpy.typing import ArrayLike, NDArray
from oracle import closest, normal_error, normal_high, occluded, t_high
from regimes import rays

from cltrace import Camera, Image, Renderer, Scene, parallel_light, point_light
from cltrace.check import sample
from cltrace.device import Device
from cltrace.reference import byte_of, primary_ray, trace, world_of
from cltrace.scene import PARALLEL, POINT

Floats = NDArray[np.float64]
Ball = tuple[Sequence[float], float]

# Always the same outputs: one program for all scenes of one kind.
OUTPUTS = ("rgb8", "color", "normal", "direction", "depth", "id", "shadow_rays")
LEFT, RIGHT, DOWN, UP, AHEAD, BACK = (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)
AXES = (AHEAD, BACK, LEFT, RIGHT, DOWN, UP)


def looking(
    eye: Sequence[float] = (0, 0, 0), tan: float = 1.0, size: tuple[int, int] = (32, 24), axis: Sequence[int] = AHEAD
) -> Camera:
    """A camera along an axis; tan: half of the longer side of its image plane at distance 1."""
    at = [e + a * max(1.0, abs(e)) for e, a in zip(eye, axis, strict=True)]
    camera = Camera(
        position=tuple(map(float, eye)),
        lookat=tuple(at),
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
    centers = d * distance[:, None] + side * (radius * (1 + near))[:, None]
    return list(zip(centers.tolist(), radius.tolist(), strict=True))


def limbs(low: int, high: int, count: int, rng: np.random.Generator) -> Floats:
    """+/-2^-k, each k of low..high equally often."""
    return np.resize(2.0 ** -np.arange(low, high + 1), count) * rng.choice([-1, 1], count)


def picture(scene: Scene, device: Device, precision: str = "accurate", width: int | None = None) -> Image:
    """All outputs of a scene."""
    return Renderer(scene, device, precision, OUTPUTS, width=width).render()


def channel(image: Image, name: str) -> np.ndarray:
    """An output, one row per pixel."""
    value = getattr(image, name)
    return value.reshape(-1, 3) if value.ndim == 3 else value.ravel()


def remembered(function: Callable[..., Any]) -> Callable[..., Any]:
    """Caches by what a scene holds, not by which object it is: every device's test makes the scene anew.

    Of the other arguments only whole numbers count; an image only says where to look.
    """
    kept: dict[tuple[object, ...], Any] = {}

    @functools.wraps(function)
    def answer(scene: Scene, *arguments: object) -> Any:
        arrays = (a.tobytes() for a in (scene.spheres, scene.materials, scene.lights))
        key = (scene.camera, *arrays, *(a for a in arguments if isinstance(a, int)))
        if key not in kept:
            if len(kept) >= 256:
                del kept[next(iter(kept))]
            kept[key] = function(scene, *arguments)
        return kept[key]

    return answer


class Truth(NamedTuple):
    """What the exact oracle says of every pixel, and whether the eye is outside of each sphere."""

    d: Floats
    index: NDArray[np.int32]
    depth: np.ndarray  # long double: the distance is rounded once more than t
    outside: list[bool]


@remembered
def truth(scene: Scene) -> Truth:
    eye, spheres = scene.camera.position, scene.spheres
    d = directions(scene.camera)
    index, t = closest(eye, d, spheres["center"], spheres["radius"])
    power = [
        sum((Fraction(c) - Fraction(e)) ** 2 for c, e in zip(center, eye, strict=True)) - Fraction(radius) ** 2
        for center, radius in zip(spheres["center"].tolist(), spheres["radius"].tolist(), strict=True)
    ]
    length = np.sqrt((d.astype(np.longdouble) ** 2).sum(axis=1))
    return Truth(d, index, t * length, [p > 0 for p in power])


def facing_normal(scene: Scene, pixel: int) -> tuple[mpmath.mpf, ...]:
    """The exact normal at a pixel's hit, facing the eye."""
    want, spheres = truth(scene), scene.spheres
    i = want.index[pixel]
    n = normal_high(scene.camera.position, want.d[pixel], spheres["center"][i], spheres["radius"][i])
    return n if want.outside[i] else tuple(-x for x in n)


@remembered
def normals_of(scene: Scene, count: int) -> dict[int, tuple[mpmath.mpf, ...]]:
    """facing_normal() of some pixels that hit: limbs first, where a normal loses its digits."""
    index, (width, height) = truth(scene).index, scene.camera.resolution
    pixels = [i for i in sample(index.reshape(height, width), 2 * count) if index[i] >= 0][:count]
    return {int(i): facing_normal(scene, i) for i in pixels}


def check(scene: Scene, device: Device, precision: str = "accurate", normals: int = 0) -> Image:
    """Every id is exact, no t is off by more than 0.52 ulp of float32 and 1e-8, no sampled normal by 1e-7 rad."""
    image, want = picture(scene, device, precision), truth(scene)
    ids, depth, normal = channel(image, "id"), channel(image, "depth"), channel(image, "normal")
    wrong = np.flatnonzero(ids != want.index)
    assert len(wrong) == 0, f"{len(wrong)} wrong ids"
    assert np.isfinite(image.color).all()
    hit = want.index >= 0
    got, exact = depth[hit].astype(np.longdouble), want.depth[hit]
    assert (depth[~hit] == np.inf).all()
    assert (normal[~hit] == 0).all()
    relative = float(np.abs(got / exact - 1).max(initial=0))
    assert relative <= 1e-8, f"t is off by {relative:.3g}"
    ulps = np.abs(depth[hit].astype(np.float32).astype(np.longdouble) - exact) / np.spacing(exact.astype(np.float32))
    most_ulps = float(ulps.max(initial=0))
    assert most_ulps <= 0.52, f"t is off by {most_ulps:.3f} ulp"
    angle = (
        max((normal_error(normal[i], n) for i, n in normals_of(scene, normals).items()), default=0) if normals else 0
    )
    assert angle <= 1e-7, f"a normal is off by {angle:.3g} rad"
    return image


@remembered
def lighting(scene: Scene, image: Image, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Some pixels that hit, edges of spheres and shadows first, and (lit, facing) of each for each light."""
    want, spheres = truth(scene), scene.spheres
    parts = image.id * 8 + (image.color > 0) @ [1, 2, 4]
    pixels = np.array([i for i in sample(parts, 2 * count) if want.index[i] >= 0][:count], int)
    out = np.zeros((len(pixels), len(scene.lights), 2), bool)
    for j, light in enumerate(scene.lights):
        kind = {POINT: "point", PARALLEL: "parallel"}[int(light["kind"])]
        where = light["position" if kind == "point" else "direction"]
        for row, i in enumerate(pixels):
            out[row, j] = occluded(
                scene.camera.position, want.d[i], want.index[i], spheres["center"], spheres["radius"], where, kind
            )
    return pixels, out


def cosine(scene: Scene, pixel: int, number: int) -> float:
    """n.l of a pixel's hit and a light, to all digits."""
    want, light = truth(scene), scene.lights[number]
    sphere = scene.spheres[want.index[pixel]]
    with mpmath.workdps(50):
        l = [-mpmath.mpf(float(x)) for x in light["direction"]]  # noqa: E741
        if light["kind"] == POINT:
            t = t_high(scene.camera.position, want.d[pixel], sphere["center"], float(sphere["radius"]))
            p = [Fraction(o) + t * Fraction(x) for o, x in zip(scene.camera.position, want.d[pixel], strict=True)]
            way = [Fraction(float(x)) - y for x, y in zip(light["position"], p, strict=True)]
            l = [mpmath.mpf(x.numerator) / x.denominator for x in way]  # noqa: E741
        n = facing_normal(scene, pixel)
        return float(mpmath.fdot(n, l) / mpmath.sqrt(mpmath.fdot(l, l)))


def check_shadows(scene: Scene, device: Device, precision: str = "accurate", count: int = 100) -> Image:
    """check(), no leak, no false shadow, and a shadow ray exactly where the surface faces a light.

    A lit pixel may be black only if n.l is below what float32 resolves in a unit vector.
    """
    image = check(scene, device, precision)
    pixels, want = lighting(scene, image, count)
    assert len(pixels)
    color = channel(image, "color")[pixels]
    for j, light in enumerate(scene.lights):
        seen = color[:, np.argmax(light["color"])] > 0
        leaks, shadows = seen & ~want[:, j, 0], ~seen & want[:, j, 0]
        assert not leaks.any(), f"{leaks.sum()} leaks"
        certain = [i for i in pixels[shadows] if cosine(scene, i, j) > 2.0**-22]
        assert not certain, f"{len(certain)} false shadows"
    other = channel(image, "shadow_rays")[pixels] != want[:, :, 1].sum(axis=1)
    assert not other.any(), f"pixels {pixels[other]} of {scene} face other lights"
    return image


@remembered
def colors_of(scene: Scene, image: Image, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Some pixels, edges of spheres first, and the reference's colours of them."""
    width = scene.camera.resolution[0]
    pixels, world = sample(image.id, min(count, image.id.size)), world_of(scene)
    return pixels, np.array(
        [trace(world, primary_ray(scene.camera, int(i) % width, int(i) // width))[0] for i in pixels]
    )


def check_colors(scene: Scene, image: Image, count: int = 100) -> float:
    """No sampled byte is off by more than one level from the reference; returns the largest error of a colour."""
    pixels, want = colors_of(scene, image, count)
    levels = np.array([[byte_of(c) for c in color] for color in want])
    assert np.isfinite(image.color).all()
    apart = np.abs(channel(image, "rgb8")[pixels].astype(int) - levels).max()
    assert apart <= 1, f"{apart} levels"
    return float(np.abs(channel(image, "color")[pixels] - want).max())
