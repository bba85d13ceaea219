"""Tables of a run: shares of right answers by task and category, ID beside OOD, with intervals by scenario."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..evaluate.table import TableLine, cells, table
from ..samplers.split import ID
from .grading import Grade
from .questioning import UNDERSTAND, Result

GRADES: tuple[Grade, ...] = ("right", "wrong", "forbidden", "missing", "format")
"""Grades of answers in the order of the tables."""


def result_of(plain: Mapping[str, Any]) -> Result:
    """The result in a line of a file of results."""
    return Result(**{name: plain[name] for name in ("about", "stage", "attempts", "format_error", "grades")})


def lines(results: Sequence[Mapping[str, Any]], stage: int) -> list[TableLine]:
    """The paper's table for one stage, see `evaluate.table.table`: an answer counts as a rollout of its scenario."""
    found = [(plain, result_of(plain).outcomes) for plain in results if plain["stage"] == stage]
    return table([_episode(plain, success) for plain, outcomes in found for success in outcomes])


MOST_PRIOR = 0.6
"""Largest share of training in which the best fixed answer may be right for a question to test sight."""


def sighted_lines(results: Sequence[Mapping[str, Any]], priors: Mapping[str, Mapping[str, float]]) -> list[TableLine]:
    """The table of stage 1 for the questions that need a look: a fixed answer is right in at most `MOST_PRIOR` of
    training. Tasks without such questions have no line; the list is empty if there are none."""
    episodes = [
        _episode(plain, grade == "right")
        for plain in results
        if plain["stage"] == UNDERSTAND
        for question, grade in plain["grades"].items()
        if priors.get(plain["task"], {}).get(question, 1.0) <= MOST_PRIOR
    ]
    return table(episodes) if episodes else []


def executed_lines(results: Sequence[Mapping[str, Any]]) -> list[TableLine]:
    """The table of stage 2 for plans that were carried out: whether they reached the goal. Tasks without moves have no
    line; the list is empty if nothing was carried out."""
    episodes = [_episode(plain, outcome["success"]) for plain, outcome in _executed(results) if outcome]
    return table(episodes) if episodes else []


@dataclass(frozen=True)
class Agreement:
    """Audits of plans beside their outcomes."""

    right: int
    """Number of plans that are right and were carried out."""
    right_reached: int
    """Number of them that reached the goal."""
    wrong: int
    """Number of plans that are wrong and were carried out."""
    wrong_reached: int
    """Number of them that reached the goal all the same."""
    no_moves: tuple[str, ...]
    """Tasks that state no moves for their sub-goals; their plans are not carried out."""


def agreement(results: Sequence[Mapping[str, Any]]) -> Agreement | None:
    """How audits and outcomes of plans agree; None if no plan was to be carried out."""
    if not (found := _executed(results)):
        return None
    told = Counter((plain["grades"]["right"], outcome["success"]) for plain, outcome in found if outcome)
    still = tuple(dict.fromkeys(plain["task"] for plain, outcome in found if not outcome))
    right, wrong = (told[right, True] + told[right, False] for right in (True, False))
    return Agreement(right, told[True, True], wrong, told[False, True], still)


def _executed(results: Sequence[Mapping[str, Any]]) -> list[tuple[Mapping[str, Any], Mapping[str, Any] | None]]:
    """Results of stage 2 whose plans were to be carried out, and their outcomes; None if the task states no moves."""
    return [(plain, plain["grades"]["executed"]) for plain in results if "executed" in plain["grades"]]


def _episode(plain: Mapping[str, Any], success: bool) -> dict[str, Any]:
    return {**{name: plain[name] for name in ("task", "category", "split", "seed", "index")}, "success": success}


@dataclass(frozen=True)
class QuestionLine:
    """Grades of one question, or kind of error of a plan, over all scenarios."""

    task: str
    """Name of the task."""
    question: str
    """Id of the question."""
    counts: Mapping[str, int]
    """Number of replies by grade."""
    prior: float | None
    """Share of training in which the best fixed answer is right; None for hidden state and the simplest plan."""


def by_question(results: Sequence[Mapping[str, Any]], priors: Mapping[str, Mapping[str, float]]) -> list[QuestionLine]:
    """Grades of stage 1 by question."""
    counts: dict[tuple[str, str], Counter[str]] = {}
    for plain in results:
        if plain["stage"] == UNDERSTAND:
            for question, grade in plain["grades"].items():
                counts.setdefault((plain["task"], question), Counter())[grade] += 1
    return [
        QuestionLine(task, question, dict(found), priors.get(task, {}).get(question))
        for (task, question), found in counts.items()
    ]


def plan_errors(results: Sequence[Mapping[str, Any]]) -> Counter[str]:
    """Number of plans with each kind of error, and of plans without a form."""
    found: Counter[str] = Counter()
    for plain in results:
        if "errors" in plain["grades"]:
            found.update({kind for kind, _ in plain["grades"]["errors"]})
            found.update(["format"] if plain["format_error"] else [])
    return found


def lost_in_twins(results: Sequence[Mapping[str, Any]], stage: int) -> tuple[int, int]:
    """How often training is understood and the OOD twin is not.

    Returns:
        Number of answers that are right in training and not in the twin of the same index, and number of answers that
        are right in training and were asked in a twin.
    """
    right: dict[tuple[Any, ...], bool] = {}
    for plain in results:
        if plain["stage"] == stage:
            grades = plain["grades"] if stage == UNDERSTAND else {"right": plain["grades"]["right"]}
            where = (plain["task"], plain["seed"], plain["index"], plain["about"]["temperature"], plain["split"])
            right.update({(*where, name): grade in ("right", True) for name, grade in grades.items()})
    pairs = [
        (right[*where[:4], ID, where[5]], good)
        for where, good in right.items()
        if where[4] != ID and (*where[:4], ID, where[5]) in right
    ]
    return sum(trained and not good for trained, good in pairs), sum(trained for trained, _ in pairs)


def markdown(title: str, found: Sequence[TableLine]) -> str:
    """A table of one stage as Markdown, rates and 95 % intervals in percent."""
    head = f"{title}\n\n| | split | ID | OOD | difference |\n|---|---|---|---|---|\n"
    return head + "".join(f"| {' | '.join(cells(line))} |\n" for line in found)
