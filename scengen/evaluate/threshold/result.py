"""The result of a search: where the policy breaks, and where the oracle does."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..comparison import PolicyResult
from ..statistics import Rate, rate
from ..table import percent
from .curves import LOOKS_PER_ROUND, Curves, Estimates
from .settings import ThresholdSettings
from .shift import Shift


@dataclass(frozen=True)
class Level:
    """Rollouts at a level in which the policy did not crash."""

    level: int
    """Number of the level; 0: without a shift."""
    value: str
    """Values of the shift."""
    rate: Rate | None
    """Success rate; None without a rollout."""


@dataclass(frozen=True)
class ThresholdResult(PolicyResult):
    """The search for the threshold of one policy."""

    shift: Shift

    @cached_property
    def levels(self) -> list[Level]:
        """The levels with their success rates."""
        found = []
        for level, outcomes in enumerate(self._outcomes):
            rate_here = rate([[success] for success in outcomes]) if outcomes else None
            found.append(Level(level, self.shift.value(level) if level else "", rate_here))
        return found

    @cached_property
    def _outcomes(self) -> Sequence[Sequence[bool]]:
        """Outcomes of the rollouts at each level."""
        found: list[list[bool]] = [[] for _ in range(self.shift.levels + 1)]
        for line in self.evaluation.episodes:
            level = self.shift.level_of(line["split"], line["perturbation"])
            if level is not None and not line["crashed"]:
                found[level].append(line["success"])
        return found

    @cached_property
    def estimate(self) -> Estimates:
        """What the rollouts show: arrays with one entry."""
        tried = np.array([[len(outcomes) for outcomes in self._outcomes]])
        solved = np.array([[sum(outcomes) for outcomes in self._outcomes]])
        return Curves(self.shift.levels, self.chosen.success).estimates(tried, solved)

    @property
    def chosen(self) -> ThresholdSettings:
        """Settings of the search."""
        assert isinstance(self.settings, ThresholdSettings)
        return self.settings

    @property
    def low(self) -> float | None:
        """Lower end of the interval [levels]; None if the policy may fail without a shift."""
        return None if (low := float(self.estimate.low[0])) < 0 else round(low, 2)

    @property
    def high(self) -> float | None:
        """Upper end of the interval [levels]; None if the policy may never break."""
        return None if (high := float(self.estimate.high[0])) > self.shift.levels else round(high, 2)

    @property
    def point(self) -> float | None:
        """Most likely breaking point [levels]; None if it is not between no shift and the last level."""
        middle = round(float(self.estimate.middle[0]), 2)
        return middle if 0 <= middle <= self.shift.levels else None

    @property
    def sentences(self) -> Iterator[str]:
        """Sentences about the breaking point, a rise, the oracle, and the means."""
        for told in (self.breaking, self.rising, self.by_means, self.exhausted):
            if told:
                yield f"{self.settings.name}: {told}"
        yield self.shift.oracle

    @property
    def breaking(self) -> str:
        """Where the policy breaks."""
        shift, share, last = self.shift, f"{self.chosen.success:.0%}", self.shift.levels
        count = sum(map(len, self._outcomes))
        first = "" if self.low is None else f"{self.low:.1f}"
        if self.estimate.low[0] >= last:
            told = f"does not break up to level {last} of {shift.name}: success stays above {share}"
        elif self.estimate.high[0] <= 0:
            told = f"solves less than {share} without a shift: nothing can break; pass success= below that"
        elif self.low is None and self.high is None:
            told = f"nothing is known of where success falls to {share} along {shift.name}"
        elif self.low is None:
            told = f"breaks before level {self.high:.1f} of {shift.name}, perhaps without a shift (success {share})"
        elif self.high is None:
            told = (
                f"breaks beyond level {first} of {shift.name}, perhaps not at all up to level {last} (success {share})"
            )
        else:
            at = "" if self.point is None else f"level {self.point:.1f}"
            value = f", {text}" if self.point is not None and (text := shift.value(self.point)) else ""
            told = f"breaks at {at} of {shift.name} [{first}, {self.high:.1f}]{value}: success falls to {share}"
        return f"{told} ({count} rollouts)"

    @property
    def rising(self) -> str:
        """Whether success rises again."""
        if not self.estimate.returns[0]:
            return ""
        low, high = int(self.estimate.fallen[0]), int(self.estimate.risen[0])
        one, other = (f"{sum(self._outcomes[level])} of {len(self._outcomes[level])}" for level in (low, high))
        what = "the interval is that of the first fall" if low else "success without a shift is lower than beyond"
        return f"not monotone: {one} succeed at level {low}, {other} at level {high}; {what}"

    @property
    def exhausted(self) -> str:
        """Whether the pools have ended the search; empty if they have not."""
        left = self.chosen.budget - len(self.evaluation.episodes)
        decided = self.estimate.is_decided(self.chosen.precision, self.shift.levels)[0]
        return "" if decided or left < LOOKS_PER_ROUND else "the pools hold too few scenarios for a narrower interval"

    @property
    def plain(self) -> dict[str, Any]:
        """The result as plain data."""
        found = {
            "breaks_at": self.point,
            "low": self.low,
            "high": self.high,
            "monotone": not self.estimate.returns[0],
            "levels": [asdict(level) for level in self.levels],
        }
        return {**super().plain, "threshold": found, "drawn": dict(self.evaluation.drawn)}


def rows(results: Sequence[ThresholdResult]) -> Iterator[Mapping[str, str]]:
    """Rows of a table of all levels: the values, and for each policy n and the success rate in percent."""
    for level, one in enumerate(results[0].levels):
        row = {"level": str(level), results[0].shift.name: one.value}
        for result in results:
            name = f"{result.settings.name} " if len(results) > 1 else ""
            rate_here = result.levels[level].rate
            row |= {f"{name}n": str(rate_here.rollouts if rate_here else 0), f"{name}success": _percent(rate_here)}
        yield row


def _percent(found: Rate | None) -> str:
    return "-" if found is None else percent(found, digits=0)
