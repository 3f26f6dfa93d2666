"""Times and errors: all tracers on one scene, in turn, round by round."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.students.check import sample

from .errors import Errors, apart, compare
from .peers import PeerError
from .points import LEAST_ROUNDS, Point
from .scenes import Case
from .tracers import Product, Run, Tracer
from .truth import Answer, answer, can_thin, held_against

Say = Callable[[str], None]

# Short frames are repeated until a measurement takes about this long, in seconds.
ENOUGH = 0.05
MOST_FRAMES = 20
# Of scenes with more balls and bonds that are not thinned, a quarter of the pixels is checked exactly.
MANY_BALLS = 5000
# What takes longer than this many seconds for a picture gets no second round.
TOO_LONG = 3


@dataclass(frozen=True)
class Budget:
    """How much to measure.

    rounds: how often each tracer is timed on a scene, at most; seconds: after which a scene gets no further round, once
    it has had LEAST_ROUNDS, and tracers of which these agree get none before that; if infinite, each has all rounds;
    errors: whether to look for errors, too; sample: how many pixels are checked exactly.
    """

    rounds: int = 7
    seconds: float = 2.0
    errors: bool = True
    sample: int = 100


def measure(
    case: Case, tracers: Sequence[Tracer], reference: Product | None, budget: Budget, points: list[Point], say: Say
) -> None:
    """Measures all tracers on one scene, in turn, round by round.

    Adds a point for each tracer to `points`, and replaces them as it goes: after an interruption they hold what there
    is. reference: what whole pictures are held against, in double precision, None if no device has that; say: is told
    what happens, for a user who waits.
    """
    live: dict[int, Tracer] = {}
    for tracer in tracers:
        if tracer.draws(case):
            note = tracer.refuses(case.scene)
            if not note:
                live[len(points)] = tracer
            points.append(_blank(case, tracer, note))

    def run(k: int, frames: int) -> Run | None:
        """None, and no more of it, if the peer fails."""
        try:
            return live[k].run(case.scene, frames)
        except PeerError as error:
            points[k] = replace(points[k], note=str(error))
            del live[k]
            return None

    # The first run of each, which may have to compile, is not counted.
    frames, pictures = {}, {}
    for k in list(live):
        say(f"{points[k].label}: first picture")
        if done := run(k, 1):
            pictures[k] = done.rgb8
            frames[k] = min(MOST_FRAMES, max(1, math.ceil(ENOUGH / max(1e-6, min(done.kernel, default=1)))))
    if budget.errors:
        _errors(case, live, pictures, reference, budget, points, say)

    start, bounded = time.perf_counter(), math.isfinite(budget.seconds)
    for number in range(budget.rounds):
        left = [k for k in live if frames[k] and not (bounded and number >= LEAST_ROUNDS and points[k].time.steady)]
        for k in left:
            say(f"{points[k].label}: round {number + 1} of {budget.rounds}")
            if done := run(k, frames[k]):
                before, time_of = points[k], statistics.median(done.kernel)
                points[k] = replace(before, kernel=(*before.kernel, time_of), whole=(*before.whole, done.whole))
                if bounded and time_of > TOO_LONG:
                    points[k] = replace(points[k], note=f"{time_of:.0f} s a picture: no further round")
                    frames[k] = 0
        if not left or (number + 1 >= LEAST_ROUNDS and time.perf_counter() - start > budget.seconds):
            break


def _blank(case: Case, tracer: Tracer, note: str) -> Point:
    scene = case.scene
    return Point(
        group=case.group,
        scene=case.name,
        spheres=len(scene.spheres),
        triangles=scene.triangles,
        cylinders=len(scene.cylinders),
        size=scene.camera.resolution,
        tracer=tracer.name,
        variant=tracer.variant,
        level=tracer.level,
        version=tracer.version,
        device=tracer.device,
        keep=tracer.keep if isinstance(tracer, Product) else (),
        note=note,
    )


def _errors(
    case: Case,
    live: dict[int, Tracer],
    pictures: dict[int, NDArray[np.uint8]],
    reference: Product | None,
    budget: Budget,
    points: list[Point],
    say: Say,
) -> None:
    """Fills in the errors of all points. No byte depends on what is skipped, so one picture of each mode is enough."""
    say("what the picture must be")
    true = held_against(case, reference)
    answers: dict[object, Answer] = {}
    if true and true.answer and reference:
        answers[reference.mode] = true.answer
    pixels = np.zeros(0, np.intp)
    checked: Answer | None = None
    seen: dict[object, tuple[Errors | None, Errors | None]] = {}
    for k, tracer in live.items():
        found: dict[str, Any] = {"truth": true.text if true else "exact arithmetic, on a sample"}
        mode = tracer.mode if isinstance(tracer, Product) else id(tracer)
        if mode not in answers and (true is None or true.answer):
            say(f"{points[k].label}: errors")
            if (got := tracer.answer(case.scene)) is not None:
                answers[mode] = got
        if checked is None and mode in answers:
            say("exact arithmetic, on a sample")
            width, height = case.scene.camera.resolution
            chosen_by = (true and true.answer) or answers[mode]
            # Where a scene is not thinned, all its balls and bonds are tried for every ray.
            balls = len(case.scene.spheres) + len(case.scene.cylinders)
            count = budget.sample // 4 if balls > MANY_BALLS and not can_thin(case.scene) else budget.sample
            pixels = sample(chosen_by.id.reshape(height, width), count)
            checked = answer(case.scene, pixels)
        if mode in answers and checked is not None:
            if mode not in seen:
                want = true.answer if true and answers[mode] is not true.answer else None
                whole = compare(answers[mode], want) if want else None
                seen[mode] = whole, compare(answers[mode].at(pixels), checked)
            if np.array_equal(pictures[k].reshape(-1, 3), answers[mode].rgb8):
                found["picture"], found["sample"] = seen[mode]
            else:
                found["note"] = "another picture than with all outputs: its errors are not known"
        if true is not None:
            found |= apart(pictures[k], true.levels)
        if found.get("picture") is None and (of := found.get("sample")):
            # Its own picture is the reference, or there is none: the sample has to say.
            found |= {"differ": of.bytes_differ / of.pixels, "off": of.bytes_off / of.pixels, "rms": None}
        points[k] = replace(points[k], **found)
