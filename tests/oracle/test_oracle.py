"""The oracle: its filter against the exact engine and the judge, and on cases that are settled by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import exact_rays
import judge
import mpmath
import numpy as np
import pytest
from exact_rays import OnSphere
from fuzzing import examples
from hostile import bounced_regimes
from hostile.sphere_regimes import REGIMES, camera_space, rays
from hypothesis import given
from hypothesis import strategies as st

from cltrace import oracle
from cltrace.exact.fine import Fine
from cltrace.oracle.search import Found, Kinds
from cltrace.oracle.spheres import Spheres, rays_among_spheres

UP, DOWN = np.inf, -np.inf
O = (0.0, 0.0, 0.0)  # noqa: E741
AHEAD = (0.0, 0.0, -1.0)

each_regime = pytest.mark.parametrize(("name", "regime"), REGIMES, ids=[name for name, _ in REGIMES])


def one(origin, row, centers, radii):
    """closest() of one ray, after having checked it against the integers; (index, t)."""
    index, t = oracle.closest(origin, [row], centers, radii)
    exact = exact_rays.closest_from(origin, [row], centers, radii)
    assert (index[0], t[0]) == (exact[0][0], exact[1][0])
    return int(index[0]), float(t[0])


# ------------------------------------------------------------------------------------------------------- all of closest


def balls(centers, radii, maps=None):
    return [judge.Ball(*one) for one in zip(centers, radii, maps or [None] * len(radii), strict=True)]


def assert_same(index, t, expected):
    assert index == expected[0]
    assert judge.is_rounded(float(t), expected[1])


@pytest.mark.parametrize("scale", [1e-44, 1e-30, 1e30, 6e37, 2.0**-149])
@pytest.mark.parametrize("length", [1e-44, 1.0, 1e38])
def test_extreme_ranges(scale, length):
    rng = np.random.default_rng(3)
    for _ in range(20):
        centers = np.round(rng.uniform(-3, 3, (3, 3))) * scale
        radii = np.round(rng.uniform(1, 3, 3)) * scale
        origin = np.round(rng.uniform(-3, 3, 3)) * scale
        row = rng.normal(size=3) * length
        index, t = one(origin, row, centers, radii)
        assert_same(index, t, judge.first(balls(centers, radii), origin, row))


@pytest.mark.parametrize("length", [1.0, 5e-324, 1e-310, 1e38])
def test_a_tiny_ball_in_front_of_a_huge_one_and_subnormal_doubles(length):
    centers, radii = [(0, 0, -3e38), (0, 0, -1e-44), (0, 0, -1e-323)], [1e38, 1e-45, 5e-324]
    row = (0, 0, -length)
    for keep, near in ((slice(0, 1), 2e38), (slice(0, 2), 1e-44 - 1e-45), (slice(0, 3), 5e-324)):
        index, t = one(O, row, centers[keep], radii[keep])
        assert index == len(radii[keep]) - 1
        z, r = -Fraction(centers[keep][-1][2]), Fraction(radii[keep][-1])
        assert math.isclose(near, float(z - r))
        exact = (z - r) / Fraction(length)
        assert t == (float(exact) if exact < 2**1024 else math.inf)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused(bad):
    for case in (((bad, 0, 0), AHEAD, O, 1), (O, (0, bad, 0), O, 1), (O, AHEAD, (0, 0, bad), 1), (O, AHEAD, O, bad)):
        with pytest.raises(ValueError):
            oracle.closest(case[0], [case[1]], [case[2]], [case[3]])


ROWS = [(0, 0, -1), (0, 1, -1)]
BALLS = {"centers": [(0, 0, -5), (0, 3, -5)], "radii": [1.0, 2.0]}
RAYS = {"origin": O, "direction": ROWS, **BALLS}


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("origin", (0, 0), "origin: must have shape (3,), got (2,)"),
        ("origin", (0, 0, np.nan), "origin: must be finite"),
        ("origin", [O], "origin: must have shape (3,), got (1, 3)"),
        ("direction", (0, 0, -1), "direction: must have shape (n, 3), got (3,)"),
        ("direction", -1, "direction: must have shape (n, 3), got ()"),
        ("direction", [(0, -1)], "direction: must have shape (n, 3), got (1, 2)"),
        ("direction", [("a", 0, 0)], "direction: must be numbers, got 'a'"),
        ("centers", (0, 0, -5), "centers: must have shape (n, 3), got (3,)"),
        ("centers", [(0, 0, 1j), O], "centers: must be numbers, got 1j among them"),
        ("centers", [O], "radii: must be one number or as many as centers, 1, got 2"),
        ("radii", [-1, 1], "radii: must be > 0, got -1"),
        ("radii", 0, "radii: must be > 0, got 0"),
        ("radii", [[1], [1]], "radii: must have shape (n,), got (2, 1)"),
        ("radii", True, "radii: must be numbers, got True"),
    ],
)
def test_what_is_refused(name, value, message):
    oracle.closest(**RAYS)
    with pytest.raises(ValueError) as caught:
        oracle.closest(**{**RAYS, name: value})
    assert str(caught.value).startswith(message)


def test_one_radius_for_all():
    one_for_all, each = (oracle.closest(**{**RAYS, "radii": radii}) for radii in (2, [2.0, 2.0]))
    assert np.array_equal(np.array(one_for_all), np.array(each))


def test_a_zero_direction_hits_nothing():
    """As the docstring says."""
    assert oracle.closest(O, [O, AHEAD], [O], 1)[0].tolist() == [-1, 0]


def test_nothing_there():
    assert one(O, AHEAD, np.zeros((0, 3)), []) == (-1, np.inf)
    assert one(O, O, [O, (0, 0, -3)], [1, 1]) == (-1, np.inf)  # a zero direction, from inside as well
    for radii in ([], 1):
        index, t = oracle.closest(O, ROWS, [], radii)
        assert (index.tolist(), t.tolist()) == ([-1, -1], [np.inf, np.inf])
    assert oracle.closest(O, [], **BALLS)[0].shape == (0,)


# ------------------------------------------------------------------------------------------------------- decisions


def test_on_the_surface_and_at_the_centre():
    assert one((0, 0, 1), (0, 0, 1), [O], [1]) == (-1, np.inf)  # outwards
    assert one((0, 0, 1), (1, 0, 0), [O], [1]) == (-1, np.inf)  # along the surface
    assert one((0, 0, 1), (0, 0, -1), [O], [1]) == (0, 2)
    assert one((0, 0, 1), (0, 3, -4), [O], [1]) == (0, 8 / 25)  # 2 b / a
    assert one(O, (0, 0, -4), [O], [1]) == (0, 0.25)
    assert one((3, 4, 0), (0, 0, 1), [O], [5]) == (-1, np.inf)
    # 3, 4, 5 scaled so that the surface point is exact though nothing else is round.
    k = 1 + 2.0**-40
    assert one((3 * k, 4 * k, 0), (-3, -4, 0), [O], [5 * k]) == (0, 2 * k)


@pytest.mark.parametrize("k", [0, 1, 30, 50])
@pytest.mark.parametrize("distance", [1.0, 5.0, 1e6, 1e16])
def test_tangent(k, distance):
    """D = 0 exactly is a hit; an ulp of the radius, or of the ray, decides."""
    s = 1 + 2.0**-k
    center, r = (3 * s, 4 * s, -distance), 5 * s
    assert one(O, AHEAD, [center], [r]) == (0, distance)
    assert one(O, AHEAD, [center], [np.nextafter(r, 0)]) == (-1, np.inf)
    assert one(O, AHEAD, [center], [np.nextafter(r, UP)])[0] == 0
    assert one(O, (-5e-324, 0, -1), [center], [r]) == (-1, np.inf)  # turned away, by the least there is
    assert one(O, (5e-324, 0, -1), [center], [r])[0] == 0
    assert one(O, (0, 0, 1), [center], [r]) == (-1, np.inf)  # behind


def test_ties_go_to_the_lowest_index():
    sphere, r = (0.25, -0.125, -5), 1.1
    row = (0.01, 0.02, -1)
    assert one(O, row, [sphere] * 3, [r] * 3)[0] == 0
    assert one(O, row, [(0, 0, -50), sphere, sphere], [r] * 3)[0] == 1
    # Mirror images in the plane x = 0, which holds the ray: equal surds from unequal spheres.
    for row in ((0, 0, -1), (0, 0.1, -1), (0, -0.2, -0.8)):
        for x in (0.1, 0.5, 1e-20):
            assert one(O, row, [(x, 0, -5), (-x, 0, -5)], [1.7, 1.7])[0] == 0
    # b and D both differ, t does not: the roots of (t - 5)(t - 7) and (t - 5)(t - 9).
    assert one(O, AHEAD, [(0, 0, -7), (0, 0, -6)], [2, 1]) == (0, 5)
    assert one(O, AHEAD, [(0, 0, -6), (0, 0, -7)], [1, 2]) == (0, 5)
    # An exit and an entry.
    assert one(O, AHEAD, [(0, 0, -9), O], [4, 5]) == (0, 5)
    # Half chords 5, 9, 16, 35 of radii 13, 15, 20, 37 at the height 12: all are met at 5.
    spheres = [(10, 13), (14, 15), (21, 20), (40, 37)]
    for turn in range(4):
        some = spheres[turn:] + spheres[:turn]
        for length in (1.0, 1.1, 0.3, 7.7, 1e-9):
            row, t = (0, 0, -length), float(5 / Fraction(length))
            assert one((0, 12, 0), row, [(0, 0, -z) for z, _ in some], [r for _, r in some]) == (0, t)


@given(
    st.lists(st.tuples(*[st.integers(-6, 6)] * 4), min_size=1, max_size=5),
    st.tuples(*[st.integers(-3, 3)] * 3),
    st.tuples(*[st.integers(-3, 3)] * 3),
)
@examples(150)
def test_ties_of_small_integers(spheres, origin, row):
    """With small integers everything coincides often."""
    centers = np.array([s[:3] for s in spheres], float)
    radii = np.abs(np.array([s[3] for s in spheres], float)) + 1
    assert_same(*one(origin, row, centers, radii), judge.first(balls(centers, radii), origin, row))


@pytest.mark.parametrize("r", [1.0, 0.3, 1e3, 6.4e6])
def test_shells_an_ulp_apart(r):
    bigger = np.nextafter(r, UP)
    rng = np.random.default_rng(0)
    origin = np.array([0.1, 0.2, 3]) * r
    rows = rng.normal(size=(200, 3)) * 0.2 * r - origin
    for radii, outer in (([r, bigger], 1), ([bigger, r], 0)):
        for start, expected in ((origin, outer), (O, 1 - outer)):
            index, t = oracle.closest(start, rows, np.zeros((2, 3)), radii)
            assert (index == expected).all()
            np.testing.assert_array_equal(t, exact_rays.closest_from(start, rows, np.zeros((2, 3)), radii)[1])


# -------------------------------------------------------------------------------------------------------- the filter


def assert_filter_is_right(origin, rows, centers, radii):
    """What the filter is sure of is what the integers say; the share of which it is not sure."""
    origin, rows, centers, radii = (np.asarray(x, float) for x in (origin, rows, centers, radii))
    found = searched(origin, rows, centers, radii)
    index, t, sure = found.item, found.t.h, ~found.doubt & found.is_rounded
    expected = exact_rays.closest_from(origin, rows, centers, radii)
    np.testing.assert_array_equal(index[sure], expected[0][sure])
    np.testing.assert_array_equal(t[sure], expected[1][sure])
    return (~sure).mean()


def searched(origin, rows, centers, radii) -> Found:
    """What closest() goes by."""
    rays, spheres = rays_among_spheres(origin, rows, centers, radii)
    return Kinds([spheres]).closest(rays)


def filter_against_integers(regime, seed, size):
    scene = regime(seed, size)
    return assert_filter_is_right(camera_space(scene)[0], rays(scene.camera), *camera_space(scene)[1:])


@each_regime
def test_filter(name, regime):
    assert filter_against_integers(regime, 10, (32, 24)) < 0.01


@pytest.mark.stress
@each_regime
def test_filter_long(name, regime):
    for seed in range(100, 130):
        assert filter_against_integers(regime, seed, (64, 48)) < 0.01


def near_misses(rng, n):
    """Rays and spheres made to be close: (origin, rows, centers, radii).

    Two spheres through about the same point of the first ray, radii and the point off by 2^-20 .. 2^-110; a third that
    the ray about touches.
    """
    scale = 2.0 ** rng.uniform(-20, 20, 2)
    origin, d = rng.normal(size=3) * scale[0], rng.normal(size=3) * scale[1]
    off = 2.0 ** -rng.uniform(20, 110, 3)
    p = origin + d * rng.uniform(0.5, 2)
    n1, n2 = rng.normal(size=(2, 3))
    n1, n2 = (v / np.linalg.norm(v) * (-1 if v @ d < 0 else 1) for v in (n1, n2))
    r = scale[0] * 2.0 ** rng.uniform(-10, 10, 3)
    side = np.cross(d, rng.normal(size=3))
    side /= np.linalg.norm(side)
    centers = np.array([p + n1 * r[0], p + n2 * r[1] * (1 + off[1]), p + d + side * r[2]])
    radii = r * (1 + off)
    rows = d * (1 + off[0] * rng.normal(size=(n, 3)))
    rows[1::2] = np.nextafter(d, d * rng.choice([-10, 10], (n // 2, 3)))
    return origin, rows, centers, radii


def test_filter_on_near_misses():
    rng = np.random.default_rng(5)
    for _ in range(200):
        assert_filter_is_right(*near_misses(rng, 8))


@pytest.mark.stress
def test_filter_on_near_misses_long():
    rng = np.random.default_rng(6)
    for _ in range(20_000):
        assert_filter_is_right(*near_misses(rng, 16))


@pytest.mark.parametrize("distance", [1 + 1e-9, 1.01, 2.0, 1e3, 1e6])
def test_filter_on_tangent_cones(distance):
    """Every ray touches the sphere but for rounding: the plain doubles in front of the filter must not drop a hit."""
    rng, hits = np.random.default_rng(8), []
    for _ in range(20):
        center, n = rng.normal(size=3), 200
        radius = float(np.linalg.norm(center)) / distance
        e = center / np.linalg.norm(center)
        side = np.cross(e, rng.normal(size=(n, 3)))
        side /= np.linalg.norm(side, axis=1)[:, None]
        rows = e * (math.sqrt((distance - 1) * (distance + 1)) / distance) + side / distance
        rows *= 1 + rng.normal(size=(n, 3)) * 2.0**-53
        assert_filter_is_right(O, rows, [center], [radius])
        hits.append((oracle.closest(O, rows, [center], [radius])[0] == 0).mean())
    assert 0.2 < np.mean(hits) < 0.8


@pytest.mark.parametrize("k", [40, 60, 80, 140])
def test_what_only_integers_can_tell(k):
    """Distances that differ by about 2^-2k, and ones as close as that to the middle between two doubles."""
    x = 2.0**-k
    assert one(O, AHEAD, [(x, 0, -5), (0, 0, -5)], [1, 1]) == (1, 4)  # 5 - sqrt(1 - x^2) is farther than 4
    assert one(O, AHEAD, [(2 * x, 0, -5), (x, 0, -5), (0, 2 * x, -5)], [1, 1, 1]) == (1, 4)
    # r - x^2 / 2 r + 1, just below a midpoint, and the midpoint, which goes to the even neighbour.
    r = 2.0**53 + 2
    assert one(O, AHEAD, [(x, 0, -1)], [r])[1] == r
    assert one(O, AHEAD, [(0, 0, -1)], [r])[1] == r + 2
    # 2^54 - 2 - sqrt(1 - x^2), just above a midpoint.
    assert one(O, AHEAD, [(x, 0, 2 - 2.0**54)], [1])[1] == 2.0**54 - 2
    assert one(O, AHEAD, [(0, 0, 2 - 2.0**54)], [1])[1] == 2.0**54 - 4


def bound_ratio(origin, rows, centers, radii):
    """The greatest error of the filter's t as a share of its bound."""
    rays, spheres = rays_among_spheres(origin, rows, centers, radii)
    worst = Fraction(0)
    with np.errstate(all="ignore"):
        ray, item, sure, t = spheres.hits(rays, *spheres.near(rays))
    for k in np.flatnonzero(sure & np.isfinite(t.error)):
        root = spheres.solid(int(item[k])).first(rays.line(int(ray[k])), 0.0, np.inf)
        exact = root.value(400)
        worst = max(worst, abs(Fraction(t.h[k]) + Fraction(t.l[k]) - exact) / Fraction(t.error[k]))
    return float(worst)


