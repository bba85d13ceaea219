"""A ball comes back from smooth walls by the law of the bounce, and is caught where it comes by after one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from controls import ablated, each_refuted_for_its_own_reason, load, play, play_shortcut, replayed

from scengen import load_task
from scengen.assets.ball import Ball
from scengen.assets.enclosure import Enclosure
from scengen.episode import OTHERWISE
from scengen.sim.arm import IDLE
from scengen.tasks.bounce_intercept import BounceIntercept
from scengen.tasks.launched_ball import place_on, way_at

TASK = load_task("bounce_intercept")
CATCH = TASK.draw("id", 0, 0).scenario
BACK = BounceIntercept(x=-0.2, y=-0.05, aim=12.0)
"""To the back wall and out again."""


def moving(scenario, until=3.0, world=None):
    """Place and velocity of the ball in every period after its launch, without actions [m, m/s, rad/s]."""
    world = world or load(TASK, scenario)
    found = []
    while world.time < scenario.launch + until:
        with world.events():
            scenario.events(world)
        world.step(IDLE)
        if world.time > scenario.launch + 0.005:
            found.append(np.concatenate([world.com("ball"), world.velocity("ball")]))
    return np.array(found)


# --- the laws of the task -----------------------------------------------------------------


@pytest.mark.parametrize("restitution", [0.55, 0.84])
def test_a_smooth_wall_returns_a_part_of_the_normal_speed_and_all_of_the_other(restitution):
    found = moving(replace(BACK, enclosure=Enclosure(restitution=restitution)))
    before, after = found[20, 6:8], found[-1, 6:8]
    assert before == pytest.approx(BACK.speed * BACK.u[:2], rel=0.01)
    assert after == pytest.approx([-restitution * before[0], before[1]], abs=0.05 * BACK.speed)
    assert np.abs(found[:, 3:6]).max() < 0.05  # nothing turns it


def test_energy_is_lost_in_the_bounce_alone():
    speeds = np.linalg.norm(moving(BACK)[:, 6:8], axis=1)
    flat = np.abs(np.diff(speeds)) < 1e-3 * BACK.speed
    changes = np.flatnonzero(~flat)
    assert changes[-1] - changes[0] < 6
    assert speeds[0] == pytest.approx(speeds[changes[0]], rel=0.02)


def test_a_ball_that_rolls_keeps_its_spin_and_is_no_mirror_image():
    """v = 5/7 v' + 2/7 w: w is the spin that the floor leaves during the bounce."""
    felt = replace(BACK, aim=0.0, friction=0.3, enclosure=Enclosure(restitution=0.9))
    found = moving(felt)
    back = -found[-1, 6] / found[20, 6]
    assert back < 0.65 < 0.9
    ways = felt.ways(felt.start, felt.speed * felt.u, felt.speed * felt.u)
    assert ways[1].velocity[0] == pytest.approx(found[-1, 6], rel=0.10)


@pytest.mark.parametrize(
    ("changed", "bounces"), [({}, 1), ({"aim": 40.0}, 2), ({"aim": -25.0, "side": -1, "turn": 15.0}, 2)]
)
def test_its_way_is_foreseen(changed, bounces):
    """Within 12 mm until it leaves the walls again: returned speeds scatter by a hundredth or two."""
    scenario = replace(BACK, **changed)
    ways = scenario.ways(scenario.start, scenario.speed * scenario.u, np.zeros(3))
    assert len(ways) == bounces + 1
    found = moving(scenario, ways[-1].starts + 0.6)
    expected = [place_on(ways, (k + 1) / 100) for k in range(len(found))]
    assert np.abs(found[:, :2] - np.array(expected)[:, :2]).max() < 0.012


def test_sides_are_mirror_images():
    left, right = (moving(replace(BACK, side=side, turn=5.0), 2.5) for side in (1, -1))
    assert left[:, 1] == pytest.approx(-right[:, 1], abs=1e-4)


