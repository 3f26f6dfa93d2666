"""What smooth pictures cost and are off by: the table of docs/speed.md.

.venv/bin/python tests/smooth.py [N] [SCENE ...] prints it, of all scenes where none are named. N: how many
samples pixels have. A row is how many times as long as one ray a pixel the picture takes, in processor time, the median
of rounds in turns; what colours are off by, root mean square, in levels of 255, in the 128x72 pixels with the most
edges, against TRUTH x TRUTH rays a pixel; and the shares of colours off by more than 4 levels, and of pixels within
`error`. The truth of a scene takes minutes. It is kept where SMOOTH_TRUTHS names a folder.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cltrace
import cltrace.scene.camera
from cltrace.bench.scenes import WHITE_LIGHTS, cloud, hills, meshed
from cltrace.scene import Scene

SCENES = Path(__file__).parents[1] / "scenes"
HD, CROP, TRUTH, ROUNDS = (1920, 1080), (128, 72), 64, 5
Colors = NDArray[np.float64]


def shell(count: int) -> Scene:
    """Balls all over a sphere."""
    random = np.random.default_rng(3)
    out = random.normal(size=(count, 3))
    centers = 2.2 * out / np.linalg.norm(out, axis=1)[:, None] + (0, 0, -6)
    return balls(centers, 1.3 * (8 / count) ** 0.5)


def grid(count: int) -> Scene:
    side = round(count ** (1 / 3))
    places = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
    return balls(places * (6 / side) + (-3, -3, -10), 2.4 / side)


def balls(centers: Colors, radius: float) -> Scene:
    colors = np.random.default_rng(4).uniform(0.05, 1, (len(centers), 3))
    return Scene.from_spheres(
        cloud(10, HD).camera, list(WHITE_LIGHTS), centers, radius, colors, ka=0.1, background=(0.1, 0.1, 0.2)
    )


def parallel(scene: Scene) -> Scene:
    """The same without perspective."""
    eye = cltrace.Orthographic((0, 0, 0), (0, 0, -1), (0, 1, 0), height=5, resolution=scene.camera.resolution)
    return scene.seen_by(eye)


LARGE: dict[str, Callable[[], Scene]] = {
    "box of 1e5": lambda: cloud(100_000, HD),
    "box of 1e5, parallel": lambda: parallel(cloud(100_000, HD)),
    "shell of 1e5": lambda: shell(100_000),
    "grid of 1e5": lambda: grid(100_000),
    "box of 1e6": lambda: cloud(1_000_000, HD),
    "shell of 1e6": lambda: shell(1_000_000),
    "grid of 1e6": lambda: grid(1_000_000),
    "terrain of 1e6": lambda: meshed(HD, hills(1_000_000)),
    "sky over 2e4": lambda: cloud(20_000, HD).lit_by([cltrace.sky_light(directions=64)]),
}


def scene_of(name: str) -> Scene:
    return LARGE[name]() if name in LARGE else cltrace.load(SCENES / f"{name}.xml")


def times_as_long(scene: Scene, how: dict[str, Any]) -> float:
    """The median of rounds, in which both renderers draw for a tenth of a second each; the first two do not count."""
    renderers = cltrace.Renderer(scene), cltrace.Renderer(scene, **how)
    ratios = []
    for _ in range(ROUNDS + 2):
        each = []
        for renderer in renderers:
            frames, start = 0, time.process_time()
            while not frames or time.process_time() - start < 0.1:
                renderer.render()
                frames += 1
            each.append((time.process_time() - start) / frames)
        ratios.append(each[1] / each[0])
    return float(np.median(ratios[2:]))


def where_edges_are(color: Colors) -> tuple[int, int, int, int]:
    """The crop of a picture, levels of 255, in which most neighbours differ by more than 8 of them."""
    steps = np.zeros(color[..., 0].shape, int)
    for axis in (0, 1):
        far = np.abs(np.diff(color, axis=axis)).max(axis=2) > 8
        steps[tuple(slice(0, length) for length in far.shape)] |= far
    sums = np.pad(steps, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    (w, h), height, width = CROP, *color.shape[:2]
    most = sums[h:, w:] - sums[: height + 1 - h, w:] - sums[h:, : width + 1 - w]
    most += sums[: height + 1 - h, : width + 1 - w]
    y, x = np.unravel_index(most.argmax(), most.shape)
    return int(x), int(y), int(x) + w, int(y) + h


def truth_of(name: str, scene: Scene) -> tuple[tuple[int, int, int, int], Colors]:
    """A crop, and means of min(colour, 1) over TRUTH x TRUTH rays through each of its pixels."""
    kept = Path(os.environ.get("SMOOTH_TRUTHS", os.devnull)) / f"{name}.npz"
    if kept.exists():
        with np.load(kept) as file:
            x0, y0, x1, y1 = map(int, file["crop"])
            return (x0, y0, x1, y1), file["right"]
    crop = where_edges_are(255 * np.minimum(cltrace.render(scene, outputs=("color",)).color, 1))
    width, height = scene.camera.resolution
    finer = scene.seen_by(replace(scene.camera, resolution=(width * TRUTH, height * TRUTH)))
    x0, y0, x1, y1 = (TRUTH * edge for edge in crop)
    part = cltrace.render(finer, outputs=("color",), crop=(x0, y0, x1, y1))
    right = np.minimum(part.color, 1).reshape(CROP[1], TRUTH, CROP[0], TRUTH, 3).mean(axis=(1, 3), dtype=np.float64)
    if kept.parent.is_dir():
        np.savez(kept, crop=crop, right=right)
    return crop, right


def row(name: str, how: dict[str, Any]) -> str:
    scene = scene_of(name)
    ratio = times_as_long(scene, how)
    crop, right = truth_of(name, scene)
    image = cltrace.render(scene, outputs=("color", "error"), crop=crop, **how)
    off = 255 * np.abs(image.color - right)
    error, far = np.sqrt((off**2).mean()), 100 * (off > 4).mean()
    within = 100 * (off.max(axis=2) <= image.error + 0.01).mean()
    return f"| {name} | {ratio:.2f} | {error:.2f} | {far:.1f} % | {within:.1f} % |"


def main(*words: str) -> None:
    # The truth is a part of a picture that is larger than one may ask for.
    vars(cltrace.scene.camera).update(MAX_SIDE=1 << 20, MAX_PIXELS=1 << 40)
    cltrace.run.executor.MAX_SECONDS = 1 << 20
    how: dict[str, Any] = {"antialias": True}
    for word in filter(str.isdigit, words):
        how["samples"] = int(word)
    names = [word for word in words if not word.isdigit()]
    print("| | times as long | error | off by more than 4 levels | within `error` |\n|---|---|---|---|---|")
    for name in names or [*sorted(path.stem for path in SCENES.glob("*.xml")), *LARGE]:
        print(row(name, how), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