def test_error_bound():
    rng = np.random.default_rng(7)
    assert 0 < max(bound_ratio(*near_misses(rng, 8)) for _ in range(50)) < 0.5


@pytest.mark.stress
@each_regime
def test_error_bound_long(name, regime):
    for seed in range(20):
        scene = regime(seed, (24, 18))
        origin, centers, radii = camera_space(scene)
        assert bound_ratio(origin, rays(scene.camera), centers, radii) < 0.5


def test_beyond_the_range_of_the_filter():
    rows = [AHEAD, (1e-60, 0, -1), (0, 0, -1e-60), (0, 0, -1e60)]
    found = searched(O, rows, [(0, 0, -5.0)], 1)
    assert found.doubt.tolist() == [False, True, True, True]
    assert one(O, rows[3], [(0, 0, -5e200)], [1e200]) == (0, 4e140)
    assert one((1e-200, 0, 0), AHEAD, [(0, 0, -5)], [1])[1] == 4.0


# ---------------------------------------------------------------------------------------------------------- shadows


def shadow(light, *others, kind="point", origin=(0, 0, 5), row=(0, 0, -1), own=((0, 0, 0), 1.0)):
    """lit() where the ray down -z meets the unit sphere `own` at (0, 0, 1), with the other (center, radius)."""
    spheres = [*others[:1], own, *others[1:]]  # not always the first
    centers, radii = [c for c, _ in spheres], [r for _, r in spheres]
    found = exact_rays.lit(origin, [row], [min(len(others), 1)], centers, radii, light, kind)
    return tuple(bool(x[0]) for x in found)


