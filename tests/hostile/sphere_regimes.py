"""The hostile regimes: scenes of spheres in which float32, or a careless formula, gets decisions wrong.

REGIMES lists (name, function); function(seed, size) is a scene without lights, of one picture of size = (width, height)
pixels. The camera looks exactly along -z with +y up, so camera space is the world moved by the eye, without a rounding.
Every coordinate and radius is a float32 value; the float64 arrays of the scene hold it exactly.

EDGES is a list of the same kind, of scenes in which many rays meet a decision exactly: they touch, or meet two spheres
at one point. Their numbers are doubles, and both sides of their pictures are odd: the directions (x, 0, -1) of the
middle row, or (0, y, -1) of the middle column, are the rays for which that can be arranged.

Most pictures are zoomed in on limbs. With a "spread" of w, the rays of the picture pass a sphere of radius r between
r (1 - w) and r (1 + w) from its centre. w is drawn at random, and so small that a good share of all rays is close to
the decision. Where spheres overlap, they are about equally far.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene import AnyCamera, Camera, Orthographic, Scene

Size = tuple[int, int]
Regime = Callable[..., Scene]
Floats = NDArray[np.float64]

SIZE = (160, 120)


def rays(camera: AnyCamera) -> Floats:
    """(n, 3): the direction of every pixel's ray in camera space, row by row from the top. Of a Camera.

    Kernel and reference use the same numbers, bit for bit.
    """
    (width, height), (tan_x, tan_y) = camera.resolution, camera.image_plane()
    i, j = np.arange(width), np.arange(height)
    out = np.empty((height, width, 3))
    out[..., 0] = (2 * i + 1 - width) * (tan_x / width)
    out[..., 1] = ((height - 1 - 2 * j) * (tan_y / height))[:, None]
    out[..., 2] = -1
    return out.reshape(-1, 3)


def camera_space(scene: Scene) -> tuple[Floats, Floats, Floats]:
    """(origin, centers, radii) for the oracle: the spheres relative to the eye, without forming that difference."""
    spheres = scene.spheres
    return np.array(scene.camera.position), spheres["center"].copy(), spheres["radius"].copy()


def _camera(eye: Sequence[float], tan: float, size: Size) -> Camera:
    """A camera at float32 coordinates. tan: half of the longer side of its image plane at distance 1."""
    x, y, z = (float(np.float32(v)) for v in eye)
    return Camera(
        position=(x, y, z),
        lookat=(x, y, z - max(1.0, abs(z))),
        horizontal_fov=math.degrees(math.atan(tan)),
        resolution=size,
        square_pixels=True,
    )


def _scene(camera: Camera, centers: NDArray[np.floating], radii: ArrayLike) -> Scene:
    """A scene of spheres, rounded to float32, each of its own colour, so that pictures tell them apart."""
    r32 = np.asarray(radii, np.float32).astype(float)
    c32 = np.asarray(centers, np.float32).astype(float)
    colors = np.linspace(0.1, 1, len(r32))[:, None] * [1.0, 0.5, 0.25]
    return Scene.from_spheres(camera, [], c32, r32, colors, ka=0.1)


def _seeded(name: str, seed: int) -> np.random.Generator:
    return np.random.default_rng([seed, *name.encode()])


def _log2(rng: np.random.Generator, low: float, high: float) -> float:
    return float(2 ** rng.uniform(low, high))


# 3, 4, 5: the twelve directions in which the distance of integer points is an integer. A sphere of radius 5 s at
# (3 s, 4 s, -d) from the eye touches the line of sight exactly.
TANGENT = [(3, 4), (4, 3), (5, 0), (4, -3), (3, -4), (0, -5), (-3, -4), (-4, -3), (-5, 0), (-4, 3), (-3, 4), (0, 5)]


def limbs(
    name: str,
    radius: float,
    distance: float,
    spread: tuple[float, float],
    seed: int,
    size: Size = SIZE,
    *,
    offset: float = 0,
    count: int = 4,
) -> Scene:
    """Spheres of about this radius at about this distance whose limbs all pass close to the middle of the picture.

    spread: log2 of the least and the greatest w, see the module's first lines; offset: the magnitude of the eye's
    coordinates; count: how many spheres.
    """
    rng = _seeded(name, seed)
    w = _log2(rng, *spread)
    eye = np.float32(offset * rng.uniform(0.5, 1, 3) * rng.choice([-1, 1], 3)).astype(float)
    # s, a fifth of a radius, is a multiple of what float32 resolves at the eye, or has 20 bits, so eye + 5 s is exact.
    grid = max(float(np.spacing(np.float32(offset))) if offset else 0, 2.0 ** (math.floor(math.log2(radius / 5)) - 20))
    s = np.maximum(np.round(radius / 5 * rng.uniform(0.75, 1.25, count) / grid), 1) * grid
    # The directions are in one half, so that some of the picture is left to the background.
    turn = rng.integers(len(TANGENT)) + rng.choice(len(TANGENT) // 2, count, replace=False)
    toward = np.array(TANGENT)[turn % len(TANGENT)]
    # In depth the spheres are about as far apart as the picture is wide, so that each is in front in places.
    depth = distance * (1 + 0.25 * w * rng.uniform(-1, 1, count) * radius / distance)
    centers = eye + np.column_stack([toward * s[:, None], -depth])
    radii = 5 * s * (1 + rng.choice([0, 1, 1]) * 0.3 * w * rng.uniform(-1, 1, count))
    return _scene(_camera(eye, w * 5 * float(s.max()) / distance, size), centers, radii)


def ground(name: str, radius: float, seed: int, size: Size = SIZE) -> Scene:
    """The eye 1 above a ground sphere, which is straight below, with balls on it, and the horizon in the picture."""
    rng = _seeded(name, seed)
    tan = math.sqrt(2 / radius) * _log2(rng, 0.5, 4)
    # The picture reaches tan * height / width below the eye's level: the ground is seen from a distance of 1 / that.
    z = -_log2(rng, 0.5, 3) / tan
    balls = rng.uniform(0.2, 1, 3) * min(0.5, -z * tan)
    x = rng.uniform(-1, 1, 3) * -z * tan
    y = balls - (x * x + z * z) / (2 * radius)
    centers = np.vstack([[0, -radius, 0], np.column_stack([x, y, np.full(3, z)])])
    return _scene(_camera((0, 1, 0), tan, size), centers, [radius, *balls])


def globe(name: str, radius: float, height: tuple[float, float], seed: int, size: Size = SIZE) -> Scene:
    """The eye above a globe that is anywhere but straight below; the horizon crosses the picture, tilted.

    height: log2 of the least and the greatest height of the eye. There is a second such globe, up to four heights to
    the side.
    """
    rng = _seeded(name, seed)
    h = _log2(rng, *height)
    dip = math.sqrt(2 * h / radius)
    pitch, roll = dip * rng.uniform(-1.5, 0), rng.uniform(0, 2 * math.pi)
    up = np.array([math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll), -math.sin(pitch)])
    side = np.array([math.cos(roll), -math.sin(roll), 0])
    centers = -(radius + h) * up + np.outer([0, 4 * h * rng.uniform(-1, 1)], side)
    return _scene(_camera((0, 0, 0), dip * _log2(rng, 0, 2), size), centers, [radius, radius])


def grazing(name: str, seed: int, size: Size = SIZE) -> Scene:
    """Nested discs whose limbs pass pixel centres at r (1 -/+ 2^-8..2^-26).

    A circle around the middle of the picture passes many pixel centres if many pairs of the odd numbers 2 i + 1 - width
    and 2 j + 1 - height have the same sum of squares. (For sizes that are odd, the numbers are even.) For each of the
    sums that occur most often there is a sphere on the axis, which is seen as that circle but for 2^-k. The larger the
    circle, the farther is the sphere, so that none hides the limb of another.
    """
    rng = _seeded(name, seed)
    width, height = size
    ring: dict[int, int] = {}
    for i in range(width % 2 ^ 1, width, 2):
        for j in range(height % 2 ^ 1, height, 2):
            ring[i * i + j * j] = ring.get(i * i + j * j, 0) + 1
    best = sorted(sorted(ring, key=lambda n: (-ring[n], n))[:38])
    tan = rng.uniform(0.3, 1)
    near = np.repeat(np.arange(8, 27), 2)[: len(best)]
    off = rng.permutation(2.0**-near * np.resize([1, -1], len(best)))
    # q is the radius of a circle on the image plane. It is at atan(q) from the axis, whose sine is q / sqrt(1 + q^2).
    q = np.sqrt(np.array(best, float)) * tan / max(size)
    depth = 5 * 1.25 ** np.arange(len(best))
    radii = np.float32(depth) * q / np.sqrt(1 + q * q) * (1 + off)
    order = rng.permutation(len(best))
    centers = np.column_stack([np.zeros((len(best), 2)), -depth])
    return _scene(_camera((0, 0, 0), tan, size), centers[order], radii[order])


def inside(name: str, seed: int, size: Size = SIZE) -> Scene:
    """The eye in a room of radius 1, 10^-k from the wall (k = 0..6). There are balls and about the same room again."""
    rng = _seeded(name, seed)
    gap, tan = 10.0 ** -rng.integers(0, 7), _log2(rng, -2, 1)
    out = rng.normal(size=3) * [1, 1, 0.3]  # to the nearest wall: not ahead, where it would hide the rest
    room = -(1 - gap) * out / np.linalg.norm(out)
    other = room + rng.uniform(-1, 1, 3) * gap / 4
    depth = rng.uniform(0.2, 1, 5)
    balls = depth[:, None] * np.column_stack([rng.uniform(-tan, tan, (5, 2)), -np.ones(5)])
    radii = [1, 1 + gap * rng.uniform(-0.25, 0.25), *(depth * tan * rng.uniform(0.1, 0.5, 5) / (1 + tan))]
    return _scene(_camera((0, 0, 0), tan, size), np.vstack([room, other, balls]), radii)


def aimed(name: str, half_angle: tuple[float, float], seed: int, size: Size = SIZE, count: int = 24) -> Scene:
    """A very wide picture, and unit spheres 4 to 6 away all over it. half_angle: degrees, the least and the greatest.

    With 89.9 degrees, rays are up to tan(89.9) sqrt(2) long. Every sphere is moved sideways until the ray of one pixel
    passes its centre at 1 -/+ 2^-4..2^-20.
    """
    rng = _seeded(name, seed)
    most, least = (90 - angle for angle in half_angle)
    camera = _camera((0, 0, 0), math.tan(math.radians(90 - _log2(rng, math.log2(least), math.log2(most)))), size)
    d = rays(camera)
    d /= np.linalg.norm(d, axis=1)[:, None]
    d = d[rng.integers(0, len(d), count)]
    side = np.cross(d, rng.normal(size=(count, 3)))
    side /= np.linalg.norm(side, axis=1)[:, None]
    miss = 1 + rng.choice([-1, 1], count) * 2 ** rng.uniform(-20, -4, count)
    centers = d * rng.uniform(4, 6, (count, 1)) + side * miss[:, None]
    return _scene(camera, centers, np.ones(count))


def _regime(function: Callable[..., Scene], name: str, *args: object, **more: object) -> tuple[str, Regime]:
    return name, partial(function, name, *args, **more)


REGIMES: list[tuple[str, Regime]] = [
    _regime(limbs, "benign r=1 d=5", 1.0, 5.0, (-8, 0.5)),
    _regime(limbs, "far r=1 d=100", 1.0, 100.0, (-10, 0.5)),
    _regime(limbs, "far r=1 d=4100", 1.0, 4100.0, (-12, 0.5)),
    _regime(limbs, "far r=1 d=1e4", 1.0, 1e4, (-12, 0.5)),
    _regime(limbs, "far tiny r=1e-3 d=1e4", 1e-3, 1e4, (-12, 0.5)),
    _regime(ground, "ground R=1e3 h=1", 1e3),
    _regime(ground, "ground R=1e5 h=1", 1e5),
    _regime(ground, "ground R=1e7 h=1", 1e7),
    _regime(globe, "globe R=1e3 h=1 tilted", 1e3, (0, 0)),
    _regime(globe, "globe R=1e5 h=1 tilted", 1e5, (0, 0)),
    _regime(globe, "globe R=1e7 h=1 tilted", 1e7, (0, 0)),
    _regime(limbs, "offset 1e4 r=1 d=5", 1.0, 5.0, (-8, 0.5), offset=1e4),
    _regime(limbs, "offset 1e7 r=10 d=50", 10.0, 50.0, (-4, 0.5), offset=1e7),
    _regime(grazing, "grazing 2^-8..2^-26"),
    _regime(inside, "inside 1e-6..1"),
    _regime(globe, "near surface h=1e-6..1e-1", 1.0, (math.log2(1e-6), math.log2(1e-1))),
    _regime(limbs, "scale 1e-6", 1e-6, 5e-6, (-8, 0.5)),
    _regime(limbs, "scale 1e6", 1e6, 5e6, (-8, 0.5)),
    _regime(aimed, "nonunit |d| 1..800", (60.0, 89.9)),
    _regime(limbs, "huge r=1e20 d=5e20", 1e20, 5e20, (-8, 0.5)),
    _regime(limbs, "tiny r=1e-25 d=5e-25", 1e-25, 5e-25, (-8, 0.5)),
]


def _edges(name: str, seed: int, size: Size) -> tuple[np.random.Generator, Camera, Floats, int]:
    """Random numbers, a camera at 0, directions (n, 3) of the middle row or column, and the index of the axis across.

    By the seed it is the middle row, and axis 1, or the middle column, and axis 0.
    """
    rng, across = _seeded(name, seed), 1 - seed % 2
    width, height = (n | 1 for n in size)
    camera = _camera((0, 0, 0), rng.uniform(0.3, 1), (width, height))
    d = rays(camera).reshape(height, width, 3)
    return rng, camera, d[height // 2] if across else d[:, width // 2], across


def _colored(camera: Camera, centers: Sequence[Floats], radii: ArrayLike) -> Scene:
    colors = np.linspace(0.1, 1, len(centers))[:, None] * [1.0, 0.5, 0.25]
    return Scene.from_spheres(camera, [], np.array(centers), radii, colors, ka=0.1)


def tangents(name: str, scale: tuple[int, int], seed: int, size: Size = SIZE, count: int = 24) -> Scene:
    """Spheres that rest on the plane of the middle row, or column, each on the ray of one pixel; and one far away.

    scale: log2 of the least and the greatest distance.
    """
    rng, camera, d, across = _edges(name, seed, size)
    m = 2.0 ** rng.integers(*scale, count)
    radii = m * 2 ** rng.uniform(-4, 3, count)
    centers = d[rng.integers(0, len(d), count)] * m[:, None]
    centers[:, across] = radii * rng.choice([-1, 1], count)
    return _colored(camera, [*centers, np.array([1e38, 0, -5])], [*radii, 1.0])


def ties(name: str, beside: tuple[int, int] | None, seed: int, size: Size = SIZE, count: int = 5) -> Scene:
    """Groups of three different spheres that meet the plane of the middle row, or column, in one circle.

    beside: None, or log2 of the least and the greatest d, for a fourth sphere in each group, whose centre is beside the
    plane by d of the group's unit: so it is met later than the others, by about d^2.
    """
    rng, camera, _, across = _edges(name, seed, size)
    centers, radii = [], []
    for _ in range(count):
        s = 2.0 ** rng.integers(-4, 4)
        place = np.array([*rng.uniform(-6, 6, 2), -rng.uniform(8, 20)]) * s
        # Pythagoras: the circle has the radius 4.
        group = [(0.0, 4), (3.0, 5), (-3.0, 5), *([(2.0 ** rng.integers(*beside), 4)] if beside else [])]
        for k in rng.permutation(len(group)):
            place[across] = group[k][0] * s
            centers.append(place.copy())
            radii.append(group[k][1] * s)
    return _colored(camera, centers, radii)


def mixed(name: str, seed: int, size: Size = SIZE, count: int = 40) -> Scene:
    """Spheres of sizes from 1e-30 to 1e30, some of whose limbs are on the ray of a pixel, and one around the eye."""
    rng, camera, _, _ = _edges(name, seed, size)
    d = rays(camera)
    s = 10.0 ** rng.uniform(-30, 30, count)
    radii = s * rng.uniform(0.01, 0.4, count)
    side = rng.normal(size=(count, 3))
    centers = d[rng.integers(0, len(d), count)] * s[:, None] + side * (radii / np.linalg.norm(side, axis=1))[:, None]
    return _colored(camera, [*centers, np.array([0, 0, 1e10])], [*radii, 2e10])


def touching(name: str, seed: int, size: Size = SIZE) -> Scene:
    """Spheres that rest on the plane of the middle row or column. The eye is on some, 2^-30..2^-70 beside others."""
    rng, camera, _, across = _edges(name, seed, size)
    centers, radii = [], []
    for side in (-1, 1):
        for beside in (0, 0, *(2.0 ** -rng.integers(30, 70, 4))):
            radii.append(rng.uniform(0.5, 2))
            center = np.zeros(3)
            center[across], center[1 - across] = side * radii[-1], beside * rng.choice([-1, 1])
            center[2] = rng.choice([0, -beside, beside])
            centers.append(center)
    order = rng.permutation(len(radii))
    return _colored(camera, [centers[i] for i in order], [radii[i] for i in order])


def crossing(name: str, seed: int, size: Size = SIZE, count: int = 6) -> Scene:
    """Spheres of different sizes and places through one point on the ray of a pixel, count times.

    The first group, which is the farthest, has two that are around the eye, too.
    """
    rng, camera, d, across = _edges(name, seed, size)
    centers, radii = [], []
    # Pythagoras again: from the point to the centre it is 5. The third coordinate leads on, away from the eye.
    to = np.array([(0, 3, -4), (0, -3, -4), (0, 4, -3), (3, 0, -4), (-3, 0, -4), (0, 0, -5)])
    for group in range(count):
        m = 8.0 if group == 0 else 2.0 ** rng.integers(-2, 2)
        point = d[rng.integers(0, len(d))] * m
        shifts = [v * 2.0 ** -rng.integers(5, 8) * m for v in to[rng.permutation(6)[:4]]]
        if group == 0:
            shifts += [np.array([0, 0, 5]) * 4 * m, np.array([0, 3, 4]) * 4 * m]
        for shift in shifts:
            if across == 0:
                shift[[0, 1]] = shift[[1, 0]]
            center = point + shift
            # The sum must be exact, or the sphere would not go through that point.
            if (center - point == shift).all() and (center - shift == point).all():
                centers.append(center)
                radii.append(float(np.abs(shift).max() if (shift != 0).sum() == 1 else math.hypot(*shift)))
    order = rng.permutation(len(radii))
    return _colored(camera, [centers[i] for i in order], [radii[i] for i in order])


def horizon(name: str, seed: int, size: Size = SIZE) -> Scene:
    """Two globes, above and below the eye and so near that their horizons all but are the middle row, or column.

    They reach beyond it by 2^-50 to 2^-46 of their radius, and touch it 2^-20 to 2^-10 radii away.
    """
    rng, camera, d, across = _edges(name, seed, size)
    centers, radii = [], []
    for side in (-1, 1):
        center = d[rng.integers(0, len(d))].copy()
        height = 2 ** rng.uniform(10, 20)
        center[across] = side * height
        centers.append(center)
        radii.append(height * (1 + 2.0 ** -rng.integers(46, 51)))
    return _colored(camera, centers, radii)


def most_digits(seed: int, size: Size = (9, 7), parallel: bool = False) -> Scene:
    """Numbers with all the bits that a scene can have: pairs, an ulp apart, from tiny to huge, that rest on a plane.

    The plane is about the middle column's.
    """
    rng = np.random.default_rng(seed)
    tiny, huge = 2.0**-149 * (1 + 2.0**-52), 2.0**127 * (2 - 2.0**-23)
    eye, at, up = (tiny, 0, tiny), (2.0**-149 * 3, 2.0**-149, -huge), (0.0, 1.0, 2.0**-149)
    height = (2.0**-149 * 9, 9.0, huge)[seed % 3]
    camera: AnyCamera = Camera(eye, at, up, 2.0**-149 * 1.3, size, square_pixels=False)
    camera = Orthographic(eye, at, up, height, resolution=size) if parallel else camera
    centers, radii = [], []
    for r in (huge / 2, 1.5 * tiny, 1.1, 1e20, 1e-20):
        z = -float(rng.choice([huge / 2, 1.0, 2.0**60, tiny]))
        for k in (0, 1):
            centers.append((r * rng.choice([-1, 1]), 0 if k else tiny, z))
            radii.append(r)
    return Scene.from_spheres(camera, [], centers, radii)


EDGES: list[tuple[str, Regime]] = [
    _regime(tangents, "tangents", (-3, 4)),
    _regime(tangents, "tangents 1e-30..1e30", (-100, 100)),
    _regime(ties, "ties", None),
    _regime(ties, "ties, but for 2^-50..2^-100", (-50, -25)),
    _regime(crossing, "crossing"),
    _regime(mixed, "mixed 1e-30..1e30"),
    _regime(touching, "touching"),
    _regime(horizon, "horizon"),
]
