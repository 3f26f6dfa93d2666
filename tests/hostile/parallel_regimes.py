"""The hostile regimes of parallel rays: spheres, ellipsoids and triangles before orthographic cameras."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene import Mesh, Orthographic, Scene

from .sphere_regimes import most_digits, rays

Rng = np.random.Generator
# Three of its four axes are doubles of 53 digits.
TURNED = Orthographic((3, 2, 5), (0.1, 0.2, 0.3), (0.1, 1, 0.2), height=4.3, resolution=(13, 9))


def _of(camera: Orthographic, rows: ArrayLike) -> Scene:
    """rows: (x, y, z, radius) of spheres."""
    values = np.array(rows, float)
    return Scene.from_spheres(camera, (), values[:, :3], values[:, 3])


def whole_numbers(rng: Rng, seed: int) -> Scene:
    """Pixels' centres are whole numbers, and so are places and radii: many a ray only touches."""
    scale = (1.0, 2.0**-40, 2.0**60)[seed % 3]
    centers = [rng.integers(-9, 10, 40), rng.integers(-7, 8, 40), rng.integers(-99, -15, 40)]
    rows = np.column_stack([*centers, rng.choice([1, 1, 2, 2, 5], 40)]) * scale
    return _of(Orthographic(height=15 * scale, resolution=(19, 15)), rows)


def grazing(rng: Rng, seed: int) -> Scene:
    """Spheres whose edge passes through pixels' centres but for an ulp, some within others and some there twice."""
    (right, up, back), far = np.array(TURNED.basis()), (9.0, 1e6, 1e14)[seed % 3]
    rows = []
    for x, y, _ in rays(TURNED)[rng.integers(13 * 9, size=12)]:
        r, angle = 10.0 ** rng.uniform(-3, 0.5), rng.uniform(0, 7)
        start = TURNED.position + x * right + y * up
        center = start + r * (np.cos(angle) * right + np.sin(angle) * up) - back * rng.uniform(2 * r, far)
        rows.append((*center, r * (1 + rng.integers(-2, 3) * 2.0**-52)))
    return _of(TURNED, rows + rows[:3])


def far_cameras(rng: Rng, seed: int) -> Scene:
    """Up to where the spheres' own rounding is all that tells rays apart."""
    distance = (1e3, 1e9, 1e15, 1e25)[seed % 4]
    camera = Orthographic(distance * np.array([0.36, 0.48, 0.8]), (0, 0, 0), height=3, resolution=(9, 7))
    scene = _of(camera, np.column_stack([rng.normal(size=(30, 3)), rng.uniform(0.05, 0.5, 30)]))
    return scene if seed < 4 else scene.seen_by(replace(camera, height=distance))


def cut_by_the_plane(rng: Rng, seed: int) -> Scene:
    """Rays start inside of some, on some, and just before or behind others; those behind are not seen."""
    if seed % 2:
        centers = rng.normal(size=(20, 3)) * (2, 2, 0.3) + TURNED.position
        return _of(TURNED, np.column_stack([centers, rng.uniform(0.1, 1, 20)]))
    rows = [(0, 0, 0, 2), (1, 1, -1, 1), (1, 1, 1, 1), (-3, 2, 0.5, 0.5), (-3, -2, -0.25, 0.25), (0, 0, 3, 4),
            (2, 0, 0.5, 0.5000000000000001), (2, -1, -0.5, 0.49999999999999994), (3, 3, 0, 0.001),
            (0, -3, 1e9, 1e9)]  # fmt: skip
    order = rng.permutation(len(rows))[: rng.integers(1, 11)]
    return _of(Orthographic((0, 0, 0), (0, 0, -1), height=7, resolution=(9, 7)), np.array(rows)[order])


def at_one_point(rng: Rng, seed: int) -> Scene:
    """Of equally near ones the lowest number is seen: spheres that touch from inside, and two that cross in a plane."""
    inner = [(0, 0, -10 + (4 - r), r) for r in (1, 4, 2, 0.5, 3)]  # all touch the plane z = -6 at (0, 0)
    rows = rng.permutation([*inner, *((x, y, -20, 5) for x, y in ((-3, 0), (3, 0), (0, -3), (0, 3)))])[: 3 + seed]
    if seed % 2 == 0:
        return _of(Orthographic(height=9, resolution=(9, 9)), rows)
    return _of(TURNED, np.column_stack([rows[:, :3] @ np.array(TURNED.basis()), rows[:, 3]]))


def triangles(rng: Rng, seed: int) -> Scene:
    """Of whole numbers, with edges and corners on pixels' centres, and needles; before, on and behind the plane."""
    vertices: NDArray[np.float64] = rng.integers(-2, 3, (10, 3)).astype(float)
    camera = Orthographic((0, 0, seed % 3 - 1), (0, 0, -5), height=5, resolution=(5, 5))  # at whole numbers
    if seed % 2:
        vertices = rng.normal(size=(10, 3)) + 1e3
        vertices[5:8] = vertices[0:3] + (vertices[1:4] - vertices[0:3]) * rng.choice([0.5, 0.25, 1 / 3], (3, 1))
        middle = vertices.mean(axis=0)
        camera = Orthographic(middle + TURNED.basis()[2], middle, height=3, resolution=(9, 7))
    return Scene.from_meshes(camera, (), Mesh(vertices, rng.integers(0, 10, (12, 3))))


def ellipsoids(rng: Rng, seed: int) -> Scene:
    """Before the plane, and cut by it."""
    camera = replace(TURNED, position=(0, 0, 0), lookat=(1, 2, 3)) if seed % 2 else TURNED
    maps = rng.normal(size=(15, 3, 3))
    return Scene.from_spheres(camera, (), rng.normal(size=(15, 3)), rng.uniform(0.1, 0.5, 15), transform=maps)


REGIMES: dict[str, Callable[[Rng, int], Scene]] = {
    "whole numbers": whole_numbers,
    "grazing": grazing,
    "far cameras": far_cameras,
    "cut by the plane": cut_by_the_plane,
    "at one point": at_one_point,
    "triangles": triangles,
    "ellipsoids": ellipsoids,
    "the most digits": lambda _, seed: most_digits(seed, parallel=True),
}


def scene_of(name: str, seed: int) -> Scene:
    return REGIMES[name](np.random.default_rng([seed, *name.encode()]), seed)
