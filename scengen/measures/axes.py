"""Measurements of OOD axes: cards, and planners with beliefs of training."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ..evidence import measuring
from ..evidence.ledger import Evidence
from ..ood.axis_card import NOT_SEARCHED, read_card
from ..ood.baseline import Baseline
from ..ood.behaviour import Trials
from ..ood.belief import measure_belief
from ..samplers.task import Task
from ..work.typed import typed
from .measurement import Job, Measurement, Result, Row


@dataclass(frozen=True)
class _OfAxes(Measurement):
    """A measurement of axes that more twins extend."""

    def all_splits(self, task: Task) -> Sequence[str]:
        return (*task.axes,)

    def answers(self, row: Evidence, job: Job) -> bool:
        return row.n >= job.made_with["n"]


@dataclass(frozen=True)
class Cards(_OfAxes):
    """Cards of axes, as `scengen axis card` makes them with n twins."""

    KIND = "axis"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 50}
    COMMANDS = True
    FOLDER = "generated/axes"

    def result(self, job: Job) -> Result:
        task, [axis], n = job.task, job.splits, self.options["n"]
        folder = self.folder / f"{task.name}-{axis}"
        settings = (f"n={n}", f"workers={self.workers}", f"to={folder}")
        self.finish("axis", "card", f"task={task.name}", f"axis={axis}", *settings)
        card = read_card(folder / "card.json")
        return Result(job, [Row(axis, n, _of_card(card))], f"{folder / 'card.html'}")


def _of_card(card: Mapping[str, Any]) -> dict[str, Any]:
    """Figures of a card."""
    gaps = [proof["relative"] for proof in card["proofs"] if proof["relative"]]
    told = [{name: value for name, value in one.items() if name != "finding"} for one in card["baselines"]]
    return {
        "outside": min(gaps, default=None),
        "leaving": [departure["feature"] for departure in card["features"] if departure["inside"] == 0],
        "baselines": [typed("baseline", Baseline, one).record for one in told],
        "boundaries": {who: _boundary(card, who) for who in ("replay", "oracle")},
        "energy": card["energy"],
    }


def _boundary(card: Mapping[str, Any], who: str) -> str:
    if card["why_no_path"]:
        return "not searched" if card["why_no_path"] == NOT_SEARCHED else "separate values"
    found = card["boundaries"][who]
    return found["told"] + "".join(f", {name} {value:.3g}" for name, value in found["values"].items())


@dataclass(frozen=True)
class Beliefs(_OfAxes):
    """Planners with beliefs of training, played on n twins of an axis without making its card.

    A twin takes 5 to 7 rollouts, about a second of processor time. Outcomes of single twins are kept by the draws and
    the version of a task, so that more twins extend fewer.
    """

    KIND = "belief"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 8}
    FOLDER = "generated/beliefs"

    def result(self, job: Job) -> Result:
        task, [axis], n = job.task, job.splits, self.options["n"]
        folder = self.folder / f"{task.name}-{axis}" / f"v{task.version}-{measuring.draws_of(task, axis)}"
        if self.fresh:
            (folder / "beliefs.jsonl").unlink(missing_ok=True)
        found = measure_belief(task, axis, folder, Trials(n, belief_n=n))
        records = [one.record for one in found]
        counts = (f"{one['name']} {one['training']} -> {one['here']} of {one['twins']}" for one in records)
        words = ", ".join(f"{count}: {one.finding}" for count, one in zip(counts, found, strict=True))
        return Result(job, [Row(axis, n, {"baselines": records})], words)
