"""A box lies in the slot if it lies there, only a cup on its broad face puts it there, and a fall breaks it."""

import itertools
import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    play_shortcut,
    solution,
)

from scengen import load_task
from scengen.episode import OTHERWISE
from scengen.geometry import UP, about_z, axes
from scengen.robots import suction
from scengen.robots.suction import CUP_HALF_WIDTH, TORQUE
from scengen.tasks.cracker_box import FLAT_TOLERANCE, HEIGHT_TOLERANCE
from scengen.tasks.cracker_box_suction import MAX_FALL_SPEED, SEAT_TOLERANCE, CrackerBoxSuction

TASK = load_task("cracker_box_suction")
NOMINAL = CrackerBoxSuction()
BOX = NOMINAL.box
NO_FALL = "the box did not fall"


def put(world, scenario, off=(0.0, 0.0, 0.0), lean=0.0, standing=False):
    """Put the box into the slot, changed by an offset in the slot's axes [m] and a lean [rad], or upright."""
    slot = about_z(math.radians(scenario.slot_yaw))
    rot = slot if standing else slot @ axes(math.cos(lean) * UP + math.sin(lean) * np.eye(3)[0], np.eye(3)[1])
    middle = scenario.seat + slot @ off + (scenario.box.size[2] - scenario.box.size[0]) / 2 * UP * standing
    free, quat = world.data.joint("box_free").qpos, np.empty(4)
    mujoco.mju_mat2Quat(quat, rot.ravel())
    free[:3], free[3:] = middle - scenario.box.size[2] / 2 * rot[:, 2], quat
    world.step(world.idle)
    return world


@pytest.fixture(scope="module")
def world():
    """One world for tests that put the box somewhere themselves; each resets it."""
    return load(TASK, NOMINAL)


@pytest.mark.parametrize(
    ("change", "counts"),
    [
        ({}, True),
        ({"off": (NOMINAL.clearance - 0.0005, 0.0, 0.0)}, True),
        ({"off": (0.0, 0.0, HEIGHT_TOLERANCE + 0.001)}, False),
        ({"off": (0.0, 0.0, NOMINAL.slot.depth)}, False),
        ({"standing": True}, False),
    ],
)
def test_what_counts_as_in_the_slot(world, change, counts):
    world.reset()
    assert NOMINAL.success(put(world, NOMINAL, **change)) == counts


def test_a_box_on_the_floor_of_a_wide_slot_must_lie_in_its_middle():
    wide = replace(NOMINAL, clearance=0.01)
    world = load(TASK, wide)
    for off, counts in ((SEAT_TOLERANCE - 0.0005, True), (SEAT_TOLERANCE + 0.0005, False)):
        world.reset()
        assert wide.success(put(world, wide, (off, 0.0, 0.0))) == counts


def test_a_box_that_leans_does_not_count(world):
    for lean, flat in ((FLAT_TOLERANCE - 0.01, True), (FLAT_TOLERANCE + 0.01, False)):
        world.reset()
        put(world, NOMINAL, (0.0, 0.0, 0.2), lean)
        assert (abs(world.rot("box")[2, 0]) > math.cos(FLAT_TOLERANCE)) == flat


@pytest.mark.parametrize(("share", "breaks"), [(0.8, False), (2.2, True)])
def test_a_fall_breaks_the_crackers_from_the_height_of_a_textbook(world, share, breaks):
    """v^2 = 2 g h. A fall is looked at every 10 ms, in which it gains 0.1 m/s: at 2.2 h it is seen for certain."""
    world.reset()
    height, broken = MAX_FALL_SPEED**2 / (2 * 9.81), False
    put(world, NOMINAL, (0.0, 0.0, share * height))
    for _ in range(30):
        world.step(world.idle)
        broken = broken or missed(NOMINAL, world, NO_FALL)
    assert broken == breaks


def test_a_box_that_turns_sinks_as_fast_as_its_fastest_corner(world):
    world.reset()
    put(world, NOMINAL, (0.0, 0.0, 0.2), lean=0.4)
    spin, rot = np.array([0.9, -0.7, 0.5]), world.rot("box")
    dof = int(world.model.joint("box_free").dofadr[0])
    world.data.qvel[dof + 3 : dof + 6] = rot.T @ spin
    mujoco.mj_forward(world.model, world.data)
    levers = [rot @ (BOX.size * sign / 2) for sign in itertools.product((-1, 1), repeat=3)]
    speeds = [world.velocity("box")[3:] + np.cross(spin, lever) for lever in levers]
    assert NOMINAL.fall_speed(world) == pytest.approx(-min(speed[2] for speed in speeds))


