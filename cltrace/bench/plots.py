"""The figures: time against error, antialiasing, growth, for light and for dark pages. Only this has matplotlib."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from cltrace.picture.files import whole_file

from .measure import Measurement, Results, Spread, sentence
from .report import by_group, by_label, complete, mean_time, percent, worst_share
from .scenes import GROWTH_PIXELS, GROWTH_SPHERES

# By what their files' names end in: ink, fine lines, paper.
SCHEMES = {"": ("#1f2328", "#d5d9de", "#ffffff"), "-dark": ("#d6dde5", "#30363d", "#0d1117")}
GREY = "#8a8f98"
# Colour, mark and text of each tracer. The palette is that of Okabe and Ito, which colour-blind people can tell apart,
# and what can be seen on both papers; what is not cltrace has marks of its own, too.
LOOKS = {
    "accurate": ("#2f81d1", "o", "cltrace, accurate"),
    "double": ("#009E73", "o", "cltrace, double"),
    "single": ("#c98500", "o", "cltrace, single"),
    "Embree": ("#CC79A7", "P", "Embree"),
    "POV-Ray": (GREY, "X", "POV-Ray"),
    "Mitsuba 3": ("#1f9ab5", "p", "Mitsuba 3"),
}
OTHER = ("#6f9a28", "d", "")
# Variants have hollow marks, except for curves of samples, which everybody has.
FILLED = ("", "samples")
# Those whose whole time is of interest where a scene grows, and what is in it.
WHOLE = {"accurate": "with packing and making lists", "Embree": "with building its tree"}
FRAME = "time of a frame (ms)"


def save(results: Results, folder: Path) -> list[str]:
    """Writes the figures for which there is something, in both schemes. Returns the files' names."""
    names = []
    for scheme in SCHEMES:
        for name, figure in figures(results, scheme).items():
            names.append(f"{name}{scheme}.png")
            with whole_file(folder / names[-1]) as file:
                about = {"Description": sentence(results.about), "Software": None}
                figure.savefig(file, format="png", metadata=about)
    return names


def figures(results: Results, scheme: str = "") -> dict[str, Figure]:
    """Those for which there is something, by name."""
    ink, fine, paper = SCHEMES[scheme]
    style: dict[str, Any] = {
        "figure.dpi": 120, "font.size": 11, "axes.titlesize": 12, "axes.spines.top": False,
        "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True, "grid.color": fine, "text.color": ink,
        "axes.labelcolor": ink, "axes.edgecolor": ink, "axes.titlecolor": ink, "xtick.color": ink, "ytick.color": ink,
        "figure.facecolor": paper, "axes.facecolor": paper,
    }  # fmt: skip
    points = [point for point in results.points if point.frames]
    with mpl.rc_context(style):  # type: ignore[arg-type]
        drawn = {
            "time-error": time_error([point for point in points if point.level is None], results),
            "antialiasing": antialiasing([point for point in points if point.level is not None], results),
            "growth": growth(points, results),
        }
        for figure in filter(None, drawn.values()):
            figure.draw_without_rendering()  # ticks are made now, in these colours
    return {name: figure for name, figure in drawn.items() if figure}


def page(results: Results, width: float, height: float, title: str, foot: str, left_out: int) -> Figure:
    """An empty figure of this size in inches: a title, a warning if the machine was loaded, and at the foot what the
    figure shows, how many marks are left out, and where it comes from."""
    wavering = f"{left_out} not drawn: repeated rounds do not agree within 10 %." if left_out else ""
    said = " ".join(filter(None, (foot, wavering, sentence(results.about))))
    lines = textwrap.wrap(said, int(15.5 * width))
    below, above = (0.1 + 0.15 * len(lines)) / height, (0.7 if results.loaded else 0.4) / height
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(rect=(0, below, 1, 1 - below - above)))
    figure.suptitle(title, fontsize=14, x=0.02, y=1 - 0.08 / height, va="top", ha="left", weight="bold")
    figure.text(0.02, 0.05 / height, "\n".join(lines), fontsize=8, va="bottom")
    if results.loaded:
        figure.text(0.02, 1 - 0.4 / height, results.loaded, fontsize=12, va="top", color="#e5484d", weight="bold")
    return figure


