"""What was measured, as tables and as JSON."""

from __future__ import annotations

import contextlib
import json
import math
import platform
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

from cltrace.base.arrays import processors

from .errors import Errors
from .measure import Row, median
from .scenes import GROUPS

COLUMNS = ("kernel ms", "median", "whole ms", "median", "wrong ids", "t ulp", "normal rad", "false sh.", "leaks",
           "colour max", "RMS", "bytes differ")  # fmt: skip


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
    return "" if share is None else f"{number(100 * share)} %"


def cells(row: Row) -> list[str]:
    """A row's texts under COLUMNS, with times in ms."""
    times = [number(1e3 * value, 3) for values in (row.kernel, row.whole) for value in _best_and_median(values)]
    e = row.errors
    if e is None:
        return [*times, *[""] * 7, percent(row.differ)]
    counts = (e.wrong_ids, e.t_ulp, e.normal, e.false_shadows, e.leaks, e.color_max, e.color_rms)
    return [*times, *(number(float(x)) if isinstance(x, float) else f"{x:,}" for x in counts), percent(row.differ)]


def _best_and_median(values: list[float]) -> tuple[float, float]:
    return min(values, default=math.nan), median(values)


def title(row: Row) -> str:
    width, height = row.case.scene.camera.resolution
    counts = {"sphere": len(row.case.scene.columns), "triangle": row.case.scene.triangles}
    shapes = ", ".join(f"{n:,} {name}{'s' * (n != 1)}" for name, n in counts.items() if n or name == "sphere")
    return f"{row.case.group}: {row.case.name} ({shapes}, {width}x{height})"


def scene_table(rows: Sequence[Row]) -> str:
    """The rows of one scene, for a terminal."""
    devices = list(dict.fromkeys(row.device for row in rows if row.device))
    sample = next((row.sample.pixels for row in rows if row.sample), 0)
    lines = [["", *COLUMNS]]
    notes = []
    for row in rows:
        where = f" [{devices.index(row.device)}]" if len(devices) > 1 and row.device else ""
        if row.kernel or row.whole or row.errors:
            star = "*" if row.picture is None and row.sample is not None else ""
            lines.append([row.label + where + star, *cells(row)])
        if row.note:
            notes.append(f"{row.label}{where}: {row.note}")
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    table = [title(rows[0])]
    table += [
        "  "
        + "  ".join(c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(line, widths, strict=True)))
        for line in lines
    ]
    if any(line[0].endswith("*") for line in lines):
        table.append(f"  * is what whole pictures are held against; its own errors are those of {sample} exact pixels")
    return "\n".join([line.rstrip() for line in table] + [f"  {note}" for note in notes])


def by_group(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by class of scene, in the order of GROUPS; only of classes that have some."""
    rows = list(rows)
    return {group: mine for group in GROUPS if (mine := [r for r in rows if r.case.group == group and r.kernel])}


def tracers_of(rows: Iterable[Row]) -> dict[tuple[str, str], list[Row]]:
    """Rows by label and device, in the order in which they were measured."""
    out: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        out.setdefault((row.label, row.device), []).append(row)
    return out


def mean_time(rows: Sequence[Row]) -> float:
    """The geometric mean of the rows' best kernel times, in seconds."""
    return math.exp(sum(math.log(row.best) for row in rows) / len(rows))


def worst(rows: Iterable[Row], name: str) -> float:
    """The largest error of one kind, by the name of a field of Errors; NaN if none is known."""
    return max((float(getattr(row.errors, name)) for row in rows if row.errors), default=math.nan)


def worst_share(rows: Iterable[Row]) -> float:
    """The largest share of pixels that differ; NaN if none is known."""
    return max((row.differ for row in rows if row.differ is not None), default=math.nan)


def complete(rows: Sequence[Row], group: Sequence[Row]) -> bool:
    """Whether a tracer has drawn all scenes of a class: otherwise its mean time cannot be compared."""
    return {row.case.name for row in rows} == {row.case.name for row in group}


def summary(rows: Sequence[Row], about: dict[str, Any]) -> str:
    """The table of docs/benchmark.md, in Markdown: time and error of each tracer by class, and its worst errors."""
    rows = [row for row in rows if row.kernel and not row.variant and row.case.group in GROUPS]
    groups = by_group(rows)
    devices = list(dict.fromkeys(row.device for row in rows if row.device))
    columns = [["", *groups, "wrong surfaces", "distance off by", "false shadows, leaks"]]
    for (label, device), mine in tracers_of(rows).items():
        column = [f"{label}, {device}" if len(devices) > 1 and device else label]
        for group in groups.values():
            here = [row for row in mine if row in group]
            ok = here and complete(here, group)
            column.append(f"{number(1e3 * mean_time(here))} ms, {percent(worst_share(here))}" if ok else "")
        columns.append(column + _worst_errors(mine))
    lines = list(zip(*columns, strict=True))
    out = ["| " + " | ".join(line) + " |" for line in (lines[0], ["---"] * len(columns), *lines[1:])]
    return "\n".join([*out, "", machine_line(about)]) + "\n"


def _worst_errors(rows: Sequence[Row]) -> list[str]:
    """Of one tracer, in all scenes: wrong surfaces, the largest error of a distance, false shadows and leaks."""
    known = [row.errors for row in rows if row.errors]
    if not known:
        return [""] * 3
    shadows, leaks = (sum(getattr(e, name) for e in known) for name in ("false_shadows", "leaks"))
    return [f"{sum(e.wrong_ids for e in known):,}", f"{number(worst(rows, 't_ulp'))} ulp", f"{shadows:,}, {leaks:,}"]


def machine_line(about: dict[str, Any]) -> str:
    """One sentence that names machine, drivers and day."""
    drivers = "; ".join(about["devices"])
    where = f"{about['cores']} cores of {about['cpu']}, {drivers}"
    return f"Measured on {about['date']} with cltrace {about['cltrace']} on {where}."


def about(devices: Sequence[str], date: str) -> dict[str, Any]:
    """The machine, for results.json and the tables."""
    cpu = platform.processor() or platform.machine()
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                cpu = line.partition(":")[2].strip()
                break
    return {
        "date": date,
        "cltrace": metadata.version("cltrace"),
        "cpu": cpu,
        "cores": processors(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "devices": list(devices),
    }


def as_json(rows: Sequence[Row], about: dict[str, Any], finished: bool) -> str:
    """Everything that was measured, as JSON. Times are in seconds; what is infinite or NaN is null."""
    everything = {"about": about, "finished": finished, "rows": [_plain(row) for row in rows]}
    return json.dumps(everything, indent=1, allow_nan=False) + "\n"


def _plain(row: Row) -> dict[str, Any]:
    return {
        "scene": row.case.name,
        "class": row.case.group,
        "spheres": len(row.case.scene.columns),
        "triangles": row.case.scene.triangles,
        "size": list(row.case.scene.camera.resolution),
        "tracer": row.name,
        "variant": row.variant,
        "keep": list(row.keep),
        "device": row.device,
        "kernel": row.kernel,
        "whole": row.whole,
        "errors": {
            "picture": _numbers(row.picture),
            "sample": _numbers(row.sample),
            "bytes_differ": row.differ,
            "bytes_off": row.off,
        },
        "note": row.note,
    }


def _numbers(errors: Errors | None) -> dict[str, float | None] | None:
    """The errors by name, None for what is infinite or NaN, as JSON has neither."""
    return {name: x if math.isfinite(x) else None for name, x in asdict(errors).items()} if errors else None
