"""The stress catalogue: scenes in which a tracer of rays and spheres goes wrong, and what their pictures must be.

G big spheres, T tiny ones, O offsets, K scales, X the ends of the range, V normals, R degenerate spheres, D rays,
I inside and on the surface, L lights and shadows, C cameras, P highlights and colours, M mirrors, F glass. The
docstring of each function says what goes wrong in a careless tracer. Its `amount` is 1, or 16 for as many times the
pixels, spheres or scenes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cltrace.scene import Camera, Scene, ambient_light, parallel_light, point_light, spot_light
from hostile.sphere_regimes import TANGENT
from hostile.sphere_scenes import (
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

Scenes = Iterator[Scene]
Numbers = float | Sequence[float]


# What is required of a case, besides numbers in all pixels. hits: exact surfaces, distances and normals; shadows: exact
# shadows; colors: colours to a level; same: the picture of the first scene, which is the same one, moved or scaled.
GEOMETRY = frozenset({"hits"})
SHADOWS = frozenset({"hits", "shadows", "colors"})
SAME = SHADOWS | {"same"}
BYTES: frozenset[str] = frozenset()
# Where rays bounce, the colour says which things were met.
TREES = frozenset({"hits", "colors"})


@dataclass(frozen=True)
class Case:
    """One case: its name in the catalogue, what it is, its scenes for an amount, and what is required of them."""

    name: str
    what: str
    scenes: Callable[[int], Scenes]
    checks: frozenset[str] = GEOMETRY


# ------------------------------------------------------------------------------------------------ big, tiny, far away


def _ground(radius: float, height: float, amount: int) -> Scenes:
    """|C|^2 - R^2 cancels, and R^2 swamps r^2 - v^2: there are rings or lost hits, or the height is rounded away."""
    dip = math.sqrt(2 * height / radius)
    for tan, size in ((14.1, (3, 300 * amount)), (4 * dip, (3, 300 * amount)), (2 * dip, frame(amount, 400))):
        yield balls(looking((0, height, 0), tan, size), [((0, -radius, 0), radius)])


def _moved(k: float, amount: int) -> Scenes:
    """World coordinates lose the digits that tell hits from misses: the picture is another one than at the origin."""
    yield everything()
    yield everything((k, -0.7 * k, 0.3 * k))


def _scaled(factors: Sequence[float], amount: int) -> Scenes:
    """With an absolute epsilon, spheres vanish when they are small, and shadow themselves when they are big."""
    yield everything()
    for factor in factors:
        yield everything(factor=factor)


def _powers_of_two(amount: int) -> Scenes:
    """With any constant that has a unit, a scene times 2^k is not the same picture, bit for bit."""
    yield from _scaled([2.0**k for k in ((-60, -23, 1, 60) if amount == 1 else range(-60, 61))], amount)


def _end_of_the_range(r: float, amount: int) -> Scenes:
    """r^2 is infinite or 0 in float32: every hit is lost, or every ray hits."""
    camera = looking(tan=0.25, size=frame(amount, 300))
    lights = [point_light((6 * r, 6 * r, 0), (0.5, 0.2, 0.3)), parallel_light((1, -1, -2), (0.2, 0.5, 0.3))]
    spheres: list[Ball] = [((0, 0, -5 * r), r), ((r, -r, -6 * r), 2 * r)]
    yield balls(camera, spheres, lights, ks=0)
    yield balls(camera, spheres[:1])


def _normals(R: float, amount: int) -> Scenes:
    """The normal is lost in the digits of P, at offsets and distances up to 1e7, or at limbs."""
    for gap in (1e-3, 1e7) if amount == 1 else 10.0 ** np.arange(-3, 8):
        for offset in (1e7,) if amount == 1 else (0, 1, 1e4, 1e7):
            eye = offset * np.array([1, -0.7, 0.3])
            center = eye + (0.1 * R, -0.05 * R, -(R + gap))
            tan = min(3.0, 1.1 * R / math.sqrt(gap * (2 * R + gap)))
            yield balls(looking(eye.tolist(), tan, frame(amount, 150)), [(center.tolist(), R)])
    # Far off the view's axis, each on the ray of a pixel; and limbs that pass pixels at r (1 +/- 2^-k).
    rng = np.random.default_rng(12)
    camera = looking(tan=1, size=(65, 49))
    yield balls(camera, aimed(camera, R + 1e7, R, -rng.uniform(0.01, 1, 12 * amount), rng))
    camera = looking(tan=3e-7 * R, size=frame(amount, 150))
    yield balls(camera, aimed(camera, R + 1e7, 0.5 * R, limbs(4, 26, 23, rng), rng))


# -------------------------------------------------------------------------------------------------------- degenerate


def _concentric(r: float, amount: int) -> Scenes:
    """The two spheres merge: which one is hit is random, and the inner one is lit through the outer one."""
    inner, outer = ulp32(r, 0), ulp32(r)
    for radii in ((inner, outer), (outer, inner)):
        spheres: list[Ball] = [((0, 0, 0), radius) for radius in radii]
        yield lit(looking((0, 0, 3 * r), 0.5, frame(amount, 300)), spheres, (2 * r, 3 * r, 4 * r), (1, -2, -1))
        eye = (0.25 * r, 0, 0.5 * r)
        yield lit(looking(eye, 2, frame(amount, 300)), spheres, (2 * r, 3 * r, 4 * r), (1, -2, -1))
        # From between the two: straight down, and across, where the horizon is.
        for tan, axis in ((3.0, AHEAD), (1.0, RIGHT)):
            eye = (0, 0, (inner + outer) / 2)
            yield lit(looking(eye, tan, frame(amount, 300), axis), spheres, (0, 0, 3 * r), (0, 0, -1))


def _duplicates(amount: int) -> Scenes:
    """Equal spheres fight for pixels: who wins depends on the order of the work."""
    yield everything()
    yield everything(order=tuple(np.repeat(np.arange(10), 3).tolist()))


def _overlapping(amount: int) -> Scenes:
    """Two spheres are equally near, or nearly. Below an ulp of float32 the farther one may be seen."""
    ties: list[Ball] = [((3, 0, -10), 5), ((-3, 0, -10), 5), ((0, 3, -10), 5), ((0, -3, -10), 5)]
    camera = looking(tan=0.1, size=frame(amount))
    yield balls(camera, ties)
    yield balls(camera, ties[::-1])
    # The first of them begins farther away than the others.
    yield balls(camera, [((0, 0, -8), 2), *ties])
    # Pairs through one point of a pixel's ray, but for 2^-k of their radii, or for roundings.
    rng = np.random.default_rng(9)
    camera = looking(tan=0.7, size=frame(amount))
    for apart in [2.0**-30, 2.0**-40, 2.0**-50, 0, 0, 0] * amount:
        d = directions(camera)[rng.integers(len(directions(camera)))]
        p = d * rng.uniform(4, 6)
        centers = p + d + unit(rng, 2) * 0.5
        radii = np.linalg.norm(centers - p, axis=1) * (1 + np.array([0, apart]))
        yield balls(camera, list(zip(centers.tolist(), radii.tolist(), strict=True)))


# -------------------------------------------------------------------------------------------------------------- rays


def _tangent(amount: int) -> Scenes:
    """A discriminant of exactly 0 comes out as noise: two hits or none, and a normal from anywhere."""
    yield balls(looking((0, 1, -5), 0.5, (1, 1), BACK), [((0, 0, 0), 1)])
    for i, (x, y) in enumerate(TANGENT):
        s, z = 2.0 ** (10 * (i % 4 - 1)), 7.0 * 10.0 ** (i % 5)
        yield balls(looking(tan=0.5, size=(3, 3)), [((x * s, y * s, -z), 5 * s)])


def _along_axes(amount: int) -> Scenes:
    """There are zeros in d, negative ones, too: if sign(0) is 0, q vanishes and t is NaN."""
    for axis in AXES:
        yield balls(looking((0, 0, 0), 1, (1, 1), axis), [((0, 0, 0), 2.5)])
        ahead = tuple(-0.0 if a == 0 else 5.0 * a for a in axis)
        yield balls(looking((-0.0, -0.0, -0.0), 1, (3, 3), axis), [(ahead, 1)])


def _from_the_wall(amount: int) -> Scenes:
    """Close to the wall, inside by 10^-k, r^2 - v^2 and |C|^2 - r^2 cancel."""
    for k in range(7):
        w = unit(np.random.default_rng(k)) if k % 2 else np.array(BACK)
        for axis in (AXES[k % 6],) if amount == 1 else AXES:
            yield balls(looking((w * (1 - 10.0**-k)).tolist(), 3, frame(amount, 300), axis), [((0, 0, 0), 1)])


def _on_the_surface(amount: int) -> Scenes:
    """The root 0 is taken for a hit at random. Outwards and along the surface is a miss, and inwards t = 2 b/a."""
    for center, r in (((0, 0, -1), 1.0), ((2, -3, 6), 7.0), ((-1, 2, -2), 3.0), ((3e4, 4e4, 12e4), 13e4)):
        for axis in AXES:
            yield balls(looking((0, 0, 0), 0.9 / math.sqrt(2), frame(amount, 100), axis), [(center, r)])


def _at_the_centre(r: float, amount: int) -> Scenes:
    """b = 0 for every ray, so nothing may be decided or divided by b."""
    for axis in AXES[: 2 if amount == 1 else 6]:
        yield balls(looking((3, -5, 7), 2, frame(amount, 200), axis), [((3, -5, 7), r)])


# ------------------------------------------------------------------------------------------------ lights and shadows


def _own_shadow(R: float, far: float, amount: int) -> Scenes:
    """A sphere shadows itself: acne."""
    C = far * R * unit(np.random.default_rng(int(far)))
    spheres: list[Ball] = [(C.tolist(), R), ((C - (0, 40 * R, 0)).tolist(), R)]
    camera = looking((C + (0, 0, 3 * R)).tolist(), 0.4, frame(amount, 200))
    yield lit(camera, spheres, (C + R * np.array([2, 3, 4])).tolist(), (1, -2, -1))


def _lit_point(lights: Sequence[Sequence[float]], amount: int, occluder: Ball = ((6, 0, 4), 5)) -> Scenes:
    """A light on an occluder, or an ulp before or beyond it: a coin toss. Neither P nor the light itself is in the way.

    P = (0, 0, -4) is seen along the axis. The way along (3, 0, 4) from there enters the occluder at (3, 0, 0) and
    leaves it at (9, 0, 8). No rounding is in any of it.
    """
    for light in lights:
        yield lit(looking(tan=0.19, size=(11, 9)), [((0, 0, -5), 1), occluder], light, (-3, 0, -4))


# The last light is seen from behind the point.
BEFORE_AND_BEYOND = (
    (math.nextafter(3.0, 0.0), 0, 0),
    (1.5, 0, -2),
    (math.nextafter(3.0, 4.0), 0, 0),
    (math.nextafter(9.0, 10.0), 0, 8),
    (12, 0, 12),
    (3e10, 0, 4e10),
)


def _before_and_beyond(amount: int) -> Scenes:
    """What is behind the light, or behind the point, casts a shadow."""
    yield from _lit_point(BEFORE_AND_BEYOND, amount)
    yield from _lit_point([(12, 0, 12)], amount, ((-6, 0, -12), 5))


def _light_inside(amount: int) -> Scenes:
    """The sphere that holds the light must darken what is outside of it, and nothing that is inside of it, too."""
    yield from _lit_point([(6, 0, 4), (6, 1, 3)], amount)
    house: list[Ball] = [((0, 1, -3), 9), ((0, -0.5, -5), 1), ((1, 0.5, -4), 0.5)]
    for light in ((2, 3, -1), (20, 30, -1)):
        yield lit(looking((0, 0, 0), 0.5, frame(amount, 200)), house, light, (0, -1, -1))


def _room(r: float, amount: int) -> Scenes:
    """A room darkens itself, or light gets in from outside. A light exactly on the wall must light the room."""
    for point in ((0.3, 0.5, -0.2), (0, math.nextafter(1, 0), 0), (0, 1, 0), (0, math.nextafter(1, 2), 0), (0, 3, 1)):
        camera = looking((0.125 * r, 0, 0.5 * r), 1, frame(amount, 150))
        yield lit(camera, [((0, 0, 0), r)], (np.array(point) * r).tolist(), (0, -1, 0))


AT_THE_POINT = ((0, 0, 0), (0, 0, 1e-30), (0, 0, -1e-30), (1e-30, 0, 0), (1e-3, 0, 0), (0, -1e-9, 0))


def _light_at_the_point(amount: int) -> Scenes:
    """L = P, or all but: the direction is 0/0. A light in the tangent plane must add nothing.

    The ray along the axis meets the first sphere at the origin, the second time from inside.
    """
    for eye, spheres in (
        ((0, 0, 4), [((0, 0, -1), 1), ((0, -9, 0), 1)]),
        ((0, 0, 1), [((0, 0, 1), 1), ((0, 0, 1), 9)]),
    ):
        for light in AT_THE_POINT:
            yield lit(looking(eye, 0.1, (9, 7)), spheres, light, (1, 0, 0))


def _light_at_the_surface(height: float, amount: int) -> Scenes:
    """A light 1e-6 above the surface is swallowed by an epsilon, and one below the surface leaks out."""
    camera = looking((0, 0, 1.5), 4 * math.sqrt(2e-6), frame(amount))
    yield lit(camera, [((0, 0, 0), 1), ((0, -40, 0), 1)], (0, 0, 1 + height), (1, 0, -1))


def _terminator(amount: int) -> Scenes:
    """n.l is within an ulp of 0: there is a line of acne."""
    spheres: list[Ball] = [((0, 0, 0), 1), ((0, -9, 0), 1)]
    yield lit(looking((0, 0, 3), 0.4, frame(amount)), spheres, (5, 0, 1e-3), (-1, 1e-3, 1e-3))


def _on_two_spheres(amount: int) -> Scenes:
    """The point (0, 0, -4) is exactly on another sphere, too, whose root 0 must not count, but whose other root must.

    In the first scene the other sphere holds the own one and touches it there. In the others it holds the eye, and the
    light is in it or beyond.
    """
    camera, own = looking(tan=0.19, size=(3, 3)), ((0, 0, -5), 1)
    yield lit(camera, [own, ((0, 0, -6), 2)], (1, 2, 0), (0, 0, -1))
    for light in ((3, 0, 0), (12, 0, 12)):
        yield lit(camera, [own, ((3, 0, 0), 5)], light, (-3, 0, -4))


def _shell_of(R: float, gap: float | str) -> tuple[float, float]:
    """The radius of a sphere of about R, and of a shell that is larger by gap R, or by an ulp of the type `gap`."""
    if gap == "double":
        return R, math.nextafter(R, math.inf)
    return (ulp32(R, 0), ulp32(R)) if gap == "float" else (R, R * (1 + float(gap)))


def _core(gap: float | str, amount: int) -> Scenes:
    """A shell is seen from far off: a P that is off by more than the gap is inside of it, and dark."""
    for R, far in ((1.0, 1e6), (1e-3, 1e2), (1e6, 1e4), (1.0, 10)):
        core, shell = _shell_of(R, gap)
        C = R * np.array([0.3, -0.2, 0.1])
        camera = looking((C + (0, 0, far * R)).tolist(), 1.2 / far, frame(amount, 150))
        light = (C + R * np.array([2, 3, 4])).tolist()
        yield lit(camera, [(C.tolist(), shell), (C.tolist(), core)], light, (1, -2, -1))


def _between(gap: float | str, amount: int) -> Scenes:
    """Light gets through a shell that is nearer than an epsilon. Here the eye is between sphere and shell."""
    for R, far in ((1.0, 0.0), (1e-3, 0.0), (1e3, 1.0), (1.0, 1e3), (1e6, 0.0)):
        C = np.array([far * R, -far * R, 0.5 * far * R])
        for seed in range(1 if amount == 1 else 4):
            if gap == "double":
                R, C = 1.0, np.zeros(3)
            R, shell = _shell_of(R, gap)
            eye = between_doubles(seed) if gap == "double" else (C + (0, 0, (R + shell) / 2)).tolist()
            spheres: list[Ball] = [(C.tolist(), R), (C.tolist(), shell)]
            light = (C + R * np.array([0.5, -0.25, 3])).tolist()
            yield lit(looking(eye, 3, frame(amount, 150)), spheres, light, (0.25, 0.5, -1))


def _resting(R: float, amount: int) -> Scenes:
    """The shadow of a ball that touches the ground detaches from it, or has rings."""
    spheres: list[Ball] = [((0, -R, 0), R), ((0, 1, 0), 1), ((2.5, 0.5, -1), 0.5)]
    for eye, tan in (((0, 1, 6), 0.5), ((0, 0.02, 3), 0.02), ((-0.75, 0.02, 1.35), 0.1)):
        yield lit(looking(eye, tan, frame(amount, 600)), spheres, (3, 8, 4), (-1, -2, -1.5))


# ------------------------------------------------------------------------------------------------ camera and shading


def _narrow(fov: float, amount: int) -> Scenes:
    """The directions of neighbouring pixels are the same in float32, and the sphere looks pixelated."""
    tan = math.tan(math.radians(fov))
    r = 0.6 * 7e5 * tan
    for axis in AXES[: 1 if amount == 1 else 6]:
        for sideways in ((0, 0, 0), (0.4 * r, -0.2 * r, 0.3 * r)):
            yield balls(looking((-7e5 * np.array(axis)).tolist(), tan, frame(amount), axis), [(sideways, r)])
    # Limbs that pass pixels at r (1 +/- 2^-k).
    camera, rng = looking(tan=tan, size=frame(amount)), np.random.default_rng(7)
    yield balls(camera, aimed(camera, 7e5, 0.2 * r, limbs(4, 26, 23, rng), rng))


def _wide(fov: float, amount: int) -> Scenes:
    """pi/180 in float32 is off by 1e-4 in the tangent; the picture's edges point elsewhere, or nowhere."""
    rng = np.random.default_rng(6)
    other = looking(tan=math.tan(math.radians(fov)), size=frame(amount))
    for camera in (Camera(horizontal_fov=fov, resolution=(401, 3), square_pixels=True), other):
        yield balls(camera, aimed(camera, 5, 1, limbs(4, 20, 17, rng), rng))


