"""What was measured, as plain data, and as results.json, which holds all of it."""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from cltrace.base.errors import UsageError

from .errors import Errors

# Rounds agree where the quartiles of their times are no further apart than this share of the median, of so many rounds.
AGREE, LEAST_ROUNDS = 0.1, 3


@dataclass(frozen=True)
class Spread:
    """Seconds of repeated rounds: the median and the quartiles."""

    low: float
    median: float
    high: float
    rounds: int

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Spread:
        """NaN of nothing."""
        if len(seconds) < 2:
            only = next(iter(seconds), math.nan)
            return cls(only, only, only, len(seconds))
        low, median, high = statistics.quantiles(seconds, n=4, method="inclusive")
        return cls(low, median, high, len(seconds))

    @property
    def steady(self) -> bool:
        """Whether the rounds agree, so that their median says something."""
        return self.rounds >= LEAST_ROUNDS and self.high - self.low <= AGREE * self.median


@dataclass(frozen=True)
class Point:
    """What was measured of one tracer on one scene.

    group: the scene's class, a row of scenes.GROUPS; spheres, triangles, cylinders: how many the scene has; size: of
    the picture in pixels; tracer, variant, level, version, device: of tracers.Tracer; keep: what cltrace did not skip.

    kernel: seconds of a frame, the median of each round; whole: seconds of each round, as of tracers.Run; picture:
    errors of the whole picture, and sample: of some pixels against exact arithmetic; differ: share of the picture's
    pixels of which a byte differs from the truth, and off: by more than a level; rms: of all bytes from the truth, in
    levels of 255; truth: what that is, and how it is known; refused: as of Tracer.refuses(); note: why something is
    missing.
    """

    group: str
    scene: str
    spheres: int
    triangles: int
    cylinders: int
    size: tuple[int, int]
    tracer: str
    variant: str = ""
    level: float | None = None
    version: str = ""
    device: str = ""
    keep: tuple[str, ...] = ()
    kernel: tuple[float, ...] = ()
    whole: tuple[float, ...] = ()
    picture: Errors | None = None
    sample: Errors | None = None
    differ: float | None = None
    off: float | None = None
    rms: float | None = None
    truth: str = ""
    refused: tuple[str, ...] = ()
    note: str = ""

    @property
    def label(self) -> str:
        """The tracer with its variant and its place on a curve."""
        level = "" if self.level is None else f"{self.level:g}"
        return ", ".join(part for part in (self.tracer, f"{self.variant} {level}".strip()) if part)

    @property
    def key(self) -> tuple[str, ...]:
        """By which the same is found in other results."""
        return self.group, self.scene, f"{self.size[0]}x{self.size[1]}", self.label, self.device

    @property
    def time(self) -> Spread:
        """Of a frame with its readback."""
        return Spread.of(self.kernel)

    @property
    def way(self) -> Spread:
        """From the scene in memory to the picture in memory."""
        return Spread.of(self.whole)

    @property
    def errors(self) -> Errors | None:
        """Those of the whole picture, or of the sample if the picture is what others are held against.

        The largest errors are those of the sample where they are larger, as those of an exact normal are.
        """
        if not self.picture or not self.sample:
            return self.picture or self.sample
        most: dict[str, Any] = {name: max(getattr(self.picture, name), getattr(self.sample, name))
                for name in ("t_ulp", "normal", "color_max")}  # fmt: skip
        return replace(self.picture, **most)


@dataclass(frozen=True)
class Way:
    """What a user waits for: one way to a picture, from its beginning to its end, as often as there were rounds.

    scene, surfaces, size, tracer, version: as of a Point; way: a row of ways.WAYS; seconds: of each round; memory: at
    the peak, and read: by the process, both in bytes, None if that is not known.
    """

    scene: str
    surfaces: int
    size: tuple[int, int]
    tracer: str
    way: str
    version: str = ""
    seconds: tuple[float, ...] = ()
    memory: int | None = None
    read: int | None = None
    note: str = ""

    @property
    def key(self) -> tuple[str, ...]:
        """By which the same is found in other results."""
        return self.scene, f"{self.size[0]}x{self.size[1]}", self.tracer, self.way

    @property
    def time(self) -> Spread:
        return Spread.of(self.seconds)


Work = dict[str, dict[str, int]]


@dataclass
class Results:
    """A whole run.

    about: of machine.about() and Watch; work: what was counted, by scene; missing: why peers were not there; finished:
    whether all of it was measured.
    """

    about: dict[str, Any]
    points: list[Point] = field(default_factory=list)
    ways: list[Way] = field(default_factory=list)
    work: Work = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    finished: bool = False

    @property
    def loaded(self) -> str:
        """What the machine did beside, if that was so much that times are in doubt; else nothing."""
        return str(self.about.get("loaded", ""))

    def as_json(self) -> str:
        """A line for each point, way and number of counted work. Times are in seconds; "inf" and "nan" are texts."""
        lines = [f' "about": {_line(self.about)}', f' "finished": {_line(self.finished)}',
                 f' "missing": {_line(self.missing)}']  # fmt: skip
        for name in ("points", "ways"):
            lines.append(_rows(name, [_line(_told(asdict(row))) for row in getattr(self, name)]))
        lines.append(f' "work": {json.dumps(self.work, indent=1, ensure_ascii=False)}')
        return "{\n" + ",\n".join(lines) + "\n}\n"


def _line(value: Any) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def _rows(name: str, lines: Iterable[str]) -> str:
    inner = ",".join(f"\n  {line}" for line in lines)
    return f' "{name}": [{inner}]'


def _told(value: Any) -> Any:
    """The same without what is a default, and with numbers to 5 digits. What is infinite or NaN is a text."""
    if isinstance(value, dict):
        return {name: _told(v) for name, v in value.items() if v not in (None, "", (), [])}
    if isinstance(value, (list, tuple)):
        return [_told(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.5g}") if math.isfinite(value) else str(value)
    return value


def load(path: str | Path) -> Results:
    """What as_json() has written. Raises UsageError, with the file's name, for anything else."""
    try:
        read = json.loads(Path(path).read_text("utf-8"))
        return Results(
            about=dict(read["about"]),
            points=[Point(**_taken(row)) for row in read["points"]],
            ways=[Way(**_taken(row)) for row in read["ways"]],
            work={name: dict(counts) for name, counts in read["work"].items()},
            missing=list(read["missing"]),
            finished=bool(read["finished"]),
        )
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from None
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise UsageError(f"{path}: these are no results of cltrace-bench: {error}") from None


def _taken(row: dict[str, Any]) -> dict[str, Any]:
    """A row's fields as they were: tuples and Errors."""
    out = dict(row)
    for name in ("size", "keep", "kernel", "whole", "refused", "seconds"):
        if name in out:
            out[name] = tuple(out[name])
    for name in ("picture", "sample"):
        if name in out:
            given: dict[str, Any] = {k: float(v) if isinstance(v, str) else v for k, v in out[name].items()}
            out[name] = Errors(**given)
    return out
