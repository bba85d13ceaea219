"""Which cheap baseline predicts what an axis does to a learner: the tables of docs/predictors.md, from the ledger.

They compare the loss of each baseline, and the distance of the features, with the learner's loss, over all axes on
which a learner was tried that works in training.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.stats import mannwhitneyu, rankdata

from scengen import list_tasks, load_task
from scengen.evaluate.statistics import NORMAL_QUANTILE
from scengen.evidence import ledger
from scengen.measures import figures
from scengen.measures.figures import table
from scengen.ood.baseline import BELIEF, INCONCLUSIVE, LEARNERS, MOTION, OBJECT_CENTRIC, Baseline, verdict

MIN_AXES = 60
"""Number of axes from which the best predictor is chosen. At 60, the interval of a rank correlation of 0.5 has a half
width of 0.2, so that a good predictor can be told from a useless one."""
MIN_TRAINING = 0.5
"""Smallest share of the training scenarios that a learner has to solve for its losses to count. `domino_select` is a
choice of five, and its learners solve 4 to 6 of 20 scenarios: they tip a chain, and cannot lose what is chance."""
DISTANCE = "distance of features"
"""Predictor: energy distance between the features in and out of distribution [training ranges]."""
TELLING = ("breaks", "holds")
"""Findings that tell something."""
PREDICTORS = (*MOTION, *OBJECT_CENTRIC, *BELIEF, DISTANCE)
"""What is compared."""
EXCEPTIONS = {
    ("balance_medium", "wide_rod"): (
        "The wider the hand stands, the less firmly the policy closes it: in training such a width was passed while "
        "closing. The rod slips, or is never lifted."
    ),
    ("cube_toss", "big_cube"): (
        "A hand around a wide cube stands as far open as one that has begun to release it in training: it opens early, "
        "at half of the swing, and the cube falls short."
    ),
    ("domino_single", "diagonal"): (
        "Goals are seen from the hand: it turns with the row, to 45 deg, and pushes along it. A planner that believes "
        "in a direction of training strikes the first tile askew."
    ),
    ("edge_slide", "far_inset"): (
        "A memory pushes as far as in training; the policy goes on until the plate overhangs."
    ),
    ("linear_intercept", "fast"): (
        "The hand waits in the right place and closes when a ball of training would arrive. The planner sees the speed."
    ),
    ("mirror_pick_place", "big"): (
        "The open hand stops 6 to 8 cm above a cube that is larger than any of training, 1 cm beside its middle, and "
        "does not close."
    ),
    ("pick_place_ycb", "far_jumps"): (
        "A memory goes to where the square jumped at that time; the policy steers to where it is now."
    ),
    ("pick_place_ycb", "late_jump"): "As for `far_jumps`.",
    ("pick_place_ycb", "more_jumps"): "As for `far_jumps`.",
    ("pick_place_ycb", "small_patch"): (
        "The policy puts the object down 4 to 7 cm beside the middle, which the square of training allows. Nothing "
        "that it sees tells the size of a mark on the table."
    ),
    ("slip_recovery", "late_slip"): (
        "The object falls 10 to 13 cm from the middle of the square, nearer than nearly always in training. The open "
        "hand hovers 10 cm above it, 2 to 4 cm beside, and does not come down."
    ),
    ("slip_recovery", "two_slips"): (
        "As for `late_slip` after the second slip, or the object is put down 3 to 5 cm beside the middle."
    ),
    ("slip_recovery", "long_window"): (
        "A memory closes the hand at a remembered moment, when it is still held open; the policy looks."
    ),
}
"""Axes on which the card and the learner disagree, and what was found when the learner was watched."""


@dataclass(frozen=True)
class Score:
    """Agreement of a predictor with the learner."""

    axes: int
    """Number of axes on which both are known."""
    correlation: float | None
    """Rank correlation; None if it is not defined, as with fewer than four axes."""
    auc: float | None
    """Area under the curve; None if the learner breaks on all or none of the axes."""

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the rank correlation, by Fisher's transformation."""
        r = min(max(self.correlation or 0.0, -0.999), 0.999)
        half = NORMAL_QUANTILE * math.sqrt((1 + r**2 / 2) / (self.axes - 3))
        return math.tanh(math.atanh(r) - half), math.tanh(math.atanh(r) + half)


def fills() -> dict[str, str]:
    """The tables of docs/predictors.md."""
    return {"predictors": _scores(), "sentence": sentence(), "trials": _tried(), "exceptions": _exceptions()}


def _scores() -> str:
    """The table of the predictors."""
    rows = [("predictor", "axes", "rank correlation", "AUC")]
    for name in PREDICTORS:
        found = score(name)
        told = "not defined"
        if found.correlation is not None:
            told = "{:+.2f} [{:+.2f}, {:+.2f}]".format(found.correlation, *found.interval)
        auc = "not defined" if found.auc is None else f"{found.auc:.2f}"
        rows.append((_spelled(name), str(found.axes), told, auc))
    return table(rows[0], rows[1:])


