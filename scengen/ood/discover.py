"""A search for axes: where outside training an object-centric memory fails and the oracle does not.

First every region outside training is tried far out, one parameter at a time, then a hypercube spreads over all
regions, one or two parameters at a time, each point in a twin of its own. A constraint costs no trial: regions end
where no twin is feasible any more, and a point goes to a twin in which it is. Then a forest learns from it, and
points are tried where it is least sure: at the edges of what was found. What two parameters do together is tried
with one of them alone, and what broke a memory is tried again, and around it, until it is known where it ends. What
is left is confirmed on fresh twins, each beside its controls, and only that counts: a search among hundreds of points
finds something by luck. The test is exact and goes by twins: of all scenarios in which a twin's memory was played,
controls and the one outside training, each is as likely as the others to be among those that it solved, if nothing is
special outside (with one control McNemar's test). A memory that fails half of its controls can still tell something.

One trial is a memory played in one scenario, and its oracle where the memory fails.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.stats.qmc import Halton

from ..errors import BadConfig, ScengenError
from ..params import with_values
from ..samplers.axis import Axis, Proof
from ..samplers.dists import Dist, Fixed, Integer, Mixture, Uniform
from ..samplers.keyed import unit
from ..samplers.task import Task
from ..scenario import Scenario
from ..validate.certify import certify
from ..validate.identity import source_sha256
from ..validate.settings import CertifySettings
from ..work.log import Log
from ..work.parallel import Limits, Workers, each
from . import behaviour
from .regions import Region, located, regions, spelled

FOREST, HYPERCUBE = "forest", "hypercube"
METHODS = (FOREST, HYPERCUBE)
BREAKS, HOLDS, UNSOLVED, UNSOUND, INFEASIBLE = "breaks", "holds", "unsolved", "unsound", "infeasible"
"""What came of a trial: the memory fails and the oracle does not; the memory solves it; the oracle fails too; the
scene fails a check that comes before the oracle; a constraint does not hold."""
TWINS = 8
"""Training scenarios whose memories are played while searching."""
FRESH, DRAWS = 20, 20
"""Twins in which a finding is confirmed, each in a scenario of its own, and draws until that is feasible."""
STAND_INS = 5
"""Training scenarios that are tried in a twin's place until a memory solves its own scenario again."""
STEPS = 16
"""Steps in which it is found where in a region some twin is feasible."""
OUTER = 0.25
"""Share of a region that is far out."""
CONTROLS = 3
"""Moves within training that each fresh twin's memory is tried on."""
LOOK, FUTILE = 5, 0.5
"""Twins between looks, and the p value above which a box is given up at one."""
LEVEL = 0.05
"""Family-wise error rate of the confirmation, by Holm's correction (Holm 1979)."""
LOOKS = FRESH // LOOK
"""p values may be believed at any look: they are multiplied by the number of looks (Bonferroni)."""
SURE = LEVEL / 20 / LOOKS
"""The p value below which no more is asked of a box: that of one among twenty."""
SHARES = (0.35, 0.55, 0.7)
"""Which share of the budget is spent when the hypercube ends, the forest ends, the narrowing ends."""
LEAST = math.ceil(FRESH / (1 - SHARES[-1]))
"""The least budget, of which something can be confirmed."""
BATCH = 8
"""Points that are tried before the forest learns anew, or boxes are drawn anew."""
CANDIDATES = 12
"""How many boxes are narrowed, those with most evidence first."""
AROUND = 0.3
"""How far around a box it is tried [shares of the box, and at least 0.05 of the region]."""
EVIDENCE = 3
"""So many more breaks than twice the other outcomes must a box hold to be confirmed."""
POOL = 4000
"""Points among which the forest chooses."""
LIMITS = Limits(300.0, 4000)
"""Of one trial: some rollouts take some seconds."""

