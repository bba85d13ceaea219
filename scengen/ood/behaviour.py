"""Success of memorised motions on an axis, each with its control.

That a memorised motion fails out of distribution says nothing if it fails within training too. So every kind of memory
(a replay baseline) is played in two arms: in OOD twins, and in training scenarios that differ from the remembered one
as much as training scenarios do. `excess` is the loss of success from the second arm to the first, twin by twin.

* `replay`: the actions that solve the training twin. `object_centric`: its path relative to bodies, see
  `solution_memory`. The control is the same scenario with the axis' own parameters redrawn within training. If training
  has one value only, there is no such move. Then both conditions play the nearest of `LIBRARY_SIZE` other memories: in
  the training scenario, and in its OOD twin.
* `any_replay`, `any_object_centric`: success if any of the `LIBRARY_SIZE` memories solves the scenario. None of them is
  the twin's own. The control is the training twin, which none of them remembers either.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from ..attack.solution_memory import SolutionMemory, remember
from ..episode import Actions
from ..errors import Infeasible
from ..evaluate.statistics import Rate, rate
from ..params import with_values
from ..samplers.dists import Fixed
from ..samplers.keyed import unit
from ..samplers.split import ID
from ..samplers.task import Draw, Task
from ..scenario import Scenario
from ..validate.identity import source_sha256
from ..validate.rebuilt import world_of
from ..validate.rollout import replay, run
from ..work.log import FRESH, Log
from ..work.parallel import Limits, Workers, each
from .baseline import MOTION, OBJECT_CENTRIC, Baseline

LIBRARY_SIZE = 16
"""Number of training solutions that `any_...` may choose from: those of the first indices of another seed."""
MOVE_TRIES = 20
"""Maximum number of draws of a move within training until one is feasible."""
TWIN_LIMITS = Limits(600.0, 4000)
"""Time and memory limits of one twin: some oracle runs and replays take several seconds."""
MOVED = "moved within training"
"""Control: the axis' own parameters are redrawn within training."""
HELD_OUT = "held-out training"
"""Control: a training scenario that no memory comes from."""


@dataclass(frozen=True)
class Trials:
    """The trials of the baselines on one split."""

    n: int
    """Number of twins. A twin whose training scenario the oracle does not solve has no memory and is left out."""
    any_n: int = 0
    """Number of twins that are also tried with all memories of the library: `2 * LIBRARY_SIZE` rollouts each."""
    belief_n: int = 0
    """Number of twins that are also tried with the planners of `belief`: up to 7 rollouts each."""
    seed: int = 0
    """Seed of the draws."""
    workers: Workers = 1
    """Workers that play the twins."""


