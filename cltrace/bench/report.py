"""What was measured, as tables: for a terminal while it goes on, and in Markdown for docs/benchmark.md."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby

from . import front, machine
from .points import Point, Results, Spread, Way
from .scenes import GROUPS
from .texts import UNSTEADY, milliseconds, number, percent
from .ways import WAYS

COLUMNS = ("frame ms", "quartiles", "whole ms", "wrong ids", "t ulp", "normal rad", "false sh.", "leaks", "RMS levels",
           "bytes differ")  # fmt: skip


def cells(point: Point) -> list[str]:
    """A point's texts under COLUMNS, with times in ms."""
    time, e = point.time, point.errors
    quartiles = f"{number(1e3 * time.low, 3)}..{number(1e3 * time.high, 3)}" if time.rounds else ""
    counts = (e.wrong_ids, e.t_ulp, e.normal, e.false_shadows, e.leaks) if e else ()
    found = [number(x) if isinstance(x, float) else f"{x:,}" for x in counts] or [""] * 5
    off = "" if point.rms is None else number(point.rms)
    return [milliseconds(time), quartiles, milliseconds(point.way), *found, off, percent(point.differ)]


def title(point: Point) -> str:
    width, height = point.size
    counts = {"sphere": point.spheres, "triangle": point.triangles, "cylinder": point.cylinders}
    shapes = ", ".join(f"{n:,} {name}{'s' * (n != 1)}" for name, n in counts.items() if n or name == "sphere")
    return f"{point.group}: {point.scene} ({shapes}, {width}x{height})"


def table(lines: Sequence[Sequence[str]]) -> list[str]:
    """Columns below each other, the first one to the left."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return [
        "  ".join(
            c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]


def scene_table(points: Sequence[Point]) -> str:
    """The points of one scene, for a terminal."""
    devices = list(dict.fromkeys(point.device for point in points if point.device))
    sample = next((point.sample.pixels for point in points if point.sample), 0)
    lines = [["", *COLUMNS]]
    notes = []
    for point in points:
        where = f" [{devices.index(point.device)}]" if len(devices) > 1 and point.device else ""
        if point.kernel or point.whole or point.errors:
            star = "*" if point.picture is None and point.sample is not None else ""
            lines.append([point.label + where + star, *cells(point)])
        if note := point.note or ", ".join(point.refused):
            notes.append(f"{point.label}{where}: {note}")
    if any(line[0].endswith("*") for line in lines):
        notes.append(f"* is what whole pictures are held against; its own errors are those of {sample} exact pixels")
    notes += [f"held against {text}" for text in dict.fromkeys(point.truth for point in points) if text]
    if any(UNSTEADY in cell for line in lines for cell in line):
        notes.append("~ repeated rounds do not agree within 10 %")
    return "\n".join([title(points[0]), *(f"  {line}" for line in [*table(lines), *notes])])


def ways_table(ways: Sequence[Way]) -> str:
    """What a user waits for, for a terminal."""
    return "\n".join(f"  {line}" for line in table(_ways(ways)))


def _ways(ways: Sequence[Way]) -> list[list[str]]:
    lines = [["what a user waits for", *(f"{way}, ms" for way in WAYS), "memory MB", "read MB"]]
    for (scene, tracer), some in groupby(ways, lambda way: (way.scene, way.tracer)):
        mine = {way.way: way for way in some if way.seconds}
        if mine:
            most = [
                max((v for w in mine.values() if (v := getattr(w, name))), default=math.nan)
                for name in ("memory", "read")
            ]
            lines.append([f"{scene}: {tracer}", *(milliseconds(mine[w].time) if w in mine else "" for w in WAYS),
                          *(number(v / 1e6) for v in most)])  # fmt: skip
    return lines


def took(spent: Mapping[str, Mapping[str, float]]) -> str:
    """Where a run's seconds went, by the kind of step and by who was at work, the most first."""
    steps = Counter({step: sum(of.values()) for step, of in spent.items()})
    who: Counter[str] = sum(map(Counter, spent.values()), Counter())
    said = f"It took {sum(steps.values()):.0f} s."
    for what, counts in (("class", steps), ("program", who)):
        if parts := [f"{name or 'the rest'} {s:.0f}" for name, s in counts.most_common() if s >= 1]:
            said += f" By {what}: {', '.join(parts)}."
    return said


def by_group(points: Iterable[Point]) -> dict[str, list[Point]]:
    """Points by class of scene, in the order of GROUPS; only of classes that have some."""
    points = list(points)
    return {group: mine for group in GROUPS if (mine := [p for p in points if p.group == group and p.kernel])}


def tracers_of(points: Iterable[Point]) -> dict[tuple[str, str], list[Point]]:
    """Points by label and device, in the order in which they were measured."""
    out: dict[tuple[str, str], list[Point]] = {}
    for point in points:
        out.setdefault((point.label, point.device), []).append(point)
    return out


def mean_time(points: Sequence[Point]) -> Spread:
    """The geometric means of median and quartiles of the points' times, and the fewest rounds of them."""

    def mean(values: Iterable[float]) -> float:
        return math.exp(math.fsum(map(math.log, values)) / len(points))

    times = [point.time for point in points]
    low, median, high = (mean(getattr(t, name) for t in times) for name in ("low", "median", "high"))
    return Spread(low, median, high, min(t.rounds for t in times))


