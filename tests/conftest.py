"""Fixtures: every OpenCL device that is there, every packet width that it can run, and what the reference says."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

import cltrace
from cltrace import reference
from cltrace.run import pack
from cltrace.run.devices import Device

SCENES = sorted((Path(__file__).parent.parent / "scenes").glob("*.xml"))
LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]) << 20,) * 2)
from cltrace.formats.{0} import read_{0} as read
for name in sys.argv[2:]:
    try:
        read(name)
        print("read")
    except Exception as error:
        print(type(error).__name__, error)
"""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--device", help="test only this device (a SPEC of --list-devices)")
    parser.addoption(
        "--quarter", type=int, help="only a quarter of the tests, by a hash of their names, for each number"
    )


def pytest_configure() -> None:
    """A shell starts what runs in the background deaf to Ctrl-C, and so would be the commands that tests interrupt."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test that takes `device` runs once on each device; with `width`, also as the packets of one that GPUs get.

    Those are other kernels, so an ordinary run has them in few tests only.
    """
    names = metafunc.fixturenames
    if "device" not in names:
        return
    wanted = metafunc.config.getoption("--device")
    found = [cltrace.run.devices.choose(wanted)] if wanted else cltrace.devices()
    if "width" in names:
        cases = [(d, w) for d in found for w in sorted({d.width, 1}, reverse=True)]
        usual = metafunc.module.__name__ == "test_exact"
        values = [pytest.param(d, w, marks=() if usual or w == d.width else pytest.mark.slow) for d, w in cases]
        metafunc.parametrize(("device", "width"), values, ids=[f"{d.spec}-{d.driver}-W{w}" for d, w in cases])
    else:
        metafunc.parametrize("device", found, ids=[f"{d.spec}-{d.driver}" for d in found])


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """On a second driver, the ordinary run does only the first case of each test: --device SPEC does all of them there.

    What differs between drivers is how they compile, which any case of a test shows. --quarter leaves one of four
    parts, chosen by bits of a hash of the names.
    """
    quarter = config.getoption("--quarter")
    if quarter is not None:
        items[:] = [item for item in items if (zlib.crc32(item.nodeid.encode()) >> 9) % 4 == quarter % 4]
    found = cltrace.devices()
    if config.getoption("--device") or "stress" in config.option.markexpr.replace("not stress", "") or not found:
        return
    seen: set[tuple[str, str]] = set()
    kept, left = [], []
    for item in items:
        device = (
            item.callspec.params.get("device")
            if isinstance(item, pytest.Function) and hasattr(item, "callspec")
            else None
        )
        key = (item.nodeid.split("[")[0], device.spec if device else "")
        again = device is not None and device.spec != found[0].spec and key in seen
        seen.add(key)
        (left if again else kept).append(item)
    if left:
        config.hook.pytest_deselected(items=left)
        items[:] = kept


def pytest_report_header() -> list[str]:
    return [f"device: {d.line()}" for d in cltrace.devices()]


@pytest.fixture
def any_device() -> Device:
    """The device that a user gets without asking for one."""
    return cltrace.run.devices.choose()


@pytest.fixture
def even_few_are_packed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A device packs scenes of any number of surfaces."""
    monkeypatch.setattr(pack, "MANY", 0)


@functools.cache
def world(scene: cltrace.Scene) -> reference.World:
    """The reference's view of a scene, made once."""
    return reference.world_of(scene)


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The test runs in a folder of its own."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


@pytest.fixture
def limited() -> Callable[[str, int, Iterable[str]], list[str]]:
    """What a process with so many megabytes of addresses says of files of a kind, "obj" or "texture", a line each."""

    def read(kind: str, megabytes: int, names: Iterable[str]) -> list[str]:
        command = [sys.executable, "-c", LIMITED.format(kind), str(megabytes), *names]
        env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=60, check=True)
        assert done.stderr == ""
        return done.stdout.splitlines()

    return read
