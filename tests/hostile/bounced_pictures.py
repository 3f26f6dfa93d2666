"""Pictures that name what the ray meets that goes on from what a pixel shows, and what the exact oracle says of it.

Every surface is a perfect mirror or all glass, and has a colour of its own; light is ambient and white, max_bounces 0.
So each ray goes on once, and its pixel shows the colour of what it meets then: `names` reads it. `second_rays` makes
the same rays in numpy, operation by operation as the kernel and the reference do, and the oracle says what
they meet. Which rays from the eye meet what is not judged here: that is read from the picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from surface_rays import along, at_point

from cltrace.base.arithmetic import Floats
from cltrace.oracle.search import Kinds
from cltrace.oracle.shapes import Spheres
from cltrace.picture.image import Image
from cltrace.reference import OnSphere, World, world_of
from cltrace.reference.spheres import Ellipsoid, Round
from cltrace.reference.surfaces import Surface
from cltrace.reference.trace import primary_ray
from cltrace.scene import MATERIAL, Camera, Scene, ambient_light
from hostile.sphere_regimes import rays as camera_rays

from . import bounced_regimes
from .bounced_regimes import ALONG, INWARDS, KINDS, REGIMES, TOUCHING, Leaving, Made
from .columns import Bools, Vector, columns_of, constant, cross, dot, magnitude, minus, pick, plus, product, times

Ids = NDArray[np.int32]

DIGITS = 255  # of a colour's channel that stand for a surface; the one that is left is the background's


class Regime(NamedTuple):
    """shapes: see bounced_regimes; kinds, widest: of the rays at which cameras are aimed, see rays_of(); glass: the
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


def _in_a_shell(rng: np.random.Generator) -> Made:
    """A shell, a ball within it that touches it but for rounding, and a ball around that one an ulp larger."""
    way, radius = rng.normal(size=3), rng.uniform(0.2, 0.8)
    center = (1 - radius) * way / np.linalg.norm(way)
    return (
        np.array([np.zeros(3), center, center, -0.5 * center]),
        np.array([1, radius, np.nextafter(radius, 2), 0.1]),
        _round(4),
    )


def _many(rng: np.random.Generator) -> Made:
    """A ball among a thousand small ones."""
    way, n = rng.normal(size=(1000, 3)), 1001
    centers, radii = np.zeros((n, 3)), np.ones(n)
    centers[1:] = way / np.linalg.norm(way, axis=1)[:, None] * rng.uniform(1.02, 3, (1000, 1))
    radii[1:] = 10.0 ** rng.uniform(-2, -0.8, 1000)
    return centers, radii, _round(n)


def _round(count: int) -> Floats:
    return np.broadcast_to(np.eye(3), (count, 3, 3))


PICTURES: dict[str, Regime] = {
    **{name: Regime(shapes) for name, shapes in REGIMES.items()},
    "grazing mirrors": Regime(bounced_regimes.room, (TOUCHING, ALONG), 0, 1e-15, 0.5),
    "grazing glass": Regime(bounced_regimes.room, (TOUCHING, ALONG, INWARDS), 1, 1e-15, 0.5),
    "the far side of glass": Regime(_far_side, (TOUCHING, INWARDS), 1),
    "a ball in a shell": Regime(_in_a_shell),
    "a thousand balls round a mirror": Regime(_many, glass=0.1),
}


def scenes_of(name: str, seed: int, size: tuple[int, int], cameras: int) -> Iterator[Scene]:
    """A scene of a regime, seen by so many cameras; size: of the pictures, pixels."""
    rng, regime = np.random.default_rng([seed, list(PICTURES).index(name)]), PICTURES[name]
    centers, radii, maps = regime.shapes(rng)
    axes = Camera((0, 0, 0), tuple(rng.normal(size=3)))
    glass = rng.random(len(radii)) < regime.glass
    index = rng.choice([1.0, 1.5, 0.75, 2.5], len(radii))
    scene = named(Scene.from_spheres(axes, (), centers, radii, transform=maps), glass, index)
    rays = bounced_regimes.rays_of(scene, cameras, int(rng.integers(2**32)), regime.kinds, regime.widest)
    for row in range(cameras):
        camera = _aimed(scene, rays, row, regime.decades, rng)
        yield scene.seen_by(replace(camera, resolution=size, max_bounces=0))


def named(scene: Scene, glass: Bools, index: Floats) -> Scene:
    """The same surfaces, of which those of `glass`, (n,), let all light through, and the others mirror all of it.

    index: (n,), of refraction. The digits of a surface's number are its colour.
    """
    n = len(scene.spheres)
    materials = np.zeros(n, MATERIAL)
    materials["texture"] = -1
    materials["color"] = np.arange(n)[:, None] // DIGITS ** np.arange(3) % DIGITS / (DIGITS + 1)
    materials["ka"] = 1
    materials["transmittance"], materials["reflectance"] = glass, ~glass
    materials["index"] = index
    spheres = scene.spheres.copy()
    spheres["material"] = np.arange(n)
    light = ambient_light((1, 1, 1))
    return replace(scene, lights=light, spheres=spheres, materials=materials, background=(1.0, 1.0, 1.0))


