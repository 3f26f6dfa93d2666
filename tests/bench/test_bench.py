"""The benchmark: its baseline and its truth are right, its errors are what they say, and the command does its work."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import stress_cases
from hostile.sphere_scenes import balls, everything, looking

import cltrace
from cltrace import Scene, parallel_light, point_light, spot_light
from cltrace.bench import errors, scenes, tracers, truth
from cltrace.bench.peers import povray
from cltrace.bench.textbook import Textbook
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT

SCENES = Path(__file__).parents[2] / "scenes"
SMALL = (48, 27)
# Every kind of light, with the one that is there.
MORE = (
    parallel_light((-1, -2, -1), (0.4, 0.4, 0.3)),
    point_light((-5, 8, 2), (0, 0, 0)),
    spot_light((-4, 5, 0), (4, -5, -7), 10, 25, (0.6, 0.3, 0.2)),
)


def run(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cltrace.bench", *map(str, arguments)]
    env = {k: v for k, v in os.environ.items() if k != "PYOPENCL_CTX"} | environment
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=240, check=False)


def every_pixel(scene: Scene) -> np.ndarray:
    return np.arange(math.prod(scene.camera.resolution))


# ---------------------------------------------------------------------------------------------------------- the parts


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first", "three-lights", "spot-colours", "inside", "transforms"])
def test_the_textbook_draws_what_cltrace_draws(device: Device, name: str) -> None:
    scene = cltrace.load(SCENES / f"{name}.xml")
    scene = replace(scene, camera=replace(scene.camera, resolution=(160, 120)))
    image = Textbook(scene, device).render("rgb8", "color", "normal", "depth", "id")
    want = cltrace.render(scene, device, outputs=("rgb8", "normal", "depth", "id"))
    assert (image.id != want.id).mean() < 1e-3
    assert (np.abs(image.rgb8.astype(int) - want.rgb8).max(axis=-1) > 1).mean() < 5e-3
    hit = (image.id == want.id) & (want.id >= 0)
    assert np.abs(image.depth[hit] / want.depth[hit] - 1).max() < 1e-3
    assert ((image.normal * want.normal).sum(axis=-1)[hit] > 0.99).all()


@pytest.mark.slow
def test_the_truth_of_a_thinned_scene_is_that_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    for scene in (scenes.cloud(60, SMALL), scenes.cloud(40, SMALL, *MORE), everything()):
        pixels = every_pixel(scene)[::7]
        monkeypatch.setattr(truth, "MANY", 1000)
        whole = truth.answer(scene, pixels)
        monkeypatch.setattr(truth, "MANY", 0)
        thinned = truth.answer(scene, pixels)
        assert len(set(whole.id.tolist())) > 5
        for name in whole.__dict__:
            assert np.array_equal(getattr(whole, name), getattr(thinned, name)), name


def test_the_truth_is_what_the_oracle_says() -> None:
    scene = scenes.cloud(16, SMALL, *MORE)
    found, exact = truth.answer(scene, every_pixel(scene)), stress_cases.hits(scene)
    assert (found.id == exact.index).all()
    hit = np.flatnonzero(exact.index >= 0)
    assert errors.ulps(found.depth[hit], exact.depth[hit]).max() <= 0.501
    lit, _ = stress_cases.reached(scene, exact, hit)
    shines = found.light[hit] > 0
    assert (found.lit[hit] == lit & shines).all()
    # There is something to compare: of each light that shines, lit and dark pixels, and one light that is off.
    assert found.lit.any(axis=0).all()
    assert not found.lit.all(axis=0).any()


@pytest.mark.slow
def test_means_of_some_rows(any_device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are those of all rows, and what is not known is not held against a picture."""
    monkeypatch.setattr(truth, "RAYS", 4)
    monkeypatch.setattr(truth, "BAND", 2 * 4 * 4 * SMALL[0])
    scene = scenes.cloud(16, SMALL)
    (every, n), (some, _) = (truth.means(scene, any_device, bands=bands) for bands in (1, 3))
    known = np.arange(SMALL[1]) % 6 < 2
    assert n == 4
    assert np.array_equal(some[known], every[known])
    assert np.isnan(some[~known]).all()
    picture = np.rint(every).astype(np.uint8)
    picture[~known] ^= 255
    assert errors.apart(picture, some)["differ"] == 0
    picture[0, :7] ^= 2
    assert errors.apart(picture, some)["differ"] == 7 / (SMALL[0] * known.sum())
    assert errors.apart(picture, every)["differ"] > 0.6


@pytest.mark.slow
def test_lamps_are_the_lights_one_by_one(any_device: Device) -> None:
    scene = scenes.cloud(16, SMALL, *MORE)
    lights = scene.lights[scene.lights["kind"] != AMBIENT]
    assert [len(lamp.lights) for lamp in truth.lamps(scene)] == [3, 1]
    got = tracers.Product(any_device, "accurate", ("features",)).answer(scene)
    for k in range(len(lights)):
        alone = lights[k : k + 1].copy()
        alone["color"] = 1
        lamp = replace(truth.lamps(scene)[0], lights=alone)
        image = cltrace.Renderer(lamp, any_device, outputs=("color",), keep=("features",)).render()
        assert np.array_equal(got.lit[:, k], image.color.reshape(-1, 3)[:, 0] > 0)


