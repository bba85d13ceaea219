"""What slips is lost, only who takes it up again brings it home, and an invalid scenario gets no certificate."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from controls import (
    each_refuted_for_its_own_reason,
    load,
    missed,
    mistaken,
    not_certified,
    play,
    play_shortcut,
    replayed,
    unchecked,
)

from scengen import load_task
from scengen.assets.prop import TABLE_TOP
from scengen.assets.ycb import Ycb
from scengen.control.loop import Loop
from scengen.episode import Episode
from scengen.geometry import UP
from scengen.robots.jaw import PALM_ABOVE, TIP_BELOW
from scengen.sim.arm import ROBOT
from scengen.skills.grip import extent, take
from scengen.skills.motion import go_to
from scengen.tasks.slip_recovery import (
    FALL_TIME,
    FLIGHT_DISTANCE,
    MAX_SLIDE,
    MIN_CARRY_HEIGHT,
    MIN_LIFT,
    Slip,
    SlipRecovery,
)

TASK = load_task("slip_recovery")
NOMINAL = SlipRecovery()
FELL = "the thing fell out of the hand"


def watched(scenario, plan, look, world=None):
    """What `look` sees of the world after every period of a plan, until the episode is decided."""
    world = world or load(TASK, scenario)
    episode, seen = Episode(scenario, world, TASK.horizon), []
    for action in plan(world):
        if episode.step(world.filter(action)) is not None:
            break
        seen.append(look(world))
    return seen


@pytest.fixture(scope="module")
def history():
    """The oracle in the nominal scenario: time, slips, place, whether it is held, tips above its top, jam."""

    def look(w):
        top = extent(w, "thing", UP)[1]
        held = w.touching(ROBOT, "thing")
        return w.time, w.memory["slips"], w.com("thing"), held, w.arm.hand[2] - TIP_BELOW - top, w.memory["jam_ends"]

    return watched(NOMINAL, NOMINAL.oracle, look)


# --- the slip -----------------------------------------------------------------------------


def test_it_slips_once_where_the_parameters_say(history):
    counts = [slips for _, slips, *_ in history]
    assert sorted(set(counts)) == [0.0, 1.0]
    at = counts.index(1.0)
    raised = next(i for i, row in enumerate(history) if row[2][2] - history[0][2][2] >= MIN_LIFT)
    come = math.dist(history[at][2][:2], history[raised][2][:2])
    assert come == pytest.approx(NOMINAL.distance(0), abs=0.006)  # two periods at 0.2 m/s, and one of raising


def test_what_slips_falls_freely_and_is_below_the_finger_tips_before_the_shortest_slip_ends(history):
    at = next(i for i, row in enumerate(history) if row[1] == 1.0)
    lost = history[at + round(FALL_TIME / Loop.PERIOD)]
    assert not lost[3] and lost[4] > 0.0
    times = np.array([row[0] for row in history[at + 4 : at + 9]])
    heights = np.array([row[2][2] for row in history[at + 4 : at + 9]])
    assert -2 * np.polyfit(times, heights, 2)[0] == pytest.approx(9.81, rel=0.03)


def test_carried_means_higher_than_a_jaw_can_hold_a_thing_under_its_top():
    assert MIN_LIFT > MIN_CARRY_HEIGHT > PALM_ABOVE + TIP_BELOW


def test_the_thing_flies_on_as_far_as_guesses_reckon(history):
    at = next(i for i, row in enumerate(history) if row[1] == 1.0)
    flown = math.dist(history[at + 40][2][:2], history[at][2][:2])
    assert flown == pytest.approx(FLIGHT_DISTANCE, abs=0.006)


@pytest.mark.parametrize("slips", [0, 2, 3])
def test_the_oracle_recovers_from_as_many_slips_as_there_are(slips):
    scenario = replace(NOMINAL, slips=slips, slip_0=Slip(share=0.2), slip_1=Slip(share=0.2), slip_2=Slip(share=0.2))
    world = load(TASK, scenario)
    rollout = play(replace(TASK, horizon=25.0), scenario, scenario.oracle, world)
    assert rollout.solved and world.memory["slips"] == slips


def test_who_knows_of_no_slip_or_of_one_does_not_cope_with_one_more():
    calm = replace(NOMINAL, slips=0)
    assert not replayed(TASK, calm, NOMINAL).solved
    assert not replayed(TASK, NOMINAL, replace(NOMINAL, slips=2)).solved


@pytest.mark.parametrize("split", ["late_slip", "long_window", "long_way", "turned_thing"])
def test_a_memorised_motion_serves_no_other_slip_place_or_pose(split):
    trained, moved = (TASK.draw(name, 0, 2).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


@pytest.mark.parametrize("off", [0.0, -0.05, 0.05])
def test_a_blind_guess_serves_who_guesses_right(off):
    answer = NOMINAL.answer()
    guess = NOMINAL.distance(0) + FLIGHT_DISTANCE + off
    assert answer.right(guess) == (off == 0.0)
    assert play(TASK, NOMINAL, lambda world: answer.act(world, guess)).solved == (off == 0.0)


# --- goal and failure ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def solved():
    """The world after the oracle has solved the nominal scenario."""
    w = load(TASK, NOMINAL)
    assert play(TASK, NOMINAL, NOMINAL.oracle, w).solved
    return w


@pytest.mark.parametrize("lacks", ["recovered", "slips"])
def test_a_thing_that_has_not_slipped_or_was_not_taken_up_again_is_not_placed(solved, lacks):
    state = solved.state()
    assert NOMINAL.success(solved)
    with solved.events():
        solved.memory[lacks] = 0.0
    assert not NOMINAL.success(solved)
    solved.restore(state)


@pytest.mark.parametrize(("beyond", "counts"), [(-0.001, True), (0.001, False)])
def test_its_middle_must_be_on_the_square(solved, beyond, counts):
    state = solved.state()
    edge = NOMINAL.goal[0] + NOMINAL.patch.size / 2 + beyond
    solved.data.joint("thing_free").qpos[0] += edge - solved.com("thing")[0]
    touching = solved.loop.touching.copy()
    solved.restore(np.concatenate([solved.state()]))
    solved.loop.touching[:] = touching
    assert NOMINAL.success(solved) == counts
    solved.restore(state)


@pytest.fixture(scope="module")
def held():
    """The world after the object has been lifted by 7 cm."""
    world = load(TASK, NOMINAL)
    for action in take(world.arm, "thing", lift=0.07):
        world.step(action)
    return world


@pytest.mark.parametrize(("lost", "kept"), [(0.0, True), (1.0, False)])
def test_a_thing_is_kept_if_the_hand_holds_it_that_has_not_lain_on_the_table(held, lost, kept):
    with held.events():
        held.memory["lost"] = lost
    assert NOMINAL.kept(held) == kept


def test_a_thing_that_the_hand_keeps_through_a_slip_did_not_fall_out_of_it(held, solved):
    """Negative control: the oracle's object has lain on the table before the shortest slip ends."""
    with held.events():
        held.memory["kept"] = 1.0
    assert missed(NOMINAL, held, FELL)
    assert solved.memory["lost"] and not solved.memory["kept"] and not missed(NOMINAL, solved, FELL)


