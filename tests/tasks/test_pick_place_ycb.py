"""The square jumps as often and as far as it should, only who follows it is done, and what is invalid is refuted."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from controls import (
    each_refuted_for_its_own_reason,
    load,
    mistaken,
    not_certified,
    play,
    play_shortcut,
    replayed,
    unchecked,
)

from scengen import load_task
from scengen.assets.ycb import Ycb
from scengen.episode import Episode
from scengen.skills.grip import take
from scengen.skills.motion import CLOSED, steer
from scengen.tasks.pick_place_ycb import CARRY_HEIGHT, FIELD, JUMP_MARGIN, MIN_LIFT, Jump, PickPlaceYcb

TASK = load_task("pick_place_ycb")
NOMINAL = PickPlaceYcb()


def watched(scenario, world):
    """Before every period of the oracle: how often the square has jumped, where it is, where the thing is."""
    episode, seen = Episode(scenario, world, TASK.horizon), []
    for action in scenario.oracle(world):
        seen.append((int(world.memory["jumps"]), world.pos("patch"), world.com("thing")))
        if episode.step(world.filter(action)) is not None:
            break
    return seen


@pytest.fixture(scope="module")
def history():
    return watched(NOMINAL, load(TASK, NOMINAL))


@pytest.fixture(scope="module")
def solved():
    """The world after the oracle has solved the nominal scenario."""
    w = load(TASK, NOMINAL)
    assert play(TASK, NOMINAL, NOMINAL.oracle, w).solved
    return w


# --- the square ---------------------------------------------------------------------------


def test_it_jumps_from_place_to_place_when_the_thing_comes_near_and_not_before(history):
    places = [[place for jumps, place, _ in history if jumps == k] for k in range(NOMINAL.jumps + 1)]
    assert all(
        len(found) and (np.array(found) == spot).all() for found, spot in zip(places, NOMINAL.spots, strict=True)
    )
    for before, after in pairwise(history):
        away = math.dist(before[2][:2], before[1][:2])
        assert (after[0] > before[0]) == (before[0] < NOMINAL.jumps and away <= NOMINAL.near)


@pytest.mark.parametrize("jumps", [0, 1, 4])
def test_a_straight_approach_each_time_makes_as_many_jumps_as_there_are(jumps):
    scenario = replace(NOMINAL, jumps=jumps)
    world = load(TASK, scenario)
    assert play(TASK, scenario, scenario.oracle, world).solved
    assert world.memory["jumps"] == jumps and world.pos("patch") == pytest.approx(scenario.spots[-1])


def test_its_dark_side_is_up_when_it_is_locked_and_only_then(history):
    for jumps in (0, 2):
        scenario = replace(NOMINAL, jumps=jumps)
        assert load(TASK, scenario).tilt("patch") == pytest.approx(0.0 if jumps else math.pi)
    world = load(TASK, NOMINAL)
    sides = {}
    episode = Episode(NOMINAL, world)
    for action in NOMINAL.oracle(world):
        episode.step(world.filter(action))
        sides.setdefault(int(world.memory["jumps"]), set()).add(round(world.tilt("patch"), 6))
    assert sides == {0: {0.0}, 1: {0.0}, 2: {round(math.pi, 6)}}


def test_it_jumps_the_way_that_is_given_to_places_on_the_field_and_never_near_the_thing():
    for split in ("id", "more_jumps", "far_jumps"):
        for index in range(20):
            scenario = TASK.draw(split, 0, index).scenario
            spots = np.array(scenario.spots)
            ways = np.linalg.norm(np.diff(spots, axis=0), axis=1)
            assert ways == pytest.approx([jump.way for jump in scenario.planned])
            assert (FIELD[:, 0] <= spots[:, :2]).all() and (spots[:, :2] <= FIELD[:, 1]).all()
            assert (ways - scenario.near >= scenario.near + JUMP_MARGIN - 1e-12).all()


@pytest.mark.parametrize("share", [0.0, 0.3, 0.999])
def test_the_share_skips_directions_that_end_on_the_field(share):
    """Near the middle of the field a short jump may go anywhere: the share is one of the full turn."""
    scenario = replace(NOMINAL, goal_x=-0.085, goal_y=0.0, jumps=1, jump_0=Jump(way=0.1, share=share), near=0.02)
    along = scenario.spots[1] - scenario.spots[0]
    assert math.degrees(math.atan2(along[1], along[0])) % 360 == pytest.approx(math.floor(360 * share), abs=1e-6)


def test_it_does_not_move_for_what_was_never_lifted():
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, "drag_it_there", world).solved
    away = np.abs(world.com("thing") - world.pos("patch"))[:2].max()
    assert world.memory["jumps"] == world.memory["lifted"] == 0.0 and away < NOMINAL.patch.size / 2


def test_lifted_afterwards_it_drives_the_square_away():
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, "drag_it_there_and_lift_it", world).solved
    assert world.memory["jumps"] == world.memory["lifted"] == 1.0


@pytest.mark.parametrize(
    ("name", "jumps"), [("put_it_where_the_square_was", 1), ("follow_the_square_once", 2), ("put_it_down_short", 0)]
)
def test_a_plan_that_is_not_changed_again_leaves_the_thing_on_bare_table(name, jumps):
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, name, world).solved
    assert world.memory["jumps"] == jumps and math.dist(world.com("thing")[:2], world.pos("patch")[:2]) > NOMINAL.near


@pytest.mark.parametrize("split", ["more_jumps", "far_jumps", "late_jump"])
def test_a_memorised_motion_serves_no_other_course_of_the_square(split):
    trained, moved = (TASK.draw(name, 0, 1).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


def pursue(scenario, world):
    """Steer to where the square is now, whatever its colour, and put the thing down once it is over the square."""
    arm = world.arm
    yield from take(arm, "thing", lift=CARRY_HEIGHT)
    while math.hypot(*(left := world.pos("patch") - world.com("thing"))[:2]) > 0.01:
        velocity = 0.2 * min(1.0, math.hypot(*left[:2]) / 0.05) * left / math.hypot(*left[:2]) * [1.0, 1.0, 0.0]
        yield steer(arm, arm.hand + 0.02 * velocity, velocity, np.zeros(3), CLOSED)
    yield from scenario.set_down(world, world.pos("patch"))


@pytest.mark.parametrize("split", ["id", "more_jumps", "late_jump"])
def test_a_policy_that_pursues_the_square_needs_no_look_at_its_colour(split):
    scenario = TASK.draw(split, 0, 0).scenario
    assert play(TASK, scenario, lambda world: pursue(scenario, world)).solved


def test_a_memorised_motion_serves_no_other_training_scene():
    scenes = [TASK.draw("id", 0, index).scenario for index in range(3)]
    assert not any(replayed(TASK, one, other).solved for one in scenes for other in scenes if one is not other)


# --- goal and failure ---------------------------------------------------------------------


@pytest.mark.parametrize("lacks", ["lifted", "jumps"])
def test_a_thing_that_was_never_lifted_or_a_square_that_is_not_locked_does_not_count(solved, lacks):
    state = solved.state()
    assert NOMINAL.success(solved)
    with solved.events():
        solved.memory[lacks] = 0.0
    assert not NOMINAL.success(solved)
    solved.restore(state)


@pytest.mark.parametrize(("beyond", "counts"), [(-0.001, True), (0.001, False)])
def test_its_middle_must_be_on_the_square(solved, beyond, counts):
    state, touching = solved.state(), solved.loop.touching.copy()
    edge = solved.pos("patch")[0] + NOMINAL.patch.size / 2 + beyond
    solved.data.joint("thing_free").qpos[0] += edge - solved.com("thing")[0]
    solved.restore(solved.state())
    solved.loop.touching[:] = touching
    assert NOMINAL.success(solved) == counts
    solved.restore(state)


def test_a_thing_that_falls_off_the_table_is_lost(solved):
    state = solved.state()
    assert NOMINAL.failure(solved) is None
    solved.data.joint("thing_free").qpos[2] = 0.5
    solved.restore(solved.state())
    assert NOMINAL.failure(solved) == "the thing fell off the table"
    solved.restore(state)


@pytest.mark.parametrize(("height", "counts"), [(-0.001, False), (0.001, True)])
def test_a_lift_is_three_centimetres(height, counts):
    world = load(TASK, NOMINAL)
    with world.events():
        world.memory["stood"] = world.com("thing")[2]
    world.data.joint("thing_free").qpos[2] += MIN_LIFT + height
    world.restore(world.state())
    row = world.body("thing")
    world.loop.touching[row, -1] = world.loop.touching[-1, row] = 1  # the robot has the last row
    Episode(NOMINAL, world).begin()
    assert world.memory["lifted"] == float(counts)


# --- scenes that must not be certified ----------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Forgiving(PickPlaceYcb):
    """Where the square was at the start will do, by any means."""

    def success(self, world):
        return bool(
            np.abs(world.com("thing") - self.spots[0])[:2].max() < self.patch.size / 2 and not world.arm.grip > 0
        )

    def means(self):
        return {}


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (unchecked(PickPlaceYcb)(thing=Ycb(item=0)), "shortcuts", "no jaw can take it"),
        (Forgiving(), "shortcuts", "reaches the goal"),
        (mistaken(PickPlaceYcb, "put_it_where_the_square_was")(), "solved", "the oracle failed"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, PickPlaceYcb) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            PickPlaceYcb(thing=Ycb(item=0)),
            PickPlaceYcb(jump_0=Jump(way=0.6)),
            PickPlaceYcb(goal_x=0.2),
            PickPlaceYcb(near=0.12),
            PickPlaceYcb(goal_y=0.1),
            PickPlaceYcb(x=-0.35, y=0.35),
            PickPlaceYcb(x=0.319, y=0.3),
        ]
    )
