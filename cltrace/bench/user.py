"""What a user's script does: arrays from a file, a picture, then other cameras and other places. ways.py times it.

python -m cltrace.bench.user ARRAYS.npz PICTURE.png DEVICE FRAMES
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace

import numpy as np

import cltrace


def main(file: str, picture: str, spec: str, frames: str) -> None:
    """Prints the seconds of each way, as one JSON object."""
    with np.load(file) as arrays:
        given = dict(arrays)
    tan, width, height = given.pop("view").tolist()
    camera = cltrace.Camera(
        (0, 0, 0), (0, 0, -1), (0, 1, 0), np.degrees(np.arctan(tan)), (int(width), int(height)), square_pixels=True
    )
    lights = [cltrace.ambient_light((1, 1, 1)), cltrace.point_light((5, 8, 2))]
    start = time.perf_counter()
    scene = cltrace.Scene.from_spheres(camera, lights, **given, ka=0.1, background=(0.1, 0.1, 0.2))
    renderer = cltrace.Renderer(scene, next(d for d in cltrace.devices() if d.spec == spec))
    image = renderer.render()
    seconds: dict[str, list[float]] = {"first": [time.perf_counter() - start], "camera": [], "places": []}
    image.save(picture)
    for k in range(int(frames)):
        seen = replace(camera, position=(0.02 * k, 0.01 * k, 0))
        start = time.perf_counter()
        renderer.look(seen).render()
        seconds["camera"].append(time.perf_counter() - start)
    rng = np.random.default_rng(3)
    for _ in range(int(frames)):
        centers = given["centers"] + rng.normal(0, 1e-3, given["centers"].shape)
        start = time.perf_counter()
        renderer.update(centers).render(image)
        seconds["places"].append(time.perf_counter() - start)
    print(json.dumps(seconds))


if __name__ == "__main__":
    main(*sys.argv[1:])
