"""Draws the picture of a scene, and says what it is, how long it took, and whether it is right."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable

from cltrace.cli.source import scene_of
from cltrace.cli.statistics import show_statistics, statistics
from cltrace.cli.target import target_of, write
from cltrace.console import tell
from cltrace.errors import UsageError
from cltrace.picture.image import Image, Output
from cltrace.picture.palettes import FAR, NEAR, depth_range
from cltrace.renderer import Renderer
from cltrace.run.devices import choose
from cltrace.scene import Scene


def draw(args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Draws the picture. Returns 0, or 1 where --check found a difference."""
    started = time.perf_counter()
    scene = scene_of(args, say)
    read_seconds = time.perf_counter() - started
    target = target_of(scene, args)
    renderer = renderer_of(scene, args)
    image = _fastest(renderer, args.repeat)
    image.seconds = {"read": read_seconds, **image.seconds}

    start = time.perf_counter()
    write(image, target, args.show, scene.camera.basis() if args.space == "camera" else None)
    image.seconds["write"] = time.perf_counter() - start
    image.seconds["total"] = time.perf_counter() - started
    if target != "-":
        width, height = renderer.region[2:]
        say(f"cltrace: wrote {target}, {width}x{height}, {renderer.precision} precision, on {renderer.device.name}")
    if args.show == "depth":
        say(f"cltrace: depth: {_depth_scale(image)}")
    if args.stats:
        show_statistics(statistics(renderer, image), args.stats)
    return 0 if args.check is None else _check(renderer, image, args, say)


def renderer_of(scene: Scene, args: argparse.Namespace) -> Renderer:
    """What draws the scene as the command line asks for it. Raises UsageError for options that make no sense."""
    device = choose(args.device)
    outputs: list[Output] = ["rgb8"] if args.show == "color" else [args.show]
    if args.check is not None:
        outputs += ["rgb8", "id"]
    keep = tuple(args.keep)
    try:
        return Renderer(scene, device, args.precision, tuple(outputs), args.crop, args.truncate, keep=keep)
    except ValueError as error:
        raise UsageError(str(error)) from None


def _fastest(renderer: Renderer, repeat: int) -> Image:
    """The picture, with the seconds of the fastest of so many frames."""
    image = best = renderer.render()
    for _ in range(repeat - 1):
        image = renderer.render(image)
        if image.frame_seconds < best.frame_seconds:
            best = image
    return best


def _check(renderer: Renderer, image: Image, args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Compares the picture with the reference, and says how they agree. Returns the exit status."""
    from cltrace.reference.check import check

    pixels = {"all": renderer.region[2] * renderer.region[3], "default": None}.get(args.check, args.check)
    try:
        origin, progress = renderer.region[:2], _progress(args.quiet)
        report = check(renderer.scene, image, renderer.precision, pixels, origin, args.truncate, progress)
    except ValueError as error:  # the reference traces what the kernel proves to be too faint, and has the same ceiling
        raise UsageError(f"--check: {error}") from None
    (say if report.ok else tell)(f"cltrace: {report}")
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


def _progress(quiet: bool) -> Callable[[float], None]:
    """Shows the share done on a terminal, after the first second."""
    start = time.monotonic()

    def show(share: float) -> None:
        if not quiet and sys.stderr.isatty() and time.monotonic() - start > 1:
            print(f"\rcltrace: checking {100 * share:3.0f} %\r", end="", file=sys.stderr, flush=True)

    return show
