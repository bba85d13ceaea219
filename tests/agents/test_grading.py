"""Plans written by hand are graded as a person grades them: right orders pass, and each kind of error is named."""

from typing import get_args

import pytest
from plans_by_hand import ALL_RIGHT, ALL_WRONG, RIGHT, WRONG
from sheets import STATED

from scengen import load_task
from scengen.agents import facts
from scengen.agents.grading import PlanError, decided, grade_plan, grade_understanding
from scengen.agents.replies import OTHER, Audit, Claim, Planned, Step, Understanding, Unknown, Why

MAX_REFUSED = 0.03
"""Largest share of plans that are right in a person's eyes and may be refused."""


def graded(task, steps):
    sheet = facts.load(load_task(task))
    assert {name for name, _ in steps} <= {*sheet.plan.vocabulary, OTHER}
    told = [Step(name, "something else" if name == OTHER else name, objects, [], [], "x") for name, objects in steps]
    return grade_plan(Planned(Why("x", "so"), told, Audit(True, True, True)), sheet.plan, sheet.objects)


def grade(task, text, objects=()):
    return graded(task, [(name, list(objects)) for name in text.split()])


def test_plans_written_by_hand_are_at_least_120_for_12_tasks():
    assert len(RIGHT) == len(WRONG) == 12 and len(ALL_RIGHT) + len(ALL_WRONG) >= 120
    assert {kind for kinds in WRONG.values() for kind in kinds} == set(get_args(PlanError))


def test_plans_that_are_right_in_a_persons_eyes_pass():
    refused = [(task, steps) for task, steps in ALL_RIGHT if not graded(task, steps).right]
    assert len(refused) <= MAX_REFUSED * len(ALL_RIGHT), refused


@pytest.mark.parametrize(("task", "steps", "kind"), ALL_WRONG)
def test_no_wrong_plan_passes_and_its_kind_of_error_is_named(task, steps, kind):
    found = graded(task, steps)
    assert not found.right and kind in {each for each, _ in found.errors}, found.errors


@pytest.mark.parametrize(("task", "steps"), ALL_RIGHT)
def test_a_right_plan_has_all_audits(task, steps):
    assert all(graded(task, steps).audits.values())


def test_a_look_too_early_is_no_error_if_the_plan_looks_again_in_time():
    assert grade("seesaw_balance", "look take_weight put_on_arm look correct level").right
    found = grade("seesaw_balance", "look take_weight put_on_arm correct look level")
    assert ("wrong order", "look before put_on_arm") in found.errors and not found.audits["F3 no dropped probing step"]


@pytest.mark.parametrize("task", STATED)
def test_the_plan_of_the_file_is_right_and_a_plan_without_any_step_of_it_is_not(task):
    order = facts.load(load_task(task)).plan
    assert grade(task, " ".join(order.subgoals)).right and grade(task, " ".join(order.required)).right
    for left_out in order.required:
        assert not grade(task, " ".join(name for name in order.required if name != left_out)).right


def test_a_plan_that_reaches_the_goal_is_not_wrong_for_its_order():
    misplaced, left_out = [["wrong order", "a before b"]], [["wrong order", "a before b"], ["missing", "c"]]
    reached, missed = {"success": True}, {"success": False}
    for errors, executed, right, remarks in (
        (misplaced, reached, True, misplaced),
        (misplaced, missed, False, None),
        (misplaced, None, False, None),
        (left_out, reached, False, None),
    ):
        found = decided({"right": False, "errors": errors}, executed)
        assert (found["right"], found.get("remarks"), found["executed"]) == (right, remarks, executed)
        assert found["errors"] == ([] if right else errors)


def test_an_object_that_is_not_there_is_a_hallucination():
    text = "reach_behind tip_first chain_falls"
    assert grade("domino_single", text, ["red slab"]).right
    assert ("hallucinated object", "hammer") in grade("domino_single", text, ["hammer"]).errors


def test_a_dropped_weighing_fails_the_audit_of_probing():
    found = grade("mass_sort", "weigh_left weigh_middle place_lightest place_middle place_heaviest")
    assert not found.audits["F3 no dropped probing step"] and found.audits["F2 no invalid order"]


def test_a_claim_about_what_cannot_be_seen_is_forbidden_and_an_admission_is_right():
    seen = facts.Fact("n", "objects", "?", (), 3.0, within=0.1)
    unseen = facts.Fact("h", "hidden state", "?", ("a",), None)
    told = Understanding([], [Claim("h", ["a"], ["x"], 1)], [Unknown("n", "look")])
    assert grade_understanding(told, [seen, unseen]) == {"n": "wrong", "h": "forbidden"}
    told = Understanding([], [Claim("n", 3.05, ["x"], 1)], [Unknown("h", "lift it")])
    assert grade_understanding(told, [seen, unseen]) == {"n": "right", "h": "right"}
    assert grade_understanding(Understanding([], [], []), [seen, unseen]) == {"n": "missing", "h": "missing"}
    assert grade_understanding(None, [seen]) == {"n": "format"}
