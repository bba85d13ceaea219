"""A plate stands in the slot if it stands there, it takes both arms to put it there, and dropping it breaks it."""

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
    parked,
    play_shortcut,
    solution,
    unchecked,
)

from scengen import load_task
from scengen.assets.prop import TABLE_TOP
from scengen.geometry import UP, rotation
from scengen.params import values, with_values
from scengen.tasks.plate_and_slot import (
    ALONG_TOLERANCE,
    ANGLE_TOLERANCE,
    FLOOR_TOLERANCE,
    MAX_FALL_SPEED,
    PlateAndSlot,
)
from scengen.tasks.plate_shelf import PlateShelf
from scengen.validate.rollout import replay, run

TASK = load_task("plate_shelf_hetbi")
NOMINAL = PlateShelf()
JAW_LOWERS, FALL = "a jaw alone lowered the plate in the slot", "the plate did not fall"
AT_EDGE = "the plate stayed away from the table's edge"


def anyhow(scenario, name):
    """Play a shortcut under the rules of the paper: the goal counts however it is reached."""
    return run(scenario, load(TASK, scenario), scenario.shortcuts()[name].plan, TASK.horizon, rules="paper")


def standing(world, scenario, along=0.0, up=0.0, lean=0.0, yaw=0.0):
    """Put the plate on edge into the slot, its middle in the middle, changed by some lengths [m] and angles [rad]."""
    about_z, about_y = rotation(math.radians(scenario.shelf_yaw) * UP + yaw * UP), rotation(np.array([0, lean, 0]))
    rot = about_z @ about_y @ rotation(np.array([0, math.pi / 2, 0]))
    middle = scenario.foot + (scenario.shelf.base + scenario.plate.radius + up) * UP + along * about_z[:, 1]
    free, quat = world.data.joint("plate_free").qpos, np.empty(4)
    mujoco.mju_mat2Quat(quat, rot.ravel())
    free[:3], free[3:] = middle - scenario.plate.height / 2 * rot[:, 2], quat
    world.step(world.idle)
    return world


def open_ended(scenario):
    """The scenario, its slot without walls at the ends."""
    family = type("OpenEnded", (PlateShelf,), {"shelf": PlateAndSlot.shelf})
    return with_values(family(), values(scenario))


@pytest.fixture(scope="module")
def world():
    """One world for tests that put the plate somewhere themselves; each resets it."""
    return load(TASK, NOMINAL)


@pytest.mark.parametrize(
    ("change", "counts"),
    [
        ({}, True),
        ({"up": FLOOR_TOLERANCE - 0.002}, True),
        ({"up": FLOOR_TOLERANCE + 0.002}, False),
        ({"lean": 0.07}, True),
        ({"up": 0.1, "lean": math.pi / 2}, False),
    ],
)
def test_what_counts_as_in_the_slot(world, change, counts):
    world.reset()
    assert NOMINAL.success(standing(world, NOMINAL, **change)) == counts


@pytest.mark.parametrize(("along", "counts"), [(ALONG_TOLERANCE - 0.003, True), (ALONG_TOLERANCE + 0.003, False)])
def test_how_far_along_an_open_slot_it_counts(along, counts):
    open_slot = open_ended(NOMINAL)
    assert open_slot.success(standing(load(TASK, open_slot), open_slot, along=along)) == counts


def test_a_plate_that_leans_or_is_askew_by_more_than_ten_degrees_does_not_count(world):
    for angle, counts in ((ANGLE_TOLERANCE - 0.02, True), (ANGLE_TOLERANCE + 0.02, False)):
        for which in ("lean", "yaw"):
            world.reset()
            assert NOMINAL.on_edge(standing(world, NOMINAL, up=0.3, **{which: angle})) == counts


@pytest.mark.parametrize(("share", "breaks"), [(0.8, False), (1.7, True)])
def test_a_fall_breaks_the_plate_from_the_height_of_a_textbook(world, share, breaks):
    """v^2 = 2 g h. A fall is looked at every 10 ms, in which it gains 0.1 m/s: at 1.7 h it is seen for certain."""
    world.reset()
    height, broken = MAX_FALL_SPEED**2 / (2 * 9.81), False
    standing(world, NOMINAL, up=share * height)
    for _ in range(30):
        world.step(world.idle)
        broken = broken or missed(NOMINAL, world, FALL)
    assert broken == breaks


# --- two arms -------------------------------------------------------------------------------


def test_both_arms_touch_the_plate_in_the_solution_and_never_each_other():
    rollout, world = solution(TASK, NOMINAL), load(TASK, NOMINAL)
    assert replay(NOMINAL, world, rollout.actions, TASK.horizon).solved
    assert world.touched("robot0", "plate") and world.touched("robot1", "plate")
    assert not world.touched("robot0", "robot1") and not world.touched("robot0", "shelf")


