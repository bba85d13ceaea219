"""Evidence of an attack: hits that replay bit for bit, the contacts that they lack, and rates with bounds."""

import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from ..episode import RULES, STRICT, Actions, Rules
from ..errors import BadConfig, NoOracle, cut
from ..geometry import Vec3
from ..params import Value, values
from ..pool.columns import ID, witness
from ..pool.untrusted import (
    MAX_HORIZON,
    READING_MEMORY,
    SHORT_HASH,
    WORD,
    check_mapping,
    check_match,
    check_text,
    check_whole,
    demand,
    read_json,
)
from ..samplers.split import ID as TRAINING
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World
from ..validate.rebuilt import world_of
from ..validate.rollout import Jitter, replay, run
from ..validate.settings import Robust, lower_bound
from ..validate.verify.claims import passed_filter
from ..work.machine import memory_bounded
from ..work.plain import open_plain
from ..work.targets import write
from .player import SETTLE_TIME, Attempt, Node, Played, Player
from .signature import ContactPair, pairs, robots, scene_bodies, signature, starts
from .variations import at_another_pace

VARIED_RUNS = 40
"""Number of varied runs of the oracle in which a causal contact has to occur. A contact that is missing in 5 % of runs
passes with a probability of 13 %."""


RESUMED = " from a state of the witness on"
"""Remark about a filtered hit that is `Hit.resumed`."""


def spelled(raw: bool) -> str:
    """Path of actions to the controller, in one word."""
    return "raw" if raw else "filtered"


@dataclass(frozen=True)
class Hit:
    """A rollout of the adversary that reached the goal, and reaches it again in a fresh world, bit for bit."""

    scenario: str
    """Id of the scenario."""
    tier: str
    """Tier of the attempt."""
    raw: bool
    """Whether its actions reached the controller without the teleoperation filter."""
    plan: str
    """Description of the attempt, as text."""
    seconds: float
    """Time at which the goal was reached [s]."""
    digest: str
    """Hash of the final physics state."""
    lacks: tuple[ContactPair, ...]
    """Causal contacts of the witness that the rollout lacks."""
    unmoved: tuple[str, ...]
    """Bodies that the witness moves and the rollout does not."""
    params: Mapping[str, Value] = field(repr=False, compare=False)
    """Parameters of the scenario, by name."""
    actions: Actions = field(repr=False, compare=False)
    """Actions of the rollout, as the controller received them."""
    task: str = ""
    """Name of the task; empty for a family that belongs to none."""
    rules: Rules = STRICT
    """Rules under which it reaches the goal."""
    task_version: int | None = None
    """Version of the task that was attacked; None in hits of earlier releases, which do not store it."""
    otherwise: str = ""
    """Means that it lacks, joined by semicolons. Under the strict rules none is lacking."""
    conditions: str = ""
    """Conditions of control under which the scenario is posed, as a split names them; empty for the usual ones."""

    @property
    def refutes(self) -> bool:
        """Whether the hit bypasses the point of the task; if not, it only shows that the goal is accessible."""
        return bool(self.lacks or self.otherwise)

    @property
    def resumed(self) -> bool:
        """Whether it was filtered from a state of the witness on, where the filter started at rest: from the start of
        the episode, the filter cannot give its actions."""
        return not self.raw and not passed_filter(self.actions)

    @property
    def name(self) -> str:
        """Stem of the hit's file name."""
        return f"{self.scenario}-{self.tier}-{spelled(self.raw)}-{self.digest[:6]}"

    def __str__(self) -> str:
        contacts = ", without " + ", ".join(f"{one} - {other}" for one, other in self.lacks) if self.lacks else ""
        otherwise = f" [lacks: {self.otherwise}]" if self.otherwise else ""
        how = f"{spelled(self.raw)}{RESUMED if self.resumed else ''}"
        return f"by {self.tier}, {how}{contacts}{otherwise}: {self.plan}"

    def plain(self) -> dict[str, Any]:
        """All fields but actions and parameters, as plain data."""
        left_out = ("actions", "params", *([] if self.conditions else ["conditions"]))
        kept = {key: value for key, value in vars(self).items() if key not in left_out}
        return {**kept, "lacks": [list(pair) for pair in self.lacks], "unmoved": list(self.unmoved)}

    def store(self, folder: Path) -> None:
        """Write the hit as `<name>.npz`, whole or not at all.

        Raises:
            BadConfig: the file cannot be written.
        """
        content, about = BytesIO(), {**self.plain(), "params": dict(self.params)}
        np.savez_compressed(content, actions=self.actions, about=json.dumps(about))
        write(folder / f"{self.name}.npz", content.getvalue())

    @classmethod
    def load(cls, path: Path) -> "Hit":
        """Read a hit that `store` has written. Nothing in the file is executed.

        Raises:
            BadConfig: the file does not exist, or holds something else.
        """
        try:
            with (
                open_plain(path.resolve()) as file,
                memory_bounded(READING_MEMORY),
                np.load(file, allow_pickle=False) as stored,
            ):
                about, actions = _plain_hit(read_json(str(stored["about"]))), witness("witness", stored["actions"])
            return cls(**about, actions=actions)
        except (OSError, ValueError, TypeError, KeyError, EOFError, MemoryError, BadZipFile, zlib.error) as error:
            why = cut(" ".join(str(error).split()))
            message = f"{path} is not a hit of scengen attack, or is damaged: {why}"
            raise BadConfig(f"{message}; give one that scengen attack has stored") from None