def names(color: ArrayLike) -> Ids:
    """(n,) surfaces by their colours (n, 3), -1 for the background, -2 for what is no surface's."""
    parts = np.asarray(color, float) * (DIGITS + 1)
    whole = (parts == np.rint(parts)).all(axis=1) & (parts >= 0).all(axis=1)
    ids = np.where(whole & (parts < DIGITS).all(axis=1), parts @ DIGITS ** np.arange(3.0), -2)
    return np.where((parts == DIGITS + 1).all(axis=1), -1, ids).astype(np.int32)


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
        index = float(material["index"])
        back, total = _refracted(columns_of(-d[None]), columns_of(n[None]), np.array([side]), index, 1.0)
        v, side = (v, side) if total[0] else (-np.array(back)[:, 0], -side)
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


def judge(scene: Scene, image: Image) -> tuple[int, NDArray[np.intp]]:
    """How many second rays a picture with colours and ids shows, and the pixels of those that met something else than
    the exact oracle says."""
    if image.id is None or image.color is None:
        raise ValueError("image: must have color and id")
    pixels, rays = second_rays(scene, image.id.ravel())
    met = names(image.color.reshape(-1, 3)[pixels])
    spheres = Spheres.of(scene)
    return len(pixels), pixels[met != Kinds([spheres]).closest(rays.path(spheres)).item]


# ------------------------------------------------------------------------------------------------------- the same rays


class Starts(NamedTuple):
    """Where n rays from the eye meet a surface. q: see Leaving; normal: outward, unit; side: (n,), 1 for rays from
    outside, -1 from inside; sure: (n,), whether doubles are sure of all that."""

    q: Vector
    normal: Vector
    side: NDArray[np.int_]
    sure: Bools


def second_rays(scene: Scene, first: Ids) -> tuple[NDArray[np.intp], Leaving]:
    """The pixels whose ray goes on, and the rays that do. first: (pixels,), the surfaces that the picture shows."""
    pixels = np.flatnonzero(first >= 0)
    d, world, own = camera_rays(scene.camera)[pixels], world_of(scene), first[pixels]
    normal, direction = np.empty_like(d), np.empty_like(d)
    for i in np.unique(own).tolist():
        rows, surface = np.flatnonzero(own == i), cast(Round, world.surfaces[i])
        starts = starts_on(surface, columns_of(d[rows]), np.array(scene.camera.position))
        _by_reference(world, i, pixels[rows], starts)
        normal[rows] = np.transpose(starts.q)
        direction[rows] = np.transpose(onward(surface, columns_of(d[rows]), starts))
    return pixels, Leaving(own, normal, direction, np.array(scene.camera.basis()))


def starts_on(surface: Round, d: Vector, eye: Floats) -> Starts:
    """Where rays from the eye meet a surface, which they meet. d: in camera space; eye: (3,), in the world."""
    with np.errstate(all="ignore"):  # those are not sure
        return _on_ellipsoid(surface, d, eye) if isinstance(surface, Ellipsoid) else _on_sphere(surface, d)


def _on_sphere(surface: Round, d: Vector) -> Starts:
    """from_eye() of cltrace/reference/spheres.py."""
    C, r, c = constant(surface.center), surface.radius, surface.eye_power
    a, b, outside = dot(d, d), dot(C, d), surface.eye_outside
    k = b * (1 / a)
    v = minus(C, times(k, d))
    bb, rr, arr = b * b, r * r, a * (r * r)
    by_b = (bb < arr) | (not outside)
    D = np.where(by_b, bb - a * c, a * (rr - dot(v, v)))
    sure = (np.abs(D) > (bb + arr) * 2.0**-48) & ~(arr < bb * 2.0**-42)
    root = np.sqrt(np.maximum(D, 0))
    q = np.where(b < 0, b - root, b + root)
    t = np.where((b < 0) == outside, q / a, c / q)
    t = np.where((b >= 0) & ~by_b & (a * c > 2.0**-10 * bb), (b - root) * (1 / a), t)
    along = times(root * (1 / a), d)
    g = pick(by_b, minus(times(t, d), C), times(-1, plus(v, along)))
    n = times(1 / r, g)
    n = times(0.5 * (3 - dot(n, n)), n)
    return Starts(n, n, np.full(len(a), 1 if outside else -1), sure & (D > 0) & (t > 0) & (t < math.inf))


