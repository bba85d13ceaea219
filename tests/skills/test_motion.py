"""Moves end when the world says so, turn the wrist the nearer way, give up in time, and can be joined."""

import math
import re

import numpy as np
import pytest

from scengen.assets.box import Block, Domino
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.errors import GaveUp
from scengen.geometry import UP, about_z, heading
from scengen.predicates import held
from scengen.sim import scene_text
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.skills.jaw import carry, pick, poke, put
from scengen.skills.motion import (
    ANGLE_TOLERANCE,
    CLOSED,
    COARSE,
    FINE,
    OPEN,
    STEADY,
    WRIST_SPARE,
    Pace,
    alone,
    closing_along,
    facing,
    facing_down,
    go_to,
    hold,
    push,
    together,
    turn_about_vertical,
    turn_to,
    until,
    wait,
)

PLACE = np.array([0.05, 0.08, TABLE_TOP])


def world(box=None, yaw=0.0):
    """A robot at a table, with a box at `PLACE` if wanted."""
    scene = table()
    if box:
        place(scene, box, "box", PLACE, yaw)
    return World.load(scene_text.emit(scene)[0])


def play(w, plan):
    """Play a plan to its end; returns its actions."""
    actions = []
    for action in plan:
        actions.append(action)
        w.step(action)
    return actions


# --- one arm --------------------------------------------------------------------------------


@pytest.mark.parametrize("azimuth", [-70.0, -30.0, 0.0, 45.0, 80.0])
def test_a_hand_looks_where_it_is_told_and_gets_there_with_joints_to_spare(azimuth):
    """From where it is after a reset, at 0.3 m above the table: every joint stays 0.3 rad from its ends."""
    w, rot = world(), facing(math.radians(azimuth), math.radians(60.0))
    assert rot[:, 2] == pytest.approx(0.5 * heading(azimuth) - math.sqrt(0.75) * UP)
    assert rot[2, 0] == 0.0 and np.linalg.det(rot) == pytest.approx(1.0)
    play(w, go_to(w.arm, [0.05, 0.0, TABLE_TOP + 0.3], rot))
    low, high = w.model.jnt_range[w.model.jnt_type == 3][:7].T
    assert np.minimum(w.arm.joint_pos - low, high - w.arm.joint_pos).min() > 0.3


@pytest.mark.parametrize("pace", [COARSE, STEADY, FINE], ids=["COARSE", "STEADY", "FINE"])
def test_a_pace_says_how_fast_the_hand_goes_and_how_near_it_must_come(pace):
    w = world()
    start, goal, times = w.arm.hand, w.arm.hand + 0.25 * heading(90.0), {}
    for action in go_to(w.arm, goal, pace=pace):
        w.step(action)
        times.setdefault(round(float((w.arm.hand - start)[1]), 2), w.time)
    assert np.linalg.norm(w.arm.hand - goal) < pace.within
    assert 0.10 / (times[0.15] - times[0.05]) == pytest.approx(pace.speed, rel=0.15)


def test_a_move_that_takes_too_long_gives_up_and_says_how_far_it_came():
    w = world()
    goal = w.arm.hand + 0.3 * heading(90.0)
    place = re.escape(", ".join(f"{value:.2f}" for value in goal))
    with pytest.raises(
        GaveUp, match=rf"the hand stayed 2\d\d mm and \d deg short of its target \({place}\) m for 0.3 s$"
    ):
        play(w, go_to(w.arm, goal, pace=Pace(0.25, 0.005, give_up=0.3)))
    assert w.time == pytest.approx(0.31, abs=0.011)
    with pytest.raises(GaveUp, match=r"pushing with \(0.00, 0.00, 0.10\) m/s for 0.2 s met no end condition$"):
        play(w, push(w.arm, 0.1 * UP, until=lambda: False, give_up=0.2))
    with pytest.raises(GaveUp, match="waiting for 0.2 s met no end condition$"):
        play(w, wait(w.arm, lambda: False, give_up=0.2))
    with pytest.raises(GaveUp, match="deg short"):
        play(w, turn_to(w.arm, facing_down(2.0), give_up=0.2))


