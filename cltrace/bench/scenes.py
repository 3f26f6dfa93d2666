"""The benchmark's own scenes: what is drawn every day, and what float32 cannot draw.

All cameras look along -z, so that the exact oracle can say what is right (see truth.py). Everything is made from the
same seeds each time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import Scene, ambient_light, point_light

from .cases import looking

Size = tuple[int, int]

ORDINARY, GROUND, FAR, SCALE, MILLION, GIVEN = GROUPS = (
    "ordinary",
    "ground spheres",
    "far from the origin",
    "tiny and huge scales",
    "a million particles",
    "given",
)
GROWTH_SPHERES, GROWTH_PIXELS = "growth with spheres", "growth with pixels"


@dataclass(frozen=True)
class Case:
    """A scene to measure: its name in tables, and the class of scenes that it belongs to."""

    name: str
    group: str
    scene: Scene


def cloud(count: int, size: Size, *more: NDArray[np.void]) -> Scene:
    """Balls in a box in front of the eye, with overlaps, smaller the more there are; one point light, and these."""
    rng = np.random.default_rng(1)
    centers = np.column_stack([rng.uniform(-3, 3, (count, 2)), rng.uniform(-10, -4, count)])
    radii = rng.uniform(0.1, 0.6, count) * (16 / count) ** (1 / 3)
    colors = rng.uniform(0.05, 1, (count, 3))
    # Rounded to what other tracers can read, too.
    centers, radii = centers.astype("f4").astype("f8"), radii.astype("f4").astype("f8")
    lights = [ambient_light((1, 1, 1)), point_light((5, 8, 2)), *more]
    return Scene.from_spheres(
        looking(tan=0.6, size=size), lights, centers, radii, colors, ka=0.1, background=(0.1, 0.1, 0.2)
    )


def filled(size: Size) -> Scene:
    """Eight balls with 50 in each, which nobody sees, and 400 behind the eye, which shadow nothing."""
    rng = np.random.default_rng(2)
    shells = np.array([(x, y, -8) for x in (-3, -1, 1, 3) for y in (-1, 1)], np.float64)
    inner = np.repeat(shells, 50, axis=0) + rng.uniform(-0.4, 0.4, (400, 3))
    behind = rng.uniform(-3, 3, (400, 3)) + (0, -20, 40)
    centers = np.concatenate([shells, inner, behind]).astype("f4").astype("f8")
    radii = np.repeat([0.875, 0.0625, 0.25], [8, 400, 400])
    lights = [ambient_light((1, 1, 1)), point_light((5, 8, 2))]
    colors = rng.uniform(0.05, 1, (len(radii), 3))
    return Scene.from_spheres(
        looking(tan=0.6, size=size), lights, centers, radii, colors, ka=0.1, background=(0.1, 0.1, 0.2)
    )


def field(size: Size, radius: float = 1e3, offset: float = 0, scale: float = 1) -> Scene:
    """84 balls of two sizes on a ground sphere of this radius, moved by about `offset` in each axis, times `scale`."""
    rng = np.random.default_rng(4)
    small = [(x + 0.8 * rng.random(), 0.2, z + 0.8 * rng.random()) for x in range(-5, 4) for z in range(-6, 3)]
    centers = np.array([(0, -radius, 0), (0, 1, 0), (-4, 1, 0), (4, 1, 0), *small])
    radii = np.array([radius, 1, 1, 1, *[0.2] * len(small)])
    colors = np.random.default_rng(5).uniform(0.1, 1, (len(radii), 3))
    move = offset * np.array([1, -0.7, 0.3])
    eye, light = ((scale * (np.array(p) + move)).tolist() for p in ((0, 1.5, 13), (9, 14, 6)))
    return Scene.from_spheres(
        looking(eye, 0.4, size),
        [ambient_light((1, 1, 1)), point_light(light)],
        scale * (centers + move),
        scale * radii,
        colors,
        ka=0.1,
        background=(0.5, 0.7, 1),
    )


def generated(size: Size) -> list[Case]:
    """The default set: a few scenes of each class."""
    return [
        Case("16 balls", ORDINARY, cloud(16, size)),
        Case("100 balls, one light off", ORDINARY, cloud(100, size, point_light((-5, 8, 2), (0, 0, 0)))),
        Case("1,000 balls", ORDINARY, cloud(1000, size)),
        Case("8 balls, filled", ORDINARY, filled(size)),
        *(Case(f"R = {radius:.0e}", GROUND, field(size, radius)) for radius in (1e3, 1e5, 1e7)),
        *(Case(f"moved by {offset:.0e}", FAR, field(size, offset=offset)) for offset in (1e4, 1e6, 1e7)),
        *(Case(f"times {scale:.0e}", SCALE, field(size, scale=scale)) for scale in (1e-6, 1e6, 1e20)),
        Case("1,000,000 balls", MILLION, cloud(1_000_000, size)),
    ]


def few(size: Size) -> list[Case]:
    """What --quick takes of them."""
    return [
        Case("16 balls", ORDINARY, cloud(16, size)),
        Case("R = 1e+05", GROUND, field(size, 1e5)),
        Case("moved by 1e+06", FAR, field(size, offset=1e6)),
    ]


def growing() -> list[Case]:
    """1 to a million balls in one size, and 300 balls in sizes up to 3840x2160."""
    spheres = [Case(f"{10**k:,}", GROWTH_SPHERES, cloud(10**k, (640, 360))) for k in range(7)]
    sizes = [(160 * k, 90 * k) for k in (1, 2, 4, 8, 12, 24)]
    return spheres + [Case(f"{w}x{h}", GROWTH_PIXELS, cloud(300, (w, h))) for w, h in sizes]
