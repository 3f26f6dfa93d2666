"""Smooth noise, for the scripts beside it: land, clouds, rock and wood are sums of it."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PRIMES = 73856093, 19349663, 83492791  # which spread the lattice's points over the table of slopes


def noise(points: Floats, seed: int) -> Floats:
    """Perlin's gradient noise, about -0.7 to 0.7 and 0 wherever all coordinates are whole; points: (..., d).

    Each point of the whole numbers' lattice has a random slope, and between them the slopes are blended, smoothly to
    the second derivative.
    """
    axes = np.moveaxis(points, -1, 0)
    slopes = np.random.default_rng(seed).normal(size=(4096, len(axes)))
    slopes /= np.linalg.norm(slopes, axis=1, keepdims=True)
    whole = np.floor(axes).astype(int)
    part = axes - whole
    blend = part**3 * (part * (6 * part - 15) + 10)
    total = np.zeros(points.shape[:-1])
    for corner in itertools.product((0, 1), repeat=len(axes)):
        place = sum((w + c) * p for w, c, p in zip(whole, corner, PRIMES, strict=False))
        place = (place ^ place >> 7) % 4096
        rise = sum(slope[place] * (f - c) for slope, f, c in zip(slopes.T, part, corner, strict=True))
        for b, c in zip(blend, corner, strict=True):
            rise *= b if c else 1 - b
        total += rise
    return total


def layers(points: Floats, count: int, seed: int) -> Floats:
    """Sums octaves of noise, each twice as fine and half as strong as the one before."""
    return sum((noise(points * 2**k, seed + k) / 2**k for k in range(count)), np.zeros(points.shape[:-1]))


def ridges(points: Floats, count: int, seed: int) -> Floats:
    """Sums octaves of ridged noise, 0 to about 1.5; each is strong only where those before it are high."""
    height, weight = np.zeros(points.shape[:-1]), np.ones(points.shape[:-1])
    for k in range(count):
        ridge = (1 - np.minimum(1, 1.6 * abs(noise(points * 2**k, seed + k)))) ** 2
        height += weight * ridge / 2**k
        weight = np.minimum(1, weight * ridge * 3)
    return height


def bytes_of(color: Floats) -> NDArray[np.uint8]:
    """Linear colours, cut off at 0 and 1, as bytes."""
    return np.round(255 * np.clip(color, 0, 1)).astype(np.uint8)