def test_a_move_that_gives_up_names_what_the_hand_touches():
    w = world()
    with pytest.raises(GaveUp, match="for 2 s, touching table$"):
        play(w, go_to(w.arm, w.arm.hand - 0.6 * UP, facing_down(), Pace(0.3, 0.003, 2.0)))


def test_a_push_keeps_its_velocity_until_the_world_says_stop():
    w = world()
    low, start, started = w.arm.hand[2], w.arm.hand, w.time
    play(w, push(w.arm, 0.1 * UP, until=lambda: w.arm.hand[2] > low + 0.05))
    assert w.arm.hand[2] - low == pytest.approx(0.05, abs=0.002)
    assert w.time - started == pytest.approx(0.5, abs=0.1)
    assert np.linalg.norm((w.arm.hand - start)[:2]) < 0.002


@pytest.mark.parametrize("yaw", np.radians([-170.0, -100.0, -80.0, -30.0, 0.0, 45.0, 89.0, 91.0, 150.0]))
def test_the_fingers_close_along_the_direction_by_the_nearer_wrist_turn(yaw):
    w = world()
    along = about_z(yaw) @ [0.0, 1.0, 0.0]
    rot = closing_along(w.arm, along)
    assert abs(rot[:, 0] @ along) == pytest.approx(1.0) and rot[2, 2] == pytest.approx(-1.0)
    turn = math.atan2(rot[1, 0], rot[0, 0]) - math.atan2(w.arm.hand_rot[1, 0], w.arm.hand_rot[0, 0])
    assert abs(math.remainder(turn, 2 * math.pi)) <= math.pi / 2 + 1e-6


@pytest.mark.parametrize(("turned", "more"), [(-90.0, -80.0), (150.0, 80.0)])
def test_near_the_end_of_its_range_the_wrist_turns_the_longer_way(turned, more):
    """Joint 7 starts at 45 deg, turns against the hand, and ends at 166 deg to either side."""
    w = world()
    play(w, turn_about_vertical(w.arm, math.radians(turned)))
    low, high = w.arm.wrist_range
    along = about_z(math.radians(more)) @ w.arm.hand_rot[:, 0]
    play(w, turn_to(w.arm, closing_along(w.arm, along)))
    assert low + WRIST_SPARE < w.arm.joint_pos[6] < high - WRIST_SPARE
    assert abs(w.arm.hand_rot[:, 0] @ along) > math.cos(ANGLE_TOLERANCE)


def test_a_broken_off_plan_ends_at_once_and_a_plan_that_ends_earlier_ends_by_itself():
    w = world()
    assert len(play(w, until(hold(w.arm, 1.0), lambda: w.time > 0.295))) == 30
    assert len(play(w, until(hold(w.arm, 0.2), lambda: False))) == 20


# --- the jaw --------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw", [0.0, 0.4, 1.3])
def test_what_is_picked_hangs_in_the_jaw_alone(yaw):
    w = world(Block(), yaw)
    play(w, pick(w.arm, w.com("box"), closing=w.rot("box")[:, 1], lift=0.10))
    assert held(w, "box") and w.arm.grip == CLOSED
    assert w.com("box")[2] == pytest.approx(TABLE_TOP + 0.025 + 0.10, abs=0.025)


def test_what_is_carried_comes_to_the_pose_wherever_it_sits_in_the_jaw():
    """Held 10 mm beside its middle, and turned by 0.5 rad on the way."""
    w = world(Block())
    goal, rot, beside = np.array([0.0, -0.10, TABLE_TOP + 0.15]), about_z(0.5), np.array([0.010, 0.0, 0.005])
    play(w, pick(w.arm, w.com("box") + beside, closing=[0.0, 1.0, 0.0]))
    play(w, carry(w.arm, "box", goal, rot @ w.rot("box")))
    assert np.linalg.norm(w.com("box") - goal) < 0.006
    assert w.tilt("box") < 0.1 and w.rot("box")[1, 0] == pytest.approx(math.sin(0.5), abs=0.06)


