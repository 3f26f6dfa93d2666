"""Rays that start on surfaces, where that is hard: for the tests of whoever decides about such rays.

A regime is a scene, and its rays are of five kinds: anywhere, at another surface, all but touching it, all but along
the surface on which they start, and inwards. Half of them start where that surface is nearest to the other one.

PICTURES has regimes of pictures in which all surfaces are mirrors, or glass, and rays go on once: cameras are aimed so
that what goes on are such rays, which the eye sees by a surface. It is near it, mostly, and the picture is from a
sixth of a degree to next to nothing wide. Each surface has a colour that names it, so that a pixel tells what is met.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from surface_rays import along, on_spheres

from cltrace.base.arithmetic import Floats
from cltrace.oracle.search import Rays
from cltrace.oracle.shapes import Spheres
from cltrace.reference.bounce import refracted
from cltrace.reference.vectors import Direction
from cltrace.scene import Camera, Scene, ambient_light

Made = tuple[Floats, Floats, Floats]  # centers, radii, and what makes ellipsoids of them, (n, 3, 3)


class Leaving(NamedTuple):
    """n rays that leave spheres. own: (n,), the surface on which each starts; normal: (n, 3), q, in camera space, but
    of an ellipsoid in its own axes; direction: (n, 3), in camera space; basis: (3, 3), the camera's axes."""

    own: NDArray[np.int32]
    normal: Floats
    direction: Floats
    basis: ArrayLike

    def path(self, spheres: Spheres) -> Rays:
        return along(
            on_spheres(spheres, self.own.astype(np.int64), self.normal, self.basis), self.direction, self.basis
        )


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _turned(rng: np.random.Generator, lengths: Floats) -> Floats:
    """Ellipsoids with these half axes, (n, 3), turned somehow."""
    first, second = np.linalg.qr(rng.normal(size=(2, len(lengths), 3, 3)))[0]
    return np.asarray(first @ (lengths[:, :, None] * second))


def _round(count: int) -> Floats:
    return np.broadcast_to(np.eye(3), (count, 3, 3))


def room(rng: np.random.Generator, distance: float = 0.0) -> Made:
    """Spheres, `distance` from the world's origin."""
    return 3 * rng.normal(size=(6, 3)) + distance, rng.uniform(0.2, 2, 6), _round(6)


def shells(rng: np.random.Generator) -> Made:
    """Concentric, the next one an ulp larger or smaller, and some in between."""
    radius = rng.uniform(0.5, 2)
    radii = [radius, np.nextafter(radius, 0), np.nextafter(radius, 9), radius * (1 + 2.0**-40), radius * (1 - 2.0**-20)]
    return np.repeat(rng.normal(size=(1, 3)), 5, axis=0), np.array(radii), _round(5)


def touching(rng: np.random.Generator) -> Made:
    """All touch the first one but for rounding, from outside, or from inside around it or within it."""
    radii = rng.uniform(0.2, 2, 6)
    away = radii[0] + radii * (0, 1, -1, 1, -1, 1)
    centers = np.repeat(rng.normal(size=(1, 3)), 6, axis=0)
    centers[1:] += away[1:, None] * _unit(rng.normal(size=(5, 3)))
    return centers, radii, _round(6)


def stack(rng: np.random.Generator) -> Made:
    """Of whole numbers: they touch exactly, in a row, with one around each pair."""
    axis = np.eye(3)[rng.integers(3)]
    at, radii = np.array([0.0, 4, 8, 2, 6]), np.array([2.0, 2, 2, 4, 4])
    return at[:, None] * axis + rng.integers(-9, 9, 3), radii, _round(5)


def sizes(rng: np.random.Generator) -> Made:
    """From 1e-3 to 1e7, small ones on large ones."""
    radii = 10.0 ** np.array([7, rng.uniform(3, 6), 0, rng.uniform(-2, 0), -3, -3])
    centers = np.zeros((6, 3))
    centers[0, 1], centers[1:] = -radii[0], 4 * rng.normal(size=(5, 3)) * np.sqrt(radii[1:, None])
    centers[1:, 1] = radii[1:] * (1 + rng.uniform(0, 1e-9, 5))
    return centers, radii, _round(6)


def eggs(rng: np.random.Generator, ratio: float = 3.0, distance: float = 0.0) -> Made:
    """Ellipsoids, the longest half axis up to `ratio` times the shortest one, and two spheres."""
    centers, radii, _ = room(rng, distance)
    lengths = ratio ** rng.uniform(-1, 0, (6, 3))
    lengths[:, 0], lengths[0, 1:] = 1, 1 / ratio
    shape = _turned(rng, lengths)
    shape[4:] = np.eye(3)
    return centers, radii, shape


def egg_shells(rng: np.random.Generator) -> Made:
    """Concentric ellipsoids of one shape, an ulp apart."""
    centers, radii, _ = shells(rng)
    return centers, radii, np.repeat(_turned(rng, np.array([[1, 0.5, 0.2]])), 5, axis=0)


