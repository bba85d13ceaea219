"""Evaluation of a policy on pools: the paper's table of success in and out of distribution, with intervals.

Episodes are kept in `<to>/episodes.jsonl` as they end, so that a run that was killed goes on where it was.
"""

import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..envs.gym import ScenarioEnv
from ..envs.observations import check_names
from ..errors import BadConfig, ScengenError, at_least
from ..parallel import each
from ..pool import Pool, Row
from ..runs.log import Log
from ..samplers.keyed import unit
from ..samplers.task import ID
from ..statistics import Difference, Rate, difference, rate
from .policies import REPLAY, Policy, find


class BadPolicy(ScengenError):
    """A policy gave something that is no action."""


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen evaluate`; meanings stand in conf/command/evaluate.yaml."""

    policy: str = ""
    pool: str | list[str] = ""
    seeds: int = 20
    rollouts: int = 5
    observations: list[str] | None = None
    width: int = 256
    height: int = 256
    workers: int = 1
    to: str | None = None

    @property
    def folders(self) -> list[str]:
        """The pools to evaluate on."""
        return self.pool if isinstance(self.pool, list) else [self.pool]

    @property
    def folder(self) -> Path:
        """Where results go."""
        return Path(self.to or f"generated/evaluation/{self.policy.replace(':', '.')}")

    def check(self) -> None:
        """Raise `ScengenError` for settings that make no sense."""
        check_names(self.observations or [])
        at_least(self, seeds=1, rollouts=1, workers=1, width=1, height=1)


@dataclass(frozen=True)
class Job:
    """One rollout to do."""

    task: str
    pool: str
    scenario: str
    rollout: int


@dataclass(frozen=True)
class Line:
    """One line of the table: a task or a category, on one OOD split."""

    what: str
    split: str
    id: Rate | None
    """None where no training pool was given."""
    ood: Rate
    difference: Difference | None
    """OOD minus ID."""


def evaluate(settings: Settings, progress: Callable[[int, int], None]) -> list[dict[str, Any]]:
    """Run every rollout that is still to do and return all episodes.

    Args:
        progress: told how many rollouts are done and how many there are.

    Raises:
        ScengenError: a pool, a policy or a setting is not as it must be.
    """
    settings.check()
    pools = [Pool.open(folder).check() for folder in settings.folders]
    rows = [row for pool in pools for row in _chosen(pool, settings.seeds)]
    jobs = [Job(r["task"], r["pool"], r["id"], k) for r in rows for k in range(settings.rollouts)]
    about = {(r["pool"], r["id"]): {k: r[k] for k in ("task", "category", "split")} for r in rows}
    with Log(settings.folder / "episodes.jsonl", _identity(settings, pools)) as log:
        done = {(e["pool"], e["scenario"], e["rollout"]) for e in log.records}
        todo = [job for job in jobs if (job.pool, job.scenario, job.rollout) not in done]
        todo.sort(key=lambda job: job.task)  # a worker then changes its environment seldom
        progress(len(jobs) - len(todo), len(jobs))
        results = each(_play, todo, settings.workers, _begin, (settings,))
        for count, episode in enumerate(results, len(jobs) - len(todo) + 1):
            log.add({**about[episode["pool"], episode["scenario"]], **episode})
            progress(count, len(jobs))
        wanted = {(j.pool, j.scenario, j.rollout) for j in jobs}
        return sorted(
            (e for e in log.records if (e["pool"], e["scenario"], e["rollout"]) in wanted),
            key=lambda e: (e["task"], e["split"] != ID, e["split"], e["scenario"], e["rollout"]),
        )


def table(episodes: Sequence[Mapping[str, Any]]) -> list[Line]:
    """The paper's table: one line for every task and OOD split, for every category, and for all together.

    A category's rate is over all its scenarios: with as many scenarios for each task, the mean of its tasks.
    """
    lines = []
    for task in _distinct(episodes, "task"):
        mine = [e for e in episodes if e["task"] == task]
        lines += [_line(task, split, mine) for split in _distinct(mine, "split") if split != ID] or [
            _line(task, ID, mine)
        ]
    for category in _distinct(episodes, "category"):
        lines.append(_line(category, "all", [e for e in episodes if e["category"] == category]))
    return [*lines, _line("all", "all", episodes)]


def markdown(lines: Sequence[Line], settings: Settings) -> str:
    """The table as Markdown, rates and 95 % intervals in percent."""
    head = (
        f"Policy `{settings.policy}`: success in percent [95 % interval], {settings.seeds} scenarios a pool, "
        f"{settings.rollouts} rollouts each\n\n| | split | ID | OOD | difference |\n|---|---|---|---|---|\n"
    )
    return head + "".join(f"| {' | '.join(cells(line))} |\n" for line in lines)


def cells(line: Line) -> list[str]:
    """A line of the table in words."""
    return [line.what, line.split, _spelled(line.id), _spelled(line.ood), _spelled(line.difference, "+")]


def plain(lines: Sequence[Line]) -> list[dict[str, Any]]:
    """The table as plain data."""
    return [asdict(line) for line in lines]


def _line(what: str, split: str, episodes: Sequence[Mapping[str, Any]]) -> Line:
    training = [e for e in episodes if e["split"] == ID]
    shifted = [e for e in episodes if e["split"] != ID and split in ("all", e["split"])]
    inside = rate(_clusters(training)) if training else None
    outside = rate(_clusters(shifted)) if shifted else None
    apart = difference(outside, inside) if inside and outside else None
    return Line(what, split, inside, outside, apart)


def _clusters(episodes: Sequence[Mapping[str, Any]]) -> list[list[bool]]:
    def key(episode: Mapping[str, Any]) -> tuple[str, str]:
        return episode["pool"], episode["scenario"]

    ordered = sorted(episodes, key=key)
    return [[e["success"] for e in group] for _, group in itertools.groupby(ordered, key)]


def _distinct(episodes: Sequence[Mapping[str, Any]], name: str) -> list[str]:
    return list(dict.fromkeys(e[name] for e in episodes))


def _spelled(rate: Rate | Difference | None, sign: str = "") -> str:
    if rate is None:
        return "-"
    return f"{100 * rate.value:{sign}.1f} [{100 * rate.low:{sign}.1f}, {100 * rate.high:{sign}.1f}]"


def _chosen(pool: Pool, seeds: int) -> list[Row]:
    if len(pool) < seeds:
        raise BadConfig(f"seeds = {seeds}, but {pool.folder} holds {len(pool)} scenarios; say seeds={len(pool)}")
    rows = pool.rows(["id", "task", "category", "split"])
    return [{**row, "pool": str(pool.folder)} for row in itertools.islice(rows, seeds)]


def _identity(settings: Settings, pools: Sequence[Pool]) -> dict[str, Any]:
    """What the outcome of a rollout depends on. More seeds or rollouts continue the same run."""
    chosen = {name: getattr(settings, name) for name in ("policy", "observations", "width", "height")}
    return {**chosen, "pools": {str(pool.folder): pool.sha256 for pool in pools}}


# --- in a worker process ----------------------------------------------------------------------


_settings: Settings
_running: dict[str, tuple[ScenarioEnv, Policy]] = {}


def _begin(settings: Settings) -> None:
    global _settings
    _settings = settings
    _running.clear()


def _play(job: Job) -> dict[str, Any]:
    """One rollout, from reset to its end."""
    if job.task not in _running:
        for env, _ in _running.values():
            env.close()
        _running.clear()
        _running[job.task] = _prepare(job.task)
    env, policy = _running[job.task]
    observation, info = env.reset(options={"scenario": job.scenario})
    policy.reset(observation, info, int(2**31 * unit("rollout", job.scenario, job.rollout)))
    over, total = False, 0.0
    while not over:
        action = np.asarray(policy.act(observation))
        try:
            observation, reward, terminated, truncated, info = env.step(action)
        except ValueError as error:
            raise BadPolicy(f"policy {_settings.policy} on scenario {job.scenario}: {error}") from None
        over, total = terminated or truncated, total + reward
    return {
        "pool": job.pool,
        "scenario": job.scenario,
        "rollout": job.rollout,
        "success": bool(info["success"]),
        "reason": info["reason"],
        "seconds": round(info["time"], 3),
    }


def _prepare(task: str) -> tuple[ScenarioEnv, Policy]:
    folders = [f for f in _settings.folders if any(r["task"] == task for r in Pool.open(f).rows(["task"]))]
    env = ScenarioEnv(task, folders, _settings.observations, width=_settings.width, height=_settings.height)
    memory = list(_training(folders)) if _settings.policy == REPLAY else []
    return env, find(_settings.policy, memory)(env)


def _training(folders: Sequence[str]) -> Iterator[Row]:
    for folder in folders:
        for row in Pool.open(folder).rows(["id", "task", "split", "params", "witness"]):
            if row["split"] == ID:
                yield {**row, "values": json.loads(row["params"])}
