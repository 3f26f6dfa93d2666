"""Textures in the kernel: where a point is on one, and the colour there, against the reference and by hand."""

from __future__ import annotations

import functools
import math
import warnings
from fractions import Fraction

import mpmath
import numpy as np
import pyopencl as cl
import pytest
from conftest import world

import cltrace
from cltrace import Camera, Renderer, Scene
from cltrace.plan import opencl
from cltrace.plan.materials import Textures
from cltrace.plan.plan import Plan
from cltrace.plan.request import Request
from cltrace.reference import Intersection
from cltrace.reference.trace import primary_ray, trace
from cltrace.run import program
from cltrace.run.devices import Device
from cltrace.scene import MATERIAL, SPHERE

pytestmark = pytest.mark.slow


def widths(device: Device) -> list[int]:
    """Those that the device has vectors for."""
    return [width for width in (1, 4, 8, 16) if width <= device.width]


BALL = Scene.from_spheres(Camera((1, 2, 5), (0, 0, 0), horizontal_fov=16, resolution=(40, 30)), [], [(0, 0, 0)], 1.0)


def coordinates(scene: Scene) -> np.ndarray:
    """What the reference's normals say of a scene of plain spheres, (h, w, 2); 0 where nothing is met."""
    width, height = scene.camera.resolution
    basis, uv = np.array(scene.camera.basis()), np.zeros((height, width, 2))
    for y in range(height):
        for x in range(width):
            at = trace(world(scene), primary_ray(scene.camera, x, y))[1]
            if at:
                n = tuple(at.normal) @ basis
                uv[y, x] = 0.5 + np.arctan2(n[0], n[2]) / (2 * np.pi), np.arctan2(np.hypot(n[0], n[2]), n[1]) / np.pi
    return uv


