"""Facts are answerable in every split, honest about what is hidden, and their names give nothing away."""

import re
from types import SimpleNamespace

import pytest
from sheets import STATED, drawn

from scengen import load_task
from scengen.agents import facts
from scengen.agents.facts import NOTHING, SIMPLEST_PLAN, Fact
from scengen.agents.replies import understanding_schema
from scengen.agents.scene import View, prompt, scene_text
from scengen.errors import BadConfig

SPLITS = [(name, split) for name in STATED for split in ("id", *load_task(name).axes)]


@pytest.mark.parametrize("name", STATED)
def test_a_task_states_six_facts_one_hidden_and_why_the_simplest_plan_fails(name):
    _, scenario, found = drawn(name, "id", 0)
    assert len(found) >= 6
    assert any(fact.hidden for fact in found)
    assert sum(fact.id == SIMPLEST_PLAN for fact in found) == 1
    assert len({fact.kind for fact in found}) >= 4
    shortcut = facts.load(load_task(name)).facts[SIMPLEST_PLAN].shortcut
    assert shortcut in scenario.shortcuts()


@pytest.mark.parametrize(("name", "split"), SPLITS)
def test_every_fact_has_an_answer_in_every_split(name, split):
    for index in range(2):
        _, _, found = drawn(name, split, index)
        for fact in found:
            right = list(fact.right) if isinstance(fact.right, tuple) else fact.right
            assert fact.holds(right) == (not fact.hidden), fact.id


@pytest.mark.parametrize("name", STATED)
def test_questions_do_not_depend_on_the_scenario(name):
    def asked(split, index):
        return [(fact.id, fact.kind, fact.question) for fact in drawn(name, split, index)[2]]

    first = asked("id", 0)
    assert all(asked(split, 1) == first for split in ("id", *load_task(name).axes))


@pytest.mark.parametrize("name", STATED)
def test_the_order_has_no_circle_and_needs_nothing_that_may_be_left_out(name):
    order = facts.load(load_task(name)).plan
    assert not any((b, a) in order.before for a, b in order.before) and order.before
    positions = {name: k for k, name in enumerate(order.subgoals)}
    assert all(positions[a] < positions[b] for a, b in order.before), "the file lists a right order"
    given = {c: name for name, s in order.subgoals.items() for c in s.gives if not s.optional}
    for subgoal in order.subgoals.values():
        every = {c for s in order.subgoals.values() for c in s.gives}
        assert all(c in given for c in subgoal.needs if c in every)
    assert len(order.required) >= 3 and len(order.wrong) >= 2 and not order.wrong.keys() & order.subgoals.keys()


@pytest.mark.parametrize(("name", "split"), SPLITS)
def test_prompts_name_no_scenario_split_axis_parameter_or_body(name, split):
    task = load_task(name)
    sheet, scenario, found = drawn(name, split, 0)
    row = SimpleNamespace(embodiment=task.embodiment, horizon=task.horizon)
    scene = scene_text(task.instruction, row, sheet, View({}, ()))
    text = prompt("understand", scene=scene, facts=found, faults=[])
    text += prompt("plan", vocabulary=sheet.plan.vocabulary, conditions=sheet.plan.conditions)
    telling = {scenario.id, name, task.code, *(axis for axis in task.axes if "_" in axis)}
    telling |= {body for body in sheet.names if "_" in body or "/" in body}
    telling |= {parameter for parameter in task.known if "_" in parameter or "." in parameter}
    assert not [word for word in telling if re.search(rf"(?<!\w){re.escape(word)}(?!\w)", text)]


def test_a_number_is_right_within_its_error_and_a_claim_about_hidden_state_never():
    number = Fact("n", "objects", "?", (), 3.0, unit="m", within=0.5)
    assert number.holds(3.5) and number.holds(3) and not number.holds(3.6) and not number.holds(True)
    options = Fact("o", "contacts", "?", ("a", "b", "c"), ("a", "b"), many=True)
    assert options.holds(["b", "a"]) and not options.holds(["a"]) and not options.holds(["a", "b", "c"])
    assert not options.holds(["a", "a"]) and not options.holds("a") and not options.holds(1.0)
    assert not Fact("h", "hidden state", "?", ("a",), None).holds(["a"])


def test_the_recorded_reason_of_the_shortcut_is_the_answer():
    asked = facts.Question("pull", "infeasibility", ["too heavy"], shortcut="pull_it", stuck="it is stuck")
    sheet = facts.Sheet(facts={SIMPLEST_PLAN: asked})

    def right(outcome, reason):
        numbers = {"pull_it": {"filtered": {"outcome": outcome, "reason": reason}}}
        return sheet._fact(SIMPLEST_PLAN, asked, {}, numbers)

    assert right("failure", "it fell").right == ("it fell",)
    assert right("timeout", "everything came to rest").right == ("it is stuck",)
    assert set(right("failure", "it fell").options) == {"it fell", "it is stuck", "too heavy", NOTHING}
    with pytest.raises(facts.UnknownName, match="pull_it"):
        sheet._fact(SIMPLEST_PLAN, asked, {}, {})


def test_a_task_without_facts_is_one_line_that_names_those_that_have_some(monkeypatch):
    monkeypatch.setattr(facts, "facts_file", lambda name, search=(): None)
    with pytest.raises(BadConfig, match=r"packing states no facts yet; add conf/facts/packing\.yaml"):
        facts.load(load_task("packing"))


@pytest.mark.parametrize("name", STATED)
def test_the_schema_lists_every_question_and_option(name):
    _, _, found = drawn(name, "id", 0)
    text = str(understanding_schema(found, ["a frame"]))
    assert all(fact.id in text and all(repr(option) in text for option in fact.options) for fact in found)
