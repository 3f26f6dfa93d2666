"""Smooth pictures by samples: exactly the rays of a lattice, in the same bits, and nothing small is missed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from clipped_scenes import scene_of as clipped
from hostile import cylinder_regimes
from numpy.typing import NDArray
from smooth_scenes import HOSTILE, OTHERS, OUTPUTS, SCENES
from stress_cases import box_means

import cltrace
from cltrace.plan.request import LATTICES
from cltrace.run.devices import Device

ONE = 2**20
# Only rays tell of meshes before themselves, shadows and ends of light that lie between the corners of a pixel.
UNTOLD = {"triangles", "triangles, parallel", "shadow rims", "cones"}
# Scenes of few surfaces have nothing that the others do not have.
SIMPLE = {"captive-light", "eclipse", "head-on", "minimal", "pyramid", "spot-colours", "step1-ambient"}
SIMPLE |= {"step2-parallel", "tall", "transforms", "wide"}


def larger(scene: cltrace.Scene, n: int) -> cltrace.Scene:
    width, height = scene.camera.resolution
    return scene.seen_by(replace(scene.camera, resolution=(width * n, height * n)))


def full(scene: cltrace.Scene, device: Device, **how: Any) -> cltrace.Image:
    """By a kernel that has the code for all features, which serves many scenes."""
    return cltrace.Renderer(scene, device, keep=("features",), **how).render()


def rays(scene: cltrace.Scene, device: Device, n: int, keep: tuple[str, ...]) -> tuple[NDArray[Any], NDArray[Any]]:
    """(h, w, n, 3) parts of colours, and (h, w, n) numbers of surfaces: what rays through each pixel's lattice find.

    The places of the lattice are the middles of pixels of a larger picture.
    """
    width, height = scene.camera.resolution
    image = cltrace.Renderer(larger(scene, n), device, outputs=("rgb8", "color", "id"), keep=keep).render()
    i = np.arange(n)
    y = np.arange(height)[:, None, None] * n + LATTICES[n] * i % n
    x = np.arange(width)[None, :, None] * n + i
    parts = (np.minimum(image.color, np.float32(1)) * np.float32(ONE) + np.float32(0.5)).astype(np.int32)
    return parts[y, x], image.id[y, x]


def assert_sampled(
    scene: cltrace.Scene, device: Device, n: int, least: float = 12, keep: tuple[str, ...] = ("branches",)
) -> None:
    """Where rays of the lattice meet different surfaces, the colour is their mean to the bit.

    Elsewhere it is their mean, or that of the corners. least: more levels than these two differ by.
    """
    image = cltrace.Renderer(scene, device, outputs=OUTPUTS, antialias=True, samples=n, keep=keep).render()
    color, number = rays(scene, device, n, keep)
    edge = (number != number[..., :1]).any(axis=2)
    mean = color.sum(axis=2).astype(np.float32) * np.float32(1 / (n * ONE))
    covered = (number >= 0).mean(axis=2, dtype=np.float32)
    if n >= 32:
        # Some come first, which are a lattice themselves.
        step = min(4, n // 16)
        first = color[:, :, step // 2 :: step]
        few = (np.ptp(first, axis=2) <= 64 * ONE // 255).all(axis=2)
        assert few[edge].any()
        assert not few[edge].all()
        mean[few] = (first.sum(axis=2).astype(np.float32) * np.float32(step / (n * ONE)))[few]
        covered[few] = (number[:, :, step // 2 :: step] >= 0).mean(axis=2, dtype=np.float32)[few]
    assert edge.any()
    np.testing.assert_array_equal(image.color[edge], mean[edge])
    np.testing.assert_array_equal(image.coverage[edge], covered[edge])
    assert 255 * np.abs(image.color - mean).max() < least
    assert np.abs(image.rgb8 / 255 - image.color).max() <= 0.5001 / 255


@pytest.mark.parametrize("name", ["crossing", "large and small", "behind edges"])
def test_samples_are_exact_rays(any_device: Device, name: str) -> None:
    assert_sampled(HOSTILE[name](), any_device, 16)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*HOSTILE, *OTHERS}))
def test_samples_of_hostile_scenes_are_exact_rays(any_device: Device, name: str) -> None:
    """By programs with the code for all features: 14 and as many for the rays, instead of 28."""
    least = 255 if name in UNTOLD else 12
    assert_sampled((HOSTILE | OTHERS)[name](), any_device, 16, least, ("branches", "features"))


def test_all_lattices(any_device: Device) -> None:
    for n in (4, 32, 64):
        assert_sampled(HOSTILE["crossing"](), any_device, n)


def test_lattices_are_even() -> None:
    """Each row and each column has one place, and steps along a lattice do not stay near a line."""
    for n, a in LATTICES.items():
        assert sorted(a * i % n for i in range(n)) == list(range(n)) or n == 1
        assert n < 16 or min(np.hypot(i, min(a * i % n, -a * i % n)) for i in range(1, n)) > 0.7 * np.sqrt(n)


def test_bits_depend_on_nothing_else(any_device: Device) -> None:
    scene = HOSTILE["crossing"]()
    whole = cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=True)
    for crop in ((3, 2, 17, 11), (0, 5, 7, 6)):
        part = cltrace.render(scene, any_device, outputs=OUTPUTS, crop=crop, antialias=True)
        x0, y0, x1, y1 = crop
        for name in OUTPUTS:
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[y0:y1, x0:x1])
    columns = scene.columns
    turned = cltrace.Scene.from_spheres(
        scene.camera,
        [cltrace.ambient_light((0.5, 0.5, 0.5)), cltrace.parallel_light((1, -2, -1.5), (0.9, 0.8, 0.7))],
        columns.center[::-1],
        columns.radius[::-1],
        background=(0.1, 0.1, 0.3),
        colors=(0.8, 0.6, 0.4),
        ks=0.3,
    )
    other = cltrace.render(turned, any_device, outputs=OUTPUTS, antialias=True)
    for name in OUTPUTS:
        np.testing.assert_array_equal(getattr(other, name), getattr(whole, name))


def test_what_is_beside_a_crop_counts_in_it(any_device: Device) -> None:
    """What lists name beside a pixel decides how many rays it has, also at a crop's border; of bonds, lists alone."""
    rng = np.random.default_rng(0)
    centers, radii = rng.uniform(-2, 2, (120, 3)), rng.uniform(0.1, 0.4, 120)
    camera = cltrace.Camera((0, 0, 8), (0, 0, 0), horizontal_fov=18, resolution=(48, 36))
    lights = [cltrace.ambient_light(), cltrace.point_light((5, 8, 9))]
    scene = cltrace.Scene.from_spheres(
        camera, lights, centers, radii, "gold", bonds=np.arange(40).reshape(20, 2), bond_radius=0.03, background="white"
    )
    whole = cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=True)
    for _ in range(12):
        (x0, x1), (y0, y1) = (np.sort(rng.choice(n + 1, 2, replace=False)) for n in (48, 36))
        part = cltrace.render(scene, any_device, outputs=OUTPUTS, crop=(x0, y0, x1, y1), antialias=True)
        for name in OUTPUTS:
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[y0:y1, x0:x1])


