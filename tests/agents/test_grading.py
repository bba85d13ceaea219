"""Plans written by hand are graded as a person grades them: right orders pass, and each kind of error is named."""

import pytest
from sheets import STATED

from scengen import load_task
from scengen.agents import facts
from scengen.agents.grading import grade_plan, grade_understanding
from scengen.agents.replies import Audit, Claim, Planned, Step, Understanding, Unknown, Why

RIGHT = {
    "domino_single": [
        "reach_behind tip_first chain_falls",
        "close_jaw reach_behind tip_first step_back chain_falls",
        "reach_behind close_jaw tip_first chain_falls step_back",
    ],
    "edge_slide": [
        "reach_inner_side slide_out reach_lip pinch lift",
        "reach_inner_side slide_out leave_plate reach_lip pinch lift",
    ],
    "mass_sort": [
        "weigh_left weigh_middle weigh_right place_lightest place_middle place_heaviest",
        "weigh_right weigh_left weigh_middle place_heaviest place_lightest place_middle",
        "weigh_middle weigh_right weigh_left place_middle place_heaviest place_lightest",
    ],
    "mirror_pick_place": ["find_frame go_above come_down grasp lift"],
    "seesaw_balance": [
        "take_weight put_on_arm look correct level",
        "take_weight put_on_arm look correct look correct look level",
    ],
}
"""Right plans by task."""
WRONG = {
    "domino_single": {
        "tip_first chain_falls": "missing",
        "tip_first reach_behind chain_falls": "wrong order",
        "reach_behind tip_first tip_first chain_falls": "additional",
        "reach_behind tip_first chain_falls push_slab": "affordance",
        "push_slab": "affordance",
    },
    "edge_slide": {
        "reach_lip pinch lift": "missing",
        "close_from_above lift": "affordance",
        "reach_inner_side slide_out pinch reach_lip lift": "wrong order",
        "reach_inner_side slide_out reach_lip pinch lift other": "additional",
    },
    "mass_sort": {
        "weigh_left weigh_middle place_lightest place_middle place_heaviest": "missing",
        "weigh_left weigh_middle place_lightest weigh_right place_middle place_heaviest": "wrong order",
        "place_lightest place_middle place_heaviest": "missing",
    },
    "mirror_pick_place": {
        "go_above come_down grasp lift": "missing",
        "find_frame go_where_shown come_down grasp lift": "affordance",
        "go_above find_frame come_down grasp lift": "wrong order",
    },
    "seesaw_balance": {
        "take_weight put_on_arm level": "missing",
        "take_weight put_on_arm correct look level": "wrong order",
        "take_weight put_on_arm look correct level hold_level": "affordance",
    },
}
"""Wrong plans by task, and the kind of error that a person sees first."""


def planned(names, objects=()):
    steps = [Step(name, "something else" if name == "other" else name, list(objects), [], [], "x") for name in names]
    return Planned(Why("x", "so"), steps, Audit(True, True, True))


def grade(task, text, objects=()):
    sheet = facts.load(load_task(task))
    return grade_plan(planned(text.split(), objects), sheet.plan, sheet.objects)


@pytest.mark.parametrize(("task", "text"), [(task, text) for task, texts in RIGHT.items() for text in texts])
def test_every_right_order_passes(task, text):
    found = grade(task, text)
    assert found.right, found.errors
    assert all(found.audits.values())


@pytest.mark.parametrize(
    ("task", "text", "kind"), [(task, text, kind) for task, texts in WRONG.items() for text, kind in texts.items()]
)
def test_each_wrong_plan_is_refused_with_its_kind_of_error(task, text, kind):
    found = grade(task, text)
    assert not found.right and kind in {each for each, _ in found.errors}


@pytest.mark.parametrize("task", STATED)
def test_the_plan_of_the_file_is_right_and_a_plan_without_any_step_of_it_is_not(task):
    order = facts.load(load_task(task)).plan
    assert grade(task, " ".join(order.subgoals)).right and grade(task, " ".join(order.required)).right
    for left_out in order.required:
        assert not grade(task, " ".join(name for name in order.required if name != left_out)).right


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
