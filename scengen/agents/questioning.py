"""Stages 1 and 2: questions about a scenario, and a plan for it, asked from a model and graded."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, TypeVar

from ..pool import PoolRow
from .calls import Calls
from .facts import Fact, Sheet
from .grading import PlanGrade, grade_plan, grade_understanding
from .models import Model, Turn
from .replies import (
    FormatError,
    Planned,
    Understanding,
    plan,
    plan_schema,
    understanding,
    understanding_schema,
    without_thoughts,
)
from .scene import View, prompt, scene_text

Artefact = TypeVar("Artefact")
"""Content of a reply of a stage."""
UNDERSTAND = 1
"""Number of the stage of understanding."""
PLAN = 2
"""Number of the stage of planning."""
ACT = 3
"""Number of the stage of acting."""
UNDERSTAND_ATTEMPTS = 3
"""Largest number of attempts at stage 1; the paper does not say how often it repeats the stage."""
EMPTY = Understanding([], [], [])
"""Artefact that says nothing."""
PLAN_ATTEMPTS = 6
"""Largest number of attempts at stage 2 (paper, App. F: "up to six times")."""


@dataclass(frozen=True)
class Exam:
    """One scenario with everything that its questions need."""

    row: PoolRow
    instruction: str
    """The instruction as the model is given it."""
    sheet: Sheet
    facts: tuple[Fact, ...]
    view: View
    temperature: float
    stand_in: Model | None
    """Stand-in that answers instead of the run's model; None for a real model."""
    perturbed: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Names of the perturbation and what it drew; none without one."""

    @property
    def about(self) -> dict[str, Any]:
        """Names for journal and results; no prompt contains them."""
        names = {"task": self.row.task, "split": self.row.split, "index": self.row.index, "scenario": self.row.id}
        return {**names, "temperature": self.temperature, **self.perturbed}

    @property
    def scene(self) -> str:
        """The part of all prompts that describes the scene."""
        return scene_text(self.instruction, self.row, self.sheet, self.view)

    @property
    def system(self) -> Turn:
        return Turn("system", prompt("system"))

    @property
    def frames(self) -> tuple[bytes, ...]:
        """All pictures, oldest first."""
        return tuple(self.view.frames.values())


@dataclass(frozen=True)
class Result:
    """Graded result of one stage."""

    about: Mapping[str, Any]
    """Scenario and temperature."""
    stage: int
    """Number of the stage."""
    attempts: int
    """Number of attempts; the best one is graded."""
    format_error: str
    """Fault of the form of the graded reply; empty if there is none."""
    grades: Mapping[str, Any]
    """Grades: by question in stage 1; errors, audits and conditions in stage 2; outcome of the episode in stage 3."""

    @property
    def outcomes(self) -> list[bool]:
        """Values that count in the table: one value for each question in stage 1, one for a plan or an episode."""
        if self.stage == UNDERSTAND:
            return [grade == "right" for grade in self.grades.values()]
        return [bool(self.grades["right"])]

    def plain(self) -> dict[str, Any]:
        """Plain data, as the file of results holds it."""
        return asdict(self)


def understand_turns(exam: Exam, faults: Sequence[str] = ()) -> list[Turn]:
    """The prompt of stage 1."""
    text = prompt("understand", scene=exam.scene, facts=exam.facts, faults=faults)
    return [exam.system, Turn("user", text, exam.frames)]


def understand(exam: Exam, calls: Calls) -> tuple[Understanding | None, Result]:
    """Ask stage 1 until the artefact has no faults that show without the answers, and grade the best attempt."""
    frames = list(exam.view.frames)
    schema = understanding_schema(exam.facts, frames)

    def ask(attempt: int, faults: Sequence[str]) -> tuple[Understanding, list[str]]:
        about = {**exam.about, "stage": UNDERSTAND, "attempt": attempt}
        reply = calls.ask(about, understand_turns(exam, faults), (), schema, exam.temperature, exam.stand_in)
        found = understanding(reply, exam.facts, calls.strict)
        return found, found.faults(exam.facts, frames)

    best, attempts, told = _best(ask, UNDERSTAND_ATTEMPTS)
    return best, Result(exam.about, UNDERSTAND, attempts, told, grade_understanding(best, exam.facts))


def _best(
    ask: Callable[[int, Sequence[str]], tuple[Artefact, list[str]]], most: int
) -> tuple[Artefact | None, int, str]:
    """Ask until an artefact has no faults that show without the answers.

    Args:
        ask: function of the number of the attempt and the faults of the last one, which returns an artefact and its
            faults, or raises `FormatError`.
        most: largest number of attempts.

    Returns:
        The artefact with the fewest faults, the number of attempts, and the last fault of form if there is no artefact.
    """
    best, fewest, wrong_form, faults, attempt = None, float("inf"), "", list[str](), 0
    while attempt < most:
        attempt += 1
        try:
            found, faults = ask(attempt, faults)
        except FormatError as error:
            faults, wrong_form = [str(error)], str(error)
            continue
        if len(faults) < fewest:
            best, fewest = found, len(faults)
        if not faults:
            break
    return best, attempt, "" if best else wrong_form


def plan_turns(exam: Exam, artefact: Understanding, faults: Sequence[str] = ()) -> list[Turn]:
    """The prompt of the free round of stage 2."""
    questions = {fact.id: fact.question for fact in exam.facts}
    slots = {"scene": exam.scene, "artefact": artefact, "questions": questions, "faults": faults}
    return [exam.system, Turn("user", prompt("plan_freely", **slots), exam.frames)]


def make_plan(exam: Exam, artefact: Understanding | None, calls: Calls) -> Result:
    """Ask stage 2: a free plan, then the same plan in the vocabulary; repeated while the plan has faults that show."""
    if artefact is None:
        return Result(exam.about, PLAN, 0, "stage 1 gave no artefact to bind the plan", _plan_grades(None))
    order = exam.sheet.plan
    vocabulary, conditions = order.vocabulary, order.conditions
    schema = plan_schema(vocabulary, exam.sheet.objects, conditions, [fact.id for fact in exam.facts])

    def ask(attempt: int, faults: Sequence[str]) -> tuple[Planned, list[str]]:
        about = {**exam.about, "stage": PLAN, "attempt": attempt}
        turns = plan_turns(exam, artefact, faults)
        free = calls.ask({**about, "step": "free"}, turns, (), None, exam.temperature, exam.stand_in)
        named = Turn("user", prompt("plan", vocabulary=vocabulary, conditions=conditions))
        turns = [*turns, Turn("assistant", free.text if calls.strict else without_thoughts(free.text)), named]
        reply = calls.ask({**about, "step": "named"}, turns, (), schema, exam.temperature, exam.stand_in)
        found = plan(reply, vocabulary, calls.strict)
        return found, found.faults(artefact)

    best, attempts, told = _best(ask, PLAN_ATTEMPTS)
    grade = grade_plan(best, order, exam.sheet.objects) if best else None
    return Result(exam.about, PLAN, attempts, told, _plan_grades(grade, best))


def _plan_grades(grade: PlanGrade | None, planned: Planned | None = None) -> dict[str, Any]:
    """Grades of a plan as plain data."""
    if grade is None or planned is None:
        return {"right": False, "errors": [], "audits": {}, "conditions": 0.0, "plan": []}
    return {
        "right": grade.right,
        "errors": [list(error) for error in grade.errors],
        "audits": grade.audits,
        "conditions": grade.conditions,
        "plan": [step.subgoal for step in planned.steps],
    }
