"""Pictures held against the oracle and the reference. The scenes are those of hostile.catalogue and of the regimes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal, NamedTuple

import mpmath
import numpy as np
from exact_rays import angle, lit, normal_of, root_of
from hostile.catalogue import Case
from hostile.sphere_regimes import rays as camera_rays
from hostile.sphere_scenes import Floats, directions
from numpy.typing import NDArray
from surface_rays import from_eye

from cltrace import Image, Renderer, Scene
from cltrace.bench.truth import white
from cltrace.exact.shapes import ExactSphere
from cltrace.oracle.scenes import kinds_of
from cltrace.reference import byte_of, world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, PARALLEL, POINT, SPOT, AnyCamera
from cltrace.students.check import sample

OUTPUTS = ("rgb8", "color", "normal", "direction", "depth", "id", "shadow_rays")
MORE = (*OUTPUTS, "primitive", "uv")


def renderer(
    scene: Scene,
    device: Device | None = None,
    precision: str = "accurate",
    width: int | None = None,
    keep: tuple[str, ...] = (),
    crop: tuple[int, int, int, int] | None = None,
) -> Renderer:
    """A renderer of all outputs, by the kernel with all features: one program serves all tests of spheres, of a
    precision and a width, and others serve those of other shapes, which have more outputs. To compile one takes longer
    than most tests; test_scenes.py says that no picture depends on it.
    """
    only_spheres = not (scene.meshes or len(scene.cylinders) or len(scene.planes) or scene.camera.parallel)
    outputs = OUTPUTS if only_spheres else MORE
    return Renderer(scene, device, precision, outputs, crop, width=width, keep=("features", *keep))


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
    return value.reshape(-1, *value.shape[2:])


def assert_same(one: Image, two: Image, outputs: Iterable[str], what: object) -> None:
    for name in outputs:
        assert np.array_equal(getattr(one, name), getattr(two, name)), (name, what)


def remembered(function: Callable[..., Any]) -> Callable[..., Any]:
    """Caches by what a scene holds, not by which object it is: every device's test makes the scene anew.

    Of the other arguments only whole numbers count; an image only says where to look.
    """
    kept: dict[tuple[object, ...], Any] = {}

    @functools.wraps(function)
    def answer(scene: Scene, *arguments: object) -> Any:
        parts = (scene.spheres, scene.cylinders, scene.planes, scene.materials, scene.lights, scene.to_object)
        of = [(m.vertices, m.geometry.faces, m.geometry.normals, m.geometry.uv, [m.number]) for m in scene.meshes]
        parts += (*scene.textures, *(part for mesh in of for part in mesh))
        arrays = (np.ascontiguousarray(part).tobytes() for part in parts)
        key = (scene.camera, scene.background, *arrays, *(a for a in arguments if isinstance(a, int)))
        if key not in kept:
            if len(kept) >= 256:
                del kept[next(iter(kept))]
            kept[key] = function(scene, *arguments)
        return kept[key]

    return answer


def box_means(scene: Scene, n: int, device: Device | None = None, **how: Any) -> NDArray[np.float64]:
    """(h, w, 3): means of min(colour, 1) over n x n rays through each pixel."""
    width, height = scene.camera.resolution
    finer = scene.seen_by(replace(scene.camera, resolution=(width * n, height * n)))
    color = np.minimum(Renderer(finer, device, outputs=("rgb8", "color", "id"), **how).render().color, 1)
    return np.asarray(color.reshape(-1, n, color.shape[1] // n, n, 3).mean(axis=(1, 3), dtype=np.float64))


def looks_along_an_axis(camera: AnyCamera) -> bool:
    """Whether turning the world into camera space rounds nothing."""
    return set(np.abs(np.ravel(camera.basis()))) == {0.0, 1.0}


@dataclass(frozen=True)
class Hits:
    """What n pixels show.

    d: (n, 3), directions of their rays in camera space; index, primitive: (n,), numbers of the surface and of the
    triangle in its mesh, -1 = none; depth: (n,) long double, distance from the eye in scene units, inf = none.
    """

    d: Floats
    index: NDArray[np.int64]
    primitive: NDArray[np.int64]
    depth: NDArray[np.longdouble]


@remembered
def hits(scene: Scene) -> Hits:
    """What the oracle says of every pixel."""
    kinds, d = kinds_of(scene), camera_rays(scene.camera)
    rays = from_eye(scene, d)
    found = kinds.closest(rays)
    index, primitive = (np.append(numbers, -1)[found.item] for numbers in (kinds.surface, kinds.primitive))
    # The distance is rounded once more than t.
    length = np.sqrt((d.astype(np.longdouble) ** 2).sum(axis=1))
    return Hits(d, index, primitive, kinds.rounded(rays, found) * (1 if scene.camera.parallel else length))


def wrong_hits(scene: Scene, image: Image) -> list[int]:
    """The pixels that show another surface or triangle than the oracle says, or a distance that is off by more than
    1e-8 of itself or by 0.52 ulp of float32."""
    want, depth = hits(scene), channel(image, "depth").astype(np.longdouble)
    wrong, hit = channel(image, "id") != want.index, want.index >= 0
    if "primitive" in image.outputs:
        wrong |= channel(image, "primitive") != want.primitive
    wrong |= np.isfinite(depth) != hit
    single = want.depth[hit].astype(np.float32)
    ulps = np.abs(depth[hit].astype(np.float32).astype(np.longdouble) - want.depth[hit]) / np.spacing(single)
    wrong[hit] |= (np.abs(depth[hit] / want.depth[hit] - 1) > 1e-8) | (ulps > 0.52)
    return np.flatnonzero(wrong).tolist()


class Said(NamedTuple):
    """What the reference says of some pixels of a picture."""

    pixels: NDArray[np.intp]
    color: Floats
    id: NDArray[np.int64]
    primitive: NDArray[np.int64]
    depth: Floats
    normal: Floats  # in the world, 0 where nothing is met


@remembered
def said(scene: Scene, image: Image, count: int) -> Said:
    """Of some pixels, those at the edges of surfaces first."""
    width, world = scene.camera.resolution[0], world_of(scene)
    pixels = sample(image.id, min(count, image.id.size))
    traced = [trace(world, primary_ray(scene.camera, int(i) % width, int(i) // width)) for i in pixels]
    none = (-1, -1, np.inf, 0, 0, 0)
    rows = [(*color, *((at.index, at.primitive, at.distance, *at.normal) if at else none)) for color, at in traced]
    columns = np.array(rows, float).reshape(-1, 9)
    numbers = columns[:, 3:5].astype(int).T
    return Said(pixels, columns[:, :3], *numbers, columns[:, 5], columns[:, 6:] @ np.array(scene.camera.basis()))


def wrong_pixels(scene: Scene, image: Image, count: int = 10_000, off: float = 1e-4) -> list[int]:
    """Of some pixels, those at the edges of surfaces first: which show another surface, triangle, distance or normal
    than the reference says, a colour that is off by more than `off`, or a byte that is off by more than one level."""
    want = said(scene, image, count)
    got = {name: channel(image, name)[want.pixels] for name in image.outputs}
    wrong = got["id"] != want.id
    wrong |= got.get("primitive", want.primitive) != want.primitive
    # Of spheres and ellipsoids, both compute t by the same operations in double: the very same bits.
    others = scene.meshes or len(scene.cylinders) or len(scene.planes)
    wrong |= ~np.isclose(got["depth"], want.depth, rtol=1e-9 if others else 0, atol=0)
    wrong |= np.abs(got["normal"] - want.normal).max(axis=1) > 1e-6
    wrong |= ~(np.abs(got["color"] - want.color).max(axis=1) <= off)
    levels = np.array([[byte_of(c) for c in color] for color in want.color])
    wrong |= np.abs(got["rgb8"].astype(int) - levels).max(axis=1) > 1
    return want.pixels[wrong].tolist()


def facing_normal(scene: Scene, pixel: int) -> tuple[Fraction, ...]:
    """The normal of what a pixel shows, which is a sphere, facing the eye, to 50 digits. The camera must look along an
    axis."""
    sphere, d = scene.spheres[hits(scene).index[pixel]], directions(scene.camera)[pixel]
    n = normal_of(scene.camera.position, d, sphere["center"], float(sphere["radius"]))
    away = sum(x * Fraction(float(y)) for x, y in zip(n, d, strict=True)) > 0
    return tuple(-x for x in n) if away else n


def reached(scene: Scene, seen: Hits, rows: NDArray[np.intp]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(rows, lights) each, for all lights that are not ambient: lit and facing of the hits of these rows, as
    exact_rays.lit() says.

    A spot light is taken for a point light: its cone is not looked at.
    """
    d, spheres, lamps = directions(scene.camera), scene.spheres, scene.lamps[scene.lamps["kind"] != AMBIENT]
    out = np.zeros((2, len(rows), len(lamps)), bool)
    for k, light in enumerate(lamps):
        kind: Literal["point", "parallel"] = "parallel" if light["kind"] == PARALLEL else "point"
        where, met = light["direction" if kind == "parallel" else "position"], (d[rows], seen.index[rows])
        out[:, :, k] = lit(scene.camera.position, *met, spheres["center"], spheres["radius"], where, kind)
    return out[0], out[1]


