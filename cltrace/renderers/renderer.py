"""The front door: a scene goes through plan and run, and comes out as an Image."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.errors import DeviceError
from cltrace.base.limits import MAX_PIXELS, MAX_SIDE
from cltrace.base.progress import bar
from cltrace.base.waiting import Stopwatch
from cltrace.picture.composition import Composition
from cltrace.picture.effects import Effects, Shares
from cltrace.picture.image import Image, Output
from cltrace.plan.abi import Precision
from cltrace.plan.passes import passes_of
from cltrace.plan.plan import Plan
from cltrace.plan.precision import precision_for
from cltrace.plan.request import WIDTHS, Crop, Keep, Region, Request, is_whole
from cltrace.plan.view import View
from cltrace.plan.world import Before, World
from cltrace.run.devices import Device, check_process, choose
from cltrace.run.executor import Executor, Frame, Made, bytes_a_pixel
from cltrace.run.pack.packers import Packer, loading, packer_of
from cltrace.run.trial import check_driver
from cltrace.scene import AnyCamera, Scene, share_all_but_camera, with_spheres

# How many samples antialias=True takes.
SAMPLES = 32
# Along how many rays a side of a pixel the ends of surfaces are looked for with antialiasing: the most that fit into a
# finer picture of so many pixels.
PROBES, PROBED = (4, 2), 2**28
# So many of these rays are traced at a time, which bounds the memory that they take.
BAND = 2**22


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
    of a small file's lights take longer than half of the limit of seconds.
    """

    scene: Scene
    plan: Plan
    seconds: dict[str, float]
    _world: World
    _view: View
    _made: dict[str, Any]  # the buffers that the view's arrays lack
    _packer: Packer | None  # None where the view came from another device
    _executor: Executor
    _probe: Renderer | None  # what draws the surfaces that effects are made of

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
        self.device = device if isinstance(device, Device) else choose(device)
        self._asked, self._effects = outputs, (outline, fog)
        self._composition = self._composition_of(scene, truncate)
        self._chosen = precision or default_precision(self.device)
        how: dict[str, Any] = {"crop": crop, "truncate": truncate, "keep": keep}
        how["samples"] = samples_of(antialias, samples)
        request = Request(self._chosen, self._composition.written, **how)
        self.request = replace(request, precision=precision_for(scene, self._chosen))
        if self.precision != "single" and not self.device.has_double:
            raise DeviceError(
                f"{self.device.name} has no double precision, which --precision {self.precision} needs; "
                "use --precision single or another device"
            )
        self._asked_width = width
        if width is not None and (not is_whole(width) or width not in WIDTHS):
            raise ValueError(f"width: must be {', '.join(map(str, WIDTHS))} or None, got {width!r}")
        self.width = self.device.width if width is None else int(width)
        check_driver(self.device, self.width)
        start = time.perf_counter()
        self._lock = threading.Lock()
        wait = loading(scene, self.request, self.device)
        self._world = World.of(scene, self.request)
        wait()
        self.scene = scene
        self._see(start)

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
        start = time.perf_counter()
        # Others are written where, say, only one of the two backgrounds is transparent.
        written = self._composition_of(scene, self.request.truncate).written
        other = self._now()._derived(scene, replace(self.request, outputs=written), self.device, start)
        with self._lock:
            # So the next camera finds what lights see, where numpy made this one's view and a device all later ones.
            if other._world is self._world and other.plan.request == self.plan.request:
                self._packer = other._packer
        return other

    def cropped(self, crop: Crop | None) -> Renderer:
        """Another part of the same picture, as another Renderer; the world and the program are kept.

        Raises ValueError if the crop is not within the picture, and else what Renderer raises.
        """
        check_process()
        start = time.perf_counter()
        now = self._now()
        return now._derived(now.scene, replace(self.request, crop=crop), self.device, start)

    def rows(self, first: int, end: int, watch: Stopwatch | None = None) -> Renderer:
        """Rows of the picture that this one draws, before `end`, as another Renderer that makes nothing anew.

        Unlike cropped(), which makes lists for less, it costs nothing. watch: where all rows of the picture together
        have one limit of seconds. Raises ValueError for rows that are not there.
        """
        x, y, width, height = self.region
        if not y <= first < end <= y + height:
            raise ValueError(f"rows: must be within {y}..{y + height} and not empty, got {first}, {end}")
        other = self._now()
        # Its view stays the one of this request, by which _derived() knows that it is of more than these rows.
        other.request = replace(self.request, crop=(x, first, x + width, end))
        other._executor = other._executor.of((x, first, width, end - first), watch)
        return other

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
        check_process()
        places = {"centers": centers, "radii": radii, "ka": ka, "kd": kd, "ks": ks}
        places |= {"colors": colors, "values": values, "cmap": cmap, "clim": clim, "norm": norm}
        others = {"exponent": exponent, "reflectance": reflectance, "transmittance": transmittance, "index": index}
        given = {name: value for name, value in (places | others).items() if value is not None}
        with self._lock:
            start = time.perf_counter()
            other = self._derived(with_spheres(self.scene, given), self.request, self.device, start)
            other._executor.take_over(self._executor)
            self.__dict__.update(other.__dict__ | {"_lock": self._lock})
        return self

    def _now(self) -> Renderer:
        """A copy, which stays as this one is now while other threads draw with this one, or update it."""
        with self._lock:
            return copy(self)

    def _derived(self, scene: Scene, request: Request, device: Device, start: float) -> Renderer:
        """Another Renderer, of another scene, crop or device: what holds for it, too, is shared by identity.

        The world: if all but the camera is the same object, and else, for the same outputs, what World.of() finds in
        it. The view: see
        _view_of(), for the same request, which differs from that of the plan after rows(); on another device only if
        numpy made all of it. The packer: for the same request and device, while it fits. Buffers of arrays that are the
        same objects, and what is known of triangles of the same world: on the same device. start: time.perf_counter()
        when the work began.
        """
        shared = share_all_but_camera(self.scene, scene)
        if not shared or scene.camera.max_bounces != self.scene.camera.max_bounces:
            request = replace(request, precision=precision_for(scene, self._chosen))
        other = copy(self)
        other.scene, other.request = scene, request
        other._composition = self._composition_of(scene, request.truncate)
        if device is not self.device:
            other.device, other.width = device, self._asked_width or device.width
            check_driver(device, other.width)
        same_precision = request.precision == self.precision
        if not same_precision or not shared:
            old = self.scene
            alike = (len(old.meshes), bool(old.textures)) == (len(scene.meshes), bool(scene.textures))
            alike = alike and same_precision and request.outputs == self.request.outputs
            before = Before(old, self._world) if alike else None
            other._world = World.of(scene, request, before)
        other._see(start, self)
        return other

    def _composition_of(self, scene: Scene, truncate: bool) -> Composition:
        """How images of a scene are made."""
        return Composition.of(self._asked, scene, truncate, Effects.of(*self._effects, scene.transfer))

    def _probe_of(self, before: Renderer | None) -> Renderer | None:
        """What draws the surfaces that effects are made of: with antialiasing, as many pixels as fit of PROBES a side.

        They reach beyond the region as far as lines do. before: of the Renderer that this one is derived from.
        """
        effects, (x, y, width, height) = self._composition.effects, self.region
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
        if before and before.device is self.device and before.request.crop == crop:
            return before.following(scene)
        return Renderer(scene, self.device, self.precision, ("id", "depth"), crop=crop)

    def _shares(self) -> Shares:
        """Where the effects are in this one's region, worked out by bands of rows, to which as many rows belong above
        and below as lines reach."""
        effects, probe = self._composition.effects, self._probe
        assert effects
        assert probe
        (x, y, width, height), (left, top, _, _) = self.region, probe.region
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

    def _see(self, start: float, before: Renderer | None = None) -> None:
        """Makes view, plan and executor. before, start: what this one is derived from, and when, see _derived()."""
        near = before if before and before.device is self.device else None
        known = before if before and before.plan.request == self.request and (near or not before._made) else None
        worlds = passes_of(self._world, self.request)
        if len(worlds) == 1 and known and (view := known._view_of(self._world, self.scene.camera)):
            self._view, self._made, self._packer = view, known._made, known._packer if near else None
        else:
            packer = known._packer if known and near else None
            if packer is None or not packer.fits(self._world):
                kept, again = (near._packer, near._world is self._world) if near else (None, False)
                packer = packer_of(self._world, self.request, self.device, kept, again)
            self._packer = packer
            self._view, self._made = packer.view(worlds[0], self.scene.camera, keep=len(worlds) == 1)
        self.plan = Plan.of(self._world, self._view, self.request)
        packed = time.perf_counter() - start
        further = [self._pass_of(world) for world in worlds[1:]]
        made = self.plan, self._made
        self._executor = Executor(made, self.device, self.width, near._executor if near else None, further)
        if near and near._world is self._world:
            self._executor.know(near._executor)
        self._probe = self._probe_of(before._probe if before else None)
        seconds = self.plan.seconds if before else self._world.seconds | self.plan.seconds
        self.seconds = {"pack": packed - sum(seconds.values()), **seconds, **self._executor.seconds}

    def _pass_of(self, some: World) -> Callable[[], Made]:
        """What makes the plan of the pass that adds the lights of `some`, and its buffers."""
        world, packer, camera, request = self._world, self._packer, self.scene.camera, self.request

        def make() -> Made:
            assert packer is not None
            view, made = packer.view(some, camera, keep=False)
            return Plan.of(world, view, request), made

        return make

    def _view_of(self, world: World, camera: AnyCamera) -> View | None:
        """This one's view if it is that of a world and a camera, but for materials; else None."""
        if camera != self.scene.camera:
            return None
        if world is self._world:
            return replace(self._view, seconds={})
        if world.differs_in_materials(self._world):
            return replace(self._view.recolored(world, self.plan.request), seconds={})
        return None

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
        return bytes_a_pixel(self.request.outputs, self.precision)

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
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__, _lock=threading.Lock())
        return other

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
        if mirrors and glass make more than 2^20 rays of a pixel, TooSlowError if it takes longer than the limit of
        seconds, and DeviceError if the driver fails or in a forked process. What `out` holds after an error is
        undefined.
        """
        with bar(self.region[3], "row", progress) as shown:
            return self.draw(shown.update, out)

    def draw(self, drawn: Callable[[int], object], out: Image | None = None) -> Image:
        """As render(), but calls drawn(n) after every n rows, and drawn(0) after stop(); what that raises ends it."""
        check_process()
        with self._lock, (executor := self._executor).driver_errors():
            if out is not None and (
                not isinstance(out, Image) or getattr(out.frame, "owner", None) is not executor.room
            ):
                raise ValueError("out: must be an image that this Renderer has rendered")
            frame = executor.frame() if out is None else out.frame
            start = time.perf_counter()
            executor.draw(frame, drawn)
            done = time.perf_counter()
            arrays = executor.read(frame)
            end = time.perf_counter()
        return self._image(arrays, {"kernel": done - start, "readback": end - done}, frame)

    def stop(self) -> None:
        """Has a draw() of another thread call its `drawn` soon; if there is none, the next one."""
        self._executor.stop()

    def _image(self, arrays: dict[str, NDArray[Any]], seconds: dict[str, float], frame: Frame | None = None) -> Image:
        """An Image of what the kernel has written."""
        written = self._composition.with_effects(arrays, self._shares()) if self._probe else arrays
        found = self._composition.composed(written)
        return Image(**found, seconds=self.seconds | seconds, frame=frame, transfer=self.scene.transfer)

    def work(self) -> dict[str, int]:
        """How often a frame does what is worth counting, in words: renders it once more, with a kernel that counts.

        The keys are the texts of abi.COUNTERS. Raises TooManyRaysError and TooSlowError as render() does, and
        DeviceError and BuildError as Renderer does.
        """
        check_process()
        with self._lock, self._executor.driver_errors():
            return self._executor.work()


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
