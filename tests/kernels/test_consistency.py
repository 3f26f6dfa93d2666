"""The kernel against the reference: every device and precision, on every scene of scenes/, random and hostile ones."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from clipped_scenes import REGIMES as CLIPPED
from clipped_scenes import everything, first_of_balls
from clipped_scenes import scene_of as clipped
from conftest import SCENES
from hostile import bounced_regimes, cylinder_regimes, mesh_regimes
from hostile.sphere_regimes import rays
from random_scenes import crowd, random_scene, random_tree, splitting
from stress_cases import channel, picture, renderer, said, wrong_pixels

import cltrace
from cltrace import Camera, Material, Mesh, Orthographic, Scene, ambient_light, parallel_light, point_light
from cltrace.reference import byte_of
from cltrace.run.devices import Device
from cltrace.scene import MATERIAL, SPHERE

RANDOM = range(24)
# The reference tries every sphere for every pixel: so many tests a scene take it a tenth of a second.
TESTS = 20_000
MESHES = {path.stem for path in SCENES if "<mesh" in path.read_text("utf-8")}
# Scenes that need a program of their own, which takes long to compile: the long run has them.
OWN_PROGRAM = {"dusk", "four-mirrors", *MESHES}
# Spheres that float32 cannot hold relative to the camera: ordinary scenes are the others.
HOSTILE = {"globe"}


@functools.cache
def load(name: str) -> Scene:
    return random_scene(int(name)) if name.isdigit() else cltrace.load(next(p for p in SCENES if p.stem == name))


@pytest.mark.slow
@pytest.mark.parametrize("name", [path.stem for path in SCENES])
def test_kernel_agrees_with_the_reference_in_all_scenes(device: Device, name: str) -> None:
    agree(device, device.width, "accurate", [name], most=800)


@pytest.mark.parametrize("precision", ["accurate", pytest.param("double", marks=pytest.mark.slow), "single"])
def test_kernel_agrees_with_the_reference(device: Device, width: int, precision: str) -> None:
    names = [path.stem for path in SCENES if path.stem not in OWN_PROGRAM]
    agree(device, width, precision, [*names, *map(str, RANDOM)])


def agree(device: Device, width: int, precision: str, names: list[str], most: int = 300) -> None:
    """All is as wrong_pixels() says, and at most one byte in 10,000 differs at all. most: of how many pixels."""
    differing = total = 0
    for name in names:
        scene = load(name)
        (w, h), tests = scene.camera.resolution, len(scene.spheres) + scene.triangles
        count = min(w * h, max(60, min(most, TESTS // tests)))
        # Where ids change is most to be got wrong. Which pixels those are, any device may say.
        want, image = said(scene, picture(scene), count), picture(scene, device, precision, width)
        levels = np.array([[byte_of(c) for c in color] for color in want.color])
        apart = np.abs(channel(image, "rgb8")[want.pixels].astype(int) - levels).max(axis=1)
        differing, total = differing + int((apart > 0).sum()), total + count
        if precision == "single":
            assert name in HOSTILE or (apart > 1).sum() <= max(1, 1e-3 * count), name
        else:
            assert wrong_pixels(scene, image, count, np.inf) == [], name
    if precision != "single":
        assert differing <= max(1, 1e-4 * total)


# ---------------------------------------------------------------------------------------------------------- all shapes

CAMERA = Camera((0, 1, 6), (0, 0, 0), (0, 1, 0), 15, (24, 18))
TURNED = Orthographic((3, 2, 5), (0.1, 0.2, 0.3), (0.1, 1, 0.2), height=4.3, resolution=(40, 30))
LIGHTS = [ambient_light((0.2, 0.2, 0.2)), point_light((5, 8, 9)), parallel_light((-1, -1, -0.3), (0.3, 0.3, 0.3))]
ALL_LIGHTS = [*LIGHTS, cltrace.spot_light((0, 9, 3), (0, -1, -0.3), 20, 30)]


def molecule(**how: float) -> Scene:
    """Three balls, two bonds of two colours, a coin and a rod."""
    centers, colors = [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    scene = Scene.from_spheres(
        replace(CAMERA, max_bounces=3), LIGHTS, centers, 0.3, colors, bonds=[(0, 1), (0, 2)], bond_radius=0.12, **how
    )  # type: ignore[arg-type]
    return scene.with_cylinders([(-1, -1, 0), (0.5, -1, 0.1)], [(-1, -1, 0.2), (1, -0.5, 0.8)], [0.6, 0.2], (1, 1, 0))


def box_edges() -> Scene:
    """Cylinders that cross: a point of one of them that is on the other one, but for rounding, is on it."""
    camera = Orthographic((1, 1, 6), (1, 1, 0), (0, 1, 0), 3, (48, 36))
    lights = [ambient_light((0.2, 0.2, 0.2)), parallel_light((-0.3, -0.2, -1))]
    bare = Scene.from_spheres(camera, lights, np.zeros((0, 3)), 1)
    return bare.with_cylinders(*cltrace.box_edges((2, 2, 2)), 0.2, "white")


def through_parallel_rays(mixed: bool) -> Iterator[Scene]:
    """Spheres, or with ellipsoids and a textured mesh, which mirror and let light through, in all lights."""
    rng, n = np.random.default_rng(7), 14 if mixed else 60
    corners, texels = rng.normal(size=(9, 3)), rng.integers(0, 256, (5, 6, 3), np.uint8)
    paint = Material(texture=texels, reflectance=0.2)
    mesh = Mesh(corners, rng.integers(0, 9, (7, 3)), material=paint, uv=rng.uniform(size=(9, 2)))
    how = {
        "reflectance": rng.choice([0, 0.3], n),
        "transmittance": rng.choice([0, 0.4], n),
        "index": 1.4,
        "transform": np.where(np.arange(n)[:, None, None] % 2, np.eye(3), rng.normal(size=(n, 3, 3))),
        "meshes": mesh,
    }
    for camera in (TURNED, Orthographic((0.1, 0.2, 0.3), (1, 0.5, 0), height=3, resolution=(40, 30))):
        yield Scene.from_spheres(
            camera,
            ALL_LIGHTS,
            rng.normal(size=(n, 3)),
            rng.uniform(0.1, 0.5, n) * (1 if mixed else 0.5),
            rng.uniform(size=(n, 3)),
            background=(0.1, 0.2, 0.3),
            **how if mixed else {},
        )


def gallery() -> Scene:
    """Balls with images and without, an ellipsoid with one, all in a mirror and through glass."""
    random = np.random.default_rng(5)
    images = [
        random.integers(0, np.iinfo(dtype).max + 1, (*size, 3)).astype(dtype)
        for dtype, size in ((np.uint8, (3, 5)), (np.uint16, (4, 4)), (np.uint8, (1, 2)))
    ]
    spheres, materials = np.zeros(7, SPHERE), np.zeros(7, MATERIAL)
    spheres["center"] = [(-2, 0, 0), (0, 0, 0), (2, 0, 0), (0, 1.6, -1), (-1, -1.2, 1), (1, -1.2, 1), (0, -103, 0)]
    spheres["radius"], spheres["material"], spheres["to_object"] = [0.8, 0.8, 0.8, 0.9, 0.5, 0.5, 101], range(7), -1
    spheres["to_object"][2] = 0
    materials["color"] = [(1, 1, 1), (1, 1, 1), (0.5, 1, 0.7), (1, 1, 1), (0.9, 0.9, 1), (1, 0.3, 0.2), (1, 1, 1)]
    materials["ka"] = materials["kd"] = 0.8
    materials["ks"], materials["exponent"], materials["index"] = 0.3, 30, 1.5
    materials["texture"] = [0, 1, 0, 2, -1, -1, 2]
    materials["reflectance"], materials["transmittance"] = [0, 0, 0, 0.7, 0.1, 0, 0.3], [0, 0, 0, 0, 0.8, 0, 0]
    lights = [cltrace.ambient_light(), cltrace.point_light((5, 8, 9), (0.8, 0.8, 0.8))]
    camera = Camera((0, 1, 8), (0, 0, 0), horizontal_fov=20, resolution=(48, 36), max_bounces=4)
    squashed = np.array([[(1.2, 0.3, 0), (0, 0.8, 0.2), (0.1, 0, 1)]])
    return Scene(camera, lights, spheres, materials, (0.2, 0.3, 0.5), "x.png", squashed, textures=images)


def cubes_in_each_other() -> Scene:
    """More closed meshes than bits of a packet tell about at a time, which are about 31."""
    scene = everything(np.random.default_rng(1), [((0, 0, 0.1), (0.1, 0.2, 1))])
    cubes = [scene.meshes[0].moved(np.array([0, 0, 0.001 * k]), 100 + k) for k in range(70)]
    return replace(scene, meshes=(*scene.meshes, *cubes))


def shell_around(radii: list[float]) -> Iterator[Scene]:
    """docs/accuracy.md says up to which ratio of sizes shadows are right: this far."""
    for R in radii:
        camera = Camera((0.5, 0.5, 3), (2, 0, 0), horizontal_fov=40, resolution=(16, 12))
        yield Scene.from_spheres(camera, [point_light((4, 0.3, 0.2))], [(2, 0, 0), (0, 0, 0)], [1, R], ka=0, kd=1, ks=0)


def smooth_mesh() -> Scene:
    """Corners with normals and places in a texture, some without, in two meshes with one geometry."""
    rng = np.random.default_rng(1)
    vertices, faces = mesh_regimes.round_mesh(1)
    paint = Material(texture=rng.integers(0, 256, (4, 7, 3)).astype(np.uint8), ks=0.5)
    one = Mesh(
        vertices, faces, vertices + 0.3 * rng.normal(size=vertices.shape), rng.normal(size=(len(vertices), 2)), paint
    )
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0] * [1, 0.5, -0.75]
    placed = [Mesh.of(one, material=paint, transform=np.column_stack([turn, (x, 0.5 * x, 0)])) for x in (-0.7, 0.7)]
    return Scene.from_meshes(CAMERA, LIGHTS, [*placed, Mesh([(-3, -1, -3), (3, -1, -3), (0, -1, 3)], [(0, 1, 2)])])


class Row(NamedTuple):
    """Scenes, how many pixels of each are compared, and how much a colour may be off.

    keep: what their pictures keep besides all features; is_slow: whether their programs take long to compile.
    """

    scenes: Callable[[], Iterator[Scene] | list[Scene]]
    count: int = 100
    off: float = 1e-4
    keep: tuple[str, ...] = ()
    is_slow: bool = False


def tree(seed: int) -> Scene:
    return random_tree(seed, ellipsoids=seed % 2 == 1)


def is_deep(seed: int) -> bool:
    """Trees of more than 8 bounces take a program of their own."""
    return tree(seed).camera.max_bounces > 8


# Colours of bright scenes have larger errors in float32: their bytes are compared.
BYTES = np.inf
ROWS = {
    "trees": Row(lambda: [tree(s) for s in range(40) if not is_deep(s)], 25, BYTES, ("bounces",)),
    "deep trees": Row(lambda: [tree(s) for s in range(40) if is_deep(s)], 25, BYTES, ("bounces",), True),
    "rays that split": Row(lambda: [splitting(tree(s), 5) for s in range(6)], 8, BYTES, ("bounces",)),
    "crowds": Row(lambda: [crowd(s, 150) for s in (1, 3)], 40, BYTES, ("bounces",)),
    "molecule": Row(lambda: [molecule()]),
    "a mirror of a molecule": Row(lambda: [molecule(reflectance=0.4)], is_slow=True),
    "a glass molecule": Row(lambda: [molecule(transmittance=0.6, index=1.5, reflectance=0.1)], is_slow=True),
    "edges of a box": Row(lambda: [box_edges()], 600),
    "parallel rays": Row(lambda: through_parallel_rays(False), 400),
    "parallel rays to all shapes": Row(lambda: through_parallel_rays(True), 200, is_slow=True),
    "smooth meshes": Row(lambda: [smooth_mesh()], 400, is_slow=True),
    "huge shells": Row(lambda: shell_around([1e2, 1e5, 1e9, 1e11, 1e13]), 192, is_slow=True),
    "textures": Row(lambda: [gallery()], 600, 5e-7, is_slow=True),
    "more closed meshes than bits": Row(lambda: [cubes_in_each_other()], 60, is_slow=True),
    **{f"{name}, clipped": Row(lambda name=name: [clipped(name, 0)], 60) for name in CLIPPED},
    **{
        f"{name}, clipped, {seed}": Row(lambda name=name, seed=seed: [clipped(name, seed)], 192, is_slow=True)
        for name, seed in product(CLIPPED, range(1, 9))
    },
    **{
        f"rays that leave: {name}": Row(
            lambda name=name: [
                scene for seed in range(3) for scene in bounced_regimes.scenes_of(name, seed, (12, 12), 2)
            ],
            144, 0, ("bounces",) if {"ellipsoids", "needles"} & set(name.replace(",", " ").split()) else (),
        )
        for name in list(bounced_regimes.PICTURES)[:-1]
    },
    "rays that leave one of a thousand": Row(
        lambda: list(bounced_regimes.scenes_of(list(bounced_regimes.PICTURES)[-1], 0, (12, 12), 1)), 40, 0, is_slow=True
    ),
    **{
        f"meshes: {name}": Row(lambda name=name: [mesh_regimes.scene_of(name, 0, (16, 16), full=True)], is_slow=True)
        for name in mesh_regimes.REGIMES
    },
    **{
        f"cylinders: {name}": Row(
            lambda name=name: [cylinder_regimes.lit_of(name, seed, (12, 9)) for seed in range(3)], is_slow=True
        )
        for name in cylinder_regimes.REGIMES
    },
}  # fmt: skip


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if row.is_slow else ()) for n, row in ROWS.items()]
)
def test_pictures_are_those_of_the_reference(device: Device, name: str) -> None:
    row = ROWS[name]
    for number, scene in enumerate(row.scenes()):
        image = picture(scene, device, keep=row.keep)
        assert (image.color >= 0).all()
        assert wrong_pixels(scene, image, row.count, row.off) == [], number


def in_float32(scene: Scene) -> Scene:
    """With radii rounded to float32, so that a shell that `single` cannot tell from its core has the core's radius."""
    spheres = scene.spheres.copy()
    spheres["radius"] = spheres["radius"].astype(np.float32)
    return replace(scene, spheres=spheres)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["trees", "molecule", "some, clipped", "parallel rays", "smooth meshes"])
