"""What must hold for any scene, tried by hypothesis. What it once found stays as a literal example."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from fuzzing import examples
from hypothesis import example, given
from hypothesis import strategies as st
from stress_cases import picture

import cltrace
from cltrace import Camera, Scene
from cltrace.base.arithmetic import two_sum
from cltrace.plan.rounding import square_excess
from cltrace.reference import world_of
from cltrace.reference.trace import primary_ray, trace

PLAIN = examples(25)
# float32's whole range, and 0, at all sizes alike.
numbers = st.one_of(st.just(0.0), st.builds(math.copysign, st.floats(2.0**-149, 3.4e38), st.sampled_from([1.0, -1.0])))
moderate = st.floats(-1e4, 1e4).map(lambda x: float(np.float32(x)))
positive = st.floats(2.0**-149, 3.4e38)


@st.composite
def scenes(draw: st.DrawFn, coordinate: st.SearchStrategy[float], radius: st.SearchStrategy[float]) -> Scene:
    """Up to 6 spheres and up to 2 lights of any kind, seen along -z in a picture of 9x7 pixels."""
    vector = st.tuples(coordinate, coordinate, coordinate)
    n = draw(st.integers(1, 6))
    spheres = [draw(vector) for _ in range(n)], [draw(radius) for _ in range(n)]
    lights = [cltrace.ambient_light((0.5, 0.5, 0.5))]
    for _ in range(draw(st.integers(0, 2))):
        place, direction = draw(vector), draw(vector.filter(any))
        spot = cltrace.spot_light(place, direction, 10, draw(st.sampled_from([10, 60, 180])))
        lights.append(draw(st.sampled_from([cltrace.parallel_light(direction), cltrace.point_light(place), spot])))
    eye = draw(vector)
    fov = draw(st.sampled_from([1e-3, 1.0, 30.0, 60.0, 89.9]))
    # Far from 0, eye - 1 may be eye: look at a point as far below as the eye is out.
    at = (eye[0], eye[1], eye[2] - max(1.0, abs(eye[2])))
    try:
        camera = Camera(eye, at, horizontal_fov=fov, resolution=(9, 7), square_pixels=False)
    except ValueError:
        camera = Camera(horizontal_fov=fov, resolution=(9, 7), square_pixels=False)
    return Scene.from_spheres(
        camera, lights, *spheres, ka=0.1, ks=0.25, exponent=draw(st.sampled_from([0, 0.5, 50, 1e6]))
    )


@PLAIN
@given(scenes(numbers, positive))
def test_no_scene_has_a_nan_anywhere(scene: Scene) -> None:
    for precision in ("accurate", "single", "double"):
        image = picture(scene, None, precision)
        assert not np.isnan(image.color).any()
        assert not np.isnan(image.depth).any()
        assert not np.isnan(image.normal).any()


@PLAIN
@given(scenes(moderate, st.floats(1e-3, 1e4)))
def test_the_reference_and_the_kernel_agree(scene: Scene) -> None:
    world = world_of(scene)
    for precision in ("accurate", "double"):
        image = picture(scene, None, precision)
        for i in range(0, 63, 2):
            color, at = trace(world, primary_ray(scene.camera, i % 9, i // 9))
            assert image.id.ravel()[i] == (at.index if at else -1)
            levels = [cltrace.reference.byte_of(c) for c in color]
            assert np.abs(image.rgb8.reshape(-1, 3)[i].astype(int) - levels).max() <= 1


@PLAIN
@given(scenes(moderate, st.floats(1e-3, 1e4)), st.integers(-60, 60))
def test_a_power_of_two_changes_no_bit(scene: Scene, k: int) -> None:
    camera = scene.camera
    eye, at = (tuple(math.ldexp(x, k) for x in p) for p in (camera.position, camera.lookat))
    spheres, lights = scene.spheres.copy(), scene.lights.copy()
    for array, name in ((spheres, "center"), (spheres, "radius"), (lights, "position")):
        array[name] = np.ldexp(array[name], k)
    try:
        small = replace(camera, position=eye, lookat=at)
        scaled = Scene(small, lights, spheres, scene.materials, scene.background)
    except ValueError:
        return  # out of float32's range
    for precision in ("accurate", "single", "double"):
        one, two = (picture(s, None, precision) for s in (scene, scaled))
        assert np.array_equal(one.id, two.id)
        assert np.array_equal(one.color, two.color)
        if precision != "single":
            assert np.array_equal(np.ldexp(one.depth, k), two.depth)


@PLAIN
@given(scenes(moderate, st.floats(1e-3, 1e4)), st.permutations(range(6)))
def test_the_order_of_spheres_changes_only_their_numbers(scene: Scene, numbers: list[int]) -> None:
    order = [i for i in numbers if i < len(scene.spheres)]
    other = Scene(scene.camera, scene.lights, scene.spheres[order], scene.materials, scene.background)
    one, two = (picture(s) for s in (scene, other))
    assert np.array_equal(one.depth, two.depth)
    assert np.array_equal(one.id >= 0, two.id >= 0)
    # Where another sphere is named, the two are equally near, and each picture names the first of its own.
    named = np.where(two.id >= 0, np.array(order)[two.id], -1)
    tied = one.id != named
    assert (one.id[tied] < named[tied]).all()


@PLAIN
@given(st.lists(st.tuples(numbers, numbers, numbers, positive), min_size=1, max_size=8), st.tuples(moderate, moderate))
@example([(0.0, 0.0, 1.0, 1.0)], (0.0, 0.0))
@example([(3e38, 1e-40, 0.0, 3e38)], (1.0, 0.0))
@example([(3e4, 4e4, 0.5, 5e4)], (1e-13, 0.0))
@example([(0.0, 1.182595400475193e38, 2.7434398881631518e38, 2.9798931274642443e38)], (0.0, 0.0))
def test_powers_are_rounded_once(spheres: list[tuple[float, float, float, float]], eye: tuple[float, float]) -> None:
    """|C - O|^2 - r^2 against rational arithmetic, and exact in sign."""
    data = np.array(spheres)
    origin = np.array([*eye, 0.5])
    hi, lo = two_sum(data[:, :3], -origin)
    c, rest = square_excess(hi, lo, data[:, 3])
    for row, got, more in zip(spheres, c.tolist(), rest.tolist(), strict=True):
        exact = sum((Fraction(x) - Fraction(o)) ** 2 for x, o in zip(row[:3], origin.tolist(), strict=True))
        exact -= Fraction(row[3]) ** 2
        assert (got > 0) - (got < 0) == (exact > 0) - (exact < 0)
        assert abs(Fraction(got) - exact) <= abs(exact) * Fraction(1, 2**52)
        assert abs(Fraction(got) + Fraction(more) - exact) <= abs(exact) * Fraction(1, 2**99)


@pytest.mark.slow
def test_the_number_of_threads_changes_no_bit() -> None:
    """PoCL takes its number of threads from the environment, once for a process."""
    script = (
        "import sys, hashlib; sys.path.insert(0, sys.argv[1]); from random_scenes import random_scene\n"
        "from stress_cases import picture\n"
        "for s in range(6):\n"
        "    i = picture(random_scene(s))\n"
        "    arrays = (i.rgb8, i.color, i.id, i.depth)\n"
        "    print(hashlib.sha256(b''.join(a.tobytes() for a in arrays)).hexdigest())"
    )
    folder = str(Path(__file__).parents[1])
    results = set()
    for threads in ("1", "2", "7"):
        env = os.environ | {"POCL_MAX_PTHREAD_COUNT": threads}
        done = subprocess.run([sys.executable, "-c", script, folder], env=env, capture_output=True, check=True)
        results.add(done.stdout)
    assert len(results) == 1
