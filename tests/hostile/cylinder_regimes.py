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
Rng = np.random.Generator


class Made(NamedTuple):
    """starts, ends: (n, 3); radii: (n,); centers: (m, 3) and sizes: (m,), of spheres; eye, at: (3,), where None is from
    somewhere around `at`, by default the middle of the first one, so that this fills the picture; angle: degrees."""

    starts: Floats
    ends: Floats
    radii: Floats
    eye: Floats | None = None
    at: Floats | None = None
    angle: float = 0
    centers: Floats = np.empty((0, 3))
    sizes: Floats = np.empty(0)


def _unit(rng: Rng, *shape: int) -> Floats:
    v = rng.normal(size=(*shape, 3))
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _across(rng: Rng, way: Floats) -> Floats:
    out = np.cross(way, _unit(rng))
    return np.asarray(out / np.linalg.norm(out))


def heap(rng: Rng) -> Made:
    """Cylinders that cross each other."""
    a, way = rng.normal(size=(2, 12, 3))
    return Made(a, a + way * 10 ** rng.uniform(-1, 0.5, (12, 1)), 10 ** rng.uniform(-1.5, 0, 12))


def needles(rng: Rng) -> Made:
    """Up to a million times as long as thick, zoomed in on."""
    thin, way, share = 10.0 ** -rng.uniform(2, 6), _unit(rng, 4), rng.uniform(0.2, 0.8, (4, 1))
    a, radii = rng.normal(size=(4, 3)) * thin, thin * rng.uniform(0.3, 1, 4)
    return Made(a - share * way, a + (1 - share) * way, radii, 3 * _unit(rng), a[0], np.degrees(2 * thin))


def coins(rng: Rng) -> Made:
    """Up to a million times as wide as thick, some all but from the edge."""
    thin, way = 10.0 ** -rng.uniform(2, 6), _unit(rng, 4)
    a, out = rng.normal(size=(4, 3)) * thin, _across(rng, way[0])
    eye = a[0] + 3 * out + way[0] * thin * rng.uniform(-3, 3)
    return Made(a, a + way * thin, rng.uniform(0.5, 1, 4), eye, a[0] + out * 0.999, np.degrees(2 * thin))


def grazing(rng: Rng) -> Made:
    """Zoomed in on the limb of the side, or on the rim of an end."""
    (a, b), r = rng.normal(size=(2, 3)), 10 ** rng.uniform(-2, 0.3)
    u = (b - a) / np.linalg.norm(b - a)
    out, turn = _across(rng, u), rng.normal()
    point = a + rng.choice([0, rng.uniform(0.1, 0.9), 1]) * (b - a) + r * out
    eye = point - (np.cos(turn) * np.cross(out, u) + np.sin(turn) * u) * 10 ** rng.uniform(-1, 3)
    ends, angle = (np.array([a, b]), np.array([b, a + out])), np.degrees(10.0 ** -rng.uniform(2, 12))
    return Made(*ends, np.array([r, r * 0.9]), eye, point, angle)


def edges(rng: Rng) -> Made:
    """The middle pixel's ray touches a side, or passes through a rim, but for what rounding the eye does."""
    (a, b), r = rng.normal(size=(2, 3)), 10 ** rng.uniform(-2, 0.3)
    u = (b - a) / np.linalg.norm(b - a)
    out, way = _across(rng, u), _unit(rng)
    if rng.random() < 0.5:
        point, way = a + rng.uniform(0.1, 0.9) * (b - a) + r * out, np.cross(out, u) + rng.normal() * u
    else:
        point = a + rng.integers(0, 2) * (b - a) + r * out
    eye = point - way * 10 ** rng.uniform(-1, 1)
    return Made(a[None], b[None], np.array([r]), eye, point, 10.0 ** -rng.uniform(8, 12))


def inside(rng: Rng) -> Made:
    """The eye is inside of some of them, or at their surface."""
    a, way = rng.normal(size=(6, 3)) * 0.2, _unit(rng, 6)
    eye = rng.choice([0, 1]) * a[1] + rng.normal(size=3) * 0.1
    ends = a - way, a + way * 10 ** rng.uniform(-1, 1, (6, 1))
    return Made(*ends, rng.uniform(0.3, 2, 6), eye, eye + _unit(rng), 50)


def straight(rng: Rng) -> Made:
    """Whole numbers, and axes along the rays through the middles of pixels: seen from the end, exactly."""
    eye = rng.integers(-3, 4, 3).astype(float)
    ray = np.column_stack([rng.integers(-4, 5, (8, 2)) / 16, -np.ones(8)])
    depth = np.cumsum(rng.integers(1, 6, (8, 2)), axis=1)
    upright = eye + rng.integers(-4, 5, (4, 3)) - np.array([0, 0, 9.0])
    axis = np.eye(3)[rng.integers(0, 3, 4)] * rng.integers(1, 4, (4, 1))
    starts, ends = (np.vstack([eye + depth[:, [k]] * ray, upright + k * axis]) for k in range(2))
    radii = np.concatenate([rng.integers(1, 5, 8) / 16, rng.integers(1, 4, 4) / 2])
    return Made(starts, ends, radii, eye, eye - (0, 0, 1), 45)


def joints(rng: Rng) -> Made:
    """Bonds that meet at spheres of their radius, in their centres and on their surfaces; ends that touch."""
    centers, r = rng.integers(-2, 3, (6, 3)).astype(float), rng.choice([0.25, 0.5])
    pairs = [(i, j) for i in range(6) for j in range(i) if (centers[i] != centers[j]).any()][:9]
    a, b = centers[np.array(pairs).T]
    touching = centers[:1] + np.array([0, 0, r])
    starts, ends = np.vstack([a, (a + b) / 2, touching]), np.vstack([(a + b) / 2, b, touching + np.array([0, 0, r])])
    sizes = np.where(np.arange(6) % 2, r, 2 * r)
    return Made(starts, ends, np.full(len(starts), r), at=centers[0], centers=centers, sizes=sizes)


def flush(rng: Rng) -> Made:
    """Equal ones, nested ones of one axis, and ends in one plane: ties all over."""
    a, u = rng.integers(-2, 3, (2, 3)).astype(float)
    u = u if u.any() else np.array([1.0, 0, 0])
    starts, ends = (a + np.array(k)[:, None] * u for k in ([0, 0, 0, -1, 1, 0], [1, 1, 2, 1, 0, 1]))
    return Made(starts, ends, np.array([1, 1, 0.5, 1, 1, 0.75]))


def far_away(rng: Rng) -> Made:
    """1e7 from the origin."""
    made, shift = (joints if rng.random() < 0.5 else heap)(rng), 1e7 * rng.choice([-1.0, 1.0], 3)
    starts, ends, centers = (places + shift for places in (made.starts, made.ends, made.centers))
    return made._replace(starts=starts, ends=ends, centers=centers, at=None)


REGIMES: dict[str, Callable[[Rng], Made]] = {
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
    rng = np.random.default_rng([seed, *name.encode()])
    made = REGIMES[name](rng)
    at = (made.starts[0] + made.ends[0]) / 2 if made.at is None else made.at
    length, far = np.linalg.norm(made.ends[0] - made.starts[0]), 10 ** rng.uniform(0.2, 1.5)
    eye = at + max(length, made.radii[0]) * far * _unit(rng) if made.eye is None else made.eye
    angle = max(made.angle or float(np.degrees(np.arctan(0.8 / far))), 1e-12)
    camera = Camera(tuple(eye), tuple(at), (0.1, 1, 0.2) if name != "straight" else (0, 1, 0), angle, size)
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
