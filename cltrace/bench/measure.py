"""Times and errors: all tracers on one scene, in turn, round by round."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cltrace.plan.abi import Precision
from cltrace.plan.request import Keep
from cltrace.run.devices import Device
from cltrace.scene import Scene
from cltrace.students.check import DEFAULT_TESTS, TRIANGLES, sample

from .errors import Errors, bytes_apart, compare
from .peers import PeerError
from .scenes import Case
from .tracers import ACCELERATION, SKIPS, Baseline, Product, Tracer
from .truth import Answer, answer, can_thin

# Short frames are repeated until a measurement takes about this long, in seconds.
ENOUGH = 0.05
MOST_FRAMES = 5

# So many pixels are checked exactly. It is fewer where spheres are so many that finding those near a pixel's rays takes
# long: pixels times spheres are about SAMPLE_TESTS at most, but pixels are LEAST_SAMPLE at least. Where a scene is not
# thinned, the reference's limit takes the place of SAMPLE_TESTS.
SAMPLE, LEAST_SAMPLE, SAMPLE_TESTS = 500, 100, 50_000_000


@dataclass(frozen=True)
class Budget:
    """How much to measure.

    rounds: how often each tracer is timed on a scene, at most; seconds: after which a scene gets no further round, once
    it has had two; errors: whether to look for errors, too; sample: how many pixels are checked exactly.
    """

    rounds: int = 5
    seconds: float = 5.0
    errors: bool = True
    sample: int = SAMPLE


@dataclass
class Row:
    """What was measured of one tracer on one scene.

    name, variant, device: of the tracer; keep: what cltrace did not skip; kernel: seconds of each frame of all rounds;
    whole: seconds of each round, as of tracers.Run; picture: errors of the whole picture against cltrace's double
    precision; sample: errors of some pixels against exact arithmetic; differ: share of the picture's pixels of which a
    byte differs from that of double precision; off: the same, by more than a level; work: of tracers.Run; note: why
    something is missing.
    """

    case: Case
    name: str
    variant: str
    device: str
    keep: tuple[str, ...] = ()
    kernel: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    picture: Errors | None = None
    sample: Errors | None = None
    differ: float | None = None
    off: float | None = None
    work: object = None
    note: str = ""

    @property
    def label(self) -> str:
        return f"{self.name}, {self.variant}" if self.variant else self.name

    @property
    def best(self) -> float:
        """Seconds of the fastest frame, kernel and readback."""
        return min(self.kernel, default=math.nan)

    @property
    def errors(self) -> Errors | None:
        """The errors of the whole picture, or those of the sample if the picture is what others are held against.

        The largest errors are those of the sample where they are larger, as those of an exact normal are.
        """
        if not self.picture or not self.sample:
            return self.picture or self.sample
        p, s = self.picture, self.sample
        return replace(
            p, t_ulp=max(p.t_ulp, s.t_ulp), normal=max(p.normal, s.normal), color_max=max(p.color_max, s.color_max)
        )


def configurations(device: Device, precisions: Sequence[Precision], quick: bool) -> list[Tracer]:
    """The tracers to measure on a device: each precision with and without acceleration and skipping, and the textbook.

    The first of the precisions is also measured with each single piece of work that is otherwise skipped. quick: only
    with and without acceleration.
    """
    out: list[Tracer] = []
    for precision in precisions:
        kept: dict[tuple[Keep, ...], str] = {(): "", (ACCELERATION,): "no lists"}
        if not quick:
            kept |= {SKIPS: "no skipping", (ACCELERATION, *SKIPS): "neither"}
            if precision == precisions[0]:
                kept |= {(name,): f"keep {name}" for name in SKIPS}
        out += [Product(device, precision, keep, variant) for keep, variant in kept.items()]
    return [*out, Baseline(device)]


def measure(
    case: Case,
    tracers: Sequence[Tracer],
    reference: Product | None,
    budget: Budget,
    rows: list[Row],
    say: Callable[[str], None],
) -> None:
    """Measures all tracers on one scene, in turn, round by round.

    Adds a row for each tracer to `rows`, and fills them as it goes: after an interruption they hold what there is.
    reference: what whole pictures are held against, in double precision, None if no device has that; say: is told what
    happens, for a user who waits.
    """
    mine = [Row(case, t.name, t.variant, t.device, t.keep if isinstance(t, Product) else ()) for t in tracers]
    rows += mine
    live: list[tuple[Tracer, Row]] = []
    for tracer, row in zip(tracers, mine, strict=True):
        row.note = tracer.refuses(case.scene)
        if not row.note:
            live.append((tracer, row))

    # The first run of each, which may have to compile, is not counted.
    frames: dict[int, int] = {}
    pictures = {}
    for tracer, row in list(live):
        say(f"{row.label}: first picture")
        try:
            run = tracer.run(case.scene, 1)
        except PeerError as error:
            row.note = str(error)
            live.remove((tracer, row))
            continue
        frames[id(tracer)] = min(MOST_FRAMES, max(1, math.ceil(ENOUGH / max(1e-6, min(run.kernel, default=1)))))
        pictures[id(tracer)], row.work = run.rgb8, run.work
    if budget.errors:
        _errors(case, live, pictures, reference, budget, say)

    start = time.perf_counter()
    for number in range(budget.rounds):
        for tracer, row in list(live):
            say(f"{row.label}: round {number + 1} of {budget.rounds}")
            try:
                run = tracer.run(case.scene, frames[id(tracer)])
            except PeerError as error:
                row.note = str(error)
                live.remove((tracer, row))
                continue
            row.kernel += run.kernel
            row.whole.append(run.whole)
        if number and time.perf_counter() - start > budget.seconds:
            break


def _errors(
    case: Case,
    live: list[tuple[Tracer, Row]],
    pictures: dict[int, np.ndarray],
    reference: Product | None,
    budget: Budget,
    say: Callable[[str], None],
) -> None:
    """Fills in the errors of all rows. No byte depends on what is skipped, so one picture of each mode is enough."""
    answers: dict[object, Answer] = {}
    true = None
    if reference:
        say("double precision, as the reference")
        true = answers[reference.mode] = reference.answer(case.scene)
    pixels = np.zeros(0, np.intp)
    checked: Answer | None = None
    seen: dict[object, tuple[Errors | None, Errors | None]] = {}
    for tracer, row in live:
        mode = tracer.mode if isinstance(tracer, Product) else id(tracer)
        if mode not in answers:
            say(f"{row.label}: errors")
            got = tracer.answer(case.scene)
            if got is not None:
                answers[mode] = got
        if checked is None and mode in answers:
            say("exact arithmetic, on a sample")
            width, height = case.scene.camera.resolution
            count = min(budget.sample, max(LEAST_SAMPLE, affordable(case.scene)))
            chosen_by = true or answers[mode]
            pixels = sample(chosen_by.id.reshape(height, width), count)
            checked = answer(case.scene, pixels)
        if mode in answers and checked is not None:
            if mode not in seen:
                is_reference = answers[mode] is true
                whole = compare(answers[mode], true) if true and not is_reference else None
                seen[mode] = whole, compare(answers[mode].at(pixels), checked)
            if np.array_equal(pictures[id(tracer)].reshape(-1, 3), answers[mode].rgb8):
                row.picture, row.sample = seen[mode]
            else:
                row.note = "another picture than with all outputs: its errors are not known"
        if true is not None:
            differ, off = bytes_apart(pictures[id(tracer)], true.rgb8)
            row.differ, row.off = differ / len(true.id), off / len(true.id)
        if row.picture is None and row.sample is not None:
            # Its own picture is the reference, or there is none: the sample has to say.
            row.differ, row.off = (n / row.sample.pixels for n in (row.sample.bytes_differ, row.sample.bytes_off))


def affordable(scene: Scene) -> int:
    """How many pixels can be checked exactly in a while."""
    tests = SAMPLE_TESTS if can_thin(scene) else DEFAULT_TESTS
    return tests // max(1, len(scene.spheres) + scene.triangles // TRIANGLES)


def median(values: list[float]) -> float:
    """The median, NaN of nothing."""
    return statistics.median(values) if values else math.nan
