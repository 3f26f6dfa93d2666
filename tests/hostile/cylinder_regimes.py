"""The hostile regimes of cylinders, some with spheres.

REGIMES has functions of a generator: the cylinders and what else is there, an eye, a place to look at, and half of the
picture's angle. All are seen by a camera without square pixels, from rays that B^T d are, exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import Camera, Scene, parallel_light, point_light

Floats = NDArray[np.float64]


class Made(NamedTuple):
    """starts, ends: (n, 3); radii: (n,); centers: (m, 3) and sizes: (m,), of spheres; eye, at: (3,); angle: degrees."""

    starts: Floats
    ends: Floats
    radii: Floats
    centers: Floats
    sizes: Floats
    eye: Floats
    at: Floats
    angle: float


def _unit(rng: np.random.Generator, *shape: int) -> Floats:
    v = rng.normal(size=(*shape, 3))
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _made(rng: np.random.Generator, starts: Any, ends: Any, radii: Any, **more: Any) -> Made:
    """Seen from somewhere around the middle of the first one, so that this fills the picture."""
    a, b, r = (np.asarray(x, float) for x in (starts, ends, radii))
    size = max(np.linalg.norm(b[0] - a[0]), r[0])
    at = more.pop("at", (a[0] + b[0]) / 2)
    eye = more.pop("eye", None)
    far = 10 ** rng.uniform(0.2, 1.5)
    eye = at + size * far * _unit(rng) if eye is None else eye
    angle = more.pop("angle", np.degrees(np.arctan(0.8 / far)))
    centers, sizes = more.get("centers", np.empty((0, 3))), more.get("sizes", np.empty(0))
    return Made(a, b, r, np.asarray(centers, float), np.asarray(sizes, float), eye, at, float(angle))


def heap(rng: np.random.Generator) -> Made:
    """Cylinders that cross each other."""
    a = rng.normal(size=(12, 3))
    return _made(
        rng, a, a + rng.normal(size=(12, 3)) * 10 ** rng.uniform(-1, 0.5, (12, 1)), 10 ** rng.uniform(-1.5, 0, 12)
    )


def needles(rng: np.random.Generator) -> Made:
    """Up to a million times as long as thick, zoomed in on."""
    thin = 10.0 ** -rng.uniform(2, 6)
    a, way = rng.normal(size=(4, 3)) * thin, _unit(rng, 4)
    share = rng.uniform(0.2, 0.8, (4, 1))
    eye = _unit(rng) * 3
    return _made(
        rng,
        a - share * way,
        a + (1 - share) * way,
        thin * rng.uniform(0.3, 1, 4),
        at=a[0],
        eye=eye,
        angle=np.degrees(2 * thin),
    )


def coins(rng: np.random.Generator) -> Made:
    """Up to a million times as wide as thick, some all but from the edge."""
    thin = 10.0 ** -rng.uniform(2, 6)
    a, way = rng.normal(size=(4, 3)) * thin, _unit(rng, 4)
    across = np.cross(way[0], _unit(rng))
    across /= np.linalg.norm(across)
    eye = a[0] + 3 * across + way[0] * thin * rng.uniform(-3, 3)
    rim = a[0] + across * 0.999
    return _made(rng, a, a + way * thin, rng.uniform(0.5, 1, 4), at=rim, eye=eye, angle=np.degrees(thin * 2))


def grazing(rng: np.random.Generator) -> Made:
    """Zoomed in on the limb of the side, or on the rim of an end."""
    a, b, r = rng.normal(size=3), rng.normal(size=3), 10 ** rng.uniform(-2, 0.3)
    u = (b - a) / np.linalg.norm(b - a)
    out = np.cross(u, _unit(rng))
    out /= np.linalg.norm(out)
    along_ = np.cross(out, u)
    k = rng.choice([0, rng.uniform(0.1, 0.9), 1])
    point = a + k * (b - a) + r * out
    turn = rng.normal()
    way = np.cos(turn) * along_ + np.sin(turn) * u
    distance, narrow = 10 ** rng.uniform(-1, 3), 10.0 ** -rng.uniform(2, 12)
    eye = point - way * distance
    return _made(rng, [a, b], [b, a + out], [r, r * 0.9], at=point, eye=eye, angle=np.degrees(narrow))


def edges(rng: np.random.Generator) -> Made:
    """The middle pixel's ray touches a side, or passes through a rim, but for what rounding the eye does."""
    a, b, r = rng.normal(size=3), rng.normal(size=3), 10 ** rng.uniform(-2, 0.3)
    u = (b - a) / np.linalg.norm(b - a)
    out = np.cross(u, _unit(rng))
    out /= np.linalg.norm(out)
    way = _unit(rng)
    if rng.random() < 0.5:
        point, way = a + rng.uniform(0.1, 0.9) * (b - a) + r * out, np.cross(out, u) + rng.normal() * u
    else:
        point = a + rng.integers(0, 2) * (b - a) + r * out
    eye = point - way * 10 ** rng.uniform(-1, 1)
    return _made(rng, [a], [b], [r], at=point, eye=eye, angle=10.0 ** -rng.uniform(8, 12))


