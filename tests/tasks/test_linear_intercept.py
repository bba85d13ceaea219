"""A rolling ball keeps its velocity, or loses it by the law; it is caught where it will be, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    play,
    play_shortcut,
    replayed,
)

from scengen import load_task
from scengen.assets.ball import Ball
from scengen.predicates import displaced
from scengen.sim.arm import IDLE
from scengen.tasks.launched_ball import ARRIVAL_TIME
from scengen.tasks.linear_intercept import NEAR_DISTANCE, LinearIntercept
from scengen.validate.rollout import run

TASK = load_task("linear_intercept")
CATCH = TASK.draw("id", 0, 0).scenario
SLANTED = LinearIntercept(x=0.15, y=0.32, heading=245.0, speed=0.13)
"""Towards the middle of the table, slowly."""
WAITED, CAUGHT = "the hand waited for the ball", "the jaw closed as the ball arrived"


def path(scenario, seconds):
    """Place [m] and velocity [m/s] of the ball in every period, without actions."""
    world, places, velocities = load(TASK, scenario), [], []
    for _ in range(round(seconds * 100)):
        with world.events():
            scenario.events(world)
        world.step(IDLE)
        places.append(world.com("ball"))
        velocities.append(world.velocity("ball"))
    return np.array(places), np.array(velocities)


# --- the laws of the task -----------------------------------------------------------------


@pytest.mark.parametrize("heading", [0.0, 255.0])
def test_it_lies_still_then_rolls_straight_on_at_constant_velocity(heading):
    """Within 1 % of its speed, without slipping, from the period on in which it is launched."""
    ball = replace(CATCH, heading=heading, x=-0.2, y=0.2, launch=0.5)
    places, velocities = path(ball, 2.5)
    assert np.abs(places[49] - ball.start).max() < 1e-4
    expected = ball.start + np.outer(np.arange(1, 201) / 100, ball.speed * ball.u)
    assert np.abs(places[50:] - expected).max() < 0.01 * ball.speed * 2.0 + 1e-3
    assert velocities[-1, 3:5] == pytest.approx(ball.speed * ball.u[:2], rel=0.01, abs=1e-3)
    spin = np.cross(velocities[-1, :3], [0.0, 0.0, ball.ball.radius])[:2]
    assert spin == pytest.approx(velocities[-1, 3:5], rel=0.02, abs=1e-3)


@pytest.mark.parametrize("rolling", [0.0015, 0.004])
def test_felt_slows_it_by_five_sevenths_of_its_share_of_gravity(rolling):
    """a = 5/7 c g: the resisting torque c m g r brakes 7/5 of the mass."""
    ball = replace(CATCH, rolling=rolling, launch=0.5)
    _, velocities = path(ball, 2.5)
    speeds = np.linalg.norm(velocities[:, 3:5], axis=1)
    assert speeds[70] - speeds[220] == pytest.approx(1.5 * 5 / 7 * rolling * 9.81, rel=0.05)
    assert ball.deceleration == pytest.approx(5 / 7 * rolling * 9.81)


@pytest.mark.parametrize(("late", "caught"), [(-0.30, False), (-0.03, True), (0.0, True), (0.03, True), (0.30, False)])
def test_fingers_must_close_when_it_is_there(late, caught):
    """By how much [s]; it takes the ball a tenth of a second to cross the pads."""
    scenario = replace(CATCH, speed=0.15)
    assert play(TASK, scenario, lambda world: scenario.take(world, scenario.closing_time - late)).solved == caught


# --- what must not work -------------------------------------------------------------------


@pytest.mark.parametrize("name", ["go_to_where_it_is", "allow_for_the_way_alone", "follow_it"])
def test_where_it_is_now_is_too_late(name):
    assert play_shortcut(TASK, CATCH, name).reason == "the ball rolled off the table"


def test_a_slower_ball_can_be_followed_which_is_not_how_it_is_to_be_caught():
    """A hand that follows it lags by its speed over 9.2 / s, less than half a pad."""
    slow = replace(SLANTED, speed=0.08)
    followed = play_shortcut(TASK, slow, "follow_it")
    assert followed.outcome == "failure" and WAITED in followed.reason
    free = run(slow, load(TASK, slow), slow.shortcuts()["follow_it"].plan, TASK.horizon, rules="paper")
    assert free.solved and WAITED in free.lacks


@pytest.mark.parametrize(("aside", "caught"), [(0.0, True), (0.015, True), (0.045, False)])
def test_a_hand_may_correct_its_place_by_25_millimetres_while_the_ball_is_near(aside, caught):
    """It waits along the path before or behind the place where it then catches the ball."""

    def late(world):
        yield from SLANTED.observe(world)
        at, _ = SLANTED.meeting(world.com("ball"), world.velocity("ball")[3:], world.arm.hand, 1.0, spare=0.2)
        near = lambda: displaced(world, "ball", at) < NEAR_DISTANCE - 0.05  # noqa: E731
        yield from SLANTED.wait_at(world, at + aside * SLANTED.u, SLANTED.u, near)
        yield from SLANTED.wait_at(
            world, at, SLANTED.u, lambda: SLANTED.time_left(world, world.arm.hand) <= SLANTED.closing_time
        )
        yield from SLANTED.catch(world)

    ended = play(TASK, SLANTED, late)
    assert ended.solved == caught and (WAITED in ended.lacks) != caught


@pytest.mark.parametrize("caught", [True, False])
def test_the_first_touch_must_become_the_catch(caught):
    world = load(TASK, CATCH)
    with world.events():
        world.memory["first_touch"], world.memory["caught"] = 0.01, float(caught)
    while world.time < ARRIVAL_TIME:
        assert not missed(CATCH, world, CAUGHT)
        world.step(IDLE)
    world.step(IDLE), world.step(IDLE)
    assert missed(CATCH, world, CAUGHT) != caught


def test_without_its_way_the_witness_closes_on_nothing():
    ((ended, world),) = ablated(TASK, CATCH).values()
    assert not ended.solved and world.touched("ball", "bar") and not world.touched("robot", "ball")


@pytest.mark.parametrize("axis", ["away", "fast", "other_edge"])
def test_a_memorised_catch_is_lost_out_of_distribution(axis):
    """One of five may come through the same place at the same time."""
    twins = [TASK.draw(axis, 0, i).scenario for i in range(5)]
    assert sum(replayed(TASK, CATCH, twin).solved for twin in twins) <= 1


# --- scenes that must not be certified ---------------------------------------------------


def test_what_is_refuted_is_refuted_for_reasons_of_its_own():
    each_refuted_for_its_own_reason(
        [
            LinearIntercept(heading=90.0),
            LinearIntercept(rolling=0.004),
            LinearIntercept(ball=Ball(radius=0.035, density=1200.0)),
        ]
    )
