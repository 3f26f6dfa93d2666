"""The benchmark's peers: they draw the scenes that we draw, and what goes wrong with one is one line."""

from __future__ import annotations

import functools
import importlib
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import cltrace
from cltrace import Scene
from cltrace.bench import scenes, tracers
from cltrace.bench.errors import apart
from cltrace.bench.peers import PEERS, PeerError, embree, installed, peer, povray

SMALL, LARGER = (48, 27), (160, 90)


def test_a_peer(tmp_path: Path) -> None:
    """A program in Embree's place: what is written for it can be read, and what it writes is taken."""
    program = tmp_path / "peer"
    program.write_text(
        f"#!{sys.executable}\n"
        "import struct, sys\n"
        "data = open(sys.argv[1], 'rb').read()\n"
        "w, h, samples, bounces, flat, n, *mesh, materials, textures, _, lights = struct.unpack('<14i', data[:56])\n"
        "assert (n, materials, lights, samples, flat, textures, *mesh) == (16, 16, 2, 4, 0, 0, 0, 0, 0, 0)\n"
        "assert len(data) == 112 + n * 20 + materials * 44 + lights * 48, len(data)\n"
        "assert struct.unpack('<i3f', data[-48:-32]) == (2, 5, 8, 2)\n"
        "open(sys.argv[3], 'wb').write(bytes(range(3)) * (w * h))\n"
        'print(\'{"way": 1, "build": 1.5, "frames": [2.5, 3]}\')\n'
        "sys.exit(sys.argv[4:] not in (['0', ''], ['0', '1']) or (sys.argv[5] == '1') != (sys.argv[2] == '1'))\n"
    )
    program.chmod(0o755)
    one = embree.Embree(str(program), tmp_path, "samples", "samples", 4)
    scene = scenes.cloud(16, SMALL)
    assert one.refuses(scene) == ()
    # The way that was the fastest is the only one from then on.
    assert one.run(scene, 3).kernel == [2.5, 3]
    done = one.run(scene, 1)
    assert (done.kernel, done.whole) == ([2.5, 3], 4)
    assert done.rgb8.shape == (27, 48, 3)
    assert done.rgb8[5, 7].tolist() == [0, 1, 2]
    with pytest.raises(PeerError, match="peer failed with status 1: AssertionError"):
        one.run(scenes.cloud(17, SMALL), 3)
    program.write_text("#!/bin/sh\necho hello\n")
    with pytest.raises(PeerError, match="peer: cannot read what it wrote: "):
        one.run(scene, 3)


def test_a_peer_has_its_seconds_for_each_of_two_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first run of one that draws several has to compile, too; it may not hang for all of a hundred frames."""
    monkeypatch.setattr(peer, "PEER_SECONDS", 0.2)
    program = tmp_path / "peer"
    program.write_text("#!/bin/sh\nexec sleep 60\n")
    program.chmod(0o755)
    for frames, most in ((1, "0.2"), (2, "0.4"), (100, "0.4")):
        with pytest.raises(PeerError, match=f"^peer took more than {most} s$"):
            peer.call([str(program)], frames)
    with pytest.raises(PeerError, match=r"^peer took more than 0.4 s$"):  # two frames at least
        embree.Embree(str(program), tmp_path).run(scenes.cloud(2, SMALL), 1)


def test_a_peer_of_an_unknown_version_is_a_peer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What has no version is ours."""
    program = tmp_path / "povray"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert {each.version for each in povray.tracers(tmp_path)} == {"unknown"}


def test_peers_that_are_not_installed_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(peer.importlib.util, "find_spec", lambda name: None)
    packages = ["mitsuba is not installed (pip install mitsuba)"]
    programs = ["Embree: there is no C++ compiler", "POV-Ray is not installed (Debian: povray)"]
    assert installed(tmp_path) == ([], programs + packages)
    assert len(PEERS) == len(programs + packages)


