"""`cltrace --doctor`: what is installed, where its drivers are, and whether each device draws what the reference says.

A driver can end the whole process, as LLVM does where it cannot translate an instruction. So whatever loads one is done
in a child process, whose death is then a line of the report:

    python -m cltrace.cli.doctor devices [SPEC]    prints one JSON object: all devices, and the one that SPEC means
    python -m cltrace.cli.doctor draw P:D          draws a small picture, with status 0 if it is right
"""

from __future__ import annotations

import json
import os
import platform
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import pyopencl as cl

import cltrace
from cltrace.base import limits
from cltrace.base.errors import CltraceError
from cltrace.run import caches
from cltrace.run.devices import choose, devices, where_drivers_are
from cltrace.students.check import check

LOAD = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"
# Seconds until a child is given up: a driver's first program has taken 12 seconds on a busy machine.
PATIENCE = 120
PACKAGES = ("numpy", "pyopencl", "pillow", "pocl-binary-distribution", "intel-opencl-rt")


def doctor(spec: str | None = None, say: Callable[[str], None] = print) -> int:
    """Reports on this installation, line by line. Returns 0 if the device that `spec` means (None: the default) draws
    the picture that the reference draws, else 3. With a spec, only that device is tried.
    """
    for line in [_versions(), *_drivers(), *_caches()]:
        say(line)
    status, answer = child("-m", __name__, "devices", *([] if spec is None else [spec]))
    if status != 0:
        say(f"devices    {answer}")
        return _advise(say, [])
    listing = json.loads(answer)
    wanted, every = listing["wanted"], listing["devices"]
    asked = f"  ({_asked(spec)})"
    well = []
    for name, line in every.items():
        if spec is not None and name != wanted:
            continue
        say(f"device     {line}{asked if name == wanted else ''}")
        status, answer = child("-m", __name__, "draw", name)
        say(f"           {'ok' if status == 0 else 'FAILS'}: {answer}")
        if status == 0:
            well.append(name)
    if wanted in well:
        return 0
    if wanted is None:
        say(f"devices    {listing['problem']}")
        for line in every.values():
            say(f"           {line}")
        if spec not in (None, "gpu"):  # only the name is wrong
            return 3
    return _advise(say, well)


def child(*arguments: str) -> tuple[int, str]:
    """Status and last line of another Python; what ended it, if it did not end by itself."""
    # -P: what lies in the current folder is not imported. Limits are for scenes of strangers.
    environment = {name: value for name, value in os.environ.items() if name != limits.CHANGED}
    how: dict[str, Any] = {"stdin": subprocess.DEVNULL, "capture_output": True, "errors": "replace"}
    try:
        done = subprocess.run([sys.executable, "-P", *arguments], timeout=PATIENCE, check=False, env=environment, **how)
    except subprocess.TimeoutExpired:
        return 1, f"no answer within {PATIENCE} seconds"
    except OSError as error:
        return 1, f"no other process can be begun: {error.strerror}"
    said, complaint = ((text.strip().splitlines() or [""])[-1].strip() for text in (done.stdout, done.stderr))
    if done.returncode >= 0:
        return done.returncode, said or complaint or f"exit status {done.returncode}"
    ending = -done.returncode
    name = signal.Signals(ending).name if ending in set(signal.Signals) else f"signal {ending}"
    return done.returncode, f"the driver ended the process with {name}{complaint and f': {complaint}'}"


def _asked(spec: str | None) -> str:
    """What has made a device the one that is used."""
    named = os.environ.get("PYOPENCL_CTX")
    return f"-d {spec}" if spec is not None else f"PYOPENCL_CTX={named}" if named else "the default"


def _advise(say: Callable[[str], None], well: list[str]) -> int:
    if well:
        which = "The device that PYOPENCL_CTX names" if os.environ.get("PYOPENCL_CTX") else "The default device"
        say(f"{which} cannot be used. Choose another: -d {well[0]}, or PYOPENCL_CTX={well[0]}")
    else:
        say(where_drivers_are())
    return 3


def _versions() -> str:
    found = [f"cltrace {cltrace.__version__}", f"Python {platform.python_version()}"]
    for name in PACKAGES:
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            continue
    return f"versions   {', '.join(found)}; {platform.system()} on {platform.machine()}"


