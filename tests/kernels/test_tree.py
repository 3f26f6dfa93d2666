"""What must hold of every tree of rays: invariances, the reference's answers, and the end of a tree."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from glowing import (
    WHITE,
    assert_same,
    eye,
    glowing,
    shades,
)
from hostile.sphere_scenes import unit
from PIL import Image as Picture
from random_scenes import fuzzed_tree, random_tree, stretched
from stress_cases import channel, picture, remembered

import cltrace
from cltrace import CltraceError, Image, Scene, ambient_light, parallel_light, point_light
from cltrace.plan.request import KEEPS
from cltrace.reference import byte_of, world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device
from cltrace.students.check import sample

# ---------------------------------------------------------------------------------------------------------- invariances

EVERY = ("rgb8", "color", "normal", "direction", "depth", "id", "shadow_rays")


def tree(seed: int) -> Scene:
    """Random mirrors and glass; every other one with ellipsoids."""
    return random_tree(seed, ellipsoids=seed % 2 == 1)


# One program draws those of spheres, and another one those with ellipsoids. It has room for 8 bounces, and the code of
# all that bounces. To compile a program takes longer than most tests.
TREES = [seed for seed in range(14) if tree(seed).camera.max_bounces <= 8]


def drawn(
    scene: Scene, device: Device, precision: str = "accurate", width: int | None = None, keep: tuple[str, ...] = ()
) -> Image:
    """picture() by one of these programs."""
    return picture(scene, device, precision, width, ("bounces", *keep))


def bare(scene: Scene) -> Scene:
    """The same in ambient light alone, so that the colours do not depend on how the light's formulas are rounded."""
    materials = scene.materials.copy()
    materials["ka"], materials["kd"], materials["ks"] = 1, 0, 0
    return replace(scene, materials=materials, lights=ambient_light((1, 1, 1)))


def check_widths(device: Device, widths: Iterable[int], seeds: Iterable[int]) -> None:
    for seed in seeds:
        scene = tree(seed)
        lit, dim = drawn(scene, device), drawn(bare(scene), device)
        for width in widths:
            other = drawn(scene, device, width=width)
            assert_same(lit, other, ("id", "depth"), (seed, width))
            assert np.allclose(lit.color, other.color, rtol=4e-6, atol=4e-6), (seed, width)
            assert_same(dim, drawn(bare(scene), device, width=width), EVERY, (seed, width))


@pytest.mark.slow
def test_packet_width_changes_nothing(device: Device) -> None:
    check_widths(device, (1,), TREES)


@pytest.mark.stress
def test_no_packet_width_changes_anything(device: Device) -> None:
    check_widths(device, (1, 4, 8, 16), range(60))


def test_a_crop_is_those_pixels(device: Device) -> None:
    for seed in TREES[:4]:
        scene = random_tree(seed)
        whole = drawn(scene, device)
        for x0, y0, x1, y1 in ((0, 0, 1, 1), (3, 5, 20, 18), (13, 2, 14, 31)):
            part = picture(scene, device, keep=("bounces",), crop=(x0, y0, x1, y1))
            for name in EVERY:
                assert np.array_equal(getattr(whole, name)[y0:y1, x0:x1], getattr(part, name)), (seed, name)


def check_keeps(device: Device, seeds: Iterable[int], precisions: Iterable[str], keeps: Iterable[str]) -> None:
    for seed in seeds:
        scene = tree(seed)
        for precision in precisions:
            usual = drawn(scene, device, precision)
            for keep in keeps:
                other = drawn(scene, device, precision, keep=(keep,))
                # What is shaded in vain has shadow rays, too.
                assert_same(usual, other, set(EVERY) - {"shadow_rays"}, (seed, precision, keep))


@pytest.mark.slow
def test_what_is_skipped_changes_no_bit(device: Device) -> None:
    check_keeps(
        device, [s for s in TREES if s % 2], ("accurate",), ("tree", "weightless", "branches", "hidden", "receivers")
    )


@pytest.mark.stress
def test_what_is_skipped_changes_no_bit_of_many(device: Device) -> None:
    check_keeps(device, range(100), ("accurate", "double", "single"), sorted(set(KEEPS) - {"features"}))
    for seed in range(20):
        for precision in ("accurate", "double", "single"):
            lean = cltrace.render(tree(seed), device, precision, ("rgb8", "color", "id"))
            assert_same(lean, drawn(tree(seed), device, precision), ("rgb8", "color", "id"), (seed, precision))


