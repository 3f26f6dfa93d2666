"""The stress catalogue: one test per case, named after it (`pytest -k L9_`; all: `-m "stress or not stress"`).

G big spheres, T tiny ones, O offsets, K scales, X the ends of the range, R degenerate spheres, D rays, I inside and on
the surface, L lights and shadows, C cameras, P Phong, N what is refused. Geometry and shadows are held against the
exact oracle, colours against the reference. Each docstring says what could go wrong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mpmath
import numpy as np
import pyopencl as cl
import pytest
from stress_cases import (
    OUTPUTS,
    channel,
    check,
    check_colors,
    check_shadows,
    lighting,
    picture,
    renderer,
)

import cltrace
from cltrace import Camera, Renderer, Scene, ambient_light, parallel_light, point_light, spot_light
from cltrace.bench.cases import (
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
from cltrace.bench.oracle import normal_error
from cltrace.bench.regimes import TANGENT, globe
from cltrace.reference import EYE, Direction, Ray, world_of
from cltrace.run.devices import Device

both = pytest.mark.parametrize("precision", ["accurate", "double"])
# double leaves out the filter, and that is all: in the ordinary run a few cases are enough.
mostly = pytest.mark.parametrize("precision", ["accurate", pytest.param("double", marks=pytest.mark.stress)])


@pytest.fixture(params=[pytest.param(1, id="short"), pytest.param(16, id="long", marks=pytest.mark.stress)])
def amount(request: pytest.FixtureRequest) -> int:
    """How many times as much as in the ordinary run."""
    return int(request.param)


def same(a: cltrace.Image, b: cltrace.Image, *names: str) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names or OUTPUTS)


# ------------------------------------------------------------------------------------------------ big, tiny, far away


@mostly
@pytest.mark.parametrize(
    ("R", "height"),
    [pytest.param(R, h, id=name) for name, R, h in (("G1", 1e3, 1), ("G2", 1e5, 1), ("G3", 1e7, 1), ("G5", 1e7, 1.3))],
)
def test_G_ground_sphere(device: Device, precision: str, amount: int, R: float, height: float) -> None:
    """|C|^2 - R^2 cancels and R^2 swamps r^2 - v^2: rings, lost hits, or the height rounded away."""
    dip = math.sqrt(2 * height / R)
    for tan, size in ((14.1, (3, 300 * amount)), (4 * dip, (3, 300 * amount)), (2 * dip, frame(amount, 400))):
        image = check(balls(looking((0, height, 0), tan, size), [((0, -R, 0), R)]), device, precision, 20)
        # No rings: along every column the ground is the farther the higher, and its normal turns one way.
        depth, n = image.depth[::-1], image.normal[::-1]
        seen = np.isfinite(depth[:-1]) & np.isfinite(depth[1:])
        assert seen.any()
        assert (depth[1:][seen] >= depth[:-1][seen]).all()
        assert (n[1:, :, 2][seen] <= n[:-1, :, 2][seen]).all()


@mostly
@pytest.mark.parametrize("R", [1e3, 1e5, 1e7])
def test_G4_tilted_globe(device: Device, precision: str, amount: int, R: float) -> None:
    """As G1 to G3, and no coordinate of the centre is exact."""
    rng = np.random.default_rng(int(R))
    for seed in range(1 if amount == 1 else 20):
        check(globe("G4", R, (0, 0), seed, frame(amount, 300)), device, precision, 10)
        w = unit(rng)
        check(balls(looking(tan=1.5, size=frame(amount, 300)), [(-(R + 1) * w, R)]), device, precision, 10)


@mostly
@pytest.mark.parametrize(
    ("r", "distance"),
    [
        pytest.param(r, d, id=name)
        for name, r, d in (("T1", 1e-3, 1e4), ("T2-100", 1, 100), ("T2-4100", 1, 4100), ("T2-1e4", 1, 1e4))
    ],
)
def test_T_tiny_in_the_distance(device: Device, precision: str, amount: int, r: float, distance: float) -> None:
    """r^2 vanishes in |C|^2, and a direction of float32 passes by: a coin toss."""
    rng = np.random.default_rng(2)
    for axis in AXES[: 1 if amount == 1 else 6]:
        camera = looking(tan=1.2 * r / distance, size=frame(amount), axis=axis)
        ahead = np.array(axis) * distance + r * np.array([0.31, -0.17, 0.23])
        check(balls(camera, [(ahead, r)]), device, precision, 20)
    camera = looking(tan=1, size=frame(amount, 400))
    check(balls(camera, aimed(camera, distance, r, limbs(4, 26, 46 * math.isqrt(amount), rng), rng)), device, precision)


@pytest.mark.parametrize(
    "offset",
    [pytest.param((k * 1e4, k * -7e3, k * 3e3), id=name) for name, k in (("O1", 1), ("O2", 100), ("O3", 1000))],
)
def test_O_offset(device: Device, offset: tuple[float, ...]) -> None:
    """World coordinates lose the digits that tell hits from misses: another picture than at the origin."""
    assert same(picture(everything(), device), picture(everything(offset), device))


@mostly
@pytest.mark.parametrize("eye", [(0, 0, 0), (1e3, -1e3, 5e2)])
def test_O4_small_and_far_off(device: Device, precision: str, amount: int, eye: tuple[float, ...]) -> None:
    """P = o + t d is off the surface by 5 % of r, so a normal made from it is off by 0.05 rad."""
    r, distance = 1e-3, 5e-3 if any(eye) else 1e3
    camera = looking(eye, 1.2 * r / distance, frame(amount))
    center = np.array(eye) + (3e-4, -2e-4, -distance)
    check(balls(camera, [(center, r)]), device, precision, 40 * amount)


@pytest.mark.parametrize("factor", [pytest.param(1e-6, id="K1"), pytest.param(1e6, id="K2")])
def test_K_scale(device: Device, factor: float) -> None:
    """An absolute epsilon: spheres vanish when they are small, and shade themselves when they are big."""
    one, other = picture(everything(), device), picture(everything(factor=factor), device)
    assert same(one, other, "rgb8", "id", "shadow_rays")
    check_colors(everything(factor=factor), other)


def test_K1_K2_powers_of_two(device: Device, amount: int) -> None:
    """Any constant with a unit: then a scene times 2^k is not the same picture, bit for bit."""
    for precision in ("accurate",) if amount == 1 else ("accurate", "double"):
        one = picture(everything(), device, precision)
        for k in (-60, -23, 1, 60) if amount == 1 else range(-60, 61, 1 if precision == "accurate" else 12):
            other = picture(everything(factor=2.0**k), device, precision)
            assert same(one, other, "rgb8", "id", "color", "normal", "direction", "shadow_rays"), k
            assert np.array_equal(np.ldexp(other.depth, -k), one.depth), k


@mostly
@pytest.mark.parametrize(
    "r",
    [pytest.param(r, id=name) for name, r in (("X1", 1e20), ("X2", 1e30), ("X3", 1e-25), ("X4", 2.0**-149))],
)
def test_X_ends_of_the_range(device: Device, precision: str, amount: int, r: float) -> None:
    """r^2 is infinite or 0 in float32: every hit is lost, or every ray hits."""
    camera = looking(tan=0.25, size=frame(amount, 300))
    lights = [point_light((6 * r, 6 * r, 0), (0.5, 0.2, 0.3)), parallel_light((1, -1, -2), (0.2, 0.5, 0.3))]
    spheres: list[Ball] = [((0, 0, -5 * r), r), ((r, -r, -6 * r), 2 * r)]
    image = check(balls(camera, spheres, lights, ks=0), device, precision, 20)
    check_colors(balls(camera, spheres, lights, ks=0), image)
    check(balls(camera, spheres[:1]), device, precision, 20)


# -------------------------------------------------------------------------------------------------------- degenerate


@pytest.mark.parametrize("r", [0.0, -0.0, -1.0, -1e-45])
def test_R0_no_radius(r: float) -> None:
    """0/0 for a normal."""
    text = (
        f"must be > 0, got {r:g}"
        if abs(r) > 1e-44 or not r
        else "must be 0 or at least 1.4e-45 in magnitude, got -1e-45"
    )
    with pytest.raises(ValueError) as caught:
        balls(Camera(), [((0, 0, -5), 1), ((0, 0, -5), r)])
    assert str(caught.value) == f"radii[1]: {text}"


@mostly
@pytest.mark.parametrize("r", [1.0, *(pytest.param(r, marks=pytest.mark.stress) for r in (1e-3, 1e6))])
def test_R1_concentric_one_ulp_apart(device: Device, precision: str, amount: int, r: float) -> None:
    """The two merge: which one is hit is random, and the inner one is lit through the outer one."""
    inner, outer = ulp32(r, 0), ulp32(r)
    for first, second in ((inner, outer), (outer, inner)):
        spheres: list[Ball] = [((0, 0, 0), first), ((0, 0, 0), second)]
        seen = check(balls(looking((0, 0, 3 * r), 0.5, frame(amount, 300)), spheres), device, precision).id
        assert set(seen[seen >= 0]) == {int(second > first)}
        seen = check(balls(looking((0.25 * r, 0, 0.5 * r), 2, frame(amount, 300)), spheres), device, precision).id
        assert set(seen.ravel()) == {int(second < first)}
        # From between the two: straight down, and across, where the horizon is.
        for tan, axis, seen in ((3, AHEAD, {int(second < first)}), (1, RIGHT, {0, 1})):
            eye = (0, 0, (inner + outer) / 2)
            scene = lit(looking(eye, tan, frame(amount, 300), axis), spheres, (0, 0, 3 * r), (0, 0, -1))
            image = check_shadows(scene, device, precision, 30 * amount)
            assert set(image.id.ravel()) == seen
            assert (image.color == 0).all()


def test_R2_duplicates_and_permutations(device: Device, width: int, amount: int) -> None:
    """Equal spheres fight for pixels: who wins depends on the order of the work."""
    rng = np.random.default_rng(8)
    one = picture(everything(), device, "accurate", width)
    for _ in range(1 if amount == 1 else 30):
        order = rng.permutation(10)
        other = picture(everything(order=tuple(order.tolist())), device, "accurate", width)
        assert np.array_equal(np.where(other.id >= 0, order[other.id], -1), one.id)
        assert same(one, other, *(set(OUTPUTS) - {"id"}))
        # Three of each sphere, shuffled: what is seen is the first of the three.
        order = rng.permutation(np.repeat(np.arange(10), 3))
        first = np.array([np.flatnonzero(order == k)[0] for k in range(10)])
        thrice = everything(order=tuple(order.tolist()))
        other = picture(thrice, device, "accurate", width)
        assert np.array_equal(other.id, np.where(one.id >= 0, first[one.id], -1))
        assert same(one, other, "rgb8", "color", "normal", "depth")


@both
def test_R3_overlapping(device: Device, precision: str, amount: int) -> None:
    """Two spheres are equally near, or nearly: below an ulp of float32 the farther one is seen."""
    camera = looking(tan=0.1, size=frame(amount))
    ties: list[Ball] = [((3, 0, -10), 5), ((-3, 0, -10), 5), ((0, 3, -10), 5), ((0, -3, -10), 5)]
    for order in (ties, ties[::-1]):
        image = check(balls(camera, order), device, precision)
        middle = image.id.shape[0] // 2, image.id.shape[1] // 2
        assert image.id[middle] == 0
        assert image.depth[middle] == 6
    # Pairs through one point of a pixel's ray, but for 2^-k of their radii, or for roundings.
    rng = np.random.default_rng(9)
    camera = looking(tan=0.7, size=frame(amount))
    for apart in [2.0**-40, 0, 0, 0] if amount == 1 else [2.0**-30, 2.0**-40, 2.0**-50, 0, 0, 0] * amount:
        d = directions(camera)[rng.integers(len(directions(camera)))]
        p = d * rng.uniform(4, 6)
        centers = p + d + unit(rng, 2) * 0.5
        radii = np.linalg.norm(centers - p, axis=1) * (1 + np.array([0, apart]))
        check(balls(camera, list(zip(centers, radii, strict=True))), device, precision)


# -------------------------------------------------------------------------------------------------------------- rays


@both
def test_D1_grazing(device: Device, precision: str, amount: int) -> None:
    """Rays that pass at r (1 +/- 2^-k), k = 8..26 and on to 52, are decided by noise."""
    rng = np.random.default_rng(3)
    camera = looking(tan=6, size=frame(1, 1200))
    for low, high, distance in ((8, 26, 5), (27, 46, 5), (47, 52, 5), (47, 52, 50)) * amount:
        scale = rng.uniform(0.5, 2, 60)
        spheres = aimed(camera, distance * scale, scale, limbs(low, high, 60, rng), rng)
        check(balls(camera, spheres), device, precision)


@mostly
def test_D2_tangent(device: Device, precision: str, amount: int) -> None:
    """A discriminant of exactly 0 comes out as noise: two hits or none, and a normal from anywhere."""
    image = check(balls(looking((0, 1, -5), 0.5, (1, 1), BACK), [((0, 0, 0), 1)]), device, precision)
    assert (image.id.item(), image.depth.item()) == (0, 5)
    assert image.normal.ravel().tolist() == [0, 1, 0]
    for i, (x, y) in list(enumerate(TANGENT))[:: 3 if amount == 1 else 1]:
        s, z = 2.0 ** (10 * (i % 4 - 1)), 7.0 * 10.0 ** (i % 5)
        image = check(balls(looking(tan=0.5, size=(3, 3)), [((x * s, y * s, -z), 5 * s)]), device, precision)
        assert (image.id[1, 1], image.depth[1, 1]) == (0, z)
        assert np.abs(image.normal[1, 1] + np.array([x, y, 0]) / 5).max() <= 2.0**-24


@mostly
@pytest.mark.parametrize("tan", [1e-3, 1.0, 573.0, 572958.0])
def test_D3_directions_of_any_length(device: Device, precision: str, amount: int, tan: float) -> None:
    """Code that takes |d| for 1: t in other units, P somewhere else. Here |d| is up to 8e5."""
    rng = np.random.default_rng(4)
    camera = looking(tan=tan, size=frame(amount))
    scene = balls(camera, aimed(camera, 50, 1, limbs(2, 20, 19 * math.isqrt(amount), rng), rng))
    check(scene, device, precision, 20)


@pytest.mark.parametrize("length", [1e-30, 1e-3, 1.0, 1e3])
def test_D3_length_of_the_references_rays(length: float) -> None:
    """The same of the reference, whose rays may have any length: t is in units of d, P stays."""
    sphere = world_of(balls(Camera(), [((0.25, -0.5, -5), 1)])).surfaces[0]
    d = Direction(0.125, -0.0625, -1.0)
    t = sphere.intersect(Ray(EYE, d))
    scaled = Ray(EYE, d * length)
    again = sphere.intersect(scaled)
    assert t is not None
    assert again is not None
    assert abs(again * length / t - 1) < 1e-15
    point, far = scaled.at(again), Ray(EYE, d).at(t)
    assert max(abs(point.x - far.x), abs(point.y - far.y), abs(point.z - far.z)) < 1e-14


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"lookat": (0, 0, 0)}, "camera.lookat: must differ from position"),
        ({"lookat": (0, math.nan, 0)}, "camera.lookat[1]: must be a finite number, got nan"),
        ({"lookat": (0, 0, -math.inf)}, "camera.lookat[2]: must be a finite number, got -inf"),
        ({"position": (math.inf, 0, 0)}, "camera.position[0]: must be a finite number, got inf"),
        ({"up": (0, 0, 0)}, "camera.up: must not be 0"),
    ],
)
def test_D4_no_direction(changed: dict[str, tuple[float, ...]], message: str) -> None:
    """A direction of 0 or NaN reaches the kernel, where NaN compares false and counts as a hit."""
    with pytest.raises(ValueError) as caught:
        Camera(**changed)  # type: ignore[arg-type]
    assert str(caught.value) == message


def test_D4_no_direction_for_the_reference() -> None:
    """A ray that goes nowhere meets nothing, from outside and from inside."""
    for center in ((0, 0, -5), (0, 0, 0)):
        sphere = world_of(balls(Camera(), [(center, 1)])).surfaces[0]
        assert sphere.intersect(Ray(EYE, Direction(0.0, 0.0, 0.0))) is None


@mostly
@pytest.mark.parametrize("axis", AXES)
def test_D5_along_an_axis(device: Device, precision: str, axis: tuple[int, int, int]) -> None:
    """Zeros, and negative ones, in d: sign(0) = 0 makes q and then t NaN."""
    image = check(balls(looking((0, 0, 0), 1, (1, 1), axis), [((0, 0, 0), 2.5)]), device, precision)
    assert (image.id.item(), image.depth.item()) == (0, 2.5)
    assert image.normal.ravel().tolist() == [-a for a in axis]
    ahead = tuple(-0.0 if a == 0 else 5.0 * a for a in axis)
    image = check(balls(looking((-0.0, -0.0, -0.0), 1, (3, 3), axis), [(ahead, 1)]), device, precision)
    assert (image.id[1, 1], image.depth[1, 1]) == (0, 4)
    assert image.normal[1, 1].tolist() == [-a for a in axis]


@mostly
@pytest.mark.parametrize("k", range(7))
def test_I1_inside(device: Device, precision: str, amount: int, k: int) -> None:
    """Close to the wall, r^2 - v^2 cancels; and the normal has to face the eye."""
    rng = np.random.default_rng(k)
    for axis in AXES[k % 6 :][:1] if amount == 1 else AXES:
        for w in (np.array(AHEAD), unit(rng))[: 1 if amount == 1 else 2]:
            eye = w * (1 - 10.0**-k)
            image = check(balls(looking(eye, 3, frame(amount, 300), axis), [((0, 0, 0), 1)]), device, precision, 20)
            assert (image.id == 0).all()
            assert ((image.normal * image.direction).sum(axis=-1) < 0).all()


@mostly
@pytest.mark.parametrize("axis", AXES)
def test_I2_on_the_surface(device: Device, precision: str, amount: int, axis: tuple[int, int, int]) -> None:
    """The root 0 is taken for a hit at random. Outward is a miss, tangential too, and inward t = 2b/a."""
    surfaces = (((0, 0, -1), 1.0), ((2, -3, 6), 7.0), ((-1, 2, -2), 3.0), ((3e4, 4e4, 12e4), 13e4))
    for center, r in surfaces[: 2 if amount == 1 else 4]:
        camera = looking((0, 0, 0), 0.9 / math.sqrt(2), frame(amount, 200), axis)
        image = check(balls(camera, [(center, r)]), device, precision, 10)
        assert ((image.normal * image.direction).sum(axis=-1)[image.id >= 0] < 0).all()
        b = float(np.dot(center, axis))
        middle = image.id.shape[0] // 2, image.id.shape[1] // 2
        assert image.id[middle] == (0 if b > 0 else -1)
        assert image.depth[middle] == (2 * b if b > 0 else np.inf)


@mostly
@pytest.mark.parametrize("k", range(1, 7))
def test_I3_just_above_the_surface(device: Device, precision: str, amount: int, k: int) -> None:
    """c = |C|^2 - r^2 cancels to 10^-k."""
    rng = np.random.default_rng(k)
    for axis in (AXES[3 * (k % 2)],) if amount == 1 else AXES:  # down and, where the horizon is, across
        for w in (np.array(BACK), unit(rng))[: 1 if amount == 1 else 2]:
            camera = looking(w * (1 + 10.0**-k), 3, frame(amount, 300), axis)
            check(balls(camera, [((0, 0, 0), 1)]), device, precision, 20)


@mostly
@pytest.mark.parametrize("r", [1.0, pytest.param(1e-3, marks=pytest.mark.stress), 1e7])
def test_I4_at_the_centre(device: Device, precision: str, amount: int, r: float) -> None:
    """b = 0 for every ray."""
    eye = (3.0, -5.0, 7.0)
    for axis in AXES[: 2 if amount == 1 else 6]:
        image = check(balls(looking(eye, 2, frame(amount, 200), axis), [(eye, r)]), device, precision, 10)
        assert np.abs(image.depth / r - 1).max() <= 2.0**-51
        assert np.abs(image.normal + image.direction).max() <= 2.0**-24
        middle = image.id.shape[0] // 2, image.id.shape[1] // 2
        assert image.depth[middle] == r
        assert image.normal[middle].tolist() == [-a for a in axis]


# ------------------------------------------------------------------------------------------------ lights and shadows


@mostly
@pytest.mark.parametrize("R", [1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("far", [0, *(pytest.param(far, marks=pytest.mark.stress) for far in (1, 1e3)), 1e6])
def test_L1_own_shadow(device: Device, precision: str, amount: int, R: float, far: float) -> None:
    """A sphere that shades itself: acne."""
    w = unit(np.random.default_rng(int(far)))
    C = far * R * w
    spheres: list[Ball] = [(C, R), (C - (0, 40 * R, 0), R)]
    scene = lit(looking(C + (0, 0, 3 * R), 0.4, frame(amount, 200)), spheres, C + R * np.array([2, 3, 4]), (1, -2, -1))
    image = check_shadows(scene, device, precision, 40 * amount)
    _, want = lighting(scene, image, 40 * amount)
    assert (want[..., 0] == want[..., 1]).all()
    assert (want[..., 0].sum(axis=0) >= 10).all()


# P = (0, 0, -4) on a sphere, seen along the axis; from there along (3, 0, 4) to an occluder whose surface is entered at
# (3, 0, 0) and left at (9, 0, 8). All of it is exact, also in the kernel.
OWN: Ball = ((0, 0, -5), 1)
OCCLUDER: Ball = ((6, 0, 4), 5)
ENTRY, EXIT = (3.0, 0.0, 0.0), (9.0, 0.0, 8.0)


def lit_at_p(device: Device, precision: str, light: Sequence[float], occluder: Ball = OCCLUDER) -> bool:
    """Whether the light reaches P; all other pixels are checked, too."""
    scene = lit(looking(tan=0.19, size=(11, 9)), [OWN, occluder], light, (-3, 0, -4))
    image = check_shadows(scene, device, precision, 60)
    assert image.depth[4, 5] == 4
    assert image.color[4, 5, 1] == 0 or occluder is not OCCLUDER
    return bool(image.color[4, 5, 0] > 0)


@mostly
def test_L2_light_before_and_beyond(device: Device, precision: str) -> None:
    """What is behind the light, or behind the point, casts a shadow."""
    before, behind = (math.nextafter(3.0, 0.0), 0.0, 0.0), (math.nextafter(9.0, 10.0), 0.0, 8.0)
    assert lit_at_p(device, precision, before)
    assert lit_at_p(device, precision, (1.5, 0, -2))
    assert not lit_at_p(device, precision, (math.nextafter(3.0, 4.0), 0, 0))
    assert not lit_at_p(device, precision, behind)
    assert not lit_at_p(device, precision, (12, 0, 12))
    assert not lit_at_p(device, precision, (3e10, 0, 4e10))
    assert lit_at_p(device, precision, (12, 0, 12), ((-6, 0, -12), 5))


@mostly
def test_L3_light_inside_another_sphere(device: Device, precision: str, amount: int) -> None:
    """The sphere that holds the light darkens what is outside of it, and nothing that is inside of it, too."""
    assert not lit_at_p(device, precision, (6, 0, 4))
    assert not lit_at_p(device, precision, (6, 1, 3))
    camera = looking((0, 0, 0), 0.5, frame(amount, 200))
    room: list[Ball] = [((0, 1, -3), 9), ((0, -0.5, -5), 1), ((1, 0.5, -4), 0.5)]
    inside = check_shadows(lit(camera, room, (2, 3, -1), (0, -1, -1)), device, precision, 60 * amount)
    assert inside.color[..., 0].max() > 0
    assert inside.color[..., 1].max() == 0
    outside = check_shadows(lit(camera, room, (20, 30, -1), (0, -1, -1)), device, precision, 60 * amount)
    assert outside.color.max() == 0


@mostly
@pytest.mark.parametrize("r", [1.0, *(pytest.param(r, marks=pytest.mark.stress) for r in (1e-3, 1e6))])
def test_L4_room(device: Device, precision: str, amount: int, r: float) -> None:
    """A room darkens itself; or it does not, with the light outside of it."""
    room: list[Ball] = [((0, 0, 0), r)]
    for point, bright in (
        ((0.3, 0.5, -0.2), True),
        ((0, math.nextafter(1, 0), 0), True),
        ((0, 1, 0), True),  # exactly on the wall: nothing is between
        ((0, math.nextafter(1, 2), 0), False),
        ((0, 3, 1), False),
    ):
        light = np.array(point) * r
        scene = lit(looking((0.125 * r, 0, 0.5 * r), 1, frame(amount, 150)), room, light, (0, -1, 0))
        image = check_shadows(scene, device, precision, 40 * amount)
        assert (image.color[..., 1] == 0).all()
        assert ((image.color[..., 0] > 0) == bright).all()


@mostly
def test_L5_light_on_an_occluder(device: Device, precision: str) -> None:
    """The light is where the occluder is entered, root = 1: a coin toss. The interval is open: it shines."""
    assert lit_at_p(device, precision, ENTRY)
    assert not lit_at_p(device, precision, EXIT)


@mostly
def test_L6_light_at_the_point(device: Device, precision: str) -> None:
    """L = P, or all but: 0/0. And a light in the tangent plane is no light."""
    ambient = np.float32(0.25)
    for eye, axis, spheres in (
        ((0, 0, 4), AHEAD, [((0, 0, -1), 1), ((0, -9, 0), 1)]),
        ((0, 0, 1), AHEAD, [((0, 0, 1), 1), ((0, 0, 1), 9)]),  # from inside
    ):
        # The ray along the axis meets the first sphere at the origin.
        for light in ((0, 0, 0), (0, 0, 1e-30), (0, 0, -1e-30), (1e-30, 0, 0), (1e-3, 0, 0), (0, -1e-9, 0)):
            lights = [ambient_light((1, 1, 1)), point_light(light, (1, 0, 0)), parallel_light((1, 0, 0), (0, 1, 0))]
            scene = balls(looking(eye, 0.1, (9, 7), axis), spheres, lights, ka=0.25, kd=1, ks=0)
            image = check(scene, device, precision)
            assert image.depth[3, 4] == eye[2]
            assert image.color[3, 4, 1] == ambient
            assert image.color[3, 4, 2] == ambient
            if light == (0, 0, 1e-30):
                assert ambient <= image.color[3, 4, 0] <= ambient + 1
            else:
                assert image.color[3, 4, 0] == ambient


@mostly
@pytest.mark.parametrize("height", [1e-6, -1e-6])
def test_L7_light_at_the_surface(device: Device, precision: str, amount: int, height: float) -> None:
    """A light 1e-6 above the surface is swallowed by an epsilon, and one below it leaks out."""
    cap = math.sqrt(2e-6)
    scene = lit(
        looking((0, 0, 1.5), 4 * cap, frame(amount)),
        [((0, 0, 0), 1), ((0, -40, 0), 1)],
        (0, 0, 1 + height),
        (1, 0, -1),
    )
    image = check_shadows(scene, device, precision, 150 * amount)
    _, want = lighting(scene, image, 150 * amount)
    assert want[:, 0, 1].any() == (height > 0)
    assert not want[:, 0, 1].all()


@mostly
def test_L8_terminator(device: Device, precision: str, amount: int) -> None:
    """n.l within an ulp of 0: a line of acne. It is the ambient colour, and no shadow ray is cast for n.l <= 0."""
    for e in (0, 2.0**-52, 1e-7, 1e-2) if amount == 1 else (0, *2.0 ** -np.arange(52, 5, -1)):
        for s in (1, -1):
            # At the pixel on the axis P = (0, 0, -1) and n = (0, 0, 1): n.l is s e, to rounding, for both lights.
            lights = [
                ambient_light((1, 1, 1)),
                point_light((1, 0, s * e - 1), (1, 0, 0)),
                parallel_light((-1, 0, -s * e), (0, 1, 0)),
            ]
            spheres: list[Ball] = [((0, 0, -2), 1), ((0, -9, 0), 1)]
            scene = balls(looking(tan=0.1, size=(9, 7)), spheres, lights, ka=0.25, kd=1, ks=0)
            image = check(scene, device, precision)
            n_l = e / math.hypot(1, e) if s > 0 else 0
            assert image.shadow_rays[3, 4] == (2 if s * e > 0 else 0)
            assert np.abs(image.color[3, 4] - (0.25 + n_l, 0.25 + n_l, 0.25)).max() <= 2e-7
    # The terminator across the picture: each side of it, as the oracle says.
    spheres = [((0, 0, 0), 1), ((0, -9, 0), 1)]
    scene = lit(looking((0, 0, 3), 0.4, frame(amount)), spheres, (5, 0, 1e-3), (-1, 1e-3, 1e-3))
    check_shadows(scene, device, precision, 200 * amount)


GAPS = [pytest.param(g, id=f"{g:g}") for g in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)]


shells = pytest.mark.parametrize("gap", [*GAPS, pytest.param("float", id="ulp32"), pytest.param("double", id="ulp64")])


def shell_of(R: float, gap: float | str) -> tuple[float, float]:
    """The radius of a sphere of about R, and that of the shell around it."""
    if gap == "double":
        return R, math.nextafter(R, math.inf)
    return (ulp32(R, 0), ulp32(R)) if gap == "float" else (R, R * (1 + float(gap)))


@mostly
@shells
def test_L9_core(device: Device, precision: str, amount: int, gap: float | str) -> None:
    """The shell from outside, and from far off: a P that is off by more than the gap is inside of it, and dark."""
    for R, far in ((1.0, 1e6), (1e-3, 1e2), (1e6, 1e4), (1.0, 10))[: 1 if amount == 1 else 4]:
        core, shell = shell_of(R, gap)
        C = R * np.array([0.3, -0.2, 0.1])
        camera = looking(C + (0, 0, far * R), 1.2 / far, frame(amount, 150))
        scene = lit(camera, [(C, shell), (C, core)], C + R * np.array([2, 3, 4]), (1, -2, -1))
        image = check_shadows(scene, device, precision, 60 * amount)
        _, want = lighting(scene, image, 60 * amount)
        assert (want[..., 0] == want[..., 1]).all()
        assert want[..., 0].any(axis=0).all()


@mostly
@shells
def test_L9_shell(device: Device, precision: str, amount: int, gap: float | str) -> None:
    """Light gets through a shell that is nearer than the epsilon. The eye is between sphere and shell."""
    rng = np.random.default_rng(11)
    for R, far in ((1.0, 0), (1e-3, 0), (1e3, 1), (1.0, 1e3), (1e6, 0))[: 1 if amount == 1 else 5]:
        C = np.array([far * R, -far * R, 0.5 * far * R])
        for seed in range(1 if amount == 1 else 4):
            if gap == "double":
                R, C = 1.0, np.zeros(3)
            R, shell = shell_of(R, gap)
            eye = np.array(between_doubles(seed)) if gap == "double" else C + (0, 0, (R + shell) / 2)
            spheres: list[Ball] = [(C, R), (C, shell)]
            point, travels = C + R * np.array([0.5, -0.25, 3]), (0.25, 0.5, -1)
            scene = lit(looking(eye, 3, frame(amount, 150)), spheres, point, travels)
            image = check_shadows(scene, device, precision, 30 * amount)
            _, want = lighting(scene, image, 30 * amount)
            assert want[..., 1].any(axis=0).all()
            assert (image.color == 0).all()
            assert 0 in image.id
            # Aslant, anywhere around the sphere.
            w = eye - C if gap == "double" else (R + shell) / 2 * unit(rng)
            at, up = C + 0.1 * R * unit(rng), unit(rng)
            camera = Camera(C + w, at, up, 70, frame(amount, 150), square_pixels=False)
            image = picture(lit(camera, spheres, tuple(C + 3 * w), tuple(-w)), device, precision)
            assert set(image.id.ravel()) <= {0, 1}
            assert (image.id == 0).any()
            assert (image.color == 0).all()


@mostly
@pytest.mark.parametrize("R", [1e3, 1e5, 1e7])
def test_L10_resting_on_the_ground(device: Device, precision: str, amount: int, R: float) -> None:
    """The shadow of a ball that touches the ground detaches from it, or has rings."""
    spheres: list[Ball] = [((0, -R, 0), R), ((0, 1, 0), 1), ((2.5, 0.5, -1), 0.5)]
    for eye, tan in (((0, 1, 6), 0.5), ((0, 0.02, 3), 0.02), ((-0.75, 0.02, 1.35), 0.1)):
        scene = lit(looking(eye, tan, frame(amount, 600)), spheres, (3, 8, 4), (-1, -2, -1.5))
        image = check_shadows(scene, device, precision, 120 * amount)
        # Both are there: lit ground and ground in shadow.
        assert len(set((image.color[image.id == 0][:, 0] > 0).tolist())) == 2


# ------------------------------------------------------------------------------------------------ camera and shading


@mostly
@pytest.mark.parametrize("fov", [1e-6, 5e-4, 1e-2])
def test_C1_narrow(device: Device, precision: str, amount: int, fov: float) -> None:
    """The directions of neighbouring pixels are one and the same float32: a pixelated sphere."""
    tan = math.tan(math.radians(fov))
    r = 0.6 * 7e5 * tan
    for axis in AXES[: 1 if amount == 1 else 6]:
        eye = -7e5 * np.array(axis)
        for sideways in ((0, 0, 0), (0.4 * r, -0.2 * r, 0.3 * r)):
            check(balls(looking(eye, tan, frame(amount), axis), [(sideways, r)]), device, precision, 20)
    # Limbs that pass pixels at r (1 +/- 2^-k).
    rng = np.random.default_rng(7)
    camera = looking(tan=tan, size=frame(amount))
    check(balls(camera, aimed(camera, 7e5, 0.2 * r, limbs(4, 26, 23, rng), rng)), device, precision)


@mostly
@pytest.mark.parametrize("fov", [89.9, 89.9999])
def test_C2_wide(device: Device, precision: str, amount: int, fov: float) -> None:
    """pi/180 in float32 is off by 1e-4 in the tangent; the picture's edges point elsewhere, or nowhere."""
    camera = Camera(horizontal_fov=fov, resolution=(401, 3), square_pixels=True)
    with mpmath.workdps(40):
        exact = mpmath.tan(mpmath.mpf(fov) * mpmath.pi / 180)
        assert abs(camera.image_plane()[0] / exact - 1) < 1e-9
        x = exact * 400 / 401
        edge = [x / mpmath.hypot(x, 1), mpmath.mpf(0), -1 / mpmath.hypot(x, 1)]
    rng = np.random.default_rng(6)
    image = check(balls(camera, aimed(camera, 5, 1, limbs(4, 20, 17, rng), rng)), device, precision, 10)
    assert np.isfinite(image.direction).all()
    assert normal_error(image.direction[1, 400], edge) <= 1e-7
    assert normal_error(image.direction[1, 0], [-edge[0], *edge[1:]]) <= 1e-7
    other = looking(tan=float(exact), size=frame(amount))
    check(balls(other, aimed(other, 5, 1, limbs(4, 20, 17, rng), rng)), device, precision, 10)


