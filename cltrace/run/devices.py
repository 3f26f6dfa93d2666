"""OpenCL devices: which there are, which one is meant by a SPEC, and what is known of their drivers.

Nothing here asks questions on a terminal, and no other device is ever taken than the one that was asked for.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyopencl as cl

from cltrace.base.errors import DeviceError, OutOfMemoryError
from cltrace.base.limits import MAX_ROWS

ADVICE = """Ways to get an OpenCL driver:
    pip install pocl-binary-distribution        a CPU driver, Linux on x86-64
    pip install intel-opencl-rt intel-cmplr-lib-rt
                                                Intel's CPU driver, for AMD's CPUs, too; Linux on x86-64, faster
    apt-get install pocl-opencl-icd             PoCL for Debian and Ubuntu, newer and faster
    conda install -c conda-forge pocl           Linux and macOS
A GPU's driver brings its own. Drivers are looked for in {where};
OCL_ICD_VENDORS=FOLDER names another folder, OCL_ICD_DEBUG=7 shows the search. A driver that was installed with pip is
found beside pyopencl. PoCL shows no device where it cannot write its kernel cache: POCL_CACHE_DIR names a folder."""


@dataclass(frozen=True)
class Driver:
    """What was measured of a CPU driver: the packet width that is right for it, and its place among the others.

    pattern: a regular expression for the platform's name and version, a space, and the device's name; width: pixels in
    a packet; rank: the lower, the faster, so that of two drivers for one CPU the faster one is taken when none is asked
    for; flags: names of -D flags that it needs.
    """

    pattern: str
    width: int
    rank: int
    flags: tuple[str, ...] = ()


# ms a frame at 1920x1080 of 16, 1,000 and 100,000 spheres in a box, on 2 cores with AVX-512, 2026-11-21:
#   width         1                8               16
#   PoCL 3.1      21, 40, 109      4.2, 9.9, 44    2.6, 6.8, 36
#   Intel 2026.22                  4.5, 10, 44     2.7, 6.8, 36
#   PoCL 3.0      24, 45, 118      4.4, 10, 46     must not be: with LLVM 14, sqrt(float16) aborts the whole process
# PoCL 3.0 also calls a function for each fma, and so spills all registers.
DRIVERS = (
    Driver(r"Intel|LINUX", 16, 1),
    Driver(r"PoCL 3\.0.* pthread-[a-z0-9-]+-", 8, 2, ("NO_FMA",)),
    # Its compiler is older than the CPU, whose kind it leaves out of the name: any 512 bits abort the whole process.
    Driver(r"PoCL 3\.0", 4, 2, ("NO_FMA",)),
    Driver(r"PoCL 3\.1", 16, 0),
    Driver(r"PoCL", 16, 0),
)
OTHER_CPU = Driver("", 8, 3)


@dataclass(frozen=True)
class Device:
    """One OpenCL device. spec: what to type to get it, `P:D`, indices of platform and device; cl: pyopencl's own."""

    spec: str
    cl: Any

    @property
    def platform(self) -> str:
        """Name and version of the platform, as the driver calls itself."""
        return f"{self.cl.platform.name} {self.cl.platform.version}".strip()

    @property
    def name(self) -> str:
        """Name of the device and of its driver, for messages and statistics."""
        return f"{self.cl.name.strip()} ({self.driver})"

    @property
    def driver(self) -> str:
        """Short name of the driver with its version."""
        found = re.search(r"PoCL \S+", self.cl.platform.version)
        return found.group() if found else f"{self.cl.platform.name.strip()} {self.cl.driver_version.strip()}"

    @property
    def kind(self) -> str:
        """cpu, gpu or other."""
        if self.cl.type & cl.device_type.CPU:
            return "cpu"
        return "gpu" if self.cl.type & cl.device_type.GPU else "other"

    @property
    def has_double(self) -> bool:
        """Whether the device computes in double precision."""
        return bool(self.cl.double_fp_config)

    @property
    def rounds_correctly(self) -> bool:
        """Whether quotients and roots of floats are rounded to the nearest, if the compiler is asked for that."""
        return bool(self.cl.single_fp_config & cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT)

    @property
    def record(self) -> Driver:
        """What is known of its driver, if that is one for a CPU."""
        return next((d for d in DRIVERS if re.search(d.pattern, f"{self.platform} {self.cl.name}")), OTHER_CPU)

    @property
    def flags(self) -> tuple[str, ...]:
        """Names of the -D flags that the driver needs."""
        return self.record.flags if self.kind == "cpu" else ()

    @property
    def width(self) -> int:
        """How many pixels a packet should have: 1 on a GPU."""
        return self.record.width if self.kind == "cpu" else 1

    @property
    def label(self) -> str:
        """Its spec, which tells it from all others, and its name."""
        return f"{self.spec} {self.name}"

    @property
    def largest_buffer(self) -> int:
        """How many bytes a buffer may have at most."""
        return int(self.cl.max_mem_alloc_size)

    def line(self) -> str:
        """One line for --list-devices."""
        double = "double" if self.has_double else "no double"
        return f"{self.spec:<5} {self.kind:<5} {double:<9}  {self.name}"


