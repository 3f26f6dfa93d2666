"""What the pixels of a scene must be, by the reference tracer, which decides exactly what is hit and what is lit.

A scene of many round spheres is thinned first: of a million, a ray and its shadow rays come near a few hundred.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.limits import MAX_SIDE
from cltrace.oracle.spheres import closest
from cltrace.plan.abi import Precision
from cltrace.reference import Material, byte_of, world_of
from cltrace.reference.trace import cast_shadow_ray, illuminate, primary_ray, trace
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, MATERIAL, PARALLEL, Scene

if TYPE_CHECKING:
    from .scenes import Case
    from .tracers import Product

Floats = NDArray[np.float64]

# Up to so many spheres, all of them are tried for every ray.
MANY = 128

# So many rays a side are a pixel's true mean, or fewer if a picture of them has more pixels than that.
RAYS, MOST_PIXELS = 64, 2**28
# So many rays are traced at a time, a band, which bounds the memory that they take. Of a case's picture, one of so many
# bands is drawn.
BAND, BANDS = 2**21, 4

WHITE = Material(color=(1.0, 1.0, 1.0), ka=0.0, kd=1.0, ks=0.0, exponent=1.0)


@dataclass(frozen=True)
class Answer:
    """What n pixels must be, to be held against a picture; or what a picture says they are.

    id: (n,), index of the sphere, -1 = nothing; depth: (n,), distance from the eye in scene units, inf = nothing;
    normal: (n, 3), unit vector in the world, facing the eye, 0 = nothing; lit: (n, k), whether each of k lights, all
    that are not ambient, reaches the point; light: (n, k), n.l times the strength of a spot light, from answer() as if
    nothing were in the way; color: (n, 3), linear; rgb8: (n, 3).
    """

    id: NDArray[Any]
    depth: NDArray[Any]
    normal: NDArray[Any]
    lit: NDArray[np.bool_]
    light: NDArray[Any]
    color: NDArray[Any]
    rgb8: NDArray[np.uint8]

    def at(self, rows: NDArray[np.intp]) -> Answer:
        """The same of some rows only."""
        return Answer(**{name: value[rows] for name, value in self.__dict__.items()})


def lamps(scene: Scene) -> list[Scene]:
    """The scene in white without highlights, once for every three of its lights, which are red, green and blue.

    So a pixel is red by n.l of the first light if that light reaches it, and else not at all. Of a scene without lights
    there is one, too.
    """
    lights = scene.lamps[scene.lamps["kind"] != AMBIENT].copy()
    lights["color"] = np.resize(np.eye(3), (len(lights), 3))
    white = np.zeros(1, MATERIAL)
    white["color"], white["kd"], white["texture"] = 1, 1, -1
    spheres, cylinders = scene.spheres.copy(), scene.cylinders.copy()
    spheres["material"] = cylinders["material"] = 0
    meshes = tuple(mesh.of(0, mesh.number) for mesh in scene.meshes)
    return [
        replace(
            scene,
            lights=lights[k : k + 3],
            spheres=spheres,
            cylinders=cylinders,
            materials=white,
            background=(0.0, 0.0, 0.0),
            meshes=meshes,
            textures=(),
        )
        for k in range(0, max(1, len(lights)), 3)
    ]


def can_thin(scene: Scene) -> bool:
    """Whether all of it is round spheres, in perspective."""
    others = scene.meshes or len(scene.cylinders) or scene.camera.parallel
    return not others and bool((scene.spheres["to_object"] < 0).all())


def answer(scene: Scene, pixels: NDArray[np.intp]) -> Answer:
    """What these pixels, counted row by row, must be: see the module's first lines."""
    if len(scene.spheres) <= MANY or not can_thin(scene):
        return _answer(scene, pixels)
    parts = []
    for pixel in pixels:
        chosen = _near(scene, pixel)
        part = _answer(_only(scene, chosen), np.array([pixel]))
        parts.append(replace(part, id=np.append(chosen, -1)[part.id].astype(np.int32)))
    return Answer(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in parts[0].__dict__})


def _only(scene: Scene, chosen: NDArray[np.intp]) -> Scene:
    """The scene with these spheres only, and with their materials only."""
    spheres = scene.spheres[chosen]
    used, spheres["material"] = np.unique(spheres["material"], return_inverse=True)
    return replace(scene, spheres=spheres, materials=scene.materials[used])