def _plain_hit(about: Any) -> dict[str, Any]:
    """The fields of a stored hit but its actions.

    Raises:
        ValueError: one of them is missing, unknown, or not what a hit has.
    """
    about = {"task_version": None, "otherwise": "", "conditions": "", **check_mapping("what it says", about)}
    known = [one.name for one in fields(Hit) if one.name != "actions"]
    for name in known:
        demand(name in about, f"it lacks {name}")
    for name in about:
        demand(name in known, f"it has an unknown entry {cut(name)!r}")
    check_match("scenario", about["scenario"], ID)
    check_match("tier", about["tier"], WORD)
    demand(isinstance(about["raw"], bool), "raw is neither true nor false")
    check_text("plan", about["plan"], 10_000)
    check_text("otherwise", about["otherwise"], 10_000)
    demand(_is_number(about["seconds"]) and 0 <= about["seconds"] <= MAX_HORIZON, "seconds is not a time")
    check_text("conditions", about["conditions"], 1000)
    check_match("digest", about["digest"], SHORT_HASH)
    check_text("task", about["task"], 100)
    demand(about["rules"] in RULES, "rules are neither strict nor paper")
    if (version := about["task_version"]) is not None:
        check_whole("task_version", version)
        demand(version >= 1, f"task_version is {version}")
    for name, number in check_mapping("params", about["params"]).items():
        demand(_is_number(number), f"params has no number for {cut(name)}")
    lacks, unmoved = about["lacks"], about["unmoved"]
    demand(
        isinstance(lacks, list) and all(isinstance(p, list) and len(p) == 2 for p in lacks),
        "lacks must be a list of pairs",
    )
    demand(isinstance(unmoved, list), "unmoved must be a list of bodies")
    for name in (*(name for pair in lacks for name in pair), *unmoved):
        check_text("the name of a body", name, 200)
    return {**about, "lacks": tuple((one, other) for one, other in lacks), "unmoved": tuple(unmoved)}


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


OTHER_SCENARIO = (
    "the scenario's id does not belong to its parameters and conditions; one of a pool with scans needs pool=FOLDER too"
)
"""Reason why a hit cannot be examined."""


@dataclass(frozen=True)
class Replayed:
    """Result of the replay of a stored hit."""

    fault: str = ""
    """Reason why it does not hold; empty if it does."""
    exact: bool = True
    """Whether the replay ends in the bits that the hit says."""


def scenario_of(hit: Hit, task: Task) -> Scenario:
    """The scenario of a hit, under its conditions.

    Raises:
        ScengenError: the parameters are not those of the task, or there are no such conditions.
    """
    try:
        return task.scenario(hit.params, hit.conditions or TRAINING)
    except BadConfig as error:
        raise BadConfig(f"{hit.name}: {error}; give a hit that scengen attack has stored") from None


def replayed(hit: Hit, task: Task) -> Replayed:
    """Replay a stored hit in the scene that is built from its parameters, and compare what it says.

    The fault names the version of the task on which the hit was found if it is not the installed one. Of another
    version only the goal is compared.

    Raises:
        ScengenError: the parameters are not those of the task.
    """
    scenario = scenario_of(hit, task)
    if scenario.id != hit.scenario or str(scenario.conditions or "") != hit.conditions:
        return Replayed(OTHER_SCENARIO)
    world = world_of(scenario, task.embodiment)
    start = starts(world)
    again = replay(scenario, world, hit.actions, task.horizon, SETTLE_TIME, rules=hit.rules)
    exact = again.digest == hit.digest
    if not again.solved:
        other = task.other_version("found on", hit.task_version)
        return Replayed(f"its actions do not reach the goal: {again.reason}{other and f' ({other})'}", exact)
    if hit.task_version != task.version:
        return Replayed(exact=exact)
    if again.lacks != hit.otherwise:
        told = f"it says that it lacks {hit.otherwise or 'no mean'}, and lacks {again.lacks or 'none'}"
        return Replayed(told, exact)
    return Replayed(next(_false_words(hit, again.seconds if exact else None, world, start), ""), exact)


