"""The baseline that everybody knows: kernels/textbook.cl, as a Renderer of the same scenes."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from cltrace.base.errors import DeviceError
from cltrace.picture.image import Image
from cltrace.run.devices import Device
from cltrace.run.program import context_of, program
from cltrace.scene import PARALLEL, SPOT, Scene

# `Setup` and `Lamp` of textbook.cl.
SETUP = np.dtype([(name, "f4", 4) for name in ("eye", "right", "up", "back", "background")] + [("size", "i4", 4)])
LAMP = np.dtype([(name, "f4", 4) for name in ("position", "axis", "color", "cone")])
OUTPUTS = {"rgb8": ("u1", 3), "color": ("f4", 3), "normal": ("f4", 3), "depth": ("f4", 1), "id": ("i4", 1)}
GROUP = (16, 4)


class Textbook:
    """A scene on a device, drawn by the textbook's tracer. `render()` is one frame with all of OUTPUTS.

    Raises DeviceError, BuildError.
    """

    def __init__(self, scene: Scene, device: Device) -> None:
        self.device = device
        self.size = scene.camera.resolution
        self._setup = _setup(scene)
        s, m = scene.spheres, scene.materials
        materials = np.column_stack([m["color"], m["ka"], m["kd"], m["ks"], m["exponent"], np.zeros(len(m))])
        parts = (
            np.column_stack([s["center"], s["radius"]]).astype("f4"),
            s["material"].astype("i4"),
            materials.astype("f4"),
            _lamps(scene),
        )
        self._kernel = cl.Kernel(program(device, [], ("textbook.cl",)).made, "render")
        context = context_of(device.cl)
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        try:
            self._queue: Any = cl.CommandQueue(context)
            # A buffer must not be empty.
            self._buffers = [
                cl.Buffer(context, flags, hostbuf=np.ascontiguousarray(part if len(part) else np.zeros(8, "f4")))
                for part in parts
            ]
            width, height = self.size
            self._arrays = {n: np.empty((height, width, k), t) for n, (t, k) in OUTPUTS.items()}
            self._out = {n: cl.Buffer(context, cl.mem_flags.WRITE_ONLY, a.nbytes) for n, a in self._arrays.items()}
        except cl.Error as error:
            raise DeviceError(f"{device.name} failed: {error}") from None

    def render(self, *outputs: str) -> Image:
        """One frame; only these outputs are read back. depth is float32, else all is as in a Renderer's Image."""
        grid = tuple(-(-n // g) * g for n, g in zip(self.size, GROUP, strict=True))
        try:
            start = time.perf_counter()
            self._kernel(self._queue, grid, GROUP, self._setup, *self._buffers, *self._out.values()).wait()
            done = time.perf_counter()
            for name in outputs:
                cl.enqueue_copy(self._queue, self._arrays[name], self._out[name])
            end = time.perf_counter()
        except cl.Error as error:
            raise DeviceError(f"{self.device.name} failed: {error}") from None
        got: dict[str, Any] = {n: self._arrays[n].copy() for n in outputs}
        for name in ("depth", "id"):
            if name in got:
                got[name] = got[name][..., 0]
        return Image(**got, seconds={"kernel": done - start, "readback": end - done})


def _setup(scene: Scene) -> Any:
    camera = scene.camera
    (width, height), (x, y) = camera.resolution, camera.image_plane()
    right, up, back = (np.array(axis) for axis in camera.basis())
    setup = np.zeros((), SETUP)
    vectors = {"eye": camera.position, "right": right * (x / width), "up": up * (y / height), "back": back}
    for name, value in {**vectors, "background": scene.background}.items():
        setup[name][:3] = value
    setup["size"] = width, height, len(scene.spheres), len(scene.lamps)
    return setup[()]


def _lamps(scene: Scene) -> NDArray[np.void]:
    lamps = np.zeros(len(scene.lamps), LAMP)
    for lamp, light in zip(lamps, scene.lamps, strict=True):
        direction = light["direction"] / (np.linalg.norm(light["direction"]) or 1.0)
        lamp["position"] = *(-direction if light["kind"] == PARALLEL else light["position"]), light["kind"]
        lamp["color"][:3] = light["color"]
        if light["kind"] == SPOT:
            alpha1, alpha2 = math.radians(light["alpha1"]), math.radians(light["alpha2"])
            lamp["axis"] = *direction, math.cos(alpha2)
            lamp["color"][3], lamp["cone"][0] = alpha1, alpha2 - alpha1
    return lamps
