"""The figures: time against error, antialiasing, growth, for light and for dark pages. Only this has matplotlib."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from . import machine
from .points import Point, Results
from .report import by_group, complete, mean_time, steady, tracers_of, worst_share
from .scenes import GROWTH_PIXELS, GROWTH_SPHERES

# By what their files' names end in: ink, fine lines, paper.
SCHEMES = {"": ("#1f2328", "#d5d9de", "#ffffff"), "-dark": ("#d6dde5", "#30363d", "#0d1117")}
# Colour, mark and text of each tracer. The palette is that of Okabe and Ito, which colour-blind people can tell apart,
# and what can be seen on both papers; what is not cltrace has marks of its own, too.
LOOKS = {
    "accurate": ("#2f81d1", "o", "cltrace, accurate"),
    "double": ("#009E73", "o", "cltrace, double"),
    "single": ("#c98500", "o", "cltrace, single"),
    "textbook": ("#D55E00", "D", "textbook, float32 with epsilon"),
    "Embree": ("#CC79A7", "P", "Embree"),
    "POV-Ray": ("#8a8f98", "X", "POV-Ray"),
    "Mitsuba 3": ("#1f9ab5", "p", "Mitsuba 3"),
    "Open3D": ("#9a6fd0", "h", "Open3D"),
    "VTK (no shadows)": ("#a0785a", "*", "VTK (no shadows)"),
}
# A variant has a hollow mark, but for curves of samples, which everybody has.
VARIANTS = {"no lists": "s", "no skipping": "^"}
FILLED = ("", "samples")
# What the whole time of those is whose growth with the scene is of interest.
WHOLE = {"accurate": "with packing and making lists", "Embree": "with building its tree"}
FRAME = "time of a frame (ms)"


def figures(results: Results, device: str, scheme: str = "") -> dict[str, Figure]:
    """By file name: those figures for which there is something on this device, as label. Peers are on all devices."""
    ink, fine, paper = SCHEMES[scheme]
    style: dict[str, Any] = {
        "figure.dpi": 120, "font.size": 11, "axes.titlesize": 12, "axes.spines.top": False,
        "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True, "grid.color": fine, "text.color": ink,
        "axes.labelcolor": ink, "axes.edgecolor": ink, "axes.titlecolor": ink, "xtick.color": ink, "ytick.color": ink,
        "figure.facecolor": paper, "axes.facecolor": paper,
    }  # fmt: skip
    points = [point for point in results.points if point.device in (device, "") and point.kernel]
    curves = [point for point in points if point.level is not None]
    rest = [point for point in points if point.level is None]
    with mpl.rc_context(style):  # type: ignore[arg-type]
        out = {
            "time-error": time_error(rest, Page(results)),
            "antialiasing": antialiasing(curves, Page(results)),
            "growth": growth(rest, Page(results)),
        }
        drawn = {name: figure for name, figure in out.items() if figure}
        for figure in drawn.values():
            figure.draw_without_rendering()  # ticks are made now, in these colours
    return drawn


class Page:
    """What all figures have: a title, a warning if the machine was loaded, and, at the foot, where they come from."""

    def __init__(self, results: Results) -> None:
        self._about, self._loaded, self._left_out = machine.sentence(results.about), results.loaded, 0

    def steady(self, points: Iterable[Sequence[Point]]) -> list[Sequence[Point]]:
        """Those of which all repeated rounds agree. The others are counted."""
        every = list(points)
        kept = [some for some in every if steady(some)]
        self._left_out += len(every) - len(kept)
        return kept

    def figure(self, width: float, height: float, title: str, foot: str = "") -> Figure:
        """An empty one of this size in inches."""
        left_out = f"{self._left_out} not drawn: repeated rounds do not agree within 10 %." if self._left_out else ""
        lines = textwrap.wrap(" ".join(part for part in (foot, left_out, self._about) if part), int(15.5 * width))
        below, above = (0.1 + 0.15 * len(lines)) / height, (0.7 if self._loaded else 0.4) / height
        figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(rect=(0, below, 1, 1 - below - above)))
        figure.suptitle(title, fontsize=14, x=0.02, y=1 - 0.08 / height, va="top", ha="left", weight="bold")
        figure.text(0.02, 0.05 / height, "\n".join(lines), fontsize=8, va="bottom")
        if self._loaded:
            figure.text(0.02, 1 - 0.4 / height, self._loaded, fontsize=12, va="top", color="#e5484d", weight="bold")
        return figure


class Marks:
    """The legend's entries of those that were drawn."""

    def __init__(self) -> None:
        self._drawn: dict[str, Line2D] = {}

    def of(self, point: Point, line: str = "") -> dict[str, Any]:
        """For Axes.plot; the same for the legend."""
        color, mark, text = LOOKS.get(point.tracer) or ("#6f9a28", "d", point.tracer)
        style: dict[str, Any] = {
            "linestyle": line,
            "marker": VARIANTS.get(point.variant, mark),
            "color": color,
            "markersize": 7,
            "markeredgewidth": 1.4,
        }
        if point.variant not in FILLED:
            style["markerfacecolor"] = "none"
        label = f"{text}, {point.variant}" if point.variant else text
        self._drawn.setdefault(label, Line2D([], [], **style))
        return style

    def legend(self, ax: Axes, more: dict[str, Line2D]) -> None:
        """In a panel that is left over."""
        drawn = self._drawn | more
        ax.axis("off")
        ax.legend(drawn.values(), drawn.keys(), loc="upper left", frameon=False, fontsize=10.5, labelspacing=0.6)


