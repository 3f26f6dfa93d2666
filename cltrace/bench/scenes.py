"""The benchmark's own scenes: what is drawn every day, and what float32 cannot draw.

Everything is made from the same seeds each time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import cltrace
from cltrace.scene import AnyCamera, Material, Scene

Size = tuple[int, int]
Floats = NDArray[np.float64]

WHITE_LIGHTS = (cltrace.ambient_light((1, 1, 1)), cltrace.point_light((5, 8, 2)))
# What a case is for: one picture; one of means over pixels; the next picture of another camera, or
# of spheres at other places.
Task = Literal["frame", "samples", "cameras", "positions"]

# Classes that others name; all of them are in CLASSES, below.
ORDINARY, MILLION = "ordinary", "a million particles"
GROUND, FAR, SCALE = "ground spheres", "far from the origin", "tiny and huge scales"
ANTIALIASED, GIVEN = "antialiased", "given"
GROWTH_SPHERES, GROWTH_PIXELS = "growth with spheres", "growth with pixels"

# Of a picture of means, so many times fewer pixels a side are drawn: each of them is held against 64 x 64 rays.
FEWER = 4


@dataclass(frozen=True)
class Case:
    """A scene to measure: its name in tables, the class of scenes that it belongs to, and what is measured of it."""

    name: str
    group: str
    scene: Scene
    task: Task = "frame"


def looking(size: Size, tan: float = 0.6, eye: tuple[float, float, float] = (0, 0, 0)) -> cltrace.Camera:
    """A camera that looks along -z. tan: half of the longer side of its image plane at distance 1."""
    x, y, z = eye
    ahead = (x, y, z - max(1.0, abs(z)))
    return cltrace.Camera(eye, ahead, (0, 1, 0), math.degrees(math.atan(tan)), size, square_pixels=True)


def as_float32(values: ArrayLike) -> Floats:
    """Rounded to numbers that tracers in single precision read without a further rounding."""
    return np.asarray(values).astype("f4").astype("f8")


def balls(camera: AnyCamera, centers: Floats, radii: ArrayLike, colors: Floats, **more: Any) -> Scene:
    """Round spheres in the light of WHITE_LIGHTS, unless `more`, which goes to Scene.from_spheres, names others."""
    look: dict[str, Any] = {"lights": WHITE_LIGHTS, "ka": 0.1, "background": (0.1, 0.1, 0.2)} | more
    return Scene.from_spheres(camera, centers=as_float32(centers), radii=radii, colors=colors, **look)


def cloud(count: int, size: Size, *more: NDArray[np.void]) -> Scene:
    """Balls in a box in front of the eye, with overlaps, smaller the more there are; one point light, and these."""
    rng = np.random.default_rng(1)
    centers = np.column_stack([rng.uniform(-3, 3, (count, 2)), rng.uniform(-10, -4, count)])
    radii = as_float32(rng.uniform(0.1, 0.6, count) * (16 / count) ** (1 / 3))
    colors = rng.uniform(0.05, 1, (count, 3))
    return balls(looking(size), centers, radii, colors, lights=[*WHITE_LIGHTS, *more])


def filled(size: Size) -> Scene:
    """Eight balls with 50 in each, which nobody sees, and 400 behind the eye, which shadow nothing."""
    rng = np.random.default_rng(2)
    shells = np.array([(x, y, -8) for x in (-3, -1, 1, 3) for y in (-1, 1)], np.float64)
    inner = np.repeat(shells, 50, axis=0) + rng.uniform(-0.4, 0.4, (400, 3))
    behind = rng.uniform(-3, 3, (400, 3)) + (0, -20, 40)
    radii = np.repeat([0.875, 0.0625, 0.25], [8, 400, 400])
    colors = rng.uniform(0.05, 1, (len(radii), 3))
    return balls(looking(size), np.concatenate([shells, inner, behind]), radii, colors)


def field(size: Size, radius: float = 1e3, offset: float = 0, scale: float = 1) -> Scene:
    """84 balls of two sizes on a ground sphere of this radius, moved by about `offset` in each axis, times `scale`."""
    rng = np.random.default_rng(4)
    small = [(x + 0.8 * rng.random(), 0.2, z + 0.8 * rng.random()) for x in range(-5, 4) for z in range(-6, 3)]
    centers = np.array([(0, -radius, 0), (0, 1, 0), (-4, 1, 0), (4, 1, 0), *small])
    radii = np.array([radius, 1, 1, 1, *[0.2] * len(small)])
    colors = np.random.default_rng(5).uniform(0.1, 1, (len(radii), 3))
    move = offset * np.array([1, -0.7, 0.3])
    eye, light = (tuple((scale * (np.array(p) + move)).tolist()) for p in ((0, 1.5, 13), (9, 14, 6)))
    lights = [cltrace.ambient_light((1, 1, 1)), cltrace.point_light(light)]
    where, look = scale * (centers + move), dict[str, Any](ka=0.1, background=(0.5, 0.7, 1))
    return Scene.from_spheres(looking(size, 0.4, eye), lights, where, scale * radii, colors, **look)


OTHER_LIGHTS = (
    cltrace.parallel_light((-1, -2, -1), (0.4, 0.4, 0.3)),
    cltrace.spot_light((-4, 5, 0), (4, -5, -7), 10, 25, (0.6, 0.3, 0.2)),
)


def soft_lights(members: int) -> list[NDArray[np.void]]:
    """A sky of so many directions, and a panel of as many points."""
    panel = cltrace.panel_light((5, 8, 2), (1, 1, 1), (2, 0, 1), (0, 2, 2), points=members)
    return [cltrace.sky_light(directions=members), panel]


def clear(size: Size, reflectance: float, transmittance: float) -> Scene:
    """24 balls that mirror, or let through, shares of the light, before a ball that they are in front of."""
    rng = np.random.default_rng(6)
    centers = np.column_stack([rng.uniform(-2.4, 2.4, 24), rng.uniform(-1.3, 1.3, 24), rng.uniform(-8, -5, 24)])
    centers = np.concatenate([centers, [(0, 0, -16)]])
    radii = as_float32(np.append(rng.uniform(0.3, 0.6, 24), 6))
    return balls(
        replace(looking(size), max_bounces=7), centers, radii, rng.uniform(0.05, 1, (25, 3)),
        reflectance=np.append(np.full(24, reflectance), 0),
        transmittance=np.append(np.full(24, transmittance), 0), index=1.5,
    )  # fmt: skip


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


LOOK = Material((0.8, 0.6, 0.4), ka=0.1, kd=0.7, ks=0.4, exponent=50)


def meshed(size: Size, shape: tuple[Floats, NDArray[np.int64], Floats | None]) -> Scene:
    """A mesh of these vertices, faces and normals."""
    vertices, faces, normals = shape
    mesh = cltrace.Mesh(vertices.astype("f4"), faces, normals, material=LOOK)
    return Scene.from_meshes(looking(size), WHITE_LIGHTS, [mesh], background=(0.1, 0.1, 0.2))


def checks(side: int) -> NDArray[np.uint8]:
    """A texture of so many pixels a side: squares of two colours, with noise."""
    i, j = np.indices((side, side)) // max(1, side // 8)
    colors = np.where(((i + j) % 2)[..., None], (220, 200, 160), (60, 80, 120))
    return (colors + np.random.default_rng(9).integers(-30, 30, (side, side, 3))).astype(np.uint8)


def floor(size: Size) -> Scene:
    """A floor of two triangles, seen at a slant as far as the horizon, with a texture that repeats 16 times a side."""
    corners = np.array([(-40, -2, 0), (40, -2, 0), (40, -2, -80), (-40, -2, -80)], float)
    place = [(0, 0), (16, 0), (16, 16), (0, 16)]
    mesh = cltrace.Mesh(corners, [(0, 1, 2), (0, 2, 3)], uv=place, material=replace(LOOK, texture=checks(256)))
    return Scene.from_meshes(looking(size), WHITE_LIGHTS, [mesh], background=(0.1, 0.1, 0.2))


def painted(count: int, size: Size) -> Scene:
    """Balls of which each has the texture."""
    scene = cloud(count, size)
    materials = scene.materials.copy()
    materials["texture"], materials["color"] = 0, 1
    return replace(scene, materials=materials, textures=(checks(128),))


def sticks(count: int, size: Size) -> Scene:
    """About so many balls and as many bonds, in each of which two of them meet: neighbours on a grid that is shaken."""
    side = round(count ** (1 / 3))
    rng = np.random.default_rng(8)
    place = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    centers = (place + rng.uniform(-0.2, 0.2, place.shape)) * (6 / side) + (-3, -3, -10)
    axis = np.eye(3, dtype=int)[rng.integers(0, 3, len(place))]
    joined = ((place + axis) % side) @ (side * side, side, 1)
    pairs = np.column_stack([np.arange(len(place)), joined])[(place + axis < side).all(axis=1)]
    return balls(
        looking(size), centers, 1.5 / side, rng.uniform(0.05, 1, (len(place), 3)),
        bonds=pairs, bond_radius=np.float32(0.6 / side), bond_colors="white",
    )  # fmt: skip


def orthographic(size: Size) -> Scene:
    """A thousand balls without perspective."""
    scene = cloud(1000, size)
    return scene.seen_by(cltrace.Orthographic((0, 0, 0), lookat=(0, 0, -1), up=(0, 1, 0), height=5, resolution=size))


def fewer(size: Size) -> Size:
    """The size of a picture of means."""
    return max(1, size[0] // FEWER), max(1, size[1] // FEWER)


def moving(size: Size) -> dict[str, Scene]:
    """What moves, or is moved around."""
    return {f"{count:,} balls": cloud(count, size) for count in (1000, 100_000)}


# The classes: what is measured of one, and its scenes for a size of pictures, by name.
CLASSES: dict[str, tuple[Task, Callable[[Size], dict[str, Scene]]]] = {
    ORDINARY: ("frame", lambda size: {
        "16 balls": cloud(16, size),
        "100 balls, one light off": cloud(100, size, cltrace.point_light((-5, 8, 2), (0, 0, 0))),
        "1,000 balls": cloud(1000, size),
        "8 balls, filled": filled(size),
    }),
    "three kinds of lights": ("frame", lambda size: {"1,000 balls, three lights": cloud(1000, size, *OTHER_LIGHTS)}),
    "soft light": ("frame", lambda size: {"100 balls, a sky and a panel": cloud(100, size).lit_by(soft_lights(16))}),
    GROUND: ("frame", lambda size: {f"R = {radius:.0e}": field(size, radius) for radius in (1e3, 1e5, 1e7)}),
    FAR: ("frame", lambda size: {f"moved by {offset:.0e}": field(size, offset=offset) for offset in (1e4, 1e6, 1e7)}),
    SCALE: ("frame", lambda size: {f"times {scale:.0e}": field(size, scale=scale) for scale in (1e-6, 1e6, 1e20)}),
    MILLION: ("frame", lambda size: {"1,000,000 balls": cloud(1_000_000, size)}),
    "meshes": ("frame", lambda size: {
        "smooth, 20,000": meshed(size, bowl(20_000)),
        "terrain, 200,000": meshed(size, hills(200_000)),
        "soup, 20,000": meshed(size, scattered(20_000, 1)),
        "slivers, 20,000": meshed(size, scattered(20_000, 0.03)),
    }),
    "bonds": ("frame", lambda size: {"10,000 balls and bonds": sticks(10_000, size)}),
    "mirrors": ("frame", lambda size: {"25 balls, 0.5 mirrored": clear(size, 0.5, 0)}),
    "glass to depth 8": ("frame", lambda size: {"25 balls, 0.8 refracted": clear(size, 0.1, 0.8)}),
    "textures": ("frame", lambda size: {"floor": floor(size), "100 balls, textured": painted(100, size)}),
    "orthographic": ("frame", lambda size: {"1,000 balls, orthographic": orthographic(size)}),
    ANTIALIASED: ("samples", lambda size: {
        "1,000 balls": cloud(1000, fewer(size)),
        "25 balls, 0.5 mirrored": clear(fewer(size), 0.5, 0),
        "smooth, 20,000": meshed(fewer(size), bowl(20_000)),
        "floor": floor(fewer(size)),
    }),
    "moving cameras": ("cameras", moving),
    "moving positions": ("positions", moving),
}  # fmt: skip
GROUPS = (*CLASSES, GIVEN)


def generated(size: Size) -> list[Case]:
    """The default set: the scenes of all classes."""
    return [
        Case(name, group, scene, task) for group, (task, make) in CLASSES.items() for name, scene in make(size).items()
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
    sizes = [(160 * k, 90 * k) for k in (1, 2, 4, 8, 24)]
    return spheres + [Case(f"{w}x{h}", GROWTH_PIXELS, cloud(300, (w, h))) for w, h in sizes]
