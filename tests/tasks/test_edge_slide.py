"""The plate has to overhang before it can be taken, and where it tips is where the push must have ended."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    after_oracle,
    each_refuted_for_its_own_reason,
    load,
    mistaken,
    not_certified,
    play,
    play_shortcut,
    replayed,
    spared,
    unchecked,
)

from scengen import load_task
from scengen.assets.board import Board
from scengen.assets.prop import TABLE_TOP
from scengen.sim.arm import ROBOT
from scengen.tasks.edge_slide import MIN_LIFT, MIN_OVERHANG, TIPPING_MARGIN, EdgeSlide
from scengen.validate.rollout import AT_REST, run

TASK = load_task("edge_slide")
NOMINAL = EdgeSlide()
SLID = "the plate lay on the table with a lip over its edge"


@pytest.fixture(scope="module")
def solved():
    return after_oracle(TASK, NOMINAL)


# --- the push -----------------------------------------------------------------------------


@pytest.mark.parametrize("yaw", [12.0, -27.0])
def test_pushed_beside_its_middle_the_plate_arrives_square_where_the_push_was_to_end(yaw):
    s = EdgeSlide(yaw=yaw)
    w = load(TASK, s)
    play(TASK, s, lambda world: s.slide_out(world, s.aim), w)
    assert s.overhang(w) == pytest.approx(s.aim, abs=0.004)
    assert w.rot("plate")[:, 1] @ s.out > np.cos(np.radians(8.0))


@pytest.mark.parametrize(
    "plate", [Board(), Board(width=0.11), Board(off_centre=0.02)], ids=["even", "narrow", "loaded"]
)
@pytest.mark.parametrize(("past", "falls"), [(-0.006, False), (0.006, True)])
def test_a_push_may_end_before_the_centre_of_mass_is_over_the_edge_and_not_after(plate, past, falls):
    s = EdgeSlide(plate=plate)
    w = load(TASK, s)
    ended = play(TASK, s, lambda world: s.slide_out(world, plate.tipping_overhang + past), w)
    assert ended.outcome == ("failure" if falls else "timeout")


def test_the_hand_that_pinches_never_touches_the_table():
    for split in ("id", "other_side"):
        s = TASK.draw(split, 0, 0).scenario
        w = load(TASK, s)
        assert play(TASK, s, s.oracle, w).solved and not w.touched(ROBOT, "table"), split


def test_the_other_side_is_the_mirror_image():
    mirror = np.array([1.0, -1.0, 1.0])
    for index in range(3):
        left, right = (TASK.draw(split, 0, index).scenario for split in ("id", "other_side"))
        one, other = left.outline, right.outline * mirror[:2]
        assert sorted(one.tolist()) == pytest.approx(np.array(sorted(other.tolist())))
        assert right.grip[:, 2] == pytest.approx(left.grip[:, 2] * mirror)
        assert right.grip[:, 0] == pytest.approx(-left.grip[:, 0] * mirror)


# --- what does not work ---------------------------------------------------------------------


@pytest.mark.parametrize("name", ["close_from_above", "squeeze_a_corner"])
def test_from_above_the_jaw_comes_back_empty_and_the_plate_stays_flat(name):
    w = load(TASK, NOMINAL)
    assert play_shortcut(TASK, NOMINAL, name, w).reason == AT_REST
    assert NOMINAL.lowest(w) == pytest.approx(TABLE_TOP, abs=0.001)


@pytest.mark.parametrize(("friction", "holds"), [(0.9, False), (1.1, True)])
def test_a_corner_can_be_squeezed_if_friction_exceeds_the_tangent_of_half_its_angle(friction, holds):
    s = unchecked(EdgeSlide)(plate=Board(friction=friction))
    squeeze = s.shortcuts()["squeeze_a_corner"].plan
    ended = run(s, load(TASK, s), squeeze, TASK.horizon, until_settled=True, rules="paper")
    assert ended.solved == holds and (SLID in ended.lacks) == holds
    assert (EdgeSlide(plate=Board(friction=friction)).infeasible() is not None) == holds


def test_where_it_lies_the_palm_is_in_the_way():
    w = load(TASK, NOMINAL)
    assert "short of its target" in play_shortcut(TASK, NOMINAL, "pinch_where_it_lies", w).gave_up
    assert w.touched(ROBOT, "table") and not w.touched(ROBOT, "plate")


def test_on_a_wider_table_the_same_motion_takes_nothing():
    ended, w = ablated(TASK, NOMINAL)["wider_table"]
    assert not ended.solved and NOMINAL.lowest(w) == pytest.approx(TABLE_TOP, abs=0.002)


@pytest.mark.parametrize("split", ["far_inset", "heavy_strip"])
def test_a_memorised_motion_serves_neither_another_way_nor_another_balance(split):
    trained, moved = (TASK.draw(name, 0, 1).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


# --- goal and failure -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("a", "b", "makes"), [(ROBOT, "plate", True), ("plate", "table", False), (ROBOT, "table", True)]
)
def test_the_plate_must_be_held_by_the_robot_and_touch_nothing_else(solved, a, b, makes):
    before = solved.loop.touching.copy()
    assert NOMINAL.success(solved)
    i, j = (-1 if body == ROBOT else solved.body(body) for body in (a, b))  # the robot has the last row
    solved.loop.touching[i, j] = solved.loop.touching[j, i] = not makes
    assert NOMINAL.success(solved) == (b == "table" and a == ROBOT)
    solved.loop.touching[:] = before


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize(("short", "counts"), [(-0.001, True), (0.001, False)])
def test_its_lowest_corner_must_be_50_mm_above_the_table_whichever_side_is_up(solved, upside_down, short, counts):
    state = solved.state()
    pose = solved.data.joint("plate_free").qpos
    if upside_down:
        mujoco.mju_mulQuat(pose[3:7], np.array([0.0, 1.0, 0.0, 0.0]), pose[3:7].copy())
        mujoco.mj_kinematics(solved.model, solved.data)
    geoms = [solved.model.geom(f"plate/{name}").id for name in ("board", "strip")]

    def lowest():
        """From the boxes that collide, not from the family's own geometry."""
        reach = [np.abs(solved.data.geom_xmat[g].reshape(3, 3)[2]) @ solved.model.geom_size[g] for g in geoms]
        return min(solved.data.geom_xpos[g][2] - r for g, r in zip(geoms, reach, strict=True))

    pose[2] += TABLE_TOP + MIN_LIFT - short - lowest()
    mujoco.mj_kinematics(solved.model, solved.data)
    assert NOMINAL.success(solved) == counts
    solved.restore(state)


