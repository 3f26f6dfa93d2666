"""Other programs that draw the same scenes: Embree and POV-Ray here, Mitsuba 3 in mitsuba.py.

A peer gets its scene in camera space, as a careful user of a tracer in single precision hands it over.
"""

from __future__ import annotations

import json
import math
import re
import shutil
import struct
import subprocess
import tempfile
import time
from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from cltrace.base.arrays import processors
from cltrace.scene import AMBIENT, LAMBERT, PARALLEL, POINT, SPOT, Scene

from .scenes import Floats, Task
from .tracers import ACROSS, FEW_ACROSS, OTHER_LIGHTS, BenchTracer, Run, has

# How long a peer may take for a picture; for more than two it has the time of two, as only short frames are repeated.
PEER_SECONDS = 120


class PeerError(Exception):
    """A peer failed, or is not installed; str() is one line."""


def installed(folder: Path) -> tuple[list[BenchTracer], list[str]]:
    """The peers that are here, and for each other one why it is not. folder: where they may keep files."""
    from . import mitsuba  # which needs this module

    found: list[BenchTracer] = []
    missing = []
    for tracers in (embree_tracers, povray_tracers, mitsuba.tracers):
        try:
            found += tracers(folder)
        except PeerError as error:
            missing.append(str(error))
    return found, missing


def limit_of(frames: int) -> float:
    """How many seconds a peer may take for so many pictures."""
    return PEER_SECONDS * min(frames, 2)


def call(command: list[str], frames: int = 1) -> subprocess.CompletedProcess[str]:
    """Runs a peer's program, which draws so many pictures. Raises PeerError if it fails, or takes too long."""
    name, limit = Path(command[0]).name, limit_of(frames)
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        raise PeerError(f"{name} took more than {limit:g} s") from None
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        raise PeerError(f"{name} failed with status {done.returncode}: {last}")
    return done


# ---------------------------------------------------------------------------------------------- scenes in camera space


def in_camera_space(scene: Scene, points: Floats) -> Floats:
    """Points (n, 3), seen from the eye."""
    return np.asarray((points - np.array(scene.camera.position)) @ np.array(scene.camera.basis()).T)


