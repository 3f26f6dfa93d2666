"""Host and device lay out the shared structs alike: pyopencl asks each device for every offset."""

from __future__ import annotations

import numpy as np
import pyopencl as cl
import pyopencl.tools
import pytest

import cltrace
from cltrace.plan import layout, lists
from cltrace.run import program
from cltrace.run.devices import Device

STRUCTS = {"View": layout.view_dtype, "Light": layout.light_dtype, "Grid": lists.grid_dtype}


@pytest.mark.parametrize("name", sorted(STRUCTS))
@pytest.mark.parametrize("real", ["f4", "f8"])
def test_offsets(device: Device, name: str, real: str) -> None:
    dtype = STRUCTS[name](np.dtype(real))
    assert dtype.fields is not None
    scalar = {"f4": "float", "f8": "double"}
    fields = {f: (t.base.str[1:], offset) for f, (t, offset, *_) in dtype.fields.items()}
    text = program.source()
    struct = text[: text.index(f"}} {name};")].rpartition("typedef struct {")[2]
    lines = [
        f"out[{i}] = (int)((__private char *)&x.{field} - (__private char *)&x);" for i, field in enumerate(fields)
    ]
    source = f"""
    typedef {scalar[real]}4 real4;
    typedef struct {{ {struct} }} {name};
    __kernel void offsets(__global int *out) {{
        {name} x;
        {" ".join(lines)}
        out[{len(fields)}] = sizeof(x);
    }}"""
    context = cl.Context([device.cl])
    queue = cl.CommandQueue(context)
    out = np.zeros(len(fields) + 1, np.int32)
    buffer = cl.Buffer(context, cl.mem_flags.READ_WRITE, out.nbytes)
    cl.Program(context, source).build().offsets(queue, (1,), None, buffer)
    cl.enqueue_copy(queue, out, buffer)
    assert out.tolist() == [*(offset for _, offset in fields.values()), dtype.itemsize]


def test_build_refuses_another_layout(any_device: Device) -> None:
    """If the sizes differ, the compiler's message names the struct."""
    packed = layout.pack(cltrace.Scene.from_spheres(cltrace.Camera(), [], [(0, 0, -3)], 1.0), "accurate")
    options = [o if "Light_BYTES" not in o else "-DLight_BYTES=124" for o in packed.options()]
    with pytest.raises(cltrace.BuildError, match="layout_of_Light_differs_from_numpy"):
        program.build(any_device, ["-DW=1", *options])


def test_a_program_for_each_combination_of_features_only() -> None:
    """Numbers are arguments, so scenes with the same features share a program."""
    camera = cltrace.Camera(resolution=(64, 48))
    light = cltrace.point_light((1, 2, 3))
    one = layout.pack(cltrace.Scene.from_spheres(camera, [light], [(0, 0, -3), (1, 0, -4)], 1.0), "accurate")
    two = layout.pack(cltrace.Scene.from_spheres(camera, [light] * 3, np.eye(3) * 9, 0.5), "accurate")
    assert one.options() == two.options()


def test_features_are_only_those_that_the_scene_needs() -> None:
    camera = cltrace.Camera()

    def flags(*lights: np.ndarray, outputs: tuple[str, ...] = ("rgb8",), **material: float) -> set[str]:
        scene = cltrace.Scene.from_spheres(camera, lights, [(0, 0, -3), (0, 0, -9)], 1.0, **material)
        return {f.removeprefix("WITH_") for f in layout.pack(scene, "accurate", outputs).features if "WITH" in f}

    base = {"FILTER", "INTERSECTION", "SHADING"}
    assert flags() == base
    assert flags(cltrace.ambient_light()) == base
    assert flags(outputs=("id",)) == {"FILTER"}
    assert flags(outputs=("normal",)) == {"FILTER", "INTERSECTION", "NORMAL"}
    lit = base | {"NORMAL", "LIGHTS", "SHADOWS"}
    assert flags(cltrace.point_light((0, 0, 0))) == lit | {"POINT", "SPECULAR"}
    assert flags(cltrace.parallel_light((0, 0, -1)), ks=0) == lit | {"PARALLEL"}
    assert flags(cltrace.spot_light((0, 0, 0), (0, 0, -1), 10, 20), ks=0) == lit | {"SPOT"}
    assert flags(cltrace.point_light((0, 0, 0), color=(0, 0, 0))) == base
    assert flags(cltrace.point_light((0, 0, 0)), kd=0, ks=0) == base