LIT, SHADOWED, AWAY = (True, True), (False, True), (False, False)


def test_between():
    ball = ((0, 0, 5), 1.0)  # its surface crosses the axis at 4 and 6; the point is at 1
    eye = {"origin": (3, 0, 2), "row": (-3, 0, -1)}  # also meets (0, 0, 1)
    assert one(eye["origin"], eye["row"], [O], [1]) == (0, 1)
    assert shadow((0, 0, 9), ball, **eye) == SHADOWED
    assert shadow((0, 0, 6), ball, **eye) == SHADOWED  # on the far side
    assert shadow((0, 0, 5), ball, **eye) == SHADOWED  # the light is within it
    assert shadow((0, 0, 4), ball, **eye) == LIT  # on the near side: the root is 1
    assert shadow((0, 0, np.nextafter(4, 9)), ball, **eye) == SHADOWED
    assert shadow((0, 0, np.nextafter(4, 0)), ball, **eye) == LIT
    assert shadow((0, 0, 2), ball, **eye) == LIT
    assert shadow((0, 0, -1), ball, kind="parallel", **eye) == SHADOWED
    assert shadow((0, 0, -1), ((0, 0, -5), 1.0), kind="parallel", **eye) == LIT  # behind
    assert shadow((0, 0, 9), ((0, 0, -5), 1.0), **eye) == LIT


