"""Evaluation of a policy on pools: the paper's table of success in and out of distribution, with intervals.

Episodes are kept in `<to>/episodes.jsonl` as they end, so that a run that was killed goes on where it was.
"""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..control.teleop import check_filter
from ..envs.gym import PoolEnv
from ..errors import BadConfig, PoolError, ScengenError, at_least
from ..pool import Pool, collection
from ..pool.library import Library
from ..samplers.keyed import unit
from ..samplers.split import ID
from ..statistics import Difference, Rate, difference, mean_difference, mean_rate, paired, rate
from ..validate.playable import unplayable
from ..work.log import Log
from ..work.parallel import Workers, each
from ..work.targets import refused, try_folder
from .policies import AT_FULL_RATE, REPLAY, Policy, blamed, find, identity, made


class BadPolicy(ScengenError):
    """A policy gave something that is no action."""


@dataclass(frozen=True)
class EvaluateSettings:
    """Settings of `scengen evaluate`; meanings stand in conf/command/evaluate.yaml."""

    policy: str = ""
    pool: str | list[str] = ""
    seeds: int = 20
    rollouts: int = 5
    observations: list[str] | None = None
    width: int = 256
    height: int = 256
    workers: Workers = 1
    to: str | None = None
    version: str | None = None
    fresh: bool = False
    action_filter: str | None = None
    action_repeat: int = 1

    @cached_property
    def folders(self) -> list[str]:
        """The pools to evaluate on."""
        return collection.folders(self.pool)

    @property
    def folder(self) -> Path:
        """Where results go."""
        return Path(self.to or f"generated/evaluation/{self.policy.replace(':', '.')}")

    def check(self) -> None:
        """Raise `ScengenError` for settings that make no sense."""
        check_filter(self.action_filter)
        at_least(self, seeds=1, rollouts=1, workers=1, width=1, height=1)
        if self.action_repeat != 1 and self.policy in AT_FULL_RATE:
            raise BadConfig(f"action_repeat = {self.action_repeat}; {self.policy} acts at 100 Hz: leave it out")


@dataclass(frozen=True, order=True)
class RolloutId:
    """Which rollout: number `rollout` of a scenario."""

    task: str
    pool: str
    scenario: str
    rollout: int


@dataclass(frozen=True)
class TableLine:
    """One line of the table: a task or a category, on one OOD split."""

    what: str
    split: str
    id: Rate | None
    """None where no training pool was given."""
    ood: Rate | None
    """None where no other pool was given."""
    difference: Difference | None
    """OOD minus ID."""


@dataclass(frozen=True)
class Evaluation:
    """What an evaluation came to."""

    episodes: list[dict[str, Any]]
    earlier: int
    """How many of them an earlier run of the same command had played."""
    lost: Mapping[str, str]
    """Scenarios that were left out, and why: they cannot be played within the limits."""


def evaluate(
    settings: EvaluateSettings, progress: Callable[[int, int], None], search: Sequence[str] = ()
) -> Evaluation:
    """Run every rollout that is still to do and return all episodes.

    Episodes are bound to the pools, the settings and the policy (see `policies.identity`): those of a policy that has
    changed since are never mixed with new ones.

    Args:
        progress: told how many rollouts are done and how many there are.
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        ScengenError: a pool, a policy or a setting is not as it must be.
    """
    settings.check()
    try_folder(settings.folder)
    pools = [Pool.open(folder).check() for folder in settings.folders]
    about: dict[tuple[str, str], dict[str, Any]] = {}
    for pool in pools:
        about |= _chosen(pool, settings.seeds)
    first = itertools.chain.from_iterable(itertools.islice(pool.rows(), settings.seeds) for pool in pools)
    if lost := dict(unplayable(first, settings.workers)):
        about = {(pool, id_): a for (pool, id_), a in about.items() if id_ not in lost}
        if not about:
            raise PoolError(f"no scenario can be played; see scengen verify: {'; '.join(lost.values())}")
    wanted = {RolloutId(a["task"], *key, k) for key, a in about.items() for k in range(settings.rollouts)}
    path, player = settings.folder / "episodes.jsonl", PolicyPlayer(settings, search)
    depends = {**_identity(settings, pools), "code": player.identities({a["task"] for a in about.values()})}
    if settings.workers != 1:
        player = PolicyPlayer(_elsewhere(settings), search)  # each worker makes its own policy
    if settings.fresh:
        _move_aside(path)
    remedy = "say fresh=true to begin anew (they are moved aside), or choose another to="
    with Log(path, depends, remedy) as log:
        todo = sorted(wanted - set(map(_id, log.records)))  # tasks one after the other, see `PolicyPlayer`
        done = len(wanted) - len(todo)
        progress(done, len(wanted))
        for count, episode in enumerate(each(player, todo, settings.workers), done + 1):
            log.add({"task": about[episode["pool"], episode["scenario"]]["task"], **episode})
            progress(count, len(wanted))
        episodes = sorted(
            ({**about[e["pool"], e["scenario"]], **e} for e in log.records if _id(e) in wanted),
            key=lambda e: (e["task"], e["split"] != ID, e["split"], e["scenario"], e["rollout"]),
        )
        return Evaluation(episodes, done, lost)


