"""A bowl stands if it stands upright in the square, it takes both arms to put it there, and no accident counts."""

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
from scengen.assets.bowl import Bowl
from scengen.episode import OTHERWISE
from scengen.geometry import UP, about_y
from scengen.robots.jaw import OPENING
from scengen.tasks.bowl_table import FALL_ANGLE, MAX_FALL_SPEED, RIM_CLEARANCE, UPRIGHT_TOLERANCE, BowlTable
from scengen.validate.rollout import replay

TASK = load_task("bowl_table")
NOMINAL = BowlTable()
NO_ACCIDENT = "the bowl neither fell nor touched anything askew"


@pytest.fixture(scope="module")
def world():
    """One world for tests that put the bowl somewhere themselves; each resets it."""
    return load(TASK, NOMINAL)


def standing(world, tilt=0.0, aside=0.0, up=0.0):
    """Put the bowl on the square, its lowest point on the table, changed by an angle [rad] and lengths [m]."""
    world.reset()
    free, quat = world.data.joint("bowl_free").qpos, np.empty(4)
    rot = about_y(tilt)
    mujoco.mju_mat2Quat(quat, rot.ravel())
    free[:3], free[3:] = NOMINAL.goal + aside * np.array([1.0, 0.0, 0.0]) + 0.3 * UP, quat
    mujoco.mj_forward(world.model, world.data)
    low = min(lowest(world, geom) for geom in range(world.model.ngeom) if on_bowl(world, geom))
    free[2] -= low - NOMINAL.goal[2] - up
    world.step(world.idle)
    return world


def on_bowl(world, geom):
    return world.model.geom_bodyid[geom] == world.body("bowl")


def lowest(world, geom):
    """Height of a geom's lowest point [m]; the bowl has meshes and spheres."""
    model, data = world.model, world.data
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE:
        return data.geom_xpos[geom][2] - model.geom_size[geom][0]
    mesh = model.geom_dataid[geom]
    points = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    return data.geom_xpos[geom][2] + float((points @ data.geom_xmat[geom].reshape(3, 3)[2]).min())


def room():
    return NOMINAL.patch.size / 2 - NOMINAL.bowl.foot


@pytest.mark.parametrize(
    ("change", "counts"),
    [
        ({}, True),
        ({"aside": room() - 0.002}, True),
        ({"aside": room() + 0.002}, False),
        ({"tilt": UPRIGHT_TOLERANCE - 0.03}, True),
        ({"tilt": UPRIGHT_TOLERANCE + 0.03}, False),
        ({"tilt": math.pi}, False),
        ({"up": 0.01}, False),
    ],
)
def test_what_counts_as_standing(world, change, counts):
    assert NOMINAL.success(standing(world, **change)) == counts


@pytest.mark.parametrize(("tilt", "lost"), [(FALL_ANGLE - 0.05, False), (FALL_ANGLE + 0.05, True), (math.pi, True)])
def test_nothing_but_hands_touches_a_bowl_that_leans(world, tilt, lost):
    assert missed(NOMINAL, standing(world, tilt), NO_ACCIDENT) == lost


def test_the_bowl_in_its_rack_is_no_accident(world):
    world.reset()
    for _ in range(20):
        world.step(world.idle)
    assert world.touching("bowl", "rack") and world.tilt("bowl") > math.pi - 0.01
    assert not missed(NOMINAL, world, NO_ACCIDENT) and not NOMINAL.success(world)


@pytest.mark.parametrize(("share", "breaks"), [(0.8, False), (1.7, True)])
def test_a_fall_breaks_the_bowl_from_the_height_of_a_textbook(world, share, breaks):
    """v^2 = 2 g h. A fall is looked at every 10 ms, in which it gains 0.1 m/s: at 1.7 h it is seen for certain."""
    standing(world, up=share * MAX_FALL_SPEED**2 / (2 * 9.81))
    broken = False
    for _ in range(30):
        world.step(world.idle)
        broken = broken or missed(NOMINAL, world, NO_ACCIDENT)
    assert broken == breaks


