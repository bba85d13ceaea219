"""Certificates as data: what was checked about a scenario, with numbers, so that others can disagree."""

import json
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
    "attack": "refuted",
}
"""The checks in the order in which they run, and the verdict when one fails.

A failed check refutes the scenario where it shows, by itself, that the scenario is invalid: it cannot be, it does not
stand still, it solves itself, or a shortcut solves it. Where only the oracle failed the verdict is unknown."""

WAIVABLE = ("ablations", "attack")
"""Checks that may have nothing to check: a family without ablations, settings that ask for no attack."""
NOT_CHECKED = "not checked: "
"""How the reason of such a check begins."""

STAGES: dict[str, tuple[str, ...]] = {
    "feasible": ("feasible",),
    "compiled": ("compiles", "overlap"),
    "rested": ("rest",),
    "not trivial": ("unsolved", "idle", "shortcuts"),
    "solved": ("solved",),
    "robust": ("robust", "numerics", "ablations"),
    "certified": ("witness", "attack"),
}
"""Steps of the funnel, and the checks that a scenario must pass to get through each."""


@dataclass(frozen=True)
class Check:
    """One line of a certificate."""

    name: str
    passed: bool | None
    """None: not made. It was skipped, which certifies nothing, or there was nothing to check, see `waived`."""
    reason: str
    """Why it failed or was not made; empty when it passed."""
    settings: Mapping[str, Any]
    numbers: Mapping[str, Any]

    @property
    def waived(self) -> bool:
        """Whether there was nothing to check, which is told and stands against nothing."""
        return self.passed is None and self.name in WAIVABLE and self.reason.startswith(NOT_CHECKED)


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
        return next((c for c in self.checks if not c.passed and not c.waived), None)

    @property
    def verdict(self) -> Verdict:
        return CHECKS[self.failed.name] if self.failed else "certified"

    @property
    def reason(self) -> str:
        """What stands against the scenario, or nothing."""
        return f"{self.failed.name}: {self.failed.reason}" if self.failed else ""


@dataclass(frozen=True)
class StoredCertificate:
    """A certificate as a pool holds it: its checks, what they speak of, and what they were made with."""

    verdict: str
    reason: str
    settings: str
    """See `Certificate`."""
    checks: tuple[Check, ...]
    scene_sha256: str
    witness_sha256: str
    final_state: str
    """Hash of the physics state at the end of the witness."""
    fingerprint: str
    """How the machine rounds that made it; see `scengen.validate.identity`."""
    source_sha256: str
    """Hash of the code that gives the family its meaning."""
    versions: Mapping[str, str]
    """Of every package that the physics depends on, and the platform."""

    @property
    def complete(self) -> bool:
        """Whether it says `certified`, and every check passed or had nothing to check."""
        held = all(check.passed or check.waived for check in self.checks)
        return self.verdict == "certified" and bool(self.checks) and held

    @property
    def settle(self) -> float | None:
        """How long the goal had to hold when the witness was certified [s]; None if the certificate does not say."""
        found = next((check.settings.get("settle") for check in self.checks if check.name == "witness"), None)
        return found if isinstance(found, (int, float)) else None

    def plain(self) -> dict[str, Any]:
        """Plain data, as a pool stores it: settings, numbers and versions as JSON text."""
        checks = [
            {**vars(check), "settings": as_json(check.settings), "numbers": as_json(check.numbers)}
            for check in self.checks
        ]
        return {**vars(self), "checks": checks, "versions": as_json(self.versions)}

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> "StoredCertificate":
        """The reverse of `plain`.

        Raises:
            ValueError: a part is missing or no canonical JSON.
        """
        if gaps := [name for name, value in plain.items() if value is None]:
            raise ValueError(f"the certificate lacks {', '.join(gaps)}")
        checks = tuple(
            Check(**{**check, "settings": from_json(check["settings"]), "numbers": from_json(check["numbers"])})
            for check in plain["checks"]
        )
        return cls(**{**plain, "checks": checks, "versions": from_json(plain["versions"])})


def as_json(values: Mapping[str, Any]) -> str:
    """The one way in which pools write a mapping: equal mappings are equal texts."""
    return json.dumps(values, sort_keys=True)


def from_json(text: str) -> dict[str, Any]:
    """Read what `as_json` wrote.

    Raises:
        ValueError: the text is not what `as_json` writes for a mapping.
    """
    try:
        values = json.loads(text)
    except (TypeError, ValueError):
        values = None
    if not isinstance(values, dict) or as_json(values) != text:
        raise ValueError(f"{str(text)[:60]!r} is no mapping in canonical JSON")
    return values
