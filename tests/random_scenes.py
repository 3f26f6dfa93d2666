"""Random scenes: any size, place, orientation, kind and number of lights, overlapping spheres; and hostile ones."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

import cltrace
from cltrace import Camera, Scene


def random_scene(seed: int) -> Scene:
    """A scene of 1 to 11 spheres, 0 to 3 lights and about 48x36 pixels, always the same for a seed."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 12))
    eye = rng.normal(size=3) * 10.0 ** rng.integers(-3, 7)
    scale = 10.0 ** rng.integers(-6, 7)
    view = rng.normal(size=3)
    view /= np.linalg.norm(view)
    middle = eye + scale * 5 * view
    lights = [cltrace.ambient_light(rng.uniform(0, 0.5, 3))]
    for _ in range(rng.integers(0, 4)):
        kind = rng.integers(0, 3)
        color = rng.uniform(0, 1, 3)
        position = middle + scale * rng.normal(size=3) * 5
        if kind == 0:
            lights.append(cltrace.parallel_light(rng.normal(size=3), color))
        elif kind == 1:
            lights.append(cltrace.point_light(position, color))
        else:
            inner, outer = rng.uniform(0, 30), rng.uniform(30, 60)
            lights.append(cltrace.spot_light(position, middle - position, inner, outer, color))
    size = [(48, 36), (36, 48), (47, 33), (40, 40)][rng.integers(0, 4)]
    up, fov = rng.normal(size=3), float(rng.uniform(5, 60))
    camera = Camera(eye, eye + scale * view, up, fov, size, square_pixels=False)
    return Scene.from_spheres(
        camera,
        lights,
        middle + scale * rng.normal(size=(n, 3)) * 2,
        scale * rng.uniform(0.1, 1.5, n),
        rng.uniform(0, 1, (n, 3)),
        ka=rng.uniform(0, 0.5, n),
        kd=rng.uniform(0, 1, n),
        ks=rng.uniform(0, 1, n),
        exponent=rng.choice([0, 0.5, 1, 20, 200, 1e4, 1e6], n),
        background=tuple(rng.uniform(0, 1, 3)),
    )


def crowded(scene: Scene, seed: int) -> Scene:
    """The same with 20 to 60 spheres for each one: smaller ones around it, and itself."""
    rng = np.random.default_rng((seed, 2))
    spheres = np.repeat(scene.spheres, rng.integers(20, 60))
    copies = np.ones(len(spheres), bool)
    copies[:: len(spheres) // len(scene.spheres)] = False
    shift = rng.normal(size=(len(spheres), 3)) * spheres["radius"][:, None]
    size = 10.0 ** rng.uniform(-2, 0, len(spheres))
    limit = 3.4e38
    center = spheres["center"] + np.where(copies, 1, 0)[:, None] * np.clip(shift, -limit, limit)
    spheres["center"] = np.where(np.abs(center) < 2.0**-149, 0, np.clip(center, -limit, limit))
    spheres["radius"] = np.maximum(spheres["radius"] * np.where(copies, size, 1), 2.0**-149)
    return dataclasses.replace(scene, spheres=spheres)


def fuzzed_scene(seed: int) -> Scene:
    """A scene of random bits: up to 6 spheres, 3 lights, 9x7 pixels, always the same for a seed.

    Numbers are any that float32 has, subnormal ones, too, and often the same number twice: spheres in one place, lights
    and the eye in centres and on surfaces.
    """
    rng = np.random.default_rng((seed, 1))
    bits = rng.integers(0, 0x7F7FC99E, 12, np.uint32).view(np.float32)  # up to 3.4e38
    pool = bits.astype(float) * rng.choice([1, -1], 12)
    pool[rng.integers(0, 12, rng.integers(0, 6))] = rng.choice([0.0, 1.0, -1.0, 2.0**-149, 3.4e38, -3.4e38])
    radii = np.where(pool == 0, 1.0, np.abs(pool))

    def vector() -> tuple[float, float, float]:
        x, y, z = rng.choice(pool, 3)
        return (float(x), float(y), float(z))

    n = int(rng.integers(1, 7))
    centers, radius = np.array([vector() for _ in range(n)]), rng.choice(radii, n)
    if rng.random() < 0.5:
        centers[rng.integers(0, n)] = centers[0]
    color = tuple(rng.choice([0, 1e-30, 0.5, 1, 3.4e38], 3))
    lights = [cltrace.ambient_light(color)]
    for _ in range(rng.integers(0, 4)):
        place = tuple(centers[0]) if rng.random() < 0.2 else vector()
        direction = vector()
        direction = direction if any(direction) else (0.0, -1.0, 0.0)
        kind = rng.integers(0, 3)
        if kind == 0:
            lights.append(cltrace.parallel_light(direction, color))
        elif kind == 1:
            lights.append(cltrace.point_light(place, color))
        else:
            lights.append(cltrace.spot_light(place, direction, *rng.choice([(0, 0), (10, 60), (180, 180)]), color))
    eye = tuple(centers[0]) if rng.random() < 0.2 else vector()
    fov = float(rng.choice([1e-3, 1.0, 30.0, 60.0, 89.9]))
    try:
        at = vector() if rng.random() < 0.5 else tuple(centers[0])
        camera = Camera(eye, at, vector(), fov, (9, 7), square_pixels=False)
    except ValueError:  # it looks nowhere: towards 0, from as far out as the eye is
        depth = eye[2] - (1.0 if eye[2] == 0 else math.copysign(max(1.0, abs(eye[2])), eye[2]))
        camera = Camera(eye, (eye[0], eye[1], depth), (0, 1, 0), fov, (9, 7), square_pixels=False)
    return Scene.from_spheres(
        camera,
        lights,
        centers,
        radius,
        rng.choice([0, 0.5, 1, 1e30], (n, 3)),
        ka=0.1,
        kd=rng.choice([0, 0.5, 1, 1e30], n),
        ks=rng.choice([0, 0.5, 1, 1e30], n),
        exponent=rng.choice([0, 1e-30, 0.5, 50, 1e6, 3e38], n),
    )
