"""A jaw leaves the box leaning on the slot's wall, as geometry says, and a knock brings it down if there is room."""

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
    play,
    play_shortcut,
    replayed,
    solution,
    unchecked,
)

from scengen import load_task
from scengen.episode import OTHERWISE
from scengen.geometry import UP
from scengen.means import Watch
from scengen.params import values, with_values
from scengen.robots.jaw import PALM_ABOVE, PALM_ALONG
from scengen.tasks.cracker_box_jaw import GRIP_DEPTH, MAX_RELEASE_ANGLE, MIN_SLIDE_CLEARANCE, CrackerBoxJaw

TASK = load_task("cracker_box_jaw")
NOMINAL = CrackerBoxJaw()
BOX = NOMINAL.box
FLAT = "the box was let go at a flat angle"
KNOCKED = "a knock of the robot brought the other end down"


def elevation(world):
    """Angle of the box' long axis to the level [rad]."""
    return math.pi / 2 - world.tilt("box")


def test_let_go_the_box_leans_on_the_near_wall_at_the_angle_of_a_ladder():
    """sin = height of the wall over the floor / length of the box: the edge of the wall bears the end of its face."""
    world = load(TASK, NOMINAL)
    end = play_shortcut(TASK, NOMINAL, "insert_and_leave", world)
    assert end.reason == "everything came to rest without reaching the goal"
    assert elevation(world) == pytest.approx(math.asin(NOMINAL.slot.depth / BOX.size[2]), abs=math.radians(1.5))
    assert world.touching_bodies("box") == {"slot"}


def test_a_shallow_slot_needs_no_knock():
    """The box then falls in by itself: its far end touches no wall before it is down."""

    class Shallow(CrackerBoxJaw):
        @property
        def slot(self):
            return replace(super().slot, depth=0.35 * self.box.size[0])

    shallow = with_values(unchecked(Shallow)(), values(NOMINAL))
    assert play(TASK, shallow, shallow.shortcuts()["insert_and_leave"].plan).reason == f"{OTHERWISE}: {KNOCKED}"


@pytest.mark.parametrize(("over", "steep"), [(0.01, True), (-0.01, False)])
def test_a_box_may_be_let_go_in_the_slot_up_to_an_angle(over, steep):
    """It leans on the near wall there, and slides down: it is looked at in the first period of contact."""
    world = load(TASK, NOMINAL)
    middle, rot = NOMINAL.leaning(world, MAX_RELEASE_ANGLE + over)
    free = world.data.joint("box_free").qpos
    mujoco.mju_mat2Quat(free[3:], rot.ravel())
    free[:3] = middle - BOX.size[2] / 2 * rot[:, 2] - 0.001 * UP
    while not world.touching("box", "slot"):
        world.step(world.idle)
    assert elevation(world) == pytest.approx(MAX_RELEASE_ANGLE + over, abs=0.008)
    assert missed(NOMINAL, world, FLAT) == steep


def test_a_toppled_box_is_not_in_its_seat_and_has_missed_a_mean():
    """The shortcut does not reach the goal; were the box shoved on into its seat, this mean would lack."""
    world = load(TASK, NOMINAL)
    assert play_shortcut(TASK, NOMINAL, "stand_it_up_and_topple_it", world).outcome == "timeout"
    assert FLAT in Watch(NOMINAL.means(), world).lacking()


@pytest.mark.parametrize(("room", "passes"), [(0.0015, True), (-0.0015, False)])
def test_a_knock_brings_it_down_if_it_passes_between_the_walls(room, passes):
    clearance = NOMINAL.clearance + (room - NOMINAL.slide_clearance) / 2
    scenario = with_values(unchecked(CrackerBoxJaw)(), {**values(NOMINAL), "clearance": clearance})
    assert scenario.slide_clearance == pytest.approx(room)
    assert play(TASK, scenario, scenario.oracle).solved == passes


def test_let_go_the_palm_is_just_over_the_table():
    reach, angle = BOX.size[2] - GRIP_DEPTH + PALM_ABOVE, NOMINAL.flattest
    lowest = reach * math.sin(angle) - (PALM_ALONG - BOX.size[0] / 2) * math.cos(angle)
    assert 0.005 < lowest < 0.015
    world = load(TASK, NOMINAL)
    for action in solution(TASK, NOMINAL).actions:
        world.step_filtered(action)
    assert not world.touched("robot", "table") and not world.touched("robot", "slot")


@pytest.mark.parametrize("name", ["lower_it_level", "stand_it_up_and_topple_it", "by_the_flat_side"])
def test_other_ways_to_put_it_down_end_elsewhere(name):
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, name, world).solved
    assert world.com("box")[2] - NOMINAL.seat[2] > 0.015


def test_ablations_fail_at_what_they_take_away():
    ends = ablated(TASK, NOMINAL)
    assert not any(rollout.solved for rollout, _ in ends.values())
    assert ends["short_slot"][1].touched("box", "slot")
    assert np.linalg.norm(ends["slippery_box"][1].com("box")[:2] - NOMINAL.start[:2]) < 0.1


def test_a_solution_is_one_of_its_own_scene():
    moved = replace(NOMINAL, slot_y=NOMINAL.slot_y + 0.02)
    assert not replayed(TASK, NOMINAL, moved).solved


# --- what must hold -----------------------------------------------------------------------------


def test_every_constraint_refutes_what_violates_it():
    each_refuted_for_its_own_reason(
        [
            replace(NOMINAL, box_x=-0.39, box_y=0.39),
            replace(NOMINAL, slot_x=0.35),
            replace(NOMINAL, slot_y=-0.1),
            replace(NOMINAL, box=replace(BOX, scale=1.01)),
            replace(NOMINAL, box=replace(BOX, friction=0.10)),
            replace(NOMINAL, clearance=0.003),
            replace(NOMINAL, box_x=0.31, box_y=-0.34, slot_x=-0.05),
            replace(NOMINAL, slot_x=0.31, slot_y=0.275),
        ]
    )


def test_whether_it_passes_is_a_matter_of_shape_alone():
    """Both sides of the law grow with the box; the clearance must."""
    for scale in (0.75, 0.9):
        scenario = replace(NOMINAL, box=replace(BOX, scale=scale), clearance=NOMINAL.clearance * scale / BOX.scale)
        assert scenario.slide_clearance / scale == pytest.approx(NOMINAL.slide_clearance / BOX.scale)
    assert NOMINAL.slide_clearance > MIN_SLIDE_CLEARANCE
