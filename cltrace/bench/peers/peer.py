"""What all peers have in common: a program reads a scene from a file and writes a picture, or a package of Python draws
in a process of its own.
"""

from __future__ import annotations

import contextlib
import importlib.util
import math
import multiprocessing
import os
import signal
import subprocess
import tempfile
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.bench.tracers import Run, Tracer
from cltrace.scene import AMBIENT, FULL, PARALLEL, PlacedMesh, Scene

Floats = NDArray[np.float64]

# How long a peer may take for a picture; for more than two it has the time of two, as only short frames are repeated.
PEER_SECONDS = 120
# New rays start off a surface by so much of the distances: the usual epsilon in single precision.
OFF = 2.0**-20


class PeerError(Exception):
    """A peer's program failed; str() is one line."""


class Peer(Tracer):
    """A program that reads a scene from a file, which is written once for each scene.

    folder: in which it gets one of its own, as other tracers with the same program write other files of a scene.
    """

    def __init__(self, program: str, folder: Path) -> None:
        self._program, self._folder = program, Path(tempfile.mkdtemp(dir=folder))
        self._scene: Scene | None = None

    def _file(self, scene: Scene, suffix: str) -> Path:
        path = self._folder / f"scene{suffix}"
        if self._scene is not scene:
            self._scene = None
            self._write(scene, path)
            self._scene = scene
        return path

    @abstractmethod
    def _write(self, scene: Scene, path: Path) -> None: ...


Draw = Callable[..., Run]


def in_turn(frame: Callable[[], NDArray[Any]], frames: int, start: float) -> tuple[list[float], float, NDArray[Any]]:
    """The seconds of each frame, those from `start` to the end of the first one, and what the last one has returned."""
    kernel, whole, last = [], 0.0, np.zeros(0, np.uint8)
    for _ in range(frames):
        begin = time.perf_counter()
        last = frame()
        end = time.perf_counter()
        whole = whole or end - start
        kernel.append(end - begin)
    return kernel, whole, last


class Company:
    """A process that calls a function for us, draw(scene, frames, *options), from the first call until we end."""

    def __init__(self, draw: Draw) -> None:
        self._draw = draw
        self._pipe: Connection | None = None

    def run(self, scene: Scene, frames: int, *options: object) -> Run:
        """What the function returns. Raises PeerError with what it raises, or if it takes too long."""
        if self._pipe is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=_serve, args=(theirs, self._draw), daemon=True)
            self._process.start()
            theirs.close()
        limit = most_seconds(frames)
        try:
            self._pipe.send((scene, frames, options))
            done = self._pipe.recv() if self._pipe.poll(limit) else f"more than {limit:g} s"
        except (EOFError, OSError):
            done = "its process has ended"
        if isinstance(done, Run):
            return done
        self._process.kill()
        self._pipe = None
        raise PeerError(f"{self._draw.__module__.rpartition('.')[2]}: {done}")


def _serve(pipe: Connection, draw: Draw) -> None:
    """Answers until nobody asks any more. What the package prints is not for our user, nor are signals for it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    with contextlib.suppress(EOFError):
        while True:
            scene, frames, options = pipe.recv()
            try:
                pipe.send(draw(scene, frames, *options))
            except Exception as error:  # whatever a package raises
                pipe.send(f"{type(error).__name__}: {error}".splitlines()[0])


def version_of(package: str) -> str:
    """The version of a package that is installed. Raises PeerError if it is not."""
    if importlib.util.find_spec(package) is None:
        raise PeerError(f"{package} is not installed (pip install {package})")
    return metadata.version(package)


def seen_from_the_eye(scene: Scene, points: Floats) -> Floats:
    """Points (n, 3) in camera space: what a careful user of a float32 tracer hands over."""
    moved: Floats = (points - np.array(scene.camera.position)) @ np.array(scene.camera.basis()).T
    return moved


@dataclass(frozen=True)
class Triangles:
    """Triangles in camera space.

    vertices, normals: (n, 3) each, normals of length 1; corners, normal_of: (f, 3), which of them each corner has, -1
    for flat ones; the corners go around counterclockwise, seen from the front; uv: (f, 3, 2), where they are in the
    texture; material: (f,).
    """

    vertices: Floats
    normals: Floats
    corners: NDArray[np.int64]
    normal_of: NDArray[np.int64]
    uv: Floats
    material: NDArray[np.int64]

    def smooth(self) -> tuple[Floats, Floats]:
        """Places and normals of all corners, (f, 3, 3) each: the triangle's own normal where it is flat."""
        places = self.vertices[self.corners]
        flat = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        normals = np.concatenate([self.normals, np.zeros((1, 3))])[self.normal_of]
        return places, np.where((self.normal_of < 0)[..., None], flat[:, None], normals)


