"""The benchmark's peers: they draw the scenes that we draw, and what goes wrong with one is one line."""

from __future__ import annotations

import functools
import multiprocessing
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import cltrace
from cltrace import Scene
from cltrace.bench import measure, mitsuba, peers, scenes, tracers, truth
from cltrace.bench.peers import PeerError

SMALL, LARGER = (48, 27), (160, 90)


def written(program: Path, text: str) -> str:
    """The name of a program that holds this text."""
    program.write_text(text)
    program.chmod(0o755)
    return str(program)


def test_a_peer(tmp_path: Path) -> None:
    """A program in Embree's place: what is written for it can be read, and what it writes is taken."""
    program = written(
        tmp_path / "peer",
        f"#!{sys.executable}\n"
        "import struct, sys\n"
        "data = open(sys.argv[1], 'rb').read()\n"
        "w, h, samples, bounces, flat, n, *mesh, materials, lights = struct.unpack('<10i', data[:40])\n"
        "assert (n, materials, lights, samples, flat, *mesh) == (16, 16, 2, 4, 0, 0, 0)\n"
        "assert len(data) == 64 + n * 20 + materials * 40 + lights * 48, len(data)\n"
        "assert struct.unpack('<i3f', data[-48:-32]) == (2, 5, 8, 2)\n"
        "open(sys.argv[3], 'wb').write(bytes(range(3)) * (w * h))\n"
        "way = int(sys.argv[5])\n"
        'print(f\'{{"build": 1.5, "frames": [{[3, 2.5, 4][way]}, {sys.argv[2]}]}}\')\n'
        "sys.exit(sys.argv[4] != '0')\n",
    )
    one = peers.Embree(program, tmp_path, "3", ("samples", "samples", 4))
    scene = scenes.cloud(16, SMALL)
    assert one.refuses(scene) == ()
    # The way that was the fastest is the only one from then on.
    for _ in range(2):
        done = one.run(scene, 3)
        assert (done.frames, done.whole) == ([2.5, 3], 4)
    assert done.rgb8.shape == (27, 48, 3)
    assert done.rgb8[5, 7].tolist() == [0, 1, 2]
    with pytest.raises(PeerError, match="peer failed with status 1: AssertionError"):
        one.run(scenes.cloud(17, SMALL), 3)


def test_a_peer_has_its_seconds_for_each_of_two_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first run of one that draws several has to compile, too; it may not hang for all of a hundred frames."""
    monkeypatch.setattr(peers, "PEER_SECONDS", 0.2)
    program = written(tmp_path / "peer", "#!/bin/sh\nexec sleep 60\n")
    for frames, most in ((1, "0.2"), (2, "0.4"), (100, "0.4")):
        with pytest.raises(PeerError, match=f"^peer took more than {most} s$"):
            peers.call([program], frames)


def test_a_peer_of_an_unknown_version_is_a_peer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What has no version is ours."""
    written(tmp_path / "povray", "#!/bin/sh\n")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert {each.version for each in peers.povray_tracers(tmp_path)} == {"unknown"}


def test_peers_that_are_not_installed_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(mitsuba.importlib.util, "find_spec", lambda name: None)
    missing = ["Embree: there is no C++ compiler", "POV-Ray is not installed (Debian: povray)",
               "mitsuba is not installed (pip install mitsuba)"]  # fmt: skip
    assert peers.installed(tmp_path) == ([], missing)


def sleeping(scene: Scene, frames: int, across: int) -> tracers.Run:
    """What a package does that hangs, or fails."""
    if across == 1:
        raise ValueError("no such thing")
    time.sleep(60)
    raise AssertionError


