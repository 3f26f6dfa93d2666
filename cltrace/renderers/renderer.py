"""A scene goes through plan and run, and comes out as an Image, whole or in strips of rows."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.errors import DeviceError, OutOfMemoryError
from cltrace.base.limits import MAX_PIXELS, MAX_SIDE
from cltrace.base.progress import bar
from cltrace.picture.composition import Composition
from cltrace.picture.effects import Effects, Shares
from cltrace.picture.image import Image, Output
from cltrace.plan.abi import OUTPUTS, Precision, dtype_of
from cltrace.plan.materials import precision_for
from cltrace.plan.plan import Plan, passes_of
from cltrace.plan.request import WIDTHS, Crop, Keep, Region, Request
from cltrace.plan.view import CameraView
from cltrace.plan.world import Before, ScenePacking
from cltrace.run.devices import DRIVERS, Device, check_process, choose, driver_errors
from cltrace.run.executor import Executor, FrameBuffers, Made, deadline
from cltrace.run.pack import packer_of, view_by
from cltrace.scene import AnyCamera, Scene, share_all_but_camera, with_spheres
from cltrace.scene.rules import is_whole

if TYPE_CHECKING:
    from cltrace.run.pack import Packer

# How many samples antialias=True takes.
SAMPLES = 32
# Along how many rays a side of a pixel the ends of surfaces are looked for with antialiasing: the most that fit into a
# finer picture of so many pixels.
PROBES, PROBED = (4, 2), 2**28
# So many of these rays are traced at a time, which bounds the memory that they take.
BAND = 2**22
# Strips begin at multiples of so many rows, which every packet divides.
STEP = 16
# Bytes of what the kernel writes that are in memory at once where a picture is drawn in strips. Files take up to twice
# as much beside them.
STRIP_BYTES = 2**26


def samples_of(antialias: bool, samples: int | None) -> int | None:
    """The samples that Request wants for these arguments of Renderer. Raises ValueError if they are not allowed."""
    if not isinstance(antialias, (bool, np.bool_)):
        raise ValueError(f"antialias: must be True or False, got {antialias!r}")
    if samples is not None and not antialias:
        raise ValueError(f"samples: goes with antialias=True, got {samples!r} without it")
    return (SAMPLES if samples is None else samples) if antialias else None


def default_precision(device: Device) -> Precision:
    """What a device renders in if nothing else is asked for: accurate if it has double precision, else single."""
    return "accurate" if device.has_double else "single"


@dataclass(frozen=True)
class _Settings:
    """What all Renderers that are derived from each other have in common: width: pixels in a packet; precision: the one
    that was asked for; outputs, effects: of Renderer."""

    device: Device
    width: int
    precision: Precision
    outputs: tuple[Output, ...]
    effects: tuple[tuple[Any, float] | None, tuple[Any, float, float] | None]

    def composition(self, scene: Scene, truncate: bool) -> Composition:
        """How images of a scene are made."""
        return Composition.of(self.outputs, scene, truncate, Effects.of(*self.effects, scene.transfer))


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A scene on a device, ready to be drawn.

    made: the buffers that the view's arrays lack; packer: what makes further views of the world, None for numpy; probe:
    what draws the surfaces that effects are made of; seconds: of Renderer. What holds for another scene or crop, too,
    is shared with it, by identity.
    """

    settings: _Settings
    scene: Scene
    request: Request
    world: ScenePacking
    view: CameraView
    made: dict[str, Any]
    packer: Packer | None
    plan: Plan
    executor: Executor
    seconds: dict[str, float]
    probe: Renderer | None = None

    @classmethod
    def of(
        cls,
        settings: _Settings,
        scene: Scene,
        request: Request,
        world: ScenePacking,
        start: float,
        before: _Prepared | None = None,
    ) -> _Prepared:
        """Makes view, plan and executor. start: time.perf_counter() when the work began; before: see derived()."""
        worlds, device = passes_of(world, request), settings.device
        known = before if before and before.plan.request == request else None
        if len(worlds) == 1 and known and (same := known.view_of(world, scene.camera)):
            view, made, packer = same, known.made, known.packer
        else:
            if known and known.packer and known.packer.fits(world):
                packer = known.packer
            else:
                kept, again = (before.packer, before.world is world) if before else (None, False)
                packer = packer_of(world, request, device, kept, again)
            view, made = view_by(packer, worlds[0], scene.camera, request, keep=len(worlds) == 1)
        plan = Plan.of(world, view, request)
        packed = time.perf_counter() - start

        def further(some: ScenePacking) -> Made:
            """The plan of the pass that adds the lights of `some`, and its buffers."""
            view, made = view_by(packer, some, scene.camera, request, keep=False)
            return Plan.of(world, view, request), made

        executor = Executor.of(
            (plan, made), device, settings.width, before.executor if before else None,
            further=[partial(further, some) for some in worlds[1:]],
            same=before.executor if before and before.world is world else None,
        )  # fmt: skip
        took = plan.seconds if before else world.seconds | plan.seconds
        seconds = {"pack": packed - sum(took.values()), **took, **executor.seconds}
        prepared = cls(settings, scene, request, world, view, made, packer, plan, executor, seconds)
        return replace(prepared, probe=prepared.probe_of(before.probe if before else None))

    def derived(self, scene: Scene, request: Request, start: float) -> _Prepared:
        """The same of another scene, or with another crop.

        What is shared: the world, if all but the camera is the same object, and else, for the same outputs, what
        ScenePacking.of() finds in it. The view: see view_of(), for the same request, which differs from that of the
        plan after rows(). The packer: for the same request, while it fits. Buffers of arrays that are the same objects.
        What is known of triangles of the same world. start: see of().
        """
        shared, old = share_all_but_camera(self.scene, scene), self.scene
        if not shared or scene.camera.max_bounces != old.camera.max_bounces:
            request = replace(request, precision=precision_for(scene, self.settings.precision))
        world, same = self.world, request.precision == self.request.precision
        if not same or not shared:
            alike = (len(old.meshes), bool(old.textures)) == (len(scene.meshes), bool(scene.textures))
            alike = alike and same and request.outputs == self.request.outputs
            world = ScenePacking.of(scene, request, Before(old, world) if alike else None)
        return _Prepared.of(self.settings, scene, request, world, start, self)

    def view_of(self, world: ScenePacking, camera: AnyCamera) -> CameraView | None:
        """This one's view if it is that of a world and a camera, but for materials; else None."""
        if camera != self.scene.camera:
            return None
        if world is self.world:
            return replace(self.view, seconds={})
        if world.differs_in_materials(self.world):
            return replace(self.view.recolored(world, self.plan.request), seconds={})
        return None

    @property
    def composition(self) -> Composition:
        """How images are made."""
        return self.settings.composition(self.scene, self.request.truncate)

    def probe_of(self, before: Renderer | None) -> Renderer | None:
        """What draws the surfaces that effects are made of: with antialiasing, as many pixels as fit of PROBES a side.

        They reach beyond the region as far as lines do. before: of what this one is derived from.
        """
        effects, (x, y, width, height) = self.composition.effects, self.executor.region
        if effects is None:
            return None
        wide, high = self.scene.camera.resolution
        most = min(PROBED, MAX_PIXELS)
        fits = (k for k in PROBES if k * max(wide, high) <= MAX_SIDE and k * k * wide * high <= most)
        k = next(fits, 1) if self.request.means else 1
        more = effects.reach(k)
        low, end = (max(0, x - more), max(0, y - more)), (min(wide, x + width + more), min(high, y + height + more))
        crop = (k * low[0], k * low[1], k * end[0], k * end[1])
        scene = self.scene.seen_by(replace(self.scene.camera, resolution=(k * wide, k * high)))
        if before and before.request.crop == crop:
            return before.following(scene)
        return Renderer(scene, self.settings.device, self.request.precision, ("id", "depth"), crop=crop)

    def shares(self) -> Shares:
        """Where the effects are in this one's region, worked out by bands of rows, to which as many rows belong above
        and below as lines reach."""
        effects, probe = self.composition.effects, self.probe
        assert effects
        assert probe
        (x, y, width, height), (left, top, _, _) = self.executor.region, probe.region
        k = probe.scene.camera.resolution[0] // self.scene.camera.resolution[0]
        more, last = effects.reach(k), (top + probe.region[3]) // k
        found, wholes = [], probe.scene.wholes
        rows = max(1, BAND // (k * k * width))
        for first in range(y, y + height, rows):
            end = min(first + rows, y + height)
            begin = max(top // k, first - more)
            image = probe.rows(k * begin, k * min(last, end + more)).render(progress=False)
            part = effects.shares(wholes[image.id], image.depth, k)
            here = (slice(first - begin, end - begin), slice(x - left // k, x - left // k + width))
            found.append([share[here] for share in part])
        line, fog = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return Shares(line, fog)


class Renderer:
    """A scene on a device: program and buffers are kept, so that each render() costs only the kernel and the readback.

    scene: what to draw, as load() or Scene makes it; device: a Device, or what --device takes on the command line, such
    as "cpu" or "0:1", None for the fastest CPU driver; precision: "accurate", "single" or "double", None for
    default_precision(), "double" in place of "accurate" where floats do not suffice for colours; outputs: one or more
    of rgb8, color, normal, direction, depth, id, primitive, uv, error, coverage, shadow_rays, work, rgba8 and alpha,
    which Image describes, and rgb8 brings rgba8 where the background has alpha; crop: (x0, y0, x1, y1), exactly those
    pixels of the whole picture, x1 and y1 excluded, None for all of it; truncate: whether a byte is 255 c cut to a
    whole number, instead of rounded to the nearest; width: pixels in a packet, 1, 4, 8 or 16, None for what is best on
    the device; antialias: whether colours are means over some rays of each pixel, see Image; samples: with
    antialias=True, how many rays a pixel has at most, 1, 4, 16, 32, 64, 256 or 1024, None for 32; outline: (color,
    width), lines of so many pixels where a surface ends before another one or before the background; fog: (color, near,
    far), the colour to which surfaces fade between these distances from the eye, in scene units: depth cueing. Both are
    made of exact ids and distances, of 16 rays a pixel with antialias, and where a crop ends they are as in the whole
    picture. Their colours are given as the background's is; without antialias, lines have an odd number of pixels.

    It has scene, device, precision, width, region, plan; seconds: what took how long, by "pack", "lists", "build" and
    "upload"; skipped: what the scene did not need. Several threads may use it: one renders while the others wait.

    Raises TypeError if scene is not a Scene or device is of another type, ValueError for any other argument that is not
    allowed, DeviceError if there is no such device, if it lacks double precision that is asked for, if its driver fails
    or has not enough memory, or in a forked process, BuildError if the kernel does not build, and TooSlowError if lists
    of lights take longer than a limit of seconds that was set.
    """

    def __init__(
        self,
        scene: Scene,
        device: str | Device | None = None,
        precision: Precision | None = None,
        outputs: tuple[Output, ...] = ("rgb8",),
        crop: Crop | None = None,
        truncate: bool = False,
        width: int | None = None,
        antialias: bool = False,
        keep: tuple[Keep, ...] = (),  # for the benchmark and tests, see Request; not part of the public interface
        samples: int | None = None,
        outline: tuple[Any, float] | None = None,
        fog: tuple[Any, float, float] | None = None,
    ) -> None:
        check_process()
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: must be a cltrace.Scene, such as cltrace.load() gives, got {scene!r}")
        at = device if isinstance(device, Device) else choose(device)
        if width is not None and (not is_whole(width) or width not in WIDTHS):
            raise ValueError(f"width: must be {', '.join(map(str, WIDTHS))} or None, got {width!r}")
        if at.kind == "cpu" and at.record in DRIVERS and (width or 0) > at.width:
            raise DeviceError(f"{at.name} has packets of {at.width} pixels at most: wider ones end the process")
        settings = _Settings(
            at, at.width if width is None else int(width), precision or default_precision(at), outputs, (outline, fog)
        )
        how: dict[str, Any] = {"crop": crop, "truncate": truncate, "keep": keep}
        how["samples"] = samples_of(antialias, samples)
        request = Request(settings.precision, outputs, **how)  # which refuses what are no outputs
        request = replace(request, outputs=settings.composition(scene, truncate).written)
        request = replace(request, precision=precision_for(scene, settings.precision))
        if request.precision != "single" and not at.has_double:
            raise DeviceError(
                f"{at.name} has no double precision, which --precision {request.precision} needs; "
                "use --precision single or another device"
            )
        start = time.perf_counter()
        world = ScenePacking.of(scene, request)
        self._lock, self._now = threading.Lock(), _Prepared.of(settings, scene, request, world, start)

    def look(self, camera: AnyCamera) -> Renderer:
        """The same scene, seen by another camera, as another Renderer with the same outputs, precision and crop.

        What no camera changes is kept, also on the device: the program, the order of the spheres and their materials.
        What depends on the eye is made again: coordinates, which are rounded from there, and the lists; of many spheres
        not those of lights at points. Raises TypeError if camera is no camera, ValueError if the crop is not within
        its picture, and DeviceError and BuildError as Renderer does.
        """
        return self.following(self.scene.seen_by(camera))

    def following(self, scene: Scene) -> Renderer:
        """Another Renderer of another scene, with the same outputs, precision and crop. This one stays as it is.

        What both scenes have is kept, also on the device: the program, arrays that are the same objects, and the order
        of the spheres while it is good. Another thread may render with this one meanwhile. Raises TypeError if scene is
        not a Scene, and else what Renderer raises.
        """
        check_process()
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: must be a cltrace.Scene, got {scene!r}")
        start, now = time.perf_counter(), self._now
        # Others are written where, say, only one of the two backgrounds is transparent.
        written = now.settings.composition(scene, now.request.truncate).written
        other = now.derived(scene, replace(now.request, outputs=written), start)
        with self._lock:
            # So the next camera finds what lights see, where numpy made this one's view and a device all later ones.
            if other.world is self._now.world and other.plan.request == self._now.plan.request:
                self._now = replace(self._now, packer=other.packer)
        return _DerivedRenderer(other)

    def cropped(self, crop: Crop | None) -> Renderer:
        """Another part of the same picture, as another Renderer; the world and the program are kept.

        Raises ValueError if the crop is not within the picture, and else what Renderer raises.
        """
        check_process()
        start, now = time.perf_counter(), self._now
        return _DerivedRenderer(now.derived(now.scene, replace(now.request, crop=crop), start))

    def rows(self, first: int, end: int) -> Renderer:
        """Rows of the picture that this one draws, before `end`, as another Renderer that makes nothing anew.

        Unlike cropped(), which makes lists for less, it costs nothing. Raises ValueError for rows that are not there.
        """
        x, y, width, height = self.region
        if not y <= first < end <= y + height:
            raise ValueError(f"rows: must be within {y}..{y + height} and not empty, got {first}, {end}")
        now, part = self._now, (x, first, width, end - first)
        # Its view stays the one of this request, by which derived() knows that it is of more than these rows.
        request = replace(now.request, crop=(x, first, x + width, end))
        return _DerivedRenderer(replace(now, request=request, executor=now.executor.part(part)))

    def update(
        self,
        centers: ArrayLike | None = None,
        radii: ArrayLike | None = None,
        colors: ArrayLike | None = None,
        *,
        values: ArrayLike | None = None,
        cmap: Any = None,
        clim: ArrayLike | None = None,
        norm: Any = None,
        ka: ArrayLike | None = None,
        kd: ArrayLike | None = None,
        ks: ArrayLike | None = None,
        exponent: ArrayLike | None = None,
        reflectance: ArrayLike | None = None,
        transmittance: ArrayLike | None = None,
        index: ArrayLike | None = None,
    ) -> Renderer:
        """Gives the scene's spheres other places, sizes or materials, and returns this Renderer.

        The arguments are those of Scene.from_spheres; what is None stays as it is, and so do camera, lights and meshes.
        Values have the map, the limits and the norm of those before, but for what is given of cmap, clim and norm.
        Where ka was not given at first, it follows kd. If `centers` are another number of spheres, all that is an array
        of as many as there were must be given, too. Radii of ellipsoids are those before their linear map.

        Only what the changes touch is made again: for materials alone no list, as long as light goes the same ways,
        and the order of the spheres in memory is kept while it is good. Renderers that look() has made stay as they
        are. Pictures are those of a new Renderer of the new `scene`, to the bit. An image of an earlier render() can
        still be handed to render().

        Raises ValueError as Scene.from_spheres does, and DeviceError and BuildError as Renderer does. Nothing is
        changed then.
        """
        given = {name: value for name, value in locals().items() if name != "self" and value is not None}
        check_process()
        with self._lock:
            start, now = time.perf_counter(), self._now
            other = now.derived(with_spheres(now.scene, given), now.request, start)
            self._now = replace(other, executor=other.executor.continuing(now.executor))
        return self

    @property
    def scene(self) -> Scene:
        """What is drawn."""
        return self._now.scene

    @property
    def device(self) -> Device:
        """Where it is drawn."""
        return self._now.settings.device

    @property
    def width(self) -> int:
        """Pixels in a packet."""
        return self._now.settings.width

    @property
    def plan(self) -> Plan:
        """What the device is given."""
        return self._now.plan

    @property
    def request(self) -> Request:
        """What is wanted of the scene."""
        return self._now.request

    @property
    def seconds(self) -> dict[str, float]:
        """What took how long, by "pack", "lists", "build" and "upload"."""
        return self._now.seconds

    @property
    def _executor(self) -> Executor:
        return self._now.executor

    @property
    def precision(self) -> Precision:
        """The precision that is used: accurate, single or double."""
        return self.request.precision

    @property
    def region(self) -> Region:
        """The part of the picture that is rendered: (x, y, width, height) in pixels of the whole picture."""
        return self._executor.region

    @property
    def bytes_a_pixel(self) -> int:
        """How much memory the outputs of a pixel take."""
        outputs = (OUTPUTS[name] for name in self.request.outputs)
        return sum(output.channels * dtype_of(output.type, self.precision).itemsize for output in outputs)

    @property
    def skipped(self) -> dict[str, int]:
        """What this scene did not need, in words, and how often."""
        return self.plan.skipped

    def __repr__(self) -> str:
        size, counts = "{2}x{3}".format(*self.region), f"{len(self.scene.columns)} spheres"
        if self.scene.meshes:
            counts += f", {len(self.scene.meshes)} meshes"
        return f"<cltrace.Renderer {size}: {counts}, {self.precision} precision, on {self.device.name}>"

    def __copy__(self) -> Renderer:
        return _DerivedRenderer(self._now)

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise TypeError(
            "a Renderer cannot be pickled, since its device's buffers stay with their process: pickle its scene, and "
            "make a Renderer of that where it arrives"
        )

    def render(self, out: Image | None = None, progress: bool | None = None) -> Image:
        """One frame, as an Image whose arrays have the region's height and width.

        out: an Image of an earlier render() of this Renderer, whose arrays are then written over, None for new ones;
        progress: whether tqdm shows it after a second, None for a terminal and notebooks, if tqdm is installed. Raises
        MissingPackageError if it is wanted and tqdm is missing, ValueError if `out` is no such image, TooManyRaysError
        if mirrors and glass make more than 2^20 rays of a pixel, TooSlowError if it takes longer than a limit of
        seconds that was set, and DeviceError if the driver fails or in a forked process. After an error, what `out`
        holds is undefined.
        """
        with bar(self.region[3], "row", progress) as shown:
            return self.draw(shown.update, out)

    def draw(self, drawn: Callable[[int], object], out: Image | None = None, until: float | None = None) -> Image:
        """As render(), but calls drawn(n) after every n rows, and drawn(0) after stop(); what that raises ends it.

        until: when it is given up, see Executor.draw().
        """
        check_process()
        with self._lock, driver_errors(self.device):
            executor = self._executor
            if out is not None and (
                not isinstance(out, Image) or getattr(out.frame, "owner", None) is not executor.room
            ):
                raise ValueError("out: must be an image that this Renderer has rendered")
            frame = executor.frame() if out is None else out.frame
            start = time.perf_counter()
            executor.draw(frame, drawn, until)
            done = time.perf_counter()
            arrays = executor.read(frame)
            end = time.perf_counter()
        return self._image(arrays, {"kernel": done - start, "readback": end - done}, frame)

    def stop(self) -> None:
        """Has a draw() of another thread call its `drawn` soon; if there is none, the next one."""
        self._executor.stop()

    def _image(
        self, arrays: dict[str, NDArray[Any]], seconds: dict[str, float], frame: FrameBuffers | None = None
    ) -> Image:
        """An Image of what the kernel has written."""
        now = self._now
        written = now.composition.with_effects(arrays, now.shares()) if now.probe else arrays
        found = now.composition.composed(written)
        return Image(**found, seconds=now.seconds | seconds, frame=frame, transfer=now.scene.transfer)

    def work(self) -> dict[str, int]:
        """How often a frame does what is worth counting, in words: renders it once more, with a kernel that counts.

        The keys are the texts of abi.COUNTERS. Raises TooManyRaysError and TooSlowError as render() does, and
        DeviceError and BuildError as Renderer does.
        """
        check_process()
        with self._lock, driver_errors(self.device):
            return self._executor.work()


class _DerivedRenderer(Renderer):
    """One that was derived from another one."""

    def __init__(self, prepared: _Prepared) -> None:
        self._lock, self._now = threading.Lock(), prepared


def render(
    scene: Scene,
    device: str | Device | None = None,
    precision: Precision | None = None,
    outputs: tuple[Output, ...] = ("rgb8",),
    crop: Crop | None = None,
    truncate: bool = False,
    progress: bool | None = None,
    antialias: bool = False,
    samples: int | None = None,
    outline: tuple[Any, float] | None = None,
    fog: tuple[Any, float, float] | None = None,
) -> Image:
    """One picture of a scene. The arguments and what is raised are those of Renderer and its render()."""
    how: dict[str, Any] = {"precision": precision, "outputs": outputs, "crop": crop, "truncate": truncate}
    how |= {"antialias": antialias, "samples": samples, "outline": outline, "fog": fog}
    return Renderer(scene, device, **how).render(progress=progress)


def strips(renderer: Renderer, progress: bool | None = None) -> Iterator[tuple[int, Image]]:
    """The picture of a renderer, as Images of some rows, each after their number: a multiple of STEP but for the last.

    A small picture is one Image. Where the memory of the device or of this process is too small, strips become smaller.
    They have one limit of seconds, which begins with the first one. progress: as of Renderer.render(), which says what
    is raised, too.
    """
    _, first, width, height = renderer.region
    end, rows = first + height, max(STEP, STRIP_BYTES // (width * renderer.bytes_a_pixel) // STEP * STEP)
    until = deadline()
    with bar(height, "row", progress) as shown:
        while first < end:
            last = min(first + rows, end)
            part = renderer if last - first == height else renderer.rows(first, last)
            try:
                image = part.draw(shown.update, until=until)
            except (OutOfMemoryError, MemoryError):
                if last - first <= STEP:
                    raise
                rows = max(STEP, (last - first) // (2 * STEP) * STEP)
            else:
                yield last - first, image
                first = last
