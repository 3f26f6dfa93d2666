"""Mitsuba 3 with LLVM: its surfaces and rays, shaded in its arrays, which it compiles, as it has no such material."""

from __future__ import annotations

import importlib
import importlib.util
import multiprocessing
import os
import signal
import time
from collections.abc import Iterable
from importlib import metadata
from multiprocessing.pool import Pool
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import processors
from cltrace.scene import PARALLEL, Scene

from .peers import PeerError, PeerLight, in_camera_space, lights, limit_of, triangles
from .scenes import Floats
from .tracers import FEW_ACROSS, OTHER_LIGHTS, BenchTracer, Run, has

VARIANT = "llvm_ad_rgb"
# Each sphere is an object of Python's.
MOST_SPHERES = 20_000


class Mitsuba(BenchTracer):
    """The package, in a process of its own. whole: with making its scene; level: level x level rays a pixel."""

    name = "Mitsuba 3"

    def __init__(self, pool: Pool, version: str, level: int | None) -> None:
        self._pool, self.version = pool, version
        if level:
            self.task, self.level, self.variant = "samples", level, "samples"

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        if len(scene.spheres) > MOST_SPHERES:
            return (f"more than {MOST_SPHERES:,} spheres, each an object",)
        return has(scene, "cylinders", "ellipsoids", "glass", "textures", OTHER_LIGHTS)

    def run(self, scene: Scene, frames: int) -> Run:
        try:
            return self._pool.apply_async(draw, (scene, frames, self.level or 1)).get(limit_of(frames))
        except multiprocessing.TimeoutError:
            self._pool.terminate()
            raise PeerError(f"mitsuba took more than {limit_of(frames):g} s, or has ended") from None