@pytest.mark.slow
def test_a_package_in_a_process_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it raises is raised here, and it may not hang."""
    monkeypatch.setattr(mitsuba, "draw", sleeping)
    monkeypatch.setattr(peers, "PEER_SECONDS", 5)
    with multiprocessing.get_context("spawn").Pool(1, mitsuba.silence) as pool:
        with pytest.raises(ValueError, match="no such thing"):
            mitsuba.Mitsuba(pool, "3", None).run(scenes.cloud(2, SMALL), 1)
        with pytest.raises(PeerError, match=r"^mitsuba took more than 5 s, or has ended$"):
            mitsuba.Mitsuba(pool, "3", 4).run(scenes.cloud(2, SMALL), 1)


def test_triangles_are_those_of_the_scene() -> None:
    """Corners go around counterclockwise from the front, and normals are of length 1, flat where there are none."""
    smooth, flat = (scenes.meshed(SMALL, shape) for shape in (scenes.bowl(200), scenes.scattered(50, 1)))
    both = cltrace.Scene.from_meshes(scenes.looking(SMALL, 1, (1, 2, 3)), [], [
        cltrace.Mesh(scene.meshes[0].vertices, scene.meshes[0].geometry.faces, normals)
        for scene, normals in ((smooth, smooth.meshes[0].geometry.normals), (flat, None))
    ])  # fmt: skip
    places, normals, materials = peers.triangles(both)
    assert len(places) == len(materials) == both.triangles
    assert np.allclose(np.linalg.norm(normals, axis=2), 1)
    assert np.allclose(places[: smooth.triangles].mean(axis=(0, 1)) + (1, 2, 3), (0, 0, -6), atol=0.2)
    outside = ((places - places[: smooth.triangles].mean(axis=(0, 1))) * normals).sum(axis=2)[: smooth.triangles]
    assert (outside > 1.9).all()
    across = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    assert ((across * normals.mean(axis=1)).sum(axis=1) > 0).all()


def test_what_a_scene_has_is_named() -> None:
    assert tracers.has(scenes.sticks(27, SMALL), "cylinders", "glass") == ("cylinders",)
    assert tracers.has(scenes.cloud(3, SMALL, *scenes.OTHER_LIGHTS), tracers.OTHER_LIGHTS)
    assert not tracers.has(scenes.cloud(3, SMALL), "cylinders", "textures", "mirrors", "glass", tracers.OTHER_LIGHTS)
    assert tracers.has(scenes.clear(SMALL, 0.5, 0.1), "mirrors", "glass") == ("mirrors", "glass")
    povray = peers.PovRay("povray", Path(), "3")
    assert povray.refuses(scenes.floor(SMALL)) == ("textures",)


@pytest.fixture(scope="session")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tracers.BenchTracer]:
    """Those that are here, of one ray a pixel."""
    every, _ = peers.installed(tmp_path_factory.mktemp("peers"))
    return {each.name: each for each in every if each.task == "frame" and not each.variant}


WRONG = (scenes.GROUND, scenes.FAR, scenes.SCALE, scenes.MILLION)


@functools.cache
def drawn_by_peers() -> list[scenes.Case]:
    """The frames of the benchmark that single precision can draw, and one with a parallel light beside points alone."""
    found = [case for case in scenes.generated(LARGER) if case.group not in WRONG and case.task == "frame"]
    light = scenes.cloud(100, LARGER, scenes.OTHER_LIGHTS[0])
    return [*found, scenes.Case("100 balls, two lights", scenes.ORDINARY, light)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Embree", "POV-Ray", "Mitsuba 3"])
def test_peers_draw_what_cltrace_draws(found: dict[str, tracers.BenchTracer], name: str) -> None:
    """They are measured with the same picture, in all scenes that single precision can draw: outlines and mirrored ones
    aside, to a level."""
    if name not in found:
        pytest.skip(f"{name} is not installed")
    one, drawn = found[name], 0
    assert one.version
    for case in drawn_by_peers():
        if one.refuses(case.scene):
            continue
        got, want = one.run(case.scene, 1).rgb8, cltrace.render(case.scene).rgb8
        assert (np.abs(got.astype(int) - want).max(axis=2) > 1).mean() < 5e-3, case.name
        assert (want != want[0, 0]).any(axis=2).mean() > 0.02
        drawn += 1
    assert drawn >= 3


@pytest.mark.slow
def test_more_samples_are_nearer_to_the_truth(tmp_path: Path) -> None:
    """Of all that draw with several rays a pixel, ours too."""
    # POV-Ray tells no time of smaller pictures, which take less than a millisecond.
    scene, device = scenes.cloud(60, (80, 45)), cltrace.devices()[0]
    case = scenes.Case("60 balls", scenes.ANTIALIASED, scene, "samples")
    true, drawn = measure.truth_of(case, device), dict[tracers.BenchTracer, bytes]()
    curves: dict[str, dict[int, float]] = {}
    for one in [*tracers.own_tracers(device, ["accurate"], False, False), *peers.installed(tmp_path)[0]]:
        if one.task == "samples" and not one.refuses(scene):
            picture = one.run(scene, 1).rgb8
            drawn[one] = picture.tobytes()
            curves.setdefault(one.name, {})[one.level or 0] = truth.rms(picture, true.levels)
    assert "accurate" in curves
    for name, errors in curves.items():
        assert errors[1] > 5, name
        assert errors[4] < 0.4 * errors[1], name
        assert errors[16] < 1.2, name
    # Also in turns, as rounds are, where several tracers have one program.
    for one, picture in drawn.items():
        assert one.run(scene, 1).rgb8.tobytes() == picture, one.label