@pytest.mark.parametrize("tilt", [25.0, 60.0, 90.0])
def test_a_bowl_on_its_side_rocks_upright_by_itself(world, tilt):
    """Why an accident inverts it: its centre of mass is below the middle of the sphere that it rolls on."""
    assert NOMINAL.bowl.inertial()[0][2] < NOMINAL.bowl.centre
    standing(world, math.radians(tilt))
    for _ in range(300):
        world.step(world.idle)
    assert world.tilt("bowl") < math.radians(1.0)


# --- why it takes both -----------------------------------------------------------------------


@pytest.mark.parametrize(("share", "holds"), [(0.8, False), (1.25, True)])
def test_pads_hold_the_dome_from_the_friction_of_a_textbook(share, holds):
    """Pads push level against a dome whose slope is asin(a / R) there: they slide off unless mu > cot(slope)."""
    bowl = Bowl(radius=0.060, depth=0.055)
    steep = math.sqrt(bowl.outer**2 / (OPENING / 2) ** 2 - 1.0)
    scenario = unchecked(BowlTable)(bowl=replace(bowl, friction=share * steep), rack_x=-0.1, rack_y=0.0)
    world = load(TASK, scenario)
    end = play_shortcut(TASK, scenario, "jaw_on_the_dome", world)
    assert not end.solved and world.touched("robot1", "bowl")
    assert (math.dist(world.pos("bowl"), scenario.start) > 0.02) == holds


def test_the_cup_does_not_hold_on_to_the_dome():
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, "cup_on_the_dome", world).solved
    assert world.touched("robot0", "bowl") and world.touching("bowl", "rack")


def test_both_arms_touch_the_bowl_in_the_solution_and_never_each_other():
    rollout, world = solution(TASK, NOMINAL), load(TASK, NOMINAL)
    assert replay(NOMINAL, world, rollout.actions, TASK.horizon).solved
    assert world.touched("robot0", "bowl") and world.touched("robot1", "bowl")
    assert not world.touched("robot0", "robot1")
    assert not any(world.touched(arm, thing) for arm in ("robot0", "robot1") for thing in ("rack", "table"))


@pytest.mark.parametrize("arm", [0, 1])
def test_with_one_arm_parked_the_witness_fails(arm):
    rollout, world = parked(TASK, NOMINAL, arm)
    assert not rollout.solved and not world.touched(f"robot{arm}", "bowl")


def test_ablations_fail_at_what_they_take_away():
    ends = ablated(TASK, NOMINAL)
    assert not any(rollout.solved for rollout, _ in ends.values())
    holed, lidded = ends["holed_foot"][1], ends["lidded"][1]
    assert not holed.touched("robot1", "bowl") and holed.touching("bowl", "rack")
    assert lidded.touched("robot1", "bowl")


def test_an_accident_reaches_the_goal_and_lacks_means():
    end = play_shortcut(TASK, NOMINAL, "cup_tips_it_over")
    assert end.reason.startswith(OTHERWISE) and NO_ACCIDENT in end.reason
    assert "the jaw gripped the bowl while suction pulled" in end.reason


# --- what must hold ---------------------------------------------------------------------------


def test_every_constraint_refutes_what_violates_it():
    bowl = NOMINAL.bowl
    each_refuted_for_its_own_reason(
        [
            BowlTable(bowl=Bowl(radius=0.095, depth=0.035)),
            BowlTable(rack_y=-0.35),
            BowlTable(goal_y=0.35),
            BowlTable(goal_y=-0.1, goal_x=-0.05),
            BowlTable(bowl=replace(bowl, foot=0.020)),
            BowlTable(bowl=replace(bowl, mass=0.4)),
            BowlTable(bowl=replace(bowl, friction=1.4)),
            BowlTable(bowl=replace(bowl, friction=0.2, mass=0.07)),
            BowlTable(rack_x=0.2, rack_y=0.3, goal_x=-0.2),
            BowlTable(goal_x=0.3, goal_y=-0.3),
        ]
    )


def test_no_finger_gets_in_beside_the_rim_and_each_thing_is_on_its_own_side_in_training():
    assert NOMINAL.rack.radius - NOMINAL.bowl.radius == pytest.approx(RIM_CLEARANCE)
    assert all(TASK.draw("id", 0, i).scenario.rack_y < 0 < TASK.draw("id", 0, i).scenario.goal_y for i in range(20))
    assert all(TASK.draw("across", 0, i).scenario.goal_y < 0 for i in range(20))
