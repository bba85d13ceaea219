"""The report of whole pools: what was lost, how far out they are, selection bias of certification, what leaks."""

import itertools
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..certificate import STAGES
from ..errors import Infeasible
from ..pictures import render
from ..pictures.plots import svg
from ..pictures.report import LARGEST_PAGE, template, thumbnail
from ..pool.library import names
from ..pool.pool import Pool
from ..samplers.split import ID
from ..samplers.task import Task
from ..work.targets import write
from .bias import Bias, bias
from .coverage import Evenness, evenness
from .distance import CLOSE, ENERGY_OF, MOST_PAIRS, Energy, NearDuplicate, energy, near_duplicates, per_parameter
from .histogram import Histogram, figure, histogram, label
from .redraw import batch_of, first_scenarios, redrawn, task_of, told
from .space import Batch, measured, of_features

SHOWN = 4
"""Marginals that are drawn of each pool, the most telling ones, and scenes that are shown."""
PAIRS = 5
"""Near duplicates of two pools that are named."""
TRAINED = 500
"""Training scenarios at most with which the draws of a pool are compared."""


@dataclass(frozen=True)
class Overview:
    """What is known of one pool."""

    folder: str
    task: str
    split: str
    scenarios: int
    sample: str
    """Of which indices coverage, bias and histograms tell; empty for all."""
    funnel: Mapping[str, int]
    reasons: Mapping[str, int]
    outside: Mapping[str, tuple[float, float]]
    """Least and mean distance from training by parameter that leaves it [training ranges]."""
    evenness: Evenness | None
    """None for a chosen subset, which was not drawn."""
    bias: Bias | None
    """Certified against feasible draws; None as above."""
    histograms: tuple[Histogram, ...]
    """Of what the axes move, then of the parameters and features that selection changed most; none as above."""


@dataclass(frozen=True)
class Contrast:
    """What is known of two pools of one task."""

    one: str
    other: str
    energy: Energy
    shared: list[NearDuplicate]
    """Near duplicates: leakage, if one is for training and the other for evaluation."""


def gather(pools: Sequence[Pool], search: Sequence[str] = ()) -> tuple[list[Overview], list[Contrast]]:
    """Look at every pool, and at every two of one task.

    Args:
        search: folders of other packages with tasks, see `task_files.search_path`.
    """
    known = [(pool, task_of(pool, search)) for pool in pools]
    held = [(pool, task, batch_of(task, pool)) for pool, task in known]
    contrasts = [
        _contrast(task, (a, one), (b, other))
        for (a, task, one), (b, beside, other) in itertools.combinations(held, 2)
        if task.name == beside.name and len(one) and len(other)
    ]
    return [_overview(*each, search) for each in held], contrasts


def page(pools: Sequence[Pool], overviews: Sequence[Overview], contrasts: Sequence[Contrast], path: Path) -> str:
    """Write the report as one HTML file. Returns why it has no pictures, or nothing."""
    remark, pictures, plots, size = "", {}, {}, 0
    for pool, overview in zip(pools, overviews, strict=True):
        shown: list[str] = []
        try:
            scenes = itertools.islice(pool.columns("scene_xml", "embodiment"), 0 if remark else SHOWN)
            shown = [thumbnail(*scene)[0] for scene in scenes]
        except render.NoPictures as error:
            remark = str(error)
        plot = svg(figure(overview.histograms)) if overview.histograms else ""
        size += len(plot) + sum(map(len, shown))
        if size > LARGEST_PAGE:
            remark = remark or f"those of the first {len(pictures)} of {len(pools)} pools fill the page"
            break
        pictures[overview.folder] = shown
        plots |= {overview.folder: plot} if plot else {}
    told = [(contrast, contrast.shared[:PAIRS]) for contrast in contrasts]
    text = template("report.html").render(
        overviews=overviews,
        contrasts=contrasts,
        pictures=pictures,
        plots=plots,
        steps=("proposed", *STAGES),
        names=names(pools, [id_ for _, pairs in told for pair in pairs for id_ in (pair.one, pair.other)]),
        pairs=PAIRS,
        most=MOST_PAIRS,
        energy_of=ENERGY_OF,
        remark=remark,
        close=CLOSE,
    )
    write(path, text)
    return remark


def plain(overviews: Sequence[Overview], contrasts: Sequence[Contrast]) -> dict[str, Any]:
    """The report as plain data."""
    return {"pools": [asdict(o) for o in overviews], "contrasts": [asdict(c) for c in contrasts]}


def _overview(pool: Pool, task: Task, batch: Batch, search: Sequence[str]) -> Overview:
    even, biased, histograms = None, None, ()
    if len(batch) and not pool.chosen:
        drawn = [p for p in redrawn(pool, search=search) if p.feasible]
        numbers = np.array([list(p.quantiles.values()) for p in drawn if p.certified])
        even = evenness(numbers) if numbers.size else None
        rows = [measured(p.scenario) for p in drawn]
        table = {name: np.array([row[name] for row in rows], float) for name in rows[0]}
        certified = np.array([p.certified for p in drawn])
        biased = bias(table, certified)
        training = _training(pool, task)
        names = list(dict.fromkeys([*task.shifts(pool.split), *(m.name for m in biased.marginals)]))[:SHOWN]
        histograms = tuple(
            histogram(label(task, n), table[n], certified, np.array([row[n] for row in training])) for n in names
        )
    return Overview(
        str(pool.folder),
        task.name,
        pool.split,
        len(batch),
        told(pool) if histograms else "",
        pool.funnel,
        pool.reasons,
        per_parameter(task, batch),
        even,
        biased,
        histograms,
    )


def _training(pool: Pool, task: Task) -> list[dict[str, float]]:
    """The training scenarios of the first indices of a pool: the twins, where it is out of distribution."""
    found = []
    for index in range(min(pool.indices, TRAINED)):
        with suppress(Infeasible):
            found.append(measured(task.draw(ID, pool.seed, index, task.design(pool.sampler)).scenario))
    return found


Side = tuple[Pool, Batch]


def _contrast(task: Task, one: Side, other: Side) -> Contrast:
    (a, here), (b, there) = one, other
    ones, others = (first_scenarios(task, pool, ENERGY_OF) for pool in (a, b))
    space = of_features(task, ones, others)
    apart = energy(space.points(ones), space.points(others))
    return Contrast(str(a.folder), str(b.folder), apart, near_duplicates(task, here, there))
