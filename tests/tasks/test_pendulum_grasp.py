"""The bob can be taken at its turning point, for as long as the law says, and at no other place or time."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    not_certified,
    play,
    play_shortcut,
    replayed,
    solution,
)

from scengen import load_task
from scengen.assets.pendulum import Pendulum
from scengen.means import MISSED
from scengen.sim.arm import IDLE
from scengen.skills.motion import CLOSED, OPEN, hold
from scengen.tasks.pendulum_grasp import APEX_SHARE, BOB, HINGE, PendulumGrasp
from scengen.validate.rollout import run

TASK = load_task("pendulum_grasp")
GRASP = TASK.draw("id", 0, 0).scenario
AT_APEX = "the robot touched the bob at its turning point alone"
ONCE = "the jaw closed once, in time for the bob"


@dataclass(frozen=True, kw_only=True)
class Anyhow(PendulumGrasp):
    """The goal counts however it is reached."""

    def means(self):
        return {}


def has_missed(world, mean):
    """Whether the episode that was played in a world missed a mean."""
    return world.shown[list(GRASP.means()).index(mean)] == MISSED


def closing(scenario, late):
    """Rollout of fingers that touch the bob `late` [s] after the turning point."""
    return play(TASK, scenario, lambda world: scenario.close_before(world, scenario.closing_time - late))


# --- the law of the task ----------------------------------------------------------------


@pytest.mark.parametrize("phase", [-150.0, 0.0, 60.0, 180.0])
def test_it_swings_from_any_moment_on_to_its_amplitude(phase):
    """The event at the start gives it the rate that belongs to its angle; the hand is far away."""
    scenario = replace(GRASP, phase=phase)
    world, angles = load(TASK, scenario), []
    for _ in range(150):
        with world.events():
            scenario.events(world)
        world.step(IDLE)
        angles.append(world.hinge(HINGE)[0])
    turns = [phase / 360.0 + (k + 1) / 100 / scenario.period for k in range(150)]
    expected = [scenario.pendulum.swing(scenario.peak_angle, turn)[0] for turn in turns]
    assert np.abs(np.array(angles) - expected).max() < math.radians(0.4)
    assert max(angles) == pytest.approx(scenario.peak_angle, rel=0.006) == -min(angles)  # half a step of Euler: 0.005
    assert world.com(BOB) == pytest.approx(scenario.bob_at(angles[-1]), abs=1e-4)


@pytest.mark.parametrize(("length", "period"), [(0.30, 1.119), (0.40, 1.292), (0.55, 1.515)])
def test_the_bob_waits_for_a_sixteenth_of_the_period(length, period):
    """Near the turning point it moves as a cosine: arccos 0.98 / pi of the period."""
    scenario = PendulumGrasp(pendulum=Pendulum(length=length))
    assert scenario.period == pytest.approx(period, abs=0.001)
    assert scenario.window / scenario.period == pytest.approx(math.acos(APEX_SHARE) / math.pi, rel=0.01)


@pytest.mark.parametrize(("share", "taken"), [(-1.6, False), (-0.5, True), (0.0, True), (0.5, True), (1.6, False)])
def test_fingers_must_arrive_while_it_waits(share, taken):
    """By halves of the window before (-) and after (+) the turning point."""
    assert closing(GRASP, share * GRASP.window / 2).solved == taken


@pytest.mark.parametrize("right", [True, False])
def test_what_statics_says_of_a_moment_is_what_happens(right):
    answer = GRASP.answer()
    margin = 0.03  # as long as a period of control and the two fingers, which do not touch at once
    sure = [m for m in answer.candidates if answer.right(m - margin) == answer.right(m) == answer.right(m + margin)]
    moment = next(m for m in sure if answer.right(m) == right)
    assert play(TASK, GRASP, lambda world: answer.act(world, moment)).solved == right


# --- what must not work -------------------------------------------------------------------


def test_a_bob_that_is_stopped_and_lifted_by_hand_reaches_the_goal_but_not_by_its_turning_point():
    ended = play_shortcut(TASK, GRASP, "stop_it_and_lift_it")
    assert ended.outcome == "failure" and AT_APEX in ended.reason
    assert play_shortcut(TASK, Anyhow(), "stop_it_and_lift_it").solved


def test_a_jaw_that_closes_on_nothing_has_had_its_try():
    world = load(TASK, GRASP)
    early = lambda world: GRASP.close_before(world, GRASP.closing_time + GRASP.period / 2)  # noqa: E731
    assert not play(TASK, GRASP, early, world).solved and has_missed(world, ONCE)

    def again(world):
        yield from hold(world.arm, 0.6, OPEN)
        yield from hold(world.arm, 0.4, CLOSED)
        yield from GRASP.oracle(world)

    ended = play(TASK, GRASP, again)
    assert ended.outcome == "failure" and ONCE in ended.reason
    free = run(GRASP, load(TASK, GRASP), again, TASK.horizon, rules="paper")
    assert free.solved and ONCE in free.lacks


@pytest.mark.parametrize(("periods", "then", "lost"), [(5, OPEN, False), (8, OPEN, True), (2, 0.0, True)])
def test_a_jaw_that_starts_to_close_has_had_its_try(periods, then, lost):
    """Far from the bob, for some control periods. Then it opens again, or stops. Five periods are an accident."""

    def starts(world):
        yield from hold(world.arm, 0.6, OPEN)
        for _ in range(periods):
            yield [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, CLOSED]
        yield from hold(world.arm, 0.6, then)

    world = load(TASK, GRASP)
    assert play(TASK, GRASP, starts, world).outcome == "timeout"
    assert has_missed(world, ONCE) == lost


@pytest.mark.parametrize(("wide", "lost"), [(-0.05, False), (-0.5, True)])
def test_a_jaw_touches_the_bob_soon_after_it_was_wide_open(wide, lost):
    """When it was, before it starts to touch [s]. The paper's goal does not see it: the bob is at the apex."""
    world = load(TASK, GRASP)
    solution_of = GRASP.oracle(world)
    while not world.touching("robot", BOB):
        with world.events():
            GRASP.events(world)
        world.step(next(solution_of))
    assert GRASP.at_apex(world) and GRASP.failure(world) is None
    with world.events():
        world.memory["wide"] = world.time + wide
    assert missed(GRASP, world, "the jaw closed from wide open") == lost
    assert not missed(GRASP, world, AT_APEX)


