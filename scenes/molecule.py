"""Draws molecule.png: the 60 atoms and 90 bonds of a fullerene, balls and sticks in the light of lights="studio".

python scenes/molecule.py [FILE.png]
"""

from __future__ import annotations

import itertools

import numpy as np
from figure import in_studio, save
from numpy.typing import NDArray

import cltrace

LENGTH = 1.42  # of a bond, in angstrom
GOLDEN = (1 + 5**0.5) / 2


def fullerene() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Places of the atoms, (60, 3), in angstrom, and the pairs that bonds join, (90, 2): a truncated icosahedron."""
    corners = [(0, 1, 3 * GOLDEN), (1, 2 + GOLDEN, 2 * GOLDEN), (GOLDEN, 2, GOLDEN**3)]
    signs = np.array(list(itertools.product((1, -1), repeat=3)))
    places = np.concatenate([np.roll(signs * corner, k, axis=1) for corner in corners for k in range(3)])
    places = np.unique(places.round(9) + 0.0, axis=0) * LENGTH / 2  # the edges of these corners are 2 long
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    first, second = np.nonzero(np.triu(apart < 1.1 * LENGTH, 1))
    return places, np.column_stack([first, second])


def molecule(resolution: tuple[int, int] = (480, 400)) -> cltrace.Scene:
    """Atoms from blue below to orange above. Each half of a bond has the colour of its end."""
    places, bonds = fullerene()
    height = (places[:, 1:2] - places[:, 1].min()) / np.ptp(places[:, 1])
    colors = (1 - height) * (0.1, 0.4, 1.0) + height * (1.0, 0.5, 0.1)
    bare = cltrace.Scene.from_spheres(
        cltrace.Camera(), [], places, 0.4, colors, ks=0.3, exponent=60, background=(1, 1, 1),
        bonds=bonds, bond_radius=0.16,
    )  # fmt: skip
    return in_studio(bare, (0.5, 0.25, 1), resolution)


if __name__ == "__main__":
    save(molecule())
