"""The scripts beside the scenes write the files that are there, and small versions of their pictures are right."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from readme import ROOT

import cltrace
from cltrace.run.devices import Device
from cltrace.students.check import check

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "scenes"))


def test_meshes_are_what_their_script_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = importlib.import_module("meshes")
    monkeypatch.setattr(script, "FOLDER", tmp_path)
    script.main()
    written = sorted(tmp_path.iterdir())
    assert len(written) >= 4
    for path in written:
        assert path.read_bytes() == (ROOT / "scenes" / "meshes" / path.name).read_bytes(), path.name


@pytest.mark.parametrize("name", ["checks", "stripes", "rings", "rug"])
def test_textures_are_what_their_script_writes(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that take no time; by their pixels, since the bytes of a PNG depend on who writes it."""
    from PIL import Image

    script = importlib.import_module("textures")
    monkeypatch.setattr(script, "FOLDER", tmp_path)
    script.write(name, getattr(script, name)(), None)
    drawn, there = (np.asarray(Image.open(f / f"{name}.png").convert("RGB"), int) for f in (tmp_path, _TEXTURES))
    assert drawn.shape == there.shape
    assert np.abs(drawn - there).max() <= (0 if name in ("checks", "stripes", "rug") else 8)  # palettes round colours


_TEXTURES = ROOT / "scenes" / "textures"


def test_the_walk_is_drawn_in_soft_light(device: Device) -> None:
    script = importlib.import_module("studio")
    _draw(script.walk(300, (120, 80)), device)


def test_balls_and_sticks_are_drawn(device: Device) -> None:
    _draw(importlib.import_module("molecule").molecule((60, 50)), device)
    _draw(importlib.import_module("network").network(30, (60, 50)), device)


def test_the_lamp_is_closed_and_drawn(device: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = importlib.import_module("sculpture")
    monkeypatch.setattr(sys, "argv", ["sculpture.py", str(tmp_path), "--grid", "16"])
    script.main()
    scene = cltrace.load(tmp_path / "sculpture.xml")
    faces = scene.meshes[0].geometry.faces
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    _draw(scene, device)


def test_the_land_is_drawn(device: Device) -> None:
    script = importlib.import_module("terrain")
    _draw(script.scene(24, (96, 54)), device)


def _draw(scene: cltrace.Scene, device: Device) -> None:
    renderer = cltrace.Renderer(scene, device, outputs=("rgb8", "id"))
    assert check(scene, renderer.render(), renderer.precision, pixels=40).ok