def _sizes(amount: int) -> Scenes:
    """The picture is half a pixel off, its sides are swapped, or packets at the edge write beyond it."""
    for size in ((1, 1), (1, 4096), (4096, 1), (7, 13), (33, 65), (40, 3)):
        yield replace(everything(), camera=Camera(horizontal_fov=40, resolution=size, square_pixels=False))


def _mirrors(exponent: float, size: tuple[int, int], eye_light: bool) -> Scene:
    """Two spheres that are all highlights. eye_light: every light stands where the eye is, so r.v is 1 on the axis."""
    at = (0, 0, 0) if eye_light else (2, 3, 0)
    lights = [
        point_light(at, (1, 0, 0)),
        parallel_light((0, 0, -1) if eye_light else (0.2, -0.3, -1), (0, 1, 0)),
        spot_light(at, (0, 0, -1) if eye_light else (-2, -3, -5), 20, 40, (0, 0, 1)),
    ]
    spheres: list[Ball] = [((0, 0, -5), 1), ((1.5, 0.5, -6), 0.75)]
    return balls(looking(tan=0.3, size=size), spheres, lights, ka=0, kd=0, ks=1, exponent=exponent)


def _shiny(exponent: float, amount: int) -> Scenes:
    """0^0 is NaN by powr(), and the power of 1e6 of a cosine in float32 is off by 15 %."""
    for eye_light in (False, True):
        yield _mirrors(exponent, frame(amount, 500), eye_light)


