"""Planners that believe training: the oracle of the training twin plays in the OOD scene.

Such a planner has its oracle's plan and feedback. It sees what the oracle reads from the world, and believes that some
parameters are as in training:

* `belief`: all parameters that the axis moves.
* `hidden_belief`: those of them that are hidden (`param(hidden=True)`). An axis that moves none has no such planner.

A third planner, `nearest_belief`, sees the moved parameters and knows no other values than those of training: it takes
each for the nearest of them, as a function that saturates, or a choice from a vocabulary. Where the value lies in
training, it is the oracle, so that it is never too weak.

Where a memory repeats a motion, a planner makes a new one from wrong numbers. A loss says that the motion depends on
the value of a moved parameter. It does not say that the value is hard to see: which values an oracle reads and which it
knows is the choice of its author. The control is the training scenario with the axis' own parameters redrawn within
training, and the same wrong numbers. A parameter that is constant in training is believed rightly there.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import GaveUp, Infeasible
from ..params import Value, values, with_values
from ..samplers.split import ID
from ..samplers.support import nearest, wrapped
from ..samplers.task import Task
from ..scenario import Plan, Scenario
from ..sim.world import World
from ..validate.rebuilt import world_of
from ..validate.rollout import run
from .baseline import BELIEF, Baseline
from .behaviour import MOVED, Trials, moved_within, play_indices, solves, varies

CONSTANT = "training, where it is constant"
"""Control: the training scenario itself, because the moved parameters have one value in training."""
STEP = "beliefs in twins"
"""Name of the step in progress."""


def measure_belief(
    task: Task,
    split: str,
    folder: Path,
    trials: Trials,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> list[Baseline]:
    """Play the planners on the first twins of a split, continuing the run in `beliefs.jsonl` of the folder.

    Returns:
        The baselines of `BELIEF`, of which `hidden_belief` is not tried if the axis moves nothing hidden.
    """
    where, count = folder / "beliefs.jsonl", trials.belief_n
    work = partial(_play_twin, task, split, trials.seed)
    played = play_indices(work, task, split, where, count, trials, partial(progress, STEP))
    control = MOVED if varies(task, split) else CONSTANT
    both = [twin for twin in played if twin.get("here") and twin.get("control")]
    arms = {
        name: [(twin["control"][name], twin["here"][name]) for twin in both if name in twin["here"]] for name in BELIEF
    }
    return [Baseline.of(name, control, arms[name]) for name in BELIEF]


def moves_hidden(task: Task, split: str) -> bool:
    """Whether an axis moves a hidden parameter."""
    return bool(_hidden(task, split))


def _hidden(task: Task, split: str) -> set[str]:
    return {name for name in task.shifts(split) if task.known[name].hidden}


def believed(task: Task, split: str, scenario: Scenario, trained: Scenario) -> dict[str, Scenario]:
    """The scenario in which each planner believes to be.

    Args:
        scenario: the scenario in which it is.
        trained: the training twin.
    """
    known, seen = values(trained), values(scenario)
    moved = set(task.shifts(split))
    hidden = _hidden(task, split)
    beliefs: dict[str, dict[str, Value]] = {"hidden_belief": {name: known[name] for name in hidden}} if hidden else {}
    beliefs["belief"] = {name: known[name] for name in moved}
    beliefs["nearest_belief"] = {name: _nearest(task, name, seen[name]) for name in moved}
    return {name: with_values(scenario, wrong) for name, wrong in beliefs.items()}


def _nearest(task: Task, name: str, value: Value) -> Value:
    """The value of training that is nearest to a value of a parameter."""
    parameter = task.known[name]
    found = nearest(task.training[name].support, value, parameter.period)
    found = wrapped(found, parameter.low, parameter.high, parameter.period)
    return round(found) if parameter.integer else found


def _play_twin(task: Task, split: str, seed: int, index: int) -> dict[str, Any]:
    """Outcomes of the planners in both conditions. A condition is None if it is infeasible or the oracle does not solve
    it."""
    record: dict[str, Any] = {"index": index, "control": None, "here": None, "reasons": {}}
    try:
        trained, here = task.draw(ID, seed, index).scenario, task.draw(split, seed, index).scenario
    except Infeasible:
        return record
    control = moved_within(task, task.shifts(split), seed, index, trained)
    if control is None or not (solves(task, here) and solves(task, control)):
        return record
    for arm, scenario in (("control", control), ("here", here)):
        planners = believed(task, split, scenario, trained)
        why = {planner: _play(task, scenario, planner) for planner in set(planners.values())}  # some agree
        failures = {name: why[planner] for name, planner in planners.items()}
        record[arm] = {name: reason is None for name, reason in failures.items()}
        if arm == "here":
            record["reasons"] = {name: reason for name, reason in failures.items() if reason}
    return record


def _play(task: Task, scenario: Scenario, planner: Scenario) -> str | None:
    """Reason why a planner fails in a scenario; None if it solves it."""
    if planner == scenario:
        return None  # its beliefs are right, so it is the oracle, which has solved the scenario
    rollout = run(
        scenario, world_of(scenario, task.embodiment), partial(_plan, planner), task.horizon, until_settled=True
    )
    return None if rollout.solved else rollout.gave_up or rollout.reason


def solves_with(task: Task, scenario: Scenario, planner: Scenario) -> bool:
    """Whether the oracle of another scenario, the planner's belief, solves a scenario that its own oracle solves."""
    return _play(task, scenario, planner) is None


def _plan(planner: Scenario, world: World) -> Plan:
    """The oracle's plan. It ends where the scene contradicts its beliefs, such as with a body that does not exist."""
    try:
        yield from planner.oracle(world)
    except GaveUp:
        raise
    except Exception as error:
        raise GaveUp(f"the scene contradicts the plan: {type(error).__name__}: {error}") from error