def _tried() -> str:
    """The table of the axes on which a learner was tried."""
    rows = [("task", "axis", "learner", "loss", "finding")]
    rows += [(one.task, one.axis, one.learner.name, f"{one.drop:+.2f}", one.learner.finding) for one in _trials()]
    return table(rows[0], rows[1:])


def _exceptions() -> str:
    """The table of the axes on which the card and the learner disagree."""
    rows = [("task", "axis", "card", "learner in training and here", "what it is")]
    for one in (trial for trial in _trials() if DISTANCE in trial.losses):  # which a card tells
        broken = any(found.finding == "breaks" for found in one.card if found.name in (*OBJECT_CENTRIC, *BELIEF))
        told = verdict(one.card)
        clear = broken or (told != INCONCLUSIVE and not told.startswith("breaks"))
        if clear and broken != (one.learner.finding == "breaks"):
            rates = [one.learner.training, one.learner.here]
            counts = " → ".join(f"{100 * rate.value:.0f} %" for rate in rates if rate)
            what = EXCEPTIONS.get((one.task, one.axis), "not looked into")
            rows.append((one.task, one.axis, told, counts, what))
    return table(rows[0], rows[1:])


def sentence() -> str:
    """Which predictor is the best, as text."""
    told = ", otherwise ".join(map(_spelled, ranking()))
    if told:
        return f"Where no learner was tried, the best predictor that was ([figures](predictors.md)) stands in: {told}."
    tried = f"it takes {MIN_AXES} axes, and {len(_trials())} were tried ([figures](predictors.md))"
    return f"Which baseline predicts the learner is not decided: {tried}."


def cell(task: str, found: Mapping[str, Baseline]) -> str:
    """What is told of an axis of a task that no learner has tried."""
    for name in ranking():
        if name in found and found[name].finding in TELLING:
            return f"{ledger.not_measured(task)}; {_spelled(name)} predicts: {found[name].finding}"
    return ledger.not_measured(task)


def _spelled(name: str) -> str:
    """Name of a predictor as text."""
    return name.replace("_", " ")


@cache
def ranking() -> list[str]:
    """The predictors that are baselines and known on enough axes, the best one first."""
    known = {name: score(name) for name in PREDICTORS if name != DISTANCE}
    enough = {name: one.correlation for name, one in known.items() if one.axes >= MIN_AXES and one.correlation}
    return sorted(enough, key=lambda name: -enough[name])


def score(name: str) -> Score:
    """The agreement of a predictor with the learner."""
    known = [one for one in _trials() if name in one.losses]
    mine, learned = [one.losses[name] for one in known], [one.drop for one in known]
    varied = len(set(mine)) > 1 and len(set(learned)) > 1
    correlation = float(np.corrcoef(rankdata(mine), rankdata(learned))[0, 1]) if len(known) > 3 and varied else None
    lost = [one.losses[name] for one in known if one.learner.finding == "breaks"]
    kept = [one.losses[name] for one in known if one.learner.finding != "breaks"]
    auc = float(mannwhitneyu(lost, kept)[0]) / (len(lost) * len(kept)) if lost and kept else None
    return Score(len(known), correlation, auc)


@dataclass(frozen=True)
class Trial:
    """An axis on which a learner was tried that works in training."""

    task: str
    """Name of the task."""
    axis: str
    """Name of the axis."""
    learner: Baseline
    """Success of the learner."""
    card: tuple[Baseline, ...]
    """The other baselines of the axis."""
    losses: Mapping[str, float]
    """Figures of the predictors that are known."""

    @property
    def drop(self) -> float:
        """Loss of the learner."""
        return self.learner.excess.value if self.learner.excess else 0.0


@cache
def _trials() -> list[Trial]:
    """All axes on which a learner was tried that works in training."""
    found = []
    for task in (load_task(name) for name in list_tasks() if ledger.newest("baseline", name)):
        cards = figures.cards(task.name)
        for axis, baselines in figures.baselines(task).items():
            learner = next((baselines[name] for name in LEARNERS if name in baselines), None)
            if learner is None or learner.training is None or learner.training.value < MIN_TRAINING:
                continue
            clear = {name: one for name, one in baselines.items() if name in PREDICTORS and one.finding != "too weak"}
            losses = {name: one.excess.value for name, one in clear.items() if one.excess}
            if axis in cards:
                losses[DISTANCE] = cards[axis]["energy"]["distance"]
            card = tuple(one for name, one in baselines.items() if name not in LEARNERS)
            found.append(Trial(task.name, axis, learner, card, losses))
    return found
