"""Computes the textures of the scenes, and writes them into scenes/textures: what a planet needs, and
what a room needs.

python scenes/textures.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from noise import Floats, bytes_of, layers, ridges
from PIL import Image

FOLDER = Path(__file__).parent / "textures"


def directions(height: int) -> Floats:
    """The direction from a ball's middle to each texel of its texture; (height, 2 height, 3), of length 1."""
    polar = np.pi * np.arange(height) / height
    around = 2 * np.pi * (np.arange(2 * height) / (2 * height) - 0.5)
    y = np.broadcast_to(np.cos(polar)[:, None], (height, 2 * height))
    return np.stack([np.outer(np.sin(polar), np.sin(around)), y, np.outer(np.sin(polar), np.cos(around))], axis=-1)


def lay(color: Floats, over: tuple[float, float, float], share: Floats) -> None:
    """Lays a colour over those of an array (..., 3), where share (...) is 1 all of it, and where it is 0 none."""
    share = np.clip(share, 0, 1)[..., None]
    color[:] = color * (1 - share) + np.array(over) * share


def planet(height: int = 512) -> Floats:
    """Seas, shelves, forests, deserts, ice, and clouds above; (height, 2 height, 3)."""
    place = directions(height)
    bent = 1.3 * place + 0.35 * np.stack([layers(1.6 * place, 4, seed) for seed in (1, 2, 3)], axis=-1)
    land = layers(bent, 9, 11) + 0.04
    far = abs(place[..., 1]) + 0.1 * layers(4 * place, 5, 70)  # from the equator, 0 to 1
    dry = layers(2.2 * place, 6, 30) + 0.35 - 2.6 * abs(far - 0.36)
    hills = ridges(4 * place, 6, 40)

    color = np.empty(place.shape)
    color[:] = (0.015, 0.06, 0.2)
    lay(color, (0.03, 0.22, 0.36), 1 + 7 * land)
    lay(color, (0.08, 0.42, 0.45), 1 + 30 * land)
    shore = 200 * land
    lay(color, (0.1, 0.26, 0.06), shore)
    lay(color, (0.62, 0.47, 0.24), np.minimum(shore, 3 * dry + 0.2))
    lay(color, (0.36, 0.27, 0.17), np.minimum(shore, 3 * (land + 0.3 * hills - 0.5)))
    lay(color, (0.92, 0.95, 1.0), 14 * (far - 0.9 + 0.15 * np.clip(land, -0.3, 0.3)))

    swirl = 1.5 * place + 0.5 * np.stack([layers(2 * place, 5, seed) for seed in (4, 5, 6)], axis=-1)
    cloud = layers(swirl * (1, 2.2, 1), 8, 50)
    lay(color, (0.95, 0.95, 0.95), np.minimum(0.9, 3.5 * (cloud - 0.12)))
    return color


def moon(height: int = 128) -> Floats:
    """Grey plains, and craters with bright rims; (height, 2 height, 3)."""
    place = directions(height)
    grey = 0.55 + 0.5 * layers(2.5 * place, 6, 5)
    random = np.random.default_rng(3)
    for _ in range(90):
        middle = random.normal(size=3)
        size = 0.05 * random.pareto(2.5) + 0.03
        away = np.arccos(np.clip(place @ (middle / np.linalg.norm(middle)), -1, 1)) / min(size, 0.3)
        grey += 0.2 * np.exp(-(((away - 1) / 0.2) ** 2)) - 0.15 * (away < 0.9)
    return grey[..., None] * np.array([0.85, 0.82, 0.78])


def rings(height: int = 256) -> Floats:
    """A planet's ring, from its inner edge at the top to the outer one; (height, 1, 3)."""
    v = np.linspace(0, 1, height)[:, None, None]
    return (0.72 + 0.9 * layers(6 * v, 5, 8))[..., None] * np.array([0.95, 0.82, 0.62])