def measure(
    task: Task,
    split: str,
    folder: Path,
    controls: Path,
    trials: Trials,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> tuple[list[Baseline], Rate | None]:
    """Play all memories on the first twins of a split, continuing the runs in both folders.

    Args:
        folder: folder of the outcomes in OOD twins.
        controls: folder of the outcomes in training scenarios, which all axes of a task share.
        progress: called with the name of the step, the number of twins done, and their total.

    Returns:
        The baselines, from the weakest to the strongest memory, and the oracle's success rate on the split.
    """
    n, any_n, seed = trials.n, trials.any_n, trials.seed

    def play(work: Callable[..., dict], where: Path, which: str, count: int, what: str, library: bool) -> list[dict]:
        def prepare() -> None:
            if library:
                _library(task, seed)

        report = partial(progress, what)
        return play_indices(partial(work, task, which, seed), task, which, where, count, trials, report, prepare)

    own = play(_play_own, controls / "own.jsonl", ID, n, "memories in training", False)
    any_id = play(_play_library, controls / "any.jsonl", ID, any_n, "any memory in training", True)
    twins = play(_play_twin, folder / "twins.jsonl", split, n, "memories in twins", not varies(task, split))
    any_ood = play(_play_library, folder / "any.jsonl", split, any_n, "any memory in twins", True)
    return _baselines(own, any_id, twins, any_ood), _oracle_rate(twins)


def play_indices(
    work: Callable[[int], dict[str, Any]],
    task: Task,
    split: str,
    where: Path,
    count: int,
    trials: Trials,
    progress: Callable[[int, int], None],
    prepare: Callable[[], None] = lambda: None,
) -> list[dict[str, Any]]:
    """Play the first indices of a split that a log does not hold yet.

    Args:
        work: makes the record of an index; an index that crashes its process or reaches a limit has only a reason.
        where: file of the log.
        count: number of indices.
        prepare: called once if there is work, before the workers start, which are copies of this process.

    Returns:
        The records of the first `count` indices, in their order.
    """
    shifts = {name: str(dist) for name, dist in task.shifts(split).items()}
    identity = {"task": task.name, "split": split, "shifts": shifts, "seed": trials.seed, "library": LIBRARY_SIZE}
    identity["source"] = source_sha256(task.family)
    with Log(where, identity, FRESH) as log:
        todo = sorted(set(range(count)) - {r["index"] for r in log.records})
        if todo:
            prepare()
        for record in each(work, todo, trials.workers, TWIN_LIMITS, _lost):
            log.add(record)
            progress(len(log.records), count)
        return sorted((r for r in log.records if r["index"] < count), key=lambda r: r["index"])


def _oracle_rate(twins: list[dict[str, Any]]) -> Rate | None:
    """Success rate of the oracle in the OOD twins; None if none was tried."""
    tried = [[t["here"]["oracle"]] for t in twins if t.get("here")]
    return rate(tried) if tried else None


def _baselines(
    own: list[dict[str, Any]],
    any_id: list[dict[str, Any]],
    twins: list[dict[str, Any]],
    any_ood: list[dict[str, Any]],
) -> list[Baseline]:
    """The baselines that follow from the records.

    Args:
        own: records of memories in their own training scenarios.
        any_id: records of the library in training scenarios.
        twins: records of the twins in both conditions.
        any_ood: records of the library in OOD twins.
    """
    again = [r["again"] for r in own if r.get("again") is not None]
    names = [*MOTION, *OBJECT_CENTRIC]
    faithful = {name: sum(again) / len(again) if again and name in OBJECT_CENTRIC else 1.0 for name in names}
    moved = any(t.get("moved") for t in twins)
    both = [t for t in twins if t.get("control") and t["control"]["oracle"] and t["here"]["oracle"]]
    solved = {t["index"] for t in twins if t.get("here") and t["here"]["oracle"]}
    inside = {r["index"]: r for r in any_id if r.get("any_replay") is not None}
    pairs = [(inside[r["index"]], r) for r in any_ood if r["index"] in solved & inside.keys()]
    found = []
    for name in names:
        if name.startswith("any"):
            arms = [(inside[name], outside[name]) for inside, outside in pairs]
        else:
            arms = [(t["control"][name], t["here"][name]) for t in both]
        control = MOVED if moved and not name.startswith("any") else HELD_OUT
        found.append(Baseline.of(name, control, arms, faithful[name]))
    return found


# --- one index ----------------------------------------------------------------------------------


def _play_own(task: Task, _: str, seed: int, index: int) -> dict[str, Any]:
    scenario, memory = recall(task, seed, index)
    return {"index": index, "again": faithful(task, scenario) if memory else None}


def _play_twin(task: Task, split: str, seed: int, index: int) -> dict[str, Any]:
    """A twin's own memory, or the nearest one, in both conditions. `here` is None if there is no memory or no OOD
    twin."""
    trained, memory = recall(task, seed, index)
    moved = varies(task, split)
    record: dict[str, Any] = {"index": index, "moved": moved, "control": None, "here": None}
    if memory is None:
        return record
    if not moved:
        memory = _nearest(task, seed, task.draw(ID, seed, index))[0]
    try:
        record["here"] = _outcomes(task, memory, task.draw(split, seed, index).scenario)
    except Infeasible:
        return record
    if (control := moved_within(task, task.shifts(split), seed, index, trained) if moved else trained) is not None:
        record["control"] = _outcomes(task, memory, control)
    return record


def varies(task: Task, split: str) -> bool:
    """Whether a parameter that a split moves varies within training too: then a twin's own memory has a control."""
    return any(not isinstance(task.training[name], Fixed) for name in task.shifts(split))


def _play_library(task: Task, split: str, seed: int, index: int) -> dict[str, Any]:
    """Whether any memory of the library solves a scenario, replayed or object-centric."""
    try:
        draw = task.draw(split, seed, index)
    except Infeasible:
        return {"index": index}
    memories = _nearest(task, seed, draw)
    return {
        "index": index,
        "any_replay": any(replays(task, m.actions, draw.scenario) for m in memories),
        "any_object_centric": any(follows(task, m, draw.scenario) for m in memories),
    }


def _lost(index: int, reason: str) -> dict[str, Any]:
    """The record of a twin that crashed its process or reached a limit: its outcome is unknown."""
    return {"index": index, "reason": reason}


def _outcomes(task: Task, memory: SolutionMemory, scenario: Scenario) -> dict[str, bool]:
    return {
        "oracle": solves(task, scenario),
        "replay": replays(task, memory.actions, scenario),
        "object_centric": follows(task, memory, scenario),
    }


def moved_within(task: Task, names: Iterable[str], seed: int, index: int, trained: Scenario) -> Scenario | None:
    """A training scenario with some parameters redrawn within training; None if no draw is feasible."""
    names = list(names)
    for attempt in range(MOVE_TRIES):
        fresh = {
            name: task.training[name].quantile(unit(task.name, name, seed, index, attempt, "moved")) for name in names
        }
        scenario = with_values(trained, fresh)
        if scenario.infeasible() is None:
            return scenario
    return None


def _nearest(task: Task, seed: int, draw: Draw) -> list[SolutionMemory]:
    """The library, nearest first. The distance is that of the quantiles of the parameters that vary in training."""

    def away(quantiles: Mapping[str, float]) -> float:
        shared = quantiles.keys() & draw.quantiles.keys() - draw.shifted.keys()
        return math.fsum((quantiles[name] - draw.quantiles[name]) ** 2 for name in sorted(shared))

    return [memory for _, memory in sorted(_library(task, seed), key=lambda known: away(known[0]))]


# --- rollouts -----------------------------------------------------------------------------------


def try_both(task: Task, actions: Actions, scenario: Scenario) -> tuple[bool, bool]:
    """Whether recorded actions and whether the oracle solve a scenario."""
    return replays(task, actions, scenario), solves(task, scenario)


def twin_actions(task: Task, seed: int, index: int) -> Actions | None:
    """Actions with which the oracle solves a training scenario; None if it does not."""
    memory = recall(task, seed, index)[1]
    return memory and memory.actions


def recall(task: Task, seed: int, index: int) -> tuple[Scenario, SolutionMemory | None]:
    """A training scenario, and the memory of the oracle's solution; None if the oracle does not solve it."""
    scenario = task.draw(ID, seed, index).scenario
    return scenario, _remembered(scenario, task.horizon, task.embodiment)


def _library(task: Task, seed: int) -> Sequence[tuple[Mapping[str, float], SolutionMemory]]:
    """Memories of training with the quantiles of their scenarios."""
    draws = [task.draw(ID, seed + 1, index) for index in range(LIBRARY_SIZE)]
    known = [(d.quantiles, _remembered(d.scenario, task.horizon, task.embodiment)) for d in draws]
    return [(quantiles, memory) for quantiles, memory in known if memory is not None]


def faithful(task: Task, scenario: Scenario) -> bool:
    """Whether an object-centric memory solves the scenario again that it remembers."""
    return _faithful(scenario, task.horizon, task.embodiment)


@cache
def _faithful(scenario: Scenario, horizon: float, embodiment: str) -> bool:
    memory = _remembered(scenario, horizon, embodiment)
    return memory is not None and _follows(memory, scenario, horizon, embodiment)


@cache
def _remembered(scenario: Scenario, horizon: float, embodiment: str) -> SolutionMemory | None:
    world = world_of(scenario, embodiment)
    rollout = run(scenario, world, scenario.oracle, horizon, until_settled=True)
    return remember(scenario, world, rollout.actions) if rollout.solved else None


def _follows(memory: SolutionMemory, scenario: Scenario, horizon: float, embodiment: str) -> bool:
    world = world_of(scenario, embodiment)
    return run(scenario, world, memory.follow, horizon, until_settled=True, raw=True).solved


def solves(task: Task, scenario: Scenario) -> bool:
    """Whether the oracle solves a scenario."""
    world = world_of(scenario, task.embodiment)
    return run(scenario, world, scenario.oracle, task.horizon, until_settled=True).solved


def replays(task: Task, actions: Actions, scenario: Scenario) -> bool:
    """Whether recorded actions solve a scenario."""
    world = world_of(scenario, task.embodiment)
    return replay(scenario, world, actions, task.horizon, until_settled=True).solved


def follows(task: Task, memory: SolutionMemory, scenario: Scenario) -> bool:
    """Whether an object-centric memory solves a scenario."""
    return _follows(memory, scenario, task.horizon, task.embodiment)