def _false_words(hit: Hit, seconds: float | None, world: World, start: Mapping[str, Vec3]) -> Iterator[str]:
    """What a hit says otherwise than its replay.

    Args:
        seconds: time at which the replay has reached the goal [s]; None if it cannot be compared.
        world: the world at the end of the replay.
        start: positions of the free bodies at the start.
    """
    if seconds not in (None, hit.seconds):
        yield f"it says that it reaches the goal after {hit.seconds:g} s; replayed, it takes {seconds:g} s"
    made, names = signature(world, start), {*scene_bodies(world).values(), *robots(world).values()}
    for pair in hit.lacks:
        if pair in made.pairs or not names.issuperset(pair):
            why = "it makes" if pair in made.pairs else "the scene cannot have"
            yield f"it says that it lacks the contact {' - '.join(pair)}, which {why}"
    for body in hit.unmoved:
        if body in made.moved or body not in start:
            yield f"it says that {body} stays where it is, which {'moves' if body in start else 'is not a free body'}"


class CausalContacts:
    """Contacts that the oracle always makes before it reaches the goal: in the witness and in every varied run.

    Contacts of the robot with fixed bodies are left out: a hand may approach an object from another side.
    """

    def __init__(self, player: Player, varied: int = VARIED_RUNS):
        """
        Args:
            varied: maximum number of varied runs. They are made when they are needed: blocks that fall into a bin touch
                by chance, for example, and not in every run.
        """
        self._player, self._left = player, iter(range(varied))
        self._pairs = player.trace.signature.pairs

    def lacking(self, touched: frozenset[ContactPair]) -> frozenset[ContactPair]:
        """The causal contacts that a hit lacks. All of them occur in every varied run that was made so far."""
        for k in self._left if self._pairs - touched else ():
            self._pairs &= self._varied(k)
            if self._pairs <= touched:
                break
        return self._pairs - touched

    def spare(self, touched: frozenset[ContactPair]) -> None:
        """Note the contacts of a success by the oracle's own moves: what it lacks is not causal."""
        self._pairs &= touched

    def _varied(self, k: int) -> frozenset[ContactPair]:
        """The contacts of a jittered run; all contacts known so far if it fails, or if there is no oracle."""
        player = self._player
        jitter = Jitter.within(Robust(), f"{player.scenario.id}/attack", k)
        world = jitter.disturbed(player.world, player.scenario.DISTURBED)
        try:
            rollout = run(player.scenario, world, player.scenario.oracle, player.horizon, SETTLE_TIME, jitter)
        except NoOracle:
            return self._pairs
        return pairs(world) if rollout.solved else self._pairs


def hit(
    player: Player, attempt: Attempt, raw: bool, played: Played, node: Node | None, causal: CausalContacts
) -> Hit | None:
    """The evidence of a success; None if the success is not the same, bit for bit, in a fresh world.

    Args:
        node: state from which the attempt started; None for the start of the episode.
        causal: contacts of the witness that a hit should have.
    """
    fresh = World.load(player.scene_xml, player.embodiment)
    again = replay(player.scenario, fresh, played.actions, player.horizon, SETTLE_TIME, rules=player.rules)
    if not again.solved or again.digest != played.digest:
        return None
    left = played.signature
    if at_another_pace(player, attempt):  # a body that lies beside another one by chance need not touch it
        causal.spare(left.pairs)
    return Hit(
        scenario=player.scenario.id,
        tier=attempt.tier,
        raw=raw,
        plan=(node or player.start).after(attempt),
        seconds=played.seconds,
        digest=played.digest,
        lacks=tuple(sorted(causal.lacking(left.pairs))),
        unmoved=tuple(sorted(player.trace.signature.moved - left.moved)),
        params=values(player.scenario),
        actions=played.actions,
        rules=player.rules,
        task_version=player.scenario.VERSION,
        otherwise=again.lacks,
        conditions=str(player.scenario.conditions or ""),
    )


@dataclass(frozen=True)
class TierRate:
    """Hit rate of one tier, with filtered or raw actions."""

    tier: str
    raw: bool
    """Whether actions reached the controller without the teleoperation filter."""
    rollouts: int = 0
    """Number of rollouts."""
    hits: int = 0
    """Number of rollouts that reached the goal."""
    refuting: int = 0
    """Number of hits that bypass the point of the task."""

    @property
    def value(self) -> float:
        """Share of the rollouts that reached the goal."""
        return self.hits / self.rollouts if self.rollouts else 0.0

    @property
    def bound(self) -> float:
        """One-sided upper Clopper-Pearson bound of the rate at 95 % confidence."""
        return 1.0 - lower_bound(self.rollouts - self.hits, self.rollouts) if self.rollouts else 1.0

    def plain(self) -> dict[str, Any]:
        return {**asdict(self), "rate": self.value, "bound": self.bound}


def rates(counts: Sequence[TierRate]) -> list[TierRate]:
    """Counts of the same tier and kind of actions added up, in the order in which they first occur."""
    total: dict[tuple[str, bool], TierRate] = {}
    for one in counts:
        sofar = total.get((one.tier, one.raw), TierRate(one.tier, one.raw))
        total[one.tier, one.raw] = replace(
            sofar,
            rollouts=sofar.rollouts + one.rollouts,
            hits=sofar.hits + one.hits,
            refuting=sofar.refuting + one.refuting,
        )
    return list(total.values())
