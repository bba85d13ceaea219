"""What the ledger says of axes, which docs/axes.md shows: cards, planners with beliefs, trained policies."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from scengen.evaluate.statistics import difference, paired, rate
from scengen.evidence import ledger, measuring
from scengen.evidence.ledger import Evidence
from scengen.ood.axis_card import NOT_SEARCHED, read_card
from scengen.ood.baseline import LEARNERS, Baseline
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.work.typed import typed

ROOT = Path(__file__).parent.parent
MADE = ROOT / "generated" / "axes"
"""Folder of the cards."""


def store_card(task: Task, axis: str, n: int) -> None:
    """Write the row of a card.

    Args:
        n: number of twins that were requested.

    Raises:
        ScengenError: there is no card, or one of an earlier format.
    """
    card = read_card(MADE / f"{task.name}-{axis}" / "card.json")
    gaps = [proof["relative"] for proof in card["proofs"] if proof["relative"]]
    told = [{name: value for name, value in one.items() if name != "finding"} for one in card["baselines"]]
    value = {
        "outside": min(gaps, default=None),
        "leaving": [departure["feature"] for departure in card["features"] if departure["inside"] == 0],
        "baselines": [typed("baseline", Baseline, one).record for one in told],
        "boundaries": {who: _boundary(card, who) for who in ("replay", "oracle")},
        "energy": card["energy"],
    }
    measuring.keep(task, axis, "axis", n, value, {"n": n})


def _boundary(card: Mapping[str, Any], who: str) -> str:
    if card["why_no_path"]:
        return "not searched" if card["why_no_path"] == NOT_SEARCHED else "separate values"
    found = card["boundaries"][who]
    return found["told"] + "".join(f", {name} {value:.3g}" for name, value in found["values"].items())


def cards(task: Task) -> dict[str, Mapping[str, Any]]:
    """Figures of the card of each axis that has one."""
    return {axis: row.value for axis, row in ledger.latest("axis", task.name).items()}


def baselines(task: Task) -> dict[str, dict[str, Baseline]]:
    """The baselines of every axis by name: of two rows about one, that with more twins; and the task's learner."""
    found: dict[str, dict[str, Baseline]] = {axis: {} for axis in task.axes}
    for row in (*ledger.current("axis", task.name), *ledger.current("belief", task.name)):
        for one in map(Baseline.of_record, row.value["baselines"]):
            known = found[row.split].get(one.name)
            if known is None or one.twins >= known.twins:
                found[row.split][one.name] = one
    for axis, learner in learners(task).items():
        found[axis][learner.name] = learner
    return found


def learners(task: Task) -> dict[str, Baseline]:
    """Success of one trained policy on the axes on which it was played, over all its trainings.

    It is the policy that solves most training scenarios, so that its failures elsewhere tell most; of several, the
    first one of `LEARNERS`.
    """
    known = ledger.current("baseline", task.name)
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
