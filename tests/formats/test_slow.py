"""Scene files that take long, found by a search: what takes longer is changed further. FUZZ=N makes it N times as long.

Each is drawn, or refused by the limit of seconds. That limit is lower here, so that the search goes on to others.
"""

from __future__ import annotations

import contextlib
import gc
import random
import re
import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import Mock

import pytest
from fuzzing import FACTOR

import cltrace
from cltrace.plan import lists
from cltrace.renderers import renderer
from cltrace.run import executor

# What a file may take of a processor before it is drawn, and in memory, and the limit of seconds here.
PREPARING, MEGABYTES, DRAWING, LISTING = 10.0, 2000, 1, 5
# How a message ends that names a limit.
ALLOWS = r"=N or CLTRACE_LIMITS allows more$"
BYTES = 10**6  # of a scene's file, and of its mesh's
# What a scene is made of, and the values that are tried: shares are of the surfaces, or of the lights.
TRIED: dict[str, tuple[float, ...]] = {
    "spheres": (1, 20, 500, 2000, 4000),
    "spread": (1e-3, 0.1, 1, 3, 30),
    "radius": (1e-3, 0.03, 0.1, 0.5, 1, 10),
    "stretched": (0, 0.5, 1),
    "cylinders": (0, 0, 0.5, 1),
    "mirrors": (0, 0.3, 1),
    "glass": (0, 0, 0.3, 1),
    "bounces": (0, 1, 5, 20, 100),
    "lights": (0, 3, 50, 300, 1020),
    "from": (0.1, 1, 6, 100),
    "parallel": (0, 0.5, 1),
    "members": (0, 0, 64, 1000),
    "meshes": (0, 0, 1, 100, 2000),
    "triangles": (3, 100, 1000, 8000, 50_000),
    "corners": (100, 20_000),
    "doubled": (0, 1),
    "fov": (5, 20, 80),
    "antialias": (0, 0, 1),
    "seed": (1, 2, 3),
}
HEAD = (
    '<scene output_file="a.png"><background_color r="0" g="0" b="0"/><camera><position x="0" y="0" z="5"/>'
    '<lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/><horizontal_fov angle="{fov}"/>'
    '<resolution horizontal="640" vertical="360"/><max_bounces n="{bounces}"/></camera><lights>'
)
SKY = '<sky_light><color r="1" g="1" b="1"/><directions n="{}"/></sky_light>'
MATERIAL = (
    '<material_solid><color r="1" g="1" b="1"/><phong ka="0" kd="0.7" ks="0.3" exponent="50"/><reflectance r="{}"/>'
    '<transmittance t="{}"/><refraction iof="1.5"/></material_solid>'
)
Case = dict[str, float]


class Maker:
    """The parts of a scene, all by the same random numbers."""

    def __init__(self, case: Case) -> None:
        self.case, self.rng = case, random.Random(case["seed"])

    def has(self, share: str) -> bool:
        return self.rng.random() < self.case[share]

    def place(self, size: str) -> str:
        """A point within the value `size`, as the attributes of an element."""
        return 'x="{:.3g}" y="{:.3g}" z="{:.3g}"'.format(*(self.rng.gauss(0, self.case[size] / 2) for _ in range(3)))

    def light(self) -> str:
        kind, at = ("parallel", "direction") if self.has("parallel") else ("point", "position")
        return f'<{kind}_light><color r="0.1" g="0.1" b="0.1"/><{at} {self.place("from")}/></{kind}_light>'

    def material(self) -> str:
        return MATERIAL.format(0.3, 0.6) if self.has("glass") else MATERIAL.format(int(self.has("mirrors")), 0)

    def stretch(self) -> str:
        sizes = (10 ** self.rng.uniform(-1, 1) for _ in range(3))
        return '<scale x="{:.2g}" y="{:.2g}" z="{:.2g}"/>'.format(*sizes) if self.has("stretched") else ""

    def surface(self) -> str:
        radius = self.case["radius"] * 10 ** self.rng.uniform(-0.5, 0.5)
        if self.has("cylinders"):
            ends = f"<start {self.place('spread')}/><end {self.place('spread')}/>"
            return f'<cylinder radius="{radius:.3g}">{ends}{self.material()}</cylinder>'
        center, steps = f"<position {self.place('spread')}/>", self.stretch()
        turned = f"<transform>{steps}</transform>" if steps else ""
        return f'<sphere radius="{radius:.3g}">{center}{self.material()}{turned}</sphere>'

    def mesh(self) -> str:
        steps = f"<translate {self.place('spread')}/>{self.stretch()}"
        return f'<mesh name="m.obj">{self.material()}<transform>{steps}</transform></mesh>'

    def obj(self) -> str:
        """Triangles anywhere, each twice where the case says so, as many as there is room for."""
        count = int(self.case["triangles"])
        n = max(3, min(count, int(self.case["corners"])))
        corners = [f"v {self.place('radius').translate(str.maketrans('', '', 'xyz=' + chr(34)))}" for _ in range(n)]
        faces = [f"f {' '.join(map(str, self.rng.sample(range(1, n + 1), 3)))}" for _ in range(count)]
        text = "\n".join([*corners, *faces * (1 + int(self.case["doubled"]))])
        return text if len(text) <= BYTES else text[: text.rindex("\n", 0, BYTES)]

    def scene(self) -> str:
        """A scene's file, with as many surfaces as there is room for."""
        case = self.case
        members = int(case["members"])
        lights = [SKY.format(members)] if members else []
        lights += [self.light() for _ in range(int(min(case["lights"], 1024 - members)))]
        parts = [HEAD.format(fov=case["fov"], bounces=int(case["bounces"])), *lights, "</lights><surfaces>"]
        room = BYTES - 100 - sum(map(len, parts))
        for make, count in ((self.mesh, case["meshes"]), (self.surface, case["spheres"])):
            for _ in range(int(count)):
                part = make()
                room -= len(part)
                if room > 0:
                    parts.append(part)
        return "".join([*parts, "</surfaces></scene>"])


