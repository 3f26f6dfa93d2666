"""Fixtures: every OpenCL device that is there, every packet width that it can run, and what the reference says."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

import cltrace
from cltrace import reference
from cltrace.run.devices import Device

SCENES = sorted((Path(__file__).parent.parent / "scenes").glob("*.xml"))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--device", help="test only this device (a SPEC of --list-devices)")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test that takes `device` runs once on each device; with `width`, also as the packets of one that GPUs get."""
    names = metafunc.fixturenames
    if "device" not in names:
        return
    wanted = metafunc.config.getoption("--device")
    found = [cltrace.run.devices.choose(wanted)] if wanted else cltrace.devices()
    if "width" in names:
        cases = [(d, w) for d in found for w in sorted({d.width, 1}, reverse=True)]
        metafunc.parametrize(("device", "width"), cases, ids=[f"{d.spec}-{d.driver}-W{w}" for d, w in cases])
    else:
        metafunc.parametrize("device", found, ids=[f"{d.spec}-{d.driver}" for d in found])


def pytest_report_header() -> list[str]:
    return [f"device: {d.line()}" for d in cltrace.devices()]


@pytest.fixture
def any_device() -> Device:
    """The device that a user gets without asking for one."""
    return cltrace.run.devices.choose()


@functools.cache
def world(scene: cltrace.Scene) -> reference.World:
    """The reference's view of a scene, made once."""
    return reference.world_of(scene)
