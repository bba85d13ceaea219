"""Blocks slide when the slope says so, only a bin that is there before catches them, and no other way leads there."""

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
    mistaken,
    not_certified,
    play,
    play_shortcut,
    replayed,
    solution,
    unchecked,
    unguarded,
)
from helpers import other_under_mujoco_4

from scengen import load_task
from scengen.assets.catch_bin import CatchBin
from scengen.assets.incline import Incline
from scengen.episode import Episode
from scengen.means import MISSED
from scengen.physics import slid
from scengen.tasks.slide_catch import FALL_TIME, ORDERS, Load, SlideCatch

TASK = load_task("slide_catch")
NOMINAL = SlideCatch(start=0.3)
"""Scenario for tests that do not use the bin, and need no time to take it."""
LIFTED = math.radians(4.3) * 0.04 * 0.01
"""How far the slab lifts a block 40 mm from the lip in a control period [m]."""
SLIDING = replace(NOMINAL, start=1.8)


# --- mechanics ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def idle():
    """Time and every block's place and velocity after each period without actions, shapes (n,) and (n, 3, 3)."""
    world = load(TASK, NOMINAL)
    episode = Episode(unguarded(SlideCatch)(start=0.3), world)
    times, places, velocities = [], [], []
    while NOMINAL.pending(world):
        episode.step(world.idle.astype(np.float32))
        times.append(world.time)
        places.append([world.com(block) - NOMINAL.ramp.lip for block in NOMINAL.blocks])
        velocities.append([world.velocity(block)[3:] for block in NOMINAL.blocks])
    return np.array(times), np.array(places), np.array(velocities)


RATTLES = other_under_mujoco_4("a block that rattles crosses the lip at 0.23 instead of 0.14 m/s")


@pytest.mark.parametrize("lane", [0, 1, pytest.param(2, marks=RATTLES)])
def test_a_block_is_over_the_lip_when_its_friction_and_its_place_say(idle, lane):
    times, places, velocities = idle
    row = int(np.argmax(places[:, lane, 0] < 0.0))
    assert times[row] == pytest.approx(NOMINAL.ramp.lip_time(lane), abs=0.05)
    since = times[row] - NOMINAL.ramp.slide_start(lane)
    _, speed = slid(NOMINAL.loads[lane].friction, math.radians(NOMINAL.rate), since)
    assert np.linalg.norm(velocities[row, lane]) == pytest.approx(speed, rel=0.25)


@pytest.mark.parametrize("lane", range(3))
def test_on_the_ramp_a_block_never_gains_more_than_gravity_gives(idle, lane):
    """Its energy falls all the way down, but for what the tilting slab lifts it, and friction takes most of it."""
    _, places, velocities = idle
    on = places[:, lane, 0] > 0.0
    kinetic = (velocities[on, lane] ** 2).sum(axis=1) / 2
    begun = int(np.argmax(kinetic > 0.02**2 / 2))
    energy = kinetic + 9.81 * places[on, lane, 2]
    assert (np.diff(energy[begun:]) < 9.81 * LIFTED).all()
    gained, given_up = kinetic[-1] - kinetic[begun], 9.81 * (places[on, lane, 2][begun] - places[on, lane, 2][-1])
    assert 0.0 < gained < 0.5 * given_up


def test_it_falls_from_lip_to_rim_in_the_time_that_is_counted_on(idle):
    times, places, _ = idle
    for lane in range(3):
        row = int(np.argmax(places[:, lane, 0] < 0.0))
        below = int(np.argmax(places[:, lane, 2] < CatchBin().rim - Incline().lip))
        assert FALL_TIME - 0.05 < times[below] - times[row] < FALL_TIME + 0.02


def test_the_darker_the_rougher():
    shades = [sum(Load(friction=friction).colour[:3]) for friction in (0.2, 0.4, 0.6, 0.8)]
    assert shades == sorted(shades, reverse=True) and min(-np.diff(shades)) > 0.2


def test_a_block_that_starts_to_slide_is_over_the_lip_before_a_bin_comes_from_the_next_lane():
    ended = play_shortcut(TASK, SLIDING, "wait_for_the_slide")
    assert ended.outcome == "failure" and "on the table" in ended.reason


