"""The oracle: its filter against the exact engine, and on cases that are settled by hand."""

from __future__ import annotations

import math
from fractions import Fraction

import exact_rays
import judge
import mpmath
import numpy as np
import pytest
from exact_rays import OnSphere
from hostile import bounced_regimes
from hostile.sphere_regimes import REGIMES, camera_space, rays
from surface_rays import along, at_point, closest, spheres_at, undecided

from cltrace.base.arithmetic import Fine
from cltrace.oracle.search import FirstItems, Kinds
from cltrace.oracle.shapes import Spheres

UP = np.inf
O = (0.0, 0.0, 0.0)  # noqa: E741
AHEAD = (0.0, 0.0, -1.0)

each_regime = pytest.mark.parametrize(("name", "regime"), REGIMES, ids=[name for name, _ in REGIMES])


def one(origin, row, centers, radii):
    """What one ray meets, after having checked it against the integers; (index, t)."""
    index, t = closest(origin, [row], centers, radii)
    exact = exact_rays.closest_from(origin, [row], centers, radii)
    assert (index[0], t[0]) == (exact[0][0], exact[1][0])
    return int(index[0]), float(t[0])


# ------------------------------------------------------------------------------------------------------- decisions


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
        balls = [judge.Ball(*ball) for ball in zip(centers, radii, strict=True)]
        want = judge.first(balls, origin, row)
        assert index == want[0]
        assert judge.is_rounded(t, want[1])


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


def test_nothing_there():
    assert one(O, AHEAD, np.zeros((0, 3)), []) == (-1, np.inf)
    assert one(O, O, [O, (0, 0, -3)], [1, 1]) == (-1, np.inf)  # a zero direction, from inside as well
    assert closest(O, [], [O], 1)[0].shape == (0,)


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


@pytest.mark.parametrize("r", [1.0, 0.3, 1e3, 6.4e6])
def test_shells_an_ulp_apart(r):
    bigger = np.nextafter(r, UP)
    rng = np.random.default_rng(0)
    origin = np.array([0.1, 0.2, 3]) * r
    rows = rng.normal(size=(200, 3)) * 0.2 * r - origin
    for radii, outer in (([r, bigger], 1), ([bigger, r], 0)):
        for start, expected in ((origin, outer), (O, 1 - outer)):
            index, t = closest(start, rows, np.zeros((2, 3)), radii)
            assert (index == expected).all()
            np.testing.assert_array_equal(t, exact_rays.closest_from(start, rows, np.zeros((2, 3)), radii)[1])


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


def searched(origin, rows, centers, radii) -> FirstItems:
    """What closest() goes by."""
    return Kinds([spheres_at(centers, radii)]).closest(
        along(at_point(origin, len(rows)), np.asarray(rows, float), np.eye(3))
    )


@pytest.mark.parametrize(
    ("seeds", "size"), [((10,), (32, 24)), pytest.param(range(100, 130), (64, 48), marks=pytest.mark.stress)]
)
@each_regime
def test_filter(name, regime, seeds, size):
    for seed in seeds:
        scene = regime(seed, size)
        assert assert_filter_is_right(camera_space(scene)[0], rays(scene.camera), *camera_space(scene)[1:]) < 0.01


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


@pytest.mark.parametrize(("scenes", "count"), [(200, 8), pytest.param(20_000, 16, marks=pytest.mark.stress)])
def test_filter_on_near_misses(scenes, count):
    rng = np.random.default_rng(5)
    for _ in range(scenes):
        assert_filter_is_right(*near_misses(rng, count))


@pytest.mark.parametrize("distance", [1 + 1e-9, 1.01, 2.0, 1e3, 1e6])
def test_filter_on_tangent_cones(distance):
    """Every ray touches the sphere except for rounding: plain doubles before the filter must not drop a hit."""
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
        hits.append((closest(O, rows, [center], [radius])[0] == 0).mean())
    assert 0.2 < np.mean(hits) < 0.8


def bound_ratio(origin, rows, centers, radii):
    """The greatest error of the filter's t as a share of its bound."""
    kinds, rays, worst = Kinds([spheres_at(centers, radii)]), along(at_point(origin, len(rows)), rows, np.eye(3)), 0
    ((_, (ray, item, sure, t)),) = kinds.hits(rays)
    for k in np.flatnonzero(sure & np.isfinite(t.error)):
        exact = kinds.root(rays, int(ray[k]), int(item[k])).value(400)
        worst = max(worst, abs(Fraction(t.h[k]) + Fraction(t.l[k]) - exact) / Fraction(t.error[k]))
    return float(worst)


def test_error_bound():
    rng = np.random.default_rng(7)
    assert 0 < max(bound_ratio(*near_misses(rng, 8)) for _ in range(50)) < 0.5


def test_beyond_the_range_of_the_filter():
    rows = [AHEAD, (0, 0, -1e-320), (0, 0, -1e300)]
    assert searched(O, rows, [(0, 0, -5.0)], 1).doubt.tolist() == [False, True, True]
    assert one(O, (0, 0, -1e60), [(0, 0, -5e200)], [1e200]) == (0, 4e140)
    assert one((1e-200, 0, 0), AHEAD, [(0, 0, -5)], [1])[1] == 4.0


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