def crowd(seed: int, count: int) -> Scene:
    """Mirrors, glass and opaque balls of all sizes around the eye, some huge, some tiny, many through each other.

    With an odd seed, half of the smaller ones are ellipsoids.
    """
    rng = np.random.default_rng(seed)
    radii = 10.0 ** rng.uniform(-3, 0, count)
    radii[: count // 50] = 10.0 ** rng.uniform(1, 4, count // 50)
    way = unit(rng, count) * (rng.uniform(1, 12, count) + radii)[:, None]
    # A wall of balls that touch in rows, exactly, and shells of one another.
    wall = np.stack(np.meshgrid(np.arange(-6, 7), np.arange(-5, 6), [-14]), -1).reshape(-1, 3)
    centers = np.concatenate([way, wall, wall[::3]])
    radii = np.concatenate([radii, np.full(len(wall), 0.5), np.full(len(wall[::3]), 0.5 + 2.0**-20)])
    kinds = rng.integers(0, 3, len(radii))
    bent = (rng.random(len(radii)) < 0.5) & (radii < 1)
    maps = np.array([stretched(rng) if b else np.eye(3) for b in bent]) if seed % 2 else None
    return Scene.from_spheres(
        replace(eye(6, tan=0.8, size=(64, 48)), up=(0.1, 1, 0)),
        [ambient_light(), point_light((1, 2, 3)), parallel_light((1, -2, -1), (0.5, 0.5, 0.5))],
        centers,
        radii,
        shades(len(radii), seed),
        reflectance=np.where(kinds == 1, 0.75, 0),
        transmittance=np.where(kinds == 2, 0.75, 0),
        index=1.5,
        transform=maps,
        background=(0.2, 0.3, 0.4),
    )


def check_crowds(device: Device, seeds: Iterable[int], count: int, precisions: Iterable[str]) -> None:
    """With the tree of boxes and without it, the same bits."""
    for seed in seeds:
        scene = crowd(seed, count)
        for precision in precisions:
            one, two = (drawn(scene, device, precision, keep=keep) for keep in ((), ("tree",)))
            assert_same(one, two, EVERY, (seed, precision))


@pytest.mark.parametrize("seeds", [(1, 3), pytest.param((0, 2), marks=pytest.mark.slow)])
def test_the_tree_misses_nothing(device: Device, seeds: tuple[int, ...]) -> None:
    check_crowds(device, seeds, 600, ("accurate",))


@pytest.mark.stress
def test_the_tree_misses_nothing_of_much(device: Device) -> None:
    check_crowds(device, range(60), 1000, ("accurate", "double", "single"))
    check_crowds(device, range(3), 30_000, ("accurate",))


def shards(seed: int, count: int, spheres: int) -> Scene:
    """Triangles of all sizes and shapes around the eye, mirrors, glass and opaque ones, and as many balls as wanted.

    Some are slivers, some huge, some twice there, some in one plane.
    """
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2, 0.2, count)
    size[: count // 50] = 8
    middle = unit(rng, count) * (rng.uniform(1, 10, count) + size)[:, None]
    corners = middle[:, None] + rng.normal(size=(count, 3, 3)) * size[:, None, None]
    corners[count // 2 :: 5, 2] = (
        corners[count // 2 :: 5, 1] + rng.normal(size=(len(corners[count // 2 :: 5]), 3)) * 1e-5
    )
    corners[1::11, :, 2] = -9
    corners = np.concatenate([corners, corners[::13]])
    meshes = []
    for kind, material in enumerate(
        (cltrace.Material(), cltrace.Material(reflectance=0.75), cltrace.Material(transmittance=0.75, index=1.5))
    ):
        part = corners[rng.permutation(len(corners))[kind::2]]
        meshes.append(cltrace.Mesh(part.reshape(-1, 3), np.arange(3 * len(part)).reshape(-1, 3), material=material))
    camera = replace(eye(5, tan=0.8, size=(48, 36)), up=(0.1, 1, 0))
    lights = [ambient_light(), point_light((1, 2, 3)), parallel_light((1, -2, -1), (0.5, 0.5, 0.5))]
    if not spheres:
        return Scene.from_meshes(camera, lights, meshes, background=(0.2, 0.3, 0.4))
    centers = unit(rng, spheres) * rng.uniform(2, 9, (spheres, 1))
    return Scene.from_spheres(
        camera,
        lights,
        centers,
        rng.uniform(0.05, 0.7, spheres),
        shades(spheres, seed),
        reflectance=np.where(np.arange(spheres) % 2, 0.75, 0),
        background=(0.2, 0.3, 0.4),
        meshes=meshes,
    )


def check_shards(device: Device, seeds: Iterable[int], precisions: Iterable[str]) -> None:
    """With the tree of boxes and without it, and whatever the packets' width, the same bits."""
    for seed in seeds:
        scene = shards(seed, 1000, 60 * (seed % 2))
        for precision in precisions:
            one, two = (drawn(scene, device, precision, keep=keep) for keep in ((), ("tree",)))
            assert_same(one, two, EVERY, (seed, precision))
            assert (one.id >= 0).mean() > 0.3
            if precision == "double":
                assert_same(one, drawn(scene, device, precision, width=1), EVERY, (seed, precision))


@pytest.mark.slow
def test_the_tree_misses_no_triangle(device: Device) -> None:
    check_shards(device, range(2), ("accurate",))


@pytest.mark.stress
def test_the_tree_misses_none_of_many_triangles(device: Device) -> None:
    check_shards(device, range(40), ("accurate", "double"))


@pytest.mark.slow
def test_a_lean_program_draws_the_same(device: Device) -> None:
    """Without the code that a scene does not need, in the usual outputs: the same bytes."""
    scene = random_tree(0)
    lean, full = cltrace.render(scene, device, outputs=("rgb8", "color", "id")), drawn(scene, device)
    assert_same(lean, full, ("rgb8", "color", "id"), "lean")


def test_the_order_of_spheres_changes_only_their_numbers(device: Device) -> None:
    for seed in TREES:
        scene = random_tree(seed, ellipsoids=seed % 2 == 1, touching=False)
        scene = replace(scene, camera=replace(scene.camera, max_bounces=min(scene.camera.max_bounces, 8)))
        order = np.random.default_rng(seed).permutation(len(scene.spheres))
        one, two = drawn(scene, device), drawn(replace(scene, spheres=scene.spheres[order]), device)
        assert np.array_equal(one.id, np.where(two.id >= 0, order[two.id], -1)), seed
        assert_same(one, two, set(EVERY) - {"id"}, seed)


def doubled(scene: Scene, k: int) -> Scene:
    """The scene times 2^k."""
    camera, spheres, lights = scene.camera, scene.spheres.copy(), scene.lights.copy()
    for array, name in ((spheres, "center"), (spheres, "radius"), (lights, "position")):
        array[name] = np.ldexp(array[name], k)
    position, lookat = (tuple(np.ldexp(p, k).tolist()) for p in (camera.position, camera.lookat))
    return replace(scene, camera=replace(camera, position=position, lookat=lookat), spheres=spheres, lights=lights)


def test_a_power_of_two_changes_no_bit(device: Device) -> None:
    for seed in TREES:
        scene = tree(seed)
        for k in (-40, 1, 40):
            one, two = drawn(scene, device), drawn(doubled(scene, k), device)
            assert_same(one, two, set(EVERY) - {"depth"}, (seed, k))
            assert np.array_equal(np.ldexp(one.depth, k), two.depth)


def test_an_exact_move_changes_nothing_to_be_seen(device: Device) -> None:
    """By 2^20 in every direction, where coordinates of few digits stay doubles: centres less the eye are the same."""
    balls = [((0.5, 0.25, -6), 1.5), ((-1.5, 0.5, -7), 1), ((0, -30, -8), 28.5), ((1, 0.5, 2), 1.25)]
    pictures = []
    for move in (0, 2.0**20):
        camera = eye(8, at=(move, move, move), tan=0.5, size=(40, 30))
        placed = [((x + move, y + move, z + move), radius) for (x, y, z), radius in balls]
        scene = glowing(camera, placed, shades(4), reflectance=[0.25, 0.5, 0.25, 0],
                        transmittance=[0.5, 0, 0, 0.5], index=1.5)  # fmt: skip
        pictures.append(drawn(scene, device))
    assert_same(*pictures, EVERY, "moved")


def test_drivers_agree(device: Device) -> None:
    """Double precision is rounded the same everywhere, and so are sums of whole numbers."""
    others = [d for d in cltrace.devices() if d.has_double and d.spec != device.spec]
    for seed in TREES[::2]:
        scene = bare(random_tree(seed))
        one = drawn(scene, device)
        for other in others:
            assert_same(one, drawn(scene, other), ("id", "depth", "color", "rgb8"), (seed, other.name))


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


# ------------------------------------------------------------------------------------------------ against the reference


@remembered
def said(scene: Scene, image: Image, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Some pixels, edges of spheres first, and the reference's bytes and ids of them."""
    width, world = scene.camera.resolution[0], world_of(scene)
    pixels = sample(image.id, min(count, image.id.size))
    answers = [trace(world, primary_ray(scene.camera, int(i) % width, int(i) // width)) for i in pixels]
    levels = np.array([[byte_of(c) for c in color] for color, _ in answers])
    return pixels, levels, np.array([at.index if at else -1 for _, at in answers])


def test_crowds_are_those_of_the_reference(device: Device) -> None:
    """Some pixels of many spheres and ellipsoids."""
    for seed in (1, 3):
        scene = crowd(seed, 150)
        image = drawn(scene, device)
        chosen, levels, ids = said(scene, image, 40)
        assert np.array_equal(channel(image, "id")[chosen], ids)
        assert np.abs(channel(image, "rgb8")[chosen].astype(int) - levels).max() <= 1


def check_agreement(device: Device, seeds: Iterable[int], precisions: Iterable[str], pixels: int) -> None:
    """Ids are the same, bytes within a level, and at most 1e-4 of the pixels differ at all: students/check.py."""
    for precision in precisions:
        compared = differing = 0
        for seed in seeds:
            scene = tree(seed)
            image = drawn(scene, device, precision)
            assert (image.color >= 0).all(), (seed, precision)
            # What the reference says, of the same pixels for each precision.
            chosen, levels, ids = said(scene, image, pixels)
            assert np.array_equal(channel(image, "id")[chosen], ids), (seed, precision)
            apart = np.abs(channel(image, "rgb8")[chosen].astype(int) - levels).max(axis=1)
            compared, differing = compared + len(chosen), differing + int((apart > 0).sum())
            assert apart.max() <= 1, (seed, precision, chosen[apart > 1])
        assert differing <= max(1, 1e-4 * compared), (precision, differing)


@pytest.mark.parametrize("deep", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_kernel_agrees_with_the_reference(device: Device, deep: bool) -> None:
    """Trees of more than 8 bounces take a program of their own."""
    check_agreement(device, [s for s in range(40) if (tree(s).camera.max_bounces > 8) == deep], ("accurate",), 25)


@pytest.mark.stress
def test_kernel_agrees_with_the_reference_on_many_scenes(device: Device) -> None:
    check_agreement(device, range(40, 640), ("accurate", "double"), 100)


def splitting(scene: Scene, bounces: int) -> Scene:
    """The same where all that mirrors is glass, too, and all glass mirrors: rays double at every hit."""
    materials = scene.materials.copy()
    both = (materials["reflectance"] > 0) | (materials["transmittance"] > 0)
    for name in ("reflectance", "transmittance"):
        materials[name][both & (materials[name] == 0)] = 0.375
    materials["index"][both & (materials["index"] == 0)] = 1.25
    return replace(scene, materials=materials, camera=replace(scene.camera, max_bounces=bounces))


def check_splits(device: Device, seeds: Iterable[int], bounces: int, pixels: int) -> None:
    for seed in seeds:
        scene = splitting(tree(seed), bounces)
        image = drawn(scene, device)
        chosen, levels, ids = said(scene, image, pixels)
        assert np.array_equal(channel(image, "id")[chosen], ids), seed
        assert np.abs(channel(image, "rgb8")[chosen].astype(int) - levels).max() <= 1, seed


def test_rays_that_split_at_every_hit(device: Device) -> None:
    check_splits(device, range(6), 5, 8)


@pytest.mark.stress
def test_rays_that_split_at_every_hit_down_to_depth_12(device: Device) -> None:
    check_splits(device, range(6, 100), 7, 20)
    check_splits(device, range(20), 12, 3)


def look_for_nan(device: Device, seeds: Iterable[int]) -> None:
    """Every pixel of trees of random bits is a number, in both precisions that use float32."""
    for seed in seeds:
        scene = fuzzed_tree(seed)
        for precision in ("accurate", "single"):
            image = drawn(scene, device, precision)
            assert (image.color >= 0).all(), (seed, precision)
            assert not np.isnan(image.normal).any(), (seed, precision)


@pytest.mark.slow
def test_no_nan(device: Device) -> None:
    look_for_nan(device, range(100))


@pytest.mark.stress
def test_no_nan_in_many_scenes(device: Device) -> None:
    look_for_nan(device, range(100, 20_000))


@pytest.mark.slow
def test_single_precision_draws_numbers(device: Device) -> None:
    """No NaN in trees of any depth; of scenes that float32 can hold, most pixels are as they should be."""
    for seed in TREES:
        scene = tree(seed)
        image = drawn(scene, device, "single")
        assert (image.color >= 0).all(), seed
        assert not np.isnan(image.normal).any(), seed
    camera = eye(4, tan=0.5, size=(40, 30))
    balls = [((0.5, 0.25, -6), 1.5), ((-1.5, 0.5, -7), 1), ((0, -30, -8), 28.5)]
    scene = glowing(camera, balls, shades(3), reflectance=[0.25, 0.5, 0.25], transmittance=[0.5, 0, 0], index=1.5)
    one, two = (channel(drawn(scene, device, precision), "color") for precision in ("accurate", "single"))
    apart = np.abs(one - two).max(axis=1)
    assert np.median(apart) <= 1e-5
    assert (apart > 0.01).mean() <= 0.02


# ---------------------------------------------------------------------------------------------------------- the command

HEAD = '<?xml version="1.0" standalone="no" ?>\n<!DOCTYPE scene SYSTEM "scene.dtd">\n'


def written(folder: Path, scene: Scene) -> Path:
    """The scene as a file, for the command. It has spheres of materials of their own, and an ambient light."""

    def three(tag: str, names: str, values: Iterable[float]) -> str:
        return f"<{tag} " + " ".join(f'{n}="{float(v)!r}"' for n, v in zip(names, values, strict=True)) + "/>"

    camera = scene.camera
    spheres = []
    for sphere in scene.spheres:
        m = scene.materials[sphere["material"]]
        spheres.append(
            f'<sphere radius="{float(sphere["radius"])!r}">{three("position", "xyz", sphere["center"])}<material_solid>'
            f'{three("color", "rgb", m["color"])}<phong ka="{m["ka"]}" kd="{m["kd"]}" ks="{m["ks"]}" exponent="1"/>'
            f'<reflectance r="{m["reflectance"]}"/><transmittance t="{m["transmittance"]}"/>'
            f'<refraction iof="{m["index"]}"/></material_solid></sphere>'
        )
    text = (
        f'{HEAD}<scene output_file="out.png">{three("background_color", "rgb", scene.background)}'
        f"<camera>{three('position', 'xyz', camera.position)}{three('lookat', 'xyz', camera.lookat)}"
        f'{three("up", "xyz", camera.up)}<horizontal_fov angle="{camera.horizontal_fov!r}"/>'
        f'<resolution horizontal="{camera.resolution[0]}" vertical="{camera.resolution[1]}"/>'
        f'<max_bounces n="{camera.max_bounces}"/></camera><lights><ambient_light>'
        f"{three('color', 'rgb', scene.lights['color'][0])}</ambient_light></lights>"
        f"<surfaces>{''.join(spheres)}</surfaces></scene>"
    )
    path = folder / "trees.xml"
    path.write_text(text)
    return path


@pytest.mark.slow
def test_the_command_draws_and_checks_trees(device: Device, tmp_path: Path) -> None:
    """From a file to a picture, which is that of Python, and held against the reference by --check."""
    scene = bare(random_tree(0))
    path = written(tmp_path, scene)
    command = [sys.executable, "-m", "cltrace", str(path), "-d", device.spec, "-o", "out.png", "--check=100"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "check ok: 100 of" in done.stderr
    with Picture.open(tmp_path / "out.png") as image:
        assert np.array_equal(np.asarray(image), drawn(scene, device).rgb8)


# -------------------------------------------------------------------------------------------------- the rays of a pixel


def forest(bounces: int, part: float = 0.5) -> Scene:
    """Three balls of glass, r = t = part, in a closed white room: every hit within it makes two rays, for ever."""
    balls = [((0, 0, -5), 1), ((2.5, 0, -5), 1), ((1, 2, -6), 1), ((0, 0, 0), 40)]
    camera = eye(bounces, tan=0.1, size=(3, 2))
    return glowing(camera, balls, WHITE, WHITE, reflectance=part, transmittance=[part] * 3 + [0], index=1.5)


@pytest.mark.slow
def test_fewer_bounces_are_drawn(device: Device) -> None:
    """Up to 2^12 rays a pixel, kept or dropped: the same bits, and all of them white."""
    for n in (3, 8, 11):
        one, two = drawn(forest(n), device), drawn(forest(n), device, keep=("branches",))
        assert_same(one, two, EVERY, n)
        assert (one.color == 1).all()


@pytest.mark.slow
def test_many_branches_that_are_faint(device: Device) -> None:
    """From the centre of 9 concentric white shells of glass, r = t = 1/4, where a ray meets all of them straight on.

    At depth 16 most of 2^16 rays are left. They weigh 2^-32 each, which is nothing, and together what a float shows.
    """
    balls = [((0, 0, -5), float(radius)) for radius in range(1, 10)]
    camera = eye(16, at=(0, 0, -5), size=(2, 1))
    scene = glowing(camera, balls, WHITE, WHITE, reflectance=0.25, transmittance=0.25, index=1.5)
    one, two = drawn(scene, device), drawn(scene, device, keep=("branches",))
    assert_same(one, two, EVERY, "shells")
    assert (one.color == 1).all()


def bytes_of(scene: Scene, device: Device, truncate: bool = False, keep: tuple[str, ...] = ()) -> np.ndarray:
    """The bytes of a picture that is nothing else, by a program of their own."""
    kept = ("features", "bounces", *keep)
    return cltrace.Renderer(scene, device, "accurate", ("rgb8",), truncate=truncate, keep=kept).render().rgb8


def plain(scene: Scene, color: tuple[float, float, float]) -> Scene:
    """The same shapes where all is of one colour, whatever bounces: weights add up to 1."""
    materials = bare(scene).materials.copy()
    materials["color"] = color
    more = np.maximum(1, materials["reflectance"] + materials["transmittance"])
    materials["reflectance"] /= more
    materials["transmittance"] /= more
    return replace(bare(scene), materials=materials, background=color)


def check_dropped(device: Device, seeds: Iterable[int], bounces: int) -> None:
    """With faint branches and without them: the same bytes, rounded and cut; and the same colours."""
    for seed in seeds:
        scene = splitting(random_tree(seed), bounces)
        every = drawn(scene, device, keep=("branches",))
        assert_same(every, drawn(scene, device), EVERY, seed)
        assert np.array_equal(every.rgb8, bytes_of(scene, device)), seed
        cut = np.floor(np.clip(every.color, 0, 1) * np.float32(255)).astype(np.uint8)
        assert np.array_equal(cut, bytes_of(scene, device, truncate=True)), seed
        # 1 is the least that is 255 when it is cut, and 1/2 the least that is 128 when it is rounded.
        for red, green, blue in np.eye(3).tolist():
            cut = bytes_of(plain(scene, (red, green, blue)), device, truncate=True)
            assert (cut == np.array([red, green, blue]) * 255).all(), seed
            rounded = bytes_of(plain(scene, (red / 2, green / 2, blue / 2)), device)
            assert (rounded == np.array([red, green, blue]) * 128).all(), seed


@pytest.mark.slow
def test_dropped_branches_change_no_byte(device: Device) -> None:
    check_dropped(device, range(0, 16, 2), 8)


@pytest.mark.stress
def test_dropped_branches_change_no_byte_of_many(device: Device) -> None:
    check_dropped(device, range(16, 200), 8)


@pytest.mark.slow
def test_white_is_never_less_than_white(device: Device) -> None:
    """A byte that no number of rays can prove is an error and no byte; 100 bounces, cut instead of rounded."""
    for truncate in (False, True):
        with contextlib.suppress(CltraceError):
            assert (bytes_of(forest(100), device, truncate) == 255).all()
