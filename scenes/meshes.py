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


def curve(points: list[tuple[float, float]], steps: int) -> Floats:
    """A smooth curve through points (Catmull and Rom's), with so many steps between two; (n, 2)."""
    p = np.array([points[0], *points, points[-1]], float)
    t = (np.arange(steps) / steps)[:, None]
    parts = [
        b + t * ((c - a) / 2 + t * (a - 2.5 * b + 2 * c - d / 2 + t * ((d - a) / 2 + 1.5 * (b - c))))
        for a, b, c, d in zip(p, p[1:], p[2:], p[3:], strict=False)
    ]
    return np.concatenate([*parts, p[-1:]])


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    vase = [
        (0.0, 0.04),
        (0.17, 0.04),
        (0.2, 0.0),
        (0.33, 0.2),
        (0.36, 0.42),
        (0.24, 0.66),
        (0.11, 0.82),
        (0.12, 0.95),
        (0.19, 1.0),
    ]
    lathe("vase", "A vase of height 1 that stands on y = 0 and is open at the top", curve(vase[::-1], 3), 24)
    cone = np.array([(0, 1), (0.5, 0), (0.5, 0), (0, 0)])
    lathe("cone", "A cone of height 1 and radius 0.5 that stands on y = 0", cone, 32)
    column = [
        (0, 1),
        (0.16, 1),
        (0.16, 1),
        (0.16, 0.96),
        (0.16, 0.96),
        (0.11, 0.92),
        (0.11, 0.92),
        (0.125, 0.5),
        (0.13, 0.08),
    ]
    column += [(0.13, 0.08), (0.17, 0.05), (0.17, 0.05), (0.17, 0)]
    lathe("column", "A column of height 1 that stands on y = 0", np.array(column), 24)
    ring = np.array([(1, 0), (1.16, 0)])
    lathe("ring", "A flat ring about the y axis, of radii 1 and 1.16; v from the inner edge to the outer", ring, 144)


if __name__ == "__main__":
    main()
