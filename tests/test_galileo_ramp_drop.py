"""The height of release decides, nothing else does, and what is no fair problem gets no certificate."""

from dataclasses import dataclass

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
from scengen.validate.level import Level
from scengen.validate.rollout import replay, run

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


def test_a_ball_that_only_crosses_the_patch_never_counts():
    """It touches the patch on its way, which is the goal but for its duration."""
    scenario, seen = GalileoRampDrop(), []
    goal, w = GalileoRampDrop.success, world(scenario)

    @dataclass(frozen=True, kw_only=True)
    class Watched(GalileoRampDrop):
        def success(self, world):
            seen.append(goal(self, world))
            return seen[-1]

    episode = run(Watched(), w, scenario.shortcuts()["as high as possible"], TASK.horizon)
    assert any(seen) and episode.outcome == "failure"


def test_the_ball_may_be_touched_on_the_near_side_and_not_on_the_far_side():
    scenario = GalileoRampDrop()
    near, far = (play(scenario, scenario.shortcuts()[n]) for n in ("half as high", "carry it to the patch"))
    assert near.outcome == "timeout"
    assert far.reason == "the robot touched the ball beyond the middle of the ramp"


@pytest.mark.parametrize(("split", "solved"), [("light_ball", True), ("high_patch", False), ("rubbing", False)])
def test_a_memorised_release_serves_a_ball_of_another_weight_and_nothing_else(split, solved):
    trained, moved = (TASK.draw(name, 0, 2).scenario for name in ("id", split))
    tape = run(trained, world(trained), trained.oracle, TASK.horizon).tape
    assert replay(moved, world(moved), tape, TASK.horizon, until_settled=True).solved == solved


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

    def without(self):
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
    certificate = certify(scenario, TASK.horizon, Level(), TASK.embodiment).certificate
    assert (certificate.verdict, certificate.failed.name) == (verdict, check), certificate.reason


def test_without_one_of_the_inclines_the_witness_misses_the_patch():
    scenario = GalileoRampDrop()
    tape = play(scenario, scenario.oracle).tape
    for scene in scenario.without().values():
        maimed = World.load(scene_text.emit(scene)[0], TASK.embodiment)
        assert not replay(scenario, maimed, tape, TASK.horizon, until_settled=True).solved
        assert not maimed.touched("ball", "ramp/patch")


@given(ramp=anywhere(Ramp), radius=st.floats(0.008, 0.035), heading=st.floats(-180.0, 180.0))
@settings(max_examples=40, deadline=None)
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_can_be_built(ramp, radius, heading):
    scenario = with_values(GalileoRampDrop(ramp=ramp), {"ball.radius": radius, "heading": heading})
    refutation = scenario.infeasible()
    if refutation is None:
        scenario.build().compile()
    else:
        assert refutation.reason and refutation.numbers
