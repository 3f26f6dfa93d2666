"""What host and kernel agree on: offsets on each device, flags, constants, and that nothing drifts apart unseen."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyopencl as cl
import pytest

import cltrace
from cltrace.picture.image import OUTPUTS
from cltrace.plan import abi, opencl
from cltrace.plan.plan import Plan
from cltrace.plan.request import COMPOSED, Request
from cltrace.run import program
from cltrace.run.devices import Device

ROOT = Path(__file__).parents[2]
KERNELS = {name: (ROOT / "kernels" / name).read_text("utf-8") for name in program.SOURCES if name != "abi"}


def plan_of(scene: cltrace.Scene, *outputs: str) -> Plan:
    return Plan.of_scene(scene, Request(outputs=outputs or ("rgb8",)))


@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")  # the log of a build that worked
@pytest.mark.parametrize("precision", ["single", "double"])
def test_offsets(device: Device, precision: abi.Precision) -> None:
    """Host and device lay out the shared structs alike: the device itself says where each field is."""
    bodies, expected = [], []
    for name in abi.STRUCTS:
        dtype = abi.dtype_of(name, precision)
        assert dtype.fields is not None
        bodies.append(f"{{ {name} x;")
        for field, (_, offset, *_) in dtype.fields.items():
            bodies.append(f"out[{len(expected)}] = (int)((__private char *)&x.{field} - (__private char *)&x);")
            expected.append((name, field, int(offset)))
        bodies.append(f"out[{len(expected)}] = sizeof(x); }}")
        expected.append((name, "its size", dtype.itemsize))
    text = program.source(("packet.cl", "abi"))
    source = f"{text}\n__kernel void offsets(__global int *out) {{\n" + "\n".join(bodies) + "\n}"
    context = cl.Context([device.cl])
    queue = cl.CommandQueue(context)
    out = np.full(len(expected), -1, np.int32)
    buffer = cl.Buffer(context, cl.mem_flags.READ_WRITE, out.nbytes)
    options = ["-DW=1", "-DRUN=1", *opencl.options(precision, frozenset())]
    cl.Program(context, source).build(options).offsets(queue, (1,), None, buffer)
    cl.enqueue_copy(queue, out, buffer)
    assert [(name, field, at) for (name, field, _), at in zip(expected, out.tolist(), strict=True)] == expected


def test_build_refuses_another_layout(any_device: Device) -> None:
    """If the sizes differ, the compiler's message names the struct."""
    plan = plan_of(cltrace.Scene.from_spheres(cltrace.Camera(), [], [(0, 0, -3)], 1.0))
    options = [o if "Light_BYTES" not in o else "-DLight_BYTES=124" for o in plan.options()]
    with pytest.raises(cltrace.BuildError, match="layout_of_Light_differs_from_numpy"):
        program.program(any_device, ["-DW=1", "-DRUN=1", *options])


def test_no_value_is_a_struct() -> None:
    """NVIDIA's compiler loses a struct of the kernel's parameters where functions hand it on by its address."""
    assert [a.name for a in abi.ARGUMENTS if a.kind == "value" and a.type in abi.STRUCTS] == []


def test_an_image_has_a_place_for_each_output() -> None:
    assert (*abi.OUTPUTS, *COMPOSED) == OUTPUTS


def test_flags_that_are_used_are_flags_that_can_be_set() -> None:
    """A misspelt flag in an #ifdef would be off for ever; one in HAS() does not compile."""
    code = "\n".join(re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL) for text in [*KERNELS.values(), opencl.header()])
    conditions = re.findall(r"^#\s*(?:ifdef|ifndef|if|elif)\b(.*)$", code, re.MULTILINE)
    used = {name for line in conditions for name in re.findall(r"\b[A-Za-z_]\w*", line)} - {"defined"}
    used |= set(re.findall(r"\bHAS\(([A-Z_0-9]+)\)", code))
    own = set(re.findall(r"^#\s*define\s+(\w+)", code, re.MULTILINE)) | {"__has_builtin", "__AVX__", "__AVX512DQ__"}
    builtins = {name for name in used if name.startswith("__builtin")}
    values = {"W", "RUN"} | {option[2:].partition("=")[0] for option in opencl.options("single", frozenset())}
    given = set(abi.FLAGS) | values
    assert used - own - builtins <= given
    assert set(abi.FLAGS) <= used
    assert all(re.search(rf"\b{name}\b", code) for name in values)


def test_a_program_for_each_combination_of_features_only() -> None:
    """Numbers are arguments, so scenes with the same features share a program."""
    camera = cltrace.Camera(resolution=(64, 48))
    light = cltrace.point_light((1, 2, 3))
    one = plan_of(cltrace.Scene.from_spheres(camera, [light], [(0, 0, -3), (1, 0, -4)], 1.0))
    two = plan_of(cltrace.Scene.from_spheres(camera, [light] * 3, np.eye(3) * 9, 0.5))
    assert one.options() == two.options()


def test_few_sets_of_features() -> None:
    """What costs a frame little is asked at run time. What costs more has a flag, which only such scenes set."""
    camera = cltrace.Camera()

    def flags(*lights: np.ndarray, outputs: tuple[str, ...] = ("rgb8",), **material: float) -> set[str]:
        scene = cltrace.Scene.from_spheres(camera, lights, [(0, 0, -3), (0, 0, -9)], 1.0, **material)
        return {f.removeprefix("WITH_") for f in plan_of(scene, *outputs).features}

    base = {"SPHERES", "FILTER"}
    for light in ((), (cltrace.ambient_light(),), (cltrace.parallel_light((0, 0, -1)),)):
        assert flags(*light) == flags(*light, ks=0) == base
    point, spot = cltrace.point_light((0, 0, 0)), cltrace.spot_light((0, 0, 0), (0, 0, -1), 10, 20)
    assert flags(point) == flags(spot) == flags(spot, point, kd=0) == base | {"POINTS"}
    assert flags(outputs=("id",)) == flags(outputs=("normal", "uv")) == base | {"EXTRAS", "POINTS"}
    assert flags(reflectance=0.5) == base | {"BOUNCES", "LEAVING"}
    assert flags(reflectance=0.5, transmittance=0.5) == base | {"BOUNCES", "GLASS", "INSIDE", "LEAVING", "SPLITS"}
    assert flags(reflectance=0.5, outputs=("id",)) == base | {"EXTRAS", "POINTS"}
