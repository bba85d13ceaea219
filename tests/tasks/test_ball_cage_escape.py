"""The ball leaves once the stool is gone and the sill is low, and what is no fair problem gets no certificate."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen import config
from scengen.assets.ball import Ball
from scengen.assets.cage import SIDE, TOP, HoledCage
from scengen.assets.prop import TABLE_TOP
from scengen.assets.stool import Stool
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.tasks.ball_cage_escape import STILL, BallCageEscape
from scengen.validate.certify import certify
from scengen.validate.rollout import replay, run
from scengen.validate.settings import CertifySettings, Robust

TASK = config.task("ball_cage_escape")
ONE_JITTER = CertifySettings(robust=Robust(runs=1, bound=0.01))
"""One jittered run, where certificates ask for more: what is tested here are the other checks."""


def world(scenario, scene=None):
    return World.load(scene_text.emit(scene or scenario.build())[0], TASK.embodiment)


def play(scenario, plan):
    return run(scenario, world(scenario), plan, TASK.horizon, until_settled=True)


# --- what keeps the ball in -------------------------------------------------------------


@pytest.mark.parametrize(("more", "outcome"), [(-6.0, "timeout"), (13.0, "success")])
@pytest.mark.parametrize("sill", [0.003, 0.006])
def test_the_ball_stays_behind_the_sill_below_the_angle_and_leaves_above_it(sill, more, outcome):
    """36.9 and 53.1 deg; a held cage gives up to 5 deg."""
    scenario = BallCageEscape(cage=HoledCage(sill=sill))
    tilt = scenario.least_tilt + math.radians(more)
    assert play(scenario, lambda w: scenario._tip_only(w, tilt)).outcome == outcome


def test_without_the_hole_the_ball_is_still_in_the_cage_when_the_witness_has_ended():
    scenario = BallCageEscape()
    actions = play(scenario, scenario.oracle).actions
    (scene,) = scenario.ablations().values()
    stopped = world(scenario, scene)
    assert not replay(scenario, stopped, actions, TASK.horizon, until_settled=True).solved
    assert not scenario.out(stopped)


def test_a_cage_that_is_knocked_off_its_stool_is_lost():
    scenario = BallCageEscape()
    episode = play(scenario, scenario.shortcuts()["knock it off the stool"])
    assert episode.reason == "the cage was dropped or set down"


@pytest.mark.parametrize("name", ["lift it off the stool", "tip it half as far", "tip it to the wrong end"])
def test_half_of_the_plan_leaves_the_ball_in_the_lifted_cage(name):
    scenario = BallCageEscape()
    w = world(scenario)
    episode = run(scenario, w, scenario.shortcuts()[name], TASK.horizon, until_settled=True)
    assert episode.outcome == "timeout" and not scenario.out(w)
    assert not w.touching("cage", "stool")


@pytest.mark.parametrize("split", list(TASK.axes))
def test_a_memorised_motion_serves_no_other_cage_and_no_other_stool(split):
    trained, moved = (TASK.draw(name, 0, 0).scenario for name in ("id", split))
    actions = play(trained, trained.oracle).actions
    assert not replay(moved, world(moved), actions, TASK.horizon, until_settled=True).solved


# --- goal and failure -------------------------------------------------------------------


def put(w, body, pos, velocity=0.0):
    """Set a body down somewhere, turned as it is, moving along x, and look at it one period later."""
    joint = w.data.joint(f"{body}_free")
    joint.qpos[:3], joint.qvel[:] = pos, [velocity, 0, 0, 0, 0, 0]
    mujoco.mj_forward(w.model, w.data)
    w.step(np.array([0.0, 0, 0, 0, 0, 0, -1.0]))


@pytest.mark.parametrize(
    ("x", "height", "velocity", "counts"),
    [
        (0.2, TABLE_TOP, 0.0, True),
        (0.2, TABLE_TOP, 3 * STILL, False),
        (0.2, TABLE_TOP + 0.05, 0.0, False),
        (-0.08 + 0.0195, TABLE_TOP + 0.08 + 0.05, 0.0, False),
    ],
    ids=["lies on the table", "rolls on the table", "falls", "lies on the cage"],
)
def test_only_a_ball_that_lies_on_the_table_counts(x, height, velocity, counts):
    scenario = BallCageEscape()
    w = world(scenario)
    put(w, "ball", [x, 0.0, height + scenario.ball.radius - 1e-5], velocity)
    assert scenario.success(w) == counts


@pytest.mark.parametrize(("beyond", "is_out"), [(-0.001, False), (0.001, True)])
def test_the_ball_is_out_when_all_of_it_is(beyond, is_out):
    scenario = BallCageEscape()
    w = world(scenario)
    below = w.pos("cage") - [0, 0, scenario.ball.radius + beyond]
    w.data.joint("ball_free").qpos[:3] = below + w.rot("cage") @ [scenario.cage.offset, 0, 0]
    mujoco.mj_forward(w.model, w.data)
    assert scenario.out(w) == is_out


def test_a_ball_on_the_floor_and_a_cage_on_the_table_are_lost():
    scenario = BallCageEscape()
    for body, place, reason in (
        ("ball", [0.5, 0.0, 0.3], "the ball fell off the table"),
        ("cage", [0.2, 0.0, TABLE_TOP - 1e-5], "the cage was dropped or set down"),
    ):
        w = world(scenario)
        assert scenario.failure(w) is None
        put(w, body, place)
        assert scenario.failure(w) == reason


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Unguarded(BallCageEscape):
    """Nobody calculates beforehand."""

    def infeasible(self):
        return None


@dataclass(frozen=True, kw_only=True)
class Outside(BallCageEscape):
    """The ball lies beside the stool from the beginning."""

    def build(self):
        scene = super().build()
        start = self.foot + np.array([self.ball_x, self.ball_y, self.cage.wall + self.ball.radius])
        scene.body("ball").pos = [0.2, 0.0, TABLE_TOP + self.ball.radius] - start
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
        yield from self._tip_only(world, math.radians(30.0))


@dataclass(frozen=True, kw_only=True)
class Spared(BallCageEscape):
    """What is taken away is not needed."""

    def ablations(self):
        scene = self.build()
        scene.delete(scene.lights[0])
        return {"less light": scene}


REFUTED = [
    BallCageEscape(cage=HoledCage(hole=0.024)),
    BallCageEscape(cage=HoledCage(hole=0.0145)),
    BallCageEscape(cage=HoledCage(face=SIDE, offset=-0.02)),
    BallCageEscape(cage=HoledCage(face=TOP)),
    BallCageEscape(cage=HoledCage(sill=0.010)),
    BallCageEscape(ball_y=0.02),
    BallCageEscape(ball_x=0.01),
    BallCageEscape(cage=HoledCage(sill=0.0005)),
    BallCageEscape(stool_x=0.0),
    BallCageEscape(stool_x=0.045, stool=Stool(length=0.080), cage=HoledCage(face=SIDE)),
    BallCageEscape(y=-0.33),
    BallCageEscape(x=0.268, y=0.268, stool=Stool(height=0.02)),
]


def test_every_refutation_has_its_own_reason():
    reasons = [s.infeasible().reason for s in REFUTED]
    assert len(set(reasons)) == len(REFUTED), reasons


@pytest.mark.parametrize(
    ("scenario", "check", "verdict"),
    [
        *[(scenario, "feasible", "refuted") for scenario in REFUTED],
        (Unguarded(stool_x=0.045, stool=Stool(length=0.080), cage=HoledCage(face=SIDE)), "rest", "refuted"),
        (Unguarded(ball=Ball(radius=0.018, density=1400.0)), "solved", "unknown"),
        (Outside(), "unsolved", "refuted"),
        (Lifted(), "shortcuts", "refuted"),
        (Timid(), "solved", "unknown"),
        (Spared(), "necessity", "refuted"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BallCageEscape) else str(value),
)
def test_what_is_no_fair_problem_is_not_certified(scenario, check, verdict):
    certificate = certify(scenario, TASK.horizon, ONE_JITTER, TASK.embodiment).certificate
    assert certificate.failed, "certified"
    assert (certificate.verdict, certificate.failed.name) == (verdict, check), certificate.reason


@given(scenario=anywhere(BallCageEscape))
@settings(max_examples=60, deadline=None)
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_can_be_built(scenario):
    refutation = scenario.infeasible()
    if refutation is None:
        scenario.build().compile()
    else:
        assert refutation.reason and all(math.isfinite(x) for x in refutation.numbers.values())
