"""Certificates as data: the checks of a scenario with their numbers, so that others can disagree."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Verdict = Literal["certified", "refuted", "unknown"]
"""Result of certification. As in SMT-LIB, `unknown` is not a claim: the oracle failed, and no check shows that every
other policy must fail."""

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
"""Checks in the order in which they run, and the verdict if one fails.

A failed check refutes the scenario if the failure alone shows that the scenario is invalid: it cannot exist, does not
stand still, solves itself, or is solved by a shortcut. If only the oracle failed, the verdict is unknown.
"""

WAIVABLE = ("ablations", "attack")
"""Checks that may have nothing to check: a family without ablations, settings that request no attack."""
NOT_CHECKED = "not checked: "
"""Prefix of the reason of such a check."""

STAGES: dict[str, tuple[str, ...]] = {
    "feasible": ("feasible",),
    "compiled": ("compiles", "overlap"),
    "rested": ("rest",),
    "not trivial": ("unsolved", "idle", "shortcuts"),
    "solved": ("solved",),
    "robust": ("robust", "numerics", "ablations"),
    "certified": ("witness", "attack"),
}
"""Steps of the rejection report, and the checks that a scenario must pass to get through each step."""


@dataclass(frozen=True)
class Check:
    """One line of a certificate."""

    name: str
    """Name of the check, a key of `CHECKS`."""
    passed: bool | None
    """Whether the check passed. None if it was not made: either it was skipped, which certifies nothing, or there was
    nothing to check (see `waived`)."""
    reason: str
    """Reason why it failed or was not made; empty if it passed."""
    settings: Mapping[str, Any]
    """Settings of the check."""
    numbers: Mapping[str, Any]
    """Numbers that the check measured."""

    @property
    def waived(self) -> bool:
        """Whether there was nothing to check.

        The certificate states it, and it does not count against the scenario.
        """
        return self.passed is None and self.name in WAIVABLE and self.reason.startswith(NOT_CHECKED)


@dataclass(frozen=True)
class Certificate:
    """All checks of one scenario."""

    settings: str
    """Name of the settings of the checks, `quick` or `full`."""
    checks: tuple[Check, ...]
    """Checks in the order in which they ran."""

    def __repr__(self) -> str:
        return f"Certificate({self.summary})"

    @property
    def summary(self) -> str:
        """Verdict, and how many of the checks that were made passed."""
        made = [check.passed for check in self.checks if check.passed is not None]
        return f"{self.verdict}: {sum(made)} of {len(made)} checks passed"

    def __getitem__(self, name: str) -> Check:
        """The check of that name."""
        return next(check for check in self.checks if check.name == name)

    @property
    def failed(self) -> Check | None:
        """The first check that did not pass, or None."""
        return next((c for c in self.checks if not c.passed and not c.waived), None)

    @property
    def verdict(self) -> Verdict:
        """Verdict of the first check that did not pass, else `certified`."""
        return CHECKS[self.failed.name] if self.failed else "certified"

    @property
    def reason(self) -> str:
        """Name and reason of the first check that did not pass, or an empty text."""
        return f"{self.failed.name}: {self.failed.reason}" if self.failed else ""


@dataclass(frozen=True, repr=False)
class StoredCertificate:
    """A certificate as a pool holds it: its checks, the scene and witness that they concern, and the code used."""

    verdict: str
    """Verdict, see `Verdict`."""
    reason: str
    """Name and reason of the first check that did not pass; empty if the scenario is certified."""
    settings: str
    """Name of the settings, see `Certificate.settings`."""
    checks: tuple[Check, ...]
    """Checks in the order in which they ran."""
    scene_sha256: str
    """Hash of the scene's text."""
    witness_sha256: str
    """Hash of the witness."""
    final_state: str
    """Hash of the physics state at the end of the witness."""
    fingerprint: str
    """Fingerprint of the machine's rounding, see `scengen.work.fingerprint`."""
    task_version: int
    """Version of the task on which the certificate was made, see `Scenario.VERSION`."""
    source_sha256: str
    """Hash of the code of the family when the certificate was made. It decides nothing."""
    versions: Mapping[str, str]
    """Versions of every package that the physics depends on, and the platform."""

    def __repr__(self) -> str:
        return f"StoredCertificate({Certificate(self.settings, self.checks).summary})"

    @property
    def complete(self) -> bool:
        """Whether the verdict is `certified` and every check passed or was waived."""
        held = all(check.passed or check.waived for check in self.checks)
        return self.verdict == "certified" and bool(self.checks) and held

    @property
    def settle(self) -> float | None:
        """Time for which the goal had to hold when the witness was certified [s]; None if it is not stated."""
        found = next((check.settings.get("settle") for check in self.checks if check.name == "witness"), None)
        return found if isinstance(found, (int, float)) else None

    def plain(self) -> dict[str, Any]:
        """Plain data as a pool stores it: settings, numbers and versions as JSON text."""
        checks = [
            {**vars(check), "settings": as_json(check.settings), "numbers": as_json(check.numbers)}
            for check in self.checks
        ]
        return {**vars(self), "checks": checks, "versions": as_json(self.versions)}

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> "StoredCertificate":
        """Read the plain data of a pool; the inverse of `plain`.

        Raises:
            ValueError: a part is missing or is not canonical JSON.
        """
        if gaps := [name for name, value in plain.items() if value is None]:
            raise ValueError(f"the certificate lacks {', '.join(gaps)}")
        checks = tuple(
            Check(**{**check, "settings": from_json(check["settings"]), "numbers": from_json(check["numbers"])})
            for check in plain["checks"]
        )
        return cls(**{**plain, "checks": checks, "versions": from_json(plain["versions"])})


def as_json(values: Mapping[str, Any]) -> str:
    """Canonical JSON text of a mapping, as pools store it: equal mappings give equal texts."""
    return json.dumps(values, sort_keys=True)


def from_json(text: str) -> dict[str, Any]:
    """Read a text that `as_json` wrote.

    Raises:
        ValueError: the text is not what `as_json` writes for a mapping.
    """
    try:
        values = json.loads(text)
    except (TypeError, ValueError):
        values = None
    if not isinstance(values, dict) or as_json(values) != text:
        raise ValueError(f"{str(text)[:60]!r} is not a mapping in canonical JSON")
    return values
