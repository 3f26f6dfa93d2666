"""Draws terrain.png: mountains made of noise, a lake that mirrors them, and a sun low on the left.

    python scenes/terrain.py [-o FILE] [--size WxH] [--side N]

`--side` is how many heights a side of the land has: 708 make a million triangles, 100 make 20,000. Everything is an
array that numpy computes, and no file is read.
"""

from __future__ import annotations

import argparse

import numpy as np
from noise import bytes_of, layers, ridges
from numpy.typing import NDArray

import cltrace

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

LEFT, RIGHT, FAR, NEAR = -15.0, 15.0, -22.0, 5.0  # the land reaches from LEFT to RIGHT in x and from FAR to NEAR in z


def heights(x: Floats, z: Floats) -> Floats:
    """The land's height above the lake; scene units."""
    place = np.stack([x, z], axis=-1)
    bent = place / 9 + 0.25 * np.stack([layers(place / 9, 3, seed) for seed in (50, 60)], axis=-1)
    back = np.clip((-z - 2) / 14, 0, 1)
    mountains = (0.4 + 1.9 * back) * ridges(bent, 11, 10)
    hills = 0.3 * layers(place / 3, 8, 30)
    shore = np.hypot((x - 0.5) / 9, (z + 1.0) / 6.0) + 0.5 * layers(place / 4, 6, 80) - 0.6 * np.clip(z / 3, 0, 1)
    basin = np.clip(1.2 - shore, -0.5, 1)
    return mountains * np.clip(1.0 - 1.3 * basin, 0, 1) + hills - 1.2 * basin + 0.05


def land(side: int) -> tuple[Floats, NDArray[np.int32], Floats, Floats, Bytes]:
    """The land as a mesh: vertices and normals (side^2, 3), faces, uv (side^2, 2), and a texture (side, side, 3)."""
    x, z = np.meshgrid(np.linspace(LEFT, RIGHT, side), np.linspace(FAR, NEAR, side))
    y = heights(x, z)
    dy_dz, dy_dx = np.gradient(y, z[:, 0], x[0])
    normals = np.stack([-dy_dx, np.ones_like(y), -dy_dz], axis=-1)
    v, u = np.indices(y.shape) / side  # each vertex in the middle of its texel
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    a, b, c, d = first, first + side, first + side + 1, first + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    flat = 1 / np.sqrt(1 + dy_dx**2 + dy_dz**2)  # the normal's height: 1 on level ground
    columns = (array.reshape(side * side, -1) for array in (np.stack([x, y, z], axis=-1), normals))
    vertices, normals = columns
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    return vertices, faces.astype(np.int32), normals, uv, colors(x, y, z, flat)


def colors(x: Floats, y: Floats, z: Floats, flat: Floats) -> Bytes:
    """The colour of each place: sand at the lake, grass and wood, rock where it is steep, snow where it is high."""
    rough = layers(1.5 * np.stack([x, z], axis=-1), 6, 90)
    color = np.empty((*x.shape, 3))
    color[:] = np.array([0.42, 0.38, 0.34]) * (1 + 0.5 * rough)[..., None]  # rock

    def lay(over: tuple[float, float, float], share: Floats) -> None:
        share = np.clip(share, 0, 1)[..., None]
        color[:] = color * (1 - share) + np.array(over) * share

    lay((0.24, 0.31, 0.11), 7 * (flat - 0.66) + rough - (y - 1.3) * 1.2)
    lay((0.13, 0.2, 0.08), 9 * (flat - 0.8) + 3 * rough - 0.3 - (y - 0.9) * 2)  # wood
    lay((0.55, 0.47, 0.33), 1 - (y - 0.02) / 0.1 - rough)
    lay((0.8, 0.82, 0.86), (y - 1.9 + rough) * 1.6 + 3 * (flat - 0.75))
    return bytes_of(color)


def sky(height: int = 256, width: int = 512) -> Bytes:
    """An evening sky, brighter and more yellow on the left, with streaks of cloud; (height, width, 3)."""
    y, x = np.mgrid[0:height, 0:width] / height
    y = 1 - y  # 0 at the horizon, 1 at the top
    low, high = np.array([1.0, 0.72, 0.5]), np.array([0.22, 0.35, 0.56])
    glow = np.exp(-np.hypot(x / 1.1, y / 0.5))[..., None]
    share = (1 - np.exp(-((y / 0.36) ** 2.5)))[..., None]
    color = low * (1 - share) * (0.75 + 0.25 * glow) + high * share
    color += 0.35 * glow * np.array([1, 0.75, 0.4])
    streaks = layers(np.stack([2.5 * x, 9 * y + 0.7 * x], axis=-1), 7, 7)
    streaks += 0.35 * layers(np.stack([2 * x, 3 * y], axis=-1), 3, 8)
    cloud = np.clip(2.2 * (streaks - 0.02), 0, 1)[..., None] * np.clip(4 * y, 0, 1)[..., None] * 0.75
    lit = np.array([1.0, 0.76, 0.6]) * (0.75 + 0.35 * glow)
    color = color * (1 - cloud) + lit * cloud
    return bytes_of(color)


def scene(side: int, resolution: tuple[int, int]) -> cltrace.Scene:
    """The land, the lake as a square that mirrors, and the sky on a wall behind the land."""
    vertices, faces, normals, uv, texture = land(side)
    ground = cltrace.Material(ka=0.4, kd=1, ks=0, texture=texture)
    meshes = [cltrace.Mesh(vertices, faces, normals, uv, ground)]

    square, halves = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]), [(0, 1, 2), (0, 2, 3)]
    lake = np.stack([square[:, 0] * 30 - 15, 0 * square[:, 0], 5 - 27 * square[:, 1]], axis=1)
    water = cltrace.Material((0.1, 0.2, 0.24), ka=0.4, kd=0.6, ks=0, reflectance=0.72)
    meshes.append(cltrace.Mesh(lake, halves, material=water))

    wall = np.stack([square[:, 0] * 84 - 42, 36 - square[:, 1] * 38, np.full(4, -40)], axis=1)
    shine = cltrace.Material(ka=1.4, kd=0, ks=0, texture=sky())  # the ambient light alone shows it
    meshes.append(cltrace.Mesh(wall, halves, uv=square * 0.998 + 0.001, material=shine))

    camera = cltrace.Camera((0.6, 1.5, 8.6), (0, 1.35, 0), horizontal_fov=25, resolution=resolution, max_bounces=1)
    lights = [
        cltrace.ambient_light((0.55, 0.63, 0.8)),
        cltrace.parallel_light((1, -0.33, -0.42), (1.45, 1.05, 0.7)),
    ]
    return cltrace.Scene.from_meshes(camera, lights, meshes, output_file="terrain.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", default="terrain.png", help="the picture (default: %(default)s)")
    parser.add_argument("--size", default="800x450", help="of the picture, in pixels (default: %(default)s)")
    parser.add_argument("--side", type=int, default=708, help="heights a side (default: %(default)s)")
    args = parser.parse_args()
    width, height = map(int, args.size.split("x"))
    cltrace.render(scene(args.side, (width, height)), antialias=True, samples=64).save(args.output)


if __name__ == "__main__":
    main()
