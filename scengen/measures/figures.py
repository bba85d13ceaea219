"""Tables of what the ledger holds about a task: certification, axes, attacks and policies, as text by title.

`scengen site` shows them for any task, and the documentation for scengen's own.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from ..attack.evidence import TierRate
from ..episode import STRICT
from ..evaluate.statistics import Rate, difference, paired, rate
from ..evidence import ledger
from ..evidence.ledger import Evidence
from ..learn.models import BC, MIP
from ..learn.train import TrainSettings
from ..ood.analysis.distance import Energy
from ..ood.baseline import BELIEF, LEARNERS, MOTION, OBJECT_CENTRIC, Baseline, verdict
from ..ood.behaviour import HELD_OUT
from ..ood.belief import moves_hidden
from ..samplers.split import ID
from ..samplers.task import Task
from ..validate.settings import lower_bound
from .policies import POLICIES, REPLAY, UNTRAINED

CERTIFIED = ("certified", "oracle", "robosuite")
"""Titles of the figures of certification."""
BASELINES = (*MOTION, *OBJECT_CENTRIC, *BELIEF)
"""Baselines with a separate column."""
TITLES = [name.replace("object_centric", "object-centric").replace("_", " ") for name in BASELINES]
"""Titles of their columns."""
AXIS = (
    *("outside", "physics", *CERTIFIED, "verdict", *TITLES),
    *("learner", "replay ends", "oracle ends", "energy"),
)
"""Titles of the figures of an axis."""
ATTACK = (
    *("random", "foreign", "shortcuts", "servo", "clock", "1 memory", "2 memories"),
    *("1 fixed", "2 fixed", "3 fixed", "retries", "own", "rollouts", "refuting"),
)
"""Titles of the figures of an attack."""
POLICY = ("split", "policy", "solved", "rate [%]", "why not")
"""Titles of the figures of policies."""
SHOWN = (*POLICIES, REPLAY)
"""Policies that are played on axes, too."""


def table(titles: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    """A table as Markdown."""
    lines = (titles, ["---"] * len(titles), *rows)
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


# --- certification ----------------------------------------------------------------------------


def certified(task: str) -> dict[str, Evidence]:
    """The row of certification at level `quick` of each split."""
    rows = [row for row in ledger.newest("certified", task) if "level" not in row.made_with]
    return {row.split: row for row in sorted(rows, key=lambda row: row.n)}


def certification(task: str, row: Evidence | None) -> list[str]:
    """The figures of certification of a split. Earlier rows have no draws for the oracle, or no replays."""
    if row is None:
        return [ledger.not_measured(task)] * len(CERTIFIED)
    found, oracle, same = row.value, "-", "-"
    if "draws" in found:
        oracle = f"{found['solved']} of {found['draws']} (> {100 * lower_bound(found['solved'], found['draws']):.0f}%)"
    if found.get("replays"):
        same = f"{found['same']} of {found['replays']}"
    return [f"{found['certified']} of {found['indices']}{ledger.mark(row)}", oracle, same]


# --- axes -------------------------------------------------------------------------------------


def axes(task: Task) -> dict[str, dict[str, str]]:
    """The figures of each axis by title, in the order of the task's file."""
    certificates, known, found = certified(task.name), cards(task.name), baselines(task)
    cells = {axis: axis_cells(task, axis, known.get(axis), found[axis], certificates.get(axis)) for axis in task.axes}
    return {axis: dict(zip(AXIS, own, strict=True)) for axis, own in cells.items()}


