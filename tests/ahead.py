"""Where Embree was ahead: few pixels of many spheres, mirrors in meshes, lamps down a tunnel, first pictures of meshes.

.venv/bin/python tests/ahead.py [ROW ...] prints a line for each row whose name begins with one of these words, of all
rows without any. A number is clock time in times of Embree 3's, with trees of high quality: of a frame, of what a new
camera takes before its frame (look), of the first picture from arrays, and of that with a tree of medium quality. Each
is the median of ROUNDS rounds in turns, of which each takes the best of its own. It needs g++ and Embree 3 with its
headers (Debian: libembree-dev), and all of the machine's processors.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from smooth import HD, balls, grid, shell

import cltrace
from cltrace.bench import peers
from cltrace.bench.scenes import bowl, cloud, hills, meshed, scattered
from cltrace.scene import Scene

ROUNDS, BEST = 3, 3
SMALL, CROP, LAMPS = (160, 90), 64, (640, 360)
MILLION = 1_000_000
# How wide the picture of cloud()'s camera is at distance 1.
WIDE = 2 * 0.6
Reals = NDArray[np.float64]


def row() -> Scene:
    """All on one line across the picture."""
    x = np.random.default_rng(11).uniform(-6, 6, MILLION)
    return balls(np.column_stack([x, np.full_like(x, 0.03), np.full_like(x, -10)]), 0.03)


def away() -> Scene:
    """All on one line that leads away from the eye, to the right of its axis."""
    z = np.random.default_rng(12).uniform(-40, -2, MILLION)
    return balls(np.column_stack([np.full_like(z, 0.3), np.zeros_like(z), z]), 0.03)


def galaxy() -> Scene:
    """A flat cloud, dense in the middle, seen at a slant."""
    random = np.random.default_rng(13)
    r, turn, up = random.exponential(1.5, MILLION), random.uniform(0, 2 * math.pi, MILLION), random.normal(size=MILLION)
    flat = np.column_stack([r * np.cos(turn), 0.1 * up, r * np.sin(turn)])
    tilt = np.array([(1, 0, 0), (0, 0.8, 0.6), (0, -0.6, 0.8)])
    return balls(flat @ tilt + (0, 0, -9), 0.01)


def tiny() -> Scene:
    """Nearly all between the middles of a small picture's pixels."""
    return balls(np.random.default_rng(14).uniform((-3, -3, -10), (3, 3, -4), (MILLION, 3)), 1e-3)


CROWDS: dict[str, Callable[[], Scene]] = {
    "shell": lambda: shell(MILLION),
    "grid": lambda: grid(MILLION),
    "box": lambda: cloud(MILLION, HD),
    "row": row,
    "away": away,
    "galaxy": galaxy,
    "tiny": tiny,
}


def small(scene: Scene) -> Scene:
    return scene.seen_by(cltrace.Camera((0, 0, 0), (0, 0, -1), horizontal_fov=FOV, resolution=SMALL))


def middle(scene: Scene) -> Scene:
    """What a crop in the middle of the whole picture shows, as a picture of its own."""
    fov = 2 * math.degrees(math.atan(WIDE / 2 * CROP / HD[0]))
    return scene.seen_by(cltrace.Camera((0, 0, 0), (0, 0, -1), horizontal_fov=fov, resolution=(CROP, CROP)))


