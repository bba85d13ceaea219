"""Questions that can be answered without observation: the answer to each question that is most often right in
training."""

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
    fixed = {id_: Prior(question.rights, 1.0) for id_, question in sheet.facts.items() if question.right}
    given = answers(task, sheet, draws, seed)
    return {**fixed, **{id_: _best(every, sheet.facts[id_].within) for id_, every in given.items()}}


def answers(task: Task, sheet: Sheet, draws: int, seed: int) -> dict[str, list[Answer]]:
    """The family's answers in training draws, by question."""
    found: dict[str, list[Answer]] = {}
    for index in range(draws):
        for id_, value in task.draw(ID, seed, index).scenario.facts().items():
            if id_ in sheet.facts and not sheet.facts[id_].shortcut:
                found.setdefault(id_, []).append((value,) if isinstance(value, str) else float(value))
    return found


def share(guess: Answer, given: Sequence[Answer], within: float) -> float:
    """Share of answers for which a fixed one counts as right."""
    return sum(_alike(guess, answer, within) for answer in given) / len(given)


def _alike(guess: Answer, answer: Answer, within: float) -> bool:
    if isinstance(guess, float) and isinstance(answer, float):
        return abs(answer - guess) <= within * (1 + 1e-9)
    return guess == answer


def _best(given: Sequence[Answer], within: float) -> Prior:
    """The fixed answer that counts as right most often."""
    tried = dict.fromkeys(
        guess
        for answer in given
        for guess in ((answer,) if isinstance(answer, tuple) else (answer - within, answer, answer + within))
    )
    best = max(tried, key=lambda guess: share(guess, given, within))
    return Prior(best, share(best, given, within))