Point = tuple[tuple[int, float], ...]
"""Places in regions: pairs of a region's number and a place from 0 to 1, in the order of the regions."""
Reaches = dict[int, tuple[float, float]]
"""By a region's number, from which place to which something in it is feasible."""


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen discover`; meanings stand in conf/command/discover.yaml."""

    budget: int = 500
    method: str = FOREST
    seed: int = 0
    workers: Workers = 1
    to: str | None = None


@dataclass(frozen=True)
class Finding:
    """A box outside training in which the memory fails and the oracle does not."""

    axis: Axis
    proofs: list[Proof]
    seen: int
    """Trials of the search within the box in which the memory failed and the oracle did not."""
    tried: int
    """Trials of the search within the box that were feasible."""
    confirmed: int
    """Fresh twins in which the memory failed and the oracle did not."""
    fresh: int
    """Fresh twins tried."""
    within: int
    """Of their controls, those that the memory solved."""
    controls: int
    """Controls tried."""
    p: float
    """Of the confirmation, one-sided, corrected for its looks, and by Holm for the number of boxes."""
    known: tuple[str, ...]
    """Axes of the task file that move one of the same parameters into the same region."""


@dataclass(frozen=True)
class Search:
    """What a search found, and what it spent."""

    findings: list[Finding]
    """Those that were confirmed, the surest first."""
    rejected: list[Finding]
    """Those that were not."""
    spent: dict[str, int]
    """Trials by what came of them."""
    stages: dict[str, int]
    """Trials by stage."""


def discover(
    task: Task,
    checks: CertifySettings,
    settings: Settings,
    folder: Path,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> Search:
    """Search, continuing what stands in `folder`.

    Args:
        checks: settings of the checks that come before the oracle.
        progress: told what is being done, how far it is, and how much there is.

    Raises:
        BadConfig: the method is none of `METHODS`, scikit-learn is missing, no training scenario can be solved, or
            nothing outside training is feasible.
    """
    if settings.method == FOREST:
        _forest()  # before any work, to say at once that it is missing
    known = regions(task)
    asked = _Asked(task, checks, settings, known, folder, progress)
    with asked.log:
        ends = [round(share * settings.budget) for share in SHARES]
        random = np.random.default_rng(settings.seed)
        reaches = asked.reaches()
        if not reaches:
            raise BadConfig(f"{task.name}: no value outside training is feasible; widen the bounds of its parameters")
        asked.ask("far", _far(known, reaches, random)[: ends[0]])
        asked.ask("hypercube", _hypercube(ends[0] - asked.spent, reaches, random))
        if settings.method == FOREST:
            while asked.spent < ends[1]:
                asked.ask("forest", _uncertain(asked.records, reaches, random)[: ends[1] - asked.spent])
        else:
            asked.ask("hypercube", _hypercube(ends[1] - asked.spent, reaches, random))
        asked.ask("shrink", _alone(asked.records)[: max(0, ends[2] - asked.spent)])
        while asked.spent < ends[2] and (around := _around(asked.records)):
            asked.ask("narrow", around[: ends[2] - asked.spent])
        tested = list[tuple[_Box, list[dict[str, Any]]]]()
        for score, box in _boxes(asked.records):
            if score >= EVIDENCE and asked.spent + FRESH <= settings.budget:
                tested.append((box, asked.confirm(len(tested), box)))
    found = [_finding(task, known, box, asked.records, outcomes) for box, outcomes in tested]
    sure = _holm(found)
    return Search(
        [f for f in sure if f.p < LEVEL],
        [f for f in sure if f.p >= LEVEL],
        dict(Counter(r["outcome"] for r in asked.log.records)),
        dict(Counter(r["stage"] for r in asked.log.records)),
    )


# --- trials -------------------------------------------------------------------------------------


class _Asked:
    """Trials, from the log as far as it goes."""

    def __init__(
        self,
        task: Task,
        checks: CertifySettings,
        settings: Settings,
        known: Sequence[Region],
        folder: Path,
        progress: Callable[[str, int, int], None],
    ):
        self.trials = _Trials(task, checks, known, settings.seed)
        self.settings, self.progress = settings, progress
        source = source_sha256(task.family)
        named = {"task": task.name, "training": {n: str(d) for n, d in task.training.items()}, "source": source}
        chosen = {"budget": settings.budget, "method": settings.method, "seed": settings.seed, "controls": CONTROLS}
        self.log = Log(folder / "trials.jsonl", named | chosen)
        self.spent = 0

    @property
    def records(self) -> list[dict[str, Any]]:
        """The trials of the search itself, without those that confirm."""
        return [r for r in self._numbered(0) if r["stage"] != "confirm"]

    @cached_property
    def trained(self) -> list[Scenario]:
        """The twins. Workers are copies of this process, which remembers now how they are solved."""
        return [self.trials.twin(number)[0] for number in range(TWINS)]

    def reaches(self) -> Reaches:
        """From which place to which some twin is feasible, in every region that has such places."""
        found: Reaches = {}
        for i in range(len(self.trials.known)):
            steps = [k for k in range(STEPS) if self._feasible(((i, (k + 0.5) / STEPS),), range(TWINS)) is not None]
            if steps:
                found[i] = steps[0] / STEPS, (steps[-1] + 1) / STEPS
        return found

    def ask(self, stage: str, points: Sequence[tuple[Point, int | None]]) -> None:
        """Try points, each in the twin that is named, or in the next one in which it is feasible."""
        items = list[_Item]()
        for number, (point, twin) in enumerate(points, self.spent):
            turns = [twin] if twin is not None else [(number + k) % TWINS for k in range(TWINS)]
            feasible = self._feasible(point, turns)
            items.append(_Item(number, stage, point, turns[0] if feasible is None else feasible))
        self._run(partial(_try, self.trials), items)

    def _feasible(self, point: Point, twins: Iterable[int]) -> int | None:
        """The first of some twins in which a point is feasible."""
        return next((k for k in twins if self.trials.feasible(self.trained[k], point)), None)

    def confirm(self, number: int, box: "_Box") -> list[dict[str, Any]]:
        """Try a box in fresh twins, some at a time, until all are tried, or they tell enough or too little."""
        begin, outcomes = self.spent, list[dict[str, Any]]()
        for first in range(0, FRESH, LOOK):
            some = range(first, first + LOOK)
            items = [_Item(begin + k, "confirm", box.ranges, TWINS + number * FRESH + k) for k in some]
            self._run(partial(_confirm, self.trials), items)
            outcomes = self._numbered(begin)
            if not SURE <= _p(outcomes) <= FUTILE:
                break
        return outcomes

    def _run(self, work: Callable[["_Item"], dict[str, Any]], items: Sequence["_Item"]) -> None:
        tried = {record["number"] for record in self.log.records}
        todo = [item for item in items if item.number not in tried]
        for record in each(work, todo, self.settings.workers, LIMITS, _lost):
            self.log.add(record)
            self.progress(record["stage"], len(self.log.records), self.settings.budget)
        self.spent += len(items)

    def _numbered(self, begin: int) -> list[dict[str, Any]]:
        """The trials from number `begin` on, in order: with several workers they end in any."""
        asked = (record for record in self.log.records if begin <= record["number"] < self.spent)
        return sorted(asked, key=lambda record: record["number"])


@dataclass(frozen=True)
class _Item:
    """A trial that is to be made."""

    number: int
    """In the search."""
    stage: str
    point: tuple[tuple[float, ...], ...]
    """A `Point`; where a box is to be confirmed, its ranges."""
    twin: int

    def record(self, outcome: str, **more: Any) -> dict[str, Any]:
        """What came of it, as plain data."""
        return {**asdict(self), "outcome": outcome, **more}


def _lost(item: _Item, reason: str) -> dict[str, Any]:
    return item.record(UNSOLVED, reason=reason)


def _try(trials: "_Trials", item: _Item) -> dict[str, Any]:
    return item.record(trials.outcome(*trials.twin(item.twin), item.point))


def _confirm(trials: "_Trials", item: _Item) -> dict[str, Any]:
    """A box in one fresh twin, at a random place; controls are moves of the same parameters within training.

    A parameter that training does not vary has one control, the scenario that is remembered.
    """
    box, number = item.point, item.twin - TWINS
    trained, memory = trials.twin(item.twin)
    outcome, task, seed = INFEASIBLE, trials.task, trials.seed
    solved = list[bool]()
    for attempt in range(DRAWS):
        point = [(i, low + unit("discover", seed, number, attempt, int(i)) * (high - low)) for i, low, high in box]
        if trials.feasible(trained, point):
            outcome = trials.outcome(trained, memory, point)
            break
    if outcome in (BREAKS, HOLDS):
        names = [trials.known[int(i)].parameter.name for i, *_ in box]
        moves = [behaviour.moved_within(task, names, seed, number + 1000 * k, trained) for k in range(CONTROLS)]
        controls = dict.fromkeys(move for move in moves if move is not None)
        solved = [behaviour.follows(task, memory, control) for control in controls]
    return item.record(outcome, controls=solved)


@dataclass(frozen=True)
class _Trials:
    """What all trials of a search share."""

    task: Task
    checks: CertifySettings
    known: Sequence[Region]
    seed: int

    def twin(self, number: int) -> tuple[Scenario, behaviour.Memory]:
        """Training scenario `number`, or another one if its memory does not solve it again."""
        for index in range(number, number + 1000 * STAND_INS, 1000):
            trained, memory = behaviour.recall(self.task, self.seed, index)
            if memory is not None and behaviour.faithful(self.task, trained):
                return trained, memory
        raise BadConfig(f"{self.task.name}: no memory of {STAND_INS} training scenarios solves its own scenario again")

    def feasible(self, trained: Scenario, point: Iterable[Sequence[float]]) -> bool:
        """Whether a point contradicts no constraint in a scenario."""
        try:
            return self._moved(trained, point).infeasible() is None
        except (ScengenError, ValueError):
            return False

    def _moved(self, trained: Scenario, point: Iterable[Sequence[float]]) -> Scenario:
        return with_values(trained, spelled({self.known[int(i)]: place for i, place in point}))

    def outcome(self, trained: Scenario, memory: behaviour.Memory, point: Iterable[Sequence[float]]) -> str:
        """What comes of a memory in its own scenario with some parameters put outside training."""
        try:
            scenario = self._moved(trained, point)
            if scenario.infeasible():
                return INFEASIBLE
            certified = certify(scenario, self.task.horizon, self.checks, self.task.embodiment, last="unsolved")
            if any(check.passed is False for check in certified.certificate.checks):
                return UNSOUND
            if behaviour.follows(self.task, memory, scenario):
                return HOLDS
            return BREAKS if behaviour.solves(self.task, scenario) else UNSOLVED
        except (ScengenError, ValueError):
            return UNSOUND  # its builder, MuJoCo or the physics refuses such values


# --- where to look ------------------------------------------------------------------------------


def _far(known: Sequence[Region], reaches: Reaches, random: np.random.Generator) -> list[tuple[Point, None]]:
    """A point far out in each region: near its feasible end, or in its middle where training lies behind its end."""
    points = list[tuple[Point, None]]()
    for i in map(int, random.permutation(list(reaches))):
        begin = 1 - OUTER if known[i].beyond else (1 - OUTER) / 2
        points.append((((i, _placed(reaches[i], begin + OUTER * random.random())),), None))
    return points


def _placed(reach: tuple[float, float], share: float) -> float:
    return round(float(reach[0] + share * (reach[1] - reach[0])), 6)


def _hypercube(n: int, reaches: Reaches, random: np.random.Generator) -> list[tuple[Point, None]]:
    """Points with one or two regions: every region as often as any other, its places spread evenly (Latin hypercube).

    Two of three points move one parameter only.
    """
    turns, uses = list[list[int]](), Counter[int]()
    deck = list[int]()
    for k in range(n):
        wanted = 1 if k % 3 else 2
        while len(deck) < 2:
            deck += [int(i) for i in random.permutation(list(reaches))]
        first = deck.pop(0)
        chosen = [first] if wanted == 1 else sorted({first, deck.pop(0)})
        turns.append(chosen)
        uses.update(chosen)
    places = {i: list((random.permutation(m) + random.random(m)) / m) for i, m in sorted(uses.items())}
    return [(tuple((i, _placed(reaches[i], places[i].pop())) for i in chosen), None) for chosen in turns]


def _forest() -> type[Any]:
    """Scikit-learn's classifier.

    Raises:
        BadConfig: scikit-learn is missing.
    """
    try:
        from sklearn.ensemble import RandomForestClassifier
    except ImportError:
        raise BadConfig(
            "no scikit-learn for method=forest; say pip install 'scengen[discover]', or method=hypercube"
        ) from None
    return RandomForestClassifier


def _uncertain(
    records: list[dict[str, Any]], reaches: Reaches, random: np.random.Generator
) -> list[tuple[Point, None]]:
    """The points of which a forest knows least whether they break the memory, all in different regions."""
    count = max(reaches) + 1
    table = np.stack([_row(r["point"], count) for r in records])
    breaks = np.array([r["outcome"] == BREAKS for r in records])
    points = [point for point, _ in _hypercube(POOL, reaches, random)]
    if breaks.all() or not breaks.any():
        return [(point, None) for point in points[:BATCH]]
    forest = _forest()(200, min_samples_leaf=2, random_state=int(random.integers(2**31)))
    share = forest.fit(table, breaks).predict_proba(np.stack([_row(p, count) for p in points]))[:, 1]
    chosen, used = list[tuple[Point, None]](), set[int]()
    for k in np.argsort(-share * (1 - share), kind="stable"):
        where = {i for i, _ in points[k]}
        if not used & where:
            used |= where
            chosen.append((points[k], None))
        if len(chosen) == BATCH:
            break
    return chosen


def _row(point: Iterable[Sequence[float]], count: int) -> NDArray[np.float64]:
    row = np.full(count, -0.2)  # not moved: before the beginning of every region
    for i, place in point:
        row[int(i)] = place
    return row


def _alone(records: list[dict[str, Any]]) -> list[tuple[Point, int]]:
    """One parameter of each pair that broke a memory, in the same twin: what a pair does, one of them may do alone."""
    single = {r["point"][0][0] for r in records if len(r["point"]) == 1 and r["outcome"] == BREAKS}
    pairs = [r for r in records if len(r["point"]) == 2 and r["outcome"] == BREAKS]
    return [
        ((tuple(place),), r["twin"])
        for r in pairs
        if not any(place[0] in single for place in r["point"])
        for place in r["point"]
    ]


def _around(records: list[dict[str, Any]]) -> list[tuple[Point, None]]:
    """A point in each of the boxes with most evidence, or a little outside: where does it end?

    Points of one box come evenly spread, however many there will be (Halton's).
    """
    points = list[tuple[Point, None]]()
    for _, box in _boxes(records)[:CANDIDATES]:
        keys = {i for i, *_ in box.ranges}
        tried = sum(r["stage"] == "narrow" and {int(i) for i, _ in r["point"]} == keys for r in records)
        shares = Halton(len(keys), scramble=False).fast_forward(tried + 1).random()[0]
        place = list[tuple[int, float]]()
        for share, (i, low, high) in zip(shares, box.ranges, strict=True):
            spare = max(AROUND * (high - low), 0.05)
            begin, end = max(0.0, low - spare), min(1.0, high + spare)
            place.append((i, round(begin + float(share) * (end - begin), 6)))
        points.append((tuple(place), None))
    return points


# --- what was found -----------------------------------------------------------------------------


@dataclass(frozen=True)
class _Box:
    """Ranges of places in one or two regions."""

    ranges: tuple[tuple[int, float, float], ...]

    def holds(self, point: Iterable[Sequence[float]]) -> bool:
        places = {int(i): place for i, place in point}
        return places.keys() == {i for i, *_ in self.ranges} and all(
            low <= places[i] <= high for i, low, high in self.ranges
        )


def _boxes(records: list[dict[str, Any]]) -> list[tuple[int, _Box]]:
    """Boxes in which memories broke with their evidence, most first; pairs only where neither does it alone."""
    where: dict[tuple[int, ...], list[dict[str, Any]]] = {}
    for record in records:
        where.setdefault(tuple(int(i) for i, _ in record["point"]), []).append(record)
    found = list[tuple[int, _Box]]()
    alone = set[int]()
    for key in sorted(where, key=len):
        if len(key) == 2 and alone.intersection(key):
            continue
        if best := _best(key, where[key]):
            found.append(best)
            alone.update(key if len(key) == 1 else ())
    return sorted(found, key=lambda f: (-f[0], len(f[1].ranges), f[1].ranges))


def _best(key: tuple[int, ...], records: list[dict[str, Any]]) -> tuple[int, _Box] | None:
    """The box with the most breaks, less twice the other outcomes in it; None where nothing breaks."""
    points = [dict(map(tuple, r["point"])) for r in records]
    broken = [p for p, r in zip(points, records, strict=True) if r["outcome"] == BREAKS]
    best: tuple[int, float, _Box] | None = None
    for one in broken:
        for other in broken:
            ranges = tuple((i, min(one[i], other[i]), max(one[i], other[i])) for i in key)
            box = _Box(ranges)
            inside = [r["outcome"] == BREAKS for p, r in zip(points, records, strict=True) if box.holds(p.items())]
            score = sum(inside) - 2 * (len(inside) - sum(inside))
            size = sum(high - low for _, low, high in ranges)
            if best is None or (score, size) > best[:2]:
                best = (score, size, box)
    return (best[0], best[2]) if best else None


def _finding(
    task: Task, known: Sequence[Region], box: _Box, records: list[dict[str, Any]], outcomes: list[dict[str, Any]]
) -> Finding:
    moved = {known[i].parameter.name: _dist(known[i], low, high) for i, low, high in box.ranges}
    name = "_and_".join(known[i].name for i, *_ in box.ranges)
    confirmed = sum(r["outcome"] == BREAKS for r in outcomes)
    played = [solved for r in outcomes for solved in r.get("controls", ())]
    why = f"An object-centric memory fails in {confirmed} of {len(outcomes)} fresh twins that the oracle solves"
    why += f" and, moved within training, in {played.count(False)} of {len(played)}."
    single = len(box.ranges) == 1 and known[box.ranges[0][0]].beyond and not known[box.ranges[0][0]].parameter.integer
    axis = Axis(name, why, "scengen discover", moved, 5 if single else 0)
    inside = [r["outcome"] for r in records if box.holds(r["point"]) and r["outcome"] != INFEASIBLE]
    same = [a.name for a in task.axes.values() if any(_same(known[i], a.replace) for i, *_ in box.ranges)]
    return Finding(
        *(axis, task.prove(axis), inside.count(BREAKS), len(inside)),
        *(confirmed, len(outcomes), sum(played), len(played), min(1.0, LOOKS * _p(outcomes)), tuple(same)),
    )


def _p(outcomes: list[dict[str, Any]]) -> float:
    """How likely as few fresh twins or fewer would be solved if a memory did as well there as in its controls.

    Exact, and conditional on how much each twin's memory solves: where that is `k` of `m` controls and the one scenario
    outside training, the latter is among them with probability `k / (m + 1)`.
    """
    chances, held = np.ones(1), 0  # of 0, 1, 2 ... twins solved
    for record in outcomes:
        if record["outcome"] in (BREAKS, HOLDS) and record["controls"]:
            holds = record["outcome"] == HOLDS
            share = (sum(record["controls"]) + holds) / (len(record["controls"]) + 1)
            chances, held = np.convolve(chances, (1 - share, share)), held + holds
    return float(chances[: held + 1].sum())


def _dist(region: Region, low: float, high: float) -> Dist:
    """The distribution over a range of places; on a circle it may run through the seam of the parameter's bounds."""
    begin, end = region.value(low), region.value(high)
    known = region.parameter
    if known.integer:
        return Fixed(begin) if begin == end else Integer(*sorted((int(begin), int(end))))
    begin, end = (float(f"{v:.4g}") for v in (begin, end))
    if known.period and begin > end:
        return Mixture((_range(begin, known.high), _range(known.low, end)))
    return _range(*sorted((begin, end)))


def _range(low: float, high: float) -> Fixed | Uniform:
    return Fixed(low) if low == high else Uniform(low, high)


def _same(region: Region, replaced: Any) -> bool:
    dist = replaced.get(region.parameter.name)
    return dist is not None and any(located(region, v) for part in dist.support for v in (part.low, part.high))


def _holm(found: list[Finding]) -> list[Finding]:
    """Findings with p values after Holm's correction, the surest first."""
    ordered, least, corrected = sorted(found, key=lambda f: f.p), 0.0, list[Finding]()
    for k, finding in enumerate(ordered):
        least = max(least, min(1.0, (len(ordered) - k) * finding.p))
        corrected.append(replace(finding, p=least))
    return corrected


def as_yaml(task: Task, search: Search) -> str:
    """The confirmed axes as a task file has them, and what the search has spent."""
    spent = ", ".join(f"{count} {what}" for what, count in (search.stages | search.spent).items())
    axes = {finding.axis.name: _entry(finding) for finding in search.findings}
    found = yaml.safe_dump({"axes": axes}, sort_keys=False, default_flow_style=None, width=120)
    return f"# Axes of {task.name} found by scengen discover: {spent}\n{found}"


def _entry(finding: Finding) -> dict[str, Any]:
    """An axis as it stands in a task file."""
    moved: dict[str, Any] = {}
    for name, dist in finding.axis.replace.items():
        *groups, last = name.split(".")
        inner = moved
        for group in groups:
            inner = inner.setdefault(group, {})
        inner[last] = _plain(dist)
    severities = {"severities": finding.axis.severities} if finding.axis.severities else {}
    return {"why": finding.axis.why, "source": finding.axis.source, **severities, "replace": moved}


def _plain(dist: Dist) -> list[Any]:
    if isinstance(dist, Fixed):
        return ["fixed", dist.value]
    if isinstance(dist, Mixture):
        return ["mixture", *map(_plain, dist.parts)]
    ends = dist.support[0].low, dist.support[-1].high
    return ["integer" if isinstance(dist, Integer) else "uniform", *ends]