@pytest.mark.slow
@pytest.mark.parametrize("name", list(bounced_regimes.REGIMES))
def test_the_filter_of_bounced_rays_is_right_where_it_is_sure(name):
    seen = set()
    for seed in range(4):
        scene = bounced_regimes.scene_of(name, seed)
        kinds = Kinds([Spheres.of(scene)])
        paths = bounced_regimes.rays_of(scene, 60, seed).path(kinds.kinds[0])
        found, exact = kinds.closest(paths), kinds.closest(undecided(paths))
        np.testing.assert_array_equal(found.item, exact.item)
        np.testing.assert_allclose(found.t.h, exact.t.h, rtol=2.0**-40, atol=0)
        assert found.doubt.mean() < 0.4
        seen |= set(exact.item.tolist())
    assert len(seen) > 3


# ------------------------------------------------------------------------------------- shadows, by the exact engine

LIT, SHADOWED, AWAY = (True, True), (False, True), (False, False)
UNIT, BALL, BEHIND, SIDE, REST = (O, 1.0), ((0, 0, 5), 1.0), ((0, 0, -5), 1.0), ((5, 0, 4), 5.0), ((0, 0, 2), 1.0)
LESS = (SIDE[0], float(np.nextafter(5, 0)))
# From outside, two ways at the point (0, 0, 1) of the unit sphere; from within, at (0, 0, -1); and from the surface.
LEFT, RIGHT = ((3, 0, 2), (-3, 0, -1)), ((-3, 0, 2), (3, 0, -1))
INSIDE, WALL = (O, AHEAD), ((0, 0, 1), AHEAD)


@pytest.mark.parametrize(
    ("eye", "other", "light", "kind", "expected"),
    [
        (LEFT, BALL, 9, "point", SHADOWED),  # its surface crosses the axis at 4 and 6
        (LEFT, BALL, 6, "point", SHADOWED),  # on the far side
        (LEFT, BALL, 5, "point", SHADOWED),  # the light is within it
        (LEFT, BALL, 4, "point", LIT),  # on the near side: the root is 1
        (LEFT, BALL, np.nextafter(4, 9), "point", SHADOWED),
        (LEFT, BALL, np.nextafter(4, 0), "point", LIT),
        (LEFT, BALL, 2, "point", LIT),
        (LEFT, BALL, -1, "parallel", SHADOWED),
        (LEFT, BEHIND, -1, "parallel", LIT),
        (LEFT, BEHIND, 9, "point", LIT),
        (RIGHT, SIDE, 9, "point", SHADOWED),  # touches the line x = y = 0 at z = 4: closed
        (RIGHT, SIDE, 4, "point", LIT),  # but not at the light
        (RIGHT, SIDE, np.nextafter(4, 9), "point", SHADOWED),
        (RIGHT, LESS, 9, "point", LIT),
        (RIGHT, SIDE, -1, "parallel", SHADOWED),
        # A ball that touches the own sphere at the very point: the root 0 does not block, but the next one does.
        (RIGHT, REST, 9, "point", SHADOWED),
        (RIGHT, REST, 3, "point", LIT),
        (RIGHT, REST, 2, "point", LIT),
        (RIGHT, REST, np.nextafter(3, 9), "point", SHADOWED),
        (RIGHT, REST, -1, "parallel", SHADOWED),
        (INSIDE, None, 0, "point", LIT),
        (INSIDE, None, 1, "point", LIT),  # on the wall, not strictly outside
        (INSIDE, None, np.nextafter(1, 2), "point", SHADOWED),
        (INSIDE, None, 9, "point", SHADOWED),
        (INSIDE, None, -2, "point", AWAY),
        (INSIDE, None, -1, "parallel", SHADOWED),
        (INSIDE, None, 1, "parallel", AWAY),
        (WALL, None, 0.5, "point", LIT),  # from the surface through the inside, the hit is an exit as well
        (WALL, None, 2, "point", SHADOWED),
    ],
)
def test_shadows(eye, other, light, kind, expected):
    """Whether light at this z, or along it, reaches and faces the point where a ray meets the unit sphere."""
    spheres = [other, UNIT] if other else [UNIT]  # not always the first
    centers, radii = zip(*spheres, strict=True)
    lit, facing = exact_rays.lit(eye[0], [eye[1]], [len(spheres) - 1], centers, radii, (0, 0, light), kind)
    assert (lit[0], facing[0]) == expected


# ------------------------------------------------------------------------------------------------ rays from anywhere


@mpmath.workdps(judge.DIGITS)
def test_a_sphere_that_is_left():
    """Outwards it is never met again, inwards at 2 b / a, whatever digits the point would have."""
    for normal in ((0.0, 0.0, 1.0), (1.0, 2.0, 3.0), (0.3, -0.1, 1e-9)):
        start = OnSphere((0.1, 0.2, 0.3), 0.7, normal)
        n = np.array(normal)
        side = np.cross(n, (1, 1, 0.5))
        rows = [n, -n, side * 3 + n * 2.0**-40, np.nextafter(-n, 0)]
        index, t = exact_rays.closest_from(start, rows, [start.center], [start.radius])
        assert index.tolist() == [-1, 0, -1, 0]
        assert judge.is_rounded(float(t[1]), 2 * mpmath.mpf(0.7) / mpmath.sqrt(sum(mpmath.mpf(x) ** 2 for x in normal)))
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
