"""A ball rolls as far as a textbook says, through the gap and not around it; a badly aimed ball is lost."""

import math
from dataclasses import replace

import mujoco
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    mistaken,
    not_certified,
    play_shortcut,
    replayed,
    solution,
)

from scengen import load_task
from scengen.assets.ball import Ball
from scengen.assets.gap_wall import GapWall, Kerb
from scengen.attack.priors import fit
from scengen.means import Watch
from scengen.sim.arm import IDLE, ROBOT
from scengen.tasks.gap_funnel import GapFunnel
from scengen.validate.rollout import AT_REST

TASK = load_task("gap_funnel")
PLAIN = GapFunnel()
BROUGHT = "the robot brought the ball before the gap"
THROUGH = "the ball rolled through the gap by itself, on the table"
LEFT_ALONE = "no hand touched the ball beyond the gap"
ON_TABLE = "the ball stayed on the table"
NOT_FELT = "neither ball nor hand felt for the gap along the wall"


def rolled(scenario, speed, seconds):
    """The world after a ball in the gap has rolled from a speed [m/s], without actions."""
    world = load(TASK, scenario)
    ball = world.model.body("ball")
    at, dof = world.model.jnt_qposadr[ball.jntadr[0]], ball.dofadr[0]
    world.data.qpos[at : at + 2] = scenario.gap_at[:2]
    world.data.qvel[dof : dof + 6] = 0.0
    world.data.qvel[dof], world.data.qvel[dof + 4] = speed, speed / scenario.ball.radius
    for _ in range(round(100 * seconds)):
        world.step(IDLE)
    return world


# --- the laws -----------------------------------------------------------------------------


@pytest.mark.parametrize("rolling", [0.008, 0.02])
def test_a_ball_rolls_seven_tenths_of_its_speed_squared_over_the_resistance(rolling):
    scenario = GapFunnel(rolling=rolling)
    speed = scenario.speed_for(0.15)
    assert speed**2 * 7 / (10 * rolling * 9.81) == pytest.approx(0.15)
    world = rolled(scenario, speed, 3.0)
    assert world.pos("ball")[0] - scenario.gap_at[0] == pytest.approx(0.15, rel=0.05)


def test_a_ball_that_is_too_fast_is_stopped_by_the_kerb_and_lies_in_the_zone():
    world = rolled(PLAIN, 1.25 * PLAIN.speed_for(PLAIN.run), 4.0)
    assert 1.25**2 * PLAIN.run > PLAIN.run + PLAIN.zone.size / 2 and PLAIN.success(world)


# --- ways around ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "lacks"),
    [
        ("straight_ahead", (BROUGHT, THROUGH, NOT_FELT)),
        ("straight_at_the_zone", (BROUGHT, THROUGH, NOT_FELT)),
        ("aslant_through_the_gap", (BROUGHT,)),
        ("too_slow", ()),
        ("over_the_wall", (BROUGHT, THROUGH, ON_TABLE)),
    ],
)
def test_shortcuts_leave_the_ball_outside_the_zone_and_lack_what_they_leave_out(name, lacks):
    world = load(TASK, PLAIN)
    ended = play_shortcut(TASK, PLAIN, name, world)
    assert ended.outcome == "timeout" and not PLAIN.success(world)
    assert ended.reason == AT_REST or name == "straight_ahead"
    found = Watch(PLAIN.means(), world).lacking()
    assert all(mean in found for mean in lacks) and bool(lacks) == bool(found)


def put(world, beyond):
    """Put the ball into the gap, `beyond` the middle of the wall [m]."""
    world.data.joint("ball_free").qpos[:3] = PLAIN.gap_at + beyond * PLAIN.normal + [0.0, 0.0, PLAIN.ball.radius]
    mujoco.mj_kinematics(world.model, world.data)
    mujoco.mj_comPos(world.model, world.data)


def touch(world):
    """Say that the robot touches the ball."""
    robot, ball = (world.row(name) for name in (ROBOT, "ball"))
    world.loop.touching[robot, ball] = True


@pytest.mark.parametrize(("beyond", "lost"), [(-0.001, False), (0.001, True)])
def test_behind_the_middle_of_the_wall_the_ball_must_roll_by_itself(beyond, lost):
    world = load(TASK, PLAIN)
    put(world, beyond)
    assert not missed(PLAIN, world, THROUGH)
    touch(world)
    assert missed(PLAIN, world, THROUGH) == lost


@pytest.mark.parametrize("touched", [True, False])
def test_a_hand_that_touches_the_ball_after_the_gap_misses_a_mean(touched):
    world = load(TASK, PLAIN)
    watch = Watch(PLAIN.means(), world)
    put(world, 0.001)
    watch.update()
    if touched:
        touch(world)
    watch.update()
    found = watch.lacking()
    assert THROUGH not in found and (LEFT_ALONE in found) == touched


def test_what_passes_the_gap_aslant_misses_the_zone_even_if_it_may_graze_the_wall():
    for offset in (0.08, -0.15):
        assert play_shortcut(TASK, GapFunnel(offset=offset), "aslant_through_the_gap").reason == AT_REST


def test_the_gap_is_what_the_ball_goes_through():
    (rollout, world), *_ = ablated(TASK, PLAIN).values()
    assert rollout.reason == AT_REST and world.touched("ball", "wall")
    assert missed(PLAIN, world, NOT_FELT)
    solved = load(TASK, PLAIN)
    assert replayed(TASK, PLAIN, PLAIN, solved).solved and not solved.touched("ball", "wall")


def test_no_fixed_place_of_the_gap_is_right_in_more_than_a_tenth_of_training():
    training, fresh = ([TASK.draw("id", seed, i).scenario for i in range(100)] for seed in (1, 2))
    (prior,) = fit(training, fresh=fresh)
    assert 0.0 < prior.fresh <= 0.10


def test_memorised_actions_stop_short_where_the_ball_rolls_less_far():
    trained, other = (TASK.draw(split, 0, 0).scenario for split in ("id", "sticky"))
    assert not replayed(TASK, trained, other).solved


def test_the_ball_comes_to_rest_out_of_reach():
    assert solution(TASK, PLAIN).solved
    assert math.dist(PLAIN.zone_at[:2], (-0.56, 0.0)) > 0.88


# --- scenes that must not be certified --------------------------------------------------------


def test_an_oracle_that_does_not_bring_the_ball_before_the_gap_is_not_certified():
    not_certified(TASK, mistaken(GapFunnel, "straight_ahead")(), "solved", "the oracle failed")


def test_what_is_refuted_is_refuted_for_reasons_of_its_own():
    each_refuted_for_its_own_reason(
        [
            replace(PLAIN, wall=GapWall(gap=0.05)),
            replace(PLAIN, wall=GapWall(gap=0.09), ball=Ball(radius=0.035)),
            replace(PLAIN, offset=0.03),
            replace(PLAIN, gap_y=0.3, offset=0.2),
            replace(PLAIN, gap_y=0.35, offset=-0.1),
            replace(PLAIN, run=0.24),
            replace(PLAIN, run=0.10),
            replace(PLAIN, before=0.15),
            replace(PLAIN, rolling=0.05),
            replace(PLAIN, kerb=Kerb(height=0.002)),
            replace(PLAIN, wall_x=0.29, run=0.05, gap_y=0.3, offset=-0.1),
        ]
    )