def in_company(scene: Scene, frames: int, what: str) -> tracers.Run:
    """What a test wants a package to do."""
    if what == "end":
        os._exit(3)
    if what == "sleep":
        time.sleep(60)
    if what == "fail":
        raise ValueError("no such thing\nbecause")
    print("not for our user")
    return tracers.Run([1.0] * frames, os.getpid(), np.zeros((*scene.camera.resolution[::-1], 3), np.uint8))


@pytest.mark.slow
def test_a_package_in_a_process_of_its_own(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """It stays for all calls. What it raises, or that it ends or hangs, is one line, and the next call has another."""
    company, scene = peer.Company(in_company), scenes.cloud(2, SMALL)
    done = company.run(scene, 3, "draw")
    assert (done.kernel, done.rgb8.shape) == ([1, 1, 1], (27, 48, 3))
    assert company.run(scene, 1, "draw").whole == done.whole != os.getpid()
    with pytest.raises(PeerError, match=r"^test_peers: ValueError: no such thing$"):
        company.run(scene, 1, "fail")
    with pytest.raises(PeerError, match="test_peers: its process has ended"):
        company.run(scene, 1, "end")
    assert company.run(scene, 1, "draw").whole != done.whole
    monkeypatch.setattr(peer, "PEER_SECONDS", 0.2)
    with pytest.raises(PeerError, match=r"test_peers: more than 0.2 s"):
        company.run(scene, 1, "sleep")
    with pytest.raises(PeerError, match=r"test_peers: more than 0.4 s"):
        company.run(scene, 2, "sleep")
    assert capfd.readouterr() == ("", "")


def test_triangles_are_those_of_the_scene() -> None:
    """Corners go around counterclockwise from the front, and normals are of length 1, flat where there are none."""
    smooth, flat = (scenes.meshed(SMALL, shape) for shape in (scenes.bowl(200), scenes.scattered(50, 1)))
    both = cltrace.Scene.from_meshes(scenes.looking(SMALL, 1, (1, 2, 3)), [], [
        cltrace.Mesh(scene.meshes[0].vertices, scene.meshes[0].geometry.faces, normals)
        for scene, normals in ((smooth, smooth.meshes[0].geometry.normals), (flat, None))
    ])  # fmt: skip
    found = peer.triangles(both)
    assert len(found.corners) == both.triangles
    places, normals = found.smooth()
    assert np.allclose(np.linalg.norm(normals, axis=2), 1)
    assert np.allclose(places[: smooth.triangles].mean(axis=(0, 1)) + (1, 2, 3), (0, 0, -6), atol=0.2)
    outside = ((places - places[: smooth.triangles].mean(axis=(0, 1))) * normals).sum(axis=2)[: smooth.triangles]
    assert (outside > 1.9).all()
    across = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    assert ((across * normals.mean(axis=1)).sum(axis=1) > 0).all()


def test_what_a_scene_has_is_named() -> None:
    assert tracers.strange(scenes.sticks(27, SMALL), "spheres", "cylinders", "glass") == ("spheres", "cylinders")
    assert tracers.strange(scenes.orthographic(SMALL), "orthographic cameras", "meshes") == ("orthographic cameras",)
    spot = scenes.cloud(3, SMALL, *scenes.OTHER_LIGHTS)
    assert tracers.strange(spot, tracers.OTHER_LIGHTS)
    assert not tracers.strange(scenes.cloud(3, SMALL), *("cylinders", "textures", "mirrors", "glass"))
    assert tracers.strange(
        scenes.clear(SMALL, 0.5, 0.1), "mirrors", "glass", "materials that differ in more than colour"
    ) == ("mirrors", "glass")
    assert povray.PovRay("povray", Path()).refuses(scenes.floor(SMALL)) == ("textures",)


@pytest.fixture(scope="session")
def peers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tracers.Tracer]:
    """Those that are here, of one ray a pixel."""
    found, _ = installed(tmp_path_factory.mktemp("peers"))
    return {each.name: each for each in found if each.task == "frame" and not each.variant}


