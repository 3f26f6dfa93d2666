"""The stability report: the stress catalogue, case by case, with what is required and what came out.

G big spheres, T tiny ones, O offsets, K scales, X the ends of the range, R degenerate spheres, D rays, I inside and on
the surface, L lights and shadows, C cameras, P highlights, N what is refused; and the hostile regimes of regimes.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Protocol

import numpy as np

from cltrace.renderer import default_precision
from cltrace.run.devices import Device
from cltrace.scene import Camera, Scene, ambient_light, parallel_light, point_light, spot_light

from .cases import (
    AHEAD,
    AXES,
    BACK,
    RIGHT,
    Ball,
    aimed,
    balls,
    between_doubles,
    directions,
    everything,
    frame,
    limbs,
    lit,
    looking,
    ulp32,
    unit,
)
from .errors import Errors, compare
from .regimes import REGIMES, TANGENT, globe
from .report import number
from .tracers import Baseline, Product
from .truth import Answer, answer

Scenes = Callable[[], Iterable[Scene]]

# Per scene; what a picture of this many pixels must be is known exactly for all of them.
PIXELS = 300


@dataclass(frozen=True)
class Limits:
    """What is required: the largest value that each of the fields of Errors may have; None: not looked at.

    same: pixels of a scene that may differ from the case's first scene, which is the same one moved or scaled.
    """

    wrong_ids: int | None = 0
    t_ulp: float | None = 0.52
    normal: float | None = 1e-7
    false_shadows: int | None = 0
    leaks: int | None = 0
    bytes_off: int | None = 0
    not_finite: int = 0
    same: int | None = None


GEOMETRY = Limits(false_shadows=None, leaks=None, bytes_off=None)
SHADOWS = Limits()
SAME = Limits(same=0)


@dataclass(frozen=True)
class Found:
    """What came out of a case: sums and maxima over its scenes, of as many pixels."""

    pixels: int
    wrong_ids: int
    t_ulp: float
    normal: float
    false_shadows: int
    leaks: int
    bytes_off: int
    not_finite: int
    same: int

    def within(self, limits: Limits) -> bool:
        """Whether that is what is required."""
        bounds = {f.name: getattr(limits, f.name) for f in fields(limits)}
        return all(most is None or getattr(self, name) <= most for name, most in bounds.items())


@dataclass(frozen=True)
class Case:
    """One case: its name in the catalogue, what it is, its scenes, and what is required of their pictures."""

    name: str
    what: str
    scenes: Scenes
    limits: Limits = GEOMETRY


@dataclass(frozen=True)
class Refusal:
    """Something that must not reach a kernel: each of these calls has to end in a ValueError."""

    name: str
    what: str
    calls: Sequence[Callable[[], object]]


class Say(Protocol):
    """Where progress goes."""

    def step(self, what: str) -> None: ...
    def say(self, detail: str) -> None: ...
    def clear(self) -> None: ...


# ------------------------------------------------------------------------------------------------------------- scenes


def _ground(radius: float, height: float) -> Iterator[Scene]:
    dip = math.sqrt(2 * height / radius)
    for tan, size in ((14.1, (3, 151)), (4 * dip, (3, 151)), (2 * dip, frame(1, PIXELS))):
        yield balls(looking((0, height, 0), tan, size), [((0, -radius, 0), radius)])


def _globes(radius: float) -> Iterator[Scene]:
    rng = np.random.default_rng(int(radius))
    for seed in range(3):
        yield globe("G4", radius, (0, 0), seed, frame(1, PIXELS))
        yield balls(looking(tan=1.5, size=frame(1, PIXELS)), [((-(radius + 1) * unit(rng)).tolist(), radius)])


def _tiny(radius: float, distance: float) -> Iterator[Scene]:
    center = (np.array(AHEAD) * distance + radius * np.array([0.31, -0.17, 0.23])).tolist()
    yield balls(looking(tan=1.2 * radius / distance, size=frame(1, PIXELS)), [(center, radius)])
    camera, rng = looking(tan=1, size=frame(1, PIXELS)), np.random.default_rng(2)
    yield balls(camera, aimed(camera, distance, radius, limbs(4, 26, 46, rng), rng))


def _small_and_far_off() -> Iterator[Scene]:
    for eye, distance in (((0, 0, 0), 1e3), ((1e3, -1e3, 5e2), 5e-3)):
        camera = looking(eye, 1.2e-3 / distance, frame(1, PIXELS))
        yield balls(camera, [((np.array(eye) + (3e-4, -2e-4, -distance)).tolist(), 1e-3)])


def _moved(*offset: float) -> Iterator[Scene]:
    yield everything()
    yield everything(offset)


def _scaled(*factors: float) -> Iterator[Scene]:
    yield everything()
    for factor in factors:
        yield everything(factor=factor)


def _end_of_the_range(r: float) -> Iterator[Scene]:
    lights = [point_light((6 * r, 6 * r, 0), (0.5, 0.2, 0.3)), parallel_light((1, -1, -2), (0.2, 0.5, 0.3))]
    spheres: list[Ball] = [((0, 0, -5 * r), r), ((r, -r, -6 * r), 2 * r)]
    yield balls(looking(tan=0.25, size=frame(1, PIXELS)), spheres, lights, ks=0)


def _concentric() -> Iterator[Scene]:
    for r in (1.0, 1e-3, 1e6):
        inner, outer = ulp32(r, 0), ulp32(r)
        for radii in ((inner, outer), (outer, inner)):
            spheres: list[Ball] = [((0, 0, 0), radius) for radius in radii]
            yield lit(looking((0, 0, 3 * r), 0.5, frame(1, 150)), spheres, (2 * r, 3 * r, 4 * r), (1, -2, -1))
            for tan, axis in ((3.0, AHEAD), (1.0, RIGHT)):
                eye = (0, 0, (inner + outer) / 2)
                yield lit(looking(eye, tan, frame(1, 150), axis), spheres, (0, 0, 3 * r), (0, 0, -1))


def _duplicates() -> Iterator[Scene]:
    yield everything()
    yield everything(order=tuple(np.repeat(np.arange(10), 3).tolist()))


def _overlapping() -> Iterator[Scene]:
    ties: list[Ball] = [((3, 0, -10), 5), ((-3, 0, -10), 5), ((0, 3, -10), 5), ((0, -3, -10), 5)]
    camera = looking(tan=0.1, size=frame(1, PIXELS))
    yield balls(camera, ties)
    yield balls(camera, ties[::-1])
    # Pairs through one point of a pixel's ray, but for 2^-k of their radii, or for roundings.
    rng = np.random.default_rng(9)
    camera = looking(tan=0.7, size=frame(1, PIXELS))
    for apart in (2.0**-30, 2.0**-40, 2.0**-50, 0, 0):
        d = directions(camera)[rng.integers(len(directions(camera)))]
        p = d * rng.uniform(4, 6)
        centers = p + d + unit(rng, 2) * 0.5
        radii = np.linalg.norm(centers - p, axis=1) * (1 + np.array([0, apart]))
        yield balls(camera, list(zip(centers.tolist(), radii.tolist(), strict=True)))


def _grazing() -> Iterator[Scene]:
    rng = np.random.default_rng(3)
    camera = looking(tan=6, size=frame(1, 600))
    for low, high, distance in ((8, 26, 5), (27, 46, 5), (47, 52, 50)):
        scale = rng.uniform(0.5, 2, 60)
        yield balls(camera, aimed(camera, distance * scale, scale, limbs(low, high, 60, rng), rng))


def _tangent() -> Iterator[Scene]:
    yield balls(looking((0, 1, -5), 0.5, (1, 1), BACK), [((0, 0, 0), 1)])
    for i, (x, y) in enumerate(TANGENT):
        s, z = 2.0 ** (10 * (i % 4 - 1)), 7.0 * 10.0 ** (i % 5)
        yield balls(looking(tan=0.5, size=(3, 3)), [((x * s, y * s, -z), 5 * s)])


def _long_directions() -> Iterator[Scene]:
    for tan in (1e-3, 1.0, 573.0, 572958.0):
        camera, rng = looking(tan=tan, size=frame(1, PIXELS)), np.random.default_rng(4)
        yield balls(camera, aimed(camera, 50, 1, limbs(2, 20, 19, rng), rng))


def _along_axes() -> Iterator[Scene]:
    for axis in AXES:
        yield balls(looking((0, 0, 0), 1, (1, 1), axis), [((0, 0, 0), 2.5)])
        ahead = tuple(-0.0 if a == 0 else 5.0 * a for a in axis)
        yield balls(looking((-0.0, -0.0, -0.0), 1, (3, 3), axis), [(ahead, 1)])


def _from_the_wall(sign: int) -> Iterator[Scene]:
    """The eye inside of a sphere (sign -1), or above it (1), by 10^-k."""
    for k in range(7) if sign < 0 else range(1, 7):
        w = unit(np.random.default_rng(k)) if k % 2 else np.array(BACK)
        yield balls(looking((w * (1 + sign * 10.0**-k)).tolist(), 3, frame(1, 150), AXES[k % 6]), [((0, 0, 0), 1)])


def _on_the_surface() -> Iterator[Scene]:
    for center, r in (((0, 0, -1), 1.0), ((2, -3, 6), 7.0), ((3e4, 4e4, 12e4), 13e4)):
        for axis in AXES:
            yield balls(looking((0, 0, 0), 0.9 / math.sqrt(2), frame(1, 60), axis), [(center, r)])


def _at_the_centre() -> Iterator[Scene]:
    for r in (1.0, 1e-3, 1e7):
        yield balls(looking((3, -5, 7), 2, frame(1, 150)), [((3, -5, 7), r)])


def _own_shadow() -> Iterator[Scene]:
    for R in (1e-3, 1.0, 1e3, 1e6):
        for far in (0, 1, 1e3, 1e6):
            C = far * R * unit(np.random.default_rng(int(far)))
            spheres: list[Ball] = [(C.tolist(), R), ((C - (0, 40 * R, 0)).tolist(), R)]
            camera = looking((C + (0, 0, 3 * R)).tolist(), 0.4, frame(1, 100))
            yield lit(camera, spheres, (C + R * np.array([2, 3, 4])).tolist(), (1, -2, -1))


def _lit_point(*lights: Sequence[float], occluder: Ball = ((6, 0, 4), 5)) -> Iterator[Scene]:
    """P = (0, 0, -4), seen along the axis; from there along (3, 0, 4) to an occluder whose surface is entered at
    (3, 0, 0) and left at (9, 0, 8), with no rounding in any of it.
    """
    for light in lights:
        yield lit(looking(tan=0.19, size=(11, 9)), [((0, 0, -5), 1), occluder], light, (-3, 0, -4))


def _before_and_beyond() -> Iterator[Scene]:
    before, within = math.nextafter(3.0, 0.0), math.nextafter(3.0, 4.0)
    behind = math.nextafter(9.0, 10.0)
    yield from _lit_point((before, 0, 0), (1.5, 0, -2), (within, 0, 0), (behind, 0, 8), (12, 0, 12), (3e10, 0, 4e10))
    yield from _lit_point((12, 0, 12), occluder=((-6, 0, -12), 5))


def _light_inside() -> Iterator[Scene]:
    yield from _lit_point((6, 0, 4), (6, 1, 3))
    house: list[Ball] = [((0, 1, -3), 9), ((0, -0.5, -5), 1), ((1, 0.5, -4), 0.5)]
    for light in ((2, 3, -1), (20, 30, -1)):
        yield lit(looking((0, 0, 0), 0.5, frame(1, 200)), house, light, (0, -1, -1))


def _room() -> Iterator[Scene]:
    for r in (1.0, 1e-3, 1e6):
        for y in (0.5, math.nextafter(1, 0), 1, math.nextafter(1, 2), 3):
            camera = looking((0.125 * r, 0, 0.5 * r), 1, frame(1, 100))
            yield lit(camera, [((0, 0, 0), r)], (0.3 * r if y == 0.5 else 0, y * r, 0), (0, -1, 0))


def _light_at_the_point() -> Iterator[Scene]:
    for eye, spheres in (
        ((0, 0, 4), [((0, 0, -1), 1), ((0, -9, 0), 1)]),
        ((0, 0, 1), [((0, 0, 1), 1), ((0, 0, 1), 9)]),
    ):
        for light in ((0, 0, 0), (0, 0, 1e-30), (0, 0, -1e-30), (1e-30, 0, 0), (1e-3, 0, 0), (0, -1e-9, 0)):
            yield lit(looking(eye, 0.1, (9, 7)), spheres, light, (1, 0, 0))


def _light_at_the_surface() -> Iterator[Scene]:
    for height in (1e-6, -1e-6):
        camera = looking((0, 0, 1.5), 4 * math.sqrt(2e-6), frame(1, PIXELS))
        yield lit(camera, [((0, 0, 0), 1), ((0, -40, 0), 1)], (0, 0, 1 + height), (1, 0, -1))


def _terminator() -> Iterator[Scene]:
    spheres: list[Ball] = [((0, 0, 0), 1), ((0, -9, 0), 1)]
    yield lit(looking((0, 0, 3), 0.4, frame(1, 600)), spheres, (5, 0, 1e-3), (-1, 1e-3, 1e-3))


def _core(gap: float) -> Iterator[Scene]:
    """A sphere within a shell: both seen from outside. gap: by how much larger the shell is; 0: one ulp of float32."""
    for R, far in ((1.0, 1e6), (1e-3, 1e2), (1e6, 1e4)):
        inner, shell = (ulp32(R, 0), ulp32(R)) if gap == 0 else (R, R * (1 + gap))
        C = R * np.array([0.3, -0.2, 0.1])
        camera = looking((C + (0, 0, far * R)).tolist(), 1.2 / far, frame(1, 150))
        light = (C + R * np.array([2, 3, 4])).tolist()
        yield lit(camera, [(C.tolist(), shell), (C.tolist(), inner)], light, (1, -2, -1))


def _between(gap: float) -> Iterator[Scene]:
    """As _core(), seen from between the two: no light gets there."""
    for R, far in ((1.0, 0.0), (1e-3, 0.0), (1.0, 1e3), (1e6, 0.0)):
        inner, shell = (ulp32(R, 0), ulp32(R)) if gap == 0 else (R, R * (1 + gap))
        C = np.array([far * R, -far * R, 0.5 * far * R])
        camera = looking((C + (0, 0, (inner + shell) / 2)).tolist(), 3, frame(1, 150))
        light = (C + R * np.array([0.5, -0.25, 3])).tolist()
        yield lit(camera, [(C.tolist(), inner), (C.tolist(), shell)], light, (0.25, 0.5, -1))


def _between_doubles() -> Iterator[Scene]:
    for seed in range(3):
        spheres: list[Ball] = [((0, 0, 0), 1), ((0, 0, 0), math.nextafter(1, 2))]
        yield lit(looking(between_doubles(seed), 3, frame(1, 150)), spheres, (0.5, -0.25, 3), (0.25, 0.5, -1))


def _resting(R: float) -> Iterator[Scene]:
    spheres: list[Ball] = [((0, -R, 0), R), ((0, 1, 0), 1), ((2.5, 0.5, -1), 0.5)]
    for eye, tan in (((0, 1, 6), 0.5), ((0, 0.02, 3), 0.02), ((-0.75, 0.02, 1.35), 0.1)):
        yield lit(looking(eye, tan, frame(1, PIXELS)), spheres, (3, 8, 4), (-1, -2, -1.5))


def _narrow(fov: float) -> Iterator[Scene]:
    tan = math.tan(math.radians(fov))
    r = 0.6 * 7e5 * tan
    yield balls(looking((0, 0, 7e5), tan, frame(1, PIXELS)), [((0.4 * r, -0.2 * r, 0.3 * r), r)])
    camera, rng = looking(tan=tan, size=frame(1, PIXELS)), np.random.default_rng(7)
    yield balls(camera, aimed(camera, 7e5, 0.2 * r, limbs(4, 26, 23, rng), rng))


def _wide(fov: float) -> Iterator[Scene]:
    rng = np.random.default_rng(6)
    for size in ((401, 3), frame(1, PIXELS)):
        camera = looking(tan=math.tan(math.radians(fov)), size=size)
        yield balls(camera, aimed(camera, 5, 1, limbs(4, 20, 17, rng), rng))


def _sizes() -> Iterator[Scene]:
    for size in ((1, 1), (1, 401), (401, 1), (7, 13), (33, 65), (40, 3)):
        scene = everything()
        yield replace(scene, camera=Camera(horizontal_fov=40, resolution=size, square_pixels=False))


def _shiny(exponent: float) -> Iterator[Scene]:
    for at, ways in (((2, 3, 0), ((0.2, -0.3, -1), (-2, -3, -5))), ((0, 0, 0), ((0, 0, -1), (0, 0, -1)))):
        lights = [
            point_light(at, (1, 0, 0)),
            parallel_light(ways[0], (0, 1, 0)),
            spot_light(at, ways[1], 20, 40, (0, 0, 1)),
        ]
        spheres: list[Ball] = [((0, 0, -5), 1), ((1.5, 0.5, -6), 0.75)]
        camera = looking(tan=0.3, size=frame(1, PIXELS))
        yield balls(camera, spheres, lights, ka=0, kd=0, ks=1, exponent=exponent)


def _regime(name: str) -> Iterator[Scene]:
    for seed in range(2):
        yield dict(REGIMES)[name](seed, size=(40, 30))


def _camera(**changed: object) -> object:
    return Camera(**changed)  # type: ignore[arg-type]


def _ball(**changed: object) -> object:
    given: dict[str, object] = {"centers": [(0, 0, -5)], "radii": [1.0], "lights": [ambient_light()], **changed}
    return Scene.from_spheres(Camera(), **given)  # type: ignore[arg-type]


BAD: tuple[object, ...] = (math.nan, math.inf, -math.inf, 1e39, True, None, "1")

CATALOGUE: list[Case | Refusal] = [
    *(Case(n, f"ground sphere of R = {R:.0e}, eye {h:g} above", partial(_ground, R, h))
      for n, R, h in (("G1", 1e3, 1), ("G2", 1e5, 1), ("G3", 1e7, 1), ("G5", 1e7, 1.3))),
    *(Case("G4", f"tilted globes of R = {R:.0e}, eye 1 above", partial(_globes, R)) for R in (1e3, 1e5, 1e7)),
    *(Case(n, f"sphere of r = {r:g} at {d:g}", partial(_tiny, r, d))
      for n, r, d in (("T1", 1e-3, 1e4), ("T2", 1, 100), ("T2", 1, 4100), ("T2", 1, 1e4))),
    *(Case(n, f"moved by {k:.0e}: the same picture", partial(_moved, k, -0.7 * k, 0.3 * k), SAME)
      for n, k in (("O1", 1e4), ("O2", 1e6), ("O3", 1e7))),
    Case("O4", "r = 1e-3 at 1e3, and at an offset of 1e3", _small_and_far_off),
    Case("K1", "times 1e-6: the same picture", partial(_scaled, 1e-6), SAME),
    Case("K2", "times 1e6: the same picture", partial(_scaled, 1e6), SAME),
    Case("K", "times 2^-60 .. 2^60: the same picture", partial(_scaled, *(2.0**k for k in (-60, -23, 1, 60))), SAME),
    *(Case(n, f"r = {r:.0e} at 5 r", partial(_end_of_the_range, r), SHADOWS)
      for n, r in (("X1", 1e20), ("X2", 1e30), ("X3", 1e-25), ("X4", 2.0**-149))),
    Case("R1", "concentric spheres, one ulp apart", _concentric, SHADOWS),
    Case("R2", "three of each sphere: the same picture", _duplicates, SAME),
    Case("R3", "spheres that are equally near", _overlapping),
    Case("D1", "rays that graze at r (1 +/- 2^-8 .. 2^-52)", _grazing),
    Case("D2", "exactly tangent rays", _tangent),
    Case("D3", "directions of length 1 .. 8e5", _long_directions),
    Case("D5", "along the axes, with zeros of both signs", _along_axes),
    Case("I1", "eye inside, 1 .. 1e-6 from the wall", partial(_from_the_wall, -1)),
    Case("I2", "eye exactly on the surface", _on_the_surface),
    Case("I3", "eye 1e-1 .. 1e-6 above the surface", partial(_from_the_wall, 1)),
    Case("I4", "eye at the centre", _at_the_centre),
    Case("L1", "own shadow, R = 1e-3 .. 1e6, up to 1e6 R off", _own_shadow, SHADOWS),
    Case("L2", "light before and beyond an occluder, by an ulp", _before_and_beyond, SHADOWS),
    Case("L3", "light inside another sphere", _light_inside, SHADOWS),
    Case("L4", "light in and around a room", _room, SHADOWS),
    Case("L5", "light exactly on an occluder's surface", partial(_lit_point, (3, 0, 0), (9, 0, 8)), SHADOWS),
    Case("L6", "light at the lit point, or 1e-30 from it", _light_at_the_point, SHADOWS),
    Case("L7", "light 1e-6 above and below the surface", _light_at_the_surface, SHADOWS),
    Case("L8", "the terminator", _terminator, SHADOWS),
    *(Case("L9", f"shell larger by {'one ulp' if g == 0 else f'{g:g}'}, from outside", partial(_core, g), SHADOWS)
      for g in (1e-2, 1e-4, 1e-6, 0)),
    *(Case("L9", f"shell larger by {'one ulp' if g == 0 else f'{g:g}'}, from between", partial(_between, g), SHADOWS)
      for g in (1e-2, 1e-4, 1e-6, 0)),
    Case("L9", "shell larger by an ulp of double, from between", _between_doubles, SHADOWS),
    *(Case("L10", f"balls resting on R = {R:.0e}", partial(_resting, R), SHADOWS) for R in (1e3, 1e5, 1e7)),
    *(Case("C1", f"half opening of {fov:g} deg, sphere at 7e5", partial(_narrow, fov)) for fov in (1e-6, 5e-4, 1e-2)),
    *(Case("C2", f"half opening of {fov:g} deg", partial(_wide, fov)) for fov in (89.9, 89.9999)),
    Case("C4", "pictures of 1x1, 1x401, 401x1, 7x13 ...", _sizes, SHADOWS),
    *(Case("P1", f"highlights of exponent {n:g}", partial(_shiny, n), SHADOWS) for n in (0, 0.5, 20, 1e4, 1e6)),
    *(Case("E", name, partial(_regime, name)) for name, _ in REGIMES),
    Refusal("R0", "no radius", [partial(_ball, radii=[r]) for r in (0.0, -0.0, -1.0, -1e-45)]),
    Refusal("C3", "no field of view", [partial(_camera, horizontal_fov=f) for f in (0, 90, 180, 181, -45, math.nan)]),
    Refusal("C5", "no camera axes", [partial(_camera, lookat=(0, 0, 0)), partial(_camera, up=(0, 0, 1)),
                                     partial(_camera, up=(0, 0, 0))]),
    Refusal("N1", "what is no number, in a camera",
            [partial(_camera, **{name: (0.5, 0.25, bad)}) for name in ("position", "lookat", "up") for bad in BAD]),
    Refusal("N1", "what is no number, in a sphere",
            [partial(_ball, radii=[bad]) for bad in BAD] + [partial(_ball, centers=[(0, 0, bad)]) for bad in BAD]),
]  # fmt: skip


# ------------------------------------------------------------------------------------------------------------- report

ABOUT = """
Every pixel is held against exact arithmetic. `required` is the most that is allowed to accurate and double; single and
the textbook's tracer promise nothing but to draw numbers. wrong ids: another sphere, or none, or one where none is; t:
largest error of a distance in ulp of float32, of which 0.5 is its rounding; false shadows and leaks: lights that do not
arrive, or that must not; off by 2: pixels of which a byte is off by two levels or more; moved: pixels that differ
from the first picture of the case."""
HEAD = (
    "tracer",
    "verdict",
    "pixels",
    "wrong ids",
    "t ulp",
    "normal rad",
    "false sh.",
    "leaks",
    "off by 2",
    "NaN",
    "moved",
)
WIDTHS = (24, 8, 7, 9, 9, 10, 9, 7, 8, 5, 7)


def examine(tracer: Product | Baseline, scenes: Sequence[Scene], truths: Sequence[Answer], limits: Limits) -> Found:
    """What comes out of a case. A scene without lights has no colours to look at."""
    errors: list[Errors] = []
    first, moved = None, 0
    for scene, want in zip(scenes, truths, strict=True):
        got = tracer.answer(scene)
        errors.append(compare(got, want))
        if limits.same is not None:
            first = first or got
            moved += int((got.rgb8 != first.rgb8).any(axis=1).sum())
    return Found(
        pixels=sum(e.pixels for e in errors),
        wrong_ids=sum(e.wrong_ids for e in errors),
        t_ulp=max(e.t_ulp for e in errors),
        normal=max(e.normal for e in errors),
        false_shadows=sum(e.false_shadows for e in errors),
        leaks=sum(e.leaks for e in errors),
        bytes_off=sum(e.bytes_off for e in errors),
        not_finite=sum(e.not_finite for e in errors),
        same=moved,
    )


def _line(cells: Sequence[str]) -> str:
    return (
        "  "
        + "  ".join(
            c.ljust(w) if i < 2 else c.rjust(w) for i, (c, w) in enumerate(zip(cells, WIDTHS, strict=True))
        ).rstrip()
    )


def _text(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else number(value)


def _required(limits: Limits) -> list[str]:
    bounds = [limits.wrong_ids, limits.t_ulp, limits.normal, limits.false_shadows, limits.leaks, limits.bytes_off,
              limits.not_finite, limits.same]  # fmt: skip
    return ["required", "", "", *("" if b is None else _text(b) for b in bounds)]


def _found(label: str, verdict: str, found: Found, limits: Limits) -> list[str]:
    values = [(found.wrong_ids, 0), (found.t_ulp, 0), (found.normal, 0), (found.false_shadows, limits.false_shadows),
              (found.leaks, limits.leaks), (found.bytes_off, limits.bytes_off), (found.not_finite, 0),
              (found.same, limits.same)]  # fmt: skip
    return [label, verdict, f"{found.pixels:,}", *("" if limit is None else _text(x) for x, limit in values)]


def chosen(quick: bool) -> Sequence[Case | Refusal]:
    """The cases of a run: quick is every seventh."""
    return CATALOGUE[::7] if quick else CATALOGUE


def run(devices: Sequence[Device], quick: bool, progress: Say) -> int:
    """Prints the report. Returns 1 if a precision that promises to meet all requirements fails one, else 0.

    accurate and double promise that; single only that nothing is NaN; the textbook nothing. quick: every seventh case,
    without double.
    """
    modes: list[tuple[Product | Baseline, bool, str]] = []
    for device in devices:
        default = default_precision(device)
        names = (
            [default] if quick else [p for p in ("accurate", "double", "single") if device.has_double or p == default]
        )
        where = f" [{device.spec}]" if len(devices) > 1 else ""
        modes += [(Product(device, name), name != "single", name + where) for name in names]
        modes.append((Baseline(device), False, Baseline.name + where))
    for device in devices:
        print(device.label)
    print(ABOUT)
    failed, passed, textbook = 0, 0, 0
    for case in chosen(quick):
        progress.step(f"{case.name} {case.what}")
        if isinstance(case, Refusal):
            every, refused = len(case.calls), sum(_refuses(call) for call in case.calls)
            verdict = "ok" if refused == every else "FAILED"
            progress.clear()
            print(f"\n{case.name}  {case.what}\n  required: {every} refused; refused: {refused}; {verdict}")
            failed, passed = failed + (refused < every), passed + (refused == every)
            continue
        scenes = list(case.scenes())
        truths = [answer(scene, np.arange(math.prod(scene.camera.resolution))) for scene in scenes]
        lines = [_line(HEAD), _line(_required(case.limits))]
        bad = missed = False
        for tracer, promises, label in modes:
            progress.say(label)
            found = examine(tracer, scenes, truths, case.limits)
            ok = found.within(case.limits)
            # single promises nothing but numbers.
            broken = (promises and not ok) or (isinstance(tracer, Product) and found.not_finite > 0)
            bad |= broken
            missed |= isinstance(tracer, Baseline) and not ok
            verdict = "FAILED" if broken else "ok" if ok else "misses"
            lines.append(_line(_found(label, verdict, found, case.limits)))
        progress.clear()
        print(f"\n{case.name}  {case.what}", *lines, sep="\n", flush=True)
        failed, passed, textbook = failed + bad, passed + (not bad), textbook + missed
    print(f"\n{passed} cases as required, {failed} failed; the textbook's tracer misses what {textbook} require")
    return 1 if failed else 0


def _refuses(call: Callable[[], object]) -> bool:
    try:
        call()
    except ValueError:
        return True
    return False
