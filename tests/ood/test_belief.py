"""Planners that believe training: what they believe, and what it costs them."""

import pytest

from scengen import load_task
from scengen.errors import GaveUp
from scengen.ood import belief
from scengen.ood.behaviour import Trials
from scengen.params import values, with_values
from scengen.samplers.split import ID
from scengen.validate.rebuilt import world_of

TASK = load_task("domino_single")


def believed(task, split, index=0):
    trained, here = (task.draw(name, 0, index).scenario for name in (ID, split))
    return trained, here, belief.believed(task, split, here, trained)


def test_a_planner_believes_the_training_values_of_moved_parameters_and_sees_the_rest():
    trained, _, planners = believed(TASK, "squat_starter")
    assert planners["belief"] == trained, "a twin differs in what the axis moves"
    trained, here, planners = believed(load_task("slip_recovery"), "late_slip")
    assert planners["belief"] == trained != here


def test_hidden_beliefs_are_those_about_hidden_parameters_alone():
    task = load_task("slip_recovery")
    assert belief.moves_hidden(task, "late_slip") and not belief.moves_hidden(TASK, "squat_starter")
    assert "hidden_belief" not in believed(TASK, "squat_starter")[2]
    trained, here, planners = believed(task, "late_slip")
    known, seen = values(trained), values(here)
    for name, value in values(planners["hidden_belief"]).items():
        assert value == (known if task.known[name].hidden else seen)[name]


def test_the_nearest_belief_is_the_end_of_training_on_the_side_of_the_axis():
    thickness, height = (
        {"starter.thickness": 0.014},
        {"starter.height": 0.08},
    )  # the nominal height, constant in training
    _, here, planners = believed(TASK, "squat_starter")
    assert planners["nearest_belief"] == with_values(here, thickness | height)


def test_the_nearest_belief_goes_round_the_circle_and_within_training_it_is_right():
    task = load_task("seesaw_balance")
    axis = believed(task, "turned")
    for index in range(6):
        _, here, planners = believed(task, "turned", index)
        assert abs(planners["nearest_belief"].heading - here.heading) <= 34.0, "training ends at 98, -98, 82, -82"
    assert axis[2]["nearest_belief"] != axis[1]
    trained = task.draw(ID, 0, 0).scenario
    assert belief.believed(task, "turned", trained, trained)["nearest_belief"] == trained
    assert belief._nearest(task, "heading", -179.0) == -98.0 and belief._nearest(task, "heading", 179.0) == 98.0


def test_the_nearest_belief_of_a_whole_number_is_one():
    task = load_task("keyboard_typing")
    assert [belief._nearest(task, "word", word) for word in (3, 12, 23)] == [3, 11, 11]
    assert isinstance(belief._nearest(task, "word", 12), int)


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
        hidden, every, nearest = belief.measure_belief(TASK, axis, tmp_path / axis, Trials(4, belief_n=4))
        assert hidden.finding == "not tried", "domino_single hides nothing"
        for one in (every, nearest):
            assert one.record | {"training": 4, "here": here, "both": here, "twins": 4} == one.record
    assert belief.measure_belief(TASK, "low_starter", tmp_path / "low_starter", Trials(4, belief_n=4))[1].twins == 4


def test_a_finished_run_is_read_again_and_continued(tmp_path, monkeypatch):
    def played(task, split, seed, index):
        return {"index": index, "control": {"belief": True}, "here": {"belief": index > 2}, "reasons": {}}

    monkeypatch.setattr(belief, "_play_twin", played)
    counts = [belief.measure_belief(TASK, "diagonal", tmp_path, Trials(9, belief_n=n))[1].record for n in (4, 6, 4)]
    assert [(record["twins"], record["here"]) for record in counts] == [(4, 1), (6, 3), (4, 1)]
    assert len((tmp_path / "beliefs.jsonl").read_text().splitlines()) == 1 + 6
