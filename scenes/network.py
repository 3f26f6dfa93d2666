"""Draws network.png: 160 nodes, each of which has chosen older ones that many had chosen, in a studio's light.

python scenes/network.py [FILE.png]
"""

from __future__ import annotations

import numpy as np
from figure import in_studio, save
from numpy.typing import NDArray

import cltrace


def grown(nodes: int) -> NDArray[np.int64]:
    """The pairs of nodes that are joined: each new one with one or two ends of older pairs, so popular ones grow."""
    rng, pairs = np.random.default_rng(7), [(1, 0)]
    for new in range(2, nodes):
        chosen = rng.choice(np.ravel(pairs), rng.integers(1, 3))
        pairs += [(new, int(old)) for old in set(chosen)]
    return np.array(pairs)


def laid_out(pairs: NDArray[np.int64], rounds: int = 300) -> NDArray[np.float64]:
    """Places of the nodes, (n, 3): all push each other away, and pairs pull each other."""
    a, b = pairs.T
    x = np.random.default_rng(1).normal(size=(pairs.max() + 1, 3))
    for k in range(rounds):
        way = x[:, None] - x
        push = (way / (np.square(way).sum(axis=2, keepdims=True) + 0.01)).sum(axis=1)
        pull = x[a] - x[b]
        np.subtract.at(push, a, 2 * pull)
        np.add.at(push, b, 2 * pull)
        far = np.linalg.norm(push, axis=1, keepdims=True)
        x = x + push / far * np.minimum(far, 1) * 0.5 * (1 - k / rounds)
    return x


def network(nodes: int = 160, resolution: tuple[int, int] = (640, 480)) -> cltrace.Scene:
    """Balls, larger and brighter the more others they are joined with; each half of a bond is as its end."""
    pairs = grown(nodes)
    degree = np.bincount(pairs.ravel())
    bare = cltrace.Scene.from_spheres(
        cltrace.Camera(), [], laid_out(pairs), 0.36 * np.cbrt(degree), values=np.log(degree), cmap="plasma", ks=0.2,
        bonds=pairs, bond_radius=0.12, background=(1, 1, 1),
    )  # fmt: skip
    return in_studio(bare, (1, 0.4, 0.7), resolution)


if __name__ == "__main__":
    save(network())
