"""Pictures of meshes against the exact oracle: what a pixel shows, whether light reaches it, what is seen in it.

What a picture shows first is judged by its ids and primitives. Where its rays go on from is computed here in numpy,
operation by operation as the kernel and the reference do, so that what they meet, and which lights reach them, can be
asked of the oracle ray by ray.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from surface_rays import Points, along, blocked, from_eye, on_triangles, to_light

from cltrace.base.arithmetic import Floats
from cltrace.base.limits import MAX_BOUNCES
from cltrace.oracle.search import Ids, Kinds, Rays
from cltrace.oracle.shapes import Spheres, Triangles
from cltrace.reference import OnTriangle, Point, world_of
from cltrace.reference.rays import view_of
from cltrace.scene import AMBIENT, MATERIAL, PARALLEL, Geometry, PlacedMesh, Scene, ambient_light
from hostile.sphere_regimes import rays as camera_rays

from .bounced_pictures import DIGITS, Starts, names, onward
from .columns import Bools, Vector, columns_of, constant, cross, dot, minus, product, times


class Seen(NamedTuple):
    """Of each pixel, (n,): the number of the surface, and that of the triangle in it; -1 for none."""

    id: Ids
    primitive: Ids


class Verdict(NamedTuple):
    """rays: how many were judged; wrong: (k,), the pixels of those that met something else than they must; leaks: how
    many of these met nothing, and must meet something; phantoms: how many met something, and must not."""

    rays: int
    wrong: NDArray[np.intp]
    leaks: int
    phantoms: int


def primary(scene: Scene) -> Rays:
    """The rays of a picture's pixels, row by row from the top."""
    return from_eye(scene, camera_rays(scene.camera))


def expected(scene: Scene) -> Seen:
    """What the oracle says of all pixels."""
    triangles, spheres = Triangles.of(scene), Spheres.of(scene)
    item = Kinds([triangles, spheres]).closest(primary(scene)).item
    none = np.full(len(spheres.surface) + 1, -1)
    id_, primitive = (
        np.concatenate([triangles.surface, spheres.surface, none[:1]]),
        np.append(triangles.primitive, none),
    )
    return Seen(id_[item], primitive[item])


def judge(scene: Scene, got: Seen) -> Verdict:
    """What is wrong with what a picture shows."""
    want = expected(scene)
    wrong = (got.id != want.id) | (got.primitive != want.primitive)
    leaks, phantoms = (got.id < 0) & (want.id >= 0), (got.id >= 0) & (want.id < 0)
    return Verdict(len(wrong), np.flatnonzero(wrong), int(leaks.sum()), int(phantoms.sum()))


# -------------------------------------------------------------------------------------------- rays that leave triangles


class Left(NamedTuple):
    """Triangles that pixels show, and by which rays leave them.

    pixels: (n,); row: (n,), of Triangles; corner, uv: (n,) and (n, 2), see on_triangles(); normal: unit,
    in camera space, facing the ray; side: (n,), 1 where the ray came from outside, -1 from inside.
    """

    pixels: NDArray[np.intp]
    row: Ids
    corner: Ids
    uv: Floats
    normal: Vector
    side: NDArray[np.int_]

    def points(self, triangles: Triangles) -> Points:
        return on_triangles(triangles, self.row, self.corner, self.uv)


def left_from(scene: Scene, triangles: Triangles, seen: Seen) -> Left:
    """Where rays go on from what pixels show, of meshes without normals: as Crossing and Triangle of the reference."""
    pixels = np.flatnonzero(seen.primitive >= 0)
    row = np.searchsorted(triangles.surface, seen.id[pixels]) + seen.primitive[pixels]
    frame, d = view_of(scene.camera), columns_of(camera_rays(scene.camera)[pixels])
    w = product(frame.B.T, d)
    A, B, C = (columns_of(triangles.vertices[triangles.faces[row, i]]) for i in range(3))
    to_a, e1, e2 = minus(A, constant(Point(*scene.camera.position))), minus(B, A), minus(C, A)
    R, N = cross(to_a, w), cross(e1, e2)
    den = dot(N, w)
    with np.errstate(all="ignore"):
        b, c = _positive(dot(e2, R) / den), _positive(-dot(e1, R) / den)
        weights = np.array([_positive((1 - b) - c), b, c])
    corner = weights.argmax(axis=0)
    uv = [np.clip(weights[(corner + i) % 3, np.arange(len(row))], OnTriangle.LEAST, OnTriangle.MOST) for i in (1, 2)]
    n = product(frame.B, times(1 / np.sqrt(dot(N, N)), N))
    front = np.concatenate([np.empty(0, np.int8), *(mesh.front for mesh in scene.meshes)])[row]
    side = np.where(front * den < 0, 1, -1)
    return Left(pixels, row, corner, np.stack(uv, axis=1), times(np.where(dot(n, d) > 0, -1.0, 1.0), n), side)


def _positive(x: Floats) -> Floats:
    return np.where(x > 0, x, 0.0)


# --------------------------------------------------------------------------------------------------------------- lights


def in_light(scene: Scene, light: ArrayLike) -> Scene:
    """The scene without spheres, all white and matt, in one light: a pixel is black if that does not reach it."""
    white = np.zeros(1, MATERIAL)
    white["color"], white["kd"], white["texture"] = 1, 1, -1
    meshes = [PlacedMesh(mesh.geometry, mesh.to_world, 0, i) for i, mesh in enumerate(scene.meshes)]
    return Scene(scene.camera, np.ravel(light), scene.spheres[:0], white, meshes=meshes)