def test_touching():
    side = ((5, 0, 4), 5.0)  # touches the line x = y = 0 at z = 4
    eye = {"origin": (-3, 0, 2), "row": (3, 0, -1)}
    assert shadow((0, 0, 9), side, **eye) == SHADOWED  # closed
    assert shadow((0, 0, 4), side, **eye) == LIT  # but not at the light
    assert shadow((0, 0, np.nextafter(4, 9)), side, **eye) == SHADOWED
    assert shadow((0, 0, 9), ((5, 0, 4), np.nextafter(5, 0)), **eye) == LIT
    assert shadow((0, 0, -1), side, kind="parallel", **eye) == SHADOWED
    # A ball that touches the own sphere at the very point: the root 0 does not block, but the next one does.
    rest = ((0, 0, 2), 1.0)
    assert shadow((0, 0, 9), rest, **eye) == SHADOWED
    assert shadow((0, 0, 3), rest, **eye) == LIT  # roots 0 and 1
    assert shadow((0, 0, 2), rest, **eye) == LIT  # roots 0 and 2
    assert shadow((0, 0, np.nextafter(3, 9)), rest, **eye) == SHADOWED
    assert shadow((0, 0, -1), rest, kind="parallel", **eye) == SHADOWED


def test_own_sphere_from_inside():
    eye = {"origin": (0, 0, 0)}  # looks down -z and meets (0, 0, -1)
    assert shadow((0.3, 0.2, 0.1), **eye) == LIT
    assert shadow((0, 0, 0), **eye) == LIT
    assert shadow((0, 0, 1), **eye) == LIT  # on the wall, not strictly outside
    assert shadow((0, 0, np.nextafter(1, 2)), **eye) == SHADOWED
    assert shadow((0, 0, 9), **eye) == SHADOWED
    assert shadow((0, 0, -2), **eye) == AWAY
    assert shadow((0, 0, -1), kind="parallel", **eye) == SHADOWED
    assert shadow((0, 0, 1), kind="parallel", **eye) == AWAY
    # From the surface through the inside, the hit is an exit as well.
    assert shadow((0, 0, 0.5), origin=(0, 0, 1)) == LIT
    assert shadow((0, 0, 2), origin=(0, 0, 1)) == SHADOWED


