"""Pictures held against oracle and reference, with assertions. The scenes are those of hostile.catalogue."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

import mpmath
import numpy as np
from exact_rays import angle, lit, normal_of, root_of
from hostile.catalogue import Case
from hostile.sphere_scenes import Floats, directions
from numpy.typing import NDArray

from cltrace import Image, Renderer, Scene
from cltrace.bench.truth import white
from cltrace.exact.shapes import ExactSphere
from cltrace.oracle import closest
from cltrace.reference import byte_of, world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, PARALLEL, POINT, SPOT, AnyCamera
from cltrace.students.check import sample

OUTPUTS = ("rgb8", "color", "normal", "direction", "depth", "id", "shadow_rays")


def renderer(
    scene: Scene,
    device: Device | None = None,
    precision: str = "accurate",
    width: int | None = None,
    keep: tuple[str, ...] = (),
    crop: tuple[int, int, int, int] | None = None,
) -> Renderer:
    """A renderer of all outputs, by the kernel with all features: one program serves all tests of a precision and a
    width. To compile one takes longer than most tests; test_scenes.py says that no picture depends on it.
    """
    return Renderer(scene, device, precision, OUTPUTS, crop, width=width, keep=("features", *keep))


def picture(
    scene: Scene,
    device: Device | None = None,
    precision: str = "accurate",
    width: int | None = None,
    keep: tuple[str, ...] = (),
    crop: tuple[int, int, int, int] | None = None,
) -> Image:
    """What such a renderer draws."""
    return renderer(scene, device, precision, width, keep, crop).render()


def channel(image: Image, name: str) -> np.ndarray:
    """An output, one row per pixel."""
    value = getattr(image, name)
    return value.reshape(-1, 3) if value.ndim == 3 else value.ravel()


def remembered(function: Callable[..., Any]) -> Callable[..., Any]:
    """Caches by what a scene holds, not by which object it is: every device's test makes the scene anew.

    Of the other arguments only whole numbers count; an image only says where to look.
    """
    kept: dict[tuple[object, ...], Any] = {}

    @functools.wraps(function)
    def answer(scene: Scene, *arguments: object) -> Any:
        arrays = (a.tobytes() for a in (scene.spheres, scene.materials, scene.lights, scene.to_object))
        key = (scene.camera, scene.background, *arrays, *(a for a in arguments if isinstance(a, int)))
        if key not in kept:
            if len(kept) >= 256:
                del kept[next(iter(kept))]
            kept[key] = function(scene, *arguments)
        return kept[key]

    return answer


def looks_along_an_axis(camera: AnyCamera) -> bool:
    """Whether turning the world into camera space rounds nothing."""
    return set(np.abs(np.ravel(camera.basis()))) == {0.0, 1.0}


@dataclass(frozen=True)
class Hits:
    """What n pixels show.

    d: (n, 3), directions of their rays in the world; index: (n,) int32, of the sphere, -1 = none; depth: (n,) long
    double, distance from the eye in scene units, inf = none; outside: (n,), whether the eye is outside of that sphere.
    """

    d: Floats
    index: NDArray[np.int32]
    depth: NDArray[np.longdouble]
    outside: NDArray[np.bool_]


@remembered
def hits(scene: Scene) -> Hits:
    """What the oracle says of every pixel. The camera must look along an axis."""
    d = directions(scene.camera)
    eye, spheres = scene.camera.position, scene.spheres
    index, t = closest(eye, d, spheres["center"], spheres["radius"])
    # The distance is rounded once more than t.
    depth = t * np.sqrt((d.astype(np.longdouble) ** 2).sum(axis=1))
    outside = np.ones(len(d), bool)
    for i in np.unique(index[index >= 0]):
        outside[index == i] = _outside(scene, int(i))
    return Hits(d, index, depth, outside)


def _outside(scene: Scene, i: int) -> bool:
    center, radius = scene.spheres["center"][i].tolist(), Fraction(float(scene.spheres["radius"][i]))
    return sum((Fraction(c) - Fraction(e)) ** 2 for c, e in zip(center, scene.camera.position, strict=True)) > radius**2


def facing_normal(scene: Scene, seen: Hits, row: int) -> tuple[Fraction, ...]:
    """The normal at the hit of that row of `seen`, facing the eye, to 50 digits."""
    sphere = scene.spheres[seen.index[row]]
    n = normal_of(scene.camera.position, seen.d[row], sphere["center"], float(sphere["radius"]))
    return n if seen.outside[row] else tuple(-x for x in n)


def reached(scene: Scene, seen: Hits, rows: NDArray[np.intp]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(rows, lights) each, for all lights that are not ambient: lit and facing of the hits of these rows, as
    exact_rays.lit() says.

    A spot light is taken for a point light: its cone is not looked at.
    """
    spheres, out = scene.spheres, np.zeros((2, len(rows), int((scene.lamps["kind"] != AMBIENT).sum())), bool)
    for k, light in enumerate(scene.lamps[scene.lamps["kind"] != AMBIENT]):
        kind: Literal["point", "parallel"] = "parallel" if light["kind"] == PARALLEL else "point"
        where, hits = light["direction" if kind == "parallel" else "position"], (seen.d[rows], seen.index[rows])
        out[:, :, k] = lit(scene.camera.position, *hits, spheres["center"], spheres["radius"], where, kind)
    return out[0], out[1]


