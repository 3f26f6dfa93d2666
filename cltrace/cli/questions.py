"""Answers about a picture instead of a picture: why a pixel has its colour, what differs, which lights reach what."""

from __future__ import annotations

import logging
import sys
from typing import Any

from cltrace.base.errors import UsageError
from cltrace.base.waiting import SLOW, Announcement
from cltrace.cli.options import Compare, Explain, Lit
from cltrace.cli.output_files import target_of, write
from cltrace.cli.reporter import Reporter
from cltrace.cli.scenes import scene_of
from cltrace.picture.image import Image
from cltrace.picture.palettes import MAX_LIGHTS
from cltrace.run.devices import Device, choose
from cltrace.scene import AMBIENT, Scene

SETS = 12  # of lights, of how many --show lit says the colours


def explain(work: Explain, reporter: Reporter) -> int:
    """Prints why a pixel has its colour."""
    scene = scene_of(work.scene, reporter, lines=True)
    (x, y), (width, height) = work.explain, scene.camera.resolution
    if not (x < width and y < height):
        raise UsageError(f"--explain: must be within 0,0 and {width - 1},{height - 1}, got {x},{y}")
    from cltrace.explanation.pixel import explain as explanation_of

    words = f"--explain is slow: lower max_bounces, which is {scene.camera.max_bounces}, if that is much"
    with Announcement(words, SLOW, logging.WARNING):
        explanation = explanation_of(scene, x, y, truncate=work.drawing.truncate)
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    print(explanation.to_json() if work.json else explanation.table if work.trace else explanation, flush=True)
    return 0


def compare(work: Compare, reporter: Reporter) -> int:
    """Prints how a picture differs from the right one, and why. Returns 0 if it does not, and 1 if it does."""
    scene = scene_of(work.scene, reporter)
    target = None if work.output is None else target_of(scene, work, "--compare")
    if sys.stdout is None:
        raise UsageError("stdout is closed")
    if target == "-" and work.json:
        raise UsageError("-o - and --json both want stdout")
    from cltrace.students.compare import compare as comparison_of

    drawing, device = work.drawing, choose(work.drawing.device)
    if work.show != "color" or work.compare.lower().endswith(".npy"):
        return _compare_dump(work, scene, device)
    options: dict[str, Any] = {"device": device, "precision": drawing.precision, "truncate": drawing.truncate}
    options["antialias"] = drawing.antialias
    try:
        result = comparison_of(scene, work.compare, tolerance=work.tolerance, **options)
    except ValueError as error:
        raise UsageError(str(error)) from None
    if target is not None:
        write(Image(rgb8=result.side_by_side()), target, "color")
    (reporter.say if target == "-" else print)(result.to_json() if work.json else str(result))
    return 0 if result.same else 1


def _compare_dump(work: Compare, scene: Scene, device: Device) -> int:
    """Prints how numbers that a program has found on its way differ from the right ones."""
    from cltrace.students.dumps import compare_dump

    try:
        dump = compare_dump(scene, work.show, work.compare, device=device, precision=work.drawing.precision)
    except ValueError as error:
        raise UsageError(str(error)) from None
    print(dump)
    return 0 if dump.same else 1


def show_lit(work: Lit, reporter: Reporter) -> int:
    """Writes a picture of which lights reach which pixels, and says what its colours are."""
    scene = scene_of(work.scene, reporter)
    target = target_of(scene, work, "--show lit")
    count = int((scene.lights["kind"] != AMBIENT).sum())
    if count > MAX_LIGHTS:
        raise UsageError(f"--show lit tells {MAX_LIGHTS} lights apart, and the scene has {count}")
    from cltrace.students.lit import lighting

    device = choose(work.drawing.device)
    try:
        found = lighting(scene, device, work.drawing.precision, work.drawing.crop)
    except ValueError as error:
        raise UsageError(str(error)) from None
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