def _highlight(exponent: float, amount: int) -> Scenes:
    """By rounding r.v = 1 + 1e-7, whose power of 1e6 is above 1. The highlight fills the picture."""
    scene = _mirrors(exponent, frame(amount, 300), True)
    yield replace(scene, camera=looking(tan=0.6 / math.sqrt(max(exponent, 20)), size=frame(amount, 300)))


GREYS = (0, 1, 1.5, 300, 2.0**-149, 1e-40, 1e38, 3.4e38, 0.5, 0.1, 0.999)


def _greys(amount: int) -> Scenes:
    """255 c beyond a byte wraps around, and products of colours leave float32's range.

    The spheres are of GREYS: in two scenes with light that adds nothing, then in four with light beyond float32.
    """
    n = len(GREYS)
    spheres: list[Ball] = [(((2 * i - n + 1) / (2 * n + 1) * 20, 0, -10), 0.5) for i in range(n)]
    strong = [point_light((0, 0, 0), (1e38, 1e38, 1)), parallel_light((0, 0, -1), (3.4e38, 0, 1)),
              spot_light((0, 0, 0), (0, 0, -1), 60, 80, (1e38, 1e38, 1e38))]  # fmt: skip
    dim = [point_light((0, 0, 0), (1e-45 * 2,) * 3), parallel_light((0, 0, -1), (2e-45,) * 3),
           spot_light((0, 0, 0), (0, 0, -1), 60, 80, (2e-45,) * 3)]  # fmt: skip
    for lights, kd, ks in ((dim, 1, 1e-30), (strong, 1e38, 1e38), (strong, 3.4e38, 0.5)):
        for ambient in (1.0, 1e38):
            every = [ambient_light((ambient,) * 3), *lights]
            colors = np.repeat(np.array(GREYS)[:, None], 3, axis=1)
            camera = looking(tan=1, size=(2 * n + 1, 3))
            yield balls(camera, spheres, every, colors=colors, ka=1, kd=kd, ks=ks, exponent=3e38)