# ------------------------------------------------------------------------------------------------ rays from anywhere


def places(start):
    """The start of a ray as the judge has it: a point, or one of a sphere."""
    return judge.Ball(start.center, start.radius).point(start.normal) if isinstance(start, OnSphere) else start


def start_of(rng, centers, radii, kind):
    """A point of some sphere, of any sphere through integers, or anywhere."""
    i = int(rng.integers(len(radii)))
    if kind == "sphere":
        return OnSphere(centers[i], radii[i], rng.normal(size=3) * 10.0 ** rng.integers(-5, 5))
    if kind == "axis":
        return OnSphere(centers[i], radii[i], np.roll([0.0, 0.0, rng.choice([-2.0, 3.0])], rng.integers(3)))
    return rng.uniform(-3, 3, 3)


@pytest.mark.parametrize("kind", ["sphere", "axis", "point"])
@pytest.mark.parametrize("spread", [1.0, 1e-6, 1e9])
def test_rays_from_anywhere(kind, spread):
    """Balls of the size 1 around a start; some as large as their distance, and concentric ones among them."""
    rng = np.random.default_rng([int(1e6 * spread), len(kind)])
    hits = 0
    for _ in range(60):
        centers = np.round(rng.uniform(-3, 3, (6, 3)), int(rng.integers(0, 8)))
        radii = np.round(rng.uniform(0.3, 2, 6), 2)
        centers[1] = centers[0]
        radii[2] *= spread
        centers[2] += (0, 0, spread if spread > 1 else 0)
        start, row = start_of(rng, centers, radii, kind), rng.normal(size=3)
        t_min, t_max = (0.0, math.inf) if rng.random() < 0.5 else (float(rng.uniform(0, 1)), float(rng.uniform(1, 4)))
        index, t = exact_rays.closest_from(start, [row], centers, radii, t_min, t_max)
        expected = judge.first(balls(centers, radii), places(start), row, t_min, t_max)
        assert_same(index[0], t[0], expected)
        hits += index[0] >= 0
    assert hits > 5