def test_errors_are_found() -> None:
    """Each kind of mistake, planted once, is counted as that and nothing else."""
    scene = scenes.cloud(16, SMALL)
    right = truth.answer(scene, every_pixel(scene))
    hit, miss = np.flatnonzero(right.lit[:, 0] & (right.light[:, 0] > 0.1))[:8], np.flatnonzero(right.id < 0)[:3]
    dark = np.flatnonzero((right.id >= 0) & ~right.lit[:, 0])[:5]
    none = errors.compare(right, right)
    assert (none.wrong_ids, none.normal, none.false_shadows, none.leaks, none.bytes_differ) == (0, 0, 0, 0, 0)
    assert 0 < none.t_ulp <= 0.5
    wrong = truth.Answer(**{name: value.copy() for name, value in right.__dict__.items()})
    wrong.id[hit[0]] = -1
    wrong.id[miss] = 5
    wrong.id[hit[1]] += 1
    wrong.depth[hit[2]] += 8 * np.spacing(np.float32(right.depth[hit[2]]))
    x, y, z = right.normal[hit[3]]
    wrong.normal[hit[3]] = np.array([x, y, z]) + 1e-5 * np.array([y, -x, 0]) / math.hypot(x, y)
    wrong.lit[hit[4:6]] = False
    wrong.lit[dark[:3]] = True
    wrong.color[hit[6]] += 0.25
    wrong.rgb8[hit[6:8], 1] ^= 1
    wrong.rgb8[hit[7], 2] ^= 2
    wrong.color[dark[4], 0] = math.nan
    found = errors.compare(wrong, right)
    assert (found.wrong_ids, found.missed, found.invented) == (5, 1, 3)
    assert found.t_ulp == pytest.approx(8, abs=0.51)
    assert found.normal == pytest.approx(1e-5, rel=1e-3)
    assert (found.false_shadows, found.leaks, found.bytes_differ, found.bytes_off) == (2, 3, 2, 1)
    assert found.color_max == pytest.approx(0.25)
    assert found.not_finite == 1


def test_a_surface_that_barely_faces_a_light_may_be_black() -> None:
    scene = scenes.cloud(16, SMALL)
    right = truth.answer(scene, every_pixel(scene))
    lit = np.flatnonzero(right.lit[:, 0])
    right.light[lit[0]] = 1e-9
    wrong = truth.Answer(**{name: value.copy() for name, value in right.__dict__.items()})
    wrong.lit[lit[0]] = False
    wrong.rgb8[lit[0]] ^= 128
    found = errors.compare(wrong, right)
    assert (found.false_shadows, found.bytes_off, found.bytes_differ) == (0, 0, 1)


def rich() -> Scene:
    """A mesh, an ellipsoid, a texture, glass and a mirror."""
    glass = cltrace.Material(transmittance=0.7, index=1.5)
    tile = cltrace.Mesh([(-2, -1, -5), (2, -1, -5), (0, 2, -6)], [(0, 1, 2)], material=cltrace.Material(texture=GREY))
    more = cltrace.Mesh.of(tile, glass, [(0.5, 0, 0, 0.6), (0, 0.5, 0, 0), (0, 0, 0.5, 0)])
    return Scene.from_spheres(
        looking(tan=0.5, size=SMALL),
        [cltrace.ambient_light(), point_light((1, 5, 1))],
        [(-1, 0, -4), (1, 0.5, -3)],
        0.5,
        reflectance=[0.5, 0],
        transform=[np.eye(3), np.diag([1, 2, 1])],
        background=(1, 1, 1),
        meshes=[tile, more],
    )


GREY = np.full((2, 2), 100, np.uint8)


def test_what_only_cltrace_draws_is_left_to_it(any_device: Device, tmp_path: Path) -> None:
    everything_odd = "meshes", "ellipsoids", "textures", "mirrors", "glass"
    assert tracers.Baseline(any_device).refuses(rich()) == everything_odd
    assert povray.PovRay("povray", tmp_path).refuses(rich()) == ("ellipsoids", "textures", "glass")
    assert tracers.Baseline(any_device).refuses(scenes.cloud(16, SMALL)) == ()
    nothing = tracers.Product(any_device, "accurate", tracers.SKIPS, "no skipping")
    assert nothing.refuses(rich()) == everything_odd
    assert nothing.refuses(scenes.cloud(16, SMALL)) == tracers.Product(any_device, "accurate").refuses(rich()) == ()


def test_lamps_keep_the_shapes() -> None:
    """Of meshes and ellipsoids, too; nothing in the background is lit."""
    scene = rich()
    lamp = truth.lamps(scene)[0]
    assert [mesh.number for mesh in lamp.meshes] == [2, 3]
    assert (lamp.spheres["to_object"] == scene.spheres["to_object"]).all()
    found = truth.answer(scene, every_pixel(scene))
    seen = truth.answer(lamp, every_pixel(scene))
    assert set(found.id.tolist()) == {-1, 0, 1, 2, 3}
    for name in ("id", "depth", "normal", "lit", "light"):
        assert np.array_equal(getattr(found, name), getattr(seen, name)), name
    assert np.array_equal(seen.color[:, 0] > 0, found.lit[:, 0])


def test_too_many_tests_are_refused(any_device: Device) -> None:
    scene = balls(looking(size=(1000, 1000)), [((0, 0, -5), 1)] * 1001)
    assert "too many" in tracers.Baseline(any_device).refuses(scene)[0]
    assert "too many" in tracers.Product(any_device, "single", ("lists",)).refuses(scene)[0]
    assert not tracers.Product(any_device, "single").refuses(scene)


@pytest.mark.slow
def test_the_truth_of_what_is_more_than_spheres() -> None:
    """Bonds and orthographic cameras have the reference's word, not that of the oracle of spheres in perspective."""
    bonds, flat = scenes.sticks(27, SMALL), scenes.orthographic(SMALL)
    assert truth.answer(bonds, every_pixel(bonds)).id.max() >= len(bonds.spheres)
    got = cltrace.render(flat, outputs=("id",)).id.ravel()
    assert (truth.answer(flat, every_pixel(flat)[::9]).id == got[::9]).all()
