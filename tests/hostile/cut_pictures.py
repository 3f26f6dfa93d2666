"""Hostile pictures of balls that planes have cut, with caps and without, and what the exact oracle says of them.

REGIMES has functions of a generator: as those of rod_pictures.py, but of CUT records, which share planes or have their
own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import CUT, Camera, Scene, parallel_light, point_light
from hostile.rod_pictures import Floats, _unit


class Made(NamedTuple):
    """cuts: (n,) CUT without caps; centers: (m, 3) and sizes: (m,), of whole balls; eye, at: (3,); angle: degrees."""

    cuts: NDArray[np.void]
    centers: Floats
    sizes: Floats
    eye: Floats
    at: Floats
    angle: float


def cut(centers: Any, radii: Any, starts: Any, axes: Any) -> NDArray[np.void]:
    """Of balls by planes through the starts; the axes, of any length, lead to what is left of them."""
    c, s, u = (np.asarray(x, float).reshape(-1, 3) for x in (centers, starts, axes))
    out = np.zeros(len(c), CUT)
    out["center"], out["radius"], out["start"] = c, radii, s
    far = np.abs(c - s).sum(axis=1) + 4 * out["radius"]
    length = 2.0 ** (np.frexp(far / np.abs(u).max(axis=1))[1] + 2)
    out["end"] = out["start"] + u * length[:, None]
    return out


def _made(rng: np.random.Generator, cuts: NDArray[np.void], **more: Any) -> Made:
    """Seen from somewhere around the first one, so that this fills the picture."""
    at, size = more.pop("at", cuts["center"][0]), cuts["radius"][0]
    far = 10 ** rng.uniform(0.3, 1.5)
    eye = more.pop("eye", None)
    eye = at + size * far * _unit(rng) if eye is None else eye
    angle = more.pop("angle", np.degrees(np.arctan(1 / far)))
    centers, sizes = more.get("centers", np.empty((0, 3))), more.get("sizes", np.empty(0))
    return Made(cuts, np.asarray(centers, float), np.asarray(sizes, float), np.asarray(eye, float), at, float(angle))


def heap(rng: np.random.Generator) -> Made:
    """Balls that overlap, each with a plane of its own."""
    c, r = rng.normal(size=(12, 3)), 10 ** rng.uniform(-1, 0, 12)
    axes = _unit(rng, 12)
    return _made(rng, cut(c, r, c + axes * (r * rng.uniform(-0.9, 0.9, 12))[:, None], axes))


def packing(rng: np.random.Generator) -> Made:
    """One plane through many, some of them whole, seen through what is left out."""
    c, r, axis = rng.normal(size=(20, 3)), rng.uniform(0.2, 0.8, 20), _unit(rng)
    height = c @ axis
    some = np.abs(height) < r
    whole = height > r
    some[0] = True
    cuts = cut(
        c[some], np.maximum(r, np.abs(height) + 0.1)[some], np.zeros((some.sum(), 3)), np.tile(axis, (some.sum(), 1))
    )
    return _made(rng, cuts, centers=c[whole], sizes=r[whole], eye=-4 * axis + rng.normal(size=3), angle=25.0)


def slivers(rng: np.random.Generator) -> Made:
    """Planes that all but touch the ball: what is left, or what is gone, is down to 1e-6 of it."""
    c, r, axes = rng.normal(size=(6, 3)), rng.uniform(0.3, 1, 6), _unit(rng, 6)
    height = (1 - 10.0 ** -rng.uniform(1, 6, 6)) * rng.choice([-1, 1], 6)
    starts = c + axes * (r * height)[:, None]
    thin = r[0] * np.sqrt(2 * (1 - abs(height[0])))
    at = starts[0] + thin * rng.normal(size=3) * 0.3
    return _made(rng, cut(c, r, starts, axes), at=at, eye=at + 3 * _unit(rng), angle=np.degrees(thin))


def grazing(rng: np.random.Generator) -> Made:
    """Zoomed in on the limb, on the rim, or along the plane."""
    c, r, axis = rng.normal(size=3), 10 ** rng.uniform(-2, 0.3), _unit(rng)
    k = rng.uniform(-0.9, 0.9)
    out = np.cross(axis, _unit(rng))
    out /= np.linalg.norm(out)
    side = np.cross(axis, out)
    rim = c + r * (k * axis + np.sqrt(1 - k * k) * out)
    which = rng.integers(0, 3)
    if which == 0:  # the limb
        n = _unit(rng)
        point, way = c + r * n, np.cross(n, _unit(rng))
    elif which == 1:  # the rim
        point, way = rim, _unit(rng)
    else:  # in the plane
        point, way = c + r * k * axis + rng.uniform(-0.9, 0.9) * r * np.sqrt(1 - k * k) * out, side
    way = way / np.linalg.norm(way)
    narrow = 10.0 ** -rng.uniform(2, 12)
    eye = point - way * 10 ** rng.uniform(-1, 3)
    return _made(rng, cut([c, c + 2 * r * out], [r, r], [c + r * k * axis] * 2, [axis] * 2), at=point, eye=eye,
                 angle=np.degrees(narrow))  # fmt: skip


def inside(rng: np.random.Generator) -> Made:
    """The eye is inside of some of them, or in their planes."""
    c, axes = rng.normal(size=(6, 3)) * 0.2, _unit(rng, 6)
    eye = rng.choice([0, 1]) * c[1] + rng.normal(size=3) * 0.1
    starts = c + axes * rng.uniform(-0.3, 0.3, (6, 1))
    starts[2] = eye
    return _made(rng, cut(c, rng.uniform(0.3, 2, 6), starts, axes), eye=eye, at=eye + _unit(rng), angle=50)


def straight(rng: np.random.Generator) -> Made:
    """Whole numbers: planes along rays, through the eye, across the view; rims that pixels' middles meet exactly."""
    eye = rng.integers(-3, 4, 3).astype(float)
    depth = rng.integers(2, 8, (8, 1)).astype(float)
    c = eye + depth * np.column_stack([rng.integers(-4, 5, (8, 2)) / 8, -np.ones(8)])
    r = rng.integers(1, 9, 8) / 8
    axes = np.eye(3)[rng.integers(0, 3, 8)] * rng.choice([-1.0, 1.0], (8, 1))
    starts = c + axes * (r * rng.integers(-3, 4, 8) / 4)[:, None]
    through = rng.random(8) < 0.3
    starts[through] = eye
    kept = np.abs(((c - starts) * axes).sum(axis=1)) < r
    kept[0], starts[0] = True, c[0]
    return _made(rng, cut(c[kept], r[kept], starts[kept], axes[kept]), eye=eye, at=eye + [0, 0, -1.0], angle=45)


