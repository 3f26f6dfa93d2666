"""cltrace --doctor, and how Intel's driver is found: what is there, what is broken, and what that leads to."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import cltrace
from cltrace.cli import doctor
from cltrace.run import caches
from cltrace.run.devices import Device


def report(spec: str | None = None) -> tuple[int, list[str]]:
    lines: list[str] = []
    status = doctor.doctor(spec, lines.append)
    return status, "\n".join(lines).splitlines()


@pytest.mark.slow
def test_what_works_is_told(device: Device) -> None:
    status, lines = report(device.spec)
    assert status == 0
    assert lines[0].startswith(
        f"versions   cltrace {metadata.version('cltrace')}, Python {sys.version.split()[0]}, numpy "
    )
    drivers = [line for line in lines if line.startswith("driver ")]
    assert drivers
    assert all(line.endswith(", loads") for line in drivers)
    assert any(line.startswith("cache ") and line.endswith(", writable") for line in lines)
    assert lines[-2:] == [
        f"device     {device.line()}  (-d {device.spec})",
        f"           ok: 1728 pixels in {cltrace.renderers.renderer.default_precision(device)} precision "
        "are as the reference draws them",
    ]


def test_a_driver_that_ends_the_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As LLVM does: it is named, with its last words; another device is advised if one works."""
    dying = cltrace.run.devices.choose().spec
    python = tmp_path / "python"
    python.write_text(
        f'#!/bin/sh\ncase "$*" in *"draw {dying}") echo "LLVM ERROR: Cannot select: fma" >&2; kill -ABRT $$;; esac\n'
        f'exec {sys.executable} "$@"\n'
    )
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    status, lines = report()
    assert status == 3
    assert "           FAILS: the driver ended the process with SIGABRT: LLVM ERROR: Cannot select: fma" in lines
    others = [d.spec for d in cltrace.devices() if d.spec != dying]
    if others:
        advice = f"The default device cannot be used. Choose another: -d {others[0]}, or PYOPENCL_CTX={others[0]}"
        assert lines[-1] == advice
    else:
        assert any("apt-get install pocl-opencl-icd" in line for line in lines)


