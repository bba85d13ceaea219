"""The block leaves the cup by the angle of friction, only the handle turns the cup, and where the block counts."""

import math
from dataclasses import replace

import mujoco
import pytest
from controls import (
    ablated,
    after_oracle,
    each_refuted_for_its_own_reason,
    load,
    mistaken,
    not_certified,
    play_shortcut,
)

from scengen import load_task
from scengen.assets.prop import TABLE_TOP
from scengen.geometry import UP, heading, quat
from scengen.params import with_values
from scengen.physics import GRAVITY
from scengen.robots.jaw import PALM_ABOVE, TIP_BELOW, pinch
from scengen.sim.arm import ROBOT
from scengen.tasks.cup_extract import FINGER_TAPER, MIN_CLEARANCE, CupExtract

TASK = load_task("cup_extract")
NOMINAL = CupExtract()


@pytest.fixture(scope="module")
def solved():
    return after_oracle(TASK, NOMINAL)


def put(world, body, pos, turn=(1.0, 0.0, 0.0, 0.0)):
    """Put the origin of a body somewhere [m], at rest."""
    joint = world.data.joint(f"{body}_free")
    joint.qpos[:3], joint.qpos[3:], joint.qvel[:] = pos, turn, 0.0
    mujoco.mj_kinematics(world.model, world.data)
    mujoco.mj_comPos(world.model, world.data)
    mujoco.mj_comVel(world.model, world.data)


# --- the way out ----------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.10, 0.27])
@pytest.mark.parametrize(("more", "slides"), [(-2.0, False), (2.0, True)])
def test_the_block_slides_out_beyond_level_by_the_friction_angle(friction, more, slides):
    """On two edges, each `a` aslant, tan(tilt - 90 deg) = friction / cos(a), to 2 deg; in a cup that is held fast."""
    scenario = with_values(NOMINAL, {"cup.friction": friction})
    scene, tilt = scenario.build(), scenario.sliding_tilt + math.radians(more)
    scene.delete(scene.joint("cup_free"))
    scene.option.gravity = [GRAVITY * math.sin(tilt), 0.0, -GRAVITY * math.cos(tilt)]
    model = scene.compile()
    data = mujoco.MjData(model)
    inner, half = NOMINAL.cup.rim - NOMINAL.cup.wall, NOMINAL.block.width / 2
    data.qpos[0] += math.sqrt(inner**2 - half**2) - half  # it lies on two of its edges
    start = data.qpos[2]
    mujoco.mj_step(model, data, 500)
    assert (data.qpos[2] - start > 0.02) == slides


def test_the_fingers_end_above_the_block_and_the_palm_on_the_rim():
    w = load(TASK, NOMINAL)
    assert play_shortcut(TASK, NOMINAL, "reach_in", w).reason == "everything came to rest without reaching the goal"
    assert not w.touched(ROBOT, "block")
    assert NOMINAL.cup.height - NOMINAL.cup.floor - NOMINAL.block.height > PALM_ABOVE + TIP_BELOW + MIN_CLEARANCE


def test_in_a_shallow_cup_the_fingers_would_take_the_block():
    """The control of the test above: nothing else keeps the fingers from it."""
    shallow = with_values(NOMINAL, {"cup.height": 0.080})
    w = load(TASK, shallow)
    play_shortcut(TASK, shallow, "reach_in", w)
    assert w.touched(ROBOT, "block") and shallow.infeasible() is not None


@pytest.mark.parametrize(("wall", "friction", "lifts"), [(0.002, 0.13, False), (0.005, 0.34, True)])
def test_the_rim_bears_the_weight_by_the_law_of_friction(wall, friction, lifts):
    """pinch(wall) * friction against the weight of cup and block: 0.39 and 2.04 N against 1.23 N."""
    s = with_values(NOMINAL, {"cup.wall": wall, "cup.friction": friction})
    assert (pinch(wall) * friction > GRAVITY * (s.cup.mass + s.block.mass)) == lifts
    w, highest = load(TASK, s), 0.0
    for action in s.shortcuts()["pour_by_the_rim"].plan(w):
        w.step(action)
        highest = max(highest, w.pos("cup")[2] - TABLE_TOP)
        if w.time > 6.0:
            break
    assert (highest > 0.05) == lifts


