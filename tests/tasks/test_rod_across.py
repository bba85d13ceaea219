"""A rod stays on the ridge if its centre of mass is over it; the place is hidden, and the wrist can measure it."""

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
from scengen.assets.prop import TABLE_TOP
from scengen.assets.ridge import Ridge
from scengen.assets.rod import Rod
from scengen.attack.priors import fit
from scengen.look.looks import PLAIN
from scengen.params import parameters
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.tasks.rod_across import MAX_TILT, RodAcross
from scengen.validate.rollout import run

TASK = load_task("rod_across")
ROD = RodAcross()
TIPPED = "the rod did not tip once let go"
laid = partial(on_ridge, RodAcross)


# --- the law of the task ----------------------------------------------------------------


@pytest.mark.parametrize(("share", "balanced"), [(0.0, True), (-0.9, True), (0.9, True), (-1.1, False), (1.1, False)])
def test_the_goal_holds_if_the_centre_of_mass_is_over_the_ridge_and_beyond_its_edge_the_rod_tips(share, balanced):
    ridge = TASK.draw("id", 0, 0).scenario.ridge
    scenario = laid(share * ridge.width / 2, ridge=ridge)
    world = left_alone(TASK, scenario, 1.5)
    assert scenario.success(world) == balanced
    assert missed(scenario, world, TIPPED) != balanced


@pytest.mark.parametrize(("turned", "counts"), [(25.0, True), (35.0, False), (90.0, False)])
def test_a_rod_counts_only_if_it_crosses_the_ridge(turned, counts):
    scenario = laid(0.0, rod_yaw=turned, rod=Rod(com=0.0))
    assert scenario.success(left_alone(TASK, scenario, 1.5)) == counts


@pytest.mark.parametrize(("com", "mass"), [(0.085, 0.10), (0.04, 0.15), (-0.085, 0.15)])
def test_the_oracle_feels_the_centre_of_mass_to_a_millimetre_and_reads_it_nowhere(com, mass, monkeypatch):
    """With parameters of another rod, it does the same to the bit."""
    felt, lay = [], RodAcross.lay

    def watched(self, world, along, yaw=0.0):
        felt.append(along)
        yield from lay(self, world, along, yaw)

    monkeypatch.setattr(RodAcross, "lay", watched)
    scenario = replace(ROD, rod=Rod(com=com, mass=mass))
    misled = replace(scenario, rod=Rod(com=-0.03, mass=0.12))
    rollout = play(TASK, scenario, misled.oracle)
    assert rollout.solved and felt == pytest.approx([com], abs=0.001)
    assert np.array_equal(rollout.actions, play(TASK, scenario, scenario.oracle).actions)


# --- what is hidden ---------------------------------------------------------------------


def test_scenes_that_differ_in_what_is_hidden_only_are_the_same_to_the_eye():
    """Only masses and what depends on them may differ in the compiled model: no size, colour, place, name or order."""
    rods = Rod(com=0.08, mass=0.10), Rod(com=-0.03, mass=0.15)
    worlds = [World.load(scene_text.emit(replace(ROD, rod=r).build())[0], look=PLAIN) for r in rods]
    a, b = (world.model for world in worlds)
    assert a.names == b.names and not (a.cam_mode.any() or a.light_mode.any()), "no camera follows a centre of mass"
    arrays = {name: (getattr(a, name), getattr(b, name)) for name in dir(a)}
    arrays = {name: both for name, both in arrays.items() if isinstance(both[0], np.ndarray)}
    differ = {n for n, (x, y) in arrays.items() if not np.array_equal(x, y, equal_nan=x.dtype.kind == "f")}
    weights = {"mass", "inertia", "ipos", "subtreemass", "invweight0", "M0", "poscom0"}
    bounds = {"bvh_aabb", "dof_length"}  # boxes and lengths for fast collisions, seen from the centre of mass
    assert {"body_mass", "body_ipos"} <= differ
    assert {name.partition("_")[2] for name in differ - bounds} <= weights, differ
    assert np.array_equal(worlds[0].data.qpos, worlds[1].data.qpos)


def test_what_the_rod_weighs_and_where_is_declared_hidden_and_independent_of_what_is_seen():
    assert {p.name for p in parameters(ROD) if p.hidden} == {"rod.mass", "rod.com"}
    drawn = [TASK.draw("id", 0, i).scenario for i in range(400)]
    hidden = np.array([[s.rod.com, s.rod.mass] for s in drawn])
    seen = np.array([[s.rod_x, s.rod_y, s.rod_yaw, s.ridge_x, s.ridge_y, s.ridge_yaw, s.ridge.height] for s in drawn])
    related = np.corrcoef(np.column_stack([hidden, seen]).T)[:2, 2:]
    assert np.abs(related).max() < 4 / math.sqrt(len(drawn))


