"""Evaluation of a policy on pools: the paper's table of success in and out of distribution, with intervals.

Episodes are kept in `<to>/episodes.jsonl` as they end, so that a run that was killed goes on where it was.
"""

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

from ..episode import Actions
from ..errors import BadConfig, PoolError
from ..installation import versions
from ..look.looks import look_named
from ..perturb.perturbation import NONE as NO_PERTURBATION
from ..pool import Pool, kinds
from ..pool.files import sha256
from ..samplers.split import ID
from ..work.fingerprint import fingerprint
from ..work.foreign import factory_of, is_typed
from ..work.log import Log
from ..work.machine import cores
from ..work.parallel import each
from ..work.targets import move_aside, try_folder
from .arms import BENIGN, CLEAN, automatic_arms
from .lines import CHAIN, COLUMNS, FORMAT, RUN, chained, renewed, run_sha256
from .player import PolicyPlayer, Spent, policy_seed
from .scenarios import Scenarios, chosen, not_playable
from .settings import Condition, EvaluateSettings, RolloutId, T, completed

Keep = Callable[[RolloutId, Actions], None]
"""Keeps the actions that the controller received in a rollout; called before the rollout counts as played."""
Progress = Callable[[int, int, str], None]
"""Called with the number of rollouts done, their total, and the name of the condition that is played."""


@dataclass(frozen=True)
class Evaluation:
    """The result of an evaluation."""

    episodes: list[dict[str, Any]]
    """Records of the episodes."""
    earlier: int
    """Number of episodes that an earlier run of the same command played."""
    lost: Mapping[str, str]
    """Scenarios that were left out because they cannot be played within the limits, with the reasons."""
    arms: Sequence[str] = ()
    """Arms that were played in addition to the clean run."""
    benign: Mapping[str, str] = field(default_factory=dict)
    """Hashes of the pools of the arm `benign`, by folder."""
    chain: str = ""
    """Hash at the end of the file of episodes, see `lines.chained`."""
    drawn: Mapping[str, str] = field(default_factory=dict)
    """Hashes of the pools that a search for a threshold has drawn, by folder."""
    spent: Spent = field(default_factory=Spent)
    """Time of the rollouts that were played now, if there are cameras."""


def evaluate(
    settings: EvaluateSettings,
    progress: Progress,
    search: Sequence[str] = (),
    keep: Keep = lambda which, actions: None,
    announce: Callable[[str], None] = lambda told: None,
) -> Evaluation:
    """Play every rollout that was not played yet, and return all episodes.

    Episodes are bound to the pools, the settings and the policy (see `policies.identity`): episodes of an older version
    of a policy are never mixed with new ones.

    Args:
        search: overrides that add folders of other packages, see `task_files.search_path`.
        keep: called with the actions of every rollout that is played to its end, if episodes are kept.
        announce: called with a line about what is going to be played.

    Raises:
        ScengenError: a pool, a policy or a setting is not valid.
    """
    settings = ready(settings)
    pools = [Pool.open(folder).check() for folder in settings.folders]
    fresh = [Pool.open(folder).check() for folder in settings.benign]
    about = {**chosen(pools, settings, search), **(chosen(fresh, settings, search) if fresh else {})}
    lost = not_playable([*pools, *fresh], about, settings.workers)
    if not (about := {key: told for key, told in about.items() if key[1] not in lost}):
        raise PoolError(f"no scenario can be played; see scengen verify: {'; '.join(lost.values())}")
    with opened(settings, identity(settings, pools), about, search, keep, progress) as run:
        first, expected = wanted(about, settings), wanted(about, settings, run.arms())
        announce(run.planned(first | expected))
        run.play(first, len(expected))
        later = wanted(about, settings, arms := run.arms())
        if later - expected:
            announce(f"the policy reads the instruction: {run.planned(later - expected)}")
        run.play(later)
        run.sort()
        pinned = {str(pool.folder): pool.sha256 for pool in fresh}
        return Evaluation(run.lines(), run.earlier, lost, arms, pinned, run.chain, spent=run.spent)


def ready(settings: T) -> T:
    """Checked settings with those that the policy brings, whose folder can be written.

    Raises:
        ScengenError: a setting is not valid, or the folder is something else.
    """
    settings = completed(settings)
    settings.check()
    kinds.check_target(settings.folder, kinds.EPISODES)
    try_folder(settings.folder)
    return settings