def test_a_bounce_goes_on_from_a_saved_state():
    """Bit for bit, from the middle of the contact with the wall."""
    world = load(TASK, BACK)
    while not world.memory["at_wall"]:
        with world.events():
            BACK.events(world)
        world.step(IDLE)
    saved = world.state()
    ends = moving(BACK, 2.5, world)
    world.restore(saved)
    assert np.array_equal(moving(BACK, 2.5, world), ends)
    assert world.memory["bounces"] == 1.0


# --- what must not work -------------------------------------------------------------------


@pytest.mark.parametrize("name", ["go_to_where_it_is", "follow_it"])
def test_a_hand_that_follows_it_touches_it_too_soon_or_does_not_reach_it(name):
    assert not play_shortcut(TASK, CATCH, name).solved


@pytest.mark.parametrize(("aside", "caught"), [(0.0, True), (0.015, True), (0.045, False)])
def test_a_hand_may_correct_its_place_by_25_millimetres_after_the_bounce(aside, caught):
    """It waits along the path before or behind the place where it then catches the ball."""

    def late(world):
        yield from BACK.observe(world)
        ways = BACK.predict(world)
        at, seconds = BACK.meeting(ways, world.arm.hand, lead=0.5)
        bounces, way = way_at(ways, seconds)
        along = way.velocity / np.linalg.norm(way.velocity)
        back = lambda: world.memory["bounces"] == bounces and not world.memory["at_wall"]  # noqa: E731
        yield from BACK.wait_at(world, at + aside * along, along, back)
        near = lambda: (world.arm.hand - world.com("ball")) @ along < BACK.closing_time * speed(world)  # noqa: E731
        yield from BACK.wait_at(world, at, along, near)
        yield from BACK.catch(world)

    assert play(TASK, BACK, late).solved == caught


def test_a_ball_that_is_caught_at_a_wall_lacks_one_mean():
    """Where it is slow, a hand that follows it is with it when it bounces."""
    dead = TASK.draw("dead_walls", 3, 1).scenario
    lacking = f"{OTHERWISE}: the robot met the ball away from the walls"
    assert play_shortcut(TASK, dead, "follow_it").reason == lacking


def speed(world):
    """Speed of the ball [m/s]."""
    return np.linalg.norm(world.velocity("ball")[3:])


def test_a_mirror_image_is_beside_it():
    scenario = next(s for s in (TASK.draw("id", 0, i).scenario for i in range(20)) if s.mirror_miss < math.inf)
    assert "expect_a_mirror_image" in scenario.shortcuts() or scenario.mirror_miss <= 0.06
    dead = replace(BACK, enclosure=Enclosure(restitution=0.55))
    assert not play_shortcut(TASK, dead, "expect_a_mirror_image").solved


@pytest.mark.parametrize("aim", [12.0, 45.0])
def test_without_walls_it_does_not_come_back(aim):
    ((ended, world),) = ablated(TASK, replace(BACK, aim=aim)).values()
    assert not ended.solved and world.memory["bounces"] == 0


@pytest.mark.parametrize("axis", ["dead_walls", "turned"])
def test_a_memorised_catch_is_lost_out_of_distribution(axis):
    twins = [TASK.draw(axis, 0, i).scenario for i in (0, 2, 5, 7)]
    assert sum(replayed(TASK, CATCH, twin).solved for twin in twins) <= 1


# --- scenes that must not be certified ---------------------------------------------------


def test_what_is_refuted_is_refuted_for_reasons_of_its_own():
    each_refuted_for_its_own_reason(
        [
            BounceIntercept(x=0.2),
            replace(BACK, aim=-8.0, y=0.25),
            BounceIntercept(turn=30.0),
            BounceIntercept(ball=Ball(radius=0.035, density=1200.0)),
            replace(BACK, speed=0.8),
            replace(BACK, aim=0.0, speed=0.1, enclosure=Enclosure(restitution=0.3)),
        ]
    )
