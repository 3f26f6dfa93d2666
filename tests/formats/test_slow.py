"""Scene files that take long, found by a search: what takes longer is changed further. FUZZ=N makes it N times as long.

Left out are rays that split at glass, of which a pixel may take 2^20: the command says after a second that these are
slow, and which number to lower.
"""

from __future__ import annotations

import random
import resource
import sys
import time
from pathlib import Path

import pytest
from fuzzing import FACTOR

import cltrace

SECONDS, MEGABYTES, BYTES = 20.0, 2000, 10**6  # of a processor, of memory, and of a file
# What a scene is made of, and the values that are tried. Lights and places are random, by `seed`.
TRIED: dict[str, tuple[float, ...]] = {
    "spheres": (1, 20, 500, 2000, 4000),
    "spread": (1e-3, 0.1, 1, 3, 30),
    "radius": (1e-3, 0.03, 0.1, 0.5, 1, 10),
    "stretched": (0, 0.5, 1),
    "mirrors": (0, 0.3, 1),
    "bounces": (0, 1, 5, 100),
    "lights": (0, 3, 50, 300),
    "from": (0.1, 1, 6, 100),
    "parallel": (0, 0.5, 1),
    "fov": (5, 20, 80),
    "seed": (1, 2, 3),
}
HEAD = (
    '<scene output_file="a.png"><background_color r="0" g="0" b="0"/><camera><position x="0" y="0" z="5"/>'
    '<lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/><horizontal_fov angle="{fov}"/>'
    '<resolution horizontal="640" vertical="360"/><max_bounces n="{bounces}"/></camera><lights>'
)
BALL = (
    '<sphere radius="{:.3g}"><position x="{:.3g}" y="{:.3g}" z="{:.3g}"/><material_solid><color r="1" g="1" b="1"/>'
    '<phong ka="0" kd="0.7" ks="0.3" exponent="50"/><reflectance r="{}"/><transmittance t="0"/><refraction iof="1"/>'
    "</material_solid>{}</sphere>"
)


def text_of(case: dict[str, float]) -> str:
    """A scene's file, with as many spheres as there is room for."""
    rng = random.Random(case["seed"])

    def place(size: float) -> list[float]:
        return [rng.uniform(-size, size) for _ in range(3)]

    parts = [HEAD.format(**case)]
    for _ in range(int(case["lights"])):
        kind, at = ("parallel", "direction") if rng.random() < case["parallel"] else ("point", "position")
        x, y, z = place(case["from"])
        where = f'<{at} x="{x:.3g}" y="{y:.3g}" z="{z:.3g}"/>'
        parts.append(f'<{kind}_light><color r="0.1" g="0.1" b="0.1"/>{where}</{kind}_light>')
    parts.append("</lights><surfaces>")
    room = BYTES - 100 - sum(map(len, parts))
    for _ in range(int(case["spheres"])):
        stretch = '<transform><scale x="{:.2g}" y="{:.2g}" z="{:.2g}"/></transform>'.format(
            *(10 ** rng.uniform(-1, 1) for _ in range(3))
        )
        shape = stretch if rng.random() < case["stretched"] else ""
        radius, mirror = case["radius"] * 10 ** rng.uniform(-0.5, 0.5), int(rng.random() < case["mirrors"])
        parts.append(BALL.format(radius, *place(case["spread"]), mirror, shape))
        room -= len(parts[-1])
        if room < 0:
            parts.pop()
            break
    return "".join([*parts, "</surfaces></scene>"])


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems count memory otherwise")
def test_no_small_file_takes_long(tmp_path: Path) -> None:
    """From reading to the picture, with everything but compiling."""
    rng, path = random.Random(FACTOR), tmp_path / "s.xml"
    worst: dict[str, float] = {name: values[len(values) // 2] for name, values in TRIED.items()}
    longest = 0.0
    for _ in range(6 * FACTOR):
        case = worst | {name: rng.choice(TRIED[name]) for name in rng.sample(sorted(TRIED), 3)}
        path.write_text(text_of(case))
        assert path.stat().st_size <= BYTES
        start = time.process_time()
        image = cltrace.render(cltrace.load(path))
        seconds = time.process_time() - start - image.seconds["build"]
        assert seconds < SECONDS, case
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < MEGABYTES * 1000, case
        if seconds > longest:
            longest, worst = seconds, case
    assert longest > 0.2  # else it has not searched