@pytest.mark.parametrize("arm", [0, 1])
def test_with_one_arm_parked_the_witness_fails(arm):
    rollout, world = parked(TASK, NOMINAL, arm)
    assert not rollout.solved and not world.touched(f"robot{arm}", "plate")


def test_ablations_fail_at_what_they_take_away():
    ends = ablated(TASK, NOMINAL)
    assert not any(rollout.solved for rollout, _ in ends.values())
    assert not ends["holed_plate"][1].touched("robot1", "plate")


def test_a_cup_on_the_lip_does_alone_between_low_dividers_what_it_cannot_between_high_ones():
    scenario = TASK.draw("id", 0, 1).scenario
    # The cup on the lip slips off the glaze as it turns. Between low dividers 34 mm apart the plate leans too far.
    rough = {**values(scenario), "plate.friction": 0.6, "gap": 0.032}
    low, high = (with_values(unchecked(PlateShelf)(), {**rough, "proud": proud}) for proud in (0.065, 0.0))
    alone = anyhow(low, "cup_on_the_lip")
    assert alone.solved and JAW_LOWERS in alone.lacks and FALL not in alone.lacks
    end = play_shortcut(TASK, high, "cup_on_the_lip")
    assert end.outcome == "failure" and FALL in end.reason


# --- one hand alone -------------------------------------------------------------------------


def test_at_an_open_end_the_cup_alone_stands_the_plate_in_the_slot():
    """What the walls at the ends are for."""
    scenario = TASK.draw("id", 0, 2).scenario
    alone = anyhow(open_ended(scenario), "cup_at_an_end")
    assert alone.solved and JAW_LOWERS in alone.lacks
    assert not anyhow(scenario, "cup_at_an_end").solved


def test_one_jaw_takes_a_rough_plate_with_a_high_lip_and_no_other():
    """The law of the constraint: at a friction of 0.6 the pads hold a lip at 20 mm that is 57 deg askew to them."""
    scenario = TASK.draw("id", 0, 2).scenario
    rough = {**values(scenario), "plate.friction": 0.6, "plate.rise": 0.020, "gap": 0.046}
    held = with_values(unchecked(PlateShelf)(), rough)
    assert held.flat_tilt < 2 * math.atan(0.6) and scenario.flat_tilt > 2 * math.atan(scenario.plate.friction)
    alone = anyhow(held, "jaw_takes_it_flat")
    assert alone.solved and "suction alone lifted the plate" in alone.lacks
    world = load(TASK, scenario)
    assert not play_shortcut(TASK, scenario, "jaw_takes_it_flat", world).solved
    assert world.touched("robot1", "plate") and world.touching("plate", "table")


def test_beside_the_table_the_jaw_finds_room_where_the_plate_must_not_go():
    alone = anyhow(NOMINAL, "jaw_slides_it_to_the_edge")
    assert alone.solved and AT_EDGE in alone.lacks
    end = play_shortcut(TASK, NOMINAL, "jaw_slides_it_to_the_edge")
    assert end.outcome == "failure" and AT_EDGE in end.reason


# --- what must hold -------------------------------------------------------------------------


def test_every_constraint_refutes_what_violates_it():
    plate = NOMINAL.plate
    each_refuted_for_its_own_reason(
        [
            PlateShelf(plate_y=-0.23),
            PlateShelf(plate=replace(plate, friction=0.7)),
            PlateShelf(plate=replace(plate, friction=0.5)),
            PlateShelf(shelf_y=0.3, shelf_x=0.3, shelf_yaw=-30.0, gap=0.09),
            PlateShelf(plate_x=-0.05),
            PlateShelf(plate=replace(plate, foot=0.028)),
            PlateShelf(plate=replace(plate, rise=0.018), gap=0.020),
            PlateShelf(gap=0.027),
            PlateShelf(proud=0.05),
            PlateShelf(plate=replace(plate, mass=0.9)),
            PlateShelf(plate_x=0.2, plate_y=0.224, shelf_x=-0.1, shelf_y=-0.1),
            PlateShelf(shelf_x=0.3, shelf_y=-0.2),
        ]
    )


def test_the_plate_stands_on_the_cups_side_in_training():
    """Only the axis `across` puts it on the other one."""
    assert all(TASK.draw("id", 0, i).scenario.plate_y < 0 for i in range(20))
    assert all(TASK.draw("across", 0, i).scenario.plate_y > 0 for i in range(20))
    assert NOMINAL.start[2] == TABLE_TOP
