"""Writes sculpture.obj, floor.obj and sculpture.xml: a lamp of a million triangles, and the floor on which it shines.

    python scenes/sculpture.py FOLDER
    cltrace FOLDER/sculpture.xml

`--grid 40` makes a lamp of 70,000 triangles, which is drawn as fast and looks coarse from near by.

The lamp is a thick hollow ball with holes, and a light in its middle throws them on the floor. The holes are where a
sum of three plane waves is high, whose vectors are 120 degrees apart: that is a lattice of triangles. It lies on
Mercator's map of the ball, which keeps angles, so holes are round and get smaller towards the axis, along spirals.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RADIUS, DEPTH = 0.96, 0.04  # of the sphere in the middle of the lamp's wall, and half of its thickness; scene units
AROUND = np.array([8, 13, -21])  # how often each of three waves goes around the ball
SQUARE = 2 / 3 * (AROUND @ AROUND)  # of the length of each wave's vector on the map
UP = np.sqrt(SQUARE - AROUND**2) * (1, -1, -1)  # radians of each wave in a unit of the map's height
HOLE, RIM = -0.6, 0.5  # a hole is where the sum of the waves is above HOLE + RIM; from HOLE on, its edge is rounded
CAP = 0.4  # no holes closer to the axis; scene units


def inside(points: Floats) -> Floats:
    """Negative inside of the lamp, positive outside, and smooth; points: (n, 3), result: (n,)."""
    x, y, z = points.T
    radius = np.linalg.norm(points, axis=1) + 1e-9
    longitude, height = np.arctan2(x, z), np.arctanh(np.clip(y / radius, -0.999, 0.999))
    waves = sum(np.cos(a * longitude + u * height) for a, u in zip(AROUND, UP, strict=True))
    waves -= 20 * np.maximum(0, CAP - np.hypot(x, z) / radius)
    distance: Floats = np.hypot(np.maximum(0, waves - HOLE) / RIM, (radius - RADIUS) / DEPTH) - 1
    return distance


def gradient(points: Floats) -> Floats:
    """The gradient of `inside`, by central differences; (n, 3)."""
    step = 1e-4
    slope = np.stack([inside(points + e) - inside(points - e) for e in step * np.eye(3)], axis=1)
    return slope / (2 * step)


# The six tetrahedra of a cube around its diagonal from corner 0 to corner 7; corner 4 i + 2 j + k is at (i, j, k).
TETRAHEDRA = np.array([(0, 4, 6, 7), (0, 6, 2, 7), (0, 2, 3, 7), (0, 3, 1, 7), (0, 1, 5, 7), (0, 5, 4, 7)])


def surface(grid: int) -> tuple[Floats, Ints]:
    """The surface where `inside` is 0, from a grid of so many cells a side: vertices (v, 3) and faces (f, 3).

    Marching tetrahedra: each cube is cut into six, and each of them has none, one or two triangles, whose corners are
    where its edges cross the surface. Neighbours share edges, so they share vertices, and the mesh is closed.
    """
    n = grid + 1
    line = np.linspace(-1, 1, n) * (RADIUS + 1.2 * DEPTH)
    value = np.concatenate([inside(_plane(x, line)) for x in line])
    shift = np.array([n * n * i + n * j + k for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    cell = np.arange(n**3).reshape(n, n, n)[:-1, :-1, :-1].ravel()
    within = value < 0
    filled = sum(within[cell + s].astype(int) for s in shift)
    corners = cell[(filled > 0) & (filled < 8)][:, None] + shift  # of the cubes that the surface passes

    tetrahedra = corners[:, TETRAHEDRA].reshape(-1, 4)
    triangles = np.concatenate(list(_crossings(tetrahedra, within)))  # (f, 3, 2): each corner an edge of the grid
    ends = np.sort(triangles.reshape(-1, 2), axis=1)
    edges, faces = np.unique(ends[:, 0] * n**3 + ends[:, 1], return_inverse=True)
    a, b = edges // n**3, edges % n**3
    share = (value[a] / (value[a] - value[b]))[:, None]
    start, end = (np.stack([line[p // n**2], line[p // n % n], line[p % n]], axis=1) for p in (a, b))
    return start + share * (end - start), faces.reshape(-1, 3)


def _plane(x: float, line: Floats) -> Floats:
    """The points (x, y, z) of a plane of the grid; (n * n, 3)."""
    y, z = np.meshgrid(line, line, indexing="ij")
    return np.stack([np.full(y.size, x), y.ravel(), z.ravel()], axis=1)


def _crossings(tetrahedra: Ints, within: NDArray[np.bool_]) -> Iterator[Ints]:
    """Yields the triangles of tetrahedra (n, 4) of grid points as (f, 3, 2): the ends of the edge of each corner.

    They are wound one way or the other: the front of a triangle is where the normals of its corners point.
    """
    code = within[tetrahedra] @ np.array([1, 2, 4, 8])
    for mask in range(1, 15):
        some = tetrahedra[code == mask]
        inner = [i for i in range(4) if mask >> i & 1]
        outer = [i for i in range(4) if not mask >> i & 1]
        if len(inner) == 1 or len(outer) == 1:
            (tip,), base = (inner, outer) if len(inner) == 1 else (outer, inner)
            yield some[:, [(tip, p) for p in base]]
        else:
            (a, b), (c, d) = inner, outer
            yield some[:, [(a, c), (a, d), (b, d)]]
            yield some[:, [(a, c), (b, d), (b, c)]]


def write_obj(path: Path, vertices: Floats, normals: Floats, faces: Ints) -> None:
    """An OBJ file with a normal for each vertex."""
    with path.open("w", encoding="ascii") as file:
        for word, rows in ("v", vertices), ("vn", normals):
            file.write((f"{word} %.6f %.6f %.6f\n" * len(rows)) % tuple(rows.ravel().tolist()))
        corners = np.repeat(faces + 1, 2, axis=1)  # a vertex and its normal have the same number
        file.write(("f %d//%d %d//%d %d//%d\n" * len(faces)) % tuple(corners.ravel().tolist()))


FLOOR = """\
v -40 0 -40
v -40 0 40
v 40 0 40
v 40 0 -40
f 1 2 3 4
"""

XML = """\
<?xml version="1.0" standalone="no" ?>
<!DOCTYPE scene SYSTEM "scene.dtd">
<scene output_file="sculpture.png">
  <background_color r="0" g="0" b="0"/>
  <camera>
    <position x="0.3" y="4.6" z="6"/>
    <lookat x="0.3" y="0.55" z="0"/>
    <up x="0" y="1" z="0"/>
    <horizontal_fov angle="22"/>
    <resolution horizontal="1600" vertical="900"/>
    <max_bounces n="2"/>
  </camera>
  <lights>
    <ambient_light><color r="0.55" g="0.7" b="1"/></ambient_light>
    <point_light>
      <color r="1" g="0.62" b="0.28"/>
      <position x="0" y="1" z="0"/>
    </point_light>
    <spot_light>
      <color r="0.55" g="0.7" b="1"/>
      <position x="-5" y="6" z="5"/>
      <direction x="5" y="-5" z="-5"/>
      <falloff alpha1="6" alpha2="24"/>
    </spot_light>
  </lights>
  <surfaces>
    <mesh name="sculpture.obj">
      <material_solid>
        <color r="0.9" g="0.88" b="0.85"/>
        <phong ka="0.12" kd="0.85" ks="0.35" exponent="40"/>
        <reflectance r="0"/> <transmittance t="0"/> <refraction iof="0"/>
      </material_solid>
      <transform><translate x="0" y="1" z="0"/><rotateZ theta="-12"/></transform>
    </mesh>
    <mesh name="floor.obj">
      <material_solid>
        <color r="0.85" g="0.85" b="0.9"/>
        <phong ka="0.1" kd="0.8" ks="0" exponent="1"/>
        <reflectance r="0.12"/> <transmittance t="0"/> <refraction iof="0"/>
      </material_solid>
    </mesh>
  </surfaces>
</scene>
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the files go; made if need be")
    parser.add_argument("--grid", type=int, default=147, help="cells a side (default: %(default)s)")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    vertices, faces = surface(args.grid)
    write_obj(args.folder / "sculpture.obj", vertices, gradient(vertices), faces)
    (args.folder / "floor.obj").write_text(FLOOR, "ascii")
    (args.folder / "sculpture.xml").write_text(XML, "ascii")
    print(f"{len(faces):,} triangles")


if __name__ == "__main__":
    main()