def test_what_is_put_down_stands_where_it_was_to_be_and_the_jaw_is_open():
    w = world(Block())
    goal = np.array([-0.05, -0.10, TABLE_TOP + 0.025])
    play(w, pick(w.arm, w.com("box"), closing=[0.0, 1.0, 0.0]))
    play(w, put(w.arm, "box", goal, on="table"))
    play(w, hold(w.arm, 0.3))
    assert np.linalg.norm(w.com("box") - goal) < 0.005 and w.touching_bodies("box") == {"table"}
    assert w.arm.grip == OPEN


@pytest.mark.parametrize("direction", [0.0, 70.0, 180.0])
def test_a_poke_tips_a_tile_and_steps_back(direction):
    w, along = world(Domino(), math.radians(direction)), heading(direction)
    behind = PLACE + 0.06 * UP - 0.04 * along
    play(w, poke(w.arm, behind, 0.08 * along, lambda: w.tilt("box") > 0.3))
    assert w.touched(ROBOT, "box") and not w.touching(ROBOT, "box") and w.arm.grip == CLOSED
    assert abs(w.arm.hand_rot[:, 0] @ along) < 0.1
    play(w, hold(w.arm, 1.0))
    assert w.tilt("box") == pytest.approx(math.pi / 2, abs=0.02)
    assert (w.com("box") - PLACE) @ along > 0.03


# --- two arms -------------------------------------------------------------------------------


def row(value, grip):
    return np.array([value] * 6 + [grip])


def plan(value, grip, periods):
    for _ in range(periods):
        yield row(value, grip)


def pair():
    """A robot with two arms at a table."""
    return World.load(scene_text.emit(table())[0], "panda_jaw+panda_jaw")


def test_joined_plans_run_side_by_side_and_the_shorter_one_keeps_its_grip():
    w, sent = pair(), []
    for action in together(w, plan(0.1, CLOSED, 2), plan(0.2, OPEN, 4)):
        sent.append(action)
        w.step(action)
    right, left = np.array(sent)[:, :7], np.array(sent)[:, 7:]
    assert np.array_equal(right[:2], [row(0.1, CLOSED)] * 2) and np.array_equal(left, [row(0.2, OPEN)] * 4)
    assert (right[2:, 6] == CLOSED).all() and (np.abs(right[2:, :6]) < 0.1).all()


def test_arms_move_at_once_and_the_first_to_arrive_waits_where_it_is():
    w = pair()
    near, far = w.arms[0].hand + 0.03 * UP, w.arms[1].hand + np.array([0.1, 0.0, 0.1])
    play(w, together(w, go_to(w.arms[0], near), go_to(w.arms[1], far)))
    assert np.linalg.norm(w.arms[0].hand - near) < 0.008 and np.linalg.norm(w.arms[1].hand - far) < 0.008
    assert w.time < 1.0  # the longer way alone takes 0.8 s


def test_an_arm_without_a_plan_is_held_against_what_pushes_it():
    w = pair()
    start, end = w.arms[1].hand, w.arms[0].hand + np.array([0.0, 0.4, 0.0])
    play(w, until(alone(w.arms[0], go_to(w.arms[0], end)), lambda: w.touching("robot0", "robot1")))
    assert w.touched("robot0", "robot1")
    play(w, alone(w.arms[0], push(w.arms[0], [0.0, 0.05, 0.0], lambda: w.time > 3.0)))
    pushed = np.linalg.norm(w.arms[1].hand - start)
    play(w, alone(w.arms[0], go_to(w.arms[0], end - np.array([0.0, 0.3, 0.0]))))
    assert 0.005 < pushed < 0.1 and np.linalg.norm(w.arms[1].hand - start) < pushed


def test_plans_that_end_at_once_ask_for_nothing():
    w = pair()
    assert list(together(w, None, None)) == list(together(w, plan(0.1, OPEN, 0), None)) == []


def test_every_arm_needs_a_plan_or_none():
    with pytest.raises(ValueError, match="1 plans for 2 arms"):
        list(together(pair(), plan(0.1, OPEN, 2)))
