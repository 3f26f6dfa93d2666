"""Meshes that tests are made of."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from glowing import RED, WHITE
from hostile.mesh_regimes import round_mesh
from hostile.sphere_scenes import directions
from stress_cases import channel

from cltrace import Camera, Image, Material, Mesh, Scene, ambient_light

Row = Sequence[float]


class Solid(NamedTuple):
    """vertices: (v, 3); faces: (f, 3), seen from the front counter-clockwise."""

    vertices: np.ndarray
    faces: np.ndarray

    def moved(self, by: Row = (0, 0, 0), factor: float = 1) -> Solid:
        """Scaled about the origin, then moved."""
        return Solid(self.vertices * factor + np.asarray(by, float), self.faces)

    def flipped(self) -> Solid:
        """The same, wound the other way."""
        return Solid(self.vertices, np.ascontiguousarray(self.faces[:, ::-1]))

    def unshared(self) -> Solid:
        """The same, with three vertices of its own for every face."""
        return Solid(self.vertices[self.faces].reshape(-1, 3), np.arange(3 * len(self.faces)).reshape(-1, 3))


def joined(*solids: Solid) -> Solid:
    """Several as one."""
    starts = np.cumsum([0, *(len(s.vertices) for s in solids)])
    faces = [s.faces + start for s, start in zip(solids, starts, strict=False)]
    return Solid(np.concatenate([s.vertices for s in solids]), np.concatenate(faces))


def box(low: Row = (-1, -1, -1), high: Row = (1, 1, 1)) -> Solid:
    """Twelve faces, two a side, their fronts outside."""
    sides = np.array([low, high], float)
    vertices = np.array([[sides[k][i] for i, k in enumerate(which)] for which in itertools.product((0, 1), repeat=3)])
    # Vertex 4 x + 2 y + z. Each side as a quad, counter-clockwise from outside.
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Solid(vertices, np.array([(q[0], q[k], q[k + 1]) for q in quads for k in (1, 2)]))


def octahedron() -> Solid:
    return ball(0)


def tetrahedron() -> Solid:
    vertices = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
    return Solid(vertices, np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]))


def ball(level: int = 2) -> Solid:
    """An octahedron whose faces are split into four so often, with its vertices on the unit sphere."""
    return Solid(*round_mesh(level))


def sheet(columns: np.ndarray, rows: np.ndarray, height: np.ndarray) -> Solid:
    """A surface over a grid: the vertices (columns[i], rows[j], height[j, i]), two faces a cell."""
    x, y = np.meshgrid(columns, rows)
    n = len(columns)
    k = (np.arange(len(rows) - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + n + 1], 1), np.stack([k, k + n + 1, k + n], 1)])
    return Solid(np.stack([x, y, height], -1).reshape(-1, 3).astype(float), faces)


# --- scenes of them

# Tangents for which the directions of 32 x 24 pixels have 7 binary digits.
NARROW, WIDE = 0.25, 1.5
SIZE = (32, 24)


def mesh(solid: Solid, **more: object) -> Mesh:
    return Mesh(solid.vertices, solid.faces, **more)  # type: ignore[arg-type]


def glow(color: Row = WHITE, **more: float) -> Material:
    """What looks as its colour says in white ambient light."""
    return Material(color=color, ka=1, kd=0, ks=0, **more)  # type: ignore[arg-type]


def glowing(camera: Camera, *solids: Solid, material: Material, background: Row = RED) -> Scene:
    meshes = [mesh(solid, material=material) for solid in solids]
    return Scene.from_meshes(camera, [ambient_light(WHITE)], meshes, background=background)


def needles(seed: int) -> Solid:
    """Triangles of length 1 and 1e-1 .. 1e-12 wide, seen from anywhere."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-1, 1, (2, 60, 3))
    c = a + (b - a) * rng.uniform(0, 1, (60, 1)) + rng.normal(size=(60, 3)) * 10.0 ** -np.linspace(1, 12, 60)[:, None]
    return Solid(np.stack([a, b, c], 1).reshape(-1, 3), np.arange(180).reshape(-1, 3))


def lattice(seed: int, side: int = 3, count: int = 120) -> Solid:
    """Triangles whose corners are small whole numbers: many have no area, lie in one plane, share edges, or twice."""
    rng = np.random.default_rng(seed)
    points = np.array(list(itertools.product(range(-side, side + 1), repeat=3)), float)
    return Solid(points, rng.integers(0, len(points), (count, 3)))


def places(camera: Camera, image: Image) -> np.ndarray:
    """(n, 3): what the pixels show, in the world; the eye for nothing."""
    w, depth = directions(camera), channel(image, "depth")
    t = np.where(np.isfinite(depth), depth, 0) / np.linalg.norm(w, axis=1)
    return np.asarray(camera.position + w * t[:, None])


def smooth(solid: Solid, **more: object) -> Mesh:
    """With the directions of its vertices from the origin as their normals."""
    return Mesh(solid.vertices, solid.faces, normals=solid.vertices, **more)  # type: ignore[arg-type]
