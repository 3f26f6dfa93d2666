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

from .errors import apart
from .machine import Watch
from .peers import PeerError
from .points import LEAST_ROUNDS, Point
from .ready import Known, digest
from .scenes import Case
from .tracers import Product, Run, Tracer

Say = Callable[[str], None]

# Short frames are repeated until a round takes about this long, in seconds: several times what a scheduler gives a
# process before another one has its turn.
ENOUGH = 0.04
MOST_FRAMES = 100
# Of the first run, which may have to compile, the last frame says how long a frame takes.
FIRST_FRAMES = 2
# Rounds that agree end a measurement when there are so many. If the quartiles are in truth a fifth of the median apart,
# three normally distributed rounds agree by chance in 4 of 10 cases, and three to seven in 6; seven to fifteen do in 3,
# and then their median is off by less than a tenth in 9 of 10.
SURE_ROUNDS = 7
# What takes longer than this many seconds for a picture gets no second round.
TOO_LONG = 3


@dataclass(frozen=True)
class Budget:
    """How much to measure.

    rounds: how often each tracer is timed on a scene, at most; seconds: how long each tracer may take for its rounds of
    a scene, from LEAST_ROUNDS on, so that what is cheap has many and nobody has those of another; if infinite, each has
    all rounds.
    """

    rounds: int = 15
    seconds: float = 0.5

    def is_over(self, point: Point, spent: float) -> bool:
        """Whether a tracer has been timed often enough, which has taken so many seconds."""
        done = len(point.kernel)
        if done >= self.rounds:
            return True
        if math.isinf(self.seconds) or done < LEAST_ROUNDS:
            return False
        return spent >= self.seconds or (done >= SURE_ROUNDS and point.time.steady)


def measure(
    case: Case,
    tracers: Sequence[Tracer],
    known: Known | None,
    budget: Budget,
    points: list[Point],
    say: Say,
    watch: Watch,
) -> None:
    """Measures all tracers on one scene, in turn, round by round.

    Adds a point for each tracer to `points`, and replaces them as it goes: after an interruption they hold what there
    is. known: of the case, None if errors are not looked for; say: is told what happens, for a user who waits; watch:
    of what the machine does beside, while something is timed.
    """
    live: dict[int, Tracer] = {}
    for tracer in tracers:
        if tracer.draws(case):
            point = _blank(case, tracer)
            if not point.refused:
                live[len(points)] = tracer
            points.append(point)

    def run(k: int, frames: int) -> Run | None:
        """None, and no more of it, if the peer fails."""
        try:
            return live[k].run(case.scene, frames)
        except PeerError as error:
            points[k] = replace(points[k], note=str(error))
            del live[k]
            return None

    frames, spent = {}, dict.fromkeys(live, 0.0)
    for k in list(live):
        say(f"{points[k].label}: first picture")
        if done := run(k, FIRST_FRAMES):
            if known:
                points[k] = _held(points[k], live[k], known, done.rgb8)
            frames[k] = min(MOST_FRAMES, max(1, math.ceil(ENOUGH / max(1e-6, done.kernel[-1]))))
            if live[k].afresh:
                points[k] = _timed(points[k], done)
    with watch.timing():
        for number in range(budget.rounds):
            for k in [k for k in live if not budget.is_over(points[k], spent[k])]:
                say(f"{points[k].label}: round {number + 1} of {budget.rounds}")
                start = time.perf_counter()
                if done := run(k, frames[k]):
                    points[k] = _timed(points[k], done)
                    spent[k] += time.perf_counter() - start
                    if math.isfinite(budget.seconds) and (seconds := points[k].kernel[-1]) > TOO_LONG:
                        points[k] = replace(points[k], note=f"{seconds:.0f} s a picture: no further round")
                        del live[k]


def _timed(point: Point, done: Run) -> Point:
    """With one round more."""
    return replace(point, kernel=(*point.kernel, statistics.median(done.kernel)), whole=(*point.whole, done.whole))


def _blank(case: Case, tracer: Tracer) -> Point:
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
        refused=tracer.refuses(scene),
    )


def _held(point: Point, tracer: Tracer, known: Known, picture: NDArray[np.uint8]) -> Point:
    """With its errors."""
    true = known.truth
    found: dict[str, Any] = {"truth": true.text if true else "exact arithmetic, on a sample"}
    if verdict := known.verdicts.get(tracer.mode):
        if digest(picture) == verdict.digest:
            found |= {"picture": verdict.picture, "sample": verdict.sample}
        else:
            found["note"] = "another picture than with all outputs: its errors are not known"
    if true:
        found |= apart(picture, true.levels)
    if found.get("picture") is None and (of := found.get("sample")):
        # Its own picture is the reference, or there is none: the sample has to say.
        found |= {"differ": of.bytes_differ / of.pixels, "off": of.bytes_off / of.pixels, "rms": None}
    return replace(point, **found)
