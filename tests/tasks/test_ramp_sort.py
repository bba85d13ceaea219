"""The side of the ridge decides, nothing undoes it, the barrier stops the hand alone, and balls must use the ramp."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    mistaken,
    not_certified,
    play_shortcut,
    replayed,
    solution,
    unguarded,
)

from scengen import load_task
from scengen.assets.crowned_ramp import CrownedRamp
from scengen.assets.prop import TABLE_TOP
from scengen.geometry import UP
from scengen.sim.arm import ROBOT
from scengen.tasks.ramp_sort import BARRIER_START, BIN_FLOOR, RampSort

TASK = load_task("ramp_sort")
NOMINAL = RampSort(reds=1, blues=1)
"""The smallest sorting there is, which takes half as long."""
BY_ITSELF = "each ball came over the lower half of the ramp by itself"


def put(world, i, along, across, scenario, height=0.0):
    """Put a ball on the ground at a place in the ramp's axes [m]."""
    lying = (BIN_FLOOR + scenario.ball.radius + height) * UP
    world.data.joint(f"ball_{i}_free").qpos[:3] = scenario.at(along, across) + lying
    mujoco.mj_kinematics(world.model, world.data)
    mujoco.mj_comPos(world.model, world.data)


# --- what decides -------------------------------------------------------------------------


def test_the_smallest_scene_is_solved_and_every_ball_used_the_ramp():
    assert solution(TASK, NOMINAL).solved


def test_without_the_ramp_or_with_the_bins_exchanged_the_same_motion_fails():
    ends = ablated(TASK, NOMINAL)
    assert ends["no_ramp"][0].reason == "a ball is on the table or on the floor"
    assert ends["bins_exchanged"][0].reason == "a ball is in the bin of the other colour"


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("colours_exchanged", "a ball is in the bin of the other colour"),
        ("through_the_barrier", BY_ITSELF),
    ],
)
def test_a_wrong_ball_ends_the_episode_and_balls_that_are_carried_do_not_count(name, reason):
    rollout = play_shortcut(TASK, NOMINAL, name)
    assert rollout.outcome == "failure" and reason in rollout.reason


def test_the_barrier_stops_the_hand():
    w = load(TASK, NOMINAL)
    play_shortcut(TASK, unguarded(RampSort)(reds=1, blues=1), "by_hand_into_the_bin", w)
    assert w.touched(ROBOT, "barrier") and not w.touched("ball_0", "barrier")


@pytest.mark.parametrize("changed", [{"red_side": 1}, {"ramp": CrownedRamp(ridge=0.055)}, {"arrangement": 1}])
def test_a_memorised_motion_serves_neither_other_sides_nor_another_ridge_nor_another_row(changed):
    assert not replayed(TASK, NOMINAL, replace(NOMINAL, **changed)).solved


def test_balls_are_let_go_on_their_side_of_the_ridge_outside_the_uncertain_band():
    for split in ("id", "shifted_ridge", "flat_crown", "steep"):
        for index in range(5):
            s = TASK.draw(split, 0, index).scenario
            for side in (1, -1):
                _, across, _ = (s.release_spot(side) - s.middle) @ s.axes
                assert side * (across - s.ramp.ridge) > s.band


def test_all_ways_to_lay_two_and_two_balls_in_a_row_are_there_once():
    rows = {RampSort(arrangement=k).colours for k in range(6)}
    assert len(rows) == 6 and all(sum(row) == 2 for row in rows)


# --- goal and failures -------------------------------------------------------------------


@pytest.mark.parametrize(("red_at", "blue_at", "success"), [(-1, 1, True), (-1, 0, False), (0, 1, False)])
def test_every_ball_must_be_in_its_bin(red_at, blue_at, success):
    w = load(TASK, NOMINAL)
    for i, side in enumerate((red_at, blue_at)):
        if side:
            put(w, i, NOMINAL._bins_along, side * 0.05, NOMINAL)
    assert NOMINAL.success(w) == success


def test_failures_and_means_name_what_went_wrong():
    w = load(TASK, NOMINAL)
    assert NOMINAL.failure(w) is None
    state = w.state()
    put(w, 0, NOMINAL._bins_along, 0.05, NOMINAL)
    assert NOMINAL.failure(w) == "a ball is in the bin of the other colour"
    w.restore(state)
    put(w, 0, NOMINAL._bins_along, -0.05, NOMINAL)
    assert NOMINAL.failure(w) is None and missed(NOMINAL, w, BY_ITSELF)
    w.loop.touched[w.body("ball_0"), w.body("ramp")] = w.loop.touched[w.body("ramp"), w.body("ball_0")] = True
    assert NOMINAL.failure(w) is None and not missed(NOMINAL, w, BY_ITSELF)
    w.restore(state)
    put(w, 1, 0.0, 0.0, NOMINAL, height=-0.1)
    assert NOMINAL.failure(w) == "a ball is on the table or on the floor"


@pytest.mark.parametrize(("height", "high"), [(0.02, False), (0.08, True)])
def test_past_the_start_of_the_barrier_a_ball_stays_low(height, high):
    w = load(TASK, NOMINAL)
    for along, beyond in ((BARRIER_START + 0.01, high), (BARRIER_START - 0.01, False)):
        surface = NOMINAL.ramp.surface(along, 0.06)[2]
        put(w, 0, along, 0.06, NOMINAL, height=surface + height - BIN_FLOOR - NOMINAL.ball.radius)
        assert NOMINAL.high_over_ramp(w, 0) == beyond == missed(NOMINAL, w, BY_ITSELF)


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Colourless(RampSort):
    """Any bin will do."""

    reds: int = 1
    blues: int = 1

    def success(self, world):
        return all(self.arrived(world, i) for i in range(2))

    def failure(self, world):
        return None

    def means(self):
        return {}


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (RampSort(reds=1, blues=1, arrangement=5), "feasible", "fewer arrangements"),
        (mistaken(RampSort, "colours_exchanged")(reds=1, blues=1), "solved", "the oracle failed"),
        (Colourless(), "shortcuts", "reaches the goal"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, RampSort) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            RampSort(red_side=0),
            RampSort(arrangement=6),
            RampSort(ramp=CrownedRamp(friction=0.05)),
            RampSort(ramp=CrownedRamp(ridge=0.08, lean=10.0, width=0.18)),
            RampSort(ramp=CrownedRamp(length=0.10)),
            RampSort(ramp=CrownedRamp(low=0.03)),
            RampSort(ramp=CrownedRamp(pitch=25.0)),
            RampSort(x=0.3),
            RampSort(box_y=-0.2),
        ]
    )


def test_the_barrier_is_below_the_hand_as_it_is_after_a_reset():
    for split in TASK.axes:
        s = TASK.draw(split, 0, 0).scenario
        w = load(TASK, s)
        assert w.arm.hand[2] - 0.0092 > TABLE_TOP + s.barrier.height, split
        assert not np.isin(w.data.contact.geom, [w.model.geom("barrier/block").id]).any()