@pytest.mark.parametrize("fov", [0, 90, 180, 181, -1e-9, -45, math.nan])
def test_C3_no_field_of_view(fov: float) -> None:
    """An infinite image plane, or none."""
    text = "must be a finite number, got nan" if math.isnan(fov) else f"must be within (0, 90), got {fov:g}"
    with pytest.raises(ValueError) as caught:
        Camera(horizontal_fov=fov)
    assert str(caught.value) == f"camera.horizontal_fov: {text}"


def stays_within(whole: Renderer, guard: int = 4096) -> bool:
    """Whether the kernel keeps off the bytes before and behind each of its outputs."""
    frame = whole._frame()
    image = cltrace.Image(frame=frame)
    flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
    outside = np.full(2 * guard, 0xA5, np.uint8)
    parts = {n: np.insert(outside, guard, np.zeros(a.nbytes, np.uint8)) for n, a in frame.arrays.items()}
    guarded = {n: cl.Buffer(whole.context, flags, hostbuf=part) for n, part in parts.items()}
    frame.buffers = {n: b.get_sub_region(guard, frame.arrays[n].nbytes) for n, b in guarded.items()}
    whole.render(image)
    for name, part in parts.items():
        cl.enqueue_copy(whole.queue, part, guarded[name])
    assert parts["direction"][guard:-guard].any()  # it was written to
    return all((np.delete(part, slice(guard, -guard)) == 0xA5).all() for part in parts.values())


