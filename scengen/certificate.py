"""Certificates as data: what was checked about a scenario, with numbers, so that others can disagree."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Verdict = Literal["certified", "refuted", "unknown"]
"""`unknown` is no claim, as in SMT-LIB: the oracle failed, and nobody has shown that all others must."""

CHECKS: dict[str, Verdict] = {
    "feasible": "refuted",
    "compiles": "refuted",
    "overlap": "refuted",
    "rest": "refuted",
    "unsolved": "refuted",
    "idle": "refuted",
    "shortcuts": "refuted",
    "solved": "unknown",
    "robust": "unknown",
    "numerics": "unknown",
    "ablations": "refuted",
    "witness": "unknown",
}
"""The checks in the order in which they run, and the verdict when one fails.

A failed check refutes the scenario where it shows, by itself, that the scenario is invalid: it cannot be, it does not
stand still, it solves itself, or it has an easy way. Where only the oracle failed the verdict is unknown."""


@dataclass(frozen=True)
class Check:
    """One line of a certificate."""

    name: str
    passed: bool | None
    """None: skipped, which certifies nothing."""
    reason: str
    """Why it failed or was skipped; empty when it passed."""
    settings: Mapping[str, Any]
    numbers: Mapping[str, Any]


@dataclass(frozen=True)
class Certificate:
    """All checks of one scenario."""

    settings: str
    """Name of the settings of the checks, `quick` or `full`."""
    checks: tuple[Check, ...]

    def __getitem__(self, name: str) -> Check:
        """The check of that name."""
        return next(check for check in self.checks if check.name == name)

    @property
    def failed(self) -> Check | None:
        """The first check that did not pass."""
        return next((c for c in self.checks if not c.passed), None)

    @property
    def verdict(self) -> Verdict:
        return CHECKS[self.failed.name] if self.failed else "certified"

    @property
    def reason(self) -> str:
        """What stands against the scenario, or nothing."""
        return f"{self.failed.name}: {self.failed.reason}" if self.failed else ""
