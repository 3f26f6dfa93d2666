"""Answers about a picture instead of a picture: why a pixel has its colour, what differs, which lights reach what."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from cltrace.cli.options import refuse_others
from cltrace.cli.source import scene_of
from cltrace.cli.target import target_of, write
from cltrace.errors import UsageError
from cltrace.picture.image import Image
from cltrace.picture.palettes import MAX_LIGHTS
from cltrace.run.devices import choose
from cltrace.scene import AMBIENT

SETS = 12  # of lights, of how many --show lit says the colours


def explain(args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Prints why a pixel has its colour."""
    refuse_others(args, "--explain", "size", "square_pixels", "truncate", "json")
    scene = scene_of(args, say, lines=True)
    (x, y), (width, height) = args.explain, scene.camera.resolution
    if not (x < width and y < height):
        raise UsageError(f"--explain: must be within 0,0 and {width - 1},{height - 1}, got {x},{y}")
    from cltrace.explanation.pixel import explain as explanation_of

    explanation = explanation_of(scene, x, y, truncate=args.truncate)
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    print(explanation.to_json() if args.json else explanation, flush=True)
    return 0


def compare(args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Prints how a picture differs from the right one, and why. Returns 0 if it does not, and 1 if it does."""
    taken = "output", "tolerance", "json", "size", "square_pixels", "truncate", "device", "precision"
    refuse_others(args, "--compare", *taken)
    scene = scene_of(args, say)
    target = None if args.output is None else target_of(scene, args, "--compare")
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    if target == "-" and args.json:
        raise UsageError("-o - and --json both want stdout")
    own, other = Path(args.compare), Path(target or "-")
    if target not in (None, "-") and own.exists() and other.exists() and own.samefile(other):
        raise UsageError(f"-o: {target!r} is the picture itself, which the comparison would replace")
    from cltrace.comparison.pictures import compare as comparison_of

    device, tolerance = choose(args.device), 1 if args.tolerance is None else args.tolerance
    options = {"device": device, "precision": args.precision, "truncate": args.truncate}
    try:
        result = comparison_of(scene, args.compare, tolerance=tolerance, **options)
    except ValueError as error:
        raise UsageError(str(error)) from None
    if target is not None:
        write(Image(rgb8=result.side_by_side()), target, "color")
    (say if target == "-" else print)(result.to_json() if args.json else str(result))
    return 0 if result.same else 1


def show_lit(args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Writes a picture of which lights reach which pixels, and says what its colours are."""
    scene = scene_of(args, say)
    target = target_of(scene, args, "--show lit")
    refuse_others(args, "--show lit", "show", "output", "size", "crop", "square_pixels", "device", "precision")
    count = int((scene.lights["kind"] != AMBIENT).sum())
    if count > MAX_LIGHTS:
        raise UsageError(f"--show lit tells {MAX_LIGHTS} lights apart, and the scene has {count}")
    from cltrace.lighting import lighting

    device = choose(args.device)
    try:
        found = lighting(scene, device, args.precision, args.crop)
    except ValueError as error:
        raise UsageError(str(error)) from None
    colors = found.as_rgb8()
    write(Image(rgb8=colors), target, "color")
    if target != "-":
        say(f"cltrace: wrote {target}, {colors.shape[1]}x{colors.shape[0]}, on {device.name}")
    legend = list(found.legend())
    for line in legend[:SETS]:
        say(f"cltrace: lit: {line}")
    if len(legend) > SETS:
        say(f"cltrace: lit: and {len(legend) - SETS} more sets of lights")
    return 0