class Marks:
    """The legend's entries of those that were drawn."""

    def __init__(self) -> None:
        self.drawn: dict[str, Line2D] = {}

    def of(self, point: Measurement, line: str, more: str = "") -> dict[str, Any]:
        """For Axes.plot; the same for the legend, where `more` says what the line is."""
        color, mark, text = LOOKS.get(point.tracer, OTHER)
        style: dict[str, Any] = {"linestyle": line, "marker": mark, "color": color, "markersize": 7}
        if point.variant not in FILLED:
            style["markerfacecolor"] = "none"
        name = ", ".join(filter(None, (text or point.tracer, point.variant)))
        self.drawn.setdefault(f"{name},\n{more}" if more else name, Line2D([], [], **style))
        return style

    def legend(self, axes: Sequence[Axes]) -> None:
        """In the first of the panels that are left over."""
        for ax in axes:
            ax.axis("off")
        axes[0].legend(self.drawn.values(), self.drawn.keys(), loc="upper left", frameon=False, fontsize=10.5)


# What a panel shows of one tracer: a point that stands for it, and by level, times and errors.
Curve = tuple[Measurement, list[tuple[int | None, Spread, float]]]


def time_error(points: Sequence[Measurement], results: Results) -> Figure | None:
    """A panel for each class of scenes: time and share of wrong pixels of each tracer, and the Pareto front."""
    panels: dict[str, list[Curve]] = {}
    for group, some in by_group(points).items():
        for mine in by_label(some).values():
            if complete(mine, some) and not math.isnan(share := worst_share(mine)):
                panels.setdefault(group, []).append((mine[0], [(None, mean_time(mine), share)]))
    foot = "A mark: geometric means of the medians of a class's scenes, with quartiles; the worst of their errors."
    title = "Time of a frame against wrong pixels, by class of scenes"
    return error_figure(panels, results, title, foot, "pixels that differ from the truth", percent)


def antialiasing(points: Sequence[Measurement], results: Results) -> Figure | None:
    """A panel for each scene: time and RMS error of the curve of each tracer, and the Pareto front."""
    panels: dict[str, list[Curve]] = {}
    for name in dict.fromkeys((p.group, p.scene, p.tracer, p.variant) for p in points):
        mine = [p for p in points if (p.group, p.scene, p.tracer, p.variant) == name and p.rms is not None]
        if mine:
            curve = [(p.level, p.time, p.rms or 0.0) for p in mine]
            panels.setdefault(f"{name[0]}:\n{name[1]}", []).append((mine[0], curve))
    foot = "Beside the ends of each curve: rays across a pixel."
    title = "Antialiasing: time against error"
    return error_figure(panels, results, title, foot, "RMS error in levels of 255", lambda y: f"{y:g}")


