"""Sampled proofs that features leave training. Interval arithmetic cannot prove it; draws prove it with a bound."""

from contextlib import suppress
from dataclasses import dataclass

from scipy.special import betaincinv

from ..errors import BadConfig, Infeasible
from ..params import values
from ..samplers.task import Task
from ..scenario import Scenario

CONFIDENCE = 0.95
"""Confidence of the bounds."""
DRAWS = 300
"""Number of draws of a sampled proof. If none of 300 lies inside training, at most 1 % of the split does, at 95 %
confidence (rule of three)."""


@dataclass(frozen=True)
class Departure:
    """Distance of one feature of a split from its range in training."""

    feature: str
    training: tuple[float, float]
    """Smallest and largest value among the training draws."""
    here: tuple[float, float]
    """Smallest and largest value among the draws of the split."""
    draws: int
    """Number of draws of the split."""
    inside: int
    """Number of draws of the split that lie in the range of training."""
    bound: float
    """Upper bound of the share of the split that lies there: one-sided, Clopper-Pearson, 95 % confidence."""
    beyond: float
    """Upper bound of the share of training that lies outside its sampled range, at the same confidence (Wilks 1941)."""

    @property
    def kind(self) -> str:
        """Kind of the proof, with its number of draws. An interval proof, as for parameters, needs no draws."""
        return f"sampled, {self.draws} draws"

    @property
    def leaves(self) -> bool:
        """Whether no draw of the split lies within training."""
        return self.inside == 0

    @property
    def gap(self) -> float | None:
        """Gap between the two ranges [widths of the training range]; None if training is one value."""
        free = max(0.0, self.here[0] - self.training[1], self.training[0] - self.here[1])
        span = self.training[1] - self.training[0]
        return free / span if span > 0 else None


@dataclass(frozen=True)
class Evidence:
    """Results of the draws of a split."""

    departures: tuple[Departure, ...]
    """Departures, one for each feature that the family declares."""
    strays: tuple[str, ...]
    """Parameters that differ between twins although no axis names them. If there are any, the sampler is wrong."""
    stuck: tuple[str, ...]
    """Parameters that an axis names and that equal their twin's in some draw."""

    @property
    def features_stay(self) -> bool:
        """Whether features are declared and not one of them leaves training.

        Then only the raw parameters are new, and only behaviour can show whether the problem is new too.
        """
        return bool(self.departures) and not any(d.leaves for d in self.departures)


def sampled(task: Task, split: str, draws: int = DRAWS, seed: int = 0) -> Evidence:
    """Draw a split and its training twins, and compare them.

    Raises:
        BadConfig: no index is feasible.
    """
    twins = _twins(task, split, draws, seed)
    if not twins:
        raise BadConfig(f"{task.name}/{split}: none of {draws} indices is feasible; widen the distributions")
    shifts = task.shifts(split)
    before, after = [values(t) for t, _ in twins], [values(s) for _, s in twins]
    differ = [{n for n in a if a[n] != b[n]} for a, b in zip(before, after, strict=True)]
    here = [{name: float(value) for name, value in s.features().items()} for _, s in twins]
    there = [{name: float(value) for name, value in t.features().items()} for t, _ in twins]
    return Evidence(
        tuple(departure(name, [f[name] for f in there], [f[name] for f in here]) for name in here[0]),
        tuple(sorted(set[str]().union(*differ) - shifts.keys())),
        tuple(sorted(n for n in shifts if any(n not in d for d in differ))),
    )


def departure(feature: str, training: list[float], here: list[float]) -> Departure:
    """The departure of one feature, from its values in draws of training and of the split."""
    low, high = min(training), max(training)
    inside = sum(low <= value <= high for value in here)
    return Departure(
        feature,
        (low, high),
        (min(here), max(here)),
        len(here),
        inside,
        at_most(inside, len(here)),
        unseen(len(training)),
    )


def at_most(hits: int, draws: int) -> float:
    """One-sided Clopper-Pearson upper bound of a share at 95 % confidence."""
    return float(betaincinv(hits + 1, draws - hits, CONFIDENCE)) if hits < draws else 1.0


def unseen(draws: int) -> float:
    """Upper bound of the share of a distribution outside the range of a sample: Beta(2, n - 1), Wilks 1941."""
    return float(betaincinv(2, draws - 1, CONFIDENCE)) if draws > 1 else 1.0


def _twins(task: Task, split: str, draws: int, seed: int) -> list[tuple[Scenario, Scenario]]:
    found = []
    for index in range(draws):
        with suppress(Infeasible):  # an infeasible index is not a scenario; it is counted where scenarios are generated
            *_, last = task.proposals(split, seed, index)
            if last.refutation is None:
                found.append((last.trained or last.scenario, last.scenario))
    return found
