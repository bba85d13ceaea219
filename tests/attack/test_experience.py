"""What the adversary knows from training: solutions by heart, carried by a body, and how long waits last."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from scengen.attack.adversary import CLOCK, MEMORY, Attack
from scengen.attack.campaign import AttackJob, drawn, player_of
from scengen.attack.clock import timed
from scengen.attack.experience import Experience, experience
from scengen.attack.memories import BEARING, PARTS, PLACE, POSE, candidates, carried
from scengen.attack.phases import by_the_clock
from scengen.compose import load_task
from scengen.geometry import about_z
from scengen.robots import panda
from scengen.validate.rebuilt import world_of
from scengen.validate.rollout import run

TASK = load_task("mirror_pick_place")


@pytest.fixture(scope="module")
def subjects():
    return drawn(TASK, "id", 2, 11)


@pytest.fixture(scope="module")
def player(subjects):
    return player_of(subjects[0])


@pytest.fixture(scope="module")
def memories(player):
    return {memory.way: memory for memory in candidates(player.scenario, player.world, player.trace, 0)}


def solved(subject, memory):
    scenario = subject.scenario
    return run(scenario, world_of(scenario, TASK.embodiment), memory.follow, TASK.horizon, raw=True).solved


@pytest.mark.parametrize("way", [PARTS, POSE, PLACE, BEARING])
def test_a_memory_solves_its_own_scenario_in_each_way(subjects, memories, way):
    assert solved(subjects[0], memories[way])


@pytest.mark.parametrize("way", [POSE, PLACE, BEARING])
def test_a_memory_of_a_body_that_another_scene_lacks_solves_nothing(subjects, memories, way):
    """Some tasks have more bodies in one scenario than in another."""
    assert not solved(subjects[0], replace(memories[way], body="shape_3"))


def test_a_path_is_turned_about_a_point_and_moved_with_it(memories):
    solution, turn, here = memories[POSE].solution, about_z(math.pi / 2), np.array([0.1, 0.2, 0.3])
    (before,), (after,) = solution.paths, carried(solution, turn, panda.BASE, panda.BASE + here).paths
    assert np.allclose(after.hands - panda.BASE - here, (before.hands - panda.BASE) @ turn.T)
    assert np.allclose(after.actions[:, 0], -before.actions[:, 1]) and np.array_equal(
        after.actions[:, 6], before.actions[:, 6]
    )


def test_the_best_memory_is_measured_on_the_attacked_scenarios(subjects, memories):
    known = Experience((memories[PARTS],))
    for number, subject in enumerate(subjects):
        (filtered, raw) = AttackJob(tuple(subjects), 4, 0, (MEMORY,), (), known=known)(number).rates
        assert (filtered.tier, raw.tier, raw.rollouts) == ("memory_1", "memory_1", 1)
        assert bool(raw.hits) == solved(subject, memories[PARTS])


def test_tiers_that_know_nothing_from_training_make_no_draws(monkeypatch):
    monkeypatch.setattr("scengen.attack.experience.feasible", lambda *_: pytest.fail("draws were made"))
    assert experience(TASK, 1, ("random", "servo")) == Experience()


# --- the clock --------------------------------------------------------------------------------------------------------


def test_waits_are_pauses_of_all_hands(player):
    waits = player.trace.waits
    assert waits and all(end - begin >= 20 for begin, end in waits)
    assert all(one[1] < other[0] for one, other in pairwise(waits))
    steps = np.linalg.norm(np.diff(player.trace.hands[:, 0], axis=0), axis=1)
    assert all(steps[begin:end].max() < 2.1e-4 for begin, end in waits)


def test_a_wait_lasts_as_long_as_asked(player):
    own = [(end - begin) * 0.01 for begin, end in player.trace.waits]
    longer = [own[0] + 0.5, *own[1:]]
    player.rewind()
    count = 0
    for action in by_the_clock(player.world, player.trace, longer):
        player.world.step_filtered(np.asarray(action, np.float32))
        count += 1
    assert 0.45 <= 0.01 * (count - len(player.trace.actions)) <= 1.5  # the hand may be brought back to its path


def test_the_clock_is_tried_only_where_waits_vary(player):
    own = tuple((end - begin) * 0.01 for begin, end in player.trace.waits)
    player.durations = [own] * 4
    assert not list(timed(player))
    player.durations = [own, own, (own[0] + 1.0, *own[1:])]
    assert [attempt.tier for attempt in timed(player)] == [CLOCK] * 3
    middle = next(timed(player)).macros[0].numbers
    assert middle == pytest.approx(own)
    assert Attack(player, seed=0).run(2, (CLOCK,)).rates[0].hits


def test_other_numbers_of_waits_say_nothing(player):
    own = tuple((end - begin) * 0.01 for begin, end in player.trace.waits)
    player.durations = [(*own, 1.0), (*own, 2.0), (*own, 3.0)]
    assert not list(timed(player))
    player.durations = replace(Experience(), durations=((1.0,),)).durations
    assert not list(timed(player))