def test_single_is_close(device: Device, name: str) -> None:
    """`single` differs from `accurate` in few pixels, at edges; of a shell and its core it shows the first."""
    row = ROWS[name]
    for scene in list(row.scenes())[:4]:
        held = in_float32(scene)
        exact, rough = (picture(held, device, precision, keep=row.keep) for precision in ("accurate", "single"))
        same = exact.id == rough.id
        assert same.mean() > 0.97
        assert (np.abs(exact.color - rough.color).max(axis=2)[same] < 1e-3).mean() > 0.97
        assert (picture(scene, device, "single", keep=row.keep).id == exact.id).mean() > 0.97


@pytest.mark.stress
def test_kernel_agrees_with_the_reference_on_many_scenes(device: Device) -> None:
    for seed, precision in product(range(40, 640), ("accurate", "double")):
        image = picture(tree(seed), device, precision, keep=("bounces",))
        assert wrong_pixels(tree(seed), image, 100, BYTES) == [], seed


def test_light_falls_through_what_is_left_out(device: Device) -> None:
    """A floor below a ball of which the upper half is gone, in light from above that the whole ball would stop."""
    camera = Camera((0, 6, 6), (0, 0, 0), (0, 1, 0), 30, (16, 12))
    centers, radii = [(0, 2, 0), (0, -1000, 0), (0, 4, 0)], [1, 999, 0.5]
    scene = Scene.from_spheres(camera, [point_light((0, 9, 0))], centers, radii).clipped((0, 1.5, 0), (0, 1, 0))
    assert wrong_pixels(scene, picture(scene, device)) == []


