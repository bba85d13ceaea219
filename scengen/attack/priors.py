"""Tier of priors: the best one, two and three fixed answers, fitted on other draws, given without looking."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..scenario import Answer, Scenario
from ..validate.certify import lower_bound
from .macros import Macro
from .player import Attempt

GUESSES = (1, 2, 3)
"""How many fixed answers are given one after the other in an episode."""


@dataclass(frozen=True)
class Prior:
    """Fixed answers, the best one first."""

    values: tuple[float, ...]
    fitted: float
    """Share of the draws that one of them answers, where they were fitted."""
    fresh: float | None = None
    """The same on other draws, by statics; None where only rollouts can tell."""
    draws: int = 0
    """How many other draws."""

    @property
    def bound(self) -> float | None:
        """One-sided upper Clopper-Pearson bound of `fresh` at 95 % confidence."""
        if self.fresh is None:
            return None
        return 1.0 - lower_bound(round((1 - self.fresh) * self.draws), self.draws)


AnswerJudge = Callable[[Scenario], Callable[[float], bool]]
"""Whether a value is right in a scenario: by statics, or by a rollout."""


def by_statics(scenario: Scenario) -> Callable[[float], bool]:
    """What the family itself says about guesses."""
    answer = scenario.answer()
    assert answer is not None and answer.right is not None, "asked for once for the family"
    return answer.right


def fit(training: Sequence[Scenario], judge: AnswerJudge = by_statics, fresh: Sequence[Scenario] = ()) -> list[Prior]:
    """The best one, two and three of the candidates, by exhaustive choice.

    Args:
        fresh: draws on which the choice is measured.
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
    """Whether guesses can be judged without rollouts."""
    return answer is not None and answer.right is not None


def guesses(priors: Iterable[Prior]) -> Iterator[Attempt]:
    """Every set of fixed answers, one answer after the other in one episode."""
    for prior in priors:
        moves = tuple(Macro("answer", "", (value,)) for value in prior.values)
        yield Attempt(f"prior_{len(prior.values)}", moves)


def _table(scenarios: Sequence[Scenario], values: Sequence[float], judge: AnswerJudge) -> NDArray[np.bool_]:
    """Which value is right in which scenario, shape (scenarios, values)."""
    rows = [[right(value) for value in values] for right in map(judge, scenarios)]
    return np.array(rows, bool).reshape(len(scenarios), len(values))
