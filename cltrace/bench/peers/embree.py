"""Embree in single precision. Its program is embree.cpp, which the system's compiler builds for this machine."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cltrace.bench.tracers import Run
from cltrace.scene import AMBIENT, LAMBERT, PARALLEL, POINT, SPOT, PlacedMesh, Scene

from .peer import Peer, PeerError, call, seconds, seen_from_the_eye, understood

# As embree.cpp reads them.
_KINDS = {AMBIENT: 0, PARALLEL: 1, POINT: 2, SPOT: 3, LAMBERT: 4}
_COLUMNS = ("color", "ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index")
# Fast mathematics, but for infinity, which ends shadow rays of parallel lights.
_FLAGS = ("-O3", "-march=native", "-ffast-math", "-fno-finite-math-only", "-std=c++17")


class Embree(Peer):
    """Embree's spheres, triangles and cones, in the way of its program that is fastest. whole: with building the tree.

    variant: "robust" with Embree's flag of that name; samples: rays a pixel, across and down.
    """

    name = "Embree"

    def __init__(self, program: str, folder: Path, variant: str = "", samples: int = 1) -> None:
        super().__init__(program, folder)
        self.variant, self.samples = variant, samples
        self.grows = not variant

    def refuses(self, scene: Scene) -> str:
        has = {
            "ellipsoids": bool((scene.spheres["to_object"] >= 0).any()),
            "textures": bool((scene.materials["texture"] >= 0).any()),
        }
        return ", ".join(name for name, there in has.items() if there)

    def run(self, scene: Scene, frames: int) -> Run:
        path, out = self._file(scene, ".embree"), self._folder / "embree.rgb"
        done = call(
            [self._program, str(path), str(frames), str(out), *(["robust"] if self.variant == "robust" else [])]
        )
        width, height = scene.camera.resolution
        with understood(self._program):
            report = json.loads(done.stdout)
            kernel, build = [seconds(value) for value in report["frames"]], seconds(report["build"])
            rgb8 = np.fromfile(out, np.uint8).reshape(height, width, 3)
        return Run(kernel, min(kernel) + build, rgb8)

    def _write(self, scene: Scene, path: Path) -> None:
        """The Head and the arrays of embree.cpp."""
        camera, spheres, rods = scene.camera, scene.spheres, scene.cylinders
        mesh = _joined(scene)
        counts = (
            len(spheres),
            len(mesh["vertices"]),
            len(mesh["normals"]),
            len(mesh["corners"]),
            len(rods),
            len(scene.materials),
        )
        sizes = (*camera.resolution, self.samples, camera.max_bounces, int(camera.parallel), *counts, len(scene.lamps))
        materials = np.column_stack([scene.materials[name].reshape(len(scene.materials), -1) for name in _COLUMNS])
        balls = np.column_stack([seen_from_the_eye(scene, spheres["center"]), spheres["radius"]])
        ends = [np.column_stack([seen_from_the_eye(scene, rods[end]), rods["radius"]]) for end in ("start", "end")]
        parts: list[tuple[NDArray[np.generic], str]] = [
            (balls, "<f4"), (mesh["vertices"], "<f4"), (mesh["normals"], "<f4"), (mesh["corners"], "<i4"),
            (mesh["normal_of"], "<i4"), (np.column_stack(ends), "<f4"),
            (np.concatenate([spheres["material"], mesh["materials"], rods["material"]]), "<i4"), (materials, "<f4"),
        ]  # fmt: skip
        with path.open("wb") as file:
            file.write(struct.pack("<12i5f", *sizes, *camera.image_plane(), *scene.background))
            for array, kind in parts:
                file.write(array.astype(kind).tobytes())
            file.writelines(_light(scene, light) for light in scene.lamps)


def _light(scene: Scene, light: np.void) -> bytes:
    """A Light of embree.cpp."""
    basis = np.array(scene.camera.basis())
    axis = basis @ (light["direction"] / (np.linalg.norm(light["direction"]) or 1.0))
    place = -axis if light["kind"] == PARALLEL else seen_from_the_eye(scene, light["position"][None])[0]
    angles = np.radians([light["alpha1"], light["alpha2"]])
    return struct.pack("<i11f", _KINDS[int(light["kind"])], *place, *light["color"], *axis, *angles)


def _joined(scene: Scene) -> dict[str, NDArray[np.generic]]:
    """All triangles of a scene, in camera space: vertices, normals, and for each its corners, normals and material.

    The corners are in the order in which Embree's normal points to the front.
    """
    basis = np.array(scene.camera.basis())
    parts = [_part(mesh, basis) for mesh in scene.meshes]
    firsts = {name: np.cumsum([0, *(len(part[name]) for part in parts)]) for name in ("vertices", "normals")}
    for k, part in enumerate(parts):
        part["vertices"] = seen_from_the_eye(scene, part["vertices"])
        part["corners"] = part["corners"] + firsts["vertices"][k]
        part["normal_of"] = np.where(part["normal_of"] < 0, -1, part["normal_of"] + firsts["normals"][k])
    shapes = {"vertices": (0, 3), "normals": (0, 3), "corners": (0, 3), "normal_of": (0, 3), "materials": (0,)}
    return {name: np.concatenate([np.zeros(shape), *(part[name] for part in parts)]) for name, shape in shapes.items()}


def _part(mesh: PlacedMesh, basis: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    shape, back = mesh.geometry, mesh.front < 0

    def turned(corners: NDArray[np.int32]) -> NDArray[np.int32]:
        return np.where(back[:, None], corners[:, ::-1], corners)

    normals = shape.normals @ mesh.normal_to_world.T @ basis.T
    materials = np.full(len(shape.faces), mesh.material)
    return {
        "vertices": mesh.vertices,
        "normals": normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300),
        "corners": turned(shape.faces),
        "normal_of": turned(shape.normal_of),
        "materials": materials,
    }


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
    """Embree as it is, and robust."""
    program = build(folder)
    return [Embree(program, folder), Embree(program, folder, "robust")]
