"""Remarks of a model about the episodes of a recording. It may add findings, and never removes one.

Answers are kept in `curation/remarks.jsonl`, by the hash of what was asked, so that a repeated curation asks nothing
again. An answer that does not follow the schema gives no remark, and is counted.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...agents.models import Model, Turn
from ...agents.replies import read_json
from ...errors import ScengenError
from ...pool.files import sha256
from ...work.log import Log
from ...work.typed import typed
from .findings import EpisodeReport, Finding

REMARK = "REMARK"
"""Check of a remark. Remarks are warnings: no episode stays out because of a model alone."""
MAX_REMARKS = 10
"""Largest number of remarks about an episode that are read."""
MAX_TEXT = 500
"""Largest length of a remark that is kept [characters]."""
SYSTEM = """You review recorded demonstrations of a robot arm before they are used for training. You get the report of \
one episode: measured terms, the checks that were made, and their findings. Reply with JSON: remarks about faults that \
a person should look at, each with the first and last frame concerned. No remark is a good answer if nothing is wrong. \
You cannot withdraw a finding."""
"""Prompt that describes the task to the model."""
SCHEMA: dict[str, Any] = {
    "title": "remarks",
    "type": "object",
    "required": ["remarks"],
    "additionalProperties": False,
    "properties": {
        "remarks": {
            "type": "array",
            "maxItems": MAX_REMARKS,
            "items": {
                "type": "object",
                "required": ["first", "last", "text"],
                "additionalProperties": False,
                "properties": {
                    "first": {"type": "integer", "minimum": 0},
                    "last": {"type": "integer", "minimum": 0},
                    "text": {"type": "string", "minLength": 1},
                },
            },
        }
    },
}
"""JSON schema of an answer."""


@dataclass(frozen=True)
class Remark:
    """One remark of an answer."""

    first: int
    """First frame concerned."""
    last: int
    """Last frame concerned."""
    text: str


@dataclass(frozen=True)
class Answer:
    """An answer of the model."""

    remarks: list[Remark]


def with_remarks(
    reports: Sequence[EpisodeReport], frames: Sequence[int], model: Model, name: str, folder: Path
) -> tuple[list[EpisodeReport], int]:
    """The reports with a model's remarks, and the number of answers without a meaning.

    Args:
        frames: numbers of rows of the episodes.
        name: name of the model; answers of another model are not used.
        folder: folder of the kept answers.

    Raises:
        ScengenError: the model cannot be reached, or the kept answers cannot be read.
    """
    found, bad = [], 0
    with Log(folder / "remarks.jsonl", {"model": name, "system": SYSTEM}, "move it aside to ask this model") as log:
        known = {str(record["asked"]): str(record["answer"]) for record in log.records}
        for report, rows in zip(reports, frames, strict=True):
            text = json.dumps({**report.plain(), "frames": rows}, sort_keys=True)
            asked = sha256(text)
            if asked not in known:
                reply = model.reply([Turn("system", SYSTEM), Turn("user", text)], (), SCHEMA, 0.0, 0)
                log.add({"asked": asked, "answer": reply.text})
                known[asked] = reply.text
            remarks = _read(known[asked], rows)
            bad += remarks is None
            found.append(replace(report, findings=(*report.findings, *(remarks or ()))))
    return found, bad


def _read(answer: str, rows: int) -> tuple[Finding, ...] | None:
    """The remarks of an answer; None if it does not follow the schema, or names frames that do not exist."""
    try:
        told = typed("", Answer, read_json(answer), exact=True).remarks
    except (ScengenError, RecursionError):
        return None
    if len(told) > MAX_REMARKS or any(not 0 <= one.first <= one.last < rows for one in told):
        return None
    return tuple(Finding(REMARK, "warning", (one.first, one.last), {}, one.text[:MAX_TEXT]) for one in told)
