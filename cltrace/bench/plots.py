"""The figures: time against error, what was saved by skipping, growth. The one module that needs matplotlib."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from .measure import Row
from .report import by_group, complete, mean_time, number, tracers_of, worst, worst_share
from .scenes import GROWTH_PIXELS, GROWTH_SPHERES

# The palette of Okabe and Ito, which colour-blind people can tell apart; the textbook and the peers have shapes, too.
COLORS = {
    "accurate": "#0072B2",
    "double": "#009E73",
    "single": "#E69F00",
    "textbook": "#D55E00",
    "Embree": "#CC79A7",
    "POV-Ray": "#555555",
}
SHAPES = {"textbook": "D", "Embree": "P", "POV-Ray": "X"}
VARIANTS = {"": "o", "no lists": "s", "no skipping": "^", "neither": "v"}
# What the whole time of those is whose growth with the scene is of interest.
WHOLE = {"accurate": "with packing and making lists", "Embree": "with building its tree"}
GROUP_COLORS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#555555")

mpl.rcParams.update(
    {
        "figure.dpi": 100,
        "savefig.dpi": 120,
        "font.size": 11,
        "axes.titlesize": 12,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": "#e4e4e4",
        "axes.axisbelow": True,
        "svg.fonttype": "none",
        "svg.hashsalt": "cltrace",
    }
)


def figures(rows: Sequence[Row], device: str, about: str) -> dict[str, Figure]:
    """By file name: those figures for which there is something on this device. Peers are on all devices."""
    rows = [row for row in rows if row.device in (device, "") and row.kernel]
    out = {
        "time-error": time_against(
            rows,
            worst_share,
            "pixels that differ from the reference",
            percent_tick,
            "Run time against wrong pixels",
            about,
        ),
        "time-distance": time_against(
            rows,
            lambda some: worst(some, "t_ulp"),
            "largest error of a distance (ulp of float32)",
            lambda y: f"{y:g}" if 1e-3 < y < 1e4 else f"$10^{{{round(math.log10(y))}}}$",
            "Run time against error of distances; 0.5 ulp is rounding to float32",
            about,
        ),
        "skipped": bars(rows, about) if saved(rows) else None,
        "growth": growth(rows, about) if {GROWTH_SPHERES, GROWTH_PIXELS} & {row.case.group for row in rows} else None,
    }
    return {name: figure for name, figure in out.items() if figure}


def percent_tick(y: float) -> str:
    """A share, as few characters as will do."""
    return f"{100 * y:g} %" if y >= 1e-5 else f"$10^{{{round(math.log10(y)) + 2}}}$ %"


def _figure(width: float, height: float, title: str, about: str) -> Figure:
    """A figure of this size in inches, with a title and, at its foot, where it comes from."""
    foot = textwrap.wrap(about, int(16 * width))
    room = (0.1 + 0.15 * len(foot)) / height
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(rect=(0, room, 1, 1 - room)))
    figure.suptitle(title, fontsize=14, x=0.02, ha="left", weight="bold")
    figure.text(0.02, 0.05 / height, "\n".join(foot), fontsize=8, color="#555555", va="bottom")
    return figure


def time_against(
    rows: Sequence[Row],
    value: Callable[[Sequence[Row]], float],
    label: str,
    tick: Callable[[float], str],
    title: str,
    about: str,
) -> Figure | None:
    """One panel for each class of scenes: kernel time and this error of each tracer, and the Pareto front.

    None if that error is not known of anything.
    """
    groups = by_group(rows)
    panels = {
        group: [
            (name, variant, 1e3 * mean_time(mine), value(mine))
            for (name, variant), mine in _by_variant(some).items()
            if complete(mine, some) and not math.isnan(value(mine))
        ]
        for group, some in groups.items()
    }
    panels = {group: points for group, points in panels.items() if points}
    every = [point for points in panels.values() for point in points]
    if not every:
        return None
    positive = [y for *_, y in every if 0 < y < math.inf]
    # An error of exactly 0 has its own place, below the smallest one of the logarithmic scale.
    low = math.floor(math.log10(min(positive, default=1e-6)))
    high = max(math.ceil(math.log10(max(positive, default=1.0))), low + 1)
    zero = 10.0 ** (low - 1)
    columns = min(3, len(panels) + 1)
    lines = math.ceil((len(panels) + 1) / columns)
    if any(len({row.case.name for row in some}) > 1 for some in groups.values()):
        about = f"A mark: the geometric mean of the times of the class's scenes, and the worst of their errors. {about}"
    figure = _figure(4.4 * columns, 3.6 * lines + 0.9, title, about)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    left, right = min(x for _, _, x, _ in every), max(x for _, _, x, _ in every)
    for ax, (group, points) in zip(axes, panels.items(), strict=False):
        _panel(ax, points, zero)
        ax.set_title(group)
        ax.set_xlim(left / 1.8, right * 1.8)
        ax.set_ylim(zero / 2.5, 10.0**high * 2)
        decades = [10.0**k for k in range(low, high + 1, 1 if high - low <= 8 else 2)]
        ax.yaxis.set_major_locator(FixedLocator([zero, *decades]))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: "0" if y < zero * 1.01 else tick(y)))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.axhline(zero * math.sqrt(10), color="#bbbbbb", linewidth=0.8, linestyle=(0, (4, 4)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        ax.set_xlabel("kernel time (ms)")
    figure.supylabel(label, fontsize=11)
    for ax in axes[len(panels) :]:
        ax.axis("off")
    _legend(axes[len(panels)], {(name, variant) for name, variant, *_ in every})
    return figure


def _by_variant(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    out: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.variant in VARIANTS:
            out.setdefault((row.name, row.variant), []).append(row)
    return out


def _panel(ax: Axes, points: Sequence[tuple[str, str, float, float]], zero: float) -> None:
    ax.set_xscale("log")
    ax.set_yscale("log")
    front, best = [], math.inf
    for _, _, x, y in sorted(points, key=lambda p: (p[2], p[3])):
        if y < 0.99 * best:  # less is the luck of the draw
            best = y
            front.append((x, max(y, zero)))
    # The front goes down where a tracer is slower and better.
    along, up = [x for x, _ in front], [y for _, y in front]
    ax.step(along, up, where="post", color="#999999", linewidth=1.2, zorder=1)
    ax.scatter(along, up, s=190, facecolors="none", edgecolors="#999999", linewidths=1.2, zorder=1)
    for name, variant, x, y in points:
        color = COLORS.get(name, "#000000")
        shape = SHAPES.get(name, VARIANTS[variant])
        face = "none" if variant else color
        ax.scatter(x, max(y, zero), s=48, marker=shape, facecolors=face, edgecolors=color, linewidths=1.4, zorder=2)


def _legend(ax: Axes, shown: set[tuple[str, str]]) -> None:
    """In the panel that is left over."""

    def mark(color: str, shape: str, face: str, size: float = 7) -> Line2D:
        return Line2D([], [], linestyle="", marker=shape, color=color, markerfacecolor=face, markersize=size,
                      markeredgewidth=1.4)  # fmt: skip

    texts = {
        "accurate": "cltrace, accurate",
        "double": "cltrace, double",
        "single": "cltrace, single",
        "textbook": "textbook, float32 with epsilon",
    }
    names = [name for name in COLORS if any(name == n for n, _ in shown)]
    handles = [mark(COLORS[n], SHAPES.get(n, "o"), COLORS[n]) for n in names]
    labels = [texts.get(n, n) for n in names]
    kept = {"no lists": "without lists", "no skipping": "without skipping", "neither": "without either"}
    for variant, text in kept.items():
        if any(variant == v for _, v in shown):
            handles.append(mark("#333333", VARIANTS[variant], "none"))
            labels.append(f"cltrace {text}")
    handles.append(mark("#999999", "o", "none", 13))
    labels.append("Pareto front: nothing else is\nboth faster and more accurate")
    ax.legend(handles, labels, loc="upper left", frameon=False, fontsize=10.5, labelspacing=0.6)


def saved(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """For each piece of work that is skipped, and each class: how many times longer a frame takes with it.

    Of the scenes where there is such work; of all, if it is nothing that is prepared on the host.
    """
    plain = {(row.name, row.case.name, row.case.group): row for row in rows if not row.keep}
    pairs = [
        (row, plain.get((row.name, row.case.name, row.case.group))) for some in by_group(rows).values() for row in some
    ]
    single = [(row, base) for row, base in pairs if base and len(row.keep) == 1 and row.name == _first(rows)]
    seen = {row.keep[0] for row, base in single if row.work != base.work}
    ratios: dict[str, dict[str, list[float]]] = {}
    for row, base in single:
        if row.work != base.work or row.keep[0] not in seen:
            ratios.setdefault(row.keep[0], {}).setdefault(row.case.group, []).append(row.best / base.best)
    return {
        name: {group: math.exp(sum(map(math.log, some)) / len(some)) for group, some in groups.items()}
        for name, groups in ratios.items()
    }


def _first(rows: Sequence[Row]) -> str:
    """The precision of which each skipped piece was measured."""
    return next((row.name for row in rows if row.keep), "")


def bars(rows: Sequence[Row], about: str) -> Figure:
    """What each skipped piece of work saved, by class of scenes."""
    ratios = saved(rows)
    groups = [g for g in by_group(rows) if any(g in some for some in ratios.values())]
    # From the top: a block of bars for each name, and half a bar between two blocks.
    count = sum(map(len, ratios.values())) + 0.5 * len(ratios)
    figure = _figure(10, 1.6 + 0.3 * count, "What each piece of work that is skipped would cost", about)
    ax = figure.subplots()
    place, ticks, labelled = 0.0, [], set()
    for some in ratios.values():
        ticks.append(place + (len(some) - 1) / 2)
        for group in (g for g in groups if g in some):
            v = some[group]
            color = GROUP_COLORS[groups.index(group) % len(GROUP_COLORS)]
            ax.barh(place, v - 1, 0.9, left=1, color=color, label="" if group in labelled else group)
            labelled.add(group)
            text = f"{number(v, 3 if v >= 1 else 2)}x"
            ax.annotate(text, (max(v, 1), place), (4, 0), textcoords="offset points", va="center", fontsize=9)
            place += 1
        place += 0.5
    ax.set_xscale("log")
    most = max(v for some in ratios.values() for v in some.values())
    least = min(v for some in ratios.values() for v in some.values())
    ax.set_xlim(min(0.9, least / 1.1), most * 1.6)
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}x"))
    ax.xaxis.set_minor_formatter(FuncFormatter(lambda x, _: f"{x:g}x" if most < 10 else ""))
    ax.axvline(1, color="#555555", linewidth=1)
    ax.set_yticks(ticks, [f"--keep {name}" for name in ratios])
    ax.set_ylim(-0.7, place - 0.3)
    ax.invert_yaxis()
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(
        f"kernel time with this work, in multiples of that without it ({_first(rows)}; mean of scenes that have any)"
    )
    ax.legend(frameon=False, loc="lower right", fontsize=10)
    return figure


def growth(rows: Sequence[Row], about: str) -> Figure:
    """Kernel time and, dotted, whole time by the number of spheres and of pixels."""
    kinds = [(GROWTH_SPHERES, "spheres (640x360 pixels)"), (GROWTH_PIXELS, "pixels (300 spheres)")]
    shown = [(group, text) for group, text in kinds if any(row.case.group == group for row in rows)]
    figure = _figure(5.2 * len(shown) + 3, 5, "Kernel time by spheres and by pixels", about)
    axes = figure.subplots(1, len(shown) + 1, width_ratios=[1.0] * len(shown) + [0.5])
    for ax, (group, text) in zip(axes, shown, strict=False):
        for (label, _), mine in tracers_of(row for row in rows if row.case.group == group).items():
            name, variant = mine[0].name, mine[0].variant
            x = [_extent(row, group) for row in mine]
            style = {
                "color": COLORS.get(name, "#000000"),
                "marker": SHAPES.get(name, VARIANTS.get(variant, "o")),
                "markersize": 6,
            }
            if variant:
                style["markerfacecolor"] = "none"
            ax.plot(x, [1e3 * row.best for row in mine], label=label, linewidth=1.6, **style)
            if name in WHOLE and not variant:
                whole = [1e3 * min(row.whole) for row in mine]
                ax.plot(x, whole, linestyle=":", label=f"{label}, {WHOLE[name]}", linewidth=1.4, **style)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel(text)
        ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    axes[0].set_ylabel("time (ms)")
    axes[-1].axis("off")
    axes[-1].legend(*axes[0].get_legend_handles_labels(), loc="center left", frameon=False, fontsize=10.5)
    return figure


def _extent(row: Row, group: str) -> int:
    return len(row.case.scene.spheres) if group == GROWTH_SPHERES else math.prod(row.case.scene.camera.resolution)
