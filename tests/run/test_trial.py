"""Drivers that end the process are met in another one."""

from __future__ import annotations

from pathlib import Path

import pytest
from random_scenes import usual_scene

from cltrace import DeviceError, Renderer
from cltrace.base import limits
from cltrace.run import trial
from cltrace.run.devices import OTHER_CPU, Device, devices


@pytest.fixture
def notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where it is remembered what came of trials; that any driver is new."""
    trial.check_driver.cache_clear()
    monkeypatch.setattr(trial, "home", lambda: tmp_path)
    monkeypatch.setattr(Device, "record", OTHER_CPU)
    return tmp_path / "cltrace"


def test_a_new_driver_draws_in_a_process_of_its_own(device: Device, notes: Path) -> None:
    trial.check_driver(device, 4)
    (note,) = notes.iterdir()
    assert note.read_bytes() == b""


def test_limits_of_scenes_are_not_those_of_the_trial(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it draws has more than these, which would be taken for a driver that draws."""
    monkeypatch.setenv(limits.CHANGED, "bounces=4 lights=1 pixels=100")
    status, answer = trial.child("-m", "cltrace.cli.doctor", "draw", device.spec, "4")
    assert (status, answer) == (0, "exit status 0")


@pytest.mark.parametrize(("status", "refused"), [(0, False), (3, False), (-6, True)])
def test_what_came_of_it_is_remembered(
    status: int, refused: bool, device: Device, notes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Errors that the driver raises are left to this process, which tells them in full."""
    asked = []
    monkeypatch.setattr(trial, "child", lambda *line: asked.append(line) or (status, "LLVM ERROR: Cannot select"))
    for _ in range(2):
        if refused:
            with pytest.raises(DeviceError) as caught:
                trial.check_driver(device, 16)
            (note,) = notes.iterdir()
            words = f"cannot draw with --width 16: LLVM ERROR: Cannot select; it is not tried again before {note}"
            assert str(caught.value) == f"{device.name} {words} is removed"
        else:
            trial.check_driver(device, 16)
        trial.check_driver.cache_clear()
    assert asked == [("-m", "cltrace.cli.doctor", "draw", device.spec, "16")]
    monkeypatch.setattr(Device, "platform", "another version")
    asked.clear()
    assert refused or trial.check_driver(device, 16) is None
    assert refused or len(asked) == 1


@pytest.mark.parametrize("status", [-9, -15, trial.GIVEN_UP])
def test_what_came_from_elsewhere_is_not_remembered(
    status: int, device: Device, notes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process that others end says nothing of the driver; one that does not come back is refused this time."""
    monkeypatch.setattr(trial, "child", lambda *_: (status, "no answer"))
    if status == trial.GIVEN_UP:
        with pytest.raises(DeviceError, match=r"cannot draw with --width 16: no answer$"):
            trial.check_driver(device, 16)
    else:
        trial.check_driver(device, 16)
    assert not notes.exists()


def test_no_trial_of_what_was_measured(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    trial.check_driver.cache_clear()
    monkeypatch.setattr(trial, "child", None)
    if device.kind == "cpu" and device.record.known:
        trial.check_driver(device, device.width)
        trial.check_driver(device, 1)
    monkeypatch.setenv(trial.TRIAL, "1")
    trial.check_driver(device, 16)
    trial.check_driver.cache_clear()


def test_what_ended_a_process_has_a_name() -> None:
    assert trial.child("-c", "import os; os.abort()") == (-6, "the driver ended the process with SIGABRT")
    assert trial.child("-c", "import sys; sys.exit('no')") == (1, "no")


@pytest.mark.slow
def test_a_driver_that_ends_the_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PoCL 3.0 with packets of 16 pixels: where it knows of AVX-512, its LLVM has no square root of 16 floats."""
    old = [device for device in devices() if "PoCL 3.0" in device.platform and "avx512" in device.name]
    if not old:
        pytest.skip("there is no PoCL 3.0 that knows a processor with AVX-512")
    monkeypatch.setattr(trial, "home", lambda: tmp_path)
    for _ in range(2):
        with pytest.raises(DeviceError, match="cannot draw with --width 16: the driver ended the process with SIG"):
            Renderer(usual_scene(), old[0], width=16)