def _bouncing(camera: Camera, bounces: int, spheres: Sequence[Ball], **material: Numbers) -> Scene:
    """Spheres of many colours in ambient and in point light, whose rays are followed so far."""
    rng = np.random.default_rng(len(spheres))
    lights = [ambient_light((1, 1, 1)), point_light((3, 4, 5), (0.5, 0.5, 0.5))]
    colors = rng.uniform(0.1, 1, (len(spheres), 3))
    camera = replace(camera, max_bounces=bounces)
    return balls(camera, spheres, lights, colors=colors, ka=0.5, background=(0.2, 0.3, 0.4), **material)


def _mirror_chain(bounces: int, amount: int) -> Scenes:
    """Three unit spheres, 6 apart. Each bounce makes an error ten times as large: after 15 even a double is noise, and
    only equal formulas in equal order give equal pictures.
    """
    spheres: list[Ball] = [((0, 2 * math.sqrt(3), -6), 1), ((-3, -math.sqrt(3), -6), 1), ((3, -math.sqrt(3), -6), 1)]
    for reflectance in (0.9, 1):
        yield _bouncing(looking(tan=0.8, size=frame(amount, 300)), bounces, spheres, reflectance=reflectance)
    # From a point between two of them, by the narrow way that comes back.
    for tan in (1e-2, 1e-6):
        camera = looking((0, -math.sqrt(3), -6), tan, frame(amount, 200), RIGHT)
        yield _bouncing(camera, bounces, spheres, reflectance=0.9)


