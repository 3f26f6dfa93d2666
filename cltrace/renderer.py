"""Upload, launch, read back: a packed scene and its program -> Image."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from cltrace.errors import DeviceError
from cltrace.picture.image import Image
from cltrace.plan.layout import (
    KEEPS,
    OUTPUTS,
    PICTURES,
    PRECISIONS,
    WORK,
    Packed,
    Prepared,
    counting,
    pack,
    prepare,
    real_dtype,
)
from cltrace.run.devices import Device, check_process, choose
from cltrace.run.program import Announcement, build, context_of
from cltrace.scene import Camera, Scene

# One local size for all pictures: PoCL compiles the kernel anew for each.
GROUP = {1: (16, 4), 4: (1, 1), 8: (1, 1), 16: (1, 1)}
# Packets that a work-item renders one after the other.
RUN = {1: 1, 4: 8, 8: 8, 16: 8}
CHANNELS = {
    "rgb8": 3,
    "color": 3,
    "normal": 3,
    "direction": 3,
    "depth": 1,
    "id": 1,
    "shadow_rays": 1,
    "work": len(WORK),
}
# Pixels of one launch at most.
STRIP = 2**22
# Seconds of one launch, about, at most, so that Ctrl-C is heard; rows of a first one, which may turn out to be slow.
PATIENCE, FIRST_ROWS = 0.25, 64
Crop = tuple[int, int, int, int]


def default_precision(device: Device) -> str:
    """accurate where the device has doubles, else single."""
    return "accurate" if device.has_double else "single"


class Renderer:
    """A scene on a device: program and buffers are kept, so that each render() costs only the kernel and the readback.

    device: None, a SPEC as on the command line, or a Device; precision: accurate, single, double or None for the
    device's default; outputs: any of rgb8, color, normal, direction, depth, id, shadow_rays, work; crop: (x0, y0, x1,
    y1), exactly those pixels of the full picture, x1 and y1 excluded; truncate: bytes are trunc(255 c) instead of
    rounded; width: pixels in a packet, 1, 4, 8 or 16, None for what is best on the device; keep: what not to skip, for
    measuring. One thread at a time: a second one waits. Raises DeviceError, BuildError, ValueError.
    """

    def __init__(
        self,
        scene: Scene,
        device: str | Device | None = None,
        precision: str | None = None,
        outputs: tuple[str, ...] = ("rgb8",),
        crop: Crop | None = None,
        truncate: bool = False,
        width: int | None = None,
        keep: tuple[str, ...] = (),
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: must be a cltrace.Scene, such as cltrace.load() gives, got {scene!r}")
        self.scene = scene
        self.device = device if isinstance(device, Device) else choose(device)
        self.precision = precision or default_precision(self.device)
        self.width = width or self.device.width
        self.seconds: dict[str, float] = {}
        self._lock = threading.Lock()
        if self.precision not in PRECISIONS:
            raise ValueError(f"precision: must be one of {', '.join(PRECISIONS)}, got {precision!r}")
        if self.precision != "single" and not self.device.has_double:
            raise DeviceError(
                f"{self.device.name} has no double precision, which --precision {self.precision} needs; "
                "use --precision single or another device"
            )
        if self.width not in GROUP:
            raise ValueError(f"width: must be 1, 4, 8 or 16, got {self.width}")
        also = PICTURES if "outputs" in keep else ()
        self.outputs = tuple(name for name in OUTPUTS if name in outputs or name in also)
        if not outputs or set(outputs) - set(OUTPUTS):
            raise ValueError(f"outputs: must be some of {', '.join(OUTPUTS)}, got {outputs!r}")
        if set(keep) - set(KEEPS):
            raise ValueError(f"keep: must be some of {', '.join(KEEPS)}, got {keep!r}")
        self._crop, self._truncate, self._keep, self._rows = crop, truncate, keep, FIRST_ROWS
        self._set_up(None)

    def look(self, camera: Camera) -> Renderer:
        """The same scene, seen by another camera, as another Renderer with the same outputs, precision and crop.

        It keeps what no camera changes: the program, the order of the spheres and their materials, also on the device.
        What float32 and double can hold of a place depends on the eye, and so do the lists: those are made again.
        Raises DeviceError, BuildError, ValueError if the crop is not within its picture.
        """
        other = copy(self)
        other.scene, other.seconds, other._lock = replace(self.scene, camera=camera), {}, threading.Lock()
        other._set_up(self)
        return other

    def _set_up(self, before: Renderer | None) -> None:
        """before: one of the same scene but for its camera."""
        self.size = self.scene.camera.resolution
        self._move_to(_region(self.size, self._crop))
        with self._timed("pack"):
            self._prepared: Prepared = before._prepared if before else prepare(self.scene, self.precision, self._keep)
            self.packed: Packed = pack(
                self.scene, self.precision, self.outputs, self._truncate, self._keep, self._prepared
            )
        self.seconds["lists"] = self.packed.list_seconds
        self.seconds["pack"] -= self.packed.list_seconds
        with self._timed("build"), self._driver_errors(), Announcement("compiling the kernel ..."):
            self.context: Any = context_of(self.device.cl)
            self.queue: Any = cl.CommandQueue(self.context)
            self._kernel = self._built()
        with self._timed("upload"), self._driver_errors():
            kept = before.packed.arrays if before else {}
            self._buffers: dict[str, Any] = {
                name: before._buffers[name] if before and array is kept[name] else self._buffer(array)
                for name, array in self.packed.arrays.items()
            }
            self.queue.finish()
        with self._timed("build"), self._driver_errors(), Announcement("compiling the kernel ..."):
            # PoCL generates the code at the first launch: one that returns at once, with the same sizes.
            self._launch(self._frame(), (0, 0, 0, 0), 0, 1).wait()

    def render(self, out: Image | None = None) -> Image:
        """One frame. With `out`, an Image of an earlier render() of this Renderer, its arrays are written over.

        Raises ValueError if `out` is none of those, DeviceError if the driver fails or in a forked process.
        """
        check_process()
        if out is not None and getattr(out.frame, "owner", None) is not self:
            raise ValueError("out: must be an image that this Renderer has rendered")
        with self._lock, self._driver_errors():
            frame = self._frame() if out is None else out.frame
            start = time.perf_counter()
            self._draw(frame)
            done = time.perf_counter()
            arrays = self._read(frame)
            end = time.perf_counter()
        seconds = self.seconds | {"kernel": done - start, "readback": end - done}
        return Image(**arrays, seconds=seconds, frame=frame)

    @property
    def skipped(self) -> dict[str, int]:
        """What this scene did not need, and how often."""
        return self.packed.skipped

    def work(self) -> dict[str, int]:
        """How often a frame does what WORK names: renders one more, in strips, with a kernel that counts."""
        check_process()
        x, y, width, height = self.region
        counter = copy(self)
        counter.outputs, counter.packed = ("work",), counting(self.packed)
        total = np.zeros(len(WORK), np.int64)
        rows = max(1, STRIP // width)
        with self._lock, self._driver_errors():
            counter._kernel = counter._built()
            for row in range(0, height, rows):
                counter._move_to((x, y + row, width, min(rows, height - row)))
                frame = counter._frame()
                counter._draw(frame)
                total += counter._read(frame)["work"].sum(axis=(0, 1), dtype=np.int64)
        return dict(zip(WORK, total.tolist(), strict=True))

    def _move_to(self, region: Crop) -> None:
        """Renders this part of the picture, (x, y, width, height), from now on."""
        self.region = region
        # Packets keep to cells of 4x4 pixels of the whole picture.
        self._margin = (region[0] % 4, region[1] % 4)

    @contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @contextmanager
    def _driver_errors(self) -> Iterator[None]:
        try:
            yield
        except cl.MemoryError as error:
            raise DeviceError(f"{self.device.name} has not enough memory: {error}") from None
        except cl.Error as error:
            raise DeviceError(f"{self.device.name} failed: {error}") from None

    def _buffer(self, array: NDArray[Any]) -> Any:
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self.context, flags, hostbuf=np.ascontiguousarray(array))

    def _frame(self) -> _Frame:
        """Room for the outputs of one frame."""
        columns, rows = (4, self.width // 4) if self.width > 1 else (1, 1)
        wide, high = (n + margin for n, margin in zip(self.region[2:], self._margin, strict=True))
        width, height = (-(-wide // columns) * columns, -(-high // rows) * rows)
        types = {"rgb8": "u1", "id": "i4", "shadow_rays": "i4", "work": "i4", "depth": real_dtype(self.precision)}
        arrays = {n: np.empty((height, width, CHANNELS[n]), types.get(n, "f4")) for n in self.outputs}
        # On a CPU the kernel writes straight into the host's arrays.
        write, use = cl.mem_flags.WRITE_ONLY, cl.mem_flags.USE_HOST_PTR
        buffers = {
            n: cl.Buffer(self.context, write | use, hostbuf=a)
            if self.device.kind == "cpu"
            else cl.Buffer(self.context, write, a.nbytes)
            for n, a in arrays.items()
        }
        return _Frame(self, width, height, arrays, buffers)

    def _built(self) -> Any:
        flags = (f"W={self.width}", f"RUN={RUN[self.width]}", *self.device.flags)
        return build(self.device, [*(f"-D{flag}" for flag in flags), *self.packed.options()])

    def _draw(self, frame: _Frame) -> None:
        """Renders the region, in strips that are short enough for Ctrl-C to be heard between them.

        A strip that takes long makes the next one smaller, and else larger; the next frame begins with what was found.
        """
        (x, y), (x0, y0, width, height) = self._margin, self.region
        region = (x0 - x, y0 - y, width + x, height + y)
        row, most = 0, max(64, STRIP // frame.width // 64 * 64)
        while row < region[3]:
            rows = min(self._rows, most, frame.height - row)
            start = time.perf_counter()
            self._launch(frame, region, row, rows).wait()
            seconds = time.perf_counter() - start
            row += rows
            if seconds > PATIENCE:
                self._rows = max(16, self._rows // 32 * 16)
            elif seconds < PATIENCE / 4 and rows == self._rows:  # else it was short because little was left
                self._rows *= 2

    def _launch(self, frame: _Frame, region: Crop, row: int, rows: int) -> Any:
        group = GROUP[self.width]
        packets = (
            -(-frame.width // (RUN[self.width] * (4 if self.width > 1 else 1))),
            -(-rows // max(1, self.width // 4)),
        )
        grid = tuple(-(-n // g) * g for n, g in zip(packets, group, strict=True))
        b = self._buffers
        any_buffer = b["power"]
        return self._kernel(
            self.queue,
            grid,
            group,
            self.packed.view[()],
            _int2(self.size),
            _int4(region),
            np.int32(row),
            np.int32(frame.width),
            b["center_radius"],
            b["power"],
            b["rest"],
            b["number"],
            b["material_of"],
            b["material"],
            b["light"],
            _int4((*self.packed.lights, sum(self.packed.lights))),
            np.int32(self.packed.count),
            b["candidate"],
            b["occluder"],
            b["outside"],
            b["light_grids"],
            b["grid"],
            b["start"],
            b["entry"],
            *(frame.buffers.get(name, any_buffer) for name in OUTPUTS),
        )

    def _read(self, frame: _Frame) -> dict[str, NDArray[Any]]:
        """The outputs as host arrays of exactly the region's size."""
        out = {}
        for name, array in frame.arrays.items():
            if self.device.kind == "cpu":
                mapped, _ = cl.enqueue_map_buffer(
                    self.queue, frame.buffers[name], cl.map_flags.READ, 0, array.shape, array.dtype
                )
                mapped.base.release(self.queue)
            else:
                cl.enqueue_copy(self.queue, array, frame.buffers[name])
            x, y = self._margin
            view = array[y : y + self.region[3], x : x + self.region[2]]
            out[name] = view[..., 0] if CHANNELS[name] == 1 else view
        self.queue.finish()
        if "depth" in out and self.precision == "single":
            # In scene units a distance may exceed float32's range.
            out["depth"] = np.ldexp(out["depth"].astype(np.float64), self.packed.scale)
        return out