def silence() -> None:
    """What the package prints is not for our user, nor are signals for it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)


def draw(scene: Scene, frames: int, across: int) -> Run:
    """Draws the scene so many times, in the process that the package has of its own."""
    mi, dr = (importlib.import_module(name) for name in ("mitsuba", "drjit"))
    mi.set_variant(VARIANT)
    dr.set_thread_count(processors())
    start = time.perf_counter()
    picture = Picture(mi, dr, scene)
    seconds, whole = [], 0.0
    for _ in range(frames):
        begin = time.perf_counter()
        rgb8 = (np.clip(picture.frame(across), 0, 1) * 255 + 0.5).astype(np.uint8)
        seconds.append(time.perf_counter() - begin)
        whole = whole or time.perf_counter() - start
    width, height = scene.camera.resolution
    return Run(seconds, whole, rgb8.reshape(height, width, 3))


class Picture:
    """A scene of Mitsuba's, in camera space. All numbers are its arrays, with an element for each ray."""

    def __init__(self, mi: Any, dr: Any, scene: Scene) -> None:
        self._mi, self._dr, self._given, (self._ambient, self._lights) = mi, dr, scene, lights(scene)
        parts: dict[str, Any] = {"type": "scene"}
        centers = in_camera_space(scene, scene.spheres["center"])
        for k, (center, radius) in enumerate(zip(centers.tolist(), scene.spheres["radius"].tolist(), strict=True)):
            parts[f"ball{k}"] = {"type": "sphere", "center": center, "radius": radius}
        places, normals, material_of = triangles(scene)
        used = np.unique(material_of)
        for material in used:
            mine = material_of == material
            parts[f"mesh{material}"] = self._mesh(places[mine], normals[mine])
        self._scene = mi.load_dict(parts)
        # Shapes are told apart by their numbers, and may come in another order.
        numbers = dr.reinterpret_array(mi.UInt32, self._scene.shapes_dr()).numpy()
        named = [shape.id() for shape in self._scene.shapes()]
        of_name = {f"ball{k}": m for k, m in enumerate(scene.spheres["material"])} | {f"mesh{m}": m for m in used}
        table = np.zeros(int(numbers.max()) + 1, np.uint32)
        table[numbers] = [of_name[name] for name in named]
        self._material = mi.UInt32(table)
        m, names = scene.materials, ("ka", "kd", "ks", "exponent", "reflectance")
        self._columns = {name: mi.Float(m[name].astype("f4")) for name in names}
        self._colors = [mi.Float(m["color"][:, k].astype("f4")) for k in range(3)]

    def _mesh(self, places: Floats, normals: Floats) -> Any:
        mi = self._mi
        mesh = mi.Mesh("mesh", 3 * len(places), len(places), has_vertex_normals=True)
        to = mi.traverse(mesh)
        to["vertex_positions"] = mi.Float(places.ravel().astype("f4"))
        to["vertex_normals"] = mi.Float(normals.ravel().astype("f4"))
        to["faces"] = mi.UInt32(np.arange(3 * len(places), dtype=np.uint32))
        to.update()
        return mesh

    def frame(self, across: int) -> NDArray[np.float32]:
        """(pixels, 3): the colours, means of across x across rays."""
        mi, dr = self._mi, self._dr
        width, height = self._given.camera.resolution
        many = across * across
        k = dr.arange(mi.UInt32, width * height * many)
        pixel, part = k // many, k % many
        x = mi.Float(pixel % width) + (mi.Float(part % across) + 0.5) / across
        y = mi.Float(pixel // width) + (mi.Float(part // across) + 0.5) / across
        half = self._given.camera.image_plane()
        x, y = (2 * x / width - 1) * half[0], (1 - 2 * y / height) * half[1]
        if self._given.camera.parallel:
            ray = mi.Ray3f(mi.Point3f(x, y, 0), mi.Vector3f(0, 0, -1))
        else:
            ray = mi.Ray3f(mi.Point3f(0), dr.normalize(mi.Vector3f(x, y, -1)))
        color = self._seen(ray)
        color = dr.select(color < 1, color, 1)  # LLVM 15 does not compile dr.minimum()
        means = [dr.block_reduce(dr.ReduceOp.Add, channel, many) / many for channel in color]
        dr.eval(means)
        return np.stack([channel.numpy() for channel in means], axis=1)

    def _seen(self, ray: Any) -> Any:
        mi, dr = self._mi, self._dr
        color, weight, active = mi.Color3f(0), mi.Float(1), mi.Bool(True)
        last = self._given.camera.max_bounces + 1 if has(self._given, "mirrors") else 0
        for depth in range(last + 1):
            at = self._scene.ray_intersect(ray, active)
            hit = active & at.is_valid()
            color += dr.select(active & ~hit, weight * mi.Color3f(self._given.background), 0)
            row = dr.gather(mi.UInt32, self._material, dr.reinterpret_array(mi.UInt32, at.shape), hit)
            m = {name: dr.gather(mi.Float, column, row, hit) for name, column in self._columns.items()}
            m["color"] = mi.Color3f(*(dr.gather(mi.Float, column, row, hit) for column in self._colors))
            n = dr.select(dr.dot(at.n, ray.d) > 0, -at.sh_frame.n, at.sh_frame.n)
            own = weight if depth == last else weight * (1 - m["reflectance"])
            shade = m["ka"] * m["color"] * mi.Color3f(self._ambient.tolist())
            for light in self._lights:
                shade += self._phong(light, at, n, ray.d, m, hit)
            color += dr.select(hit, own * shade, 0)
            if depth < last:
                weight, active = weight * m["reflectance"], hit & (m["reflectance"] > 0)
                ray = at.spawn_ray(dr.normalize(ray.d - 2 * dr.dot(n, ray.d) * n))
        return color

    def _phong(self, light: PeerLight, at: Any, n: Any, d: Any, m: dict[str, Any], hit: Any) -> Any:
        mi, dr = self._mi, self._dr
        place = mi.Vector3f(light.place.tolist())
        to = place if light.kind == PARALLEL else dr.normalize(place - at.p)
        cosine = dr.dot(n, to)
        lit = hit & (cosine > 0)
        shadow = at.spawn_ray(to) if light.kind == PARALLEL else at.spawn_ray_to(mi.Point3f(place))
        lit &= ~self._scene.ray_test(shadow, lit)
        along = dr.dot(to - 2 * cosine * n, d)
        lobe = m["ks"] * dr.select(along > 0, along, 0) ** m["exponent"]
        full = (m["kd"] * cosine * m["color"] + lobe) * mi.Color3f(light.color.tolist())
        return dr.select(lit, full, 0)


def tracers(folder: Path) -> Iterable[BenchTracer]:
    """Mitsuba 3, if it is installed."""
    if importlib.util.find_spec("mitsuba") is None:
        raise PeerError("mitsuba is not installed (pip install mitsuba)")
    version = metadata.version("mitsuba")
    pool = multiprocessing.get_context("spawn").Pool(1, silence)
    return [Mitsuba(pool, version, level) for level in (None, *FEW_ACROSS)]
