"""Tables of a run: shares of right answers by task and category, ID next to OOD, with intervals by scenario."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..evaluate.statistics import Difference, Rate, mean_difference
from ..evaluate.table import TableLine, cells, percent, table
from ..samplers.split import ID
from .grading import Grade
from .priors import Prior
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


@dataclass(frozen=True)
class SightLine:
    """Measure of how much the answers of stage 1 are better than the best answers without a look: 0 as good, 1 all
    right.

    The measure is Cohen's kappa with the best fixed answers of training in place of chance: (share of right answers -
    prior) / (1 - prior), over the questions whose prior is below 1.
    """

    what: str
    """Name of the task or category, or `all`."""
    split: str
    """Name of the OOD split, or `all`."""
    id: Difference | None
    """The measure in distribution."""
    ood: Difference | None
    """The measure out of distribution. Below 0 the answers of training were given where they no longer hold."""

    @property
    def cells(self) -> list[str]:
        """The cells of the line, as text."""
        return [self.what, self.split, percent(self.id, "+"), percent(self.ood, "+")]


def sight_lines(
    results: Sequence[Mapping[str, Any]], known: Mapping[str, Mapping[str, Prior]]
) -> tuple[list[SightLine], list[str]]:
    """What stage 1 says about sight, in the lines of `lines`; categories are means over their tasks.

    Returns:
        The lines, and the tasks that have none, as all their answers are the same in training.
    """
    varied = {task: {id_: p.share for id_, p in of.items() if p.share < 1.0} for task, of in known.items()}
    episodes = [
        _episode(plain, grade == "right")
        for plain in results
        if plain["stage"] == UNDERSTAND
        for question, grade in plain["grades"].items()
        if question in varied.get(plain["task"], {})
    ]
    if not episodes:
        return [], list(varied)
    category = {episode["task"]: episode["category"] for episode in episodes}
    by_task = []
    for line in (line for line in table(episodes) if line.what in category):
        prior = sum(varied[line.what].values()) / len(varied[line.what])
        by_task.append(SightLine(line.what, line.split, _beyond(line.id, prior), _beyond(line.ood, prior)))
    last = {line.what: line for line in by_task}  # the line over all axes comes last
    groups = {name: [last[task] for task in category if category[task] == name] for name in category.values()}
    means = [_mean(name, lines) for name, lines in (*groups.items(), ("all", [*last.values()]))]
    return [*by_task, *means], [task for task, of in varied.items() if not of]


def _beyond(rate: Rate | None, prior: float) -> Difference | None:
    """A share of right answers, as a share of what is possible beyond a prior."""
    if rate is None:
        return None
    value, low, high = ((share - prior) / (1.0 - prior) for share in (rate.value, rate.low, rate.high))
    return Difference(value, low, high)


def _mean(name: str, lines: Sequence[SightLine]) -> SightLine:
    """The mean line of some tasks."""
    inside, outside = ([line.id for line in lines if line.id], [line.ood for line in lines if line.ood])
    return SightLine(
        name, "all", mean_difference(inside) if inside else None, mean_difference(outside) if outside else None
    )


def executed_lines(results: Sequence[Mapping[str, Any]]) -> list[TableLine]:
    """The table of stage 2 for plans that were carried out: whether they reached the goal. Tasks without moves have no
    line; the list is empty if nothing was carried out."""
    episodes = [_episode(plain, outcome["success"]) for plain, outcome in _executed(results) if outcome]
    return table(episodes) if episodes else []


@dataclass(frozen=True)
class Agreement:
    """Audits of plans next to their outcomes."""

    right: int
    """Number of plans that are right and were carried out."""
    right_reached: int
    """Number of them that reached the goal."""
    wrong: int
    """Number of plans that are wrong and were carried out."""
    wrong_reached: int
    """Number of them that still reached the goal."""
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


def by_question(results: Sequence[Mapping[str, Any]], known: Mapping[str, Mapping[str, Prior]]) -> list[QuestionLine]:
    """Grades of stage 1 by question."""
    counts: dict[tuple[str, str], Counter[str]] = {}
    for plain in results:
        if plain["stage"] == UNDERSTAND:
            for question, grade in plain["grades"].items():
                counts.setdefault((plain["task"], question), Counter())[grade] += 1
    return [
        QuestionLine(task, question, dict(found), prior.share if (prior := known[task].get(question)) else None)
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
    """Share of answers that are right in training and wrong in the OOD twin.

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