@pytest.mark.slow
def test_bits_do_not_depend_on_width(any_device: Device) -> None:
    scene = HOSTILE["crossing"]()
    whole, *others = (
        cltrace.Renderer(scene, any_device, outputs=OUTPUTS, width=width, antialias=True).render()
        for width in (None, 1, 4, 8)
    )
    for other in others:
        for name in OUTPUTS:
            np.testing.assert_array_equal(getattr(other, name), getattr(whole, name))


@pytest.mark.slow
def test_error_is_mostly_enough(any_device: Device) -> None:
    """95 of 100 pixels are within it, and it is not much too large.

    32 rays are nearer to the truth than what their spread says by more than 16 rays are.
    """
    for name in ("crossing", "large and small", "large texels", "tiny texels"):
        scene = (HOSTILE | OTHERS)[name]()
        right = box_means(scene, 32, any_device)
        for n, most in ((16, 5), (32, 7)):
            image = cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=True, samples=n)
            off = 255 * np.abs(image.color - right).max(axis=2)
            assert (off <= image.error + 0.01).mean() >= 0.95
            assert image.error[off > 0.5].mean() < most * off[off > 0.5].mean()


def edges(scene: cltrace.Scene, device: Device, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """The crop of this size in which most neighbours differ by more than 8 levels."""
    color = 255 * np.minimum(full(scene, device, outputs=("rgb8", "color", "id")).color, 1)
    steps = np.zeros(color.shape[:2], int)
    for axis in (0, 1):
        few = np.abs(np.diff(color, axis=axis)).max(axis=2) > 8
        steps[tuple(slice(0, length) for length in few.shape)] |= few
    sums = np.pad(steps, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    (w, h), (height, width) = size, color.shape[:2]
    most = (
        sums[h:, w:] - sums[: height + 1 - h, w:] - sums[h:, : width + 1 - w] + sums[: height + 1 - h, : width + 1 - w]
    )
    y, x = np.unravel_index(most.argmax(), most.shape)
    return int(x), int(y), int(x) + w, int(y) + h


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({path.stem for path in SCENES.glob("*.xml")} - SIMPLE))
def test_error_is_mostly_enough_where_edges_are(device: Device, name: str) -> None:
    """95 of 100 pixels are within it where it is hardest: where most edges are, at a third of the scenes' own sizes."""
    scene = cltrace.load(SCENES / f"{name}.xml")
    width, height = scene.camera.resolution
    scene = scene.seen_by(replace(scene.camera, resolution=(width // 3, height // 3)))
    crop = edges(scene, device, (48, 27))
    image = full(scene, device, outputs=OUTPUTS, antialias=True, crop=crop)
    x0, y0, x1, y1 = (32 * edge for edge in crop)
    color = full(larger(scene, 32), device, outputs=("rgb8", "color", "id"), crop=(x0, y0, x1, y1)).color
    right = np.minimum(color, 1).reshape(27, 32, 48, 32, 3).mean(axis=(1, 3), dtype=np.float64)
    off = 255 * np.abs(image.color - right).max(axis=2)
    assert (off <= image.error + 0.01).mean() >= 0.95


@pytest.mark.parametrize(("share", "texels"), [(0.02, 2), (0.02, 9), (0.08, 9)])
def test_rare_details_of_textures(any_device: Device, share: float, texels: int) -> None:
    """Of a black page with white texels, so many of which are in a pixel along each side, none is lost unknown."""
    n = 64 * texels
    page = np.where(np.random.default_rng(0).random((n, n, 1)) < share, np.uint8(255), np.uint8(0)).repeat(3, 2)
    white = cltrace.Material((1, 1, 1), ka=1, kd=0, ks=0, texture=page)
    corners = [(-1, -1, -3), (1, -1, -3), (1, 1, -3), (-1, 1, -3)]
    paper = cltrace.Mesh(corners, [(0, 1, 2), (0, 2, 3)], uv=[(0, 0), (1, 0), (1, 1), (0, 1)], material=white)
    camera = cltrace.Camera(horizontal_fov=36, resolution=(64, 48))
    scene = cltrace.Scene.from_meshes(camera, [cltrace.ambient_light((1, 1, 1))], [paper])
    image = cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=True)
    right = box_means(scene, 32, any_device)
    off = 255 * np.abs(image.color - right).max(axis=2)
    assert (off <= image.error + 0.01).mean() >= 0.99
    assert abs(image.color.mean() / right.mean() - 1) <= 0.05  # as much white as there is


@pytest.mark.slow
@pytest.mark.parametrize("parallel", [False, True], ids=["perspective", "parallel"])
def test_no_pixel_of_thin_shapes_is_far_off(any_device: Device, parallel: bool) -> None:
    """Black prisms and fans before white, from 10 to 10,000 sizes away.

    A straight edge leaves a mean over 16 rays with an error of 3.85 % of the contrast, root mean square: no pixel has
    more than three times that of two edges.
    """
    for seed in range(4):
        random = np.random.default_rng(seed)
        turn = np.sort(random.uniform(0, 2 * np.pi, 24))
        rim = np.column_stack([np.cos(turn), np.sin(turn), random.uniform(-0.2, 0.2, 24)])
        i, j = np.arange(24), (np.arange(24) + 1) % 24
        tube = rim * (0.4, 0.4, 0) - (0, 0, 1), rim * (0.4, 0.4, 0) + (0, 0, 1)
        shapes = [
            (np.vstack([rim, [(0, 0, 0.3)]]), np.column_stack([i, j, np.full(24, 24)])),
            (np.vstack(tube), np.vstack([np.column_stack([i, j, i + 24]), np.column_stack([j, j + 24, i + 24])])),
        ]
        out = random.normal(size=3)
        eye = out / np.linalg.norm(out) * 10.0 ** (1 + seed)  # a size is 2 at most
        camera: cltrace.scene.AnyCamera = cltrace.Orthographic(eye, (0, 0, 0), height=2.5, resolution=(36, 36))
        if not parallel:
            angle = float(np.degrees(np.arctan(1.25 / np.linalg.norm(eye))))
            camera = cltrace.Camera(eye, (0, 0, 0), horizontal_fov=angle, resolution=(36, 36))
        for vertices, faces in shapes:
            mesh = cltrace.Mesh(vertices, faces, material=cltrace.Material((0, 0, 0), ka=1, kd=0, ks=0))
            scene = cltrace.Scene.from_meshes(camera, [cltrace.ambient_light()], [mesh], background="white")
            image = cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=True, samples=16)
            assert np.abs(image.color - box_means(scene, 32, any_device)).max() <= 3 * 0.0385 * np.sqrt(2), seed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cylinders", "clipped"])
def test_other_shapes_are_the_means_of_finer_pixels(any_device: Device, name: str) -> None:
    scene = cylinder_regimes.lit_of("joints", 0, (48, 36)) if name == "cylinders" else clipped("some", 0)
    scene = scene.seen_by(replace(scene.camera, resolution=(48, 36)))
    image = cltrace.render(scene, any_device, outputs=("rgb8",), antialias=True)
    off = np.abs(image.rgb8 - 255 * box_means(scene, 16, any_device))
    assert off.mean() < 0.3
    assert off.max() < 24  # 255 times what 95 of 100 means over 32 rays are off by, where colours differ by 1


def test_alpha_and_srgb(any_device: Device) -> None:
    scene = HOSTILE["crossing"]()
    mean = cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=True)
    clear = cltrace.render(
        scene.in_front_of((0.1, 0.1, 0.3, 0)), any_device, outputs=(*OUTPUTS, "alpha"), antialias=True
    )
    np.testing.assert_array_equal(clear.alpha, mean.coverage)
    curved = cltrace.render(replace(scene, transfer="srgb"), any_device, outputs=OUTPUTS, antialias=True)
    np.testing.assert_array_equal(curved.color, mean.color)
    bright = np.where(mean.color > 0.0031308, 1.055 * mean.color ** (1 / 2.4) - 0.055, 12.92 * mean.color)
    assert np.abs(curved.rgb8 / 255 - bright).max() <= 0.501 / 255


def test_what_is_not_allowed(any_device: Device) -> None:
    scene = HOSTILE["crossing"]()
    for antialias, samples, message in (
        (True, 8, "samples: must be one of 1, 4, 16"),
        (True, True, "samples: must be one of 1, 4, 16"),
        (False, 16, "samples: goes with antialias=True"),
        ("proved", None, "antialias: must be True or False, got 'proved'"),
        (0.5, 16, "antialias: must be True or False, got 0.5"),
    ):
        with pytest.raises(ValueError, match=message):
            cltrace.render(scene, any_device, antialias=antialias, samples=samples)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="outputs: error is of antialiasing, which is off"):
        cltrace.render(scene, any_device, outputs=("error",))


def test_bright_background(any_device: Device) -> None:
    """A background counts up to 1, whether or not a surface is near."""
    scene = HOSTILE["behind edges"]().in_front_of((1.5, 0.5, 1, 1))
    color = cltrace.render(scene, any_device, outputs=("color",), antialias=True).color
    assert color.max() == 1
    assert color[0, 0].tolist() == [1, 0.5, 1]


def test_middles_stay(any_device: Device) -> None:
    """What is no colour is that of the ray through the middle, as without antialiasing."""
    scene = HOSTILE["behind edges"]()
    names: tuple[Any, ...] = ("normal", "depth", "id")
    plain = cltrace.render(scene, any_device, outputs=names)
    image = cltrace.render(scene, any_device, outputs=("rgb8", *names), antialias=True)
    for name in names:
        np.testing.assert_array_equal(getattr(image, name), getattr(plain, name))
    assert (image.rgb8 != cltrace.render(scene, any_device).rgb8).any()