@pytest.mark.parametrize("size", [(1, 1), (1, 4096), (4096, 1), (7, 13), (33, 65), (40, 3)])
def test_C4_sizes(device: Device, width: int, amount: int, size: tuple[int, int]) -> None:
    """Half a pixel off, width and height swapped, or the packets at the edge write behind the picture."""
    w, h = size
    camera = Camera(horizontal_fov=40, resolution=size, square_pixels=False)
    base = everything()
    scene = Scene(camera, base.lights, base.spheres, base.materials, base.background)
    whole = renderer(scene, device, "accurate", width)
    assert stays_within(whole)
    image = whole.render()
    crops = [(w // 2, h // 3, w, h), (w // 3, h // 4, w // 3 + 1, h // 4 + 1), (0, 0, max(1, w // 2), max(1, h // 2))]
    for crop in crops[: 1 if amount == 1 else 3]:
        part = renderer(scene, device, "accurate", width, crop=crop)
        assert stays_within(part)
        x0, y0, x1, y1 = crop
        cut = part.render()
        for name in OUTPUTS:
            assert np.array_equal(getattr(cut, name), getattr(image, name)[y0:y1, x0:x1]), name
    # The tutorial's angles: the longer side has the whole one, the other one its share.
    fov = np.radians([40 * min(1, w / h), 40 * min(1, h / w)])
    x = ((np.arange(w) + 0.5) / w * 2 - 1) * math.tan(fov[0])
    y = (1 - (np.arange(h) + 0.5) / h * 2) * math.tan(fov[1])
    d = np.stack([*np.meshgrid(x, y), np.full((h, w), -1.0)], axis=-1)
    assert np.abs(image.direction - d / np.linalg.norm(d, axis=-1, keepdims=True)).max() <= 1e-7
    if size == (1, 1):
        assert image.direction.ravel().tolist() == [0, 0, -1]


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -1e30), (0, 1e-40, 7), (0, 0, 0)])
def test_C5_up_along_the_view(up: tuple[float, ...]) -> None:
    """Axes of NaN."""
    with pytest.raises(ValueError) as caught:
        Camera(up=up)
    assert str(caught.value) == f"camera.up: must not be {'parallel to the view' if any(up) else '0'}"
    with pytest.raises(ValueError) as caught:
        Camera(position=(1, 2, 3), lookat=(1, 2, 3))
    assert str(caught.value) == "camera.lookat: must differ from position"


