"""The height of release decides, nothing else does, and what is no fair problem gets no certificate."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import config
from scengen.assets.ball import Ball
from scengen.assets.ramp import Ramp
from scengen.params import with_values
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.tasks.galileo_ramp_drop import GalileoRampDrop
from scengen.validate.certify import certify
from scengen.validate.rollout import replay, run
from scengen.validate.settings import CertifySettings

TASK = config.task("galileo_ramp_drop")


def world(scenario):
    return World.load(scene_text.emit(scenario.build())[0], TASK.embodiment)


def play(scenario, plan):
    return run(scenario, world(scenario), plan, TASK.horizon, until_settled=True)


def let_go_at(scenario, height):
    """The oracle with another height of release [m]."""
    return play(scenario, lambda w: scenario.let_go(w, -scenario.ramp.at_height(height)))


# --- the law of the task ----------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.0, 0.05])
def test_one_patch_higher_goes_past_it_and_one_patch_lower_falls_short(friction):
    scenario = GalileoRampDrop(ramp=Ramp(friction=friction))
    right, band = scenario.ramp.height(scenario.start), scenario.ramp.band
    assert let_go_at(scenario, right).outcome == "success"
    assert let_go_at(scenario, right + 1.3 * band).reason == "the ball went past the patch"
    assert let_go_at(scenario, right - 1.3 * band).outcome == "timeout"


@pytest.mark.parametrize("angle", [14.0, 24.0, 38.0])
def test_without_friction_the_height_of_release_is_that_of_the_patch(angle):
    ramp = Ramp(angle=angle)
    scenario = GalileoRampDrop(ramp=ramp)
    assert ramp.height(scenario.start) == pytest.approx(ramp.level * ramp.height(ramp.top), rel=0.02)


def test_where_the_ball_slips_and_rolls_equal_heights_fall_short():
    scenario = TASK.draw("rubbing", 0, 0).scenario
    episode = play(scenario, scenario.shortcuts()["as high as the patch"])
    assert episode.outcome == "timeout"


@dataclass(frozen=True, kw_only=True)
class Watched(GalileoRampDrop):
    """Remembers, from period to period, whether the goal held, and how fast the ball was beyond the patch's edge."""

    seen: list[bool] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)

    def success(self, world):
        edge = (self.resting(self.ramp.patch[0]) - self.middle) @ self.frame[:, 0]
        if self.along(world) > edge:
            self.speeds.append(float(np.linalg.norm(world.velocity("ball")[3:])))
        self.seen.append(super().success(world))
        return self.seen[-1]


def test_a_ball_that_only_crosses_the_patch_never_counts():
    """It touches the patch on its way, which is the goal but for its duration."""
    scenario = Watched()
    episode = play(scenario, scenario.shortcuts()["as high as possible"])
    assert any(scenario.seen) and episode.outcome == "failure"


@pytest.mark.parametrize(("angle", "friction"), [(14.0, 0.0), (24.0, 0.0), (38.0, 0.0), (24.0, 0.4)])
def test_the_ball_arrives_on_the_patch_at_the_speed_of_the_closed_form_and_turns_back_there(angle, friction):
    """Aimed at the middle of the patch: sqrt(g band) at its lower edge if it slides, zero where it turns back."""
    scenario = Watched(ramp=Ramp(angle=angle, friction=friction, band=0.006))
    assert play(scenario, scenario.oracle).solved
    arrival = math.sqrt(9.81 * 0.006) * math.sqrt(5 / 7 if friction else 1.0)
    assert 0.5 * arrival < scenario.speeds[0] < 1.35 * arrival < scenario.ramp.arrival
    assert min(scenario.speeds) < 0.06


def test_the_ball_may_be_touched_on_the_near_side_and_not_on_the_far_side():
    scenario = GalileoRampDrop()
    near, far = (play(scenario, scenario.shortcuts()[n]) for n in ("half as high", "carry it to the patch"))
    assert near.outcome == "timeout"
    assert far.reason == "the robot touched the ball beyond the middle of the ramp"


