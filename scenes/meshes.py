"""Writes the small meshes of the scenes into scenes/meshes: flat things by hand, round ones turned on a lathe.

python scenes/meshes.py
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FOLDER = Path(__file__).parent / "meshes"


def write(name: str, lines: Iterable[str]) -> None:
    (FOLDER / f"{name}.obj").write_text("".join(f"{line}\n" for line in lines), "ascii")


def text(word: str, rows: Floats) -> list[str]:
    """A line for each row: a word and numbers of at most five places."""
    return [" ".join([word, *(f"{round(x, 5) + 0:g}" for x in row)]) for row in rows.tolist()]


def lathe(name: str, note: str, profile: Floats, sides: int, smooth: bool = True) -> None:
    """A profile (n, 2) of radius and height, turned about the y axis, in quads; u goes around and v down the profile.

    smooth: with a normal at each vertex. Where the profile has a point twice in a row, it has an edge there.
    """
    turn = 2 * np.pi * np.arange(sides) / sides
    around = np.stack([np.sin(turn), np.cos(turn)], axis=1)
    step = np.diff(profile, axis=0)
    length = np.linalg.norm(step, axis=1, keepdims=True)
    across = np.divide(step, length, out=np.zeros_like(step), where=length > 0) @ np.array([[0, 1], [-1, 0]])
    normal = np.concatenate([across[:1], across[:-1] + across[1:], across[-1:]])

    def turned(rows: Floats) -> Floats:
        out, up = rows.T
        x, z = out[:, None] * around[:, 0], out[:, None] * around[:, 1]
        return np.stack([x, np.broadcast_to(up[:, None], x.shape), z], axis=-1).reshape(-1, 3)

    lines = [f"# {note}", *text("v", turned(profile))]
    v = np.concatenate([[0], np.cumsum(length)]) / length.sum()
    u = np.arange(sides + 1) / sides
    lines += text("vt", np.stack([np.tile(u, len(v)), np.repeat(v, sides + 1)], axis=1))
    if smooth:
        lines += text("vn", turned(normal / np.linalg.norm(normal, axis=1, keepdims=True)))
    for i in np.flatnonzero(length[:, 0]).tolist():
        for k in range(sides):
            corners = [(i + p, k + q) for p, q in ((0, 0), (1, 0), (1, 1), (0, 1))]
            if profile[i, 0] == 0:
                corners.pop(3)
            if profile[i + 1, 0] == 0:
                corners.pop(2)
            place = [(1 + p * sides + q % sides, 1 + p * (sides + 1) + q) for p, q in corners]
            lines.append("f " + " ".join(f"{a}/{b}/{a}" if smooth else f"{a}/{b}" for a, b in place))
    write(name, lines)


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    ring = np.array([(1, 0), (1.16, 0)])
    lathe("ring", "A flat ring about the y axis, of radii 1 and 1.16; v from the inner edge to the outer", ring, 144)


if __name__ == "__main__":
    main()
