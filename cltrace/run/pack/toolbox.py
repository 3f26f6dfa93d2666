"""The programs that pack on a device: their kernels, and buffers for them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any
from weakref import finalize

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from cltrace.base.limits import MAX_ROWS
from cltrace.plan import abi, opencl
from cltrace.run.devices import Device, check_sizes
from cltrace.run.program import Kernel, context_of, parameters_of, program, source

# Of a kernel, by the names of its parameters.
Arguments = dict[str, Any]
FILES = (
    *("packet.cl", "abi", "numbers.cl"),
    *(f"pack/{name}.cl" for name in ("rows", "spheres", "eye", "cells", "polygons")),
)
# Vectors in memory begin at multiples of their size.
PAGE = 4096
# One camera's Views have at most so many buffers of one size.
SPARE = 2
ZERO = np.int32(0)
# Buffers end with a whole packet, however wide.
PACKET = 16
# Eight doubles are as wide as the widest registers.
WIDEST = 8
# Work-items of a kernel that goes through all spheres, and in a group. On a CPU each one takes spheres that are
# neighbours in memory; a GPU wants very many.
ITEMS, GROUP = {"cpu": 2**10, "gpu": 2**15}, {"cpu": 4, "gpu": 64}
# What float and double must be able to do for the host's bits.
EXACT = cl.device_fp_config.ROUND_TO_NEAREST | cl.device_fp_config.INF_NAN | cl.device_fp_config.DENORM


@dataclass(frozen=True)
class Entered:
    """Surfaces to be entered in the lists of a grid.

    kind: "entries" or "outlines"; counted: arguments of the kernels `count_` and `scatter_` of it; written: those
    that the latter has besides.
    """

    kind: str
    counted: Arguments
    written: Arguments


def numbered(member: Any, first: int | None = None) -> Arguments:
    """Which surfaces are entered: those of a buffer of indices, or, with any buffer, those from the first one on."""
    return {"first": first or 0, "named": first is None, "member": member}


def is_exact(device: Device) -> bool:
    """Whether the device rounds all that packing needs as numpy does."""
    single, double = device.cl.single_fp_config, device.cl.double_fp_config
    return bool(single & EXACT == EXACT and device.rounds_correctly and double & EXACT == EXACT)


class Toolbox:
    """Kernels and buffers of one device, for arrays of n spheres with room for whole packets.

    precision: of the buffers that are packed; before: one whose spare memory this one uses, too; one for each thread.
    """

    def __init__(self, device: Device, precision: abi.Precision, before: Toolbox | None = None) -> None:
        self.kind = "cpu" if device.kind == "cpu" else "gpu"
        self.context: Any = context_of(device.cl)
        self.queue: Any = cl.CommandQueue(self.context)
        self._device, self._single = device, precision == "single"
        # What commands in the queue still use, even if nobody else does: drivers do not keep the memory of arrays.
        self._in_use: list[Any] = []
        # Memory of buffers that are gone, by their sizes in bytes.
        self._spare: dict[int, list[NDArray[np.uint8]]] = before._spare if before else {}

    def run(self, name: str, /, *, items: int = 0, **arguments: Any) -> None:
        """Starts a kernel. items: how many work-items.

        The arguments have the names of the kernel's parameters; there may be others. A driver may compile a kernel anew
        for each size, so there are few of them.
        """
        kernel = kernel_of(self._device, self._single, name)
        self._in_use += arguments.values()
        kernel.start(self.queue, (items or ITEMS[self.kind],), (GROUP[self.kind],), arguments)

    def room(self, count: int, dtype: Any, again: bool = False) -> Any:
        """A buffer of so many numbers, at least one. They are undefined.

        again: whether a CPU keeps the memory for later buffers of about this size.
        """
        size = max(1, count) * np.dtype(dtype).itemsize
        check_sizes(self._device, {"spheres": (count, size)})
        if self.kind == "cpu":
            memory = self._memory_again(size) if again else _memory(size)
            return cl.Buffer(self.context, cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR, hostbuf=memory)
        return cl.Buffer(self.context, cl.mem_flags.READ_WRITE, size)

    def most(self, dtype: Any) -> int:
        """How many numbers a buffer may have."""
        return int(min(MAX_ROWS, self._device.largest_buffer // np.dtype(dtype).itemsize))

    def _memory_again(self, size: int) -> NDArray[np.uint8]:
        """So many bytes, which are spare again when nobody uses them any longer.

        To get memory from the system can take longer than to fill it: of another camera for six million spheres, it was
        2.5 of 3.9 seconds of a busy machine's processors.
        """
        # Few sizes leave little spare, and serve lists of other lengths. What is not used of memory costs nothing.
        rounded = max(PAGE, 1 << (size - 1).bit_length())
        spare = self._spare.setdefault(rounded, [])
        try:
            memory = spare.pop()
        except IndexError:
            memory = _memory(rounded)
        lent = memory[:size]
        finalize(lent, _take_back, spare, memory).atexit = False
        return lent

    def forget(self) -> None:
        """Gives spare memory back to the system."""
        for spare in self._spare.values():
            spare.clear()

    def noted(self, name: str, columns: int, dtype: Any, /, *, items: int = 0, **arguments: Any) -> NDArray[Any]:
        """(work-items, columns): what each work-item notes in `part`, which is not given. The rest as run()."""
        count = columns * (items or ITEMS[self.kind])
        part = self.room(count, dtype)
        self.run(name, items=items, part=part, **arguments)
        return self.read(part, count, dtype).reshape(-1, columns)

    def upload(self, array: NDArray[Any]) -> Any:
        """A buffer with a copy of this array, which may be empty."""
        array = np.ascontiguousarray(array) if array.size else np.zeros(1, array.dtype)
        return cl.Buffer(self.context, cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR, hostbuf=array)

    def share(self, array: NDArray[Any]) -> Any:
        """A buffer with an array that does not change: on a CPU, the array itself."""
        if self.kind != "cpu" or not array.size:
            return self.upload(array)
        return cl.Buffer(self.context, cl.mem_flags.READ_ONLY | cl.mem_flags.USE_HOST_PTR, hostbuf=array)

    def finish(self) -> None:
        """Waits until all is done."""
        self.queue.finish()
        self._in_use.clear()

    def clear(self, buffer: Any, count: int, value: Any = ZERO) -> None:
        """Sets so many numbers of 32 bits to 0, or to a value."""
        self._in_use.append(buffer)
        cl.enqueue_fill_buffer(self.queue, buffer, np.array([value]), 0, 4 * count)

    def copy(self, source: Any, target: Any, offset: int, size: int) -> None:
        """Copies so many bytes, from the first one on, to an offset of another buffer."""
        if size:
            self._in_use += (source, target)
            cl.enqueue_copy(self.queue, target, source, dst_offset=offset, byte_count=size)

    def read(self, buffer: Any, count: int, dtype: Any, first: int = 0) -> NDArray[Any]:
        """So many numbers of a buffer, from the first one on."""
        out = np.empty(count, dtype)
        if count:
            cl.enqueue_copy(self.queue, out, buffer, src_offset=first * out.itemsize)
            self._in_use.clear()
        return out


def _memory(size: int) -> NDArray[np.uint8]:
    """So many bytes, which begin on a page."""
    # numpy asks the system for large pages. To fill an array for the first time then takes half as long.
    memory = np.empty(size + PAGE, np.uint8)
    return memory[-memory.ctypes.data % PAGE :][:size]


def _take_back(spare: list[NDArray[np.uint8]], memory: NDArray[np.uint8]) -> None:
    if len(spare) < SPARE:
        spare.append(memory)


@cache
def kernel_of(device: Device, single: bool, name: str) -> Kernel:
    """A kernel, which all toolboxes of a device share.

    To make one anew takes 2 ms, and a movie of moving spheres needs sixteen in each frame.
    """
    out = "float" if single else "double"
    types = {"out2": f"{out}2", "out4": f"{out}4"}
    values: dict[str, object] = {**types, "W": min(device.width, WIDEST), "RUN": 1}
    # The kernels compute in double, whatever precision they pack for.
    options = [*(f"-D{name}={value}" for name, value in values.items()), *opencl.options("double", frozenset())]
    return program(device, options, FILES).kernel(name, parameters_of(source(FILES), types)[name])
