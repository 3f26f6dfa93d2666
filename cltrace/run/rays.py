"""Arrays of rays on a device: which surface of a scene each of them meets first, and where. See kernels/rays.cl."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from cltrace.base.arrays import joined
from cltrace.base.waiting import Announcement
from cltrace.plan import abi, opencl
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints
from cltrace.plan.world import SHAPES, paths_of
from cltrace.run.devices import Device, check_sizes, driver_errors
from cltrace.run.program import BUFFER, SOURCES, Kernel, context_of, program
from cltrace.scene import Scene

FILES = (*SOURCES[: SOURCES.index("find/tree.cl") + 1], "rays.cl")
FLAGS = frozenset({"WITH_RAYS", "IN_STAGES", "WITH_LEAVING", "WITH_BOUNCES", "WITH_TREE"})
# Room for the candidates of an undecided ray: CANDIDATES of kernels/find/leaves.cl.
CANDIDATES = 64
# Rays in one launch, so that Ctrl-C is heard soon, and in one work-item of a CPU.
RAYS_AT_ONCE, RUN = 1 << 18, 64
# More undecided rays than these are traced once more, with whole numbers. The exact engine takes about as long for them
# as that kernel takes to compile.
MANY_UNDECIDED = 10_000
# The parameters of the kernel beside those of all kernels.
PARAMETERS = {"rays": "int", "run": "int"} | dict.fromkeys(("origin", "way", "t_min", "t_max"), BUFFER)
RESULTS = {"met": (1, np.int32), "t": (1, np.float64), "open": (1, np.int32), "candidate": (CANDIDATES, np.int32)}
# Sizes of surfaces for which products of ten of them neither overflow nor vanish.
MODERATE = (2.0**-80, 2.0**80)


@dataclass(frozen=True)
class DeviceHits:
    """What a device knows of n rays.

    index: (n,), the surface that each meets first, -1 for none; t: (n,), correctly rounded, inf for none. These do
    not count for the rays `undecided`. ray, surface: (m,), pairs of such a ray and a surface that it may meet first.
    anything: those undecided rays that may meet any surface, and are in no pair.
    """

    index: Ints
    t: Array
    undecided: NDArray[np.intp]
    ray: NDArray[np.intp]
    surface: Ints
    anything: NDArray[np.intp]


class RayTracer:
    """A scene on a device that has doubles. number, primitive: (n,), of the surfaces in the scene and of triangles in
    their mesh, -1 for others. moderate: whether all sizes are such that the kernel may decide about them. For one
    thread at a time.
    """

    def __init__(self, scene: Scene, device: Device) -> None:
        self.device = device
        request = Request(outputs=("id",))
        shapes = tuple(kind.of(scene, request, None) for kind in SHAPES)
        # The tree's unit is twice as large as the scene, so that rays may begin outside of it.
        paths = paths_of(shapes, room=2.0)
        axes, real = np.eye(3), np.dtype("f8")
        arrays = {"id_of": joined([shape.number for shape in shapes]), **paths.arrays()}
        arrays["camera"] = np.zeros((4, 4))
        arrays["camera"][1:, :3] = axes
        values = {**paths.values(scene.camera, None), "unit": 1.0}
        first, features = 0, set(FLAGS)
        for shape in shapes:
            arrays |= shape.packed(real, None, axes, paths)
            values |= shape.values(first)
            features |= set(shape.flags)
            first += len(shape.number)
        if "WITH_SHAPES" in features:
            features |= set(abi.EVERY_SHAPE)  # one program for all such scenes
        self.number, triangles = arrays["id_of"], shapes[-1].number
        self._triangles = len(triangles)
        self.primitive = np.full(first, -1, np.int32)
        self.primitive[first - len(triangles) :] = arrays["number_of"]
        sizes = np.concatenate([shape.sizes for shape in shapes])
        self.moderate = bool(((sizes >= MODERATE[0]) & (sizes <= MODERATE[1])).all())
        with driver_errors(device), Announcement("compiling the kernel ..."):
            self._queue: Any = cl.CommandQueue(context_of(device.cl))
            self._upload(arrays, values, frozenset(features))

    def _upload(self, arrays: dict[str, Any], values: dict[str, Any], features: frozenset[str]) -> None:
        check_sizes(self.device, {name: (len(array), array.nbytes) for name, array in arrays.items()})
        arguments = abi.arguments_of(features)
        types = {a.name: a.type.replace("real", "double") if a.kind == "value" else BUFFER for a in arguments}
        self._features, self._parameters = features, types | PARAMETERS | dict.fromkeys(RESULTS, BUFFER)
        self._kernels = {"": self._built("")}
        # What no ray asks for is 0, or a buffer of a few zeros.
        zeros = {type_: np.zeros((), getattr(cl.cltypes, type_))[()] for type_ in types.values() if type_ != BUFFER}
        zeros[BUFFER] = self._buffer(np.zeros(64))
        self._arguments = {name: zeros[type_] for name, type_ in types.items()}
        self._arguments |= {name: value for name, value in values.items() if name in types}
        self._arguments |= {name: self._buffer(a) for name, a in arrays.items() if name in types and len(a)}
        if "plane" in types:
            self._arguments["plane"] = self._buffer(np.zeros(max(1, values["triangles"]), np.int32))

    def _buffer(self, array: NDArray[Any]) -> Any:
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._queue.context, flags, hostbuf=np.ascontiguousarray(array))

    def _built(self, whole: str) -> Kernel:
        """The kernel; whole: "WITH_WHOLE" for that which has whole numbers, else ""."""
        flags = ["-DW=1", "-DRUN=1", *(f"-D{flag}" for flag in self.device.flags)]
        options = opencl.options("accurate", self._features | ({whole} if whole else set()))
        return program(self.device, [*flags, *options], FILES).kernel("trace_rays", self._parameters)

    def trace(self, *rays: Array) -> DeviceHits:
        """Origins and directions, (n, 3), in the world, none 0 nor of an extreme length, t_min and t_max, (n,)."""
        with driver_errors(self.device):
            found = self._found(rays, "")
            rows = found.undecided
            if len(rows) <= MANY_UNDECIDED or not self._triangles:
                return found
            if "WITH_WHOLE" not in self._kernels:
                with Announcement("compiling the kernel ..."):
                    self._kernels["WITH_WHOLE"] = self._built("WITH_WHOLE")
            again = self._found([x[rows] for x in rays], "WITH_WHOLE")
        found.index[rows], found.t[rows] = again.index, again.t
        ray, anything = rows[again.ray], rows[again.anything]
        return DeviceHits(found.index, found.t, rows[again.undecided], ray, again.surface, anything)

    def _found(self, rays: Sequence[Array], whole: str) -> DeviceHits:
        """What one of the kernels knows."""
        parts = [slice(i, i + RAYS_AT_ONCE) for i in range(0, len(rays[0]), RAYS_AT_ONCE)]
        found = [self._trace(self._kernels[whole], *(x[part] for x in rays)) for part in parts]
        index, t, count = (np.concatenate([one[name] for one in found]) for name in ("met", "t", "open"))
        undecided = np.flatnonzero(count)
        candidate = np.concatenate([one["candidate"] for one in found])
        kept = np.arange(CANDIDATES) < count[undecided, None]
        ray = np.repeat(undecided, kept.sum(axis=1))
        return DeviceHits(index, t, undecided, ray, candidate[kept], undecided[count[undecided] < 0])

    def _trace(self, kernel: Kernel, *rays: Array) -> dict[str, NDArray[Any]]:
        """One launch: its results, of which the candidates are those of undecided rays alone."""
        n, cpu = len(rays[0]), self.device.kind == "cpu"
        run, group = (RUN, 1) if cpu else (1, 64)
        items = -(-n // (run * group)) * group
        given = dict(zip(("origin", "way", "t_min", "t_max"), map(self._buffer, rays), strict=True))
        context, write = self._queue.context, cl.mem_flags.READ_WRITE
        sizes = {name: n * width * np.dtype(type_).itemsize for name, (width, type_) in RESULTS.items()}
        made = {name: cl.Buffer(context, write, size) for name, size in sizes.items()}
        own = given | made | {"undecided": cl.Buffer(context, write, 1 + items), "rays": n, "run": run}
        kernel.start(self._queue, (items,), (group,), self._arguments | own)
        results = {name: np.empty(n, RESULTS[name][1]) for name in ("met", "t", "open")}
        for name, array in results.items():
            cl.enqueue_copy(self._queue, array, made[name])
        undecided = np.flatnonzero(results["open"])
        candidate = np.empty((0, CANDIDATES), np.int32)
        if len(undecided):
            mapped, _ = cl.enqueue_map_buffer(
                self._queue, made["candidate"], cl.map_flags.READ, 0, (n, CANDIDATES), np.dtype(np.int32)
            )
            candidate = mapped[undecided]
            mapped.base.release(self._queue)
        return results | {"candidate": candidate}
