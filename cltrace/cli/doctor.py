"""`cltrace --doctor` and its --report: what is installed, where its drivers are, and whether each device draws what the
reference says.

A driver can end the whole process, as LLVM does where it cannot translate an instruction. So whatever loads one is done
in a child process, whose death is then a line of the report:

    python -m cltrace.cli.doctor devices [SPEC]    prints one JSON object: all devices, and the one that SPEC means
    python -m cltrace.cli.doctor draw P:D [WIDTH]  draws a small picture; without WIDTH, status 0 if it is right
    python -m cltrace.cli.doctor report P:D        prints the lines of --report on a device as one JSON list
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import sys
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path

import numpy as np
import pyopencl as cl

import cltrace
from cltrace.base.errors import CltraceError
from cltrace.cli.files import naming
from cltrace.picture.files import whole_file
from cltrace.plan.abi import Precision
from cltrace.plan.request import PRECISIONS
from cltrace.run import caches
from cltrace.run.devices import Device, choose, devices, where_drivers_are
from cltrace.run.trial import child
from cltrace.students.check import check

LOAD = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"
FRAMES = 5  # of which the fastest counts
# Seconds until a device is given up: it builds fifteen kernels, of which a driver may take a minute each.
PATIENCE = 1200


PACKAGES = ("numpy", "pyopencl", "lxml", "pillow", "pocl-binary-distribution", "intel-opencl-rt")


def doctor(spec: str | None = None, say: Callable[[str], None] = print) -> int:
    """Reports on this installation, line by line. Returns 0 if the device that `spec` means (None: the default) draws
    the picture that the reference draws, else 3. With a spec, only that device is tried.
    """
    return examine(spec, say)[0]


def examine(spec: str | None, say: Callable[[str], None]) -> tuple[int, list[str]]:
    """doctor()'s status, and the specs of the devices that draw that picture."""
    for line in [_versions(), *_drivers(), *_caches()]:
        say(line)
    status, answer = child("-m", __name__, "devices", *([] if spec is None else [spec]))
    if status != 0:
        say(f"devices    {answer}")
        return _advise(say, []), []
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
        return 0, well
    if wanted is None:
        say(f"devices    {listing['problem']}")
        for line in every.values():
            say(f"           {line}")
        if spec not in (None, "gpu"):  # only the name is wrong
            return 3, well
    return _advise(say, well), well


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

    Doubles cannot tell which of the two is first: so a device with two programs has to compile both, see
    cltrace/run/undecided.py.
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


def _draw(spec: str, width: str | None = None) -> int:
    """Draws, and without a width compares with the reference: else a picture that is drawn is enough."""
    scene = picture()
    try:
        renderer = cltrace.Renderer(scene, spec, outputs=("rgb8", "id"), width=None if width is None else int(width))
        image = renderer.render()
    except CltraceError as error:
        print(" ".join(str(error).split()))
        return error.exit_code
    if width is not None:
        return 0
    report = check(scene, image, renderer.precision, 48 * 36)
    if report.ok:
        print(f"{report.pixels} pixels in {renderer.precision} precision are as the reference draws them")
        return 0
    print(" ".join(str(report).split()))
    return 1


def write_report(spec: str | None, target: str, say: Callable[[str], None] = print) -> int:
    """Says what doctor() says, and writes that and the lines on each device that works into a file. Returns doctor()'s
    status. Raises UsageError if the file cannot be written.
    """
    lines: list[str] = []

    def note(line: str) -> None:
        say(line)
        lines.append(line)

    with naming(target), whole_file(Path(target)) as file:
        status, well = examine(spec, note)
        for name in well:
            ended, answer = child("-m", __name__, "report", name, patience=PATIENCE)
            lines += ["", *(json.loads(answer) if ended == 0 else [f"device     {name} FAILS: {answer}"])]
        file.write("\n".join([*lines, ""]).encode())
    say(f"wrote {target}")
    return status


def lines_on(device: Device) -> Iterator[str]:
    """A device's limits, then what it draws: how many pixels are wrong, and how long a build and a frame take."""
    yield f"device     {device.line()}"
    for name in filter(str.isupper, dir(cl.device_info)):
        with contextlib.suppress(cl.Error, ValueError):  # what this driver has not
            value = device.cl.get_info(getattr(cl.device_info, name))
            yield f"{name.lower():<30} {' '.join(str(value).split())}"
    yield f"{'width':<30} {device.width}"
    for name, (scene, checked) in TRIALS.items():
        for precision in PRECISIONS if device.has_double else ("single",):
            try:
                found = _tried(scene(), checked, device, precision)
            except CltraceError as error:
                found = f"FAILS: {' '.join(str(error).split())}"
            yield f"{f'{name}, {precision}':<30} {found}"


def _tried(scene: cltrace.Scene, checked: bool, device: Device, precision: Precision) -> str:
    renderer = cltrace.Renderer(scene, device, precision, outputs=("rgb8", "id"))
    images = [renderer.render() for _ in range(FRAMES)]
    frame = min(image.seconds["kernel"] for image in images)
    times = f"build {1000 * renderer.seconds['build']:.0f} ms, frame {1000 * frame:.3g} ms"
    if not checked:
        return times
    found = check(scene, images[0], precision, images[0].rgb8[..., 0].size)
    return f"{'ok' if found.ok else 'WRONG'}: {' '.join(str(found).split())}; {times}"


def _mirrors() -> cltrace.Scene:
    """The doctor's picture with a mirror and a ball of glass."""
    plain = picture()
    return cltrace.Scene.from_spheres(
        plain.camera,
        plain.lights,
        plain.spheres["center"],
        plain.spheres["radius"],
        reflectance=[0, 0.5, 0, 0, 0],
        transmittance=[0, 0, 0.8, 0, 0],
        index=[1, 1, 1.5, 1, 1],
    )


def _mesh() -> cltrace.Scene:
    """A bowl of 2 x 20 x 20 triangles in the doctor's light."""
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 21), np.linspace(-1.5, 1.5, 21))
    vertices = np.stack([x, 0.4 * (x * x + y * y) - 1, y], axis=-1).reshape(-1, 3)
    first = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()[:, None]
    faces = np.concatenate([first + [0, 21, 1], first + [1, 21, 22]])
    plain = picture()
    return cltrace.Scene.from_meshes(plain.camera, plain.lights, cltrace.Mesh(vertices, faces))


def _many(count: int) -> cltrace.Scene:
    """Spheres in a box, at 960x540."""
    plain, rng = picture(), np.random.default_rng(1)
    camera = cltrace.Camera((0, 1, 6), (0, 0, 0), horizontal_fov=24, resolution=(960, 540))
    return cltrace.Scene.from_spheres(camera, plain.lights, rng.uniform(-2, 2, (count, 3)), 1.5 * count ** (-1 / 3))


# The scenes that a device draws for a report, and whether the reference is fast enough to draw them, too.
TRIALS: dict[str, tuple[Callable[[], cltrace.Scene], bool]] = {
    "spheres": (picture, True),
    "mirrors and glass": (_mirrors, True),
    "a mesh": (_mesh, True),
    "1,000 spheres": (lambda: _many(1_000), False),
    "100,000 spheres": (lambda: _many(100_000), False),
}


def _report(spec: str) -> int:
    print(json.dumps(list(lines_on(choose(spec)))))
    return 0


if __name__ == "__main__":
    task, *rest = sys.argv[1:]
    tasks: dict[str, Callable[..., int]] = {"draw": _draw, "devices": _list, "report": _report}
    sys.exit(tasks[task](*rest))
