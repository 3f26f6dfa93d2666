"""How far something is: shown by tqdm, after a second, where somebody is looking."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest
from random_scenes import usual_scene

import cltrace
from cltrace import cli
from cltrace.base import progress
from cltrace.run.devices import Device
from cltrace.students.check import check

SCENE = Path(__file__).parents[2] / "scenes" / "step3-shadows.xml"


@pytest.fixture
def no_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("tqdm")
    monkeypatch.setattr(progress, "DELAY", 0.0)


@pytest.mark.usefixtures("no_delay")
def test_what_is_wanted_is_shown(any_device: Device, capsys: pytest.CaptureFixture[str]) -> None:
    scene = usual_scene()
    image = cltrace.render(scene, any_device, outputs=("rgb8", "id"), progress=True)
    shown = capsys.readouterr().err
    height = scene.camera.resolution[1]
    assert "100%" in shown
    assert f"{height}/{height}" in shown
    assert check(scene, image, "accurate", 20, progress=True).ok
    assert "20/20" in capsys.readouterr().err


@pytest.mark.usefixtures("no_delay")
def test_nothing_is_shown_where_nobody_looks(
    any_device: Device, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = usual_scene()
    for wanted in (None, False):
        cltrace.render(scene, any_device, outputs=("rgb8", "id"), progress=wanted)
    assert capsys.readouterr().err == ""
    monkeypatch.setitem(sys.modules, "ipykernel", ModuleType("ipykernel"))
    cltrace.render(scene, any_device, outputs=("rgb8", "id"))
    assert "100%" in capsys.readouterr().err
    cltrace.render(scene, any_device, outputs=("rgb8", "id"), progress=False)
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("no_delay")
def test_the_command_shows_it_on_a_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = [str(SCENE), "-o", str(tmp_path / "a.png"), "--size", "64x48", "--check=30"]
    assert cli.main(arguments) == 0
    assert "%" not in capsys.readouterr().err
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert cli.main(arguments) == 0
    shown = capsys.readouterr().err
    assert "48/48" in shown
    assert "30/30" in shown
    assert cli.main([*arguments, "-q"]) == 0
    assert capsys.readouterr().err == ""


def test_short_work_shows_nothing(any_device: Device, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("tqdm")
    renderer = cltrace.Renderer(usual_scene(), any_device)
    renderer.render(progress=True)
    assert capsys.readouterr().err == ""


def test_a_bar_without_its_package(monkeypatch: pytest.MonkeyPatch, any_device: Device) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "tqdm" else find(name))
    renderer = cltrace.Renderer(usual_scene(), any_device)
    with pytest.raises(cltrace.MissingPackageError) as caught:
        renderer.render(progress=True)
    words = "a progress bar needs the package tqdm, which is not installed: pip install 'cltrace[progress]'"
    assert str(caught.value) == words
    assert renderer.render().rgb8.any()


@pytest.mark.slow
def test_frames_of_other_backgrounds_and_curves(any_device: Device) -> None:
    """A Renderer that follows has the new scene's alpha and curve, also where the kernel has to write more for it."""
    scene = usual_scene()
    renderer = cltrace.Renderer(scene.in_front_of("#12345600"), any_device)
    for other in (
        scene.in_front_of("#12345680"),
        scene.in_front_of("#123456"),
        replace(scene, transfer="srgb"),
    ):
        found, fresh = renderer.following(other).render(), cltrace.render(other, any_device)
        assert found.outputs == fresh.outputs
        for name in fresh.outputs:
            assert (getattr(found, name) == getattr(fresh, name)).all()
