"""Settings of an evaluation."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Self, TypeVar

from ..compose import load_task
from ..control.teleop import check_filter
from ..envs.vector import MAX_SLOTS
from ..episode import STRICT, check_rules
from ..errors import BadConfig, UnknownName, cut
from ..learn.store import is_policy, read_settings
from ..look.looks import ROOM, look_named
from ..perturb.perturbation import NONE as NO_PERTURBATION
from ..perturb.perturbation import Perturbation
from ..pool import collection
from ..sim.embodiment import JAW
from ..work.foreign import factory_of, is_factory
from ..work.limits import at_least
from ..work.parallel import Workers
from .arms import AUTO, CLEAN, NONE, check_arms
from .policies import FULL_RATE_POLICIES, Needs, unobserved
from .remote.client import INSTRUCTION, ClientSettings, address_of, is_address, read_client

ALL = "all"
"""Name of all splits of the pools."""
PAPER = "paper"
"""Name of the training split and the OOD conditions of the paper (App. I)."""
LATEX = "latex"
"""Value of `format` for tables in LaTeX."""
PROFILE = "profile"
"""Value of `format` for plots of the profile of each policy."""
EPISODES = "episodes"
"""Value of `keep` for keeping the actions of all episodes."""
SPLITS = (ALL, PAPER)
"""Names of sets of splits."""
SCENARIOS = 20
"""Number of scenarios of each pool by default, as in the paper; all of the smallest pool if it holds fewer."""
MAX_FOLDER_NAME = 100
"""Largest length of the name of a folder that is made from the names of policies."""


@dataclass(frozen=True)
class EvaluateSettings:
    """Settings of `scengen evaluate`; conf/command/evaluate.yaml explains them.

    `benign` holds the pools of that arm, and `harness` the name of the program that played the episodes instead.
    """

    policy: str | list[str] = ""
    pool: str | list[str] | None = None
    edition: str | None = None
    tasks: str | list[str] | None = None
    seeds: int | None = None
    rollouts: int = 5
    observations: list[str] | None = None
    width: int = 256
    height: int = 256
    workers: Workers = 1
    slots: int = 1
    to: str | None = None
    version: str | None = None
    fresh: bool = False
    action_filter: str | None = None
    action_repeat: int = 1
    rules: str = STRICT
    client: str | None = None
    splits: str = ALL
    settle: bool = True
    keep: list[str] = field(default_factory=list)
    perturb: str | list[str] | None = None
    perturb_seed: int = 0
    look: str = ROOM.name
    arms: str | list[str] = AUTO
    format: list[str] = field(default_factory=list)
    benign: list[str] = field(default_factory=list)
    harness: str | None = None

    @cached_property
    def folders(self) -> list[str]:
        """Folders of the pools."""
        if self.pool is None:
            raise BadConfig("no pool was given; pass pool=FOLDER, or edition=NAME, whose pools scengen evaluate makes")
        return collection.folders(self.pool)

    @cached_property
    def perturbations(self) -> list[str]:
        """Perturbations that are played in addition to the clean run, each once."""
        given = self.perturb.split(",") if isinstance(self.perturb, str) else self.perturb or ()
        return list(dict.fromkeys(str(p) for p in map(Perturbation.parse, given) if p))

    @property
    def chosen_arms(self) -> list[str] | None:
        """Arms that are played in addition to the clean run; None if the inputs of the policy decide."""
        if self.arms == AUTO:
            return None
        given = self.arms.split(",") if isinstance(self.arms, str) else self.arms
        return [] if given in ([NONE], [""]) else list(dict.fromkeys(given))

    @property
    def every_folder(self) -> list[str]:
        """Folders of the pools, and of those of the arm `benign`, which `benign.benign_pools` makes."""
        return [*self.folders, *self.benign]

    @property
    def name(self) -> str:
        """Name of the policy, of settings for one alone."""
        assert isinstance(self.policy, str)
        return self.policy

    @property
    def folder(self) -> Path:
        """Folder of the results; for several policies, that of their comparison."""
        names = [self.policy] if isinstance(self.policy, str) else self.policy
        return Path(self.to or Path("generated/evaluation", "+".join(map(_folder_name, names))[:MAX_FOLDER_NAME]))

    def several(self) -> list[Self]:
        """The settings for each policy alone.

        A policy that decides something itself, such as its rate, does not get that setting.

        Raises:
            BadConfig: there is no policy, or one is named twice.
        """
        if isinstance(self.policy, str):
            return [self]
        if not self.policy or len({_folder_name(name) for name in self.policy}) < len(self.policy):
            raise BadConfig(
                f"policy = {cut(str(self.policy))}; name different policies: policy=[replay,my_package:mine]"
            )
        return [self._alone(name) for name in self.policy]

    def _alone(self, name: str) -> Self:
        to = self.to and str(Path(self.to, _folder_name(name)))
        remote, own_rate = is_address(name), is_address(name) or name in FULL_RATE_POLICIES
        return replace(
            self,
            policy=name,
            to=to,
            client=self.client if remote else None,
            observations=None if remote else self.observations,
            action_repeat=1 if own_rate else self.action_repeat,
        )

    @cached_property
    def remote(self) -> ClientSettings | None:
        """Names of observations and actions of a policy behind a socket; None for other policies."""
        return read_client(self.client, address_of(self.name)) if is_address(self.name) else None

    @property
    def needs(self) -> Needs:
        """What the code of the policy declares; nothing for other policies."""
        return Needs.of(self.name, factory_of("policy", self.name)) if is_factory(self.name) else Needs()

    @property
    def _gets_text(self) -> bool:
        """Whether the policy may read the instruction: code of its own may, a server if its client file names it."""
        if self.remote:
            return any(INSTRUCTION in names for names in self.remote.observation.values())
        return is_factory(self.name)

    def check_pools(self) -> None:
        """Raise `BadConfig` unless the settings name pools, or sets of an edition."""
        if self.pool is None and self.edition is None:
            raise BadConfig("evaluate needs pool=..., or edition=...; see scengen evaluate --help")
        if self.tasks is not None and (self.edition is None or self.pool is not None):
            raise BadConfig(
                f"tasks = {cut(str(self.tasks))}; it chooses sets of an edition: pass edition=v1 without pool="
            )

    def check_no_text(self) -> None:
        """Raise `BadConfig` if a perturbation changes the instruction, for a policy that does not read it."""
        if texts := [p for p in self.perturbations if Perturbation.parse(p).has_words]:
            raise BadConfig(f"perturb = {texts[0]}; policy {self.name} gets no text: leave out what changes the text")

    def check(self) -> None:
        """Raise `ScengenError` if a setting is not valid. Nothing is imported: they may be of unknown origin."""
        check_filter(self.action_filter)
        check_rules(self.rules)
        check_arms(self.chosen_arms or ())
        self.perturbations  # noqa: B018  (it raises an error)
        for name in self.format:
            if name not in (LATEX, PROFILE):
                raise UnknownName("format", name, (LATEX, PROFILE))
        if not self._gets_text and not self.harness:
            self.check_no_text()
        look_named(self.look)
        if self.splits not in SPLITS:
            raise UnknownName("splits", self.splits, SPLITS)
        at_least(self, seeds=1, rollouts=1, workers=1, width=1, height=1, perturb_seed=0)
        if not 1 <= self.slots <= MAX_SLOTS:
            raise BadConfig(f"slots = {self.slots}; it must lie in [1, {MAX_SLOTS}]")
        if self.action_repeat != 1 and self.name in FULL_RATE_POLICIES:
            raise BadConfig(f"action_repeat = {self.action_repeat}; policy {self.name} acts at 100 Hz: leave it out")
        if set(self.keep) - {EPISODES}:
            raise BadConfig(f"keep = {cut(','.join(self.keep))}; it must be {EPISODES}, or be left out")
        posed = [each for each in self.perturbations if Perturbation.parse(each).conditions(JAW)]
        if self.keep and posed and self.perturb_seed:
            what = f"episodes under {posed[0]} are kept with the values that a pool has"
            raise BadConfig(f"perturb_seed = {self.perturb_seed}; {what}: leave perturb_seed= out, or keep=")
        if self.keep and not self.settle:
            raise BadConfig("episodes are kept with settle=true alone: leave out keep=")
        if self.remote:
            for name, free in (("observations", None), ("action_repeat", 1)):
                if getattr(self, name) != free:
                    raise BadConfig(f"{name} = {getattr(self, name)}; {self.remote.file} decides it: leave it out")
        elif self.client is not None:
            raise BadConfig(f"client = {self.client}; policy {self.name} is not behind a socket: leave it out")


T = TypeVar("T", bound=EvaluateSettings)


@dataclass(frozen=True, order=True)
class Condition:
    """What is changed in an episode without another scenario."""

    perturbation: str = NO_PERTURBATION
    """Kinds of perturbation at their levels."""
    arm: str = CLEAN
    """Name of the arm."""

    def __str__(self) -> str:
        return "/".join(each for each in (self.perturbation, self.arm) if each not in (NO_PERTURBATION, CLEAN))

    def __bool__(self) -> bool:
        return self != Condition()


@dataclass(frozen=True, order=True)
class RolloutId:
    """The identity of a rollout: number `rollout` of a scenario under a condition."""

    task: str
    perturbation: str
    arm: str
    pool: str
    scenario: str
    rollout: int

    @property
    def condition(self) -> Condition:
        """What is changed."""
        return Condition(self.perturbation, self.arm)


def completed(settings: T) -> T:
    """Settings with the observations and the rate that a policy brings or declares, unless they were chosen.

    Raises:
        BadConfig: the chosen observations lack one that the policy declares, or a perturbation changes a text that it
            does not read.
    """
    if is_policy(settings.name):
        own = read_settings(settings.name)
        needs = Needs(tuple(own.observed), own.action_repeat)
    else:
        needs = settings.needs
        if settings.observations and (missing := needs.missing(settings.observations)):
            raise BadConfig(unobserved(settings.name, missing, settings.observations))
        if needs.language is False:
            settings.check_no_text()
    observations = settings.observations or (None if needs.observations is None else list(needs.observations))
    repeat = settings.action_repeat if settings.action_repeat != 1 else needs.action_repeat or 1
    return replace(settings, observations=observations, action_repeat=repeat)


def other_version(settings: EvaluateSettings, search: Sequence[str] = ()) -> str:
    """A line about a policy that was trained on another version of its task than the installed one; empty for others.

    Args:
        search: overrides that add folders of other packages, see `task_files.search_path`.
    """
    if not is_policy(settings.name):
        return ""
    own = read_settings(settings.name)
    return load_task(own.task, search).other_version(f"{settings.name} was trained on", own.task_version)


def _folder_name(policy: str) -> str:
    """Name of the folder of a policy's results."""
    return re.sub(r"[^\w.-]+", ".", policy)