def steady(points: Iterable[Point]) -> bool:
    """Whether the rounds of each agree."""
    return all(point.time.steady for point in points)


def worst(points: Iterable[Point], name: str) -> float:
    """The largest error of one kind, by the name of a field of Errors; NaN if none is known."""
    return max((float(getattr(point.errors, name)) for point in points if point.errors), default=math.nan)


def worst_share(points: Iterable[Point]) -> float:
    """The largest share of pixels that differ; NaN if none is known."""
    return max((point.differ for point in points if point.differ is not None), default=math.nan)


def complete(points: Sequence[Point], group: Sequence[Point]) -> bool:
    """Whether a tracer has drawn all scenes of a class: otherwise its mean time cannot be compared."""
    return {point.scene for point in points} == {point.scene for point in group}


def summary(results: Results) -> str:
    """What docs/benchmark.md says of a run: time and error of each tracer by class, its worst errors, whole ways, where
    peers are ahead, and where all that comes from."""
    points = [p for p in results.points if p.kernel and not p.variant and p.group in GROUPS]
    curves = [p for p in results.points if p.kernel and p.level is not None]
    out = [*_classes([p for p in points if p.level is None]), ""]
    if curves:
        out += [*_curves(curves), ""]
    if results.ways:
        out += [*_markdown(_ways(results.ways)), ""]
    if any(point.version for point in results.points):
        out += [*front.told(results), ""]
    versions = sorted({f"{point.tracer} {point.version}" for point in results.points if point.version})
    sizes = sorted({point.size for point in points if point.level is None}, reverse=True)
    said = [machine.sentence(results.about), f"Pictures of {', '.join(f'{w}x{h}' for w, h in sizes)} pixels."]
    if versions:
        said.append(f"Peers: {', '.join(versions)}.")
    said += [f"{name} does not draw: {', '.join(kinds)}." for name, kinds in _refused(results.points).items()]
    if spent := results.about.get("seconds"):
        said.append(took(spent).partition(". ")[0].rstrip(".") + ".")
    if results.missing:
        said.append(f"Missing: {'; '.join(results.missing)}.")
    if not results.finished:
        said.append("**Interrupted**: this is a part of what there is to measure.")
    if results.loaded:
        said.append(f"**{results.loaded}**: times are in doubt.")
    return "\n".join([*out, " ".join(said)]) + "\n"


def _refused(points: Iterable[Point]) -> dict[str, list[str]]:
    """By peer, what it has not drawn, and what it has failed at."""
    found: dict[str, dict[str, None]] = {}
    for point in points:
        if point.version and not point.kernel and (point.refused or point.note):
            found.setdefault(point.tracer, {}).update(dict.fromkeys(point.refused or [point.note]))
    return {name: list(kinds) for name, kinds in found.items()}


def _markdown(lines: Sequence[Sequence[str]]) -> list[str]:
    head, *rest = ("| " + " | ".join(line) + " |" for line in lines)
    return [head, "| " + " | ".join(["---"] * len(lines[0])) + " |", *rest]


def _classes(points: Sequence[Point]) -> list[str]:
    """A line for each class and kind of error, a column for each tracer."""
    groups = by_group(points)
    devices = list(dict.fromkeys(point.device for point in points if point.device))
    columns = [["", *groups, "wrong surfaces", "distance off by", "false shadows, leaks"]]
    for (label, device), mine in tracers_of(points).items():
        column = [f"{label}, {device}" if len(devices) > 1 and device else label]
        for group in groups.values():
            here = [point for point in mine if point in group]
            ok = here and complete(here, group)
            mark = "" if steady(here) else UNSTEADY
            text = f"{number(1e3 * mean_time(here).median)}{mark} ms" if ok else ""
            column.append(", ".join(part for part in (text, percent(worst_share(here))) if part) if ok else "")
        columns.append(column + _worst_errors(mine))
    return _markdown(list(zip(*columns, strict=True)))


def _curves(points: Sequence[Point]) -> list[str]:
    """A line for each place on a curve: time and RMS of each of its scenes."""
    scenes = list(dict.fromkeys((p.group, p.scene) for p in points))
    lines = [["", *(f"{group}: {scene}" for group, scene in scenes)]]
    for (label, _), mine in tracers_of(points).items():
        by = {(p.group, p.scene): p for p in mine}
        texts = [
            f"{milliseconds(p.time)} ms, {number(p.rms)}" if (p := by.get(s)) and p.rms is not None else ""
            for s in scenes
        ]
        lines.append([label, *texts])
    return _markdown(lines)


def _worst_errors(points: Sequence[Point]) -> list[str]:
    """Of one tracer, in all scenes: wrong surfaces, the largest error of a distance, false shadows and leaks."""
    known = [point.errors for point in points if point.errors]
    if not known:
        return [""] * 3
    shadows, leaks = (sum(getattr(e, name) for e in known) for name in ("false_shadows", "leaks"))
    return [f"{sum(e.wrong_ids for e in known):,}", f"{number(worst(points, 't_ulp'))} ulp", f"{shadows:,}, {leaks:,}"]
