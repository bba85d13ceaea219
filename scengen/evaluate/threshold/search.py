"""The search for the level at which a policy breaks: rounds of rollouts, each at the levels that inform most."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import BadConfig
from ..arms import CLEAN
from ..rollouts import Evaluation, Keep, id_of, identity, opened, ready
from ..scenarios import Scenarios, not_playable
from ..settings import RolloutId, completed
from .curves import LOOKS_AT_LEVEL, LOOKS_PER_ROUND, Curves, Ints
from .pools import Candidate, LevelPools
from .settings import ThresholdSettings
from .shift import Shift

DESIGN = "threshold"
"""Entry of a run with the settings that decide which rollouts are played."""

Outcomes = Mapping[RolloutId, bool | None]
"""Whether rollouts succeeded; None for those in which the policy crashed."""


class Search:
    """A search, as rounds of rollouts that depend on the outcomes of earlier rounds and on nothing else."""

    def __init__(self, settings: ThresholdSettings, pools: LevelPools, lost: Mapping[str, str] | None = None):
        """
        Args:
            lost: scenarios that cannot be played, with the reasons.
        """
        self.settings, self.pools, self.lost, self.shift = settings, pools, lost or {}, pools.shift
        self.curves = Curves(self.shift.levels, settings.success)
        self._used: set[tuple[int, int]] = set()

    def rounds(self, outcomes: Outcomes) -> Iterator[list[RolloutId]]:
        """Yield the rollouts of each round. The outcomes must hold them before the next round; it ends if they do not.

        Args:
            outcomes: outcomes of rollouts, which grow between rounds.
        """
        counts = np.zeros((2, 1, self.shift.levels + 1), np.int64)
        tried, solved = counts
        spent, wanted = 0, [level for level in range(self.shift.levels + 1) for _ in range(LOOKS_AT_LEVEL)]
        while wanted:
            found = [(level, which) for level in wanted if (which := self._next(level))]
            yield [which for _, which in found]
            for level, which in found:
                if which not in outcomes:
                    return
                if (success := outcomes[which]) is not None:
                    tried[0, level] += 1
                    solved[0, level] += success
            spent += len(wanted)
            wanted = self._wanted(tried, solved, spent)

    def _wanted(self, tried: Ints, solved: Ints, spent: int) -> list[int]:
        """Levels of the next round; none if the search ends."""
        found = self.curves.estimates(tried, solved).is_decided(self.settings.precision, self.shift.levels)
        if found.all() or spent + LOOKS_PER_ROUND > self.settings.budget:
            return []
        there = np.array([[self._has_more(level) for level in range(self.shift.levels + 1)]])
        level = int(self.curves.next_level(tried, solved, there)[0])
        return [level] * LOOKS_PER_ROUND if there[0, level] else []

    def _has_more(self, level: int) -> bool:
        """Whether a round at a level is possible."""
        unused = sum(map(self._is_unused, self.pools.candidates(level)))
        return unused >= LOOKS_PER_ROUND or self.pools.is_drawn

    def _next(self, level: int) -> RolloutId | None:
        """The next rollout at a level, which is then used; None if there is none."""
        if self.pools.is_drawn and not any(map(self._is_unused, self.pools.candidates(level))):
            self.pools.draw(level)
        for candidate in filter(self._is_unused, self.pools.candidates(level)):
            self._used.add((candidate.seed, candidate.index))
            perturbation = self.shift.perturbation(level)
            return RolloutId(self.shift.task.name, perturbation, CLEAN, candidate.folder, candidate.id, 0)
        return None

    def _is_unused(self, candidate: Candidate) -> bool:
        return (candidate.seed, candidate.index) not in self._used and candidate.id not in self.lost


def find(
    settings: ThresholdSettings,
    pools: LevelPools,
    progress: Callable[[int, int], None],
    search: Sequence[str] = (),
    keep: Keep = lambda which, actions: None,
) -> Evaluation:
    """Search for the level at which a policy breaks, continuing the run in the folder of the settings.

    Args:
        progress: called with the number of rollouts, and their maximum.
        search: overrides that add folders of other packages, see `task_files.search_path`.
        keep: called with the actions of every rollout that is played to its end, if episodes are kept.

    Raises:
        ScengenError: a pool, a policy or a setting is not valid.
    """
    settings = ready(with_levels(settings, pools))
    fixed = [] if pools.is_drawn else pools.pools
    lost = not_playable(fixed, _within_reach(settings, pools), settings.workers) if fixed else {}
    depends = {**identity(settings, fixed), DESIGN: dict(settings.design)}
    with opened(settings, depends, pools.about, search, keep, lambda *_: None) as run:
        outcomes, played = dict[RolloutId, bool | None](), 0
        for some in Search(settings, pools, lost).rounds(outcomes):
            run.extend(with_levels(settings, pools))
            run.play({*some})
            outcomes |= outcomes_of(run.lines())
            played += len(some)
            progress(played, settings.budget)
        progress(played, played)
        run.sort()
        return Evaluation(run.lines(), run.earlier, lost, (), {}, run.chain, spent=run.spent)


def _within_reach(settings: ThresholdSettings, pools: LevelPools) -> Scenarios:
    """The scenarios that a search may come to."""
    first = (pools.candidates(level)[: settings.budget] for level in range(pools.shift.levels + 1))
    return {(each.folder, each.id): pools.about[each.folder, each.id] for some in first for each in some}


def check(settings: ThresholdSettings, shift: Shift) -> None:
    """Raise `BadConfig` if a policy perceives nothing of a shift, or if the budget is below the first looks."""
    along_levels(settings, shift).check()
    robot = shift.task.embodiment
    observed = settings.remote.streams(robot) if settings.remote else completed(settings).observations
    shift.check_observed(observed, settings.look)
    if settings.budget < (first := LOOKS_AT_LEVEL * (shift.levels + 1)):
        what = f"the first looks at {shift.levels} levels and without a shift are {first} rollouts"
        raise BadConfig(f"budget = {settings.budget}; {what}: pass budget={first} or more")


def along_levels(settings: ThresholdSettings, shift: Shift) -> ThresholdSettings:
    """The settings with the perturbations of all levels."""
    return replace(settings, perturb=[*dict.fromkeys(map(shift.perturbation, range(1, shift.levels + 1)))])


def with_levels(settings: ThresholdSettings, pools: LevelPools) -> ThresholdSettings:
    """The settings with the pools and the perturbations of all levels."""
    return replace(along_levels(settings, pools.shift), pool=[str(pool.folder) for pool in pools.pools])


def outcomes_of(lines: Iterable[Mapping[str, Any]]) -> dict[RolloutId, bool | None]:
    """Outcomes of the rollouts of some lines."""
    return {id_of(line): None if line["crashed"] else line["success"] for line in lines}
