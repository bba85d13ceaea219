"""A rod stays upright on the ridge if its centre of mass is over it; the side of lead is seen."""

import math
from dataclasses import dataclass, replace
from functools import partial

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
    unchecked,
)
from rods import left_alone, on_ridge

from scengen import load_task
from scengen.assets.inlaid_rod import InlaidRod
from scengen.assets.ridge import Ridge
from scengen.episode import OTHERWISE, PAPER
from scengen.geometry import UP, about_z
from scengen.params import parameters
from scengen.predicates import rests_on
from scengen.skills.jaw import grasp, release
from scengen.tasks.balance import MAX_FALL_SPEED, MAX_TILT, RELEASE_TIME, RIDGE, UprightRod
from scengen.validate.rollout import AT_REST, run

MEDIUM, HARD = load_task("balance_medium"), load_task("balance_hard")
BOTH = pytest.mark.parametrize("task", [MEDIUM, HARD], ids=lambda task: task.name)
ROD = UprightRod()
NARROW = UprightRod(ridge=Ridge(width=0.008, height=0.05))
LOPSIDED = UprightRod(rod=InlaidRod(com=0.0085))
TIPPED = "the rod did not tip once let go"
DROPPED = "the rod was not dropped"
TOUCHED_AGAIN = "a rod that stood by itself was not touched again"
stood = partial(on_ridge, UprightRod)


# --- the law of the task ----------------------------------------------------------------


@pytest.mark.parametrize(("share", "balanced"), [(0.0, True), (-0.5, True), (0.5, True), (-1.1, False), (1.1, False)])
@pytest.mark.parametrize("com", [0.0, 0.008])
@BOTH
def test_the_rod_stays_up_if_its_centre_of_mass_is_over_the_ridge_and_is_lost_beyond(task, com, share, balanced):
    ridge = replace(task.draw("id", 0, 0).scenario.ridge, length=0.12)
    scenario = stood(share * ridge.width / 2, ridge=ridge, rod=InlaidRod(com=com))
    world = left_alone(MEDIUM, scenario, 2.0)
    assert scenario.success(world) == balanced
    assert missed(scenario, world, TIPPED) == (not balanced)


def test_a_ridge_is_as_wide_as_the_paper_says():
    assert {MEDIUM.draw("id", 0, i).scenario.ridge.width for i in range(5)} == {0.012}
    assert {HARD.draw("id", 0, i).scenario.ridge.width for i in range(5)} == {0.008}


@BOTH
def test_the_middle_of_the_foot_serves_in_training_and_not_off_centre(task):
    for index in range(20):
        training, shifted = (task.draw(split, 0, index).scenario for split in ("id", "off_centre"))
        assert abs(training.rod.com) < training.ridge.width / 2 < abs(shifted.rod.com)
        assert "by_the_middle_of_the_foot" not in training.shortcuts()
        assert "by_the_middle_of_the_foot" in shifted.shortcuts()
    assert play(task, task.draw("id", 0, 0).scenario, task.draw("id", 0, 0).scenario._by_the_foot).solved


def test_nothing_is_hidden():
    assert not any(p.hidden for p in parameters(ROD))


# --- ways around ------------------------------------------------------------------------


def under_the_rules_of_the_paper(plan, scenario=ROD):
    return run(scenario, load(MEDIUM, scenario), plan, MEDIUM.horizon, until_settled=True, rules=PAPER)


def test_a_foot_centred_on_the_ridge_does_not_serve_a_lopsided_rod_unless_the_lead_looks_along_the_ridge():
    world = load(MEDIUM, LOPSIDED)
    assert play_shortcut(MEDIUM, LOPSIDED, "by_the_middle_of_the_foot", world).reason == AT_REST
    assert missed(LOPSIDED, world, TIPPED)
    turned = UprightRod(rod=LOPSIDED.rod, rod_yaw=85.0)
    assert not turned.lopsided and play(MEDIUM, turned, turned._by_the_foot).solved


@dataclass(frozen=True, kw_only=True)
class Lenient(UprightRod):
    """The goal is an upright rod that touches the ridge, and nothing else."""

    def success(self, world):
        return world.tilt("rod") <= MAX_TILT and world.touching("rod", RIDGE)


def test_held_it_is_upright_on_the_ridge_and_does_not_count():
    assert under_the_rules_of_the_paper(ROD._hold, Lenient()).solved
    assert not play_shortcut(MEDIUM, ROD, "hold_it_there").solved


