"""Draws studio.png: a random walk of 10,000 steps in the light of lights="studio".

python scenes/studio.py [FILE.png]
"""

from __future__ import annotations

import numpy as np
from figure import in_studio, save

import cltrace


def walk(steps: int = 10_000, resolution: tuple[int, int] = (640, 400)) -> cltrace.Scene:
    """Balls on the way, blue where it starts and orange where it ends."""
    x = np.cumsum(np.random.default_rng(0).normal(size=(steps, 3)), axis=0)
    colors = np.linspace((0.1, 0.4, 1.0), (1.0, 0.6, 0.1), steps)
    bare = cltrace.Scene.from_spheres(cltrace.Camera(), [], x, 1.5, colors, ks=0.2, background=(1, 1, 1))
    return in_studio(bare, (1, 0.3, 1), resolution)


if __name__ == "__main__":
    save(walk())
