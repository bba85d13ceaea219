"""The chain is as long as what the arm lacks, one block less comes too short, and nothing else reaches the target."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    after_oracle,
    each_refuted_for_its_own_reason,
    load,
    missed,
    mistaken,
    not_certified,
    play_shortcut,
    replayed,
    spared,
)

from scengen import load_task
from scengen.episode import Episode
from scengen.geometry import UP
from scengen.means import Watch
from scengen.robots import ik
from scengen.robots.jaw import TIP_BELOW
from scengen.robots.panda import BASE
from scengen.sim.arm import ROBOT
from scengen.tasks.indirect_push import END_MARGIN, MAX_COAST_SPEED, MAX_PUSH_DISTANCE, ZONE_SIZE, IndirectPush, Spot
from scengen.validate.rollout import AT_REST

TASK = load_task("indirect_push")
NOMINAL = IndirectPush()
CHAIN = "a chain of two or more blocks passed the push on to the target"
PUSHED = "the target moved only as far as the chain pushed it"
NO_SINGLE_BLOCK = "no block touched robot and target at once"
UNTOUCHED = "the robot did not touch the target"


@pytest.fixture(scope="module")
def solved():
    return after_oracle(TASK, NOMINAL)


# --- how far a chain reaches ---------------------------------------------------------------


def test_a_chain_brings_the_target_as_far_as_its_blocks_are_long():
    """The tips at MAX_PUSH_DISTANCE, n blocks and half of the target: the least n for the zone is needed."""
    for split, blocks in (("id", 2), ("far_zone", 3), ("small_blocks", 3)):
        for index in range(5):
            s = TASK.draw(split, 0, index).scenario
            inside = s.distance + s.way - ZONE_SIZE / 2 + END_MARGIN
            assert s.needed == blocks
            assert MAX_PUSH_DISTANCE + (blocks + 0.5) * s.edge >= inside > MAX_PUSH_DISTANCE + (blocks - 0.5) * s.edge


def test_the_chain_stands_in_contact_between_hand_and_target_when_the_push_ends(solved):
    first, second = NOMINAL.chosen
    places = [NOMINAL.out(solved.com(body)) for body in (second, first, "target")]
    assert np.diff(places) == pytest.approx(NOMINAL.edge, abs=0.003)
    assert all(abs((solved.com(body) - BASE) @ NOMINAL.side) < 0.010 for body in (first, second, "target"))
    assert not solved.touched(ROBOT, "target")


@pytest.mark.parametrize(("beyond", "reached"), [(-0.010, True), (0.004, False)])
def test_inverse_kinematics_finds_no_posture_in_which_one_block_would_do(beyond, reached):
    top = NOMINAL.at(NOMINAL.stretch - TIP_BELOW + beyond) + NOMINAL.edge * UP
    assert (ik.reach(top).residual < 0.001) == reached


def test_one_block_pushed_square_to_full_stretch_comes_too_short():
    w = load(TASK, NOMINAL)
    assert play_shortcut(TASK, NOMINAL, "push_one_block", w).reason == AT_REST
    assert NOMINAL.out(w.com("target")) < NOMINAL.distance + NOMINAL.way - ZONE_SIZE / 2 - 0.005


def test_a_block_that_touches_robot_and_target_at_once_misses_a_mean(solved):
    """Pushed corner first it reaches 0.41 edges farther than the bound, which is past the start of the zone."""
    entered = NOMINAL.distance + NOMINAL.way - ZONE_SIZE / 2
    assert NOMINAL.stretch + 1.5 * NOMINAL.edge < entered < NOMINAL.stretch + (2**0.5 + 0.5) * NOMINAL.edge
    w = load(TASK, NOMINAL)
    play_shortcut(TASK, NOMINAL, "push_one_block", w)
    assert Watch(NOMINAL.means(), w).lacking() == f"{CHAIN}; {NO_SINGLE_BLOCK}"
    first, second = NOMINAL.chosen
    assert solved.touched(ROBOT, second) and solved.touched(first, "target")
    assert not missed(NOMINAL, solved, NO_SINGLE_BLOCK) and Watch(NOMINAL.means(), solved).lacking() == ""


def test_a_blow_that_would_bring_the_target_into_the_zone_is_seen():
    """It must slide at least as far as from where one block leaves it: v^2 = 2 mu g s."""
    for friction in (0.35, 0.65):
        s = replace(NOMINAL, friction=friction)
        short = s.distance + s.way - ZONE_SIZE / 2 - s.stretch - 1.5 * s.edge
        assert (s.infeasible() is None) == (short > MAX_COAST_SPEED**2 / (2 * 9.81 * friction))
    w = load(TASK, NOMINAL)
    mujoco.mj_forward(w.model, w.data)
    for speed, struck in ((0.07, False), (0.09, True)):
        w.data.joint("target_free").qvel[:3] = speed * NOMINAL.u
        mujoco.mj_forward(w.model, w.data)
        assert missed(NOMINAL, w, PUSHED) == struck


@pytest.mark.parametrize(("speed", "seen"), [(0.20, False), (0.25, False), (0.30, True), (0.60, True)])
def test_a_block_that_is_shot_at_the_target_loses_or_knocks_it_on_by_two_millimetres_at_most(speed, seen):
    """A dozen knocks that took it farther, each beyond a hand's reach, had brought the target into the zone."""
    w = load(TASK, NOMINAL)
    block, target = w.data.joint("block_0_free"), w.data.joint("target_free")
    begin = target.qpos.copy()
    block.qpos[:3], block.qpos[3:] = begin[:3] - (NOMINAL.edge + 0.001) * NOMINAL.u, begin[3:]
    block.qvel[:3] = speed * NOMINAL.u
    mujoco.mj_forward(w.model, w.data)
    episode = Episode(NOMINAL, w)
    for _ in range(15):
        assert episode.step(w.filter(w.idle)) is None
    assert w.touched("block_0", "target")
    assert (PUSHED in Watch(NOMINAL.means(), w).lacking()) == seen
    assert seen or (target.qpos - begin)[:3] @ NOMINAL.u < 0.0025


