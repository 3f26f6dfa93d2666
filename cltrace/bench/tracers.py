"""What is measured: cltrace in each precision with and without what it skips, the textbook's tracer, and the peers."""

from __future__ import annotations

import contextlib
import json
import math
import re
import shutil
import struct
import subprocess
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture

from cltrace.base.arrays import processors
from cltrace.picture.image import Image, Output
from cltrace.plan.abi import Precision
from cltrace.plan.request import KEEPS, Keep
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, POINT, Scene

from .textbook import Textbook
from .truth import Answer, lamps

# The one of KEEPS that is an acceleration structure. The others are work that a scene does not need.
ACCELERATION: Keep = "lists"
SKIPS = tuple(name for name in KEEPS if name != ACCELERATION)

# Without lists every ray tries every surface. With more tests than this, a frame would take seconds.
MOST_TESTS = 1_000_000_000

PEER_SECONDS = 120


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
    """Something that draws scenes. Tables and plots call it by name, variant and device."""

    name: str
    variant: str = ""
    device: str = ""

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


# ------------------------------------------------------------------------------------------------------------- peers


def _one_light(scene: Scene) -> str:
    """Why a scene cannot be handed to the peers; empty if it can. Embree's program knows one kind of scene."""
    lights = _shining(scene)
    used = scene.materials[np.unique(scene.spheres["material"])]
    if len(lights) != 1 or lights["kind"][0] != POINT or (lights["color"] != 1).any():
        return "not one white point light"
    if not len(used) or any((used[name] != used[name][0]).any() for name in ("ka", "kd", "ks", "exponent")):
        return "materials that differ"
    if used["exponent"][0] != 50 or (used["ka"][0] > 0 and (_ambient(scene) != 1).any()):
        return "another exponent than 50, or another ambient light than 1"
    return ""


def _shining(scene: Scene) -> NDArray[np.void]:
    """The lights that are neither ambient nor black."""
    lights: NDArray[np.void] = scene.lamps[(scene.lamps["kind"] != AMBIENT) & scene.lamps["color"].any(axis=1)]
    return lights


def _ambient(scene: Scene) -> NDArray[np.float64]:
    total: NDArray[np.float64] = scene.lamps["color"][scene.lamps["kind"] == AMBIENT].sum(axis=0)
    return total