def _near(scene: Scene, pixel: int) -> NDArray[np.intp]:
    """Indices of the spheres that the pixel's ray may meet, or a shadow ray from where it ends, and of a few more."""
    camera, (center, radius) = scene.camera, (scene.spheres["center"], scene.spheres["radius"])
    ray = primary_ray(camera, pixel % camera.resolution[0], pixel // camera.resolution[0])
    eye, d = np.array(camera.position), np.array(tuple(ray.direction)) @ np.array(camera.basis())
    chosen = _along(eye, d, center, radius)
    index, t = closest(eye, d[None], center[chosen], radius[chosen])
    if index[0] < 0:
        return chosen
    p = eye + t[0] * d
    ways = [
        -light["direction"] if light["kind"] == PARALLEL else light["position"] - p
        for light in scene.lamps[scene.lamps["kind"] != AMBIENT]
    ]
    return np.unique(np.concatenate([chosen, *(_along(p, way, center, radius) for way in ways)]))


def _along(origin: Floats, d: Floats, center: Floats, radius: Floats) -> NDArray[np.intp]:
    """Indices of the spheres that a line may meet: |f x d|^2 <= |d|^2 r^2, with a margin far above all rounding."""
    (x, y, z), f = d / np.linalg.norm(d), center - origin
    across = (f[:, 1] * z - f[:, 2] * y) ** 2 + (f[:, 2] * x - f[:, 0] * z) ** 2 + (f[:, 0] * y - f[:, 1] * x) ** 2
    margin = 1e-9 * (np.einsum("ij,ij->i", f, f) + float(origin @ origin))
    return np.flatnonzero(across <= radius**2 * (1 + 1e-6) + margin)


def _answer(scene: Scene, pixels: NDArray[np.intp]) -> Answer:
    """answer() for a scene of which all surfaces are looked at."""
    width = scene.camera.resolution[0]
    world = world_of(scene)
    # The same lights in white, with nothing in their way.
    nothing = replace(scene, spheres=scene.spheres[:1], cylinders=scene.cylinders[:0], bonds=None, meshes=())
    bare = [replace(world_of(lamp), surfaces=[]) for lamp in lamps(nothing)]
    n, k = len(pixels), len(world.lights)
    out = Answer(
        id=np.full(n, -1, np.int32),
        depth=np.full(n, np.inf, np.longdouble),
        normal=np.zeros((n, 3)),
        lit=np.zeros((n, k), bool),
        light=np.zeros((n, k)),
        color=np.zeros((n, 3)),
        rgb8=np.zeros((n, 3), np.uint8),
    )
    basis = np.array(scene.camera.basis())
    for row, pixel in enumerate(pixels.tolist()):
        ray = primary_ray(scene.camera, pixel % width, pixel // width)
        out.color[row], at = trace(world, ray)
        out.rgb8[row] = [byte_of(c) for c in out.color[row]]
        if at is None:
            continue
        out.id[row], out.depth[row] = at.index, at.distance
        out.normal[row] = np.array(tuple(at.normal)) @ basis
        dull = replace(at, material=WHITE)
        out.light[row] = [max(illuminate(lamp, ray, dull, light).color) for lamp in bare for light in lamp.lights]
        out.lit[row] = [not cast_shadow_ray(world, at, light) for light in world.lights]
    out.lit[:] &= out.light > 0
    return out


@dataclass(frozen=True)
class Truth:
    """What a whole picture is held against.

    levels: (h, w, 3), of 255, bytes, or NaN in rows where it is not known; text: what it is, and how that is known;
    answer: the same, surface by surface, None where there is none.
    """

    levels: Floats | NDArray[np.uint8]
    text: str
    answer: Answer | None = None


def held_against(case: Case, reference: Product | None) -> Truth | None:
    """The truth of a case, as the reference in double precision draws it; None without one."""
    if reference is None:
        return None
    if case.task == "samples":
        levels, n = means(case.scene, reference.on, bands=BANDS)
        return Truth(levels, f"means of {n} x {n} rays a pixel, in a {BANDS}th of the rows, by cltrace, accurate")
    found = reference.answer(case.scene)
    width, height = case.scene.camera.resolution
    bytes_of = found.rgb8.reshape(height, width, 3)
    if case.task == "members":
        return Truth(
            bytes_of, f"{len(case.scene.lamps)} lights in place of the soft ones, by cltrace in double precision"
        )
    return Truth(bytes_of, "cltrace in double precision, a sample of it against the reference tracer", found)


def means(scene: Scene, device: Device, precision: Precision = "accurate", bands: int = 1) -> tuple[Floats, int]:
    """(h, w, 3): a picture's means, in levels of 255, over n x n rays a pixel, each clamped to 0..1; and n.

    bands: only the first of so many bands of rows is drawn, again and again; the others are NaN.
    """
    width, height = scene.camera.resolution
    n = RAYS
    while n > 1 and (n * max(width, height) > MAX_SIDE or n * n * width * height > MOST_PIXELS):
        n //= 2
    fine = scene.seen_by(replace(scene.camera, resolution=(n * width, n * height)))
    rows = max(1, BAND // (n * n * width))
    out = np.full((height, width, 3), np.nan)
    for first in range(0, height, bands * rows):
        end = min(height, first + rows)
        crop = (0, n * first, n * width, n * end)
        color = np.minimum(Renderer(fine, device, precision, ("color",), crop).render(progress=False).color, 1)
        out[first:end] = color.reshape(end - first, n, width, n, 3).mean(axis=(1, 3), dtype=np.float64)
    return 255 * out, n