def table(episodes: Sequence[Mapping[str, Any]]) -> list[TableLine]:
    """The paper's table: one line for every task and OOD split, for every category, and for all tasks together.

    A scenario counts once, whatever the number of its rollouts. Scenario i of an axis is scenario i of training with
    the axis moved: differences are taken within twins where training has at least half of them, and a line over several
    axes takes the mean over them for each i first. Categories are means over their tasks, with equal weights on both
    sides: tasks with many axes count no more than others.
    """
    lines, whole = [], []
    for task in _distinct(episodes, "task"):
        cells = _cells(e for e in episodes if e["task"] == task)
        training, axes = cells.pop(ID, {}), cells
        lines += [_line(task, axis, training, [shares]) for axis, shares in axes.items()]
        every = _line(task, "all", training, list(axes.values()))
        if len(axes) > 1:
            lines.append(every)
        elif not axes:
            lines.append(replace(every, split=ID))
        category = next(e["category"] for e in episodes if e["task"] == task)
        whole.append((category, every))
    for category in dict.fromkeys(name for name, _ in whole):
        lines.append(_mean_line(category, [line for name, line in whole if name == category]))
    return [*lines, _mean_line("all", [line for _, line in whole])]


def markdown(lines: Sequence[TableLine], settings: EvaluateSettings) -> str:
    """The table as Markdown, rates and 95 % intervals in percent."""
    head = (
        f"Policy `{settings.policy}`: success in percent [95 % interval], {settings.seeds} scenarios a pool, "
        f"{settings.rollouts} rollouts each\n\n| | split | ID | OOD | difference |\n|---|---|---|---|---|\n"
    )
    return head + "".join(f"| {' | '.join(cells(line))} |\n" for line in lines)


def cells(line: TableLine) -> list[str]:
    """A line of the table in words."""
    return [line.what, line.split, _spelled(line.id), _spelled(line.ood), _spelled(line.difference, "+")]


def plain(lines: Sequence[TableLine]) -> list[dict[str, Any]]:
    """The table as plain data."""
    return [asdict(line) for line in lines]


Outcomes = dict[tuple[int, int], list[bool]]
"""Outcomes of the rollouts of each scenario of a split, by seed and index: twins have the same in all splits."""


def _cells(episodes: Iterable[Mapping[str, Any]]) -> dict[str, Outcomes]:
    """By split."""
    found: dict[str, Outcomes] = {}
    for e in episodes:
        found.setdefault(e["split"], {}).setdefault((e["seed"], e["index"]), []).append(e["success"])
    return found


def _line(what: str, split: str, training: Outcomes, axes: Sequence[Outcomes]) -> TableLine:
    """One task. Several axes are averaged over the scenarios that all of them have."""
    inside = rate(list(training.values())) if training else None
    shared = [key for key in axes[0] if all(key in axis for axis in axes)] if axes else []
    if not shared:
        return TableLine(what, split, inside, None, None)
    outcomes = {key: [success for axis in axes for success in _equally(axis[key], axes, key)] for key in shared}
    outside = rate(list(outcomes.values()))
    twins = [key for key in shared if key in training]
    if inside is None:
        return TableLine(what, split, None, outside, None)
    if 2 * len(twins) >= len(shared) and len(twins) > 1:
        apart = paired([outcomes[key] for key in twins], [training[key] for key in twins])
    else:
        apart = difference(outside, inside)
    return TableLine(what, split, inside, outside, apart)


def _equally(outcomes: list[bool], axes: Sequence[Outcomes], key: tuple[int, int]) -> list[bool]:
    """As many rollouts of every axis, so that each has the same weight."""
    return outcomes[: min(len(axis[key]) for axis in axes)]


def _mean_line(what: str, lines: Sequence[TableLine]) -> TableLine:
    """The mean of some tasks, over those that have both sides if any has."""
    both = [line for line in lines if line.difference is not None]
    if not both:
        inside = [line.id for line in lines if line.id is not None]
        outside = [line.ood for line in lines if line.ood is not None]
        return TableLine(
            what, "all", mean_rate(inside) if inside else None, mean_rate(outside) if outside else None, None
        )
    parts = [(line.id, line.ood, line.difference) for line in both]
    inside, outside, apart = ([part for part in column if part is not None] for column in zip(*parts, strict=True))
    return TableLine(what, "all", mean_rate(inside), mean_rate(outside), mean_difference(apart))