@pytest.mark.parametrize(("split", "solved"), [("light_ball", True), ("high_patch", False), ("rubbing", False)])
def test_a_memorised_release_serves_a_ball_of_another_weight_and_nothing_else(split, solved):
    trained, moved = (TASK.draw(name, 0, 2).scenario for name in ("id", split))
    assert isinstance(trained, GalileoRampDrop)
    actions = run(trained, world(trained), trained.oracle, TASK.horizon).actions
    assert replay(moved, world(moved), actions, TASK.horizon, until_settled=True).solved == solved


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Portable(GalileoRampDrop):
    """The ball may be carried across."""

    def failure(self, world):
        return None


@dataclass(frozen=True, kw_only=True)
class LetGoBefore(GalileoRampDrop):
    """The ball lies at the right height from the beginning."""

    MOVING = ("ball",)

    def build(self):
        scene = super().build()
        scene.body("ball").pos = self.resting(self.start) - self.tray
        return scene


@dataclass(frozen=True, kw_only=True)
class Spared(GalileoRampDrop):
    """What is taken away is not needed."""

    def ablations(self):
        scene = self.build()
        scene.delete(scene.geom("tray_3"))
        return {"no tray wall": scene}


@dataclass(frozen=True, kw_only=True)
class Misjudged(GalileoRampDrop):
    """The oracle does not reckon with friction."""

    def oracle(self, world):
        yield from self.let_go(world, -self.ramp.at_height(self.ramp.level * self.ramp.height(self.ramp.top)))


@pytest.mark.parametrize(
    ("scenario", "check", "verdict"),
    [
        (GalileoRampDrop(ramp=Ramp(level=0.97)), "feasible", "refuted"),
        (GalileoRampDrop(ramp=Ramp(level=0.75, friction=0.08)), "feasible", "refuted"),
        (GalileoRampDrop(ramp=Ramp(level=0.7, band=0.04)), "feasible", "refuted"),
        (GalileoRampDrop(ramp=Ramp(angle=55.0, level=0.4)), "feasible", "refuted"),
        (GalileoRampDrop(ramp=Ramp(width=0.12)), "feasible", "refuted"),
        (GalileoRampDrop(ball=Ball(radius=0.011)), "feasible", "refuted"),
        (GalileoRampDrop(y=0.2), "feasible", "refuted"),
        (LetGoBefore(), "unsolved", "refuted"),
        (Portable(), "shortcuts", "refuted"),
        (Misjudged(ramp=Ramp(friction=0.045)), "solved", "unknown"),
        (Spared(), "necessity", "refuted"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, GalileoRampDrop) else str(value),
)
def test_what_is_no_fair_problem_is_not_certified(scenario, check, verdict):
    certificate = certify(scenario, TASK.horizon, CertifySettings(), TASK.embodiment).certificate
    failed = certificate.failed
    assert failed and (certificate.verdict, failed.name) == (verdict, check), certificate.reason


def test_without_the_near_incline_the_witness_drops_the_ball_and_without_the_far_one_it_runs_across_the_patch():
    scenario = GalileoRampDrop()
    actions = play(scenario, scenario.oracle).actions
    ends = {}
    for name, scene in scenario.ablations().items():
        maimed = World.load(scene_text.emit(scene)[0], TASK.embodiment)
        episode = replay(scenario, maimed, actions, TASK.horizon, until_settled=True)
        ends[name] = episode.outcome, maimed.touched("ball", "ramp/patch")
    assert ends == {"no near incline": ("timeout", False), "no far incline": ("failure", True)}


@given(ramp=anywhere(Ramp), radius=st.floats(0.008, 0.035), heading=st.floats(-180.0, 180.0))
@settings(max_examples=40, deadline=None)
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_can_be_built(ramp, radius, heading):
    scenario = with_values(GalileoRampDrop(ramp=ramp), {"ball.radius": radius, "heading": heading})
    refutation = scenario.infeasible()
    if refutation is None:
        scenario.build().compile()
    else:
        assert refutation.reason and refutation.numbers