@pytest.mark.parametrize("angle", [1e-7, 1e-9, 1e-12])
def test_C5_up_nearly_along_the_view(device: Device, angle: float) -> None:
    """Axes that are not orthogonal: a skew picture."""
    camera = Camera((1, 2, 3), (4, -1, 5), (3 + angle, -3, 2), 40, (9, 9))
    rows = [mpmath.matrix(row) for row in camera.basis()]
    with mpmath.workdps(50):
        for i in range(3):
            for j in range(3):
                assert abs(sum(rows[i][k] * rows[j][k] for k in range(3)) - (i == j)) < 1e-15
    image = picture(balls(camera, [((4, -1, 5), 1)]), device)
    assert image.id[4, 4] == 0
    assert np.abs(np.linalg.norm(image.direction, axis=-1) - 1).max() <= 1e-7
    # Right and left are mirrored at the view, as are up and down.
    assert np.abs(image.direction + image.direction[::-1, ::-1] - 2 * image.direction[4, 4] *
                  (image.direction * image.direction[4, 4]).sum(-1, keepdims=True)).max() <= 3e-7  # fmt: skip


def shiny(exponent: float, size: tuple[int, int], eye_light: bool = False, ks: float = 1) -> Scene:
    """Two mirrors, all highlights; eye_light: every light stands where the eye is, so that r.v is 1 on the axis."""
    at = (0, 0, 0) if eye_light else (2, 3, 0)
    lights = [
        point_light(at, (1, 0, 0)),
        parallel_light((0, 0, -1) if eye_light else (0.2, -0.3, -1), (0, 1, 0)),
        spot_light(at, (0, 0, -1) if eye_light else (-2, -3, -5), 20, 40, (0, 0, 1)),
    ]
    return balls(
        looking(tan=0.3, size=size),
        [((0, 0, -5), 1), ((1.5, 0.5, -6), 0.75)],
        lights,
        ka=0,
        kd=0,
        ks=ks,
        exponent=exponent,
    )


