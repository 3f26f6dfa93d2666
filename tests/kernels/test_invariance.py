"""What changes no bit of a picture: packets, crops, rows, drivers, threads, powers of two, and all that is skipped."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from clipped_scenes import scene_of as clipped
from glowing import eye, glowing, shades
from hostile import cylinder_regimes, mesh_regimes
from hostile.sphere_scenes import unit
from random_scenes import bare, crowd, random_scene, random_tree, splitting
from stress_cases import OUTPUTS, assert_same, picture

import cltrace
from cltrace import Image, Material, Mesh, Orthographic, Renderer, Scene, ambient_light, parallel_light, point_light
from cltrace.plan.request import KEEPS
from cltrace.run.devices import Device

LIGHTS = [ambient_light(), point_light((1, 2, 3)), parallel_light((1, -2, -1), (0.5, 0.5, 0.5))]
SKIPPED = sorted(set(KEEPS) - {"features"})


def tree(seed: int) -> Scene:
    """Random mirrors and glass; every other one with ellipsoids."""
    return random_tree(seed, ellipsoids=seed % 2 == 1)


# One program draws those of spheres, and another one those with ellipsoids. It has room for 8 bounces.
TREES = [seed for seed in range(14) if tree(seed).camera.max_bounces <= 8]


def shards(seed: int, count: int, spheres: int) -> Scene:
    """Triangles of all sizes and shapes around the eye, mirrors, glass and opaque ones, and as many balls as wanted.

    Some are slivers, some huge, some twice there, some in one plane.
    """
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2, 0.2, count)
    size[: count // 50] = 8
    middle = unit(rng, count) * (rng.uniform(1, 10, count) + size)[:, None]
    corners = middle[:, None] + rng.normal(size=(count, 3, 3)) * size[:, None, None]
    thin = corners[count // 2 :: 5]
    thin[:, 2] = thin[:, 1] + rng.normal(size=(len(thin), 3)) * 1e-5
    corners[1::11, :, 2] = -9
    corners = np.concatenate([corners, corners[::13]])
    meshes = []
    for kind, material in enumerate((Material(), Material(reflectance=0.75), Material(transmittance=0.75, index=1.5))):
        part = corners[rng.permutation(len(corners))[kind::2]]
        meshes.append(Mesh(part.reshape(-1, 3), np.arange(3 * len(part)).reshape(-1, 3), material=material))
    return Scene.from_spheres(
        replace(eye(5, tan=0.8, size=(48, 36)), up=(0.1, 1, 0)),
        LIGHTS,
        unit(rng, spheres) * rng.uniform(2, 9, (spheres, 1)),
        rng.uniform(0.05, 0.7, spheres),
        shades(spheres, seed),
        reflectance=np.where(np.arange(spheres) % 2, 0.75, 0),
        background=(0.2, 0.3, 0.4),
        meshes=meshes,
    )


def parallel(scene: Scene) -> Scene:
    camera = scene.camera
    height = float(np.linalg.norm(np.subtract(camera.lookat, camera.position)))
    return scene.seen_by(
        Orthographic(camera.position, camera.lookat, camera.up, height, camera.resolution, camera.max_bounces)
    )


class Row(NamedTuple):
    """Scenes, what all their pictures keep, and what changes no bit of them if it is kept, too."""

    scenes: Callable[[], list[Scene]]
    keep: tuple[str, ...] = ()
    skipped: tuple[str, ...] = ("lists", "filter", "hidden", "receivers", "unstopped", "order")


ROWS = {
    "spheres": Row(lambda: [random_scene(seed) for seed in (1, 4, 6)], (), tuple(SKIPPED)),
    "mirrors and glass": Row(
        lambda: [tree(seed) for seed in TREES if seed % 2],
        ("bounces",),
        ("tree", "weightless", "branches", "hidden", "receivers"),
    ),
    "many mirrors": Row(lambda: [crowd(seed, 600) for seed in (0, 1, 2, 3)], ("bounces",), ("tree",)),
    "triangles": Row(lambda: [shards(seed, 1000, 60 * seed) for seed in range(2)], ("bounces",), ("tree", "lists")),
    "shadows of meshes": Row(
        lambda: [mesh_regimes.scene_of(name, 0, (32, 32), True) for name in ("room", "terrain", "among spheres")],
        (),
        ("lists", "unstopped"),
    ),
    "parallel rays": Row(lambda: [parallel(random_scene(seed)) for seed in range(4)]),
    "cylinders": Row(
        lambda: [cylinder_regimes.lit_of(name, 0, (31, 23)) for name in cylinder_regimes.REGIMES], (), ("filter",)
    ),
    "parallel rays and cylinders": Row(
        lambda: [parallel(cylinder_regimes.lit_of(name, 1, (31, 23))) for name in cylinder_regimes.REGIMES],
        (),
        ("filter",),
    ),
    "clipped": Row(lambda: [clipped(name, 2) for name in ("some", "glass", "straight")], (), ("filter",)),
    "a lamp in a cylinder, or at it": Row(
        lambda: [
            Scene.from_spheres(
                cltrace.Camera((2, 2, 9), (1.5, 0, 0), (0, 1, 0), 40, (48, 36)),
                [ambient_light((0.2, 0.2, 0.2)), point_light((x, 0.25, 0), (0.8, 0.8, 0.8))],
                [(3, 0, 0), (3, 0.9, 0), (0, 0, -3)],
                0.5,
            ).with_cylinders([(0, -2, 0)], [(0, 2, 0)], 1)
            for x in (1 + 2.0**-22, 0.2)
        ],
        (),
        ("filter",),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ROWS)
def test_what_is_skipped_changes_no_bit(device: Device, name: str) -> None:
    """What is shaded in vain has shadow rays, too, so these may differ."""
    row = ROWS[name]
    for number, scene in enumerate(row.scenes()):
        usual = picture(scene, device, keep=row.keep)
        for kept in row.skipped:
            other = picture(scene, device, keep=(*row.keep, kept))
            assert_same(usual, other, set(OUTPUTS) - {"shadow_rays"}, (number, kept))


@pytest.mark.stress
def test_what_is_skipped_changes_no_bit_of_many(device: Device) -> None:
    for seed in range(100):
        for precision in ("accurate", "double", "single"):
            usual = picture(tree(seed), device, precision)
            for kept in SKIPPED:
                other = picture(tree(seed), device, precision, keep=(kept,))
                assert_same(usual, other, ("rgb8", "color", "depth", "id"), (seed, precision, kept))


@pytest.mark.parametrize("seeds", [(1, 3), pytest.param((0, 2), marks=pytest.mark.slow)])
def test_the_tree_misses_nothing(device: Device, seeds: tuple[int, ...]) -> None:
    for seed in seeds:
        one, two = (picture(crowd(seed, 600), device, keep=("bounces", *kept)) for kept in ((), ("tree",)))
        assert_same(one, two, OUTPUTS, seed)


def assert_widths_agree(scenes: Iterable[Scene], device: Device, keep: tuple[str, ...], precision: str) -> None:
    """The light's formulas are rounded as each compiler likes in float32, but nothing else."""
    for number, scene in enumerate(scenes):
        wide, one = (picture(scene, device, precision, width, keep) for width in (None, 1))
        assert_same(wide, one, ("depth",) if precision == "single" else ("id", "depth"), number)
        assert np.allclose(wide.color, one.color, rtol=4e-6, atol=4e-6), number


