"""What can be answered without a look: the answer to each question that is most often right in training."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ..samplers.split import ID
from ..samplers.task import Task
from .facts import Answer, Sheet

DRAWS = 100
"""Number of training draws from which priors are estimated: the standard error of a share is at most 5 points."""
SEED = 1_000_003
"""Seed of these draws, which no pool has by default."""


@dataclass(frozen=True)
class Prior:
    """The best fixed answer to a question."""

    answer: Answer
    """The answer that is most often right in training."""
    share: float
    """Share of training in which it is right; 1 for a question that tests knowledge of the task and no sight."""


def priors(task: Task, sheet: Sheet, draws: int = DRAWS, seed: int = SEED) -> dict[str, Prior]:
    """The best fixed answer to each question of a task.

    Hidden state and the simplest plan are left out: the first has no right claim, the second needs certificates.
    """
    answers: dict[str, list[Answer]] = {}
    for index in range(draws):
        told = task.draw(ID, seed, index).scenario.facts()
        for id_, value in told.items():
            if id_ in sheet.facts and not sheet.facts[id_].shortcut:
                answers.setdefault(id_, []).append((value,) if isinstance(value, str) else float(value))
    fixed = {id_: Prior(question.rights, 1.0) for id_, question in sheet.facts.items() if question.right}
    return {**fixed, **{id_: _best(every, sheet.facts[id_].within) for id_, every in answers.items()}}


def _best(answers: Sequence[Answer], within: float) -> Prior:
    """The fixed answer that counts as right most often."""
    if isinstance(answers[0], tuple):
        (likeliest, count), *_ = Counter(answers).most_common(1)
        return Prior(likeliest, count / len(answers))
    numbers = [answer for answer in answers if isinstance(answer, float)]
    best = max(
        (n + shift for n in numbers for shift in (-within, 0.0, within)), key=lambda g: _right(numbers, g, within)
    )
    return Prior(best, _right(numbers, best, within) / len(numbers))


def _right(numbers: Sequence[float], guess: float, within: float) -> int:
    """Number of numbers for which a guess counts as right."""
    return sum(abs(number - guess) <= within * (1 + 1e-9) for number in numbers)