@contextmanager
def opened(
    settings: EvaluateSettings,
    depends: Mapping[str, Any],
    about: Scenarios,
    search: Sequence[str],
    keep: Keep,
    progress: Progress,
) -> "Iterator[Run]":
    """A run that plays rollouts into the folder of the settings, or continues there.

    Args:
        depends: everything but the policy on which episodes depend, see `identity`.

    Raises:
        BadConfig: the folder holds episodes of another run.
    """
    path = settings.folder / kinds.EPISODES
    if settings.remote and settings.version is None and not settings.fresh and path.exists():
        why = f"{path} holds episodes of an earlier run, and a server does not say which weights it serves"
        raise BadConfig(f"{why}; pass fresh=true to start again, or version=NAME from the start to be able to continue")
    remedy = "pass fresh=true to start again (old episodes are moved aside), or choose another to="
    if settings.name.startswith("__main__:") and is_typed(factory_of("policy", settings.name)):
        remedy = f"a policy that was typed into a session can be compared by its attribute `version` only; {remedy}"
    with closing(PolicyPlayer(settings, search)) as player:
        task_versions = {a["task"]: a["task_version"] for a in about.values()}
        described = player.described({*task_versions})
        if settings.fresh:
            move_aside(path, path.with_name(RUN))
        whole = {**depends, "task_versions": task_versions, **described}
        with Log(path, whole, remedy, settings.folder / RUN) as log:
            yield Run(settings, about, log, player, keep, progress)


@dataclass
class LineLog:
    """Lines of episodes, in a log that is open."""

    settings: EvaluateSettings
    """Settings of the evaluation."""
    about: Scenarios
    """What lines say of the scenarios."""
    log: Log
    """The log."""

    def add(self, record: dict[str, Any]) -> None:
        """Store the line of an episode."""
        told = told_of(id_of(record), self.about[record["pool"], record["scenario"]])
        made = {"policy": self.settings.name, "instruction_sha256": sha256(record["instruction"])}
        line = {"episode": len(self.log.records), **record, **told, **made, **here()}
        line = {name: line[name] for name in COLUMNS if name != CHAIN}
        self.log.add({**line, CHAIN: chained(self.chain, line)})

    @property
    def chain(self) -> str:
        """Hash at the end of the log."""
        return self.log.records[-1][CHAIN] if self.log.records else run_sha256(self.log.identity)

    def sort(self) -> None:
        """Bring the lines into an order that does not depend on when they were played."""
        there = sorted(self.log.records, key=order)
        if there != self.log.records:
            self.log.replace(renewed(self.log.identity, there))


@dataclass
class Run(LineLog):
    """A run of a policy."""

    player: PolicyPlayer
    """Plays the rollouts."""
    keep: Keep
    """Keeps their actions."""
    progress: Progress
    """Called with each rollout."""
    earlier: int = 0
    """Number of episodes that an earlier run played."""
    spent: Spent = field(default_factory=Spent)
    """Time of the rollouts that this run played, if there are cameras."""
    wanted: set[RolloutId] = field(default_factory=set)
    """All rollouts of the run."""

    def play(self, some: set[RolloutId], later: int = 0) -> None:
        """Play those rollouts that the log does not hold.

        Args:
            later: number of rollouts that are expected after them, for the progress.
        """
        if not some:
            return
        self.wanted |= some
        todo = sorted(some - set(map(id_of, self.log.records)))  # one task and perturbation after the other
        self.earlier += len(some) - len(todo)
        done, total = len(self.wanted) - len(todo), len(self.wanted) + later
        self.progress(done, total, _named(todo[0]) if todo else "")
        self.player.strict = not self.log.records
        for count, record in enumerate(_played(self.player, todo), done + 1):
            self.spent = self.spent.plus(record.pop("spent", Spent()))
            played = record.pop("played", None)
            if played is not None:
                self.keep(id_of(record), played)
            self.add(record)
            self.progress(count, total, _named(id_of(record)))

    def planned(self, some: set[RolloutId]) -> str:
        """A line about rollouts: how many of each condition, how to leave out arms, and what is slow."""
        ordered = sorted(some, key=lambda which: (which.arm != CLEAN, bool(which.condition), which.condition))
        counts = ", ".join(f"{n} {name}" for name, n in Counter(map(_named, ordered)).items())
        scenarios, earlier = len({which.scenario for which in some}), len(some & {*map(id_of, self.log.records)})
        told = f"episodes: {counts} (scenarios: {scenarios}, rollouts of each: {self.settings.rollouts})"
        automatic = self.settings.chosen_arms is None and any(which.arm != CLEAN for which in some)
        remarks = {
            f"{earlier} from an earlier run": bool(earlier),
            "arms=none leaves out the arms": automatic,
            "pictures are slow without a graphics card, smaller width= and height= save time": self.player.has_cameras,
        }
        return "; ".join([told, *(remark for remark, holds in remarks.items() if holds)])

    def extend(self, settings: EvaluateSettings) -> None:
        """Go on with settings that name further pools, in which later rollouts are played."""
        if settings != self.settings:
            self.player.close()
            self.settings = self.player.settings = settings

    def lines(self) -> list[dict[str, Any]]:
        """The lines of all rollouts of the run."""
        return [line for line in self.log.records if id_of(line) in self.wanted]

    def arms(self) -> list[str]:
        """The chosen arms; by default those of the inputs that the policy is known to have."""
        if self.settings.chosen_arms is not None:
            return self.settings.chosen_arms
        return automatic_arms([{"pictures": self.player.has_cameras, "instruction_read": False}, *self.lines()])


