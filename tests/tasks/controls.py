"""What the tests of tasks share: how to play a scenario, families with one part changed, and negative controls.

In a test of a task:

    TASK = load_task("domino_single")
    play(TASK, scenario, scenario.oracle)            # until the plan has ended and everything is at rest
    not_certified(TASK, scenario, "feasible", "cannot reach its neighbour")
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache

import mujoco

from scengen.certificate import Certificate
from scengen.means import MISSED
from scengen.samplers.task import Task
from scengen.scenario import Plan, Planner, Refutation, Scenario, Shortcut
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.validate.certify import certify
from scengen.validate.rebuilt import world_of
from scengen.validate.rollout import Rollout, replay, run, try_shortcut
from scengen.validate.settings import CertifySettings, Robust

ONE_JITTER = CertifySettings(robust=Robust(runs=1, bound=0.01))
"""One jittered run, where certificates ask for more: the negative controls are about the other checks."""


# --- playing ------------------------------------------------------------------------------


def load(task: Task, scenario: Scenario, scene: mujoco.MjSpec | None = None) -> World:
    """A world with the scenario's own scene or another one, and the robot of the task."""
    return World.load(scene_text.emit(scene or scenario.build())[0], task.embodiment)


def play(task: Task, scenario: Scenario, plan: Planner, world: World | None = None) -> Rollout:
    """Play a plan until the verdict, or until it has ended and everything is at rest."""
    return run(scenario, world or load(task, scenario), plan, task.horizon, until_settled=True)


def play_shortcut(task: Task, scenario: Scenario, name: str, world: World | None = None) -> Rollout:
    """Play a shortcut as a certificate does."""
    return try_shortcut(scenario, world or load(task, scenario), scenario.shortcuts()[name], task.horizon)


def solution(task: Task, scenario: Scenario) -> Rollout:
    """The oracle's rollout, which must succeed. Played once for each scenario."""
    return _solution(task.horizon, task.embodiment, scenario)


@cache
def _solution(horizon: float, embodiment: str, scenario: Scenario) -> Rollout:
    world = world_of(scenario, embodiment)
    rollout = run(scenario, world, scenario.oracle, horizon)
    assert rollout.solved, rollout.reason
    return rollout


def after_oracle(task: Task, scenario: Scenario) -> World:
    """A world of the scenario after its oracle has solved it."""
    world = load(task, scenario)
    rollout = play(task, scenario, scenario.oracle, world)
    assert rollout.solved, rollout.reason
    return world


def replayed(task: Task, actions_of: Scenario, scenario: Scenario, world: World | None = None) -> Rollout:
    """What the oracle's actions in one scenario do in another one, or in another world."""
    actions = solution(task, actions_of).actions
    return replay(scenario, world or load(task, scenario), actions, task.horizon, until_settled=True)


def ablated(task: Task, scenario: Scenario) -> dict[str, tuple[Rollout, World]]:
    """What the witness does in each ablation, and the world afterwards."""
    ends = {}
    for name, scene in scenario.ablations().items():
        world = load(task, scenario, scene)
        ends[name] = replayed(task, scenario, scenario, world), world
    return ends


def parked(task: Task, scenario: Scenario, arm: int) -> tuple[Rollout, World]:
    """What the witness does while one of two arms stays where it is, with an open hand, and the world afterwards."""
    actions, world = solution(task, scenario).actions.copy(), load(task, scenario)
    actions[:, 7 * arm : 7 * arm + 7] = [0, 0, 0, 0, 0, 0, -1]
    return replay(scenario, world, actions, task.horizon, until_settled=True), world


# --- families with one part changed ---------------------------------------------------------


def unguarded(family: type[Scenario]) -> type[Scenario]:
    """The family without failure rules: the robot may do what it likes."""

    def failure(self: Scenario, world: World) -> str | None:
        return None

    return type("Unguarded", (family,), {"failure": failure})


def unchecked(family: type[Scenario]) -> type[Scenario]:
    """The family without constraints: nobody calculates beforehand."""

    def constraints(self: Scenario) -> Iterator[Refutation | None]:
        yield from ()

    return type("Unchecked", (family,), {"constraints": constraints})


def spared(family: type[Scenario]) -> type[Scenario]:
    """The family with an ablation that takes away one lamp, which nobody needs; without shortcuts, to save time."""

    def ablations(self: Scenario) -> Mapping[str, mujoco.MjSpec]:
        scene = self.build()
        scene.delete(scene.lights[0])
        return {"less_light": scene}

    def shortcuts(self: Scenario) -> Mapping[str, Shortcut]:
        return {}

    return type("Spared", (family,), {"ablations": ablations, "shortcuts": shortcuts})


def mistaken(family: type[Scenario], shortcut: str) -> type[Scenario]:
    """The family whose oracle takes one of its own shortcuts for the solution; nobody else takes any."""

    def oracle(self: Scenario, world: World) -> Plan:
        yield from family.shortcuts(self)[shortcut].plan(world)

    def shortcuts(self: Scenario) -> Mapping[str, Shortcut]:
        return {}

    return type("Mistaken", (family,), {"oracle": oracle, "shortcuts": shortcuts})


# --- negative controls ------------------------------------------------------------------------


def not_certified(task: Task, scenario: Scenario, check: str, says: str = "") -> Certificate:
    """Certify, and expect that this check is the one that fails, for a reason that contains `says`."""
    certificate = certify(scenario, task.horizon, ONE_JITTER, task.embodiment).certificate
    assert certificate.failed is not None, "it is certified"
    assert certificate.failed.name == check, f"{certificate.failed.name}: {certificate.reason}"
    assert says in certificate.reason, certificate.reason
    return certificate


def missed(scenario: Scenario, world: World, mean: str) -> bool:
    """Whether a mean, if it is open, is missed in the present state."""
    return scenario.means()[mean].found(world) == MISSED


def refuted(scenario: Scenario) -> str:
    """Expect that a constraint refutes the scenario, with finite numbers; returns its reason."""
    refutation = scenario.infeasible()
    assert refutation is not None, f"no constraint refutes {scenario}"
    assert refutation.reason and refutation.numbers
    assert all(math.isfinite(number) for number in refutation.numbers.values()), refutation
    return refutation.reason


def each_refuted_for_its_own_reason(scenarios: Sequence[Scenario]) -> None:
    """Expect that every scenario is refuted, and no two of them for the same reason."""
    reasons = [refuted(scenario) for scenario in scenarios]
    assert len(set(reasons)) == len(reasons), reasons


def builds_or_is_refuted(scenario: Scenario) -> None:
    """Whatever is within bounds has an id, and is refuted with finite numbers or can be built."""
    assert len(scenario.id) == 12
    if scenario.infeasible() is None:
        scenario.build().compile()
    else:
        refuted(scenario)
