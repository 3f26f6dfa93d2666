"""Devices that can less than those at hand, simulated: other texts and options of programs, other words of drivers."""

from __future__ import annotations

import functools
import re
import shutil
from collections.abc import Iterable
from dataclasses import replace
from math import prod
from typing import Any

import numpy as np
import oclgrind
import pyopencl as cl
import pytest
from conftest import SCENES as ALL_SCENES

import cltrace
from cltrace.base.errors import BuildError
from cltrace.renderers.renderer import strips
from cltrace.run import program
from cltrace.run.devices import DRIVERS, Device
from cltrace.run.program import Kernel

# Quotients may be off by 2.5 ulp and roots by 3, unless a device says that it rounds them to the nearest.
ROUGH = """
#define LESS(T, I) \\
    static T __attribute__((overloadable)) rough(const T x) { \\
        const I bits = as_##I(x); \\
        return isfinite(x) && x != 0 ? as_##T(bits + (I)((bits * 2654435761u >> 16) % 5) - (I)2) : x; \\
    } \\
    static T __attribute__((overloadable)) rough_root(const T x) { return rough(sqrt(x)); }
LESS(float, uint)
LESS(float8, uint8)
#define AS_IT_IS(T) static T __attribute__((overloadable)) rough(const T x) { return x; }
AS_IT_IS(int)
AS_IT_IS(uint)
AS_IT_IS(long)
AS_IT_IS(ulong)
"""
ROUGH_DOUBLE = """
AS_IT_IS(double)
static double __attribute__((overloadable)) rough_root(const double x) { return sqrt(x); }
"""
# Without doubles, a program may not name them, and each constant that is one becomes a float.
NO_DOUBLES = "\n#define double no_double\n"
FLUSHED, NO_CONSTANTS = "-cl-denorms-are-zero", "-cl-single-precision-constant"
# A group of the least devices has at most so many work-items.
GROUP = 256
START = Kernel.start


def roughened(text: str, doubles: bool) -> str:
    """The program's text with quotients and roots wrong by up to 2 ulp, where these are of floats."""
    text = re.sub(r"/\*.*?\*/", lambda comment: "\n" * comment.group().count("\n"), text, flags=re.DOTALL)
    parts, end = [], 0
    for divided in re.finditer(r"(?<=[^/\"a-z])/ (?=[(a-zA-Z])", text):
        if divided.start() < end:
            continue
        begin = divided.end()
        parts += [text[end:begin], "rough("]
        end = end_of_operand(text, begin)
        parts += [re.sub(r"\bsqrt\(", "rough_root(", text[begin:end]), ")"]
    text = "".join([*parts, text[end:]])
    head, first, rest = text.partition("#line")
    return head + ROUGH + (ROUGH_DOUBLE if doubles else "") + first + re.sub(r"\bsqrt\(", "rough_root(", rest)


def end_of_operand(text: str, at: int) -> int:
    """Where the name, with its members and arguments, or the expression in parentheses ends that begins here."""
    depth = 0
    while depth or re.match(r"[\w.(\[]|->", text[at:]):
        depth += (text[at] in "([") - (text[at] in ")]")
        at += 2 if text.startswith("->", at) else 1
        if not depth and text[at - 1] == ")" and not re.match(r"[.(\[]|->", text[at:]):
            break
    return at


def watched(kernel: Kernel, queue: Any, grid: tuple[int, ...], group: tuple[int, ...], arguments: Iterable[Any]) -> Any:
    """As Kernel.start(); groups of work-items are not larger than a poor device's."""
    assert prod(group) <= GROUP
    return START(kernel, queue, grid, group, arguments)


@pytest.fixture
def poor(monkeypatch: pytest.MonkeyPatch, any_device: Device, doubles: bool) -> Device:
    """All devices are graphics cards now that flush denormals and divide roughly; without `doubles` they have none."""
    source, build = program.source.__wrapped__, program._program
    monkeypatch.setattr(Device, "kind", "gpu")
    monkeypatch.setattr(Device, "rounds_correctly", False)
    monkeypatch.setattr(Device, "has_double", doubles)
    monkeypatch.setattr(
        program, "source", lambda files: ("" if doubles else NO_DOUBLES) + roughened(source(files), doubles)
    )
    further = (FLUSHED,) if doubles else (FLUSHED, NO_CONSTANTS)
    monkeypatch.setattr(program, "_program", lambda device, options, files: build(device, (*options, *further), files))
    monkeypatch.setattr(Kernel, "start", watched)
    return any_device


