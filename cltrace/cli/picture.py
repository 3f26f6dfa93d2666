"""Draws the picture of a scene, and says what it is, how long it took, and whether it is right."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

from numpy.typing import ArrayLike

from cltrace.base.arrays import physical_memory
from cltrace.base.errors import UsageError
from cltrace.base.waiting import SLOW, Announcement
from cltrace.cli.files import Reporter, scene_of, suffix_of, targets_of, write, write_rows
from cltrace.cli.options import Options, refusing
from cltrace.picture.image import USUAL, Image, Output, Show
from cltrace.picture.palettes import FAR, NEAR, depth_range
from cltrace.picture.storing import BY_ROWS, CHANNELS
from cltrace.process.console import tell
from cltrace.renderers.renderer import Renderer, strips
from cltrace.run.devices import choose
from cltrace.scene import Scene

NUMBERS = {".npy", ".npz", ".exr"}  # formats that have depths themselves, not greys


def draw(options: Options, reporter: Reporter) -> int:
    """Draws the picture. Returns 0, or 1 where --check found a difference."""
    started = time.perf_counter()
    scene = scene_of(options.scenes[0], options, reporter)
    read_seconds = time.perf_counter() - started
    files = Files.of(scene, options)
    checked: tuple[Output, ...] = () if options.check is None else ("rgb8", "id")
    renderer = _renderer(scene, options, (*files.needed, *checked))
    start, axes = time.perf_counter(), options.axes(scene.camera)
    if files.by_rows and options.check is None and options.repeat == 1:
        image = files.write_strips(renderer, axes, reporter.progress)
        start += image.frame_seconds
    else:
        _check_memory(renderer)
        frames = (renderer.render(progress=reporter.progress) for _ in range(options.repeat))
        image = min(frames, key=lambda frame: frame.frame_seconds)
        start = time.perf_counter()
        files.write(image, axes)
    now = time.perf_counter()
    image.seconds = {"read": read_seconds, **image.seconds, "write": now - start, "total": now - started}
    if written := [target for target in files.targets if target != "-"]:
        width, height = renderer.region[2:]
        how = f"{renderer.precision} precision, on {renderer.device.name}"
        reporter.say(f"cltrace: wrote {', '.join(written)}, {width}x{height}, {how}")
    if options.show == "depth" and not NUMBERS.issuperset(map(suffix_of, files.targets)):
        reporter.say(f"cltrace: depth: {_depth_scale(image)}")
    if options.stats:
        show_statistics(statistics(renderer, image), options.stats)
    return 0 if options.check is None else _check(renderer, image, options, reporter)


@dataclass(frozen=True)
class Files:
    """What is written of a picture.

    targets: where to; show: what PNG and NPY show; deep: the outputs that a PNG of 16 bits is made of, none if it has
    8; stored: the outputs that EXR and NPZ have.
    """

    targets: list[str]
    show: Show
    deep: tuple[Output, ...]
    stored: tuple[Output, ...]

    @classmethod
    def of(cls, scene: Scene, options: Options) -> Files:
        """What the command line asks for. Raises UsageError where that makes no sense or cannot work."""
        targets = targets_of(scene, options)
        kinds = set(map(suffix_of, targets))
        if options.outputs and kinds.isdisjoint((".exr", ".npz")):
            raise UsageError("--outputs goes with -o of an .exr or .npz")
        if options.bits == 16 and (".png" not in kinds or options.show != "color"):
            raise UsageError("--bits 16 goes with a PNG and --show color")
        usual = (*USUAL, "primitive") if scene.triangles else USUAL
        colors: tuple[Output, ...] = ("color", "alpha") if scene.background_alpha < 1 else ("color",)
        files = cls(targets, options.show, colors if options.bits == 16 else (), tuple(options.outputs or usual))
        if ".exr" in kinds and (strange := [name for name in files.stored if name not in CHANNELS]):
            raise UsageError(f"--outputs: an .exr has none of {', '.join(strange)}, only of {', '.join(CHANNELS)}")
        return files

    @property
    def needed(self) -> tuple[Output, ...]:
        """The outputs that they are made of."""
        shown: tuple[Output, ...] = ("rgb8",) if self.show == "color" else (self.show,)
        parts = {".png": self.deep or shown, ".exr": self.stored, ".npz": self.stored}
        return tuple(dict.fromkeys(name for target in self.targets for name in parts.get(suffix_of(target), shown)))

    @property
    def by_rows(self) -> bool:
        """Whether they can be written without the whole picture. The greys of depths depend on all of it."""
        return self.show != "depth" and all(suffix_of(target) in BY_ROWS for target in self.targets)

    def how(self, target: str, axes: ArrayLike | None) -> dict[str, Any]:
        """How one of them is written, see Image.write(). axes: along which normals and directions are shown."""
        if suffix_of(target) in (".exr", ".npz"):
            return {"outputs": self.stored}
        return {"show": self.show, "axes": axes, "bits": 16 if self.deep and suffix_of(target) == ".png" else 8}

    def write(self, image: Image, axes: ArrayLike | None) -> None:
        """Writes them, one after the other, so that those before a fault are there."""
        for target in self.targets:
            write(image, target, **self.how(target, axes))

    def write_strips(self, renderer: Renderer, axes: ArrayLike | None, progress: bool | None) -> Image:
        """Draws and writes them, a large picture by its rows. Returns the first of these, with the seconds of all."""
        height, parts, seconds = renderer.region[3], strips(renderer, progress), Counter[str]()
        rows, image = next(parts)
        if rows == height:
            self.write(image, axes)
            return image

        def images() -> Iterator[Image]:
            for part in chain([image], (part for _, part in parts)):
                seconds.update({name: part.seconds[name] for name in ("kernel", "readback")})
                yield part

        write_rows(images(), height, {target: self.how(target, axes) for target in self.targets})
        image.seconds |= seconds
        return image


def _renderer(scene: Scene, options: Options, outputs: tuple[Output, ...]) -> Renderer:
    """What draws the outputs of a scene. Raises UsageError for options that make no sense."""
    many = f"{len(scene.columns):,} spheres and {scene.triangles:,} triangles"
    with refusing(), Announcement(f"preparing {many} ...", SLOW):
        renderer = Renderer(scene, choose(options.device), **options.renderer_options(outputs))
    return renderer


def _check_memory(renderer: Renderer) -> None:
    """Raises UsageError for a whole picture that is larger than this computer's memory."""
    width, height = renderer.region[2:]
    size, memory = width * height * renderer.bytes_a_pixel, physical_memory()
    if size > memory:
        taken = f"{width}x{height} would take {size / 1e9:.3g} GB at once, of {memory / 1e9:.3g} GB"
        rows = f"only {', '.join(BY_ROWS)} are written by rows, without --check, --repeat and --show depth"
        raise UsageError(f"{taken}; {rows}; or draw a part of it with --crop")