REGIMES: dict[str, Callable[[np.random.Generator], Made]] = {
    "spheres": room,
    "spheres, 1e7 from the origin": lambda rng: room(rng, 1e7),
    "shells an ulp apart": shells,
    "touching but for rounding": touching,
    "touching exactly": stack,
    "radii from 1e-3 to 1e7": sizes,
    "ellipsoids": eggs,
    "ellipsoids, 1e7 from the origin": lambda rng: eggs(rng, distance=1e7),
    "needles and discs, 1 : 1000": lambda rng: eggs(rng, 1e3),
    "ellipsoids, an ulp apart": egg_shells,
}


def scene_of(name: str, seed: int) -> Scene:
    """The regime's scene, before a camera that stands near it and looks anywhere, or along the axes for even seeds."""
    rng = np.random.default_rng([seed, list(REGIMES).index(name)])
    centers, radii, shape = REGIMES[name](rng)
    eye = centers[-1] + 5 * rng.normal(size=3)
    camera = Camera(tuple(eye), tuple(eye + rng.normal(size=3)), tuple(rng.normal(size=3)))
    if seed % 2 == 0:
        camera = Camera(tuple(eye), tuple(eye - (0, 0, 1)))
    return Scene.from_spheres(camera, (), centers, radii, transform=shape)


# The kinds of rays.
ANYWHERE, AT_ANOTHER, TOUCHING, ALONG, INWARDS = KINDS = tuple(range(5))


def rays_of(scene: Scene, count: int, seed: int, kinds: Sequence[int] = KINDS, widest: float = 1e-1) -> Leaving:
    """Rays of these kinds from all surfaces of a scene. widest: how far from its kind a ray may be."""
    rng, spheres = np.random.default_rng(seed), scene.spheres
    bent = spheres["to_object"] >= 0
    K = np.where(bent[:, None, None], scene.to_object[spheres["to_object"]] if bent.any() else np.eye(3), np.eye(3))
    L, basis = np.linalg.inv(K), np.array(scene.camera.basis())
    own, other = rng.integers(len(spheres), size=(2, count))
    gap, little = spheres["center"][other] - spheres["center"][own], _little(rng, count, widest)
    towards = _of(K[own], gap) + np.where(own == other, 1.0, 0.0)[:, None]
    u = _unit(np.where(rng.random((count, 1)) < 0.5, rng.normal(size=(count, 3)), _unit(_some(towards)) + little))
    to = gap - spheres["radius"][own, None] * _of(L[own], u)
    normal = _unit(_of(K[own].transpose(0, 2, 1), u))
    there = _of(L[other], _unit(rng.normal(size=(count, 3))) * spheres["radius"][other, None])
    ways = [
        rng.normal(size=(count, 3)),
        to + there,
        _of(L[other], _tangent(rng, _of(K[other], to), spheres["radius"][other]) + _little(rng, count, widest)),
        np.cross(normal, rng.normal(size=(count, 3))) + little,
        little - normal,
    ]
    d = _some(np.choose(np.array(kinds)[rng.integers(len(kinds), size=(count, 1))], ways)) * 10.0 ** rng.uniform(
        -3, 3, (count, 1)
    )
    q = np.where(bent[own, None], u, _unit(u @ basis.T))
    return Leaving(own.astype(np.int32), q, d @ basis.T, basis)


def _of(matrices: Floats, v: Floats) -> Floats:
    return np.asarray(np.einsum("nij,nj->ni", matrices, v))


def _little(rng: np.random.Generator, count: int, widest: float) -> Floats:
    return np.asarray(rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-17, math.log10(widest), (count, 1)))


def _some(v: Floats) -> Floats:
    """v, but the x axis where it is 0."""
    return np.where(v.any(axis=1, keepdims=True), v, np.array([1.0, 0, 0]))


def _tangent(rng: np.random.Generator, f: Floats, r: NDArray[np.float64]) -> Floats:
    """Along a line that all but touches a sphere whose centre is at f; from inside, across f."""
    far = np.linalg.norm(_some(f), axis=1)
    sine = np.minimum(1, r / far)[:, None]
    side = _unit(_some(np.cross(f, rng.normal(size=f.shape))))
    return np.asarray(f / far[:, None] * np.sqrt((1 - sine) * (1 + sine)) + side * sine)


# ---------------------------------------------------------------------------------------------------------- pictures


class Regime(NamedTuple):
    """shapes: see REGIMES; kinds, widest: of the rays at which cameras are aimed, see rays_of(); glass: the
    share of surfaces that are glass, the others being mirrors; decades: half of the pictures are at most that many
    powers of ten wider than what the rounding of the eye allows for."""

    shapes: Callable[[np.random.Generator], Made]
    kinds: tuple[int, ...] = KINDS
    glass: float = 0.5
    widest: float = 1e-1
    decades: float = 3