def axis_cells(
    task: Task, axis: str, card: Mapping[str, Any] | None, found: Mapping[str, Baseline], row: Evidence | None
) -> list[str]:
    """The figures of an axis from its card, its baselines, and its row of certification."""
    none = ledger.not_measured(task.name)
    outside, physics, replay_ends, oracle_ends, energy = [none] * 5
    if card:
        outside = "another value" if card["outside"] is None else f"{card['outside']:.2g}"
        outside += marked_cards(task.name, axis)
        physics = ", ".join(card["leaving"]) or "stays"
        replay_ends, oracle_ends, energy = *card["boundaries"].values(), str(Energy(**card["energy"]))
    cells = [baseline_cell(found[name]) if name in found else none for name in BASELINES]
    if not moves_hidden(task, axis):
        cells[BASELINES.index("hidden_belief")] = "nothing hidden"
    judged = verdict(found.values()) if found else none
    learner = learner_cell(found) or none
    return [outside, physics, *certification(task.name, row), judged, *cells, learner, replay_ends, oracle_ends, energy]


def learner_cell(found: Mapping[str, Baseline]) -> str:
    """The cell of the learner that solves most in training; of two, the first one of `LEARNERS`. Empty for none."""
    tried = [found[name] for name in LEARNERS if name in found]
    best = max(tried, key=lambda one: one.training.value if one.training else 0.0, default=None)
    return f"{best.name}: {baseline_cell(best)}" if best else ""


def baseline_cell(baseline: Baseline) -> str:
    """Success of a baseline in training and on an axis, and its loss with the 95 % interval."""
    if not (baseline.training and baseline.here and baseline.excess):
        return baseline.finding
    training, here, lost = baseline.training, baseline.here, baseline.excess
    marks = [
        "weak" if baseline.finding == "too weak" else "",
        f"{_count(training)} → {_count(here)} of {here.rollouts}",
        f"{lost.value:+.2f} [{lost.low:.2f}, {lost.high:.2f}]",
        "held out" if baseline.control == HELD_OUT and not baseline.name.startswith("any") else "",
        "" if lost.twins else "unpaired",
    ]
    return ", ".join(filter(None, marks))


def _count(rate: Rate) -> int:
    """Number of solved episodes: one for each scenario, or one for each of a learner's trainings."""
    return round(rate.value * rate.rollouts)


def marked_cards(task: str, axis: str) -> str:
    """The mark of the rows of an axis, as of `ledger.mark`."""
    rows = [row for kind in ("axis", "belief") for row in ledger.newest(kind, task) if row.split == axis]
    return max(map(ledger.mark, rows), default="")


def cards(task: str) -> dict[str, Mapping[str, Any]]:
    """Figures of the card of each axis that has one."""
    return {axis: row.value for axis, row in ledger.latest("axis", task).items()}


def baselines(task: Task) -> dict[str, dict[str, Baseline]]:
    """The baselines of every axis by name: of two rows about one, that with more twins; and the task's learner."""
    found: dict[str, dict[str, Baseline]] = {axis: {} for axis in task.axes}
    for row in (*ledger.newest("axis", task.name), *ledger.newest("belief", task.name)):
        if row.split not in found:  # an axis of an earlier version
            continue
        for one in map(Baseline.of_record, row.value["baselines"]):
            known = found[row.split].get(one.name)
            if known is None or one.twins >= known.twins:
                found[row.split][one.name] = one
    for axis, learner in learners(task).items():
        found[axis][learner.name] = learner
    return found


def learners(task: Task) -> dict[str, Baseline]:
    """Success of one trained policy on the axes on which it was played, over all its trainings.

    It is the policy that solves most training scenarios, so that its failures elsewhere show most; of several, the
    first one of `LEARNERS`.
    """
    known = ledger.newest("baseline", task.name)
    played = {
        (name, split): outcomes(row for row in known if row.split == split and row.has(policy=name))
        for name in LEARNERS
        for split in (ID, *task.axes)
    }
    training = {name: rate([*played[name, ID].values()]).value for name in LEARNERS if played[name, ID]}
    if not training:
        return {}
    best = max(training, key=lambda name: training[name])
    return {axis: _learner(best, played[best, ID], played[best, axis]) for axis in task.axes if played[best, axis]}


def outcomes(rows: Iterable[Evidence]) -> dict[int, list[bool]]:
    """Successes in each scenario, by its number: one for each row, which are those of several trainings."""
    found: dict[int, list[bool]] = {}
    for row in rows:
        for index, success in row.value["outcomes"]:
            found.setdefault(index, []).append(success)
    return found


