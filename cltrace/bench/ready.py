"""What is made ready before anything is timed, by a process for each processor, of which eight are enough: programs are
compiled, so that the driver's cache on disk has them, and it is found out what pictures must be and what is wrong with
ours.
"""

from __future__ import annotations

import gc
import hashlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import processors
from cltrace.base.errors import DeviceError
from cltrace.plan.abi import Precision
from cltrace.run.devices import choose
from cltrace.students.check import sample

from .errors import Errors, compare
from .scenes import Case
from .tracers import Product, Tracer, configurations
from .truth import Answer, Truth, answer, can_thin, held_against

Found = TypeVar("Found")

# Of scenes with more balls and bonds that are not thinned, a quarter of the pixels is checked exactly.
MANY_BALLS = 5000
# How many seconds a job may take, and how many are done at once: each process holds a scene and its pictures.
LONGEST, AT_ONCE = 600, 8


@dataclass(frozen=True)
class Verdict:
    """What is wrong with a picture of ours. digest: of its bytes; picture, sample: as of a Point."""

    digest: str
    picture: Errors | None
    sample: Errors


@dataclass(frozen=True)
class Known:
    """What is known of a case. truth: what whole pictures are held against, without its answer, None if no device has
    double precision; verdicts: by the mode of the tracer that says more of its pixels than their bytes."""

    truth: Truth | None = None
    verdicts: dict[object, Verdict] = field(default_factory=dict)


@dataclass(frozen=True)
class Ours:
    """Our tracers, as another process can make them, too. devices: the spec of each, and its precisions; double: that
    of a device that has double precision, if any has; quick: as of configurations()."""

    devices: tuple[tuple[str, tuple[Precision, ...]], ...]
    double: str | None
    quick: bool

    def tracers(self) -> list[Tracer]:
        return [t for spec, precisions in self.devices for t in configurations(choose(spec), precisions, self.quick)]

    def reference(self) -> Product | None:
        """What whole pictures are held against: double precision without filters."""
        return Product(choose(self.double), "double", ("filter",)) if self.double else None


def digest(picture: NDArray[np.uint8]) -> str:
    return hashlib.sha256(picture.tobytes()).hexdigest()


def known(case: Case, ours: Ours, count: int) -> Known:
    """Compiles what our tracers need for a case, and finds what is known of it. count: of pixels checked exactly."""
    return judged(case, ours.tracers(), ours.reference(), count)


def judged(case: Case, tracers: Sequence[Tracer], reference: Product | None, count: int) -> Known:
    """What is known of a case. No byte depends on what is skipped, so one picture of each mode is enough."""
    live = [tracer for tracer in tracers if tracer.draws(case) and not tracer.refuses(case.scene)]
    for tracer in live:
        if isinstance(tracer, Product):
            tracer.run(case.scene, 1)
    true = held_against(case, reference)
    answers: dict[object, Answer] = {}
    if true and true.answer and reference:
        answers[reference.mode] = true.answer
    for tracer in live if true is None or true.answer else ():
        if tracer.mode not in answers and (got := tracer.answer(case.scene)) is not None:
            answers[tracer.mode] = got
    verdicts = {}
    if answers:
        pixels = _pixels(case, next(iter(answers.values())), count)
        exact = answer(case.scene, pixels)
        for mode, got in answers.items():
            want = true.answer if true and got is not true.answer else None
            whole = compare(got, want) if want else None
            verdicts[mode] = Verdict(digest(got.rgb8), whole, compare(got.at(pixels), exact))
    return Known(true and replace(true, answer=None), verdicts)


def _pixels(case: Case, seen: Answer, count: int) -> NDArray[np.intp]:
    """Which pixels are checked exactly. In a scene that is not thinned, all balls and bonds are tried for each ray."""
    width, height = case.scene.camera.resolution
    balls = len(case.scene.spheres) + len(case.scene.cylinders)
    few = balls > MANY_BALLS and not can_thin(case.scene)
    return sample(seen.id.reshape(height, width), count // 4 if few else count)


def at_once(jobs: Sequence[Callable[[], Found]]) -> Iterator[Found]:
    """What these return, in their order. They and what they return go from process to process."""
    context = multiprocessing.get_context("spawn")
    interrupted = False
    count = max(1, min(processors(), AT_ONCE, len(jobs)))
    with context.Pool(count, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        found = pool.imap(_done, jobs)
        try:
            for _ in jobs:
                yield found.next(LONGEST)
        except multiprocessing.TimeoutError:
            raise DeviceError(f"making a scene ready has taken more than {LONGEST} s") from None
        except KeyboardInterrupt:
            interrupted = True
    # What an interruption remembers would hold the semaphores that they share, and Python says so where a program ends.
    del pool, found
    gc.collect()
    if interrupted:
        raise KeyboardInterrupt


def _done(job: Callable[[], Found]) -> Found:
    return job()