def _critical(amount: int) -> Scenes:
    """Whether a ray of sin(i) = 1/N (1 +/- 1e-9) leaves glass is a coin toss in float32, and k = 0 may become a NaN.

    The eye is in the glass, and the axis passes the centre at R/N.
    """
    for tan in (1e-2, 1e-5, 1e-9, 1e-12):
        for N in (1.5, 2.4):
            camera = looking((0, 2 / N, 1), tan, frame(amount, 150))
            yield _bouncing(camera, 5, [((0, 0, 0), 2)], transmittance=0.8, reflectance=0.1, index=N)


def _indices(amount: int) -> Scenes:
    """Rays bend where both sides are the same; and extreme indices lose c or k. Spheres in each other, and twice."""
    for index in (1, 1e-3, 1e3, 1.5):
        for radii in ((1, 1), (1, math.nextafter(1, 2)), (1, 0.5), (0.5, 1, 0.75)):
            spheres: list[Ball] = [*(((0.25, 0, -5), r) for r in radii), ((-1, 0.5, -9), 1.5)]
            glass = [0.75] * len(radii) + [0]
            camera = looking(tan=0.3, size=frame(amount, 20))
            yield _bouncing(camera, 6, spheres, transmittance=glass, reflectance=0.125, index=index)


GAPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, "float", "double")

