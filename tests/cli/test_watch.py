"""--watch: a picture for each change of a file that it depends on, and the last one where a change is a fault."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

import cltrace
from cltrace import cli

FILE = Path(__file__).parents[2] / "scenes" / "minimal.xml"
MESH = """<scene output_file="m.png"><background_color r="0" g="0" b="0"/><camera><position x="0" y="0" z="4"/>
<lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/><horizontal_fov angle="45"/>
<resolution horizontal="32" vertical="24"/><max_bounces n="1"/></camera>
<lights><ambient_light><color r="1" g="1" b="1"/></ambient_light></lights><surfaces>
<mesh name="t.obj"><material_solid><color r="1" g="1" b="1"/><phong ka="1" kd="0" ks="0" exponent="1"/>
<reflectance r="0"/><transmittance t="0"/><refraction iof="1"/></material_solid></mesh></surfaces></scene>
"""
TRIANGLE = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/1\n"


@contextmanager
def watching(folder: Path, *arguments: str) -> Iterator[Callable[[], str]]:
    """The command, and what it says until it waits. At the end it is interrupted, and nothing is left of it."""
    pytest.importorskip("watchfiles")
    line = [sys.executable, "-m", "cltrace", *arguments, "--watch"]
    with subprocess.Popen(line, cwd=folder, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        guard = threading.Timer(300, process.kill)
        guard.start()

        def said() -> str:
            lines = []
            while "waiting" not in "".join(lines):
                lines.append(process.stderr.readline())  # type: ignore[union-attr]
                assert lines[-1], "".join(lines)
            return "".join(lines[:-1])

        try:
            yield said
        finally:
            guard.cancel()
            process.send_signal(signal.SIGINT)
            status = process.wait(30)
    assert status == 130
    assert not list(folder.glob(".*.part"))


def same(picture: Path, scene: Path) -> bool:
    with Picture.open(picture) as found:
        return np.array_equal(np.asarray(found), cltrace.render(cltrace.load(scene)).rgb8)


def test_a_mesh_is_saved(tmp_path: Path) -> None:
    """In place, with a fault, by a file that takes its name as editors do it, and the scene itself."""
    scene, mesh, picture = tmp_path / "s.xml", tmp_path / "sub" / "t.obj", tmp_path / "m.png"
    mesh.parent.mkdir()
    text = MESH.replace("t.obj", "sub/t.obj")
    scene.write_text(text)
    mesh.write_text(TRIANGLE)
    with watching(tmp_path, "s.xml") as said:
        assert said().startswith("cltrace: wrote m.png, 32x24")
        assert same(picture, scene)
        mesh.write_text(TRIANGLE.replace("v 0 1 0", "v 0 0 0"))
        assert said().startswith("cltrace: wrote")
        assert same(picture, scene)
        last = picture.read_bytes()
        mesh.write_text(TRIANGLE.replace("v 0 1 0", "v 0 x 0"))
        assert said().startswith("sub/t.obj:3: ")
        assert picture.read_bytes() == last
        (tmp_path / "new").write_text(TRIANGLE)
        (tmp_path / "new").replace(mesh)
        assert said().startswith("cltrace: wrote")
        assert same(picture, scene)
        assert picture.read_bytes() != last
        scene.write_text(text.replace('z="4"', 'z="5"'))
        assert said().startswith("cltrace: wrote")
        assert same(picture, scene)


@pytest.mark.slow
def test_a_mesh_that_is_not_there_yet_and_a_picture_to_compare(tmp_path: Path) -> None:
    scene = tmp_path / "s.xml"
    scene.write_text(MESH)
    with watching(tmp_path, "s.xml", "-o", "other.png") as said:
        assert "mesh: name" in said()
        (tmp_path / "t.obj").write_text(TRIANGLE)
        assert said().startswith("cltrace: wrote other.png")
    mine = tmp_path / "mine.png"
    Picture.fromarray(np.zeros((24, 32, 3), np.uint8)).save(mine)
    with watching(tmp_path, "s.xml", "--compare", "mine.png") as said:
        said()
        time.sleep(0.2)
        (tmp_path / "other.png").replace(mine)
        said()


def test_watch_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def fault(*arguments: str) -> str:
        assert cli.main([str(FILE), "--watch", *arguments]) == 2
        return capsys.readouterr().err

    monkeypatch.chdir(tmp_path)
    assert fault("-o", "-") == "cltrace: --watch takes no -o -\n"
    assert fault("--orbit", "2") == "cltrace: --watch is for one picture, of one scene\n"
    monkeypatch.setitem(sys.modules, "watchfiles", None)
    assert "pip install 'cltrace[watch]'" in fault()
    assert not list(tmp_path.iterdir())
