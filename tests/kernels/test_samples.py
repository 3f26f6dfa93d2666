"""Smooth pictures by samples: exactly the rays of a lattice, in the same bits, and nothing small is missed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from smooth_scenes import HOSTILE, OTHERS, OUTPUTS, SCENES

import cltrace
from cltrace.plan.request import LATTICES
from cltrace.run.devices import Device

ONE = 2**20
Part = tuple[NDArray[np.float64], NDArray[np.int64]]
# Only rays tell of meshes before themselves, shadows and ends of light that lie between the corners of a pixel.
UNTOLD = {"triangles", "triangles, parallel", "shadow rims", "cones"}
# Scenes with outlines, shadows, cones, textures, mirrors and glass.
CLAIMED = (
    *("first", "three-lights", "spot", "inside", "step3-shadows", "step4-meshes", "step5-mirror", "step6-textures"),
    *(
        "step7-glass",
        "step8-cone",
        "step9-many",
        "planet",
        "globe",
        "thousand",
        "bounces",
        "room",
        "four-mirrors",
        "dusk",
    ),
)
# One surface fills all of it.
FILLED = {"small texels, parallel"}


def larger(scene: cltrace.Scene, n: int) -> cltrace.Scene:
    width, height = scene.camera.resolution
    return scene.seen_by(replace(scene.camera, resolution=(width * n, height * n)))


def full(scene: cltrace.Scene, device: Device, **how: Any) -> cltrace.Image:
    """By a kernel that has the code for all features, which serves many scenes."""
    return cltrace.Renderer(scene, device, keep=("features",), **how).render()


def truth(scene: cltrace.Scene, device: Device, n: int = 32) -> NDArray[np.float64]:
    """(h, w, 3): means of min(colour, 1) over n x n rays through each pixel."""
    width, height = scene.camera.resolution
    color = np.minimum(cltrace.render(larger(scene, n), device, outputs=("rgb8", "color", "id")).color, 1)
    return np.asarray(color.reshape(height, n, width, n, 3).mean(axis=(1, 3), dtype=np.float64))


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
@pytest.mark.parametrize("name", sorted({*HOSTILE, *OTHERS} - FILLED))
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
        right = truth(scene, any_device)
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
@pytest.mark.parametrize("name", CLAIMED)
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
    right = truth(scene, any_device)
    off = 255 * np.abs(image.color - right).max(axis=2)
    assert (off <= image.error + 0.01).mean() >= 0.99
    assert abs(image.color.mean() / right.mean() - 1) <= 0.05  # as much white as there is


# What a mean over 16 rays of the lattice is off by where a straight edge goes through the pixel, of its contrast, root
# mean square.
SIGMA = 0.0385
# The places of 16 are on lines along (3, -1), which are 0.32 pixels apart, and up to 1.05 long within a pixel: what is
# thinner may lie between two of them.
BETWEEN = 0.333


def rods(random: np.random.Generator, sides: int, thick: float) -> Part:
    """A prism of so many sides without ends, two lengths long."""
    turn = 2 * np.pi * np.arange(sides) / sides + random.uniform(0, 2 * np.pi)
    rim = thick * np.column_stack([np.cos(turn), np.sin(turn)])
    vertices = np.concatenate([np.column_stack([rim, np.full(sides, z)]) for z in (-1.0, 1.0)])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    return vertices, np.concatenate([np.column_stack([i, j, i + sides]), np.column_stack([j, j + sides, i + sides])])


def thin_box(random: np.random.Generator) -> Part:
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    return corners * random.uniform((0.5, 0.2, 0.002), (1, 1, 0.05)), np.array(faces)


def fan(random: np.random.Generator) -> Part:
    """Triangles around one corner, of all widths."""
    n = 24
    turn = np.sort(random.uniform(0, 2 * np.pi, n))
    rim = np.column_stack([np.cos(turn), np.sin(turn), random.uniform(-0.2, 0.2, n)])
    i = np.arange(n)
    return np.concatenate([rim, [(0, 0, 0.3)]]), np.column_stack([i, (i + 1) % n, np.full(n, n)])


def star(random: np.random.Generator) -> Part:
    """A closed mesh with spikes: an octahedron, each face with a tip on it."""
    vertices = [*np.eye(3), *-np.eye(3)]
    faces = []
    for a in (0, 3):
        for b in (1, 4):
            for c in (2, 5):
                tip = sum(vertices[k] for k in (a, b, c)) * random.uniform(0.3, 0.6)
                vertices.append(tip)
                faces += [(a, b, len(vertices) - 1), (b, c, len(vertices) - 1), (c, a, len(vertices) - 1)]
    return 0.7 * np.array(vertices), np.array(faces)


MAKERS: dict[str, Callable[[np.random.Generator], Part]] = {
    "tubes": lambda random: rods(random, 48, 0.3),
    "prisms": lambda random: rods(random, 3 + random.integers(3), 0.4),
    "needles": lambda random: rods(random, 3, 0.02),
    "thin boxes": thin_box,
    "fans": fan,
    "closed": star,
}


def turned(random: np.random.Generator) -> NDArray[np.float64]:
    return np.linalg.qr(random.normal(size=(3, 3)))[0]


def black(part: Part, camera: cltrace.scene.AnyCamera) -> cltrace.Scene:
    """It is black before white, so that colours are one minus what it covers."""
    material = cltrace.Material((0, 0, 0), ka=1, kd=0, ks=0)
    mesh = cltrace.Mesh(*part, material=material)
    return cltrace.Scene.from_meshes(camera, [cltrace.ambient_light()], [mesh], background="white")


@pytest.mark.slow
@pytest.mark.parametrize("parallel", [False, True], ids=["perspective", "parallel"])
@pytest.mark.parametrize("name", MAKERS)
def test_random_shapes(any_device: Device, name: str, parallel: bool) -> None:
    """From 10 to 10,000 sizes away, no pixel is off by more than 3 sigma of the lattice's own error at two edges."""
    most = BETWEEN if name == "needles" else 3 * SIGMA * np.sqrt(2)
    for seed in range(4):
        random = np.random.default_rng(seed)
        vertices, faces = MAKERS[name](random)
        part = vertices @ turned(random), faces
        eye = turned(random)[0] * 10.0 ** (1 + seed)  # a size is 2 at most
        if parallel:
            camera: cltrace.scene.AnyCamera = cltrace.Orthographic(eye, (0, 0, 0), height=2.5, resolution=(36, 36))
        else:
            angle = float(np.degrees(np.arctan(1.25 / np.linalg.norm(eye))))
            camera = cltrace.Camera(eye, (0, 0, 0), horizontal_fov=angle, resolution=(36, 36))
        scene = black(part, camera)
        image = cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=True, samples=16)
        right = truth(scene, any_device)
        assert (right == 0).any() or name in ("needles", "thin boxes")
        assert np.abs(image.color - right).max() <= most, seed


