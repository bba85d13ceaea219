"""What a shift does to behaviour: witnesses of training scenarios are replayed in their OOD twins."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from ..episode import Actions
from ..errors import Infeasible
from ..log import Log
from ..parallel import Limits, each
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim import scene_text
from ..sim.world import World
from ..statistics import wilson
from ..validate.identity import source_sha256
from ..validate.rollout import Rollout, replay, run

EXTRAPOLATION = "true extrapolation"
COSMETIC = "cosmetic"
UNKNOWN = "unknown or refuted"
BUG = "oracle bug"
KINDS: dict[tuple[bool, bool], str] = {
    (False, True): EXTRAPOLATION,
    (True, True): COSMETIC,
    (False, False): UNKNOWN,
    (True, False): BUG,
}
"""What it means whether (the actions of the ID twin, the oracle) solves an OOD scenario."""


LIMITS = Limits(600.0, 4000)
"""Of one twin: two oracle runs and a replay take some seconds."""


@dataclass(frozen=True)
class Trial:
    """One OOD scenario, tried twice."""

    index: int
    replay: bool
    """Whether the actions that solve its ID twin solve it too."""
    oracle: bool
    """Whether its oracle solves it; False too if the scenario is infeasible."""
    reason: str
    """Why the replay failed; or why there is no scenario."""

    @property
    def kind(self) -> str:
        """One of the values of `KINDS`."""
        return KINDS[self.replay, self.oracle]


@dataclass(frozen=True)
class Share:
    """How often one kind occurred, with Wilson's 95 % interval of its share."""

    kind: str
    count: int
    value: float
    low: float
    high: float


def try_twins(
    task: Task,
    split: str,
    folder: Path,
    n: int,
    seed: int = 0,
    workers: int = 1,
    progress: Callable[[int], None] = lambda done: None,
) -> list[Trial]:
    """Replay ID witnesses in the first n scenarios of a split, continuing what stands in `folder`.

    Twins that their own oracle cannot solve have no actions and are left out.

    Args:
        progress: told how many twins are done.
    """
    shifts = {name: str(dist) for name, dist in task.shifts(split).items()}
    identity = {"task": task.name, "split": split, "shifts": shifts, "seed": seed, "source": source_sha256(task.family)}
    with Log(folder / "behaviour.jsonl", identity) as log:
        todo = sorted(set(range(n)) - {r["index"] for r in log.records})
        for trial in each(partial(_try_twin, task, split, seed), todo, workers, LIMITS, _lost):
            log.add(trial)
            progress(len(log.records))
        records = sorted((r for r in log.records if r["index"] < n), key=lambda r: r["index"])
    return [Trial(**r) for r in records if r["replay"] is not None]


def shares(trials: Iterable[Trial]) -> list[Share]:
    """How often each kind occurred, in the order of `KINDS`."""
    kinds = [trial.kind for trial in trials]
    n = len(kinds)
    counts = {kind: kinds.count(kind) for kind in KINDS.values()}
    return [Share(kind, k, k / n, *wilson(k / n, n)) for kind, k in counts.items()] if n else []


def try_both(task: Task, actions: Actions, scenario: Scenario) -> tuple[bool, bool, str]:
    """Whether recorded actions and whether the oracle solve a scenario, and why the replay does not."""
    world = World.load(scene_text.emit(scenario.build())[0], task.embodiment)
    replayed = replay(scenario, world, actions, task.horizon, until_settled=True)
    return replayed.solved, _solution(scenario, world, task.horizon).solved, replayed.reason


def twin_actions(task: Task, seed: int, index: int) -> Actions | None:
    """Actions with which the oracle solves a training scenario, or None."""
    return _actions(task.draw(ID, seed, index).scenario, task.horizon, task.embodiment)


@cache
def _actions(scenario: Scenario, horizon: float, embodiment: str) -> Actions | None:
    world = World.load(scene_text.emit(scenario.build())[0], embodiment)
    rollout = _solution(scenario, world, horizon)
    return rollout.actions if rollout.solved else None


def _solution(scenario: Scenario, world: World, horizon: float) -> Rollout:
    return run(scenario, world, scenario.oracle, horizon, until_settled=True)


def _try_twin(task: Task, split: str, seed: int, index: int) -> dict[str, Any]:
    """One trial as plain data; `replay` is None where the twin's oracle gave no actions."""
    found: tuple[bool | None, bool, str]
    actions = twin_actions(task, seed, index)
    try:
        scenario = task.draw(split, seed, index).scenario
        found = try_both(task, actions, scenario) if actions is not None else (None, False, "")
    except Infeasible as error:
        found = False, False, str(error)
    return {"index": index, **dict(zip(("replay", "oracle", "reason"), found, strict=True))}


def _lost(index: int, reason: str) -> dict[str, Any]:
    """A twin that has crashed its process, or has reached a limit: nothing is known about it."""
    return {"index": index, "replay": False, "oracle": False, "reason": reason}