# --- solutions ----------------------------------------------------------------------------


def test_a_restored_world_goes_on_bit_for_bit_while_the_ramp_tilts():
    actions = solution(TASK, SLIDING).actions
    one, other = load(TASK, SLIDING), load(TASK, SLIDING)
    first, second = Episode(SLIDING, one), Episode(SLIDING, other)
    for action in actions[:560]:
        first.step(action)
    other.restore(one.state())
    for action in actions[560:640]:
        assert first.step(action) is None and second.step(action) is None
    assert one.digest == other.digest and other.hinge("incline/hinge")[1] > 0.0


def test_the_witness_fails_where_frictions_are_exchanged():
    ((ended, world),) = ablated(TASK, SLIDING).values()
    assert ended.outcome == "failure" and world.touching(SLIDING.blocks[ORDERS[SLIDING.order][2]], "table")


@pytest.mark.parametrize(
    "moved",
    [replace(SLIDING, low=SLIDING.high, high=SLIDING.low), replace(SLIDING, rate=3.3), replace(SLIDING, start=3.3)],
    ids=["upper_first", "slow_tilt", "late_start"],
)
def test_a_memorised_motion_serves_no_other_order_and_no_other_time(moved):
    assert not replayed(TASK, SLIDING, moved).solved


def test_one_of_six_sequences_is_right():
    answer = SLIDING.answer()
    right = [number for number in answer.candidates if answer.right(number)]
    assert [ORDERS[round(number)] for number in right] == [SLIDING.ramp.sequence]
    wrong = next(number for number in answer.candidates if number not in right)
    assert not play(TASK, SLIDING, lambda world: answer.act(world, wrong)).solved


# --- means --------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "meddler"), [("herd_them_together", "bin"), ("take_them_by_hand", "robot")])
def test_blocks_that_are_herded_or_taken_do_not_slide_by_themselves(name, meddler):
    """Some of them also fall on the table."""
    world = load(TASK, SLIDING)
    assert play_shortcut(TASK, SLIDING, name, world).reason == "a block fell on the table"
    assert any(world.touched(meddler, block) for block in SLIDING.blocks)
    assert world.shown[list(SLIDING.means()).index("each block slid by itself")] == MISSED


@pytest.mark.parametrize(("angle", "lost"), [(4.5, False), (-5.5, True)])
def test_once_the_ramp_tilts_the_bin_must_be_square_to_the_lip(angle, lost):
    world = load(TASK, NOMINAL)
    turn = math.radians(angle) / 2
    world.data.joint("bin_free").qpos[3:] = [math.cos(turn), 0.0, 0.0, math.sin(turn)]
    for after, now in ((-0.1, False), (0.1, lost)):
        world.data.time = NOMINAL.start + after
        mujoco.mj_kinematics(world.model, world.data)
        assert NOMINAL.turned(world) == now == missed(NOMINAL, world, "the bin stood upright and square to the lip")


# --- scenes that must not be certified ----------------------------------------------------


def test_an_oracle_that_takes_the_wrong_order_gets_no_certificate():
    not_certified(TASK, mistaken(SlideCatch, "the_other_way_round")(), "solved", "the oracle failed")


def test_what_is_refuted_for_want_of_time_cannot_be_done():
    close = unchecked(SlideCatch)(order=1, high=Load(friction=0.54, away=0.040))
    ended = play(TASK, close, close.oracle)
    assert ended.outcome == "failure" and "on the table" in ended.reason


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            SlideCatch(low=Load(friction=0.19, away=0.022)),
            SlideCatch(high=Load(friction=0.96, away=0.04)),
            SlideCatch(incline=Incline(most=42.0)),
            SlideCatch(lane=0.085),
            SlideCatch(edge=0.045 - 0.005, bin=CatchBin(length=0.055)),
            SlideCatch(start=0.3),
            SlideCatch(high=Load(friction=0.60, away=0.040)),
            SlideCatch(lane=0.10),
            SlideCatch(low=Load(friction=0.277, away=0.12), incline=Incline(length=0.12)),
            SlideCatch(incline=Incline(width=0.2)),
            SlideCatch(bin_x=0.1),
            SlideCatch(y=0.2, incline=Incline(width=0.5)),
        ]
    )
