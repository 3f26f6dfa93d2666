"""What Oclgrind finds in the kernel: `python tests/oclgrind.py [SCENE ...]`, by names of scenes/, all of them if none.

Oclgrind (Debian's package of this name) is an OpenCL device that interprets a program, and says where it reads or
writes beside a buffer, reads what was never written, or races. Each scene is drawn in `single` and in `accurate`, in
16x12 pixels, as by a graphics card. Prints what was found; the exit status is 1 if that is anything.

As a child of Oclgrind, with the words `draw SCENE PRECISION FILE`, it draws one of them.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl

import cltrace
from cltrace.base.limits import CHANGED
from cltrace.run import program
from cltrace.run.devices import Device

ROOT = Path(__file__).parent.parent
SIZE = (16, 12)
COMMAND = (
    "oclgrind",
    "--data-races",
    "--uninitialized",
    # What is inlined has marks of aliases, which it takes for calls of functions that are not there.
    "--build-options",
    "-O0 -Dalways_inline=unused",
    "--log",
)


def scene_of(name: str) -> cltrace.Scene:
    scene = cltrace.load(ROOT / "scenes" / f"{name}.xml")
    return scene.seen_by(replace(scene.camera, resolution=SIZE))


def without_notes(log: str) -> str:
    """A log without the races for notes of triangles' planes, of which any may be lost: see note_plane()."""
    path = "shapes/triangle/triangle.cl"
    text = (ROOT / "kernels" / path).read_text("utf-8")
    begin, end = text.index("static int first_in_plane"), text.index("\n}", text.index("static void note_plane"))
    first, last = (text.count("\n", 0, at) + 1 for at in (begin, end))
    kept = []
    for race in re.split(r"(?m)^(?=\S)", log):
        lines = [int(line) for line in re.findall(rf"At line (\d+) \(column \d+\) of kernels/{path}", race)]
        if not (race.startswith("Read-write data race") and len(lines) == 2 and all(first <= n <= last for n in lines)):
            kept.append(race)
    return "".join(kept).strip()


def faults_of(name: str, precision: str) -> str:
    """What Oclgrind says of a scene, or the bytes that differ from those of the device at hand; empty if nothing."""
    with tempfile.TemporaryDirectory() as folder:
        log, drawn = Path(folder) / "log", Path(folder) / "drawn.npy"
        child = (sys.executable, __file__, "draw", name, precision, str(drawn))
        # Its own options are not in the key of pyopencl's cache of programs.
        environment = os.environ | {
            "PYOPENCL_NO_CACHE": "1",
            "PYTHONPATH": str(ROOT),
            CHANGED: "seconds=100000",
        }
        done = subprocess.run(
            [*COMMAND, str(log), *child], env=environment, capture_output=True, text=True, check=False
        )
        found = without_notes(log.read_text("utf-8")) if log.exists() else ""
        if done.returncode or found:
            return f"{done.stderr}\n{found}"
        differing = int((np.load(drawn) != cltrace.render(scene_of(name), precision=precision).rgb8).sum())
    return f"{differing} bytes are others than those of the device at hand" if differing else ""


def draw(name: str, precision: str, path: str) -> None:
    """Draws a scene by Oclgrind and saves its bytes."""
    Device.kind = "gpu"  # type: ignore[method-assign, assignment]
    # It counts what was written by buffers of threads, and has none of the thread in which programs are built.
    program.aside = lambda build: build()
    # It does not count what is filled, so that is written.
    cl.enqueue_fill_buffer = filled
    np.save(path, cltrace.render(scene_of(name), "0:0", precision).rgb8)


def filled(queue: Any, buffer: Any, pattern: Any, offset: int, size: int) -> Any:
    return cl.enqueue_copy(queue, buffer, np.tile(pattern, size // pattern.nbytes), dst_offset=offset)


def main(names: list[str]) -> int:
    if names[:1] == ["draw"]:
        draw(*names[1:])
        return 0
    found = 0
    for name in names or sorted(path.stem for path in (ROOT / "scenes").glob("*.xml")):
        for precision in ("single", "accurate"):
            faults = faults_of(name, precision)
            print(f"{name} {precision}: {faults or 'nothing'}", flush=True)
            found += bool(faults)
    return int(found > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