WRONG = (scenes.GROUND, scenes.FAR, scenes.SCALE, scenes.MILLION)


@functools.cache
def drawn_by_peers() -> list[scenes.Case]:
    """The frames of the benchmark that single precision can draw, and one with a parallel light beside points alone."""
    found = [case for case in scenes.generated(LARGER) if case.group not in WRONG and case.task == "frame"]
    light = scenes.cloud(100, LARGER, scenes.OTHER_LIGHTS[0])
    return [*found, scenes.Case("100 balls, two lights", scenes.ORDINARY, light)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Embree", "POV-Ray", "Mitsuba 3"])
def test_peers_draw_what_cltrace_draws(peers: dict[str, tracers.Tracer], name: str) -> None:
    """They are measured with the same picture, in all scenes that single precision can draw: outlines and mirrored ones
    aside, to a level."""
    if name not in peers:
        pytest.skip(f"{name} is not installed")
    one, drawn = peers[name], 0
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
def test_more_samples_are_nearer_to_the_truth(peers: dict[str, tracers.Tracer], tmp_path: Path) -> None:
    """Of all that draw with several rays a pixel, ours too."""
    # POV-Ray tells no time of smaller pictures, which take less than a millisecond.
    case = scenes.Case("60 balls", scenes.ANTIALIASED, scenes.cloud(60, (80, 45)), "samples")
    device = cltrace.devices()[0]
    from cltrace.bench import truth

    true = truth.held_against(case, tracers.Product(device, "double"))
    assert true
    drawn: dict[tracers.Tracer, bytes] = {}
    assert true.text.startswith("means of 64 x 64 rays a pixel")
    curves: dict[tuple[str, str], dict[float, float]] = {}
    for one in [*tracers.configurations(device, ["accurate"], False), *installed(tmp_path)[0]]:
        if one.draws(case) and not one.refuses(case.scene):
            picture = one.run(case.scene, 1).rgb8
            drawn[one] = picture.tobytes()
            curves.setdefault((one.name, one.variant), {})[one.level or 0] = apart(picture, true.levels)["rms"]
    assert ("accurate", "samples") in curves
    for (name, variant), errors in curves.items():
        if variant in ("samples", "antialiasing"):
            assert errors[1] > 5, (name, variant)
            assert errors[4] < 0.4 * errors[1], (name, variant)
            assert errors[16] < 1.2, (name, variant)
    # Also in turns, as rounds are, where several tracers have one program.
    for one, picture in drawn.items():
        assert one.run(case.scene, 1).rgb8.tobytes() == picture, one.name


@pytest.mark.slow
def test_more_members_are_nearer_to_the_truth(tmp_path: Path) -> None:
    """Of all that draw soft lights, whose pictures are the same to a level, but for edges."""
    scene = scenes.cloud(60, (80, 45)).lit_by(scenes.soft_lights(512))
    case = scenes.Case("60 balls", scenes.MEMBERS, scene, "members")
    device = cltrace.devices()[0]
    right = cltrace.render(scene).rgb8
    drawn: dict[str, dict[float, np.ndarray]] = {}
    for one in [*tracers.configurations(device, ["accurate"], False), *installed(tmp_path)[0]]:
        if one.draws(case) and not one.refuses(case.scene):
            drawn.setdefault(one.name, {})[one.level or 0] = one.run(case.scene, 1).rgb8
    ours = drawn["accurate"]
    assert list(ours) == list(tracers.MEMBERS)
    for name, curve in drawn.items():
        assert apart(curve[256], right)["rms"] < 0.2 * apart(curve[4], right)["rms"], name
        for level, picture in curve.items():
            assert (np.abs(picture.astype(int) - ours[level]).max(axis=2) > 1).mean() < 0.02, (name, level)


def test_importing_the_peers_imports_no_package() -> None:
    importlib.import_module("cltrace.bench.peers")
    assert "mitsuba" not in sys.modules
