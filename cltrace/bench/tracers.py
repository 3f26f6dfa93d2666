"""What a tracer is for the benchmark, and our own: cltrace in each precision, its means, soft lights and movements."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.picture.image import Output
from cltrace.plan.abi import Precision
from cltrace.plan.request import KEEPS, Keep
from cltrace.renderers.renderer import Renderer, default_precision
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, PARALLEL, POINT, Scene

from .scenes import Task
from .truth import Answer, answer_of

# The outputs of which errors are found.
JUDGED: tuple[Output, ...] = ("rgb8", "color", "depth", "id")
# Rays across a pixel of the curves of antialiasing, and those of programs whose curves take long.
ACROSS, FEW_ACROSS = (1, 2, 4, 8, 16), (1, 4, 16)
# From frame to frame the eye, or each sphere, moves by so much of the distance to the middle of all spheres.
STEP = 1e-3
# Without lists, every ray tries every surface: more tests than this would take seconds.
MOST_TESTS = 1_000_000_000
# A kind of has().
OTHER_LIGHTS = "other lights than points and parallel ones"


@dataclass(frozen=True)
class Run:
    """One measurement.

    frames: seconds of each frame, with readback; whole: seconds from the scene in memory to the first picture in
    memory, with everything compiled; rgb8: (h, w, 3), the last picture.
    """

    frames: list[float]
    whole: float
    rgb8: NDArray[np.uint8]


class BenchTracer(ABC):
    """Something that draws scenes.

    name, variant: by which tables and plots call it; task: what it is measured at; level: its place on a curve, rays
    across a pixel, None for none; version: of a program that is not ours; grows: whether the growth of its time with
    the scene is measured.
    """

    name: str
    variant: str = ""
    task: Task = "frame"
    level: int | None = None
    version: str = ""
    grows: bool = False

    @property
    def label(self) -> str:
        """The name with the variant and the place on a curve."""
        place = "" if self.level is None else str(self.level)
        return ", ".join(part for part in (self.name, f"{self.variant} {place}".strip()) if part)

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        """What this scene has for which it is not measured; empty if it is."""
        return ()

    @abstractmethod
    def run(self, scene: Scene, frames: int) -> Run:
        """Draws the scene so many times. A peer may raise PeerError."""

    def answer(self, scene: Scene) -> Answer | None:
        """All that it says of the pixels, row by row; None if it has only bytes."""
        return None

    def command(self, scene: Scene) -> list[str] | None:
        """Writes the scene's file, and gives the command of a process that makes a picture's file of it, if any."""
        return None


def has(scene: Scene, *kinds: str) -> tuple[str, ...]:
    """Which of these kinds of things, which few tracers draw, a scene has, by name."""
    m, lights = scene.materials, set(scene.lamps["kind"].tolist())
    found = {
        "cylinders": bool(len(scene.cylinders)),
        "ellipsoids": bool((scene.spheres["to_object"] >= 0).any()),
        "textures": bool((m["texture"] >= 0).any()),
        "mirrors": bool((m["reflectance"] > 0).any()),
        "glass": bool((m["transmittance"] > 0).any()),
        OTHER_LIGHTS: not lights <= {AMBIENT, PARALLEL, POINT},
    }
    return tuple(kind for kind in kinds if found[kind])


class Product(BenchTracer):
    """cltrace on a device. keep: names of KEEPS, what it does not skip.

    With the task "cameras" or "positions", frames are those of a camera, or of spheres, that moves: the seconds from a
    camera, or from centers in memory, to the picture in memory.
    """

    def __init__(
        self,
        device: Device,
        precision: Precision,
        task: Task = "frame",
        level: int | None = None,
        keep: tuple[Keep, ...] = (),
        variant: str = "",
    ) -> None:
        self.device, self.name, self.task, self.level, self.keep = device, precision, task, level, keep
        self.precision, self.variant = precision, variant or ("samples" if task == "samples" else "")
        self.grows = task == "frame" and not keep and precision == default_precision(device)

    def refuses(self, scene: Scene) -> tuple[str, ...]:
        tests = (len(scene.spheres) + scene.triangles) * math.prod(scene.camera.resolution)
        return ("too many tests without lists",) if "lists" in self.keep and tests > MOST_TESTS else ()

    def renderer(self, scene: Scene, *outputs: Output) -> Renderer:
        """What is measured, or, with outputs, one that has a program in common with as many scenes as can be."""
        means: dict[str, Any] = {"antialias": True, "samples": (self.level or 1) ** 2} if self.task == "samples" else {}
        keep: tuple[Keep, ...] = (*self.keep, "features") if outputs else self.keep
        return Renderer(scene, self.device, self.precision, outputs or ("rgb8",), keep=keep, **means)

    def run(self, scene: Scene, frames: int) -> Run:
        if self.task in ("cameras", "positions"):
            return self._run_moving(scene, frames)
        start = time.perf_counter()
        renderer = self.renderer(scene)
        image = renderer.render()
        whole = time.perf_counter() - start
        seconds = [image.frame_seconds]
        for _ in range(frames - 1):
            image = renderer.render(image)
            seconds.append(image.frame_seconds)
        return Run(seconds, whole, image.rgb8)

    def _run_moving(self, scene: Scene, frames: int) -> Run:
        """Each frame is a step towards the scene that is given, which is the last one."""
        eye = np.array(scene.camera.position)
        step = STEP * np.array([1, 0.5, 0.25]) * np.linalg.norm(scene.spheres["center"].mean(axis=0) - eye)
        start = time.perf_counter()
        renderer = self.renderer(moved(scene, self.task, frames * step))
        image = renderer.render()
        whole = time.perf_counter() - start
        seconds = []
        for left in range(frames - 1, -1, -1):
            later = moved(scene, self.task, left * step)
            places = later.spheres["center"]
            start = time.perf_counter()
            if self.task == "cameras":
                renderer = renderer.look(later.camera)
            else:
                renderer.update(centers=places)
            image = renderer.render()
            seconds.append(time.perf_counter() - start)
        return Run(seconds, whole, image.rgb8)

    def answer(self, scene: Scene) -> Answer:
        return answer_of(scene, lambda of: self.renderer(of, *JUDGED).render())


def moved(scene: Scene, task: Task, by: NDArray[np.float64]) -> Scene:
    """The scene with its camera, or with its spheres, moved by a vector (3,)."""
    if task == "cameras":
        camera = scene.camera
        position, lookat = (tuple((np.array(end) + by).tolist()) for end in (camera.position, camera.lookat))
        return scene.seen_by(replace(camera, position=position, lookat=lookat))
    spheres = scene.spheres.copy()
    spheres["center"] += by
    return replace(scene, spheres=spheres)


def own_tracers(device: Device, precisions: Sequence[Precision], quick: bool, stages: bool) -> list[BenchTracer]:
    """What is measured of ours: each precision, and of the first one the curve of antialiasing, and what moves.

    quick: only precisions; stages: also the first one without each of the stages that skip work, and without all.
    """
    best = precisions[0]
    out: list[BenchTracer] = [Product(device, precision) for precision in precisions]
    if stages:
        out += [Product(device, best, keep=(name,), variant=f"without {name}") for name in KEEPS]
        out.append(Product(device, best, keep=tuple(k for k in KEEPS if k != "lists"), variant="without all but lists"))
    if not quick:
        out += [Product(device, best, "samples", across) for across in ACROSS]
        out += [Product(device, best, "cameras"), Product(device, best, "positions")]
    return out