def triangles(scene: Scene) -> Triangles:
    """Those of all meshes of a scene."""
    basis = np.array(scene.camera.basis())
    parts = [_part(scene, mesh, basis) for mesh in scene.meshes]
    firsts = [np.cumsum([0, *(len(getattr(part, name)) for part in parts)]) for name in ("vertices", "normals")]
    empty = np.zeros((0, 3), np.int64)
    return Triangles(
        np.concatenate([np.zeros((0, 3)), *(part.vertices for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.normals for part in parts)]),
        np.concatenate([empty, *(part.corners + firsts[0][k] for k, part in enumerate(parts))]),
        np.concatenate([empty, *(np.where(part.normal_of < 0, -1, part.normal_of + firsts[1][k])
                                 for k, part in enumerate(parts))]),
        np.concatenate([np.zeros((0, 3, 2)), *(part.uv for part in parts)]),
        np.concatenate([empty[:, 0], *(part.material for part in parts)]),
    )  # fmt: skip


def _part(scene: Scene, mesh: PlacedMesh, basis: Floats) -> Triangles:
    shape = mesh.geometry
    back = (mesh.front < 0)[:, None]

    def turned(corners: NDArray[np.int32]) -> NDArray[np.int64]:
        return np.where(back, corners[:, ::-1], corners).astype(np.int64)

    normals = shape.normals @ mesh.normal_to_world.T @ basis.T
    return Triangles(
        seen_from_the_eye(scene, mesh.vertices),
        normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300),
        turned(shape.faces),
        turned(shape.normal_of),
        np.concatenate([shape.uv, np.zeros((1, 2))])[turned(shape.uv_of)],
        np.full(len(shape.faces), mesh.material),
    )


def texels(scene: Scene) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Pixels of all textures (n, 3), 1 = full; and (k, 3): which of them is the first of each, width and height."""
    full = [texture.reshape(-1, 3) / np.float32(FULL[texture.dtype]) for texture in scene.textures]
    firsts = np.cumsum([0, *map(len, full)])[:-1]
    sizes = [texture.shape[1::-1] for texture in scene.textures]
    table = np.column_stack([firsts, np.reshape(sizes, (-1, 2))]).astype(np.int32)
    return np.concatenate([np.zeros((0, 3), np.float32), *full]).astype(np.float32), table


@dataclass(frozen=True)
class Light:
    """A light that is not ambient, in camera space.

    kind: PARALLEL, POINT, SPOT or LAMBERT; color: (3,); place: (3,), of a parallel one the way to it; axis: (3,), along
    its light, of length 1; angles: of a spot light, rad from the axis, to where it is full and to where it ends.
    """

    kind: int
    place: Floats
    color: Floats
    axis: Floats
    angles: tuple[float, float]

    @property
    def parallel(self) -> bool:
        return self.kind == PARALLEL


def lights(scene: Scene) -> tuple[Floats, list[Light]]:
    """The ambient light (3,), and the others."""
    found, basis = [], np.array(scene.camera.basis())
    for light in scene.lamps[scene.lamps["kind"] != AMBIENT]:
        kind, axis = int(light["kind"]), basis @ light["direction"] / (np.linalg.norm(light["direction"]) or 1)
        place = -axis if kind == PARALLEL else seen_from_the_eye(scene, light["position"][None])[0]
        inner, outer = np.radians([light["alpha1"], light["alpha2"]]).tolist()
        found.append(Light(kind, place, light["color"], axis, (inner, outer)))
    return scene.lamps["color"][scene.lamps["kind"] == AMBIENT].sum(axis=0), found


def levels(color: NDArray[Any]) -> NDArray[np.uint8]:
    """0..255 of colours, 1 = full."""
    rounded: NDArray[np.uint8] = (np.clip(color, 0, 1) * 255 + 0.5).astype(np.uint8)
    return rounded


def bytes_of(color: NDArray[Any], size: tuple[int, int]) -> NDArray[np.uint8]:
    """(h, w, 3) of colours, 1 = full, row by row from the top."""
    return levels(color).reshape(size[1], size[0], 3)


@contextlib.contextmanager
def understood(program: str) -> Iterator[None]:
    """Turns what goes wrong while reading what a peer has written into a PeerError."""
    try:
        yield
    except (ValueError, LookupError, TypeError, OSError) as error:
        raise PeerError(f"{Path(program).name}: cannot read what it wrote: {error}") from None


def seconds(text: Any) -> float:
    """A time that a peer has measured; ValueError if it is none that can be compared."""
    value = float(text)
    if not 0 < value < math.inf:
        raise ValueError(f"a time of {text}")
    return value


def most_seconds(frames: int) -> float:
    """How long a peer may take for so many pictures."""
    return PEER_SECONDS * min(frames, 2)


def call(command: list[str], frames: int = 1) -> subprocess.CompletedProcess[str]:
    """Runs a peer's program, which draws so many pictures. Raises PeerError if it fails, or takes too long."""
    name, limit = Path(command[0]).name, most_seconds(frames)
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        raise PeerError(f"{name} took more than {limit:g} s") from None
    except OSError as error:
        raise PeerError(f"{name}: {error.strerror}") from None
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        raise PeerError(f"{name} failed with status {done.returncode}: {last}")
    return done
