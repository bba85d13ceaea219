"""The search: which points are tried, in which order, and what is confirmed.

The budget is spent in stages:

1. far: every region outside training is tried far out, one parameter at a time.
2. hypercube: points spread over all regions, one or two parameters at a time.
3. forest: a random forest learns from the trials so far, and the points are tried at which it is least certain. These
   lie at the edges of the regions in which a memory breaks.
4. shrink: if two parameters together broke a memory, each of them is tried alone.
5. narrow: boxes of points that broke a memory are tried again, inside and around, until their ends are known.
6. confirm: each box with enough evidence is tested on fresh twins (`confirmation`).

A point that violates a constraint costs no trial: regions end where no twin is feasible any more, and a point is tried
in a twin in which it is feasible.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from types import TracebackType

import numpy as np

from ...errors import BadConfig
from ...samplers.task import Task
from ...scenario import Scenario
from ...validate.identity import source_sha256
from ...validate.settings import CertifySettings
from ...work.log import FRESH, Log
from ...work.parallel import Workers, each
from ...work.targets import move_aside
from .boxes import boxes
from .candidates import (
    NARROW,
    Reaches,
    far_points,
    forest_class,
    hypercube,
    single_points,
    surrounding_points,
    uncertain_points,
)
from .confirmation import (
    CONTROLS_PER_TWIN,
    FAMILYWISE_ERROR,
    FRESH_TWINS,
    SEARCH_TWINS,
    TWINS_PER_LOOK,
    corrected_by_holm,
    corrected_p_value,
    decided,
    play_confirming_trial,
)
from .proposal import Finding, as_yaml, finding
from .regions import Region, regions
from .trial import (
    CONFIRM,
    TRIAL_LIMITS,
    Place,
    PlannedTrial,
    Point,
    RegionBox,
    SearchTrial,
    TrialRunner,
    play_search_trial,
)

TRIALS = "trials.jsonl"
"""Name of the log of a search."""
FOREST = "forest"
"""Method that learns from the trials so far where to look."""
HYPERCUBE = "hypercube"
"""Method that spreads its points and does not learn."""
METHODS = (FOREST, HYPERCUBE)
"""All methods."""
HYPERCUBE_END = 0.35
"""Share of the budget that is spent when the first hypercube ends."""
LEARNING_END = 0.55
"""Share of the budget that is spent when the forest, or the second hypercube, ends."""
NARROWING_END = 0.7
"""Share of the budget that is spent when the narrowing ends."""
MIN_BUDGET = math.ceil(FRESH_TWINS / (1 - NARROWING_END))
"""Minimum budget: one box can be confirmed with it [trials]."""
REACH_STEPS = 16
"""Number of places in a region at which it is examined whether some twin is feasible."""
MIN_EVIDENCE = 3
"""Minimum of `breaks - 2 * others` among the trials in a box that is to be confirmed."""


@dataclass(frozen=True)
class DiscoverSettings:
    """Settings of `scengen axis discover`; conf/command/axis_discover.yaml explains them."""

    budget: int = 500
    method: str = FOREST
    seed: int = 0
    workers: Workers = 1
    fresh: bool = False
    to: str | None = None


@dataclass(frozen=True)
class SearchResult:
    """Findings of a search, and the number of its trials."""

    findings: list[Finding]
    """Findings that were confirmed, the smallest p value first."""
    rejected: list[Finding]
    """Findings that were not confirmed."""
    outcomes: dict[str, int]
    """Number of trials by outcome."""
    stages: dict[str, int]
    """Number of trials by stage."""

    @property
    def spent(self) -> dict[str, int]:
        """Number of trials by stage and by outcome."""
        return self.stages | self.outcomes

    def as_yaml(self, task: Task) -> str:
        """The confirmed axes in the format of a task file."""
        return as_yaml(task, self.findings, self.spent)


def discover(
    task: Task,
    checks: CertifySettings,
    settings: DiscoverSettings,
    folder: Path,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> SearchResult:
    """Search for axes, continuing the run in `folder`.

    Args:
        checks: settings of the checks that come before the oracle.
        progress: called with the stage, the number of trials done, and the budget.

    Raises:
        BadConfig: the method is none of `METHODS`, scikit-learn is missing, no training scenario can be solved, or
            nothing outside training is feasible.
    """
    if settings.method == FOREST:
        forest_class()  # before any work, to say at once that it is missing
    if settings.fresh:
        move_aside(folder / TRIALS)
    known = regions(task)
    with _SearchRun(task, checks, settings, known, folder, progress) as run:
        _search(run, known, settings)
        tested = list[tuple[RegionBox, list[SearchTrial]]]()
        for evidence, box in boxes(run.searched):
            if evidence >= MIN_EVIDENCE and run.spent + FRESH_TWINS <= settings.budget:
                tested.append((box, run.confirm(len(tested), box)))
    found = corrected_by_holm(
        [finding(task, known, box, run.searched, trials, corrected_p_value(trials)) for box, trials in tested]
    )
    return SearchResult(
        [f for f in found if f.p < FAMILYWISE_ERROR],
        [f for f in found if f.p >= FAMILYWISE_ERROR],
        dict(Counter(trial.outcome for trial in run.trials)),
        dict(Counter(trial.stage for trial in run.trials)),
    )


def _search(run: "_SearchRun", known: Sequence[Region], settings: DiscoverSettings) -> None:
    """Spend the budget of all stages before the confirmation.

    Raises:
        BadConfig: nothing outside training is feasible.
    """
    hypercube_end, learning_end, narrowing_end = (
        round(share * settings.budget) for share in (HYPERCUBE_END, LEARNING_END, NARROWING_END)
    )
    random = np.random.default_rng(settings.seed)
    reaches = run.reaches()
    if not reaches:
        raise BadConfig(f"{run.task.name}: no value outside training is feasible; widen the bounds of its parameters")
    run.ask("far", far_points(known, reaches, random)[:hypercube_end])
    run.ask(HYPERCUBE, hypercube(hypercube_end - run.spent, reaches, random))
    if settings.method == FOREST:
        while run.spent < learning_end:
            run.ask(FOREST, uncertain_points(run.searched, reaches, random)[: learning_end - run.spent])
    else:
        run.ask(HYPERCUBE, hypercube(learning_end - run.spent, reaches, random))
    single = single_points(run.searched)[: max(0, narrowing_end - run.spent)]
    run.ask("shrink", [point for point, _ in single], [twin for _, twin in single])
    while run.spent < narrowing_end and (points := surrounding_points(run.searched)):
        run.ask(NARROW, points[: narrowing_end - run.spent])


class _SearchRun:
    """The trials of one search: read from the log as far as it goes, then made."""

    def __init__(
        self,
        task: Task,
        checks: CertifySettings,
        settings: DiscoverSettings,
        known: Sequence[Region],
        folder: Path,
        progress: Callable[[str, int, int], None],
    ):
        self.task, self.settings, self.progress = task, settings, progress
        self.runner = TrialRunner(task, checks, known, settings.seed)
        identity = {
            "task": task.name,
            "training": {name: str(dist) for name, dist in task.training.items()},
            "source": source_sha256(task.family),
            "budget": settings.budget,
            "method": settings.method,
            "seed": settings.seed,
            "controls": CONTROLS_PER_TWIN,
        }
        self.log = Log(folder / TRIALS, identity, FRESH)
        self.trials: list[SearchTrial] = []
        """Trials in the order in which they ended: with several workers any order."""
        self.spent = 0
        """Number of trials that the search has requested."""

    def __enter__(self) -> "_SearchRun":
        self.log.__enter__()
        self.trials = [SearchTrial.read(record) for record in self.log.records]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.log.__exit__(kind, error, trace)

    @property
    def searched(self) -> list[SearchTrial]:
        """The trials of the search itself, without those that confirm."""
        return [trial for trial in self._from(0) if trial.stage != CONFIRM]

    @cached_property
    def trained(self) -> list[Scenario]:
        """The twins. Workers are copies of this process, which has computed their memories by then."""
        return [self.runner.twin(number)[0] for number in range(SEARCH_TWINS)]

    def reaches(self) -> Reaches:
        """The first and the last place at which some twin is feasible, for every region that has such places."""
        found: dict[int, tuple[float, float]] = {}
        for i in range(len(self.runner.known)):
            places = [Point((Place(i, (k + 0.5) / REACH_STEPS),)) for k in range(REACH_STEPS)]
            steps = [k for k, point in enumerate(places) if self._feasible(point, range(SEARCH_TWINS)) is not None]
            if steps:
                found[i] = steps[0] / REACH_STEPS, (steps[-1] + 1) / REACH_STEPS
        return found

    def ask(self, stage: str, points: Sequence[Point], twins: Sequence[int] | None = None) -> None:
        """Try points.

        Args:
            twins: number of the twin for each point; without it, each point goes to the next twin in which it is
                feasible.
        """
        planned = list[PlannedTrial]()
        for k, point in enumerate(points):
            number = self.spent + k
            turns = [(number + shift) % SEARCH_TWINS for shift in range(SEARCH_TWINS)] if twins is None else [twins[k]]
            feasible = self._feasible(point, turns)
            planned.append(PlannedTrial(number, stage, point, turns[0] if feasible is None else feasible))
        self._make(play_search_trial, planned)

    def confirm(self, number: int, box: RegionBox) -> list[SearchTrial]:
        """Try a box in fresh twins, some at a time, until all are tried or the p value decides.

        Args:
            number: number of the box among those that are confirmed.
        """
        begin, trials = self.spent, list[SearchTrial]()
        for first in range(0, FRESH_TWINS, TWINS_PER_LOOK):
            numbers = range(first, first + TWINS_PER_LOOK)
            twins = SEARCH_TWINS + number * FRESH_TWINS
            self._make(play_confirming_trial, [PlannedTrial(begin + k, CONFIRM, box, twins + k) for k in numbers])
            trials = self._from(begin)
            if decided(trials):
                break
        return trials

    def _feasible(self, point: Point, twins: Iterable[int]) -> int | None:
        """The first of some twins in which a point is feasible."""
        return next((k for k in twins if self.runner.feasible(self.trained[k], point)), None)

    def _make(self, work: Callable[[TrialRunner, PlannedTrial], SearchTrial], planned: Sequence[PlannedTrial]) -> None:
        """Make the trials that the log does not hold."""
        made = {trial.number for trial in self.trials}
        todo = [one for one in planned if one.number not in made]
        for trial in each(partial(work, self.runner), todo, self.settings.workers, TRIAL_LIMITS, PlannedTrial.lost):
            self.log.add(trial.plain())
            self.trials.append(trial)
            self.progress(trial.stage, len(self.trials), self.settings.budget)
        self.spent += len(planned)

    def _from(self, begin: int) -> list[SearchTrial]:
        """The trials from number `begin` on that the search has requested, by number."""
        asked = (trial for trial in self.trials if begin <= trial.number < self.spent)
        return sorted(asked, key=lambda trial: trial.number)
