"""Plots of docs/baselines.md, for `baselines_page`."""

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scengen.pictures.plots import svg_bytes
from scengen.samplers.split import ID

Rates = Mapping[str, Mapping[str, Sequence[float]]]
"""Solved scenarios [%] of each training, by policy and split."""
Point = tuple[int, float, float]
"""Point of a learning curve: a number of demonstrations, and the solved scenarios in training and on axes [%]."""
COLUMNS = 3
"""Number of tasks in a row."""
WIDTH = 4.0
"""Width of the plot of a task [in]."""
LINE = 0.24
"""Height of the line of an axis [in]."""
APART = 0.2
"""Distance of the marks of different policies on a line [lines]."""
AROUND = 0.7
"""Height of the title and the labels of a plot [in]."""
CURVES = 1.8
"""Height of the learning curves of a task [in]."""
COLORS = ("#0b6e99", "#c4500c", "#6f6f6f", "#a9a9a9")
"""Colors of the policies."""
MARKERS = "os^x"
"""Markers of the policies."""


def axes(tasks: Mapping[str, Rates]) -> bytes:
    """The rates on each split, a line of each task's plot for a split, as SVG."""
    lines = [len(next(iter(rates.values()))) for rates in tasks.values()]
    rows = [max(lines[first : first + COLUMNS]) for first in range(0, len(lines), COLUMNS)]
    figure, plots = _plots(len(tasks), [LINE * row for row in rows])
    for place, (plot, (task, rates)) in enumerate(zip(plots, tasks.items(), strict=True)):
        splits = [*next(iter(rates.values()))]
        for number, (policy, solved) in enumerate(rates.items()):
            style = {"color": COLORS[number], "zorder": 5 - number}
            heights = np.arange(len(splits)) + APART * (number - (len(rates) - 1) / 2)
            means = [np.mean(solved[split]) for split in splits]
            plot.plot(means, heights, MARKERS[number], markersize=4, label=policy, **style)
            lowest, highest = ([of(solved[split]) for split in splits] for of in (min, max))
            plot.hlines(heights, lowest, highest, linewidth=1.2, **style)
        plot.set_yticks(range(len(splits)), ["in training" if split == ID else split for split in splits])
        plot.set(title=task, ylim=(rows[place // COLUMNS] - 0.5, -0.5), xlim=(-4, 104), xlabel="solved [%]")
        plot.axhline(0.5, color="black", linewidth=0.6)
    return _drawn(figure, plots)


def curves(tasks: Mapping[str, Mapping[str, Sequence[Point]]]) -> bytes:
    """The rates over the number of demonstrations, as SVG."""
    figure, plots = _plots(len(tasks), [CURVES] * -(-len(tasks) // COLUMNS))
    for plot, (task, known) in zip(plots, tasks.items(), strict=True):
        for number, (policy, curve) in enumerate(known.items()):
            sizes = [size for size, _, _ in curve]
            style = {"color": COLORS[number], "marker": MARKERS[number], "markersize": 4}
            plot.plot(sizes, [here for _, here, _ in curve], "-", label=policy, **style)
            plot.plot(sizes, [there for _, _, there in curve], "--", **style)
        plot.set_xscale("log", base=2)
        ticks = sorted({size for curve in known.values() for size, _, _ in curve})
        plot.set_xticks(ticks, map(str, ticks))
        plot.minorticks_off()
        plot.set(title=task, ylim=(-4, 104), xlabel="demonstrations", ylabel="solved [%]")
    return _drawn(figure, plots)


def _plots(count: int, heights: Sequence[float]) -> tuple[Figure, list[Axes]]:
    """A figure with a plot for each task.

    Args:
        heights: height of each row [in].
    """
    size = (WIDTH * COLUMNS, sum(heights) + AROUND * len(heights))
    figure = Figure(figsize=size, layout="constrained")
    made = figure.subplots(len(heights), COLUMNS, squeeze=False, height_ratios=heights)
    plots: list[Axes] = [*made.flat]
    for plot in plots[count:]:
        plot.remove()
    return figure, plots[:count]


def _drawn(figure: Figure, plots: Sequence[Axes]) -> bytes:
    """The finished figure as SVG, with its text as text."""
    for plot in plots:
        plot.grid(color="#e5e5e5", linewidth=0.6)
        plot.set_axisbelow(True)
        plot.tick_params(length=0, labelsize=8)
        plot.xaxis.label.set_fontsize(8)
        plot.yaxis.label.set_fontsize(8)
        plot.title.set_fontsize(10)
        plot.spines[["top", "right", "left"]].set_visible(False)
    handles, labels = plots[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    with matplotlib.rc_context({"svg.fonttype": "none", "font.family": "sans-serif"}):
        return svg_bytes(figure)