def called(device: Device, precision: str, width: int, body: str, results: int, *given: np.ndarray) -> np.ndarray:
    """What a kernel finds, (results, n) of the precision of colours.

    body: its code, for the W numbers from `first` on, which writes to out[0] and so on; given: (n,) arrays each, which
    it knows as a, b and so on: real numbers, or integers of 32 bits, or of 8; n is a multiple of the width.
    """
    real = np.dtype("f4" if precision == "single" else "f8")
    arrays = [a.astype(real) if a.dtype == np.float64 else np.ascontiguousarray(a) for a in given]
    types = {real: "real", np.dtype("i4"): "int", np.dtype("u1"): "uchar"}
    parameters = [f"__global const {types[a.dtype]} *{name}" for a, name in zip(arrays, "abcdefgh", strict=False)]
    pointers = ", ".join(f"all + {k * len(given[0])} + first" for k in range(results))
    source = f"""{program.source()}
    __kernel void called({", ".join(parameters)}, __global real *all) {{
        const int first = (int)get_global_id(0) * W;
        __global real *out[] = {{{pointers}}};
        {body}
    }}"""
    context = cl.Context([device.cl])
    queue = cl.CommandQueue(context)
    features = frozenset(
        {f"WITH_{part}" for part in ("SPHERES", "INTERSECTION", "NORMAL", "SHADING", "UV", "TEXTURES")}
    )
    flags = [f"-D{flag}" for flag in (f"W={width}", "RUN=1", *device.flags)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)  # the log of a build that worked
        options = [*opencl.options(precision, features), *flags, "-cl-std=CL1.2"]  # type: ignore[arg-type]
        kernel = cl.Kernel(cl.Program(context, source).build(options), "called")
    out = np.empty((results, len(given[0])), real)
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    buffers = [cl.Buffer(context, read, hostbuf=a) for a in arrays]
    buffers.append(cl.Buffer(context, cl.mem_flags.WRITE_ONLY, out.nbytes))
    kernel(queue, (len(given[0]) // width,), (1,), *buffers)
    cl.enqueue_copy(queue, out, buffers[-1])
    return out


def turns(device: Device, precision: str, y: np.ndarray, x: np.ndarray, width: int) -> np.ndarray:
    """turns_of() of the kernel."""
    body = "STORE_LANES(turns_of(LOAD_LANES(a + first), LOAD_LANES(b + first)), out[0]);"
    return called(device, precision, width, body, 1, y, x)[0]


PAINT = """
    Scene scene;
    scene.texel = d;
    scene.texture = (__global const int4 *)e;
    scene.texture_of = f;
    scene.material_of = g;
    Intersection at;
    at.u = LOAD_LANES(b + first);
    at.v = LOAD_LANES(c + first);
    at.ambient.x = at.ambient.y = at.ambient.z = at.diffuse.x = at.diffuse.y = at.diffuse.z = 1;
    paint(&scene, LOAD_LANES(a + first), &at);
    STORE_LANES(TO_REAL(at.ambient.x), out[0]);
    STORE_LANES(TO_REAL(at.ambient.y), out[1]);
    STORE_LANES(TO_REAL(at.diffuse.z), out[2]);
"""


def painted(
    device: Device, precision: str, width: int, images: list[np.ndarray], which: np.ndarray, uv: np.ndarray
) -> np.ndarray:
    """What white is at (n, 2) coordinates of those images, which (n,), -1 for a surface that has none. (n, 3).

    Surface i has the material i, and the image i - 1.
    """
    materials = np.arange(len(images) + 1, dtype=np.int32)
    textures = Textures.of(tuple(images), materials - 1, materials)
    buffers = textures.texel, textures.place.reshape(-1), textures.of_material, materials
    given = (which.astype(np.int32) + 1, *np.ascontiguousarray(uv.T), *buffers)
    return called(device, precision, width, PAINT, 3, *given).T


def exact(image: np.ndarray, u: float, v: float) -> list[float]:
    """The colour there by the definition, without rounding."""
    x, y = Fraction(u) * image.shape[1], Fraction(v) * image.shape[0]
    i, j = math.floor(x), math.floor(y)
    parts = ((i, 1 - (x - i)), (i + 1, x - i)), ((j, 1 - (y - j)), (j + 1, y - j))
    full = np.iinfo(image.dtype).max
    texels = [
        [share * other * int(part) for part in image[row % image.shape[0], column % image.shape[1]]]
        for column, share in parts[0]
        for row, other in parts[1]
    ]
    return [float(sum(part) / full) for part in zip(*texels, strict=True)]


@pytest.mark.parametrize(("precision", "bound"), [("accurate", 2.0**-51), ("single", 2.0**-21)])
def test_angles_are_right(device: Device, precision: str, bound: float) -> None:
    """The error that the comment in texture.cl proves, and none at all of multiples of an eighth turn."""
    random = np.random.default_rng(0)
    y, x = random.normal(size=(2, 4096))
    # Both signs, both sides of the diagonals and of tan(pi / 8), and all but on the axes.
    near = np.tan(np.arange(-8, 8) * np.pi / 8) * (1 + random.normal(size=(16, 16)) * 2.0**-20)
    y[:256], x[:256] = near.ravel(), 1
    y[256:512] *= 2.0 ** -random.uniform(0, 60, 256)
    x[512:768] *= 2.0 ** -random.uniform(0, 60, 256)
    exact = np.array([(0, 0), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-0.0, -1), (-1, -1), (-1, 0), (-1, 1)])
    y[768:778], x[768:778] = exact.T
    if precision == "single":
        y, x = (a.astype(np.float32).astype(np.float64) for a in (y, x))
    out = turns(device, precision, y, x, device.width)
    assert out[768:778].tolist() == [0, 0, 0.125, 0.25, 0.375, 0.5, 0.5, -0.375, -0.25, -0.125]
    with mpmath.workdps(30):
        # At -1 exactly the kernel's angle is half a turn, whatever the sign of 0.
        want = [mpmath.atan2(a + 0.0, b) / (2 * mpmath.pi) for a, b in zip(y, x, strict=True)]
        error = max(abs(mpmath.mpf(float(a)) - b) for a, b in zip(out, want, strict=True))
    assert 0 < error < bound
    for width in widths(device):
        assert np.array_equal(turns(device, precision, y, x, width), out)


def test_drivers_agree_on_angles() -> None:
    y, x = np.random.default_rng(1).normal(size=(2, 4096))
    drivers = [turns(device, "accurate", y, x, device.width) for device in cltrace.devices() if device.has_double]
    assert all(np.array_equal(drivers[0], other) for other in drivers)


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_coordinates_of_spheres(device: Device, precision: str) -> None:
    want = coordinates(BALL)
    first = cltrace.render(BALL, device, precision, ("uv", "id", "primitive"))
    assert first.uv.shape == (30, 40, 2)
    assert first.uv.dtype == np.float32
    # u's error grows towards the poles, where all longitudes are near each other.
    errors = np.abs(first.uv - want) * np.stack([np.sin(np.pi * want[..., 1]), np.ones_like(want[..., 1])], axis=-1)
    assert errors.max() <= (1e-6 if precision == "single" else 2.0**-24)
    assert (first.uv[first.id < 0] == 0).all()
    assert (first.uv[first.id >= 0] > 0).all()
    assert (first.primitive == -1).all()
    for width in widths(device):
        image = Renderer(BALL, device, precision, ("uv",), width=width).render()
        assert np.array_equal(image.uv, first.uv), width


def test_poles_and_seam(device: Device) -> None:
    """Along the axes the coordinates are exact, from all six sides."""
    ways = {
        (0, 0, 1): (0.5, 0.5),
        (1, 0, 0): (0.75, 0.5),
        (0, 0, -1): (1, 0.5),
        (-1, 0, 0): (0.25, 0.5),
        (0, 1, 0): (0.5, 0),
        (0, -1, 0): (0.5, 1),
    }
    for way, want in ways.items():
        up = (0, 0, 1) if way[1] else (0, 1, 0)
        camera = Camera(tuple(5 * x for x in way), (0, 0, 0), up, 10, (1, 1))
        scene = Scene.from_spheres(camera, [], [(0, 0, 0)], 1.0)
        for precision in ("accurate", "single"):
            assert cltrace.render(scene, device, precision, ("uv",)).uv[0, 0].tolist() == list(want), way


FOUR = np.array([[(0, 0, 0), (200, 100, 51)], [(100, 100, 100), (40, 80, 255)]], np.uint8)


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_colours_by_hand(device: Device, precision: str) -> None:
    """Texels, halves between them, and how textures repeat."""
    one = np.array([[(255, 51, 0)]], np.uint8)
    deep = np.array([[(65535, 13107, 257), (0, 0, 0)]], np.uint16)
    cases = [
        (FOUR, (0, 0), (0, 0, 0)),
        (FOUR, (0.25, 0), (100, 50, 25.5)),
        (FOUR, (0.5, 0), (200, 100, 51)),
        (FOUR, (0.75, 0), (100, 50, 25.5)),  # between the last column and the first
        (FOUR, (1, 0), (0, 0, 0)),
        (FOUR, (2.5, 3), (200, 100, 51)),
        (FOUR, (-0.5, 0), (200, 100, 51)),
        (FOUR, (-0.25, -2), (100, 50, 25.5)),
        (FOUR, (0, 0.5), (100, 100, 100)),  # v goes down from the top row
        (FOUR, (0, 0.75), (50, 50, 50)),
        (FOUR, (0, 1), (0, 0, 0)),
        (FOUR, (0.5, 0.5), (40, 80, 255)),
        (FOUR, (0.25, 0.25), (85, 70, 101.5)),
        (FOUR, (-1e-30, -1e-30), (0, 0, 0)),
        (FOUR, (2.0**100, -(2.0**127)), (0, 0, 0)),
        (FOUR, (2.0**22 + 0.5, -(2.0**22) - 0.5), (40, 80, 255)),
        (one, (0.3, -7.7), (255, 51, 0)),
        (one, (1e30, 0.999), (255, 51, 0)),
        (deep, (0, 5), (255, 51, 1)),
        (deep, (1.25, 0.1), (127.5, 25.5, 0.5)),
        (None, (0.25, 0.25), (255, 255, 255)),
    ]
    images = [FOUR, one, deep]
    which = np.array([next((i for i, image in enumerate(images) if image is case[0]), -1) for case in cases])
    uv, want = np.array([case[1] for case in cases], float), np.array([case[2] for case in cases]) / 255
    # Each case once in each lane, beside other textures than before.
    order = np.concatenate([np.roll(np.arange(len(cases)), 5 * k) for k in range(16)])
    for width in widths(device):
        got = painted(device, precision, width, images, which[order], uv[order])
        assert np.abs(got - want[order]).max() <= (1e-15 if precision == "double" else 2.0**-24)


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_colours_are_right(device: Device, precision: str) -> None:
    """Any size, depth and place, in one packet, against the definition."""
    random = np.random.default_rng(2)
    images = [
        random.integers(0, np.iinfo(dtype).max + 1, (*size, 3)).astype(dtype)
        for dtype in (np.uint8, np.uint16)
        for size in ((1, 7), (300, 1), (49, 50), (129, 1000))
    ]
    n = 1024
    which = random.integers(0, len(images), n)
    uv = random.uniform(-1.5, 1.5, (n, 2)) * random.choice((1, 1, 1, 30), (n, 1))
    # Multiples of eighths of texels, which are not doubles where the side is no power of two.
    side = np.array([images[k].shape[1::-1] for k in which])
    uv[::3] = np.rint(uv[::3] * 8 * side[::3]) / (8 * side[::3])
    if precision == "single":
        uv = uv.astype(np.float32).astype(float)
    want = np.array([exact(images[k], *place) for k, place in zip(which, uv.tolist(), strict=True)])
    got = painted(device, precision, device.width, images, which, uv)
    # In float, coordinates up to 45 and sides up to 1000 leave 2^-24 of 45,000 texels, for each side.
    assert (
        np.abs(got - want).max() <= {"accurate": 2.0**-22, "double": 1e-11, "single": 2 * 45_000 * 2.0**-24}[precision]
    )
    for width in widths(device):
        assert np.array_equal(painted(device, precision, width, images, which, uv), got)


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_at_a_texel_the_colour_is_its_own(device: Device, precision: str) -> None:
    """For every width up to 128, although i/W is rounded, and times W may be less than i."""
    random = np.random.default_rng(3)
    images = [random.integers(0, 256, (1, width, 3), np.uint8) for width in range(1, 129)]
    which = np.repeat(np.arange(128), np.arange(1, 129))
    column = np.concatenate([np.arange(width) for width in range(1, 129)])
    u = column / (which + 1)
    got = painted(device, precision, 16 if device.width == 16 else 1, images, which, np.stack([u, 0 * u], axis=1))
    want = np.array([images[k][0, i] for k, i in zip(which, column, strict=True)])
    assert np.array_equal(np.rint(got * 255), want)
    error = np.abs(got * 255 - want).max()
    assert error <= {"accurate": 2.0**-16, "double": 1e-9, "single": 2.0**-7}[precision]


def globe(texture: int = 0, images: tuple[np.ndarray, ...] = (FOUR,), to_object: np.ndarray | None = None) -> Scene:
    """A ball in ambient light that has an image."""
    spheres, materials = np.zeros(1, SPHERE), np.zeros(2, MATERIAL)
    spheres["radius"], spheres["to_object"] = 1, -1 if to_object is None else 0
    materials["color"] = materials["ka"] = materials["kd"] = materials["index"] = 1
    materials["texture"] = texture, 0
    maps = np.empty((0, 3, 3)) if to_object is None else to_object[None]
    return Scene(BALL.camera, [cltrace.ambient_light((1, 1, 1))], spheres, materials, to_object=maps, textures=images)


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_a_globe(device: Device, precision: str) -> None:
    """The picture has the colours of its own coordinates; a turned one those of its own axes."""
    a, b = math.cos(0.7), math.sin(0.7)
    turned = np.array([(a, 0, b), (0, 1, 0), (-b, 0, a)]) @ np.array([(1, 0, 0), (0, a, -b), (0, b, a)])
    image = np.random.default_rng(4).integers(0, 256, (6, 9, 3), np.uint8)
    for to_object in (None, turned):
        scene = globe(0, (image,), to_object)
        drawn = cltrace.render(scene, device, precision, ("rgb8", "color", "uv", "id"))
        hit = drawn.id >= 0
        want = np.array([exact(image, *uv) for uv in drawn.uv[hit].tolist()])
        assert np.abs(drawn.color[hit] - want).max() <= 1e-5  # as uv is in float
        assert (drawn.color[~hit] == 0).all()
        other = Renderer(scene, device, precision, ("color",), width=1).render()
        assert np.abs(other.color - drawn.color).max() <= 2e-6
    plain = coordinates(BALL)[hit]
    longitude, colatitude = (2 * plain[:, 0] - 1) * np.pi, plain[:, 1] * np.pi
    across = np.sin(colatitude)
    normal = np.stack([across * np.sin(longitude), np.cos(colatitude), across * np.cos(longitude)], axis=1) @ turned.T
    assert np.abs(np.arccos(normal[:, 1]) / np.pi - drawn.uv[hit][:, 1]).max() <= 1e-6


@functools.cache
def gallery() -> Scene:
    """Balls with images and without, an ellipsoid with one, all in a mirror and through glass."""
    random = np.random.default_rng(5)
    images = [
        random.integers(0, np.iinfo(dtype).max + 1, (*size, 3)).astype(dtype)
        for dtype, size in ((np.uint8, (3, 5)), (np.uint16, (4, 4)), (np.uint8, (1, 2)))
    ]
    spheres, materials = np.zeros(7, SPHERE), np.zeros(7, MATERIAL)
    spheres["center"] = [(-2, 0, 0), (0, 0, 0), (2, 0, 0), (0, 1.6, -1), (-1, -1.2, 1), (1, -1.2, 1), (0, -103, 0)]
    spheres["radius"], spheres["material"], spheres["to_object"] = [0.8, 0.8, 0.8, 0.9, 0.5, 0.5, 101], range(7), -1
    spheres["to_object"][2] = 0
    materials["color"] = [(1, 1, 1), (1, 1, 1), (0.5, 1, 0.7), (1, 1, 1), (0.9, 0.9, 1), (1, 0.3, 0.2), (1, 1, 1)]
    materials["ka"] = materials["kd"] = 0.8
    materials["ks"], materials["exponent"], materials["index"] = 0.3, 30, 1.5
    materials["texture"] = [0, 1, 0, 2, -1, -1, 2]
    materials["reflectance"], materials["transmittance"] = [0, 0, 0, 0.7, 0.1, 0, 0.3], [0, 0, 0, 0, 0.8, 0, 0]
    lights = [cltrace.ambient_light(), cltrace.point_light((5, 8, 9), (0.8, 0.8, 0.8))]
    camera = Camera((0, 1, 8), (0, 0, 0), horizontal_fov=20, resolution=(48, 36), max_bounces=4)
    squashed = np.array([[(1.2, 0.3, 0), (0, 0.8, 0.2), (0.1, 0, 1)]])
    return Scene(camera, lights, spheres, materials, (0.2, 0.3, 0.5), "x.png", squashed, textures=images)


@functools.cache
def expected(x: int, y: int) -> tuple[tuple[float, float, float], Intersection | None]:
    """What the reference says of a pixel of the gallery."""
    return trace(world(gallery()), primary_ray(gallery().camera, x, y))


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_kernel_agrees_with_the_reference(device: Device, width: int, precision: str) -> None:
    image = Renderer(gallery(), device, precision, ("rgb8", "color", "id", "uv", "primitive"), width=width).render()
    hits = 0
    for y, x in np.ndindex(image.id.shape):
        color, at = expected(x, y)
        assert image.id[y, x] == (at.index if at else -1)
        assert np.abs(image.rgb8[y, x] - 255 * np.clip(color, 0, 1)).max() <= 1
        assert (
            np.abs(image.color[y, x] - color).max() <= {"accurate": 5e-7, "double": 2.0**-24, "single": 5e-5}[precision]
        )
        if at:
            hits += 1
            assert np.abs(image.uv[y, x] - at.uv).max() <= (5e-5 if precision == "single" else 2.0**-24)
            assert at.primitive == image.primitive[y, x] == -1
    assert hits > 800


def test_only_textures_that_show_are_packed() -> None:
    """A texture that several materials have is there once; one of materials that no surface has is not."""
    images = tuple(np.full((2, 3, 3), k, dtype) for k, dtype in enumerate((np.uint8, np.uint16, np.uint8)))
    textures = Textures.of(images, np.array([2, 0, -1, 2, 1]), np.array([0, 4, 3, 2, 2]))
    assert textures.place.tolist() == [[3, 2, 0, 65535], [3, 2, 36, 255]]
    assert textures.of_material.tolist() == [1, -1, -1, 1, 0]
    assert textures.texel[:36].view(np.uint16).tolist() == [1] * 18
    assert textures.texel[36:54].tolist() == [2] * 18
    assert len(textures.texel) == 54 + 8


def test_flags() -> None:
    assert "WITH_TEXTURES" in Plan.of_scene(globe(), Request()).features
    for plan in (
        Plan.of_scene(globe(-1), Request()),  # only a material that nothing has
        Plan.of_scene(globe(), Request(outputs=("id", "normal", "depth"))),
    ):
        assert not {"WITH_TEXTURES", "WITH_UV"} & plan.features
        assert len(plan.arrays["texel"]) == 1
    seen = Plan.of_scene(globe(), Request(outputs=("uv",)))
    assert "WITH_UV" in seen.features
    assert "WITH_TEXTURES" not in seen.features


def test_another_camera_keeps_the_texels(device: Device) -> None:
    renderer = Renderer(globe(), device)
    moved = renderer.look(Camera((5, 0, 0), (0, 0, 0), horizontal_fov=16, resolution=(40, 30)))
    assert moved.plan.arrays["texel"] is renderer.plan.arrays["texel"]
    assert not np.array_equal(moved.render().rgb8, renderer.render().rgb8)
