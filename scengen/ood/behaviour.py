"""What a shift does to behaviour: replays that solve training scenarios are played in their OOD twins."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from ..errors import Infeasible
from ..parallel import each
from ..runs.log import Log
from ..samplers.task import ID, Task
from ..scenario import Scenario
from ..sim import scene_text
from ..sim.world import World
from ..statistics import wilson
from ..validate.identity import source_sha256
from ..validate.rollout import Actions, Episode, replay, run

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


@dataclass(frozen=True)
class Trial:
    """One OOD scenario, tried twice."""

    index: int
    replay: bool
    """Whether the actions that solve its ID twin solve it."""
    oracle: bool
    """Whether its oracle solves it; False too if the scenario is infeasible."""
    reason: str
    """Why the actions failed; or why there is no scenario."""

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
    """Play ID witnesses in the first n scenarios of a split, continuing what stands in `folder`.

    Twins that their own oracle cannot solve have no actions and are left out.

    Args:
        progress: told how many twins are done.
    """
    moves = {name: str(dist) for name, dist in task.shifts(split).items()}
    identity = {"task": task.name, "split": split, "moves": moves, "seed": seed, "source": source_sha256(task.family)}
    with Log(folder / "behaviour.jsonl", identity) as log:
        todo = sorted(set(range(n)) - {r["index"] for r in log.records})
        for trial in each(partial(_try_twin, task, split, seed), todo, workers):
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


def attempt(task: Task, actions: Actions, scenario: Scenario) -> tuple[bool, bool, str]:
    """Whether a actions and whether the oracle solve a scenario, and why the actions does not."""
    world = World.load(scene_text.emit(scenario.build())[0], task.embodiment)
    played = replay(scenario, world, actions, task.horizon, until_settled=True)
    return played.solved, _solution(scenario, world, task.horizon).solved, played.reason


def twin_actions(task: Task, seed: int, index: int) -> Actions | None:
    """Actions with which the oracle solves a training scenario, or None."""
    return _actions(task.draw(ID, seed, index).scenario, task.horizon, task.embodiment)


@cache
def _actions(scenario: Scenario, horizon: float, embodiment: str) -> Actions | None:
    world = World.load(scene_text.emit(scenario.build())[0], embodiment)
    episode = _solution(scenario, world, horizon)
    return episode.actions if episode.solved else None


def _solution(scenario: Scenario, world: World, horizon: float) -> Episode:
    return run(scenario, world, scenario.oracle, horizon, until_settled=True)  # type: ignore[attr-defined]


def _try_twin(task: Task, split: str, seed: int, index: int) -> dict[str, Any]:
    """One trial as plain data; `actions` is None where there is no actions to try."""
    found: tuple[bool | None, bool, str]
    actions = twin_actions(task, seed, index)
    try:
        scenario = task.draw(split, seed, index).scenario
        found = attempt(task, actions, scenario) if actions is not None else (None, False, "")
    except Infeasible as error:
        found = False, False, str(error)
    return {"index": index, **dict(zip(("replay", "oracle", "reason"), found, strict=True))}
