"""The report of whole pools: rejections, distance from training, selection bias of certification, leakage."""

import itertools
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...certificate import STAGES
from ...errors import Infeasible
from ...pictures import render
from ...pictures.page import LARGEST_PAGE, template, thumbnail
from ...pictures.plots import svg
from ...pictures.shared_view import directions_of
from ...pool import Pool
from ...pool.library import names
from ...samplers.split import ID
from ...samplers.task import Task
from ...work.targets import write
from .bias import Bias, bias
from .contrast import Apart, apart
from .coverage import Evenness, evenness
from .distance import (
    MAX_ENERGY_SCENARIOS,
    MAX_PAIRS,
    NEAR_DUPLICATE_DISTANCE,
    NearDuplicate,
    near_duplicates,
    per_parameter,
)
from .histogram import Histogram, figure, histogram, label
from .redraw import batch_of, redrawn, sampled_indices, task_of
from .space import Batch, measured

SHOWN_SCENES = 4
"""Number of scenes that are shown of each pool."""
SHOWN_MARGINALS = 4
"""Number of histograms of each pool, the parameters with the largest changes first."""
SHOWN_PAIRS = 5
"""Number of near duplicates that are named for two pools."""
MAX_TRAINING = 500
"""Maximum number of training scenarios with which the draws of a pool are compared."""


@dataclass(frozen=True)
class Overview:
    """The report of one pool."""

    folder: str
    task: str
    split: str
    scenarios: int
    """Number of scenarios in the pool."""
    sample: str
    """Indices to which coverage, bias and histograms refer, as text; empty for all."""
    funnel: Mapping[str, int]
    """Number of draws that passed each step of certification."""
    reasons: Mapping[str, int]
    """Number of rejected draws by reason."""
    outside: Mapping[str, tuple[float, float]]
    """Minimum and mean distance from training, by parameter that leaves training [training ranges]."""
    evenness: Evenness | None
    """Evenness of the certified draws; None for a chosen subset, which was not drawn."""
    bias: Bias | None
    """Selection bias of certified against feasible draws; None for a chosen subset."""
    histograms: tuple[Histogram, ...]
    """Histograms of the moved parameters, then of those that selection changed most; empty for a chosen subset."""


@dataclass(frozen=True)
class Contrast:
    """The comparison of two pools of one task."""

    one: str
    other: str
    apart: Apart
    """Distance between the two pools."""
    shared: list[NearDuplicate]
    """Near duplicates: leakage, if one pool is for training and the other for evaluation."""


def gather(pools: Sequence[Pool], search: Sequence[str] = ()) -> tuple[list[Overview], list[Contrast]]:
    """Report on every pool, and compare every two pools of one task.

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


def page(
    pools: Sequence[Pool],
    overviews: Sequence[Overview],
    contrasts: Sequence[Contrast],
    path: Path,
    search: Sequence[str] = (),
) -> str:
    """Write the report as one HTML file.

    Args:
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Returns:
        The reason why pictures are missing; empty if none is missing.
    """
    remark, pictures, plots, size = "", {}, {}, 0
    for pool, overview in zip(pools, overviews, strict=True):
        shown: list[str] = []
        try:
            if not remark and len(pool):
                scenes = itertools.islice(pool.columns("scene_xml", "embodiment"), SHOWN_SCENES)
                directions = directions_of(pool, task_of(pool, search))
                shown = [thumbnail(text, embodiment, directions) for text, embodiment in scenes]
        except render.NoPictures as error:
            remark = str(error)
        plot = svg(figure(overview.histograms)) if overview.histograms else ""
        size += len(plot) + sum(map(len, shown))
        if size > LARGEST_PAGE:
            remark = remark or f"those of the first {len(pictures)} of {len(pools)} pools fill the page"
            break
        pictures[overview.folder] = shown
        plots |= {overview.folder: plot} if plot else {}
    parts = [(contrast, contrast.shared[:SHOWN_PAIRS]) for contrast in contrasts]
    text = template("report.html").render(
        overviews=overviews,
        contrasts=contrasts,
        pictures=pictures,
        plots=plots,
        steps=("proposed", *STAGES),
        names=names(pools, [id_ for _, pairs in parts for pair in pairs for id_ in (pair.one, pair.other)]),
        pairs=SHOWN_PAIRS,
        most=MAX_PAIRS,
        energy_of=MAX_ENERGY_SCENARIOS,
        remark=remark,
        close=NEAR_DUPLICATE_DISTANCE,
    )
    write(path, text)
    return remark


def plain(overviews: Sequence[Overview], contrasts: Sequence[Contrast]) -> dict[str, Any]:
    """The report as plain data."""
    return {"pools": [asdict(o) for o in overviews], "contrasts": [asdict(c) for c in contrasts]}


def _overview(pool: Pool, task: Task, batch: Batch, search: Sequence[str]) -> Overview:
    even, biased, histograms = None, None, ()
    if len(batch) and not pool.manifest.is_subset:
        even, biased, histograms = _selection(pool, task, search)
    return Overview(
        folder=str(pool.folder),
        task=task.name,
        split=pool.split,
        scenarios=len(batch),
        sample=sampled_indices(pool) if histograms else "",
        funnel=pool.manifest.funnel,
        reasons=pool.manifest.reasons,
        outside=per_parameter(task, batch),
        evenness=even,
        bias=biased,
        histograms=histograms,
    )


def _selection(pool: Pool, task: Task, search: Sequence[str]) -> tuple[Evenness | None, Bias, tuple[Histogram, ...]]:
    """Evenness, selection bias and histograms of a pool, from all its draws, which are made again."""
    drawn = [p for p in redrawn(pool, search=search) if p.feasible]
    numbers = np.array([list(p.quantiles.values()) for p in drawn if p.certified])
    even = evenness(numbers) if numbers.size else None
    rows = [measured(p.scenario) for p in drawn]
    table = {name: np.array([row[name] for row in rows], float) for name in rows[0]}
    certified = np.array([p.certified for p in drawn])
    biased = bias(table, certified)
    training = _training(pool, task)
    names = list(dict.fromkeys([*task.shifts(pool.split), *(m.name for m in biased.marginals)]))[:SHOWN_MARGINALS]
    histograms = tuple(
        histogram(label(task, n), table[n], certified, np.array([row[n] for row in training])) for n in names
    )
    return even, biased, histograms


def _training(pool: Pool, task: Task) -> list[dict[str, float]]:
    """The training scenarios of the first indices of a pool: the twins, if the pool is out of distribution."""
    drawn, found = pool.manifest.config, []
    for index in range(min(pool.manifest.indices, MAX_TRAINING)):
        with suppress(Infeasible):
            found.append(measured(task.draw(ID, drawn.seed, index, task.design(drawn.sampler)).scenario))
    return found


Side = tuple[Pool, Batch]


def _contrast(task: Task, one: Side, other: Side) -> Contrast:
    (a, here), (b, there) = one, other
    return Contrast(str(a.folder), str(b.folder), apart(task, a, b), near_duplicates(task, here, there))
