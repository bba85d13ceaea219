"""Records of what was measured on the axes, from which docs/axes.md is written: a file for each task in every folder.

records/axes holds what the cards of `scengen probe` say, records/beliefs the planners with beliefs of training alone,
and records/baselines the trained policies. A record counts as long as its axis has the distributions that it was
measured with.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from scengen.ood.axis_card import NOT_SEARCHED, read_card
from scengen.ood.baseline import LEARNERS, Baseline
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.statistics import difference, paired, rate
from scengen.typed import typed

ROOT = Path(__file__).parent.parent
CARDS = ROOT / "records" / "axes"
"""Folder of what the cards say."""
BELIEFS = ROOT / "records" / "beliefs"
"""Folder of the planners with beliefs of training."""
LEARNED = ROOT / "records" / "baselines"
"""Folder of the trained policies."""
MADE = ROOT / "generated" / "axes"
"""Folder of the cards."""

Record = dict[str, Any]


def lines(path: Path) -> list[Record]:
    """The records of a file; none if there is no file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []


def shifts(task: Task, axis: str) -> dict[str, str]:
    """The distributions of an axis, as a record tells them."""
    return {name: str(dist) for name, dist in task.shifts(axis).items()}


def read(folder: Path, task: Task) -> dict[str, Record]:
    """The records of a task that still count, by axis."""
    known = {record["axis"]: record for record in lines(folder / f"{task.name}.jsonl")}
    return {axis: known[axis] for axis in task.axes if axis in known and known[axis]["shifts"] == shifts(task, axis)}


def store(folder: Path, task: Task, axis: str, record: Mapping[str, Any]) -> None:
    """Write the record of an axis, in the order of the task's file. Records of axes that have changed are dropped."""
    records = read(folder, task) | {axis: {"axis": axis, "shifts": shifts(task, axis), **record}}
    folder.mkdir(parents=True, exist_ok=True)
    text = "".join(json.dumps(records[name]) + "\n" for name in task.axes if name in records)
    (folder / f"{task.name}.jsonl").write_text(text)


def store_card(task: Task, axis: str) -> None:
    """Write the record of a card.

    Raises:
        ScengenError: there is no card, or one of an earlier format.
    """
    card = read_card(MADE / f"{task.name}-{axis}" / "card.json")
    gaps = [proof["relative"] for proof in card["proofs"] if proof["relative"]]
    told = [{name: value for name, value in one.items() if name != "finding"} for one in card["baselines"]]
    record = {
        "outside": min(gaps, default=None),
        "leaving": [departure["feature"] for departure in card["features"] if departure["inside"] == 0],
        "baselines": [typed("baseline", Baseline, one).record for one in told],
        "boundaries": {who: _boundary(card, who) for who in ("replay", "oracle")},
        "energy": card["energy"],
    }
    store(CARDS, task, axis, record)


def _boundary(card: Mapping[str, Any], who: str) -> str:
    if card["why_no_path"]:
        return "not searched" if card["why_no_path"] == NOT_SEARCHED else "separate values"
    found = card["boundaries"][who]
    return found["told"] + "".join(f", {name} {value:.3g}" for name, value in found["values"].items())


def baselines(task: Task) -> dict[str, dict[str, Baseline]]:
    """The baselines of every axis by name: of two records of one, that with more twins; and the task's learner."""
    found: dict[str, dict[str, Baseline]] = {axis: {} for axis in task.axes}
    for folder in (CARDS, BELIEFS):
        for axis, record in read(folder, task).items():
            for one in map(Baseline.of_record, record["baselines"]):
                known = found[axis].get(one.name)
                if known is None or one.twins >= known.twins:
                    found[axis][one.name] = one
    for axis, learner in learners(task).items():
        found[axis][learner.name] = learner
    return found


def learners(task: Task) -> dict[str, Baseline]:
    """Success of one trained policy on the axes on which it was played, over all its trainings.

    It is the policy that solves most training scenarios, so that its failures elsewhere tell most; of several, the
    first one of `LEARNERS`.
    """
    known = lines(LEARNED / f"{task.name}.jsonl")
    splits = {ID: {}} | {axis: shifts(task, axis) for axis in task.axes}
    played = {
        (name, split): outcomes(
            one for one in known if (one["policy"], one["split"], one["shifts"]) == (name, split, moved)
        )
        for name in LEARNERS
        for split, moved in splits.items()
    }
    training = {name: rate([*played[name, ID].values()]).value for name in LEARNERS if played[name, ID]}
    if not training:
        return {}
    best = max(training, key=lambda name: training[name])
    return {axis: _learner(best, played[best, ID], played[best, axis]) for axis in task.axes if played[best, axis]}


def outcomes(records: Iterable[Record]) -> dict[int, list[bool]]:
    """Successes in each scenario, by its number: one for each record, which are those of several trainings."""
    found: dict[int, list[bool]] = {}
    for record in records:
        for index, success in record["outcomes"]:
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