@cache
def here() -> dict[str, Any]:
    """Versions and fingerprint of this machine."""
    found = versions()
    return {"machine": fingerprint(), "scengen": found["scengen"], "mujoco": found["mujoco"]}


def wanted(about: Scenarios, settings: EvaluateSettings, arms: Sequence[str] | None = None) -> set[RolloutId]:
    """Rollouts of some scenarios: clean and perturbed ones, or those of some arms.

    Args:
        about: folders of pools and ids of scenarios, with what is known of them.
        arms: names of the arms.
    """
    plain = [Condition(each) for each in (NO_PERTURBATION, *settings.perturbations)]
    usual = plain if arms is None else [Condition(arm=arm) for arm in arms if arm != BENIGN]
    fresh = [Condition(arm=arm) for arm in arms or () if arm == BENIGN]
    return {
        RolloutId(told["task"], each.perturbation, each.arm, *key, k)
        for key, told in about.items()
        for each in (fresh if key[0] in settings.benign else usual)
        for k in range(settings.rollouts)
    }


def order(line: Mapping[str, Any]) -> tuple[Any, ...]:
    """Key by which lines are sorted: clean episodes first, and those in training before others."""
    condition = Condition(line["perturbation"], line["arm"])
    where = line["split"] != ID, line["split"], line["pool"], line["index"], line["scenario"], line["rollout"]
    return line["task"], bool(condition), condition, *where


def _named(which: RolloutId) -> str:
    """Name of the condition of a rollout, for people."""
    return f"arm {which.arm}" if which.arm != CLEAN else str(which.condition) or CLEAN


def _played(player: PolicyPlayer, todo: Sequence[RolloutId]) -> Iterator[dict[str, Any]]:
    """Records of the rollouts as their batches are played. Those of a batch whose process dies are played alone."""
    settings, alone = player.settings, list[Sequence[RolloutId]]()
    play = player if settings.workers == 1 else _for_workers(player)

    def lost(batch: Sequence[RolloutId], reason: str) -> list[dict[str, Any]]:
        if len(batch) == 1:
            return [crashed_record(batch[0], f"the process {reason}")]
        alone.extend([which] for which in batch)
        return []

    of_tasks = [list(group) for _, group in itertools.groupby(todo, lambda which: (which.task, which.condition))]
    batches = [some[i : i + settings.slots] for some in of_tasks for i in range(0, len(some), settings.slots)]
    for some in (batches, alone):
        for records in each(play, some, settings.workers, lost=lost):
            yield from records


def told_of(which: RolloutId, scenario: Mapping[str, Any]) -> dict[str, Any]:
    """What the line of a rollout says of its scenario."""
    words = [which.task, scenario["split"], *([str(which.condition)] if which.condition else [])]
    return {**scenario, "skill": "/".join(words)}


def id_of(line: Mapping[str, Any]) -> RolloutId:
    """The rollout of a line."""
    return RolloutId(**{f.name: line[f.name] for f in fields(RolloutId)})


def crashed_record(which: RolloutId, reason: str) -> dict[str, Any]:
    """The record of a rollout of which nothing but its start is known, such as one whose process died twice."""
    unknown = dict.fromkeys(("instruction", "first_state", "renderer", "reason", "lacks", "phase"), "")
    unknown |= {"actions_sha256": "", "final_state": "", "crashed": reason}
    nothing = {"perturb": {}, "pictures": {}, "instruction_read": False, "success": False, "seconds": 0.0, "actions": 0}
    return {**asdict(which), **unknown, **nothing, "policy_seed": policy_seed(which.scenario, which.rollout)}


def identity(settings: EvaluateSettings, pools: Sequence[Pool]) -> dict[str, Any]:
    """Everything on which the outcome of a rollout depends. More scenarios, rollouts or conditions continue a run."""
    names = ("policy", "version", "observations", "width", "height", "action_filter", "action_repeat", "rules", "look")
    chosen = {"format": FORMAT, **{name: getattr(settings, name) for name in (*names, "perturb_seed")}}
    if settings.harness:
        chosen["harness"] = settings.harness
    chosen["look_version"] = look_named(settings.look).version
    if settings.remote:
        chosen["client"] = settings.remote.identity()
    if not settings.settle:
        chosen["settle"] = False
    if settings.keep:
        chosen["keep"] = settings.keep
    return {**chosen, "pools": {str(pool.folder): pool.sha256 for pool in pools}}


def _for_workers(player: PolicyPlayer) -> PolicyPlayer:
    """The player of each worker, which may run in another folder: with absolute paths."""
    settings = player.settings
    threads = max(1, cores() // settings.workers) if isinstance(settings.workers, int) else 1
    folders = [str(Path(folder).resolve()) for folder in settings.folders]
    client = settings.remote and str(Path(settings.remote.file).resolve())
    fresh = [str(Path(folder).resolve()) for folder in settings.benign]
    changed = replace(settings, pool=folders, benign=fresh, client=client, workers=1)
    return PolicyPlayer(changed, player.search, player.strict, threads)