@pytest.mark.parametrize("exponent", [0, 0.5, 1, 20, 1e4, 1e6])
def test_P1_exponents(device: Device, amount: int, exponent: float) -> None:
    """0^0 is NaN by powr, and cos^1e6 from a float32 cosine is off by 15 %."""
    for eye_light in (False, True):
        for precision in ("accurate",) if amount == 1 else ("accurate", "double"):
            scene = shiny(exponent, frame(amount, 500), eye_light)
            image = check(scene, device, precision)
            assert check_colors(scene, image, 200 * amount) <= 5e-6
            if exponent == 0:
                # 1 where the surface faces the light, though r.v may be negative; else 0.
                assert set(np.unique(image.color[..., :2]).tolist()) == {0, 1}
                assert (image.color[..., :2].sum(axis=-1).ravel() <= channel(image, "shadow_rays")).all()
    if exponent in (1e4, 1e6):
        # Zoomed in on the highlight, so that it fills the picture.
        scene = zoomed(exponent, frame(amount, 300))
        assert check_colors(scene, picture(scene, device), 300 * amount) <= 5e-6


def zoomed(exponent: float, size: tuple[int, int]) -> Scene:
    base = shiny(exponent, size, True)
    camera = looking(tan=0.6 / math.sqrt(exponent), size=size)
    return Scene(camera, base.lights, base.spheres, base.materials)