class _Frame:
    def __init__(
        self, owner: Renderer, width: int, height: int, arrays: dict[str, NDArray[Any]], buffers: dict[str, Any]
    ) -> None:
        self.owner, self.width, self.height, self.arrays, self.buffers = owner, width, height, arrays, buffers


def _int2(values: tuple[int, ...]) -> Any:
    return np.array(tuple(values), cl.cltypes.int2)[()]


def _int4(values: tuple[int, ...]) -> Any:
    return np.array(tuple(values), cl.cltypes.int4)[()]


def _region(size: tuple[int, int], crop: Crop | None) -> Crop:
    """(x, y, width, height) of a crop; ValueError if it is not within the picture."""
    if crop is None:
        return (0, 0, *size)
    if len(crop) != 4 or not all(isinstance(n, (int, np.integer)) for n in crop):
        raise ValueError(f"crop: must be 4 whole numbers (x0, y0, x1, y1), got {crop!r}")
    x0, y0, x1, y1 = (int(n) for n in crop)
    if not (0 <= x0 < x1 <= size[0] and 0 <= y0 < y1 <= size[1]):
        raise ValueError(f"crop: must be within 0,0,{size[0]},{size[1]} and not empty, got {x0},{y0},{x1},{y1}")
    return (x0, y0, x1 - x0, y1 - y0)


def render(
    scene: Scene,
    device: str | Device | None = None,
    precision: str | None = None,
    outputs: tuple[str, ...] = ("rgb8",),
    crop: Crop | None = None,
    truncate: bool = False,
) -> Image:
    """One picture of a scene; see Renderer for the arguments."""
    return Renderer(scene, device, precision, outputs, crop, truncate).render()
