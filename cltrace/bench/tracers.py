"""What is measured: cltrace in each precision, with and without what it skips; its antialiasing, its soft lights and
what moves; and the textbook's tracer.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cltrace.picture.image import Image, Output
from cltrace.plan.abi import Precision
from cltrace.plan.request import KEEPS, Keep
from cltrace.renderers.renderer import Renderer, default_precision
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, PARALLEL, POINT, Scene

from .scenes import Case, Task, soft_lights
from .textbook import Textbook
from .truth import Answer, lamps

# The one of KEEPS that is an acceleration structure. The others are work that a scene does not need.
ACCELERATION: Keep = "lists"
SKIPS = tuple(name for name in KEEPS if name != ACCELERATION)

# Without lists every ray tries every surface. With more tests than this, a frame would take seconds.
MOST_TESTS = 1_000_000_000

# What is more than spheres in perspective that only shade: kinds of strange().
BEYOND = "meshes", "cylinders", "ellipsoids", "textures", "mirrors", "glass", "orthographic cameras"
# A kind of strange().
OTHER_LIGHTS = "other lights than points and parallel ones"
# What errors are found in.
JUDGED: tuple[Output, ...] = ("rgb8", "color", "normal", "depth", "id")
# Rays across a pixel, and down, of the curves of antialiasing.
ACROSS = (1, 2, 4, 8, 16)
# The same of peers whose curves take long.
FEW_ACROSS = (1, 4, 16)
# Directions of the sky, and points of the panel, of the curve of soft light.
MEMBERS = (4, 16, 64, 256)
# By so much of the distance to the middle of all spheres the eye, or each sphere, moves from frame to frame.
STEP = 1e-3


@dataclass(frozen=True)
class Run:
    """One measurement.

    kernel: seconds of each frame, with readback; whole: seconds from the scene in memory to the first picture in
    memory, with everything compiled; rgb8: (h, w, 3), that picture; work: what the host has prepared for the device,
    equal where the device has the same work to do.
    """

    kernel: list[float]
    whole: float
    rgb8: NDArray[np.uint8]
    work: object = None


class Tracer(ABC):
    """Something that draws scenes. Tables and plots call it by name, variant and device.

    task: what it is measured at; level: its place on a curve, as rays across a pixel, or None; version: of a program
    that is not ours; grows: whether the growth of its time with the scene is measured, as of all that are a point of
    view of their own; afresh: whether each picture begins with nothing, so that the first is as good as any other.
    """

    name: str
    variant: str = ""
    device: str = ""
    task: Task = "frame"
    level: float | None = None
    version: str = ""
    grows: bool = False
    afresh: bool = False

    @property
    def mode(self) -> object:
        """What alone decides the picture."""
        return self.name, self.variant, self.device, self.level

    def draws(self, case: Case) -> bool:
        """Whether it is measured at what that case is for."""
        return case.task == self.task

    def command(self, scene: Scene) -> list[str] | None:
        """Writes the scene's file, and gives the command of a process that makes a picture's file of it, if any."""
        return None

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        """What this scene has for which it is not measured; empty if it is."""
        return ()

    @abstractmethod
    def run(self, scene: Scene, frames: int) -> Run:
        """Draws the scene so many times. A peer may raise PeerError."""

    def answer(self, scene: Scene) -> Answer | None:
        """All that it says of the pixels, row by row; None if it has only bytes."""
        return None


class Product(Tracer):
    """cltrace on a device. keep: what it does not skip."""

    def __init__(self, device: Device, precision: Precision, keep: tuple[Keep, ...] = (), variant: str = "") -> None:
        self.on, self.precision, self.keep = device, precision, keep
        self.name, self.variant, self.device = precision, variant, device.label
        self.grows = precision == default_precision(device) and variant in ("", "no lists")

    @property
    def mode(self) -> object:
        return self.on.spec, self.precision, self.task, self.variant if self.level else "", self.level

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        # What skips nothing has a large program for each kind, which takes longer to compile than to measure.
        beyond = strange(scene, *BEYOND) if self.keep == SKIPS else ()
        return beyond or (too_much(scene) if ACCELERATION in self.keep else ())

    def renderer(self, scene: Scene, *outputs: Output) -> Renderer:
        """What is measured, or, with outputs of which errors are found, one program for as many scenes as can be."""
        keep: tuple[Keep, ...] = (*self.keep, "features") if outputs else self.keep
        return Renderer(scene, self.on, self.precision, outputs or ("rgb8",), keep=keep)

    def run(self, scene: Scene, frames: int) -> Run:
        start = time.perf_counter()
        renderer = self.renderer(scene)
        image = renderer.render()
        whole = time.perf_counter() - start
        kernel = [image.frame_seconds]
        for _ in range(frames - 1):
            image = renderer.render(image)
            kernel.append(image.frame_seconds)
        plan = renderer.plan
        # Most differences show in the arrays' shapes. The order of the spheres and the bits of `unstopped` do not.
        shapes = {name: array.shape for name, array in plan.arrays.items()}
        values = [plan.arrays[name].tobytes() for name in ("id_of", "light_buffer")]
        work = plan.options(), plan.values["lights"], shapes, values
        return Run(kernel, whole, image.rgb8, work)

    def answer(self, scene: Scene) -> Answer:
        return answer_of(scene, *(self.renderer(of, *JUDGED).render() for of in (scene, *lamps(scene))))


class Smooth(Product):
    """cltrace's antialiasing: of level x level rays."""

    task: Task = "samples"

    def __init__(self, device: Device, precision: Precision, level: int) -> None:
        super().__init__(device, precision, (), "samples")
        self.level, self.grows, self._samples = level, False, level**2

    def renderer(self, scene: Scene, *outputs: Output) -> Renderer:
        return Renderer(scene, self.on, self.precision, outputs or ("rgb8",), antialias=True, samples=self._samples)