def pairs_on_a_plane(rng: np.random.Generator, x: float, huge: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres (10, 3) and radii (10) of spheres that rest on the plane at x, from tiny to huge: pairs, an ulp apart."""
    centers, radii = [], []
    for r in (huge / 2, 1.5 * x, 1.1, 1e20, 1e-20):
        z = -float(rng.choice([huge / 2, 1.0, 2.0**60, x]))
        for k in (0, 1):
            centers.append((r * rng.choice([-1, 1]), 0 if k else x, z))
            radii.append(r)
    return np.array(centers), np.array(radii)


@remembered
def normals_of(scene: Scene, count: int) -> dict[int, tuple[Fraction, ...]]:
    """The exact normals of some pixels that hit: limbs first, where a normal loses its digits."""
    seen, (width, height) = hits(scene), scene.camera.resolution
    pixels = [i for i in sample(seen.index.reshape(height, width), 2 * count) if seen.index[i] >= 0][:count]
    return {int(i): facing_normal(scene, seen, i) for i in pixels}


def check(scene: Scene, device: Device, precision: str = "accurate", normals: int = 0) -> Image:
    """Every id is exact, no t is off by more than 0.52 ulp of float32 and 1e-8, no sampled normal by 1e-7 rad."""
    image, want = picture(scene, device, precision), hits(scene)
    ids, depth, normal = channel(image, "id"), channel(image, "depth"), channel(image, "normal")
    wrong = np.flatnonzero(ids != want.index)
    assert len(wrong) == 0, f"{len(wrong)} wrong ids"
    assert np.isfinite(image.color).all()
    hit = want.index >= 0
    got, exact = depth[hit].astype(np.longdouble), want.depth[hit]
    assert (depth[~hit] == np.inf).all()
    assert (normal[~hit] == 0).all()
    relative = float(np.abs(got / exact - 1).max(initial=0))
    assert relative <= 1e-8, f"t is off by {relative:.3g}"
    ulps = np.abs(depth[hit].astype(np.float32).astype(np.longdouble) - exact) / np.spacing(exact.astype(np.float32))
    most_ulps = float(ulps.max(initial=0))
    assert most_ulps <= 0.52, f"t is off by {most_ulps:.3f} ulp"
    off = max((angle(normal[i], n) for i, n in normals_of(scene, normals).items()), default=0) if normals else 0
    assert off <= 1e-7, f"a normal is off by {off:.3g} rad"
    return image


@remembered
def lighting(scene: Scene, image: Image, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Some pixels that hit, edges of spheres and shadows first, and (lit, facing) of each for each light."""
    seen = hits(scene)
    parts = image.id * 8 + (image.color > 0) @ [1, 2, 4]
    pixels = np.array([i for i in sample(parts, 2 * count) if seen.index[i] >= 0][:count], int)
    return pixels, np.stack(reached(scene, seen, pixels), axis=2)


def cosine(scene: Scene, pixel: int, number: int) -> float:
    """n.l of a pixel's hit and a light, to all digits."""
    seen, light = hits(scene), scene.lights[number]
    sphere = scene.spheres[seen.index[pixel]]
    l = [-Fraction(float(x)) for x in light["direction"]]  # noqa: E741
    if light["kind"] == POINT:
        ball = ExactSphere(sphere["center"].tolist(), float(sphere["radius"]))
        t = root_of(scene.camera.position, seen.d[pixel], ball).value()
        p = [Fraction(o) + t * Fraction(x) for o, x in zip(scene.camera.position, seen.d[pixel], strict=True)]
        l = [Fraction(float(x)) - y for x, y in zip(light["position"], p, strict=True)]  # noqa: E741
    with mpmath.workdps(50):
        n, l = ([mpmath.mpf(x.numerator) / x.denominator for x in v]  # noqa: E741
                for v in (facing_normal(scene, seen, pixel), l))  # fmt: skip
        return float(mpmath.fdot(n, l) / mpmath.sqrt(mpmath.fdot(l, l)))


def check_shadows(scene: Scene, device: Device, precision: str = "accurate", count: int = 100) -> Image:
    """check(), no leak, no false shadow, and a shadow ray exactly where the surface faces a light.

    A lit pixel may be black only if n.l is below what float32 resolves in a unit vector.
    """
    image = check(scene, device, precision)
    pixels, want = lighting(scene, image, count)
    assert len(pixels)
    color = channel(image, "color")[pixels]
    for j, light in enumerate(scene.lights):
        seen = color[:, np.argmax(light["color"])] > 0
        leaks, shadows = seen & ~want[:, j, 0], ~seen & want[:, j, 0]
        assert not leaks.any(), f"{leaks.sum()} leaks"
        certain = [i for i in pixels[shadows] if cosine(scene, i, j) > 2.0**-22]
        assert not certain, f"{len(certain)} false shadows"
    other = channel(image, "shadow_rays")[pixels] != want[:, :, 1].sum(axis=1)
    assert not other.any(), f"pixels {pixels[other]} of {scene} face other lights"
    return image


@remembered
def colors_of(scene: Scene, image: Image, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Some pixels, edges of spheres first, and the reference's colours of them."""
    width = scene.camera.resolution[0]
    pixels, world = sample(image.id, min(count, image.id.size)), world_of(scene)
    return pixels, np.array(
        [trace(world, primary_ray(scene.camera, int(i) % width, int(i) // width))[0] for i in pixels]
    )


def check_colors(scene: Scene, image: Image, count: int = 100) -> float:
    """No sampled byte is off by more than one level from the reference; returns the largest error of a colour."""
    pixels, want = colors_of(scene, image, count)
    levels = np.array([[byte_of(c) for c in color] for color in want])
    assert np.isfinite(image.color).all()
    apart = np.abs(channel(image, "rgb8")[pixels].astype(int) - levels).max()
    assert apart <= 1, f"{apart} levels"
    return float(np.abs(channel(image, "color")[pixels] - want).max())


def check_case(case: Case, device: Device, precision: str, amount: int) -> None:
    """All that the catalogue requires of a case. What is seen aslant has no oracle: its colours say what is right."""
    first = None
    for scene in case.scenes(amount):
        image = picture(scene, device, precision)
        assert (image.color >= 0).all()
        if "hits" in case.checks and looks_along_an_axis(scene.camera):
            check(scene, device, precision, 6 * amount)
            # L6's lights are nearer to a point than the point is known.
            shadows = "shadows" in case.checks and len(scene.lights) > 0 and (image.id >= 0).any() and case.name != "L6"
            # The oracle takes a spot light for a point light.
            bare = replace(scene, lights=scene.lights[scene.lights["kind"] != SPOT])
            for first in range(0, max(1, int((bare.lights["kind"] != AMBIENT).sum())), 3) if shadows else ():
                check_shadows(white(bare, first), device, precision, 40 * amount)
        if "colors" in case.checks:
            check_colors(scene, image, 12 + 4 * amount)
        if "same" in case.checks:
            first = first or image
            assert np.array_equal(image.rgb8, first.rgb8)
