"""How far pictures in soft light are from those in all of it: the table of docs/accuracy.md.

.venv/bin/python tests/soft_lights.py prints it. The truth is 16,384 directions, a Fibonacci lattice as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import cltrace
from cltrace.scene import Scene, members_of

MOST = 16_384
NUMBERS = (16, 64, 256, 1024)


def scene() -> Scene:
    """300 balls that lie about and above a floor, and nothing but what is asked for to light them."""
    random = np.random.default_rng(0)
    balls = np.concatenate([random.normal(size=(300, 3)) * (1.5, 0.8, 1.5) + (0, 2, 0), [(0, -1000, 0)]])
    camera = cltrace.Camera((0, 4, 12), (0, 1.5, 0), horizontal_fov=18, resolution=(160, 120))
    radii = np.append(np.full(300, 0.25), 1000)
    return Scene.from_spheres(camera, [], balls, radii, (0.9, 0.9, 0.9), ka=0, ks=0)


def directions(light: NDArray[np.void]) -> NDArray[np.float64]:
    """(n, 3): from where the members of a sky shine."""
    return np.asarray(-members_of(light[0])["direction"])


def random_directions(n: int, seed: int) -> NDArray[np.float64]:
    found = np.random.default_rng(seed).normal(size=(n, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])


def colors(bare: Scene, towards: NDArray[np.float64]) -> NDArray[np.float64]:
    """(h, w, 3): linear colours in the light of directions (n, 3), which add up to a sky of 4, in many pictures."""
    total = np.zeros((*bare.camera.resolution[::-1], 3))
    for some in np.split(towards, range(1024, len(towards), 1024)):
        lights = [cltrace.parallel_light(-w, (4.0 / len(towards),) * 3) for w in some]
        total += cltrace.render(bare.lit_by(lights), outputs=("color",)).color
    return np.minimum(total, 1)


def many(n: int) -> NDArray[np.float64]:
    """The Fibonacci lattice of a whole sky, also with more members than a light may have."""
    light = cltrace.sky_light((4.0, 4.0, 4.0))
    light["members"] = n
    return directions(light)


def levels_off(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Root mean square, in levels of 255."""
    return 255 * float(np.sqrt(np.mean((a - b) ** 2)))


def table(most: int = MOST, numbers: tuple[int, ...] = NUMBERS) -> dict[int, tuple[float, float]]:
    """By the number of directions: what the lattice is off by, and what random directions are, of four draws."""
    bare = scene()
    truth = colors(bare, many(most))
    found = {}
    for n in numbers:
        drawn = [levels_off(colors(bare, random_directions(n, seed)), truth) for seed in range(4)]
        found[n] = levels_off(colors(bare, many(n)), truth), float(np.sqrt(np.mean(np.square(drawn))))
    return found


if __name__ == "__main__":
    for n, (lattice, drawn) in table().items():
        print(f"| {n:,} | {lattice:.2g} | {drawn:.2g} |")
