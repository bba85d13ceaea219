"""Tier of priors: the best one, two and three fixed answers, fitted on other draws, given blindly."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..scenario import Answer, Scenario
from ..validate.settings import lower_bound
from .macros import Macro
from .player import Attempt

GUESSES = (1, 2, 3)
"""Numbers of fixed answers, or of memories, that are tried one after the other in an episode."""


@dataclass(frozen=True)
class Prior:
    """A set of fixed answers."""

    values: tuple[float, ...]
    """Answers, the best one first."""
    fitted: float
    """Share of the draws on which the answers were fitted that one of them solves."""
    fresh: float | None = None
    """Share of other draws that one of them solves, by statics; None if only rollouts can judge."""
    draws: int = 0
    """Number of other draws."""

    @property
    def bound(self) -> float | None:
        """One-sided upper Clopper-Pearson bound of `fresh` at 95 % confidence; None as `fresh`."""
        if self.fresh is None:
            return None
        return 1.0 - lower_bound(round((1 - self.fresh) * self.draws), self.draws)


AnswerJudge = Callable[[Scenario], Callable[[float], bool]]
"""Test whether a value is right in a scenario: by statics, or by a rollout."""


def by_statics(scenario: Scenario) -> Callable[[float], bool]:
    """The family's own test of an answer, which needs no rollout."""
    answer = scenario.answer()
    assert answer is not None and answer.right is not None, "fitted once for the family"
    return answer.right


def fit(training: Sequence[Scenario], judge: AnswerJudge = by_statics, fresh: Sequence[Scenario] = ()) -> list[Prior]:
    """The best one, two and three of the candidates, by exhaustive search.

    Args:
        training: draws on which the answers are fitted.
        judge: test of an answer.
        fresh: other draws on which the answers are measured.
    """
    answer = next(iter(training)).answer()
    if answer is None:
        return []
    values = answer.candidates
    known, other = _table(training, values, judge), _table(fresh, values, judge)
    priors = []
    for count in (n for n in GUESSES if n <= min(answer.tries, len(values))):
        best = max(combinations(range(len(values)), count), key=lambda chosen: known[:, chosen].any(axis=1).mean())
        order = sorted(best, key=lambda k: -known[:, k].mean())
        found = other[:, order].any(axis=1).mean() if len(fresh) else None
        chosen = tuple(values[k] for k in order)
        priors.append(Prior(chosen, float(known[:, order].any(axis=1).mean()), found, len(fresh)))
    return priors


def has_statics(answer: Answer | None) -> bool:
    """Whether answers can be judged without rollouts."""
    return answer is not None and answer.right is not None


def guesses(priors: Iterable[Prior]) -> Iterator[Attempt]:
    """An attempt for every set of fixed answers, which gives one answer after the other in one episode."""
    for prior in priors:
        moves = tuple(Macro("answer", "", (value,)) for value in prior.values)
        yield Attempt(f"prior_{len(prior.values)}", moves)


def _table(scenarios: Sequence[Scenario], values: Sequence[float], judge: AnswerJudge) -> NDArray[np.bool_]:
    """Whether each value is right in each scenario, shape (scenarios, values)."""
    rows = [[right(value) for value in values] for right in map(judge, scenarios)]
    return np.array(rows, bool).reshape(len(scenarios), len(values))
