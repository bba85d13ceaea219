"""Only the hook reaches the cube, only an empty jaw lifts it, and what is no fair problem gets no certificate."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen import config
from scengen.assets.hook import LHook
from scengen.assets.prop import TABLE_TOP
from scengen.params import with_values
from scengen.robots.panda import BASE
from scengen.sim import scene_text
from scengen.sim.world import ROBOT, World
from scengen.tasks.tool_retrieve import ARM, LIFTED, ToolRetrieve
from scengen.validate.certify import certify
from scengen.validate.rollout import replay, run
from scengen.validate.settings import CertifySettings, Robust

TASK = config.task("tool_retrieve")
ONE_JITTER = CertifySettings(robust=Robust(runs=1, bound=0.01))
"""One jittered run, where certificates ask for more: what is tested here are the other checks."""


def world(scenario, scene=None):
    return World.load(scene_text.emit(scene or scenario.build())[0], TASK.embodiment)


@pytest.fixture(scope="module")
def solved():
    """The nominal scenario with its world after the oracle has solved it, and the actions."""
    scenario = ToolRetrieve()
    w = world(scenario)
    episode = run(scenario, w, scenario.oracle, TASK.horizon)
    assert episode.solved, episode.reason
    return scenario, w, episode.actions


# --- what the hook is for ---------------------------------------------------------------


def test_the_cube_is_drawn_from_beyond_the_arm_to_within_it(solved):
    scenario, w, _ = solved
    before, after = (math.hypot(*(place - BASE)[:2]) for place in (scenario.spot, w.com("cube")))
    assert before > 0.9 and after < ARM


def test_without_the_hook_the_cube_stays_and_without_its_tip_it_is_not_lifted(solved):
    scenario, _, actions = solved
    ends = {}
    for name, scene in scenario.ablations().items():
        maimed = world(scenario, scene)
        assert not replay(scenario, maimed, actions, TASK.horizon, until_settled=True).solved
        ends[name] = float(np.linalg.norm(maimed.com("cube") - scenario.spot - [0, 0, scenario.half]))
    assert ends["no hook"] < 1e-4
    assert ends["no tip"] < 0.15


def test_the_arm_stretched_out_for_the_cube_never_touches_it():
    scenario = ToolRetrieve()
    w = world(scenario)
    run(scenario, w, scenario.shortcuts()["reach for the cube"], TASK.horizon, until_settled=True)
    assert not w.touched(ROBOT, "cube")


def test_a_tip_that_is_turned_away_passes_by_the_cube():
    scenario = ToolRetrieve()
    w = world(scenario)
    run(scenario, w, scenario.shortcuts()["pull with the tip turned away"], TASK.horizon, until_settled=True)
    assert math.hypot(*(w.com("cube") - BASE)[:2]) > 0.9


@pytest.mark.parametrize("name", ["pick the cube with the hook", "grasp the cube with the hook in the jaw"])
def test_whoever_keeps_the_hook_has_the_cube_within_reach_and_cannot_take_it(name):
    scenario = ToolRetrieve()
    w = world(scenario)
    episode = run(scenario, w, scenario.shortcuts()[name], TASK.horizon, until_settled=True)
    assert episode.outcome == "timeout"
    assert math.hypot(*(w.com("cube") - BASE)[:2]) < ARM and w.com("cube")[2] < TABLE_TOP + scenario.half + LIFTED


@pytest.mark.parametrize("split", ["mirrored_hook", "long_handle", "far_corner", "turned_hook"])
def test_a_memorised_motion_serves_no_other_hook_and_no_other_place(split):
    trained, moved = (TASK.draw(name, 0, 1).scenario for name in ("id", split))
    actions = run(trained, world(trained), trained.oracle, TASK.horizon).actions
    assert not replay(moved, world(moved), actions, TASK.horizon, until_settled=True).solved


def test_a_memorised_motion_serves_a_cube_of_another_weight(solved):
    """Why weight is no axis here."""
    scenario, _, actions = solved
    heavy = with_values(scenario, {"cube.mass": 0.4})
    assert replay(heavy, world(heavy), actions, TASK.horizon, until_settled=True).solved


# --- goal and failure -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("a", "b", "makes"),
    [(ROBOT, "cube", True), (ROBOT, "hook", False), ("cube", "hook", False), ("cube", "table", False)],
)
def test_the_cube_must_be_held_by_the_robot_and_touch_nothing_else(solved, a, b, makes):
    scenario, w, _ = solved
    before = w.loop.touching.copy()
    assert scenario.success(w)
    i, j = (w.model.nbody if body == ROBOT else w.body(body) for body in (a, b))
    w.loop.touching[i, j] = w.loop.touching[j, i] = not makes
    assert not scenario.success(w)
    w.loop.touching[:] = before


@pytest.mark.parametrize(("short", "counts"), [(-0.001, True), (0.001, False)])
def test_the_cube_counts_as_lifted_40_mm_above_its_place_on_the_table(solved, short, counts):
    scenario, w, _ = solved
    state = w.state()
    w.data.joint("cube_free").qpos[2] += TABLE_TOP + scenario.half + 0.040 - short - w.com("cube")[2]
    mujoco.mj_kinematics(w.model, w.data)
    mujoco.mj_comPos(w.model, w.data)
    assert scenario.success(w) == counts
    w.restore(state)


@pytest.mark.parametrize("body", ["cube", "hook"])
def test_what_falls_off_the_table_is_lost(body):
    scenario = ToolRetrieve()
    w = world(scenario)
    assert scenario.failure(w) is None
    w.data.joint(f"{body}_free").qpos[2] = 0.6
    mujoco.mj_forward(w.model, w.data)
    assert scenario.failure(w) == f"the {body} fell off the table"


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Unguarded(ToolRetrieve):
    """Nobody calculates beforehand."""

    def infeasible(self):
        return None


@dataclass(frozen=True, kw_only=True)
class Drawn(ToolRetrieve):
    """To have the cube within reach is enough."""

    def success(self, world):
        return math.hypot(*(world.com("cube") - BASE)[:2]) < ARM


@dataclass(frozen=True, kw_only=True)
class WrongSide(ToolRetrieve):
    """The oracle takes every hook for its mirror image."""

    def oracle(self, world):
        yield from self.shortcuts()["pull with the tip turned away"](world)


@dataclass(frozen=True, kw_only=True)
class Spared(ToolRetrieve):
    """What is taken away is not needed."""

    def ablations(self):
        scene = self.build()
        scene.delete(scene.lights[0])
        return {"less light": scene}


@pytest.mark.parametrize(
    ("scenario", "check", "verdict"),
    [
        (ToolRetrieve(distance=0.80), "feasible", "refuted"),
        (ToolRetrieve(distance=0.96), "feasible", "refuted"),
        (ToolRetrieve(hook=LHook(length=0.25)), "feasible", "refuted"),
        (ToolRetrieve(hook=LHook(width=0.028)), "feasible", "refuted"),
        (ToolRetrieve(hook=LHook(tip=0.022)), "feasible", "refuted"),
        (ToolRetrieve(hook_x=0.30, hook_y=0.0, hook_yaw=-90.0), "feasible", "refuted"),
        (ToolRetrieve(hook_x=0.17, hook_y=-0.05), "overlap", "refuted"),
        (Unguarded(distance=0.97), "rest", "refuted"),
        (Drawn(), "shortcuts", "refuted"),
        (WrongSide(), "solved", "unknown"),
        (Spared(), "necessity", "refuted"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, ToolRetrieve) else str(value),
)
def test_what_is_no_fair_problem_is_not_certified(scenario, check, verdict):
    certificate = certify(scenario, TASK.horizon, ONE_JITTER, TASK.embodiment).certificate
    assert (certificate.verdict, certificate.failed.name) == (verdict, check), certificate.reason


def test_every_refutation_has_its_own_reason():
    scenarios = [
        ToolRetrieve(distance=0.80),
        ToolRetrieve(distance=0.96),
        ToolRetrieve(hook=LHook(length=0.25)),
        ToolRetrieve(hook=LHook(width=0.028)),
        ToolRetrieve(hook=LHook(tip=0.022)),
        ToolRetrieve(hook_x=0.30, hook_y=0.0, hook_yaw=-90.0),
    ]
    assert len({s.infeasible().reason for s in scenarios}) == len(scenarios)


@given(scenario=anywhere(ToolRetrieve))
@settings(max_examples=60, deadline=None)
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_can_be_built(scenario):
    refutation = scenario.infeasible()
    if refutation is None:
        scenario.build().compile()
    else:
        assert refutation.reason and all(math.isfinite(x) for x in refutation.numbers.values())
