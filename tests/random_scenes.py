"""Random scenes: any size, place, orientation, kind and number of lights, with overlapping spheres."""

from __future__ import annotations

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
    camera = Camera(tuple(eye), tuple(eye + scale * view), tuple(rng.normal(size=3)), float(rng.uniform(5, 60)), size)
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
