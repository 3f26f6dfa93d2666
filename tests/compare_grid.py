"""A grid of wrong pictures, and what `cltrace.compare` says of each: mistakes of wrong_texts, scenes, sizes, makers.

    python tests/compare_grid.py [SHARE] [WORD] [SEED]

prints how many mistakes are named rightly, falsely and not at all, and how long that takes. SHARE: of the grid, such as
30 for a thirtieth; WORD: only cases that contain it; SEED: which ones, 0 being those that
tests/students/test_compare_grid.py asks for. A seed that nobody has looked at yet says how good the comparison is.
"""

from __future__ import annotations

import shutil
import sys
import time
import types
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import wrong_scenes as parts
from lxml import etree
from wrong_texts import PAIRS, PICTURE, READING, TUTORIAL, VECTOR, Bytes, Texts

import cltrace

ROOT = Path(__file__).parent.parent
MAKERS = {"tutorial": (ROOT / "scenes/tutorial.py", TUTORIAL), "vector": (ROOT / "tests/vector_tracer.py", VECTOR)}
OURS = (
    "step1-ambient", "step2-parallel", "step3-shadows", "step4-meshes", "step5-mirror", "step6-textures",
    "step7-glass", "step8-cone", "transforms", "spot", "tall", "bounces", "globe",
)  # fmt: skip
SMALL = [make.__name__ for make in parts.SCENES]
RANDOM = [f"random-{seed}" for seed in range(4)]
SIZES = ((48, 36), (33, 44), (64, 40))
FEWEST = 8  # pixels that a mistake has to change for its name to be asked for


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
    size: tuple[int, int]
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
    """A fixed part of the grid, in which every mistake has its turn."""
    every = list(cases())
    return [every[i] for i in sorted(np.random.default_rng(seed).permutation(len(every))[: len(every) // share])]


class Grid:
    """The files of all scenes, in a folder of their own, and the pictures that tracers make of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for path in (ROOT / "scenes").iterdir():
            if path.is_dir() and path.name in ("meshes", "textures"):
                shutil.copytree(path, folder / path.name)
        self.paths = {name: ROOT / "scenes" / f"{name}.xml" for name in OURS}
        self.paths |= parts.scenes(folder)
        for seed, name in enumerate(RANDOM):
            self.paths[name] = folder / f"{name}.xml"
            self.paths[name].write_text(random_text(seed))
        self.scene = cache(self._scene)

    def _scene(self, name: str, size: tuple[int, int], edits: tuple[str, ...] = ()) -> cltrace.Scene:
        path = self.paths[name]
        if edits:
            tree = etree.parse(str(path), etree.XMLParser(load_dtd=False, no_network=True))
            for edit in edits:
                READING[edit](tree.getroot())
            path = self.folder / "edited.xml"
            tree.write(str(path))
        scene = cltrace.load(path)
        return scene.seen_by(replace(scene.camera, resolution=size))

    def draw(self, case: Case) -> Bytes:
        """The picture of a case, (h, w, 3)."""
        path, texts = MAKERS[case.maker]
        edits = tuple(name for name in case.wrong if name in READING)
        tracer = module(path, tuple(text for name in case.wrong for text in texts.get(name, ())))
        picture = np.asarray(tracer.render(self.scene(case.scene, case.size, edits)))
        for name in case.wrong:
            if name in PICTURE and name not in texts:
                picture = PICTURE[name](picture)
        return np.ascontiguousarray(picture)

    def right(self, case: Case) -> Bytes:
        return cltrace.render(self.scene(case.scene, case.size)).rgb8


@cache
def module(path: Path, texts: Texts) -> types.ModuleType:
    """A tracer with some of its texts replaced, each of which must be there."""
    source = path.read_text("utf-8")
    for old, new in texts:
        assert source.count(old) == 1, f"{path.name}: {source.count(old)} times {old}"
        source = source.replace(old, new)
    made = types.ModuleType(f"wrong_{path.stem}")
    sys.modules[made.__name__] = made  # which dataclasses ask for
    exec(compile(source, str(path), "exec"), made.__dict__)
    return made


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
    tolerance = 0 if case.wrong == ("truncated",) else 1
    differ = np.abs(picture.astype(int) - grid.right(case)).max(axis=2) > tolerance
    if case.wrong and differ.sum() < FEWEST:
        return Answer(case, "hidden", "", 0.0)
    for name in case.wrong if len(case.wrong) > 1 else ():  # each has to show beside the other
        other = grid.draw(replace(case, wrong=tuple(other for other in case.wrong if other != name)))
        if (np.abs(picture.astype(int) - other).max(axis=2) > 1).sum() < FEWEST:
            return Answer(case, "hidden", "", 0.0)
    start = time.process_time()
    result = cltrace.compare(grid.scene(case.scene, case.size), picture, tolerance=tolerance)
    seconds = time.process_time() - start
    likely = getattr(result, "likely", None)
    said = " + ".join("|".join((cause.name, *getattr(cause, "rivals", ()))) for cause in result.causes)
    said += f" (likely {likely.name})" if likely else ""
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
                answers.append(asked(grid, case))
                if answers[-1].kind not in ("hidden",):
                    print(
                        answers[-1].kind,
                        *vars(case).values(),
                        answers[-1].said,
                        f"{answers[-1].seconds:.2f}",
                        flush=True,
                    )
    shown = [a for a in answers if a.kind != "hidden"]
    singles = [a for a in shown if len(a.case.wrong) == 1]
    for name, some in (
        ("none", [a for a in shown if not a.case.wrong]),
        ("one", singles),
        ("two", [a for a in shown if len(a.case.wrong) == 2]),
    ):
        counts = Counter(a.kind for a in some)
        print(name, len(some), {kind: f"{n} = {100 * n / len(some):.1f} %" for kind, n in counts.items()})
    times = sorted(a.seconds for a in shown)
    print(f"median {np.median(times):.2f} s, worst {times[-1]:.2f} s, {len(answers) - len(shown)} do not show")


if __name__ == "__main__":
    main(*sys.argv[1:])
