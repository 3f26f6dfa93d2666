"""Kernel sources and options -> a program for one device, and the arguments of its kernels."""

from __future__ import annotations

import re
import threading
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl

from cltrace.base.errors import BuildError, warnings_are
from cltrace.base.waiting import aside
from cltrace.plan import opencl
from cltrace.plan.abi import SHAPES
from cltrace.run.caches import ROOM, largest_file, mend_kernels
from cltrace.run.devices import Device

# In this order; "abi" stands for the header that is made from the table of plan/abi.py. Others are made of parts of the
# first shape, the sphere, which therefore has more files.
SOURCES = (
    "packet.cl",
    "abi",
    "shapes/kinds.cl",
    "numbers.cl",
    "ray.cl",
    "shapes/sphere/sphere.cl",
    "shapes/sphere/exact.cl",
    "shapes/sphere/meet.cl",
    "shapes/start.cl",
    "shapes/sphere/leaving.cl",
    *(f"shapes/{shape}/{shape}.cl" for shape in SHAPES[1:]),
    "find/cells.cl",
    "find/closest.cl",
    "find/leaves.cl",
    *(f"shapes/{shape}/eye.cl" for shape in SHAPES),
    "shapes/dispatch.cl",
    "find/range.cl",
    "find/tree.cl",
    "lights.cl",
    "shade/phong.cl",
    "shade/materials.cl",
    *(f"shapes/{shape}/surface.cl" for shape in SHAPES),
    "find/stopped.cl",
    "shade/points.cl",
    "shade/tree_of_rays.cl",
    "trace.cl",
    "output.cl",
    "samples.cl",
    "render.cl",
)
# What finds triangles without shadows.
UNSTOPPABLE = ("packet.cl", "abi", "find/cells.cl", "find/unstoppable.cl")


@cache
def context_of(device: cl.Device) -> Any:
    """The one context of a device, so that all pictures of a process share its programs."""
    return cl.Context([device])


def kernel_folder() -> Traversable:
    """The folder of the kernel's files: of the package cltrace.kernels, or in a checkout kernels/ beside cltrace/.

    An installed cltrace has the package. Python that is started in a checkout finds the checkout's cltrace first, even
    if another one is installed, and a checkout has the folder only. Raises BuildError if neither is there.
    """
    try:
        return resources.files("cltrace.kernels")
    except ModuleNotFoundError:
        folder = Path(__file__).parents[2] / "kernels"
        if (folder / SOURCES[-1]).is_file():
            return folder
        raise BuildError("the kernel's files are missing: no package cltrace.kernels; install cltrace again") from None


@cache
def source(files: tuple[str, ...] = SOURCES) -> str:
    """The kernel's files as one text, with `#line`s, so that the compiler's messages name the file they are about."""
    folder = kernel_folder()
    texts = (opencl.header() if name == "abi" else (folder / name).read_text("utf-8") for name in files)
    texts = (opencl.for_its_shape(name, text) for name, text in zip(files, texts, strict=True))
    return "".join(f'#line 1 "kernels/{name}"\n{text}' for name, text in zip(files, texts, strict=True))


class Kernel:
    """A kernel of a program. Several threads may start it.

    types: those of its parameters by name, in their order; launched: the groups for which it has been compiled.
    """

    def __init__(self, made: Any, name: str, types: Mapping[str, str]) -> None:
        self.types = types
        self._made, self._lock, self.launched = cl.Kernel(made, name), threading.Lock(), set[object]()
        # Without types pyopencl finds out by exceptions which arguments are numbers: that took 0.09 of the 0.33 ms of a
        # thumbnail's frame. Of structs it needs only that they are some.
        known = {BUFFER: None} | {type_: np.dtype(getattr(cl.cltypes, type_)) for type_ in NUMBERS}
        self._made.set_arg_types([known.get(t, getattr(cl.cltypes, t, np.dtype("V"))) for t in types.values()])

    def start(self, queue: Any, grid: tuple[int, ...], group: tuple[int, ...], arguments: Mapping[str, Any]) -> Any:
        """Starts it, and returns its event. arguments: by the names of the parameters; there may be others.

        PoCL compiles in the first launch of each local size, group: signals are heard until that one is done.
        """
        values = [argument(type_, arguments[name]) for name, type_ in self.types.items()]

        def launch() -> Any:
            with self._lock:  # the arguments are the kernel's until it has been started
                return self._made(queue, grid, group, *values)

        if group in self.launched:
            return launch()
        event = aside(launch)
        aside(event.wait)
        self.launched.add(group)
        return event


class Program:
    """A program for one device. kernel() gives the same kernel each time."""

    def __init__(self, made: Any) -> None:
        self.made = made
        self._kernels: dict[str, Kernel] = {}

    def kernel(self, name: str, types: Mapping[str, str]) -> Kernel:
        if name not in self._kernels:
            self._kernels[name] = Kernel(self.made, name, types)
        return self._kernels[name]


def program(device: Device, options: list[str], files: tuple[str, ...] = SOURCES) -> Program:
    """The program of some files, compiled with these -D flags.

    files: names of SOURCES, or of others in that folder. Building takes most of the time of a small picture, even from
    the driver's cache, so programs are kept for the next picture. Raises BuildError with the options and the compiler's
    log.
    """
    try:
        exact = ["-cl-fp32-correctly-rounded-divide-sqrt"] if device.rounds_correctly else []
        return _program(device.cl, (*options, *exact), files)
    except cl.Error as error:
        raise BuildError(f"the kernel does not build on {device.name}\noptions: {' '.join(options)}\n{error}") from None


@lru_cache(maxsize=64)
def _program(device: cl.Device, options: tuple[str, ...], files: tuple[str, ...]) -> Program:
    if "PoCL" in device.platform.version:
        if largest_file() < ROOM:  # which ends the process with the status of a check that failed
            raise BuildError(
                f"compiling takes files of {ROOM} bytes, but they may have {largest_file()} here: ulimit -f"
            )
        mend_kernels()
    with warnings_are("ignore", cl.CompilerWarning):  # the log of a build that worked
        # No fast-math of any kind: infinity is the distance of a miss, and the filters' bounds need each rounding.
        # No warnings: of processors without registers for 16 floats, PoCL 3.1 counts some hundred on stderr.
        made = cl.Program(context_of(device), source(files))
        return Program(aside(lambda: made.build(options=[*options, "-cl-std=CL1.2", "-w"], devices=[device])))


ENTRY_POINT = re.compile(r"^__kernel\s+void\s+(\w+)\(([^()]*)\)", re.MULTILINE)
# In place of the type of a parameter that is a buffer.
BUFFER = "*"
NUMBERS = ("int", "uint", "long", "ulong", "float", "double")


def parameters_of(text: str, macros: Mapping[str, str] | None = None) -> dict[str, dict[str, str]]:
    """Of each kernel of a text its parameters, in their order: the type of a value, BUFFER for a pointer.

    macros: what names of types stand for.
    """
    found: dict[str, dict[str, str]] = {}
    for kernel, declarations in ENTRY_POINT.findall(text):
        found[kernel] = {}
        for declaration in declarations.split(","):
            *words, name = declaration.replace("*", " * ").split()
            found[kernel][name] = BUFFER if BUFFER in words else (macros or {}).get(words[-1], words[-1])
    return found


def argument(type_: str, value: Any) -> Any:
    """Some numbers as the vector of this type, of which the last may be missing and is then 0. All else as it is."""
    if not isinstance(value, (tuple, list, np.ndarray)):
        return value
    return np.array((*value, 0)[: int(type_[-1])], getattr(cl.cltypes, type_))[()]
