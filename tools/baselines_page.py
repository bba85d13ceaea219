"""The tables and plots of docs/baselines.md, from the ledger."""

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import product
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scengen import list_tasks, load_task
from scengen.evaluate.statistics import paired
from scengen.evidence import ledger
from scengen.evidence.ledger import Evidence
from scengen.learn.models import BC
from scengen.learn.train import TrainSettings
from scengen.measures import figures
from scengen.measures.figures import SHOWN, table, trainings_of
from scengen.measures.policies import (
    ALL,
    BLIND,
    CURATED,
    DEMONSTRATIONS,
    FELT,
    MIXED,
    NOMINAL,
    POLICIES,
    RANDOM,
    SCENARIOS,
    VARIED,
)
from scengen.pictures.plots import svg_bytes
from scengen.samplers.split import ID

Rates = Mapping[str, Mapping[str, Sequence[float]]]
"""Solved scenarios [%] of each training, by policy and split."""
Point = tuple[int, float, float]
"""Point of a learning curve: a number of demonstrations, and the solved scenarios in training and on axes [%]."""
PLOTS = 3
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


def fills() -> dict[str, str]:
    """The tables and plots of docs/baselines.md."""
    return {
        "summary": _summary(),
        "rates": "![Rates of each policy on each axis of each task](baselines_axes.svg)",
        "plot": "![Learning curves of each task](baselines_curves.svg)",
        "curves": _learning_curves(),
        "styles": _worth(NOMINAL, VARIED),
        "curation": _worth(ALL, RANDOM, CURATED),
        "wrench": _worth(BLIND, FELT),
        "splits": _all_splits(),
    }


def plots() -> dict[str, bytes]:
    """The plots of the page: names of files, and SVG."""
    return {
        "baselines_axes.svg": axes_plot(_rates()),
        "baselines_curves.svg": curves_plot(_curves()),
    }


def means(task: str) -> dict[str, tuple[float, float]]:
    """Mean percentages that each policy solves in training and on the axes; nothing if one has not played the task."""
    rates, axes = _rates().get(task, {}), load_task(task).axes
    return {
        name: (float(np.mean(own[ID])), float(np.mean([np.mean(own[axis]) for axis in axes])))
        for name, own in rates.items()
    }


@cache
def _rates() -> dict[str, Rates]:
    """Solved scenarios [%] of each training of each policy in training and on all axes, by task.

    Tasks that not all of these policies have played are left out.
    """
    found = dict[str, Rates]()
    for task, rows in _measured().items():
        splits = (ID, *load_task(task).axes)
        rates = {
            policy: {split: [_percent(one) for one in trainings_of(rows, policy, split)] for split in splits}
            for policy in SHOWN
        }
        if all(solved for known in rates.values() for solved in known.values()):
            found[task] = rates
    return found


@cache
def _measured() -> dict[str, list[Evidence]]:
    """The rows of each task that has some."""
    every = {task: ledger.newest("baseline", task) for task in list_tasks()}
    return {task: rows for task, rows in every.items() if rows}


def _percent(row: Evidence) -> float:
    return 100.0 * row.value["solved"] / row.n


def _summary() -> str:
    """The table with a line for each task, and one for their mean."""
    lines, every, count = [], [], 0
    for task in _rates():
        own, axes = [*means(task).values()], len(load_task(task).axes)
        lines.append([f"[{task}](tasks/{task}.md){ledger.mark(_measured()[task][0])}", str(axes), *map(_arrow, own)])
        every.append(own)
        count += axes
    lines.append(["**mean**", str(count), *map(_arrow, np.mean(every, axis=0))])
    return table(("task", "axes", *SHOWN), lines)


def _arrow(rates: Sequence[Any]) -> str:
    return " → ".join(f"{rate:.0f}" for rate in rates)


def _all_splits() -> str:
    """The table with a line for each split and policy."""
    rows = [[f"[{task}](tasks/{task}.md)", *line] for task in _measured() for line in figures.policies(load_task(task))]
    before = [task for task in list_tasks() if task not in _measured() and ledger.read("baseline", task)]
    rows += [[f"[{task}](tasks/{task}.md)", *[ledger.not_measured(task)] * 5] for task in before]
    return table(("task", *figures.POLICY), rows)


@cache
def _trainings(*sets: str) -> dict[str, list[Evidence]]:
    """Rows of trainings on some sets of demonstrations, as they are made today, by task."""
    today = {"epochs": TrainSettings().epochs}
    known = {task: ledger.newest("training", task) for task in list_tasks()}
    chosen = {
        task: [row for row in own if row.made_with["data"] in sets and row.has(**today)] for task, own in known.items()
    }
    return {task: own for task, own in chosen.items() if own}


