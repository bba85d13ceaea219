"""Findings of the checks of an episode: findings, the report of an episode, and its JSON schema."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from ...errors import PoolError
from ...pool.untrusted import check_text, check_whole, demand, read_json
from ...work.plain import read_plain

REPORTS = "reports.jsonl"
"""File of the reports of a curation."""
Severity = Literal["error", "warning"]
"""`error`: the episode stays out unless a person accepts it. `warning`: worth a look, and no reason to stay out."""
MAX_REPORTS = 1_000_000_000
"""Size of the largest file of reports that is read [bytes]: ten thousand episodes have 20 MB."""


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


def read_reports(path: Path) -> list[EpisodeReport]:
    """The reports in a file that `curate` has written.

    Raises:
        PoolError: it does not exist, or it holds something else.
    """
    if not path.exists():
        raise PoolError(f"no reports at {path}; run scengen curate first")
    try:
        return [_report(read_json(line)) for line in read_plain(path, MAX_REPORTS).decode().splitlines()]
    except (OSError, ValueError, TypeError, KeyError) as error:
        why = " ".join(str(error).split())[:120]
        raise PoolError(f"{path} is damaged ({why}); run scengen curate again") from None


def _report(plain: Any) -> EpisodeReport:
    """A report from its plain data.

    Raises:
        ValueError, TypeError, KeyError: it is none.
    """
    findings = []
    for one in plain["findings"]:
        frames = tuple(one["frames"])
        for frame in frames:
            check_whole("a frame", frame)
        demand(one["severity"] in ("error", "warning"), "a severity is neither error nor warning")
        for name in ("check", "explanation"):
            check_text(name, one[name])
        findings.append(Finding(**{**one, "frames": frames}))
    check_whole("episode", plain["episode"])
    check_whole("score", plain["score"], 5)
    for name in ("scenario", "task", "style", "scored_by"):
        check_text(name, plain[name])
    return EpisodeReport(**{**plain, "checks": tuple(plain["checks"]), "findings": tuple(findings)})


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