SCENES = ["first", "step4-meshes", "step7-glass", "four-mirrors", "room", "globe"]


def scene_of(name: str) -> cltrace.Scene:
    path = next(path for path in ALL_SCENES if path.stem == name)
    scene = cltrace.load(path)
    return scene.seen_by(replace(scene.camera, resolution=(120, 90)))


@functools.cache
def drawn(name: str) -> cltrace.Image:
    return cltrace.render(scene_of(name), outputs=("id", "rgb8"))


@pytest.fixture
def want(name: str) -> cltrace.Image:
    """What a device at hand draws, before it is a poor one."""
    return drawn(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("doubles", [True], ids=["doubles"])
def test_decisions_are_exact(name: str, want: cltrace.Image, poor: Device) -> None:
    image = cltrace.render(scene_of(name), poor, "accurate", ("id", "rgb8"))
    assert (image.id == want.id).all()
    assert np.abs(image.rgb8.astype(int) - want.rgb8).max() <= 1


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("doubles", [False], ids=["no doubles"])
def test_single_draws_right(name: str, want: cltrace.Image, poor: Device) -> None:
    image = cltrace.render(scene_of(name), poor, outputs=("id", "rgb8"))
    same = image.id == want.id
    assert same.mean() > 0.995
    assert (np.abs(image.rgb8.astype(int) - want.rgb8).max(axis=2)[same] <= 1).mean() > 0.995


@pytest.mark.parametrize("doubles", [False], ids=["no doubles"])
def test_doubles_that_are_not_there_are_refused(poor: Device) -> None:
    with pytest.raises(cltrace.DeviceError, match="double"):
        cltrace.render(scene_of("first"), poor, "accurate")


def test_packets_that_would_end_the_process_are_refused(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of 16 pixels by PoCL 3.0, whose LLVM has no square root of 16 floats."""
    monkeypatch.setattr(Device, "kind", "cpu")
    monkeypatch.setattr(Device, "record", next(driver for driver in DRIVERS if driver.width == 8))
    with pytest.raises(cltrace.DeviceError, match="has packets of 8 pixels at most: wider ones end the process"):
        cltrace.Renderer(scene_of("first"), device, width=16)


@pytest.mark.parametrize("doubles", [False], ids=["no doubles"])
def test_what_is_simulated_is_so(poor: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "rough" in program.source(program.SOURCES)
    monkeypatch.setattr(program, "source", lambda files: NO_DOUBLES + "__kernel void render(double x) {}")
    with pytest.raises(BuildError, match="double"):
        program.program(poor, [])


@pytest.mark.slow
def test_what_is_larger_than_a_buffer(any_device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture that no buffer holds is refused with advice, and drawn in strips by the command."""
    scene = scene_of("first")
    want = cltrace.render(scene, any_device).rgb8

    class Small(cl.Buffer):  # type: ignore[misc]
        def __init__(self, context: Any, flags: Any, size: int = 0, hostbuf: Any = None) -> None:
            too_large = (size or hostbuf.nbytes) > want.nbytes // 2
            super().__init__(context, flags, 2**60 if too_large else size, None if too_large else hostbuf)

    monkeypatch.setattr(Device, "kind", "gpu")
    monkeypatch.setattr(Device, "largest_buffer", 128 << 20)
    renderer = cltrace.Renderer(scene, any_device, width=1)
    monkeypatch.setattr(cl, "Buffer", Small)
    with pytest.raises(cltrace.DeviceError, match=r"buffers of 0.134 GB at most: draw a crop"):
        renderer.render()
    parts = [image.rgb8 for _, image in strips(renderer)]
    assert len(parts) > 1
    assert (np.concatenate(parts) == want).all()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("oclgrind") is None, reason="needs Debian's oclgrind")
@pytest.mark.parametrize("precision", ["single", "accurate"])
def test_oclgrind_finds_nothing(precision: str) -> None:
    assert oclgrind.faults_of("first", precision) == ""