def test_the_arm_stretched_out_for_the_target_never_touches_it():
    w = load(TASK, NOMINAL)
    play_shortcut(TASK, NOMINAL, "reach_for_the_target", w)
    assert not w.touched(ROBOT, "target") and w.com("target") == pytest.approx(
        NOMINAL.at(NOMINAL.distance) + NOMINAL.edge / 2 * UP, abs=0.001
    )


def test_without_the_head_of_the_chain_the_same_motion_leaves_the_target_before_the_zone():
    ended, w = ablated(TASK, NOMINAL)["one_block_less"]
    assert not ended.solved
    assert NOMINAL.out(w.com("target")) < NOMINAL.distance + NOMINAL.way - ZONE_SIZE / 2


@pytest.mark.parametrize("split", ["far_zone", "other_side"])
def test_a_memorised_motion_serves_no_other_distance_and_no_other_line(split):
    trained, moved = (TASK.draw(name, 0, 1).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


# --- goal and failure -------------------------------------------------------------------


@pytest.mark.parametrize(("beyond", "counts"), [(-0.001, True), (0.001, False)])
@pytest.mark.parametrize("along", [True, False])
def test_the_targets_middle_must_be_over_the_zone(solved, along, beyond, counts):
    state, direction = solved.state(), NOMINAL.u if along else NOMINAL.side
    pose = solved.data.joint("target_free").qpos
    pose[:2] = (NOMINAL.at(NOMINAL.distance + NOMINAL.way) + (ZONE_SIZE / 2 + beyond) * direction)[:2]
    mujoco.mj_kinematics(solved.model, solved.data)
    assert NOMINAL.success(solved) == counts
    solved.restore(state)


@pytest.mark.parametrize(("what", "index", "value"), [("in the air", 2, 0.02), ("moving", None, 0.05)])
def test_it_must_be_on_the_table_and_at_rest(solved, what, index, value):
    state = solved.state()
    assert NOMINAL.success(solved)
    if index is None:
        solved.data.joint("target_free").qvel[0] = value
    else:
        solved.data.joint("target_free").qpos[index] += value
    mujoco.mj_forward(solved.model, solved.data)
    assert not NOMINAL.success(solved), what
    solved.restore(state)


def test_touching_the_target_misses_a_mean_and_dropping_it_from_the_table_loses(solved):
    state, touched = solved.state(), solved.loop.touched.copy()
    assert NOMINAL.failure(solved) is None and not missed(NOMINAL, solved, UNTOUCHED)
    solved.loop.touched[-1, solved.body("target")] = solved.loop.touched[solved.body("target"), -1] = True
    assert missed(NOMINAL, solved, UNTOUCHED)
    solved.loop.touched[:] = touched
    solved.data.joint("target_free").qpos[2] = 0.6
    mujoco.mj_kinematics(solved.model, solved.data)
    mujoco.mj_comPos(solved.model, solved.data)
    assert NOMINAL.failure(solved) == "the target fell off the table"
    solved.restore(state)


# --- scenes that must not be certified ---------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (IndirectPush(distance=0.80), "feasible", "without a block"),
        (mistaken(IndirectPush, "push_where_it_lies")(), "solved", "the oracle failed"),
        (spared(IndirectPush)(), "ablations", "the witness succeeds with 'less_light'"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, IndirectPush) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            replace(NOMINAL, block_0=Spot(x=-0.38, y=-0.25)),
            replace(NOMINAL, bearing=5.0),
            replace(NOMINAL, distance=0.80),
            replace(NOMINAL, way=0.040),
            replace(NOMINAL, edge=0.030),
            replace(NOMINAL, block_0=Spot(x=0.3, y=-0.3)),
            replace(NOMINAL, block_0=Spot(y=-0.17)),
            replace(NOMINAL, block_2=Spot(x=0.0, y=0.19)),
        ]
    )
