"""The profile of a policy: success in training, by category of physics, under perturbations, and without inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from matplotlib.figure import Figure

from ..pictures.plots import svg_bytes
from ..samplers.split import ID
from .arms import ARMS
from .comparison import Comparison
from .rows import ALL_AXES, Row
from .statistics import Rate

PROFILES = {"profile.svg": False, "profile_dark.svg": True}
"""Files of a profile, and whether each is for a dark page."""
PLOT_WIDTH = 5.5
"""Width of the plot without its labels [inches]."""
LINE_HEIGHT = 0.24
"""Height of a line [inches]."""
FRAME_HEIGHT = 0.9
"""Height of title and axis together [inches]."""
COLOURS = {False: ("#1f2328", "#0969da", "#d0d7de"), True: ("#e6edf3", "#58a6ff", "#30363d")}
"""Colours of text, rates and guides, for light and dark pages."""


@dataclass(frozen=True)
class Line:
    """A line of the plot."""

    group: str
    """Kind of shift: physics, perception, or inputs."""
    name: str
    """Name of the line."""
    rate: Rate
    """Success rate."""


def plots(compared: Comparison) -> dict[Path, bytes]:
    """Content of the plots of each policy."""
    found = {}
    for result in compared.results:
        lines = profile_lines(result.rows, compared.category)
        for name, dark in PROFILES.items():
            found[result.settings.folder / name] = profile(result.settings.name, lines, dark)
    return found


def profile_lines(rows: Sequence[Row], category: Mapping[str, str]) -> list[Line]:
    """Lines of the plot of one policy, from the rows of its table.

    Args:
        category: category of each task.
    """
    found = []
    for row in rows:
        name = f"{category[row.task]} {row.task}" if row.task in category else row.task
        if row.condition:
            group = "inputs" if row.condition in ARMS else "perception"
            found.append(Line(group, f"{row.task} {row.split}: {row.condition}", row.rate))
        elif row.split != ALL_AXES:
            found.append(Line("training" if row.split == ID else "physics", f"{name} {row.split}", row.rate))
    order = ("training", "physics", "perception", "inputs")
    return sorted(found, key=lambda line: order.index(line.group))


def profile(policy: str, lines: Sequence[Line], dark: bool = False) -> bytes:
    """The plot as SVG: a rate with its 95 % interval on each line, in groups."""
    text, accent, guide = COLOURS[dark]
    figure = Figure((PLOT_WIDTH, FRAME_HEIGHT + LINE_HEIGHT * len(lines)))
    axes = figure.add_subplot()
    for place, line in enumerate(lines):
        value, low, high = (100 * each for each in (line.rate.value, line.rate.low, line.rate.high))
        axes.plot([low, high], [place, place], color=accent, linewidth=1.5, solid_capstyle="butt")
        axes.plot([value], [place], "o", color=accent, markersize=5)
    for place, (one, other) in enumerate(pairwise(lines)):
        if one.group != other.group:
            axes.axhline(place + 0.5, color=guide, linewidth=0.8)
    axes.set_yticks(range(len(lines)), [f"{line.group}  {line.name}" for line in lines], fontsize=8)
    axes.set_xlim(-2, 102)
    axes.set_ylim(len(lines) - 0.5, -0.5)
    axes.set_xlabel("success [%], 95 % interval", fontsize=8, color=text)
    axes.set_title(policy, fontsize=9, color=text, loc="left")
    axes.tick_params(colors=text, labelsize=8, length=0)
    axes.grid(axis="x", color=guide, linewidth=0.5)
    axes.set_axisbelow(True)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.set_facecolor("none")
    figure.patch.set_alpha(0.0)
    return svg_bytes(figure)
