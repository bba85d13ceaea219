"""The ball leaves once the cage is lifted and tilted towards the hole; over the other end, or shaken, it is no use."""

import math
from dataclasses import dataclass

import mujoco
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
    spared,
    unchecked,
)

from scengen import load_task
from scengen.assets.ball import Ball
from scengen.assets.cage import SIDE, TOP, HoledCage, lowered
from scengen.assets.prop import TABLE_TOP
from scengen.assets.stool import Stool
from scengen.episode import OTHERWISE, Episode
from scengen.sim.arm import ROBOT
from scengen.skills.jaw import grasp
from scengen.skills.motion import CLOSED, Pace, go_to, hold, until
from scengen.tasks.ball_cage_escape import REST_SPEED, BallCageEscape

TASK = load_task("ball_cage_escape")
NOMINAL = BallCageEscape()
LIFTED = "the jaw held the cage in the air as the ball left it"
TILTED = "the cage was tilted to the hole, farther than the ball needs to roll"
ONE_WAY = "the ball did not roll to the other end"
UNTOUCHED = "no hand touched the ball in the cage"


# --- what keeps the ball in -------------------------------------------------------------


def tipped(scenario, *degrees, rate=0.5):
    """Plan that lifts the cage and tilts it by each of some angles from the level."""

    def plan(world):
        yield from scenario.pick_up(world)
        yield from scenario.present(world, lowered(math.radians(degrees[-1])))
        for tilt in degrees:
            yield from scenario.tip(world, lowered(math.radians(tilt)), rate)
            yield from hold(world.arm, 1.0)

    return plan


@pytest.mark.parametrize(("degrees", "outcome"), [(3.0, "timeout"), (16.0, "success")])
def test_the_ball_stays_below_its_rolling_tilt_and_leaves_above_it(degrees, outcome):
    """It is 5.7 deg; a hand is exact to 3 deg."""
    assert math.degrees(NOMINAL.rolling_tilt) == pytest.approx(5.71, abs=0.01)
    assert play(TASK, NOMINAL, tipped(NOMINAL, degrees)).outcome == outcome


@pytest.mark.parametrize("name", ["tip_it_to_the_wrong_end", "tip_it_to_both_ends"])
def test_a_tilt_to_the_wrong_end_leaves_the_ball_there_and_misses_a_mean(name):
    world = load(TASK, NOMINAL)
    assert play_shortcut(TASK, NOMINAL, name, world).outcome == "timeout" and not NOMINAL.out(world)
    assert missed(NOMINAL, world, ONE_WAY)


def test_a_cage_that_is_tilted_both_ways_reaches_the_goal_and_lacks_one_mean():
    assert play(TASK, NOMINAL, tipped(NOMINAL, -20.0, 35.0)).reason == f"{OTHERWISE}: {ONE_WAY}"


def half_tipped_and_thrown(world):
    """Tip the cage half as far as the ball needs to roll, then shake it without the teleoperation filter."""
    yield from NOMINAL.shortcuts()["shake_it_half_tipped"].plan(world)


def test_a_ball_that_is_shaken_out_reaches_the_goal_and_lacks_the_tilt_alone():
    episode = Episode(NOMINAL, world := load(TASK, NOMINAL), TASK.horizon)
    for action in half_tipped_and_thrown(world):
        if episode.step(np.clip(action, -1.0, 1.0).astype(np.float32)):
            break
    while episode.outcome is None:
        episode.step(world.idle.astype(np.float32))
    assert episode.reason == f"{OTHERWISE}: {TILTED}"


def slid(world):
    """Grasp the cage, slide it on the stool until the hole is beside it, and lower that end."""
    yield from until(NOMINAL.pick_up(world), lambda: world.arm.grip == CLOSED)
    yield from grasp(world.arm)
    yield from go_to(world.arm, world.arm.hand + 0.05 * NOMINAL.axes[:, 0], pace=Pace(0.05, 0.004))
    yield from NOMINAL.tip(world, lowered(0.6), rate=0.5)


def test_a_ball_that_leaves_a_cage_on_its_stool_reaches_the_goal_and_lacks_the_lift():
    assert play(TASK, NOMINAL, slid).reason == f"{OTHERWISE}: {LIFTED}"