# fmt: off
CATALOGUE = [
    *(Case(n, f"ground sphere of R = {R:.0e}, eye {h:g} above", partial(_ground, R, h))
      for n, R, h in (("G1", 1e3, 1), ("G2", 1e5, 1), ("G3", 1e7, 1), ("G5", 1e7, 1.3))),
    *(Case(n, f"moved by {k:.0e}: the same picture", partial(_moved, k), SAME)
      for n, k in (("O1", 1e4), ("O2", 1e6), ("O3", 1e7))),
    Case("K1", "times 1e-6: the same picture", partial(_scaled, [1e-6]), SAME),
    Case("K2", "times 1e6: the same picture", partial(_scaled, [1e6]), SAME),
    Case("K", "times 2^-60 .. 2^60: the same picture", _powers_of_two, SAME),
    *(Case(n, f"r = {r:.0e} at 5 r", partial(_end_of_the_range, r), SHADOWS)
      for n, r in (("X1", 1e20), ("X2", 1e30), ("X3", 1e-25), ("X4", 2.0**-149))),
    *(Case("V", f"normals of R = {R:g}, up to 1e7 off", partial(_normals, R)) for R in (1e-3, 1.0, 1e3, 1e7)),
    *(Case("R1", f"concentric spheres of {r:g}, one ulp apart", partial(_concentric, r), SHADOWS)
      for r in (1.0, 1e-3, 1e6)),
    Case("R2", "three of each sphere: the same picture", _duplicates, SAME),
    Case("R3", "spheres that are equally near", _overlapping),
    Case("D2", "exactly tangent rays", _tangent),
    Case("D5", "along the axes, with zeros of both signs", _along_axes),
    Case("I1", "eye inside, 1 .. 1e-6 from the wall", _from_the_wall),
    Case("I2", "eye exactly on the surface", _on_the_surface),
    *(Case("I4", f"eye at the centre, r = {r:g}", partial(_at_the_centre, r)) for r in (1.0, 1e-3, 1e7)),
    *(Case("L1", f"own shadow, R = {R:g}, {far:g} R off", partial(_own_shadow, R, far), SHADOWS)
      for R in (1e-3, 1.0, 1e3, 1e6) for far in (0, 1, 1e3, 1e6)),
    Case("L2", "light before and beyond an occluder, by an ulp", _before_and_beyond, SHADOWS),
    Case("L3", "light inside another sphere", _light_inside, SHADOWS),
    *(Case("L4", f"light in and around a room of {r:g}", partial(_room, r), SHADOWS) for r in (1.0, 1e-3, 1e6)),
    Case("L5", "light exactly on an occluder's surface", partial(_lit_point, [(3, 0, 0), (9, 0, 8)]), SHADOWS),
    Case("L6", "light at the lit point, or 1e-30 from it", _light_at_the_point, SHADOWS),
    *(Case("L7", f"light {h:g} above the surface", partial(_light_at_the_surface, h), SHADOWS) for h in (1e-6, -1e-6)),
    Case("L8", "the terminator", _terminator, SHADOWS),
    Case("L11", "points exactly on two spheres", _on_two_spheres, SHADOWS),
    *(Case("L9", f"shell larger by {g}, from outside", partial(_core, g), SHADOWS) for g in GAPS),
    *(Case("L9", f"shell larger by {g}, from between", partial(_between, g), SHADOWS) for g in GAPS),
    *(Case("L10", f"balls resting on R = {R:.0e}", partial(_resting, R), SHADOWS) for R in (1e3, 1e5, 1e7)),
    *(Case("C1", f"half opening of {fov:g} deg, sphere at 7e5", partial(_narrow, fov)) for fov in (1e-6, 5e-4, 1e-2)),
    *(Case("C2", f"half opening of {fov:g} deg", partial(_wide, fov)) for fov in (89.9, 89.9999)),
    Case("C4", "pictures of 1x1, 1x4096, 4096x1, 7x13 ...", _sizes, SHADOWS),
    *(Case("P1", f"highlights of exponent {n:g}", partial(_shiny, n), SHADOWS) for n in (0, 0.5, 1, 20, 1e4, 1e6)),
    *(Case("P2", f"the middle of a highlight of exponent {n:g}", partial(_highlight, n), SHADOWS)
      for n in (0, 0.5, 20, 1e4, 1e6)),
    Case("P3", "greys from 0 to 3.4e38", _greys, BYTES),
    *(Case("M1", f"three mirrors, {n} bounces", partial(_mirror_chain, n), TREES) for n in (3, 12)),
    Case("F1", "glass at the critical angle +/- 1e-2 .. 1e-12", _critical, TREES),
    Case("F2", "indices of 1, 1e-3 and 1e3, glass in glass", _indices, TREES),
]
# fmt: on


def cases(*names: str) -> list[Case]:
    """The cases of these names, or all of them."""
    return [case for case in CATALOGUE if not names or case.name in names]