def inside(rng: np.random.Generator) -> Made:
    """The eye is inside of some of them, or at their surface."""
    a, way = rng.normal(size=(6, 3)) * 0.2, _unit(rng, 6)
    eye = rng.choice([0, 1]) * a[1] + rng.normal(size=3) * 0.1
    return _made(
        rng,
        a - way,
        a + way * 10 ** rng.uniform(-1, 1, (6, 1)),
        rng.uniform(0.3, 2, 6),
        eye=eye,
        at=eye + _unit(rng),
        angle=50,
    )


def straight(rng: np.random.Generator) -> Made:
    """Whole numbers, and axes along the rays through the middles of pixels: seen from the end, exactly."""
    eye = rng.integers(-3, 4, 3).astype(float)
    at = eye + np.array([0, 0, -1.0])
    x, y = (rng.integers(-4, 5, 8) / 16 for _ in range(2))
    depth = rng.integers(1, 6, (8, 2)).astype(float)
    depth[:, 1] += depth[:, 0]
    ray = np.stack([x, y, -np.ones(8)], axis=1)
    starts, ends = eye + depth[:, :1] * ray, eye + depth[:, 1:] * ray
    upright = eye + rng.integers(-4, 5, (4, 3)) - np.array([0, 0, 9.0])
    axis = np.eye(3)[rng.integers(0, 3, 4)] * rng.integers(1, 4, (4, 1))
    radii = np.concatenate([rng.integers(1, 5, 8) / 16, rng.integers(1, 4, 4) / 2])
    return _made(rng, np.vstack([starts, upright]), np.vstack([ends, upright + axis]), radii, eye=eye, at=at, angle=45)


def joints(rng: np.random.Generator) -> Made:
    """Bonds that meet at spheres of their radius, in their centres and on their surfaces; ends that touch."""
    centers = rng.integers(-2, 3, (6, 3)).astype(float)
    pairs = [(i, j) for i in range(6) for j in range(i) if (centers[i] != centers[j]).any()][:9]
    i, j = np.array(pairs).T
    r = rng.choice([0.25, 0.5])
    starts, ends = centers[i], centers[j]
    middle = (starts + ends) / 2
    touching = centers[0] + np.array([0, 0, r]), centers[0] + np.array([0, 0, 2 * r])
    return _made(
        rng,
        np.vstack([starts, middle, [touching[0]]]),
        np.vstack([middle, ends, [touching[1]]]),
        np.full(2 * len(pairs) + 1, r),
        centers=centers,
        sizes=np.where(np.arange(6) % 2, r, 2 * r),
        at=centers[0],
    )


def flush(rng: np.random.Generator) -> Made:
    """Equal ones, nested ones of one axis, and ends in one plane: ties all over."""
    a = rng.integers(-2, 3, 3).astype(float)
    u = rng.integers(-2, 3, 3).astype(float)
    u = u if u.any() else np.array([1.0, 0, 0])
    starts = [a, a, a, a - u, a + u, a]
    ends = [a + u, a + u, a + 2 * u, a + u, a, a + u]
    radii = [1, 1, 0.5, 1, 1, 0.75]
    return _made(rng, starts, ends, radii)


def far_away(rng: np.random.Generator) -> Made:
    """1e7 from the origin."""
    made = (joints if rng.random() < 0.5 else heap)(rng)
    shift = 1e7 * rng.choice([-1.0, 1.0], 3)
    moved = [x + shift if len(x) else x for x in (made.starts, made.ends)]
    return made._replace(
        starts=moved[0], ends=moved[1], centers=made.centers + shift, eye=made.eye + shift, at=made.at + shift
    )


REGIMES: dict[str, Callable[[np.random.Generator], Made]] = {
    "heap": heap,
    "needles": needles,
    "coins": coins,
    "grazing": grazing,
    "edges": edges,
    "inside": inside,
    "straight": straight,
    "joints": joints,
    "flush": flush,
    "far away": far_away,
}


def scene_of(name: str, seed: int, size: tuple[int, int], lights: Any = ()) -> Scene:
    made = REGIMES[name](np.random.default_rng([seed, *name.encode()]))
    angle = min(max(made.angle, 1e-12), 80.0)
    camera = Camera(tuple(made.eye), tuple(made.at), (0.1, 1, 0.2) if name != "straight" else (0, 1, 0), angle, size)
    scene = Scene.from_spheres(camera, lights, made.centers, made.sizes, ka=1)
    kept = (made.starts != made.ends).any(axis=1)
    return scene.with_cylinders(made.starts[kept], made.ends[kept], made.radii[kept])


def lit_of(name: str, seed: int, size: tuple[int, int]) -> Scene:
    """The same in four lights: a point near some of it, one in or at an end, a parallel one, and one along an axis."""
    scene, rng = scene_of(name, seed, size), np.random.default_rng(seed)
    rods = scene.cylinders
    rod, other = rods[rng.integers(len(rods))], rods[rng.integers(len(rods))]
    axis = rod["end"] - rod["start"]
    near = rod["start"] + axis / 2 + rng.normal(size=3) * np.linalg.norm(axis) * 10 ** rng.uniform(-6, 1.5)
    at = other["end"] + rng.choice([0, 1]) * rng.normal(size=3) * other["radius"]
    points = [point_light(near, (1, 0, 0)), point_light(at, (0, 0.5, 0))]
    return scene.lit_by([*points, parallel_light(rng.normal(size=3), (0, 0, 1)), parallel_light(axis, (0, 0.4, 0.01))])