def test_a_sphere_that_is_left():
    """Outwards it is never met again, inwards at 2 b / a, whatever digits the point would have."""
    for normal in ((0.0, 0.0, 1.0), (1.0, 2.0, 3.0), (0.3, -0.1, 1e-9)):
        start = OnSphere((0.1, 0.2, 0.3), 0.7, normal)
        n = np.array(normal)
        side = np.cross(n, (1, 1, 0.5))
        rows = [n, -n, side * 3 + n * 2.0**-40, np.nextafter(-n, 0)]
        index, t = exact_rays.closest_from(start, rows, [start.center], [start.radius])
        assert index.tolist() == [-1, 0, -1, 0]
        length = Fraction(0.7) * 2
        square = sum(Fraction(x) ** 2 for x in normal)
        with mpmath.workdps(60):
            exact = (
                mpmath.mpf(length.numerator)
                / length.denominator
                / mpmath.sqrt(mpmath.mpf(square.numerator) / square.denominator)
            )
            assert abs(mpmath.mpf(t[1]) / exact - 1) <= 2.0**-53
    # Along the surface: exactly at a right angle, one ulp to each side.
    start = OnSphere((0, 0, 0), 5.0, (3.0, 4.0, 0.0))
    rows = [(-4, 3, 1), (-4, np.nextafter(3, 4), 1), (-4, np.nextafter(3, 0), 1)]
    assert exact_rays.closest_from(start, rows, [O], [5.0])[0].tolist() == [-1, -1, 0]


def test_ends_of_a_range_do_not_count():
    ball = [(0, 0, -5)], [2]
    for t_min, t_max, expected in (
        (0, 3, math.inf),
        (0, np.nextafter(3, 4), 3),
        (np.nextafter(3, 0), math.inf, 3),
        (3, math.inf, 7),
        (4, math.inf, 7),
        (3, 7, math.inf),
        (7, math.inf, math.inf),
        (-math.inf, math.inf, 3),
    ):
        assert exact_rays.closest_from(O, [AHEAD], *ball, t_min, t_max)[1][0] == expected
    assert exact_rays.closest_from((0, 0, -9), [AHEAD], *ball, -math.inf, 0)[1][0] == -6
    # 2 / sqrt(3) is between two doubles: the range ends between it and its rounded value, too.
    start = OnSphere(O, 1.0, (1, 1, 1))
    t = exact_rays.closest_from(start, [(-1, -1, -1)], [O], [1.0])[1][0]
    below = np.nextafter(t, 0)
    assert exact_rays.closest_from(start, [(-1, -1, -1)], [O], [1.0], t_max=below)[0][0] == -1
    sides = [exact_rays.closest_from(start, [(-1, -1, -1)], [O], [1.0], t_min=x)[0][0] for x in (below, t)]
    with mpmath.workdps(60):
        assert sides == [0, 0 if 2 / mpmath.sqrt(3) > mpmath.mpf(float(t)) else -1]


def test_ties_of_rays_from_a_sphere():
    """Mirror images in a plane through the ray: equal nested roots of unequal spheres; an ulp unties them."""
    start = OnSphere((0, 0, 1), 0.3, (0.0, 1.0, -3.0))
    row = (0, 0.21, -0.93)
    pair = [(0.5, 0.25, -4), (-0.5, 0.25, -4)]
    assert exact_rays.closest_from(start, [row], pair, [1.7, 1.7])[0][0] == 0
    bigger = float(np.nextafter(1.7, 2))
    assert exact_rays.closest_from(start, [row], pair, [1.7, bigger])[0][0] == 1
    assert exact_rays.closest_from(start, [row], pair, [bigger, 1.7])[0][0] == 0
    # Two spheres through the start: both at 0, which is no hit, and at the same far end.
    assert exact_rays.closest_from(start, [(0, -1, 3)], [(0, 0, 1)] * 2, [0.3] * 2)[0][0] == 0


@given(st.integers(0, 2**32), st.booleans(), st.booleans())
@examples(150)
def test_shadows_from_a_sphere(seed, parallel, small):
    """blocked() against mpmath, for lights and spheres at random, among small integers where much coincides."""
    rng = np.random.default_rng(seed)
    centers, radii = rng.uniform(-3, 3, (5, 3)), rng.uniform(0.2, 2, 5)
    light, normal = rng.uniform(-4, 4, 3), rng.normal(size=3)
    if small:
        centers, radii, light = np.round(centers), np.round(radii) + 1, np.round(light)
        normal = np.roll([0.0, 3.0, 4.0], rng.integers(3)) * rng.choice([-1, 1], 3)
    start = OnSphere(centers[0], radii[0], normal)
    kind = "parallel" if parallel else "point"
    if parallel and not light.any():
        return
    expected = judge.between(balls(centers, radii), places(start), light, parallel)
    assert exact_rays.blocked(start, light, kind, centers, radii) == expected


