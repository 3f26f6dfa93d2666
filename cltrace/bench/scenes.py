"""The benchmark's own scenes: what is drawn every day, and what float32 cannot draw.

All cameras look along -z, so that the exact oracle can say what is right (see truth.py). Everything is made from the
same seeds each time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import (
    Material,
    Mesh,
    Orthographic,
    Scene,
    ambient_light,
    panel_light,
    parallel_light,
    point_light,
    sky_light,
    spot_light,
)

from .cases import looking

Size = tuple[int, int]
Floats = NDArray[np.float64]

(ORDINARY, LIGHTS, SOFT_LIGHT, GROUND, FAR, SCALE, MILLION, MESHES, BONDS, MIRRORS, GLASS, PARALLEL, GIVEN) = GROUPS = (
    "ordinary",
    "three kinds of lights",
    "soft light",
    "ground spheres",
    "far from the origin",
    "tiny and huge scales",
    "a million particles",
    "meshes",
    "bonds",
    "mirrors",
    "glass to depth 8",
    "orthographic",
    "given",
)
GROWTH_SPHERES, GROWTH_PIXELS = "growth with spheres", "growth with pixels"


@dataclass(frozen=True)
class Case:
    """A scene to measure: its name in tables, and the class of scenes that it belongs to."""

    name: str
    group: str
    scene: Scene


def cloud(count: int, size: Size, *more: NDArray[np.void]) -> Scene:
    """Balls in a box in front of the eye, with overlaps, smaller the more there are; one point light, and these."""
    rng = np.random.default_rng(1)
    centers = np.column_stack([rng.uniform(-3, 3, (count, 2)), rng.uniform(-10, -4, count)])
    radii = rng.uniform(0.1, 0.6, count) * (16 / count) ** (1 / 3)
    colors = rng.uniform(0.05, 1, (count, 3))
    # Rounded to what other tracers can read, too.
    centers, radii = centers.astype("f4").astype("f8"), radii.astype("f4").astype("f8")
    lights = [ambient_light((1, 1, 1)), point_light((5, 8, 2)), *more]
    return Scene.from_spheres(
        looking(tan=0.6, size=size), lights, centers, radii, colors, ka=0.1, background=(0.1, 0.1, 0.2)
    )


def filled(size: Size) -> Scene:
    """Eight balls with 50 in each, which nobody sees, and 400 behind the eye, which shadow nothing."""
    rng = np.random.default_rng(2)
    shells = np.array([(x, y, -8) for x in (-3, -1, 1, 3) for y in (-1, 1)], np.float64)
    inner = np.repeat(shells, 50, axis=0) + rng.uniform(-0.4, 0.4, (400, 3))
    behind = rng.uniform(-3, 3, (400, 3)) + (0, -20, 40)
    centers = np.concatenate([shells, inner, behind]).astype("f4").astype("f8")
    radii = np.repeat([0.875, 0.0625, 0.25], [8, 400, 400])
    lights = [ambient_light((1, 1, 1)), point_light((5, 8, 2))]
    colors = rng.uniform(0.05, 1, (len(radii), 3))
    return Scene.from_spheres(
        looking(tan=0.6, size=size), lights, centers, radii, colors, ka=0.1, background=(0.1, 0.1, 0.2)
    )


def field(size: Size, radius: float = 1e3, offset: float = 0, scale: float = 1) -> Scene:
    """84 balls of two sizes on a ground sphere of this radius, moved by about `offset` in each axis, times `scale`."""
    rng = np.random.default_rng(4)
    small = [(x + 0.8 * rng.random(), 0.2, z + 0.8 * rng.random()) for x in range(-5, 4) for z in range(-6, 3)]
    centers = np.array([(0, -radius, 0), (0, 1, 0), (-4, 1, 0), (4, 1, 0), *small])
    radii = np.array([radius, 1, 1, 1, *[0.2] * len(small)])
    colors = np.random.default_rng(5).uniform(0.1, 1, (len(radii), 3))
    move = offset * np.array([1, -0.7, 0.3])
    eye, light = ((scale * (np.array(p) + move)).tolist() for p in ((0, 1.5, 13), (9, 14, 6)))
    return Scene.from_spheres(
        looking(eye, 0.4, size),
        [ambient_light((1, 1, 1)), point_light(light)],
        scale * (centers + move),
        scale * radii,
        colors,
        ka=0.1,
        background=(0.5, 0.7, 1),
    )


WHITE_LIGHTS = (ambient_light((1, 1, 1)), point_light((5, 8, 2)))
SOFT_LIGHTS = (sky_light(directions=32), panel_light((5, 8, 2), (1, 1, 1), (2, 0, 1), (0, 2, 2), points=16))
OTHER_LIGHTS = (
    parallel_light((-1, -2, -1), (0.4, 0.4, 0.3)),
    spot_light((-4, 5, 0), (4, -5, -7), 10, 25, (0.6, 0.3, 0.2)),
)


def clear(size: Size, reflectance: float, transmittance: float) -> Scene:
    """24 balls that mirror, or let through, shares of the light, before a ball that they are in front of."""
    rng = np.random.default_rng(6)
    centers = np.column_stack([rng.uniform(-2.4, 2.4, 24), rng.uniform(-1.3, 1.3, 24), rng.uniform(-8, -5, 24)])
    centers = np.concatenate([centers, [(0, 0, -16)]])
    radii = np.append(rng.uniform(0.3, 0.6, 24), 6)
    return Scene.from_spheres(
        replace(looking(tan=0.6, size=size), max_bounces=7),
        WHITE_LIGHTS,
        centers.astype("f4").astype("f8"),
        radii.astype("f4").astype("f8"),
        rng.uniform(0.05, 1, (25, 3)),
        ka=0.1,
        reflectance=np.append(np.full(24, reflectance), 0),
        transmittance=np.append(np.full(24, transmittance), 0),
        index=1.5,
        background=(0.1, 0.1, 0.2),
    )


def bowl(count: int) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Vertices, faces and normals of about so many triangles: a ball of radius 2 before the eye, made of a grid."""
    columns = round((2 * count) ** 0.5 / 2) * 2
    rows = max(2, count // (2 * columns))
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, columns + 1), np.linspace(0.01, np.pi - 0.01, rows + 1))
    normals = np.column_stack([(np.sin(v) * np.cos(u)).ravel(), np.cos(v).ravel(), (np.sin(v) * np.sin(u)).ravel()])
    return 2 * normals + (0, 0, -6), quads(rows, columns), normals