def stars(width: int = 1024, height: int = 576) -> Floats:
    """Stars, more along a band of faint light; (height, width, 3)."""
    y, x = np.mgrid[0:height, 0:width] / height
    across = (y - 0.75 + 0.45 * x) / 0.3
    band = np.exp(-(across**2)) * np.clip(0.6 + 1.3 * layers(np.stack([3 * x, 3 * y], axis=-1), 7, 9), 0, 2)
    color = band[..., None] * np.array([0.1, 0.085, 0.13])
    random = np.random.default_rng(12)
    for _ in range(1500):
        i, j = random.integers(height), random.integers(width)
        if random.uniform() < 0.35 + 0.6 * band[i, j]:
            color[i, j] += min(1, 0.25 / random.uniform(0.1, 1) ** 2) * random.uniform((0.7, 0.7, 0.75), 1)
    return color


def planks(size: int = 512, count: int = 8) -> Floats:
    """A floor of planks that repeats in both directions, each plank with one joint; (size, size, 3)."""
    y, x = np.mgrid[0:size, 0:size] / size
    plank = np.floor(y * count).astype(int)
    random = np.random.default_rng(2)
    along = (x - random.uniform(size=count)[plank]) % 1
    across = (y * count) % 1
    place = np.stack([3 * along, across + 7 * plank, 0 * x], axis=-1)
    rings = np.sin(2 * np.pi * (2.2 * across + 3.5 * layers(place * (0.35, 0.5, 1), 3, 4)))
    grain = 0.11 * rings + 0.3 * layers(place * (6, 30, 1), 3, 6)
    shade = (1 + grain) * random.uniform(0.75, 1.1, count)[plank]
    gap = np.minimum(np.minimum(across, 1 - across) / 0.035, np.minimum(along, 1 - along) / 0.004)
    shade *= 0.35 + 0.65 * np.clip(gap, 0, 1)
    return shade[..., None] * np.array([0.58, 0.36, 0.19])


def rug(width: int = 192, height: int = 288) -> Floats:
    """A woven rug: diamonds within a border; (height, width, 3)."""
    y, x = np.mgrid[0:height, 0:width]
    edge = np.minimum(np.minimum(x, width - 1 - x), np.minimum(y, height - 1 - y))
    i, j = abs(x - (width - 1) / 2) // 4, abs(y - (height - 1) / 2) // 4  # in stitches of 4 texels, from the middle
    diamond = ((i + j) // 3 % 6).astype(int)
    thread = np.array(
        [
            (0.5, 0.07, 0.07),
            (0.5, 0.07, 0.07),
            (0.72, 0.55, 0.3),
            (0.09, 0.12, 0.3),
            (0.72, 0.55, 0.3),
            (0.5, 0.07, 0.07),
        ]
    )
    color = thread[diamond]
    color[edge < 32] = (0.09, 0.12, 0.3)
    zigzag = abs((x + y) // 4 % 8 - 4) + abs((x - y) // 4 % 8 - 4) < 4
    color[(edge < 26) & (edge >= 8) & zigzag] = (0.75, 0.6, 0.38)
    color[edge < 4] = (0.72, 0.62, 0.5)
    return color * (0.9 + 0.1 * ((x + y) % 2))[..., None]


def checks(count: int = 4, texels: int = 16) -> Floats:
    """Light and dark squares, the first one light; (count texels, count texels, 3)."""
    y, x = np.mgrid[0 : count * texels, 0 : count * texels] // texels
    return np.where(((x + y) % 2)[..., None], (0.2, 0.24, 0.3), (0.9, 0.88, 0.8))


def stripes(texels: int = 8) -> Floats:
    """The six colours of a beach ball, one row; (1, 6 texels, 3)."""
    return np.repeat(
        [[(0.9, 0.2, 0.2), (0.9, 0.9, 0.9), (0.2, 0.4, 0.9), (0.9, 0.9, 0.9), (1.0, 0.8, 0.2), (0.9, 0.9, 0.9)]],
        texels,
        axis=1,
    )


def write(name: str, color: Floats, colors: int | None = 256) -> None:
    """Writes a PNG, with a palette of so many colours."""
    image = Image.fromarray(bytes_of(color))
    if colors is not None:
        image = image.quantize(colors, dither=Image.Dither.FLOYDSTEINBERG)
    image.save(FOLDER / f"{name}.png", optimize=True)


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    write("planet", planet())
    write("moon", moon(), 32)
    write("rings", rings())
    write("stars", stars(), None)
    write("checks", checks(), None)
    write("stripes", stripes(), None)
    write("planks", planks(), 64)
    write("rug", rug(), 16)


if __name__ == "__main__":
    main()
