"""The tier of feedback plans finds what a look at the ball and a steady hand find; its macros are data and replay."""

from dataclasses import replace

import numpy as np
import pytest
from hand import otherwise

from scengen.attack.adversary import Attack
from scengen.attack.player import Player
from scengen.attack.retries import retries
from scengen.attack.servo import SERVO, moving, must_touch, servo
from scengen.compose import load_task
from scengen.sim.world import World
from scengen.validate.rebuilt import rebuild
from scengen.validate.rollout import replay, run


def player_of(name, change=lambda scenario: scenario):
    """A player on the first training draw of a task, with the oracle's actions as its witness."""
    task = load_task(name)
    scenario = change(task.draw("id", 11, 0).scenario)
    text = rebuild(scenario)
    found = run(scenario, World.load(text, task.embodiment), scenario.oracle, task.horizon)
    assert found.solved, found.reason
    return Player(scenario, text, task.embodiment, task.horizon, found.actions)


def slow(scenario):
    """The ball rolls so slowly that a hand can follow it, and no rule asks the hand to wait for it."""
    return otherwise(replace(scenario, speed=0.12))


@pytest.fixture(scope="module")
def rolling():
    return player_of("linear_intercept", slow)


def test_a_slow_ball_is_pursued_and_grasped(rolling):
    result = Attack(rolling, seed=0).run(24, (SERVO,))
    found = [hit for hit in result.hits if str(hit.plan).startswith("pursue ball")]
    assert found, "a stiff pursuit of where the ball is grasps it"
    assert result.rates[0].rollouts > 0 and {rate.tier for rate in result.rates} == {SERVO}


def test_attempts_are_data_and_give_the_same_bits(rolling):
    attempt = next(servo(rolling))
    one, other = (rolling.play(attempt.macros, raw=False) for _ in range(2))
    assert one.digest == other.digest and np.array_equal(one.actions, other.actions)


def test_only_bodies_that_move_by_themselves_are_chased(rolling):
    assert moving(rolling) == {"ball"}
    still = player_of("tool_retrieve")
    assert not moving(still) and not [a for a in servo(still) if a.macros[0].kind in ("pursue", "pin", "block")]


def test_what_the_goal_asks_a_body_to_touch_is_touched_first():
    player = player_of("ramp_sort")
    assert player.latches >= {(f"ball_{i}", "ramp") for i in range(4)} and must_touch(player, "ball_0") == ("ramp",)
    ways = [[(macro.kind, len(macro.numbers)) for macro in attempt.macros] for attempt in servo(player)]
    place, straight = ([("pick", 4), ("touch", count), ("bring", 7)] * 4 for count in (3, 0))
    assert place in ways and straight in ways


@pytest.mark.slow
def test_where_the_goal_asks_for_no_touch_none_is_made():
    player = player_of("mass_sort")
    assert not any(must_touch(player, body) for body in player.trace.handled)
    assert not [a for a in servo(player) if "touch" in [macro.kind for macro in a.macros]]


def test_a_body_is_carried_along_its_way_with_the_narrow_side_of_the_hand_across():
    closed = load_task("gap_funnel").draw("id", 11, 0).scenario
    player = player_of("gap_funnel", otherwise)
    attempt = next(one for one in servo(player) if one.macros[-1].kind == "along")
    played = player.play(attempt.macros, raw=False)
    assert played.solved
    world = World.load(player.scene_xml, player.embodiment)
    assert "behind the wall" in replay(closed, world, played.actions, player.horizon, until_settled=True).reason


def test_each_kind_of_plan_for_one_arm_is_played_where_there_are_two():
    player = player_of("plate_shelf_hobi")
    first = {attempt.macros[-1].kind: attempt for attempt in reversed(list(servo(player)))}
    assert {"along", "bring", "move"} <= first.keys()
    for attempt in first.values():
        assert player.play(attempt.macros, raw=False).actions.shape[1] == 14


def test_a_suction_cup_carries_a_body_to_where_the_witness_leaves_it():
    player = player_of("cracker_box_suction")
    attempts = list(servo(player))
    assert {macro.kind for attempt in attempts for macro in attempt.macros} == {"pick", "along", "bring", "touch"} - (
        set() if must_touch(player, "box") else {"touch"}
    )
    attempt = next(one for one in attempts if [macro.kind for macro in one.macros] == ["pick", "bring"])
    player.play(attempt.macros, raw=False)
    start, goal, there = player.start_place("box"), player.goal_place("box"), player.world.com("box")
    assert np.linalg.norm((there - goal)[:2]) < 0.3 * np.linalg.norm((start - goal)[:2])


def test_a_hinged_body_that_swings_is_met_and_stopped():
    player = player_of("pendulum_grasp")
    kinds = {macro.kind for attempt in servo(player) for macro in attempt.macros if macro.target == "pendulum/bob"}
    assert kinds == {"meet", "stop", "pursue", "pin", "block"}


def test_a_body_is_put_down_on_a_face_from_each_of_its_ends():
    first = {
        attempt.macros[1].numbers[:2]
        for attempt in retries(player_of("shape_stack"))
        if [macro.kind for macro in attempt.macros] == ["pick", "place", "wait"] * 5
    }
    assert first == {(0.0, 0.9), (0.9, 0.0), (-0.9, 0.0), (0.0, -0.9)}
