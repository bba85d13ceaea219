"""Evaluation of a policy on pools: the paper's table of success in and out of distribution, with intervals.

Episodes are kept in `<to>/episodes.jsonl` as they end, so that a run that was killed goes on where it was.
"""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

from ..compose import load_task
from ..episode import Actions
from ..errors import BadConfig, PoolError
from ..look.looks import look_named
from ..pool import Pool, kinds
from ..samplers.split import ID
from ..samplers.task_files import about as about_task
from ..validate.playable import unplayable
from ..work.log import Log
from ..work.machine import cores
from ..work.parallel import each
from ..work.targets import refused, try_folder
from .player import PolicyPlayer
from .settings import PAPER, EvaluateSettings, RolloutId, completed

Keep = Callable[[RolloutId, Actions], None]
"""Keeps the actions that the controller received in a rollout; called before the rollout counts as played."""


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
    settings: EvaluateSettings,
    progress: Callable[[int, int], None],
    search: Sequence[str] = (),
    keep: Keep = lambda which, actions: None,
) -> Evaluation:
    """Play every rollout that was not played yet, and return all episodes.

    Episodes are bound to the pools, the settings and the policy (see `policies.identity`): episodes of an older version
    of a policy are never mixed with new ones.

    Args:
        progress: called with the number of rollouts done, and their total.
        search: overrides that add folders of other packages, see `task_files.search_path`.
        keep: called with the actions of every rollout that is played to its end, if episodes are kept.

    Raises:
        ScengenError: a pool, a policy or a setting is not valid.
    """
    settings = completed(settings)
    settings.check()
    kinds.check_target(settings.folder, kinds.EPISODES)
    try_folder(settings.folder)
    pools = [Pool.open(folder).check() for folder in settings.folders]
    about, lost = _scenarios(pools, settings, search)
    wanted = {RolloutId(a["task"], *key, k) for key, a in about.items() for k in range(settings.rollouts)}
    path = settings.folder / kinds.EPISODES
    if settings.remote and settings.version is None and not settings.fresh and path.exists():
        why = f"{path} holds episodes of an earlier run, and a server does not say which weights it serves"
        raise BadConfig(f"{why}; pass fresh=true to start again, or version=NAME from the start to be able to continue")
    remedy = "pass fresh=true to start again (old episodes are moved aside), or choose another to="
    with closing(PolicyPlayer(settings, search)) as player:
        versions = {a["task"]: a["task_version"] for a in about.values()}
        code = {"server" if settings.remote else "code": player.identities({*versions})}
        depends = {**_identity(settings, pools), "task_versions": versions, **code}
        if settings.fresh:
            _move_aside(path)
        with Log(path, depends, remedy) as log:
            todo = sorted(wanted - set(map(_id, log.records)))  # tasks one after the other, see `PolicyPlayer`
            done = len(wanted) - len(todo)
            progress(done, len(wanted))
            player.strict = not done
            for count, episode in enumerate(_played(player, todo), done + 1):
                played, task = episode.pop("played", None), about[episode["pool"], episode["scenario"]]["task"]
                if played is not None:
                    keep(_id({"task": task, **episode}), played)
                log.add({"task": task, "task_version": versions[task], **episode})
                progress(count, len(wanted))
            records = log.records
    episodes = sorted(
        ({**about[e["pool"], e["scenario"]], **e} for e in records if _id(e) in wanted),
        key=lambda e: (e["task"], e["split"] != ID, e["split"], e["scenario"], e["rollout"]),
    )
    return Evaluation(episodes, done, lost)


def _played(player: PolicyPlayer, todo: Sequence[RolloutId]) -> Iterator[dict[str, Any]]:
    """Records of the rollouts as their batches are played. Those of a batch whose process dies are played alone."""
    settings, alone = player.settings, list[Sequence[RolloutId]]()
    play = player if settings.workers == 1 else _for_workers(player)

    def lost(batch: Sequence[RolloutId], reason: str) -> list[dict[str, Any]]:
        if len(batch) == 1:
            return [_crashed(batch[0], reason)]
        alone.extend([which] for which in batch)
        return []

    of_tasks = [list(group) for _, group in itertools.groupby(todo, lambda which: which.task)]
    batches = [some[i : i + settings.slots] for some in of_tasks for i in range(0, len(some), settings.slots)]
    for some in (batches, alone):
        for records in each(play, some, settings.workers, lost=lost):
            yield from records


def _id(episode: Mapping[str, Any]) -> RolloutId:
    return RolloutId(**{f.name: episode[f.name] for f in fields(RolloutId)})


Scenarios = dict[tuple[str, str], dict[str, Any]]
"""Columns of scenarios that the table needs, by the pool's folder and the scenario's id."""


