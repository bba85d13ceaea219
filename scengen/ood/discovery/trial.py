"""One trial: a memory is played in a scenario outside training, and the oracle if the memory fails."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from ...errors import BadConfig, ScengenError
from ...params import with_values
from ...samplers.task import Task
from ...scenario import Scenario
from ...validate.certify import certify
from ...validate.settings import CertifySettings
from ...work.parallel import Limits
from .. import behaviour
from .regions import Region, values_at

BREAKS = "breaks"
"""Outcome: the memory fails and the oracle succeeds."""
HOLDS = "holds"
"""Outcome: the memory succeeds."""
UNSOLVED = "unsolved"
"""Outcome: the memory fails and the oracle fails too, or the trial was lost."""
UNSOUND = "unsound"
"""Outcome: the scene fails a check that comes before the oracle."""
INFEASIBLE = "infeasible"
"""Outcome: a constraint of the family does not hold."""
CONFIRM = "confirm"
"""Stage of the trials that confirm a box."""
STAND_INS = 5
"""Number of training scenarios that are tried in a twin's place until a memory solves its own scenario again."""
TRIAL_LIMITS = Limits(300.0, 4000)
"""Time and memory limits of one trial: some rollouts take several seconds."""


class Place(NamedTuple):
    """A place in one region."""

    region: int
    """Number of the region."""
    at: float
    """Place in the region, from 0 to 1."""


@dataclass(frozen=True)
class Point:
    """A place in each of one or two regions."""

    places: tuple[Place, ...]
    """Places in the order of their regions."""

    @property
    def regions(self) -> tuple[int, ...]:
        """Numbers of the regions."""
        return tuple(place.region for place in self.places)

    def __iter__(self) -> Iterator[Place]:
        return iter(self.places)


class Range(NamedTuple):
    """A range of places in one region."""

    region: int
    """Number of the region."""
    low: float
    """Lower end, from 0 to 1."""
    high: float
    """Upper end, from 0 to 1."""


@dataclass(frozen=True)
class RegionBox:
    """A range of places in each of one or two regions."""

    ranges: tuple[Range, ...]
    """Ranges in the order of their regions."""

    @property
    def regions(self) -> tuple[int, ...]:
        """Numbers of the regions."""
        return tuple(part.region for part in self.ranges)

    def holds(self, point: Point) -> bool:
        """Whether a point moves the same regions and lies within all ranges."""
        return point.regions == self.regions and all(
            part.low <= place.at <= part.high for part, place in zip(self.ranges, point, strict=True)
        )


@dataclass(frozen=True)
class PlannedTrial:
    """A trial that is to be made."""

    number: int
    """Number of the trial in the search."""
    stage: str
    """Stage of the search that requests the trial."""
    where: Point | RegionBox
    """Point of the trial, or the box to be confirmed."""
    twin: int
    """Number of the twin whose memory is played."""

    def ended(self, outcome: str, controls: Sequence[bool] = (), reason: str = "") -> "SearchTrial":
        """The trial with its outcome."""
        return SearchTrial(self.number, self.stage, self.where, self.twin, outcome, tuple(controls), reason)

    def lost(self, reason: str) -> "SearchTrial":
        """The trial if its process crashed or reached a limit: unsolved, with the reason."""
        return self.ended(UNSOLVED, reason=reason)


@dataclass(frozen=True)
class SearchTrial(PlannedTrial):
    """A trial that was made."""

    outcome: str
    """Outcome: `BREAKS`, `HOLDS`, `UNSOLVED`, `UNSOUND` or `INFEASIBLE`."""
    controls: tuple[bool, ...] = ()
    """Whether the memory solved each of its controls; empty in a search trial."""
    reason: str = ""
    """Reason why the trial was lost; empty otherwise."""

    @property
    def breaks(self) -> bool:
        """Whether the memory failed and the oracle succeeded."""
        return self.outcome == BREAKS

    @property
    def point(self) -> Point:
        """Point of a search trial."""
        assert isinstance(self.where, Point), "a box is confirmed, not searched"
        return self.where

    def plain(self) -> dict[str, Any]:
        """The trial as a record of the log."""
        where = self.where.places if isinstance(self.where, Point) else self.where.ranges
        record = {"number": self.number, "stage": self.stage, "point": where, "twin": self.twin}
        record["outcome"] = self.outcome
        if self.reason:
            record["reason"] = self.reason
        elif self.stage == CONFIRM:
            record["controls"] = list(self.controls)
        return record

    @classmethod
    def read(cls, record: Mapping[str, Any]) -> "SearchTrial":
        """A record of the log as a trial."""
        parts = record["point"]
        where = (
            RegionBox(tuple(Range(*p) for p in parts))
            if record["stage"] == CONFIRM
            else Point(tuple(Place(*p) for p in parts))
        )
        given = {field.name: record[field.name] for field in fields(cls) if field.name in record}
        return cls(**{**given, "where": where, "controls": tuple(record.get("controls", ()))})


@dataclass(frozen=True)
class TrialRunner:
    """Plays trials: what all trials of a search share."""

    task: Task
    checks: CertifySettings
    """Settings of the checks that come before the oracle."""
    known: Sequence[Region]
    """Regions outside training, by number."""
    seed: int

    def twin(self, number: int) -> tuple[Scenario, behaviour.SolutionMemory]:
        """Training scenario `number`, or another one if its memory does not solve it again.

        Raises:
            BadConfig: none of `STAND_INS` scenarios is solved again by its memory.
        """
        for index in range(number, number + 1000 * STAND_INS, 1000):
            trained, memory = behaviour.recall(self.task, self.seed, index)
            if memory is not None and behaviour.faithful(self.task, trained):
                return trained, memory
        raise BadConfig(f"{self.task.name}: no memory of {STAND_INS} training scenarios solves its own scenario again")

    def feasible(self, trained: Scenario, point: Point) -> bool:
        """Whether a scenario moved to a point satisfies all constraints."""
        try:
            return self._moved(trained, point).infeasible() is None
        except (ScengenError, ValueError):
            return False

    def outcome(self, trained: Scenario, memory: behaviour.SolutionMemory, point: Point) -> str:
        """Outcome of a memory in its own scenario, some parameters of which are moved outside training."""
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

    def _moved(self, trained: Scenario, point: Point) -> Scenario:
        return with_values(trained, values_at({self.known[place.region]: place.at for place in point}))


def play_search_trial(runner: TrialRunner, planned: PlannedTrial) -> SearchTrial:
    """Make one trial of the search."""
    assert isinstance(planned.where, Point), "a box is confirmed, not searched"
    return planned.ended(runner.outcome(*runner.twin(planned.twin), planned.where))