def check_sizes(device: Device, sizes: Mapping[str, tuple[int, int]]) -> None:
    """Raises DeviceError, with advice, if there can be no buffers of these sizes: rows and bytes, by name.

    Kernels count rows with whole numbers of 32 bits.
    """
    for name, (rows, size) in sizes.items():
        most = device.largest_buffer
        if rows > MAX_ROWS or size > most:
            fault = f"{rows} rows, of {MAX_ROWS}" if rows > MAX_ROWS else f"{size / 1e9:.3g} GB, of {most / 1e9:.3g} GB"
            raise DeviceError(
                f"{device.name}: the scene's `{name}` would take {fault} that a buffer may have; draw fewer surfaces, "
                "with fewer lights, or a crop of the picture, or use a device with more memory"
            )


@contextmanager
def driver_errors(device: Device) -> Iterator[None]:
    """Turns what pyopencl raises into a DeviceError that names the device."""
    try:
        yield
    except cl.MemoryError as error:
        raise OutOfMemoryError(f"{device.name} has not enough memory: {error}") from None
    except cl.Error as error:
        if "INVALID_BUFFER_SIZE" in str(error):
            most = f"{device.largest_buffer / 1e9:.3g} GB at most"
            raise OutOfMemoryError(
                f"{device.name} has buffers of {most}: draw a crop of the picture, or fewer outputs"
            ) from None
        raise DeviceError(f"{device.name} failed: {error}") from None


_process: list[int] = []  # the process that has started OpenCL


def check_process() -> None:
    """Raises DeviceError in a fork of a process that has used OpenCL: drivers lose their threads there."""
    if not _process:
        _process.append(os.getpid())
    if _process[0] != os.getpid():
        raise DeviceError(
            "OpenCL does not survive a fork: use multiprocessing.get_context('spawn'), or fork before the first picture"
        )


def devices() -> list[Device]:
    """All devices of all platforms, in the order of the OpenCL loader; an empty list if there are none."""
    check_process()
    found = []
    try:
        platforms = cl.get_platforms()
    except cl.Error:  # the loader's way to say that there is none
        return []
    for p, platform in enumerate(platforms):
        try:
            members = platform.get_devices()
        except cl.Error:  # a platform may have no device
            continue
        found += [Device(f"{p}:{d}", device) for d, device in enumerate(members)]
    return found


def choose(spec: str | None = None) -> Device:
    """The device that `spec` names: cpu, gpu, P, P:D, or part of the name of a platform or device.

    P and D are the indices of a platform and of a device. Without a spec, the environment's PYOPENCL_CTX counts, and
    without that the fastest CPU driver by DRIVERS. Raises TypeError if spec is no text, and DeviceError, with the list
    of devices, if there is no such device or it could be several.
    """
    if spec is not None and not isinstance(spec, str):
        raise TypeError(f"device: must be a text such as 'cpu' or '0:1', got {spec!r}")
    every = devices()
    if not every:
        raise DeviceError(f"no OpenCL device found\n{where_drivers_are()}")
    source = ""
    if spec is None and os.environ.get("PYOPENCL_CTX"):
        spec, source = os.environ["PYOPENCL_CTX"], " (from PYOPENCL_CTX)"
    wanted = "cpu" if spec is None else spec.strip()
    if wanted.lower() in ("cpu", "gpu"):
        matches = [d for d in every if d.kind == wanted.lower()]
        if matches and wanted.lower() == "cpu":  # several drivers for the one CPU: always the same choice
            return min(matches, key=lambda d: (d.record.rank, d.spec))
    elif re.fullmatch(r"\d+(:\d+)?", wanted):
        matches = [d for d in every if d.spec == wanted or d.spec.split(":")[0] == wanted]
    else:
        matches = [d for d in every if wanted and wanted.lower() in f"{d.platform} {d.cl.name}".lower()]
    if len(matches) == 1:
        return matches[0]
    problem = "no device matches" if not matches else "several devices match"
    listing = "\n".join(d.line() for d in every)
    raise DeviceError(f"{problem} {wanted!r}{source}; choose one of:\n{listing}")


def where_drivers_are() -> str:
    """Advice for a machine without a driver: what can be installed, and where drivers are looked for."""
    named = os.environ.get("OCL_ICD_VENDORS")
    if named and not Path(named).exists():
        return f"OCL_ICD_VENDORS is {named}, which does not exist. No driver is found then, wherever it is: unset it."
    return ADVICE.format(where=named or "/etc/OpenCL/vendors")
