"""The front door: a scene goes through plan and run, and comes out as an Image."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from copy import copy
from dataclasses import fields, replace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.errors import DeviceError
from cltrace.picture.composition import Composition
from cltrace.picture.image import Image, Output
from cltrace.plan.abi import Precision
from cltrace.plan.plan import Before, Plan, View, World
from cltrace.plan.request import Crop, Keep, Region, Request
from cltrace.progress import bar
from cltrace.run.devices import Device, check_process, choose, is_all
from cltrace.run.executor import WIDTHS, Executor, Frame
from cltrace.run.maker import Maker, loading, maker_of, order_on
from cltrace.scene import AnyCamera, Scene, colors_given, with_spheres


def levels_of(antialias: bool | float) -> float | None:
    """The levels of 255 that Request wants for this argument of Renderer."""
    if isinstance(antialias, (bool, np.bool_)):
        return 1.0 if antialias else None
    if not isinstance(antialias, (int, float, np.integer, np.floating)):
        raise ValueError(f"antialias: must be True, False or levels of 255, above 0, got {antialias!r}")
    return float(antialias)


def default_precision(device: Device) -> Precision:
    """What a device renders in if nothing else is asked for: accurate if it has double precision, else single."""
    return "accurate" if device.has_double else "single"


class Renderer:
    """A scene on a device: program and buffers are kept, so that each render() costs only the kernel and the readback.

    scene: what to draw, as load() or Scene makes it; device: a Device, or what --device takes on the command line, such
    as "cpu" or "0:1", None for the fastest CPU driver; precision: "accurate", "single" or "double", None for
    default_precision(); outputs: one or more of rgb8, color, normal, direction, depth, id, primitive, uv, error,
    coverage, shadow_rays, work, rgba8 and alpha, which Image describes, and rgb8 brings rgba8 where the background has
    alpha; crop: (x0, y0, x1, y1), exactly those pixels of the whole picture, x1 and y1 excluded, None for all of it;
    truncate: whether a byte is 255 c cut to a whole number, instead of rounded to the nearest; width: pixels in a
    packet, 1, 4, 8 or 16, None for what is best on the device; antialias: whether colours are means over pixels, with
    an error of 1 level of 255 or of as many as this says, but for a few pixels, see Image; keep: what not to skip, for
    measuring, see Request.

    It has scene, device, precision, width, region, plan; seconds: what took how long, by "pack", "lists", "build" and
    "upload"; skipped: what the scene did not need. Several threads may use it: one renders while the others wait.

    Raises TypeError if scene is not a Scene or device is of another type, ValueError for any other argument that is not
    allowed, DeviceError if there is no such device, if it lacks double precision that is asked for, if its driver fails
    or has not enough memory, or in a forked process, and BuildError if the kernel does not build.
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
        antialias: bool | float = False,
        keep: tuple[Keep, ...] = (),
    ) -> None:
        check_process()
        if not isinstance(scene, Scene):
            raise TypeError(f"scene: must be a cltrace.Scene, such as cltrace.load() gives, got {scene!r}")
        self.device = device if isinstance(device, Device) else choose(device)
        self._asked = outputs
        self._composition = Composition.of(outputs, scene, truncate)
        wanted, levels = self._composition.written, levels_of(antialias)
        self.request = Request(precision or default_precision(self.device), wanted, crop, truncate, levels, keep)
        if self.precision != "single" and not self.device.has_double:
            raise DeviceError(
                f"{self.device.name} has no double precision, which --precision {self.precision} needs; "
                "use --precision single or another device"
            )
        self.width = self.device.width if width is None else width
        if not isinstance(self.width, int) or isinstance(self.width, bool) or self.width not in WIDTHS:
            raise ValueError(f"width: must be {', '.join(map(str, WIDTHS))} or None, got {width!r}")
        start = time.perf_counter()
        self._lock = threading.Lock()
        wait = loading(scene, self.request, self.device)
        order_of = order_on(self.device, len(scene.columns), self.precision)
        self._world = World.of(scene, self.request, None, order_of)
        wait()
        self._maker: Maker | None = None
        self._see(scene, start)

    def look(self, camera: AnyCamera) -> Renderer:
        """The same scene, seen by another camera, as another Renderer with the same outputs, precision and crop.

        What no camera changes is kept, also on the device: the program, the order of the spheres and their materials.
        What depends on the eye is made again: coordinates, which are rounded from there, and the lists; of many spheres
        not those of lights at points. Raises TypeError if camera is not a Camera, ValueError if the crop is not within
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
        composition = Composition.of(self._asked, scene, self.request.truncate)
        if composition.written != self._composition.written:  # as where only one background is transparent
            asked, levels = self.request, self.request.antialias
            how = self.precision, self._asked, asked.crop, asked.truncate, self.width, levels or False
            return Renderer(scene, self.device, *how, asked.keep)  # type: ignore[arg-type]
        with self._lock:
            other = copy(self)
        other._composition = composition
        other._follow(scene, start)
        return other

    def cropped(self, crop: Crop | None) -> Renderer:
        """Another part of the same picture, as another Renderer; the world and the program are kept.

        Raises ValueError if the crop is not within the picture, and else what Renderer raises.
        """
        check_process()
        start = time.perf_counter()
        with self._lock:
            other = copy(self)
        other.request, other._maker = replace(self.request, crop=crop), None
        other._see(self.scene, start, self._executor)
        other._executor.know(self._executor)
        return other

    def rows(self, first: int, end: int) -> Renderer:
        """Rows of the picture that this one draws, before `end`, as another Renderer that makes nothing anew.

        Unlike cropped(), which makes lists for less, it costs nothing. Raises ValueError for rows that are not there.
        """
        x, y, width, height = self.region
        if not y <= first < end <= y + height:
            raise ValueError(f"rows: must be within {y}..{y + height} and not empty, got {first}, {end}")
        with self._lock:
            other = copy(self)
        other.request, other._maker = replace(self.request, crop=(x, first, x + width, end)), None
        other._executor = self._executor.of((x, first, width, end - first))
        return other

    def on(self, device: Device) -> Renderer:
        """The same picture on another device, as another Renderer; the world is shared, and the view if numpy made it.

        Raises what Renderer raises.
        """
        check_process()
        start = time.perf_counter()
        with self._lock:
            other = copy(self)
        other.device, other.width, other._maker = device, device.width, None
        if self._maker or maker_of(self._world, self.request, device):
            other._see(self.scene, start)
        else:
            other._executor = Executor(self.plan, device, device.width)
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
        cmap and clim go with values; those of earlier values are not remembered.
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
        n = len(self.scene.columns if centers is None else np.atleast_1d(centers))
        shown = colors_given(n, colors, values, cmap, clim)
        places = {"centers": centers, "radii": radii, "colors": shown, "ka": ka, "kd": kd, "ks": ks}
        others = {"exponent": exponent, "reflectance": reflectance, "transmittance": transmittance, "index": index}
        given = {name: value for name, value in (places | others).items() if value is not None}
        with self._lock:
            start = time.perf_counter()
            other = copy(self)
            other._follow(with_spheres(self.scene, given), start)
            other._executor.take_over(self._executor)
            self.__dict__.update(other.__dict__ | {"_lock": self._lock})
        return self

    def _follow(self, scene: Scene, start: float) -> None:
        """Becomes a Renderer of another scene, and leaves alone what it shares with a copy. start: see _see()."""
        old, world, executor, view = self.scene, self._world, self._executor, None
        anew = _is_seen_anew(old, scene)
        if not anew:
            alike = (len(old.meshes), bool(old.textures)) == (len(scene.meshes), bool(scene.textures))
            order_of = order_on(self.device, len(scene.columns), self.precision)
            self._world = World.of(scene, self.request, Before(old, world) if alike else None, order_of)
            if alike and scene.camera == old.camera and self._world.differs_in_materials(world):
                view = self._view
        self._see(scene, start, executor, view)
        if anew:
            self._executor.know(executor)

    def _see(self, scene: Scene, start: float, before: Executor | None = None, view: View | None = None) -> None:
        """Makes plan and executor for a scene.

        start: time.perf_counter() when the work began; before: see Executor; view: of a world that differs in materials
        alone from this one.
        """
        self.scene = scene
        if view:
            self._view = replace(view.recolored(self._world, self.request), seconds={})
        else:
            if self._maker is None or not self._maker.fits(self._world):
                self._maker = maker_of(self._world, self.request, self.device, self._maker)
            if self._maker:
                self._view, self._made = self._maker.view(self._world, scene.camera)
            else:
                self._view, self._made = View.of(self._world, scene.camera, self.request), {}
        self.plan = Plan.of(self._world, self._view, self.request)
        packed = time.perf_counter() - start
        self._executor = Executor(self.plan, self.device, self.width, before, self._made)
        seconds = self.plan.seconds if before else self._world.seconds | self.plan.seconds
        self.seconds = {"pack": packed - sum(seconds.values()), **seconds, **self._executor.seconds}

    @property
    def precision(self) -> Precision:
        """The precision that is used: accurate, single or double."""
        return self.request.precision

    @property
    def region(self) -> Region:
        """The part of the picture that is rendered: (x, y, width, height) in pixels of the whole picture."""
        return self._executor.region

    @property
    def skipped(self) -> dict[str, int]:
        """What this scene did not need, in words, and how often."""
        return self.plan.skipped

    @property
    def place(self) -> str:
        """Where it is rendered, for messages and statistics."""
        return self.device.name

    def __repr__(self) -> str:
        size, counts = "{2}x{3}".format(*self.region), f"{len(self.scene.columns)} spheres"
        if self.scene.meshes:
            counts += f", {len(self.scene.meshes)} meshes"
        return f"<cltrace.Renderer {size}: {counts}, {self.precision} precision, on {self.place}>"

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
        if mirrors and glass make more than 2^20 rays of a pixel, and DeviceError if the driver fails or in a forked
        process. What `out` holds after an error is undefined.
        """
        with bar(self.region[3], "row", progress) as shown:
            return self.draw(shown.update, out)

    def draw(self, drawn: Callable[[int], object], out: Image | None = None) -> Image:
        """As render(), but calls drawn(n) after every n rows; what that raises ends it."""
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

    def _image(self, arrays: dict[str, NDArray[Any]], seconds: dict[str, float], frame: Frame | None = None) -> Image:
        """An Image of what the kernel has written."""
        found = self._composition.composed(arrays)
        return Image(**found, seconds=self.seconds | seconds, frame=frame, transfer=self.scene.transfer)

    def work(self) -> dict[str, int]:
        """How often a frame does what is worth counting, in words: renders it once more, with a kernel that counts.

        The keys are the texts of abi.COUNTERS. Raises TooManyRaysError as render() does, and DeviceError and BuildError
        as Renderer does.
        """
        check_process()
        with self._lock, self._executor.driver_errors():
            return self._executor.work()


def _is_seen_anew(old: Scene, new: Scene) -> bool:
    """Whether two scenes share all but the camera."""
    names = {f.name for f in fields(Scene)} - {"camera", "output_file", "source", "spheres", "materials"}
    return all(getattr(old, name) is getattr(new, name) for name in ("columns", *names))


def render(
    scene: Scene,
    device: str | Device | None = None,
    precision: Precision | None = None,
    outputs: tuple[Output, ...] = ("rgb8",),
    crop: Crop | None = None,
    truncate: bool = False,
    progress: bool | None = None,
    antialias: bool | float = False,
) -> Image:
    """One picture of a scene. The arguments and what is raised are those of Renderer and its render().

    device: may also be "all", for all devices of this machine together. In accurate and double, the bytes are those of
    one device.
    """
    how: dict[str, Any] = {"precision": precision, "outputs": outputs, "crop": crop, "truncate": truncate}
    if is_all(device):
        from cltrace.joint import Joint

        return Joint(scene, **how, antialias=antialias).render(progress=progress)
    return Renderer(scene, device, **how, antialias=antialias).render(progress=progress)
