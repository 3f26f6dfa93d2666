"""On which triangles no shadow falls: found on a device, for views that are drawn again and again."""

from __future__ import annotations

import logging
import threading
from typing import Any

import numpy as np
import pyopencl as cl

from cltrace.errors import BuildError
from cltrace.plan import abi
from cltrace.plan.plan import Plan
from cltrace.run.devices import Device
from cltrace.run.program import UNSTOPPABLE, Announcement, program
from cltrace.run.toolbox import vector

# It takes as long as it saves in six pixels for each entry of the lists: 15 to 30 ms of a processor's time for 100,000
# triangles, of which each frame then takes 10 to 14 less (PoCL 3.1, 1920x1080). Nobody knows how many frames there
# will be, so it is done after half of that.
PAYS = 3
# Work-items. Each one goes through neighbouring cells.
ITEMS = 256

log = logging.getLogger("cltrace")


class Unstoppable:
    """What is known of the triangles that a plan shows, of its lights at points, on one device.

    lights: how many of the plan's lights it is known of: none, or all. Several threads may use it.
    """

    def __init__(self, plan: Plan, device: Device) -> None:
        self._plan, self._device, self._lock = plan, device, threading.Lock()
        self._pixels = self.lights = 0
        self._entries: int | None = None
        parallel, *_, lights = plan.values["lights"]
        listed = lights > parallel and len(plan.arrays["grid"]) > 1
        self._may_pay = listed and device.kind == "cpu"

    def drawn(self, pixels: int) -> None:
        """Counts pixels that have been drawn."""
        with self._lock:
            self._pixels += pixels

    def find(self, context: Any, queue: Any, buffers: dict[str, Any]) -> None:
        """Adds the buffer `unstoppable` to those of the plan once that pays: never on a GPU.

        Where a driver fails, there is none: pictures are the same without it.
        """
        with self._lock:
            if not self._may_pay:
                return
            if self._entries is None:
                self._entries = self._counted(queue, buffers["start"])
            if self._pixels < PAYS * self._entries:
                return
            self._may_pay = False
            try:
                with Announcement("compiling the kernel ..."):
                    buffers["unstoppable"] = self._found(context, queue, buffers)
                self.lights = self._plan.values["lights"][3]
            except (BuildError, cl.Error) as error:
                log.info("triangles without shadows are not looked for: %s", error)

    def _counted(self, queue: Any, start: Any) -> int:
        """How many entries the lists have: where that of the last cell ends."""
        columns, rows, first, mask = self._plan.arrays["grid"][-1]["cells"].tolist()
        levels = [k for k in range(mask.bit_length()) if mask >> k & 1]
        cells = first + sum((((columns - 1) >> k) + 1) * (((rows - 1) >> k) + 1) for k in levels)
        end = np.empty(1, np.int32)
        cl.enqueue_copy(queue, end, start, src_offset=end.itemsize * cells)
        return int(end[0])

    def _found(self, context: Any, queue: Any, buffers: dict[str, Any]) -> Any:
        """The buffer."""
        values, grids, flags = self._plan.values, self._plan.arrays["grid"], self._plan.features
        find, look, note = self._kernels()
        m, first, (parallel, _, _, lights) = values["triangles"], np.int32(values["first"]), values["lights"]
        words, everywhere = -(-m // 32), "WITH_BOUNCES" in flags
        out, wanted, there, open_ = (
            cl.Buffer(context, cl.mem_flags.READ_WRITE, size) for size in (4 * words * lights, m, m, m)
        )
        zero, one = np.zeros(1, np.uint8), np.ones(1, np.uint8)
        cl.enqueue_fill_buffer(queue, out, zero, 0, 4 * words * lights)
        cl.enqueue_fill_buffer(queue, wanted, one if everywhere else zero, 0, m)
        if not everywhere:  # what is in the tiles' lists
            of_tiles = np.int32(grids[1]["cells"][2]), first, buffers["start"], buffers["entry"]
            look(queue, (ITEMS,), (1,), *of_tiles, wanted)
        eye = (*values["eye"][:3], float(not everywhere and "WITH_PARALLEL_RAYS" not in flags))
        axes = (vector(values["frame"][name][:3]) for name in ("right", "up", "back"))
        common = *axes, np.float64(values["unit"]), vector(eye), first
        read = [buffers[name] for name in ("start", "entry", "light_facet", "vertex", "face")]
        for light in range(parallel, lights):
            begin, count = self._plan.arrays["light_buffer"][light, :2].tolist()
            place, row = vector(self._plan.arrays["lamp"][light, :3]), np.int64(3 * m * light)
            for buffer in (there, open_):
                cl.enqueue_fill_buffer(queue, buffer, zero, 0, m)
            for grid in grids[begin : begin + count]:
                find(queue, (ITEMS,), (1,), grid, place, *common, row, *read, wanted, there, open_)
            note(queue, (ITEMS,), (1,), np.int32(m), np.int32(words * light), there, open_, out)
            queue.finish()  # so that Ctrl-C is heard
        return out

    def _kernels(self) -> list[Any]:
        names = ("find_stoppable", "find_listed", "note_unstoppable")
        flags = (f"W={self._device.width}", *self._device.flags)
        options = [*(f"-D{flag}" for flag in flags), *abi.options("accurate", frozenset({"WITH_TRIANGLES"}))]
        made = program(self._device, options, UNSTOPPABLE)
        return [cl.Kernel(made, name) for name in names]
