"""Answers about a picture instead of a picture: why a pixel has its colour, what differs, which lights reach what."""

from __future__ import annotations

import logging
import sys
from typing import Any

from cltrace.base.errors import UsageError
from cltrace.base.waiting import SLOW, Announcement
from cltrace.cli.files import Reporter, scene_of, targets_of, write
from cltrace.cli.options import Options, refusing
from cltrace.picture.image import Image
from cltrace.picture.palettes import MAX_LIGHTS
from cltrace.run.devices import choose
from cltrace.scene import AMBIENT

SETS = 12  # of lights, of how many --show lit says the colours


def explain(options: Options, reporter: Reporter) -> int:
    """Prints why a pixel has its colour."""
    scene = scene_of(options.scenes[0], options, reporter)
    (x, y), (width, height) = options.explain or (0, 0), scene.camera.resolution
    if not (x < width and y < height):
        raise UsageError(f"--explain: must be within 0,0 and {width - 1},{height - 1}, got {x},{y}")
    from cltrace.explanation.pixel import explain as explanation_of

    words = f"--explain is slow: lower max_bounces, which is {scene.camera.max_bounces}, if that is much"
    with Announcement(words, SLOW, logging.WARNING):
        explanation = explanation_of(scene, x, y, truncate=options.truncate)
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    print(explanation.to_json() if options.json else explanation.table if options.trace else explanation, flush=True)
    return 0


def compare(options: Options, reporter: Reporter) -> int:
    """Prints how a picture differs from the right one, and why. Returns 0 if it does not, and 1 if it does."""
    scene = scene_of(options.scenes[0], options, reporter)
    target = None if options.output is None else targets_of(scene, options, (".png",))[0]
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    if target == "-" and options.json:
        raise UsageError("-o - and --json both want stdout")
    from cltrace.students.compare import compare as comparison_of

    tolerance = 1 if options.tolerance is None else options.tolerance
    how: dict[str, Any] = {name: getattr(options, name) for name in ("precision", "truncate", "antialias")}
    with refusing():
        result = comparison_of(scene, options.compare or "", tolerance=tolerance, device=choose(options.device), **how)
    if target is not None:
        write(Image(rgb8=result.side_by_side()), target, "color")
    (reporter.say if target == "-" else print)(result.to_json() if options.json else str(result))
    return 0 if result.same else 1


def show_lit(options: Options, reporter: Reporter) -> int:
    """Writes a picture of which lights reach which pixels, and says what its colours are."""
    scene = scene_of(options.scenes[0], options, reporter)
    (target,) = targets_of(scene, options, (".png",))
    count = int((scene.lights["kind"] != AMBIENT).sum())
    if count > MAX_LIGHTS:
        raise UsageError(f"--show lit tells {MAX_LIGHTS} lights apart, and the scene has {count}")
    from cltrace.students.lit import lighting

    device = choose(options.device)
    with refusing():
        found = lighting(scene, device, options.precision, options.crop)
    colors = found.as_rgb8()
    write(Image(rgb8=colors), target, "color")
    if target != "-":
        reporter.say(f"cltrace: wrote {target}, {colors.shape[1]}x{colors.shape[0]}, on {device.name}")
    legend = list(found.legend())
    for line in legend[:SETS]:
        reporter.say(f"cltrace: lit: {line}")
    if len(legend) > SETS:
        reporter.say(f"cltrace: lit: and {len(legend) - SETS} more sets of lights")
    return 0
