"""Arguments of kernels by name: names and types are the compiler's, and what does not fit is an error at the call."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from cltrace.plan import opencl
from cltrace.run.devices import Device
from cltrace.run.pack.toolbox import FILES, Toolbox, packed_types
from cltrace.run.program import BUFFER, UNSTOPPABLE, argument, kernel_folder, parameters_of, program, source


@pytest.mark.parametrize("name", ["floats", "doubles", "unstoppable"])
def test_parameters_are_those_that_the_compiler_sees(any_device: Device, name: str) -> None:
    """Of both programs that pack, and of the one that finds triangles."""
    files, macros = (
        (UNSTOPPABLE, dict[str, str]()) if name == "unstoppable" else (FILES, packed_types(name == "floats"))
    )
    features = frozenset({"WITH_TRIANGLES"} if name == "unstoppable" else ())
    options = [f"-D{macro}={value}" for macro, value in (macros | {"W": "1", "RUN": "1"}).items()]
    made = program(any_device, [*options, "-cl-kernel-arg-info", *opencl.options("double", features)], files).made
    found = parameters_of(source(files), macros)
    assert found.keys() == {kernel.function_name for kernel in made.all_kernels()}
    ask = cl.kernel_arg_info
    for kernel in made.all_kernels():
        parameters = found[kernel.function_name]
        assert kernel.num_args == len(parameters)
        for i, (parameter, type_) in enumerate(parameters.items()):
            assert kernel.get_arg_info(i, ask.NAME) == parameter
            declared = kernel.get_arg_info(i, ask.TYPE_NAME)
            assert type_ == (BUFFER if declared.endswith("*") else declared)


def test_each_kernel_s_file_is_in_a_program() -> None:
    assert {name for name in FILES if "pack/" in name} == {
        f"pack/{path.name}" for path in (kernel_folder() / "pack").iterdir()
    }


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"index": None}, "mend: missing or unknown: index"),
        ({"first": 0}, "mend: missing or unknown: first"),
        ({"count": 1.0}, "mend: count: 'float' object cannot be interpreted as an integer"),
        ({"count": 2**31}, "mend: count: "),
        ({"count": "a buffer"}, "mend: count: must be int, got a buffer"),
        ({"value": 1.0}, "mend: value: must be a buffer, got 1.0"),
        ({"count": (0, 0)}, "mend: count: "),
    ],
)
def test_wrong_arguments_are_errors_at_the_call(device: Device, changes: dict[str, Any], message: str) -> None:
    tools = Toolbox(device, "accurate")
    index, value = tools.upload(np.array([2], np.int32)), tools.upload(np.array([7.0]))
    column = tools.upload(np.zeros(4))
    arguments = {"count": 1, "index": index, "value": value, "column": column}
    changes = {name: index if new == "a buffer" else new for name, new in changes.items()}
    wrong = {name: new for name, new in (arguments | changes).items() if new is not None}
    with pytest.raises(TypeError, match=re.escape(message)):
        tools.run("mend", **wrong)
    tools.run("mend", **arguments)
    assert tools.read(column, 4, np.float64).tolist() == [0, 0, 7, 0]


def test_vectors_have_as_many_numbers_as_their_types() -> None:
    assert argument("double4", (1, 2, 3)).tolist() == (1, 2, 3, 0)
    assert argument("float2", np.array([0.1, 2])).tolist() == (np.float32(0.1), 2)
    for type_, value in (("double4", (1, 2)), ("float2", (1, 2, 3)), ("int2", (1.5, 2)), ("Grid", 1)):
        with pytest.raises(TypeError):
            argument(type_, value)
