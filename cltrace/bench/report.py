"""What was measured, as texts: tables for a terminal and for docs/benchmark.md, where peers are ahead, and the page."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import geometric_mean

from cltrace.base.errors import UsageError
from cltrace.picture.files import whole_file

from .measure import ROOT, Measurement, Results, Spread, Wait, Work, load, sentence
from .scenes import GROUPS
from .user import WAYS

# Stands where repeated rounds do not agree.
UNSTEADY = "~"
# Errors that are closer to each other than this share are equal: the luck of the draw.
EQUAL = 0.01
PAGE, RESULTS, COUNTED = Path("docs/benchmark.md"), Path("docs/benchmark.json"), Path("tests/bench/counted.json")
BEGIN, END = "<!-- made by cltrace-bench --publish -->", "<!-- until here -->"


def number(value: float, digits: int = 2) -> str:
    """A number as text, with this many digits in as few characters as will do; empty for NaN."""
    if math.isnan(value):
        return ""
    if value == 0 or math.isinf(value):
        return "0" if value == 0 else "inf"
    if 1e-3 <= abs(value) < 1e5:
        places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        return f"{value:,.{places}f}"
    return f"{value:.{digits - 1}e}".replace("e-0", "e-").replace("e+0", "e")


def percent(share: float | None) -> str:
    return "" if share is None or math.isnan(share) else f"{number(100 * share)} %"


def milliseconds(time: Spread, digits: int = 3) -> str:
    """The median, with a ~ where the rounds do not agree."""
    return number(1e3 * time.median, digits) + UNSTEADY * (not time.steady)


# ---------------------------------------------------------------------------------------------- points, put together


def by_group(points: Iterable[Measurement]) -> dict[str, list[Measurement]]:
    """Points by class of scene, in the order of GROUPS; only of classes that have some."""
    points = list(points)
    return {group: mine for group in GROUPS if (mine := [p for p in points if p.group == group and p.frames])}


def by_label(points: Iterable[Measurement]) -> dict[str, list[Measurement]]:
    """Points by tracer, in the order in which they were measured."""
    out: dict[str, list[Measurement]] = {}
    for point in points:
        out.setdefault(point.label, []).append(point)
    return out


def mean_time(points: Sequence[Measurement]) -> Spread:
    """The geometric means of median and quartiles; steady if all are."""
    times = [point.time for point in points]
    low, median, high = (geometric_mean(getattr(time, name) for time in times) for name in ("low", "median", "high"))
    return Spread(low, median, high, all(time.steady for time in times))


def worst_share(points: Iterable[Measurement]) -> float:
    """The largest share of pixels that differ; NaN if none is known."""
    return max((point.differ for point in points if point.differ is not None), default=math.nan)


def complete(points: Sequence[Measurement], group: Sequence[Measurement]) -> bool:
    """Whether a tracer has drawn all scenes of a class: otherwise its mean time cannot be compared."""
    return {point.scene for point in points} == {point.scene for point in group}


# ------------------------------------------------------------------------------------------------------------- tables


def scene_table(points: Sequence[Measurement]) -> str:
    """The points of one scene, for a terminal."""
    width, height = points[0].size
    lines = [["", "frame ms", "whole ms", "wrong ids", "t ulp", "false sh.", "leaks", "RMS", "differ"]]
    for point in points:
        e, off = point.errors, "" if point.rms is None else number(point.rms)
        counts = [f"{e.wrong_ids:,}", number(e.t_ulp), f"{e.false_shadows:,}", f"{e.leaks:,}"] if e else [""] * 4
        if point.frames:
            times = milliseconds(point.time), milliseconds(Spread.of(point.whole))
            lines.append([point.label, *times, *counts, off, percent(point.differ)])
    title = f"{points[0].group}: {points[0].scene} ({points[0].surfaces:,} surfaces, {width}x{height})"
    return "\n  ".join([title, aligned(lines), *(f"{p.label}: {p.note}" for p in points if p.note)])


def aligned(lines: Sequence[Sequence[str]]) -> str:
    """Columns below each other, the first one to the left."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    rows = ((c.rjust(w) if k else c.ljust(w) for k, (c, w) in enumerate(zip(line, widths, strict=True)))
            for line in lines)  # fmt: skip
    return "\n  ".join("  ".join(row).rstrip() for row in rows)