class Members(Product):
    """cltrace with soft lights of fewer members than the scene has."""

    task: Task = "members"

    def __init__(self, device: Device, precision: Precision, members: int) -> None:
        super().__init__(device, precision)
        self.level, self.grows = members, False

    def renderer(self, scene: Scene, *outputs: Output) -> Renderer:
        assert self.level
        return super().renderer(scene.lit_by(soft_lights(int(self.level))), *outputs)


class Moving(Product):
    """cltrace's way to the next picture. kernel: from a camera, or from centers in memory, to the picture in memory.

    Each frame is a step towards the scene that is given, which is the last one; whole: all of the first picture.
    """

    def __init__(self, device: Device, precision: Precision, task: Task) -> None:
        super().__init__(device, precision)
        self.task, self.grows = task, False

    def run(self, scene: Scene, frames: int) -> Run:
        centers, eye = scene.spheres["center"], np.array(scene.camera.position)
        step = STEP * np.array([1, 0.5, 0.25]) * np.linalg.norm(centers.mean(axis=0) - eye)
        start = time.perf_counter()
        renderer = self.renderer(moved(scene, self.task, frames * step))
        image = renderer.render()
        whole = time.perf_counter() - start
        kernel = []
        for left in range(frames - 1, -1, -1):
            later = moved(scene, self.task, left * step)
            places = later.spheres["center"]
            start = time.perf_counter()
            if self.task == "cameras":
                renderer = renderer.look(later.camera)
            else:
                renderer.update(centers=places)
            image = renderer.render()
            kernel.append(time.perf_counter() - start)
        return Run(kernel, whole, image.rgb8)


def moved(scene: Scene, task: Task, by: NDArray[np.float64]) -> Scene:
    """The scene with its camera, or with its spheres, moved by a vector (3,)."""
    if task == "cameras":
        camera = scene.camera
        ends = (np.array([camera.position, camera.lookat]) + by).tolist()
        return scene.seen_by(replace(camera, position=tuple(ends[0]), lookat=tuple(ends[1])))
    spheres = scene.spheres.copy()
    spheres["center"] += by
    return replace(scene, spheres=spheres)