@pytest.mark.slow
@pytest.mark.parametrize("height", [2, 10, 40])
def test_a_black_tube(any_device: Device, height: float) -> None:
    """No pixel is off by more than 3 sigma of the lattice's own error, of two edges where the tube is thin."""
    vertices, faces = rods(np.random.default_rng(0), 32, 0.5)
    camera = cltrace.Orthographic((40, 40, 40), (0, 0, 0), up=(0, 0, 1), height=height, resolution=(60, 60))
    scene = black((vertices * (1, 1, 8), faces), camera)
    image = cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=True, samples=16)
    assert np.abs(image.color - truth(scene, any_device)).max() <= 3 * SIGMA * np.sqrt(2)


def test_look_update_and_movies(any_device: Device) -> None:
    """The bits of a fresh picture."""
    scene = HOSTILE["crossing"]()
    how: dict[str, Any] = {"outputs": OUTPUTS, "antialias": True}
    moved = replace(scene.camera, position=(0.3, 0.2, 0.5))
    fresh = cltrace.render(scene.seen_by(moved), any_device, **how)
    renderer = cltrace.Renderer(scene, any_device, **how)
    renderer.render()
    frames = list(cltrace.animate([scene.camera, moved], scene=scene, device=any_device, **how))
    for image in (renderer.look(moved).render(), frames[1]):
        for name in OUTPUTS:
            np.testing.assert_array_equal(getattr(image, name), getattr(fresh, name))
    centers = scene.columns.center + np.float64(0.125)
    other = scene.with_fields(columns=replace(scene.columns, center=centers), meshes=())
    fresh = cltrace.render(other, any_device, **how)
    image = renderer.update(centers=centers).render()
    for name in OUTPUTS:
        np.testing.assert_array_equal(getattr(image, name), getattr(fresh, name))


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
