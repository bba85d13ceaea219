"""The ball leaves once the stool is gone and the right sill is low; over the other one it is lost."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    not_certified,
    play,
    play_shortcut,
    replayed,
    spared,
    unchecked,
    unguarded,
)

from scengen import load_task
from scengen.assets.ball import Ball
from scengen.assets.cage import SIDE, TOP, HoledCage
from scengen.assets.prop import TABLE_TOP
from scengen.assets.stool import Stool
from scengen.episode import Episode
from scengen.tasks.ball_cage_escape import MAX_HAND_TILT, REST_SPEED, TILT_MARGIN, BallCageEscape

TASK = load_task("ball_cage_escape")
NOMINAL = BallCageEscape()


# --- what keeps the ball in -------------------------------------------------------------


@pytest.mark.parametrize(("more", "outcome"), [(-6.0, "timeout"), (13.0, "success")])
@pytest.mark.parametrize("sill", [0.004, 0.006])
def test_the_ball_stays_behind_the_sill_below_the_angle_and_leaves_above_it(sill, more, outcome):
    """42.8 and 53.1 deg; a held cage gives up to 5 deg."""
    scenario = BallCageEscape(cage=HoledCage(sill=sill))
    tilt = scenario.least_tilt + math.radians(more)
    assert play(TASK, scenario, lambda world: scenario.tip_only(world, tilt)).outcome == outcome


@pytest.mark.parametrize(("more", "reason"), [(-6.0, ""), (6.0, "the ball fell into the trap")])
def test_the_trap_takes_the_ball_at_its_own_angle(more, reason):
    """23.1 deg, to the other end."""
    tilt = NOMINAL.cage.tilt_into_trap(NOMINAL.ball.radius) + math.radians(more)
    rollout = play(TASK, NOMINAL, lambda world: NOMINAL.tip_only(world, -tilt))
    assert (rollout.reason if rollout.outcome == "failure" else "") == reason


@pytest.mark.parametrize("name", ["tip_it_to_the_wrong_end", "tip_it_to_both_ends", "shake_it_level"])
def test_blind_tilts_and_shakes_fill_the_trap(name):
    assert play_shortcut(TASK, NOMINAL, name).reason == "the ball fell into the trap"


@pytest.mark.parametrize("first", [-1.0, 1.0])
def test_no_tilt_of_the_hand_brings_the_ball_out_of_the_trap(first):
    """Without the rule that ends the episode there: physics alone keeps it, for all that is done afterwards."""
    scenario = unguarded(BallCageEscape)()
    world, steep = load(TASK, scenario), MAX_HAND_TILT - 0.02
    wrong = NOMINAL.least_tilt
    rollout = play(
        TASK, scenario, lambda world: scenario.tip_only(world, -wrong, steep, first * steep, -first * steep), world
    )
    place = world.rot("cage").T @ (world.pos("ball") - world.pos("cage"))
    assert not rollout.solved and scenario.cage.traps(place, scenario.ball.radius)


def half_tipped_and_thrown(world):
    """Tip the cage half as far as the law asks for, then shake it without the teleoperation filter."""
    yield from NOMINAL.shortcuts()["shake_it_half_tipped"].plan(world)


def test_a_ball_that_is_shaken_over_the_sill_is_lost_and_only_the_rule_forbids_it():
    outcomes = []
    for scenario in (NOMINAL, unguarded(BallCageEscape)()):
        episode = Episode(scenario, world := load(TASK, scenario), TASK.horizon)
        for action in half_tipped_and_thrown(world):
            if episode.step(np.clip(action, -1.0, 1.0).astype(np.float32)):
                break
        while episode.outcome is None:
            episode.step(world.idle.astype(np.float32))
        outcomes.append(episode.reason or episode.outcome)
    assert outcomes == ["the ball was shaken over the sill", "success"]


@pytest.mark.parametrize("rate", [0.5, 1.0, 2.0])
def test_a_tilt_does_not_count_as_a_shake(rate):
    def lean_over(world):
        down = np.array([math.sin(NOMINAL.least_tilt + TILT_MARGIN), 0.0, -math.cos(NOMINAL.least_tilt + TILT_MARGIN)])
        yield from NOMINAL.pick_up(world)
        yield from NOMINAL.present(world, down)
        yield from NOMINAL.tip(world, down, rate)

    assert play(TASK, NOMINAL, lean_over).solved


def test_one_fixed_answer_is_right_in_half_of_the_draws():
    """A choice between two ends: a tilt in one fixed heading is a guess."""
    draws = [TASK.draw("id", 0, i).scenario for i in range(300)]
    right = [[draw.answer().right(value) for draw in draws] for value in NOMINAL.answer().candidates]
    assert max(map(np.mean, right)) <= 0.55 + 1.64 * math.sqrt(0.25 / 300)
    assert NOMINAL.answer().tries == 1


@pytest.mark.parametrize(("heading", "outcome"), [(0.0, "success"), (180.0, "failure")])
def test_a_guess_is_acted_upon(heading, outcome):
    answer = NOMINAL.answer()
    rollout = play(TASK, NOMINAL, lambda world: answer.act(world, heading))
    assert rollout.outcome == outcome and answer.right(heading) == rollout.solved


def test_without_the_hole_the_ball_is_still_in_the_cage_when_the_witness_has_ended():
    ((episode, world),) = ablated(TASK, NOMINAL).values()
    assert not episode.solved and not NOMINAL.out(world)


def test_a_cage_that_is_knocked_off_its_stool_is_lost():
    assert play_shortcut(TASK, NOMINAL, "knock_it_off_the_stool").reason == "the cage was dropped or set down"


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
        ("cage", [0.2, 0.0, TABLE_TOP - 1e-5], "the cage was dropped or set down"),
    ],
)
def test_a_ball_on_the_floor_and_a_cage_on_the_table_are_lost(body, place, reason):
    world = load(TASK, NOMINAL)
    assert NOMINAL.failure(world) is None
    put(world, body, place)
    assert NOMINAL.failure(world) == reason


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
    """To have the cage off its stool is enough."""

    def success(self, world):
        return not world.touching("cage", "stool") and world.pos("cage")[2] > self.foot[2] + 0.02


@dataclass(frozen=True, kw_only=True)
class Timid(BallCageEscape):
    """The oracle does not reckon with the sill."""

    def oracle(self, world):
        yield from self.tip_only(world, math.radians(30.0))


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
def test_what_makes_the_task_another_one_is_not_certified(scenario, check):
    not_certified(TASK, scenario, check)


def test_every_constraint_refutes_for_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            BallCageEscape(cage=HoledCage(hole=0.024)),
            BallCageEscape(cage=HoledCage(hole=0.0145)),
            BallCageEscape(cage=HoledCage(face=SIDE, offset=-0.005)),
            BallCageEscape(cage=HoledCage(face=TOP)),
            BallCageEscape(cage=HoledCage(sill=0.010)),
            BallCageEscape(ball_y=0.02),
            BallCageEscape(ball_x=0.01),
            BallCageEscape(cage=HoledCage(trap_sill=0.0005)),
            BallCageEscape(cage=HoledCage(sill=0.0012)),
            BallCageEscape(cage=HoledCage(trap_x=-0.031)),
            BallCageEscape(cage=HoledCage(trap=0.008)),
            BallCageEscape(cage=HoledCage(trap=0.018), stool=Stool(height=0.02)),
            BallCageEscape(stool_x=0.0),
            BallCageEscape(**TOPPLES),
            BallCageEscape(y=-0.33),
            BallCageEscape(x=0.268, y=0.268, stool=Stool(height=0.021)),
        ]
    )