def _learning_curves() -> str:
    """The table of the learning curves."""
    lines = []
    for task, known in _trainings(MIXED).items():
        for split, policy in product(_splits(task, known), POLICIES):
            cells = (_spread(_learned(task, split, policy, size)) for size in _sizes())
            lines.append([f"[{task}](tasks/{task}.md){ledger.mark(known[0])}", split, policy, *cells])
    columns = ("task", "split", "policy", *(f"{size} demonstrations" for size in _sizes()))
    return table(columns, lines)


def _curves() -> dict[str, dict[str, list[Point]]]:
    """The points of the learning curves of each policy, by task."""
    found = dict[str, dict[str, list[Point]]]()
    for task, known in _trainings(MIXED).items():
        found[task] = {policy: [] for policy in POLICIES}
        for policy, size in product(POLICIES, _sizes()):
            solved = [_learned(task, split, policy, size) for split in _splits(task, known)]
            if all(solved):
                here, *axes = (100.0 * np.mean(own) / SCENARIOS for own in solved)
                found[task][policy].append((size, float(here), float(np.mean(axes))))
    return found


def _sizes() -> list[int]:
    """Numbers of demonstrations of the learning curves."""
    return [*sorted({row.made_with["size"] for known in _trainings(MIXED).values() for row in known}), DEMONSTRATIONS]


def _learned(task: str, split: str, policy: str, size: int) -> list[int]:
    """Solved scenarios of each training on so many demonstrations."""
    if size == DEMONSTRATIONS:
        return [one.value["solved"] for one in trainings_of(_measured().get(task, []), policy, split)]
    rows = trainings_of(_trainings(MIXED)[task], policy, split)
    return [row.value["solved"] for row in rows if row.has(size=size)]


def _splits(task: str, rows: Iterable[Evidence]) -> list[str]:
    """The splits on which all trainings were evaluated, training first, in the order of the task's file."""
    tried = dict[str, set[str]]()
    for row in rows:
        tried.setdefault(json.dumps(row.made_with, sort_keys=True), set()).add(row.split)
    return [split for split in (ID, *load_task(task).axes) if all(split in known for known in tried.values())]


def _worth(*sets: str) -> str:
    """A table that compares the last of some sets with the others."""
    *others, last = sets
    lines = []
    for task, known in _trainings(*sets).items():
        own = {name: [row for row in known if row.has(data=name)] for name in sets}
        if not all(own.values()):
            continue
        for split in _splits(task, known):
            here = {name: trainings_of(own[name], BC, split) for name in sets}
            cells = [_spread([row.value["solved"] for row in here[name]]) for name in sets]
            outcomes = {name: [*zip(*(row.value["outcomes"] for row in here[name]), strict=True)] for name in sets}
            for name in others:
                gain = paired(outcomes[last], outcomes[name])
                cells.append(f"{100 * gain.value:+.1f} [{100 * gain.low:.1f}, {100 * gain.high:.1f}]")
            lines.append([f"[{task}](tasks/{task}.md)", split, *cells])
    columns = ("task", "split", *sets, *(f"{last} - {name}" for name in others))
    return table(columns, lines)


def _spread(solved: list[int]) -> str:
    """The mean of some counts, and the lowest and the highest of them; nothing if there is none."""
    if len(solved) < 2:
        return "".join(map(str, solved))
    return f"{sum(solved) / len(solved):.3g} [{min(solved)}, {max(solved)}]"


# --- plots ------------------------------------------------------------------------------------


def axes_plot(tasks: Mapping[str, Rates]) -> bytes:
    """The rates on each split, a line of each task's plot for a split, as SVG."""
    lines = [len(next(iter(rates.values()))) for rates in tasks.values()]
    rows = [max(lines[first : first + PLOTS]) for first in range(0, len(lines), PLOTS)]
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
        plot.set(title=task, ylim=(rows[place // PLOTS] - 0.5, -0.5), xlim=(-4, 104), xlabel="solved [%]")
        plot.axhline(0.5, color="black", linewidth=0.6)
    return _drawn(figure, plots)


def curves_plot(tasks: Mapping[str, Mapping[str, Sequence[Point]]]) -> bytes:
    """The rates over the number of demonstrations, as SVG."""
    figure, plots = _plots(len(tasks), [CURVES] * -(-len(tasks) // PLOTS))
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
    size = (WIDTH * PLOTS, sum(heights) + AROUND * len(heights))
    figure = Figure(figsize=size, layout="constrained")
    made = figure.subplots(len(heights), PLOTS, squeeze=False, height_ratios=heights)
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