def _distinct(episodes: Sequence[Mapping[str, Any]], name: str) -> list[str]:
    return list(dict.fromkeys(e[name] for e in episodes))


def _spelled(rate: Rate | Difference | None, sign: str = "") -> str:
    if rate is None:
        return "-"
    return f"{100 * rate.value:{sign}.1f} [{100 * rate.low:{sign}.1f}, {100 * rate.high:{sign}.1f}]"


def _id(episode: Mapping[str, Any]) -> RolloutId:
    return RolloutId(**{f.name: episode[f.name] for f in fields(RolloutId)})


def _chosen(pool: Pool, seeds: int) -> dict[tuple[str, str], dict[str, Any]]:
    """What the table needs to know of the first scenarios of a pool, by the pool's folder and their ids."""
    if len(pool) < seeds:
        raise BadConfig(f"seeds = {seeds}, but {pool.folder} holds {len(pool)} scenarios; say seeds={len(pool)}")
    names = ("task", "category", "split", "seed", "index")
    rows = itertools.islice(pool.columns("id", *names), seeds)
    return {(str(pool.folder), id_): dict(zip(names, told, strict=True)) for id_, *told in rows}


def _identity(settings: EvaluateSettings, pools: Sequence[Pool]) -> dict[str, Any]:
    """What the outcome of a rollout depends on. More seeds or rollouts continue the same run."""
    names = ("policy", "version", "observations", "width", "height", "action_filter", "action_repeat")
    chosen = {name: getattr(settings, name) for name in names}
    return {**chosen, "pools": {str(pool.folder): pool.sha256 for pool in pools}}


def _elsewhere(settings: EvaluateSettings) -> EvaluateSettings:
    """EvaluateSettings for workers, which need not be where this process is: their paths are whole."""
    return replace(settings, pool=[str(Path(folder).resolve()) for folder in settings.folders], workers=1)


def _move_aside(path: Path) -> None:
    """Give the episodes of earlier runs another name; nothing is deleted."""
    if not path.exists():
        return
    free = next(p for k in itertools.count(1) if not (p := path.with_name(f"{path.stem}-{k}{path.suffix}")).exists())
    try:
        path.rename(free)
    except OSError as error:
        raise refused(path, error) from None


class PolicyPlayer:
    """Plays rollouts: one environment and one policy at a time, kept as long as the task stays the same."""

    def __init__(self, settings: EvaluateSettings, search: Sequence[str] = ()):
        self.settings, self.search = settings, search
        self._running: tuple[PoolEnv, Policy] | None = None

    def __call__(self, which: RolloutId) -> dict[str, Any]:
        """One rollout, from reset to its end.

        Raises:
            BadPolicy: the policy gave something that is no action.
        """
        env, policy = self._prepared(which.task)
        observation, info = env.reset(options={"scenario": which.scenario})
        name, where = self.settings.policy, f"on scenario {env.row.name}"
        with blamed(name, f"its reset {where}"):
            policy.reset(observation, info, int(2**31 * unit("rollout", which.scenario, which.rollout)))
        over = False
        while not over:
            with blamed(name, f"its act {where}"):
                action = np.asarray(policy.act(observation), float)
            try:
                observation, _, terminated, truncated, info = env.step(action)
            except (ValueError, TypeError) as error:
                raise BadPolicy(f"policy {name} {where}: {error}") from None
            over = terminated or truncated
        return {
            "pool": which.pool,
            "scenario": which.scenario,
            "rollout": which.rollout,
            "success": bool(info["success"]),
            "reason": info["reason"],
            "seconds": round(info["time"], 3),
        }

    def identities(self, tasks: set[str]) -> dict[str, str]:
        """What the policy is, by task: see `policies.identity`."""
        return {task: self._identity(task) for task in sorted(tasks)}

    def _identity(self, task: str) -> str:
        _, policy = self._prepared(task)
        return identity(self.settings.policy, find(self.settings.policy), policy)

    def _prepared(self, task: str) -> tuple[PoolEnv, Policy]:
        if self._running and self._running[0].task.name != task:
            self._running[0].close()
            self._running = None
        if not self._running:
            settings = self.settings
            folders = [f for f in settings.folders if task in Pool.open(f).kinds("task")[0]]
            env = PoolEnv(
                task,
                folders,
                settings.observations,
                width=settings.width,
                height=settings.height,
                action_filter=settings.action_filter,
                action_repeat=settings.action_repeat,
                settle=True,
                search=self.search,
            )
            memory = _training(folders) if settings.policy == REPLAY else None
            self._running = env, made(settings.policy, find(settings.policy, memory), env)
        return self._running


def _training(folders: Sequence[str]) -> Library | None:
    """The training scenarios of some pools; None if there are none."""
    every = Library([Pool.open(folder) for folder in folders])
    return every.of_split(ID) if ID in every.kinds("split") else None