def test_a_light_at_the_point_is_not_blocked():
    start = OnSphere(O, 1.0, (0.0, 0.0, 7.0))
    assert not exact_rays.blocked(start, (0, 0, 1), "point", [O, (0, 0, 1)], [1.0, 3.0])


# ------------------------------------------------------------------------------------------------------- ellipsoids


def whole_map(rng):
    """A matrix of small whole numbers with an inverse, so that products with it are exact."""
    while True:
        K = rng.integers(-3, 4, (3, 3)).astype(float)
        if round(np.linalg.det(K)) != 0:
            return K


def test_an_ellipsoid_is_a_sphere_in_its_own_axes():
    """The same ray and ellipsoid seen from the world and from the ellipsoid's own axes, where both are exact."""
    rng = np.random.default_rng(50)
    met = 0
    for k in range(200):
        K = whole_map(rng)
        center, eye, d, q = rng.integers(-99, 99, (4, 3)).astype(float)
        radius = float(rng.integers(1, 400))
        d = d if k % 3 else center - eye
        start = OnSphere(center, radius, q, K) if k % 2 else eye
        seen_start = OnSphere(K @ center, radius, q) if k % 2 else K @ eye
        index, t = exact_rays.closest_from(start, [d], [center], [radius], to_object=[K])
        same, same_t = exact_rays.closest_from(seen_start, [K @ d], [K @ center], [radius])
        assert (index[0], t[0]) == (same[0], same_t[0])
        met += index[0] == 0
    assert 40 < met < 160


def test_ellipsoids_and_spheres_by_hand():
    shapes = {"centers": [(0, 0, -5), (0, 0, -5), (0, 0, -9)], "radii": [1, 1, 1]}
    flat, long = np.diag([0.25, 0.25, 2]), np.diag([4, 4, 0.25])
    # The sphere begins at 4, the disc, four times as wide, at 4.5, and the needle at 5.
    index, t = exact_rays.closest_from(O, [AHEAD, (0.5, 0, -1), (0, 0, 1)], **shapes, to_object=[None, flat, long])
    assert index.tolist() == [0, 1, -1]
    assert t[0] == 4
    assert t[1] == pytest.approx((20 - math.sqrt(400 - 4.015625 * 99)) / 4.015625, rel=1e-15)
    start = OnSphere((0, 0, -5), 1, (0, 0, 1))
    index, t = exact_rays.closest_from(start, [AHEAD], **shapes, to_object=[None, None, long])
    assert (index[0], t[0]) == (2, 1)
    # Equal t: the lowest index.
    twice = exact_rays.closest_from(
        O, [AHEAD], [(0, 0, -6), (0, 0, -5)], [1, 1], to_object=[np.diag([9, 7, 0.5]), None]
    )
    assert (twice[0][0], twice[1][0]) == (0, 4)


def test_an_ellipsoid_in_the_way_of_light():
    disc = np.diag([0.25, 0.25, 2])
    start = OnSphere(O, 1.0, (0, 0, 7.0))
    for x, between in ((3.99, True), (4.0, True), (np.nextafter(4, 9), False)):
        for light, kind in (((0, 0, 9), "point"), ((0, 0, -1), "parallel")):
            assert exact_rays.blocked(start, light, kind, [O, (x, 0, 4)], [1, 1], [None, disc]) is between
    # Light within a disc, and at it.
    for z, between in ((3.5, False), (np.nextafter(3.5, 9), True), (4, True)):
        assert exact_rays.blocked(start, (0, 0, z), "point", [O, (0, 0, 4)], [1, 1], [None, disc]) is between
    # From an ellipsoid, whose own inside is in the way of what is outside.
    own = OnSphere(O, 1.0, (0, 0, 1), disc)
    for z, between in ((9, False), (-0.25, False), (-0.5, False), (np.nextafter(-0.5, -1), True)):
        assert exact_rays.blocked(own, (0, 0, z), "point", [O], [1], [disc]) is between


# ------------------------------------------------------------------------------------------- many rays from surfaces

each_bounced = pytest.mark.parametrize("name", list(bounced_regimes.REGIMES))