def _far_side(rng: np.random.Generator) -> Made:
    """A ball, and what is at its wall: smaller balls that touch it from within, stick in it, and all but reach it."""
    radii = np.array([1.0, *10.0 ** rng.uniform(-3, -0.5, 6)])
    away = 1 + radii * np.array([-1, -1, -1, 0, 0.5, 1, 1 + 2.0**-30])
    way = rng.normal(size=(7, 3))
    away[0] = 0
    return away[:, None] * (way / np.linalg.norm(way, axis=1)[:, None]) + rng.normal(size=3), radii, _round(7)


def _many(rng: np.random.Generator) -> Made:
    """A ball among a thousand small ones."""
    way, n = rng.normal(size=(1000, 3)), 1001
    centers, radii = np.zeros((n, 3)), np.ones(n)
    centers[1:] = way / np.linalg.norm(way, axis=1)[:, None] * rng.uniform(1.02, 3, (1000, 1))
    radii[1:] = 10.0 ** rng.uniform(-2, -0.8, 1000)
    return centers, radii, _round(n)


PICTURES: dict[str, Regime] = {
    **{name: Regime(shapes) for name, shapes in REGIMES.items()},
    "grazing mirrors": Regime(room, (TOUCHING, ALONG), 0, 1e-15, 0.5),
    "grazing glass": Regime(room, (TOUCHING, ALONG, INWARDS), 1, 1e-15, 0.5),
    "the far side of glass": Regime(_far_side, (TOUCHING, INWARDS), 1),
    "a thousand balls round a mirror": Regime(_many, glass=0.1),
}


def scenes_of(name: str, seed: int, size: tuple[int, int], cameras: int) -> Iterator[Scene]:
    """A scene of a regime, seen by so many cameras; size: of the pictures, pixels."""
    rng, regime = np.random.default_rng([seed, list(PICTURES).index(name)]), PICTURES[name]
    centers, radii, maps = regime.shapes(rng)
    axes, n = Camera((0, 0, 0), tuple(rng.normal(size=3))), len(radii)
    glass, digits = rng.random(n) < regime.glass, 256  # of a colour's channel
    scene = Scene.from_spheres(
        axes,
        [ambient_light((1, 1, 1))],
        centers,
        radii,
        np.arange(n)[:, None] // digits ** np.arange(3) % digits / digits,
        ka=1,
        kd=0,
        ks=0,
        reflectance=1.0 - glass,
        transmittance=1.0 * glass,
        index=rng.choice([1.0, 1.5, 0.75, 2.5], n),
        transform=maps,
        background=(1.0, 1.0, 1.0),
    )
    rays = rays_of(scene, cameras, int(rng.integers(2**32)), regime.kinds, regime.widest)
    for row in range(cameras):
        camera = _aimed(scene, rays, row, regime.decades, rng)
        yield scene.seen_by(replace(camera, resolution=size, max_bounces=0))


def _aimed(scene: Scene, rays: Leaving, row: int, decades: float, rng: np.random.Generator) -> Camera:
    """A camera that looks at where a ray starts, such that the ray is what goes on from there, but for rounding.

    What it sees is between all of that and next to nothing beside it. Something else may be in the way.
    """
    own, material = int(rays.own[row]), scene.materials[int(rays.own[row])]
    K = scene.to_object[scene.spheres["to_object"][own]] if scene.spheres["to_object"][own] >= 0 else np.eye(3)
    basis = np.array(scene.camera.basis())
    u = rays.normal[row] if scene.spheres["to_object"][own] >= 0 else rays.normal[row] @ basis
    n, d = u @ K, rays.direction[row] @ basis
    n, d = n / np.linalg.norm(n), d / np.linalg.norm(d)
    r = float(scene.spheres["radius"][own])
    step, side = r * np.linalg.solve(K, u), 1 if n @ d > 0 else -1
    v = d - 2 * (n @ d) * n
    if material["transmittance"]:
        back = refracted(Direction(*-d), Direction(*n), side, float(material["index"]))
        v, side = (v, side) if back is None else (-np.array(tuple(back)), -side)
    # From within, no farther than to the wall; but an eye that is all but on it is for other tests.
    chord = 2 * (K @ step) @ (K @ v) / ((K @ v) @ (K @ v))
    away = rng.uniform(0.05, 0.95) * chord if side < 0 else r * 10.0 ** rng.uniform(-1.5, 1.5)
    away = max(away, 2.0**-20 * r)
    eye = scene.spheres["center"][own] + step - away * v
    # Its place is rounded, by which the aim is off, and the far point at which it looks, by next to nothing.
    size = np.abs(eye).max() + away
    least = math.log10(min(2.0**-46 * size / away, 0.1))
    angle = math.degrees(math.atan(10.0 ** rng.uniform(least, rng.choice([0.3, min(0.3, least + decades)]))))
    return Camera(tuple(eye), tuple(eye + 4 * size * v), tuple(rng.normal(size=3)), angle)
