"""Small scene files that take long: each is prepared in seconds, and then drawn in time or refused."""

from __future__ import annotations

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

import cltrace
from cltrace.plan import lists
from cltrace.renderers import renderer
from cltrace.run import executor

# What a file may take of a processor before it is drawn, and in memory, and the limits of seconds here.
PREPARING, MEGABYTES, DRAWING, LISTING = 10.0, 2000, 1, 5
BYTES = 10**6  # of a scene's file, and of its mesh's
SCENE = (
    '<scene output_file="a.png"><background_color r="0" g="0" b="0"/><camera><position x="0" y="0" z="5"/>'
    '<lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/><horizontal_fov angle="20"/>'
    '<resolution horizontal="640" vertical="360"/><max_bounces n="100"/></camera><lights>{}</lights>'
    "<surfaces>{}</surfaces></scene>"
)
SKY = '<sky_light><color r="1" g="1" b="1"/><directions n="1000"/></sky_light>'
RNG = random.Random(1)


def place(size: float) -> str:
    return 'x="{:.3g}" y="{:.3g}" z="{:.3g}"'.format(*(RNG.gauss(0, size / 2) for _ in range(3)))


def lamp() -> str:
    return f'<point_light><color r="0.1" g="0.1" b="0.1"/><position {place(6)}/></point_light>'


def material(r: float = 0, t: float = 0) -> str:
    return (
        '<material_solid><color r="1" g="1" b="1"/><phong ka="0" kd="0.7" ks="0.3" exponent="50"/>'
        f'<reflectance r="{r}"/><transmittance t="{t}"/><refraction iof="1.5"/></material_solid>'
    )


def ball(radius: float, look: str, steps: str = "") -> str:
    return f'<sphere radius="{radius}"><position {place(3)}/>{look}<transform>{steps}</transform></sphere>'


def rod() -> str:
    return f'<cylinder radius="0.3"><start {place(3)}/><end {place(3)}/>{material(0.5)}</cylinder>'


def mesh() -> str:
    return f'<mesh name="m.obj">{material()}<transform><translate {place(3)}/></transform></mesh>'


FLAT = '<scale x="3" y="0.1" z="1"/>'
CASES = {
    "large balls and many lights": (50, [ball(1, material()) for _ in range(2000)]),
    "small balls and more lights": (300, [ball(0.03, material()) for _ in range(2000)]),
    "mirrors and glass": (3, [ball(0.5, material(0.3, 0.6)) for _ in range(500)]),
    "flat ellipsoids": (50, [ball(0.5, material(1), FLAT) for _ in range(1500)]),
    "cylinders": (50, [rod() for _ in range(2000)]),
    "a mesh of large triangles, placed often": (3, [mesh() for _ in range(100)]),
}


def try_case(name: str, path: Path) -> None:
    executor.MAX_SECONDS, lists.MAX_SECONDS = DRAWING, LISTING
    lights, surfaces = CASES[name]
    text = SCENE.format("".join(lamp() for _ in range(lights)) + SKY * (lights < 10), "".join(surfaces))
    corners = "".join(f"v {re.sub('[xyz=]|' + chr(34), '', place(2))}\n" for _ in range(3000))
    faces = "".join(f"f {' '.join(map(str, RNG.sample(range(1, 3001), 3)))}\n" for _ in range(8000))
    path.write_text(text)
    path.with_name("m.obj").write_text(corners + faces)
    assert max(path.stat().st_size, path.with_name("m.obj").stat().st_size) <= BYTES
    start, of = time.process_time(), renderer.Executor.of
    try:
        renderer.Executor.of = Mock(side_effect=KeyError)  # type: ignore[method-assign]
        with pytest.raises(KeyError):
            cltrace.Renderer(cltrace.load(path))
        assert time.process_time() - start < PREPARING
        renderer.Executor.of = of  # type: ignore[method-assign]
        made = cltrace.Renderer(cltrace.load(path))
        start = time.process_time()
        made.render()
    except cltrace.SceneError as error:
        if "--limit pairs=N" not in str(error):
            raise
    except (cltrace.TooSlowError, cltrace.TooManyRaysError):
        pass
    assert time.process_time() - start < max(PREPARING, DRAWING + 4)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1000 < MEGABYTES


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems count memory otherwise")
@pytest.mark.parametrize("name", CASES)
def test_no_small_file_takes_long(name: str, tmp_path: Path) -> None:
    """In a process of its own: the most memory that a process has ever had is not taken back."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        pool.submit(try_case, name, tmp_path / "s.xml").result()
