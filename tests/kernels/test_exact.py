"""The kernel against the exact oracle: hostile regimes, and exact tangents and ties; no excused band."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pyopencl as cl
import pytest
from hostile.sphere_regimes import EDGES, REGIMES, camera_space, rays
from stress_cases import pairs_on_a_plane
from surface_rays import closest

import cltrace
from cltrace import Camera, Scene
from cltrace.plan import opencl
from cltrace.reference import world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run import program
from cltrace.run.devices import Device

THINNED = (8_000, 2)
LONG = (1_050_000, 12)


def compare(name: str, device: Device, precision: str, total: int, seeds: int) -> None:
    """`total` rays of a regime, over several seeds: no other id, t within 0.52 ulp of float32 and 1e-8 in double."""
    make = dict(REGIMES + EDGES)[name]
    side = int(np.ceil(np.sqrt(total / seeds)))
    wrong = 0
    for seed in range(seeds):
        scene = make(seed, size=(side, side))
        image = cltrace.render(scene, device, precision, ("id", "depth"))
        assert image.id is not None
        assert image.depth is not None
        d = rays(scene.camera)
        index, t = closest(camera_space(scene)[0], d, *camera_space(scene)[1:])
        wrong += int((image.id.ravel() != index).sum())
        hit = index >= 0
        exact = np.float64(t[hit].astype(np.longdouble) * np.sqrt((d[hit].astype(np.longdouble) ** 2).sum(axis=1)))
        got = image.depth.ravel()[hit]
        assert np.abs(got / exact - 1).max(initial=0) <= 1e-8
        ulps = np.abs(got.astype(np.float32).astype(np.longdouble) - exact) / np.spacing(exact.astype(np.float32))
        assert ulps.max(initial=0) <= 0.52
    assert wrong == 0


# double leaves out the filter, and that is all: in an ordinary run some regimes are enough for it.
ORDINARY = [
    pytest.param(name, precision, marks=pytest.mark.stress if precision == "double" and k % 4 else ())
    for precision in ("accurate", "double")
    for k, (name, _) in enumerate(REGIMES + EDGES)
]


@pytest.mark.parametrize(("name", "precision"), ORDINARY)
def test_regime(device: Device, name: str, precision: str) -> None:
    compare(name, device, precision, *THINNED)


@pytest.mark.stress
@pytest.mark.parametrize("name", [name for name, _ in REGIMES + EDGES])
def test_regime_with_a_million_rays(device: Device, name: str) -> None:
    compare(name, device, "accurate", *LONG)


@pytest.mark.parametrize("precision", ["accurate", "double"])
def test_a_ray_that_touches_hits(device: Device, precision: str) -> None:
    """Spheres at decimal places that the middle ray touches, alone and with something far away in the scene."""
    camera = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 45, (3, 3), square_pixels=False)
    for number in range(300 if precision == "accurate" else 30):
        # The literal case first; then of one to six decimals.
        z = 0.3 if number == 0 else round(9 * (number * 0.6180339887498949 % 1) + 0.2, number % 6 + 1)
        r = (1, 0.1, 0.3, 0.5, 0.7, 2)[number % 6]
        for more in ([], [(1e14, 0, -5)]):
            scene = Scene.from_spheres(camera, [], [(r, 0, -z), *more], [r, *[1.0] * len(more)])
            image = cltrace.render(scene, device, precision, ("id", "depth"))
            assert image.id is not None
            assert image.depth is not None
            assert image.id[1, 1] == 0, (z, r, more)
            assert abs(image.depth[1, 1] / z - 1) <= 2.0**-52, (z, r, more)


@pytest.mark.parametrize("name", [name for name, _ in EDGES])
def test_edges_to_the_bit(device: Device, width: int, name: str) -> None:
    """The same distances as the reference's, whose discriminants are exact where they are in doubt."""
    for seed in range(2):
        scene = dict(EDGES)[name](seed, size=(33, 5) if seed % 2 == 0 else (5, 33))
        image = cltrace.Renderer(scene, device, "accurate", ("id", "depth"), width=width).render()
        world = world_of(scene)
        assert image.id is not None
        assert image.depth is not None
        for y, x in np.ndindex(image.id.shape):
            _, at = trace(world, primary_ray(scene.camera, x, y))
            assert image.id[y, x] == (at.index if at else -1)
            assert image.depth[y, x] == (at.distance if at else np.inf)


def far_and_small(seed: int) -> Scene:
    """A turned camera, one pixel of which looks at a sphere that is 1e13 to 1e30 times as far away as it is large.

    The centre is a double; the eye is where the ray from there goes by in less than a few radii.
    """
    rng = np.random.default_rng(seed)
    view, up = np.round(rng.normal(size=3) * 2.0**16) / 2.0**16, (0, 1, 0.25)
    camera = Camera((0, 0, 0), view, up, 40, (9, 7))
    ray = primary_ray(camera, int(rng.integers(9)), int(rng.integers(7)))
    distance = Fraction(2) ** int(rng.integers(20, 75))
    to = [
        distance * sum(Fraction(d) * Fraction(axis[i]) for d, axis in zip(ray.direction, camera.basis(), strict=True))
        for i in range(3)
    ]
    center = [float(x) for x in to]
    grid = Fraction(2) ** -24
    eye = [float(round((Fraction(c) - x) / grid) * grid) for c, x in zip(center, to, strict=True)]
    moved = Camera(eye, eye + view, up, 40, (9, 7))
    assert moved.basis() == camera.basis()
    return Scene.from_spheres(moved, [], [center], 2.0 ** rng.uniform(-26, -22))


