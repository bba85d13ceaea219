"""Grades of stage 1 and stage 2, by code alone."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from .facts import Fact
from .order import Order
from .replies import OTHER, Planned, Understanding

Grade = Literal["right", "wrong", "forbidden", "missing", "format"]
"""Grade of one answer: `forbidden` claims to know what cannot be seen; `format` belongs to a reply without a form."""
PlanError = Literal["hallucinated object", "affordance", "missing", "additional", "wrong order"]
"""Kind of error in a plan, as in the Embodied Agent Interface (arXiv:2410.07166)."""


def grade_understanding(artefact: Understanding | None, facts: Sequence[Fact]) -> dict[str, Grade]:
    """Grade of each answer, by question.

    Args:
        artefact: the artefact; None if no reply followed the schema.
        facts: the facts of the scenario.
    """
    if artefact is None:
        return {fact.id: "format" for fact in facts}
    claims = {claim.fact: claim.answer for claim in artefact.semantic}
    unknown = {each.fact for each in artefact.unknown}
    return {fact.id: _grade(fact, claims, unknown) for fact in facts}


def _grade(fact: Fact, claims: Mapping[str, float | list[str]], unknown: set[str]) -> Grade:
    if fact.hidden:
        return "right" if fact.id in unknown else "forbidden" if fact.id in claims else "missing"
    if fact.id in claims:
        return "right" if fact.holds(claims[fact.id]) else "wrong"
    return "wrong" if fact.id in unknown else "missing"


ALWAYS = frozenset({"table", "robot", "arm", "hand", "gripper", "jaw", "fingers", "finger", "suction cup", "camera"})
"""Objects that are in every scene."""


@dataclass(frozen=True)
class PlanGrade:
    """Grade of a plan."""

    errors: tuple[tuple[PlanError, str], ...]
    """Errors: kind, and what it is about."""
    conditions: float
    """Share of the steps that name all conditions which the sub-goal needs and gives; not part of `right`."""
    sensing: frozenset[str] = frozenset()
    """Sub-goals of the task that bring information."""

    @property
    def right(self) -> bool:
        """Whether the plan is a linear extension of the partial order, with nothing required missing."""
        return not self.errors

    @property
    def audits(self) -> dict[str, bool]:
        """Audits F1 to F3 (paper, App. F), made by code instead of the model."""
        kinds = {kind for kind, _ in self.errors}
        dropped = any(
            kind in ("missing", "wrong order") and self.sensing & {*what.split()} for kind, what in self.errors
        )
        return {
            "F1 no missing prerequisite": "missing" not in kinds,
            "F2 no invalid order": "wrong order" not in kinds,
            "F3 no dropped probing step": not dropped,
        }


def grade_plan(plan: Planned, order: Order, objects: Sequence[str]) -> PlanGrade:
    """Grade a plan: right if it is some linear extension of the partial order.

    Args:
        plan: the plan.
        order: sub-goals of the task and their partial order.
        objects: neutral names of the things in the scene.
    """
    names = [step.subgoal for step in plan.steps]
    errors: list[tuple[PlanError, str]] = []
    told = " ".join([*objects, *order.vocabulary.values()]).lower()
    for name in (name for step in plan.steps for name in step.objects if not _exists(name, told)):
        errors.append(("hallucinated object", name))
    for name in (name for name in names if name in order.wrong):
        errors.append(("affordance", name))
    for name in (name for name in order.required if name not in names):
        errors.append(("missing", name))
    for position, name in enumerate(names):
        again = name in names[:position] and not (name in order.subgoals and order.subgoals[name].again)
        if name == OTHER or (again and name not in order.wrong):
            errors.append(("additional", plan.steps[position].outcome if name == OTHER else name))
    for one, other in _misplaced(names, order):
        errors.append(("wrong order", f"{one} before {other}"))
    return PlanGrade(tuple(errors), _conditions(plan, order), order.sensing)


def decided(grades: Mapping[str, Any], executed: Mapping[str, Any] | None) -> dict[str, Any]:
    """Grades of a plan that was carried out. One that reaches the goal is right in any order: what the partial
    order says against it is a remark then. Other errors count as before.

    Args:
        grades: grades of stage 2.
        executed: outcome of the plan; None if it was not carried out.
    """
    if not executed or not executed["success"] or any(kind != "wrong order" for kind, _ in grades["errors"]):
        return {**grades, "executed": executed}
    return {**grades, "right": True, "errors": [], "remarks": grades["errors"], "executed": executed}


def _exists(name: str, told: str) -> bool:
    """Whether an object is in every scene, or named in a text: those of the sheet, in small letters."""
    plain = name.strip().lower().removeprefix("the ")
    return plain in ALWAYS or (bool(plain) and re.search(rf"\b{re.escape(plain)}\b", told) is not None)


def _misplaced(names: Sequence[str], order: Order) -> list[tuple[str, str]]:
    """Pairs of sub-goals of a plan, of which the first one comes before the second one and must not.

    The plan is gone through with the conditions that its steps give. A look that comes too early reveals nothing; it is
    an error only if the plan does not look again in time. What may be repeated may not follow what ends it.
    """
    givers = {c: name for name, subgoal in order.subgoals.items() if name in names for c in subgoal.gives}
    found, given, early = dict[tuple[str, str], None](), set[str](), dict[str, str]()
    for name in (name for name in names if name in order.subgoals):
        subgoal = order.subgoals[name]
        lacking = [givers[c] for c in subgoal.needs if c in givers and c not in given]
        if lacking and subgoal.senses:
            early[name] = lacking[0]
            continue
        for giver in lacking:
            found[(giver, early[giver]) if giver in early else (name, giver)] = None
        given.update(subgoal.gives)
        early.pop(name, None)
    found |= dict.fromkeys((name, giver) for name, giver in early.items() if name in order.required)
    for one, other in order.before:
        round_, end = order.subgoals[one], order.subgoals[other]
        if one in names and other in names and round_.repeats and not (round_.senses or end.again):
            if len(names) - 1 - names[::-1].index(one) > names.index(other) and (other, one) not in found:
                found[other, one] = None
    return sorted(found)


def _conditions(plan: Planned, order: Order) -> float:
    """Share of the known steps that name the conditions before and after them."""
    known = [step for step in plan.steps if step.subgoal in order.subgoals]
    good = [
        set(order.subgoals[s.subgoal].needs) <= set(s.before) and set(order.subgoals[s.subgoal].gives) <= set(s.after)
        for s in known
    ]
    return sum(good) / len(good) if good else 0.0
