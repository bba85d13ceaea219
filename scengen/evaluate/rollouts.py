"""Evaluation of a policy on pools: the paper's table of success in and out of distribution, with intervals.

Episodes are kept in `<to>/episodes.jsonl` as they end, so that a run that was killed goes on where it was.
"""

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..compose import load_task
from ..control.teleop import check_filter
from ..envs.gym import PoolEnv
from ..episode import STRICT, check_rules
from ..errors import BadConfig, PoolError, ScengenError, at_least
from ..learn.store import is_policy, read_settings
from ..pool import Pool, collection
from ..pool.library import Library
from ..samplers.keyed import unit
from ..samplers.split import ID
from ..validate.playable import unplayable
from ..work.log import Log
from ..work.parallel import Workers, each
from ..work.targets import refused, try_folder
from .policies import FULL_RATE_POLICIES, REPLAY, Policy, find_policy, identity, make_policy, policy_errors
from .remote.client import ClientSettings, address_of, is_address, read_client


class BadPolicy(ScengenError):
    """A policy returned an invalid action."""


@dataclass(frozen=True)
class EvaluateSettings:
    """Settings of `scengen evaluate`; conf/command/evaluate.yaml explains them."""

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
    rules: str = STRICT
    client: str | None = None

    @cached_property
    def folders(self) -> list[str]:
        """Folders of the pools."""
        return collection.folders(self.pool)

    @property
    def folder(self) -> Path:
        """Folder of the results."""
        return Path(self.to or Path("generated/evaluation", re.sub(r"[^\w.-]+", ".", self.policy)))

    @cached_property
    def remote(self) -> ClientSettings | None:
        """Names of observations and actions of a policy behind a socket; None for other policies."""
        return read_client(self.client, address_of(self.policy)) if is_address(self.policy) else None

    def check(self) -> None:
        """Raise `ScengenError` if a setting is not valid."""
        check_filter(self.action_filter)
        check_rules(self.rules)
        at_least(self, seeds=1, rollouts=1, workers=1, width=1, height=1)
        if self.action_repeat != 1 and self.policy in FULL_RATE_POLICIES:
            raise BadConfig(f"action_repeat = {self.action_repeat}; policy {self.policy} acts at 100 Hz: leave it out")
        if self.remote:
            for name, free in (("observations", None), ("action_repeat", 1)):
                if getattr(self, name) != free:
                    raise BadConfig(f"{name} = {getattr(self, name)}; {self.remote.file} decides it: leave it out")
        elif self.client is not None:
            raise BadConfig(f"client = {self.client}; policy {self.policy} is not behind a socket: leave it out")


@dataclass(frozen=True, order=True)
class RolloutId:
    """The identity of a rollout: number `rollout` of a scenario."""

    task: str
    pool: str
    scenario: str
    rollout: int


@dataclass(frozen=True)
class Evaluation:
    """The result of an evaluation."""

    episodes: list[dict[str, Any]]
    """Records of the episodes."""
    earlier: int
    """Number of episodes that an earlier run of the same command played."""
    lost: Mapping[str, str]
    """Scenarios that were left out because they cannot be played within the limits, with the reasons."""


def evaluate(
    settings: EvaluateSettings, progress: Callable[[int, int], None], search: Sequence[str] = ()
) -> Evaluation:
    """Play every rollout that was not played yet, and return all episodes.

    Episodes are bound to the pools, the settings and the policy (see `policies.identity`): episodes of an older version
    of a policy are never mixed with new ones.

    Args:
        progress: called with the number of rollouts done, and their total.
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        ScengenError: a pool, a policy or a setting is not valid.
    """
    settings = _completed(settings)
    settings.check()
    try_folder(settings.folder)
    pools = [Pool.open(folder).check() for folder in settings.folders]
    about, lost = _scenarios(pools, settings)
    wanted = {RolloutId(a["task"], *key, k) for key, a in about.items() for k in range(settings.rollouts)}
    path = settings.folder / "episodes.jsonl"
    if settings.remote and settings.version is None and not settings.fresh and path.exists():
        why = f"{path} holds episodes of an earlier run, and a server does not say which weights it serves"
        raise BadConfig(f"{why}; say fresh=true to begin anew, or version=NAME from the start to be able to continue")
    remedy = "say fresh=true to begin anew (old episodes are moved aside), or choose another to="
    with closing(PolicyPlayer(settings, search)) as player:
        depends = {**_identity(settings, pools), "code": player.identities({a["task"] for a in about.values()})}
        if settings.fresh:
            _move_aside(path)
        play = player if settings.workers == 1 else PolicyPlayer(_for_workers(settings), search)  # one for each worker
        with Log(path, depends, remedy) as log:
            todo = sorted(wanted - set(map(_id, log.records)))  # tasks one after the other, see `PolicyPlayer`
            done = len(wanted) - len(todo)
            progress(done, len(wanted))
            for count, episode in enumerate(each(play, todo, settings.workers), done + 1):
                log.add({"task": about[episode["pool"], episode["scenario"]]["task"], **episode})
                progress(count, len(wanted))
            records = log.records
    episodes = sorted(
        ({**about[e["pool"], e["scenario"]], **e} for e in records if _id(e) in wanted),
        key=lambda e: (e["task"], e["split"] != ID, e["split"], e["scenario"], e["rollout"]),
    )
    return Evaluation(episodes, done, lost)


def _completed(settings: EvaluateSettings) -> EvaluateSettings:
    """Settings with the observations and the rate of a policy that names them, unless they were chosen."""
    if not is_policy(settings.policy):
        return settings
    own = read_settings(settings.policy)
    repeat = own.action_repeat if settings.action_repeat == 1 else settings.action_repeat
    return replace(settings, observations=settings.observations or list(own.streams), action_repeat=repeat)