@remembered
def normals_of(scene: Scene, count: int) -> dict[int, tuple[Fraction, ...]]:
    """The exact normals of some pixels that hit: limbs first, where a normal loses its digits."""
    index, (width, height) = hits(scene).index, scene.camera.resolution
    pixels = [i for i in sample(index.reshape(height, width), 2 * count) if index[i] >= 0][:count]
    return {int(i): facing_normal(scene, i) for i in pixels}


def check(scene: Scene, device: Device, precision: str = "accurate", normals: int = 0) -> Image:
    """Every id and distance is the oracle's, and no sampled normal is off by 1e-7 rad."""
    image = picture(scene, device, precision)
    assert wrong_hits(scene, image) == []
    normal = channel(image, "normal")
    assert np.isfinite(image.color).all()
    assert (normal[channel(image, "id") < 0] == 0).all()
    for pixel, exact in normals_of(scene, normals).items() if normals else ():
        assert angle(normal[pixel], exact) <= 1e-7, pixel
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
    light, d, sphere = scene.lights[number], directions(scene.camera)[pixel], scene.spheres[hits(scene).index[pixel]]
    l = [-Fraction(float(x)) for x in light["direction"]]  # noqa: E741
    if light["kind"] == POINT:
        ball = ExactSphere(sphere["center"].tolist(), float(sphere["radius"]))
        t = root_of(scene.camera.position, d, ball).value()
        p = [Fraction(o) + t * Fraction(x) for o, x in zip(scene.camera.position, d, strict=True)]
        l = [Fraction(float(x)) - y for x, y in zip(light["position"], p, strict=True)]  # noqa: E741
    with mpmath.workdps(50):
        n, l = ([mpmath.mpf(x.numerator) / x.denominator for x in v]  # noqa: E741
                for v in (facing_normal(scene, pixel), l))  # fmt: skip
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
            for number in range(0, max(1, int((bare.lights["kind"] != AMBIENT).sum())), 3) if shadows else ():
                check_shadows(white(bare, number), device, precision, 40 * amount)
        if "colors" in case.checks:
            assert wrong_pixels(scene, image, 12 + 4 * amount, np.inf) == []
        if "same" in case.checks:
            first = first or image
            assert np.array_equal(image.rgb8, first.rgb8)