def test_a_plate_on_the_floor_is_lost(solved):
    state = solved.state()
    assert NOMINAL.failure(solved) is None
    solved.data.joint("plate_free").qpos[2] = 0.7
    mujoco.mj_kinematics(solved.model, solved.data)
    mujoco.mj_comPos(solved.model, solved.data)
    assert NOMINAL.failure(solved) == "the plate fell off the table"
    solved.restore(state)


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Overhanging(EdgeSlide):
    """To have made a lip is enough, by any means."""

    def success(self, world):
        return self.overhang(world) > MIN_OVERHANG / 2

    def means(self):
        return {}


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (EdgeSlide(away=0.05), "feasible", "the plate leaves the table"),
        (Overhanging(), "shortcuts", "reaches the goal"),
        (mistaken(EdgeSlide, "stop_at_the_edge")(), "solved", "the oracle failed"),
        (spared(EdgeSlide)(), "ablations", "the witness succeeds with 'less_light'"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, EdgeSlide) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_the_window_closes_where_the_plate_falls_before_it_can_be_pinched():
    widest = 0.05 - MIN_OVERHANG - TIPPING_MARGIN
    for off_centre, opens in ((widest - 0.001, True), (widest + 0.001, False)):
        plate = Board(width=0.10, off_centre=off_centre)
        assert (EdgeSlide(plate=plate).infeasible() is None) == opens


def test_every_refutation_has_its_own_reason():
    plate = NOMINAL.plate
    each_refuted_for_its_own_reason(
        [
            EdgeSlide(side=0),
            EdgeSlide(away=0.05),
            EdgeSlide(plate=replace(plate, length=0.075)),
            EdgeSlide(plate=replace(plate, friction=1.2)),
            EdgeSlide(plate=replace(plate, width=0.10, off_centre=0.02)),
            EdgeSlide(plate=replace(plate, friction=0.1, mass=0.05)),
            EdgeSlide(plate=replace(plate, mass=0.2, friction=0.9)),
            EdgeSlide(x=0.34),
        ]
    )
