"""Pressed on one side the plate can be taken on the other; one arm takes it only where friction or a stop helps."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    parked,
    play,
    play_shortcut,
    solution,
    unchecked,
)
from helpers import other_under_mujoco_4

from scengen import load_task
from scengen.assets.prop import TABLE_TOP
from scengen.errors import GaveUp
from scengen.geometry import rotation
from scengen.means import MISSED
from scengen.params import values, with_values
from scengen.robots.jaw import PALM_ABOVE, PALM_ALONG
from scengen.sim.world import World
from scengen.tasks.plate_shelf_hobi import OVERLAP, PALM_CLEARANCE, PlateShelfHobi
from scengen.validate.rollout import run

TASK = load_task("plate_shelf_hobi")
NOMINAL = PlateShelfHobi()
PLATE = NOMINAL.plate
AT_EDGE, FALL = "the plate stayed away from the table's edge", "the plate did not fall"
UNPRESSED, KNOCKED = "no hand raised the plate unpressed", "the plate touched the shelf on edge only"


def has_missed(world, mean):
    """Whether the episode that was played in a world missed a mean."""
    return world.shown[list(NOMINAL.means()).index(mean)] == MISSED


def until_taken(scenario):
    """A world in which the jaw has just closed on the raised rim."""
    world = load(TASK, scenario)
    for action in scenario.take(world):
        world.step(action)
    return world


@pytest.mark.parametrize("scenario", [NOMINAL, replace(NOMINAL, plate_y=0.05, shelf_y=-0.05)], ids=["left", "right"])
def test_the_raised_rim_is_where_geometry_says_and_the_palm_passes_over_the_table(scenario):
    """The presser stops at 96 % of the incline, and the plate gives way to the pads a little."""
    world = until_taken(scenario)
    presser, taker = scenario.roles(world)
    assert scenario.tilt(world) == pytest.approx(PLATE.slope, rel=0.08)
    assert scenario.rim(world)[2] - TABLE_TOP == pytest.approx(PLATE.raised + PLATE.thickness / 2, rel=0.08)
    assert world.touching(taker.label, "plate") and world.touching(presser.label, "plate")
    assert not world.touched(taker.label, "table") and not world.touched("robot0", "robot1")
    palm = taker.hand - PALM_ABOVE * taker.hand_rot[:, 2]
    lowest = min((palm + side * PALM_ALONG * taker.hand_rot[:, 0])[2] for side in (-1, 1))
    assert lowest - TABLE_TOP > PALM_CLEARANCE / 2


def test_the_palm_just_passes_at_the_tilt_that_the_law_gives():
    low = replace(NOMINAL, plate=replace(PLATE, radius=0.088))
    tilt, height = low.raised_tilt, low.plate.raised + low.plate.thickness / 2
    assert tilt > 2 * low.plate.slope  # the palm decides, not the rim
    lowest = height + (PALM_ABOVE - OVERLAP) * math.sin(tilt) - PALM_ALONG * math.cos(tilt)
    assert lowest == pytest.approx(PALM_CLEARANCE, abs=1e-9)


# --- two arms -------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", [0, 1])
@pytest.mark.slow
def test_with_one_arm_parked_the_witness_fails(arm):
    rollout, world = parked(TASK, NOMINAL, arm)
    assert not rollout.solved and not world.touched(f"robot{arm}", "plate")


def test_ablations_fail_at_what_they_take_away():
    ends = ablated(TASK, NOMINAL)
    assert not any(rollout.solved for rollout, _ in ends.values())
    assert ends["flat_plate"][1].pos("plate")[2] - TABLE_TOP < 0.01


SLIPS = other_under_mujoco_4("the plate rises by 41 mm before it slips off")


@pytest.mark.parametrize(("friction", "lifts"), [(0.3, False), pytest.param(0.6, True, marks=SLIPS)])
def test_one_jaw_lifts_the_flat_plate_by_its_rim_where_it_is_rough(friction, lifts):
    """The law of the constraint: pads slip off a rim that is askew to them by more than twice the angle of friction."""
    rough = with_values(unchecked(PlateShelfHobi)(), {**values(NOMINAL), "plate.friction": friction})
    assert (rough.flat_tilt - PLATE.slope > 2 * math.atan(friction)) != lifts
    world, highest = load(TASK, rough), 0.0
    try:
        for action in rough.shortcuts()["grip_it_flat"].plan(world):
            world.step(action)
            highest = max(highest, float(world.com("plate")[2] - TABLE_TOP))
    except GaveUp:
        pass
    assert (highest > 0.05) == lifts


def test_beside_the_table_one_arm_finds_room_where_the_plate_must_not_go():
    slide = NOMINAL.shortcuts()["slide_it_to_the_edge"].plan
    free = run(NOMINAL, load(TASK, NOMINAL), slide, TASK.horizon, rules="paper")
    assert free.solved and AT_EDGE in free.lacks
    end = play_shortcut(TASK, NOMINAL, "slide_it_to_the_edge")
    assert end.outcome == "failure" and AT_EDGE in end.reason


def test_a_plate_that_falls_back_has_fallen():
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, "let_it_fall_back", world).solved
    assert has_missed(world, FALL)


def test_two_hands_lift_the_plate_between_them_but_get_no_farther():
    """They come as far as the shelf."""
    world, heights = load(TASK, NOMINAL), []

    def squeeze(world):
        for action in NOMINAL.shortcuts()["squeeze_it_between_the_hands"].plan(world):
            if world.touching("robot0", "plate") and world.touching("robot1", "plate"):
                heights.append(world.pos("plate")[2] - TABLE_TOP)
            yield action

    assert not play(TASK, NOMINAL, squeeze, world).solved
    assert max(heights) > 0.1 and has_missed(world, UNPRESSED) and has_missed(world, KNOCKED)


@pytest.mark.parametrize(
    ("tilt", "up", "where", "lost"),
    [
        (6.0, 0.0, 0.9, False),  # pressed: the hand is on the side that goes down
        (6.0, 0.0, -0.9, True),
        (6.0, 0.0, 0.0, True),
        (1.0, 0.0, -0.9, False),  # it only rocks
        (15.0, 0.0, -0.9, False),  # it has been pressed
        (0.0, 0.006, 0.9, True),  # off the table, level
        (15.0, 0.006, -0.9, False),
    ],
)
def test_a_plate_is_raised_only_once_it_has_been_pressed(tilt, up, where, lost):
    """A world that holds nothing but the pose of the plate, one hand, and what touches what."""
    turn, middle = rotation(np.array([math.radians(tilt), 0.0, 0.0])), np.array([0.0, 0.0, TABLE_TOP + up])
    down = np.array([0.0, -1.0, 0.0])
    arm = SimpleNamespace(label="robot0", hand=middle + where * PLATE.radius * down)
    world = SimpleNamespace(
        arms=(arm,),
        pos=lambda body: middle,
        rot=lambda body: turn,
        tilt=lambda body: math.radians(tilt),
        touching=lambda a, b: {a, b} != {"plate", "table"} or up == 0.0,
    )
    assert NOMINAL.raised_unpressed(cast(World, world)) == lost


def test_a_replay_from_a_state_with_the_plate_pressed_ends_in_the_same_bits():
    """What is restored in the middle goes on as the whole did."""
    actions, ends = solution(TASK, NOMINAL).actions, []
    world = load(TASK, NOMINAL)
    for action in actions[:400]:
        world.step_filtered(action)
    saved = world.state()
    for _ in range(2):
        world.restore(saved)
        for action in actions[400:700]:
            world.step_filtered(action)
        ends.append(world.data.qpos.copy())
    assert np.array_equal(*ends)


# --- what must hold -------------------------------------------------------------------------


def test_every_constraint_refutes_what_violates_it():
    each_refuted_for_its_own_reason(
        [
            replace(NOMINAL, plate_y=-0.25),
            replace(NOMINAL, shelf_y=0.3, shelf_x=0.3, shelf_yaw=-60.0),
            replace(NOMINAL, plate_x=-0.05),
            replace(NOMINAL, gap=0.020),
            replace(NOMINAL, gap=0.060),
            replace(NOMINAL, proud=0.015),
            replace(NOMINAL, plate=replace(PLATE, friction=0.6)),
            replace(NOMINAL, plate=replace(PLATE, incline=12.0)),
            replace(NOMINAL, plate=replace(PLATE, radius=0.130, rim=0.020, mass=0.14, incline=25.0)),
            replace(NOMINAL, plate=replace(PLATE, mass=0.14)),
            replace(NOMINAL, plate_x=0.2, plate_y=0.214, shelf_x=-0.1, shelf_y=0.0),
        ]
    )