def judge_light(scene: Scene, got: Seen, color: ArrayLike) -> Verdict:
    """What is wrong with what light pixels get, (n, 3), in a scene of in_light(). Leaks are in light, and must not be.

    Where the light is all but in the plane of what a pixel shows, it is not judged.
    """
    (light,), triangles = scene.lights[scene.lights["kind"] != AMBIENT], Triangles.of(scene)
    left, parallel = left_from(scene, triangles, got), bool(light["kind"] == PARALLEL)
    place = light["direction" if parallel else "position"]
    rays = to_light(left.points(triangles), place, parallel)
    n = np.transpose(left.normal) @ np.array(scene.camera.basis())
    way = np.stack([x.h for x in rays.way], axis=1) * (1 if parallel else -1)
    cosine = (n * way).sum(axis=1) / np.linalg.norm(way, axis=1)
    dark = blocked(Kinds([triangles]), rays) | (cosine < 0)
    black = ~np.asarray(color).reshape(-1, 3)[left.pixels].any(axis=1)
    judged = np.abs(cosine) > 2.0**-20
    wrong = judged & (dark != black)
    return Verdict(int(judged.sum()), left.pixels[wrong], int((wrong & dark).sum()), int((wrong & ~dark).sum()))


# -------------------------------------------------------------------------------------------------------------- mirrors


def each_named(scene: Scene, glass: Bools, index: float) -> Scene:
    """The scene without spheres; each triangle is a mesh, and has a colour that names it, which ambient light shows.

    glass: (m,), which triangles let all light through; the others mirror all of it. See bounced_pictures.names().
    """
    triangles = Triangles.of(scene)
    m = len(triangles.faces)
    materials = np.zeros(m, MATERIAL)
    materials["texture"], materials["ka"], materials["index"] = -1, 1, index
    materials["color"] = np.arange(m)[:, None] // DIGITS ** np.arange(3) % DIGITS / (DIGITS + 1)
    materials["transmittance"], materials["reflectance"] = glass, ~glass
    meshes = [
        PlacedMesh(Geometry(triangles.vertices[face], [(0, 1, 2)]), material=i, number=i)
        for i, face in enumerate(triangles.faces)
    ]
    camera, light = replace(scene.camera, max_bounces=0), ambient_light((1, 1, 1))
    return Scene(camera, light, scene.spheres[:0], materials, background=(1.0, 1.0, 1.0), meshes=meshes)


def onward_from(scene: Scene, left: Left) -> Floats:
    """(n, 3): in which directions of camera space rays go on from triangles, each of which is a surface after the
    spheres and mirrors all or lets all through."""
    surfaces, first = world_of(scene).surfaces, len(scene.spheres)
    direction = np.empty((len(left.row), 3))
    for i in np.unique(left.row).tolist():
        rows = np.flatnonzero(left.row == i)
        n, side = columns_of(np.transpose(left.normal)[rows]), left.side[rows]
        starts = Starts(n, times(side, n), side, np.ones(len(rows), bool))
        d = columns_of(camera_rays(scene.camera)[left.pixels[rows]])
        direction[rows] = np.transpose(onward(surfaces[first + i], d, starts))
    return direction


def judge_onward(scene: Scene, got: Seen, color: ArrayLike) -> Verdict:
    """What is wrong with what rays meet that go on from what pixels show, in a scene of each_named()."""
    triangles = Triangles.of(scene)
    left = left_from(scene, triangles, got)
    rays = along(left.points(triangles), onward_from(scene, left), scene.camera.basis())
    want = Kinds([triangles]).closest(rays).item
    return verdict(left.pixels, names(np.asarray(color).reshape(-1, 3)[left.pixels]), want)


def verdict(pixels: NDArray[np.intp], met: NDArray[np.integer[Any]], want: Ids) -> Verdict:
    """Of the rays of these pixels, what is wrong with what they met."""
    wrong = met != want
    leaks, phantoms = wrong & (met == -1), wrong & (want == -1)
    return Verdict(len(met), pixels[wrong], int(leaks.sum()), int(phantoms.sum()))


# --------------------------------------------------------------------------------------------------- through everything


def seen_through(scene: Scene) -> Scene:
    """The scene without spheres, of glass that bends nothing and halves what is behind it, up to 100 times."""
    glass = np.zeros(1, MATERIAL)
    glass["texture"], glass["transmittance"], glass["index"] = -1, 0.5, 1
    meshes = [PlacedMesh(mesh.geometry, mesh.to_world, 0, i) for i, mesh in enumerate(scene.meshes)]
    camera, white = replace(scene.camera, max_bounces=MAX_BOUNCES), (1.0, 1.0, 1.0)
    return Scene(camera, (), scene.spheres[:0], glass, background=white, meshes=meshes)


def passed(color: ArrayLike) -> Ids:
    """(n,): through how many triangles the pixels see the background, by their colours (n, 3), -1 where none tells.

    Each triangle is where a ray starts anew, from a point in it, so that this may be another number than the oracle's
    where a ray passes an edge. But of a closed mesh, from outside, it is even; unless it covers itself or another one,
    as of triangles in one plane a ray meets the first one only.
    """
    count = -np.log2(np.maximum(np.asarray(color, float).reshape(-1, 3)[:, 0], 2.0**-1000))
    return np.where(count == np.rint(count), count, -1).astype(np.int64)