def percent_tick(y: float) -> str:
    """A share, as few characters as will do."""
    return f"{100 * y:g} %" if y >= 1e-5 else f"$10^{{{round(math.log10(y)) + 2}}}$ %"


def _panels(page: Page, count: int, title: str, foot: str) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels, and one more for the legend."""
    lines = math.ceil((count + 1) / 4)
    columns = math.ceil((count + 1) / lines)
    figure = page.figure(max(3.6 * columns, 8), 3.2 * lines + 0.9, title, foot)
    axes = list(figure.subplots(lines, columns, squeeze=False).ravel())
    for ax in axes[count + 1 :]:
        ax.axis("off")
    return figure, axes


def _scale(axes: Iterable[Axes], errors: Iterable[float], tick: Callable[[float], str]) -> float:
    """Logarithmic scales for times and these errors. An error of 0 has a place below all others, which is returned."""
    positive = [y for y in errors if 0 < y < math.inf]
    low = math.floor(math.log10(min(positive, default=1e-6)))
    high = max(math.ceil(math.log10(max(positive, default=1.0))), low + 1)
    zero = 10.0 ** (low - 1)
    decades = [10.0**k for k in range(low, high + 1, 1 if high - low <= 6 else 2)]
    for ax in axes:
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylim(zero / 2.5, 10.0**high * 2)
        ax.yaxis.set_major_locator(FixedLocator([zero, *decades]))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: "0" if y < zero * 1.01 else tick(y)))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.axhline(zero * math.sqrt(10), color="#8a8f98", linewidth=0.8, linestyle=(0, (4, 4)))
        _plain_ticks(ax)
    return zero


def _plain_ticks(ax: Axes) -> None:
    """Times as plain numbers, of which there are few if the axis is long."""

    def text(x: float, _: object) -> str:
        low, high = ax.get_xlim()
        return f"{x:g}" if high < 300 * low or f"{x:.0e}".startswith("1") else ""

    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(text))
    ax.xaxis.set_minor_formatter(NullFormatter())


def time_error(points: Sequence[Point], page: Page) -> Figure | None:
    """A panel for each class of scenes: time and share of wrong pixels of each tracer, and the Pareto front.

    None if nothing is known of that.
    """
    groups = by_group(points)
    panels: dict[str, list[Sequence[Point]]] = {}
    left_out: dict[str, int] = {}
    for group, some in groups.items():
        known = [
            mine for mine in tracers_of(some).values() if complete(mine, some) and not math.isnan(worst_share(mine))
        ]
        if drawn := page.steady(known):
            panels[group] = drawn
            left_out[group] = len(known) - len(drawn)
    if not panels:
        return None
    foot = "A mark: geometric means of the medians of a class's scenes, with quartiles; the worst of their errors."
    figure, axes = _panels(page, len(panels), "Time of a frame against wrong pixels, by class of scenes", foot)
    zero = _scale(axes[: len(panels)], [worst_share(m) for some in panels.values() for m in some], percent_tick)
    marks = Marks()
    times = [mean_time(mine).median for drawn in panels.values() for mine in drawn]
    for ax, (group, drawn) in zip(axes, panels.items(), strict=False):
        _front(ax, [(1e3 * mean_time(mine).median, worst_share(mine)) for mine in drawn], zero)
        for mine in drawn:
            time, style = mean_time(mine), marks.of(mine[0])
            y = max(worst_share(mine), zero)
            ax.plot([1e3 * time.low, 1e3 * time.high], [y, y], color=str(style["color"]), linewidth=1.4)
            ax.plot([1e3 * time.median], [y], **style)
        # Of a front that lacks some, nobody should think that it is all of it.
        ax.set_title(f"{group} ({left_out[group]} not drawn)" if left_out[group] else group)
        ax.set_xlim(1e3 * min(times) / 1.8, 1e3 * max(times) * 1.8)
        ax.set_xlabel(FRAME)
    figure.supylabel("pixels that differ from the truth", fontsize=11)
    ring = Line2D([], [], linestyle="", marker="o", color="#8a8f98", markerfacecolor="none", markersize=13)
    marks.legend(axes[len(panels)], {"Pareto front: nothing else here is\nboth faster and more accurate": ring})
    return figure


def _front(ax: Axes, points: Sequence[tuple[float, float]], zero: float) -> None:
    """Rings around what nothing beats, and the line along them, which goes down where a tracer is slower and better."""
    front, best = [], math.inf
    for x, y in sorted(points):
        if y < 0.99 * best:  # less is the luck of the draw
            best = y
            front.append((x, max(y, zero)))
    along, up = [x for x, _ in front], [y for _, y in front]
    ax.step(along, up, where="post", color="#8a8f98", linewidth=1.2, zorder=1)
    ax.scatter(along, up, s=190, facecolors="none", edgecolors="#8a8f98", linewidths=1.2, zorder=1)


def antialiasing(points: Sequence[Point], page: Page) -> Figure | None:
    """A panel for each scene: time and RMS error of the curve of each tracer. None if there is nothing to draw."""
    panels: dict[tuple[str, str], list[Point]] = {}
    for (point,) in page.steady([point] for point in points if point.rms is not None):
        panels.setdefault((point.group, point.scene), []).append(point)
    if not panels:
        return None
    foot = "Beside the ends of each curve: rays across a pixel, or members of a light."
    figure, axes = _panels(page, len(panels), "Antialiasing and soft light: time against error", foot)
    zero = _scale(axes[: len(panels)], [p.rms or 0 for some in panels.values() for p in some], lambda y: f"{y:g}")
    marks = Marks()
    for ax, ((group, scene), some) in zip(axes, panels.items(), strict=False):
        for name in dict.fromkeys((p.tracer, p.variant, p.device) for p in some):
            mine = sorted((p for p in some if (p.tracer, p.variant, p.device) == name), key=lambda p: p.level or 0)
            x, y = [1e3 * p.time.median for p in mine], [max(p.rms or 0, zero) for p in mine]
            ax.plot(x, y, linewidth=1.4, **marks.of(mine[0], "-"))
            for k in {0, len(mine) - 1}:
                ax.annotate(f"{mine[k].level:g}", (x[k], y[k]), (5, 4), textcoords="offset points", fontsize=9)
        ax.set_title(f"{group}:\n{scene}", fontsize=11)
        ax.set_xlabel(FRAME)
    figure.supylabel("RMS error in levels of 255", fontsize=11)
    marks.legend(axes[len(panels)], {})
    return figure


def growth(points: Sequence[Point], page: Page) -> Figure | None:
    """Time of a frame and, dotted, of the whole way by spheres and by pixels. None if there is nothing to draw."""
    kinds = [(GROWTH_SPHERES, "spheres (640x360 pixels)"), (GROWTH_PIXELS, "pixels (300 spheres)")]
    lines = {group: list(tracers_of(p for p in points if p.group == group).values()) for group, _ in kinds}
    lines = {group: [[p for (p,) in page.steady([p] for p in mine)] for mine in some] for group, some in lines.items()}
    shown = [(group, text) for group, text in kinds if any(lines[group])]
    if not shown:
        return None
    figure = page.figure(4.6 * len(shown) + 3.6, 5, "Time of a frame by spheres and by pixels")
    axes = figure.subplots(1, len(shown) + 1, width_ratios=[1.0] * len(shown) + [0.6])
    marks, more = Marks(), {}
    for ax, (group, text) in zip(axes, shown, strict=False):
        for mine in filter(None, lines[group]):
            x, style = [_extent(point) for point in mine], marks.of(mine[0], "-")
            ax.plot(x, [1e3 * point.time.median for point in mine], linewidth=1.6, **style)
            name = mine[0].tracer
            if name in WHOLE and not mine[0].variant:
                dotted = {**style, "linestyle": ":", "linewidth": 1.4}
                ax.plot(x, [1e3 * point.way.median for point in mine], **dotted)
                more[f"{LOOKS[name][2]},\n{WHOLE[name]}"] = Line2D([], [], **dotted)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel(text)
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    axes[0].set_ylabel("time (ms)")
    marks.legend(axes[-1], more)
    return figure


def _extent(point: Point) -> int:
    return point.spheres if point.group == GROWTH_SPHERES else math.prod(point.size)
