"""How far a question can be answered without a look: by the answer that is most often right in training."""

from collections import Counter
from collections.abc import Sequence

from ..samplers.split import ID
from ..samplers.task import Task
from .facts import Answer, Sheet

DRAWS = 40
"""Number of training draws from which the share is estimated: its standard error is at most 8 points."""


def prior_shares(task: Task, sheet: Sheet, draws: int = DRAWS) -> dict[str, float]:
    """Share of training draws in which the best fixed answer is right, by question.

    1 for a question with the same answer in all of training: it tests knowledge of the task and no sight. Hidden state
    and the simplest plan are left out: the first has no right claim, the second needs certificates.
    """
    answers: dict[str, list[Answer]] = {}
    for index in range(draws):
        told = task.draw(ID, 0, index).scenario.facts()
        for id_, value in told.items():
            if id_ in sheet.facts and not sheet.facts[id_].shortcut:
                answers.setdefault(id_, []).append((value,) if isinstance(value, str) else float(value))
    fixed = {id_: 1.0 for id_, question in sheet.facts.items() if question.right}
    return {**fixed, **{id_: _best(every, sheet.facts[id_].within) for id_, every in answers.items()}}


def _best(answers: Sequence[Answer], within: float) -> float:
    """Share of answers for which the best fixed one counts as right."""
    if isinstance(answers[0], tuple):
        return max(Counter(answers).values()) / len(answers)
    numbers = [answer for answer in answers if isinstance(answer, float)]
    tried = [number + shift for number in numbers for shift in (-within, 0.0, within)]
    return max(sum(abs(n - guess) <= within * (1 + 1e-9) for n in numbers) for guess in tried) / len(numbers)
