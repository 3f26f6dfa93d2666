"""Computes the textures of the scenes, and writes them into scenes/textures: a planet, its moon and rings, stars; wood,

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


if __name__ == "__main__":
    main()
