"""Only the hook reaches the cube, only an empty jaw lifts it, and an invalid scenario gets no certificate."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    after_oracle,
    each_refuted_for_its_own_reason,
    load,
    mistaken,
    not_certified,
    play,
    play_shortcut,
    replayed,
    spared,
    unchecked,
)

from scengen import load_task
from scengen.assets.hook import LHook
from scengen.assets.prop import TABLE_TOP
from scengen.geometry import UP
from scengen.params import with_values
from scengen.robots.panda import BASE
from scengen.sim.arm import ROBOT
from scengen.skills.hook import nearest_pull, put_down, slide
from scengen.tasks.tool_retrieve import MAX_DISTANCE, MIN_LIFT, PULL_END_DISTANCE, ToolRetrieve

TASK = load_task("tool_retrieve")
NOMINAL = ToolRetrieve()


def away(pos):
    """Level distance from the robot's first axis [m]."""
    return math.hypot(*(pos - BASE)[:2])


@pytest.fixture(scope="module")
def solved():
    return after_oracle(TASK, NOMINAL)


# --- what the hook is for ---------------------------------------------------------------


def test_the_cube_is_drawn_from_beyond_the_arm_to_within_it(solved):
    assert away(NOMINAL.spot) > 0.9 and away(solved.com("cube")) < MAX_DISTANCE


def test_without_the_hook_the_cube_stays_and_without_its_tip_it_is_not_lifted():
    ends, farthest = ablated(TASK, NOMINAL), {"no_hook": 1e-4, "no_tip": 0.15}
    for name, (ended, w) in ends.items():
        moved = float(np.linalg.norm(w.com("cube") - NOMINAL.spot - NOMINAL.half * UP))
        assert not ended.solved and moved < farthest[name], name


def test_the_arm_stretched_out_for_the_cube_never_touches_it():
    w = load(TASK, NOMINAL)
    play_shortcut(TASK, NOMINAL, "reach_for_the_cube", w)
    assert not w.touched(ROBOT, "cube")


def test_a_tip_that_is_turned_away_passes_by_the_cube():
    w = load(TASK, NOMINAL)
    play_shortcut(TASK, NOMINAL, "pull_with_the_tip_turned_away", w)
    assert away(w.com("cube")) > 0.9


@pytest.mark.parametrize("name", ["pick_the_cube_with_the_hook", "grasp_the_cube_with_the_hook_in_the_jaw"])
def test_whoever_keeps_the_hook_has_the_cube_within_reach_and_cannot_take_it(name):
    w = load(TASK, NOMINAL)
    assert play_shortcut(TASK, NOMINAL, name, w).outcome == "timeout"
    assert away(w.com("cube")) < MAX_DISTANCE and w.com("cube")[2] < TABLE_TOP + NOMINAL.half + MIN_LIFT


@pytest.mark.parametrize("split", ["bent_hook", "double_hook"])
def test_every_kind_of_hook_draws_the_cube_in_and_none_does_without_what_pulls(split):
    scenario = TASK.draw(split, 0, 0).scenario
    assert play(TASK, scenario, scenario.oracle).solved
    straight, _ = ablated(TASK, scenario)["no_tip"]
    assert not straight.solved


