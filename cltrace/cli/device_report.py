"""`cltrace --doctor --report`: what is to be sent of a device that nobody has tried yet, in one text file.

python -m cltrace.cli.device_report P:D        prints the lines on a device as one JSON list
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyopencl as cl

import cltrace
from cltrace.base.errors import CltraceError
from cltrace.cli.doctor import examine, picture
from cltrace.cli.output_files import naming
from cltrace.picture.files import whole_file
from cltrace.plan.abi import Precision
from cltrace.plan.request import PRECISIONS
from cltrace.run.devices import Device, choose
from cltrace.run.trial import child
from cltrace.students.check import check

# What decides how the kernel runs on a device, by OpenCL's names.
LIMITS = (
    "VERSION",
    "DRIVER_VERSION",
    "MAX_COMPUTE_UNITS",
    "MAX_CLOCK_FREQUENCY",
    "MAX_WORK_GROUP_SIZE",
    "MAX_WORK_ITEM_SIZES",
    "GLOBAL_MEM_SIZE",
    "MAX_MEM_ALLOC_SIZE",
    "GLOBAL_MEM_CACHE_SIZE",
    "LOCAL_MEM_SIZE",
    "MAX_CONSTANT_BUFFER_SIZE",
    "MEM_BASE_ADDR_ALIGN",
    "NATIVE_VECTOR_WIDTH_FLOAT",
    "NATIVE_VECTOR_WIDTH_DOUBLE",
    "SINGLE_FP_CONFIG",
    "DOUBLE_FP_CONFIG",
    "EXTENSIONS",
)
FRAMES = 5  # of which the fastest counts
# Seconds until a device is given up: it builds fifteen kernels, of which a driver may take a minute each.
PATIENCE = 1200


class Trial(NamedTuple):
    """A scene that the device draws. checked: whether the reference is fast enough to draw it, too."""

    name: str
    scene: Callable[[], cltrace.Scene]
    checked: bool


def report(spec: str | None, target: str, say: Callable[[str], None] = print) -> int:
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
            ended, answer = child("-m", __name__, name, patience=PATIENCE)
            lines += ["", *(json.loads(answer) if ended == 0 else [f"device     {name} FAILS: {answer}"])]
        file.write("\n".join([*lines, ""]).encode())
    say(f"wrote {target}")
    return status


def lines_on(device: Device) -> Iterator[str]:
    """A device's limits, then what it draws: how many pixels are wrong, and how long a build and a frame take."""
    yield f"device     {device.line()}"
    for name in LIMITS:
        try:
            value = device.cl.get_info(getattr(cl.device_info, name))
        except cl.Error as error:
            value = error
        yield f"{name.lower():<30} {' '.join(str(value).split())}"
    yield f"{'width':<30} {device.width}"
    for trial in TRIALS:
        for precision in PRECISIONS if device.has_double else ("single",):
            try:
                yield f"{trial.name + ', ' + precision:<30} {_tried(trial, device, precision)}"
            except CltraceError as error:
                yield f"{trial.name + ', ' + precision:<30} FAILS: {' '.join(str(error).split())}"


def _tried(trial: Trial, device: Device, precision: Precision) -> str:
    scene = trial.scene()
    renderer = cltrace.Renderer(scene, device, precision, outputs=("rgb8", "id"))
    images = [renderer.render() for _ in range(FRAMES)]
    frame = min(image.seconds["kernel"] for image in images)
    times = f"build {1000 * renderer.seconds['build']:.0f} ms, frame {1000 * frame:.3g} ms"
    if not trial.checked:
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


TRIALS = (
    Trial("spheres", picture, True),
    Trial("mirrors and glass", _mirrors, True),
    Trial("a mesh", _mesh, True),
    Trial("1,000 spheres", lambda: _many(1_000), False),
    Trial("100,000 spheres", lambda: _many(100_000), False),
)


if __name__ == "__main__":
    print(json.dumps(list(lines_on(choose(sys.argv[1])))))
