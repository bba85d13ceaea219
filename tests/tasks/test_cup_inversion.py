"""The cup stands if it stands upright on the square; one arm cannot do it, nor can two without suction and pinch."""

import math
from dataclasses import replace

import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    parked,
    play_shortcut,
    solution,
    unchecked,
)

from scengen import load_task
from scengen.episode import OTHERWISE
from scengen.physics import GRAVITY
from scengen.tasks.cup_inversion import FALL_ANGLE, INVERTED_ANGLE, MAX_FALL_SPEED, UPRIGHT_TOLERANCE, CupInversion
from scengen.validate.rollout import AT_REST, replay

TASK = load_task("cup_inversion")
NOMINAL = CupInversion()
CUP = NOMINAL.cup
NO_ACCIDENT = "the cup neither fell nor touched the table askew"


def stood(world, tilt=0.0, off=(0.0, 0.0), up=0.0):
    """Put the cup on the square, tilted on the edge of its base [rad], beside its middle, and above the table [m]."""
    world.reset()
    free = world.data.joint("cup_free").qpos
    high = up + CUP.base * abs(math.sin(tilt)) + max(0.0, -CUP.height * math.cos(tilt))
    free[:3] = NOMINAL.goal + np.array([*off, high])
    free[3:] = [math.cos(tilt / 2), math.sin(tilt / 2), 0.0, 0.0]
    world.step(world.idle)
    return world


def changed(**cup):
    """The nominal scenario with another cup, whatever the constraints say."""
    return unchecked(CupInversion)(cup=replace(CUP, **cup))


@pytest.fixture(scope="module")
def world():
    """One world for tests that put the cup somewhere themselves; each resets it."""
    return load(TASK, NOMINAL)


@pytest.mark.parametrize(
    ("change", "counts"),
    [
        ({}, True),
        ({"off": (0.025, -0.025)}, True),
        ({"off": (0.030, 0.0)}, False),
        ({"off": (0.0, -0.030)}, False),
        ({"up": 0.01}, False),
        ({"tilt": UPRIGHT_TOLERANCE - 0.03}, True),
        ({"tilt": UPRIGHT_TOLERANCE + 0.03}, False),
        ({"tilt": math.pi}, False),
    ],
)
def test_what_counts_as_upright_on_the_square(world, change, counts):
    assert NOMINAL.success(stood(world, **change)) == counts


@pytest.mark.parametrize(
    ("tilt", "lost"), [(FALL_ANGLE - 0.1, False), (FALL_ANGLE + 0.1, True), (math.pi - 0.1, False)]
)
def test_a_cup_that_touches_the_table_askew_misses_a_mean(world, tilt, lost):
    assert missed(NOMINAL, stood(world, tilt=tilt), NO_ACCIDENT) == lost


@pytest.mark.parametrize(("share", "lost"), [(0.8, False), (1.6, True)])
def test_a_fall_costs_the_cup_from_the_height_of_a_textbook(world, share, lost):
    """v^2 = 2 g h. A fall is looked at every 10 ms, in which it gains 0.1 m/s: at 1.5 h it is seen for certain."""
    stood(world, up=share * MAX_FALL_SPEED**2 / (2 * GRAVITY))
    seen = set()
    for _ in range(30):
        world.step(world.idle)
        seen.add(missed(NOMINAL, world, NO_ACCIDENT))
    assert (True in seen) == lost


def test_upside_down_the_cup_stands_still(world):
    world.reset()
    start = world.pos("cup")
    for _ in range(50):
        world.step(world.idle)
    assert np.linalg.norm(world.pos("cup") - start) < 5e-4 and world.tilt("cup") > math.pi - 1e-3


# --- two arms -------------------------------------------------------------------------------


def test_both_arms_touch_the_cup_in_the_solution_and_never_each_other():
    rollout, world = solution(TASK, NOMINAL), load(TASK, NOMINAL)
    assert replay(NOMINAL, world, rollout.actions, TASK.horizon).solved
    assert world.touched("robot0", "cup") and world.touched("robot1", "cup")
    assert not world.touched("robot0", "robot1")


@pytest.mark.parametrize("arm", [0, 1])
def test_with_one_arm_parked_the_witness_fails(arm):
    rollout, world = parked(TASK, NOMINAL, arm)
    assert not rollout.solved and not world.touched(f"robot{arm}", "cup")


def test_ablations_fail_at_what_they_take_away():
    ends = ablated(TASK, NOMINAL)
    assert not any(rollout.solved for rollout, _ in ends.values())
    assert ends["no_base"][1].tilt("cup") > INVERTED_ANGLE
    assert ends["smooth_rim"][1].touched("robot1", "cup")


def test_from_a_state_in_the_middle_of_the_handover_the_witness_goes_on_bit_for_bit():
    actions, world = solution(TASK, NOMINAL).actions, load(TASK, NOMINAL)
    half = len(actions) // 2
    for action in actions[:half]:
        world.step_filtered(action)
    state = world.state()
    for action in actions[half : half + 100]:
        world.step_filtered(action)
    digest, again = world.digest, load(TASK, NOMINAL)
    again.restore(state)
    for action in actions[half : half + 100]:
        again.step_filtered(action)
    assert again.digest == digest


# --- laws that the constraints rely on --------------------------------------------------------


def test_a_push_topples_the_cup_if_its_rim_has_more_friction_than_its_radius_over_its_height():
    assert CUP.rim_friction < CUP.rim / CUP.height < 1.3
    for scenario, toppled in ((NOMINAL, False), (changed(rim_friction=1.3), True)):
        world = load(TASK, scenario)
        assert play_shortcut(TASK, scenario, "topple_it", world).reason == AT_REST
        assert missed(scenario, world, NO_ACCIDENT) == toppled == (world.tilt("cup") < INVERTED_ANGLE)


def test_two_hands_turn_a_cup_over_by_its_wall_if_that_has_more_friction_than_slope():
    assert CUP.friction < NOMINAL.slope < 0.4
    assert not play_shortcut(TASK, NOMINAL, "squeeze_and_roll").solved
    reason = play_shortcut(TASK, changed(friction=0.4), "squeeze_and_roll").reason
    assert reason.startswith(OTHERWISE) and "suction alone lifted the inverted cup" in reason


def test_every_constraint_refutes_what_violates_it():
    def of(**cup):
        return CupInversion(cup=replace(CUP, **cup))

    each_refuted_for_its_own_reason(
        [
            of(handle=0.04),
            CupInversion(x=0.38),
            CupInversion(goal_y=0.38),
            CupInversion(goal_x=-0.05, goal_y=-0.05),
            CupInversion(patch=replace(NOMINAL.patch, size=0.1)),
            of(base=0.040),
            of(rim_friction=0.6),
            of(friction=0.12),
            of(mass=0.12, friction=0.05),
            of(handle_friction=0.1),
            of(height=0.14, base=0.041, mass=0.13, bead=0.003, friction=0.074, handle_friction=1.5),
            CupInversion(x=0.34, y=0.34),
            CupInversion(goal_x=0.33, goal_y=-0.33),
        ]
    )


def test_cup_and_square_change_sides_on_one_axis_only():
    assert all(s.y < 0 < s.goal_y for s in (TASK.draw("id", 0, i).scenario for i in range(20)))
    assert all(s.goal_y < 0 < s.y for s in (TASK.draw("crossed", 0, i).scenario for i in range(20)))
