"""Histograms of parameters and features: accepted and proposed draws, and training."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...samplers.task import Task

BARS = 12
"""Number of bars of a histogram, of equal width."""
MAX_CHOICES = 6
"""Maximum number of different values that get a bar each."""
MIN_DRAWS_PER_CHOICE = 3
"""Minimum mean number of draws per value, if each value is to get a bar."""
TRAINING_COLOUR = "#8a8a8a"
"""Colour of the outline of training."""
PROPOSED_COLOUR = "#c9d3de"
"""Colour of the bars of proposed draws."""
ACCEPTED_COLOUR = "#4a7fb5"
"""Colour of the bars of accepted draws."""


@dataclass(frozen=True)
class Histogram:
    """Numbers of draws by value of one parameter or feature."""

    name: str
    edges: tuple[float, ...]
    """Edges of the bars, one more than there are bars; for choices, their values."""
    choices: bool
    """Whether every value has a separate bar."""
    proposed: tuple[int, ...]
    """Number of proposed draws in each bar."""
    accepted: tuple[int, ...]
    """Number of accepted draws in each bar."""
    training: tuple[int, ...]
    """Number of training scenarios in each bar."""


def histogram(
    name: str, proposed: NDArray[np.float64], accepted: NDArray[np.bool_], training: NDArray[np.float64]
) -> Histogram:
    """Count draws and training scenarios in the same bars.

    Args:
        proposed: values, shape (n,).
        accepted: whether each of them was accepted, shape (n,).
        training: values in training, shape (m,).
    """
    every = np.concatenate([proposed, training])
    values = np.unique(every)
    choices = len(values) <= MAX_CHOICES and len(every) >= MIN_DRAWS_PER_CHOICE * len(values)
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
    """The name of a parameter with its unit, or the name of a feature, whose unit is not declared."""
    unit = task.known[name].unit.removeprefix("1") if name in task.known else ""
    return f"{name} [{unit}]" if unit else name


def figure(histograms: tuple[Histogram, ...]) -> Figure:
    """Accepted draws (blue) over proposed draws (pale). The grey outline is training, scaled to the same number."""
    drawn = Figure(figsize=(2.6 * len(histograms), 1.9))
    for plot, shown in zip(drawn.subplots(1, len(histograms), squeeze=False)[0], histograms, strict=True):
        at = np.arange(len(shown.edges)) if shown.choices else np.array(shown.edges[:-1])
        width = np.full(len(at), 0.8) if shown.choices else np.diff(shown.edges)
        align = "center" if shown.choices else "edge"
        scale = sum(shown.proposed) / max(1, sum(shown.training))
        plot.bar(at, shown.proposed, width, align=align, color=PROPOSED_COLOUR, edgecolor="white")
        plot.bar(at, shown.accepted, width, align=align, color=ACCEPTED_COLOUR, edgecolor="white")
        trained = [scale * count for count in shown.training]
        plot.bar(at, trained, width, align=align, fill=False, edgecolor=TRAINING_COLOUR, linewidth=1)
        if shown.choices:
            plot.set_xticks(at, [f"{value:.4g}" for value in shown.edges])
        plot.set_title(shown.name, fontsize=8)
        plot.tick_params(labelsize=7)
        plot.spines[["right", "top"]].set_visible(False)
    drawn.tight_layout()
    return drawn
