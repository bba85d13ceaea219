"""Histograms of what was drawn: accepted over proposed, beside training."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..samplers.task import Task

BARS = 12
"""Bars of a histogram, of equal width."""
FEW, OFTEN = 6, 3
"""At most so many different values have one bar each, if each of them was drawn so often on average."""
TRAINING, PROPOSED, ACCEPTED = "#8a8a8a", "#c9d3de", "#4a7fb5"


@dataclass(frozen=True)
class Histogram:
    """One parameter or feature: how many draws fall into each of some bars."""

    name: str
    edges: tuple[float, ...]
    """Ends of the bars, one more than there are bars; of choices, their values."""
    choices: bool
    proposed: tuple[int, ...]
    accepted: tuple[int, ...]
    training: tuple[int, ...]


def histogram(
    name: str, proposed: NDArray[np.float64], accepted: NDArray[np.bool_], training: NDArray[np.float64]
) -> Histogram:
    """Count draws and training scenarios in the same bars.

    Args:
        proposed: values, shape (n,).
        accepted: which of them were accepted, shape (n,).
        training: values in training, shape (m,).
    """
    every = np.concatenate([proposed, training])
    values = np.unique(every)
    choices = len(values) <= FEW and len(every) >= OFTEN * len(values)
    edges = values if choices else np.histogram_bin_edges(every, BARS)

    def counted(column: NDArray[np.float64]) -> tuple[int, ...]:
        counts = [(column == v).sum() for v in values] if choices else np.histogram(column, edges)[0]
        return tuple(int(count) for count in counts)

    return Histogram(
        name,
        tuple(float(edge) for edge in edges),
        choices,
        counted(proposed),
        counted(proposed[accepted]),
        counted(training),
    )


def label(task: Task, name: str) -> str:
    """A parameter's name with its unit; a feature has none that is declared."""
    unit = task.known[name].unit.removeprefix("1") if name in task.known else ""
    return f"{name} [{unit}]" if unit else name


def figure(histograms: tuple[Histogram, ...]) -> Figure:
    """Accepted (blue) over proposed (pale) draws; the grey outline is training, scaled to as many draws."""
    drawn = Figure(figsize=(2.6 * len(histograms), 1.9))
    for plot, shown in zip(drawn.subplots(1, len(histograms), squeeze=False)[0], histograms, strict=True):
        at = np.arange(len(shown.edges)) if shown.choices else np.array(shown.edges[:-1])
        width = np.full(len(at), 0.8) if shown.choices else np.diff(shown.edges)
        align = "center" if shown.choices else "edge"
        scale = sum(shown.proposed) / max(1, sum(shown.training))
        plot.bar(at, shown.proposed, width, align=align, color=PROPOSED, edgecolor="white")
        plot.bar(at, shown.accepted, width, align=align, color=ACCEPTED, edgecolor="white")
        trained = [scale * count for count in shown.training]
        plot.bar(at, trained, width, align=align, fill=False, edgecolor=TRAINING, linewidth=1)
        if shown.choices:
            plot.set_xticks(at, [f"{value:.4g}" for value in shown.edges])
        plot.set_title(shown.name, fontsize=8)
        plot.tick_params(labelsize=7)
        plot.spines[["right", "top"]].set_visible(False)
    drawn.tight_layout()
    return drawn