@pytest.mark.parametrize("scale", [0.75, 0.85, 1.0, 1.05])
def test_a_cup_on_a_side_face_meets_the_slots_wall_while_the_box_has_a_centimetre_to_fall(scale):
    """The lip ends at the face's edge at most; below it are half the lip and the bellows."""
    scenario = replace(NOMINAL, box=replace(BOX, scale=scale))
    (bellows,) = (
        geom.size[0] for geom in mujoco.MjSpec.from_string(suction.xml()).geoms if geom.name == "hand_collision_2"
    )
    lowest = scenario.box.size[0] - CUP_HALF_WIDTH - bellows
    assert scenario.slot.depth - lowest > 0.01


# --- the means --------------------------------------------------------------------------------


def test_a_box_that_is_let_drop_lies_in_the_slot_and_lacks_means():
    """The slot guides it. It fell, and the cup that let go of it over the slot did not lay it down."""
    end = play_shortcut(TASK, NOMINAL, "let_it_drop")
    assert end.reason.startswith(OTHERWISE) and NO_FALL in end.reason
    assert "the cup on a broad face laid the box down" in end.reason
    assert "the cup still pulled when the box was down" in end.reason


def test_a_box_taken_by_its_top_stands_in_the_slot():
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, "upright_into_the_slot", world).solved
    assert world.touching("box", "slot") and world.tilt("box") < 0.01


def test_only_a_box_that_lies_turned_from_the_slot_is_laid_across_its_walls():
    straight, turned = replace(NOMINAL, slot_yaw=3.0), replace(NOMINAL, slot_yaw=10.0)
    assert "as_it_comes" not in straight.shortcuts()
    world = load(TASK, turned)
    assert not play_shortcut(TASK, turned, "as_it_comes", world).solved
    assert (world.com("box") - turned.seat)[2] > 0.9 * turned.slot.depth


def test_ablations_fail_at_what_they_take_away():
    ends = ablated(TASK, NOMINAL)
    assert not any(rollout.solved for rollout, _ in ends.values())
    assert ends["short_slot"][1].touched("box", "slot") and not ends["slippery_box"][1].touched("box", "slot")


def test_the_cup_never_meets_the_slot_and_the_box_is_pushed_by_less_than_a_thumb():
    world, start = load(TASK, NOMINAL), NOMINAL.start
    for action in solution(TASK, NOMINAL).actions:
        world.step_filtered(action)
        if world.arm.sealed:
            break
    assert np.linalg.norm(world.pos("box") - start) < 0.02 and world.tilt("box") < math.radians(1.0)
    assert not world.touched("robot", "slot")


# --- what must hold -----------------------------------------------------------------------------


def test_every_constraint_refutes_what_violates_it():
    each_refuted_for_its_own_reason(
        [
            replace(NOMINAL, box_x=-0.39, box_y=0.39),
            replace(NOMINAL, slot_x=0.35),
            replace(NOMINAL, box_x=0.05, box_y=0.0),
            replace(NOMINAL, box=replace(BOX, friction=0.30)),
            replace(NOMINAL, box=replace(BOX, friction=0.13)),
            replace(NOMINAL, box=replace(BOX, scale=1.1)),
            replace(NOMINAL, box_x=0.31, box_y=0.34, slot_x=-0.05, slot_y=-0.1),
            replace(NOMINAL, slot_x=0.3, slot_y=-0.25),
        ]
    )


def test_the_largest_box_that_is_carried_by_its_side_is_that_of_the_law():
    """Weight times half the thickness grows with the fourth power of the size."""
    torque = 9.81 * BOX.mass * BOX.size[0] / 2
    largest = (TORQUE / 1.5 / torque) ** 0.25
    for scale, carried in ((largest - 0.01, True), (largest + 0.01, False)):
        assert (replace(NOMINAL, box=replace(BOX, scale=scale)).infeasible() is None) == carried