def hills(count: int) -> tuple[Floats, NDArray[np.int64], Floats]:
    """The same of a landscape of waves, seen at a slant."""
    side = round((count / 2) ** 0.5)
    x, z = np.meshgrid(np.linspace(-8, 8, side + 1), np.linspace(-20, -2, side + 1))
    vertices = np.column_stack([x.ravel(), (-2 + 0.4 * np.sin(2 * x) * np.cos(1.5 * z)).ravel(), z.ravel()])
    slope = (0.8 * np.cos(2 * x) * np.cos(1.5 * z), -0.6 * np.sin(2 * x) * np.sin(1.5 * z))
    return vertices, quads(side, side), np.column_stack([-slope[0].ravel(), np.ones(x.size), -slope[1].ravel()])


def quads(rows: int, columns: int) -> NDArray[np.int64]:
    """The faces of a grid of vertices, of which columns + 1 stand in each of rows + 1 rows: two for each cell."""
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = first + columns + 1
    return np.concatenate([np.column_stack([first, first + 1, below]), np.column_stack([first + 1, below + 1, below])])


def scattered(count: int, width: float) -> tuple[Floats, NDArray[np.int64], None]:
    """The same of small triangles at random, of which the shorter sides are so wide, of the longer ones."""
    rng = np.random.default_rng(7)
    corner = np.column_stack([rng.uniform(-3, 3, (count, 2)), rng.uniform(-10, -4, count)])
    long, other = rng.normal(size=(2, count, 3)) * count ** (-1 / 3) * 2
    vertices = np.stack([corner, corner + long, corner + width * other], axis=1).reshape(-1, 3)
    return vertices, np.arange(3 * count).reshape(-1, 3), None


