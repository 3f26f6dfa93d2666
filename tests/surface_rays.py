"""Rays for the oracle that start on surfaces, or lead to lights, exactly, and rays of a camera's space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Fine, FineVector, Floats, adjugate, dot, fine_vector, product, select
from cltrace.exact.lines import ExactPoint, Frame, Line
from cltrace.oracle.search import Ids, Kind, Kinds, Rays
from cltrace.oracle.shapes import Spheres, Triangles
from cltrace.scene import Scene


@dataclass(frozen=True)
class Points:
    """n points: anchor, (n, 3), exactly, plus a step; place(i): exactly; own: the surfaces on which they are, see
    Rays."""

    anchor: Floats
    step: FineVector
    place: Callable[[int], ExactPoint]
    own: tuple[type[Kind], Ids] | None = None


def at_point(place: ArrayLike, count: int) -> Points:
    """So often the same point of the world, the eye."""
    anchor, exact = np.broadcast_to(np.asarray(place, float), (count, 3)), ExactPoint.of(np.asarray(place).tolist())
    return Points(anchor, fine_vector(np.zeros((count, 3))), lambda i: exact)


def turned(v: Floats, basis: ArrayLike) -> FineVector:
    """B^T v: vectors (n, 3) of camera space along the world's axes; basis: (3, 3), B, the camera's axes."""
    columns: Any = [[Fine.of(np.array(e)) for e in column] for column in np.asarray(basis, float).T]
    return product(columns, fine_vector(v))


def rays_from(start: Points, way: FineVector, line: Callable[[int], Line]) -> Rays:
    low = np.zeros(len(start.anchor))
    return Rays(start.anchor, start.step, way, lru_cache(maxsize=64)(line), low, low + np.inf, start.own)


def along(start: Points, direction: Floats, basis: ArrayLike) -> Rays:
    """Rays along B^T d: direction (n, 3), d, in camera space; basis: (3, 3), B, the camera's axes in the world."""
    frame = Frame(tuple(map(tuple, np.asarray(basis, float).tolist())))
    way = turned(direction, basis)
    return rays_from(start, way, lambda i: Line(start.place(i), frame.to_world(direction[i].tolist())))


def from_eye(scene: Scene, d: Floats) -> Rays:
    """The rays of pixels, exactly; d: (n, 3), their directions in camera space, of a parallel camera where they start
    in the plane of the camera, at the same x and y at which other cameras' rays pass z = -1."""
    basis, start = scene.camera.basis(), at_point(scene.camera.position, len(d))
    if not scene.camera.parallel:
        return along(start, d, basis)
    aside, frame = d * (1, 1, 0), Frame(basis)
    aside_of = replace(
        start, step=turned(aside, basis), place=lambda i: start.place(i) + frame.to_world(aside[i].tolist())
    )
    return along(aside_of, np.broadcast_to((0.0, 0.0, -1.0), d.shape), basis)


def to_light(start: Points, light: ArrayLike, parallel: bool) -> Rays:
    """Shadow rays. light: (3,), the light's position, or the direction in which parallel light travels.

    From a light at a point they lead to the start, where t is 1.
    """
    place, count = np.asarray(light, float), len(start.anchor)
    if parallel:
        return along(start, np.broadcast_to(-place, (count, 3)), np.eye(3))
    source = ExactPoint.of(place.tolist())
    x, y, z = (Fine.gap(start.anchor[:, i], np.full(count, place[i])) + start.step[i] for i in range(3))
    own = start.own if start.own and start.own[0] is Triangles else None  # a sphere is left at the other end
    rays = rays_from(
        replace(at_point(place, count), own=own), (x, y, z), lambda i: Line(source, start.place(i) - source)
    )
    return replace(rays, t_max=np.ones(count))


def blocked(kinds: Kinds, rays: Rays) -> NDArray[np.bool_]:
    """(n,): whether each ray meets anything."""
    return kinds.counts(rays) > 0


def undecided(rays: Rays) -> Rays:
    """The same, of which doubles know nothing."""
    x, y, z = (replace(x, error=x.error + np.inf) for x in rays.way)
    return replace(rays, way=(x, y, z))


def on_spheres(spheres: Spheres, own: Ids, normal: Floats, basis: ArrayLike) -> Points:
    """Points of the spheres `own`, (n,). normal: (n, 3), of any length but 0, of a sphere in camera space, and of an
    ellipsoid in its own axes; basis: (3, 3), the camera's axes in the world."""
    bent, frame = spheres.bent[own] >= 0, Frame(tuple(map(tuple, np.asarray(basis, float).tolist())))

    def place(i: int) -> ExactPoint:
        q = normal[i].tolist()
        return spheres.solid(int(own[i])).point(q if bent[i] else frame.to_world(q).fractions())

    maps = spheres.maps[own]
    K = [[Fine.of(maps[:, i, j].copy()) for j in range(3)] for i in range(3)]
    with np.errstate(all="ignore"):  # what is not finite is not sure
        n, q, (inverse, over) = turned(normal, basis), fine_vector(normal), adjugate(K)
        r = Fine.of(spheres.radii[own])
        factor = select(bent, r / (dot(q, q).root() * over), r / dot(n, n).root())
        x, y, z = (select(bent, v, w) * factor for v, w in zip(product(inverse, q), n, strict=True))
    return Points(spheres.centers[own], (x, y, z), place, (Spheres, own))


def on_triangles(triangles: Triangles, own: Ids, corner: Ids, uv: Floats) -> Points:
    """V + u (V' - V) + v (V'' - V) of the triangles `own`, (n,): V is that corner, V' and V'' the next ones."""
    V = [triangles.vertices[triangles.faces[own, (corner + i) % 3]] for i in range(3)]
    u, v = fine_vector(np.column_stack([uv, uv[:, :1]]))[:2]
    x, y, z = (u * Fine.gap(V[1][:, i], V[0][:, i]) + v * Fine.gap(V[2][:, i], V[0][:, i]) for i in range(3))
    return Points(
        V[0], (x, y, z), lambda i: triangles.solid(int(own[i])).point(int(corner[i]), *uv[i].tolist()), (Triangles, own)
    )


def closest(origin: ArrayLike, directions: ArrayLike, centers: ArrayLike, radii: ArrayLike) -> tuple[Ids, Floats]:
    """The sphere that each ray from a point meets first, -1 for none, and t, correctly rounded."""
    d, spheres = np.asarray(directions, float).reshape(-1, 3), spheres_at(centers, radii)
    kinds, rays = Kinds([spheres]), along(at_point(origin, len(d)), d, np.eye(3))
    found = kinds.closest(rays)
    return found.item, kinds.rounded(rays, found)


def spheres_at(centers: ArrayLike, radii: ArrayLike) -> Spheres:
    places = np.asarray(centers, float).reshape(-1, 3)
    n = len(places)
    return Spheres(places, np.broadcast_to(radii, n).astype(float), np.arange(n), np.full(n, -1), np.zeros((0, 3, 3)))