def test_where_it_hangs_still_the_witness_closes_on_nothing():
    ((ended, world),) = ablated(TASK, GRASP).values()
    assert not ended.solved and missed(GRASP, world, ONCE) and not world.touched("robot", BOB)


@pytest.mark.parametrize("axis", ["plane_45", "long_rod", "small_bob"])
def test_a_memorised_grasp_is_lost_out_of_distribution(axis):
    assert not replayed(TASK, GRASP, TASK.draw(axis, 0, 0).scenario).solved


def test_the_same_swing_half_a_period_later_is_another_problem():
    assert solution(TASK, GRASP).solved
    assert not replayed(TASK, GRASP, replace(GRASP, phase=math.remainder(GRASP.phase + 180.0, 360.0))).solved


# --- scenes that must not be certified ---------------------------------------------------


def test_without_means_it_is_not_certified():
    not_certified(TASK, Anyhow(), "shortcuts", "reaches the goal")


def test_what_is_refuted_is_refuted_for_reasons_of_its_own():
    each_refuted_for_its_own_reason(
        [
            PendulumGrasp(pendulum=Pendulum(length=0.65)),
            PendulumGrasp(pivot_y=0.25),
            PendulumGrasp(pendulum=Pendulum(radius=0.024)),
            PendulumGrasp(plane=60.0),
            PendulumGrasp(amplitude=18.0),
            PendulumGrasp(pivot_x=0.37, pivot_y=0.19, amplitude=21.0, pendulum=Pendulum(length=0.2, height=1.0)),
        ]
    )
