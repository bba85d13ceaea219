"""An attack on several scenarios of a task: subjects, jobs in parallel, and the report."""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ..episode import STRICT, Actions, Rules, check_rules
from ..errors import BadConfig, Infeasible, ScengenError, UnknownName, cut
from ..pool import Pool, PoolRow
from ..pool.files import sha256
from ..pool.names import Name
from ..samplers.task import Task
from ..scenario import Answer, Plan, Scenario
from ..sim.world import World
from ..validate.identity import source_sha256
from ..validate.playable import scene_errors
from ..validate.rebuilt import rebuild, world_of
from ..validate.rollout import run
from ..validate.settings import FEWEST, lower_bound
from ..validate.verify.claims import alike
from ..work.fingerprint import same_bits
from ..work.limits import at_least
from ..work.log import FRESH, Log, recorded
from ..work.parallel import Limits, Workers, each
from ..work.plain import read_plain, why_not_plain
from ..work.targets import move_aside, write
from .adversary import LEAKS, PRIOR, RANDOM, RATED, TIERS, Attack, AttackResult, UntriedShortcut, never
from .evidence import Hit, TierRate, rates, replayed
from .experience import Experience, experience, feasible
from .player import Player
from .priors import AnswerJudge, Prior, by_statics, fit, has_statics
from .variations import FOREIGN

MAX_HIT = 100_000_000
"""Size of the largest file of a hit that is read [bytes]: an hour of two arms has 20 MB."""
GRAMMAR = 7
"""Version of macros and tiers: reports of different versions are not comparable."""
LOG = "attack.jsonl"
"""Name of the log in the folder of an attack."""
HITS_FOLDER = "hits"
"""Folder of the hits in a pool."""
DRAWS_PER_SCENARIO = 4
"""Maximum number of draws for every scenario that is to be attacked."""
STATICS_DRAWS = 300
"""Number of draws on which fixed answers are fitted by statics."""
ROLLOUT_DRAWS = 8
"""Number of draws on which fixed answers are fitted by rollouts, one for each draw and candidate."""
FITTING_SEED = 1_000_003
"""Offset from the seed of the attack to the seed of the draws on which fixed answers are fitted."""
FRESH_SEED = 2_000_003
"""Offset from the seed of the attack to the seed of the draws on which fixed answers are measured."""
LIMITS = {RANDOM: 0.10, FOREIGN: 0.10, f"{PRIOR}_1": 0.10, f"{PRIOR}_3": 0.20}
"""Largest share of successes of plans that need no look at the scene, by name of the rate (CONTRIBUTING.md)."""
CHOICE_MARGIN = 0.05
"""Share by which a fixed answer may exceed chance in a choice among few."""
PLANS = {RANDOM: "random plans solve", FOREIGN: "witnesses of other scenarios solve"}
"""Plans that have a limit, as text; the others are fixed answers."""


@dataclass(frozen=True)
class AttackSettings:
    """Settings of `scengen attack`; conf/command/attack.yaml explains them."""

    pool: str | None = None
    split: str = "id"
    n: int = 5
    budget: int = 200
    seed: int = 0
    tiers: str | list[str] | None = None
    rules: str = STRICT
    workers: Workers = 1
    limit_seconds: float = 3600.0
    limit_mb: int = 4000
    to: str | None = None
    json: str | None = None
    fresh: bool = False

    @property
    def requested(self) -> Sequence[str] | None:
        """The requested tiers; None for the default."""
        return [self.tiers] if isinstance(self.tiers, str) else self.tiers

    @property
    def observed(self) -> bool:
        """Whether observations are searched for hidden parameters: on request, and by default for draws of a task."""
        return self.pool is None if self.requested is None else LEAKS in self.requested

    @property
    def chosen(self) -> tuple[str, ...]:
        """The tiers that are played."""
        return tuple(tier for tier in TIERS if self.requested is None or tier in self.requested)

    def check(self) -> None:
        """Raise `ScengenError` if a setting is not valid."""
        check_rules(self.rules)
        at_least(self, n=1, budget=1, seed=0, workers=1, limit_seconds=1, limit_mb=200)
        for tier in self.requested or []:
            if tier not in (*TIERS, LEAKS):
                raise UnknownName("tier", tier, (*TIERS, LEAKS))