def write(case: Case, path: Path) -> None:
    maker = Maker(case)
    path.write_text(maker.scene())
    path.with_name("m.obj").write_text(maker.obj())
    assert max(path.stat().st_size, path.with_name("m.obj").stat().st_size) <= BYTES


class _PreparedError(Exception):
    pass


def prepared(case: Case, path: Path) -> tuple[float, str]:
    """How long a processor takes for a scene until a kernel is compiled for it, and why it is refused, if it is."""
    gc.collect()  # else what errors and mocks hold of the scene before counts as this one's memory
    start = time.process_time()
    with pytest.MonkeyPatch.context() as patch, contextlib.suppress(_PreparedError):
        patch.setattr(renderer.Executor, "of", Mock(side_effect=_PreparedError))
        try:
            cltrace.Renderer(cltrace.load(path), antialias=bool(case["antialias"]))
        except (cltrace.SceneError, cltrace.TooSlowError) as error:
            return time.process_time() - start, str(error)
    return time.process_time() - start, ""


def drawn(case: Case, path: Path) -> tuple[float, str]:
    """How long it then takes, but for compiling and what other programs take, and why it is refused, if it is."""
    gc.collect()
    made, refused = cltrace.Renderer(cltrace.load(path), antialias=bool(case["antialias"])), ""
    start = time.process_time()
    try:
        made.render()
    except (cltrace.TooSlowError, cltrace.TooManyRaysError) as error:
        refused = str(error)
    return time.process_time() - start, refused


def search(path: Path) -> None:
    """Try scenes, each the one that took longest so far but for three values, with the limit of seconds of here."""
    executor.MAX_SECONDS, lists.MAX_SECONDS = DRAWING, LISTING
    rng, longest = random.Random(FACTOR), 0.0
    worst: Case = {name: values[len(values) // 2] for name, values in TRIED.items()}
    for _ in range(20 * FACTOR):
        case = worst | {name: rng.choice(TRIED[name]) for name in rng.sample(sorted(TRIED), 3)}
        write(case, path)
        seconds, refused = prepared(case, path)
        assert seconds < PREPARING, (case, seconds)
        assert not refused or re.search(f"--limit (pairs|seconds){ALLOWS}", refused), (case, refused)
        if seconds > longest and not refused:
            longest, worst = seconds, case
            seconds, refused = drawn(case, path)
            assert seconds < DRAWING + 4, (case, seconds)
            assert not refused or re.search(f"--limit (rays|seconds){ALLOWS}", refused), (case, refused)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1000
        assert peak < MEGABYTES, (case, peak)
    assert longest > 0.2, longest  # else it has not searched


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems count memory otherwise")
def test_no_small_file_takes_long(tmp_path: Path) -> None:
    """Before it is drawn; and what takes longest there is drawn in time, or refused.

    In a process of its own: the most memory that a process has ever had is not taken back, and the tests before this
    one had up to 0.5 GB of it.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        pool.submit(search, tmp_path / "s.xml").result()
