"""A plan on a device: its program, its buffers, its launches."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from cltrace.base.arrays import LARGE, begins_on_page, empty
from cltrace.base.errors import TooManyRaysError, TooSlowError
from cltrace.base.limits import MAX_SECONDS
from cltrace.base.waiting import Announcement, interruptible
from cltrace.plan.abi import CONSTANTS, COUNTERS, OUTPUTS, Precision, arguments_of, dtype_of
from cltrace.plan.plan import Plan
from cltrace.plan.request import WIDTHS, Region
from cltrace.plan.world import timed
from cltrace.run.devices import Device, check_sizes, driver_errors
from cltrace.run.program import BUFFER, Kernel, argument, context_of, program
from cltrace.run.unstoppable import Unstoppable


@dataclass(frozen=True)
class Packet:
    """How packets of one width are rendered.

    group: the local size in work-items, the same for all pictures, as PoCL compiles the kernel anew for each size; run:
    packets that a work-item renders, one after the other; columns, rows: of a packet, in pixels.
    """

    group: tuple[int, int]
    run: int
    columns: int
    rows: int


PACKETS = {w: Packet((16, 4), 1, 1, 1) if w == 1 else Packet((1, 1), 8, 4, w // 4) for w in WIDTHS}
# A launch has at most so many pixels.
STRIP = 2**22
# A launch takes about so many seconds at most, for whoever looks at the progress, and as some devices do not see what
# stops it. A first one, which may turn out to be slow, has so many rows.
PATIENCE, FIRST_ROWS = 0.25, 64
# Rows of packets that a work-item renders where a cache holds few of the lights' lists, and of samples, as two rows
# share the rays through their corners.
BLOCK_ROWS, SAMPLED_ROWS = 4, 8
# A plan, and buffers that are there already, by the names of arrays that it lacks.
Made = tuple[Plan, dict[str, Any]]
# Values of the kernel's argument `last`: later than any pixel, and before all.
ALL, OVER = np.iinfo(np.int32).max, np.iinfo(np.int32).min
# Flags of both programs, and of the first one alone.
BOTH, FIRST = "IN_STAGES", "WITHOUT_RARE"


def deadline() -> float:
    """When drawing is given up that begins now, by time.monotonic()."""
    return time.monotonic() + MAX_SECONDS


class Last:
    """The kernel's argument of this name: a buffer with one number.

    notes: whether the kernel may write it. stopped: whether stop() was called. A CPU sees that at once, and its kernel
    comes back. Other devices need not see what the host writes meanwhile.
    """

    def __init__(self, context: Any, device: Device, notes: bool) -> None:
        flags = cl.mem_flags
        use = flags.USE_HOST_PTR if device.kind == "cpu" else flags.COPY_HOST_PTR
        # No other data are in its page. A driver that wants memory to begin there for that reads this array itself.
        self._shared, self._own = empty((LARGE // 4,), np.int32), np.empty(1, np.int32)
        self._shared[0] = ALL
        self.buffer: Any = cl.Buffer(context, flags.READ_WRITE | use, hostbuf=self._shared)
        self.stopped, self._notes = False, notes

    def reset(self, queue: Any) -> None:
        """Before a launch, when a stop() has been heard."""
        self.stopped = False
        self.begin(queue)

    def begin(self, queue: Any) -> None:
        """Before a picture. A stop() that nobody has heard yet is heard then."""
        self._shared[0] = self._own[0] = ALL
        if self._notes:
            cl.enqueue_copy(queue, self.buffer, self._own)
        if self.stopped:
            self._shared[0] = OVER

    def stop(self) -> None:
        """Has the kernel come back, if it runs. Any thread may call it."""
        self.stopped = True
        self._shared[0] = OVER

    def read(self, queue: Any) -> int:
        """What the kernel has noted: the first pixel of too many rays, or ALL."""
        if self._notes:
            cl.enqueue_copy(queue, self._own, self.buffer)
        return int(self._own[0])


def is_in_stages(width: int, precision: Precision) -> bool:
    """Whether packets of this width are drawn so. In vectors, other lanes wait for what one needs anyway."""
    return width == 1 and precision != "single"


class Undecided:
    """Pixels that double cannot decide, on devices that render one pixel in each work-item, of one launch after the
    other.

    What decides them takes registers and memory of all work-items of a program, also where none of them needs it. So
    two programs are made of the kernel's text. The first one has nothing of that, and marks the pixels that it leaves;
    the second one has everything, and draws those. It is compiled once there is such a pixel.

    options: of the program that draws them; device: where; types: of its parameters. marks: the kernels' argument
    `undecided`; compiles: whether that program is being compiled.
    """

    def __init__(self, queue: Any, device: Device, options: list[str], types: dict[str, str]) -> None:
        self.queue, self._device, self._options, self._types = queue, device, options, types
        self._first = np.empty(1, np.uint8)
        self._drawer: Kernel | None = None
        self.marks: Any = None
        self.compiles = False

    def begin(self, items: int) -> None:
        """Before the first program is started with so many work-items: none is marked."""
        size = 1 + items
        if self.marks is None or self.marks.size < size:
            self.marks = cl.Buffer(self.queue.context, cl.mem_flags.READ_WRITE, size)
        cl.enqueue_fill_buffer(self.queue, self.marks, np.zeros(1, np.uint8), 0, size)

    def any(self) -> bool:
        """Whether it has left a pixel, once it is done."""
        cl.enqueue_copy(self.queue, self._first, self.marks)
        return bool(self._first[0])

    def drawer(self, launch_first: Callable[[Kernel], None]) -> Kernel:
        """What draws them. launch_first: has the driver compile a kernel."""
        if self._drawer is None:
            self.compiles = True
            self._drawer = program(self._device, self._options).kernel("render", self._types)
            launch_first(self._drawer)
            self.compiles = False
        return self._drawer


@dataclass(eq=False)
class FrameBuffers:
    """Room for the outputs of one frame, which are whole packets.

    owner: the `room` of the executor that made it; width, height: in pixels; arrays: on the host, by the outputs'
    names, (height, width, channels) each; buffers: on the device. On a CPU a buffer is its array. exponent: depths that
    have been drawn are in units of 2^exponent scene units.
    """

    owner: object
    width: int
    height: int
    arrays: dict[str, NDArray[Any]]
    buffers: dict[str, Any]
    exponent: int = 0


@dataclass(frozen=True)
class BuiltKernel:
    """The kernel of a plan. undecided: None where one program draws all pixels."""

    kernel: Kernel
    undecided: Undecided | None

    @classmethod
    def of(cls, plan: Plan, device: Device, width: int, queue: Any) -> BuiltKernel:
        """Raises BuildError."""
        features, precision = plan.features, plan.request.precision
        flags = (f"W={width}", f"RUN={PACKETS[width].run}", *device.flags)
        options = [*(f"-D{flag}" for flag in flags), *plan.options()]
        in_stages = is_in_stages(width, precision)
        if in_stages:
            features, options = features | {BOTH}, [*options, f"-D{BOTH}"]
        real = "float" if precision == "single" else "double"
        types = {a.name: a.type.replace("real", real) if a.kind == "value" else BUFFER for a in arguments_of(features)}
        kernel = program(device, [*options, f"-D{FIRST}"] if in_stages else options).kernel("render", types)
        return cls(kernel, Undecided(queue, device, options, types) if in_stages else None)

    def values(self, plan: Plan) -> dict[str, Any]:
        """Arguments of a plan that are no buffers."""
        types = self.kernel.types
        return {name: argument(types[name], value) for name, value in plan.values.items() if name in types}


@dataclass(eq=False)
class Pace:
    """How many rows a launch has: so many that it takes about PATIENCE."""

    rows: int = FIRST_ROWS

    def took(self, seconds: float, full: bool, lines: int) -> None:
        """After a launch. full: whether it had all of `rows`; lines: of which these are multiples."""
        if seconds > PATIENCE:
            least = max(16, lines)
            self.rows = max(least, self.rows // (2 * least) * least)
        elif seconds < PATIENCE / 4 and full:  # else it was short because little was left
            self.rows *= 4 if seconds < PATIENCE / 16 else 2


@dataclass(eq=False)
class Executor:
    """A plan on a device, built and uploaded: draw() renders a frame() and read() brings back its arrays.

    plan: its arrays are not to change; width: pixels in a packet, one of WIDTHS; region: x, y, width, height of what is
    rendered, in pixels; built: the kernel; buffers, values: its arguments that no launch changes; last: to stop it;
    until: when drawing is given up, by time.monotonic(); further: what makes each pass that follows this one,
    with the same features and outputs, see plan/plan.py; started: whether this is one of those; unstoppable: what is
    known of triangles, None where nothing is asked; room: owns the frames that it draws into; seconds: what "build" and
    "upload" took. For one thread at a time.
    """

    plan: Plan
    device: Device
    width: int
    region: Region
    queue: Any
    built: BuiltKernel
    buffers: dict[str, Any]
    values: dict[str, Any]
    last: Last
    until: float = math.inf
    further: Sequence[Callable[[], Made]] = ()
    started: bool = False
    unstoppable: Unstoppable | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    pace: Pace = field(default_factory=Pace)
    room: object = field(default_factory=object)

    @classmethod
    def of(
        cls,
        made: Made,
        device: Device,
        width: int,
        before: Executor | None = None,
        further: Sequence[Callable[[], Made]] = (),
        same: Executor | None = None,
    ) -> Executor:
        """Builds and uploads a plan.

        before: an executor on the same device, whose buffers are used again for the arrays that its plan shares with
        this one; same: one of the same scene, which another camera sees. Raises BuildError if the kernel does not
        build, and DeviceError if the driver fails or has not enough memory.
        """
        plan, seconds = made[0], dict[str, float]()
        with timed(seconds, "build"), driver_errors(device), Announcement("compiling the kernel ..."):
            queue: Any = cl.CommandQueue(context_of(device.cl))
            built = BuiltKernel.of(plan, device, width, queue)
        last = Last(queue.context, device, "WITH_SPLITS" in plan.features)
        with timed(seconds, "upload"), driver_errors(device):
            buffers = _uploaded(made, device, queue, before) | {"last": last.buffer}
            if "WITH_TRIANGLES" in plan.features:
                size = 4 * max(plan.values["triangles"], 1)
                buffers["plane"] = cl.Buffer(queue.context, cl.mem_flags.READ_WRITE, size)
                cl.enqueue_fill_buffer(queue, buffers["plane"], np.zeros(1, np.int32), 0, size)
            unstoppable = None
            if plan.unstoppable:
                unstoppable = Unstoppable(plan, device, same.unstoppable if same else None)
            queue.finish()
        executor = cls(
            plan, device, width, plan.region, queue, built, buffers, built.values(plan), last, further=further,
            unstoppable=unstoppable, seconds=seconds,
        )  # fmt: skip
        with timed(seconds, "build"), driver_errors(device), Announcement("compiling the kernel ..."):
            executor._launch_first(built.kernel)
        return executor

    def continuing(self, before: Executor) -> Executor:
        """The same, but drawing into the frames of an executor with the same width, request and region, as it did."""
        return replace(self, room=before.room, pace=before.pace)

    def part(self, region: Region) -> Executor:
        """What draws a part of the same region, with the same buffers. Not while another thread draws with this one."""
        return replace(self, region=region, room=object(), pace=Pace(self.pace.rows))

    @property
    def packet(self) -> Packet:
        return PACKETS[self.width]

    @property
    def _margin(self) -> tuple[int, int]:
        """How many columns and rows of the tile in which the region begins are not in it. A frame has them, too, as no
        packet may be in two tiles."""
        return self.region[0] % CONSTANTS["TILE"], self.region[1] % CONSTANTS["TILE"]

    def frame(self) -> FrameBuffers:
        """Room for one frame. Its arrays hold nothing yet."""
        columns, rows = self.packet.columns, self.packet.rows
        wide, high = (n + margin for n, margin in zip(self.region[2:], self._margin, strict=True))
        width, height = (-(-wide // columns) * columns, -(-high // rows) * rows)
        precision = self.plan.request.precision
        arrays = {
            name: np.empty((height, width, OUTPUTS[name].channels), dtype_of(OUTPUTS[name].type, precision))
            for name in self.plan.request.outputs
        }
        # On a CPU the kernel writes straight into the host's arrays.
        cpu, context, flags = self.device.kind == "cpu", self.queue.context, cl.mem_flags
        use = flags.WRITE_ONLY | (flags.USE_HOST_PTR if cpu else 0)
        buffers = {n: cl.Buffer(context, use, a.nbytes, hostbuf=a if cpu else None) for n, a in arrays.items()}
        if self.plan.passes:
            size = height * width * dtype_of("shade4", precision).itemsize
            buffers["so_far"] = cl.Buffer(context, flags.READ_WRITE, size)
        return FrameBuffers(self.room, width=width, height=height, arrays=arrays, buffers=buffers)

    def draw(
        self, frame: FrameBuffers, drawn: Callable[[int], object] = lambda rows: None, until: float | None = None
    ) -> None:
        """Renders the region, in strips, in each pass.

        A strip that takes too long makes the next one smaller, and one that takes little time makes it larger. The next
        frame begins with the size that was found. drawn: called with how many rows a strip had, in the last pass, and
        with 0 in others and where it was stopped; what that raises ends it. Raises TooManyRaysError after the strip in
        which that happened, and TooSlowError after `until`, which None has be the deadline of now.
        """
        self.until = deadline() if until is None else until
        for number, part in enumerate(self._passes()):
            part._draw(frame, drawn if number == len(self.further) else lambda rows: drawn(0))
            del part  # The next one has room in its place.

    def _passes(self) -> Iterator[Executor]:
        """This one, and those that follow it, each of which is made when it is asked for, and not kept."""
        yield self
        for make in self.further:
            plan, _ = made = make()
            buffers, pace = self.buffers | _uploaded(made, self.device, self.queue, self), Pace(self.pace.rows)
            values = self.built.values(plan)
            yield replace(self, plan=plan, buffers=buffers, values=values, started=True, pace=pace)
            del plan, made, buffers

    def _strips(self, frame: FrameBuffers) -> Iterator[range]:
        """The rows of a frame in strips, each as large as the time that the last one took allows."""
        most = max(64, STRIP // frame.width // 64 * 64)
        rows = range(self.region[3] + self._margin[1])
        while rows:
            size = min(self.pace.rows, most)
            yield rows[:size]
            rows = rows[size:]

    def _draw(self, frame: FrameBuffers, drawn: Callable[[int], object]) -> None:
        """Renders the strips of one pass."""
        if self.unstoppable:
            self.unstoppable.find(self.queue, self.buffers)
        (x, y), (x0, y0, width, height) = self._margin, self.region
        region = (x0 - x, y0 - y, width + x, height + y)
        frame.exponent = self.plan.exponent
        self.last.begin(self.queue)
        with interruptible(self.last.stop, self._advice, self._is_late) as begin:
            for strip in self._strips(frame):
                count = (frame.height if strip.stop == region[3] else strip.stop) - strip.start
                begin()
                seconds = self._seconds_of(partial(self._render, frame, region, strip.start, count), drawn)
                self._check_overgrown()
                drawn(len(strip))
                if self.unstoppable:
                    self.unstoppable.drawn(len(strip) * width)
                self.pace.took(seconds, count == self.pace.rows, self._lines)

    def stop(self) -> None:
        """Has a draw() of another thread call its `drawn` soon; if there is none, the next one."""
        self.last.stop()

    def read(self, frame: FrameBuffers) -> dict[str, NDArray[Any]]:
        """The outputs by name, as host arrays of exactly the region's size, (h, w) or (h, w, channels).

        The dtypes are those of abi.OUTPUTS, but depth is float64, in scene units. The arrays are views of the frame's,
        which the next draw() of that frame writes over; the depth of single precision is a copy.
        """
        out = {}
        for name, array in frame.arrays.items():
            if self.device.kind != "cpu":
                cl.enqueue_copy(self.queue, array, frame.buffers[name])
            x, y = self._margin
            view = array[y : y + self.region[3], x : x + self.region[2]]
            out[name] = view[..., 0] if OUTPUTS[name].channels == 1 else view
        self.queue.finish()
        if "depth" in out and out["depth"].dtype == np.float32:
            # In scene units a distance may exceed float32's range.
            out["depth"] = np.ldexp(out["depth"].astype(np.float64), frame.exponent)
        return out

    def work(self) -> dict[str, int]:
        """How often a frame does what each text of COUNTERS says: renders it once more, with a kernel that counts.

        It does so in strips, as the counters of all pixels at once might need too much memory.
        """
        x, y, width, height = self.region
        total, rows = np.zeros(len(COUNTERS), np.int64), max(1, STRIP // width)
        until = deadline()
        for part in self._passes():
            plan = part.plan.counting()
            built = BuiltKernel.of(plan, self.device, self.width, self.queue)
            counter = replace(part, plan=plan, built=built, values=built.values(plan), further=())
            counter._launch_first(built.kernel)
            for row in range(0, height, rows):
                strip = counter.part((x, y + row, width, min(rows, height - row)))
                frame = strip.frame()
                strip.draw(frame, until=until)
                total += strip.read(frame)["work"].sum(axis=(0, 1), dtype=np.int64)
            del part, counter, strip
        return dict(zip(COUNTERS.values(), total.tolist(), strict=True))

    def _check_overgrown(self) -> None:
        """Raises TooManyRaysError if the kernel has noted a pixel."""
        if (last := self.last.read(self.queue)) == ALL:
            return
        size, (columns, rows) = self.plan.size, (self.packet.columns, self.packet.rows)
        number, lane = divmod(last, self.width)
        row, column = divmod(number, -(-size[0] // columns))
        pixel = (column * columns + lane % columns, row * rows + lane // columns)
        raise TooManyRaysError(pixel, CONSTANTS["MOST_RAYS"], self.plan.values["bounces"])

    def _launch_first(self, kernel: Kernel) -> None:
        """Has PoCL generate the code, by a launch that returns at once, of the same local size as others."""
        if self.packet.group not in kernel.launched:
            small = self.part((*self.region[:2], 1, 1))
            small._launch(kernel, small.frame(), (0, 0, 0, 0), row=0, rows=1)

    def _render(self, frame: FrameBuffers, region: Region, row: int, rows: int) -> None:
        """Starts the kernel for `rows` rows of a region from `row` on, and what draws the pixels that it leaves."""
        self._launch(self.built.kernel, frame, region, row=row, rows=rows)
        if self.built.undecided and self.built.undecided.any() and not self.last.stopped:
            kernel = self.built.undecided.drawer(self._launch_first)
            self._launch(kernel, frame, region, row=row, rows=rows)
        if self.device.kind == "cpu":
            self._map(frame)

    def _map(self, frame: FrameBuffers) -> None:
        """Has the frame's arrays hold what the kernel writes, once all of the queue is done.

        To wait for this alone took 0.06 ms, a quarter of a thumbnail's frame.
        """
        for name, array in frame.arrays.items():
            mapped, _ = cl.enqueue_map_buffer(
                self.queue, frame.buffers[name], cl.map_flags.READ, 0, array.shape, array.dtype, is_blocking=False
            )
            mapped.base.release(self.queue)

    def _advice(self) -> str:
        """What to say where a strip takes long: which numbers could be lower."""
        if self.built.undecided and self.built.undecided.compiles:
            return "compiling what draws the pixels that double cannot decide"
        return f"drawing is slow: no {self.pace.rows} rows in a second; lower {self._lower()}"

    def _lower(self) -> str:
        """Which numbers could be lower for a picture to take less time."""
        request, values = self.plan.request, self.plan.values
        numbers = {
            "max_bounces": values["bounces"] if "WITH_BOUNCES" in self.plan.features else None,
            "samples": request.samples,
            "the resolution": "x".join(map(str, self.plan.size)),
        }
        lower = ", or ".join(f"{name}, which is {number}" for name, number in numbers.items() if number)
        lights = ", or have fewer lights" if self.further else ""
        return lower + lights

    def _is_late(self) -> bool:
        return time.monotonic() >= self.until

    def _seconds_of(self, launch: Callable[[], Any], drawn: Callable[[int], object]) -> float:
        """Launches the kernel, again if it is stopped and drawn(0) raises nothing, and says how long it took."""
        while True:
            if self.last.stopped:
                self.last.reset(self.queue)
                drawn(0)
            if self._is_late():
                raise TooSlowError(MAX_SECONDS, self._lower())
            start = time.perf_counter()
            try:
                launch()
                self.queue.finish()
            except BaseException:  # nothing may be written into arrays that nobody holds any more
                self.last.stop()
                self.queue.finish()
                raise
            if not self.last.stopped:
                return time.perf_counter() - start

    @property
    def _lines(self) -> int:
        """How many rows of pixels a work-item renders."""
        return self._high * self.packet.rows

    @property
    def _high(self) -> int:
        """How many rows of packets a work-item renders."""
        if not self.plan.blocks or self.width == 1:
            return 1
        return SAMPLED_ROWS if "WITH_SAMPLES" in self.plan.features else BLOCK_ROWS

    def _launch(self, kernel: Kernel, frame: FrameBuffers, region: Region, row: int, rows: int) -> Any:
        """Starts a kernel for `rows` rows of a region from `row` on. Returns its event."""
        columns, lines = self.packet.run * self.packet.columns, self._lines
        packets = (-(-frame.width // columns), -(-rows // lines))
        grid = tuple(-(-n // g) * g for n, g in zip(packets, self.packet.group, strict=True))
        if self.built.undecided:
            if kernel is self.built.kernel:
                self.built.undecided.begin(grid[0] * grid[1])
            self.buffers["undecided"] = self.built.undecided.marks
        proved = self.unstoppable.lights if self.unstoppable else 0
        of_launch = {"region": region, "row": row, "pitch": frame.width, "margin": self._margin, "high": self._high}
        of_launch |= {"proved": proved, "started": int(self.started)}
        # An output that is not wanted is null, and the kernel does not write it.
        outputs = dict.fromkeys((*OUTPUTS, "so_far")) | frame.buffers
        arguments = self.values | of_launch | self.buffers | outputs
        return kernel.start(self.queue, grid, self.packet.group, arguments)


def _uploaded(made: Made, device: Device, queue: Any, before: Executor | None) -> dict[str, Any]:
    """The kernel's arguments that are buffers and that no launch changes. before: see Executor.of()."""
    arrays, kept, flags = made[0].arrays, before.plan.arrays if before else {}, cl.mem_flags
    check_sizes(device, {name: (len(array), array.nbytes) for name, array in arrays.items()})

    def uploaded(array: NDArray[Any]) -> Any:
        # A CPU's driver reads the array itself, if it is one that is there for that.
        use = flags.USE_HOST_PTR if device.kind == "cpu" and begins_on_page(array) else flags.COPY_HOST_PTR
        return cl.Buffer(queue.context, flags.READ_ONLY | use, hostbuf=np.ascontiguousarray(array))

    return {
        name: before.buffers[name] if before and array is kept.get(name) else uploaded(array)
        for name, array in arrays.items()
    } | made[1]