def _drivers() -> list[str]:
    """A line for each .icd file that the OpenCL loader reads: the library that it names, and whether that loads."""
    place = Path(os.environ.get("OCL_ICD_VENDORS") or "/etc/OpenCL/vendors")
    # Beside a pyopencl from a wheel, there is the loader, and the wheels of drivers put themselves.
    beside = Path(cl.__file__).parent / ".libs"
    files = [place] if place.is_file() else [*sorted(place.glob("*.icd")), *sorted(beside.glob("*.icd"))]
    lines = [f"driver     {file}: {_library(file)}" for file in files]
    if os.environ.get("OCL_ICD_VENDORS") and not place.exists():
        lines.insert(0, f"driver     OCL_ICD_VENDORS is {place}, which does NOT exist: unset it")
    return lines or [f"driver     none: no .icd file in {place}, nor in {beside}"]


def _library(icd: Path) -> str:
    try:
        named = icd.read_text("utf-8", "replace").strip()
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    beside = icd.parent / named
    status, answer = child("-c", LOAD, str(beside) if beside.is_file() else named)
    return f"{named}, loads" if status == 0 else f"{named}, does NOT load: {answer}"


def _caches() -> list[str]:
    """Where the drivers and pyopencl keep what they have compiled."""
    pocl = os.environ.get("POCL_CACHE_DIR")
    folders = {"cache": caches.home()} | ({"PoCL's": Path(pocl)} if pocl else {})
    caches.mend_kernels()
    return [
        *(f"{name:<10} {folder}, {_writable(folder)}" for name, folder in folders.items()),
        *(f"{'':<10} {note}" for note in caches.notes),
    ]


def _writable(folder: Path) -> str:
    try:
        caches.check_room(folder)
        return "writable"
    except OSError as error:
        return f"NOT writable: {error.strerror}"


def picture() -> cltrace.Scene:
    """A small scene with each kind of light, shadows, highlights, a ground, and a ball just before another one.

    Doubles cannot tell which of the two is first: so a device with two programs has to compile both, see Undecided of
    cltrace/run/executor.py.
    """
    camera = cltrace.Camera(position=(0, 1, 6), lookat=(0, 0, 0), horizontal_fov=24, resolution=(48, 36))
    lights = [
        cltrace.ambient_light((0.2, 0.2, 0.2)),
        cltrace.parallel_light((1, -2, -1), (0.5, 0.5, 0.5)),
        cltrace.point_light((3, 4, 5), (0.4, 0.4, 0.4)),
        cltrace.spot_light((-4, 5, 2), (4, -6, -2), alpha1=8, alpha2=20, color=(0.6, 0.6, 0.5)),
    ]
    centers = [(0, -101, 0), (-1.2, -0.3, 0), (0.3, 0, -0.5), (1.3, -0.6, 0.8 + 2**-52), (1.3, -0.6, 0.8)]
    colors = [(0.8, 0.8, 0.8), (0.9, 0.3, 0.3), (0.2, 0.6, 0.9), (0.9, 0.8, 0.3), (0.9, 0.8, 0.3)]
    return cltrace.Scene.from_spheres(
        camera, lights, centers, radii=[100, 0.7, 1, 0.4, 0.4], colors=colors, ka=0.8, kd=0.8, ks=0.5, exponent=30
    )


def _list(spec: str | None = None) -> int:
    try:
        wanted, problem = choose(spec).spec, ""
    except CltraceError as error:
        wanted, problem = None, str(error).splitlines()[0]
    every = {device.spec: device.line() for device in devices()}
    print(json.dumps({"wanted": wanted, "problem": problem, "devices": every}))
    return 0


def _draw(spec: str) -> int:
    """Draws, and compares with the reference."""
    scene = picture()
    try:
        renderer = cltrace.Renderer(scene, spec, outputs=("rgb8", "id"))
        image = renderer.render()
    except CltraceError as error:
        print(" ".join(str(error).split()))
        return error.exit_code
    report = check(scene, image, renderer.precision, 48 * 36)
    if report.ok:
        print(f"{report.pixels} pixels in {renderer.precision} precision are as the reference draws them")
        return 0
    print(" ".join(str(report).split()))
    return 1


if __name__ == "__main__":
    task, *rest = sys.argv[1:]
    tasks: dict[str, Callable[..., int]] = {"draw": _draw, "devices": _list}
    sys.exit(tasks[task](*rest))
