"""The axis card: all evidence about one OOD axis."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import BadConfig, UnknownName, cut
from ..evaluate.statistics import Rate
from ..samplers.axis import Proof
from ..samplers.task import Task
from ..work.limits import at_least
from ..work.parallel import Workers
from ..work.plain import read_plain
from . import behaviour, boundary, features
from .analysis.distance import Energy
from .baseline import Baseline

FORMAT = 3
"""Format of `card.json`. A card without a number is of format 1, which lacks the planners with beliefs of training and
whose verdict names a memory alone; one of format 2 lacks `nearest_belief`."""
NOT_SEARCHED = "boundaries were not searched for (rounds=0)"
"""Reason why a card has no boundaries if none were requested."""


@dataclass(frozen=True)
class AxisSettings:
    """Settings of `scengen axis card`; conf/command/axis_card.yaml explains them."""

    axis: str = ""
    n: int = 50
    any_n: int | None = None
    belief_n: int | None = None
    certify_n: int | None = None
    seed: int = 0
    rounds: int = 20
    workers: Workers = 1
    fresh: bool = False
    to: str | None = None

    def check(self, task: Task) -> None:
        """Raise `ScengenError` if a setting is not valid for this task."""
        if self.axis not in task.axes:
            raise UnknownName(f"axis of {task.name}", self.axis, task.axes)
        at_least(self, n=2, seed=0, rounds=0, workers=1)
        for name in ("any_n", "belief_n", "certify_n"):
            if not 0 <= (value := self.count(name)) <= self.n:
                raise BadConfig(f"{name} = {value}; it must be from 0 to n = {self.n}")

    def count(self, name: str) -> int:
        """Value of `any_n`, `belief_n` or `certify_n`: all twins if it is not given."""
        given = getattr(self, name)
        return self.n if given is None else given

    @property
    def trials(self) -> behaviour.Trials:
        """Trials of the baselines."""
        return behaviour.Trials(self.n, self.count("any_n"), self.count("belief_n"), self.seed, self.workers)


@dataclass(frozen=True)
class AxisCard:
    """The evidence about one axis."""

    task: str
    axis: str
    why: str
    source: str
    proofs: list[Proof]
    """Proof for each moved parameter that its values lie outside training."""
    features: list[features.Departure]
    """Departures of the features that the family declares."""
    features_stay: bool
    """Whether features are declared and none of them leaves training."""
    funnel: Mapping[str, int]
    """Number of draws that passed each step of certification."""
    reasons: Mapping[str, int]
    """Number of rejected draws by reason."""
    indices: int
    """Number of indices that were tried for the certified scenarios; 0 if none was requested."""
    first_draws: int
    """Number of indices whose first draw was certified."""
    verdict: str
    """Verdict on the axis, see `baseline.verdict_of_twins`."""
    baselines: list[Baseline]
    """Results of the memories, then those of the planners with beliefs from training."""
    oracle: Rate | None
    """Success rate of the oracle in the OOD twins, certified or not."""
    boundaries: dict[str, boundary.Boundary]
    """Boundaries of replay and oracle."""
    why_no_path: str
    """Reason why there are no boundaries; empty if there are."""
    energy: Energy
    """Energy distance between the features of the first n draws in and out of distribution [training ranges]."""
    energy_of_parameters: Energy
    """Energy distance between the moved parameters of the same draws [training ranges]."""

    def plain(self) -> dict[str, Any]:
        """The card as plain data, for JSON."""
        values = {"format": FORMAT, **asdict(self)}
        values["baselines"] = [{**asdict(baseline), "finding": baseline.finding} for baseline in self.baselines]
        values["boundaries"] = {
            k: {**asdict(b), "verdict": b.verdict, "told": str(b)} for k, b in self.boundaries.items()
        }
        return values


def read_card(path: Path) -> dict[str, Any]:
    """The plain data of a stored card.

    Raises:
        BadConfig: the file cannot be read, or is a card of another format.
    """
    try:
        card = json.loads(read_plain(path))
        made, task, axis = card.get("format", 1), card["task"], card["axis"]
    except (OSError, ValueError, AttributeError, KeyError, TypeError, RecursionError) as error:
        raise BadConfig(f"{path} is not the card of an axis: {type(error).__name__} {cut(str(error))}") from None
    if made != FORMAT:
        remedy = f"scengen axis card task={task} axis={axis} writes it again, and plays only what is missing"
        raise BadConfig(f"{path} is a card of format {cut(str(made))}; this version reads format {FORMAT}; {remedy}")
    return card