@pytest.mark.slow
def test_far_and_small_spheres_by_turned_cameras(device: Device, width: int) -> None:
    """To the bit as the reference, which decides in exact arithmetic; about half of the spheres are hit."""
    hits = 0
    for seed in range(80):
        scene = far_and_small(seed)
        image = cltrace.Renderer(scene, device, "accurate", ("id", "depth"), width=width).render()
        world = world_of(scene)
        for y in range(7):
            for x in range(9):
                _, at = trace(world, primary_ray(scene.camera, x, y))
                hits += at is not None
                assert image.id is not None
                assert image.depth is not None
                assert image.id[y, x] == (at.index if at else -1), seed
                assert image.depth[y, x] == (at.distance if at else np.inf), seed
    assert 20 < hits < 80


@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")  # the log of a build that worked
def test_whole_numbers(device: Device) -> None:
    """x y + z w in numbers.cl, rounded to the nearest double, ties to even: of both signs, with ties."""
    if not device.has_double:
        return
    rng = np.random.default_rng(0)
    data = rng.normal(size=(2000, 4)) * 2.0 ** rng.integers(-120, 120, (2000, 4))
    data[:500, 2] = -data[:500, 0] * (1 + rng.integers(-3, 4, 500) * 2.0**-52)
    data[:500, 3] = data[:500, 1] * (1 + rng.integers(-3, 4, 500) * 2.0**-52)
    # Half a unit in the last place beside a whole number.
    data[500:1000, :2] = rng.integers(2**52, 2**53, (500, 1)) * [1, 0] + [0, 1]
    data[500:1000, 2:] = rng.choice([-0.5, 0.5, 0.5 + 2.0**-50, 0.5 - 2.0**-50], (500, 1)) * [1, 0] + [0, 1]
    source = (
        program.source(("packet.cl", "abi", "numbers.cl"))
        + """
    __kernel void sums(__global const double4 *in, __global double *out) {
        const double4 v = in[get_global_id(0)];
        Span span = span_of_both(span_of_both(span_of(v.x), span_of(v.y)), span_of_both(span_of(v.z), span_of(v.w)));
        const int n = (2 * (span.high - span.low) + 33) / 32;
        Integer sum, a, b;
        set_to(&sum, 0, 0, n);
        set_to(&a, v.x, span.low, n);
        set_to(&b, v.y, span.low, n);
        add_product(&sum, &a, &b, n);
        set_to(&a, v.z, span.low, n);
        set_to(&b, v.w, span.low, n);
        add_product(&sum, &a, &b, n);
        out[get_global_id(0)] = nearest_double(&sum, 2 * span.low, n);
    }"""
    )
    context = cl.Context([device.cl])
    queue, flags = cl.CommandQueue(context), cl.mem_flags
    given = cl.Buffer(context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=data)
    out = np.empty(len(data))
    buffer = cl.Buffer(context, flags.WRITE_ONLY, out.nbytes)
    built = cl.Program(context, source).build(["-DW=1", "-DRUN=1", *opencl.options("double", frozenset())])
    built.sums(queue, (len(data),), None, given, buffer)
    cl.enqueue_copy(queue, out, buffer)
    for row, got in zip(data.tolist(), out.tolist(), strict=True):
        x, y, z, w = map(Fraction, row)
        assert got == float(x * y + z * w)


def extreme(seed: int) -> Scene:
    """Numbers with all the bits that a scene can have: the exact arithmetic of the kernel takes the most digits."""
    rng = np.random.default_rng(seed)
    up, tiny, huge = (0.0, 1.0, 2.0**-149), 2.0**-149 * (1 + 2.0**-52), 2.0**127 * (2 - 2.0**-23)
    camera = Camera(
        (tiny, 0, tiny), (2.0**-149 * 3, 2.0**-149, -huge), up, 2.0**-149 * 1.3, (9, 7), square_pixels=False
    )
    # The plane is about the middle column's.
    return Scene.from_spheres(camera, [], *pairs_on_a_plane(rng, tiny, huge))


@pytest.mark.slow
def test_the_most_digits(device: Device, width: int) -> None:
    seen = set()
    for seed in range(12):
        scene = extreme(seed)
        image = cltrace.Renderer(scene, device, "accurate", ("id",), width=width).render()
        world = world_of(scene)
        for y in range(7):
            for x in range(9):
                _, at = trace(world, primary_ray(scene.camera, x, y))
                assert image.id is not None
                assert image.id[y, x] == (at.index if at else -1), (seed, x, y)
                seen.add(at.index if at else -1)
    assert len(seen) > 3
