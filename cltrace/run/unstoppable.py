"""On which triangles no shadow falls: found on a device, for scenes that are drawn again and again."""

from __future__ import annotations

import logging
import threading
from typing import Any

import numpy as np
import pyopencl as cl

from cltrace.base.errors import BuildError
from cltrace.base.waiting import Announcement
from cltrace.plan import opencl
from cltrace.plan.lights import are_at_points
from cltrace.plan.plan import Plan
from cltrace.run.devices import Device
from cltrace.run.program import UNSTOPPABLE, Kernel, parameters_of, program, source

# It takes as long as it saves in about eight pixels for each triangle and each list that it is in, of the tiles and of
# the lights: 15 to 30 ms of a processor's time for 100,000 triangles, of which each frame then takes 10 to 14 less
# (PoCL 3.1, 1920x1080). Nobody knows how many frames there will be, so it is done after half of that.
PAYS = 4
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
    lights: how many of the plan's lights it is known of: none, or all; lists: about how many entries the lists of
    triangles have. Several threads may use it.
    """

    def __init__(self, plan: Plan, device: Device, before: Unstoppable | None = None) -> None:
        self._plan, self._device = plan, device
        self._findings: _Findings = before._findings if before else _Findings()
        self.lights, at_points = 0, len(self._lights_at_points())
        self._may_pay = at_points > 0 and len(plan.arrays["grid"]) > 1 and device.kind == "cpu"
        self.lists = plan.values["triangles"] * (1 + at_points)

    def drawn(self, pixels: int) -> None:
        """Counts pixels that have been drawn."""
        with self._findings.lock:
            self._findings.pixels += pixels

    def find(self, queue: Any, buffers: dict[str, Any]) -> None:
        """Puts the buffer `unstoppable` among those of the plan, and more into it once that pays: never on a GPU.

        Where a driver fails, there is none: pictures are the same without it.
        """
        findings = self._findings
        with findings.lock:
            if self._may_pay and findings.pixels >= PAYS * self.lists:
                self._may_pay, findings.pixels = False, 0
                try:
                    with Announcement("compiling the kernel ..."):
                        self._find(queue, buffers)
                except (BuildError, cl.Error) as error:
                    log.info("triangles without shadows are not looked for: %s", error)
            if findings.bits is not None:
                buffers["unstoppable"], self.lights = findings.bits, self._plan.values["lights"]

    def _lights_at_points(self) -> list[int]:
        """The indices of these lights of the plan."""
        lights = self._plan.arrays["light"][: self._plan.values["lights"]]
        return np.flatnonzero(are_at_points(lights["color"][:, 3])).tolist()

    def _find(self, queue: Any, buffers: dict[str, Any]) -> None:
        """Asks about the triangles that this plan shows, but for those that are known already."""
        findings, values, flags = self._findings, self._plan.values, self._plan.features
        grids = self._plan.arrays["grid"]
        everywhere = "WITH_BOUNCES" in flags
        if everywhere and findings.bits is not None:
            return
        kernels = self._kernels()
        m, first, lights = values["triangles"], values["first_triangle"], values["lights"]
        words = -(-m // 32)

        def filled(size: int, value: int = 0) -> Any:
            buffer = cl.Buffer(queue.context, cl.mem_flags.READ_WRITE, size)
            cl.enqueue_fill_buffer(queue, buffer, np.full(1, value, np.uint8), 0, size)
            return buffer

        asked = filled(m) if findings.asked is None else findings.asked
        bits = filled(4 * words * lights) if findings.bits is None else findings.bits
        wanted = filled(m, int(everywhere))
        if not everywhere:  # what is in the tiles' lists
            of_tiles = {"cells": grids[1]["cells"][2], "spheres": first, "asked": asked, "wanted": wanted}
            lists = {name: buffers[name] for name in ("start", "entry")}
            kernels["find_listed"].start(queue, (ITEMS,), (1,), of_tiles | lists)
        common = {name: values[name] for name in ("right", "up", "back")}
        common |= {"eye": (*values["eye"][:3], not everywhere and "WITH_PARALLEL_RAYS" not in flags)}
        common |= {"unit": values["unit"], "spheres": first, "wanted": wanted, "facet": buffers["light_facet"]}
        common |= {name: buffers[name] for name in ("start", "entry", "vertex", "face")}
        for light in self._lights_at_points():
            begin, count = self._plan.arrays["light_buffer"][light, :2].tolist()
            of_light = {"place": self._plan.arrays["lamp"][light, :3], "facets": 3 * m * light}
            found = {"listed": filled(m), "open": filled(m)}
            for grid in grids[begin : begin + count]:
                kernels["find_stoppable"].start(queue, (ITEMS,), (1,), common | of_light | found | {"grid": grid})
            known = {"triangles": m, "first": words * light, "unstoppable": bits}
            kernels["note_unstoppable"].start(queue, (ITEMS,), (1,), known | found)
            queue.finish()  # so that Ctrl-C is heard
        findings.asked, findings.bits = asked, bits

    def _kernels(self) -> dict[str, Kernel]:
        flags = (f"W={self._device.width}", *self._device.flags)
        options = [*(f"-D{flag}" for flag in flags), *opencl.options("accurate", frozenset({"WITH_TRIANGLES"}))]
        made = program(self._device, options, UNSTOPPABLE)
        return {name: made.kernel(name, types) for name, types in parameters_of(source(UNSTOPPABLE)).items()}