FOV = 2 * math.degrees(math.atan(WIDE / 2))
BOX = tuple((side - CROP) // 2 for side in HD)
PART = {"crop": (*BOX, BOX[0] + CROP, BOX[1] + CROP)}


def room(faces: int) -> tuple[Reals, NDArray[np.int64], None]:
    """A box around the eye with smaller ones in it, of about so many triangles, in flat pieces."""
    random = np.random.default_rng(15)
    unit = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    halves = [half for a, b, c, d in sides for half in ((a, b, c), (a, c, d))]
    boxes = [unit * (4, 3, 9) + (0, 0, -6)]
    for _ in range(faces // 12 - 1):
        boxes.append(unit * random.uniform(0.1, 0.4, 3) + random.uniform((-3.5, -2.5, -13), (3.5, 2.5, -4)))
    corners = np.concatenate([np.array(halves) + 8 * k for k in range(len(boxes))])
    return np.concatenate(boxes), corners, None


def mirrored(shape: tuple[Reals, NDArray[np.int64], Reals | None]) -> Scene:
    """The mesh mirrors 0.4 of the light, at most three times."""
    vertices, faces, normals = shape
    look = cltrace.Material((0.8, 0.6, 0.4), ka=0.1, kd=0.7, ks=0.4, exponent=50, reflectance=0.4)
    mesh = cltrace.Mesh(vertices.astype("f4"), faces, normals, material=look)
    eye = cltrace.Camera((0, 0, 0), (0, 0, -1), horizontal_fov=FOV, resolution=LAMPS, max_bounces=3)
    lights = [cltrace.ambient_light((1, 1, 1)), cltrace.point_light((0, 2, -3) if normals is None else (5, 8, 2))]
    return Scene.from_meshes(eye, lights, [mesh], background=(0.1, 0.1, 0.2))


def tunnel(count: int, length: float, radius: float) -> Scene:
    """A hundred lamps in a tunnel that the eye looks down, whose wall is of so many balls."""
    random = np.random.default_rng(16)
    angle, z = random.uniform(0, 2 * math.pi, count), random.uniform(-length, 0, count)
    centers = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    size = 1.2 * math.sqrt(math.pi * 2 * radius * length / count) / 2
    lamps = [
        cltrace.point_light((*random.uniform(-0.5, 0.5, 2) * radius, -k * length / 100), (0.05,) * 3)
        for k in range(100)
    ]
    colors = random.uniform(0.05, 1, (count, 3))
    eye = cltrace.Camera((0, 0, -0.5), (0, 0, -1), horizontal_fov=FOV, resolution=LAMPS)
    return Scene.from_spheres(eye, [cltrace.ambient_light(), *lamps], centers.astype("f4").astype("f8"), size, colors)


def best(measured: Callable[[], object], before: Callable[[], object] = tuple) -> float:
    """Seconds, the least of a few times; before: what comes before each of them and does not count."""
    times = []
    for _ in range(BEST):
        before()
        start = time.perf_counter()
        measured()
        times.append(time.perf_counter() - start)
    return min(times)


class Rival:
    """Embree with trees of high quality, and of medium quality."""

    def __init__(self, folder: Path) -> None:
        self._high = peers.embree_tracers(folder)[0]
        source = Path(peers.__file__).with_name("embree.cpp").read_text()
        changed = folder / "medium.cpp"
        changed.write_text(source.replace("RTC_BUILD_QUALITY_HIGH", "RTC_BUILD_QUALITY_MEDIUM"))
        program = str(folder / "medium")
        peers.call(["g++", *peers.BUILD, str(changed), "-o", program, "-lembree3", "-lpthread"])
        self._medium = peers.Embree(program, folder, self._high.version)

    def times(self, scene: Scene, medium: bool = False) -> tuple[float, float]:
        """Seconds of a frame, and of a tree and a frame."""
        tracer = self._medium if medium else self._high
        runs = [tracer.run(scene, BEST) for _ in range(BEST)]
        frame = min(min(run.frames) for run in runs)
        return frame, min(run.whole for run in runs)


class Ours:
    """A scene, which is made anew for each first picture, and how it is drawn."""

    def __init__(self, make: Callable[[], Scene], how: dict[str, Any]) -> None:
        self._make, self._how = make, how
        self.scene = make()
        self._draw()

    def _anew(self) -> None:
        self.scene = self._make()

    def _draw(self) -> cltrace.Renderer:
        renderer = cltrace.Renderer(self.scene, **self._how)
        renderer.render()
        return renderer

    def first(self) -> float:
        return best(self._draw, self._anew)

    def frame_and_look(self) -> tuple[float, float]:
        """Of the third camera and later ones, each at another place."""
        renderer, eye = self._draw(), self.scene.camera
        frame = best(renderer.render)
        places = iter(range(1, 2 * BEST))

        def look() -> cltrace.Renderer:
            return renderer.look(replace(eye, position=(1e-3 * next(places), 0, 0)))

        for _ in range(2):
            look().render()
        return min(frame, best(renderer.render)), best(look)


def ratios(rival: Rival, ours: Ours, seen: Scene, medium: bool) -> dict[str, float]:
    """Of one scene; seen: what Embree draws."""
    found: dict[str, list[float]] = {"frame": [], "look": [], "first": [], "first, of medium": []}
    for _ in range(ROUNDS):
        frame, whole = rival.times(seen)
        drawn, look = ours.frame_and_look()
        first = ours.first()
        for name, value in zip(found, (drawn / frame, look / frame, first / whole), strict=False):
            found[name].append(value)
        if medium:
            found["first, of medium"].append(first / rival.times(seen, medium=True)[1])
    return {name: float(np.median(values)) for name, values in found.items() if values}


Row = tuple[Callable[[], Scene], Callable[[Scene], Scene], bool, dict[str, Any]]


def rows() -> dict[str, Row]:
    def itself(scene: Scene) -> Scene:
        return scene

    table: dict[str, Row] = {}
    for name, make in CROWDS.items():
        table[f"small {name}"] = (lambda make=make: small(make())), itself, False, {}
    for name, make in CROWDS.items():
        table[f"crop {name}"] = make, middle, False, PART
    shapes = {"room 300": lambda: room(300), "room 20": lambda: room(24)}
    shapes |= {f"{of.__name__} {n}": (lambda of=of, n=n: of(n)) for of in (hills, bowl) for n in (1000, 100_000)}
    for name, shape in shapes.items():
        table[f"mirrors {name}"] = (lambda shape=shape: mirrored(shape())), itself, False, {}
    for n in (20_000, 100_000):
        for length, radius in ((60, 2), (100, 3)):
            table[f"lamps {n} {length}"] = (lambda a=(n, length, radius): tunnel(*a)), itself, False, {}
    for of in (hills, bowl):
        for n in (1000, 3000, 30_000, 200_000, MILLION):
            table[f"mesh {of.__name__} {n}"] = (lambda of=of, n=n: meshed(HD, of(n))), itself, True, {}
    table["mesh needles 30000"] = (lambda: meshed(HD, scattered(30_000, 0.03))), itself, True, {}
    for name, make in {"shell": lambda: shell(10 * MILLION), "box": lambda: cloud(10 * MILLION, HD)}.items():
        table[f"ten million, {name}"] = make, itself, False, {}
    return table


def main(words: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        rival = Rival(Path(folder))
        for name, (make, seen, medium, how) in rows().items():
            if not words or any(name.startswith(word) for word in words):
                ours = Ours(make, how)
                told = ratios(rival, ours, seen(ours.scene), medium)
                print(f"| {name} |", " | ".join(f"{what} {value:.3g}" for what, value in told.items()), "|", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
