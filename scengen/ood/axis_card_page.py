"""The page of an axis card: tables, plots of supports and boundaries, pictures of twins."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ..certificate import STAGES
from ..pictures import film, render
from ..pictures.page import template
from ..pictures.plots import svg
from ..pictures.twins import DIRECTIONS, pair
from ..pool import Pool, PoolRow
from ..samplers.axis import spell
from ..samplers.split import ID
from ..samplers.support import Support
from ..samplers.task import Task
from ..validate.rebuilt import rebuild
from ..work.targets import write
from .axis_card import AxisCard
from .boundary import HOLDS, OPEN

SHOWN_TWINS = 4
"""Number of twins whose pictures are shown side by side."""
TRAINING_COLOUR = "#4a7fb5"
"""Colour of training in plots."""
AXIS_COLOUR = "#b5524a"
"""Colour of the axis in plots."""


def write_page(task: Task, card: AxisCard, pool: Pool | None, seed: int, path: Path) -> str:
    """Write the card as an HTML page.

    Args:
        pool: pool whose scenarios are shown; None for no pictures.
        seed: seed of the pool.

    Returns:
        The reason why pictures are missing; empty if none is missing.
    """
    remark, pairs, strips = "", [], []
    try:
        rows = [row for row, _ in zip(pool.rows(), range(SHOWN_TWINS), strict=False)] if pool else []
        pairs = [*_pairs(task, seed, rows)]
        strips = [*_strips(task, rows[0])] if rows else []
    except render.NoPictures as error:
        remark = str(error)
    page = template("axis_card.html").render(
        card=card,
        task=task,
        axis=task.axes[card.axis],
        spell=spell,
        steps=("proposed", *STAGES),
        supports=svg(_supports_figure(task, card)),
        path=svg(_path_figure(card)) if card.boundaries else "",
        pairs=pairs,
        strips=strips,
        remark=remark,
    )
    write(path, page)
    return remark


def _pairs(task: Task, seed: int, rows: Sequence[PoolRow]) -> Iterator[tuple[int, str, str]]:
    """Indices of scenarios, and pictures of their training twins and of them from one direction, as data URLs."""
    directions = DIRECTIONS
    for row in rows:
        twin = rebuild(task.draw(ID, seed, row.index).scenario)
        training, here, directions = pair(row, twin, directions)
        yield row.index, training, here


def _strips(task: Task, row: PoolRow) -> list[tuple[str, str]]:
    """Titles and film strips of the witness and of the shortcut that lasts longest."""
    scenario = task.scenario(row.params)
    tried = {name: film.shortcut(row, scenario, name) for name in scenario.shortcuts()}
    takes = [("the witness", film.Take.witness(row, scenario))]
    if tried:
        name, (take, rollout) = max(tried.items(), key=lambda item: item[1][1].seconds)
        takes.append((f"the shortcut {name}: {rollout.reason}", take))
    return [(title, render.address(render.encode(film.strip(take)), "webp")) for title, take in takes]


def _supports_figure(task: Task, card: AxisCard) -> Figure:
    """The supports of every moved parameter in training and on the axis, each in a separate plot."""
    shifts = task.axes[card.axis].replace
    figure = Figure(figsize=(7.5, 0.5 + 0.55 * len(shifts)))
    axes = figure.subplots(len(shifts), 1, squeeze=False)[:, 0]
    for plot, (name, dist) in zip(axes, shifts.items(), strict=True):
        _draw_support(plot, task.training[name].support, 0.62, TRAINING_COLOUR)
        _draw_support(plot, dist.support, 0.38, AXIS_COLOUR)
        plot.set(yticks=[], ylim=(0.1, 0.9))
        unit = f" [{task.known[name].unit}]" if task.known[name].unit else ""
        plot.set_ylabel(name + unit, rotation=0, ha="right", va="center")
        plot.spines[["left", "right", "top"]].set_visible(False)
    figure.subplots_adjust(hspace=0.9)
    return figure


def _draw_support(plot: Any, support: Support, y: float, colour: str) -> None:
    for part in support:
        if part.low == part.high:
            plot.plot(part.low, y, "o", color=colour, markersize=7)
        else:
            plot.plot([part.low, part.high], [y, y], color=colour, linewidth=7, solid_capstyle="butt")


def _path_figure(card: AxisCard) -> Figure:
    """The boundaries of replay and oracle on the path: interval and guess. Lines show where they succeed."""
    figure = Figure(figsize=(7.5, 1.5))
    plot = figure.subplots()
    end = max(b.end for b in card.boundaries.values())
    plot.axvspan(0, 1, color=AXIS_COLOUR, alpha=0.12, lw=0)
    for y, found in enumerate(card.boundaries.values()):
        high = end if found.high is None else found.high
        for part in ((0.0, found.middle), found.again or ()):
            plot.plot(part, [y] * len(part), color="#555", linewidth=2)
        plot.plot([found.low, high], [y, y], color="#555", linewidth=7, alpha=0.35, solid_capstyle="butt")
        marker = {HOLDS: ">", OPEN: ""}.get(found.verdict, "x")
        plot.plot(found.middle, y, marker, color="#222", markersize=8, clip_on=False)
    plot.set(yticks=range(len(card.boundaries)), yticklabels=list(card.boundaries), ylim=(-0.6, 1.6), xlim=(0, end))
    plot.set_xlabel("path: 0 the edge of training, 1 the far end of the axis, on to the bounds of the parameters")
    plot.spines[["right", "top"]].set_visible(False)
    if not math.isclose(end, 1.0):
        plot.axvline(1.0, color=AXIS_COLOUR, lw=1)
    return figure
