"""Arguments of kernels, by the names and with the types that the kernels' own text declares."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pyopencl as cl

from cltrace.run.program import Program

ENTRY_POINT = re.compile(r"^__kernel\s+void\s+(\w+)\(([^()]*)\)", re.MULTILINE)
# In place of the type of a parameter that is a buffer.
BUFFER = "*"
SCALARS = {"int": "i4", "uint": "u4", "long": "i8", "ulong": "u8", "float": "f4", "double": "f8"}


def parameters_of(text: str, macros: Mapping[str, str] | None = None) -> dict[str, dict[str, str]]:
    """Of each kernel of a text its parameters, in their order: the type of a value, BUFFER for a pointer.

    macros: what names of types stand for.
    """
    found: dict[str, dict[str, str]] = {}
    for kernel, declarations in ENTRY_POINT.findall(text):
        found[kernel] = {}
        for declaration in declarations.split(","):
            *words, name = declaration.replace("*", " * ").split()
            found[kernel][name] = BUFFER if BUFFER in words else (macros or {}).get(words[-1], words[-1])
    return found


def argument(type_: str, value: Any) -> Any:
    """A value as pyopencl passes it where a kernel has this type: a buffer, a number, a vector or a struct.

    Of four numbers the last may be missing, which is then 0. Raises TypeError or OverflowError for another value.
    """
    scalar, width = re.fullmatch(r"(\*|\w*?[a-z_])(\d*)", type_).groups()  # type: ignore[union-attr]
    if scalar == BUFFER:
        if not isinstance(value, cl.Buffer):
            raise TypeError(f"must be a buffer, got {value!r}")
        return value
    if scalar not in SCALARS:
        if not isinstance(value, np.void):
            raise TypeError(f"must be a {type_}, got {value!r}")
        return value
    if isinstance(value, cl.Buffer):
        raise TypeError(f"must be {type_}, got a buffer")
    exact: Callable[[Any], float] = float if scalar in ("float", "double") else operator.index
    if not width:
        return np.dtype(SCALARS[scalar]).type(exact(value))
    numbers = [exact(number) for number in np.asarray(value).tolist()]
    if len(numbers) not in (int(width), *((3,) if width == "4" else ())):
        raise TypeError(f"must be {width} numbers, got {value!r}")
    return np.array((*numbers, 0)[: int(width)], getattr(cl.cltypes, type_))[()]


def dtypes_of(types: Iterable[str]) -> list[Any]:
    """Those of parameters that have these types, None of buffers. Of structs only that they are some."""
    known = {BUFFER: None} | {name: np.dtype(number) for name, number in SCALARS.items()}
    return [known[type_] if type_ in known else getattr(cl.cltypes, type_, np.dtype("V")) for type_ in types]


class NamedKernel:
    """A kernel of a program whose arguments have names. Several threads may start it.

    parameters: of parameters_of().
    """

    def __init__(self, program: Program, name: str, parameters: dict[str, str]) -> None:
        self._kernel = program.kernel(dtypes_of(parameters.values()), name)
        self.parameters, self._name = parameters, name

    def start(self, queue: Any, items: int, group: int, arguments: Mapping[str, Any]) -> None:
        """Starts so many work-items, in groups.

        Raises TypeError for an argument that is missing, that the kernel has not, or that is of another type.
        """
        if arguments.keys() != self.parameters.keys():
            wrong = ", ".join(sorted(arguments.keys() ^ self.parameters.keys()))
            raise TypeError(f"{self._name}: missing or unknown: {wrong}")
        values = []
        for name, type_ in self.parameters.items():
            try:
                values.append(argument(type_, arguments[name]))
            except (TypeError, OverflowError) as error:
                raise TypeError(f"{self._name}: {name}: {error}") from None

        def launch() -> Any:
            return self._kernel.start(queue, (items,), (group,), values)

        if not self._kernel.launch_first(group, launch):
            launch()
