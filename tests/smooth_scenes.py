"""Scenes for smooth pictures: outlines, shadow edges, cones, textures, mirrors and glass, small and large."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from solids import box, mesh, octahedron

import cltrace

SCENES = Path(__file__).parents[1] / "scenes"
SIZE = (20, 14)
OUTPUTS = ("rgb8", "color", "error", "coverage")
Colors = NDArray[np.float64]


def lit(centers: object, radii: object, *lights: np.ndarray, **materials: object) -> cltrace.Scene:
    """Spheres before a dark sky."""
    camera = cltrace.Camera((0, 0, 0), (0, 0, -1), horizontal_fov=25, resolution=SIZE)
    some = lights or (cltrace.parallel_light((1, -2, -1.5), (0.9, 0.8, 0.7)),)
    every = [cltrace.ambient_light((0.5, 0.5, 0.5)), *some]
    given = {"colors": (0.8, 0.6, 0.4), "ks": 0.3} | materials
    return cltrace.Scene.from_spheres(camera, every, centers, radii, background=(0.1, 0.1, 0.3), **given)


def cloud(seed: int, n: int, smallest: float, largest: float) -> tuple[Colors, Colors]:
    """Centres and radii of spheres within sight."""
    random = np.random.default_rng(seed)
    z = -random.uniform(3, 9, n)
    across = random.uniform(-0.45, 0.45, (n, 2)) * -z[:, None]
    return np.column_stack([across, z]), random.uniform(smallest, largest, n)


EGG = np.array([[0.5, 0.6, -0.2], [-0.3, 0.5, 0.4], [0.2, -0.1, 0.6]])
HOSTILE = {
    "crossing": lambda: lit([(-0.3, 0, -5), (0.4, 0.1, -5.1), (0, 0.5, -4.8)], [0.7, 0.6, 0.4]),
    "behind edges": lambda: lit([(0, 0, -4), (0.99, 0, -6), (-0.5, 0.9, -5)], [0.6, 0.4, 0.5]),
    "shadow rims": lambda: lit(
        [(0, -101, -6), (0, 0.3, -5), (0.8, 0, -6), (-0.8, -0.4, -5)],
        [100, 0.4, 0.3, 0.2],
        cltrace.point_light((2, 4, -3)),
        cltrace.parallel_light((3, -2, -1), (0.4, 0.4, 0.6)),
    ),
    "cones": lambda: lit(
        [(0, -101, -6), (0, 0.2, -5)],
        [100, 0.5],
        cltrace.spot_light((0.5, 3, -4), (-0.1, -1, -0.2), 10, 16),
        cltrace.spot_light((-2, 3, -5), (0.6, -1, 0), 12, 12, (1, 0.3, 0.2)),
    ),
    "tiny": lambda: lit(*cloud(2, 300, 0.001, 0.004)),
    "large and small": lambda: lit(
        *map(np.concatenate, zip(cloud(3, 6, 0.4, 0.8), cloud(4, 60, 0.01, 0.1), strict=True))
    ),
    "crossing eggs": lambda: lit(
        [(-0.3, 0, -8), (0.4, 0.1, -8.1), (0, 0.5, -7.8)],
        [1.0, 0.9, 0.6],
        cltrace.point_light((2, 4, -3)),
        transform=EGG,
    ),
    "in an egg": lambda: lit([(0, 0, 0), (0.5, 0, -4)], [30, 0.7], cltrace.point_light((1, 2, 0)), transform=EGG),
}
MATERIAL = cltrace.Material((0.5, 0.7, 0.8), ka=0.3, kd=0.7, ks=0.3, exponent=20)
CORNERS = [(-9, -0.8, -2), (9, -0.8, -2), (9, -0.8, -20), (-9, -0.8, -20)]
FLOOR = cltrace.Mesh(CORNERS, [(0, 1, 2), (0, 2, 3)], material=MATERIAL)
LAMP = cltrace.point_light((2, 4, -3))


def triangles(seed: int, n: int, size: float) -> cltrace.Mesh:
    """Triangles apart from each other, within sight."""
    places, _ = cloud(seed, n, 0, 1)
    vertices = places[:, None] + size * np.random.default_rng(seed).normal(size=(n, 3, 3))
    return cltrace.Mesh(vertices.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3), material=MATERIAL)


def meshed(
    meshes: list[cltrace.Mesh], *lights: np.ndarray, spheres: Colors | None = None, **materials: object
) -> cltrace.Scene:
    """Meshes, and spheres of rows (x, y, z, radius), before a dark sky."""
    given = np.zeros((0, 4)) if spheres is None else spheres
    return lit(given[:, :3], given[:, 3], *lights, meshes=meshes, **materials)


OTHERS = {
    "box": lambda: meshed(
        [mesh(box().moved((0.2, 0.1, -6)), material=MATERIAL), FLOOR], LAMP, spheres=np.array([(0.5, 0.2, -4, 0.3)])
    ),
    "crossing meshes": lambda: meshed(
        [
            mesh(solid, material=MATERIAL)
            for solid in (octahedron().moved((0, 0, -5)), box().moved((0.5, 0.5, -5), 0.7))
        ],
        spheres=np.array([(-0.3, -0.3, -4.5, 0.6)]),
    ),
    "triangles": lambda: meshed([triangles(1, 40, 0.3), FLOOR], LAMP),
}
IMAGE = np.random.default_rng(7).integers(60, 200, (5, 8, 3)).astype(np.uint8)


def globes() -> cltrace.Scene:
    """A sphere and an ellipsoid with a texture."""
    plain = lit([(-0.5, 0, -5), (0.7, 0.1, -5)], [0.7, 0.5], LAMP, transform=[np.eye(3), EGG], colors=(1, 1, 1))
    materials = plain.materials.copy()
    materials["texture"] = 0
    return replace(plain, materials=materials, textures=(IMAGE,))


NOISE = np.random.default_rng(8).integers(0, 65536, (37, 53, 3)).astype(np.uint16)


def papered(texels: float) -> cltrace.Scene:
    """A wall of noise, so many texels a pixel, which lean by some 20 degrees, and a ball that shadows it."""
    corners = np.array([(-3, -2), (3, -2), (3, 2), (-3, 2)])
    uv = corners @ np.array([[0.93, -0.36], [0.36, 0.93]]) * (texels * SIZE[0] / 2.2 / 53)
    material = cltrace.Material((0.9, 0.8, 0.7), ka=0.5, kd=0.6, ks=0.2, exponent=20, texture=NOISE)
    wall = cltrace.Mesh(np.column_stack([corners, np.full(4, -5)]), [(0, 1, 2), (0, 2, 3)], uv=uv, material=material)
    return meshed([wall], LAMP, spheres=np.array([(0.2, 0.1, -4.2, 0.2)]))


OTHERS |= {
    "globes": globes,
    "large texels": lambda: papered(0.3),
    "tiny texels": lambda: papered(20),
}
# As an orthographic camera sees them.
HOSTILE |= {
    f"{name}, parallel": lambda name=name: parallel(HOSTILE[name]())  # type: ignore[misc]
    for name in ("crossing", "shadow rims", "crossing eggs")
}
OTHERS |= {
    f"{name}, parallel": lambda name=name: parallel(OTHERS[name]())  # type: ignore[misc]
    for name in ("box", "triangles")
}


CHECKS = cltrace.Material(
    (1, 1, 1), ka=0.5, kd=0.6, ks=0, texture=np.eye(2, dtype=np.uint8)[..., None].repeat(3, 2) * 200
)
OTHERS |= {
    # A mirror and an opaque sphere cross before another mirror.
    "mirrors": lambda: lit(
        [(-0.4, 0, -4), (0.3, 0.1, -4.2), (0.2, -30.6, -8), (0.6, 0.5, -4.5)],
        [0.5, 0.4, 30, 0.25],
        LAMP,
        reflectance=[0.8, 0.0, 0.5, 0.4],
    ),
    "glass": lambda: lit(
        [(-0.4, 0, -4), (0.4, 0.1, -4.2), (0, 0, -6)],
        [0.5, 0.4, 0.8],
        LAMP,
        reflectance=[0.1, 0.3, 0],
        transmittance=[0.8, 0.3, 0],
        index=[1.5, 1.2, 1],
    ),
    # A checked floor, a box and a sphere.
    "mirror over checks": lambda: meshed(
        [
            cltrace.Mesh(CORNERS, [(0, 1, 2), (0, 2, 3)], uv=[(0, 0), (9, 0), (9, 9), (0, 9)], material=CHECKS),
            mesh(box().moved((0.9, 0.1, -6)), material=replace(MATERIAL, reflectance=0.5)),
        ],
        LAMP,
        spheres=np.array([(-0.3, 0, -4.5, 0.6)]),
        reflectance=0.8,
    ),
}


def parallel(scene: cltrace.Scene) -> cltrace.Scene:
    """The same scene as an orthographic camera sees it, from the middle of its nearest sphere."""
    return scene.seen_by(cltrace.Orthographic((0, 0, -4.5), (0, 0, -9), height=2.5, resolution=SIZE))