@pytest.mark.parametrize("exponent", [0, *(pytest.param(n, marks=pytest.mark.stress) for n in (0.5, 20, 1e4)), 1e6])
def test_P2_never_above_1(device: Device, amount: int, exponent: float) -> None:
    """r.v = 1 + 1e-7 by rounding, to the power of 1e6."""
    for scene in (shiny(exponent, frame(amount, 500), True), zoomed(max(exponent, 20), frame(amount, 300))):
        image = picture(scene, device)
        assert image.color.max() <= 1
        middle = image.id.shape[0] // 2, image.id.shape[1] // 2
        assert image.color[middle].tolist() == [1, 1, 1]


def test_P3_colours(device: Device) -> None:
    """255 c beyond a byte wraps around, and products of colours leave float32's range."""
    greys = [0, 1, 1.5, 300, 2.0**-149, 1e-40, 1e38, 3.4e38, 0.5, 0.1, 0.999]
    camera = looking(tan=1, size=(2 * len(greys) + 1, 3))
    where = [((2 * i - len(greys) + 1) / (2 * len(greys) + 1) * 20, 0, -10) for i in range(len(greys))]
    colors = np.repeat(np.array(greys)[:, None], 3, axis=1)
    spheres = list(zip(where, [0.5] * len(greys), strict=True))
    want = [math.floor(min(1.0, grey) * 255 + 0.5) for grey in greys]
    strong = [point_light((0, 0, 0), (1e38, 1e38, 1)), parallel_light((0, 0, -1), (3.4e38, 0, 1)),
              spot_light((0, 0, 0), (0, 0, -1), 60, 80, (1e38, 1e38, 1e38))]  # fmt: skip
    dim = [point_light((0, 0, 0), (1e-45 * 2,) * 3), parallel_light((0, 0, -1), (2e-45,) * 3),
           spot_light((0, 0, 0), (0, 0, -1), 60, 80, (2e-45,) * 3)]  # fmt: skip
    for lights, kd, ks in ((dim, 1, 1e-30), (strong, 1e38, 1e38), (strong, 3.4e38, 0.5)):
        for ambient in (1.0, 1e38):
            scene = balls(
                camera,
                spheres,
                [ambient_light((ambient,) * 3), *lights],
                colors=colors,
                ka=1,
                kd=kd,
                ks=ks,
                exponent=3e38,
            )
            image = picture(scene, device)
            assert not np.isnan(image.color).any()
            middle = image.rgb8[1, 1::2]
            if lights is dim and ambient == 1:
                assert middle[:, 0].tolist() == want
                down = Renderer(scene, device, "accurate", OUTPUTS, truncate=True, keep=("features",)).render()
                assert down.rgb8[1, 1::2, 0].tolist() == [
                    math.floor(min(1.0, np.float32(g)) * np.float32(255)) for g in greys
                ]
            elif lights is strong:
                assert (middle[1:4] == 255).all()


