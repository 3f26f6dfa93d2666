"""On which triangles no shadow falls: found on a device, for scenes that are drawn again and again."""

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


class _Findings:
    """What is known of a scene's triangles on one device, by all that draw them from wherever.

    pixels: how many have been drawn since more was found; asked, bits: buffers, None before: of which triangles it is
    known, and what, as unstoppable.cl has it. Whether a shadow falls on a triangle does not depend on the camera.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.pixels = 0
        self.asked: Any = None
        self.bits: Any = None


class Unstoppable:
    """What is known of the triangles that a plan shows, of its lights at points, on one device.

    before: that of a plan of the same scene, which another camera sees; what either finds out, both know.
    lights: how many of the plan's lights it is known of: none, or all. Several threads may use it.
    """

    def __init__(self, plan: Plan, device: Device, before: Unstoppable | None = None) -> None:
        self._plan, self._device = plan, device
        self._findings: _Findings = before._findings if before else _Findings()
        self.lights = 0
        self._entries: int | None = None
        parallel, *_, lights = plan.values["lights"]
        listed = lights > parallel and len(plan.arrays["grid"]) > 1
        self._may_pay = listed and device.kind == "cpu"

    def drawn(self, pixels: int) -> None:
        """Counts pixels that have been drawn."""
        with self._findings.lock:
            self._findings.pixels += pixels

    def find(self, context: Any, queue: Any, buffers: dict[str, Any]) -> None:
        """Puts the buffer `unstoppable` among those of the plan, and more into it once that pays: never on a GPU.

        Where a driver fails, there is none: pictures are the same without it.
        """
        findings = self._findings
        with findings.lock:
            if self._may_pay and self._pays(queue, buffers["start"]):
                self._may_pay, findings.pixels = False, 0
                try:
                    with Announcement("compiling the kernel ..."):
                        self._find(context, queue, buffers)
                except (BuildError, cl.Error) as error:
                    log.info("triangles without shadows are not looked for: %s", error)
            if findings.bits is not None:
                buffers["unstoppable"], self.lights = findings.bits, self._plan.values["lights"][3]

    def _pays(self, queue: Any, start: Any) -> bool:
        if self._entries is None:
            self._entries = self._counted(queue, start)
        return self._findings.pixels >= PAYS * self._entries

    def _counted(self, queue: Any, start: Any) -> int:
        """How many entries the lists have: where that of the last cell ends."""
        columns, rows, first, mask = self._plan.arrays["grid"][-1]["cells"].tolist()
        levels = [k for k in range(mask.bit_length()) if mask >> k & 1]
        cells = first + sum((((columns - 1) >> k) + 1) * (((rows - 1) >> k) + 1) for k in levels)
        end = np.empty(1, np.int32)
        cl.enqueue_copy(queue, end, start, src_offset=end.itemsize * cells)
        return int(end[0])

    def _find(self, context: Any, queue: Any, buffers: dict[str, Any]) -> None:
        """Asks about the triangles that this plan shows, but for those that are known already."""
        findings, values, grids, flags = (
            self._findings,
            self._plan.values,
            self._plan.arrays["grid"],
            self._plan.features,
        )
        everywhere = "WITH_BOUNCES" in flags
        if everywhere and findings.bits is not None:
            return
        find, look, note = self._kernels()
        m, first, (parallel, _, _, lights) = values["triangles"], np.int32(values["first"]), values["lights"]
        words = -(-m // 32)

        def filled(size: int, value: int = 0) -> Any:
            buffer = cl.Buffer(context, cl.mem_flags.READ_WRITE, size)
            cl.enqueue_fill_buffer(queue, buffer, np.full(1, value, np.uint8), 0, size)
            return buffer

        asked = filled(m) if findings.asked is None else findings.asked
        bits = filled(4 * words * lights) if findings.bits is None else findings.bits
        wanted = filled(m, int(everywhere))
        if not everywhere:  # what is in the tiles' lists
            of_tiles = np.int32(grids[1]["cells"][2]), first, buffers["start"], buffers["entry"]
            look(queue, (ITEMS,), (1,), *of_tiles, asked, wanted)
        eye = (*values["eye"][:3], float(not everywhere and "WITH_PARALLEL_RAYS" not in flags))
        axes = (vector(values["frame"][name][:3]) for name in ("right", "up", "back"))
        common = *axes, np.float64(values["unit"]), vector(eye), first
        read = [buffers[name] for name in ("start", "entry", "light_facet", "vertex", "face")]
        for light in range(parallel, lights):
            begin, count = self._plan.arrays["light_buffer"][light, :2].tolist()
            place, row = vector(self._plan.arrays["lamp"][light, :3]), np.int64(3 * m * light)
            there, open_ = filled(m), filled(m)
            for grid in grids[begin : begin + count]:
                find(queue, (ITEMS,), (1,), grid, place, *common, row, *read, wanted, there, open_)
            note(queue, (ITEMS,), (1,), np.int32(m), np.int32(words * light), there, open_, bits)
            queue.finish()  # so that Ctrl-C is heard
        findings.asked, findings.bits = asked, bits

    def _kernels(self) -> list[Any]:
        names = ("find_stoppable", "find_listed", "note_unstoppable")
        flags = (f"W={self._device.width}", *self._device.flags)
        options = [*(f"-D{flag}" for flag in flags), *abi.options("accurate", frozenset({"WITH_TRIANGLES"}))]
        made = program(self._device, options, UNSTOPPABLE)
        return [cl.Kernel(made, name) for name in names]
