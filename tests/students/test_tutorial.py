"""scenes/tutorial.py, which is made to be read, draws what cltrace draws."""

from __future__ import annotations

import importlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cltrace
from cltrace.run.devices import Device

ROOT = Path(__file__).parents[2]
# Columns of the picture of each scene: fewer where a pixel takes long in Python.
COLUMNS = {
    **dict.fromkeys(("step1-ambient", "step2-parallel", "step3-shadows", "step4-meshes", "step5-mirror"), 48),
    **dict.fromkeys(("step6-textures", "step7-glass", "step8-cone", "transforms", "spot"), 40),
    "tall": 20,
    "step9-many": 16,
}


# The others need programs of their own, which take long to compile, or many seconds in Python.
ALWAYS = {"step2-parallel", "step3-shadows", "spot"}


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in ALWAYS else pytest.mark.slow) for n in COLUMNS])
def test_pictures_are_within_a_level(any_device: Device, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """At these sizes no pixel differs by more. At others a few may, where rounding decides what an edge shows."""
    monkeypatch.syspath_prepend(str(ROOT / "scenes"))
    tutorial = importlib.import_module("tutorial")
    scene = cltrace.load(ROOT / "scenes" / f"{name}.xml")
    width, height = scene.camera.resolution
    columns = COLUMNS[name]
    scene = scene.seen_by(replace(scene.camera, resolution=(columns, round(columns * height / width))))
    mine = np.asarray(tutorial.render(scene)).astype(int)
    right = cltrace.render(scene, any_device).rgb8.astype(int)
    assert mine.shape == right.shape
    assert np.abs(mine - right).max() <= 1
    assert len(np.unique(right.reshape(-1, 3), axis=0)) > 3


def test_as_a_program(tmp_path: Path) -> None:
    """As its first lines say, from the folder of the project."""
    source = (ROOT / "scenes" / "minimal.xml").read_text("utf-8")
    assert 'horizontal="481" vertical="361"' in source
    small = source.replace('horizontal="481" vertical="361"', 'horizontal="8" vertical="6"')
    (tmp_path / "scene.xml").write_text(small, "utf-8")
    picture = tmp_path / "picture.png"
    subprocess.run([sys.executable, "scenes/tutorial.py", tmp_path / "scene.xml", picture], cwd=ROOT, check=True)
    assert picture.is_file()
