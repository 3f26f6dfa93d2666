"""The stability report: the stress catalogue, case by case, with what is required and what came out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.renderers.renderer import default_precision
from cltrace.run.devices import Device
from cltrace.scene import Scene

from .catalogue import CATALOGUE, Case, Limits, Refusal
from .errors import Errors, compare
from .report import number
from .tracers import Baseline, Product
from .truth import Answer, answer

# Of a scene, at most so many pixels are looked at: what each must be takes milliseconds to find out.
PIXELS = 300


@dataclass(frozen=True)
class Found:
    """What came out of a case: sums and maxima over its scenes, of as many pixels."""

    pixels: int
    wrong_ids: int
    t_ulp: float
    normal: float
    false_shadows: int
    leaks: int
    bytes_off: int
    not_finite: int
    same: int

    def within(self, limits: Limits) -> bool:
        """Whether that is what is required."""
        bounds = {f.name: getattr(limits, f.name) for f in fields(limits)}
        return all(most is None or getattr(self, name) <= most for name, most in bounds.items())


class Say(Protocol):
    """Where progress goes."""

    def step(self, what: str) -> None: ...
    def say(self, detail: str) -> None: ...
    def clear(self) -> None: ...


ABOUT = """
Pixels are held against exact arithmetic. `required` is the most that is allowed to accurate and double; single and
the textbook's tracer promise nothing but to draw numbers. wrong ids: another sphere, or none, or one where none is; t:
largest error of a distance in ulp of float32, of which 0.5 is its rounding; false shadows and leaks: lights that do not
arrive, or that must not; off by 2: pixels of which a byte is off by two levels or more; moved: pixels that differ
from the first picture of the case."""
HEAD = (
    "tracer",
    "verdict",
    "pixels",
    "wrong ids",
    "t ulp",
    "normal rad",
    "false sh.",
    "leaks",
    "off by 2",
    "NaN",
    "moved",
)
WIDTHS = (24, 8, 7, 9, 9, 10, 9, 7, 8, 5, 7)


def pixels_of(scene: Scene) -> NDArray[np.intp]:
    """The pixels that are looked at: all of them, or every k-th."""
    count = math.prod(scene.camera.resolution)
    return np.arange(0, count, -(-count // PIXELS))


def examine(tracer: Product | Baseline, scenes: Sequence[Scene], truths: Sequence[Answer], limits: Limits) -> Found:
    """What comes out of a case. A scene without lights has no colours to look at."""
    errors: list[Errors] = []
    first, moved = None, 0
    for scene, want in zip(scenes, truths, strict=True):
        got = tracer.answer(scene)
        errors.append(compare(got.at(pixels_of(scene)), want))
        if limits.same is not None:
            first = first or got
            moved += int((got.rgb8 != first.rgb8).any(axis=1).sum())
    return Found(
        pixels=sum(e.pixels for e in errors),
        wrong_ids=sum(e.wrong_ids for e in errors),
        t_ulp=max(e.t_ulp for e in errors),
        normal=max(e.normal for e in errors),
        false_shadows=sum(e.false_shadows for e in errors),
        leaks=sum(e.leaks for e in errors),
        bytes_off=sum(e.bytes_off for e in errors),
        not_finite=sum(e.not_finite for e in errors),
        same=moved,
    )


def _line(cells: Sequence[str]) -> str:
    return (
        "  "
        + "  ".join(
            c.ljust(w) if i < 2 else c.rjust(w) for i, (c, w) in enumerate(zip(cells, WIDTHS, strict=True))
        ).rstrip()
    )


def _text(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else number(value)


def _required(limits: Limits) -> list[str]:
    bounds = [limits.wrong_ids, limits.t_ulp, limits.normal, limits.false_shadows, limits.leaks, limits.bytes_off,
              limits.not_finite, limits.same]  # fmt: skip
    return ["required", "", "", *("" if b is None else _text(b) for b in bounds)]


def _found(label: str, verdict: str, found: Found, limits: Limits) -> list[str]:
    values = [(found.wrong_ids, 0), (found.t_ulp, 0), (found.normal, 0), (found.false_shadows, limits.false_shadows),
              (found.leaks, limits.leaks), (found.bytes_off, limits.bytes_off), (found.not_finite, limits.not_finite),
              (found.same, limits.same)]  # fmt: skip
    return [label, verdict, f"{found.pixels:,}", *("" if limit is None else _text(x) for x, limit in values)]


def chosen(quick: bool) -> Sequence[Case | Refusal]:
    """The cases of a run: quick is every seventh."""
    return CATALOGUE[::7] if quick else CATALOGUE


def run(devices: Sequence[Device], quick: bool, progress: Say) -> int:
    """Prints the report. Returns 1 if a precision that promises to meet all requirements fails one, else 0.

    accurate and double promise that; single only that nothing is NaN; the textbook nothing. quick: every seventh case,
    without double.
    """
    modes: list[tuple[Product | Baseline, bool, str]] = []
    for device in devices:
        default = default_precision(device)
        names = (
            [default] if quick else [p for p in ("accurate", "double", "single") if device.has_double or p == default]
        )
        where = f" [{device.spec}]" if len(devices) > 1 else ""
        modes += [(Product(device, name), name != "single", name + where) for name in names]
        modes.append((Baseline(device), False, Baseline.name + where))
    for device in devices:
        print(device.label)
    print(ABOUT)
    failed, passed, textbook = 0, 0, 0
    for case in chosen(quick):
        progress.step(f"{case.name} {case.what}")
        if isinstance(case, Refusal):
            every, refused = len(case.calls), sum(_refuses(call) for call in case.calls)
            verdict = "ok" if refused == every else "FAILED"
            progress.clear()
            print(f"\n{case.name}  {case.what}\n  required: {every} refused; refused: {refused}; {verdict}")
            failed, passed = failed + (refused < every), passed + (refused == every)
            continue
        scenes = list(case.scenes(1))
        truths = [answer(scene, pixels_of(scene)) for scene in scenes]
        lines = [_line(HEAD), _line(_required(case.limits))]
        bad = missed = False
        for tracer, promises, label in modes:
            progress.say(label)
            found = examine(tracer, scenes, truths, case.limits)
            ok = found.within(case.limits)
            # single promises nothing but numbers.
            finite = case.limits.not_finite is None or found.not_finite == 0
            broken = (promises and not ok) or (isinstance(tracer, Product) and not finite)
            bad |= broken
            missed |= isinstance(tracer, Baseline) and not ok
            verdict = "FAILED" if broken else "ok" if ok else "misses"
            lines.append(_line(_found(label, verdict, found, case.limits)))
        progress.clear()
        print(f"\n{case.name}  {case.what}", *lines, sep="\n", flush=True)
        failed, passed, textbook = failed + bad, passed + (not bad), textbook + missed
    print(f"\n{passed} cases as required, {failed} failed; the textbook's tracer misses what {textbook} require")
    return 1 if failed else 0


def _refuses(call: Callable[[], object]) -> bool:
    try:
        call()
    except ValueError:
        return True
    return False
