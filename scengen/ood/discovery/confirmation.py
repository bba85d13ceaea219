"""The confirmation of a box on fresh twins, each with its controls.

A search among hundreds of points finds something by chance, so only the confirmation counts. The test is exact and goes
by twins. A twin's memory is played in some controls and in one scenario outside training. If nothing is special
outside, each of these scenarios is equally likely to be among those that the memory solved (with one control:
McNemar's test). A memory that fails half of its controls can still show something.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...samplers.keyed import unit
from .. import behaviour
from .proposal import Finding
from .trial import BREAKS, HOLDS, INFEASIBLE, Place, PlannedTrial, Point, RegionBox, SearchTrial, TrialRunner

SEARCH_TWINS = 8
"""Number of training scenarios whose memories are played in the search."""
FRESH_TWINS = 20
"""Number of twins in which a box is confirmed, each in a separate scenario."""
PLACEMENT_TRIES = 20
"""Maximum number of draws within the box until one is feasible in a fresh twin."""
CONTROLS_PER_TWIN = 3
"""Number of moves within training on which each fresh twin's memory is tried."""
TWINS_PER_LOOK = 5
"""Number of fresh twins that are tried between two looks at the p value."""
LOOKS = FRESH_TWINS // TWINS_PER_LOOK
"""Number of looks. The test may end at any of them, so p values are multiplied by it (Bonferroni)."""
FUTILITY_P = 0.5
"""P value above which the confirmation of a box ends at a look."""
FAMILYWISE_ERROR = 0.05
"""Family-wise error rate of the confirmation, by Holm's correction (Holm 1979)."""
CERTAINTY_P = FAMILYWISE_ERROR / 20 / LOOKS
"""P value below which the confirmation of a box ends at a look: it would suffice for one box among twenty."""


def play_confirming_trial(runner: TrialRunner, planned: PlannedTrial) -> SearchTrial:
    """Try a box in one fresh twin, at a random place; controls are moves of the same parameters within training.

    A parameter that training does not vary has one control, the scenario that is remembered.
    """
    box, number = planned.where, planned.twin - SEARCH_TWINS
    assert isinstance(box, RegionBox), "only boxes are confirmed"
    trained, memory = runner.twin(planned.twin)
    outcome, task, seed = INFEASIBLE, runner.task, runner.seed
    solved = list[bool]()
    for attempt in range(PLACEMENT_TRIES):
        point = _drawn_within(box, seed, number, attempt)
        if runner.feasible(trained, point):
            outcome = runner.outcome(trained, memory, point)
            break
    if outcome in (BREAKS, HOLDS):
        names = [runner.known[region].parameter.name for region in box.regions]
        moves = [
            behaviour.moved_within(task, names, seed, number + 1000 * k, trained) for k in range(CONTROLS_PER_TWIN)
        ]
        controls = dict.fromkeys(move for move in moves if move is not None)
        solved = [behaviour.follows(task, memory, control) for control in controls]
    return planned.ended(outcome, solved)


def _drawn_within(box: RegionBox, seed: int, number: int, attempt: int) -> Point:
    """A random point of a box, the same for the same seed, twin and attempt."""
    return Point(
        tuple(
            Place(region, low + unit("discover", seed, number, attempt, region) * (high - low))
            for region, low, high in box.ranges
        )
    )


def p_value(trials: Sequence[SearchTrial]) -> float:
    """Probability that at most as many fresh twins are solved if a memory succeeds there as often as in its controls.

    Exact, and conditional on how much each twin's memory solves: where that is `k` of `m` controls and the one scenario
    outside training, the latter is among them with probability `k / (m + 1)`.
    """
    chances, held = np.ones(1), 0  # of 0, 1, 2 ... twins solved
    for trial in trials:
        if trial.outcome in (BREAKS, HOLDS) and trial.controls:
            holds = trial.outcome == HOLDS
            share = (sum(trial.controls) + holds) / (len(trial.controls) + 1)
            chances, held = np.convolve(chances, (1 - share, share)), held + holds
    return float(chances[: held + 1].sum())


def corrected_p_value(trials: Sequence[SearchTrial]) -> float:
    """The p value corrected for the number of looks."""
    return min(1.0, LOOKS * p_value(trials))


def decided(trials: Sequence[SearchTrial]) -> bool:
    """Whether the confirmation of a box can end: its p value is small enough, or too large."""
    return not CERTAINTY_P <= p_value(trials) <= FUTILITY_P


def corrected_by_holm(found: Sequence[Finding]) -> list[Finding]:
    """Findings with p values after Holm's correction, the smallest first."""
    ordered, least, corrected = sorted(found, key=lambda f: f.p), 0.0, list[Finding]()
    for k, finding in enumerate(ordered):
        least = max(least, min(1.0, (len(ordered) - k) * finding.p))
        corrected.append(replace(finding, p=least))
    return corrected
