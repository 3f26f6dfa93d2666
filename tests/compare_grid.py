"""A grid of wrong pictures, and what `cltrace.compare` says of each: mistakes of wrong_tracers, scenes, sizes, makers.

    python tests/compare_grid.py [SHARE] [WORD] [SEED]

prints how many mistakes are named rightly, falsely and not at all, and how long that takes. SHARE: of the grid, such as
30 for a thirtieth; WORD: only cases that contain it; SEED: which ones, 0 being those that
tests/students/test_compare.py asks for. A seed that nobody has looked at yet says how good the comparison is.

A part of the grid is chosen in two steps, so that pictures and kernels are shared. First come rooms, each of one scene,
one size and one maker: as many as are needed for the part to be a third or so of what they have, of scenes that are
drawn by lot, and twice as many of the vector's maker as of the tutorial's, which is slow. Of these, every mistake has
its turn in its share of the rooms.
"""

from __future__ import annotations

import shutil
import sys
import time
import types
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar
from unittest.mock import patch

import numpy as np
import wrong_scenes as parts
from lxml import etree
from wrong_tracers import MAKERS, PAIRS, PICTURE, READING, ROOT, Bytes, tracer

import cltrace
from cltrace import Scene
from cltrace.students.rules import CameraRules, Rules
from cltrace.students.shapes import Floats, Ints
from cltrace.students.tracer import Tracer

OURS = (
    "step1-ambient", "step2-parallel", "step3-shadows", "step4-meshes", "step5-mirror", "step6-textures",
    "step7-glass", "step8-cone", "transforms", "spot", "tall", "bounces", "globe",
)  # fmt: skip
SMALL = [make.__name__ for make in parts.SCENES]
RANDOM = [f"random-{seed}" for seed in range(4)]
SIZES = ((40, 30), (24, 32), (48, 30))
ROOMS = {"tutorial": 120, "vector": 240}  # divided by the share: how many are drawn
FEWEST = 8  # pixels that a mistake has to change for its name to be asked for
PATIENCE = 0.1  # of a picture's pixels, beyond which all of them are traced and kept
Size = tuple[int, int]


def random_text(seed: int) -> str:
    """A scene file of things at random: a floor, balls of all kinds, eggs, gems, and lights of three kinds."""
    rng = np.random.default_rng(seed)

    def three(low: float, high: float) -> tuple[float, float, float]:
        return tuple(rng.uniform(low, high, 3).tolist())

    def look(mirror: float = 0, glass: float = 0) -> str:
        color = ["rug", "globe"][rng.integers(2)] if rng.random() < 0.3 else three(0.1, 1)
        phong = (rng.uniform(0, 0.5), rng.uniform(0.3, 1), rng.uniform(0, 1), float(rng.integers(3, 60)))
        return parts._look(color, phong, mirror, glass, rng.uniform(1.2, 2) if glass else 0)

    def place() -> tuple[float, float, float]:
        x, y, z = three(-2, 2)
        return x, 0.6 * y + 0.6, z

    surfaces = [
        parts._mesh("square", look(), ("translate", 0, -1.2, 0), ("rotateY", rng.uniform(0, 90)), ("scale", 9, 1, 9))
    ]
    for i in range(int(rng.integers(4, 9))):
        mirror, glass = (0.2 + 0.6 * rng.random()) * (i == 1), (0.3 + 0.6 * rng.random()) * (i == 2)
        surfaces.append(parts._sphere(place(), rng.uniform(0.3, 0.9), look(mirror, glass)))
    for _ in range(int(rng.integers(1, 4))):
        turn, scale = ("rotateZ", rng.uniform(-80, 80)), ("scale", *three(0.3, 1.5))
        surfaces.append(parts._sphere((0.2, 0.1, 0), 0.7, look(), ("translate", *place()), turn, scale))
        surfaces.append(parts._mesh("gem", look(), ("translate", *place()), turn, scale))
    lights = [parts._ambient(three(0.2, 0.7)), parts._parallel(three(0.2, 0.6), (rng.uniform(-1, 1), -1.5, -1))]
    lights += [parts._point(three(0.2, 0.7), (rng.uniform(-3, 3), 3.5, rng.uniform(0, 4)))]
    lights += [parts._spot(three(0.3, 0.8), (2, 4, 3), (-2 + rng.uniform(-1, 1), -4, -3), (10, 25))]
    return parts._scene(
        parts._camera((0.4, 1.4, 6), (0, 0.3, 0), 35, (64, 48), int(rng.integers(1, 5))), lights, surfaces
    )