def test_no_fixed_place_along_the_rod_balances_more_than_a_tenth_of_training():
    training, fresh = ([TASK.draw("id", seed, i).scenario for i in range(1000)] for seed in (1, 2))
    (prior,) = fit(training, fresh=fresh)
    assert 0.02 < prior.fresh <= 0.10


# --- ways around ------------------------------------------------------------------------


def test_a_rod_that_tipped_can_be_picked_up_again_and_therefore_it_must_not_tip():
    """Repeated attempts reach the goal, but not by one try."""
    scenario = replace(ROD, rod=Rod(com=0.05))
    world = load(TASK, scenario)
    assert not play_shortcut(TASK, scenario, "by_the_middle", world).solved and missed(scenario, world, TIPPED)

    def again(world):
        yield from scenario._lay(world, 0.0)
        yield from scenario._lay(world, scenario.rod.com)

    free = run(scenario, world, again, TASK.horizon, rules="paper")
    assert free.solved and TIPPED in free.lacks
    ended = play(TASK, scenario, again)
    assert ended.outcome == "failure" and TIPPED in ended.reason


@dataclass(frozen=True, kw_only=True)
class Lenient(RodAcross):
    """The goal is a level rod on the ridge and nothing else: it may be held, and lie along the ridge."""

    def success(self, world):
        return world.tilt("rod") <= MAX_TILT and world.touching("rod", "stand/ridge")

    def means(self):
        return {}


@pytest.mark.parametrize("name", ["hold_it_there", "along_the_ridge"])
def test_held_or_laid_along_the_ridge_it_is_level_and_does_not_count(name):
    assert play_shortcut(TASK, Lenient(), name).solved
    assert not play_shortcut(TASK, ROD, name).solved


def test_the_torque_alone_misleads_where_the_rod_is_not_a_common_one():
    scenario = replace(ROD, rod=Rod(com=0.085, mass=0.10))
    world = load(TASK, scenario)
    assert not play_shortcut(TASK, scenario, "by_the_torque_alone", world).solved and missed(scenario, world, TIPPED)
    assert "by_the_torque_alone" not in replace(ROD, rod=Rod(com=0.085, mass=0.125)).shortcuts()


def test_without_ridge_or_with_the_slug_elsewhere_the_witness_balances_nothing():
    ends = ablated(TASK, ROD)
    assert set(ends) == {"no_ridge", "slug_elsewhere"} and not any(end.solved for end, _ in ends.values())
    assert missed(ROD, ends["slug_elsewhere"][1], TIPPED)


@pytest.mark.parametrize("split", ["turned", "high_ridge"])
def test_memorised_actions_are_lost_where_rod_and_ridge_are_others(split):
    trained, other = (TASK.draw(which, 0, 1).scenario for which in ("id", split))
    assert not replayed(TASK, trained, other).solved


# --- scenes that must not be certified --------------------------------------------------


def test_what_is_refuted_is_refuted_for_reasons_of_its_own():
    each_refuted_for_its_own_reason(
        [
            replace(ROD, rod=Rod(com=0.12)),
            replace(ROD, rod=Rod(com=0.01)),
            replace(ROD, ridge=Ridge(height=0.04)),
            replace(ROD, rod=Rod(com=0.09, mass=0.3)),
            replace(ROD, rod_y=0.3),
            replace(ROD, rod_x=-0.02),
            replace(ROD, ridge_x=0.3, ridge_y=0.3),
        ]
    )


def test_a_rod_that_balances_on_its_middle_would_be_solved_without_feeling():
    easy = unchecked(RodAcross)(rod=Rod(com=0.002))
    not_certified(TASK, easy, "shortcuts", "by_the_middle")


def test_a_rod_that_is_too_heavy_for_the_grip_hangs_and_is_refuted():
    """Where the constraint says that the pads hold it they do; with twice the torque they do not."""
    tilts = []
    for mass in (0.15, 0.35):
        scenario = replace(ROD, rod=Rod(com=0.09, mass=mass))
        world = load(TASK, scenario)
        for action in scenario.lift(world):
            world.step(action)
        tilts.append(world.tilt("rod"))
        assert (scenario.infeasible() is None) == (mass < 0.2)
    assert tilts[0] < math.radians(3.0) < MAX_TILT < tilts[1]


def test_the_rod_starts_on_the_table():
    assert load(TASK, ROD).pos("rod")[2] == pytest.approx(TABLE_TOP)