@pytest.mark.parametrize("name", ["drag_it", "push_the_rest"])
def test_what_is_slid_is_lost(name):
    world = load(TASK, NOMINAL)
    ended = play_shortcut(TASK, NOMINAL, name, world)
    assert ended.outcome == "failure" and "slid" in ended.reason
    assert MAX_SLIDE < world.memory["slid"] < MAX_SLIDE + 0.01


def nudge(scenario, world):
    """Push the thing over the table little by little, and let go in between."""
    for _ in range(4):
        at = world.com("thing")
        beside = np.array([at[0], at[1] + 0.052 / 2 + 0.04, TABLE_TOP + 0.06])
        yield from go_to(world.arm, beside + 0.08 * UP, grip=1.0)
        yield from go_to(world.arm, beside)
        yield from go_to(world.arm, beside - 0.04 * np.array([0.0, 1.0, 0.0]))


def test_pushes_add_up():
    world = load(TASK, NOMINAL)
    ended = play(TASK, NOMINAL, lambda w: nudge(NOMINAL, w), world)
    assert ended.outcome == "failure" and "slid" in ended.reason
    assert 0.04 < NOMINAL.y - world.com("thing")[1] < 0.06


def test_where_a_thing_goes_after_a_fall_is_no_push():
    """Let go 9 cm over the table it topples, far from where it fell."""
    world = load(TASK, NOMINAL)
    joint = world.data.joint("thing_free")
    joint.qpos[2] += 0.09
    joint.qvel[1] = -1.0
    episode = Episode(NOMINAL, world)
    for _ in range(150):
        episode.step(world.idle.astype(np.float32))
    assert NOMINAL.y - world.com("thing")[1] > 0.12 and world.memory["slid"] == 0.0 and episode.outcome is None


@pytest.mark.parametrize("name", ["carry_on", "grip_harder", "carry_it_low"])
def test_who_does_not_take_it_up_again_brings_nothing(name):
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, name, world).solved
    away = np.abs(world.com("thing") - NOMINAL.goal)[:2].max()
    assert (away < NOMINAL.patch.size / 2) == (name == "carry_it_low")
    assert world.memory["slips"] == (0.0 if name == "carry_it_low" else 1.0)


# --- scenes that must not be certified ----------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Forgiving(SlipRecovery):
    """Whatever lies on the square counts."""

    def success(self, world):
        return bool(
            np.abs(world.com("thing") - self.goal)[:2].max() < self.patch.size / 2 and world.com("thing")[2] < 0.9
        )


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (unchecked(SlipRecovery)(thing=Ycb(item=0)), "solved", "no jaw can take it"),
        (Forgiving(), "shortcuts", "'carry_it_low' reaches the goal"),
        (mistaken(SlipRecovery, "carry_on")(), "solved", "the oracle failed"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, SlipRecovery) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            SlipRecovery(thing=Ycb(item=0)),
            SlipRecovery(slip_0=Slip(seconds=0.08)),
            SlipRecovery(goal_y=0.05),
            SlipRecovery(slip_0=Slip(share=0.05), y=0.05),
            SlipRecovery(goal_y=-0.38),
            SlipRecovery(x=0.32, y=0.3, goal_x=0.3),
        ]
    )
