"""What the pixels of a scene must be, and how far off a picture is.

The reference tracer decides exactly what is hit and what is lit, and takes milliseconds a pixel: so a sample of the
pixels is held against it, and all pixels against cltrace in double precision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.limits import MAX_SIDE
from cltrace.picture.image import Image
from cltrace.reference import Ray, byte_of, world_of
from cltrace.reference.trace import closest_hit, illuminate, primary_ray, trace
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, MATERIAL, PARALLEL, Scene
from cltrace.students.check import sample

from .scenes import Floats

# A scene of more round spheres than this is thinned before the reference sees it.
MANY_SPHERES = 128
# Pixels of a scene that are held against the reference, and fewer where it has to try all of more surfaces than that.
CHECKED, MANY_SURFACES = 100, 5000
# Rays across a pixel whose mean is taken for true, and down; there are fewer where their picture would be larger.
RAYS, MOST_PIXELS = 64, 2**28
# Of these rays so many are traced at a time. A picture's rows are in bands of as many, of which one in BANDS is drawn.
BAND, BANDS = 2**21, 4
# A surface that a light meets at a smaller cosine may be black: float32 does not resolve it in a unit vector.
LEAST_COSINE = 2.0**-22


@dataclass(frozen=True)
class Answer:
    """What n pixels show, or must show.

    id: (n,), index of the surface, -1 for none; depth: (n,), distance from the eye in scene units, inf for none;
    light: (n, k), the cosine at which each of k lights that are not ambient arrives, times the strength of a spot
    light, 0 where it does not arrive; rgb8: (n, 3).
    """

    id: NDArray[Any]
    depth: NDArray[Any]
    light: NDArray[Any]
    rgb8: NDArray[np.uint8]

    def at(self, pixels: NDArray[np.intp]) -> Answer:
        """The same of some of the pixels."""
        return Answer(self.id[pixels], self.depth[pixels], self.light[pixels], self.rgb8[pixels])


@dataclass(frozen=True)
class Errors:
    """What is wrong with some pixels.

    wrong_ids: how many show another surface than they must; t_ulp: the largest error of a distance where the surface is
    right, in ulp of float32, of which 0.5 is its rounding; false_shadows, leaks: how many lights do not arrive and
    should, or arrive and must not, over all pixels whose surface is right.
    """

    wrong_ids: int
    t_ulp: float
    false_shadows: int
    leaks: int


def compare(got: Answer, want: Answer) -> Errors:
    """The errors of `got`."""
    right = got.id == want.id
    hit = right & (want.id >= 0)
    seen, due = got.light[hit] > 0, want.light[hit]
    return Errors(
        wrong_ids=int((~right).sum()),
        t_ulp=float(np.nan_to_num(ulps(got.depth[hit], want.depth[hit]), nan=np.inf).max(initial=0)),
        false_shadows=int(((due > LEAST_COSINE) & ~seen).sum()),
        leaks=int((seen & (due <= 0)).sum()),
    )


def ulps(got: NDArray[np.floating], want: NDArray[np.floating]) -> NDArray[np.floating]:
    """Errors of distances, each rounded to float32, in ulp of float32."""
    near = got.astype(np.float32).astype(np.longdouble)
    return np.asarray(np.abs(near - want) / np.spacing(want.astype(np.float32)))


def differ(picture: NDArray[np.uint8], levels: NDArray[Any]) -> float:
    """The share of pixels (..., 3) of which a byte is another one, where levels are known."""
    known = ~np.isnan(levels[..., 0])
    return float((picture[known] != np.rint(levels[known])).any(axis=-1).mean())


def rms(picture: NDArray[np.uint8], levels: NDArray[Any]) -> float:
    """The root mean square of what bytes are off by where levels are known."""
    known = ~np.isnan(levels[..., 0])
    return float(np.sqrt(np.mean((picture[known] - levels[known].astype(np.float64)) ** 2)))


# ------------------------------------------------------------------------------------------------- pictures as answers


def answer_of(scene: Scene, draw: Callable[[Scene], Image]) -> Answer:
    """What pictures say of all pixels, row by row. draw: makes a picture with rgb8, color, depth and id of a scene.

    Which lights arrive is in the colours of white() scenes, of which there are as many as their lights need.
    """
    image, count = draw(scene), int((scene.lamps["kind"] != AMBIENT).sum())
    light = np.zeros((image.id.size, count))
    for first in range(0, count, 3):
        light[:, first : first + 3] = draw(white(scene, first)).color.reshape(-1, 3)[:, : count - first]
    return Answer(image.id.ravel(), image.depth.ravel(), light, image.rgb8.reshape(-1, 3))


def white(scene: Scene, first: int = 0) -> Scene:
    """The scene in white without highlights, in three of its lights from that one on: a red, a green and a blue one.

    So a pixel is red by the cosine of the first of them if that light reaches it, and else not at all.
    """
    lights = scene.lamps[scene.lamps["kind"] != AMBIENT][first : first + 3].copy()
    lights["color"] = np.eye(3)[: len(lights)]
    material = np.zeros(1, MATERIAL)
    material["color"], material["kd"], material["texture"] = 1, 1, -1
    spheres, cylinders = scene.spheres.copy(), scene.cylinders.copy()
    spheres["material"] = cylinders["material"] = 0
    meshes = tuple(mesh.changed(material=0) for mesh in scene.meshes)
    return replace(
        scene, lights=lights, spheres=spheres, cylinders=cylinders, materials=material, background=(0.0, 0.0, 0.0),
        meshes=meshes, textures=(),
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------- the reference


def exact(scene: Scene, pixels: NDArray[np.intp]) -> Answer:
    """What the reference says of these pixels, counted row by row."""
    n, lights, width = len(pixels), int((scene.lamps["kind"] != AMBIENT).sum()), scene.camera.resolution[0]
    out = Answer(np.full(n, -1), np.full(n, np.inf), np.zeros((n, lights)), np.zeros((n, 3), np.uint8))
    chosen, thin = None, can_thin(scene)
    world = world_of(_only(scene, np.arange(0)) if thin else scene)
    for row, pixel in enumerate(pixels.tolist()):
        ray = primary_ray(scene.camera, pixel % width, pixel // width)
        if thin:
            chosen = _spheres_near(scene, ray)
            world = world_of(_only(scene, chosen))
        color, at = trace(world, ray)
        out.rgb8[row] = [byte_of(c) for c in color]
        if at:
            out.id[row] = at.index if chosen is None else chosen[at.index]
            out.depth[row] = at.distance
            found = [illuminate(world, ray, at, light) for light in world.lights]
            out.light[row] = [f.n_l * f.strength if f.fate == "lit" else 0 for f in found]
    return out


def can_thin(scene: Scene) -> bool:
    """Whether it is many round spheres in perspective that neither mirror nor let light through."""
    m, others = scene.materials, scene.meshes or len(scene.cylinders) or scene.camera.parallel
    bounces = (m["reflectance"] > 0).any() or (m["transmittance"] > 0).any()
    return len(scene.spheres) > MANY_SPHERES and not (others or bounces or (scene.spheres["to_object"] >= 0).any())


def _spheres_near(scene: Scene, ray: Ray) -> NDArray[np.intp]:
    """Indices of the spheres that a ray of the camera may meet, or a shadow ray from where it ends."""
    eye, d = np.array(scene.camera.position), np.array(tuple(ray.direction)) @ np.array(scene.camera.basis())
    chosen = _along(scene, eye, d)
    at = closest_hit(world_of(_only(scene, chosen)), ray)
    if at is None:
        return chosen
    p = eye + at.distance * d / np.linalg.norm(d)
    lights = scene.lamps[scene.lamps["kind"] != AMBIENT]
    ways = [-light["direction"] if light["kind"] == PARALLEL else light["position"] - p for light in lights]
    return np.unique(np.concatenate([chosen, *(_along(scene, p, way) for way in ways)]))


def _along(scene: Scene, origin: Floats, d: Floats) -> NDArray[np.intp]:
    """Indices of the spheres that a line may meet: |f x d|^2 <= |d|^2 r^2, with a margin."""
    f, r = scene.spheres["center"] - origin, scene.spheres["radius"]
    across = (np.cross(f, d / np.linalg.norm(d)) ** 2).sum(axis=1)
    margin = 1e-9 * ((f * f).sum(axis=1) + float(origin @ origin))
    return np.flatnonzero(across <= r * r * (1 + 1e-6) + margin)


def _only(scene: Scene, chosen: NDArray[np.intp]) -> Scene:
    """The scene with these spheres only, and with their materials only."""
    spheres = scene.spheres[chosen]
    used, spheres["material"] = np.unique(spheres["material"], return_inverse=True)
    return replace(scene, spheres=spheres, materials=scene.materials[used])


# ---------------------------------------------------------------------------------------------------- whole pictures


@dataclass(frozen=True)
class Truth:
    """What pictures of a case are held against.

    levels: (h, w, 3), of 255, NaN in rows where it is not known; answer: of all pixels; pixels, exact: some of them,
    and what the reference says of these. There is no answer of pictures of means.
    """

    levels: NDArray[Any]
    answer: Answer | None = None
    pixels: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))
    exact: Answer | None = None

    def errors(self, got: Answer) -> Errors | None:
        """Those of a picture: of each kind the larger one, of all pixels or of the sample."""
        if not self.answer or not self.exact:
            return None
        both = astuple(compare(got, self.answer)), astuple(compare(got.at(self.pixels), self.exact))
        return Errors(*map(max, *both))


def truth_of_frame(scene: Scene, answer: Answer) -> Truth:
    """The truth of a picture, as double precision draws it, and the reference some of its pixels."""
    width, height = scene.camera.resolution
    many = len(scene.spheres) + len(scene.cylinders) > MANY_SURFACES and not can_thin(scene)
    pixels = sample(answer.id.reshape(height, width), CHECKED // 4 if many else CHECKED)
    return Truth(answer.rgb8.reshape(height, width, 3), answer, pixels, exact(scene, pixels))


def truth_of_means(scene: Scene, device: Device, bands: int = BANDS) -> Truth:
    """The means over pixels of RAYS x RAYS rays, each clamped to 0..1, in the first of so many bands of rows."""
    width, height = scene.camera.resolution
    n = RAYS
    while n > 1 and (n * max(width, height) > MAX_SIDE or n * n * width * height > MOST_PIXELS):
        n //= 2
    fine = scene.seen_by(replace(scene.camera, resolution=(n * width, n * height)))
    rows = max(1, BAND // (n * n * width))
    levels = np.full((height, width, 3), np.nan)
    for first in range(0, height, bands * rows):
        end = min(height, first + rows)
        crop = (0, n * first, n * width, n * end)
        color = np.minimum(Renderer(fine, device, outputs=("color",), crop=crop).render(progress=False).color, 1)
        levels[first:end] = 255 * color.reshape(end - first, n, width, n, 3).mean(axis=(1, 3), dtype=np.float64)
    return Truth(levels)
