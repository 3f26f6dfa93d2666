"""Textures in the kernel: where a point is on one, and the colour there, against the reference and by hand."""

from __future__ import annotations

import warnings

import mpmath
import numpy as np
import pyopencl as cl
import pytest
from conftest import world

import cltrace
from cltrace import Camera, Renderer, Scene
from cltrace.plan.plan import Plan
from cltrace.plan.request import Request
from cltrace.reference import primary_ray, trace
from cltrace.run import program
from cltrace.run.devices import Device


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


def turns(device: Device, precision: str, y: np.ndarray, x: np.ndarray, width: int) -> np.ndarray:
    """turns_of() of the kernel, of as many numbers as are a multiple of the width."""
    real = np.dtype("f4" if precision == "single" else "f8")
    source = f"""{program.source()}
    __kernel void turns(__global const real *y, __global const real *x, __global real *out) {{
        const int first = (int)get_global_id(0) * W;
        STORE_LANES(turns_of(LOAD_LANES(y + first), LOAD_LANES(x + first)), out + first);
    }}"""
    context = cl.Context([device.cl])
    queue = cl.CommandQueue(context)
    options = Plan.of_scene(BALL, Request(precision, ("uv",))).options()  # type: ignore[arg-type]
    flags = [f"-D{flag}" for flag in (f"W={width}", "RUN=1", *device.flags)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)  # the log of a build that worked
        kernel = cl.Kernel(cl.Program(context, source).build([*options, *flags, "-cl-std=CL1.2"]), "turns")
    out = np.empty(len(y), real)
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    buffers = [cl.Buffer(context, read, hostbuf=a.astype(real)) for a in (y, x)]
    buffers.append(cl.Buffer(context, cl.mem_flags.WRITE_ONLY, out.nbytes))
    kernel(queue, (len(y) // width,), (1,), *buffers)
    cl.enqueue_copy(queue, out, buffers[2])
    return out


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


def test_without_textures_their_code_is_not_there(device: Device) -> None:
    """A program without the file builds as long as nobody asks for coordinates."""
    files = tuple(name for name in program.SOURCES if name != "shade/texture.cl")
    lean = Plan.of_scene(BALL, Request(outputs=("rgb8", "normal", "primitive")))
    program.build(device, ["-DW=1", "-DRUN=1", *lean.options()], files)
    mapped = Plan.of_scene(BALL, Request(outputs=("uv",)))
    with pytest.raises(cltrace.BuildError, match="map_spheres"):
        program.build(device, ["-DW=1", "-DRUN=1", *mapped.options()], files)
