"""Scenes of all shapes that planes clip: at random, and in hostile places. REGIMES has functions of a generator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from solids import box

from cltrace import Camera, Material, Mesh, Orthographic, Scene, ambient_light, parallel_light, point_light

Clip = tuple[Any, Any]
SIZE = (16, 12)


def everything(rng: np.random.Generator, planes: list[Clip], **how: Any) -> Scene:
    """Spheres, ellipsoids, cylinders, a closed mesh and an open one; lights in the region, beyond it, and far away."""
    camera = how.pop("camera", None) or Camera(
        tuple(rng.normal(size=3) * 0.3 + (0, 0, 6)), (0, 0, 0), (0, 1, 0), 22, SIZE
    )
    maps = np.tile(np.eye(3), (9, 1, 1))
    maps[3:6] = rng.normal(size=(3, 3, 3)) + np.eye(3)
    solid, sheet = box((-0.5, -0.6, -0.7), (0.6, 0.5, 0.4)), box((-1.5, -1.2, -1.5), (1.5, -1, 1.5))
    material = Material(**{name: float(np.max(value)) for name, value in how.items()})
    meshes = [
        Mesh(solid.vertices + rng.normal(size=3) * 0.5, solid.faces, material=material),
        Mesh(sheet.vertices, sheet.faces[:-1], material=material),
    ]
    lights = [
        ambient_light((0.2, 0.2, 0.2)),
        point_light(tuple(rng.normal(size=3)), (0.8, 0.3, 0.2)),
        point_light((0.3, 2.5, 3.5), (0.1, 0.5, 0.2)),
        parallel_light(tuple(rng.normal(size=3)), (0.1, 0.1, 0.6)),
    ]
    centers, radii = rng.normal(size=(9, 3)) * 0.8, rng.uniform(0.2, 0.7, 9)
    scene = Scene.from_spheres(
        camera, lights, centers, radii, rng.uniform(0.2, 1, (9, 3)), transform=maps, meshes=meshes, **how
    )
    ends = rng.normal(size=(2, 4, 3))
    scene = scene.with_cylinders(ends[0], ends[1], 0.2, material=material)
    scene = scene.with_cylinders([(-1.4, -1.1, -1)], [(-1.4, 1.5, 1)], 0.1, "gold", clipped=False)
    for i, (point, normal) in enumerate(planes):
        scene = scene.clipped(point, normal, "red" if i == 1 else None)
    return scene


def some(rng: np.random.Generator, **how: Any) -> Scene:
    return everything(rng, [(rng.normal(size=3) * 0.4, rng.normal(size=3)) for _ in range(rng.integers(1, 4))], **how)


def mirrors(rng: np.random.Generator) -> Scene:
    return some(rng, reflectance=np.full(9, 0.4))


def glass(rng: np.random.Generator) -> Scene:
    return some(rng, transmittance=np.full(9, 0.6), index=np.full(9, 1.4), reflectance=np.full(9, 0.1))


def parallel(rng: np.random.Generator) -> Scene:
    camera = Orthographic(tuple(rng.normal(size=3) * 0.3 + (0, 0, 6)), (0, 0, 0), (0, 1, 0), 3.0, SIZE)
    return some(rng, camera=camera)


def many(rng: np.random.Generator) -> Scene:
    """Planes that touch a ball."""
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return everything(rng, [(n, n) for n in normals])


def through_the_eye(rng: np.random.Generator) -> Scene:
    """One plane holds the eye, and one ends just before it."""
    camera = Camera((0.25, -0.5, 5), (0, 0, 0), (0, 1, 0), 22, SIZE)
    return everything(rng, [((0.25, -0.5, 5), (1, 0, 0.05)), ((0, 0, 4.999999), (0, 0, 1))], camera=camera)


def inside(rng: np.random.Generator) -> Scene:
    """The eye is in the region, and in some surfaces."""
    camera = Camera((0.0, 0.1, 0.2), tuple(rng.normal(size=3)), (0, 1, 0), 60, SIZE)
    return everything(rng, [(rng.normal(size=3) * 2, rng.normal(size=3)) for _ in range(2)], camera=camera)


def straight(rng: np.random.Generator) -> Scene:
    """Whole numbers: planes through centres, touching, in the planes of faces and of discs; nested surfaces."""
    eye = rng.integers(-1, 2, 3) / 2 + (0, 0, 6)
    camera = Camera(tuple(eye), tuple(eye - (0, 0, 6)), (0, 1, 0), 22, SIZE)
    lights = [ambient_light(), point_light((0, 0, 1.0), (0.5, 0.5, 0.5)), point_light((2, 3, 4), (0.5, 0.2, 0.5))]
    cube, ends = box(), np.array([[(-2, 0, -1), (0, 0, -1.0)], [(2, 0, -1), (0, 0, 1)]])
    scene = Scene.from_spheres(
        camera, lights, [(0, 0, 0), (0, 0, 0), (1, 1, 0), (0, 0, 0.5)], [1, 0.5, 1, 1],
        meshes=[Mesh(cube.vertices * 0.75, cube.faces), Mesh(cube.vertices * 1.25, cube.faces)],
    )  # fmt: skip
    scene = scene.with_cylinders(ends[0], ends[1], [0.5, 1.0])
    for _ in range(rng.integers(1, 4)):
        axis = np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
        scene = scene.clipped(axis * rng.choice([0, 0, 0.5, 0.75, 1, -0.75, 1.25]), axis)
    return scene


def slivers(rng: np.random.Generator) -> Scene:
    """Planes that all but touch what fills the picture."""
    n = rng.normal(size=3) * (1, 1, 0.2)
    n /= np.linalg.norm(n)
    height = rng.choice([-1, 1]) * (1 - 10.0 ** -rng.uniform(3, 15))
    camera = Camera(tuple(n * height + (0, 0, 5)), tuple(n * height), (0, 1, 0), 2, SIZE)
    scene = Scene.from_spheres(camera, [ambient_light(), point_light((0, 2, 4))], [(0, 0, 0), (0, 0, 0)], [1, 0.9999])
    scene = scene.with_cylinders([-n], [n], 0.5)
    return scene.clipped(n * height, n * rng.choice([-1, 1]))


REGIMES: dict[str, Callable[[np.random.Generator], Scene]] = {
    "some": some,
    "mirrors": mirrors,
    "glass": glass,
    "parallel": parallel,
    "many": many,
    "through the eye": through_the_eye,
    "inside": inside,
    "straight": straight,
    "slivers": slivers,
}


def first_of_balls(centers: Any, radii: Any, planes: list[Clip], o: Any, d: Any) -> tuple[Any, Any, Any]:
    """Of each ray, the index of the ball that it meets first, -1 for none, t, and whether in a cap: by intervals."""
    n, k = len(o), len(planes)
    point, normal = (np.array([plane[i] for plane in planes], float).reshape(k, 3) for i in (0, 1))
    dd, g = (d * d).sum(axis=1), d @ normal.T
    h = ((point - o[:, None]) * normal).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        enter = np.where(g < 0, h / g, -np.inf).max(axis=1)
        leave = np.where(g > 0, h / g, np.inf).min(axis=1)
    enter = np.where(((g == 0) & (h < 0)).any(axis=1), np.inf, enter)
    best, index, cap = np.full(n, np.inf), np.full(n, -1), np.zeros(n, bool)
    for i, (center, radius) in enumerate(zip(centers, np.broadcast_to(radii, len(centers)), strict=True)):
        f = center - o
        b = (f * d).sum(axis=1)
        with np.errstate(invalid="ignore"):
            root = np.sqrt(b * b - dd * ((f * f).sum(axis=1) - radius**2))
            near, far = (b - root) / dd, (b + root) / dd
            capped = (near < enter) & (enter < far) & (enter > 0) & (enter < leave)
            first = np.where(near > 0, near, far)
            t = np.where(capped, enter, np.where((first >= enter) & (first > 0), first, np.inf))
            t = np.where(np.isnan(root) | (t > leave), np.inf, t)
        closer = t < best
        best[closer], index[closer], cap[closer] = t[closer], i, capped[closer]
    return index, best, cap


def scene_of(name: str, seed: int) -> Scene:
    return REGIMES[name](np.random.default_rng([seed, *name.encode()]))
