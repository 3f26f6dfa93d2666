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
from cltrace.bench.tracers import ACROSS, Run, too_rich
from cltrace.scene import AMBIENT, POINT, Scene

from .peer import Peer, PeerError, call, seconds, seen_from_the_eye, understood

# Rays that differ by more of the full colour have more between them.
THRESHOLD = 0.05


class PovRay(Peer):
    """POV-Ray. kernel: what it calls trace time; whole: the whole process, which reads the scene and writes a PNG.

    level: with its own antialiasing, of as many rays across a pixel where neighbours differ.
    """

    name = "POV-Ray"

    def __init__(self, program: str, folder: Path, version: str = "", level: int | None = None) -> None:
        super().__init__(program, folder)
        self.version = version
        if level:
            self.task, self.level, self.variant = "samples", level, "antialiasing"

    def refuses(self, scene: Scene) -> str:
        many = "too many spheres to write as text" if len(scene.spheres) > 20_000 else ""
        return too_rich(scene) or _one_light(scene) or many

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
        material = scene.materials[scene.spheres["material"]]
        light = seen_from_the_eye(scene, _shining(scene)["position"])[0]
        centers = seen_from_the_eye(scene, scene.spheres["center"])

        def vector(v: NDArray[np.float64]) -> str:
            return f"<{','.join(map(repr, v.tolist()))}>"

        with path.open("w", encoding="ascii") as file:
            file.write(
                "#version 3.7; global_settings{assumed_gamma 1 ambient_light rgb 1}\n"
                f"background{{rgb {vector(np.array(scene.background))}}}\n"
                f"camera{{{kind} location 0 direction -z right x*{2 * x!r} up y*{2 * y!r}}}\n"
                f"light_source{{{vector(light)} rgb 1}}\n"
            )
            for center, radius, m in zip(centers, scene.spheres["radius"].tolist(), material, strict=True):
                finish = f"ambient {m['ka']} diffuse {m['kd']} phong {m['ks']} phong_size {m['exponent']}"
                look = f"pigment{{rgb {vector(m['color'])}}} finish{{{finish}}}"
                file.write(f"sphere{{{vector(center)},{radius!r} {look}}}\n")


def _one_light(scene: Scene) -> str:
    """Why a scene is not written for POV-Ray; empty if it is."""
    lights = _shining(scene)
    used = scene.materials[np.unique(scene.spheres["material"])]
    if len(lights) != 1 or lights["kind"][0] != POINT or (lights["color"] != 1).any():
        return "not one white point light"
    if not len(used) or any((used[name] != used[name][0]).any() for name in ("ka", "kd", "ks", "exponent")):
        return "materials that differ"
    if used["exponent"][0] != 50 or (used["ka"][0] > 0 and (_ambient(scene) != 1).any()):
        return "another exponent than 50, or another ambient light than 1"
    return ""


def _shining(scene: Scene) -> NDArray[np.void]:
    """The lights that are neither ambient nor black."""
    lights: NDArray[np.void] = scene.lamps[(scene.lamps["kind"] != AMBIENT) & scene.lamps["color"].any(axis=1)]
    return lights


def _ambient(scene: Scene) -> NDArray[np.float64]:
    total: NDArray[np.float64] = scene.lamps["color"][scene.lamps["kind"] == AMBIENT].sum(axis=0)
    return total


def tracers(folder: Path) -> Iterable[Peer]:
    """POV-Ray, if it is on the PATH."""
    program = shutil.which("povray")
    if not program:
        raise PeerError("POV-Ray is not installed (Debian: povray)")
    version = next(iter(re.findall(r"POV-Ray (\d[\w.]*)", call([program, "--version"]).stderr)), "")
    return [PovRay(program, folder, version, level) for level in (None, *ACROSS)]
