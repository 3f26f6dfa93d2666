"""Embree in single precision. Its program is embree.cpp, which the system's compiler builds for this machine."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cltrace.bench.scenes import Task, soft_lights
from cltrace.bench.tracers import ACROSS, MEMBERS, Run, strange
from cltrace.scene import AMBIENT, LAMBERT, PARALLEL, POINT, SPOT, Scene

from .peer import Light, Peer, PeerError, call, lights, seconds, seen_from_the_eye, texels, triangles, understood

# As embree.cpp reads them.
_KINDS = {AMBIENT: 0, PARALLEL: 1, POINT: 2, SPOT: 3, LAMBERT: 4}
_COLUMNS = ("color", "ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index", "texture")
# Fast mathematics, but for infinity, which ends shadow rays of parallel lights.
_FLAGS = ("-O3", "-march=native", "-ffast-math", "-fno-finite-math-only", "-std=c++17")


class Embree(Peer):
    """Embree's spheres, triangles and cones, in the way of its program that is fastest. whole: with building the tree.

    variant: "robust" with Embree's flag of that name; task: with "samples", level x level rays a pixel; with "members",
    so many of each soft light; with "positions", each frame is with building the tree.
    """

    name = "Embree"

    def __init__(
        self, program: str, folder: Path, variant: str = "", task: Task = "frame", level: int | None = None
    ) -> None:
        super().__init__(program, folder)
        self.variant, self.task, self.level = variant, task, level
        self.grows = task == "frame" and not variant
        self._way = ""

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        return strange(scene, "ellipsoids")

    def run(self, scene: Scene, frames: int) -> Run:
        if self.task == "members":
            scene = scene.lit_by(soft_lights(int(self.level or 1)))
        path, out = self._file(scene, ".embree"), self._folder / "embree.rgb"
        # A way is not chosen by the first frame of all.
        count, robust = frames if self._way else max(frames, 2), int(self.variant == "robust")
        done = call([self._program, str(path), str(count), str(out), str(robust), self._way], count)
        width, height = scene.camera.resolution
        with understood(self._program):
            report = json.loads(done.stdout)
            self._way = str(report["way"])
            kernel, build = [seconds(value) for value in report["frames"]], seconds(report["build"])
            rgb8 = np.fromfile(out, np.uint8).reshape(height, width, 3)
        if self.task == "positions":
            kernel = [frame + build for frame in kernel]
        return Run(kernel, min(report["frames"]) + build, rgb8)

    def command(self, scene: Scene) -> list[str]:
        """Reads the scene, builds the tree, draws one picture and writes its bytes."""
        return [
            self._program,
            str(self._file(scene, ".embree")),
            "1",
            str(self._folder / "embree.rgb"),
            "0",
            self._way or "0",
        ]

    def _write(self, scene: Scene, path: Path) -> None:
        """The Head and the arrays of embree.cpp. Of another scene another way may be the fastest."""
        self._way = ""
        camera, spheres, rods = scene.camera, scene.spheres, scene.cylinders
        mesh, (pixels, textures) = triangles(scene), texels(scene)
        ambient, others = lights(scene)
        every = [Light(AMBIENT, np.zeros(3), ambient, np.zeros(3), (0, 0)), *others]
        surfaces = len(spheres), len(mesh.vertices), len(mesh.normals), len(mesh.corners), len(rods)
        counts = (*surfaces, len(scene.materials), len(textures), len(pixels))
        samples = int(self.level or 1) if self.task == "samples" else 1
        sizes = (*camera.resolution, samples, camera.max_bounces, int(camera.parallel), *counts, len(every))
        materials = np.column_stack([scene.materials[name].reshape(len(scene.materials), -1) for name in _COLUMNS])
        balls = np.column_stack([seen_from_the_eye(scene, spheres["center"]), spheres["radius"]])
        ends = [np.column_stack([seen_from_the_eye(scene, rods[end]), rods["radius"]]) for end in ("start", "end")]
        parts: list[tuple[NDArray[np.generic], str]] = [
            (balls, "<f4"), (mesh.vertices, "<f4"), (mesh.normals, "<f4"), (mesh.corners, "<i4"),
            (mesh.normal_of, "<i4"), (mesh.uv, "<f4"), (np.column_stack(ends), "<f4"),
            (np.concatenate([spheres["material"], mesh.material, rods["material"]]), "<i4"), (materials, "<f4"),
            (textures, "<i4"), (pixels, "<f4"),
        ]  # fmt: skip
        with path.open("wb") as file:
            floats = (*camera.image_plane(), *scene.background, *np.ravel(camera.basis()))
            file.write(struct.pack("<14i14f", *sizes, *floats))
            for array, kind in parts:
                file.write(array.astype(kind).tobytes())
            for of in every:
                file.write(struct.pack("<i11f", _KINDS[of.kind], *of.place, *of.color, *of.axis, *of.angles))


def build(folder: Path) -> str:
    """The program, built. Raises PeerError with the reason."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if not compiler:
        raise PeerError("Embree: there is no C++ compiler")
    out = str(folder / "embree")
    source = str(Path(__file__).with_suffix(".cpp"))
    try:
        call([compiler, *_FLAGS, source, "-o", out, "-lembree3", "-lpthread"])
    except PeerError as error:
        raise PeerError(f"Embree 3 is not installed with its headers (Debian: libembree-dev): {error}") from None
    return out


def tracers(folder: Path) -> Iterable[Peer]:
    """Embree as it is, and robust; with samples; and for what moves."""
    program = build(folder)
    moving: tuple[Task, ...] = ("cameras", "positions")
    found = [
        Embree(program, folder),
        Embree(program, folder, "robust"),
        *(Embree(program, folder, "samples", "samples", level) for level in ACROSS),
        *(Embree(program, folder, "", "members", level) for level in MEMBERS),
        *(Embree(program, folder, task=task) for task in moving),
    ]
    version = call([program]).stdout.strip()
    for each in found:
        each.version = version
    return found