# ------------------------------------------------------------------------------------------------------------ normals


@mostly
@pytest.mark.parametrize("R", [1e-3, 1.0, 1e3, 1e7])
def test_normals_everywhere(device: Device, precision: str, amount: int, R: float) -> None:
    """The normal is lost in P: offsets to 1e7, R from 1e-3 to 1e7, distances to 1e7; never off by 1e-7 rad."""
    for gap in (1e-3, 1e7) if amount == 1 else 10.0 ** np.arange(-3, 8):
        for offset in (1e7,) if amount == 1 else (0, 1, 1e4, 1e7):
            eye = offset * np.array([1, -0.7, 0.3])
            tan = min(3.0, 1.1 * R / math.sqrt(gap * (2 * R + gap)))
            center = eye + (0.1 * R, -0.05 * R, -(R + gap))
            scene = balls(looking(eye, tan, frame(amount, 150)), [(center, R)])
            check(scene, device, precision, 12 if amount == 1 else 60)
    # Far off the view's axis, each on the ray of a pixel; and limbs that pass pixels at r (1 +/- 2^-k).
    rng = np.random.default_rng(12)
    camera = looking(tan=1, size=(65, 49))
    off_axis = aimed(camera, R + 1e7, R, -rng.uniform(0.01, 1, 12 * amount), rng)
    check(balls(camera, off_axis), device, precision, 12 * amount)
    camera = looking(tan=3e-7 * R, size=frame(amount, 150))
    check(balls(camera, aimed(camera, R + 1e7, 0.5 * R, limbs(4, 26, 23, rng), rng)), device, precision)