@dataclass(frozen=True)
class Subject:
    """A scenario that is attacked, with a witness that reaches its goal."""

    scenario: Scenario
    scene_xml: str
    embodiment: str
    horizon: float
    """Time limit [s]."""
    witness: Actions
    name: Name


@dataclass(frozen=True)
class AttackReport:
    """The result of an attack on several scenarios."""

    task: str
    task_version: int
    """Version of the task."""
    rules: Rules
    """Rules under which the hits reach the goal."""
    scenarios: tuple[str, ...]
    """Ids of the scenarios."""
    rates: tuple[TierRate, ...]
    """Hit rates of the tiers."""
    hits: tuple[Hit, ...]
    priors: tuple[Prior, ...]
    """Fixed answers that were tried."""
    untried: tuple[UntriedShortcut, ...]
    lost: tuple[str, ...]
    """Scenarios whose attack crashed or reached a limit, each with the reason. Their results are unknown."""
    folder: Path
    """Folder of the hits."""
    cpu: float
    """Processor time of the adversary's rollouts [s]; it differs from run to run."""

    @property
    def rollouts(self) -> int:
        """Number of rollouts."""
        return sum(rate.rollouts for rate in self.rates)

    @property
    def refuting(self) -> list[Hit]:
        """Hits that bypass the point of the task."""
        return [hit for hit in self.hits if hit.refutes]

    def above_limits(self, answer: Answer | None) -> Iterator[tuple[str, bool]]:
        """Limits of what plans may solve that need no look at the scene, as far as they are exceeded.

        Args:
            answer: the answer that the family declares. In a choice among k, n answers may solve n/k plus 5 points.

        Yields:
            The rate and its limit as text, and whether the rate's lower 95 % bound exceeds the limit, too.
        """
        fresh = {
            f"{PRIOR}_{len(prior.values)}": (round(prior.fresh * prior.draws), prior.draws)
            for prior in self.priors
            if prior.fresh is not None
        }
        for name, limit in LIMITS.items():
            played = [rate for rate in self.rates if rate.tier == name]
            hits, runs = fresh.get(name, (sum(r.hits for r in played), sum(r.rollouts for r in played)))
            tier, _, number = name.partition("_")
            if tier == PRIOR and answer is not None:
                limit = max(limit, int(number) / len(answer.candidates) + CHOICE_MARGIN)
            if runs and hits / runs > limit:
                what = PLANS.get(tier, "1 fixed answer solves" if number == "1" else f"{number} fixed answers solve")
                yield f"{what} {hits} of {runs}, more than {limit:.0%}", lower_bound(hits, runs) > limit

    def plain(self) -> dict[str, Any]:
        """The report as plain data, without actions, folder and processor time."""
        return {
            "task": self.task,
            "task_version": self.task_version,
            "rules": self.rules,
            "grammar": GRAMMAR,
            "scenarios": list(self.scenarios),
            "rollouts": self.rollouts,
            "rates": [rate.plain() for rate in self.rates],
            "priors": [{**asdict(prior), "bound": prior.bound} for prior in self.priors],
            "not_tried": [asdict(one) for one in self.untried],
            "lost": list(self.lost),
            "hits": [
                {"name": hit.name, "refutes": hit.refutes, "resumed": hit.resumed, **hit.plain()} for hit in self.hits
            ],
        }


@dataclass(frozen=True)
class AttackJob:
    """The common data of the attacks of one report. Called with a number, it attacks that scenario."""

    subjects: tuple[Subject, ...]
    budget: int
    """Number of rollouts for each scenario."""
    seed: int
    tiers: tuple[str, ...]
    priors: tuple[Prior, ...]
    rules: Rules = STRICT
    """Rules that end an episode."""
    known: Experience = Experience()
    """Data from training that the adversary uses."""
    until: Callable[[Hit], bool] = never
    """Test of a hit at which the attack on a scenario ends."""

    def __call__(self, number: int) -> AttackResult:
        attacked = self.subjects[number]
        player = player_of(attacked, self.rules)
        player.foreign = {one.scenario.id: one.witness for one in self.subjects if one is not attacked}
        player.memories = {memory.name: memory.follow for memory in self.known.memories}
        player.durations = self.known.durations
        attack = Attack(player, self.seed, number, len(self.subjects), self.priors, self.until)
        return attack.run(self.budget, self.tiers)

    def lost(self, number: int, reason: str) -> AttackResult:
        """The result of a scenario whose attack crashed its process or reached a limit."""
        return AttackResult(self.subjects[number].scenario.id, [], [], 0.0, [], reason)


