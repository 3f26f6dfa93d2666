"""Where another program is ahead of cltrace: faster at an equal or a smaller error, or in what a user waits for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from .points import Point, Results, Way
from .scenes import GROUPS
from .texts import milliseconds, number, percent
from .tracers import Baseline

# Errors that are closer to each other than this share are equal: the luck of the draw.
EQUAL = 0.01


def error(point: Point) -> float | None:
    """By which points are compared: RMS of what stands on a curve, else the share of pixels that differ."""
    return point.rms if point.level is not None else point.differ


def faster(points: Iterable[Point]) -> list[str]:
    """A line for each point of a peer that is faster than one of ours, at an equal or a smaller error, and that none of
    ours beats."""
    return [
        f"{title}: {_told(peer)}, ours {_told(min(slower, key=_time))}"
        for title, peer, slower in _unbeaten(points)
        if slower
    ]


def beside(points: Iterable[Point]) -> list[str]:
    """A line for each scene in which points of peers beat none of ours, and none of ours beats them: what is faster is
    less right there, and the other way round."""
    alone = [(title, _told(peer)) for title, peer, slower in _unbeaten(points) if not slower]
    return [f"{title}: {'; '.join(text for _, text in some)}" for title, some in groupby(alone, lambda of: of[0])]


def sooner(ways: Sequence[Way]) -> list[str]:
    """A line for each scene and way in which a user waits less for a peer than for any of ours."""
    out = []
    for (scene, way), some in groupby(sorted(ways, key=_of), _of):
        timed = [one for one in some if one.seconds]
        ours = [one for one in timed if one.tracer.startswith("cltrace")]
        best = min(ours, key=lambda one: one.time.median, default=None)
        for one in timed:
            if best and one not in ours and one.time.median < best.time.median:
                out.append(
                    f"{scene}, {way}: {one.tracer} {milliseconds(one.time)} ms, ours {milliseconds(best.time)} ms"
                )
    return out


def told(results: Results) -> list[str]:
    """The lists of docs/benchmark.md, in Markdown."""
    parts = {
        "faster, at an equal or a smaller error": faster(results.points),
        "neither better nor worse: faster and less right than ours, or slower and more right": beside(results.points),
        "sooner, in what a user waits for": sooner(results.ways),
    }
    equal = f"errors that are within {100 * EQUAL:g} % of each other are equal"
    out = [f"Where another program is ahead of cltrace, or beside it; {equal}:", ""]
    for text, lines in parts.items():
        out += [f"- **{text}**:{'' if lines else ' nowhere'}", *(f"  - {line}" for line in lines)]
    return out


def _of(way: Way) -> tuple[str, str]:
    return way.scene, way.way


def _time(point: Point) -> float:
    return point.time.median


def _as_right(one: Point, other: Point) -> bool:
    """Whether the error of one is not larger than that of the other."""
    return (error(one) or 0.0) <= (1 + EQUAL) * (error(other) or 0.0)


def _told(point: Point) -> str:
    size = percent(point.differ) if point.level is None else f"RMS {number(point.rms or 0.0)}"
    return f"{point.label} {milliseconds(point.time)} ms at {size}"


def _unbeaten(points: Iterable[Point]) -> Iterator[tuple[str, Point, list[Point]]]:
    """The scene's name, a point of a peer that none of ours beats there, by being as fast and as right, and those of
    ours that are slower and not more right."""
    scenes: dict[tuple[str, str], list[Point]] = {}
    for point in points:
        if point.group in GROUPS and point.kernel and error(point) is not None:
            scenes.setdefault((point.group, point.scene), []).append(point)
    for (group, scene), some in scenes.items():
        ours = [point for point in some if not point.version and point.tracer != Baseline.name]
        for peer in (point for point in some if point.version and ours):
            if not any(_time(one) <= _time(peer) and _as_right(one, peer) for one in ours):
                slower = [one for one in ours if _time(one) > _time(peer) and _as_right(peer, one)]
                yield f"{group}, {scene}", peer, slower
