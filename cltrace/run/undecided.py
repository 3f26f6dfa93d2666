"""Pixels that double cannot decide, on devices that render one pixel in each work-item.

What decides them takes registers and memory of all work-items of a program, also where none of them needs it. So two
programs are made of the kernel's text. The first one has nothing of that, and marks the pixels that it leaves; the
second one has everything, and draws those. It is compiled once there is such a pixel.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pyopencl as cl

from cltrace.plan.abi import Precision
from cltrace.run.devices import Device
from cltrace.run.program import Kernel, program

# Flags of both programs, and of the first one alone.
BOTH, FIRST = "IN_STAGES", "WITHOUT_RARE"


def is_in_stages(width: int, precision: Precision) -> bool:
    """Whether packets of this width are drawn so. In vectors, other lanes wait for what one needs anyway."""
    return width == 1 and precision != "single"


class Undecided:
    """Such pixels, of one launch after the other.

    options: of the program that draws them; device: where; dtypes: of its parameters. marks: the kernels' argument
    `undecided`; compiles: whether that program is being compiled.
    """

    def __init__(self, queue: Any, device: Device, options: list[str], dtypes: Sequence[Any]) -> None:
        self._queue, self._device, self._options, self._dtypes = queue, device, options, dtypes
        self._first = np.empty(1, np.uint8)
        self._drawer: Kernel | None = None
        self.marks: Any = None
        self.compiles = False

    def begin(self, items: int) -> None:
        """Before the first program is started with so many work-items: none is marked."""
        size = 1 + items
        if self.marks is None or self.marks.size < size:
            self.marks = cl.Buffer(self._queue.context, cl.mem_flags.READ_WRITE, size)
        cl.enqueue_fill_buffer(self._queue, self.marks, np.zeros(1, np.uint8), 0, size)

    def any(self) -> bool:
        """Whether it has left a pixel, once it is done."""
        cl.enqueue_copy(self._queue, self._first, self.marks)
        return bool(self._first[0])

    def drawer(self) -> Kernel:
        """What draws them."""
        if self._drawer is None:
            self._drawer = program(self._device, self._options).kernel(self._dtypes)
        return self._drawer

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """While it lasts, that program may be being compiled."""
        self.compiles = True
        try:
            yield
        finally:
            self.compiles = False