def attack(
    task: Task,
    subjects: Sequence[Subject],
    settings: AttackSettings,
    folder: Path,
    progress: Callable[[int, int], None],
) -> AttackReport:
    """Attack every subject, continuing the run in `folder`, and store the hits there.

    Args:
        progress: called with the number of scenarios done, and the number of hits.
    """
    priors = tuple(fitted(task, settings)) if PRIOR in settings.chosen else ()
    budget, rules = max(1, settings.budget // len(subjects)), check_rules(settings.rules)
    identity = {
        "grammar": GRAMMAR,
        "task_version": task.version,
        "scenarios": [one.scenario.id for one in subjects],
        "budget": budget,
        "seed": settings.seed,
        "tiers": list(settings.chosen),
        "rules": settings.rules,
        "source_sha256": source_sha256(task.family),
    }
    if settings.fresh and begun(folder):
        move_aside(folder)
    with Log(folder / LOG, identity, FRESH) as log:
        done = {record["scenario"] for record in log.records}
        todo = [k for k, one in enumerate(subjects) if one.scenario.id not in done]
        limits = Limits(settings.limit_seconds, settings.limit_mb)
        known = experience(task, settings.seed + FITTING_SEED, settings.chosen) if todo else Experience()
        job = AttackJob(tuple(subjects), budget, settings.seed, settings.chosen, priors, rules, known)
        for result in each(job, todo, settings.workers, limits, job.lost):
            for hit in result.hits:
                replace(hit, task=task.name).store(folder)
            log.add(_record(result))
            progress(len(log.records), sum(len(record["hits"]) for record in log.records))
        order = [one.scenario.id for one in subjects]
        log.sort(lambda record: order.index(record["scenario"]))
        return _report(task, rules, subjects, log, folder, priors)


def begun(folder: Path) -> int:
    """Number of scenarios that earlier attacks into a folder have finished, those of a refused identity included."""
    return recorded(folder / LOG)


def check_budget(setting: str, budget: int, scenarios: int) -> None:
    """Raise `BadConfig` if a budget is too small to attack every scenario."""
    if budget < (fewest := FEWEST * scenarios):
        raise BadConfig(
            f"{setting} = {budget} for {scenarios} scenarios; each attack plays a plan filtered and raw, which needs "
            f"{fewest} rollouts; give {setting}={fewest} or more, or fewer scenarios"
        )


def drawn(task: Task, split: str, n: int, seed: int) -> list[Subject]:
    """The first `n` scenarios of a split that their oracle solves, out of at most `DRAWS_PER_SCENARIO * n` draws.

    Raises:
        BadConfig: the oracle solves none of the draws.
    """
    found: list[Subject] = []
    for index in range(DRAWS_PER_SCENARIO * n):
        try:
            scenario = task.draw(split, seed, index).scenario
        except Infeasible:
            continue
        text = rebuild(scenario)
        rollout = run(scenario, World.load(text, task.embodiment), scenario.oracle, task.horizon)
        if rollout.solved:
            name = Name(task.name, split, index, scenario.id)
            found.append(Subject(scenario, text, task.embodiment, task.horizon, rollout.actions, name))
        if len(found) == n:
            return found
    if not found:
        draws = DRAWS_PER_SCENARIO * n
        raise BadConfig(f"{task.name}/{split}: the oracle solves none of {draws} draws, so none can be attacked")
    return found


def certified(task: Task, rows: Iterable[PoolRow]) -> list[Subject]:
    """Certified scenarios, with their witnesses."""
    return [
        Subject(task.scenario(r.params, r.split), r.scene_xml, r.embodiment, r.horizon, r.witness, r.name) for r in rows
    ]


def store_in_pool(report: AttackReport, folder: Path) -> dict[str, Any]:
    """The entry of a pool's manifest about an attack on it. The hits are copied to the pool.

    Args:
        folder: folder of the pool.

    Raises:
        BadConfig: the hits cannot be written.
    """
    files = []
    for hit in report.hits:
        content = read_plain(report.folder / f"{hit.name}.npz", MAX_HIT)
        write(folder / HITS_FOLDER / f"{hit.name}.npz", content)
        files.append({"file": f"{HITS_FOLDER}/{hit.name}.npz", "sha256": sha256(content), **hit.plain()})
    return {**report.plain(), "hits": files}


def wrong_hits(pool: Pool, task: Task) -> Iterator[tuple[str, str]]:
    """Contradictions between a pool's manifest and its hits.

    Yields:
        The tier or file in question, and the contradiction.
    """
    attack = pool.manifest.attack or {}
    yield from (("attack", why) for why in _contradictions(pool, attack))
    counts = Counter((hit["tier"], hit["raw"]) for hit in pool.manifest.hits)
    for rate in pool.manifest.rates:
        if rate["tier"] not in RATED:
            yield rate["tier"], f"the attack counts rollouts of an unknown tier; known: {', '.join(RATED)}"
        if rate["hits"] != counts.pop((rate["tier"], rate["raw"]), 0):
            yield rate["tier"], "the attack counts a different number of hits than it lists"
    if counts:
        yield next(iter(counts))[0], "the attack lists hits of a tier that it does not count"
    ids = {id_ for (id_,) in pool.columns("id")}
    for entry in pool.manifest.hits:
        try:
            path = pool.folder / entry["file"]
            if why := why_not_plain(path):
                yield entry["file"], f"the hit {why}"
                continue
            found = Hit.load(path)
            listed = {key: value for key, value in entry.items() if key not in ("file", "sha256")}
            if sha256(read_plain(path, MAX_HIT)) != entry["sha256"] or json.loads(json.dumps(found.plain())) != listed:
                yield entry["file"], "the hit differs from the one that the manifest lists"
            elif entry["file"] != f"{HITS_FOLDER}/{found.name}.npz":
                yield entry["file"], f"the hit is not named {found.name}, or is listed twice"
            elif found.refutes and found.scenario in ids:
                yield entry["file"], f"the pool holds {found.scenario}, which this hit refutes"
            elif why := (again := replayed(found, task)).fault:
                yield entry["file"], why
            elif not again.exact and same_bits(pool.manifest):
                yield entry["file"], "the replay ends in other bits than the hit says"
        except (ScengenError, OSError, ValueError) as error:
            yield entry["file"], str(error)


ENTRIES = (
    *("task", "task_version", "rules", "grammar", "scenarios", "rollouts"),
    *("rates", "priors", "not_tried", "lost", "hits"),
)
"""Entries about an attack in the manifest of a pool."""


def _contradictions(pool: Pool, attack: Mapping[str, Any]) -> Iterator[str]:
    """Entries about an attack that contradict each other, or the pool. Earlier releases have fewer of them."""
    if unknown := sorted(attack.keys() - {*ENTRIES}):
        yield f"it has an unknown entry {cut(unknown[0])!r}"
    manifest, rates = pool.manifest, pool.manifest.rates
    of = {"task": pool.task, "task_version": manifest.task_version, "rules": STRICT}
    of["rollouts"] = sum(rate["rollouts"] for rate in rates)
    for name, here in of.items():
        if (there := attack.get(name, here)) != here:
            yield f"it says {name} = {cut(repr(there), 40)}, which must be {here!r}"
    refuting = Counter((hit["tier"], hit["raw"]) for hit in manifest.hits if hit.get("lacks") or hit.get("otherwise"))
    for rate in rates:
        key = rate["tier"], rate["raw"]
        made = TierRate(*key, rate["rollouts"], rate["hits"], refuting[key]).plain()
        if wrong := [name for name, there in rate.items() if not alike({name: made.get(name)}, {name: there})]:
            yield f"{wrong[0]} of the tier {key[0]} does not follow from the listed hits and rollouts"
        if rate["hits"] > rate["rollouts"]:
            yield f"the tier {key[0]} has more hits than rollouts"
    if len({(rate["tier"], rate["raw"]) for rate in rates}) < len(rates):
        yield "it counts a tier twice"
    yield from _other_scenarios(pool, attack)


def _other_scenarios(pool: Pool, attack: Mapping[str, Any]) -> Iterator[str]:
    """Whether the attacked scenarios are those of the pool and those that were refuted."""
    lists: dict[str, Any] = {name: attack.get(name, []) for name in ("scenarios", "lost", "priors", "not_tried")}
    if wrong := [name for name, there in lists.items() if not isinstance(there, list)]:
        yield f"{wrong[0]} is not a list"
        return
    named, ids = {str(name) for name in lists["scenarios"]}, {id_ for (id_,) in pool.columns("id")}
    refuted = {str(hit.get("scenario")) for hit in pool.manifest.hits if hit.get("lacks") or hit.get("otherwise")}
    if named and named != ids | refuted:
        yield f"it names the scenarios {shown(named)}, not those of the pool and of the hits that refute"
    for told, names in (
        ("hits of", [str(hit.get("scenario")) for hit in pool.manifest.hits]),
        ("losses of", [str(lost).partition(" ")[0] for lost in lists["lost"]]),
    ):
        if others := {*names} - (named or ids | refuted):
            yield f"it has {told} {shown(others)}, which it has not attacked"


def shown(names: Iterable[str]) -> str:
    """The first of some names, for messages."""
    return cut(", ".join(sorted(names)[:3]), 100)


def player_of(subject: Subject, rules: Rules = STRICT) -> Player:
    """A player for attempts on a subject."""
    with scene_errors(f" of {subject.name}"):
        return Player(subject.scenario, subject.scene_xml, subject.embodiment, subject.horizon, subject.witness, rules)


def fitted(task: Task, settings: AttackSettings) -> list[Prior]:
    """The best fixed answers of a task, fitted on other draws; none if its family declares no answer."""
    answer = task.family().answer()
    if answer is None:
        return []
    static = has_statics(answer)
    count = STATICS_DRAWS if static else ROLLOUT_DRAWS
    training = list(feasible(task, settings.split, settings.seed + FITTING_SEED, count))
    if not training:
        return []
    fresh = list(feasible(task, settings.split, settings.seed + FRESH_SEED, count)) if static else []
    return fit(training, by_statics if static else _by_rollouts(task), fresh)


def _by_rollouts(task: Task) -> AnswerJudge:
    def judge(scenario: Scenario) -> Callable[[float], bool]:
        world, answer = world_of(scenario, task.embodiment), scenario.answer()
        assert answer is not None, "fitted once for the family"

        def right(value: float) -> bool:
            def guess(world: World) -> Plan:
                return answer.act(world, value)

            return run(scenario, world, guess, task.horizon, until_settled=True).solved

        return right

    return judge


def _record(result: AttackResult) -> dict[str, Any]:
    counts = [asdict(rate) for rate in result.rates]
    untried = [asdict(one) for one in result.untried]
    hits = [hit.name for hit in result.hits]
    about = {"rates": counts, "hits": hits, "untried": untried, "cpu": result.cpu, "lost": result.lost}
    return {"scenario": result.scenario, **about}


def _report(
    task: Task, rules: Rules, subjects: Sequence[Subject], log: Log, folder: Path, priors: tuple[Prior, ...]
) -> AttackReport:
    records = log.records
    counts = [TierRate(**rate) for record in records for rate in record["rates"]]
    hits = [Hit.load(folder / f"{name}.npz") for record in records for name in record["hits"]]
    untried = tuple(UntriedShortcut(**one) for record in records for one in record["untried"])
    cpu = sum(record["cpu"] for record in records)
    lost = tuple(f"{record['scenario']} {record['lost']}" for record in records if record["lost"])
    order = tuple(one.scenario.id for one in subjects)
    sorted_rates = tuple(_sorted(rates(counts)))
    return AttackReport(
        task.name, task.version, rules, order, sorted_rates, tuple(hits), priors, untried, lost, folder, cpu
    )


def _sorted(counts: Sequence[TierRate]) -> list[TierRate]:
    """Rates in the order of the tiers."""
    return sorted(counts, key=lambda rate: (TIERS.index(rate.tier.split("_")[0]), rate.tier, rate.raw))