def _on_ellipsoid(surface: Ellipsoid, d: Vector, eye: Floats) -> Starts:
    """from_surface() of cltrace/reference/spheres.py, from the eye. Where it is in doubt, t is the exact one."""
    k, r = surface.stretch, surface.radius
    f = constant((surface.exact.center - surface.view.exact_eye).fractions())
    w = product(surface.view.B.T, d)
    s, w1 = k * magnitude(f), k * magnitude(w)
    f, w = product(surface.K, f), product(surface.K, w)
    X, a, b, ff, rr = cross(f, w), dot(w, w), dot(f, w), dot(f, f), r * r
    XX, arr, c = dot(X, X), a * rr, ff - rr
    D, e, w_error = arr - XX, 2.0**-47 * s * w1, 2.0**-49 * w1
    a_error = w_error * (2 * magnitude(w) + w_error)
    D_error = (2 * magnitude(X) * e + e * e) + 2.0**-47 * (arr + XX) + rr * a_error
    root = np.sqrt(np.maximum(D, 0))
    reach, outside = np.abs(b) + root, surface.eye_outside
    sure = (D_error < D) & (D_error <= 2.0**-25 * root * reach) & (e <= 2.0**-26 * reach) & (a_error <= 2.0**-27 * a)
    sure &= np.abs(c) > 2.0**26 * (2.0**-46 * s * s + 2.0**-50 * (ff + rr))
    t = c / reach if outside else np.where(b >= 0, reach / a, -c / reach)
    sure |= _put_exact_t(t, surface, d, eye, np.flatnonzero(~sure))
    g = minus(times(t, w), f)
    q = times(1 / np.sqrt(dot(g, g)), g)
    n = product(surface.K.T, q)
    n = product(surface.view.B, times(1 / np.sqrt(dot(n, n)), n))
    return Starts(q, n, np.full(len(a), 1 if outside else -1), sure & (t > 0) & (t < math.inf))


def _put_exact_t(t: Floats, surface: Ellipsoid, d: Vector, eye: Floats, rows: NDArray[np.intp]) -> Bools:
    """(n,): for which of t, (n,), this has put in the exact one, rounded. rows: which to try."""
    done = np.zeros(len(t), bool)
    if len(rows):
        basis = np.array([tuple(row) for row in (surface.view.B.x, surface.view.B.y, surface.view.B.z)])
        K = np.array([tuple(row) for row in (surface.K.x, surface.K.y, surface.K.z)])
        zero = np.zeros(1, int)
        kinds = Kinds([Spheres(np.array([tuple(surface.place)]), np.array([surface.radius]), zero, zero, K[None])])
        rays = along(at_point(eye, len(rows)), np.transpose(d)[rows], basis)
        t[rows], done[rows] = kinds.rounded(rays, kinds.closest(rays)), True
    return done & (t < math.inf)


def _by_reference(world: World, i: int, pixels: NDArray[np.intp], starts: Starts) -> None:
    """Puts what the reference says into `starts` where doubles are not sure."""
    width = world.camera.resolution[0]
    for row in np.flatnonzero(~starts.sure).tolist():
        ray = primary_ray(world.camera, int(pixels[row]) % width, int(pixels[row]) // width)
        t = world.surfaces[i].intersect(ray)
        if t is None:
            raise ValueError(f"pixel {pixels[row]}: its ray does not meet surface {i}")
        at = world.surfaces[i].intersection_at(ray, t)
        starts.side[row] = at.side
        for vector, value in ((starts.q, cast(OnSphere, at.start).normal), (starts.normal, at.outward)):
            for x, part in zip(vector, value, strict=True):
                x[row] = part


def onward(surface: Surface, d: Vector, starts: Starts) -> Vector:
    """As bounces() of cltrace/reference/trace.py, for a surface that mirrors all or lets all through."""
    n, side, spread = starts.normal, starts.side, surface.spread
    mirrored = lift(minus(d, times(2 * dot(n, d), n)), n, side, spread)
    if not surface.material.transmittance:
        return mirrored
    through, total = _refracted(d, n, side, surface.material.index, spread)
    return pick(total, mirrored, through)


def _refracted(d: Vector, n: Vector, side: NDArray[np.int_], index: float, spread: float) -> tuple[Vector, Bools]:
    """refracted() of cltrace/reference/bounce.py, and where reflection is total instead."""
    if index == 1:
        return d, np.zeros(len(side), bool)
    eta, N = np.where(side > 0, 1 / index, index), times(side, n)
    c, X = -dot(N, d), cross(n, d)
    k = dot(d, d) - (eta * eta) * dot(X, X)
    bent = minus(times(eta, plus(d, times(c, N))), times(np.sqrt(np.maximum(k, 0)), N))
    return lift(bent, n, -side, spread), k < 0


def lift(d: Vector, n: Vector, side: NDArray[np.int_], spread: float) -> Vector:
    leaves, least = side * dot(n, d), 2.0**-48 * magnitude(d) * spread
    return pick(leaves > least, d, plus(d, times(side * (2 * least - leaves), n)))
