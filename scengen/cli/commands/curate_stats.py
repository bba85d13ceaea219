"""measure the episodes of recordings: lengths, actions, smoothness, spread of the paths"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.table import Table

from ...demos.curate.stats import TaskStats, paths_of, statistics_of
from ...errors import BadConfig
from ...export.dataset import Recording
from ...pictures.page import template
from ...pictures.plots import svg
from ...work.targets import try_file
from . import OK, Arguments, out, say, write, write_json
from .settings import read

MAX_WAYS = 5
"""Largest number of ways that are printed."""


@dataclass(frozen=True)
class StatsSettings:
    """Settings of `scengen curate stats`; conf/command/curate_stats.yaml explains them."""

    data: str | list[str]
    to: str | None
    json: str | None


def command(arguments: Arguments) -> int:
    settings = read("curate stats", arguments, StatsSettings)
    if settings.to is not None and Path(settings.to).suffix != ".html":
        raise BadConfig(f"to = {settings.to}; give an .html file")
    try_file(settings.to)
    try_file(settings.json)
    recordings = [
        Recording.open(folder) for folder in ([settings.data] if isinstance(settings.data, str) else settings.data)
    ]
    tasks = statistics_of(recordings)
    out.print(_table(tasks))
    for own in tasks:
        if own.ways:
            text = ", ".join(f"{way} ({count})" for way, count in [*own.ways.items()][:MAX_WAYS])
            say(f"{own.task}: {len(own.ways)} ways, by the bodies moved first: {text}")
    if settings.to is not None:
        paths = paths_of(recordings)
        plots = {own.task: _plot(own, paths[own.task]) for own in tasks}
        write(Path(settings.to), template("stats.html").render(tasks=tasks, plots=plots))
        say(f"wrote {settings.to}")
    if settings.json:
        write_json(settings.json, [asdict(own) for own in tasks])
    return OK


def _table(tasks: list[TaskStats]) -> Table:
    """One line for each task."""
    table = Table("task", title="demonstrations", title_justify="left")
    for column in (
        "episodes",
        "solved",
        "length [s]",
        "paper [s]",
        "idle",
        "jerk [m/s3]",
        "path / extent",
        "nearest [mm]",
    ):
        table.add_column(column, justify="right")
    for own in tasks:
        paper = "-" if own.paper_seconds is None else f"{own.paper_seconds:.1f}"
        shape = (f"{own.idle:.0%}", f"{own.jerk:.1f}", f"{own.path_ratio:.2f}", f"{1000 * own.nearest:.1f}")
        table.add_row(own.task, str(own.episodes), str(own.solved), f"{own.seconds:.1f}", paper, *shape)
    return table


def _plot(own: TaskStats, paths: Sequence[NDArray[np.float64]]) -> str:
    """Paths of the hands from above and from the side, and their spread in each phase."""
    figure = Figure(figsize=(11, 3.4))
    above, side, spread = figure.subplots(1, 3)
    for path in paths:
        for arm in range(path.shape[1] // 3):
            x, y, z = path[:, 3 * arm : 3 * arm + 3].T
            above.plot(x, y, color=f"C{arm}", alpha=0.3, linewidth=0.8)
            side.plot(x, z, color=f"C{arm}", alpha=0.3, linewidth=0.8)
    above.set(xlabel="x [m]", ylabel="y [m]", title="from above")
    side.set(xlabel="x [m]", ylabel="z [m]", title="from the side")
    spread.bar(range(1, len(own.spread) + 1), [1000 * value for value in own.spread])
    spread.set(xlabel="tenth of the time", ylabel="spread [mm]", title="distance from the mean path")
    figure.tight_layout()
    return svg(figure)