def _id(episode: Mapping[str, Any]) -> RolloutId:
    return RolloutId(**{f.name: episode[f.name] for f in fields(RolloutId)})


Scenarios = dict[tuple[str, str], dict[str, Any]]
"""Columns of scenarios that the table needs, by the pool's folder and the scenario's id."""


def _scenarios(pools: Sequence[Pool], settings: EvaluateSettings) -> tuple[Scenarios, dict[str, str]]:
    """The scenarios that can be played, and those that cannot, with the reasons.

    Raises:
        PoolError: no scenario can be played.
    """
    about: Scenarios = {}
    for pool in pools:
        about |= _first_scenarios(pool, settings.seeds)
    first = itertools.chain.from_iterable(itertools.islice(pool.rows(), settings.seeds) for pool in pools)
    if lost := dict(unplayable(first, settings.workers)):
        about = {(pool, id_): a for (pool, id_), a in about.items() if id_ not in lost}
        if not about:
            raise PoolError(f"no scenario can be played; see scengen verify: {'; '.join(lost.values())}")
    return about, lost


def _first_scenarios(pool: Pool, seeds: int) -> Scenarios:
    """The first scenarios of a pool."""
    if not len(pool):
        raise BadConfig(f"{pool.folder} holds no scenario; choose another pool")
    if len(pool) < seeds:
        raise BadConfig(f"seeds = {seeds}, but {pool.folder} holds {len(pool)} scenarios; say seeds={len(pool)}")
    names = ("task", "category", "split", "seed", "index")
    rows = itertools.islice(pool.columns("id", *names), seeds)
    return {(str(pool.folder), id_): dict(zip(names, told, strict=True)) for id_, *told in rows}


def _identity(settings: EvaluateSettings, pools: Sequence[Pool]) -> dict[str, Any]:
    """Everything on which the outcome of a rollout depends. More seeds or rollouts continue the same run."""
    names = ("policy", "version", "observations", "width", "height", "action_filter", "action_repeat", "rules")
    chosen = {name: getattr(settings, name) for name in names}
    if settings.remote:
        chosen["client"] = settings.remote.identity()
    return {**chosen, "pools": {str(pool.folder): pool.sha256 for pool in pools}}


def _for_workers(settings: EvaluateSettings) -> EvaluateSettings:
    """Settings for workers, which may run in another folder: with absolute paths."""
    folders = [str(Path(folder).resolve()) for folder in settings.folders]
    client = settings.remote and str(Path(settings.remote.file).resolve())
    return replace(settings, pool=folders, client=client, workers=1)


def _move_aside(path: Path) -> None:
    """Rename the file of episodes of earlier runs; nothing is deleted."""
    if not path.exists():
        return
    free = next(p for k in itertools.count(1) if not (p := path.with_name(f"{path.stem}-{k}{path.suffix}")).exists())
    try:
        path.rename(free)
    except OSError as error:
        raise refused(path, error) from None


class PolicyPlayer:
    """Plays rollouts. It keeps one environment and one policy as long as the task stays the same."""

    def __init__(self, settings: EvaluateSettings, search: Sequence[str] = ()):
        self.settings, self.search = settings, search
        self._running: tuple[PoolEnv, Policy] | None = None

    def __call__(self, which: RolloutId) -> dict[str, Any]:
        """Play one rollout, from reset to its end.

        Raises:
            BadPolicy: the policy returned an invalid action.
        """
        env, policy = self._prepared_for(which.task)
        observation, info = env.reset(options={"scenario": which.scenario})
        name, where = self.settings.policy, f"on scenario {env.row.name}"
        with policy_errors(name, f"its reset {where}"):
            policy.reset(observation, info, int(2**31 * unit("rollout", which.scenario, which.rollout)))
        over = False
        while not over:
            with policy_errors(name, f"its act {where}"):
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
        """Hashes of the policy by task, see `policies.identity`."""
        return {task: self._identity(task) for task in sorted(tasks)}

    def _identity(self, task: str) -> str:
        _, policy = self._prepared_for(task)
        factory = find_policy(self.settings.policy, client=self.settings.remote)
        return identity(self.settings.policy, factory, policy)

    def _prepared_for(self, task: str) -> tuple[PoolEnv, Policy]:
        if self._running and self._running[0].task.name != task:
            self.close()
        if not self._running:
            settings, remote = self.settings, self.settings.remote
            folders = [f for f in settings.folders if task in Pool.open(f).kinds("task")[0]]
            env = PoolEnv(
                task,
                folders,
                remote.streams(load_task(task, self.search).embodiment) if remote else settings.observations,
                width=settings.width,
                height=settings.height,
                action_filter=settings.action_filter,
                action_repeat=remote.repeat if remote else settings.action_repeat,
                rules=check_rules(settings.rules),
                settle=True,
                search=self.search,
            )
            memory = _training(folders) if settings.policy == REPLAY else None
            factory = find_policy(settings.policy, memory, remote)
            self._running = env, make_policy(settings.policy, factory, env)
        return self._running

    def close(self) -> None:
        """Close the environment, and the policy if it has a method `close`."""
        if self._running:
            env, policy = self._running
            env.close()
            if callable(close := getattr(policy, "close", None)):
                with policy_errors(self.settings.policy, "its close"):
                    close()
            self._running = None


def _training(folders: Sequence[str]) -> Library | None:
    """The training scenarios of the pools; None if there are none."""
    every = Library([Pool.open(folder) for folder in folders])
    return every.of_split(ID) if ID in every.kinds("split") else None