@pytest.mark.parametrize("split", ["mirrored_hook", "long_handle", "far_corner", "turned_hook"])
def test_a_memorised_motion_serves_no_other_hook_and_no_other_place(split):
    trained, moved = (TASK.draw(name, 0, 1).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


@pytest.mark.slow
def test_a_memorised_motion_serves_at_most_a_tenth_of_other_training_scenes():
    scenes = [TASK.draw("id", 0, index).scenario for index in range(6)]
    pairs = [(one, other) for one in scenes for other in scenes if one is not other]
    assert sum(replayed(TASK, one, other).solved for one, other in pairs) <= len(pairs) / 10


def sweep(scenario, world):
    """Take the hook, sweep it along the far edge, draw it in: blind to the cube, until it is lifted."""
    yield from scenario.take_hook(world)
    across = [(bearing, 1.0, 0.03) for bearing in np.linspace(-22.0, 18.0, 8)]
    nearest = max(PULL_END_DISTANCE, nearest_pull(scenario.stretch))
    for bearing, inside, beside in ((-22.0, 0.8, 0.15), (-22.0, 1.0, 0.15), *across, (18.0, nearest, 0.03)):
        yield from slide(world.arm, scenario.hook, "hook", math.radians(bearing), inside, beside)
    yield from put_down(world.arm, scenario.hook, "hook")
    yield from scenario.lift_cube(world)


def test_where_the_cube_stands_need_not_be_known():
    """Why the family declares no answer: no bearing has to be guessed. The hook has to be used all the same."""
    scenarios = [TASK.draw("id", 0, index).scenario for index in range(3)]
    solved = [play(TASK, s, lambda world, s=s: sweep(s, world)).solved for s in scenarios]
    assert sum(solved) >= 2


def test_a_memorised_motion_serves_a_cube_of_another_weight():
    """Why weight is no axis here."""
    assert replayed(TASK, NOMINAL, with_values(NOMINAL, {"cube.mass": 0.4})).solved


# --- goal and failure -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("a", "b", "makes"),
    [(ROBOT, "cube", True), (ROBOT, "hook", False), ("cube", "hook", False), ("cube", "table", False)],
)
def test_the_cube_must_be_held_by_the_robot_and_touch_nothing_else(solved, a, b, makes):
    before = solved.loop.touching.copy()
    assert NOMINAL.success(solved)
    i, j = (-1 if body == ROBOT else solved.body(body) for body in (a, b))  # the robot has the last row
    solved.loop.touching[i, j] = solved.loop.touching[j, i] = not makes
    assert not NOMINAL.success(solved)
    solved.loop.touching[:] = before


@pytest.mark.parametrize(("short", "counts"), [(-0.001, True), (0.001, False)])
def test_the_cube_counts_as_lifted_40_mm_above_its_place_on_the_table(solved, short, counts):
    state = solved.state()
    solved.data.joint("cube_free").qpos[2] += TABLE_TOP + NOMINAL.half + 0.040 - short - solved.com("cube")[2]
    mujoco.mj_kinematics(solved.model, solved.data)
    mujoco.mj_comPos(solved.model, solved.data)
    assert NOMINAL.success(solved) == counts
    solved.restore(state)


def test_a_cube_that_falls_off_the_table_is_lost_and_a_hook_that_falls_is_not_needed_any_more(solved):
    state = solved.state()
    for body, reason in (("hook", None), ("cube", "the cube fell off the table")):
        assert NOMINAL.failure(solved) is None and NOMINAL.success(solved)
        solved.data.joint(f"{body}_free").qpos[2] = 0.6
        mujoco.mj_kinematics(solved.model, solved.data)
        mujoco.mj_comPos(solved.model, solved.data)
        assert NOMINAL.failure(solved) == reason
    solved.restore(state)


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Drawn(ToolRetrieve):
    """To have the cube within reach is enough, by any means."""

    def success(self, world):
        return away(world.com("cube")) < MAX_DISTANCE

    def means(self):
        return {}


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (ToolRetrieve(hook_x=0.17, hook_y=-0.05), "overlap", "bodies overlap"),
        (unchecked(ToolRetrieve)(distance=0.97), "rest", "cube"),
        (Drawn(), "shortcuts", "reaches the goal"),
        (mistaken(ToolRetrieve, "pull_with_the_tip_turned_away")(), "solved", "the oracle failed"),
        (spared(ToolRetrieve)(), "ablations", "the witness succeeds with 'less_light'"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, ToolRetrieve) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            ToolRetrieve(distance=0.80),
            ToolRetrieve(distance=0.96),
            ToolRetrieve(hook=LHook(length=0.25)),
            ToolRetrieve(hook=LHook(width=0.028)),
            ToolRetrieve(hook=LHook(tip=0.022)),
            ToolRetrieve(hook_x=0.30, hook_y=0.0, hook_yaw=-90.0),
        ]
    )
