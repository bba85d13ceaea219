"""What the checks of an episode find: findings, the report of an episode, and its JSON schema."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

Severity = Literal["error", "warning"]
"""`error`: the episode stays out unless a person accepts it. `warning`: worth a look, and no reason to stay out."""


@dataclass(frozen=True)
class Finding:
    """One fault of an episode."""

    check: str
    """Name of the check; names of lerobot-lint where it has the same rule."""
    severity: Severity
    frames: tuple[int, ...]
    """First and last frame concerned; empty if all are."""
    numbers: Mapping[str, float]
    """Measured numbers, and the thresholds that they exceed."""
    explanation: str


@dataclass(frozen=True)
class EpisodeReport:
    """Result of stages 1 and 2 for one episode."""

    episode: int
    scenario: str
    task: str
    style: str
    """Style of a demonstration; empty for a witness."""
    score: int
    """Score from 1 to 5."""
    scored_by: str
    """`terms`, or `person` if scores.csv has the score."""
    terms: Mapping[str, float]
    """Measured terms of the score."""
    checks: tuple[str, ...]
    """Names of the checks that were made."""
    findings: tuple[Finding, ...]

    @property
    def flagged(self) -> bool:
        """Whether a finding keeps the episode out unless a person accepts it."""
        return any(finding.severity == "error" for finding in self.findings)

    def plain(self) -> dict[str, Any]:
        """Plain data, as `SCHEMA` describes it."""
        plain = asdict(self)
        plain["checks"] = list(self.checks)
        plain["findings"] = [{**asdict(f), "frames": list(f.frames)} for f in self.findings]
        return plain


_NUMBERS = {"type": "object", "additionalProperties": {"type": "number"}}
_FINDING = {
    "type": "object",
    "required": ["check", "severity", "frames", "numbers", "explanation"],
    "additionalProperties": False,
    "properties": {
        "check": {"type": "string"},
        "severity": {"enum": ["error", "warning"]},
        "frames": {"type": "array", "items": {"type": "integer", "minimum": 0}, "maxItems": 2},
        "numbers": _NUMBERS,
        "explanation": {"type": "string"},
    },
}
SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "EpisodeReport",
    "type": "object",
    "required": [*EpisodeReport.__dataclass_fields__],
    "additionalProperties": False,
    "properties": {
        "episode": {"type": "integer", "minimum": 0},
        "scenario": {"type": "string"},
        "task": {"type": "string"},
        "style": {"type": "string"},
        "score": {"type": "integer", "minimum": 1, "maximum": 5},
        "scored_by": {"enum": ["terms", "person"]},
        "terms": _NUMBERS,
        "checks": {"type": "array", "items": {"type": "string"}},
        "findings": {"type": "array", "items": _FINDING},
    },
}
"""JSON schema of an `EpisodeReport`."""