def _check(renderer: Renderer, image: Image, options: Options, reporter: Reporter) -> int:
    """Compares the picture with the reference, and says how they agree. Returns the exit status."""
    from cltrace.students.check import check

    x, y, width, height = renderer.region
    every = {"all": width * height, "default": None}
    pixels = every[options.check] if isinstance(options.check, str) else options.check
    how: dict[str, Any] = {"origin": (x, y), "truncate": options.truncate, "progress": reporter.progress}
    # The reference traces what the kernel proves to be too faint, and has the same ceiling.
    with refusing("--check: "):
        report = check(renderer.scene, image, renderer.precision, pixels, **how)
    (reporter.say if report.ok else tell)(f"cltrace: {report}")
    return 0 if report.ok else 1


def _depth_scale(image: Image) -> str:
    """What the greys of a picture of depths stand for."""
    ends = depth_range(image.depth)
    if ends is None:
        return "no surface is seen, and all is black"
    near, far = (f"{depth:.6g}" for depth in ends)
    return (
        f"{near} is white ({NEAR}), {far} is dark ({FAR}), nothing is black; in between, a grey is "
        f"{FAR} + {NEAR - FAR} (1/depth - 1/{far}) / (1/{near} - 1/{far})"
    )


def statistics(renderer: Renderer, image: Image) -> dict[str, Any]:
    """Times and counts of a picture, by name; seconds. Counting the work renders it once more."""
    scene = renderer.scene
    width, height = renderer.region[2:]
    work = renderer.work()
    names = ("read", "pack", "lists", "build", "upload", "kernel", "readback", "write", "total")
    return {
        "device": renderer.device.name,
        "precision": renderer.precision,
        "size": [width, height],
        "spheres": len(scene.columns),
        "triangles": scene.triangles,
        "cylinders": len(scene.cylinders),
        "features": sorted(renderer.plan.features),
        "seconds": {name: image.seconds[name] for name in names},
        "rays": {"primary": width * height, "shadow": work["shadow rays traced"]},
        "work": work,
        "skipped": renderer.skipped,
    }


def show_statistics(stats: dict[str, Any], form: str) -> None:
    """Prints them: as lines on stderr, or as one JSON object on stdout where the form is json."""
    if form == "json":
        print(json.dumps(stats), flush=True)
        return
    for name, value in stats.items():
        if isinstance(value, dict):
            for what, number in value.items():
                tell(f"{name:<10} {number:12.6g} {what}")
        else:
            tell(f"{name:<10} {' '.join(map(str, value)) if isinstance(value, list) else value}")