@pytest.mark.parametrize(
    "precision", ["accurate", *(pytest.param(p, marks=pytest.mark.slow) for p in ("double", "single"))]
)
def test_packet_width_changes_nothing(device: Device, precision: str) -> None:
    """A lane never depends on its neighbours."""
    assert_widths_agree(map(random_scene, range(8)), device, (), precision)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROWS)
def test_packets_of_one_pixel(device: Device, name: str) -> None:
    """As GPUs have them. In ambient light alone, they have the same colours, too."""
    row = ROWS[name]
    assert_widths_agree(row.scenes()[:3], device, row.keep, "accurate")
    scene = bare(row.scenes()[0])
    assert_same(*(picture(scene, device, width=width, keep=row.keep) for width in (None, 1)), OUTPUTS, name)


def test_a_crop_is_those_pixels(device: Device, width: int) -> None:
    cases = [(random_scene(1), ()), *((random_tree(seed), ("bounces",)) for seed in TREES[:4])]
    for scene, keep in cases if width > 1 else cases[:1]:
        whole = picture(scene, device, width=width, keep=keep)
        for x0, y0, x1, y1 in ((0, 0, 1, 1), (3, 5, 20, 18), (0, 7, 33, 8), (13, 2, 14, 31)):
            part = picture(scene, device, width=width, keep=keep, crop=(x0, y0, x1, y1))
            for name in OUTPUTS:
                assert np.array_equal(getattr(whole, name)[y0:y1, x0:x1], getattr(part, name)), name