def markdown(lines: Sequence[Sequence[str]]) -> str:
    """A table whose first line is its head."""
    head, *rest = ("| " + " | ".join(line) + " |" for line in lines)
    return "\n".join([head, "| " + " | ".join(["---"] * len(lines[0])) + " |", *rest])


def summary(results: Results) -> str:
    """What docs/benchmark.md says of a run."""
    points = [point for point in results.points if point.frames and point.group in GROUPS]
    classes = _classes([point for point in points if point.level is None and not point.variant])
    curves, waits = _curves([point for point in points if point.level is not None]), waits_table(results.waits)
    parts = [markdown(classes), *(markdown(table) for table in (curves, waits) if len(table) > 1)]
    if any(point.version for point in results.points):
        parts.append(ahead(results))
    return "\n\n".join([*parts, _origin(results)]) + "\n"


def _classes(points: Sequence[Measurement]) -> list[tuple[str, ...]]:
    """A line for each class and kind of error, a column for each tracer."""
    groups = by_group(points)
    columns = [["", *groups, "wrong surfaces", "distance off by", "false shadows, leaks"]]
    for label, mine in by_label(points).items():
        column = [label]
        for group in groups.values():
            here = [point for point in mine if point in group]
            cell = ""
            if here and complete(here, group):
                cell = ", ".join(filter(None, (f"{milliseconds(mean_time(here), 2)} ms", percent(worst_share(here)))))
            column.append(cell)
        known = [point.errors for point in mine if point.errors]
        ids, shadows, leaks = (sum(getattr(e, n) for e in known) for n in ("wrong_ids", "false_shadows", "leaks"))
        ulp = max((e.t_ulp for e in known), default=0.0)
        columns.append(column + ([f"{ids:,}", f"{number(ulp)} ulp", f"{shadows:,}, {leaks:,}"] if known else [""] * 3))
    return list(zip(*columns, strict=True))


def _curves(points: Sequence[Measurement]) -> list[list[str]]:
    """A line for each place on a curve: time and RMS of each of its scenes."""
    scenes = list(dict.fromkeys((p.group, p.scene) for p in points))
    lines = [["", *(f"{group}: {scene}" for group, scene in scenes)]]
    for label, mine in by_label(points).items():
        cells = {(p.group, p.scene): f"{milliseconds(p.time)} ms, {number(p.rms)}" for p in mine if p.rms is not None}
        lines.append([label, *(cells.get(scene, "") for scene in scenes)])
    return lines


def waits_table(waits: Sequence[Wait]) -> list[list[str]]:
    """A line for each scene and who is waited for, a column for each way."""
    lines = [["what a user waits for", *(f"{way}, ms" for way in WAYS)]]
    for scene, tracer in dict.fromkeys((wait.scene, wait.tracer) for wait in waits):
        mine = {wait.way: milliseconds(wait.time) for wait in waits if (wait.scene, wait.tracer) == (scene, tracer)}
        lines.append([f"{scene}: {tracer}", *(mine.get(way, "") for way in WAYS)])
    return lines


def _origin(results: Results) -> str:
    """Where and when all that was measured, with what, and what is missing."""
    sizes = sorted({p.size for p in results.points if p.level is None and p.group in GROUPS}, reverse=True)
    said = [sentence(results.about), f"Pictures of {', '.join(f'{w}x{h}' for w, h in sizes)} pixels."]
    peers = {f"{point.tracer} {point.version}": point.tracer for point in results.points if point.version}
    for title, name in sorted(peers.items()):
        notes = dict.fromkeys(p.note for p in results.points if p.tracer == name and p.note and not p.frames)
        said.append(f"{title} does not draw {', '.join(notes)}." if notes else f"{title}.")
    if "seconds" in results.about:
        said.append(f"It took {results.about['seconds']:.0f} s.")
    if results.missing:
        said.append(f"Missing: {'; '.join(results.missing)}.")
    if not results.finished:
        said.append("**Interrupted**: this is a part of what there is to measure.")
    if results.loaded:
        said.append(f"**{results.loaded}**: times are in doubt.")
    return " ".join(said)