def test_a_picture_that_is_wrong(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """One byte that is off by two levels, as a miscompiled kernel would make it."""
    rendered = cltrace.Renderer.render

    def spoilt(self: cltrace.Renderer) -> cltrace.Image:
        image = rendered(self)
        assert image.rgb8 is not None
        image.rgb8[20, 20, 1] ^= 2
        return image

    monkeypatch.setattr(cltrace.Renderer, "render", spoilt)
    assert doctor._draw(cltrace.run.devices.choose().spec) == 1
    assert "1 by more than a level" in capsys.readouterr().out


def test_no_such_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """The devices that there are follow, and how to get a driver only where that would help."""
    every = [f"           {device.line()}" for device in cltrace.devices()]
    status, lines = report("nosuchthing")
    assert status == 3
    assert lines[-1 - len(every) :] == ["devices    no device matches 'nosuchthing'; choose one of:", *every]
    status, lines = report("gpu")
    assert status == (0 if any(device.kind == "gpu" for device in cltrace.devices()) else 3)
    assert ("Ways to get an OpenCL driver:" in lines) == (status == 3)
    monkeypatch.setenv("PYOPENCL_CTX", "nosuchthing")
    status, lines = report()
    assert status == 3
    at = lines.index("devices    no device matches 'nosuchthing' (from PYOPENCL_CTX); choose one of:")
    assert lines[at + 1 : -1] == every
    assert lines[-1].startswith("The device that PYOPENCL_CTX names cannot be used. Choose another: -d ")


@pytest.mark.parametrize("named", [False, True])
def test_the_device_says_what_chose_it(named: bool, device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a child process finds this device alone, which works."""
    listing = json.dumps({"wanted": device.spec, "problem": "", "devices": {device.spec: device.line()}})
    monkeypatch.setattr(doctor, "child", lambda *arguments: (0, listing if "devices" in arguments else "fine"))
    monkeypatch.delenv("PYOPENCL_CTX", raising=False)
    if named:
        monkeypatch.setenv("PYOPENCL_CTX", device.spec)
    status, lines = report()
    assert status == 0
    assert lines[-2] == f"device     {device.line()}  ({f'PYOPENCL_CTX={device.spec}' if named else 'the default'})"


def test_a_folder_of_drivers_that_does_not_exist(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The OpenCL loader then finds no driver at all, not even one beside pyopencl."""
    nowhere = str(tmp_path / "nonexistent")
    monkeypatch.setenv("OCL_ICD_VENDORS", nowhere)
    status, lines = report()
    assert status == 3
    assert lines[1] == f"driver     OCL_ICD_VENDORS is {nowhere}, which does NOT exist: unset it"
    assert lines[-2:] == [
        "devices    no OpenCL device found",
        f"OCL_ICD_VENDORS is {nowhere}, which does not exist. No driver is found then, wherever it is: unset it.",
    ]


def test_broken_icd_files(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "gone.icd").write_text("/no/such/libdriver.so\n")
    (tmp_path / "folder.icd").mkdir()
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    lines = doctor._drivers()
    assert lines[0] == f"driver     {tmp_path}/folder.icd: cannot be read: Is a directory"
    assert lines[1].startswith(f"driver     {tmp_path}/gone.icd: /no/such/libdriver.so, does NOT load: ")
    assert "No such file" in lines[1]


def test_the_command(any_device: Device, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cltrace", "--doctor", "-d", any_device.spec]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "ok: 1728 pixels" in done.stdout
    assert not list(tmp_path.iterdir())


@pytest.fixture
def intel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """An environment in which pip has put Intel's driver, its misleading .icd files, and nothing else."""
    (tmp_path / "lib").mkdir()
    library = tmp_path / "lib" / caches.LIBRARY
    library.touch()
    theirs = tmp_path / "etc" / "OpenCL" / "vendors"
    theirs.mkdir(parents=True)
    (theirs / "intel-cpu.icd").write_text("/opt/somewhere/else/lib/libintelocl.so\n")
    system = tmp_path / "system"
    system.mkdir()
    (system / "pocl.icd").write_text("libpocl.so.2.10.0\n")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(caches, "SYSTEM", system)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("OCL_ICD_VENDORS", "")
    return library


def vendors() -> dict[str, str]:
    """The files of the folder in which drivers are looked for; none where no folder is named."""
    os.environ["OCL_ICD_VENDORS"] = ""
    caches.ensure_vendors()
    folder = os.environ["OCL_ICD_VENDORS"]
    return {path.name: path.read_text() for path in Path(folder).iterdir()} if folder else {}


def test_intels_driver_is_found_beside_the_others(intel: Path, tmp_path: Path) -> None:
    for _ in range(2):
        assert vendors() == {"pocl.icd": "libpocl.so.2.10.0\n", "cltrace-intel.icd": f"{intel}\n"}
    (folder,) = (tmp_path / "cache" / "cltrace").iterdir()
    assert os.environ["OCL_ICD_VENDORS"] == str(folder)


def test_what_is_there_is_taken_as_it_is(intel: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in an environment of conda, or where somebody has named a folder."""
    (tmp_path / "etc" / "OpenCL" / "vendors" / "intel-cpu.icd").write_text(f"{intel}\n")
    assert caches._icd_files(intel) == {"pocl.icd": "libpocl.so.2.10.0", "intel-cpu.icd": str(intel)}
    monkeypatch.setenv("OCL_ICD_VENDORS", "/mine")
    caches.ensure_vendors()
    assert os.environ["OCL_ICD_VENDORS"] == "/mine"


def test_without_intels_driver_or_a_cache_of_ones_own_nothing_is_set(intel: Path, tmp_path: Path) -> None:
    """What an .icd file names is run, so that a folder of somebody else is not used."""
    (tmp_path / "cache").write_text("in the way")
    assert vendors() == {}
    (tmp_path / "cache").unlink()
    if hasattr(os, "getuid") and os.getuid() == 0:
        assert vendors()
        os.chown(os.environ["OCL_ICD_VENDORS"], 12345, 12345)
        assert vendors() == {}
    intel.unlink()
    assert vendors() == {}
