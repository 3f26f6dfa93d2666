"""What is measured: cltrace in each precision with and without what it skips, and the textbook's tracer."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.picture.image import Image, Output
from cltrace.plan.abi import Precision
from cltrace.plan.request import KEEPS, Keep
from cltrace.renderers.renderer import Renderer, default_precision
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, Scene

from .textbook import Textbook
from .truth import Answer, lamps

# The one of KEEPS that is an acceleration structure. The others are work that a scene does not need.
ACCELERATION: Keep = "lists"
SKIPS = tuple(name for name in KEEPS if name != ACCELERATION)

# Without lists every ray tries every surface. With more tests than this, a frame would take seconds.
MOST_TESTS = 1_000_000_000


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

    grows: whether the growth of its time with the scene is measured, as of all that are a point of view of their own.
    """

    name: str
    variant: str = ""
    device: str = ""
    grows: bool = False

    def refuses(self, scene: Scene) -> str:
        """Why this scene is not measured; empty if it is."""
        return ""

    @abstractmethod
    def run(self, scene: Scene, frames: int) -> Run:
        """Draws the scene so many times. A peer may raise PeerError."""

    def answer(self, scene: Scene) -> Answer | None:
        """All that it says of the pixels, row by row; None if it has only bytes."""
        return None


class Product(Tracer):
    """cltrace on a device. keep: what it does not skip; mode: device and precision, which alone decide the picture."""

    def __init__(self, device: Device, precision: Precision, keep: tuple[Keep, ...] = (), variant: str = "") -> None:
        self.on, self.precision, self.keep = device, precision, keep
        self.name, self.variant, self.device = precision, variant, device.label
        self.mode = (device.spec, precision)
        self.grows = precision == default_precision(device) and variant in ("", "no lists")

    def refuses(self, scene: Scene) -> str:
        return too_much(scene) if ACCELERATION in self.keep else ""

    def run(self, scene: Scene, frames: int) -> Run:
        start = time.perf_counter()
        renderer = Renderer(scene, self.on, self.precision, keep=self.keep)
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
        dull = [self._picture(lamp, "color", "normal", "depth", "id") for lamp in lamps(scene)]
        return answer_of(scene, self._picture(scene, "rgb8", "color"), dull)

    def _picture(self, scene: Scene, *outputs: Output) -> Image:
        return Renderer(scene, self.on, self.precision, outputs, keep=self.keep).render()


class Baseline(Tracer):
    """The textbook's tracer on a device."""

    name = "textbook"
    grows = True

    def __init__(self, device: Device) -> None:
        self._device, self.device = device, device.label

    def refuses(self, scene: Scene) -> str:
        return too_rich(scene) or too_much(scene)

    def run(self, scene: Scene, frames: int) -> Run:
        start = time.perf_counter()
        textbook = Textbook(scene, self._device)
        image = textbook.render("rgb8")
        whole = time.perf_counter() - start
        images = [image, *(textbook.render("rgb8") for _ in range(frames - 1))]
        return Run([image.frame_seconds for image in images], whole, image.rgb8)

    def answer(self, scene: Scene) -> Answer:
        dull = [Textbook(lamp, self._device).render("color", "normal", "depth", "id") for lamp in lamps(scene)]
        return answer_of(scene, Textbook(scene, self._device).render("rgb8", "color"), dull)


def too_much(scene: Scene) -> str:
    """Why a scene is not traced surface by surface; empty if it is."""
    tests = (len(scene.spheres) + scene.triangles) * math.prod(scene.camera.resolution)
    return f"{tests:.1g} tests a frame are too many" if tests > MOST_TESTS else ""


def too_rich(scene: Scene) -> str:
    """Why a scene is not handed to a tracer that knows only round opaque spheres of one colour; empty if it is."""
    used = scene.materials[np.unique(scene.spheres["material"])]
    has = {
        "meshes": bool(scene.meshes),
        "cylinders": bool(len(scene.cylinders)),
        "ellipsoids": bool((scene.spheres["to_object"] >= 0).any()),
        "textures": bool((used["texture"] >= 0).any()),
        "mirrors": bool((used["reflectance"] > 0).any()),
        "glass": bool((used["transmittance"] > 0).any()),
    }
    return ", ".join(name for name, there in has.items() if there)


def answer_of(scene: Scene, image: Image, dull: list[Image]) -> Answer:
    """What pictures of a scene and of its lamps() say of its pixels, row by row.

    image: rgb8 and color; dull: color, normal, depth and id.
    """
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
