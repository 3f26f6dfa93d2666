"""What a user waits for: whole ways to a picture, from the start of a process or from arrays in memory.

python -m cltrace.bench.user ARRAYS.npz PICTURE.png DEVICE is a user's script, which is timed: a picture of arrays.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import cltrace

if TYPE_CHECKING:
    from .tracers import BenchTracer

WAYS = NEW, AGAIN, ARRAYS = ("process to file, nothing compiled", "process to file", "arrays to first picture")
# Who takes a way, the version of a program that is not ours, the way, and what takes it: seconds.
Taker = tuple[str, str, str, Callable[[], float]]


def seconds_of(command: Sequence[str], **environment: str) -> float:
    """How long a program runs. Raises subprocess.CalledProcessError if it fails."""
    start = time.perf_counter()
    subprocess.run(command, capture_output=True, env=os.environ | environment, check=True)
    return time.perf_counter() - start


def takers(scene: cltrace.Scene, device: str, peers: Sequence[BenchTracer], folder: Path) -> Iterator[Taker]:
    """All ways to a picture of the scene. folder: where files may be until the last of them has been taken."""
    arrays, picture = str(folder / "scene.npz"), str(folder / "out.png")
    view = [scene.camera.image_plane()[0], *scene.camera.resolution]
    spheres, colors = scene.spheres, scene.materials["color"][scene.spheres["material"]]
    np.savez(arrays, view=view, centers=spheres["center"], radii=spheres["radius"], colors=colors)
    script = [sys.executable, "-m", "cltrace.bench.user", arrays, picture, device]

    def anew() -> float:
        with tempfile.TemporaryDirectory() as empty:
            return seconds_of(script, POCL_CACHE_DIR=empty, XDG_CACHE_HOME=empty)

    def inner() -> float:
        return float(subprocess.run(script, capture_output=True, text=True, check=True).stdout)

    yield "cltrace, arrays", "", NEW, anew
    yield "cltrace, arrays", "", AGAIN, lambda: seconds_of(script)
    yield "cltrace, arrays", "", ARRAYS, inner
    for peer in peers:
        if not peer.variant and peer.task == "frame" and not peer.refuses(scene):
            if own := peer.command(scene):
                yield peer.name, peer.version, AGAIN, lambda own=own: seconds_of(own)  # type: ignore[misc]
            yield peer.name, peer.version, ARRAYS, lambda peer=peer: peer.run(scene, 1).whole  # type: ignore[misc]


def main(file: str, picture: str, spec: str) -> None:
    """The user's script. Prints how many seconds its picture took."""
    with np.load(file) as arrays:
        given = dict(arrays)
    tan, width, height = given.pop("view").tolist()
    fov, size = float(np.degrees(np.arctan(tan))), (int(width), int(height))
    start = time.perf_counter()
    camera = cltrace.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), fov, size, square_pixels=True)
    lights = [cltrace.ambient_light((1, 1, 1)), cltrace.point_light((5, 8, 2))]
    scene = cltrace.Scene.from_spheres(camera, lights, **given, ka=0.1, background=(0.1, 0.1, 0.2))
    image = cltrace.Renderer(scene, spec).render()
    print(time.perf_counter() - start)
    image.save(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