@dataclass(frozen=True)
class Case:
    """One wrong picture: made by whom, of which scene, how large (width, height), with which mistakes."""

    maker: str
    scene: str
    size: Size
    wrong: tuple[str, ...]


def cases() -> Iterator[Case]:
    """The whole grid, always in the same order. No mistake at all is one, too."""
    for maker, (_, texts) in MAKERS.items():
        alone = [*texts, *READING, *PICTURE]
        for wrong in [(), *((name,) for name in alone), *PAIRS]:
            for scene in (*OURS, *SMALL, *RANDOM):
                for size in SIZES:
                    if all(name in alone for name in wrong):
                        yield Case(maker, scene, size, wrong)


def chosen(share: int, seed: int = 0) -> list[Case]:
    """A fixed part of the grid, as is said above."""
    every = list(cases())
    scenes = np.random.default_rng(seed).permutation([*OURS, *SMALL, *RANDOM]).tolist()
    rooms, first = set(), 0
    for maker, count in ROOMS.items():
        for i in range(first, first + min(count // share, len(SIZES) * len(scenes))):
            turn, place = divmod(i, len(scenes))
            rooms.add((maker, scenes[place], SIZES[(turn + place) % len(SIZES)]))
        first += count // share
    some = [case for case in every if (case.maker, case.scene, case.size) in rooms]
    count = len(every) // share
    return [some[i * len(some) // count] for i in range(count)]


class Remembering(Tracer):
    """The comparison's tracer, which keeps what it has traced: many cases of one scene ask for the same pictures."""

    pictures: ClassVar[dict[tuple[Scene, Rules], Remembered]] = {}

    def through(self, pixels: Ints, cameras: Sequence[CameraRules], rules: Rules) -> Floats:
        (width, height), found = self.scene.camera.resolution, []
        for camera in cameras:
            one = replace(rules, camera=camera)
            kept = self.pictures.setdefault((self.scene, one), Remembered())
            kept.asked += len(pixels)
            if kept.colors is None and kept.asked <= PATIENCE * width * height:
                found.append(super().through(pixels, [camera], rules)[0])
                continue
            if kept.colors is None:
                before, self.rays = self.rays, 0
                every = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=2).reshape(-1, 2)
                kept.colors = super().through(every, [camera], rules).reshape(height, width, 3)
                kept.rays, self.rays = self.rays / len(every), before
            self.rays += round(kept.rays * len(pixels))
            found.append(kept.colors[pixels[:, 1], pixels[:, 0]])
        return np.array(found)


@dataclass
class Remembered:
    """A picture: its colours, once enough of its pixels have been asked for, and how many rays a pixel takes."""

    asked: int = 0
    colors: Floats | None = None
    rays: float = 0.0


class Grid:
    """The files of all scenes, in a folder of their own, and the pictures that tracers make of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scene, self.right, self.draw = cache(self._scene), cache(self._right), cache(self._drawn)
        self.hits: dict[tuple[str, Size], dict[object, object]] = {}
        for path in (ROOT / "scenes").iterdir():
            if path.is_dir() and path.name in ("meshes", "textures"):
                shutil.copytree(path, folder / path.name)
        self.paths = {name: ROOT / "scenes" / f"{name}.xml" for name in OURS}
        self.paths |= parts.scenes(folder)
        for seed, name in enumerate(RANDOM):
            self.paths[name] = folder / f"{name}.xml"
            self.paths[name].write_text(random_text(seed))

    def _scene(self, name: str, size: Size | None = None, edits: tuple[str, ...] = ()) -> cltrace.Scene:
        path = self.paths[name]
        if edits:
            tree = etree.parse(str(path), etree.XMLParser(load_dtd=False, no_network=True))
            for edit in edits:
                READING[edit](tree.getroot())
            path = self.folder / "edited.xml"
            tree.write(str(path))
        scene = cltrace.load(path)
        return scene.seen_by(replace(scene.camera, resolution=size)) if size else scene

    def _drawn(self, case: Case) -> Bytes:
        """The picture of a case, (h, w, 3)."""
        path, texts = MAKERS[case.maker]
        written = [name for name in case.wrong if name in PICTURE and name not in texts]
        if written:
            picture = self.draw(replace(case, wrong=tuple(name for name in case.wrong if name not in written)))
            for name in written:
                picture = PICTURE[name](picture)
            return np.ascontiguousarray(picture)
        edits = tuple(name for name in case.wrong if name in READING)
        made = tracer(path, tuple(text for name in case.wrong for text in texts.get(name, ())))
        scene = self.scene(case.scene, case.size, edits)
        if case.maker == "tutorial" and not edits and made.MEETS == tracer(path, ()).MEETS:
            return np.asarray(self._with_hits(made, self.hits.setdefault((case.scene, case.size), {}), scene))
        return np.asarray(made.render(scene))

    def _with_hits(self, made: types.ModuleType, hits: dict[object, object], scene: cltrace.Scene) -> Bytes:
        """The tutorial's picture, of which other mistakes have left known what some rays meet."""
        meets = made.closest_hit

        def closest_hit(surfaces: list[Any], ray: Any) -> Any:
            if surfaces and type(surfaces[0]).__name__ == "Triangle":
                return meets(surfaces, ray)
            if ray not in hits:
                hits[ray] = meets(surfaces, ray)
            return hits[ray]

        with patch.object(made, "closest_hit", closest_hit):
            return np.asarray(made.render(scene))

    def _right(self, scene: str, size: Size) -> Bytes:
        return cltrace.render(self.scene(scene, size)).rgb8


@dataclass(frozen=True)
class Answer:
    """What was said of a case. kind: one of right, either, false, unnamed, hidden (the mistake does not show)."""

    case: Case
    kind: str
    said: str
    seconds: float


def asked(grid: Grid, case: Case) -> Answer:
    try:
        picture = grid.draw(case)
    except cltrace.CltraceError:  # nothing is left of the scene
        return Answer(case, "hidden", "", 0.0)
    tolerance = 0 if case.wrong in (("truncated",), ("truncated/256",)) else 1
    differ = np.abs(picture.astype(int) - grid.right(case.scene, case.size)).max(axis=2) > tolerance
    if case.wrong and differ.sum() < FEWEST:
        return Answer(case, "hidden", "", 0.0)
    for name in case.wrong if len(case.wrong) > 1 else ():  # each has to show beside the other
        other = grid.draw(replace(case, wrong=tuple(other for other in case.wrong if other != name)))
        if (np.abs(picture.astype(int) - other).max(axis=2) > 1).sum() < FEWEST:
            return Answer(case, "hidden", "", 0.0)
    start = time.process_time()
    result = cltrace.compare(grid.scene(case.scene, case.size), picture, tolerance=tolerance)
    seconds = time.process_time() - start
    said = " + ".join("|".join((cause.name, *getattr(cause, "rivals", ()))) for cause in result.causes)
    return Answer(case, kind_of(case, result), said, seconds)


def kind_of(case: Case, result: cltrace.Comparison) -> str:
    """A name is false if none of the mistakes is among it and its rivals."""
    true = {name.split("/")[0] for name in case.wrong}
    if not np.ptp(result.mine, axis=(0, 1)).any():  # it says nothing else, and what is said is true
        true |= {"only-background", "one-colour", "black"}
    named = [(cause.name, *getattr(cause, "rivals", ())) for cause in result.causes]
    if any(not true & set(names) for names in named):
        return "false"
    if len(named) < len(case.wrong) and not true & {"black"}:
        return "partly" if named else "unnamed"
    return "either" if any(len(names) > 1 for names in named) else "right"


def main(share: str = "30", word: str = "", seed: str = "0") -> None:
    answers = []
    with TemporaryDirectory() as folder:
        grid = Grid(Path(folder))
        for case in chosen(int(share), int(seed)):
            if word in repr(case):
                answers.append(answer := asked(grid, case))
                if answer.kind != "hidden":
                    print(answer.kind, *vars(case).values(), answer.said, f"{answer.seconds:.2f}", flush=True)
    shown = [a for a in answers if a.kind != "hidden"]
    for count, name in enumerate(("none", "one", "two")):
        some = [a for a in shown if len(a.case.wrong) == count]
        counts = Counter(a.kind for a in some)
        print(name, len(some), {kind: f"{n} = {100 * n / len(some):.1f} %" for kind, n in counts.items()})
    times = sorted(a.seconds for a in shown)
    print(f"median {np.median(times):.2f} s, worst {times[-1]:.2f} s, {len(answers) - len(shown)} do not show")


if __name__ == "__main__":
    main(*sys.argv[1:])