def ties(rng: np.random.Generator) -> Made:
    """Equal ones, nested ones, halves of one ball, and whole ones of the same sphere."""
    c = rng.integers(-2, 3, 3).astype(float)
    axis = rng.integers(-2, 3, 3).astype(float)
    axis = axis if axis.any() else np.array([1.0, 0, 0])
    shift = np.array([0.5, 0, 0])
    return _made(
        rng,
        cut([c, c, c, c, c + shift], [1, 1, 0.5, 1, 1], [c] * 5, [axis, axis, axis, -axis, axis]),
        centers=[c, c + [0, 0, 2.0]] if rng.random() < 0.5 else [c + [0, 0, 2.0]] * 2,
        sizes=[1.0, 1.0],
    )


def far_planes(rng: np.random.Generator) -> Made:
    """The point of the plane is up to 1e6 of a radius away."""
    made = packing(rng)
    cuts = made.cuts.copy()
    u = cuts["end"] - cuts["start"]
    across = np.cross(u, _unit(rng))
    across *= 10 ** rng.uniform(2, 6) / np.linalg.norm(across, axis=1, keepdims=True)
    return made._replace(cuts=cut(cuts["center"], cuts["radius"], cuts["start"] + across, u))


def far_away(rng: np.random.Generator) -> Made:
    """1e7 from the origin."""
    made = (packing if rng.random() < 0.5 else ties)(rng)
    shift = 1e7 * rng.choice([-1.0, 1.0], 3)
    cuts = made.cuts.copy()
    for name in ("center", "start", "end"):
        cuts[name] += shift
    return made._replace(cuts=cuts, centers=made.centers + shift, eye=made.eye + shift, at=made.at + shift)


REGIMES: dict[str, Callable[[np.random.Generator], Made]] = {
    "heap": heap,
    "packing": packing,
    "slivers": slivers,
    "grazing": grazing,
    "inside": inside,
    "straight": straight,
    "ties": ties,
    "far planes": far_planes,
    "far away": far_away,
}


def scene_of(name: str, seed: int, size: tuple[int, int], lights: Any = ()) -> Scene:
    """Half of them have caps."""
    rng = np.random.default_rng([seed, *name.encode()])
    made = REGIMES[name](rng)
    angle = min(max(made.angle, 1e-12), 80.0)
    up = (0.1, 1, 0.2) if name != "straight" else (0, 1, 0)
    camera = Camera(tuple(made.eye), tuple(made.at), up, angle, size)
    scene = Scene.from_spheres(camera, lights, made.centers, made.sizes, ka=1)
    caps = made.cuts[::2].copy()
    caps["flat"] = 1
    cuts = np.concatenate([caps, made.cuts])
    cuts["number"] = len(made.centers) + np.arange(len(cuts))
    cuts["material"] = scene.columns.materials_count
    whole = Scene.from_spheres(camera, lights, [(0, 0, 0)], 1.0, ka=1)
    columns = scene.columns.with_more(whole.materials)
    return scene.with_fields(columns=columns, cuts=cuts)


def lit_of(name: str, seed: int, size: tuple[int, int]) -> Scene:
    """The same in four lights: near some of it, at a rim's plane or within, a parallel one, and one along a plane."""
    scene, rng = scene_of(name, seed, size), np.random.default_rng(seed)
    one, other = scene.cuts[rng.integers(len(scene.cuts))], scene.cuts[rng.integers(len(scene.cuts))]
    axis = one["end"] - one["start"]
    near = one["center"] + rng.normal(size=3) * one["radius"] * 10 ** rng.uniform(-2, 1.5)
    at = other["center"] + rng.choice([0, 1]) * rng.normal(size=3) * other["radius"]
    along = np.cross(axis, rng.normal(size=3))
    points = [point_light(near, (1, 0, 0)), point_light(at, (0, 0.5, 0))]
    along = along / np.abs(along).max()
    return scene.lit_by([*points, parallel_light(rng.normal(size=3), (0, 0, 1)), parallel_light(along, (0, 0.4, 0.01))])
