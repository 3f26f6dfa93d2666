"""Arguments of kernels by name: names and types are the compiler's."""

from __future__ import annotations

import numpy as np
import pyopencl as cl
import pytest

from cltrace.plan import opencl
from cltrace.run.devices import Device
from cltrace.run.pack.toolbox import FILES, packed_types
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


def test_vectors_have_as_many_numbers_as_their_types() -> None:
    assert argument("double4", (1, 2, 3)).tolist() == (1, 2, 3, 0)
    assert argument("float2", np.array([0.1, 2])).tolist() == (np.float32(0.1), 2)