# ------------------------------------------------------------------------------------------------------------ refused

BAD = [
    pytest.param(value, text, id=f"N1-{name}")
    for name, value, text in (
        ("nan", math.nan, "must be a finite number, got nan"),
        ("inf", math.inf, "must be a finite number, got inf"),
        ("-inf", -math.inf, "must be a finite number, got -inf"),
        ("1e39", 1e39, "must not exceed 3.4e38 in magnitude, got 1e+39"),
        ("bool", True, "must be numbers, got "),
        ("None", None, "must be numbers, got "),
        ("str", "1", "must be numbers, got "),
    )
]


def refused(name: str, index: str, text: str, error: ValueError) -> None:
    """The message names the field; and, where the value is a number, says which one and all that is wrong."""
    if text.endswith(" "):
        assert str(error).startswith(f"{name}: {text}") or str(error).startswith(f"{name}{index}: {text}")
    else:
        assert str(error) == f"{name}{index}: {text}"


@pytest.mark.parametrize(("value", "text"), BAD)
@pytest.mark.parametrize(
    "field", ["position", "lookat", "up", "horizontal_fov", "resolution", "max_bounces", "square_pixels"]
)
def test_N1_camera(field: str, value: object, text: str) -> None:
    """Something that is no number reaches the kernel: speckles, or a hang."""
    if field == "square_pixels" and isinstance(value, bool):
        pytest.skip("the one field that a bool is right for")
    vector = field in ("position", "lookat", "up")
    given = {"resolution": (8, value)}.get(field, (0.5, 0.25, value) if vector else value)
    with pytest.raises(ValueError) as caught:
        Camera(**{field: given})  # type: ignore[arg-type]
    if vector or field == "horizontal_fov":
        refused(f"camera.{field}", "[2]" if vector else "", text, caught.value)
    else:
        assert str(caught.value).startswith(f"camera.{field}: must be ")


@pytest.mark.parametrize(("value", "text"), BAD)
@pytest.mark.parametrize("field", ["color", "position", "direction", "alpha1", "alpha2"])
def test_N1_lights(field: str, value: object, text: str) -> None:
    """As for the camera."""
    vector = field not in ("alpha1", "alpha2")
    given = {"position": (1, 2, 3), "direction": (0, 0, -1), "alpha1": 0, "alpha2": 180, "color": (1, 1, 1)}
    given[field] = (0.5, 0.25, value) if vector else value  # type: ignore[assignment]
    with pytest.raises(ValueError) as caught:
        balls(Camera(), [((0, 0, -5), 1)], [ambient_light(), spot_light(**given)])  # type: ignore[arg-type]
    if text.endswith(" "):
        assert field in str(caught.value)
    else:
        assert str(caught.value) == f"lights.{field}[1]{'[2]' if vector else ''}: {text}"


@pytest.mark.parametrize(("value", "text"), BAD)
@pytest.mark.parametrize("field", ["centers", "radii", "colors", "ka", "kd", "ks", "exponent"])
def test_N1_spheres_and_materials(field: str, value: object, text: str) -> None:
    """As for the camera."""
    vector = field in ("centers", "colors")
    kept = value if isinstance(value, float) else [value]  # an array of numbers with one bad one, or all bad
    one = [0.5, 0.25, kept] if isinstance(value, float) else [value] * 3
    given = {"centers": [(0, 0, -5), (0, 0, -6)], "radii": [1, 2]}
    if isinstance(value, float):
        given[field] = [(0.5, 0.25, 0.5), one] if vector else [0.5, value]
    else:
        given[field] = [one, one] if vector else [value, value]
    with pytest.raises(ValueError) as caught:
        Scene.from_spheres(Camera(), [], **given)  # type: ignore[arg-type]
    if text.endswith(" "):
        refused(field, "", text, caught.value)
    else:
        assert str(caught.value) == f"{field}[1]{'[2]' if vector else ''}: {text}"


def test_N1_a_bool_among_numbers() -> None:
    """As numpy would turn it into a number."""
    with pytest.raises(ValueError) as caught:
        Scene.from_spheres(Camera(), [], [(0, 0, True)], [1])
    assert str(caught.value) == "centers: must be numbers, got True among them"


@pytest.mark.parametrize(("value", "text"), BAD)
def test_N1_background(value: object, text: str) -> None:
    """As for the camera."""
    with pytest.raises(ValueError) as caught:
        balls(Camera(), [((0, 0, -5), 1)], background=(0, 0.5, value))  # type: ignore[arg-type]
    refused("background", "[2]", text, caught.value)
