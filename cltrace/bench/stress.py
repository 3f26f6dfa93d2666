"""The stability report: the stress catalogue, case by case, with what is required and what came out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.request import PRECISIONS
from cltrace.renderers.renderer import default_precision
from cltrace.run.devices import Device
from cltrace.scene import Scene

from .catalogue import CATALOGUE, Case, Limits, Refusal
from .errors import Errors, compare
from .others import OTHERS, Judged
from .texts import number
from .tracers import Baseline, Product
from .truth import Answer, answer

if TYPE_CHECKING:
    from .cli import Progress

# Of a scene, at most so many pixels are looked at: what each must be takes milliseconds to find out.
PIXELS = 300


ABOUT = """
A line a case: what it is, how many pixels are looked at, and what came out of each tracer: ok, or what is beyond the
most that is allowed. Pixels are held against exact arithmetic, or where a scene is more than spheres against the
reference tracer; means against 64 x 64 rays; updates against new scenes, bit by bit. accurate and double promise that
all is ok; single and the textbook's tracer, which is float32 without any care, promise nothing but to draw numbers.
ids: pixels with another surface, or none, or one where none is; ulp: largest error of a distance, in ulp of float32, of
which 0.5 is its rounding; rad: of a normal; dark and leaks: lights that do not arrive, or that must not; off: pixels of
which a byte is off by two levels or more; moved: pixels that differ from the case's first picture; NaN: no numbers. A
tracer that has no say, as it has neither means nor updates, has a -."""
NAMES = {
    "not_finite": "NaN", "wrong_ids": "ids", "t_ulp": "ulp", "false_shadows": "dark", "leaks": "leaks",
    "bytes_off": "off", "same": "moved", "normal": "rad",
}  # fmt: skip
# Of what is beyond its limit, so many kinds are told.
TOLD = 2
WIDTHS = (5, 52, 7)


def pixels_of(scene: Scene) -> NDArray[np.intp]:
    """The pixels that are looked at: all of them, or every k-th."""
    count = math.prod(scene.camera.resolution)
    return np.arange(0, count, -(-count // PIXELS))


Found = dict[str, float]


def examine(tracer: Product | Baseline, scenes: Sequence[Scene], truths: Sequence[Answer], limits: Limits) -> Found:
    """What comes out of a case, by the names of Limits: sums, and maxima of sizes, over its scenes. A scene without
    lights has no colours to look at."""
    errors: list[Errors] = []
    first, moved = None, 0
    for scene, want in zip(scenes, truths, strict=True):
        got = tracer.answer(scene)
        errors.append(compare(got.at(pixels_of(scene)), want))
        if limits.same is not None:
            first = first or got
            moved += int((got.rgb8 != first.rgb8).any(axis=1).sum())
    each = {name: [getattr(e, name) for e in errors] for name in NAMES if name != "same"}
    return {name: max(v) if isinstance(v[0], float) else sum(v) for name, v in each.items()} | {"same": moved}


def beyond(found: Found, limits: Limits) -> list[str]:
    """What is more than is allowed, the worst kinds first."""
    return [
        f"{number(found[field]) if isinstance(found[field], float) else f'{found[field]:,}'} {name}"
        for field, name in NAMES.items()
        if (most := getattr(limits, field)) is not None and found[field] > most
    ]


def _line(cells: Sequence[str], columns: int) -> str:
    widths = (*WIDTHS, *[22] * columns)
    return "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()


def chosen(quick: bool) -> Sequence[AnyCase]:
    """The cases of a run: quick is every seventh."""
    every = [*CATALOGUE, *OTHERS]
    return every[::7] if quick else every


@dataclass(frozen=True)
class Outcome:
    """What a tracer makes of a case. text: its cell; ok: whether it is as required; finite: whether it drew numbers."""

    text: str
    ok: bool
    finite: bool = True


Of = Product | Baseline
AnyCase = Case | Judged | Refusal


def outcomes(case: AnyCase, tracers: Sequence[Of], say: Callable[[str], None]) -> tuple[int, list[Outcome | None]]:
    """How many pixels a case has, or calls, and what each tracer makes of it; None where it has no say."""
    if isinstance(case, Refusal):
        refused = sum(_refuses(call) for call in case.calls)
        every = len(case.calls)
        return every, [Outcome("ok" if refused == every else f"{every - refused} not refused", refused == every),
                       *[None] * (len(tracers) - 1)]  # fmt: skip
    if isinstance(case, Judged):
        pixels, out = 0, list[Outcome | None]()
        for tracer in tracers:
            if isinstance(tracer, Baseline):
                out.append(None)
                continue
            say(tracer.name)
            wrong, pixels = case.judge(tracer.on, tracer.precision)
            ok = wrong <= case.most * pixels
            out.append(Outcome("ok" if ok else f"{wrong:,} wrong", ok))
        return pixels, out
    scenes = list(case.scenes(1))
    truths = [answer(scene, pixels_of(scene)) for scene in scenes]
    out = []
    for tracer in tracers:
        say(tracer.name)
        if isinstance(tracer, Baseline) and any(cannot := tracer.refuses(scene) for scene in scenes):
            out.append(Outcome(f"no {', '.join(cannot)}", False))
            continue
        found = examine(tracer, scenes, truths, case.limits)
        more = beyond(found, case.limits)
        finite = case.limits.not_finite is None or not found["not_finite"]
        out.append(Outcome(", ".join(more[:TOLD]) or "ok", not more, finite))
    return sum(len(of.id) for of in truths), out


def run(devices: Sequence[Device], quick: bool, progress: Progress) -> int:
    """Prints the report. Returns 1 if a precision that promises to meet all requirements fails one, else 0.

    accurate and double promise that; single only that nothing is NaN; the textbook nothing. quick: every seventh case,
    without double.
    """
    tracers: list[Of] = []
    for device in devices:
        default = default_precision(device)
        names = [p for p in PRECISIONS if device.has_double or p == default]
        tracers += [Product(device, name) for name in ([default] if quick else names)]
        tracers.append(Baseline(device))
        print(device.label)
    print(ABOUT, end="\n\n")
    print(_line(["case", "what", "pixels", *(tracer.name for tracer in tracers)], len(tracers)))
    failed = passed = textbook = 0
    for case in chosen(quick):
        progress.step(f"{case.name} {case.what}")
        pixels, found = outcomes(case, tracers, progress.say)
        progress.clear()
        broken = [
            of is not None
            and isinstance(tracer, Product)
            and not (of.finite if tracer.precision == "single" else of.ok)
            for tracer, of in zip(tracers, found, strict=True)
        ]
        cells = [
            "-" if of is None else f"FAILED: {of.text}" if bad else of.text
            for of, bad in zip(found, broken, strict=True)
        ]
        print(_line([case.name, case.what, f"{pixels:,}", *cells], len(tracers)), flush=True)
        failed, passed = failed + any(broken), passed + (not any(broken))
        textbook += any(
            of is not None and not of.ok for t, of in zip(tracers, found, strict=True) if isinstance(t, Baseline)
        )
    print(f"\n{passed} cases as required, {failed} failed; the textbook's tracer misses what {textbook} require")
    return 1 if failed else 0


def _refuses(call: Callable[[], object]) -> bool:
    try:
        call()
    except ValueError:
        return True
    return False