def test_rows_are_those_of_the_whole_picture(device: Device, width: int) -> None:
    """With the lists of all of it."""
    whole = Renderer(random_scene(1), device, "accurate", OUTPUTS, (3, 2, 31, 30), width=width, keep=("features",))
    image = whole.render()
    for first, end in [(2, 3), (2, 21), (9, 16), (17, 30), (29, 30)]:
        part = whole.rows(first, end)
        assert part.region == (3, first, 28, end - first)
        for name in ("rgb8", "id", "depth"):
            rows = getattr(image, name)[first - 2 : end - 2]
            assert np.array_equal(rows, getattr(part.render(), name)), (name, first)
    looked = whole.rows(9, 16).look(whole.scene.camera)  # packs for these rows alone
    assert np.array_equal(image.rgb8[7:14], looked.render().rgb8)
    for first, end in [(1, 5), (2, 31), (7, 7)]:
        with pytest.raises(ValueError, match=r"rows: must be within 2\.\.30 and not empty"):
            whole.rows(first, end)


def each_driver(scene: Scene, precision: str, keep: tuple[str, ...] = ()) -> list[Image]:
    found = [(device, width) for device in cltrace.devices() if device.has_double for width in {1, device.width}]
    return [picture(scene, device, precision, width, keep) for device, width in found]


