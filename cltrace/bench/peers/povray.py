"""POV-Ray, in double precision."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from cltrace.base.arrays import processors
from cltrace.bench.tracers import FEW_ACROSS, OTHER_LIGHTS, Run, strange
from cltrace.scene import Scene

from .peer import Peer, PeerError, Triangles, call, lights, seconds, seen_from_the_eye, triangles, understood

# Rays that differ by more of the full colour have more between them.
THRESHOLD = 0.05
# More are too much text.
MOST_SPHERES, MOST_TRIANGLES = 20_000, 250_000
# So far away is a parallel light.
FAR = 1e5


class PovRay(Peer):
    """POV-Ray. kernel: what it calls trace time; whole: the whole process, which reads the scene and writes a PNG.

    level: with its own antialiasing, of as many rays across a pixel where neighbours differ.
    """

    name = "POV-Ray"
    afresh = True

    def __init__(self, program: str, folder: Path, version: str = "", level: int | None = None) -> None:
        super().__init__(program, folder)
        self.version = version
        if level:
            self.task, self.level, self.variant = "samples", level, "antialiasing"

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        many = len(scene.spheres) > MOST_SPHERES or scene.triangles > MOST_TRIANGLES
        # Light goes through its glass, where it has a shadow here.
        return strange(scene, "cylinders", "ellipsoids", "textures", "glass",
                       OTHER_LIGHTS) or (("too much text",) if many else ())  # fmt: skip

    def command(self, scene: Scene) -> list[str]:
        """Reads the scene, draws it with all processors and writes a PNG."""
        path, out = self._file(scene, ".pov"), self._folder / "povray.png"
        width, height = scene.camera.resolution
        depth = int(self.level or 1).bit_length() - 1
        smooth = [f"+A{THRESHOLD}", "+AM2", f"+R{depth}", "-J"] if depth else ["-A"]
        options = [f"+W{width}", f"+H{height}", *smooth, "-D", f"+WT{processors()}", "File_Gamma=1.0"]
        return [self._program, f"+I{path}", f"+O{out}", *options]

    def run(self, scene: Scene, frames: int) -> Run:
        command = self.command(scene)
        width, height = scene.camera.resolution
        start = time.perf_counter()
        done = call(command)
        whole = time.perf_counter() - start
        with understood(self._program):
            with Picture.open(self._folder / "povray.png") as picture:
                rgb8 = np.asarray(picture.convert("RGB")).reshape(height, width, 3)
            traced = re.findall(r"Trace Time:.*\(([0-9.]+) seconds\)", done.stderr)
            return Run([seconds(traced[-1])], whole, rgb8)

    def _write(self, scene: Scene, path: Path) -> None:
        x, y = scene.camera.image_plane()
        kind = "orthographic" if scene.camera.parallel else "perspective"
        ambient, others = lights(scene)
        text = [
            f"#version 3.7; global_settings{{assumed_gamma 1 ambient_light rgb {_vector(ambient)}",
            f"max_trace_level {scene.camera.max_bounces + 2}}} background{{rgb {_vector(scene.background)}}}",
            f"camera{{{kind} location 0 direction -z right x*{2 * x!r} up y*{2 * y!r}}}",
        ]
        for light in others:
            place, more = (light.place * FAR, " parallel point_at 0") if light.parallel else (light.place, "")
            text.append(f"light_source{{{_vector(place)} rgb {_vector(light.color)}{more}}}")
        text += [f"#declare M{k}={_look(m)}" for k, m in enumerate(scene.materials)]
        balls = zip(seen_from_the_eye(scene, scene.spheres["center"]), scene.spheres, strict=True)
        text += [f"sphere{{{_vector(c)},{float(b['radius'])!r} texture{{M{b['material']}}}}}" for c, b in balls]
        mesh = triangles(scene)
        smooth = mesh.normal_of[:, 0] >= 0
        for material in np.unique(mesh.material):
            for mine in ((mesh.material == material) & smooth, (mesh.material == material) & ~smooth):
                if mine.any():
                    text.append(f"mesh2{{{_mesh(mesh, mine)} texture{{M{material}}}}}")
        path.write_text("\n".join(text), "ascii")


def _vector(v: Iterable[float]) -> str:
    return f"<{','.join(map(repr, map(float, v)))}>"


def _mesh(mesh: Triangles, mine: NDArray[np.bool_]) -> str:
    """The lists of these triangles, which all have normals, or none of them."""
    lists = {"vertex_vectors": mesh.vertices, "face_indices": mesh.corners[mine]}
    if (mesh.normal_of[mine] >= 0).all():
        lists = {"vertex_vectors": mesh.vertices, "normal_vectors": mesh.normals, "face_indices": mesh.corners[mine],
                 "normal_indices": mesh.normal_of[mine]}  # fmt: skip
    texts = {name: ",".join(f"<{x},{y},{z}>" for x, y, z in rows.tolist()) for name, rows in lists.items()}
    return " ".join(f"{name}{{{len(lists[name])},{text}}}" for name, text in texts.items())


def _look(m: np.void) -> str:
    """A texture. What it mirrors is added to its own colour."""
    ka, kd, ks = (m[name] * (1 - m["reflectance"]) for name in ("ka", "kd", "ks"))
    finish = f"ambient {ka} diffuse {kd} phong {ks} phong_size {m['exponent']} reflection {m['reflectance']}"
    return f"texture{{pigment{{rgb {_vector(m['color'])}}} finish{{{finish}}}}}"


def tracers(folder: Path) -> Iterable[Peer]:
    """POV-Ray, if it is on the PATH."""
    program = shutil.which("povray")
    if not program:
        raise PeerError("POV-Ray is not installed (Debian: povray)")
    version = next(iter(re.findall(r"POV-Ray (\d[\w.]*)", call([program, "--version"]).stderr)), "unknown")
    return [PovRay(program, folder, version, level) for level in (None, *FEW_ACROSS)]