@pytest.mark.parametrize("rate", [0.25, 0.5, 1.0, 2.0])
def test_a_tilt_does_not_count_as_a_shake(rate):
    assert play(TASK, NOMINAL, tipped(NOMINAL, 35.0, rate=rate)).solved


@pytest.mark.parametrize("split", ["id", *TASK.axes])
def test_a_cage_that_is_carried_level_keeps_the_ball_where_it_is(split):
    """Off the hole and off the wrong end: 5 and 4 mm are what the constraints leave."""
    scenario = TASK.draw(split, 0, 0).scenario
    world = load(TASK, scenario)
    play(TASK, scenario, lambda world: scenario.tip_only(world, 0.0), world)
    place = world.rot("cage").T @ (world.pos("ball") - world.pos("cage"))
    assert abs(place[0] - scenario.ball_x) < 0.012 and not scenario.at_wrong_end(place)


def test_one_fixed_answer_is_right_in_half_of_the_draws():
    """A choice between two ends: a tilt in one fixed heading is a guess."""
    draws = [TASK.draw("id", 0, i).scenario for i in range(300)]
    right = [[draw.answer().right(value) for draw in draws] for value in NOMINAL.answer().candidates]
    assert max(map(np.mean, right)) <= 0.55 + 1.64 * math.sqrt(0.25 / 300)
    assert NOMINAL.answer().tries == 1


@pytest.mark.parametrize(("heading", "outcome"), [(0.0, "success"), (180.0, "timeout")])
def test_a_guess_is_acted_upon(heading, outcome):
    answer = NOMINAL.answer()
    rollout = play(TASK, NOMINAL, lambda world: answer.act(world, heading))
    assert rollout.outcome == outcome and answer.right(heading) == rollout.solved


def test_without_the_hole_the_ball_is_still_in_the_cage_when_the_witness_has_ended():
    ((episode, world),) = ablated(TASK, NOMINAL).values()
    assert not episode.solved and not NOMINAL.out(world)


def test_a_cage_that_is_knocked_off_its_stool_keeps_the_ball_or_is_lost():
    episode = play_shortcut(TASK, NOMINAL, "knock_it_off_the_stool")
    assert not episode.solved


@pytest.mark.parametrize("name", ["lift_it_off_the_stool", "tip_it_half_as_far"])
def test_half_of_the_plan_leaves_the_ball_in_the_lifted_cage(name):
    world = load(TASK, NOMINAL)
    episode = play_shortcut(TASK, NOMINAL, name, world)
    assert episode.outcome == "timeout" and not NOMINAL.out(world)
    assert not world.touching("cage", "stool")


@pytest.mark.parametrize("split", list(TASK.axes))
def test_a_memorised_motion_serves_no_other_cage_and_no_other_stool(split):
    trained, shifted = (TASK.draw(name, 0, 0).scenario for name in ("id", split))
    assert not replayed(TASK, trained, shifted).solved


# --- goal and failure -------------------------------------------------------------------


def put(world, body, pos, velocity=0.0):
    """Set a body down somewhere, turned as it is, moving along x, and look at it one period later."""
    joint = world.data.joint(f"{body}_free")
    joint.qpos[:3], joint.qvel[:] = pos, [velocity, 0, 0, 0, 0, 0]
    mujoco.mj_forward(world.model, world.data)
    world.step(world.idle)


@pytest.mark.parametrize(
    ("x", "height", "velocity", "counts"),
    [
        (0.2, TABLE_TOP, 0.0, True),
        (0.2, TABLE_TOP, 3 * REST_SPEED, False),
        (0.2, TABLE_TOP + 0.05, 0.0, False),
        (-0.08 + NOMINAL.stool_x, TABLE_TOP + 0.08 + 0.05, 0.0, False),
    ],
    ids=["lies on the table", "rolls on the table", "falls", "lies on the cage"],
)
def test_only_a_ball_that_lies_on_the_table_counts(x, height, velocity, counts):
    world = load(TASK, NOMINAL)
    put(world, "ball", [x, 0.0, height + NOMINAL.ball.radius - 1e-5], velocity)
    assert NOMINAL.success(world) == counts