def test_drivers_agree_on_ids_and_distances() -> None:
    """Double precision is rounded the same everywhere, so all drivers and packet widths give the same bits."""
    for seed in range(24):
        first, *others = each_driver(random_scene(seed), "accurate")
        for other in others:
            assert_same(first, other, ("id", "depth"), seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_drivers_agree_on_every_byte_in_double(seed: int) -> None:
    """Colours in double are rounded the same everywhere, too, with highlights, spot lights and bounces."""
    for scene in (random_scene(seed), random_tree(seed)):
        first, *others = each_driver(scene, "double")
        for other in others:
            assert_same(first, other, ("rgb8", "color"), seed)


@pytest.mark.slow
def test_the_number_of_threads_changes_no_bit(device: Device) -> None:
    """PoCL takes its number of threads from the environment, once for a process."""
    script = (
        "import sys, hashlib; sys.path.insert(0, sys.argv[1]); from random_scenes import random_tree\n"
        "from stress_cases import picture\n"
        "from cltrace.run.devices import choose\n"
        "for s in range(0, 14, 2):\n"
        "    i = picture(random_tree(s), choose(sys.argv[2]), keep=('bounces',))\n"
        "    print(hashlib.sha256(b''.join(a.tobytes() for a in (i.rgb8, i.color, i.id, i.depth))).hexdigest())"
    )
    results = set()
    for threads in ("1", "7"):
        env = os.environ | {"POCL_MAX_PTHREAD_COUNT": threads}
        command = [sys.executable, "-c", script, str(Path(__file__).parents[1]), device.spec]
        results.add(subprocess.run(command, env=env, capture_output=True, check=True).stdout)
    assert len(results) == 1
    assert len(results.pop()) > 200


def test_the_order_of_spheres_changes_only_their_numbers(device: Device) -> None:
    draw = partial(picture, device=device, keep=("bounces",))
    for seed in TREES:
        scene = random_tree(seed, ellipsoids=seed % 2 == 1, touching=False)
        scene = replace(scene, camera=replace(scene.camera, max_bounces=min(scene.camera.max_bounces, 8)))
        order = np.random.default_rng(seed).permutation(len(scene.spheres))
        one, two = draw(scene), draw(replace(scene, spheres=scene.spheres[order]))
        assert np.array_equal(one.id, np.where(two.id >= 0, order[two.id], -1)), seed
        assert_same(one, two, set(OUTPUTS) - {"id"}, seed)


def doubled(scene: Scene, k: int) -> Scene:
    """The scene times 2^k."""
    camera, spheres, lights = scene.camera, scene.spheres.copy(), scene.lights.copy()
    for array, name in ((spheres, "center"), (spheres, "radius"), (lights, "position")):
        array[name] = np.ldexp(array[name], k)
    position, lookat = (tuple(np.ldexp(p, k).tolist()) for p in (camera.position, camera.lookat))
    return replace(scene, camera=replace(camera, position=position, lookat=lookat), spheres=spheres, lights=lights)


def test_a_power_of_two_changes_no_bit(device: Device) -> None:
    for seed in TREES:
        one = picture(tree(seed), device, keep=("bounces",))
        for k in (-40, 1, 40):
            two = picture(doubled(tree(seed), k), device, keep=("bounces",))
            assert_same(one, two, set(OUTPUTS) - {"depth"}, (seed, k))
            assert np.array_equal(np.ldexp(one.depth, k), two.depth)


def test_an_exact_move_changes_nothing_to_be_seen(device: Device) -> None:
    """By 2^20 in every direction, where coordinates of few digits stay doubles: centres less the eye are the same."""
    balls = [((0.5, 0.25, -6), 1.5), ((-1.5, 0.5, -7), 1), ((0, -30, -8), 28.5), ((1, 0.5, 2), 1.25)]
    pictures = []
    for move in (0, 2.0**20):
        placed = [((x + move, y + move, z + move), radius) for (x, y, z), radius in balls]
        scene = glowing(eye(8, at=(move, move, move), tan=0.5, size=(40, 30)), placed, shades(4),
                        reflectance=[0.25, 0.5, 0.25, 0], transmittance=[0.5, 0, 0, 0.5], index=1.5)  # fmt: skip
        pictures.append(picture(scene, device, keep=("bounces",)))
    assert_same(*pictures, OUTPUTS, "moved")


def bytes_of(scene: Scene, device: Device, truncate: bool = False) -> np.ndarray:
    """The bytes of a picture that is nothing else, by a program of their own."""
    how: dict[str, Any] = {"truncate": truncate, "keep": ("features", "bounces")}
    return Renderer(scene, device, "accurate", ("rgb8",), **how).render().rgb8


def check_dropped(device: Device, seeds: Iterable[int]) -> None:
    """With faint branches and without them: the same bytes, rounded and cut; and the same colours."""
    for seed in seeds:
        scene = splitting(random_tree(seed), 8)
        every, some = (picture(scene, device, keep=("bounces", *kept)) for kept in (("branches",), ()))
        assert_same(every, some, OUTPUTS, seed)
        assert np.array_equal(every.rgb8, bytes_of(scene, device)), seed
        cut = np.floor(np.clip(every.color, 0, 1) * np.float32(255)).astype(np.uint8)
        assert np.array_equal(cut, bytes_of(scene, device, truncate=True)), seed


@pytest.mark.slow
def test_dropped_branches_change_no_byte(device: Device) -> None:
    check_dropped(device, range(0, 16, 2))


@pytest.mark.stress
def test_dropped_branches_change_no_byte_of_many(device: Device) -> None:
    check_dropped(device, range(16, 200))


@pytest.mark.slow
def test_faint_branches_add_up_to_white(device: Device) -> None:
    """From the centre of 9 concentric white shells of glass, r = t = 1/4, where a ray meets all of them straight on.

    At depth 16 most of 2^16 rays are left. They weigh 2^-32 each, which is nothing, and together what a float shows.
    And in a closed white room, in which three balls of glass make two rays of every one, up to 2^12 of them.
    """
    shells = [((0, 0, -5), float(radius)) for radius in range(1, 10)]
    white, forest = (1.0, 1.0, 1.0), [((0, 0, -5), 1), ((2.5, 0, -5), 1), ((1, 2, -6), 1), ((0, 0, 0), 40)]
    one = glowing(eye(16, at=(0, 0, -5), size=(2, 1)), shells, white, white, reflectance=0.25, transmittance=0.25,
                  index=1.5)  # fmt: skip
    two = glowing(eye(11, tan=0.1, size=(3, 2)), forest, white, white, reflectance=0.5,
                  transmittance=[0.5, 0.5, 0.5, 0], index=1.5)  # fmt: skip
    for scene in (one, two):
        few, all_ = (picture(scene, device, keep=("bounces", *kept)) for kept in ((), ("branches",)))
        assert_same(few, all_, OUTPUTS, "faint")
        assert (few.color == 1).all()
        assert (bytes_of(scene, device, truncate=True) == 255).all()
