"""Open3D's RaycastingScene, which is Embree: triangles in single precision. Its rays alone are timed; numpy shades."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import processors
from cltrace.bench.regimes import rays
from cltrace.bench.tracers import OTHER_LIGHTS, Run, Tracer, strange
from cltrace.scene import Scene

from .peer import OFF, Company, Light, bytes_of, lights, triangles, version_of

Floats = NDArray[np.float32]


class Open3D(Tracer):
    """Rays of the camera and to the lights. kernel: of these; whole: with building the tree, and numpy's shading."""

    name = "Open3D"

    def __init__(self) -> None:
        self.version, self._company = version_of("open3d"), Company(draw)

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        if not scene.meshes:
            return ("scenes without meshes",)
        return strange(scene, "spheres", "cylinders", "textures", "mirrors", "glass", "orthographic cameras",
                       OTHER_LIGHTS)  # fmt: skip

    def run(self, scene: Scene, frames: int) -> Run:
        return self._company.run(scene, frames)


class Shooter:
    """The triangles, and how long their rays took so far."""

    def __init__(self, places: NDArray[np.float64]) -> None:
        self._library: Any = importlib.import_module("open3d")
        self._scene = self._library.t.geometry.RaycastingScene(nthreads=processors())
        corners = np.arange(3 * len(places), dtype=np.uint32).reshape(-1, 3)
        self._scene.add_triangles(self._tensor(places.reshape(-1, 3).astype("f4")), self._tensor(corners))
        self.seconds = 0.0

    def _tensor(self, array: NDArray[Any]) -> Any:
        return self._library.core.Tensor(np.ascontiguousarray(array))

    def closest(self, way: Floats) -> dict[str, NDArray[Any]]:
        """What rays (n, 6) hit: t_hit, primitive_ids, primitive_uvs."""
        given = self._tensor(way)
        start = time.perf_counter()
        found = self._scene.cast_rays(given)
        self.seconds += time.perf_counter() - start
        return {name: value.numpy() for name, value in found.items()}

    def blocked(self, way: Floats, far: float) -> NDArray[np.bool_]:
        """Whether something is before `far`, in lengths of the direction."""
        given = self._tensor(way)
        start = time.perf_counter()
        found = self._scene.test_occlusions(given, tfar=far)
        self.seconds += time.perf_counter() - start
        out: NDArray[np.bool_] = found.numpy()
        return out


def draw(scene: Scene, frames: int) -> Run:
    """In the process that the package has of its own."""
    start = time.perf_counter()
    mesh = triangles(scene)
    places, normals = mesh.smooth()
    shooter = Shooter(places)
    kernel, picture, whole = [], np.zeros(0, np.uint8), 0.0
    for _ in range(frames):
        shooter.seconds = 0.0
        picture = _frame(scene, shooter, normals.astype("f4"), mesh.material)
        whole = whole or time.perf_counter() - start
        kernel.append(shooter.seconds)
    return Run(kernel, whole, picture)


def _frame(scene: Scene, shooter: Shooter, normals: Floats, material: NDArray[np.int64]) -> NDArray[np.uint8]:
    d = rays(scene.camera).astype("f4")
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    found = shooter.closest(np.concatenate([np.zeros_like(d), d], axis=1))
    color = np.tile(np.array(scene.background, "f4"), (len(d), 1))
    hit = np.isfinite(found["t_hit"])
    d, t, number = d[hit], found["t_hit"][hit], found["primitive_ids"][hit]
    u, v = found["primitive_uvs"][hit].T[:, :, None]
    a, b, c = normals[number].transpose(1, 0, 2)
    n = a * (1 - u - v) + b * u + c * v
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    n *= -np.sign((found["primitive_normals"][hit] * d).sum(axis=1, keepdims=True))
    point, m = d * t[:, None], scene.materials[material[number]]
    start = point + n * (2 * t * OFF)[:, None].astype("f4")
    ambient, others = lights(scene)
    sum_of = m["ka"][:, None] * m["color"] * ambient
    for light in others:
        sum_of = sum_of + _phong(light, shooter, start, n, d, m)
    color[hit] = sum_of
    return bytes_of(color, scene.camera.resolution)


def _phong(light: Light, shooter: Shooter, start: Floats, n: Floats, d: Floats, m: NDArray[np.void]) -> NDArray[Any]:
    """(n, 3): what a light adds, if it arrives."""
    way = np.broadcast_to(light.place.astype("f4"), n.shape) - (0 if light.parallel else start)
    to = way / np.linalg.norm(way, axis=1, keepdims=True)
    cosine = (n * to).sum(axis=1)
    lit = cosine > 0
    out = np.zeros(n.shape)
    blocked = shooter.blocked(np.concatenate([start, way], axis=1)[lit], np.inf if light.parallel else 1.0)
    lit[lit] = ~blocked
    along = np.maximum(((to - 2 * cosine[:, None] * n) * d).sum(axis=1), 0)[lit]
    lobe = m["ks"][lit] * along ** m["exponent"][lit]
    out[lit] = ((m["kd"] * cosine)[lit, None] * m["color"][lit] + lobe[:, None]) * light.color
    return out


def tracers(folder: Path) -> Iterable[Tracer]:
    """Open3D, if it is installed."""
    return [Open3D()]