class Baseline(Tracer):
    """The textbook's tracer on a device."""

    name = "textbook"
    grows = True

    def __init__(self, device: Device) -> None:
        self._device, self.device = device, device.label

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        return strange(scene, *BEYOND) or too_much(scene)

    def run(self, scene: Scene, frames: int) -> Run:
        start = time.perf_counter()
        textbook = Textbook(scene, self._device)
        image = textbook.render("rgb8")
        whole = time.perf_counter() - start
        images = [image, *(textbook.render("rgb8") for _ in range(frames - 1))]
        return Run([image.frame_seconds for image in images], whole, image.rgb8)

    def answer(self, scene: Scene) -> Answer:
        return answer_of(scene, *(Textbook(of, self._device).render(*JUDGED) for of in (scene, *lamps(scene))))


def configurations(device: Device, precisions: Sequence[Precision], quick: bool) -> list[Tracer]:
    """The tracers to measure on a device: each precision, and the textbook.

    The first of the precisions is also measured without acceleration and without skipping, at the curves of
    antialiasing and of soft light, and at what moves. quick: only without acceleration.
    """
    best = precisions[0]
    out: list[Tracer] = [Product(device, precision) for precision in precisions]
    out.append(Product(device, best, (ACCELERATION,), "no lists"))
    if quick:
        return [*out, Baseline(device)]
    out.append(Product(device, best, SKIPS, "no skipping"))
    out += [Smooth(device, best, level) for level in ACROSS]
    out += [Members(device, best, members) for members in MEMBERS]
    out += [Moving(device, best, "cameras"), Moving(device, best, "positions")]
    return [*out, Baseline(device)]


def too_much(scene: Scene) -> tuple[str, ...]:
    """Why a scene is not traced surface by surface; empty if it is."""
    tests = (len(scene.spheres) + scene.triangles) * math.prod(scene.camera.resolution)
    return (f"{tests:.1g} tests a frame are too many",) if tests > MOST_TESTS else ()


def strange(scene: Scene, *kinds: str) -> tuple[str, ...]:
    """Which of these kinds of things, that few tracers draw, a scene has, by name."""
    m, lights = scene.materials, set(scene.lamps["kind"].tolist())
    has = {
        "spheres": bool(len(scene.spheres)),
        "meshes": bool(scene.meshes),
        "cylinders": bool(len(scene.cylinders)),
        "ellipsoids": bool((scene.spheres["to_object"] >= 0).any()),
        "textures": bool((m["texture"] >= 0).any()),
        "mirrors": bool((m["reflectance"] > 0).any()),
        "glass": bool((m["transmittance"] > 0).any()),
        "orthographic cameras": scene.camera.parallel,
        OTHER_LIGHTS: not lights <= {AMBIENT, PARALLEL, POINT},
        "materials that differ in more than colour": any(
            (m[name] != m[name][0]).any() for name in ("ka", "kd", "ks", "exponent")
        ),
    }
    return tuple(kind for kind in kinds if has[kind])


def answer_of(scene: Scene, image: Image, *dull: Image) -> Answer:
    """What pictures of a scene and of its lamps(), with the outputs JUDGED, say of its pixels, row by row."""
    first = dull[0]
    count = int((scene.lamps["kind"] != AMBIENT).sum())
    light = np.concatenate([np.asarray(lamp.color).reshape(-1, 3) for lamp in dull], axis=1)[:, :count]
    return Answer(
        id=first.id.ravel(),
        depth=first.depth.ravel(),
        normal=np.asarray(first.normal).reshape(-1, 3),
        lit=light > 0,
        light=light,
        color=np.asarray(image.color).reshape(-1, 3),
        rgb8=image.rgb8.reshape(-1, 3),
    )