def test_a_rod_that_is_dropped_does_not_count_though_it_may_stay_up():
    assert under_the_rules_of_the_paper(ROD._drop).solved
    ended = play_shortcut(MEDIUM, ROD, "drop_it_from_above")
    assert ended.reason.startswith(OTHERWISE) and DROPPED in ended.reason
    assert MAX_FALL_SPEED**2 / (2 * 9.81) > 0.006


def again(world):
    """Open the jaw on the ridge, close it, and open it once more."""
    yield from ROD.lift(world)
    yield from ROD.bring(world, ROD.rod.com)
    yield from ROD._set_down(world)
    yield from release(world.arm, 0.3)
    yield from grasp(world.arm)
    yield from ROD.leave(world)


def test_a_rod_that_stood_on_the_ridge_may_not_be_touched_again():
    assert under_the_rules_of_the_paper(again).solved
    reason = play(MEDIUM, ROD, again).reason
    assert reason.startswith(OTHERWISE) and TOUCHED_AGAIN in reason
    assert RELEASE_TIME < math.sqrt(2 * ROD.rod.height / (3 * 9.81)), "less than the time constant of its fall"


def test_let_go_in_motion_it_falls():
    world = load(MEDIUM, ROD)
    assert play_shortcut(MEDIUM, ROD, "let_go_in_motion", world).reason == AT_REST
    assert missed(ROD, world, TIPPED)


def test_without_ridge_or_with_the_lead_on_the_other_side_the_witness_balances_nothing():
    ends = ablated(MEDIUM, LOPSIDED)
    assert set(ends) == {"no_ridge", "lead_on_the_other_side"} and not any(end.solved for end, _ in ends.values())
    assert set(ROD.ablations()) == {"no_ridge"}


@pytest.mark.parametrize("split", ["off_centre", "long_rod", "short_rod", "high_ridge"])
@BOTH
def test_memorised_actions_are_lost_where_rod_and_ridge_are_others(task, split):
    trained, other = (task.draw(which, 0, 1).scenario for which in ("id", split))
    assert not replayed(task, trained, other).solved


# --- the oracle ---------------------------------------------------------------------------


def test_the_oracle_puts_the_centre_of_mass_over_the_ridge():
    world = load(MEDIUM, LOPSIDED)
    assert play(MEDIUM, LOPSIDED, LOPSIDED.oracle, world).solved
    assert abs((world.com("rod") - LOPSIDED.top) @ LOPSIDED.normal) < 0.002
    assert abs((world.pos("rod") - LOPSIDED.top) @ LOPSIDED.normal) > 0.006
    assert rests_on(world, "rod", RIDGE)


@pytest.mark.parametrize("relative", [-80.0, -50.0, -40.0, 0.0, 40.0, 50.0, 80.0])
def test_the_rod_is_turned_by_less_than_an_eighth(relative):
    scenario = UprightRod(rod_yaw=0.4 * relative, ridge_yaw=-0.6 * relative)
    world = load(MEDIUM, scenario)
    rod, aligned = world.rot("rod"), scenario.aligned(world)
    assert np.allclose(aligned[:, 2], UP) and rod[:, 0] @ aligned[:, 0] >= math.cos(math.pi / 4) - 1e-9
    along = about_z(math.radians(scenario.ridge_yaw))[:, 0]
    assert max(abs(along @ aligned[:, k]) for k in (0, 1)) == pytest.approx(1.0)


# --- scenes that must not be certified --------------------------------------------------


def test_what_is_refuted_is_refuted_for_reasons_of_its_own():
    each_refuted_for_its_own_reason(
        [
            replace(ROD, rod=InlaidRod(com=0.012)),
            replace(ROD, rod_y=0.395),
            replace(ROD, rod=InlaidRod(width=0.014), ridge=Ridge(width=0.02)),
            replace(ROD, rod_x=0.0, rod_y=-0.06),
            replace(ROD, rod=InlaidRod(friction=0.05, height=0.40, com=0.0095)),
            replace(ROD, ridge_x=0.33, ridge_y=-0.33, rod=InlaidRod(height=0.40)),
        ]
    )


def test_a_lopsided_rod_of_training_would_be_solved_by_its_foot():
    easy = unchecked(type("Blind", (UprightRod,), {"lopsided": True}))(rod=InlaidRod(com=0.002))
    not_certified(MEDIUM, easy, "shortcuts", "by_the_middle_of_the_foot")


def test_the_rod_starts_upright_on_the_table():
    world = left_alone(MEDIUM, LOPSIDED, 2.0)
    assert rests_on(world, "rod", "table") or world.touching_bodies("rod") == {"table"}
    assert world.tilt("rod") < 1e-3
