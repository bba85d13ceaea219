"""Planners that believe training: what they believe, and what it costs them."""

import pytest

from scengen import load_task
from scengen.errors import GaveUp
from scengen.ood import belief
from scengen.ood.behaviour import Trials
from scengen.params import values
from scengen.samplers.split import ID
from scengen.validate.rebuilt import world_of

TASK = load_task("domino_single")


def test_a_planner_believes_the_training_values_of_moved_parameters_and_sees_the_rest():
    trained, here = (TASK.draw(split, 0, 0).scenario for split in (ID, "squat_starter"))
    assert belief.beliefs(TASK, "squat_starter") == {"belief": frozenset(TASK.shifts("squat_starter"))}
    assert belief.believer(here, trained, frozenset(TASK.shifts("squat_starter"))) == trained
    partly = values(belief.believer(here, trained, frozenset({"starter.height"})))
    assert partly["starter.height"] == values(trained)["starter.height"]
    assert partly["starter.thickness"] == values(here)["starter.thickness"] != values(trained)["starter.thickness"]


def test_hidden_beliefs_are_those_about_hidden_parameters_alone():
    task = load_task("slip_recovery")
    found = belief.beliefs(task, "late_slip")
    assert found["hidden_belief"] and all(task.known[name].hidden for name in found["hidden_belief"])
    assert found["hidden_belief"] <= found["belief"] == frozenset(task.shifts("late_slip"))


def test_a_plan_that_contradicts_the_scene_ends_as_one_that_gave_up():
    class Confused:
        def oracle(self, world):
            yield world.idle
            raise KeyError("tile_7")

    plan = belief._plan(Confused(), world_of(TASK.draw(ID, 0, 0).scenario))
    next(plan)
    with pytest.raises(GaveUp, match="the scene contradicts the plan: KeyError: 'tile_7'"):
        next(plan)


@pytest.mark.slow
def test_a_low_first_tile_breaks_belief_and_light_tiles_do_not(tmp_path):
    """With a first tile that is lower than believed, the hand pushes over it; what a tile weighs no plan asks."""
    for axis, here in (("low_starter", 0), ("light_tiles", 4)):
        hidden, every = belief.measure_belief(TASK, axis, tmp_path / axis, Trials(4, belief_n=4))
        assert hidden.finding == "not tried", "domino_single hides nothing"
        assert every.record | {"training": 4, "here": here, "both": here, "twins": 4} == every.record
    assert belief.measure_belief(TASK, "low_starter", tmp_path / "low_starter", Trials(4, belief_n=4))[1].twins == 4


def test_a_finished_run_is_read_again_and_continued(tmp_path, monkeypatch):
    def played(task, split, seed, index):
        return {"index": index, "control": {"belief": True}, "here": {"belief": index > 2}, "reasons": {}}

    monkeypatch.setattr(belief, "_play_twin", played)
    counts = [belief.measure_belief(TASK, "diagonal", tmp_path, Trials(9, belief_n=n))[1].record for n in (4, 6, 4)]
    assert [(record["twins"], record["here"]) for record in counts] == [(4, 1), (6, 3), (4, 1)]
    assert len((tmp_path / "belief.jsonl").read_text().splitlines()) == 1 + 6
