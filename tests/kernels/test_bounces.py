"""Mirrors and glass: answers that are derived by hand. What the scenes are made of is in glowing.py."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from glowing import (
    BLACK,
    BLUE,
    GREEN,
    NIGHT,
    RED,
    WHITE,
    A,
    B,
    Beams,
    Row,
    eye,
    glowing,
    passes,
    scaled,
    shades,
    targets,
    total,
    turned,
)
from hostile.sphere_regimes import rays as camera_rays
from hostile.sphere_scenes import AXES, Ball, directions, looking
from random_scenes import random_tree
from stress_cases import assert_same, channel, picture

from cltrace import Camera, Image, Scene, ambient_light, parallel_light, point_light, spot_light
from cltrace.reference import byte_of
from cltrace.run.devices import Device

DEPTHS = (0, 1, 2, 8, 64, 100)


def drawn(scene: Scene, device: Device, precision: str = "accurate", keep: tuple[str, ...] = ()) -> Image:
    """picture() without the tree of boxes, which needs another program: test_invariance.py has it."""
    return picture(scene, device, precision, keep=("tree", *keep))


def show(scene: Scene, device: Device, precision: str = "accurate", keep: tuple[str, ...] = ()) -> np.ndarray:
    """(n, 3) float32: the linear colours of that picture, row by row."""
    return channel(drawn(scene, device, precision, keep), "color")


# --------------------------------------------------------------------------------------- what weights and depths add up


@pytest.mark.parametrize("r", [1.0, 0.5, 0.75, 0.9])
def test_two_mirrors_that_face_each_other(device: Device, r: float) -> None:
    """The eye is midway between two balls of radius 2^24, one in front and one behind, 2 apart.

    A ray of slope s <= 0.32 goes 2 s sideways from one to the other. After 100 of them, at x <= 64, the surfaces have
    receded by x^2 / 2R < 2^-12 and turned by x/R < 2^-18: it still goes to and fro. The balls are met in turn,
    A, B, A, ...: the sum over k <= n of r^k (1 - r) times the colour of the k-th, and r^(n+1) times the last in full.
    """
    R, balls = 2.0**24, (A, B)
    for n in DEPTHS:
        scene = glowing(eye(n, size=(7, 5)), [((0, 0, -R - 1), R), ((0, 0, R + 1), R)], balls, reflectance=r)
        parts, weight = [], 1.0
        for depth in range(n + 1):
            parts.append((weight * (1 - r), balls[depth % 2]))
            weight *= r
        parts.append((weight, balls[(n + 1) % 2]))
        assert (show(scene, device) == total(parts)).all(), n


def shells(apart: str) -> list[Ball]:
    """64 concentric balls about (0, 0, -8), the smallest first: by 1/64 or by the smallest step of a double."""
    radii = [1.0]
    while len(radii) < 64:
        radii.append(math.nextafter(radii[-1], 2) if apart == "ulp" else radii[-1] + 2.0**-6)
    return [((0, 0, -8), radius) for radius in radii]


GREYS = [(k % 5 / 4, k % 7 / 8, k % 11 / 16) for k in range(64)]


@pytest.mark.parametrize("apart", ["ulp", "64th"])
@pytest.mark.parametrize("index", [1.0, 1.5])
def test_shells_from_outside(device: Device, apart: str, index: float) -> None:
    """A ray that enters 25 balls leaves them in the opposite order.

    b is how far from the centre the ray passes, over the radius of the outermost one. With index 1 it goes straight on
    and meets them all, as b < 0.6 and the smallest is 0.7 of the largest at least. With index 1.5 each wall bends it
    inwards, and by symmetry outwards as much: it meets all of them all the more.
    """
    t = 1 - 2.0**-6
    count, camera = 25, eye(100, tan=0.06)
    scene = glowing(camera, shells(apart)[:count], GREYS[:count], transmittance=t, index=index)
    parts, weight = [], 1.0
    for color in (*GREYS[:count][::-1], *GREYS[:count]):
        parts.append((weight * (1 - t), color))
        weight *= t
    assert (show(scene, device) == total([*parts, (weight, NIGHT)])).all()


def test_weights_that_grow(device: Device) -> None:
    """r = 1.5 within a ball: nothing of its own colour remains but at depth n + 1, which shows 1.5^(n+1) of it.

    A contribution is 2^61 units at most, which is a colour of 2^21. What is black stays black.
    """
    color = (1.0, 0.25, 0.0)
    for r, n in ((1.5, 0), (1.5, 1), (1.5, 8), (1.5, 20), (1.5, 100), (2.0, 100), (2.0**20, 4), (1e30, 100)):
        scene = glowing(eye(n, tan=2), [((0, 0, 0), 1)], color, background=BLACK, reflectance=r)
        image = drawn(scene, device)
        grown = math.exp((n + 1) * math.log(r)) if r < 1e9 else math.inf
        want = [min(grown * c, 2.0**21) if c else 0 for c in color]
        assert np.allclose(channel(image, "color"), want, rtol=1e-6, atol=0), (r, n)
        assert (channel(image, "rgb8") == [byte_of(c) for c in want]).all(), (r, n)


def furnace(scene: Scene) -> Scene:
    """The same shapes, mirrors and glass, where all is white: what comes from anywhere is 1."""
    materials = scene.materials.copy()
    materials["color"], materials["ka"], materials["kd"], materials["ks"] = 1, 1, 0, 0
    more = np.maximum(1, materials["reflectance"] + materials["transmittance"])
    materials["reflectance"] /= more
    materials["transmittance"] /= more
    return replace(scene, materials=materials, lights=ambient_light((1, 1, 1)), background=WHITE)


@pytest.mark.slow
def test_white_furnace(device: Device) -> None:
    """Weights that add up to 1 at every branch add up to 1 at the end: energy is neither lost nor made."""
    for seed in range(30):
        scene = furnace(random_tree(seed))
        for precision in ("accurate", "single"):
            color = show(scene, device, precision)
            assert (np.abs(color - 1) <= 2.0**-23).all(), (seed, precision)


def test_what_is_outside_of_a_tree_is_exact(device: Device) -> None:
    """An opaque thing shows its colour whether or not something in the scene mirrors, bit for bit."""
    balls = [((0, 0, -5), 1), ((2, 1, -6), 0.75)]
    lights = [ambient_light(), point_light((3, 4, 0)), parallel_light((-1, -1, -1))]
    for n in (0, 8):
        camera = eye(n, size=(24, 18), tan=0.5)
        kept = Scene.from_spheres(camera, lights, *map(list, zip(*balls, strict=True)), [A, B], background=NIGHT)
        materials = kept.materials.copy()
        materials["reflectance"] = 0, 0.5
        mirror = replace(kept, materials=materials)
        one, two = drawn(kept, device), drawn(mirror, device)
        away = one.id != 1
        assert away.any()
        assert (one.id == 1).any()
        assert_same(one, two, ("id", "depth", "normal", "direction"), n)
        assert np.array_equal(one.shadow_rays[away], two.shadow_rays[away])
        # A colour is rounded to 2^-40 once more.
        assert np.abs(one.color[away] - two.color[away]).max() <= 2.0**-24
        assert (one.rgb8[away] == two.rgb8[away]).all()
        assert (one.rgb8[~away] != two.rgb8[~away]).any()


# -------------------------------------------------------------------------------------------------------- where rays go


def test_through_the_centre_of_a_ball(device: Device) -> None:
    """Each pixel looks through the centre of a glass ball of its own, at a pea far beyond it, on the same line.

    With 8x8 pixels and tan 1/4 the directions, and so the centres, are doubles. The peas are 2^-32 wide, at 64.
    """
    camera = eye(2, size=(8, 8))
    d = directions(camera)
    assert (d * 2**8 == np.rint(d * 2**8)).all()
    for index in (1.5, 0.75, 1.0, 1e3, 1e-3):
        glass = [(p, 0.0625) for p in (8 * d).tolist()]
        scene, (colors,) = targets(camera, glass, [64 * d], 2.0**-32, transmittance=1, index=index)
        assert (show(scene, device) == colors).all(), index


@pytest.mark.parametrize("index", [1.5, 2.5, 0.9, 1e3])
def test_a_ball_lens(device: Device, index: float) -> None:
    """A ray that passes the centre at b < R is turned by 2 (i - o), sin(i) = b/R, sin(o) = b/(R index).

    It leaves as far from the centre as it came, so its line is the old one, turned about the centre by that angle.
    """
    center, R, camera = (0.25, -0.125, -8.0), 1.5, eye(2, tan=0.08, size=(16, 12))
    rays = Beams.of(camera)
    sine = passes(center, rays) / R
    out = turned(center, rays, 2 * (np.arcsin(sine) - np.arcsin(sine / np.longdouble(index))))
    scene, (colors,) = targets(camera, [(center, R)], [out.at(20)], transmittance=1, index=index)
    assert (show(scene, device) == colors).all()
    assert (drawn(scene, device).id == 0).all()


def test_from_within_glass(device: Device) -> None:
    """An eye inside a ball of glass: rays are bent once, away from the normal, as they leave."""
    center, R, index = (0.25, 0.5, 0.125), 2.0, 1.5
    for axis in AXES[:3]:
        camera = eye(1, at=(0.5, 0.25, -0.125), tan=1, axis=axis)
        wall, n = Beams.of(camera).meet(center, R, far=True)
        scene, (colors,) = targets(camera, [(center, R)], [wall.bent(n, 1 / index).at(9)], transmittance=1, index=index)
        assert (show(scene, device) == colors).all(), axis


def test_glass_within_glass(device: Device) -> None:
    """Who enters any ball comes from index 1, and who leaves one, too: there is no stack of media.

    Concentric balls of radii R and Q: the line is turned by 2 (i - o) at the outer one, as a lens does, and passes the
    centre at b/N within it; there the inner one turns it as a lens would whose ray comes so.
    """
    center, R, Q, N = (0.0, 0.0, -8.0), 1.5, 0.75, 1.25
    camera = eye(8, tan=0.05, size=(12, 10))
    rays = Beams.of(camera)
    b = passes(center, rays)
    angle = 2 * (np.arcsin(b / R) - np.arcsin(b / (R * N)) + np.arcsin(b / (N * Q)) - np.arcsin(b / (N * N * Q)))
    out = turned(center, rays, angle)
    scene, (colors,) = targets(camera, [(center, R), (center, Q)], [out.at(20)], transmittance=1, index=N)
    assert (show(scene, device) == colors).all()


def test_a_mirror_chain(device: Device) -> None:
    """Three unit balls, centres 6 apart, between which a ray goes round for ever if it is aimed so.

    Errors grow about tenfold a bounce, and so do differences between pixels. Ball k is of pure colour k, and with
    r = 1/4 what it adds at depth j is 3/4 of 4^-j: a digit of base 4 in channel k. Which balls were met, in which
    order, is compared up to depth 8 where school-book rays in long double, and such that are off by 1e-15, agree.
    """
    n, r = 8, 0.25
    centers = [(6 / math.sqrt(3) * math.cos(a), 6 / math.sqrt(3) * math.sin(a), 0.0)
               for a in (math.pi / 2, math.pi * 7 / 6, math.pi * 11 / 6)]  # fmt: skip
    inner = [tuple(c * (1 - 1 / math.hypot(*center)) for c in center) for center in centers]
    towards = np.array(inner[0]) - np.array(inner[1])
    start = np.array(inner[0]) - towards / np.linalg.norm(towards)
    compared = 0
    for zoom in (1e-1, 1e-3, 1e-5, 1e-7):
        camera = Camera(start, np.array(inner[0]), (0, 0, 1), math.degrees(math.atan(zoom)), (11, 9), n)
        chains = [chain(camera, centers, n, shift) for shift in (0, 1e-15, -1e-15)]
        sure = (chains[0] == chains[1]).all(axis=1) & (chains[0] == chains[2]).all(axis=1)
        got = show(glowing(camera, [(c, 1.0) for c in centers], np.eye(3), BLACK, reflectance=r), device)
        for pixel in np.flatnonzero(sure):
            seen = [int(k) for k in chains[0][pixel] if k >= 0]
            last = len(seen) - 1
            parts = [(r**j * (1 - r if j <= n else 1), np.eye(3)[k]) for j, k in enumerate(seen)]
            assert (got[pixel] == total(parts)).all(), (zoom, pixel, last)
            compared += last >= 3
    assert compared > 150


def chain(camera: Camera, centers: Sequence[Row], bounces: int, shift: float) -> np.ndarray:
    """(pixels, bounces + 2): which unit balls the rays meet one after the other, -1 beyond the last."""
    d = camera_rays(camera).astype(np.longdouble) @ np.array(camera.basis(), np.longdouble)
    beams = Beams(np.broadcast_to(np.array(camera.position, np.longdouble), d.shape), scaled(d + shift * d[:, ::-1]))
    out = np.full((len(d), bounces + 2), -1)
    own = np.full(len(d), -1)
    alive = np.ones(len(d), bool)
    for depth in range(bounces + 2):
        nearest, index = np.full(len(d), np.inf, np.longdouble), np.full(len(d), -1)
        for k, center in enumerate(centers):
            f = np.array(center, np.longdouble) - beams.p
            b = (f * beams.d).sum(axis=1)
            across = f - b[:, None] * beams.d
            D = 1 - (across * across).sum(axis=1)
            with np.errstate(invalid="ignore"):
                way = b - np.sqrt(D)
            ok = (D > 0) & (way > 0) & (way < nearest) & (own != k)
            nearest[ok], index[ok] = way[ok], k
        alive &= index >= 0
        out[alive, depth] = index[alive]
        if not alive.any():
            break
        p = beams.at(np.where(alive, nearest, 0))
        normal = scaled(p - np.array(centers, np.longdouble)[index] + ~alive[:, None])
        beams, own = Beams(p, beams.d).mirrored(normal), index
    return out


@pytest.mark.parametrize("zoom", [1e-2, 1e-5, 1e-9, 1e-12])
def test_the_critical_angle(device: Device, zoom: float) -> None:
    """An eye in a ball of radius R and index N sees out iff sin(i) = b/R <= 1/N, b from the centre.

    Beyond, a ray stays within for ever, at the same angle, and shows the ball's colour at depth n + 1 with the weight
    (r + t)^(n+1). On the axis b is R/N; what is within 1e-14 of that is not asked for.
    """
    N, R, n = 1.5, 2.0, 5
    camera = eye(n, at=(0, R / N, 1), tan=zoom, size=(33, 33))
    scene = glowing(camera, [((0, 0, 0), R)], A, transmittance=0.75, reflectance=0.25, index=N)
    got = show(scene, device)
    bright = (A[0] - NIGHT[0]) / 2
    seen = [0, 0]
    for pixel, d in enumerate(directions(camera)):
        x, y, z = (Fraction(float(v)) for v in d)
        # (b N/R)^2 with b^2 = |C x d|^2 / |d|^2, C = -(0, h, 1), d = (x, y, -1)
        h = Fraction(camera.position[1])
        cross = (h + y) ** 2 + x * x + (h * x) ** 2
        square = cross / (x * x + y * y + z * z) * Fraction(N) ** 2 / Fraction(R) ** 2
        if abs(square - 1) > Fraction(1, 10**14):
            stays = square > 1
            seen[stays] += 1
            # What leaves has shown 3/4 of the night already; what stays adds up to A alone.
            assert np.array_equal(got[pixel], total([(1.0, A)])) == stays, (pixel, float(square - 1))
            if not stays:
                assert got[pixel, 2] > bright
    assert min(seen) > 300


def test_total_reflection_is_one_ray(device: Device) -> None:
    """Beyond the critical angle what is transmitted goes the way of what is reflected: r + t, not r and t."""
    for r, t in ((0.25, 0.5), (0.5, 0.5), (0.0, 0.75), (1.0, 1.0)):
        n = 6
        camera = eye(n, at=(0, 1.75, 0), tan=0.01)
        scene = glowing(camera, [((0, 0, 0), 2)], A, reflectance=r, transmittance=t, index=1.5)
        share = max(0.0, 1 - r - t)
        parts = [((r + t) ** k * share, A) for k in range(n + 1)]
        assert (show(scene, device) == total([*parts, ((r + t) ** (n + 1), A)])).all(), (r, t)


def test_total_reflection_from_outside(device: Device) -> None:
    """Index 1/2: a ball mirrors those that pass its centre at more than half of its radius.

    Those show (1 - t) A + t night with t = 1/2; the others enter and leave, and show A/2 + A/4 + night/4.
    """
    camera = eye(4, at=(0, 0, 8), tan=0.12, size=(40, 30))
    got = show(glowing(camera, [((0, 0, 0), 1)], A, transmittance=0.5, index=0.5), device)
    b = passes((0, 0, 0), Beams.of(camera))
    for where, parts in (
        (b > 1, [(1.0, NIGHT)]),
        ((b > 0.5) & (b < 1), [(0.5, A), (0.5, NIGHT)]),
        (b < 0.5, [(0.5, A), (0.25, A), (0.25, NIGHT)]),
    ):
        assert where.sum() > 50
        assert (got[where] == total(parts)).all()


def test_touching_balls_of_glass(device: Device) -> None:
    """On the axis a ray leaves one ball exactly where it touches the next. A root at 0 is none: it is in the next one.

    So it meets the first one twice and the second one once, from inside, whether that is glass or not.
    """
    for second in (0.5, 0.0):
        camera = eye(8, size=(1, 1))
        scene = glowing(camera, [((0, 0, -5), 1), ((0, 0, -7), 1)], [A, B], transmittance=[0.5, second], index=1.5)
        parts = [(0.5, A), (0.25, A)]
        parts += [(0.125, B), (0.125, NIGHT)] if second else [(0.25, B)]
        assert (show(scene, device) == total(parts)).all(), second


def test_a_ball_that_is_there_twice(device: Device) -> None:
    """The lower number is met, entering and leaving, and the other one never."""
    camera = eye(8, tan=0.3, size=(24, 18))
    twins, colors = [((0, 0.25, -5), 1), ((0, 0.25, -5), 1)], [A, B]
    for index in (1.0, 1.5):
        both = drawn(glowing(camera, twins, colors, transmittance=0.5, reflectance=0.25, index=index), device)
        one = drawn(glowing(camera, twins[:1], colors[:1], transmittance=0.5, reflectance=0.25, index=index), device)
        assert np.array_equal(both.color, one.color)
        assert np.array_equal(both.id, one.id)


def test_index_1_changes_nothing(device: Device) -> None:
    """A ball of t = 1 and index 1 before the eye is not to be seen. Its shadow falls where nobody looks."""
    rng = np.random.default_rng(4)
    n = 12
    centers, radii = rng.uniform(-2, 2, (n, 3)) + (0, 0, -9), rng.uniform(0.3, 0.8, n)
    lights = [ambient_light(), parallel_light((-1, -0.5, 0.4)), parallel_light((0.5, -1, 0.5), (0.5, 0.2, 0.3))]
    camera = eye(20, tan=0.4, size=(48, 36))
    mirror = np.where(np.arange(n) % 3, 0, 0.5)
    bare = Scene.from_spheres(camera, lights, centers, radii, shades(n), reflectance=mirror, background=NIGHT)
    for radius, at in ((1.0, (0.0, 0.0, -4.0)), (1.0, (0.2, 0.1, 0.3))):  # before the eye, and around it
        covered = Scene.from_spheres(
            replace(camera, max_bounces=60),
            lights,
            [*centers, at],
            [*radii, radius],
            [*shades(n), A],
            reflectance=[*mirror, 0],
            transmittance=[0] * n + [1],
            index=[0] * n + [1],
            background=NIGHT,
        )
        one, two = drawn(bare, device), drawn(covered, device)
        assert (two.id == n).mean() > 0.2
        # A mirror behind the glass shows the world through the glass again, and its depth counts the glass: so 60.
        apart = np.abs(one.color - two.color).max(axis=2)
        assert (apart > 1e-5).mean() <= 2e-3
        assert (np.abs(one.rgb8.astype(int) - two.rgb8).max(axis=2) > 1).mean() <= 2e-3


def test_exactly_tangent_rays(device: Device) -> None:
    """Where n.d is 0, a ray meets glass once. With index 1 it goes on, with 3/4 it is mirrored: straight on.

    The middle pixel's ray is (0, 0, -1); a ball at (x, y, -z) of radius |(x, y)| touches it, in whole numbers.
    """
    for x, y, radius in ((0, 1, 1), (3, 4, 5), (-5, 12, 13), (8, -15, 17), (-1, 0, 1)):
        for index in (1.0, 0.75):
            scene = glowing(eye(4, size=(1, 1)), [((x, y, -20), radius)], A, transmittance=0.5, index=index)
            image = drawn(scene, device)
            assert (image.id == 0).all()
            assert (channel(image, "color") == total([(0.5, A), (0.5, NIGHT)])).all(), (x, y, index)


def test_index_0_of_what_is_opaque(device: Device) -> None:
    """Most files have iof 0 on everything opaque, mirrors too: it means nothing there."""
    for seed in range(4):
        scene = random_tree(seed)
        materials = scene.materials.copy()
        opaque = materials["transmittance"] == 0
        assert opaque.any()
        pictures = []
        for index in (0.0, 1.5):
            materials["index"][opaque] = index
            pictures.append(drawn(replace(scene, materials=materials), device))
        assert np.array_equal(pictures[0].color, pictures[1].color)
    with pytest.raises(ValueError, match="index"):
        glowing(eye(1), [((0, 0, -5), 1)], A, transmittance=0.5, index=0)


# ---------------------------------------------------------------------------------------------- what must not be culled


def test_what_only_a_mirror_shows_keeps_its_shadow(device: Device) -> None:
    """A black mirror of r = 1/2 shows the ball behind the eye; what shades that ball is out of the picture, too.

    On the axis the mirror at (0, 0, -4) looks straight back, at P = (0, 0, 19), n = (0, 0, -1). The light is at
    (3, 0, 10): n.l = 9/sqrt(90), and half of that is seen. With a ball of 0.3 on the way it is dark there.
    """
    light = [point_light((3, 0, 10), WHITE)]
    for blocked in (False, True):
        balls = [((0, 0, -5), 1), ((0, 0, 20), 1), *([((1.5, 0, 14.5), 0.3)] if blocked else [])]
        centers, radii = zip(*balls, strict=True)
        kd = [0.0, 1.0, 1.0][: len(balls)]
        mirror = [0.5, 0.0, 0.0][: len(balls)]
        for keep in ((), ("receivers",)):
            scene = Scene.from_spheres(
                eye(1, size=(1, 1)), light, centers, radii, WHITE, ka=0, kd=kd, ks=0, reflectance=mirror
            )
            image = drawn(scene, device, keep=keep)
            assert (image.id == 0).all()
            want = 0.0 if blocked else 0.5 * 9 / math.sqrt(90)
            assert image.color.ravel() == pytest.approx([want] * 3, abs=1e-6)


def test_what_mirrors_nothing_of_its_own_still_shows_the_lit(device: Device) -> None:
    """All that is seen directly is black: lights matter all the same, and so do highlights."""
    here, aslant = (0, 0, 0), 1 / math.sqrt(2)
    for light, kd, ks, want in (
        (point_light(here, WHITE), 1.0, 0.0, 1.0),
        (point_light(here, WHITE), 0.0, 1.0, 1.0),
        (spot_light(here, (0, 0, 1), 20, 30, WHITE), 1.0, 0.0, 1.0),
        (spot_light(here, (0, 0, 1), 20, 30, WHITE), 0.0, 1.0, 1.0),
        (parallel_light((1, 0, 1), WHITE), 1.0, 0.0, aslant),
        (parallel_light((1, 0, 1), WHITE), 0.0, 1.0, aslant**2),
    ):
        for bounces in (1, 8):
            scene = Scene.from_spheres(
                eye(bounces, size=(1, 1)),
                [light],
                [(0, 0, -5), (0, 0, 20)],
                [1, 1],
                [BLACK, WHITE],
                ka=0,
                kd=[0, kd],
                ks=[0, ks],
                exponent=2,
                reflectance=[1, 0],
            )
            # The mirrored ray goes along +z, to where n = v = (0, 0, -1), and l, too, or l = (-1, 0, -1)/sqrt(2).
            assert show(scene, device).ravel() == pytest.approx([want] * 3, abs=1e-6), (light, kd, ks)


def test_a_faint_highlight_that_a_mirror_makes_bright(device: Device) -> None:
    """(r.v)^80 with r.v = 1/sqrt(2) is 2^-40, too faint for a byte; a mirror of r = 2^40 shows it as white."""
    scene = Scene.from_spheres(
        eye(1, size=(1, 1)),
        [parallel_light((1, 0, 1), WHITE)],
        [(0, 0, -5), (0, 0, 20)],
        [1, 1],
        [BLACK, WHITE],
        ka=0,
        kd=0,
        ks=[0, 1],
        exponent=80,
        reflectance=[2.0**40, 0],
    )
    assert show(scene, device).ravel() == pytest.approx([1.0] * 3, rel=1e-4)


def test_what_is_within(device: Device) -> None:
    """A ball in an opaque one is hidden, also if that one mirrors; in glass it is seen, and from within, too."""
    balls = [((0, 0, -5), 2), ((0, 0, -5), 1)]
    for r, t, parts in (
        (0.0, 0.0, [(1.0, A)]),
        (0.5, 0.0, [(0.5, A), (0.5, NIGHT)]),
        (0.0, 0.5, [(0.5, A), (0.5, B)]),
        (0.25, 0.5, [(0.25, A), (0.25, NIGHT), (0.5, B)]),
    ):
        scene = glowing(eye(8, size=(1, 1)), balls, [A, B], reflectance=[r, 0], transmittance=[t, 0], index=1.5)
        assert (show(scene, device) == total(parts)).all(), (r, t)
        assert (show(scene, device, keep=("hidden",)) == total(parts)).all(), (r, t)
    # From between the two, with a mirror around: back to the inner one, and never out.
    inside = glowing(eye(8, at=(0, 0, -3.5), size=(1, 1), axis=(0, 0, 1)), balls, [A, B], reflectance=[0.5, 0])
    assert (show(inside, device) == total([(0.5, A), (0.5, B)])).all()


def test_what_is_within_a_ball_that_glass_lets_rays_into(device: Device) -> None:
    """A ray gets into an opaque ball where glass touches it, or where glass of a lower number is in its place.

    Then what is within that ball is seen, although from outside the ball hides it.
    """
    touching = [((0, 0, -5), 1), ((0, 0, -7), 1), ((0, 0, -7), 0.5)]
    in_place = [((0, 0, -5), 1), ((0, 0, -5), 1), ((0, 0, -5), 0.5)]
    for balls, parts in (
        (touching, [(0.5, A), (0.25, A), (0.25, RED)]),
        (in_place, [(0.5, A), (0.5, RED)]),
    ):
        scene = glowing(eye(8, size=(1, 1)), balls, [A, B, RED], transmittance=[0.5, 0, 0], index=1.5)
        assert (show(scene, device) == total(parts)).all()
        assert (show(scene, device, keep=("hidden",)) == total(parts)).all()
    # The other way round, the opaque one is met.
    scene = glowing(eye(8, size=(1, 1)), in_place, [B, A, RED], transmittance=[0, 0.5, 0], index=1.5)
    assert (show(scene, device) == total([(1.0, B)])).all()


# -------------------------------------------------------------------------------------------------- leaks and self-hits


def sizes_and_places() -> Iterable[tuple[float, np.ndarray]]:
    """Radii, and centres near, at a radius from and far from the origin."""
    for exponent, far in itertools.product(range(-3, 8), (0.0, 1.0, 1e3)):
        R = float(np.float32(10.0**exponent))
        yield R, far * R * np.array([1, -1, 1.0])


def check_lone_balls(device: Device, side: int) -> None:
    """Rays from a lone ball: all that it mirrors is night; all that enters leaves after one wall more."""
    for R, C in sizes_and_places():
        camera = replace(looking((C + (0, 0, 3 * R)).tolist(), 0.34, (side, side)), max_bounces=8)
        assert (show(glowing(camera, [(C, R)], RED, BLUE, reflectance=1), device) == BLUE).all(), (R, C)
        for index in (1.5, 1.0, 0.9375):
            image = drawn(glowing(camera, [(C, R)], RED, BLUE, transmittance=0.5, index=index), device)
            hit, color = image.id.ravel() == 0, channel(image, "color")
            # Half from the first wall, a quarter from the second; beyond index 15/16 of R a ray is all mirrored.
            entered, grazed = ((color == of).all(axis=1) for of in ((0.75, 0, 0.25), (0.5, 0, 0.5)))
            assert hit.sum() > 0.1 * side**2
            assert (color[~hit] == BLUE).all()
            assert (entered | grazed)[hit].all(), (R, C, index)
            assert index < 1 or not grazed.any(), (R, C, index)


def check_closed_rooms(device: Device, side: int, bounces: int) -> None:
    """Rays within a mirror, and between a mirror and a shell around it that is larger by g or by an ulp, stay there."""
    for R, C in sizes_and_places():
        rooms = [([(C, R)], C + (0.3 * R, 0.2 * R, -0.1 * R))]
        gaps = () if C.any() else (1e-2, 1e-4, 1e-6)
        rooms += [([(C, R), (C, R * (1 + g))], C + (0, 0, R * (1 + g / 2))) for g in gaps]
        for (balls, at), r in itertools.product(rooms, (1.0, 0.75)):
            camera = replace(looking(at.tolist(), 2, (side, side)), max_bounces=bounces)
            color = show(glowing(camera, balls, GREEN, RED, reflectance=r), device)
            assert (color[:, 0] == 0).all(), (R, C, len(balls), r)
            assert np.abs(color[:, 1] - 1).max() <= 2.0**-23, (R, C, len(balls), r)


def test_no_self_hits(device: Device) -> None:
    check_lone_balls(device, 20)


def test_no_leaks(device: Device) -> None:
    check_closed_rooms(device, 6, 30)


@pytest.mark.stress
def test_no_self_hits_and_no_leaks_in_ten_million_rays(device: Device) -> None:
    check_lone_balls(device, 230)
    check_closed_rooms(device, 60, 60)
