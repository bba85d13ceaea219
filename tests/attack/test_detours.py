"""The tier of detours breaks rules on the way, and the solution goes on from there."""

import numpy as np
import pytest
from hand import otherwise
from test_servo import player_of

from scengen.attack.detours import DETOUR, detours, takings
from scengen.attack.macros import Macro
from scengen.attack.variations import rest, stretch
from scengen.compose import load_task
from scengen.sim.world import World
from scengen.validate.rollout import replay


def refused(player, task, played):
    """The reason for which the task as it is refuses what was played; empty if it does not."""
    closed = load_task(task).draw("id", 11, 0).scenario
    world = World.load(player.scene_xml, player.embodiment)
    return replay(closed, world, played.actions, player.horizon, until_settled=True).reason


def solving(player, kind):
    """The attempts that reach the goal of the open task, of those that start with a kind of move or contain it."""
    attempts = [one for one in detours(player) if any(macro.kind == kind for macro in one.macros)]
    assert attempts and all(one.tier == DETOUR for one in attempts)
    for attempt in attempts[:6]:
        played = player.play(attempt.macros, False, player.stage(attempt.stage))
        if played.solved:
            yield attempt, played


@pytest.mark.slow
def test_what_is_held_is_pressed_on_another_body_and_the_goal_is_reached_all_the_same():
    player = player_of("shape_stack", otherwise)
    reasons = [refused(player, "shape_stack", played) for _, played in solving(player, "press")]
    assert any("nothing was set on the cone" in reason for reason in reasons)


@pytest.fixture(scope="module")
def felt():
    return player_of("sheltered_grasp", otherwise)


def test_a_body_that_was_pushed_aside_is_taken_where_it_is_then(felt):
    (stage, _, body), *_ = takings(felt)
    attempt, played = next(solving(felt, "go"))
    again = next(macro for macro in attempt.macros if macro.kind == "resume")
    before = felt.trace.ways[body][felt.trace.stages[stage].row]
    assert again.target == body and np.linalg.norm(before - felt.start_place(body)) < 0.01
    assert "when the robot first touched it" in refused(felt, "sheltered_grasp", played)


def test_where_nothing_has_moved_a_resumed_witness_is_the_witness(felt):
    (stage, _, body), *_ = takings(felt)
    row, left = felt.trace.stages[stage].row, rest(felt, stage)
    resumed, plain = (felt.play((one, *left), False) for one in (Macro("resume", body, (0.0, row)), stretch(0, row)))
    assert resumed.solved and resumed.digest == plain.digest
