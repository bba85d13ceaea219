"""Plans that are carried out: right ones reach the goal, wrong ones fail in the scene, and looks cannot be left out."""

import helpers
import pytest

from scengen import load_task
from scengen.agents import execution, facts
from scengen.agents.execution import CUT_OFF, DONE, NOT_BEGUN, Executions, execute
from scengen.agents.order import Order, Subgoal
from scengen.agents.runner import AgentSettings, run
from scengen.agents.tables import Agreement, agreement
from scengen.errors import BadConfig, UnknownName
from scengen.pool import Pool
from scengen.samplers.task_files import facts_file, tasks
from scengen.scenario import Scenario
from scengen.validate.rebuilt import world_of
from scengen.work.log import Log

MOVING = [name for name in tasks() if facts_file(name) and load_task(name).nominal.steps()]
"""Tasks that state moves for their sub-goals."""


def carried_out(task, text, index=0):
    found = load_task(task)
    scenario = found.draw("id", 0, index).scenario
    world = world_of(scenario, found.embodiment)
    outcome = execute(text.split(), facts.load(found).plan, scenario, world, found.horizon)
    assert outcome
    return outcome


def test_at_least_twenty_one_arm_tasks_state_moves():
    assert sum(load_task(name).embodiment.count("_") == 1 for name in MOVING) >= 20


@pytest.mark.parametrize("task", ["domino_single", "mirror_pick_place", "rod_across"])
def test_the_plan_of_the_file_reaches_the_goal(task):
    order = facts.load(load_task(task)).plan
    found = carried_out(task, " ".join(order.required))
    assert found.success and found.reason == "" and [name for name, _ in found.steps] == list(order.required)
    assert {end for _, end in found.steps} <= {DONE, CUT_OFF, NOT_BEGUN}


@pytest.mark.slow
@pytest.mark.parametrize("task", MOVING)
def test_the_plan_of_every_file_reaches_the_goal_with_and_without_what_is_optional(task):
    order = facts.load(load_task(task)).plan
    assert carried_out(task, " ".join(order.required)).success
    assert carried_out(task, " ".join(order.subgoals)).success


@pytest.mark.parametrize(
    ("task", "text", "says"),
    [
        ("domino_single", "tip_first reach_behind chain_falls", "tip_first: pushing with"),
        ("domino_single", "push_slab chain_falls", "slab"),
        ("mirror_pick_place", "find_frame go_where_shown come_down grasp lift", "everything came to rest"),
        ("mirror_pick_place", "find_frame grasp go_above come_down lift", "everything came to rest"),
        ("rod_across", "take_rod feel middle_on_ridge", "everything came to rest"),
    ],
)
def test_a_wrong_plan_fails_in_the_scene(task, text, says):
    found = carried_out(task, text)
    assert not found.success
    assert says in found.reason


@pytest.mark.parametrize(
    ("text", "says", "ends"),
    [
        ("go_above come_down", "go_above: no step before it has looked: the real place of the block is known", 0),
        ("find_frame push_to_middle lift", "push_to_middle: there is no move for it", 1),
        ("find_frame other lift", "other: there is no move for it", 1),
    ],
)
def test_a_step_that_cannot_be_carried_out_ends_the_plan_and_says_why(text, says, ends):
    found = carried_out("mirror_pick_place", text)
    assert not found.success and found.reason == says
    assert [end for _, end in found.steps][:ends] == [DONE] * ends
    assert found.steps[ends][1] == says.partition(": ")[2]
    assert all(end == NOT_BEGUN for _, end in found.steps[ends + 1 :])


def test_steps_that_may_be_repeated_go_on_until_a_round_has_nothing_left_to_do():
    rounds, order = [], Order({n: Subgoal(n, repeats=True, senses=n == "look") for n in ("take", "look")}, {})

    def take(world):
        if rounds.count("take") < 3:
            rounds.append("take")
            yield world.idle

    def look(world):
        rounds.append("look")
        yield world.idle

    world = world_of(load_task("domino_single").nominal)
    steps = execution.Steps(["take", "look"], order, {"take": take, "look": look})
    assert len(list(steps.plan(world))) == 3 + 4 and rounds.count("look") == 4
    assert steps.ends == [DONE, DONE]


@pytest.mark.parametrize("task", MOVING)
def test_moves_are_those_of_the_sheet(task):
    order, moves = facts.load(load_task(task)).plan, load_task(task).nominal.steps()
    assert set(order.moving) <= set(moves) <= set(order.vocabulary)


def test_a_move_of_no_sub_goal_and_a_sub_goal_without_a_move_are_told(monkeypatch):
    task = load_task("domino_single")
    moves = dict(task.nominal.steps())
    monkeypatch.setattr(task.family, "steps", lambda self: {**moves, "tip_frist": moves["tip_first"]})
    with pytest.raises(UnknownName, match=r"tip_frist.*tip_first"):
        facts.load(task)
    del moves["reach_behind"]
    monkeypatch.setattr(task.family, "steps", lambda self: moves)
    with pytest.raises(BadConfig, match="no move for reach_behind"):
        facts.load(task)


def test_the_same_plan_is_carried_out_once(tmp_path, monkeypatch):
    row = next(iter(Pool.open(str(helpers.REFERENCE)).rows(witness=False)))
    task = load_task(row.task)
    scenario, order, played = task.scenario(row.params), facts.load(task).plan, []
    monkeypatch.setattr(execution, "execute", lambda *given: played.append(given[0]))
    for _ in range(2):
        with Log(tmp_path / "e.jsonl", {}) as log:
            for names in (["tip_first"], ["tip_first"], ["chain_falls"]):
                assert Executions(log).of(row, scenario, names, order) is None
    assert played == [["tip_first"], ["chain_falls"]]


def test_outcomes_stand_beside_the_audit_and_a_repeated_run_has_the_same(tmp_path):
    def played(model, **changes):
        settings = AgentSettings(
            model=model,
            pool=str(helpers.REFERENCE),
            seeds=1,
            pictures=False,
            stage=2,
            to=str(tmp_path / model),
            **changes,
        )
        return run(settings, lambda *_: None).results

    right, wrong = played("facts"), played("wrong")
    assert agreement([*right, *wrong]) == Agreement(1, 1, 1, 0, ())
    assert right[-1]["grades"]["executed"]["steps"][-1][0] == "chain_falls"
    assert played("facts") == right
    assert agreement(played("facts", execute=False)) is None
    assert played("silent")[-1]["grades"]["executed"]["reason"] == execution.NO_PLAN


def test_a_task_without_moves_is_named_and_not_counted(monkeypatch, tmp_path):
    monkeypatch.setattr(load_task("domino_single").family, "steps", Scenario.steps)
    settings = AgentSettings(
        model="facts", pool=str(helpers.REFERENCE), seeds=1, pictures=False, stage=2, to=str(tmp_path)
    )
    assert agreement(run(settings, lambda *_: None).results) == Agreement(0, 0, 0, 0, ("domino_single",))