@pytest.mark.parametrize(("beyond", "is_out"), [(-0.001, False), (0.001, True)])
def test_the_ball_is_out_when_all_of_it_is(beyond, is_out):
    world = load(TASK, NOMINAL)
    below = world.pos("cage") - [0, 0, NOMINAL.ball.radius + beyond]
    world.data.joint("ball_free").qpos[:3] = below + world.rot("cage") @ [NOMINAL.cage.offset, 0, 0]
    mujoco.mj_forward(world.model, world.data)
    assert NOMINAL.out(world) == is_out


@pytest.mark.parametrize(
    ("body", "place", "reason"),
    [
        ("ball", [0.5, 0.0, 0.3], "the ball fell off the table"),
        ("cage", [0.5, 0.0, 0.3], "the cage fell off the table"),
    ],
)
def test_what_is_lost_is_lost_for_its_own_reason(body, place, reason):
    world = load(TASK, NOMINAL)
    assert NOMINAL.failure(world) is None
    put(world, body, place)
    assert NOMINAL.failure(world) == reason


@pytest.mark.parametrize(("along", "is_missed"), [(-0.0465, True), (-0.0430, False), (0.0, False)])
def test_a_ball_at_the_end_without_the_hole_misses_a_mean(along, is_missed):
    world = load(TASK, NOMINAL)
    put(world, "ball", [-0.08 + along, 0.0, TABLE_TOP + 0.08 + 0.018])
    assert missed(NOMINAL, world, ONE_WAY) == is_missed


@pytest.mark.parametrize("touched", [True, False])
def test_a_ball_that_a_hand_has_touched_misses_a_mean_as_it_leaves(touched):
    world = load(TASK, NOMINAL)
    robot, ball = (world.row(name) for name in (ROBOT, "ball"))
    world.loop.touched[robot, ball] = touched
    assert not missed(NOMINAL, world, UNTOUCHED), "it has not left yet"
    world.data.joint("ball_free").qpos[:3] = world.pos("cage") + world.rot("cage") @ [NOMINAL.cage.offset, 0, 0]
    mujoco.mj_forward(world.model, world.data)
    assert missed(NOMINAL, world, UNTOUCHED) == touched


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Outside(BallCageEscape):
    """The ball lies beside the stool from the beginning."""

    def build(self):
        scene = super().build()
        scene.body("ball").pos = [0.2, 0.0, TABLE_TOP + self.ball.radius]
        return scene


@dataclass(frozen=True, kw_only=True)
class Lifted(BallCageEscape):
    """To have the cage off its stool is enough, by whatever means."""

    def success(self, world):
        return not world.touching("cage", "stool") and world.pos("cage")[2] > self.foot[2] + 0.02

    def means(self):
        return {}


@dataclass(frozen=True, kw_only=True)
class Timid(BallCageEscape):
    """The oracle tilts less than the ball needs to roll."""

    def oracle(self, world):
        yield from self.tip_only(world, math.radians(3.0))


TOPPLES = {"stool_x": 0.045, "cage": HoledCage(face=SIDE)}


@pytest.mark.parametrize(
    ("scenario", "check"),
    [
        (unchecked(BallCageEscape)(**TOPPLES), "rest"),
        (unchecked(BallCageEscape)(ball=Ball(radius=0.018, density=1400.0)), "solved"),
        (Outside(), "unsolved"),
        (Lifted(), "shortcuts"),
        (Timid(), "solved"),
        (spared(BallCageEscape)(), "ablations"),
    ],
    ids=["topples", "ball wider than the hole", "outside", "lifted", "timid", "spared"],
)
@pytest.mark.slow
def test_what_makes_the_task_another_one_is_not_certified(scenario, check):
    not_certified(TASK, scenario, check)


def test_every_constraint_refutes_for_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            BallCageEscape(cage=HoledCage(hole=0.024)),
            BallCageEscape(cage=HoledCage(hole=0.0145)),
            BallCageEscape(cage=HoledCage(face=TOP)),
            BallCageEscape(cage=HoledCage(face=SIDE, height=0.056, hole=0.0165)),
            BallCageEscape(ball_y=0.02),
            BallCageEscape(ball_x=-0.045),
            BallCageEscape(ball_x=0.022),
            BallCageEscape(rolling=0.05),
            BallCageEscape(stool_x=0.0),
            BallCageEscape(**TOPPLES),
            BallCageEscape(y=-0.33),
            BallCageEscape(x=0.268, y=0.268, stool=Stool(height=0.021)),
        ]
    )