def _scenarios(
    pools: Sequence[Pool], settings: EvaluateSettings, search: Sequence[str]
) -> tuple[Scenarios, dict[str, str]]:
    """The scenarios that can be played, and those that cannot, with the reasons.

    Raises:
        PoolError: no scenario can be played.
    """
    about: Scenarios = {}
    for pool in pools:
        about |= _first_scenarios(pool, settings, search)
    if not about:
        named = ", ".join(sorted({split for pool in pools for split in pool.kinds("split")[0]}))
        raise BadConfig(f"splits = {settings.splits}; these pools have none of them, but {named}; pass splits=all")
    rows = (
        row
        for pool in pools
        for row in itertools.islice(pool.rows(), _last(pool, about))
        if (str(pool.folder), row.id) in about
    )
    if lost := dict(unplayable(rows, settings.workers)):
        about = {(pool, id_): a for (pool, id_), a in about.items() if id_ not in lost}
        if not about:
            raise PoolError(f"no scenario can be played; see scengen verify: {'; '.join(lost.values())}")
    return about, lost


def _first_scenarios(pool: Pool, settings: EvaluateSettings, search: Sequence[str]) -> Scenarios:
    """The first scenarios of a pool, of the chosen splits.

    Raises:
        BadConfig: the pool holds fewer.
    """
    if not len(pool):
        raise BadConfig(f"{pool.folder} holds no scenario; choose another pool")
    names = ("task", "category", "split", "seed", "index")
    every: list[tuple[str, dict[str, Any]]] = [
        (id_, dict(zip(names, told, strict=True))) for id_, *told in pool.columns("id", *names)
    ]
    versions = {name: load_task(name, search).version for name in {told["task"] for _, told in every}}
    every = [(id_, {**told, "task_version": versions[told["task"]]}) for id_, told in every]
    wanted = [(id_, told) for id_, told in every if _is_wanted(told["task"], told["split"], settings.splits, search)]
    if wanted and len(wanted) < settings.seeds:
        remedy = f"pass seeds={len(wanted)}"
        raise BadConfig(f"seeds = {settings.seeds}, but {pool.folder} holds {len(wanted)} scenarios; {remedy}")
    return {(str(pool.folder), id_): told for id_, told in wanted[: settings.seeds]}


def _is_wanted(task: str, split: str, splits: str, search: Sequence[str]) -> bool:
    """Whether a split belongs to a set of splits."""
    return splits != PAPER or split == ID or split in _paper_axes(task, tuple(search))


@cache
def _paper_axes(task: str, search: tuple[str, ...]) -> tuple[str, ...]:
    return about_task(task, search).paper_axes


def _last(pool: Pool, about: Scenarios) -> int:
    """Number of rows of a pool up to the last chosen one."""
    numbers = [n for n, (id_,) in enumerate(pool.columns("id"), 1) if (str(pool.folder), id_) in about]
    return max(numbers, default=0)


def _crashed(which: RolloutId, reason: str) -> dict[str, Any]:
    """The record of a rollout whose process died twice."""
    key = {"pool": which.pool, "scenario": which.scenario, "rollout": which.rollout}
    return {**key, "success": False, "reason": "", "seconds": 0.0, "phase": "", "crashed": f"the process {reason}"}


def _identity(settings: EvaluateSettings, pools: Sequence[Pool]) -> dict[str, Any]:
    """Everything on which the outcome of a rollout depends. More seeds or rollouts continue the same run."""
    names = ("policy", "version", "observations", "width", "height", "action_filter", "action_repeat", "rules")
    chosen = {**{name: getattr(settings, name) for name in names}, "look": str(look_named(settings.look))}
    if settings.remote:
        chosen["client"] = settings.remote.identity()
    if not settings.settle:
        chosen["settle"] = False
    if settings.perturb:
        chosen |= {"perturb": settings.perturb, "perturb_seed": settings.perturb_seed}
    if settings.keep:
        chosen["keep"] = settings.keep
    return {**chosen, "pools": {str(pool.folder): pool.sha256 for pool in pools}}


def _for_workers(player: PolicyPlayer) -> PolicyPlayer:
    """The player of each worker, which may run in another folder: with absolute paths."""
    settings = player.settings
    threads = max(1, cores() // settings.workers) if isinstance(settings.workers, int) else 1
    folders = [str(Path(folder).resolve()) for folder in settings.folders]
    client = settings.remote and str(Path(settings.remote.file).resolve())
    changed = replace(settings, pool=folders, client=client, workers=1)
    return PolicyPlayer(changed, player.search, player.strict, threads)


def _move_aside(path: Path) -> None:
    """Rename the file of episodes of earlier runs; nothing is deleted."""
    if not path.exists():
        return
    free = next(p for k in itertools.count(1) if not (p := path.with_name(f"{path.stem}-{k}{path.suffix}")).exists())
    try:
        path.rename(free)
    except OSError as error:
        raise refused(path, error) from None
