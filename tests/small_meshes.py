"""Small meshes where it is hard to decide exactly."""

from __future__ import annotations

import numpy as np

from cltrace import Mesh


def grid_mesh(rng: np.random.Generator, count: int = 12) -> Mesh:
    """Triangles between small whole numbers: many share edges and corners, or planes with other things."""
    vertices = rng.integers(-2, 3, (10, 3))
    return Mesh(vertices, rng.integers(0, 10, (count, 3)))


def doubles_mesh(rng: np.random.Generator, offset: float) -> Mesh:
    """Around a corner, and with needles: corners that are all but on the edges of others."""
    vertices = rng.normal(size=(9, 3)) + offset * rng.normal(size=3)
    vertices[5:8] = vertices[0:3] + (vertices[1:4] - vertices[0:3]) * rng.choice([0.5, 0.25, 1 / 3], (3, 1))
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 5, 2], [2, 6, 3], [0, 5, 1], [3, 7, 4], [8, 5, 6]]
    return Mesh(vertices, faces)