def meshes(size: Size) -> list[Case]:
    """Smooth and flat meshes, close and at a slant, and slivers."""
    shapes = {
        "smooth, 20,000": bowl(20_000),
        "terrain, 200,000": hills(200_000),
        "soup, 20,000": scattered(20_000, 1),
        "slivers, 20,000": scattered(20_000, 0.03),
    }
    look = Material((0.8, 0.6, 0.4), ka=0.1, kd=0.7, ks=0.4, exponent=50)
    return [
        Case(name, MESHES, Scene.from_meshes(
            looking(tan=0.6, size=size), WHITE_LIGHTS,
            [Mesh(vertices.astype("f4"), faces, normals, material=look)], background=(0.1, 0.1, 0.2),
        ))
        for name, (vertices, faces, normals) in shapes.items()
    ]  # fmt: skip


def sticks(count: int, size: Size) -> Scene:
    """About so many balls and as many bonds, in each of which two of them meet: neighbours on a grid that is shaken."""
    side = round(count ** (1 / 3))
    rng = np.random.default_rng(8)
    place = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    centers = (place + rng.uniform(-0.2, 0.2, place.shape)) * (6 / side) + (-3, -3, -10)
    axis = np.eye(3, dtype=int)[rng.integers(0, 3, len(place))]
    joined = ((place + axis) % side) @ (side * side, side, 1)
    pairs = np.column_stack([np.arange(len(place)), joined])[(place + axis < side).all(axis=1)]
    return Scene.from_spheres(
        looking(tan=0.6, size=size), WHITE_LIGHTS, centers.astype("f4").astype("f8"), 1.5 / side,
        rng.uniform(0.05, 1, (len(place), 3)), ka=0.1, background=(0.1, 0.1, 0.2),
        bonds=pairs, bond_radius=np.float32(0.6 / side), bond_colors="white",
    )  # fmt: skip


def orthographic(size: Size) -> Scene:
    """A thousand balls without perspective."""
    scene = cloud(1000, size)
    return scene.seen_by(Orthographic((0, 0, 0), lookat=(0, 0, -1), up=(0, 1, 0), height=5, resolution=size))


def generated(size: Size) -> list[Case]:
    """The default set: a few scenes of each class."""
    return [
        Case("16 balls", ORDINARY, cloud(16, size)),
        Case("100 balls, one light off", ORDINARY, cloud(100, size, point_light((-5, 8, 2), (0, 0, 0)))),
        Case("1,000 balls", ORDINARY, cloud(1000, size)),
        Case("8 balls, filled", ORDINARY, filled(size)),
        *(Case(f"R = {radius:.0e}", GROUND, field(size, radius)) for radius in (1e3, 1e5, 1e7)),
        *(Case(f"moved by {offset:.0e}", FAR, field(size, offset=offset)) for offset in (1e4, 1e6, 1e7)),
        *(Case(f"times {scale:.0e}", SCALE, field(size, scale=scale)) for scale in (1e-6, 1e6, 1e20)),
        Case("1,000,000 balls", MILLION, cloud(1_000_000, size)),
        Case("1,000 balls, three lights", LIGHTS, cloud(1000, size, *OTHER_LIGHTS)),
        Case("100 balls, a sky and a panel", SOFT_LIGHT, cloud(100, size).lit_by(SOFT_LIGHTS)),
        *meshes(size),
        Case("10,000 balls and bonds", BONDS, sticks(10_000, size)),
        Case("25 balls, 0.5 mirrored", MIRRORS, clear(size, 0.5, 0)),
        Case("25 balls, 0.8 refracted", GLASS, clear(size, 0.1, 0.8)),
        Case("1,000 balls, orthographic", PARALLEL, orthographic(size)),
    ]


def few(size: Size) -> list[Case]:
    """What --quick takes of them."""
    return [
        Case("16 balls", ORDINARY, cloud(16, size)),
        Case("R = 1e+05", GROUND, field(size, 1e5)),
        Case("moved by 1e+06", FAR, field(size, offset=1e6)),
    ]


def growing() -> list[Case]:
    """1 to a million balls in one size, and 300 balls in sizes up to 3840x2160."""
    spheres = [Case(f"{10**k:,}", GROWTH_SPHERES, cloud(10**k, (640, 360))) for k in range(7)]
    sizes = [(160 * k, 90 * k) for k in (1, 2, 4, 8, 12, 24)]
    return spheres + [Case(f"{w}x{h}", GROWTH_PIXELS, cloud(300, (w, h))) for w, h in sizes]