@pytest.mark.slow
def test_many_clipped_spheres(device: Device) -> None:
    """As many as a device makes lists of, which take the reference long: hits and caps are those of intervals."""
    camera, clip = Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 30, (64, 48)), ((0, 0, 0.2), (0, 0.3, 1))
    rng = np.random.default_rng(3)
    scene = Scene.from_spheres(camera, "studio", rng.uniform(-1, 1, (40_000, 3)), 0.03).clipped(*clip)
    image, chosen = cltrace.render(scene, device, outputs=("id", "primitive", "depth")), np.arange(0, 64 * 48, 7)
    d = rays(camera)[chosen]
    index, t, cap = first_of_balls(scene.columns.center, 0.03, [clip], np.tile((0.0, 0, 4), (len(d), 1)), d)
    met = index >= 0
    assert np.array_equal(channel(image, "id")[chosen], index)
    assert np.array_equal(channel(image, "primitive")[chosen] == -2, cap)
    assert np.allclose(channel(image, "depth")[chosen][met], (t * np.linalg.norm(d, axis=1))[met], rtol=1e-9)
    assert cap.mean() > 0.05


@pytest.mark.slow
def test_shadow_rays_are_counted(device: Device) -> None:
    """One per light that a hit point faces, none without a hit, none for a lone sphere seen from outside."""
    camera = Camera((0, 0, 5), (0, 0, 0), horizontal_fov=20, resolution=(40, 40))
    light = point_light((0, 0, 5))
    two = Scene.from_spheres(camera, [light, light], [(-0.6, 0, 0), (0.6, 0, 0)], 0.5)
    work = renderer(two, device).work()
    asked = work["shadow rays traced"] + work["shadow rays that no sphere can stop"]
    assert asked == 2 * (picture(two, device).id >= 0).sum()
    one = Scene.from_spheres(camera, [light], [(0, 0, 0)], 1.0)
    assert renderer(one, device).work()["shadow rays traced"] == 0