def test_fine_numbers_are_within_their_errors():
    """Sums, products, quotients and roots that cancel, against rational numbers."""
    rng = np.random.default_rng(51)
    n, worst = 400, 0.0
    for _ in range(20):
        values = rng.normal(size=(4, n)) * 2.0 ** rng.integers(-30, 30, (4, n))
        values[3] = np.where(rng.random(n) < 0.5, values[2] * (1 + rng.uniform(1, 2, n) * 2.0**-40), values[3])
        x, y, z, w = (Fine.of(v) for v in values)
        root = (x * x + z * z).root()
        results = {
            "difference": (z * z - w * w, lambda a, b, c, e: c * c - e * e),
            "quotient": (x * y / (z - w), lambda a, b, c, e: a * b / (c - e)),
            "square of a root": (root * root - x * x, lambda a, b, c, e: c * c),
        }
        for fine, exact in results.values():
            for i, row in enumerate(values.T.tolist()):
                a, b, c, e = map(Fraction, row)
                if not np.isfinite(fine.error[i]):
                    continue
                off = abs(Fraction(fine.h[i]) + Fraction(fine.l[i]) - exact(a, b, c, e))
                assert off <= Fraction(2 * fine.error[i])
                worst = max(worst, float(off / Fraction(fine.error[i])) if fine.error[i] else 0.0)
    assert 0.01 < worst < 1


def bounced_rays(name, seed, count):
    scene = bounced_regimes.scene_of(name, seed)
    return scene, bounced_regimes.rays_of(scene, count, seed)


@pytest.mark.slow
@each_bounced
def test_the_filter_of_bounced_rays_is_right_where_it_is_sure(name):
    seen = set()
    for seed in range(4):
        scene, rays = bounced_rays(name, seed, 60)
        spheres = Spheres.of(scene)
        found = Kinds([spheres]).closest(rays.path(spheres))
        exact = Kinds([spheres]).closest(replace(rays.path(spheres), rough=None))
        np.testing.assert_array_equal(found.item, exact.item)
        np.testing.assert_allclose(found.t.h, exact.t.h, rtol=2.0**-40, atol=0)
        assert found.doubt.mean() < 0.4
        seen |= set(exact.item.tolist())
    assert len(seen) > 3


def test_bounced_rays_beyond_the_range_of_the_filter():
    spheres = Spheres(np.array([[0.0, 0, 0], [0, 0, -5]]), np.array([1.0, 1]), [None, None], np.arange(2))
    d = np.array([(0, 0, -1), (0, 0, -1e-60), (1e60, 0, 0), (0, 0, 0)])
    rays = bounced_regimes.Leaving(np.zeros(4, np.int32), np.array([(0, 0, -1.0)] * 4), d, np.eye(3))
    found = Kinds([spheres]).closest(rays.path(spheres))
    assert found.doubt.tolist() == [False, True, True, True]
    assert found.item.tolist() == [1, 1, -1, -1]
    huge = replace(spheres, radii=np.array([1, 1e60]))
    found = Kinds([huge]).closest(rays.path(huge))
    assert found.doubt.all()
    assert found.item.tolist() == [1, 1, 1, -1]


@each_bounced
def test_bounced_regimes_are_what_they_say(name):
    scene, again, other = (bounced_regimes.scene_of(name, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(scene.spheres, again.spheres)
    assert scene.spheres.tobytes() != other.spheres.tobytes()
    assert (scene.spheres["to_object"] >= 0).any() == ("ellips" in name or "needles" in name)
    first, second = (bounced_regimes.rays_of(scene, 100, 5) for _ in range(2))
    np.testing.assert_array_equal(first.direction, second.direction)
    np.testing.assert_allclose(np.linalg.norm(first.normal, axis=1), 1, rtol=1e-15)
    assert np.isfinite(first.direction).all()
    assert set(first.own) == set(range(len(scene.spheres)))


# ---------------------------------------------------------------------------------------------------------- regimes


@each_regime
def test_regimes_are_what_they_say(name, regime):
    scene, again, other = regime(3, (20, 15)), regime(3, (20, 15)), regime(4, (20, 15))
    np.testing.assert_array_equal(scene.spheres, again.spheres)
    assert scene.camera == again.camera
    assert scene.spheres.tobytes() != other.spheres.tobytes()
    assert scene.camera.basis() == ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    assert scene.camera.resolution == (20, 15)
    for values in camera_space(scene):
        np.testing.assert_array_equal(values, values.astype(np.float32))
    assert len(scene.lights) == 0
    # Over a few seeds, there is more to decide than whether anything is there at all.
    seen = {-1} if name.startswith("inside") else set()
    for seed in range(4):
        scene = regime(seed, (40, 30))
        origin, centers, radii = camera_space(scene)
        seen |= set(oracle.closest(origin, rays(scene.camera), centers, radii)[0].tolist())
    assert -1 in seen
    assert len(seen) > 2


def test_there_are_21_regimes():
    assert len({name for name, _ in REGIMES}) == len(REGIMES) == 21


def test_rays():
    camera = REGIMES[0][1](0, (3, 2)).camera
    tan_x, tan_y = camera.image_plane()
    d = rays(camera).reshape(2, 3, 3)
    assert d[0, 0].tolist() == [-2 * (tan_x / 3), tan_y / 2, -1]  # left, top
    assert d[1, 2].tolist() == [2 * (tan_x / 3), -(tan_y / 2), -1]
    assert d[:, 1, 0].tolist() == [0, 0]
