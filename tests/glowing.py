"""Scenes that show where rays go, and a school-book tracer that knows it.

The scenes have white ambient light, ka = 1, and nothing else. What a ray adds to its pixel is then its weight times the
colour of what it meets, or times (1 - r) - t of that where the tree goes on. So a colour tells which things were met,
how often and in what order, to the last bit of a float32.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from hostile.sphere_scenes import AHEAD, Ball, directions, looking
from stress_cases import channel, picture

from cltrace import Camera, Scene, ambient_light
from cltrace.run.devices import Device

Row = Sequence[float]
Part = tuple[float, Row]


# Colours of few binary digits: their sums are exact in float32 as long as the weights are.
A, B, NIGHT = (1.0, 0.5, 0.25), (0.125, 0.75, 0.5), (0.25, 0.0, 0.875)
BLACK, WHITE, RED, GREEN, BLUE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def eye(
    bounces: int, at: Row = (0, 0, 0), tan: float = 0.25, size: tuple[int, int] = (8, 6), axis: Sequence[int] = AHEAD
) -> Camera:
    """A camera that looks along an axis, whose basis is exact, and follows rays so far."""
    return replace(looking(at, tan, size, axis), max_bounces=bounces)


def glowing(
    camera: Camera, spheres: Iterable[Ball], colors: object, background: Row = NIGHT, **material: object
) -> Scene:
    """Spheres that look as their colours say, in white ambient light alone."""
    centers, radii = zip(*spheres, strict=True)
    return Scene.from_spheres(
        camera,
        [ambient_light((1, 1, 1))],
        np.array(centers, float),
        np.array(radii, float),
        colors,  # type: ignore[arg-type]
        ka=1,
        kd=0,
        ks=0,
        background=background,
        **material,  # type: ignore[arg-type]
    )


def total(parts: Iterable[Part]) -> np.ndarray:
    """(3,) float32: contributions (weight, colour), each rounded to whole numbers of 2^-40, and added."""
    units = [sum(int(np.rint(weight * color[k] * 2.0**40)) for weight, color in parts) for k in range(3)]
    return np.array([float(Fraction(n, 2**40)) for n in units], np.float32)


def show(scene: Scene, device: Device, precision: str = "accurate", **more: object) -> np.ndarray:
    """(n, 3) float32: the linear colours of the picture, row by row."""
    return channel(picture(scene, device, precision, **more), "color")  # type: ignore[arg-type]


@dataclass(frozen=True)
class Beams:
    """n rays in long double: points p (n, 3), unit directions d (n, 3). A school-book tracer, which knows its way."""

    p: np.ndarray
    d: np.ndarray

    @classmethod
    def of(cls, camera: Camera) -> Beams:
        """The rays of a camera's pixels."""
        d = directions(camera).astype(np.longdouble)
        return cls(np.broadcast_to(np.array(camera.position, np.longdouble), d.shape), scaled(d))

    def at(self, way: object) -> np.ndarray:
        """The points so far along."""
        return self.p + np.reshape(np.asarray(way, np.longdouble), (-1, 1)) * self.d

    def meet(
        self, center: Row, radius: float, far: bool = False, K: object = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    ) -> tuple[Beams, np.ndarray]:
        """Where they enter { x: |K (x - center)| = radius }, or leave it if far, and the unit normals outwards."""
        K = np.asarray(K, np.longdouble)
        f, w = (np.asarray(center, np.longdouble) - self.p) @ K.T, self.d @ K.T
        a, b = (w * w).sum(axis=1), (f * w).sum(axis=1)
        across = f - (b / a)[:, None] * w
        half = np.sqrt((np.longdouble(radius) ** 2 - (across * across).sum(axis=1)) / a)
        assert np.isfinite(half).all()
        p = self.at(b / a + (half if far else -half))
        return Beams(p, self.d), scaled(((p - np.asarray(center, np.longdouble)) @ K.T) @ K)

    def mirrored(self, n: np.ndarray) -> Beams:
        """The angle of reflection is that of incidence."""
        return Beams(self.p, scaled(self.d - 2 * (n * self.d).sum(axis=1)[:, None] * n))

    def bent(self, n: np.ndarray, index: float) -> Beams:
        """Snell's law by its angles: sin(o) = sin(i) / index. n: unit normals, of either side."""
        cosine = (n * self.d).sum(axis=1)
        along = self.d - cosine[:, None] * n
        sine = np.sqrt((along * along).sum(axis=1))
        o = np.arcsin(sine / np.longdouble(index))
        assert np.isfinite(o).all()
        tangent = along / sine[:, None]
        return Beams(self.p, np.cos(o)[:, None] * np.sign(cosine)[:, None] * n + np.sin(o)[:, None] * tangent)


def scaled(v: np.ndarray) -> np.ndarray:
    """Rows of length 1."""
    return np.asarray(v / np.sqrt((v * v).sum(axis=1))[:, None])


def peas(points: np.ndarray, radius: float = 1e-9) -> list[Ball]:
    """Balls so small that only who aims at them hits them."""
    return [(p, radius) for p in points.astype(float).tolist()]


def shades(count: int, seed: int = 0) -> np.ndarray:
    """(count, 3): colours of 6 binary digits, none of them black."""
    return np.asarray(np.random.default_rng(seed).integers(1, 65, (count, 3)) / 64)


def targets(
    camera: Camera,
    things: Sequence[Ball],
    points: Sequence[np.ndarray],
    radius: float = 1e-9,
    transform: np.ndarray | None = None,
    **material: object,
) -> tuple[Scene, list[np.ndarray]]:
    """A scene of things, which are of colour BLACK, and of a pea for each pixel and each of `points`.

    Returns the colours of the peas, too, as those of `points`. The material is that of the things, one value for all or
    one for each; peas are opaque, and with t = 0 their index is 0, as in most files. transform: of the things.
    """
    count, n = len(things), len(points[0])
    colors = [shades(n, seed) for seed in range(len(points))]
    every = [*things, *(pea for group in points for pea in peas(group, radius))]
    values = {}
    for name, value in material.items():
        values[name] = np.zeros(len(every))
        values[name][:count] = value
    shown = np.concatenate([np.zeros((count, 3)), *colors])
    maps = None if transform is None else np.array([transform] * count + [np.eye(3)] * (len(every) - count))
    return glowing(camera, every, shown, BLACK, transform=maps, **values), colors


def turned(center: Row, beams: Beams, angle: np.ndarray) -> Beams:
    """The rays' lines, turned about a point in the plane of both: towards it if the angle is positive. rad."""
    C = np.asarray(center, np.longdouble)
    foot = beams.at(((C - beams.p) * beams.d).sum(axis=1))
    b = np.sqrt(((C - foot) ** 2).sum(axis=1))[:, None]
    e, cos, sin = (C - foot) / b, np.cos(angle)[:, None], np.sin(angle)[:, None]
    return Beams(C - b * (e * cos - beams.d * sin), beams.d * cos + e * sin)


def passes(center: Row, beams: Beams) -> np.ndarray:
    """How far from a point the rays' lines pass it."""
    f = np.asarray(center, np.longdouble) - beams.p
    across = f - (f * beams.d).sum(axis=1)[:, None] * beams.d
    return np.asarray(np.sqrt((across * across).sum(axis=1)))
