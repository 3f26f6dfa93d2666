"""Mitsuba 3 with LLVM: its surfaces and rays, shaded in its arrays, which it compiles, as it has no such material."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import processors
from cltrace.bench.scenes import Task, soft_lights
from cltrace.bench.tracers import FEW_ACROSS, MEMBERS, Run, Tracer, strange
from cltrace.scene import LAMBERT, SPOT, Scene

from .peer import (
    Company,
    Floats,
    Light,
    bytes_of,
    in_turn,
    lights,
    seen_from_the_eye,
    texels,
    triangles,
    version_of,
)

VARIANT = "llvm_ad_rgb"
# Each sphere is an object of Python's.
MOST_SPHERES = 20_000


class Mitsuba(Tracer):
    """kernel: of a picture; whole: with making its scene.

    task: with "samples", level x level rays a pixel; with "members", so many of each soft light.
    """

    name = "Mitsuba 3"

    def __init__(self, company: Company, version: str, task: Task = "frame", level: int | None = None) -> None:
        self._company, self.version, self.task, self.level = company, version, task, level
        self.variant = "samples" if task == "samples" else ""

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        if len(scene.spheres) > MOST_SPHERES:
            return (f"more than {MOST_SPHERES:,} spheres, each an object",)
        if scene.textures and scene.meshes and len(scene.spheres):
            return ("textures",)
        return strange(scene, "cylinders", "ellipsoids", "glass")

    def run(self, scene: Scene, frames: int) -> Run:
        level = int(self.level or 1)
        if self.task == "members":
            scene, level = scene.lit_by(soft_lights(level)), 1
        return self._company.run(scene, frames, level)


def draw(scene: Scene, frames: int, across: int) -> Run:
    """In the process that the package has of its own."""
    mi, dr = (importlib.import_module(name) for name in ("mitsuba", "drjit"))
    mi.set_variant(VARIANT)
    dr.set_thread_count(processors())
    start = time.perf_counter()
    picture = Picture(mi, dr, scene)
    return Run(*in_turn(lambda: bytes_of(picture.frame(across), scene.camera.resolution), frames, start))


class Picture:
    """A scene of Mitsuba's, in camera space. All numbers are its arrays, with an element for each ray."""

    def __init__(self, mi: Any, dr: Any, scene: Scene) -> None:
        self._mi, self._dr, self._given = mi, dr, scene
        parts: dict[str, Any] = {"type": "scene"}
        centers = seen_from_the_eye(scene, scene.spheres["center"])
        for k, (center, radius) in enumerate(zip(centers.tolist(), scene.spheres["radius"].tolist(), strict=True)):
            parts[f"ball{k}"] = {"type": "sphere", "center": center, "radius": radius}
        mesh = triangles(scene)
        used = np.unique(mesh.material)
        places, normals = mesh.smooth()
        for material in used:
            mine = mesh.material == material
            parts[f"mesh{material}"] = self._mesh(places[mine], normals[mine], mesh.uv[mine])
        self._scene = mi.load_dict(parts)
        # Shapes are told apart by their numbers, and may come in another order.
        numbers = dr.reinterpret_array(mi.UInt32, self._scene.shapes_dr()).numpy()
        named = [shape.id() for shape in self._scene.shapes()]
        of_name = {f"ball{k}": m for k, m in enumerate(scene.spheres["material"])} | {f"mesh{m}": m for m in used}
        table = np.zeros(int(numbers.max()) + 1, np.uint32)
        table[numbers] = [of_name[name] for name in named]
        self._material = mi.UInt32(table)
        pixels, textures = texels(scene)
        self._texels, self._textures = mi.Float(pixels.ravel()), [mi.Int32(column) for column in textures.T]
        self._texture = mi.Int32(scene.materials["texture"].astype(np.int32)) if len(textures) else None
        columns = {name: scene.materials[name].astype("f4") for name in ("ka", "kd", "ks", "exponent", "reflectance")}
        self._columns = {name: mi.Float(column) for name, column in columns.items()}
        self._colors = [mi.Float(scene.materials["color"][:, k].astype("f4")) for k in range(3)]
        self._mirrors = bool(columns["reflectance"].any())

    def _mesh(self, places: Floats, normals: Floats, uv: Floats) -> Any:
        mi = self._mi
        mesh = mi.Mesh("mesh", 3 * len(places), len(places), has_vertex_normals=True, has_vertex_texcoords=True)
        to = mi.traverse(mesh)
        to["vertex_positions"] = mi.Float(places.ravel().astype("f4"))
        to["vertex_normals"] = mi.Float(normals.ravel().astype("f4"))
        to["vertex_texcoords"] = mi.Float(uv.ravel().astype("f4"))
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
        found: NDArray[np.float32] = np.stack([channel.numpy() for channel in means], axis=1)
        return found

    def _seen(self, ray: Any) -> Any:
        mi, dr = self._mi, self._dr
        color, weight, active = mi.Color3f(0), mi.Float(1), mi.Bool(True)
        last = self._given.camera.max_bounces + 1 if self._mirrors else 0
        for depth in range(last + 1):
            at = self._scene.ray_intersect(ray, active)
            hit = active & at.is_valid()
            color += dr.select(active & ~hit, weight * mi.Color3f(self._given.background), 0)
            row = dr.gather(mi.UInt32, self._material, dr.reinterpret_array(mi.UInt32, at.shape), hit)
            m = {name: dr.gather(mi.Float, column, row, hit) for name, column in self._columns.items()}
            m["color"] = mi.Color3f(*(dr.gather(mi.Float, column, row, hit) for column in self._colors))
            if self._texture is not None:
                m["color"] *= self._painted(at, dr.gather(mi.Int32, self._texture, row, hit), hit)
            n = dr.select(dr.dot(at.n, ray.d) > 0, -at.sh_frame.n, at.sh_frame.n)
            own = weight if depth == last else weight * (1 - m["reflectance"])
            color += dr.select(hit, own * self._shaded(at, n, ray.d, m, hit), 0)
            if depth < last:
                weight, active = weight * m["reflectance"], hit & (m["reflectance"] > 0)
                ray = at.spawn_ray(dr.normalize(ray.d - 2 * dr.dot(n, ray.d) * n))
        return color

    def _painted(self, at: Any, texture: Any, hit: Any) -> Any:
        """The colour of a texture, by which that of its surface is multiplied: of the four pixels around."""
        mi, dr = self._mi, self._dr
        if self._given.meshes:
            u, v = at.uv
        else:  # LLVM 15 compiles neither dr.atan2() nor dr.clip(), nor the uv of a sphere, which has them
            q = mi.Matrix3f(np.array(self._given.camera.basis()).T.tolist()) @ mi.Vector3f(at.n)
            cosines = q.z * dr.rsqrt(q.x * q.x + q.z * q.z + 1e-20), q.y
            around, v = (dr.acos(dr.select(dr.abs(c) < 1, c, dr.sign(c))) / np.pi for c in cosines)
            u = 0.5 + dr.select(q.x < 0, -around, around) / 2
        has = hit & (texture >= 0)
        first, width, height = (dr.gather(mi.Int32, column, texture, has) for column in self._textures)
        x, y = (u - dr.floor(u)) * mi.Float(width), (v - dr.floor(v)) * mi.Float(height)
        i, j = mi.Int32(x), mi.Int32(y)
        right, down = x - mi.Float(i), y - mi.Float(j)
        color = mi.Color3f(0)
        for a, b, share in ((0, 0, (1 - right) * (1 - down)), (1, 0, right * (1 - down)),
                            (0, 1, (1 - right) * down), (1, 1, right * down)):  # fmt: skip
            column, line = (dr.select(k + o < n, k + o, 0) for k, o, n in ((i, a, width), (j, b, height)))
            color += share * dr.gather(mi.Color3f, self._texels, first + line * width + column, has)
        return dr.select(has, color, 1)

    def _shaded(self, at: Any, n: Any, d: Any, m: dict[str, Any], hit: Any) -> Any:
        ambient, others = lights(self._given)
        color = m["ka"] * m["color"] * self._mi.Color3f(ambient.tolist())
        for light in others:
            color += self._phong(light, at, n, d, m, hit)
        return color

    def _phong(self, light: Light, at: Any, n: Any, d: Any, m: dict[str, Any], hit: Any) -> Any:
        mi, dr = self._mi, self._dr
        place = mi.Vector3f(light.place.tolist())
        to = place if light.parallel else dr.normalize(place - at.p)
        cosine = dr.dot(n, to)
        lit = hit & (cosine > 0)
        lit &= ~self._scene.ray_test(at.spawn_ray(to) if light.parallel else at.spawn_ray_to(mi.Point3f(place)), lit)
        along = dr.dot(to - 2 * cosine * n, d)
        lobe = m["ks"] * dr.select(along > 0, along, 0) ** m["exponent"]
        strength = self._strength(light, -dr.dot(to, mi.Vector3f(light.axis.tolist())))
        full = (m["kd"] * cosine * m["color"] + lobe) * mi.Color3f(light.color.tolist())
        return dr.select(lit, strength * full, 0)

    def _strength(self, light: Light, along: Any) -> Any:
        """Of its light, how much is emitted this way. along: the cosine of the angle to the axis."""
        dr, (inner, outer) = self._dr, light.angles
        if light.kind == LAMBERT:
            return dr.select(along > 0, along, 0)
        if light.kind != SPOT:
            return 1.0
        angle = dr.acos(dr.select(dr.abs(along) < 1, along, dr.sign(along)))
        share = (outer - angle) / (outer - inner) if outer > inner else 1.0
        return dr.select(angle <= inner, 1, dr.select(angle <= outer, share, 0))


def tracers(folder: Path) -> Iterable[Tracer]:
    """Mitsuba 3, if it is installed."""
    version, company = version_of("mitsuba"), Company(draw)
    curves: tuple[tuple[Task, tuple[int, ...]], ...] = (("samples", FEW_ACROSS), ("members", MEMBERS))
    return [Mitsuba(company, version), *(Mitsuba(company, version, task, level) for task, of in curves for level in of)]