# ----------------------------------------------------------------------------------------------- where peers are ahead


def ahead(results: Results) -> str:
    """Where another program is ahead of cltrace, in Markdown: by scene its points for which none of ours is as fast and
    as right, and by way those that keep a user waiting for less time."""
    found = dict[str, list[str]]()
    points = [p for p in results.points if p.group in GROUPS and p.frames and not math.isnan(_error(p))]
    for peer in (point for point in points if point.version):
        ours = [one for one in points if not one.version and (one.group, one.scene) == (peer.group, peer.scene)]
        beaten = (one.time.median <= peer.time.median and _error(one) <= (1 + EQUAL) * _error(peer) for one in ours)
        if ours and not any(beaten):
            found.setdefault(f"{peer.group}, {peer.scene}", []).append(peer.label)
    for wait in (wait for wait in results.waits if wait.version):
        own = [one for one in results.waits if not one.version and (one.scene, one.way) == (wait.scene, wait.way)]
        if own and wait.time.median < min(one.time.median for one in own):
            found.setdefault(f"{wait.scene}, {wait.way}", []).append(wait.tracer)
    head = f"Where another program is ahead of cltrace; errors within {100 * EQUAL:g} % of each other are equal:"
    lines = [f"- {where}: {'; '.join(who)}" for where, who in found.items()]
    return "\n".join([f"{head}{'' if lines else ' nowhere.'}", "", *lines]).rstrip()


def _error(point: Measurement) -> float:
    """By which points are compared: RMS of what stands on a curve, else the share of pixels that differ."""
    found = point.differ if point.level is None else point.rms
    return math.nan if found is None else found


# ------------------------------------------------------------------------------------------------------------ the page


def publish(results: Results, counted: bool) -> list[Path]:
    """Writes docs/benchmark.md, its results and figures; of counted work alone, that and the page. Returns the files.

    counted: whether the counted work is that of today's code. Raises UsageError outside of a checkout.
    """
    if not (ROOT / PAGE).exists():
        raise UsageError("--publish writes docs/benchmark.md, and this is no checkout")
    written: list[Path] = []

    def write(path: Path, text: str) -> None:
        with whole_file(ROOT / path) as file:
            file.write(text.encode())
        written.append(path)

    if results.points:
        from .plots import save  # matplotlib takes a second to load, and need not be there

        write(RESULTS, results.as_json())
        written += [PAGE.parent / name for name in save(results, ROOT / PAGE.parent)]
    if counted and results.work:
        about = {"device": results.about["device"]}  # without what changes each day
        write(COUNTED, Results(about, work=results.work, finished=True).as_json())
    text = (ROOT / PAGE).read_text("utf-8")
    head, _, tail = re.split(f"({BEGIN}.*?{END})", text, maxsplit=1, flags=re.DOTALL)
    write(PAGE, head + block(load(ROOT / RESULTS), load(ROOT / COUNTED).work) + tail)
    return written


def block(published: Results, work: Work) -> str:
    """What stands between BEGIN and END: whether the figures are those of today's code, and the tables."""
    return "\n\n".join(filter(None, (BEGIN, aged(published.work, work), summary(published).rstrip(), END)))


def aged(old: Work, now: Work) -> str:
    """Says that the figures are older than the code, if a frame takes other work today; else nothing."""
    scenes = [scene for scene in dict.fromkeys([*old, *now]) if old.get(scene) != now.get(scene)]
    text = f"the counted work of {len(scenes)} scenes has changed."
    return f"**These figures are older than the code**: {text}" if scenes else ""