def error_figure(
    panels: dict[str, list[Curve]], results: Results, title: str, foot: str, label: str, tick: Callable[[float], str]
) -> Figure | None:
    """Panels of times and errors, and one more for the legend; None if there is nothing to draw. An error of 0 has a
    place of its own below all others."""
    every = [(time, error) for curves in panels.values() for _, curve in curves for _, time, error in curve]
    steady = [(time.median, error) for time, error in every if time.steady]
    if not steady:
        return None
    lines = math.ceil((len(panels) + 1) / 4)
    columns = math.ceil((len(panels) + 1) / lines)
    figure = page(results, max(3.6 * columns, 8), 3.2 * lines + 0.9, title, foot, len(every) - len(steady))
    axes = list(figure.subplots(lines, columns, squeeze=False).ravel())
    positive = [error for _, error in steady if 0 < error < math.inf]
    low = math.floor(math.log10(min(positive, default=1e-6)))
    high = max(math.ceil(math.log10(max(positive, default=1.0))), low + 1)
    zero, marks = 10.0 ** (low - 1), Marks()
    for ax, (name, curves) in zip(axes, panels.items(), strict=False):
        drawn: list[tuple[float, float]] = []
        left_out = 0
        for point, curve in curves:
            kept = [(level, time, max(error, zero)) for level, time, error in curve if time.steady]
            left_out += len(curve) - len(kept)
            x, y = [1e3 * time.median for _, time, _ in kept], [error for _, _, error in kept]
            if kept:
                ax.plot(x, y, **marks.of(point, "-" if len(kept) > 1 else ""))
            for k in {0, len(kept) - 1} if len(kept) > 1 else ():
                ax.annotate(str(kept[k][0]), (x[k], y[k]), (5, 4), textcoords="offset points", fontsize=9)
            for _, time, error in kept:
                color = LOOKS.get(point.tracer, OTHER)[0]
                ax.plot([1e3 * time.low, 1e3 * time.high], [error, error], color=color, linewidth=1.4)
            drawn += zip(x, y, strict=True)
        front(ax, drawn)
        # Nobody should take a front that lacks some for all of it.
        ax.set_title(f"{name} ({left_out} not drawn)" if left_out else name, fontsize=11)
        ax.set(xscale="log", yscale="log", xlabel=FRAME, ylim=(zero / 2.5, 10.0**high * 2))
        ax.set_xlim(1e3 * min(steady)[0] / 1.8, 1e3 * max(steady)[0] * 1.8)
        ax.yaxis.set_major_locator(FixedLocator([zero, *(10.0**k for k in range(low, high + 1))]))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: "0" if y < zero * 1.01 else tick(y)))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.axhline(zero * math.sqrt(10), color=GREY, linewidth=0.8, linestyle=(0, (4, 4)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
    figure.supylabel(label, fontsize=11)
    ring = Line2D([], [], linestyle="", marker="o", color=GREY, markerfacecolor="none", markersize=13)
    marks.drawn["Pareto front: nothing else here is\nboth faster and more accurate"] = ring
    marks.legend(axes[len(panels) :])
    return figure


def front(ax: Axes, points: Iterable[tuple[float, float]]) -> None:
    """Rings around what nothing beats, and the line along them, which goes down where a tracer is slower and better."""
    along, up, best = [], [], math.inf
    for x, y in sorted(points):
        if y < 0.99 * best:  # less is the luck of the draw
            best = y
            along.append(x)
            up.append(y)
    ax.step(along, up, where="post", color=GREY, linewidth=1.2, zorder=1)
    ax.scatter(along, up, s=190, facecolors="none", edgecolors=GREY, linewidths=1.2, zorder=1)


def growth(points: Sequence[Measurement], results: Results) -> Figure | None:
    """Time of a frame and, dotted, of the whole way by spheres and by pixels. None if there is nothing to draw."""
    kinds = {GROWTH_SPHERES: "spheres (640x360 pixels)", GROWTH_PIXELS: "pixels (300 spheres)"}
    grown = [point for point in points if point.group in kinds]
    steady = [point for point in grown if point.time.steady]
    if not steady:
        return None
    figure = page(results, 13, 5, "Time of a frame by spheres and by pixels", "", len(grown) - len(steady))
    axes, marks = figure.subplots(1, 3, width_ratios=[1.0, 1.0, 0.6]), Marks()
    for ax, (group, text) in zip(axes, kinds.items(), strict=False):
        for name, mine in by_label(point for point in steady if point.group == group).items():
            x = [point.surfaces if group == GROWTH_SPHERES else math.prod(point.size) for point in mine]
            ax.plot(x, [1e3 * point.time.median for point in mine], linewidth=1.6, **marks.of(mine[0], "-"))
            dotted = marks.of(mine[0], ":", WHOLE.get(name, "whole"))
            ax.plot(x, [1e3 * Spread.of(point.whole).median for point in mine], **dotted)
        ax.set(xscale="log", yscale="log", xlabel=text)
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    axes[0].set_ylabel("time (ms)")
    marks.legend([axes[-1]])
    return figure