def triangles(scene: Scene) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Corners and normals (n, 3, 3) of all triangles in camera space, and their materials (n,).

    Corners go around counterclockwise, seen from the front. Normals are of length 1; a flat triangle has its own.
    """
    corners, normals, materials = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 3))], [np.zeros(0, np.int64)]
    for mesh in scene.meshes:
        shape, back = mesh.geometry, (mesh.front < 0)[:, None]
        places = in_camera_space(scene, mesh.vertices)[np.where(back, shape.faces[:, ::-1], shape.faces)]
        flat = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
        given = np.concatenate([shape.normals @ mesh.normal_to_world.T, np.zeros((1, 3))])
        of = np.where(back, shape.normal_of[:, ::-1], shape.normal_of)
        smooth = (given @ np.array(scene.camera.basis()).T)[of]
        normal = np.where((of < 0)[..., None], flat[:, None], smooth)
        corners.append(places)
        normals.append(normal / np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300))
        materials.append(np.full(len(places), mesh.material))
    return np.concatenate(corners), np.concatenate(normals), np.concatenate(materials)


@dataclass(frozen=True)
class PeerLight:
    """A light that is not ambient, in camera space.

    kind: PARALLEL, POINT, SPOT or LAMBERT; color: (3,); place: (3,), of a parallel one the way to it; axis: (3,), along
    its light, of length 1; angles: of a spot light, rad from the axis, to where it is full and to where it ends.
    """

    kind: int
    place: Floats
    color: Floats
    axis: Floats
    angles: tuple[float, float]


def lights(scene: Scene) -> tuple[Floats, list[PeerLight]]:
    """The ambient light (3,), and the others."""
    found, basis = [], np.array(scene.camera.basis())
    for light in scene.lamps[scene.lamps["kind"] != AMBIENT]:
        kind, axis = int(light["kind"]), basis @ light["direction"] / (np.linalg.norm(light["direction"]) or 1)
        place = -axis if kind == PARALLEL else in_camera_space(scene, light["position"][None])[0]
        inner, outer = np.radians([light["alpha1"], light["alpha2"]]).tolist()
        found.append(PeerLight(kind, place, light["color"], axis, (inner, outer)))
    return scene.lamps["color"][scene.lamps["kind"] == AMBIENT].sum(axis=0), found


class PeerProgram(BenchTracer):
    """A program that reads a scene from a file, which is written once for each scene, in a folder of its own."""

    def __init__(self, program: str, folder: Path, version: str) -> None:
        self._program, self.version = program, version
        self._folder = Path(tempfile.mkdtemp(dir=folder))
        self._written: Scene | None = None

    def _file(self, scene: Scene) -> str:
        path = self._folder / "scene"
        if self._written is not scene:
            self._written = None
            self._write(scene, path)
            self._written = scene
        return str(path)

    @abstractmethod
    def _write(self, scene: Scene, path: Path) -> None: ...


# -------------------------------------------------------------------------------------------------------------- Embree

# As embree.cpp reads them.
KINDS = {AMBIENT: 0, PARALLEL: 1, POINT: 2, SPOT: 3, LAMBERT: 4}
COLUMNS = ("color", "ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index")
# Fast mathematics, except for infinity, which ends shadow rays of parallel lights.
BUILD = ("-O3", "-march=native", "-ffast-math", "-fno-finite-math-only", "-std=c++17")


Kind = tuple[str, Task, int | None]


class Embree(PeerProgram):
    """Embree in single precision: its spheres, triangles and cones, in the way of embree.cpp that is fastest.

    variant: "robust" with Embree's flag of that name; task: with "samples", level x level rays a pixel; with
    "positions", each frame is with building the tree.
    """

    name = "Embree"

    def __init__(self, program: str, folder: Path, version: str, kind: Kind = ("", "frame", None)) -> None:
        super().__init__(program, folder, version)
        self.variant, self.task, self.level = kind
        self.grows = kind == ("", "frame", None)
        self._way = ""

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        return has(scene, "ellipsoids", "textures")

    def run(self, scene: Scene, frames: int) -> Run:
        width, height = scene.camera.resolution
        path, out, robust = self._file(scene), self._folder / "embree.rgb", str(int(self.variant == "robust"))
        best, whole = [math.inf], math.inf
        for way in self._way or "012":
            # The first frame of all does not choose a way.
            count = frames if self._way else max(frames, 2)
            done = call([self._program, path, str(count), str(out), robust, way], count)
            found = json.loads(done.stdout)
            seconds = [frame + (found["build"] if self.task == "positions" else 0) for frame in found["frames"]]
            if min(seconds) < min(best):
                best, whole, fastest = seconds, min(found["frames"]) + found["build"], way
                rgb8 = np.fromfile(out, np.uint8).reshape(height, width, 3)
        self._way = fastest
        return Run(best, whole, rgb8)

    def command(self, scene: Scene) -> list[str]:
        """Reads the scene, builds the tree, draws one picture and writes its bytes."""
        return [self._program, self._file(scene), "1", str(self._folder / "embree.rgb"), "0", self._way or "0"]

    def _write(self, scene: Scene, path: Path) -> None:
        """The Head and the arrays of embree.cpp. Of another scene another way may be the fastest."""
        self._way = ""
        camera, spheres, rods = scene.camera, scene.spheres, scene.cylinders
        (corners, normals, material), (ambient, others) = triangles(scene), lights(scene)
        every = [PeerLight(AMBIENT, np.zeros(3), ambient, np.zeros(3), (0, 0)), *others]
        counts = (len(spheres), len(corners), len(rods), len(scene.materials), len(every))
        samples = self.level or 1 if self.task == "samples" else 1
        sizes = (*camera.resolution, samples, camera.max_bounces, int(camera.parallel), *counts)
        materials = np.column_stack([scene.materials[name].reshape(len(scene.materials), -1) for name in COLUMNS])
        balls = np.column_stack([in_camera_space(scene, spheres["center"]), spheres["radius"]])
        ends = [np.column_stack([in_camera_space(scene, rods[end]), rods["radius"]]) for end in ("start", "end")]
        material_of = np.concatenate([spheres["material"], material, rods["material"]])
        parts = [balls, np.column_stack(ends), corners, normals, material_of.astype("<i4"), materials]
        with path.open("wb") as file:
            floats = (*camera.image_plane(), *scene.background)
            file.write(struct.pack("<10i5fi", *sizes, *floats, 0))
            for part in parts:
                file.write((part if part.dtype == "<i4" else part.astype("<f4")).tobytes())
            for of in every:
                file.write(struct.pack("<i11f", KINDS[of.kind], *of.place, *of.color, *of.axis, *of.angles))


def embree_tracers(folder: Path) -> list[Embree]:
    """Embree as it is, and robust; with samples, and for what moves.

    The system's compiler builds the program for this machine. Raises PeerError if it cannot.
    """
    compiler, program = shutil.which("c++") or shutil.which("g++"), str(folder / "embree")
    if not compiler:
        raise PeerError("Embree: there is no C++ compiler")
    try:
        source = str(Path(__file__).with_name("embree.cpp"))
        call([compiler, *BUILD, source, "-o", program, "-lembree3", "-lpthread"])
    except PeerError as error:
        raise PeerError(f"Embree 3 is not installed with its headers (Debian: libembree-dev): {error}") from None
    version = call([program]).stdout.strip()
    kinds: list[Kind] = [("", "frame", None), ("robust", "frame", None)]
    kinds += [("samples", "samples", across) for across in ACROSS]
    kinds += [("", "cameras", None), ("", "positions", None)]
    return [Embree(program, folder, version, kind) for kind in kinds]


# ------------------------------------------------------------------------------------------------------------- POV-Ray

# Rays that differ by more of the full colour have more between them.
THRESHOLD = 0.05
# More are too much text.
MOST_SPHERES, MOST_TRIANGLES = 20_000, 250_000
# A parallel light is so far away.
FAR = 1e5


class PovRay(PeerProgram):
    """POV-Ray, in double precision. frames: what it calls trace time; whole: the whole process, which writes a PNG.

    level: with its own antialiasing, of as many rays across a pixel where neighbours differ.
    """

    name = "POV-Ray"

    def __init__(self, program: str, folder: Path, version: str, level: int | None = None) -> None:
        super().__init__(program, folder, version)
        if level:
            self.task, self.level, self.variant = "samples", level, "antialiasing"

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        many = len(scene.spheres) > MOST_SPHERES or scene.triangles > MOST_TRIANGLES
        # Light goes through its glass, where it has a shadow here.
        beyond = has(scene, "cylinders", "ellipsoids", "textures", "glass", OTHER_LIGHTS)
        return beyond or (("too much text",) if many else ())

    def command(self, scene: Scene) -> list[str]:
        """Reads the scene, draws it with all processors and writes a PNG."""
        width, height = scene.camera.resolution
        depth = (self.level or 1).bit_length() - 1
        smooth = [f"+A{THRESHOLD}", "+AM2", f"+R{depth}", "-J"] if depth else ["-A"]
        options = [f"+W{width}", f"+H{height}", *smooth, "-D", f"+WT{processors()}", "File_Gamma=1.0"]
        return [self._program, f"+I{self._file(scene)}", f"+O{self._folder / 'povray.png'}", *options]

    def run(self, scene: Scene, frames: int) -> Run:
        command = self.command(scene)
        start = time.perf_counter()
        done = call(command)
        whole = time.perf_counter() - start
        with Picture.open(self._folder / "povray.png") as picture:
            rgb8 = np.asarray(picture.convert("RGB"))
        traced = re.findall(r"Trace Time:.*\(([0-9.]+) seconds\)", done.stderr)
        return Run([max(float(traced[-1]), 1e-3)], whole, rgb8)

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
            place, more = (light.place * FAR, " parallel point_at 0") if light.kind == PARALLEL else (light.place, "")
            text.append(f"light_source{{{_vector(place)} rgb {_vector(light.color)}{more}}}")
        for k, m in enumerate(scene.materials):
            # What it mirrors is added to its own colour.
            ka, kd, ks = (m[name] * (1 - m["reflectance"]) for name in ("ka", "kd", "ks"))
            finish = f"ambient {ka} diffuse {kd} phong {ks} phong_size {m['exponent']} reflection {m['reflectance']}"
            text.append(f"#declare M{k}=texture{{pigment{{rgb {_vector(m['color'])}}} finish{{{finish}}}}}")
        balls = zip(in_camera_space(scene, scene.spheres["center"]), scene.spheres, strict=True)
        text += [f"sphere{{{_vector(c)},{float(b['radius'])!r} texture{{M{b['material']}}}}}" for c, b in balls]
        corners, normals, material_of = triangles(scene)
        for material in np.unique(material_of):
            mine, parts = material_of == material, []
            for name, rows in (("vertex_vectors", corners[mine]), ("normal_vectors", normals[mine])):
                vectors = ",".join(f"<{x},{y},{z}>" for x, y, z in rows.reshape(-1, 3).tolist())
                parts.append(f"{name}{{{3 * len(rows)},{vectors}}}")
            faces = ",".join(f"<{3 * k},{3 * k + 1},{3 * k + 2}>" for k in range(mine.sum()))
            parts += [f"{name}{{{mine.sum()},{faces}}}" for name in ("face_indices", "normal_indices")]
            text.append(f"mesh2{{{' '.join(parts)} texture{{M{material}}}}}")
        path.write_text("\n".join(text), "ascii")


def _vector(v: Iterable[float]) -> str:
    return f"<{','.join(map(repr, map(float, v)))}>"


def povray_tracers(folder: Path) -> Iterable[BenchTracer]:
    """POV-Ray, if it is on the PATH."""
    program = shutil.which("povray")
    if not program:
        raise PeerError("POV-Ray is not installed (Debian: povray)")
    version = next(iter(re.findall(r"POV-Ray (\d[\w.]*)", call([program, "--version"]).stderr)), "unknown")
    return [PovRay(program, folder, version, level) for level in (None, *FEW_ACROSS)]
