"""The tier of hands that feel: it balances, lets go in motion, tries two sides, slides, and finds ways around a rod."""

import numpy as np
import pytest
from hand import otherwise
from test_detours import refused
from test_servo import player_of

from scengen.attack import touch
from scengen.attack.feel import FEEL, balanced, beside, either_way, felt, flung, slid, slipped
from scengen.compose import load_task
from scengen.geometry import UP
from scengen.skills.motion import facing_down, go_to
from scengen.validate.rebuilt import world_of


def carried_out(world, plan):
    """The number of control periods that a plan takes."""
    count = 0
    for action in plan:
        world.step(world.received(action))
        count += 1
    return count


@pytest.fixture
def world():
    scenario = load_task("domino_single").draw("id", 11, 0).scenario
    found = world_of(scenario)
    carried_out(found, go_to(found.arm, np.add(found.arm.hand, [0.0, 0.25, -0.12]), facing_down()))
    return found


def test_a_hand_stops_at_what_it_meets_and_only_there(world):
    arm = world.arm
    there = carried_out(world, touch.until_stopped(arm, touch.CREEP * -UP, 6.0))
    assert world.touching(arm.label, "table") and there < 500
    away = carried_out(world, touch.until_stopped(arm, touch.CREEP * UP, 1.0))
    assert away == pytest.approx(100, abs=2)


def test_a_way_is_tried_to_one_side_and_where_it_is_barred_to_the_other(world):
    arm, start = world.arm, world.arm.hand
    seen = []
    for action in touch.lean(arm, np.array([1.0, 0.0, 0.0]), np.radians(30.0), [0.0, -0.25, -0.05], 0.15):
        world.step(world.received(action))
        seen.append(arm.hand - start)
    side, low = np.min(seen, axis=0)[1:]
    assert low < -0.03 and side < -0.15  # once towards the table, once over it


@pytest.fixture(scope="module")
def rod():
    return player_of("rod_across", otherwise)


def test_every_kind_of_attempt_is_data_of_this_tier(rod):
    arm = rod.world.arm
    for made in (balanced, flung, slipped, either_way, slid):
        first = next(made(rod, arm))
        assert first.tier == FEEL and first.stage is not None
    assert not [*beside(rod, arm)]  # nothing moves by itself
    assert {attempt.tier for attempt in felt(rod)} == {FEEL}


@pytest.mark.slow
@pytest.mark.parametrize(("task", "made"), [("rod_across", balanced), ("rod_across", slipped), ("gap_funnel", slid)])
def test_it_reaches_goals_that_the_sound_task_refuses(task, made):
    player = player_of(task, otherwise)
    attempts = [*made(player, player.world.arm)]
    reasons = []
    for attempt in attempts[:8]:
        played = player.play(attempt.macros, False, player.stage(attempt.stage))
        if played.solved:
            reasons.append(refused(player, task, played))
    assert any(reasons)