def _seen_from_the_eye(scene: Scene, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) in camera space: what a careful user of a float32 tracer hands over."""
    moved: NDArray[np.float64] = (points - np.array(scene.camera.position)) @ np.array(scene.camera.basis()).T
    return moved


class _Peer(Tracer):
    """A program that reads a scene from a file, which is written once for each scene."""

    def __init__(self, program: str, folder: Path) -> None:
        self._program, self._folder = program, folder
        self._scene: Scene | None = None

    def refuses(self, scene: Scene) -> str:
        return too_rich(scene) or _one_light(scene)

    def _file(self, scene: Scene, suffix: str) -> Path:
        path = self._folder / f"scene{suffix}"
        if self._scene is not scene:
            self._scene = None
            self._write(scene, path)
            self._scene = scene
        return path

    @abstractmethod
    def _write(self, scene: Scene, path: Path) -> None: ...


class Embree(_Peer):
    """Embree's spheres in float32, as packets of 16 or as single rays, whichever is faster.

    The program is called with a scene as _write() makes it, a number of frames, and a file for the picture's bytes. It
    prints {"best_ms": milliseconds of the best frame, "build_ms": of building the tree}. whole: both together.
    """

    name = "Embree"

    def run(self, scene: Scene, frames: int) -> Run:
        path, out = self._file(scene, ".bin"), self._folder / "embree.rgb"
        done = _call([self._program, str(path), str(frames), str(out)])
        width, height = scene.camera.resolution
        with _understood(self._program):
            report = json.loads(done.stdout)
            best, build = _seconds(report["best_ms"]) / 1e3, _seconds(report["build_ms"]) / 1e3
            rgb8 = np.fromfile(out, np.uint8).reshape(height, width, 3)
        return Run([best], best + build, rgb8)

    def _write(self, scene: Scene, path: Path) -> None:
        """Size, count, image plane, light, background, ka, kd, ks; (x, y, z, r) of all spheres; (r, g, b, 1)."""
        width, height = scene.camera.resolution
        spheres, material = scene.spheres, scene.materials[scene.spheres["material"]]
        head = (
            *scene.camera.image_plane(),
            *_seen_from_the_eye(scene, _shining(scene)["position"])[0],
            *scene.background,
            *(material[name][0] for name in ("ka", "kd", "ks")),
        )
        centers = _seen_from_the_eye(scene, spheres["center"])
        colors = np.column_stack([material["color"], np.ones(len(spheres))])
        with path.open("wb") as file:
            file.write(struct.pack("<3i11f", width, height, len(spheres), *head))
            file.write(np.column_stack([centers, spheres["radius"]]).astype("<f4").tobytes())
            file.write(colors.astype("<f4").tobytes())


class PovRay(_Peer):
    """POV-Ray. kernel: what it calls trace time; whole: the whole process, which reads the scene and writes a PNG."""

    name = "POV-Ray"

    def refuses(self, scene: Scene) -> str:
        many = "too many spheres to write as text" if len(scene.spheres) > 20_000 else ""
        return super().refuses(scene) or many

    def run(self, scene: Scene, frames: int) -> Run:
        path, out = self._file(scene, ".pov"), self._folder / "povray.png"
        width, height = scene.camera.resolution
        options = [f"+W{width}", f"+H{height}", "-A", "-D", f"+WT{processors()}", "File_Gamma=1.0"]
        start = time.perf_counter()
        done = _call([self._program, f"+I{path}", f"+O{out}", *options])
        whole = time.perf_counter() - start
        with _understood(self._program):
            with Picture.open(out) as picture:
                rgb8 = np.asarray(picture.convert("RGB")).reshape(height, width, 3)
            traced = re.findall(r"Trace Time:.*\(([0-9.]+) seconds\)", done.stderr)
            return Run([_seconds(traced[-1])], whole, rgb8)

    def _write(self, scene: Scene, path: Path) -> None:
        x, y = scene.camera.image_plane()
        material = scene.materials[scene.spheres["material"]]
        light = _seen_from_the_eye(scene, _shining(scene)["position"])[0]
        centers = _seen_from_the_eye(scene, scene.spheres["center"])

        def vector(v: NDArray[np.float64]) -> str:
            return f"<{','.join(map(repr, v.tolist()))}>"

        with path.open("w", encoding="ascii") as file:
            file.write(
                "#version 3.7; global_settings{assumed_gamma 1 ambient_light rgb 1}\n"
                f"background{{rgb {vector(np.array(scene.background))}}}\n"
                f"camera{{perspective location 0 direction -z right x*{2 * x!r} up y*{2 * y!r}}}\n"
                f"light_source{{{vector(light)} rgb 1}}\n"
            )
            for center, radius, m in zip(centers, scene.spheres["radius"].tolist(), material, strict=True):
                finish = f"ambient {m['ka']} diffuse {m['kd']} phong {m['ks']} phong_size {m['exponent']}"
                look = f"pigment{{rgb {vector(m['color'])}}} finish{{{finish}}}"
                file.write(f"sphere{{{vector(center)},{radius!r} {look}}}\n")


class PeerError(Exception):
    """A peer's program failed; str() is one line."""


@contextlib.contextmanager
def _understood(program: str) -> Iterator[None]:
    """Turns what goes wrong while reading what a peer has written into a PeerError."""
    try:
        yield
    except (ValueError, LookupError, TypeError, OSError) as error:
        raise PeerError(f"{Path(program).name}: cannot read what it wrote: {error}") from None


def _seconds(text: Any) -> float:
    """A time that a peer has measured; ValueError if it is none that can be compared."""
    value = float(text)
    if not 0 < value < math.inf:
        raise ValueError(f"a time of {text}")
    return value


def _call(command: list[str]) -> subprocess.CompletedProcess[str]:
    name = Path(command[0]).name
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=PEER_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        raise PeerError(f"{name} took more than {PEER_SECONDS} s") from None
    except OSError as error:
        raise PeerError(f"{name}: {error.strerror}") from None
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        raise PeerError(f"{name} failed with status {done.returncode}: {last}")
    return done


def peers(embree: str | None, folder: Path) -> list[Tracer]:
    """The peers that are installed. embree: path of its program, None to look on the PATH, as for POV-Ray."""
    found: list[Tracer] = []
    if program := embree or shutil.which("embree_spheres"):
        found.append(Embree(program, folder))
    if program := shutil.which("povray"):
        found.append(PovRay(program, folder))
    return found
