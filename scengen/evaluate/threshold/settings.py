"""Settings of a search for the level at which a policy breaks."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from ...errors import BadConfig
from ...work.limits import at_least
from ..arms import NONE
from ..settings import EvaluateSettings
from .shift import MAX_LEVELS

SEED = 7400
"""Seed of the draws: none that people take for training, and not that of editions or of the arm `benign`."""
MAX_BUDGET = 10_000
"""Largest number of rollouts: pools for them are drawn in advance."""


@dataclass(frozen=True)
class ThresholdSettings(EvaluateSettings):
    """Settings of `scengen evaluate threshold`; conf/command/evaluate_threshold.yaml explains them."""

    task: str = ""
    along: str = ""
    budget: int = 60
    precision: float = 1.0
    success: float = 0.5
    levels: int | None = None
    seed: int = SEED
    rollouts: int = 1
    arms: str | list[str] = NONE

    @property
    def folder(self) -> Path:
        """Folder of the results; for several policies, that of their comparison."""
        return (
            Path(self.to) if self.to else Path("generated/threshold", f"{self.task}-{self.along}", super().folder.name)
        )

    @property
    def design(self) -> Mapping[str, Any]:
        """Settings that decide which rollouts are played."""
        return {name: getattr(self, name) for name in ("task", "along", "success", "levels", "seed")}

    def check(self) -> None:
        """Raise `ScengenError` if a setting is not valid."""
        super().check()
        at_least(self, seed=0)
        for name, low, high in (("success", 0.05, 0.95), ("precision", 0.1, float(MAX_LEVELS))):
            if not low <= (value := getattr(self, name)) <= high:
                raise BadConfig(f"{name} = {value:g}; it must lie in [{low:g}, {high:g}]")
        for name, low, high in (("budget", 1, MAX_BUDGET), ("levels", 2, MAX_LEVELS)):
            if (value := getattr(self, name)) is not None and not low <= value <= high:
                raise BadConfig(f"{name} = {value}; it must lie in [{low}, {high}]")
        if (self.rollouts, self.arms, self.splits, self.seeds) != (1, NONE, "all", None):
            raise BadConfig("a search for a threshold plays each scenario once, without arms: leave them out")


NAMES = {field.name for field in fields(ThresholdSettings)} - {field.name for field in fields(EvaluateSettings)}
"""Settings that an evaluation without a search does not have."""