def _learner(name: str, training: Mapping[int, list[bool]], here: Mapping[int, list[bool]]) -> Baseline:
    """The baseline of a trained policy, paired by twins if half of the scenarios have one."""
    twins = [index for index in here if index in training]
    if 2 * len(twins) >= len(here):
        a, b = ([played[index] for index in twins] for played in (training, here))
        return Baseline(name, 1.0, "training", rate(a), rate(b), paired(a, b))
    inside, outside = (rate([*played.values()]) for played in (training, here))
    return Baseline(name, 1.0, "training", inside, outside, difference(inside, outside))


# --- attacks ----------------------------------------------------------------------------------


def attack(task: str, rules: str = STRICT) -> Mapping[str, Any] | None:
    """The report on a task that was attacked: by the newest grammar of plans, and with the most rollouts."""
    rows = [row for row in ledger.newest("attack", task) if row.has(rules=rules)]
    last = max(rows, key=lambda row: (row.made_with["grammar"], row.value["rollouts"]), default=None)
    return {**last.value, "mark": ledger.mark(last)} if last else None


def attack_cells(report: Mapping[str, Any]) -> list[str]:
    """The figures of an attack."""
    fixed = {len(prior["values"]): _share(prior) for prior in report["priors"]}
    return [
        *(_counted(report, tier) for tier in ("random", "foreign", "shortcut", "servo", "clock")),
        *(_counted(report, tier) for tier in ("memory_1", "memory_2")),
        *(fixed.get(count, "-") for count in (1, 2, 3)),
        *(_counted(report, *tiers) for tiers in (("retry",), ("detour", "witness", "search"))),
        f"{report['rollouts']}{report['mark']}",
        str(len(report["hits"])),
    ]


def _counted(report: Mapping[str, Any], *tiers: str) -> str:
    known = [rate for rate in report["rates"] if rate["tier"] in tiers]
    total = TierRate("", False, sum(rate["rollouts"] for rate in known), sum(rate["hits"] for rate in known))
    return f"{total.hits} of {total.rollouts} (< {total.bound:.1%})" if total.rollouts else "-"


def _share(prior: Mapping[str, Any]) -> str:
    if prior["fresh"] is None:
        return f"{prior['fitted']:.1%} where fitted"
    return f"{prior['fresh']:.1%} (< {prior['bound']:.1%})"


# --- policies ---------------------------------------------------------------------------------


def policies(task: Task) -> Iterator[list[str]]:
    """The figures of policies: one line for each split and policy that was measured."""
    rows = ledger.newest("baseline", task.name)
    for split, policy in product((ID, *task.axes), (*SHOWN, *UNTRAINED)):
        if own := trainings_of(rows, policy, split):
            yield _of_policy(own)


def trainings_of(rows: Iterable[Evidence], policy: str, split: str) -> list[Evidence]:
    """The rows of a policy on a split, one for each training, by seed."""
    chosen = [row for row in rows if row.split == split and row.has(policy=policy)]
    return sorted(chosen, key=lambda row: row.made_with.get("seed", 0))


def _of_policy(rows: Sequence[Evidence]) -> list[str]:
    """The line of a policy on a split, over all its trainings."""
    first = rows[0]
    interval = rate([*outcomes(rows).values()])
    reasons = sum((Counter(row.value["reasons"]) for row in rows), Counter[str]())
    why = "; ".join(f"{number} x {reason}" for reason, number in reasons.most_common(2))
    shown = f"{100 * interval.value:.0f} [{100 * interval.low:.0f}, {100 * interval.high:.0f}]"
    solved = ", ".join(str(row.value["solved"]) for row in rows)
    policy, epochs = first.made_with["policy"], first.made_with.get("epochs")
    if policy in (BC, MIP) and epochs != TrainSettings().epochs:
        policy += f", {epochs} epochs"
    return [first.split, policy, f"{solved} of {first.n}{ledger.mark(first)}", shown, why]
