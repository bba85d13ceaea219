"""Cues that a task's author knows: `conf/cues/<task>.yaml`, by decision, next to the folder of the task file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import yaml

from ...errors import BadConfig, UnknownName
from ...samplers.task_files import file_of_group
from ...work.typed import typed
from .audit import DecisionAudit

GONE = 0.6
"""Share of right answers below which a stated cue counts as gone: well below `audit.REVEALED`, because draws vary."""
STATUSES = ("known", "accepted")
"""What a task's author says of a cue: it is to be removed, or it stays for a reason."""


@dataclass(frozen=True)
class Stated:
    """What the author says of the cue that reveals one decision."""

    status: str
    """One of `STATUSES`."""
    why: str
    """Which cue it is; for an accepted one the reason."""


@dataclass(frozen=True)
class Compared:
    """Findings of an audit against what the author states."""

    stated: Mapping[str, Stated] = field(default_factory=dict)
    """Statements by decision."""
    new: Sequence[str] = ()
    """Decisions that a cue reveals and that are not stated."""
    gone: Sequence[str] = ()
    """Decisions that are stated and that no cue reveals any more."""


def stated(task: str, search: Sequence[str] = ()) -> dict[str, Stated]:
    """Statements of a task by decision; none without a file.

    Raises:
        ScengenError: the file is not as described here.
    """
    path = file_of_group(task, "cues", search)
    if path is None:
        return {}
    try:
        node = yaml.safe_load(path.read_text()) or {}
    except yaml.YAMLError as error:
        raise BadConfig(f"{path} is not YAML: {' '.join(str(error).split())}; correct it") from None
    if not isinstance(node, Mapping) or not all(isinstance(inner, Mapping) for inner in node.values()):
        raise BadConfig(f"{path} holds no decisions with status and why")
    found = {str(name): typed(f"cues.{task}.{name}", Stated, inner) for name, inner in node.items()}
    for name, one in found.items():
        if one.status not in STATUSES:
            raise UnknownName(f"status of cues.{task}.{name}", one.status, STATUSES)
    return found


def compared(found: Sequence[DecisionAudit], known: Mapping[str, Stated]) -> Compared:
    """Compare the findings of an audit with what is stated."""
    new = [one.decision for one in found if one.revealed and one.decision not in known]
    left = [one.decision for one in found if one.best.share >= GONE]
    return Compared(known, new, [name for name in known if name not in left])