def test_pushed_at_its_rim_the_cup_slides_and_stands():
    w = load(TASK, NOMINAL)
    play_shortcut(TASK, NOMINAL, "knock_it_over", w)
    assert math.dist(w.pos("cup"), NOMINAL.foot) > 0.03 and w.tilt("cup") < math.radians(1.0)


def test_with_more_friction_a_push_tips_it():
    """The control of the test above."""
    rough = with_values(NOMINAL, {"cup.friction": 0.8})
    w, most = load(TASK, rough), 0.0
    for action in rough.shortcuts()["knock_it_over"].plan(w):
        w.step(action)
        most = max(most, w.tilt("cup"))
        if most > math.radians(20.0):
            return
    raise AssertionError(f"tilted by {math.degrees(most):.0f} deg at most")


def test_level_the_block_stays_in_the_cup():
    w = load(TASK, NOMINAL)
    play_shortcut(TASK, NOMINAL, "tip_it_level", w)
    assert NOMINAL.within(w)


def test_without_a_handle_the_cup_stays_and_covered_it_keeps_the_block():
    ends = ablated(TASK, NOMINAL)
    assert not any(rollout.solved for rollout, _ in ends.values())
    assert ends["no_handle"][1].tilt("cup") < math.radians(5.0)
    assert NOMINAL.within(ends["covered"][1])


# --- goal and failure -----------------------------------------------------------------------


@pytest.mark.parametrize(("out", "counts"), [(-0.001, True), (0.001, False)])
def test_the_block_counts_with_its_middle_in_the_square(solved, out, counts):
    state = solved.state()
    put(solved, "block", NOMINAL.goal + (NOMINAL.patch.size / 2 + out) * heading(0.0))
    assert NOMINAL.success(solved) == counts
    solved.restore(state)


@pytest.mark.parametrize("turn", [quat("x", 0.0), quat("x", math.pi)], ids=["upright", "upside down"])
def test_under_or_in_a_cup_the_block_does_not_count(solved, turn):
    """A cup that is stood over the block touches it nowhere."""
    state = solved.state()
    at = solved.com("block") - NOMINAL.block.height / 2 * UP
    put(solved, "cup", at + (NOMINAL.cup.height * UP if turn[0] < 0.5 else 0.0))
    put(solved, "cup", solved.pos("cup"), turn)
    assert NOMINAL.within(solved) and not NOMINAL.success(solved)
    solved.restore(state)


@pytest.mark.parametrize(("other", "touching"), [(ROBOT, True), ("cup", True), ("table", False)])
def test_the_block_touches_the_table_and_nothing_else(solved, other, touching):
    before = solved.loop.touching.copy()
    assert NOMINAL.success(solved)
    i, j = solved.body("block"), -1 if other == ROBOT else solved.body(other)  # the robot has the last row
    solved.loop.touching[i, j] = solved.loop.touching[j, i] = touching
    assert not NOMINAL.success(solved)
    solved.loop.touching[:] = before


@pytest.mark.parametrize("body", ["block", "cup"])
def test_what_falls_off_the_table_is_lost(solved, body):
    state = solved.state()
    assert NOMINAL.failure(solved) is None
    put(solved, body, [0.6, 0.0, TABLE_TOP - 0.2])
    assert NOMINAL.failure(solved) == f"the {body} fell off the table"
    solved.restore(state)


# --- scenes that must not be certified ------------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (replace(NOMINAL, goal_x=0.0, goal_y=-0.05), "feasible", "the cup stands on the square"),
        (mistaken(CupExtract, "tip_it_level")(), "solved", "the oracle failed"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, CupExtract) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            with_values(NOMINAL, change)
            for change in (
                {"cup.handle": 0.0},
                {"cup.handle": 0.042},
                {"cup.base": 0.039, "cup.rim": 0.039},
                {"cup.height": 0.090},
                {"block.width": 0.055},
                {"cup.wall": 0.005, "cup.friction": 0.3},
                {"cup.friction": FINGER_TAPER + 0.001, "cup.mass": 0.2},
                {"cup.friction": 0.27, "cup.height": 0.14, "cup.mass": 0.2},
                {"x": 0.37},
                {"goal_y": -0.36},
                {"goal_y": -0.12},
                {"x": 0.28, "y": 0.35, "handle": 0.0},
            )
        ]
    )
